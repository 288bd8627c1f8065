"""Before an estimate: do the contacts carry the model's weight where the model stands?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .body import Motion
from .record import Finding, refuse

if TYPE_CHECKING:
    from .torques import SensorSuite

Array = NDArray[np.float64]

_MOST_FRAMES = 1000  # of a recording, evenly
# Odds of exchanged contacts, as a logarithm, from which they are named.
_DECISIVE = 5.0
_NEAR = 0.3
# What a model's balance may lack all the time without a wrong sensor: N, and m of the centre of mass.
_CONSTANT_FORCE_N = 5.0
_CONSTANT_OFFSET_M = 0.02
_BLOCKS = 20


@dataclass(frozen=True)
class StartCheck:
    """Whether contacts and model fit together.

    Attributes
    ----------
    carried_kg, model_kg : float
        Mass that the contacts carry, from their vertical force and the motion, and the model's.
    pressure_m, centre_m : (2,) array
        Centre of pressure on the floor and centre of mass above it, world x and y, mean.
    issues : tuple of Finding
        What does not fit, and notes on what could not be told; empty when all is well.
    """

    carried_kg: float
    model_kg: float
    pressure_m: Array
    centre_m: Array
    issues: tuple[Finding, ...]

    @property
    def findings(self) -> tuple[str, ...]:
        """What does not fit, a sentence each, without notes."""
        return tuple(issue.message for issue in self.issues if issue.severity != "note")

    def summary(self) -> str:
        """In words."""
        apart = float(np.linalg.norm(self.pressure_m - self.centre_m))
        lines = [
            f"contacts carry {self.carried_kg:.2f} kg of {self.model_kg:.2f} kg, centre of pressure "
            f"{100 * apart:.1f} cm from below the centre of mass"
        ]
        return "\n".join([*lines, *(issue.message for issue in self.issues)])


def start_check(
    suite: SensorSuite, motion: Motion, measured: ArrayLike, *, mass_limit_kg: float = 0.5,
    pressure_limit_m: float = 0.08, contacts: Sequence[str] | None = None,
) -> StartCheck:  # fmt: skip
    """Compare measured contacts with the model before torques are trusted.

    Finds a wrong mass (or a load that nobody told), a contact that pulls at the floor or is upside
    down, two contacts whose readings are exchanged, and a centre of pressure that is not below the
    centre of mass. Frames in which a contact is missing do not count.

    Exchanged contacts show in the balance only by what differs between them: the load, and how it
    moves from one to the other. With the load shared equally and at rest nothing tells them apart,
    which is said as a note; feet that are both pushed outward are then named, because legs that carry
    a weight are pushed inward.

    Parameters
    ----------
    suite : SensorSuite
    motion : Motion
        With `acceleration` and `base_acceleration` given, the motion of the centre of mass is taken
        into account.
    measured : (frames, rows) array
    mass_limit_kg, pressure_limit_m : float
        Differences that are said.
    contacts : sequence of str, optional
        Sensors that stand on the floor; all external wrenches unless given. The others, such as those
        of a worn device, only add to what is carried.
    """
    y = np.atleast_2d(np.asarray(measured, dtype=float))
    wrenched = _wrenches(suite)
    chosen = [s.name for s, _ in wrenched] if contacts is None else list(contacts)
    unknown = set(chosen) - {s.name for s, _ in wrenched}
    if unknown:
        raise refuse(f"there is no external wrench {sorted(unknown)[0]!r}", "contacts")
    rows = np.concatenate([np.arange(start, start + 6) for _, start in wrenched])
    there = np.flatnonzero(np.isfinite(y[:, rows]).all(axis=1) & _has_state(motion, len(y)))
    if not there.size:
        raise refuse("no frame has a state and readings of all contacts", "measured")
    kept = there[:: max(1, len(there) // _MOST_FRAMES)]
    motion, y = _frames(motion, kept), y[kept]
    body = suite.body
    weight = body.mass_kg * body.gravity_m_s2
    centroid = body.centroid(motion)
    poses = body.poses(motion)
    wrenches = {s.name: in_world(s, y[:, start : start + 6], poses, body.links)
                for s, start in wrenched}  # fmt: skip
    floor = [(s, start) for s, start in wrenched if s.name in chosen]
    total = sum(wrenches.values())
    lift = body.gravity_m_s2 + centroid.momentum_rate[:, 2] / body.mass_kg
    carried = float(np.mean(total[:, 2]) / np.mean(lift))
    height = min(
        (float(np.min(poses[:, body.links.index(s.place), 2])) for s, _ in floor), default=0.0
    )
    pressure = _pressure(total.mean(axis=0), height)
    centre = centroid.position_m[:, :2].mean(axis=0)

    issues = []
    for sensor, _ in floor:
        force = float(wrenches[sensor.name][:, 2].mean())
        if force < -0.05 * weight:
            issues.append(
                _issue("error", "upside_down", sensor.name,
                       f"{sensor.name} is pulled up by {-force:.0f} N: it is upside down, or its sign "
                       "is that of the force on the floor")
            )  # fmt: skip
    if not any(issue.code == "upside_down" for issue in issues):
        for pair in combinations(floor, 2):
            issues += _exchanged(suite, motion, y, pair, wrenches, poses, weight)
    if abs(carried - body.mass_kg) > mass_limit_kg:
        more = carried > body.mass_kg
        issues.append(
            _issue("error", "wrong_mass", "",
                   f"the contacts carry {carried:.2f} kg, the model has {body.mass_kg:.2f} kg: "
                   f"{abs(carried - body.mass_kg):.2f} kg are "
                   f"{'missing in' if more else 'too much on'} the model, or something else is touched")
        )  # fmt: skip
    apart = float(np.linalg.norm(pressure - centre))
    if apart > pressure_limit_m:
        issues.append(
            _issue("warning", "pressure_apart", "",
                   f"the centre of pressure is {100 * apart:.0f} cm from below the centre of mass")
        )  # fmt: skip
    return StartCheck(carried, body.mass_kg, pressure, centre, tuple(issues))


def _issue(severity: str, code: str, channel: str, message: str) -> Finding:
    return Finding(severity, code, channel, 0, 0, message)


def _wrenches(suite: SensorSuite) -> list[tuple[Any, int]]:
    """Measured external wrenches with their first row."""
    found = [(s, suite.row(s.name)) for s in suite.sensors if s.kind == "external_wrench"]
    if not found:
        raise refuse("the suite has no external wrench to check", "suite")
    return found


def _has_state(motion: Motion, frames: int) -> NDArray[np.bool_]:
    good = np.ones(frames, dtype=bool)
    for value in vars(motion).values():
        if value is not None:
            array = np.atleast_2d(np.asarray(value, dtype=float))
            if len(array) != frames:
                raise refuse(
                    f"the motion has {len(array)} frames, measured has {frames}", "measured"
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


def in_world(sensor: Any, wrench: Array, poses: Array, links: tuple[str, ...]) -> Array:
    """Force, and moment about the world's origin, world axes."""
    pose = poses[:, links.index(sensor.place)]
    own = np.asarray(sensor.orientation, dtype=float).reshape(3, 3)
    force, moment = wrench[:, :3] @ own.T, wrench[:, 3:] @ own.T
    place = np.broadcast_to(np.asarray(sensor.position_m, dtype=float), force.shape)
    if sensor.frame == "link":
        force, moment = turned(pose, force), turned(pose, moment)
    if sensor.frame != "world":
        place = pose[:, :3] + turned(pose, place)
    return np.hstack([force, moment + np.cross(place, force)])


