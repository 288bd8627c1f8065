"""A passive device on the arms: its table, the elevation of the arm, and wrenches in balance."""

from pathlib import Path

import numpy as np
import pytest

import ulna
from ulna._call import check, ffi, lib, options, view
from ulna.assist import (
    ForceCurve,
    ForceTable,
    PassiveDevice,
    elevation,
    elevation_of_joints,
    published_wrenches,
    read_force_table,
    zxy_angles,
)

PAEXO = Path(__file__).resolve().parents[3] / "shared" / "data" / "wholebody" / "paexo.csv"
needs_paexo = pytest.mark.skipif(
    not PAEXO.is_file(), reason="the table of the published study is absent"
)

HEADER = "subject,beta_deg,F_shear_N,F_support_N,F_hip_x_N,F_hip_y_N\n"


def rotation(axis, angle):
    c, s = np.cos(angle), np.sin(angle)
    return {
        "x": np.array([[1, 0, 0], [0, c, -s], [0, s, c]]),
        "y": np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]),
        "z": np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]),
    }[axis]


def pose(frames=200, seed=1):
    """Shoulders, elbows and hips of a person who waves about."""
    rng = np.random.default_rng(seed)
    shoulder = np.array([[0.0, 0.2, 1.4], [0.0, -0.2, 1.4]]) + 0.02 * rng.normal(
        size=(frames, 2, 3)
    )
    arm = rng.normal(size=(frames, 2, 3))
    arm *= 0.33 / np.linalg.norm(arm, axis=-1, keepdims=True)
    return shoulder, shoulder + arm, np.array([0.0, 0.0, 1.0]) + 0.02 * rng.normal(size=(frames, 3))


# Elevation ----------------------------------------------------------------------------------------


def test_zxy_is_the_same_rotation():
    rng = np.random.default_rng(0)
    for u in rng.uniform(-3, 3, size=(200, 3)):
        v = zxy_angles(u)
        first = rotation("x", u[0]) @ rotation("y", u[1]) @ rotation("z", u[2])
        second = rotation("z", v[2]) @ rotation("x", v[0]) @ rotation("y", v[1])
        np.testing.assert_allclose(first, second, atol=1e-13)


def test_both_elevations_agree():
    u = np.random.default_rng(2).uniform(-3, 3, size=(500, 3))
    for side, neutral in (("left", 1.0), ("right", -1.0)):
        turns = np.array([rotation("x", a) @ rotation("y", b) @ rotation("z", c) for a, b, c in u])
        geometric = elevation(turns @ np.array([0.0, neutral, 0.0]))
        # Both are rounded; near the vertical the angle keeps half the digits of its cosine.
        np.testing.assert_allclose(elevation_of_joints(u, side=side), geometric, atol=1e-7)


def test_where_the_arm_hangs_the_other_two_angles_are_not_defined():
    angles = zxy_angles([-np.pi / 2, 0.3, 0.0])
    assert angles[0] == pytest.approx(-np.pi / 2) and np.isnan(angles[1:]).all()
    assert elevation_of_joints([-np.pi / 2, 0.3, 0.0], side="left") == pytest.approx(0, abs=1e-12)


def test_elevation_does_not_depend_on_roll_or_heading():
    base = np.array([-0.4, 0.0, 0.0])
    turn = rotation("x", base[0])
    for roll in (-1.0, 0.5):
        for heading in (-2.0, 1.0):
            whole = rotation("z", heading) @ turn @ rotation("y", roll)
            assert elevation(whole @ [0, 1, 0]) == pytest.approx(np.pi / 2 - 0.4, abs=1e-14)


# Curves -------------------------------------------------------------------------------------------


