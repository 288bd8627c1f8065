"""General linear models: transfer functions in continuous time and measured frequency responses.

``identify_transfer_function`` estimates G(s) = B(s)/A(s) exp(-s delay) from sampled signals by the
simplified refined instrumental variable method, ``select_order`` finds out how many poles and zeros
the data support, and ``frf`` measures the frequency response without a model.
"""

from __future__ import annotations

import warnings as _warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ._call import Handle, check, ffi, lib, long_call, options, out_array, result, text, view
from ._frf import ResponseEstimate, frf
from ._ports import Ports, Word, ports
from .record import pick, refuse

if TYPE_CHECKING:
    from .systems import TransferFunction

__all__ = [
    "OrderCandidate",
    "OrderSelection",
    "ResponseEstimate",
    "TransferFunctionEstimate",
    "Validation",
    "frf",
    "identify_transfer_function",
    "select_order",
    "simulate",
]

_METHODS = {"srivc": lib.ULNA_MODEL_SRIVC, "oe": lib.ULNA_MODEL_OUTPUT_ERROR}
_HOLDS = {"zoh": lib.ULNA_HOLD_ZERO, "foh": lib.ULNA_HOLD_LINEAR}
_OUTCOMES = {
    lib.ULNA_MODEL_GOOD: "good",
    lib.ULNA_MODEL_NOT_CONVERGED: "not_converged",
    lib.ULNA_MODEL_UNSTABLE: "unstable",
    lib.ULNA_MODEL_ILL_CONDITIONED: "ill_conditioned",
    lib.ULNA_MODEL_UNEXPLAINED: "unexplained",
}
_CRITERIA = {
    "held-out": lib.ULNA_ORDER_HELD_OUT,
    "bic": lib.ULNA_ORDER_BIC,
    "aicc": lib.ULNA_ORDER_AICC,
    "yic": lib.ULNA_ORDER_YIC,
}
_STATES = ("free", "fixed", "at its bound")


class _Model(Handle):
    kind = "ulna_model"
    __slots__ = ()


class _OrderSearch(Handle):
    kind = "ulna_order_search"
    __slots__ = ()


# The estimate -------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Validation:
    """How well a model predicts another recording, with its own initial state and offset there.

    Attributes
    ----------
    vaf : float
        Percent of the output's variance that is accounted for.
    simulated, output_error : ndarray, shape (rows,)
        NaN outside of the runs.
    """

    vaf: float
    simulated: np.ndarray = field(repr=False)
    output_error: np.ndarray = field(repr=False)


