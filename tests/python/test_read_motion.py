"""Motion-capture files: written here, read back, and spoiled in every way a laboratory finds."""

import re
import struct

import numpy as np
import pytest

import ulna
from ulna.io import read_suit

SEGMENTS = ("Pelvis", "T8", "RightUpperArm")
SENSORS = ("Pelvis", "T8")
JOINTS = ("jL5S1", "jRightShoulder")


def mvnx(frames=40, *, rate=60.0, lost=(), first=0, extra="", stamp_rate=None, spoil=None):
    """An MVNX file of a slow motion, with the signals that it holds."""
    rng = np.random.default_rng(3)
    signals = {
        "orientation": rng.normal(size=(frames, 4 * len(SEGMENTS))),
        "position": rng.normal(size=(frames, 3 * len(SEGMENTS))),
        "sensorFreeAcceleration": rng.normal(size=(frames, 3 * len(SENSORS))),
        "jointAngle": 90 * rng.normal(size=(frames, 3 * len(JOINTS))),
        "centerOfMass": rng.normal(size=(frames, 9)),
    }
    segments = "".join(
        f'<segment label="{label}" id="{i + 1}"><points><point label="pOrigin"><pos_b>{i} 0 0.5</pos_b>'
        "</point></points></segment>"
        for i, label in enumerate(SEGMENTS)
    )
    sensors = "".join(f'<sensor label="{label}"/>' for label in SENSORS)
    joints = "".join(
        f'<joint label="{label}"><connector1>Pelvis/{label}</connector1>'
        f"<connector2>T8/{label}</connector2></joint>"
        for label in JOINTS
    )
    pose = " ".join(["1 0 0 0"] * len(SEGMENTS))
    places = " ".join(["0 0 1"] * len(SEGMENTS))
    body = [
        f'<frame time="0" index="" type="tpose"><orientation>{pose}</orientation>'
        f"<position>{places}</position></frame>"
    ]
    for row in range(frames):
        if row in lost:
            continue
        stamp = round(1000 * row / (stamp_rate or rate))
        items = "".join(
            f"<{name}>{' '.join(repr(float(v)) for v in values[row])}</{name}>"
            for name, values in signals.items()
        )
        body.append(f'<frame time="{stamp}" index="{first + row}" type="normal">{items}</frame>\n')
    text = (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        '<mvnx version="4" xmlns="http://www.xsens.com/mvn/mvnx"><mvn version="2022"/>'
        f'<subject label="S" frameRate="{rate:g}" segmentCount="3"><segments>{segments}</segments>'
        f"<sensors>{sensors}</sensors><joints>{joints}</joints>{extra}"
        f'<frames segmentCount="3">{"".join(body)}</frames></subject></mvnx>\n'
    )
    if spoil:
        text = spoil(text)
    return text.encode(), signals


def test_mvnx_gives_every_signal_with_unit_and_frame():
    data, signals = mvnx()
    log = ulna.read(data, format="mvnx")
    units = {channel.name: (channel.unit, channel.frame) for channel in log.channels}
    assert log.rate_hz == pytest.approx(60, rel=1e-9)
    assert units["Pelvis_qw"] == ("1", "segment to global")
    assert units["T8_position_z"] == ("m", "global, z up")
    assert units["T8_free_acceleration_x"][0] == "m/s^2"
    assert units["jRightShoulder_angle_z"] == ("rad", "ZXY")
    np.testing.assert_array_equal(log["RightUpperArm_qz"], signals["orientation"][:, 11])
    np.testing.assert_array_equal(log["T8_position_y"], signals["position"][:, 4])
    np.testing.assert_array_equal(
        log["jRightShoulder_angle_x"], signals["jointAngle"][:, 3] * (np.pi / 180)
    )
    np.testing.assert_array_equal(log["center_of_mass_z"], signals["centerOfMass"][:, 2])
    assert set(channel.role for channel in log.channels) == {"other"}


