"""Figures of an estimate: axes in, axes out.

Every function draws into the axes it is given, or makes a figure of its own, and returns the axes.
Colours are those of M. Okabe and K. Ito, which remain distinct for colour-blind readers; line
styles and markers differ as well, so that the figures survive a black-and-white printer.

Needs matplotlib: ``pip install ulna[plot]``.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ._figure import BLUE, GREEN, GREY, INK, ORANGE, SKY, WIDTH_IN, axes_grid, style
from ._plot_effort import effort_change, force_curves, subject_lines
from ._plot_exo import (
    assessment,
    assessment_scheme,
    compression,
    elbow_torque,
    plant_difference,
)
from ._plot_models import orders, response, transfer_function
from ._plot_overhead import effort_by_block, effort_over_time, interval_coverage
from ._plot_passivity import allowed, port_indices, two_port
from ._plot_reflex import delay_profile, joint, reflex, windows
from ._plot_rig import sensing_methods, sensor_check, spring_array, virtual_force
from ._plot_sim import absorbed_energy, loop
from ._plot_study import (
    convergence,
    failure_map,
    fidelity,
    fixing,
    output_density,
    output_pairs,
    output_scatter,
    patient,
    screening,
    sobol_indices,
)
from ._plot_torques import body_effort, body_page, body_torques
from ._response import dynamic_stiffness, is_break, measured_response, raw_signals
from .record import refuse

__all__ = [
    "Picture",
    "absorbed_energy",
    "allowed",
    "body_effort",
    "body_page",
    "body_torques",
    "assessment",
    "assessment_scheme",
    "compression",
    "convergence",
    "delay_profile",
    "effort_by_block",
    "effort_change",
    "effort_over_time",
    "elbow_torque",
    "ellipses",
    "energy",
    "entry_names",
    "failure_map",
    "fidelity",
    "fixing",
    "force_curves",
    "frequency_response",
    "human_share",
    "interval_coverage",
    "joint",
    "loop",
    "measured_response",
    "method_name",
    "orders",
    "output_density",
    "output_pairs",
    "output_scatter",
    "overview",
    "parameters",
    "patient",
    "pictures",
    "plant_difference",
    "port_indices",
    "prediction",
    "record",
    "reflex",
    "response",
    "screening",
    "sensing_methods",
    "sensor_check",
    "signals",
    "sobol_indices",
    "spring_array",
    "style",
    "subject_lines",
    "transfer_function",
    "two_port",
    "unit_of",
    "virtual_force",
    "windows",
]

_POINTS = 2000  # a line; more do not show on a page


# Words and samples -------------------------------------------------------------------------------


def _shown_position(estimate: Any) -> tuple[float, str]:
    """Factor and unit in which positions are drawn."""
    return (1.0, "rad") if estimate.rotational else (1e3, "mm")


def _force_unit(estimate: Any) -> str:
    return "N m" if estimate.rotational else "N"


def _force_name(estimate: Any) -> str:
    return "torque" if estimate.rotational else "force"


def _thin(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """At most `_POINTS` samples, with a break wherever the time jumps."""
    step = max(1, len(time) // _POINTS)
    time, values = np.asarray(time)[::step], np.asarray(values)[::step]
    if len(time) < 3:
        return time, values
    steps = np.diff(time)
    jumps = np.flatnonzero(is_break(steps)) + 1
    return np.insert(time, jumps, np.nan), np.insert(values, jumps, np.nan, axis=0)


def _label_axes(estimate: Any) -> list[str]:
    return [str(name) for name in estimate.axes]


def _force_label(estimate: Any, axis: int) -> str:
    """Label of a force axis with its unit, as ``F_x (N)``."""
    name = f"F {_label_axes(estimate)[axis]}" if estimate.n > 1 else _force_name(estimate)
    return f"{name} ({_force_unit(estimate)})"


# Records -----------------------------------------------------------------------------------------


def record(record: Any, axes: Any = None) -> np.ndarray:
    """Every channel of a record over time, one below the other; an axes each.

    Positions come first, each with its reference dashed over it, then forces, then what is left.
    Every other trial is shaded grey, and segments blue where an analysis does not use whole trials.
    `axes` holds as many axes as there are channels, less the references drawn with their position.
    """
    rows = _channel_rows(record)
    grid = axes_grid(axes, len(rows), 1, (WIDTH_IN, 0.7 + 1.15 * len(rows)), sharex=True)
    time, label = _drawn_clock(record)
    for ax, columns in zip(grid[:, 0], rows, strict=True):
        factor, unit = _drawn_unit(record.channels[columns[0]])
        looks = ((BLUE, "-"), (ORANGE, (0, (4, 1.2))))
        for column, (colour, line) in zip(columns, looks, strict=False):
            x, y = _whole_line(record, time, factor * record.values[:, column])
            name = record.channels[column].name
            ax.plot(x, y, color=colour, ls=line, lw=0.9, label=name)
        _shade(ax, record, time)
        names = record.channels[columns[0]].name
        ax.set_ylabel(f"{names} ({unit})" if unit else names)
        ax.margins(x=0)
        if len(columns) > 1:
            ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.1)
    grid[-1, 0].set_xlabel(label)
    return grid


def _channel_rows(record: Any) -> list[list[int]]:
    """Columns to draw in one axes each, from the top."""
    channels = record.channels
    positions = [[column] for column in record.with_role("position")]
    alone = []
    for column in record.with_role("reference"):
        mine = channels[column]
        for row in positions:
            place = channels[row[0]]
            if len(row) == 1 and (place.axis, place.unit) == (mine.axis, mine.unit):
                row.append(column)
                break
        else:
            alone.append([column])
    rest = [[column] for role in ("force", "other") for column in record.with_role(role)]
    return positions + alone + rest


def _drawn_unit(channel: Any) -> tuple[float, str]:
    if channel.unit == "m" and channel.role in ("position", "reference"):
        return 1e3, "mm"
    return 1.0, {"Nm": "N m", "1": ""}.get(channel.unit, channel.unit)


def _drawn_clock(record: Any) -> tuple[np.ndarray, str]:
    """The record's time, or its trials one after another where the clock restarts."""
    time = np.asarray(record.time)
    if np.all(np.diff(time) > 0):
        return time, "time (s)"
    return np.arange(len(time)) / record.rate_hz, "time, trials one after another (s)"


