"""Effort from torques: by hand, invariant to axes, and the published numbers beside it."""

import csv
from pathlib import Path

import numpy as np
import pytest

import ulna
from ulna.effort import (
    AREAS,
    area_of,
    effort,
    published_mean_torque,
    published_normalised_norm,
    published_reduction,
    working_frames,
)

JOINTS = Path(__file__).resolve().parents[3] / "shared" / "data" / "wholebody" / "joints_48.csv"
NAMES = ["jL5S1_rotx", "jRightShoulder_rotx", "jRightElbow_roty", "jLeftKnee_roty"]


def torques(frames=300, seed=0):
    return np.random.default_rng(seed).normal([1, -5, 2, 10], 1.0, size=(frames, 4))


def test_effort_by_hand():
    table = np.array([[3.0, -4.0, 0.0, 12.0], [-3.0, 4.0, 0.0, -12.0]])
    found = effort(table, joints=NAMES, body_mass_kg=65)
    assert found.mean_abs_nm.tolist() == [3, 4, 0, 12]
    assert found.rms_nm.tolist() == [3, 4, 0, 12]
    assert found.norm_nm == 13 and found.norm_nm_kg == 0.2
    assert found.total_mean_abs_nm == 19 / 4
    assert found.total_rms_nm == pytest.approx(6.5)
    assert found.area_norm_nm == {"torso": 3, "right arm": 4, "left leg": 12}
    assert "norm 13 Nm" in found.summary() and "13 Nm" in repr(found)


def test_effort_does_not_know_how_axes_are_signed():
    table = torques()
    first = effort(table, joints=NAMES)
    second = effort(table * [1, -1, -1, 1], joints=NAMES)
    np.testing.assert_array_equal(first.mean_abs_nm, second.mean_abs_nm)
    assert first.norm_nm == second.norm_nm
    # The published mean does.
    assert published_mean_torque([table]) != pytest.approx(
        published_mean_torque([table * [1, -1, -1, 1]])
    )


def test_frames_without_a_torque_are_left_out_and_counted():
    table = torques()
    table[10:20, 2] = np.nan
    found = effort(table)
    assert (found.frames, found.missing) == (290, 10)
    kept = np.delete(table, np.arange(10, 20), axis=0)
    np.testing.assert_allclose(found.rms_nm, np.sqrt(np.mean(kept**2, axis=0)))
    working = np.zeros(300, dtype=bool)
    working[15:100] = True
    assert (effort(table, working=working).frames, effort(table, working=working).missing) == (
        80,
        5,
    )


def test_pauses_are_no_work_but_movements_are():
    rate = 60.0
    t = np.arange(0, 60, 1 / rate)
    angle = np.radians(np.where(t < 25, 20.0, 90.0))  # 25 s with the arm down, then work
    angle[(t > 40) & (t < 42)] = np.radians(30.0)  # fetching something
    angle[(t > 50) & (t < 51)] = np.nan
    working = working_frames(angle, rate_hz=rate)
    assert working.sum() == pytest.approx(35 * rate, abs=1)
    assert not working[: int(24 * rate)].any() and working[int(26 * rate) :].all()
    angle[:10] = np.nan  # before anything is known
    assert not working_frames(angle, rate_hz=rate)[:10].any()
    assert not working_frames(np.zeros(1000), rate_hz=rate).any()


@pytest.mark.skipif(not JOINTS.is_file(), reason="the joint table of the published model is absent")
def test_every_joint_of_the_model_has_an_area():
    with JOINTS.open(encoding="utf-8") as file:
        names = [row["joint"] for row in csv.DictReader(file)]
    counts = {area: sum(area_of(name) == area for name in names) for area in AREAS}
    assert counts == {"torso": 14, "left arm": 8, "right arm": 8, "left leg": 9, "right leg": 9}


def test_the_published_reduction_cannot_tell_less_from_more():
    table = torques()
    less, more = [0.5 * table], [1.5 * table]
    assert published_reduction([table], less) == pytest.approx(published_reduction([table], more))
    assert published_reduction([table, table], less * 2) == pytest.approx(0.5)


def test_every_subject_counts_alike_in_the_published_mean():
    assert published_mean_torque([np.ones((1000, 2)), 3 * np.ones((1, 2))]) == 2


def test_scaling_by_extremes_keeps_missing_values():
    scaled = published_normalised_norm([[2.0, np.nan], [4.0, 3.0]])
    np.testing.assert_array_equal(scaled, [[0, np.nan], [1, 0.5]])


def test_what_cannot_be_is_refused():
    table = torques()
    for call, words in (
        (lambda: effort(table[0]), "shape"),
        (lambda: effort(table[:0]), "shape"),
        (lambda: effort(table, joints=NAMES[:2]), "2 names for 4"),
        (lambda: effort(table, areas=["a"]), "1 entries for 4"),
        (lambda: effort(table, joints=["jRightWing_rotx", *NAMES[1:]]), "no arm or leg"),
        (lambda: effort(table, working=np.ones(3, dtype=bool)), "one a frame"),
        (lambda: effort(table, working=np.ones(300)), "truth values"),
        (lambda: effort(table, body_mass_kg=0), "positive"),
        (lambda: effort(table).norm_nm_kg, "body_mass_kg"),
        (lambda: effort(table * np.nan), "no frame"),
        (lambda: effort(np.where(table > 12, np.inf, table)), "infinite"),
        (lambda: working_frames(table, rate_hz=60), "shape"),
        (lambda: working_frames(table[:, 0], rate_hz=0), "rate_hz"),
        (lambda: working_frames(table[:, 0], rate_hz=60, shortest_rest_s=-1), "shortest_rest_s"),
        (lambda: working_frames([np.nan], rate_hz=60), "missing"),
        (lambda: published_mean_torque([]), "at least one"),
        (lambda: published_reduction([table * 0], [table]), "zero"),
        (lambda: published_normalised_norm([1.0, 1.0]), "differ"),
    ):
        with pytest.raises(ulna.Error, match=words):
            call()
