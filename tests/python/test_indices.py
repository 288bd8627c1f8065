"""Passivity indices, two-ports, and what a delay allows, through the Python surface."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest
import ulna
from ulna import passivity, systems, teleoperation

ROOT = Path(__file__).resolve().parents[2]
INF = np.inf


def tf(num, den):
    return ulna.TransferFunction(num, den)


@pytest.fixture(scope="module")
def bundled():
    return ulna.identify_impedance(ulna.read(ROOT / "examples" / "data" / "relaxed-arm.csv"))


# Indices -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("space", [False, True])
@pytest.mark.parametrize(
    ("num", "den", "input", "output", "verdict"),
    [
        ([1, 0], [1, 0.2, 1], 0.0, 0.2, "passive"),
        ([1, 1, 5, 0.1], [1, 2, 3, 4], 0.025, None, "passive"),
        ([2, 14, 20], [1, 4, 10], 2.0, 2 / 7, "passive"),
        ([1.5, 6, 40], [1, 0], 6.0, 0.0, "passive"),
        ([1, 3.1], [1, 3, 2], -3.876493197e-4, -0.1, "not passive"),
        ([1], [1, -1], -INF, -1.0, "not passive"),
        ([1], [1, 0, 0], -INF, -INF, "not passive"),
        ([1, 0], [1, 0, 1], 0.0, 0.0, "passive"),
        ([1, 0, 1], [1, 1, 1], 0.0, 1.0, "undecided"),
    ],
)
def test_closed_forms(num, den, input, output, verdict, space):
    h = tf(num, den).to_state_space() if space else tf(num, den)
    found = passivity.indices(h)
    assert found.verdict == verdict
    assert found.input == pytest.approx(input, abs=1e-12)
    if output is not None:
        assert found.output == pytest.approx(output, abs=1e-12)
    assert passivity.is_positive_real(h) is {"passive": True, "not passive": False}.get(verdict)
    assert (found.relative <= 1 + 1e-9) == (verdict != "not passive")


def test_frequencies():
    assert passivity.indices(tf([1, 1, 5, 0.1], [1, 2, 3, 4])).input_frequency_rad_s == 0.0
    found = passivity.indices(tf([2, 14, 20], [1, 4, 10]))
    assert found.output_frequency_rad_s == pytest.approx(np.sqrt(10), rel=1e-6)
    found = passivity.indices(tf([1, 3.1], [1, 3, 2]))
    assert found.input_frequency_rad_s == pytest.approx(11.25, abs=5e-3)
    assert found.output_frequency_rad_s == INF


def test_undecided_depends_on_the_tolerance():
    h = tf([1, 3 - 1e-7], [1, 3, 2])  # passive by a ten millionth
    assert passivity.indices(h).verdict == "passive"
    assert passivity.indices(h, tolerance=1e-5).verdict == "undecided"
    assert passivity.is_positive_real(h, tolerance=1e-5) is None
    assert passivity.indices(tf([1, 3 + 1e-7], [1, 3, 2]), tolerance=0).verdict == "not passive"


def test_modes_that_cancel_are_named():
    found = passivity.indices(tf([1, -1], [1, 1, -2]))
    assert found.verdict == "passive" and "cancels" in found.notes[0]
    space = ulna.StateSpace(np.diag([1.0, -2.0]), [[0], [1]], [[1, 1]], [[0]])
    found = passivity.indices(space)  # an uncontrollable mode
    assert found.verdict == "passive" and "cancels" in found.notes[0]


def test_a_band_and_a_direction():
    h = tf([1, 3.1], [1, 3, 2])
    low = passivity.indices(h, band_rad_s=(0, 5))
    assert low.verdict == "passive" and low.input_frequency_rad_s == 5.0
    assert passivity.indices(h, band_rad_s=(5, INF)).input == pytest.approx(-3.876493197e-4)
    b = np.array([[5.75, -3.39], [-0.94, 10.60]])
    z = systems.impedance(np.eye(2), b, np.eye(2))
    for angle in np.linspace(0, 3, 7):
        d = np.array([np.cos(angle), np.sin(angle)])
        found = passivity.indices(z, direction=5 * d)
        assert found.input == pytest.approx(d @ b @ d, abs=1e-12)
        assert np.allclose(found.direction, d)
    assert passivity.indices(z).input == pytest.approx(4.924177, abs=1e-6)


def test_an_estimate(bundled):
    found = passivity.indices(bundled)
    assert found.input == pytest.approx(passivity.of_model(bundled.M, bundled.B, bundled.K).b_min)
    assert found.verdict == "passive"
    assert any("antisymmetric" in note for note in found.notes)
    # As it stands, the skew part of M needs unbounded energy.
    assert passivity.indices(systems.as_system(bundled)).input == -INF
    assert passivity.indices(bundled, antisymmetry_threshold=0.0).verdict == "not passive"


def random_system(rng):
    """Two ports of order up to four with a spread of frequencies, damped or nearly so."""
    n = int(rng.integers(1, 5))
    a = rng.normal(size=(n, n))
    a -= (np.linalg.eigvals(a).real.max() + rng.exponential(0.3) + 1e-3) * np.eye(n)
    b, c = rng.normal(size=(2, n, 2))
    d = np.diag(rng.exponential(2.0, 2)) + 0.3 * rng.normal(size=(2, 2))
    return a, b, c.T, d


def test_random_systems_agree_with_a_sweep():
    rng = np.random.default_rng(3)
    for _ in range(150):
        a, b, c, d = random_system(rng)
        found = passivity.indices(ulna.StateSpace(a, b, c, d))
        omega = np.concatenate([[0.0], np.geomspace(1e-3, 1e4, 700)])
        h = np.array([c @ np.linalg.solve(1j * w * np.eye(len(a)) - a, b) + d for w in omega])
        swept = np.linalg.eigvalsh((h + h.conj().transpose(0, 2, 1)) / 2)[:, 0]
        assert found.input <= swept.min() + 1e-9
        curve = found.curves(omega)[:, 0]
        assert np.allclose(curve, swept, atol=1e-9)
        if np.isfinite(found.input_frequency_rad_s):
            here = found.curves([found.input_frequency_rad_s])[0, 0]
            assert here == pytest.approx(found.input, abs=1e-9)
        if abs(swept.min()) > 1e-3:
            # A dip between the samples goes deeper by far less than this.
            assert found.verdict == ("passive" if swept.min() > 0 else "not passive")


def test_beside_python_control():
    """Where its linear matrix inequality can be solved, the answer is the same."""
    control = pytest.importorskip("control")
    pytest.importorskip("cvxopt")
    rng = np.random.default_rng(8)
    compared = 0
    for _ in range(12):
        a, b, c, d = random_system(rng)
        theirs = control.ss(a, b, c, d)
        mine = passivity.indices(theirs)
        if abs(mine.input) > 1e-2:
            assert control.ispassive(theirs) == (mine.verdict == "passive")
            compared += 1
        if mine.verdict != "passive":
            continue
        try:
            found = control.get_input_ff_index(theirs)
        except (RuntimeError, ValueError):
            continue
        # An interior-point solver stops some 1e-6 short.
        assert mine.input == pytest.approx(found, abs=1e-4)
        compared += 1
    assert compared >= 8


def test_words_and_figures():
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    z = systems.impedance(np.eye(2), [[5.75, -3.39], [-0.94, 10.60]], np.eye(2))
    for found in (
        passivity.indices(tf([1, 1, 5, 0.1], [1, 2, 3, 4])),
        passivity.indices(tf([1], [1, -1])),
        passivity.indices(tf([0], [1])),
        passivity.indices(2.0),
        passivity.indices(z),
        passivity.indices(z, direction=[1, 1], band_rad_s=(1, 10)),
        passivity.indices(tf([1, 0], [1, 0, 1])),
        passivity.two_port([[2, 1], [1, 2]]),
        passivity.two_port(z, shortage=-1.0, port=1),
        teleoperation.allowed_stiffness(3.0, delay_s=[0.001, 0.01], device_damping_n_s_m=1.0),
    ):
        words = found.summary()
        assert max(map(len, words.splitlines())) <= 80
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            drawn = np.atleast_1d(found.plot())
        assert all(ax.get_title() and ax.get_xlabel() and ax.get_ylabel() for ax in drawn.ravel())
        matplotlib.pyplot.close("all")
    with pytest.raises(ulna.ArgumentError, match="2 x 2"):
        passivity.indices(2.0).plot(matplotlib.pyplot.figure().subplots())
    matplotlib.pyplot.close("all")


# Two-ports ---------------------------------------------------------------------------------------


def test_the_limit_of_two_resistors():
    found = passivity.two_port([[2, 1], [1, 2]])
    assert found.largest_shortage == pytest.approx(1.5, abs=1e-14)
    assert found.verdict == "absolutely stable" and found.margin == pytest.approx(6.0)
    assert passivity.two_port([[2, 1], [1, 2]], shortage=1.6).verdict == "not absolutely stable"
    assert passivity.two_port([[2, 1], [1, 2]], shortage=1.5).verdict == "undecided"


def test_a_network_that_the_printed_theorem_passes():
    z = tf([[[1, 1], [2]], [[2], [1, 1]]], [1, 0])
    omega = np.geomspace(1e-3, 1e3, 200)
    h = z.frequency_response(omega)
    k = h[:, 0, 1] * h[:, 1, 0]
    # (4.1) holds at every frequency, z11 and z22 have a simple pole with a positive residue ...
    assert np.all(2 * h[:, 0, 0].real * h[:, 1, 1].real - k.real - np.abs(k) > 0)
    # ... but between an open and a short circuit z11 = z12 z21 / z22 at s = 1.
    assert 2.0 - 4.0 / 2.0 == 0.0
    found = passivity.two_port(z)
    assert found.verdict == "not absolutely stable" and found.largest_shortage == -INF


def test_the_excess_of_an_arm_stabilises():
    """A termination's excess counts as damping of the port that it ends."""
    z = tf([[[1, 1.0], [3.0]], [[3.0], [1, 1.0]]], [1])
    alone = passivity.two_port(z, port=1)
    assert alone.verdict == "not absolutely stable"
    needed = -alone.largest_shortage
    assert needed == pytest.approx(8.0)  # 2 (1 + e) 1 >= 2 * 9
    assert passivity.two_port(z, port=1, shortage=-8.1).verdict == "absolutely stable"
    damped = z + np.diag([8.1, 0.0])
    assert passivity.two_port(damped).verdict == "absolutely stable"


