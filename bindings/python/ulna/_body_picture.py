"""The body of one frame, or of two conditions side by side, as a figure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ._body_cast import Solid, View, image
from ._body_scene import (
    BodyLink,
    BodyScene,
    colour_limits,
    colour_table,
    floor_height,
    matching,
    rotation_matrix,
)
from ._figure import BLUE, GREEN, INK, SKY, axes_grid, style
from .record import refuse

MISSING = "#A3ABB5"
PLAIN = "#D3D7DC"  # the body where only joints carry colours
_DPI = 200
_HEIGHT_IN = 4.2


@dataclass(frozen=True)
class _Mark:
    """A part to be named: where it is in the picture, and on which side its name stands."""

    x: float
    y: float
    words: str
    value: float
    left: bool


def draw(
    scene: BodyScene,
    frame: int,
    axes: Any = None,
    *,
    beside: BodyScene | None = None,
    beside_frame: int | None = None,
    limits: tuple[float, float] | None = None,
    azimuth_deg: float = 35.0,
    elevation_deg: float = 12.0,
    labels: int = 3,
) -> np.ndarray:
    """The body in one frame, coloured by effort, with a colour bar; returns the axes.

    Parameters
    ----------
    scene : BodyScene
        What to draw.
    frame : int
        Which frame; negative ones count from the end.
    axes : one or two matplotlib axes, optional
        Where; a new figure otherwise.
    beside : BodyScene, optional
        Another condition, drawn to the right in the same scale and with the same colours.
    beside_frame : int, optional
        Its frame; the one nearest in time since the start when left out.
    limits : (float, float), optional
        Ends of the colour bar. Round numbers around the values of all frames when left out.
    azimuth_deg, elevation_deg : float
        From where: 0 is ahead of the body, 90 its left side, elevation above the horizon.
    labels : int
        So many links or joints with the largest effort in `scene` are named with their value, and
        the same ones in `beside`.

    Examples
    --------
    >>> scene = BodyScene("arm", [BodyLink("forearm", "capsule", (0.04, 0.3))], [0.0],
    ...                   [[[0, 0, 1]]], [[[1, 0, 0, 0]]], [[3.0]])
    >>> draw(scene, 0).shape
    (1, 1)
    """
    scenes = matching(scene, beside)
    frames = [_frame(scene, frame, "frame")]
    if beside is not None:
        if beside_frame is None:
            since = scene.time_s[frames[0]] - scene.time_s[0]
            beside_frame = beside.frame_at(time_s=float(beside.time_s[0] + since))
        frames.append(_frame(beside, beside_frame, "beside_frame"))
    if labels < 0:
        raise refuse(f"labels must be zero or more, got {labels}", "labels")
    low, high = colour_limits(scenes, limits)
    view = View(azimuth_deg, elevation_deg)
    table = colour_table()
    drawn = [_solids(one, k, table, low, high) for one, k in zip(scenes, frames, strict=True)]
    arrows = [_ends(one, k, force_scale(scenes)) for one, k in zip(scenes, frames, strict=True)]
    centres = [_stand(solids, view) for solids in drawn]
    named = _hardest(scenes[0], frames[0], labels)
    marks = [
        _marks(one, k, view, centre, named)
        for one, k, centre in zip(scenes, frames, centres, strict=True)
    ]
    half_width, bottom, top = _window(drawn, arrows, centres, view)
    # Beside the body there is room for the longest name of each side, the same in all pictures.
    scale = (top - bottom) / (_HEIGHT_IN - 0.4)
    top += 0.4 * scale  # for what stands above it
    room = [
        max(
            (0.055 * scale * len(m.words) + 0.03 for m in sum(marks, []) if m.left is left),
            default=0,
        )
        for left in (True, False)
    ]
    # What stands above the body needs its width as well.
    heads = [
        max(0.085 * len(one.name), 0.06 * len(_when(one, k)))
        for one, k in zip(scenes, frames, strict=True)
    ]
    lacking = max(heads) * scale - 2 * half_width - sum(room)
    room = [side + max(0.0, lacking / 2) for side in room]

    with style():
        width_in = max(1.5, (2 * half_width + sum(room)) / scale)
        grid = axes_grid(axes, 1, len(scenes), (width_in * len(scenes) + 1.1, _HEIGHT_IN + 0.4))
        for place, one, k, solids, ends, names, centre in zip(
            grid[0], scenes, frames, drawn, arrows, marks, centres, strict=True
        ):
            window = (centre - half_width - room[0], centre + half_width + room[1], bottom, top)
            _paint(place, one, solids, view, window)
            _arrows(place, ends, view)
            _names(place, one, names, centre, half_width)
            place.text(
                0, 1, one.name, transform=place.transAxes, fontsize=9, weight="bold", va="top"
            )
            place.text(
                0, 1 - 0.19 / _HEIGHT_IN, _when(one, k), color="#5B5B5B",
                transform=place.transAxes, fontsize=7.5, va="top",
            )  # fmt: skip
        _bar(grid, scenes, low, high, table)
        _legend(grid, scenes)
    return grid


def colours_of(values: np.ndarray, low: float, high: float, table: np.ndarray) -> np.ndarray:
    """(n, 3) colours of values; NaN stays NaN."""
    share = np.clip((values - low) / (high - low), 0, 1)
    index = np.where(np.isnan(share), 0, np.round(share * (len(table) - 1))).astype(int)
    return np.where(np.isnan(share)[:, None], np.nan, table[index])


def _when(scene: BodyScene, frame: int) -> str:
    """What stands below the name of a condition."""
    value = scene.series[frame]
    told = "" if np.isnan(value) else f" · {scene.overall_name} {value:.3g} {scene.unit}"
    return f"{scene.time_s[frame]:.2f} s{told}"


def _frame(scene: BodyScene, frame: Any, name: str) -> int:
    if not isinstance(frame, int | np.integer) or not -scene.frames <= frame < scene.frames:
        raise refuse(
            f"{name} must be a whole number below {scene.frames}, the number of frames of "
            f"{scene.name!r}, got {frame!r}",
            name,
        )
    return int(frame) % scene.frames


def _rgb(colour: str) -> np.ndarray:
    return np.array([int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)])


def _solids(
    scene: BodyScene, frame: int, table: np.ndarray, low: float, high: float
) -> list[Solid]:
    """Everything that has a pose in this frame."""
    colours = colours_of(scene.values[frame], low, high, table)
    missing = _rgb(MISSING)
    body = _rgb(PLAIN) if scene.effort is None else missing
    plain = {"body": body, "device": _rgb(BLUE), "tool": _rgb(SKY)}
    out = []
    places = {}
    for k, link in enumerate(scene.links):
        origin, turn = scene.position_m[frame, k], rotation_matrix(scene.rotation[frame, k])
        places[link.name] = origin, turn
        centre = origin + turn @ np.asarray(link.centre_m, dtype=float)
        if not np.isfinite(centre).all():
            continue
        colour = plain[link.role] if np.isnan(colours[k, 0]) else colours[k]
        out.append(Solid(link, centre, turn @ rotation_matrix(link.rotation), colour))
    for k, joint in enumerate(scene.joints):
        origin, turn = places[joint.link]
        centre = origin + turn @ np.asarray(joint.at_m, dtype=float)
        if not np.isfinite(centre).all():
            continue
        given = colours[len(scene.links) + k]
        colour = missing if np.isnan(given[0]) else given
        ball = BodyLink(joint.name, "sphere", (joint.radius_m,))
        out.append(Solid(ball, centre, np.eye(3), colour, through=True))
    return out


def _stand(solids: list[Solid], view: View) -> float:
    """Where the middle of the body lies across the picture."""
    if not solids:
        return 0.0
    middles = np.array([view.project(one.centre_m)[0] for one in solids])
    return float((middles.min() + middles.max()) / 2)


def _window(
    drawn: list[list[Solid]],
    arrows: list[list[tuple[np.ndarray, np.ndarray]]],
    centres: list[float],
    view: View,
) -> tuple[float, float, float]:
    """Half the width, the bottom and the top that hold everything of all scenes."""
    wide, low, high = [0.3], [], []
    for solids, centre, ends in zip(drawn, centres, arrows, strict=True):
        for one in solids:
            x, y = view.project(one.centre_m)
            half = one.link.half_extents_m
            reach_x = np.abs(view.right @ one.axes) @ half
            reach_y = np.abs(view.up @ one.axes) @ half
            wide.append(abs(x - centre) + reach_x)
            low.append(y - reach_y)
            high.append(y + reach_y)
        for x, y in view.project(np.array(ends).reshape(-1, 3)):
            wide.append(abs(x - centre))
            low.append(y)
            high.append(y)
    if not low:
        return 0.5, 0.0, 1.8
    margin = 0.05 * (max(high) - min(low)) + 0.02
    return max(wide) + margin, min(low) - margin, max(high) + margin


def _paint(place: Any, scene: BodyScene, solids: list[Solid], view: View, window: Any) -> None:
    """The image of the shapes, as fine as the axes will be printed."""
    left, right, bottom, top = window
    box = place.get_window_extent()
    inches = max(1.0, box.height / place.figure.dpi)
    rows = int(min(2000, _DPI * inches))
    columns = max(2, int(round(rows * (right - left) / (top - bottom))))
    picture = image(solids, view, window, (columns, rows), floor_height(scene))
    place.imshow(picture, extent=window, interpolation="antialiased", zorder=2)
    place.set(xlim=(left, right), ylim=(bottom, top), aspect="equal")
    place.grid(False)
    place.set_axis_off()
    if not solids:
        place.text(
            (left + right) / 2, (bottom + top) / 2, "no pose in this frame", ha="center",
            color="#5B5B5B",
        )  # fmt: skip


def force_scale(scenes: list[BodyScene]) -> float:
    """Metres a newton: the largest force of all frames is half a metre long."""
    largest = 0.0
    for one in scenes:
        if one.force_N is not None and np.isfinite(one.force_N).any():
            largest = max(largest, float(np.nanmax(np.linalg.norm(one.force_N, axis=-1))))
    return 0.5 / largest if largest > 0 else 0.0


def _ends(scene: BodyScene, frame: int, scale: float) -> list[tuple[np.ndarray, np.ndarray]]:
    """Start and tip of every arrow of a frame."""
    if scene.force_N is None:
        return []
    index = {link.name: k for k, link in enumerate(scene.links)}
    out = []
    for k, force in enumerate(scene.forces):
        link = index[force.link]
        turn = rotation_matrix(scene.rotation[frame, link])
        start = scene.position_m[frame, link] + turn @ np.asarray(force.at_m, dtype=float)
        tip = start + scale * scene.force_N[frame, k]
        if np.isfinite(tip).all() and np.linalg.norm(tip - start) > 0.005:
            out.append((start, tip))
    return out


def _arrows(place: Any, ends: list[tuple[np.ndarray, np.ndarray]], view: View) -> None:
    for a, b in view.project(np.array(ends).reshape(-1, 2, 3)):
        place.annotate(
            "", b, xytext=a, zorder=4,
            arrowprops={
                "arrowstyle": "-|>,head_length=0.45,head_width=0.22", "color": GREEN,
                "linewidth": 1.8, "shrinkA": 0, "shrinkB": 0,
            },
        )  # fmt: skip


def _hardest(scene: BodyScene, frame: int, count: int) -> list[str]:
    """Names of the parts that work hardest, of those whose value is known."""
    values = scene.values[frame]
    parts = [*scene.links, *scene.joints]
    order = np.argsort(-np.where(np.isnan(values), -np.inf, values), kind="stable")
    return [parts[k].name for k in order[:count] if not np.isnan(values[k])]


def _marks(
    scene: BodyScene, frame: int, view: View, centre: float, named: list[str]
) -> list[_Mark]:
    """Where the parts with these names are, of those that have a pose and a value."""
    links = {link.name: k for k, link in enumerate(scene.links)}
    out: list[_Mark] = []
    for index, part in enumerate([*scene.links, *scene.joints]):
        value = float(scene.values[frame, index])
        if part.name not in named or np.isnan(value):
            continue
        if isinstance(part, BodyLink):
            link, at = index, part.centre_m
        else:
            link, at = links[part.link], part.at_m
        turn = rotation_matrix(scene.rotation[frame, link])
        point = scene.position_m[frame, link] + turn @ np.asarray(at, dtype=float)
        if np.isfinite(point).all():
            x, y = view.project(point)
            words = part.name.replace("_", " ")
            out.append(_Mark(float(x), float(y), words, value, bool(x < centre)))
    return out


def _names(
    place: Any, scene: BodyScene, marks: list[_Mark], centre: float, half_width: float
) -> None:
    """Names with values in the margin, with a line to what they name."""
    low, high = place.get_ylim()
    gap = 0.078 * (high - low)
    for side in (-1, 1):
        column = sorted((m for m in marks if m.left is (side < 0)), key=lambda m: -m.y)
        top = np.inf
        for mark in column:
            level = top = min(mark.y, top - gap)
            edge = centre + side * (half_width + 0.01)
            place.plot([mark.x, edge], [mark.y, level], color=INK, linewidth=0.5, zorder=5)
            place.plot([mark.x], [mark.y], marker="o", markersize=2.2, color=INK, zorder=5)
            place.text(
                edge + side * 0.015, level, f"{mark.words}\n{mark.value:.3g} {scene.unit}",
                fontsize=7, ha="left" if side > 0 else "right", va="center", linespacing=1.05,
                color=INK, zorder=5,
            )  # fmt: skip


def _bar(grid: np.ndarray, scenes: list[BodyScene], low: float, high: float, table: Any) -> None:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize

    over = any((one.values > high).any() for one in scenes)
    under = any((one.values < low).any() for one in scenes)
    extend = {(0, 0): "neither", (1, 0): "max", (0, 1): "min", (1, 1): "both"}[over, under]
    mappable = ScalarMappable(Normalize(low, high), ListedColormap(table))
    figure = grid[0, 0].figure
    bar = figure.colorbar(
        mappable, ax=list(grid[0]), shrink=0.62, aspect=22, pad=0.02, extend=extend, extendfrac=0.04
    )
    bar.set_label(f"{scenes[0].quantity} ({scenes[0].unit})")
    bar.outline.set_visible(False)
    bar.ax.tick_params(length=2.5, width=0.6)
    bar.ax.grid(False)


def _legend(grid: np.ndarray, scenes: list[BodyScene]) -> None:
    """What is not on the colour bar, where it occurs."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    keys: list[Any] = []
    if missing_parts(scenes):
        keys.append(Patch(color=MISSING, label="not known"))
    for role, colour, name in (("device", BLUE, "exoskeleton"), ("tool", SKY, "tool")):
        if plain_parts(scenes, role):
            keys.append(Patch(color=colour, label=name))
    scale = force_scale(scenes)
    if scale > 0:
        keys.append(Line2D([], [], color=GREEN, linewidth=1.8, label="force"))
    if keys:
        grid[0, 0].figure.legend(
            handles=keys, loc="outside lower left", ncols=4, handlelength=1.2, columnspacing=1.4
        )


def missing_parts(scenes: list[BodyScene]) -> bool:
    """Whether some part of a body that should carry a colour has no value in some frame."""
    return any(
        (scene.joint_effort is not None and np.isnan(scene.joint_effort).any())
        or (
            scene.effort is not None
            and np.isnan(scene.effort[:, [one.role == "body" for one in scene.links]]).any()
        )
        for scene in scenes
    )


def plain_parts(scenes: list[BodyScene], role: str) -> bool:
    """Whether a device or a tool is shown in its own colour."""
    return any(
        link.role == role and np.isnan(one.values[:, k]).any()
        for one in scenes
        for k, link in enumerate(one.links)
    )
