"""Analysis of a study beside SALib, and making a large design.

N = 10^5 base points, K = 20 factors, 1000 bootstrap resamples: 2.2 million outputs. SALib does the
same estimators and the same number of resamples in the same run, on one thread; the library too.
SALib is run on all factors once; it needs about 8 GB of memory.
"""

import time

import numpy as np
import pytest

import ulna
from ulna import study as st

K, N, RESAMPLES = 20, 100_000, 1000
best = {}


@pytest.fixture(scope="module")
def runs():
    factors = {f"x{i}": ulna.Uniform(0, 1) for i in range(K)}
    study = ulna.Study(factors)
    design = study.design(n=N, sampler="monte-carlo", seed=1)
    weights = np.arange(1.0, K + 1)
    y = np.empty(design.rows)
    for first in range(0, design.rows, 220_000):
        u = design.unit(first=first, count=min(220_000, design.rows - first))
        y[first : first + len(u)] = u @ weights + 5 * u[:, 0] * u[:, 1]
    return study.read_outputs(y)


def test_ulna(benchmark, runs):
    result = benchmark.pedantic(
        lambda: runs.sobol(resamples=RESAMPLES, threads=1), rounds=3, iterations=1
    )
    best["ulna"] = benchmark.stats.stats.min
    best["result"] = result


def test_salib(benchmark, runs, say):
    sobol = pytest.importorskip("SALib.analyze.sobol")
    problem = {"num_vars": K, "names": list(runs.design.factors), "bounds": [[0, 1]] * K}
    y = runs.output()
    out = benchmark.pedantic(
        lambda: sobol.analyze(
            problem, y, calc_second_order=False, num_resamples=RESAMPLES, conf_level=0.9, seed=1
        ),
        rounds=1,
        iterations=1,
    )
    theirs = benchmark.stats.stats.min
    ours = best["result"].to_salib()
    np.testing.assert_allclose(ours["ST"], out["ST"], atol=1e-12)
    np.testing.assert_allclose(ours["ST_conf"], out["ST_conf"], rtol=0.2)
    say(f"study: {theirs / best['ulna']:.0f} times as fast as SALib (at least 20 wanted)")
    assert theirs > 20 * best["ulna"]


@pytest.mark.parametrize("sampler", ["sobol", "latin", "monte-carlo"])
def test_design(sampler, say):
    factors = {f"x{i}": ulna.Uniform(0, 1) for i in range(50)}
    design = ulna.StudyDesign(factors, scheme="sample", sampler=sampler, n=2**20)
    start = time.perf_counter()
    for first in range(0, design.rows, 2**15):
        design.unit(first=first, count=2**15)
    took = time.perf_counter() - start
    say(f"design of 2^20 x 50, {sampler}: {took:.1f} s, 13 MB at a time")
    assert took < 20
    assert isinstance(design, st.StudyDesign)
