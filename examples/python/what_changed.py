"""What each defect of the published simulation (Tesfazgi 2023) does to the error of K and its ranking.

    python examples/python/what_changed.py

reads the stored runs of `published_study.py` and `published_defects.py` in docs/results, writes
what-changed.csv (parts in each setting) and what-changed-pairs.csv (how a defect moves them) there and
prints the tables of docs/what-changed.md. Nothing is run.

Some dozens of runs are too few for shares of the variance. A factor's part is its squared
standardised regression coefficient, with a 90 % interval from 2000 bootstrap samples of the runs;
these parts add up to the R² of a straight model when the factors are independent. What a defect does
to them is told by the same arms with and without it, drawn together, so that what the two settings
share does not widen the interval.
"""

import argparse
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from paper_study import write
from published_study import FACTORS, rows_of, samples

RESULTS = Path(__file__).resolve().parents[2] / "docs" / "results"
HELD_DEG = 60.0  # above, the arm has left its strap
LEVEL = (0.05, 0.95)
LEAST = 12  # runs for a ranking
ERROR = "error_nm_rad"
# Settings, by what is left out, whose runs differ by one defect or by the two that end runs.
PAIRS = (
    ("none", "hold"),
    ("none", "strap_mask"),
    ("none", "drop"),
    ("none", "hold+strap_mask"),
    ("hold+strap_mask", "hold+strap_mask+nominal"),
    ("hold+strap_mask", "hold+strap_mask+human_angle"),
    ("hold+strap_mask", "hold+strap_mask+nominal+human_angle"),
)

Row = dict[str, str]
Rows = list[Row]
# Runs of the same arms with a defect and without it.
Pairs = list[tuple[Row, Row]]


