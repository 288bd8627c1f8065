"""What does not fit in a capture: contacts, sensors on other links, sensors that say what cannot be."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

import numpy as np

from ._capture_readings import aligned
from ._start_check import in_world, turned
from .record import ArgumentError, Finding
from .torques import ROWS, SensorFit, SensorSuite, StartCheck, estimate_torques, start_check

if TYPE_CHECKING:
    from .capture import CapturedFrames

# Another link explains a sensor so much better than its own, and the own one leaves so much.
_BETTER = 2.0
_LEFT_RAD_S = 0.15
_LEFT_M_S2 = 0.7
# Innovations so many times as large as expected are worth a line, and a warning.
_LARGER = 3.0
_MUCH_LARGER = 8.0
# Beyond the sole by so much, a centre of pressure is none.
_SOLE_MARGIN_M = 0.03
_LOADED_N = 50.0  # below it a contact has no centre of pressure
_INVERSE = np.array([1.0, 1.0, 1.0, 1.0, -1.0, -1.0, -1.0])  # turns a pose's quaternion round
_MOST_APART = 5
_FEWEST_OF_KIND = 4
_UNCHECKED = 0.02  # a smaller innovation is that of a row that nothing checks
_FIT_STEPS = 30
_FIT_FRAMES = 300


def look_at_unknowns(frames: CapturedFrames) -> list[Finding]:
    """What the sensors cannot tell at all, at a frame in which most of them read."""
    if not frames.contacts and not frames.setup.touches:
        words = (
            f"no contact is measured, so that nothing carries the {frames.setup.body.mass_kg:.4g} kg: "
            "torques between the base and the ground are wrong"
        )
        return [Finding("error", "no_contact", "", 0, 0, words)]
    best = int(np.argmax(np.isfinite(frames.measured).sum(axis=1)))
    one = frames.select(slice(best, best + 1))
    told = frames.suite.identifiability(one.motion, one.measured)
    if told.complete:
        return []
    return [Finding("warning", "not_determined", "", best, 1, " ".join(told.summary().split()))]


def look_at_contacts(frames: CapturedFrames) -> tuple[StartCheck | None, list[Finding]]:
    """The check of contacts against the model; none where no frame has all of them."""
    if not frames.contacts:
        return None, []
    try:
        check = start_check(frames.suite, frames.motion, frames.measured, contacts=frames.contacts)
    except ArgumentError as failure:
        words = f"the contacts cannot be checked: {failure}"
        return None, [Finding("warning", "contacts_not_checked", "", 0, 0, words)]
    return check, list(check.issues)


def pressure_in_link(frames: CapturedFrames, name: str, poses: np.ndarray) -> np.ndarray:
    """Centre of pressure of a contact in its link, at the height of its sole, (loaded frames, 3)."""
    body, suite = frames.setup.body, frames.suite
    sensor = next(s for s in suite.sensors if s.name == name)
    row = suite.row(name)
    wrench = in_world(sensor, frames.measured[:, row : row + 6], poses, body.links)
    index = body.links.index(sensor.place)
    link = body.describe()[index]
    with np.errstate(invalid="ignore"):
        loaded = np.isfinite(poses[:, index, 0]) & (wrench[:, 2] > _LOADED_N)
    pose, force = poses[loaded, index], wrench[loaded, :3]
    below = np.array([0.0, 0.0, link.shape_centre_m[2] - 0.5 * link.shape_size_m[2]])
    sole = pose[:, :3] + turned(pose, below)
    moment = wrench[loaded, 3:] - np.cross(sole, force)
    away = np.stack([-moment[:, 1], moment[:, 0], 0 * force[:, 2]], axis=1) / force[:, 2:]
    return np.asarray(below + turned(pose * _INVERSE, away))


def look_at_soles(frames: CapturedFrames) -> list[Finding]:
    """Centres of pressure that are not under their link, where the model knows its box."""
    body = frames.setup.body
    poses = body.poses(frames.motion)
    found = []
    for name in frames.contacts:
        place = next(s.place for s in frames.suite.sensors if s.name == name)
        link = body.describe()[body.links.index(place)]
        pressure = pressure_in_link(frames, name, poses)
        if link.shape != "box" or not len(pressure):
            continue
        ahead, left, _ = np.mean(pressure, axis=0) - link.shape_centre_m
        reach = 0.5 * link.shape_size_m
        # The toes of the human model are links of their own, ahead of the foot.
        toes = sum(t.shape_size_m[0] for t in body.describe() if t.parent == link.name)
        beyond = [ahead - reach[0] - toes, -reach[0] - ahead, abs(left) - reach[1]]
        if max(beyond) > _SOLE_MARGIN_M:
            found.append(
                Finding("warning", "pressure_beyond_sole", name, 0, 0,
                        f"the centre of pressure of {name} lies {100 * ahead:.0f} cm ahead and "
                        f"{100 * left:.0f} cm to the left of the middle of the sole, outside of it: its "
                        "place or axes on the foot are wrong")
            )  # fmt: skip
    return found


def look_at_imus(frames: CapturedFrames) -> list[Finding]:
    """Inertial sensors whose readings are those of another link.

    A rotation between sensor and link is free, as the mount may be anything: what is left after the
    best one tells which link the sensor rides on.
    """
    imus = [s for s in frames.suite.sensors if s.kind == "accelerometer" and s.frame == "link"]
    links = list(dict.fromkeys(s.place for s in imus))
    felt = {link: frames.setup.body.sensor(frames.motion, link=link) for link in links}
    found = []
    for sensor in imus:
        turn_rate = frames.gyroscopes.get(sensor.name)
        if turn_rate is not None and np.isfinite(turn_rate).any():
            sensed, which, limit, unit = turn_rate, 1, _LEFT_RAD_S, "rad/s"
        else:
            row = frames.suite.row(sensor.name)
            sensed, which, limit, unit = frames.measured[:, row : row + 3], 2, _LEFT_M_S2, "m/s^2"
        left = {link: aligned(sensed, felt[link][which])[1] for link in links}
        own = left[sensor.place]
        best = min(left, key=lambda link: np.inf if np.isnan(left[link]) else left[link])
        if own > limit and own > _BETTER * left[best]:
            found.append(
                Finding("error", "wrong_segment", sensor.name, 0, 0,
                        f"{sensor.name} does not move as {sensor.place} (it is off by {own:.2g} {unit}), "
                        f"but as {best} ({left[best]:.2g}): it is worn there, or labels are exchanged")
            )  # fmt: skip
    return found


def look_at_sensors(frames: CapturedFrames, *, named: Collection[str]) -> list[Finding]:
    """Sensors whose innovations are much larger than their standard deviations allow."""
    return [
        _larger(sensor, ratio, "its readings are off by")
        for sensor, ratio in _innovations(frames, frames.suite).items()
        if sensor not in named and ratio > _LARGER
    ]


def _suspects(frames: CapturedFrames, suite: SensorSuite) -> list[str]:
    """Sensors with much larger innovations than others of their kind, the worst first.

    Against the middle one of the kind: a variance that all share is raised by the one that is wrong.
    """
    found = _innovations(frames, suite)
    kinds: dict[str, list[float]] = {}
    own = {s.name: _kind(s.name, s.kind) for s in suite.sensors}
    for name, ratio in found.items():
        kinds.setdefault(own[name], []).append(ratio)
    typical = {
        kind: min(1.0, float(np.median(ratios))) if len(ratios) >= _FEWEST_OF_KIND else 1.0
        for kind, ratios in kinds.items()
    }
    return [name for name, ratio in found.items() if ratio > _LARGER * typical[own[name]]]


def _innovations(frames: CapturedFrames, suite: SensorSuite) -> dict[str, float]:
    """The largest normalised innovation (RMS) of each sensor's rows, the worst sensor first."""
    rows = estimate_torques(suite, frames.motion, frames.measured).suspects(limit=_UNCHECKED)
    worst: dict[str, float] = {}
    for row, ratio in rows.items():
        sensor = next(
            s.name for s in suite.sensors if row == s.name or row.startswith(s.name + ".")
        )
        worst.setdefault(sensor, ratio)
    return worst


