"""Figures of studies: indices, elementary effects, convergence, outputs, failures."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from ._figure import AMBER, BLUE, GREEN, GREY, INK, ORANGE, PINK, SEQUENTIAL, SKY, WIDTH_IN, axes_grid, style
from .record import refuse

if TYPE_CHECKING:
    from ._study_fidelity import MultiFidelity
    from ._study_indices import Convergence, Screening, SobolIndices
    from ._study_patient import Patient
    from ._study_two_phase import TwoPhase
    from .study import Runs

_COLOURS = (BLUE, ORANGE, GREEN, PINK, AMBER, SKY)
_MARKERS = ("o", "s", "D", "^", "v", "P")
_LINES = 8  # factors of a convergence figure
_LABELLED = 12  # factors that a legend can hold; of more the most important ones
_TITLES = {
    "first": "First-order index",
    "total": "Total-order index",
    "mu_star": "Mean magnitude µ* of the effects",
    "sigma": "Standard deviation σ of the effects",
}


def _look(i: int) -> dict[str, Any]:
    return {"color": _COLOURS[i % 6], "marker": _MARKERS[(i // 6 + i) % 6]}


def _shown(names: tuple[str, ...], size: np.ndarray) -> list[int]:
    """Places of the factors that get a name, the most important first when there are many."""
    if len(names) <= _LABELLED:
        return list(range(len(names)))
    return sorted(np.argsort(-np.nan_to_num(size), kind="stable")[:_LABELLED].tolist())


def _errors(value: np.ndarray, interval: np.ndarray) -> np.ndarray | None:
    if np.isnan(interval).any():
        return None
    return np.abs(interval.T - value)


def _label(runs: Runs, name: str) -> str:
    """A factor or an output with its unit."""
    unit = runs.units.get(name, "")
    return f"{name} ({unit})" if unit else name


def _level(level: float) -> str:
    return f"{100 * level:g} %"


def sobol_indices(result: SobolIndices, axes: Any = None) -> Any:
    """First- and total-order indices side by side, with their intervals; returns the two axes."""
    with style():
        height = max(2.4, 0.9 + 0.22 * len(result.names))
        given = axes_grid(axes, 1, 2, (WIDTH_IN, height), sharey=True)[0]
        rows = np.arange(len(result.names))
        for ax, kind, colour in zip(given, ("first", "total"), (BLUE, ORANGE), strict=True):
            value = getattr(result, kind)
            ax.barh(rows, np.nan_to_num(value), height=0.62, color=colour, alpha=0.35, zorder=2)
            ax.errorbar(
                value,
                rows,
                xerr=_errors(value, result.intervals[kind]),
                fmt="o",
                color=colour,
                ecolor=INK,
                elinewidth=1.0,
                capsize=2.5,
                markersize=4,
                zorder=3,
            )
            ax.axvline(0.0, color=INK, linewidth=0.7)
            if result.outcome == "constant":
                ax.text(
                    0.5, 0.5, "the output does not vary", transform=ax.transAxes, ha="center"
                )
            with np.errstate(invalid="ignore"):
                total = f", sum {value.sum():.2f}" if np.isfinite(value).all() else ""
            ax.set_title(_TITLES[kind] + total)
            bars = "" if result.interval == "none" else f"; bars: {_level(result.level)} interval"
            ax.set_xlabel("share of the variance" + bars)
            ax.grid(False, axis="y")
        given[0].set_yticks(rows, result.names)
        given[0].set_ylim(len(rows) - 0.45, -0.55)
        return given


def fidelity(result: MultiFidelity, axes: Any = None) -> Any:
    """Indices of a full model, combined and from its own runs, beside the cheap model's."""
    if "total" not in result.value:
        raise refuse("the runs are of a plain sample: there are no indices to draw", "result")
    none = {kind: np.full((len(result.names), 2), np.nan) for kind in ("first", "total")}
    rows_of = result.block_rows
    series = (
        (result.cheap, none, GREY, "D", f"cheap model, {result.cheap_blocks * rows_of} runs"),
        (
            result.alone, result.alone_intervals, ORANGE, "s",
            f"full model, {result.blocks * rows_of} runs",
        ),
        (result.value, result.intervals, BLUE, "o", "full model, combined"),
    )  # fmt: skip
    with style():
        height = max(2.8, 1.2 + 0.36 * len(result.names))
        given = axes_grid(axes, 1, 2, (WIDTH_IN, height), sharey=True)
        rows = np.arange(len(result.names))
        for ax, kind in zip(given[0], ("first", "total"), strict=True):
            for place, (value, intervals, colour, marker, label) in enumerate(series):
                ax.errorbar(
                    value[kind], rows + 0.22 * (place - 1), xerr=_errors(value[kind], intervals[kind]),
                    fmt=marker, color=colour, elinewidth=1.0, capsize=2.5, markersize=4.5, label=label,
                )  # fmt: skip
            ax.axvline(0.0, color=INK, linewidth=0.7)
            ax.set_title(_TITLES[kind])
            ax.set_xlabel(f"share of the variance; bars: {_level(result.level)} interval")
            ax.grid(False, axis="y")
        given[0, 0].set_yticks(rows, result.names)
        given[0, 0].set_ylim(len(rows) - 0.45, -0.55)
        _legend_below(given, given[0, 0].get_legend_handles_labels()[0])
        return given[0]


