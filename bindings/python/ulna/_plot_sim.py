"""Figures of experiments with a robot, simulated or recorded; `ulna.plot` offers them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import wraps
from typing import Any

import numpy as np

from ._figure import BLUE, GREEN, GREY, INK, ORANGE, PINK, WIDTH_IN, axes_grid, style
from .record import Record, refuse

_POINTS = 4000  # a line; more do not show on a page


def _styled(draw: Callable[..., Any]) -> Callable[..., Any]:
    """The look of a report for the whole figure, titles and legends included."""

    @wraps(draw)
    def inside(*args: Any, **keywords: Any) -> Any:
        with style():
            return draw(*args, **keywords)

    return inside


def _names(record: Record, role: str) -> list[str]:
    found = sorted((c.axis, c.name) for c in record.channels if c.role == role)
    return [name for _, name in found]


def _columns(record: Record, names: list[str]) -> np.ndarray:
    return np.column_stack([record[name] for name in names])


def _thin(*signals: np.ndarray) -> list[np.ndarray]:
    step = max(1, len(signals[0]) // _POINTS)
    return [s[::step] for s in signals]


@_styled
def loop(
    record: Record, axes: Any = None, *, start_s: float = 0.0, span_s: float = 8.0
) -> np.ndarray:
    """What happens in the loop of robot and human, an axes a kind of signal.

    Position with its reference (dashed), force by the human on the robot with the commanded force
    where there is one (dashed), and, of a simulation with ``extras=["truth"]``, the human's own force
    and co-contraction.

    Parameters
    ----------
    record : Record
    axes : array of axes, optional
    start_s, span_s : float
        What to show; the shaded parts are the perturbations (segments).
    """
    position, force = _names(record, "position"), _names(record, "force")
    reference = _names(record, "reference")
    if not position or not force:
        raise refuse("the record must have position and force channels", "record")
    own = [c.name for c in record.channels if c.name.endswith("_cns")]
    rows = 3 if own else 2
    grid = axes_grid(axes, rows, 1, (WIDTH_IN, 1.75 * rows + 0.3), sharex=True)[:, 0]
    time = np.asarray(record.time) - record.time[0]
    shown = (time >= start_s) & (time < start_s + span_s)
    if np.sum(shown) < 2:
        raise refuse(f"the record has no samples from {start_s:g} s on", "start_s")
    t = time[shown]
    of_force = bool(reference) and reference[0].startswith("F_")
    rest = _columns(record, position)[0]
    for i, (name, colour) in enumerate(zip(position, (BLUE, ORANGE, GREEN), strict=False)):
        moved = 1e3 * (record[name][shown] - rest[i])
        grid[0].plot(*_thin(t, moved), color=colour, label=name)
        if reference and not of_force:
            asked = 1e3 * (record[reference[i]][shown] - rest[i])
            grid[0].plot(*_thin(t, asked), color=colour, ls="--", lw=0.8, alpha=0.8)
        grid[1].plot(*_thin(t, record[force[i]][shown]), color=colour, label=force[i])
        if of_force:
            asked = record[reference[i]][shown]
            grid[1].plot(*_thin(t, asked), color=colour, ls="--", lw=0.8, alpha=0.8)
    grid[0].set_ylabel("displacement (mm)")
    grid[1].set_ylabel("force (N)")
    grid[0].set_title(
        "Handle" if of_force or not reference else "Handle; dashed: where it should be"
    )
    grid[1].set_title(
        "Force of the human on the robot" + ("; dashed: that of the robot" if of_force else "")
    )
    if own:
        _draw_human(grid[2], record, own, shown, t)
    for ax in grid:
        for segment in record.segments if len(record.segments) > 1 else ():
            begin, end = time[segment.begin], time[segment.end - 1]
            if end > start_s and begin < start_s + span_s:
                ax.axvspan(max(begin, t[0]), min(end, t[-1]), color=GREY, alpha=0.13, lw=0)
        low, high = ax.get_ylim()
        ax.set_ylim(low, high + 0.25 * (high - low))  # room for the legend
        ax.legend(loc="upper right", ncols=4)
        ax.set_xlim(t[0], t[-1])
    grid[-1].set_xlabel("time (s)")
    return grid


def _draw_human(ax: Any, record: Record, own: list[str], shown: np.ndarray, t: np.ndarray) -> None:
    for name, colour in zip(own, (BLUE, ORANGE), strict=False):
        ax.plot(*_thin(t, record[name][shown]), color=colour, label=name[:-4] + ", voluntary")
    ax.set_ylabel("force (N)")
    ax.set_title("What the human does")
    level = record["cocontraction"][shown]
    if np.ptp(level) > 0 or level[0] > 0:
        # On the same axes as a share of its height, so that one scale serves both.
        other = ax.twinx()
        other.plot(*_thin(t, level), color=PINK, lw=1.0, ls=":", label="co-contraction")
        other.set_ylim(0, 1.05)
        other.set_ylabel("co-contraction")
        other.grid(False)
        other.spines["right"].set_visible(True)
        ax.plot([], [], color=PINK, ls=":", label="co-contraction")


def _absorbed(record: Record) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time, absorbed energy (J) and displacement (m), from smoothed signals of the first trial."""
    from .passivity import of_energy
    from .signal import savgol_filter

    trial = record.trials[0]
    rows = slice(trial.begin, trial.end)
    position = _columns(record, _names(record, "position"))[rows]
    force = _columns(record, _names(record, "force"))[rows]
    rate = record.rate_hz
    window = max(7, 2 * round(0.05 * rate) + 1)  # 0.1 s, as in section 3.5.1
    velocity = savgol_filter(
        position, window=window, order=min(6, window - 2), derivative=1, rate_hz=rate
    )
    energy = of_energy(
        savgol_filter(force, window=window, order=min(6, window - 2)), velocity, rate_hz=rate
    ).energy_j
    time = np.asarray(record.time)[rows] - record.time[trial.begin]
    return time, energy, np.linalg.norm(position - position[0], axis=1)


