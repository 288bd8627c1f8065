"""Rigs and sensors: springs, tare, strain gauges, the accelerometer against the encoders."""

import numpy as np
import pytest
from scipy import optimize, signal, stats

import ulna
from ulna import rig
from ulna.rig import SpringArray, StrainGauge, calibrate_line, cross_check, design_springs

MIDSIDES = [0, 200, 0, 90, 0, 200, 0, 90]


# Springs -----------------------------------------------------------------------------------------


def thesis_force(array, position):
    """(D.1) as printed; the same while every spring is taut."""
    anchor, rate, rest = np.asarray(array)[:, :2], np.asarray(array)[:, 2], np.asarray(array)[:, 3]
    d = np.asarray(position) - anchor
    length = np.linalg.norm(d, axis=1)
    return -np.sum((rate * (1 - rest / length))[:, None] * d, axis=0)


@pytest.mark.parametrize(
    ("rates", "rest", "diagonal"),
    [([80] * 8, 0.09, (501.900681, 503.384339)), (MIDSIDES, 0.10, (481.639344, 351.428571))],
)
def test_stiffness_of_the_thesis_frame(rates, rest, diagonal):
    at = SpringArray.on_frame(rates, rest_m=rest).equilibrium()
    assert at.position_m == pytest.approx([0, 0], abs=1e-15)
    # Reference values are printed with nine figures; the thesis' grid would err by 0.1 %.
    assert at.K == pytest.approx(np.diag(diagonal), abs=5e-7)


def test_equilibrium_and_stiffness_agree_with_scipy():
    rng = np.random.default_rng(1)
    seen = 0
    for _ in range(30):
        rates = np.where(rng.random(8) < 0.8, rng.uniform(30, 300, 8), 0)
        rests = rng.uniform(0.06, 0.13, 8)
        array = SpringArray.on_frame(rates, rest_m=rests)
        try:
            at = array.equilibrium()
        except ulna.AnalysisError:
            continue
        if any(at.slack):
            continue
        seen += 1
        root = optimize.root(lambda r: thesis_force(array, r), at.position_m + 0.003, tol=1e-13)
        assert at.position_m == pytest.approx(root.x, abs=1e-10)
        K = -optimize.approx_fprime(root.x, lambda r: thesis_force(array, r), 1e-7)
        # Forward differences: 1e-7 times the curvature, some 1e4 N/m^2.
        assert at.K == pytest.approx(K, abs=0.02)
        # A radius of linearity is where the worst direction reaches 5 %.
        share = array.equilibrium(radius_m=at.linear_radius_m).deviation_share
        assert share == pytest.approx(0.05, rel=1e-4) or at.linear_radius_m == pytest.approx(0.1)
    assert seen >= 10


def test_force_field_shapes_and_the_form_that_simulations_take():
    array = SpringArray.on_frame(MIDSIDES, rest_m=0.1)
    assert array.force([0.01, 0.0]).shape == (2,)
    assert array.force(np.zeros((5, 2))).shape == (5, 2)
    assert array.stiffness(np.zeros((5, 2))).shape == (5, 2, 2)
    assert array.force([0.01, -0.02]) == pytest.approx(thesis_force(array, [0.01, -0.02]))
    assert np.asarray(array).shape == (4, 4)
    assert len(array) == 4
    assert "200 90 200 90" in repr(array)
    assert "k_xx 481.64" in array.summary()


def test_slack_springs_are_flagged():
    array = SpringArray.on_frame(
        [0, 100, 100, 100, 0, 100, 0, 100], rest_m=[0.1, 0.1, 0.4] + [0.1] * 5
    )
    at = array.equilibrium()
    assert at.slack == (False, True, False, False, False)
    assert "slack at the equilibrium: spring 2" in at.summary()
    tight = SpringArray.on_frame([0, 100, 0, 100, 0, 100, 0, 100], rest_m=0.17)
    assert "goes slack within 25 mm" in tight.equilibrium().summary()


