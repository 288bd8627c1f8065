"""The errors of an experiment, foreseen."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ._call import Handle, check, ffi, lib, long_call, options, out_array, result, text
from ._design_arguments import number
from ._design_assumed import Arm, Noise, Robot, arm_of, structs_of
from .record import pick, refuse

if TYPE_CHECKING:
    from .design import Design

_MATRICES = ("M", "B", "K")


class _Plan(Handle):
    kind = "ulna_plan"
    __slots__ = ()


def plan(
    design: Design,
    arm: Any = None,
    *,
    robot: Robot | None = None,
    noise: Noise | None = None,
    minutes: float | None = None,
    repetitions: float | None = None,
    model: str = "free",
    no_damping: bool = False,
    diagonal_mass: bool = False,
    estimator: str = "auto",
    refit: bool | None = None,
    train_s: float | None = None,
    lowpass_hz: float | None = None,
    window: int | None = None,
    order: int | None = None,
    condition_limit: float = 1000.0,
) -> Plan:
    """Predict the standard error of every parameter before anything is recorded.

    The recording is foreseen without noise and goes through the filters, the split and the estimator
    of `ulna.identify_impedance`; tremor and sensor noise have known spectra, from which the errors
    follow to first order. Least squares gets its bias as well.

    Parameters
    ----------
    design : Design
    arm : Arm, estimate or mapping of M, B and K, optional
        What is expected; by default participant P1 of Dyck (2013).
    robot : Robot, optional
    noise : Noise, optional
    minutes, repetitions : float, optional
        How long the experiment lasts, pauses of the design included, or how often the design is
        repeated. By default once.
    model, no_damping, diagonal_mass, estimator, refit, train_s, lowpass_hz, window, order
        As in `ulna.identify_impedance`; the passive model is planned as the symmetric one.
    condition_limit : float

    Returns
    -------
    Plan

    Examples
    --------
    >>> import ulna
    >>> from ulna.design import Noise
    >>> expected = ulna.design.plan(ulna.design.multisine(seed=1), noise=Noise(tremor=0.3))
    >>> bool(expected.minutes_for("K_xx", 0.05) < 30)
    True
    """
    from .impedance import _ESTIMATORS, _MODELS, _REFIT

    if not hasattr(design, "reference_rate"):
        raise refuse("design must be an ulna.design.Design", "design")
    if minutes is not None and repetitions is not None:
        raise refuse("give minutes or repetitions, not both", "minutes")
    times = 1.0 if repetitions is None else number(repetitions, "repetitions", above=0.0)
    if minutes is not None:
        times = 60.0 * number(minutes, "minutes", above=0.0) / design.duration_s
    filters = options("ulna_prepare_options", lowpass_hz=lowpass_hz, window=window, order=order)
    chosen = options(
        "ulna_plan_options",
        prepare=filters,
        train_s=None if train_s is None else number(train_s, "train_s", above=0.0),
        condition_limit=number(condition_limit, "condition_limit", above=0.0),
        repetitions=times,
        model=pick(_MODELS, model, "model"),
        no_damping=no_damping,
        diagonal_mass=diagonal_mass,
        estimator=pick(_ESTIMATORS, estimator, "estimator"),
        refit=pick(_REFIT, refit, "refit"),
    )
    expected = arm_of(arm)
    machine, disturbance = robot or Robot(), noise or Noise()
    out = ffi.new("ulna_plan **")
    long_call(
        lib.ulna_design_plan,
        design._native().pointer,
        *structs_of(design, expected, machine, disturbance),
        chosen,
        ffi.NULL,
        out,
    )
    handle = _Plan(out[0])
    info = result("ulna_plan_info")
    check(lib.ulna_plan_get_info(handle.pointer, info))

    def values(which: int) -> np.ndarray:
        return out_array(lib.ulna_plan_get_values, handle.pointer, which)

    covariance = values(lib.ULNA_PLAN_COVARIANCE)
    size = int(np.sqrt(covariance.size))
    words = text(lib.ulna_plan_get_text, handle.pointer)
    iv = info.estimator == lib.ULNA_ESTIMATOR_INSTRUMENTAL
    return Plan(
        design=design,
        arm=expected,
        robot=machine,
        noise=disturbance,
        estimator="instrumental_variables" if iv else "least_squares",
        minutes=info.seconds / 60.0,
        used_minutes=info.used_s / 60.0,
        repetitions=info.repetitions,
        cov=covariance.reshape(size, size),
        bias=values(lib.ULNA_PLAN_BIAS),
        least_squares_bias=values(lib.ULNA_PLAN_LEAST_SQUARES_BIAS),
        least_squares_se=values(lib.ULNA_PLAN_LEAST_SQUARES_ERROR),
        rho=values(lib.ULNA_PLAN_MOTION_SHARE),
        condition=info.condition,
        weakness=info.weakness,
        lowpass_hz=info.lowpass_hz,
        warnings=tuple(words.split("\n")) if words else (),
        _truth=values(lib.ULNA_PLAN_TRUTH),
        _errors=values(lib.ULNA_PLAN_ERROR),
        _handle=handle,
    )


@dataclass(frozen=True, eq=False)
class Plan:
    """What an experiment will tell. Made by `plan`.

    Vectors over all parameters are M, B and K row by row, then x0, as in an estimate's `cov`.

    Attributes
    ----------
    minutes, used_minutes : float
        Length of the experiment, and how much of it the fit uses.
    repetitions : float
    cov : ndarray, shape (3 n^2 + n, 3 n^2 + n)
        Predicted covariance.
    bias : ndarray
        Of the estimator in use; 0 for instrumental variables, to first order.
    least_squares_bias, least_squares_se : ndarray
        Of least squares on the same recording.
    rho : ndarray, shape (n,)
        Share of the motion's power that the human causes.
    condition : float
        Of the regressors.
    weakness : float
        Noise in the instruments' hold on the motion; above 0.3 the errors will be larger than
        predicted, and a warning says so.
    warnings : tuple of str
    """

    design: Design = field(repr=False)
    arm: Arm = field(repr=False)
    robot: Robot
    noise: Noise
    estimator: str
    minutes: float
    used_minutes: float
    repetitions: float
    cov: np.ndarray
    bias: np.ndarray
    least_squares_bias: np.ndarray
    least_squares_se: np.ndarray
    rho: np.ndarray
    condition: float
    weakness: float
    lowpass_hz: float
    warnings: tuple[str, ...]
    _truth: np.ndarray = field(repr=False)
    _errors: np.ndarray = field(repr=False)
    _handle: _Plan = field(repr=False)

    @property
    def n(self) -> int:
        """Number of axes."""
        return self.design.n

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all parameters: "M_xx", "M_xy", ..., "x0_x", ..."""
        axes = self.design.axes
        pairs = [f"{row}{column}" for row in axes for column in axes]
        names = [f"{matrix}_{pair}" for matrix in _MATRICES for pair in pairs]
        return (*names, *(f"x0_{axis}" for axis in axes))

    @property
    def units(self) -> dict[str, str]:
        """Unit of M, B, K and x0."""
        if self.design.rotational:
            return {"M": "kg m^2", "B": "N m s/rad", "K": "N m/rad", "x0": "rad"}
        return {"M": "kg", "B": "N s/m", "K": "N/m", "x0": "m"}

    def _part(self, values: np.ndarray, name: str) -> np.ndarray:
        n = self.n
        if name == "x0":
            return values[3 * n * n :]
        if name not in _MATRICES:
            raise refuse(f"there is no parameter {name!r}; there are M, B, K and x0", "name")
        first = _MATRICES.index(name) * n * n
        return values[first : first + n * n].reshape(n, n)

    def _index(self, name: str) -> int:
        if name not in self.names:
            raise refuse(
                f"there is no parameter {name!r}; there are {', '.join(self.names)}", "name"
            )
        return self.names.index(name)

    def se(self, name: str) -> np.ndarray:
        """Predicted standard errors of "M", "B", "K" or "x0", in its shape.

        Examples
        --------
        >>> import ulna
        >>> expected = ulna.design.multisine(seed=1).plan()
        >>> expected.se("K").shape, bool((expected.se("K") > 0).all())
        ((2, 2), True)
        """
        return self._part(self._errors, name)

    def value(self, name: str) -> np.ndarray:
        """The assumed "M", "B", "K" or "x0"."""
        return self._part(self._truth, name)

    @property
    def scales(self) -> np.ndarray:
        """What relative errors of M, B and K refer to, row by row.

        The entry itself on the diagonal; elsewhere the geometric mean of the two diagonal entries,
        since an entry near 0 has no meaningful share.
        """
        out = []
        for name in _MATRICES:
            diagonal = np.sqrt(np.abs(np.diag(self.value(name))))
            out.append(np.outer(diagonal, diagonal).ravel())
        return np.concatenate(out)

    @property
    def relative(self) -> dict[str, float]:
        """Predicted standard error of each entry of M, B and K over its scale, by name."""
        with np.errstate(divide="ignore", invalid="ignore"):
            shares = self._errors[: 3 * self.n**2] / self.scales
        return dict(zip(self.names, shares.tolist(), strict=False))

    def minutes_for(self, name: str, relative: float) -> float:
        """Minutes of the experiment until one parameter is known to a relative error.

        Parameters
        ----------
        name : str
            As "K_xx".
        relative : float
            Standard error over the parameter, 0.05 for 5 %.

        Examples
        --------
        >>> import ulna
        >>> expected = ulna.design.multisine(seed=1).plan()
        >>> round(expected.minutes_for("K_xx", 0.05) / expected.minutes_for("K_xx", 0.10), 6)
        4.0
        """
        index = self._index(name)
        if index >= 3 * self.n**2:
            raise refuse("the equilibrium has no relative error: plan M, B or K", "name")
        wanted = number(relative, "relative", above=0.0)
        seconds = ffi.new("double *")
        error = wanted * abs(self.scales[index])
        check(lib.ulna_plan_seconds_for(self._handle.pointer, index, error, seconds))
        return seconds[0] / 60.0

    def compare(self, *others: Plan, minutes: float | None = None) -> Comparison:
        """This plan beside others; see `ulna.design.compare`."""
        return compare(self, *others, minutes=minutes)

    def summary(self) -> str:
        """Expected parameters with predicted errors, the bias of least squares, and warnings.

        Examples
        --------
        >>> import ulna
        >>> print(ulna.design.multisine(seed=1).plan().summary())  # doctest: +ELLIPSIS
        Plan of 0.833 minutes...
        """
        return _plan_summary(self)

    def plot(self) -> Any:
        """Predicted relative errors, and the bias of least squares (needs matplotlib)."""
        from ._plot_design import plans

        return plans([self], [_label(self)])

    def __repr__(self) -> str:
        worst = max(self.relative, key=lambda name: self.relative[name])
        stiffness = f"K_{self.design.axes[0] * 2}"
        return (
            f"<Plan of {self.minutes:.3g} min: {stiffness} to {100 * self.relative[stiffness]:.2g} %, "
            f"worst {worst} to {100 * self.relative[worst]:.2g} %>"
        )


