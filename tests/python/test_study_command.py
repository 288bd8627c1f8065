"""``ulna study``: its file, its verbs, what it writes; tables for other programs."""

from __future__ import annotations

import csv
import html
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import ulna
from ulna import cli
from ulna import study as st

MODEL = """
import os
from ulna.study import RunFailed

def torque(k, angle, speed):
    if angle > 1.15:
        raise RunFailed("limit", "stretched")
    return {"T": k * angle + 0.001 * speed, "P": k * angle**2 + 0.001 * speed}
"""
STUDY = """
title = "Torque of an elbow"
model = "elbow.py:torque"
outputs = ["T", "P"]

[factors.k]
low = 2
high = 8.0
unit = "N m/rad"

[factors.angle]
distribution = "triangular"
low = 0.2
mode = 0.5
high = 1.2

[factors.speed]
distribution = "normal"
mean = 1.0
deviation = 0.1

[design]
r = 16
n = 32
seed = 1

[analysis]
resamples = 50
"""


@pytest.fixture
def elbow(tmp_path, monkeypatch):
    """The file of a study; its model beside it."""
    pytest.importorskip("matplotlib")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "elbow.py").write_text(MODEL)
    path = tmp_path / "elbow.toml"
    path.write_text(STUDY)
    return path


def call(capsys, *words, code=cli.OK, figures=False):
    if words and words[0] in ("run", "analyse") and not figures:
        words = (*words, "--no-figures")  # which take most of the time
    got = cli.main(["study", *map(str, words)])
    out, err = capsys.readouterr()
    assert got == code, err
    return out, err


def refused(capsys, *words):
    out, err = call(capsys, *words, code=cli.BAD_INPUT)
    assert out == "" and err.startswith("ulna") and len(err.splitlines()) == 1, err
    return err


def kind(path, name, more=""):
    path.write_text(STUDY.replace("[design]\nr = 16\n", f'[design]\nkind = "{name}"\n{more}'))


# Verbs ---------------------------------------------------------------------------------------------


def test_plan_run_analyse(elbow, capsys):
    out, _ = call(capsys, "plan", elbow)
    assert "screen: 64 runs in 16 blocks of 4" in out and "rank: at most 160 runs" in out
    assert "N m/rad" in out and not Path("elbow").exists()
    out, err = call(capsys, "run", elbow, figures=True)
    assert "fixed at speed = 1" in out and "report: " in out
    assert "screen: 64 of 64 runs" in err and "rank: 128 of 128 runs" in err
    told = [line for line in out.splitlines() if not line.startswith("report: ")]  # holds a path
    assert max(map(len, told)) <= 80
    result = json.loads(Path("elbow/result.json").read_text())
    assert result["fixed"] == {"speed": 1.0} and result["ranked"] == ["k", "angle"]
    low, high = result["ranking"]["T"]["k"]["first_interval"]
    assert low < result["ranking"]["T"]["k"]["first"] < high
    assert result["runs"]["rank"]["failed"].keys() <= {"limit"}
    page = Path("elbow/report.html").read_text()
    for words in ("Torque of an elbow", "matters most", "Decision", "ulna study run", "Triangular"):
        assert words in page
    figures = {p.stem for p in Path("elbow/figures").glob("*.png")}
    assert {"fixing-T", "screening-P", "indices-T", "density-P", "scatter-T"} <= figures
    # Once more runs nothing, and says the same.
    journal = Path("elbow/rank/main.journal").read_bytes()
    again, err = call(capsys, "analyse", elbow, "--json")
    assert {**json.loads(again), "report": ""} == {**result, "report": ""} and err == ""
    call(capsys, "run", elbow, "--quiet", "--workers", 2)
    assert Path("elbow/rank/main.journal").read_bytes() == journal
    out, _ = call(capsys, "plan", elbow)
    assert "64 of 64 runs of screen are done" in out and "a run takes" in out


def test_the_command_gives_what_python_gives(elbow, capsys):
    kind(elbow, "sobol")
    out, _ = call(capsys, "run", elbow, "--json", "--quiet")
    found = json.loads(out)["ranking"]["P"]

    def torque(k, angle, speed):
        if angle > 1.15:
            raise st.RunFailed("limit")
        return k * angle**2 + 0.001 * speed

    study = ulna.Study(
        {
            "k": ulna.Uniform(2, 8),
            "angle": ulna.Triangular(0.2, 0.5, 1.2),
            "speed": ulna.Normal(1, 0.1),
        },
        torque,
    )
    direct = study.sobol(n=32, seed=1, resamples=50, on_failure="drop_block")
    assert [found[name]["total"] for name in direct.names] == direct.total.tolist()
    assert [found[n]["total_interval"] for n in direct.names] == direct.intervals["total"].tolist()


