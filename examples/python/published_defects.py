"""The defects of the published simulation (Tesfazgi 2023), left out one by one.

    python examples/python/published_defects.py --to docs/results/published-defects.csv

First the nominal arm without each defect, then samples of `published_study.py`. Some are run without
one defect at a time (`--alone`). Others are run without the two defects that end runs, the torque held
for 10 ms and straps as soft as the tissue, and each log is identified four times (`--estimators`): a
defect of the estimator needs no run of its own. Rows are kept as they come, and those that are there
already are not run again: half a minute a run on one core.
"""

import argparse
import csv
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from published_study import FACTORS, rows_of, samples

from ulna import exo

TWO_FIXES = ("hold", "strap_mask")
ESTIMATOR = ("nominal", "human_angle")  # what a log of the same run is identified with
ALONE = ("hold", "strap_mask", "drop")  # left out on samples, one at a time
# Of the nominal arm, beside each defect alone: without limits the held torque diverges.
TOGETHER = (("hold", "limits"), (*TWO_FIXES, "limits"), (*TWO_FIXES, "drop"), (*TWO_FIXES, "self_contact"))
COLUMNS = (
    "arm", "left_out", "status", "k_nm_rad", "true_k_nm_rad", "error_nm_rad", "largest_slip_deg",
    "reason",
)  # fmt: skip

Key = tuple[str, str]


def name_of(left_out: tuple[str, ...]) -> str:
    return "+".join(left_out) or "none"


def arm_of(name: str) -> dict[str, float]:
    """Factors of a sample; none of the nominal arm."""
    if name == "nominal":
        return {}
    return dict(zip(FACTORS, map(float, samples()[int(name)]), strict=True))


def row_of(name: str, left_out: tuple[str, ...], done: exo.Assessment, k: float, true_k: float):
    return {
        "arm": name,
        "left_out": name_of(left_out),
        "status": done.status,
        "k_nm_rad": f"{k:.6g}",
        "true_k_nm_rad": f"{true_k:.6g}",
        "error_nm_rad": f"{k - true_k:.6g}",
        "largest_slip_deg": f"{np.degrees(done.largest_slip_rad):.6g}",
        "reason": done.reason,
    }


def run_once(name: str, left_out: tuple[str, ...]) -> Iterator[dict[str, object]]:
    """One run, one row."""
    done = exo.published_assessment(
        defects=set(exo.PUBLISHED_DEFECTS) - set(left_out), **arm_of(name)
    )
    yield row_of(name, left_out, done.assessment, done.k_nm_rad, done.true_k_nm_rad)


def run_estimators(name: str) -> Iterator[dict[str, object]]:
    """One run without the two defects that end runs, identified in four ways."""
    kept = set(exo.PUBLISHED_DEFECTS) - set(TWO_FIXES)
    first = exo.published_assessment(defects=kept, **arm_of(name))
    yield row_of(name, TWO_FIXES, first.assessment, first.k_nm_rad, first.true_k_nm_rad)
    log = first.assessment.record
    for more in (ESTIMATOR[:1], ESTIMATOR[1:], ESTIMATOR):
        k = true_k = float("nan")
        if first.status == "ok":
            known = "nominal" in more
            (joint,) = exo.identify_viscoelasticity(
                log,
                exo.published_simulation(defects=kept - set(more), **arm_of(name)),
                published=True,
                friction="engine" if known else None,
                damping_torque=known,
                inertia=known,
                human_angle="human_angle" not in more,
            )
            # The published sign; the truth is a slope on the arm's own angle whatever K is one on.
            k, true_k = -joint.k, first.true_k_nm_rad
        yield row_of(name, TWO_FIXES + more, first.assessment, k, true_k)


def tasks(estimators: range, alone: range) -> Iterator[tuple[Key, Iterator[dict[str, object]]]]:
    """What is run, in order: the key of its first row, and its rows."""
    for left_out in ((), *((defect,) for defect in exo.PUBLISHED_DEFECTS), *TOGETHER):
        yield ("nominal", name_of(left_out)), run_once("nominal", left_out)
    yield ("nominal", name_of(TWO_FIXES)), run_estimators("nominal")
    for sample in map(str, alone):
        for defect in ALONE:
            yield (sample, defect), run_once(sample, (defect,))
    for sample in map(str, estimators):
        yield (sample, name_of(TWO_FIXES)), run_estimators(sample)


def run(path: Path, estimators: range, alone: range) -> None:
    there = rows_of(path)
    done = {(row["arm"], row["left_out"]) for row in there}
    path.parent.mkdir(parents=True, exist_ok=True)
    with open(path, "a", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        if not there:
            table.writeheader()
        for key, rows in tasks(estimators, alone):
            if key not in done:
                table.writerows(list(rows))  # all rows of a run or none
                file.flush()


def span(text: str) -> range:
    """Samples from the first to before the last one, as 0:40."""
    first, _, last = text.partition(":")
    return range(int(first), int(last))


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    for name, default, words in (
        ("--alone", "0:22", "samples that are run without one defect at a time"),
        ("--estimators", "42:160", "samples that are run once and identified in four ways"),
    ):
        parser.add_argument(
            name, type=span, default=default, metavar="FIRST:LAST", help=f"{words} (default: {default})"
        )
    parser.add_argument("--to", type=Path, default=Path("out/published-defects.csv"))
    arguments = parser.parse_args()
    run(arguments.to, arguments.estimators, arguments.alone)


if __name__ == "__main__":
    main()
