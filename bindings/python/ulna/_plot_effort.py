"""Figures of effort and of arm supports; `ulna.plot` offers them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ._figure import BLUE, GREEN, GREY, INK, ORANGE, WIDTH_IN, axes_grid, matplotlib_module, style
from .effort import area_of
from .record import refuse

_GROUPS = (("arms", ("left arm", "right arm")), ("torso", ("torso",)),
           ("legs", ("left leg", "right leg")))  # fmt: skip


def force_curves(table: Any, axes: Any = None) -> np.ndarray:
    """Force of an arm support over elevation: every subject grey, the mean blue.

    Parameters
    ----------
    table : ForceTable
        Of :func:`ulna.assist.read_force_table`.
    axes : array of two axes, optional
        Across and along the arm.
    """
    with style():
        grid = axes_grid(axes, 1, 2, (WIDTH_IN, 2.9))
        for ax, name, label in (
            (grid[0, 0], "support_n", "across the arm, upward (N)"),
            (grid[0, 1], "shear_n", "along the arm, to the elbow (N)"),
        ):
            for at, curve in enumerate(table.curves.values()):
                ax.plot(
                    np.degrees(curve.angle_rad), getattr(curve, name), color=GREY, linewidth=0.7,
                    alpha=0.8, label=f"{len(table.curves)} subjects" if at == 0 else None,
                )  # fmt: skip
            mean = table.mean
            ax.plot(
                np.degrees(mean.angle_rad),
                getattr(mean, name),
                color=BLUE,
                linewidth=1.8,
                label="mean",
            )
            ax.set(xlabel="elevation of the arm (deg)", ylabel=label, xlim=(0, 180))
            ax.set_xticks(range(0, 181, 30))
            ax.axhline(0, color=INK, linewidth=0.6)
        at = int(np.argmax(mean.support_n))
        grid[0, 0].plot(
            np.degrees(mean.angle_rad[at]), mean.support_n[at], "o", color=BLUE, markersize=4
        )
        grid[0, 0].annotate(
            f"{mean.support_n[at]:.1f} N at {np.degrees(mean.angle_rad[at]):.0f}°",
            (np.degrees(mean.angle_rad[at]), mean.support_n[at]), xytext=(0.02, 0.93),
            textcoords="axes fraction", va="center", color=BLUE, fontsize=8,
        )  # fmt: skip
        grid[0, 0].set_title("Support")
        grid[0, 1].set_title("Force along the arm")
        grid[0, 0].legend(loc="lower right")
        return grid


def effort_change(
    without: Any, with_device: Any, axes: Any = None, *, joints: Sequence[str]
) -> np.ndarray:
    """Change of effort at every joint, area by area: green where there is less, orange where more.

    Parameters
    ----------
    without, with_device : array_like, shape (subjects, joints) or (subjects, blocks, joints)
        Effort such as the mean absolute torque, Nm. Bars are means over subjects, one a block; whiskers
        are standard errors over subjects.
    axes : array of three axes, optional
        Arms, torso, legs.
    joints : sequence of str
        Names, as in the suit's model.
    """
    matplotlib_module()
    from matplotlib.patches import Patch

    before, after = (_cells(values, len(joints)) for values in (without, with_device))
    if before.shape != after.shape:
        raise refuse(
            "both conditions must have the same subjects, blocks and joints", "with_device"
        )
    change = after - before
    mean = change.mean(axis=0)
    error = change.std(axis=0, ddof=1) / np.sqrt(len(change)) if len(change) > 1 else 0 * mean
    shown = [
        (title, [j for area in areas for j, name in enumerate(joints) if area_of(name) == area])
        for title, areas in _GROUPS
    ]
    rows = [(title, members) for title, members in shown if members]
    with style():
        grid = axes_grid(axes, len(rows), 1, (WIDTH_IN, 0.6 + 2.1 * len(rows)), sharey=True)
        width = 0.8 / mean.shape[0]
        for ax, (title, members) in zip(grid[:, 0], rows, strict=True):
            for block in range(mean.shape[0]):
                place = np.arange(len(members)) + (block - (mean.shape[0] - 1) / 2) * width
                values = mean[block, members]
                ax.bar(
                    place, values, 0.9 * width, yerr=error[block, members],
                    color=[GREEN if v < 0 else ORANGE for v in values],
                    error_kw={"linewidth": 0.6, "ecolor": INK},
                )  # fmt: skip
            ax.axhline(0, color=INK, linewidth=0.7)
            ax.set_xticks(range(len(members)), [short_name(joints[j]) for j in members], rotation=60,
                          ha="right", rotation_mode="anchor", fontsize=7)  # fmt: skip
            ax.set_ylabel("change (Nm)")
            ax.set_title(title.capitalize())
            ax.grid(visible=False, axis="x")
            ax.margins(x=0.02)
        first = grid[0, 0]
        keys = [Patch(color=GREEN, label="less effort"), Patch(color=ORANGE, label="more effort")]
        first.legend(handles=keys, loc="lower right", ncols=2, bbox_to_anchor=(1, 1))
        return grid


def subject_lines(
    without: Any,
    with_device: Any,
    axes: Any = None,
    *,
    label: str = "effort (Nm)",
    names: tuple[str, str] = ("without", "with"),
) -> np.ndarray:
    """Every subject in both conditions, the mean with its 95 % interval, and the change.

    Parameters
    ----------
    without, with_device : array_like, shape (subjects,)
        One number a subject.
    axes : array of two axes, optional
        The subjects, and the change with its interval.
    label : str
        Of the values.
    names : pair of str
        Of the conditions.
    """
    from .stats import compare_pairs

    change = compare_pairs(without, with_device)
    first, second = np.ravel(without).astype(float), np.ravel(with_device).astype(float)
    with style():
        grid = axes_grid(axes, 1, 2, (WIDTH_IN * 0.75, 3.0), width_ratios=[1.6, 1.0])
        left, right = grid[0]
        for a, b in zip(first, second, strict=True):
            left.plot([0, 1], [a, b], color=GREEN if b < a else ORANGE, linewidth=0.8, alpha=0.8,
                      marker="o", markersize=3)  # fmt: skip
        left.plot([0, 1], [first.mean(), second.mean()], color=INK, linewidth=2.2, marker="s",
                  markersize=5, label="mean")  # fmt: skip
        for colour, word, there in (
            (GREEN, "less", (second < first).any()),
            (ORANGE, "more", (second >= first).any()),
        ):
            if there:
                left.plot([], [], color=colour, label=word)
        left.set_xticks([0, 1], names)
        left.set(ylabel=label, title=f"{len(first)} subjects", xlim=(-0.3, 1.3))
        left.grid(visible=False, axis="x")
        left.legend()
        value, low, high = (float(part[0]) for part in (
            change.difference.value, change.difference.low, change.difference.high))  # fmt: skip
        differences = second - first
        spread = np.linspace(-0.12, 0.12, len(differences))[np.argsort(np.argsort(differences))]
        right.plot(spread, differences, "o", color=GREY, markersize=3)
        right.errorbar([0.35], [value], yerr=[[value - low], [high - value]], fmt="s", color=BLUE,
                       capsize=3)  # fmt: skip
        right.axhline(0, color=INK, linewidth=0.7)
        right.set_xticks([0, 0.35], ["subjects", "mean,\n95 %"])
        right.grid(visible=False, axis="x")
        relative = 100 * float(change.relative.value[0])
        right.set(title=f"Change {relative:+.0f} %", ylabel=f"change of {label}", xlim=(-0.3, 0.6))
        return grid


def _cells(values: Any, joints: int) -> np.ndarray:
    table = np.asarray(values, dtype=float)
    if table.ndim == 2:
        table = table[:, None, :]
    if table.ndim != 3 or table.shape[2] != joints or not len(table):
        raise refuse(
            f"the effort has the shape {np.shape(values)}, but (subjects, {joints}) or (subjects, blocks, "
            f"{joints}) is expected",
            "without",
        )
    return table


def short_name(joint: str) -> str:
    """``jRightC7Shoulder_rotx`` -> ``R C7Shoulder x``."""
    body, _, axis = joint.removeprefix("j").partition("_rot")
    for side in ("Right", "Left"):
        if body.startswith(side):
            body = f"{side[0]} {body[len(side) :]}"
    return f"{body} {axis}".strip()
