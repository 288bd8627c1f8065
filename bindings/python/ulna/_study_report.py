"""The report of a study: one HTML page, one JSON object, the figures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from ._call import Error
from ._page import definitions, document, figure, table
from ._study_indices import Convergence, Screening, SobolIndices
from ._study_two_phase import TwoPhase

if TYPE_CHECKING:
    from .plot import Picture
    from ._study_file import StudyFile
    from .study import Runs


_BLOCKS_SHOWN = 32  # whose parts are not noise alone


@dataclass(frozen=True, eq=False)
class Analysed:
    """All that a study's file led to."""

    file: StudyFile
    screening: Mapping[str, Screening]
    ranking: Mapping[str, SobolIndices]
    phases: TwoPhase | None
    runs: Mapping[str, Runs]  # by the folder of their journal

    def summary(self) -> str:
        """For a terminal."""
        if self.phases is not None:
            return self.phases.summary()
        parts = [one.summary() for one in (*self.screening.values(), *self.ranking.values())]
        return "\n\n".join(parts or self._of_sample(self.runs["runs"]))

    @staticmethod
    def _of_sample(runs: Runs) -> list[str]:
        if runs.failed.size == len(runs.y):
            return [f"every run failed; {runs._why_failed()}"]
        return [
            f"{name}: mean {np.nanmean(y):.6g}, standard deviation {np.nanstd(y, ddof=1):.6g}, "
            f"{len(y)} runs, {runs.failed.size} failed"
            for name, y in zip(runs.outputs, runs.y.T, strict=True)
        ]

    def result(self) -> dict[str, Any]:
        """For a program; what does not exist is null."""
        out: dict[str, Any] = {
            "title": self.file.title,
            "kind": self.file.kind,
            "factors": list(self.file.study.factors),
            "outputs": list(self.file.study.outputs),
            "runs": {name: _about_runs(runs) for name, runs in self.runs.items()},
            "screening": {
                name: {
                    factor: {
                        "mu_star": _finite(one.mu_star[i]),
                        "interval": _pair(one.intervals["mu_star"][i]),
                        "mu": _finite(one.mu[i]),
                        "sigma": _finite(one.sigma[i]),
                    }
                    for i, factor in enumerate(one.names)
                }
                for name, one in self.screening.items()
            },
            "ranking": {
                name: {
                    factor: {
                        "first": _finite(one.first[i]),
                        "first_interval": _pair(one.intervals["first"][i]),
                        "total": _finite(one.total[i]),
                        "total_interval": _pair(one.intervals["total"][i]),
                    }
                    for i, factor in enumerate(one.names)
                }
                for name, one in self.ranking.items()
            },
        }
        if self.phases is not None:
            out["share"] = self.phases.share
            out["fixed"] = dict(self.phases.fixed)
            out["ranked"] = list(self.phases.kept)
        return out

    def pictures(self) -> Iterator[Picture]:
        """Every figure, in the order of the report; closed for pyplot."""
        import matplotlib.pyplot as plt

        from ._figure import style
        from .plot import Picture

        with style():
            for name, title, caption, make in self._catalogue():
                axes = np.atleast_1d(np.asarray(make(), dtype=object)).flat[0]
                plt.close(axes.figure)
                yield Picture(name, title, caption, axes.figure)

    def _catalogue(self) -> Iterator[tuple[str, str, str, Any]]:
        many = len(self.file.study.outputs) > 1
        for output in self.file.study.outputs:
            tail = f"-{output}" if many else ""
            of = f" of {output}" if many else ""
            if self.phases is not None and output in self.phases.decided_by:
                yield (
                    f"fixing{tail}", f"What is fixed{of}",
                    "A factor is fixed when its effect, with its interval, stays left of the line "
                    "for every output that decides.",
                    lambda o=output: self.phases.plot(output=o),
                )  # fmt: skip
            if output in self.screening:
                yield (
                    f"screening{tail}", f"Elementary effects{of}",
                    "How much a factor changes the output on its way from its lowest to its "
                    "highest value (right), and how much that varies from place to place (up).",
                    self.screening[output].plot,
                )  # fmt: skip
            if output in self.ranking:
                one = self.ranking[output]
                yield (
                    f"indices{tail}", f"Shares of the variance{of}",
                    "First order: what would go if the factor were known. Total: what would be "
                    "left if all others were known.",
                    one.plot,
                )  # fmt: skip
                steps = self._convergence[output]
                if not isinstance(steps, str):
                    yield (
                        f"convergence{tail}", f"Convergence{of}",
                        "The same indices from fewer runs: where the lines are level, more runs "
                        "change little.",
                        steps.plot,
                    )  # fmt: skip
            runs = list(self.runs.values())[-1]
            good = runs.base_rows()
            if np.count_nonzero(runs.status[good] == 0) >= 20:
                yield (
                    f"density{tail}", f"Distribution{of}",
                    "The output over the uncertainty of all factors.",
                    lambda o=output: runs.plot_density(output=o),
                )  # fmt: skip
                yield (
                    f"scatter{tail}", f"The output over each factor{of}",
                    "Dots are runs, the line is their mean over slices of the factor.",
                    lambda o=output: runs.plot_scatter(output=o),
                )  # fmt: skip
                if len(runs.design.factors) > 1:
                    yield (
                        f"pairs{tail}", f"Two factors at a time{of}",
                        "Each dot is a run over two factors, its colour is the output: what changes "
                        "only where both are large, the two do together.",
                        lambda o=output: runs.plot_pairs(output=o),
                    )  # fmt: skip
        for phase, runs in self.runs.items():
            if runs.failed.size:
                yield (
                    f"failures-{phase}", f"Where runs failed ({phase})",
                    "Pairs of the three factors that failures depend on most.",
                    runs.plot_failures,
                )  # fmt: skip

    @cached_property
    def _convergence(self) -> dict[str, Convergence | str]:
        """The convergence of each ranked output, or why it is not shown."""
        return {output: _converged(one) for output, one in self.ranking.items()}

    def page(self, command: str, pictures: list[Picture]) -> str:
        """The report."""
        return document(
            self.file.title,
            [
                f"<h1>{escape(self.file.title)}</h1>",
                f'<p class="source">{escape(self.file.path.name)} · '
                f"{sum(len(runs.y) for runs in self.runs.values())} runs</p>",
                self._answer(),
                self._failures(),
                self._factors(),
                self._decision(),
                *(_screening_table(one) for one in self.screening.values()),
                *(_ranking_table(one) for one in self.ranking.values()),
                "<h2>Figures</h2>" if pictures else "",
                self._not_drawn() if pictures else "",
                *(figure(picture) for picture in pictures),
                self._method(command),
            ],
        )

    def _answer(self) -> str:
        lines = []
        for output, one in self.ranking.items():
            if one.outcome == "constant":
                lines.append(f"{output} does not vary.")
                continue
            first = one.ranking[0]
            i = one.names.index(first)
            low, high = one.intervals["first"][i]
            bounds = "" if np.isnan(low) else f" ({100 * low:.0f} to {100 * high:.0f} %)"
            lines.append(
                f"{output}: {first} matters most. Were it known, {100 * one.first[i]:.0f} %"
                f"{bounds} of the variance would go. Order: {', '.join(one.ranking)}."
            )
        if not self.ranking:
            lines += [
                f"{output}: the largest effect is that of {one.ranking[0]}. "
                f"Order: {', '.join(one.ranking)}."
                for output, one in self.screening.items()
            ]
        if self.phases is not None and self.phases.fixed:
            lines.append(f"Fixed as negligible: {', '.join(self.phases.fixed)}.")
        words = "".join(f"<p>{escape(line)}</p>" for line in lines)
        return f'<div class="verdict good">{words}</div>' if words else ""

    def _failures(self) -> str:
        lines = []
        for phase, runs in self.runs.items():
            if runs.failed.size:
                counts = _counts(runs)
                kinds = ", ".join(f"{count} {name}" for name, count in counts.items())
                lines.append(
                    f"{phase}: {runs.failed.size} of {len(runs.y)} runs failed ({kinds}); they are "
                    f"treated by {self.file.on_failure!r}. {runs._why_failed()}"
                )
        words = "".join(f"<p>{escape(line)}</p>" for line in lines)
        return f'<div class="warn">{words}</div>' if words else ""

    def _not_drawn(self) -> str:
        return "".join(
            f"<p>The convergence of {escape(output)} is not shown: {escape(why)}.</p>"
            for output, why in self._convergence.items()
            if isinstance(why, str)
        )

    def _factors(self) -> str:
        rows = [
            [escape(name), escape(repr(factor)), escape(self.file.units.get(name, ""))]
            for name, factor in self.file.study.factors.items()
        ]
        return "<h2>Factors</h2>" + table(["factor", "distribution", "unit"], rows, words=(1, 2))

    def _decision(self) -> str:
        if self.phases is None:
            return ""
        rows = []
        for name, bound, value, word in self.phases.decisions():
            members = [m for m in self.phases.fixed if self._group(m) == name]
            where = ", ".join(f"{m} = {self.phases.fixed[m]:.6g}" for m in members)
            word = f"{word} at {where}" if where else word
            rows.append(
                [escape(name), f"{100 * value:.1f} %", f"{100 * bound:.1f} %", escape(word)]
            )
        share = f"{100 * self.phases.share:g}"
        deciding = self.phases.decided_by
        which = "every output" if len(deciding) == len(self.screening) else ", ".join(deciding)
        return (
            f"<h2>Decision</h2><p>A factor is fixed when the high end of its µ* stays below "
            f"{share} % of the largest µ*, for {escape(which)}.</p>"
            + table(["factor", "µ*", "at most", "decision"], rows, words=(3,))
        )

    def _group(self, name: str) -> str:
        return (self.file.study.groups or {}).get(name, name)

    def _method(self, command: str) -> str:
        pairs = [("command", escape(command))]
        for phase, runs in self.runs.items():
            pairs.append((phase, escape(repr(runs.design))))
            wall = runs.wall_s[np.isfinite(runs.wall_s)]
            if wall.size:
                pairs.append(
                    (f"{phase}, time", f"{wall.sum():.3g} s of computing, {wall.mean():.3g} s a run")
                )
        for one in [*self.ranking.values()][:1]:
            pairs.append(("estimator", f"{one.estimator}; intervals: {one.interval}"))
        return "<h2>How</h2>" + definitions(pairs)


