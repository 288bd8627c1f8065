"""Few runs of a full model and many of a cheap one: closed forms, spread, refusals."""

from __future__ import annotations

import numpy as np
import pytest

import ulna
from ulna import study as studies

FACTORS = {name: ulna.Normal(0.0, 1.0) for name in ("a", "b", "c")}


def full(a, b, c):
    return 1 + 2 * a + b + 0.5 * a * b + 0.5 * c


def cheap(a, b, c):
    """Another mean, other slopes, no interaction."""
    return 3 + 1.7 * a + 1.2 * b + 0.3 * c


# Of the full model, in closed form: V_a = 4, V_b = 1, V_c = V_ab = 1/4.
MEAN, VARIANCE = 1.0, 5.5
FIRST = np.array([4, 1, 0.25]) / VARIANCE
TOTAL = np.array([4.25, 1.25, 0.25]) / VARIANCE
CORRELATION = (2 * 1.7 + 1.2 + 0.5 * 0.3) / np.sqrt(VARIANCE * (1.7**2 + 1.2**2 + 0.3**2))


def runs_of(function, **design):
    made = ulna.Study(FACTORS, function, vectorized=True, units={"y": "N m/rad"})
    return made.run(made.design(**{"sampler": "monte-carlo", **design}))


def test_estimates_spread_and_intervals_agree_with_the_closed_form():
    seeds, m, n = 100, 64, 512
    found = [
        studies.multi_fidelity(
            runs_of(cheap, n=n, seed=seed), runs_of(full, n=m, seed=seed), resamples=80, seed=seed
        )
        for seed in range(seeds)
    ]
    exact = {"mean": MEAN, "variance": VARIANCE, "first": FIRST, "total": TOTAL}
    for name, truth in exact.items():
        values = np.array([one.value[name] for one in found])
        spread = values.std(axis=0, ddof=1)
        # Ratios and fitted slopes have a bias of the order of 1/m, a tenth of the spread here.
        assert (np.abs(values.mean(axis=0) - truth) <= (3 / np.sqrt(seeds) + 0.15) * spread).all()
        ends = np.array([one.intervals[name] for one in found])
        held = ((ends[..., 0] <= truth) & (truth <= ends[..., 1])).mean(axis=0)
        # 90 % intervals: three standard errors of a share of 100 are 9 %, and percentile intervals
        # of 64 blocks and 80 resamples hold a little less than they say.
        assert (held >= 0.79).all() and (held <= 0.99).all(), (name, held)
        alone = np.array([one.alone[name] for one in found]).std(axis=0, ddof=1)
        assert (spread[..., None] < alone[..., None]).all(), name
    # Of the mean the spread is known: ends of a block are two independent runs.
    predicted = np.sqrt(VARIANCE / 2 / m * (1 - CORRELATION**2 * (1 - m / n)))
    # The spread of 100 has a standard error of 7 %.
    assert np.std([one.value["mean"] for one in found], ddof=1) == pytest.approx(
        predicted, rel=0.21
    )
    gain = np.median([one.gain["mean"] for one in found])
    assert gain == pytest.approx(1 / (1 - CORRELATION**2 * (1 - m / n)), rel=0.15)
    assert np.mean([one.correlation for one in found]) == pytest.approx(CORRELATION, abs=0.01)


@pytest.mark.parametrize("second_order", [False, True])
def test_a_cheap_model_that_is_the_full_one_gives_its_own_estimates(second_order):
    many = runs_of(full, n=256, seed=3, second_order=second_order, sampler="sobol")
    few = runs_of(full, n=32, seed=3, second_order=second_order, sampler="sobol")
    found = studies.multi_fidelity(many, few, resamples=50)
    whole = many.sobol(interval="none")
    assert found.value["mean"] == pytest.approx(whole.mean, abs=1e-12)
    assert found.value["variance"] == pytest.approx(whole.variance, rel=1e-12)
    np.testing.assert_allclose(found.value["first"], whole.first, atol=1e-12)
    np.testing.assert_allclose(found.value["total"], whole.total, atol=1e-12)
    assert found.correlation == pytest.approx(1.0)
    np.testing.assert_allclose(found.cheap["total"], whole.total, atol=1e-12)
    np.testing.assert_allclose(found.alone["total"], few.sobol(interval="none").total, atol=1e-12)


def test_all_runs_in_full_are_the_estimate_of_the_full_model():
    many, all_of = runs_of(cheap, n=128, seed=1), runs_of(full, n=128, seed=1)
    found = studies.multi_fidelity(many, all_of, resamples=50)
    np.testing.assert_allclose(
        found.value["first"], all_of.sobol(interval="none").first, atol=1e-12
    )
    assert found.value["mean"] == found.alone["mean"]