def screening(result: Screening, ax: Any = None) -> Any:
    """µ* and σ of every factor, with their intervals; returns the axes."""
    with style():
        (ax,) = axes_grid(ax, 1, 1, (WIDTH_IN * 0.75, 3.9))[0]
        spread = result.sigma if np.isfinite(result.sigma).all() else np.zeros_like(result.mu_star)
        shown = _shown(result.names, result.mu_star)
        for i, name in enumerate(result.names):
            x, y = result.mu_star[i], spread[i]
            look = _look(shown.index(i)) if i in shown else {"color": GREY, "marker": "."}
            box = result.intervals["mu_star"][i]
            tall = result.intervals["sigma"][i]
            ax.errorbar(
                x,
                y,
                xerr=None if np.isnan(box).any() else np.abs(box - x)[:, None],
                yerr=None if np.isnan(tall).any() else np.abs(tall - y)[:, None],
                fmt=look["marker"],
                color=look["color"],
                elinewidth=0.9,
                capsize=2,
                markersize=5.5,
                label=name if i in shown else None,
            )
        top = float(np.nanmax(np.append(result.intervals["mu_star"][:, 1], result.mu_star)))
        high = float(np.nanmax(np.append(result.intervals["sigma"][:, 1], spread)))
        reach = min(top, high) if high > 0 else 0.0
        if reach > 0:
            # Above this line the effect of a factor changes its sign or size with the others.
            ax.plot([0, reach], [0, reach], color=GREY, linestyle=":", zorder=1, label="σ = µ*")
        # Room below zero for the markers of factors without an effect, or of one that never varies.
        ax.set_xlim(left=-0.025 * top if top > 0 else None)
        ax.set_ylim(bottom=-0.025 * high if high > 0 else None)
        bars = "" if result.interval == "none" else f"; bars: {_level(result.level)}"
        unit = f" ({result.unit})" if result.unit else ""
        ax.set_title(f"Elementary effects of {result.output}")
        ax.set_xlabel(f"mean magnitude µ* over a factor's range{unit}{bars}")
        ax.set_ylabel(f"standard deviation σ{unit}")
        ax.legend(loc="center left", bbox_to_anchor=(1.01, 0.5))
        return ax


