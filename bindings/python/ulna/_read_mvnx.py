"""Xsens MVNX: the motion of a suit, frame by frame, as XML.

Global frame: right-handed, z up, x to the (magnetic or set) front. Orientations are unit quaternions
(w, x, y, z) that turn vectors of the segment or sensor into the global frame. Joint angles are those
of the ZXY sequence. The file's free acceleration has gravity removed; its sensor acceleration holds
gravity, as an accelerometer reads it.
"""

from __future__ import annotations

import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.parsers import expat

import numpy as np

from ._call import (
    FileError,
    FormatError,
    Handle,
    check,
    encode,
    ffi,
    lib,
    out_array,
    text,
)
from ._motion_file import broken, named_columns, record_of
from .record import Record, refuse

_QUATERNION = ("qw", "qx", "qy", "qz")
_AXES = ("x", "y", "z")
_GLOBAL = "global, z up"

# Element of a frame -> (whose, prefix of the channel, components, unit, frame).
_SIGNALS: Mapping[str, tuple[str, str, tuple[str, ...], str, str]] = {
    "orientation": ("segment", "", _QUATERNION, "1", "segment to global"),
    "position": ("segment", "position_", _AXES, "m", _GLOBAL),
    "velocity": ("segment", "velocity_", _AXES, "m/s", _GLOBAL),
    "acceleration": (
        "segment",
        "acceleration_",
        _AXES,
        "m/s^2",
        _GLOBAL + ", without gravity",
    ),
    "angularVelocity": ("segment", "angular_velocity_", _AXES, "rad/s", _GLOBAL),
    "angularAcceleration": (
        "segment",
        "angular_acceleration_",
        _AXES,
        "rad/s^2",
        _GLOBAL,
    ),
    "sensorFreeAcceleration": ("sensor", "free_acceleration_", _AXES, "m/s^2", _GLOBAL),
    "sensorAcceleration": (
        "sensor",
        "sensor_acceleration_",
        _AXES,
        "m/s^2",
        "sensor, with gravity",
    ),
    "sensorAngularVelocity": (
        "sensor",
        "sensor_angular_velocity_",
        _AXES,
        "rad/s",
        "sensor",
    ),
    "sensorOrientation": ("sensor", "sensor_", _QUATERNION, "1", "sensor to global"),
    "jointAngle": ("joint", "angle_", _AXES, "deg", "ZXY"),
    "centerOfMass": ("body", "center_of_mass_", _AXES, "m", _GLOBAL),
}

# Read at once.
_CHUNK = 1 << 20
# The tag behind which the library reads: expat alone would take ten times as long for the numbers.
_FRAMES_TAG = re.compile(rb"<((?:[^\s<>:/]+:)?frames)(?=[\s/>])(?:[^<>\"']|\"[^\"]*\"|'[^']*')*>")


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


def read(
    source: Any,
    contents: bytes | None,
    *,
    signals: Sequence[str] | None = None,
    rules: Sequence[Any],
    progress: bool,
) -> Record:
    """The motion of an MVNX file; `signals` are the elements of its frames that are read."""
    name = _name_of(source)
    chosen = tuple(_SIGNALS) if signals is None else tuple(signals)
    unknown = [element for element in chosen if element not in _SIGNALS]
    if unknown or not chosen:
        raise refuse(
            f"signals is {list(chosen)!r}; it must name some of {', '.join(_SIGNALS)}", "signals"
        )
    suit, frames = _parse(source, contents, name, elements=chosen)
    if frames is None or not frames.count:
        raise broken(f"{name} holds no frames of motion")
    columns = []
    for at, element in enumerate(chosen):
        whose, prefix, parts, unit, frame = _SIGNALS[element]
        table = frames.numbers(at)
        if table.size == 0:
            continue
        owners = {
            "segment": suit.segments,
            "sensor": suit.sensors,
            "joint": suit.joints,
            "body": ("",),
        }[whose]
        if element == "centerOfMass":
            table = table[:, :3]  # newer files add its velocity and acceleration
        width = len(owners) * len(parts)
        if table.shape[1] != width:
            raise broken(
                f"<{element}> in {name} has {table.shape[1]} numbers a frame, but {len(owners)} "
                f"{whose}s need {width}: the file does not fit its own list of {whose}s"
            )
        labels = [
            f"{owner}_{prefix}{part}" if owner else f"{prefix}{part}"
            for owner in owners
            for part in parts
        ]
        columns += named_columns(labels, table, units=[unit] * width, frame=frame)
    time_s = _clock(frames, suit.frame_rate_hz, name)
    del frames  # the library's copy of all numbers
    return record_of(
        columns,
        name=name,
        time_s=time_s,
        rules=rules,
        progress=progress,
    )


