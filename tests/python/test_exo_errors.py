"""Standard errors and intervals of K and D against repetitions with noise, rigid and soft plants."""

from __future__ import annotations

import numpy as np
import pytest

from ulna import exo

PROTOCOLS = {
    "one way": exo.Protocol(),
    "there and back": exo.Protocol(shape="minimum_jerk", speeds=[1, 2]),
}
NOISES = {
    "white": {"torque_nm": 0.2},
    "sensors": {
        "angle_rad": 1e-4,
        "rate_rad_s": 2e-3,
        "acceleration_rad_s2": 0.05,
        "torque_nm": 0.1,
    },
    "10 Hz": {"slow_torque_nm": 0.1, "slow_hz": 10.0},
    "5 Hz": {"slow_torque_nm": 0.1, "slow_hz": 5.0},
    "3 Hz": {"slow_torque_nm": 0.1, "slow_hz": 3.0},
}


@pytest.fixture(scope="module")
def reduced():
    return exo.exoskeleton(soft=True).reduced()


def repeat(record, plant, noise, runs, seed=11):
    """Values, reported errors and coverage of the mean by the intervals: (runs, 2), (runs, 2), (2,)."""
    found = [
        exo.identify_viscoelasticity(
            exo.with_errors(record, plant, seed=seed, run=run, **noise), plant
        )[0]
        for run in range(runs)
    ]
    value = np.array([(one.k, one.d) for one in found])
    error = np.array([(one.k_error, one.d_error) for one in found])
    ends = np.array([(one.k_interval, one.d_interval) for one in found])
    mean = value.mean(axis=0)
    held = (ends[..., 0] <= mean) & (mean <= ends[..., 1])
    return value, error, held.mean(axis=0)


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_errors_of_a_reduced_plant(reduced, protocol):
    """Misfit of bushings and muscles' curves is no noise: 60 repetitions, white and band-limited."""
    record = exo.mobilise(reduced, PROTOCOLS[protocol]).record
    for name in ("sensors", "3 Hz"):
        value, error, held = repeat(record, reduced, NOISES[name], 60)
        ratio = error.mean(axis=0) / value.std(axis=0, ddof=1)
        # 0.85 to 1.2 over 300 is asked for; a deviation of 60 has an error of 9 %.
        assert np.all((ratio > 0.85 - 0.18) & (ratio < 1.2 + 0.18)), (name, ratio)
        assert np.all(held >= 0.87), (name, held)  # 3 standard errors below 95 %


@pytest.mark.slow
@pytest.mark.parametrize("noise", NOISES)
@pytest.mark.parametrize("protocol", PROTOCOLS)
@pytest.mark.parametrize("kind", ["rigid", "soft"])
def test_errors_are_those_of_repetitions(kind, protocol, noise):
    """300 repetitions: reported standard errors over empirical ones, and 95 % intervals."""
    plant = exo.exoskeleton(soft=kind == "soft")
    record = exo.mobilise(plant, PROTOCOLS[protocol]).record
    value, error, held = repeat(record, plant, NOISES[noise], 300)
    ratio = error.mean(axis=0) / value.std(axis=0, ddof=1)
    print(kind, protocol, noise, ratio.round(3), held.round(3))
    # 0.85 to 1.2 and 93 to 97 % are wanted. The deviation of 300 has an error of 4 %, a share of
    # 93 % one of 1.5 %: three of them beyond, for 40 such numbers.
    assert np.all((ratio > 0.85 * 0.88) & (ratio < 1.2 * 1.12)), ratio
    assert np.all(held >= 0.93 - 0.044), held
    # The mean is the estimate without noise, as the errors say.
    (exact,) = exo.identify_viscoelasticity(record, plant)
    away = (value.mean(axis=0) - (exact.k, exact.d)) / (error.mean(axis=0) / np.sqrt(300))
    assert np.all(np.abs(away) < 4), away


def test_intervals_with_the_misfit_are_told_apart(reduced):
    """What a line leaves is in one interval and not in the other; the summary names both."""
    done = exo.mobilise(reduced, PROTOCOLS["there and back"])
    (one,) = done.joints
    assert one.k_misfit_error > 5 * one.k_error
    assert one.d_misfit_error > 5 * one.d_error
    assert one.k_misfit_interval[0] < one.k_interval[0] < one.k_interval[1]
    assert one.k_interval[1] < one.k_misfit_interval[1]
    assert "with misfit" in one.summary()
    assert max(map(len, one.summary().splitlines()[:2])) <= 100
    (other,) = exo.identify_viscoelasticity(done.record, reduced, errors="bootstrap")
    assert (other.k_error, other.k_interval) == (one.k_error, one.k_interval)
    # Newey-West and blocks of the same length see the same slow residual.
    assert other.k_misfit_error == pytest.approx(one.k_misfit_error, rel=0.3)


def test_slow_errors_are_in_the_misfit_alone():
    """0.1 N m below 0.5 Hz look like the arm: said in the docs, held with the misfit."""
    plant = exo.exoskeleton()
    record = exo.mobilise(plant, PROTOCOLS["there and back"]).record
    held = np.zeros(2)
    for run in range(40):
        noisy = exo.with_errors(record, plant, slow_torque_nm=0.1, slow_hz=0.5, seed=5, run=run)
        (one,) = exo.identify_viscoelasticity(noisy, plant)
        held[0] += one.k_interval[0] <= one.true_k <= one.k_interval[1]
        held[1] += one.k_misfit_interval[0] <= one.true_k <= one.k_misfit_interval[1]
    assert held[0] < 30
    assert held[1] >= 34


@pytest.mark.parametrize("seconds", [0.45, 1.2])
def test_short_records_have_errors_too(seconds):
    """A part of a movement: fewer functions of angle and rate are taken off."""
    plant = exo.exoskeleton()
    done = exo.mobilise(plant, exo.Protocol(shape="ramp", duration_s=2))
    start = done.record.time[60]
    record = done.record.select(start_s=start, stop_s=start + seconds)
    value, error, _ = repeat(record, plant, NOISES["white"], 60)
    ratio = error.mean(axis=0) / value.std(axis=0, ddof=1)
    # Three errors of the deviation of 60 repetitions, 9 % each, beyond 0.85 and 1.2.
    assert np.all((ratio > 0.6) & (ratio < 1.5)), ratio