@dataclass(frozen=True, eq=False)
class TransferFunctionEstimate:
    """A transfer function G(s) = num(s)/den(s) exp(-s delay_s) with its uncertainty.

    Attributes
    ----------
    num : ndarray, or tuple of ndarray for several inputs
        Coefficients of the numerator in descending powers of s.
    den : ndarray
        Of the denominator, common to all inputs; the first is 1.
    num_se, den_se : like num, den
        Standard errors; 0 for what was fixed.
    delay_s : float, or tuple of float for several inputs
    names : tuple of str
        Of the coefficients: "a0" ... belong to powers of s in the denominator, "b0" ... in the
        numerator, "b0[1]" in that of the second of several inputs.
    values, covariance : ndarray, shape (p,) and (p, p)
        Of the coefficients in the order of `names`.
    states : tuple of str
        Of each: "free", "fixed" or "at its bound".
    outcome : str
        "good", "not_converged", "unstable" (the data ask for an unstable pole), "ill_conditioned" or
        "unexplained".
    notes : tuple of str
        What there is to say about the estimate; the first explains an outcome that is not good.
    vaf, vaf_held_out : float
        Percent of the output's variance accounted for: of the rows behind the estimate, and of
        held-out rows by the model before it was refitted to all (NaN without any).
    aic, aicc, bic, yic : float
        Information criteria; smaller is better, and only models of the same rows compare.
    noise_variance : float
        Of the output error.
    noise_ar : ndarray
        Autoregression of the output error; empty when it is white.
    condition : float
        Of the sensitivities in unit columns.
    initial : ndarray, shape (runs, n + 1)
        Free response and its derivatives at the first row of each run, and the offset.
    simulated, output_error, validation_error : ndarray, shape (rows,)
        NaN outside of the runs.
    """

    num: Any
    den: np.ndarray
    num_se: Any
    den_se: np.ndarray
    delay_s: Any
    names: tuple[str, ...]
    values: np.ndarray
    covariance: np.ndarray
    states: tuple[str, ...]
    rate_hz: float
    method: str
    hold: str
    outcome: str
    notes: tuple[str, ...]
    vaf: float
    vaf_held_out: float
    aic: float
    aicc: float
    bic: float
    yic: float
    noise_variance: float
    noise_ar: np.ndarray
    condition: float
    iterations: int
    rows: int
    held_out_rows: int
    refitted: bool
    initial: np.ndarray = field(repr=False)
    simulated: np.ndarray = field(repr=False)
    output_error: np.ndarray = field(repr=False)
    validation_error: np.ndarray = field(repr=False)
    input_names: tuple[str, ...] = ("u",)
    output_name: str = "y"
    _settings: dict[str, Any] = field(default_factory=dict, repr=False)
    _output: np.ndarray = field(default_factory=lambda: np.empty(0), repr=False)

    # Numbers ----------------------------------------------------------------------------------

    @property
    def inputs(self) -> int:
        """Number of inputs."""
        return len(self.input_names)

    @cached_property
    def _numerators(self) -> tuple[np.ndarray, ...]:
        return self.num if self.inputs > 1 else (self.num,)

    @cached_property
    def _delays(self) -> tuple[float, ...]:
        return self.delay_s if self.inputs > 1 else (self.delay_s,)

    @property
    def poles(self) -> np.ndarray:
        """Roots of the denominator, rad/s."""
        return np.roots(self.den)

    @property
    def zeros(self) -> Any:
        """Roots of the numerator, rad/s; a tuple of arrays for several inputs."""
        found = tuple(np.roots(n) for n in self._numerators)
        return found if self.inputs > 1 else found[0]

    @property
    def gain(self) -> Any:
        """Static gain G(0); infinite with a pole at zero."""
        with np.errstate(divide="ignore"):
            found = tuple(float(n[-1] / np.float64(self.den[-1])) for n in self._numerators)
        return found if self.inputs > 1 else found[0]

    def value(self, name: str) -> float:
        """A coefficient by name, as ``est.value("a0")``."""
        return float(self.values[self._place(name)])

    def se(self, name: str) -> float:
        """Standard error of a coefficient."""
        place = self._place(name)
        return float(np.sqrt(self.covariance[place, place]))

    def interval(self, name: str, *, level: float = 0.95) -> tuple[float, float]:
        """Confidence interval of a coefficient."""
        from statistics import NormalDist

        if not 0 < level < 1:
            raise refuse("level must lie between 0 and 1", "level")
        half = NormalDist().inv_cdf(0.5 + level / 2) * self.se(name)
        return self.value(name) - half, self.value(name) + half

    def _place(self, name: str) -> int:
        if name not in self.names:
            raise refuse(f"there is no coefficient {name!r}; there are {', '.join(self.names)}", "name")
        return self.names.index(name)

    # What follows from it ---------------------------------------------------------------------

    @property
    def transfer_function(self) -> TransferFunction:
        """As `ulna.TransferFunction`, for passivity and other analyses; there must be no delay."""
        from .systems import TransferFunction

        if any(delay > 0 for delay in self._delays):
            raise refuse(
                f"a delay of {1e3 * max(self._delays):.4g} ms has no rational transfer function: "
                "build one from num and den with a Padé approximation of the delay",
                "estimate",
            )
        return TransferFunction([list(self._numerators)], self.den)

    def frequency_response(self, freq_hz: Any, *, input: int = 0) -> np.ndarray:  # noqa: A002
        """G(j 2 pi f) of an input, complex, one value a frequency.

        Examples
        --------
        >>> import numpy as np
        >>> from ulna import models
        >>> u = np.random.default_rng(0).normal(size=2000)
        >>> y = models.simulate([2.0], [1.0, 3.0], u, rate_hz=100)
        >>> est = models.identify_transfer_function(u, y, rate_hz=100, poles=1, zeros=0)
        >>> round(float(abs(est.frequency_response([0.0])[0])), 6)
        0.666667
        """
        s = 2j * np.pi * np.asarray(freq_hz, dtype=float)
        value = np.polyval(self._numerators[input], s) / np.polyval(self.den, s)
        return value * np.exp(-s * self._delays[input])

    def response_se(self, freq_hz: Any, *, input: int = 0) -> np.ndarray:  # noqa: A002
        """Root mean square error of the frequency response, by linear propagation."""
        freq = np.atleast_1d(np.asarray(freq_hz, dtype=float))
        s = 2j * np.pi * freq
        n = len(self.den) - 1
        den = np.polyval(self.den, s)
        value = self.frequency_response(freq, input=input)
        slopes = np.zeros((len(self.names), len(freq)), dtype=complex)
        for k in range(n):
            slopes[k] = -value * s**k / den
        first = n + sum(len(num) for num in self._numerators[:input])
        for j in range(len(self._numerators[input])):
            slopes[first + j] = s**j / den * np.exp(-s * self._delays[input])
        variance = np.einsum("if,ij,jf->f", slopes.conj(), self.covariance, slopes).real
        return np.sqrt(np.maximum(variance, 0.0)).reshape(np.shape(freq_hz))

    def simulate(self, u: Any, *, rate_hz: float | None = None) -> np.ndarray:
        """Output for inputs (rows, or rows x inputs) after rest, without the offset."""
        return simulate(
            self.num, self.den, u, rate_hz=self.rate_hz if rate_hz is None else rate_hz,
            delay_s=self.delay_s, hold=self.hold,
        )  # fmt: skip

    def validate(
        self,
        u: Any,
        y: Any = None,
        *,
        rate_hz: float | None = None,
        input: Word | None = None,  # noqa: A002
        output: Word | None = None,
        runs: Any = None,
    ) -> Validation:
        """Prediction of another recording; arguments as for `identify_transfer_function`.

        Initial state and offset of each run are fitted to it, the coefficients stay.
        """
        signals = ports(u, y, rate_hz, runs, input=input, output=output)
        settings = self._settings | {"lower": self.values, "upper": self.values, "held_out": 0.0}
        settings |= {"bound_count": len(self.values)}
        model = _identify(signals, settings, progress=False)
        info = result("ulna_model_info")
        check(lib.ulna_model_get_info(model.pointer, info))
        return Validation(
            info.vaf,
            _values(model, lib.ULNA_MODEL_SIMULATED),
            _values(model, lib.ULNA_MODEL_OUTPUT_ERRORS),
        )

    # Looking ----------------------------------------------------------------------------------

    def summary(self) -> str:
        """Coefficients with standard errors, poles, fit and notes, at most 80 columns."""
        from ._words_models import transfer_function_summary

        return transfer_function_summary(self)

    def plot(self, axes: Any = None, *, response: ResponseEstimate | None = None) -> np.ndarray:
        """Output beside its simulation, magnitude and phase with bands (needs matplotlib).

        Parameters
        ----------
        axes : array of 3 matplotlib.axes.Axes, optional
        response : ResponseEstimate, optional
            A measured response to draw under the model's.
        """
        from . import plot

        return plot.transfer_function(self, axes, response=response)

    def __repr__(self) -> str:
        from ._words_models import entry

        shown = ", ".join(
            f"{name} {entry(value, error)}"
            for name, value, error in zip(
                self.names, self.values, np.sqrt(np.diag(self.covariance)), strict=True
            )
        )
        return f"<TransferFunctionEstimate {self.outcome}, VAF {self.vaf:.1f} %: {shown}>"


