"""Records: logs of an experiment as channels on one clock.

Values are SI. Positions are in the frame of the log; forces and torques are those of the human on the
robot. A record never changes: what alters one returns another.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ._call import (
    ArgumentError,
    Handle,
    check,
    decode,
    encode,
    ffi,
    lib,
    long_call,
    options,
    out_array,
    result,
    text,
    view,
)

ROLES = ("other", "position", "force", "reference")
SEVERITIES = ("note", "warning", "error")


@dataclass(frozen=True)
class Channel:
    """One channel: what it is, and what it was in the file.

    ``unit`` is SI; ``sign`` is what the source was multiplied by; ``axis`` counts from 0 within the
    role (``"position"``, ``"force"``, ``"reference"`` or ``"other"``).
    """

    name: str
    unit: str
    role: str
    axis: int
    frame: str = ""
    sign: int = 1
    source_name: str = ""
    source_unit: str = ""


@dataclass(frozen=True)
class Trial:
    """Rows ``begin`` to ``end`` (excluded) recorded without interruption."""

    begin: int
    end: int


@dataclass(frozen=True)
class Segment:
    """Rows ``begin`` to ``end`` (excluded) of one trial that an analysis uses."""

    begin: int
    end: int
    trial: int


@dataclass(frozen=True)
class Finding:
    """What a look at the data found; ``channel`` is empty for the clock."""

    severity: str
    code: str
    channel: str
    row: int
    count: int
    message: str


@dataclass(frozen=True)
class Source:
    """How a file was understood; ``delimiter`` is empty when it was no text table."""

    delimiter: str
    decimal: str
    skip_rows: int
    header: bool
    time_column: str
    time_unit: str


class _Record(Handle):
    kind = "ulna_record"
    __slots__ = ()


def refuse(message: str, argument: str = "") -> ArgumentError:
    """An argument error of the Python layer, to be raised."""
    return ArgumentError(message, status="ULNA_ERROR_ARGUMENT", argument=argument)


def pick(table: Mapping[Any, int], value: Any, name: str) -> int:
    """The constant behind a word; an argument error of the Python layer otherwise."""
    try:
        return table[value]
    except (KeyError, TypeError):
        known = ", ".join(repr(key) for key in table)
        raise refuse(f"{name} is {value!r}; it must be one of {known}", name) from None


def rule_array(rules: Sequence[Mapping[str, Any]]) -> Any:
    """Rules as the C interface takes them; keys are those of a map's ``[[channel]]``."""
    array = ffi.new("ulna_channel_rule[]", len(rules))
    for item, rule in zip(array, rules, strict=True):
        for name in ("source", "name", "unit", "frame"):
            data = str(rule.get(name, "")).encode("utf-8", "surrogateescape")
            if len(data) >= ffi.sizeof(getattr(item, name)) or b"\0" in data:
                raise refuse(f"the {name} {rule[name]!r} is too long or holds a zero byte", name)
            setattr(item, name, data)
        item.sign = int(rule.get("sign", 1))
        role = rule.get("role")
        if role is not None and role not in ROLES:
            raise refuse(f"the role {role!r} is none of {', '.join(ROLES)}", "role")
        item.role = 0 if role is None else lib.ULNA_ROLE_NONE if role == "other" else ROLES.index(role)
        axis = rule.get("axis")
        item.axis = 0 if axis is None else int(axis) + 1
    return array