def test_mvnx_tells_the_person_and_the_poses():
    suit = read_suit(mvnx()[0])
    assert suit.segments == SEGMENTS and suit.sensors == SENSORS and suit.joints == JOINTS
    assert suit.connections["jL5S1"] == ("Pelvis/jL5S1", "T8/jL5S1")
    np.testing.assert_array_equal(suit.points_m["T8/pOrigin"], [1, 0, 0.5])
    orientations, positions = suit.poses["tpose"]
    assert orientations.shape == (3, 4) and positions.shape == (3, 3)
    assert "3 segments" in repr(suit)


def test_mvnx_keeps_lost_frames_as_a_gap():
    data, signals = mvnx(frames=60, lost=(20, 21, 22), first=100)
    log = ulna.read(data)
    assert len(log) == 57
    steps = np.diff(log.time) * 60
    assert steps[19] == pytest.approx(4)
    assert np.delete(steps, 19) == pytest.approx(np.ones(55))
    assert any(finding.code == "gap" for finding in log.findings)
    np.testing.assert_array_equal(log["Pelvis_qw"][20], signals["orientation"][23, 0])


def test_mvnx_keeps_a_missing_element_as_missing():
    def spoil(text):
        at = [i for i in range(len(text)) if text.startswith("<position>", i)][5]
        end = text.index("</position>", at) + len("</position>")
        return text[:at] + text[end:]

    log = ulna.read(mvnx(spoil=spoil)[0])
    missing = np.isnan(log["Pelvis_position_x"])
    assert missing.sum() == 1 and missing[4]  # the T-pose has the first one
    assert not np.isnan(log["Pelvis_qw"]).any()


def test_mvnx_is_the_same_however_its_bytes_are_cut(monkeypatch):
    data = mvnx(frames=40)[0]
    whole = ulna.read(data).values.copy()
    for count in (60, 501, 4096, len(data) - 1):
        monkeypatch.setattr("ulna._read_mvnx._CHUNK", count)
        np.testing.assert_array_equal(ulna.read(data).values, whole)
    # An element that begins late or ends early is missing elsewhere.
    parts = data.split(b"<frame ")
    for begin, end in ((2, 20), (30, 42)):
        cut = [re.sub(rb"<centerOfMass>.*</centerOfMass>", b"", part) for part in parts[begin:end]]
        log = ulna.read(b"<frame ".join([*parts[:begin], *cut, *parts[end:]]))
        missing = np.flatnonzero(np.isnan(log["center_of_mass_x"]))
        assert missing.tolist() == list(range(begin - 2, min(end, 42) - 2))
        np.testing.assert_array_equal(log["Pelvis_qw"], whole[:, 0])


def test_mvnx_reads_only_the_signals_that_are_asked_for():
    data, _ = mvnx()
    log = ulna.read(data, signals=["jointAngle", "position"])
    assert len(log.channels) == 3 * (len(JOINTS) + len(SEGMENTS))
    np.testing.assert_array_equal(log["T8_position_y"], ulna.read(data)["T8_position_y"])
    for wrong in (["orientations"], [], "orientation"):
        with pytest.raises(ulna.ArgumentError, match="it must name some of orientation, position"):
            ulna.read(data, signals=wrong)
    with pytest.raises(ulna.ArgumentError, match="only an MVNX file has signals"):
        ulna.read(b"t,x\n0,1\n1,2\n", signals=["position"])
    with pytest.raises(ulna.FormatError, match="holds no signals"):
        ulna.read(data, signals=["sensorAcceleration"])


def test_mvnx_may_have_comments_prefixes_and_other_elements():
    data, _ = mvnx(frames=5)
    whole = ulna.read(data).values
    changed = re.sub(rb"<(/?)frame", rb"<\1x:frame", data)
    changed = changed.replace(b"<subject ", b"<!-- <frames> --><subject ", 1)
    changed = changed.replace(b"<orientation>", b"<a b='>'><c/>1 2<!-- > --></a><orientation>")
    changed = changed.replace(b"<mvnx ", b'<mvnx xmlns:x="http://www.xsens.com/mvn/mvnx" ', 1)
    np.testing.assert_array_equal(ulna.read(changed).values, whole)