def _pressure(wrench: Array, floor: float) -> Array:
    """Where on the floor a wrench (about the world's origin) has no horizontal moment."""
    force, moment = wrench[:3], wrench[3:] - np.cross([0.0, 0.0, floor], wrench[:3])
    if abs(force[2]) < 1e-6:
        return np.full(2, np.nan)
    return np.array([-moment[1], moment[0]]) / force[2]


def turned(pose: Array, x: ArrayLike) -> Array:
    """Vectors of a link in the world's axes, by its poses (frames, 7)."""
    w, v = pose[:, 3], pose[:, 4:]
    x = np.broadcast_to(np.asarray(x, dtype=float), (len(pose), 3))
    t = 2.0 * np.cross(v, x)
    return np.asarray(x + w[:, None] * t + np.cross(v, t))


def _exchanged(
    suite: SensorSuite,
    motion: Motion,
    y: Array,
    pair: tuple[tuple[Any, int], tuple[Any, int]],
    wrenches: dict[str, Array],
    poses: Array,
    weight: float,
) -> list[Finding]:
    """Whether two contacts have each other's readings, by what the exchange does to the balance.

    Exchanging changes what the balance lacks, r, by a known g. Where the readings are right, r does
    not depend on g; where they are exchanged, r holds -g. The share of -g in r is a regression: its
    fluctuations against each other, with an error from blocks of the recording, and their means, which
    a model may miss by its centre of mass.
    """
    (a, at), (b, bt) = pair
    swapped = y.copy()
    swapped[:, at : at + 6], swapped[:, bt : bt + 6] = y[:, bt : bt + 6], y[:, at : at + 6]
    lack, other = (_lacking(suite, motion, values) for values in (y, swapped))
    g = other - lack
    allowed = np.array([_CONSTANT_FORCE_N] * 3 + [_CONSTANT_OFFSET_M * weight] * 3)
    precision, product = _slope(lack.mean(axis=0), g.mean(axis=0), allowed)
    moving, change = lack - lack.mean(axis=0), g - g.mean(axis=0)
    spread = np.minimum(moving.std(axis=0), (other - other.mean(axis=0)).std(axis=0)) + 1e-6
    share, error = _regression(moving / spread, change / spread)
    if np.isfinite(error):
        precision, product = precision + error**-2, product + share * error**-2
    # Log odds of a share of one against none.
    odds = product - 0.5 * precision
    # Noise of the contacts alone is in both r and g, and pretends a share of one half.
    share = product / precision if precision > 0 else 0.5
    if odds > _DECISIVE and share > 1 - _NEAR:
        return [
            _issue("error", "exchanged", a.name,
                   f"the readings of {a.name} and {b.name} fit the motion much better when they are "
                   "exchanged")
        ]  # fmt: skip
    if odds < -_DECISIVE and share < _NEAR:
        return []
    across = (
        poses[:, suite.body.links.index(b.place)] - poses[:, suite.body.links.index(a.place)]
    )[:, :3].mean(axis=0) * [1, 1, 0]
    across /= max(float(np.linalg.norm(across)), 1e-9)
    inward = [wrenches[a.name][:, :3] @ across, -(wrenches[b.name][:, :3] @ across)]
    if all(shear.mean() < -max(3.0, 3.0 * _error_of_mean(shear)) for shear in inward):
        return [
            _issue("warning", "exchanged", a.name,
                   f"{a.name} and {b.name} are both pushed outward, which legs that carry a weight are "
                   "not: their readings may be exchanged; the balance cannot tell, since both carry the "
                   "same load")
        ]  # fmt: skip
    return [
        _issue("note", "not_told_apart", a.name,
               f"{a.name} and {b.name} carry the same load all the time, so nothing would tell if their "
               "readings were exchanged: shift the weight to one foot once in a recording")
    ]  # fmt: skip


