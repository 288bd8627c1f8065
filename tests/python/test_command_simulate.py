"""``ulna simulate``: logs that read like recorded ones."""

import json

import numpy as np
import pytest

import ulna
from ulna import cli, design, sim


def run(*arguments):
    return cli.main(["simulate", *map(str, arguments)])


@pytest.fixture
def positions(tmp_path):
    path = tmp_path / "positions.csv"
    design.multisine(peak=0.01, duration_s=15, seed=1).to_csv(path)
    return path


@pytest.fixture
def forces(tmp_path):
    path = tmp_path / "forces.csv"
    design.steps(size=2, unit="N", repeats=1, seed=1).to_csv(path)
    return path


def test_arm(positions, tmp_path, capsys):
    out = tmp_path / "log.csv"
    assert run("arm", "--design", positions, "--out", out, "--tremor", 0.3, "--seed", 4) == cli.OK
    printed = capsys.readouterr().out
    assert "seed 4, run 0" in printed
    assert str(out) in printed
    log = ulna.read(out)
    expected = sim.simulate(
        sim.arms("3.2")["P1"], ulna.read(positions), human=sim.Human(tremor_n=0.3), seed=4
    )
    np.testing.assert_array_equal(log.values, expected.values)
    estimate = ulna.identify_impedance(log)
    # 15 s tell the stiffness to a few percent only.
    assert abs(estimate.K[1, 1] - 125.43) < 4 * estimate.se("K")[1, 1] < 0.3 * 125.43


def test_arm_of_a_file_and_of_another_table(positions, tmp_path, capsys):
    arm = tmp_path / "arm.json"
    arm.write_text(json.dumps({"M": [[1, 0], [0, 1]], "B": [[8, 0], [0, 9]], "K": [[70, 0], [0, 90]]}))
    out = tmp_path / "log.csv"
    common = ("--design", positions, "--out", out, "--json")
    assert run("arm", "--arm", arm, "--payload", 0.2, "--extras", "truth,robot", *common) == cli.OK
    said = json.loads(capsys.readouterr().out)
    assert said["log"] == str(out)
    assert said["rows"] == 15_000
    assert {"q_1", "tau_2", "F_x_true", "cocontraction"} <= set(said["channels"])
    assert any("K [70 0; 0 90]" in line and "payload 0.2 kg" in line for line in said["provenance"])
    assert run("arm", "--table", "5.6", "--row", "Method 1", "--exact", *common) == cli.OK
    assert "0 N noise" in "".join(json.loads(capsys.readouterr().out)["provenance"])


def test_rigid(forces, tmp_path, capsys):
    out = tmp_path / "log.csv"
    assert run("rigid", "--design", forces, "--out", out, "--json") == cli.OK
    said = json.loads(capsys.readouterr().out)
    assert "holds the hand by" in "".join(said["provenance"])
    assert len(said["segments"]) == 8
    assert {"F_x_ref", "F_y_ref"} <= set(said["channels"])


def test_springs(positions, tmp_path, capsys):
    out = tmp_path / "log.csv"
    rates = "0,200,0,90,0,200,0,90"
    command = ("springs", "--design", positions, "--out", out, "--rates", rates, "--rest", 0.1)
    assert run(*command, "--mass", 1.031) == cli.OK
    assert "4 springs" in capsys.readouterr().out
    found = ulna.identify_impedance(ulna.read(out), no_damping=True)
    # 10 mm are not linear to better than this; the closed form is 481.64 and 351.43.
    np.testing.assert_allclose(np.diag(found.K), [481.64, 351.43], rtol=0.05)
    np.testing.assert_allclose(np.diag(found.M), 1.031, rtol=0.05)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("arm", "--row", "P9"), "--row P9 is none of Table 3.2"),
        (("arm", "--arm", "{folder}/none.json"), "none.json"),
        (("arm", "--arm", "{design}"), "no JSON object with M, B and K"),
        (("arm", "--extras", "angles"), "extras are acceleration"),
        (("arm", "--kp", "1e6", "--kd", "0", "--tremor", "-1"), "is below 0"),
        (("rigid",), "perturbed by forces"),
        (("springs", "--rates", "1,2"), "not eight numbers"),
        (("springs", "--rates", "0,0,0,0,0,0,0,0"), "spring"),
        (("nothing",), "invalid choice"),
    ],
)
def test_refusals(arguments, words, positions, tmp_path, capsys):
    filled = [str(a).format(folder=tmp_path, design=positions) for a in arguments]
    try:
        code = run(*filled, "--design", positions, "--out", tmp_path / "log.csv")
    except SystemExit as stop:
        code = stop.code
    assert code == cli.BAD_INPUT
    assert words in capsys.readouterr().err
    assert not (tmp_path / "log.csv").exists()


def test_an_unstable_loop_is_a_failed_analysis(positions, tmp_path, capsys):
    arm = tmp_path / "arm.json"
    arm.write_text(json.dumps({"M": [[1, 0], [0, 1]], "B": [[-90, 0], [0, -90]], "K": [[9, 0], [0, 9]]}))
    command = ("arm", "--arm", arm, "--design", positions, "--out", tmp_path / "log.csv")
    assert run(*command, "--kd", 20) == cli.FAILED_ANALYSIS
    assert "the loop is unstable" in capsys.readouterr().err


def test_a_folder_is_no_log(positions, tmp_path, capsys):
    assert run("arm", "--design", positions, "--out", tmp_path) == cli.BAD_INPUT
    assert "is a folder" in capsys.readouterr().err
