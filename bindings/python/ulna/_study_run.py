"""Runs a function at every row of a design: what is known, what is wanted, what came of it."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from ._study_call import GO_ON, Call, Outcome, stop_at, tried, wrong
from ._study_design import StudyDesign
from ._study_indices import STATUSES
from ._study_journal import TRANSIENT, StudyJournal
from ._study_progress import Meter

_ROWS_AT_ONCE = 4096  # that a vectorised function gets
NOT_RUN = -1


def named(values: Mapping[str, float]) -> str:
    """A point in words."""
    return ", ".join(f"{name} = {value:.6g}" for name, value in values.items())


class Runner:
    """Fills the arrays of a study's runs, from the journal where it knows them.

    `rows` are those that this process is to run (a shard); None for all. After `budget_s` no run
    is begun any more. Runs of the journal whose cause may be the machine are run `again`; without
    it they count as failed.
    """

    def __init__(
        self,
        call: Call,
        design: StudyDesign,
        *,
        on_failure: str,
        journal: StudyJournal | None,
        rows: np.ndarray | None = None,
        budget_s: float | None = None,
        again: bool = True,
        retries: int = 0,
    ) -> None:
        self.stop = on_failure == "error"
        # Of an array that raises, rows are told apart where the study goes on without them.
        self.call = replace(call, narrow=not self.stop, retries=retries)
        self.design = design
        self.outputs = call.outputs
        self.journal = journal
        self.names = design.function_factors
        self.y = np.full((design.rows, len(self.outputs)), np.nan)
        self.status = np.full(design.rows, NOT_RUN, dtype=np.int32)
        self.wall_s = np.full(design.rows, np.nan)
        self.messages: dict[int, str] = {}
        self.rows = rows
        self.until = None if budget_s is None else time.monotonic() + budget_s
        self.meter: Meter | None = None
        if journal is not None:
            self._take_journal(journal, again)

    def _take_journal(self, journal: StudyJournal, again: bool) -> None:
        known = journal.status
        passing = np.isin(known, TRANSIENT)
        done = known >= 0
        if again:
            done &= ~(passing & self._own())
        self.status[done] = known[done]
        self.wall_s[done] = journal.wall_s[done]
        self.y[done] = journal.values[done]
        lost = done & (known != 0)
        for row in np.flatnonzero(lost):
            self.messages[int(row)] = journal.message(int(row))
        final = np.flatnonzero(lost & ~passing)
        if final.size and self.stop:
            self._stop(int(final[0]), None)

    def _own(self) -> np.ndarray:
        """Whether a row is one of those that this process is to run."""
        own = np.full(self.design.rows, self.rows is None)
        if self.rows is not None:
            own[self.rows] = True
        return own

    def wanted(self) -> np.ndarray:
        """Rows without a result, in their order."""
        return np.flatnonzero((self.status == NOT_RUN) & self._own())

    def over(self) -> bool:
        """Whether the time is up."""
        return self.until is not None and time.monotonic() > self.until

    def points(self, rows: np.ndarray) -> np.ndarray:
        """Values of the function's factors at rows."""
        first, last = int(rows[0]), int(rows[-1])
        values = self.design.values(first=first, count=last - first + 1)[rows - first]
        return values[:, : len(self.names)]

    def run(self) -> None:
        """All wanted rows, here and one after the other."""
        rows = self.wanted()
        size = 256
        if self.call.vectorized:
            # A slow function asks for less at once: what a kill loses is what is under way.
            size = int(getattr(self.call.function, "rows_at_once", _ROWS_AT_ONCE))
        for at in range(0, rows.size, size):
            part = rows[at : at + size]
            points = self.points(part)
            if self.call.vectorized:
                if self.over():
                    return
                try:
                    outcomes = self.call.many(points)
                except Exception as failure:
                    stop_at(part.tolist(), failure)
                for row, outcome in zip(part.tolist(), outcomes, strict=True):
                    self.take(row, outcome)
                self.tick()
                continue
            for row, point in zip(part.tolist(), points.tolist(), strict=True):
                if self.over():
                    return
                self.take(row, tried(partial(self.call.one, row, point), self.call.retries))
                self.tick()

    def tick(self) -> None:
        """Tell how far it is."""
        if self.meter is not None:
            self.meter.tick()

    def take(self, row: int, outcome: Outcome) -> None:
        """Keep a result, and stop at a failed one where that was asked for."""
        if self.stop and outcome.error is not None:
            # Not a result: the function is to be repaired, and the row run again.
            point = dict(zip(self.names, self.points(np.array([row]))[0].tolist(), strict=True))
            outcome.error.add_note(f"in run {row} of the study, at {named(point)}")
            raise outcome.error
        self.y[row] = outcome.values
        self.status[row] = outcome.status
        self.wall_s[row] = outcome.wall_s
        if outcome.status:
            self.messages[row] = outcome.message
        if self.journal is not None:
            self.journal.append(
                row, outcome.status, outcome.wall_s, self.y[row], outcome.message
            )
        if outcome.status and self.stop:
            self._stop(row, None)

    def _stop(self, row: int, cause: Exception | None) -> None:
        point = self.points(np.array([row]))[0].tolist()
        where = named(dict(zip(self.names, point, strict=False)))
        raise wrong(
            f"run {row} failed ({STATUSES[self.status[row]]}: {self.messages[row]}) at {where}; "
            f"{GO_ON}",
            row,
        ) from cause