def test_the_report_shows_the_convergence_or_says_why_not(elbow, capsys):
    # The stretched elbow fails in some runs: what is left converges all the same.
    kind(elbow, "sobol")
    elbow.write_text(elbow.read_text().replace("n = 32", "n = 64"))
    call(capsys, "run", elbow, "--quiet")
    page = html.unescape(Path("elbow/report.html").read_text())
    assert "3 of 320 runs have status 'limit', first run " in page
    assert "stretched" in page
    found = analysed(elbow, "elbow")
    assert {"convergence-T", "convergence-P"} <= {name for name, *_ in found._catalogue()}
    assert found._not_drawn() == ""
    elbow.write_text(elbow.read_text().replace("n = 64", "n = 16"))
    call(capsys, "run", elbow, "--quiet", "--out", "few")
    found = analysed(elbow, "few")
    assert "convergence-T" not in {name for name, *_ in found._catalogue()}
    count = found.ranking["T"].blocks
    why = f"The convergence of T is not shown: {count} base points are fewer than 32."
    assert why in found._not_drawn()


def analysed(path, folder):
    from ulna._command_study import _execute, collected
    from ulna._study_file import read_study

    file = read_study(path)
    return _execute(file, collected(file, Path(folder)))


def test_runs_that_all_fail_say_why(elbow, capsys):
    model = elbow.parent / "elbow.py"
    model.write_text(MODEL.replace("    if angle", "    boom\n    if angle"))
    why = "64 of 64 runs have status 'raised', first run 0 (k = "
    _, err = call(capsys, "run", elbow, "--quiet", code=cli.BAD_INPUT)
    assert "every run failed" in err and why in err and "NameError: name 'boom'" in err
    kind(elbow, "sample")
    elbow.write_text(elbow.read_text().replace("n = 32", "n = 64").split("[analysis]")[0])
    out, err = call(capsys, "run", elbow, "--quiet", "--out", "sample")
    assert "every run failed" in out and why in out and "NameError: name 'boom'" in out
    assert err == ""


def test_shards_and_merge(elbow, capsys):
    for i in (1, 2):
        out, _ = call(capsys, "run", elbow, "--shard", f"{i}/2", "--out", f"part{i}", code=5)
        assert "screen: 32 of 64 runs are there: run the other shards" in out
    out, _ = call(capsys, "merge", "part1", "part2", "--into", "whole")
    assert "screen: 64 of 64 runs, " in out
    for i in (1, 2):  # the second phase, from the merged first one
        call(capsys, "merge", "whole", "--into", f"part{i}")
        out, _ = call(capsys, "run", elbow, "--shard", f"{i}/2", "--out", f"part{i}", code=5)
        assert "rank: 64 of 128 runs are there" in out
    call(capsys, "merge", "part1", "part2", "--into", "whole")
    out, _ = call(capsys, "analyse", elbow, "--out", "whole", "--json")
    shards = json.loads(out)
    call(capsys, "run", elbow, "--quiet")
    whole = json.loads(Path("elbow/result.json").read_text())
    assert shards["ranking"] == whole["ranking"]
    assert "holds no results" in refused(capsys, "merge", ".", "--into", "w")
    assert "is no folder" in refused(capsys, "merge", "nothing", "--into", "w")


def test_a_budget_of_time(elbow, capsys):
    (elbow.parent / "elbow.py").write_text(MODEL.replace("import os", "import time")
                                           .replace("    if angle", "    time.sleep(0.02)\n    if angle"))  # fmt: skip
    text = STUDY + "\n[budget]\nhours = 1e-4\n"
    elbow.write_text(text)
    out, _ = call(capsys, "run", elbow, "--quiet", code=5)
    assert "the time is up; run this again to go on" in out
    assert "are missing" in refused(capsys, "analyse", elbow)
    elbow.write_text(text.replace("1e-4", "1"))
    call(capsys, "run", elbow, "--quiet")


