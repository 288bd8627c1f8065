"""Reading recordings: text tables, MATLAB, NPZ, HDF5 and motion capture (MVNX, OpenSim, C3D), with a
small TOML map of a lab's columns."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ._call import Error, FileError, FormatError, encode, ffi, lib, long_call, options
from .record import ROLES, Record, _Record, from_columns, join, refuse, rule_array

_FORMATS = {
    ".csv": "csv",
    ".tsv": "csv",
    ".txt": "csv",
    ".dat": "csv",
    ".asc": "csv",
    ".mat": "mat",
    ".npz": "npz",
    ".h5": "hdf5",
    ".hdf5": "hdf5",
    ".hdf": "hdf5",
    ".mvnx": "mvnx",
    ".mot": "mot",
    ".sto": "mot",
    ".trc": "trc",
    ".c3d": "c3d",
}
# Their readers know names, units and frames of all channels.
_MOTION = ("mvnx", "mot", "trc", "c3d")
_FILE_KEYS = {
    "delimiter": str,
    "decimal": str,
    "skip_rows": int,
    "header": bool,
    "format": str,
    "part": str,
}
_TIME_KEYS = {"column": str, "unit": str}
_CHANNEL_KEYS = {
    "column": str,
    "name": str,
    "role": str,
    "axis": (str, int),
    "unit": str,
    "sign": int,
    "frame": str,
}
_TOP_KEYS = {"file": dict, "time": dict, "channel": list, "rate_hz": (int, float)}


def read(
    source: Any,
    *,
    map: Any = None,
    format: str | None = None,
    part: str | None = None,
    signals: Sequence[str] | None = None,
    progress: bool = False,
) -> Record:
    """Read a recording.

    Parameters
    ----------
    source : path, list of paths, folder, bytes or binary file
        Several files, or a folder of them, become one record with several trials.
    map : path or dict, optional
        TOML file (or its contents) that names columns, units, signs and roles; `ulna.inspect` drafts
        one. Without it, channels are found by their names.
    format : {"csv", "mat", "npz", "hdf5", "mvnx", "mot", "trc", "c3d"}, optional
        By default from the ending of the name and the first bytes; ``"mot"`` is also .sto.
    part : {"points", "analog"}, optional
        Of a C3D file whose markers and analog channels have different rates.
    signals : sequence of str, optional
        Of an MVNX file: the elements of its frames to read, as ``["orientation", "jointAngle"]``,
        which is quicker than all of them.
    progress : bool
        Show a bar (needs tqdm).

    Returns
    -------
    Record

    Examples
    --------
    >>> import ulna
    >>> log = ulna.read(b"time_s,x_mm,F_x_N\\n0,1,2\\n0.001,2,3\\n")
    >>> log["x"].tolist(), log.channels[1].role
    ([0.001, 0.002], 'force')
    """
    plan = _load_map(map)
    if part is not None:
        plan = replace(plan, part=part)
    if signals is not None:
        plan = replace(plan, signals=tuple(signals))
    if format is not None and format not in set(_FORMATS.values()):
        raise refuse(
            f"the format {format!r} is none of {', '.join(sorted(set(_FORMATS.values())))}",
            "format",
        )
    paths = _paths_of(source)
    if paths is None:
        return _read_one(source, plan, format, progress)
    if len(paths) == 1:
        return _read_one(paths[0], plan, format, progress)
    records = []
    for path in paths:
        try:
            records.append(_read_one(path, plan, format, progress))
        except Error as failure:
            if str(path) in str(failure):
                raise
            raise _reworded(failure, f"{path}: {failure}") from failure
    return _joined(records, paths)


def _joined(records: list[Record], paths: list[Path]) -> Record:
    try:
        return join(records)
    except Error as failure:
        # The core knows the records by number alone.
        named = re.match(r"record (\d+) ", str(failure))
        if named is None:
            raise
        words = str(failure)[named.end() :].replace("the first", str(paths[0]), 1)
        raise _reworded(failure, f"{paths[int(named[1])]}: it {words}") from failure


def _reworded(failure: Error, message: str) -> Error:
    """The same error with another message."""
    return type(failure)(
        message, status=failure.status, argument=failure.argument, detail=failure.detail
    )


def _paths_of(source: Any) -> list[Path] | None:
    """The files that a source names; ``None`` for a source that is itself the contents."""
    if isinstance(source, bytes | bytearray | memoryview) or hasattr(source, "read"):
        return None
    if isinstance(source, list | tuple):
        if not source:
            raise refuse("the list of files is empty: give at least one", "source")
        return [path for item in source for path in _files_of(Path(item))]
    return _files_of(Path(source))


def _files_of(path: Path) -> list[Path]:
    """The file itself, or the recordings in a folder in order of their names."""
    if not path.is_dir():
        return [path]
    files = sorted(item for item in path.iterdir() if item.suffix.lower() in _FORMATS)
    if not files:
        raise FileError(
            f"the folder {str(path)!r} holds no recording ({', '.join(_FORMATS)})",
            status="ULNA_ERROR_FILE",
            argument="source",
        )
    return files


def _read_one(source: Any, plan: _Plan, format: str | None, progress: bool) -> Record:
    contents: bytes | None = None
    if not isinstance(source, Path):
        contents = bytes(source.read() if hasattr(source, "read") else source)
    kind = format or plan.format or _format_of(source, contents)
    if plan.part is not None and kind != "c3d":
        raise refuse(f"only a C3D file has parts, this one is read as {kind}", "part")
    if plan.signals is not None and kind != "mvnx":
        raise refuse(f"only an MVNX file has signals, this one is read as {kind}", "signals")
    if kind == "csv":
        return _read_csv(source, contents, plan, progress)
    if kind in _MOTION:
        return _read_motion(kind, source, contents, plan, progress)
    reader = {"mat": _mat_columns, "npz": _npz_columns, "hdf5": _hdf5_columns}[kind]
    name = source.name if isinstance(source, Path) else f"{kind} in memory"
    if isinstance(source, Path) and not source.is_file():
        what = "is a folder" if source.is_dir() else "does not exist"
        raise FileError(f"{str(source)!r} {what}", status="ULNA_ERROR_FILE", argument="source")
    try:
        columns = list(reader(source, contents))
    except (Error, ImportError):
        raise
    except OSError as failure:
        raise FileError(f"{name} cannot be read: {failure}", status="ULNA_ERROR_FILE") from failure
    except Exception as failure:  # these readers raise whatever a damaged file makes of them
        raise FormatError(
            f"{name} is damaged or no {kind} file: {failure}", status="ULNA_ERROR_FORMAT"
        ) from failure
    return _from_found(columns, name, plan, progress)


def _read_motion(
    kind: str, source: Any, contents: bytes | None, plan: _Plan, progress: bool
) -> Record:
    rules = {"rules": plan.rules, "progress": progress}
    if isinstance(source, Path) and not source.is_file():
        what = "is a folder" if source.is_dir() else "does not exist"
        raise FileError(f"{str(source)!r} {what}", status="ULNA_ERROR_FILE", argument="source")
    if kind == "c3d":
        from . import _read_c3d

        return _read_c3d.read(source, contents, part=plan.part, **rules)
    if kind == "mvnx":
        from . import _read_mvnx

        return _read_mvnx.read(source, contents, signals=plan.signals, **rules)
    from . import _read_opensim

    reader = _read_opensim.read_markers if kind == "trc" else _read_opensim.read_table
    return reader(source, contents, **rules)


def read_suit(source: Any) -> Any:
    """What an MVNX file says of the person and the suit beside the motion.

    Parameters
    ----------
    source : path, bytes or binary file

    Returns
    -------
    Suit
        With ``segments``, ``sensors``, ``joints``, ``points_m``, ``connections``, ``poses`` and
        ``frame_rate_hz``.

    Examples
    --------
    >>> import ulna
    >>> suit = ulna.io.read_suit(
    ...     b'<mvnx><subject frameRate="60"><segments><segment label="Pelvis"><points>'
    ...     b'<point label="jL5S1"><pos_b>0 0 0.1</pos_b></point></points></segment></segments>'
    ...     b'</subject></mvnx>')
    >>> suit.points_m["Pelvis/jL5S1"]
    array([0. , 0. , 0.1])
    """
    from . import _read_mvnx

    if isinstance(source, bytes | bytearray | memoryview) or hasattr(source, "read"):
        contents = bytes(source.read() if hasattr(source, "read") else source)
        return _read_mvnx.read_suit(None, contents)
    return _read_mvnx.read_suit(Path(source), None)


def _format_of(source: Any, contents: bytes | None) -> str:
    if isinstance(source, Path) and source.suffix.lower() in _FORMATS:
        return _FORMATS[source.suffix.lower()]
    head = contents[:16] if contents is not None else b""
    if contents is None and source.is_file():
        with source.open("rb") as file:
            head = file.read(16)
    if head.startswith(b"MATLAB"):
        return "mat"
    if head.startswith(b"\x89HDF"):
        return "hdf5"
    if head.startswith(b"PathFileType"):
        return "trc"
    if len(head) > 1 and head[1] == 0x50 and 2 <= head[0] <= 8:  # no text begins so
        return "c3d"
    if head.lstrip().startswith((b"<?xml", b"<mvnx")):
        return "mvnx"
    return "npz" if head.startswith(b"PK\x03\x04") else "csv"


def _read_csv(source: Any, contents: bytes | None, plan: _Plan, progress: bool) -> Record:
    struct = options(
        "ulna_read_options",
        skip_rows=plan.skip_rows,
        delimiter=ord(plan.delimiter) if plan.delimiter else 0,
        decimal=ord(plan.decimal) if plan.decimal else 0,
        header=plan.header,
        rate_hz=plan.rate_hz,
        time_column=plan.time_column,
        time_unit=plan.time_unit,
        rules=rule_array(plan.rules) if plan.rules else None,
        rule_count=len(plan.rules),
    )
    out = ffi.new("ulna_record **")
    keywords = {"progress": progress, "label": "read"}
    if contents is not None:
        data = ffi.from_buffer(contents)
        long_call(
            lib.ulna_record_read_csv_memory, data, len(contents), struct, ffi.NULL, out, **keywords
        )
    else:
        path = encode(os.fspath(source), "path")
        long_call(lib.ulna_record_read_csv, path, struct, ffi.NULL, out, **keywords)
    return Record(_Record(out[0]))


# Other formats -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Found:
    name: str
    values: np.ndarray
    unit: str = ""


def _columns_of(name: str, value: Any, unit: str = "") -> Iterator[_Found]:
    """One-dimensional arrays as they are; the columns of two-dimensional ones by number."""
    array = np.asarray(value)
    if array.dtype.kind not in "fiub" or array.ndim > 2:
        return
    array = array.astype(float, copy=False)
    if array.ndim == 2 and 1 in array.shape:
        array = array.reshape(-1)
    if array.ndim == 1:
        yield _Found(name, array, unit)
    elif array.ndim == 2:
        if array.shape[0] < array.shape[1]:
            array = array.T  # channels in rows
        for index in range(array.shape[1]):
            yield _Found(f"{name}_{index + 1}", array[:, index], unit)


def _handle_of(source: Any, contents: bytes | None) -> Any:
    if contents is None:
        return source
    from io import BytesIO

    return BytesIO(contents)


def _npz_columns(source: Any, contents: bytes | None) -> Iterator[_Found]:
    with np.load(_handle_of(source, contents), allow_pickle=False) as archive:
        for name in archive.files:
            yield from _columns_of(name, archive[name])


def _mat_columns(source: Any, contents: bytes | None) -> Iterator[_Found]:
    head = contents[:512] if contents is not None else b""
    if contents is None:
        with source.open("rb") as file:
            head = file.read(520)
    # Version 7.3 is HDF5 behind a block of 512 bytes.
    if head.startswith((b"MATLAB 7.3", b"\x89HDF")):
        yield from _hdf5_columns(source, contents)
        return
    try:
        from scipy.io import loadmat
    except ImportError as failure:
        raise ImportError(
            "reading .mat files needs SciPy: install it with `pip install ulna[io]`"
        ) from failure
    variables = loadmat(_handle_of(source, contents), simplify_cells=True)
    yield from _nested({k: v for k, v in variables.items() if not k.startswith("__")}, "")


def _nested(value: Any, name: str) -> Iterator[_Found]:
    if not isinstance(value, dict):
        yield from _columns_of(name, value)
        return
    units = value.get("unit", value.get("units"))
    for key, item in value.items():
        if key in ("unit", "units"):
            continue
        inner = f"{name}.{key}" if name else key
        if isinstance(item, dict):
            yield from _nested(item, inner)
            continue
        unit = units.get(key, "") if isinstance(units, dict) else units
        # struct x with fields value (or data) and unit is the channel x
        inner = name if key in ("value", "values", "data") and isinstance(units, str) else inner
        yield from _columns_of(inner, item, unit if isinstance(unit, str) else "")


def _hdf5_columns(source: Any, contents: bytes | None) -> Iterator[_Found]:
    try:
        import h5py
    except ImportError as failure:
        raise ImportError(
            "reading HDF5 and MATLAB 7.3 files needs h5py: install it with `pip install ulna[io]`"
        ) from failure
    found: list[_Found] = []

    def visit(path: str, item: Any) -> None:
        if not isinstance(item, h5py.Dataset) or path.startswith("#"):
            return
        if "MATLAB_class" in item.attrs and item.attrs["MATLAB_class"] in (b"char", b"cell"):
            return
        unit = item.attrs.get("unit", item.attrs.get("units", ""))
        if isinstance(unit, bytes):
            unit = unit.decode("utf-8", "replace")
        found.extend(_columns_of(path.replace("/", "."), item[()], str(unit)))

    with h5py.File(_handle_of(source, contents), "r") as file:
        file.visititems(visit)
    return iter(found)


def _from_found(columns: list[_Found], name: str, plan: _Plan, progress: bool) -> Record:
    columns = _same_length(columns, name, plan)
    short = _without_common_prefix([c.name for c in columns])
    headings = [f"{s} [{c.unit}]" if c.unit else s for s, c in zip(short, columns, strict=True)]
    # A map names the variable, with or without its struct; the heading carries the unit as well.
    full = dict(zip(short, headings, strict=True))
    full.update({c.name: heading for c, heading in zip(columns, headings, strict=True)})

    def heading_of(source: str) -> str:
        return full.get(source, full.get(source.replace("/", "."), source))

    rules = [{**rule, "source": heading_of(rule["source"])} for rule in plan.rules]
    time = plan.time_column
    return from_columns(
        np.column_stack([c.values for c in columns]),
        headings,
        rules=rules,
        time_column=heading_of(time) if time else None,
        time_unit=plan.time_unit,
        rate_hz=plan.rate_hz,
        name=name,
        progress=progress,
    )


def _without_common_prefix(names: list[str]) -> list[str]:
    """Names without the struct or group that holds all of those inside one.

    Examples
    --------
    >>> _without_common_prefix(["log.time", "log.pos.x", "gain"])
    ['time', 'pos.x', 'gain']
    """
    inside = [name.split(".")[:-1] for name in names if "." in name]
    common = os.path.commonprefix(inside)  # of lists, element by element
    prefix = "".join(f"{part}." for part in common)
    out = [name[len(prefix) :] if "." in name else name for name in names]
    return out if len(set(out)) == len(out) else names


def _same_length(columns: list[_Found], name: str, plan: _Plan) -> list[_Found]:
    if not columns:
        raise FormatError(
            f"{name} holds no arrays of numbers: save time, position and force as vectors",
            status="ULNA_ERROR_FORMAT",
        )
    lengths: dict[int, list[str]] = {}
    for column in columns:
        lengths.setdefault(len(column.values), []).append(column.name)
    sources = [rule["source"] for rule in plan.rules] + [plan.time_column or ""]
    needed = {source.replace("/", ".") for source in sources}
    # Parameters of one number beside the signals are no channels.
    scalars = lengths.pop(1, []) if len(lengths) > 1 else []
    kept = [c for c in columns if c.name not in scalars or c.name in needed]
    if len({len(c.values) for c in kept}) > 1:
        parts = (f"{', '.join(names[:4])}: {length}" for length, names in lengths.items())
        raise FormatError(
            f"the arrays in {name} have different lengths ({'; '.join(parts)}): save them on one clock",
            status="ULNA_ERROR_FORMAT",
        )
    return kept


# The map -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Plan:
    rules: tuple[Mapping[str, Any], ...] = ()
    time_column: str | None = None
    time_unit: str | None = None
    rate_hz: float = 0.0
    delimiter: str = ""
    decimal: str = ""
    skip_rows: int = 0
    header: int = 0
    format: str | None = None
    part: str | None = None
    signals: tuple[str, ...] | None = None


def _load_map(source: Any) -> _Plan:
    if source is None:
        return _Plan()
    if isinstance(source, Mapping):
        return _Checker("the map", "").plan(dict(source))
    path = Path(source)
    try:
        contents = path.read_text(encoding="utf-8")
    except OSError as failure:
        raise FileError(
            f"the map {str(path)!r} cannot be read: {failure.strerror}",
            status="ULNA_ERROR_FILE",
            argument="map",
        ) from failure
    except UnicodeDecodeError as failure:
        raise FormatError(
            f"the map {str(path)!r} is no UTF-8 text", status="ULNA_ERROR_FORMAT", argument="map"
        ) from failure
    try:
        table = tomllib.loads(contents)
    except tomllib.TOMLDecodeError as failure:
        raise FormatError(
            f"the map {path.name} is no TOML: {failure}", status="ULNA_ERROR_FORMAT", argument="map"
        ) from failure
    return _Checker(path.name, contents).plan(table)


class _Checker:
    """Refuses what a map must not hold, with the key and its line."""

    def __init__(self, name: str, contents: str) -> None:
        self.name = name
        self.lines = contents.splitlines()

    def place(self, key: str, which: int = 0) -> str:
        pattern = re.compile(rf"^\s*(\[+\s*)?[\"']?{re.escape(key)}[\"']?\s*(=|\]|$)")
        hits = [i + 1 for i, line in enumerate(self.lines) if pattern.match(line)]
        return f"line {hits[min(which, len(hits) - 1)]} of {self.name}" if hits else self.name

    def refuse(self, key: str, message: str) -> Error:
        return FormatError(
            f"{self.place(key)}: {message}",
            status="ULNA_ERROR_FORMAT",
            argument="map",
            detail=f"key {key}",
        )

    def table(self, table: Any, keys: Mapping[str, Any], where: str) -> dict[str, Any]:
        if not isinstance(table, dict):
            raise self.refuse(where, f"{where} must be a table")
        for key, value in table.items():
            if key not in keys:
                known = ", ".join(keys)
                raise self.refuse(key, f"{where} has no key {key!r}; it has {known}")
            kinds = keys[key]
            if not isinstance(value, kinds) or (isinstance(value, bool) and kinds is not bool):
                kinds = kinds if isinstance(kinds, tuple) else (kinds,)
                words = {
                    str: "a text",
                    int: "a whole number",
                    float: "a number",
                    bool: "true or false",
                    dict: "a table",
                    list: "a list of tables ([[channel]])",
                }
                wanted = " or ".join(words[k] for k in kinds)
                raise self.refuse(key, f"{key} must be {wanted}")
        return table

    def plan(self, table: dict[str, Any]) -> _Plan:
        self.table(table, _TOP_KEYS, "a map")
        file = self.table(table.get("file", {}), _FILE_KEYS, "[file]")
        time = self.table(table.get("time", {}), _TIME_KEYS, "[time]")
        rate = float(table.get("rate_hz", 0.0))
        if "rate_hz" in table and not 0 < rate < float("inf"):
            raise self.refuse("rate_hz", "rate_hz must be positive")
        if rate and "column" in time:
            raise self.refuse("rate_hz", "give rate_hz or a time column, not both")
        delimiter = {"tab": "\t", "\\t": "\t"}.get(
            file.get("delimiter", ""), file.get("delimiter", "")
        )
        for key, value in (("delimiter", delimiter), ("decimal", file.get("decimal", ""))):
            if len(value) > 1:
                raise self.refuse(key, f"{key} must be one character")
        if file.get("format", "csv") not in set(_FORMATS.values()):
            known = ", ".join(sorted(set(_FORMATS.values())))
            raise self.refuse("format", f"format must be one of {known}")
        if file.get("skip_rows", 0) < 0:
            raise self.refuse("skip_rows", "skip_rows must be 0 or more")
        for item in table.get("channel", []):
            column = item.get("column") if isinstance(item, dict) else None
            if column is not None and column == time.get("column"):
                raise self.refuse(
                    "time", f"the column {column!r} is the time: remove its [[channel]] table"
                )
        header = {None: 0, True: lib.ULNA_HEADER_PRESENT, False: lib.ULNA_HEADER_ABSENT}
        return _Plan(
            rules=tuple(self.rule(item) for item in table.get("channel", [])),
            time_column=time.get("column"),
            time_unit=time.get("unit"),
            rate_hz=rate,
            delimiter=delimiter,
            decimal=file.get("decimal", ""),
            skip_rows=file.get("skip_rows", 0),
            header=header[file.get("header")],
            format=file.get("format"),
            part=file.get("part"),
        )

    def rule(self, item: Any) -> dict[str, Any]:
        self.table(item, _CHANNEL_KEYS, "[[channel]]")
        if "column" not in item:
            raise self.refuse("channel", "a [[channel]] needs its column")
        rule = {key: value for key, value in item.items() if key != "column"}
        rule["source"] = item["column"]
        if rule.get("role", "other") not in ROLES:
            raise self.refuse("role", f"role {rule['role']!r} is none of {', '.join(ROLES)}")
        if rule.get("sign", 1) not in (1, -1):
            raise self.refuse("sign", "sign must be 1 or -1")
        if "axis" in rule:
            letters = {"x": 0, "y": 1, "z": 2}
            axis = letters.get(rule["axis"], rule["axis"])
            if not isinstance(axis, int) or axis < 0:
                raise self.refuse("axis", 'axis must be "x", "y", "z" or a number from 0')
            rule["axis"] = axis
        return rule


# Inspection --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Inspection:
    """What a file holds, how it was understood, and the draft of a map for it."""

    path: str
    record: Record
    rate_is_missing: bool

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns of the file."""
        time = (self.record.source.time_column,) if self.record.source.time_column else ()
        return time + tuple(channel.source_name for channel in self.record.channels)

    @property
    def channels(self) -> Any:
        """What each column was taken for."""
        return self.record.channels

    @property
    def findings(self) -> Any:
        """What the reader and a look at the data found."""
        return self.record.findings

    @property
    def map_toml(self) -> str:
        """The draft of a map, as `toml` gives it."""
        return self.toml()

    def toml(self) -> str:
        """A map that reads this file to the same record, to be corrected where it is wrong.

        Examples
        --------
        >>> import ulna
        >>> print(ulna.inspect(b"t,x_mm\\n0,1\\n0.001,2\\n").toml().splitlines()[0])
        # Map for data in memory. Roles: position, force, reference, other.
        """
        source = self.record.source
        lines = [
            f"# Map for {self.path}. Roles: position, force, reference, other.",
            "# sign = -1 turns a force of the robot on the human into that of the human on the robot.",
            "",
        ]
        if self.rate_is_missing:
            lines += ["rate_hz = 1.0  # no column looks like time: write the true rate here", ""]
        elif not source.time_column:
            lines += [f"rate_hz = {self.record.rate_hz!r}", ""]
        if source.delimiter:
            lines += [
                "[file]",
                f"delimiter = {_toml(source.delimiter)}",
                f"decimal = {_toml(source.decimal)}",
                f"header = {'true' if source.header else 'false'}",
            ]
            lines += [f"skip_rows = {source.skip_rows}"] if source.skip_rows else []
            lines.append("")
        if source.time_column:
            lines += [
                "[time]",
                f"column = {_toml(source.time_column)}",
                f"unit = {_toml(source.time_unit)}",
                "",
            ]
        for channel in self.record.channels:
            known = _is_known(channel.source_unit)
            lines += ["[[channel]]", f"column = {_toml(channel.source_name)}"]
            lines += [f"name = {_toml(channel.name)}", f"role = {_toml(channel.role)}"]
            if channel.role != "other":
                lines.append(f"axis = {channel.axis}")
                lines.append(f"unit = {_toml(channel.source_unit if known else channel.unit)}")
            elif known:
                lines.append(f"unit = {_toml(channel.source_unit)}")
            else:
                lines.append('# unit = "..."  # the file does not say, or says an unknown one')
            lines += [f"sign = {channel.sign}"] if channel.sign != 1 else []
            lines += [f"frame = {_toml(channel.frame)}"] if channel.frame else []
            lines.append("")
        return "\n".join(lines)

    def summary(self) -> str:
        """What was found, as text.

        Examples
        --------
        >>> import ulna
        >>> print(ulna.inspect(b"t,x_mm\\n0,1\\n0.001,2\\n").summary().splitlines()[0])
        data in memory: 2 samples at 1000 Hz, 0.002 s, 1 trial
        """
        text = f"{self.path}: {self.record.summary()}"
        if self.rate_is_missing:
            text += "\nerror: no column looks like time: name it in the map, or give rate_hz there"
        return text


