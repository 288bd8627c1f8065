"""Two clocks of one experiment: offset and drift, their errors, and what cannot be decided."""

import numpy as np
import pytest

import ulna
from ulna.clocks import ClockFit, fit_clocks, on_one_clock


def movement(seed, low=0.3, high=4.0):
    """A movement without a rhythm, as a function of time."""
    rng = np.random.default_rng(seed)
    freq, phase, size = rng.uniform(low, high, 60), rng.uniform(0, 6.3, 60), rng.normal(size=60)

    def value(t):
        return np.sin(np.multiply.outer(2 * np.pi * np.asarray(t), freq) + phase) @ size / 5

    return value


def pair(seed, *, offset=2.5, drift=1e-4, noise=0.0, length=150.0, rates=(100.0, 60.0)):
    """Both recordings; the other one begins at its own zero."""
    move = movement(seed)
    rng = np.random.default_rng(1000 + seed)
    ta = np.arange(0, length, 1 / rates[0])
    tb = np.arange(0, 0.8 * length, 1 / rates[1])
    a, b = move(ta), 40 * move(offset + (1 + drift) * tb) + 7  # another unit and level
    return ta, a + noise * rng.normal(size=len(ta)), tb, b + 40 * noise * rng.normal(size=len(tb))


@pytest.mark.parametrize(("offset", "drift"), [(2.5, 0.0), (-11.23, 3e-4), (20.0, -8e-4)])
def test_offset_and_drift_are_found_to_a_fraction_of_a_sample(offset, drift):
    fit = fit_clocks(*pair(1, offset=offset, drift=drift))
    truth = offset + drift * fit.centre_s
    # A sample is 17 ms. What is left comes from the ends of the filters and the windows.
    assert fit.offset_s == pytest.approx(truth, abs=3e-4)
    assert fit.drift == pytest.approx(drift, abs=1e-5)
    # Windows that the reference does not see count against the correlation.
    assert fit.correlation > 0.9 and fit.rival < 0.8
    again = fit.to_reference([0.0, 100.0])
    np.testing.assert_allclose(again, [offset, offset + 100 * (1 + drift)], atol=2e-3)


def test_standard_errors_are_honest():
    """Over many recordings the errors are as large as they say they are."""
    ratios = []
    for seed in range(10):
        fit = fit_clocks(*pair(seed, noise=0.5, length=100.0))
        ratios.append((fit.offset_s - 2.5 - 1e-4 * fit.centre_s) / fit.offset_error_s)
        ratios.append((fit.drift - 1e-4) / fit.drift_error)
    # Of 20 ratios of variance 1.1 (Student's t with 20 degrees of freedom), 99.9 % limits.
    assert 0.5 < np.sqrt(np.mean(np.square(ratios))) < 1.65
    assert np.max(np.abs(ratios)) < 5


@pytest.mark.slow
def test_standard_errors_are_honest_over_many_recordings():
    ratios = []
    for seed in range(150):
        for noise in (0.3, 1.0):
            fit = fit_clocks(*pair(seed, noise=noise, length=200.0))
            ratios.append((fit.offset_s - 2.5 - 1e-4 * fit.centre_s) / fit.offset_error_s)
    assert 0.93 < np.mean(np.abs(ratios) < 2.1) < 0.98


def test_gaps_and_missing_values_are_left_out():
    ta, a, tb, b = pair(3, noise=0.1)
    b = b.copy()
    b[1000:1300] = np.nan
    keep = np.ones(len(ta), dtype=bool)
    keep[5000:5600] = False
    fit = fit_clocks(ta[keep], a[keep], tb, b)
    assert fit.offset_s == pytest.approx(2.5 + 1e-4 * fit.centre_s, abs=2e-3)
    # A tenth of the frames lost one by one is bridged.
    lost = np.random.default_rng(0).random(len(tb)) < 0.1
    lost[1:] &= ~lost[:-1]
    fit = fit_clocks(ta, a, tb[~lost], pair(3, noise=0.1)[3][~lost])
    assert fit.offset_s == pytest.approx(2.5 + 1e-4 * fit.centre_s, abs=2e-3)


def test_a_stretch_of_another_movement_is_left_out():
    ta, a, tb, b = pair(4, noise=0.05)
    b = b.copy()
    b[3000:3600] = 40 * movement(99)(tb[3000:3600])
    fit = fit_clocks(ta, a, tb, b)
    assert fit.windows_left_out > 0 and "left out" in fit.summary()
    assert fit.offset_s == pytest.approx(2.5 + 1e-4 * fit.centre_s, abs=2e-3)


def test_a_steady_rhythm_is_refused():
    ta = np.arange(0, 120, 0.01)
    tb = np.arange(0, 90, 1 / 60)
    with pytest.raises(ulna.AnalysisError, match="about as good"):
        fit_clocks(ta, np.sin(2 * np.pi * ta), tb, np.sin(2 * np.pi * (tb + 3.2)))
    # Within half a period it is no question.
    fit = fit_clocks(
        ta, np.sin(2 * np.pi * ta), tb, np.sin(2 * np.pi * (tb + 0.2)), max_offset_s=0.45
    )
    assert fit.to_reference(40.0) == pytest.approx(40.2, abs=2e-3)


