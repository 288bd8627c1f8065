"""Figures of whole-body torques; `ulna.plot` offers them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ._figure import AMBER, BLUE, GREEN, GREY, INK, ORANGE, PINK, WIDTH_IN, axes_grid, style
from .record import refuse

_COLOURS = (BLUE, ORANGE, GREEN, PINK, AMBER)
_95 = 1.959963984540054


def body_torques(
    torques: Any, axes: Any = None, *, joints: Sequence[str] | None = None, time_s: Any = None
) -> np.ndarray:
    """Torques with their 95 % intervals, and below what the measured wrenches lack.

    Parameters
    ----------
    torques : BodyTorques
    axes : array of two axes, optional
    joints : sequence of str, optional
        At most five; default: those with the largest torques.
    time_s : (frames,) array, optional
        Default: the number of the frame.

    The grey band below is two standard deviations of the residual's vertical force as the sensors
    explain it. Frames that were bridged are marked by ticks at the top.
    """
    if not len(torques.torque):
        raise refuse("there are no frames to draw", "torques")
    time = np.arange(len(torques.torque)) if time_s is None else np.asarray(time_s, dtype=float)
    if time.shape != (len(torques.torque),):
        raise refuse(f"time_s has shape {time.shape}, one number a frame is needed", "time_s")
    if joints is None:
        size = np.nan_to_num(np.nanmax(np.abs(torques.torque), axis=0))
        joints = [torques.joints[k] for k in np.argsort(-size, kind="stable")[:3]]
    unknown = [name for name in joints if name not in torques.joints]
    if unknown or not 0 < len(joints) <= len(_COLOURS):
        words = f"there is no joint {unknown[0]!r}" if unknown else "one to five joints are drawn"
        raise refuse(words, "joints")
    with style():
        grid = axes_grid(axes, 2, 1, (WIDTH_IN, 4.2), sharex=True, height_ratios=[1.6, 1.0])
        top, below = grid[:, 0]
        top.axhline(0, color=INK, linewidth=0.6)
        for name, colour in zip(joints, _COLOURS, strict=False):
            k = torques.joints.index(name)
            top.plot(time, torques.torque[:, k], color=colour, linewidth=1.3, label=name)
            if torques.torque_deviation.size:
                low, high = torques.interval(name)
                top.fill_between(time, low, high, color=colour, alpha=0.2, linewidth=0)
        if torques.bridged.any():
            high = top.get_ylim()[1]
            top.plot(time[torques.bridged], np.full(int(torques.bridged.sum()), high), "|",
                     color=GREY, label="bridged")  # fmt: skip
        top.set(ylabel="torque (N m)", title="Joint torques, 95 % intervals")
        top.legend(ncol=3, loc="upper center", bbox_to_anchor=(0.5, -0.04))
        below.axhline(0, color=INK, linewidth=0.6)
        if torques.residual.size:
            band = 2.0 * torques.residual_deviation[:, 2]
            below.fill_between(time, -band, band, color=GREY, alpha=0.25, linewidth=0)
            for axis, colour in zip(range(3), (BLUE, ORANGE, GREEN), strict=True):
                below.plot(
                    time, torques.residual[:, axis], color=colour, label=f"$F_{'xyz'[axis]}$"
                )
            below.legend(ncol=3, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.1)
        below.set(
            xlabel="frame" if time_s is None else "time (s)",
            ylabel="lacking force (N)",
            title="Balance residual",
        )
        return grid


def body_effort(
    body: Any,
    axes: Any = None,
    *,
    time_s: float | None = None,
    beside: Any = None,
    names: tuple[str, str] = ("", ""),
    limits: tuple[float, float] | None = None,
    azimuth_deg: float = 35.0,
    elevation_deg: float = 12.0,
    labels: int = 3,
) -> np.ndarray:
    """The body at one time, each link in the colour of the torque at the joint that carries it.

    Parameters
    ----------
    body : RecordedTorques
    axes : one or two matplotlib axes, optional
    time_s : float, optional
        The frame in which all torques together are largest when left out.
    beside : RecordedTorques, optional
        Another condition, drawn to the right in the same colours.
    names : (str, str)
        What stands above the two; the files when left out.
    limits : (float, float), optional
        Ends of the colour bar.
    azimuth_deg, elevation_deg : float
        From where: 0 is ahead of the body, 90 its left side.
    labels : int
        So many links with the largest torques are named.
    """
    from ._body_picture import draw
    from ._body_show import as_scene

    scene = as_scene(body, names[0])
    frame = scene.hardest_frame() if time_s is None else scene.frame_at(time_s=time_s)
    return draw(
        scene, frame, axes, beside=None if beside is None else as_scene(beside, names[1]),
        limits=limits, azimuth_deg=azimuth_deg, elevation_deg=elevation_deg, labels=labels,
    )  # fmt: skip


def body_page(
    body: Any,
    path: Any,
    *,
    beside: Any = None,
    names: tuple[str, str] = ("", ""),
    title: str = "Effort of the whole body",
    source: str = "",
    limits: tuple[float, float] | None = None,
    rate_hz: float = 30.0,
    start_s: float | None = None,
) -> Path:
    """Write the moving body as one interactive HTML file, without a network, and return its path.

    Parameters
    ----------
    body, beside : RecordedTorques
        Conditions, both from the start and in the same colours.
    path : path-like
    names : (str, str)
        Of the conditions; the files when left out.
    title, source : str
        Heading, and what stands below it.
    limits : (float, float), optional
        Ends of the colour bar.
    rate_hz : float
        Frames that come faster are left out of the page.
    start_s : float, optional
        At which the page opens; the hardest frame when left out.

    Raises
    ------
    FileNotFoundError
        When three.js is not there: neither in the package nor as Debian's libjs-three.
    """
    from ._body_page import write_page
    from ._body_show import as_scene

    return write_page(
        as_scene(body, names[0]), path,
        beside=None if beside is None else as_scene(beside, names[1]), title=title, source=source,
        limits=limits, rate_hz=rate_hz, start_s=start_s,
    )  # fmt: skip