def parts(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Squared standardised regression coefficients, and R²."""
    x = (x - x.mean(axis=0)) / x.std(axis=0)
    y = (y - y.mean()) / y.std()
    slopes, *_ = np.linalg.lstsq(x, y, rcond=None)
    return np.append(slopes**2, 1.0 - np.var(y - x @ slopes))


def bootstrapped(
    found: Callable[[np.ndarray], np.ndarray], count: int, resamples: int = 2000
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What is found of all runs, by their places, and the ends of its intervals."""
    drawn = np.random.default_rng(0).integers(count, size=(resamples, count))
    low, high = np.quantile([found(i) for i in drawn], LEVEL, axis=0)
    return found(np.arange(count)), low, high


def with_intervals(
    x: np.ndarray, y: np.ndarray, resamples: int = 2000
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`parts`, and the ends of their intervals."""
    return bootstrapped(lambda i: parts(x[i], y[i]), len(y), resamples)


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
    for left_out in dict.fromkeys(after for _, after in PAIRS):
        rows = [r for r in defects if r["left_out"] == left_out and r["arm"] != "nominal"]
        rows = held(rows)
        if left_out != "hold+strap_mask" and len(rows) >= LEAST:
            for quantity in ("error", "K"):
                words = f"without {left_out.replace('+', ', ')}"
                yield words, quantity, points(rows, "arm"), column(rows, quantities[quantity])


def paired(study: Rows, defects: Rows) -> Iterator[tuple[str, str, Pairs]]:
    """Settings in words, and their runs of the same arms."""
    runs: dict[str, dict[str, Row]] = {}
    for r in defects:
        if r["arm"] != "nominal":
            runs.setdefault(r["left_out"], {})[r["arm"]] = r
    for r in study:
        left_out = {"published": "none", "both_fixes": "hold+strap_mask"}[r["setting"]]
        runs.setdefault(left_out, {})[r["sample"]] = r
    for before, after in PAIRS:
        first, second = runs.get(before, {}), runs.get(after, {})
        words = [w.replace("+", ", ").replace("none", "every defect") for w in (before, after)]
        yield *words, [(first[arm], r) for arm, r in second.items() if arm in first]


def both_held(pairs: Pairs) -> Pairs:
    return [(a, b) for a, b in pairs if held([a]) and held([b])]


def alone(pairs: Pairs) -> tuple[int, int, float, float]:
    """Of a defect left out: flags that go and that come, mean and spread of the change of error."""
    flagged = np.array([[r["status"] != "ok" for r in pair] for pair in pairs])
    gone, come = int((flagged @ [1, -1] == 1).sum()), int((flagged @ [1, -1] == -1).sum())
    kept = both_held(pairs)
    change = column([b for _, b in kept], ERROR) - column([a for a, _ in kept], ERROR)
    return gone, come, float(change.mean()), float(change.std(ddof=1))


def moved(study: Rows, defects: Rows) -> Iterator[tuple[object, ...]]:
    """Rows of what-changed-pairs.csv: how the parts of the error move, on the same arms."""
    for before, after, pairs in paired(study, defects):
        kept = both_held(pairs)
        if len(kept) < LEAST:
            continue
        x = points([b for _, b in kept], "arm" if "arm" in kept[0][1] else "sample")
        first, second = (column([pair[k] for pair in kept], ERROR) for k in (0, 1))

        def change(i: np.ndarray, x=x, first=first, second=second) -> np.ndarray:
            return parts(x[i], second[i]) - parts(x[i], first[i])

        for name, *cells in zip((*FACTORS, "R2"), *bootstrapped(change, len(kept)), strict=True):
            yield (before, after, len(kept), name, *map(float, cells))


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


def cells(rows: list[tuple[object, ...]], form: str) -> Iterator[str]:
    """Lines of a Markdown table, a setting each, of rows that are a factor each."""
    width = len(FACTORS) + 1
    for k in range(0, len(rows), width):
        found = [form.format(*row[4:7]) for row in rows[k : k + width]]
        yield "| " + " | ".join([*map(str, rows[k][:3]), *found]) + " |"


def told(
    results: Path, rows: list[tuple[object, ...]], changes: list[tuple[object, ...]]
) -> Iterator[str]:
    study = rows_of(results / "published-study.csv")
    defects = rows_of(results / "published-defects.csv")
    yield "| left out | K | true K | error |\n|---|---|---|---|"
    yield from nominal_rows(defects)
    yield "\n| from | to without | arms | flags that go, come | change of the error |\n" + "|---" * 5 + "|"
    for before, after, pairs in paired(study, defects):
        if len(both_held(pairs)) > 2:
            gone, come, mean, spread = alone(pairs)
            yield f"| {before} | {after} | {len(pairs)} | {gone}, {come} | {mean:+.2f} ± {spread:.2f} |"
    names = " | ".join(["x1", "x2", "x3", "x4", "x5", "x6", "R²"])
    yield f"\n| setting | of | runs | {names} |\n" + "|---" * 10 + "|"
    yield from cells(rows, "{:.2f} ({:.2f}, {:.2f})")
    yield f"\n| from | to without | runs | {names} |\n" + "|---" * 10 + "|"
    yield from cells(changes, "{:+.2f} ({:+.2f}, {:+.2f})")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--results", type=Path, default=RESULTS, help="folder of the stored runs")
    parser.add_argument("--to", type=Path, default=RESULTS, help="folder for the tables")
    chosen = parser.parse_args()
    rows = list(table(chosen.results))
    columns = ("runs", "factor", "part", "low", "high")
    write(chosen.to / "what-changed.csv", ("setting", "quantity", *columns), iter(rows))
    changes = list(
        moved(*(rows_of(chosen.results / f"published-{name}.csv") for name in ("study", "defects")))
    )
    columns = ("runs", "factor", "change", "low", "high")
    write(chosen.to / "what-changed-pairs.csv", ("from", "without", *columns), iter(changes))
    print("\n".join(told(chosen.results, rows, changes)))


if __name__ == "__main__":
    main()
