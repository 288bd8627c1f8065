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
    if error == 0:
        return f"{value:.4g} (fixed)"
    return f"{_figures(value, error)} ± {_figures(error, error)}"


def _table(estimate: ImpedanceEstimate) -> list[str]:
    """Rows of M, B, K and x0; least squares stands beside them where there is room for all."""
    beside = estimate.least_squares
    lines = []
    widest = max(
        len(_entry(v, s))
        for name in ("M", "B", "K")
        for v, s in zip(getattr(estimate, name).ravel(), estimate.se(name).ravel(), strict=True)
    )
    width = max(16, widest + 2)
    for name, word in _NAMES.items():
        value, error = np.asarray(getattr(estimate, name)), np.asarray(estimate.se(name))
        other = value if beside is None else np.asarray(getattr(beside, name))
        unit, scale = estimate.units[name], 1.0
        if unit == "m":
            unit, scale = "mm", 1e3
        if name == "x0":  # one entry a row, in the first column
            value, error, other = value[:, None], error[:, None], other[:, None]
        for i, (row, spread) in enumerate(zip(scale * value, scale * error, strict=True)):
            head = f"{name:>2} {word:<12}{unit:<10}" if i == 0 else ""
            entries = "".join(f"{_entry(v, s):>{width}}" for v, s in zip(row, spread, strict=True))
            line = f"{head:<25}{entries}"
            if beside is not None and estimate.n <= 2:
                least = "".join(
                    f"{_figures(v, s):>8}" for v, s in zip(scale * other[i], spread, strict=True)
                )
                line = f"{line:<{25 + width * estimate.n}} |{least}"
            lines.append(line)
    return lines


def _band(low: float, high: float, digits: str = ".1f") -> str:
    return f"{low:{digits}} to {high:{digits}}"


def _fact(name: str, text: str) -> str:
    # A number stays with its sign.
    whole = text.replace(" %", "\u00a0%").replace("> ", ">\u00a0").replace("< ", "<\u00a0")
    lines = textwrap.fill(
        whole, _WIDTH, initial_indent=f"{name:<23}", subsequent_indent=" " * 23, break_long_words=False
    )
    return lines.replace("\u00a0", " ")


def _per_axis(estimate: ImpedanceEstimate, entries: list[str]) -> str:
    return ", ".join(f"{axis} {entry}" for axis, entry in zip(estimate.axes, entries, strict=True))


def impedance_summary(estimate: ImpedanceEstimate) -> str:
    """Table of M, B, K and x0 with standard errors, validation, checks and warnings."""
    what = "Joint" if estimate.rotational else "Endpoint"
    beside = estimate.least_squares is not None and estimate.n <= 2
    lines = [
        f"{what} impedance along {', '.join(estimate.axes)}: M x'' + B x' + K (x - x0) = -F",
        _paragraph(
            f"by {_ESTIMATORS[estimate.estimator]}; value ± standard error"
            + (" | least squares" if beside else "")
        ),
        "",
        *_table(estimate),
        "",
        *_facts(estimate),
    ]
    if estimate.trial_mean is not None:
        lines += ["", *_trials(estimate)]
    lines += ["", f"Outcome: {estimate.outcome.replace('_', ' ')}"]
    lines += [_paragraph(words, "  ! ") for words in estimate.warnings]
    lines += [_paragraph(words, "  - ") for words in estimate.notes]
    return "\n".join(lines)


def _facts(estimate: ImpedanceEstimate) -> list[str]:
    filters = estimate.preprocessing
    rate = filters.rate_hz
    lines = []
    if estimate.held_out_rows:
        bounds = zip(estimate.vaf, *estimate.vaf_interval, strict=True)
        entries = [
            f"{value:.1f} %" + (f" ({_band(low, high)})" if np.isfinite(low) else "")
            for value, low, high in bounds
        ]
        lines.append(_fact("VAF, held-out data", _per_axis(estimate, entries)))
    if np.all(np.isfinite(estimate.vaf_reference)):
        entries = [f"{value:.1f} %" for value in estimate.vaf_reference]
        lines.append(_fact("  of what was caused", _per_axis(estimate, entries)))
    lines.append(
        _fact(
            "Data",
            f"{estimate.train_rows / rate:.3g} s identify, {estimate.held_out_rows / rate:.3g} s "
            f"validate{', then refitted to all' if estimate.refitted else ''}, at {rate:.4g} Hz",
        )
    )
    lowpass = f"low pass {filters.lowpass_hz:.3g} Hz, " if filters.lowpass_order else ""
    lines.append(
        _fact(
            "Filters",
            f"{lowpass}window {filters.window} samples, -3 dB at {filters.effective_cutoff_hz:.3g} Hz",
        )
    )
    lines.append(_fact("Condition number", f"{estimate.condition:.3g}"))
    if estimate.rho is not None:
        entries = [f"{100 * value:.0f} %" for value in estimate.rho.total]
        lines.append(
            _fact("Motion by the human", _per_axis(estimate, entries) + " of its power")
        )
    if np.isfinite(estimate.lag_s):
        lines.append(
            _fact(
                "Force after motion", f"{1e3 * estimate.lag_s:.2g} ± {1e3 * estimate.lag_se_s:.2g} ms"
            )
        )
    return lines


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
    by = "identified model" if verdict.approach == "model" else "energy balance"
    lines = [
        f"Passivity: {verdict.verdict.upper()} (probability {_percent(verdict.probability)}, "
        f"by the {by})",
        _fact(
            "  excess, model",
            f"{_index(verdict.eop, verdict.eop_interval)} {verdict.unit}; passive with "
            f"{_percent(verdict.model_probability)}",
        ),
        _fact(
            "  excess, energy",
            f"{_index(verdict.eop_energy, verdict.eop_energy_interval)} {verdict.unit}; passive with "
            f"{_percent(verdict.energy_probability)}",
        ),
        _fact("  energy absorbed", f"{verdict.energy_j[-1]:.3g} J in {verdict.time_s[-1]:.3g} s"),
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
