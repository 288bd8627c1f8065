"""Captures in the formats of suits, models and plates: MVNX, OpenSim's tables, C3D."""

from __future__ import annotations

import numpy as np
import pytest
from simulated_capture import FEET, WRENCH, simulated_capture

import ulna
from ulna._capture_channels import load
from ulna.body import Link, Motion, body_from_links, human_body
from ulna.capture import BodySetup, Contact, read_setup, recorded_torques
from ulna.motion import rotation_matrices

UP = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # OpenSim's axes (y up) of the world's (z up)


def as_mvnx(record, path):
    """The suit's record as a file: segments with their orientations, and positions of the pelvis."""
    segments = [c.name.removesuffix("_qw") for c in record.channels if c.name.endswith("_qw")]
    sensors = sorted({c.name.partition("_sensor_acc")[0] for c in record.channels
                      if "_sensor_acceleration" in c.name})  # fmt: skip

    def table(names):
        return np.stack([record[name] for name in names], axis=1)

    signals = {
        "orientation": table([f"{s}_q{k}" for s in segments for k in "wxyz"]),
        "position": np.hstack([
            table([f"Pelvis_position_{a}" for a in "xyz"])
            if s == "Pelvis" else np.zeros((len(record), 3)) for s in segments]),
        "sensorAcceleration": table([f"{s}_sensor_acceleration_{a}" for s in sensors for a in "xyz"]),
        "sensorAngularVelocity": table(
            [f"{s}_sensor_angular_velocity_{a}" for s in sensors for a in "xyz"]),
    }  # fmt: skip
    labels = "".join(f'<segment label="{s}"/>' for s in segments)
    worn = "".join(f'<sensor label="{s}"/>' for s in sensors)
    frames = []
    for row in range(len(record)):
        items = "".join(
            f"<{name}>{' '.join(f'{v:.9g}' for v in values[row])}</{name}>"
            for name, values in signals.items()
        )
        stamp = round(1000 * row / 60)
        frames.append(f'<frame time="{stamp}" index="{row}" type="normal">{items}</frame>')
    path.write_text(
        f'<mvnx version="4"><subject frameRate="60"><segments>{labels}</segments>'
        f'<sensors>{worn}</sensors><frames>{"".join(frames)}</frames></subject></mvnx>'
    )
    return path


def as_mot(path, time, names, values, *, title="Coordinates", degrees="yes"):
    rows = "\n".join("\t".join(f"{v:.9g}" for v in row) for row in np.column_stack([time, values]))
    path.write_text(
        f"{title}\nversion=1\nnRows={len(time)}\nnColumns={1 + len(names)}\ninDegrees={degrees}\n"
        "endheader\n" + "\t".join(["time", *names]) + "\n" + rows + "\n"
    )
    return path


def test_a_suit_and_shoes_from_files_are_those_from_records(tmp_path):
    made = simulated_capture(seconds=6.0, angles=False)
    suit = as_mvnx(made.suit, tmp_path / "suit.mvnx")
    made.shoes.to_csv(tmp_path / "shoes.csv")
    given = {"clocks": "shared", "variances": "given", "checks": False}
    one = recorded_torques([suit, tmp_path / "shoes.csv"], made.body, **given)
    two = recorded_torques([made.suit, made.shoes], made.body, **given)
    assert one.frames.sources == ("suit.mvnx", "shoes.csv")
    # Nine digits in the file.
    np.testing.assert_allclose(one.torques.torque, two.torques.torque, atol=1e-3)


def leg():
    """A foot that stands and a leg of 70 kg together."""
    return body_from_links([
        Link("foot", mass_kg=3.0, inertia_kg_m2=0.02 * np.eye(3)),
        Link("leg", parent="foot", joint="hip_flexion", axis=[0, 1, 0], centre_m=[0, 0, 0.6],
             mass_kg=67.0, inertia_kg_m2=2.0 * np.eye(3), position_m=[0, 0, 0.1]),
    ])  # fmt: skip


