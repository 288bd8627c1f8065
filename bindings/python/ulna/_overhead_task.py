"""How a simulated person works overhead: postures, movements and their order, as in the study.

A right hand with a drill points at a target above the head from four places around it and stays there,
the left hand is held at the frame of the screen, the feet stand. Joint angles between postures follow
minimum jerk; slow sway and differences between repetitions are added. Everything is a function of time
with derivatives in closed form, so that true torques rest on no filter.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .body import Body, Motion, human_body
from .record import refuse

__all__ = ["BASE", "Protocol", "Subject", "Task", "cohort", "task_of", "worker_body"]

Array = NDArray[np.float64]

# The foot that simulated motion is told from: it stands, so no acceleration of a base is needed.
BASE = "RightFoot"
DRILL_KG = 0.66
DRILL_CENTRE_M = (0.0, -0.10, 0.0)  # in the right hand, which points along -y
DRILL_TIP_M = (0.0, -0.30, 0.0)

_WORK_DEG = {
    "jT1C7_roty": -15.0, "jC1Head_roty": -15.0,
    "jRightShoulder_rotx": 90.0, "jRightShoulder_rotz": 90.0, "jRightElbow_rotz": 90.0,
    "jLeftShoulder_rotx": -90.0, "jLeftShoulder_rotz": -95.0, "jLeftElbow_rotz": -80.0,
}  # fmt: skip
_REST_DEG = {
    "jRightShoulder_rotx": 80.0, "jRightShoulder_rotz": 5.0, "jRightElbow_rotz": 15.0,
    "jLeftShoulder_rotx": -80.0, "jLeftShoulder_rotz": -5.0, "jLeftElbow_rotz": -15.0,
}  # fmt: skip
_ARM = ("jRightShoulder_rotx", "jRightShoulder_roty", "jRightShoulder_rotz", "jRightElbow_roty",
        "jRightElbow_rotz")  # fmt: skip
# Standard deviations, in degrees: of a posture from block to block, and from movement to movement.
_BLOCK_DEG = {
    "jL5S1_roty": 1.0, "jL4L3_roty": 0.7, "jT9T8_roty": 0.7, "jT9T8_rotx": 0.5, "jT1C7_roty": 3.0,
    "jRightShoulder_rotx": 1.5, "jRightShoulder_roty": 3.0, "jRightShoulder_rotz": 1.5,
    "jLeftShoulder_rotx": 1.5, "jLeftShoulder_roty": 3.0, "jLeftShoulder_rotz": 2.0,
    "jLeftElbow_rotz": 2.0,
}  # fmt: skip
_MOVE_DEG = {name: 0.7 for name in (*_ARM, "jRightWrist_rotz")}
# Sway, in degrees (root mean square); legs sway together, see `_sway`.
_SWAY_DEG = {
    "jL5S1_rotx": 0.3, "jL5S1_roty": 0.4, "jL1T12_roty": 0.3, "jT9T8_rotz": 0.5, "jT1C7_rotz": 1.0,
    "jT1C7_roty": 0.8, "jLeftShoulder_rotz": 0.4, "jLeftElbow_rotz": 0.4, "jRightWrist_rotx": 0.4,
    "jRightShoulder_roty": 0.4,
}  # fmt: skip
_LEAN_DEG, _TILT_DEG = 0.6, 0.3
_SWAY_HZ = (0.05, 0.5)
_WAVES = 6
# The trunk sinks forward by this from block to block, at both of its lowest joints.
_TIRED_DEG = 0.2

# Seconds: to raise or lower the arms, from the target to a starting point, and back to a small and to a
# large target, which takes less (Fitts).
_RAISE_S = 1.5
_AWAY_S = 1.0
_REACH_S = (1.0, 0.8)

# Published mean and standard deviation of the twelve subjects.
HEIGHT_M = (1.793, 0.059)
MASS_KG = (72.7, 5.4)
# Peak force on an arm, as the levers of a commercial device were set for twelve people.
SUPPORT_N = (35.3, 2.7)


@dataclass(frozen=True)
class Subject:
    """A person of the simulated cohort.

    Attributes
    ----------
    name : str
        ``"1"`` and so on, as subjects are named in a force table.
    height_m, mass_kg : float
    device_first : bool
        Whether the session with the device came first.
    support_n : float
        Peak force of the device on each arm, as its lever is set for this person.
    """

    name: str
    height_m: float
    mass_kg: float
    device_first: bool
    support_n: float


@dataclass(frozen=True)
class Protocol:
    """One session.

    Attributes
    ----------
    blocks : int
    repetitions : int
        Of every one of the 8 combinations of target size and starting point in a block.
    hold_s, rest_s : float
        At the target, and between blocks with the arms down.
    still_s : float
        Before the first and after the last block, arms down.
    cycle_s : float
        From one target to the next.
    rate_hz : float
        Of the suit.
    """

    blocks: int = 5
    repetitions: int = 3
    hold_s: float = 2.0
    rest_s: float = 25.0
    still_s: float = 10.0
    cycle_s: float = 4.8
    rate_hz: float = 60.0

    def __post_init__(self) -> None:
        for name in ("blocks", "repetitions"):
            if getattr(self, name) < 1:
                raise refuse(f"{name} must be at least 1", name)
        for name in ("hold_s", "still_s", "cycle_s", "rate_hz"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise refuse(f"{name} must be positive", name)
        if not self.rest_s > 2 * _RAISE_S:
            raise refuse(
                f"rest_s must be above {2 * _RAISE_S:g}: the arms are lowered and raised in it",
                "rest_s",
            )
        if self.cycle_s < self.hold_s + _AWAY_S + max(_REACH_S):
            raise refuse(
                f"a cycle of {self.cycle_s:g} s is too short: a movement away of {_AWAY_S:g} s, one of "
                f"{max(_REACH_S):g} s back and {self.hold_s:g} s at the target do not fit",
                "cycle_s",
            )

    @property
    def block_s(self) -> float:
        """Length of a block's movements."""
        return 8 * self.repetitions * self.cycle_s

    @property
    def duration_s(self) -> float:
        """Length of a session."""
        return 2 * self.still_s + self.blocks * self.block_s + (self.blocks - 1) * self.rest_s

    @property
    def starts_s(self) -> Array:
        """Start of every block's movements."""
        return self.still_s + np.arange(self.blocks) * (self.block_s + self.rest_s)

    @cached_property
    def time_s(self) -> Array:
        """Times of the suit's frames."""
        return np.arange(round(self.duration_s * self.rate_hz)) / self.rate_hz

    def block_of(self, time_s: Array) -> NDArray[np.int64]:
        """Block of every frame, from 0; a rest belongs to the block that follows, as published;
        -1 before the first and after the last."""
        ends = self.starts_s + self.block_s
        block = np.searchsorted(ends, time_s, side="right")
        outside = (time_s < self.still_s) | (block >= self.blocks)
        return np.where(outside, -1, block)