def test_signals_without_anything_in_common_are_refused():
    ta, a, tb, _ = pair(5)
    for seed in (6, 7):
        with pytest.raises(ulna.AnalysisError):
            fit_clocks(ta, a, tb, movement(seed)(tb + 3))
    rng = np.random.default_rng(0)
    with pytest.raises(ulna.AnalysisError, match="nothing in common|agree|about as good"):
        fit_clocks(ta, rng.normal(size=len(ta)), tb, rng.normal(size=len(tb)))


def test_a_turned_signal_is_refused_not_shifted():
    ta, a, tb, b = pair(8, noise=0.1)
    with pytest.raises(ulna.AnalysisError):
        fit_clocks(ta, a, tb, -b)


def test_arguments_and_data_that_cannot_be_are_refused():
    ta, a, tb, b = pair(1)
    for call, kind, words in (
        (lambda: fit_clocks(ta, a[:-1], tb, b), ulna.ArgumentError, "shape"),
        (lambda: fit_clocks(ta[::-1], a, tb, b), ulna.DataError, "reference must increase"),
        (lambda: fit_clocks(ta, a, tb, b * np.nan), ulna.DataError, "other has 0 samples"),
        (lambda: fit_clocks(ta, a, tb, b, band_hz=(1, 40)), ulna.ArgumentError, "band_hz"),
        (lambda: fit_clocks(ta, a, tb, b, band_hz=(2, 1)), ulna.ArgumentError, "band_hz"),
        (lambda: fit_clocks(ta, a, tb, b, max_drift=1), ulna.ArgumentError, "max_drift"),
        (lambda: fit_clocks(ta, a, tb, b, max_offset_s=-1), ulna.ArgumentError, "max_offset_s"),
        (lambda: fit_clocks(ta, a, tb, b, window_s=1), ulna.ArgumentError, "two periods"),
        (lambda: fit_clocks(ta, a, tb[:900], b[:900]), ulna.AnalysisError, "windows"),
        (lambda: fit_clocks(ta, a, tb[:200], b[:200]), ulna.Error, "windows|without a gap"),
        (lambda: fit_clocks(ta, a * 0, tb, b), ulna.AnalysisError, "nothing in common"),
    ):
        with pytest.raises(kind, match=words):
            call()


# One clock ----------------------------------------------------------------------------------------


def test_both_recordings_on_one_clock():
    move = movement(2)
    offset, drift = 4.0, 2e-4
    ta, tb = np.arange(0, 60, 1 / 60), np.arange(0, 50, 1 / 1000)
    suit = ulna.Record.from_arrays(ta, {"a": move(ta)}, units={"a": "rad"}, frame="global")
    shoe = ulna.Record.from_arrays(
        tb, {"F_z": move(offset + (1 + drift) * tb), "a": 0 * tb}, units={"F_z": "kN"}
    )
    fit = ClockFit(offset, drift, 1e-4, 1e-6, 0.0, 1.0, 0.0, 20, 0)
    both = on_one_clock(suit, shoe, fit, rate_hz=100, prefix="shoe_")
    assert [c.name for c in both.channels] == ["a", "shoe_F_z", "shoe_a"]
    assert [c.unit for c in both.channels][:2] == ["rad", "N"] and both.channels[
        0
    ].frame == "global"
    assert both.rate_hz == pytest.approx(100)
    assert both.time[0] == pytest.approx(4.0) and both.time[-1] == pytest.approx(54.01, abs=0.011)
    inside = slice(150, -150)
    # 4 Hz in a record of 60 Hz; the ends of a resampled record are less exact.
    np.testing.assert_allclose(both["a"][inside], move(both.time)[inside], atol=2e-5)
    np.testing.assert_allclose(both["shoe_F_z"][inside], 1000 * move(both.time)[inside], atol=2e-2)


def test_gaps_stay_missing_on_the_common_clock():
    ta = np.arange(0, 40, 0.01)
    value = np.sin(ta)
    value[1000:1200] = np.nan
    keep = (ta < 25) | (ta > 27)
    first = ulna.Record.from_arrays(ta[keep], {"a": value[keep], "c": np.cos(ta[keep])})
    second = ulna.Record.from_arrays(ta, {"b": np.cos(ta)})
    both = on_one_clock(first, second, ClockFit(0, 0, 0, 0, 0, 1, 0, 9, 0))
    t = both.time
    missing = np.isnan(both["a"])
    assert missing[(t > 10.005) & (t < 11.985)].all() and missing[(t > 25.005) & (t < 26.995)].all()
    assert not missing[(t < 9.98) | ((t > 12.01) & (t < 24.98)) | (t > 27.02)].any()
    assert not np.isnan(both["c"][(t > 10) & (t < 12)]).any()
    assert not np.isnan(both["b"]).any()


def test_what_has_no_common_clock_is_refused():
    t = np.arange(0, 10, 0.01)
    log = ulna.Record.from_arrays(t, {"a": np.sin(t)})
    fit = ClockFit(0, 0, 0, 0, 0, 1, 0, 9, 0)
    with pytest.raises(ulna.ArgumentError, match="give a prefix"):
        on_one_clock(log, log, fit)
    with pytest.raises(ulna.DataError, match="do not overlap"):
        on_one_clock(log, log, ClockFit(50, 0, 0, 0, 0, 1, 0, 9, 0), prefix="b_")
    with pytest.raises(ulna.ArgumentError, match="rate_hz"):
        on_one_clock(log, log, fit, prefix="b_", rate_hz=0)
    with pytest.raises(ulna.ArgumentError, match="other has 2 trials"):
        on_one_clock(log, ulna.record.join([log, log]), fit, prefix="b_")