def test_a_program(elbow, capsys):
    folder = elbow.parent
    (folder / "sim.py").write_text(
        "import json, os, sys\n"
        "x = json.load(sys.stdin)\n"
        "print('working')\n"
        "if x['k'] > 7: os.abort()\n"
        "if x['k'] < 2.3: sys.exit('no equilibrium')\n"
        "print(json.dumps({'T': x['k'] * x['angle'], 'P': x['k']}))\n"
    )
    program = json.dumps([sys.executable, "sim.py"])
    text = STUDY.replace('model = "elbow.py:torque"', f"program = {program}")
    text = text.replace("[design]\nr = 16\nn = 32", '[design]\nkind = "screen"\nr = 4')
    elbow.write_text(text + "\n[run]\ntimeout_s = 20\nworkers = 2\nretries = 0\n")
    call(capsys, "export", elbow, "--to", "X.txt", "--points")
    k, angle, _ = np.loadtxt("X.txt").T
    out, _ = call(capsys, "run", elbow, "--quiet", "--json")
    call(capsys, "export", elbow, "--to", "runs.csv")
    with open("runs.csv", newline="") as stream:
        rows = list(csv.DictReader(stream))
    expected = np.where(k > 7, "crashed", np.where(k < 2.3, "raised", "ok"))
    assert set(expected) == {"crashed", "raised", "ok"}
    assert [row["status"] for row in rows] == expected.tolist()
    good = expected == "ok"
    # What crashed is no gap: the analysis of what is there says the same as the run did.
    again, _ = call(capsys, "analyse", elbow, "--json")
    counts = {word: int(np.sum(expected == word)) for word in ("crashed", "raised")}
    assert json.loads(again)["runs"]["runs"]["failed"] == counts
    assert {**json.loads(again), "report": ""} == {**json.loads(out), "report": ""}
    told, _ = call(capsys, "plan", elbow)
    assert f"16 of 16 runs of runs are done, {sum(counts.values())} failed" in told
    kept = np.array([float(row["T"]) for row in rows])
    assert np.array_equal(kept[good], (k * angle)[good])
    assert {row["message"] for row in rows} <= {
        "", "the program ended with exit status 1: no equilibrium", "the program died of signal 6"
    }  # fmt: skip


def test_words_of_a_program_take_values(elbow, tmp_path):
    from ulna._study_model import ProgramModel

    words = [sys.executable, "-c", "print({k} * 2, {angle})"]
    model = ProgramModel(words, ["k", "angle"], ["T", "P"], tmp_path, None)
    assert model(k=0.1, angle=3.0) == [0.2, 3.0]
    slow = ProgramModel([sys.executable, "-c", "import time; time.sleep(9)"], [], ["T"], tmp_path, 0.2)
    with pytest.raises(st.RunFailed, match="longer than 0.2 s") as caught:
        slow()
    assert caught.value.status == "timeout"
    for said, words in (("", "printed nothing"), ("hello", "no result: hello")):
        silent = ProgramModel([sys.executable, "-c", f"print({said!r})"], [], ["T"], tmp_path, None)
        with pytest.raises(st.RunFailed, match=words):
            silent()


def test_outputs_from_elsewhere(elbow, capsys):
    kind(elbow, "sobol")
    call(capsys, "export", elbow, "--to", "X.txt", "--points")
    k, angle, speed = np.loadtxt("X.txt").T
    np.savetxt("Y.txt", np.column_stack([k * angle + 0.001 * speed, k]))
    out, _ = call(capsys, "analyse", elbow, "--outputs", "Y.txt", "--json")
    assert json.loads(out)["ranking"]["P"]["k"]["first"] == pytest.approx(1, abs=0.2)
    assert "holds 3 x 1 numbers" in refused_table(elbow, capsys, "1\n2\n3\n")
    assert "no table of numbers" in refused_table(elbow, capsys, "one\n")


def refused_table(elbow, capsys, text):
    Path("bad.txt").write_text(text)
    return refused(capsys, "analyse", elbow, "--outputs", "bad.txt")


def test_a_dask_cluster_from_the_command(elbow, capsys):
    pytest.importorskip("distributed")
    from distributed import LocalCluster

    with LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, host="127.0.0.1", dashboard_address=None,
        protocol="tcp",
    ) as cluster:  # fmt: skip
        call(capsys, "run", elbow, "--quiet", "--dask", cluster.scheduler_address)
    there = json.loads(Path("elbow/result.json").read_text())
    call(capsys, "run", elbow, "--quiet", "--out", "here")
    assert there["ranking"] == json.loads(Path("here/result.json").read_text())["ranking"]


