"""What reacts late: reflex torque, delayed feedback, and the first window after a perturbation.

A limb answers a perturbation at once with its mechanics, and after a delay with its reflexes. Three
views of the same question, for three kinds of recordings:

* :func:`identify_reflex`: one joint, intrinsic and reflex torque apart (parallel cascade);
* :func:`identify_delayed_feedback`: a hand or joint whose impedance has a delayed part;
* :func:`compare_windows`: many perturbations, their first 100 or 200 ms against what follows.

Forces and torques are those of the human on the robot.
"""

from __future__ import annotations

import warnings as _warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ._call import Handle, check, ffi, lib, long_call, options, out_array, result, text, view
from .impedance import (
    Preprocessing,
    UncertainResult,
    _prepare_options,
    _preprocessing,
)
from .record import Record, pick, refuse

__all__ = [
    "DelayedFeedback",
    "ImpulseResponse",
    "ReflexEstimate",
    "ReflexSignals",
    "WindowComparison",
    "compare_windows",
    "identify_delayed_feedback",
    "identify_reflex",
]

_INTRINSIC = {
    "second-order": lib.ULNA_INTRINSIC_SECOND_ORDER,
    "impulse-response": lib.ULNA_INTRINSIC_IMPULSE_RESPONSE,
}
_SIDES = {"rising": 1, "falling": -1, "auto": 0}
_ESTIMATORS = {
    "auto": lib.ULNA_ESTIMATOR_AUTO,
    "least_squares": lib.ULNA_ESTIMATOR_LEAST_SQUARES,
    "instrumental_variables": lib.ULNA_ESTIMATOR_INSTRUMENTAL,
    "ls": lib.ULNA_ESTIMATOR_LEAST_SQUARES,
    "iv": lib.ULNA_ESTIMATOR_INSTRUMENTAL,
}
_REFIT = {None: lib.ULNA_REFIT_AUTO, True: lib.ULNA_REFIT_YES, False: lib.ULNA_REFIT_NO}
# Most serious first: the outcome is the first that holds.
_REFLEX_OUTCOMES = {
    "suspect_data": lib.ULNA_REFLEX_SUSPECT_DATA,
    "not_significant": lib.ULNA_REFLEX_NOT_SIGNIFICANT,
    "not_converged": lib.ULNA_REFLEX_NOT_CONVERGED,
    "poor_fit": lib.ULNA_REFLEX_POOR_FIT,
    "delay_at_bound": lib.ULNA_REFLEX_DELAY_AT_BOUND,
    "dynamics_at_bound": lib.ULNA_REFLEX_DYNAMICS_AT_BOUND,
    "untested": lib.ULNA_REFLEX_UNTESTED,
}
_DELAYED_OUTCOMES = {
    "suspect_data": lib.ULNA_DELAYED_SUSPECT_DATA,
    "not_significant": lib.ULNA_DELAYED_NOT_SIGNIFICANT,
    "ill_conditioned": lib.ULNA_DELAYED_ILL_CONDITIONED,
    "delay_at_bound": lib.ULNA_DELAYED_AT_BOUND,
    "poor_fit": lib.ULNA_DELAYED_POOR_FIT,
    "untested": lib.ULNA_DELAYED_UNTESTED,
}
_WINDOW_OUTCOMES = {
    "smeared": lib.ULNA_WINDOWS_SMEARED,
    "ill_conditioned": lib.ULNA_WINDOWS_ILL_CONDITIONED,
    "untested": lib.ULNA_WINDOWS_UNTESTED,
}
_REFLEX_NAMES = ("M", "B", "K", "gain", "omega", "zeta", "delay")
_MATRICES = ("M", "B", "K")


class _Reflex(Handle):
    kind = "ulna_reflex"
    __slots__ = ()


class _Delayed(Handle):
    kind = "ulna_delayed"
    __slots__ = ()


class _Windows(Handle):
    kind = "ulna_windows"
    __slots__ = ()


def _first(outcomes: dict[str, int], bits: int) -> str:
    return next((name for name, bit in outcomes.items() if bits & bit), "good")


def _lines(function: Any, handle: Handle, which: int) -> tuple[str, ...]:
    words = text(function, handle.pointer, which)
    return tuple(words.split("\n")) if words else ()


def _frozen(array: np.ndarray) -> np.ndarray:
    array.flags.writeable = False
    return array


def _report(function: Any, handle: Handle) -> Preprocessing:
    report = result("ulna_prepare_report")
    check(function(handle.pointer, report))
    return _preprocessing(report)


def _require_record(record: Any) -> None:
    if not isinstance(record, Record):
        raise refuse(
            f"record is a {type(record).__name__}; read one with ulna.read or make one with "
            "ulna.Record.from_arrays",
            "record",
        )


def _warn(warnings: tuple[str, ...]) -> None:
    if warnings:
        _warnings.warn(" ".join(warnings), UncertainResult, stacklevel=3)


# Intrinsic and reflex torque ---------------------------------------------------------------------


@dataclass(frozen=True)
class ReflexSignals:
    """Prepared torque of a trial and what the paths make of it; all in the sign of the torque.

    Attributes
    ----------
    time, torque, intrinsic, reflex, drive : ndarray, shape (rows,)
        Paths are NaN where their past is not in the record. `drive` is the rectified velocity.
    use : ndarray of int
        0 not used, 1 identification, 2 held out.
    """

    time: np.ndarray
    torque: np.ndarray
    intrinsic: np.ndarray
    reflex: np.ndarray
    drive: np.ndarray
    use: np.ndarray


