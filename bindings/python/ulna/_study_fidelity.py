"""A study of a cheap model, corrected by some runs of the full one: control variates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ._call import DataError
from ._study_design import check_share
from ._study_indices import _cell, _row
from ._study_run import NOT_RUN
from .record import refuse

if TYPE_CHECKING:
    from ._study_design import StudyDesign
    from .study import Runs

__all__ = ["MultiFidelity", "multi_fidelity"]

# Below, the coefficients of the control variates are little more than noise.
_FEWEST_BLOCKS = 20


@dataclass(frozen=True, eq=False)
class MultiFidelity:
    """Estimates for the full model from its few runs and the many of a cheap one.

    Attributes
    ----------
    names : tuple of str
        Of the factors, or of the groups.
    value : dict of str to float or ndarray
        "mean" and "variance" of the full model's output; of a saltelli design also "first" and
        "total", (K,). Nothing is clipped.
    intervals, errors : dict of str to ndarray
        Of the same: (2,) or (K, 2), and standard errors.
    alone : dict of str to float or ndarray
        From the full model's runs only.
    alone_intervals, alone_errors : dict of str to ndarray
    cheap : dict of str to float or ndarray
        Of the cheap model, from all of its runs.
    correlation : float
        Between the outputs of the two models, over the runs that both have.
    blocks, cheap_blocks : int
        Blocks of the design that both models have, and that the cheap one has.
    dropped : int
        Blocks that were left out because a run in them failed.
    level : float
        Of the intervals.
    output, unit : str
    """

    names: tuple[str, ...]
    value: Mapping[str, Any]
    intervals: Mapping[str, np.ndarray]
    errors: Mapping[str, Any]
    alone: Mapping[str, Any]
    alone_intervals: Mapping[str, np.ndarray]
    alone_errors: Mapping[str, Any]
    cheap: Mapping[str, Any]
    correlation: float
    blocks: int
    cheap_blocks: int
    dropped: int
    level: float
    output: str = "y"
    unit: str = ""
    block_rows: int = field(default=1, repr=False)

    @property
    def gain(self) -> Mapping[str, Any]:
        """How many times as many runs of the full model would tell as much without the cheap one."""
        with np.errstate(invalid="ignore", divide="ignore"):  # of a factor that does nothing: NaN
            return {name: (self.alone_errors[name] / self.errors[name]) ** 2 for name in self.value}

    @property
    def ranking(self) -> tuple[str, ...]:
        """Names by their total-order index, the largest first; empty without indices."""
        if "total" not in self.value:
            return ()
        return tuple(self.names[i] for i in np.argsort(-self.value["total"], kind="stable"))

    def summary(self) -> str:
        """A table in at most 80 columns."""
        unit = f" {self.unit}" if self.unit else ""
        rows = self.block_rows
        lines = [
            f"{self.output} of the full model: {self.blocks * rows} runs, and "
            f"{self.cheap_blocks * rows} of the cheap one (correlation {self.correlation:.3f})",
            f"  {100 * self.level:g} % intervals (bootstrap)"
            + (f"; {self.dropped} blocks with failed runs left out" if self.dropped else ""),
            f"  mean {self.value['mean']:.4g}{unit} "
            f"({self.intervals['mean'][0]:.4g}, {self.intervals['mean'][1]:.4g}); "
            f"cheap model alone {self.cheap['mean']:.4g}",
            f"  standard deviation {_root(self.value['variance']):.4g}{unit} "
            f"({_root(self.intervals['variance'][0]):.4g}, "
            f"{_root(self.intervals['variance'][1]):.4g}); "
            f"cheap model alone {_root(self.cheap['variance']):.4g}",
        ]
        width = max(6, *(len(name) for name in self.names))
        for kind, title in (("first", "first order"), ("total", "total order")):
            if kind not in self.value:
                continue
            lines += [
                "",
                _row(title, max(width, len(title)), f"{'combined':<26}", "full alone, cheap alone"),
            ]
            for i, name in enumerate(self.names):
                lines.append(
                    _row(
                        name,
                        max(width, len(title)),
                        _cell(self.value[kind][i], self.intervals[kind][i]),
                        f"{self.alone[kind][i]:8.3f} {self.cheap[kind][i]:8.3f}",
                    )
                )
        return "\n".join(lines)

    def plot(self, axes: Any = None) -> Any:
        """Indices of the full model, combined and alone, beside the cheap one's (needs matplotlib)."""
        from . import plot

        return plot.fidelity(self, axes)

    def __repr__(self) -> str:
        return (
            f"<MultiFidelity {self.output}: {self.blocks} of {self.cheap_blocks} blocks in full, "
            f"correlation {self.correlation:.3f}>"
        )


def _root(variance: float) -> float:
    return float(np.sqrt(max(variance, 0.0)))


