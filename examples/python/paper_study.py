"""The sensitivity study of Tesfazgi (2023), both phases, on this project's plant.

    python examples/python/paper_study.py --out out/paper-study

Which of six uncertainties about a patient's arm spoils the elbow's stiffness that an exoskeleton
finds? Elementary effects of all six (1050 runs), then shares of the variance of five, the upper
arm's mass fixed as in the publication (21 000 runs). Arms of the published ranges sit in a device of
one size, held by soft interfaces as bushings; the estimator knows only the nominal arm. It takes
about 50 minutes of computing, shared by the processor's threads. It can be killed at any time: the
same command goes on.

    python examples/python/paper_study.py --out out/paper-study --full 10

also runs every tenth block of the second phase with cuffs, straps and tissue in full (2100 runs of
1.5 s) and corrects the indices by them.

    python examples/python/paper_study.py --out out/paper-study --full 10 --tell --tables docs/results

runs nothing, analyses what is there and writes the tables that are kept in docs/results.
`--adjusted` is the same study of a device that is adjusted to each arm's lengths, `--unguarded` adds
the screening as it was drawn for the publication.
"""

import argparse
import csv
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import ulna
from ulna import exo
from ulna.study import MultiFidelity, Runs, StudyProgress, TwoPhase, multi_fidelity

FACTORS = exo.published_factors()
OUTPUTS = ("K_error", "K_est", "D_error", "D_est", "slip_rad")
# As published: the upper arm's mass is what the screening fixes.
RANKED = tuple(name for name in FACTORS if name != "upper_mass_kg")
CHECKED = ("K_error", "K_est", "D_error")  # by runs in full
SEED = 2023


def study(
    *, full: bool = False, adjusted: bool = False, threads: int = 0, **settings: Any
) -> ulna.Study:
    """The study of reduced or of full interfaces, in a device of one size or one that is adjusted."""
    model = exo.AssessmentModel(
        FACTORS,
        outputs=OUTPUTS,
        soft=exo.Soft(fixed_device=not adjusted),
        **{"reduced": not full, "threads": threads, **settings},
    )
    return model.study(FACTORS)


def both_phases(
    made: ulna.Study, out: Path | None, *, r: int = 150, n: int = 3000, **running: Any
) -> TwoPhase:
    """Screen six factors, rank five: r (6 + 1) and n (5 + 2) runs."""
    return made.two_phase(
        r=r,
        n=n,
        seed=SEED,
        keep=RANKED,
        decide_by=["K_error"],
        values={"upper_mass_kg": 1.761},
        on_failure="drop_block",
        journal=out,
        ranking={"sampler": "latin"},
        **running,
    )


def in_full(
    design: ulna.StudyDesign, out: Path, every: int, *, tell: bool = False, **running: Any
) -> Runs:
    """Every n-th block of the second phase with full interfaces, or what the journal has of them."""
    made = study(full=True, **running.pop("settings", {})).fix(upper_mass_kg=1.761)
    if tell:
        return made.collect(design, journal=out / "full")
    return made.run(
        design, shard=(1, every), journal=out / "full", on_failure="drop_block", **running
    )


def unguarded(made: ulna.Study, out: Path, r: int, *, tell: bool = False, **running: Any) -> Runs:
    """The screening as the toolbox of the publication draws it: steps of any length, one hypercube."""
    design = made.design(scheme="radial", sampler="pooled-latin", n=r, seed=SEED)
    if tell:
        return made.collect(design, journal=out / "unguarded")
    return made.run(design, journal=out / "unguarded", on_failure="drop_block", **running)


# Tables -------------------------------------------------------------------------------------------