def _label(one: Plan) -> str:
    if one.design.lines:
        return "multisine"
    return "steps" if one.design.events else "design"


def _plan_summary(one: Plan) -> str:
    from ._words import _entry, _fact, _paragraph

    by = "instrumental variables" if one.estimator == "instrumental_variables" else "least squares"
    lines = [
        f"Plan of {one.minutes:.3g} minutes ({one.repetitions:.3g} times the design), of which "
        f"{one.used_minutes:.3g} are fitted",
        f"by {by}; expected value ± predicted standard error",
        "",
    ]
    for name in (*_MATRICES, "x0"):
        value, error = np.atleast_2d(one.value(name)), np.atleast_2d(one.se(name))
        unit = one.units[name]
        for i, (row, spread) in enumerate(zip(value, error, strict=True)):
            head = f"{name:>2} {unit:<10}" if i == 0 else ""
            entries = "".join(f"{_entry(v, s):>20}" for v, s in zip(row, spread, strict=True))
            lines.append(f"{head:<14}{entries}")
    share = ", ".join(
        f"{axis} {100 * value:.0f} %" for axis, value in zip(one.design.axes, one.rho, strict=True)
    )
    n = one.n
    k = slice(2 * n * n, 3 * n * n)
    bias = one.least_squares_bias[k].reshape(n, n).diagonal()
    lines += [
        "",
        _fact("Motion by the human", share + " of its power"),
        _fact(
            "Least squares",
            "would change "
            + ", ".join(
                f"K_{axis}{axis} by {value:+.3g} {one.units['K']}"
                for axis, value in zip(one.design.axes, bias, strict=True)
            ),
        ),
    ]
    first = f"K_{one.design.axes[0] * 2}"
    lines.append(_fact("Minutes for 5 %", f"of {first}: {one.minutes_for(first, 0.05):.3g}"))
    lines += [_paragraph(words, "  ! ") for words in one.warnings]
    return "\n".join(lines)