def test_a_table_is_exact_at_its_angles_and_straight_between(tmp_path):
    path = tmp_path / "device.csv"
    path.write_text(
        HEADER + "1,20,1,10,0,0\n1,40,3,30,0,0\n1,90,2,35,0,0\n2,30,0,12,0,0\n2,95,0,30,0,0\n"
    )
    table = read_force_table(path)
    assert table.subjects == ("1", "2")
    curve = table.of(1)
    angles = np.radians([0, 10, 20, 30, 40, 90])
    np.testing.assert_allclose(curve.support(angles), [0, 5, 10, 20, 30, 35], rtol=1e-13)
    np.testing.assert_allclose(curve.shear(angles[2:5]), [1, 2, 3], rtol=1e-13)
    assert curve.outside(np.radians([0, 90, 91])).tolist() == [False, False, True]
    assert curve.support(np.radians(120)) == 35
    # The mean ends where the shorter table ends.
    assert np.degrees(table.mean.angle_rad[-1]) == pytest.approx(90)
    assert table.mean.support(np.radians(30)) == pytest.approx((20 + 12) / 2)


def test_one_factor_scales_the_mean_to_a_subject():
    shape = ForceCurve.parametric(peak_n=1.0)
    table = ForceTable(
        {str(i): shape.scaled(factor) for i, factor in enumerate((20.0, 30.0, 40.0))}
    )
    for subject, factor in enumerate((20.0, 30.0, 40.0)):
        assert table.scale_of(subject) == pytest.approx(factor / 30)
    own = table.mean.scaled(table.scale_of(2))
    angles = np.radians(np.arange(0, 180, 7))
    np.testing.assert_allclose(own.support(angles), 40 * shape.support(angles), atol=1e-12)


def test_a_fit_finds_the_parameters_of_a_bump():
    angles = np.radians(np.arange(5, 140.0))
    truth = ForceCurve.parametric(peak_n=33, onset_rad=0.2, peak_rad=1.75, exponent=1.8)
    none = np.zeros_like(angles)
    sampled = ForceCurve(angles, truth.support(angles), none, none, none)
    found = ForceTable({"1": sampled}).fit(1)
    np.testing.assert_allclose(found.support(angles), truth.support(angles), atol=0.02)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "no rows with a column 'subject'"),
        ("subject,beta_deg\n1,2\n", "'F_support_N'"),
        (HEADER + "1,20,1,x,0,0\n", "line 2 .* no number"),
        (HEADER + "1,20,1,nan,0,0\n1,30,1,1,0,0\n", "line 2 .* no number"),
        (HEADER + "1,20\n", "line 2 .* no number|increase"),
        (HEADER + ",20,1,1,0,0\n", "line 2"),
        (HEADER + "1,20,1,1,0,0\n1,20,1,1,0,0\n", "must increase"),
        (HEADER + "1,20,1,1,0,0\n1,200,1,1,0,0\n", "180 degrees"),
        (HEADER + "1,20,1,1,0,0\n", "must increase"),
    ],
)
def test_a_spoiled_table_is_refused_in_words(tmp_path, text, words):
    path = tmp_path / "device.csv"
    path.write_text(text)
    with pytest.raises(ulna.FormatError, match=words):
        read_force_table(path)


def test_what_is_no_curve_is_refused(tmp_path):
    with pytest.raises(ulna.FileError):
        read_force_table(tmp_path / "none.csv")
    table = ForceTable({"1": ForceCurve.parametric(peak_n=30)})
    with pytest.raises(ulna.ArgumentError, match="no subject 7; there are 1"):
        table.of(7)
    for wrong in (
        {"peak_n": np.nan},
        {"peak_n": 1, "exponent": 0.5},
        {"peak_n": 1, "onset_rad": 2.0},
    ):
        with pytest.raises(ulna.ArgumentError):
            ForceCurve.parametric(**wrong)
    with pytest.raises(ulna.ArgumentError):
        table.of(1).scaled(np.inf)
    empty = ForceTable({"1": ForceCurve.parametric(peak_n=0)})
    with pytest.raises(ulna.ArgumentError, match="no support"):
        empty.scale_of(1)


