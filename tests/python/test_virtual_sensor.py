"""The virtual force sensor: force, error budget, robot parameters, both methods side by side."""

import numpy as np
import pytest
from scipy import integrate

import ulna
from ulna import virtual_sensor
from ulna.plant import Friction, PlanarRobot
from ulna.virtual_sensor import compare, identify_robot, sense

ROBOT = PlanarRobot()
ARM = {
    "M": np.array([[1.45, 0.65], [0.68, 1.06]]),  # Table 5.6 of Dyck (2013), method 2
    "B": np.array([[10.88, 3.09], [2.75, 4.01]]),
    "K": np.array([[72.34, 6.29], [16.12, 42.61]]),
}
UNITS = {"theta": "rad", "tau": "Nm", "a": "m/s^2", "ref": "rad"}


def made(
    *,
    seconds=40,
    rate=250,
    reach=0.15,
    centre=(0.77, 0.85),
    contact=True,
    robot=ROBOT,
    angle=0.0,
    torque=0.0,
    acceleration=0.0,
    measured=False,
    wobble=0.0,
    seed=0,
):
    """A recording that is exact but for the noise asked for, and the true force.

    Angles are sums of sines, their derivatives known; torques follow from the inverse dynamics.
    """
    phases = np.random.default_rng(1000 + seed)
    noise = np.random.default_rng(seed)
    t = np.arange(seconds * rate) / rate
    w = 2 * np.pi * (0.12 + 0.23 * np.arange(8)[:, None] + [0.0, 0.05])
    q, rates, second, ref = (np.zeros((len(t), 2)) for _ in range(4))
    for size, frequency, commanded in ((reach, w, True), (wobble, 1.03 * w, False)):
        at = frequency * t[:, None, None] + phases.uniform(0, 2 * np.pi, w.shape)
        q += size / 4 * np.sin(at).sum(axis=1)
        rates += size / 4 * (frequency * np.cos(at)).sum(axis=1)
        second -= size / 4 * (frequency**2 * np.sin(at)).sum(axis=1)
        if commanded:
            ref += size / 4 * np.sin(at).sum(axis=1)
    q, ref = q + centre, ref + centre
    x = robot.forward(q)
    jacobian = robot.jacobian(q)
    v = np.einsum("tij,tj->ti", jacobian, rates)
    a = np.einsum("tij,tj->ti", jacobian, second)
    a += np.einsum("tij,tj->ti", robot.jacobian_rate(q, rates), rates)
    force = np.zeros_like(x)
    if contact:
        home = robot.forward(np.asarray(centre))
        force = -(a @ ARM["M"].T + v @ ARM["B"].T + (x - home) @ ARM["K"].T)
    tau = robot.inverse_dynamics(q, rates, second, force)
    channels = {}
    for j in (0, 1):
        channels[f"theta_{j + 1}"] = q[:, j] + angle * noise.normal(size=len(t))
        channels[f"tau_{j + 1}"] = tau[:, j] + torque * noise.normal(size=len(t))
        channels[f"a_{'xy'[j]}"] = a[:, j] + acceleration * noise.normal(size=len(t))
        channels[f"ref_{j + 1}"] = ref[:, j]
        if measured:
            channels[f"F_{'xy'[j]}"] = force[:, j] + noise.normal(size=len(t)) / 24
    units = {name: UNITS[name.split("_")[0]] for name in channels if name[0] != "F"}
    roles = {name: "force" if name[0] == "F" else "other" for name in channels}
    return ulna.Record.from_arrays(t, channels, units=units, roles=roles), force


def truth_at(force, record):
    """True force at the rows that the sensor kept."""
    dropped = (len(force) - len(record)) // 2
    return force[dropped : dropped + len(record)]


