"""One HTML file with a moving body in it: turn it, play it, ask it for numbers; no network needed.

The file holds three.js (MIT licence, its text stands in the file) and the data. It opens from a
folder as well as from a server, and tells what is missing where a browser cannot draw in 3-D.
"""

from __future__ import annotations

import base64
import json
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from ._body_picture import (
    MISSING,
    PLAIN,
    force_scale,
    missing_parts,
    plain_parts,
)
from ._body_scene import BodyScene, colour_limits, colour_table, floor_height, matching
from ._figure import BLUE, GREEN, SKY
from ._page import footer
from .record import refuse

_ASSETS = Path(__file__).parent / "_assets"
# Where the build puts three.js, and where Debian's package libjs-three has it.
_THREE = (
    (_ASSETS / "three" / "three.min.js", _ASSETS / "three" / "OrbitControls.js"),
    (
        Path("/usr/share/javascript/three/three.min.js"),
        Path("/usr/share/javascript/three/examples/js/controls/OrbitControls.js"),
    ),
)
# They share their names, and share none with other programs: one function is put around them all.
_PROGRAMS = ("body_data.js", "body_shapes.js", "body_stage.js", "body_time.js", "body.js")
_LARGEST_INTEGER = 32767
_NO_POSE = -32768


def write_page(
    scene: BodyScene,
    path: Any,
    *,
    beside: BodyScene | None = None,
    title: str = "Effort of the whole body",
    source: str = "",
    limits: tuple[float, float] | None = None,
    rate_hz: float = 30.0,
    start_s: float | None = None,
) -> Path:
    """Write a moving body coloured by effort as one interactive HTML file and return its path.

    Parameters
    ----------
    scene : BodyScene
        What to show.
    path : path-like
        The file to write; its folder is made when it does not exist.
    beside : BodyScene, optional
        Another condition, shown to the right; both start together and share colours and the view.
    title, source : str
        Heading, and what stands below it.
    limits : (float, float), optional
        Ends of the colour bar. Round numbers around the values of all frames when left out.
    rate_hz : float
        Frames that come faster than this are left out of the page, so that it stays small; none is
        averaged or invented. The page tells how many it holds. A link takes 29 bytes a frame with its
        standard deviation: 25 links are 1.3 MB a minute at 30 Hz.
    start_s : float, optional
        The time since the first frame at which the page opens; that of the hardest frame when left out.

    Raises
    ------
    FileNotFoundError
        When three.js is not there: neither in the package nor as Debian's libjs-three.

    Examples
    --------
    >>> from ulna._body_scene import BodyLink, BodyScene
    >>> scene = BodyScene("arm", [BodyLink("forearm", "capsule", (0.04, 0.3))], [0.0, 0.1],
    ...                   [[[0, 0, 1]], [[0, 0, 1.1]]], [[[1, 0, 0, 0]]] * 2, [[3.0], [5.0]])
    >>> write_page(scene, "out/arm.html", title="An arm").name
    'arm.html'
    """
    scenes = matching(scene, beside)
    target = Path(path)
    if target.is_dir():
        raise refuse(
            f"{str(path)!r} is a folder: give the name of the file to write, as "
            f"{str(target / 'body.html')!r}",
            "path",
        )
    if not rate_hz > 0:
        raise refuse(f"rate_hz must be above zero, got {rate_hz!r}", "rate_hz")
    low, high = colour_limits(scenes, limits)
    kept = [_kept(one, rate_hz) for one in scenes]
    if start_s is None:
        # The hardest frame may be one that is left out; the one before it is near enough.
        start_s = float(scene.time_s[scene.hardest_frame()] - scene.time_s[0])
    elif not np.isfinite(start_s):
        raise refuse(f"start_s must be a finite number, got {start_s!r}", "start_s")
    data = {
        "quantity": scene.quantity,
        "unit": scene.unit,
        "low": low,
        "high": high,
        "over": any(bool((one.values > high).any()) for one in scenes),
        "under": any(bool((one.values < low).any()) for one in scenes),
        "colours": [
            "#" + bytes(np.round(255 * c).astype(np.uint8)).hex() for c in colour_table(128)
        ],
        "missing": MISSING,
        "plain": PLAIN,
        "device": BLUE,
        "tool": SKY,
        "force": GREEN,
        "legend": {
            "missing": missing_parts(scenes),
            "device": plain_parts(scenes, "device"),
            "tool": plain_parts(scenes, "tool"),
            "force": force_scale(scenes) > 0,
        },
        "metres_per_newton": force_scale(scenes),
        "start": start_s,
        "scenes": [_scene(one, keep) for one, keep in zip(scenes, kept, strict=True)],
    }
    held = [f"{keep.size} of {one.frames}" for one, keep in zip(scenes, kept, strict=True)]
    html = _document(title, source, data, " and ".join(held))
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(html, encoding="utf-8")
    return target


def three_files() -> tuple[Path, Path]:
    """three.js and its orbit controls, or one sentence that says how to get them."""
    for files in _THREE:
        if all(one.is_file() for one in files):
            return files
    raise FileNotFoundError(
        "the page of a body needs three.js, which this build of ulna was made without: install "
        "Debian's package libjs-three (apt-get install libjs-three), or draw the picture instead"
    )