def multi_fidelity(
    low: Runs,
    high: Runs,
    *,
    output: str | None = None,
    level: float = 0.9,
    resamples: int = 1000,
    on_failure: str = "error",
    seed: int = 0,
) -> MultiFidelity:
    """Mean, variance and indices of a full model: its few runs, corrected by many of a cheap one.

    Every partial variance is a mean over blocks of the design. The mean of the full model's few
    blocks gets a multiple of what the cheap model's mean over all blocks differs from that over the
    same few; the multiple is the regression coefficient between the two over the common blocks
    (multi-fidelity Monte Carlo: Qian, Peherstorfer, O'Malley, Vesselinov and Willcox, SIAM/ASA J.
    Uncertainty Quantification 6, 2018). For the mean, the variance of the estimate falls by
    1 − ρ² (1 − m/n), with ρ the correlation of the models and m of n blocks in common. A wrong cheap
    model costs precision, not correctness.

    Parameters
    ----------
    low : Runs
        Of the cheap model, all rows of a saltelli design (indices) or a sample (mean, variance).
    high : Runs
        Of the full model on some blocks of the same design: of a sequence or independent points the
        first ones, by a design of smaller `n`; of a hypercube any, by ``shard=(1, 10)`` for every
        tenth, or as far as `budget_s` lets it come.
    output : str, optional
        The first one of `low` by default; both must have it.
    level : float
        Of the intervals, from a bootstrap of blocks. Of a Latin hypercube or a sequence they are
        usually too wide, as the bootstrap does not see how even the points are; of few points of a
        sequence they can be too narrow.
    resamples : int
    on_failure : str
        "error", or "drop_block": blocks with a failed run of either model are left out.
    seed : int
        Of the bootstrap.

    Raises
    ------
    DataError
        When fewer than twenty whole blocks were run in full, or others than the first of a sequence.

    Examples
    --------
    >>> import ulna
    >>> factors = {"a": ulna.Uniform(0, 1), "b": ulna.Uniform(0, 1)}
    >>> cheap = ulna.Study(factors, lambda a, b: 2 * a + b)
    >>> full = ulna.Study(factors, lambda a, b: 2 * a + b + 4 * a * b)
    >>> many, few = cheap.run(cheap.design(n=512, seed=1)), full.run(full.design(n=64, seed=1))
    >>> ulna.study.multi_fidelity(many, few)
    <MultiFidelity y: 64 of 512 blocks in full, correlation 0.959>
    """
    check_share(level, "level")
    if not isinstance(resamples, int) or resamples < 50:
        raise refuse(f"resamples is {resamples!r}; it must be at least 50", "resamples")
    if on_failure not in ("error", "drop_block"):
        raise refuse(
            f"on_failure is {on_failure!r}; it must be 'error' or 'drop_block'", "on_failure"
        )
    _check_designs(low, high)
    name = low.outputs[low._place(output)]
    cheap, cheap_state = _blocks(low, low.output(name))
    full, full_state = _blocks(high, high.output(name))
    more = len(cheap) - len(full)
    full = np.pad(full, ((0, more), (0, 0)))
    full_state = np.pad(full_state, (0, more), constant_values=_MISSING)
    _check_part(low.design, full_state)
    failed = (cheap_state == _FAILED) | (full_state == _FAILED)
    if failed.any() and on_failure == "error":
        raise _refused(
            f"{failed.sum()} blocks hold a failed run; choose on_failure 'drop_block' to leave them "
            "out",
            "on_failure",
        )
    known = cheap_state == _WHOLE
    both = known & (full_state == _WHOLE)
    if both.sum() < _FEWEST_BLOCKS:
        raise _refused(
            f"{both.sum()} whole blocks of the design were run by both models; it takes "
            f"{_FEWEST_BLOCKS}",
            "high",
        )
    rest = cheap[known & ~both & ~failed]
    cheap, full = cheap[both], full[both]
    count = len(low.design.names) if low.design.scheme == "saltelli" else 0
    random = np.random.Generator(np.random.Philox(seed))
    draws, alone_draws = [], []
    for _ in range(resamples):
        m = random.integers(len(full), size=len(full))
        n = random.integers(len(rest), size=len(rest)) if len(rest) else slice(None)
        draws.append(_combined(full[m], cheap[m], rest[n], count))
        alone_draws.append(_combined(full[m], None, None, count))
    value = _combined(full, cheap, rest, count)
    alone = _combined(full, None, None, count)
    intervals, errors = _spread(draws, level)
    alone_intervals, alone_errors = _spread(alone_draws, level)
    return MultiFidelity(
        names=low.design.names,
        value=value,
        intervals=intervals,
        errors=errors,
        alone=alone,
        alone_intervals=alone_intervals,
        alone_errors=alone_errors,
        cheap=_combined(np.concatenate([cheap, rest]), None, None, count),
        correlation=float(np.corrcoef(full.ravel(), cheap.ravel())[0, 1]),
        blocks=len(full),
        cheap_blocks=len(cheap) + len(rest),
        dropped=int(failed.sum()),
        level=level,
        output=name,
        unit=low.units.get(name, ""),
        block_rows=low.design.block_rows,
    )


