"""The planar robot and friction through the Python surface."""

import pickle

import numpy as np
import pytest

import ulna
from ulna.plant import Friction, PlanarRobot


@pytest.fixture(scope="module")
def robot():
    return PlanarRobot()


@pytest.fixture(scope="module")
def poses():
    rng = np.random.default_rng(1)
    q = np.radians(rng.uniform([-55, 0], [90, 145], (400, 2)))
    return q[np.degrees(q[:, 0] - q[:, 1]) + 90 >= 36]


def test_published_kinematics(robot, poses):
    """(A.1), (A.3) and (A.4), written out anew."""
    q1, q2 = poses.T
    d1, d2 = 0.254, 0.2667
    position = np.column_stack(
        [d1 * np.cos(q1) + d2 * np.sin(q2), d1 * np.sin(q1) - d2 * np.cos(q2)]
    )
    np.testing.assert_allclose(robot.forward(poses), position, atol=1e-15)
    jacobian = np.stack(
        [-d1 * np.sin(q1), d2 * np.cos(q2), d1 * np.cos(q1), d2 * np.sin(q2)], axis=1
    )
    np.testing.assert_allclose(robot.jacobian(poses), jacobian.reshape(-1, 2, 2), atol=1e-15)
    # acos is steep where the arm is stretched: a rounding of the position grows.
    np.testing.assert_allclose(robot.inverse(position), poses, atol=1e-7)


def test_dynamics_follow_from_the_lagrangian(robot, poses):
    """Torques by differentiating the Lagrangian numerically along a motion."""
    rng = np.random.default_rng(2)
    a1, a2, a3, a4, a5 = robot.alpha

    def momentum(q, v):
        coupling = -0.5 * a2 * np.sin(q[0] - q[1])
        return np.array([a1 * v[0] + coupling * v[1], coupling * v[0] + a3 * v[1]])

    def energy(q, v):
        return 0.5 * v @ momentum(q, v)

    h = 1e-6
    for q in poses[:50]:
        v, a = rng.normal(size=2), 10 * rng.normal(size=2)
        along = [momentum(q + s * v, v + s * a) for s in (h, -h)]
        slope = [(energy(q + e, v) - energy(q - e, v)) / (2 * h) for e in h * np.eye(2)]
        torque = (along[0] - along[1]) / (2 * h) - slope + np.array([a4, a5]) * v
        # Central differences err by h^2 and by rounding over h.
        np.testing.assert_allclose(robot.inverse_dynamics(q, v, a), torque, atol=1e-8)
        force = rng.normal(size=2)
        back = robot.forward_dynamics(q, v, torque - robot.jacobian(q).T @ force, force)
        np.testing.assert_allclose(back, a, atol=1e-6)


def test_one_pose_and_many_agree(robot, poses):
    q, v = poses[0], np.array([0.3, -0.2])
    for many, one in (
        (robot.forward(poses), robot.forward(q)),
        (robot.jacobian(poses), robot.jacobian(q)),
        (robot.inertia(poses), robot.inertia(q)),
        (robot.quality(poses), robot.quality(q)),
        (robot.friction(poses), robot.friction(q)),
    ):
        np.testing.assert_array_equal(many[0], one)
    rates = np.tile(v, (len(poses), 1))
    np.testing.assert_array_equal(robot.coriolis(poses, rates)[0], robot.coriolis(q, v))
    np.testing.assert_array_equal(robot.jacobian_rate(poses, rates)[0], robot.jacobian_rate(q, v))
    y = robot.regressor(poses, rates, rates)
    assert y.shape == (len(poses), 2, 5)
    expected = robot.inverse_dynamics(poses, rates, rates)
    np.testing.assert_allclose(y @ robot.parameters, expected, atol=1e-15)


def test_dry_friction():
    dry = Friction(sliding=0.02, breakaway=0.03, threshold=0.05)
    robot = PlanarRobot(dry_friction=(dry, dry))
    speed = np.array([0.1, -0.4])
    viscous = np.array(robot.alpha[3:]) * speed
    np.testing.assert_allclose(robot.friction(speed), dry.force(speed) + viscous, atol=1e-15)
    assert pickle.loads(pickle.dumps(robot)) == robot


def test_published_friction_values():
    f = Friction(sliding=0.3, breakaway=0.5, viscous=0.1, threshold=0.02)
    expected = [0.314276039, 0.441687564, 0.501798790, 0.434612177, 0.330408163, 0.350202848]
    np.testing.assert_allclose(f.force([0.005, 0.01, 0.02, 0.04, 0.1, 0.5]), expected, atol=5e-10)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda r: r.inverse([[0.38, 0.0], [0.9, 0.0]]), "row 1: it is 0.9 m from the base"),
        (lambda r: r.inverse([0.0, -0.45]), "joint 1 is at .* beyond its limits"),
        (lambda r: r.inverse([np.nan, 0.1]), "NaN at row 0"),
        (lambda r: r.forward([1.0, 2.0, 3.0]), "angle must have two columns"),
        (lambda r: r.coriolis([[0.1, 0.2]], [[0.1, 0.2], [0.3, 0.4]]), "rate has 2 rows, 1 are"),
        (lambda r: r.jacobian_rate([0.1, 0.2], [0.1, np.inf]), "infinite|not finite|inf"),
        (lambda r: r.inverse_dynamics([0.1, 0.2], [0, 0], [0, 0], [1.0]), "force must have two"),
        (lambda r: PlanarRobot(alpha=(1, 2, 3)), "alpha must be 5 numbers"),
        (lambda r: PlanarRobot(link_m=("a", 1)), "link_m must be 2 numbers"),
        (lambda r: PlanarRobot(link_m=(0.25, -0.1)), "length of link 2"),
        (lambda r: PlanarRobot(alpha=(0.07, 0.2, 0.04, 0, 0)), "not positive definite"),
        (lambda r: PlanarRobot(dry_friction=(1, 2)), "two ulna.plant.Friction"),
        (
            lambda r: PlanarRobot(dry_friction=(Friction(viscous=1.0), Friction())),
            "viscous friction is alpha_4",
        ),
        (lambda r: Friction(sliding=0.2).force([1.0]), "breaks away below"),
        (lambda r: Friction(breakaway=0.2).force([1.0]), "threshold speed above 0"),
        (lambda r: Friction().force([[np.nan]]), "NaN"),
    ],
)
def test_refuses_with_a_sentence(robot, call, words):
    with pytest.raises(ulna.Error, match=words):
        call(robot)
