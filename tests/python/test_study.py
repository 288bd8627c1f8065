"""Studies from Python: any function, SALib's layout, failures, journals, figures."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import inspect
import json
import os
import pathlib
import pickle
import signal
import subprocess
import sys
import threading
import time
import warnings
from itertools import combinations

import numpy as np
import pytest

import ulna
from ulna import study as st
from ulna._call import lib
from ulna._study_indices import OPTIONS, STATUSES
from ulna._study_plan import described

X = ulna.Uniform(-np.pi, np.pi)
FIRST = np.array([0.313905191148, 0.442411144790, 0.0])
TOTAL = np.array([0.557588855210, 0.442411144790, 0.243683664062])


def ishigami(x1, x2, x3):
    return np.sin(x1) + 7 * np.sin(x2) ** 2 + 0.1 * x3**4 * np.sin(x1)


@pytest.fixture(scope="module")
def study():
    return ulna.Study({"x1": X, "x2": X, "x3": X}, ishigami, vectorized=True)


# Factors -------------------------------------------------------------------------------------------


def test_quantiles_are_those_of_scipy():
    stats = pytest.importorskip("scipy.stats")
    p = np.linspace(0.001, 0.999, 301)
    pairs = [
        (ulna.Uniform(-1, 3), stats.uniform(-1, 4)),
        (ulna.Normal(2, 0.5), stats.norm(2, 0.5)),
        (st.TruncatedNormal(1, 2, -1, 2), stats.truncnorm(-1, 0.5, 1, 2)),
        (st.TruncatedNormal(0, 1, 3, 8), stats.truncnorm(3, 8)),
        (st.Triangular(1, 2, 5), stats.triang(0.25, 1, 4)),
        (st.LogUniform(0.1, 10), stats.loguniform(0.1, 10)),
    ]
    for factor, other in pairs:
        np.testing.assert_allclose(factor.quantile(p), other.ppf(p), rtol=1e-10, atol=1e-12)
        np.testing.assert_allclose(factor.probability(other.ppf(p)), p, rtol=0, atol=1e-10)


def test_discrete_values_come_as_often_as_they_weigh():
    factor = st.Discrete([1.0, 5.0, 2.0], [0.5, 0.3, 0.2])
    values = factor.quantile(np.linspace(0.0005, 0.9995, 1000))
    assert [float(np.mean(values == v)) for v in (1, 5, 2)] == [0.5, 0.3, 0.2]


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: ulna.Uniform(1, 1), "high must be above low"),
        (lambda: ulna.Normal(0, -1), "deviation must be positive"),
        (lambda: st.LogUniform(-1, 1), "positive"),
        (lambda: st.Triangular(0, 3, 2), "between low and high"),
        (lambda: st.Discrete([1, 2], [1]), "as many as values"),
        (lambda: st.Discrete([]), "at least one value"),
        (lambda: ulna.Uniform(0, float("nan")), "finite"),
    ],
)
def test_bad_distributions_are_refused(make, words):
    with pytest.raises(ulna.ArgumentError, match=words):
        make()


# Designs -------------------------------------------------------------------------------------------


def test_a_design_travels_as_its_specification(study):
    design = study.design(scheme="radial", sampler="latin", n=40, seed=3, dummy=True)
    other = pickle.loads(pickle.dumps(design))
    assert np.array_equal(other.unit(), design.unit())
    assert np.array_equal(design.unit(first=37, count=11), design.unit()[37:48])
    assert design.names == ("x1", "x2", "x3", "dummy")
    assert design.function_factors == ("x1", "x2", "x3")


def test_a_large_design_takes_seconds_and_little_memory():
    factors = {f"x{i}": ulna.Uniform(0, 1) for i in range(50)}
    design = ulna.StudyDesign(factors, scheme="sample", n=2**20)
    start = time.process_time()
    sums = np.zeros(50)
    for first in range(0, design.rows, 2**16):
        sums += design.unit(first=first, count=2**16).sum(0)
    # About a second; the limit is for a machine that is busy or builds with checks.
    assert time.process_time() - start < 30
    # A net: every coordinate has one point in each of the 2^20 strata, so the mean errs by 2^-21.
    np.testing.assert_allclose(sums / 2**20, 0.5, rtol=0, atol=2.0**-20)


@pytest.mark.parametrize(
    ("keywords", "words"),
    [
        ({"n": 1000}, "take 512 or 1024"),
        ({"n": 0}, "at least 1"),
        ({"n": 2.5}, "whole number"),
        ({"scheme": "grid"}, "must be one of 'saltelli'"),
        ({"sampler": "halton"}, "must be one of 'sobol'"),
        ({"guard": 0.7, "scheme": "radial"}, "below 0.5"),
        ({"guard": 0.2, "scheme": "radial", "sampler": "pooled-latin"}, "leave out guard"),
        ({"scheme": "trajectories", "levels": 3}, "even"),
        ({"seed": 1.5}, "whole number"),
        ({"points": np.zeros((4, 3))}, "sampler 'given'"),
        ({"groups": {"nothing": "g"}}, "name no factor"),
    ],
)
def test_bad_designs_are_refused(keywords, words):
    factors = {"x1": X, "x2": X, "x3": X}
    with pytest.raises(ulna.ArgumentError, match=words):
        ulna.StudyDesign(factors, **keywords)


def test_trajectories_need_bounded_factors():
    study = ulna.Study({"a": ulna.Normal(0, 1), "b": X}, lambda a, b: a + b)
    with pytest.raises(ulna.ArgumentError, match="need bounded factors"):
        study.screen(r=4, scheme="trajectories")
    assert study.screen(r=4).mu_star.shape == (2,)


# Indices -------------------------------------------------------------------------------------------


def test_ishigami(study):
    result = study.sobol(n=4096, seed=1, second_order=True)
    # 4096 scrambled points: errors of 0.01.
    np.testing.assert_allclose(result.first, FIRST, atol=0.02)
    np.testing.assert_allclose(result.total, TOTAL, atol=0.02)
    assert abs(result.second[0, 2] - 0.243683664062) < 0.04
    assert np.array_equal(result.second, result.second.T, equal_nan=True)
    assert result.ranking == ("x1", "x2", "x3")
    assert result.intervals["first"].shape == (3, 2)
    assert result.intervals["second"].shape == (3, 3, 2)
    assert result.dummy["first"] == (0.0, 0.0, 0.0)
    text = result.summary()
    assert max(map(len, text.splitlines())) <= 80
    assert "x1 x x3" in text
    assert "0.5" in repr(result) and "±" in repr(result)


def test_a_function_of_numbers_gives_the_same(study):
    plain = ulna.Study(study.factors, ishigami).sobol(n=64, seed=4)
    # A power of an array may round otherwise than one of a number.
    np.testing.assert_allclose(plain.total, study.sobol(n=64, seed=4).total, rtol=1e-12)


def test_results_are_frozen_and_repeatable(study):
    one, two = (study.sobol(n=128, seed=0, resamples=100) for _ in range(2))
    assert np.array_equal(one.intervals["total"], two.intervals["total"])
    assert not np.array_equal(one.total, study.sobol(n=128, seed=1, resamples=100).total)
    with pytest.raises(AttributeError):
        one.first = None


def test_replicates_give_their_own_interval(study):
    result = study.sobol(n=128, replicates=16, seed=2)
    assert result.interval == "replicates"
    assert result.blocks == 2048
    inside = (result.intervals["total"][:, 0] < TOTAL) & (TOTAL < result.intervals["total"][:, 1])
    assert inside.sum() >= 2
    bootstrap = study.sobol(n=2048, seed=2)
    # The bootstrap does not know that the sequence is even.
    assert (result.errors["total"] < bootstrap.errors["total"]).all()


def test_product_estimators_show_the_noise_of_a_dummy(study):
    inside = 0
    for seed in range(40):
        result = study.sobol(
            n=512, sampler="monte-carlo", estimator="martinez", seed=seed, resamples=200
        )
        value, low, high = result.dummy["first"]
        assert low < value < high
        assert 0 < abs(value) < 0.2
        inside += low < 0 < high
    # 90 % of 40; below 31 or all of them with a chance of 2 %.
    assert 31 <= inside <= 39


def test_a_random_function_has_a_noise_floor():
    rng = np.random.default_rng(1)
    noisy = ulna.Study({"a": ulna.Uniform(0, 1)}, lambda a: a + 0.3 * rng.normal())
    result = noisy.sobol(n=512, dummy=True, seed=1)
    assert result.names == ("a", "dummy")
    # Half of the squared difference of two draws is the variance of the noise.
    expected = 0.09 / (1 / 12 + 0.09)
    assert abs(result.total[1] - expected) < 0.1


def test_constant_output_is_said(study):
    flat = ulna.Study(study.factors, lambda x1, x2, x3: 2.5)
    with pytest.warns(ulna.UncertainResult, match="does not vary"):
        result = flat.sobol(n=16)
    assert result.outcome == "constant" and np.isnan(result.total).all()
    assert "does not vary" in result.summary() and "does not vary" in repr(result)
    with pytest.warns(ulna.UncertainResult):
        assert (flat.screen(r=4).mu_star == 0).all()


def test_groups(study):
    grouped = ulna.Study(
        study.factors, ishigami, vectorized=True, groups={"x1": "odd", "x3": "odd"}
    )
    result = grouped.sobol(n=4096, seed=1)
    assert result.names == ("odd", "x2")
    np.testing.assert_allclose(result.total, [TOTAL[0], TOTAL[1]], atol=0.02)
    screen = grouped.screen(r=32, seed=1)
    assert np.isnan(screen.mu[0]) and np.isfinite(screen.mu_star).all()
    assert "odd" in screen.summary()


def test_screening(study):
    result = study.screen(r=500, seed=1)
    assert result.mu_star.shape == (3,)
    assert max(map(len, result.summary().splitlines())) <= 80
    with pytest.raises(ulna.ArgumentError, match="independent"):
        result.total  # noqa: B018
    free = study.screen(r=4096, guard=0, seed=1)
    np.testing.assert_allclose(free.total, TOTAL, atol=0.06)
    idle = ulna.Study(study.factors, lambda x1, x2, x3: x1 + 1e-6 * x2)
    assert idle.screen(r=16).negligible() == ("x2", "x3")


def test_convergence(study):
    result = study.sobol(n=1024, seed=1, resamples=100)
    steps = result.convergence()
    assert steps.subset == "prefix"
    assert steps.runs.tolist() == [5 * 16 * 2**k for k in range(7)]
    assert np.array_equal(steps.values["total"][-1], result.total)
    latin = study.screen(r=50, seed=1, resamples=100).convergence(sizes=[10, 50])
    assert latin.subset == "random"
    assert latin.values["mu_star"].shape == (2, 3)
    with pytest.raises(ulna.ArgumentError, match="prefix"):
        result.convergence(subset="half")


def test_convergence_leaves_out_what_failures_leave_too_little_of(study):
    broken = ulna.Study(study.factors, fails_in_a_corner)
    runs = broken.run(broken.design(n=64, seed=3), on_failure="drop_block")
    runs.status[: 3 * 5] = STATUSES.index("diverged")  # three blocks, and some others
    result = runs.sobol(on_failure="drop_block", resamples=50)
    steps = result.convergence()
    assert 4 * 5 <= steps.runs[0] <= 16 * 5 and steps.runs[-1] == 64 * 5
    assert np.array_equal(steps.values["total"][-1], result.total)
    with pytest.raises(ulna.DataError, match="complete blocks"):
        result.convergence(sizes=[2])


def test_several_outputs(study):
    def model(x1, x2, x3):
        return {"y": ishigami(x1, x2, x3), "z": x2}

    runs = ulna.Study(study.factors, model, outputs=("y", "z"), vectorized=True)
    runs = runs.run(runs.design(n=256))
    assert runs.sobol(output="z").first[1] == pytest.approx(1.0, abs=0.02)
    assert runs.sobol().output == "y"
    with pytest.raises(ulna.ArgumentError, match="no output 'w'"):
        runs.sobol(output="w")


def test_bad_calls_are_refused(study):
    runs = study.run(study.design(n=16))
    for keywords, words in [
        ({"estimator": "best"}, "must be one of 'default'"),
        ({"interval": "sigma"}, "must be one of 'percentile'"),
        ({"on_failure": "ignore"}, "must be one of 'error'"),
        ({"level": 1.5}, "between 0 and 1"),
        ({"resamples": 10}, "from 50"),
        ({"resamples": 0}, "at least 50"),
        ({"interval": "replicates"}, "at least two"),
    ]:
        with pytest.raises(ulna.ArgumentError, match=words):
            runs.sobol(**keywords)
    with pytest.raises(ulna.ArgumentError, match="radial"):
        runs.screen()
    with pytest.raises(ulna.ArgumentError, match="no function"):
        ulna.Study({"a": X}).sobol(n=4)
    with pytest.raises(ulna.ArgumentError, match="other factors"):
        ulna.Study({"a": X}, lambda a: a).run(study.design(n=4))
    for wrong in ({}, [X], {"a": 3.0}, {"": X}):
        with pytest.raises(ulna.ArgumentError):
            ulna.Study(wrong)
    with pytest.raises(ulna.ArgumentError):
        ulna.Study({"a": X}, outputs="y")
    with pytest.raises(ulna.ArgumentError):
        ulna.Study({"a": X}, outputs=())
    with pytest.raises(ulna.ArgumentError):
        ulna.Study({"a": X}, function=3)


WRONG_OPTIONS = [
    ("sobol", {"resample": 100}, "did you mean 'resamples'"),
    ("sobol", {"worker": 2}, "did you mean 'workers'"),
    ("sobol", {"estimator": "jannon"}, "must be one of 'default'"),
    ("sobol", {"estimator": ["janon"]}, "must be one of 'default'"),
    ("sobol", {"interval": "bac"}, "must be one of 'percentile'"),
    ("sobol", {"interval": "replicates"}, "at least two"),
    ("sobol", {"level": 90}, "between 0 and 1"),
    ("sobol", {"level": "high"}, "between 0 and 1"),
    ("sobol", {"output": "z"}, "no output 'z'"),
    ("sobol", {"resamples": 10}, "from 50"),
    ("sobol", {"resamples": "many"}, "a whole number"),
    ("sobol", {"on_failure": "drop"}, "must be one of 'error'"),
    ("sobol", {"n": 1}, "at least two complete blocks"),
    ("screen", {"estimator": "janon"}, "'estimator' means nothing here"),
    ("screen", {"level": 0}, "between 0 and 1"),
    ("screen", {"guard": -0.3}, "at least 0 and below 0.5"),
    ("screen", {"guard": -1.0}, "at least 0 and below 0.5"),
    ("screen", {"guard": float("nan")}, "at least 0 and below 0.5"),
    ("screen", {"guard": "wide"}, "at least 0 and below 0.5"),
    ("screen", {"guard": 0.5}, "at least 0 and below 0.5"),
    ("screen", {"budget_s": "1h"}, "budget_s is '1h'; it must be a positive number"),
    ("screen", {"timeout_s": [1]}, "timeout_s"),
    ("two_phase", {"share": 5}, "share is 5"),
    ("two_phase", {"share": "5 %"}, "share is '5 %'"),
    ("two_phase", {"keep": 3}, "keep must be names"),
    ("two_phase", {"decide_by": [["y"]]}, "decide_by must be names"),
    ("two_phase", {"values": {"x1": "low"}}, "x1 is to be fixed at 'low'"),
    ("two_phase", {"values": ["x1"]}, "values must map factors"),
    ("two_phase", {"screening": {"estimator": "janon"}}, "screening: 'estimator'"),
    ("two_phase", {"ranking": {"estimater": "janon"}}, "did you mean 'estimator'"),
    ("two_phase", {"ranking": {"estimator": "jannon"}}, "must be one of 'default'"),
    ("two_phase", {"ranking": {"sampler": "halton"}}, "must be one of 'sobol'"),
    ("two_phase", {"ranking": {"seed": 3}}, "ranking: 'seed'"),
    ("two_phase", {"n": 1000}, "take 512 or 1024"),
    ("patient", {"quantities": "K"}, "no output 'K'"),
    ("patient", {"quantities": {"y": -1.0}}, "must be 0 or more"),
    ("patient", {"level": 90}, "between 0 and 1"),
    ("patient", {"method": "guess"}, "must be one of reweight"),
    ("patient", {"measurable": ["x4"]}, "measurable must be names"),
    ("patient", {"observed": {"y": (1.0, 0.0)}}, "standard error above 0"),
    ("patient", {"observed": {"z": (1.0, 0.1)}}, "observed names no output"),
    ("patient", {"covariance": [[1.0]]}, "nothing observed"),
    ("patient", {"on_failure": "nearest"}, "left out"),
    ("patient", {"n": 32}, "too few"),
    ("patient", {"n": 0}, "at least 1"),
]


@pytest.mark.parametrize(("analysis", "chosen", "words"), WRONG_OPTIONS)
def test_wrong_options_are_refused_before_a_run(study, analysis, chosen, words):
    calls = []
    counted = ulna.Study(study.factors, lambda **x: calls.append(x) or ishigami(**x))
    with pytest.raises((ulna.ArgumentError, ulna.DataError), match=words):
        getattr(counted, analysis)(**chosen)
    assert not calls


def test_an_emulator_of_too_few_runs_is_refused_before_them(study):
    pytest.importorskip("sklearn")
    calls = []
    counted = ulna.Study(study.factors, lambda **x: calls.append(x) or ishigami(**x))
    with pytest.raises(ulna.ArgumentError, match="takes 16 to 1000 good runs"):
        counted.patient(method="emulator", n=8)
    assert not calls


def test_what_an_analysis_may_be_told_is_what_it_takes():
    for name, known in OPTIONS.items():
        taken = set(inspect.signature(getattr(st.Runs, name)).parameters)
        assert taken == {"self", "output", "on_failure", "seed", *known}


# Failed runs ---------------------------------------------------------------------------------------


def fails_in_a_corner(x1, x2, x3):
    if x1 > 0.6 * np.pi and x2 > 0.6 * np.pi:
        raise st.RunFailed("diverged", "too far")
    return ishigami(x1, x2, x3)


def test_a_failed_run_is_an_error_unless_told_otherwise(study):
    broken = ulna.Study(study.factors, fails_in_a_corner)
    with pytest.raises(ulna.DataError, match=r"diverged: too far\) at x1 = (1\.9|2|3)") as caught:
        broken.sobol(n=64)
    assert caught.value.detail.startswith("row ")


def test_the_functions_own_error_is_shown_with_its_row(study):
    def bug(x1, x2, x3):
        raise KeyError("torque")

    with pytest.raises(KeyError) as caught:
        ulna.Study(study.factors, bug).sobol(n=4)
    assert "in run 0 of the study" in caught.value.__notes__[0]
    point = study.design(n=4).values()[0]
    where = ", ".join(f"x{k} = {x:.6g}" for k, x in enumerate(point, 1))
    with pytest.raises(ulna.DataError, match="every run failed") as caught:
        ulna.Study(study.factors, bug).sobol(n=4, on_failure="drop_block")
    assert str(caught.value).endswith(
        f"; 20 of 20 runs have status 'raised', first run 0 ({where}): KeyError: 'torque'"
    )


def test_an_analysis_that_failures_make_impossible_says_why_they_failed(study):
    def mostly(x1, x2, x3):
        if x1 > -2.4:
            raise st.RunFailed("diverged", "too far") if x2 > 2 else ValueError("boom")
        return x1

    broken = ulna.Study(study.factors, mostly)
    runs = broken.run(broken.design(n=16, seed=1, dummy=True), on_failure="drop_block")
    count = sum("boom" in words for words in runs.messages.values())
    told = f"; {count} of 96 runs have status 'raised', first run .*: ValueError: boom"
    for treatment, words in (("drop_block", "fewer than two"), ("error", "runs failed")):
        with pytest.raises(ulna.DataError, match=words + ".*" + told) as caught:
            runs.sobol(on_failure=treatment)
    assert caught.value.detail.startswith("row ") and "dummy" not in str(caught.value)
    with pytest.raises(ulna.DataError, match="status 'nonfinite', first run 0$"):
        broken.read_outputs(np.full(20, np.nan)).sobol(on_failure="drop_block")


@pytest.mark.parametrize("treatment", ["drop_block", "nearest", "surface"])
def test_failures_are_reported(study, treatment):
    broken = ulna.Study(study.factors, fails_in_a_corner)
    runs = broken.run(broken.design(n=512, seed=1), on_failure=treatment)
    result = runs.sobol(on_failure=treatment, resamples=100)
    report = result.failures
    assert report.rows == len(runs.failed) and report.by_status == {"diverged": report.rows}
    assert report.flip_share["x3"] == 0 < report.flip_share["x1"]
    assert report.total["x1"] > 0.5 > report.total["x3"] == 0
    assert sum(report.by_factor.values()) + report.base == report.rows
    assert f"{report.rows} runs failed" in result.summary()
    assert runs.messages[int(runs.failed[0])] == "too far"
    if treatment == "surface":
        whole = study.sobol(n=512, seed=1, interval="none")
        np.testing.assert_allclose(result.total, whole.total, atol=0.01)
        assert report.surface_r2 > 0.9


def test_arrays_and_wrong_results(study):
    def half(x1, x2, x3):
        return np.where(x1 > 3, np.nan, x1)

    runs = ulna.Study(study.factors, half, vectorized=True)
    with pytest.raises(ulna.DataError, match=r"returned \[nan\]"):
        runs.sobol(n=64)
    lost = runs.run(runs.design(n=64), on_failure="nearest")
    assert set(lost.status) == {0, STATUSES.index("nonfinite")}
    for out in ("text", [1.0, 2.0], None):
        with pytest.raises((ulna.DataError, ValueError, TypeError)):
            ulna.Study({"a": X}, lambda a, out=out: out).sobol(n=4)
    with pytest.raises(ulna.DataError, match="shape"):
        ulna.Study({"a": X}, lambda a: a[:3], vectorized=True).sobol(n=4)


def test_a_complex_result_is_none():
    """Its imaginary part is not dropped; where there is none, nothing is."""
    def root(a):
        return np.emath.sqrt(a)

    one = ulna.Study({"a": X}, root)
    design = one.design(n=16)
    lost = design.values()[:, 0] < 0
    for vectorized in (False, True):
        both = ulna.Study({"a": X}, root, vectorized=vectorized)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            runs = both.run(design, on_failure="nearest")
        assert np.array_equal(runs.status == STATUSES.index("raised"), lost)
        assert np.array_equal(runs.y[~lost, 0], np.sqrt(design.values()[~lost, 0]))
        assert "returned a complex number" in runs.messages[int(runs.failed[0])]
        with pytest.raises(ulna.DataError, match="returned a complex number, a real one expected"):
            both.run(design)


def test_switches_are_true_or_false(study):
    with pytest.raises(ulna.ArgumentError, match="vectorized is 'no'; it must be true or false"):
        ulna.Study({"a": X}, vectorized="no")
    with pytest.raises(ulna.ArgumentError, match="isolate is 'no'; it must be true or false"):
        study.run(study.design(n=4), isolate="no")


def test_statuses_have_the_numbers_of_the_library():
    for code, name in enumerate(STATUSES):
        assert getattr(lib, "ULNA_ROW_" + name.upper()) == code
    with pytest.raises(ulna.ArgumentError):
        st.RunFailed("sad")
    assert pickle.loads(pickle.dumps(st.RunFailed("limit", "knee"))).status == "limit"


# SALib ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("second_order", [False, True])
def test_indices_are_those_of_salib(study, second_order):
    pytest.importorskip("SALib")
    from SALib.analyze import sobol
    from SALib.sample import sobol as sample

    problem = {"num_vars": 3, "names": ["x1", "x2", "x3"], "bounds": [[-np.pi, np.pi]] * 3}
    x = sample.sample(problem, 512, calc_second_order=second_order, seed=1)
    y = ishigami(*x.T)
    theirs = sobol.analyze(problem, y, calc_second_order=second_order, num_resamples=200, seed=1)
    runs = ulna.Study.from_problem(problem).read_outputs(y, x=x, second_order=second_order)
    result = runs.sobol(level=0.95)
    ours = result.to_salib()
    # The same estimators but for the mean that is taken off: there of all runs, here of A and B.
    # In mean(B (C - A)) that shows as the difference of the means, times mean(C - A).
    blocks = y.reshape(512, -1)
    ends = blocks[:, [0, -1]]
    shift = (y.mean() - ends.mean()) / ends.var()
    lift = (blocks[:, 1:4] - blocks[:, :1]).mean(0)
    expected = {"S1": theirs["S1"] + shift * lift, "ST": theirs["ST"]}
    if second_order:
        back = (blocks[:, 4:7] - blocks[:, 7:]).mean(0)
        pairs = shift * (back[:, None] + lift[None, :] - lift[:, None] - lift[None, :])
        expected["S2"] = theirs["S2"] + pairs
    for key in ["S1", "ST"] + ["S2"] * second_order:
        # Rounding.
        np.testing.assert_allclose(ours[key], expected[key], rtol=0, atol=1e-12)
        # Half widths are of resamples: about 10 % apart.
        np.testing.assert_allclose(ours[key + "_conf"], theirs[key + "_conf"], rtol=0.4)


def test_effects_are_those_of_salib():
    pytest.importorskip("SALib")
    from SALib.analyze import morris
    from SALib.sample import morris as sample

    problem = {"num_vars": 3, "names": ["a", "b", "c"], "bounds": [[0, 1], [-1, 1], [2, 5]]}
    x = sample.sample(problem, 40, seed=1)
    y = np.exp(x[:, 0]) * x[:, 1] + x[:, 2] ** 2
    theirs = morris.analyze(problem, x, y, seed=1, num_resamples=50)
    runs = ulna.Study.from_problem(problem).read_outputs(y, x=x, scheme="trajectories")
    ours = runs.screen().to_salib()
    for key in ("mu", "mu_star", "sigma"):
        # Effects per unit of quantile, as there. Values go through floats of their own.
        np.testing.assert_allclose(ours[key], np.asarray(theirs[key], float), rtol=1e-9)


def test_a_problem_there_and_back():
    factors = {
        "a": ulna.Uniform(0, 2),
        "b": ulna.Normal(1, 3),
        "c": st.TruncatedNormal(1, 2, -1, 4),
        "d": st.Triangular(1, 2, 5),
        "e": st.LogUniform(0.1, 10),
    }
    study = ulna.Study(factors, groups={"a": "g", "b": "g"})
    back = ulna.Study.from_problem(study.problem)
    assert back.factors == factors
    assert back.problem == study.problem
    util = pytest.importorskip("SALib.util")
    design = study.design(scheme="sample", n=64)
    unit = design.unit().copy()
    problem = study.problem
    scaled = util.nonuniform_scale_samples(unit, problem["bounds"], problem["dists"]) if hasattr(
        util, "nonuniform_scale_samples"
    ) else util._nonuniform_scale_samples(unit, problem["bounds"], problem["dists"])
    np.testing.assert_allclose(design.values(), scaled, rtol=1e-9, atol=1e-9)
    with pytest.raises(ulna.ArgumentError, match="no distribution"):
        ulna.Study({"a": st.Discrete([1, 2])}).problem  # noqa: B018
    for wrong in (
        {"names": ["a"]},
        {"names": ["a", "a"], "bounds": [[0, 1]] * 2},
        {"names": ["a"], "bounds": [[0, 1]], "dists": ["cauchy"]},
        {"names": ["a"], "bounds": [[0, 1]], "groups": ["g", "h"]},
    ):
        with pytest.raises(ulna.ArgumentError):
            ulna.Study.from_problem(wrong)


def test_outputs_of_a_wrong_size_are_refused(study):
    with pytest.raises(ulna.ArgumentError, match="blocks of 5 rows"):
        study.read_outputs(np.zeros(12))
    with pytest.raises(ulna.ArgumentError, match="x must be"):
        study.read_outputs(np.zeros(10), x=np.zeros((10, 2)))
    with pytest.raises(ulna.Error, match="points"):
        study.read_outputs(np.arange(8.0), scheme="radial").screen()


@pytest.mark.parametrize("method", ["pawn", "delta", "rbd_fast"])
def test_given_data(study, method):
    pytest.importorskip("SALib")
    n = 128 if method == "delta" else 1024  # it draws slowly
    result = study.sample(n=n, seed=1).given_data(method=method, resamples=5)
    again = study.sample(n=n, seed=1).given_data(method=method, resamples=5)
    assert result.rows == n and np.array_equal(result.half_width, again.half_width, equal_nan=True)
    assert set(np.argsort(result.value)[1:]) == {0, 1} or method != "rbd_fast"
    assert "x2" in result.summary()
    if method == "rbd_fast":
        np.testing.assert_allclose(result.value, FIRST, atol=0.08)
    with pytest.raises(ulna.ArgumentError, match="must be 'pawn'"):
        study.sample(n=64).given_data(method="fast")


# Journals ------------------------------------------------------------------------------------------

COUNTED = """
import os, sys, time
import ulna