def identify_transfer_function(
    u: Any,
    y: Any = None,
    *,
    rate_hz: float | None = None,
    input: Word | None = None,  # noqa: A002
    output: Word | None = None,
    poles: int = 2,
    zeros: int | Sequence[int] | None = None,
    delay_s: float | Sequence[float] = 0.0,
    method: Literal["srivc", "oe"] = "srivc",
    hold: Literal["zoh", "foh"] = "zoh",
    initial: Literal["free", "rest"] = "free",
    offset: bool = True,
    fixed: Mapping[str, float] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    runs: Any = None,
    held_out: float = 0.2,
    refit: bool = True,
    errors: Literal["coloured", "white"] = "coloured",
    skip_s: float = 0.0,
    cutoffs_hz: Sequence[float] | None = None,
    max_iterations: int = 60,
    tolerance: float = 1e-3,
    progress: bool = False,
) -> TransferFunctionEstimate:
    """Transfer function in continuous time from sampled signals, with standard errors.

    Parameters
    ----------
    u, y : array_like, shape (rows,) or (rows, inputs), and (rows,)
        Inputs and output; or `u` is a `Record`, and `input` and `output` name its channels.
    rate_hz : float
        Sample rate of arrays.
    input, output : str or list of str
        Channels of a record. Signs stay as they are: forces of a record are those of the human on
        the robot, so an arm's admittance comes out negative from "F" to "x".
    poles : int
        Degree of the denominator, 1 to 10.
    zeros : int or list of int
        Degree of the numerator, or of each input's; ``poles - 1`` unless given, at most `poles`. A
        system with more zeros than poles is identified with input and output exchanged.
    delay_s : float or list of float
        Of the input; need not be a whole number of samples. `select_order` searches for it.
    method : {"srivc", "oe"}
        Refined instrumental variables, or output-error least squares from the same start. Both end
        at the same place when they converge.
    hold : {"zoh", "foh"}
        Between samples the input stays ("zoh", for commands of a computer) or runs straight ("foh",
        for recorded motion). The discretisation is exact for it.
    initial : {"free", "rest"}
        Each run begins in any state, which is estimated, or at rest with zero input before.
    offset : bool
        Each run has a constant of its own in the output.
    fixed, bounds : mapping
        Coefficients by name, ``{"a0": 4.0}`` and ``{"a1": (0, np.inf)}``; "a1" belongs to s in the
        denominator, whose highest coefficient is 1, "b0" to the constant of the numerator, "b0[1]"
        to that of the second of several inputs.
    runs : array_like of int, shape (n, 2), optional
        Rows ``[begin, end)`` of each trial; the segments of a record. Never joined.
    held_out : float
        Share of each run, its end, that validates a model of the rest.
    refit : bool
        After the validation, estimate from all rows.
    errors : {"coloured", "white"}
        Whether the standard errors allow for output errors that are correlated in time.
    skip_s : float
        Left out at the start of each run.
    cutoffs_hz : list of float, optional
        Of the filters that start the iterations; a grid over the band unless given.
    max_iterations, tolerance : int, float
        The last step is below `tolerance` standard errors.
    progress : bool
        Show a bar (needs tqdm).

    Returns
    -------
    TransferFunctionEstimate
        Warns `UncertainResult` when its outcome is not good.

    Examples
    --------
    A mass of 2 kg on a spring of 50 N/m with a damper of 4 N s/m, from force to position:

    >>> import numpy as np
    >>> from ulna import models
    >>> force = np.repeat(np.random.default_rng(0).normal(size=100), 50)
    >>> x = models.simulate([0.5], [1.0, 2.0, 25.0], force, rate_hz=1000)
    >>> est = models.identify_transfer_function(force, x, rate_hz=1000, poles=2, zeros=0)
    >>> est.outcome, est.den.round(6).tolist(), est.num.round(6).tolist()
    ('good', [1.0, 2.0, 25.0], [0.5])
    """
    signals = ports(u, y, rate_hz, runs, input=input, output=output)
    if signals.outputs.shape[1] != 1:
        raise refuse(
            f"one output is identified at a time, got {', '.join(signals.output_names)}", "output"
        )
    if not 1 <= poles <= 10:
        raise refuse(f"poles is {poles}; it must be from 1 to 10", "poles")
    count = signals.inputs.shape[1]
    degrees = _each(poles - 1 if zeros is None else zeros, count, "zeros", int)
    delays = _each(delay_s, count, "delay_s", float)
    names = _names(poles, degrees)
    lower, upper = _limits(names, fixed, bounds)
    settings = {
        "poles": poles,
        "zeros": degrees,
        "zero_count": count,
        "delay_s": delays,
        "delay_count": count,
        "method": pick(_METHODS, method, "method"),
        "hold": pick(_HOLDS, hold, "hold"),
        "rest": pick({"free": 0, "rest": 1}, initial, "initial"),
        "no_offset": not offset,
        "skip_s": skip_s,
        "white": pick({"coloured": 0, "white": 1}, errors, "errors"),
    }
    run = settings | {
        "lower": lower,
        "upper": upper,
        "bound_count": len(names) if fixed or bounds else 0,
        "held_out": held_out,
        "no_refit": not refit,
        "cutoffs_hz": None if cutoffs_hz is None else np.asarray(cutoffs_hz, dtype=float),
        "cutoff_count": 0 if cutoffs_hz is None else len(cutoffs_hz),
        "max_iterations": _positive(max_iterations, "max_iterations"),
        "tolerance": _positive(tolerance, "tolerance"),
    }
    model = _identify(signals, run, progress)
    estimate = _estimate(model, signals, settings, method, hold, names, degrees, delays)
    if estimate.outcome != "good":
        from .impedance import UncertainResult

        _warnings.warn(estimate.notes[0], UncertainResult, stacklevel=2)
    return estimate