def write(path: Path, columns: tuple[str, ...], rows: Iterator[tuple[Any, ...]]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with open(path, "w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(columns)
        for row in rows:
            table.writerow([f"{v:.5g}" if isinstance(v, float) else v for v in row])


def screening_rows(found: TwoPhase) -> Iterator[tuple[Any, ...]]:
    decision = {name: (share, bound) for name, bound, share, _ in found.decisions()}
    for output, one in found.screening.items():
        for i, name in enumerate(one.names):
            ends = [float(v) for kind in ("mu_star", "sigma") for v in one.intervals[kind][i]]
            share = decision[name] if output in found.decided_by else ("", "")
            yield (
                output, name, float(one.mu[i]), float(one.mu_star[i]), *ends[:2],
                float(one.sigma[i]), *ends[2:], *share,
            )  # fmt: skip


def index_rows(
    output: str, plant: str, estimator: str, names: Any, value: Any, intervals: Any
) -> Iterator[tuple[Any, ...]]:
    for i, name in enumerate(names):
        cells = []
        for kind in ("first", "total"):
            cells += [float(value[kind][i]), *map(float, intervals[kind][i])]
        yield (output, plant, estimator, name, *cells)


def ranking_rows(found: TwoPhase, checks: dict[str, MultiFidelity]) -> Iterator[tuple[Any, ...]]:
    runs = found.ranking_runs
    assert runs is not None
    # A failed run gives 0 in the published simulation, a stiffness like any other.
    zeros = replace(runs, y=np.nan_to_num(runs.y), status=np.zeros_like(runs.status))
    for output, one in found.ranking.items():
        value = {"first": one.first, "total": one.total}
        yield from index_rows(output, "reduced", "default", one.names, value, one.intervals)
        # "parity" is what the toolbox of the publication computes from the same runs.
        for words, estimator, of in (
            ("parity", "parity", runs),
            ("failed runs as 0", "default", zeros),
        ):
            other = of.sobol(output=output, estimator=estimator, on_failure="drop_block", seed=SEED)
            value = {"first": other.first, "total": other.total}
            yield from index_rows(output, "reduced", words, other.names, value, other.intervals)
        if output in checks:
            check = checks[output]
            yield from index_rows(
                output, "full alone", "default", check.names, check.alone, check.alone_intervals
            )
            yield from index_rows(
                output, "full combined", "default", check.names, check.value, check.intervals
            )


def convergence_rows(found: TwoPhase) -> Iterator[tuple[Any, ...]]:
    one = found.ranking["K_error"]
    steps = one.convergence()
    for k, runs in enumerate(steps.runs):
        for i, name in enumerate(steps.names):
            cells = []
            for kind in ("first", "total"):
                table = (steps.values[kind], steps.low[kind], steps.high[kind])
                cells += [float(part[k, i]) for part in table]
            yield (int(runs), name, *cells)


def output_rows(found: TwoPhase, checks: dict[str, MultiFidelity]) -> Iterator[tuple[Any, ...]]:
    """Distribution of each output over the factors."""
    runs = found.ranking_runs
    assert runs is not None
    rows = runs.base_rows()
    for output in runs.outputs:
        y = runs.output(output)[rows]
        y = y[np.isfinite(y)]
        quantiles = map(float, np.quantile(y, [0.0, 0.05, 0.25, 0.5, 0.75, 0.95, 1.0]))
        yield (output, "reduced", y.size, float(y.mean()), float(y.std(ddof=1)), *quantiles)
        if output in checks:
            check = checks[output]
            root = float(np.sqrt(check.value["variance"]))
            yield (output, "full combined", "", float(check.value["mean"]), root, *[""] * 7)


def slice_rows(found: TwoPhase, slices: int = 20) -> Iterator[tuple[Any, ...]]:
    """Mean and spread of outputs over slices of each factor: the lines of the scatter plots."""
    runs = found.ranking_runs
    assert runs is not None
    rows = runs.base_rows()
    values = runs.design.values()[rows]
    for output in ("K_error", "K_est"):
        y = runs.output(output)[rows]
        for i, name in enumerate(runs.design.factors):
            for part in np.array_split(np.argsort(values[:, i]), slices):
                good = part[np.isfinite(y[part])]
                yield (
                    output, name, float(values[good, i].mean()), float(y[good].mean()),
                    float(y[good].std(ddof=1)),
                )  # fmt: skip


def unguarded_rows(found: TwoPhase, runs: Runs) -> Iterator[tuple[Any, ...]]:
    one = runs.screen(output="K_error", on_failure="drop_block", seed=SEED)
    guarded = found.screening["K_error"]
    for design, screened in (("guarded", guarded), ("unguarded", one)):
        for i, name in enumerate(screened.names):
            ends = [float(v) for kind in ("mu_star", "sigma") for v in screened.intervals[kind][i]]
            yield (
                design, name, float(screened.mu_star[i]), *ends[:2], float(screened.sigma[i]),
                *ends[2:],
            )  # fmt: skip


def write_tables(
    folder: Path,
    study_name: str,
    found: TwoPhase,
    checks: dict[str, MultiFidelity],
    loose: Runs | None,
) -> None:
    both = ("first", "first_low", "first_high", "total", "total_low", "total_high")
    effects = ("mu_star", "mu_star_low", "mu_star_high", "sigma", "sigma_low", "sigma_high")
    name = (study_name + "-{}.csv").format
    write(
        folder / name("screening"),
        ("output", "factor", "mu", *effects, "share", "share_high"),
        screening_rows(found),
    )
    write(
        folder / name("ranking"),
        ("output", "plant", "estimator", "factor", *both),
        ranking_rows(found, checks),
    )
    write(folder / name("convergence"), ("runs", "factor", *both), convergence_rows(found))
    ends = ("least", "q05", "q25", "median", "q75", "q95", "largest")
    write(
        folder / name("outputs"),
        ("output", "plant", "runs", "mean", "deviation", *ends),
        output_rows(found, checks),
    )
    write(
        folder / name("slices"), ("output", "factor", "at", "mean", "deviation"), slice_rows(found)
    )
    if loose is not None:
        write(
            folder / name("unguarded"), ("design", "factor", *effects), unguarded_rows(found, loose)
        )


# Figures ------------------------------------------------------------------------------------------


def draw(folder: Path, found: TwoPhase, checks: dict[str, MultiFidelity]) -> None:
    """The publication's figures 8 to 13, the decision, failures, and the check."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    folder.mkdir(parents=True, exist_ok=True)
    runs = found.ranking_runs
    assert runs is not None

    def save(name: str, axes: Any) -> None:
        figure = np.atleast_1d(np.asarray(axes, dtype=object)).flat[0].figure
        figure.savefig(folder / f"{name}.png")
        plt.close(figure)

    one = found.ranking["K_error"]
    with ulna.plot.style():
        save("fig-8-elementary-effects", found.screening["K_error"].plot())
        save("decision", found.plot())
        save("fig-9-density", runs.plot_density(output="K_error"))
        save("fig-10-indices", one.plot())
        save("fig-10-indices-of-estimate", found.ranking["K_est"].plot())
        save("fig-11-convergence", one.convergence().plot())
        save("fig-12-scatter", runs.plot_scatter(output="K_error"))
        save("fig-13-pairs", runs.plot_pairs(output="K_error"))
        save("failures", runs.plot_failures())
        for output, check in checks.items():
            save(f"full-plant-{output}", check.plot())


class Lines:
    """A line about the progress every half minute."""

    def __init__(self) -> None:
        self.next = 0.0

    def __call__(self, state: StudyProgress) -> None:
        if time.monotonic() >= self.next:
            self.next = time.monotonic() + 30.0
            print(time.strftime("%H:%M:%S"), state.line(), flush=True)


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("out/paper-study"))
    parser.add_argument("-r", type=int, default=150, help="repetitions of the screening")
    parser.add_argument("-n", type=int, default=3000, help="base points of the ranking")
    parser.add_argument("--full", type=int, metavar="N", help="every N-th block in full, too")
    parser.add_argument("--minutes", type=float, help="begin no more full runs after that")
    parser.add_argument("--unguarded", action="store_true", help="the published screening, too")
    parser.add_argument("--adjusted", action="store_true", help="the device fits each arm")
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument("--tell", action="store_true", help="analyse what is there, run nothing")
    parser.add_argument("--tables", type=Path, help="folder for the tables")
    parser.add_argument("--no-figures", action="store_true")
    chosen = parser.parse_args(arguments)

    made = study(adjusted=chosen.adjusted, threads=chosen.threads)
    started = time.monotonic()
    running = {} if chosen.tell else {"progress": Lines()}
    if chosen.tell:
        # Everything that both phases need must be there: nothing is run where nothing is missing.
        running["budget_s"] = 1e-9
    found = both_phases(made, chosen.out, r=chosen.r, n=chosen.n, **running)
    print(found.summary())
    wall = sum(
        float(np.nansum(runs.wall_s)) for runs in (found.screening_runs, found.ranking_runs) if runs
    )
    print(f"\n{time.monotonic() - started:.0f} s, {wall:.0f} s of the runs' own time\n")
    loose = None
    if chosen.unguarded:
        loose = unguarded(made, chosen.out, chosen.r, tell=chosen.tell)
    checks = {}
    if chosen.full:
        assert found.ranking_runs is not None
        more = {} if chosen.tell else {"progress": Lines()}
        if chosen.minutes and not chosen.tell:
            more["budget_s"] = 60 * chosen.minutes
        whole = in_full(
            found.ranking_runs.design, chosen.out, chosen.full, tell=chosen.tell,
            settings={"threads": chosen.threads, "adjusted": chosen.adjusted}, **more,
        )  # fmt: skip
        for output in CHECKED:
            checks[output] = multi_fidelity(
                found.ranking_runs, whole, output=output, on_failure="drop_block", seed=SEED
            )
            print(checks[output].summary(), "\n")
    if chosen.tables:
        name = "adjusted-study" if chosen.adjusted else "paper-study"
        write_tables(chosen.tables, name, found, checks, loose)
    if not chosen.no_figures:
        draw(chosen.out / "figures", found, checks)


if __name__ == "__main__":
    main()
