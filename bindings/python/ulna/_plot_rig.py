"""Figures of rigs and sensors; `ulna.plot` offers them."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any

import numpy as np

from ._figure import BLUE, GREEN, GREY, INK, ORANGE, SKY, WIDTH_IN, axes_grid, style
from .record import refuse

_MARKERS = ("o", "s", "^", "D")


def _styled(draw: Callable[..., Any]) -> Callable[..., Any]:
    """The look of a report for the whole figure, titles and legends included."""

    @wraps(draw)
    def inside(*args: Any, **keywords: Any) -> Any:
        with style():
            return draw(*args, **keywords)

    return inside


def _coil(start: np.ndarray, end: np.ndarray, *, turns: int = 9, width: float = 4.0) -> np.ndarray:
    """A spring as a zigzag line between two points, mm."""
    along = (end - start) / np.linalg.norm(end - start)
    across = np.array([-along[1], along[0]])
    share = np.concatenate([[0.0, 0.15], np.linspace(0.18, 0.82, 2 * turns), [0.85, 1.0]])
    side = np.zeros_like(share)
    side[2:-2] = width * np.where(np.arange(2 * turns) % 2 == 0, 1.0, -1.0)
    return start + np.outer(share * np.linalg.norm(end - start), along) + np.outer(side, across)


def _ellipse_line(matrix: np.ndarray, size: float) -> np.ndarray:
    """K u over all unit displacements u, drawn with the larger semi-axis `size`."""
    angle = np.linspace(0, 2 * np.pi, 181)
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    return size * circle @ matrix.T / np.linalg.eigvalsh(matrix)[-1]


@_styled
def spring_array(
    array: Any, axes: Any = None, *, wanted: Any = None, radius_m: float = 0.025
) -> np.ndarray:
    """A spring array: its springs and stiffness ellipse, and beside it the force field.

    Left: frame and springs (dashed when slack), the handle at its equilibrium, the ellipse of the
    force that answers a unit displacement, dashed that of `wanted`. Right: the force around the
    equilibrium, and by shade how far it is from the linear law; the circle is `radius_m`.
    """
    rest = array.equilibrium(radius_m=radius_m)
    grid = axes_grid(axes, 1, 2, (WIDTH_IN, 3.5), width_ratios=[1.0, 1.12])
    left, right = grid[0]
    centre, half = 1e3 * np.asarray(array.centre_m), 1e3 * np.asarray(array.half_m)
    place = 1e3 * rest.position_m
    x, y = centre - half
    left.add_patch(
        _rectangle((x, y), *(2 * half), fill=False, ec=GREY, lw=3.0, alpha=0.6, zorder=1)
    )
    for spring, loose in zip(array.springs, rest.slack, strict=True):
        anchor = 1e3 * np.asarray(spring.anchor_m)
        line = np.array([anchor, place]) if loose else _coil(anchor, place)
        left.plot(
            *line.T, color=GREY if loose else INK, lw=0.8, ls="--" if loose else "-", zorder=2
        )
        left.plot(*anchor, "o", ms=3.5, color=GREY, zorder=3)
        # Between the frame and the coil's middle, where springs are furthest apart.
        spot = anchor + 0.24 * (place - anchor)
        label = f"{spring.rate_n_m:.3g} N/m" + (", slack" if loose else "")
        left.annotate(
            label, spot, fontsize=7, ha="center", va="center", zorder=5,
            bbox={"boxstyle": "round,pad=0.15", "fc": "white", "ec": "none", "alpha": 0.85},
        )  # fmt: skip
    size = 0.42 * float(half.min())
    ellipse = place + _ellipse_line(rest.K, size)
    left.plot(*ellipse.T, color=BLUE, lw=1.6, zorder=4, label="stiffness")
    if wanted is not None:
        scale = size * np.linalg.eigvalsh(wanted)[-1] / rest.eigenvalues_n_m[-1]
        left.plot(
            *(place + _ellipse_line(np.asarray(wanted), scale)).T, color=ORANGE, lw=1.4,
            ls=(0, (3, 1.2)), zorder=4, label="wanted",
        )  # fmt: skip
        _legend_above(left)
    left.plot(*place, "o", ms=4, color=BLUE, zorder=6)
    if wanted is None:
        left.set_title("Springs and stiffness")
    _square(left, centre, 1.12 * half.max())

    span = 2.2e3 * radius_m
    steps = np.linspace(-span, span, 61)
    dx, dy = np.meshgrid(steps, steps)
    offset = 1e-3 * np.column_stack([dx.ravel(), dy.ravel()])
    force = array.force(rest.position_m + offset)
    linear = -offset @ rest.K
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.linalg.norm(force - linear, axis=1) / np.linalg.norm(linear, axis=1)
    share = np.where(np.isfinite(share), share, 0.0).reshape(dx.shape)
    shade = right.contourf(
        place[0] + dx, place[1] + dy, 100 * share, levels=12, cmap="Greys", alpha=0.55, zorder=0
    )
    right.figure.colorbar(shade, ax=right, label="off the linear law (%)", shrink=0.85, pad=0.02)
    keep = (slice(3, None, 6), slice(3, None, 6))
    arrows = force.reshape(*dx.shape, 2)[keep]
    right.quiver(
        (place[0] + dx)[keep], (place[1] + dy)[keep], arrows[..., 0], arrows[..., 1], color=BLUE,
        angles="xy", width=0.005, zorder=3,
    )  # fmt: skip
    around = np.linspace(0, 2 * np.pi, 121)
    right.plot(
        place[0] + 1e3 * radius_m * np.cos(around), place[1] + 1e3 * radius_m * np.sin(around),
        color=INK, lw=1.0, ls="--", zorder=4,
    )  # fmt: skip
    largest = float(np.linalg.norm(arrows, axis=-1).max())
    right.set_title(f"Force on the handle, up to {largest:.2g} N")
    _square(right, place, span)
    return grid


def _legend_above(ax: Any) -> None:
    """A legend over the right end of the axes, where it hides no data."""
    ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.1)


def _rectangle(*args: Any, **options: Any) -> Any:
    from matplotlib.patches import Rectangle

    return Rectangle(*args, **options)


def _square(ax: Any, centre: np.ndarray, half: float) -> None:
    ax.set_aspect("equal")
    ax.set_xlim(centre[0] - half, centre[0] + half)
    ax.set_ylim(centre[1] - half, centre[1] + half)
    ax.set_xlabel("x (mm)")
    ax.set_ylabel("y (mm)")
    ax.grid(False)


@_styled
def sensor_check(check: Any, axes: Any = None, *, seconds: float = 8.0) -> np.ndarray:
    """Accelerometer, twice integrated, over the encoder: some seconds, and one against the other.

    The dashed line is where both agree; the solid one the gain that was found.
    """
    n = len(check.accelerations)
    grid = axes_grid(axes, n, 2, (WIDTH_IN, 0.8 + 1.7 * n), width_ratios=[2.4, 1.0])
    start = check.time[len(check.time) // 2]
    keep = (check.time >= start) & (check.time < start + seconds)
    for i in range(n):
        left, right = grid[i]
        p, x = 1e3 * check.accelerometer[:, i], 1e3 * check.encoder[:, i]
        left.plot(check.time[keep], x[keep], color=GREY, lw=2.6, label=check.positions[i])
        left.plot(
            check.time[keep], p[keep], color=BLUE, lw=1.0,
            label=f"{check.accelerations[i]}, twice integrated",
        )  # fmt: skip
        left.set_ylabel("slow drift removed (mm)")
        _legend_above(left)
        left.margins(x=0)
        step = max(1, len(p) // 1500)
        right.plot(x[::step], p[::step], ".", ms=2, color=SKY, alpha=0.6)
        bound = 1.05 * max(np.abs(x).max(), 1e-9)
        right.plot([-bound, bound], [-bound, bound], color=INK, lw=0.9, ls="--")
        gain = check.gain[i, i]
        right.plot([-bound, bound], [-gain * bound, gain * bound], color=ORANGE, lw=1.3)
        right.set_title(f"Gain {gain:.3f} ± {check.gain_se[i, i]:.1g}")
        right.set_ylabel(f"{check.accelerations[i]} (mm)")
    grid[-1, 0].set_xlabel("time (s)")
    grid[-1, 1].set_xlabel("encoder (mm)")
    return grid


@_styled
def virtual_force(
    comparison: Any,
    axes: Any = None,
    *,
    method: str = "accelerometer",
    start_s: float | None = None,
    seconds: float = 6.0,
) -> np.ndarray:
    """The virtual force over the measured one, and their difference with the budget's 95 % band.

    Parameters
    ----------
    comparison : MethodComparison or SensedForce
    method : {"accelerometer", "differentiation"}
        Which force of a comparison.
    start_s, seconds : float
        What is shown; by default from the middle.
    """
    force = comparison.forces[method] if hasattr(comparison, "forces") else comparison
    record = force.record
    names = [record.channels[c].name for c in record.with_role("force")]
    n = len(names)
    measured = [name + "_measured" for name in names]
    beside = all(name in record for name in measured)
    size = (WIDTH_IN, 0.6 + 2.1 * n)
    grid = axes_grid(axes, 2 * n, 1, size, sharex=True, height_ratios=[2.0, 1.1] * n)
    time = np.asarray(record.time)
    start = time[len(time) // 2] if start_s is None else start_s
    keep = (time >= start) & (time < start + seconds)
    if not np.any(keep):
        raise refuse(f"there are no samples from {start:g} s for {seconds:g} s", "start_s")
    t = time[keep]
    band = 1.96 * force.force_se[keep]
    for i, name in enumerate(names):
        top, low = grid[2 * i, 0], grid[2 * i + 1, 0]
        virtual = force.force[keep, i]
        if beside:
            truth = record[measured[i]][keep]
            top.plot(t, truth, color=GREY, lw=2.8, label="force sensor")
        top.fill_between(t, virtual - band[:, i], virtual + band[:, i], color=SKY, alpha=0.45, lw=0)
        top.plot(t, virtual, color=BLUE, lw=1.0, label="virtual sensor")
        top.set_ylabel(f"{name} (N)")
        _legend_above(top)
        low.fill_between(
            t, -band[:, i], band[:, i], color=SKY, alpha=0.45, lw=0, label="95 % budget"
        )
        low.axhline(0, color=INK, lw=0.7)
        if beside:
            low.plot(t, virtual - truth, color=ORANGE, lw=0.9, label="virtual − sensor")
        low.set_ylabel("error (N)")
        _legend_above(low)
        for ax in (top, low):
            ax.margins(x=0)
    grid[-1, 0].set_xlabel("time (s)")
    return grid


@_styled
def sensing_methods(comparison: Any, axes: Any = None) -> np.ndarray:
    """M, B and K by every method of a comparison, with 95 % intervals that hold all known errors."""
    estimates = comparison.estimates
    first = next(iter(estimates.values()))
    grid = axes_grid(axes, 1, 3, (WIDTH_IN, 2.7))
    colours = dict(zip(estimates, (BLUE, ORANGE, GREEN), strict=False))
    shift = 0.22
    for ax, name in zip(grid[0], ("M", "B", "K"), strict=True):
        labels = [f"{a}{b}" for a in first.axes for b in first.axes]
        for k, (method, estimate) in enumerate(estimates.items()):
            budget = comparison.budgets.get(method)
            error = 1.96 * (budget.total_se(name) if budget else estimate.se(name)).ravel()
            place = np.arange(len(labels)) + shift * (k - 0.5 * (len(estimates) - 1))
            ax.errorbar(
                place, getattr(estimate, name).ravel(), error, ls="", marker=_MARKERS[k], ms=4,
                color=colours[method], capsize=2, lw=1.0, label=method,
            )  # fmt: skip
        ax.set_xticks(np.arange(len(labels)), labels)
        ax.set_xlim(-0.5, len(labels) - 0.5)
        ax.set_title(f"{name} ({first.units[name]})")
        ax.grid(axis="x", visible=False)
    handles, words = grid[0, 0].get_legend_handles_labels()
    if axes is None:
        grid[0, 0].figure.legend(handles, words, loc="outside lower center", ncols=len(words))
    else:
        grid[0, 0].legend()
    return grid