@pytest.mark.parametrize(
    ("spoil", "line"),
    [
        (lambda t: t.replace("</subject>", "", 1), 42),  # behind the frames
        (lambda t: t.replace('index="30"', "index=30"), 32),  # within
        (lambda t: t.replace("<sensors>", "<sensors", 1), 2),  # before
        (lambda t: t[: t.index('index="30"')], 32),  # it ends there
    ],
)
def test_a_damaged_mvnx_is_refused_with_its_line(spoil, line):
    with pytest.raises(ulna.FormatError, match=rf"damaged at line {line} ") as caught:
        ulna.read(mvnx(spoil=spoil)[0], format="mvnx")
    assert caught.value.detail == f"line {line}"


def test_an_mvnx_in_another_encoding_or_with_frames_twice_is_refused():
    data, _ = mvnx(frames=3)
    wide = data.decode().replace("UTF-8", "UTF-16").encode("utf-16")
    with pytest.raises(ulna.FormatError, match="not written in UTF-8"):
        ulna.read(wide, format="mvnx")
    frames = data[data.index(b"<frames") : data.index(b"</frames>") + len(b"</frames>")]
    with pytest.raises(ulna.FormatError, match="not written in UTF-8|twice"):
        ulna.read(data.replace(frames, 2 * frames), format="mvnx")


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda t: t[: len(t) // 2], "breaks off or is damaged at line"),
        (lambda t: t.replace("</frames>", ""), "breaks off or is damaged"),
        (lambda t: t.replace('frameRate="60"', ""), "frameRate"),
        (lambda t: t.replace('frameRate="60"', 'frameRate="-1"'), "frameRate"),
        (lambda t: t.replace('<segment label="T8"', "<segment"), "do not|need 8|does not fit"),
        (lambda t: t.replace('index="7"', 'index="6"'), "in order"),
        (lambda t: t.replace('index="7"', 'index="x"'), "no number"),
        (lambda t: t.replace("<jointAngle>", "<jointAngle>abc ", 1), "no number"),
        (lambda t: t.replace("<jointAngle>", "<jointAngle>1 ", 1), "numbers"),
        (lambda t: t.replace('type="normal"', 'type="tpose"'), "no frames"),
        (lambda t: t.replace("<mvnx ", '<!DOCTYPE a [<!ENTITY b "c">]><mvnx '), "document type"),
        (lambda t: "<?xml version='1.0'?><other/>", "no MVNX"),
    ],
)
def test_a_spoiled_mvnx_is_refused_in_words(spoil, words):
    with pytest.raises(ulna.FormatError, match=words):
        ulna.read(mvnx(spoil=spoil)[0], format="mvnx")


def test_mvnx_with_a_wrong_frame_rate_is_found_by_its_stamps():
    with pytest.raises(ulna.FormatError, match="60 frames a second, but its time stamps say 120"):
        ulna.read(mvnx(stamp_rate=120.0)[0])


# OpenSim ------------------------------------------------------------------------------------------


def mot(values, names, *, degrees="yes", title="Coordinates", rows=None, columns=None, end=True):
    table = np.asarray(values, dtype=float)
    lines = [title, "version=1"]
    lines += [f"nRows={table.shape[0] if rows is None else rows}"]
    lines += [f"nColumns={table.shape[1] if columns is None else columns}"]
    lines += [f"inDegrees={degrees}"] if degrees else []
    lines += ["endheader"] if end else []
    lines.append("\t".join(names))
    lines += ["\t".join(repr(float(v)) for v in row) for row in table]
    return ("\n".join(lines) + "\n").encode()