def _lacking(suite: SensorSuite, motion: Motion, y: Array) -> Array:
    from .torques import estimate_torques

    return estimate_torques(suite, motion, y, deviations=False).residual


def _slope(r: Array, g: Array, deviation: Array) -> tuple[float, float]:
    """Information about the share of -g in r, and that times the share."""
    return float(np.sum((g / deviation) ** 2)), float(-np.sum(g * r / deviation**2))


def _regression(r: Array, g: Array) -> tuple[float, float]:
    """Share of -g in r over all components, and its error by leaving out blocks."""
    parts = [np.array([-(r[k] * g[k]).sum(), (g[k] ** 2).sum()])
             for k in np.array_split(np.arange(len(r)), _BLOCKS) if len(k)]  # fmt: skip
    total = np.sum(parts, axis=0)
    if len(parts) < 4 or total[1] <= 1e-12 * max(1.0, float((r**2).sum())):
        return 0.0, np.inf
    left = np.array([(total[0] - n) / max(total[1] - d, 1e-300) for n, d in parts])
    count = len(parts)
    error = float(np.sqrt((count - 1) ** 2 / count) * left.std(ddof=1))
    # Errors of the model follow the sway as well: no share is known better than to a tenth.
    return float(total[0] / total[1]), max(error, 0.1)


def _error_of_mean(values: Array) -> float:
    blocks = [block.mean() for block in np.array_split(values, _BLOCKS) if len(block)]
    return float(np.std(blocks) / np.sqrt(max(len(blocks) - 1, 1)))
