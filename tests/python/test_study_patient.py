"""A measured patient: closed forms, coverage, emulator against runs, refusals, the exoskeleton."""

from __future__ import annotations

import numpy as np
import pytest

import ulna
from ulna import study as st
from ulna._study_patient import _interval, _Sample, _weights

# K = 3 m + l + 0.5 t with error 0.3, seen z = m + l with error 0.5, all normal: every answer is a
# formula. Standard deviations 1, 2, 0.5.
GAIN = np.array([3.0, 1.0, 0.5])
DEVIATION = np.array([1.0, 2.0, 0.5])
SEEN = np.array([1.0, 1.0, 0.0])
ERROR, Z, Z_ERROR = 0.3, 1.2, 0.5
NAMES = ("m", "l", "t")
FACTORS = {name: ulna.Normal(0, sd) for name, sd in zip(NAMES, DEVIATION, strict=True)}


def linear(m, l, t):  # noqa: E741
    return np.column_stack([3 * m + l + 0.5 * t, m + l])


@pytest.fixture(scope="module")
def linear_study():
    units = {"m": "kg", "K": "N m/rad"}
    return st.Study(FACTORS, linear, outputs=("K", "z"), vectorized=True, units=units)


@pytest.fixture(scope="module")
def linear_runs(linear_study):
    return linear_study.sample(n=4096, seed=3)


def exact(observed):
    """Mean and variance of K, covariance of the factors, after z was seen or not."""
    covariance = np.diag(DEVIATION**2)
    mean = np.zeros(3)
    if observed:
        gain = covariance @ SEEN / (SEEN @ covariance @ SEEN + Z_ERROR**2)
        mean = gain * Z
        covariance = covariance - np.outer(gain, SEEN @ covariance)
    return mean @ GAIN, GAIN @ covariance @ GAIN + ERROR**2, mean, covariance


# Closed forms --------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["reweight", "emulator"])
@pytest.mark.parametrize("observed", [False, True])
def test_linear_and_normal(linear_study, linear_runs, method, observed):
    if method == "emulator":
        pytest.importorskip("sklearn")
        runs = linear_study.sample(n=64, seed=3)
    else:
        runs = linear_runs
    patient = runs.patient(
        quantities={"K": ERROR}, observed={"z": (Z, Z_ERROR)} if observed else None, method=method
    )
    one = patient["K"]
    mean, variance, factor_mean, covariance = exact(observed)
    deviation = np.sqrt(variance)
    # Standard error of a mean of ESS points: at most 0.03 deviations here; 0.04 allows for 1 in 100.
    assert one.mean == pytest.approx(mean, abs=0.04 * deviation)
    assert one.deviation == pytest.approx(deviation, rel=0.03)
    ends = mean + 1.6448536 * deviation * np.array([-1, 1])
    assert np.all(np.abs(np.array(one.interval) - ends) < 3 * np.array(one.interval_error))
    assert max(one.interval_error) < 0.1 * deviation
    assert one.noise_deviation == pytest.approx(ERROR)
    at = covariance @ GAIN
    own = np.diag(covariance)
    known = np.sqrt((variance - at**2 / own) / variance)
    halved = np.sqrt((variance - at**2 / (own + own / 3)) / variance)
    # 64 nodes and points of a normal distribution make its width 1 % too small.
    np.testing.assert_allclose([one.known[n] for n in NAMES], known, rtol=0.03, atol=0.01)
    np.testing.assert_allclose([one.halved[n] for n in NAMES], halved, rtol=0.03, atol=0.01)
    needed = at**2 / (0.75 * variance) - own
    assert set(one.to_halve) == {n for n, y in zip(NAMES, needed, strict=True) if y > 0}
    for name, value in one.to_halve.items():
        assert value == pytest.approx(np.sqrt(needed[NAMES.index(name)]), rel=0.1)
    for k, name in enumerate(NAMES):
        value, sd = patient.factors[name]
        assert value == pytest.approx(factor_mean[k], abs=0.05 * DEVIATION[k])
        assert sd == pytest.approx(np.sqrt(own[k]), rel=0.05)
    # Together: m, then l, leave what t and the error make.
    left = [left for _, left in one.together]
    rest = covariance - np.outer(covariance[:, 0], covariance[0]) / own[0]
    assert one.together[0][0] == "m"
    assert left[0] == pytest.approx(known[0], rel=0.03)
    assert left[1] == pytest.approx(
        np.sqrt((GAIN[2] ** 2 * rest[2, 2] + ERROR**2) / variance), rel=0.05
    )
    assert left[2] == pytest.approx(ERROR / deviation, rel=0.05)


