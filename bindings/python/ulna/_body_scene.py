"""What is shown of a moving body: its links, where they are in every frame, and how hard they work.

Plain numbers, so that any model, recording or simulation can fill it. Frames are rows, links are
columns; the world is the one of the body: x forward, y left, z up, in metres.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ._figure import SEQUENTIAL
from .record import refuse

_SIZES = {
    "box": "the three edges",
    "cylinder": "the radius and the length along z",
    "capsule": "the radius and the length along z from tip to tip",
    "sphere": "the radius",
}
_COUNTS = {"box": 3, "cylinder": 2, "capsule": 2, "sphere": 1}
ROLES = ("body", "device", "tool")


@dataclass(frozen=True)
class BodyLink:
    """A link as it is drawn.

    Attributes
    ----------
    name : str
        Shown beside its value.
    shape : str
        ``"box"``, ``"cylinder"``, ``"capsule"`` or ``"sphere"``.
    size_m : tuple of float
        Box: edges along x, y, z. Cylinder and capsule: radius and length along z, the length of a
        capsule from tip to tip. Sphere: radius.
    centre_m : tuple of float
        Centre of the shape in the frame of the link.
    rotation : tuple of float
        Quaternion (w, x, y, z) from the axes of the shape to those of the link.
    role : str
        ``"body"``, ``"device"`` (an exoskeleton) or ``"tool"``; the latter two have colours of their
        own where they carry no effort.
    """

    name: str
    shape: str
    size_m: tuple[float, ...]
    centre_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rotation: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    role: str = "body"

    def __post_init__(self) -> None:
        if not self.name:
            raise refuse("a link has no name: every link needs one", "name")
        if self.shape not in _SIZES:
            raise refuse(
                f"the shape {self.shape!r} of link {self.name!r} is none of {', '.join(_SIZES)}",
                "shape",
            )
        size = _vector(self.size_m, f"the size of link {self.name!r}", "size_m")
        if size.size != _COUNTS[self.shape] or not (size > 0).all():
            raise refuse(
                f"the size of link {self.name!r}, a {self.shape}, must be {_SIZES[self.shape]}, "
                f"all above zero, got {self.size_m!r}",
                "size_m",
            )
        if self.shape == "capsule" and size[1] < 2 * size[0]:
            raise refuse(
                f"the capsule {self.name!r} is {size[1]:g} m long, shorter than its diameter of "
                f"{2 * size[0]:g} m: use a sphere",
                "size_m",
            )
        if _vector(self.centre_m, f"the centre of link {self.name!r}", "centre_m").size != 3:
            raise refuse(f"the centre of link {self.name!r} must be x, y, z", "centre_m")
        turn = _vector(self.rotation, f"the rotation of link {self.name!r}", "rotation")
        if turn.size != 4 or not turn.any():
            raise refuse(
                f"the rotation of link {self.name!r} must be a quaternion w, x, y, z that is not "
                "all zero",
                "rotation",
            )
        if self.role not in ROLES:
            raise refuse(
                f"the role {self.role!r} of link {self.name!r} is none of {', '.join(ROLES)}",
                "role",
            )

    @property
    def half_extents_m(self) -> np.ndarray:
        """Half of the edges of the box around the shape, in the axes of the shape."""
        size = np.asarray(self.size_m, dtype=float)
        if self.shape == "box":
            return size / 2
        if self.shape == "sphere":
            return np.repeat(size, 3)
        return np.array([size[0], size[0], size[1] / 2])


@dataclass(frozen=True)
class BodyJoint:
    """A joint, drawn as a ball in the colour of its effort.

    Attributes
    ----------
    name : str
        Shown beside its value.
    link : str
        The link it is fixed to.
    at_m : tuple of float
        Its place in the frame of that link.
    radius_m : float
        Of the ball.
    """

    name: str
    link: str
    at_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    radius_m: float = 0.05


@dataclass(frozen=True)
class BodyForce:
    """A force that acts on the body, drawn as an arrow that starts where it acts.

    Attributes
    ----------
    name : str
        Shown in the legend.
    link : str
        The link it acts on.
    at_m : tuple of float
        Where it acts, in the frame of that link.
    """

    name: str
    link: str
    at_m: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False, repr=False)
class BodyScene:
    """A moving body and its effort: what :func:`draw` and :func:`write_page` show.

    Attributes
    ----------
    name : str
        The condition, such as ``"with the exoskeleton"``.
    links : sequence of BodyLink
        The body, and what it wears and carries.
    time_s : array, (frames,)
        Strictly increasing.
    position_m : array, (frames, links, 3)
        Origins of the links in the world. A link whose pose is NaN is not shown in that frame.
    rotation : array, (frames, links, 4)
        Quaternions (w, x, y, z) from the link to the world; they are normalised here.
    effort : array, (frames, links), optional
        What colours the links; NaN, shown grey, where it is not known.
    effort_sd : array, (frames, links), optional
        Its standard deviation.
    joints : sequence of BodyJoint, optional
        Balls to be coloured beside the links or in their place.
    joint_effort, joint_effort_sd : array, (frames, joints), optional
        As for the links, in the same unit.
    forces : sequence of BodyForce, optional
        Arrows.
    force_N : array, (frames, forces, 3), optional
        Along the axes of the world; NaN draws no arrow.
    overall : array, (frames,), optional
        One number a frame, drawn over time; the mean over links and joints when left out.
    overall_name : str
        What that number is.
    quantity, unit : str
        What the colours mean.

    Examples
    --------
    >>> scene = BodyScene("arm", [BodyLink("forearm", "capsule", (0.04, 0.3))], [0.0, 0.1],
    ...                   [[[0, 0, 1]], [[0, 0, 1.1]]], [[[1, 0, 0, 0]]] * 2, [[3.0], [5.0]])
    >>> scene
    BodyScene('arm': 2 frames of 1 link over 0.1 s, effort 3 to 5 N m)
    """

    name: str
    links: Sequence[BodyLink]
    time_s: Any
    position_m: Any
    rotation: Any
    effort: Any = None
    effort_sd: Any = None
    joints: Sequence[BodyJoint] = ()
    joint_effort: Any = None
    joint_effort_sd: Any = None
    forces: Sequence[BodyForce] = ()
    force_N: Any = None  # noqa: N815
    overall: Any = None
    overall_name: str = "mean"
    quantity: str = "effort"
    unit: str = "N m"

    def __post_init__(self) -> None:
        def put(name: str, value: Any) -> None:
            object.__setattr__(self, name, value)

        for name in ("links", "joints", "forces"):
            put(name, tuple(getattr(self, name)))
        if not self.links:
            raise refuse(f"the scene {self.name!r} has no links: give at least one", "links")
        _distinct([*self.links, *self.joints], "links")
        _distinct(self.forces, "forces")
        names = {link.name for link in self.links}
        for one in (*self.joints, *self.forces):
            if one.link not in names:
                raise refuse(
                    f"{one.name!r} stands on the link {one.link!r}, which the scene "
                    f"{self.name!r} does not have",
                    "joints" if isinstance(one, BodyJoint) else "forces",
                )
            if _vector(one.at_m, f"the place of {one.name!r}", "at_m").size != 3:
                raise refuse(f"the place of {one.name!r} must be x, y, z", "at_m")
        for joint in self.joints:
            if not joint.radius_m > 0:
                raise refuse(f"the radius of joint {joint.name!r} must be above zero", "radius_m")

        time = np.atleast_1d(np.asarray(self.time_s, dtype=float))
        if time.ndim != 1 or time.size == 0 or not np.isfinite(time).all():
            raise refuse("time_s must hold one finite number for each frame", "time_s")
        back = np.flatnonzero(np.diff(time) <= 0)
        if back.size:
            raise refuse(
                f"time_s must increase: frame {back[0] + 1} is not later than the one before it",
                "time_s",
            )
        put("time_s", _frozen(time))
        frames, links, joints = time.size, len(self.links), len(self.joints)
        link_names = [link.name for link in self.links]
        joint_names = [joint.name for joint in self.joints]

        put("position_m", _array(self.position_m, (frames, links, 3), "position_m", link_names))
        turns = _array(self.rotation, (frames, links, 4), "rotation", link_names)
        length = np.linalg.norm(turns, axis=-1, keepdims=True)
        zero = np.argwhere(length[..., 0] == 0)
        if zero.size:
            raise refuse(
                f"the quaternion of link {link_names[zero[0][1]]!r} in frame {zero[0][0]} is all "
                "zero: give NaN where the pose is not known",
                "rotation",
            )
        put("rotation", _frozen(turns / length))

        if self.effort is None and self.joint_effort is None:
            raise refuse("the scene has neither effort nor joint_effort: give one", "effort")
        if self.joint_effort is not None and not self.joints:
            raise refuse("joint_effort is given without joints: say where they are", "joints")
        for name, shape, columns in (
            ("effort", (frames, links), link_names),
            ("effort_sd", (frames, links), link_names),
            ("joint_effort", (frames, joints), joint_names),
            ("joint_effort_sd", (frames, joints), joint_names),
        ):
            if getattr(self, name) is not None:
                put(name, _array(getattr(self, name), shape, name, columns))
        for name in ("effort", "joint_effort"):
            deviation = getattr(self, name + "_sd")
            if deviation is None:
                continue
            if getattr(self, name) is None:
                raise refuse(f"{name}_sd is given without {name}", name + "_sd")
            if (deviation < 0).any():
                raise refuse(f"{name}_sd holds a negative standard deviation", name + "_sd")
        if (self.force_N is None) != (not self.forces):
            raise refuse("forces and force_N go together: give both or neither", "force_N")
        if self.force_N is not None:
            shape = (frames, len(self.forces), 3)
            put("force_N", _array(self.force_N, shape, "force_N", [f.name for f in self.forces]))
        if self.overall is not None:
            put("overall", _array(self.overall, (frames,), "overall", []))

    @property
    def frames(self) -> int:
        """Number of frames."""
        return int(self.time_s.size)

    @property
    def values(self) -> np.ndarray:
        """Effort of links, then of joints, (frames, links + joints); NaN where there is none."""
        links = (
            np.full((self.frames, len(self.links)), np.nan) if self.effort is None else self.effort
        )
        if not self.joints:
            return links
        balls = self.joint_effort
        if balls is None:
            balls = np.full((self.frames, len(self.joints)), np.nan)
        return np.hstack([links, balls])

    @property
    def series(self) -> np.ndarray:
        """One number for each frame: `overall`, or the mean of what is known in that frame."""
        if self.overall is not None:
            return self.overall
        values = self.values
        known = np.isfinite(values)
        count = known.sum(axis=1)
        total = np.where(known, values, 0.0).sum(axis=1)
        return np.where(count > 0, total / np.maximum(count, 1), np.nan)

    def frame_at(self, *, time_s: float) -> int:
        """The frame nearest to a time."""
        return int(np.abs(self.time_s - time_s).argmin())

    def hardest_frame(self) -> int:
        """The frame in which `series` is largest; the first when it is nowhere known."""
        series = self.series
        return int(np.nanargmax(series)) if np.isfinite(series).any() else 0

    def __repr__(self) -> str:
        low, high = _bounds(self.values)
        known = f"{low:.3g} to {high:.3g} {self.unit}" if np.isfinite(low) else "nowhere known"
        links = f"{len(self.links)} link{'s' if len(self.links) != 1 else ''}"
        span = self.time_s[-1] - self.time_s[0]
        return (
            f"BodyScene({self.name!r}: {self.frames} frame{'s' if self.frames != 1 else ''} of "
            f"{links} over {span:.3g} s, {self.quantity} {known})"
        )


def matching(scene: BodyScene, beside: BodyScene | None) -> list[BodyScene]:
    """The scenes shown together, or the reason why they cannot share one colour bar."""
    for given, name in ((scene, "scene"), (beside, "beside")):
        if not isinstance(given, BodyScene) and not (name == "beside" and given is None):
            raise refuse(f"{name} must be a BodyScene, got {type(given).__name__}", name)
    if beside is None:
        return [scene]
    if (scene.quantity, scene.unit) != (beside.quantity, beside.unit):
        raise refuse(
            f"{scene.name!r} shows {scene.quantity} in {scene.unit}, {beside.name!r} "
            f"{beside.quantity} in {beside.unit}: one colour bar cannot mean both",
            "beside",
        )
    return [scene, beside]


def colour_limits(
    scenes: Sequence[BodyScene], limits: tuple[float, float] | None
) -> tuple[float, float]:
    """Ends of the colour bar: those given, or round numbers around all but the rarest values.

    It starts at zero unless values are negative. One value in a thousand may lie beyond its end, so
    that a glitch of a single frame does not take the colours from the rest.
    """
    if limits is not None:
        pair = np.asarray(limits, dtype=float)
        if pair.shape != (2,) or not np.isfinite(pair).all() or not pair[0] < pair[1]:
            raise refuse(f"limits must be two numbers, the lower first, got {limits!r}", "limits")
        return float(pair[0]), float(pair[1])
    values = np.concatenate([one.values[np.isfinite(one.values)] for one in scenes])
    if values.size == 0:
        return 0.0, 1.0
    low, high = np.quantile(values, [0.001, 0.999])
    low = 0.0 if values.min() >= 0 else -_round_up(-low) if low < 0 else 0.0
    high = _round_up(high) if high > 0 else 0.0
    return (float(low), float(high)) if high > low else (float(low), float(low) + 1.0)


def colour_table(count: int = 256) -> np.ndarray:
    """The sequential map as (count, 3) sRGB from 0 to 1, straight in Oklab between its colours."""
    stops = np.array([[int(c[i : i + 2], 16) / 255 for i in (1, 3, 5)] for c in SEQUENTIAL])
    linear = np.where(stops <= 0.04045, stops / 12.92, ((stops + 0.055) / 1.055) ** 2.4)
    lab = np.cbrt(linear @ _TO_LMS.T) @ _TO_LAB.T
    at = np.linspace(0, len(stops) - 1, count)
    path = np.stack([np.interp(at, np.arange(len(stops)), lab[:, k]) for k in range(3)], axis=1)
    back = ((path @ np.linalg.inv(_TO_LAB).T) ** 3) @ np.linalg.inv(_TO_LMS).T
    back = np.clip(back, 0.0, 1.0)
    return np.where(back <= 0.0031308, 12.92 * back, 1.055 * back ** (1 / 2.4) - 0.055)


# B. Ottosson, "A perceptual color space for image processing", 2020: linear sRGB to cone responses,
# and their cube roots to lightness and two opponent colours.
_TO_LMS = np.array(
    [
        [0.4122214708, 0.5363325363, 0.0514459929],
        [0.2119034982, 0.6806995451, 0.1073969566],
        [0.0883024619, 0.2817188376, 0.6299787005],
    ]
)
_TO_LAB = np.array(
    [
        [0.2104542553, 0.7936177850, -0.0040720468],
        [1.9779984951, -2.4285922050, 0.4505937099],
        [0.0259040371, 0.7827717662, -0.8086757660],
    ]
)


def rotation_matrix(quaternion: Any) -> np.ndarray:
    """(..., 3, 3) from (..., 4) quaternions w, x, y, z of any length but zero."""
    q = np.asarray(quaternion, dtype=float)
    w, x, y, z = np.moveaxis(q / np.linalg.norm(q, axis=-1, keepdims=True), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def z_onto(axis: Any) -> tuple[float, float, float, float]:
    """The shortest turn that puts z onto an axis: the rotation of a cylinder that lies along it."""
    x, y, z = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    if z < -1 + 1e-12:
        return 0.0, 1.0, 0.0, 0.0
    q = np.array([1 + z, -y, x, 0.0])
    w, x, y, z = q / np.linalg.norm(q)
    return float(w), float(x), float(y), float(z)


def floor_height(scene: BodyScene) -> float:
    """Height of the lowest point of the body over all frames, in metres; 0 when no pose is known."""
    turns = rotation_matrix(scene.rotation)
    lowest = []
    for k, link in enumerate(scene.links):
        if link.role != "body":
            continue
        axes = turns[:, k] @ rotation_matrix(link.rotation)
        centre = scene.position_m[:, k] + turns[:, k] @ np.asarray(link.centre_m, dtype=float)
        reach = np.abs(axes[:, 2]) @ link.half_extents_m
        height = centre[:, 2] - reach
        lowest.append(height[np.isfinite(height)])
    found = np.concatenate(lowest) if lowest else np.empty(0)
    return float(found.min()) if found.size else 0.0


def _round_up(value: float) -> float:
    step = 10.0 ** np.floor(np.log10(value))
    for nice in (1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10):
        if value <= nice * step * (1 + 1e-9):
            return float(nice * step)
    return float(10 * step)


def _bounds(values: np.ndarray) -> tuple[float, float]:
    known = values[np.isfinite(values)]
    return (float(known.min()), float(known.max())) if known.size else (np.nan, np.nan)


def _vector(value: Any, what: str, argument: str) -> np.ndarray:
    try:
        out = np.atleast_1d(np.asarray(value, dtype=float))
    except (TypeError, ValueError) as failure:
        raise refuse(f"{what} must be numbers, got {value!r}", argument) from failure
    if out.ndim != 1 or not np.isfinite(out).all():
        raise refuse(f"{what} must be finite numbers, got {value!r}", argument)
    return out


def _array(value: Any, shape: tuple[int, ...], name: str, columns: list[str]) -> np.ndarray:
    """A read-only copy of the shape asked for; NaN may be in it, infinity not."""
    try:
        out = np.array(value, dtype=float)
    except (TypeError, ValueError) as failure:
        raise refuse(f"{name} must be an array of shape {shape}", name) from failure
    if out.shape != shape:
        raise refuse(f"{name} must have the shape {shape}, got {out.shape}", name)
    endless = np.argwhere(np.isinf(out))
    if endless.size:
        where = f" of {columns[endless[0][1]]!r}" if columns else ""
        raise refuse(
            f"{name}{where} is infinite in frame {endless[0][0]}: give NaN where it is not known",
            name,
        )
    return _frozen(out)


def _frozen(array: np.ndarray) -> np.ndarray:
    array.setflags(write=False)
    return array


def _distinct(named: Sequence[Any], argument: str) -> None:
    seen = set()
    for one in named:
        if one.name in seen:
            raise refuse(f"the name {one.name!r} stands twice: give each its own", argument)
        seen.add(one.name)