@dataclass(frozen=True, eq=False)
class Comparison:
    """Several plans at the same length of the experiment. Made by `compare`.

    Attributes
    ----------
    labels : tuple of str
    parameters : tuple of str
        "M_xx", "M_xy", ...
    relative : ndarray, shape (plans, parameters)
        Predicted standard error over the parameter's scale (`Plan.scales`) at `minutes`.
    minutes : float
    best : dict of str to str
        Label of the plan with the smallest error, by parameter.
    """

    labels: tuple[str, ...]
    parameters: tuple[str, ...]
    relative: np.ndarray
    minutes: float
    plans: tuple[Plan, ...] = field(repr=False)

    @property
    def best(self) -> dict[str, str]:
        """Label of the plan with the smallest error, by parameter."""
        winners = np.argmin(self.relative, axis=0)
        return {name: self.labels[w] for name, w in zip(self.parameters, winners, strict=True)}

    def summary(self) -> str:
        """The table, percent.

        Examples
        --------
        >>> import ulna
        >>> both = ulna.design.compare(
        ...     multisine=ulna.design.multisine(seed=1).plan(), steps=ulna.design.steps(seed=1).plan()
        ... )
        >>> print(both.summary())  # doctest: +ELLIPSIS
        Predicted relative standard error, percent, in 0.833 minutes...
        """
        width = max(12, 2 + max(len(label) for label in self.labels))
        lines = [
            f"Predicted relative standard error, percent, in {self.minutes:.3g} minutes",
            f"{'':<8}" + "".join(f"{label:>{width}}" for label in self.labels),
        ]
        for name, column in zip(self.parameters, self.relative.T, strict=True):
            lines.append(f"{name:<8}" + "".join(f"{100 * value:>{width}.2g}" for value in column))
        return "\n".join(lines)

    def plot(self) -> Any:
        """Predicted relative error of every parameter for each plan (needs matplotlib)."""
        from ._plot_design import comparison

        return comparison(self)

    def __repr__(self) -> str:
        return f"<Comparison of {', '.join(self.labels)} at {self.minutes:.3g} min>"


