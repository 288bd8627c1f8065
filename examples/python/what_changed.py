"""What each defect of the published simulation (Tesfazgi 2023) does to the error of K and its ranking.

    python examples/python/what_changed.py

reads the stored runs of `published_study.py` and `published_defects.py` in docs/results, writes
docs/results/what-changed.csv and prints the tables of docs/what-changed.md. Nothing is run.

Some dozens of runs are too few for shares of the variance. A factor's part is its squared
standardised regression coefficient, with a 90 % interval from 2000 bootstrap samples of the runs;
these parts add up to the R² of a straight model when the factors are independent.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from paper_study import write
from published_study import FACTORS, rows_of, samples

RESULTS = Path(__file__).resolve().parents[2] / "docs" / "results"
HELD_DEG = 60.0  # above, the arm has left its strap
LEVEL = (0.05, 0.95)

Rows = list[dict[str, str]]


def parts(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Squared standardised regression coefficients, and R²."""
    x = (x - x.mean(axis=0)) / x.std(axis=0)
    y = (y - y.mean()) / y.std()
    slopes, *_ = np.linalg.lstsq(x, y, rcond=None)
    return np.append(slopes**2, 1.0 - np.var(y - x @ slopes))


def with_intervals(
    x: np.ndarray, y: np.ndarray, resamples: int = 2000
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`parts`, and the ends of their intervals."""
    random = np.random.default_rng(0)
    drawn = random.integers(len(y), size=(resamples, len(y)))
    low, high = np.quantile([parts(x[i], y[i]) for i in drawn], LEVEL, axis=0)
    return parts(x, y), low, high


def held(rows: Rows) -> Rows:
    """Runs that ended well with the arm in its strap."""
    return [r for r in rows if r["status"] == "ok" and float(r["largest_slip_deg"]) <= HELD_DEG]


def unflagged(rows: Rows) -> Rows:
    """Runs that the published flag lets pass, slipped ones too."""
    return [r for r in rows if r["status"] == "ok"]


def column(rows: Rows, name: str) -> np.ndarray:
    return np.array([float(r[name]) for r in rows])


def points(rows: Rows, key: str) -> np.ndarray:
    """Factors of the rows' samples."""
    return samples()[[int(r[key]) for r in rows]]


def rankings(study: Rows, defects: Rows) -> Iterator[tuple[str, str, np.ndarray, np.ndarray]]:
    """Setting, quantity, factors and values of everything that is ranked."""
    quantities = {"error": "error_nm_rad", "K": "k_nm_rad", "true K": "true_k_nm_rad"}
    for setting, words, kept in (
        ("published", "every defect", unflagged),
        ("published", "every defect, arm held", held),
        ("both_fixes", "without hold, strap_mask", held),
    ):
        rows = kept([r for r in study if r["setting"] == setting])
        for quantity, name in quantities.items():
            yield words, quantity, points(rows, "sample"), column(rows, name)
    # A run that fails gives 0 in the published simulation, which is a stiffness like any other.
    rows = [r for r in study if r["setting"] == "published"]
    error = np.nan_to_num(column(rows, "error_nm_rad"))
    yield "every defect, flagged runs as 0", "error", points(rows, "sample"), error
    for more, words in (
        ("human_angle", "without hold, strap_mask, human_angle"),
        ("nominal", "without hold, strap_mask, nominal"),
        ("nominal+human_angle", "without hold, strap_mask, nominal, human_angle"),
    ):
        left_out = f"hold+strap_mask+{more}"
        rows = [r for r in defects if r["left_out"] == left_out and r["arm"] != "nominal"]
        rows = held(rows)
        if len(rows) > 2 * len(FACTORS):
            for quantity in ("error", "K"):
                yield words, quantity, points(rows, "arm"), column(rows, quantities[quantity])


# Pairs of settings whose runs differ by one defect: with it, and with it left out too.
PAIRS = (
    ("none", "hold"),
    ("none", "strap_mask"),
    ("none", "drop"),
    ("none", "hold+strap_mask"),
    ("hold+strap_mask", "hold+strap_mask+nominal"),
    ("hold+strap_mask", "hold+strap_mask+human_angle"),
    ("hold+strap_mask", "hold+strap_mask+nominal+human_angle"),
)


def alone(study: Rows, defects: Rows) -> Iterator[tuple[str, str, int, int, float, float]]:
    """Of a defect left out: pairs of runs, flags that go, mean and spread of the change of error."""
    runs: dict[str, dict[str, dict[str, str]]] = {}
    for r in defects:
        if r["arm"] != "nominal":
            runs.setdefault(r["left_out"], {})[r["arm"]] = r
    for r in study:
        left_out = {"published": "none", "both_fixes": "hold+strap_mask"}[r["setting"]]
        runs.setdefault(left_out, {})[r["sample"]] = r
    for before, after in PAIRS:
        first, second = runs.get(before, {}), runs.get(after, {})
        pairs = [(first[arm], r) for arm, r in second.items() if arm in first]
        gone = sum(a["status"] != "ok" and b["status"] == "ok" for a, b in pairs)
        both = [(a, b) for a, b in pairs if held([a]) and held([b])]
        change = np.array([float(b["error_nm_rad"]) - float(a["error_nm_rad"]) for a, b in both])
        if len(change) > 2:
            words = [w.replace("+", ", ").replace("none", "every defect") for w in (before, after)]
            yield (*words, len(pairs), gone, float(change.mean()), float(change.std(ddof=1)))


def nominal_rows(defects: Rows) -> Iterator[str]:
    for r in defects:
        if r["arm"] != "nominal":
            continue
        words = "every defect" if r["left_out"] == "none" else r["left_out"].replace("+", ", ")
        if r["status"] != "ok":
            yield f"| {words} | | | {r['status']} |"
            continue
        k, true_k, error = (float(r[c]) for c in ("k_nm_rad", "true_k_nm_rad", "error_nm_rad"))
        yield f"| {words} | {k:.3f} | {true_k:.3f} | {error:+.3f} |"


def table(results: Path) -> Iterator[tuple[object, ...]]:
    """Rows of what-changed.csv."""
    study = rows_of(results / "published-study.csv")
    defects = rows_of(results / "published-defects.csv")
    for setting, quantity, x, y in rankings(study, defects):
        value, low, high = with_intervals(x, y)
        for name, *cells in zip((*FACTORS, "R2"), value, low, high, strict=True):
            yield (setting, quantity, len(y), name, *map(float, cells))


def told(results: Path, rows: list[tuple[object, ...]]) -> Iterator[str]:
    defects = rows_of(results / "published-defects.csv")
    yield "| left out | K | true K | error |\n|---|---|---|---|"
    yield from nominal_rows(defects)
    yield "\n| from | to without | pairs | flags that go | change of the error |\n|---|---|---|---|---|"
    study = rows_of(results / "published-study.csv")
    for before, after, pairs, gone, mean, spread in alone(study, defects):
        yield f"| {before} | {after} | {pairs} | {gone} | {mean:+.2f} ± {spread:.2f} |"
    names = ["x1", "x2", "x3", "x4", "x5", "x6", "R²"]
    yield "\n| setting | of | runs | " + " | ".join(names) + " |\n|---" + "|---" * 9 + "|"
    width = len(names)
    for k in range(0, len(rows), width):
        setting, quantity, runs = rows[k][:3]
        cells = [f"{r[4]:.2f} ({r[5]:.2f}–{r[6]:.2f})" for r in rows[k : k + width]]  # type: ignore
        yield f"| {setting} | {quantity} | {runs} | " + " | ".join(cells) + " |"


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--results", type=Path, default=RESULTS, help="folder of the stored runs")
    parser.add_argument("--to", type=Path, default=RESULTS / "what-changed.csv")
    chosen = parser.parse_args()
    rows = list(table(chosen.results))
    write(
        chosen.to,
        ("setting", "quantity", "runs", "factor", "part", "low", "high"),
        iter(rows),
    )
    print("\n".join(told(chosen.results, rows)))


if __name__ == "__main__":
    main()
