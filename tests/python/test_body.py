"""Whole bodies: the human model, files, dynamics of a motion, and what is refused."""

import copy
import csv
import json
import pickle
from pathlib import Path

import numpy as np
import pytest

import ulna
from ulna.body import (
    Link,
    Motion,
    body_from_links,
    body_from_text,
    human_body,
    human_names,
    read_body,
)

SHARED = Path(__file__).resolve().parents[3] / "shared" / "data" / "wholebody"


def person(**changes):
    return human_body(**{"height_m": 1.793, "mass_kg": 72.7, **changes})


def moving(body, frames=5, seed=0):
    rng = np.random.default_rng(seed)
    n = len(body.joints)
    quaternion = rng.normal(size=(frames, 4))
    return Motion(
        angle=0.4 * rng.normal(size=(frames, n)),
        rate=rng.normal(size=(frames, n)),
        acceleration=3.0 * rng.normal(size=(frames, n)),
        position_m=rng.normal(size=(frames, 3)),
        orientation=quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True),
        velocity_m_s=rng.normal(size=(frames, 3)),
        angular_velocity_rad_s=rng.normal(size=(frames, 3)),
        base_acceleration=rng.normal(size=(frames, 6)) + [0, 0, 9.81, 0, 0, 0],
    )


def test_the_human_model_has_the_joints_of_the_table():
    path = SHARED / "joints_48.csv"
    if not path.is_file():
        pytest.skip(f"{path} is not there")
    body = person()
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["joint"] for row in rows] == list(body.joints)
    for row, link in zip(rows, body.describe()[1:], strict=True):
        assert (link.joint, link.parent, link.name) == (row["joint"], row["parent"], row["child"])
        assert np.degrees(link.lower_rad) == pytest.approx(float(row["lower_deg"]))
        assert np.degrees(link.upper_rad) == pytest.approx(float(row["upper_deg"]))


@pytest.mark.parametrize(("spherical", "links"), [(False, 49), (True, 67)])
def test_the_human_model_has_mass_and_size(spherical, links):
    body = person(spherical=spherical)
    assert len(body.links) == links and len(body.joints) == links - 1
    assert body.mass_kg == pytest.approx(72.7, abs=1e-9)
    assert person(spherical=spherical, published_masses=True).mass_kg == pytest.approx(72.7)
    massive = [link for link in body.describe() if link.mass_kg > 0.0]
    assert len(massive) == 23
    assert {link.shape for link in massive} == {"box", "cylinder", "sphere"}


def test_measured_lengths_and_points_are_used():
    body = person(lengths_m={"thigh": 0.5})
    knee = next(link for link in body.describe() if link.joint == "jRightKnee_roty")
    assert knee.position_m[2] == pytest.approx(-0.5)
    points = {"jRightHip": (0, -0.1, 1), "jLeftHip": (0, 0.1, 1), "jLeftKnee": (0, 0.1, 0.55)}
    knee = next(
        link for link in person(points_m=points).describe() if link.joint == "jLeftKnee_roty"
    )
    assert knee.position_m == pytest.approx([0, 0, -0.45])
    assert len(human_names("points")) == 29 and len(human_names("suit")) == 17


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"height_m": 179.3}, "height is 179.3"),
        ({"mass_kg": float("nan")}, "mass"),
        ({"lengths_m": {"arm": 0.3}}, "no segment 'arm'"),
        ({"points_m": {"jRightKnee": (0, 0, 0)}}, "both hips"),
        ({"points_m": {"jRightHip": (0, 0)}}, "point_positions"),
        ({"density_kg_m3": -1.0}, "density"),
    ],
)
def test_what_nobody_has_is_refused(changes, words):
    with pytest.raises(ulna.ArgumentError, match=words):
        person(**changes)


