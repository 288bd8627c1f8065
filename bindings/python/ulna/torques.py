"""Joint torques of a body with their standard deviations, from its motion and what touches it.

The maximum a posteriori estimate of Latella et al. 2021: accelerometers, accelerations of joints,
measured and unknown external wrenches, and the body's own dynamics, weighed by how far each is
trusted. A missing sample is NaN: it widens the result and is never read as zero. Conventions are
those of :mod:`ulna.body`.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._call import (
    FormatError,
    Handle,
    check,
    ffi,
    lib,
    long_call,
    options,
    out_array,
    result,
    text,
    view,
)
from ._start_check import StartCheck, start_check
from .body import Body, Motion, human_names, read_body
from .record import pick, refuse

__all__ = [
    "BodySensor",
    "BodyTorques",
    "Identifiability",
    "Prior",
    "SensorFit",
    "SensorSuite",
    "StartCheck",
    "TorqueStream",
    "estimate_torques",
    "model_sensors",
    "start_check",
    "suit_sensors",
]

Array = NDArray[np.float64]

_KINDS = {
    "accelerometer": lib.ULNA_SENSOR_ACCELEROMETER,
    "angular_acceleration": lib.ULNA_SENSOR_ANGULAR_ACCELERATION,
    "joint_acceleration": lib.ULNA_SENSOR_JOINT_ACCELERATION,
    "external_wrench": lib.ULNA_SENSOR_EXTERNAL_WRENCH,
    "external_force": lib.ULNA_SENSOR_EXTERNAL_FORCE,
    "free_wrench": lib.ULNA_SENSOR_FREE_WRENCH,
    "free_force": lib.ULNA_SENSOR_FREE_FORCE,
    "joint_torque": lib.ULNA_SENSOR_JOINT_TORQUE,
    "joint_wrench": lib.ULNA_SENSOR_JOINT_WRENCH,
}
ROWS = dict(zip(_KINDS, (3, 3, 1, 6, 3, 0, 0, 1, 6), strict=True))
_OF_JOINTS = {"joint_acceleration", "joint_torque", "joint_wrench"}
_FRAMES = {
    "link": lib.ULNA_SENSOR_FRAME_LINK,
    "world_axes": lib.ULNA_SENSOR_FRAME_WORLD_AXES,
    "world": lib.ULNA_SENSOR_FRAME_WORLD,
}
_SOLVERS = {"closed_form": lib.ULNA_SOLVER_CLOSED_FORM, "sparse": lib.ULNA_SOLVER_SPARSE}
_95 = 1.959963984540054


class _Sensors(Handle):
    kind = "ulna_sensors"
    __slots__ = ()


class _Torques(Handle):
    kind = "ulna_torques"
    __slots__ = ()


class _Stream(Handle):
    kind = "ulna_torque_stream"
    __slots__ = ()


@dataclass(frozen=True)
class BodySensor:
    """One sensor, or one contact. Wrenches on one link add up.

    Attributes
    ----------
    name : str
    kind : str
        ``"accelerometer"`` (3 rows: proper acceleration, m/s^2), ``"angular_acceleration"`` (3),
        ``"joint_acceleration"`` (1), ``"external_wrench"`` (6: force, moment about the sensor's
        place), ``"external_force"`` (3), ``"free_wrench"`` and ``"free_force"`` (no rows: something
        touches, nobody knows how), ``"joint_torque"`` (1), ``"joint_wrench"`` (6).
    place : str
        Link, or joint for kinds of joints.
    deviation : float or sequence
        Standard deviation of the noise: one for all rows, one each, or two for the forces and the
        moments of a wrench. Of free wrenches: how large they may be.
    position_m, orientation : (3,) and (3, 3) array
        In the link; columns are the sensor's axes.
    frame : {"link", "world_axes", "world"}
        ``"world_axes"``: the axes are the world's; ``"world"``: the place is as well (a plate).
    """

    name: str
    kind: str
    place: str
    deviation: float | Sequence[float] | None = None
    position_m: ArrayLike = (0.0, 0.0, 0.0)
    orientation: ArrayLike = field(default_factory=lambda: np.eye(3))
    frame: str = "link"


def suit_sensors(
    body: Body,
    *,
    imu_m_s2: float = 0.1,
    joint_rad_s2: float = 0.5,
    shoe_n: float = 2.0,
    shoe_nm: float = 0.5,
) -> list[BodySensor]:
    """The suit of the overhead study on a human body: 17 accelerometers at the centres of mass of
    their links, the accelerations of all joints, and the wrenches of two shoes at the feet.

    Names: ``"imu <link>"``, the joints', ``"shoe RightFoot"``, ``"shoe LeftFoot"``.

    Examples
    --------
    >>> from ulna.body import human_body
    >>> len(suit_sensors(human_body(height_m=1.8, mass_kg=75)))
    67
    """
    centres = {link.name: link.centre_m for link in body.describe()}
    missing = [name for name in human_names("suit") if name not in centres]
    if missing:
        raise refuse(f"the body has no link {missing[0]!r}, which wears a sensor", "body")
    sensors = [
        BodySensor(f"imu {name}", "accelerometer", name, imu_m_s2, position_m=centres[name])
        for name in human_names("suit")
    ]
    sensors += [BodySensor(name, "joint_acceleration", name, joint_rad_s2) for name in body.joints]
    return sensors + [
        BodySensor(f"shoe {foot}", "external_wrench", foot, (shoe_n, shoe_nm))
        for foot in ("RightFoot", "LeftFoot")
    ]


def model_sensors(
    path: str | os.PathLike[str],
    *,
    imu_m_s2: float = 0.1,
    joint_rad_s2: float = 0.1,
    plate_n: float = 1.0,
    plate_nm: float = 0.3,
    still: float = 1e-3,
) -> list[BodySensor]:
    """Sensors that a JSON model names beside its ``links`` (see :func:`ulna.body.read_body`).

    ``imu`` (link, position, fixed-axis ``rpy_rad``) becomes the accelerometer ``"imu"``; ``plate``
    (link) the external wrench ``"plate"``, and its link, which stands, the accelerometer and the
    angular acceleration ``"still"`` and ``"upright"`` (readings 0, 0, g and 0, 0, 0); every joint an
    acceleration of its name. Numbers are standard deviations.
    """
    body = read_body(path)
    with open(path, encoding="utf-8") as file:
        content = json.load(file)
    sensors = []
    try:
        if "plate" in content:
            link = content["plate"]["link"]
            sensors += [
                BodySensor("still", "accelerometer", link, still, frame="world_axes"),
                BodySensor("upright", "angular_acceleration", link, still, frame="world_axes"),
            ]
        if "imu" in content:
            imu = content["imu"]
            sensors.append(
                BodySensor(
                    "imu",
                    "accelerometer",
                    imu["link"],
                    imu_m_s2,
                    position_m=np.asarray(imu["position"], dtype=float),
                    orientation=roll_pitch_yaw(*map(float, imu["rpy_rad"])),
                )
            )
        sensors += [
            BodySensor(name, "joint_acceleration", name, joint_rad_s2) for name in body.joints
        ]
        if "plate" in content:
            sensors.append(
                BodySensor(
                    "plate", "external_wrench", content["plate"]["link"], (plate_n, plate_nm)
                )
            )
    except (KeyError, TypeError, ValueError) as failure:
        raise FormatError(
            f"imu or plate of {os.fspath(path)} cannot be read: {type(failure).__name__} {failure}",
            status="ULNA_ERROR_FORMAT",
            argument="path",
        ) from failure
    return sensors


def roll_pitch_yaw(roll: float, pitch: float, yaw: float) -> Array:
    """Rotation by angles about the fixed axes x, y and z, in this order."""
    (cr, cp, cy), (sr, sp, sy) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    return z @ y @ x


@dataclass(frozen=True)
class Prior:
    """Standard deviations of what is assumed before anything is measured: rest, nothing touches."""

    base_acceleration_m_s2: float = 100.0
    base_angular_acceleration_rad_s2: float = 300.0
    joint_acceleration_rad_s2: float = 300.0
    force_n: float = 1000.0
    moment_nm: float = 300.0
    untouched_force_n: float = 1e-3
    untouched_moment_nm: float = 1e-4

    def _struct(self) -> Any:
        return options("ulna_prior_options", **vars(self))


@dataclass(frozen=True)
class Identifiability:
    """What sensors can tell at one pose: unknowns, and how many combinations are determined."""

    wrench_unknowns: int
    wrench_rank: int
    force_unknowns: int
    force_rank: int
    motion_unknowns: int
    motion_rank: int
    words: str

    @property
    def complete(self) -> bool:
        """Whether no acceleration and no free wrench is left to the prior."""
        return self.wrench_rank == self.wrench_unknowns and self.motion_rank == self.motion_unknowns

    def summary(self) -> str:
        """In words."""
        return self.words


@dataclass(frozen=True)
class SensorFit:
    """Standard deviations of sensors, found from a recording by maximum likelihood.

    Attributes
    ----------
    suite : SensorSuite
        The same sensors with these deviations.
    deviation : (rows,) array
    freedom : (rows,) array
        Pieces of information about each variance: a deviation has a relative standard error of
        ``1/sqrt(2 freedom)`` for noise without memory. Near 0: nothing else checks this row.
    log_likelihood : float
    converged : bool
    """

    suite: SensorSuite
    deviation: Array
    freedom: Array
    log_likelihood: float
    converged: bool

    def summary(self) -> str:
        """A line for each row."""
        lines = [f"log-likelihood {self.log_likelihood:.6g}, converged: {self.converged}"]
        for name, deviation, freedom in zip(
            self.suite.rows, self.deviation, self.freedom, strict=True
        ):
            error = deviation / np.sqrt(2.0 * freedom) if freedom > 0.5 else np.inf
            known = f"± {error:.2g}" if np.isfinite(error) else "(as given: nothing checks it)"
            lines.append(f"{name}: {deviation:.4g} {known}")
        return "\n".join(lines)


class SensorSuite:
    """What is measured on a body. Immutable.

    Attributes
    ----------
    body : Body
    sensors : tuple of BodySensor
    rows : tuple of str
        Names of the rows of measurements, in order: ``"shoe.force_x"``.

    Examples
    --------
    >>> from ulna.body import human_body
    >>> body = human_body(height_m=1.8, mass_kg=75)
    >>> suite = SensorSuite(body, [BodySensor("imu", "accelerometer", "T8", 0.1)])
    >>> suite.rows
    ('imu.x', 'imu.y', 'imu.z')
    """

    def __init__(
        self, body: Body, sensors: Sequence[BodySensor], *, prior: Prior | None = None
    ) -> None:
        self.body = body
        self.sensors = tuple(sensors)
        self.prior = prior or Prior()
        carriers = {link.joint: index for index, link in enumerate(body.describe()) if link.joint}
        links = {name: index for index, name in enumerate(body.links)}
        rows = np.zeros((len(self.sensors), lib.ULNA_SENSOR_VALUES))
        for row, sensor in zip(rows, self.sensors, strict=True):
            places = carriers if sensor.kind in _OF_JOINTS else links
            row[0] = pick(_KINDS, sensor.kind, "kind")
            if sensor.place not in places:
                what = "joint" if places is carriers else "link"
                raise refuse(
                    f"sensor {sensor.name!r} is on {what} {sensor.place!r}, which the body has not",
                    "place",
                )
            row[1] = places[sensor.place]
            row[2] = pick(_FRAMES, sensor.frame, "frame")
            row[3:6] = np.asarray(sensor.position_m, dtype=float)
            row[6:15] = np.asarray(sensor.orientation, dtype=float).reshape(9)
            row[15:] = np.nan
            if sensor.deviation is not None:
                given = np.atleast_1d(np.asarray(sensor.deviation, dtype=float))
                if given.ndim != 1 or given.size > 6 or np.isnan(given).any():
                    raise refuse(
                        f"sensor {sensor.name!r} has deviations that are no 1 to 6 numbers",
                        "deviation",
                    )
                row[15 : 15 + given.size] = given
        names = [ffi.new("char[]", sensor.name.encode()) for sensor in self.sensors]
        self._handle = _Sensors.make(
            lib.ulna_sensors_new,
            body._handle.pointer,
            view(rows),
            ffi.new("const char *[]", names),
            len(names),
            self.prior._struct(),
        )
        listed = text(lib.ulna_sensors_row_names, self._handle.pointer)
        self.rows = tuple(listed.split("\n")) if listed else ()

    def __repr__(self) -> str:
        return f"SensorSuite({len(self.sensors)} sensors, {len(self.rows)} rows, on {self.body!r})"

    def __reduce__(self) -> Any:
        return _rebuilt, (self.body, self.sensors, self.prior)

    def row(self, sensor: str) -> int:
        """First row of a sensor's measurements."""
        start = 0
        for own in self.sensors:
            if own.name == sensor:
                return start
            start += ROWS[own.kind]
        raise refuse(f"there is no sensor {sensor!r}", "sensor")

    @property
    def deviation(self) -> Array:
        """Standard deviations, one a row."""
        return out_array(lib.ulna_sensors_deviations, self._handle.pointer)

    def with_deviation(self, deviation: ArrayLike) -> SensorSuite:
        """The same sensors with other standard deviations, one a row."""
        values = np.asarray(deviation, dtype=float)
        # The library says what is wrong with them.
        _Sensors.make(lib.ulna_sensors_with_deviations, self._handle.pointer, view(values))
        sensors = []
        start = 0
        for sensor in self.sensors:
            count = ROWS[sensor.kind]
            if count:
                sensor = replace(sensor, deviation=tuple(values[start : start + count]))
            start += count
            sensors.append(sensor)
        return SensorSuite(self.body, sensors, prior=self.prior)

    def stack(self, readings: Mapping[str, ArrayLike], *, frames: int | None = None) -> Array:
        """Measurements as (frames, rows) from arrays by sensor; a sensor without one is missing.

        Examples
        --------
        >>> from ulna.body import human_body
        >>> body = human_body(height_m=1.8, mass_kg=75)
        >>> suite = SensorSuite(body, [BodySensor("a", "accelerometer", "T8", 0.1),
        ...                            BodySensor("q", "joint_acceleration", "jL5S1_roty", 0.5)])
        >>> suite.stack({"a": [[0, 0, 9.81]]})
        array([[0.  , 0.  , 9.81,  nan]])
        """
        unknown = set(readings) - {sensor.name for sensor in self.sensors}
        if unknown:
            raise refuse(f"there is no sensor {sorted(unknown)[0]!r}", "readings")
        arrays = {name: np.asarray(values, dtype=float) for name, values in readings.items()}
        if frames is None:
            if not arrays:
                raise refuse("without readings the number of frames must be given", "frames")
            frames = len(next(iter(arrays.values())))
        y = np.full((frames, len(self.rows)), np.nan)
        start = 0
        for sensor in self.sensors:
            count = ROWS[sensor.kind]
            if sensor.name in arrays:
                values = arrays[sensor.name]
                values = values[:, None] if values.ndim == 1 else values
                if values.shape != (frames, count):
                    raise refuse(
                        f"readings of {sensor.name!r} have shape {values.shape}; "
                        f"({frames}, {count}) is expected",
                        "readings",
                    )
                y[:, start : start + count] = values
            start += count
        return y

    def fit(
        self,
        motion: Motion,
        measured: ArrayLike,
        *,
        groups: ArrayLike | None = None,
        steps: int | None = None,
        frames: int | None = None,
        threads: int = 0,
    ) -> SensorFit:
        """Standard deviations from a recording by maximum likelihood.

        Parameters
        ----------
        motion : Motion
        measured : (frames, rows) array
        groups : (rows,) array of int, optional
            Rows of one group share a variance, -1 leaves a row as it is. Default: a group for each
            sensor, forces and moments apart.
        steps, frames : int, optional
            At most so many; default 60 and 2000.
        threads : int
            0: one a processor.
        """
        likelihood = ffi.new("double *")
        converged = ffi.new("int32_t *")
        count = ffi.new("int64_t *")
        values = np.empty((len(self.rows), 2))
        long_call(
            lib.ulna_sensors_fit,
            self._handle.pointer,
            motion._struct(),
            view(measured),
            options(
                "ulna_variance_options", groups=groups, steps=steps, frames=frames, threads=threads
            ),
            ffi.NULL,
            likelihood,
            converged,
            ffi.cast("double *", values.__array_interface__["data"][0]),
            values.size,
            count,
        )
        return SensorFit(
            suite=self.with_deviation(values[:, 0]),
            deviation=values[:, 0].copy(),
            freedom=values[:, 1].copy(),
            log_likelihood=float(likelihood[0]),
            converged=bool(converged[0]),
        )

    def identifiability(self, motion: Motion, measured: ArrayLike | None = None) -> Identifiability:
        """What the sensors can tell at the first frame of a motion; NaN in `measured`: missing."""
        struct = result("ulna_identifiability")
        words = text(
            lib.ulna_sensors_identify,
            self._handle.pointer,
            motion._struct(),
            ffi.NULL if measured is None else view(measured),
            struct,
        )
        names = ("wrench_unknowns", "wrench_rank", "force_unknowns", "force_rank",
                 "motion_unknowns", "motion_rank")  # fmt: skip
        return Identifiability(**{name: int(getattr(struct, name)) for name in names}, words=words)


