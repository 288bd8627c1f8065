"""Designs: signals against closed forms, limits, tables, and foreseen errors against simulations."""

from __future__ import annotations

import json
import pickle
import warnings
from pathlib import Path

import numpy as np
import pytest

import ulna
from ulna import cli, design
from ulna.design import Arm, Limits, Noise, Robot

signal = pytest.importorskip("scipy.signal")
interpolate = pytest.importorskip("scipy.interpolate")

RECORDING = Path(__file__).resolve().parents[2] / "examples" / "data" / "relaxed-arm.csv"
P1 = Arm()


# Signals -----------------------------------------------------------------------------------------


def test_default_multisine_is_that_of_the_thesis():
    made = design.multisine(seed=3)
    assert made.reference.shape == (50_000, 2) and made.rate_hz == 1000 and made.duration_s == 50
    assert made.kind == "position" and made.unit == "m" and made.axes == ("x", "y")
    assert made.segments == (ulna.record.Segment(0, 50_000, 0),)
    assert np.allclose(np.abs(made.reference).max(axis=0), 0.01, rtol=1e-14)
    assert np.array_equal(made.time_s, np.arange(50_000) / 1000)
    freq = [line.freq_hz for line in made.lines]
    # 7 steps of 0.02 Hz apart: axis x has the odd multiples of 0.14 Hz, y the even ones.
    assert np.allclose(sorted(freq), 0.14 * np.arange(1, 21), rtol=1e-14)
    assert {line.axis for line in made.lines if round(line.freq_hz / 0.14) % 2} == {0}
    assert not made.reference.flags.writeable


def test_spectrum_holds_the_lines_and_nothing_else():
    made = design.multisine(seed=3, phases="random", rms=[0.003, 0.005])
    spectrum = 2 * np.fft.rfft(made.reference, axis=0) / len(made.reference)
    expected = np.zeros_like(spectrum)
    for line in made.lines:
        expected[round(line.freq_hz * 50), line.axis] = line.amplitude * np.exp(1j * line.phase_rad)
    # Amplitudes are a thousandth: 1e-15 is rounding.
    assert np.abs(spectrum - expected).max() < 1e-15
    assert np.allclose(made.rms, [0.003, 0.005], rtol=1e-12)
    # The derivatives of a sum of whole cycles by its transform.
    omega = 2 * np.pi * np.fft.rfftfreq(50_000, 1e-3)[:, None]
    rate = np.fft.irfft(1j * omega * np.fft.rfft(made.reference, axis=0), 50_000, axis=0)
    assert np.abs(rate - made.reference_rate).max() < 1e-11
    second = np.fft.irfft(-(omega**2) * np.fft.rfft(made.reference, axis=0), 50_000, axis=0)
    assert np.abs(second - made.reference_acceleration).max() < 1e-8


def test_crest_factors_optimised_below_schroeder_below_random():
    found = {
        phases: np.array([
            design.multisine(phases=phases, seed=seed, rate_hz=100).crest for seed in range(10)
        ])
        for phases in ("optimised", "schroeder", "random")
    }  # fmt: skip
    means = {phases: crest.mean() for phases, crest in found.items()}
    assert means["optimised"] < 1.42 < 1.65 < means["schroeder"] < 2.0 < 2.2 < means["random"]
    # The lowest that 200 starts find: 1.3703 for ten odd harmonics, 1.3917 for the first ten. Most
    # designs come that low; none stays further off than the ten starts of these seeds leave.
    assert np.all(found["optimised"] > [1.36, 1.38])
    assert np.all(found["optimised"] < [1.40, 1.44])
    assert np.all(np.median(found["optimised"], axis=0) < [1.372, 1.41])


@pytest.mark.parametrize("phases", ["optimised", "schroeder", "random"])
def test_shared_lines_do_not_move_the_hand_along_a_line(phases):
    for seed in range(3):
        made = design.multisine(shared_lines=True, phases=phases, seed=seed, rate_hz=100)
        lines = [{line.freq_hz for line in made.lines if line.axis == axis} for axis in range(2)]
        assert lines[0] == lines[1] and len(lines[0]) == 10
        for other in (made.reference, made.reference_rate):
            assert abs(np.corrcoef(made.reference[:, 0], other[:, 1])[0, 1]) < 0.5
        assert not np.abs(made.reference[0]).max() > 1e-12  # both begin at 0
        assert any("share their lines" in note for note in made.notes)


def test_seeds_and_pickles():
    for make in (design.multisine, design.steps, design.random_binary):
        first, again, other = make(seed=0), make(seed=0), make(seed=1)
        assert np.array_equal(first.reference, again.reference)
        assert not np.array_equal(first.reference[:5000], other.reference[:5000])
        copy = pickle.loads(pickle.dumps(first))
        assert np.array_equal(copy.reference, first.reference) and copy.provenance == first.provenance