def simulate(
    num: Any,
    den: Any,
    u: Any,
    *,
    rate_hz: float,
    delay_s: float | Sequence[float] = 0.0,
    hold: Literal["zoh", "foh"] = "zoh",
) -> np.ndarray:
    """Output of a transfer function after rest, exact for the hold of the input.

    Parameters
    ----------
    num, den : array_like
        Coefficients in descending powers of s; a list of numerators for several inputs.
    u : array_like, shape (rows,) or (rows, inputs)
    rate_hz, delay_s, hold
        As for `identify_transfer_function`.

    Examples
    --------
    >>> import numpy as np
    >>> from ulna import models
    >>> y = models.simulate([1.0], [1.0, 1.0], np.ones(5), rate_hz=1.0)
    >>> bool(np.allclose(y, 1 - np.exp(-np.arange(5))))
    True
    """
    inputs = np.asarray(u, dtype=float)
    if inputs.ndim not in (1, 2):
        raise refuse(f"u has {inputs.ndim} axes: one, or two with time first, are expected", "u")
    inputs = inputs.reshape(len(inputs), -1)
    count = inputs.shape[1]
    several = count > 1 and not np.isscalar(num[0])
    numerators = [np.atleast_1d(np.asarray(n, dtype=float)) for n in (num if several else [num])]
    denominator = np.atleast_1d(np.asarray(den, dtype=float))
    if denominator.ndim != 1 or len(denominator) < 2 or not denominator[0] != 0:
        raise refuse("den must start with a coefficient that is not zero and have a pole", "den")
    if len(numerators) != count or any(n.ndim != 1 for n in numerators):
        raise refuse(f"num must give one list of coefficients for each of {count} inputs", "num")
    if any(len(n) > len(denominator) for n in numerators):
        raise refuse("num must not have a higher degree than den", "num")
    coefficients = np.concatenate([(n / denominator[0])[::-1] for n in (denominator[1:], *numerators)])
    chosen = options(
        "ulna_model_options",
        poles=len(denominator) - 1,
        zeros=[len(n) - 1 for n in numerators],
        zero_count=count,
        delay_s=_each(delay_s, count, "delay_s", float),
        delay_count=count,
        hold=pick(_HOLDS, hold, "hold"),
    )
    return out_array(
        lib.ulna_model_simulate, view(coefficients), chosen, view(inputs), float(rate_hz)
    )