# Refusals ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("low = 2\n", "lo = 2\n", "[factors.k] 'lo' means nothing here; did you mean 'low'?"),
        ("low = 2\n", "", "[factors.k] lacks low"),
        ("low = 2\n", "low = 9\n", "[factors.k] high must be above low"),
        ("low = 2\n", 'low = "2"\n', "[factors.k] low is '2', which is no number"),
        ('"normal"', '"gauss"', "must be one of uniform, normal"),
        ("elbow.py:torque", "elbow.py:force", "has no function 'force'"),
        ("elbow.py:torque", "arm.py:torque", "cannot be read"),
        ("elbow.py:torque", "elbow.py", "must be 'file.py:function'"),
        ("elbow.py:torque", "no_such_module:f", "cannot be imported"),
        ("[factors.speed]", "[factors.spede]", "does not take these factors"),
        ("r = 16", "r = 0", "r must be a whole number"),
        ("r = 16", 'kind = "grid"', "must be one of two-phase, sobol"),
        ("r = 16", "rr = 16", "[design] of kind 'two-phase': 'rr'"),
        ("[analysis]", "[analyses]", "did you mean 'analysis'"),
        ("[analysis]", "[budget]\nruns = 100\n[analysis]", "needs up to 224 runs"),
        ("[analysis]", "[budget]\nhours = -1\n[analysis]", "hours must be positive"),
        ("[analysis]", "[run]\nworker = 2\n[analysis]", "did you mean 'workers'"),
        ("[analysis]", '[analysis]\nestimator = "jansson"', "must be one of 'default'"),
        ("[analysis]", "[analysis]\nlevel = 90", "level is 90; it must lie between 0 and 1"),
        ("[analysis]", '[analysis]\nlevel = "high"', "level is 'high'; it must lie between"),
        ("[analysis]", '[analysis]\ninterval = "replicates"', "at least two"),
        ("[analysis]\nresamples = 50", "[analysis]\nresamples = 10", "resamples must be from 50"),
        ("[analysis]", '[run]\non_failure = "drop"\n[analysis]', "must be one of 'error'"),
        ("[analysis]", '[run]\ntimeout_s = "1 min"\n[analysis]', "must be a positive number"),
        ("[analysis]", '[run]\nworkers = 1.5\n[analysis]', "workers is 1.5"),
        ("r = 16", 'r = 16\nkeep = "k"', "keep must be names of factors"),
        ("r = 16", "r = 16\nshare = 7", "share is 7; it must lie between 0 and 1"),
        ("r = 16", 'r = 16\ndecide_by = ["zz"]', "decide_by must be names of outputs"),
        ("r = 16", "r = 16\nfix_at = {qq = 1}", "there is no factor 'qq'"),
        ("r = 16", 'r = 16\nfix_at = {k = "low"}', "k is to be fixed at 'low'"),
        ("r = 16", "r = 16\nguard = -0.3", "guard is -0.3; it must be at least 0"),
        ("r = 16", 'kind = "screen"\nr = 16', "'n' means nothing here"),
        ('outputs = ["T", "P"]', 'outputs = "T"', "outputs must be a list"),
        ('model = "elbow.py:torque"', "program = []", "program must be a list of words"),
        ('model = "elbow.py:torque"', 'program = ["./nothing"]', "cannot be found"),
        ('model = "', 'program = ["ls"]\nmodel = "', "one of them is too many"),
        ("[factors.k]", "[groups]\nx = \"g\"\n[factors.k]", "name no factor: x"),
        ("title =", "title", "is no TOML file"),
    ],
)  # fmt: skip
def test_a_wrong_file_is_refused_with_its_place(elbow, capsys, old, new, words):
    assert STUDY.count(old) >= 1
    elbow.write_text(STUDY.replace(old, new, 1))
    assert words in refused(capsys, "plan", elbow)


@pytest.mark.parametrize(
    ("name", "analysis", "words"),
    [
        ("sobol", 'estimator = "jansson"', "must be one of 'default'"),
        ("sobol", "resamples = 10", "resamples must be from 50"),
        ("screen", "level = 90", "between 0 and 1"),
        ("screen", 'estimator = "janon"', "[analysis] of kind 'screen': 'estimator'"),
        ("sample", "level = 0.9", "[analysis] of kind 'sample': 'level' means nothing here"),
    ],
)
def test_options_of_an_analysis_are_checked_for_each_kind(elbow, capsys, name, analysis, words):
    kind(elbow, name)
    text = elbow.read_text().replace("resamples = 50", analysis)
    elbow.write_text(text.replace("n = 32", "r = 32") if name == "screen" else text)
    assert words in refused(capsys, "plan", elbow)