def test_step_response_agrees_with_scipy():
    """lsim holds the input linearly between samples, which for a step held from the start is exact."""
    t = np.arange(3000) / 1000
    for zeta, omega in ((0.1, 15.0), (1.0, 8.0), (2.5, 15.0)):
        mine = design.step_response(t, damping_ratio=zeta, natural_rad_s=omega)
        system = signal.lti([omega**2], [1, 2 * zeta * omega, omega**2])
        _, value, _ = signal.lsim(system, np.ones_like(t), t)
        assert np.abs(mine[:, 0] - value).max() < 1e-9
        _, rate, _ = signal.lsim(([omega**2, 0], [1, 2 * zeta * omega, omega**2]), np.ones_like(t), t)
        assert np.abs(mine[:, 1] - rate).max() < 1e-9 * omega
    assert not design.step_response([-1.0, -1e-9]).any()


def test_published_facts_of_the_filter():
    facts = design.step_facts()
    assert 100 * facts.overshoot == pytest.approx(72.9248, abs=5e-5)
    assert facts.peak_time_s == pytest.approx(0.210495, abs=5e-7)
    assert facts.settling_s == pytest.approx(2.67, abs=5e-3)
    notes = " ".join(design.steps().notes)
    assert "72.92 %" in notes and "2.67 s, longer than the hold of 1.5 to 2 s" in notes


@pytest.mark.parametrize("seed", range(4))
def test_steps_are_those_of_the_thesis(seed):
    made = design.steps(seed=seed)
    assert len(made.events) == len(made.segments) == 16
    directions = [step.direction for step in made.events]
    assert sorted(directions) == sorted([*range(8)] * 2)
    assert sorted(directions[:8]) == [*range(8)]  # the first half identifies in every direction
    free = 0.0
    for step, segment in zip(made.events, made.segments, strict=True):
        assert 1.5 <= step.hold_s <= 2.0
        assert 2.0 - 1e-9 <= step.onset_s - free <= 7.0 + 1e-9
        free = step.onset_s + step.hold_s
        angle = np.pi / 4 * step.direction
        assert np.allclose(step.size, 0.005 * np.array([np.cos(angle), np.sin(angle)]), atol=1e-17)
        rows = np.arange(segment.end - segment.begin)
        held = made.reference[segment.begin : segment.end]
        # The closed form, along one direction.
        want = np.outer(design.step_response(rows / 1000)[:, 0], step.size)
        assert np.abs(held - want).max() < 1e-16
        assert not made.reference[segment.begin].any()
    assert not made.reference[-1000:].any()
    order = directions
    assert any(design.steps(seed=s).events[0].direction != order[0] for s in range(4, 12))


def test_steps_of_a_force_and_of_one_axis():
    made = design.steps(unit="N", seed=1)
    # The largest sample: the overshoot of 72.9248 % falls between two of them.
    t, wd = np.arange(3000) / 1000, 15 * np.sqrt(0.99)
    held = 1 - np.exp(-1.5 * t) * (np.cos(wd * t) + 1.5 / wd * np.sin(wd * t))
    assert made.kind == "force" and made.peak.max() == pytest.approx(2 * held.max(), rel=1e-12)
    one = design.steps(axes=("q",), unit="deg", size=2.0, seed=1)
    assert one.rotational and one.unit == "rad"
    assert {np.sign(step.size[0]) for step in one.events} == {1.0, -1.0}
    three = design.steps(axes=("x", "y", "z"), directions=np.eye(3), repeats=1, seed=1)
    assert three.n == 3 and len(three.events) == 3


def test_binary_agrees_with_scipy_between_switches():
    raw = design.random_binary(seed=4, filtered=False, rate_hz=500, duration_s=20, axes=("x", "y"))
    made = design.random_binary(seed=4, rate_hz=500, duration_s=20, axes=("x", "y"))
    used = made.segments[0].end
    assert used == 19 * 500 and set(np.unique(raw.reference[:used])) == {-2.0, 2.0}
    for axis in range(2):
        state = np.zeros(2)
        a = np.array([[0, 1], [-225, -3.0]])
        system = (a, [[0], [225]], np.eye(2), np.zeros((2, 1)))
        for begin in range(0, used, 250):  # lsim from each switch to the next: a constant input
            count = min(250, used - begin)
            t = np.arange(count + 1) / 500
            u = np.full(count + 1, raw.reference[begin, axis])
            _, y, x = signal.lsim(system, u, t, X0=state)
            assert np.abs(made.reference[begin : begin + count, axis] - y[:-1, 0]).max() < 1e-9
            assert np.abs(made.reference_rate[begin : begin + count, axis] - y[:-1, 1]).max() < 1e-8
            state = x[-1]
    assert not np.array_equal(raw.reference[:, 0], raw.reference[:, 1])


def test_own_signals():
    t = np.arange(2000) / 500
    made = design.from_signal(
        np.c_[np.sin(t), np.cos(t)], rate_hz=500, unit="deg", axes=("q1", "q2"), segments=[(10, 1500)]
    )
    assert made.unit == "rad" and made.segments[0].end == 1500
    assert made.peak == pytest.approx(np.radians([1, 1]), rel=1e-3)
    # Central differences: h^2 / 6.
    assert np.abs(made.reference_rate[5:-5, 0] - np.radians(np.cos(t))[5:-5]).max() < 2e-8