def cohort(*, subjects: int = 12, seed: int = 0) -> tuple[Subject, ...]:
    """People with exactly the published mean and standard deviation of height and mass.

    Every other one begins with the device, in random order.

    Examples
    --------
    >>> people = cohort()
    >>> len(people), round(sum(one.height_m for one in people) / 12, 6)
    (12, 1.793)
    """
    rng = np.random.default_rng([seed, 0])
    numbers = rng.normal(size=(2, subjects))
    # Tall people are heavy: correlation 0.5, as among young men.
    numbers[1] = 0.5 * numbers[0] + np.sqrt(0.75) * numbers[1]
    if subjects > 1:
        numbers = (numbers - numbers.mean(axis=1, keepdims=True)) / numbers.std(
            axis=1, ddof=1, keepdims=True
        )
    order = rng.permutation(np.arange(subjects) % 2 == 0)
    support = rng.normal(*SUPPORT_N, size=subjects)
    return tuple(
        Subject(
            str(k + 1),
            float(HEIGHT_M[0] + HEIGHT_M[1] * numbers[0, k]),
            float(MASS_KG[0] + MASS_KG[1] * numbers[1, k]),
            bool(order[k]),
            float(support[k]),
        )
        for k in range(subjects)
    )


def worker_body(subject: Subject, *, device_kg: float = 0.0) -> Body:
    """The model of a person with the drill in the hand, and the device's mass at the hip."""
    body = human_body(height_m=subject.height_m, mass_kg=subject.mass_kg).attach(
        "drill", link="RightHand", mass_kg=DRILL_KG, centre_m=DRILL_CENTRE_M
    )
    if device_kg > 0:
        centre = next(link.centre_m for link in body.describe() if link.name == "Pelvis")
        body = body.attach("arm support", link="Pelvis", mass_kg=device_kg, centre_m=centre)
    return body


