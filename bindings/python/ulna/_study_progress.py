"""How far a study is, how long it still takes, and what it says so far."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ._call import Error
from ._study_indices import analyse

if TYPE_CHECKING:
    from ._study_run import Runner

__all__ = ["StudyProgress"]


@dataclass(frozen=True)
class StudyProgress:
    """State of a study that runs.

    Attributes
    ----------
    done, rows : int
        Runs with a result, and all runs that this process is to have.
    failed : int
        Of those done.
    elapsed_s, left_s : float
        Since the start, and what is left at the pace so far (NaN before the first result).
    indices : dict of str to float
        Total-order indices or mu* of the first output, from the blocks that are complete; empty
        before there are two.
    """

    done: int
    rows: int
    failed: int
    elapsed_s: float
    left_s: float
    indices: Mapping[str, float] = field(default_factory=dict)

    def line(self) -> str:
        """All of it in one line."""
        left = "" if np.isnan(self.left_s) else f", {_duration(self.left_s)} left"
        lost = f", {self.failed} failed" if self.failed else ""
        text = f"{self.done} of {self.rows} runs{lost}{left}"
        if self.indices:
            text += "; so far " + self._leading()
        return text

    def _leading(self, count: int = 4) -> str:
        order = sorted(self.indices, key=lambda name: -self.indices[name])
        return ", ".join(f"{name} {self.indices[name]:.2g}" for name in order[:count])


def _duration(seconds: float) -> str:
    whole = round(seconds)
    if whole < 100:
        return f"{whole} s"
    if whole < 6000:
        return f"{round(whole / 60)} min"
    return f"{whole / 3600:.1f} h"


class Meter:
    """Watches a runner; looks at most every `every_s`."""

    def __init__(
        self, runner: Runner, progress: bool | Callable[[StudyProgress], Any], every_s: float = 1.0
    ) -> None:
        self.runner = runner
        self.tell = progress if callable(progress) else None
        self.begin = time.monotonic()
        self.every_s = every_s
        wanted = runner.wanted().size
        mine = runner.design.rows if runner.rows is None else len(runner.rows)
        self.rows = mine
        self.before = mine - wanted
        self.next = self.begin + (0.0 if self.tell is None else every_s)
        self.indices: dict[str, float] = {}
        self.indices_next = self.begin + every_s
        self.bar: Any = None

    @contextlib.contextmanager
    def running(self) -> Any:
        """Shows the bar, and tells the last state at the end."""
        if self.tell is None:
            self.bar = _bar(self.rows, self.before)
        self.runner.meter = self
        try:
            yield
            self._look(last=True)
        finally:
            if self.bar is not None:
                self.bar.close()

    def tick(self) -> None:
        """Called after results."""
        if time.monotonic() >= self.next:
            self._look()

    def _look(self, last: bool = False) -> None:
        now = time.monotonic()
        if last or now >= self.indices_next:
            start = time.monotonic()
            self.indices = self._so_far()
            cost = time.monotonic() - start
            # Looking at a large study takes at most a twentieth of the time.
            self.indices_next = time.monotonic() + max(self.every_s, 20.0 * cost)
        state = self._state(now)
        if self.tell is not None:
            self.next = now + self.every_s
            self.tell(state)
            return
        self.next = now + 0.1
        self.bar.update(state.done - self.bar.n)
        if state.indices:
            self.bar.set_postfix_str(state._leading(), refresh=False)

    def _state(self, now: float) -> StudyProgress:
        runner = self.runner
        mine = runner.status if runner.rows is None else runner.status[runner.rows]
        done = int(np.count_nonzero(mine >= 0))
        elapsed = now - self.begin
        fresh = done - self.before
        left = (self.rows - done) * elapsed / fresh if fresh else float("nan")
        return StudyProgress(
            done=done,
            rows=self.rows,
            failed=int(np.count_nonzero(mine > 0)),
            elapsed_s=elapsed,
            left_s=left if done < self.rows else 0.0,
            indices=dict(self.indices),
        )

    def _so_far(self) -> dict[str, float]:
        design, runner = self.runner.design, self.runner
        if design.scheme == "sample":
            return {}
        effects = design.scheme != "saltelli"
        y = np.where(runner.status == 0, runner.y[:, 0], np.nan)
        # Blocks that are not complete are left out as those with failed runs are.
        if np.count_nonzero(np.isfinite(y.reshape(-1, design.block_rows)).all(axis=1)) < 2:
            return {}
        with contextlib.suppress(Error):
            found = analyse(
                design, y, None, effects=effects, interval="none", on_failure="drop_block"
            )
            values = found.value["mu_star" if effects else "total"]
            return {
                name: float(value)
                for name, value in zip(design.names, values, strict=True)
                if np.isfinite(value)
            }
        return {}


def _bar(total: int, done: int) -> Any:
    try:
        from tqdm.auto import tqdm
    except ImportError as failure:
        raise ImportError(
            "a progress bar needs tqdm: install it with `pip install ulna[progress]`"
        ) from failure
    return tqdm(total=total, initial=done, unit="run", leave=False)