def test_scaled():
    made = design.steps(seed=1)
    twice = made.scaled(2.0)
    for name in ("reference", "reference_rate", "reference_acceleration", "peak", "rms"):
        assert np.array_equal(getattr(twice, name), 2 * getattr(made, name))
    assert twice.events[0].size == tuple(2 * size for size in made.events[0].size)
    assert np.array_equal(twice.crest, made.crest) and "scaled by 2" in twice.provenance
    waves = design.multisine(seed=1)
    assert waves.scaled(0.5).lines[3].amplitude == 0.5 * waves.lines[3].amplitude


BAD = [
    (design.multisine, {"peak": 0}, "amplitude"),
    (design.multisine, {"peak": -1}, "amplitude"),
    (design.multisine, {"peak": float("nan")}, "amplitude"),
    (design.multisine, {"peak": [1, 2, 3]}, "peak"),
    (design.multisine, {"peak": 1, "rms": 1}, "rms"),
    (design.multisine, {"unit": "kg"}, "unit"),
    (design.multisine, {"unit": "furlong"}, "unit"),
    (design.multisine, {"unit": "Nm"}, "peak"),
    (design.multisine, {"axes": ()}, "axes"),
    (design.multisine, {"axes": ("x", "x")}, "axes"),
    (design.multisine, {"axes": ("x,y",)}, "axes"),
    (design.multisine, {"lines": 0}, "lines"),
    (design.multisine, {"lines": 2.5}, "lines"),
    (design.multisine, {"lines": 100}, "lines"),
    (design.multisine, {"band_hz": (3, 0)}, "band_hz"),
    (design.multisine, {"band_hz": (0, 0)}, "band_hz"),
    (design.multisine, {"band_hz": 3}, "band_hz"),
    (design.multisine, {"band_hz": (0, 600)}, "high_hz"),
    (design.multisine, {"duration_s": 0}, "duration_s"),
    (design.multisine, {"rate_hz": -1}, "rate_hz"),
    (design.multisine, {"phases": "best"}, "phases"),
    (design.multisine, {"lines_hz": [1.0, 1.0]}, "lines_hz"),
    (design.multisine, {"lines_hz": [0.0]}, "lines_hz"),
    (design.multisine, {"lines_hz": []}, "lines_hz"),
    (design.multisine, {"period_s": 0}, "period_s"),
    (design.multisine, {"slope": 9}, "slope"),
    (design.multisine, {"fade_s": 25}, "fade_s"),
    (design.multisine, {"fade_s": -1}, "fade_s"),
    (design.multisine, {"starts": -1}, "starts"),
    (design.multisine, {"seed": -1}, "seed"),
    (design.multisine, {"seed": 1.5}, "seed"),
    (design.steps, {"size": 0}, "size"),
    (design.steps, {"unit": "rad"}, "size"),
    (design.steps, {"directions": 0}, "directions"),
    (design.steps, {"directions": [[1, 1]]}, "directions"),
    (design.steps, {"directions": [[1, 0, 0]]}, "directions"),
    (design.steps, {"axes": ("x", "y", "z")}, "directions"),
    (design.steps, {"repeats": 0}, "repeats"),
    (design.steps, {"hold_s": (2, 1)}, "hold_s"),
    (design.steps, {"hold_s": (0, 0)}, "hold_s"),
    (design.steps, {"wait_s": (0.5, 1)}, "wait_s"),
    (design.steps, {"return_s": 0}, "return_s"),
    (design.steps, {"rest_s": -1}, "rest_s"),
    (design.steps, {"damping_ratio": 0}, "damping_ratio"),
    (design.steps, {"natural_rad_s": float("inf")}, "natural_rad_s"),
    (design.steps, {"rate_hz": 0.3}, "hold_s"),
    (design.random_binary, {"amplitude": 0}, "amplitude"),
    (design.random_binary, {"clock_s": 0}, "clock_s"),
    (design.random_binary, {"clock_s": 1e-5}, "clock_s"),
    (design.random_binary, {"duration_s": 1}, "duration_s"),
    (design.random_binary, {"return_s": -1}, "return_s"),
    (design.random_binary, {"unit": "Nm"}, "amplitude"),
    (design.random_binary, {"seed": "one"}, "seed"),
]


@pytest.mark.parametrize(("make", "keywords", "argument"), BAD)
def test_bad_designs_are_refused_by_name(make, keywords, argument):
    with pytest.raises(ulna.ArgumentError) as failure:
        make(**keywords)
    assert failure.value.argument == argument
    assert "\n" not in str(failure.value)


def test_bad_signals_factors_and_times():
    with pytest.raises(ulna.DataError, match="row 1, channel 0"):
        design.from_signal([0.0, np.nan, 0.0, 1.0], rate_hz=100)
    for keywords in ({"rate_hz": 0}, {"rate_hz": 1, "axes": ("x", "y")}, {"rate_hz": 1, "unit": "s"}):
        with pytest.raises(ulna.ArgumentError):
            design.from_signal(np.zeros(9), **keywords)
    for segments in ([(0, 20)], [(3, 3)], [1, 2], [(5, 7), (0, 3)]):
        with pytest.raises(ulna.ArgumentError, match="segments"):
            design.from_signal(np.ones(9), rate_hz=1, segments=segments)
    with pytest.raises(ulna.ArgumentError, match="3 rows"):
        design.from_signal([1.0, 2.0], rate_hz=1)
    with pytest.raises(ulna.ArgumentError):
        design.from_signal(np.zeros((9, 7)), rate_hz=1)
    made = design.random_binary()
    for factor in (0.0, np.nan, np.inf):
        with pytest.raises(ulna.ArgumentError, match="factor"):
            made.scaled(factor)
    with pytest.raises(ulna.ArgumentError, match="damping"):
        design.step_facts(damping_ratio=-1)
    with pytest.raises(ulna.ArgumentError, match="natural"):
        design.step_response([0.0], natural_rad_s=0)


