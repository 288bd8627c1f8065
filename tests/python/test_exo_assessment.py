"""Assessment of an arm by an exoskeleton from Python and the command line."""

import json
from pathlib import Path

import numpy as np
import pytest

import ulna
from ulna import cli, exo
from ulna._command import BAD_INPUT

ROOT = Path(__file__).resolve().parents[2]
DEGREE = np.pi / 180


@pytest.fixture(scope="module")
def plant():
    return exo.exoskeleton()


@pytest.fixture(scope="module")
def done(plant):
    return exo.mobilise(plant)


def test_assessment_returns_the_truth(done):
    assert done.status == "ok"
    assert done.reason == ""
    (joint,) = done.joints
    assert joint.joint == "J4"
    # Half a percent is asked for; nothing is uncertain here.
    assert joint.k == pytest.approx(joint.true_k, rel=1e-9)
    assert joint.d == pytest.approx(joint.true_d, rel=1e-9)
    assert joint.model_residual_max < 1e-6
    assert joint.k_interval[0] < joint.k < joint.k_interval[1]
    assert "K" in repr(done) and "true K" in done.summary()
    assert any("'J1' rests on a limit" in note for note in done.notes)


def test_log_is_an_ordinary_record(done, plant, tmp_path):
    path = tmp_path / "log.csv"
    done.record.to_csv(path)
    log = ulna.read(path)
    np.testing.assert_allclose(log.values, done.record.values, atol=1e-12)
    assert [c.name for c in log.channels if c.role == "position"] == ["theta_J4"]
    assert [c.name for c in log.channels if c.role == "force"] == ["tau_hum_J4"]
    (again,) = exo.identify_viscoelasticity(log, plant)
    assert again.k == pytest.approx(done.joints[0].k, rel=1e-9)
    # A script of one's own: torque of the muscles by rigid bodies, friction and motors.
    names = ("J1", "J2", "J3", "J4")
    angle, rate, acceleration, motor = (
        np.column_stack([log[prefix + name] for name in names])
        for prefix in ("theta_", "theta_dot_", "theta_ddot_", "tau_motor_")
    )
    torque = plant.inverse_dynamics(angle, rate, acceleration, dynamics="friction") - motor
    fast = np.abs(rate[:, 3]) > 0.3  # slower than this the engine's friction creeps
    # The engine damps with the rate at the end of a step: 1 N m s/rad * 5 ms * 3 rad/s^2.
    assert fast.sum() > 100
    assert np.abs(torque[fast, 3] - log["tau_muscle_J4"][fast]).max() < 0.02


def test_ordinary_identification_reads_the_log(plant):
    protocol = exo.Protocol(
        shape="sinusoid",
        duration_s=1.0,
        speeds=[0.5, 1.0, 1.7],
        repeats=3,
        start_rad=[0, -90 * DEGREE, 0, 90 * DEGREE],
        moved={"J4": 60 * DEGREE},
        balanced=True,
    )
    done = exo.mobilise(plant, protocol)
    estimate = ulna.identify_impedance(done.record, estimator="ls")
    assert estimate.B[0, 0] == pytest.approx(done.joints[0].d, rel=0.15)


def test_command_assess_finds_the_muscles_in_a_small_swing(tmp_path, capsys):
    swing = tmp_path / "swing.csv"
    scene = ROOT / "examples" / "data" / "elbow-swing.toml"
    assert run("--scene", scene, "--balanced", "--out", swing, "--json") == cli.OK
    (joint,) = json.loads(capsys.readouterr().out)["joints"]
    assert cli.main(["assess", str(swing), "--json"]) == cli.OK
    found = json.loads(capsys.readouterr().out)
    assert found["outcome"] == "good"
    # Less than two standard errors, and 5 %; nothing but the curves of the muscles is off the line.
    assert found["K"][0][0] == pytest.approx(joint["true_k"], abs=0.12)
    assert found["B"][0][0] == pytest.approx(joint["true_d"], abs=0.03)
    assert found["M"][0][0] == pytest.approx(0, abs=0.02)  # the nominal model has taken it off