@dataclass(frozen=True)
class ImpulseResponse:
    """An impulse response with standard errors, lag by lag.

    Attributes
    ----------
    lag_s, value, se : ndarray
        Intrinsic: N m/rad a lag of the position. Reflex: N m/rad, whose integral over time is the
        gain.
    """

    lag_s: np.ndarray
    value: np.ndarray
    se: np.ndarray


@dataclass(frozen=True, eq=False)
class ReflexEstimate:
    """Intrinsic and reflex torque of a joint. Made by :func:`identify_reflex`.

    Attributes
    ----------
    M, B, K : float
        Intrinsic inertia, damping and stiffness; of an impulse response, those that describe it
        best for this motion.
    gain : float
        Static gain of the reflex path, N m s/rad; positive resists the motion.
    omega, zeta : float
        Natural frequency (rad/s) and damping ratio of the reflex dynamics; zeta is NaN for order 1.
    delay_s : float
    delay_interval_s : (float, float)
        95 %, from the profile of the fit over the delay.
    cov : ndarray, shape (7, 7)
        Covariance of M, B, K, gain, omega, zeta, delay.
    p_value : float
        Of the test that there is no reflex path of any delay and speed in the range; NaN when the
        recording is too short for it.
    vaf, vaf_interval : float, (float, float)
        Variance of the held-out torque that both paths account for, percent.
    vaf_intrinsic, vaf_reflex : float
        Each path alone.
    vaf_without, vaf_gain_interval : float, (float, float)
        The best fit without a reflex path; interval of `vaf` less `vaf_without`.
    vaf_train, vaf_train_without, vaf_train_other : float
        On the data of the fit: both paths, no reflex path, a reflex of the other side.
    vaf_impulse : float
        Held out, with an impulse response for either path.
    side : str
        "rising" or "falling" position excites.
    intrinsic_response, reflex_response : ImpulseResponse or None
    profile_delay_s, profile_vaf : ndarray
    powers, powers_se : ndarray
        Coefficients of the square, cube, ... of the position about `position_mean`.
    outcome : str
        "good", or what to look at first: "suspect_data" (negative inertia), "not_significant", "not_converged", "poor_fit",
        "delay_at_bound", "dynamics_at_bound" or "untested".
    warnings, notes, provenance : tuple of str
    """

    axis: str
    rotational: bool
    M: float
    B: float
    K: float
    gain: float
    omega: float
    zeta: float
    delay_s: float
    delay_interval_s: tuple[float, float]
    cov: np.ndarray
    p_value: float
    vaf: float
    vaf_interval: tuple[float, float]
    vaf_intrinsic: float
    vaf_reflex: float
    vaf_without: float
    vaf_gain_interval: tuple[float, float]
    vaf_train: float
    vaf_train_without: float
    vaf_train_other: float
    vaf_impulse: float
    side: str
    intrinsic: str
    order: int
    intrinsic_response: ImpulseResponse | None
    reflex_response: ImpulseResponse | None
    profile_delay_s: np.ndarray
    profile_vaf: np.ndarray
    powers: np.ndarray
    powers_se: np.ndarray
    position_mean: float
    outcome: str
    warnings: tuple[str, ...]
    notes: tuple[str, ...]
    provenance: tuple[str, ...]
    refitted: bool
    train_rows: int
    held_out_rows: int
    train_s: float
    test_blocks: int
    trials: int
    preprocessing: Preprocessing
    record: Record
    _intervals: np.ndarray = field(repr=False)
    _handle: _Reflex = field(repr=False)
    _settings: dict[str, Any] = field(repr=False)

    @property
    def units(self) -> dict[str, str]:
        """Unit of every parameter."""
        turn = {"omega": "rad/s", "zeta": "", "delay": "s"}
        if self.rotational:
            return {"M": "kg m^2", "B": "N m s/rad", "K": "N m/rad", "gain": "N m s/rad", **turn}
        return {"M": "kg", "B": "N s/m", "K": "N/m", "gain": "N s/m", **turn}

    def _place(self, name: str) -> int:
        if name not in _REFLEX_NAMES:
            raise refuse(
                f"there is no parameter {name!r}; there are {', '.join(_REFLEX_NAMES)}", "name"
            )
        return _REFLEX_NAMES.index(name)

    def value(self, name: str) -> float:
        """A parameter by name: "M", "B", "K", "gain", "omega", "zeta" or "delay"."""
        self._place(name)
        return float(self.delay_s if name == "delay" else getattr(self, name))

    def se(self, name: str) -> float:
        """Standard error of a parameter."""
        place = self._place(name)
        return float(np.sqrt(self.cov[place, place]))

    def interval(self, name: str) -> tuple[float, float]:
        """95 % interval of a parameter; the delay's from its profile, not from its error."""
        low, high = self._intervals[:, self._place(name)]
        return float(low), float(high)

    def signals(self, *, trial: int = 0) -> ReflexSignals:
        """Torque of a trial with both paths."""

        def get(which: int) -> np.ndarray:
            return out_array(lib.ulna_reflex_get_signals, self._handle.pointer, trial, which)

        return ReflexSignals(
            time=get(lib.ULNA_REFLEX_SIGNAL_TIME),
            torque=get(lib.ULNA_REFLEX_SIGNAL_TORQUE),
            intrinsic=get(lib.ULNA_REFLEX_SIGNAL_INTRINSIC),
            reflex=get(lib.ULNA_REFLEX_SIGNAL_REFLEX),
            drive=get(lib.ULNA_REFLEX_SIGNAL_DRIVE),
            use=get(lib.ULNA_REFLEX_SIGNAL_USE).astype(int),
        )

    def summary(self) -> str:
        """The estimate as text of at most 80 columns."""
        from ._reflex_words import reflex_summary

        return reflex_summary(self)

    def plot(self) -> Any:
        """Torques of the paths, impulse responses and the delay's profile (needs matplotlib)."""
        from . import plot

        return plot.reflex(self)

    def __reduce__(self) -> tuple[Any, ...]:
        # The same record and settings give the same bits, so they are all that has to travel.
        return _again, (identify_reflex, self.record, self._settings)

    def __repr__(self) -> str:
        low, high = self.delay_interval_s
        return (
            f"<ReflexEstimate K={self.K:.4g}±{self.se('K'):.2g} gain={self.gain:.4g}"
            f"±{self.se('gain'):.2g} {self.units['gain']}, delay {1e3 * self.delay_s:.1f} "
            f"({1e3 * low:.1f} to {1e3 * high:.1f}) ms, VAF {self.vaf:.1f} %, {self.outcome}>"
        )


