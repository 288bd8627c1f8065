"""Indices, two-ports and allowed gains as text for a terminal of 80 columns."""

from __future__ import annotations

import textwrap
from typing import Any

import numpy as np

_WIDTH = 78


def _at(omega_rad_s: float) -> str:
    if np.isnan(omega_rad_s):
        return ""
    if np.isinf(omega_rad_s):
        return "at infinite frequency"
    return f"at {omega_rad_s:.4g} rad/s ({omega_rad_s / (2 * np.pi):.3g} Hz)"


def _line(name: str, value: float, where: str) -> str:
    return f"  {name:<22}{value:>12.5g}  {where}".rstrip()


def _wrapped(text: str) -> str:
    return textwrap.fill(text, _WIDTH)


def _scope(found: Any) -> str:
    parts = []
    if found.band_rad_s is not None:
        low, high = found.band_rad_s
        parts.append(f"from {low:g} to {high:g} rad/s")
    if getattr(found, "direction", None) is not None:
        parts.append("along (" + ", ".join(f"{x:.3g}" for x in found.direction) + ")")
    return " " + " ".join(parts) if parts else " at all frequencies"


def indices_summary(found: Any) -> str:
    """`PortIndices` in words."""
    lines = [
        _wrapped(f"Passivity of the system{_scope(found)}: {found.verdict.upper()}"),
        _wrapped(found.reason),
        _line("input index (excess)", found.input, _at(found.input_frequency_rad_s)),
        _line("output index", found.output, _at(found.output_frequency_rad_s)),
        _line("relative index", found.relative, _at(found.relative_frequency_rad_s)),
    ]
    return "\n".join(lines + [_wrapped(note) for note in found.notes])


def two_port_summary(found: Any) -> str:
    """`TwoPortStability` in words."""
    kind = "shortage" if found.shortage > 0 else "excess"
    ends = (
        "both terminations passive"
        if found.shortage == 0
        else f"port {found.port} ends with {kind} {abs(found.shortage):.4g}, the other is passive"
    )
    lines = [
        _wrapped(f"Two-port{_scope(found)}, {ends}: {found.verdict.upper()}"),
        _wrapped(found.reason),
        _line("margin", found.margin, _at(found.margin_frequency_rad_s)),
        _line(
            f"largest shortage, {found.port}",
            found.largest_shortage,
            _at(found.largest_shortage_frequency_rad_s),
        ),
        _line(
            f"largest shortage, {3 - found.port}",
            found.opposite_shortage,
            _at(found.opposite_shortage_frequency_rad_s),
        ),
    ]
    return "\n".join(lines)


def allowed_summary(found: Any) -> str:
    """`Allowed` in words."""
    low, high = found.excess_interval
    known = f"{found.excess:.4g} {found.excess_unit}"
    if high > low:
        known += f" ({low:.4g} to {high:.4g})"
    head = f"Allowed {found.quantity}{f' ({found.unit})' if found.unit else ''}"
    rows = [
        _wrapped(f"{head} over delay, for {found.loop}."),
        f"  excess of passivity of the arm: {known}",
        "",
        f"  {'delay':>9}{'any passive arm':>18}{'this arm, low':>16}{'this arm':>12}",
    ]
    shown = np.unique(np.linspace(0, len(found.delay_s) - 1, 8).astype(int))
    for i in shown:
        rows.append(
            f"  {1e3 * found.delay_s[i]:>6.4g} ms{found.passive[i]:>18.4g}{found.low[i]:>16.4g}"
            f"{found.allowed[i]:>12.4g}"
        )
    rows += ["", _wrapped(found.reason)]
    return "\n".join(rows)
