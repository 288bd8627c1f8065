"""The command: what it prints, writes and returns."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import ulna
from ulna import cli

ROOT = Path(__file__).resolve().parents[2]
ARM = ROOT / "examples" / "data" / "relaxed-arm.csv"
ANKLE = ROOT.parent / "shared" / "data" / "ankle"


def _no_constant(word):
    raise AssertionError(f"{word} is not JSON")


def _json(capsys, *arguments):
    assert cli.main(["assess", *map(str, arguments), "--json"]) == cli.OK
    out, err = capsys.readouterr()
    assert err == ""
    return json.loads(out, parse_constant=_no_constant)


def _refused(capsys, code, *arguments):
    """One sentence on standard error, nothing on standard output; returns the sentence.

    What was found in the record follows, a line each.
    """
    line, *found = _refused_lines(capsys, code, *arguments)
    assert all(one.startswith("ulna: warning: ") for one in found)
    return line


def _refused_lines(capsys, code, *arguments):
    assert cli.main([str(a) for a in arguments]) == code
    out, err = capsys.readouterr()
    assert out == "" and err.startswith("ulna") and err.endswith("\n"), err
    assert "Traceback" not in err
    return err.splitlines()


def test_json_is_one_object_with_everything_promised(capsys):
    found = _json(capsys, ARM)
    assert found["n"] == 2 and found["axes"] == ["x", "y"]
    for name in ("M", "B", "K"):
        assert np.shape(found[name]) == np.shape(found[name + "_se"]) == (2, 2)
        low, high = found["intervals_95"][name]
        assert np.all(np.array(low) < found[name]) and np.all(np.array(found[name]) < high)
        assert found["standard_errors"][name] == found[name + "_se"]
    assert len(found["x0"]) == len(found["x0_se"]) == 2
    assert len(found["vaf"]) == 2 and all(0 < value <= 100 for value in found["vaf"])
    assert found["estimator"] == "instrumental_variables"
    assert found["least_squares"]["estimator"] == "least_squares"
    assert found["passivity"]["verdict"] in ("passive", "not passive", "undecided")
    assert 0 <= found["passivity"]["probability"] <= 1
    assert found["passivity"]["approach"] in ("model", "energy", "both")
    assert found["units"]["K"] == "N/m"
    assert isinstance(found["outcome"], str) and isinstance(found["warnings"], list)
    assert found["report"] is None and found["record"]["source"] == str(ARM)


def test_json_agrees_with_the_library(capsys):
    estimate = ulna.identify_impedance(ulna.read(ARM), model="symmetric", estimator="ls")
    found = _json(capsys, ARM, "--model", "symmetric", "--estimator", "ls")
    for name in ("M", "B", "K", "x0", "K_se", "vaf"):
        assert found[name] == np.asarray(getattr(estimate, name)).tolist()
    assert found["K"][0][1] == found["K"][1][0]
    assert found["least_squares"] is None


def test_summary_fits_a_terminal_and_ends_with_the_report(capsys, tmp_path):
    pytest.importorskip("matplotlib")
    out = tmp_path / "deep" / "out"
    assert cli.main(["assess", str(ARM), "--out", str(out)]) == cli.OK
    printed, err = capsys.readouterr()
    lines = printed.rstrip("\n").split("\n")
    assert err == ""
    assert lines[-1] == f"report: {out / 'report.html'}"
    assert max(len(line) for line in lines[:-1]) <= 80
    stored = json.loads((out / "result.json").read_text(), parse_constant=_no_constant)
    assert stored["report"] == str(out / "report.html")
    figures = sorted(path.name for path in (out / "figures").iterdir())
    assert len(figures) == 14 and figures[:2] == ["ellipses.png", "ellipses.svg"]
    for path in (out / "figures").glob("*.png"):
        assert path.read_bytes().startswith(b"\x89PNG")
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "relaxed-arm.csv" in page and "ulna assess" in page


def test_without_out_nothing_is_written(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["assess", str(ARM)]) == cli.OK
    assert list(tmp_path.iterdir()) == []
    assert "report:" not in capsys.readouterr().out


@pytest.mark.parametrize("flag", ["--help", "--version"])
def test_help_and_version(capsys, flag):
    assert cli.main([flag]) == cli.OK
    out = capsys.readouterr().out
    if flag == "--help":
        assert out.startswith("usage: ulna")
    else:
        assert out == f"ulna {ulna.__version__}\n"


@pytest.mark.parametrize("command", [[], ["assess"], ["inspect"]])
def test_every_help_shows_an_example_and_fits(capsys, command):
    assert cli.main([*command, "--help"]) == cli.OK
    out = capsys.readouterr().out
    assert "example" in out and "ulna " + (command or ["assess"])[0] + " trial" in out
    assert max(len(line) for line in out.split("\n")) <= 80


def test_no_command_shows_the_help(capsys):
    assert cli.main([]) == cli.BAD_INPUT
    assert capsys.readouterr().out.startswith("usage: ulna")


@pytest.mark.parametrize(
    "arguments, words",
    [
        (["assess"], "FILE"),
        (["assess", "x.csv", "--window", "8"], "'8' is not an odd number"),
        (["assess", "x.csv", "--lowpass", "-5"], "-5"),
        (["assess", "x.csv", "--lowpass", "nan"], "not a finite number"),
        (["assess", "x.csv", "--payload", "many"], "'many' is not a number"),
        (["assess", "x.csv", "--shoulder", "1"], "not two numbers"),
        (["assess", "x.csv", "--shoulder", "-1"], "not two numbers"),
        (["assess", "x.csv", "--bootstrap", "0"], "not a whole number above 0"),
        (["assess", "x.csv", "--bootstrap", "9", "--errors", "newey-west"], "--errors bootstrap"),
        (["assess", "x.csv", "--model", "round"], "round"),
        (["assess", "x.csv", "--wobble"], "--wobble"),
        (["asses", "x.csv"], "asses"),
        (["assess", "no-such-file.csv"], "no-such-file.csv"),
    ],
)
def test_a_wrong_command_line_is_one_sentence(capsys, arguments, words):
    assert words in _refused(capsys, cli.BAD_INPUT, *arguments)


@pytest.mark.parametrize(
    "name, content",
    [
        ("binary.csv", bytes(range(256)) * 20),
        ("empty.csv", b""),
        ("header.csv", b"time_s,x_m,F_x_N\n"),
        ("words.csv", b"time_s,x_m,F_x_N\n0,a,b\n0.001,c,d\n"),
        ("short.csv", b"time_s,position_rad,torque_Nm\n"
         + b"".join(b"%.3f,%.3f,0.5\n" % (i / 1000, i * i / 9) for i in range(10))),
        ("back.csv", b"time_s,x_m,F_x_N\n0.002,1,2\n0.001,1,2\n0.000,1,2\n"),
        ("broken.mat", b"MATLAB 5.0 MAT-file, truncated"),
        ("broken.h5", b"\x89HDF\r\n\x1a\n" + b"\0" * 8),
        ("broken.npz", b"PK\x03\x04 no zip"),
    ],
)  # fmt: skip
def test_bad_files_are_refused_in_one_sentence(capsys, tmp_path, name, content):
    path = tmp_path / name
    path.write_bytes(content)
    assert len(_refused(capsys, cli.BAD_INPUT, "assess", path)) > 20


def test_a_recording_that_determines_nothing_is_a_failed_analysis(capsys, tmp_path):
    time = np.arange(20000) / 1000
    motion = 0.01 * np.sin(2 * np.pi * time)  # one sinusoid: M and K cannot be told apart
    force = 0.5 * np.sin(2 * np.pi * time + 0.3)
    path = tmp_path / "one-sinusoid.csv"
    np.savetxt(
        path, np.column_stack([time, motion, force]), delimiter=",", comments="",
        header="time_s,x_m,F_x_N",
    )  # fmt: skip
    assert "internal" not in _refused(capsys, cli.FAILED_ANALYSIS, "assess", path)


def _altered_arm(path, change):
    """The arm's recording with its lines of data changed."""
    heading, *rows = ARM.read_text().splitlines()
    path.write_text("\n".join([heading, *change(rows)]) + "\n")
    return path


