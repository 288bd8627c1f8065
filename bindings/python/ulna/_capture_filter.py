"""One local polynomial for every signal of a capture: smoothed, differentiated, and put on the frames.

Every value is the value of a polynomial fitted by least squares to the samples within half a window of
it, as Savitzky and Golay (1964) do on an even grid without gaps, where both agree. Missing samples are
left out of the fit, so that a dropped frame costs certainty and not the window around it; frames need
not fall on samples, so that a signal of another clock and rate is taken over by the same filter and
stays in step with the others.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_TARGETS_AT_ONCE = 4096  # bounds the memory of the windows
# Samples beyond the polynomial's coefficients, below which a fit follows noise.
_SPARE = 2


# A polynomial of so few samples that it is this much less certain than usual is no measurement.
MOST_LOSS = 2.0


@dataclass(frozen=True, eq=False)
class Smoothed:
    """A signal on the frames.

    Attributes
    ----------
    derivatives : ndarray, shape (1 to 3, frames, channels)
        Value, rate and acceleration of one polynomial; NaN where too few samples are near.
    loss : ndarray, shape (frames, channels)
        Standard deviation of the last of them under white noise, over that of a window without gaps.
    """

    derivatives: Array
    loss: NDArray[np.float32]

    @property
    def value(self) -> Array:
        """The signal itself."""
        return np.asarray(self.derivatives[0])


def worst(loss: NDArray[np.float32]) -> Array:
    """The largest loss of the channels of each frame."""
    return np.asarray(loss.max(axis=1, initial=1.0), dtype=float)


def half_window(window_s: float, rate_hz: float, order: int) -> int:
    """Samples on either side: as many as the window holds, and enough for the polynomial."""
    return max(int(0.5 * window_s * rate_hz + 1e-9), order // 2 + 1)


def kernel_centre(half: int, order: int) -> float:
    """The middle weight of the value's kernel: the share of white noise's power that it keeps."""
    return float(_Fit(half, order + 1, 1.0, 1).kernels[0, half])


def smooth(
    start_s: float,
    rate_hz: float,
    values: Array,
    at_s: Array,
    *,
    window_s: float,
    order: int,
    derivatives: int = 2,
) -> Smoothed:
    """Values, rates and accelerations at times.

    Parameters
    ----------
    start_s, rate_hz
        Of the even grid of samples.
    values
        Shape (n, channels); NaN: missing.
    at_s
        Times, shape (frames,), increasing.
    derivatives
        0 to 2: how many are wanted beside the value.
    """
    half = half_window(window_s, rate_hz, order)
    fit = _Fit(half, order + 1, half / rate_hz, 1 + derivatives)
    place = (at_s - start_s) * rate_hz
    centre = np.rint(place).astype(np.int64)
    inside = (centre >= 0) & (centre < len(values))
    centre = np.clip(centre, 0, len(values) - 1)
    away = place - centre
    # On the samples themselves, as frames of the same clock are, one kernel serves all.
    aligned = bool(np.all(np.abs(away) < 1e-6) and np.all(np.diff(centre) == 1))
    away = np.zeros_like(away) if aligned else away

    known = np.isfinite(values)
    out = np.full((1 + derivatives, len(at_s), values.shape[1]), np.nan)
    loss = np.full((len(at_s), values.shape[1]), np.inf, dtype=np.float32)
    for columns in _alike(known):
        table = np.pad(np.where(known[:, columns], values[:, columns], 0.0), ((half, half), (0, 0)))
        mask = np.pad(known[:, columns[0]].astype(float), half)
        seen = np.lib.stride_tricks.sliding_window_view(mask, fit.width)[centre]
        count = seen.sum(axis=1)
        rows = np.flatnonzero(inside & (count >= order + 1 + _SPARE))
        whole = count[rows] == fit.width
        if aligned and whole.any():
            span = table[centre[0] : centre[-1] + fit.width]
            at = np.ix_(rows[whole], columns)
            for d in range(1 + derivatives):
                out[d][at] = _correlate(fit.kernels[d], span)[rows[whole]]
            loss[at] = 1.0
            rows = rows[~whole]
        windows = np.lib.stride_tricks.sliding_window_view(table, fit.width, axis=0)
        for begin in range(0, len(rows), _TARGETS_AT_ONCE):
            part = rows[begin : begin + _TARGETS_AT_ONCE]
            weights, lost = fit.weights(away[part], seen[part])
            near = windows[centre[part]]
            at = np.ix_(range(1 + derivatives), part, columns)
            out[at] = np.einsum("fcw,dfw->dfc", near, weights, optimize=True)
            loss[np.ix_(part, columns)] = lost[:, None]
    return Smoothed(out, loss)


class _Fit:
    """Polynomials of `count` coefficients in windows of 2 half + 1 samples, u = -1 to 1 over them."""

    def __init__(self, half: int, count: int, scale_s: float, derivatives: int) -> None:
        self.width, self.count, self.half, self.scale = 2 * half + 1, count, half, scale_s
        self.derivatives = derivatives
        self.basis = (np.arange(-half, half + 1) / half)[:, None] ** np.arange(count)
        self._whole = np.linalg.inv(self.basis.T @ self.basis)
        rows = self._rows(np.zeros(1))[:, 0]
        self.kernels = rows @ self._whole @ self.basis.T
        self._least = float(np.linalg.norm(self.kernels[-1]))

    def _rows(self, away: Array) -> Array:
        """What turns coefficients into derivatives at these samples off the centre, (d, n, count)."""
        u = away / self.half
        return np.stack(
            [_derivative(u, self.count, d) / self.scale**d for d in range(self.derivatives)]
        )

    def weights(self, away: Array, seen: Array) -> tuple[Array, Array]:
        """Weights of the samples (d, n, width), and the last derivative's loss of certainty (n,)."""
        rows = self._rows(away)
        if seen.all():
            weights = (rows @ self._whole) @ self.basis.T
        else:
            gram = np.einsum("fw,wp,wq->fpq", seen, self.basis, self.basis, optimize=True)
            weights = np.einsum("dfp,fpq->dfq", rows, _inverse(gram)) @ self.basis.T * seen
        lost = np.linalg.norm(weights[-1], axis=1) / self._least
        return weights, np.where(np.isfinite(lost), lost, np.inf)


