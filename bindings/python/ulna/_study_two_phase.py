"""Screen, fix, rank: the two-phase scheme of Tesfazgi et al. with its decision in the open."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np

from ._study_design import check_names, check_share
from ._study_indices import OPTIONS
from .record import refuse

if TYPE_CHECKING:
    from ._study_design import StudyDesign
    from ._study_indices import Screening, SobolIndices
    from .study import Runs, Study

__all__ = ["TwoPhase"]

# What of `screening` and of `ranking` is the design's; the rest is the analysis's.
_OF_SCREENING = ("scheme", "sampler", "guard", "levels", "replicates")
_OF_RANKING = ("sampler", "second_order", "replicates", "dummy")


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


@dataclass(frozen=True)
class Phases:
    """Both phases before the first run, checked.

    Attributes
    ----------
    screening : StudyDesign
    ranking : dict
        Of the second design, whose factors only the first phase tells.
    screen, sobol : dict
        Options of the analyses.
    """

    screening: StudyDesign
    ranking: Mapping[str, Any]
    screen: Mapping[str, Any]
    sobol: Mapping[str, Any]


def phases(
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
) -> Phases:
    """Refuse what is wrong before anything is run; see `Study.two_phase`."""
    check_share(share, "share")
    _check_chosen(keep, study.factors, "keep must be names of factors", "keep")
    _check_chosen(decide_by, study.outputs, "decide_by must be names of outputs", "decide_by")
    _check_values(values or {}, study)
    first, screen = _parted(screening, _OF_SCREENING, "screen", "screening")
    second, sobol = _parted(ranking, _OF_RANKING, "sobol", "ranking")
    treat = {"on_failure": on_failure, "seed": seed}
    found = Phases(
        study.design(**{"scheme": "radial", "sampler": "latin", "n": r, "seed": seed, **first}),
        {"scheme": "saltelli", "sampler": "sobol", "n": n, "seed": seed, **second},
        {**treat, **screen},
        {**treat, **sobol},
    )
    study._rehearse(found.screening, "screen", found.screen)
    if len(found.screening.names) > 1:
        study._rehearse(study.design(**found.ranking), "sobol", found.sobol)
    return found


def _check_chosen(given: Any, known: Any, words: str, argument: str) -> None:
    try:
        good = not isinstance(given, str) and set(given) <= set(known)
    except TypeError:
        good = False
    if not good:
        raise refuse(words, argument)


def _check_values(values: Any, study: Study) -> None:
    if not isinstance(values, Mapping):
        raise refuse("values must map factors to where they are fixed", "values")
    for name, value in values.items():
        if name not in study.factors:
            raise refuse(f"there is no factor {name!r}", "values")
        if not (isinstance(value, Real) and np.isfinite(value)):
            raise refuse(f"{name} is to be fixed at {value!r}, which is no number", "values")


def _parted(
    given: Mapping[str, Any] | None, own: tuple[str, ...], analysis: str, argument: str
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Options of a phase's design, and of its analysis."""
    options = dict(given or {})
    check_names(options, (*own, *OPTIONS[analysis]), f"{argument}: ")
    chosen = {name: options.pop(name) for name in own if name in options}
    return chosen, options


def two_phase(
    study: Study,
    *,
    execute: Callable[[Study, StudyDesign, str], Runs],
    **chosen: Any,
) -> TwoPhase:
    """Both phases; see `phases`. `execute` runs a design, of the phase of this name."""
    planned = phases(study, **chosen)
    share, keep, values = chosen["share"], chosen["keep"], chosen["values"]
    deciding = tuple(
        name for name in study.outputs if name in (chosen["decide_by"] or study.outputs)
    )
    runs = execute(study, planned.screening, "screen")
    screened = {name: runs.screen(output=name, **planned.screen) for name in study.outputs}
    fixed, kept = decide(
        study, {name: screened[name] for name in deciding}, share=share, keep=keep, values=values
    )
    if len(kept) < 2:
        return TwoPhase(screened, {}, fixed, share, kept, deciding, runs, groups=study.groups)
    rest = study.fix(**fixed) if fixed else study
    ranked_runs = execute(rest, rest.design(**planned.ranking), "rank")
    ranked = {name: ranked_runs.sobol(output=name, **planned.sobol) for name in study.outputs}
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
