"""The overhead study: people, movements and truth as they should be, the pipeline against the truth."""

import csv
import json
import re
from dataclasses import fields, replace

import numpy as np
import pytest

import ulna
from ulna import overhead
from ulna._overhead_session import Setting, run_session
from ulna._overhead_task import BASE, DRILL_TIP_M, task_of, worker_body
from ulna.body import Motion
from ulna.capture import recorded_torques
from ulna.cli import main
from ulna.effort import published_reduction
from ulna.overhead import (
    MEASURES,
    OverheadStudy,
    Protocol,
    SensorErrors,
    cohort,
    overhead_study,
    session_setup,
    simulate_session,
)
from ulna.stats import repeated_anova

SHORT = Protocol(blocks=2, repetitions=1, hold_s=1.2, rest_s=8.0, still_s=1.0, cycle_s=3.4)
# One block of eight movements: enough where nothing is averaged.
TINY = replace(SHORT, blocks=1)
EXACT = SensorErrors(**{f.name: 0.0 for f in fields(SensorErrors) if f.name != "shoe_rate_hz"})


@pytest.fixture(scope="module")
def study():
    return overhead_study(subjects=3, protocol=SHORT, seed=2)


# People and movements -----------------------------------------------------------------------------


def test_people_have_the_published_moments_and_half_begin_with_the_device():
    people = cohort()
    height, mass = (
        np.array([getattr(p, name) for p in people]) for name in ("height_m", "mass_kg")
    )
    assert height.mean() == pytest.approx(1.793) and height.std(ddof=1) == pytest.approx(0.059)
    assert mass.mean() == pytest.approx(72.7) and mass.std(ddof=1) == pytest.approx(5.4)
    assert sum(person.device_first for person in people) == 6
    assert people == cohort() != cohort(seed=1)


def test_a_session_is_as_long_as_the_published_one():
    full = Protocol()
    assert full.blocks == 5 and 8 * full.repetitions == 24
    assert 11 < full.duration_s / 60 < 12.5
    assert 24 * len(full.time_s) == pytest.approx(1e6, rel=0.01)
    block = full.block_of(np.array([0.0, 9.9, 10.0, 125.1, 125.3, 150.3, 685.9, 690.0]))
    # The rest after the first block belongs to the second.
    assert block.tolist() == [-1, -1, 0, 0, 1, 1, 4, -1]


def test_derivatives_of_the_movement_are_its_derivatives():
    task = task_of(cohort()[0], SHORT, seed=1)
    time = np.arange(3.0, 12.0, 1e-3)
    motion = task.motion(time)
    for value, slope in ((motion.angle, motion.rate), (motion.rate, motion.acceleration)):
        numeric = np.gradient(value, time, axis=0)
        # Central differences of 1 ms; the jerk of minimum jerk jumps at ends, by half a step there.
        assert np.abs(numeric - slope)[2:-2].max() < 0.03


def test_the_drill_reaches_four_places_around_the_target_and_rests_there_for_the_hold():
    subject = replace(cohort()[0], height_m=1.8)
    protocol = replace(SHORT, cycle_s=4.8, hold_s=2.0)
    task = task_of(subject, protocol, seed=3)
    # Without sway and differences between repetitions.
    still = replace(task, wave_rad=0 * task.wave_rad)
    body = worker_body(subject)
    starts = protocol.starts_s[0] + 4.8 * np.arange(8)
    hand = body.links.index("RightHand")

    def tip(time):
        pose = body.poses(still.motion(time))[:, hand]
        turn = ulna.motion.rotation_matrices(pose[:, 3:])
        return pose[:, :3] + turn @ np.asarray(DRILL_TIP_M)

    target, away = tip(starts + 4.7), tip(starts + 1.2)
    apart = away - target.mean(axis=0)
    # Differences between repetitions are 0.7 degrees at each of six joints, half a metre of arm.
    assert np.abs(np.linalg.norm(apart[:, :2], axis=1) - 0.3).max() < 0.06
    assert np.abs(apart[:, 2]).max() < 0.06
    quadrants = {tuple(np.sign(row[:2]).astype(int)) for row in apart}
    assert len(quadrants) == 4
    speed = np.linalg.norm(np.diff(tip(starts[0] + np.arange(2.85, 4.75, 0.01)), axis=0), axis=1)
    assert speed.max() < 1e-9


