"""Readings of contacts, inertial sensors and worn devices on the frames of a capture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ._call import AnalysisError, DataError
from ._capture_channels import Item, refuse_accelerometer
from ._capture_clock import Clock
from ._capture_filter import MOST_LOSS, half_window, smooth, worst
from ._capture_motion import felt_at, frames_of, mean_of, poses_of
from .body import Body, Motion
from .motion import Mount, identify_mount, rotation_matrices
from .record import Finding, refuse
from .torques import BodySensor

if TYPE_CHECKING:
    from ._capture_frames import State
    from .assist import DeviceWrenches
    from .capture import BodySetup, Contact, Imu

Array = NDArray[np.float64]

_FEET = ("RightFoot", "LeftFoot")
# A sensor that repeats itself to the last digit for so long has stopped.
_DEAD_S = 1.0
_DEAD_SAMPLES = 16
_WORTH_SAYING = 0.01  # of the samples missing
# Beyond such an error of its axes a mount is worse than what gravity says of them.
_MOST_MOUNT_ERROR_RAD = 0.1
_GUESSED_AXES_RAD = 0.02
_WORN_WITHIN_M = 0.05  # of the centre of mass of the link
_MOUNT_S = 40.0  # of movement tell the place to a millimetre; more costs time


class Readings:
    """Channels of any recording on the frames."""

    def __init__(
        self, items: Sequence[Item], frames: State, clock: Clock, window_s: float, order: int
    ) -> None:
        self.items, self.frames, self.clock = items, frames, clock
        self.window = {"window_s": window_s, "order": order}
        self.notes: list[str] = []
        self.findings: list[Finding] = []
        self.gyroscopes: dict[str, Array] = {}
        self._missing: dict[str, list[tuple[float, str]]] = {}

    def missing(self) -> list[Finding]:
        """What is missing in each recording, in a line."""
        out = []
        for label, found in self._missing.items():
            share, worst = max(found)
            others = f" and {len(found) - 1} others" if len(found) > 1 else ""
            words = (
                f"{100 * share:.3g} % of the samples of {worst}{others} in {label} are missing: short "
                "gaps are bridged, with wider intervals"
            )
            out.append(Finding("warning", "missing_samples", "", 0, 0, words))
        return out

    def of(
        self, item: Item, columns: Sequence[int], name: str, *, force: bool = False
    ) -> tuple[Array, Array]:
        """Values on the frames and their loss; a sensor that stopped is missing from then on."""
        return self.taken(item, np.array(item.values[:, list(columns)]), name, force=force)

    def taken(
        self, item: Item, values: Array, name: str, *, force: bool = False
    ) -> tuple[Array, Array]:
        """The same of values on the item's grid."""
        dead = _stopped(values, item.rate_hz, force)
        if dead.any() and any(name == _gyroscope_of(f.channel) for f in self.findings):
            values = np.where(dead[:, None], np.nan, values)  # the sensor was named already
        elif dead.any():
            share = 100 * dead.mean()
            when = "all the time" if dead.all() else f"for {share:.3g} % of the time"
            self.findings.append(
                Finding("error", "dead_sensor", name, int(np.argmax(dead)), int(dead.sum()),
                        f"{name} in {item.label} repeats one reading {when}, from row "
                        f"{int(np.argmax(dead))}: it is dead or unplugged, and is left out there")
            )  # fmt: skip
            values = np.where(dead[:, None], np.nan, values)
        else:
            missing = float(np.isnan(values).any(axis=1).mean())
            told = item is self.frames.item and missing <= 1.01 * self.frames.dropped
            if missing > _WORTH_SAYING and not told:
                self._missing.setdefault(item.label, []).append((missing, name))
        at = self.clock.own_time(item, self.frames.time_s)
        if self.frames.as_given and item is self.frames.item:
            first = int(np.rint((self.frames.time_s[0] - item.start_s) * item.rate_hz))
            return values[first : first + len(at)], np.ones(len(at))
        found = smooth(item.start_s, item.rate_hz, values, at, **self.window, derivatives=0)
        out = np.array(found.value)
        lost = worst(found.loss)
        out[lost > MOST_LOSS] = np.nan
        return out, np.where(lost > MOST_LOSS, 1.0, lost)


