"""What sensors record of a simulated worker, with the errors that sensors have, and the true torques.

A session is told twice: as it is (`Truth`, from inverse dynamics with the device's wrenches and the
contacts of both feet) and as a suit of inertial sensors and a pair of shoes see it (`simulate`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import signal
from ._overhead_task import BASE, Protocol, Subject, Task, worker_body
from .posture import hinge_errors, joint_segments, times_small
from .assist import DeviceWrenches, PassiveDevice, elevation
from .body import Body, Motion, human_names
from .record import Record, refuse

__all__ = ["SHOE_POSITION_M", "SensorErrors", "Simulated", "simulate"]

Array = NDArray[np.float64]

# Where a shoe's wrench is told about, in the foot.
SHOE_POSITION_M = (0.03, 0.0, -0.05)
# Frames that are simulated together, so that poses and wrenches of all links stay small.
_CHUNK = 6000
_WAVES = 8


@dataclass(frozen=True)
class SensorErrors:
    """Standard deviations of sensors' errors.

    What is fixed is drawn anew for every session: bias, place and axes of a sensor. What wanders
    changes over a minute. Noise is white.

    Attributes
    ----------
    segment_deg : float
        Axes of a segment as the suit was calibrated against the true ones, about each axis. Turns the
        segment's orientation and its sensor's readings alike.
    wander_deg, orientation_noise_deg : float
        Of the orientations, about each axis.
    imu_bias_m_s2, imu_noise_m_s2, imu_place_m : float
        Of accelerometers: the last is where they sit, along each axis.
    gyroscope_noise_rad_s, gyroscope_bias_rad_s : float
    shoe_bias_n, shoe_bias_nm, shoe_noise_n, shoe_noise_nm : float
        Of the forces and moments of a shoe; noise at its own rate.
    shoe_place_m, shoe_tilt_deg : float
        Place and axes of a shoe's sensor in the foot, along and about each axis.
    device_share : float
        Relative error of the device's force curve, each arm.
    """

    segment_deg: float = 1.0
    wander_deg: float = 0.3
    orientation_noise_deg: float = 0.02
    imu_bias_m_s2: float = 0.05
    imu_noise_m_s2: float = 0.05
    imu_place_m: float = 0.01
    gyroscope_noise_rad_s: float = 0.01
    gyroscope_bias_rad_s: float = 0.003
    shoe_bias_n: float = 2.0
    shoe_bias_nm: float = 0.3
    shoe_noise_n: float = 3.0
    shoe_noise_nm: float = 0.2
    shoe_place_m: float = 0.003
    shoe_tilt_deg: float = 0.5
    device_share: float = 0.03
    shoe_rate_hz: float = 1000.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (np.isfinite(value) and value >= 0):
                raise refuse(f"{name} must not be negative", name)
        if self.shoe_rate_hz == 0:
            raise refuse("shoe_rate_hz must be positive", "shoe_rate_hz")


@dataclass(frozen=True, eq=False)
class Simulated:
    """A simulated session.

    Attributes
    ----------
    body : Body
        With the drill; without the device.
    suit, shoes : Record
        What was recorded, on one clock.
    torque_nm : (frames, joints) array
        True torques at the suit's frames.
    elevation_rad : (frames, 2) array
        True elevation of the left and right upper arm.
    balance : float
        Largest wrench (N, N m) that the true external wrenches leave unexplained.
    """

    body: Body
    suit: Record
    shoes: Record
    torque_nm: Array
    elevation_rad: Array
    balance: float


def simulate(
    subject: Subject,
    task: Task,
    protocol: Protocol,
    *,
    device: PassiveDevice | None,
    errors: SensorErrors,
    seed: int,
    gyroscopes: bool = True,
) -> Simulated:
    """Record a session of a task.

    Parameters
    ----------
    device
        Worn, with its true mass; its true force differs from its curve by `errors.device_share`.
    seed
        Of all errors.
    gyroscopes
        Whether they are recorded as well: checks and calibrations read them, the estimate does not.
    """
    rng = np.random.default_rng(seed)
    time = protocol.time_s
    truth = _Truth.of(subject, device, errors, rng)
    places = {
        name: centre + errors.imu_place_m * rng.normal(size=3)
        for name, centre in _centres(truth.body).items()
    }
    parts = [
        truth.frames(task, time[begin : begin + _CHUNK], places)
        for begin in range(0, len(time), _CHUNK)
    ]
    suit = _suit_channels(truth.body, time, parts, errors, rng, gyroscopes)
    shoes_s, shoes = _shoe_channels(time, parts, errors, rng)
    return Simulated(
        body=worker_body(subject),
        suit=Record.from_arrays(time, suit),
        shoes=Record.from_arrays(shoes_s, shoes),
        torque_nm=np.concatenate([part.torque for part in parts]),
        elevation_rad=np.concatenate([part.elevation for part in parts]),
        balance=max(part.balance for part in parts),
    )


# As it is -----------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Part:
    """True frames."""

    angle: Array
    torque: Array
    orientation: Array  # of the base
    position: Array
    imu: dict[str, tuple[Array, Array]]  # angular velocity, proper acceleration; link axes
    shoes: dict[str, Array]  # wrench about the shoe's nominal place, foot axes
    elevation: Array
    balance: float


@dataclass(frozen=True, eq=False)
class _Truth:
    """The person, the device and their true contacts."""

    body: Body  # with the device's mass
    standing: Body  # the same from the standing foot
    device: PassiveDevice | None
    order: NDArray[np.int64]
    pelvis_m: Array  # the pelvis' origin in its frame of the standing body

    @classmethod
    def of(
        cls,
        subject: Subject,
        device: PassiveDevice | None,
        errors: SensorErrors,
        rng: np.random.Generator,
    ) -> _Truth:
        scale = 1.0 + errors.device_share * rng.normal(size=2)
        body = worker_body(subject, device_kg=0.0 if device is None else device.mass_kg)
        standing = body.rebased(BASE)
        hip = next(link for link in body.describe() if link.joint == "jRightHip_rotx")
        if device is not None:
            curves = device.curve if isinstance(device.curve, tuple) else (device.curve,) * 2
            # The body carries its mass, so that the mass is accelerated as well.
            device = PassiveDevice(
                (curves[0].scaled(scale[0]), curves[1].scaled(scale[1])),
                attachment=device.attachment,
                mass_kg=0.0,
                along_arm=device.along_arm,
            )
        order = np.array([body.joints.index(name) for name in standing.joints])
        return cls(body, standing, device, order, -hip.position_m)

    def frames(self, task: Task, time: Array, places: dict[str, Array]) -> _Part:
        motion = self._motion(task.motion(time))
        poses = self.body.poses(motion)
        at = {name: k for k, name in enumerate(self.body.links)}
        arms = [(at[f"{side}UpperArm"], at[f"{side}ForeArm"]) for side in ("Left", "Right")]
        shoulder, elbow = (
            np.stack([poses[:, pair[k], :3] for pair in arms], axis=1) for k in (0, 1)
        )
        external = np.zeros((len(time), len(self.body.links), 6))
        if self.device is not None:
            hip = poses[:, at["Pelvis"], :3]
            pair = self.device.wrenches(shoulder, elbow, hip)
            raised = pair.elevation_rad
            self._put_device(external, poses, pair, at)
        else:
            raised = elevation(elbow - shoulder)
        _, lacking = self.body.inverse_dynamics(motion, external)
        feet = _split(lacking, poses[:, at["Pelvis"], :3], poses, at)
        shoes = {}
        for name, wrench in feet.items():
            link = at[name]
            external[:, link] += _to_link(wrench, poses[:, link])
            place = np.asarray(SHOE_POSITION_M)
            force, moment = external[:, link, :3], external[:, link, 3:]
            shoes[name] = np.hstack([force, moment - np.cross(place, force)])
        torque, left = self.body.inverse_dynamics(motion, external)
        imu = {}
        for name, place in places.items():
            _, turn, proper, _ = self.body.sensor(motion, link=name, point_m=place)
            imu[name] = (turn, proper)
        return _Part(
            np.asarray(motion.angle), torque, np.asarray(motion.orientation),
            np.asarray(motion.position_m), imu, shoes, raised, float(np.abs(left).max()),
        )  # fmt: skip

    def _motion(self, own: Motion) -> Motion:
        """Told from the pelvis, as a suit tells it."""
        angle, rate, acceleration = (
            np.asarray(values) for values in (own.angle, own.rate, own.acceleration)
        )
        told = Motion(*(values[:, self.order] for values in (angle, rate, acceleration)))
        pose = self.standing.poses(told)[:, self.standing.links.index("Pelvis")]
        velocity, turn, proper, turning = (
            _turned(pose[:, 3:], values)
            for values in self.standing.sensor(told, link="Pelvis", point_m=self.pelvis_m)
        )
        return Motion(
            angle, rate, acceleration,
            position_m=pose[:, :3] + _turned(pose[:, 3:], self.pelvis_m),
            orientation=pose[:, 3:], velocity_m_s=velocity, angular_velocity_rad_s=turn,
            base_acceleration=np.hstack([proper, turning]),
        )  # fmt: skip

    def _put_device(
        self, external: Array, poses: Array, pair: DeviceWrenches, at: dict[str, int]
    ) -> None:
        links = [at["LeftUpperArm"], at["RightUpperArm"]]
        on_arms = pair.arm_wrench(poses[:, links, :3])
        for side, link in enumerate(links):
            external[:, link] += _about_origin(on_arms[:, side], poses[:, link])
        external[:, at["Pelvis"]] += _about_origin(
            pair.hip_wrench(poses[:, at["Pelvis"], :3]), poses[:, at["Pelvis"]]
        )


def _centres(body: Body) -> dict[str, Array]:
    """Where sensors are said to sit: at the centres of mass of their links, without tools."""
    names = human_names("suit")
    return {link.name: link.centre_m for link in body.describe() if link.name in names}


def _split(lacking: Array, about: Array, poses: Array, at: dict[str, int]) -> dict[str, Array]:
    """Share a wrench (about `about`, world axes) between the feet: force and moment about the world's
    origin. Both centres of pressure lie equally far ahead, each on the middle line of its foot."""
    force = lacking[:, :3]
    moment = lacking[:, 3:] + np.cross(about, force)
    place = {}
    for name in ("RightFoot", "LeftFoot"):
        pose = poses[:, at[name]]
        place[name] = pose[:, :3] + _turned(pose[:, 3:], np.array([0.0, 0.0, -0.07]))
    floor = 0.5 * (place["RightFoot"][:, 2] + place["LeftFoot"][:, 2])
    down = np.zeros_like(force)
    down[:, 2] = floor
    at_floor = moment - np.cross(down, force)
    x, y = -at_floor[:, 1] / force[:, 2], at_floor[:, 0] / force[:, 2]
    right, left = place["RightFoot"][:, 1], place["LeftFoot"][:, 1]
    share = ((y - left) / (right - left))[:, None]
    found = {}
    rest = moment.copy()
    for name, part, side in (("RightFoot", share, right), ("LeftFoot", 1.0 - share, left)):
        pressure = np.column_stack([x, side, floor])
        own = part * force
        found[name] = np.hstack([own, np.cross(pressure, own)])
        rest -= found[name][:, 3:]
    for name, part in (("RightFoot", share), ("LeftFoot", 1.0 - share)):
        found[name][:, 3:] += part * rest  # about the vertical; nothing about the other axes
    return found


def _to_link(wrench: Array, pose: Array) -> Array:
    """A wrench about the world's origin as one about a link's origin in its axes."""
    shifted = wrench.copy()
    shifted[:, 3:] -= np.cross(pose[:, :3], wrench[:, :3])
    return _about_origin(shifted, pose)


def _about_origin(wrench: Array, pose: Array) -> Array:
    """A wrench about a link's origin, from the world's axes into the link's."""
    back = pose[:, 3:] * [1.0, -1.0, -1.0, -1.0]
    return np.hstack([_turned(back, wrench[:, :3]), _turned(back, wrench[:, 3:])])


