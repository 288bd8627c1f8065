"""What a capture's files hold: every recording on an even grid of its own clock, its channels by meaning.

Names are compared without case and signs, so that ``foot_fx``, ``Foot_F_x`` and ``foot Fx`` are one. What
is found has its unit checked; a message names the file, the channel and where it matters the row.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._call import DataError, FormatError
from .record import Record, refuse

Array = NDArray[np.float64]

# More than a third of a step off the even grid, a sample cannot be told from its neighbours.
_MOST_JITTER = 0.35
# Two turns: above it an angle in radians is no posture of a joint.
_MOST_RAD = 4 * np.pi
_GRAVITY_M_S2 = 9.81
# What is looked for among the dozen signals of a suit's frames.
_OF_A_SUIT = (
    "orientation",
    "position",
    "sensorAcceleration",
    "sensorFreeAcceleration",
    "sensorOrientation",
    "sensorAngularVelocity",
)
_FORCES = ("f", "force", "forcev")
_MOMENTS = ("m", "moment", "torque")
_ACCELEROMETERS = ("sensoracceleration", "acc", "accelerometer")
_GYROSCOPES = ("sensorangularvelocity", "gyr", "gyro", "gyroscope")


def plain(name: str) -> str:
    """A name for comparison.

    Examples
    --------
    >>> plain("Foot_F_x"), plain("/jointset/hip/hip_flexion/value")
    ('footfx', 'hipflexionvalue')
    """
    parts = name.strip("/").split("/")
    if parts[-1] in ("value", "speed"):  # a path of OpenSim 4
        parts = parts[-2:]
    return re.sub(r"[^a-z0-9]", "", "".join(parts).lower())


@dataclass(frozen=True, eq=False)
class Item:
    """One recording on an even grid of its own clock.

    Attributes
    ----------
    label : str
        Its file, or "recording 2".
    names, units : tuple of str
    start_s, rate_hz : float
    values : ndarray, shape (n, channels)
        NaN where a sample is missing or was never recorded.
    lost : int
        Rows of the grid that the file does not have.
    """

    label: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    start_s: float
    rate_hz: float
    values: Array
    lost: int
    _columns: dict[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for column, name in enumerate(self.names):
            self._columns.setdefault(plain(name), column)

    @property
    def time_s(self) -> Array:
        """Of the grid."""
        return self.start_s + np.arange(len(self.values)) / self.rate_hz

    def find(self, candidates: Iterable[str], unit: str) -> int | None:
        """Column of the first name that is there, or None; its unit must be the one expected."""
        for name in candidates:
            column = self._columns.get(plain(name))
            if column is not None:
                if self.units[column] not in (unit, ""):
                    raise DataError(
                        f"the channel {self.names[column]!r} of {self.label} is in "
                        f"{self.units[column]}, but {unit} is expected",
                        status="ULNA_ERROR_DATA",
                        argument="recordings",
                        detail=f"channel {self.names[column]}",
                    )
                return column
        return None

    def three(self, prefixes: Iterable[str], words: Iterable[str], unit: str) -> list[int] | None:
        """Columns of x, y and z behind a prefix and a word; part of them is an error."""
        words = list(words)
        for prefix in prefixes:
            for word in words:
                found = [self.find([f"{prefix}_{word}_{axis}"], unit) for axis in "xyz"]
                there = [column for column in found if column is not None]
                if len(there) == 3:
                    return there
                if there:
                    missing = "xyz"[found.index(None)]
                    raise DataError(
                        f"{self.label} has {self.names[there[0]]!r}, but no component {missing} of it",
                        status="ULNA_ERROR_DATA",
                        argument="recordings",
                        detail=f"channel {self.names[there[0]]}",
                    )
        return None

    def quaternion(self, link: str) -> list[int] | None:
        """Columns of the orientation of a link."""
        found = [self.find([f"{link}_q{part}"], "1") for part in "wxyz"]
        return None if None in found else [c for c in found if c is not None]

    def wrench(self, prefixes: Sequence[str]) -> list[int] | None:
        """Columns of force and moment."""
        force = self.three(prefixes, _FORCES, "N")
        moment = self.three(prefixes, _MOMENTS, "Nm")
        if force is None or moment is None:
            return None
        return force + moment

    def accelerometer(self, prefixes: Sequence[str]) -> list[int] | None:
        """Columns of the proper acceleration in the sensor's axes."""
        return self.three(prefixes, _ACCELEROMETERS, "m/s^2")

    def gyroscope(self, prefixes: Sequence[str]) -> list[int] | None:
        """Columns of the angular velocity in the sensor's axes."""
        return self.three(prefixes, _GYROSCOPES, "rad/s")

    def angle(self, hinge: str) -> int | None:
        """Column of a hinge's angle."""
        return self.find([hinge, f"q_{hinge}", f"{hinge}_angle", f"{hinge}/value"], "rad")

    def rate(self, hinge: str) -> int | None:
        """Column of a hinge's rate."""
        names = [f"dq_{hinge}", f"d{hinge}", f"{hinge}_rate", f"{hinge}_velocity", f"{hinge}/speed"]
        return self.find(names, "rad/s")

    def acceleration(self, hinge: str) -> int | None:
        """Column of a hinge's acceleration."""
        return self.find([f"ddq_{hinge}", f"dd{hinge}", f"{hinge}_acceleration"], "rad/s^2")


