"""Statistics of repeated measures: by hand, beside pingouin and SciPy, and what is refused."""

import numpy as np
import pytest
from scipy import stats as peer

import ulna
from ulna.stats import Anova, compare_pairs, f_tail, repeated_anova

# 4 subjects, two sessions of three blocks; worked by hand in tests/core/stats/anova_test.cpp.
BY_HAND = np.array(
    [[3, 5, 7, 2, 3, 4], [4, 4, 9, 3, 5, 6], [2, 6, 5, 1, 2, 4], [5, 7, 8, 4, 3, 7]], dtype=float
).reshape(4, 2, 3)


def test_the_table_worked_by_hand():
    found = repeated_anova(BY_HAND)
    assert isinstance(found, Anova) and found.names == ("session", "block", "session x block")
    session, block, both = found.effects
    assert session.f == pytest.approx(49) and (session.dof, session.error_dof) == (1, 3)
    assert block.f == pytest.approx(1533 / 53) and block.epsilon == pytest.approx(2809 / 4466)
    assert both.f == pytest.approx(21 / 37) and both.epsilon == pytest.approx(1369 / 2642)
    assert both.partial_eta_squared == pytest.approx(7 / 44)
    assert found["block"] is block
    with pytest.raises(KeyError, match="there are session"):
        found["subject"]


@pytest.mark.filterwarnings("ignore")  # of the peer
@pytest.mark.parametrize("shape", [(12, 2, 5), (6, 3, 3), (9, 4)])
def test_equal_to_pingouin(shape):
    pingouin = pytest.importorskip("pingouin")
    import pandas

    rng = np.random.default_rng(len(shape) + shape[0])
    values = rng.normal(size=shape) + 2 * rng.normal(size=(shape[0], *[1] * (len(shape) - 1)))
    values += np.cumsum(0.5 * rng.normal(size=shape), axis=-1)  # not spherical
    found = repeated_anova(values, names=["a", "b"][: len(shape) - 1])
    index = np.indices(shape).reshape(len(shape), -1)
    table = pandas.DataFrame({"s": index[0], "a": index[1], "y": values.reshape(-1)})
    if len(shape) == 3:
        table["b"] = index[2]
    within = ["a", "b"] if len(shape) == 3 else "a"
    theirs = pingouin.rm_anova(
        table, dv="y", within=within, subject="s", correction=True, effsize="np2", detailed=True
    )
    theirs = theirs[theirs["Source"] != "Error"].reset_index(drop=True)
    columns = {name.replace("-", "_"): name for name in theirs.columns}
    for row, effect in enumerate(found.effects):
        line = {key: theirs.loc[row, name] for key, name in columns.items()}
        assert effect.f == pytest.approx(line["F"], rel=1e-9)
        # Older releases of the peer round p to its printed digits.
        assert effect.p == pytest.approx(line["p_unc"], rel=1e-6, abs=1e-12)
        assert effect.epsilon == pytest.approx(line["eps"], rel=1e-9)
        assert effect.partial_eta_squared == pytest.approx(line["np2"], rel=1e-9)
        assert effect.p_corrected == pytest.approx(line["p_GG_corr"], rel=1e-6, abs=1e-12)


def test_the_tail_of_f_equals_scipy():
    for dof in (0.5, 1.0, 2.2, 4.0, 40.0):
        for error_dof in (0.7, 3.0, 11.0, 24.2, 44.0, 1e4):
            for f in (1e-9, 0.1, 1.0, 2.5, 20.0, 1e4):
                # lgamma of thousands leaves some 1e-12.
                assert f_tail(f, dof=dof, error_dof=error_dof) == pytest.approx(
                    peer.f.sf(f, dof, error_dof), rel=2e-10, abs=1e-300
                )


def test_an_effect_is_found_and_written():
    rng = np.random.default_rng(4)
    values = 20 + 3 * rng.normal(size=(12, 1, 1)) + rng.normal(size=(12, 2, 5))
    values[:, 1] -= 4
    found = repeated_anova(values)
    assert found["session"].p_corrected < 1e-4 < 0.05 < found["block"].p_corrected
    assert "session: F(1, 11) =" in found.summary() and "p < 0.0001" in found.summary()
    assert "session" in repr(found)


def test_pairs_by_hand():
    first, second = [10.0, 12, 8, 10], [8.0, 9, 7, 6]
    found = compare_pairs(first, second, names=["norm"])
    assert found.difference.value.tolist() == [-2.5] and found.relative.value.tolist() == [-0.25]
    assert found.standardised.value[0] == pytest.approx(-2.5 / np.std([-2, -3, -1, -4], ddof=1))
    assert found.difference.low[0] < -2.5 < found.difference.high[0] < 0
    assert "norm: -2.5" in found.summary() and "4 subjects" in repr(found)
    assert "±" in repr(found.difference)