def compare(*plans: Plan, minutes: float | None = None, **named: Plan) -> Comparison:
    """Plans beside each other, all brought to the same length of the experiment.

    Parameters
    ----------
    plans : Plan
        Labelled by the kind of their designs; give keywords for labels of your own.
    minutes : float, optional
        Length at which they are compared, pauses included; by default that of the first.
    named : Plan
        Label to plan.

    Examples
    --------
    >>> import ulna
    >>> both = ulna.design.compare(
    ...     small=ulna.design.multisine(peak=0.005, seed=1).plan(),
    ...     large=ulna.design.multisine(peak=0.01, seed=1).plan(),
    ... )
    >>> set(both.best.values())
    {'large'}
    """
    labels = [_label(one) if isinstance(one, Plan) else "" for one in plans]
    labels = [
        f"{label} {1 + labels[:i].count(label)}" if labels.count(label) > 1 else label
        for i, label in enumerate(labels)
    ]
    every = [*plans, *named.values()]
    labels += list(named)
    if not every or not all(isinstance(one, Plan) for one in every):
        raise refuse("compare one or more plans, as made by ulna.design.plan", "plans")
    if len({one.names for one in every}) > 1:
        raise refuse("the plans must be about the same axes", "plans")
    length = every[0].minutes if minutes is None else number(minutes, "minutes", above=0.0)
    names = every[0].names[: 3 * every[0].n ** 2]
    # Standard errors fall with the square root of time.
    table = [
        [one.relative[name] * np.sqrt(one.minutes / length) for name in names] for one in every
    ]
    return Comparison(
        labels=tuple(labels),
        parameters=names,
        relative=np.array(table),
        minutes=length,
        plans=tuple(every),
    )
