"""Hands the rows of a study to an executor, in tasks of a few seconds."""

from __future__ import annotations

import contextlib
import os
import sys
import threading
import uuid
from collections import Counter, deque
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from ._study_call import Outcome, pack, wrong
from ._study_child import Job, abandon, infrastructure, kept_at_once, run_task
from ._study_indices import STATUSES
from ._study_run import Runner
from .record import refuse

_LARGEST = 4096  # rows of a task
_LOST_WORKERS = 5  # that a row survives before it is blamed


@contextlib.contextmanager
def executor_of(given: Any, workers: int) -> Iterator[tuple[Executor, int]]:
    """The executor and its slots."""
    if given is None:
        with ThreadPoolExecutor(workers) as pool:
            yield pool, workers
        return
    if isinstance(given, Executor):
        yield given, workers if workers > 1 else _slots(given)
        return
    # A Dask client makes an executor itself; no retries of its own, a lost row is asked for again.
    make = getattr(given, "get_executor", None)
    if make is None:
        raise refuse(
            f"executor must be one of concurrent.futures, or a Dask client, got {given!r}",
            "executor",
        )
    pool = make(pure=False, retries=0)
    try:
        yield pool, workers if workers > 1 else max(1, sum(given.nthreads().values()))
    finally:
        pool.shutdown(wait=False)


def _slots(executor: Any) -> int:
    client = getattr(executor, "_client", None)  # of Dask
    if client is not None:
        return max(1, sum(client.nthreads().values()))
    for name in ("_max_workers", "num_workers"):
        count = getattr(executor, name, None)
        if isinstance(count, int) and count > 0:
            return count
    return os.cpu_count() or 1


class Farm:
    """One study on one executor."""

    def __init__(
        self,
        runner: Runner,
        *,
        isolate: bool,
        timeout_s: float | None,
        retries: int,
        task_s: float,
    ) -> None:
        self.runner = runner
        data, digest = pack(runner.call)
        self.job = Job(
            data=data,
            digest=digest,
            study=uuid.uuid4().hex,
            isolate=isolate,
            vectorized=runner.call.vectorized,
            outputs=len(runner.outputs),
            timeout_s=timeout_s,
            retries=retries,
            path=tuple(entry or os.getcwd() for entry in sys.path),
        )
        self.retries = retries
        self.task_s = task_s
        self.lost: Counter[int] = Counter()
        self.wall_s = 0.0
        self.known = 0
        self.again: deque[np.ndarray] = deque()
        self.lock = threading.Lock()
        self.at_once = False

    def run(self, given: Any, workers: int) -> None:
        """All rows that have no result yet."""
        rows = self.runner.wanted()
        at = 0
        running: dict[Future[list[Outcome]], np.ndarray] = {}
        with contextlib.ExitStack() as stack:
            executor, slots = stack.enter_context(executor_of(given, workers))
            self.at_once = isinstance(executor, ThreadPoolExecutor)
            if self.at_once:
                stack.enter_context(kept_at_once(self.job.study, self._keep))
            try:
                while True:
                    # Two tasks a slot: none waits for its next one.
                    while len(running) < 2 * slots and not self.runner.over():
                        if self.again:
                            part = self.again.popleft()
                        elif at < rows.size:
                            part = rows[at : at + self._size(rows.size - at, slots)]
                            at += part.size
                        else:
                            break
                        running[self._submit(executor, part)] = part
                    if not running:
                        break
                    done, _ = wait(running, timeout=0.5, return_when=FIRST_COMPLETED)
                    for future in done:
                        self._take(future, running.pop(future))
                    self.runner.tick()
            except BaseException:
                for future in running:
                    future.cancel()
                # Threads of this process wait for children: those end now. Elsewhere a task that
                # runs ends by itself.
                abandon(self.job.study)
                raise

    def _size(self, left: int, slots: int) -> int:
        if self.known == 0:
            return 1
        each = max(self.wall_s / self.known, 1e-4)
        # Towards the end tasks are short, so that all slots end together.
        return max(1, min(int(self.task_s / each), -(-left // (2 * slots)), _LARGEST))

    def _submit(self, executor: Executor, rows: np.ndarray) -> Future[list[Outcome]]:
        points = self.runner.points(rows)
        try:
            return executor.submit(run_task, self.job, rows.tolist(), points.tolist())
        except BrokenExecutor as failure:
            raise self._broken(failure) from failure

    def _broken(self, failure: BaseException) -> Exception:
        return wrong(
            f"the executor broke ({failure}): leave isolate on, so that a run that dies does not "
            "take its worker along"
        )

    def _take(self, future: Future[list[Outcome]], rows: np.ndarray) -> None:
        try:
            outcomes = future.result()
        except BrokenExecutor as failure:
            raise self._broken(failure) from failure
        except Exception as failure:
            if not infrastructure(failure):
                raise
            self._worker_lost(rows, failure)
            return
        for row, outcome in zip(rows.tolist(), outcomes, strict=True):
            if np.isfinite(outcome.wall_s):  # a function may not know it
                self.wall_s += outcome.wall_s
            self.known += 1
            if not self.at_once:
                self.runner.take(row, outcome)

    def _keep(self, row: int, outcome: Outcome) -> None:
        with self.lock:
            self.runner.take(row, outcome)

    def _worker_lost(self, rows: np.ndarray, failure: Exception) -> None:
        """Smaller and smaller tasks are asked for again, until one row is to blame."""
        self.lost.update(rows.tolist())
        if rows.size > 1:
            self.again.extend(np.array_split(rows, 2))
        elif self.lost[int(rows[0])] <= _LOST_WORKERS:
            self.again.append(rows)
        else:
            words = f"its workers died {self.lost[int(rows[0])]} times ({type(failure).__name__})"
            nothing = [float("nan")] * len(self.runner.outputs)
            crashed = Outcome(STATUSES.index("crashed"), float("nan"), nothing, words)
            self.runner.take(int(rows[0]), crashed)
