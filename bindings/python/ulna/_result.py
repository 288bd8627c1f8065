"""An estimate as plain numbers: what ``ulna assess --json`` prints and a report stores."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

_PARAMETERS = ("M", "B", "K", "x0")
# Of a verdict: everything but long series and what is not data.
_NOT_LISTED = {"time_s", "energy_j", "series"}


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
    return {f.name: getattr(value, f.name) for f in dataclasses.fields(value)}


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
    out["vaf_interval"] = estimate.vaf_interval
    out["vaf_reference"] = estimate.vaf_reference
    out["condition"] = estimate.condition
    return out


def _passivity(verdict: Any) -> dict[str, Any]:
    out = {
        name: value
        for name, value in _fields(verdict).items()
        if name not in _NOT_LISTED and not name.startswith("_") and not callable(value)
    }
    out["eigenvalues"] = verdict.eigenvalues
    out["energy_total_j"] = [float(absorbed[-1]) for _, absorbed, _ in verdict.series]
    out["energy_lowest_j"] = [float(absorbed.min()) for _, absorbed, _ in verdict.series]
    return out


def record_information(record: Any) -> dict[str, Any]:
    """Size, rate, channels, findings and provenance of a record."""
    return {
        "rows": len(record),
        "rate_hz": record.rate_hz,
        "duration_s": record.duration_s,
        "trials": len(record.trials),
        "channels": [_fields(channel) for channel in record.channels],
        "findings": [_fields(finding) for finding in record.findings],
        "provenance": list(record.provenance),
    }


def result(
    estimate: Any, *, source: str | list[str] | None = None, report: str | None = None
) -> dict[str, Any]:
    """Everything of an estimate that fits in a JSON object; NaN becomes ``None``.

    `source` names the file of the record, or lists those of its trials.
    """
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
    out["rho"] = None if estimate.rho is None else _fields(estimate.rho)
    names = ("difference_p", "lag_s", "lag_se_s", "train_rows", "held_out_rows", "train_s",
             "refitted", "payload_kg", "trials", "trial_mean", "trial_se", "provenance")  # fmt: skip
    out.update({name: getattr(estimate, name) for name in names})
    out["preprocessing"] = {
        **_fields(estimate.preprocessing),
        "band_hz": estimate.preprocessing.band_hz,
    }
    out["record"] = {"source": source, **record_information(estimate.record)}
    out["ulna"] = __version__
    out["report"] = report
    return plain(out)