def test_wrong_commands_are_refused(elbow, capsys):
    assert "No such file" in refused(capsys, "run", "nothing.toml")
    assert "use `ulna study run` first" in refused(capsys, "analyse", elbow)
    assert "use `ulna study run` first" in refused(capsys, "export", elbow, "--to", "x.csv")
    assert "exclude each other" in refused(
        capsys, "run", elbow, "--workers", 2, "--dask", "tcp://127.0.0.1:1"
    )
    assert "is a file" in refused(capsys, "run", elbow, "--out", elbow)
    for shard in ("3/2", "0/2", "1", "a/b"):
        assert "--shard" in refused(capsys, "run", elbow, "--shard", shard)
    call(capsys, "run", elbow, "--quiet")
    assert "name the format" in refused(capsys, "export", elbow, "--to", "x.xlsx")
    # A changed model is another plan: its results are not mixed with the old ones.
    (elbow.parent / "elbow.py").write_text(MODEL + "\n# better\n")
    assert "another plan" in refused(capsys, "run", elbow, "--quiet")


def test_the_file_of_the_documentation_is_right(elbow, capsys):
    page = Path(__file__).resolve().parents[2] / "docs" / "command-line.md"
    (text,) = re.findall(r"^```toml\n(.*?)^```", page.read_text(encoding="utf-8"), re.M | re.S)
    (elbow.parent / "elbow.py").write_text("def torque(k, speed): return k, speed")
    elbow.write_text(text)
    out, _ = call(capsys, "plan", elbow)
    assert "screen: 192 runs" in out and "rank: at most 4096 runs" in out


def test_help_shows_an_example():
    for verb in ((), ("plan",), ("run",), ("analyse",), ("export",), ("merge",)):
        text = subprocess.run(
            [sys.executable, "-m", "ulna.cli", "study", *verb, "--help"],
            capture_output=True, text=True, check=True, env={**os.environ, "COLUMNS": "80"},
        ).stdout  # fmt: skip
        assert "examples:\n  ulna study" in text


# Models --------------------------------------------------------------------------------------------


def ulna_command(*words, code=0):
    """As a shell has it: the real standard output and standard error."""
    done = subprocess.run(
        [sys.executable, "-m", "ulna", *map(str, words)], capture_output=True, text=True
    )
    assert done.returncode == code, done.stderr
    return done.stdout, done.stderr


@pytest.mark.parametrize("workers", [1, 2])
def test_a_printing_model_leaves_the_json_alone(elbow, workers):
    """Printed by Python, past it, by a library's buffer, by a program that the model starts."""
    words = """
import ctypes, subprocess, sys
print("loaded")
def torque(k, angle, speed):
    print("python", flush=True)
    sys.__stdout__.write("past it\\n")
    os.write(1, b"descriptor\\n")
    ctypes.CDLL(None).puts(b"library")
    if k > 7.5: subprocess.run(["echo", "program"], check=True)
"""
    text = MODEL.replace("\ndef torque(k, angle, speed):\n", words)
    (elbow.parent / "elbow.py").write_text(text)
    kind(elbow, "screen", "r = 4\n")
    elbow.write_text(elbow.read_text().replace("n = 32\n", ""))
    out, err = ulna_command(
        "study", "run", elbow, "--json", "--quiet", "--no-figures", "--workers", workers
    )
    assert json.loads(out)["screening"]
    # Within lines: what two processes write at once may share one.
    words = ["loaded", "python", "descriptor", "program"]
    if workers == 1:
        words += ["past it", "library"]
    assert all(word in err for word in words)


def test_an_unfinished_study_prints_no_half_json(elbow, capsys):
    out, err = call(capsys, "run", elbow, "--json", "--shard", "1/2", code=5)
    assert out == "" and "32 of 64 runs are there" in err


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("def torque(:\n", r"SyntaxError: .*, \S*elbow.py line 1\)"),
        ("\n\nraise RuntimeError('no licence')", r"RuntimeError: no licence, \S*elbow.py line 3\)"),
        ("import json\njson.loads('{')", r"JSONDecodeError: .*, \S*elbow.py line 2\)"),
        ("import sys\nsys.exit('later')", r"called sys.exit\('later'\), \S*elbow.py line 2\)"),
        ("import sys\nsys.exit()", r"called sys.exit\(\), \S*elbow.py line 2\)"),
    ],
)
def test_a_model_that_cannot_be_loaded_is_refused(elbow, capsys, text, words):
    (elbow.parent / "elbow.py").write_text(text)
    for verb in ("plan", "run"):
        told = refused(capsys, verb, elbow)
        assert re.search(r"the model cannot be loaded \(" + words, told), told


