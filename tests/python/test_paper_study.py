"""The published study: 301 runs of it on the plant, and its programs from end to end."""

from __future__ import annotations

import csv
import shutil
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import ulna
from ulna import exo

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "examples" / "python"))
import paper_estimators  # noqa: E402
import paper_study  # noqa: E402
import published_defects  # noqa: E402
import published_study  # noqa: E402
import what_changed  # noqa: E402

RESULTS = ROOT / "docs" / "results"
# A faster movement from a start that need not be as still, bushings from fewer poses: 0.05 s a run.
BRIEF = exo.Protocol(
    duration_s=2.0, settle_s=0.1, start_angle_rad=0.1, start_rate_rad_s=1.0,
    start_rad=np.radians([0, -90, 0, 100]),
)  # fmt: skip
COARSE = {"poses": 9, "start_rad": np.radians(100), "end_rad": np.radians(5)}


def rows_of(path):
    with open(path, encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_three_hundred_runs_of_the_study(tmp_path):
    made = paper_study.study(threads=1, protocol=BRIEF, reduced=COARSE)
    found = paper_study.both_phases(made, tmp_path, r=15, n=28)
    assert len(found.screening_runs.y) + len(found.ranking_runs.y) == 301
    assert found.fixed == {"upper_mass_kg": 1.761} and found.kept == paper_study.RANKED
    one = found.screening["K_error"]
    # The upper arm's mass moves nothing at the elbow; an elbow beside the device's does.
    assert one.ranking[0] == "upper_factor" and one.ranking[-1] == "upper_mass_kg"
    (share,) = [row[1] for row in found.decisions() if row[0] == "upper_mass_kg"]
    assert share < found.share
    ranked = found.ranking["K_error"]
    assert ranked.ranking[:2] == ("upper_factor", "fore_mass_kg")
    first = [0, 2]  # places of these two
    assert ranked.intervals["total"][first, 0].min() > ranked.intervals["total"][1, 1]
    lost = len(found.screening_runs.failed) + len(found.ranking_runs.failed)
    assert lost < 0.1 * 301
    # The same call finds everything in its journals.
    again = paper_study.both_phases(made, tmp_path, r=15, n=28, budget_s=1e-9)
    np.testing.assert_array_equal(again.ranking_runs.y, found.ranking_runs.y)


def test_estimators_of_one_run(monkeypatch):
    arm = {"upper_factor": 0.95, "fore_factor": 0.9, "upper_mass_kg": 1.761, "fore_mass_kg": 1.1}
    soft = {"upper_stiffness_n_m": 400.0, "fore_stiffness_n_m": 600.0}
    found = paper_estimators.assess(**arm, **soft)
    (own,) = paper_study.study().function.run({k: [v] for k, v in (arm | soft).items()})["K_error"]
    assert found["own"] == own
    # Without its losses the device's own friction is taken for the arm's.
    assert len({round(value, 3) for value in found.values()}) == 4
    lost = SimpleNamespace(status="limit", reason="J4 left its range", record=None)
    monkeypatch.setattr(exo, "mobilise", lambda *a, **k: lost)
    with pytest.raises(ulna.study.RunFailed, match="J4 left its range"):
        paper_estimators.assess(**arm, **soft)


def test_the_program_of_the_estimators(tmp_path, monkeypatch, capsys):
    def model(**x):
        return {name: k + x["upper_factor"] for k, name in enumerate(paper_estimators.ESTIMATORS)}

    monkeypatch.setattr(paper_estimators, "assess", model)
    paper_estimators.main(["--out", str(tmp_path / "out"), "-n", "16", "--tables", str(tmp_path)])
    assert "Variance-based indices of published" in capsys.readouterr().out
    rows = rows_of(tmp_path / "paper-study-estimators.csv")
    assert rows[0].keys() == rows_of(RESULTS / "paper-study-estimators.csv")[0].keys()
    assert {r["estimator"] for r in rows} == set(paper_estimators.ESTIMATORS)
    assert len(rows) == 4 * len(paper_study.RANKED)


def cheap(full=False, adjusted=False, threads=0, **settings):
    """A study of these factors that computes nothing to speak of."""

    def model(**x):
        u = [factor.probability(x[name]) for name, factor in paper_study.FACTORS.items()]
        error = 5 * u[0] ** 2 - u[3] + (0.4 if full else 0.3) * u[5] * u[0] + 1e-3 * u[2]
        y = np.column_stack([error, error - 3 * u[1], u[4] + u[0], u[0], 0.1 * u[0]])
        y[(u[0] > 0.97) & (u[3] > 0.5)] = np.nan
        return y

    return ulna.Study(
        paper_study.FACTORS, model, outputs=paper_study.OUTPUTS, vectorized=True,
        units={"K_error": "N m/rad"},
    )  # fmt: skip


def test_the_program_from_end_to_end(tmp_path, monkeypatch, capsys):
    pytest.importorskip("matplotlib")
    monkeypatch.setattr(paper_study, "study", cheap)
    words = ["--out", str(tmp_path / "out"), "-r", "20", "-n", "300", "--full", "5", "--unguarded"]
    paper_study.main([*words, "--no-figures"])
    capsys.readouterr()
    tables = tmp_path / "tables"
    paper_study.main([*words, "--tell", "--tables", str(tables)])
    told = capsys.readouterr().out
    assert "of the full model: " in told and "Decision: fix what stays below 5 %" in told
    figures = {path.stem for path in (tmp_path / "out" / "figures").glob("*.png")}
    assert {f"fig-{k}" for k in range(8, 14)} == {
        "-".join(f.split("-")[:2]) for f in figures if f[:3] == "fig"
    }
    assert {"decision", "failures", "full-plant-K_error"} <= figures
    ranking = rows_of(tables / "paper-study-ranking.csv")
    combined = [r for r in ranking if r["plant"] == "full combined" and r["output"] == "K_error"]
    assert [r["factor"] for r in combined] == list(paper_study.RANKED)
    assert all(
        float(r["total_low"]) <= float(r["total"]) <= float(r["total_high"]) for r in combined
    )
    assert {r["estimator"] for r in ranking} == {"default", "parity", "failed runs as 0"}
    for name in ("screening", "convergence", "outputs", "slices", "unguarded"):
        rows = rows_of(tables / f"paper-study-{name}.csv")
        assert rows and None not in rows[0] and None not in rows[0].values()
        assert (tables / f"paper-study-{name}.csv").stat().st_size < 40_000
    # Without its runs there is nothing to tell.
    with pytest.raises(ulna.DataError, match="runs are missing"):
        paper_study.main(["--out", str(tmp_path / "other"), "--tell", "--no-figures"])


def test_parts_of_a_straight_model_are_its_shares():
    random = np.random.default_rng(1)
    x = random.random((2000, 6))
    y = 2 * x[:, 0] + x[:, 1] + 5
    value, low, high = what_changed.with_intervals(x, y, resamples=50)
    # Sampling leaves correlations of 1/sqrt(2000) between the factors.
    np.testing.assert_allclose(value, [0.8, 0.2, 0, 0, 0, 0, 1], atol=0.03)
    assert (low <= value + 1e-12).all() and (value <= high + 1e-12).all()


def test_pairs_of_runs_tell_what_a_defect_does():
    values = published_study.samples()[:40]
    x = (values - values.mean(axis=0)) / values.std(axis=0)

    def run(key, k, error, **more):
        ok = {"status": "ok", "largest_slip_deg": "10", "error_nm_rad": str(error)}
        return {key: str(k), **ok, **more}

    # With the defect the error follows the first factor, without it the second one.
    study = [run("sample", k, x[k, 0], setting="published") for k in range(40)]
    study[3]["status"] = "diverged"
    defects = [run("arm", k, x[k, 1] + 1, left_out="hold") for k in range(40)]
    (pairs,) = [p for b, a, p in what_changed.paired(study, defects) if (b, a) == ("every defect", "hold")]
    gone, come, mean, spread = what_changed.alone(pairs)
    kept = np.arange(40) != 3
    change = (x[:, 1] + 1 - x[:, 0])[kept]
    assert (gone, come) == (1, 0)
    assert (mean, spread) == pytest.approx((change.mean(), change.std(ddof=1)))
    rows = {r[3]: r for r in what_changed.moved(study, defects)}
    assert {r[:3] for r in rows.values()} == {("every defect", "hold", 39)}
    for name, exact in (("upper_factor", -1), ("fore_factor", 1), ("fore_mass_kg", 0), ("R2", 0)):
        assert rows[name][4:] == pytest.approx([exact] * 3)  # whatever is drawn
    assert list(what_changed.moved(study, defects[:8])) == []  # too few to rank


def test_what_changed_tells_of_the_stored_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["what_changed.py", "--to", str(tmp_path)])
    what_changed.main()
    for name in ("what-changed.csv", "what-changed-pairs.csv"):
        for made, stored in zip(rows_of(tmp_path / name), rows_of(RESULTS / name), strict=True):
            assert made.keys() == stored.keys()
            for cell, was in zip(made.values(), stored.values(), strict=True):
                # Another linear algebra changes the last of five digits at most.
                assert cell == was or float(cell) == pytest.approx(float(was), rel=1e-3, abs=1e-6)
    rows = rows_of(tmp_path / "what-changed.csv")
    part = {(r["setting"], r["quantity"], r["factor"]): float(r["part"]) for r in rows}
    for setting in ("every defect, arm held", "without hold, strap_mask"):
        error = [part[setting, "error", name] for name in published_study.FACTORS]
        assert int(np.argmax(error)) == 0  # the upper arm's length
        truth = [part[setting, "true K", name] for name in published_study.FACTORS]
        assert int(np.argmax(truth)) == 1  # the forearm's
    assert "| every defect | 6.210 | 6.101 | +0.110 |" in capsys.readouterr().out


def test_runs_of_the_defects_go_on_where_they_stopped(tmp_path, monkeypatch):
    table = tmp_path / "published-defects.csv"
    shutil.copy(RESULTS / "published-defects.csv", table)
    stored = rows_of(table)
    for row in stored:
        assert row["arm"] == "nominal" or int(row["arm"]) < published_study.SAMPLES
        assert set(row["left_out"].split("+")) <= {*exo.PUBLISHED_DEFECTS, "none"}
    asked = []

    def never(name, *rest):
        asked.append(name)
        return iter(())

    monkeypatch.setattr(published_defects, "run_once", never)
    monkeypatch.setattr(published_defects, "run_estimators", never)
    done = {row["arm"] for row in stored}
    published_defects.run(table, estimators=range(0), alone=range(0))
    assert rows_of(table) == stored and "nominal" in done