log, folder, slow, workers = sys.argv[1], sys.argv[2], float(sys.argv[3]), int(sys.argv[4])

def model(a, b):
    with open(log, "a") as calls:
        calls.write(f"{a!r} {b!r}\\n")
    time.sleep(slow)
    return a * a + 0.1 * b

study = ulna.Study({"a": ulna.Uniform(0, 1), "b": ulna.Normal(0, 1)}, model)
result = study.sobol(n=64, seed=3, resamples=100, journal=folder, workers=workers)
print(result.first.tobytes().hex(), result.intervals["total"].tobytes().hex())
"""
ROWS = 64 * 4


def _script(tmp_path):
    path = tmp_path / "model.py"
    path.write_text(COUNTED, encoding="utf-8")
    return path


def _kill_often(tmp_path, kills, slow, workers):
    """Kills a study again and again; returns the calls of its model and what it printed at last."""
    script, log = _script(tmp_path), tmp_path / "calls.txt"
    rng = np.random.default_rng(5)
    command = [sys.executable, str(script), str(log), str(tmp_path / "study"), str(slow)]
    command.append(str(workers))
    killed = 0
    log.touch()
    for _ in range(kills):
        before = len(log.read_text().splitlines())
        with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
            # Not before it runs at all; then at any moment.
            while len(log.read_text().splitlines()) == before and process.poll() is None:
                time.sleep(0.005)
            time.sleep(rng.uniform(0, 8 * slow))
            process.send_signal(signal.SIGKILL)
            killed += process.wait() == -signal.SIGKILL
    last = subprocess.run(command, capture_output=True, text=True, check=True)
    return log.read_text().splitlines(), last.stdout, killed


def _check_kills(tmp_path, kills, slow, workers=1):
    calls, printed, killed = _kill_often(tmp_path, kills, slow, workers)
    assert killed >= kills - 1
    # Nothing lost, nothing that was done is run again: only the runs under way at each kill.
    assert len(set(calls)) == ROWS
    assert ROWS <= len(calls) <= ROWS + killed * workers
    undisturbed = subprocess.run(
        [sys.executable, str(tmp_path / "model.py"), str(tmp_path / "other.txt"),
         str(tmp_path / "undisturbed"), "0", "1"],
        capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    assert printed == undisturbed


def test_a_killed_study_goes_on_where_it_stopped(tmp_path):
    _check_kills(tmp_path, 3, 0.004)


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2])
def test_twenty_kills(tmp_path, workers):
    _check_kills(tmp_path, 20, 0.01, workers)


def square(a):
    return a * a


def test_a_journal_keeps_results_times_and_failures(tmp_path):
    study = ulna.Study({"a": ulna.Uniform(-1, 1)}, square)
    design = study.design(n=16)
    first = study.run(design, journal=tmp_path / "s")
    again = study.run(design, journal=tmp_path / "s")
    assert np.array_equal(first.y, again.y) and np.array_equal(first.wall_s, again.wall_s)

    def fails(a):
        if a > 0:
            raise st.RunFailed("limit", "positive")
        return a

    broken = ulna.Study({"a": ulna.Uniform(-1, 1)}, fails)
    with pytest.raises(ulna.DataError, match="another plan") as caught:
        broken.run(design, journal=tmp_path / "s")
    assert caught.value.__notes__ == ["what differs: function, source"]
    one = broken.run(design, journal=tmp_path / "t", on_failure="nearest")
    two = broken.run(design, journal=tmp_path / "t", on_failure="nearest")
    assert np.array_equal(one.status, two.status) and one.messages == two.messages
    with pytest.raises(ulna.DataError, match="limit: positive"):
        broken.run(design, journal=tmp_path / "t")


def test_an_error_of_the_function_is_no_result(tmp_path):
    """A bug is repaired and the row run again; a failed run is final."""
    calls = []

    def model(a):
        calls.append(a)
        if len(calls) == 5:
            raise KeyError("typo")
        return a

    study = ulna.Study({"a": ulna.Uniform(0, 1)}, model)
    design = study.design(n=8)
    with pytest.raises(KeyError):
        study.run(design, journal=tmp_path / "s")
    runs = study.run(design, journal=tmp_path / "s")
    assert len(calls) == 24 + 1 and np.isfinite(runs.y).all()


def test_arrays_are_journalled_too(study, tmp_path):
    design = study.design(n=32)
    one = study.run(design, journal=tmp_path / "s")
    journal = tmp_path / "s" / "main.journal"
    journal.write_bytes(journal.read_bytes()[:-200])
    two = study.run(design, journal=tmp_path / "s")
    assert np.array_equal(one.y, two.y)


def test_journal_by_hand(tmp_path):
    kept = st.StudyJournal(tmp_path / "s", plan={"seed": 1}, rows=4, outputs=2, sync_s=0)
    kept.append(2, 0, 0.5, np.array([1.0, 2.0]))
    kept.append(0, 2, 0.5, np.array([np.nan, np.nan]), "far \N{DEGREE SIGN}")
    kept.sync()
    assert kept.records == 2 and kept.damaged_bytes == 0 and len(kept.hash) == 64
    assert kept.status.tolist() == [2, -1, 0, -1]
    assert kept.message(0) == "far \N{DEGREE SIGN}" and kept.message(1) == ""
    with pytest.raises(ValueError, match="2 numbers"):
        kept.append(1, 0, 0.0, np.zeros(3))
    with pytest.raises(ulna.DataError, match="two different results"):
        kept.append(2, 0, 0.5, np.array([1.0, 3.0]))
    with pytest.raises(ulna.FileError, match="another process"):
        st.StudyJournal(tmp_path / "s", plan={"seed": 1}, rows=4, outputs=2)
    reader = st.StudyJournal(tmp_path / "s", plan={"seed": 1}, rows=4, outputs=2, writer=None)
    assert reader.values[2].tolist() == [1.0, 2.0]
    assert reader.wall_s[2] == 0.5
    kept.close()
    st.StudyJournal(tmp_path / "s", plan={"seed": 1}, rows=4, outputs=2).close()


FULL = """
import resource, sys
import numpy as np, ulna
from ulna import study as st