def _without_some(rows):
    return rows[:20000] + rows[20050:]


def _with_a_hole(rows):
    cells = rows[20000].split(",")
    return rows[:20000] + [",".join([cells[0], "nan", *cells[2:]])] + rows[20001:]


def _jittered(rows):
    def shifted(row, by):
        time, rest = row.split(",", 1)
        return f"{float(time) + by:.4f},{rest}"

    return [shifted(row, 2e-4 if i % 3 == 2 else 0.0) for i, row in enumerate(rows)]


@pytest.mark.parametrize(
    "change, option, code",
    [
        (_without_some, "--split", "gap"),
        (_with_a_hole, "--split", "missing values"),
        (_jittered, "--regularise", "jitter"),
    ],
)
def test_a_recording_with_faults_names_the_option_that_helps(
    capsys, tmp_path, change, option, code
):
    path = _altered_arm(tmp_path / "faulty.csv", change)
    line, *found = _refused_lines(capsys, cli.BAD_INPUT, "assess", path)
    assert line.endswith(f"; try {option}")
    assert any(one.startswith("ulna: warning: ") and code in one for one in found)
    assert _json(capsys, path, option)["n"] == 2


def test_several_files_are_trials(capsys, tmp_path):
    for name, rows in (("1.csv", slice(0, 20000)), ("2.csv", slice(20000, 40000))):
        _altered_arm(tmp_path / name, lambda lines, rows=rows: lines[rows])
    files = [str(tmp_path / "1.csv"), str(tmp_path / "2.csv")]
    found = _json(capsys, *files)
    assert found["record"]["trials"] == len(found["trials"]) == 2
    assert found["record"]["source"] == files
    assert np.mean(found["trials"], axis=0) == pytest.approx(found["trial_mean"], rel=1e-9)
    # Two values: the standard error of their mean is half their distance.
    half = np.abs(np.subtract(*found["trials"])) / 2
    assert half == pytest.approx(found["trial_se"], rel=1e-9)
    folder = _json(capsys, tmp_path)
    assert folder["K"] == found["K"] and folder["record"]["source"] == str(tmp_path)


