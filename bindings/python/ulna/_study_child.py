"""Runs a model in a process of its own, so that what kills it costs one run.

A slot (a thread of a worker) keeps one child. The child gets the function once and loads it; a fork
of it gets the rows and answers row by row, so the row it did not answer is the one to blame. When it
dies, the next fork costs milliseconds: nothing is imported again.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import select
import signal
import struct
import subprocess
import sys
import threading
import time
import traceback
import weakref
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from ._call import DataError
from ._study_call import Call, Outcome, stop_at, tried, wrong
from ._study_indices import STATUSES
from ._study_journal import TRANSIENT

_START_S = 120.0  # to import the model
_SHORT_S = 0.002  # runs that are sent several at once
_CRASHED, _TIMEOUT = STATUSES.index("crashed"), STATUSES.index("timeout")
_SIZE = struct.Struct("<Q")
_DONE = 113  # exit status of a child that nobody asks any more


class Abandoned(Exception):  # noqa: N818 - the study ended meanwhile, nobody waits for the rows
    """The study that wanted these rows has ended."""


@dataclass(frozen=True)
class Job:
    """What a worker needs to know of a study."""

    data: bytes  # a packed Call
    digest: str
    study: str  # of one call of Study.run
    isolate: bool
    vectorized: bool
    outputs: int
    timeout_s: float | None
    retries: int
    path: tuple[str, ...]


Keeper = Callable[[int, Outcome], None]

_slots = threading.local()
_children: weakref.WeakSet[Child] = weakref.WeakSet()
_abandoned: set[str] = set()
_calls: dict[str, Call] = {}
# Of studies whose workers are threads of this process (by its id, which a fork has not): keeps each
# outcome at once, so that killing the study loses only the runs under way.
_keepers: dict[tuple[int, str], Keeper] = {}


def abandon(study: str) -> None:
    """End the children of a study whose threads are in this process."""
    _abandoned.add(study)
    for child in list(_children):
        if child.study == study:
            child.kill()


@contextlib.contextmanager
def kept_at_once(study: str, keep: Keeper) -> Iterator[None]:
    """Outcomes of a study's rows that threads of this process run go to `keep`."""
    _keepers[os.getpid(), study] = keep
    try:
        yield
    finally:
        del _keepers[os.getpid(), study]


def _keep(study: str, rows: Sequence[int], outcomes: Sequence[Outcome]) -> None:
    keep = _keepers.get((os.getpid(), study))
    if keep is not None:
        for row, outcome in zip(rows, outcomes, strict=True):
            keep(row, outcome)


def run_task(job: Job, rows: Sequence[int], points: Sequence[Sequence[float]]) -> list[Outcome]:
    """Outcomes of some rows, in their order; what a worker calls."""
    if not job.isolate:
        if job.digest not in _calls:
            _calls.clear()
            _see(job.path)
            _calls[job.digest] = pickle.loads(job.data)  # noqa: S301 - our own
        return _answer(job, _calls[job.digest], rows, points)
    child = getattr(_slots, "child", None)
    if child is None or child.job.digest != job.digest or child.job.path != job.path:
        if child is not None:
            child.kill()
        child = _slots.child = Child(job)
    child.job = job
    try:
        return child.run(list(rows), [list(point) for point in points])
    except BaseException:
        child.kill()  # it may have answers that nobody read
        child._stop()
        raise


def _answer(
    job: Job, call: Call, rows: Sequence[int], points: Sequence[Sequence[float]]
) -> list[Outcome]:
    if call.vectorized:
        try:
            out = [_sendable(outcome) for outcome in call.many(np.asarray(points, dtype=float))]
        except Exception as failure:
            stop_at(rows, failure)
        _keep(job.study, rows, out)
        return out
    out = []
    for row, point in zip(rows, points, strict=True):
        out.append(tried(partial(_one, job, call, row, point), job.retries))
        _keep(job.study, [row], out[-1:])
    return out


def _one(job: Job, call: Call, row: int, point: Sequence[float]) -> Outcome:
    if job.study in _abandoned:
        raise Abandoned
    return _sendable(call.one(row, point))


def _sendable(outcome: Outcome) -> Outcome:
    """An error that does not survive pickling travels as its words."""
    if outcome.error is None:
        return outcome
    words = "".join(traceback.format_exception(outcome.error)).rstrip()
    with contextlib.suppress(Exception):
        outcome.error.add_note(f"in a worker:\n{words}")
        pickle.loads(pickle.dumps(outcome.error))  # noqa: S301 - our own
        return outcome
    return outcome._replace(error=wrong(f"the function raised {outcome.message}\n{words}"))


