"""Errors of the told posture and what they do to torques."""

import numpy as np
import pytest

import ulna
from ulna.body import Link, Motion, body_from_links, human_body
from ulna.motion import hinge_angles, rotation_matrices
from ulna.posture import hinge_errors, joint_segments, posture_deviation, times_small
from ulna.torques import BodySensor, SensorSuite, estimate_torques, suit_sensors

NONE = np.array([1.0, 0.0, 0.0, 0.0])


def turn(small):
    """Rotation matrices of small rotations (n, 3)."""
    return rotation_matrices(times_small(np.tile(NONE, (len(small), 1)), small))


@pytest.mark.parametrize("axes", ["xyz", "xy", "yz", "xz", "x", "y", "z"])
def test_hinge_errors_are_those_of_the_nearest_hinges(axes):
    rng = np.random.default_rng(1)
    angle = 0.6 * rng.normal(size=(40, len(axes)))
    parent, child = 1e-5 * rng.normal(size=(2, 40, 3))
    told = np.tile(np.eye(3), (40, 1, 1))
    for k, axis in enumerate(axes):
        half = np.zeros((40, 4))
        half[:, 0], half[:, 1 + "xyz".index(axis)] = (
            np.cos(angle[:, k] / 2),
            np.sin(angle[:, k] / 2),
        )
        told = told @ rotation_matrices(half)
    found, _ = hinge_angles(np.swapaxes(turn(parent), 1, 2) @ told @ turn(child), axes=axes)
    names = tuple(f"joint_rot{axis}" for axis in axes)
    # Second order: (5e-5)^2 with a factor of 1 / cos of the middle angle.
    assert np.abs(found - angle - hinge_errors(angle, names, parent, child)).max() < 3e-8


def standing():
    """A person who stands with bent arms, on both feet, without errors."""
    body = human_body(height_m=1.8, mass_kg=75)
    suite = SensorSuite(body, suit_sensors(body))
    angle = np.zeros((1, 48))
    for joint, degrees in (
        ("jRightShoulder_rotx", 80), ("jRightShoulder_rotz", 80), ("jRightElbow_rotz", 70),
        ("jLeftShoulder_rotx", -70), ("jL5S1_roty", 10), ("jT9T8_rotz", 8),
    ):  # fmt: skip
        angle[0, body.joints.index(joint)] = np.radians(degrees)
    motion = Motion(angle, orientation=[[1, 0, 0, 0]], position_m=[[0, 0, 0]])
    readings = {joint: [0.0] for joint in body.joints}
    for sensor in suite.sensors:
        if sensor.kind == "accelerometer":
            readings[sensor.name] = body.sensor(
                motion, link=sensor.place, point_m=sensor.position_m
            )[2]
    _, lacking = body.inverse_dynamics(motion)
    feet = [body.links.index(name) for name in ("RightFoot", "LeftFoot")]
    for name, foot in zip(("shoe RightFoot", "shoe LeftFoot"), feet, strict=True):
        place = body.poses(motion)[0, foot, :3]
        force = 0.5 * lacking[0, :3]
        moment = 0.5 * lacking[0, 3:] - np.cross(place, force)
        readings[name] = [[*force, *moment]]
    return suite, motion, suite.stack(readings)


def told(suite, motion, y, small):
    """The same as suits tell it whose segments are turned by `small` (name -> rotations (n, 3), rad)."""
    body = suite.body
    count = len(small["Pelvis"])
    poses = body.poses(motion)[0]
    turned = {
        name: rotation_matrices(poses[body.links.index(name), 3:])[None] @ turn(own)
        for name, own in small.items()
    }
    angle = np.tile(motion.angle, (count, 1))
    for parent, child, names in joint_segments(body):
        relative = np.swapaxes(turned[parent], 1, 2) @ turned[child]
        axes = "".join(name[-1] for name in names)
        angle[:, [body.joints.index(name) for name in names]] = hinge_angles(relative, axes=axes)[0]
    y = np.tile(y, (count, 1))
    for sensor in suite.sensors:
        vectors = {"accelerometer": 1, "external_wrench": 2}.get(sensor.kind, 0)
        for first in (suite.row(sensor.name) + 3 * half for half in range(vectors)):
            rows = slice(first, first + 3)
            y[:, rows] = np.einsum("nji,nj->ni", turn(small[sensor.place]), y[:, rows])
    base = times_small(np.tile(motion.orientation, (count, 1)), small["Pelvis"])
    return Motion(angle, orientation=base, position_m=np.zeros((count, 3))), y


