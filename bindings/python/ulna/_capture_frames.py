"""From the files of a capture to frames: the body's motion and every reading, on one clock, by one filter."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ._call import DataError
from ._capture_channels import Item, load
from ._capture_clock import Clock, common_clock
from ._capture_filter import MOST_LOSS, half_window, kernel_centre, smooth, worst
from ._capture_readings import (
    Readings,
    contact_sensor,
    find_contacts,
    find_imus,
    imu_reading,
    mount_of,
    placed,
    touching,
    wear,
)
from .body import Body, Motion
from .motion import hinge_angles, rotation_matrices, same_sign, turning, unwrapped
from .record import Finding, refuse
from .torques import BodySensor, SensorSuite

if TYPE_CHECKING:
    from .capture import BodySetup, CapturedFrames
    from .motion import Mount

Array = NDArray[np.float64]

# A state that this few samples carry is left to the bridge between its neighbours.
_MOST_STATE_LOSS = 6.0
_STILL = 1e-3  # of a base that stands, m/s^2 and rad/s^2


def gather(
    recordings: Any,
    body: Any,
    *,
    calibration: Any = None,
    clocks: str = "fit",
    rate_hz: float | None = None,
    window_s: float = 0.25,
    order: int = 4,
    progress: bool = False,
) -> CapturedFrames:
    """Frames of a capture on one clock, through one filter; arguments as for `recorded_torques`."""
    from ._capture_setup import setup_of
    from .capture import CapturedFrames

    setup = setup_of(body)
    if clocks not in ("fit", "shared"):
        raise refuse(f"clocks is {clocks!r}: it must be 'fit' or 'shared'", "clocks")
    if not (np.isfinite(window_s) and window_s > 0):
        raise refuse("window_s must be positive", "window_s")
    if not 2 <= order <= 8:
        raise refuse("order must lie between 2 and 8, for accelerations", "order")
    items = load(recordings, progress=progress)
    frames = State(items, setup.body, rate_hz, window_s, order)
    clock = common_clock(items, frames.item, frames.time_s, setup, frames.motion, clocks)
    taken = Readings(items, frames, clock, window_s, order)
    contacts = find_contacts(items, setup)
    sensors, readings, loss = frames.sensors(setup.deviations)
    for contact, item, columns in contacts:
        values, lost = taken.of(item, columns, contact.name, force=True)
        sensors.append(contact_sensor(contact, setup))
        readings[contact.name] = contact.sign * values
        loss = np.fmax(loss, lost)
    unplaced: list[str] = []
    mounting: dict[str, float] = {}
    known = {} if calibration is None else calibrated(calibration, setup, window_s, order)
    for imu, name in find_imus(items, setup):
        found = imu_reading(items, imu, name, setup, taken)
        at = placed(imu, name, found, frames, known.get(name), setup.deviations.imu_m_s2)
        unplaced += [] if at.told else [name]
        mounting[name] = at.deviation_m_s2
        sensors.append(at.sensor)
        readings[name] = found.acceleration
        if found.turn_rate is not None:
            taken.gyroscopes[name] = found.turn_rate
        loss = np.fmax(loss, found.loss)
    if unplaced:
        taken.notes.append(
            f"the motion does not tell how {', '.join(unplaced)} sit: at the centre of mass of their "
            "links, with axes as gravity shows them; record a calibration motion"
        )
    sensors += touching(setup)
    device = wear(setup, frames.motion, sensors, readings)
    suite = SensorSuite(setup.body, sensors)
    return CapturedFrames(
        time_s=frames.time_s,
        rate_hz=frames.rate_hz,
        setup=setup,
        motion=frames.motion,
        suite=suite,
        measured=suite.stack(readings, frames=len(frames.time_s)),
        loss=loss,
        state_noise=frames.noise,
        mounting=mounting,
        contacts=tuple(contact.name for contact, _, _ in contacts),
        clocks=clock.fits,
        gyroscopes=taken.gyroscopes,
        device=device,
        sources=tuple(item.label for item in items),
        notes=(*frames.notes, *clock.notes, *taken.notes),
        findings=(*frames.findings, *taken.findings, *taken.missing()),
    )


def calibrated(calibration: Any, setup: BodySetup, window_s: float, order: int) -> dict[str, Mount]:
    """How the sensors sit on their links, from a calibration motion; what it leaves open is left out."""
    items = load(calibration)
    frames = State(items, setup.body, None, window_s, order)
    taken = Readings(items, frames, Clock.shared(), window_s, order)
    out = {}
    for imu, name in find_imus(items, setup):
        found = imu_reading(items, imu, name, setup, taken)
        mount = mount_of(found, frames, imu.link)
        if mount is not None:
            out[name] = mount
    return out


# The state ------------------------------------------------------------------------------------------


class State:
    """Motion of the body from the recording that holds it."""

    def __init__(
        self, items: Sequence[Item], body: Body, rate_hz: float | None, window_s: float, order: int
    ) -> None:
        self.notes: list[str] = []
        self.findings: list[Finding] = []
        self.body = body
        self.item, angles, hinges = _motion_item(items, body)
        item = self.item
        base = body.links[0]
        quaternion = item.quaternion(base)
        position = item.three([base], ["position", "pos"], "m")
        given = [(item.rate(hinge), item.acceleration(hinge)) for hinge in body.joints]
        self.as_given = hinges is not None and bool(given) and all(
            rate is not None and acceleration is not None for rate, acceleration in given
        )  # fmt: skip
        self.moves = quaternion is not None
        half = half_window(window_s, item.rate_hz, order)
        edge = 0 if self.as_given and not self.moves and rate_hz is None else half
        if len(item.values) < 2 * edge + 3:
            raise DataError(
                f"{item.label} has {len(item.values)} samples, but the filter needs "
                f"{2 * edge + 3}: record longer, or give a smaller window",
                status="ULNA_ERROR_DATA",
                argument="recordings",
            )
        self.rate_hz = item.rate_hz if rate_hz is None else float(rate_hz)
        if not (np.isfinite(self.rate_hz) and self.rate_hz > 0):
            raise refuse("rate_hz must be positive", "rate_hz")
        grid = item.time_s[edge : len(item.values) - edge]
        if rate_hz is not None:
            grid = grid[0] + np.arange(int((grid[-1] - grid[0]) * rate_hz + 1e-6) + 1) / rate_hz
        self.time_s = grid
        self.window = {"window_s": window_s, "order": order}
        if self.as_given and rate_hz is None:
            cut = slice(edge, len(item.values) - edge)
            columns = [[c for c in part if c is not None] for part in zip(*given, strict=True)]
            state = [angles[cut], item.values[cut, columns[0]], item.values[cut, columns[1]]]
            loss = np.ones(len(grid))
            noise = np.zeros(angles.shape[1])
        else:
            found = smooth(item.start_s, item.rate_hz, angles, grid, **self.window)
            state = list(found.derivatives)
            loss = worst(found.loss)
            noise = self._noise(angles, found.value)
        self._finish(state, loss, quaternion, position)
        self.noise = {"angle": noise, "base": self._turn_noise}
        missing = np.isnan(angles).any(axis=1)
        self.dropped = float(missing.mean())
        if item.lost or missing.any():
            share = 100 * missing.mean()
            self.findings.append(
                Finding("warning", "dropped_frames", "", int(np.argmax(missing)), int(missing.sum()),
                        f"{share:.3g} % of the frames of {item.label} are missing: short gaps are "
                        "bridged, with wider intervals")
            )  # fmt: skip

    def _noise(self, raw: Array, smoothed: Array) -> Array:
        """Standard deviation of the smoothed signals, from what the filter took away."""
        item = self.item
        at = (self.time_s - item.start_s) * item.rate_hz
        rows = np.rint(at).astype(int)
        if not np.allclose(at, rows, atol=1e-3):
            rows, smoothed = rows[:0], smoothed[:0]
        with np.errstate(invalid="ignore"):
            taken = raw[rows] - smoothed
        known = np.isfinite(taken)
        count = np.maximum(known.sum(axis=0), 1)
        half = half_window(self.window["window_s"], item.rate_hz, self.window["order"])
        share = kernel_centre(half, self.window["order"])
        # Of white noise the filter keeps the share of its middle weight, and takes the rest.
        return np.asarray(np.sqrt(np.nansum(taken**2, axis=0) / count * share / (1 - share)))

    def _finish(
        self, state: list[Array], loss: Array, quaternion: list[int] | None,
        position: list[int] | None,
    ) -> None:  # fmt: skip
        item, grid = self.item, self.time_s
        base: dict[str, Array] = {}
        upward = np.array([0.0, 0.0, self.body.gravity_m_s2])
        self.base_turning = self.base_moving = None
        self._turn_noise = np.zeros(3)
        if quaternion is not None:
            rotation_matrices(item.values[:, quaternion])  # refuses what is no rotation
            raw = same_sign(item.values[:, quaternion])
            found = smooth(item.start_s, item.rate_hz, raw, grid, **self.window)
            unit, velocity, acceleration = turning(*found.derivatives)
            # A turn by a small angle moves the quaternion by half of it.
            self._turn_noise += 2 * float(np.sqrt(np.mean(self._noise(raw, found.value) ** 2)))
            turn = rotation_matrices(unit)
            base["orientation"] = unit
            base["angular_velocity_rad_s"] = np.einsum("nij,nj->ni", turn, velocity)
            self.base_turning = np.einsum("nij,nj->ni", turn, acceleration)
            loss = np.fmax(loss, worst(found.loss))
        if position is not None:
            place = smooth(
                item.start_s, item.rate_hz, item.values[:, position], grid, **self.window
            )
            base["position_m"], base["velocity_m_s"] = place.derivatives[0], place.derivatives[1]
            if quaternion is not None:
                self.base_moving = place.derivatives[2] + upward
            loss = np.fmax(loss, worst(place.loss))
        far = ~(loss < _MOST_STATE_LOSS)
        for array in (*state, *base.values()):
            array[far] = np.nan
        if self.base_turning is not None:
            linear = (
                upward + np.zeros((len(grid), 3)) if self.base_moving is None else self.base_moving
            )
            base["base_acceleration"] = np.hstack([linear, self.base_turning])
        if not self.moves:
            self.notes.append(
                f"{item.label} holds no orientation of the link {self.body.links[0]}: it is taken to "
                "stand still"
            )
        # Accelerations that few samples decide would be trusted too far: they are missing.
        self._doubtful = ~(loss <= MOST_LOSS)
        self.loss = np.where(self._doubtful, 1.0, loss)
        self.acceleration = np.where(self._doubtful[:, None], np.nan, state[2])
        self.motion = Motion(state[0], state[1], state[2], **base)

    def sensors(self, deviations: Any) -> tuple[list[BodySensor], dict[str, Array], Array]:
        """What the motion itself measures: accelerations of the base and of all joints."""
        base = self.body.links[0]
        rows = len(self.time_s)
        readings: dict[str, Array] = {}
        sensors = []

        def add(name: str, kind: str, deviation: float, values: Array) -> None:
            sensors.append(BodySensor(name, kind, base, deviation, frame="world_axes"))
            readings[name] = np.where(self._doubtful[:, None], np.nan, values)

        if not self.moves:
            upward = np.array([0.0, 0.0, self.body.gravity_m_s2])
            add("base at rest", "accelerometer", _STILL, upward + np.zeros((rows, 3)))
            add("base upright", "angular_acceleration", _STILL, np.zeros((rows, 3)))
        else:
            if self.base_moving is not None:
                add("base moving", "accelerometer", deviations.base_m_s2, self.base_moving)
            assert self.base_turning is not None
            add("base turning", "angular_acceleration", deviations.base_rad_s2, self.base_turning)
        for column, joint in enumerate(self.body.joints):
            sensors.append(BodySensor(joint, "joint_acceleration", joint, deviations.joint_rad_s2))
            readings[joint] = self.acceleration[:, column]
        return sensors, readings, self.loss


def _motion_item(items: Sequence[Item], body: Body) -> tuple[Item, Array, list[int] | None]:
    """The recording with the joints, and their angles; columns where the file gives angles."""
    for item in items:
        columns = [item.angle(hinge) for hinge in body.joints]
        if body.joints and None not in columns:
            found = [c for c in columns if c is not None]
            return item, item.values[:, found], found
    for item in items:
        if any(item.quaternion(link) is not None for link in body.links[1:]):
            return item, _angles(item, body), None
    # Name the nearest miss.
    best = max(items, key=lambda item: sum(item.angle(h) is not None for h in body.joints))
    missing = [h for h in body.joints if best.angle(h) is None]
    names = ", ".join(best.names[:6])
    raise DataError(
        f"no channel of {best.label} is the angle of the joint {missing[0]!r}"
        + (f" ({len(missing)} of {len(body.joints)} joints have none)" if len(missing) > 1 else "")
        + f", and there are no orientations of segments; it has {names} and so on",
        status="ULNA_ERROR_DATA",
        argument="recordings",
        detail=f"channel {missing[0]}",
    )


def _angles(item: Item, body: Body) -> Array:
    """Hinge angles from orientations of segments that are named as links."""
    links = body.describe()
    index = {link.name: k for k, link in enumerate(links)}
    turns: dict[str, Array] = {}

    def rotation(name: str) -> Array | None:
        if name not in turns:
            columns = item.quaternion(name)
            if columns is None:
                return None
            turns[name] = rotation_matrices(item.values[:, columns])
        return turns[name]

    out = np.full((len(item.values), len(body.joints)), np.nan)
    covered = set()
    for link in links[1:]:
        child = rotation(link.name)
        if child is None:
            continue
        hinges: list[str] = []
        axes = ""
        at: str | None = link.name
        while at is not None and (at == link.name or rotation(at) is None):
            own = links[index[at]]
            if own.joint is not None:
                hinges.insert(0, own.joint)
                axes = _letter(own, body) + axes
            at = own.parent
        if at is None:
            raise DataError(
                f"{item.label} has the orientation of {link.name!r}, but of no segment that carries it",
                status="ULNA_ERROR_DATA",
                argument="recordings",
                detail=f"channel {link.name}_qw",
            )
        parent = rotation(at)
        assert parent is not None
        angles, _ = hinge_angles(np.swapaxes(parent, 1, 2) @ child, axes=axes)
        for column, hinge in enumerate(hinges):
            out[:, body.joints.index(hinge)] = unwrapped(angles[:, column])
            covered.add(hinge)
    lacking = [hinge for hinge in body.joints if hinge not in covered]
    if lacking:
        carrier = next(link.name for link in links if link.joint == lacking[0])
        raise DataError(
            f"{item.label} has neither the angle of the joint {lacking[0]!r} nor the orientation of "
            f"a segment beyond it ({carrier})",
            status="ULNA_ERROR_DATA",
            argument="recordings",
            detail=f"channel {lacking[0]}",
        )
    return out


def _letter(link: Any, body: Body) -> str:
    axis = np.abs(link.axis)
    k = int(np.argmax(axis))
    if axis[k] < 1 - 1e-9 or link.axis[k] < 0 or not np.allclose(link.orientation, np.eye(3)):
        raise refuse(
            f"the joint {link.joint!r} of the body does not turn about x, y or z of its link: give its "
            "angle as a channel",
            "body",
        )
    return "xyz"[k]