def _gyroscope_of(sensor: str) -> str:
    return f"gyroscope of {sensor}"


def _stopped(values: Array, rate_hz: float, force: bool) -> NDArray[np.bool_]:
    """Rows of runs in which every component repeats itself to the last digit."""
    same = np.concatenate([[False], (np.diff(values, axis=0) == 0).all(axis=1)])
    edges = np.flatnonzero(np.diff(np.concatenate([[False], same, [False]]).astype(int)))
    least = max(_DEAD_SAMPLES, _DEAD_S * rate_hz)
    out = np.zeros(len(values), dtype=bool)
    for begin, end in edges.reshape(-1, 2):
        if end - begin + 1 >= least:
            # A foot in the air is told as nothing at all by many shoes.
            if force and not values[begin].any() and end - begin + 1 < 0.9 * len(values):
                continue
            out[begin - 1 : end] = True
    return out


def find_contacts(
    items: Sequence[Item], setup: BodySetup, *, all_of: bool = True
) -> list[tuple[Contact, Item, list[int]]]:
    """Contacts with the recording and the columns of each; with `all_of` none may be missing."""
    from .capture import Contact

    found = []
    if setup.contacts is not None:
        for contact in setup.contacts:
            prefixes = [contact.prefix] if contact.prefix else [contact.name, contact.link]
            for item in items:
                columns = item.wrench(prefixes)
                if columns is not None:
                    found.append((contact, item, columns))
                    break
            else:
                if not all_of:
                    continue
                raise DataError(
                    f"no recording has the force and moment of {contact.name!r}: channels such as "
                    f"{prefixes[0]}_F_x to {prefixes[0]}_M_z",
                    status="ULNA_ERROR_DATA",
                    argument="recordings",
                    detail=f"channel {prefixes[0]}_F_x",
                )
        return found
    for link in setup.body.links:
        for item in items:
            columns = item.wrench([link])
            if columns is not None:
                found.append((Contact(link, link), item, columns))
                break
    for item in items:
        for number in range(1, 100):
            columns = item.wrench([f"plate{number}"])
            if columns is None:
                break
            found.append((_plate(item, columns, f"plate{number}", setup.body), item, columns))
    return found


def _plate(item: Item, columns: list[int], name: str, body: Body) -> Contact:
    """A plate in the floor; which foot stands on it must be told where there are two."""
    from .capture import Contact

    feet = [foot for foot in _FEET if foot in body.links]
    if len(feet) != 1:
        raise refuse(
            f"{item.label} has the force plate {name}: say which link stands on it, as a contact of the "
            'body\'s file with frame = "world"',
            "body",
        )
    return Contact(name, feet[0], frame="world")


def contact_sensor(contact: Contact, setup: BodySetup) -> BodySensor:
    """What a shoe or a plate measures."""
    size = setup.deviations
    own = (contact.force_n or size.force_n, contact.moment_nm or size.moment_nm)
    return BodySensor(
        contact.name, "external_wrench", contact.link, own, position_m=contact.position_m,
        orientation=contact.orientation, frame=contact.frame,
    )  # fmt: skip


def touching(setup: BodySetup) -> list[BodySensor]:
    """Contacts that nobody measures."""
    return [
        BodySensor(f"touch {touch.link}", "free_force" if touch.force_only else "free_wrench",
                   touch.link, position_m=touch.position_m)
        for touch in setup.touches
    ]  # fmt: skip


# Inertial sensors -----------------------------------------------------------------------------------


def _prefixes(imu: Imu, setup: BodySetup) -> list[str]:
    if imu.prefix is not None:
        return [imu.prefix]
    alone = [""] if setup.imus is not None and len(setup.imus) == 1 else []
    return [imu.link, imu.name or "imu", *alone]


def find_imus(items: Sequence[Item], setup: BodySetup) -> list[tuple[Imu, str]]:
    """Inertial sensors with their names."""
    from .capture import Imu

    chosen = setup.imus
    if chosen is None:
        chosen = tuple(
            Imu(link)
            for link in setup.body.links
            if any(imu_columns(item, Imu(link), setup) is not None for item in items)
        )
    return [(imu, imu.name or f"imu {imu.link}") for imu in chosen]


