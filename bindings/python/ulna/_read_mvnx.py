"""Xsens MVNX: the motion of a suit, frame by frame, as XML.

Global frame: right-handed, z up, x to the (magnetic or set) front. Orientations are unit quaternions
(w, x, y, z) that turn vectors of the segment or sensor into the global frame. Joint angles are those
of the ZXY sequence. The file's free acceleration has gravity removed; its sensor acceleration holds
gravity, as an accelerometer reads it.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from ._call import FileError
from ._motion_file import Column, broken, record_of
from .record import Record

_QUATERNION = ("qw", "qx", "qy", "qz")
_AXES = ("x", "y", "z")
_GLOBAL = "global, z up"

# Element of a frame -> (whose, prefix of the channel, components, unit, frame).
_SIGNALS: Mapping[str, tuple[str, str, tuple[str, ...], str, str]] = {
    "orientation": ("segment", "", _QUATERNION, "1", "segment to global"),
    "position": ("segment", "position_", _AXES, "m", _GLOBAL),
    "velocity": ("segment", "velocity_", _AXES, "m/s", _GLOBAL),
    "acceleration": ("segment", "acceleration_", _AXES, "m/s^2", _GLOBAL + ", without gravity"),
    "angularVelocity": ("segment", "angular_velocity_", _AXES, "rad/s", _GLOBAL),
    "angularAcceleration": ("segment", "angular_acceleration_", _AXES, "rad/s^2", _GLOBAL),
    "sensorFreeAcceleration": ("sensor", "free_acceleration_", _AXES, "m/s^2", _GLOBAL),
    "sensorAcceleration": (
        "sensor",
        "sensor_acceleration_",
        _AXES,
        "m/s^2",
        "sensor, with gravity",
    ),
    "sensorAngularVelocity": ("sensor", "sensor_angular_velocity_", _AXES, "rad/s", "sensor"),
    "sensorOrientation": ("sensor", "sensor_", _QUATERNION, "1", "sensor to global"),
    "jointAngle": ("joint", "angle_", _AXES, "deg", "ZXY"),
    "centerOfMass": ("body", "center_of_mass_", _AXES, "m", _GLOBAL),
}


@dataclass(frozen=True, eq=False)
class Suit:
    """What an MVNX file says of the person and the suit beside the motion.

    Attributes
    ----------
    segments, sensors, joints : tuple of str
        Labels in the order of the file.
    points_m : mapping of str to ndarray, shape (3,)
        ``"Pelvis/jL5S1"``: place of the point in the segment's frame.
    connections : mapping of str to (str, str)
        Joint -> the two points that it connects.
    poses : mapping of str to (ndarray, ndarray)
        ``"tpose"`` and the like -> orientations (segments, 4) and positions (segments, 3).
    frame_rate_hz : float
    """

    segments: tuple[str, ...]
    sensors: tuple[str, ...]
    joints: tuple[str, ...]
    points_m: Mapping[str, np.ndarray]
    connections: Mapping[str, tuple[str, str]]
    poses: Mapping[str, tuple[np.ndarray, np.ndarray]]
    frame_rate_hz: float

    def __repr__(self) -> str:
        return (
            f"<Suit: {len(self.segments)} segments, {len(self.sensors)} sensors, "
            f"{len(self.joints)} joints, {self.frame_rate_hz:g} Hz>"
        )


def read(source: Any, contents: bytes | None, *, rules: Sequence[Any], progress: bool) -> Record:
    """The motion of an MVNX file."""
    name = source.name if isinstance(source, Path) else "mvnx in memory"
    suit, frames = _parse(source, contents, name)
    columns = []
    count = len(frames.index)
    for element, rows in frames.values.items():
        whose, prefix, parts, unit, frame = _SIGNALS[element]
        owners = {
            "segment": suit.segments,
            "sensor": suit.sensors,
            "joint": suit.joints,
            "body": ("",),
        }[whose]
        table = np.asarray(rows)
        if element == "centerOfMass":
            table = table[:, :3]  # newer files add its velocity and acceleration
        width = len(owners) * len(parts)
        if table.shape != (count, width):
            raise broken(
                f"<{element}> in {name} has {table.shape[1]} numbers a frame, but {len(owners)} "
                f"{whose}s need {width}: the file does not fit its own list of {whose}s"
            )
        for at, owner in enumerate(owners):
            for axis, part in enumerate(parts):
                label = f"{owner}_{prefix}{part}" if owner else f"{prefix}{part}"
                columns.append(Column(label, table[:, at * len(parts) + axis], unit, frame))
    return record_of(
        columns,
        name=name,
        time_s=_clock(frames, suit.frame_rate_hz, name),
        rules=rules,
        progress=progress,
    )


def read_suit(source: Any, contents: bytes | None) -> Suit:
    """What an MVNX file says of the person and the suit."""
    name = source.name if isinstance(source, Path) else "mvnx in memory"
    return _parse(source, contents, name, motion=False)[0]


class _Frames:
    """Numbers of the frames as they are read; a missing element of a frame is a row of NaN."""

    def __init__(self) -> None:
        self.index: list[int] = []
        self.time_ms: list[float] = []
        self.values: dict[str, list[np.ndarray]] = {}

    def add(self, frame: Any, name: str) -> None:
        number = frame.get("index")
        where = f"frame {number}"
        try:
            self.index.append(int(number))
            self.time_ms.append(float(frame.get("time", "nan")))
        except (TypeError, ValueError):
            raise broken(
                f"a frame of {name} has the index {number!r}, which is no number"
            ) from None
        seen = {}
        for item in frame:
            element = _tag(item)
            if element in _SIGNALS:
                seen[element] = _numbers(item, element, where, name)
        before = len(self.index) - 1
        for element, numbers in seen.items():
            rows = self.values.setdefault(element, [np.full(len(numbers), np.nan)] * before)
            if rows and len(rows[-1]) != len(numbers):
                raise broken(
                    f"{where} of {name} has {len(numbers)} numbers in <{element}>, the frame before "
                    f"has {len(rows[-1])}",
                    where=where,
                )
            rows.append(numbers)
        for rows in self.values.values():
            if len(rows) == before:
                rows.append(np.full(len(rows[-1]), np.nan))


def _parse(
    source: Any, contents: bytes | None, name: str, *, motion: bool = True
) -> tuple[Suit, _Frames]:
    frames = _Frames()
    lists: dict[str, list[str]] = {"segment": [], "sensor": [], "joint": []}
    points: dict[str, np.ndarray] = {}
    connections: dict[str, tuple[str, str]] = {}
    poses: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    rate = np.nan
    inside: list[Any] = []
    for event, item in _events(source, contents, name):
        tag = _tag(item)
        if event == "start":
            inside.append(item)
            if tag == "subject":
                rate = _positive(item.get("frameRate"), "frameRate", name)
            continue
        inside.pop()
        if tag in ("segment", "sensor", "joint") and item.get("label"):
            lists[tag].append(item.get("label"))
            if tag == "segment":
                _put_points(item, points, name)
            ends = [child.text or "" for child in item if _tag(child).startswith("connector")]
            if tag == "joint" and len(ends) == 2:
                connections[item.get("label")] = (ends[0].strip(), ends[1].strip())
        elif tag == "frame":
            kind = item.get("type", "normal")
            if kind != "normal":
                _put_pose(item, kind, poses, name)
            elif motion:
                frames.add(item, name)
            # The tree would otherwise grow to many times the file.
            item.clear()
            if inside:
                inside[-1].clear()
        if tag == "frames" and not motion:
            break
    if not lists["segment"] or not rate > 0:
        raise broken(f"{name} has no <subject> with a frameRate and segments: it is no MVNX file")
    if motion and not frames.index:
        raise broken(f"{name} holds no frames of motion")
    suit = Suit(
        tuple(lists["segment"]),
        tuple(lists["sensor"]),
        tuple(lists["joint"]),
        points,
        connections,
        poses,
        float(rate),
    )
    return suit, frames


def _events(source: Any, contents: bytes | None, name: str) -> Iterator[tuple[str, Any]]:
    try:
        file = Path(source).open("rb") if contents is None else io.BytesIO(contents)
    except OSError as failure:
        raise FileError(
            f"{str(source)!r} cannot be read: {failure.strerror}", status="ULNA_ERROR_FILE"
        ) from failure
    with file:
        # Entities can blow a small file up to all memory; MVNX needs none.
        if b"<!" in file.read(4096).replace(b"<!--", b""):
            raise broken(f"{name} declares a document type, which no MVNX file does")
        file.seek(0)
        try:
            yield from ElementTree.iterparse(file, events=("start", "end"))
        except ElementTree.ParseError as failure:
            line = failure.position[0]
            raise broken(
                f"{name} breaks off or is damaged at line {line} ({failure}): export it again",
                where=f"line {line}",
            ) from failure


def _tag(item: Any) -> str:
    return str(item.tag).rpartition("}")[2]


def _positive(text: str | None, what: str, name: str) -> float:
    try:
        value = float(text or "nan")
    except ValueError:
        value = np.nan
    if not 0 < value < 1e6:
        raise broken(f"the {what} of {name} is {text!r}, it must be a positive number")
    return value


def _numbers(item: Any, element: str, where: str, name: str) -> np.ndarray:
    words = (item.text or "").split()
    try:
        return np.array(words, dtype=float)
    except ValueError:
        raise broken(
            f"<{element}> in {where} of {name} holds text that is no number", where=where
        ) from None


def _put_points(segment: Any, points: dict[str, np.ndarray], name: str) -> None:
    for point in segment.iter():
        if _tag(point) != "point":
            continue
        label = f"{segment.get('label')}/{point.get('label')}"
        place = [child for child in point if _tag(child) == "pos_b"]
        if place:
            points[label] = _numbers(place[0], "pos_b", f"point {label}", name)
            if points[label].shape != (3,):
                raise broken(f"the point {label} of {name} must have three coordinates")


def _put_pose(
    frame: Any, kind: str, poses: dict[str, tuple[np.ndarray, np.ndarray]], name: str
) -> None:
    found = {
        _tag(item): _numbers(item, _tag(item), f"the {kind} frame", name)
        for item in frame
        if _tag(item) in ("orientation", "position")
    }
    if len(found) == 2 and found["orientation"].size % 4 == 0 and found["position"].size % 3 == 0:
        poses[kind] = (found["orientation"].reshape(-1, 4), found["position"].reshape(-1, 3))


def _clock(frames: _Frames, rate_hz: float, name: str) -> np.ndarray:
    """Time from the frames' numbers: the file's milliseconds are rounded. Lost frames stay gaps."""
    index = np.asarray(frames.index, dtype=float)
    steps = np.diff(index)
    if np.any(steps <= 0):
        row = int(np.argmax(steps <= 0)) + 1
        raise broken(
            f"frame {frames.index[row]} of {name} comes after frame {frames.index[row - 1]}: "
            "frames must be in order",
            where=f"frame {frames.index[row]}",
        )
    time = (index - index[0]) / rate_hz
    stamps = np.asarray(frames.time_ms) / 1000
    if len(time) > 10 and np.all(np.isfinite(stamps)):
        span = stamps[-1] - stamps[0]
        # Rounding costs a millisecond; a wrong frameRate is wrong by the ratio of two rates.
        if span > 0 and abs(span - time[-1]) > 0.002 + 0.02 * time[-1]:
            true_rate = time[-1] * rate_hz / span
            raise broken(
                f"{name} says {rate_hz:g} frames a second, but its time stamps say {true_rate:.4g}: "
                "correct frameRate"
            )
    return time
