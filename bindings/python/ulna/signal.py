"""Filters, spectra and clocks of sampled signals.

Axis 0 is time; a second axis holds channels. A NaN or infinite sample is refused with its row and
channel, because one would spread over the whole record.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._call import (
    ArgumentError,
    check,
    constants,
    ffi,
    lib,
    long_call,
    out_array,
    result,
    view,
)

__all__ = [
    "Clock",
    "Coherence",
    "FrequencyResponse",
    "butterworth",
    "check_clock",
    "coherence",
    "corrected_cutoff",
    "cross_spectra",
    "filter_zero_phase",
    "frequency_response",
    "pad_samples",
    "resample",
    "response",
    "savgol_cutoff",
    "savgol_filter",
    "savgol_kernel",
    "settle_samples",
    "two_pass_cutoff",
]

Array = NDArray[np.float64]
Pad = Literal["pole-radius", "scipy"]

_PADS = {name.replace("_", "-"): value for name, value in constants("ULNA_PAD_")}


def savgol_kernel(
    *, window: int = 101, order: int = 6, derivative: int = 0, rate_hz: float = 1.0
) -> Array:
    """Weights of a Savitzky-Golay filter for a derivative at the centre of the window.

    Parameters
    ----------
    window
        Samples in the window, odd.
    order
        Of the polynomial, 0 to 30 and below the window.
    derivative
        0 to 6. Above the order it is zero.
    rate_hz
        Sampling rate; the weights are in 1/s^derivative.

    Returns
    -------
    ndarray, shape (window,)
        ``value[i] = sum_k weights[k] * y[i + k - (window - 1) // 2]``.

    Examples
    --------
    >>> (35 * savgol_kernel(window=5, order=2)).round(12)
    array([-3., 12., 17., 12., -3.])
    """
    kernels = out_array(lib.ulna_savgol_kernels, window, order, derivative, rate_hz)
    return kernels.reshape(derivative + 1, -1)[derivative]


def savgol_cutoff(*, window: int = 101, order: int = 6) -> float:
    """-3 dB frequency of Savitzky-Golay smoothing as a fraction of the Nyquist frequency.

    Examples
    --------
    >>> round(savgol_cutoff(window=101, order=6), 5)
    0.04605
    """
    out = ffi.new("double *")
    check(lib.ulna_savgol_cutoff(window, order, out))
    return out[0]


def savgol_filter(
    y: ArrayLike,
    *,
    window: int = 101,
    order: int = 6,
    derivative: int = 0,
    rate_hz: float = 1.0,
) -> Array:
    """Smoothed values, or a derivative, by local polynomials.

    The ``(window - 1) // 2`` rows at either end come from the polynomial of the first or last
    window, as ``scipy.signal.savgol_filter`` does with ``mode="interp"``; they are less certain.

    Parameters
    ----------
    y
        Signal, or several as columns; at least `window` rows.
    window, order, derivative
        As for `savgol_kernel`.
    rate_hz
        Sampling rate; the result is in units of `y` per s^derivative.

    Returns
    -------
    ndarray, the shape of `y`

    Examples
    --------
    >>> t = np.arange(200) / 100
    >>> v = savgol_filter(t**2, window=21, order=3, derivative=1, rate_hz=100)
    >>> bool(np.allclose(v, 2 * t))
    True
    """
    values = _signals(y, "y")
    borrowed = view(values)
    out = out_array(lib.ulna_savgol_apply, borrowed, window, order, derivative, rate_hz)
    rows, columns = _shape(values)
    return out.reshape(columns, derivative + 1, rows)[:, derivative].T.reshape(values.shape)


def butterworth(*, order: int = 5, cutoff_hz: float, rate_hz: float) -> Array:
    """Butterworth low pass as second-order sections, as ``scipy.signal.butter(output="sos")``.

    Returns
    -------
    ndarray, shape (sections, 6)
        ``b0 b1 b2 a0 a1 a2`` of each section.

    Examples
    --------
    >>> butterworth(order=5, cutoff_hz=5, rate_hz=1000).shape
    (3, 6)
    """
    return out_array(lib.ulna_butterworth_design, order, cutoff_hz, rate_hz, shape=(-1, 6))


def two_pass_cutoff(*, order: int = 5, cutoff_hz: float, rate_hz: float) -> float:
    """-3 dB frequency in Hz of a Butterworth low pass applied forward and backward.

    Examples
    --------
    >>> round(two_pass_cutoff(order=5, cutoff_hz=5, rate_hz=1000), 3)
    4.578
    """
    out = ffi.new("double *")
    check(lib.ulna_butterworth_two_pass_cutoff(order, cutoff_hz, rate_hz, out))
    return out[0]


def corrected_cutoff(*, order: int = 5, wanted_hz: float, rate_hz: float) -> float:
    """Cut-off in Hz to design for, so that two passes are at -3 dB at `wanted_hz`.

    Examples
    --------
    >>> design = corrected_cutoff(order=5, wanted_hz=5, rate_hz=1000)
    >>> round(two_pass_cutoff(order=5, cutoff_hz=design, rate_hz=1000), 9)
    5.0
    """
    out = ffi.new("double *")
    check(lib.ulna_butterworth_corrected_cutoff(order, wanted_hz, rate_hz, out))
    return out[0]


def settle_samples(sos: ArrayLike, *, epsilon: float = 1e-3) -> int:
    """Samples until the slowest transient of a filter has fallen to `epsilon`.

    Examples
    --------
    >>> settle_samples(butterworth(order=5, cutoff_hz=5, rate_hz=1000))
    712
    """
    out = ffi.new("int64_t *")
    filter_view = view(_signals(sos, "sos"))
    check(lib.ulna_sos_settle(filter_view, epsilon, out))
    return out[0]


def pad_samples(
    sos: ArrayLike, *, pad: Pad = "pole-radius", epsilon: float = 1e-3, rows: int | None = None
) -> int:
    """Samples by which `filter_zero_phase` extends each end of a signal of so many rows.

    Below what it gives without `rows`, the signal is too short for the transient to die out.

    Examples
    --------
    >>> sos = butterworth(order=5, cutoff_hz=5, rate_hz=1000)
    >>> pad_samples(sos, pad="scipy"), pad_samples(sos, rows=300)
    (18, 299)
    """
    out = ffi.new("int64_t *")
    filter_view = view(_signals(sos, "sos"))
    options = _zero_phase(pad, epsilon)
    check(lib.ulna_sos_pad(filter_view, options, -1 if rows is None else rows, out))
    return out[0]


def filter_zero_phase(
    y: ArrayLike, *, sos: ArrayLike, pad: Pad = "pole-radius", epsilon: float = 1e-3
) -> Array:
    """Filter forward and backward, so that nothing is shifted in time.

    Two passes square the gain: see `two_pass_cutoff`.

    Parameters
    ----------
    y
        Signal, or several as columns.
    sos
        Second-order sections, as from `butterworth`.
    pad
        ``"pole-radius"`` extends the ends until the transient has fallen to `epsilon`;
        ``"scipy"`` as ``scipy.signal.sosfiltfilt`` does by default, which is shorter than it.
    epsilon
        Share of the transient.

    Returns
    -------
    ndarray, the shape of `y`

    Examples
    --------
    >>> sos = butterworth(order=5, cutoff_hz=5, rate_hz=1000)
    >>> bool(np.allclose(filter_zero_phase(np.ones(2000), sos=sos), 1))
    True
    """
    values = _signals(y, "y")
    borrowed, filter_view = view(values), view(_signals(sos, "sos"))
    out = out_array(lib.ulna_sos_filter, borrowed, filter_view, _zero_phase(pad, epsilon))
    return out.reshape(_shape(values), order="F").reshape(values.shape)


def response(
    freq_hz: ArrayLike,
    *,
    rate_hz: float,
    window: int = 101,
    order: int = 6,
    sos: ArrayLike | None = None,
    relative: bool = True,
) -> Array:
    """Magnitude response of smoothing, first and second derivative.

    Parameters
    ----------
    freq_hz
        Frequencies from 0 to ``rate_hz / 2``.
    rate_hz
        Sampling rate.
    window, order
        Of the Savitzky-Golay filter.
    sos
        Low pass that is applied forward and backward as well.
    relative
        To the ideal operators 1, omega and omega^2; otherwise the gain in 1, 1/s, 1/s^2.

    Returns
    -------
    ndarray, shape (frequencies, 3)

    Examples
    --------
    >>> sos = butterworth(order=5, cutoff_hz=5, rate_hz=1000)
    >>> response([2, 5], rate_hz=1000, sos=sos)[:, 0].round(5)
    array([0.9999, 0.5   ])
    """
    freq = view(np.atleast_1d(_signals(freq_hz, "freq_hz")))
    filter_view = ffi.NULL if sos is None else view(_signals(sos, "sos"))
    out = out_array(
        lib.ulna_smoother_response, window, order, filter_view, rate_hz, freq, int(relative)
    )
    return out.reshape(3, -1).T


@dataclass(frozen=True, eq=False)
class Coherence:
    """Share of the power of each output that a linear system of the inputs explains.

    Attributes
    ----------
    freq_hz : ndarray, shape (bins,)
    value : ndarray, shape (bins, outputs)
        Multiple coherence, 0 to 1; NaN where the inputs have no power.
    corrected : ndarray, shape (bins, outputs)
        Without the bias of a finite number of averages.
    averages : int
        Segments averaged.
    effective_averages : float
        Independent segments that they are worth.
    """

    freq_hz: Array
    value: Array
    corrected: Array
    averages: int
    effective_averages: float

    def __repr__(self) -> str:
        return (
            f"Coherence({self.freq_hz.size} frequencies to {self.freq_hz[-1]:g} Hz, "
            f"{self.averages} averages, mean {np.nanmean(self.corrected):.3f})"
        )


@dataclass(frozen=True, eq=False)
class FrequencyResponse:
    """H1 of each output to each input with its confidence region.

    Attributes
    ----------
    freq_hz : ndarray, shape (bins,)
    value : ndarray of complex, shape (bins, outputs, inputs)
    radius : ndarray, shape (bins, outputs, inputs)
        Of the circle about `value` that holds the truth with `confidence`.
    confidence : float
    averages : int
    """

    freq_hz: Array
    value: NDArray[np.complex128]
    radius: Array
    confidence: float
    averages: int

    def __repr__(self) -> str:
        _, outputs, inputs = self.value.shape
        return (
            f"FrequencyResponse({outputs} outputs x {inputs} inputs, {self.freq_hz.size} "
            f"frequencies to {self.freq_hz[-1]:g} Hz, {self.averages} averages)"
        )


def coherence(
    inputs: ArrayLike,
    outputs: ArrayLike,
    *,
    rate_hz: float,
    segment: int | None = None,
    ranges: ArrayLike | None = None,
) -> Coherence:
    """Multiple coherence of each output on all the inputs by Welch's method.

    Hann window, 50 % overlap, the mean of each segment removed.

    Parameters
    ----------
    inputs, outputs
        Signals as columns, the same number of rows.
    rate_hz
        Sampling rate.
    segment
        Samples in a segment; 1024, or all rows when there are fewer.
    ranges : array_like of int, shape (n, 2)
        Rows ``[begin, end)`` that no segment reaches across, for example trials.

    Examples
    --------
    >>> u = np.random.default_rng(0).normal(size=20000)
    >>> c = coherence(u, np.roll(u, 1), rate_hz=1000, segment=256)
    >>> bool(c.value[1:, 0].min() > 0.99)
    True
    """
    u, y = _signals(inputs, "inputs"), _signals(outputs, "outputs")
    table, info = _estimate(
        lib.ulna_coherence_estimate, (u, y), rate_hz, segment, ranges, 1 + 2 * _shape(y)[1]
    )
    count = _shape(y)[1]
    return Coherence(
        table[:, 0],
        table[:, 1 : 1 + count],
        table[:, 1 + count :],
        info.averages,
        info.effective_averages,
    )


def frequency_response(
    inputs: ArrayLike,
    outputs: ArrayLike,
    *,
    rate_hz: float,
    segment: int | None = None,
    ranges: ArrayLike | None = None,
    confidence: float = 0.95,
) -> FrequencyResponse:
    """Frequency response H1 with its confidence region; parameters as for `coherence`.

    Examples
    --------
    >>> u = np.random.default_rng(0).normal(size=20000)
    >>> h = frequency_response(u, 3 * u, rate_hz=1000, segment=256)
    >>> bool(np.allclose(h.value[1:, 0, 0], 3))
    True
    """
    u, y = _signals(inputs, "inputs"), _signals(outputs, "outputs")
    m, n = _shape(y)[1], _shape(u)[1]
    table, info = _estimate(
        lib.ulna_response_estimate, (u, y), rate_hz, segment, ranges, 1 + 3 * m * n, confidence
    )
    parts = table[:, 1:].reshape(-1, m, n, 3)
    value = parts[..., 0] + 1j * parts[..., 1]
    return FrequencyResponse(table[:, 0], value, parts[..., 2], confidence, info.averages)


def cross_spectra(
    signals: ArrayLike,
    *,
    rate_hz: float,
    segment: int | None = None,
    ranges: ArrayLike | None = None,
) -> tuple[Array, NDArray[np.complex128]]:
    """One-sided cross-spectral densities, as ``scipy.signal.csd``; parameters as for `coherence`.

    Returns
    -------
    freq_hz : ndarray, shape (bins,)
    density : ndarray of complex, shape (bins, channels, channels)
        ``density[:, i, j]`` is the mean of ``conj(X_i) X_j``, in units of both per Hz.

    Examples
    --------
    >>> u = np.random.default_rng(0).normal(size=20000)
    >>> freq_hz, density = cross_spectra(u, rate_hz=1000, segment=256)
    >>> round(float(density[1:, 0, 0].real.mean() * 500), 1)
    1.0
    """
    values = _signals(signals, "signals")
    n = _shape(values)[1]
    table, _ = _estimate(
        lib.ulna_spectrum_estimate, (values,), rate_hz, segment, ranges, 1 + 2 * n * n
    )
    parts = table[:, 1:].reshape(-1, n, n, 2)
    return table[:, 0], parts[..., 0] + 1j * parts[..., 1]


@dataclass(frozen=True, eq=False)
class Clock:
    """What the time stamps of a log show; steps above 1.5 medians are gaps, not jitter.

    Attributes
    ----------
    median_step_s : float
    jitter_rms, jitter_max : float
        Root mean square and largest deviation of a step, as shares of the median step.
    worst_row : int
        Row at the end of the most deviating step.
    gap_rows : ndarray of int
        Row before each gap.
    largest_gap_s : float
        0 when there is none.
    """

    median_step_s: float
    jitter_rms: float
    jitter_max: float
    worst_row: int
    gap_rows: NDArray[np.int64]
    largest_gap_s: float

    @property
    def rate_hz(self) -> float:
        """Sampling rate from the median step."""
        return 1.0 / self.median_step_s

    def __repr__(self) -> str:
        return (
            f"Clock({self.rate_hz:g} Hz, jitter {100 * self.jitter_rms:.2g} % rms, "
            f"{self.gap_rows.size} gaps)"
        )


def check_clock(t: ArrayLike) -> Clock:
    """Jitter and gaps of time stamps in s, which must increase.

    Examples
    --------
    >>> check_clock([0.0, 0.1, 0.2, 0.5, 0.6]).gap_rows
    array([2])
    """
    borrowed = view(_signals(t, "t"))
    out = result("ulna_clock")
    check(lib.ulna_clock_check(borrowed, out))
    return Clock(
        out.median_step_s,
        out.jitter_rms,
        out.jitter_max,
        out.worst_row,
        out_array(lib.ulna_clock_gaps, borrowed),
        out.largest_gap_s,
    )


def resample(
    t: ArrayLike,
    y: ArrayLike,
    *,
    rate_hz: float,
    t0_s: float | None = None,
    count: int | None = None,
    max_gap_steps: float = 2.5,
) -> tuple[Array, Array]:
    """The signal behind jittering time stamps, at a uniform rate.

    The record is taken as band-limited to 0.7 of its own Nyquist frequency, and a lower `rate_hz`
    low-passes to 0.7 of the new one. Some 64 samples at either end are less exact.

    Parameters
    ----------
    t
        Time stamps in s, increasing.
    y
        Signal, or several as columns, at these times.
    rate_hz
        Wanted rate.
    t0_s
        Time of the first sample; the first stamp unless given.
    count
        Samples wanted; all that fit before the last stamp unless given.
    max_gap_steps
        A longer step, in median steps, is refused as a gap.

    Returns
    -------
    times : ndarray, shape (count,)
    values : ndarray, shape (count,) or (count, channels)

    Examples
    --------
    >>> t = np.sort(np.arange(2000) + np.random.default_rng(0).uniform(-0.2, 0.2, 2000)) / 1000
    >>> times, values = resample(t, np.sin(2 * np.pi * 40 * t), rate_hz=1000)
    >>> bool(np.abs(values - np.sin(2 * np.pi * 40 * times))[64:-64].max() < 1e-5)
    True
    """
    stamps, values = _signals(t, "t"), _signals(y, "y")
    if stamps.size == 0:
        raise ArgumentError("t has no stamps", status="ULNA_ERROR_ARGUMENT", argument="t")
    if not rate_hz > 0:
        raise ArgumentError(
            "rate_hz must be positive", status="ULNA_ERROR_ARGUMENT", argument="rate_hz"
        )
    start = float(stamps.flat[0]) if t0_s is None else float(t0_s)
    if count is None:
        # A millionth of a sample, for stamps that were rounded.
        fitting = np.floor((float(stamps.flat[-1]) - start) * rate_hz + 1e-6)
        count = max(0, int(fitting) + 1) if np.isfinite(fitting) else 0
    options = result("ulna_resample_options")
    options.max_gap_steps = max_gap_steps
    out = np.empty((_shape(values)[1], count))
    _fill(
        lib.ulna_clock_resample,
        (view(stamps), view(values), start, rate_hz, count, options, ffi.NULL),
        out,
    )
    return start + np.arange(count) / rate_hz, out.T.reshape((count, *values.shape[1:]))


# Inside ------------------------------------------------------------------------------------------


def _signals(array: ArrayLike, name: str) -> NDArray[Any]:
    values = np.asarray(array)
    if values.ndim > 2:
        raise ArgumentError(
            f"{name} has {values.ndim} axes: it must have one, or two with time first",
            status="ULNA_ERROR_ARGUMENT",
            argument=name,
        )
    return values


def _shape(values: NDArray[Any]) -> tuple[int, int]:
    return (values.shape[0], 1) if values.ndim == 1 else (values.shape[0], values.shape[1])


def _zero_phase(pad: str, epsilon: float) -> Any:
    if pad not in _PADS:
        raise ArgumentError(
            f"pad is {pad!r}: it must be one of {', '.join(map(repr, sorted(_PADS)))}",
            status="ULNA_ERROR_ARGUMENT",
            argument="pad",
        )
    if not 0 < epsilon < 1:
        raise ArgumentError(
            "epsilon must lie between 0 and 1", status="ULNA_ERROR_ARGUMENT", argument="epsilon"
        )
    options = result("ulna_zero_phase_options")
    options.pad = _PADS[pad]
    options.epsilon = epsilon
    return options


def _fill(function: Any, args: tuple[Any, ...], out: Array) -> None:
    """A long call that writes `out` whole through its last arguments."""
    pointer = ffi.cast("double *", out.__array_interface__["data"][0])
    long_call(function, *args, pointer, out.size, ffi.new("int64_t *"))


def _estimate(
    function: Any,
    signals: tuple[NDArray[Any], ...],
    rate_hz: float,
    segment: int | None,
    ranges: ArrayLike | None,
    columns: int,
    confidence: float = 0.95,
) -> tuple[Array, Any]:
    """Table of a spectral estimate (frequencies x columns) and what was averaged."""
    if not 0 < confidence < 1:
        raise ArgumentError(
            "confidence must lie between 0 and 1",
            status="ULNA_ERROR_ARGUMENT",
            argument="confidence",
        )
    options = result("ulna_spectrum_options")
    options.segment = 0 if segment is None else segment
    options.confidence = confidence
    rows = np.ascontiguousarray([] if ranges is None else ranges, dtype=np.int64)
    if ranges is not None:
        if rows.ndim != 2 or rows.shape[1] != 2 or rows.shape[0] == 0:
            raise ArgumentError(
                "ranges must be pairs (begin, end) of rows",
                status="ULNA_ERROR_ARGUMENT",
                argument="ranges",
            )
        options.ranges = ffi.cast("int64_t *", rows.__array_interface__["data"][0])
        options.range_count = rows.shape[0]
    info = result("ulna_spectrum_info")
    check(lib.ulna_spectrum_plan(_shape(signals[0])[0], options, info))
    table = np.empty((columns, info.bins))
    views = [view(values) for values in signals]
    _fill(function, (*views, rate_hz, options, ffi.NULL), table)
    return table.T, info