@dataclass(frozen=True, eq=False)
class ImuReading:
    """Proper acceleration and, where there is a gyroscope, angular velocity on the frames."""

    acceleration: Array
    turn_rate: Array | None
    loss: Array


def imu_columns(item: Item, imu: Imu, setup: BodySetup) -> tuple[bool, list[int]] | None:
    """Columns of the accelerometer, or of the free acceleration (True) and the sensor's orientation."""
    prefixes = _prefixes(imu, setup)
    own = item.accelerometer(prefixes)
    if own is not None:
        return False, own
    free = item.three(prefixes, ["free_acceleration"], "m/s^2")
    turns = [item.find([f"{p}_sensor_q{k}" for p in prefixes], "1") for k in "wxyz"]
    if free is not None and None not in turns:
        return True, free + [c for c in turns if c is not None]
    return None


def imu_reading(
    items: Sequence[Item], imu: Imu, name: str, setup: BodySetup, taken: Readings
) -> ImuReading:
    """What a sensor read; refused where no recording has it."""
    prefixes = _prefixes(imu, setup)
    for item in items:
        found = imu_columns(item, imu, setup)
        if found is None:
            continue
        free, columns = found
        raw = np.array(item.values[:, columns])
        if free:
            upward = np.array([0.0, 0.0, setup.body.gravity_m_s2])
            raw = np.einsum("nji,nj->ni", rotation_matrices(raw[:, 3:]), raw[:, :3] + upward)
        else:
            refuse_accelerometer(item, columns)
        values, loss = taken.taken(item, raw, name)
        gyroscope = item.gyroscope(prefixes)
        turn_rate = None
        if gyroscope is not None:
            turn_rate, _ = taken.of(item, gyroscope, _gyroscope_of(name))
        return ImuReading(values, turn_rate, loss)
    raise DataError(
        f"no recording has the acceleration of {name!r}: channels such as "
        f"{prefixes[0]}_sensor_acceleration_x",
        status="ULNA_ERROR_DATA",
        argument="recordings",
        detail=f"channel {prefixes[0]}_sensor_acceleration_x",
    )


# Where sensors sit ----------------------------------------------------------------------------------


def mount_of(found: ImuReading, frames: State, link: str) -> Mount | None:
    """Place and axes of a sensor from the motion of its link; None where it does not tell them."""
    if found.turn_rate is None or (frames.moves and frames.base_moving is None):
        return None
    part = _liveliest(found.turn_rate, frames.rate_hz)
    motion = frames_of(frames.motion, part)
    pose = poses_of(frames.body, motion)[:, frames.body.links.index(link)]
    half = half_window(frames.window["window_s"], frames.rate_hz, frames.window["order"])
    try:
        return identify_mount(
            found.acceleration[part], found.turn_rate[part], pose[:, 3:], pose[:, :3],
            rate_hz=frames.rate_hz, window=2 * half + 1, order=frames.window["order"],
        )  # fmt: skip
    except AnalysisError:
        return None


def _liveliest(turn_rate: Array, rate_hz: float) -> slice:
    """The stretch of at most `_MOUNT_S` in which the sensor turns most."""
    size = int(_MOUNT_S * rate_hz)
    if len(turn_rate) <= size:
        return slice(None)
    power = np.cumsum(np.concatenate([[0.0], np.nansum(turn_rate**2, axis=1)]))
    begin = int(np.argmax(power[size:] - power[:-size]))
    return slice(begin, begin + size)


@dataclass(frozen=True, eq=False)
class Placed:
    """A sensor on its link; what its uncertain mount adds to its readings, and whether that was told."""

    sensor: BodySensor
    deviation_m_s2: float
    told: bool


