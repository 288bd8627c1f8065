"""Virtual force sensor, robot parameters and spring arrays beside the same steps in NumPy and SciPy.

The recording is that of the thesis: 50 s at 1 kHz, two joints, torques and an accelerometer. The peer
smooths with `savgol_filter` and `sosfiltfilt`, forms the force row by row in NumPy's arrays, and fits
parameters by `lstsq`; it has no errors and no checks.
"""

import numpy as np
import pytest

import ulna
from ulna.rig import SpringArray
from ulna.virtual_sensor import identify_robot, sense

pytest.importorskip("scipy")
from peer_impedance import prepare  # noqa: E402
from scipy import optimize  # noqa: E402

FILTERS = {"lowpass_hz": 20.0, "window": 25, "order": 6}
ROBOT = ulna.plant.PlanarRobot()
best = {}


@pytest.fixture(scope="module")
def motion():
    t = np.arange(50_000) / 1000
    w = 2 * np.pi * (0.12 + 0.23 * np.arange(8)[:, None] + [0.0, 0.05])
    at = w * t[:, None, None] + np.arange(16.0).reshape(8, 2) ** 2
    q, rate, second = (0.05 * s.sum(axis=1) for s in (np.sin(at), w * np.cos(at), -(w**2) * np.sin(at)))
    q = q + [0.77, 0.85]
    j = ROBOT.jacobian(q)
    a = np.einsum("tij,tj->ti", j, second)
    a += np.einsum("tij,tj->ti", ROBOT.jacobian_rate(q, rate), rate)
    force = 1.5 * np.column_stack([np.sin(3 * t), np.cos(2 * t)])
    noise = np.random.default_rng(0).normal(size=(3, *q.shape)) * [[[1e-5]], [[0.02]], [[0.05]]]
    loaded = ROBOT.inverse_dynamics(q, rate, second, force) + noise[1]
    free = ROBOT.inverse_dynamics(q, rate, second) + noise[1]
    return t, q + noise[0], loaded, free, a + noise[2]


def record(t, q, tau, a):
    columns = {"theta": (q, "rad"), "tau": (tau, "Nm"), "a": (a, "m/s^2")}
    names = {f"{n}_{j + 1}": v[:, j] for n, (v, _) in columns.items() for j in (0, 1)}
    units = {f"{n}_{j + 1}": u for n, (_, u) in columns.items() for j in (0, 1)}
    return ulna.Record.from_arrays(t, names, units=units, roles=dict.fromkeys(names, "other"))


def peer_force(q, tau, a):
    """The thesis' method 1 in NumPy: smooth all signals, then (5.3) and (5.1)."""
    q, rate = prepare(q, 1, rate_hz=1000.0, **FILTERS)
    (tau,) = prepare(tau, 0, rate_hz=1000.0, **FILTERS)
    (a,) = prepare(a, 0, rate_hz=1000.0, **FILTERS)
    d, alpha = (0.254, 0.2667), ROBOT.alpha
    (s1, s2), (c1, c2) = np.sin(q).T, np.cos(q).T
    j = np.array([[-d[0] * s1, d[1] * c2], [d[0] * c1, d[1] * s2]])
    slope = np.array([-d[0] * c1 * rate[:, 0] ** 2 - d[1] * s2 * rate[:, 1] ** 2,
                      -d[0] * s1 * rate[:, 0] ** 2 + d[1] * c2 * rate[:, 1] ** 2])  # fmt: skip
    inverse = np.linalg.inv(np.moveaxis(j, 2, 0))
    second = np.einsum("tij,jt->ti", inverse, a.T - slope)
    s12, c12 = np.sin(q[:, 0] - q[:, 1]), np.cos(q[:, 0] - q[:, 1])
    h = 0.5 * alpha[1]
    torque = np.column_stack([
        alpha[0] * second[:, 0] - h * s12 * second[:, 1] + h * c12 * rate[:, 1] ** 2 + alpha[3] * rate[:, 0],
        alpha[2] * second[:, 1] - h * s12 * second[:, 0] - h * c12 * rate[:, 0] ** 2 + alpha[4] * rate[:, 1],
    ]) - tau  # fmt: skip
    return np.einsum("tji,tj->ti", inverse, torque)