def test_curves_of_a_two_port():
    z = tf([[[3, 3], [1]], [[2], [2, 4]]], [1, 1])
    found = passivity.two_port(z, shortage=0.5)
    omega = np.geomspace(0.1, 10, 5)
    h = z.frequency_response(omega)
    k = h[:, 0, 1] * h[:, 1, 0]
    r1, r2 = h[:, 0, 0].real, h[:, 1, 1].real
    margin, tolerable = found.curves(omega).T
    assert np.allclose(margin, 2 * r1 * (r2 - 0.5) - k.real - np.abs(k))
    assert np.allclose(tolerable, r2 - (k.real + np.abs(k)) / (2 * r1))
    assert found.margin <= margin.min() and found.largest_shortage <= tolerable.min()


# What a delay allows -----------------------------------------------------------------------------

LOOP = {
    "master_damping_n_s_m": 2.0,
    "slave_damping_n_s_m": 1.0,
    "coupling_damping_n_s_m": 30.0,
    "coupling_stiffness_n_m": 200.0,
}


def test_gain_is_at_the_edge_of_the_two_port():
    """Llewellyn's criterion on the hybrid matrix with the delay, evaluated over frequency."""
    delay, excess = 0.05, 4.0
    gain = teleoperation.allowed_gain(excess, delay_s=[delay], **LOOP).allowed[0]
    omega = np.geomspace(1e-2, 1e4, 200_000)
    s = 1j * omega
    coupler = 30.0 + 200.0 / s
    slave = 0.4 * s + 1.0
    q = coupler / (slave + coupler)

    def margin(g):
        h11 = 0.9 * s + 2.0 + g * np.exp(-2 * s * delay) * q * slave
        k = -g * np.exp(-2 * s * delay) * q**2
        r2 = (1 / (slave + coupler)).real
        return (2 * (h11.real + excess) * r2 - k.real - np.abs(k)) / (np.abs(k) + r2)

    assert margin(0.999 * gain).min() > -1e-12 and margin(1.01 * gain).min() < -1e-6


