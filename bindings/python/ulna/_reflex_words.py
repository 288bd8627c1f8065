"""Reflexes, windows and joints as text for a terminal of 80 columns."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ._words import _fact, _figures, _paragraph

if TYPE_CHECKING:
    from .joint import JointImpedance
    from .reflex import DelayedFeedback, ReflexEstimate, WindowComparison


def _with_interval(value: float, low: float, high: float, *, scale: float = 1.0) -> str:
    spread = (high - low) / 4
    words = [_figures(scale * v, scale * spread) for v in (value, low, high)]
    return f"{words[0]} ({words[1]} to {words[2]})"


def _probability(p: float) -> str:
    if not np.isfinite(p):
        return "not tested, too few blocks"
    return f"p = {p:.2g}"


def _ending(estimate: Any) -> list[str]:
    lines = ["", f"Outcome: {estimate.outcome.replace('_', ' ')}"]
    lines += [_paragraph(words, "  ! ") for words in estimate.warnings]
    lines += [_paragraph(words, "  - ") for words in estimate.notes]
    return lines


def reflex_summary(e: ReflexEstimate) -> str:
    """Parameters with 95 % intervals, what each path accounts for, the test, warnings."""
    words = {
        "M": "inertia",
        "B": "damping",
        "K": "stiffness",
        "gain": "reflex gain",
        "omega": "reflex frequency",
        "zeta": "reflex damping ratio",
    }
    lines = [
        f"Intrinsic and reflex torque at {e.axis}: parallel cascade",
        _paragraph(
            f"{e.intrinsic} intrinsic path; reflex of order {e.order} on {e.side} position; "
            "value (95 % interval)"
        ),
        "",
    ]
    for name, word in words.items():
        value = e.value(name)
        if np.isfinite(value):
            entry = _with_interval(value, *e.interval(name))
            lines.append(f"  {word:<21}{entry} {e.units[name]}".rstrip())
    entry = _with_interval(e.delay_s, *e.delay_interval_s, scale=1e3)
    lines += [f"  {'reflex delay':<21}{entry} ms", ""]
    if np.isfinite(e.vaf):
        low, high = e.vaf_interval
        band = f" ({low:.1f} to {high:.1f})" if np.isfinite(low) else ""
        lines.append(_fact("VAF, held-out data", f"{e.vaf:.1f} %{band}"))
        lines.append(
            _fact(
                "  each path alone",
                f"intrinsic {e.vaf_intrinsic:.1f} %, reflex {e.vaf_reflex:.1f} %",
            )
        )
        low, high = e.vaf_gain_interval
        band = f"; {low:.1f} to {high:.1f} % less" if np.isfinite(low) else ""
        lines.append(_fact("  without a reflex", f"{e.vaf_without:.1f} %{band}"))
    else:
        lines.append(
            _fact(
                "VAF, data of the fit",
                f"{e.vaf_train:.1f} %, without a reflex {e.vaf_train_without:.1f} %",
            )
        )
    lines.append(_fact("Is there a reflex?", _probability(e.p_value)))
    rate = e.preprocessing.rate_hz
    lines.append(
        _fact(
            "Data",
            f"{e.train_rows / rate:.3g} s identify, {e.held_out_rows / rate:.3g} s validate"
            f"{', then refitted to all' if e.refitted else ''}, at {rate:.4g} Hz",
        )
    )
    return "\n".join(lines + _ending(e))


def _matrix_rows(
    name: str, value: np.ndarray, error: np.ndarray, unit: str, width: int = 20
) -> list[str]:
    lines = []
    for i, (row, errors) in enumerate(zip(np.atleast_2d(value), np.atleast_2d(error), strict=True)):
        entries = "".join(
            f"{_figures(v, s)} ± {_figures(s, s)}".rjust(width)
            if np.isfinite(s)
            else f"{v:.4g}".rjust(width)
            for v, s in zip(row, errors, strict=True)
        )
        lines.append(f"  {name if i == 0 else '':<10}{entries}   {unit if i == 0 else ''}".rstrip())
    return lines


def delayed_summary(e: DelayedFeedback) -> str:
    """What acts at once, what acts later, the delay, the test, warnings."""
    what = "instrumental variables" if e.estimator.startswith("inst") else "least squares"
    lines = [
        _paragraph(f"Impedance along {', '.join(e.axes)} with delayed feedback, by {what}"),
        "  M x'' + B x' + K (x - x0) + K_d (x(t - tau) - x0) + B_d x'(t - tau) = -F",
        "",
    ]
    for name, short in (
        ("M", "M"),
        ("B", "B"),
        ("K", "K"),
        ("K_delayed", "K_d"),
        ("B_delayed", "B_d"),
    ):
        lines += _matrix_rows(short, getattr(e, name), e.se(name), e.units[name])
    entry = _with_interval(e.delay_s, *e.delay_interval_s, scale=1e3)
    lines += ["", _fact("Delay (95 % interval)", f"{entry} ms")]
    if np.all(np.isfinite(e.vaf)):
        entries = ", ".join(
            f"{axis} {v:.1f} % (without {w:.1f} %)"
            for axis, v, w in zip(e.axes, e.vaf, e.vaf_without, strict=True)
        )
        lines.append(_fact("VAF, held-out data", entries))
    lines.append(_fact("Delayed feedback?", _probability(e.p_value)))
    lines.append(_fact("Condition number", f"{e.condition:.3g}"))
    return "\n".join(lines + _ending(e))


def windows_summary(e: WindowComparison) -> str:
    """Both windows and their difference, the test, warnings."""
    lines = [
        f"Impedance along {', '.join(e.axes)}: first {1e3 * e.window_s:.0f} ms of "
        f"{len(e.onsets_s)} perturbations, and after it",
        "  value ± standard error over perturbations",
        "",
    ]
    shared = not np.any(e.difference["M"])
    if shared:
        lines += _matrix_rows("M", e.early["M"], e.se("M", part="early"), e.units["M"])
    for name in ("B", "K") if shared else ("M", "B", "K"):
        for part, value in (("early", e.early), ("late", e.late), ("difference", e.difference)):
            label = "  change" if part == "difference" else f"{name} {part}"
            lines += _matrix_rows(label, value[name], e.se(name, part=part), e.units[name])
    lines += [
        "",
        _fact("Do they differ?", _probability(e.p_value)),
        _fact("VAF", ", ".join(
            f"{axis} {a:.1f} % in the window, {b:.1f} % after"
            for axis, a, b in zip(e.axes, e.early_vaf, e.late_vaf, strict=True)
        )),
        _fact("Filter", f"-3 dB at {e.preprocessing.effective_cutoff_hz:.3g} Hz"),
    ]  # fmt: skip
    return "\n".join(lines + _ending(e))


def joint_summary(z: JointImpedance) -> str:
    """M, B and K, the posture's share, the margins."""
    where = "joints" if z.at == "joints" else "hand"
    lines = [f"Impedance at the {where}", ""]
    for name in ("M", "B", "K"):
        lines += _matrix_rows(name, getattr(z, name), z.se(name), z.units[name])
    if z.at == "joints":
        lines += _matrix_rows("posture", -z.gamma, np.full_like(z.gamma, np.nan), "N m/rad of K")
    margins = z.passivity()
    lines += [
        "",
        _fact(
            "Smallest eigenvalues",
            f"M {margins.m_min:.3g}, B {margins.b_min:.3g}, K {margins.k_min:.3g}",
        ),
    ]
    if z.cov is not None:
        lines.append(_fact("All positive", f"with probability {margins.probability:.3f}"))
    lines.append(_fact("Condition of J", f"{z.condition:.3g}"))
    return "\n".join(lines)