def test_command_assess_says_that_a_whole_range_is_another_model(done, tmp_path, capsys):
    done.record.to_csv(tmp_path / "log.csv")
    cli.main(["assess", str(tmp_path / "log.csv"), "--json"])
    found = json.loads(capsys.readouterr().out)
    assert found["outcome"] == "poor_fit" and found["K"][0][0] > 0 > done.joints[0].true_k


def test_a_plant_that_was_read_or_changed_takes_the_nominal_model_of_another(
    plant, done, tmp_path
):
    path = tmp_path / "scene.xml"
    path.write_text(plant.mjcf)
    read = exo.mobilise(exo.read_scene(path), nominal=plant)
    assert read.status == "ok"
    assert read.joints[0].k == pytest.approx(done.joints[0].k, rel=1e-9)
    assert read.joints[0].true_k == pytest.approx(done.joints[0].true_k, rel=1e-9)
    noisy = exo.with_errors(read.record, exo.read_scene(path), nominal=plant, torque_nm=0.1)
    assert exo.identify_viscoelasticity(noisy, exo.read_scene(path), nominal=plant)[0].joint == "J4"
    heavier = exo.mobilise(plant.change("mass", "hand", 0.735), nominal=plant)
    assert heavier.joints[0].model_residual_rms > 0.1
    # Joints, motors and muscles have the names of the nominal model, and the device holds the arm.
    for text, words in (
        (plant.mjcf.replace('"J4"', '"elbow"'), "no joint 'J4'"),
        (plant.mjcf.replace('"J4_motor"', '"motor"'), "'J4_motor'"),
        (exo.exoskeleton(muscles="none").mjcf, "4 actuators, the nominal model 12"),
        (exo.exoskeleton(coupling="apart").mjcf, "no muscle of the scene turns a joint"),
    ):
        path.write_text(text)
        with pytest.raises(ulna.ArgumentError, match=words):
            exo.mobilise(exo.read_scene(path), nominal=plant)
    with pytest.raises(ulna.UnsupportedError, match="give a plant that is described as nominal"):
        exo.mobilise(exo.read_scene(path))


@pytest.mark.parametrize("errors", ["newey-west", "bootstrap"])
def test_intervals_hold_the_truth(done, plant, errors):
    # Intervals of 95 %, 40 repetitions: fewer than 34 would be a chance of 1 in 500.
    held = 0
    for run in range(40):
        noisy = exo.with_errors(
            done.record, plant, angle_rad=1e-4, rate_rad_s=2e-4, torque_nm=0.1, seed=3, run=run
        )
        (joint,) = exo.identify_viscoelasticity(noisy, plant, errors=errors, bootstrap=200)
        held += joint.k_interval[0] <= joint.true_k <= joint.k_interval[1]
    assert held >= 34


def test_published_estimator_leaves_friction_to_the_arm(done, plant):
    (joint,) = exo.identify_viscoelasticity(done.record, plant, published=True)
    q, muscle = done.record["q_J4"], done.record["tau_muscle_J4"]
    assert joint.true_k_alone == pytest.approx(-np.polyfit(q, muscle, 1)[0], rel=1e-9)
    assert np.isnan(joint.d)
    assert joint.model_residual_max > 2.787
    (with_friction,) = exo.identify_viscoelasticity(
        done.record, plant, published=True, friction="engine", damping_torque=True, inertia=True
    )
    assert with_friction.k == pytest.approx(joint.true_k_alone, rel=1e-9)


