"""Mechanical impedance from a perturbation experiment, with its uncertainty.

The model is (3.2) of Dyck (2013), for one joint or a hand in up to six axes::

    M x'' + B x' + K (x - x0) = -F

x is the position of the hand (m) or joint (rad) and F the force (N) or torque (N m) that the human
exerts on the robot.
"""

from __future__ import annotations

import warnings as _warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from statistics import NormalDist
from typing import TYPE_CHECKING, Any

import numpy as np

from . import passivity as _passivity
from ._call import (
    ArgumentError,
    Handle,
    check,
    ffi,
    lib,
    long_call,
    options,
    out_array,
    result,
    text,
    view,
)
from .record import Record, _Record, pick

if TYPE_CHECKING:
    from .passivity import PassivityVerdict

__all__ = [
    "Ellipse",
    "ImpedanceEstimate",
    "MotionShare",
    "Preprocessing",
    "Signals",
    "UncertainResult",
    "ellipse",
    "identify_impedance",
    "preprocess",
]

_MODELS = {
    "free": lib.ULNA_MODEL_FREE,
    "symmetric": lib.ULNA_MODEL_SYMMETRIC,
    "passive": lib.ULNA_MODEL_PASSIVE,
}
_ESTIMATORS = {
    "auto": lib.ULNA_ESTIMATOR_AUTO,
    "least_squares": lib.ULNA_ESTIMATOR_LEAST_SQUARES,
    "instrumental_variables": lib.ULNA_ESTIMATOR_INSTRUMENTAL,
    "ls": lib.ULNA_ESTIMATOR_LEAST_SQUARES,
    "iv": lib.ULNA_ESTIMATOR_INSTRUMENTAL,
}
_ERRORS = {
    "newey-west": lib.ULNA_ERRORS_NEWEY_WEST,
    "bootstrap": lib.ULNA_ERRORS_BLOCK_BOOTSTRAP,
}
_PADS = {"pole-radius": lib.ULNA_PAD_POLE_RADIUS, "scipy": lib.ULNA_PAD_SCIPY}
_REFIT = {None: lib.ULNA_REFIT_AUTO, True: lib.ULNA_REFIT_YES, False: lib.ULNA_REFIT_NO}
# Most serious first: the outcome of an estimate is the first that holds.
_OUTCOMES = {
    "suspect_data": lib.ULNA_OUTCOME_SUSPECT_DATA,
    "not_converged": lib.ULNA_OUTCOME_NOT_CONVERGED,
    "ill_conditioned": lib.ULNA_OUTCOME_ILL_CONDITIONED,
    "closed_loop_biased": lib.ULNA_OUTCOME_CLOSED_LOOP_BIASED,
    "poor_fit": lib.ULNA_OUTCOME_POOR_FIT,
    "force_lag": lib.ULNA_OUTCOME_FORCE_LAG,
    "not_finite": lib.ULNA_OUTCOME_NOT_FINITE,
}
_MATRICES = {"M": lib.ULNA_IMPEDANCE_M, "B": lib.ULNA_IMPEDANCE_B, "K": lib.ULNA_IMPEDANCE_K}
_USES = {"train": 1, "held-out": 2}


class UncertainResult(UserWarning):
    """An estimate whose outcome is not good: read its warnings before using it."""


class _Impedance(Handle):
    kind = "ulna_impedance"
    __slots__ = ()


