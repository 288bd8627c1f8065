"""What a reduced plant costs: the full plant's assessment beside it."""

from __future__ import annotations

import numpy as np
import pytest

import ulna
from ulna import exo

QUICK = exo.Protocol(shape="minimum_jerk", duration_s=2.0, settle_s=0.2)


@pytest.fixture(scope="module")
def full():
    return exo.exoskeleton(soft=True)


@pytest.fixture(scope="module")
def reduced(full):
    return full.reduced()


@pytest.fixture(scope="module")
def apart(full, reduced):
    return full.difference(reduced, protocol=QUICK)


def test_difference_is_that_of_two_assessments(full, reduced, apart):
    """Every number by hand from two mobilisations of their own."""
    whole, quick = (exo.mobilise(plant, QUICK) for plant in (full, reduced))
    (a,), (b,) = whole.joints, quick.joints
    assert apart.joint == a.joint == "J4"
    assert apart.full_k == pytest.approx(a.k, rel=1e-12)
    assert apart.full_d == pytest.approx(a.d, rel=1e-12)
    assert apart.full_k_error == pytest.approx(a.k - a.true_k, rel=1e-12)
    assert apart.full_slip_rad == pytest.approx(whole.largest_slip_rad, rel=1e-12)
    assert apart.k == pytest.approx(b.k - a.k, rel=1e-9)
    assert apart.d == pytest.approx(b.d - a.d, rel=1e-9)
    assert apart.k_error == pytest.approx((b.k - b.true_k) - (a.k - a.true_k), rel=1e-9)
    assert apart.slip_rad == pytest.approx(
        quick.largest_slip_rad - whole.largest_slip_rad, rel=1e-9
    )

    def rms(name):
        return np.sqrt(np.mean((whole.record[name] - quick.record[name]) ** 2))

    assert apart.torque_rms_nm == pytest.approx(rms("tau_hum_J4"), rel=1e-9)
    assert apart.angle_rms_rad == pytest.approx(rms("q_elbow_flexion"), rel=1e-9)
    limbs = [
        [rms(f"displacement_{limb}_{axis}") for axis in "xyz"] for limb in ("upper", "fore")
    ]
    assert apart.displacement_rms_m == pytest.approx(np.sqrt(np.sum(np.square(limbs)) / 2), rel=1e-9)
    np.testing.assert_array_equal(apart.full["tau_hum_J4"], whole.record["tau_hum_J4"])
    np.testing.assert_array_equal(apart.reduced["tau_hum_J4"], quick.record["tau_hum_J4"])


def test_difference_is_small_and_not_nothing(apart):
    assert 0 < abs(apart.k_error) < 0.5
    assert 0 < apart.torque_rms_nm < 0.5
    assert 0 < apart.displacement_rms_m < 2e-3
    assert 0 < apart.angle_rms_rad < np.radians(2)


def test_what_bushings_do_not_know_is_in_no_log_of_theirs(apart):
    for name in ("pressure_upper", "area_fore", "tension_upper", "slide_fore"):
        assert name in apart.full
        assert name not in apart.reduced


def test_an_estimator_is_a_choice(full, reduced, apart):
    other = full.difference(reduced, protocol=QUICK, published=True)
    assert other.full_k != apart.full_k
    assert np.isnan(other.d) and np.isnan(other.full_d)


def test_words_and_figure(apart):
    plt = pytest.importorskip("matplotlib.pyplot")
    words = apart.summary()
    assert words.splitlines()[0].split() == ["J4", "full", "reduced", "less", "full"]
    assert "place in the cuffs" in words
    assert max(map(len, words.splitlines())) <= 80
    assert "<PlantDifference J4 K" in repr(apart)
    axes = apart.plot()
    assert axes.shape == (1, 3)
    assert [line.get_label() for line in axes[0, 0].get_lines()] == ["full", "reduced"]
    assert len(axes[0, 2].get_lines()) == 4
    plt.close("all")


def test_plants_that_cannot_be_compared(full, reduced):
    rigid = exo.exoskeleton()
    with pytest.raises(ulna.ArgumentError, match="full has no soft interfaces"):
        rigid.difference(reduced, protocol=QUICK)
    with pytest.raises(ulna.ArgumentError, match="full is a reduced plant"):
        reduced.difference(reduced, protocol=QUICK)
    with pytest.raises(ulna.ArgumentError, match="reduced is a plant that is not reduced"):
        full.difference(full, protocol=QUICK)
    with pytest.raises(ulna.ArgumentError, match="protocol is a str"):
        full.difference(reduced, protocol="quick")
    with pytest.raises(ulna.ArgumentError, match="no joint 'knee'"):
        full.difference(reduced, protocol=QUICK.with_(moved={"knee": 0.1}))
    with pytest.raises(TypeError):
        full.difference(reduced, protocol=QUICK, colour=1)
    with pytest.raises(ulna.AnalysisError, match="run of the full plant ended as failed_init"):
        full.difference(reduced, protocol=QUICK.with_(kp=0, ki=0, start_limit_s=0.5))
