"""Which uncertainty matters: sensitivity studies of any function.

>>> import ulna
>>> study = ulna.Study(
...     factors={"a": ulna.Uniform(0.0, 1.0), "b": ulna.Uniform(0.0, 1.0)},
...     function=lambda a, b: 2.0 * a + b,
... )
>>> indices = study.sobol(n=256, seed=1)
>>> [round(float(share), 1) for share in indices.first]
[0.8, 0.2]
"""

from __future__ import annotations

import contextlib
import os
import warnings
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np

from ._factors import (
    Discrete,
    Factor,
    LogUniform,
    Normal,
    Triangular,
    TruncatedNormal,
    Uniform,
    check_factors,
)
from ._call import DataError
from ._study_design import StudyDesign, check_names, one_of
from ._study_indices import (
    ON_FAILURE,
    OPTIONS,
    STATUSES,
    Convergence,
    FailureReport,
    Screening,
    SobolIndices,
    analyse,
)
from ._study_export import export, salib_files, status_words
from ._study_fidelity import MultiFidelity, multi_fidelity
from ._study_journal import StudyJournal, plan_of
from ._study_patient import Patient, PatientQuantity, check_question, check_size, patient
from ._study_plan import Describes
from ._study_call import Call, RunFailed, RunTable
from ._study_progress import Meter, StudyProgress
from ._study_run import NOT_RUN, Runner, named
from ._study_salib import GivenData, factors_of_problem, given_data, problem_of
from ._study_shards import check_shard, merge, rows_of_shard
from ._study_two_phase import Fixed, TwoPhase, two_phase
from .record import refuse

__all__ = [
    "Convergence",
    "Discrete",
    "Factor",
    "FailureReport",
    "GivenData",
    "LogUniform",
    "MultiFidelity",
    "Normal",
    "Patient",
    "PatientQuantity",
    "RunFailed",
    "RunTable",
    "Runs",
    "Screening",
    "SobolIndices",
    "Study",
    "StudyDesign",
    "StudyJournal",
    "StudyProgress",
    "Triangular",
    "TruncatedNormal",
    "TwoPhase",
    "Uniform",
    "merge",
    "multi_fidelity",
]