# Wrenches -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("along", [False, True])
@pytest.mark.parametrize("up", [(0, 0, 1), (0, 1, 0), (0.1, -0.2, 1)])
def test_the_device_is_in_balance(along, up):
    shear = ForceCurve.parametric(peak_n=20)
    curve = ForceCurve(
        shear.angle_rad, 1.5 * shear.support_n, shear.support_n, *([shear.shear_n] * 2)
    )
    device = PassiveDevice(curve, along_arm=along)
    pair = device.wrenches(*pose(), up=up)
    vertical = np.array(up) / np.linalg.norm(up)
    np.testing.assert_allclose(
        pair.net_force_n, -1.8 * 9.81 * np.tile(vertical, (200, 1)), atol=1e-9
    )
    np.testing.assert_allclose(pair.net_moment_nm, 0, atol=1e-9)
    # About any other point the sum is the weight's moment alone.
    origin = np.array([0.3, -2.0, 5.0])
    arms = pair.arm_wrench(np.broadcast_to(origin, (200, 2, 3)))
    hip = pair.hip_wrench(np.broadcast_to(origin, (200, 3)))
    weight = np.cross(pair.hip_point_m - origin, -1.8 * 9.81 * vertical)
    np.testing.assert_allclose((arms.sum(axis=1) + hip)[:, 3:], weight, atol=1e-9)


def test_the_force_is_perpendicular_upward_and_in_the_vertical_plane():
    shoulder, elbow, hip = pose()
    curve = ForceCurve.parametric(peak_n=30)
    pair = PassiveDevice((curve, curve.scaled(2))).wrenches(shoulder, elbow, hip)
    arm = elbow - shoulder
    np.testing.assert_allclose(np.sum(pair.arm_force_n * arm, axis=-1), 0, atol=1e-12)
    assert (pair.arm_force_n[..., 2] >= 0).all()
    sideways = np.cross(arm, [0.0, 0.0, 1.0])
    np.testing.assert_allclose(np.sum(pair.arm_force_n * sideways, axis=-1), 0, atol=1e-12)
    size = np.linalg.norm(pair.arm_force_n, axis=-1)
    np.testing.assert_allclose(size[:, 0], curve.support(elevation(arm[:, 0])), atol=1e-12)
    np.testing.assert_allclose(size[:, 1], 2 * curve.support(elevation(arm[:, 1])), atol=1e-12)
    np.testing.assert_allclose(pair.arm_point_m, shoulder + 0.6895 * arm)


def test_turning_the_world_turns_the_wrenches():
    shoulder, elbow, hip = pose()
    turn = rotation("x", 0.7) @ rotation("z", -1.1)
    device = PassiveDevice(ForceCurve.parametric(peak_n=30))
    first = device.wrenches(shoulder, elbow, hip)
    second = device.wrenches(shoulder @ turn.T, elbow @ turn.T, hip @ turn.T, up=turn[:, 2])
    np.testing.assert_allclose(second.arm_force_n, first.arm_force_n @ turn.T, atol=1e-12)
    np.testing.assert_allclose(second.hip_moment_nm, first.hip_moment_nm @ turn.T, atol=1e-12)


def test_an_upright_arm_and_a_missing_one():
    shoulder = np.zeros((3, 2, 3))
    elbow = shoulder + np.array([0, 0, -0.3])
    elbow[1, 0] = [0, 0, 0.3]
    elbow[2, 1] = np.nan
    curve = ForceCurve.parametric(peak_n=30, peak_rad=np.pi)
    pair = PassiveDevice(curve).wrenches(shoulder, elbow, np.zeros((3, 3)))
    assert (pair.arm_force_n[:2] == 0).all()
    assert pair.outside.tolist() == [[False, False], [True, False], [False, False]]
    assert np.isnan(pair.arm_force_n[2, 1]).all() and np.isnan(pair.hip_force_n[2]).all()
    assert not np.isnan(pair.arm_force_n[2, 0]).any()