def test_advice_is_what_a_measurement_does(linear_study):
    """Measuring the factor as well as was advised halves the interval, in a study of its own."""
    runs = linear_study.sample(n=2**13, seed=5)
    before = runs.patient(quantities={"K": ERROR}, observed={"z": (Z, Z_ERROR)})["K"]
    error = before.to_halve["m"]
    assert "measure m to ±0.4 kg" in before.advice()
    both = st.Study(
        FACTORS, lambda **x: np.column_stack([linear(**x), x["m"]]), outputs=("K", "z", "m_seen"),
        vectorized=True,
    )  # fmt: skip
    after = both.sample(n=2**13, seed=5).patient(
        quantities={"K": ERROR}, observed={"z": (Z, Z_ERROR), "m_seen": (0.3, error)}
    )["K"]
    # 10 % for the ends of both intervals, of about 2000 and 450 points.
    assert after.width == pytest.approx(0.5 * before.width, rel=0.1)


def test_a_covariance_says_the_same_as_errors(linear_runs):
    apart = linear_runs.patient(quantities="K", observed={"z": (Z, Z_ERROR), "K": (2.0, 3.0)})
    joint = linear_runs.patient(
        quantities="K", observed={"z": Z, "K": 2.0}, covariance=np.diag([Z_ERROR**2, 9.0])
    )
    assert joint["K"].interval == apart["K"].interval
    assert joint.effective == apart.effective
    # Errors that go together: z - K/3 is all that is known well. By hand, from the posterior.
    matrix = np.array([[0.25, 0.6], [0.6, 9.0]])
    design = np.vstack([SEEN, GAIN])
    prior = np.diag(DEVIATION**2)
    gain = prior @ design.T @ np.linalg.inv(design @ prior @ design.T + matrix)
    mean = gain @ np.array([Z, 2.0])
    deviation = np.sqrt(GAIN @ (prior - gain @ design @ prior) @ GAIN)
    tied = linear_runs.patient(quantities="K", observed={"z": Z, "K": 2.0}, covariance=matrix)["K"]
    assert tied.mean == pytest.approx(GAIN @ mean, abs=0.1 * deviation)
    assert tied.deviation == pytest.approx(deviation, rel=0.05)


def test_uniform_factors_and_a_curve():
    """x uniform on (0, 1), K = x^2 and nothing else: quantiles are squares, and x tells all."""
    study = ulna.Study(
        {"x": ulna.Uniform(0, 1), "nothing": ulna.Uniform(0, 1)},
        lambda x, nothing: x**2,
        vectorized=True,
    )
    one = study.patient(n=2048, seed=1)["y"]
    np.testing.assert_allclose(one.interval, [0.05**2, 0.95**2], atol=2e-3)
    assert one.known["x"] < 0.02
    assert one.known["nothing"] > 0.99
    assert set(one.to_halve) == {"x"}
    # Numerically: widths of x^2 given readings of x, by Bayes on a fine grid.
    x = (np.arange(4000) + 0.5) / 4000
    reading = x[::40, None] + one.to_halve["x"] * np.linspace(-3, 3, 31)
    weight = np.exp(-0.5 * np.linspace(-3, 3, 31) ** 2)
    width = np.zeros(reading.shape)
    for place, m in np.ndenumerate(reading):
        reached = np.cumsum(np.exp(-0.5 * ((m - x) / one.to_halve["x"]) ** 2))
        width[place] = np.subtract(*np.interp([0.95, 0.05], reached / reached[-1], x**2))
    assert (width @ weight).mean() / weight.sum() == pytest.approx(0.45, rel=0.03)