def _turned(q: Array, vector: Array) -> Array:
    """Vectors turned by quaternions (w, x, y, z)."""
    v = np.broadcast_to(vector, (len(q), 3))
    t = 2.0 * np.cross(q[:, 1:], v)
    return np.asarray(v + q[:, :1] * t + np.cross(q[:, 1:], t))


# As it is recorded --------------------------------------------------------------------------------


def _suit_channels(
    body: Body,
    time: Array,
    parts: list[_Part],
    errors: SensorErrors,
    rng: np.random.Generator,
    gyroscopes: bool,
) -> dict[str, Array]:
    joined = joint_segments(body)
    segments = sorted({name for joint in joined for name in joint[:2]})
    turned = {name: _misread(time, errors, rng) for name in segments}
    angle = np.concatenate([part.angle for part in parts])
    hinges = {name: k for k, name in enumerate(body.joints)}
    channels: dict[str, Array] = {}
    for parent, child, names in joined:
        own = angle[:, [hinges[name] for name in names]]
        error = hinge_errors(own, names, turned[parent], turned[child])
        channels |= {name: own[:, k] + error[:, k] for k, name in enumerate(names)}
    channels = {name: channels[name] for name in body.joints}
    orientation = np.concatenate([part.orientation for part in parts])
    seen = times_small(orientation, turned["Pelvis"])
    channels |= {f"Pelvis_q{part}": seen[:, k] for k, part in enumerate("wxyz")}
    position = np.concatenate([part.position for part in parts])
    channels |= {f"Pelvis_position_{axis}": position[:, k] for k, axis in enumerate("xyz")}
    shape = (len(time), 3)
    read_out = [("sensor_acceleration", 1, errors.imu_bias_m_s2, errors.imu_noise_m_s2)]
    if gyroscopes:
        read_out.append(("sensor_angular_velocity", 0, errors.gyroscope_bias_rad_s,
                         errors.gyroscope_noise_rad_s))  # fmt: skip
    for name in parts[0].imu:
        for label, which, bias, noise in read_out:
            values = np.concatenate([part.imu[name][which] for part in parts])
            read = values - np.cross(turned[name], values)
            read += bias * rng.normal(size=3) + noise * rng.standard_normal(shape)
            channels |= {f"{name}_{label}_{axis}": read[:, k] for k, axis in enumerate("xyz")}
    return channels