# Orders -------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class OrderCandidate:
    """One model of a search, estimated from the rows that are not held out.

    Attributes
    ----------
    poles, zeros : int
    delay_s : float
    outcome : str
        As of an estimate, or "failed".
    note : str
        Why it is no candidate; empty when it is one.
    vaf, vaf_held_out : float
        Percent of the output's variance accounted for.
    aicc, bic, yic, condition : float
    """

    poles: int
    zeros: int
    delay_s: float
    outcome: str
    note: str
    vaf: float
    vaf_held_out: float
    aicc: float
    bic: float
    yic: float
    condition: float


@dataclass(frozen=True, eq=False)
class OrderSelection:
    """Models of several orders and delays, the best by the criterion first.

    Attributes
    ----------
    candidates : tuple of OrderCandidate
    best : OrderCandidate or None
        The recommended one; None when none is good.
    criterion : str
    reason : str
        Why it is recommended.
    """

    candidates: tuple[OrderCandidate, ...]
    best: OrderCandidate | None
    criterion: str
    reason: str
    _again: Callable[..., TransferFunctionEstimate] = field(repr=False)

    def identify(self, **keywords: Any) -> TransferFunctionEstimate:
        """The recommended model from all rows; keywords as for `identify_transfer_function`."""
        if self.best is None:
            raise refuse(self.reason, "criterion")
        orders = {"poles": self.best.poles, "zeros": self.best.zeros, "delay_s": self.best.delay_s}
        return self._again(**(orders | keywords))

    def summary(self, *, rows: int = 12) -> str:
        """The table of the best candidates, and why one of them is recommended."""
        from ._words_models import order_summary

        return order_summary(self, rows)

    def plot(self, axes: Any = None) -> np.ndarray:
        """Held-out error and information criterion over the number of coefficients."""
        from . import plot

        return plot.orders(self, axes)

    def __repr__(self) -> str:
        best = self.best
        shown = "none" if best is None else f"{best.poles} poles, {best.zeros} zeros"
        delay = f", {1e3 * best.delay_s:.4g} ms" if best is not None and best.delay_s > 0 else ""
        return f"<OrderSelection of {len(self.candidates)} by {self.criterion}: {shown}{delay}>"


