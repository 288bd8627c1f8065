"""A study of overhead work with and without an arm support, on simulated people.

Twelve people point a drill at a target above their heads, in two sessions, with and without a device on
their arms. A suit and a pair of shoes record them with the errors that sensors have; the recordings go
through the pipeline of recorded data (:mod:`ulna.capture`), and the true torques are known. So the study
shows what such an experiment finds, and how far its intervals can be trusted. After Latella et al. 2021.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._overhead_sensors import SensorErrors, Simulated
from ._overhead_session import (
    SIDES,
    BlockEffort,
    SessionEffort,
    Setting,
    record_session,
    run_session,
    session_setup,
)
from ._overhead_task import Protocol, Subject, cohort
from .assist import ForceTable, read_force_table
from .effort import AREAS
from .record import refuse
from .stats import Anova, Paired, compare_pairs, repeated_anova

__all__ = [
    "BlockEffort",
    "Coverage",
    "OverheadStudy",
    "Protocol",
    "PublishedReduction",
    "SensorErrors",
    "SessionEffort",
    "Simulated",
    "Subject",
    "cohort",
    "overhead_study",
    "session_setup",
    "simulate_session",
]

Array = NDArray[np.float64]

_SESSION_BYTES = 1.2e9
MEASURES = (
    "norm", "norm per kg", "mean absolute", "root mean square",
    *AREAS, *(f"{side} shoulder" for side in SIDES),
)  # fmt: skip


def simulate_session(
    subject: Subject,
    *,
    with_device: bool,
    protocol: Protocol | None = None,
    errors: SensorErrors | None = None,
    device: ForceTable | str | os.PathLike[str] | None = None,
    seed: int = 0,
) -> Simulated:
    """What a suit and shoes record of a person at work, and the true torques.

    Parameters
    ----------
    subject
        Of `cohort`.
    with_device
        Whether the person wears the arm support.
    protocol, errors, device, seed
        As for `overhead_study`.

    Examples
    --------
    >>> short = Protocol(blocks=1, repetitions=1, hold_s=0.4, cycle_s=2.4, still_s=1.0)
    >>> made = simulate_session(cohort()[0], with_device=False, protocol=short)
    >>> len(made.suit), len(made.shoes), made.torque_nm.shape, made.balance < 1e-9
    (1272, 21184, (1272, 48), True)
    """
    return record_session(
        subject, with_device=with_device, setting=_setting(protocol, errors, device, seed)
    )


def overhead_study(
    *,
    subjects: int = 12,
    protocol: Protocol | None = None,
    errors: SensorErrors | None = None,
    device: ForceTable | str | os.PathLike[str] | None = None,
    seed: int = 0,
    workers: int = 0,
    progress: bool | Callable[[int, int], None] = False,
) -> OverheadStudy:
    """Simulate the cohort, estimate its torques by the pipeline of recorded data, and compare.

    Parameters
    ----------
    subjects : int
        At least 3; every other one begins with the device.
    protocol : Protocol, optional
        As in the published study: five blocks of 24 movements, about 12 minutes.
    errors : SensorErrors, optional
    device : ForceTable or path, optional
        Measured force curves, one a person in turn (see `ulna.assist.read_force_table`). Without one: a
        smooth curve with 35.3 ± 2.7 N at its peak.
    seed : int
        Of people, movements and errors.
    workers : int
        Sessions that are computed at once; 0: one a processor, as far as the memory reaches (a session of
        full length takes 1 GB). The numbers do not depend on it.
    progress : bool or function of (done, all)

    Examples
    --------
    >>> short = Protocol(blocks=1, repetitions=1, hold_s=0.4, cycle_s=2.4, still_s=1.0)
    >>> overhead_study(subjects=3, protocol=short)
    <OverheadStudy: 3 subjects, 7548 frames, ...>
    """
    setting = _setting(protocol, errors, device, seed)
    if subjects < 3:
        raise refuse(f"{subjects} subjects are too few: a comparison needs at least 3", "subjects")
    if workers < 0:
        raise refuse("workers must not be negative", "workers")
    people = cohort(subjects=subjects, seed=seed)
    cells = [(person, worn) for person in people for worn in (False, True)]
    told = _teller(progress, len(cells))
    pool = ThreadPoolExecutor(workers or _workers())
    try:
        runs = [
            pool.submit(
                run_session, person, with_device=worn, setting=setting, scene=person is people[0]
            )
            for person, worn in cells
        ]
        done = []
        for run in runs:
            done.append(run.result())
            told(len(done))
    finally:
        # After an error or Ctrl-C what has not begun does not begin.
        pool.shutdown(cancel_futures=True)
    return OverheadStudy(
        sessions=tuple((done[2 * k], done[2 * k + 1]) for k in range(subjects)),
        protocol=setting.protocol,
        errors=setting.errors,
        seed=seed,
        device="measured curves" if setting.table is not None else "a smooth curve",
    )


def _workers() -> int:
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    return max(1, min(os.cpu_count() or 1, int(memory / _SESSION_BYTES)))


def _setting(
    protocol: Protocol | None,
    errors: SensorErrors | None,
    device: ForceTable | str | os.PathLike[str] | None,
    seed: int,
) -> Setting:
    if seed < 0:
        raise refuse("seed must not be negative", "seed")
    table = device if device is None or isinstance(device, ForceTable) else read_force_table(device)
    return Setting(protocol or Protocol(), errors or SensorErrors(), seed, table)


def _teller(progress: bool | Callable[[int, int], None], count: int) -> Callable[[int], None]:
    if callable(progress):
        return lambda done: progress(done, count)
    if not progress:
        return lambda done: None
    try:
        from tqdm import tqdm
    except ImportError as failure:
        raise ImportError("progress needs tqdm: install it with `pip install tqdm`") from failure
    bar = tqdm(total=count, unit="session")

    def move(done: int) -> None:
        bar.update(done - bar.n)
        if done == count:
            bar.close()

    return move


# What it found ------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Coverage:
    """How often true torques lie inside their 95 % intervals, over frames and sessions.

    Attributes
    ----------
    joints : tuple of str
    share : (joints,) array
    session_share : (sessions,) array
        Over all joints of a session.
    error_nm, deviation_nm : (joints,) array
        Root mean squares of the true error and of the standard deviation stated.
    sensor_nm, posture_nm : (joints,) array
        Parts of the latter: of the sensors, and of the told posture.
    frames : int
    """

    joints: tuple[str, ...]
    share: Array
    session_share: Array
    error_nm: Array
    deviation_nm: Array
    sensor_nm: Array
    posture_nm: Array
    frames: int

    @property
    def overall(self) -> float:
        """Share of all frames and joints."""
        return float(self.share.mean())

    @property
    def overall_error(self) -> float:
        """Standard error of `overall`: fixed errors of sensors are drawn once a session."""
        count = len(self.session_share)
        return float(self.session_share.std(ddof=1) / np.sqrt(count)) if count > 1 else np.nan

    def summary(self) -> str:
        """In words."""
        low, high = int(np.argmin(self.share)), int(np.argmax(self.share))
        return (
            f"{100 * self.overall:.1f} ± {100 * self.overall_error:.1f} % of {self.frames} frames x "
            f"{len(self.joints)} joints lie inside their 95 % intervals "
            f"({self.joints[low]} {100 * self.share[low]:.0f} %, "
            f"{self.joints[high]} {100 * self.share[high]:.0f} %)"
        )

    def __repr__(self) -> str:
        return f"<Coverage: {100 * self.overall:.1f} ± {100 * self.overall_error:.1f} %>"


@dataclass(frozen=True, eq=False)
class PublishedReduction:
    """Table I as published, beside the change of the effort, block by block.

    Attributes
    ----------
    without_nm, with_nm : (blocks,) array
        Signed means of all torques over subjects, rests included.
    reduction : (blocks,) array
        Size of their difference over the size without: what was published.
    norm, mean_abs : Paired
        Of the norm and the mean absolute torque in working frames; one measure a block.
    """

    without_nm: Array
    with_nm: Array
    reduction: Array
    norm: Paired
    mean_abs: Paired


@dataclass(frozen=True, eq=False)
class OverheadStudy:
    """Effort of a cohort in both sessions.

    Attributes
    ----------
    sessions : tuple of (SessionEffort, SessionEffort)
        Of every subject: without and with the device.
    protocol : Protocol
    errors : SensorErrors
    seed : int
    device : str
        What drove it, in words.
    """

    sessions: tuple[tuple[SessionEffort, SessionEffort], ...]
    protocol: Protocol
    errors: SensorErrors
    seed: int
    device: str

    @property
    def subjects(self) -> tuple[Subject, ...]:
        """The people."""
        return tuple(pair[0].subject for pair in self.sessions)

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints."""
        return self.sessions[0][0].joints

    def values(self, measure: str, *, true: bool = False) -> Array:
        """Effort by subject, session (without, with) and block, in Nm.

        Parameters
        ----------
        measure : str
            One of `MEASURES`: ``"norm"``, ``"norm per kg"``, ``"mean absolute"``, ``"root mean square"``,
            an area such as ``"right arm"``, ``"right shoulder"``; or ``"signed mean"``, as published.
        true : bool
            Of the true torques instead of the estimated ones.
        """
        if measure == "norm per kg":
            mass = np.array([subject.mass_kg for subject in self.subjects])
            return self.values("norm", true=true) / mass[:, None, None]
        take = _measure(measure)
        return np.array(
            [[take(one.true if true else one.measured) for one in pair] for pair in self.sessions]
        )

    def joint_values(self, *, true: bool = False) -> Array:
        """Mean absolute torque by subject, session, block and joint, in Nm."""
        return np.array(
            [
                [(one.true if true else one.measured).joint_nm for one in pair]
                for pair in self.sessions
            ]
        )

    def anova(self, measure: str = "norm", *, true: bool = False) -> Anova:
        """Two-way analysis of variance with repeated measures: session, block, and both."""
        return repeated_anova(self.values(measure, true=true), names=("session", "block"))

    def change(self, measures: Sequence[str] = MEASURES, *, true: bool = False) -> Paired:
        """Change from without to with the device, means over blocks, intervals over subjects."""
        table = np.stack([self.values(m, true=true).mean(axis=2) for m in measures], axis=-1)
        return compare_pairs(table[:, 0], table[:, 1], names=tuple(measures), seed=self.seed)

    @cached_property
    def published(self) -> PublishedReduction:
        """Table I as published, beside what happened to the effort."""
        signed = self.values("signed mean").mean(axis=0)
        blocks = tuple(f"block {b + 1}" for b in range(signed.shape[1]))

        def paired(measure: str) -> Paired:
            table = self.values(measure)
            return compare_pairs(table[:, 0], table[:, 1], names=blocks, seed=self.seed)

        return PublishedReduction(
            signed[0],
            signed[1],
            np.abs(signed[0] - signed[1]) / np.abs(signed[0]),
            paired("norm"),
            paired("mean absolute"),
        )

    @cached_property
    def coverage(self) -> Coverage:
        """How often the true torques lie inside their intervals."""
        every = [one for pair in self.sessions for one in pair]
        weights = np.array([one.frames for one in every], dtype=float)

        def squares(name: str) -> Array:
            table = np.array([getattr(one, name) for one in every])
            return np.asarray(np.sqrt(np.average(table**2, axis=0, weights=weights)))

        inside = np.array([one.inside for one in every])
        return Coverage(
            joints=self.joints,
            share=np.average(inside, axis=0, weights=weights),
            session_share=inside.mean(axis=1),
            error_nm=squares("error_nm"),
            deviation_nm=squares("deviation_nm"),
            sensor_nm=squares("sensor_nm"),
            posture_nm=squares("posture_nm"),
            frames=int(weights.sum()),
        )

    def summary(self) -> str:
        """What was found, as text."""
        chosen = ("norm", "mean absolute", "torso", "right arm", "right leg", "right shoulder")
        lines = [
            f"{len(self.sessions)} subjects, {self.coverage.frames} frames; effort in Nm, with the device against without",
            *self.change(chosen).summary().splitlines()[1:],
            *(str(effect) for effect in self.anova().effects),
            "as published (signed mean): "
            + ", ".join(f"{100 * r:.0f} %" for r in self.published.reduction),
            self.coverage.summary(),
        ]
        return "\n".join(lines)

    def tables(self) -> Mapping[str, Sequence[Sequence[Any]]]:
        """Tables by name: a row of names, then rows of values."""
        from ._overhead_tables import tables

        return tables(self)

    def plot(self, axes: Any = None) -> Any:
        """Effort over time in both sessions: `ulna.plot.effort_over_time`."""
        from .plot import effort_over_time

        return effort_over_time(self, axes)

    def write(self, folder: str | os.PathLike[str], *, command: str = "") -> Path:
        """Write tables, figures, the moving body and the report; return the report's path.

        Parameters
        ----------
        folder
            Made when it is not there.
        command : str
            What made the study, for the report.
        """
        from ._overhead_report import write

        return write(self, Path(folder), command)

    def __repr__(self) -> str:
        norm = self.change(("norm",)).relative
        return (
            f"<OverheadStudy: {len(self.sessions)} subjects, {self.coverage.frames} frames, effort "
            f"{100 * norm.value[0]:+.1f} % [{100 * norm.low[0]:.1f}, {100 * norm.high[0]:.1f}], "
            f"{100 * self.coverage.overall:.1f} % covered>"
        )


def _measure(name: str) -> Callable[[BlockEffort], Array]:
    plain = {
        "norm": "norm_nm", "mean absolute": "mean_abs_nm", "root mean square": "rms_nm",
        "signed mean": "signed_nm",
    }  # fmt: skip
    if name in plain:
        return lambda effort: np.asarray(getattr(effort, plain[name]))
    if name in AREAS:
        return lambda effort: effort.area_nm[:, AREAS.index(name)]
    side = name.removesuffix(" shoulder")
    if side in SIDES and side != name:
        return lambda effort: effort.shoulder_nm[:, SIDES.index(side)]
    raise refuse(f"there is no measure {name!r}; there are {', '.join(MEASURES)}", "measure")
