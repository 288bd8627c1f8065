"""Before an estimate: do the contacts carry the model's weight where the model stands?"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._call import ArgumentError
from .body import Motion

if TYPE_CHECKING:
    from .torques import SensorSuite

Array = NDArray[np.float64]

_MOST_FRAMES = 200  # of a recording, evenly


@dataclass(frozen=True)
class StartCheck:
    """Whether contacts and model fit together.

    Attributes
    ----------
    carried_kg, model_kg : float
        Mass that the contacts carry, from their vertical force and the motion, and the model's.
    pressure_m, centre_m : (2,) array
        Centre of pressure on the floor and centre of mass above it, world x and y, mean.
    findings : tuple of str
        What does not fit, a sentence each; empty when all is well.
    """

    carried_kg: float
    model_kg: float
    pressure_m: Array
    centre_m: Array
    findings: tuple[str, ...]

    def summary(self) -> str:
        """In words."""
        apart = float(np.linalg.norm(self.pressure_m - self.centre_m))
        lines = [
            f"contacts carry {self.carried_kg:.2f} kg of {self.model_kg:.2f} kg, centre of pressure "
            f"{100 * apart:.1f} cm from below the centre of mass"
        ]
        return "\n".join([*lines, *self.findings])


def start_check(
    suite: SensorSuite, motion: Motion, measured: ArrayLike, *, mass_limit_kg: float = 0.5,
    pressure_limit_m: float = 0.08,
) -> StartCheck:  # fmt: skip
    """Compare measured contacts with the model before torques are trusted.

    Finds a wrong mass (or a load that nobody told), a contact that pulls at the floor or is upside
    down, two contacts whose readings are exchanged, and a centre of pressure that is not below the
    centre of mass. Frames in which a contact is missing do not count.

    Parameters
    ----------
    suite : SensorSuite
    motion : Motion
        Slow: with `acceleration` given, the motion of the centre of mass is taken into account.
    measured : (frames, rows) array
    mass_limit_kg, pressure_limit_m : float
        Differences that are said.
    """
    y = np.atleast_2d(np.asarray(measured, dtype=float))
    contacts = _contacts(suite)
    rows = np.concatenate([np.arange(start, start + 6) for _, start in contacts])
    there = np.flatnonzero(np.isfinite(y[:, rows]).all(axis=1) & _has_state(motion, len(y)))
    if not there.size:
        raise ArgumentError(
            "no frame has a state and readings of all contacts",
            status="ULNA_ERROR_ARGUMENT",
            argument="measured",
        )
    chosen = there[:: max(1, len(there) // _MOST_FRAMES)]
    motion, y = _frames(motion, chosen), y[chosen]
    body = suite.body
    centroid = body.centroid(motion)
    poses = body.poses(motion)
    wrenches = {s.name: _in_world(s, y[:, start : start + 6], poses, body.links)
                for s, start in contacts}  # fmt: skip
    total = sum(wrenches.values())
    lift = body.gravity_m_s2 + centroid.momentum_rate[:, 2] / body.mass_kg
    carried = float(np.mean(total[:, 2]) / np.mean(lift))
    floor = min(float(np.min(poses[:, body.links.index(s.place), 2])) for s, _ in contacts)
    pressure = _pressure(total.mean(axis=0), floor)
    centre = centroid.position_m[:, :2].mean(axis=0)

    findings = []
    for sensor, _ in contacts:
        force = float(wrenches[sensor.name][:, 2].mean())
        if force < -0.05 * body.mass_kg * body.gravity_m_s2:
            findings.append(
                f"{sensor.name} is pulled up by {-force:.0f} N: it is upside down, or its sign is "
                "that of the force on the floor"
            )
    exchanged = _exchanged(suite, motion, y, contacts)
    if exchanged:
        findings.append(
            f"the readings of {exchanged[0]} and {exchanged[1]} fit the motion much better when "
            "they are exchanged"
        )
    if abs(carried - body.mass_kg) > mass_limit_kg:
        findings.append(
            f"the contacts carry {carried:.2f} kg, the model has {body.mass_kg:.2f} kg: "
            f"{abs(carried - body.mass_kg):.2f} kg are {'missing in' if carried > body.mass_kg else 'too much on'} "
            "the model, or something else is touched"
        )
    apart = float(np.linalg.norm(pressure - centre))
    if apart > pressure_limit_m:
        findings.append(
            f"the centre of pressure is {100 * apart:.0f} cm from below the centre of mass"
        )
    return StartCheck(carried, body.mass_kg, pressure, centre, tuple(findings))


def _contacts(suite: SensorSuite) -> list[tuple[Any, int]]:
    found = []
    for sensor in suite.sensors:
        if sensor.kind == "external_wrench":
            found.append((sensor, suite.row(sensor.name)))
    if not found:
        raise ArgumentError(
            "the suite has no external wrench to check",
            status="ULNA_ERROR_ARGUMENT",
            argument="suite",
        )
    return found


def _has_state(motion: Motion, frames: int) -> NDArray[np.bool_]:
    good = np.ones(frames, dtype=bool)
    for value in vars(motion).values():
        if value is not None:
            array = np.atleast_2d(np.asarray(value, dtype=float))
            if len(array) != frames:
                raise ArgumentError(
                    f"the motion has {len(array)} frames, measured has {frames}",
                    status="ULNA_ERROR_ARGUMENT",
                    argument="measured",
                )
            good &= np.isfinite(array).all(axis=1)
    return good


def _frames(motion: Motion, chosen: NDArray[np.int64]) -> Motion:
    return Motion(
        **{
            name: None if value is None else np.atleast_2d(np.asarray(value, dtype=float))[chosen]
            for name, value in vars(motion).items()
        }
    )


def _in_world(sensor: Any, wrench: Array, poses: Array, links: tuple[str, ...]) -> Array:
    """Force, and moment about the world's origin, world axes."""
    pose = poses[:, links.index(sensor.place)]
    w, v = pose[:, 3], pose[:, 4:]

    def turned(x: Array) -> Array:
        t = 2.0 * np.cross(v, x)
        return x + w[:, None] * t + np.cross(v, t)

    own = np.asarray(sensor.orientation, dtype=float).reshape(3, 3)
    force, moment = wrench[:, :3] @ own.T, wrench[:, 3:] @ own.T
    place = np.broadcast_to(np.asarray(sensor.position_m, dtype=float), force.shape)
    if sensor.frame == "link":
        force, moment = turned(force), turned(moment)
    if sensor.frame != "world":
        place = pose[:, :3] + turned(place)
    return np.hstack([force, moment + np.cross(place, force)])


def _pressure(wrench: Array, floor: float) -> Array:
    """Where on the floor a wrench (about the world's origin) has no horizontal moment."""
    force, moment = wrench[:3], wrench[3:] - np.cross([0.0, 0.0, floor], wrench[:3])
    if abs(force[2]) < 1e-6:
        return np.full(2, np.nan)
    return np.array([-moment[1], moment[0]]) / force[2]


def _exchanged(
    suite: SensorSuite, motion: Motion, y: Array, contacts: list[tuple[Any, int]]
) -> tuple[str, str] | None:
    """The two contacts of which exchanged readings lower what the balance lacks by half."""
    from .torques import estimate_torques

    def lacking(values: Array) -> float:
        return float(np.mean(estimate_torques(suite, motion, values, deviations=False).balance_nis))

    best, pair = 0.5 * lacking(y), None
    for (a, at), (b, bt) in combinations(contacts, 2):
        swapped = y.copy()
        swapped[:, at : at + 6], swapped[:, bt : bt + 6] = (
            y[:, bt : bt + 6].copy(),
            y[:, at : at + 6].copy(),
        )
        now = lacking(swapped)
        if now < best and best > 6.0:
            best, pair = now, (a.name, b.name)
    return pair