def _is_known(unit: str) -> bool:
    from .record import unit_factor

    try:
        unit_factor(unit)
    except Error:
        return False
    return bool(unit)


def _toml(value: str) -> str:
    escaped = value.replace("\\", "\\\\").replace('"', '\\"').replace("\t", "\\t")
    return f'"{escaped}"'


def inspect(source: Any, *, map: Any = None, format: str | None = None) -> Inspection:
    """See what a file holds and draft a map for it.

    Parameters
    ----------
    source : path, bytes or binary file
    map : path or dict, optional
        A map to start from.
    format : str, optional
        As in `ulna.read`.

    Returns
    -------
    Inspection
        With ``columns``, ``channels`` (the guesses), ``findings``, ``summary()`` and ``toml()``.

    Examples
    --------
    >>> import ulna
    >>> ulna.inspect(b"t,x_mm\\n0,1\\n0.001,2\\n").columns
    ('t', 'x_mm')
    """
    in_memory = isinstance(source, bytes | bytearray | memoryview) or hasattr(source, "read")
    if hasattr(source, "read"):
        source = source.read()
    name = "data in memory" if in_memory else str(source)
    try:
        return Inspection(name, read(source, map=map, format=format), False)
    except Error as failure:
        # Only the clock is missing: everything else can still be shown.
        if failure.argument != "time" or failure.status != "ULNA_ERROR_ARGUMENT" or map is not None:
            raise
    return Inspection(name, read(source, map={"rate_hz": 1.0}, format=format), True)


__all__: Sequence[str] = ("Inspection", "inspect", "read", "read_suit")