def _correlate(kernel: Array, table: Array) -> Array:
    """Sums of kernel times rows of a table: row i of the result begins at row i of the table."""
    count = len(table) - len(kernel) + 1
    out = np.zeros((count, table.shape[1]))
    # Pieces that stay in the processor's cache while the kernel passes over them.
    rows = max(1, 30_000 // table.shape[1])
    scratch = np.empty((rows, table.shape[1]))
    for begin in range(0, count, rows):
        size = min(rows, count - begin)
        for shift, weight in enumerate(kernel):
            first = begin + shift
            np.multiply(table[first : first + size], weight, out=scratch[:size])
            out[begin : begin + size] += scratch[:size]
    return out


def _derivative(u: Array, count: int, order: int) -> Array:
    """Rows that turn coefficients in powers of u into the derivative there, (len(u), count)."""
    powers = np.arange(count)
    factor = np.array([factorial(p) / factorial(p - order) if p >= order else 0.0 for p in powers])
    return factor * u[:, None] ** np.maximum(powers - order, 0)


def _inverse(gram: Array) -> Array:
    """Inverses of Gram matrices; NaN where the samples do not determine the polynomial."""
    sound = np.linalg.cond(gram) < 1e10
    out = np.full_like(gram, np.nan)
    out[sound] = np.linalg.inv(gram[sound])
    return out


def _alike(known: NDArray[np.bool_]) -> list[list[int]]:
    """Columns with the same missing samples."""
    groups: dict[bytes, list[int]] = {}
    for column in range(known.shape[1]):
        groups.setdefault(np.packbits(known[:, column]).tobytes(), []).append(column)
    return list(groups.values())