def test_the_deviation_is_the_spread_of_estimates_from_turned_segments():
    suite, motion, y = standing()
    exact = estimate_torques(suite, motion, y, deviations=False).torque[0]
    names = sorted({name for joint in joint_segments(suite.body) for name in joint[:2]})
    rng = np.random.default_rng(4)
    size = np.radians(0.5)
    small = {name: size * rng.normal(size=(300, 3)) for name in names}
    found = estimate_torques(suite, *told(suite, motion, y, small), deviations=False).torque - exact
    spread = np.sqrt(np.mean(np.square(found), axis=0))
    stated = posture_deviation(suite, motion, y, segment_rad=size)[0]
    # 300 draws tell a standard deviation to 4 %; four of these, and 2 % for the second order.
    heavy = stated > 1e-3
    assert heavy.sum() > 40
    assert np.abs(spread[heavy] / stated[heavy] - 1).max() < 0.18
    assert abs(np.median(spread[heavy] / stated[heavy]) - 1) < 0.05


def test_it_grows_with_the_error_and_is_drawn_as_lines_between_frames():
    suite, motion, y = standing()
    frames = 7
    angle = np.tile(motion.angle, (frames, 1))
    angle[:, suite.body.joints.index("jL5S1_roty")] += np.linspace(0, 0.3, frames)
    moving = Motion(angle, orientation=np.tile(NONE, (frames, 1)))
    y = np.tile(y, (frames, 1))
    full = posture_deviation(suite, moving, y)
    some = posture_deviation(suite, moving, y, every=3)
    assert np.array_equal(some[[0, 3, 6]], full[[0, 3, 6]])
    assert np.allclose(some[1], (2 * full[0] + full[3]) / 3)
    half = posture_deviation(suite, moving, y, segment_rad=np.radians(0.5))
    # Linear but for the second order of a rotation of a degree.
    assert np.allclose(2 * half, full, rtol=0.03, atol=1e-4)


def test_readings_that_follow_the_told_posture_follow_it():
    """A force that is told to push along the told forearm turns with it."""
    body = human_body(height_m=1.8, mass_kg=75)
    sensors = [*suit_sensors(body),
               BodySensor("push", "external_wrench", "RightForeArm", 0.1, frame="world_axes")]  # fmt: skip
    suite = SensorSuite(body, sensors)
    _, motion, y = standing()
    forearm = body.links.index("RightForeArm")

    def computed(told):
        turn = rotation_matrices(body.poses(told)[:, forearm, 3:])
        force = -30.0 * turn[:, :, 1]
        return {"push": np.hstack([force, 0.0 * force])}

    y = np.hstack([y, np.hstack(list(computed(motion).values()))])
    by_hand = posture_deviation(suite, motion, y, computed=computed)
    fixed = posture_deviation(suite, motion, y)
    elbow = body.joints.index("jRightElbow_rotz")
    # Along the forearm there is no moment about the elbow, however it is turned.
    assert by_hand[0, elbow] < fixed[0, elbow]


def test_missing_states_are_bridged_and_ends_stay_missing():
    suite, motion, y = standing()
    angle = np.tile(motion.angle, (5, 1))
    angle[[0, 2]] = np.nan
    found = posture_deviation(suite, Motion(angle), np.tile(y, (5, 1)))
    assert np.isnan(found[0]).all()
    assert np.isfinite(found[1:]).all()
    assert np.allclose(found[2], found[1])
    none = posture_deviation(suite, Motion(np.full((2, 48), np.nan)), np.tile(y, (2, 1)))
    assert np.isnan(none).all()


def test_what_cannot_be_is_refused():
    suite, motion, y = standing()
    for size in (0.0, -1.0, np.nan):
        with pytest.raises(ulna.ArgumentError, match="segment_rad must be positive"):
            posture_deviation(suite, motion, y, segment_rad=size)
    with pytest.raises(ulna.ArgumentError, match="every must be at least 1"):
        posture_deviation(suite, motion, y, every=0)
    ball = {"mass_kg": 1.0, "inertia_kg_m2": 0.01 * np.eye(3)}
    other = body_from_links(
        [Link("trunk", **ball), Link("arm", parent="trunk", joint="shoulder", **ball)]
    )
    with pytest.raises(ulna.ArgumentError, match="the joint above 'arm' has other hinges"):
        joint_segments(other)
