"""The published estimator's defects (Tesfazgi 2023) on this project's plant, and what they rank.

    python examples/python/paper_estimators.py --out out/paper-estimators --tables docs/results

Each run of `paper_study.py`'s second phase is identified four times: as this project does it; without
inertia, damping and friction in the nominal model; on the true angle of the arm, without the rate, as
a device cannot; and by the whole published estimator. 128 base points, 896 runs, two to three minutes
of computing; the same command goes on where it was stopped. Arms that cannot be put into the device
with a straight elbow are refused: their blocks are left out.
"""

import argparse
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import ulna
from paper_study import FACTORS, SEED, index_rows, write
from ulna import exo
from ulna.study import RunFailed, Runs

# What `exo.identify_viscoelasticity` is told, beyond its defaults.
ESTIMATORS: dict[str, dict[str, Any]] = {
    "own": {},
    "no losses": {"inertia": False, "damping_torque": False, "friction": "none"},
    "arm's angle": {"human_angle": True, "rate": False},
    "published": {"published": True},
}


@cache
def nominal() -> exo.Plant:
    return exo.exoskeleton()


def assess(
    *, upper_stiffness_n_m: float, fore_stiffness_n_m: float, **arm: float
) -> dict[str, float]:
    """Error of K by each estimator, from one run with reduced interfaces, N m/rad."""
    soft = exo.Soft(stiffness_n_m=(upper_stiffness_n_m, fore_stiffness_n_m), fixed_device=True)
    plant = exo.exoskeleton(soft=soft, **arm).reduced()
    done = exo.mobilise(plant, nominal=nominal())
    if done.status != "ok" or done.record is None:
        raise RunFailed(done.status, done.reason)
    out = {}
    for name, options in ESTIMATORS.items():
        (joint,) = exo.identify_viscoelasticity(done.record, plant, nominal=nominal(), **options)
        # A slope on the angle alone is compared with the truth's slope on it alone.
        rate = name in ("own", "no losses")
        out[name] = joint.k - (joint.true_k if rate else joint.true_k_alone)
    return out


def study() -> ulna.Study:
    every = ulna.Study(
        FACTORS, assess, outputs=tuple(ESTIMATORS),
        units={name: "N m/rad" for name in ESTIMATORS},
    )  # fmt: skip
    return every.fix(upper_mass_kg=1.761)


def rows(runs: Runs) -> Iterator[tuple[Any, ...]]:
    for name in runs.outputs:
        one = runs.sobol(output=name, on_failure="drop_block", seed=SEED)
        value = {"first": one.first, "total": one.total}
        for row in index_rows(name, "", "", one.names, value, one.intervals):
            yield (name, float(one.mean), float(one.variance**0.5), *row[3:])


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("out/paper-estimators"))
    parser.add_argument("-n", type=int, default=128, help="base points, a power of two")
    parser.add_argument("--tables", type=Path, help="folder for the table")
    chosen = parser.parse_args(arguments)
    made = study()
    design = made.design(n=chosen.n, seed=SEED)
    runs = made.run(design, journal=chosen.out, on_failure="drop_block")
    for name in ESTIMATORS:
        print(runs.sobol(output=name, on_failure="drop_block", seed=SEED).summary(), "\n")
    if chosen.tables:
        both = ("first", "first_low", "first_high", "total", "total_low", "total_high")
        columns = ("estimator", "mean", "deviation", "factor", *both)
        write(chosen.tables / "paper-study-estimators.csv", columns, rows(runs))


if __name__ == "__main__":
    main()