def angles(rows=50):
    t = np.arange(rows) / 100
    return np.column_stack([t, 30 * np.sin(t), 0.9 + 0 * t, 100 * t])


NAMES = ["time", "hip_flexion_r", "pelvis_ty", "knee_angle_r"]


def test_mot_in_degrees_and_in_radians_is_the_same_motion():
    table = angles()
    log = ulna.read(mot(table, NAMES), format="mot")
    assert [c.unit for c in log.channels] == ["rad", "m", "rad"]
    np.testing.assert_allclose(log["hip_flexion_r"], np.deg2rad(table[:, 1]), rtol=1e-15)
    np.testing.assert_array_equal(log["pelvis_ty"], table[:, 2])
    other = table.copy()
    other[:, [1, 3]] = np.deg2rad(other[:, [1, 3]])
    again = ulna.read(mot(other, NAMES, degrees="no"), format="mot")
    np.testing.assert_allclose(again.values, log.values, rtol=1e-15)
    assert log.channels[0].frame == "ground"


def test_mot_with_degrees_under_a_header_of_radians_is_refused():
    table = angles()
    with pytest.raises(ulna.FormatError, match="hip_flexion_r reaches 14.1"):
        ulna.read(mot(table, NAMES, degrees="no"), format="mot")


def test_ground_reactions_have_the_units_of_their_names():
    names = ["time", "1_ground_force_vx", "ground_force_px", "1_ground_torque_z", "hip_moment"]
    table = np.column_stack([np.arange(20) / 100, *np.random.default_rng(1).normal(size=(4, 20))])
    log = ulna.read(mot(table, names, title="name forces.mot"), format="mot")
    assert [c.unit for c in log.channels] == ["N", "m", "Nm", "Nm"]


def test_sto_of_version_3_with_vectors(tmp_path):
    text = "DataType=Vec3\nversion=3\nOpenSimVersion=4.5\nendheader\ntime\tT8\tPelvis\n"
    text += "".join(f"{i / 10}\t{i},2,3\t4,5,{-i}\n" for i in range(12))
    path = tmp_path / "a.sto"
    path.write_text(text)
    log = ulna.read(path)
    assert [c.name for c in log.channels][:3] == ["T8_1", "T8_2", "T8_3"]
    np.testing.assert_array_equal(log["Pelvis_3"], -np.arange(12.0))


def test_missing_values_stay_missing():
    table = angles()
    table[7, 3] = np.nan
    log = ulna.read(mot(table, NAMES), format="mot")
    assert np.flatnonzero(np.isnan(log["knee_angle_r"])).tolist() == [7]


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (mot(angles(), NAMES, rows=60), "50 rows, but its header says 60: it was cut off"),
        (mot(angles(), NAMES, rows=40), "header is of another file"),
        (mot(angles(), NAMES, columns=5), "4 columns, but its header says 5"),
        (mot(angles(), NAMES, end=False), "endheader"),
        (mot(angles(), NAMES, degrees=""), "inDegrees"),
        (mot(angles(), ["x", *NAMES[1:]]), "must be time"),
        (mot(angles(), ["time", "a", "a", "b"]), "two columns named 'a'"),
        (mot(angles(), NAMES)[:-9], "line 57 .* was cut off|rows, but"),
        (mot(angles(), NAMES).replace(b"0.9", b"abc", 1), "line 8 .*'abc'"),
        (mot(angles(), NAMES).replace(b"nRows=50", b"nRows=?"), "no number"),
        (b"Coordinates\nendheader\n", "ends after its header"),
        (b"\0\1\2", "zero bytes"),
    ],
)
def test_a_spoiled_mot_is_refused_in_words(data, words):
    with pytest.raises(ulna.FormatError, match=words):
        ulna.read(data, format="mot")