def _again(function: Any, record: Record, settings: dict[str, Any]) -> Any:
    with _warnings.catch_warnings():
        _warnings.simplefilter("ignore", UncertainResult)
        return function(record, **settings)


def identify_reflex(
    record: Record,
    torque: str | Sequence[str] | None = None,
    position: str | Sequence[str] | None = None,
    *,
    intrinsic: str = "second-order",
    side: str = "auto",
    order: int = 2,
    delay_range_s: tuple[float, float] = (0.0, 0.12),
    threshold_rad_s: float = 0.0,
    position_powers: int = 1,
    drift: int = 0,
    intrinsic_irf_s: float = 0.04,
    reflex_irf_s: float = 0.4,
    train_s: float | None = None,
    refit: bool | None = None,
    lag_s: float = 0.4,
    block_s: float = 1.0,
    level: float = 0.05,
    test_draws: int = 1999,
    poor_vaf: float = 80.0,
    seed: int = 0,
    lowpass_hz: float | None = None,
    lowpass_order: int | None = None,
    corrected: bool = False,
    window: int | None = None,
    polynomial_order: int | None = None,
    plain_savgol: bool = False,
    pad: str = "pole-radius",
    threads: int = 0,
    progress: bool = False,
) -> ReflexEstimate:
    """Intrinsic and reflex torque of a joint, apart, with the reflex's delay and its interval.

    The model is the parallel cascade of Kearney, Stein and Parameswaran (1997)::

        -F = M x'' + B x' + K x + c  +  gain H(s) r(t - delay)

    r is the half-wave rectified velocity and H a low pass of unit static gain. Both paths are
    fitted together. Segments keep an offset of their own and are never concatenated; what a trial's
    unknown past leaves behind is part of the fit. The position is taken as the cause of the torque,
    as under a position-controlled robot.

    Parameters
    ----------
    record : Record
        One joint: position (rad) and torque (by the human on the robot).
    torque, position : str, optional
        Channels; default: by role.
    intrinsic : {"second-order", "impulse-response"}
        M, B and K, or a two-sided impulse response of the position that reaches `intrinsic_irf_s`,
        smoothed by a ridge that cross-validation chooses.
    side : {"auto", "rising", "falling"}
        Velocity of which direction excites the reflex. "auto": the better of both.
    order : {2, 1}
        Of H.
    delay_range_s : (float, float)
    threshold_rad_s : float
        Velocity that excites nothing.
    position_powers : int
        Static torque of the position up to this power, beside K x.
    drift : int
        Order of the polynomial that each segment's offset may follow.
    reflex_irf_s : float
        Length of the reflex impulse response that is made beside the model; 0: none.
    train_s, refit, lag_s, seed
        As :func:`ulna.identify_impedance`.
    block_s : float
        Blocks of the test and of the interval of the VAF.
    level, test_draws
        Of the test whether there is a reflex path: sign flips of blocks.
    lowpass_hz, lowpass_order, corrected, window, polynomial_order, plain_savgol, pad
        As :func:`ulna.preprocess`; `polynomial_order` is its `order`.

    Returns
    -------
    ReflexEstimate
        Look at its `outcome` and `warnings`; an outcome that is not "good" also warns here.

    Raises
    ------
    ulna.ArgumentError
        For options out of range or several axes.
    ulna.DataError
        The record cannot be used: says where and why.
    ulna.AnalysisError
        The velocity never excites the path, or the motion does not determine the intrinsic path.

    Examples
    --------
    A joint without reflexes:

    >>> import numpy as np, ulna
    >>> t = np.arange(20000) / 1000
    >>> f = np.array([0.7, 1.9, 3.1, 5.3, 8.9])[:, None]
    >>> x = (0.01 * np.sin(2 * np.pi * f * t + f)).sum(axis=0)
    >>> v = (0.01 * 2 * np.pi * f * np.cos(2 * np.pi * f * t + f)).sum(axis=0)
    >>> a = (-0.01 * (2 * np.pi * f) ** 2 * np.sin(2 * np.pi * f * t + f)).sum(axis=0)
    >>> noise = 0.05 * np.random.default_rng(0).normal(size=t.size)
    >>> log = ulna.Record.from_arrays(
    ...     t, {"q": x, "tau": -(0.015 * a + 0.8 * v + 60 * x) + noise}
    ... )
    >>> import warnings
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("ignore")
    ...     estimate = ulna.identify_reflex(log, torque="tau", position="q")
    >>> estimate.outcome
    'not_significant'
    """
    settings = {k: v for k, v in locals().items() if k not in ("record", "progress")}
    _require_record(record)
    low, high = _range(delay_range_s)
    if reflex_irf_s < 0:
        raise refuse("reflex_irf_s must not be negative", "reflex_irf_s")
    if order not in (1, 2):
        raise refuse(f"order is {order!r}; the reflex dynamics have order 1 or 2", "order")
    chosen = options(
        "ulna_reflex_options",
        prepare=_prepare_options(
            position=position,
            force=torque,
            reference=None,
            lowpass_hz=lowpass_hz,
            lowpass_order=lowpass_order,
            corrected=corrected,
            window=window,
            order=polynomial_order,
            plain_savgol=plain_savgol,
            pad=pad,
            threads=threads,
        ),
        intrinsic=pick(_INTRINSIC, intrinsic, "intrinsic"),
        side=pick(_SIDES, side, "side"),
        order=order,
        position_powers=_nonzero(position_powers, "position_powers"),
        drift=drift,
        refit=pick(_REFIT, refit, "refit"),
        threshold=threshold_rad_s,
        delay_min_s=low,
        delay_max_s=high,
        intrinsic_irf_s=_nonzero(intrinsic_irf_s, "intrinsic_irf_s"),
        reflex_irf_s=reflex_irf_s if reflex_irf_s else -1.0,
        train_s=train_s,
        lag_s=_nonzero(lag_s, "lag_s"),
        block_s=_nonzero(block_s, "block_s"),
        level=_nonzero(level, "level"),
        poor_vaf=poor_vaf if poor_vaf else 1e-12,
        draws=_nonzero(test_draws, "test_draws"),
        seed=seed,
        threads=threads,
    )
    out = ffi.new("ulna_reflex **")
    long_call(
        lib.ulna_reflex_identify,
        record._handle.pointer,
        chosen,
        ffi.NULL,
        out,
        progress=progress,
        label="reflex",
    )
    estimate = _reflex_estimate(_Reflex(out[0]), record, settings)
    _warn(estimate.warnings)
    return estimate


