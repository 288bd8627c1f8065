"""OpenSim's tables: .mot and .sto (coordinates, forces, torques) and .trc (markers).

A header says how many rows and columns follow; a file that holds others was cut off or edited, and is
refused. Angles are degrees or radians as the header says, never by guess.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ._motion_file import Column, broken, lines_of, named_columns, record_of, table_of
from .record import Record

# Above this an angle in radians is no posture of a joint: two turns.
_MOST_RAD = 4 * np.pi

_UNITS_BY_NAME: Sequence[tuple[re.Pattern[str], str]] = (
    (re.compile(r"(_t[xyz]|pelvis_t[xyz]/value)$"), "m"),
    (re.compile(r"_(v[xyz]|F[xyz]|f[xyz]|force|force_v[xyz])$|_force_v[xyz]$"), "N"),
    (re.compile(r"_(px|py|pz|force_p[xyz])$"), "m"),
    (re.compile(r"(_torque_[xyz]|_moment_[xyz]|_M[xyz]|_moment|_torque)$"), "Nm"),
)
_TUPLES = {"Vec3": 3, "Vec6": 6, "Quaternion": 4, "SpatialVec": 6}


def read_table(
    source: Any, contents: bytes | None, *, rules: Sequence[Any], progress: bool
) -> Record:
    """A .mot or .sto file."""
    name = source.name if isinstance(source, Path) else "table in memory"
    lines = lines_of(source, contents, name)
    header, title, first = _header(lines, name)
    kind = header.get("datatype", "double")
    size = _TUPLES.get(kind, 1)
    if kind not in ("double", *_TUPLES):
        raise broken(f"{name} holds the DataType {kind}: double, {', '.join(_TUPLES)} can be read")
    while first < len(lines) and not lines[first].strip():
        first += 1
    if first >= len(lines):
        raise broken(f"{name} ends after its header: it was cut off")
    labels = lines[first].split()
    if not labels or labels[0].lower() not in ("time", "range"):
        raise broken(
            f"the first column of {name} is {(labels or [''])[0]!r}, it must be time",
            where=f"line {first + 1}",
        )
    names = labels[1:]
    if size > 1:
        names = [f"{label}_{part + 1}" for label in names for part in range(size)]
    rows = (
        [line.replace(",", "\t") for line in lines[first + 1 :]] if size > 1 else lines[first + 1 :]
    )
    table = table_of(rows, first_line=first + 2, columns=1 + len(names), name=name)
    _check_count(header, "ncolumns", 1 + len(labels[1:]), "columns", name)
    _check_count(header, "nrows", len(table), "rows", name)
    units = [_unit_of(label, header, title, name) for label in names]
    for index, unit in enumerate(units):
        _check_angles(names[index], table[:, 1 + index], unit, name)
    return record_of(
        named_columns(names, table[:, 1:], units=units, frame="ground"),
        name=name,
        time_s=table[:, 0],
        rules=rules,
        progress=progress,
    )


def _header(lines: Sequence[str], name: str) -> tuple[dict[str, str], str, int]:
    """Keys in lower case, the title, and the line after the header."""
    header: dict[str, str] = {}
    title = ""
    for number, line in enumerate(lines[:200]):
        text = line.strip()
        if text.lower() == "endheader":
            return header, title, number + 1
        if "=" in text:
            key, _, value = text.partition("=")
            header[key.strip().lower()] = value.strip()
            continue
        words = text.split()
        # The older form of SIMM: "datacolumns 5", "datarows 100".
        old = {"datacolumns": "ncolumns", "datarows": "nrows"}
        if len(words) == 2 and words[0].lower() in old:
            header[old[words[0].lower()]] = words[1]
        elif text and not title:
            title = text
            if len(words) == 2 and words[0].lower() == "name":
                title = words[1]
    raise broken(f"{name} has no line 'endheader': it is no .mot or .sto file, or was cut off")


def _check_count(header: dict[str, str], key: str, found: int, what: str, name: str) -> None:
    if key not in header:
        return  # version 3 of the format does not say
    try:
        expected = int(header[key])
    except ValueError:
        raise broken(
            f"the header of {name} says {header[key]!r} {what}, which is no number"
        ) from None
    if expected != found:
        cause = "it was cut off" if found < expected else "its header is of another file"
        raise broken(f"{name} has {found} {what}, but its header says {expected}: {cause}")


def _unit_of(label: str, header: dict[str, str], title: str, name: str) -> str:
    for pattern, unit in _UNITS_BY_NAME:
        if pattern.search(label):
            return unit
    degrees = header.get("indegrees", "").lower()
    # A path of OpenSim 4 says itself what is a coordinate.
    path = label.endswith("/value") or label.endswith("/speed")
    motion = path or "coordinate" in title.lower() or "kinematics" in title.lower()
    rate = "/s" if label.endswith(("/speed", "_u")) else ""
    if degrees in ("yes", "true", "1"):
        return "deg" + rate
    if degrees in ("no", "false", "0"):
        return "rad" + rate if motion else ""
    if motion:
        raise broken(
            f"{name} holds angles, but its header does not say inDegrees=yes or inDegrees=no: add the "
            "line"
        )
    return ""


def _check_angles(label: str, values: np.ndarray, unit: str, name: str) -> None:
    if unit != "rad" or not np.any(np.isfinite(values)):
        return
    largest = float(np.nanmax(np.abs(values)))
    if largest > _MOST_RAD:
        raise broken(
            f"{name} says inDegrees=no, but {label} reaches {largest:.4g} rad: its angles are degrees, "
            "correct the header",
            where=f"channel {label}",
        )


def read_markers(
    source: Any, contents: bytes | None, *, rules: Sequence[Any], progress: bool
) -> Record:
    """A .trc file."""
    name = source.name if isinstance(source, Path) else "trc in memory"
    lines = lines_of(source, contents, name)
    if len(lines) < 5 or not lines[0].startswith("PathFileType"):
        raise broken(f"{name} does not begin with PathFileType: it is no .trc file, or was cut off")
    keys = lines[1].split()
    values = lines[2].split()
    if len(values) < len(keys):
        raise broken(f"line 3 of {name} has {len(values)} values for {len(keys)} headings")
    header = dict(zip(keys, values, strict=False))
    for key in ("DataRate", "NumFrames", "NumMarkers", "Units"):
        if key not in header:
            raise broken(f"the header of {name} has no {key}", where="line 2")
    unit = header["Units"]
    if unit not in ("mm", "m", "cm"):
        raise broken(f"{name} is in {unit!r}: Units must be mm, cm or m", where="line 3")
    labels = [label.strip() for label in lines[3].split("\t")[2:] if label.strip()]
    if lines[3].split()[:1] != ["Frame#"]:
        raise broken(f"line 4 of {name} must begin with Frame# and Time", where="line 4")
    _check_count({"n": header["NumMarkers"]}, "n", len(labels), "markers", name)
    first = 5
    while first < len(lines) and not lines[first].strip():
        first += 1
    table = table_of(lines[first:], first_line=first + 1, columns=2 + 3 * len(labels), name=name)
    _check_count({"n": header["NumFrames"]}, "n", len(table), "frames", name)
    columns = [
        Column(f"{label}_{axis}", table[:, 2 + 3 * index + at], unit, "ground")
        for index, label in enumerate(labels)
        for at, axis in enumerate("xyz")
    ]
    return record_of(columns, name=name, time_s=table[:, 1], rules=rules, progress=progress)