def test_feet_stand_while_the_body_sways():
    subject = cohort()[1]
    made = simulate_session(subject, with_device=False, protocol=TINY, errors=EXACT)
    angle = np.stack([made.suit[name] for name in made.body.joints], axis=1)
    quaternion = np.stack([made.suit[f"Pelvis_q{part}"] for part in "wxyz"], axis=1)
    place = np.stack([made.suit[f"Pelvis_position_{axis}"] for axis in "xyz"], axis=1)
    poses = made.body.poses(Motion(angle, position_m=place, orientation=quaternion))
    for foot in ("RightFoot", "LeftFoot"):
        at = poses[:, made.body.links.index(foot), :3]
        assert np.ptp(at, axis=0).max() < (1e-9 if foot == BASE else 2e-3)
    head = poses[:, made.body.links.index("Head"), :3]
    assert np.ptp(head, axis=0).max() > 0.01


# Truth --------------------------------------------------------------------------------------------


def test_true_torques_of_the_arms_follow_from_what_is_beyond_them():
    made = simulate_session(cohort()[0], with_device=False, protocol=TINY, errors=EXACT)
    assert made.balance < 1e-9
    task_frame = 600
    angle = np.array([[made.suit[name][task_frame] for name in made.body.joints]])
    quaternion = [[made.suit[f"Pelvis_q{part}"][task_frame] for part in "wxyz"]]
    held, _ = made.body.inverse_dynamics(Motion(angle, orientation=quaternion))
    arm = [k for k, name in enumerate(made.body.joints) if "Shoulder" in name or "Elbow" in name]
    # Held still against the frame of a slow movement: what is left is its acceleration.
    assert np.abs(made.torque_nm[task_frame, arm] - held[0, arm]).max() < 1.0


@pytest.mark.parametrize("worn", [False, True])
def test_the_shoes_carry_the_person_the_drill_and_the_device(worn):
    person = cohort()[2]
    made = simulate_session(person, with_device=worn, protocol=TINY, errors=EXACT)
    total = made.shoes["RightShoe_F_z"] + made.shoes["LeftShoe_F_z"]
    mass = person.mass_kg + 0.66 + (1.8 if worn else 0.0)
    assert total.mean() == pytest.approx(9.81 * mass, rel=1e-4)


def test_without_errors_the_pipeline_returns_the_true_torques():
    made = simulate_session(cohort()[0], with_device=False, protocol=TINY, errors=EXACT)
    found = recorded_torques(
        [made.suit, made.shoes], session_setup(made.body), clocks="shared", variances="given",
        checks=False,
    )  # fmt: skip
    rows = np.rint(found.time_s * TINY.rate_hz).astype(int)
    error = found.torques.torque - made.torque_nm[rows]
    # What is left is the filter's: movements of 0.8 s through a window of a quarter of a second.
    assert np.sqrt(np.mean(error**2)) < 0.05


def test_sensors_without_errors_make_a_session_like_any_other():
    found = run_session(cohort()[0], with_device=True, setting=Setting(TINY, EXACT, 0, None))
    assert (found.error_nm < 0.2).all() and not found.posture_nm.any()
    assert np.allclose(found.measured.norm_nm, found.true.norm_nm, rtol=0.01)


def test_a_recording_is_the_same_for_the_same_seed_alone():
    def torque(seed, worn=False):
        return simulate_session(cohort()[0], with_device=worn, protocol=TINY, seed=seed).suit[
            "T8_sensor_acceleration_x"
        ]

    assert np.array_equal(torque(5), torque(5))
    assert not np.array_equal(torque(5), torque(6))
    assert not np.array_equal(torque(5), torque(5, worn=True))


# The study ----------------------------------------------------------------------------------------