def test_activation_and_movement_are_choices(plant):
    start = [-5 * DEGREE, -85 * DEGREE, 0, 80 * DEGREE]
    protocol = exo.Protocol(
        shape="minimum_jerk",
        duration_s=1.0,
        start_rad=start,
        moved={"J4": 50 * DEGREE},
        balanced=True,
        carry_weight=True,
    )
    rest = exo.mobilise(plant, protocol)
    assert not rest.notes
    reflex = exo.mobilise(
        plant,
        protocol.with_(excitation="stretch_reflex", rate_threshold_1_s=0.02, rate_gain_s=2.0),
    )
    assert rest.status == reflex.status == "ok"
    assert reflex.record["a_brachialis"].max() > rest.record["a_brachialis"].max() + 0.02
    # A reflex resists.
    assert reflex.joints[0].d > rest.joints[0].d


def test_local_impedance(done, plant):
    log = done.record
    names = ("J1", "J2", "J3", "J4")
    angle, rate = (
        np.column_stack([log[prefix + name] for name in names])[100:500:100]
        for prefix in ("q_", "q_dot_")
    )
    muscles = [c.name for c in log.channels if c.name.startswith("a_")]
    activation = np.column_stack([log[name] for name in muscles])[100:500:100]
    stiffness, damping = exo.muscle_impedance(plant, angle, rate, activation)
    assert stiffness.shape == damping.shape == (4, 4, 4)
    assert (damping[:, 3, 3] > 0).all()
    with pytest.raises(ulna.ArgumentError, match="activation is 4 x 3, expected 4 x 8"):
        exo.muscle_impedance(plant, angle, rate, activation[:, :3])


def test_runs_that_go_wrong_have_a_status_and_nothing_else(plant):
    weak = exo.mobilise(plant, exo.Protocol(kp=0, ki=0, start_limit_s=1))
    assert weak.status == "failed_init"
    assert "the start was not reached within 1 s" in weak.reason
    assert weak.record is None and weak.joints == () and np.isnan(weak.largest_slip_rad)
    held = exo.mobilise(plant, exo.Protocol(torque="held"))
    assert held.status == "diverged"
    assert held.joints == () and len(held.record.time) < 601
    late = exo.mobilise(plant, exo.Protocol(time_limit_s=1e-9))
    assert late.status == "timeout"
    assert "timeout" in repr(late) and "computing took longer" in late.summary()


def test_movement_that_says_nothing_keeps_its_log(plant):
    still = exo.mobilise(plant, exo.Protocol(shape="ramp", moved={"J4": 110 * DEGREE}))
    assert still.status == "nonfinite"
    assert "'J4' moves by" in still.reason and "move it further" in still.reason
    assert still.joints == () and len(still.record.time) == 601


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"moved": {"knee": 0.1}}, "no joint 'knee'"),
        ({"moved": {}}, "moved names no joint"),
        ({"moved": {"J4": 4.0}}, "the end of joint 'J4' is 229.2 degrees"),
        ({"start_rad": [0, 0, 0, 3.0]}, "the start of joint 'J4' is 171.9 degrees"),
        ({"start_rad": [0, np.nan, 0, 1.0]}, "the start of joint 'J2' is not finite"),
        ({"shape": "square"}, "shape is 'square'"),
        ({"torque": "later"}, "torque is 'later'"),
        ({"excitation": "loud"}, "excitation is 'loud'"),
        ({"speeds": [1, 2]}, "logistic movement ends short"),
        ({"flexors": 2.0}, "excitation of the flexors is 2"),
        ({"kp": np.nan}, "kp is nan"),
        ({"duration_s": 0.0}, "duration_s is 0.0; it must be positive"),
        ({"log_rate_hz": 130.0}, "whole number of the plant's time steps"),
        ({"settle_s": -1.0}, "settle_s is -1.0"),
        ({"settle_s": "x"}, "settle_s is 'x'; it must be a number"),
        ({"kp": "big"}, "kp is 'big'; it must be a number"),
        ({"kp": True}, "kp is True; it must be a number"),
        ({"flexors": "x"}, "flexors is 'x'; it must be a number"),
        ({"duration_s": [6]}, r"duration_s is \[6\]; it must be a number"),
        ({"rest_s": "x"}, "rest_s is 'x'; it must be a number"),
        ({"repeats": 1.5}, "repeats is 1.5; it must be a whole number"),
        ({"speeds": "fast"}, "speeds is 'fast'; it must be numbers"),
        ({"start_rad": "a"}, "start_rad is 'a'; it must be numbers"),
        ({"moved": "J4"}, "moved is 'J4'; it must be a table of joints"),
        ({"moved": ["J4"]}, "moved is .*; it must be a table of joints"),
        ({"moved": {"J4": "x"}}, r"moved\['J4'\] is 'x'; it must be a number"),
    ],
)
def test_protocols_that_cannot_be(plant, settings, words):
    with pytest.raises(ulna.ArgumentError, match=words) as caught:
        exo.mobilise(plant, exo.Protocol(**settings))
    if "it must be" in words:
        assert caught.value.argument == next(iter(settings))