def _whole_line(
    record: Any, time: np.ndarray, values: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """A line broken between trials; long ones by their extremes, so that no spike is lost."""
    parts = []
    for trial in record.trials:
        t, v = time[trial.begin : trial.end], values[trial.begin : trial.end]
        step = max(1, 2 * len(values) // _POINTS)
        if step > 2:
            begins = np.arange(0, len(v), step)
            low, high = np.fmin.reduceat(v, begins), np.fmax.reduceat(v, begins)
            t, v = np.repeat(t[begins], 2), np.column_stack([low, high]).ravel()
        parts += [np.vstack([t, v]), np.full((2, 1), np.nan)]
    x, y = np.hstack(parts)
    return x, y


def _shade(ax: Any, record: Any, time: np.ndarray) -> None:
    for trial in record.trials[1::2]:
        ax.axvspan(time[trial.begin], time[trial.end - 1], color=GREY, alpha=0.15, lw=0)
    whole = {(trial.begin, trial.end) for trial in record.trials}
    if whole == {(segment.begin, segment.end) for segment in record.segments}:
        return
    for segment in record.segments:
        ax.axvspan(time[segment.begin], time[segment.end - 1], color=SKY, alpha=0.25, lw=0)


# Signals -----------------------------------------------------------------------------------------


def signals(estimate: Any, axes: Any = None, *, span_s: float = 5.0) -> np.ndarray:
    """Raw and filtered position and force of every axis, `span_s` seconds from the middle.

    `axes` holds (axes of the estimate) x 2.
    """
    shown = estimate.signals("all")
    names = _label_axes(estimate)
    factor, unit = _shown_position(estimate)
    grid = axes_grid(axes, estimate.n, 2, (WIDTH_IN, 1.1 + 1.35 * estimate.n), sharex=True)
    time = np.asarray(shown.time)
    begin = time[len(time) // 2]
    rows = (time >= begin) & (time <= begin + span_s)
    raw = raw_signals(estimate)
    columns = (
        ("position", factor, unit, "position"),
        ("force", 1.0, _force_unit(estimate), _force_name(estimate)),
    )
    for column, (field, scale, label, title) in enumerate(columns):
        for i, name in enumerate(names):
            ax = grid[i, column]
            if raw is not None:
                near = (raw.time >= begin) & (raw.time <= begin + span_s)
                values = getattr(raw, field)[near, i]
                ax.plot(*_thin(raw.time[near], scale * values), color=GREY, lw=0.7, label="raw")
            values = scale * np.asarray(getattr(shown, field))[rows, i]
            ax.plot(*_thin(time[rows], values), color=BLUE, label="filtered")
            if field == "position":
                ax.set_ylabel(f"{name if estimate.n > 1 else field} ({label})")
            else:
                ax.set_ylabel(_force_label(estimate, i))
            ax.margins(x=0)
        grid[0, column].set_title(title.capitalize())
        grid[-1, column].set_xlabel("time (s)")
    grid[0, 1].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.1)
    return grid


def prediction(estimate: Any, axes: Any = None, *, span_s: float = 10.0) -> np.ndarray:
    """Measured against predicted force on data that the fit has not seen, an axes per direction."""
    held = _held_out(estimate)
    grid = axes_grid(axes, estimate.n, 1, (WIDTH_IN, 0.9 + 1.35 * estimate.n), sharex=True)
    time = np.asarray(held.time)
    rows = slice(None) if not len(time) else time <= time[0] + span_s
    vaf = np.atleast_1d(estimate.vaf)
    for i, name in enumerate(_label_axes(estimate)):
        ax = grid[i, 0]
        measured = np.asarray(held.force)[rows, i]
        predicted = np.asarray(held.force_predicted)[rows, i]
        ax.plot(*_thin(time[rows], measured), color=INK, lw=1.2, label="measured")
        ax.plot(*_thin(time[rows], predicted), color=ORANGE, ls=(0, (4, 1.2)), label="predicted")
        ax.set_ylabel(_force_label(estimate, i))
        axis = f"{name}: " if estimate.n > 1 else ""
        ax.set_title(f"{axis}{vaf[i]:.0f} % of the variance explained")
        ax.margins(x=0)
    grid[0, 0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.1)
    grid[-1, 0].set_xlabel("time (s)")
    return grid


def _held_out(estimate: Any) -> Any:
    """Held-out signals of the first trial that has any; all of them when nothing was held out."""
    for trial in range(max(1, len(estimate.record.trials))):
        try:
            shown = estimate.signals("held-out", trial=trial)
        except ValueError:  # the trials of the record may be more than those prepared
            break
        if len(shown.time):
            return shown
    return estimate.signals("all")


# Ellipses ----------------------------------------------------------------------------------------

_ROUND = (1.0, 2.0, 5.0)


def _nice(value: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that does not exceed a positive value."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(r for r in _ROUND if r * power <= value * (1 + 1e-12)) * power)


def _elbow(hand: np.ndarray, upper_m: float, fore_m: float) -> np.ndarray | None:
    """Elbow of a right arm in the plane, shoulder at the origin; None when the hand is too far."""
    distance = float(np.hypot(*hand))
    if not abs(upper_m - fore_m) < distance < upper_m + fore_m:
        return None
    along = (upper_m**2 - fore_m**2 + distance**2) / (2 * distance)
    aside = np.sqrt(max(upper_m**2 - along**2, 0.0))
    unit = hand / distance
    return along * unit + aside * np.array([unit[1], -unit[0]])


def _outline(matrix: np.ndarray, scale: float) -> np.ndarray:
    """Tips of the restoring forces for unit displacements all around: (2, points)."""
    turn = np.linspace(0.0, 2 * np.pi, 121)
    symmetric = (matrix + matrix.T) / 2
    return scale * (symmetric @ np.vstack([np.cos(turn), np.sin(turn)]))


def ellipses(
    estimate: Any,
    axes: Any = None,
    *,
    shoulder_m: tuple[float, float] | None = None,
    upper_arm_m: float = 0.31,
    forearm_m: float = 0.34,
    count: int = 40,
    seed: int = 0,
) -> np.ndarray:
    """Ellipses of inertia, damping and stiffness at the hand, an axes each.

    The thin lines are draws from the covariance of the estimate; the dashed circle is an isotropic
    hand of the value beside it. With `shoulder_m`, the place of the shoulder in the frame of the
    record, a right arm of the given segments is drawn to scale. It is known to be the origin when
    the positions are in a frame named "shoulder".
    """
    if shoulder_m is None:
        shoulder_m = _shoulder(estimate.record)
    if estimate.n != 2:
        raise refuse(
            f"ellipses are drawn in the plane; this estimate has {estimate.n} axes", "estimate"
        )
    grid = axes_grid(axes, 1, 3, (WIDTH_IN, 3.0 if shoulder_m is None else 3.5))
    position = np.asarray(estimate.signals("all").position)
    centre = np.nanmean(position, axis=0)
    origin = centre if shoulder_m is None else np.asarray(shoulder_m, dtype=float)
    hand = centre - origin  # drawn with the shoulder, or else the hand, at zero
    drawn = estimate.draws(count=count, seed=seed) if count else None
    shapes = estimate.ellipses()
    colours = {"M": BLUE, "B": GREEN, "K": ORANGE}
    titles = {"M": "Inertia", "B": "Damping", "K": "Stiffness"}
    for ax, name in zip(grid[0], "MBK", strict=True):
        _one_ellipse(
            ax, np.asarray(getattr(estimate, name)), drawn and drawn[name], hand, colours[name],
            unit_of(estimate, name), shoulder_m is None,
        )  # fmt: skip
        if shoulder_m is not None:
            _arm(ax, hand, upper_arm_m, forearm_m)
        ax.set_title(titles[name], pad=17)
        ax.annotate(
            _ellipse_words(shapes[name]), (0, 1), (0, 4), xycoords="axes fraction",
            textcoords="offset points", va="bottom", fontsize=8,
        )  # fmt: skip
        ax.set_aspect("equal", adjustable="box")
        _frame(ax, hand, shoulder_m is not None)
        ax.set_xlabel(str(estimate.axes[0]) + (" (m)" if shoulder_m is not None else " →"))
    grid[0, 0].set_ylabel(str(estimate.axes[1]) + (" (m)" if shoulder_m is not None else " →"))
    return grid


def _shoulder(record: Any) -> tuple[float, float] | None:
    frames = {channel.frame for channel in record.channels if channel.role == "position"}
    return (0.0, 0.0) if frames == {"shoulder"} else None


def _frame(ax: Any, hand: np.ndarray, with_arm: bool) -> None:
    if with_arm:
        ax.set_xlim(hand[0] - 0.32, hand[0] + 0.32)
        ax.set_ylim(min(0.0, hand[1]) - 0.07, max(0.0, hand[1]) + 0.20)
        ax.set_xticks(np.round([hand[0] - 0.2, hand[0], hand[0] + 0.2], 1))
    else:
        ax.set_xlim(hand[0] - 0.20, hand[0] + 0.20)
        ax.set_ylim(hand[1] - 0.22, hand[1] + 0.18)
        ax.set_xticks([])
        ax.set_yticks([])


def _one_ellipse(
    ax: Any, matrix: np.ndarray, draws: Any, hand: np.ndarray, colour: str, unit: str, tight: bool
) -> None:
    eigenvalues = np.linalg.eigvalsh((matrix + matrix.T) / 2)
    largest = float(np.abs(eigenvalues).max())
    if not np.isfinite(largest) or largest == 0.0:
        ax.text(*hand, "not finite", ha="center")
        return
    scale = 0.14 / largest
    x, y = hand[:, None] + _outline(matrix, scale)
    if draws is not None:
        break_ = np.full((2, 1), np.nan)  # one line with gaps draws faster than many lines
        many = np.hstack([np.hstack([_outline(one, scale), break_]) for one in draws])
        ax.plot(*(hand[:, None] + many), color=colour, lw=0.4, alpha=0.3)
    solid = eigenvalues[0] > 0
    ax.plot(x, y, color=colour, lw=2.0, ls="-" if solid else (0, (3, 1.5)))
    if not solid:
        ax.text(
            hand[0], hand[1] + 0.165, "negative along one direction", ha="center", fontsize=7.5
        )
    size = _nice(largest / 2)
    turn = np.linspace(0, 2 * np.pi, 91)
    radius = scale * size
    middle = hand + np.array([-0.11, -0.145] if tight else [-0.20, -0.34])
    ax.plot(
        middle[0] + radius * np.cos(turn), middle[1] + radius * np.sin(turn), color=INK, lw=0.9,
        ls=(0, (2, 1.5)),
    )  # fmt: skip
    place, align = middle - [0, 0.125], "center"
    if tight:
        place, align = middle + [radius + 0.012, 0], "left"
    ax.text(*place, f"{size:g} {unit}", va="center", ha=align, fontsize=8)
    ax.plot(*hand, "o", color=INK, ms=3.5, zorder=5)


def _arm(ax: Any, hand: np.ndarray, upper_m: float, fore_m: float) -> None:
    elbow = _elbow(hand, upper_m, fore_m)
    joints = np.array([[0.0, 0.0], hand] if elbow is None else [[0.0, 0.0], elbow, hand])
    ax.plot(*joints.T, color="#CFCFCF", lw=7, solid_capstyle="round", zorder=0)
    ax.plot(*joints[:-1].T, "o", color="white", mec=GREY, ms=5, zorder=1)


def _ellipse_words(shape: Any) -> str:
    words = f"shape {shape.shape:.1f}" if np.isfinite(shape.shape) else "no ellipse"
    if getattr(shape, "angle_defined", True) and np.isfinite(shape.angle_deg):
        words += f", {shape.angle_deg:.0f}°"
        interval = _interval_of(shape, "angle")
        if interval is not None and np.all(np.isfinite(interval)):
            words += f" [{interval[0]:.0f}, {interval[1]:.0f}]"
    else:
        words += ", no direction"
    return words


def _interval_of(shape: Any, name: str) -> Any:
    for field in (f"{name}_interval", f"{name}_deg_interval", f"{name}_interval_deg"):
        value = getattr(shape, field, None)
        if value is not None:
            return np.asarray(value, dtype=float)
    return None


# Passivity ---------------------------------------------------------------------------------------


def energy(source: Any, ax: Any = None) -> Any:
    """Energy the limb has absorbed over time, of an estimate or a verdict; a line a trial.

    A rising line is a limb that takes energy from the robot. The dashed line is the bound that the
    energy just keeps: the excess (or shortage) of passivity times the integral of velocity squared,
    from what may have been stored at the start.
    """
    verdict = source.passivity() if hasattr(source, "passivity") else source
    ax = axes_grid(None if ax is None else [ax], 1, 1, (WIDTH_IN, 2.3))[0, 0]
    index = float(verdict.eop_energy)
    word = "excess" if index >= 0 else "shortage"
    unit = verdict.unit.replace("^2", "²")
    labels = ["absorbed by the limb", f"{word} of passivity, {abs(index):.2f} {unit}"]
    for time, absorbed, motion in verdict.series:
        ax.plot(*_thin(time, absorbed), color=BLUE, lw=1.5, label=labels[0])
        if np.isfinite(index):
            bound = verdict.beta_j + index * motion
            ax.plot(*_thin(time, bound), color=ORANGE, ls=(0, (4, 1.5)), label=labels[1])
        labels = ["_", "_"]  # named once
    ax.axhline(0.0, color=INK, lw=0.7)
    ax.set_xlabel("time (s)")
    ax.set_ylabel("energy (J)")
    ax.margins(x=0)
    ax.legend(loc="upper left")
    return ax


# Parameters --------------------------------------------------------------------------------------

_TITLES = {"M": "Inertia", "B": "Damping", "K": "Stiffness", "x0": "Equilibrium"}
_METHODS = {
    "instrumental_variables": "instrumental variables",
    "least_squares": "least squares",
}


def unit_of(estimate: Any, name: str) -> str:
    """Unit of ``M``, ``B``, ``K`` or ``x0`` as it is printed, as ``kg m²``."""
    return str(estimate.units[name]).replace("^2", "²")


def method_name(estimator: str) -> str:
    """Name of an estimator as a person writes it."""
    return _METHODS.get(estimator, estimator.replace("_", " "))


def entry_names(estimate: Any, name: str) -> list[str]:
    """Names of the entries of ``M``, ``B``, ``K`` or ``x0`` in order, as ``k_xy``."""
    axes = _label_axes(estimate)
    if name == "x0":
        return [f"{axis}₀" for axis in axes] if estimate.n > 1 else ["x₀"]
    letter = name.lower()
    return [letter] if estimate.n == 1 else [f"{letter}_{a}{b}" for a in axes for b in axes]


def _subscript(name: str) -> str:
    letter, _, index = name.partition("_")
    return rf"${letter}_{{{index}}}$" if index else f"${letter}$" if letter.isascii() else name


def _check_truth(estimate: Any, truth: dict[str, Any]) -> None:
    for name, known in truth.items():
        if name not in _TITLES:
            raise refuse(
                f"truth names {name!r}; the parameters are {', '.join(_TITLES)}", "truth"
            )
        wanted = np.shape(getattr(estimate, name))
        if np.shape(known) != wanted:
            raise refuse(
                f"truth has {name} in the shape {np.shape(known)}, but {wanted} is expected", "truth"
            )


def parameters(estimate: Any, axes: Any = None, *, truth: dict[str, Any] | None = None) -> Any:
    """Every parameter with its 95 % interval, least squares beside the estimate; four axes.

    `truth` maps ``"M"``, ``"B"``, ``"K"``, ``"x0"`` to known values, drawn as crosses.
    """
    _check_truth(estimate, truth or {})
    entries = estimate.n**2
    grid = axes_grid(axes, 2, 2, (WIDTH_IN, 1.6 + 0.42 * min(entries, 12)))
    methods = [(estimate, BLUE, "o", 0.0)]
    if estimate.least_squares is not None:
        methods = [(estimate, BLUE, "o", 0.14), (estimate.least_squares, ORANGE, "s", -0.14)]
    mean = np.nanmean(np.asarray(estimate.signals("all").position), axis=0)
    for ax, name in zip(grid.flat, ("M", "B", "K", "x0"), strict=True):
        factor, unit = (
            _shown_position(estimate) if name == "x0" else (1.0, unit_of(estimate, name))
        )
        labels = entry_names(estimate, name)
        # Equilibria are often far from zero and near each other: drawn from the mean position.
        zero = factor * mean if name == "x0" else 0.0
        place = -np.arange(len(labels), dtype=float)
        for one, colour, marker, shift in methods:
            low, high = (factor * np.ravel(side) - zero for side in one.interval(name))
            value = factor * np.ravel(getattr(one, name)) - zero
            ax.hlines(place + shift, low, high, color=colour, lw=2.2, alpha=0.55)
            ax.plot(value, place + shift, marker, color=colour, ms=4.5, lw=0,
                    label=method_name(one.estimator))  # fmt: skip
        if truth is not None and name in truth:
            ax.plot(factor * np.ravel(truth[name]) - zero, place, "x", color=INK, ms=7, mew=1.4,
                    label="truth")  # fmt: skip
        ax.axvline(0.0, color=INK, lw=0.7)
        ax.set_yticks(place, [_subscript(label) for label in labels], fontsize=10)
        if name == "x0":
            _keep_in_view(ax, estimate, factor, zero)
        ax.set_ylim(place[-1] - 0.6, 0.6)
        ax.locator_params(axis="x", nbins=6)
        ax.grid(axis="y", visible=False)
        ax.set_title(_TITLES[name])
        ax.set_xlabel(f"{unit} from the mean position" if name == "x0" else unit)
    handles, labels = grid[0, 0].get_legend_handles_labels()
    if len(labels) > 1 and axes is None:
        grid[0, 0].figure.legend(handles, labels, loc="outside upper right", ncols=len(labels))
    elif len(labels) > 1:
        grid[0, 0].legend(loc="best")
    return grid


def _keep_in_view(ax: Any, estimate: Any, factor: float, zero: Any) -> None:
    """Limits by the estimate's own intervals: a useless interval beside it may leave the axes."""
    low, high = (factor * side - zero for side in estimate.interval("x0"))
    sides = [*low, *high, 0.0]
    if estimate.least_squares is not None:
        sides += list(factor * estimate.least_squares.x0 - zero)
    sides = [side for side in sides if np.isfinite(side)]
    pad = 0.08 * (max(sides) - min(sides)) or 1.0
    ax.set_xlim(min(sides) - pad, max(sides) + pad)


# Frequency domain --------------------------------------------------------------------------------


def frequency_response(
    estimate: Any, axes: Any = None, *, count: int = 200, seed: int = 0, points: bool = True
) -> np.ndarray:
    """Dynamic stiffness of the model over frequency with its 95 % band; n x n axes.

    Row: axis of the force; column: axis of the motion. The real part holds stiffness and inertia,
    the imaginary part damping. Dots come from the reference without a model, where there is one.
    """
    n = estimate.n
    size = (WIDTH_IN, 2.6 if n == 1 else 0.8 + 1.75 * n)
    grid = axes_grid(axes, n, n, size, sharex=True)
    measured = measured_response(estimate) if points else None
    band = getattr(estimate.preprocessing, "band_hz", None)
    top = float(np.max(band)) if band is not None else 5.0
    if measured is not None:
        top = min(top, 1.15 * measured.freq_hz.max())
    freq = np.linspace(0.0, top, 121)
    centre = dynamic_stiffness(estimate.M, estimate.B, estimate.K, freq_hz=freq)
    drawn = estimate.draws(count=count, seed=seed)
    spread = dynamic_stiffness(drawn["M"], drawn["B"], drawn["K"], freq_hz=freq)
    names = _label_axes(estimate)
    parts: tuple[tuple[str, Callable[[Any], Any], str, str, str], ...] = (
        ("real part: stiffness and inertia", np.real, BLUE, "o", "-"),
        ("imaginary part: damping", np.imag, ORANGE, "s", (0, (5, 1.2))),  # type: ignore[arg-type]
    )
    for i in range(n):
        for j in range(n):
            ax = grid[i, j]
            for label, part, colour, marker, line in parts:
                low, high = np.percentile(part(spread[:, :, i, j]), [2.5, 97.5], axis=0)
                ax.fill_between(freq, low, high, color=colour, alpha=0.18, lw=0)
                ax.plot(freq, part(centre[:, i, j]), color=colour, ls=line, lw=1.5, label=label)
                if measured is not None:
                    dots = part(measured.value[:, i, j])
                    low_dot, high_dot = _visible(low, high, dots)
                    ax.plot(measured.freq_hz, dots, marker, color=colour, ms=2.6, alpha=0.75)
                    ax.update_datalim([(0, low_dot), (0, high_dot)])
            if n > 1:
                ax.set_title(f"−F {names[i]} over {names[j]}")
            ax.axhline(0, color=INK, lw=0.6)
            ax.set_xlim(0, top)
    unit = unit_of(estimate, "K")
    for i in range(n):
        grid[i, 0].set_ylabel(unit)
    for j in range(n):
        grid[-1, j].set_xlabel("frequency (Hz)")
    handles, labels = grid[0, 0].get_legend_handles_labels()
    if axes is None:
        grid[0, 0].figure.legend(handles, labels, loc="outside upper right", ncols=2)
    else:
        grid[0, 0].legend(loc="best")
    return grid


def _visible(low: np.ndarray, high: np.ndarray, dots: np.ndarray) -> tuple[float, float]:
    return float(min(low.min(), dots.min())), float(max(high.max(), dots.max()))


def human_share(estimate: Any, ax: Any = None) -> Any:
    """Share of the motion's power that the reference does not explain, over frequency."""
    rho = estimate.rho
    if rho is None:
        raise refuse("the estimate has no rho: the record holds no reference", "estimate")
    ax = axes_grid(None if ax is None else [ax], 1, 1, (WIDTH_IN, 2.3))[0, 0]
    value = np.asarray(rho.value)
    value = value[:, None] if value.ndim == 1 else value
    total = np.atleast_1d(rho.total)
    lines: Iterator[Any] = iter(("-", (0, (5, 1.2)), (0, (1, 1)), "-.", "--", ":"))
    for i, name in enumerate(_label_axes(estimate)):
        label = f"{name}, {100 * total[i]:.0f} % of all its power"
        ax.plot(rho.freq_hz, 100 * value[:, i], ls=next(lines), lw=1.5, label=label)
    ax.set_ylim(0, 100)
    ax.set_xlim(0, float(np.max(rho.freq_hz)))
    ax.set_xlabel("frequency (Hz)")
    ax.set_ylabel("caused by the human (%)")
    ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.1)
    return ax


# All of them -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Picture:
    """A figure with what to say about it."""

    name: str  # file name without its ending
    title: str
    caption: str
    figure: Any

    @cached_property
    def svg(self) -> bytes:
        """The figure as SVG, the same bytes for the same figure."""
        buffer = io.BytesIO()
        with style():
            self.figure.savefig(buffer, format="svg", metadata={"Date": None})
        return buffer.getvalue()

    def save(self, folder: Any) -> list[Path]:
        """Write ``<name>.svg`` and ``<name>.png`` into a folder that exists; return their paths."""
        paths = [Path(folder) / f"{self.name}.{ending}" for ending in ("svg", "png")]
        paths[0].write_bytes(self.svg)
        with style():
            self.figure.savefig(paths[1])
        return paths


def pictures(
    estimate: Any, *, shoulder_m: tuple[float, float] | None = None
) -> Iterator[Picture]:
    """Every figure that the estimate allows, in the order of the report.

    The figures are already closed for pyplot: they open no window and need no closing.
    """
    import matplotlib.pyplot as plt

    with style():
        for name, title, caption, make in _catalogue(estimate, shoulder_m):
            axes = np.atleast_1d(np.asarray(make(), dtype=object)).flat[0]
            plt.close(axes.figure)
            yield Picture(name, title, caption, axes.figure)


def _catalogue(
    estimate: Any, shoulder_m: tuple[float, float] | None
) -> Iterator[tuple[str, str, str, Callable[[], Any]]]:
    force = _force_name(estimate)
    beside = (
        ", beside those of least squares" if estimate.least_squares is not None else ""
    )
    dots = "."
    if estimate.rho is not None:
        dots = "; dots are measured without a model, each on its own, and scatter more."
    yield (
        "parameters", "Parameters",
        f"Estimates and their 95 % intervals{beside}.",
        lambda: parameters(estimate),
    )  # fmt: skip
    yield (
        "prediction", f"Predicted {force} on held-out data",
        f"Measured {force} and the {force} that the model predicts, on data the fit has not seen.",
        lambda: prediction(estimate),
    )  # fmt: skip
    if estimate.n == 2:
        yield (
            "ellipses", "Impedance ellipses",
            "Force that answers a unit motion in every direction; thin lines are draws from the "
            "estimate's covariance, the dashed circle gives the scale. Below each title: ratio of "
            "the axes, and the angle of the major axis with its 95 % interval.",
            lambda: ellipses(estimate, shoulder_m=shoulder_m),
        )  # fmt: skip
    yield (
        "energy", "Absorbed energy",
        "Energy that has flowed from the robot into the limb since the start of the record.",
        lambda: energy(estimate),
    )  # fmt: skip
    yield (
        "frequency-response", "Frequency response",
        "Dynamic stiffness of the model with its 95 % band"
        + dots,
        lambda: frequency_response(estimate),
    )  # fmt: skip
    if estimate.rho is not None:
        yield (
            "human-share", "Motion caused by the human",
            "Share of the motion's power that does not come from the reference. Where it is "
            "large, least squares is misled.",
            lambda: human_share(estimate),
        )  # fmt: skip
    yield (
        "signals", "Signals",
        "Five seconds from the middle of the record, as recorded and as used by the fit.",
        lambda: signals(estimate),
    )  # fmt: skip


def overview(estimate: Any) -> Any:
    """Parameters, prediction and energy in one figure; what ``estimate.plot()`` shows."""
    import matplotlib.pyplot as plt

    n = estimate.n
    with style():
        figure = plt.figure(figsize=(WIDTH_IN, 6.2 + 1.0 * n), layout="constrained")
        top, middle, bottom = figure.subfigures(3, 1, height_ratios=[2.4 + n / 2, 0.6 + n, 1.6])
        parameters(estimate, top.subplots(2, 2))
        prediction(estimate, middle.subplots(n, 1, sharex=True, squeeze=False))
        energy(estimate, bottom.subplots())
    return figure