def test_tables_of_opensim_are_turned_to_z_up(tmp_path):
    body = leg()
    t = np.arange(300) / 100
    angle = 0.1 * np.sin(2 * t)
    truth = Motion(angle[:, None], 0.2 * np.cos(2 * t)[:, None], -0.4 * np.sin(2 * t)[:, None])
    torque, ground = body.inverse_dynamics(truth)
    # As a force at its centre of pressure with a free moment about the vertical.
    place = np.stack([-ground[:, 4] / ground[:, 2], ground[:, 3] / ground[:, 2], 0 * t], axis=1)
    free = ground[:, 3:] - np.cross(place, ground[:, :3])
    assert np.abs(free[:, :2]).max() < 1e-9
    motion = as_mot(tmp_path / "walk.mot", t, ["/jointset/hip/hip_flexion/value"],
                    np.degrees(angle)[:, None])  # fmt: skip
    names = [f"ground_{w}{a}" for w in ("force_v", "force_p", "torque_") for a in "xyz"]
    forces = as_mot(
        tmp_path / "forces.mot", t, names,
        np.hstack([ground[:, :3] @ UP.T, place @ UP.T, free @ UP.T]), title="ground reactions",
        degrees="no",
    )  # fmt: skip
    setup = BodySetup(body, contacts=[Contact("plate1", "foot", frame="world")])
    found = recorded_torques([motion, forces], setup, clocks="shared", variances="given")
    np.testing.assert_allclose(found.torques.torque[:, 0], torque[12:-12, 0], atol=0.05)
    assert np.sqrt(np.mean(found.balance**2, axis=0)).max() < 0.05
    assert found.start.carried_kg == pytest.approx(70.0, abs=0.01)
    with pytest.raises(ulna.ArgumentError, match="plate1: say which link"):
        recorded_torques([motion, forces], body, clocks="shared")


def test_a_pelvis_of_opensim_is_turned_to_z_up(tmp_path):
    rotation = pytest.importorskip("scipy.spatial.transform").Rotation
    t = np.arange(40) / 100
    tilt, lean, turn = 0.3 * np.sin(t), 0.2 * np.cos(t), 0.5 + 0.1 * t
    place = np.stack([t, 0.9 + 0 * t, 0.1 * t], axis=1)
    path = as_mot(
        tmp_path / "gait.mot", t,
        ["pelvis_tilt", "pelvis_list", "pelvis_rotation", "pelvis_tx", "pelvis_ty", "pelvis_tz"],
        np.column_stack([np.degrees(tilt), np.degrees(lean), np.degrees(turn), place]),
    )  # fmt: skip
    item = load(path)[0]
    found = rotation_matrices(item.values[:, item.quaternion("Pelvis")])
    # Intrinsic z, x, y, as the axes of the ground-pelvis joint are listed.
    own = rotation.from_euler("ZXY", np.column_stack([tilt, lean, turn])).as_matrix()
    np.testing.assert_allclose(found, UP.T @ own @ UP, atol=1e-7)
    columns = item.three(["Pelvis"], ["position"], "m")
    np.testing.assert_allclose(item.values[:, columns], place @ UP, atol=1e-7)


def test_a_plate_of_a_c3d_file_carries_the_person(tmp_path):
    from test_read_motion import c3d

    body = leg()
    path, *_ = c3d(tmp_path, frames=60)
    t = np.arange(60) / 100
    rng = np.random.default_rng(0)
    motion = ulna.Record.from_arrays(
        t, {"hip_flexion": 0.02 * np.sin(3 * t) + 1e-4 * rng.normal(size=60)},
        units={"hip_flexion": "rad"},
    )  # fmt: skip
    setup = BodySetup(body, contacts=[Contact("plate1", "foot", frame="world")])
    found = recorded_torques([motion, path], setup, clocks="shared", variances="given")
    # The file's plate carries about 700 N and its sine.
    row = found.frames.suite.row("plate1")
    expected = np.asarray(ulna.read(path, part="analog")["plate1_F_z"])
    times = found.time_s
    np.testing.assert_allclose(
        found.frames.measured[:, row + 2],
        np.interp(times, np.arange(len(expected)) / 1000, expected), rtol=0.01,
    )  # fmt: skip