def _range(delay_range_s: Any) -> tuple[float, float]:
    try:
        low, high = (float(bound) for bound in delay_range_s)
    except (TypeError, ValueError):
        raise refuse(
            f"delay_range_s is {delay_range_s!r}; it must be two times, as (0.02, 0.1)",
            "delay_range_s",
        ) from None
    if not 0 <= low < high:
        raise refuse("delay_range_s must be two times, 0 <= low < high", "delay_range_s")
    return low, high


def _nonzero(value: Any, name: str) -> Any:
    """Zero bytes would mean the default, so a zero that the caller gave is refused here."""
    if value == 0:
        raise refuse(f"{name} must not be 0", name)
    return value


def _reflex_estimate(handle: _Reflex, record: Record, settings: dict[str, Any]) -> ReflexEstimate:
    info = result("ulna_reflex_info")
    check(lib.ulna_reflex_get_info(handle.pointer, info))

    def values(quantity: int) -> np.ndarray:
        return _frozen(out_array(lib.ulna_reflex_get_values, handle.pointer, quantity))

    def lines(which: int) -> tuple[str, ...]:
        return _lines(lib.ulna_reflex_get_text, handle, which)

    def response(lag: int, value: int, error: int) -> ImpulseResponse | None:
        lags = values(lag)
        return ImpulseResponse(lags, values(value), values(error)) if lags.size else None

    found = values(lib.ULNA_REFLEX_PARAMETERS)
    intervals = _frozen(values(lib.ULNA_REFLEX_INTERVALS).reshape(2, -1))
    warnings = lines(lib.ULNA_TEXT_WARNINGS)
    return ReflexEstimate(
        axis=lines(lib.ULNA_TEXT_AXES)[0],
        rotational=bool(info.rotational),
        **dict(
            zip(("M", "B", "K", "gain", "omega", "zeta", "delay_s"), map(float, found), strict=True)
        ),
        delay_interval_s=(float(intervals[0, 6]), float(intervals[1, 6])),
        cov=_frozen(values(lib.ULNA_REFLEX_COVARIANCE).reshape(7, 7)),
        p_value=info.p_value,
        vaf=info.vaf,
        vaf_interval=tuple(info.vaf_interval),
        vaf_intrinsic=info.vaf_intrinsic,
        vaf_reflex=info.vaf_reflex,
        vaf_without=info.vaf_without,
        vaf_gain_interval=tuple(info.gain_interval),
        vaf_train=info.vaf_train,
        vaf_train_without=info.vaf_train_without,
        vaf_train_other=info.vaf_train_other,
        vaf_impulse=info.vaf_impulse,
        side="rising" if info.side > 0 else "falling",
        intrinsic=settings["intrinsic"],
        order=settings["order"],
        intrinsic_response=response(
            lib.ULNA_REFLEX_INTRINSIC_LAG,
            lib.ULNA_REFLEX_INTRINSIC_RESPONSE,
            lib.ULNA_REFLEX_INTRINSIC_ERROR,
        ),
        reflex_response=response(
            lib.ULNA_REFLEX_REFLEX_LAG,
            lib.ULNA_REFLEX_REFLEX_RESPONSE,
            lib.ULNA_REFLEX_REFLEX_ERROR,
        ),
        profile_delay_s=values(lib.ULNA_REFLEX_PROFILE_DELAY),
        profile_vaf=values(lib.ULNA_REFLEX_PROFILE_VAF),
        powers=values(lib.ULNA_REFLEX_POWERS),
        powers_se=values(lib.ULNA_REFLEX_POWERS_ERROR),
        position_mean=info.position_mean,
        outcome=_first(_REFLEX_OUTCOMES, info.outcome),
        warnings=warnings,
        notes=lines(lib.ULNA_TEXT_NOTES),
        provenance=lines(lib.ULNA_TEXT_PROVENANCE),
        refitted=bool(info.refitted),
        train_rows=info.train_rows,
        held_out_rows=info.held_out_rows,
        train_s=info.train_s,
        test_blocks=info.test_blocks,
        trials=info.trials,
        preprocessing=_report(lib.ulna_reflex_get_preparation, handle),
        record=record,
        _intervals=intervals,
        _handle=handle,
        _settings=settings,
    )