@pytest.mark.benchmark(group="force on the handle: 50 s, 1 kHz")
def test_force_ulna(benchmark, motion):
    t, q, loaded, _, a = motion
    log = record(t, q, loaded, a)
    force = benchmark(sense, log, acceleration="a", **FILTERS)
    best["ulna"] = benchmark.stats.stats.min
    # Half a window and what the low pass takes to settle are left out at either end.
    assert 49_500 < len(force.record) < 49_976


@pytest.mark.benchmark(group="force on the handle: 50 s, 1 kHz")
def test_force_numpy(benchmark, motion):
    t, q, loaded, _, a = motion
    found = benchmark.pedantic(peer_force, (q, loaded, a), rounds=3)
    best["peer"] = benchmark.stats.stats.min
    ours = sense(record(t, q, loaded, a), acceleration="a", plain_savgol=True, **FILTERS).force
    settled = (len(found) - len(ours)) // 2  # rows that only the peer keeps, at either end
    inner = slice(5000, -5000)  # SciPy pads less at the ends
    assert np.allclose(found[settled : settled + len(ours)][inner], ours[inner], atol=1e-5)


@pytest.mark.benchmark(group="force on the handle: 50 s, 1 kHz")
def test_force_with_its_errors(benchmark, motion):
    t, q, loaded, _, a = motion
    known = {
        "parameter_cov": np.eye(5) * 1e-8, "torque_noise_nm": 0.02, "angle_noise_rad": 1e-5,
        "acceleration_noise_m_s2": 0.05,
    }  # fmt: skip
    benchmark.pedantic(
        sense, (record(t, q, loaded, a),), {"acceleration": "a", **known, **FILTERS}, rounds=3
    )


def test_the_force_is_no_slower_than_numpy(say):
    if not {"ulna", "peer"} <= best.keys():
        pytest.skip("both benchmarks of this group have to run")
    ratio = best["peer"] / best["ulna"]
    say(
        f"virtual force of 50 s: {1e3 * best['ulna']:.0f} ms with its record and checks, NumPy and "
        f"SciPy {1e3 * best['peer']:.0f} ms: {ratio:.1f} times"
    )
    assert ratio > 1


@pytest.mark.benchmark(group="robot parameters: 50 s, 1 kHz")
def test_robot_parameters(benchmark, motion):
    t, q, _, free, a = motion
    fit = benchmark.pedantic(identify_robot, (record(t, q, free, a),), {"lowpass_hz": 5.0}, rounds=3)
    assert fit.value == pytest.approx(ROBOT.parameters, rel=0.03)


@pytest.mark.benchmark(group="equilibrium and stiffness of eight springs")
def test_springs_ulna(benchmark):
    array = SpringArray.on_frame([60, 100, 20, 80, 60, 140, 20, 80])
    # With the range of linearity, which the peer does not look for.
    assert benchmark(array.equilibrium).K[0, 0] > 0


@pytest.mark.benchmark(group="equilibrium and stiffness of eight springs")
def test_springs_scipy(benchmark):
    array = SpringArray.on_frame([60, 100, 20, 80, 60, 140, 20, 80])
    anchors, rate, rest = np.asarray(array)[:, :2], np.asarray(array)[:, 2], np.asarray(array)[:, 3]

    def force(r):
        d = r - anchors
        return -((rate * (1 - rest / np.linalg.norm(d, axis=1)))[:, None] * d).sum(axis=0)

    def run():
        root = optimize.root(force, [0.0, 0.0], tol=1e-13).x
        return -optimize.approx_fprime(root, force, 1e-7)

    assert benchmark(run) == pytest.approx(array.equilibrium().K, abs=0.02)