def test_an_arm_gives_its_excess(bundled):
    delays = np.geomspace(1e-3, 0.3, 5)
    found = teleoperation.allowed_gain(bundled, delay_s=delays, **LOOP)
    verdict = bundled.passivity()
    assert found.excess == verdict.eop and found.excess_interval == verdict.eop_interval
    assert np.allclose(found.allowed / found.passive, (2 + verdict.eop) / 2)
    assert np.allclose(found.low / found.passive, (2 + verdict.eop_interval[0]) / 2)
    assert teleoperation.allowed_gain(verdict, delay_s=delays, **LOOP).excess == verdict.eop
    along = teleoperation.allowed_gain(bundled, delay_s=delays, direction=[0, 1], **LOOP)
    assert along.excess == pytest.approx(bundled.B[1, 1])
    assert along.excess_interval[0] < along.excess < along.excess_interval[1]


def test_without_delay_nothing_limits():
    found = teleoperation.allowed_gain(1.0, delay_s=[0.0], **LOOP)
    assert np.isinf(found.passive[0]) and "nothing limits" in found.reason
    mixed = teleoperation.allowed_stiffness(4.0, delay_s=[0.0, 0.01], device_damping_n_s_m=1.0)
    assert "5 times" in mixed.reason and np.isinf(mixed.allowed[0])
    nothing = teleoperation.allowed_stiffness(4.0, delay_s=[0.01], device_damping_n_s_m=0.0)
    assert nothing.passive[0] == 0 and "allows nothing" in nothing.reason