def select_order(
    u: Any,
    y: Any = None,
    *,
    rate_hz: float | None = None,
    input: Word | None = None,  # noqa: A002
    output: Word | None = None,
    poles: Sequence[int] = (1, 2, 3, 4),
    zeros: Sequence[int] | None = None,
    delay_s: Sequence[float] = (0.0,),
    criterion: Literal["held-out", "bic", "aicc", "yic"] = "held-out",
    method: Literal["srivc", "oe"] = "srivc",
    hold: Literal["zoh", "foh"] = "zoh",
    initial: Literal["free", "rest"] = "free",
    offset: bool = True,
    runs: Any = None,
    held_out: float = 0.25,
    threads: int = 0,
    progress: bool = False,
) -> OrderSelection:
    """How many poles and zeros, and which delay, do the data support?

    Every combination is estimated from the same rows and judged on the same held-out rows.

    Parameters
    ----------
    u, y, rate_hz, input, output, method, hold, initial, offset, runs, progress
        As for `identify_transfer_function`; several inputs share orders and delay.
    poles, zeros, delay_s : lists
        What is tried. Zeros from 0 to ``poles - 1`` unless given.
    criterion : {"held-out", "bic", "aicc", "yic"}
        "held-out": the fewest coefficients whose held-out error is within two standard errors of
        the least, which needs no assumption on the noise. "bic", "aicc": information criteria,
        which take the noise as white. "yic": Young's, among models whose error is within three
        standard errors of the least.
    held_out : float
        Share of each run, its end, that validates.
    threads : int
        0: one per processor. The result does not depend on it.

    Examples
    --------
    >>> import numpy as np
    >>> from ulna import models
    >>> rng = np.random.default_rng(1)
    >>> u = np.repeat(rng.normal(size=200), 20)
    >>> y = models.simulate([30.0], [1.0, 2.0, 25.0], u, rate_hz=200) + 0.1 * rng.normal(size=4000)
    >>> models.select_order(u, y, rate_hz=200, poles=[1, 2, 3])
    <OrderSelection of 6 by held-out: 2 poles, 0 zeros>
    """
    signals = ports(u, y, rate_hz, runs, input=input, output=output)
    if signals.outputs.shape[1] != 1:
        raise refuse(
            f"one output is identified at a time, got {', '.join(signals.output_names)}", "output"
        )
    poles, delay_s = np.atleast_1d(poles).tolist(), np.atleast_1d(delay_s).tolist()
    zeros = None if zeros is None else np.atleast_1d(zeros).tolist()
    grid = options(
        "ulna_order_grid",
        poles=_whole(poles, "poles"),
        pole_count=len(poles),
        zeros=None if zeros is None else _whole(zeros, "zeros"),
        zero_count=0 if zeros is None else len(zeros),
        delay_s=np.asarray(delay_s, dtype=float),
        delay_count=len(delay_s),
        criterion=pick(_CRITERIA, criterion, "criterion"),
        threads=threads,
    )
    chosen = _model_options(
        signals,
        {
            "method": pick(_METHODS, method, "method"),
            "hold": pick(_HOLDS, hold, "hold"),
            "rest": pick({"free": 0, "rest": 1}, initial, "initial"),
            "no_offset": not offset,
            "held_out": held_out,
        },
    )
    out = ffi.new("ulna_order_search **")
    views = view(signals.inputs), view(signals.outputs)
    long_call(
        lib.ulna_order_search_new, *views, signals.rate_hz, grid, chosen, ffi.NULL, out,
        progress=progress, label="orders",
    )  # fmt: skip
    search = _OrderSearch(out[0])

    again = partial(
        identify_transfer_function,
        u, y, rate_hz=rate_hz, input=input, output=output, runs=runs, method=method, hold=hold,
        initial=initial, offset=offset,
    )  # fmt: skip
    return _selection(search, criterion, again)