@dataclass(frozen=True)
class Preprocessing:
    """What the filters did to the signals, the same to each.

    Attributes
    ----------
    rate_hz : float
        Sample rate.
    lowpass_hz, lowpass_order
        Butterworth low pass of one pass (it runs forward and backward); 0 without one.
    effective_cutoff_hz : float
        -3 dB frequency of the whole smoother.
    motion_band_hz : float
        Frequency below which 95 % of the power of the velocity lies: of the reference's, if the
        record holds one, so that tremor does not widen it.
    window, order : int
        Savitzky-Golay window (samples) and polynomial order.
    flagged_start, flagged_end : int
        Samples dropped at either end of a trial, where the window is not full.
    transient : int
        Samples at either end where the extension of the signal still shows in the filtered signals
        (the same in all of them, so that the parameters are not affected).
    pad : int
        Samples by which either end was extended.
    velocity_consistency, position_consistency : float
        Acceleration integrated once against the velocity, and twice against the position, over ten
        seconds: rms of the difference over rms of the motion (Fig. 3.6 of Dyck, 2013). Correct
        filters leave 1e-3 and less.
    """

    rate_hz: float
    lowpass_hz: float
    lowpass_order: int
    lowpass_chosen: bool
    effective_cutoff_hz: float
    motion_band_hz: float
    window: int
    order: int
    flagged_start: int
    flagged_end: int
    transient: int
    pad: int
    short_trials: bool
    velocity_consistency: float
    position_consistency: float

    @property
    def band_hz(self) -> tuple[float, float]:
        """Band that the estimate speaks for: from the slowest motion to the effective cut-off."""
        return 0.0, self.effective_cutoff_hz

    def text(self) -> str:
        """One paragraph about the filters."""
        words = (
            f"Savitzky-Golay order {self.order}, window {self.window} samples "
            f"({1e3 * self.window / self.rate_hz:.0f} ms)"
        )
        if self.lowpass_order:
            chosen = ", chosen from the motion" if self.lowpass_chosen else ""
            words += (
                f"; zero-phase Butterworth order {self.lowpass_order} at {self.lowpass_hz:.3g} Hz"
                f"{chosen}"
            )
        return words + (
            f"; -3 dB at {self.effective_cutoff_hz:.3g} Hz in all. The motion holds 95 % of its "
            f"velocity's power below {self.motion_band_hz:.3g} Hz. {self.flagged_start} samples are dropped "
            f"at the start and {self.flagged_end} at the end of a trial; the filter's end transient "
            f"lasts {self.transient} samples. The acceleration, integrated twice, gives the position "
            f"back to {100 * self.position_consistency:.2g} %."
        )


def _preprocessing(report: Any) -> Preprocessing:
    return Preprocessing(
        rate_hz=report.rate_hz,
        lowpass_hz=report.lowpass_hz,
        lowpass_order=report.lowpass_order,
        lowpass_chosen=bool(report.lowpass_chosen),
        effective_cutoff_hz=report.effective_cutoff_hz,
        motion_band_hz=report.motion_band_hz,
        window=report.window,
        order=report.order,
        flagged_start=report.dropped_rows,
        flagged_end=report.dropped_rows,
        transient=report.transient_rows,
        pad=report.pad_rows,
        short_trials=bool(report.short_trials),
        velocity_consistency=report.velocity_consistency,
        position_consistency=report.position_consistency,
    )


@dataclass(frozen=True)
class MotionShare:
    """Share of the motion's power that the reference does not explain: rho of the human.

    Attributes
    ----------
    freq_hz : ndarray, shape (f,)
    value : ndarray, shape (f, n)
        0 to 1, one minus the multiple coherence.
    total : ndarray, shape (n,)
        Over the whole band, weighted by power.
    """

    freq_hz: np.ndarray
    value: np.ndarray
    total: np.ndarray


@dataclass(frozen=True)
class Signals:
    """Prepared signals with the force that the fit predicts; arrays are (rows, n)."""

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    force: np.ndarray
    force_predicted: np.ndarray


@dataclass(frozen=True)
class Ellipse:
    """Ellipse of the symmetric part of a 2 x 2 impedance matrix and its antisymmetric part.

    Dyck (2013), (3.11) to (3.17) and (3.26). Intervals are (low, high), NaN where there are none.

    Attributes
    ----------
    major, minor : float
        Eigenvalues of the symmetric part, in the unit of the matrix.
    area : float
        pi major minor.
    shape : float
        major / minor; NaN unless minor is positive.
    angle_deg : float
        Of the major axis to +x, 0 to 180; NaN where `angle_defined` is false.
    antisymmetry : float
        \\|z_xy - z_yx\\| / 2 over sqrt(major minor).
    angle_defined : bool
        False for an isotropic matrix, or one not distinguishable from it.
    """

    major: float
    minor: float
    area: float
    shape: float
    angle_deg: float
    antisymmetric: float
    antisymmetry: float
    angle_defined: bool
    major_interval: tuple[float, float]
    minor_interval: tuple[float, float]
    area_interval: tuple[float, float]
    shape_interval: tuple[float, float]
    angle_deg_interval: tuple[float, float]
    antisymmetry_interval: tuple[float, float]