def trc(frames=30, *, unit="mm", names=("R.ASIS", "L.ASIS"), hole=None):
    rng = np.random.default_rng(2)
    places = 1000 * rng.normal(size=(frames, 3 * len(names)))
    lines = [
        "PathFileType\t4\t(X/Y/Z)\ta.trc",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"100\t100\t{frames}\t{len(names)}\t{unit}\t100\t1\t{frames}",
        "Frame#\tTime\t" + "\t\t\t".join(names) + "\t\t",
        "\t\t" + "\t".join(f"{axis}{i + 1}" for i in range(len(names)) for axis in "XYZ"),
        "",
    ]
    for row in range(frames):
        cells = [repr(float(v)) for v in places[row]]
        if row == hole:
            cells[3:6] = ["", "", ""]
        lines.append("\t".join([str(row + 1), repr(row / 100), *cells]))
    return "\n".join(lines).encode(), places


def test_trc_gives_markers_in_metres_and_keeps_holes():
    data, places = trc(hole=4)
    log = ulna.read(data)
    assert log.channels[0].name == "R.ASIS_x" and log.channels[0].unit == "m"
    np.testing.assert_allclose(log["R.ASIS_y"], places[:, 1] / 1000, rtol=1e-15)
    assert np.flatnonzero(np.isnan(log["L.ASIS_z"])).tolist() == [4]
    assert log.rate_hz == pytest.approx(100)


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda d: d[: len(d) // 2], "cut off"),
        (lambda d: d.replace(b"\tmm\t", b"\tinch\t"), "'inch'"),
        (lambda d: d.replace(b"NumMarkers", b"Markers"), "no NumMarkers"),
        (lambda d: d.replace(b"\t2\tmm", b"\t3\tmm"), "2 markers, but its header says 3"),
        (lambda d: d.replace(b"Frame#", b"Frame"), "Frame#"),
        (lambda d: d.replace(b"PathFileType", b"Path"), "PathFileType"),
        (lambda d: b"PathFileType\t4\n", "PathFileType|cut off"),
    ],
)
def test_a_spoiled_trc_is_refused_in_words(spoil, words):
    with pytest.raises(ulna.FormatError, match=words):
        ulna.read(spoil(trc()[0]), format="trc")


# C3D ----------------------------------------------------------------------------------------------

LENGTH, WIDTH = 0.6, 0.4


