"""Assessment of an arm by an exoskeleton from Python and the command line."""

import json

import numpy as np
import pytest

import ulna
from ulna import cli, exo

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
    ],
)
def test_protocols_that_cannot_be(plant, settings, words):
    with pytest.raises(ulna.ArgumentError, match=words):
        exo.mobilise(plant, exo.Protocol(**settings))


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
    ):
        scene.write_text(text)
        assert run("--scene", scene) != cli.OK
        assert words in capsys.readouterr().err
