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


# Random systems ----------------------------------------------------------------------------------

# The full size runs with the longer studies.
COUNTS = [150, pytest.param(10_000, marks=pytest.mark.slow)]


def random_polynomial(rng, degree, stable):
    """Of real and complex roots over some decades; unless stable, some in the right half-plane."""
    p = np.ones(1)
    while degree > 0:
        w, zeta = np.exp(2 * rng.normal()), rng.uniform(0.05, 1.55)
        if not stable and rng.random() < 0.3:
            zeta = -zeta
        pair = degree >= 2 and rng.random() < 0.6
        p = np.polymul(p, [1, 2 * zeta * w, w * w] if pair else [1, np.sign(zeta) * w])
        degree -= 2 if pair else 1
    return p


def random_rational(rng):
    """One to three ports, proper and improper, orders to six, some unstable; rows of num and den."""
    n = int(rng.integers(1, 4))
    common = random_polynomial(rng, int(rng.integers(7)), rng.random() < 0.9)
    shared, damped = rng.random() < 0.5, rng.random() < 0.75
    num, den = np.empty((n, n), dtype=object), np.empty((n, n), dtype=object)
    for i, j in np.ndindex(n, n):
        most = int(rng.integers(3 if n > 1 else 7))
        d = common if shared else random_polynomial(rng, most, rng.random() < 0.95)
        degree = max(0, d.size - 1 + int(rng.integers(-1, 2)))
        p = np.exp(rng.normal()) * random_polynomial(rng, degree, rng.random() < 0.8)
        if i == j:
            p = np.abs(p)
            p = np.polyadd(p, np.exp(1.5 * rng.normal()) * d) if damped else p
        num[i, j], den[i, j] = rng.choice([-1.0, 1.0]) * p if i != j else p, d
    return num.tolist(), den.tolist()


def evaluated(num, den, omega):
    s = 1j * omega
    rows = zip(num, den, strict=True)
    return np.stack(
        [
            np.stack([np.polyval(p, s) / np.polyval(q, s) for p, q in zip(*row, strict=True)], -1)
            for row in rows
        ],
        -2,
    )


def least(h):
    return np.linalg.eigvalsh((h + h.conj().swapaxes(-1, -2)) / 2)[..., 0]


@pytest.mark.parametrize("count", COUNTS)
def test_random_systems_agree_with_a_sweep(count):
    """NumPy's sweep over ten decades: the indices bound it, are met, and have its verdict."""
    rng = np.random.default_rng(3)
    decided = 0
    for trial in range(count):
        num, den = random_rational(rng)
        h = tf(num, den)
        scale = np.exp(np.mean([np.log(abs(p)) for p in h.poles() if p] or [0.0]))
        omega = scale * np.geomspace(1e-5, 1e5, 600)
        at = evaluated(num, den, omega)
        one = np.eye(len(num))
        swept = least(at)
        size = np.linalg.norm(at[swept.argmin()])
        found = passivity.indices(h.to_state_space() if rng.random() < 0.3 else h)
        # What rounding leaves of the samples, most at the ends of the sweep.
        assert found.input <= swept.min() + 1e-7 * (abs(swept.min()) + 1e-3 * size), trial
        inverse = least(np.linalg.inv(at)).min()
        assert found.output <= inverse + 1e-7 * abs(inverse) + 1e-9, trial
        gain = np.linalg.norm((one - at) @ np.linalg.inv(one + at), 2, axis=(1, 2)).max()
        assert found.relative >= gain * (1 - 1e-7), trial
        here = found.input_frequency_rad_s
        if np.isfinite(found.input) and 0 < here < INF:
            value = evaluated(num, den, np.array([here]))
            assert least(value)[0] == pytest.approx(
                found.input, rel=1e-6, abs=1e-9 * np.linalg.norm(value)
            ), trial
        # Where the sweep decides: an unstable mode does not show in it, nor what a pole on the axis
        # or infinity leaves.
        stable = np.all(h.poles().real <= 0)
        clear = 1e-6 * size
        if stable and swept.min() < -clear:
            assert found.verdict == "not passive", trial
            decided += 1
        elif stable and swept.min() > clear and np.isfinite([found.input, here]).all():
            assert found.verdict == "passive", trial
            decided += 1
        elif not stable and found.verdict == "passive":
            assert found.notes, trial
    assert decided > 0.6 * count


def random_space(rng):
    """Two ports of order up to four with a spread of frequencies, damped or nearly so."""
    n = int(rng.integers(1, 5))
    a = rng.normal(size=(n, n))
    a -= (np.linalg.eigvals(a).real.max() + rng.exponential(0.3) + 1e-3) * np.eye(n)
    b = rng.normal(size=(n, 2))
    c = b.T + rng.exponential(0.7) * rng.normal(size=(2, n))  # near to collocated, or not
    d = np.diag(rng.exponential(2.0, 2)) + 0.3 * rng.normal(size=(2, 2))
    return a, b, c, d


