"""Torques of a body with their deviations: exact data, noise, missing data, streams, bad sensors."""

import json
import pickle
from pathlib import Path

import numpy as np
import pytest

import ulna
from ulna.body import Link, Motion, body_from_links, human_body, human_names, read_body
from ulna.torques import (
    BodySensor,
    Prior,
    SensorSuite,
    TorqueStream,
    estimate_torques,
    model_sensors,
    start_check,
    suit_sensors,
)

SHARED = Path(__file__).resolve().parents[3] / "shared" / "data" / "wholebody"
FRAMES = 120


def suit(body):
    sensors = [
        BodySensor(f"imu {name}", "accelerometer", name, 0.1) for name in human_names("suit")
    ]
    sensors += [BodySensor(joint, "joint_acceleration", joint, 0.5) for joint in body.joints]
    sensors += [
        BodySensor(foot, "external_wrench", foot, (2.0, 0.5), position_m=(0.05, 0, -0.06))
        for foot in ("RightFoot", "LeftFoot")
    ]
    return sensors


@pytest.fixture(scope="module")
def made():
    """A person who sways, on two feet, and what the suit reads without noise."""
    body = human_body(height_m=1.793, mass_kg=72.7)
    rng = np.random.default_rng(3)
    t = np.arange(FRAMES)[:, None] / 60.0
    w = 2.0 * np.pi * rng.uniform(0.2, 1.0, 48)
    phase = rng.uniform(0, 2 * np.pi, 48)
    size = 0.1 * rng.uniform(size=48)
    motion = Motion(
        angle=size * np.sin(w * t + phase),
        rate=size * w * np.cos(w * t + phase),
        acceleration=-size * w**2 * np.sin(w * t + phase),
        position_m=np.tile([0.0, 0.0, 0.95], (FRAMES, 1)),
    )
    _, missing = body.inverse_dynamics(motion)
    # The right foot carries two thirds of what the base lacks; told about the feet, in their axes.
    poses = body.poses(motion)
    suite = SensorSuite(body, suit(body))
    external = np.zeros((FRAMES, 49, 6))
    readings = {}
    for foot, share in (("RightFoot", 0.65), ("LeftFoot", 0.35)):
        k = body.links.index(foot)
        for f in range(FRAMES):
            qw, *qv = poses[f, k, 3:]
            r = rotation(qw, np.array(qv))
            force = share * missing[f, :3]
            arm = poses[f, k, :3] - poses[f, 0, :3]
            moment = share * missing[f, 3:] - np.cross(arm, force)
            external[f, k] = [*(r.T @ force), *(r.T @ moment)]
        place = np.array([0.05, 0, -0.06])
        moved = external[:, k, 3:] - np.cross(place, external[:, k, :3])
        readings[foot] = np.hstack([external[:, k, :3], moved])
    for name in human_names("suit"):
        readings[f"imu {name}"] = body.sensor(motion, link=name)[2]
    for k, joint in enumerate(body.joints):
        readings[joint] = motion.acceleration[:, k]
    torque, lacking = body.inverse_dynamics(motion, external)
    assert np.abs(lacking).max() < 1e-9
    return body, suite, motion, suite.stack(readings), torque


def rotation(w, v):
    cross = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross


def noisy(suite, y, seed=1):
    return y + suite.deviation * np.random.default_rng(seed).normal(size=y.shape)


@pytest.mark.parametrize("solver", ["closed_form", "sparse"])
def test_exact_measurements_give_inverse_dynamics(made, solver):
    body, suite, motion, y, torque = made
    open_prior = SensorSuite(
        body,
        suite.sensors,
        prior=Prior(base_acceleration_m_s2=1e6, base_angular_acceleration_rad_s2=1e6,
                    joint_acceleration_rad_s2=1e6),
    )  # fmt: skip
    found = estimate_torques(
        open_prior, motion, y, solver=solver, model_deviation=0.0, wrenches=True
    )
    assert np.abs(found.torque - torque).max() < 1e-7
    assert found.external.shape == (FRAMES, 49, 6) and found.joint_wrench.shape == (FRAMES, 49, 6)
    if solver == "closed_form":
        assert np.abs(found.residual).max() < 1e-7
        assert found.torque_deviation.shape == torque.shape
    else:
        assert found.torque_deviation.size == 0


