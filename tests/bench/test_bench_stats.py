"""Statistics of a study beside pingouin and SciPy, and a million frames of an arm support."""

import numpy as np
import pytest

from ulna.assist import ForceCurve, PassiveDevice
from ulna.stats import compare_pairs, repeated_anova

best = {}


@pytest.fixture(scope="module")
def effort():
    return 20 + np.random.default_rng(1).normal(size=(12, 2, 5)).cumsum(axis=2)


def test_anova_ulna(benchmark, effort):
    benchmark(lambda: repeated_anova(effort))
    best["anova"] = benchmark.stats.stats.min


def test_anova_pingouin(benchmark, effort, say):
    pingouin = pytest.importorskip("pingouin")
    pandas = pytest.importorskip("pandas")
    s, a, b = np.indices(effort.shape).reshape(3, -1)
    table = pandas.DataFrame({"s": s, "a": a, "b": b, "y": effort.reshape(-1)})
    theirs = benchmark.pedantic(
        lambda: pingouin.rm_anova(table, dv="y", within=["a", "b"], subject="s"),
        rounds=3,
        iterations=1,
    )
    mine = repeated_anova(effort)
    np.testing.assert_allclose([e.f for e in mine.effects], theirs["F"], rtol=1e-9)
    say(
        f"analysis of variance: {benchmark.stats.stats.min / best['anova']:.0f} times pingouin's speed"
    )


def test_bootstrap_ulna(benchmark, effort):
    first, second = effort[:, 0], effort[:, 1]
    benchmark(lambda: compare_pairs(first, second, resamples=10000))
    best["bootstrap"] = benchmark.stats.stats.min


def test_bootstrap_scipy(benchmark, effort, say):
    stats = pytest.importorskip("scipy.stats")

    def all_measures():
        for block in range(5):
            pair = effort[:, 0, block], effort[:, 1, block]
            for statistic in (
                lambda a, b, axis: (b - a).mean(axis=axis),
                lambda a, b, axis: b.mean(axis=axis) / a.mean(axis=axis) - 1,
                lambda a, b, axis: (b - a).mean(axis=axis) / (b - a).std(axis=axis, ddof=1),
            ):
                stats.bootstrap(pair, statistic, paired=True, vectorized=True, n_resamples=10000)

    benchmark.pedantic(all_measures, rounds=3, iterations=1)
    say(
        f"paired bootstrap: {benchmark.stats.stats.min / best['bootstrap']:.1f} times SciPy's speed"
    )


def test_a_million_frames_of_an_arm_support(benchmark, say):
    rng = np.random.default_rng(0)
    shoulder = np.zeros((1_000_000, 2, 3))
    arm = rng.normal(size=shoulder.shape)
    hip = np.zeros((1_000_000, 3))
    device = PassiveDevice(ForceCurve.parametric(peak_n=35))
    benchmark.pedantic(lambda: device.wrenches(shoulder, arm, hip), rounds=3, iterations=1)
    say(f"arm support: {benchmark.stats.stats.min:.2f} s for a million frames of both arms")