def test_a_factor_on_a_logarithmic_scale():
    """K = log x: halving takes a relative error, told in the units of x at its mean."""
    study = ulna.Study(
        {"x": st.LogUniform(1.0, 100.0), "other": ulna.Uniform(0, 1)},
        lambda x, other: np.log(x) + 0.1 * other,
        vectorized=True,
    )
    patient = study.patient(n=1024, seed=1)
    one = patient["y"]
    assert one.known["x"] < 0.05
    relative = one.to_halve["x"] / patient.factors["x"][0]
    # log x is uniform with deviation 1.33: its interval halves for an error of about 0.7 of it.
    assert 0.6 < relative < 1.2


def test_discrete_factors_are_known_or_not():
    study = ulna.Study(
        {"grip": st.Discrete([0.0, 1.0]), "x": ulna.Normal(0, 1)},
        lambda grip, x: 10 * grip + x,
        vectorized=True,
    )
    one = study.patient(n=1024, seed=1)["y"]
    # Two bells at 0 and 10: together 90 % reach from -1.28 to 11.28, each is 3.29 wide.
    assert one.known["grip"] == pytest.approx(3.29 / 12.56, rel=0.05)
    assert "grip" not in one.to_halve


def test_when_the_measurement_is_what_is_unsure():
    study = ulna.Study({"x": ulna.Uniform(-1, 1)}, lambda x: 5.0 + 0.1 * x, vectorized=True)
    one = study.patient(n=256, quantities={"y": 1.0})["y"]
    assert one.deviation == pytest.approx(np.sqrt(1 + 0.01 / 3), rel=1e-3)
    assert not one.to_halve
    assert "cannot be halved by measuring factors" in one.advice()


def test_two_factors_that_halve_only_together():
    study = ulna.Study(
        {"a": ulna.Normal(0, 1), "b": ulna.Normal(0, 1), "c": ulna.Normal(0, 0.1)},
        lambda a, b, c: a + b + c,
        vectorized=True,
    )
    one = study.patient(n=1024, seed=2)["y"]
    assert not one.to_halve
    assert one.known["a"] == pytest.approx(np.sqrt(1.01 / 2.01), rel=0.03)
    words = one.advice()
    assert "cannot be halved by one factor" in words
    assert "knowing a and b" in words or "knowing b and a" in words


def test_only_what_can_be_measured_is_advised(linear_runs):
    every = linear_runs.patient(quantities={"K": ERROR}, observed={"z": (Z, Z_ERROR)})["K"]
    some = linear_runs.patient(
        quantities={"K": ERROR}, observed={"z": (Z, Z_ERROR)}, measurable=("l", "t")
    )["K"]
    assert some.interval == every.interval
    assert set(some.known) == {"l", "t"}
    assert some.known["l"] == every.known["l"]
    assert not some.to_halve
    assert [name for name, _ in some.together] == ["l", "t"]
    none = linear_runs.patient(quantities={"K": ERROR}, measurable=())["K"]
    assert none.advice() == "Nothing can be measured better for K."
    assert not none.known


def test_a_quantity_that_does_not_vary():
    study = ulna.Study({"x": ulna.Uniform(0, 1)}, lambda x: 0 * x + 4.0, vectorized=True)
    one = study.patient(n=64)["y"]
    assert one.interval == (4.0, 4.0)
    assert one.deviation == 0.0
    assert "the same for all" in one.summary()


# Coverage ------------------------------------------------------------------------------------------


def curved(stiffness, mass, length):
    """Estimate of a stiffness from a log, wrong by the weight that is not known; and its truth."""
    weight = 9.81 * mass * length
    return stiffness, stiffness * (1 + 0.1 * np.sin(3 * length)) + 0.5 * weight


