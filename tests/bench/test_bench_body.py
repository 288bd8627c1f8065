"""Whole-body inverse dynamics of the 48-joint human, read by both from the same URDF, beside Pinocchio's
recursive Newton-Euler (``rnea``), and what the estimate with its standard deviations costs beside it.

Pinocchio is called once a frame from Python, as its users do; that call is a part of its time. Where
its wheel ``pin`` is not installed the comparison is skipped.
"""

import numpy as np
import pytest
from ulna.body import Motion, body_from_text, human_body
from ulna.torques import SensorSuite, estimate_torques, suit_sensors

FRAMES = 100
GROUP = "torques of 100 frames of a body with 48 joints"
BODY = human_body(height_m=1.793, mass_kg=72.7)
best = {}


@pytest.fixture(scope="module")
def urdf():
    return BODY.to_text(format="urdf", name="human")


@pytest.fixture(scope="module")
def motion():
    """Everything moves, the base as well; SI, world axes."""
    rng = np.random.default_rng(1)
    joints = rng.normal(size=(3, FRAMES, 48)) * np.array([0.5, 2.0, 10.0])[:, None, None]
    quaternion = rng.normal(size=(FRAMES, 4))
    return Motion(
        angle=joints[0],
        rate=joints[1],
        acceleration=joints[2],
        position_m=rng.normal(size=(FRAMES, 3)),
        orientation=quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True),
        velocity_m_s=rng.normal(size=(FRAMES, 3)),
        angular_velocity_rad_s=rng.normal(size=(FRAMES, 3)),
        base_acceleration=np.hstack(
            [
                [0, 0, 9.81] + 3 * rng.normal(size=(FRAMES, 3)),
                5 * rng.normal(size=(FRAMES, 3)),
            ]
        ),
    )


def pinocchio_states(pin, model, motion):
    """The same frames as Pinocchio has them: base velocities in base axes, spatial accelerations."""
    order = np.argsort([model.joints[model.getJointId(name)].idx_v for name in BODY.joints])
    rows = []
    for i in range(FRAMES):
        w, *xyz = motion.orientation[i]
        turn = pin.Quaternion(np.array([*xyz, w])).toRotationMatrix()
        linear = turn.T @ motion.velocity_m_s[i]
        angular = turn.T @ motion.angular_velocity_rad_s[i]
        proper = motion.base_acceleration[i]
        # Spatial: what the velocity of a point fixed in the base does, seen from the base.
        acceleration = turn.T @ (proper[:3] - [0, 0, 9.81]) - np.cross(angular, linear)
        q = np.concatenate([motion.position_m[i], xyz, [w], motion.angle[i][order]])
        v = np.concatenate([linear, angular, motion.rate[i][order]])
        a = np.concatenate([acceleration, turn.T @ proper[3:], motion.acceleration[i][order]])
        rows.append((q, v, a))
    return rows, order


@pytest.mark.benchmark(group=GROUP)
def test_ulna(benchmark, urdf, motion):
    body = body_from_text(urdf)
    torque, missing = benchmark(body.inverse_dynamics, motion)
    best["ulna"] = benchmark.stats.stats.min
    assert np.isfinite(torque).all() and np.isfinite(missing).all()


@pytest.mark.benchmark(group=GROUP)
def test_pinocchio(benchmark, urdf, motion):
    pin = pytest.importorskip("pinocchio", reason="the wheel 'pin' is not installed")
    model = pin.buildModelFromXML(urdf, pin.JointModelFreeFlyer())
    model.gravity.linear = np.array([0.0, 0.0, -9.81])
    data = model.createData()
    states, order = pinocchio_states(pin, model, motion)
    out = np.empty((FRAMES, 54))

    def frames():
        for i, state in enumerate(states):
            out[i] = pin.rnea(model, data, *state)

    benchmark(frames)
    best["pinocchio"] = benchmark.stats.stats.min
    torque, missing = body_from_text(urdf).inverse_dynamics(motion)
    scale = np.abs(torque).max()
    assert np.abs(out[:, 6:] - torque[:, order]).max() < 1e-8 * scale
    # The base's part, in base axes about its origin.
    turn = np.array([pin.Quaternion(np.array([*q[1:], q[0]])).matrix() for q in motion.orientation])
    wrench = np.hstack(
        [np.einsum("nji,nj->ni", turn, part) for part in np.split(missing, 2, axis=1)]
    )
    assert np.abs(out[:, :6] - wrench).max() < 1e-8 * np.abs(wrench).max()


@pytest.mark.benchmark(group=GROUP)
@pytest.mark.parametrize("deviations", [False, True])
def test_estimate(benchmark, motion, deviations):
    """The whole estimate from 17 accelerometers, 48 accelerations of joints and two shoes."""
    suite = SensorSuite(BODY, suit_sensors(BODY))
    y = np.random.default_rng(2).normal(size=(FRAMES, len(suite.rows)))
    found = benchmark(estimate_torques, suite, motion, y, deviations=deviations, threads=1)
    best["deviations" if deviations else "estimate"] = benchmark.stats.stats.min
    assert found.unusable == 0 and np.isfinite(found.torque).all()


def test_a_frame_is_quick(say):
    if not {"ulna", "estimate", "deviations"} <= set(best):
        pytest.skip("all benchmarks of this group have to run")
    micros = {name: 1e6 * seconds / FRAMES for name, seconds in best.items()}
    words = f"a frame of 48 joints: inverse dynamics {micros['ulna']:.1f} us"
    if "pinocchio" in micros:
        words += f", Pinocchio's {micros['pinocchio']:.1f} us"
    say(
        f"{words}; estimate {micros['estimate']:.0f} us, with standard deviations "
        f"{micros['deviations']:.0f} us"
    )
    # With copies in and out of Python; the limits are those of the estimate itself.
    assert micros["estimate"] < 60 and micros["deviations"] < 300