@pytest.mark.parametrize("count", [12, pytest.param(300, marks=pytest.mark.slow)])
def test_beside_python_control(count):
    """Where its linear matrix inequality can be solved, the answer is the same."""
    control = pytest.importorskip("control")
    pytest.importorskip("cvxopt")
    rng = np.random.default_rng(8)
    verdicts = {True: 0, False: 0}
    indices = 0
    for trial in range(count):
        theirs = control.ss(*random_space(rng))
        mine = passivity.indices(theirs)
        if abs(mine.input) > 1e-2:
            passive = bool(control.ispassive(theirs))
            assert passive == (mine.verdict == "passive"), trial
            verdicts[passive] += 1
        if mine.verdict != "passive":
            continue
        for value, peer in (
            (mine.input, control.get_input_ff_index),
            (mine.output, control.get_output_fb_index),
        ):
            try:
                index = peer(theirs)
            except (RuntimeError, ValueError):
                continue
            # An interior-point solver stops some 1e-6 short.
            assert value == pytest.approx(index, abs=1e-4), trial
            indices += 1
    assert min(verdicts.values()) >= count / 6 and indices >= count / 4


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
        assert all(ax.get_title(loc="left") and ax.get_xlabel() and ax.get_ylabel() for ax in drawn.ravel())
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


def random_network(rng):
    """z of two rows: damped own impedances, some with a mass, and couplings of any size."""
    poles = [[1, np.exp(rng.normal())] for _ in range(5)]
    shared = rng.random() < 0.6
    common = np.ones(1)
    for pole in poles[: int(rng.integers(4))]:
        common = np.polymul(common, pole)
    coupling = np.exp(1.2 * rng.normal())
    num, den = [], []
    for k in range(4):
        own = k in (0, 3)
        d = common if shared else np.array([1, np.exp(rng.normal())])
        p = rng.normal(size=d.size) * (1.0 if own else coupling)
        if own:
            p = np.abs(p) + 2 * np.exp(rng.normal()) * d
            if rng.random() < 0.3:
                p = np.polyadd(p, np.exp(rng.normal()) * np.polymul(d, [1, 0]))
        num.append(p)
        den.append(d)
    return [num[:2], num[2:]], [den[:2], den[2:]]


def worst_terminated(z11, k, c):
    """Least Re(z11 - k / (c + j x)) over x, by trial: every frequency at once."""
    angle = np.linspace(-1.57, 1.57, 201)
    values = (z11[:, None] - k[:, None] / (c[:, None] * (1 + 1j * np.tan(angle)))).real
    best = angle[values.argmin(axis=1)]
    value, step = values.min(axis=1), angle[1] - angle[0]
    for _ in range(30):
        for moved in (best - step, best + step):
            here = (z11 - k / (c * (1 + 1j * np.tan(moved)))).real
            best, value = np.where(here < value, moved, best), np.minimum(here, value)
        step *= 0.7
    return value


def loop_unstable(num, den, first, second):
    """Of the network between (m s + b + k / s) and another, given as [m, b, k]."""
    x = np.polyadd(np.polymul(num[0][0], [1, 0]), np.polymul(first, den[0][0]))
    y = np.polyadd(np.polymul(num[1][1], [1, 0]), np.polymul(second, den[1][1]))
    direct = np.polymul(np.polymul(x, y), np.polymul(den[0][1], den[1][0]))
    across = np.polymul(np.polymul(num[0][1], num[1][0]), np.polymul(den[0][0], den[1][1]))
    roots = np.roots(np.polysub(direct, np.polymul(across, [1, 0, 0])))
    return np.any(roots.real > 1e-3 * np.abs(roots))


@pytest.mark.parametrize("count", COUNTS)
def test_random_networks_agree_with_the_worst_termination(count):
    """No network is called stable that a termination found by brute force makes unstable."""
    rng = np.random.default_rng(11)
    verdicts = {"absolutely stable": 0, "not absolutely stable": 0, "undecided": 0}
    for trial in range(count):
        num, den = random_network(rng)
        z = tf(num, den)
        a = 0.0 if rng.random() < 0.5 else rng.normal()
        port = int(rng.integers(1, 3))
        found = passivity.two_port(z, shortage=a, port=port)
        verdicts[found.verdict] += 1
        omega = np.geomspace(1e-4, 1e4, 200)
        at = evaluated(num, den, omega)
        far, own = at[:, 2 - port, 2 - port], at[:, port - 1, port - 1]
        k, c = at[:, 0, 1] * at[:, 1, 0], own.real - a
        worst = (c / np.abs(own)).min()
        some = c > 0
        if some.any():
            size = np.abs(far[some]) + np.abs(k[some]) / c[some]
            worst = min(worst, (worst_terminated(far[some], k[some], c[some]) / size).min())
        if worst < -1e-9:
            assert found.verdict != "absolutely stable", (trial, found.reason)
        # A dip between two samples is no deeper than 1e-4 of the size.
        if worst > 1e-4 and 1e-4 < found.margin_frequency_rad_s < 1e4:
            assert found.verdict != "not absolutely stable", (trial, found.reason)
        tolerable = (own.real - (k.real + np.abs(k)) / (2 * far.real)).min()
        assert found.largest_shortage <= tolerable + 1e-9 * (1 + abs(tolerable)), trial
        if found.verdict != "absolutely stable":
            continue
        for _ in range(4):
            m, s = np.where(rng.random(4) < 0.5, 0.0, np.exp(2 * rng.normal(size=4))).reshape(2, 2)
            passive, active = [m[0], 0.0, s[0]], [m[1], -a, s[1]]
            ends = (passive, active) if port == 2 else (active, passive)
            assert not loop_unstable(num, den, *ends), trial
    assert min(verdicts["absolutely stable"], verdicts["not absolutely stable"]) > 0.2 * count


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