def c3d(tmp_path, *, points=4, frames=20, ratio=10, kind=2, reaction=False, turn=0.0, wrench=None,
        unit="mm", moment_unit="Nmm", lose=None, tilt=False):  # fmt: skip
    """A file with one plate whose wrench on the person at its surface is known, in m, N, Nm."""
    ezc3d = pytest.importorskip("ezc3d")
    file = ezc3d.c3d()
    scale = {"mm": 1000.0, "m": 1.0}[unit]
    rng = np.random.default_rng(5)
    places = rng.normal(size=(3, points, frames))
    file["parameters"]["POINT"]["RATE"]["value"] = [100.0]
    file["parameters"]["POINT"]["UNITS"]["value"] = [unit]
    file["parameters"]["POINT"]["LABELS"]["value"] = [f"M{i + 1}" for i in range(points)]
    data = np.ones((4, points, frames))
    data[:3] = scale * places
    residuals = np.zeros((1, points, frames))
    if lose is not None:
        data[:3, lose[0], lose[1]] = np.nan
        residuals[0, lose[0], lose[1]] = -1
    file["data"]["points"] = data
    file["data"]["meta_points"] = {
        "residuals": residuals,
        "camera_masks": np.zeros((7, points, frames), dtype=bool),
    }
    n = frames * ratio
    t = np.arange(n) / n
    # On the person, laboratory axes: 700 N up, a push to the side, a moving centre of pressure.
    if wrench is None:
        force = np.stack([20 * np.sin(9 * t), 10 * np.cos(7 * t), 700 + 50 * np.sin(5 * t)])
        cop = np.stack([0.1 * np.sin(3 * t), 0.05 * np.cos(4 * t), 0 * t])
    else:
        force, cop = wrench(t)
    c, s = np.cos(turn), np.sin(turn)
    # Plate axes: z down, as makers build them.
    axes = np.array([[c, s, 0], [s, -c, 0], [0, 0, -1.0]]).T
    middle = np.array([1.0, 2.0, 0.0])
    corners = np.stack(
        [
            middle + axes @ np.array([a * LENGTH / 2, b * WIDTH / 2, 0])
            for a, b in ((1, 1), (-1, 1), (-1, -1), (1, -1))
        ],
        axis=1,
    )
    free = np.stack([0 * t, 0 * t, 3 * np.sin(t)])
    moment = np.cross(cop, force, axis=0) + free  # about the middle, laboratory axes
    sign = 1 if reaction else -1
    inside_force = sign * axes.T @ force
    inside_moment = sign * axes.T @ moment
    origin = np.array([0.002, -0.003, -0.04])  # sensors' origin to surface, plate axes
    m_unit = {"Nmm": 1000.0, "Nm": 1.0}[moment_unit]
    at_sensors = inside_moment + np.cross(origin[:, None], inside_force, axis=0)
    if kind in (2, 4):
        channels = np.concatenate([inside_force, m_unit * at_sensors])
        units = ["N"] * 3 + [moment_unit] * 3
    elif kind == 1:
        px = -inside_moment[1] / inside_force[2]
        py = inside_moment[0] / inside_force[2]
        tz = inside_moment[2] - (px * inside_force[1] - py * inside_force[0])
        channels = np.concatenate([inside_force, scale * np.stack([px, py]), m_unit * tz[None]])
        units = ["N"] * 3 + [unit] * 2 + [moment_unit]
    else:
        raise AssertionError(kind)
    matrix = np.eye(6)
    if kind == 4:
        matrix = rng.normal(size=(6, 6)) + 5 * np.eye(6)
        # The matrix gives N and N times the unit of length.
        goal = np.concatenate([inside_force, scale * at_sensors])
        channels = np.linalg.solve(matrix, goal)
        units = ["V"] * 6
    other = np.sin(20 * t)
    values = np.concatenate([channels, other[None]])
    file["data"]["analogs"] = values[None]
    analog = file["parameters"]["ANALOG"]
    analog["RATE"]["value"] = [100.0 * ratio]
    analog["LABELS"]["value"] = ["Fx1", "Fy1", "Fz1", "Mx1", "My1", "Mz1", "EMG"]
    analog["UNITS"]["value"] = [*units, "mV"]
    plate = file["parameters"]["FORCE_PLATFORM"]
    plate["USED"]["value"] = [1]
    plate["TYPE"]["value"] = [kind]
    plate["ZERO"]["value"] = [1, 0]
    plate["CORNERS"]["value"] = scale * corners[..., None]
    plate["ORIGIN"]["value"] = scale * origin[:, None]
    plate["CHANNEL"]["value"] = np.arange(1, 7)[:, None]
    if kind == 4:
        plate["CAL_MATRIX"]["value"] = matrix[..., None]
    path = tmp_path / "trial.c3d"
    file.write(str(path))
    lab_moment = moment + np.cross(middle[:, None], force, axis=0)
    return path, {"places": places, "force": force, "moment": lab_moment, "cop": middle[:, None] + cop,
                  "free": free, "other": other}  # fmt: skip