# Delayed feedback --------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class DelayedFeedback:
    """An impedance with a delayed part. Made by :func:`identify_delayed_feedback`.

    Attributes
    ----------
    M, B, K : ndarray, shape (n, n)
        What acts at once.
    K_delayed, B_delayed : ndarray, shape (n, n)
        What acts `delay_s` later.
    x0 : ndarray, shape (n,)
    delay_s, delay_interval_s : float, (float, float)
        95 % interval from the profile.
    cov : ndarray
        Covariance of M, B, K, K_delayed, B_delayed row by row, x0, delay.
    p_value : float
        Of the test that there is no delayed feedback; NaN with too few blocks.
    vaf, vaf_without : ndarray, shape (n,)
        Held out, percent, with and without the delayed part.
    profile_delay_s, profile_statistic : ndarray
        Chi-square of one degree of each delay against the best.
    outcome : str
        "good", "suspect_data" (negative inertia), "not_significant", "ill_conditioned", "delay_at_bound" (its interval reaches the end
        of the range), "poor_fit" or "untested".
    """

    n: int
    axes: tuple[str, ...]
    rotational: bool
    M: np.ndarray
    B: np.ndarray
    K: np.ndarray
    K_delayed: np.ndarray
    B_delayed: np.ndarray
    x0: np.ndarray
    delay_s: float
    delay_interval_s: tuple[float, float]
    cov: np.ndarray
    p_value: float
    vaf: np.ndarray
    vaf_without: np.ndarray
    profile_delay_s: np.ndarray
    profile_statistic: np.ndarray
    condition: float
    estimator: str
    outcome: str
    warnings: tuple[str, ...]
    notes: tuple[str, ...]
    provenance: tuple[str, ...]
    refitted: bool
    train_rows: int
    held_out_rows: int
    test_blocks: int
    preprocessing: Preprocessing
    record: Record
    _settings: dict[str, Any] = field(repr=False)

    @property
    def units(self) -> dict[str, str]:
        """Unit of every parameter."""
        k, b = ("N m/rad", "N m s/rad") if self.rotational else ("N/m", "N s/m")
        mass, place = ("kg m^2", "rad") if self.rotational else ("kg", "m")
        return {"M": mass, "B": b, "K": k, "K_delayed": k, "B_delayed": b, "x0": place}

    def se(self, name: str) -> np.ndarray:
        """Standard errors of a matrix or x0, in its shape."""
        names = ("M", "B", "K", "K_delayed", "B_delayed", "x0")
        if name not in names:
            raise refuse(f"there is no parameter {name!r}; there are {', '.join(names)}", "name")
        n = self.n
        first = names.index(name) * n * n
        shape = (n,) if name == "x0" else (n, n)
        return np.sqrt(np.diag(self.cov)[first : first + int(np.prod(shape))]).reshape(shape)

    def summary(self) -> str:
        """The estimate as text of at most 80 columns."""
        from ._reflex_words import delayed_summary

        return delayed_summary(self)

    def plot(self, ax: Any = None) -> Any:
        """Profile over the delay (needs matplotlib)."""
        from . import plot

        return plot.delay_profile(self, ax)

    def __reduce__(self) -> tuple[Any, ...]:
        return _again, (identify_delayed_feedback, self.record, self._settings)

    def __repr__(self) -> str:
        low, high = self.delay_interval_s
        return (
            f"<DelayedFeedback K={np.round(self.K, 3).tolist()} "
            f"K_delayed={np.round(self.K_delayed, 3).tolist()}±"
            f"{np.round(self.se('K_delayed'), 3).tolist()} {self.units['K']}, delay "
            f"{1e3 * self.delay_s:.1f} ({1e3 * low:.1f} to {1e3 * high:.1f}) ms, {self.outcome}>"
        )