# Tables and records --------------------------------------------------------------------------------


def test_a_table_is_read_back_to_the_bit(tmp_path):
    made = design.steps(unit="N", seed=2, rate_hz=500)
    path = tmp_path / "push.csv"
    made.to_csv(path, derivatives=True)
    lines = path.read_text().splitlines()
    heading = next(line for line in lines if not line.startswith("#"))
    assert heading.startswith('time [s],"F_x_ref [N]","F_y_ref [N]","F_x_ref_rate [N/s]"')
    assert "#ulna rate_hz 500" in lines
    log = ulna.read(path)
    assert log.rate_hz == 500 and log.segments == made.segments
    assert log.with_role("reference") == (0, 1)
    assert np.array_equal(log.values[:, :2], made.reference)
    assert np.array_equal(log["F_y_ref_acceleration"], made.reference_acceleration[:, 1])
    assert made.provenance.startswith("design: 16 steps of 2 in 8 directions")
    assert log.provenance[0] == made.provenance
    assert made.scaled(0.5).record().provenance == (made.provenance + ", scaled by 0.5",)
    # A folder that is not there leaves nothing behind.
    with pytest.raises(ulna.FileError):
        made.to_csv(tmp_path / "none" / "push.csv")
    assert list(tmp_path.iterdir()) == [path]


def test_a_recording_gets_the_segments_of_its_design():
    made = design.steps(seed=2, rate_hz=500, repeats=1)
    rows = len(made.reference) + 700
    log = ulna.Record.from_arrays(np.arange(rows) / 500, {"x": np.arange(rows)})
    marked = made.mark(log, start_s=1.0)
    assert [(s.begin, s.end) for s in marked.segments] == [
        (s.begin + 500, s.end + 500) for s in made.segments
    ]
    with pytest.raises(ulna.DataError, match="record longer"):
        made.mark(log, start_s=5.0)
    with pytest.raises(ulna.ArgumentError):
        made.mark(log, start_s=-1.0)


# Safety ------------------------------------------------------------------------------------------


def loop_matrices(arm, kp, kd, mass):
    """A, B, C, D from [Kp r + Kd r'] to position, velocity and force on the robot."""
    n = arm.n
    inverse = np.linalg.inv(arm.M + mass * np.eye(n))
    a = np.block([
        [np.zeros((n, n)), np.eye(n)],
        [-inverse @ (arm.K + kp * np.eye(n)), -inverse @ (arm.B + kd * np.eye(n))],
    ])  # fmt: skip
    b = np.vstack([np.zeros((n, n)), inverse])
    to_force = -arm.M @ a[n:] - np.hstack([arm.K, arm.B])
    c = np.vstack([np.eye(2 * n), to_force])
    d = np.vstack([np.zeros((2 * n, n)), -arm.M @ inverse])
    return a, b, c, d


def test_predicted_motion_and_force_agree_with_scipy():
    made = design.steps(seed=1, rate_hz=500, repeats=1)
    robot = Robot(stiffness=500.0, damping=35.0, mass=1.1)
    u = 500.0 * made.reference + 35.0 * made.reference_rate
    _, y, _ = signal.lsim(loop_matrices(P1, 500.0, 35.0, 1.1), u, made.time_s)
    for name, columns in (("position", y[:, :2]), ("velocity", y[:, 2:4]), ("force", y[:, 4:])):
        mine = made.respond(P1, robot=robot, response=name)
        assert np.abs(mine - columns).max() < 1e-9 * np.abs(columns).max()
    found = made.check(P1, robot=robot, noise=Noise(tremor=0), limits=Limits(force=1.0))
    assert found.peaks["force"][:2] == pytest.approx(np.abs(y[:, 4:]).max(axis=0), rel=1e-9)
    size = np.linalg.norm(y[:, 4:], axis=1)
    assert found.peaks["force"][2] == pytest.approx(size.max(), rel=1e-9)
    assert found.time_s == found.peak_times_s["force"][2] == np.argmax(size) / 500
    assert found.scale == pytest.approx(1 / size.max(), rel=1e-9)
    assert not found.within and found.tightest == "force"
    assert f"at {found.time_s:g} s, mostly along {found.axis}" in found.message