def _rebuilt(body: Body, sensors: tuple[BodySensor, ...], prior: Prior) -> SensorSuite:
    return SensorSuite(body, sensors, prior=prior)


@dataclass(frozen=True)
class BodyTorques:
    """Torques of a recording.

    Attributes
    ----------
    joints, links, rows : tuple of str
    torque, torque_deviation : (frames, joints) array, N m
    joint_acceleration : (frames, joints) array, rad/s^2
    residual, residual_deviation : (frames, 6) array
        What the measured wrenches lack at the base link's origin for the measured motion (world
        axes), and the standard deviation that the sensors explain.
    balance_nis, motion_nis, motion_freedom : (frames,) array
        Squared normalised innovations: of the balance (6 on average) and of the accelerations
        (`motion_freedom` on average).
    innovation, innovation_deviation : (frames, rows) array
        Measured less estimated, NaN where missing, and the standard deviation of that.
    external, external_deviation, joint_wrench, joint_wrench_deviation : (frames, links, 6) array
        Net wrench from outside, and the wrench of the parent, on each link about its origin, link
        axes; empty unless kept.
    bridged : (frames,) array of bool
        Frames whose state was missing and lies between neighbours.
    unusable : int
        Frames without a state: their numbers are NaN.
    log_likelihood : float
    """

    joints: tuple[str, ...]
    links: tuple[str, ...]
    rows: tuple[str, ...]
    torque: Array
    torque_deviation: Array
    joint_acceleration: Array
    residual: Array
    residual_deviation: Array
    balance_nis: Array
    motion_nis: Array
    motion_freedom: Array
    innovation: Array
    innovation_deviation: Array
    external: Array
    external_deviation: Array
    joint_wrench: Array
    joint_wrench_deviation: Array
    bridged: NDArray[np.bool_]
    unusable: int
    log_likelihood: float

    def interval(self, joint: str) -> tuple[Array, Array]:
        """95 % interval of a joint's torque in every frame, N m."""
        if joint not in self.joints:
            raise refuse(f"there is no joint {joint!r}", "joint")
        k = self.joints.index(joint)
        half = _95 * self.torque_deviation[:, k]
        return self.torque[:, k] - half, self.torque[:, k] + half

    def suspects(self, *, limit: float = 2.0) -> dict[str, float]:
        """Rows whose innovations are more than `limit` times as large as expected (RMS), worst
        first: sensors that are wrong, or trusted too far."""
        if not self.innovation.size:
            return {}
        deviation = np.where(self.innovation_deviation > 0.0, self.innovation_deviation, np.nan)
        with np.errstate(invalid="ignore"):
            squares = (self.innovation / deviation) ** 2
        found = {}
        for name, column in zip(self.rows, squares.T, strict=True):
            there = column[np.isfinite(column)]
            size = float(np.sqrt(there.mean())) if there.size else 0.0
            if size > limit:
                found[name] = size
        return dict(sorted(found.items(), key=lambda item: -item[1]))

    def summary(self) -> str:
        """Range of every torque, the residual, and what is suspect."""
        used = len(self.torque) - self.unusable
        lines = [
            f"{len(self.torque)} frames, {int(self.bridged.sum())} bridged, "
            f"{self.unusable} without a state"
        ]
        if used:
            if self.residual.size:
                rms = np.sqrt(np.nanmean(self.residual**2, axis=0))
                lines.append("balance residual RMS: " + ", ".join(f"{v:.3g}" for v in rms))
                lines.append(f"balance NIS {np.nanmean(self.balance_nis):.3g} (6 expected)")
            for k, joint in enumerate(self.joints):
                column = self.torque[:, k]
                line = f"{joint}: {np.nanmin(column):.3g} to {np.nanmax(column):.3g} N m"
                if self.torque_deviation.size:
                    line += f" ± {np.nanmedian(self.torque_deviation[:, k]):.2g}"
                lines.append(line)
        suspects = self.suspects()
        if suspects:
            listed = ", ".join(f"{name} ({size:.1f})" for name, size in list(suspects.items())[:6])
            lines.append(f"larger than expected: {listed}")
        return "\n".join(lines)

    def plot(
        self,
        axes: Any = None,
        *,
        joints: Sequence[str] | None = None,
        time_s: ArrayLike | None = None,
    ) -> Any:
        """Torques with their intervals and the balance: :func:`ulna.plot.body_torques`."""
        from .plot import body_torques

        return body_torques(self, axes, joints=joints, time_s=time_s)

    def __repr__(self) -> str:
        return (
            f"BodyTorques({len(self.torque)} frames, {len(self.joints)} joints, "
            f"{int(self.bridged.sum())} bridged, {self.unusable} without a state)"
        )