@_styled
def absorbed_energy(
    records: Mapping[str, Record], axes: Any = None, *, perturbation: int = 0, span_s: float = 2.0
) -> np.ndarray:
    """Energy that an arm absorbed: over a trial, and with the displacement over one perturbation.

    As Figures 4.3 to 4.5 of Dyck (2013): a passive arm's energy rises, an active one's falls.

    Parameters
    ----------
    records : mapping of str to Record
        By title, a column each.
    axes : array of axes, shape (2, columns), optional
    perturbation : int
        Number of the segment to show below.
    span_s : float
        From its onset, at most to its end.
    """
    if not isinstance(records, Mapping) or not records:
        raise refuse("records must be a mapping of titles to records", "records")
    width = max(WIDTH_IN, 2.4 * len(records))
    grid = axes_grid(axes, 2, len(records), (width, 4.4))
    for number, (title, record) in enumerate(records.items()):
        if not _names(record, "position") or not _names(record, "force"):
            raise refuse(f"the record {title!r} must have position and force channels", "records")
        time, energy, moved = _absorbed(record)
        top, bottom = grid[:, number]
        active = energy[-1] < 0
        top.plot(*_thin(time, 1e3 * energy), color=ORANGE if active else BLUE)
        top.axhline(0, color=INK, lw=0.6)
        top.set_title(title)
        top.set_xlabel("time (s)")
        segments = record.segments
        if not 0 <= perturbation < len(segments):
            raise refuse(
                f"perturbation is {perturbation}, but {title!r} has {len(segments)}", "perturbation"
            )
        begin = segments[perturbation].begin - record.trials[0].begin
        end = min(segments[perturbation].end - record.trials[0].begin, len(time))
        end = min(end, begin + round(span_s * record.rate_hz))
        t = time[begin:end] - time[begin]
        bottom.plot(
            *_thin(t, 1e3 * (energy[begin:end] - energy[begin])), color=ORANGE if active else BLUE
        )
        bottom.axhline(0, color=INK, lw=0.6)
        bottom.set_xlabel("time from its onset (s)")
        right = bottom.twinx()
        right.plot(*_thin(t, 1e3 * moved[begin:end]), color=GREY, ls="--")
        right.set_ylim(bottom=0)
        right.grid(False)
        if number == len(records) - 1:
            right.set_ylabel("displacement (mm, dashed)")
        right.spines["right"].set_visible(True)
    grid[0, 0].set_ylabel("absorbed in the trial (mJ)")
    grid[1, 0].set_ylabel("in one perturbation (mJ)")
    return grid