def test_the_allowed_scale_is_allowed():
    made = design.multisine(peak=20, unit="mm", seed=1)
    limits = Limits(force=12.0, displacement=0.03, velocity=0.15)
    found = made.check(limits=limits)
    assert not found.within and 0 < found.scale < 1
    assert found.scale == min(found.scales.values())
    again = made.scaled(0.9999 * found.scale).check(limits=limits)
    assert again.within and again.scale == pytest.approx(1 / 0.9999, rel=1e-9)
    assert "Within limits" in again.message and "Out of limits" in found.message
    text = found.summary()
    assert all(word in text for word in ("force (N)", "vector", "limit", found.message[:30]))
    none = made.check()
    assert none.within and none.scale == np.inf and "No limit" in none.message


def test_tremor_adds_to_the_peaks():
    made = design.multisine(seed=1)
    calm, shaky = (made.check(noise=Noise(tremor=t), limits=Limits(force=20)) for t in (0.0, 2.0))
    assert not calm.tremor["force"].any()
    for name in ("force", "displacement", "velocity"):
        assert shaky.peaks[name] == pytest.approx(calm.peaks[name] + shaky.tremor[name])
    # A rigid robot takes all of the tremor as force: three standard deviations.
    rigid = made.check(robot=Robot(stiffness=1e7, damping=1e4), noise=Noise(tremor=2.0))
    assert rigid.tremor["force"][:2] == pytest.approx([6.0, 6.0], rel=1e-3)
    alone = made.check(noise=Noise(tremor=9.0), limits=Limits(force=5.0))
    assert alone.scale == 0 and "even without a perturbation" in alone.message


def test_joints_are_judged_one_by_one():
    arm = Arm(M=np.diag([0.2, 0.1]), B=np.diag([1.0, 0.5]), K=np.diag([10.0, 5.0]))
    made = design.multisine(unit="deg", peak=2, axes=("q1", "q2"), seed=1)
    robot, noise = Robot(stiffness=100.0, damping=5.0, mass=0.05), Noise(tremor=0.05)
    found = made.check(arm, robot=robot, limits=Limits(force=1.0), noise=noise)
    assert found.units["force"] == "N m" and "torque" in found.message
    # What the tremor leaves of the limit, over what the design alone makes of it.
    tremor, peaks = found.tremor["force"][:2], found.peaks["force"][:2]
    assert found.scale == pytest.approx(min((1 - tremor) / (peaks - tremor)), rel=1e-12)
    both = made.check(arm, robot=robot, limits=Limits(force=1.0, per_axis=False), noise=noise)
    assert 0 < both.scale < found.scale


def test_force_designs_need_a_robot_that_follows():
    push = design.steps(unit="N", seed=1)
    found = push.check(limits=Limits(displacement=0.2))
    assert found.within
    with pytest.raises(ulna.AnalysisError, match="unstable"):
        push.check(Arm(M=np.eye(2), B=np.eye(2), K=-50 * np.eye(2)))


def test_bad_arms_robots_noises_and_limits():
    made = design.multisine(seed=1, rate_hz=100)
    for keywords in (
        {"limits": Limits(force=0.0)},
        {"limits": Limits(velocity=-1.0)},
        {"limits": Limits(displacement=float("nan"))},
        {"sigmas": -1.0},
        {"noise": Noise(tremor=-1.0)},
        {"noise": Noise(tremor_band_hz=(5.0, 1.0))},
        {"noise": Noise(tremor_band_hz=(0.0, 0.0))},
        {"noise": Noise(tremor_band_hz=5.0)},
        {"robot": Robot(stiffness=np.eye(3))},
        {"robot": Robot(mass=float("nan"))},
    ):
        with pytest.raises(ulna.ArgumentError):
            made.check(**keywords)
    for arm in (Arm(M=1, B=1, K=1), {"M": 1}, {"M": 1, "B": 1, "K": 1, "Z": 1}, 3.0, "P1"):
        with pytest.raises(ulna.ArgumentError):
            made.check(arm)
    for matrices in ({"M": np.ones((2, 3))}, {"K": [[np.nan, 0], [0, 1]]}):
        with pytest.raises(ulna.ArgumentError):
            Arm(**matrices)
    with pytest.raises(ulna.ArgumentError):
        made.check(Arm(x0=[0.0]))
    with pytest.raises(ulna.ArgumentError, match="response"):
        made.respond(response="jerk")


# Plans -------------------------------------------------------------------------------------------


def coloured(rng, runs, rows, rate, tremor, band):
    """Spectra (runs, bins, n) of Gaussian force of flat density in a band, over twice the rows."""
    bins = rows + 1  # of a sequence of 2 rows
    freq = np.arange(bins) * rate / (2 * rows)
    inside = (freq >= band[0]) & (freq <= band[1])
    raw = rng.normal(size=(runs, bins, 2)) + 1j * rng.normal(size=(runs, bins, 2))
    raw[:, 0] = np.sqrt(2) * raw[:, 0].real  # power at 0 Hz counts once, and is real
    density = tremor**2 / (band[1] - band[0])  # one-sided
    return freq, raw * inside[:, None] * np.sqrt(density * rows * rate / 2)