def test_shoes_with_the_other_sign_are_turned(tmp_path):
    made = simulated_capture(seconds=6.0)
    turned = ulna.Record.from_arrays(
        np.array(made.shoes.time), {f"{f}_{w}": -made.shoes[f"{f}_{w}"] for f in FEET for w in WRENCH}
    )
    setup = BodySetup(made.body, contacts=[Contact(f, f, sign=-1) for f in FEET], imus=())
    found = recorded_torques([made.suit, turned], setup, clocks="shared", variances="given")
    assert found.start.carried_kg == pytest.approx(72.7, abs=0.1)
    wrong = BodySetup(made.body, contacts=[Contact(f, f) for f in FEET], imus=())
    told = recorded_torques([made.suit, turned], wrong, clocks="shared", variances="given")
    assert [f.channel for f in told.findings if f.code == "upside_down"] == list(FEET)


def test_points_of_a_suit_give_the_lengths_of_the_body(tmp_path):
    """A body of odd proportions, told as a suit's file tells it, comes back."""
    long_arms = human_body(height_m=1.8, mass_kg=75, lengths_m={"upper_arm": 0.36, "shank": 0.40})
    places = dict(zip(long_arms.links, long_arms.poses(Motion(np.zeros((1, 48))))[0, :, :3],
                      strict=True))  # fmt: skip
    segments = [name for name in long_arms.links if "_f" not in name]
    links = {link.name: link for link in long_arms.describe()}
    points = {name: [] for name in segments}
    joints = []
    for name in segments[1:]:
        parent = links[name].parent
        while parent not in segments:
            parent = links[parent].parent
        hinge = links[name]
        while hinge.joint is None:
            hinge = links[hinge.parent]
        joint = hinge.joint.rpartition("_rot")[0]
        points[parent].append((joint, places[name] - places[parent]))
        points[name].append((joint, np.zeros(3)))
        joints.append((joint, f"{parent}/{joint}", f"{name}/{joint}"))
    text = "".join(
        f'<segment label="{name}"><points>'
        + "".join(f'<point label="{p}"><pos_b>{x[0]} {x[1]} {x[2]}</pos_b></point>' for p, x in own)
        + "</points></segment>"
        for name, own in points.items()
    )
    told = "".join(f'<joint label="{j}"><connector1>{a}</connector1><connector2>{b}</connector2></joint>'
                   for j, a, b in joints)  # fmt: skip
    (tmp_path / "suit.mvnx").write_text(
        f'<mvnx><subject frameRate="60"><segments>{text}</segments><joints>{told}</joints>'
        "<frames></frames></subject></mvnx>"
    )
    person = tmp_path / "person.toml"
    person.write_text('[body]\nheight_m = 1.8\nmass_kg = 75\nsuit = "suit.mvnx"\n')
    body = read_setup(person).body
    arm = body.links.index("RightForeArm")
    origin = body.poses(Motion(np.zeros((1, 48))))[0, :, :3]
    for name in ("RightForeArm", "LeftHand", "RightFoot", "Head"):
        k = body.links.index(name)
        np.testing.assert_allclose(origin[k], places[name], atol=1e-9)
    upper = body.links.index("RightUpperArm")
    assert np.linalg.norm(origin[arm] - origin[upper]) == pytest.approx(0.36)
    (tmp_path / "suit.mvnx").write_text(
        (tmp_path / "suit.mvnx").read_text().replace("Pelvis/jL5S1", "Pelvis/nothing")
    )
    with pytest.raises(ulna.FormatError, match="where the joint jL5S1 lies"):
        read_setup(person)
