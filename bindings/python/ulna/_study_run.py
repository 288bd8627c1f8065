"""Runs a Python function at every row of a design."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from ._call import DataError
from ._study_design import StudyDesign
from ._study_indices import STATUSES
from ._study_journal import TRANSIENT, StudyJournal
from .record import refuse

__all__ = ["RunFailed"]

_ROWS_AT_ONCE = 4096  # that a vectorised function gets


class RunFailed(Exception):  # noqa: N818 - said by a model, not a defect of a call
    """Raised by a function to say that this run has no result.

    Parameters
    ----------
    status : str
        "failed_init", "diverged", "limit", "timeout", "nonfinite".
    message : str
    """

    def __init__(self, status: str, message: str = "") -> None:
        if status not in STATUSES[1:]:
            raise refuse(
                f"status is {status!r}; it must be one of {', '.join(map(repr, STATUSES[1:]))}",
                "status",
            )
        super().__init__(message or status)
        self.status = status

    def __reduce__(self) -> Any:
        return RunFailed, (self.status, str(self))


def _named(values: Mapping[str, float]) -> str:
    return ", ".join(f"{name} = {value:.6g}" for name, value in values.items())


def _wrong(message: str, row: int | None = None) -> DataError:
    return DataError(
        message,
        status="ULNA_ERROR_DATA",
        argument="function",
        detail="" if row is None else f"row {row}",
    )


class Runner:
    """Fills the arrays of a study's runs, from the journal where it knows them."""

    def __init__(
        self,
        function: Callable[..., Any],
        design: StudyDesign,
        outputs: Sequence[str],
        *,
        scalar: bool,
        vectorized: bool,
        on_failure: str,
        journal: StudyJournal | None,
    ) -> None:
        self.function = function
        self.design = design
        self.outputs = tuple(outputs)
        self.scalar = scalar
        self.vectorized = vectorized
        self.stop = on_failure == "error"
        self.journal = journal
        self.names = design.function_factors
        self.y = np.full((design.rows, len(self.outputs)), np.nan)
        self.status = np.zeros(design.rows, dtype=np.int32)
        self.wall_s = np.full(design.rows, np.nan)
        self.messages: dict[int, str] = {}
        self.missing = np.ones(design.rows, dtype=bool)
        if journal is not None:
            self._take_journal(journal)

    def _take_journal(self, journal: StudyJournal) -> None:
        known = journal.status
        done = (known >= 0) & ~np.isin(known, TRANSIENT)
        self.status[done] = known[done]
        self.wall_s[done] = journal.wall_s[done]
        self.y[done] = journal.values[done]
        for row in np.flatnonzero(done & (known != 0)):
            self.messages[int(row)] = journal.message(int(row))
        self.missing = ~done
        lost = np.flatnonzero(done & (known != 0))
        if lost.size and self.stop:
            self._stop(int(lost[0]), None)

    def run(self, progress: bool) -> None:
        """All rows that have no result yet."""
        size = _ROWS_AT_ONCE if self.vectorized else 256
        with _bar(progress, self.design.rows) as update:
            for first in range(0, self.design.rows, size):
                count = min(size, self.design.rows - first)
                rows = first + np.flatnonzero(self.missing[first : first + count])
                update(count - rows.size)
                if not rows.size:
                    continue
                values = self.design.values(first=first, count=count)[rows - first]
                values = values[:, : len(self.names)]
                if self.vectorized:
                    self._run_array(rows, values)
                    update(rows.size)
                    continue
                for row, point in zip(rows.tolist(), values.tolist(), strict=True):
                    self._run_row(row, dict(zip(self.names, point, strict=True)))
                    update(1)

    def _run_row(self, row: int, named: dict[str, float]) -> None:
        start = time.perf_counter()
        cause: Exception | None = None
        status, message = 0, ""
        out = np.full(len(self.outputs), np.nan)
        try:
            out = self._numbers(self.function(**named), row)
        except RunFailed as failure:
            status, message, cause = STATUSES.index(failure.status), str(failure), failure
        except Exception as failure:
            if self.stop:
                # Not a result: the function is to be repaired, and the row run again.
                failure.add_note(f"in run {row} of the study, at {_named(named)}")
                raise
            status, message = STATUSES.index("raised"), f"{type(failure).__name__}: {failure}"
        else:
            if not np.isfinite(out).all():
                status, message = STATUSES.index("nonfinite"), f"returned {out.tolist()}"
        self._keep(row, status, time.perf_counter() - start, out, message)
        if status and self.stop:
            self._stop(row, cause)

    def _run_array(self, rows: np.ndarray, values: np.ndarray) -> None:
        start = time.perf_counter()
        named = {name: values[:, k].copy() for k, name in enumerate(self.names)}
        out = self.function(**named)
        if isinstance(out, Mapping):
            out = np.column_stack([np.asarray(out[name], dtype=float) for name in self.outputs])
        out = np.asarray(out, dtype=float)
        shape = (len(values), len(self.outputs))
        if out.shape == shape[:1] and shape[1] == 1:
            out = out[:, None]
        if out.shape != shape:
            raise _wrong(
                f"the function returned an array of shape {out.shape}; {shape[0]} runs with "
                f"{shape[1]} outputs need {shape}"
            )
        wall = (time.perf_counter() - start) / len(values)
        lost = ~np.isfinite(out).all(axis=1)
        self.y[rows], self.wall_s[rows], self.missing[rows] = out, wall, False
        self.status[rows[lost]] = STATUSES.index("nonfinite")
        for i in np.flatnonzero(lost):
            self.messages[int(rows[i])] = f"returned {out[i].tolist()}"
        if self.journal is not None:
            for row in rows.tolist():
                self.journal.append(
                    row,
                    int(self.status[row]),
                    wall,
                    self.y[row],
                    self.messages.get(row, ""),
                )
        if lost.any() and self.stop:
            self._stop(int(rows[lost][0]), None)

    def _keep(self, row: int, status: int, wall_s: float, out: np.ndarray, message: str) -> None:
        self.y[row] = out
        self.status[row] = status
        self.wall_s[row] = wall_s
        self.missing[row] = False
        if status:
            self.messages[row] = message
        if self.journal is not None:
            self.journal.append(row, status, wall_s, out, message)

    def _stop(self, row: int, cause: Exception | None) -> None:
        point = self.design.values(first=row, count=1)[0].tolist()
        where = _named(dict(zip(self.names, point, strict=False)))
        raise _wrong(
            f"run {row} failed ({STATUSES[self.status[row]]}: {self.messages[row]}) at {where}; "
            "choose on_failure 'drop_block', 'nearest' or 'surface' to go on",
            row,
        ) from cause

    def _numbers(self, out: Any, row: int) -> np.ndarray:
        if isinstance(out, Mapping):
            missing = [name for name in self.outputs if name not in out]
            if missing:
                raise _wrong(f"the function's result has no output {missing[0]!r}", row)
            out = [out[name] for name in self.outputs]
        numbers = np.atleast_1d(np.asarray(out, dtype=float))
        if numbers.shape != (len(self.outputs),):
            wanted = "a number" if self.scalar else f"{len(self.outputs)} numbers"
            raise _wrong(f"the function returned {out!r}, {wanted} expected", row)
        return numbers


@contextlib.contextmanager
def _bar(progress: bool, total: int) -> Iterator[Callable[[int], None]]:
    if not progress:
        yield lambda count: None
        return
    try:
        from tqdm.auto import tqdm
    except ImportError as failure:
        raise ImportError(
            "a progress bar needs tqdm: install it with `pip install ulna[progress]`"
        ) from failure
    with tqdm(total=total, unit="run", leave=False) as bar:
        yield bar.update
