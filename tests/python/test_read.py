"""Reading: formats, maps, drafts, bad input, memory."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import ulna

ANKLE = Path(__file__).parents[2].parent / "shared" / "data" / "ankle"
T = np.arange(500) / 1000
X = 10 * np.sin(9 * T)  # mm
F = np.cos(9 * T)


def csv(rows=zip(T, X, F, strict=True), heading="t_s,x_mm,Fx_N"):
    return "\n".join([heading, *(",".join(f"{v:.9g}" for v in row) for row in rows)]) + "\n"


TABLE = csv()


def test_text_of_each_kind(tmp_path):
    variants = {
        "a.csv": TABLE,
        "a.tsv": TABLE.replace(",", "\t"),
        "b.csv": TABLE.replace(",", ";").replace(".", ","),
        "a.txt": TABLE.replace(",", "  "),
        "units.csv": TABLE.replace("t_s,x_mm,Fx_N", "t,x,Fx\ns,mm,N"),
        "crlf.csv": TABLE.replace("\n", "\r\n"),
    }
    for name, contents in variants.items():
        (tmp_path / name).write_bytes(contents.encode())
        log = ulna.read(tmp_path / name)
        assert [c.name for c in log.channels] == ["x", "F_x"], name
        assert np.allclose(log["x"], X / 1000, rtol=1e-8, atol=1e-12), name
        assert log.rate_hz == pytest.approx(1000, rel=1e-12)
    assert len(ulna.read(TABLE.encode())) == 500
    with (tmp_path / "a.csv").open("rb") as file:
        assert len(ulna.read(file)) == 500


def check_log(log):
    assert np.allclose(log["x"], X / 1000) and np.allclose(log["F_x"], F)
    assert log.rate_hz == pytest.approx(1000, rel=1e-9)


def test_npz(tmp_path):
    np.savez(tmp_path / "a.npz", t=T, x_mm=X, Fx_N=F, mass=3.0)
    check_log(ulna.read(tmp_path / "a.npz"))
    np.savez(tmp_path / "b.npz", t=T, x=X[:-1])
    with pytest.raises(ulna.FormatError, match=r"different lengths \(t: 500; x: 499\)"):
        ulna.read(tmp_path / "b.npz")


def test_matlab(tmp_path):
    scipy_io = pytest.importorskip("scipy.io")
    scipy_io.savemat(tmp_path / "a.mat", {"t": T, "x_mm": X, "Fx": F, "who": "me", "fs": 1000})
    check_log(ulna.read(tmp_path / "a.mat"))
    nested = {"log": {"t": T, "x": {"value": X, "unit": "mm"}, "Fx": F}}
    scipy_io.savemat(tmp_path / "b.mat", nested)
    rules = [{"column": "log.x", "name": "x"}, {"column": "log.Fx", "name": "F_x"}]
    check_log(ulna.read(tmp_path / "b.mat", map={"time": {"column": "log.t"}, "channel": rules}))
    scipy_io.savemat(tmp_path / "c.mat", {"t": T, "p": np.column_stack([X, F])})
    assert [c.name for c in ulna.read(tmp_path / "c.mat").channels] == ["p_1", "p_2"]


def test_names_inside_one_struct_or_group_are_guessed_and_the_draft_reads_back(tmp_path):
    scipy_io = pytest.importorskip("scipy.io")
    h5py = pytest.importorskip("h5py")
    inner = {"time": T, "x": {"value": X, "unit": "mm"}, "F_x": F, "gain": 2.0}
    scipy_io.savemat(tmp_path / "a.mat", {"log": inner, "fs": 1000})
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name, values in (("t", T), ("x_mm", X), ("Fx", F)):
            file["trial1/" + name] = values
    for name in ("a.mat", "a.h5"):
        log = ulna.read(tmp_path / name)
        check_log(log)
        (tmp_path / "map.toml").write_text(ulna.inspect(tmp_path / name).toml())
        again = ulna.read(tmp_path / name, map=tmp_path / "map.toml")
        assert np.array_equal(again.values, log.values)
        kinds = [[(c.name, c.role, c.unit) for c in one.channels] for one in (log, again)]
        assert kinds[0] == kinds[1]
    whole = {"time": {"column": "trial1/t"}, "channel": [
        {"column": "trial1/x_mm", "name": "x"}, {"column": "Fx", "name": "F_x"}]}  # fmt: skip
    check_log(ulna.read(tmp_path / "a.h5", map=whole))


def test_names_of_different_structs_stay_whole(tmp_path):
    np.savez(tmp_path / "a.npz", **{"t": T, "left.x": X, "right.x": X})
    assert [c.name for c in ulna.read(tmp_path / "a.npz").channels] == ["left.x", "right.x"]
    np.savez(tmp_path / "b.npz", **{"t": T, "log.t": T, "log.x": X})  # two clocks without the prefix
    assert "log.x" in ulna.read(tmp_path / "b.npz")


@pytest.mark.parametrize("cmd", ["CmdX", "x_des", "goal_x", "setpoint", "x_target", "DesiredX"])
def test_commands_are_references(cmd):
    log = ulna.read(csv(zip(T, X, F, X, strict=True), f"t_s,x_mm,Fx_N,{cmd}").encode())
    assert [(c.name, c.role) for c in log.channels][2] == ("x_ref", "reference")


@pytest.mark.parametrize("name", ["nodes", "prefer", "cmdF", "vel_des"])
def test_other_names_are_no_references(name):
    log = ulna.read(csv(zip(T, X, F, X, strict=True), f"t_s,x_mm,Fx_N,{name}").encode())
    assert log.channels[2].role == "other"


def test_hdf5_and_matlab_73(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["t"] = T
        file["x"] = X
        file["x"].attrs["unit"] = "mm"
        file["Fx"] = F
    check_log(ulna.read(tmp_path / "a.h5"))
    with h5py.File(tmp_path / "b.mat", "w", userblock_size=512) as file:
        for name, values in (("t", T), ("x_mm", X), ("Fx", F)):
            file[name] = values.reshape(1, -1)
    with (tmp_path / "b.mat").open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(512))
    check_log(ulna.read(tmp_path / "b.mat"))


@pytest.mark.parametrize("name", ["a.mat", "a.npz", "a.h5"])
def test_damaged_files_are_refused(tmp_path, name):
    if name != "a.npz":
        pytest.importorskip("scipy")
        pytest.importorskip("h5py")
    for contents in (b"", b"not a table", b"\x89HDF\r\n\x1a\n" + bytes(100), b"PK\x03\x04" + bytes(50)):
        (tmp_path / name).write_bytes(contents)
        with pytest.raises((ulna.FormatError, ulna.FileError)):
            ulna.read(tmp_path / name)


MAP = """
[file]
delimiter = ","
header = true

