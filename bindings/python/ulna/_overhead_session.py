"""One simulated session of the overhead study: recorded, estimated, reduced to effort and compared with
the truth."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._capture_filter import half_window
from ._capture_readings import wear
from ._overhead_sensors import SHOE_POSITION_M, SensorErrors, Simulated, simulate
from ._overhead_task import Protocol, Subject, task_of
from .assist import ForceCurve, ForceTable, PassiveDevice
from .body import Body, Motion, human_names
from .capture import BodySetup, CapturedFrames, Contact, Imu, RecordedTorques, estimate, gather
from .effort import AREAS, effort, working_frames
from .posture import posture_deviation
from .signal import savgol_kernel
from .torques import SensorSuite

__all__ = ["BlockEffort", "SessionEffort", "Setting", "run_session"]

Array = NDArray[np.float64]

DEVICE_KG = 1.8
SIDES = ("left", "right")
# Postures change slowly: what their errors do is computed once a second.
_POSTURE_S = 1.0
# Of the pipeline, as by default.
_WINDOW_S, _ORDER = 0.25, 4
_95 = 1.959963984540054
# Of the movement that is shown as a picture: from the start of the first block.
_SHOWN_S = (14.4, 24.0)


@dataclass(frozen=True, eq=False)
class Setting:
    """What all sessions of a study share."""

    protocol: Protocol
    errors: SensorErrors
    seed: int
    table: ForceTable | None


@dataclass(frozen=True, eq=False)
class BlockEffort:
    """Effort in the working frames of every block.

    Attributes
    ----------
    norm_nm, rms_nm, mean_abs_nm : (blocks,) array
        Norm of all torques, mean over frames; root mean square and mean absolute torque over frames and
        joints.
    joint_nm : (blocks, joints) array
        Mean absolute torque of each joint.
    area_nm : (blocks, areas) array
        Norm of each area's torques, in the order of `ulna.effort.AREAS`.
    shoulder_nm : (blocks, 2) array
        Norm of the three torques of the left and the right shoulder.
    signed_nm : (blocks,) array
        Signed mean of all torques, rests of the block included: what the published Table I rests on.
    """

    norm_nm: Array
    rms_nm: Array
    mean_abs_nm: Array
    joint_nm: Array
    area_nm: Array
    shoulder_nm: Array
    signed_nm: Array


@dataclass(frozen=True, eq=False)
class SessionEffort:
    """One person in one session.

    Attributes
    ----------
    subject : Subject
    with_device : bool
    joints : tuple of str
    measured, true : BlockEffort
        From the estimated and from the true torques.
    second_nm, true_second_nm : (seconds,) array
        Norm of all torques, mean over each second of the session.
    frames : int
    inside : (joints,) array
        Share of frames whose true torque lies inside the 95 % interval.
    error_nm, deviation_nm : (joints,) array
        Root mean square of the error, and of the standard deviation that was stated.
    sensor_nm, posture_nm : (joints,) array
        Parts of the latter: from sensors, and from the told posture.
    residual : (6,) array
        Root mean square of what the measured wrenches lack (N, N m).
    balance : float
        Largest wrench that the true ones lack: how exact the truth is.
    scene : BodyScene or None
        Some seconds of the first block.
    """

    subject: Subject
    with_device: bool
    joints: tuple[str, ...]
    measured: BlockEffort
    true: BlockEffort
    second_nm: Array
    true_second_nm: Array
    frames: int
    inside: Array
    error_nm: Array
    deviation_nm: Array
    sensor_nm: Array
    posture_nm: Array
    residual: Array
    balance: float
    scene: Any = None


def device_of(subject: Subject, table: ForceTable | None) -> PassiveDevice:
    """The device as it is set for a person: the curve of a table, or a bump of the person's peak."""
    curve = (
        ForceCurve.parametric(peak_n=subject.support_n)
        if table is None
        else table.of(table.subjects[(int(subject.name) - 1) % len(table.subjects)])
    )
    return PassiveDevice(curve, mass_kg=DEVICE_KG)


def record_session(
    subject: Subject, *, with_device: bool, setting: Setting, gyroscopes: bool = True
) -> Simulated:
    """What the sensors record of a person in a session, and the true torques."""
    seeds = np.random.SeedSequence([setting.seed, int(subject.name), int(with_device)])
    movement, sensors = (int(seed) for seed in seeds.generate_state(2))
    return simulate(
        subject,
        task_of(subject, setting.protocol, seed=movement),
        setting.protocol,
        device=device_of(subject, setting.table) if with_device else None,
        errors=setting.errors,
        seed=sensors,
        gyroscopes=gyroscopes,
    )


