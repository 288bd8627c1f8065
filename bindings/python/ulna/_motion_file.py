"""What the readers of motion-capture files share: columns with unit and frame, and their record."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ._call import FileError, FormatError
from .record import Record, from_columns

# Without a limit a damaged count would ask for all memory before the first row is read.
MAX_CELLS = 2_000_000_000


@dataclass(frozen=True)
class Column:
    """One column of a file.

    ``values`` are the file's and in its ``unit``, ``""`` where it does not say; the record multiplies
    them by ``sign``.
    """

    name: str
    values: np.ndarray
    unit: str = ""
    frame: str = ""
    role: str = "other"
    sign: int = 1


def broken(message: str, *, where: str = "") -> FormatError:
    """The error of a file that does not hold what its kind promises."""
    return FormatError(message, status="ULNA_ERROR_FORMAT", detail=where)


def bytes_of(source: Any, contents: bytes | None) -> bytes:
    """The whole file."""
    if contents is not None:
        return contents
    try:
        return Path(source).read_bytes()
    except OSError as failure:
        raise FileError(
            f"{str(source)!r} cannot be read: {failure.strerror}", status="ULNA_ERROR_FILE"
        ) from failure


def lines_of(source: Any, contents: bytes | None, name: str) -> list[str]:
    """The lines of a text file without their ends."""
    data = bytes_of(source, contents)
    if b"\0" in data:
        raise broken(f"{name} holds zero bytes, so it is no text")
    try:
        return data.decode("utf-8-sig").splitlines()
    except UnicodeDecodeError:
        return data.decode("latin-1").splitlines()


def table_of(lines: Sequence[str], *, first_line: int, columns: int, name: str) -> np.ndarray:
    """Numbers of a table; an empty cell between tabs is a missing value.

    Parameters
    ----------
    lines
        Rows, blank ones at the end are left out.
    first_line : int
        Number of the first row in the file, from 1, for messages.
    columns : int
        Cells that each row must have.

    Examples
    --------
    >>> table_of(["1\\t2", "3\\t"], first_line=7, columns=2, name="a.mot")
    array([[ 1.,  2.],
           [ 3., nan]])
    """
    rows = list(lines)
    while rows and not rows[-1].strip():
        rows.pop()
    if len(rows) * columns > MAX_CELLS:
        raise broken(f"{name} has {len(rows)} rows of {columns} columns, more than can be held")
    fast = _whole_table(rows, columns)
    if fast is not None:
        return fast
    out = np.empty((len(rows), columns))
    for index, row in enumerate(rows):
        cells = row.rstrip("\r\n ").split("\t") if "\t" in row else row.split()
        if len(cells) > columns and not any(cell.strip() for cell in cells[columns:]):
            cells = cells[:columns]  # a tab at the end of the row
        place = f"line {first_line + index}"
        if len(cells) != columns:
            last = index + 1 == len(rows)
            advice = "the file was cut off" if last else "repair the line"
            raise broken(
                f"{place} of {name} has {len(cells)} cells, {columns} are expected: {advice}",
                where=place,
            )
        try:
            out[index] = cells
        except ValueError:
            out[index] = [_number(cell, place, name) for cell in cells]
    return out


def _whole_table(rows: Sequence[str], columns: int) -> np.ndarray | None:
    """The numbers at once, where every cell is there; row by row names what is wrong."""
    if not rows or any("\t\t" in row or row.startswith("\t") for row in rows):
        return None
    try:
        table = np.loadtxt(rows, comments=None, ndmin=2)
    except ValueError:
        return None
    return table if table.shape == (len(rows), columns) else None


def _number(cell: str, place: str, name: str) -> float:
    text = cell.strip()
    if not text:
        return np.nan
    try:
        return float(text)
    except ValueError:
        raise broken(
            f"{place} of {name} holds {text[:40]!r}, which is no number", where=place
        ) from None


def named_columns(
    names: Sequence[str], values: np.ndarray, *, units: Sequence[str], frame: str = ""
) -> list[Column]:
    """Columns of a matrix."""
    return [
        Column(name, values[:, index], unit, frame)
        for index, (name, unit) in enumerate(zip(names, units, strict=True))
    ]


def record_of(
    columns: Sequence[Column],
    *,
    name: str,
    time_s: np.ndarray | None = None,
    rate_hz: float = 0.0,
    rules: Sequence[Mapping[str, Any]] = (),
    progress: bool = False,
) -> Record:
    """A record of columns; rules of a map come before what the file says.

    Parameters
    ----------
    columns
        At least one.
    time_s : ndarray, shape (n,), optional
        Else `rate_hz` is the clock.
    rules
        As in a map's ``[[channel]]``, with ``source`` for ``column``.
    """
    if not columns:
        raise broken(f"{name} holds no signals")
    twice = _first_repeated([column.name for column in columns])
    if twice is not None:
        raise broken(f"{name} has two columns named {twice!r}: rename one of them")
    told = {rule["source"]: rule for rule in rules}
    for source in told:
        if source not in {column.name for column in columns}:
            near = ", ".join(column.name for column in columns[:6])
            raise broken(f"the map names the column {source!r}, but {name} has {near} and so on")
    merged = []
    for column in columns:
        own = {
            "source": column.name,
            "name": column.name,
            "unit": column.unit,
            "frame": column.frame,
            "role": column.role,
            "sign": column.sign,
        }
        merged.append({**own, **told.get(column.name, {})})
    table = [column.values for column in columns]
    headings = [column.name for column in columns]
    if time_s is not None:
        # No channel may have the name of the clock.
        clock = "time" if "time" not in headings else "\x01time"
        table, headings = [time_s, *table], [clock, *headings]
    return from_columns(
        np.column_stack(table),
        headings,
        rules=merged,
        time_column=None if time_s is None else headings[0],
        time_unit=None if time_s is None else "s",
        rate_hz=0.0 if time_s is not None else rate_hz,
        name=name,
        progress=progress,
    )


def _first_repeated(names: Sequence[str]) -> str | None:
    seen: set[str] = set()
    for name in names:
        if name in seen:
            return name
        seen.add(name)
    return None
