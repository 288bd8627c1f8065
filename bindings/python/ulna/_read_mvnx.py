"""Xsens MVNX: the motion of a suit, frame by frame, as XML.

Global frame: right-handed, z up, x to the (magnetic or set) front. Orientations are unit quaternions
(w, x, y, z) that turn vectors of the segment or sensor into the global frame. Joint angles are those
of the ZXY sequence. The file's free acceleration has gravity removed; its sensor acceleration holds
gravity, as an accelerometer reads it.
"""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.parsers import expat

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

# Numbers of so many frames are parsed together, which is three times as fast as one by one.
_FRAMES_AT_ONCE = 1000


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
    for element, table in frames.values.items():
        whose, prefix, parts, unit, frame = _SIGNALS[element]
        owners = {
            "segment": suit.segments,
            "sensor": suit.sensors,
            "joint": suit.joints,
            "body": ("",),
        }[whose]
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

    def __init__(self, name: str) -> None:
        self.name = name
        self.index: list[int] = []
        self.time_ms: list[float] = []
        self.values: dict[str, np.ndarray] = {}
        self._tables: dict[str, list[np.ndarray]] = {}
        self._texts: dict[str, list[str | None]] = {}
        self._done = 0  # frames whose text has become numbers

    def add(self, number: str | None, stamp: str | None, texts: Mapping[str, str]) -> None:
        try:
            self.index.append(int(number or ""))
            self.time_ms.append(float(stamp or "nan"))
        except ValueError:
            raise broken(
                f"a frame of {self.name} has the index {number!r} and the time {stamp!r}, one of which "
                "is no number"
            ) from None
        before = len(self.index) - 1 - self._done
        for element, text in texts.items():
            self._texts.setdefault(element, [None] * before).append(text)
        for rows in self._texts.values():
            if len(rows) == before:
                rows.append(None)
        if before + 1 >= _FRAMES_AT_ONCE:
            self._convert()

    def finish(self) -> None:
        self._convert()
        self.values = {element: np.concatenate(parts) for element, parts in self._tables.items()}

    def _convert(self) -> None:
        count = len(self.index) - self._done
        for element, rows in self._texts.items():
            if count == 0:
                break
            parts = self._tables.get(element, [])
            given = [at for at, text in enumerate(rows) if text]
            words = [str(rows[at]) for at in given]
            rows.clear()
            if not words and not parts:
                continue  # how many numbers it holds is not known yet
            try:
                numbers = np.loadtxt(words, comments=None, ndmin=2) if words else None
            except ValueError:
                raise self._where(element, given, words) from None
            width = parts[-1].shape[1] if parts else numbers.shape[1]
            if numbers is not None and numbers.shape[1] != width:
                raise self._where(element, given, [" ".join(["0"] * width), *words])
            table = np.full((count, width), np.nan)
            if numbers is not None:
                table[given] = numbers
            if self._done and not parts:
                parts.append(np.full((self._done, width), np.nan))
            self._tables[element] = [*parts, table]
        self._done = len(self.index)

    def _where(self, element: str, given: Sequence[int], words: Sequence[str]) -> Exception:
        """The error of the first row that does not fit."""
        width = len(words[0].split())
        extra = len(words) - len(given)  # a row from before, to compare with
        for at, text in enumerate(words):
            frame = self.index[self._done + given[max(at - extra, 0)]]
            where = f"frame {frame}"
            try:
                count = len([float(word) for word in text.split()])
            except ValueError:
                return broken(
                    f"<{element}> in {where} of {self.name} holds text that is no number",
                    where=where,
                )
            if count != width:
                return broken(
                    f"{where} of {self.name} has {count} numbers in <{element}>, the frame before has "
                    f"{width}",
                    where=where,
                )
        return broken(f"<{element}> in {self.name} holds text that is no number")


