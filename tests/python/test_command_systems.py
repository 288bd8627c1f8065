"""``ulna passivity``, ``ulna model`` and ``ulna rig``: what the functions find, said on a terminal."""

import json
from pathlib import Path

import numpy as np
import pytest

import ulna
from ulna import cli, design, sim


def run(*arguments):
    return cli.main([str(a) for a in arguments])


def told(capsys):
    return json.loads(capsys.readouterr().out)


# Passivity ---------------------------------------------------------------------------------------


def test_passivity_of_a_fraction(capsys, tmp_path):
    assert run("passivity", "--num", "1 3.1", "--den", "1,3,2") == cli.OK
    assert "not passive" in capsys.readouterr().out.lower()
    out = tmp_path / "judged"
    assert run("passivity", "--num", "1 0", "--den", "1 0.2 1", "--out", out, "--json") == cli.OK
    found = told(capsys)
    assert found["output"] == pytest.approx(0.2, abs=1e-12)
    assert found["verdict"] == "passive"
    assert json.loads((out / "result.json").read_text()) == found
    assert (out / "passivity.png").stat().st_size > 10_000
    assert run("passivity", "--num", "1 3.1", "--den", "1 3 2", "--band", "0,5", "--json") == cli.OK
    assert told(capsys)["verdict"] == "passive"


def test_passivity_of_files(capsys, tmp_path):
    path = tmp_path / "system.json"
    path.write_text(json.dumps({"M": [[1, 0], [0, 1]], "B": [[3, 1], [0, 5]], "K": [[9, 0], [0, 9]]}))
    assert run("passivity", path, "--json") == cli.OK
    assert told(capsys)["input"] == pytest.approx(np.linalg.eigvalsh([[3, 0.5], [0.5, 5]])[0])
    assert run("passivity", path, "--direction", "0,1", "--json") == cli.OK
    assert told(capsys)["input"] == pytest.approx(5.0)
    path.write_text(json.dumps({"A": [[-1]], "B": [[1]], "C": [[1]], "D": [[0]]}))
    assert run("passivity", path) == cli.OK
    capsys.readouterr()
    path.write_text(json.dumps({"num": [[[2], [1]], [[1], [2]]], "den": [1]}))
    assert run("passivity", path, "--two-port", "--json") == cli.OK
    assert told(capsys)["largest_shortage"] == pytest.approx(1.5)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((), "give a FILE, or --num and --den"),
        (("--num", "1"), "--num and --den go together"),
        (("--num", "1 x", "--den", "1"), "'x' is not a number"),
        (("none.json",), "none.json"),
        (("--num", "1", "--den", "1 1", "--two-port", "--band", "0,1"), "leave --band"),
        (("--num", "1", "--den", "0"), "denominator"),
        (("--num", "1", "--den", "1 1", "--shortage", "1"), "belong to --two-port"),
    ],
)
def test_passivity_refuses(arguments, words, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run("passivity", *arguments) == cli.BAD_INPUT
    assert words in capsys.readouterr().err


def test_passivity_of_an_assessment_agrees_with_it(capsys, tmp_path):
    data = Path(__file__).resolve().parents[2] / "examples" / "data" / "relaxed-arm.csv"
    assert run("assess", data, "--json") == cli.OK
    result = capsys.readouterr().out
    (tmp_path / "result.json").write_text(result)
    assert run("passivity", tmp_path / "result.json", "--json") == cli.OK
    found = told(capsys)
    assert found["verdict"] == json.loads(result)["passivity"]["verdict"] == "passive"
    assert "antisymmetric part of K" in " ".join(found["notes"])
    assert run("passivity", "--num", "1", "--den", "1 -1", "--json") == cli.OK
    assert told(capsys)["input"] == "-inf"


def test_passivity_names_what_a_file_lacks(capsys, tmp_path):
    path = tmp_path / "system.json"
    for text, words in (("{", "is not JSON"), ('{"M": 1}', "must hold num and den"), ("[1]", "must hold")):
        path.write_text(text)
        assert run("passivity", path) == cli.BAD_INPUT
        assert words in capsys.readouterr().err


# Models ------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    rate_hz, rng = 200.0, np.random.default_rng(0)
    force = np.repeat(rng.normal(size=300), 20)
    x = ulna.models.simulate([0.8], [1.0, 3.0, 60.0], force, rate_hz=rate_hz, delay_s=0.01)
    record = ulna.Record.from_arrays(
        None, {"F_x": force, "x": x + 5e-4 * rng.normal(size=len(x))}, rate_hz=rate_hz
    )
    path = tmp_path_factory.mktemp("model") / "log.csv"
    record.to_csv(path)
    return path


def test_model(log, capsys, tmp_path):
    channels = (log, "--input", "F_x", "--output", "x", "--delay", "10")
    out = tmp_path / "fit"
    assert run("model", *channels, "--poles", 2, "--zeros", 0, "--json", "--out", out) == cli.OK
    found = told(capsys)
    for name, true in (("b0", 0.8), ("a1", 3.0), ("a0", 60.0)):
        low, high = found["intervals_95"][name]
        assert low < true < high
        assert high - low < 0.1 * true
    assert (out / "model.png").exists()
    assert "simulated" not in found


def test_model_order_and_delay_are_found(log, capsys):
    arguments = ("model", log, "--input", "F_x", "--output", "x", "--poles", "1,2", "--delay", "0:20:5")
    assert run(*arguments) == cli.OK
    assert "2 poles" in capsys.readouterr().out
    assert run(*arguments, "--json") == cli.OK
    found = told(capsys)
    assert found["delay_s"] == pytest.approx(0.01)
    assert len(found["den"]) == 3
    assert len(found["candidates"]) == 5 + 2 * 5


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--input", "F", "--output", "x"), "there is no channel 'F'; the record holds"),
        (("--input", "F_x", "--output", "x", "--delay", "5:1:1"), "is not ms"),
        (("--input", "F_x", "--output", "x", "--delay", "0:0.04:0.005"), "is in ms"),
        (("--input", "F_x", "--output", "x", "--poles", "two"), "is not whole numbers"),
        (("--input", "F_x", "--output", "x", "--poles", "99"), "poles"),
    ],
)
def test_model_refuses(log, arguments, words, capsys):
    assert run("model", log, *arguments) == cli.BAD_INPUT
    assert words in capsys.readouterr().err