def read_suit(source: Any, contents: bytes | None) -> Suit:
    """What an MVNX file says of the person and the suit."""
    return _parse(source, contents, _name_of(source), elements=())[0]


def _name_of(source: Any) -> str:
    return source.name if isinstance(source, Path) else "mvnx in memory"


class _Handle(Handle):
    kind = "ulna_mvnx_frames"
    __slots__ = ()


class _Frames:
    """What stands between <frames> and </frames>, as the library reads it."""

    def __init__(self, name: str, elements: Sequence[str], first_line: int) -> None:
        words = [encode(element, "elements") for element in elements]
        self._handle = _Handle.make(
            lib.ulna_mvnx_frames_new,
            encode(name, "name"),
            ffi.new("const char *[]", words),
            len(words),
            first_line,
        )
        self.first_line = first_line
        self.done = False

    def push(self, data: bytes) -> int:
        """How many of the bytes belong to the frames."""
        used, done = ffi.new("int64_t *"), ffi.new("int32_t *")
        buffer = ffi.from_buffer(data)
        check(lib.ulna_mvnx_frames_push(self._handle.pointer, buffer, len(data), used, done))
        self.done = bool(done[0])
        return int(used[0])

    def _size(self) -> tuple[int, int]:
        count, line = ffi.new("int64_t *"), ffi.new("int64_t *")
        check(lib.ulna_mvnx_frames_size(self._handle.pointer, count, line))
        return int(count[0]), int(line[0])

    @property
    def count(self) -> int:
        return self._size()[0]

    @property
    def line(self) -> int:
        """Of the file, behind what was read."""
        return self._size()[1]

    def clock(self) -> np.ndarray:
        """Number and time stamp in ms of every frame."""
        return out_array(lib.ulna_mvnx_frames_clock, self._handle.pointer, shape=(-1, 2))

    def numbers(self, element: int) -> np.ndarray:
        """Rows of an element; without columns where no frame has it."""
        flat = out_array(lib.ulna_mvnx_frames_numbers, self._handle.pointer, element)
        return flat.reshape(self.count, -1) if flat.size else np.empty((0, 0))

    def poses(self) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Frames that are no motion, where they hold orientations and positions."""
        kinds = text(lib.ulna_mvnx_frames_poses, self._handle.pointer)
        found = {}
        for at, kind in enumerate(kinds.split("\n") if kinds else ()):
            turns, places = (
                out_array(lib.ulna_mvnx_frames_pose, self._handle.pointer, at, which)
                for which in (0, 1)
            )
            if turns.size and places.size and turns.size % 4 == 0 and places.size % 3 == 0:
                found[kind] = turns.reshape(-1, 4), places.reshape(-1, 3)
        return found


class _Reader:
    """What an MVNX file says beside its frames."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.lists: dict[str, list[str]] = {"segment": [], "sensor": [], "joint": []}
        self.points: dict[str, np.ndarray] = {}
        self.connections: dict[str, tuple[str, str]] = {}
        self.rate = np.nan
        self.in_frames = False
        self._ends: list[str] = []
        self._point = ""
        self._words: list[str] | None = None  # text of the element that is being read

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        tag = tag.rpartition(":")[2]
        if tag == "frames":
            self.in_frames = True
        elif tag == "frame":
            raise broken(f"the frames of {self.name} are not written in UTF-8: export it again")
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
        if tag == "frames":
            self.in_frames = False
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

    def document_type(self, *_: Any) -> None:
        # Entities can blow a small file up to all memory; MVNX needs none.
        raise broken(f"{self.name} declares a document type, which no MVNX file does")