def test_intervals_hold_the_truth(made):
    _, suite, motion, y, torque = made
    found = estimate_torques(suite, motion, noisy(suite, y))
    # Toes weigh grams: what may touch them beyond the truth's nothing decides their deviation.
    joints = [k for k, name in enumerate(found.joints) if "BallFoot" not in name]
    inside = np.abs(found.torque - torque)[:, joints] < 1.96 * found.torque_deviation[:, joints]
    assert 0.93 < inside.mean() < 0.97
    assert found.balance_nis.mean() == pytest.approx(6.0, abs=1.5)
    assert found.motion_nis.mean() == pytest.approx(found.motion_freedom.mean(), rel=0.1)
    assert found.suspects() == {}
    low, high = found.interval("jRightKnee_roty")
    assert (low < high).all()
    assert "jRightKnee_roty" in found.summary() and "BodyTorques(120 frames" in repr(found)
    with pytest.raises(ulna.ArgumentError, match="no joint 'knee'"):
        found.interval("knee")


def test_threads_do_not_matter_and_streams_give_the_same(made):
    _, suite, motion, y, _ = made
    y = noisy(suite, y)
    one = estimate_torques(suite, motion, y, threads=1)
    two = estimate_torques(suite, motion, y, threads=2)
    assert (one.torque == two.torque).all() and one.log_likelihood == two.log_likelihood
    stream = TorqueStream(pickle.loads(pickle.dumps(suite)))
    for f in (0, 7, 119):
        torque, deviation, residual = stream.update(
            motion.angle[f], motion.rate[f], y[f], position_m=motion.position_m[f]
        )
        assert (torque == one.torque[f]).all()
        assert (deviation == one.torque_deviation[f]).all()
        assert (residual == one.residual[f]).all()
    lost = stream.update(np.full(48, np.nan), motion.rate[0], y[0])
    assert all(np.isnan(part).all() for part in lost)
    sparse = TorqueStream(suite, solver="sparse").update(motion.angle[0], motion.rate[0], y[0])
    assert np.isfinite(sparse[0]).all() and np.isnan(sparse[1]).all()
    with pytest.raises(ulna.ArgumentError, match="angle holds 47"):
        stream.update(np.zeros(47), motion.rate[0], y[0])


def test_what_is_missing_widens_and_is_never_zero(made):
    body, suite, motion, y, torque = made
    y = noisy(suite, y)
    full = estimate_torques(suite, motion, y)
    dropped = y.copy()
    dropped[::10] = np.nan
    found = estimate_torques(suite, motion, dropped)
    assert np.isfinite(found.torque).all()
    assert (found.torque_deviation[::10] > full.torque_deviation[::10] - 1e-9).all()
    assert (found.torque_deviation[1::10] == full.torque_deviation[1::10]).all()
    angle = np.array(motion.angle)
    angle[20:24] = np.nan
    gap = Motion(angle, motion.rate, position_m=motion.position_m)
    bridged = estimate_torques(suite, gap, y)
    assert bridged.bridged.nonzero()[0].tolist() == [20, 21, 22, 23] and bridged.unusable == 0
    assert np.abs(bridged.torque - torque)[20:24].max() < 100.0
    left = estimate_torques(suite, gap, y, longest_gap=0)
    assert left.unusable == 4 and np.isnan(left.torque[20:24]).all()


def test_a_shoe_that_lies_is_named(made):
    _, suite, motion, y, _ = made
    y = noisy(suite, y)
    shoe = suite.rows.index("RightFoot.force_z")
    y[:, shoe] += 40.0
    found = estimate_torques(suite, motion, y)
    assert found.balance_nis.mean() > 20.0
    assert "RightFoot.force_z" in found.suspects()
    assert "larger than expected" in found.summary()


@pytest.mark.parametrize("fault", ["dead", "swapped"])
def test_a_bad_accelerometer_is_named(made, fault):
    _, suite, motion, y, _ = made
    y = noisy(suite, y)
    arm, hand = (slice(suite.row(f"imu {n}"), suite.row(f"imu {n}") + 3)
                 for n in ("RightForeArm", "RightHand"))  # fmt: skip
    bad = y.copy()
    if fault == "dead":
        bad[:, arm] = 0.0
    else:  # mounted on each other's link, and turned
        bad[:, arm], bad[:, hand] = y[:, hand][:, [1, 0, 2]], y[:, arm][:, [1, 0, 2]]
    found = estimate_torques(suite, motion, bad)
    worst = list(found.suspects())[:3]
    assert any(name.startswith(("imu RightForeArm", "imu RightHand")) for name in worst), worst
    assert found.motion_nis.mean() > 1.3 * found.motion_freedom.mean()