def _torque_options(
    solver: str,
    stack: bool,
    deviations: bool,
    wrenches: bool,
    threads: int,
    longest_gap: int,
    model_deviation: float | Sequence[float] | None,
    momentum_rate_deviation: Sequence[float] | None,
) -> Any:
    given: dict[str, Any] = {}
    if model_deviation is not None:
        four = np.broadcast_to(np.asarray(model_deviation, dtype=float), (4,))
        if not np.isfinite(four).all() or (four < 0.0).any():
            raise refuse(
                "deviations of the model must be finite and not negative", "model_deviation"
            )
        names = ("model_force_n", "model_moment_nm", "model_acceleration_m_s2",
                 "model_acceleration_rad_s2")  # fmt: skip
        given |= {name: -1.0 if v == 0.0 else float(v) for name, v in zip(names, four, strict=True)}
    if momentum_rate_deviation is not None:
        force, moment = momentum_rate_deviation
        if not (force > 0.0 and moment > 0.0):
            raise refuse(
                "deviations of the rate of momentum must be positive", "momentum_rate_deviation"
            )
        given["momentum_rate_force_n"] = force
        given["momentum_rate_moment_nm"] = moment
    return options(
        "ulna_torque_options",
        solver=pick(_SOLVERS, solver, "solver"),
        stack=bool(stack),
        means_only=not deviations,
        wrenches=bool(wrenches),
        threads=threads,
        longest_gap=longest_gap,
        no_bridges=longest_gap == 0,
        **given,
    )


