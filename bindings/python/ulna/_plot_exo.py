"""Figures of the exoskeleton and the arm; `ulna.plot` offers them."""

from __future__ import annotations

from typing import Any

import numpy as np

from ._figure import BLUE, GREY, INK, ORANGE, WIDTH_IN, axes_grid, style


def elbow_torque(torque: Any, axes: Any = None) -> np.ndarray:
    """Maximum isometric torque beside measurements, and beside it the muscles' moment arms.

    Left: flexion above zero and extension below, passive torque grey, Amis as circles, Buchanan as
    squares. Right: moment arms, flexors blue and extensors orange.
    """
    from .exo import measured_torque

    with style():
        grid = axes_grid(axes, 1, 2, (WIDTH_IN, 3.2), width_ratios=[1.25, 1.0])
        left, right = grid[0]
        degrees = np.degrees(torque.angle_rad)
        left.axhline(0, color=INK, linewidth=0.6)
        left.plot(degrees, torque.flexion, color=BLUE, linewidth=1.6, label="flexion")
        left.plot(degrees, torque.extension, color=ORANGE, linewidth=1.6, label="extension")
        left.plot(degrees, torque.passive, color=GREY, linestyle="--", label="passive")
        for source, marker in (("Amis", "o"), ("Buchanan", "s")):
            angle, flexion, extension = measured_torque(source)
            look = {"marker": marker, "linestyle": "", "markersize": 4, "markerfacecolor": "white"}
            left.plot(np.degrees(angle), flexion, color=BLUE, **look)
            left.plot(np.degrees(angle), extension, color=ORANGE, **look)
            left.plot([], [], color=INK, label=source, **look)
        left.set(
            xlabel="elbow flexion (deg)", ylabel="torque (N m)", title="Maximum isometric torque"
        )
        left.set_ylim(-75, 115)
        left.legend(ncol=3, loc="upper left")

        ends = []
        for k, name in enumerate(torque.muscles):
            arm = 1e3 * torque.moment_arm_m[:, k]
            colour = BLUE if arm.mean() > 0 else ORANGE
            right.plot(degrees, arm, color=colour, linewidth=1.0)
            ends.append((arm[-1], name.replace("_", " "), colour))
        _write_apart(right, degrees[-1], ends)
        right.axhline(0, color=INK, linewidth=0.6)
        right.set_xlim(degrees[0], degrees[0] + 1.55 * (degrees[-1] - degrees[0]))
        right.set_xticks(right.get_xticks()[right.get_xticks() <= degrees[-1] + 1])
        right.set(xlabel="elbow flexion (deg)", ylabel="moment arm (mm)", title="Moment arms")
        return grid


def _write_apart(axes: Any, x: float, ends: list[tuple[float, str, str]]) -> None:
    """Names at the ends of lines, moved apart where they would lie on each other, as little as that takes."""
    low, high = axes.get_ylim()
    gap = 0.062 * (high - low)
    ends = sorted(ends)
    # Names that touch stand in a row about the mean of their ends: (number of names, their first place).
    rows: list[tuple[int, float]] = []
    for value, _, _ in ends:
        rows.append((1, value))
        while len(rows) > 1 and rows[-2][1] + gap * rows[-2][0] > rows[-1][1]:
            (many, first), (more, second) = rows[-2:]
            start = (many * first + more * (second - gap * many)) / (many + more)
            rows[-2:] = [(many + more, start)]
    places = [first + gap * k for many, first in rows for k in range(many)]
    for (value, name, colour), place in zip(ends, places, strict=True):
        axes.annotate(
            name,
            (x, value),
            xytext=(x + 4, place),
            color=colour,
            fontsize=7,
            va="center",
            arrowprops={"arrowstyle": "-", "color": colour, "linewidth": 0.4, "shrinkB": 0},
        )
