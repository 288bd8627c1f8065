"""A capture's body and torques as a scene: what pictures and pages of it show."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ._body_scene import BodyForce, BodyLink, BodyScene, z_onto
from ._capture_checks import pressure_in_link
from ._capture_motion import poses_of
from ._start_check import in_world
from .body import Link
from .motion import quaternions
from .record import refuse

if TYPE_CHECKING:
    from .capture import RecordedTorques

Array = NDArray[np.float64]

_THINNEST_M = 0.01


def scene_of(
    found: RecordedTorques, *, name: str = "", rate_hz: float = 30.0, per_kg: bool = False
) -> BodyScene:
    """The body over time, each link in the colour of the torque at the joint that carries it.

    The base, which no joint carries, has the largest of the joints that it carries itself.
    """
    if not rate_hz > 0:
        raise refuse("rate_hz must be positive", "rate_hz")
    frames = found.frames
    step = max(1, round(frames.rate_hz / rate_hz))
    some = frames.select(slice(None, None, step))
    links = found.body.describe()
    shown = [k for k, link in enumerate(links) if link.mass_kg > 0]
    poses = poses_of(found.body, some.motion)
    torque, spread = (
        part[::step] for part in (found.torques.torque, found.torques.torque_deviation)
    )
    scale = 1.0 / found.body.mass_kg if per_kg else 1.0
    effort, deviation = _effort(links, shown, found.body.joints, scale * torque, scale * spread)
    forces, newton = _forces(found, some, poses)
    with np.errstate(invalid="ignore"):
        whole = scale * np.linalg.norm(torque, axis=1)
    return BodyScene(
        name or ", ".join(frames.sources) or "body",
        [_drawn(links[k]) for k in shown],
        some.time_s,
        poses[:, shown, :3],
        poses[:, shown, 3:],
        effort,
        effort_sd=deviation,
        forces=forces,
        force_N=newton if forces else None,
        overall=whole,
        overall_name="norm of all torques",
        quantity="joint torque",
        unit="N m/kg" if per_kg else "N m",
    )


def _drawn(link: Link) -> BodyLink:
    """The link's shape; one without gets the box of its inertia."""
    if link.shape in ("box", "sphere", "cylinder"):
        count = {"box": 3, "cylinder": 2, "sphere": 1}[link.shape]
        turn = z_onto(link.shape_axis) if link.shape == "cylinder" else (1.0, 0.0, 0.0, 0.0)
        size = tuple(float(v) for v in link.shape_size_m[:count])
        return BodyLink(link.name, link.shape, size, _three(link.shape_centre_m), turn)
    moments, axes = np.linalg.eigh(link.inertia_kg_m2)
    if np.linalg.det(axes) < 0:
        axes[:, 0] *= -1
    # Of a uniform box: m (b^2 + c^2) / 12 about the axis of a.
    square = 6.0 * (moments.sum() - 2.0 * moments) / link.mass_kg
    edges = np.maximum(np.sqrt(np.maximum(square, 0.0)), _THINNEST_M)
    w, x, y, z = (float(v) for v in quaternions(axes[None])[0])
    return BodyLink(link.name, "box", tuple(edges.tolist()), _three(link.centre_m), (w, x, y, z))


def _three(vector: Array) -> tuple[float, float, float]:
    x, y, z = (float(v) for v in vector)
    return x, y, z


def _effort(
    links: list[Link], shown: list[int], joints: tuple[str, ...], torque: Array, spread: Array
) -> tuple[Array, Array]:
    index = {link.name: k for k, link in enumerate(links)}
    hinges: dict[int, list[int]] = {}
    carried: dict[int, list[int]] = {}
    for k in shown:
        at, own = k, []
        while links[at].parent is not None:
            joint = links[at].joint
            own += [joints.index(joint)] if joint is not None else []
            at = index[str(links[at].parent)]
            if at in shown:
                carried.setdefault(at, []).append(k)
                break
        hinges[k] = own
    size, deviation = {}, {}
    for k in shown:
        part, error = torque[:, hinges[k]], spread[:, hinges[k]]
        length = np.linalg.norm(part, axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.where(length[:, None] > 0, part / length[:, None], 0.0)
        size[k] = length if hinges[k] else np.full(len(torque), np.nan)
        deviation[k] = np.sqrt(np.sum((share * error) ** 2, axis=1))
    for k in shown:
        if not hinges[k] and carried.get(k):
            around = np.stack([size[c] for c in carried[k]], axis=1)
            worst = np.argmax(np.nan_to_num(around), axis=1)
            rows = np.arange(len(around))
            size[k] = around[rows, worst]
            deviation[k] = np.stack([deviation[c] for c in carried[k]], axis=1)[rows, worst]
    return (np.stack([size[k] for k in shown], axis=1),
            np.stack([deviation[k] for k in shown], axis=1))  # fmt: skip


def _forces(found: RecordedTorques, some: Any, poses: Array) -> tuple[list[BodyForce], Array]:
    """Arrows of the ground, and of what a device does to the arms."""
    suite = some.suite
    forces, newton = [], []
    for sensor in suite.sensors:
        worn = sensor.name.startswith("device ") and sensor.place != found.body.links[0]
        if sensor.name not in some.contacts and not worn:
            continue
        row = suite.row(sensor.name)
        wrench = in_world(sensor, some.measured[:, row : row + 6], poses, found.body.links)
        at = np.zeros(3)
        if sensor.name in some.contacts:
            pressure = pressure_in_link(some, sensor.name, poses)
            at = pressure.mean(axis=0) if len(pressure) else at
        forces.append(BodyForce(sensor.name, sensor.place, _three(at)))
        newton.append(wrench[:, :3])
    return forces, np.stack(newton, axis=1) if newton else np.zeros((len(poses), 0, 3))


def as_scene(body: Any, name: str = "") -> BodyScene:
    """A scene as it is, or that of a capture's torques."""
    if isinstance(body, BodyScene):
        return body
    if not hasattr(body, "scene"):
        raise refuse(
            f"a {type(body).__name__} cannot be drawn: give what recorded_torques returned", "body"
        )
    scene = body.scene(name=name)
    assert isinstance(scene, BodyScene)
    return scene


def write_picture(
    found: RecordedTorques, path: Any, *, time_s: float | None, **drawing: Any
) -> Path:
    """The body at a time as an image file."""
    from . import plot

    target = Path(path)
    if target.is_dir():
        raise refuse(f"{str(path)!r} is a folder: give the name of the image to write", "path")
    target.parent.mkdir(parents=True, exist_ok=True)
    with plot.style():
        figure = plot.body_effort(found, time_s=time_s, **drawing)[0, 0].figure
        figure.savefig(target)
    import matplotlib.pyplot as plt

    plt.close(figure)
    return target