def _ellipse(raw: Any) -> Ellipse:
    defined = bool(raw.angle_defined)
    degrees = 180.0 / np.pi if defined else np.nan
    return Ellipse(
        major=raw.major,
        minor=raw.minor,
        area=raw.area,
        shape=raw.shape,
        angle_deg=raw.angle_rad * degrees,
        antisymmetric=raw.antisymmetric,
        antisymmetry=raw.antisymmetry,
        angle_defined=defined,
        major_interval=tuple(raw.major_interval),
        minor_interval=tuple(raw.minor_interval),
        area_interval=tuple(raw.area_interval),
        shape_interval=tuple(raw.shape_interval),
        angle_deg_interval=tuple(bound * degrees for bound in raw.angle_interval_rad),
        antisymmetry_interval=tuple(raw.antisymmetry_interval),
    )


def ellipse(matrix: Any) -> Ellipse:
    """Ellipse of a 2 x 2 matrix.

    Parameters
    ----------
    matrix : array_like, shape (2, 2)
        Inertia, damping or stiffness; finite.

    Examples
    --------
    Stiffness of participant P1, Tables 3.2 and 3.3 of Dyck (2013):

    >>> import ulna
    >>> e = ulna.ellipse([[42.45, -34.38], [-23.02, 125.43]])
    >>> f"{e.area:.0f} {e.shape:.1f} {e.angle_deg:.1f}"
    '14140 4.0 107.3'
    """
    raw = result("ulna_ellipse")
    check(lib.ulna_ellipse_of(view(np.asarray(matrix)), raw))
    return _ellipse(raw)


