"""How soft interfaces hold arms, and what the reduced plant costs, over the published ranges.

    python examples/python/interface_study.py --out out/interface-study --tables docs/results

500 arms and tissues, drawn evenly over Table 1 of Tesfazgi (2023), each in a device that is adjusted
to it, assessed with cuffs, straps and tissue in full and with bushings in their place; the estimator
knows the arm, so that what is left is the interface's. Then the default arm at time steps of 5 and
2.5 ms. It takes about twelve minutes of computing, shared by the processor's threads. It can be
killed at any time: the same command goes on.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from paper_study import write

from ulna import exo
from ulna.study import Runs

FACTORS = exo.published_factors()
OUTPUTS = ("slip_rad", "K_error", "D_error")
SEED = 20
STEPS_S = (5e-3, 2.5e-3)
LARGE_DEG = 5.0  # a slip


def assessed(out: Path, *, full: bool, n: int, threads: int = 0, **running: Any) -> Runs:
    model = exo.AssessmentModel(
        FACTORS, outputs=OUTPUTS, soft=True, reduced=not full, nominal="own", threads=threads
    )
    journal = out / ("full" if full else "reduced")
    made = model.study(FACTORS)
    return made.sample(
        n=n, seed=SEED, sampler="monte-carlo", on_failure="drop_block", journal=journal, **running
    )


def steps() -> Iterator[tuple[float, float, float]]:
    """Time step, K and true K of the default arm."""
    for step_s in STEPS_S:
        (joint,) = exo.mobilise(exo.exoskeleton(soft=True, timestep_s=step_s)).joints
        yield step_s, joint.k, joint.true_k


def arms(full: Runs, reduced: Runs) -> Iterator[tuple[object, ...]]:
    points = full.design.values()
    for i, point in enumerate(points):
        both = [float(v) for runs in (full, reduced) for v in runs.y[i]]
        yield (i, *map(float, point), int(full.status[i]), int(reduced.status[i]), *both)


def told(full: Runs, reduced: Runs) -> Iterator[str]:
    for name, runs in (("in full", full), ("reduced", reduced)):
        slip = np.degrees(runs.output("slip_rad"))
        beyond = slip > LARGE_DEG
        yield (
            f"{name}: {len(slip)} arms, {len(runs.failed)} failed; slip: median "
            f"{np.nanmedian(slip):.2f} degrees, 95 % below {np.nanquantile(slip, 0.95):.2f}, beyond "
            f"{LARGE_DEG:g} in {beyond.sum()} ({beyond.mean():.1%}), largest {np.nanmax(slip):.2f}; "
            f"error of K {np.nanmean(runs.output('K_error')):+.3f} ± "
            f"{np.nanstd(runs.output('K_error'), ddof=1):.3f} N m/rad"
        )
        yield from (f"  arm {row}: {words}" for row, words in sorted(runs.messages.items()))
    for name, unit in (("K_error", "N m/rad"), ("D_error", "N m s/rad")):
        apart = reduced.output(name) - full.output(name)
        yield (
            f"reduced less full, {name}: rms {np.sqrt(np.nanmean(apart**2)):.3f}, "
            f"mean {np.nanmean(apart):+.3f}, worst {apart[np.nanargmax(abs(apart))]:+.3f} {unit}"
        )
    apart = np.degrees(reduced.output("slip_rad") - full.output("slip_rad"))
    yield f"reduced less full, slip: rms {np.sqrt(np.nanmean(apart**2)):.3f} degrees"


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("out/interface-study"))
    parser.add_argument("-n", type=int, default=500, help="arms (default: 500)")
    parser.add_argument("--threads", type=int, default=0, help="default: one per processor")
    parser.add_argument("--tables", type=Path, help="folder for the tables")
    chosen = parser.parse_args(arguments)
    full, reduced = (
        assessed(chosen.out, full=full, n=chosen.n, threads=chosen.threads) for full in (True, False)
    )
    halved = list(steps())
    print("\n".join(told(full, reduced)))
    for step_s, k, true_k in halved:
        print(f"steps of {1e3 * step_s:g} ms: K {k:.4f}, true K {true_k:.4f} N m/rad")
    if chosen.tables is not None:
        outputs = [f"{name}_{plant}" for plant in ("full", "reduced") for name in OUTPUTS]
        columns = ("arm", *FACTORS, "status_full", "status_reduced", *outputs)
        write(chosen.tables / "interface-arms.csv", columns, arms(full, reduced))
        write(chosen.tables / "interface-steps.csv", ("step_s", "k", "true_k"), iter(halved))


if __name__ == "__main__":
    main()