def test_an_uncertain_arm_is_not_called_safe():
    found = teleoperation.allowed_stiffness(
        (-1.0, 2.0, 5.0), delay_s=[0.01], device_damping_n_s_m=3.0
    )
    assert "not safe" in found.reason
    assert (found.low[0], found.passive[0], found.allowed[0]) == pytest.approx((200, 300, 500))


# Bad input ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "ask",
    [
        lambda: passivity.indices(tf([[[1], [1]]], [1, 1])),
        lambda: passivity.indices(tf([1], [1, 1]), tolerance=-1.0),
        lambda: passivity.indices(tf([1], [1, 1]), tolerance=np.nan),
        lambda: passivity.indices(tf([1], [1, 1]), band_rad_s=(2, 1)),
        lambda: passivity.indices(tf([1], [1, 1]), band_rad_s=(-1, 1)),
        lambda: passivity.indices(tf([1], [1, 1]), band_rad_s=3.0),
        lambda: passivity.indices(tf([1], [1, 1]), band_rad_s=(np.nan, 1.0)),
        lambda: passivity.indices(tf([1], [1, 1]), direction=[1, 2]),
        lambda: passivity.indices(tf([1], [1, 1]), direction=[0]),
        lambda: passivity.indices(tf([1], [1, 1]), direction=[]),
        lambda: passivity.indices("system"),
        lambda: passivity.indices(tf([1], [1, 1])).curves([-1.0]),
        lambda: passivity.two_port(tf([1], [1, 1])),
        lambda: passivity.two_port([[2, 1], [1, 2]], port=3),
        lambda: passivity.two_port([[2, 1], [1, 2]], shortage=np.nan),
        lambda: passivity.two_port([[2, 1], [1, 2]], band_rad_s=(1, 1)),
        lambda: passivity.two_port([[2, 1], [1, 2]]).curves([np.nan]),
        lambda: teleoperation.allowed_gain("arm", delay_s=[0.1], **LOOP),
        lambda: teleoperation.allowed_gain(np.nan, delay_s=[0.1], **LOOP),
        lambda: teleoperation.allowed_gain((3, 2, 1), delay_s=[0.1], **LOOP),
        lambda: teleoperation.allowed_gain(1.0, delay_s=[], **LOOP),
        lambda: teleoperation.allowed_gain(1.0, delay_s=[-0.1], **LOOP),
        lambda: teleoperation.allowed_gain(1.0, delay_s=[0.1], direction=[1, 0], **LOOP),
        lambda: teleoperation.allowed_gain(1.0, delay_s=[0.1], **{**LOOP, "slave_damping_n_s_m": -1}),
        lambda: teleoperation.allowed_gain(1.0, delay_s=[0.1], **{**LOOP, "coupling_damping_n_s_m": 0}),
        lambda: teleoperation.allowed_stiffness(1.0, delay_s=[0.1], device_damping_n_s_m=-1.0),
        lambda: teleoperation.allowed_stiffness(1.0, delay_s=[0.0], device_damping_n_s_m=1.0).plot(),
    ],
)
def test_wrong_arguments(ask):
    pytest.importorskip("matplotlib").use("Agg")
    with pytest.raises(ulna.ArgumentError) as caught:
        ask()
    words = str(caught.value)
    assert "\n" not in words and not words.endswith(".") and len(words) > 10