def identify_delayed_feedback(
    record: Record,
    force: str | Sequence[str] | None = None,
    position: str | Sequence[str] | None = None,
    reference: str | Sequence[str] | None = None,
    *,
    delay_range_s: tuple[float, float] = (0.02, 0.25),
    estimator: str = "auto",
    train_s: float | None = None,
    refit: bool | None = None,
    lag_s: float = 0.4,
    block_s: float = 2.0,
    level: float = 0.05,
    test_draws: int = 1999,
    condition_limit: float = 1000.0,
    poor_vaf: float = 80.0,
    seed: int = 0,
    lowpass_hz: float | None = None,
    lowpass_order: int | None = None,
    corrected: bool = False,
    window: int | None = None,
    order: int | None = None,
    plain_savgol: bool = False,
    pad: str = "pole-radius",
    threads: int = 0,
    progress: bool = False,
) -> DelayedFeedback:
    """Impedance along one or two axes with a delayed stiffness and damping, delay included.

    The model is::

        M x'' + B x' + K (x - x0) + K_d (x(t - tau) - x0) + B_d x'(t - tau) = -F

    tau is identified with the rest, with an interval from the profile of the fit.

    Parameters
    ----------
    record : Record
    force, position, reference : str or list of str, optional
        As :func:`ulna.identify_impedance`.
    delay_range_s : (float, float)
    estimator : {"auto", "instrumental_variables", "least_squares"}
        "auto": instrumental variables (the reference at once and at delays over the range) where
        the record holds a reference for every axis.
    block_s, level, test_draws
        Of the test whether there is delayed feedback: sign flips of blocks.
    train_s, refit, lag_s, condition_limit, poor_vaf, seed
        As :func:`ulna.identify_impedance`.
    lowpass_hz, lowpass_order, corrected, window, order, plain_savgol, pad
        As :func:`ulna.preprocess`.

    Returns
    -------
    DelayedFeedback

    Raises
    ------
    ulna.AnalysisError
        The motion does not tell the immediate from the delayed response.

    Examples
    --------
    >>> import ulna, warnings
    >>> log = ulna.read("examples/data/relaxed-arm.csv")
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("ignore")
    ...     est = ulna.identify_delayed_feedback(log, condition_limit=1e5)
    >>> est.K_delayed.shape
    (2, 2)
    """
    settings = {k: v for k, v in locals().items() if k not in ("record", "progress")}
    _require_record(record)
    low, high = _range(delay_range_s)
    chosen = options(
        "ulna_delayed_options",
        prepare=_prepare_options(
            position=position,
            force=force,
            reference=reference,
            lowpass_hz=lowpass_hz,
            lowpass_order=lowpass_order,
            corrected=corrected,
            window=window,
            order=order,
            plain_savgol=plain_savgol,
            pad=pad,
            threads=threads,
        ),
        estimator=pick(_ESTIMATORS, estimator, "estimator"),
        refit=pick(_REFIT, refit, "refit"),
        delay_min_s=low if low else -1.0,
        delay_max_s=high,
        train_s=train_s,
        lag_s=_nonzero(lag_s, "lag_s"),
        block_s=_nonzero(block_s, "block_s"),
        level=_nonzero(level, "level"),
        condition_limit=_nonzero(condition_limit, "condition_limit"),
        poor_vaf=poor_vaf if poor_vaf else 1e-12,
        draws=_nonzero(test_draws, "test_draws"),
        seed=seed,
        threads=threads,
    )
    out = ffi.new("ulna_delayed **")
    long_call(
        lib.ulna_delayed_identify,
        record._handle.pointer,
        chosen,
        ffi.NULL,
        out,
        progress=progress,
        label="delayed feedback",
    )
    estimate = _delayed_estimate(_Delayed(out[0]), record, settings)
    _warn(estimate.warnings)
    return estimate


def _delayed_estimate(
    handle: _Delayed, record: Record, settings: dict[str, Any]
) -> DelayedFeedback:
    info = result("ulna_delayed_info")
    check(lib.ulna_delayed_get_info(handle.pointer, info))
    n = info.axes

    def values(quantity: int) -> np.ndarray:
        return _frozen(out_array(lib.ulna_delayed_get_values, handle.pointer, quantity))

    def lines(which: int) -> tuple[str, ...]:
        return _lines(lib.ulna_delayed_get_text, handle, which)

    found = values(lib.ULNA_DELAYED_PARAMETERS)
    matrices = [_frozen(part) for part in found[: 5 * n * n].reshape(5, n, n)]
    instrumental = info.estimator == lib.ULNA_ESTIMATOR_INSTRUMENTAL
    return DelayedFeedback(
        n=n,
        axes=lines(lib.ULNA_TEXT_AXES),
        rotational=bool(info.rotational),
        M=matrices[0],
        B=matrices[1],
        K=matrices[2],
        K_delayed=matrices[3],
        B_delayed=matrices[4],
        x0=_frozen(found[5 * n * n : 5 * n * n + n]),
        delay_s=info.delay_s,
        delay_interval_s=tuple(info.delay_interval),
        cov=_frozen(values(lib.ULNA_DELAYED_COVARIANCE).reshape(found.size, found.size)),
        p_value=info.p_value,
        vaf=values(lib.ULNA_DELAYED_VAF),
        vaf_without=values(lib.ULNA_DELAYED_VAF_WITHOUT),
        profile_delay_s=values(lib.ULNA_DELAYED_PROFILE_DELAY),
        profile_statistic=values(lib.ULNA_DELAYED_PROFILE_STATISTIC),
        condition=info.condition,
        estimator="instrumental_variables" if instrumental else "least_squares",
        outcome=_first(_DELAYED_OUTCOMES, info.outcome),
        warnings=lines(lib.ULNA_TEXT_WARNINGS),
        notes=lines(lib.ULNA_TEXT_NOTES),
        provenance=lines(lib.ULNA_TEXT_PROVENANCE),
        refitted=bool(info.refitted),
        train_rows=info.train_rows,
        held_out_rows=info.held_out_rows,
        test_blocks=info.test_blocks,
        preprocessing=_report(lib.ulna_delayed_get_preparation, handle),
        record=record,
        _settings=settings,
    )