def test_numbers_may_be_of_any_kind(plant):
    # What a script of NumPy gives is as good as plain numbers.
    given = exo.Protocol(
        kp=np.float32(50),
        duration_s=np.array(2.0),
        repeats=np.int64(1),
        speeds=np.array([1]),
        shape="ramp",
        moved={"J4": np.float64(0.5)},
    )
    plain = exo.Protocol(duration_s=2, shape="ramp", moved={"J4": 0.5})
    one, other = (exo.mobilise(plant, protocol) for protocol in (given, plain))
    np.testing.assert_array_equal(one.record.values, other.record.values)


def test_plants_that_cannot_be_assessed(plant, done):
    with pytest.raises(ulna.ArgumentError, match="does not hold the arm"):
        exo.mobilise(exo.exoskeleton(coupling="apart"))
    with pytest.raises(ulna.UnsupportedError, match="no nominal model"):
        exo.mobilise(plant.change("mass", "Link4", 0.6))
    with pytest.raises(ulna.ArgumentError, match="theta_"):
        time = np.arange(100) / 100
        exo.identify_viscoelasticity(ulna.Record.from_arrays(time, {"x": np.sin(time)}), plant)
    with pytest.raises(ulna.ArgumentError, match="not a Record"):
        exo.identify_viscoelasticity(np.zeros(3), plant)
    with pytest.raises(ulna.AnalysisError, match="'J3' moves by"):
        exo.identify_viscoelasticity(done.record, plant, joints=["J3"])
    with pytest.raises(ulna.ArgumentError, match="torque_nm must"):
        exo.with_errors(done.record, plant, torque_nm=-1.0)
    with pytest.raises(ulna.ArgumentError, match="torque_nm is 1e.300; it must be at most"):
        exo.with_errors(done.record, plant, torque_nm=1e300)


def test_what_is_no_plant_and_no_protocol_is_refused(plant, done):
    cases = [
        (lambda: exo.mobilise(3), "plant", "plant is a int, not a Plant"),
        (lambda: exo.mobilise(plant, nominal=3), "nominal", "nominal is a int, not a Plant"),
        (lambda: exo.mobilise(plant, {"shape": "ramp"}), "protocol", "is a dict, not a Protocol"),
        (lambda: exo.AssessmentModel([], protocol={}), "protocol", "is a dict, not a Protocol"),
        (lambda: exo.AssessmentModel([], nominal=3), "nominal", "not a Plant"),
        (
            lambda: exo.identify_viscoelasticity(done.record, 3),
            "plant", "plant is a int, not a Plant",
        ),
        (
            lambda: exo.identify_viscoelasticity(done.record, plant, joints="J4"),
            "joints", "joints is 'J4'; it must be a sequence of names",
        ),
        (
            lambda: exo.identify_viscoelasticity(done.record, plant, lag_s="long"),
            "lag_s", "lag_s is 'long'; it must be a number",
        ),
    ]  # fmt: skip
    for call, argument, words in cases:
        with pytest.raises(ulna.ArgumentError, match=words) as caught:
            call()
        assert caught.value.argument == argument


def test_another_nominal_model_is_a_choice(plant):
    heavier = exo.exoskeleton(fore_mass_kg=1.2)
    off = exo.mobilise(plant, nominal=heavier).joints[0]
    assert off.model_residual_rms > 0.1
    assert off.k != off.true_k