def fixing(result: TwoPhase, ax: Any = None, *, output: str | None = None) -> Any:
    """µ* of each factor as a share of the largest, and the share below which it is fixed."""
    if output is not None and output not in result.screening:
        raise refuse(f"there is no output {output!r}", "output")
    one = result.screening[output or result.decided_by[0]]
    largest = float(np.max(one.mu_star)) or 1.0
    order = np.argsort(one.mu_star, kind="stable")
    with style():
        (ax,) = axes_grid(ax, 1, 1, (WIDTH_IN * 0.8, max(2.2, 0.9 + 0.24 * len(order))))[0]
        for kept, colour, marker, word in ((True, BLUE, "o", "ranked"), (False, ORANGE, "s", "fixed")):
            rows = [k for k, i in enumerate(order) if (one.names[i] in result.kept) == kept]
            if not rows:
                continue
            value = one.mu_star[order[rows]] / largest
            interval = one.intervals["mu_star"][order[rows]] / largest
            ax.errorbar(
                value, rows, xerr=_errors(value, interval), fmt=marker, color=colour, capsize=2.5,
                markersize=5, elinewidth=1.0, label=word,
            )  # fmt: skip
        ax.axvline(
            result.share, color=INK, linestyle="--", linewidth=0.9,
            label=f"{100 * result.share:g} % of the largest",
        )  # fmt: skip
        ax.set_yticks(np.arange(len(order)), [one.names[i] for i in order])
        ax.set_ylim(-0.6, len(order) - 0.4)
        ax.set_xlim(left=0.0)
        ax.grid(False, axis="y")
        ax.set_title(f"What is fixed: effects on {one.output}")
        bars = "" if one.interval == "none" else f"; bars: {_level(one.level)} interval"
        ax.set_xlabel("µ*, share of the largest" + bars)
        ax.legend(loc="center left", bbox_to_anchor=(1.01, 0.5))
        return ax


def convergence(result: Convergence, axes: Any = None) -> Any:
    """Indices over the number of runs, one panel a kind; returns the axes."""
    with style():
        kinds = list(result.values)
        given = axes_grid(axes, 1, len(kinds), (WIDTH_IN, 3.0))[0]
        last = result.values[kinds[-1]][-1]
        # Most important first; more than a handful of lines and bands cannot be told apart.
        shown = np.argsort(-np.nan_to_num(last), kind="stable")[:_LINES]
        for ax, kind in zip(given, kinds, strict=True):
            for place, i in enumerate(shown):
                look = _look(place)
                value = result.values[kind][:, i]
                ax.plot(result.runs, value, markersize=4, label=result.names[i], **look)
                low, high = result.low[kind][:, i], result.high[kind][:, i]
                if np.isfinite(low).any():
                    ax.fill_between(
                        result.runs, low, high, color=look["color"], alpha=0.13, linewidth=0
                    )
            ax.axhline(0.0, color=INK, linewidth=0.7)
            ax.set_title(_TITLES[kind])
            _runs_axis(ax, result.runs)
            _near_the_lines(ax, result, kind, shown)
            part = {"prefix": "the first of the study", "random": "drawn from the study"}
            ax.set_xlabel(f"runs, {part[result.subset]}")
        unit = f" ({result.unit})" if result.unit else ""
        given[0].set_ylabel(f"index{unit}; band: {_level(result.level)} interval")
        given[-1].legend(loc="center left", bbox_to_anchor=(1.01, 0.5), title=_left_out(result, shown))
        return given


def _left_out(result: Convergence, shown: np.ndarray) -> str | None:
    more = len(result.names) - len(shown)
    return f"the first {len(shown)} of {len(result.names)}" if more else None


def _runs_axis(ax: Any, runs: np.ndarray) -> None:
    """Ticks at numbers of runs that were analysed, written as they are."""
    if runs[-1] > 8 * runs[0]:
        ax.set_xscale("log")
    position = np.log(runs) if runs[-1] > 8 * runs[0] else runs.astype(float)
    chosen = [len(runs) - 1]
    for k in range(len(runs) - 2, -1, -1):
        # A label takes about a fifth of the axis.
        if position[chosen[-1]] - position[k] > 0.2 * (position[-1] - position[0]):
            chosen.append(k)
    ax.set_xticks(runs[chosen], [f"{number:g}" for number in runs[chosen]])
    ax.minorticks_off()


def _near_the_lines(ax: Any, result: Convergence, kind: str, shown: np.ndarray) -> None:
    """Limits that hold all lines and the bands of the last half, not the widest first band."""
    half = len(result.runs) // 2
    parts = [result.values[kind][:, shown], result.low[kind][half:, shown], result.high[kind][half:, shown]]
    held = np.concatenate([part[np.isfinite(part)].ravel() for part in parts] + [np.zeros(1)])
    room = 0.06 * (held.max() - held.min()) or 1.0
    ax.set_ylim(held.min() - room, held.max() + room)