def test_a_design_reaches_what_springs_can_give():
    made = SpringArray.on_frame([60, 100, 20, 80, 60, 100, 20, 80]).equilibrium()
    design = design_springs(made.K)
    assert design.error < 1e-9
    assert design.taut and design.central and design.exhaustive
    assert design.equilibrium.K == pytest.approx(made.K)
    # Against SciPy: bounded least squares of the stiffness at the centre, opposite springs alike.
    wanted = np.array([[443.86, 16.74], [16.74, 232.34]])
    places = rig.frame_places()
    blocks = []
    for place in places[:4]:
        unit = SpringArray(
            (rig.Spring(tuple(place), 1.0, 0.09), rig.Spring(tuple(-place), 1.0, 0.09))
        )
        blocks.append(unit.stiffness([0.0, 0.0]).ravel())
    best = optimize.lsq_linear(np.array(blocks).T, wanted.ravel(), (0, np.inf))
    found = np.linalg.norm(np.array(blocks).T @ best.x - wanted.ravel()) / np.linalg.norm(wanted)
    assert design_springs(wanted).error == pytest.approx(found, abs=1e-9)


def test_a_design_by_its_ellipse_and_from_a_drawer():
    design = design_springs(
        major_n_m=450, minor_n_m=330, angle_deg=30, springs=[(80, 0.09), (200, 0.10, 2), (90, 0.1)]
    )
    assert design.wanted == pytest.approx(np.array([[420, 51.9615], [51.9615, 360]]), abs=1e-3)
    assert sum(kind == 1 for kind in design.kinds) <= 2
    assert design.rates_n_m.tolist() == [
        {-1: 0, 0: 80, 1: 200, 2: 90}[kind] for kind in design.kinds
    ]
    assert design.evaluations == 4**8
    assert "wanted" in design.summary()
    assert "off by" in repr(design)


def test_published_rigs_are_near_what_the_frame_can_give():
    rigs = rig.published_rigs("3.1") | rig.published_rigs("5.1")
    assert len(rigs) == 11
    for published in rigs.values():
        # Wherever the handle was put: nearest stiffness at the centre.
        assert design_springs(published.K, rest_m=0.1).error < 0.2
    with pytest.raises(ulna.ArgumentError, match=r"3\.1 and 5\.1"):
        rig.published_rigs("3.2")


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: SpringArray(()), "from 1 to 8 springs"),
        (lambda: SpringArray.on_frame([100] * 7), "eight places"),
        (lambda: SpringArray.on_frame([-100] + [100] * 7), "spring 1 has a rate of -100"),
        (lambda: SpringArray.on_frame([100] * 8, rest_m=0), "must be above zero"),
        (lambda: SpringArray.on_frame([100] * 8).force([0, 0, 0]), "shape"),
        (lambda: SpringArray.on_frame([100] * 8).force([0, np.nan]), "position"),
        (lambda: SpringArray.on_frame([100] * 8).equilibrium(radius_m=0), "above 0"),
        (lambda: design_springs(), "stiffness matrix, or an ellipse"),
        (lambda: design_springs([[1, 2], [3, 4]]), "symmetric"),
        (lambda: design_springs([[1, 0], [0, -4]]), "positive in every direction"),
        (lambda: design_springs([1, 2]), "shape"),
        (lambda: design_springs(major_n_m=100, minor_n_m=200), "major_n_m >= minor_n_m"),
        (lambda: design_springs(np.eye(2), springs=[]), "drawer is empty"),
        (lambda: design_springs(np.eye(2), springs=[(1,)]), "rate, rest length"),
        (lambda: design_springs(np.eye(2), springs=[(1, -0.1)]), "spring 1 of the drawer"),
        (lambda: design_springs(np.eye(2), rest_m=0.5), "fewer than three places"),
        (lambda: design_springs(np.eye(2), offset_m=(1, 0)), "inside the frame"),
        (lambda: design_springs(np.eye(2), reach=2.0), "at most 1"),
    ],
)
def test_what_is_no_spring_array_is_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_springs_that_do_not_hold_the_handle_are_refused():
    with pytest.raises(ulna.AnalysisError, match="do not hold the handle"):
        SpringArray.on_frame([0, 200, 0, 0, 0, 200, 0, 0], rest_m=0.3).equilibrium()


