"""Rotations, hinge angles, derivatives and the mount of a sensor, against closed forms and a simulated
calibration motion."""

import csv
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import ulna
from ulna.motion import (
    angular_velocity,
    differentiate,
    hinge_angles,
    identify_mount,
    joint_angles,
    proper_acceleration,
    rotation_matrices,
    segment,
)

JOINTS = Path(__file__).resolve().parents[3] / "shared" / "data" / "wholebody" / "joints_48.csv"


def rotation(axis, angle):
    c, s = np.cos(angle), np.sin(angle)
    return {
        "x": np.array([[1, 0, 0], [0, c, -s], [0, s, c]]),
        "y": np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]),
        "z": np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]),
    }[axis]


def quaternion(matrix):
    """Of a rotation matrix, by its dominant eigenvector: another way than the code under test."""
    m = matrix
    k = np.array([
        [m[0, 0] - m[1, 1] - m[2, 2], 0, 0, 0],
        [m[0, 1] + m[1, 0], m[1, 1] - m[0, 0] - m[2, 2], 0, 0],
        [m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], m[2, 2] - m[0, 0] - m[1, 1], 0],
        [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], np.trace(m)],
    ]) / 3  # fmt: skip
    _, vectors = np.linalg.eigh(k)
    x, y, z, w = vectors[:, -1]
    return np.array([w, x, y, z])