def test_variances_are_found_from_the_data(made):
    _, suite, motion, y, _ = made
    wrong = suite.with_deviation(suite.deviation * 3.0)
    fit = wrong.fit(motion, noisy(suite, y), steps=30, frames=60)
    imu = [k for k, name in enumerate(suite.rows) if name.startswith("imu")]
    ratio = fit.deviation[imu] / suite.deviation[imu]
    assert np.median(ratio) == pytest.approx(1.0, abs=0.1)
    assert fit.suite.deviation == pytest.approx(fit.deviation)
    assert "log-likelihood" in fit.summary()
    with pytest.raises(ulna.ArgumentError, match="groups"):
        wrong.fit(motion, y, groups=np.zeros(3))


def test_free_hands_cannot_be_told_apart(made):
    body, suite, motion, y, _ = made
    still = Motion(np.zeros((1, 48)))
    hands = [BodySensor(name, "free_wrench", name) for name in ("RightHand", "LeftHand")]
    both = SensorSuite(body, [*suite.sensors, *hands]).identifiability(still)
    assert (both.wrench_unknowns, both.wrench_rank) == (12, 6)
    assert (both.force_unknowns, both.force_rank) == (6, 5)
    assert not both.complete and "RightHand, LeftHand" in both.summary()
    assert suite.identifiability(still).complete
    none = suite.identifiability(still, np.full((1, len(suite.rows)), np.nan))
    assert none.motion_rank == 0 and not none.complete


def test_the_stack_of_tasks(made):
    _, suite, motion, y, torque = made
    found = estimate_torques(suite, motion, y, stack=True, momentum_rate_deviation=(0.5, 0.5))
    assert np.abs(found.torque - torque).max() < 1e-3
    with pytest.raises(ulna.ArgumentError, match="positive"):
        estimate_torques(suite, motion, y, stack=True, momentum_rate_deviation=(0.0, 1.0))
    with pytest.raises(ulna.ArgumentError, match="closed form"):
        estimate_torques(suite, motion, y, stack=True, solver="sparse")


def test_what_cannot_be_is_refused(made):
    body, suite, motion, y, _ = made
    good = BodySensor("imu", "accelerometer", "T8", 0.1)
    with pytest.raises(ulna.ArgumentError, match="no link|has not"):
        SensorSuite(body, [BodySensor("imu", "accelerometer", "Spine", 0.1)])
    with pytest.raises(ulna.ArgumentError, match="joint 'T8'"):
        SensorSuite(body, [BodySensor("imu", "joint_torque", "T8", 0.1)])
    with pytest.raises(ulna.ArgumentError, match="kind is 'gyro'"):
        SensorSuite(body, [BodySensor("imu", "gyro", "T8", 0.1)])
    with pytest.raises(ulna.ArgumentError, match="frame is 'moon'"):
        SensorSuite(body, [BodySensor("imu", "accelerometer", "T8", 0.1, frame="moon")])
    with pytest.raises(ulna.ArgumentError, match="deviations"):
        SensorSuite(body, [BodySensor("imu", "accelerometer", "T8")])
    with pytest.raises(ulna.ArgumentError, match="two sensors"):
        SensorSuite(body, [good, good])
    with pytest.raises(ulna.ArgumentError, match="prior"):
        SensorSuite(body, [good], prior=Prior(force_n=-1.0))
    with pytest.raises(ulna.ArgumentError, match="no sensor 'x'"):
        suite.stack({"x": np.zeros(3)})
    with pytest.raises(ulna.ArgumentError, match="shape"):
        suite.stack({"RightFoot": np.zeros((4, 3))})
    with pytest.raises(ulna.ArgumentError, match="measured is"):
        estimate_torques(suite, motion, y[:5])
    with pytest.raises(ulna.ArgumentError, match="solver is 'magic'"):
        estimate_torques(suite, motion, y, solver="magic")
    with pytest.raises(ulna.ArgumentError, match="model"):
        estimate_torques(suite, motion, y, solver="sparse", model_deviation=-1.0)
    with pytest.raises(ulna.ArgumentError, match="2 x"):
        estimate_torques(suite, Motion(np.zeros((2, 48))), y)


def test_sensors_of_a_suit_and_of_a_model(made, tmp_path):
    body = made[0]
    suite = SensorSuite(body, suit_sensors(body))
    assert len(suite.rows) == 17 * 3 + 48 + 12
    with pytest.raises(ulna.ArgumentError, match="no link"):
        suit_sensors(body_from_links([Link("trunk", mass_kg=1.0, inertia_kg_m2=np.eye(3))]))
    path = tmp_path / "model.json"
    links = [{"name": "foot", "mass": 1.0, "com": [0, 0, 0], "inertia_diag": [1, 1, 1]}]
    path.write_text(json.dumps({"links": links, "plate": {"link": "foot"}}))
    names = [sensor.name for sensor in model_sensors(path)]
    assert names == ["still", "upright", "plate"]
    path.write_text(json.dumps({"links": links, "imu": {"link": "foot"}}))
    with pytest.raises(ulna.FormatError, match="position"):
        model_sensors(path)