# Tare --------------------------------------------------------------------------------------------


def moving(seed=0, seconds=60, rate=250):
    """Two axes of a multisine with its derivatives."""
    rng = np.random.default_rng(seed)
    t = np.arange(seconds * rate) / rate
    w = 2 * np.pi * (0.2 + 0.3 * np.arange(10)[:, None] + [0.0, 0.11])
    phase = rng.uniform(0, 2 * np.pi, w.shape)
    angle = w * t[:, None, None] + phase
    x = 0.004 * np.sin(angle).sum(axis=1)
    v = 0.004 * (w * np.cos(angle)).sum(axis=1)
    a = -0.004 * (w**2 * np.sin(angle)).sum(axis=1)
    return t, x, v, a


def recorded(parts, seed=0, noise=0.02):
    """Record of a hand or rig with the parts (M, B, K, x0), and noise of the force."""
    t, x, v, a = moving(seed)
    force = np.random.default_rng(100 + seed).normal(scale=noise, size=x.shape)
    for m, b, k, x0 in parts:
        force -= a @ m.T + v @ b.T + (x - x0) @ k.T
    return ulna.Record.from_arrays(
        t, {"x": x[:, 0], "y": x[:, 1], "F_x": force[:, 0], "F_y": force[:, 1]}
    )


HAND = (
    np.array([[1.3, -0.2], [-0.2, 1.8]]),
    np.array([[6.0, -1.0], [-1.0, 10.0]]),
    np.array([[90.0, -20.0], [-20.0, 120.0]]),
    np.array([0.002, -0.001]),
)
RIG = (
    np.array([[0.4, 0.0], [0.0, 0.5]]),
    np.array([[1.5, 0.2], [0.0, 1.0]]),
    np.array([[15.0, 2.0], [2.0, 12.0]]),
    np.array([-0.004, 0.003]),
)


def test_tare_gives_the_hand_with_the_errors_of_both():
    measured = ulna.identify_impedance(recorded([HAND, RIG]))
    empty = ulna.identify_impedance(recorded([RIG], seed=1))
    hand = rig.tare(measured, empty)
    for name, truth in zip(("M", "B", "K", "x0"), HAND, strict=True):
        z = (getattr(hand, name) - truth) / hand.se(name)
        assert np.abs(z).max() < 4.5, name
        if name != "x0":
            both = np.hypot(measured.se(name), empty.se(name))
            assert hand.se(name) == pytest.approx(both)
    assert "empty rig" in hand.summary()
    assert hand.margins().verdict == "passive"


def test_a_tared_record_and_tared_parameters_agree():
    record = recorded([HAND, RIG])
    empty = ulna.identify_impedance(recorded([RIG], seed=1))
    force = rig.tare_record(record, empty)
    estimate = ulna.identify_impedance(force.record)
    hand = rig.tare(ulna.identify_impedance(record), empty)
    for name in ("M", "B", "K"):
        # The record lost its ends, and the noise there: a small part of a standard error.
        assert getattr(estimate, name) == pytest.approx(
            getattr(hand, name), abs=hand.se(name).max()
        )
    budget = force.budget(estimate)
    # The hand is wrong by what the rig is wrong by.
    assert budget.systematic_se("K") == pytest.approx(empty.se("K"), rel=1e-3)
    assert budget.total_se("K") == pytest.approx(
        np.hypot(empty.se("K"), estimate.se("K")), rel=1e-3
    )
    assert "rig K_11" in force.constants
    assert "tared" in force.record.provenance[-1]
    assert "systematic" in budget.summary()


