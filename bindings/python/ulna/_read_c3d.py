"""C3D: markers and analog channels, force plates as wrenches in the laboratory's frame.

Markers and analog channels have different rates in most files and one record has one clock, so a file
that holds both is read one part at a time; both parts begin at time 0.

A plate gives ``plate1_F_x`` ... (N), ``plate1_M_x`` ... (Nm, about the origin of the laboratory) and
``plate1_cop_x`` ... (m, missing where the vertical force is below 20 N), all **of the plate on the
person**. Makers disagree on whether a file holds this or its opposite; as a plate only pushes, the
direction of the load tells, and the channel's ``sign`` says what was done.
"""

from __future__ import annotations

import json
import struct
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from ._call import Error
from ._motion_file import Column, broken, bytes_of, record_of
from .record import Record, refuse, unit_factor

PARTS = ("points", "analog")
_LAB = "laboratory"
# A plate is loaded above this; below, the centre of pressure is a ratio of noise.
_LOADED_N = 20.0
_COUNT = {1: 6, 2: 6, 3: 8, 4: 6}


def read(
    source: Any, contents: bytes | None, *, part: str | None, rules: Sequence[Any], progress: bool
) -> Record:
    """One part of a C3D file."""
    name = source.name if isinstance(source, Path) else "c3d in memory"
    if part is not None and part not in PARTS:
        raise refuse(f"part is {part!r}: it must be 'points' or 'analog'", "part")
    file = _open(bytes_of(source, contents), name)
    points, point_rate = _points(file, name)
    analog, analog_rate = _analog(file, name)
    if part is None:
        if points and analog and analog_rate != point_rate:
            raise refuse(
                f"{name} holds markers at {point_rate:g} Hz and analog channels at "
                f"{analog_rate:g} Hz: say part='points' or part='analog'",
                "part",
            )
        chosen, rate = points + analog, point_rate if points else analog_rate
    else:
        chosen, rate = (points, point_rate) if part == "points" else (analog, analog_rate)
        if not chosen:
            raise broken(f"{name} holds no {'markers' if part == 'points' else 'analog channels'}")
    return record_of(chosen, name=name, rate_hz=rate, rules=rules, progress=progress)


@dataclass(frozen=True, eq=False)
class _File:
    """What a file holds: markers (4, markers, frames), analog channels (1, channels, samples)."""

    points: np.ndarray
    analogs: np.ndarray
    residuals: np.ndarray | None
    numbers: Mapping[str, np.ndarray]  # "POINT:RATE" and the like
    words: Mapping[str, Mapping[str, list[str]]]

    def scalar(self, key: str) -> float:
        """A parameter of one number, 0 where there is none."""
        value = np.ravel(self.numbers.get(key, 0.0))
        return float(value[0]) if value.size and np.isfinite(value[0]) else 0.0

    def array(self, key: str) -> np.ndarray:
        """A parameter, empty where there is none."""
        return np.asarray(self.numbers.get(key, []), dtype=float)


def _open(data: bytes, name: str) -> _File:
    if find_spec("ezc3d") is None:
        raise ImportError("reading .c3d files needs ezc3d: install it with `pip install ulna[c3d]`")
    _check_length(data, name)
    with tempfile.TemporaryDirectory(prefix="ulna-c3d-") as folder:
        path, out = Path(folder) / "in.c3d", Path(folder) / "out.npz"
        path.write_bytes(data)
        child = Path(__file__).with_name("_c3d_child.py")
        limit = 4 * 2**30 + 64 * len(data)
        # -P: the folder of this package holds modules with names of the standard library.
        command = [sys.executable, "-P", str(child), str(path), str(out), str(limit)]
        try:
            done = subprocess.run(
                command, capture_output=True, text=True, timeout=60 + len(data) / 1e6, check=False
            )
        except subprocess.TimeoutExpired:
            raise broken(f"{name} is damaged: reading it does not come to an end") from None
        if done.returncode != 0 or not out.is_file():
            words = done.stderr.strip().splitlines()
            reason = words[-1] if words and done.returncode == 1 else "its sections do not fit"
            raise broken(f"{name} is damaged or no C3D file: {reason}")
        with np.load(out, allow_pickle=False) as archive:
            arrays = {key: archive[key] for key in archive.files}
    return _File(
        points=arrays.pop("points"),
        analogs=arrays.pop("analogs"),
        residuals=arrays.pop("residuals", None),
        words=json.loads(arrays.pop("words").tobytes()),
        numbers=arrays,
    )