# What Study.run takes besides what the analyses take.
_RUNNING = (
    "journal", "progress", "executor", "workers", "isolate", "timeout_s", "retries", "task_s",
    "budget_s",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Runs:
    """Outputs of a design's runs, one row each.

    Attributes
    ----------
    design : StudyDesign
    y : ndarray, shape (rows, outputs)
        NaN where a run failed.
    status : ndarray of int
        0 for a good run, else a place in `STATUSES`; -1 for a row that was not run.
    wall_s : ndarray
        Time of each run, s; NaN when it is not known.
    outputs : tuple of str
    messages : dict of int to str
        Why rows failed.
    units : dict of str to str
        Of factors and outputs, for figures and words.
    """

    design: StudyDesign
    y: np.ndarray = field(repr=False)
    status: np.ndarray = field(repr=False)
    wall_s: np.ndarray = field(repr=False)
    outputs: tuple[str, ...] = ("y",)
    messages: Mapping[int, str] = field(default_factory=dict, repr=False)
    units: Mapping[str, str] = field(default_factory=dict, repr=False)

    @property
    def failed(self) -> np.ndarray:
        """Rows whose run failed."""
        lost = (self.status != 0) | ~np.isfinite(self.y).all(axis=1)
        return np.flatnonzero(lost & (self.status != NOT_RUN))

    @property
    def missing(self) -> np.ndarray:
        """Rows that were not run: of another shard, or because the time was up."""
        return np.flatnonzero(self.status == NOT_RUN)

    def _why_failed(self) -> str:
        """The commonest reason of failed runs, with its first row; empty when none failed."""
        failed = self.failed.tolist()
        if not failed:
            return ""
        words = status_words(np.where(self.status == 0, STATUSES.index("nonfinite"), self.status))
        reasons = Counter((words[row], self.messages.get(row, "")) for row in failed)
        (word, message), count = reasons.most_common(1)[0]
        row = next(r for r in failed if (words[r], self.messages.get(r, "")) == (word, message))
        where = f"first run {row}"
        if self.design.has_points:
            point = self.design.values(first=row, count=1)[0].tolist()
            pairs = zip(self.design.function_factors, point, strict=False)  # no dummy
            where += f" ({named(dict(pairs))})"
        return f"{count} of {len(self.y)} runs have status {word!r}, {where}" + (
            message and f": {message}"
        )

    def output(self, name: str | None = None) -> np.ndarray:
        """One output, (rows,); the first when no name is given."""
        return self.y[:, self._place(name)]

    def _place(self, name: str | None) -> int:
        if name is None:
            return 0
        if name not in self.outputs:
            raise refuse(f"there is no output {name!r}; there are {', '.join(self.outputs)}", "output")
        return self.outputs.index(name)

    def _analysis(self, output: str | None, effects: bool, **chosen: Any) -> Any:
        place = self._place(output)
        if self.missing.size:
            raise DataError(
                f"{self.missing.size} of {len(self.y)} runs are missing: go on with the study and "
                "its journal, or merge its shards",
                status="ULNA_ERROR_DATA",
                argument="runs",
                detail=f"row {self.missing[0]}",
            )
        y = np.ascontiguousarray(self.y[:, place])

        def again(**subset: Any) -> Any:
            return analyse(self.design, y, self.status, effects=effects, **chosen, **subset)

        try:
            analysis = again()
        except DataError as failure:
            why = self._why_failed()
            if not why:
                raise
            raise DataError(
                f"{failure}; {why}",
                status=failure.status,
                argument=failure.argument,
                detail=failure.detail,
            ) from failure
        if analysis.outcome == "constant":
            from .impedance import UncertainResult

            words = "elementary effects are 0" if effects else "the indices are not defined (NaN)"
            warnings.warn(
                f"the output {self.outputs[place]} does not vary: {words}",
                UncertainResult,
                stacklevel=4,
            )
        return analysis, again, self.outputs[place]

    def sobol(
        self,
        *,
        output: str | None = None,
        estimator: str = "default",
        interval: str | None = None,
        level: float = 0.9,
        resamples: int = 1000,
        on_failure: str = "error",
        seed: int = 0,
        threads: int = 0,
    ) -> SobolIndices:
        """Variance-based indices of a saltelli design.

        Parameters
        ----------
        output : str, optional
            The first one by default.
        estimator : str
            "default": first order of Saltelli 2010, total order of Jansen, centred. "janon",
            "martinez". "parity": the uncentred pair of Saltelli 2008 that the SAFE toolbox computes.
        interval : str, optional
            "percentile" or "bca": bootstrap of whole blocks, of a sequence usually too wide, and
            with small n perhaps too narrow. "replicates": spread of the design's replicates, the
            default where there are at least two. "none".
        level : float
            Of the intervals.
        resamples : int
            Of the bootstrap.
        on_failure : str
            "error", "drop_block", "nearest" (the nearest good run, in quantiles) or "surface" (a
            polynomial fitted to the good runs).
        seed : int
            Of the bootstrap, of random subsets and of a surface's rows.
        threads : int
            0: one per processor. The result is the same.
        """
        if interval is None:
            interval = "replicates" if self.design.replicates > 1 else "percentile"
        analysis, again, name = self._analysis(
            output,
            False,
            estimator=estimator,
            interval=interval,
            level=level,
            resamples=resamples,
            on_failure=on_failure,
            seed=seed,
            threads=threads,
        )
        value, intervals = analysis.value, dict(analysis.interval)
        errors = dict(analysis.error)
        second = None
        if "second" in value:
            count = len(self.design.names)
            place = np.triu_indices(count, 1)

            def square(pairs: np.ndarray) -> np.ndarray:
                out = np.full((count, count, *pairs.shape[1:]), np.nan)
                out[place] = pairs
                out[place[1], place[0]] = pairs
                return out

            second = square(value["second"])
            errors["second"] = square(errors["second"])
            intervals["second"] = square(intervals["second"])
        dummy = {
            kind: (float(value["dummy_" + kind][0]), *intervals.pop("dummy_" + kind)[0].tolist())
            for kind in ("first", "total")
        }
        for kind in ("dummy_first", "dummy_total"):
            errors.pop(kind)
        return SobolIndices(
            names=self.design.names,
            first=value["first"],
            total=value["total"],
            second=second,
            intervals=intervals,
            errors=errors,
            dummy=dummy,
            mean=float(value["mean"][0]),
            variance=float(value["variance"][0]),
            level=level,
            estimator=estimator,
            interval=interval,
            blocks=analysis.blocks,
            outcome=analysis.outcome,
            failures=analysis.failures,
            design=self.design,
            output=name,
            _again=again,
        )

    def screen(
        self,
        *,
        output: str | None = None,
        interval: str | None = None,
        level: float = 0.9,
        resamples: int = 1000,
        on_failure: str = "error",
        seed: int = 0,
        threads: int = 0,
    ) -> Screening:
        """Elementary effects of a radial design or of trajectories; options as of `sobol`."""
        if interval is None:
            interval = "replicates" if self.design.replicates > 1 else "percentile"
        analysis, again, name = self._analysis(
            output,
            True,
            interval=interval,
            level=level,
            resamples=resamples,
            on_failure=on_failure,
            seed=seed,
            threads=threads,
        )
        value = analysis.value
        return Screening(
            names=self.design.names,
            mu=value["mu"],
            mu_star=value["mu_star"],
            sigma=value["sigma"],
            intervals=analysis.interval,
            errors=analysis.error,
            mean=float(value["mean"][0]),
            variance=float(value["variance"][0]),
            level=level,
            interval=interval,
            blocks=analysis.blocks,
            outcome=analysis.outcome,
            failures=analysis.failures,
            design=self.design,
            output=name,
            _total=value.get("total"),
            _again=again,
            unit=self.units.get(name, ""),
        )

    def given_data(
        self,
        *,
        method: str = "pawn",
        output: str | None = None,
        level: float = 0.9,
        resamples: int = 100,
        seed: int = 0,
    ) -> GivenData:
        """Indices from any sample, by SALib (``pip install SALib``); failed runs are left out.

        Parameters
        ----------
        method : str
            "pawn" (median of the Kolmogorov-Smirnov distances), "delta" (moment-independent) or
            "rbd_fast" (first order).
        """
        return given_data(
            self, method=method, output=output, level=level, resamples=resamples, seed=seed
        )

    def patient(
        self,
        *,
        quantities: Any = None,
        observed: Mapping[str, Any] | None = None,
        covariance: Any = None,
        measurable: Sequence[str] | None = None,
        method: str = "reweight",
        level: float = 0.9,
        seed: int = 0,
        on_failure: str = "error",
    ) -> Patient:
        """Intervals of a measured patient's quantities, from runs over all such patients.

        Rows of the study are patients that could be; each weighs as much as it agrees with what was
        observed. What is left is the uncertainty of this patient.

        Parameters
        ----------
        quantities : sequence of str, or dict of str to (str or float), optional
            Outputs that are asked for; all by default. A dict gives each the output that holds its
            standard error in a run, or a standard error: the measurement's own, which adds to that
            of the factors.
        observed : dict of str to (float, float), optional
            Outputs that predict what was measured on the patient: what was measured, and its
            standard error. With a `covariance`, values alone.
        covariance : array_like, optional
            Of what was observed, in the order of `observed`.
        measurable : sequence of str, optional
            Factors that could be measured better: only these are advised. All by default; a factor
            that is asked for itself should be left out.
        method : str
            "reweight": the runs themselves. "emulator": a Gaussian process that learns from some
            dozens of runs (needs scikit-learn); what it does not know widens the interval.
        level : float
        seed : int
            Of the emulator's points.
        on_failure : str
            "error", or "drop_block": patients whose run failed are left out.

        Raises
        ------
        AnalysisError
            When too few runs agree with what was observed (effective sample size below 50), none
            does, or the emulator does not predict unseen runs.

        Examples
        --------
        >>> import ulna
        >>> study = ulna.Study(
        ...     factors={"m": ulna.Normal(1.0, 0.1), "g": ulna.Normal(5.0, 1.0)},
        ...     function=lambda m, g: {"K": g + 20 * m, "seen": g},
        ...     outputs=("K", "seen"),
        ... )
        >>> patient = study.sample(n=1024, seed=1).patient(
        ...     quantities="K", observed={"seen": (5.5, 0.1)}
        ... )
        >>> patient["K"]
        <PatientQuantity K=25.5±2, 22.12 to 28.95>
        """
        return patient(
            self,
            quantities=quantities,
            observed=observed,
            covariance=covariance,
            measurable=measurable,
            method=method,
            level=level,
            seed=seed,
            on_failure=on_failure,
        )

    def base_rows(self) -> np.ndarray:
        """Rows that are a plain sample of the factors: those of A and B, or first rows of blocks."""
        rows = np.arange(0, self.design.rows, self.design.block_rows)
        if self.design.scheme == "saltelli":
            rows = np.sort(np.concatenate([rows, rows + self.design.block_rows - 1]))
        return rows

    def export(self, path: str | os.PathLike[str]) -> Path:
        """Write the runs as a table: .csv, .h5, .nc (NetCDF 3) or .parquet.

        Columns: row, block, factors, outputs, status (its name), wall_s, message. A name that is
        taken gets an underscore.
        """
        return export(self, path)

    def to_salib(self, folder: str | os.PathLike[str] | None = None) -> tuple[Any, Any, Any]:
        """SALib's ``problem``, ``X`` and ``Y``; written too when a folder is named.

        The files are problem.json, X.txt, Y.txt, and params.csv where SALib's command can read it.
        """
        if folder is not None:
            salib_files(self, folder)
        return problem_of(self.design.factors, self.design.groups), self.design.values(), self.y

    def plot_density(self, ax: Any = None, *, output: str | None = None) -> Any:
        """Distribution of an output over the factors (needs matplotlib)."""
        from . import plot

        return plot.output_density(self, ax, output=output)

    def plot_scatter(self, axes: Any = None, *, output: str | None = None) -> Any:
        """An output over each factor (needs matplotlib)."""
        from . import plot

        return plot.output_scatter(self, axes, output=output)

    def plot_pairs(
        self, axes: Any = None, *, output: str | None = None, factors: Sequence[str] | None = None
    ) -> Any:
        """Runs over two factors at a time, coloured by an output (needs matplotlib).

        By default of the three factors whose slices differ most in the output's mean.
        """
        from . import plot

        return plot.output_pairs(self, axes, output=output, factors=factors)

    def plot_failures(self, axes: Any = None) -> Any:
        """Where runs failed, two factors at a time (needs matplotlib)."""
        from . import plot

        return plot.failure_map(self, axes)

    def __repr__(self) -> str:
        return f"<Runs of {', '.join(self.outputs)}: {len(self.y)} rows, {len(self.failed)} failed>"


def check_running(
    *,
    workers: Any = 1,
    isolate: Any = None,
    timeout_s: Any = None,
    retries: Any = 1,
    task_s: Any = 10.0,
    budget_s: Any = None,
) -> None:
    """Refuse wrong options of `Study.run`."""
    if not isinstance(workers, int) or not 1 <= workers <= 4096:
        raise refuse(f"workers is {workers!r}; it must be a whole number from 1 to 4096", "workers")
    if not isinstance(retries, int) or not 0 <= retries <= 100:
        raise refuse(f"retries is {retries!r}; it must be a whole number from 0 to 100", "retries")
    for value, name, optional in (
        (timeout_s, "timeout_s", True),
        (task_s, "task_s", False),
        (budget_s, "budget_s", True),
    ):
        positive = isinstance(value, Real) and np.isfinite(value) and value > 0
        if not positive and not (optional and value is None):
            raise refuse(f"{name} is {value!r}; it must be a positive number", name)
    if isolate is not None:
        _check_flag(isolate, "isolate")
    if isolate is False and timeout_s is not None:
        raise refuse("timeout_s needs isolate: only a process can be ended", "isolate")


def _check_flag(value: Any, name: str) -> None:
    if not isinstance(value, (bool, np.bool_)):
        raise refuse(f"{name} is {value!r}; it must be true or false", name)


def _check_units(units: Mapping[str, str] | None, names: tuple[str, ...]) -> dict[str, str]:
    given = dict(units or {})
    for name, unit in given.items():
        if name not in names:
            raise refuse(f"units name no factor and no output {name!r}", "units")
        if not isinstance(unit, str):
            raise refuse(f"the unit of {name} must be text, got {unit!r}", "units")
    return given


class Study:
    """Factors with their uncertainty, and the function of them that is studied.

    Parameters
    ----------
    factors : dict of str to Factor
        As ``{"a": ulna.Uniform(0, 1)}``.
    function : callable, optional
        Called with the factors by name. Returns a number; with `outputs`, a sequence or a mapping of
        them. It may raise `RunFailed`, or return NaN, to say that a run has no result.
    outputs : sequence of str, optional
        Names of several outputs.
    groups : dict of str to str, optional
        Group of a factor; groups move as one and have one index.
    vectorized : bool
        The function takes arrays, one element a run, and returns (runs,) or (runs, outputs).
    units : dict of str to str, optional
        Of factors and outputs, for figures and words: ``{"k": "N m/rad"}``.

    Examples
    --------
    >>> import ulna
    >>> study = ulna.Study(
    ...     factors={"k": ulna.Normal(50.0, 5.0), "x": ulna.Uniform(0.0, 0.1)},
    ...     function=lambda k, x: k * x,
    ... )
    >>> study.screen(r=16, seed=1).ranking
    ('x', 'k')
    """

    def __init__(
        self,
        factors: Mapping[str, Factor],
        function: Callable[..., Any] | None = None,
        *,
        outputs: Sequence[str] | None = None,
        groups: Mapping[str, str] | None = None,
        vectorized: bool = False,
        units: Mapping[str, str] | None = None,
    ) -> None:
        self.factors = check_factors(factors)
        if function is not None and not callable(function):
            raise refuse(f"function must be callable, got {function!r}", "function")
        self.function = function
        if isinstance(outputs, str):
            raise refuse("outputs must be a sequence of names, not one text", "outputs")
        self.outputs = ("y",) if outputs is None else tuple(outputs)
        if not self.outputs or len(set(self.outputs)) != len(self.outputs):
            raise refuse("outputs must be names, each once", "outputs")
        _check_flag(vectorized, "vectorized")
        self._scalar = outputs is None
        self.groups = None if groups is None else dict(groups)
        self.vectorized = vectorized
        self.units = _check_units(units, (*self.factors, *self.outputs))
        self._describes = Describes()

    def design(self, **chosen: Any) -> StudyDesign:
        """A design over these factors; keywords are those of `StudyDesign`."""
        return StudyDesign(self.factors, groups=self.groups, **chosen)

    def run(
        self,
        design: StudyDesign,
        *,
        on_failure: str = "error",
        journal: str | os.PathLike[str] | None = None,
        writer: str | None = None,
        progress: bool | Callable[[StudyProgress], Any] = False,
        executor: Any = None,
        workers: int = 1,
        isolate: bool | None = None,
        timeout_s: float | None = None,
        retries: int = 1,
        task_s: float = 10.0,
        shard: tuple[int, int] | None = None,
        budget_s: float | None = None,
    ) -> Runs:
        """Run the function at every row of a design.

        Results do not depend on where the rows are run, nor in what order.

        Parameters
        ----------
        design : StudyDesign
        on_failure : str
            "error" stops at the first failed run. Anything else goes on and keeps its status; the
            analysis decides what to do about it.
        journal : path, optional
            A folder that keeps each result as soon as it is there. After a kill the same call goes
            on where it stopped: rows that are done are not run again, those that crashed or took
            too long are. A folder of another plan (factors, design, outputs, source of the
            function and what is bound to it) is refused.
        writer : str, optional
            Name of the file in it, for one process at a time; "main", or one of the shard's.
        progress : bool or callable
            Show a bar with the time left and the indices so far (needs tqdm), or call this with a
            `StudyProgress` every second.
        executor : optional
            Where rows are run: any executor of concurrent.futures, a Dask client or its executor,
            MPI's ``MPIPoolExecutor``.
        workers : int
            Without an executor: slots on this machine. With one: its slots, where it does not say.
        isolate : bool, optional
            Run the function in a child process of each slot: a run that crashes natively, or is
            killed, has status "crashed" and takes nothing else along. The default with more than
            one slot, an executor or a `timeout_s`. What a run prints or keeps in globals stays
            there.
        timeout_s : float, optional
            A run that takes longer is killed, with status "timeout".
        retries : int
            How often a run that crashed or took too long is tried again; other failures are final.
        task_s : float
            Rows are handed out in tasks of about this many seconds.
        shard : (int, int), optional
            ``(i, n)``: only the i-th of n parts, i from 1. Needs a journal; see `merge`.
        budget_s : float, optional
            Begin no more runs after this time; call again with the journal to go on.
        """
        if self.function is None:
            raise refuse(
                "this study has no function: give it one, or use read_outputs", "function"
            )
        one_of(ON_FAILURE, on_failure, "on_failure")
        if list(design.function_factors) != list(self.factors):
            raise refuse("the design is one of other factors", "design")
        check_running(
            workers=workers,
            isolate=isolate,
            timeout_s=timeout_s,
            retries=retries,
            task_s=task_s,
            budget_s=budget_s,
        )
        if shard is not None:
            check_shard(shard)
            if journal is None:
                raise refuse("a shard needs a journal: it is what shards are merged from", "journal")
        apart = executor is not None or workers > 1 or timeout_s is not None
        isolate = apart if isolate is None else bool(isolate)
        name = writer or ("main" if shard is None else f"shard-{shard[0]}-of-{shard[1]}")
        kept = None if journal is None else self._journal(design, journal, name)
        try:
            runner = Runner(
                self._call(design),
                design,
                on_failure=on_failure,
                journal=kept,
                rows=None if shard is None else rows_of_shard(design, shard),
                budget_s=budget_s,
                retries=retries,
            )
            with contextlib.ExitStack() as stack:
                if progress:
                    stack.enter_context(Meter(runner, progress).running())
                if apart or isolate:
                    from ._study_farm import Farm

                    farm = Farm(
                        runner,
                        isolate=isolate,
                        timeout_s=timeout_s,
                        retries=retries,
                        task_s=task_s,
                    )
                    farm.run(executor, workers)
                else:
                    runner.run()
        finally:
            self._describes.after_runs()
            if kept is not None:
                kept.close()
        return self._runs(runner)

    def collect(self, design: StudyDesign, *, journal: str | os.PathLike[str]) -> Runs:
        """What a journal knows of a design's runs, without running any.

        A run that crashed or took too long has failed here; `run` tries it again.
        """
        kept = self._journal(design, journal, None)
        try:
            return self._runs(
                Runner(
                    self._call(design), design, on_failure="drop_block", journal=kept, again=False
                )
            )
        finally:
            kept.close()

    def fix(self, **values: float) -> Study:
        """The same study with some factors at fixed values, as ``study.fix(mass=2.1)``."""
        unknown = set(values) - set(self.factors)
        if unknown or len(values) >= len(self.factors):
            raise refuse(
                f"there is no factor {min(unknown)!r}"
                if unknown
                else "at least one factor must remain",
                "values",
            )
        rest = {name: factor for name, factor in self.factors.items() if name not in values}
        groups = None
        if self.groups is not None:
            groups = {name: group for name, group in self.groups.items() if name in rest} or None
        numbers = {name: float(value) for name, value in values.items()}
        found = Study(
            rest,
            None if self.function is None else Fixed(self.function, numbers),
            outputs=None if self._scalar else self.outputs,
            groups=groups,
            vectorized=self.vectorized,
            units={name: unit for name, unit in self.units.items() if name not in values},
        )
        found._describes = self._describes  # one function, whatever is fixed
        return found

    def two_phase(
        self,
        *,
        r: int = 64,
        n: int = 1024,
        share: float = 0.05,
        seed: int = 0,
        keep: Sequence[str] = (),
        decide_by: Sequence[str] = (),
        values: Mapping[str, float] | None = None,
        on_failure: str = "error",
        journal: str | os.PathLike[str] | None = None,
        screening: Mapping[str, Any] | None = None,
        ranking: Mapping[str, Any] | None = None,
        **running: Any,
    ) -> TwoPhase:
        """Screen all factors, fix the negligible ones, rank the others.

        Elementary effects first, r (K + 1) runs. A factor (or group) is fixed when the high end of
        its mu*'s interval is below `share` of the largest mu*, for every output that decides. The others
        get variance-based indices.

        Parameters
        ----------
        r, n : int
            Repetitions of the screening; base points of the ranking.
        share : float
            Of the largest mu*.
        keep : sequence of str
            Factors that are never fixed.
        decide_by : sequence of str
            Outputs that decide; all by default.
        values : dict of str to float, optional
            Where factors are fixed; their median by default.
        journal : path, optional
            A folder; each phase has its own in it.
        screening, ranking : dict, optional
            More for `screen` and for `sobol`, as ``{"guard": 0}`` and ``{"replicates": 8}``.
        **running
            As of `run`: executor, workers, isolate, timeout_s, retries, progress, ...
        """
        folder = None if journal is None else Path(journal)

        def execute(study: Study, design: StudyDesign, phase: str) -> Runs:
            kept = None if folder is None else folder / phase
            return study.run(design, on_failure=on_failure, journal=kept, **running)

        return two_phase(
            self,
            r=r,
            n=n,
            share=share,
            seed=seed,
            keep=keep,
            decide_by=decide_by,
            values=values,
            on_failure=on_failure,
            screening=screening,
            ranking=ranking,
            execute=execute,
        )

    def _call(self, design: StudyDesign) -> Call:
        return Call(
            function=self.function,
            names=design.function_factors,
            outputs=self.outputs,
            scalar=self._scalar,
            vectorized=self.vectorized,
        )

    def _journal(
        self, design: StudyDesign, folder: str | os.PathLike[str], writer: str | None
    ) -> StudyJournal:
        told = self._describes.now(self.function)
        if told.unknown:
            from .impedance import UncertainResult

            warnings.warn(
                f"the journal's plan does not hold {', '.join(told.unknown)} of the function: give "
                "it an attribute plan_source, a text that changes when its results do",
                UncertainResult,
                stacklevel=3,
            )
        return StudyJournal(
            folder,
            plan=plan_of(design, self.outputs, self.function, self.vectorized, told),
            rows=design.rows,
            outputs=len(self.outputs),
            writer=writer,
        )

    def _runs(self, runner: Runner) -> Runs:
        return Runs(
            runner.design, runner.y, runner.status, runner.wall_s, self.outputs, runner.messages,
            self.units,
        )  # fmt: skip

    def screen(
        self,
        *,
        r: int = 64,
        seed: int = 0,
        scheme: str = "radial",
        sampler: str = "latin",
        guard: float | None = None,
        levels: int = 4,
        replicates: int = 1,
        dummy: bool = False,
        on_failure: str = "error",
        **options: Any,
    ) -> Screening:
        """Elementary effects: which factors can be left alone? r (K + 1) runs.

        Parameters
        ----------
        r : int
            Repetitions: effects of each factor.
        scheme : str
            "radial" (steps from base points) or "trajectories" (Morris, on a grid).
        sampler : str
            Of radial base points: "latin", "sobol", "monte-carlo", or "pooled-latin" for parity.
        guard : float
            Smallest step in quantiles: short steps divide rounding by nearly nothing. 0 for none,
            which makes the total index available too. The default is 0.25, and none of a pooled
            hypercube.
        levels : int
            Of the grid of trajectories.
        dummy : bool
            Add a factor that the function never sees: the noise of a random function.
        on_failure, output, interval, level, resamples, threads
            See `Runs.screen`.
        journal, progress, executor, workers, isolate, timeout_s, retries, task_s, budget_s
            See `run`.
        """
        design = self.design(
            scheme=scheme,
            sampler=sampler,
            n=r,
            replicates=replicates,
            guard=guard,
            levels=levels,
            seed=seed,
            dummy=dummy,
        )
        running = self._parted(design, "screen", on_failure, seed, options)
        runs = self.run(design, on_failure=on_failure, **running)
        return runs.screen(on_failure=on_failure, seed=seed, **options)

    def sobol(
        self,
        *,
        n: int = 1024,
        seed: int = 0,
        sampler: str = "sobol",
        second_order: bool = False,
        replicates: int = 1,
        dummy: bool = False,
        on_failure: str = "error",
        **options: Any,
    ) -> SobolIndices:
        """Variance-based indices: how much of the output's variance is each factor's?

        n (K + 2) runs a replicate, n (2 K + 2) with second order.

        Parameters
        ----------
        n : int
            Base points of each replicate; a power of two for the Sobol' sequence.
        sampler : str
            "sobol", "latin", "monte-carlo", or "pooled-latin" for parity.
        second_order : bool
            Indices of pairs too.
        replicates : int
            Independent scrambles; with at least two the intervals are those of their spread.
        dummy : bool
            Add a factor that the function never sees: the noise of a random function.
        on_failure, output, estimator, interval, level, resamples, threads
            See `Runs.sobol`.
        journal, progress, executor, workers, isolate, timeout_s, retries, task_s, budget_s
            See `run`.
        """
        design = self.design(
            scheme="saltelli",
            sampler=sampler,
            n=n,
            replicates=replicates,
            second_order=second_order,
            seed=seed,
            dummy=dummy,
        )
        running = self._parted(design, "sobol", on_failure, seed, options)
        runs = self.run(design, on_failure=on_failure, **running)
        return runs.sobol(on_failure=on_failure, seed=seed, **options)

    def _parted(
        self, design: StudyDesign, analysis: str, on_failure: str, seed: int, options: dict[str, Any]
    ) -> dict[str, Any]:
        """Options of `run`, which are taken out of those of an analysis, and those checked."""
        check_names(options, (*OPTIONS[analysis], "output", *_RUNNING), f"{analysis}: ")
        running = {name: options.pop(name) for name in _RUNNING if name in options}
        self._rehearse(design, analysis, {"on_failure": on_failure, "seed": seed, **options})
        return running

    def _rehearse(self, design: StudyDesign, analysis: str, options: Mapping[str, Any]) -> None:
        """Analyse a made-up result of a small such design: what is refused is so before a run."""
        small = self.design(
            scheme=design.scheme,
            sampler="monte-carlo",
            n=min(design.n, 2),
            replicates=design.replicates,
            second_order=design.second_order,
            guard=design.guard,
            levels=design.levels,
            dummy=design.dummy,
        )
        made_up = self._nothing_of(small)
        made_up.y[:] = np.arange(small.rows)[:, None]
        made_up.status[:] = 0
        getattr(made_up, analysis)(**options)

    def _nothing_of(self, design: StudyDesign) -> Runs:
        """The design's runs before the first one."""
        nothing = np.full((design.rows, len(self.outputs)), np.nan)
        status = np.full(design.rows, NOT_RUN, dtype=np.int32)
        return Runs(design, nothing, status, nothing[:, 0].copy(), self.outputs)

    def sample(
        self,
        *,
        n: int = 1024,
        seed: int = 0,
        sampler: str = "sobol",
        candidates: int = 1,
        on_failure: str = "error",
        **running: Any,
    ) -> Runs:
        """Run a plain sample of the factors: for densities, scatter plots and given-data indices.

        Options are those of `design` and of `run`.
        """
        design = self.design(
            scheme="sample", sampler=sampler, n=n, candidates=candidates, seed=seed
        )
        return self.run(design, on_failure=on_failure, **running)

    def patient(
        self,
        *,
        n: int | None = None,
        quantities: Any = None,
        observed: Mapping[str, Any] | None = None,
        covariance: Any = None,
        measurable: Sequence[str] | None = None,
        method: str = "reweight",
        level: float = 0.9,
        seed: int = 0,
        on_failure: str = "error",
        **running: Any,
    ) -> Patient:
        """How well is a measured patient known? A plain sample of the factors, then `Runs.patient`.

        Parameters
        ----------
        n : int, optional
            Runs, a power of two: 1024, or 128 that an emulator learns from.
        quantities, observed, covariance, measurable, method, level
            See `Runs.patient`.
        on_failure : str
            "error" or "drop_block".
        **running
            As of `run`: journal, executor, workers, ...

        Examples
        --------
        >>> import ulna
        >>> study = ulna.Study(
        ...     factors={"mass": ulna.Normal(1.3, 0.15), "length": ulna.Normal(0.27, 0.01)},
        ...     function=lambda mass, length: 4.0 + 9.81 * mass * length,
        ...     units={"mass": "kg", "length": "m", "y": "N m/rad"},
        ... )
        >>> print(study.patient(quantities={"y": 0.05}, seed=1)["y"].advice())
        To halve the interval of y: measure mass to ±0.066 kg (standard error).
        """
        design = self.design(
            scheme="sample",
            n=(1024 if method == "reweight" else 128) if n is None else n,
            seed=seed,
            **{name: running.pop(name) for name in ("sampler", "candidates") if name in running},
        )
        question = {
            "quantities": quantities,
            "observed": observed,
            "covariance": covariance,
            "measurable": measurable,
            "method": method,
            "level": level,
            "on_failure": on_failure,
        }
        planned = self._nothing_of(design)
        check_question(planned, **question)
        check_size(planned, planned.base_rows(), method)
        runs = self.run(design, on_failure=on_failure, **running)
        return runs.patient(seed=seed, **question)

    @property
    def problem(self) -> dict[str, Any]:
        """The factors as SALib's ``problem``."""
        return problem_of(self.factors, self.groups)

    @classmethod
    def from_problem(
        cls, problem: Mapping[str, Any], function: Callable[..., Any] | None = None, **keywords: Any
    ) -> Study:
        """A study of SALib's ``problem``."""
        factors, groups = factors_of_problem(problem)
        return cls(factors, function, groups=groups, **keywords)

    def read_outputs(
        self,
        y: Any,
        *,
        x: Any = None,
        scheme: str = "saltelli",
        second_order: bool = False,
        status: Any = None,
    ) -> Runs:
        """Outputs that were computed elsewhere, in SALib's order of rows.

        Parameters
        ----------
        y : array_like, shape (rows,) or (rows, outputs)
        x : array_like, shape (rows, factors), optional
            Values of the factors. Elementary effects need them, and so do "nearest" and "surface".
        scheme : str
            "saltelli", "radial" or "trajectories" (SALib's morris).
        second_order : bool
            As the sample was made (SALib's ``calc_second_order``).
        status : array_like of int, optional
            0 for good runs.
        """
        values = np.asarray(y, dtype=float)
        values = values[:, None] if values.ndim == 1 else values
        if values.ndim != 2 or values.shape[1] != len(self.outputs):
            raise refuse(f"y must be (rows,) or (rows, {len(self.outputs)})", "y")
        points = None
        if x is not None:
            given = np.asarray(x, dtype=float)
            if given.shape != (len(values), len(self.factors)):
                raise refuse(
                    f"x must be ({len(values)}, {len(self.factors)}), got {given.shape}", "x"
                )
            points = np.column_stack(
                [f.probability(given[:, k]) for k, f in enumerate(self.factors.values())]
            )
        names = dict.fromkeys((self.groups or {}).get(name, name) for name in self.factors)
        count = len(names)
        block = {"saltelli": (2 if second_order else 1) * count + 2, "sample": 1}.get(
            scheme, count + 1
        )
        if len(values) == 0 or len(values) % block:
            raise refuse(
                f"y has {len(values)} rows; a {scheme} design of {count} factors has blocks of "
                f"{block} rows: check scheme and second_order",
                "y",
            )
        design = self.design(
            scheme=scheme,
            sampler="given",
            n=len(values) // block,
            second_order=second_order,
            guard=0.0,
            points=points,
        )
        codes = np.zeros(len(values), dtype=np.int32)
        if status is not None:
            codes = np.asarray(status, dtype=np.int32)
        wall = np.full(len(values), np.nan)
        return Runs(design, values, codes, wall, self.outputs, units=self.units)


