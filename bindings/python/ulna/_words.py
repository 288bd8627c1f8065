"""Estimates and verdicts as text for a terminal of 80 columns."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from .impedance import ImpedanceEstimate
    from .passivity import PassivityVerdict

_WIDTH = 78
_NAMES = {"M": "inertia", "B": "damping", "K": "stiffness", "x0": "equilibrium"}
_ESTIMATORS = {
    "instrumental_variables": "instrumental variables from the reference",
    "least_squares": "least squares",
}


def _paragraph(text: str, mark: str = "") -> str:
    return textwrap.fill(
        text, _WIDTH, initial_indent=mark, subsequent_indent=" " * len(mark), break_long_words=False
    )


def _figures(value: float, spread: float) -> str:
    """Value with two figures of its uncertainty."""
    if not np.isfinite(value):
        return "-"
    if not np.isfinite(spread) or spread <= 0:
        return f"{value:.4g}"
    decimals = int(np.clip(1 - np.floor(np.log10(spread)), 0, 9))
    return f"{value:.{decimals}f}"


def _entry(value: float, error: float) -> str:
    return f"{_figures(value, error)} ± {_figures(error, error)}"


def _table(estimate: ImpedanceEstimate) -> list[str]:
    lines = []
    beside = estimate.least_squares
    for name, word in _NAMES.items():
        value, error = np.asarray(getattr(estimate, name)), np.asarray(estimate.se(name))
        unit = estimate.units[name]
        scale = 1e3 if name == "x0" and not estimate.rotational else 1.0
        if scale != 1.0:
            unit = "mm"
        rows = np.atleast_2d(scale * value) if name != "x0" else scale * value[:, None]
        spreads = np.atleast_2d(scale * error) if name != "x0" else scale * error[:, None]
        other = None
        if beside is not None:
            other = np.asarray(getattr(beside, name)) * scale
            other = np.atleast_2d(other) if name != "x0" else other[:, None]
        for i, (row, spread) in enumerate(zip(rows, spreads, strict=True)):
            head = f"{name:>2} {word:<12}{unit:<11}" if i == 0 else " " * 26
            line = head + "".join(f"{_entry(v, s):>18}" for v, s in zip(row, spread, strict=True))
            if other is not None and len(line) + 4 + 8 * len(row) <= _WIDTH:
                line += "  | " + " ".join(
                    f"{_figures(v, s):>7}" for v, s in zip(other[i], spread, strict=True)
                )
            lines.append(line.rstrip())
    return lines


def _band(low: float, high: float, digits: str = ".1f") -> str:
    return f"{low:{digits}} to {high:{digits}}"


def impedance_summary(estimate: ImpedanceEstimate) -> str:
    """Table of M, B, K and x0 with standard errors, validation, checks and warnings."""
    what = "Joint" if estimate.rotational else "Endpoint"
    lines = [
        f"{what} impedance of {estimate.n} {'axis' if estimate.n == 1 else 'axes'} "
        f"({', '.join(estimate.axes)}), by {_ESTIMATORS[estimate.estimator]}",
        "M x'' + B x' + K (x - x0) = -F, F by the human on the robot; value ± standard error"
        if estimate.least_squares is None
        else "value ± standard error, and least squares beside it (|)",
        "",
        *_table(estimate),
        "",
    ]
    vaf = "  ".join(
        f"{axis} {value:.1f} % ({_band(low, high)})"
        for axis, value, low, high in zip(
            estimate.axes, estimate.vaf, *estimate.vaf_interval, strict=True
        )
    )
    rate = estimate.preprocessing.rate_hz
    if estimate.held_out_rows:
        lines.append(
            f"VAF on held-out data   {vaf}   [{estimate.train_rows / rate:.3g} s identify, "
            f"{estimate.held_out_rows / rate:.3g} s validate]"
        )
    filters = estimate.preprocessing
    lowpass = f"low pass {filters.lowpass_hz:.3g} Hz, " if filters.lowpass_order else ""
    lines.append(
        f"Filters                {lowpass}window {filters.window} samples at {rate:.4g} Hz, "
        f"-3 dB at {filters.effective_cutoff_hz:.3g} Hz"
    )
    lines.append(f"Condition number       {estimate.condition:.3g}")
    if estimate.rho is not None:
        share = "  ".join(
            f"{axis} {100 * value:.0f} %"
            for axis, value in zip(estimate.axes, estimate.rho.total, strict=True)
        )
        lines.append(f"Motion by the human    {share}  (power the reference does not explain)")
    if np.isfinite(estimate.lag_s):
        lines.append(
            f"Force after motion     {1e3 * estimate.lag_s:.2g} ms ± {1e3 * estimate.lag_se_s:.2g} ms"
        )
    if estimate.trial_mean is not None:
        lines.append("")
        lines += _trials(estimate)
    lines += ["", f"Outcome: {estimate.outcome.replace('_', ' ')}"]
    lines += [_paragraph(words, "  ! ") for words in estimate.warnings]
    lines += [_paragraph(words, "  - ") for words in estimate.notes]
    return "\n".join(lines)


def _trials(estimate: ImpedanceEstimate) -> list[str]:
    assert estimate.trials is not None
    lines = [f"Mean ± standard error over {len(estimate.trials)} trials"]
    n = estimate.n
    for k, name in enumerate(("M", "B", "K")):
        place = slice(k * n * n, (k + 1) * n * n)
        entries = zip(estimate.trial_mean[place], estimate.trial_se[place], strict=True)
        lines.append(f"{name:>2}  " + "".join(f"{_entry(v, s):>18}" for v, s in entries))
    return lines


def passivity_summary(verdict: PassivityVerdict) -> str:
    """Verdict, probability, both indices, and why."""
    lines = [
        f"Passivity: {verdict.verdict.upper()} (probability {_percent(verdict.probability)}, "
        f"by the {'identified model' if verdict.approach == 'model' else 'energy balance'})",
        f"  excess by the model    {_index(verdict.eop, verdict.eop_interval)} {verdict.unit}"
        f"   [{_percent(verdict.model_probability)} passive]",
        f"  excess by the energy   {_index(verdict.eop_energy, verdict.eop_energy_interval)} "
        f"{verdict.unit}   [{_percent(verdict.energy_probability)} passive]",
        f"  energy absorbed        {verdict.energy_j[-1]:.3g} J in {verdict.time_s[-1]:.3g} s",
        _paragraph(verdict.reason, "  "),
        _paragraph(verdict.would_change, "  "),
    ]
    return "\n".join(lines)


def _index(value: float, interval: tuple[float, float]) -> str:
    if not np.all(np.isfinite(interval)):
        return f"{value:.3g}"
    spread = (interval[1] - interval[0]) / 4
    low, high = (_figures(bound, spread) for bound in interval)
    return f"{_figures(value, spread)} (95 %: {low} to {high})"


def _percent(probability: float) -> str:
    if not np.isfinite(probability):
        return "unknown"
    if probability > 0.999:
        return "> 99.9 %"
    if probability < 0.001:
        return "< 0.1 %"
    return f"{100 * probability:.1f} %"