class _Parser:
    """Takes an MVNX file apart as it streams by: expat what describes the suit, the library the
    frames. No tree is built."""

    def __init__(self, name: str, elements: Sequence[str]) -> None:
        self.name = name
        self.elements = elements
        self.reader = _Reader(name)
        self.frames: _Frames | None = None
        self._expat = expat.ParserCreate()
        self._expat.buffer_text = True
        self._expat.StartElementHandler = self.reader.start
        self._expat.EndElementHandler = self.reader.end
        self._expat.CharacterDataHandler = self.reader.text
        self._expat.StartDoctypeDeclHandler = self.reader.document_type
        self._end_tag = b""  # of the frames
        self._held = b""  # perhaps the beginning of the tag of the frames
        self._lines = 0  # that expat has seen

    def feed(self, data: bytes) -> None:
        if self.frames is None:
            data = self._head(self._held + data)
        if self.frames is not None and not self.frames.done and data:
            data = data[self.frames.push(data) :]
            if self.frames.done:
                self._parse(self._end_tag)
        if self.frames is not None and self.frames.done and data:
            self._parse(data)

    def finish(self) -> None:
        if self.frames is None:
            self._parse(self._held)
        elif not self.frames.done:
            raise self._damaged(self.frames.line, "no </frames>")
        self._parse(b"", last=True)

    def _head(self, data: bytes) -> bytes:
        """Takes what stands before the frames; the rest begins with them."""
        begin = 0
        for tag in _FRAMES_TAG.finditer(data):
            self._parse(data[begin : tag.end()])
            begin = tag.end()
            if self.reader.in_frames:  # and not within a comment
                self.frames = _Frames(self.name, self.elements, self._lines + 1)
                self._end_tag = b"</" + tag[1] + b">"
                return data[begin:]
        keep = data.rfind(b"<", begin)
        if keep < 0 or len(data) - keep > _CHUNK:
            keep = len(data)
        self._parse(data[begin:keep])
        self._held = data[keep:]
        return b""

    def _parse(self, data: bytes, *, last: bool = False) -> None:
        self._lines += data.count(b"\n")
        try:
            self._expat.Parse(data, last)
        except expat.ExpatError as failure:
            skipped = 0 if self.frames is None else self.frames.line - self.frames.first_line
            reason = expat.errors.messages.get(failure.code, "not well formed")
            raise self._damaged(failure.lineno + skipped, reason) from failure

    def _damaged(self, line: int, reason: str) -> FormatError:
        return broken(
            f"{self.name} breaks off or is damaged at line {line} ({reason}): export it again",
            where=f"line {line}",
        )


def _parse(
    source: Any, contents: bytes | None, name: str, *, elements: Sequence[str]
) -> tuple[Suit, _Frames | None]:
    parser = _Parser(name, elements)
    try:
        file = Path(source).open("rb") if contents is None else io.BytesIO(contents)
    except OSError as failure:
        raise FileError(
            f"{str(source)!r} cannot be read: {failure.strerror}",
            status="ULNA_ERROR_FILE",
        ) from failure
    with file:
        while chunk := file.read(_CHUNK):
            parser.feed(chunk)
            if not elements and parser.frames is not None and parser.frames.done:
                break
        else:
            parser.finish()
    reader = parser.reader
    if not reader.lists["segment"] or not reader.rate > 0:
        raise broken(f"{name} has no <subject> with a frameRate and segments: it is no MVNX file")
    suit = Suit(
        tuple(reader.lists["segment"]),
        tuple(reader.lists["sensor"]),
        tuple(reader.lists["joint"]),
        reader.points,
        reader.connections,
        {} if parser.frames is None else parser.frames.poses(),
        float(reader.rate),
    )
    return suit, parser.frames


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
    index, stamps = frames.clock().T
    steps = np.diff(index)
    if np.any(steps <= 0):
        row = int(np.argmax(steps <= 0)) + 1
        where = f"frame {index[row]:.0f}"
        raise broken(
            f"{where} of {name} comes after frame {index[row - 1]:.0f}: frames must be in order",
            where=where,
        )
    time = (index - index[0]) / rate_hz
    stamps = stamps / 1000
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