def test_shapes_and_values_that_cannot_be_are_refused():
    shoulder, elbow, hip = pose(4)
    device = PassiveDevice(ForceCurve.parametric(peak_n=30))
    with pytest.raises(ulna.ArgumentError, match=r"elbow_m has the shape \(3, 2, 3\)"):
        device.wrenches(shoulder, elbow[:3], hip)
    with pytest.raises(ulna.ArgumentError, match=r"\(\.\.\., 3\)"):
        device.wrenches(shoulder[..., :2], elbow, hip)
    with pytest.raises(ulna.DataError, match="elbow lies in its shoulder"):
        device.wrenches(shoulder, shoulder, hip)
    with pytest.raises(ulna.DataError, match="no length"):
        device.wrenches(shoulder, elbow, hip, up=(0, 0, 0))
    with pytest.raises(ulna.ArgumentError, match=r"up has the shape \(2,\)|\(\.\.\., 3\)"):
        device.wrenches(shoulder, elbow, hip, up=(0, 1))
    with pytest.raises(ulna.ArgumentError, match="does not go with"):
        elevation(elbow - shoulder, up=np.ones((5, 3)))
    with pytest.raises(ulna.ArgumentError, match="left arm must have angles that increase"):
        wrong = ForceCurve(np.array([0.5, 0.4]), *([np.ones(2)] * 4))
        PassiveDevice(wrong).wrenches(shoulder, elbow, hip)
    with pytest.raises(ulna.ArgumentError, match="attachment"):
        PassiveDevice(device.curve, attachment=1.2)
    with pytest.raises(ulna.ArgumentError, match="mass_kg"):
        PassiveDevice(device.curve, mass_kg=-1)
    with pytest.raises(ulna.ArgumentError, match="left and one for the right"):
        PassiveDevice((device.curve,)).wrenches(shoulder, elbow, hip)
    with pytest.raises(ulna.ArgumentError, match="side"):
        elevation_of_joints([0, 0, 0], side="both")


def test_the_interface_refuses_other_shapes():
    curve = np.array([[0.5, 10.0, 0.0], [1.0, 20.0, 0.0]])
    count = ffi.new("int64_t *")
    for fields, poses, words in (
        ({"left": curve}, np.zeros((3, 14)), "15 columns"),
        ({"left": curve}, np.zeros((3, 15)), "left elbow lies in its shoulder at row 0"),
        ({"left": curve[:, :2]}, np.ones((3, 15)), "left has 2 columns"),
        ({"left": curve[:1]}, np.ones((3, 15)), "at least 2 angles"),
        ({"left": curve * np.nan}, np.ones((3, 15)), "left"),
        ({}, np.ones((3, 15)), "left"),
        ({"left": curve, "along_arm": 2}, np.ones((3, 15)), "along_arm"),
        ({"left": curve, "up": [np.inf, 0, 0]}, np.ones((3, 15)), "up"),
    ):
        device = options("ulna_arm_support", **fields)
        out = np.full(66, 7.0)
        pointer = ffi.cast("double *", out.ctypes.data)
        with pytest.raises(ulna.Error, match=words):
            check(lib.ulna_arm_support_wrenches(device, view(poses), pointer, out.size, count))
        assert (out == 7).all()


# The published study --------------------------------------------------------------------------------


@needs_paexo
def test_the_published_tables_peak_beyond_the_horizontal():
    table = read_force_table(PAEXO)
    assert len(table.subjects) == 12
    for subject in table.subjects:
        peak = np.degrees(table.of(subject).angle_rad[np.argmax(table.of(subject).support_n)])
        assert 103 <= peak <= 106
    assert table.mean.support(np.pi / 2) == pytest.approx(33.9073, abs=1e-4)
    scales = [table.scale_of(subject) for subject in table.subjects]
    assert np.mean(scales) == pytest.approx(1, abs=0.01) and 0.9 < min(scales) < max(scales) < 1.15
    mean = table.mean
    # Four parameters follow the measured mean to 1 % of its peak (0.31 N when this was written).
    assert np.abs(table.fit().support(mean.angle_rad) - mean.support_n).max() < 0.36


@needs_paexo
def test_the_published_hip_force_is_the_reaction_to_the_arm():
    """The table's hip force is the arm's, shear along and support across it, seen in the laboratory."""
    for curve in read_force_table(PAEXO).curves.values():
        loaded = np.hypot(curve.support_n, curve.shear_n) > 5
        c, s = np.cos(curve.angle_rad), np.sin(curve.angle_rad)
        forward = curve.shear_n * s + curve.support_n * c
        upward = -curve.shear_n * c + curve.support_n * s
        # The tables are printed with three digits.
        np.testing.assert_allclose(curve.hip_x_n[loaded], forward[loaded], atol=2e-3)
        np.testing.assert_allclose(-curve.hip_y_n[loaded], upward[loaded], atol=2e-3)


