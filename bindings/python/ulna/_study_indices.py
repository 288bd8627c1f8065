"""Sensitivity indices with their intervals."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ._call import DataError, Handle, check, ffi, lib, long_call, options, out_array, result, view
from ._study_design import StudyDesign, check_share, one_of
from .record import refuse

__all__ = ["Convergence", "FailureReport", "Screening", "SobolIndices"]

ESTIMATORS = {
    "default": lib.ULNA_INDICES_BY_SALTELLI,
    "janon": lib.ULNA_INDICES_BY_JANON,
    "martinez": lib.ULNA_INDICES_BY_MARTINEZ,
    "parity": lib.ULNA_INDICES_BY_PARITY,
}
INTERVALS = {
    "percentile": lib.ULNA_INTERVAL_PERCENTILE,
    "bca": lib.ULNA_INTERVAL_BCA,
    "replicates": lib.ULNA_INTERVAL_REPLICATES,
    "none": lib.ULNA_INTERVAL_NONE,
}
ON_FAILURE = {
    "error": lib.ULNA_ON_FAILURE_ERROR,
    "drop_block": lib.ULNA_ON_FAILURE_DROP_BLOCK,
    "nearest": lib.ULNA_ON_FAILURE_NEAREST,
    "surface": lib.ULNA_ON_FAILURE_SURFACE,
}
# What the analyses may be told besides the output, on_failure and the seed.
OPTIONS = {
    "screen": ("interval", "level", "resamples", "threads"),
    "sobol": ("estimator", "interval", "level", "resamples", "threads"),
}
# Final status of a run, as the core numbers it; 0 is good.
STATUSES = (
    "ok",
    "failed_init",
    "diverged",
    "limit",
    "timeout",
    "nonfinite",
    "raised",
    "crashed",
)


class _Indices(Handle):
    kind = "ulna_indices"
    __slots__ = ()


@dataclass(frozen=True, eq=False)
class FailureReport:
    """Runs that failed, and which factors bring that about.

    Attributes
    ----------
    rows, blocks : int
        Failed runs, and blocks that hold one.
    by_status : dict of str to int
    base : int
        Failed runs at which no factor had been moved alone.
    by_factor : dict of str to int
        Failed runs at which the factor had just been moved.
    flip_share : dict of str to float
        Share of a factor's steps that turned a good run into a failed one, or back.
    first, total : dict of str to float
        Sensitivity of the indicator "the run failed"; empty where the design does not give it.
    treatment : str
        What the analysis did about them (`on_failure`).
    surface_r2 : float
        Of the surface, on the good runs nearest to the failed ones, which it had not seen.
    """

    rows: int
    blocks: int
    by_status: Mapping[str, int]
    base: int
    by_factor: Mapping[str, int]
    flip_share: Mapping[str, float]
    first: Mapping[str, float]
    total: Mapping[str, float]
    treatment: str
    surface_r2: float

    def summary(self) -> str:
        """Who failed, in a few lines."""
        kinds = ", ".join(f"{count} {name}" for name, count in self.by_status.items())
        lines = [f"{self.rows} runs failed ({kinds}) in {self.blocks} blocks: {self.treatment}"]
        if self.treatment == "surface":
            lines.append(f"  surface: R2 {self.surface_r2:.3f} on the good runs nearest to them")
        worst = max(self.flip_share, key=lambda name: self.flip_share[name])
        lines.append(
            f"  moving {worst} turns {100 * self.flip_share[worst]:.1f} % of runs from good to "
            "failed or back"
        )
        return "\n".join(lines)


@dataclass(frozen=True, eq=False)
class _Analysis:
    """Numbers of one call, by name."""

    value: Mapping[str, np.ndarray]
    error: Mapping[str, np.ndarray]
    interval: Mapping[str, np.ndarray]
    blocks: int
    outcome: str
    failures: FailureReport | None


def analyse(
    design: StudyDesign,
    y: np.ndarray,
    status: np.ndarray | None,
    *,
    effects: bool,
    estimator: str = "default",
    interval: str = "percentile",
    level: float = 0.9,
    resamples: int = 1000,
    on_failure: str = "error",
    seed: int = 0,
    threads: int = 0,
    blocks: int = 0,
    random: bool = False,
) -> _Analysis:
    """One call of the core."""
    check_share(level, "level")
    chosen = options(
        "ulna_indices_options",
        level=level,
        resamples=resamples,
        seed=seed,
        blocks=blocks,
        random=random,
        estimator=one_of(ESTIMATORS, estimator, "estimator"),
        interval=one_of(INTERVALS, interval, "interval"),
        on_failure=one_of(ON_FAILURE, on_failure, "on_failure"),
        threads=threads,
    )
    if interval in ("percentile", "bca") and resamples < 1:  # zero bytes would mean the default
        raise refuse(f"resamples is {resamples!r}; it must be at least 50", "resamples")
    outputs = np.ascontiguousarray(y, dtype=float)
    codes = ffi.NULL
    kept = None
    if status is not None:
        kept = np.ascontiguousarray(status, dtype=np.int32)
        if kept.shape != outputs.shape:
            raise refuse("status must hold one number a run", "status")
        codes = ffi.cast("const int32_t *", kept.__array_interface__["data"][0])
    out = ffi.new("ulna_indices **")
    call = lib.ulna_indices_of_effects if effects else lib.ulna_indices_of_variance
    long_call(call, design._handle.pointer, view(outputs), codes, chosen, ffi.NULL, out)
    handle = _Indices(out[0])
    info = result("ulna_indices_info")
    check(lib.ulna_indices_get_info(handle.pointer, info))

    def get(which: int, part: int) -> np.ndarray:
        return out_array(lib.ulna_indices_get_values, handle.pointer, which, part)

    wanted = {"mean": lib.ULNA_INDEX_MEAN, "variance": lib.ULNA_INDEX_VARIANCE}
    if effects:
        wanted |= {
            "mu": lib.ULNA_INDEX_MU,
            "mu_star": lib.ULNA_INDEX_MU_STAR,
            "sigma": lib.ULNA_INDEX_SIGMA,
        }
        if design.independent_steps:
            wanted["total"] = lib.ULNA_INDEX_TOTAL
    else:
        wanted |= {
            "first": lib.ULNA_INDEX_FIRST,
            "total": lib.ULNA_INDEX_TOTAL,
            "dummy_first": lib.ULNA_INDEX_DUMMY_FIRST,
            "dummy_total": lib.ULNA_INDEX_DUMMY_TOTAL,
        }
        if design.second_order:
            wanted["second"] = lib.ULNA_INDEX_SECOND
    return _Analysis(
        value={k: get(w, lib.ULNA_FIELD_VALUE) for k, w in wanted.items()},
        error={k: get(w, lib.ULNA_FIELD_ERROR) for k, w in wanted.items()},
        interval={
            k: np.column_stack([get(w, lib.ULNA_FIELD_LOW), get(w, lib.ULNA_FIELD_HIGH)])
            for k, w in wanted.items()
        },
        blocks=info.blocks,
        outcome="constant" if info.outcome == lib.ULNA_INDICES_CONSTANT else "good",
        failures=_failures(handle, info, design, on_failure) if info.failed_rows else None,
    )


def _failures(handle: Any, info: Any, design: StudyDesign, treatment: str) -> FailureReport:
    names = design.names

    def get(which: int) -> np.ndarray:
        return out_array(lib.ulna_indices_get_failures, handle.pointer, which)

    def indicator(which: int) -> dict[str, float]:
        values = out_array(
            lib.ulna_indices_get_values, handle.pointer, which, lib.ULNA_FIELD_VALUE
        )
        return dict(zip(names, values.tolist(), strict=False))

    by_status = {}
    for code, count in enumerate(get(lib.ULNA_FAILURES_BY_STATUS).astype(int).tolist()):
        if count:
            known = code < len(STATUSES)
            name = "nonfinite" if code == 0 else STATUSES[code] if known else f"status {code}"
            by_status[name] = by_status.get(name, 0) + count
    return FailureReport(
        rows=info.failed_rows,
        blocks=info.failed_blocks,
        by_status=by_status,
        base=info.failed_base,
        by_factor=dict(
            zip(names, get(lib.ULNA_FAILURES_BY_GROUP).astype(int).tolist(), strict=True)
        ),
        flip_share=dict(zip(names, get(lib.ULNA_FAILURES_FLIP_SHARE).tolist(), strict=True)),
        first=indicator(lib.ULNA_INDEX_FAILURE_FIRST),
        total=indicator(lib.ULNA_INDEX_FAILURE_TOTAL),
        treatment=treatment,
        surface_r2=info.surface_r2,
    )


@dataclass(frozen=True, eq=False)
class Convergence:
    """Indices from more and more of the runs.

    Attributes
    ----------
    names : tuple of str
    runs : ndarray
        Runs behind each size.
    values, low, high : dict of str to ndarray
        Of each kind of index ("first", "total" or "mu_star", "sigma"), (sizes, factors).
    level : float
    subset : str
        "prefix" (the first blocks) or "random" (a random choice).
    unit : str
        Of the values; empty for shares of the variance.
    """

    names: tuple[str, ...]
    runs: np.ndarray
    values: Mapping[str, np.ndarray]
    low: Mapping[str, np.ndarray]
    high: Mapping[str, np.ndarray]
    level: float
    subset: str
    unit: str = ""

    def plot(self, axes: Any = None) -> Any:
        """Indices over the number of runs (needs matplotlib)."""
        from . import plot

        return plot.convergence(self, axes)


def _sizes(n: int, sizes: Sequence[int] | None, powers: bool) -> list[int]:
    if sizes is not None:
        return [int(size) for size in sizes]
    if powers:
        start = max(2, n // 64)
        return [start << k for k in range(20) if start << k <= n]
    return sorted({max(2, round(n * share)) for share in np.linspace(0.1, 1.0, 10)})


def converge(
    design: StudyDesign,
    again: Callable[..., _Analysis],
    kinds: tuple[str, ...],
    sizes: Sequence[int] | None,
    subset: str | None,
    level: float,
    unit: str = "",
) -> Convergence:
    """Analyses of subsets, one after the other."""
    sequence = design.sampler == "sobol" and design.scheme != "trajectories"
    subset = subset or ("prefix" if sequence else "random")
    if subset not in ("prefix", "random"):
        raise refuse(f"subset is {subset!r}; it must be 'prefix' or 'random'", "subset")
    chosen = _sizes(design.n, sizes, sequence)
    analysed = {}
    for size in chosen:
        try:
            analysed[size] = again(blocks=size, random=subset == "random")
        except DataError:
            # Where runs failed a small part may have too few complete blocks.
            if sizes is not None or size == chosen[-1]:
                raise
    parts = list(analysed.values())
    return Convergence(
        names=design.names,
        runs=np.array(list(analysed)) * design.replicates * design.block_rows,
        values={kind: np.array([part.value[kind] for part in parts]) for kind in kinds},
        low={kind: np.array([part.interval[kind][:, 0] for part in parts]) for kind in kinds},
        high={kind: np.array([part.interval[kind][:, 1] for part in parts]) for kind in kinds},
        level=level,
        subset=subset,
        unit=unit,
    )


def _row(name: str, width: int, *cells: str) -> str:
    return f"  {name:<{width}}  " + "  ".join(cells)


def _cell(value: float, interval: np.ndarray) -> str:
    if np.isnan(interval).any():
        return f"{value:8.3f}" + " " * 18
    return f"{value:8.3f} ({interval[0]:6.3f}, {interval[1]:6.3f})"


@dataclass(frozen=True, eq=False)
class SobolIndices:
    """Variance-based indices of a study's output.

    Attributes
    ----------
    names : tuple of str
        Of the factors, or of the groups.
    first, total : ndarray, shape (K,)
        First- and total-order index. Nothing is clipped: one below zero shows the error.
    second : ndarray, shape (K, K), or None
        Second-order index of each pair, symmetric, NaN on the diagonal.
    intervals : dict of str to ndarray, shape (K, 2)
        Of "first" and "total"; "second" is (K, K, 2).
    errors : dict of str to ndarray
        Standard errors.
    dummy : dict of str to (float, float, float)
        "first" and "total" of a factor that does nothing, with the interval: the noise of the
        estimator. The default estimator gives exactly 0.
    mean, variance : float
        Of the output; `intervals` has theirs too.
    level : float
    estimator, interval : str
    blocks : int
        Base points that the estimates rest on.
    outcome : str
        "good", or "constant" when the output does not vary (indices are NaN).
    failures : FailureReport or None
    design : StudyDesign
    output : str
    """

    names: tuple[str, ...]
    first: np.ndarray
    total: np.ndarray
    second: np.ndarray | None
    intervals: Mapping[str, np.ndarray]
    errors: Mapping[str, np.ndarray]
    dummy: Mapping[str, tuple[float, float, float]]
    mean: float
    variance: float
    level: float
    estimator: str
    interval: str
    blocks: int
    outcome: str
    failures: FailureReport | None
    design: StudyDesign = field(repr=False)
    output: str = "y"
    _again: Callable[..., _Analysis] | None = field(default=None, repr=False)

    @property
    def ranking(self) -> tuple[str, ...]:
        """Names by their total-order index, the largest first."""
        return tuple(self.names[i] for i in np.argsort(-self.total, kind="stable"))

    def convergence(
        self, *, sizes: Sequence[int] | None = None, subset: str | None = None
    ) -> Convergence:
        """The same analysis of more and more blocks.

        Parameters
        ----------
        sizes : sequence of int, optional
            Blocks of each replicate; powers of two for a sequence, tenths otherwise, but for those
            that failed runs leave fewer than two complete blocks of.
        subset : str, optional
            "prefix" for a sequence, "random" otherwise.
        """
        return converge(
            self.design, self._again, ("first", "total"), sizes, subset, self.level
        )

    def to_salib(self) -> dict[str, np.ndarray]:
        """The indices as SALib names them; half widths of the intervals as S1_conf, ST_conf.

        Second-order indices stand above the diagonal, as there.
        """
        half = {k: 0.5 * (v[..., 1] - v[..., 0]) for k, v in self.intervals.items()}
        out = {
            "S1": self.first.copy(),
            "S1_conf": half["first"],
            "ST": self.total.copy(),
            "ST_conf": half["total"],
        }
        if self.second is not None:
            lower = np.tril_indices(len(self.names))
            out["S2"], out["S2_conf"] = self.second.copy(), half["second"].copy()
            out["S2"][lower] = out["S2_conf"][lower] = np.nan
        return out

    def summary(self) -> str:
        """A table of the indices in at most 80 columns."""
        width = max(6, *(len(name) for name in self.names))
        words = {"percentile": "bootstrap", "bca": "BCa bootstrap", "replicates": "replicates"}
        how = words.get(self.interval)
        lines = [
            f"Variance-based indices of {self.output}: {self.design.rows} runs, "
            f"{self.blocks} base points",
            f"  estimator {self.estimator}; "
            + (f"{100 * self.level:g} % intervals ({how})" if how else "no intervals"),
            f"  mean {self.mean:.6g}, standard deviation {np.sqrt(max(self.variance, 0.0)):.6g}",
            "",
            _row("factor", width, f"{'first order':<26}", "total order"),
        ]
        for i, name in enumerate(self.names):
            lines.append(
                _row(
                    name,
                    width,
                    _cell(self.first[i], self.intervals["first"][i]),
                    _cell(self.total[i], self.intervals["total"][i]).rstrip(),
                )
            )
        lines.append(_row("sum", width, f"{self.first.sum():8.3f}{'':18}", f"{self.total.sum():8.3f}"))
        if self.second is not None:
            lines += ["", "  pairs, the largest second-order index first"]
            rows, columns = np.triu_indices(len(self.names), 1)
            order = np.argsort(-np.abs(self.second[rows, columns]), kind="stable")[:5]
            for at in order:
                i, j = rows[at], columns[at]
                pair = f"{self.names[i]} x {self.names[j]}"
                cell = _cell(self.second[i, j], self.intervals["second"][i, j])
                lines.append(f"  {pair:<{max(width, 20)}}  {cell}".rstrip())
        if self.outcome == "constant":
            lines += ["", "  the output does not vary: the indices are not defined"]
        if self.failures is not None:
            lines += ["", self.failures.summary()]
        return "\n".join(lines)

    def plot(self, axes: Any = None) -> Any:
        """First- and total-order indices with their intervals (needs matplotlib)."""
        from . import plot

        return plot.sobol_indices(self, axes)

    def __repr__(self) -> str:
        if self.outcome == "constant":
            return f"<SobolIndices of {self.output}: the output does not vary>"
        parts = ", ".join(
            f"{name} {self.total[i]:.3g} ± {self.errors['total'][i]:.2g}"
            for i, name in list(enumerate(self.names))[:4]
        )
        more = ", ..." if len(self.names) > 4 else ""
        return f"<SobolIndices of {self.output}, total order: {parts}{more}>"


@dataclass(frozen=True, eq=False)
class Screening:
    """Elementary effects of a study's output, per unit of quantile.

    Attributes
    ----------
    names : tuple of str
    mu, mu_star, sigma : ndarray, shape (K,)
        Mean, mean magnitude and standard deviation (with r - 1) of the effects, in the unit of the
        output; mu and sigma are NaN for groups of several factors.
    intervals, errors : dict of str to ndarray
        Of "mu", "mu_star", "sigma".
    mean, variance : float
        Of the output at the first rows of the blocks.
    level, interval, blocks, outcome, failures, design, output
        As of `SobolIndices`.
    unit : str
        Of the output.
    """

    names: tuple[str, ...]
    mu: np.ndarray
    mu_star: np.ndarray
    sigma: np.ndarray
    intervals: Mapping[str, np.ndarray]
    errors: Mapping[str, np.ndarray]
    mean: float
    variance: float
    level: float
    interval: str
    blocks: int
    outcome: str
    failures: FailureReport | None
    design: StudyDesign = field(repr=False)
    output: str = "y"
    _total: np.ndarray | None = field(default=None, repr=False)
    _again: Callable[..., _Analysis] | None = field(default=None, repr=False)
    unit: str = ""

    @property
    def total(self) -> np.ndarray:
        """Jansen's total-order index, from radial steps without a guard.

        A guarded step or one on a grid depends on where it starts; the total index would be wrong
        and is refused.
        """
        if self._total is None:
            raise refuse(
                "total indices need steps whose two points are independent: screen with "
                "scheme='radial' and guard=0, or use Study.sobol",
                "guard",
            )
        return self._total

    @property
    def ranking(self) -> tuple[str, ...]:
        """Names by mu_star, the largest first."""
        return tuple(self.names[i] for i in np.argsort(-self.mu_star, kind="stable"))

    def negligible(self, *, share: float = 0.05) -> tuple[str, ...]:
        """Factors whose mu_star, at the high end of its interval, is below a share of the largest."""
        high = self.intervals["mu_star"][:, 1]
        bound = np.where(np.isnan(high), self.mu_star, high)
        return tuple(
            name for name, b in zip(self.names, bound, strict=True) if b < share * max(self.mu_star)
        )

    def convergence(
        self, *, sizes: Sequence[int] | None = None, subset: str | None = None
    ) -> Convergence:
        """The same analysis of more and more repetitions; see `SobolIndices.convergence`."""
        return converge(
            self.design, self._again, ("mu_star", "sigma"), sizes, subset, self.level, self.unit
        )

    def to_salib(self) -> dict[str, Any]:
        """The effects as SALib names them; the half width of mu_star's interval as mu_star_conf."""
        interval = self.intervals["mu_star"]
        return {
            "names": list(self.names),
            "mu": self.mu.copy(),
            "mu_star": self.mu_star.copy(),
            "sigma": self.sigma.copy(),
            "mu_star_conf": 0.5 * (interval[:, 1] - interval[:, 0]),
        }

    def summary(self) -> str:
        """A table of the effects in at most 80 columns."""
        width = max(6, *(len(name) for name in self.names))
        steps = "trajectories" if self.design.scheme == "trajectories" else "radial steps"
        lines = [
            f"Elementary effects of {self.output}: {self.design.rows} runs, "
            f"{self.blocks} repetitions ({steps})",
            f"  per unit of quantile; {100 * self.level:g} % intervals of mu*"
            if self.interval != "none"
            else "  per unit of quantile",
            "",
            _row("factor", width, f"{'mu*':>10}", f"{'interval':>23}", f"{'mu':>10}", f"{'sigma':>10}"),
        ]
        for i, name in enumerate(self.names):
            low, high = self.intervals["mu_star"][i]
            interval = "" if np.isnan(low) else f"({low:.4g}, {high:.4g})"
            lines.append(
                _row(
                    name,
                    width,
                    f"{self.mu_star[i]:10.4g}",
                    f"{interval:>23}",
                    f"{self.mu[i]:10.4g}",
                    f"{self.sigma[i]:10.4g}",
                )
            )
        if self.outcome == "constant":
            lines += ["", "  the output does not vary"]
        if self.failures is not None:
            lines += ["", self.failures.summary()]
        return "\n".join(lines)

    def plot(self, axes: Any = None) -> Any:
        """mu* and sigma of each factor with their intervals (needs matplotlib)."""
        from . import plot

        return plot.screening(self, axes)

    def __repr__(self) -> str:
        parts = ", ".join(
            f"{name} {self.mu_star[i]:.3g} ± {self.errors['mu_star'][i]:.2g}"
            for i, name in list(enumerate(self.names))[:4]
        )
        more = ", ..." if len(self.names) > 4 else ""
        return f"<Screening of {self.output}, mu*: {parts}{more}>"
