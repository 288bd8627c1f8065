"""Transfer functions and order searches as text for a terminal of 80 columns."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ._words import _fact, _figures, _paragraph

if TYPE_CHECKING:
    from .models import OrderSelection, TransferFunctionEstimate

_METHODS = {
    "srivc": "refined instrumental variables (SRIVC)",
    "oe": "output-error least squares",
}
_HOLDS = {"zoh": "held", "foh": "straight"}


def entry(value: float, error: float) -> str:
    """Value ± standard error with two figures of the error, in powers of ten where that is shorter."""
    if error == 0 or not np.isfinite(error):
        return f"{value:.6g}"
    if abs(value) >= 1e6 or error < 1e-7:
        return f"{value:.6g} ± {error:.2g}"
    return f"{_figures(value, error)} ± {_figures(error, error)}"


def _power(name: str) -> str:
    degree = int(name[1:].split("[")[0])
    return "1" if degree == 0 else "s" if degree == 1 else f"s^{degree}"


def _roots(roots: np.ndarray) -> str:
    """Real roots, and frequency with damping ratio of pairs."""
    words = []
    for root in sorted(roots, key=lambda r: (abs(r), r.imag)):
        if root.imag < -1e-9 * abs(root):
            continue
        if abs(root.imag) <= 1e-9 * abs(root):
            words.append(f"{root.real:.4g}")
        else:
            words.append(f"{abs(root):.4g} (ζ {-root.real / abs(root):.3g})")
    return ", ".join(words) if words else "none"


def transfer_function_summary(estimate: TransferFunctionEstimate) -> str:
    """Coefficients with standard errors, poles, zeros, fit, noise, notes."""
    several = estimate.inputs > 1
    lines = [
        f"{estimate.output_name} = G(s) {', '.join(estimate.input_names)}, G = b(s)/a(s)"
        + (" exp(-s delay)" if np.any(np.asarray(estimate.delay_s) > 0) else ""),
        _paragraph(f"by {_METHODS[estimate.method]}, input {_HOLDS[estimate.hold]} between samples; "
                   "value ± standard error"),
        "",
        f"  {'a(s)':<8}{_power(f'a{len(estimate.den) - 1}'):<6}{'1':>24}",
    ]  # fmt: skip
    errors = np.sqrt(np.diag(estimate.covariance))
    rows = list(zip(estimate.names, estimate.values, errors, estimate.states, strict=True))
    order = sorted(rows, key=lambda row: (row[0][0], row[0].partition("[")[2], -_degree(row[0])))
    shown = "a"
    for name, value, error, state in order:
        group = name[0] + (name.partition("[")[2] if several else "")
        head = ""
        if group != shown:
            head = f"b(s)[{name.partition('[')[2]}" if several and name[0] == "b" else "b(s)"
            shown = group
        mark = "" if state == "free" else f"  ({state})"
        lines.append(f"  {head:<8}{_power(name):<6}{entry(value, error):>24}{mark}")
    lines.append("")
    delays = np.atleast_1d(estimate.delay_s)
    if np.any(delays > 0):
        lines.append(_fact("Delay", ", ".join(f"{1e3 * d:.4g}" for d in delays) + " ms (given)"))
    lines.append(_fact("Poles", f"{_roots(estimate.poles)} rad/s"))
    found = estimate.zeros if several else (estimate.zeros,)
    for name, zeros in zip(estimate.input_names, found, strict=True):
        unit = " rad/s" if len(zeros) else ""
        lines.append(_fact(f"Zeros{f' of {name}' if several else ''}", _roots(zeros) + unit))
    gains = np.atleast_1d(estimate.gain)
    lines.append(_fact("Static gain", ", ".join(f"{g:.5g}" for g in gains)))
    vaf = f"{estimate.vaf:.2f} %"
    if np.isfinite(estimate.vaf_held_out):
        vaf += f"; {estimate.vaf_held_out:.2f} % of held-out rows"
    lines.append(_fact("VAF", vaf))
    noise = "white" if not len(estimate.noise_ar) else f"AR({len(estimate.noise_ar)})"
    lines.append(_fact("Output error", f"{np.sqrt(estimate.noise_variance):.3g} rms, {noise}"))
    again = ", then refitted to all" if estimate.refitted else ""
    held = f", {estimate.held_out_rows} validated{again}" if estimate.held_out_rows else ""
    lines.append(_fact("Rows", f"{estimate.rows} at {estimate.rate_hz:.4g} Hz{held}"))
    lines.append(_fact("Condition number", f"{estimate.condition:.3g}"))
    lines.append(_fact("AICc, BIC, YIC", f"{estimate.aicc:.1f}, {estimate.bic:.1f}, {estimate.yic:.2f}"))
    lines += ["", f"Outcome: {estimate.outcome.replace('_', ' ')}"]
    bad = estimate.outcome != "good"
    for index, note in enumerate(estimate.notes):
        lines.append(_paragraph(note, "  ! " if bad and index == 0 else "  - "))
    return "\n".join(lines)


def _degree(name: str) -> int:
    return int(name[1:].split("[")[0])


def order_summary(selection: OrderSelection, rows: int) -> str:
    """Table of the best candidates and the recommendation."""
    lines = [
        f"{'':2}{'poles':>5}{'zeros':>6}{'delay':>9}{'held-out':>10}{'VAF':>9}"
        f"{'BIC':>11}{'AICc':>11}{'YIC':>8}",
        f"{'':2}{'':>5}{'':>6}{'ms':>9}{'%':>10}{'%':>9}",
    ]
    shown = list(selection.candidates[:rows])
    if selection.best is not None and selection.best not in shown:
        shown.append(selection.best)
    for c in shown:
        mark = "> " if c is selection.best else "  "
        lines.append(
            f"{mark}{c.poles:>5}{c.zeros:>6}{1e3 * c.delay_s:>9.4g}{c.vaf_held_out:>10.3f}{c.vaf:>9.3f}"
            f"{c.bic:>11.1f}{c.aicc:>11.1f}{c.yic:>8.2f}"
        )
        if c.note:
            lines.append(_paragraph(c.note, "        ! "))
    left = len(selection.candidates) - len(shown)
    if left > 0:
        lines.append(f"  and {left} more")
    lines += ["", _paragraph(f"Recommended: {selection.reason}." if selection.best else selection.reason)]
    return "\n".join(lines)