def test_files_give_the_body_back(tmp_path):
    body = person()
    motion = moving(body)
    torque, missing = body.inverse_dynamics(motion)
    for format in ("urdf", "mjcf"):
        path = tmp_path / f"body.{format}"
        path.write_text(body.to_text(format=format, name="a body"))
        for again in (read_body(path), body_from_text(path.read_text())):
            assert again.joints == body.joints
            back, lacking = again.inverse_dynamics(motion)
            assert back == pytest.approx(torque, abs=1e-8)
            assert lacking == pytest.approx(missing, abs=1e-8)
    assert "freejoint" not in body.to_text(format="mjcf", fixed_base=True)
    with pytest.raises(ulna.ArgumentError, match="'sdf'"):
        body.to_text(format="sdf")
    with pytest.raises(ulna.FileError):
        read_body(tmp_path / "nothing.urdf")
    with pytest.raises(ulna.FileError):
        read_body(tmp_path / "nothing.json")
    with pytest.raises(ulna.FormatError, match="neither URDF"):
        body_from_text("<html/>")
    (tmp_path / "half.json").write_text('{"links": [{"name": "foot"}]}')
    with pytest.raises(ulna.FormatError, match="link 0"):
        read_body(tmp_path / "half.json")
    (tmp_path / "half.json").write_text("{")
    with pytest.raises(ulna.FormatError, match="no JSON"):
        read_body(tmp_path / "half.json")


def test_a_body_is_made_from_its_links_and_pickled():
    body = (
        person(spherical=True)
        .rebased("LeftHand")
        .attach(
            "drill",
            link="RightHand",
            mass_kg=0.66,
            centre_m=(0, -0.1, 0),
            inertia_kg_m2=1e-3 * np.eye(3),
        )
    )
    motion = moving(body)
    torque, _ = body.inverse_dynamics(motion)
    for again in (
        body_from_links(body.describe()),
        pickle.loads(pickle.dumps(body)),
        copy.deepcopy(body),
    ):
        assert again.links == body.links
        assert again.inverse_dynamics(motion)[0] == pytest.approx(torque, abs=1e-12)


def test_links_that_make_no_body_are_refused():
    ball = {"mass_kg": 1.0, "inertia_kg_m2": np.eye(3)}
    with pytest.raises(ulna.ArgumentError, match="'trunk', which is not there"):
        body_from_links([Link("arm", parent="trunk", **ball)])
    with pytest.raises(ulna.ArgumentError, match="needs a link"):
        body_from_links([])
    with pytest.raises(ulna.ArgumentError, match="triangle"):
        body_from_links([Link("a", mass_kg=1.0, inertia_kg_m2=np.diag([1, 1, 9.0]))])
    body = person()
    with pytest.raises(ulna.ArgumentError, match="RightHand"):
        body.attach("drill", link="Hand", mass_kg=1.0, centre_m=(0, 0, 0))
    with pytest.raises(ulna.ArgumentError, match="positive mass"):
        body.attach("drill", link="RightHand", mass_kg=-1.0, centre_m=(0, 0, 0))
    with pytest.raises(ulna.ArgumentError, match="symmetric"):
        body.attach("d", link="RightHand", mass_kg=1, centre_m=(0, 0, 0), inertia_kg_m2=np.eye(2))
    with pytest.raises(ulna.ArgumentError, match="no link 'Elbow'"):
        body.rebased("Elbow")
    with pytest.raises(ulna.ArgumentError, match="made by"):
        ulna.body.Body(None)


