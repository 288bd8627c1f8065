"""Captures from files to torques: one filter, one clock, truth inside the intervals, wrong data named."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from simulated_capture import FEET, IMUS, WRENCH, changed, person, simulated_capture

import ulna
from ulna._capture_filter import smooth
from ulna.assist import ForceCurve, PassiveDevice
from ulna.body import Link, body_from_links
from ulna.capture import (
    BodySetup,
    Contact,
    Deviations,
    Imu,
    Touch,
    estimate,
    gather,
    read_setup,
    recorded_torques,
)
from ulna.motion import differentiate

SHARED = Path(__file__).resolve().parents[3] / "shared" / "data" / "wholebody"
needs_bowing = pytest.mark.skipif(
    not (SHARED / "bowing.csv").is_file(), reason="the bowing recording is not there"
)


@pytest.fixture(scope="module")
def capture():
    return simulated_capture()


@pytest.fixture(scope="module")
def setup(capture):
    """Mounts are known, so that only the data decide."""
    imus = [Imu(name, position_m=p, orientation=r) for name, (p, r) in capture.mounts.items()]
    return BodySetup(capture.body, imus=imus)


def run(capture, setup, *, suit=None, shoes=None, **more):
    records = [suit or capture.suit, shoes or capture.shoes]
    return recorded_torques(records, setup, clocks="shared", **more)


def codes(found, *, severity=None):
    return {f.code for f in found.findings if severity in (None, f.severity)}


def errors(found, capture):
    """Estimated less true torque of all joints but the toes, whose truth weighs nothing."""
    rows = np.rint(found.time_s * 60).astype(int)
    joints = [k for k, name in enumerate(found.torques.joints) if "Ball" not in name]
    difference = found.torques.torque - capture.torque[rows]
    return difference[:, joints], found.torques.torque_deviation[:, joints]


# The filter -----------------------------------------------------------------------------------------


def test_the_filter_is_savitzky_and_golay_where_nothing_is_missing():
    values = np.random.default_rng(0).normal(size=(200, 3))
    found = smooth(0.0, 60.0, values, np.arange(200) / 60, window_s=0.25, order=4)
    same = differentiate(values, rate_hz=60.0)
    inside = slice(7, -7)
    for own, other in zip(
        found.derivatives, (same.value, same.rate, same.acceleration), strict=True
    ):
        np.testing.assert_allclose(own[inside], other[inside], rtol=1e-9, atol=1e-9)
    assert (found.loss[inside] == 1).all() and (found.loss[0] > 2).all()


def test_the_filter_is_exact_for_polynomials_whatever_is_missing():
    rng = np.random.default_rng(1)
    t = np.arange(300) / 100
    coefficients = rng.normal(size=5)
    values = np.polyval(coefficients, t)[:, None]
    values[rng.random(300) < 0.2] = np.nan
    at = rng.uniform(0.2, 2.7, 50)  # on no sample
    at.sort()
    found = smooth(0.0, 100.0, values, at, window_s=0.2, order=4)
    for d in range(3):
        expected = np.polyval(np.polyder(coefficients, d), at)
        np.testing.assert_allclose(found.derivatives[d][:, 0], expected, rtol=1e-6, atol=1e-6)


def test_the_filter_says_how_much_a_gap_costs():
    rng = np.random.default_rng(2)
    noise = rng.normal(size=(15, 40000))
    gap = noise.copy()
    gap[7] = np.nan
    given = {"window_s": 0.25, "order": 4, "derivatives": 0}
    whole, found = (smooth(0.0, 60.0, y, np.array([7 / 60]), **given) for y in (noise, gap))
    # The scatter of 40000 draws is known to four thousandths.
    assert found.value.std() / whole.value.std() == pytest.approx(found.loss[0, 0], rel=0.02)


# Truth inside the intervals -------------------------------------------------------------------------


def test_true_torques_lie_inside_the_intervals(capture, setup):
    found = run(capture, setup)
    off, spread = errors(found, capture)
    assert 0.93 < (np.abs(off) < 1.96 * spread).mean() < 0.99
    # A hundredth of the largest torques, from sensors of 2 N, 0.05 m/s^2 and a milliradian.
    assert np.sqrt(np.mean(off**2)) < 0.4
    assert found.findings == () and found.sound
    assert found.start.carried_kg == pytest.approx(72.7, abs=0.1)
    assert len(found.frames) == len(capture.time_s) - 14  # half a window at either end
    assert "72.7 kg" in found.summary() and "RecordedTorques" in repr(found)
    assert found.from_above is None and found.from_below is None


def test_mounts_are_found_from_the_motion(capture):
    found = run(capture, capture.body, variances="given")
    for sensor in found.frames.suite.sensors:
        if sensor.kind != "accelerometer" or sensor.place in ("Pelvis",) or sensor.frame != "link":
            continue
        place, axes = capture.mounts[sensor.place]
        # The pelvis hardly turns here; the others wave by a tenth of a radian.
        assert np.linalg.norm(sensor.position_m - place) < 0.02
        assert np.abs(sensor.orientation - axes).max() < 0.01
    assert any("imu Pelvis" in note and "calibration" in note for note in found.frames.notes)


def test_a_calibration_motion_tells_the_mounts(capture):
    lively = simulated_capture(seed=0, seconds=12.0)
    frames = gather([capture.suit, capture.shoes], capture.body, calibration=lively.suit,
                    clocks="shared")  # fmt: skip
    hand = next(s for s in frames.suite.sensors if s.name == "imu RightHand")
    assert np.linalg.norm(hand.position_m - lively.mounts["RightHand"][0]) < 0.02


def test_orientations_of_segments_are_as_good_as_angles(setup):
    suit = simulated_capture(seconds=8.0, angles=False)
    found = run(suit, setup, variances="given", checks=False)
    off, _ = errors(found, suit)
    assert np.sqrt(np.mean(off**2)) < 0.6


def test_clocks_are_put_together_by_the_vertical_force(setup):
    apart = simulated_capture(seconds=60.0, offset_s=3.2, drift=1e-4)
    frames = gather([apart.suit, apart.shoes], setup)
    fit = frames.clocks["recording 2"]
    off = float(fit.to_reference(26.8)) - (26.8 * (1 + 1e-4) + 3.2)
    # The person only sways, so that the force tells the time to some hundredths of a second.
    assert abs(off) < max(4 * float(fit.error_s(26.8)), 0.005) and abs(off) < 0.03
    assert any("clock of recording 2" in note for note in frames.notes)
    found = estimate(frames, variances="given", checks=False)
    off, _ = errors(found, apart)
    assert np.sqrt(np.nanmean(off**2)) < 0.5
    nothing = changed(apart.shoes, lambda c, t: [c[k].fill(0.0) or c[k].__iadd__(
        np.random.default_rng(3).normal(size=len(t))) for k in c] and None)  # fmt: skip
    with pytest.raises(ulna.AnalysisError, match="cannot be put on the clock of recording 1"):
        gather([apart.suit, nothing], setup)


def test_a_device_enters_in_balance(capture, setup):
    device = PassiveDevice(ForceCurve.parametric(peak_n=30), mass_kg=0.0)
    with_device = BodySetup(capture.body, imus=setup.imus, device=device)
    plain = run(capture, setup, variances="given", checks=False)
    found = run(capture, with_device, variances="given", checks=False)
    worn = found.frames.device
    assert np.abs(worn.net_force_n).max() < 1e-9 and np.abs(worn.net_moment_nm).max() < 1e-9
    joint = found.torques.joints.index("jLeftShoulder_rotx")
    lever = np.linalg.norm(worn.arm_point_m[:, 0] - worn.arm_point_m[:, 1]) > 0
    assert lever
    less = np.abs(found.torques.torque[:, joint]).mean() / np.abs(
        plain.torques.torque[:, joint]).mean()  # fmt: skip
    assert less < 0.6
    assert found.elevation_rad.shape == (len(found.frames), 2)
    with pytest.raises(ulna.ArgumentError, match="LeftUpperArm"):
        stick, log = two_links()
        recorded_torques(log, BodySetup(stick, device=device))


def test_errors_of_the_angles_widen_the_intervals(capture, setup):
    wide = BodySetup(capture.body, imus=setup.imus,
                     deviations=Deviations(angle_rad=0.02, base_angle_rad=0.01))  # fmt: skip
    frames = gather([capture.suit, capture.shoes], setup, clocks="shared")
    narrow = estimate(frames, variances="given", checks=False)
    wider = run(capture, wide, variances="given", checks=False)
    joint = narrow.torques.joints.index("jL5S1_roty")
    # Half the body a quarter of a metre above the joint, tilted by a hundredth or two.
    more = np.median(wider.torques.torque_deviation[:, joint])
    assert more > 1.0 + np.median(narrow.torques.torque_deviation[:, joint])


# Wrong data -----------------------------------------------------------------------------------------


def exchange_feet(channels, _):
    right, left = FEET
    for word in WRENCH:
        a, b = f"{right}_{word}", f"{left}_{word}"
        channels[a], channels[b] = channels[b], channels[a]


def test_swapped_feet_are_named(capture, setup):
    found = run(capture, setup, shoes=changed(capture.shoes, exchange_feet), variances="given")
    assert "exchanged" in codes(found, severity="error") and not found.sound


@pytest.mark.parametrize("toe_out", [0.15, 0.0])
def test_swapped_feet_under_equal_load(toe_out):
    """The balance sees exchanged shoes only by what differs: feet that are turned out feel the other's
    push in another direction; with parallel feet only the sign of that push is left to tell."""
    equal = simulated_capture(equal=True, toe_out=toe_out, seconds=10.0)
    setup = BodySetup(equal.body, imus=())
    good = run(equal, setup, variances="given")
    swapped = run(equal, setup, shoes=changed(equal.shoes, exchange_feet), variances="given")
    assert "exchanged" not in codes(good)
    assert "exchanged" in codes(swapped)
    if toe_out == 0.0:
        assert codes(good) == {"not_told_apart"}
        assert "cannot tell" in next(f.message for f in swapped.findings if f.code == "exchanged")


def test_equal_feet_without_a_push_cannot_be_told_apart():
    equal = simulated_capture(equal=True, toe_out=0.0, seconds=10.0, medial_n=0.0)
    setup = BodySetup(equal.body, imus=())
    swapped = run(equal, setup, shoes=changed(equal.shoes, exchange_feet), variances="given")
    assert codes(swapped) == {"not_told_apart"}


def test_a_shoe_upside_down_is_named(capture, setup):
    def turn(channels, _):
        for word in ("F_y", "F_z", "M_y", "M_z"):
            channels[f"RightFoot_{word}"] *= -1

    found = run(capture, setup, shoes=changed(capture.shoes, turn), variances="given")
    told = next(f for f in found.findings if f.code == "upside_down")
    assert told.severity == "error" and told.channel == "RightFoot"


def test_a_kilogram_too_much_is_named(capture, setup):
    heavier = capture.body.attach("stone", link="T8", mass_kg=1.0, centre_m=(0, 0, 0.1))
    found = run(capture, BodySetup(heavier, imus=setup.imus), variances="given")
    words = next(f.message for f in found.findings if f.code == "wrong_mass")
    assert "1.0" in words and "too much on" in words


@pytest.mark.parametrize("gyroscope", [True, False])
def test_sensors_on_each_others_segments_are_named(capture, setup, gyroscope):
    def exchange(channels, _):
        kinds = ["sensor_acceleration", "sensor_angular_velocity"]
        for kind in kinds:
            for axis in "xyz":
                a, b = f"RightHand_{kind}_{axis}", f"T8_{kind}_{axis}"
                channels[a], channels[b] = channels[b], channels[a]
        if not gyroscope:
            for name in [n for n in channels if "angular_velocity" in n]:
                del channels[name]

    found = run(capture, capture.body, suit=changed(capture.suit, exchange), variances="given")
    told = {f.channel for f in found.findings if f.code == "wrong_segment"}
    assert told == {"imu RightHand", "imu T8"}


def test_dropped_frames_are_bridged_with_wider_intervals(capture, setup):
    def drop(_, time):
        keep = np.random.default_rng(5).random(len(time)) > 0.1
        keep[[0, -1]] = True
        return keep

    whole = run(capture, setup, variances="given")
    found = run(capture, setup, suit=changed(capture.suit, drop), shoes=changed(capture.shoes, drop),
                variances="given")  # fmt: skip
    assert {"dropped_frames", "missing_samples"} <= codes(found, severity="warning")
    assert "recording 1" in next(f.message for f in found.findings if f.code == "dropped_frames")
    off, spread = errors(found, capture)
    known = np.isfinite(off).all(axis=1)
    assert known.mean() > 0.97
    assert (np.abs(off[known]) < 1.96 * spread[known]).mean() > 0.93
    _, before = errors(whole, capture)
    assert np.nanmedian(spread) > 1.02 * np.median(before)


def test_a_long_gap_of_the_motion_has_no_torques(capture):
    def lose(channels, time):
        for joint in capture.body.joints:
            channels[joint][(time > 5) & (time < 6)] = np.nan

    # Mounts are found beside the gap, and everything is drawn and told around it.
    found = run(capture, capture.body, suit=changed(capture.suit, lose))
    assert codes(found) == {"dropped_frames"} and found.balance.shape == (len(found.frames), 6)
    assert np.isnan(found.scene().position_m).any() and "without a state" in found.summary()
    inside = (found.time_s > 5.02) & (found.time_s < 5.98)
    assert np.isnan(found.torques.torque[inside]).all() and found.torques.unusable >= inside.sum()
    off, spread = errors(found, capture)
    known = np.isfinite(off).all(axis=1)
    assert (np.abs(off[known]) < 4 * spread[known] + 0.5).all()
    assert np.isfinite(off[(found.time_s < 4.9) | (found.time_s > 6.1)]).all()


def test_a_gap_becomes_no_zero(capture, setup):
    def lose(channels, time):
        rows = (time > 5) & (time < 6)
        for word in WRENCH:
            channels[f"RightFoot_{word}"][rows] = np.nan

    found = run(capture, setup, shoes=changed(capture.shoes, lose), variances="given")
    whole = run(capture, setup, variances="given")
    knee = found.torques.joints.index("jRightKnee_roty")
    inside = (found.time_s > 5.2) & (found.time_s < 5.8)
    wider = found.torques.torque_deviation[inside, knee]
    assert np.median(wider) > 1.2 * np.median(whole.torques.torque_deviation[inside, knee])
    rows = np.rint(found.time_s * 60).astype(int)
    off = found.torques.torque[inside, knee] - capture.torque[rows][inside, knee]
    assert (np.abs(off) < 4 * wider).all()  # the other foot and the balance tell


@pytest.mark.parametrize("what", ["imu", "shoe"])
def test_a_dead_sensor_is_named_and_left_out(capture, setup, what):
    def die(channels, time):
        names = [n for n in channels if n.startswith("RightForeArm_sensor")]
        if what == "shoe":
            names = [f"RightFoot_{word}" for word in WRENCH]
        for name in names:
            channels[name][len(time) // 2 :] = channels[name][len(time) // 2]

    records = {"suit": changed(capture.suit, die)} if what == "imu" else {
        "shoes": changed(capture.shoes, die)}  # fmt: skip
    found = run(capture, setup, **records, variances="given")
    told = [f for f in found.findings if f.code == "dead_sensor"]
    assert [f.channel for f in told] == ["imu RightForeArm" if what == "imu" else "RightFoot"]
    assert "50" in told[0].message and f"row {told[0].row}" in told[0].message
    off, spread = errors(found, capture)
    assert (np.abs(off) < 1.96 * spread).mean() > 0.93


def test_a_sensor_that_lies_gets_a_variance_of_its_own(capture, setup):
    def lie(channels, time):
        rng = np.random.default_rng(9)
        for axis in "xyz":
            channels[f"Head_sensor_acceleration_{axis}"] += 3.0 * rng.normal(size=len(time))

    found = run(capture, setup, suit=changed(capture.suit, lie))
    told = {f.channel for f in found.findings if f.code == "larger_than_expected"}
    assert told == {"imu Head"}
    suite = found.frames.suite
    head, hand = (suite.deviation[suite.row(f"imu {n}")] for n in ("Head", "RightHand"))
    assert head > 10 * hand
    off, spread = errors(found, capture)
    assert (np.abs(off) < 1.96 * spread).mean() > 0.93


def test_what_nobody_measures_is_said(capture, setup):
    suit_only = recorded_torques(capture.suit, BodySetup(capture.body, imus=()), variances="given")
    assert "no_contact" in codes(suit_only, severity="error")
    hands = ("RightHand", "LeftHand")
    for force_only in (True, False):
        touches = [Touch(hand, force_only=force_only) for hand in hands]
        frames = gather([capture.suit, capture.shoes],
                        BodySetup(capture.body, imus=setup.imus, touches=touches), clocks="shared")  # fmt: skip
        found = estimate(frames.select(slice(0, 60)), variances="given")
        # Two forces leave one combination open, which runs along the line between the hands.
        words = [f.message for f in found.findings if f.code == "not_determined"]
        assert words and "touch RightHand, touch LeftHand" in words[0]
    one = BodySetup(capture.body, imus=setup.imus, touches=[Touch("RightHand")])
    frames = gather([capture.suit, capture.shoes], one, clocks="shared").select(slice(0, 60))
    assert "not_determined" not in codes(estimate(frames, variances="given"))


# Refusals -------------------------------------------------------------------------------------------


def two_links(rows=200, **more):
    ball = {"mass_kg": 10.0, "inertia_kg_m2": np.eye(3)}
    body = body_from_links([
        Link("foot", **ball),
        Link("leg", parent="foot", joint="ankle", axis=[0, 1, 0], centre_m=[0, 0, 0.5], **ball),
    ])  # fmt: skip
    t = np.arange(rows) / 100
    rng = np.random.default_rng(0)
    channels = {"ankle": 0.2 * np.sin(2 * t)}
    channels |= {f"foot_{w}": v + 0.1 * rng.normal(size=rows)
                 for w, v in zip(WRENCH, (0, 0, 196.2, 0, 0, 0), strict=True)}  # fmt: skip
    channels |= more
    return body, ulna.Record.from_arrays(t, channels, units={"ankle": "rad"})


@pytest.mark.parametrize(
    ("channels", "units", "words"),
    [
        ({"knee": 0.0}, {}, "recording 1 is the angle of the joint 'ankle'.*it has knee"),
        ({"ankle": 40.0}, {"ankle": "rad"}, "'ankle' of recording 1 reaches .* rad in row 0.*degrees"),
        ({"ankle": 0.0}, {"ankle": "m"}, "'ankle' of recording 1 is in m, but rad is expected"),
        ({"ankle": np.inf}, {"ankle": "rad"}, "'ankle' of recording 1 is infinite in row 0"),
        ({"ankle": np.nan}, {"ankle": "rad"}, "no frame has the angles"),
        ({"ankle": 0.0, "foot_F_x": 0.0}, {"ankle": "rad"}, "'foot_F_x', but no component y"),
        (
            {"ankle": 0.0} | {f"leg_sensor_acceleration_{a}": 0.6 for a in "xyz"},
            {"ankle": "rad"},
            "'leg_sensor_acceleration_x' of recording 1 reads 1.04 .* in g",
        ),
    ],
)  # fmt: skip
def test_bad_channels_are_refused_by_name(channels, units, words):
    body, _ = two_links()
    t = np.arange(100) / 100
    log = ulna.Record.from_arrays(
        t, {name: np.full(100, value) for name, value in channels.items()}, units=units
    )
    with pytest.raises(ulna.Error, match=words):
        recorded_torques(log, body)


def test_bad_clocks_are_refused():
    body, log = two_links()
    t = np.array(log.time)
    values = {"ankle": np.array(log["ankle"])}
    late = t.copy()
    late[50:] += 0.004  # and back: neither a gap nor a rate
    late[60:] -= 0.004
    with pytest.raises(ulna.Error, match="jitter"):
        gather(ulna.Record.from_arrays(late, values, units={"ankle": "rad"}), BodySetup(body))
    with pytest.raises(ulna.Error, match="12 samples"):
        gather(ulna.Record.from_arrays(t[:12], {"ankle": values["ankle"][:12]},
                                       units={"ankle": "rad"}), BodySetup(body))  # fmt: skip
    with pytest.raises(ulna.Error, match="give a smaller window"):
        gather(log, BodySetup(body), window_s=3.0)


def test_bad_arguments_are_refused():
    body, log = two_links()
    for more, words in (
        ({"clocks": "best"}, "clocks is 'best'"),
        ({"variances": "mine"}, "variances is 'mine'"),
        ({"window_s": 0.0}, "window_s"),
        ({"order": 1}, "order"),
        ({"rate_hz": -1.0}, "rate_hz"),
    ):
        with pytest.raises(ulna.ArgumentError, match=words):
            recorded_torques(log, body, **more)
    with pytest.raises(ulna.ArgumentError, match="no recording"):
        recorded_torques([], body)
    with pytest.raises(ulna.ArgumentError, match="body is a int"):
        recorded_torques(log, 3)
    with pytest.raises(ulna.ArgumentError, match="which the body has not"):
        BodySetup(body, contacts=[Contact("shoe", "hand")])
    with pytest.raises(ulna.ArgumentError, match="sign"):
        Contact("shoe", "foot", sign=0)
    with pytest.raises(ulna.Error, match="force and moment of 'shoe'"):
        recorded_torques(log, BodySetup(body, contacts=[Contact("shoe", "leg")]))
    with pytest.raises(ulna.Error, match="acceleration of 'imu leg'"):
        recorded_torques(log, BodySetup(body, imus=[Imu("leg")]))
    with pytest.raises(ulna.FormatError, match="markers"):
        recorded_torques("walk.trc", body)


def test_forces_in_another_unit_do_not_pass(capture, setup):
    def kilo(channels, _):
        for word in WRENCH:
            for foot in FEET:
                channels[f"{foot}_{word}"] /= 1000

    found = run(capture, setup, shoes=changed(capture.shoes, kilo), variances="given")
    assert "wrong_mass" in codes(found, severity="error")


# Bodies from files ----------------------------------------------------------------------------------


def test_a_toml_file_describes_person_tool_sensors_and_device(tmp_path):
    (tmp_path / "support.csv").write_text("subject,beta_deg,F_support_N\n1,5,0\n1,90,30\n1,140,20\n")
    path = tmp_path / "person.toml"
    path.write_text(
        "[body]\nheight_m = 1.8\nmass_kg = 75\n"
        '[[attach]]\nname = "drill"\nlink = "RightHand"\nmass_kg = 0.66\ncentre_m = [0.05, -0.1, 0]\n'
        '[[contact]]\nname = "right shoe"\nlink = "RightFoot"\nposition_m = [0.05, 0, -0.06]\nsign = -1\n'
        '[[imu]]\nlink = "T8"\nposition_m = [0, 0, 0.1]\nrpy_rad = [0, 0, 1.5]\n'
        '[device]\ntable = "support.csv"\nsubject = 1\nmass_kg = 1.8\n'
        "[deviations]\nimu_m_s2 = 0.2\n"
        '[[touch]]\nlink = "LeftHand"\n'
    )
    found = read_setup(path)
    assert found.body.mass_kg == pytest.approx(75.66)
    assert found.contacts[0].sign == -1 and found.imus[0].link == "T8"
    assert found.touches[0].force_only and found.device.mass_kg == 1.8 and found.deviations.imu_m_s2 == 0.2


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[body", "no TOML"),
        ("[body]\nheight_m = 1.8\n", "no mass_kg"),
        ("[body]\nheight_m = 1.8\nmass_kg = 75\nwidth = 2\n", "unknown key 'width'"),
        ("[person]\nheight_m = 1.8\n", "unknown key 'person'"),
        ("[body]\nheight_m = -1\nmass_kg = 75\n", "person.toml: .*height"),
        ('[body]\nheight_m = "tall"\nmass_kg = 75\n', "person.toml"),
        ("[body]\nheight_m = 1.8\nmass_kg = 75\n[contact]\nname = 'a'\n", "list of tables"),
        ("[body]\nheight_m = 1.8\nmass_kg = 75\n[[imu]]\nlink = 'Spine'\n", "'Spine'"),
        ("[body]\nfile = 'nobody.urdf'\n", "nobody.urdf"),
        ("[body]\nfile = 'a.urdf'\nmass_kg = 3\n", "one of them"),
        ("[body]\nheight_m = 1.8\nmass_kg = 75\n[device]\ntable = 'none.csv'\n", "none.csv"),
    ],
)
def test_bad_bodies_are_refused_in_words(tmp_path, text, words):
    path = tmp_path / "person.toml"
    path.write_text(text)
    with pytest.raises(ulna.Error, match=words):
        read_setup(path)


def test_a_body_that_is_not_there_is_named(tmp_path):
    with pytest.raises(ulna.FileError, match="none.toml"):
        read_setup(tmp_path / "none.toml")
    path = tmp_path / "model.json"
    links = [{"name": "foot", "mass": 1.0, "com": [0, 0, 0], "inertia_diag": [1, 1, 1]}]
    path.write_text(json.dumps({"links": links, "imu": {"link": "foot"}}))
    with pytest.raises(ulna.FormatError, match="imu or plate of model.json"):
        read_setup(path)


# The bowing recording -------------------------------------------------------------------------------


@needs_bowing
def test_the_bowing_recording_has_its_published_numbers():
    found = recorded_torques(SHARED / "bowing.csv", SHARED / "bowing-model.json")
    assert found.body.mass_kg == pytest.approx(61.691, abs=5e-4)
    above = found.from_above
    for column, (low, high) in enumerate([(-63.9, -15.5), (-72.5, -0.2)]):
        assert above[:, column].min() == pytest.approx(low, abs=0.05)
        assert above[:, column].max() == pytest.approx(high, abs=0.05)
    rms = np.sqrt(np.mean(found.balance**2, axis=0))
    assert rms == pytest.approx([5.77, 2.55, 1.61, 6.43, 8.20, 0.86], abs=0.05)
    apart = above[:, 0] - found.from_below[:, 0]
    assert np.sqrt(np.mean(apart**2)) == pytest.approx(7.8, abs=0.05)
    # Variances of the data cover the difference of the two ways, those typed in do not.
    assert found.torques.balance_nis.mean() == pytest.approx(6.0, abs=2.0)
    narrow = recorded_torques(SHARED / "bowing.csv", SHARED / "bowing-model.json", variances="given")
    assert narrow.torques.balance_nis.mean() > 30
    assert found.sound and found.start.findings == ()


# What is shown --------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def short(capture, setup):
    frames = gather([capture.suit, capture.shoes], setup, clocks="shared").select(slice(0, 240))
    return estimate(frames, variances="given")


def test_the_scene_has_the_torques_of_the_joints(short):
    scene = short.scene(name="standing", rate_hz=20)
    names = [link.name for link in scene.links]
    assert len(names) == 23 and scene.frames == 80
    knee = [short.torques.joints.index(f"jRightKnee_rot{a}") for a in "yz"]
    expected = np.linalg.norm(short.torques.torque[::3][:, knee], axis=1)
    np.testing.assert_allclose(scene.effort[:, names.index("RightLowerLeg")], expected)
    assert (scene.effort[:, 0] >= scene.effort[:, names.index("L5")] - 1e-9).all()
    assert [force.name for force in scene.forces] == ["RightFoot", "LeftFoot"]
    assert scene.force_N[:, :, 2].mean() == pytest.approx(0.5 * 72.7 * 9.81, rel=0.02)
    assert short.scene(per_kg=True).unit == "N m/kg"
    with pytest.raises(ulna.ArgumentError, match="rate_hz"):
        short.scene(rate_hz=0)


def test_effort_is_told_by_areas(short):
    assert set(short.effort().area_norm_nm) == {
        "torso", "left arm", "right arm", "left leg", "right leg"
    }  # fmt: skip


def test_pictures_pages_and_reports_are_written(short, tmp_path):
    pytest.importorskip("matplotlib").use("Agg")
    from ulna._body_page import three_files

    assert short.picture(tmp_path / "a" / "body.png", time_s=2.0, labels=1).is_file()
    report = short.report(tmp_path / "report.html", command="ulna torques").read_text("utf-8")
    for words in ("Nothing contradicts", "jRightHip", "Balance", "ulna torques", "standard deviation"):
        assert words in report, words
    torques, balance, joints = short.tables(tmp_path)
    again = ulna.read(torques)
    assert len(again) == 240 and "jL5S1_roty" in again
    np.testing.assert_allclose(again["jL5S1_roty"],
                               short.torques.torque[:, short.torques.joints.index("jL5S1_roty")],
                               rtol=1e-6, atol=1e-6)  # fmt: skip
    assert joints.read_text().count("\n") == 49 and balance.is_file()
    with pytest.raises(ulna.ArgumentError, match="folder"):
        short.picture(tmp_path)
    with pytest.raises(ulna.ArgumentError, match="folder"):
        short.report(tmp_path)
    with pytest.raises(ulna.ArgumentError, match="cannot be drawn"):
        ulna.plot.body_effort(3)
    try:
        three_files()
    except FileNotFoundError:
        with pytest.raises(FileNotFoundError, match="libjs-three"):
            short.page(tmp_path / "body.html")
    else:
        page = short.page(tmp_path / "body.html", names=("standing", ""), title="Standing")
        assert "Standing" in page.read_text("utf-8")


def test_the_page_of_a_capture_opens_without_a_network(short, tmp_path):
    from browser import Browser, chromium

    from ulna._body_page import three_files

    try:
        three_files()
    except FileNotFoundError as missing:
        pytest.skip(str(missing))
    if chromium() is None:
        pytest.skip("there is no Chromium on this machine")
    page = short.page(tmp_path / "body.html", beside=short, names=("one", "two"), rate_hz=10)
    with Browser(chromium(), width=800, height=600) as browser:
        browser.open(page)
        browser.until("ulna.ready()")
        assert browser.errors == []
        assert all(address.startswith("file:") for address in browser.requests)
        assert browser.run("document.body.innerText.includes('joint torque (N m)')")


def test_sensors_are_those_of_the_suit():
    assert set(IMUS) <= set(person().links)