# The first window --------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class WindowComparison:
    """Impedance in the first window after perturbations and after it. See :func:`compare_windows`.

    Attributes
    ----------
    early, late : dict
        "M", "B" and "K" as arrays (n, n), in the window and after it.
    early_cov, late_cov, difference_cov : ndarray
        Covariances of M, B, K row by row; the last of late less early.
    degrees : float
        Of Student's t for intervals: perturbations less one.
    p_value : float
        Of the test that both windows have the same B and K; NaN with too few perturbations.
    early_vaf, late_vaf : ndarray, shape (n,)
        Percent, on the rows of the fit.
    onsets_s : ndarray
        Perturbations used.
    guard_s : float
        Left out on either side of the border, where the filter mixes both sides.
    outcome : str
        "good", "smeared" (the low pass reaches across the border), "ill_conditioned", "untested".
    """

    n: int
    axes: tuple[str, ...]
    rotational: bool
    window_s: float
    early: dict[str, np.ndarray]
    late: dict[str, np.ndarray]
    early_cov: np.ndarray
    late_cov: np.ndarray
    difference_cov: np.ndarray
    degrees: float
    p_value: float
    early_vaf: np.ndarray
    late_vaf: np.ndarray
    onsets_s: np.ndarray
    guard_s: float
    condition: float
    estimator: str
    outcome: str
    warnings: tuple[str, ...]
    notes: tuple[str, ...]
    provenance: tuple[str, ...]
    preprocessing: Preprocessing
    record: Record
    _t: float = field(repr=False)
    _settings: dict[str, Any] = field(repr=False)

    @property
    def units(self) -> dict[str, str]:
        """Unit of M, B and K."""
        if self.rotational:
            return {"M": "kg m^2", "B": "N m s/rad", "K": "N m/rad"}
        return {"M": "kg", "B": "N s/m", "K": "N/m"}

    @property
    def difference(self) -> dict[str, np.ndarray]:
        """Late less early."""
        return {name: self.late[name] - self.early[name] for name in _MATRICES}

    def _error(self, covariance: np.ndarray, name: str) -> np.ndarray:
        if name not in _MATRICES:
            raise refuse(f"there is no parameter {name!r}; there are M, B and K", "name")
        size = self.n * self.n
        first = _MATRICES.index(name) * size
        return np.sqrt(np.diag(covariance)[first : first + size]).reshape(self.n, self.n)

    def se(self, name: str, *, part: str = "difference") -> np.ndarray:
        """Standard errors of "M", "B" or "K" of the "early" or "late" part, or of the difference."""
        table = {
            "early": self.early_cov,
            "late": self.late_cov,
            "difference": self.difference_cov,
        }
        if part not in table:
            raise refuse(f"part is {part!r}; it must be one of {', '.join(table)}", "part")
        return self._error(table[part], name)

    def interval(self, name: str, *, part: str = "difference") -> tuple[np.ndarray, np.ndarray]:
        """95 % interval: low and high, by Student's t over the perturbations."""
        value = self.difference[name] if part == "difference" else None
        half = self._t * self.se(name, part=part)
        if value is None:
            value = (self.early if part == "early" else self.late)[name]
        return value - half, value + half

    def summary(self) -> str:
        """The comparison as text of at most 80 columns."""
        from ._reflex_words import windows_summary

        return windows_summary(self)

    def plot(self) -> Any:
        """Both windows side by side with intervals (needs matplotlib)."""
        from . import plot

        return plot.windows(self)

    def __reduce__(self) -> tuple[Any, ...]:
        return _again, (compare_windows, self.record, self._settings)

    def __repr__(self) -> str:
        change = self.difference["K"]
        return (
            f"<WindowComparison of {len(self.onsets_s)} perturbations, first "
            f"{1e3 * self.window_s:.0f} ms: K changes by {np.round(change, 3).tolist()}±"
            f"{np.round(self.se('K'), 3).tolist()} {self.units['K']}, p = {self.p_value:.3g}, "
            f"{self.outcome}>"
        )