def test_weight_momentum_and_sensors_of_a_motion():
    body = person()
    motion = moving(body)
    torque, missing = body.inverse_dynamics(motion)
    assert torque.shape == (5, 48)
    centroid = body.centroid(motion)
    # All that acts: what the base lacks, and the weight.
    weight = [0, 0, 72.7 * 9.81]
    assert missing[:, :3] - weight == pytest.approx(centroid.momentum_rate[:, :3], abs=1e-9)
    # Given back at the base, nothing lacks.
    external = np.zeros((5, 49, 6))
    w, x, y, z = np.asarray(motion.orientation).T
    r = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    external[:, 0, :3] = np.einsum("jif,fj->fi", r, missing[:, :3])
    external[:, 0, 3:] = np.einsum("jif,fj->fi", r, missing[:, 3:])
    assert body.inverse_dynamics(motion, external)[1] == pytest.approx(0.0, abs=1e-9)
    # An accelerometer at rest reads the weight's reaction, whatever the pose.
    still = Motion(motion.angle, orientation=motion.orientation)
    _, turning, proper, _ = body.sensor(still, link="LeftHand", point_m=(0.01, 0.02, 0.0))
    assert np.linalg.norm(proper, axis=1) == pytest.approx(9.81)
    assert turning == pytest.approx(0.0)
    # Mass matrix times acceleration: the difference that an acceleration makes.
    first = Motion(*(None if v is None else np.asarray(v)[:1] for v in vars(motion).values()))
    rest = Motion(first.angle, first.rate, None, first.position_m, first.orientation,
                  first.velocity_m_s, first.angular_velocity_rad_s, np.zeros((1, 6)))  # fmt: skip
    step = np.concatenate([first.base_acceleration[0], first.acceleration[0]])
    after, base_after = body.inverse_dynamics(first)
    before, base_before = body.inverse_dynamics(rest)
    change = np.concatenate([(base_after - base_before)[0], (after - before)[0]])
    assert body.mass_matrix(first) @ step == pytest.approx(change, abs=1e-9)
    jacobian = body.jacobian(first, link="Head")
    rates = np.concatenate([first.velocity_m_s[0], first.angular_velocity_rad_s[0], first.rate[0]])
    velocity = body.sensor(first, link="Head")[0][0]
    assert np.linalg.norm((jacobian @ rates)[:3]) == pytest.approx(np.linalg.norm(velocity))


def test_motions_of_the_wrong_size_are_refused():
    body = person()
    with pytest.raises(ulna.ArgumentError, match="frames x 48"):
        body.poses(Motion(np.zeros((2, 47))))
    with pytest.raises(ulna.ArgumentError, match="rate is 3 x 48"):
        body.poses(Motion(np.zeros((2, 48)), rate=np.zeros((3, 48))))
    with pytest.raises(ulna.DataError, match="frame 1"):
        body.poses(Motion(np.zeros((2, 48)), orientation=[[1, 0, 0, 0], [1, 1, 0, 0]]))
    with pytest.raises(ulna.DataError, match="angle holds NaN at row 0"):
        body.poses(Motion(np.full((2, 48), np.nan)))
    with pytest.raises(ulna.ArgumentError, match=r"\(frames, 49, 6\)"):
        body.inverse_dynamics(Motion(np.zeros((1, 48))), np.zeros((1, 48, 6)))
    with pytest.raises(ulna.ArgumentError, match="one row a frame"):
        body.inverse_dynamics(Motion(np.zeros((2, 48))), np.zeros((1, 49, 6)))
    with pytest.raises(ulna.ArgumentError, match="three"):
        body.sensor(Motion(np.zeros((1, 48))), link="Head", point_m=(0, 0))


def test_the_bowing_model_is_read():
    path = SHARED / "bowing-model.json"
    if not path.is_file():
        pytest.skip(f"{path} is not there")
    body = read_body(path)
    assert body.links == ("foot", "leg", "torso") and body.joints == ("ankle", "hip")
    assert body.mass_kg == pytest.approx(61.691, abs=5e-4)
    rows = np.genfromtxt(SHARED / "bowing.csv", delimiter=",", skip_header=1)
    external = np.zeros((len(rows), 3, 6))
    external[:, 0] = rows[:, 10:]
    torque, missing = body.inverse_dynamics(
        Motion(rows[:, 1:3], rows[:, 3:5], rows[:, 5:7]), external
    )
    # The table of the recording, to 0.05 N m and 0.05 N.
    assert [torque[:, 0].min(), torque[:, 0].max()] == pytest.approx([-63.9, -15.5], abs=0.05)
    assert [torque[:, 1].min(), torque[:, 1].max()] == pytest.approx([-72.5, -0.2], abs=0.05)
    table = [5.77, 2.55, 1.61, 6.43, 8.20, 0.86]
    assert np.sqrt((missing**2).mean(axis=0)) == pytest.approx(table, abs=0.05)
    assert json.loads(path.read_text())["links"][1]["mass"] == body.describe()[1].mass_kg