def _check_length(data: bytes, name: str) -> None:
    """Whether all frames that the header promises are there: ezc3d fills what is missing."""
    if len(data) < 1024 or data[1] != 0x50 or not 2 <= data[0] <= 8:
        raise broken(f"{name} does not begin as a C3D file does")
    block = (data[0] - 1) * 512
    if len(data) < block + 4:
        raise broken(f"{name} ends before its parameters: it was cut off")
    order = {84: "<", 85: "<", 86: ">"}.get(data[block + 3])
    if order is None:
        raise broken(f"{name} was written by an unknown kind of processor ({data[block + 3]})")
    points, analogs, first, last = struct.unpack_from(f"{order}4H", data, 2)
    scale = data[12:16] if data[block + 3] != 85 else data[14:16] + data[12:14]
    start = struct.unpack_from(f"{order}H", data, 16)[0]
    whole = struct.unpack(f"{order}f", scale)[0]
    bytes_a_frame = (4 if whole < 0 else 2) * (4 * points + analogs)
    frames = last - first + 1
    needed = (start - 1) * 512 + frames * bytes_a_frame
    if frames < 1 or start < 2 or len(data) < needed:
        raise broken(
            f"{name} has {len(data)} bytes, but its header promises {frames} frames in {needed}: it was "
            "cut off"
        )


def _labels(file: _File, group: str, count: int) -> list[str]:
    """Labels in file order; more than 255 continue in LABELS2 and so on."""
    found: list[str] = []
    for more in ("", "2", "3", "4", "5"):
        found += [
            str(label).strip() for label in file.words.get(group, {}).get("LABELS" + more, [])
        ]
    fallback = "point" if group == "POINT" else "analog"
    return [found[i] if i < len(found) and found[i] else f"{fallback}{i + 1}" for i in range(count)]


def _length_unit(file: _File, name: str) -> str:
    units = file.words.get("POINT", {}).get("UNITS", [])
    unit = units[0].strip() if units else ""
    if unit not in ("mm", "cm", "m"):
        raise broken(f"{name} has the unit {unit!r} for POINT:UNITS: it must be mm, cm or m")
    return unit


def _points(file: _File, name: str) -> tuple[list[Column], float]:
    data = np.asarray(file.points, dtype=float)
    count = data.shape[1] if data.ndim == 3 else 0
    if not count or not data.shape[2]:
        return [], 0.0
    rate = file.scalar("POINT:RATE")
    if not rate > 0:
        raise broken(f"{name} has no frame rate (POINT:RATE)")
    unit = _length_unit(file, name)
    places = data[:3].copy()
    if file.residuals is not None and file.residuals.shape[-2:] == places.shape[1:]:
        places[:, file.residuals[0] < 0] = np.nan  # a marker that was not seen
    columns = [
        Column(f"{label}_{axis}", places[at, index], unit, _LAB)
        for index, label in enumerate(_labels(file, "POINT", count))
        for at, axis in enumerate("xyz")
    ]
    return columns, rate