def test_the_start_check_names_what_does_not_fit(made):
    body, suite, motion, y, _ = made
    y = noisy(suite, y)
    good = start_check(suite, motion, y)
    assert good.findings == () and good.carried_kg == pytest.approx(72.7, abs=0.1)
    assert "72.70 kg" in good.summary()
    right, left = (
        slice(suite.row(foot), suite.row(foot) + 6) for foot in ("RightFoot", "LeftFoot")
    )
    swapped = y.copy()
    swapped[:, right], swapped[:, left] = y[:, left], y[:, right]
    assert any("exchanged" in words for words in start_check(suite, motion, swapped).findings)
    turned = y.copy()
    turned[:, right] *= [1, -1, -1, 1, -1, -1]
    assert any("RightFoot" in w and "upside down" in w
               for w in start_check(suite, motion, turned).findings)  # fmt: skip
    heavier = body.attach("stone", link="T8", mass_kg=1.0, centre_m=(0, 0, 0.1))
    found = start_check(SensorSuite(heavier, suite.sensors), motion, y)
    assert any("too much on the model" in words for words in found.findings)
    assert found.model_kg - found.carried_kg == pytest.approx(1.0, abs=0.1)
    y[:, right] = np.nan
    with pytest.raises(ulna.ArgumentError, match="no frame"):
        start_check(suite, motion, y)
    with pytest.raises(ulna.ArgumentError, match="no external wrench"):
        start_check(SensorSuite(body, suite.sensors[:3]), motion, y)


def test_torques_are_drawn(made):
    _, suite, motion, y, _ = made
    angle = np.array(motion.angle)
    angle[30:33] = np.nan
    found = estimate_torques(suite, Motion(angle, motion.rate, position_m=motion.position_m), y)
    top, below = found.plot(time_s=np.arange(FRAMES) / 60.0)[:, 0]
    assert top.get_ylabel() == "torque (N m)" and below.get_xlabel() == "time (s)"
    assert len(top.get_legend().get_texts()) == 4  # three joints, and what was bridged
    named = found.plot(joints=["jRightKnee_roty"])[0, 0]
    assert named.get_legend().get_texts()[0].get_text() == "jRightKnee_roty"
    with pytest.raises(ulna.ArgumentError, match="no joint 'knee'"):
        found.plot(joints=["knee"])
    with pytest.raises(ulna.ArgumentError, match="one to five"):
        found.plot(joints=[])
    with pytest.raises(ulna.ArgumentError, match="time_s"):
        found.plot(time_s=[0.0])


def test_the_bowing_recording():
    if not (SHARED / "bowing.csv").is_file():
        pytest.skip("the recording is not there")
    body = read_body(SHARED / "bowing-model.json")
    rows = np.genfromtxt(SHARED / "bowing.csv", delimiter=",", skip_header=1)
    suite = SensorSuite(body, model_sensors(SHARED / "bowing-model.json"))
    motion = Motion(rows[:, 1:3], rows[:, 3:5])
    # Without the sensor on the torso, which leans out of the plane that the model moves in.
    y = suite.stack(
        {
            "still": np.tile([0, 0, 9.81], (len(rows), 1)),
            "upright": np.zeros((len(rows), 3)),
            "ankle": rows[:, 5],
            "hip": rows[:, 6],
            "plate": rows[:, 10:],
        }
    )
    found = estimate_torques(suite, motion, y)
    table = [5.77, 2.55, 1.61, 6.43, 8.20, 0.86]
    assert np.sqrt((found.residual**2).mean(axis=0)) == pytest.approx(table, abs=0.05)
    # Small variances that were typed in do not explain the residual; those of the data do.
    assert found.balance_nis.mean() > 30.0
    groups = np.array([-1] * 9 + [0, 1, 2, 2, 2, 3, 3, 3])
    fit = suite.fit(motion, y, groups=groups)
    again = estimate_torques(fit.suite, motion, y)
    assert again.balance_nis.mean() == pytest.approx(6.0, abs=2.0)
    assert np.median(again.torque_deviation[:, 0]) > 3 * np.median(found.torque_deviation[:, 0])