@dataclass(frozen=True, eq=False)
class Task:
    """Angles of all joints over a session.

    Attributes
    ----------
    knots_s : (knots,) array
        Times at which a movement begins or ends.
    postures : (knots, joints) array
        Angles there, rad; minimum jerk between them.
    wave_hz, wave_rad, wave_phase : (waves, joints) array
        Sway: a sum of sines.
    """

    knots_s: Array
    postures: Array
    wave_hz: Array
    wave_rad: Array
    wave_phase: Array

    def motion(self, time_s: Array) -> Motion:
        """The motion at given times, told from `BASE`, which stands."""
        last = len(self.knots_s) - 2
        k = np.clip(np.searchsorted(self.knots_s, time_s, side="right") - 1, 0, last)
        span = self.knots_s[k + 1] - self.knots_s[k]
        x = np.clip((time_s - self.knots_s[k]) / span, 0.0, 1.0)[:, None]
        span = span[:, None]
        step = self.postures[k + 1] - self.postures[k]
        angle = self.postures[k] + step * (x**3 * (10 - 15 * x + 6 * x**2))
        rate = step * (30 * x**2 * (1 - x) ** 2 / span)
        acceleration = step * (60 * x * (1 - x) * (1 - 2 * x) / span**2)
        swaying = np.flatnonzero(np.any(self.wave_rad != 0, axis=0))
        for hz, size, phase in zip(self.wave_hz, self.wave_rad, self.wave_phase, strict=True):
            omega = 2 * np.pi * hz[swaying]
            turn = np.multiply.outer(time_s, omega) + phase[swaying]
            sine, cosine = size[swaying] * np.sin(turn), size[swaying] * np.cos(turn)
            angle[:, swaying] += sine
            rate[:, swaying] += omega * cosine
            acceleration[:, swaying] -= omega**2 * sine
        return Motion(angle, rate, acceleration)