@pytest.mark.parametrize("kind", [1, 2, 4])
@pytest.mark.parametrize("reaction", [False, True])
@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_a_plate_gives_the_wrench_on_the_person(tmp_path, kind, reaction, turn):
    path, truth = c3d(tmp_path, kind=kind, reaction=reaction, turn=turn)
    log = ulna.read(path, part="analog")
    assert log.rate_hz == pytest.approx(1000)
    for at, axis in enumerate("xyz"):
        # C3D holds single precision: 700 N to 3e-5, and the moments of 2 m lever arms; a calibration
        # matrix mixes forces with moments of 3e4 Nmm.
        fine = 1e-2 if kind == 4 else 2e-3
        np.testing.assert_allclose(log[f"plate1_F_{axis}"], truth["force"][at], atol=fine)
        np.testing.assert_allclose(log[f"plate1_M_{axis}"], truth["moment"][at], atol=5 * fine)
        np.testing.assert_allclose(log[f"plate1_cop_{axis}"], truth["cop"][at], atol=1e-5)
    sign = {c.name: c.sign for c in log.channels}
    assert sign["plate1_F_z"] == sign["plate1_M_x"] == (1 if reaction else -1)
    assert sign["plate1_cop_x"] == 1
    assert "Fz1" not in log and log["EMG"].max() < 2e-3  # V


def test_the_plate_agrees_with_ezc3d(tmp_path):
    ezc3d = pytest.importorskip("ezc3d")
    path, _ = c3d(tmp_path, turn=0.3)
    log = ulna.read(path, part="analog")
    peer = ezc3d.c3d(str(path), extract_forceplat_data=True)["data"]["platform"][0]
    force = np.stack([log[f"plate1_F_{axis}"] for axis in "xyz"])
    sign = np.sign((force * peer["force"]).sum())
    np.testing.assert_allclose(force, sign * peer["force"], atol=2e-3)
    cop = np.stack([log[f"plate1_cop_{axis}"] for axis in "xyz"])
    np.testing.assert_allclose(cop, peer["center_of_pressure"] / 1000, atol=1e-5)


def test_units_of_moments_and_lengths_are_honoured(tmp_path):
    first, _ = c3d(tmp_path)
    one = ulna.read(first, part="analog").values.copy()
    second, _ = c3d(tmp_path, unit="m", moment_unit="Nm")
    np.testing.assert_allclose(ulna.read(second, part="analog").values, one, rtol=2e-5, atol=2e-3)


def test_markers_and_holes(tmp_path):
    path, truth = c3d(tmp_path, lose=(2, 5))
    log = ulna.read(path, part="points")
    assert log.rate_hz == pytest.approx(100) and len(log) == 20
    np.testing.assert_allclose(log["M2_y"], truth["places"][1, 1], atol=1e-6)
    assert np.flatnonzero(np.isnan(log["M3_x"])).tolist() == [5]
    assert {c.frame for c in log.channels} == {"laboratory"}


def test_two_rates_ask_for_a_part_and_one_rate_does_not(tmp_path):
    path, _ = c3d(tmp_path)
    with pytest.raises(ulna.ArgumentError, match="100 Hz and analog channels at 1000 Hz"):
        ulna.read(path)
    with pytest.raises(ulna.ArgumentError, match="'points' or 'analog'"):
        ulna.read(path, part="both")
    with pytest.raises(ulna.ArgumentError, match="only a C3D file has parts"):
        ulna.read(b"t,x\n0,1\n1,2\n", part="points")
    same, _ = c3d(tmp_path, ratio=1)
    log = ulna.read(same)
    assert "M1_x" in log and "plate1_F_z" in log


def test_an_unloaded_plate_has_no_centre_of_pressure(tmp_path):
    path, _ = c3d(tmp_path, wrench=lambda t: (np.stack([0 * t, 0 * t, 900 * (t > 0.5)]),
                                              np.zeros((3, len(t)))))  # fmt: skip
    log = ulna.read(path, part="analog")
    missing = np.isnan(log["plate1_cop_x"])
    assert missing[:90].all() and not missing[-90:].any()
    assert not np.isnan(log["plate1_F_z"]).any()


def test_a_plate_that_pulls_is_refused(tmp_path):
    path, _ = c3d(tmp_path, wrench=lambda t: (np.stack([0 * t, 0 * t, 900 * np.sign(t - 0.5 + 1e-9)]),
                                              np.zeros((3, len(t)))))  # fmt: skip
    with pytest.raises(ulna.FormatError, match="both push and pull"):
        ulna.read(path, part="analog")


