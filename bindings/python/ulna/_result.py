"""An estimate as plain numbers: what ``ulna assess --json`` prints and a report stores."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

_PARAMETERS = ("M", "B", "K", "x0")
# Of a verdict: everything but long series and what is not data.
_NOT_LISTED = {"time_s", "energy_j"}


def plain(value: Any) -> Any:
    """`value` in JSON's own types; NaN and infinities become ``None``.

    Examples
    --------
    >>> plain({"a": np.array([1.0, np.nan]), "b": (np.int64(2), True)})
    {'a': [1.0, None], 'b': [2, True]}
    """
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, bool | int | str):
        return value
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    return str(value)


def _fields(value: Any) -> dict[str, Any]:
    if dataclasses.is_dataclass(value):
        return {f.name: getattr(value, f.name) for f in dataclasses.fields(value)}
    return dict(vars(value))


def _fit(estimate: Any) -> dict[str, Any]:
    """What an estimate and its least-squares companion both have."""
    out: dict[str, Any] = {"estimator": estimate.estimator, "outcome": estimate.outcome}
    for name in _PARAMETERS:
        out[name] = getattr(estimate, name)
    out["standard_errors"] = {name: getattr(estimate, name + "_se") for name in _PARAMETERS}
    for name in _PARAMETERS:
        out[name + "_se"] = getattr(estimate, name + "_se")
    out["intervals_95"] = {name: list(estimate.interval(name)) for name in _PARAMETERS}
    out["vaf"] = np.atleast_1d(estimate.vaf)
    out["vaf_interval"] = getattr(estimate, "vaf_interval", None)
    out["condition"] = getattr(estimate, "condition", None)
    return out


def _passivity(verdict: Any) -> dict[str, Any]:
    out = {
        name: value
        for name, value in _fields(verdict).items()
        if name not in _NOT_LISTED and not name.startswith("_") and not callable(value)
    }
    energy = np.asarray(verdict.energy_j, dtype=float)
    out["energy_total_j"] = float(energy[-1]) if energy.size else None
    out["energy_lowest_j"] = float(energy.min()) if energy.size else None
    return out


def _preprocessing(prepared: Any) -> dict[str, Any]:
    names = (
        "lowpass_hz", "effective_cutoff_hz", "window", "order", "flagged_start", "flagged_end",
        "band_hz", "rate_hz",
    )  # fmt: skip
    return {name: getattr(prepared, name) for name in names if hasattr(prepared, name)}


def record_information(record: Any) -> dict[str, Any]:
    """Size, rate, channels and provenance of a record, as far as it tells."""
    out: dict[str, Any] = {}
    for name in ("rows", "rate_hz", "duration_s", "provenance"):
        value = getattr(record, name, None)
        if value is not None and not callable(value):
            out[name] = value
    trials = getattr(record, "trials", None)
    if trials is not None and hasattr(trials, "__len__"):
        out["trials"] = len(trials)
    channels = getattr(record, "channels", None)
    if channels is not None and not callable(channels):
        out["channels"] = [_channel(channel) for channel in channels]
    return out


def _channel(channel: Any) -> Any:
    names = ("name", "unit", "frame", "sign", "role", "axis", "source_name", "source_unit")
    found = {name: getattr(channel, name) for name in names if hasattr(channel, name)}
    return found or str(channel)


def result(
    estimate: Any, *, source: str | None = None, report: str | None = None
) -> dict[str, Any]:
    """Everything of an estimate that fits in a JSON object; NaN becomes ``None``."""
    from . import __version__

    out = _fit(estimate)
    out["n"] = estimate.n
    out["axes"] = list(estimate.axes)
    out["rotational"] = bool(estimate.rotational)
    out["units"] = dict(estimate.units)
    out["warnings"] = list(estimate.warnings)
    out["notes"] = list(estimate.notes)
    out["passivity"] = _passivity(estimate.passivity())
    out["ellipses"] = (
        {name: _fields(shape) for name, shape in estimate.ellipses().items()}
        if estimate.n == 2
        else None
    )
    squares = estimate.least_squares
    out["least_squares"] = None if squares is None else _fit(squares)
    out["rho"] = None if estimate.rho is None else {"total": estimate.rho.total}
    out["lag_s"] = getattr(estimate, "lag_s", None)
    out["lag_se_s"] = getattr(estimate, "lag_se_s", None)
    out["preprocessing"] = _preprocessing(estimate.preprocessing)
    out["record"] = {"source": source, **record_information(estimate.record)}
    out["ulna"] = __version__
    out["report"] = report
    return plain(out)