_WHOLE, _FAILED, _MISSING = 0, 1, 2


def _refused(words: str, argument: str) -> DataError:
    return DataError(words, status="ULNA_ERROR_DATA", argument=argument, detail="")


def _check_designs(low: Runs, high: Runs) -> None:
    one, other = low.design, high.design
    if one.scheme not in ("saltelli", "sample"):
        raise refuse(f"the design is {one.scheme}; it must be saltelli or a sample", "low")
    same = (
        (one.scheme, one.names, one.block_rows, one.replicates)
        == (other.scheme, other.names, other.block_rows, other.replicates)
        and one.has_points == other.has_points
        and (one.n == other.n or (one.n > other.n and one.replicates == 1))
    )
    if same and one.has_points:
        same = np.array_equal(one.values(count=other.rows), other.values())
    if not same:
        raise refuse(
            f"the runs of the full model, {other!r}, are not on rows of the cheap one's, {one!r}",
            "high",
        )


def _check_part(design: StudyDesign, state: np.ndarray) -> None:
    """Of a sequence, which blocks were run in full? Every n-th point of it lies in a corner."""
    if design.sampler != "sobol":
        return
    for part in np.split(state, design.replicates):
        run = np.flatnonzero(part != _MISSING)
        if run.size and run[-1] != run.size - 1:
            raise _refused(
                "the full model was run on some blocks of a Sobol' sequence that are not its first "
                "ones, which are no fair part of it: run a design of smaller n, or use sampler "
                "'latin'",
                "high",
            )


def _blocks(runs: Runs, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Outputs, a block a row, and what is known of each block."""
    shape = (-1, runs.design.block_rows)
    missing = (runs.status == NOT_RUN).reshape(shape).any(axis=1)
    failed = (((runs.status != 0) | ~np.isfinite(y)) & (runs.status != NOT_RUN)).reshape(shape)
    state = np.where(failed.any(axis=1), _FAILED, np.where(missing, _MISSING, _WHOLE))
    return y.reshape(shape), state


def _parts(y: np.ndarray, centre: float, count: int) -> np.ndarray:
    """What is averaged over blocks: variance, then the first-order and total parts of `count` factors."""
    if count == 0:
        return (y - centre) ** 2
    # A, then A with a column of B, ..., (B with a column of A, ..., of pairs,) then B.
    a, b, moved = y[:, :1], y[:, -1:], y[:, 1 : 1 + count]
    return np.column_stack(
        [
            0.5 * ((a - centre) ** 2 + (b - centre) ** 2),
            (b - centre) * (moved - a),
            0.5 * (moved - a) ** 2,
        ]
    )


def _ends(y: np.ndarray) -> np.ndarray:
    """Mean output of the first and the last row of a block, which are a plain sample."""
    return 0.5 * (y[:, :1] + y[:, -1:])


def _controlled(full: np.ndarray, cheap: np.ndarray, rest: np.ndarray) -> np.ndarray:
    """Means of the full model's columns, corrected by the cheap model's."""
    more = len(rest) / (len(cheap) + len(rest))
    if more == 0.0:
        return full.mean(axis=0)
    deviation = cheap - cheap.mean(axis=0)
    spread = np.sum(deviation**2, axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        slope = np.sum(deviation * full, axis=0) / spread
    slope = np.where(spread > 0.0, slope, 0.0)
    return full.mean(axis=0) + slope * more * (rest.mean(axis=0) - cheap.mean(axis=0))


def _combined(
    full: np.ndarray, cheap: np.ndarray | None, rest: np.ndarray | None, count: int
) -> dict[str, Any]:
    """Mean, variance and indices; without a cheap model those of the full one alone."""
    if cheap is None or rest is None:
        mean = float(_ends(full).mean())
        parts = _parts(full, mean, count).mean(axis=0)
    else:
        mean = float(_controlled(_ends(full), _ends(cheap), _ends(rest))[0])
        # The cheap model is centred by its own mean: what it corrects with is a variance, too.
        centre = float(np.concatenate([_ends(cheap), _ends(rest)]).mean())
        parts = _controlled(
            _parts(full, mean, count), _parts(cheap, centre, count), _parts(rest, centre, count)
        )
    out: dict[str, Any] = {"mean": mean, "variance": float(parts[0])}
    if count:
        with np.errstate(invalid="ignore", divide="ignore"):
            out["first"] = parts[1 : 1 + count] / parts[0]
            out["total"] = parts[1 + count :] / parts[0]
    return out


def _spread(draws: list[dict[str, Any]], level: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """Percentile intervals and standard errors."""
    ends = 0.5 * (1.0 - level), 0.5 * (1.0 + level)
    intervals, errors = {}, {}
    for name in draws[0]:
        all_of = np.array([draw[name] for draw in draws])
        intervals[name] = np.moveaxis(np.quantile(all_of, ends, axis=0), 0, -1)
        errors[name] = all_of.std(axis=0, ddof=1)
    return intervals, errors