def fit_variances(
    frames: CapturedFrames, *, named: Collection[str], threads: int
) -> tuple[SensorFit, list[Finding]]:
    """Variances that make the recording most likely, and the sensors that are worse than their kind.

    Sensors of a kind share a variance at first: one each would let the likelihood choose which of two
    that see the same thing is perfect. The one that agrees least gets its own, until none stands out.
    """
    suite = frames.suite
    apart = [name for name in named if any(s.name == name for s in suite.sensors)]
    for _ in range(_MOST_APART + 1):
        fit = suite.fit(
            frames.motion, frames.measured, groups=_groups(suite, apart), steps=_FIT_STEPS,
            frames=_FIT_FRAMES, threads=threads,
        )  # fmt: skip
        rest = [
            name for name in _suspects(frames, fit.suite) if _fitted(name) and name not in apart
        ]
        if not rest:
            break
        apart.append(rest[0])
    findings = []
    for name in apart:
        row = suite.row(name)
        ratio = float(fit.deviation[row] / _of_kind(suite, fit, name, apart))
        if name not in named and ratio > _LARGER:
            findings.append(_larger(name, ratio, "it is off by"))
    return fit, findings


def _larger(sensor: str, ratio: float, words: str) -> Finding:
    severity = "warning" if ratio > _MUCH_LARGER else "note"
    return Finding(
        severity, "larger_than_expected", sensor, 0, 0,
        f"{sensor}: {words} {ratio:.3g} times what is expected of it; it is wrong, badly placed, or "
        "trusted too far",
    )  # fmt: skip


def _fitted(name: str) -> bool:
    """Whether a sensor measures; what is assumed, or computed from a table, keeps its deviation."""
    return name not in ("base at rest", "base upright") and not name.startswith("device ")


def _groups(suite: SensorSuite, apart: Collection[str]) -> np.ndarray:
    """Rows that share a variance: those of a kind, forces and moments apart."""
    kinds: dict[str, int] = {}
    out: list[int] = []
    for sensor in suite.sensors:
        count = ROWS[sensor.kind]
        own = sensor.name if sensor.name in apart else _kind(sensor.name, sensor.kind)
        parts = [own] * count if count < 6 else [f"{own} force"] * 3 + [f"{own} moment"] * 3
        fitted = _fitted(sensor.name)
        out += [kinds.setdefault(part, len(kinds)) if fitted else -1 for part in parts]
    return np.asarray(out, dtype=float)


def _kind(name: str, kind: str) -> str:
    return name if name.startswith("base ") else kind


def _of_kind(suite: SensorSuite, fit: SensorFit, name: str, apart: Collection[str]) -> float:
    """The deviation of the sensor's kind; the given one where it is the only one of it."""
    sensor = next(s for s in suite.sensors if s.name == name)
    for other in suite.sensors:
        same = _kind(other.name, other.kind) == _kind(name, sensor.kind)
        if same and other.name not in apart:
            return float(fit.deviation[suite.row(other.name)])
    return float(suite.deviation[suite.row(name)])