def inner(values):
    """Without the ends, where the filters' transient shows."""
    return values[len(values) // 8 : -len(values) // 8]


# The force ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("acceleration", ["a", None])
def test_the_force_comes_back(acceleration):
    record, truth = made()
    force = sense(record, acceleration=acceleration, reference="ref")
    # Newtons; the smoother deviates from one by 1e-6 within the band.
    assert np.abs(inner(force.force - truth_at(truth, force.record))).max() < 5e-4
    assert force.accelerometer is (acceleration is not None)
    names = [c.name for c in force.record.channels]
    assert names == ["x", "y", "F_x", "F_y", "x_ref", "y_ref", "a_x", "a_y"]
    estimate = ulna.identify_impedance(force.record)
    assert estimate.estimator == "instrumental_variables"
    for name, matrix in ARM.items():
        assert getattr(estimate, name) == pytest.approx(matrix, rel=1e-3, abs=2e-3), name


def test_the_filters_of_the_thesis():
    record, truth = made(rate=1000, seconds=20)
    force = sense(record, acceleration="a", lowpass_hz=4.5, window=151)
    assert "window 151, low pass at 4.5 Hz" in force.record.provenance[-1]
    # Smoothing before the product of signals costs some percent of a newton at 2 Hz.
    miss = inner(force.force - truth_at(truth, force.record))
    assert 1e-4 < np.sqrt(np.mean(miss**2)) < 0.2


def test_against_a_simulated_loop():
    """Equations of motion integrated by SciPy, a PD controller, the arm in contact."""
    home = np.array([0.77, 0.85])
    x0 = ROBOT.forward(home)
    w = 2 * np.pi * np.array([0.4, 0.9, 1.6])

    def command(t):
        return home + 0.05 * np.array([np.sin(w * t).sum(), np.cos(w * t + 0.5).sum() - 1.2])

    def slopes(t, state):
        q, rate = state[:2], state[2:]
        j, jr = ROBOT.jacobian(q), ROBOT.jacobian_rate(q, rate)
        tau = 30 * (command(t) - q) - 1.5 * rate
        # Robot and arm share the handle: both equations for q'' and F at once.
        v, x = j @ rate, ROBOT.forward(q)
        free = tau - ROBOT.coriolis(q, rate) @ rate - ROBOT.friction(rate)
        arm = ARM["M"] @ jr @ rate + ARM["B"] @ v + ARM["K"] @ (x - x0)
        mass = ROBOT.inertia(q) + j.T @ ARM["M"] @ j
        return np.concatenate([rate, np.linalg.solve(mass, free - j.T @ arm)])

    t = np.arange(1500) / 250
    run = integrate.solve_ivp(
        slopes, (0, t[-1]), [*home, 0, 0], t_eval=t, rtol=1e-8, atol=1e-10, max_step=0.02
    )
    q, rate = run.y[:2].T, run.y[2:].T
    second = np.array([slopes(*item)[2:] for item in zip(t, run.y.T, strict=True)])
    tau = np.array([30 * (command(s) - a) - 1.5 * b for s, a, b in zip(t, q, rate, strict=True)])
    j = ROBOT.jacobian(q)
    v = np.einsum("tij,tj->ti", j, rate)
    a = np.einsum("tij,tj->ti", j, second)
    a += np.einsum("tij,tj->ti", ROBOT.jacobian_rate(q, rate), rate)
    truth = -(a @ ARM["M"].T + v @ ARM["B"].T + (ROBOT.forward(q) - x0) @ ARM["K"].T)
    log = ulna.Record.from_arrays(
        t, {"q_1": q[:, 0], "q_2": q[:, 1], "tau_1": tau[:, 0], "tau_2": tau[:, 1]},
        units={"q_1": "rad", "q_2": "rad", "tau_1": "Nm", "tau_2": "Nm"},
    )  # fmt: skip
    force = sense(log)
    miss = inner(force.force - truth_at(truth, force.record))
    # The start-up transient holds frequencies above the smoother's band.
    assert np.sqrt(np.mean(miss**2)) < 0.01 * np.sqrt(np.mean(truth**2))


def test_a_simulated_rig_of_springs_is_recovered():
    """The whole chain: springs in closed form, simulated robot, virtual sensor, identification."""
    sim = pytest.importorskip("ulna.sim")
    springs = ulna.rig.SpringArray.on_frame(
        [0, 200, 0, 90, 0, 200, 0, 90], rest_m=0.10, centre_m=(0.383, 0.0)
    )
    t = np.arange(50000) / 1000
    w = 2 * np.pi * (0.1 + 0.2 * np.arange(9)[:, None] + [0.0, 0.07])
    # Two millimetres: beyond, the springs themselves are not linear to 0.1 %.
    at = w * t[:, None, None] + np.arange(18.0).reshape(9, 2) ** 2
    log = sim.simulate(
        sim.Arm(M=0.539 * np.eye(2), B=np.zeros((2, 2)), springs=springs, frame="robot"),
        5e-4 * np.sin(at).sum(axis=1),
        sensors=sim.Sensors.exact(),
        extras=("robot", "acceleration"),
    )
    found = compare(log, acceleration="a", reference="x_ref")
    for method, estimate in found.estimates.items():
        K = springs.equilibrium().K
        assert np.diag(estimate.K) == pytest.approx(np.diag(K), rel=1e-3), method
        assert estimate.K[0, 1] == pytest.approx(0, abs=0.5)
        assert np.diag(estimate.M) == pytest.approx([0.539] * 2, rel=5e-3), method
        # The torque of a controller's step is held for a millisecond: half of that is a lag.
        assert np.abs(estimate.B).max() < 0.3, method


def test_the_noise_budget_is_the_scatter():
    record, truth = made(angle=2e-5, torque=0.02, acceleration=0.05)
    errors = {"torque_noise_nm": 0.02, "angle_noise_rad": 2e-5, "lowpass_hz": 15}
    both = {
        "a": sense(record, acceleration="a", acceleration_noise_m_s2=0.05, **errors),
        None: sense(record, **errors),
    }
    for method, force in both.items():
        miss = inner(force.force - truth_at(truth, force.record))
        ratio = np.sqrt(np.mean(miss**2, axis=0) / np.mean(inner(force.force_se) ** 2, axis=0))
        # 30 s below 15 Hz hold some 900 independent values: four standard errors are 10 %.
        assert ratio == pytest.approx([1, 1], abs=0.12), method
    assert set(both["a"].parts) == {"torque", "angle", "acceleration"}
    assert set(both[None].parts) == {"torque", "angle"}
    assert "all errors" in both["a"].summary()
    assert "± " in repr(both["a"])


def test_steps_of_the_encoders_are_noise_of_a_step_over_root_twelve():
    record, truth = made()
    step = 2 * np.pi / 40000
    coarse = ulna.Record.from_arrays(
        record.time,
        {c.name: np.round(record[c.name] / step) * step if c.name[:5] == "theta" else record[c.name]
         for c in record.channels},
        units={c.name: c.unit for c in record.channels},
        roles={c.name: "other" for c in record.channels},
    )  # fmt: skip
    force = sense(coarse, angle_step_rad=step, lowpass_hz=15)
    miss = inner(force.force - truth_at(truth, force.record))
    ratio = np.sqrt(np.mean(miss**2) / np.mean(inner(force.force_se) ** 2))
    # Quantisation is nearly white where many steps pass between samples' turns.
    assert 0.6 < ratio < 1.4


def test_errors_of_the_robot_reach_the_impedance():
    """Monte Carlo: robots drawn from the covariance, noise drawn anew; scatter against the budget."""
    sd = np.array([3e-5, 7e-5, 4e-5, 1.76e-3, 7.2e-4]) * 5
    cov = np.diag(sd**2)
    noise = {"torque": 0.02, "angle": 1e-5, "acceleration": 0.05}
    known = {"parameter_cov": cov, "torque_scale_error": 0.005}
    force = sense(made(**noise)[0], acceleration="a", **known)
    budget = force.budget(ulna.identify_impedance(force.record))
    rng = np.random.default_rng(8)
    runs = []
    for run in range(40):
        record, _ = made(seed=run, **noise)
        scale = 1 + 0.005 * rng.normal(size=2)
        scaled = ulna.Record.from_arrays(
            record.time,
            {c.name: record[c.name] * (scale[int(c.name[-1]) - 1] if "tau" in c.name else 1)
             for c in record.channels},
            units={c.name: c.unit for c in record.channels},
            roles={c.name: "other" for c in record.channels},
        )  # fmt: skip
        robot = PlanarRobot(alpha=tuple(np.asarray(ROBOT.alpha) + sd * rng.normal(size=5)))
        estimate = ulna.identify_impedance(sense(scaled, robot=robot, acceleration="a").record)
        runs.append(np.concatenate([getattr(estimate, name).ravel() for name in "MBK"]))
    truth = np.concatenate([ARM[name].ravel() for name in "MBK"])
    total = np.concatenate([budget.total_se(name).ravel() for name in "MBK"])
    z = (np.array(runs) - truth) / total
    # 40 runs: a standard deviation within four standard errors is 0.55 to 1.45.
    assert np.all(z.std(axis=0) > 0.5) and np.all(z.std(axis=0) < 1.5)
    assert np.mean(np.abs(z) < 1.96) == pytest.approx(0.95, abs=0.05)
    # It is mostly the robot: the statistical errors alone are far too small.
    assert np.all(budget.systematic_se("B") > budget.estimate.se("B"))
    assert "parameter 4" in budget.summary()


def test_a_singular_pose_is_refused_with_its_place():
    record, _ = made(contact=False, centre=(1.5, 0.1), seconds=10)
    with pytest.raises(
        ulna.DataError, match=r"row \d+ .*the pose \(.*\) deg is near a singular"
    ) as info:
        sense(record)
    row = int(info.value.detail.removeprefix("row "))
    q = np.array([record["theta_1"][row], record["theta_2"][row]])
    assert ROBOT.quality(q) < 0.051
    assert (
        sense(record.select(rows=slice(0, row - 300))).worst_quality > 0.05 if row > 900 else True
    )


@pytest.mark.parametrize(
    ("keywords", "kind", "message"),
    [
        ({"angle": "tau"}, ulna.DataError, "not in rad"),
        ({"torque": "theta"}, ulna.DataError, "not in Nm"),
        ({"acceleration": "tau"}, ulna.DataError, "not in m/s"),
        ({"angle": "elbow"}, ulna.ArgumentError, "elbow"),
        ({"angle": ["theta_1"]}, ulna.ArgumentError, "two joints"),
        ({"torque_noise_nm": -1.0}, ulna.ArgumentError, "at least 0"),
        ({"least_quality": 2.0}, ulna.ArgumentError, "between 0 and 1"),
        ({"parameter_cov": np.eye(4)}, ulna.ArgumentError, "5 x 5"),
        ({"parameter_cov": np.arange(25.0).reshape(5, 5)}, ulna.ArgumentError, "symmetric"),
    ],
)
def test_what_gives_no_force_is_refused(keywords, kind, message):
    record, _ = made(seconds=8)
    with pytest.raises(kind, match=message):
        sense(record, **keywords)


def test_a_budget_needs_its_own_record_and_something_known():
    force = sense(made(seconds=20)[0], parameter_cov=np.eye(5) * 1e-8)
    other = sense(made(seconds=30)[0])
    with pytest.raises(ulna.ArgumentError, match="rows"):
        force.budget(ulna.identify_impedance(other.record))
    with pytest.raises(ulna.ArgumentError, match="nothing is known"):
        other.budget(ulna.identify_impedance(other.record))
    assert not other.force_se.any()
    with pytest.raises(ulna.ArgumentError, match="no parameter"):
        force.budget(ulna.identify_impedance(force.record)).total_se("Q")


# The robot's parameters --------------------------------------------------------------------------


def test_parameters_agree_with_numpy():
    """Least squares with NumPy on the exact motion; without noise both are the truth."""
    record, _ = made(contact=False, reach=0.35, seconds=50)
    fit = identify_robot(record, reference="ref")
    assert fit.value == pytest.approx(ROBOT.parameters, rel=2e-4)
    assert fit.other == pytest.approx(ROBOT.parameters, rel=2e-4)
    assert fit.outcome == "good"
    assert fit.vaf.min() > 99.99
    assert fit.robot.alpha == pytest.approx(ROBOT.alpha, rel=2e-4)
    assert "alpha_1" in fit.summary() and "both estimators agree" in fit.summary()
    t, rate = record.time, record.rate_hz
    q = np.column_stack([record["theta_1"], record["theta_2"]])
    rates = np.gradient(q, 1 / rate, axis=0)
    second = np.gradient(rates, 1 / rate, axis=0)
    rows = slice(2, len(t) - 2)
    y = ROBOT.regressor(q[rows], rates[rows], second[rows]).reshape(-1, 5)
    tau = np.column_stack([record["tau_1"], record["tau_2"]])[rows].reshape(-1)
    oracle, *_ = np.linalg.lstsq(y, tau, rcond=None)
    # Central differences at 250 Hz err by (omega h)^2 / 6, 4e-4 at 2 Hz.
    assert fit.value == pytest.approx(oracle, rel=5e-3)


def test_errors_of_parameters_are_honest():
    z = []
    for seed in range(8):
        record, _ = made(
            contact=False, reach=0.35, seconds=30, angle=3e-4, torque=0.05, wobble=0.04, seed=seed
        )
        fit = identify_robot(record, reference="ref")
        z.append((fit.value - ROBOT.parameters) / fit.se)
    # 40 standardised values.
    assert 0.35 < np.mean(np.square(z)) < 2.0


def test_instruments_withstand_what_biases_least_squares():
    record, _ = made(contact=False, reach=0.35, seconds=50, angle=0.02, torque=0.02)
    fit = identify_robot(record, reference="ref", lowpass_hz=15)
    truth = ROBOT.parameters[:3]
    assert np.abs(fit.value[:3] / truth - 1).max() < 0.5 * np.abs(fit.other[:3] / truth - 1).max()
    assert fit.difference_p < 0.01
    squares = identify_robot(record, reference="ref", lowpass_hz=15, estimator="ls")
    assert squares.outcome == "look"
    assert any("differs from instrumental variables" in words for words in squares.warnings)


def test_dry_friction_is_found_and_used():
    dry = (Friction(sliding=0.08, breakaway=0.08, threshold=0.02),) * 2
    record, _ = made(contact=False, reach=0.35, robot=PlanarRobot(dry_friction=dry), rate=500)
    fit = identify_robot(record, dry_friction=True)
    assert fit.names[-1] == "dry_2"
    assert fit.value[5:] == pytest.approx([0.08, 0.08], abs=0.006)
    assert fit.robot.dry_friction[0].sliding == pytest.approx(fit.value[5])
    assert identify_robot(record).vaf.min() < fit.vaf.min()


def test_an_estimated_robot_senses_with_its_errors():
    free, _ = made(contact=False, reach=0.35, angle=2e-5, torque=0.05, seconds=50)
    robot = identify_robot(free, reference="ref")
    record, truth = made(torque=0.02, angle=1e-5)
    force = sense(record, robot=robot)
    miss = inner(force.force - truth_at(truth, force.record))
    assert np.sqrt(np.mean(miss**2)) < 0.2
    assert force.constants[:2] == ("parameter 1", "parameter 2")
    assert force.constant_cov == pytest.approx(robot.cov)


def test_parameters_that_no_body_has():
    inertia, friction = virtual_sensor.feasible(ROBOT.parameters)
    assert inertia == pytest.approx(
        min(np.linalg.eigvalsh(ROBOT.inertia([q, 0.0]))[0] for q in np.linspace(0, 2 * np.pi, 721)),
        abs=1e-9,
    )
    assert friction == pytest.approx(0.0651)
    record, _ = made(contact=False, reach=0.35)
    wrong = ulna.Record.from_arrays(
        record.time,
        {c.name: -record[c.name] if "tau" in c.name else record[c.name] for c in record.channels},
        units={c.name: c.unit for c in record.channels},
        roles={c.name: "other" for c in record.channels},
    )
    fit = identify_robot(wrong)
    assert fit.outcome == "not_feasible" and fit.robot is None
    with pytest.raises(ulna.ArgumentError, match="not feasible"):
        sense(record, robot=fit)


@pytest.mark.parametrize(
    ("keywords", "kind", "message"),
    [
        ({"angle": "a"}, ulna.DataError, "not in rad"),
        ({"torque": "nothing"}, ulna.ArgumentError, "nothing"),
        ({"estimator": "best"}, ulna.ArgumentError, "must be one of"),
        ({"estimator": "iv"}, ulna.ArgumentError, "name the reference"),
        ({"lag_s": -1.0}, ulna.ArgumentError, "positive"),
        ({"reference": "tau"}, ulna.DataError, "not in rad"),
    ],
)
def test_what_gives_no_parameters_is_refused(keywords, kind, message):
    record, _ = made(contact=False, reach=0.35, seconds=10)
    with pytest.raises(kind, match=message):
        identify_robot(record, **keywords)


def test_joints_that_move_alike_do_not_determine_the_parameters():
    record, _ = made(contact=False, reach=0.1, seconds=20)
    alike = {c.name: record[c.name] for c in record.channels}
    # At a right angle sin(theta_1 - theta_2) is 1: alpha_2 acts as alpha_1 and alpha_3 do together.
    alike["theta_2"] = record["theta_1"] + np.pi / 2
    log = ulna.Record.from_arrays(
        record.time, alike, units={c.name: c.unit for c in record.channels},
        roles=dict.fromkeys(alike, "other"),
    )  # fmt: skip
    with pytest.raises(ulna.AnalysisError, match="does not tell the torques? of .*alpha_2") as info:
        identify_robot(log)
    assert info.value.detail.startswith("condition ")


# Table 5.2 ---------------------------------------------------------------------------------------


def test_methods_side_by_side():
    record, _ = made(angle=1e-5, torque=0.02, acceleration=0.05, measured=True)
    cov = np.diag([0.00003, 0.00007, 0.00004, 0.00176, 0.00072]) ** 2
    found = compare(
        record, acceleration="a", reference="ref", parameter_cov=cov, torque_noise_nm=0.02,
        angle_noise_rad=1e-5, acceleration_noise_m_s2=0.05,
    )  # fmt: skip
    assert list(found.estimates) == ["accelerometer", "differentiation", "force sensor"]
    assert all(vaf.min() > 99 for vaf in found.vaf.values())
    for method, estimate in found.estimates.items():
        for name, truth in ARM.items():
            budget = found.budgets.get(method)
            se = budget.total_se(name) if budget else estimate.se(name)
            assert np.abs((getattr(estimate, name) - truth) / se).max() < 4.5, (method, name)
    assert "force sensor" in found.summary() and "K_xx" in found.summary()


def test_without_a_force_sensor_the_methods_are_compared_with_each_other():
    record, _ = made(seconds=20)
    found = compare(record, acceleration="a")
    assert list(found.rms_n) == ["difference"]
    assert found.rms_n["difference"].max() < 1e-3
    assert not found.vaf


def test_figures():
    import matplotlib.pyplot as plt

    record, _ = made(seconds=20, measured=True)
    found = compare(record, acceleration="a", parameter_cov=np.eye(5) * 1e-8)
    assert found.plot().shape == (4, 1)
    assert ulna.plot.virtual_force(found.forces["differentiation"], seconds=2).shape == (4, 1)
    assert ulna.plot.sensing_methods(found).shape == (1, 3)
    with pytest.raises(ulna.ArgumentError, match="no samples"):
        found.plot(start_s=900.0)
    plt.close("all")
