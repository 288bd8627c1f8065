"""Dynamic stiffness over frequency: of a model, and measured without one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class ResponsePoints:
    """Measured frequency response: dynamic stiffness, -force over position."""

    freq_hz: np.ndarray  # (f,)
    value: np.ndarray  # (f, n, n) complex


def dynamic_stiffness(m: Any, b: Any, k: Any, *, freq_hz: Any) -> np.ndarray:
    """K - w^2 M + j w B at every frequency: (f, n, n), or (draws, f, n, n) for stacked matrices.

    Examples
    --------
    >>> dynamic_stiffness([[2.0]], [[3.0]], [[50.0]], freq_hz=[0.0]).tolist()
    [[[(50+0j)]]]
    """
    omega = 2 * np.pi * np.asarray(freq_hz, dtype=float)[:, None, None]
    m, b, k = (np.asarray(z, dtype=float)[..., None, :, :] for z in (m, b, k))
    return k - omega**2 * m + 1j * omega * b


def measured_response(
    estimate: Any, *, half_band_hz: float = 0.6, step_hz: float = 0.3
) -> ResponsePoints | None:
    """Dynamic stiffness straight from the raw signals and the reference, without M, B and K.

    Around every frequency the response is taken as a straight line over `half_band_hz` to either
    side and fitted to the spectra by instrumental variables, the reference being the instrument.
    So axes that are excited at different frequencies can still be told apart. None where the log
    holds no reference or is too short; frequencies without enough excitation are left out.
    """
    raw = raw_signals(estimate)
    if raw is None or raw.reference is None:
        return None
    time = raw.time
    spectra = [
        _spectra(time[rows], [a[rows] for a in (raw.reference, raw.position, raw.force)])
        for rows in _pieces(time)
        if (time[rows][-1] - time[rows][0]) * half_band_hz > 3.0
    ]
    spectra = [piece for piece in spectra if all(np.isfinite(part).all() for part in piece)]
    if not spectra:
        return None
    freq, r, x, f = (np.concatenate(parts) for parts in zip(*spectra, strict=True))
    power = (np.abs(r) ** 2).sum(axis=1)
    order = np.argsort(freq)
    covered = np.cumsum(power[order]) / power.sum()
    top = float(freq[order][np.searchsorted(covered, 0.995)])
    found = []
    for centre in np.arange(step_hz, top - step_hz / 3, step_hz):  # none beyond the excitation
        near = np.abs(freq - centre) < half_band_hz
        value = _local_line((freq[near] - centre) / half_band_hz, r[near], x[near], f[near])
        if value is not None and power[near].sum() > 0.01 * power.sum():
            found.append((centre, value))
    if not found:
        return None
    return ResponsePoints(np.array([c for c, _ in found]), np.array([v for _, v in found]))


@dataclass(frozen=True)
class Raw:
    """Signals as recorded: time (rows,), the others (rows, n); reference may be None."""

    time: np.ndarray
    position: np.ndarray
    force: np.ndarray
    reference: np.ndarray | None


def raw_signals(estimate: Any) -> Raw | None:
    """What the record holds by role; None where its roles do not name one channel an axis."""
    record = estimate.record
    columns = {role: list(record.with_role(role)) for role in ("position", "force", "reference")}
    if len(columns["position"]) != estimate.n or len(columns["force"]) != estimate.n:
        return None
    values = record.values
    complete = len(columns["reference"]) == estimate.n
    return Raw(
        time=np.asarray(record.time),
        position=values[:, columns["position"]],
        force=values[:, columns["force"]],
        reference=values[:, columns["reference"]] if complete else None,
    )


def is_break(steps: np.ndarray) -> np.ndarray:
    """Which time steps are gaps or the start of another trial."""
    return (steps > 1.5 * np.median(steps)) | (steps <= 0)


def _pieces(time: np.ndarray) -> list[slice]:
    """Stretches without a gap."""
    if len(time) < 3:
        return []
    steps = np.diff(time)
    ends = [0, *(np.flatnonzero(is_break(steps)) + 1), len(time)]
    return [slice(a, b) for a, b in zip(ends[:-1], ends[1:], strict=True) if b - a > 2]


def _spectra(time: np.ndarray, signals_: list[np.ndarray]) -> list[np.ndarray]:
    """Frequencies above the leaked mean, and the spectra of reference, position and force."""
    window = np.hanning(len(time))[:, None]
    freq = np.fft.rfftfreq(len(time), (time[-1] - time[0]) / (len(time) - 1))
    return [freq[2:]] + [np.fft.rfft((a - a.mean(axis=0)) * window, axis=0)[2:] for a in signals_]


def _local_line(offset: np.ndarray, r: np.ndarray, x: np.ndarray, f: np.ndarray) -> Any:
    """Value at zero offset of the line Z(offset) in -f = Z x; None when it is not determined."""
    n = x.shape[1]
    regressors = np.hstack([x, offset[:, None] * x])
    instruments = np.hstack([r, offset[:, None] * r])
    normal = instruments.conj().T @ regressors
    scale = np.sqrt(np.abs(np.outer(
        (np.abs(instruments) ** 2).sum(axis=0), (np.abs(regressors) ** 2).sum(axis=0)
    )))  # fmt: skip
    if not scale.all() or np.linalg.cond(normal / scale) > 100.0:
        return None
    return np.linalg.solve(normal, instruments.conj().T @ -f)[:n].T