def load(recordings: Any, *, progress: bool = False) -> list[Item]:
    """The recordings of a capture, in the order given."""
    given = recordings if isinstance(recordings, list | tuple) else [recordings]
    if not given:
        raise refuse("there is no recording: give at least one", "recordings")
    items = []
    for number, one in enumerate(given):
        record = one if isinstance(one, Record) else _read(Path(one), progress)
        label = f"recording {number + 1}" if isinstance(one, Record) else Path(one).name
        items.append(_item(record, label))
    return items


def _read(path: Path, progress: bool) -> Record:
    import ulna

    ending = path.suffix.lower()
    if ending == ".trc":
        raise FormatError(
            f"{path.name} holds markers: torques need joint angles or orientations of segments, "
            "solve the inverse kinematics first",
            status="ULNA_ERROR_FORMAT",
            argument="recordings",
        )
    # Markers of a C3D file carry no angles; its plates do carry the person.
    part = "analog" if ending == ".c3d" else None
    signals = _OF_A_SUIT if ending == ".mvnx" else None
    try:
        return ulna.read(path, part=part, signals=signals, progress=progress)
    except ulna.Error as failure:
        if path.name in str(failure):
            raise
        raise type(failure)(  # among several files a line number alone says nothing
            f"{path.name}: {failure}",
            status=failure.status,
            argument=failure.argument,
            detail=failure.detail,
        ) from failure


def _item(record: Record, label: str) -> Item:
    if len(record.trials) != 1:
        raise refuse(f"{label} has {len(record.trials)} trials: select one", "recordings")
    names = [channel.name for channel in record.channels]
    units = [channel.unit for channel in record.channels]
    values = np.asarray(record.values)
    endless = np.argwhere(np.isinf(values))
    if endless.size:
        row, column = (int(k) for k in endless[0])
        raise DataError(
            f"the channel {names[column]!r} of {label} is infinite in row {row}: leave the cell empty "
            "where it is not known",
            status="ULNA_ERROR_DATA",
            argument="recordings",
            detail=f"channel {names[column]}, row {row}",
        )
    start, rate, index = _grid(np.asarray(record.time), label)
    rows = int(index[-1]) + 1
    if rows != len(values):
        grid = np.full((rows, values.shape[1]), np.nan)
        grid[index] = values
        lost, values = rows - len(values), grid
    else:
        lost = 0
    _refuse_degrees(names, units, values, label)
    item = Item(label, tuple(names), tuple(units), start, rate, values, lost)
    return _with_opensim(item)


def _grid(time: Array, label: str) -> tuple[float, float, NDArray[np.int64]]:
    """Start, rate and the place of every sample on the even grid that fits the stamps."""
    if len(time) < 16:
        raise DataError(
            f"{label} has {len(time)} samples: at least 16 are needed",
            status="ULNA_ERROR_DATA",
            argument="recordings",
        )
    steps = np.diff(time)
    if not np.all(steps > 0):
        row = int(np.argmin(steps > 0)) + 1
        raise DataError(
            f"the time of {label} does not increase at row {row}",
            status="ULNA_ERROR_DATA",
            argument="recordings",
            detail=f"row {row}",
        )
    step = float(np.median(steps))
    index = np.concatenate([[0], np.cumsum(np.maximum(np.rint(steps / step), 1.0))])
    # Stamps are rounded: the whole length tells the rate, and then the places again.
    step = float(time[-1] - time[0]) / float(index[-1])
    index = np.rint((time - time[0]) / step)
    off = np.abs(time - time[0] - index * step) / step
    if off.max() > _MOST_JITTER or not np.all(np.diff(index) > 0):
        row = int(np.argmax(off))
        raise DataError(
            f"the time stamps of {label} jitter by {100 * off.max():.0f} % of a step (row {row}): put "
            "them on an even clock first (Record.regularise)",
            status="ULNA_ERROR_DATA",
            argument="recordings",
            detail=f"row {row}",
        )
    if index[-1] > 10 * len(time):
        raise DataError(
            f"more than nine tenths of {label} are missing",
            status="ULNA_ERROR_DATA",
            argument="recordings",
        )
    return float(time[0]), 1.0 / step, index.astype(np.int64)