class Child:
    """A child process and the pipes to it."""

    def __init__(self, job: Job) -> None:
        self.job = job
        self.process: subprocess.Popen[bytes] | None = None
        self.pace_s = float("inf")
        _children.add(self)

    @property
    def study(self) -> str:
        """The study it works for."""
        return self.job.study

    def run(self, rows: list[int], points: list[list[float]]) -> list[Outcome]:
        """Outcomes of rows; a row that kills or stalls the child is tried `retries` times more."""
        if self.job.vectorized:
            return self._arrays(rows, points)
        out: dict[int, Outcome] = {}
        tries = dict.fromkeys(range(len(rows)), 0)
        waiting = list(tries)
        while waiting:
            self._ready()
            # One row after the other, so that a study that is killed has begun no other; several at
            # once only when they are so short that the way to the child would matter.
            batch = waiting[: 64 if self.pace_s < _SHORT_S else 1]
            rest = waiting[len(batch) :]
            self._send([(rows[i], points[i]) for i in batch])
            for place, i in enumerate(batch):
                outcome, lost = self._outcome()
                self.pace_s = outcome.wall_s
                again = outcome.status in TRANSIENT and tries[i] < self.job.retries
                tries[i] += 1
                if not again:
                    out[i] = outcome
                    _keep(self.job.study, [rows[i]], [outcome])
                rest += [i] * again
                if lost:
                    rest = batch[place + 1 :] + rest
                    break
            waiting = rest
        return [out[i] for i in range(len(rows))]

    def _arrays(self, rows: list[int], points: list[list[float]], tries: int = 0) -> list[Outcome]:
        """Of an array nobody knows which element killed it: halves are tried, then their halves."""
        self._ready()
        self._send((rows, points))
        answer, lost = self._outcome(len(rows))
        if not lost:
            if isinstance(answer, Outcome):
                stop_at(rows, answer.error or wrong("the function failed"))
            _keep(self.job.study, rows, answer)
            return answer
        if len(rows) == 1:
            if tries < self.job.retries:
                return self._arrays(rows, points, tries + 1)
            _keep(self.job.study, rows, [answer])
            return [answer]
        half = len(rows) // 2
        return self._arrays(rows[:half], points[:half]) + self._arrays(rows[half:], points[half:])

    def _ready(self) -> None:
        if self.job.study in _abandoned:
            raise Abandoned
        if self.process is not None:
            return
        there, send = os.pipe()
        receive, back = os.pipe()
        # Paths of this process come first, as they would for the function itself.
        path = os.pathsep.join(entry or os.getcwd() for entry in sys.path)
        code = f"from ulna._study_child import serve; serve({there}, {back})"
        try:
            self.process = subprocess.Popen(
                [sys.executable, "-c", code],
                pass_fds=(there, back),
                stdin=subprocess.DEVNULL,
                env={**os.environ, "PYTHONPATH": path},
            )
        finally:
            os.close(there)
            os.close(back)
        self.send, self.receive = send, receive
        self.buffer = bytearray()
        self._end = weakref.finalize(self, _end, self.process, send, receive)
        self._send((self.job.data, self.job.path, os.getpid()))
        answer = self._read(_START_S)
        if answer != "ready":
            code_ = self._stop()
            if self.job.study in _abandoned:
                raise Abandoned
            why = answer or f"its process {_fate(code_)}"
            raise wrong(f"the function cannot be made in a child process: {why}")

    def _outcome(self, rows: int = 1) -> tuple[Any, bool]:
        """The next answer, and whether its run killed or stalled the child."""
        start = time.perf_counter()
        limit = self.job.timeout_s
        answer = self._read(None if limit is None else limit * rows)
        if isinstance(answer, int):  # the fork's end, told by the child
            status, words = _CRASHED, f"the process of the run {_fate(answer)}"
        elif answer == "late":
            status, words = _TIMEOUT, f"took longer than {limit:g} s"
            self.kill()
            self._stop()
        elif answer is None:
            status, words = _CRASHED, f"the process of the run {_fate(self._stop())}"
        else:
            return answer, False
        if self.job.study in _abandoned:
            raise Abandoned
        wall = time.perf_counter() - start
        return Outcome(status, wall, [float("nan")] * self.job.outputs, words), True

    def _send(self, message: Any) -> None:
        data = pickle.dumps(message)
        # A child that is gone shows when its answer is read.
        with contextlib.suppress(BrokenPipeError):
            _write(self.send, _SIZE.pack(len(data)) + data)

    def _read(self, limit_s: float | None) -> Any:
        """A message; "late" when none came in time, None when the child is gone."""
        until = None if limit_s is None else time.monotonic() + limit_s
        while True:
            if len(self.buffer) >= _SIZE.size:
                end = _SIZE.size + _SIZE.unpack_from(self.buffer)[0]
                if len(self.buffer) >= end:
                    data = bytes(self.buffer[_SIZE.size : end])
                    del self.buffer[:end]  # what follows is the next message
                    return pickle.loads(data)  # noqa: S301 - of our own child
            left = None if until is None else max(0.0, until - time.monotonic())
            if not select.select([self.receive], [], [], left)[0]:
                return "late"
            part = os.read(self.receive, 1 << 16)
            if not part:
                return None
            self.buffer += part

    def _stop(self) -> int:
        """End the child; its exit status."""
        process, self.process = self.process, None
        if process is None:
            return 0
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(1.0)  # one that closed its pipe is about to end; its own status is told
        self._end()
        return int(process.returncode)

    def kill(self) -> None:
        """End the child at once; the thread that waits for it sees that."""
        process = self.process
        if process is not None:
            with contextlib.suppress(ProcessLookupError):
                process.kill()