def _legend_below(axes: Any, handles: Any) -> None:
    """One legend under all panels; of axes that somebody gave, under the last one."""
    figure = axes.flat[0].figure
    engine = figure.get_layout_engine() if hasattr(figure, "get_layout_engine") else None
    if type(engine).__name__ == "ConstrainedLayoutEngine" and len(figure.axes) == axes.size:
        figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), markerscale=1.5)
    else:
        axes.flat[-1].legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.25), ncols=2)


def _good(runs: Runs, output: str | None) -> tuple[np.ndarray, np.ndarray, str]:
    """Rows of the plain sample whose run is good, their output, its name."""
    y = runs.output(output)
    rows = runs.base_rows()
    rows = rows[(runs.status[rows] == 0) & np.isfinite(y[rows])]
    if rows.size < 2:
        raise refuse("fewer than two good runs: there is nothing to draw", "runs")
    return rows, y[rows], runs.outputs[runs._place(output)]


def output_density(runs: Runs, ax: Any = None, *, output: str | None = None) -> Any:
    """Histogram of an output over the factors' uncertainty, its mean and 90 % of it."""
    _, y, name = _good(runs, output)
    with style():
        (ax,) = axes_grid(ax, 1, 1, (WIDTH_IN * 0.7, 2.9))[0]
        bins = int(np.clip(np.sqrt(y.size), 10, 60)) if np.ptp(y) > 0 else 1
        ax.hist(y, bins=bins, density=True, color=BLUE, alpha=0.45, label=f"{y.size} runs")
        low, mean, high = np.quantile(y, 0.05), y.mean(), np.quantile(y, 0.95)
        ax.axvline(mean, color=ORANGE, label=f"mean {mean:.3g}")
        for edge, label in ((low, f"5 to 95 %: {low:.3g} to {high:.3g}"), (high, None)):
            ax.axvline(edge, color=INK, linestyle="--", linewidth=0.9, label=label)
        ax.set_title(f"Distribution of {name}")
        unit = runs.units.get(name, "")
        ax.set_xlabel(_label(runs, name))
        ax.set_ylabel(f"probability density (1/({unit}))" if unit else "probability density")
        ax.legend(loc="center left", bbox_to_anchor=(1.01, 0.5))
        return ax


