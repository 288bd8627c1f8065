"""Inputs and outputs of a system, from arrays or from the channels of a record."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .record import Record, refuse

Word = str | Sequence[str]


@dataclass(frozen=True)
class Ports:
    """Signals as columns with their names, and the runs that are never joined."""

    inputs: np.ndarray  # (rows, inputs)
    outputs: np.ndarray  # (rows, outputs)
    reference: np.ndarray | None
    rate_hz: float
    runs: np.ndarray | None  # (runs, 2)
    input_names: tuple[str, ...]
    output_names: tuple[str, ...]
    input_units: tuple[str, ...]
    output_units: tuple[str, ...]


def ports(
    u: Any,
    y: Any,
    rate_hz: float | None,
    runs: Any,
    *,
    input: Word | None,  # noqa: A002 - the word that a user knows
    output: Word | None,
    reference: Any = None,
) -> Ports:
    """What `u` and `y` (arrays), or a record and its channels' names, stand for."""
    if isinstance(u, Record):
        return _of_record(u, y, rate_hz, runs, input, output, reference)
    for name, word in (("input", input), ("output", output)):
        if word is not None:
            raise refuse(f"{name} names channels of a record, but arrays were given", name)
    if y is None:
        raise refuse("give the output y, or a record with the names of its channels", "y")
    if rate_hz is None:
        raise refuse("give rate_hz, the sample rate of the arrays", "rate_hz")
    inputs, outputs = _columns(u, "u"), _columns(y, "y")
    driving = None if reference is None else _columns(reference, "reference")
    for name, values in (("y", outputs), ("reference", driving)):
        if values is not None and len(values) != len(inputs):
            raise refuse(f"u has {len(inputs)} rows and {name} {len(values)}", name)
    return Ports(
        inputs,
        outputs,
        driving,
        float(rate_hz),
        _runs(runs),
        _numbered("u", inputs.shape[1]),
        _numbered("y", outputs.shape[1]),
        ("",) * inputs.shape[1],
        ("",) * outputs.shape[1],
    )


def _of_record(
    record: Record,
    y: Any,
    rate_hz: float | None,
    runs: Any,
    input: Word | None,  # noqa: A002
    output: Word | None,
    reference: Any,
) -> Ports:
    if y is not None or rate_hz is not None:
        raise refuse("a record brings its own output and rate: leave y and rate_hz out", "y")
    if input is None or output is None:
        names = ", ".join(c.name for c in record.channels)
        raise refuse(f"name the channels: input=..., output=...; there are {names}", "input")
    into, out = _find(record, input), _find(record, output)
    if runs is None:
        runs = [(s.begin, s.end) for s in record.segments]
    driving = None if reference is None else _find(record, reference)
    values = record.values
    channels = record.channels
    return Ports(
        np.array(values[:, into]),
        np.array(values[:, out]),
        None if driving is None else np.array(values[:, driving]),
        record.rate_hz,
        _runs(runs),
        tuple(channels[c].name for c in into),
        tuple(channels[c].name for c in out),
        tuple(channels[c].unit for c in into),
        tuple(channels[c].unit for c in out),
    )


def _find(record: Record, word: Word) -> list[int]:
    """One channel when the word is its name, else all that it stands for."""
    names = [c.name for c in record.channels]
    if isinstance(word, str) and word in names:
        return [names.index(word)]
    return list(record.resolve(word))


def _columns(values: Any, name: str) -> np.ndarray:
    array = np.asarray(values)
    if array.dtype.kind not in "fiub":
        raise refuse(f"{name} must hold real numbers, got {array.dtype}", name)
    if array.ndim not in (1, 2):
        raise refuse(f"{name} has {array.ndim} axes: one, or two with time first, are expected", name)
    return array.astype(float).reshape(len(array), -1)


def _numbered(letter: str, count: int) -> tuple[str, ...]:
    return (letter,) if count == 1 else tuple(f"{letter}{i}" for i in range(count))


def _runs(runs: Any) -> np.ndarray | None:
    if runs is None:
        return None
    pairs = np.asarray(runs)
    if pairs.ndim != 2 or pairs.shape[1] != 2 or not len(pairs) or pairs.dtype.kind not in "iu":
        raise refuse("runs must be pairs (begin, end) of row numbers", "runs")
    return np.ascontiguousarray(pairs, dtype=np.int64)