def test_intervals_cover_patients_as_often_as_they_say():
    """600 patients drawn from the ranges, one study; each has its own noisy estimate."""
    factors = {
        "stiffness": ulna.Uniform(2, 8),
        "mass": ulna.Normal(1.3, 0.2),
        "length": ulna.Uniform(0.24, 0.3),
    }
    study = ulna.Study(
        factors, lambda **x: np.column_stack(curved(**x)), outputs=("K", "K_est"), vectorized=True
    )
    runs = study.sample(n=2**14, seed=1)
    nothing = np.zeros(len(runs.y))
    value = {"K": runs.output("K"), "K_est": runs.output("K_est")}
    sample = _Sample(runs.design.values(), value, dict.fromkeys(value, nothing), len(runs.y), {})
    rng = np.random.default_rng(7)
    patients = study.design(scheme="sample", sampler="monte-carlo", n=600, seed=99).values()
    inside = 0
    for truth in patients:
        k, estimate = curved(*truth)
        seen = {"K_est": (estimate + 0.3 * rng.standard_normal(), 0.3)}
        weight, _, _ = _weights(sample, seen, None, "reweight")
        effective = 1 / np.sum(weight**2)
        (low, high), _ = _interval(value["K"], nothing, weight, 0.9, effective)
        inside += low <= k <= high
    # 540 are expected; 3 standard deviations of the binomial are 22.
    assert abs(inside - 540) <= 22
    # The public call gives the same interval.
    again = runs.patient(quantities="K", observed=seen)["K"].interval
    assert again == pytest.approx((low, high))


# Emulator ------------------------------------------------------------------------------------------


def test_an_emulator_says_what_many_runs_say():
    pytest.importorskip("sklearn")
    calls = []

    def slow(stiffness, mass, length):
        calls.append(1)
        return dict(zip(("K", "K_est"), curved(stiffness, mass, length), strict=True))

    factors = {
        "stiffness": ulna.Uniform(2, 8),
        "mass": ulna.Normal(1.3, 0.2),
        "length": ulna.Uniform(0.24, 0.3),
    }
    study = ulna.Study(factors, slow, outputs=("K", "K_est"))
    seen = {"K_est": (5.0, 0.1)}
    few = study.patient(quantities="K", observed=seen, method="emulator", n=64, seed=1)
    assert len(calls) == 64
    many = study.patient(quantities="K", observed=seen, n=8192, seed=2)
    assert min(few.q2.values()) > 0.999
    for a, b, error in zip(
        few["K"].interval, many["K"].interval, many["K"].interval_error, strict=True
    ):
        assert a == pytest.approx(b, abs=3 * error)
    assert few["K"].known["mass"] == pytest.approx(many["K"].known["mass"], abs=0.05)
    again = study.patient(quantities="K", observed=seen, method="emulator", n=64, seed=1)
    assert again["K"].interval == few["K"].interval


def test_an_emulator_that_does_not_predict_is_refused():
    pytest.importorskip("sklearn")
    study = ulna.Study({"x": ulna.Uniform(0, 1)}, lambda x: np.sin(1e4 * x), vectorized=True)
    with pytest.raises(ulna.AnalysisError, match="of the variance of y at runs it is not told of"):
        study.patient(method="emulator", n=32, seed=1)


def test_an_emulators_doubt_widens_the_interval():
    """A rough function from few runs: the intervals of both methods agree, the emulator's is wider."""
    pytest.importorskip("sklearn")
    rng = np.random.default_rng(1)
    rough = rng.standard_normal(64)

    def function(x):
        return x + 0.15 * rough[(1000 * x).astype(int) % 64]

    study = ulna.Study({"x": ulna.Uniform(0, 1)}, function, vectorized=True)
    few = study.patient(method="emulator", n=64, seed=1)["y"]
    assert 0.1 < few.noise_deviation < 0.25
    many = study.patient(n=4096, seed=1)["y"]
    assert few.width == pytest.approx(many.width, rel=0.1)


def test_what_an_emulator_needs(monkeypatch, linear_study):
    import sys

    runs = linear_study.sample(n=64, seed=1)
    monkeypatch.setitem(sys.modules, "sklearn", None)
    monkeypatch.setitem(sys.modules, "sklearn.exceptions", None)
    with pytest.raises(ImportError, match=r"pip install ulna\[gp\]"):
        runs.patient(method="emulator")


