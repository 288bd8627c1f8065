"""Figures of designs: signals, spectrum and path; predicted peaks; predicted errors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ._figure import AMBER, BLUE, GREEN, GREY, INK, ORANGE, PINK, SKY, WIDTH_IN, axes_grid, style

if TYPE_CHECKING:
    from .design import Comparison, Design, Plan, SafetyCheck

_COLOURS = (BLUE, ORANGE, GREEN, PINK, AMBER, SKY)
_MARKERS = ("o", "s", "D", "^", "v", "P")
_POINTS = 4000  # a line; more do not show on a page


def _shown(unit: str) -> tuple[float, str]:
    """Factor and unit in which values are drawn."""
    return {"m": (1e3, "mm"), "rad": (180 / np.pi, "deg"), "Nm": (1.0, "N m")}.get(
        unit, (1.0, unit)
    )


def _thin(*arrays: np.ndarray) -> list[np.ndarray]:
    step = max(1, len(arrays[0]) // _POINTS)
    return [array[::step] for array in arrays]


def _legend_above(ax: Any, columns: int) -> None:
    """A legend over the right end of the axes, beside the title, where it hides no data."""
    ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=columns, borderaxespad=0.1)


def _line_style(axis: int) -> dict[str, Any]:
    return {"color": _COLOURS[axis % 6], "linestyle": ("-", "--", "-.")[axis % 3]}


# A design ------------------------------------------------------------------------------------------


def design(design: Design) -> Any:
    """Reference over time, one below the other, then its spectrum and its path; returns the figure."""
    import matplotlib.pyplot as plt

    n = design.n
    with style():
        figure = plt.figure(figsize=(WIDTH_IN, 2.9 + 1.05 * n), layout="constrained")
        top, bottom = figure.subfigures(2, 1, height_ratios=[0.45 + 1.05 * n, 2.6])
        design_signals(design, top.subplots(n, 1, sharex=True, squeeze=False))
        left, right = bottom.subplots(1, 2)
        design_spectrum(design, left)
        design_path(design, right)
    return figure


def design_signals(design: Design, axes: Any = None) -> np.ndarray:
    """The reference of every axis over time, with the perturbations shaded; an axes each.

    Parameters
    ----------
    design : Design
    axes : array of matplotlib.axes.Axes, optional
    """
    factor, unit = _shown(design.unit)
    with style():
        grid = axes_grid(axes, design.n, 1, (WIDTH_IN, 0.6 + 1.1 * design.n), sharex=True)
        time, values = _thin(design.time_s, factor * design.reference)
        for axis, ax in enumerate(grid[:, 0]):
            if len(design.segments) > 1 or len(design.reference) > design.segments[0].end:
                for segment in design.segments:
                    bounds = np.array([segment.begin, segment.end]) / design.rate_hz
                    ax.axvspan(*bounds, color="#EDEDED", linewidth=0, zorder=0)
            ax.plot(time, values[:, axis], color=_COLOURS[axis % 6], linewidth=0.8)
            ax.set_ylabel(f"{_symbol(design, axis)} ({unit})")
            ax.margins(x=0)
        grid[0, 0].set_title(_title(design))
        grid[-1, 0].set_xlabel("time (s)")
    return grid[:, 0]


def _symbol(design: Design, axis: int) -> str:
    name = design.axes[axis]
    if design.kind == "force":
        return f"F {name}"
    return f"{name} ref"


def _title(design: Design) -> str:
    what = "Position reference" if design.kind == "position" else "Force on the hand"
    count = len(design.segments)
    return f"{what}: {design.duration_s:.4g} s" + (
        f", {count} perturbations (grey)" if count > 1 else ""
    )


def design_spectrum(design: Design, ax: Any = None) -> Any:
    """Amplitude of every line of a multisine; of other designs the amplitude density.

    Parameters
    ----------
    design : Design
    ax : matplotlib.axes.Axes, optional
    """
    factor, unit = _shown(design.unit)
    with style():
        ax = axes_grid(ax, 1, 1, (WIDTH_IN / 2, 2.6))[0, 0]
        if design.lines:
            for axis, name in enumerate(design.axes):
                own = [line for line in design.lines if line.axis == axis]
                colour = _COLOURS[axis % 6]
                freq = [line.freq_hz for line in own]
                size = [factor * abs(line.amplitude) for line in own]
                ax.vlines(freq, 0, size, color=colour, linewidth=1.2)
                ax.plot(
                    freq, size, _MARKERS[axis % 6], color=colour, markersize=4,
                    markerfacecolor="white" if axis % 2 else colour, label=name,
                )  # fmt: skip
            ax.set_ylim(bottom=0)
            ax.set_xlim(left=0)
            ax.margins(y=0.12)
            ax.set_ylabel(f"amplitude ({unit})")
            ax.set_title("Lines")
        else:
            freq, density = _density(design)
            for axis, name in enumerate(design.axes):
                ax.plot(freq, factor * density[:, axis], label=name, **_line_style(axis))
            ax.set_xlim(0, freq[-1])
            ax.set_yscale("log")
            top = factor * density[1:].max()
            ax.set_ylim(top / 1e3, 2 * top)
            ax.set_ylabel(f"density ({unit} / √Hz)")
            ax.set_title("Spectrum")
        ax.set_xlabel("frequency (Hz)")
        if design.n > 1:
            _legend_above(ax, min(design.n, 4))
    return ax


def _density(design: Design) -> tuple[np.ndarray, np.ndarray]:
    """Root of the power density up to where 99.9 % of the velocity's power lies, in 0.1 Hz bands."""
    rate, rows = design.rate_hz, len(design.reference)
    power = np.abs(np.fft.rfft(design.reference, axis=0)) ** 2 * 2 / (rate * rows)
    freq = np.fft.rfftfreq(rows, 1 / rate)
    moving = np.cumsum((power.sum(axis=1)) * freq**2)
    last = freq[np.searchsorted(moving, 0.999 * moving[-1])]
    width = max(1, round(0.1 * rows / rate))
    count = max(8, min(len(freq), int(last * rows / rate)) // width)
    bands = power[: count * width].reshape(count, width, -1).mean(axis=1)
    return (np.arange(count) + 0.5) * width * rate / rows, np.sqrt(bands)


def design_path(design: Design, ax: Any = None) -> Any:
    """The path in the plane of the first two axes; for one axis, value against its rate.

    Parameters
    ----------
    design : Design
    ax : matplotlib.axes.Axes, optional
    """
    factor, unit = _shown(design.unit)
    with style():
        ax = axes_grid(ax, 1, 1, (WIDTH_IN / 2, 2.6))[0, 0]
        if design.n == 1:
            value, rate = _thin(
                factor * design.reference[:, 0], factor * design.reference_rate[:, 0]
            )
            ax.plot(value, rate, color=BLUE, linewidth=0.6)
            ax.set_xlabel(f"{_symbol(design, 0)} ({unit})")
            ax.set_ylabel(f"rate ({unit}/s)")
            ax.set_title("Phase plane")
            return ax
        path = _thin(factor * design.reference)[0]
        ax.plot(path[:, 0], path[:, 1], color=BLUE, linewidth=0.6)
        ax.plot(*path[0, :2], "o", color=INK, markersize=4, label="start")
        ax.set_xlabel(f"{_symbol(design, 0)} ({unit})")
        ax.set_ylabel(f"{_symbol(design, 1)} ({unit})")
        ax.set_aspect("equal", adjustable="datalim")
        ax.set_title("Path")
    return ax


# Safety --------------------------------------------------------------------------------------------


def safety(safety: SafetyCheck, axes: Any = None) -> np.ndarray:
    """Predicted force, displacement and velocity over time with tremor bands and limits.

    Parameters
    ----------
    safety : SafetyCheck
    axes : array of three matplotlib.axes.Axes, optional
    """
    design = safety.design
    names = (("force", "force"), ("displacement", "position"), ("velocity", "velocity"))
    with style():
        grid = axes_grid(axes, 3, 1, (WIDTH_IN, 5.0), sharex=True)
        for ax, (quantity, response) in zip(grid[:, 0], names, strict=True):
            factor, unit = _shown_quantity(safety.units[quantity])
            values = design.respond(safety._arm, robot=safety._robot, response=response)
            size = np.linalg.norm(values, axis=1)
            time, values, size = _thin(design.time_s, factor * values, factor * size)
            for axis, name in enumerate(design.axes):
                spread = factor * safety.tremor[quantity][axis]
                colour = _COLOURS[axis % 6]
                ax.fill_between(
                    time, values[:, axis] - spread, values[:, axis] + spread,
                    color=colour, alpha=0.2, linewidth=0,
                )  # fmt: skip
                ax.plot(time, values[:, axis], color=colour, linewidth=0.8, label=name)
            if design.n > 1:
                ax.plot(time, size, color=GREY, linewidth=0.6, label="length", zorder=1)
            limit = safety.limits[quantity]
            if np.isfinite(limit):
                for bound in (-factor * limit, factor * limit):
                    ax.axhline(bound, color=INK, linestyle=":", linewidth=1.2)
                where = (safety.scales[quantity] < 1) * "exceeded: "
                ax.set_title(f"{where}limit {factor * limit:.4g} {unit}")
            ax.set_ylabel(f"{quantity} ({unit})")
            ax.margins(x=0)
        _legend_above(grid[0, 0], design.n + 1)
        grid[-1, 0].set_xlabel("time (s)")
    return grid[:, 0]


def _shown_quantity(unit: str) -> tuple[float, str]:
    return {
        "m": (1e3, "mm"),
        "m/s": (1e3, "mm/s"),
        "rad": (180 / np.pi, "deg"),
        "rad/s": (180 / np.pi, "deg/s"),
    }.get(unit, (1.0, unit))


# Plans ---------------------------------------------------------------------------------------------


def plans(plans: Sequence[Plan], labels: Sequence[str], ax: Any = None) -> Any:
    """Predicted relative error of every parameter, and the bias of least squares as crosses.

    Parameters
    ----------
    plans : sequence of Plan
    labels : sequence of str
    ax : matplotlib.axes.Axes, optional
    """
    names = plans[0].names[: 3 * plans[0].n ** 2]
    table = np.array([[one.relative[name] for name in names] for one in plans])
    with style():
        ax = axes_grid(ax, 1, 1, (WIDTH_IN, 3.2))[0, 0]
        _draw_errors(ax, names, table, labels)
        for i, one in enumerate(plans):
            bias = np.abs(one.least_squares_bias[: len(names)]) / one.scales
            ax.plot(
                np.arange(len(names)) + _offset(i, len(plans)), 100 * bias, "x",
                color=_COLOURS[i % 6], markersize=5, zorder=4,
                label="bias of least squares" if i == 0 else None,
            )  # fmt: skip
        _finish_errors(ax, f"Predicted errors in {plans[0].minutes:.3g} minutes")
    return ax


def comparison(comparison: Comparison, ax: Any = None) -> Any:
    """Predicted relative error of every parameter for each plan, at the same length.

    Parameters
    ----------
    comparison : Comparison
    ax : matplotlib.axes.Axes, optional
    """
    with style():
        ax = axes_grid(ax, 1, 1, (WIDTH_IN, 3.2))[0, 0]
        _draw_errors(ax, comparison.parameters, comparison.relative, comparison.labels)
        _finish_errors(ax, f"Predicted errors in {comparison.minutes:.3g} minutes")
    return ax


def _offset(i: int, count: int) -> float:
    return 0.0 if count == 1 else 0.5 * (i / (count - 1) - 0.5)


def _draw_errors(ax: Any, names: Sequence[str], table: np.ndarray, labels: Sequence[str]) -> None:
    places = np.arange(len(names))
    for i, (row, label) in enumerate(zip(100 * table, labels, strict=True)):
        colour = _COLOURS[i % 6]
        at = places + _offset(i, len(table))
        ax.vlines(at, 1e-9, row, color=colour, linewidth=1.0, alpha=0.5)
        ax.plot(
            at, row, _MARKERS[i % 6], color=colour, markersize=6,
            markerfacecolor="white" if i % 2 else colour, label=label, zorder=3,
        )  # fmt: skip
    ax.set_yscale("log")
    low, high = 100 * table[table > 0].min(), 100 * table.max()
    ax.set_ylim(low / 3, 3 * high)
    ax.set_xticks(places, [_subscript(name) for name in names])
    ax.grid(axis="x", visible=False)


def _subscript(name: str) -> str:
    symbol, index = name.split("_", 1)
    return f"${symbol}_{{{index}}}$"


def _finish_errors(ax: Any, title: str) -> None:
    from matplotlib.ticker import FuncFormatter

    low, high = ax.get_ylim()
    shown = [line.get_ydata() for line in ax.lines]
    largest = max(np.max(values) for values in shown)
    ax.set_ylim(low, max(high, 2 * largest))
    ax.axhline(5, color=GREY, linestyle=":", linewidth=1.0, zorder=1)
    ax.annotate(
        "5 %", (1, 5), xycoords=("axes fraction", "data"), xytext=(2, 0),
        textcoords="offset points", va="center", fontsize=8, color=GREY,
    )  # fmt: skip
    ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.set_ylabel("standard error (%)")
    ax.set_title(title)
    ax.legend(loc="upper left", bbox_to_anchor=(0, -0.1), ncols=4)