def test_tare_refuses_what_does_not_belong_together():
    two = ulna.identify_impedance(recorded([RIG]))
    one = ulna.identify_impedance(recorded([RIG]), position=["x"], force=["F_x"])
    with pytest.raises(ulna.ArgumentError, match="same axes"):
        rig.tare(two, one)
    with pytest.raises(ulna.ArgumentError, match="payload was already removed"):
        rig.tare(ulna.identify_impedance(recorded([HAND, RIG]), payload_kg=0.1), two)
    with pytest.raises(ulna.ArgumentError, match="M, B, K, x0"):
        rig.tare_record(recorded([RIG]), "nothing")
    with pytest.raises(ulna.ArgumentError, match="axes"):
        rig.tare_record(recorded([HAND]), one)


# Strain gauges -----------------------------------------------------------------------------------


def test_a_line_agrees_with_scipy():
    rng = np.random.default_rng(2)
    volts = rng.uniform(-6, 6, 15)
    forces = -8.56 * volts + 0.54 + 0.3 * rng.normal(size=15)
    line = calibrate_line(volts, forces)
    oracle = stats.linregress(volts, forces)
    assert line.slope_n_v == pytest.approx(oracle.slope, rel=1e-12)
    assert line.slope_se == pytest.approx(oracle.stderr, rel=1e-10)
    assert line.intercept_se == pytest.approx(oracle.intercept_stderr, rel=1e-10)
    assert line.r_squared == pytest.approx(oracle.rvalue**2, rel=1e-12)
    errors = rng.uniform(0.1, 1.0, 15)
    weighted = calibrate_line(volts, forces, errors)
    value, cov = optimize.curve_fit(
        lambda v, a, b: a * v + b, volts, forces, (1, 1), errors, absolute_sigma=True
    )
    assert [weighted.slope_n_v, weighted.intercept_n] == pytest.approx(value, rel=1e-6)
    assert weighted.slope_se == pytest.approx(np.sqrt(cov[0, 0]), rel=1e-5)
    assert weighted.covariance == pytest.approx(cov[0, 1], rel=1e-5)
    assert weighted.fit_p == pytest.approx(stats.chi2.sf(weighted.chi_square, 13), rel=1e-9)
    # Curvature: the t test of a quadratic part, by hand.
    design = np.column_stack([volts**2, volts, np.ones(15)])
    beta, rest, *_ = np.linalg.lstsq(design, forces, rcond=None)
    t = beta[0] / np.sqrt(rest[0] / 12 * np.linalg.inv(design.T @ design)[0, 0])
    assert line.curvature_p == pytest.approx(2 * stats.t.sf(abs(t), 12), rel=1e-6)


def test_a_bad_calibration_says_so():
    volts = np.linspace(-6, 6, 13)
    forces = -8.5 * volts + 0.02 * np.random.default_rng(1).normal(size=13)
    assert calibrate_line(volts, forces).warnings == ()
    assert "bend away" in calibrate_line(volts, forces + 0.05 * volts**2).warnings[0]
    scattered = calibrate_line(volts, forces, np.full(13, 0.001))
    assert any("scatter more" in words for words in scattered.warnings)
    stray = np.where(np.arange(13) == 3, forces + 5, forces)
    assert "Point 3" in calibrate_line(volts, stray).warnings[-1]
    # The externally studentised residual by hand: point 3 against the line through the others.
    others = np.arange(13) != 3
    slope, intercept = np.polyfit(volts[others], stray[others], 1)
    scatter = (stray - slope * volts - intercept)[others]
    spread = np.sqrt(scatter @ scatter / 10)
    off = volts[3] - volts[others].mean()
    lever = 1 + 1 / 12 + off**2 / np.sum((volts[others] - volts[others].mean()) ** 2)
    t = (stray[3] - slope * volts[3] - intercept) / (spread * np.sqrt(lever))
    mild = np.where(np.arange(13) == 3, forces + 0.08, forces)
    assert calibrate_line(volts, stray).outlier_p == pytest.approx(26 * stats.t.sf(t, 10), abs=1e-12)
    assert 1e-6 < calibrate_line(volts, mild).outlier_p < 0.05