def _analog(file: _File, name: str) -> tuple[list[Column], float]:
    data = np.asarray(file.analogs, dtype=float)
    if data.ndim != 3 or not data.shape[1] or not data.shape[2]:
        return [], 0.0
    rate = file.scalar("ANALOG:RATE")
    if not rate > 0:
        raise broken(f"{name} has no rate of analog channels (ANALOG:RATE)")
    values = data[0]
    labels = _labels(file, "ANALOG", len(values))
    units = [unit.strip() for unit in file.words.get("ANALOG", {}).get("UNITS", [])]
    units += [""] * (len(values) - len(units))
    plates, used = _plates(file, values, units, name)
    columns = [
        Column(label, values[i], _known(units[i]))
        for i, label in enumerate(labels)
        if i not in used
    ]
    return plates + columns, rate


def _known(unit: str) -> str:
    """The unit where it is one; makers write what they like for channels of other devices."""
    try:
        unit_factor(unit)
    except Error:
        return ""
    return unit


# Force plates -------------------------------------------------------------------------------------


def _plates(
    file: _File, values: np.ndarray, units: Sequence[str], name: str
) -> tuple[list[Column], set[int]]:
    count = int(file.scalar("FORCE_PLATFORM:USED"))
    if count == 0:
        return [], set()
    kinds = np.ravel(file.array("FORCE_PLATFORM:TYPE"))
    channels = file.array("FORCE_PLATFORM:CHANNEL")
    corners = file.array("FORCE_PLATFORM:CORNERS")
    origins = file.array("FORCE_PLATFORM:ORIGIN")
    if (
        count < 0
        or len(kinds) < count
        or channels.ndim != 2
        or channels.shape[0] < 6
        or channels.shape[1] < count
        or corners.shape[:2] != (3, 4)
        or corners.size < 12 * count
        or origins.shape[0] != 3
        or origins.size < 3 * count
    ):
        raise broken(f"{name} says {count} force plates, but does not describe all of them")
    length = unit_factor(_length_unit(file, name))[1]
    corners = corners.reshape(3, 4, -1) * length
    origins = origins.reshape(3, -1) * length
    used: set[int] = set()
    wrenches = []
    for plate in range(count):
        kind = int(kinds[plate])
        where = f"force plate {plate + 1}"
        if kind not in _COUNT:
            raise broken(
                f"{where} of {name} is of type {kind}: types 1 to 4 can be read", where=where
            )
        if len(channels) < _COUNT[kind]:
            raise broken(f"{where} of {name} names {len(channels)} channels", where=where)
        own = [int(number) - 1 for number in channels[: _COUNT[kind], plate]]
        if min(own) < 0 or max(own) >= len(values):
            raise broken(
                f"{where} of {name} names an analog channel that is not there", where=where
            )
        used.update(own)
        signals = _si_signals(
            file, kind, plate, values[own], [units[i] for i in own], length, where
        )
        force, moment = _at_surface(kind, signals, origins[:, plate])
        wrenches.append(_in_laboratory(force, moment, corners[..., plate], where, name))
    sign = _sign(wrenches, corners[..., :count], name)
    columns = []
    for plate, (force, moment, cop) in enumerate(wrenches):
        for letter, unit, table in (("F", "N", force), ("M", "Nm", moment), ("cop", "m", cop)):
            turned = 1 if letter == "cop" else sign
            columns += [
                Column(f"plate{plate + 1}_{letter}_{axis}", table[at], unit, _LAB, sign=turned)
                for at, axis in enumerate("xyz")
            ]
    return columns, used


def _si_signals(
    file: _File,
    kind: int,
    plate: int,
    signals: np.ndarray,
    units: Sequence[str],
    length: float,
    where: str,
) -> np.ndarray:
    """Channels in N, Nm and m."""
    if kind == 4:
        matrices = file.array("FORCE_PLATFORM:CAL_MATRIX")
        if matrices.ndim < 2 or matrices.shape[:2] != (6, 6) or matrices.size < 36 * (plate + 1):
            raise broken(f"{where} is of type 4 and has no calibration matrix", where=where)
        # A calibration matrix gives N and N times the unit of length.
        out = matrices.reshape(6, 6, -1)[..., plate] @ signals
        out[3:] *= length
        return out
    wanted = {1: "NNNmmT", 2: "NNNTTT", 3: "N" * 8}[kind]
    names = {"N": ("N", "N"), "T": ("Nm", "Nm or Nmm"), "m": ("m", "mm or m")}
    out = np.empty_like(signals)
    for index, (letter, unit) in enumerate(zip(wanted, units, strict=True)):
        expected, words = names[letter]
        try:
            si, factor = unit_factor(unit) if unit else ("", 0.0)
        except Error:
            si, factor = "", 0.0
        if si != expected:
            raise broken(
                f"channel {index + 1} of {where} has the unit {unit!r}: it must be {words}",
                where=where,
            )
        out[index] = signals[index] * factor
    return out