# Refusals ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("chosen", "words"),
    [
        ({"method": "magic"}, "method is 'magic'"),
        ({"level": 1.0}, "between 0 and 1"),
        ({"quantities": "Q"}, "no output 'Q'"),
        ({"quantities": ()}, "at least one output"),
        ({"quantities": {"K": -1.0}}, "must be 0 or more"),
        ({"quantities": {"K": float("nan")}}, "must be 0 or more"),
        ({"quantities": {"K": "missing"}}, "no output 'missing'"),
        ({"quantities": {"K": "z"}}, "standard error and is below 0"),
        ({"observed": {"w": (1.0, 1.0)}}, "observed names no output 'w'"),
        ({"observed": {"z": 1.0}}, "a value and its standard error"),
        ({"observed": {"z": (1.0, 0.0)}}, "standard error above 0"),
        ({"observed": {"z": (float("nan"), 1.0)}}, "standard error above 0"),
        ({"observed": [1.0]}, "must map outputs"),
        ({"covariance": [[1.0]]}, "nothing observed"),
        ({"observed": {"z": 1.0}, "covariance": [[1.0, 0.0]]}, "must be 1 x 1"),
        ({"observed": {"z": 1.0}, "covariance": [[-1.0]]}, "positive definite"),
        ({"observed": {"z": 1.0, "K": 1.0}, "covariance": [[1.0, 0.5], [0.2, 1.0]]}, "symmetric"),
        ({"observed": {"z": (1.0, 1.0)}, "covariance": [[1.0]]}, "finite values"),
        ({"on_failure": "surface"}, "left out"),
        ({"measurable": ("mass",)}, "must be names of factors: m, l, t"),
        ({"measurable": "m"}, "must be names of factors"),
    ],
)
def test_bad_questions_are_refused(linear_runs, chosen, words):
    with pytest.raises(ValueError, match=words):
        linear_runs.patient(**chosen)


def test_too_few_runs_agree(linear_runs):
    with pytest.raises(ulna.AnalysisError, match=r"effective sample size is [\d.]+, at least 50"):
        linear_runs.patient(quantities="K", observed={"z": (1.0, 0.005)})


def test_no_run_agrees(linear_runs):
    with pytest.raises(ulna.AnalysisError, match="standard errors from the closest of 4096 points"):
        linear_runs.patient(quantities="K", observed={"z": (40.0, 0.5)})


def test_small_samples_and_samples_without_points(linear_study):
    with pytest.raises(ulna.ArgumentError, match="32 good runs .* are too few"):
        linear_study.patient(n=32)
    x = np.ones((40, 3))
    with pytest.raises(ulna.ArgumentError, match="needs the values of the factors"):
        linear_study.read_outputs(np.zeros((40, 2)), scheme="saltelli").patient()
    with pytest.raises(ulna.ArgumentError, match="too few"):
        linear_study.read_outputs(np.zeros((40, 2)), x=x, scheme="sample").patient()


def test_failed_runs_are_said_or_left_out():
    def breaks(a, b):
        if a > 0.9:
            raise st.RunFailed("diverged")
        return a + b

    study = ulna.Study({"a": ulna.Uniform(0, 1), "b": ulna.Uniform(0, 1)}, breaks)
    runs = study.run(study.design(scheme="sample", n=256, seed=1), on_failure="drop_block")
    with pytest.raises(
        ulna.DataError, match=r"runs have no result.*status 'diverged', first run \d+ \(a = 0.9"
    ):
        runs.patient()
    patient = runs.patient(on_failure="drop_block")
    assert patient.runs == 256 - runs.failed.size
    assert patient.factors["a"][0] == pytest.approx(0.45, abs=0.01)


def test_units_must_be_of_something():
    with pytest.raises(ulna.ArgumentError, match="no factor and no output 'b'"):
        ulna.Study({"a": ulna.Uniform(0, 1)}, units={"b": "kg"})
    with pytest.raises(ulna.ArgumentError, match="unit of a must be text"):
        ulna.Study({"a": ulna.Uniform(0, 1)}, units={"a": 3})


# Words and figure ----------------------------------------------------------------------------------