@dataclass(frozen=True, eq=False)
class ImpedanceEstimate:
    """An identified impedance. Made by :func:`identify_impedance`.

    Attributes
    ----------
    M, B, K : ndarray, shape (n, n)
        Inertia, damping and stiffness; rows are force axes, columns motion axes.
    x0 : ndarray, shape (n,)
        Equilibrium position; NaN where K is singular.
    cov : ndarray, shape (3 n^2 + n, 3 n^2 + n)
        Covariance of M, B, K row by row, then x0.
    vaf, vaf_interval : ndarray, shape (n,) and (2, n)
        Variance of the force accounted for on data not used for the fit, percent, with its 95 %
        interval. NaN when nothing was held out.
    vaf_train : ndarray, shape (n,)
        The same on the data used for the fit.
    vaf_reference : ndarray, shape (n,)
        Variance accounted for of the force that the perturbation caused, percent: the human's own
        force does not lower it, a model that does not hold does. NaN without a reference.
    outcome : str
        "good", or what to look at before use: "suspect_data" (as a unit that looks wrong),
        "closed_loop_biased", "poor_fit",
        "ill_conditioned", "force_lag", "not_converged" or "not_finite".
    warnings, notes : tuple of str
        In plain words.
    estimator : str
        "instrumental_variables" or "least_squares".
    least_squares : ImpedanceEstimate or None
        Least squares on the same data, where this is an instrumental estimate.
    rho : MotionShare or None
        Share of the motion that the reference does not explain; None without a reference.
    difference_p : float
        p value of the test that both estimators agree; NaN without a reference.
    lag_s, lag_se_s : float
        How much later the force is than the motion, with its standard error.
    trials : ndarray or None
        M, B, K row by row and x0 of every trial, one a row; with `trial_mean` and `trial_se`.
    condition : float
        Condition number of the regressors in unit columns.
    preprocessing : Preprocessing
    record : Record
    """

    n: int
    axes: tuple[str, ...]
    rotational: bool
    M: np.ndarray
    B: np.ndarray
    K: np.ndarray
    x0: np.ndarray
    cov: np.ndarray
    vaf: np.ndarray
    vaf_interval: np.ndarray
    vaf_train: np.ndarray
    vaf_reference: np.ndarray
    outcome: str
    warnings: tuple[str, ...]
    notes: tuple[str, ...]
    condition: float
    constrained: bool
    estimator: str
    least_squares: ImpedanceEstimate | None
    rho: MotionShare | None
    difference_p: float
    lag_s: float
    lag_se_s: float
    trials: np.ndarray | None
    trial_mean: np.ndarray | None
    trial_se: np.ndarray | None
    train_rows: int
    held_out_rows: int
    train_s: float
    refitted: bool
    payload_kg: float
    preprocessing: Preprocessing
    provenance: tuple[str, ...]
    record: Record
    _handle: _Impedance = field(repr=False)
    _fit: int = field(repr=False)
    _settings: dict[str, Any] = field(repr=False)

    # Parameters and their uncertainty --------------------------------------------------------

    @property
    def units(self) -> dict[str, str]:
        """Unit of M, B, K and x0."""
        if self.rotational:
            return {"M": "kg m^2", "B": "N m s/rad", "K": "N m/rad", "x0": "rad"}
        return {"M": "kg", "B": "N s/m", "K": "N/m", "x0": "m"}

    def _place(self, name: str) -> tuple[slice, tuple[int, ...]]:
        n = self.n
        try:
            first = {"M": 0, "B": n * n, "K": 2 * n * n, "x0": 3 * n * n}[name]
        except KeyError:
            raise ArgumentError(
                f"there is no parameter {name!r}; there are M, B, K and x0",
                status="ULNA_ERROR_ARGUMENT",
                argument="name",
            ) from None
        shape = (n,) if name == "x0" else (n, n)
        return slice(first, first + int(np.prod(shape))), shape

    def se(self, name: str) -> np.ndarray:
        """Standard errors of "M", "B", "K" or "x0", in its shape."""
        place, shape = self._place(name)
        return np.sqrt(np.diag(self.cov)[place]).reshape(shape)

    @property
    def M_se(self) -> np.ndarray:
        """Standard errors of M."""
        return self.se("M")

    @property
    def B_se(self) -> np.ndarray:
        """Standard errors of B."""
        return self.se("B")

    @property
    def K_se(self) -> np.ndarray:
        """Standard errors of K."""
        return self.se("K")

    @property
    def x0_se(self) -> np.ndarray:
        """Standard errors of x0."""
        return self.se("x0")

    def interval(self, name: str, *, level: float = 0.95) -> tuple[np.ndarray, np.ndarray]:
        """Confidence interval of "M", "B", "K" or "x0": low and high, each in its shape."""
        if not 0.0 < level < 1.0:
            raise ArgumentError(
                f"level is {level!r}; it must lie between 0 and 1",
                status="ULNA_ERROR_ARGUMENT",
                argument="level",
            )
        value = getattr(self, name) if name in ("M", "B", "K", "x0") else self._place(name)
        half = NormalDist().inv_cdf(0.5 * (1.0 + level)) * self.se(name)
        return value - half, value + half

    def draws(self, *, count: int | None = None, seed: int = 0) -> dict[str, np.ndarray]:
        """Sampled parameters: arrays (count, n, n) for M, B, K and (count, n) for x0.

        Gaussian draws from the covariance, or bootstrap replicates. `count` picks that many of them
        at random; None gives all.
        """
        rows = self._values(lib.ULNA_IMPEDANCE_DRAWS).reshape(-1, self.cov.shape[0])
        if count is not None:
            if count < 1:
                raise ArgumentError(
                    f"count is {count!r}; it must be at least 1",
                    status="ULNA_ERROR_ARGUMENT",
                    argument="count",
                )
            rows = rows[np.random.default_rng(seed).integers(0, len(rows), count)]
        out = {}
        for name in ("M", "B", "K", "x0"):
            place, shape = self._place(name)
            out[name] = rows[:, place].reshape(-1, *shape)
        return out

    def _values(self, quantity: int) -> np.ndarray:
        return out_array(lib.ulna_impedance_get_values, self._handle.pointer, self._fit, quantity)

    # What follows from them ------------------------------------------------------------------

    def ellipses(self, *, level: float = 0.95) -> dict[str, Ellipse]:
        """Inertia, damping and stiffness ellipses with intervals, as {"M": ..., "B": ..., "K": ...}.

        Only for two axes.
        """
        out = {}
        for name, quantity in _MATRICES.items():
            raw = result("ulna_ellipse")
            pointer = self._handle.pointer
            check(lib.ulna_impedance_get_ellipse(pointer, self._fit, quantity, level, raw))
            out[name] = _ellipse(raw)
        return out

    def passivity(self, **keywords: Any) -> PassivityVerdict:
        """Is the limb passive, and how sure is that? Keywords as :func:`ulna.passivity.assess`."""
        return _passivity.assess(self, **keywords)

    def signals(self, split: str = "all", *, trial: int = 0) -> Signals:
        """Prepared signals of a trial and the force that this fit predicts.

        Parameters
        ----------
        split : {"all", "train", "held-out"}
        """
        if split != "all":
            pick(_USES, split, "split")

        def get(which: int) -> np.ndarray:
            values = out_array(
                lib.ulna_impedance_get_signals, self._handle.pointer, self._fit, trial, which
            )
            one = which in (lib.ULNA_SIGNAL_TIME, lib.ULNA_SIGNAL_USE)
            return values if one else values.reshape(-1, self.n)

        time = get(lib.ULNA_SIGNAL_TIME)
        keep = slice(None) if split == "all" else get(lib.ULNA_SIGNAL_USE) == _USES[split]
        return Signals(
            time=time[keep],
            position=get(lib.ULNA_SIGNAL_POSITION)[keep],
            velocity=get(lib.ULNA_SIGNAL_VELOCITY)[keep],
            acceleration=get(lib.ULNA_SIGNAL_ACCELERATION)[keep],
            force=get(lib.ULNA_SIGNAL_FORCE)[keep],
            force_predicted=get(lib.ULNA_SIGNAL_FORCE_PREDICTED)[keep],
        )

    # Words and pictures ----------------------------------------------------------------------

    def summary(self) -> str:
        """The estimate as a table for the terminal, at most 80 columns wide."""
        from ._words import impedance_summary

        return impedance_summary(self)

    def plot(self) -> Any:
        """Figure with parameters, prediction and ellipses (needs matplotlib)."""
        from . import plot

        return plot.overview(self)

    def __reduce__(self) -> tuple[Any, ...]:
        # The same record and settings give the same bits, so they are all that has to travel.
        return _again, (self.record, self._settings, self._fit)

    def __repr__(self) -> str:
        parts = []
        for name in ("M", "B", "K"):
            value, error = getattr(self, name), self.se(name)
            entries = " ".join(
                f"{v:.4g}±{e:.2g}" for v, e in zip(value.ravel(), error.ravel(), strict=True)
            )
            parts.append(f"{name}=[{entries}] {self.units[name]}")
        return f"<ImpedanceEstimate {' '.join(parts)}, {self.estimator}, {self.outcome}>"