def recordings(made, arm, kp, kd, mass, noise, runs, seed):
    """Simulated recordings, by scipy's lsim for the reference and by spectra for the tremor."""
    n, rows, rate = made.n, len(made.reference), made.rate_hz
    # The robot moves smoothly between the rows: lsim's straight lines at five times the rate.
    time = np.arange(5 * rows - 4) / (5 * rate)
    reference = interpolate.CubicHermiteSpline(made.time_s, made.reference, made.reference_rate)
    speed = interpolate.CubicHermiteSpline(
        made.time_s, made.reference_rate, made.reference_acceleration
    )
    u = reference(time) if made.kind == "force" else kp * reference(time) + kd * speed(time)
    spring = 0.0 if made.kind == "force" else kp
    system = loop_matrices(arm, spring, kd, mass)
    caused = signal.lsim(system, u, time)[1][::5]
    rng = np.random.default_rng(seed)
    freq, force = coloured(rng, runs, rows, rate, noise.tremor, noise.tremor_band_hz)
    force = force[:, :, :n]
    s = 2j * np.pi * freq[:, None, None]
    eye = np.eye(n)
    used = freq <= noise.tremor_band_hz[1]
    z = (arm.M * s**2 + arm.B * s + arm.K)[used]
    both = z + ((mass * s**2 + kd * s + spring) * eye)[used]
    moved = np.zeros_like(force)
    moved[:, used] = np.einsum("fij,rfj->rfi", np.linalg.inv(both), force[:, used])
    pushed = force.copy()
    pushed[:, used] -= np.einsum("fij,rfj->rfi", z, moved[:, used])
    for i in range(runs):
        x = np.fft.irfft(moved[i], 2 * rows, axis=0)[:rows] + caused[:, :n]
        f = np.fft.irfft(pushed[i], 2 * rows, axis=0)[:rows] + caused[:, 2 * n :]
        x += noise.position * rng.normal(size=x.shape)
        f += noise.force * rng.normal(size=f.shape)
        names = made.axes
        channels = {name: x[:, a] for a, name in enumerate(names)}
        channels |= {f"F_{name}": f[:, a] for a, name in enumerate(names)}
        channels |= {f"{name}_ref": made.reference[:, a] for a, name in enumerate(names)}
        roles = {f"{name}_ref": "reference" for name in names}
        log = ulna.Record.from_arrays(made.time_s, channels, roles=roles, units=dict.fromkeys(names, "m"))
        yield made.mark(log) if len(made.segments) > 1 else log


def natural(estimate):
    return np.concatenate([estimate.M.ravel(), estimate.B.ravel(), estimate.K.ravel(), estimate.x0])


def monte_carlo(made, arm, kp, kd, mass, noise, runs, seed):
    iv, ls = [], []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ulna.UncertainResult)
        for log in recordings(made, arm, kp, kd, mass, noise, runs, seed):
            estimate = ulna.identify_impedance(log, draws=100, threads=1)
            assert estimate.estimator == "instrumental_variables"
            iv.append(natural(estimate))
            ls.append(natural(estimate.least_squares))
    return np.array(iv), np.array(ls)


ONE = Arm(M=1.89, B=10.6, K=125.43)
CASES = {
    "stiff robot": (lambda: design.multisine(peak=0.02, rate_hz=200, seed=1), P1, 3000, 90, 1.1, 0.3),
    "soft robot": (lambda: design.multisine(peak=0.02, rate_hz=200, seed=2), P1, 500, 35, 1.1, 0.5),
    "steps": (lambda: design.steps(size=0.01, rate_hz=200, seed=1), P1, 3000, 90, 1.1, 0.3),
    "binary force": (lambda: design.random_binary(amplitude=4, rate_hz=200, seed=1), ONE, 0, 5, 1.1, 0.3),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_foreseen_errors_are_those_of_simulated_experiments(case):
    _compare_with_simulations(case, runs=100, seed=11)


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_foreseen_errors_in_many_simulated_experiments(case):
    _compare_with_simulations(case, runs=600, seed=12)


def _compare_with_simulations(case, runs, seed):
    make, arm, kp, kd, mass, tremor = CASES[case]
    made = make()
    noise = Noise(tremor=tremor, force=1 / 24, position=2e-6)
    robot = Robot(stiffness=None if kp == 0 else kp, damping=kd, mass=mass)
    expected = design.plan(made, arm, robot=robot, noise=noise)
    iv, ls = monte_carlo(made, arm, kp, kd, mass, noise, runs, seed)
    ratio = expected._errors / iv.std(axis=0, ddof=1)
    # The spread of R runs is itself known to 1 / sqrt(2 R): 7 % for 100. A quarter allows for three
    # and a half of these among four designs and 14 parameters, and for what the first order leaves.
    assert np.all(np.abs(ratio - 1) < 0.25), (case, ratio.round(2))
    # No bias of the instruments beyond their own error of the mean.
    truth = np.concatenate([arm.M.ravel(), arm.B.ravel(), arm.K.ravel(), arm.x0])
    assert np.all(np.abs(iv.mean(axis=0) - truth) < 4.5 * expected._errors / np.sqrt(runs))
    # Least squares: its bias within a tenth and the error of the mean, its spread as the others.
    n = 3 * arm.n**2
    spread = ls.std(axis=0, ddof=1)[:n]
    found = (ls.mean(axis=0) - truth)[:n]
    allowed = 0.1 * np.abs(found) + 4.5 * spread / np.sqrt(runs)
    assert np.all(np.abs(expected.least_squares_bias[:n] - found) < allowed), case
    ratio = expected.least_squares_se[:n] / spread
    assert np.all(np.abs(ratio - 1) < 0.3), (case, ratio.round(2))


def test_foreseen_errors_are_those_that_an_estimate_reports():
    make, arm, kp, kd, mass, tremor = CASES["soft robot"]
    made, noise = make(), Noise(tremor=tremor, force=1 / 24, position=2e-6)
    expected = design.plan(made, arm, robot=Robot(stiffness=kp, damping=kd, mass=mass), noise=noise)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ulna.UncertainResult)
        reported = [
            np.sqrt(np.diag(ulna.identify_impedance(log, draws=100, threads=1).cov))
            for log in recordings(made, arm, kp, kd, mass, noise, 12, 5)
        ]
    # Newey-West from one recording scatters by a fifth; the median of twelve by a tenth, and it is
    # low by its lag of 0.4 s.
    ratio = np.median(reported, axis=0) / expected._errors
    assert np.all((ratio > 0.6) & (ratio < 1.35)), ratio.round(2)