def test_a_wrong_unit_of_a_plate_is_refused(tmp_path):
    ezc3d = pytest.importorskip("ezc3d")
    path, _ = c3d(tmp_path)
    file = ezc3d.c3d(str(path))
    file["parameters"]["ANALOG"]["UNITS"]["value"] = ["N", "N", "V", "Nmm", "Nmm", "Nmm", "mV"]
    file.write(str(path))
    with pytest.raises(ulna.FormatError, match="channel 3 of force plate 1 has the unit 'V'"):
        ulna.read(path, part="analog")


def test_a_spoiled_c3d_is_refused_in_words(tmp_path):
    data = c3d(tmp_path)[0].read_bytes()
    for spoiled, words in (
        (data[: len(data) - 600], "cut off"),
        (data[:700], "does not begin"),
        (b"\x02\x51" + data[2:], "does not begin"),
        (data[:515] + b"\x20" + data[516:], "unknown kind of processor"),
        (data[:6] + struct.pack("<2H", 9, 3) + data[10:], "cut off"),
    ):
        with pytest.raises(ulna.FormatError, match=words):
            ulna.read(spoiled, format="c3d")


def test_a_c3d_that_ends_its_reader_is_refused(tmp_path):
    """Damage in the parameters crashes the library: that happens in a process of its own."""
    data = c3d(tmp_path)[0].read_bytes()
    rng = np.random.default_rng(11)
    refused = 0
    for _ in range(8):
        spoiled = bytearray(data)
        for place in rng.integers(512, 1024, size=6):
            spoiled[place] = int(rng.integers(256))
        try:
            ulna.read(bytes(spoiled), format="c3d", part="points")
        except ulna.Error as failure:
            refused += 1
            assert "\n" not in str(failure)
    assert refused >= 2


def test_a_c3d_without_its_library_says_what_to_install(tmp_path, monkeypatch):
    path = c3d(tmp_path)[0]
    monkeypatch.setattr("ulna._read_c3d.find_spec", lambda name: None)
    with pytest.raises(ImportError, match=r"pip install ulna\[c3d\]"):
        ulna.read(path)


# Everything ---------------------------------------------------------------------------------------


def test_a_map_renames_turns_and_overrides():
    channel = {"column": "knee_angle_r", "name": "q", "sign": -1, "role": "position"}
    log = ulna.read(mot(angles(), NAMES), format="mot", map={"channel": [channel]})
    q = log.channels[2]
    assert (q.name, q.role, q.sign, q.unit) == ("q", "position", -1, "rad")
    assert log["q"][-1] < 0
    with pytest.raises(ulna.FormatError, match="the map names the column 'nothing'"):
        ulna.read(mot(angles(), NAMES), format="mot", map={"channel": [{"column": "nothing"}]})


def test_inspect_drafts_a_map_that_reads_the_same(tmp_path):
    path = tmp_path / "a.mot"
    path.write_bytes(mot(angles(), NAMES))
    found = ulna.inspect(path)
    draft = tmp_path / "a.toml"
    draft.write_text(found.toml())
    np.testing.assert_array_equal(ulna.read(path, map=draft).values, found.record.values)


def test_several_files_become_trials(tmp_path):
    for number in range(3):
        (tmp_path / f"{number}.mvnx").write_bytes(mvnx()[0])
    log = ulna.read(tmp_path)
    assert len(log.trials) == 3 and len(log) == 120


def test_a_file_that_is_not_there_is_named(tmp_path):
    for ending in ("mvnx", "mot", "sto", "trc", "c3d"):
        with pytest.raises(ulna.FileError, match="does not exist"):
            ulna.read(tmp_path / f"none.{ending}")


def test_a_quoted_table_is_no_c3d():
    log = ulna.read(b'"Pos","t"\n0,0\n1,0.001\n2,0.002\n')
    assert log.channels[0].source_name == "Pos"