def estimate_torques(
    suite: SensorSuite,
    motion: Motion,
    measured: ArrayLike,
    *,
    solver: str = "closed_form",
    stack: bool = False,
    deviations: bool = True,
    wrenches: bool = False,
    longest_gap: int = 12,
    model_deviation: float | Sequence[float] | None = None,
    momentum_rate_deviation: Sequence[float] | None = None,
    threads: int = 0,
    progress: bool = False,
) -> BodyTorques:
    """Torques of a recording with their standard deviations.

    Parameters
    ----------
    suite : SensorSuite
    motion : Motion
        Angles and rates of the joints, orientation and angular velocity of the base. NaN: missing;
        gaps of up to `longest_gap` frames are bridged, and said. Its accelerations are not read:
        they are measurements of the suite.
    measured : (frames, rows) array
        In the order of ``suite.rows`` (`SensorSuite.stack` puts it together); NaN: missing.
    solver : {"closed_form", "sparse"}
        ``"closed_form"``: dynamics hold exactly; ``"sparse"``: they are uncertain by
        `model_deviation` (N, N m, m/s^2, rad/s^2; default 0.001 each), means only.
    stack : bool
        Task 1 and task 2 as published instead of one shot; `momentum_rate_deviation` (N, N m;
        default 1 and 1) is how far task 1 trusts the rate of the momentum.
    deviations, wrenches : bool
        Whether standard deviations, and wrenches on links, are kept.
    threads : int
        0: one a processor; the result does not depend on it.
    progress : bool

    Examples
    --------
    A person who stands still, half the weight on each foot:

    >>> from ulna.body import human_body
    >>> body = human_body(height_m=1.8, mass_kg=75)
    >>> suite = SensorSuite(body, [
    ...     BodySensor("pelvis", "accelerometer", "Pelvis", 0.1),
    ...     BodySensor("turn", "angular_acceleration", "Pelvis", 0.1),
    ...     *[BodySensor(j, "joint_acceleration", j, 0.1) for j in body.joints],
    ...     BodySensor("right", "external_wrench", "RightFoot", (2.0, 0.5)),
    ...     BodySensor("left", "external_wrench", "LeftFoot", (2.0, 0.5))])
    >>> y = suite.stack({"pelvis": [[0, 0, 9.81]], "turn": [[0, 0, 0]],
    ...                  **{j: [0.0] for j in body.joints},
    ...                  "right": [[0, 0, 367.9, 0, -15.0, 0]],
    ...                  "left": [[0, 0, 367.9, 0, -15.0, 0]]})
    >>> torques = estimate_torques(suite, Motion(np.zeros((1, 48))), y)
    >>> torques
    BodyTorques(1 frames, 48 joints, 0 bridged, 0 without a state)
    """
    struct = _torque_options(
        solver, stack, deviations, wrenches, threads, longest_gap, model_deviation,
        momentum_rate_deviation,
    )  # fmt: skip
    out = ffi.new("ulna_torques **")
    long_call(
        lib.ulna_torques_estimate,
        suite._handle.pointer,
        motion._struct(),
        view(np.atleast_2d(np.asarray(measured, dtype=float))),
        struct,
        ffi.NULL,
        out,
        progress=progress,
        label="torques",
    )
    handle = _Torques(out[0])
    summary = result("ulna_torques_summary")
    check(lib.ulna_torques_summarise(handle.pointer, summary))
    frames = int(summary.frames)

    def array(which: int, columns: int) -> Array:
        flat = out_array(lib.ulna_torques_array, handle.pointer, which)
        return flat.reshape(frames if flat.size else 0, columns)

    def wrench(which: int) -> Array:
        return array(which, 6 * len(suite.body.links)).reshape(-1, len(suite.body.links), 6)

    joints = len(suite.body.joints)
    rows = len(suite.rows)
    tests = array(lib.ULNA_TORQUES_TESTS, 4)
    return BodyTorques(
        joints=suite.body.joints,
        links=suite.body.links,
        rows=suite.rows,
        torque=array(lib.ULNA_TORQUES_TORQUE, joints),
        torque_deviation=array(lib.ULNA_TORQUES_TORQUE_DEVIATION, joints),
        joint_acceleration=array(lib.ULNA_TORQUES_ACCELERATION, joints),
        residual=array(lib.ULNA_TORQUES_RESIDUAL, 6),
        residual_deviation=array(lib.ULNA_TORQUES_RESIDUAL_DEVIATION, 6),
        balance_nis=tests[:, 0],
        motion_nis=tests[:, 1],
        motion_freedom=tests[:, 2],
        innovation=array(lib.ULNA_TORQUES_INNOVATION, rows),
        innovation_deviation=array(lib.ULNA_TORQUES_INNOVATION_DEVIATION, rows),
        external=wrench(lib.ULNA_TORQUES_EXTERNAL),
        external_deviation=wrench(lib.ULNA_TORQUES_EXTERNAL_DEVIATION),
        joint_wrench=wrench(lib.ULNA_TORQUES_JOINT_WRENCH),
        joint_wrench_deviation=wrench(lib.ULNA_TORQUES_JOINT_WRENCH_DEVIATION),
        bridged=tests[:, 3] > 0.0,
        unusable=int(summary.unusable),
        log_likelihood=float(summary.log_likelihood),
    )