def output_scatter(runs: Runs, axes: Any = None, *, output: str | None = None) -> Any:
    """An output over each factor, with the mean over twenty slices; returns the axes."""
    rows, y, name = _good(runs, output)
    factors = runs.design.factors
    columns = min(3, len(factors))
    lines = -(-len(factors) // columns)
    with style():
        given = axes_grid(axes, lines, columns, (WIDTH_IN, 2.1 * lines + 0.3), sharey=True)
        unit = runs.design.unit()[rows]
        thin = max(1, rows.size // 4000)
        for i, (factor, distribution) in enumerate(factors.items()):
            ax = given.flat[i]
            x = distribution.quantile(unit[:, i])
            ax.plot(
                x[::thin], y[::thin], ".", color=BLUE, markersize=2, alpha=0.5, rasterized=True
            )
            slices = np.array_split(np.argsort(unit[:, i], kind="stable"), min(20, rows.size // 5 or 1))
            ax.plot(
                [x[s].mean() for s in slices],
                [y[s].mean() for s in slices],
                color=ORANGE,
                linewidth=1.8,
                label="mean of a slice",
            )
            ax.set_xlabel(_label(runs, factor))
            if i % columns == 0:
                ax.set_ylabel(_label(runs, name))
        for ax in given.flat[len(factors) :]:
            ax.set_visible(False)
        given.flat[0].legend(loc="best")
        return given


def output_pairs(
    runs: Runs, axes: Any = None, *, output: str | None = None, factors: Any = None
) -> Any:
    """Runs over two factors at a time, coloured by an output: what only together is large.

    `factors` are up to four names; by default the three whose slices differ most in the mean.
    """
    from matplotlib.colors import LinearSegmentedColormap

    rows, y, name = _good(runs, output)
    unit = runs.design.unit()[rows]
    names = list(runs.design.factors)
    if factors is None:
        chosen = sorted(np.argsort(-_between_slices(unit, y), kind="stable")[:3].tolist())
    else:
        unknown = [factor for factor in factors if factor not in names]
        if isinstance(factors, str) or unknown or not 2 <= len(set(factors)) <= 4:
            raise refuse(f"factors must be two to four of {', '.join(names)}", "factors")
        chosen = [names.index(factor) for factor in factors]
    if len(chosen) < 2:
        raise refuse("pairs need two factors", "runs")
    pairs = list(combinations(chosen, 2))
    columns = min(3, len(pairs))
    lines = -(-len(pairs) // columns)
    thin = max(1, rows.size // 3000)
    # A few extreme runs must not take the colours from all others.
    low, high = np.quantile(y, [0.01, 0.99])
    colours = LinearSegmentedColormap.from_list("ulna", SEQUENTIAL)
    with style():
        width = WIDTH_IN / max(2, columns)
        given = axes_grid(axes, lines, columns, (WIDTH_IN, (width + 0.2) * lines + 0.4))
        for ax, (i, j) in zip(given.flat, pairs, strict=False):
            x = [runs.design.factors[names[k]].quantile(unit[:, k]) for k in (i, j)]
            drawn = ax.scatter(
                x[0][::thin], x[1][::thin], c=y[::thin], s=6, cmap=colours, vmin=low, vmax=high,
                linewidths=0.15, edgecolors=GREY, rasterized=True,
            )  # fmt: skip
            ax.set_xlabel(_label(runs, names[i]))
            ax.set_ylabel(_label(runs, names[j]))
            ax.grid(False)
        for ax in given.flat[len(pairs) :]:
            ax.set_visible(False)
        given.flat[0].figure.colorbar(
            drawn, ax=given.tolist()[0] if lines == 1 else given.ravel().tolist(), extend="both",
            label=_label(runs, name), location="bottom", shrink=0.5, aspect=35,
        )  # fmt: skip
        return given


def _between_slices(unit: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Of each factor, the variance of the output's mean over ten slices."""
    out = np.empty(unit.shape[1])
    for i, column in enumerate(unit.T):
        slices = np.array_split(np.argsort(column, kind="stable"), min(10, y.size))
        out[i] = np.var([y[part].mean() for part in slices])
    return out


def failure_map(runs: Runs, axes: Any = None) -> Any:
    """Failed runs among good ones, for the pairs of the three factors they depend on most."""
    design = runs.design
    if not design.has_points:
        raise refuse("a map needs the values of the factors: read_outputs(y, x=...)", "x")
    failed = np.zeros(len(runs.y), dtype=bool)
    failed[runs.failed] = True
    unit = design.unit()
    names = list(design.factors)
    # How far the failed runs' mean is from the middle of what was run, in standard errors.
    if failed.any() and not failed.all():
        shift = np.abs(unit[failed].mean(0) - unit[~failed].mean(0))
    else:
        shift = np.zeros(len(names))
    chosen = sorted(np.argsort(-shift, kind="stable")[:3].tolist())
    pairs = list(combinations(chosen, 2)) or [(chosen[0], chosen[0])]
    with style():
        given = axes_grid(axes, 1, len(pairs), (WIDTH_IN, WIDTH_IN / max(2, len(pairs)) + 0.6))[0]
        good = np.flatnonzero(~failed)
        good = good[:: max(1, good.size // 3000)]
        values = {i: design.factors[names[i]].quantile(unit[:, i]) for i in chosen}
        for ax, (i, j) in zip(given, pairs, strict=True):
            ax.plot(
                values[i][good], values[j][good], ".", color=SKY, markersize=2.5, label="good"
            )
            ax.plot(
                values[i][failed],
                values[j][failed],
                "x",
                color=ORANGE,
                markersize=4,
                markeredgewidth=1.0,
                label=f"failed, {int(failed.sum())} of {failed.size}",
            )
            ax.set_xlabel(_label(runs, names[i]))
            ax.set_ylabel(_label(runs, names[j]))
            ax.grid(False)
        given[0].set_title("Where runs failed")
        _legend_below(given, given[-1].get_legend_handles_labels()[0])
        return given


def patient(result: Patient, axes: Any = None) -> Any:
    """Each quantity's interval, and what is left of it when a factor is known; a row a quantity.

    Left: before and after what was observed, and what the measurement's own error would leave.
    Right: share of the interval's width that is left, and the half that is asked for.
    """
    with style():
        count = len(result.quantities)
        most = max(len(one.known) for one in result.quantities.values())
        given = axes_grid(
            axes, count, 2, (WIDTH_IN, count * max(1.9, 0.95 + 0.27 * most)), width_ratios=[1.0, 1.15]
        )
        for row, one in zip(given, result.quantities.values(), strict=True):
            _patient_interval(row[0], one, result)
            _patient_factors(row[1], one)
        # One legend for all rows, where it lies on nothing.
        handles, _ = given[0][1].get_legend_handles_labels()
        if handles:
            _legend_below(given, handles)
        return given


def _patient_interval(ax: Any, one: Any, result: Patient) -> None:
    bars = [("now", *one.interval, one.mean, BLUE)]
    if result.observed:
        bars.insert(0, ("before what\nwas observed", *one.unobserved, None, GREY))
    if one.deviation > 0:
        # The measurement alone: the interval that would be left if every factor were known.
        half = 0.5 * one.width * one.noise_deviation / one.deviation
        bars.append(("if every factor\nwere known", one.mean - half, one.mean + half, None, ORANGE))
    for k, (_, low, high, mean, colour) in enumerate(bars):
        ax.plot([low, high], [k, k], color=colour, linewidth=7, solid_capstyle="butt", alpha=0.55)
        for end in (low, high):
            ax.plot([end, end], [k - 0.16, k + 0.16], color=colour, linewidth=1.4)
        if mean is not None:
            ax.plot([mean], [k], "o", color=INK, markersize=4)
        ax.annotate(
            f"{low:.3g} to {high:.3g}" if high > low else f"{low:.3g}",
            (0.5 * (low + high), k), xytext=(0, 8), textcoords="offset points", ha="center",
            fontsize=7.5, color=INK,
        )  # fmt: skip
    ax.set_yticks(range(len(bars)), [bar[0] for bar in bars])
    ax.set_ylim(len(bars) - 0.4, -0.75)
    ax.margins(x=0.12)
    ax.grid(False, axis="y")
    unit = f" ({one.unit})" if one.unit else ""
    ax.set_xlabel(one.name + unit)
    ax.set_title(f"{one.name}: {_level(result.level)} interval")


def _patient_factors(ax: Any, one: Any) -> None:
    if not one.known:
        ax.text(0.5, 0.5, "no factor matters", transform=ax.transAxes, ha="center")
        ax.set_axis_off()
        return
    names = sorted(one.known, key=lambda name: one.known[name])
    rows = np.arange(len(names))
    known = 100 * np.array([one.known[name] for name in names])
    halved = 100 * np.array([one.halved[name] for name in names])
    ax.barh(rows - 0.19, known, height=0.34, color=BLUE, label="known exactly")
    ax.barh(rows + 0.19, halved, height=0.34, color=SKY, label="known twice as well")
    ax.axvline(50.0, color=INK, linestyle="--", linewidth=0.9)
    for row, name in enumerate(names):
        if name in one.to_halve:
            unit = one.units.get(name, "")
            words = f"±{one.to_halve[name]:.2g} {unit}".rstrip() + " halves it"
            ax.text(101.5, row, words, fontsize=7.5, va="center", color=INK, clip_on=False)
    ax.set_yticks(rows, names)
    ax.set_ylim(len(names) - 0.45, -0.55)
    ax.set_xlim(0, 100)
    ax.grid(False, axis="y")
    ax.set_title("Left of its width if a factor is")
    ax.set_xlabel("share of the width (%); dashed: half")