kept = st.StudyJournal(sys.argv[1], plan={"seed": 1}, rows=100, outputs=1)
for row in range(20):
    kept.append(row, 0, 0.0, np.array([1.0 * row]))
size = 64 + 20 * 48 + 30  # the next record does not fit any more
resource.setrlimit(resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))
try:
    kept.append(20, 0, 0.0, np.array([20.0]))
except ulna.FileError as failure:
    print(failure)
resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
for row in range(20, 30):
    kept.append(row, 0, 0.0, np.array([1.0 * row]))
"""


def test_a_full_disk_gives_an_error_and_a_usable_journal(tmp_path):
    script = tmp_path / "full.py"
    script.write_text(FULL, encoding="utf-8")
    folder = tmp_path / "s"
    out = subprocess.run(
        [sys.executable, str(script), str(folder)], capture_output=True, text=True, check=True
    ).stdout
    assert "cannot be written to" in out and "File too large" in out
    kept = st.StudyJournal(folder, plan={"seed": 1}, rows=100, outputs=1)
    assert kept.records == 30 and kept.damaged_bytes == 0


def test_an_unwritable_folder_gives_an_error(study, tmp_path):
    (tmp_path / "file").write_text("x")
    with pytest.raises(ulna.FileError, match="file"):
        study.sobol(n=4, journal=tmp_path / "file" / "s")
    with pytest.raises(ulna.FileError):
        study.sobol(n=4, journal="/proc/ulna-study")


# What a plan says of a function --------------------------------------------------------------------


def scaled(a, gain=1.0):
    return gain * a


def keeps(gain):
    def model(a):
        return gain * a

    return model


class Scaled:
    def __init__(self, gain):
        self.gain = gain
        self.calls = 0

    def __call__(self, a):
        self.calls += 1
        return self.gain * a

    def run(self, a):
        return self(a)


@dataclasses.dataclass(frozen=True)
class Settings:
    gain: float
    folder: pathlib.PurePath = pathlib.PurePosixPath("arms")


def by_default(gain):
    def model(a, gain=gain, *, more=(gain,)):
        return gain * a

    return model


def through(function, gain):
    @functools.wraps(function)
    def model(a):
        return gain * function(a)

    return model


HELD = {
    "keyword": lambda gain: functools.partial(scaled, gain=gain),
    "partial of a partial": lambda gain: functools.partial(functools.partial(scaled), gain=gain),
    "closure": keeps,
    "default": by_default,
    "object": Scaled,
    "method": lambda gain: Scaled(gain).run,
    "array": lambda gain: keeps(np.array([1.0, gain])),
    "dataclass": lambda gain: keeps(Settings(gain)),
    "set": lambda gain: keeps({"x", "y", gain}),
    "dict": lambda gain: keeps({"x": [gain], "y": {"z": (gain, None, b"w")}}),
    "function": lambda gain: keeps(keeps(gain)),
    "decorator": lambda gain: through(square, gain),
    "cache": lambda gain: functools.cache(keeps(gain)),
    "one of two": lambda gain: (lambda a: a, lambda a: 10 * a)[gain == 10],
}


@pytest.mark.parametrize("how", HELD)
def test_what_a_function_holds_is_part_of_the_plan(tmp_path, how):
    """Another gain is another model; the same gain, held anew, is the same."""
    make = HELD[how]
    assert described(make(1)) == described(make(1))
    assert described(make(1)).unknown == ()
    if how in ("keyword", "closure", "object", "method", "one of two"):
        factors = {"a": ulna.Uniform(0, 1)}
        design = ulna.Study(factors).design(n=4)
        first = ulna.Study(factors, make(1)).run(design, journal=tmp_path)
        again = ulna.Study(factors, make(1)).run(design, journal=tmp_path)
        assert np.array_equal(first.wall_s, again.wall_s)
        with pytest.raises(ulna.DataError, match="another plan") as caught:
            ulna.Study(factors, make(10)).run(design, journal=tmp_path)
        assert caught.value.__notes__ == ["what differs: state"]
    assert described(make(1)).state != described(make(10)).state


def test_a_function_is_described_alike_in_every_process():
    code = (
        "import sys; sys.path.insert(0, sys.argv[1])\n"
        "import test_study as t\n"
        "print({how: t.described(make(1)).state for how, make in t.HELD.items()})"
    )
    said = [
        subprocess.run(
            [sys.executable, "-c", code, str(pathlib.Path(__file__).parent)],
            capture_output=True, text=True, check=True,
            env={**os.environ, "PYTHONHASHSEED": seed},
        ).stdout
        for seed in ("1", "2")
    ]  # fmt: skip
    assert said[0] == said[1] and len(said[0]) > 64 * len(HELD)


def test_a_plain_function_is_its_text():
    """Journals of earlier releases go on."""
    told = described(square)
    source = "def square(a):\n    return a * a\n"
    assert told == described(square) and told.state is None
    assert told.source == hashlib.sha256(source.encode()).hexdigest()


def test_what_the_runs_change_in_a_function_is_no_other_function(tmp_path):
    model = Scaled(2.0)
    study = ulna.Study({"a": X, "b": X}, lambda a, b: model(a) + b)
    design = study.design(n=4)
    first = study.run(design, journal=tmp_path / "s")
    assert model.calls == design.rows
    assert np.array_equal(study.run(design, journal=tmp_path / "s").wall_s, first.wall_s)
    assert np.array_equal(study.collect(design, journal=tmp_path / "s").wall_s, first.wall_s)
    part = study.fix(b=0.5)
    part.run(part.design(n=4), journal=tmp_path / "t")
    plan = json.loads((tmp_path / "t" / "plan.json").read_text())
    assert plan["state"] == json.loads((tmp_path / "s" / "plan.json").read_text())["state"]
    model.gain = 3.0
    with pytest.raises(ulna.DataError, match="another plan"):
        study.run(design, journal=tmp_path / "s")


def test_state_that_no_plan_can_hold_is_told(tmp_path):
    def make(lock):
        return lambda a: a if lock else 0.0

    model = make(threading.Lock())
    study = ulna.Study({"a": X}, model)
    with pytest.warns(ulna.UncertainResult, match=r"does not hold lock \(a lock\).*plan_source"):
        study.run(study.design(n=4), journal=tmp_path / "s")
    assert described(model).state == described(make(threading.Lock())).state
    model.plan_source = "version 1"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        study.run(study.design(n=4), journal=tmp_path / "t")
        ulna.Study({"a": X}, make(threading.Lock())).sobol(n=4)


# Figures -------------------------------------------------------------------------------------------


@pytest.fixture
def pyplot(monkeypatch):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    yield plt
    plt.close("all")


def _inside(figure):
    """No visible text reaches beyond the paper."""
    from matplotlib.text import Text

    figure.canvas.draw()
    width, height = figure.canvas.get_width_height()
    beyond = set()  # labels of ticks outside the limits are there but not drawn
    for ax in figure.axes:
        for axis, limits in ((ax.xaxis, ax.get_xlim()), (ax.yaxis, ax.get_ylim())):
            for tick in (*axis.get_major_ticks(), *axis.get_minor_ticks()):
                if not min(limits) <= tick.get_loc() <= max(limits):
                    beyond |= {id(tick.label1), id(tick.label2)}
    for text in figure.findobj(Text):
        if not text.get_visible() or not text.get_text().strip() or id(text) in beyond:
            continue
        box = text.get_window_extent()
        if box.width == 0:
            continue
        assert -2 <= box.x0 and box.x1 <= width + 2, text.get_text()
        assert -2 <= box.y0 and box.y1 <= height + 2, text.get_text()


def test_figures(study, pyplot):
    result = study.sobol(n=256, seed=1, resamples=100)
    axes = result.plot()
    assert "sum" in axes[0].get_title(loc="left")
    assert [label.get_text() for label in axes[0].get_yticklabels()] == ["x1", "x2", "x3"]
    np.testing.assert_allclose(axes[1].lines[0].get_xdata(), result.total)
    _inside(axes[0].figure)
    screen = study.screen(r=32, seed=1, resamples=100)
    ax = screen.plot()
    assert "µ*" in ax.get_xlabel()
    _inside(ax.figure)
    for steps in (result.convergence(), screen.convergence(sizes=[8, 32])):
        axes = steps.plot()
        assert len(axes) == 2
        _inside(axes[0].figure)
    runs = study.sample(n=256)
    _inside(runs.plot_density().figure)
    _inside(runs.plot_scatter().flat[0].figure)
    pairs = runs.plot_pairs()
    assert [(ax.get_xlabel(), ax.get_ylabel()) for ax in pairs.flat] == [
        ("x1", "x2"), ("x1", "x3"), ("x2", "x3")
    ]  # fmt: skip
    _inside(pairs.flat[0].figure)
    (pair,) = runs.plot_pairs(factors=["x3", "x1"]).flat
    assert (pair.get_xlabel(), pair.get_ylabel()) == ("x3", "x1")
    assert pair.figure.axes[-1].get_xlabel() == "y"
    for wrong in (["x1"], ["x1", "x9"], "x1", ["x1", "x1"]):
        with pytest.raises(ulna.ArgumentError, match="two to four of x1, x2, x3"):
            runs.plot_pairs(factors=wrong)
    broken = ulna.Study(study.factors, fails_in_a_corner)
    lost = broken.run(broken.design(n=64), on_failure="nearest")
    axes = lost.plot_failures()
    # The two factors of the corner are found.
    assert (axes[0].get_xlabel(), axes[0].get_ylabel()) == ("x1", "x2")
    _inside(axes[0].figure)
    figure, two = pyplot.subplots(1, 2)
    assert list(result.plot(two)) == list(two)
    with pytest.raises(ulna.ArgumentError, match="1 x 2 axes"):
        result.plot(two[0])


def test_figures_of_odd_results(study, pyplot):
    many = {f"factor {i}": ulna.Uniform(0, 1) for i in range(20)}
    wide = ulna.Study(many, lambda **x: sum(i * v for i, v in enumerate(x.values())))
    _inside(wide.screen(r=8, seed=1, resamples=50).plot().figure)
    result = wide.sobol(n=32, seed=1, interval="none")
    _inside(result.plot()[0].figure)
    assert "no intervals" in result.summary()
    with pytest.warns(ulna.UncertainResult):
        flat = ulna.Study(study.factors, lambda x1, x2, x3: 1.0)
        _inside(flat.sobol(n=8).plot()[0].figure)
        _inside(flat.screen(r=8).plot().figure)
    one = ulna.Study({"a": X}, square)
    runs = one.run(one.design(n=16))
    for figure in (runs.plot_density().figure, runs.plot_scatter().flat[0].figure,
                   runs.plot_failures()[0].figure):  # fmt: skip
        _inside(figure)
    with pytest.raises(ulna.ArgumentError, match="pairs need two factors"):
        runs.plot_pairs()


# The long versions ---------------------------------------------------------------------------------


def g_function(a):
    a = np.asarray(a, dtype=float)
    part = 1 / (3 * (1 + a) ** 2)
    whole = np.prod(1 + part)

    def value(u):
        return np.prod((np.abs(4 * u - 2) + a) / (1 + a), axis=1)

    return value, part / (whole - 1), part * whole / (1 + part) / (whole - 1)


def bratley(u):
    return np.cumprod(u, axis=1) @ ((-1.0) ** np.arange(1, u.shape[1] + 1))


def morris20(u):
    w = 2 * (u - 0.5)
    for i in (2, 4, 6):
        w[:, i] = 2 * (1.1 * u[:, i] / (u[:, i] + 0.1) - 0.5)
    y = 20 * w[:, :10].sum(1)
    for i, j in combinations(range(6), 2):
        y -= 15 * w[:, i] * w[:, j]
    for i, j, k in combinations(range(5), 3):
        y -= 10 * w[:, i] * w[:, j] * w[:, k]
    return y + 5 * w[:, 0] * w[:, 1] * w[:, 2] * w[:, 3]


def known_functions():
    yield "ishigami", lambda u: ishigami(*(2 * np.pi * (u - 0.5)).T), FIRST, TOTAL
    for a in [(0, 0.5, 3, 9, 99, 99), (0,) * 4, (0, 1, 4.5, 9, 99, 99, 99, 99), (99,) * 3,
              (0, 1, 2, 4, 8)]:  # fmt: skip
        yield f"G{a}", *g_function(a)
    yield (
        "bratley",
        bratley,
        np.array([0.6528636616, 0.1791303924, 0.03701041165, 0.0133237482, 0.001480416466,
                  0.001480416466]),
        np.array([0.7396477462, 0.265914477, 0.07642116935, 0.03431154542, 0.006238462804,
                  0.006238462804]),
    )  # fmt: skip
    first = [0.0069263356, 0.0069263356, 0.014973192, 0.0069263356, 0.014973192, 9.4975281e-6,
             0.060947994, 0.12563637, 0.12563637, 0.12563637] + [0.0] * 10  # fmt: skip
    total = [0.25717197, 0.25717197, 0.11154116, 0.25717197, 0.11140007, 0.093535452,
             0.060947994, 0.12563637, 0.12563637, 0.12563637] + [0.0] * 10  # fmt: skip
    yield "morris20", morris20, np.array(first), np.array(total)


@pytest.mark.slow
@pytest.mark.parametrize("sampler", ["monte-carlo", "latin"])
@pytest.mark.parametrize("case", list(known_functions()), ids=lambda case: case[0])
def test_estimates_and_intervals_over_many_designs(case, sampler):
    """200 designs: unbiased within 3 standard errors, 90 % intervals hold 86 to 94 %."""
    _, function, first, total = case
    count, designs = len(first), 200
    factors = {f"x{i}": ulna.Uniform(0, 1) for i in range(count)}
    exact = np.concatenate([first, total])
    values, hits = [], np.zeros(2 * count)
    for seed in range(designs):
        design = ulna.StudyDesign(factors, n=1024, sampler=sampler, seed=seed)
        y = function(design.unit())[:, None]
        runs = st.Runs(design, y, np.zeros(len(y), np.int32), np.full(len(y), np.nan))
        result = runs.sobol(resamples=500, seed=seed)
        values.append(np.concatenate([result.first, result.total]))
        bounds = np.concatenate([result.intervals["first"], result.intervals["total"]])
        hits += (bounds[:, 0] <= exact) & (exact <= bounds[:, 1])
    values = np.array(values)
    error = values.std(0, ddof=1) / np.sqrt(designs)
    vary = error > 0
    # A ratio of two means has a bias of the order of its size over n.
    miss = np.abs(values.mean(0) - exact)
    z = np.where(vary, (miss - exact / 1024) / np.where(vary, error, 1), 0)
    assert (miss[~vary] < 1e-12).all()
    # 3 standard errors; of up to 40 indices at once one may be a little beyond.
    assert np.sum(z > 3) <= (1 if count > 4 else 0) and z.max() < 4
    # The share over all indices. One index alone is known to 2 % (200 designs): 3 of those wider.
    share = hits[vary].mean() / designs
    assert 0.86 < share < 0.94
    assert (np.abs(hits[vary] / designs - 0.9) < 0.04 + 3 * 0.021).all()


def share_inside(function, first, total, designs, **chosen):
    """Of each index, first and total: how often its 90 % interval holds it."""
    factors = {f"x{i}": ulna.Uniform(0, 1) for i in range(len(first))}
    exact, hits = np.concatenate([first, total]), np.zeros(2 * len(first))
    for seed in range(designs):
        design = ulna.StudyDesign(factors, seed=seed, **chosen)
        y = function(design.unit())[:, None]
        runs = st.Runs(design, y, np.zeros(len(y), np.int32), np.full(len(y), np.nan))
        result = runs.sobol(resamples=200, seed=seed)
        bounds = np.concatenate([result.intervals["first"], result.intervals["total"]])
        hits += (bounds[:, 0] <= exact) & (exact <= bounds[:, 1])
    return hits / designs


def test_intervals_of_a_small_sequence_come_from_replicates():
    """Of a sequence the bootstrap may be far too sure, or too wide; replicates are neither."""
    _, *case = next(case for case in known_functions() if case[0] == "bratley")
    designs = 100
    bootstrap = share_inside(*case, 60, n=256)
    assert bootstrap[8] < 0.5  # the third factor's total: its estimates lie in two clusters
    replicates = share_inside(*case, designs, n=64, replicates=16)
    # 0.9 within 3 standard deviations of a binomial of 100; all twelve together within 0.04, as the
    # small indices, whose estimates are skew, lie somewhat low.
    assert (np.abs(replicates - 0.9) < 3 * np.sqrt(0.09 / designs)).all()
    assert abs(replicates.mean() - 0.9) < 0.04
    # So do intervals of points that are not even, but for the smallest indices.
    latin = share_inside(*case, designs, n=256, sampler="latin")
    assert abs(latin[8] - 0.9) < 3 * np.sqrt(0.09 / designs)


# Functions that say how their runs ended ------------------------------------------------------------


def test_a_run_table_carries_statuses(tmp_path):
    sizes = []

    def model(a, b):
        sizes.append(len(a))
        status = np.where(a > 0.9, "diverged", "ok").tolist()
        values = np.column_stack([a + b, a * b])
        values[0, 1] = np.nan if len(sizes) == 1 else values[0, 1]  # called ok, and is no number
        messages = {i: f"a is {a[i]:.2f}" for i, word in enumerate(status) if word != "ok"}
        return st.RunTable(values, status, np.full(len(a), 0.25), messages)

    model.rows_at_once = 32
    study = ulna.Study(
        {"a": ulna.Uniform(0, 1), "b": ulna.Uniform(0, 1)}, model, outputs=("sum", "product"),
        vectorized=True,
    )  # fmt: skip
    design = study.design(scheme="sample", n=128, seed=1)
    runs = study.run(design, on_failure="drop_block", journal=tmp_path)
    assert sizes == [32] * 4
    lost = design.values()[:, 0] > 0.9
    words = np.array(STATUSES)[runs.status]
    assert (words[lost] == "diverged").all()
    assert words[0] == "nonfinite" and np.isnan(runs.y[0]).all()
    assert (words[~lost][1:] == "ok").all()
    assert runs.wall_s == pytest.approx(0.25)
    first = int(np.flatnonzero(lost)[0])
    assert runs.messages[first].startswith("a is 0.9")
    again = study.run(design, on_failure="drop_block", journal=tmp_path)
    assert len(sizes) == 4
    np.testing.assert_array_equal(again.y, runs.y)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        (lambda a: st.RunTable(a, ["ok"]), "as many statuses"),
        (lambda a: st.RunTable(a, ["ok"] * len(a), [1.0]), "as many statuses"),
        (lambda a: st.RunTable(a, ["fine"] * len(a)), "has the status 'fine'"),
        (lambda a: st.RunTable(a[:-1], ["ok"] * (len(a) - 1)), "returned an array of shape"),
    ],
)
def test_wrong_run_tables_are_refused(table, words):
    study = ulna.Study({"a": ulna.Uniform(0, 1)}, table, vectorized=True)
    with pytest.raises(ulna.DataError, match=words):
        study.sample(n=16)