def compare_windows(
    record: Record,
    force: str | Sequence[str] | None = None,
    position: str | Sequence[str] | None = None,
    reference: str | Sequence[str] | None = None,
    *,
    window_s: float = 0.1,
    after_s: float = 1.0,
    baseline_s: float = 0.1,
    onsets_s: Any = None,
    free_inertia: bool = False,
    estimator: str = "auto",
    level: float = 0.05,
    test_draws: int = 1999,
    condition_limit: float = 1000.0,
    seed: int = 0,
    lowpass_hz: float | None = None,
    lowpass_order: int | None = None,
    corrected: bool = False,
    window: int | None = None,
    order: int | None = None,
    plain_savgol: bool = False,
    pad: str = "pole-radius",
    threads: int = 0,
    progress: bool = False,
) -> WindowComparison:
    """Impedance before the nervous system can react against impedance after.

    Every perturbation is cut, after the whole record has been filtered, into its first `window_s`
    and the rest up to `after_s`; a period of the low pass on either side of the border, where the
    filter mixes both, is left out. One fit to all of them gives B and K of either part and one M
    (`free_inertia`: an M of its own in either). Force and position count from their means over
    `baseline_s` before the onset. Errors leave one perturbation out at a time.

    Parameters
    ----------
    record : Record
        With segments around the perturbations (as ``record.select(onsets_s=...)`` makes them), or
        with a reference from which onsets are found.
    force, position, reference : str or list of str, optional
        As :func:`ulna.identify_impedance`.
    window_s, after_s, baseline_s : float
    onsets_s : array_like, optional
        Onsets in the record's clock, in order. Default: one in each segment, or where the reference
        leaves a rest.
    estimator : {"auto", "instrumental_variables", "least_squares"}
    lowpass_hz : float, optional
        Default: 5 / `window_s`, so that the filter does not carry what follows into the window.
    level, test_draws
        Of the test that both parts agree: sign flips of perturbations.
    lowpass_order, corrected, window, order, plain_savgol, pad
        As :func:`ulna.preprocess`.

    Returns
    -------
    WindowComparison

    Raises
    ------
    ulna.DataError
        No perturbation is found, or fewer than three can be used.
    ulna.AnalysisError
        A window does not determine its parameters.

    Examples
    --------
    A hand whose stiffness does not change:

    >>> import numpy as np, ulna
    >>> t = np.arange(24000) / 1000
    >>> onsets = np.arange(1.0, 23.0, 2.0)
    >>> x, v, a = np.zeros((3, t.size))
    >>> for k, onset in enumerate(onsets):
    ...     w = 15 + 2 * k
    ...     on = (t > onset) & (t < onset + 2 * np.pi / w)
    ...     c, s = np.cos(w * (t - onset)) * on, np.sin(w * (t - onset)) * on
    ...     x += 0.002 * on * (1 - c) ** 2
    ...     v += 0.004 * w * (1 - c) * s
    ...     a += 0.004 * w**2 * (s**2 + (1 - c) * c)
    >>> noise = 0.05 * np.random.default_rng(0).normal(size=t.size)
    >>> log = ulna.Record.from_arrays(
    ...     t, {"x": x, "F_x": -(1.2 * a + 8 * v + 150 * x) + noise}
    ... )
    >>> windows = ulna.compare_windows(log, onsets_s=onsets, window_s=0.2)
    >>> bool(windows.p_value > 0.01), len(windows.onsets_s)
    (True, 11)
    """
    settings = {k: v for k, v in locals().items() if k not in ("record", "progress")}
    _require_record(record)
    onsets = None
    if onsets_s is not None:
        onsets = np.asarray(onsets_s, dtype=float).reshape(-1)
        if onsets.size == 0:
            raise refuse("onsets_s is empty; leave it out to have onsets found", "onsets_s")
    chosen = options(
        "ulna_windows_options",
        prepare=_prepare_options(
            position=position,
            force=force,
            reference=reference,
            lowpass_hz=lowpass_hz,
            lowpass_order=lowpass_order,
            corrected=corrected,
            window=window,
            order=order,
            plain_savgol=plain_savgol,
            pad=pad,
            threads=threads,
        ),
        onsets_s=None if onsets is None else view(onsets),
        window_s=_nonzero(window_s, "window_s"),
        after_s=_nonzero(after_s, "after_s"),
        baseline_s=_nonzero(baseline_s, "baseline_s"),
        condition_limit=_nonzero(condition_limit, "condition_limit"),
        level=_nonzero(level, "level"),
        draws=_nonzero(test_draws, "test_draws"),
        seed=seed,
        estimator=pick(_ESTIMATORS, estimator, "estimator"),
        free_inertia=free_inertia,
        threads=threads,
    )
    out = ffi.new("ulna_windows **")
    long_call(
        lib.ulna_windows_compare,
        record._handle.pointer,
        chosen,
        ffi.NULL,
        out,
        progress=progress,
        label="windows",
    )
    comparison = _comparison(_Windows(out[0]), record, settings)
    _warn(comparison.warnings)
    return comparison


def _comparison(handle: _Windows, record: Record, settings: dict[str, Any]) -> WindowComparison:
    info = result("ulna_windows_info")
    check(lib.ulna_windows_get_info(handle.pointer, info))
    n = info.axes
    size = 3 * n * n

    def values(quantity: int, *shape: int) -> np.ndarray:
        array = out_array(lib.ulna_windows_get_values, handle.pointer, quantity)
        return _frozen(array.reshape(shape or -1))

    def lines(which: int) -> tuple[str, ...]:
        return _lines(lib.ulna_windows_get_text, handle, which)

    def matrices(quantity: int) -> dict[str, np.ndarray]:
        return dict(zip(_MATRICES, values(quantity, 3, n, n), strict=True))

    instrumental = info.estimator == lib.ULNA_ESTIMATOR_INSTRUMENTAL
    return WindowComparison(
        n=n,
        axes=lines(lib.ULNA_TEXT_AXES),
        rotational=bool(info.rotational),
        window_s=settings["window_s"],
        early=matrices(lib.ULNA_WINDOWS_EARLY),
        late=matrices(lib.ULNA_WINDOWS_LATE),
        early_cov=values(lib.ULNA_WINDOWS_EARLY_COVARIANCE, size, size),
        late_cov=values(lib.ULNA_WINDOWS_LATE_COVARIANCE, size, size),
        difference_cov=values(lib.ULNA_WINDOWS_DIFFERENCE_COVARIANCE, size, size),
        degrees=info.degrees,
        p_value=info.p_value,
        early_vaf=values(lib.ULNA_WINDOWS_EARLY_VAF),
        late_vaf=values(lib.ULNA_WINDOWS_LATE_VAF),
        onsets_s=values(lib.ULNA_WINDOWS_ONSETS),
        guard_s=info.guard_s,
        condition=info.condition,
        estimator="instrumental_variables" if instrumental else "least_squares",
        outcome=_first(_WINDOW_OUTCOMES, info.outcome),
        warnings=lines(lib.ULNA_TEXT_WARNINGS),
        notes=lines(lib.ULNA_TEXT_NOTES),
        provenance=lines(lib.ULNA_TEXT_PROVENANCE),
        preprocessing=_report(lib.ulna_windows_get_preparation, handle),
        record=record,
        _t=info.quantile,
        _settings=settings,
    )
