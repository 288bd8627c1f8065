"""Screen, fix, rank: the two-phase scheme of Tesfazgi et al. with its decision in the open."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from .record import refuse

if TYPE_CHECKING:
    from ._study_design import StudyDesign
    from ._study_indices import Screening, SobolIndices
    from .study import Runs, Study

__all__ = ["TwoPhase"]


@dataclass(frozen=True)
class Fixed:
    """A function with some of its factors at fixed values."""

    function: Callable[..., Any]
    fixed: Mapping[str, float]

    @property
    def rows_at_once(self) -> int:
        """Rows that the function takes at once."""
        return int(getattr(self.function, "rows_at_once", 4096))

    def prepare(self) -> None:
        """Load the function before the first run, where that is something to do."""
        prepare = getattr(self.function, "prepare", None)
        if prepare is not None:
            prepare()

    def __call__(self, **named: Any) -> Any:
        if named and all(isinstance(value, np.ndarray) for value in named.values()):
            size = len(next(iter(named.values())))
            return self.function(
                **named, **{name: np.full(size, value) for name, value in self.fixed.items()}
            )
        return self.function(**named, **self.fixed)


@dataclass(frozen=True, eq=False)
class TwoPhase:
    """A screening, what was fixed because of it, and the ranking of the rest.

    Attributes
    ----------
    screening : dict of str to Screening
        Of each output.
    ranking : dict of str to SobolIndices
        Of each output; empty when fewer than two factors are left.
    fixed : dict of str to float
        Factors that were fixed, and where.
    share : float
        Of the largest mu*: what a factor's mu* must stay below, with its interval, for all outputs
        that decide.
    decided_by : tuple of str
        These outputs.
    kept : tuple of str
        Factors or groups in the ranking.
    screening_runs, ranking_runs : Runs
    """

    screening: Mapping[str, Screening]
    ranking: Mapping[str, SobolIndices]
    fixed: Mapping[str, float]
    share: float
    kept: tuple[str, ...]
    decided_by: tuple[str, ...]
    screening_runs: Runs = field(repr=False)
    ranking_runs: Runs | None = field(default=None, repr=False)
    groups: Mapping[str, str] | None = field(default=None, repr=False)

    def decisions(self) -> list[tuple[str, float, float, str]]:
        """Of each factor or group: its name, the high end of mu* and mu*, as shares of the largest
        mu* (the larger of all outputs that decide), and what became of it.
        """
        return [
            (name, bound, value, "ranked" if name in self.kept else "fixed")
            for name, (bound, value) in _shares(
                {output: self.screening[output] for output in self.decided_by}
            ).items()
        ]

    def summary(self) -> str:
        """Both phases and the decision between them, in at most 80 columns."""
        parts = ["Phase 1: screening"]
        parts += [one.summary() for one in self.screening.values()]
        width = max(6, *(len(row[0]) for row in self.decisions()))
        by = "" if len(self.decided_by) == len(self.screening) else f" of {', '.join(self.decided_by)}"
        lines = [
            f"Decision: fix what stays below {100 * self.share:g} % of the largest mu*{by}",
            f"  {'factor':<{width}}  {'mu*':>8}  {'at most':>8}  decision",
        ]
        for name, bound, value, word in self.decisions():
            at = [
                f"{member} = {number:.6g}"
                for member, number in self.fixed.items()
                if (self.groups or {}).get(member, member) == name
            ]
            where = f" at {', '.join(at)}" if at else ""
            lines.append(
                f"  {name:<{width}}  {100 * value:6.1f} %  {100 * bound:6.1f} %  {word}{where}"
            )
        parts.append("\n".join(lines))
        if self.ranking:
            parts.append("Phase 2: ranking")
            parts += [one.summary() for one in self.ranking.values()]
        else:
            parts.append("Phase 2: nothing to rank, one factor is left")
        return "\n\n".join(parts)

    def plot(self, axes: Any = None, *, output: str | None = None) -> Any:
        """The decision: mu* as shares of the largest, and the line (needs matplotlib)."""
        from . import plot

        return plot.fixing(self, axes, output=output)

    def __repr__(self) -> str:
        fixed = ", ".join(self.fixed) or "nothing"
        first = next(iter(self.ranking.values()), None)
        ranked = ", ".join(self.kept) if first is None else repr(first)
        return f"<TwoPhase: fixed {fixed}; {ranked}>"


def _shares(screening: Mapping[str, Screening]) -> dict[str, tuple[float, float]]:
    """High end of mu* and mu* over the largest mu*, the larger of all outputs."""
    out: dict[str, tuple[float, float]] = {}
    for one in screening.values():
        largest = float(np.max(one.mu_star))
        high = one.intervals["mu_star"][:, 1]
        bound = np.where(np.isnan(high), one.mu_star, high)
        for name, b, value in zip(one.names, bound, one.mu_star, strict=True):
            # Of an output that does not vary every share is nothing.
            pair = (float(b) / largest, float(value) / largest) if largest > 0 else (0.0, 0.0)
            before = out.get(name, (0.0, 0.0))
            out[name] = (max(before[0], pair[0]), max(before[1], pair[1]))
    return out


def two_phase(
    study: Study,
    *,
    r: int,
    n: int,
    share: float,
    seed: int,
    keep: Sequence[str],
    decide_by: Sequence[str],
    values: Mapping[str, float] | None,
    on_failure: str,
    screening: Mapping[str, Any] | None,
    ranking: Mapping[str, Any] | None,
    execute: Callable[[Study, StudyDesign, str], Runs],
) -> TwoPhase:
    """Both phases; see `Study.two_phase`. `execute` runs a design, of the phase of this name."""
    if isinstance(keep, str) or set(keep) - set(study.factors):
        raise refuse("keep must be names of factors", "keep")
    if isinstance(decide_by, str) or set(decide_by) - set(study.outputs):
        raise refuse("decide_by must be names of outputs", "decide_by")
    deciding = tuple(name for name in study.outputs if name in (decide_by or study.outputs))
    values = dict(values or {})
    if set(values) - set(study.factors):
        raise refuse(f"there is no factor {min(set(values) - set(study.factors))!r}", "values")
    first = dict(screening or {})
    chosen = {
        k: first.pop(k) for k in ("scheme", "sampler", "guard", "levels", "replicates") if k in first
    }
    design = study.design(
        **{"scheme": "radial", "sampler": "latin", "n": r, "seed": seed, **chosen}
    )
    runs = execute(study, design, "screen")
    screened = {
        name: runs.screen(output=name, on_failure=on_failure, seed=seed, **first)
        for name in study.outputs
    }
    fixed, kept = decide(
        study, {name: screened[name] for name in deciding}, share=share, keep=keep, values=values
    )
    if len(kept) < 2:
        return TwoPhase(screened, {}, fixed, share, kept, deciding, runs, groups=study.groups)
    rest = study.fix(**fixed) if fixed else study
    second = dict(ranking or {})
    chosen = {
        k: second.pop(k) for k in ("sampler", "second_order", "replicates", "dummy") if k in second
    }
    design = rest.design(
        **{"scheme": "saltelli", "sampler": "sobol", "n": n, "seed": seed, **chosen}
    )
    ranked_runs = execute(rest, design, "rank")
    ranked = {
        name: ranked_runs.sobol(output=name, on_failure=on_failure, seed=seed, **second)
        for name in study.outputs
    }
    return TwoPhase(
        screened, ranked, fixed, share, kept, deciding, runs, ranked_runs, groups=study.groups
    )


def decide(
    study: Study,
    screening: Mapping[str, Screening],
    *,
    share: float,
    keep: Sequence[str] = (),
    values: Mapping[str, float] | None = None,
) -> tuple[dict[str, float], tuple[str, ...]]:
    """Factors that are fixed and where; names of the factors or groups that are ranked."""
    if not 0.0 < share < 1.0:
        raise refuse(f"share is {share!r}; it must lie between 0 and 1", "share")
    if all(one.outcome == "constant" for one in screening.values()):
        raise refuse("no output varies in the screening: there is nothing to rank", "outputs")
    groups = study.groups or {}
    shares = _shares(screening)
    held = {groups.get(name, name) for name in keep}
    lost = {name for name, (bound, _) in shares.items() if bound < share and name not in held}
    fixed = {
        name: float((values or {}).get(name, factor.quantile(0.5)))
        for name, factor in study.factors.items()
        if groups.get(name, name) in lost
    }
    return fixed, tuple(name for name in shares if name not in lost)