def _kept(scene: BodyScene, rate_hz: float) -> np.ndarray:
    """Frames to be written: for every tick of the page's clock the last one recorded by then."""
    time = scene.time_s - scene.time_s[0]
    ticks = np.floor(time * rate_hz + 1e-6)
    first = np.concatenate([[True], np.diff(ticks) > 0])
    first[-1] = True
    return np.flatnonzero(first)


def _scene(scene: BodyScene, keep: np.ndarray) -> dict[str, Any]:
    position = scene.position_m[keep]
    rotation = scene.rotation[keep]
    known = np.isfinite(position).all(axis=-1) & np.isfinite(rotation).all(axis=-1)
    inside = position[known]
    centre = (inside.min(axis=0) + inside.max(axis=0)) / 2 if len(inside) else np.zeros(3)
    # Sixteen bits over the room that is used: a tenth of a millimetre in seven metres.
    reach = max(float(np.abs(inside - centre).max()) if len(inside) else 0.0, 1e-3)
    return {
        "name": scene.name,
        "time": _floats(scene.time_s[keep] - scene.time_s[0]),
        "links": [
            {
                "name": one.name,
                "shape": one.shape,
                "size": [float(v) for v in one.size_m],
                "centre": [float(v) for v in one.centre_m],
                "rotation": [float(v) for v in one.rotation],
                "role": one.role,
            }
            for one in scene.links
        ],
        "joints": [
            {
                "name": one.name,
                "link": _index(scene, one.link),
                "at": [float(v) for v in one.at_m],
                "radius": float(one.radius_m),
            }
            for one in scene.joints
        ],
        "forces": [
            {"name": one.name, "link": _index(scene, one.link), "at": [float(v) for v in one.at_m]}
            for one in scene.forces
        ],
        "centre": centre.tolist(),
        "reach": reach,
        "position": _integers((position - centre) / reach, known),
        "rotation": _integers(rotation, known),
        "effort": _floats(None if scene.effort is None else scene.effort[keep]),
        "effort_sd": _floats(None if scene.effort_sd is None else scene.effort_sd[keep]),
        "joint_effort": _floats(None if scene.joint_effort is None else scene.joint_effort[keep]),
        "joint_effort_sd": _floats(
            None if scene.joint_effort_sd is None else scene.joint_effort_sd[keep]
        ),
        "force": _floats(None if scene.force_N is None else scene.force_N[keep]),
        "series": _floats(scene.series[keep]),
        "series_name": scene.overall_name,
        "floor": floor_height(scene),
    }


def _index(scene: BodyScene, name: str) -> int:
    return [one.name for one in scene.links].index(name)


def _floats(values: np.ndarray | None) -> str | None:
    """Base64 of little-endian 32-bit numbers; NaN stays NaN."""
    if values is None:
        return None
    return base64.b64encode(np.ascontiguousarray(values, dtype="<f4").tobytes()).decode("ascii")


def _integers(values: np.ndarray, known: np.ndarray) -> str:
    """Base64 of numbers from -1 to 1 as little-endian 16-bit integers."""
    whole = np.full(values.shape, _NO_POSE, dtype="<i2")
    whole[known] = np.round(np.clip(values[known], -1, 1) * _LARGEST_INTEGER)
    return base64.b64encode(whole.tobytes()).decode("ascii")


def _document(title: str, source: str, data: dict[str, Any], held: str) -> str:
    """The page: what a reader sees first, then the data, then the programs."""
    three, controls = (_program(one.read_text(encoding="utf-8")) for one in three_files())
    licence = (_ASSETS / "three" / "LICENSE").read_text(encoding="utf-8")
    parts = [(_ASSETS / name).read_text(encoding="utf-8") for name in _PROGRAMS]
    program = _program('(function () {\n"use strict";\n' + "\n".join(parts) + "})();\n")
    style = (_ASSETS / "body.css").read_text(encoding="utf-8")
    body = (_ASSETS / "body.html").read_text(encoding="utf-8")
    # Names come from recordings: nothing in them may end the element that holds them.
    told = json.dumps(data, ensure_ascii=False, allow_nan=False).replace("<", "\\u003c")
    for key, value in {
        "@TITLE@": escape(title),
        "@SOURCE@": escape(source),
        "@HELD@": escape(held),
        "@FOOTER@": footer(),
    }.items():
        body = body.replace(key, value)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="color-scheme" content="light dark">\n'
        f"<title>{escape(title)}</title>\n<style>{style}</style>\n</head>\n<body>\n{body}\n"
        f'<script type="application/json" id="data">{told}</script>\n'
        f"<script>/* three.js, https://threejs.org\n\n{licence}*/\n{three}</script>\n"
        f"<script>/* Part of three.js, under the licence above. */\n{controls}</script>\n"
        f"<script>{program}</script>\n</body>\n</html>\n"
    )


def _program(text: str) -> str:
    """A program that can stand in a page: no text in it ends the element."""
    return text.replace("</script", "<\\/script").replace("<!--", "<\\!--")