def task_of(subject: Subject, protocol: Protocol, *, seed: int) -> Task:
    """What a person does in one session; another seed is another session."""
    rng = np.random.default_rng(seed)
    body = worker_body(subject)
    names = body.joints
    rest = _posture(_REST_DEG, names)
    postures = _work_postures(body, subject)
    spread, jitter = (np.abs(_posture(table, names)) for table in (_BLOCK_DEG, _MOVE_DEG))
    trunk = [names.index(name) for name in ("jL5S1_roty", "jL4L3_roty")]
    times, angles = [0.0], [rest]

    def put(time: float, posture: Array) -> None:
        times.append(time)
        angles.append(posture)

    for block, start in enumerate(protocol.starts_s):
        shift = spread * rng.normal(size=len(names))
        shift[trunk] += np.radians(_TIRED_DEG) * block
        # 8 combinations of a large or small target and a starting point, each as often.
        order = rng.permutation(np.repeat(np.arange(8), protocol.repetitions))
        at = postures[0] + shift
        put(start - min(_RAISE_S, 0.9 * protocol.still_s), rest)
        put(start, at)
        for number, combination in enumerate(order):
            begin = start + number * protocol.cycle_s
            reach = _REACH_S[combination // 4]
            away = postures[1 + combination % 4] + shift + jitter * rng.normal(size=len(names))
            put(begin + _AWAY_S, away)
            put(begin + protocol.cycle_s - protocol.hold_s - reach, away)
            at = postures[0] + shift + jitter * rng.normal(size=len(names))
            put(begin + protocol.cycle_s - protocol.hold_s, at)
            put(begin + protocol.cycle_s, at)
        put(start + protocol.block_s + min(_RAISE_S, 0.9 * protocol.still_s), rest)
    put(protocol.duration_s, rest)
    return Task(np.array(times), np.array(angles), *_sway(names, rng))


def _posture(degrees: dict[str, float], names: tuple[str, ...]) -> Array:
    angles = np.zeros(len(names))
    for name, value in degrees.items():
        angles[names.index(name)] = np.radians(value)
    return angles


def _work_postures(body: Body, subject: Subject) -> Array:
    """At the target, and with the drill's tip at four places around it, a sixth of the height away."""
    work = _posture(_WORK_DEG, body.joints)
    centre = _tip(body, work)
    found = [work]
    for turn in np.radians([45.0, 135.0, 225.0, 315.0]):
        away = subject.height_m / 6 * np.array([np.cos(turn), np.sin(turn), 0.0])
        found.append(_reach(body, work, centre + away))
    return np.array(found)


def _tip(body: Body, angles: Array) -> Array:
    pose = body.poses(Motion(angles[None]))[0, body.links.index("RightHand")]
    v, w = pose[4:], pose[3]
    tip = np.asarray(DRILL_TIP_M)
    turned = 2.0 * np.cross(v, tip)
    return np.asarray(pose[:3] + tip + w * turned + np.cross(v, turned))


def _reach(body: Body, start: Array, goal: Array) -> Array:
    """Angles of the right arm that bring the tip to a place, near those it starts from."""
    arm = [body.joints.index(name) for name in _ARM]
    angles = start.copy()
    for _ in range(60):
        lack = goal - _tip(body, angles)
        if np.linalg.norm(lack) < 1e-6:
            break
        jacobian = body.jacobian(Motion(angles[None]), link="RightHand", point_m=DRILL_TIP_M)
        j = jacobian[:3, 6:][:, arm]
        # Damped least squares; the five joints have more freedom than the tip.
        angles[arm] += j.T @ np.linalg.solve(j @ j.T + 1e-3 * np.eye(3), lack)
    return angles


def _sway(names: tuple[str, ...], rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Frequencies, sizes and phases of the sines of every joint."""
    shape = (_WAVES, len(names))
    hz = rng.uniform(*_SWAY_HZ, size=shape)
    phase = rng.uniform(0.0, 2 * np.pi, size=shape)
    share = np.sqrt(2.0 / _WAVES)
    size = np.tile(np.abs(_posture(_SWAY_DEG, names)) * share, (_WAVES, 1))
    # Both legs lean and tilt alike, the hips turning back by what the ankles turn: the feet stay where
    # they are and the pelvis upright.
    for axis, degrees in (("y", _LEAN_DEG), ("x", _TILT_DEG)):
        lead = names.index(f"jRightAnkle_rot{axis}")
        for joint, sign in (("Ankle", 1.0), ("Hip", -1.0)):
            for side in ("Right", "Left"):
                own = names.index(f"j{side}{joint}_rot{axis}")
                hz[:, own], phase[:, own] = hz[:, lead], phase[:, lead]
                size[:, own] = sign * share * np.radians(degrees)
    return hz, size, phase
