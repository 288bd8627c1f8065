"""Recordings of one experiment on different clocks: how the clocks differ, and one clock for both.

Two devices that record the same movement disagree by an offset (each starts at its own zero) and a
drift (their crystals differ by some hundred parts per million, a tenth of a second in a quarter of an
hour). Both are found from a signal that the two recordings share, such as the vertical force under the
feet and the acceleration of the pelvis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import signal
from ._call import AnalysisError, DataError
from ._motion_file import Column, record_of
from .record import Record, refuse

__all__ = ["ClockFit", "fit_clocks", "on_one_clock"]

Array = NDArray[np.float64]

# A step above this many median steps is a gap; `ulna.signal.resample` bridges what is shorter.
_GAP_STEPS = 2.5
_FEWEST_WINDOWS = 4
# Signals that have nothing in common reach this many standard deviations at no lag of a recording.
_SIGNIFICANT = 6.0
# A rival peak this near to the best is another beat of the same rhythm.
_RIVAL = 0.95
# Log likelihood ratio between the best lag and its best rival.
_DECISIVE = 10.0


@dataclass(frozen=True)
class ClockFit:
    """How one clock runs against a reference: ``t_reference = t + offset_s + drift (t - centre_s)``.

    Attributes
    ----------
    offset_s : float
        At `centre_s`.
    drift : float
        Seconds gained on the reference a second; 1e-4 is 0.36 s an hour.
    offset_error_s, drift_error : float
        Standard errors, from the scatter of the windows; those of offset and drift are independent.
    centre_s : float
        On the other's clock.
    correlation : float
        Of the band-limited signals, aligned; what the reference does not cover counts against it.
    rival : float
        The highest correlation at any other alignment.
    windows, windows_left_out : int
        That the fit rests on, and that disagree or hold no common signal.
    """

    offset_s: float
    drift: float
    offset_error_s: float
    drift_error: float
    centre_s: float
    correlation: float
    rival: float
    windows: int
    windows_left_out: int

    def to_reference(self, time_s: ArrayLike) -> Array:
        """Times of the other clock on the reference clock.

        Examples
        --------
        >>> fit = ClockFit(1.5, 1e-4, 1e-4, 1e-6, 100.0, 0.9, 0.2, 20, 0)
        >>> fit.to_reference([0.0, 100.0]).round(6).tolist()
        [1.49, 101.5]
        """
        time = np.asarray(time_s, dtype=float)
        return np.asarray(time + self.offset_s + self.drift * (time - self.centre_s))

    def error_s(self, time_s: ArrayLike) -> Array:
        """Standard error of `to_reference`.

        Examples
        --------
        >>> fit = ClockFit(1.5, 1e-4, 3e-4, 4e-6, 100.0, 0.9, 0.2, 20, 0)
        >>> float(fit.error_s(0.0).round(12))
        0.0005
        """
        away = np.asarray(time_s, dtype=float) - self.centre_s
        return np.asarray(np.hypot(self.offset_error_s, self.drift_error * away))

    def summary(self) -> str:
        """What was found, as text.

        Examples
        --------
        >>> print(ClockFit(1.5, 1e-4, 3e-4, 4e-6, 100.0, 0.9, 0.2, 20, 1).summary())
        offset 1.5000 ± 0.0003 s at 100 s, drift 100 ± 4 ppm
        correlation 0.900 (0.200 at any other alignment), 20 windows, 1 left out
        """
        left = f", {self.windows_left_out} left out" if self.windows_left_out else ""
        return (
            f"offset {self.offset_s:.4f} ± {self.offset_error_s:.1g} s at {self.centre_s:.4g} s, "
            f"drift {1e6 * self.drift:.4g} ± {1e6 * self.drift_error:.2g} ppm\n"
            f"correlation {self.correlation:.3f} ({self.rival:.3f} at any other alignment), "
            f"{self.windows} windows{left}"
        )

    def __repr__(self) -> str:
        return f"<ClockFit: {self.summary().splitlines()[0]}>"


def fit_clocks(
    time_reference_s: ArrayLike,
    reference: ArrayLike,
    time_other_s: ArrayLike,
    other: ArrayLike,
    *,
    band_hz: tuple[float, float] | None = None,
    max_offset_s: float | None = None,
    max_drift: float = 1e-3,
    window_s: float | None = None,
) -> ClockFit:
    """Offset and drift between two recordings of one signal.

    Both signals are band-limited and cut into windows; offset and drift are where the correlation of
    all windows together is largest, and then the delays of the single windows, found to a fraction of a
    sample, give the fit and its standard errors.

    Parameters
    ----------
    time_reference_s, reference
        Times and values, shape (n,). Missing values (NaN) and gaps are left out, never filled.
    time_other_s, other
        The same on the other clock. The signals may differ in unit and size, not in sign: turn one of
        them where it points the other way.
    band_hz
        In which they are compared; from 0.3 Hz to 10 Hz or 0.3 of the lower rate unless given.
    max_offset_s
        Largest offset looked for; half of the shorter recording, at most 300 s, unless given.
    max_drift
        Largest drift looked for.
    window_s
        Length of a window; a 24th of the recording, shorter where drift would blur it and at least two
        periods of the band, unless given.

    Returns
    -------
    ClockFit
        Refused as `ulna.AnalysisError` where the signals have nothing in common or two alignments are
        about as good, as in a steady rhythm.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> t = np.arange(0, 120, 0.01)
    >>> freq, phase = rng.uniform(0.4, 4, 40), rng.uniform(0, 6, 40)
    >>> def movement(t):
    ...     return np.sin(np.multiply.outer(2 * np.pi * t, freq) + phase).sum(axis=-1)
    >>> stamps = np.arange(0, 100, 1 / 60)          # the other clock
    >>> fit = fit_clocks(t, movement(t), stamps, movement(3 + 1.0002 * stamps))
    >>> round(float(fit.to_reference(0.0)), 3), round(1e6 * fit.drift)
    (3.0, 200)
    """
    stamps_a, values_a = _series(time_reference_s, reference, "reference")
    stamps_b, values_b = _series(time_other_s, other, "other")
    if not 0 <= max_drift <= 0.05:
        raise refuse("max_drift must lie between 0 and 0.05", "max_drift")
    lowest_rate = min(_rate(stamps_a), _rate(stamps_b))
    low, high = _band(band_hz, lowest_rate)
    rate = min(lowest_rate, 8 * high)
    a = _Grid.of(stamps_a, values_a, rate, (low, high), "reference")
    b = _Grid.of(stamps_b, values_b, rate, (low, high), "other")
    size = _window(window_s, b.duration_s, low, high, max_drift)
    limit = min(a.duration_s, b.duration_s) / 2
    reach = min(limit, 300.0) if max_offset_s is None else float(max_offset_s)
    if not 0 < reach:
        raise refuse("max_offset_s must be positive", "max_offset_s")
    windows = _windows(a, b, round(size * rate), reach)
    if len(windows) < _FEWEST_WINDOWS:
        raise AnalysisError(
            f"only {len(windows)} windows of {size:.3g} s overlap and move: record longer, or give a "
            "smaller window_s",
            status="ULNA_ERROR_ANALYSIS",
        )
    start = _search(windows, a, b, rate, (low, high), max_drift)
    return _refine(windows, a, b, rate, high, start)


# The signals on a common grid ---------------------------------------------------------------------


def _series(time: ArrayLike, values: ArrayLike, name: str) -> tuple[Array, Array]:
    stamps, signals = np.asarray(time, dtype=float), np.asarray(values, dtype=float)
    if stamps.ndim != 1 or signals.shape != stamps.shape:
        raise refuse(
            f"{name} has the shape {signals.shape} and its times {stamps.shape}: both must be (n,)",
            name,
        )
    if not np.isfinite(stamps).all() or np.any(np.diff(stamps) <= 0):
        raise DataError(
            f"the times of {name} must increase", status="ULNA_ERROR_DATA", argument=name
        )
    known = np.isfinite(signals)
    if known.sum() < 64:
        raise DataError(
            f"{name} has {int(known.sum())} samples, at least 64 are needed",
            status="ULNA_ERROR_DATA",
            argument=name,
        )
    return stamps[known], signals[known]


def _rate(stamps: Array) -> float:
    return 1.0 / float(np.median(np.diff(stamps)))


def _band(band_hz: tuple[float, float] | None, rate: float) -> tuple[float, float]:
    low, high = (0.3, min(10.0, 0.3 * rate)) if band_hz is None else map(float, band_hz)
    # Resampling keeps what lies below 0.7 of the Nyquist frequency.
    if not 0 < low < high <= 0.35 * rate:
        raise refuse(
            f"band_hz is ({low:g}, {high:g}): it must increase from above 0 to at most "
            f"{0.35 * rate:.3g} Hz, 0.35 of the lower rate",
            "band_hz",
        )
    return low, high


def _window(
    window_s: float | None, duration_s: float, low: float, high: float, max_drift: float
) -> float:
    if window_s is not None:
        if not window_s >= 2 / low:
            raise refuse(f"window_s must hold two periods of the band, {2 / low:.3g} s", "window_s")
        return float(window_s)
    # Drift within a window may blur it by a quarter of the shortest period.
    longest = 0.25 / (max_drift * high) if max_drift > 0 else np.inf
    return float(max(min(duration_s / 24, longest), 2 / low))


@dataclass(frozen=True, eq=False)
class _Grid:
    """A band-limited signal at ``start_s + k / rate_hz``; 0 where nothing is known."""

    start_s: float
    rate_hz: float
    values: Array
    known: NDArray[np.bool_]

    @property
    def duration_s(self) -> float:
        return len(self.values) / self.rate_hz

    @classmethod
    def of(
        cls, stamps: Array, values: Array, rate: float, band: tuple[float, float], name: str
    ) -> _Grid:
        start = float(stamps[0])
        count = int(np.floor((stamps[-1] - start) * rate + 1e-6)) + 1
        out, known = np.zeros(count), np.zeros(count, dtype=bool)
        low, high = (signal.butterworth(order=4, cutoff_hz=f, rate_hz=rate) for f in band)
        for begin, end in _runs(stamps):
            first = int(np.ceil((stamps[begin] - start) * rate - 1e-9))
            last = int(np.floor((stamps[end - 1] - start) * rate + 1e-9))
            if last - first < 2 * rate / band[0]:
                continue  # shorter than the filters need
            times = start + first / rate
            _, even = signal.resample(
                stamps[begin:end], values[begin:end], rate_hz=rate, t0_s=max(times, stamps[begin]),
                count=last - first,
            )  # fmt: skip
            even = even - even.mean()
            smooth = signal.filter_zero_phase(even, sos=high)
            out[first:last] = smooth - signal.filter_zero_phase(smooth, sos=low)
            known[first:last] = True
        if not known.any():
            raise DataError(
                f"{name} has no stretch of {2 / band[0]:.3g} s without a gap",
                status="ULNA_ERROR_DATA",
                argument=name,
            )
        return cls(start, rate, out, known)


def _runs(stamps: Array) -> list[tuple[int, int]]:
    """Rows [begin, end) between gaps."""
    steps = np.diff(stamps)
    cuts = np.flatnonzero(steps > _GAP_STEPS * np.median(steps)) + 1
    edges = [0, *cuts.tolist(), len(stamps)]
    return list(zip(edges[:-1], edges[1:], strict=True))


# Windows and their correlations -------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Window:
    """A stretch of the other signal and its products with the reference at every lag."""

    begin: int
    size: int
    product: Array  # over lags in samples, from first_lag
    power: Array  # of the reference under the window, over the same lags
    own_power: float


def _windows(a: _Grid, b: _Grid, size: int, reach_s: float) -> list[_Window]:
    # Lag 0 puts the same times of both clocks over each other.
    shift = round((b.start_s - a.start_s) * a.rate_hz)
    reach = round(reach_s * a.rate_hz)
    found = []
    powers = []
    for begin in range(0, len(b.values) - size + 1, size):
        if b.known[begin : begin + size].mean() < 0.8:
            continue
        own = b.values[begin : begin + size]
        first = begin + shift - reach
        stretch = _padded(a.values, first, size + 2 * reach)
        seen = _padded(a.known.astype(float), first, size + 2 * reach)
        length = 1 << int(np.ceil(np.log2(len(stretch) + size)))
        spectrum = np.fft.rfft(stretch, length) * np.conj(np.fft.rfft(own, length))
        product = np.fft.irfft(spectrum, length)[: 2 * reach + 1]
        power = _sliding_sum(stretch**2, size)
        # A lag at which the reference knows less than half of the window tells nothing.
        product[_sliding_sum(seen, size) < 0.5 * size] = 0.0
        found.append(_Window(begin, size, product, power, float(own @ own)))
        powers.append(found[-1].own_power)
    if not found:
        return []
    # Windows of rest hold noise only.
    moving = np.asarray(powers) > 0.05 * np.median(powers)
    return [window for window, moves in zip(found, moving, strict=True) if moves]


def _padded(values: Array, first: int, count: int) -> Array:
    out = np.zeros(count)
    begin, end = max(first, 0), min(first + count, len(values))
    if begin < end:
        out[begin - first : end - first] = values[begin:end]
    return out


def _sliding_sum(values: Array, size: int) -> Array:
    sums = np.concatenate([[0.0], np.cumsum(values)])
    return np.asarray(sums[size:] - sums[:-size])


@dataclass(frozen=True)
class _Start:
    lag: float  # samples, at the centre
    drift: float
    centre: float  # sample of the other grid
    correlation: float
    rival: float


def _search(
    windows: list[_Window],
    a: _Grid,
    b: _Grid,
    rate: float,
    band: tuple[float, float],
    max_drift: float,
) -> _Start:
    """The offset and drift at which all windows together correlate best."""
    middles = np.array([window.begin + window.size / 2 for window in windows])
    centre = float(middles.mean())
    span = float(np.ptp(middles))
    # A step of the drift moves the ends by an eighth of the shortest period.
    step = rate / (8 * band[1]) / max(span / 2, 1.0)
    count = int(np.ceil(max_drift / step)) if max_drift > 0 else 0
    drifts = step * np.arange(-count, count + 1) if count else np.zeros(1)
    best_of_lag = np.full(len(windows[0].product), -1.0)
    drift_of_lag = np.zeros(len(best_of_lag))
    own = sum(window.own_power for window in windows)
    for drift in drifts:
        product = np.zeros(len(best_of_lag))
        power = np.zeros(len(best_of_lag))
        for window, middle in zip(windows, middles, strict=True):
            move = round(drift * (middle - centre))
            product += _moved(window.product, move)
            power += _moved(window.power, move)
        # A lag with little of the reference below it would divide noise by nothing.
        enough = power > 0.2 * power.max(initial=0.0)
        value = np.where(enough, product / np.sqrt(np.where(enough, power, 1.0) * own), -1.0)
        better = value > best_of_lag
        best_of_lag[better], drift_of_lag[better] = value[better], drift
    at = int(np.argmax(best_of_lag))
    reach = (len(best_of_lag) - 1) // 2
    best = float(best_of_lag[at])
    # Width of the peak: what drift and lag can trade for each other, and a period of the band's width.
    near = int(np.ceil(1.5 * rate / (band[1] - band[0]))) + int(np.ceil(max_drift * span / 2))
    away = np.abs(np.arange(len(best_of_lag)) - at) > near
    rival = float(best_of_lag[away].max(initial=0.0))
    independent = 2 * (band[1] - band[0]) * sum(window.size for window in windows) / rate
    _refuse_doubt(best, rival, independent)
    return _Start(at - reach, float(drift_of_lag[at]), centre, best, max(rival, 0.0))


def _moved(values: Array, move: int) -> Array:
    """values[k + move], 0 outside."""
    if move == 0:
        return values
    out = np.zeros_like(values)
    if move > 0:
        out[:-move] = values[move:]
    else:
        out[-move:] = values[:move]
    return out


def _refuse_doubt(best: float, rival: float, independent: float) -> None:
    if best < _SIGNIFICANT / np.sqrt(independent):
        raise AnalysisError(
            f"the two signals have nothing in common in this band (largest correlation {best:.2f}): "
            "choose signals that both devices see, or a larger max_offset_s",
            status="ULNA_ERROR_ANALYSIS",
        )
    clipped = min(best, 1 - 1e-9)
    # A quarter of the samples: the two devices do not see quite the same, so residuals are not white.
    ratio = 0.125 * independent * np.log((1 - rival**2) / (1 - clipped**2))
    if rival > _RIVAL * best or ratio < _DECISIVE:
        raise AnalysisError(
            f"two alignments are about as good (correlations {best:.3f} and {rival:.3f}): the movement "
            "repeats itself, begin with a jump or a clap that happens once, or give a smaller "
            "max_offset_s",
            status="ULNA_ERROR_ANALYSIS",
        )


def _refine(
    windows: list[_Window], a: _Grid, b: _Grid, rate: float, high: float, start: _Start
) -> ClockFit:
    """Delays of single windows to a fraction of a sample, and a line through them."""
    shift = round((b.start_s - a.start_s) * rate)
    middles, delays, weights = [], [], []
    for window in windows:
        middle = window.begin + window.size / 2
        lag = round(start.lag + start.drift * (middle - start.centre))
        first = window.begin + shift + lag
        theirs = _padded(a.values, first, window.size)
        known = _padded(a.known.astype(float), first, window.size)
        if known.mean() < 0.8:
            continue
        ours = b.values[window.begin : window.begin + window.size]
        delay, weight = _delay(theirs, ours, rate, high)
        if weight > 0:
            middles.append(middle)
            delays.append((lag + delay * rate + shift) / rate)
            weights.append(weight)
    time = b.start_s + np.array(middles) / rate
    # The grids begin at times that are no whole number of samples apart.
    offset = np.array(delays) - (b.start_s - a.start_s)
    return _line(time, offset, np.array(weights), start, len(windows))


def _delay(theirs: Array, ours: Array, rate: float, high: float) -> tuple[float, float]:
    """Delay in s at which both agree best, within half a period, and its weight (1 / variance)."""
    taper = np.hanning(len(ours) + 2)[1:-1]
    x, y = np.fft.rfft(ours * taper), np.fft.rfft(theirs * taper)
    omega = 2 * np.pi * np.fft.rfftfreq(len(ours), 1 / rate)
    cross = y * np.conj(x)
    # theirs(t) = ours(t - delay): the phase of the cross-spectrum is -omega delay.
    tries = np.linspace(-0.5 / high, 0.5 / high, 33)
    values = (cross[None] * np.exp(1j * np.outer(tries, omega))).real.sum(axis=1)
    delay = float(tries[np.argmax(values)])
    for _ in range(20):
        turned = cross * np.exp(1j * omega * delay)
        slope = float((-omega * turned.imag).sum())
        bend = float((-(omega**2) * turned.real).sum())
        if bend >= 0:
            return 0.0, 0.0
        move = -slope / bend
        delay += move
        if abs(move) < 1e-12:
            break
    turned = cross * np.exp(1j * omega * delay)
    norm = float(np.sqrt((np.abs(x) ** 2).sum() * (np.abs(y) ** 2).sum()))
    together = float(turned.real.sum()) / norm if norm > 0 else 0.0
    if abs(delay) > 0.5 / high + 1 / rate or not 0.3 < together:
        return 0.0, 0.0
    # Of a delay in white noise: (1 - rho^2) / (rho^2 bandwidth^2 samples), up to a common factor.
    width = float(-bend / turned.real.sum())
    noise = max(1 - together**2, 1e-6) / together**2
    return delay, width * len(ours) / noise


def _line(time: Array, offset: Array, weight: Array, start: _Start, windows: int) -> ClockFit:
    kept = np.ones(len(time), dtype=bool)
    for _ in range(10):
        if kept.sum() < _FEWEST_WINDOWS:
            raise AnalysisError(
                f"only {int(kept.sum())} of {windows} windows agree on the delay: the signals have too "
                "little in common, choose others or another band",
                status="ULNA_ERROR_ANALYSIS",
            )
        fitted = kept
        w = weight[fitted] / weight[fitted].sum()
        centre = float(w @ time[fitted])
        away = time[fitted] - centre
        level = float(w @ offset[fitted])
        spread = float(w @ away**2)
        drift = float(w @ (away * (offset[fitted] - level))) / spread
        residual = offset - level - drift * (time - centre)
        scaled = residual * np.sqrt(weight / weight.max())
        typical = 1.4826 * float(np.median(np.abs(scaled[fitted])))
        # Beyond four deviations of the others a window saw something else. Rounding is no outlier.
        kept = np.abs(scaled) <= max(4 * typical, 1e-9)
        if (kept == fitted).all():
            break
    used = int(fitted.sum())
    if used < 0.5 * windows or used < _FEWEST_WINDOWS:
        raise AnalysisError(
            f"only {used} of {windows} windows agree on the delay: the signals have too little in "
            "common, choose others or another band",
            status="ULNA_ERROR_ANALYSIS",
        )
    # Rounding of the times leaves some 1e-9 s even where the signals are equal.
    scatter = float(w @ residual[fitted] ** 2) / (used - 2) + 1e-18
    return ClockFit(
        offset_s=level,
        drift=drift,
        offset_error_s=float(np.sqrt(scatter)),
        drift_error=float(np.sqrt(scatter / spread)),
        centre_s=centre,
        correlation=start.correlation,
        rival=start.rival,
        windows=used,
        windows_left_out=windows - used,
    )


# One clock ----------------------------------------------------------------------------------------


def on_one_clock(
    reference: Record,
    other: Record,
    fit: ClockFit,
    *,
    rate_hz: float | None = None,
    prefix: str = "",
    progress: bool = False,
) -> Record:
    """Both recordings on the reference clock at one rate, where they overlap.

    Signals are taken as band-limited; what a lower rate cannot hold is filtered out. Nothing is filled:
    a stretch without samples or with missing values stays missing.

    Parameters
    ----------
    reference, other : Record
        Of one trial each.
    fit : ClockFit
        Of the other's clock, from `fit_clocks`.
    rate_hz
        The reference's unless given.
    prefix
        Before the names of the other's channels, where both have some of one name.
    progress
        Show a bar (needs tqdm).

    Returns
    -------
    Record
        Time 0 is that of the reference.

    Examples
    --------
    >>> import ulna
    >>> t = np.arange(0, 30, 0.01)
    >>> suit = ulna.Record.from_arrays(t, {"a": np.sin(t)})
    >>> s = np.arange(0, 20, 0.001)
    >>> shoe = ulna.Record.from_arrays(s, {"b": np.sin(s + 5)})
    >>> fit = ClockFit(5.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 10, 0)
    >>> both = on_one_clock(suit, shoe, fit)
    >>> both, bool(np.abs(both["a"] - both["b"])[64:-64].max() < 1e-4)
    (<Record: 2000 samples at 100 Hz, 1 trial; a [?], b [?]>, True)
    """
    for name, record in (("reference", reference), ("other", other)):
        if len(record.trials) != 1:
            raise refuse(f"{name} has {len(record.trials)} trials: select one of each pair", name)
    rate = reference.rate_hz if rate_hz is None else float(rate_hz)
    if not (np.isfinite(rate) and rate > 0):
        raise refuse("rate_hz must be positive", "rate_hz")
    times = [np.array(reference.time), fit.to_reference(other.time)]
    start, end = max(t[0] for t in times), min(t[-1] for t in times)
    first, last = int(np.ceil(start * rate - 1e-6)), int(np.floor(end * rate + 1e-6))
    if last - first < 2:
        raise DataError(
            f"the recordings do not overlap on one clock ({times[0][0]:.6g} to {times[0][-1]:.6g} s and "
            f"{times[1][0]:.6g} to {times[1][-1]:.6g} s)",
            status="ULNA_ERROR_DATA",
        )
    grid = np.arange(first, last + 1) / rate
    columns = []
    for record, stamps, before in ((reference, times[0], ""), (other, times[1], prefix)):
        table = _resampled(stamps, np.array(record.values), grid, rate)
        for index, channel in enumerate(record.channels):
            columns.append(
                Column(
                    before + channel.name,
                    table[:, index],
                    channel.unit,
                    channel.frame,
                    channel.role,
                )
            )
    names = [column.name for column in columns]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise refuse(f"both recordings have a channel {twice[0]!r}: give a prefix", "prefix")
    return record_of(columns, name="two recordings on one clock", time_s=grid, progress=progress)


def _resampled(stamps: Array, values: Array, grid: Array, rate: float) -> Array:
    """Channels at the times of the grid; NaN where they are not known."""
    out = np.full((len(grid), values.shape[1]), np.nan)
    known = np.isfinite(values)
    patterns: dict[bytes, list[int]] = {}
    for column in range(values.shape[1]):
        patterns.setdefault(known[:, column].tobytes(), []).append(column)
    step = float(np.median(np.diff(stamps)))
    for columns in patterns.values():
        rows = np.flatnonzero(known[:, columns[0]])
        if not len(rows):
            continue
        cuts = np.flatnonzero(np.diff(stamps[rows]) > 1.5 * step) + 1
        for run in np.split(rows, cuts):
            # A sliver between gaps does not determine a band-limited signal.
            if len(run) < 8:
                continue
            inside = np.flatnonzero(
                (grid >= stamps[run[0]] - 1e-9) & (grid <= stamps[run[-1]] + 1e-9)
            )
            if not len(inside):
                continue
            begin = min(max(grid[inside[0]], stamps[run[0]]), stamps[run[-1]])
            if begin + (len(inside) - 1) / rate > stamps[run[-1]]:
                inside = inside[:-1]
            if not len(inside):
                continue
            _, part = signal.resample(
                stamps[run],
                values[np.ix_(run, columns)],
                rate_hz=rate,
                t0_s=begin,
                count=len(inside),
            )
            out[np.ix_(inside, columns)] = part.reshape(len(inside), len(columns))
    return out