# Inside -------------------------------------------------------------------------------------------


def _selection(search: _OrderSearch, criterion: str, again: Any) -> OrderSelection:
    count, recommended = ffi.new("int64_t *"), ffi.new("int64_t *")
    check(lib.ulna_order_search_get_count(search.pointer, count, recommended))
    candidates = []
    for index in range(count[0]):
        raw = result("ulna_order_candidate")
        check(lib.ulna_order_search_get_candidate(search.pointer, index, raw))
        candidates.append(
            OrderCandidate(
                poles=raw.poles,
                zeros=raw.zeros,
                delay_s=raw.delay_s,
                outcome=_OUTCOMES.get(raw.outcome, "failed"),
                note=text(lib.ulna_order_search_get_text, search.pointer, index),
                vaf=raw.vaf,
                vaf_held_out=raw.vaf_held_out,
                aicc=raw.aicc,
                bic=raw.bic,
                yic=raw.yic,
                condition=raw.condition,
            )
        )
    best = None if recommended[0] < 0 else candidates[recommended[0]]
    reason = text(lib.ulna_order_search_get_text, search.pointer, -1)
    return OrderSelection(tuple(candidates), best, criterion, reason, again)


def _model_options(signals: Ports, settings: Mapping[str, Any]) -> Any:
    fields = dict(settings)
    if signals.runs is not None:
        fields |= {"ranges": signals.runs, "range_count": len(signals.runs)}
    return options("ulna_model_options", **fields)


def _identify(signals: Ports, settings: Mapping[str, Any], progress: bool) -> _Model:
    chosen = _model_options(signals, settings)
    out = ffi.new("ulna_model **")
    views = view(signals.inputs), view(signals.outputs)
    long_call(
        lib.ulna_model_identify, *views, signals.rate_hz, chosen, ffi.NULL, out,
        progress=progress, label="transfer function",
    )  # fmt: skip
    return _Model(out[0])


def _values(model: _Model, which: int) -> np.ndarray:
    return out_array(lib.ulna_model_get_values, model.pointer, which)