def test_quaternions_and_matrices_are_the_same_rotations():
    rng = np.random.default_rng(0)
    q = rng.normal(size=(50, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    matrices = rotation_matrices(q)
    np.testing.assert_allclose(
        matrices @ np.swapaxes(matrices, 1, 2), np.tile(np.eye(3), (50, 1, 1)), atol=1e-14
    )
    np.testing.assert_allclose(np.linalg.det(matrices), 1)
    for one, matrix in zip(q, matrices, strict=True):
        other = quaternion(matrix)
        assert abs(one @ other) == pytest.approx(1, abs=1e-12)
    np.testing.assert_array_equal(rotation_matrices(-q), matrices)
    assert np.isnan(rotation_matrices([np.nan, 0, 0, 0])).all()


@pytest.mark.parametrize("axes", ["x", "y", "z", "xy", "xz", "yz", "xyz"])
def test_hinge_angles_are_found_again(axes):
    rng = np.random.default_rng(len(axes))
    truth = rng.uniform(-1.4, 1.4, size=(60, len(axes)))
    matrices = np.empty((60, 3, 3))
    for row, angles in enumerate(truth):
        matrices[row] = np.eye(3)
        for axis, angle in zip(axes, angles, strict=True):
            matrices[row] = matrices[row] @ rotation(axis, angle)
    matrices[7] = np.nan
    found, misfit = hinge_angles(matrices, axes=axes)
    keep = np.arange(60) != 7
    np.testing.assert_allclose(found[keep], truth[keep], atol=1e-9)
    # The misfit is the angle of a rotation near none: rounding of its matrix.
    np.testing.assert_allclose(misfit[keep], 0, atol=1e-9)
    assert np.isnan(found[7]).all() and np.isnan(misfit[7])


def test_too_few_hinges_leave_the_smallest_misfit():
    rng = np.random.default_rng(3)
    for _ in range(5):
        a, b, c = rng.uniform(-0.6, 0.6, 3)
        target = rotation("x", a) @ rotation("y", b) @ rotation("z", c)
        found, misfit = hinge_angles(target[None], axes="xy")
        best = np.inf
        for da in np.linspace(-0.02, 0.02, 9):
            for db in np.linspace(-0.02, 0.02, 9):
                near = rotation("x", found[0, 0] + da) @ rotation("y", found[0, 1] + db)
                best = min(best, np.arccos(np.clip((np.trace(target.T @ near) - 1) / 2, -1, 1)))
        assert misfit[0] == pytest.approx(best, abs=1e-7)


@pytest.mark.parametrize("axes", ["xy", "yz", "xz"])
def test_two_hinges_come_as_near_as_any_angles_do(axes):
    """Beside a dense search; two local maxima can be almost alike."""
    targets = Rotation.random(20, random_state=3).as_matrix()
    _, misfit = hinge_angles(targets, axes=axes)
    grid = np.linspace(-np.pi, np.pi, 181)
    pairs = np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2)
    products = Rotation.from_euler(axes.upper(), pairs).as_matrix()
    cosine = 0.5 * (np.einsum("nij,mij->nm", targets, products).max(axis=1) - 1)
    searched = np.arccos(np.clip(cosine, -1, 1))
    assert np.all(misfit <= searched + 1e-9)
    assert np.all(misfit > searched - np.radians(2))  # half a step of the grid in either angle


@pytest.mark.skipif(not JOINTS.is_file(), reason="the joint table of the published model is absent")
def test_a_whole_suit_moves_the_published_model():
    with JOINTS.open(encoding="utf-8") as file:
        hinges = [row["joint"] for row in csv.DictReader(file)]
    joints = list(dict.fromkeys(name.rpartition("_rot")[0] for name in hinges))
    rng = np.random.default_rng(4)
    frames = 20
    truth = np.cumsum(0.05 * rng.normal(size=(frames, len(hinges))), axis=0)
    chain = {"Pelvis": np.tile(np.eye(3), (frames, 1, 1))}
    connections, parent = {}, "Pelvis"
    for joint in joints:  # one long chain: who is joined to whom does not matter here
        child = "S" + joint
        turn = np.tile(np.eye(3), (frames, 1, 1))
        for column, name in enumerate(hinges):
            if name.rpartition("_rot")[0] == joint:
                turn = turn @ np.stack([rotation(name[-1], a) for a in truth[:, column]])
        chain[child] = chain[parent] @ turn
        connections[joint] = (f"{parent}/{joint}", f"{child}/{joint}")
        parent = child
    channels = {}
    for name, matrices in chain.items():
        q = np.array([quaternion(m) for m in matrices])
        for at, part in enumerate("wxyz"):
            channels[f"{name}_q{part}"] = q[:, at]
    log = ulna.Record.from_arrays(np.arange(frames) / 60, channels)
    angles, misfit = joint_angles(log, hinges, connections=connections)
    np.testing.assert_allclose(angles, truth, atol=1e-9)
    assert len(misfit) == 22 and max(m.max() for m in misfit.values()) < 1e-7


def test_a_turn_does_not_jump():
    t = np.arange(300) / 60
    half = 2.0 * t  # 4 rad/s: several turns
    channels = {f"A_q{p}": v for p, v in zip("wxyz", (1 + 0 * t, 0 * t, 0 * t, 0 * t), strict=True)}
    channels |= {"B_qw": np.cos(half), "B_qx": 0 * t, "B_qy": 0 * t, "B_qz": np.sin(half)}
    log = ulna.Record.from_arrays(t, channels)
    angles, _ = joint_angles(log, ["j_rotz"], connections={"j": ("A/j", "B/j")})
    np.testing.assert_allclose(angles[:, 0], 4 * t, atol=1e-9)
    assert segment(log, "A")[1].shape == (300, 3) and np.isnan(segment(log, "A")[1]).all()


def test_the_accelerometer_reads_gravity_in_its_own_axes():
    rng = np.random.default_rng(5)
    q = rng.normal(size=(30, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    free = rng.normal(size=(30, 3))
    channels = {f"Head_free_acceleration_{a}": free[:, i] for i, a in enumerate("xyz")}
    channels |= {f"Head_sensor_q{p}": q[:, i] for i, p in enumerate("wxyz")}
    log = ulna.Record.from_arrays(np.arange(30) / 60, channels)
    found = proper_acceleration(log, "Head")
    back = np.einsum("nij,nj->ni", rotation_matrices(q), found)
    np.testing.assert_allclose(back, free + [0, 0, 9.81], atol=1e-13)
    own = {f"Head_sensor_acceleration_{a}": free[:, i] for i, a in enumerate("xyz")}
    log = ulna.Record.from_arrays(np.arange(30) / 60, {**channels, **own})
    np.testing.assert_array_equal(proper_acceleration(log, "Head"), free)
    with pytest.raises(ulna.ArgumentError, match="neither T8_sensor_acceleration_x nor T8_free"):
        proper_acceleration(log, "T8")


def test_derivatives_belong_together_and_tell_their_noise():
    t = np.arange(600) / 60
    truth = np.stack([np.sin(3 * t), t**3], axis=-1)
    found = differentiate(truth, rate_hz=60)
    np.testing.assert_allclose(found.rate[20:-20, 0], 3 * np.cos(3 * t)[20:-20], atol=2e-4)
    np.testing.assert_allclose(found.acceleration[:, 1], 6 * t, atol=1e-8)
    rng = np.random.default_rng(0)
    noise = differentiate(rng.normal(size=60000), rate_hz=60)
    for part, gain in zip(
        (noise.value, noise.rate, noise.acceleration), noise.noise_gains, strict=True
    ):
        assert part.std() == pytest.approx(gain, rel=0.03)


def test_a_gap_stays_a_gap():
    t = np.arange(300) / 60
    y = np.sin(t)
    y[100:104] = np.nan
    found = differentiate(y, rate_hz=60, window=15)
    missing = np.flatnonzero(np.isnan(found.acceleration))
    assert missing.tolist() == list(range(93, 111))
    y[200:210] = np.nan
    y[212:216] = np.nan  # two samples between gaps determine nothing
    assert np.isnan(differentiate(y, rate_hz=60).value[210:212]).all()


def calibration(seed=0, *, seconds=40.0, noise=(0.0, 0.0), axes="xyz", place=(0.05, -0.02, 0.12)):
    """A segment that is waved about, and the sensor on it, by closed forms of its Euler angles."""
    rng = np.random.default_rng(seed)
    rate = 100.0
    t = np.arange(0, seconds, 1 / rate)

    def motion(t):
        out = np.eye(3)[None].repeat(len(t), axis=0)
        for axis, f, a in zip("xyz", (0.5, 0.7, 0.9), (0.8, 0.7, 0.6), strict=True):
            if axis in axes:
                angle = a * np.sin(2 * np.pi * f * t + f)
                out = out @ np.stack([rotation(axis, b) for b in angle])
        return out

    def path(t):
        return np.stack(
            [0.1 * np.sin(3 * t), 0.2 * np.cos(2 * t), 1 + 0.05 * np.sin(4 * t)], axis=-1
        )

    mount = rotation("x", 0.3) @ rotation("z", -1.2)
    bias = np.array([0.01, -0.02, 0.005])
    h = 1e-4
    r = np.array(place)
    turn = motion(t)
    skew = np.swapaxes(turn, 1, 2) @ (motion(t + h) - motion(t - h)) / (2 * h)
    omega = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=-1)
    where = [path(u) + np.einsum("nij,j->ni", motion(u), r) for u in (t - h, t, t + h)]
    proper = (where[0] - 2 * where[1] + where[2]) / h**2 + [0, 0, 9.81]
    in_segment = np.einsum("nji,nj->ni", turn, proper)
    gyroscope = omega @ mount + bias + noise[0] * rng.normal(size=(len(t), 3))
    accelerometer = in_segment @ mount + noise[1] * rng.normal(size=(len(t), 3))
    q = np.array([quaternion(m) for m in turn])
    return (accelerometer, gyroscope, q, path(t)), mount, r, bias, rate


def test_the_mount_is_found():
    signals, mount, place, bias, rate = calibration()
    found = identify_mount(*signals, rate_hz=rate, window=9, order=6)
    # The filter bends movements of 1 Hz by some 1e-5, the reference's differences by 1e-7.
    np.testing.assert_allclose(found.rotation, mount, atol=2e-4)
    np.testing.assert_allclose(found.position_m, place, atol=1e-3)
    np.testing.assert_allclose(found.gyroscope_bias_rad_s, bias, atol=1e-3)
    assert "mm" in found.summary() and "sensor at" in repr(found)


def test_the_errors_of_the_mount_are_honest():
    turns, places = [], []
    for seed in range(7):
        signals, mount, place, _, rate = calibration(seed, noise=(0.02, 0.3), seconds=15.0)
        found = identify_mount(*signals, rate_hz=rate)
        skew = found.rotation @ mount.T
        vector = 0.5 * np.array(
            [skew[2, 1] - skew[1, 2], skew[0, 2] - skew[2, 0], skew[1, 0] - skew[0, 1]]
        )
        turns.append(vector / found.rotation_error_rad)
        places.append((found.position_m - place) / found.position_error_m)
    for ratios in (turns, places):
        # 21 ratios; the filter's bias of the place adds a little. 99.9 % limits of a sample of 21.
        assert 0.5 < np.sqrt(np.mean(np.square(ratios))) < 1.8


def test_a_motion_that_does_not_show_the_mount_is_refused():
    for axes, words in (("z", "one axis only"), ("", "one axis only")):
        signals, *_, rate = calibration(axes=axes, noise=(1e-4, 1e-3))
        with pytest.raises(ulna.AnalysisError, match=words):
            identify_mount(*signals, rate_hz=rate)
    signals, *_, rate = calibration(seconds=5.0)
    with pytest.raises(ulna.AnalysisError, match="at least 8 s"):
        identify_mount(*signals, rate_hz=rate)


def test_what_cannot_be_is_refused():
    log = ulna.Record.from_arrays([0, 0.1], {"a": [0.0, 1.0]})
    eye = np.eye(3)[None]
    for call, words in (
        (lambda: rotation_matrices([1.0, 0, 0]), "shape"),
        (lambda: rotation_matrices([[1, 0, 0, 0], [2.0, 0, 0, 0]]), "frame 1 has the length 2"),
        (lambda: segment(log, "T8"), "no orientation of 'T8'"),
        (lambda: hinge_angles(np.eye(3)), "shape"),
        (lambda: hinge_angles(eye, axes="zx"), "in this order"),
        (lambda: hinge_angles(eye, axes=""), "in this order"),
        (lambda: hinge_angles(eye, axes="xx"), "in this order"),
        (lambda: joint_angles(log, ["jA_rotx"], connections={}), "jA_rotx"),
        (lambda: joint_angles(log, ["jA_rotq"], connections={"jA": ("a/b", "c/d")}), "jA_rotq"),
        (lambda: differentiate(np.zeros((3, 3, 3)), rate_hz=60), "axes"),
        (lambda: differentiate(np.zeros(100), rate_hz=60, order=1), "order"),
        (lambda: differentiate(np.zeros(100), rate_hz=60, window=14), "window"),
        (lambda: differentiate(np.zeros(100), rate_hz=0), "rate"),
        (lambda: angular_velocity(np.array([1.0, 0, 0, 0]), rate_hz=60), "shape"),
        (lambda: identify_mount(np.zeros((5, 3)), np.zeros((4, 3)), np.tile([1.0, 0, 0, 0], (5, 1)),
                                np.zeros((5, 3)), rate_hz=60), "gyroscope_rad_s has the shape"),
    ):  # fmt: skip
        with pytest.raises(ulna.Error, match=words):
            call()
