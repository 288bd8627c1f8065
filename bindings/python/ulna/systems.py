"""Linear systems in continuous time: rational functions, proper or not, and state space.

`TransferFunction` and `StateSpace` are what the passivity of general models is judged on. Systems of
python-control and scipy.signal are taken as they are (`as_system`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._call import ArgumentError, Handle, check, ffi, lib, out_array, result, view
from .record import refuse

__all__ = ["LinearSystem", "StateSpace", "TransferFunction", "as_system", "impedance"]

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


class _System(Handle):
    kind = "ulna_system"
    __slots__ = ()


class LinearSystem:
    """What `TransferFunction` and `StateSpace` share: response, poles, zeros, sums and products."""

    _handle: _System

    @classmethod
    def _own(cls, handle: _System) -> LinearSystem:
        info = result("ulna_system_info")
        check(lib.ulna_system_get_info(handle.pointer, info))
        made: LinearSystem = object.__new__(TransferFunction if info.rational else StateSpace)
        made._handle = handle
        return made

    def _info(self) -> Any:
        info = result("ulna_system_info")
        check(lib.ulna_system_get_info(self._handle.pointer, info))
        return info

    def _values(self, which: int) -> Array:
        return out_array(lib.ulna_system_get_values, self._handle.pointer, which)

    @property
    def outputs(self) -> int:
        """Number of outputs."""
        return int(self._info().outputs)

    @property
    def inputs(self) -> int:
        """Number of inputs."""
        return int(self._info().inputs)

    @property
    def is_proper(self) -> bool:
        """Whether the response stays bounded towards infinite frequency."""
        return bool(self._info().proper)

    def poles(self) -> ComplexArray:
        """Poles of every entry, or eigenvalues of the state space: modes that cancel are among them.

        Examples
        --------
        >>> TransferFunction([1, 0], [1, 0.2, 1]).poles().round(3)
        array([-0.1-0.995j, -0.1+0.995j])
        """
        return self._values(lib.ULNA_SYSTEM_POLES).view(np.complex128)

    def zeros(self) -> ComplexArray:
        """Finite zeros: roots of the numerator, or where a square matrix is singular.

        Examples
        --------
        >>> TransferFunction([1, 3], [1, 3, 2]).zeros()
        array([-3.+0.j])
        """
        return self._values(lib.ULNA_SYSTEM_ZEROS).view(np.complex128)

    def frequency_response(self, omega_rad_s: ArrayLike) -> ComplexArray:
        """H(j omega): the shape of `omega_rad_s` for one input and output, else (..., out, in).

        Examples
        --------
        >>> TransferFunction([1], [1, 1]).frequency_response([0, 1])
        array([1. +0.j , 0.5-0.5j])
        """
        omega = np.asarray(omega_rad_s, dtype=float)
        flat = out_array(lib.ulna_system_respond, self._handle.pointer, view(omega.ravel()))
        shape = (self.outputs, self.inputs)
        values = flat.view(np.complex128).reshape(*omega.shape, *shape)
        return values[..., 0, 0] if shape == (1, 1) else values

    def to_state_space(self) -> StateSpace:
        """A realisation; what is improper needs a singular E.

        Examples
        --------
        >>> TransferFunction([2], [1, 3]).to_state_space().A
        array([[-3.]])
        """
        return _converted(self, lib.ULNA_FORM_STATE_SPACE)

    def to_transfer_function(self) -> TransferFunction:
        """Rational functions; modes that an entry does not show cancel.

        Examples
        --------
        >>> StateSpace([[-3.0]], [[1.0]], [[2.0]], [[0.0]]).to_transfer_function()
        TransferFunction([2], [1, 3])
        """
        return _converted(self, lib.ULNA_FORM_RATIONAL)

    def feedback(self, other: Any) -> LinearSystem:
        """The loop (I + self other)^-1 self: `other` feeds back and is subtracted.

        Examples
        --------
        >>> TransferFunction([1], [1, 0]).feedback(TransferFunction([2], [1]))
        TransferFunction([1], [1, 2])
        """
        return _combined(self, other, lib.ULNA_COMBINE_LOOP)

    def __add__(self, other: Any) -> LinearSystem:
        return _combined(self, other, lib.ULNA_COMBINE_PARALLEL)

    def __radd__(self, other: Any) -> LinearSystem:
        return _combined(other, self, lib.ULNA_COMBINE_PARALLEL)

    def __mul__(self, other: Any) -> LinearSystem:
        return _combined(self, other, lib.ULNA_COMBINE_SERIES)

    def __rmul__(self, other: Any) -> LinearSystem:
        return _combined(other, self, lib.ULNA_COMBINE_SERIES)

    def __neg__(self) -> LinearSystem:
        return _gain(-1.0, self.outputs) * self

    def __sub__(self, other: Any) -> LinearSystem:
        return self + -_operand(other, self)

    def __rsub__(self, other: Any) -> LinearSystem:
        return _operand(other, self) + -self

    # NumPy would otherwise add a system to every entry of an array.
    __array_ufunc__ = None


class TransferFunction(LinearSystem):
    """A rational function of s, or a matrix of them, with real coefficients.

    Parameters
    ----------
    num, den
        Coefficients, highest power first. For a matrix, rows of entries: ``num[i][j]`` holds the
        coefficients from input j to output i; `den` likewise, or one list for all entries. The
        numerator may have the higher degree.

    Examples
    --------
    A mass, a damper and a spring, from velocity to force:

    >>> z = TransferFunction([1.5, 6.0, 40.0], [1, 0])
    >>> z.is_proper
    False
    >>> z + TransferFunction([2], [1])
    TransferFunction([1.5, 8, 40], [1, 0])
    """

    def __init__(self, num: Any, den: Any) -> None:
        numerators = _entries(num, "num")
        shape = len(numerators), len(numerators[0])
        if _depth(den) < 3:
            common = _coefficients(den, "den")
            denominators = [[common] * shape[1] for _ in range(shape[0])]
        else:
            denominators = _entries(den, "den")
        if (len(denominators), len(denominators[0])) != shape:
            raise refuse(
                f"den is a matrix of {len(denominators)} x {len(denominators[0])} entries and num "
                f"one of {shape[0]} x {shape[1]}",
                "den",
            )
        self._handle = _System.make(
            lib.ulna_system_new_rational,
            view(_table(numerators)),
            view(_table(denominators)),
            *shape,
        )

    def _polynomials(self, which: int) -> list[list[Array]]:
        rows = self._values(which).reshape(self.outputs, self.inputs, -1)
        return [[_trimmed(entry) for entry in row] for row in rows]

    @property
    def num(self) -> Any:
        """Coefficients of the numerator; rows of them for a matrix."""
        every = self._polynomials(lib.ULNA_SYSTEM_NUM)
        return every[0][0] if self.outputs == self.inputs == 1 else every

    @property
    def den(self) -> Any:
        """Coefficients of the denominator; rows of them for a matrix."""
        every = self._polynomials(lib.ULNA_SYSTEM_DEN)
        return every[0][0] if self.outputs == self.inputs == 1 else every

    def __reduce__(self) -> tuple[Any, ...]:
        return TransferFunction, (
            self._polynomials(lib.ULNA_SYSTEM_NUM),
            self._polynomials(lib.ULNA_SYSTEM_DEN),
        )

    def __repr__(self) -> str:
        if self.outputs == self.inputs == 1:
            return f"TransferFunction({_listed(self.num)}, {_listed(self.den)})"
        return f"<TransferFunction {self.outputs} x {self.inputs}>"


class StateSpace(LinearSystem):
    """E x' = A x + B u, y = C x + D u.

    Parameters
    ----------
    A, B, C, D : array_like
        Of n states, so A is n x n, B n x inputs, C outputs x n, D outputs x inputs.
    E : array_like, optional
        n x n; the identity unless given. A singular E allows improper systems.

    Examples
    --------
    A mass of 1.5 kg on a spring of 40 N/m and a damper of 6 N s/m, from force to velocity:

    >>> y = StateSpace([[0, 1], [-40 / 1.5, -4]], [[0], [1 / 1.5]], [[0, 1]], [[0]])
    >>> y.poles().round(2)
    array([-2.+4.76j, -2.-4.76j])
    """

    def __init__(
        self, A: ArrayLike, B: ArrayLike, C: ArrayLike, D: ArrayLike, *, E: ArrayLike | None = None
    ) -> None:
        direct = np.atleast_2d(_real(D, "D"))
        outputs, inputs = direct.shape
        state = _matrix(A, "A", (0, 0))
        parts = [
            state,
            _matrix(B, "B", (state.shape[0], inputs)),
            _matrix(C, "C", (outputs, state.shape[0])),
            direct,
        ]
        descriptor = ffi.NULL if E is None else view(_matrix(E, "E", (0, 0)))
        self._handle = _System.make(
            lib.ulna_system_new_state_space, *[view(part) for part in parts], descriptor
        )

    def _matrix(self, which: int, rows: int, columns: int) -> Array:
        return self._values(which).reshape(rows, columns)

    @property
    def states(self) -> int:
        """Number of states."""
        return int(self._info().states)

    @property
    def A(self) -> Array:
        """States x states."""
        return self._matrix(lib.ULNA_SYSTEM_A, self.states, self.states)

    @property
    def B(self) -> Array:
        """States x inputs."""
        return self._matrix(lib.ULNA_SYSTEM_B, self.states, self.inputs)

    @property
    def C(self) -> Array:
        """Outputs x states."""
        return self._matrix(lib.ULNA_SYSTEM_C, self.outputs, self.states)

    @property
    def D(self) -> Array:
        """Outputs x inputs."""
        return self._matrix(lib.ULNA_SYSTEM_D, self.outputs, self.inputs)

    @property
    def E(self) -> Array:
        """States x states; the identity unless given."""
        values = self._values(lib.ULNA_SYSTEM_E)
        return values.reshape(self.states, self.states) if values.size else np.eye(self.states)

    def __reduce__(self) -> tuple[Any, ...]:
        return _again, (self.A, self.B, self.C, self.D, self.E)

    def __repr__(self) -> str:
        return f"<StateSpace {self.outputs} x {self.inputs}, {self.states} states>"


def _again(a: Array, b: Array, c: Array, d: Array, e: Array) -> StateSpace:
    return StateSpace(a, b, c, d, E=e)


def impedance(M: ArrayLike, B: ArrayLike, K: ArrayLike) -> TransferFunction:
    """Z(s) = M s + B + K / s, from velocity to the force that it takes; n x n.

    Examples
    --------
    >>> impedance(1.5, 6.0, 40.0)
    TransferFunction([1.5, 6, 40], [1, 0])
    """
    parts = [np.atleast_2d(_real(part, name)) for part, name in ((M, "M"), (B, "B"), (K, "K"))]
    n = parts[0].shape[0]
    if any(part.shape != (n, n) for part in parts):
        raise refuse("M, B and K must be square and of one size", "M")
    return TransferFunction(np.stack(parts, axis=-1), [1.0, 0.0])


def as_system(system: Any) -> LinearSystem:
    """A system of this module from one of python-control or scipy.signal, or from an estimate.

    Taken are objects with ``num`` and ``den``, with ``A``, ``B``, ``C`` and ``D``, or with
    ``to_tf`` (zeros, poles and gain); a discrete-time one (``dt`` above 0) is refused. An
    `ulna.ImpedanceEstimate` becomes M s + B + K / s as it stands. A number or matrix is a gain.

    Examples
    --------
    >>> import scipy.signal
    >>> as_system(scipy.signal.lti([1.0, 2.0], [1.0, 3.0, 5.0]))
    TransferFunction([1, 2], [1, 3, 5])
    """
    if isinstance(system, LinearSystem):
        return system
    if all(hasattr(system, name) for name in ("M", "B", "K", "x0")):
        return impedance(system.M, system.B, system.K)
    _refuse_discrete(system)
    if all(hasattr(system, name) for name in ("num_list", "den_list")):
        return TransferFunction(system.num_list, system.den_list)
    if all(hasattr(system, name) for name in ("num", "den")):
        return TransferFunction(_of_outputs(system.num), system.den)
    if all(hasattr(system, name) for name in "ABCD"):
        return StateSpace(system.A, system.B, system.C, system.D)
    if hasattr(system, "to_tf"):
        return as_system(system.to_tf())
    try:
        gain = np.empty(0) if isinstance(system, str) else np.asarray(system, dtype=float)
    except (TypeError, ValueError):
        gain = np.empty(0)
    if gain.ndim in (0, 2) and gain.size and np.all(np.isfinite(gain)):
        return TransferFunction(np.atleast_2d(gain)[..., None], [1.0])
    raise refuse(
        f"expected a linear system, got {type(system).__name__}: use ulna.TransferFunction, "
        "ulna.StateSpace, or one of python-control or scipy.signal",
        "system",
    )


# Inside ------------------------------------------------------------------------------------------


def _refuse_discrete(system: Any) -> None:
    step = getattr(system, "dt", None)
    # None and 0 mean continuous (python-control, scipy.signal); True is a step not said.
    if step is None or (not isinstance(step, bool) and step == 0):
        return
    raise refuse(
        "the system is in discrete time; passivity is judged in continuous time: convert it "
        "first, for example with a bilinear (Tustin) transformation",
        "system",
    )


def _of_outputs(num: Any) -> Any:
    """scipy.signal keeps the numerators of several outputs as rows."""
    if isinstance(num, np.ndarray) and num.ndim == 2:
        return [[row] for row in num]
    return num


def _depth(values: Any) -> int:
    if isinstance(values, np.ndarray):
        inner = _depth(values.flat[0]) if values.dtype == object and values.size else 0
        return values.ndim + inner
    if isinstance(values, Sequence) and not isinstance(values, str):
        return 1 + (_depth(values[0]) if len(values) else 0)
    return 0


def _real(values: Any, name: str) -> Array:
    try:
        array = np.asarray(values)
        if array.dtype.kind == "c":
            raise refuse(f"{name} holds complex numbers; coefficients must be real", name)
        return array.astype(np.float64)
    except ArgumentError:
        raise
    except (TypeError, ValueError):
        raise refuse(f"{name} must hold real numbers", name) from None


def _coefficients(values: Any, name: str) -> Array:
    array = np.atleast_1d(_real(values, name))
    if array.ndim != 1:
        raise refuse(
            f"{name} is nested twice: give one list of coefficients, or for a matrix rows of "
            "entries that are lists of coefficients",
            name,
        )
    if array.size == 0:
        raise refuse(f"{name} has no coefficient", name)
    return array


def _entries(values: Any, name: str) -> list[list[Array]]:
    if _depth(values) < 3:
        return [[_coefficients(values, name)]]
    rows = [[_coefficients(entry, name) for entry in row] for row in values]
    if not rows or not rows[0] or any(len(row) != len(rows[0]) for row in rows):
        raise refuse(f"the rows of {name} must have the same number of entries", name)
    return rows


def _table(rows: list[list[Array]]) -> Array:
    entries = [entry for row in rows for entry in row]
    table = np.zeros((len(entries), max(entry.size for entry in entries)))
    for line, entry in zip(table, entries, strict=True):
        line[line.size - entry.size :] = entry
    return table


def _matrix(values: Any, name: str, empty: tuple[int, int]) -> Array:
    array = _real(values, name)
    if array.size == 0:
        return np.zeros(empty)
    return np.atleast_2d(array)


def _trimmed(entry: Array) -> Array:
    nonzero = np.flatnonzero(entry)
    return entry[nonzero[0] :] if nonzero.size else entry[-1:]


def _listed(coefficients: Array) -> str:
    return "[" + ", ".join(f"{value:.6g}" for value in coefficients) + "]"


def _gain(value: float, size: int) -> TransferFunction:
    return TransferFunction((value * np.eye(size))[..., None], [1.0])


def _operand(value: Any, beside: LinearSystem) -> LinearSystem:
    if isinstance(value, int | float | np.number) and math.isfinite(float(value)):
        if beside.outputs == beside.inputs:
            return _gain(float(value), beside.outputs)
    return as_system(value)


def _combined(first: Any, second: Any, how: int) -> LinearSystem:
    beside = first if isinstance(first, LinearSystem) else second
    x, y = _operand(first, beside), _operand(second, beside)
    made = _System.make(lib.ulna_system_combine, x._handle.pointer, y._handle.pointer, how)
    return LinearSystem._own(made)


def _converted(system: LinearSystem, form: int) -> Any:
    made = _System.make(lib.ulna_system_convert, system._handle.pointer, form)
    return LinearSystem._own(made)