def drilling_pose():
    """Upper arms forward and level, forearms up, drill in the hand: 72.7 kg, 179.3 cm."""
    height, mass = 1.793, 72.7
    upper = 0.186 * height
    shoulder = np.array([[[0.0, 0.2, 1.45], [0.0, -0.2, 1.45]]])
    elbow = shoulder + [upper, 0, 0]
    loads = [(0.030 * mass, upper / 2), (0.020 * mass, upper), (0.006 * mass, upper), (0.66, upper)]
    gravity = 9.81 * sum(load * lever for load, lever in loads)
    return shoulder, elbow, gravity


@needs_paexo
def test_drilling_overhead_relieves_the_shoulder():
    shoulder, elbow, gravity = drilling_pose()
    device = PassiveDevice(read_force_table(PAEXO).mean)
    pair = device.wrenches(shoulder, elbow, [[0.0, 0.0, 1.0]])
    moment = -pair.arm_wrench(shoulder)[0, 1, 4]  # about y: lifting is negative
    assert moment == pytest.approx(33.9073 * 0.6895 * 0.186 * 1.793, rel=1e-4)
    assert 0.60 < moment / gravity < 0.70
    assert pair.net_force_n[0] == pytest.approx([0, 0, -1.8 * 9.81], abs=1e-9)
    assert pair.net_moment_nm[0] == pytest.approx([0, 0, 0], abs=1e-9)


@needs_paexo
def test_the_published_mapping_does_not_relieve_the_flexed_arm():
    shoulder, elbow, gravity = drilling_pose()
    arms = np.tile(np.eye(3), (1, 2, 1, 1))
    # Rolled so that the elbow's flexion (about z) lifts the forearm: x of the arm points up, y backward
    # and z, along which the mapping pushes, to the right.
    arms[0, 1] = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
    assert arms[0, 1] @ [0, -1, 0] == pytest.approx([1, 0, 0])  # forward
    assert arms[0, 1] @ [1, 0, 0] == pytest.approx([0, 0, 1])  # the flexed forearm points up
    pair = published_wrenches(
        read_force_table(PAEXO).mean,
        shoulder,
        elbow,
        [[0.0, 0.0, 1.0]],
        arm_rotation=arms,
        pelvis_rotation=np.eye(3)[None],
        elevation_rad=[[np.pi / 2, np.pi / 2]],
        pelvis_width_m=0.3,
    )
    relief = -pair.arm_wrench(shoulder)[0, 1, 4]
    assert abs(relief) < 1e-9 * gravity
    # And it is not in balance: the arm is pushed sideways, the hip is not.
    assert np.linalg.norm(pair.net_force_n) > 10


def test_the_published_mapping_is_nearly_in_balance_with_the_arms_to_the_sides():
    curve = read_force_table(
        Path(__file__).resolve().parents[2] / "examples/data/arm-support.csv"
    ).of(1)
    shoulder = np.array([[[0.0, 0.2, 1.4], [0.0, -0.2, 1.4]]])
    elbow = shoulder + np.array([[0, 0.33, 0], [0, -0.33, 0]])
    pair = published_wrenches(
        curve,
        shoulder,
        elbow,
        [[0.0, 0.0, 1.0]],
        arm_rotation=np.tile(np.eye(3), (1, 2, 1, 1)),
        pelvis_rotation=np.eye(3)[None],
        elevation_rad=[[np.pi / 2, np.pi / 2]],
        pelvis_width_m=0.3,
    )
    np.testing.assert_allclose(pair.net_force_n, 0, atol=2e-3)  # the table has three digits
    with pytest.raises(ulna.ArgumentError, match="arm_rotation has the shape"):
        published_wrenches(
            curve,
            shoulder,
            elbow,
            [[0, 0, 1.0]],
            arm_rotation=np.eye(3),
            pelvis_rotation=np.eye(3)[None],
            elevation_rad=[[1.0, 1.0]],
            pelvis_width_m=0.3,
        )