def _at_surface(kind: int, s: np.ndarray, origin: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Force, and moment about the middle of the surface, in the plate's axes."""
    if kind == 1:
        # The last channel is the free moment, about the centre of pressure.
        force, (px, py, free) = s[:3], s[3:]
        about_middle = free + px * force[1] - py * force[0]
        return force, np.stack([py * force[2], -px * force[2], about_middle])
    if kind == 3:
        a, b, depth = origin
        force = np.stack([s[0] + s[1], s[2] + s[3], s[4:].sum(axis=0)])
        moment = np.stack(
            [
                b * (s[4] + s[5] - s[6] - s[7]),
                a * (-s[4] + s[5] + s[6] - s[7]),
                b * (-s[0] + s[1]) + a * (s[2] - s[3]),
            ]
        )
        origin = np.array([0.0, 0.0, depth])
    else:
        force, moment = s[:3], s[3:]
    # ORIGIN points from the sensors' origin to the middle of the surface.
    return force, moment - np.cross(origin, force, axisb=0, axisc=0)


def _in_laboratory(
    force: np.ndarray, moment: np.ndarray, corners: np.ndarray, where: str, name: str
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Force, moment about the laboratory's origin, centre of pressure; shape (3, n) each."""
    # Corners lie at (+x, +y), (-x, +y), (-x, -y), (+x, -y).
    x = corners[:, 0] - corners[:, 1] + corners[:, 3] - corners[:, 2]
    y = corners[:, 0] - corners[:, 3] + corners[:, 1] - corners[:, 2]
    z = np.cross(x, y)
    sizes = [float(np.linalg.norm(axis)) for axis in (x, y, z)]
    if min(sizes) < 1e-9 or abs(x @ y) > 0.1 * sizes[0] * sizes[1]:
        raise broken(f"the corners of {where} in {name} are no rectangle", where=where)
    z = z / sizes[2]
    x = x / sizes[0]
    turn = np.stack([x, np.cross(z, x), z], axis=1)
    middle = corners.mean(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        place = np.stack([-moment[1] / force[2], moment[0] / force[2], np.zeros_like(force[2])])
    place[:, ~(np.abs(force[2]) >= _LOADED_N)] = np.nan
    lab_force = turn @ force
    lab_moment = turn @ moment + np.cross(middle, lab_force, axisb=0, axisc=0)
    return lab_force, lab_moment, middle[:, None] + turn @ place


def _sign(wrenches: Sequence[Any], corners: np.ndarray, name: str) -> int:
    """-1 where the file holds the load of the person on the plates."""
    edges = corners[:, 1] - corners[:, 0], corners[:, 3] - corners[:, 0]
    normals = np.abs(np.cross(*edges, axis=0)).sum(axis=1)
    up = int(np.argmax(normals))
    pushes = pulls = 0.0
    for force, _, _ in wrenches:
        loaded = np.abs(force[up]) >= _LOADED_N
        pushes += float(force[up][loaded & (force[up] > 0)].sum())
        pulls -= float(force[up][loaded & (force[up] < 0)].sum())
    if min(pushes, pulls) > 0.2 * max(pushes, pulls):
        raise broken(
            f"the force plates of {name} both push and pull: check the corners and the sign of each"
        )
    # Without a load the standard holds: the file has the force of the person on the plate.
    return 1 if pushes > pulls else -1
