"""Whole-body torques from recorded or simulated files: one call from recordings to numbers with errors.

Motion, inertial sensors, shoes, plates and worn devices are put on one clock and through one filter,
checked against each other, and handed to the estimate of :mod:`ulna.torques`. What does not fit is
named: exchanged shoes, a sensor that is dead or on another segment, a mass that is not the model's.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._capture_checks import (
    fit_variances,
    look_at_contacts,
    look_at_imus,
    look_at_sensors,
    look_at_soles,
    look_at_unknowns,
)
from ._capture_frames import gather
from ._capture_motion import frames_of, known_frames, newton_euler, poses_of
from ._capture_readings import arms
from ._capture_setup import setup_of
from ._start_check import in_world
from .body import Body, Motion
from .motion import rotation_matrices
from .record import Finding, refuse
from .torques import BodyTorques, SensorFit, SensorSuite, StartCheck, estimate_torques

if TYPE_CHECKING:
    from pathlib import Path

    from ._body_scene import BodyScene
    from .assist import DeviceWrenches, PassiveDevice
    from .clocks import ClockFit
    from .effort import Effort

__all__ = [
    "BodySetup",
    "CapturedFrames",
    "Contact",
    "Deviations",
    "Imu",
    "RecordedTorques",
    "Touch",
    "estimate",
    "gather",
    "read_setup",
    "recorded_torques",
]

Array = NDArray[np.float64]

_CHECKED_FRAMES = 1000  # spread over the recording, for the checks and the fit of variances
_STATE_FRAMES = 20


@dataclass(frozen=True)
class Contact:
    """A shoe or a plate that measures what the ground does to a link.

    Attributes
    ----------
    name, link : str
    position_m, orientation : (3,) and (3, 3) array
        Where it measures, in the link, and its axes as columns.
    frame : {"link", "world_axes", "world"}
        ``"world"`` is a plate in the floor: moments about a place of the world.
    prefix : str, optional
        Of the channels ``<prefix>_F_x`` to ``<prefix>_M_z``; the name, or else the link, unless given.
    sign : {1, -1}
        -1 where the file holds what the person does to the ground.
    force_n, moment_nm : float, optional
        Standard deviations, where they differ from those of the setup.
    """

    name: str
    link: str
    position_m: ArrayLike = (0.0, 0.0, 0.0)
    orientation: ArrayLike = field(default_factory=lambda: np.eye(3))
    frame: str = "link"
    prefix: str | None = None
    sign: int = 1
    force_n: float | None = None
    moment_nm: float | None = None

    def __post_init__(self) -> None:
        if self.sign not in (1, -1):
            raise refuse(f"the sign of the contact {self.name!r} must be 1 or -1", "sign")


@dataclass(frozen=True)
class Imu:
    """An inertial sensor on a link.

    Attributes
    ----------
    link : str
    name : str, optional
        ``"imu <link>"`` unless given.
    position_m, orientation : (3,) and (3, 3) array, optional
        In the link, axes as columns. Found from a calibration motion, or else from the recording,
        unless both are given.
    prefix : str, optional
        Of the channels ``<prefix>_sensor_acceleration_x`` …; the link unless given.
    """

    link: str
    name: str = ""
    position_m: ArrayLike | None = None
    orientation: ArrayLike | None = None
    prefix: str | None = None


@dataclass(frozen=True)
class Touch:
    """Something that touches a link and is not measured, such as a wall under a hand.

    Attributes
    ----------
    link : str
    position_m : (3,) array
        Where, in the link.
    force_only : bool
        A force at this place without a moment. Two hands with a moment each cannot be told apart by
        the six equations of balance.
    """

    link: str
    position_m: ArrayLike = (0.0, 0.0, 0.0)
    force_only: bool = True


@dataclass(frozen=True)
class Deviations:
    """Standard deviations of the filtered readings, before the data are asked.

    `angle_rad` and `base_angle_rad` are errors of the joints' angles and of the base's orientation beside
    the noise that the recording shows, such as those of a suit's calibration.
    """

    imu_m_s2: float = 0.3
    joint_rad_s2: float = 0.5
    base_m_s2: float = 0.5
    base_rad_s2: float = 0.5
    force_n: float = 2.0
    moment_nm: float = 0.5
    device_n: float = 1.5
    device_nm: float = 0.5
    angle_rad: float = 0.0
    base_angle_rad: float = 0.0


@dataclass(frozen=True)
class BodySetup:
    """A body and what is worn and stood on.

    Attributes
    ----------
    body : Body
    contacts : tuple of Contact, optional
        Found by the names of channels (``RightFoot_F_x``) unless given.
    imus : tuple of Imu, optional
        Every link with channels of an accelerometer unless given.
    device : PassiveDevice, optional
        Its wrenches act on the upper arms and the pelvis.
    deviations : Deviations
    source : str
        The file.
    touches : tuple of Touch
        What else touches the person.
    """

    body: Body
    contacts: Sequence[Contact] | None = None
    imus: Sequence[Imu] | None = None
    device: PassiveDevice | None = None
    deviations: Deviations = field(default_factory=Deviations)
    source: str = ""
    touches: Sequence[Touch] = ()

    def __post_init__(self) -> None:
        for one in (*(self.contacts or ()), *(self.imus or ()), *self.touches):
            if one.link not in self.body.links:
                what = getattr(one, "name", "") or type(one).__name__
                raise refuse(
                    f"{what!r} is on the link {one.link!r}, which the body has not", "link"
                )


def read_setup(path: str | os.PathLike[str]) -> BodySetup:
    """A body with its sensors from a file: TOML, URDF, MJCF, or JSON (see `ulna.body.read_body`).

    Examples
    --------
    >>> import pathlib
    >>> _ = pathlib.Path("person.toml").write_text('''
    ... [body]
    ... height_m = 1.8
    ... mass_kg = 75
    ... [[attach]]
    ... name = "drill"
    ... link = "RightHand"
    ... mass_kg = 0.66
    ... centre_m = [0.05, -0.1, 0]
    ... ''')
    >>> read_setup("person.toml").body
    Body(49 links, 48 joints, 75.66 kg, base 'Pelvis')
    """
    return setup_of(path)


@dataclass(frozen=True, eq=False)
class CapturedFrames:
    """A capture on one clock: what `gather` makes of the files and `estimate` takes.

    Attributes
    ----------
    time_s : ndarray, shape (frames,)
    rate_hz : float
    setup : BodySetup
    motion : Motion
    suite : SensorSuite
    measured : ndarray, shape (frames, rows)
    loss : ndarray, shape (frames,)
        By how much gaps near a frame widen its standard deviations, at most; 1 without gaps.
    state_noise : mapping of str to ndarray
        Standard deviations of what the estimate takes as known: ``"angle"`` (joints,) and ``"base"``
        (3,), its orientation about the world's axes, in rad.
    mounting : mapping of str to float
        Standard deviation that the uncertain mount of an inertial sensor adds, m/s^2.
    contacts : tuple of str
        Sensors that stand on the ground.
    clocks : mapping of str to ClockFit
        By recording.
    gyroscopes : mapping of str to ndarray
        By sensor, rad/s in its axes; only the checks read them.
    device : DeviceWrenches or None
    sources, notes : tuple of str
    findings : tuple of Finding
        What the files themselves told.
    """

    time_s: Array
    rate_hz: float
    setup: BodySetup
    motion: Motion
    suite: SensorSuite
    measured: Array
    loss: Array
    contacts: tuple[str, ...]
    state_noise: Mapping[str, Array] = field(default_factory=dict)
    mounting: Mapping[str, float] = field(default_factory=dict)
    clocks: Mapping[str, ClockFit] = field(default_factory=dict)
    gyroscopes: Mapping[str, Array] = field(default_factory=dict)
    device: DeviceWrenches | None = None
    sources: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    findings: tuple[Finding, ...] = ()

    def __len__(self) -> int:
        return len(self.time_s)

    def __repr__(self) -> str:
        return (
            f"<CapturedFrames: {len(self)} frames at {self.rate_hz:.6g} Hz, "
            f"{len(self.suite.sensors)} sensors on {self.setup.body!r}>"
        )

    def select(self, rows: Any) -> CapturedFrames:
        """Some of the frames: a slice or an array of row numbers."""
        motion = frames_of(self.motion, rows)
        return replace(
            self, time_s=self.time_s[rows], motion=motion, measured=self.measured[rows],
            loss=self.loss[rows], device=None,
            gyroscopes={name: values[rows] for name, values in self.gyroscopes.items()},
        )  # fmt: skip


def recorded_torques(
    recordings: Any,
    body: Any,
    *,
    calibration: Any = None,
    clocks: str = "fit",
    rate_hz: float | None = None,
    window_s: float = 0.25,
    order: int = 4,
    variances: str = "data",
    wrenches: bool = False,
    checks: bool = True,
    threads: int = 0,
    progress: bool = False,
) -> RecordedTorques:
    """Torques of a capture with their standard deviations and what does not fit.

    Parameters
    ----------
    recordings
        A file or an `ulna.Record`, or several: MVNX, MOT, STO, C3D (its plates), CSV and what else
        `ulna.read` reads. One of them holds the motion: angles of all joints by name, or orientations
        of all segments.
    body : BodySetup, Body or path
    calibration
        Recording in which every segment with a sensor turns about two axes: it tells where the
        sensors sit. Without one the recording itself is asked.
    clocks : {"fit", "shared"}
        Whether several recordings have a clock each, to be put together by the vertical force, or one.
    rate_hz : float, optional
        Of the frames; that of the motion unless given.
    window_s, order
        Of the local polynomial that all signals pass. Frames with half a window at either end are
        left out. Angles that come with rates and accelerations are taken as they are.
    variances : {"data", "given"}
        Whether standard deviations of the sensors are those that make the recording most likely.
    wrenches : bool
        Keep the wrenches on all links.
    checks : bool
        Look for wrong data.
    threads : int
        0: one a processor.
    progress : bool

    Returns
    -------
    RecordedTorques

    Examples
    --------
    Two links, a hinge, and a plate below:

    >>> import ulna
    >>> from ulna.body import Link, body_from_links
    >>> ball = dict(mass_kg=10.0, inertia_kg_m2=np.eye(3))
    >>> body = body_from_links([Link("foot", **ball), Link("leg", parent="foot", joint="ankle",
    ...     axis=[0, 1, 0], centre_m=[0, 0, 0.5], **ball)])
    >>> t = np.arange(0, 5, 0.01)
    >>> angle = 0.2 * np.sin(2 * t)
    >>> truth = Motion(angle[:, None], 0.4 * np.cos(2 * t)[:, None], -0.8 * np.sin(2 * t)[:, None])
    >>> torque, plate = body.inverse_dynamics(truth)
    >>> noise = np.random.default_rng(0).normal(size=(500, 6))
    >>> log = ulna.Record.from_arrays(t, {"ankle": angle, **dict(zip(
    ...     [f"foot_{w}_{a}" for w in "FM" for a in "xyz"], (plate + 0.1 * noise).T))},
    ...     units={"ankle": "rad"})
    >>> found = recorded_torques(log, BodySetup(body))
    >>> bool(np.abs(found.torques.torque - torque[12:-12]).max() < 0.2), found.findings
    (True, ())
    """
    frames = gather(
        recordings, body, calibration=calibration, clocks=clocks, rate_hz=rate_hz,
        window_s=window_s, order=order, progress=progress,
    )  # fmt: skip
    return estimate(
        frames, variances=variances, wrenches=wrenches, checks=checks, threads=threads,
        progress=progress,
    )  # fmt: skip


def estimate(
    frames: CapturedFrames,
    *,
    variances: str = "data",
    wrenches: bool = False,
    checks: bool = True,
    threads: int = 0,
    progress: bool = False,
) -> RecordedTorques:
    """Torques of frames that are on one clock already; arguments as for `recorded_torques`."""
    if variances not in ("data", "given"):
        raise refuse(f"variances is {variances!r}: it must be 'data' or 'given'", "variances")
    usable = np.flatnonzero(known_frames(frames.motion))
    if not usable.size:
        raise refuse("no frame has the angles of all joints", "recordings")
    some = frames.select(usable[:: max(1, len(usable) // _CHECKED_FRAMES)])
    findings = list(frames.findings)
    start = None
    if checks:
        findings += look_at_unknowns(some)
        start, found = look_at_contacts(some)
        findings += found + look_at_soles(some) + look_at_imus(some)
        if variances == "given":
            findings += look_at_sensors(some, named={f.channel for f in findings})
    suite, fit = frames.suite, None
    if variances == "data":
        fit, found = fit_variances(some, named={f.channel for f in findings}, threads=threads)
        suite = fit.suite
        findings += found if checks else []
    suite = _with_mounts(suite, frames.mounting)
    torques = estimate_torques(
        suite, frames.motion, frames.measured, wrenches=wrenches, threads=threads,
        progress=progress,
    )  # fmt: skip
    widened = frames.loss[:, None]
    of_state = _of_state(replace(frames, suite=suite), usable)
    torques = replace(
        torques,
        torque_deviation=np.hypot(torques.torque_deviation * widened, of_state),
        residual_deviation=torques.residual_deviation * widened,
    )
    return RecordedTorques(replace(frames, suite=suite), torques, start, fit, tuple(findings))


def _with_mounts(suite: SensorSuite, mounting: Mapping[str, float]) -> SensorSuite:
    """The same sensors, less certain by how they are mounted."""
    deviation = suite.deviation
    for name, size in mounting.items():
        row = suite.row(name)
        deviation[row : row + 3] = np.hypot(deviation[row : row + 3], size)
    return suite.with_deviation(deviation) if mounting else suite


def _of_state(frames: CapturedFrames, usable: NDArray[np.int64]) -> Array:
    """Standard deviation of each torque from errors of the angles, which the estimate takes as known.

    Every angle is turned by its standard deviation in some frames spread over the recording.
    """
    given = frames.setup.deviations
    joints = len(frames.setup.body.joints)
    angle = np.hypot(frames.state_noise.get("angle", np.zeros(joints)), given.angle_rad)
    turn = np.hypot(frames.state_noise.get("base", np.zeros(3)), given.base_angle_rad)
    if not angle.any() and not turn.any():
        return np.zeros(joints)
    some = frames.select(usable[:: max(1, len(usable) // _STATE_FRAMES)])

    def torque(motion: Motion) -> Array:
        return estimate_torques(some.suite, motion, some.measured, deviations=False).torque

    plain = torque(some.motion)
    square = np.zeros_like(plain)
    for joint, size in enumerate(angle):
        moved = np.array(some.motion.angle)
        moved[:, joint] += size
        square += (torque(replace(some.motion, angle=moved)) - plain) ** 2
    if some.motion.orientation is not None:
        for axis, size in enumerate(turn):
            half = np.zeros(4)
            half[0], half[1 + axis] = np.cos(0.5 * size), np.sin(0.5 * size)
            moved = _after(half, np.asarray(some.motion.orientation))
            square += (torque(replace(some.motion, orientation=moved)) - plain) ** 2
    return np.asarray(np.sqrt(np.nanmean(square, axis=0)))


def _after(turn: Array, q: Array) -> Array:
    """Quaternions (n, 4) turned further in the world."""
    w, v = turn[0], turn[1:]
    scalar = w * q[:, 0] - q[:, 1:] @ v
    return np.column_stack([scalar, w * q[:, 1:] + q[:, :1] * v + np.cross(v, q[:, 1:])])


@dataclass(frozen=True, eq=False)
class RecordedTorques:
    """Torques of a capture, how sure they are, and what does not fit.

    Attributes
    ----------
    frames : CapturedFrames
        Their suite has the standard deviations that were used.
    torques : BodyTorques
        Standard deviations are wider where samples were missing.
    start : StartCheck or None
        None without contacts or without checks.
    fit : SensorFit or None
        Of the variances.
    findings : tuple of Finding
        What does not fit: ``"error"``, ``"warning"`` and ``"note"``.
    """

    frames: CapturedFrames
    torques: BodyTorques
    start: StartCheck | None
    fit: SensorFit | None
    findings: tuple[Finding, ...]

    @property
    def body(self) -> Body:
        """The body."""
        return self.frames.setup.body

    @property
    def time_s(self) -> Array:
        """Of the frames."""
        return self.frames.time_s

    @property
    def motion(self) -> Motion:
        """Of the body."""
        return self.frames.motion

    @property
    def sound(self) -> bool:
        """Whether nothing was found that makes the torques wrong."""
        return not any(finding.severity == "error" for finding in self.findings)

    @cached_property
    def elevation_rad(self) -> Array | None:
        """Of the upper arms from hanging, (frames, 2), left and right; None for a body without arms."""
        from .assist import elevation

        found = arms(self.body, self.motion)
        return None if found is None else elevation(found[1] - found[0])

    @cached_property
    def _newton_euler(self) -> tuple[Array, Array]:
        """Torques of the motion alone, and what the base then lacks less what the contacts give it."""
        torque, lack = newton_euler(self.body, self.motion)
        poses = poses_of(self.body, self.motion)
        suite = self.frames.suite
        for sensor in suite.sensors:
            if sensor.kind == "external_wrench":
                row = suite.row(sensor.name)
                given = in_world(
                    sensor, self.frames.measured[:, row : row + 6], poses, self.body.links
                )
                moment = given[:, 3:] - np.cross(poses[:, 0, :3], given[:, :3])
                lack = lack - np.hstack([given[:, :3], moment])
        return torque, lack

    @property
    def balance(self) -> Array:
        """What the measured wrenches lack at the base link's origin for the measured motion, by
        Newton-Euler, (frames, 6), N and N m, world axes."""
        return self._newton_euler[1]

    @property
    def from_above(self) -> Array | None:
        """Torques by Newton-Euler from the free ends down, N m, (frames, joints).

        Where all contacts are on the base link these follow from the motion alone; None elsewhere.
        """
        base = self.body.links[0]
        places = {s.place for s in self.frames.suite.sensors if s.kind == "external_wrench"}
        return self._newton_euler[0] if places == {base} else None

    @cached_property
    def from_below(self) -> Array | None:
        """Torques from the contacts up: `from_above` less what the balance lacks about each joint."""
        above = self.from_above
        if above is None:
            return None
        poses = poses_of(self.body, self.motion)
        carriers = {link.joint: k for k, link in enumerate(self.body.describe())}
        links = self.body.describe()
        out = np.array(above)
        for column, joint in enumerate(self.body.joints):
            at = carriers[joint]
            axis = rotation_matrices(poses[:, at, 3:]) @ links[at].axis
            arm = poses[:, at, :3] - poses[:, 0, :3]
            moment = self.balance[:, 3:] - np.cross(arm, self.balance[:, :3])
            out[:, column] -= np.sum(axis * moment, axis=1)
        return out

    def effort(self, *, working: ArrayLike | None = None) -> Effort:
        """Effort of the joints; see `ulna.effort.effort`."""
        from .effort import AREAS, area_of, effort

        joints = self.torques.joints
        human = all(link in self.body.links for link in ("Pelvis", "RightFoot", "LeftFoot"))
        areas = [area_of(joint) for joint in joints] if human else ["body"] * len(joints)
        assert not human or set(areas) <= set(AREAS)
        return effort(
            self.torques.torque, joints=joints, areas=areas, working=working,
            body_mass_kg=self.body.mass_kg,
        )  # fmt: skip

    def scene(self, *, name: str = "", rate_hz: float = 30.0, per_kg: bool = False) -> BodyScene:
        """The moving body coloured by the torques of its joints, for pictures and pages."""
        from ._body_show import scene_of

        return scene_of(self, name=name, rate_hz=rate_hz, per_kg=per_kg)

    def picture(self, path: Any, *, time_s: float | None = None, **drawing: Any) -> Path:
        """Write the body at a time, or in its hardest frame, as an image and return its path.

        Other keywords are those of `ulna.plot.body_effort`, such as ``beside``.
        """
        from ._body_show import write_picture

        return write_picture(self, path, time_s=time_s, **drawing)

    def page(self, path: Any, *, beside: RecordedTorques | None = None, **page: Any) -> Path:
        """Write the moving body as one interactive HTML file and return its path.

        Other keywords are those of `ulna.plot.body_page`.
        """
        from .plot import body_page

        return body_page(self, path, beside=beside, **page)

    def report(self, path: Any, *, title: str = "", command: str | None = None) -> Path:
        """Write a report as one HTML file and return its path."""
        from ._capture_report import write_report

        return write_report(self, path, title=title, command=command)

    def tables(self, folder: Any) -> tuple[Path, ...]:
        """Write torques, balance and joints as text tables into a folder and return their paths."""
        from ._capture_tables import write_tables

        return write_tables(self, folder)

    def plot(self, axes: Any = None, *, joints: Sequence[str] | None = None) -> Any:
        """Torques with their intervals and the balance: :func:`ulna.plot.body_torques`."""
        return self.torques.plot(axes, joints=joints, time_s=self.time_s)

    def summary(self) -> str:
        """What was found, as text."""
        from ._capture_tables import summary_of

        return summary_of(self)

    def __repr__(self) -> str:
        errors = sum(finding.severity == "error" for finding in self.findings)
        spread = self.torques.torque_deviation
        told = f" ± {np.nanmedian(spread):.2g} N m" if spread.size else ""
        return (
            f"<RecordedTorques: {len(self.frames)} frames, {len(self.torques.joints)} joints{told}"
            + (f", {errors} findings that make them wrong" if errors else "")
            + ">"
        )