def run(*arguments):
    return cli.main(["simulate", "assessment", *map(str, arguments)])


def test_command(tmp_path, capsys):
    out = tmp_path / "log.csv"
    assert run("--out", out, "--noise", 0.1, "--seed", 2) == cli.OK
    printed = capsys.readouterr().out
    assert printed.startswith("ok\nJ4: K")
    assert f"log: {out}" in printed
    assert "seed 2" in "".join(ulna.read(out).provenance)
    assert run("--json", "--published") == cli.OK
    said = json.loads(capsys.readouterr().out)
    assert said["status"] == "ok" and said["log"] is None
    assert said["joints"][0]["d"] is None and said["joints"][0]["k"] < 0


def test_command_with_a_scene(tmp_path, capsys):
    scene = tmp_path / "scene.toml"
    scene.write_text(
        '[scene]\nfore_mass_kg = 1.1\n[protocol]\nshape = "ramp"\nduration_s = 2\nmoved = {J4 = 0.5}\n'
    )
    assert run("--scene", scene, "--balanced", "--json") == cli.OK
    assert json.loads(capsys.readouterr().out)["rows"] == 201
    scene.write_text("[protocol]\nkp = 0\nki = 0\nstart_limit_s = 1\n")
    assert run("--scene", scene) == 1
    assert capsys.readouterr().out.startswith("failed_init: the start was not reached")
    scene.write_text('[protocol]\nshape = "ramp"\nmoved = {J4 = 1.9198621771937625}\n')
    out = tmp_path / "still.csv"
    assert run("--scene", scene, "--out", out, "--noise", 1e-3) == 1
    assert "move it further" in capsys.readouterr().out
    assert len(ulna.read(out).time) == 601
    for text, words in (
        ("[scene]\nlegs = 2\n", "[scene] has 'legs'"),
        ("[protocol]\nspeed = 2\n", "[protocol] has 'speed'"),
        ("scene = 3\n", "scene must be a table"),
        ("[scene\n", "is not TOML"),
        ("[protcol]\nkp = 5\n", "has 'protcol', which there is not; there are [scene], [soft]"),
        ("kp = 5\n", "has 'kp', which there is not"),
        ('[[links]]\nname = "Link1"\n', "has 'links', which there is not"),
        ("link = [1, 2]\n", "link 1 is 1; it must be a table"),
        ('[protocol]\nkp = "big"\n', "kp is 'big'; it must be a number"),
        ('[protocol]\nmoved = {J4 = "x"}\n', "moved['J4'] is 'x'"),
        ("[soft]\nstiffness_n_m = [1, 2, 3]\n", "it must be one number, or two"),
    ):
        scene.write_text(text)
        assert run("--scene", scene) == BAD_INPUT
        assert words in capsys.readouterr().err


def test_command_takes_a_device_beside_its_settings(tmp_path, capsys):
    scene = tmp_path / "scene.toml"
    device = (ROOT / "examples" / "data" / "nesm.toml").read_text()
    scene.write_text('[protocol]\nshape = "ramp"\nduration_s = 2\n\n' + device)
    assert run("--scene", scene, "--json") == cli.OK
    assert json.loads(capsys.readouterr().out)["rows"] == 201


def test_command_refuses_before_it_simulates(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(exo, "mobilise", None)
    for arguments, words in (
        (("--out", tmp_path / "nowhere" / "log.csv"), "there is no folder"),
        (("--out", tmp_path), "is a folder"),
        (("--seed", "-1"), "'-1' is not a whole number from 0"),
        (("--noise", "1e300"), "1e300 is above 1000000 N m"),
    ):
        assert run(*arguments) == BAD_INPUT
        assert words in capsys.readouterr().err


def test_help_of_the_command_has_its_own_exit_code(capsys):
    assert run("--help") == cli.OK
    assert "  1  the run did not end as ok" in capsys.readouterr().out