def _outcome(bits: int) -> str:
    return next((name for name, bit in _OUTCOMES.items() if bits & bit), "good")


def _lines(handle: _Impedance, which: int) -> tuple[str, ...]:
    words = text(lib.ulna_impedance_get_text, handle.pointer, which)
    return tuple(words.split("\n")) if words else ()


def _again(record: Record, settings: dict[str, Any], fit: int) -> ImpedanceEstimate:
    with _warnings.catch_warnings():
        _warnings.simplefilter("ignore", UncertainResult)
        estimate = identify_impedance(record, **settings)
    return estimate if fit == lib.ULNA_FIT_REPORTED else estimate.least_squares


def _estimate(
    handle: _Impedance,
    record: Record,
    settings: dict[str, Any],
    preparation: Preprocessing,
    fit: int = lib.ULNA_FIT_REPORTED,
) -> ImpedanceEstimate:
    info = result("ulna_impedance_info")
    check(lib.ulna_impedance_get_info(handle.pointer, info))
    about = result("ulna_fit_info")
    check(lib.ulna_impedance_get_fit(handle.pointer, fit, about))
    n = info.axes
    size = 3 * n * n + n

    def values(quantity: int, *shape: int) -> np.ndarray:
        array = out_array(lib.ulna_impedance_get_values, handle.pointer, fit, quantity)
        array = array.reshape(shape)
        array.flags.writeable = False
        return array

    frequency = values(lib.ULNA_IMPEDANCE_MOTION_FREQUENCY, -1)
    rho = None
    if frequency.size:
        rho = MotionShare(
            freq_hz=frequency,
            value=values(lib.ULNA_IMPEDANCE_MOTION_SHARE, -1, n),
            total=values(lib.ULNA_IMPEDANCE_MOTION_TOTAL, n),
        )
    trials = values(lib.ULNA_IMPEDANCE_TRIALS, -1, size)
    instrumental = about.estimator == lib.ULNA_ESTIMATOR_INSTRUMENTAL
    reported = fit == lib.ULNA_FIT_REPORTED
    return ImpedanceEstimate(
        n=n,
        axes=_lines(handle, lib.ULNA_TEXT_AXES),
        rotational=bool(info.rotational),
        M=values(lib.ULNA_IMPEDANCE_M, n, n),
        B=values(lib.ULNA_IMPEDANCE_B, n, n),
        K=values(lib.ULNA_IMPEDANCE_K, n, n),
        x0=values(lib.ULNA_IMPEDANCE_X0, n),
        cov=values(lib.ULNA_IMPEDANCE_COVARIANCE, size, size),
        vaf=values(lib.ULNA_IMPEDANCE_VAF, n),
        vaf_interval=values(lib.ULNA_IMPEDANCE_VAF_INTERVAL, 2, n),
        vaf_train=values(lib.ULNA_IMPEDANCE_VAF_TRAIN, n),
        vaf_reference=values(lib.ULNA_IMPEDANCE_VAF_REFERENCE, n),
        outcome=_outcome(about.outcome),
        warnings=_lines(handle, lib.ULNA_TEXT_WARNINGS) if reported else (),
        notes=_lines(handle, lib.ULNA_TEXT_NOTES) if reported else (),
        condition=about.condition,
        constrained=bool(about.constrained),
        estimator="instrumental_variables" if instrumental else "least_squares",
        least_squares=(
            _estimate(handle, record, settings, preparation, lib.ULNA_FIT_ALTERNATIVE)
            if reported and info.fits == 2 and instrumental
            else None
        ),
        rho=rho,
        difference_p=info.difference_p,
        lag_s=info.lag_s,
        lag_se_s=info.lag_error_s,
        trials=trials if len(trials) else None,
        trial_mean=values(lib.ULNA_IMPEDANCE_TRIAL_MEAN, size) if len(trials) > 1 else None,
        trial_se=values(lib.ULNA_IMPEDANCE_TRIAL_ERROR, size) if len(trials) > 1 else None,
        train_rows=info.train_rows,
        held_out_rows=info.held_out_rows,
        train_s=info.train_s,
        refitted=bool(info.refitted),
        payload_kg=info.payload_kg,
        preprocessing=preparation,
        provenance=_lines(handle, lib.ULNA_TEXT_PROVENANCE),
        record=record,
        _handle=handle,
        _fit=fit,
        _settings=settings,
    )