@dataclass(frozen=True, eq=False, repr=False)
class Record:
    """Channels with name, unit, frame and sign on one clock, in one or more trials.

    Made by `ulna.read` or `Record.from_arrays`. ``record["F_x"]`` is a read-only view of the values.

    Examples
    --------
    >>> import numpy as np
    >>> import ulna
    >>> t = np.arange(1000) / 1000
    >>> log = ulna.Record.from_arrays(t, {"x": 10 * np.sin(t), "F_x": np.cos(t)}, units={"x": "mm"})
    >>> log
    <Record: 1000 samples at 1000 Hz, 1 trial; x [m], F_x [N]>
    >>> float(log["x"].max()) < 0.01
    True
    """

    _handle: _Record

    # Making -----------------------------------------------------------------------------------

    @classmethod
    def from_arrays(
        cls,
        time: Any,
        channels: Mapping[str, Any],
        *,
        units: Mapping[str, str] | None = None,
        roles: Mapping[str, str] | None = None,
        signs: Mapping[str, int] | None = None,
        frame: str = "",
        rate_hz: float = 0.0,
    ) -> Record:
        """Make a record from arrays.

        Parameters
        ----------
        time : array_like, shape (n,), or None
            Seconds; ``None`` with `rate_hz`.
        channels : mapping of str to array_like, shape (n,)
            Values by name. Names such as ``x``, ``F_x``, ``torque``, ``x_ref`` tell the role.
        units : mapping of str to str, optional
            Units of the values as given, ``{"x": "mm"}``; SI where absent.
        roles : mapping of str to str, optional
            ``"position"``, ``"force"``, ``"reference"`` or ``"other"`` by name, where the name does
            not tell.
        signs : mapping of str to int, optional
            -1 turns a channel, for a force of the robot on the human.
        frame : str
            Frame of all values.
        rate_hz : float
            Sample rate when there is no time.

        Examples
        --------
        >>> import ulna
        >>> log = ulna.Record.from_arrays(None, {"a": [0.0, 1.0, 4.0]}, roles={"a": "position"},
        ...                               units={"a": "deg"}, rate_hz=100)
        >>> log.channels[0].role, log.channels[0].unit, log.duration_s
        ('position', 'rad', 0.03)
        """
        names = list(channels)
        for word, given in (("units", units), ("roles", roles), ("signs", signs)):
            for name in given or {}:
                if name not in channels:
                    raise refuse(
                        f"{word} names the channel {name!r}, but the channels are {', '.join(names)}",
                        word,
                    )
        if time is None and not rate_hz > 0:
            raise refuse("give the time of the samples, or rate_hz", "time")
        columns = {name: np.asarray(values, dtype=float) for name, values in channels.items()}
        if time is not None:
            columns = {"\x01time": np.asarray(time, dtype=float), **columns}
        if not names:
            raise refuse("there are no channels: give at least one", "channels")
        length = len(next(iter(columns.values())))
        for name, values in columns.items():
            if values.ndim != 1 or len(values) != length:
                raise refuse(
                    f"{name.strip(chr(1))!r} has the shape {values.shape}, but ({length},) is expected",
                    name.strip("\x01"),
                )
        rules = [
            {
                "source": name,
                "name": name,
                "unit": (units or {}).get(name, ""),
                "role": (roles or {}).get(name),
                "sign": (signs or {}).get(name, 1),
                "frame": frame,
            }
            for name in names
        ]
        return from_columns(
            np.column_stack(list(columns.values())),
            list(columns),
            rules=rules,
            time_column=None if time is None else "\x01time",
            time_unit=None if time is None else "s",
            rate_hz=0.0 if time is not None else rate_hz,
            name="arrays",
        )

    @classmethod
    def _from_parts(cls, parts: dict[str, Any]) -> Record:
        channels = ffi.new("ulna_channel[]", len(parts["channels"]))
        for item, channel in zip(channels, parts["channels"], strict=True):
            item.struct_size = ffi.sizeof("ulna_channel")
            for name in ("name", "unit", "frame", "source_name", "source_unit"):
                setattr(item, name, getattr(channel, name).encode())
            item.sign, item.role, item.axis = channel.sign, ROLES.index(channel.role), channel.axis
        trials = ffi.new("ulna_trial[]", [(t.begin, t.end) for t in parts["trials"]])
        segments = ffi.new("ulna_segment[]", [(s.begin, s.end, s.trial) for s in parts["segments"]])
        struct = options(
            "ulna_record_parts",
            time=parts["time"],
            values=parts["values"],
            rate_hz=parts["rate_hz"],
            channels=channels,
            channel_count=len(channels),
            trials=trials,
            trial_count=len(trials),
            segments=segments,
            segment_count=len(segments),
            provenance="\n".join(parts["provenance"]),
        )
        return cls(_Record.make(lib.ulna_record_new, struct))

    def __reduce__(self) -> Any:
        parts = {
            "time": np.array(self.time),
            "values": np.array(self.values, order="F"),
            "rate_hz": self.rate_hz,
            "channels": self.channels,
            "trials": self.trials,
            "segments": self.segments,
            "provenance": self.provenance,
        }
        return Record._from_parts, (parts,)

    # Looking ----------------------------------------------------------------------------------

    @cached_property
    def _info(self) -> Any:
        info = result("ulna_record_info")
        check(lib.ulna_record_get_info(self._handle.pointer, info))
        return info

    def _items(self, kind: str, function: Any, count: int) -> Any:
        for index in range(count):
            item = result(kind)
            check(function(self._handle.pointer, index, item))
            yield item

    def _window(self, function: Any, count: int) -> np.ndarray:
        pointer = ffi.new("const double **")
        check(function(self._handle.pointer, pointer))
        # The array's base keeps the handle, and so the native memory, alive.
        owner = _Window(self._handle, int(ffi.cast("intptr_t", pointer[0])), count)
        return np.asarray(owner)

    @cached_property
    def channels(self) -> tuple[Channel, ...]:
        """What each column of `values` is."""
        items = self._items("ulna_channel", lib.ulna_record_get_channel, self._info.channels)
        return tuple(
            Channel(
                name=decode(c.name),
                unit=decode(c.unit),
                role=ROLES[c.role],
                axis=c.axis,
                frame=decode(c.frame),
                sign=c.sign,
                source_name=decode(c.source_name),
                source_unit=decode(c.source_unit),
            )
            for c in items
        )

    @cached_property
    def trials(self) -> tuple[Trial, ...]:
        """Rows of each uninterrupted recording."""
        items = self._items("ulna_trial", lib.ulna_record_get_trial, self._info.trials)
        return tuple(Trial(t.begin, t.end) for t in items)

    @cached_property
    def segments(self) -> tuple[Segment, ...]:
        """Rows that an analysis uses; one segment a trial unless chosen otherwise."""
        items = self._items("ulna_segment", lib.ulna_record_get_segment, self._info.segments)
        return tuple(Segment(s.begin, s.end, s.trial) for s in items)

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """What the reader and a look at the data found."""
        items = self._items("ulna_finding", lib.ulna_record_get_finding, self._info.findings)
        return tuple(
            Finding(
                SEVERITIES[f.severity],
                decode(f.code),
                decode(f.channel),
                f.row,
                f.count,
                decode(f.message),
            )
            for f in items
        )

    @cached_property
    def provenance(self) -> tuple[str, ...]:
        """One line for every step since the file."""
        return tuple(text(lib.ulna_record_provenance, self._handle.pointer).splitlines())

    @cached_property
    def source(self) -> Source:
        """How the file was understood."""
        found = result("ulna_record_source")
        check(lib.ulna_record_get_source(self._handle.pointer, found))
        return Source(
            delimiter=chr(found.delimiter) if found.delimiter else "",
            decimal=chr(found.decimal) if found.decimal else "",
            skip_rows=found.skip_rows,
            header=found.header == lib.ULNA_HEADER_PRESENT,
            time_column=decode(found.time_column),
            time_unit=decode(found.time_unit),
        )

    @property
    def rate_hz(self) -> float:
        """Sample rate."""
        return float(self._info.rate_hz)

    @property
    def duration_s(self) -> float:
        """Length of all trials together."""
        return float(self._info.duration_s)

    @cached_property
    def time(self) -> np.ndarray:
        """Time of each row in s, read-only, shape (n,)."""
        return self._window(lib.ulna_record_time, self._info.rows)

    @cached_property
    def values(self) -> np.ndarray:
        """All values, read-only, shape (n, channels), SI."""
        rows, columns = self._info.rows, self._info.channels
        return self._window(lib.ulna_record_values, rows * columns).reshape(rows, columns, order="F")

    def __len__(self) -> int:
        return int(self._info.rows)

    def __getitem__(self, name: str) -> np.ndarray:
        """Values of one channel, read-only, shape (n,)."""
        for index, channel in enumerate(self.channels):
            if channel.name == name:
                return self.values[:, index]
        known = ", ".join(c.name for c in self.channels)
        raise KeyError(f"there is no channel {name!r}; the channels are {known}")

    def __contains__(self, name: object) -> bool:
        return any(channel.name == name for channel in self.channels)

    def with_role(self, role: str) -> tuple[int, ...]:
        """Columns of a role, in order of axis.

        Examples
        --------
        >>> import ulna
        >>> ulna.Record.from_arrays([0, 1], {"F_x": [1, 2], "x": [0, 1]}).with_role("position")
        (1,)
        """
        if role not in ROLES:
            raise refuse(f"the role {role!r} is none of {', '.join(ROLES)}", "role")
        found = out_array(lib.ulna_record_with_role, self._handle.pointer, ROLES.index(role))
        return tuple(found.tolist())

    def resolve(self, word: str | Sequence[str]) -> tuple[int, ...]:
        """Columns that a word stands for: ``"F"`` for F_x and F_y, ``"x"`` for x and y, ``"x_ref"``.

        A list of names means exactly these channels.

        Examples
        --------
        >>> import ulna
        >>> log = ulna.Record.from_arrays([0, 1], {"x": [1, 2], "y": [0, 1]})
        >>> log.resolve("x"), log.resolve(["x"])
        ((0, 1), (0,))
        """
        if isinstance(word, str):
            pointer = encode(word, "word")
            return tuple(out_array(lib.ulna_record_resolve, self._handle.pointer, pointer).tolist())
        names = [channel.name for channel in self.channels]
        for name in word:
            if name not in names:
                raise refuse(f"there is no channel {name!r}; the channels are {', '.join(names)}")
        return tuple(names.index(name) for name in word)

    def summary(self) -> str:
        """What the record holds and what was found, as text.

        Examples
        --------
        >>> import ulna
        >>> print(ulna.Record.from_arrays([0, 0.1], {"x": [1, 2]}, units={"x": "mm"}).summary())
        2 samples at 10 Hz, 0.2 s, 1 trial
          x [m]  position
        warning: the sample rate is 10 Hz: check the unit of the time (s or ms), 100 to 10000 Hz are usual
        error: the record has only 2 samples: an analysis needs some seconds of recording
        """
        trials = len(self.trials)
        lines = [
            f"{len(self)} samples at {self.rate_hz:.6g} Hz, {self.duration_s:.6g} s, "
            f"{trials} trial{'s' if trials != 1 else ''}"
        ]
        for channel in self.channels:
            line = f"  {channel.name} [{channel.unit or '?'}]  {channel.role}"
            if channel.source_name not in ("", channel.name):
                sign = "-" if channel.sign < 0 else ""
                line += f", from {sign}{channel.source_name}"
                if channel.source_unit and channel.source_unit not in channel.source_name:
                    line += f" [{channel.source_unit}]"
            lines.append(line)
        order = sorted(self.findings, key=lambda f: SEVERITIES.index(f.severity))
        lines += [f"{finding.severity}: {finding.message}" for finding in order]
        return "\n".join(lines)

    def __repr__(self) -> str:
        trials = len(self.trials)
        names = [f"{c.name} [{c.unit or '?'}]" for c in self.channels[:8]]
        names += ["..."] if len(self.channels) > 8 else []
        return (
            f"<Record: {len(self)} samples at {self.rate_hz:.6g} Hz, "
            f"{trials} trial{'s' if trials != 1 else ''}; {', '.join(names)}>"
        )

    # Other records ----------------------------------------------------------------------------

    def split(self, *, gap_steps: float = 1.5, min_rows: int = 100) -> Record:
        """The same rows with a trial for every piece between gaps and missing values.

        Parameters
        ----------
        gap_steps : float
            A time step above this many sample steps ends a trial.
        min_rows : int
            Shorter pieces are left out.

        Examples
        --------
        >>> import numpy as np
        >>> import ulna
        >>> t = np.arange(1000) / 1000
        >>> t[500:] += 1
        >>> len(ulna.Record.from_arrays(t, {"x": np.sin(t)}).split().trials)
        2
        """
        if min_rows < 1:
            raise refuse("min_rows must be at least 1", "min_rows")
        if not gap_steps > 1:
            raise refuse("gap_steps must be above 1", "gap_steps")
        return self._derive(lib.ulna_record_split, float(gap_steps), int(min_rows))

    def select(
        self,
        *,
        rows: slice | None = None,
        start_s: float | None = None,
        stop_s: float | None = None,
        trials: Sequence[int] | int | None = None,
        onsets_s: Any = None,
        before_s: float = 0.0,
        after_s: float | None = None,
    ) -> Record:
        """Part of the record: rows, a span of time, trials, or segments around triggers.

        Parameters
        ----------
        rows : slice, optional
            Rows without a step.
        start_s, stop_s : float, optional
            Span of the record's clock, stop excluded.
        trials : int or sequence of int, optional
            Trials by number.
        onsets_s : array_like, shape (k,), optional
            Onsets on the record's clock; one segment each, of `before_s` before to `after_s` after.
            Segments must not overlap.

        Examples
        --------
        >>> import numpy as np
        >>> import ulna
        >>> t = np.arange(1000) / 1000
        >>> log = ulna.Record.from_arrays(t, {"x": np.sin(t)})
        >>> len(log.select(start_s=0.2, stop_s=0.5)), len(log.select(rows=slice(10, 20)))
        (300, 10)
        >>> log.select(onsets_s=[0.1, 0.5], after_s=0.2).segments[1]
        Segment(begin=500, end=700, trial=0)
        """
        record = self
        if trials is not None:
            numbers = np.atleast_1d(np.asarray(trials, dtype=np.int64))
            pointer = ffi.from_buffer("int64_t[]", np.ascontiguousarray(numbers))
            record = record._derive(lib.ulna_record_select_trials, pointer, len(numbers))
        if rows is not None and (start_s is not None or stop_s is not None):
            raise refuse("give rows or a span of time, not both", "rows")
        if rows is not None:
            begin, end, step = rows.indices(len(record))
            if step != 1:
                raise refuse("rows must have the step 1: a record keeps every sample", "rows")
            record = record._derive(lib.ulna_record_select_rows, begin, end)
        if start_s is not None or stop_s is not None:
            record = record._span(start_s, stop_s)
        if onsets_s is not None:
            if after_s is None:
                raise refuse("give after_s, the length of the segments after the onsets", "after_s")
            times = np.asarray(onsets_s, dtype=float).reshape(-1)
            record._refuse_overlaps(times, float(before_s) + float(after_s))
            onsets = view(times)
            record = record._derive(
                lib.ulna_record_with_segments, onsets, float(before_s), float(after_s)
            )
        return record

    def _refuse_overlaps(self, onsets_s: np.ndarray, length_s: float) -> None:
        """A sample in two segments would count twice in every fit and bootstrap."""
        order = np.argsort(onsets_s, kind="stable")
        # Segments are whole samples: neighbours that share less than half a step do not overlap.
        with np.errstate(invalid="ignore"):  # onsets that are no numbers are refused by the core
            apart = np.diff(onsets_s[order])
            close = np.flatnonzero(apart < length_s - 0.5 / self.rate_hz)
        if not len(close):
            return
        first, second = sorted(int(which) for which in order[close[0] : close[0] + 2])
        room = float(apart[close[0]])
        advice = f", or make before_s and after_s at most {room:g} s in all" if room > 0 else ""
        raise refuse(
            f"the segments of onset {first} ({onsets_s[first]:g} s) and onset {second} "
            f"({onsets_s[second]:g} s) overlap: leave one out{advice}",
            "onsets_s",
        )

    def _span(self, start_s: float | None, stop_s: float | None) -> Record:
        if np.any(np.diff(self.time) <= 0):
            raise refuse("the clock restarts in this record: select trials before a span", "start_s")
        # Stamps are rounded; a thousandth of a step decides no sample.
        slack = 1e-3 / self.rate_hz
        begin = 0 if start_s is None else int(np.searchsorted(self.time, start_s - slack))
        end = len(self) if stop_s is None else int(np.searchsorted(self.time, stop_s - slack))
        return self._derive(lib.ulna_record_select_rows, begin, end)

    def regularise(self, *, rate_hz: float = 0.0, progress: bool = False) -> Record:
        """Every trial on an even clock, band-limited; for time stamps that jitter.

        Parameters
        ----------
        rate_hz : float
            New rate; 0 keeps the record's.

        Examples
        --------
        >>> import numpy as np
        >>> import ulna
        >>> t = np.arange(1000) / 1000 + 1e-4 * np.sin(np.arange(1000))
        >>> log = ulna.Record.from_arrays(t, {"x": np.sin(t)})
        >>> even = log.regularise(rate_hz=1000)
        >>> bool(np.allclose(np.diff(even.time), 1e-3))
        True
        """
        out = ffi.new("ulna_record **")
        long_call(
            lib.ulna_record_regularise,
            self._handle.pointer,
            float(rate_hz),
            ffi.NULL,
            out,
            progress=progress,
            label="regularise",
        )
        return Record(_Record(out[0]))

    def _derive(self, function: Any, *args: Any) -> Record:
        return Record(_Record.make(function, self._handle.pointer, *args))

    # Out --------------------------------------------------------------------------------------

    def to_csv(self, path: str | os.PathLike[str], *, progress: bool = False) -> None:
        """Write a text table that `ulna.read` reads back to the same bits.

        A file of that name is replaced only by a whole one.

        Examples
        --------
        >>> import os, tempfile
        >>> import ulna
        >>> log = ulna.Record.from_arrays([0, 0.1], {"x": [0.1, 0.2]})
        >>> path = os.path.join(tempfile.mkdtemp(), "log.csv")
        >>> log.to_csv(path)
        >>> bool((ulna.read(path)["x"] == log["x"]).all())
        True
        """
        long_call(
            lib.ulna_record_write_csv,
            self._handle.pointer,
            encode(os.fspath(path), "path"),
            ffi.NULL,
            progress=progress,
            label="write",
        )

    def to_pandas(self) -> Any:
        """A `pandas.DataFrame` by time with one column a channel, and ``trial`` when there are several."""
        try:
            import pandas
        except ImportError as failure:
            raise ImportError("to_pandas needs pandas: install it with `pip install pandas`") from failure
        frame = pandas.DataFrame(
            np.array(self.values),
            columns=[channel.name for channel in self.channels],
            index=pandas.Index(np.array(self.time), name="time_s"),
        )
        if len(self.trials) > 1:
            number = np.full(len(self), -1)
            for index, trial in enumerate(self.trials):
                number[trial.begin : trial.end] = index
            frame.insert(0, "trial", number)
        return frame

    def plot(self, **keywords: Any) -> Any:
        """Draw the channels; see `ulna.plot.record`."""
        from . import plot

        return plot.record(self, **keywords)


