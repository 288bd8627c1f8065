"""Frequency response functions with confidence circles: Welch, periodic, local polynomial, closed loop."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from . import signal
from ._call import check, ffi, lib, long_call, options, view
from ._ports import Ports, Word, ports
from .record import refuse

Method = Literal["welch", "periodic", "local"]


@dataclass(frozen=True, eq=False)
class ResponseEstimate:
    """Measured frequency response of each output to each input.

    Attributes
    ----------
    freq_hz : ndarray, shape (bins,)
    value : ndarray of complex, shape (bins, outputs, inputs)
        Output unit over input unit; NaN where a frequency is not excited.
    radius : ndarray, shape (bins, outputs, inputs)
        Of the circle about `value` that holds the truth with `confidence`, frequency by frequency.
    coherence : ndarray, shape (bins, outputs), or None
        Share of each output's power that the inputs (in a closed loop: the references) explain,
        without the bias of few averages. None for periodic excitation.
    input_coherence : ndarray, shape (bins, inputs), or None
        Closed loop only: share of each input's power that the references explain.
    confidence : float
    method : str
        "welch", "periodic", "local" or "closed loop".
    averages : float
        Independent averages behind each value, or the degrees of freedom.
    input_names, output_names : tuple of str
    """

    freq_hz: np.ndarray
    value: np.ndarray
    radius: np.ndarray
    coherence: np.ndarray | None
    input_coherence: np.ndarray | None
    confidence: float
    method: str
    averages: float
    input_names: tuple[str, ...]
    output_names: tuple[str, ...]
    units: np.ndarray = field(repr=False)  # (outputs, inputs) of str

    @property
    def magnitude(self) -> np.ndarray:
        """|H|, the shape of `value`."""
        return np.abs(self.value)

    @property
    def phase_rad(self) -> np.ndarray:
        """Phase, rad; unwrapped over the frequencies at which it is well known.

        That is where the circle's radius is below half the magnitude: noise alone reaches the
        magnitude of its circle in one case of twenty, and twice that next to never. Elsewhere the
        phase is given within half a turn of the last one that is well known.
        """
        out = np.full(self.value.shape, np.nan)
        for place in np.ndindex(*self.value.shape[1:]):
            value, radius = self.value[(slice(None), *place)], self.radius[(slice(None), *place)]
            known = np.isfinite(value)
            angle = np.angle(value[known])
            firm = ~(radius[known] >= 0.5 * np.abs(value[known]))
            out[(known, *place)] = _unwrapped(angle, firm)
        return out

    @property
    def magnitude_band(self) -> tuple[np.ndarray, np.ndarray]:
        """Least and largest magnitude within the circle."""
        return np.maximum(self.magnitude - self.radius, 0.0), self.magnitude + self.radius

    @property
    def phase_band(self) -> tuple[np.ndarray, np.ndarray]:
        """Least and largest phase within the circle, rad; the whole turn where it holds zero."""
        with np.errstate(invalid="ignore", divide="ignore"):
            ratio = self.radius / self.magnitude
        half = np.where(ratio < 1.0, np.arcsin(np.clip(ratio, 0.0, 1.0)), np.pi)
        half = np.where(np.isnan(ratio), np.nan, half)
        return self.phase_rad - half, self.phase_rad + half

    def summary(self) -> str:
        """What was estimated and how well, in a few lines."""
        known = np.isfinite(self.value).all(axis=(1, 2))
        share = 100 * np.median(self.radius[known] / np.abs(self.value[known]))
        lines = [
            repr(self)[1:-1],
            f"  {int(known.sum())} frequencies from {self.freq_hz[known][0]:.3g} to "
            f"{self.freq_hz[known][-1]:.3g} Hz, {self.averages:.3g} independent averages",
            f"  radius of the {100 * self.confidence:.3g} % circle: "
            f"{share:.{0 if share >= 10 else 1}f} % of the magnitude in the median",
        ]
        if self.coherence is not None:
            lines.append(f"  coherence: {np.nanmedian(self.coherence):.3f} in the median")
        return "\n".join(lines)

    def plot(self, axes: Any = None, *, model: Any = None) -> np.ndarray:
        """Magnitude, phase and coherence over frequency, with bands (needs matplotlib).

        Parameters
        ----------
        axes : array of matplotlib.axes.Axes, optional
        model : TransferFunctionEstimate, optional
            Drawn over it.
        """
        from . import plot

        return plot.response(self, axes, model=model)

    def __repr__(self) -> str:
        return (
            f"<ResponseEstimate {', '.join(self.output_names)} over {', '.join(self.input_names)} "
            f"by {self.method}: {self.freq_hz.size} frequencies to {self.freq_hz[-1]:.4g} Hz>"
        )


def _unwrapped(angle: np.ndarray, firm: np.ndarray) -> np.ndarray:
    """Angles as close as turns allow to the last firm one before them."""
    out = angle.copy()
    at = np.flatnonzero(firm)
    if not at.size:
        return out
    out[at] = np.unwrap(angle[at])
    before = np.maximum.accumulate(np.where(firm, np.arange(angle.size), at[0]))
    return out + 2 * np.pi * np.round((out[before] - out) / (2 * np.pi))


def frf(
    u: Any,
    y: Any = None,
    *,
    rate_hz: float | None = None,
    input: Word | None = None,  # noqa: A002
    output: Word | None = None,
    reference: Any = None,
    method: Method = "welch",
    runs: Any = None,
    segment: int | None = None,
    period_s: float | None = None,
    skip_periods: int = 1,
    order: int = 2,
    half_width: int | None = None,
    confidence: float = 0.95,
    progress: bool = False,
) -> ResponseEstimate:
    """Measured frequency response with confidence circles and coherence.

    Parameters
    ----------
    u, y : array_like, shape (rows,) or (rows, channels)
        Inputs and outputs; or `u` is a `Record`, and `input` and `output` name its channels.
    rate_hz : float
        Sample rate of arrays.
    input, output : str or list of str
        Channels of a record.
    reference : array_like, str or list of str, optional
        What drives a control loop that `u` and `y` are recorded in, one for each input. Feedback
        brings the noise of `y` into `u`, which biases every other method; here H = S_ry / S_ru.
    method : {"welch", "periodic", "local"}
        "welch": H1 by averaged segments; several inputs are told apart by their cross spectra.
        "periodic": means over periods of `period_s`, for multisines; nothing leaks.
        "local": local polynomials over the whole run, finer and free of leakage.
    runs : array_like of int, shape (n, 2), optional
        Rows ``[begin, end)`` that are never joined; the segments of a record.
    segment : int, optional
        Welch, closed loop: samples of a segment; 1024, or all rows when there are fewer.
    period_s, skip_periods : float, int
        Periodic: a whole number of samples; periods left out at the start of every run.
    order, half_width : int
        Local: degree of the polynomials; bins to either side (so that 10 degrees of freedom remain).
    confidence : float
        Of the circles.
    progress : bool
        Show a bar (needs tqdm).

    Returns
    -------
    ResponseEstimate

    Examples
    --------
    A spring of 3 N/m with noise on the force:

    >>> import numpy as np
    >>> from ulna import models
    >>> rng = np.random.default_rng(0)
    >>> x = rng.normal(size=20000)
    >>> h = models.frf(x, 3 * x + 0.1 * rng.normal(size=20000), rate_hz=1000, segment=256)
    >>> bool(np.all(np.abs(h.value - 3) < 2 * h.radius))
    True
    """
    signals = ports(u, y, rate_hz, runs, input=input, output=output, reference=reference)
    if not 0 < confidence < 1:
        raise refuse("confidence must lie between 0 and 1", "confidence")
    if reference is not None:
        if method != "welch":
            raise refuse("with a reference the method is Welch's: leave method out", "method")
        return _closed_loop(signals, segment, confidence, progress)
    if method == "welch":
        return _welch(signals, segment, confidence)
    if method == "periodic":
        return _periodic(signals, period_s, skip_periods, confidence, progress)
    if method == "local":
        return _local(signals, order, half_width, confidence, progress)
    raise refuse(f"method is {method!r}; it must be 'welch', 'periodic' or 'local'", "method")


def _welch(p: Ports, segment: int | None, confidence: float) -> ResponseEstimate:
    given = {"rate_hz": p.rate_hz, "segment": segment, "ranges": p.runs}
    response = signal.frequency_response(p.inputs, p.outputs, confidence=confidence, **given)
    coherence = signal.coherence(p.inputs, p.outputs, **given)
    return _result(
        p,
        response.freq_hz,
        response.value,
        response.radius,
        coherence.corrected,
        None,
        confidence,
        "welch",
        coherence.effective_averages,
    )


def _closed_loop(p: Ports, segment: int | None, confidence: float, progress: bool) -> ResponseEstimate:
    given = {"rate_hz": p.rate_hz, "segment": segment, "ranges": p.runs}
    n, m = p.inputs.shape[1], p.outputs.shape[1]
    both = np.column_stack([p.inputs, p.outputs])
    chosen = _options(p, confidence, segment=segment)
    table = _table(
        lib.ulna_frf_closed_loop, (p.reference, p.inputs, p.outputs), p, chosen, progress
    ).reshape(1 + 3 * n * m, -1)
    coherence = signal.coherence(p.reference, both, **given)
    return _result(
        p,
        *_parts(table, m, n),
        coherence.corrected[:, n:],
        coherence.corrected[:, :n],
        confidence,
        "closed loop",
        coherence.effective_averages,
    )


def _periodic(
    p: Ports, period_s: float | None, skip: int, confidence: float, progress: bool
) -> ResponseEstimate:
    if period_s is None:
        raise refuse("give period_s, the period of the excitation", "period_s")
    period = period_s * p.rate_hz
    if not abs(period - round(period)) < 1e-6 * max(1.0, period) or not period >= 4:
        raise refuse(
            f"period_s is {period:.6g} samples; it must be a whole number, at least 4", "period_s"
        )
    if skip < 0:
        raise refuse("skip_periods must not be negative", "skip_periods")
    n, m = p.inputs.shape[1], p.outputs.shape[1]
    chosen = _options(p, confidence, period=round(period), skip=skip if skip > 0 else -1)
    table = _table(lib.ulna_frf_periodic, (p.inputs, p.outputs), p, chosen, progress)
    runs = [(0, len(p.inputs))] if p.runs is None else p.runs
    freedom = sum((end - begin) // round(period) - skip - 1 for begin, end in runs)
    parts = _parts(table.reshape(1 + 3 * n * m, -1), m, n)
    return _result(p, *parts, None, None, confidence, "periodic", float(freedom))


def _local(
    p: Ports, order: int, half_width: int | None, confidence: float, progress: bool
) -> ResponseEstimate:
    if not 1 <= order <= 6:
        raise refuse(f"order is {order}; it must be from 1 to 6", "order")
    n, m = p.inputs.shape[1], p.outputs.shape[1]
    chosen = _options(p, confidence, order=order, half_width=half_width)
    table = _table(lib.ulna_frf_local, (p.inputs, p.outputs), p, chosen, progress)
    table = table.reshape(1 + 3 * n * m + 2 * m, -1)
    runs = 1 if p.runs is None else len(p.runs)
    unknowns = (order + 1) * (n + runs)
    width = half_width
    if width is None:
        width = next(w for w in range(1, 1000) if runs * (2 * w + 1) - unknowns >= 10)
    freedom = runs * (2 * width + 1) - unknowns
    coherence = table[1 + 3 * n * m + m :].T
    return _result(
        p, *_parts(table, m, n), coherence, None, confidence, "local", float(freedom)
    )


def _options(p: Ports, confidence: float, **fields: Any) -> Any:
    if p.runs is not None:
        fields |= {"ranges": p.runs, "range_count": len(p.runs)}
    return options("ulna_frf_options", confidence=confidence, **fields)


def _table(
    function: Any, signals: tuple[Any, ...], p: Ports, chosen: Any, progress: bool
) -> np.ndarray:
    views = [view(values) for values in signals]
    count = ffi.new("int64_t *")
    check(function(*views, p.rate_hz, chosen, ffi.NULL, ffi.NULL, 0, count))
    out = np.empty(count[0])
    pointer = ffi.cast("double *", out.__array_interface__["data"][0])
    long_call(
        function, *views, p.rate_hz, chosen, ffi.NULL, pointer, out.size, count,
        progress=progress, label="frequency response",
    )  # fmt: skip
    return out


def _parts(table: np.ndarray, m: int, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Frequencies, values and radii of a table by columns."""
    parts = table[1 : 1 + 3 * m * n].reshape(m, n, 3, -1)
    value = np.moveaxis(parts[:, :, 0] + 1j * parts[:, :, 1], -1, 0)
    return table[0], value, np.moveaxis(parts[:, :, 2], -1, 0)


def _result(
    p: Ports,
    freq_hz: np.ndarray,
    value: np.ndarray,
    radius: np.ndarray,
    coherence: np.ndarray | None,
    input_coherence: np.ndarray | None,
    confidence: float,
    method: str,
    averages: float,
) -> ResponseEstimate:
    units = np.array(
        [[f"{out}/{into}" if out and into else "" for into in p.input_units] for out in p.output_units],
        dtype=object,
    )
    return ResponseEstimate(
        freq_hz, value, radius, coherence, input_coherence, confidence, method, averages,
        p.input_names, p.output_names, units,
    )  # fmt: skip