# The rig -----------------------------------------------------------------------------------------


def test_springs(capsys, tmp_path):
    arguments = ("rig", "springs", "--rates", "0 200 0 90 0 200 0 90", "--rest", "0.1")
    assert run(*arguments, "--out", tmp_path, "--json") == cli.OK
    found = told(capsys)
    np.testing.assert_allclose(np.diag(found["K"]), [481.639344, 351.428571], rtol=1e-8)
    assert (tmp_path / "springs.png").exists()
    assert run("rig", "springs", "--rates", "1 2", "--rest", "0.1") == cli.BAD_INPUT


def test_calibrate(capsys):
    volts, force = "-5.9 -3.5 -1.1 1.2 3.6 5.9", "50.9 30.6 10.1 -9.8 -30.4 -50"
    assert run("rig", "calibrate", "--volts", volts, "--force", force, "--json") == cli.OK
    found = told(capsys)
    slope = np.polyfit([float(v) for v in volts.split()], [float(f) for f in force.split()], 1)[0]
    assert found["slope_n_v"] == pytest.approx(slope)
    assert run("rig", "calibrate", "--volts", "1 2", "--force", "1") == cli.BAD_INPUT


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    arm = sim.Arm(np.eye(2), 8 * np.eye(2), 100 * np.eye(2), frame="robot")
    plan = design.multisine(peak=0.02, band_hz=(0, 2), duration_s=30, seed=1)
    log = sim.simulate(
        arm, plan, sensors=sim.Sensors(acceleration_noise_m_s2=0.02), extras=["robot", "acceleration"]
    )
    path = tmp_path_factory.mktemp("rig") / "log.csv"
    log.to_csv(path)
    return path


def test_check(recording, capsys):
    assert run("rig", "check", recording, "--acceleration", "a", "--json") == cli.OK
    found = told(capsys)
    assert found["outcome"] == "good"
    np.testing.assert_allclose(found["gain"], np.eye(2), atol=0.01)


def test_force(recording, capsys, tmp_path):
    sensed = tmp_path / "sensed.csv"
    arguments = ("rig", "force", recording, "--acceleration", "a", "--reference", "x_ref")
    assert run(*arguments, "--to", sensed) == cli.OK
    assert str(sensed) in capsys.readouterr().out
    estimate = ulna.identify_impedance(ulna.read(sensed))
    np.testing.assert_allclose(np.diag(estimate.K), 100, rtol=0.02)
    assert run(*arguments, "--alpha", "1 2", "--to", sensed) == cli.BAD_INPUT
    assert "needs five numbers" in capsys.readouterr().err


def test_help_shows_examples(capsys):
    for command in ("passivity", "model", "rig"):
        assert run(command, "--help") == 0
        assert f"  ulna {command} " in capsys.readouterr().out