def test_time_and_error():
    made = design.multisine(seed=1)
    one, four = design.plan(made), design.plan(made, repetitions=4)
    assert four.minutes == pytest.approx(4 * one.minutes) == pytest.approx(200 / 60)
    assert np.allclose(four.se("K"), one.se("K") / 2, rtol=1e-12)
    minutes = one.minutes_for("K_xx", 0.05)
    there = design.plan(made, minutes=minutes)
    assert there.relative["K_xx"] == pytest.approx(0.05, rel=1e-9)
    assert one.minutes_for("K_xx", 0.025) == pytest.approx(4 * minutes)
    text = one.summary()
    assert "Minutes for 5 %" in text and "Motion by the human" in text and "K N/m" in text
    assert one.names[0] == "M_xx" and one.names[-1] == "x0_y" and len(one.names) == 14


def test_larger_stiffer_and_calmer_is_better():
    made = design.multisine(seed=1)
    base = design.plan(made).se("K")
    assert np.all(design.plan(made.scaled(2)).se("K") < base)
    assert np.all(design.plan(made, noise=Noise(tremor=0.5)).se("K") < base)
    soft = design.plan(made, robot=Robot(stiffness=300, damping=30))
    assert np.all(soft.rho > design.plan(made).rho)
    assert np.all(np.abs(soft.least_squares_bias[8]) > np.abs(design.plan(made).least_squares_bias[8]))


def test_least_squares_can_be_planned():
    made = design.multisine(seed=1)
    robot = Robot(stiffness=500, damping=35)
    ls = design.plan(made, robot=robot, estimator="least_squares")
    iv = design.plan(made, robot=robot)
    assert np.array_equal(ls.bias, iv.least_squares_bias) and not iv.bias.any()
    assert ls.bias[8] < 0 and "biased" in ls.warnings[0]
    assert np.allclose(ls._errors, iv.least_squares_se)


def test_an_estimate_is_a_prior():
    estimate = ulna.identify_impedance(ulna.read(RECORDING))
    expected = design.multisine(seed=1).plan(estimate)
    assert np.array_equal(expected.value("K"), estimate.K)
    assert not expected.value("x0").any()
    as_mapping = {"M": estimate.M, "B": estimate.B, "K": estimate.K}
    assert np.array_equal(design.multisine(seed=1).plan(as_mapping).se("B"), expected.se("B"))


def test_plans_are_compared_at_the_same_length():
    small = design.multisine(peak=0.005, seed=1).plan()
    large = design.multisine(peak=0.010, seed=1).plan(repetitions=3)
    steps = design.steps(seed=1).plan()
    found = design.compare(small, large, steps=steps, minutes=5)
    assert found.labels == ("multisine 1", "multisine 2", "steps")
    assert found.relative.shape == (3, 12) and found.minutes == 5
    k = found.parameters.index("K_xx")
    # Four times the power is half the error, whatever was planned for it.
    assert found.relative[0, k] == pytest.approx(2 * found.relative[1, k], rel=1e-3)
    assert found.best["K_xx"] == "multisine 2" and "K_xx" in found.summary()
    assert small.compare(large).labels == ("multisine 1", "multisine 2")
    for wrong in ((), (3,)):
        with pytest.raises(ulna.ArgumentError):
            design.compare(*wrong)
    with pytest.raises(ulna.ArgumentError, match="same axes"):
        design.compare(small, design.random_binary(seed=1).plan(ONE))


def test_bad_plans():
    made = design.multisine(seed=1, rate_hz=100)
    for keywords in (
        {"minutes": 0}, {"minutes": 1, "repetitions": 2}, {"repetitions": -1}, {"train_s": 0},
        {"model": "best"}, {"estimator": "ml"}, {"refit": "yes"}, {"condition_limit": 0},
        {"noise": Noise(force=-1.0)}, {"noise": Noise(position=float("nan"))}, {"lowpass_hz": 80.0},
    ):  # fmt: skip
        with pytest.raises(ulna.ArgumentError):
            design.plan(made, **keywords)
    with pytest.raises(ulna.ArgumentError):
        design.plan("multisine")
    with pytest.raises(ulna.AnalysisError, match="does not determine"):
        design.multisine(lines_hz=[1.0], axes=("x",), seed=1).plan(ONE)
    expected = made.plan()
    for name, share in (("K_zz", 0.05), ("x0_x", 0.05), ("K_xx", 0.0)):
        with pytest.raises(ulna.ArgumentError):
            expected.minutes_for(name, share)
    with pytest.raises(ulna.ArgumentError):
        expected.se("Z")