def _misread(time: Array, errors: SensorErrors, rng: np.random.Generator) -> Array:
    """Small rotations from a segment's true axes to those that the suit tells, (frames, 3), rad."""
    out = np.tile(errors.segment_deg * rng.normal(size=3), (len(time), 1))
    period = rng.uniform(20.0, 200.0, size=(_WAVES, 3))
    phase = rng.uniform(0.0, 2 * np.pi, size=(_WAVES, 3))
    # Sines of minutes need no more than a value a second.
    slow = np.arange(0.0, time[-1] + 2.0, 1.0)
    for own, start in zip(period, phase, strict=True):
        wave = np.sin(2 * np.pi * np.multiply.outer(slow, 1.0 / own) + start)
        for axis in range(3):
            size = errors.wander_deg * np.sqrt(2.0 / _WAVES)
            out[:, axis] += size * np.interp(time, slow, wave[:, axis])
    out += errors.orientation_noise_deg * rng.standard_normal(out.shape)
    return np.radians(out)


def _shoe_channels(
    time: Array, parts: list[_Part], errors: SensorErrors, rng: np.random.Generator
) -> tuple[Array, dict[str, Array]]:
    channels: dict[str, Array] = {}
    stamps = time
    for side in ("Right", "Left"):
        wrench = np.concatenate([part.shoes[f"{side}Foot"] for part in parts])
        place = errors.shoe_place_m * rng.normal(size=3)
        tilt = np.radians(errors.shoe_tilt_deg) * rng.normal(size=3)
        wrench[:, 3:] -= np.cross(place, wrench[:, :3])
        for half in (slice(0, 3), slice(3, 6)):
            wrench[:, half] -= np.cross(tilt, wrench[:, half])
        stamps, fine = signal.resample(time, wrench, rate_hz=errors.shoe_rate_hz)
        fine = np.asarray(fine).reshape(len(stamps), 6)
        bias = rng.normal(size=6) * ([errors.shoe_bias_n] * 3 + [errors.shoe_bias_nm] * 3)
        noise = np.array([errors.shoe_noise_n] * 3 + [errors.shoe_noise_nm] * 3)
        # Single precision draws twice as fast; noise has no more digits than that.
        fine = fine + bias + noise * rng.standard_normal(fine.shape, dtype=np.float32)
        names = [f"{side}Shoe_{what}_{axis}" for what in "FM" for axis in "xyz"]
        channels |= {name: fine[:, k] for k, name in enumerate(names)}
    return stamps, channels