def test_a_cheap_model_of_nothing_costs_little():
    noise = np.random.default_rng(0).standard_normal

    def nothing(a, b, c):
        return noise(len(a))

    ratios = [
        studies.multi_fidelity(
            runs_of(nothing, n=512, seed=seed), runs_of(full, n=64, seed=seed), resamples=200
        ).gain["mean"]
        for seed in range(10)
    ]
    # 1 but for the fitted slope, which costs 1/m.
    assert np.median(ratios) == pytest.approx(1.0, abs=0.1)


def test_a_plain_sample_has_mean_and_variance():
    many = runs_of(cheap, scheme="sample", n=2000, seed=1)
    few = runs_of(full, scheme="sample", n=200, seed=1)
    found = studies.multi_fidelity(many, few, resamples=200)
    assert set(found.value) == {"mean", "variance"} and found.ranking == ()
    assert abs(found.value["mean"] - MEAN) < 4 * found.errors["mean"]
    assert abs(found.value["variance"] - VARIANCE) < 4 * found.errors["variance"]
    with pytest.raises(ulna.ArgumentError, match="no indices to draw"):
        found.plot()


def test_shards_budgets_and_failures(tmp_path):
    def fragile(a, b, c):
        return np.where(a > 1.5, np.nan, full(a, b, c))

    base = ulna.Study(FACTORS, cheap, vectorized=True)
    design = base.design(sampler="latin", n=300, seed=4)
    low = base.run(design)
    other = ulna.Study(FACTORS, fragile, vectorized=True)
    tenth = other.run(design, shard=(1, 5), journal=tmp_path, on_failure="drop_block")
    assert tenth.missing.size == 4 / 5 * design.rows
    lost = len({row // design.block_rows for row in tenth.failed})
    assert lost > 0
    with pytest.raises(ulna.DataError, match="hold a failed run; choose on_failure 'drop_block'"):
        studies.multi_fidelity(low, tenth)
    found = studies.multi_fidelity(low, tenth, on_failure="drop_block", resamples=50)
    assert (found.blocks, found.dropped) == (60 - lost, lost)
    assert found.cheap_blocks == 300 - lost
    again = studies.multi_fidelity(low, tenth, on_failure="drop_block", resamples=50)
    np.testing.assert_array_equal(found.intervals["first"], again.intervals["first"])


def test_what_cannot_be_is_said(tmp_path):
    low = runs_of(cheap, n=64, seed=1)

    def refused(words, high, error=ulna.ArgumentError, **options):
        with pytest.raises(error, match=words):
            studies.multi_fidelity(low, high, **options)

    refused("not on rows of the cheap one's", runs_of(full, n=64, seed=2))
    refused("not on rows of the cheap one's", runs_of(full, n=128, seed=1))
    few = runs_of(full, n=8, seed=1)
    refused(
        "8 whole blocks of the design were run by both models; it takes 20", few, ulna.DataError
    )
    high = runs_of(full, n=32, seed=1)
    refused("level is 1.0", high, level=1.0)
    refused("resamples is 3", high, resamples=3)
    refused("on_failure is 'surface'", high, on_failure="surface")
    refused("no output 'K'", high, output="K")
    made = ulna.Study(FACTORS, cheap, vectorized=True)
    steps = made.run(made.design(scheme="radial", sampler="latin", n=30))
    with pytest.raises(ulna.ArgumentError, match="the design is radial"):
        studies.multi_fidelity(steps, steps)
    # Every fourth point of a sequence lies in a corner of the cube.
    design = made.design(n=128, seed=1)
    part = ulna.Study(FACTORS, full, vectorized=True).run(design, shard=(1, 4), journal=tmp_path)
    with pytest.raises(ulna.DataError, match="no fair part of it"):
        studies.multi_fidelity(made.run(design), part)


def test_words_and_figure():
    plot = pytest.importorskip("matplotlib.pyplot")
    found = studies.multi_fidelity(runs_of(cheap, n=512, seed=1), runs_of(full, n=64, seed=1))
    words = found.summary()
    assert max(map(len, words.splitlines())) <= 80
    assert "320 runs, and 2560 of the cheap one" in words and "N m/rad" in words
    assert found.ranking == ("a", "b", "c")
    axes = found.plot()
    assert [label.get_text() for label in axes[0].get_yticklabels()] == ["a", "b", "c"]
    assert "90 % interval" in axes[0].get_xlabel()
    assert len(axes[0].containers) == 3
    plot.close(axes[0].figure)