class TorqueStream:
    """Torques frame by frame as they come: real-time in the library, which allocates nothing.

    Examples
    --------
    >>> from ulna.body import human_body
    >>> body = human_body(height_m=1.8, mass_kg=75)
    >>> stream = TorqueStream(SensorSuite(body, [BodySensor("a", "accelerometer", "Pelvis", 0.1)]))
    >>> torque, deviation, residual = stream.update(np.zeros(48), np.zeros(48), [0, 0, 9.81])
    >>> torque.shape, bool((deviation > 0).all())
    ((48,), True)
    """

    def __init__(
        self,
        suite: SensorSuite,
        *,
        solver: str = "closed_form",
        stack: bool = False,
        model_deviation: float | Sequence[float] | None = None,
        momentum_rate_deviation: Sequence[float] | None = None,
    ) -> None:
        self.suite = suite
        struct = _torque_options(
            solver, stack, True, False, 0, 12, model_deviation, momentum_rate_deviation
        )
        self._handle = _Stream.make(lib.ulna_torque_stream_new, suite._handle.pointer, struct)

    def update(
        self,
        angle: ArrayLike,
        rate: ArrayLike,
        measured: ArrayLike,
        *,
        position_m: ArrayLike = (0.0, 0.0, 0.0),
        orientation: ArrayLike = (1.0, 0.0, 0.0, 0.0),
        angular_velocity_rad_s: ArrayLike = (0.0, 0.0, 0.0),
    ) -> tuple[Array, Array, Array]:
        """One frame: torque and deviation of every joint (N m), and the balance residual (6).

        Numbers are NaN when the state is not finite, and those that the sparse solver has not.
        """
        joints = len(self.suite.body.joints)
        base = np.concatenate(
            [_numbers(position_m, 3, "position_m"), _numbers(orientation, 4, "orientation"),
             _numbers(angular_velocity_rad_s, 3, "angular_velocity_rad_s")]
        )  # fmt: skip
        given = [
            base,
            _numbers(angle, joints, "angle"),
            _numbers(rate, joints, "rate"),
            _numbers(measured, len(self.suite.rows), "measured"),
        ]
        out = [np.empty(joints), np.empty(joints), np.empty(6)]
        pointers = [ffi.cast("double *", a.__array_interface__["data"][0]) for a in (*given, *out)]
        check(lib.ulna_torque_stream_update(self._handle.pointer, *pointers))
        return out[0], out[1], out[2]


def _numbers(values: ArrayLike, count: int, argument: str) -> Array:
    array = np.ascontiguousarray(values, dtype=float).reshape(-1)
    if array.size != count:
        raise refuse(f"{argument} holds {array.size} numbers, {count} are expected", argument)
    return array