def test_a_model_that_exits_has_failed(elbow, capsys):
    text = MODEL.replace("    if angle", "    if k > 7: raise SystemExit(0)\n    if angle")
    (elbow.parent / "elbow.py").write_text(text)
    kind(elbow, "sobol")
    out, _ = call(capsys, "run", elbow, "--json", "--quiet")
    assert json.loads(out)["runs"]["runs"]["failed"]["raised"] > 0
    call(capsys, "export", elbow, "--to", "runs.csv")
    with open("runs.csv", newline="") as stream:
        lost = [row for row in csv.DictReader(stream) if row["status"] == "raised"]
    assert {row["message"] for row in lost} == {"called sys.exit(0)"}
    elbow.write_text(elbow.read_text() + '\n[run]\non_failure = "error"\n')
    assert "called sys.exit(0)" in refused(capsys, "run", elbow, "--quiet", "--out", "other")


@pytest.mark.parametrize("workers", [1, 2])
def test_an_error_of_the_model_is_told_with_its_run(elbow, capsys, workers):
    text = MODEL.replace("    if angle", "    raise KeyError('torque')\n    if angle")
    (elbow.parent / "elbow.py").write_text(text)
    elbow.write_text(STUDY + '\n[run]\non_failure = "error"\n')
    told = refused(capsys, "run", elbow, "--quiet", "--workers", workers)
    assert re.search(r"the model raised KeyError: 'torque', in run \d+ of the study, at k = ", told)


def test_a_module_that_changed_is_another_plan(elbow):
    """Also when the function is in another file than the module that is named."""
    package = elbow.parent / "arms"
    package.mkdir()
    (package / "__init__.py").write_text("from .joint import torque\n")
    (package / "joint.py").write_text(MODEL)
    kind(elbow, "sobol")
    elbow.write_text(elbow.read_text().replace("elbow.py:torque", "arms:torque"))
    words = ("study", "run", elbow, "--json", "--quiet", "--no-figures")
    first, _ = ulna_command(*words)
    assert ulna_command(*words)[0] == first
    (package / "joint.py").write_text(MODEL.replace("k * angle +", "k +"))
    _, err = ulna_command(*words, code=cli.BAD_INPUT)
    assert "another plan" in err


def test_every_factor_has_a_place_in_a_programs_words(elbow, capsys):
    for words in (["/bin/sh", "-c", "echo {k} {angle}"], ["/bin/echo", "{k}", "{angle}", "{sped}"]):
        text = STUDY.replace('model = "elbow.py:torque"', f"program = {json.dumps(words)}")
        elbow.write_text(text)
        assert "no place for the factor 'speed': write {speed}" in refused(capsys, "plan", elbow)
    elbow.write_text(text.replace("{sped}", "{speed}"))
    call(capsys, "plan", elbow)
    for words, wrong in ((["{anlge}"], "'{anlge}'"), (["--speed={sped}"], "'--speed={sped}'")):
        program = json.dumps(["/bin/echo", *words])
        elbow.write_text(STUDY.replace('model = "elbow.py:torque"', f"program = {program}"))
        assert f"the program's {wrong} names no factor; did you mean" in refused(capsys, "plan", elbow)
    program = json.dumps(["/bin/echo", "{print}", "{}", "speed={0}"])  # which are none of ours
    elbow.write_text(STUDY.replace('model = "elbow.py:torque"', f"program = {program}"))
    call(capsys, "plan", elbow)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("title =", 'vectorized = "no"\ntitle =', "vectorized is 'no'; it must be true or false"),
        ("[analysis]", '[run]\nisolate = "no"\n[analysis]', "isolate is 'no'; it must be true or"),
    ],
)
def test_switches_are_true_or_false(elbow, capsys, old, new, words):
    elbow.write_text(STUDY.replace(old, new, 1))
    assert words in refused(capsys, "plan", elbow)


def test_the_package_is_the_command():
    assert ulna_command("--version")[0].startswith("ulna ")


# Tables --------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def runs():
    def model(row, b):
        if row > 0.9:
            raise st.RunFailed("diverged", "zu weit: 90 \N{DEGREE SIGN}")
        return {"y/x": row + b, "b": b}

    unit = ulna.Uniform(0, 1)
    study = ulna.Study({"row": unit, "b": unit}, model, outputs=("y/x", "b"))
    return study.run(study.design(n=16, seed=1), on_failure="nearest")