def _end(process: subprocess.Popen[bytes], *pipes: int) -> None:
    with contextlib.suppress(ProcessLookupError):
        process.kill()
    process.wait()
    for pipe in pipes:
        os.close(pipe)


def _fate(status: int) -> str:
    if status < 0:
        with contextlib.suppress(ValueError):
            return f"died of {signal.Signals(-status).name}"
        return f"died of signal {-status}"
    return f"ended itself with exit status {status}"


def _write(pipe: int, data: bytes) -> None:
    view = memoryview(data)
    while view:
        view = view[os.write(pipe, view) :]


def _see(path: Sequence[str]) -> None:
    """Modules that the study could import can be imported here, after one's own."""
    sys.path.extend(entry for entry in path if entry not in sys.path)


# In the child --------------------------------------------------------------------------------------


def serve(there: int, back: int) -> None:
    """Answer rows until nobody asks any more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the study's; it ends its children

    def read() -> Any:
        head = _take(there, _SIZE.size)
        return pickle.loads(_take(there, _SIZE.unpack(head)[0]))  # noqa: S301 - of our own parent

    def say(message: Any) -> None:
        data = pickle.dumps(message)
        try:
            _write(back, _SIZE.pack(len(data)) + data)
        except BrokenPipeError:
            os._exit(_DONE)  # nobody asks any more

    data, path, parent = read()
    _die_with(parent)
    try:
        _see(path)
        call: Call = pickle.loads(data)  # noqa: S301
        if prepare := getattr(call.function, "prepare", None):
            prepare()
    except BaseException as failure:  # noqa: BLE001 - told to the parent
        say(f"{type(failure).__name__}: {failure}")
        return
    say("ready")
    # Threads that the import started would be missing in a fork.
    while threading.active_count() == 1:
        me = os.getpid()
        fork = os.fork()
        if fork == 0:
            _die_with(me)
            break
        status = os.waitstatus_to_exitcode(os.waitpid(fork, 0)[1])
        if status == -signal.SIGKILL or status == _DONE:
            # Killed from outside, perhaps amid a word: the pipe is not to be trusted any more.
            os.kill(me, signal.SIGKILL) if status != _DONE else os._exit(0)
        say(status)
    while True:
        message = read()
        if call.vectorized:
            rows, points = message
            try:
                answer: Any = [_sendable(one) for one in call.many(np.asarray(points, dtype=float))]
            except Exception as failure:  # noqa: BLE001 - told to the parent
                answer = _sendable(Outcome(STATUSES.index("raised"), 0.0, [], "", failure))
            say(answer)
            continue
        for row, point in message:
            say(_sendable(call.one(row, point)))


def _take(pipe: int, size: int) -> bytes:
    """So many bytes; the process ends when nobody writes any more."""
    data = b""
    while len(data) < size:
        part = os.read(pipe, size - len(data))
        if not part:
            os._exit(_DONE)
        data += part
    return data


def _die_with(parent: int) -> None:
    """A child whose worker is killed must not go on alone (Linux: PR_SET_PDEATHSIG)."""
    with contextlib.suppress(Exception):
        import ctypes

        ctypes.CDLL(None).prctl(1, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(0)


def infrastructure(failure: BaseException) -> bool:
    """Whether an executor lost a worker, which says nothing about the function."""
    names = {kind.__name__ for kind in type(failure).__mro__}
    return bool(names & {"KilledWorker", "CommClosedError", "LostWorker"}) and not isinstance(
        failure, DataError
    )