@pytest.mark.parametrize(
    ("arguments", "kind", "message"),
    [
        (([1, 2], [3, 4]), ulna.AnalysisError, "at least three"),
        (([1, 1, 1], [3, 4, 5]), ulna.AnalysisError, "same voltage"),
        (([1, 2, 3], [3, 4]), ulna.ArgumentError, "one force for every voltage"),
        (([1, 2, np.inf], [3, 4, 5]), ulna.DataError, "calibration point 2"),
        (([1, 2, 3], [3, 4, 5], [1, 1, 0]), ulna.ArgumentError, "error of calibration point 2"),
        (([1, 2, 3], [3, 4, 5], [1, 1]), ulna.ArgumentError, "2 errors for 3 points"),
    ],
)
def test_what_gives_no_line_is_refused(arguments, kind, message):
    with pytest.raises(kind, match=message):
        calibrate_line(*arguments)


def volts_of(force, theta, gauge, scale):
    """Volts that a force in the world gives, (E.2) to (E.4) backwards."""
    s, c = np.sin(theta), np.cos(theta)
    xs = s * force[:, 0] - c * force[:, 1]
    ys = c * force[:, 0] + s * force[:, 1]
    return (
        (xs / scale - gauge.x.intercept_n) / gauge.x.slope_n_v,
        (ys / scale - gauge.y.intercept_n) / gauge.y.slope_n_v,
    )


def gauge_log(theta_too=True, seed=0):
    t, x, v, a = moving(seed)
    force = -(a @ HAND[0].T + v @ HAND[1].T + (x - HAND[3]) @ HAND[2].T)
    theta = 0.8 + 0.2 * np.sin(2 * np.pi * 0.3 * t)
    gauge = StrainGauge.published()
    one, two = volts_of(force, theta, gauge, 0.0688 / 0.075)
    noise = np.random.default_rng(seed).normal(scale=0.01 / 8, size=(2, len(t)))
    channels = {"x": x[:, 0], "y": x[:, 1], "V_x": one + noise[0], "V_y": two + noise[1]}
    if theta_too:
        channels["theta_2"] = theta
    units = {"V_x": "V", "V_y": "V", "theta_2": "rad"}
    roles = dict.fromkeys(("V_x", "V_y", "theta_2"), "other")
    record = ulna.Record.from_arrays(
        t, channels, units={k: v for k, v in units.items() if k in channels},
        roles={k: v for k, v in roles.items() if k in channels},
    )  # fmt: skip
    return record, force


def test_volts_become_the_force_and_the_impedance():
    record, truth = gauge_log()
    force = StrainGauge.published().apply(
        record, volts="V", angle="theta_2", lever_m=0.075, lever_se_m=0.0005
    )
    assert np.abs(force.force - truth).max() < 0.1
    assert "lever 0.075 m" in force.record.provenance[-1]
    estimate = ulna.identify_impedance(force.record)
    assert estimate.K == pytest.approx(HAND[2], rel=0.02, abs=1.0)
    budget = force.budget(estimate)
    # A relative error of the lever arm is one of every parameter.
    lever = budget.shares()["lever"]
    natural = np.concatenate([estimate.M.ravel(), estimate.B.ravel(), estimate.K.ravel()])
    assert lever[:12] == pytest.approx(np.abs(natural) * 0.0005 / 0.075, rel=1e-3)
    assert "lever" in force.constants
    assert set(force.parts) == {"constants"}
    assert "constants" in force.summary()


def test_a_gauges_errors_are_the_scatter_of_calibrations():
    record, _ = gauge_log()
    gauge = StrainGauge.published()
    base = gauge.apply(record, volts="V", angle="theta_2")
    rng = np.random.default_rng(4)
    forces = []
    for _ in range(200):
        lines = [
            rig.CalibrationLine(
                line.slope_n_v + line.slope_se * rng.normal(),
                line.intercept_n + line.intercept_se * rng.normal(),
            )
            for line in (gauge.x, gauge.y)
        ]
        forces.append(StrainGauge(*lines).apply(record, volts="V", angle="theta_2").force[::500])
    # 200 draws: four standard errors are 20 %.
    assert np.std(forces, axis=0) == pytest.approx(base.force_se[::500], rel=0.25)