def test_pairs_equal_scipys_bootstrap_within_its_noise():
    rng = np.random.default_rng(8)
    first = rng.normal(20, 4, size=15)
    second = first - rng.exponential(3, size=15)
    mine = compare_pairs(first, second, resamples=20000, expand=False)
    theirs = peer.bootstrap(
        (second - first,), np.mean, n_resamples=20000, method="BCa", rng=np.random.default_rng(1)
    ).confidence_interval
    # 20000 resamples place a 2.5 % quantile to about 0.03 standard errors.
    noise = 0.1 * mine.difference.error[0]
    assert mine.difference.low[0] == pytest.approx(theirs.low, abs=noise)
    assert mine.difference.high[0] == pytest.approx(theirs.high, abs=noise)
    plain = compare_pairs(first, second, resamples=20000, interval="percentile")
    assert plain.difference.low[0] != mine.difference.low[0]
    assert plain.difference.value[0] == mine.difference.value[0]


def test_few_subjects_are_covered_as_promised():
    """95 % intervals of 12 subjects; a plain bootstrap holds the truth in 90 % of them."""
    rng = np.random.default_rng(2)
    hits = np.zeros(2)
    for seed in range(300):
        first = 20 + 4 * rng.normal(size=12)
        second = first - 5 + 2 * rng.normal(size=12)
        for which, expand in enumerate((True, False)):
            found = compare_pairs(first, second, resamples=500, seed=seed, expand=expand).difference
            hits[which] += found.low[0] <= -5 <= found.high[0]
    share = hits / 300
    # The standard error of a share near 0.94 is 0.014.
    assert 0.905 < share[0] < 0.985 and share[1] < share[0]


def test_the_same_seed_gives_the_same_interval():
    rng = np.random.default_rng(0)
    first, second = rng.normal(10, 1, size=(2, 9, 2))
    one, two = (compare_pairs(first, second, seed=3) for _ in range(2))
    np.testing.assert_array_equal(one.relative.low, two.relative.low)
    other = compare_pairs(first, second, seed=0)
    assert (other.relative.low != one.relative.low).any()


def test_what_cannot_be_tested_is_refused():
    hole = BY_HAND.copy()
    hole[2, 1, 1] = np.nan
    same = BY_HAND.copy()
    same[:, 1] = same[:, 0] - 2
    good = BY_HAND.reshape(4, -1)
    for call, kind, words in (
        (lambda: repeated_anova(hole), ulna.DataError, "subject 2, column 4"),
        (lambda: repeated_anova(same), ulna.AnalysisError, "do not differ"),
        (lambda: repeated_anova(BY_HAND[:1]), ulna.ArgumentError, "at least 2 subjects"),
        (lambda: repeated_anova(BY_HAND[:, :1]), ulna.ArgumentError, "2 levels"),
        (lambda: repeated_anova([1.0, 2.0]), ulna.ArgumentError, "1 axes"),
        (lambda: repeated_anova(BY_HAND, names=["a"]), ulna.ArgumentError, "2 different names"),
        (lambda: repeated_anova(BY_HAND, names=["a", "a"]), ulna.ArgumentError, "different"),
        (lambda: f_tail(1.0, dof=0, error_dof=1), ulna.ArgumentError, "positive"),
        (lambda: compare_pairs(good, good[:3]), ulna.ArgumentError, "same subjects"),
        (lambda: compare_pairs(good[:2], good[:2]), ulna.ArgumentError, "3 subjects"),
        (lambda: compare_pairs(good, hole.reshape(4, -1)), ulna.DataError, "subject 2, measure 4"),
        (lambda: compare_pairs(BY_HAND, BY_HAND), ulna.ArgumentError, "shape"),
        (lambda: compare_pairs(good, good, names=["a"]), ulna.ArgumentError, "6 measures"),
        (lambda: compare_pairs(good, good, level=1.0), ulna.ArgumentError, "level"),
        (lambda: compare_pairs(good, good, resamples=10), ulna.ArgumentError, "resamples"),
        (lambda: compare_pairs(good, good, resamples=0), ulna.ArgumentError, "resamples"),
        (lambda: compare_pairs(good, good, interval="t"), ulna.ArgumentError, "'percentile'"),
    ):
        with pytest.raises(kind, match=words):
            call()