def test_words_and_figure(linear_runs):
    plt = pytest.importorskip("matplotlib.pyplot")
    patient = linear_runs.patient(
        quantities={"K": ERROR, "z": None}, observed={"z": (Z, Z_ERROR)}
    )
    text = patient.summary()
    assert "90 % intervals from 4096 runs" in text
    assert "observed: z 1.2±0.5" in text
    assert "measure it to ±0.4 kg" in text
    assert max(map(len, text.splitlines())) <= 100
    assert "K=" in repr(patient)
    axes = patient.plot()
    assert axes.shape == (2, 2)
    assert axes[0, 0].get_xlabel() == "K (N m/rad)"
    assert [label.get_text() for label in axes[0, 1].get_yticklabels()][0] == "m"
    plt.close("all")
    constant = ulna.Study({"x": ulna.Uniform(0, 1)}, lambda x: 0 * x, vectorized=True)
    constant.patient(n=64).plot()
    plt.close("all")


# The exoskeleton -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def exo_log():
    exo = pytest.importorskip("ulna.exo")
    plant = exo.exoskeleton()
    truth = exo.exoskeleton(fore_factor=1.04, fore_mass_kg=1.1)
    found = exo.mobilise(truth, exo.Protocol(shape="minimum_jerk", speeds=[1, 2]))
    log = exo.with_errors(
        found.record, truth, torque_nm=0.2, slow_torque_nm=0.1, slow_hz=3.0, seed=1
    )
    return plant, truth, found, log


def test_a_log_over_what_is_not_known_of_the_arm(exo_log):
    from ulna import exo

    plant, truth, found, log = exo_log
    k = found.joints[0]
    arm = {"fore_factor": ulna.Normal(1.0, 0.05), "fore_mass_kg": ulna.Normal(1.0, 0.15)}
    patient = exo.patient(log, plant, arm, n=128)
    one = patient["K"]
    assert one.interval[0] < k.true_k < one.interval[1]
    assert patient["D"].interval[0] < k.true_d < patient["D"].interval[1]
    # K grows by the gravity of the forearm: what knowing nothing but the noise leaves.
    (own,) = exo.identify_viscoelasticity(log, truth)
    assert one.noise_deviation == pytest.approx(own.k_error, rel=0.1)
    assert one.deviation > 2 * own.k_error
    assert one.known["fore_mass_kg"] < one.known["fore_factor"] < 1
    assert one.unit == "N m/rad"
    # D does not depend on the arm's weight.
    assert "measurement's own error" in patient["D"].advice()
    with pytest.raises(ulna.ArgumentError, match="nominal must make a plant"):
        exo.patient(log, plant, arm, nominal=plant)


@pytest.mark.slow
@pytest.mark.parametrize(("slow_hz", "misfit"), [(3.0, False), (0.5, True)])
def test_intervals_cover_simulated_patients(slow_hz, misfit):
    """100 arms drawn from their ranges, each mobilised with noise; 90 % intervals of K and D.

    Errors as slow as the movement are held with the misfit counted only.
    """
    from ulna import exo

    plant = exo.exoskeleton()
    arm = {"fore_factor": ulna.Normal(1.0, 0.05), "fore_mass_kg": ulna.Normal(1.0, 0.15)}
    patients = ulna.StudyDesign(arm, scheme="sample", sampler="monte-carlo", n=100, seed=4).values()
    protocol = exo.Protocol(shape="minimum_jerk", speeds=[1, 2])
    inside = np.zeros(2)
    for k, (fore_factor, fore_mass_kg) in enumerate(patients):
        truth = exo.exoskeleton(fore_factor=fore_factor, fore_mass_kg=fore_mass_kg)
        found = exo.mobilise(truth, protocol)
        log = exo.with_errors(
            found.record, truth, torque_nm=0.2, slow_torque_nm=0.1, slow_hz=slow_hz, seed=k
        )
        patient = exo.patient(log, plant, arm, n=64, seed=k, misfit=misfit)
        for i, (name, value) in enumerate(
            (("K", found.joints[0].true_k), ("D", found.joints[0].true_d))
        ):
            low, high = patient[name].interval
            inside[i] += low <= value <= high
    # 90 are expected, and 3 standard deviations of the binomial are 9. D depends on nothing but the
    # log's own errors, and with the misfit counted they are told too large.
    assert 81 <= inside[0] <= 99, inside
    assert 81 <= inside[1] <= (100 if misfit else 99), inside