def _words(channels: str | Sequence[str] | None) -> str | None:
    """A word for several channels as it is; a list of names means exactly these."""
    if channels is None or isinstance(channels, str):
        return channels
    return ",".join(channels) + ","


def _prepare_options(
    *,
    position: str | Sequence[str] | None,
    force: str | Sequence[str] | None,
    reference: str | Sequence[str] | None,
    lowpass_hz: float | None,
    lowpass_order: int | None,
    corrected: bool,
    window: int | None,
    order: int | None,
    plain_savgol: bool,
    pad: str,
    threads: int,
) -> Any:
    if lowpass_hz is not None and lowpass_hz == 0:
        lowpass_hz = -1.0  # no low pass; zero bytes would mean the default
    return options(
        "ulna_prepare_options",
        position=_words(position),
        force=_words(force),
        reference=_words(reference),
        lowpass_hz=lowpass_hz,
        lowpass_order=lowpass_order,
        corrected=corrected,
        window=window,
        order=order,
        plain_savgol=plain_savgol,
        pad=pick(_PADS, pad, "pad"),
        threads=threads,
    )


def preprocess(
    record: Record,
    *,
    position: str | Sequence[str] | None = None,
    force: str | Sequence[str] | None = None,
    reference: str | Sequence[str] | None = None,
    lowpass_hz: float | None = None,
    lowpass_order: int | None = None,
    corrected: bool = False,
    window: int | None = None,
    order: int | None = None,
    plain_savgol: bool = False,
    pad: str = "pole-radius",
    threads: int = 0,
    progress: bool = False,
) -> tuple[Record, Preprocessing]:
    """Smooth and differentiate a record as :func:`identify_impedance` does.

    Every channel passes the same linear operator: Savitzky-Golay (value, first and second
    derivative), then a zero-phase Butterworth low pass. Dyck (2013), section 3.4.

    Parameters
    ----------
    record : Record
    position, force, reference : str or list of str, optional
        Word for channels: "F" stands for F_x and F_y. A list of names means exactly these. Default:
        by role.
    lowpass_hz : float, optional
        Cut-off of one pass, Hz; 0: no low pass. Default: so that both passes together keep the band
        that holds 95 % of the velocity's power (of the reference's, if any), 5 to 60 Hz.
    lowpass_order : int, optional
        Default 5.
    corrected : bool
        `lowpass_hz` is the -3 dB frequency after both passes.
    window, order : int, optional
        Of the Savitzky-Golay filter. Default: 101 samples at 1 kHz and 5 Hz, in proportion
        otherwise; order 6.
    plain_savgol : bool
        Use the derivative kernels as published. By default they are matched to the value kernel's
        response (a change of about 1e-5), which keeps the parameters exact.
    pad : {"pole-radius", "scipy"}
        Extension of the ends: until the filter has settled, or as SciPy does, for comparison.

    Returns
    -------
    prepared : Record
        For every position and reference channel c: c, c_rate, c_acceleration; and every force.
    report : Preprocessing

    Raises
    ------
    ulna.DataError
        For missing values, gaps, jitter, constant channels and too few samples: says where.
    """
    chosen = _prepare_options(
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
    )
    report = result("ulna_prepare_report")
    out = ffi.new("ulna_record **")
    source = record._handle.pointer
    long_call(lib.ulna_prepare, source, chosen, ffi.NULL, out, report, progress=progress)
    return Record(_Record(out[0])), _preprocessing(report)


