"""The bundled recording: its truth is found, and least squares is caught being wrong."""

from __future__ import annotations

import json
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

import ulna

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT / "examples" / "data"
sys.path.insert(0, str(ROOT / "examples" / "python"))

pytest.importorskip("scipy")
import relaxed_arm  # noqa: E402


@pytest.fixture(scope="module")
def truth():
    return json.loads((DATA / "relaxed-arm-truth.json").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def estimate():
    return ulna.identify_impedance(ulna.read(DATA / "relaxed-arm.csv"))


def _inside(estimate, truth, name):
    low, high = estimate.interval(name)
    return (low <= np.array(truth[name])) & (np.array(truth[name]) <= high)


def test_truth_is_that_of_table_3_2(truth):
    assert truth["M"] == [[1.33, -0.93], [-0.96, 1.89]]
    assert truth["B"] == [[5.75, -3.39], [-0.94, 10.6]]
    assert truth["K"] == [[42.45, -34.38], [-23.02, 125.43]]
    assert truth["x0"] == [-0.003, 0.529]


def test_truth_lies_in_the_intervals(estimate, truth):
    assert estimate.estimator == "instrumental_variables"
    inside = sum(_inside(estimate, truth, name).sum() for name in ("M", "B", "K"))
    assert inside >= 11  # of 12; at 95 % one miss is no surprise
    assert _inside(estimate, truth, "x0").all()


def test_least_squares_is_biased_and_flagged(estimate, truth):
    squares = estimate.least_squares
    assert squares.K[0, 0] < truth["K"][0][0] / 2
    assert not _inside(squares, truth, "K").all()
    assert squares.outcome == "closed_loop_biased"
    assert estimate.difference_p < 1e-3


def test_a_passive_arm_is_called_passive(estimate):
    verdict = estimate.passivity()
    assert verdict.verdict == "passive" and verdict.probability > 0.95
    # The excess of the true arm: the smallest eigenvalue of sym B.
    assert verdict.eop_interval[0] < 4.924 < verdict.eop_interval[1]


def test_the_script_makes_the_file(tmp_path, truth):
    table, facts = relaxed_arm.write_bundled(tmp_path, seed=truth["seed"])
    assert json.loads(facts.read_text(encoding="utf-8")) == truth
    made = np.loadtxt(table, delimiter=",", skiprows=1)
    stored = np.loadtxt(DATA / "relaxed-arm.csv", delimiter=",", skiprows=1)
    assert made.shape == stored.shape == (50000, 7)
    # Another BLAS may round a sample to the neighbouring step of its sensor.
    steps = np.array([1e-9, 3e-6, 3e-6, 0.043, 0.043, 1.1e-6, 1.1e-6])
    assert np.all(np.abs(made - stored) <= steps)
    assert (DATA / "relaxed-arm.csv").stat().st_size < 3.5e6


def test_a_repetition_does_not_depend_on_how_many_there_are():
    one = relaxed_arm.simulate(seed=3, duration_s=2.0)
    three = relaxed_arm.simulate(seed=3, duration_s=2.0, repetitions=3)
    # Matrix products of other shapes may round differently, by a step of a sensor at most.
    assert np.abs(one.position_m[0] - three.position_m[0]).max() < 2.1e-6
    assert np.abs(one.force_n[0] - three.force_n[0]).max() < 0.042
    assert np.abs(three.position_m[1] - three.position_m[0]).max() > 1e-3


def test_simulated_arm_obeys_its_equation():
    """Without tremor and sensor noise the impedance follows exactly from motion and force."""
    run = relaxed_arm.simulate(seed=1, tremor_n=0.0, sensors=False)
    log = _record(run, 0)
    estimate = ulna.identify_impedance(log, estimator="least_squares")
    arm = relaxed_arm.P1
    for name, true in (("M", arm.m_kg), ("B", arm.b_ns_m), ("K", arm.k_n_m)):
        # A noise-free trial is recovered to 1e-6.
        assert np.abs(getattr(estimate, name) - true).max() < 1e-6 * np.abs(true).max()
    assert np.abs(estimate.x0 - arm.x0_m).max() < 1e-6


def test_tremor_has_the_stated_power():
    run = relaxed_arm.simulate(
        seed=2, repetitions=4, peak_m=1e-12, stiffness_n_m=1e9, sensors=False
    )
    # A robot that stiff does not move, so the force sensor feels the tremor alone.
    rms = run.force_n.std(axis=1)
    # 50 s of noise in a 5 Hz band hold some 450 independent values: 3.3 % per axis and run.
    assert rms.mean() == pytest.approx(relaxed_arm.TREMOR_N, rel=0.06)


def _record(run, i):
    return ulna.Record.from_arrays(
        run.time_s,
        {
            "x": run.position_m[i, :, 0],
            "y": run.position_m[i, :, 1],
            "F_x": run.force_n[i, :, 0],
            "F_y": run.force_n[i, :, 1],
            "x_ref": run.reference_m[i, :, 0],
            "y_ref": run.reference_m[i, :, 1],
        },
    )


@pytest.mark.slow
def test_intervals_cover_the_truth_as_often_as_they_say():
    """200 recordings with other references and tremors: 95 % intervals hold 90 to 98 %."""
    arm = relaxed_arm.P1
    true = {"M": arm.m_kg, "B": arm.b_ns_m, "K": arm.k_n_m, "x0": arm.x0_m}
    inside = []
    flagged = 0
    for batch in range(4):
        run = relaxed_arm.simulate(seed=1000 + batch, repetitions=50)
        for i in range(50):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)
                estimate = ulna.identify_impedance(_record(run, i))
            flagged += estimate.least_squares.outcome == "closed_loop_biased"
            inside.append(np.concatenate([_inside(estimate, true, n).ravel() for n in true]))
    share = np.mean(inside)
    assert 0.90 <= share <= 0.98
    # One parameter alone has a standard error of 2 % in 200 recordings.
    assert np.mean(inside, axis=0).min() > 0.84
    assert flagged >= 190