def session_setup(body: Body, *, device: PassiveDevice | None = None) -> BodySetup:
    """The body, its sensors and contacts as `ulna.capture.recorded_torques` takes them.

    Parameters
    ----------
    body : Body
        Of `Simulated`.
    device : PassiveDevice, optional
        Where one was worn.

    Examples
    --------
    >>> from ulna.body import human_body
    >>> setup = session_setup(human_body(height_m=1.8, mass_kg=75))
    >>> len(setup.imus), [contact.link for contact in setup.contacts]
    (17, ['RightFoot', 'LeftFoot'])
    """
    centres = {link.name: link.centre_m for link in body.describe()}
    return BodySetup(
        body,
        contacts=tuple(
            Contact(f"{side}Shoe", f"{side}Foot", position_m=SHOE_POSITION_M)
            for side in ("Right", "Left")
        ),
        imus=tuple(
            Imu(name, position_m=centres[name], orientation=np.eye(3))
            for name in human_names("suit")
        ),
        device=device,
    )


def trusted(frames: CapturedFrames, errors: SensorErrors) -> SensorSuite:
    """Standard deviations of all rows from what is known of the sensors: their data sheets.

    Bias and misplacement are as much an error of a frame as noise is. Noise is that behind the filter of
    the pipeline. No sensor is taken to be better than 0.1 N, 0.02 N m and 0.01 m/s^2.
    """
    suite = frames.suite
    half_weight = 0.5 * suite.body.mass_kg * suite.body.gravity_m_s2
    # A shoe is turned in the foot, and the foot is told with an error.
    tilt = np.radians(np.hypot(errors.shoe_tilt_deg, errors.segment_deg))
    level = max(np.hypot(errors.shoe_bias_n, half_weight * tilt), 0.1)
    turned = max(np.hypot(errors.shoe_bias_nm, half_weight * errors.shoe_place_m), 0.02)
    shoe = (level, level, errors.shoe_bias_n + 0.1, turned, turned, errors.shoe_bias_nm + 0.02)
    window = 2 * half_window(_WINDOW_S, frames.rate_hz, _ORDER) + 1
    gains = [
        float(np.sqrt(np.sum(savgol_kernel(
            window=window, order=_ORDER, derivative=derivative, rate_hz=frames.rate_hz
        ) ** 2)))
        for derivative in (0, 2)
    ]  # fmt: skip
    # What 1 cm of place does in a movement of 1.5 rad/s^2 comes beside bias and noise.
    imu = np.sqrt(
        errors.imu_bias_m_s2**2
        + (gains[0] * errors.imu_noise_m_s2) ** 2
        + (1.5 * errors.imu_place_m) ** 2
    )
    # The filter itself is wrong by 0.1 rad/s^2 where a movement begins or ends.
    turning = np.hypot(gains[1] * np.radians(errors.orientation_noise_deg), 0.1)
    arm, hip = _device_deviations(errors)
    sensors = []
    for sensor in suite.sensors:
        if sensor.name.endswith("Shoe"):
            sensor = replace(sensor, deviation=shoe)
        elif sensor.name.startswith("device "):
            sensor = replace(sensor, deviation=hip if sensor.place == "Pelvis" else arm)
        elif sensor.name.startswith("imu "):
            sensor = replace(sensor, deviation=max(float(imu), 0.01))
        elif sensor.kind == "joint_acceleration":
            sensor = replace(sensor, deviation=float(np.sqrt(2.0) * turning))
        elif sensor.kind == "angular_acceleration":
            sensor = replace(sensor, deviation=float(turning))
        sensors.append(sensor)
    return SensorSuite(suite.body, sensors, prior=suite.prior)