def identify_impedance(
    record: Record,
    force: str | Sequence[str] | None = None,
    position: str | Sequence[str] | None = None,
    reference: str | Sequence[str] | None = None,
    *,
    model: str = "free",
    no_damping: bool = False,
    diagonal_mass: bool = False,
    estimator: str = "auto",
    errors: str = "newey-west",
    payload_kg: float = 0.0,
    train_s: float | None = None,
    refit: bool | None = None,
    lag_s: float = 0.4,
    block_s: float = 2.0,
    bootstrap: int = 1000,
    draws: int = 4000,
    seed: int = 0,
    condition_limit: float = 1000.0,
    poor_vaf: float = 80.0,
    lowpass_hz: float | None = None,
    lowpass_order: int | None = None,
    corrected: bool = False,
    window: int | None = None,
    order: int | None = None,
    plain_savgol: bool = False,
    pad: str = "pole-radius",
    threads: int = 0,
    progress: bool = False,
) -> ImpedanceEstimate:
    """Identify M, B, K and x0 from a perturbation experiment, with honest errors.

    Parameters
    ----------
    record : Record
        Positions, forces (by the human on the robot) and, if there is one, the commanded reference.
    force, position, reference : str or list of str, optional
        Word for channels: "F" stands for F_x and F_y. A list of names means exactly these. Default:
        by role.
    model : {"free", "symmetric", "passive"}
        "passive": symmetric and positive semidefinite.
    no_damping, diagonal_mass : bool
        B = 0; M = m I.
    estimator : {"auto", "instrumental_variables", "least_squares"}
        "auto": instrumental variables where the record holds a reference for every axis. Least
        squares is biased when the human causes part of the motion.
    errors : {"newey-west", "bootstrap"}
        Newey-West standard errors with a lag of `lag_s`, or a bootstrap over blocks: the record's
        segments, or stretches of `block_s`.
    payload_kg : float
        Known mass between force sensor and hand, removed from M (kg m^2 for a joint).
    train_s : float, optional
        Identify from the first `train_s` of every trial and validate on the rest. Default: 40 s, at
        most 80 % of a trial; or the first half of its segments.
    refit : bool, optional
        Report a fit to all data after validation. Default: when trials hold several segments.
    draws, seed : int
        For intervals of derived quantities.
    condition_limit : float
        Condition number above which the data do not determine the parameters: an error.
    poor_vaf : float
        Percent, below which the fit is called poor.
    lowpass_hz, lowpass_order, corrected, window, order, plain_savgol, pad
        As :func:`preprocess`.

    Returns
    -------
    ImpedanceEstimate
        Look at its `outcome` and `warnings`; an outcome that is not "good" also warns here.

    Raises
    ------
    ulna.DataError
        The record cannot be used: says where and why.
    ulna.AnalysisError
        The motion does not determine the parameters: names the direction.

    Examples
    --------
    >>> import ulna
    >>> log = ulna.read("examples/data/relaxed-arm.csv")
    >>> est = ulna.identify_impedance(log)
    >>> est.estimator, est.outcome
    ('instrumental_variables', 'good')
    >>> est.least_squares.outcome
    'closed_loop_biased'
    """
    settings = {k: v for k, v in locals().items() if k not in ("record", "progress")}
    if not isinstance(record, Record):
        raise ArgumentError(
            f"record is a {type(record).__name__}; read one with ulna.read or make one with "
            "ulna.Record.from_arrays",
            status="ULNA_ERROR_ARGUMENT",
            argument="record",
        )
    prepare = _prepare_options(
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
    )
    chosen = options(
        "ulna_impedance_options",
        prepare=prepare,
        model=pick(_MODELS, model, "model"),
        no_damping=no_damping,
        diagonal_mass=diagonal_mass,
        estimator=pick(_ESTIMATORS, estimator, "estimator"),
        errors=pick(_ERRORS, errors, "errors"),
        refit=pick(_REFIT, refit, "refit"),
        payload_kg=payload_kg,
        train_s=train_s,
        lag_s=lag_s,
        block_s=block_s,
        condition_limit=condition_limit,
        poor_vaf=poor_vaf,
        bootstrap=bootstrap,
        draws=draws,
        seed=seed,
        threads=threads,
    )
    out = ffi.new("ulna_impedance **")
    long_call(
        lib.ulna_impedance_identify,
        record._handle.pointer,
        chosen,
        ffi.NULL,
        out,
        progress=progress,
        label="identify",
    )
    handle = _Impedance(out[0])
    report = result("ulna_prepare_report")
    check(lib.ulna_impedance_get_preparation(handle.pointer, report))
    estimate = _estimate(handle, record, settings, _preprocessing(report))
    if estimate.warnings:
        _warnings.warn(" ".join(estimate.warnings), UncertainResult, stacklevel=2)
    return estimate