def test_intervals_hold_the_truth_and_the_shoulder_is_relieved(study):
    # Six sessions: their fixed errors are drawn once each, so that the share itself is uncertain. The
    # whole cohort is the slow test below.
    assert 0.90 < study.coverage.overall < 0.99
    change = study.change(("norm", "right shoulder", "left shoulder"))
    assert (change.relative.high < -0.1).all()
    assert -0.85 < change.relative.value[1] < -0.55
    true = study.change(("norm", "right shoulder"), true=True).relative.value
    # The norm of torques with errors is larger than that without, the more so where torques are small:
    # the effort with the device seems larger than it is.
    assert true[0] - 0.02 < change.relative.value[0] < true[0] + 0.12
    assert abs(change.relative.value[1] - true[1]) < 0.05
    assert max(one.balance for pair in study.sessions for one in pair) < 1e-9


def test_numbers_do_not_depend_on_the_number_of_workers():
    found = overhead_study(subjects=3, protocol=TINY, seed=1, workers=3)
    setting = Setting(TINY, SensorErrors(), 1, None)
    alone = run_session(found.subjects[2], with_device=True, setting=setting)
    beside = found.sessions[2][1]
    assert np.array_equal(alone.measured.joint_nm, beside.measured.joint_nm)
    assert np.array_equal(alone.inside, beside.inside)


def test_measures_are_shaped_by_subject_session_and_block(study):
    for name in (*MEASURES, "signed mean"):
        assert study.values(name).shape == (3, 2, 2)
    assert study.joint_values().shape == (3, 2, 2, 48)
    mass = np.array([person.mass_kg for person in study.subjects])[:, None, None]
    assert np.allclose(study.values("norm per kg") * mass, study.values("norm"))
    # The mean over joints of the joints' means.
    assert np.allclose(study.joint_values().mean(axis=3), study.values("mean absolute"))
    areas = np.stack([study.values(area) for area in ulna.effort.AREAS])
    # By the triangle inequality; means over frames of each.
    assert (areas.sum(axis=0) > study.values("norm")).all()
    with pytest.raises(ulna.ArgumentError, match="there is no measure 'left ear'"):
        study.values("left ear")


def test_the_analysis_of_variance_is_that_of_the_table(study):
    ours, plain = study.anova("torso"), repeated_anova(study.values("torso"))
    assert ours.effects == plain.effects
    assert [effect.name for effect in ours.effects] == ["session", "block", "session x block"]
    assert ours["session"].dof == 1 and ours["session"].error_dof == 2


def test_table_one_is_the_published_formula(study):
    signed = study.values("signed mean")
    for block in range(2):
        # A table of one frame and one joint a subject has that mean.
        tables = [[[[v]] for v in signed[:, session, block]] for session in range(2)]
        assert study.published.reduction[block] == pytest.approx(published_reduction(*tables))


