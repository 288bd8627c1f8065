"""One call of a study's function, and what came of it: plain data that travels between processes."""

from __future__ import annotations

import hashlib
import pickle
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, NoReturn

import numpy as np

from ._call import DataError
from ._study_indices import STATUSES
from ._study_journal import TRANSIENT
from .record import refuse

__all__ = ["RunFailed", "RunTable"]

GO_ON = "choose on_failure 'drop_block', 'nearest' or 'surface' to go on"
_COMPLEX = "returned a complex number, a real one expected"


class RunFailed(Exception):  # noqa: N818 - said by a model, not a defect of a call
    """Raised by a function to say that this run has no result.

    Parameters
    ----------
    status : str
        "failed_init", "diverged", "limit", "timeout", "nonfinite", "raised" or "crashed". A run that
        timed out or crashed is tried again (`retries`), as the machine may be the cause; the others
        are final.
    message : str
        Why, in words; the status when there are none.
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


class RunTable(NamedTuple):
    """What a vectorised function may return in place of an array: results with their statuses.

    Attributes
    ----------
    values : array_like, shape (runs, outputs)
    status : sequence of str
        "ok", or what `RunFailed` takes.
    wall_s : array_like, optional
        Time of each run, s; their mean when it is not given.
    messages : dict of int to str
        Why runs have no result, by their place.
    """

    values: Any
    status: Sequence[str]
    wall_s: Any = None
    messages: Mapping[int, str] = {}


class Outcome(NamedTuple):
    """Of one run."""

    status: int
    wall_s: float
    values: list[float]
    message: str = ""
    error: Exception | None = None  # what the function raised, when it was no RunFailed


def wrong(message: str, row: int | None = None) -> DataError:
    """The function gave something that is no result."""
    return DataError(
        message,
        status="ULNA_ERROR_DATA",
        argument="function",
        detail="" if row is None else f"row {row}",
    )


def exit_words(stop: SystemExit) -> str:
    """What a model did that ended the program it thought it was."""
    # Not `stop.code`, which an exception that came from another process may have lost.
    return f"called sys.exit({', '.join(map(repr, stop.args))})"


def stop_at(rows: Sequence[int], failure: Exception) -> NoReturn:
    """End the study with an error of a vectorised function, and the rows that it was given."""
    where = f"runs {rows[0]} to {rows[-1]}" if len(rows) > 1 else f"run {rows[0]}"
    if isinstance(failure, RunFailed):
        raise wrong(f"{where} failed ({failure.status}: {failure}); {GO_ON}", rows[0]) from failure
    failure.add_note(f"in {where} of the study")
    raise failure


def tried(run: Callable[[], Outcome], retries: int) -> Outcome:
    """The outcome of a run; one whose cause may be the machine is tried `retries` times more."""
    outcome = run()
    for _ in range(retries):
        if outcome.status not in TRANSIENT:
            break
        outcome = run()
    return outcome


def _real(values: Any) -> tuple[np.ndarray, np.ndarray]:
    """Values as real numbers, and whether something of each would be lost by that."""
    given = np.asarray(values)
    if np.iscomplexobj(given):
        return given.real.astype(float), given.imag != 0
    return np.asarray(given, dtype=float), np.zeros(given.shape, dtype=bool)


@dataclass(frozen=True)
class Call:
    """A function with the names of what it takes and gives.

    Of a vectorised function `narrow` finds the rows at which it raises; without it all of them are
    lost, and its error is raised.
    """

    function: Callable[..., Any]
    names: tuple[str, ...]
    outputs: tuple[str, ...]
    scalar: bool
    vectorized: bool
    narrow: bool = False
    retries: int = 0

    def one(self, row: int, point: Sequence[float]) -> Outcome:
        """Run the function at a point."""
        start = time.perf_counter()
        try:
            named = dict(zip(self.names, point, strict=True))
            out = self._numbers(self.function(**named), row)
        except (Exception, SystemExit) as failure:  # noqa: BLE001 - told, not hidden
            return self._lost(failure, start, row)
        wall = time.perf_counter() - start
        if not np.isfinite(out).all():
            words = f"returned {out.tolist()}"
            return Outcome(STATUSES.index("nonfinite"), wall, out.tolist(), words)
        return Outcome(0, wall, out.tolist())

    def _lost(self, failure: BaseException, start: float, row: int | None = None) -> Outcome:
        """Of a run that the function ended itself."""
        wall, nothing = time.perf_counter() - start, [float("nan")] * len(self.outputs)
        if isinstance(failure, RunFailed):
            return Outcome(STATUSES.index(failure.status), wall, nothing, str(failure))
        words = f"{type(failure).__name__}: {failure}"
        if isinstance(failure, SystemExit):
            words = exit_words(failure)
            failure = wrong(f"the function {words}", row)
        assert isinstance(failure, Exception)
        return Outcome(STATUSES.index("raised"), wall, nothing, words, failure)

    def many(self, points: np.ndarray) -> list[Outcome]:
        """Run a vectorised function at rows of points."""
        out = self._halves(points)
        for _ in range(self.retries):
            again = [i for i, outcome in enumerate(out) if outcome.status in TRANSIENT]
            if not again:
                break
            for i, outcome in zip(again, self._halves(points[again]), strict=True):
                out[i] = outcome
        return out

    def _halves(self, points: np.ndarray) -> list[Outcome]:
        """Nobody knows at which element it raised: halves are tried, then their halves."""
        start = time.perf_counter()
        try:
            out = self.function(**{name: points[:, k].copy() for k, name in enumerate(self.names)})
        except (Exception, SystemExit) as failure:
            if not self.narrow and isinstance(failure, SystemExit):
                raise wrong(f"the function {exit_words(failure)}") from failure
            if not self.narrow:
                raise
            if len(points) == 1:
                return [self._lost(failure, start)]
        else:
            return self._results(points, out, start)
        half = len(points) // 2
        return self._halves(points[:half]) + self._halves(points[half:])

    def _results(self, points: np.ndarray, out: Any, start: float) -> list[Outcome]:
        table = out if isinstance(out, RunTable) else None
        if table is not None:
            out = table.values
        if isinstance(out, Mapping):
            out = np.column_stack([np.asarray(out[name]) for name in self.outputs])
        out, cut = _real(out)
        shape = (len(points), len(self.outputs))
        if out.shape == shape[:1] and shape[1] == 1:
            out, cut = out[:, None], cut[:, None]
        if out.shape != shape:
            raise wrong(
                f"the function returned an array of shape {out.shape}; {shape[0]} runs with "
                f"{shape[1]} outputs need {shape}"
            )
        wall = (time.perf_counter() - start) / len(points)
        if table is not None:
            if cut.any():
                raise wrong("a RunTable has complex values, its runs need real ones")
            return self._of_table(table, out, wall)
        if cut.any():
            out[cut.any(axis=1)] = np.nan
        good = np.isfinite(out).all(axis=1).tolist()
        lost = STATUSES.index("nonfinite")
        found = [
            Outcome(0, wall, values) if fine else Outcome(lost, wall, values, f"returned {values}")
            for values, fine in zip(out.tolist(), good, strict=True)
        ]
        for i in np.flatnonzero(cut.any(axis=1)):
            found[i] = Outcome(STATUSES.index("raised"), wall, out[i].tolist(), _COMPLEX)
        return found

    def _of_table(self, table: RunTable, values: np.ndarray, mean_s: float) -> list[Outcome]:
        walls = np.full(len(values), mean_s) if table.wall_s is None else np.asarray(table.wall_s)
        if len(table.status) != len(values) or len(walls) != len(values):
            raise wrong(f"a RunTable of {len(values)} runs needs as many statuses and times")
        outcomes = []
        for i, (status, wall, row) in enumerate(zip(table.status, walls, values, strict=True)):
            if status not in STATUSES:
                raise wrong(f"a RunTable has the status {status!r}; it must be one of {STATUSES}")
            if status == "ok" and not np.isfinite(row).all():
                status = "nonfinite"  # noqa: PLW2901 - a result that is none
            message = "" if status == "ok" else table.messages.get(i, status)
            lost = row if status == "ok" else np.full(len(row), np.nan)
            outcomes.append(Outcome(STATUSES.index(status), float(wall), lost.tolist(), message))
        return outcomes

    def _numbers(self, out: Any, row: int) -> np.ndarray:
        if isinstance(out, Mapping):
            missing = [name for name in self.outputs if name not in out]
            if missing:
                raise wrong(f"the function's result has no output {missing[0]!r}", row)
            out = [out[name] for name in self.outputs]
        real, cut = _real(out)
        numbers = np.atleast_1d(real)
        if cut.any():
            raise wrong(f"the function {_COMPLEX}: {out!r}", row)
        if numbers.shape != (len(self.outputs),):
            wanted = "a number" if self.scalar else f"{len(self.outputs)} numbers"
            raise wrong(f"the function returned {out!r}, {wanted} expected", row)
        return numbers


def pack(call: Call) -> tuple[bytes, str]:
    """A call as bytes that another process can read, and their digest.

    What is defined in a script, a notebook or another function has no name to be found by
    elsewhere; cloudpickle sends its code.
    """
    try:
        import cloudpickle
    except ImportError:
        cloudpickle = None
    try:
        data = (cloudpickle or pickle).dumps(call)
        if cloudpickle is None and b"__main__" in data:
            raise AttributeError("it is defined in a script")
    except Exception as failure:
        how = (
            "give it what can be pickled"
            if cloudpickle
            else "put it into a module, or `pip install ulna[dask]`, which brings cloudpickle"
        )
        raise refuse(
            f"the function cannot be sent to another process ({failure}): {how}", "function"
        ) from failure
    return data, hashlib.sha256(data).hexdigest()
