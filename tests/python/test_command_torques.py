"""The command ``ulna torques``: what it writes and prints, and what it says of bad input."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from ulna.cli import main

pytest.importorskip("matplotlib").use("Agg")

SHARED = Path(__file__).resolve().parents[3] / "shared" / "data" / "wholebody"
needs_bowing = pytest.mark.skipif(
    not (SHARED / "bowing.csv").is_file(), reason="the bowing recording is not there"
)

MODEL = {
    "links": [
        {"name": "foot", "mass": 2.0, "com": [0, 0, 0.03], "inertia_diag": [0.01, 0.02, 0.02]},
        {"name": "leg", "mass": 18.0, "com": [0, 0, 0.4], "inertia_diag": [1.0, 1.0, 0.1],
         "joint": "ankle", "axis": [0, 1, 0], "origin": [0, 0, 0.06]},
    ],
    "plate": {"link": "foot"},
}  # fmt: skip
HEAD = ["time_s", "q_ankle_rad", *(f"foot_f{a}_N" for a in "xyz"), *(f"foot_m{a}_Nm" for a in "xyz")]


def table(rows=120):
    t = np.arange(rows) / 50
    rng = np.random.default_rng(0)
    out = np.zeros((rows, 8))
    out[:, 0], out[:, 1] = t, 0.1 * np.sin(2 * t)
    out[:, 2:] = [0, 0, 20 * 9.81, 0, 0, 0] + 0.2 * rng.normal(size=(rows, 6))
    # The centre of pressure follows the lean of the leg.
    out[:, 6] -= 18 * 9.81 * 0.4 * np.sin(out[:, 1])
    return out


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "model.json").write_text(json.dumps(MODEL))
    write(tmp_path / "log.csv", HEAD, table())
    return tmp_path


def write(path, head, rows):
    lines = [",".join("" if v != v else f"{v:.9g}" for v in row) for row in np.asarray(rows).tolist()]
    path.write_text("\n".join([",".join(head), *lines]) + "\n")


def run(folder, *more, file="log.csv", body="model.json"):
    return main(["torques", str(folder / file), "--body", str(folder / body), *more])


def test_it_prints_torques_and_what_does_not_fit(folder, capsys):
    assert run(folder) == 0
    told = capsys.readouterr().out
    assert "ankle" in told and "balance lacks" in told and "20 kg" in told and "from above" in told


def test_json_holds_everything_but_the_series(folder, capsys):
    assert run(folder, "--json", "--variances", "given") == 0
    found = json.loads(capsys.readouterr().out)
    assert found["body"]["mass_kg"] == pytest.approx(20) and found["sound"] is True
    assert [row["joint"] for row in found["joints"]] == ["ankle"]
    assert set(found["balance_rms"]) == {"Fx", "Fy", "Fz", "Mx", "My", "Mz"}
    assert found["start"]["carried_kg"] == pytest.approx(20, abs=0.1)
    assert found["variances"] == "given" and found["deviations"]["plate.force_x"] == 2.0


def test_out_holds_tables_figures_a_report_and_a_page(folder, capsys):
    from ulna._body_page import three_files

    assert run(folder, "--out", str(folder / "out")) == 0
    names = {path.name for path in (folder / "out").iterdir()}
    assert {"report.html", "result.json", "torques.csv", "balance.csv", "joints.csv", "torques.png",
            "torques.svg", "body.png", "body.svg"} <= names  # fmt: skip
    told = capsys.readouterr().out
    try:
        three_files()
        assert "body.html" in names and "moving body" in told
    except FileNotFoundError:
        assert "libjs-three" in told
    report = (folder / "out" / "report.html").read_text("utf-8")
    assert "ulna torques" in report and "log.csv" in report and "<script" not in report


def test_the_page_is_left_out_without_three(folder, capsys, monkeypatch):
    from ulna import _body_page

    monkeypatch.setattr(_body_page, "_THREE", ())
    assert run(folder, "--out", str(folder / "out")) == 0
    assert "libjs-three" in capsys.readouterr().out
    assert not (folder / "out" / "body.html").exists()
    assert (folder / "out" / "report.html").is_file()


def spoiled(folder, change, head=None):
    rows = table()
    change(rows)
    write(folder / "log.csv", head or HEAD, rows)


@pytest.mark.parametrize(
    ("change", "head", "words"),
    [
        (lambda r: None, ["time_s", "q_knee_rad", *HEAD[2:]], "log.csv is the angle of the joint 'ankle'"),
        (lambda r: None, [*HEAD[:2], "plate_fx_kN", *HEAD[3:]], "log.csv has 'plate_fx', but no component y"),
        (lambda r: r[:, 1].__imul__(400), None, "'q_ankle' of log.csv reaches .* in row .*degrees"),
        (lambda r: r[:, 1].fill(np.nan), None, "no frame has the angles"),
        (lambda r: r.__setitem__((5, 3), np.inf), None, "log.csv"),
        (lambda r: r.__setitem__((7, 0), r[5, 0]), None, "log.csv: line 9: the time .* goes back"),
        (lambda r: None, [*HEAD[:4], "foot_fz_Nm", *HEAD[5:]], "'foot_fz' of log.csv is in Nm, but N"),
    ],
)  # fmt: skip
def test_bad_recordings_are_refused_by_file_and_channel(folder, capsys, change, head, words):
    spoiled(folder, change, head)
    assert run(folder) == 2
    told = capsys.readouterr()
    assert told.out == "" and told.err.startswith("ulna: ")
    assert re.search(words, told.err), told.err


def test_gaps_are_bridged_and_said(folder, capsys):
    def lose(rows):
        rows[60:63, 1:] = np.nan
        rows[[20, 35, 90], 1:] = np.nan

    spoiled(folder, lose)
    assert run(folder, "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert "dropped_frames" in {f["code"] for f in found["findings"]}
    assert found["without_state"] == 0


def test_a_long_gap_leaves_its_frames_without_torques(folder, capsys):
    spoiled(folder, lambda rows: rows[40:80, 1:].fill(np.nan))
    assert run(folder, "--out", str(folder / "out"), "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert 30 < found["without_state"] < 50
    assert np.isfinite(found["joints"][0]["rms_nm"]) and found["balance_rms"]["Fz"] < 5
    lines = (folder / "out" / "torques.csv").read_text().splitlines()
    assert sum(line.split(",")[1] == "" for line in lines) == found["without_state"]


def test_a_dead_plate_is_said_in_a_report_of_its_own(folder, capsys):
    def die(rows):
        rows[:, 2:] = rows[0, 2:]

    spoiled(folder, die)
    assert run(folder, "--out", str(folder / "out")) == 0
    assert "plate in log.csv repeats one reading all the time" in capsys.readouterr().out
    assert "Do not use" in (folder / "out" / "report.html").read_text("utf-8")


def test_a_wrong_unit_of_the_forces_is_said(folder, capsys):
    spoiled(folder, lambda rows: rows[:, 2:].__imul__(1e-3))
    assert run(folder) == 0
    assert "error: the contacts carry 0.02 kg" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nothing.csv", "--body", "model.json"], "nothing.csv"),
        (["log.csv", "--body", "nobody.json"], "nobody.json"),
        (["log.csv", "--body", "log.csv"], "log.csv"),
        (["log.csv", "log.csv", "--body", "model.json"], "same file name"),
        (["log.csv"], "--body"),
        (["log.csv", "--body", "model.json", "--window", "-1"], "--window"),
        (["log.csv", "--body", "model.json", "--order", "12"], "order"),
        (["log.csv", "--body", "model.json", "--out", "log.csv"], "is a file"),
    ],
)
def test_a_wrong_command_is_refused(folder, capsys, monkeypatch, arguments, words):
    monkeypatch.chdir(folder)
    assert main(["torques", *arguments]) == 2
    assert words in capsys.readouterr().err


@needs_bowing
def test_the_bowing_recording_needs_no_options(tmp_path, capsys):
    arguments = [str(SHARED / "bowing.csv"), "--body", str(SHARED / "bowing-model.json")]
    assert main(["torques", *arguments, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    ankle, hip = found["joints"]
    assert ankle["from_above_lowest_nm"] == pytest.approx(-63.9, abs=0.05)
    assert ankle["from_above_highest_nm"] == pytest.approx(-15.5, abs=0.05)
    assert hip["from_above_lowest_nm"] == pytest.approx(-72.5, abs=0.05)
    assert hip["from_above_highest_nm"] == pytest.approx(-0.2, abs=0.05)
    assert ankle["above_less_below_rms_nm"] == pytest.approx(7.8, abs=0.05)
    assert list(found["balance_rms"].values()) == pytest.approx(
        [5.77, 2.55, 1.61, 6.43, 8.20, 0.86], abs=0.05
    )
    assert found["body"]["mass_kg"] == pytest.approx(61.691, abs=5e-4)