def _refuse_degrees(names: Sequence[str], units: Sequence[str], values: Array, label: str) -> None:
    for column, unit in enumerate(units):
        if unit != "rad" or not np.isfinite(values[:, column]).any():
            continue
        size = np.abs(values[:, column])
        if np.nanmax(size) > _MOST_RAD:
            row = int(np.nanargmax(size))
            raise DataError(
                f"the channel {names[column]!r} of {label} reaches {size[row]:.4g} rad in row {row}: it "
                "is in degrees",
                status="ULNA_ERROR_DATA",
                argument="recordings",
                detail=f"channel {names[column]}, row {row}",
            )


def refuse_accelerometer(item: Item, columns: Sequence[int]) -> None:
    """An accelerometer at rest or in motion reads about gravity, in m/s^2."""
    norm = np.linalg.norm(item.values[:, list(columns)], axis=1)
    norm = norm[np.isfinite(norm)]
    if not norm.size:
        return
    typical = float(np.median(norm))
    if 0.0 < typical and not 0.5 < typical / _GRAVITY_M_S2 < 2.0:
        what = "it is in g" if 0.5 < typical < 2.0 else "its unit is wrong, or gravity was removed"
        raise DataError(
            f"the accelerometer {item.names[columns[0]]!r} of {item.label} reads {typical:.3g} m/s^2, "
            f"where gravity alone is {_GRAVITY_M_S2:g}: {what}",
            status="ULNA_ERROR_DATA",
            argument="recordings",
            detail=f"channel {item.names[columns[0]]}",
        )


# OpenSim --------------------------------------------------------------------------------------------

# OpenSim's ground has y up and z to the right: x, y, z of the body's world from it.
_FROM_OPENSIM = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


def _with_opensim(item: Item) -> Item:
    """With plates and the pelvis of OpenSim's tables under the names of this module, z up."""
    names, units, columns = list(item.names), list(item.units), [item.values]
    plates = [name.removesuffix("force_vx") for name in item.names if name.endswith("force_vx")]
    for number, prefix in enumerate(plates, start=1):
        places = [_three(item, f"{prefix}{word}", word) for word in ("force_v", "force_p")]
        free = _three(item, prefix.replace("force", "torque") + "torque_", "torque_")
        if places[0] is None or places[1] is None or free is None:
            continue
        force, place = places
        wrench = np.hstack([force, np.cross(place, force) + free])
        names += [f"plate{number}_{kind}_{axis}" for kind in "FM" for axis in "xyz"]
        units += ["N"] * 3 + ["Nm"] * 3
        columns.append(wrench)
    pelvis = [item.find([f"pelvis_{word}"], "rad") for word in ("tilt", "list", "rotation")]
    place = [item.find([f"pelvis_t{axis}"], "m") for axis in "xyz"]
    if None not in pelvis and None not in place:
        from .motion import hinge_rotations, quaternions

        # Tilt about z, list about x, rotation about y, each about the axes that the ones before turned.
        z, x, y = (item.values[:, c] for c in pelvis if c is not None)
        turn = hinge_rotations(z[:, None], axes="z") @ hinge_rotations(x[:, None], axes="x")
        turn = turn @ hinge_rotations(y[:, None], axes="y")
        turn = _FROM_OPENSIM @ turn @ _FROM_OPENSIM.T
        names += [f"Pelvis_q{part}" for part in "wxyz"] + [f"Pelvis_position_{a}" for a in "xyz"]
        units += ["1"] * 4 + ["m"] * 3
        columns += [quaternions(turn), item.values[:, [c for c in place if c is not None]]
                    @ _FROM_OPENSIM.T]  # fmt: skip
    if len(columns) == 1:
        return item
    return Item(
        item.label, tuple(names), tuple(units), item.start_s, item.rate_hz, np.hstack(columns),
        item.lost,
    )  # fmt: skip


def _three(item: Item, prefix: str, word: str) -> Array | None:
    unit = {"force_v": "N", "force_p": "m", "torque_": "Nm"}[word]
    found = [item.find([f"{prefix}{axis}"], unit) for axis in "xyz"]
    if None in found:
        return None
    return np.asarray(item.values[:, [c for c in found if c is not None]] @ _FROM_OPENSIM.T)