def test_weak_instruments_are_told():
    made = design.multisine(peak=0.0005, seed=1)
    expected = made.plan(robot=Robot(stiffness=50, damping=10), noise=Noise(tremor=3.0))
    assert expected.weakness > 0.3 and "errors will be larger" in expected.warnings[0]


# Figures and the command ---------------------------------------------------------------------------


def _titles(figure):
    return [ax.get_title(loc="left") for ax in figure.axes]


def test_figures():
    plt = pytest.importorskip("matplotlib.pyplot")
    plt.switch_backend("Agg")
    figure = design.multisine(seed=1).plot()
    assert len(figure.axes) == 4 and _titles(figure)[2:] == ["Lines", "Path"]
    figure = design.random_binary(seed=1).plot()
    assert _titles(figure)[1:] == ["Spectrum", "Phase plane"]
    made = design.steps(seed=1, rate_hz=200)
    assert "16 perturbations" in _titles(made.plot())[0]
    axes = made.check(limits=Limits(force=5.0, velocity=1.0)).plot()
    titles = [ax.get_title(loc="left") for ax in axes]
    assert "exceeded" in titles[0] and "limit 1000 mm/s" in titles[2]
    expected = made.plan()
    assert "Predicted errors" in expected.plot().get_title(loc="left")
    both = design.compare(expected, other=expected).plot()
    assert [text.get_text() for text in both.get_legend().get_texts()] == ["steps", "other"]
    plt.close("all")


def _run(capsys, *words):
    assert cli.main(["design", *map(str, words)]) == cli.OK
    out, err = capsys.readouterr()
    assert err == ""
    return out


def test_command(capsys, tmp_path):
    path = tmp_path / "design.csv"
    out = _run(
        capsys, "multisine", "--peak", 15, "--unit", "mm", "--seed", 4, "--rate", 500, "--out", path,
        "--limit-force", 20, "--minutes", 5, "--plot",
    )  # fmt: skip
    assert "limits: " in out and "Plan of 5 minutes" in out and str(path) in out
    assert max(len(line) for line in out.splitlines() if "tmp" not in line) <= 80
    assert np.array_equal(
        ulna.read(path).values, design.multisine(peak=15, unit="mm", seed=4, rate_hz=500).reference
    )
    assert (tmp_path / "design.png").stat().st_size > 10_000
    found = json.loads(_run(capsys, "steps", "--size", 2, "--unit", "N", "--json", "--rate", 500))
    assert found["kind"] == "force" and len(found["segments"]) == 16 and found["table"] is None
    assert found["safety"]["within"] and found["safety"]["scale"] is None
    assert len(found["plan"]["standard_error"]) == 14
    found = json.loads(_run(capsys, "binary", "--clock", 0.4, "--json", "--rate", 500))
    assert found["axes"] == ["y"] and found["plan"]["value"][2] == 125.43
    found = json.loads(
        _run(capsys, "multisine", "--fit", "--limit-force", 8, "--json", "--rate", 500)
    )
    assert found["safety"]["within"] and found["safety"]["scale"] == pytest.approx(1.001, abs=1e-3)


def test_command_takes_an_estimate_as_prior(capsys, tmp_path):
    cli.main(["assess", str(RECORDING), "--json"])
    path = tmp_path / "arm.json"
    path.write_text(capsys.readouterr().out)
    found = json.loads(_run(capsys, "multisine", "--arm", path, "--json", "--rate", 500))
    assert found["plan"]["value"][8] == json.loads(path.read_text())["K"][0][0]


@pytest.mark.parametrize(
    "words",
    [
        ["multisine", "--unit", "kg"],
        ["multisine", "--peak", "-1"],
        ["multisine", "--peak", "1", "--rms", "1"],
        ["multisine", "--band", "3"],
        ["multisine", "--fit"],
        ["multisine", "--fit", "--limit-force", "0.5"],
        ["multisine", "--arm", "none.json"],
        ["multisine", "--out", "."],
        ["multisine", "--axes", "x,y,z"],
        ["steps", "--hold", "2,1"],
        ["steps", "--seed", "one"],
        ["binary", "--clock", "0"],
        ["waves"],
        [],
    ],
)
def test_bad_commands_are_one_sentence(capsys, words):
    assert cli.main(["design", *words]) == cli.BAD_INPUT
    out, err = capsys.readouterr()
    assert out == "" and err.startswith("ulna") and err.count("\n") == 1 and "Traceback" not in err


def test_help_shows_examples(capsys):
    for words in (["design"], ["design", "multisine"], ["design", "steps"], ["design", "binary"]):
        assert cli.main([*words, "--help"]) == cli.OK
        out = capsys.readouterr().out
        assert "examples:" in out and "ulna design" in out