class _Reader:
    """Takes an MVNX file apart as it streams by: no tree is built."""

    def __init__(self, name: str, motion: bool) -> None:
        self.name = name
        self.motion = motion
        self.frames = _Frames(name)
        self.lists: dict[str, list[str]] = {"segment": [], "sensor": [], "joint": []}
        self.points: dict[str, np.ndarray] = {}
        self.connections: dict[str, tuple[str, str]] = {}
        self.poses: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        self.rate = np.nan
        self.all_frames_seen = False
        self._frame: dict[str, str] | None = None
        self._texts: dict[str, str] = {}
        self._ends: list[str] = []
        self._point = ""
        self._words: list[str] | None = None  # text of the element that is being read

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        tag = tag.rpartition(":")[2]
        if self._frame is not None:
            self._words = [] if tag in _SIGNALS else None
        elif tag == "frame":
            self._frame, self._texts = attributes, {}
        elif tag == "subject":
            self.rate = _positive(attributes.get("frameRate"), "frameRate", self.name)
        elif tag in self.lists and attributes.get("label"):
            self.lists[tag].append(attributes["label"])
            self._ends = []
        elif tag == "point":
            self._point = attributes.get("label", "")
        elif tag == "pos_b" or tag.startswith("connector"):
            self._words = []

    def text(self, words: str) -> None:
        if self._words is not None:
            self._words.append(words)

    def end(self, tag: str) -> None:
        tag = tag.rpartition(":")[2]
        words, self._words = self._words, None
        text = "".join(words or []).strip()
        if tag == "frame" and self._frame is not None:
            self._end_of_frame(self._frame)
            self._frame = None
        elif self._frame is not None:
            if words is not None:
                self._texts[tag] = text
        elif tag == "pos_b" and self.lists["segment"]:
            label = f"{self.lists['segment'][-1]}/{self._point}"
            place = _numbers(text, f"the point {label}", self.name)
            if place.shape != (3,):
                raise broken(f"the point {label} of {self.name} must have three coordinates")
            self.points[label] = place
        elif tag.startswith("connector"):
            self._ends.append(text)
        elif tag == "joint" and len(self._ends) == 2 and self.lists["joint"]:
            self.connections[self.lists["joint"][-1]] = (self._ends[0], self._ends[1])
        elif tag == "frames":
            self.all_frames_seen = True

    def document_type(self, *_: Any) -> None:
        # Entities can blow a small file up to all memory; MVNX needs none.
        raise broken(f"{self.name} declares a document type, which no MVNX file does")

    def _end_of_frame(self, frame: Mapping[str, str]) -> None:
        kind = frame.get("type", "normal")
        if kind == "normal":
            if self.motion:
                self.frames.add(frame.get("index"), frame.get("time"), self._texts)
            return
        found = {
            element: _numbers(self._texts[element], f"the {kind} frame", self.name)
            for element in ("orientation", "position")
            if element in self._texts
        }
        if (
            len(found) == 2
            and found["orientation"].size % 4 == 0
            and found["position"].size % 3 == 0
        ):
            self.poses[kind] = found["orientation"].reshape(-1, 4), found["position"].reshape(-1, 3)


def _parse(
    source: Any, contents: bytes | None, name: str, *, motion: bool = True
) -> tuple[Suit, _Frames]:
    reader = _Reader(name, motion)
    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartElementHandler = reader.start
    parser.EndElementHandler = reader.end
    parser.CharacterDataHandler = reader.text
    parser.StartDoctypeDeclHandler = reader.document_type
    try:
        file = Path(source).open("rb") if contents is None else io.BytesIO(contents)
    except OSError as failure:
        raise FileError(
            f"{str(source)!r} cannot be read: {failure.strerror}", status="ULNA_ERROR_FILE"
        ) from failure
    with file:
        try:
            while chunk := file.read(1 << 20):
                parser.Parse(chunk, False)
                if reader.all_frames_seen and not motion:
                    break
            else:
                parser.Parse(b"", True)
        except expat.ExpatError as failure:
            reason = expat.errors.messages.get(failure.code, "not well formed")
            raise broken(
                f"{name} breaks off or is damaged at line {failure.lineno} ({reason}): export it again",
                where=f"line {failure.lineno}",
            ) from failure
    if not reader.lists["segment"] or not reader.rate > 0:
        raise broken(f"{name} has no <subject> with a frameRate and segments: it is no MVNX file")
    if motion and not reader.frames.index:
        raise broken(f"{name} holds no frames of motion")
    reader.frames.finish()
    suit = Suit(
        tuple(reader.lists["segment"]),
        tuple(reader.lists["sensor"]),
        tuple(reader.lists["joint"]),
        reader.points,
        reader.connections,
        reader.poses,
        float(reader.rate),
    )
    return suit, reader.frames


def _positive(text: str | None, what: str, name: str) -> float:
    try:
        value = float(text or "nan")
    except ValueError:
        value = np.nan
    if not 0 < value < 1e6:
        raise broken(f"the {what} of {name} is {text!r}, it must be a positive number")
    return value


def _numbers(text: str, where: str, name: str) -> np.ndarray:
    try:
        return np.array([float(word) for word in text.split()])
    except ValueError:
        raise broken(f"{where} of {name} holds text that is no number", where=where) from None


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