def test_bootstrap_counts_and_needs_no_other_option(capsys):
    true = ulna.identify_impedance(ulna.read(ARM), errors="bootstrap", bootstrap=60, seed=3)
    found = _json(capsys, ARM, "--bootstrap", "60", "--seed", "3")
    assert found["K_se"] == true.K_se.tolist()
    assert found["K_se"] != _json(capsys, ARM)["K_se"]


def test_a_shoulder_left_of_the_origin_is_no_option(capsys):
    _json(capsys, ARM, "--shoulder", "-0.1,0")
    assert cli._with_negative_pair(["--shoulder", "-.1,0", "-x"]) == ["--shoulder=-.1,0", "-x"]


def test_json_holds_what_the_perturbation_caused_and_rho(capsys):
    estimate = ulna.identify_impedance(ulna.read(ARM))
    found = _json(capsys, ARM)
    assert found["vaf_reference"] == estimate.vaf_reference.tolist()
    assert found["vaf_interval"] == estimate.vaf_interval.tolist()
    for name in ("freq_hz", "value", "total"):
        assert found["rho"][name] == getattr(estimate.rho, name).tolist()


def test_out_that_is_a_file_is_refused_before_the_work(capsys, tmp_path):
    path = tmp_path / "taken"
    path.write_text("")
    line = _refused(capsys, cli.BAD_INPUT, "assess", ARM, "--out", path)
    assert "is a file" in line


def test_a_defect_is_told_apart_and_shown_on_request(capsys, monkeypatch):
    def broken(*_, **__):
        raise KeyError("something\ninner")

    monkeypatch.setattr(ulna, "identify_impedance", broken)
    line = _refused(capsys, cli.INTERNAL, "assess", ARM)
    assert "internal error: KeyError" in line and "--debug" in line
    with pytest.raises(KeyError):
        cli.main(["assess", str(ARM), "--debug"])
    with pytest.raises(KeyError):
        cli.main(["--debug", "assess", str(ARM)])


def test_ctrl_c_is_130(capsys, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(ulna, "read", interrupted)
    assert "interrupted" in _refused(capsys, cli.INTERRUPTED, "assess", ARM)


def test_out_without_matplotlib_says_what_to_install(capsys, monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    line = _refused(capsys, cli.BAD_INPUT, "assess", ARM, "--out", tmp_path / "o")
    assert "pip install ulna[plot]" in line
    assert not (tmp_path / "o").exists()
    assert cli.main(["assess", str(ARM)]) == cli.OK


def test_inspect_drafts_a_map_that_assess_takes(capsys, tmp_path):
    draft = tmp_path / "lab.toml"
    assert cli.main(["inspect", str(ARM), "--out", str(draft)]) == cli.OK
    out = capsys.readouterr().out
    assert all(name in out for name in ("x_m", "F_y_N", "x_ref_m"))
    assert out.rstrip().endswith(f"map: {draft}")
    with_map = _json(capsys, ARM, "--map", draft)
    assert with_map["K"] == _json(capsys, ARM)["K"]
    assert "exists already" in _refused(capsys, cli.BAD_INPUT, "inspect", ARM, "--out", draft)


def test_selftest_passes(capsys):
    assert cli.main(["--selftest"]) == cli.OK
    out = capsys.readouterr().out
    assert "selftest passed" in out and "FAILED" not in out


def test_selftest_notices_a_wrong_answer(capsys, monkeypatch):
    true = ulna.identify_impedance

    class Wrong:
        def __init__(self, estimate):
            self._estimate = estimate

        def __getattr__(self, name):
            value = getattr(self._estimate, name)
            return value * 1.01 if name == "B" else value

    monkeypatch.setattr(ulna, "identify_impedance", lambda *a, **k: Wrong(true(*a, **k)))
    assert cli.main(["--selftest"]) == cli.INTERNAL
    assert "FAILED" in capsys.readouterr().out


def test_as_a_program_with_a_closed_pipe():
    environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
    program = subprocess.Popen(
        [sys.executable, "-m", "ulna.cli", "assess", str(ARM), "--json"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment,
    )  # fmt: skip
    program.stdout.close()
    assert program.stderr.read() == b""
    program.stderr.close()
    assert program.wait(60) == 0


def test_ankle_needs_no_map(capsys):
    if not ANKLE.exists():
        pytest.skip(f"{ANKLE} is not there")
    found = _json(capsys, ANKLE / "ankle-b.csv", "--lowpass", "50", "--train", "40")
    assert found["rotational"] is True and found["n"] == 1
    assert found["K"][0][0] == pytest.approx(60.0, abs=2.0)