def placed(
    imu: Imu, name: str, found: ImuReading, frames: State, mount: Mount | None, deviation: float
) -> Placed:
    """The sensor where the setup says, or the calibration, or the recording itself."""
    if imu.position_m is not None and imu.orientation is not None:
        sensor = BodySensor(
            name, "accelerometer", imu.link, deviation, position_m=imu.position_m,
            orientation=imu.orientation,
        )  # fmt: skip
        return Placed(sensor, 0.0, True)
    felt = felt_at(frames.body, frames.motion, imu.link)
    centre = frames.body.describe()[frames.body.links.index(imu.link)].centre_m
    mount = mount or mount_of(found, frames, imu.link)
    told = mount is not None and bool(np.max(mount.rotation_error_rad) < _MOST_MOUNT_ERROR_RAD)
    if mount is not None and told:
        # What the motion says of the place against where sensors are worn at all.
        trust = _WORN_WITHIN_M**2 / (_WORN_WITHIN_M**2 + mount.position_error_m**2)
        place = trust * mount.position_m + (1 - trust) * centre
        axes = mount.rotation
        off_m = float(np.max(_WORN_WITHIN_M * np.sqrt(1 - trust)))
        off_rad = float(np.max(mount.rotation_error_rad))
    else:
        place = np.asarray(centre, dtype=float)
        axes = aligned(found.acceleration, felt[2])[0]
        off_m, off_rad = _WORN_WITHIN_M, _GUESSED_AXES_RAD
    with np.errstate(invalid="ignore"):
        lever = np.sum(felt[3] ** 2, axis=1) + np.sum(felt[1] ** 2, axis=1) ** 2
    moving = float(np.nan_to_num(np.sqrt(mean_of(lever))))
    sensor = BodySensor(
        name, "accelerometer", imu.link, deviation, position_m=place, orientation=axes
    )
    gravity = frames.body.gravity_m_s2
    return Placed(sensor, float(np.hypot(off_rad * gravity, off_m * moving)), told)


def aligned(sensed: Array, felt: Array) -> tuple[Array, float]:
    """Rotation from the sensor's axes under which two series of vectors are nearest, and what is left.

    Least squares over rotations (Kabsch 1976); the rest is the root mean square of the difference.
    """
    whole = np.isfinite(sensed).all(axis=1) & np.isfinite(felt).all(axis=1)
    if not whole.any():
        return np.eye(3), np.nan
    a, b = sensed[whole], felt[whole]
    u, _, vt = np.linalg.svd(b.T @ a)
    turn = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    return turn, float(np.sqrt(np.mean(np.sum((b - a @ turn.T) ** 2, axis=1))))


# Worn devices ---------------------------------------------------------------------------------------


def wear(
    setup: BodySetup, motion: Motion, sensors: list[BodySensor], readings: dict[str, Array]
) -> DeviceWrenches | None:
    """Add the wrenches of a passive device as readings: what it gives the arms it takes from the hip."""
    if setup.device is None:
        return None
    shoulder, elbow = arms(setup.body, motion) or (None, None)
    if shoulder is None or "Pelvis" not in setup.body.links:
        raise refuse(
            "the device needs a body with the links Pelvis, LeftUpperArm, LeftForeArm and their right "
            "counterparts",
            "device",
        )
    links = setup.body.links
    hip = poses_of(setup.body, motion)[:, links.index("Pelvis"), :3]
    worn = setup.device.wrenches(shoulder, elbow, hip)
    size = setup.deviations
    told = dict(zip(ARMS, np.moveaxis(worn.arm_wrench(shoulder), 1, 0), strict=True))
    told["Pelvis"] = worn.hip_wrench(hip)
    for link, wrench in told.items():
        name = f"device {link}"
        own = (size.device_n, size.device_nm)
        sensors.append(BodySensor(name, "external_wrench", link, own, frame="world_axes"))
        readings[name] = wrench
    return worn


ARMS = ("LeftUpperArm", "RightUpperArm")


def arms(body: Body, motion: Motion) -> tuple[Array, Array] | None:
    """Shoulders and elbows, (frames, 2, 3) each, left and right; None for a body without arms."""
    elbows = ("LeftForeArm", "RightForeArm")
    if any(name not in body.links for name in (*ARMS, *elbows)):
        return None
    poses = poses_of(body, motion)
    shoulder, elbow = (
        poses[:, [body.links.index(name) for name in names], :3] for names in (ARMS, elbows)
    )
    return shoulder, elbow