[time]
column = "clock"
unit = "ms"

[[channel]]
column = "enc"
name = "x"
role = "position"
unit = "mm"

[[channel]]
column = "Fraw"
name = "F_x"
role = "force"
axis = "x"
unit = "N"
sign = -1
frame = "base"
"""


def test_map(tmp_path):
    (tmp_path / "a.csv").write_text(csv(zip(1000 * T, X, -F, T, strict=True), "clock,enc,Fraw,more"))
    (tmp_path / "map.toml").write_text(MAP)
    log = ulna.read(tmp_path / "a.csv", map=tmp_path / "map.toml")
    assert np.allclose(log["x"], X / 1000) and np.allclose(log["F_x"], F)
    force = log.channels[1]
    assert (force.sign, force.frame, force.source_name, force.role) == (-1, "base", "Fraw", "force")
    assert log.channels[2].name == "more" and log.channels[2].role == "other"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("sign = -1", "sgn = -1"), r"line 22 of map.toml: \[\[channel\]\] has no key 'sgn'"),
        (("sign = -1", "sign = 2"), "sign must be 1 or -1"),
        (('role = "force"', 'role = "push"'), "role 'push' is none of"),
        (('axis = "x"', 'axis = "w"'), "axis must be"),
        (("[time]", "[tiem]"), "line 6 of map.toml: a map has no key 'tiem'"),
        (("header = true", 'header = "yes"'), "header must be true or false"),
        (('delimiter = ","', 'delimiter = ",,"'), "delimiter must be one character"),
        (("[file]", "[file"), "no TOML"),
        (('column = "enc"', 'column = "encoder"'), 'no column "encoder"'),
        (('column = "enc"\n', ""), "needs its column"),
        (("[file]", "rate_hz = -1\n[file]"), "rate_hz must be positive"),
        (('unit = "N"', 'unit = "lbf"'), 'unknown unit "lbf"'),
        (('column = "enc"', 'column = "clock"'), r"line 6 .*remove its \[\[channel\]\] table"),
    ],
)
def test_wrong_maps_are_refused_with_their_place(tmp_path, change, message):
    assert change[0] in MAP
    (tmp_path / "a.csv").write_text(csv(zip(1000 * T, X, F, strict=True), "clock,enc,Fraw"))
    (tmp_path / "map.toml").write_text(MAP.replace(*change, 1))
    with pytest.raises((ulna.FormatError, ulna.ArgumentError), match=message):
        ulna.read(tmp_path / "a.csv", map=tmp_path / "map.toml")


def test_absent_map(tmp_path):
    with pytest.raises(ulna.FileError, match="no.toml"):
        ulna.read(TABLE.encode(), map=tmp_path / "no.toml")


@pytest.mark.parametrize(
    "contents",
    [
        TABLE,
        TABLE.replace(",", ";").replace(".", ","),
        csv(zip(T, X, F, strict=True), "t [s],w [furlong],M [Nm]"),
        csv(zip(T, X, F, strict=True), "Time (s),q_1_deg,tau"),
    ],
)
def test_drafted_map_reads_back_to_the_same_record(tmp_path, contents):
    (tmp_path / "a.csv").write_text(contents)
    found = ulna.inspect(tmp_path / "a.csv")
    (tmp_path / "map.toml").write_text(found.toml())
    log, again = found.record, ulna.read(tmp_path / "a.csv", map=tmp_path / "map.toml")
    assert np.array_equal(log.values, again.values) and np.array_equal(log.time, again.time)
    assert [(c.name, c.role, c.axis, c.unit) for c in log.channels] == [
        (c.name, c.role, c.axis, c.unit) for c in again.channels
    ]


def test_inspect_without_a_clock():
    found = ulna.inspect(b"a,b\n1,2\n3,4\n")
    assert found.rate_is_missing and found.columns == ("a", "b")
    assert "rate_hz" in found.toml() and "no column looks like time" in found.summary()


def test_several_files_are_trials(tmp_path):
    for name in ("1.csv", "2.csv"):
        (tmp_path / name).write_text(TABLE)
    (tmp_path / "notes.md").write_text("not a recording")
    for source in (tmp_path, [tmp_path / "1.csv", tmp_path / "2.csv"]):
        log = ulna.read(source)
        assert len(log.trials) == 2 and len(log) == 1000
    (tmp_path / "3.csv").write_text(TABLE.replace("x_mm", "y_mm"))
    with pytest.raises(ulna.DataError, match=r"3\.csv: it has other channels than .*1\.csv"):
        ulna.read(tmp_path)
    (tmp_path / "3.csv").write_text("t,x,F\n0,1,2\n1,abc,3\n2,3,4\n")
    with pytest.raises(ulna.FormatError, match=r"3\.csv: .*abc") as caught:
        ulna.read(tmp_path)
    assert caught.value.status == "ULNA_ERROR_FORMAT" and "row 1" in caught.value.detail
    assert len(ulna.read([tmp_path / "1.csv", tmp_path / "2.csv"]).trials) == 2
    (tmp_path / "empty").mkdir()
    with pytest.raises(ulna.FileError, match="holds no recording"):
        ulna.read(tmp_path / "empty")


@pytest.mark.parametrize(
    ("contents", "kind", "message"),
    [
        (b"", ulna.FormatError, "empty"),
        (bytes(range(256)) * 4, ulna.FormatError, "binary"),
        (b"t,x,F_x\n", ulna.FormatError, "no rows of data"),
        (b"t:x:F\n0:1:2\n", ulna.FormatError, "one column|no row of numbers"),
        (b"t,x,x\n0,1,2\n1,2,3\n", ulna.FormatError, "both named"),
        (b"t,x,F\n0,1,2\n1,2\n2,3,4\n", ulna.FormatError, "line 3 has 2 cells"),
        (b"t,x,F\n0,1,2\n1,abc,3\n2,3,4\n", ulna.FormatError, "abc"),
        (b"t,x,F\n0,1,2\n2,2,3\n1,3,4\n", ulna.DataError, "line 4.*goes back"),
        (b"x,F\n0,1\n2,2\n", ulna.ArgumentError, "no column is called time"),
    ],
)
def test_bad_text_is_refused_in_one_sentence(contents, kind, message):
    with pytest.raises(kind, match=message) as caught:
        ulna.read(contents)
    assert "\n" not in str(caught.value)


def test_absent_file_and_unknown_format(tmp_path):
    for name in ("no.csv", "no.mat", "no.npz"):
        with pytest.raises(ulna.FileError, match=name):
            ulna.read(tmp_path / name)
    with pytest.raises(ulna.ArgumentError, match="xls"):
        ulna.read(TABLE.encode(), format="xls")


def codes(time, x, f, **keywords):
    log = ulna.Record.from_arrays(time, {"x": x, "F_x": f}, **keywords)
    return {(finding.code, finding.channel) for finding in log.findings}


def test_suspicions_are_voiced():
    assert ("unit", "x") in codes(T, X, F)  # mm taken for m
    assert ("unit", "x") in codes(T, X, F, units={"x": "rad"})  # degrees taken for rad
    assert ("unit", "x") in codes(T, 1e-6 * X, F, units={"x": "mm"})  # m taken for mm
    assert ("zero", "F_x") in codes(T, 1e-3 * X, 0 * F)
    assert ("short", "") in codes(T[:10], 1e-3 * X[:10], F[:10])
    assert ("constant", "x") in codes(T, 0 * X + 1, F)


def test_truncated_last_line_is_said():
    log = ulna.read(TABLE[:-12].encode())
    assert len(log) == 499
    assert "truncated" in {f.code for f in log.findings}


def test_ankle_recordings():
    if not ANKLE.exists():
        pytest.skip("the ankle recordings are absent")
    log = ulna.read(sorted(ANKLE.glob("ankle-*.csv")))
    assert len(log.trials) == 3 and log.rate_hz == 1000
    assert [(c.name, c.unit, c.role) for c in log.channels] == [
        ("position", "rad", "position"),
        ("torque", "Nm", "force"),
    ]


# The high-water mark of this program alone; getrusage would inherit that of the parent.
MEASURE = """
import sys
import ulna

