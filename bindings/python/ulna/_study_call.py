"""One call of a study's function, and what came of it: plain data that travels between processes."""

from __future__ import annotations

import hashlib
import pickle
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ._call import DataError
from ._study_indices import STATUSES
from .record import refuse

__all__ = ["RunFailed", "RunTable"]


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


class RunTable(NamedTuple):
    """What a vectorised function may return in place of an array: results with their statuses.

    Attributes
    ----------
    values : array_like, shape (runs, outputs)
    status : sequence of str
        "ok", "failed_init", "diverged", "limit", "timeout", "nonfinite".
    wall_s : array_like, optional
        Time of each run, s.
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


@dataclass(frozen=True)
class Call:
    """A function with the names of what it takes and gives."""

    function: Callable[..., Any]
    names: tuple[str, ...]
    outputs: tuple[str, ...]
    scalar: bool
    vectorized: bool

    def one(self, row: int, point: Sequence[float]) -> Outcome:
        """Run the function at a point."""
        start = time.perf_counter()
        lost = [float("nan")] * len(self.outputs)

        def outcome(status: str, values: list[float], *more: Any) -> Outcome:
            return Outcome(STATUSES.index(status), time.perf_counter() - start, values, *more)

        try:
            named = dict(zip(self.names, point, strict=True))
            out = self._numbers(self.function(**named), row)
        except RunFailed as failure:
            return outcome(failure.status, lost, str(failure))
        except Exception as failure:  # noqa: BLE001 - any error of a model is told, none is hidden
            return outcome("raised", lost, f"{type(failure).__name__}: {failure}", failure)
        if not np.isfinite(out).all():
            return outcome("nonfinite", out.tolist(), f"returned {out.tolist()}")
        return outcome("ok", out.tolist())

    def many(self, points: np.ndarray) -> list[Outcome]:
        """Run a vectorised function at rows of points."""
        start = time.perf_counter()
        out = self.function(**{name: points[:, k].copy() for k, name in enumerate(self.names)})
        table = out if isinstance(out, RunTable) else None
        if table is not None:
            out = table.values
        if isinstance(out, Mapping):
            out = np.column_stack([np.asarray(out[name], dtype=float) for name in self.outputs])
        out = np.asarray(out, dtype=float)
        shape = (len(points), len(self.outputs))
        if out.shape == shape[:1] and shape[1] == 1:
            out = out[:, None]
        if out.shape != shape:
            raise wrong(
                f"the function returned an array of shape {out.shape}; {shape[0]} runs with "
                f"{shape[1]} outputs need {shape}"
            )
        if table is not None:
            return self._of_table(table, out)
        wall = (time.perf_counter() - start) / len(points)
        good = np.isfinite(out).all(axis=1).tolist()
        lost = STATUSES.index("nonfinite")
        return [
            Outcome(0, wall, values) if fine else Outcome(lost, wall, values, f"returned {values}")
            for values, fine in zip(out.tolist(), good, strict=True)
        ]

    def _of_table(self, table: RunTable, values: np.ndarray) -> list[Outcome]:
        walls = np.full(len(values), np.nan) if table.wall_s is None else np.asarray(table.wall_s)
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
        numbers = np.atleast_1d(np.asarray(out, dtype=float))
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
