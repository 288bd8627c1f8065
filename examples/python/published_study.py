"""Flags, slips and errors of the published simulation (Tesfazgi 2023) over its factors.

    python examples/python/published_study.py --samples 40 --to docs/results/published-study.csv

Every sample is run twice: with every defect, and with the two fixes that decide the study (the
torque recomputed at every step, straps with their own stiffness). Rows are kept as they come, and
those that are there already are not run again: about a minute a sample on one core.

    python examples/python/published_study.py --tell docs/results/published-study.csv

says what the rows say, and runs nothing.
"""

import argparse
import csv
from pathlib import Path

import numpy as np

from ulna import exo

FACTORS = {
    "upper_factor": (0.9, 1.1),
    "fore_factor": (0.9, 1.1),
    "upper_mass_kg": (0.3, 3.41),
    "fore_mass_kg": (0.1, 1.82),
    "upper_stiffness_1_s2": (100.5, 974.43),
    "fore_stiffness_1_s2": (100.5, 974.43),
}
SAMPLES = 160  # drawn at once, so that the first ones are the same whatever the number that is run
SETTINGS = {
    "published": set(exo.PUBLISHED_DEFECTS),
    "both_fixes": set(exo.PUBLISHED_DEFECTS) - {"hold", "strap_mask"},
}
RESULTS = (
    "status",
    "k_nm_rad",
    "true_k_nm_rad",
    "error_nm_rad",
    "largest_slip_deg",
    "reason",
)


def samples() -> np.ndarray:
    """Uniform samples of the factors, one a row."""
    low, high = np.array(list(FACTORS.values())).T
    return low + (high - low) * np.random.default_rng(0).random((SAMPLES, len(FACTORS)))


def run_row(sample: int, setting: str, values: np.ndarray) -> dict[str, object]:
    done = exo.published_assessment(
        defects=SETTINGS[setting], **dict(zip(FACTORS, map(float, values), strict=True))
    )
    return {
        "sample": sample,
        "setting": setting,
        **{name: f"{value:.17g}" for name, value in zip(FACTORS, values, strict=True)},
        "status": done.status,
        "k_nm_rad": f"{done.k_nm_rad:.6g}",
        "true_k_nm_rad": f"{done.true_k_nm_rad:.6g}",
        "error_nm_rad": f"{done.error_nm_rad:.6g}",
        "largest_slip_deg": f"{np.degrees(done.largest_slip_rad):.6g}",
        "reason": done.assessment.reason,
    }


def rows_of(path: Path) -> list[dict[str, str]]:
    if not path.exists():
        return []
    with open(path, encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def run(path: Path, count: int) -> None:
    done = {(int(row["sample"]), row["setting"]) for row in rows_of(path)}
    path.parent.mkdir(parents=True, exist_ok=True)
    new = not path.exists()
    with open(path, "a", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(
            file, ["sample", "setting", *FACTORS, *RESULTS], lineterminator="\n"
        )
        if new:
            table.writeheader()
        for sample, values in enumerate(samples()[:count]):
            for setting in SETTINGS:
                if (sample, setting) not in done:
                    table.writerow(run_row(sample, setting, values))
                    file.flush()


def told(path: Path) -> str:
    """What the rows say: flags, slips, errors."""
    lines = []
    for setting in SETTINGS:
        rows = [row for row in rows_of(path) if row["setting"] == setting]
        flagged = sum(row["status"] != "ok" for row in rows)
        ok = [row for row in rows if row["status"] == "ok"]
        slip = np.array([float(row["largest_slip_deg"]) for row in ok])
        held = slip <= 60  # the arm is in its strap
        error = np.array([float(row["error_nm_rad"]) for row in ok])[held]
        lines.append(
            f"{setting}: {len(rows)} samples, {flagged} flagged ({flagged / len(rows):.0%}), "
            f"unflagged slips above 60 degrees: {(~held).sum()}, of 35 to 60: "
            f"{((slip > 35) & held).sum()}; error {error.mean():+.2f} ± {error.std(ddof=1):.2f} N m/rad "
            f"where the arm is held"
        )
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument(
        "--samples", type=int, default=40, help=f"how many of {SAMPLES}"
    )
    parser.add_argument("--to", type=Path, default=Path("out/published-study.csv"))
    parser.add_argument("--tell", type=Path, help="a table to tell of; nothing is run")
    arguments = parser.parse_args()
    if arguments.tell is None:
        run(arguments.to, arguments.samples)
    print(told(arguments.tell or arguments.to))


if __name__ == "__main__":
    main()