def peak():
    with open("/proc/self/status") as status:
        return next(int(line.split()[1]) for line in status if line.startswith("VmHWM"))

ulna.read(b"t,x\\n0,1\\n1,2\\n")
before = peak()
log = ulna.read(sys.argv[1])
print(len(log), peak() - before)
"""


@pytest.mark.parametrize("megabytes", [20, pytest.param(200, marks=pytest.mark.slow)])
def test_memory_stays_below_three_files(tmp_path, megabytes):
    block = "".join(f"%d.{i:03d},{i % 97}.0625,-{i}.5\n" for i in range(1000))
    path, rows = tmp_path / "large.csv", 0
    with path.open("w") as file:
        file.write("time_s,x_m,F_x_N\n")
        while file.tell() < megabytes * 1_000_000:
            file.write(block.replace("%d", str(rows // 1000)))
            rows += 1000
    done = subprocess.run(
        [sys.executable, "-c", MEASURE, str(path)], capture_output=True, text=True, check=True
    )
    read, growth_kib = map(int, done.stdout.split())
    assert read == rows
    assert growth_kib * 1024 < 3 * path.stat().st_size, f"{growth_kib} KiB"
    # Two columns of doubles and the clock are at least a quarter of it: the measure works.
    assert growth_kib * 1024 > 0.25 * path.stat().st_size