def _converged(one: SobolIndices) -> Convergence | str:
    if one.outcome == "constant":
        return "the output does not vary"
    if one.blocks < _BLOCKS_SHOWN:
        return f"{one.blocks} base points are fewer than {_BLOCKS_SHOWN}"
    try:
        return one.convergence()
    except Error as failure:
        return str(failure)


def _counts(runs: Runs) -> dict[str, int]:
    from ._study_export import status_words

    words, counts = np.unique(status_words(runs.status[runs.failed]), return_counts=True)
    return dict(zip(words.tolist(), counts.tolist(), strict=True))


def _about_runs(runs: Runs) -> dict[str, Any]:
    wall = runs.wall_s[np.isfinite(runs.wall_s)]
    return {
        "rows": len(runs.y),
        "missing": int(runs.missing.size),
        "failed": _counts(runs) if runs.failed.size else {},
        "wall_s": float(wall.sum()) if wall.size else None,
    }


def _finite(value: Any) -> float | None:
    return float(value) if np.isfinite(value) else None


def _pair(interval: Any) -> list[float | None]:
    return [_finite(end) for end in interval]


def _between(interval: Any, form: str) -> str:
    low, high = interval
    return "" if np.isnan(low) else f"{low:{form}} to {high:{form}}"


def _screening_table(one: Screening) -> str:
    rows = [
        [
            escape(name), f"{one.mu_star[i]:.4g}", _between(one.intervals["mu_star"][i], ".4g"),
            f"{one.mu[i]:.4g}", f"{one.sigma[i]:.4g}",
        ]
        for i, name in enumerate(one.names)
    ]  # fmt: skip
    return f"<h2>Elementary effects of {escape(one.output)}</h2>" + table(
        ["factor", "µ*", f"{100 * one.level:g} %", "µ", "σ"], rows
    )


def _ranking_table(one: SobolIndices) -> str:
    rows = [
        [
            escape(name), f"{one.first[i]:.3f}", _between(one.intervals["first"][i], ".3f"),
            f"{one.total[i]:.3f}", _between(one.intervals["total"][i], ".3f"),
        ]
        for i, name in enumerate(one.names)
    ]  # fmt: skip
    level = f"{100 * one.level:g} %"
    return f"<h2>Shares of the variance of {escape(one.output)}</h2>" + table(
        ["factor", "first order", level, "total order", level], rows
    )