def check_table(runs, table, slash="/"):
    """Every number to the last bit; names that are taken have an underscore."""
    x = runs.design.values()
    assert list(table["row"]) == list(range(64))
    assert list(table["block"]) == [i // 4 for i in range(64)]
    for name, expected in (
        ("row_", x[:, 0]), ("b", x[:, 1]), (f"y{slash}x", runs.y[:, 0]), ("b_", runs.y[:, 1]),
        ("wall_s", runs.wall_s),
    ):  # fmt: skip
        assert np.array_equal(np.asarray(table[name], float), expected, equal_nan=True), name
    lost = runs.status != 0
    assert 0 < lost.sum() < 20
    assert [word == "diverged" for word in table["status"]] == lost.tolist()
    assert {*table["message"]} == {"", "zu weit: 90 \N{DEGREE SIGN}"}


def test_csv(runs, tmp_path):
    with runs.export(tmp_path / "new" / "runs.csv").open(newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    table = {name: [row[name] for row in rows] for name in rows[0]}
    table["row"], table["block"] = map(int, table["row"]), map(int, table["block"])
    check_table(runs, table)


def test_hdf5(runs, tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(runs.export(tmp_path / "runs.h5")) as file:
        table = {name: file[name][()] for name in file}
        assert json.loads(file.attrs["design"])["seed"] == 1
        assert json.loads(file.attrs["factors"]) == ["row", "b"]
    for name in ("status", "message"):
        table[name] = [text.decode() for text in table[name]]
    check_table(runs, table, "_")


def test_netcdf(runs, tmp_path):
    scipy_io = pytest.importorskip("scipy.io")
    path = runs.export(tmp_path / "runs.nc")
    with scipy_io.netcdf_file(path, mmap=False) as file:
        table = {name: variable[:] for name, variable in file.variables.items()}
        assert b"sensitivity study" in file.title
    for name in ("status", "message"):
        table[name] = [b"".join(row).rstrip(b"\0").decode() for row in table[name]]
    check_table(runs, table, "_")


def test_netcdf_is_read_by_its_own_library(runs, tmp_path):
    netcdf = pytest.importorskip("netCDF4")
    with netcdf.Dataset(runs.export(tmp_path / "runs.nc")) as file:
        assert np.array_equal(file["wall_s"][:], runs.wall_s)
        assert file.dimensions["run"].size == 64


def test_parquet(runs, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    table = parquet.read_table(runs.export(tmp_path / "runs.parquet"))
    check_table(runs, table.to_pydict())
    assert json.loads(table.schema.metadata[b"outputs"]) == ["y/x", "b"]


def test_a_failed_export_leaves_the_old_table(runs, tmp_path):
    path = runs.export(tmp_path / "runs.csv")
    before = path.read_bytes()
    broken = st.Runs(runs.design, runs.y, runs.status, runs.wall_s[:5], runs.outputs)
    with pytest.raises(ValueError, match="shorter"):
        broken.export(path)
    assert path.read_bytes() == before and list(tmp_path.iterdir()) == [path]
    with pytest.raises(ulna.ArgumentError, match="name the format"):
        runs.export(tmp_path / "runs")


def test_salib_there_and_back(tmp_path):
    util = pytest.importorskip("SALib.util")
    study = ulna.Study({"a": ulna.Uniform(0, 2), "b": ulna.Normal(1, 3)}, lambda a, b: a * b)
    runs = study.run(study.design(n=16, seed=1))
    problem, x, y = runs.to_salib(tmp_path)
    read = util.read_param_file(str(tmp_path / "params.csv"))
    assert read["names"] == problem["names"] and read["bounds"] == problem["bounds"]
    assert read["dists"] == problem["dists"]
    assert json.loads((tmp_path / "problem.json").read_text()) == problem
    assert np.array_equal(np.loadtxt(tmp_path / "X.txt"), x)
    assert np.array_equal(np.loadtxt(tmp_path / "Y.txt")[:, None], y)
    back = ulna.Study.from_problem(problem).read_outputs(y, x=x)
    assert np.array_equal(back.sobol().total, runs.sobol().total)
    wide = ulna.Study({"a": st.Triangular(0, 1, 3), "b": ulna.Uniform(0, 1)}, lambda a, b: a + b)
    wide.run(wide.design(n=4)).to_salib(tmp_path / "wide")
    assert not (tmp_path / "wide" / "params.csv").exists()
    with pytest.raises(ulna.ArgumentError, match="values of the factors"):
        study.read_outputs(y).to_salib(tmp_path / "none")


# One patient ---------------------------------------------------------------------------------------

SAMPLE = """
model = "arm.py:arm"
outputs = ["K", "K_est"]
[units]
K = "N m/rad"
[factors.k]
low = 2.0
high = 8.0
[factors.mass]
distribution = "normal"
mean = 1.3
deviation = 0.2
unit = "kg"
[design]
kind = "sample"
n = 2048
seed = 1
"""


@pytest.fixture
def arm(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm.py").write_text(
        "def arm(k, mass):\n    return {'K': k, 'K_est': k + 1.3 * (mass - 1.3)}\n"
    )
    path = tmp_path / "arm.toml"
    path.write_text(SAMPLE)
    return path


def test_a_patient(arm, capsys):
    pytest.importorskip("matplotlib")
    call(capsys, "run", arm)
    words = ("patient", arm, "--observed", "K_est=5.0:0.1", "--quantity", "K")
    out, _ = call(capsys, *words)
    assert "K: 5" in out and "N m/rad" in out and "mass" in out
    told = json.loads(Path("arm/patient.json").read_text())
    low, high = told["quantities"]["K"]["interval"]
    # k - 5 = -1.3 (mass - 1.3) + error: a deviation of hypot(0.26, 0.1).
    assert high - low == pytest.approx(2 * 1.645 * np.hypot(0.26, 0.1), rel=0.15)
    assert told["observed"] == {"K_est": [5.0, 0.1]}
    assert told["factors"]["mass"]["mean"] == pytest.approx(1.3, abs=0.05)
    assert list(Path("arm/figures").glob("patient.*"))
    out, _ = call(
        capsys, *words, "--json", "--no-figures", "--level", "0.5", "--measurable", "mass"
    )
    told = json.loads(out)
    assert set(told["quantities"]["K"]["known"]) == {"mass"}
    assert told["level"] == 0.5
    low, high = told["quantities"]["K"]["interval"]
    assert high - low == pytest.approx(2 * 0.6745 * np.hypot(0.26, 0.1), rel=0.15)
    out, _ = call(
        capsys, "patient", arm, "--quantity", "K=0.3", "--quantity", "K_est=K", "--no-figures"
    )
    assert "K_est" in out


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--observed", "K_est"), "is not NAME=VALUE:ERROR"),
        (("--observed", "K_est=5"), "is not NAME=VALUE:ERROR"),
        (("--observed", "K_est=five:0.1"), "is not NAME=VALUE:ERROR"),
        (("--observed", "other=5:0.1"), "observed names no output 'other'"),
        (("--observed", "K_est=5:0"), "standard error above 0"),
        (("--quantity", "K="), "is not NAME or NAME=ERROR"),
        (("--quantity", "other"), "no output 'other'"),
        (("--observed", "K_est=50:0.1"), "standard errors from the closest"),
    ],
)
def test_questions_about_a_patient_that_are_refused(arm, capsys, options, words):
    call(capsys, "run", arm)
    got = cli.main(["study", "patient", str(arm), "--no-figures", *options])
    assert got != cli.OK
    assert words in capsys.readouterr().err


@pytest.mark.parametrize("status", ["crashed", "timeout"])
def test_a_patient_goes_without_what_crashed(arm, capsys, status):
    model = arm.parent / "arm.py"
    model.write_text(
        "from ulna.study import RunFailed\n"
        + model.read_text().replace(
            "    return", f"    if k > 7:\n        raise RunFailed({status!r}, 'stuck')\n    return"
        )
    )
    call(capsys, "run", arm, "--quiet")
    words = ("patient", arm, "--observed", "K_est=5.0:0.1", "--quantity", "K", "--no-figures")
    out, _ = call(capsys, *words)
    assert "K: 5" in out
    call(capsys, "export", arm, "--to", "runs.csv")
    with open("runs.csv", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert {(row["status"], row["message"]) for row in rows} == {("ok", ""), (status, "stuck")}
    assert {row["status"] for row in rows if float(row["k"]) > 7} == {status}


def test_a_patient_needs_runs(arm, capsys, elbow):
    for path, words in ((arm, "holds no runs"), (elbow, "choose kind 'sample' or 'sobol'")):
        assert cli.main(["study", "patient", str(path), "--no-figures"]) != cli.OK
        assert words in capsys.readouterr().err
    assert cli.main(["study", "patient", str(arm), "--level", "2"]) != cli.OK
    assert "no number between 0 and 1" in capsys.readouterr().err


def test_units_of_what_there_is_not(arm, capsys):
    arm.write_text(SAMPLE.replace('K = "N m/rad"', 'L = "N m/rad"'))
    assert cli.main(["study", "plan", str(arm)]) != cli.OK
    assert "[units] must map outputs" in capsys.readouterr().err