def test_zero_from_a_rest():
    record, _ = gauge_log()
    shifted = ulna.Record.from_arrays(
        record.time,
        {"V_x": np.where(record.time < 2, 0.3, 1.3), "V_y": np.full(len(record), -0.1)},
        units={"V_x": "V", "V_y": "V"},
    )
    force = StrainGauge.published().apply(shifted, volts=["V_x", "V_y"], rest_s=(0, 2))
    assert force.force[-1] == pytest.approx([-8.56, 0.0], abs=1e-12)
    assert "zero from rows 0 to 500" in force.record.provenance[-1]


@pytest.mark.parametrize(
    ("keywords", "kind", "message"),
    [
        ({"volts": "V_x"}, ulna.ArgumentError, "two axes"),
        ({"volts": ["x", "y"]}, ulna.DataError, "not in V"),
        ({"volts": "U"}, ulna.ArgumentError, "U"),
        ({"volts": "V", "angle": "x"}, ulna.DataError, "not in rad"),
        ({"volts": "V", "lever_m": -0.1}, ulna.ArgumentError, "above 0"),
        ({"volts": "V", "rest_s": (900, 901)}, ulna.ArgumentError, "fewer than two"),
        ({"volts": "V", "sign": 3}, ulna.ArgumentError, "sign"),
    ],
)
def test_volts_that_are_none_are_refused(keywords, kind, message):
    record, _ = gauge_log()
    with pytest.raises(kind, match=message):
        StrainGauge.published().apply(record, **keywords)


# Accelerometer against encoders ------------------------------------------------------------------


def sensors(gain=None, lag_s=0.0, bias=0.0, noise=0.03, seed=5):
    t, x, _, _ = moving(seed)
    _, _, _, a = moving(seed) if lag_s == 0 else (0, 0, 0, late(t, seed, lag_s))
    rng = np.random.default_rng(seed)
    sensed = a @ np.asarray(np.eye(2) if gain is None else gain).T + bias
    sensed = sensed + noise * rng.normal(size=a.shape)
    return ulna.Record.from_arrays(
        t, {"x": x[:, 0], "y": x[:, 1], "a_x": sensed[:, 0], "a_y": sensed[:, 1]},
        units={"a_x": "m/s^2", "a_y": "m/s^2"},
    )  # fmt: skip


def late(t, seed, lag_s):
    rng = np.random.default_rng(seed)
    w = 2 * np.pi * (0.2 + 0.3 * np.arange(10)[:, None] + [0.0, 0.11])
    phase = rng.uniform(0, 2 * np.pi, w.shape)
    return -0.004 * (w**2 * np.sin(w * (t[:, None, None] - lag_s) + phase)).sum(axis=1)


def test_good_sensors_agree():
    check = cross_check(sensors(bias=0.3), acceleration="a")
    assert check.outcome == "good"
    assert [finding.severity for finding in check.findings] == ["note", "note"]  # the bias
    assert np.abs((check.gain - np.eye(2)) / check.gain_se).max() < 4.5
    assert "agrees to" in check.summary()
    assert check.accelerometer.shape == check.encoder.shape == (len(check.time), 2)