def _device_deviations(errors: SensorErrors) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Of a device's wrench on an arm about the shoulder, and on the hip; world axes.

    With the arms ahead the force stands upright, 30 N a quarter of a metre ahead of the shoulder and
    half a metre above the hip; its size is off by the curve. What the told posture does to its direction
    is told with the posture's.
    """
    size = 30.0 * errors.device_share + 0.01
    arm = np.array([0.3, 0.1, 1.0, 0.05, 0.25, 0.05]) * size
    hip = np.sqrt(2.0) * np.array([0.3, 0.1, 1.0, 0.25, 0.3, 0.1]) * size
    return tuple(float(v) for v in arm), tuple(float(v) for v in hip)


def run_session(
    subject: Subject, *, with_device: bool, setting: Setting, scene: bool = False
) -> SessionEffort:
    """Record, estimate, reduce."""
    protocol, errors = setting.protocol, setting.errors
    made = record_session(subject, with_device=with_device, setting=setting, gyroscopes=False)
    device = device_of(subject, setting.table) if with_device else None
    frames = gather(
        [made.suit, made.shoes], session_setup(made.body, device=device), clocks="shared"
    )
    frames = replace(frames, suite=trusted(frames, errors))
    found = estimate(frames, variances="given", checks=False, threads=1)
    every = round(_POSTURE_S * protocol.rate_hz)
    turned = np.radians(
        np.sqrt(errors.segment_deg**2 + errors.wander_deg**2 + errors.orientation_noise_deg**2)
    )

    def device_readings(motion: Motion) -> dict[str, Array]:
        readings: dict[str, Array] = {}
        wear(frames.setup, motion, [], readings)
        return readings

    posture = np.zeros_like(found.torques.torque)
    if turned > 0:
        posture = posture_deviation(
            frames.suite, frames.motion, frames.measured, segment_rad=turned, every=every,
            computed=device_readings if with_device else None, threads=1,
        )  # fmt: skip
    rows = np.rint(frames.time_s * protocol.rate_hz).astype(np.int64)
    torque, truth = found.torques.torque, made.torque_nm[rows]
    deviation = np.hypot(found.torques.torque_deviation, posture)
    block = protocol.block_of(frames.time_s)
    raised = found.elevation_rad if frames.device is None else frames.device.elevation_rad
    working = working_frames(raised[:, 1], rate_hz=protocol.rate_hz)
    working_true = working_frames(made.elevation_rad[rows, 1], rate_hz=protocol.rate_hz)
    names = made.body.joints
    error = torque - truth
    return SessionEffort(
        subject=subject,
        with_device=with_device,
        joints=names,
        measured=_by_block(torque, names, block, working, protocol.blocks),
        true=_by_block(truth, names, block, working_true, protocol.blocks),
        second_nm=_by_second(torque, frames.time_s, protocol.duration_s),
        true_second_nm=_by_second(truth, frames.time_s, protocol.duration_s),
        frames=len(torque),
        inside=np.mean(np.abs(error) <= _95 * deviation, axis=0),
        error_nm=_rms(error),
        deviation_nm=_rms(deviation),
        sensor_nm=_rms(found.torques.torque_deviation),
        posture_nm=_rms(posture),
        residual=_rms(found.torques.residual),
        balance=made.balance,
        scene=_scene(found, deviation, protocol, with_device) if scene else None,
    )


def _rms(values: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))


def _by_block(
    torque: Array, joints: tuple[str, ...], block: NDArray[Any], working: NDArray[Any], count: int
) -> BlockEffort:
    shoulders = [
        [k for k, name in enumerate(joints) if name.startswith(f"j{side.capitalize()}Shoulder")]
        for side in SIDES
    ]
    found = [effort(torque, joints=joints, working=working & (block == b)) for b in range(count)]
    held = [torque[working & (block == b)] for b in range(count)]
    return BlockEffort(
        norm_nm=np.array([one.norm_nm for one in found]),
        rms_nm=np.array([one.total_rms_nm for one in found]),
        mean_abs_nm=np.array([one.total_mean_abs_nm for one in found]),
        joint_nm=np.array([one.mean_abs_nm for one in found]),
        area_nm=np.array([[one.area_norm_nm[area] for area in AREAS] for one in found]),
        shoulder_nm=np.array(
            [[np.linalg.norm(t[:, own], axis=1).mean() for own in shoulders] for t in held]
        ),
        signed_nm=np.array([torque[block == b].mean() for b in range(count)]),
    )


def _by_second(torque: Array, time_s: Array, duration_s: float) -> Array:
    second = time_s.astype(np.int64)
    norm = np.linalg.norm(torque, axis=1)
    count = np.bincount(second, minlength=int(duration_s))
    total = np.bincount(second, weights=norm, minlength=int(duration_s))
    return np.asarray(np.where(count > 0, total / np.maximum(count, 1), np.nan))


def _scene(found: RecordedTorques, deviation: Array, protocol: Protocol, with_device: bool) -> Any:
    """Some movements of the first block, for the picture and the page."""
    start = protocol.starts_s[0]
    first, last = np.searchsorted(found.time_s, start + np.array(_SHOWN_S))
    rows = slice(int(first), int(last))
    shown = estimate(found.frames.select(rows), variances="given", checks=False, threads=1)
    torques = replace(shown.torques, torque_deviation=deviation[rows])
    return replace(shown, torques=torques).scene(
        name="with the device" if with_device else "without the device"
    )