class _Window:
    """Native memory as NumPy's array interface; NumPy keeps this object, and this the handle."""

    def __init__(self, handle: _Record, address: int, count: int) -> None:
        self.handle = handle
        self.__array_interface__ = {
            "version": 3,
            "shape": (count,),
            "typestr": np.dtype(np.float64).str,
            "data": (address, True),
        }


def from_columns(
    values: np.ndarray,
    headings: Sequence[str],
    *,
    rules: Sequence[Mapping[str, Any]] = (),
    time_column: str | None = None,
    time_unit: str | None = None,
    rate_hz: float = 0.0,
    name: str = "",
    progress: bool = False,
) -> Record:
    """Columns found by other means, through the same mapping and checks as a text table.

    Parameters
    ----------
    values : ndarray, shape (n, columns)
    headings : sequence of str
        Names with or without units, as ``"Fx [N]"``.
    rules : sequence of mapping
        As in a map's ``[[channel]]``, with ``source`` for ``column``.

    Examples
    --------
    >>> import numpy as np
    >>> from ulna.record import from_columns
    >>> from_columns(np.eye(2), ["t", "x [mm]"], rate_hz=10).channels[1].unit
    'm'
    """
    texts = [encode(heading, "headings") for heading in headings]
    struct = options(
        "ulna_read_options",
        rate_hz=float(rate_hz),
        time_column=time_column,
        time_unit=time_unit,
        name=name,
        rules=rule_array(rules) if rules else None,
        rule_count=len(rules),
    )
    out = ffi.new("ulna_record **")
    long_call(
        lib.ulna_record_from_columns,
        view(values),
        ffi.new("const char *[]", texts),
        len(texts),
        struct,
        ffi.NULL,
        out,
        progress=progress,
        label="read",
    )
    return Record(_Record(out[0]))


def join(records: Sequence[Record]) -> Record:
    """The trials of several records as one; channels and rates must agree.

    Examples
    --------
    >>> import ulna
    >>> from ulna.record import join
    >>> log = ulna.Record.from_arrays([0, 0.1], {"x": [1, 2]})
    >>> len(join([log, log]).trials)
    2
    """
    pointers = ffi.new("const ulna_record *[]", [record._handle.pointer for record in records])
    return Record(_Record.make(lib.ulna_record_join, pointers, len(records)))


def unit_factor(unit: str) -> tuple[str, float]:
    """The SI unit of a unit's text, and the factor to it.

    Examples
    --------
    >>> from ulna.record import unit_factor
    >>> unit_factor("kN")
    ('N', 1000.0)
    """
    factor = ffi.new("double *")
    si = text(lib.ulna_unit_parse, encode(unit, "unit"), factor)
    return si, factor[0]