def _estimate(
    model: _Model,
    signals: Ports,
    settings: dict[str, Any],
    method: str,
    hold: str,
    names: tuple[str, ...],
    degrees: list[int],
    delays: list[float],
) -> TransferFunctionEstimate:
    info = result("ulna_model_info")
    check(lib.ulna_model_get_info(model.pointer, info))
    values = _values(model, lib.ULNA_MODEL_COEFFICIENTS)
    p, n, count = len(values), info.poles, info.inputs
    covariance = _values(model, lib.ULNA_MODEL_COVARIANCE).reshape(p, p)
    errors = np.sqrt(np.diag(covariance))
    states = _values(model, lib.ULNA_MODEL_STATE).astype(int)

    def numerators(coefficients: np.ndarray) -> Any:
        ends = n + np.cumsum([0] + [m + 1 for m in degrees])
        parts = tuple(coefficients[a:b][::-1] for a, b in zip(ends[:-1], ends[1:], strict=True))
        return parts if count > 1 else parts[0]

    notes = text(lib.ulna_model_get_text, model.pointer)
    return TransferFunctionEstimate(
        num=numerators(values),
        den=np.concatenate([[1.0], values[:n][::-1]]),
        num_se=numerators(errors),
        den_se=np.concatenate([[0.0], errors[:n][::-1]]),
        delay_s=tuple(delays) if count > 1 else delays[0],
        names=names,
        values=values,
        covariance=covariance,
        states=tuple(_STATES[s] for s in states),
        rate_hz=signals.rate_hz,
        method=method,
        hold=hold,
        outcome=_OUTCOMES[info.outcome],
        notes=tuple(notes.split("\n")) if notes else (),
        vaf=info.vaf,
        vaf_held_out=info.vaf_held_out,
        aic=info.aic,
        aicc=info.aicc,
        bic=info.bic,
        yic=info.yic,
        noise_variance=info.noise_variance,
        noise_ar=_values(model, lib.ULNA_MODEL_NOISE),
        condition=info.condition,
        iterations=info.iterations,
        rows=info.rows,
        held_out_rows=info.held_out_rows,
        refitted=bool(info.refitted),
        initial=_values(model, lib.ULNA_MODEL_INITIAL).reshape(-1, n + 1),
        simulated=_values(model, lib.ULNA_MODEL_SIMULATED),
        output_error=_values(model, lib.ULNA_MODEL_OUTPUT_ERRORS),
        validation_error=_values(model, lib.ULNA_MODEL_VALIDATION_ERRORS),
        input_names=signals.input_names,
        output_name=signals.output_names[0],
        _settings=settings,
        _output=signals.outputs[:, 0],
    )


def _names(poles: int, degrees: Sequence[int]) -> tuple[str, ...]:
    names = [f"a{k}" for k in range(poles)]
    for i, degree in enumerate(degrees):
        names += [f"b{j}" + (f"[{i}]" if len(degrees) > 1 else "") for j in range(degree + 1)]
    return tuple(names)


def _limits(
    names: tuple[str, ...],
    fixed: Mapping[str, float] | None,
    bounds: Mapping[str, tuple[float, float]] | None,
) -> tuple[np.ndarray, np.ndarray]:
    lower, upper = np.full(len(names), -np.inf), np.full(len(names), np.inf)
    given = {name: (value, value) for name, value in (fixed or {}).items()}
    for argument, entries in (("fixed", given), ("bounds", dict(bounds or {}))):
        for name, pair in entries.items():
            if name not in names:
                raise refuse(
                    f"{argument} names {name!r}, but the coefficients are {', '.join(names)}", argument
                )
            if argument == "bounds" and name in given:
                raise refuse(f"{name} is both fixed and bounded: give one of them", "bounds")
            low, high = (float(v) for v in pair)
            if not low <= high or (argument == "fixed" and not np.isfinite(low)):
                raise refuse(f"{argument} of {name} is {pair}: no value fits", argument)
            place = names.index(name)
            lower[place], upper[place] = low, high
    return lower, upper


def _each(given: Any, count: int, name: str, kind: type) -> list[Any]:
    """One value an input."""
    values = list(np.atleast_1d(given))
    if len(values) == 1:
        values = values * count
    if len(values) != count:
        raise refuse(f"{name} has {len(values)} entries for {count} inputs", name)
    if kind is int:
        return _whole(values, name)
    return [float(v) for v in values]


def _whole(values: Sequence[Any], name: str) -> list[int]:
    if any(int(v) != v for v in values):
        raise refuse(f"{name} must hold whole numbers", name)
    return [int(v) for v in values]


def _positive(value: float, name: str) -> float:
    # Zero bytes would ask the library for its default.
    if not value > 0:
        raise refuse(f"{name} must be positive", name)
    return value