def test_the_integral_agrees_with_scipy():
    """Gain by SciPy: double cumulative integral, the same detrending and high pass, a regression."""
    record = sensors(gain=[[0.9, 0], [0, 1.05]], noise=0.0)
    check = cross_check(record, acceleration="a", lowpass_hz=0, window=9)
    t = record.time
    low = signal.butter(3, check.highpass_hz, fs=record.rate_hz, output="sos")
    for i, (p, x) in enumerate((("a_x", "x"), ("a_y", "y"))):
        twice = np.asarray(record[p])
        for _ in range(2):
            twice = np.cumsum((twice + np.roll(twice, 1)) / 2) / record.rate_hz
        both = np.column_stack([twice, record[x]])
        powers = np.vander(np.linspace(-1, 1, len(t)), 4)
        both -= powers @ np.linalg.lstsq(powers, both, rcond=None)[0]
        both -= signal.sosfiltfilt(low, both, axis=0)
        inner = both[len(t) // 8 : -len(t) // 8]
        gain = inner[:, 0] @ inner[:, 1] / (inner[:, 1] @ inner[:, 1])
        # The trapezoid errs by (omega step)^2 / 12, 5e-4 at 3 Hz and 250 Hz.
        assert check.gain[i, i] == pytest.approx(gain, rel=2e-3)


@pytest.mark.parametrize(
    ("keywords", "outcome", "message"),
    [
        ({"gain": np.diag([1, -1])}, "sign_reversed", "a_y is opposite"),
        ({"gain": [[0, 1], [1, 0]]}, "axes_exchanged", "a_x follows y"),
        ({"gain": np.eye(2) / 9.80665, "noise": 0.003}, "unit", "in g"),
        ({"gain": np.diag([1.06, 1])}, "scale", "too large"),
        ({"lag_s": 0.008}, "lag", "ms later"),
        ({"lag_s": -0.008}, "lag", "ms earlier"),
        (
            {"gain": [[0.9848, 0.1736], [-0.1736, 0.9848]]},
            "turned",
            "turned against those of the encoders",
        ),
        ({"gain": np.diag([1, 0])}, "unrelated", "a_y does not follow"),
    ],
)
def test_faults_are_named(keywords, outcome, message):
    check = cross_check(sensors(**keywords), acceleration="a")
    assert check.outcome == outcome
    assert any(message in finding.message for finding in check.findings)
    assert outcome.replace("_", " ") in check.summary()


def test_errors_of_gain_and_lag_are_honest():
    """Over runs with other noise: the scatter is the standard error, the truth is covered."""
    gains, lags, errors = [], [], []
    for seed in range(12):
        check = cross_check(sensors(lag_s=0.004, noise=0.3, seed=seed), acceleration="a")
        gains.append((np.diag(check.gain) - 1) / np.diag(check.gain_se))
        lags.append((check.lag_s - 0.004) / check.lag_se_s)
        errors.append(np.diag(check.gain_se))
    # 24 standardised values each: mean square between 0.35 and 2.2 with room for the jackknife.
    for z in (np.array(gains), np.array(lags)):
        assert 0.3 < np.mean(z**2) < 2.5


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"acceleration": "b"}, "b"),
        ({"acceleration": ["a_x"]}, "one of each"),
        ({"acceleration": "a", "position": ["a_x", "a_y"]}, "not in m"),
        ({"acceleration": ["x", "y"]}, "not in m/s"),
        ({"acceleration": "a", "highpass_hz": 30.0}, "leaves nothing"),
        ({"acceleration": "a", "max_lag_s": -1.0}, "lag to look for"),
        ({"acceleration": "a", "highpass_hz": 0.01}, "record longer"),
    ],
)
def test_what_cannot_be_compared_is_refused(keywords, message):
    with pytest.raises(ulna.Error, match=message):
        cross_check(sensors(), **keywords)


# Figures -----------------------------------------------------------------------------------------


def test_figures_draw_into_given_axes():
    import matplotlib.pyplot as plt

    array = SpringArray.on_frame(MIDSIDES, rest_m=0.1)
    _, axes = plt.subplots(1, 2)
    assert array.plot(axes=axes)[0, 0] is axes[0]
    design_springs([[440, 0], [0, 300]]).plot()
    check = cross_check(sensors(), acceleration="a")
    grid = check.plot()
    assert grid.shape == (2, 2)
    assert "Gain" in grid[0, 1].get_title(loc="left")
    with pytest.raises(ulna.ArgumentError, match="axes must hold"):
        array.plot(axes=axes[:1])
    plt.close("all")