def test_the_report_holds_every_table_and_figure(study, tmp_path):
    page = study.write(tmp_path / "out", command="ulna study overhead --out out")
    folder = page.parent
    text = page.read_text(encoding="utf-8")
    for words in ("With the device", "Greenhouse", "as published", "ulna study overhead --out out"):
        assert words in text
    assert not re.search(r"\bnan\b", text, re.IGNORECASE)
    names = {path.stem for path in (folder / "tables").iterdir()}
    assert names == set(study.tables()) >= {"effort", "change", "anova", "coverage", "table-1"}
    with open(folder / "tables" / "effort.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 3 * 2 * 2
    assert float(rows[0]["norm (Nm)"]) == pytest.approx(study.values("norm")[0, 0, 0], rel=1e-5)
    drawn = {path.stem for path in (folder / "figures").glob("*.png")}
    assert drawn == {
        "effort-over-time", "effort-by-block", "subjects", "right-shoulder", "areas", "body",
        "coverage",
    }  # fmt: skip
    found = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    assert found["coverage"]["overall"] == pytest.approx(study.coverage.overall)
    moving = (folder / "body.html").read_text(encoding="utf-8")
    assert "with the device" in moving and "RightUpperArm" in moving


def test_figures_take_axes_and_tell_what_they_show(study):
    plt = pytest.importorskip("matplotlib.pyplot")
    from ulna import plot

    figure, axes = plt.subplots()
    grid = study.plot(axes)
    assert grid[0, 0] is axes and "N m" in axes.get_ylabel()
    assert plot.effort_by_block(study).shape == (1, 3)
    below = plot.interval_coverage(study)[1, 0]
    assert len(below.get_xticklabels()) == 48
    plt.close("all")


def test_summary_and_repr_tell_the_answer(study):
    assert "right shoulder: -" in study.summary() and "as published" in study.summary()
    assert "covered" in repr(study) and "3 subjects" in repr(study)


def test_what_cannot_be_is_refused(tmp_path):
    with pytest.raises(ulna.ArgumentError, match="2 subjects are too few"):
        overhead_study(subjects=2)
    with pytest.raises(ulna.ArgumentError, match="seed must not be negative"):
        overhead_study(seed=-1)
    with pytest.raises(ulna.ArgumentError, match="workers must not be negative"):
        overhead_study(workers=-1)
    with pytest.raises(ulna.FileError, match="cannot be read"):
        overhead_study(device=tmp_path / "nothing.csv")
    with pytest.raises(ulna.ArgumentError, match="a cycle of 3 s is too short"):
        Protocol(hold_s=2.0, cycle_s=3.0)
    for wrong in ({"blocks": 0}, {"repetitions": 0}, {"rate_hz": 0.0}, {"rest_s": 2.0}):
        with pytest.raises(ulna.ArgumentError):
            Protocol(**wrong)
    with pytest.raises(ulna.ArgumentError, match="shoe_bias_n must not be negative"):
        SensorErrors(shoe_bias_n=-1.0)


# The command --------------------------------------------------------------------------------------


def test_the_command_writes_and_tells(study, tmp_path, monkeypatch, capsys):
    asked = {}

    def instead(**given):
        asked.update(given)
        return study

    def written(self, folder, *, command=""):
        folder.mkdir()
        asked["command"] = command
        return folder / "report.html"

    monkeypatch.setattr(overhead, "overhead_study", instead)
    # What it writes is tested above.
    monkeypatch.setattr(OverheadStudy, "write", written)
    assert (
        main(["study", "overhead", "--out", str(tmp_path / "out"), "--quick", "--seed", "3"]) == 0
    )
    assert asked["subjects"] == 4 and asked["seed"] == 3 and asked["protocol"].blocks == 2
    assert "report:" in capsys.readouterr().out and "study overhead" in asked["command"]
    assert (
        main(["study", "overhead", "--out", str(tmp_path / "two"), "--json", "--blocks", "5"]) == 0
    )
    told = json.loads(capsys.readouterr().out)
    assert asked["subjects"] == 12 and asked["protocol"] == Protocol()
    assert told["frames"] == study.coverage.frames


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--subjects", "2"], "2 is too few"),
        (["--seed", "-1"], "is not a whole number from 0"),
        (["--device", "nothing.csv"], "cannot be read"),
    ],
)
def test_the_command_says_what_is_wrong(arguments, words, tmp_path, capsys):
    try:
        code = main(["study", "overhead", "--out", str(tmp_path / "out"), *arguments])
    except SystemExit as stop:
        code = stop.code
    assert code == 2
    assert words in capsys.readouterr().err


def test_a_file_is_no_folder(tmp_path, capsys):
    (tmp_path / "out").write_text("here")
    assert main(["study", "overhead", "--out", str(tmp_path / "out"), "--quick"]) == 2
    assert "is a file" in capsys.readouterr().err


# At full size -------------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_cohort_at_full_size_covers_and_finds_the_session():
    found: OverheadStudy = overhead_study()
    assert found.coverage.frames > 1_000_000 - 24 * 100
    assert 0.93 <= found.coverage.overall <= 0.97
    assert found.anova()["session"].p_corrected < 1e-4
    relief = found.change(("right shoulder",)).relative
    assert relief.high[0] < -0.5
