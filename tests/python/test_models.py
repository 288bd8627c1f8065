"""Transfer functions and frequency responses against SciPy, closed forms and their own statistics."""

from __future__ import annotations

import pickle
import warnings
from pathlib import Path

import numpy as np
import pytest
import ulna
from ulna import AnalysisError, ArgumentError, DataError, models

scipy_signal = pytest.importorskip("scipy.signal")

SHARED = Path(__file__).resolve().parents[2].parent / "shared"
RAO_GARNIER = ([-6400.0, 1600.0], [1.0, 5.0, 408.0, 416.0, 1600.0])


def prbs(rows: int, *, stages: int = 10, clock: int = 7) -> np.ndarray:
    """Pseudo-random binary sequence of maximal length, each bit held for `clock` samples."""
    taps = {10: (10, 7)}[stages]
    register = [1] * stages
    bits = []
    for _ in range(-(-rows // clock)):
        bits.append(2.0 * register[-1] - 1.0)
        register = [register[taps[0] - 1] ^ register[taps[1] - 1], *register[:-1]]
    return np.repeat(bits, clock)[:rows]


def held_noise(rows: int, hold: int, seed: int = 0) -> np.ndarray:
    return np.repeat(np.random.default_rng(seed).normal(size=-(-rows // hold)), hold)[:rows]


def scipy_output(num, den, u, rate_hz, hold="zoh"):
    """Response from rest by SciPy: exact for a straight input, and by its state space for a held one."""
    time = np.arange(len(u)) / rate_hz
    return scipy_signal.lsim((num, den), u, time, interp=hold == "foh")[1]


# Exactness ---------------------------------------------------------------------------------------

SYSTEMS = {
    "first order": ([3.0], [1.0, 2.0], 100.0),
    "underdamped": ([50.0, 400.0], [1.0, 0.8, 400.0], 200.0),
    "stiff": ([1e4, 2e6], [1.0, 1010.0, 1e4], 5000.0),
    "zero at the origin": ([2.0, 0.0], [1.0, 3.0, 30.0], 100.0),
    "as many zeros as poles": ([2.0, 5.0, 90.0], [1.0, 4.0, 80.0], 200.0),
    "Rao and Garnier": (*RAO_GARNIER, 100.0),
    "five poles": (
        [200.0, 3000.0, 9000.0],
        np.real(np.poly([-1.0, -2 + 9j, -2 - 9j, -4 + 25j, -4 - 25j])),
        200.0,
    ),
}


@pytest.mark.parametrize("hold", ["zoh", "foh"])
@pytest.mark.parametrize("name", SYSTEMS)
def test_without_noise_the_system_comes_back(name, hold):
    num, den, rate = SYSTEMS[name]
    u = held_noise(6000, 10)
    y = scipy_output(num, den, u, rate, hold)
    # From the middle of the motion, over an offset: state and offset have to be found.
    est = models.identify_transfer_function(
        u[700:], y[700:] + 11.0, rate_hz=rate, poles=len(den) - 1, zeros=len(num) - 1, hold=hold,
        held_out=0,
    )  # fmt: skip
    assert est.outcome == "good"
    # SciPy's own matrix exponential is good to about 1e-11 for the stiff system.
    assert np.allclose(est.den, den, rtol=1e-7, atol=1e-7 * np.abs(num).max())
    assert np.allclose(est.num, num, rtol=1e-7, atol=1e-7 * np.abs(num).max())
    assert est.initial[0, -1] == pytest.approx(11.0, abs=1e-6)


@pytest.mark.parametrize("hold", ["zoh", "foh"])
@pytest.mark.parametrize("name", SYSTEMS)
def test_simulation_is_that_of_scipy(name, hold):
    num, den, rate = SYSTEMS[name]
    u = held_noise(1500, 7, 1)
    ours = models.simulate(num, den, u, rate_hz=rate, hold=hold)
    theirs = scipy_output(num, den, u, rate, hold)
    assert np.abs(ours - theirs).max() < 1e-9 * np.abs(theirs).max()


@pytest.mark.parametrize("hold", ["zoh", "foh"])
def test_a_delay_of_part_of_a_sample_is_that_of_a_finer_clock(hold):
    num, den, rate, finer = [40.0], [1.0, 3.0, 40.0], 100.0, 10
    u = held_noise(800, 5, 2)
    fine = np.arange(800 * finer) / finer
    held = u[fine.astype(int)] if hold == "zoh" else np.interp(fine, np.arange(800), u)
    late = np.concatenate([np.zeros(37), held])[: len(held)]  # 3.7 samples
    if hold == "foh":
        pytest.importorskip("scipy")
        late[:37] = 0.0
        late = late - late[37] * (np.arange(len(late)) >= 37)  # the input starts from zero
        u = u - u[0]
    theirs = scipy_output(num, den, late, rate * finer, hold)[::finer]
    ours = models.simulate(num, den, u, rate_hz=rate, delay_s=0.037, hold=hold)
    assert np.abs(ours - theirs).max() < 1e-10
    est = models.identify_transfer_function(
        u, theirs, rate_hz=rate, poles=2, zeros=0, delay_s=0.037, hold=hold
    )
    assert np.allclose(est.den, den, rtol=1e-7)


def test_the_wrong_hold_is_seen():
    """What is between the samples matters: a straight input taken as held looks like a delay."""
    optimize = pytest.importorskip("scipy.optimize")
    num, den, rate = [400.0], [1.0, 8.0, 400.0], 50.0
    u = np.random.default_rng(3).normal(size=4000)
    y = scipy_output(num, den, u, rate, "foh")
    given = {"rate_hz": rate, "poles": 2, "zeros": 0, "initial": "rest", "offset": False}
    right = models.identify_transfer_function(u, y, hold="foh", held_out=0, **given)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ulna.UncertainResult)
        wrong = models.identify_transfer_function(
            u, y, hold="zoh", held_out=0, method="oe", **given
        )
    assert right.vaf > 99.999999

    def error(theta):
        held = scipy_signal.cont2discrete(([theta[0]], [1.0, *theta[1:]]), 1 / rate)
        return y - scipy_signal.lfilter(held[0][0], held[1], u)

    # 10 ms too late is 0.2 rad at the resonance, of which two poles can hide only a part: no model
    # of this form that is held explains more than 98.2 %.
    best = optimize.least_squares(error, [400.0, 8.0, 400.0], x_scale=[400.0, 8.0, 400.0]).fun
    assert wrong.vaf == pytest.approx(100 * (1 - best.var() / y.var()), abs=0.01)
    assert wrong.vaf < 99.0


# Statistics --------------------------------------------------------------------------------------


def cramer_rao(num, den, u, rate_hz, sd):
    """Bound on a0 ... a(n-1), b0 ... bm from exact sensitivities, in NumPy and SciPy."""
    n = len(den) - 1
    time = np.arange(len(u)) / rate_hz

    def response(top, bottom):
        a, b, c, d, _ = scipy_signal.cont2discrete(
            scipy_signal.tf2ss(top, bottom), 1 / rate_hz, "zoh"
        )
        return scipy_signal.dlsim((a, b, c, d, 1 / rate_hz), u, time)[1][:, 0]

    power = [np.eye(n + 1)[n - k] for k in range(n + 1)]  # s^k
    columns = [-response(np.polymul(num, power[k]), np.polymul(den, den)) for k in range(n)]
    columns += [response(power[k], den) for k in range(len(num))]
    psi = np.column_stack(columns)
    return sd * np.sqrt(np.diag(np.linalg.inv(psi.T @ psi)))


def test_rao_garnier_is_unbiased_and_efficient():
    """300 runs: means within 4 standard errors, standard deviations 0.9 to 1.15 of the bound."""
    num, den = RAO_GARNIER
    runs, rows, rate = 300, 7161, 100.0
    u = prbs(rows)
    clean = scipy_output(num, den, u, rate)
    sd = clean.std() / np.sqrt(10.0)  # 10 dB
    truth = np.concatenate([den[:0:-1], num[::-1]])
    rng = np.random.default_rng(0)
    found, inside = [], 0
    for _ in range(runs):
        y = clean + sd * rng.normal(size=rows)
        est = models.identify_transfer_function(
            u, y, rate_hz=rate, poles=4, zeros=1, initial="rest", offset=False, held_out=0
        )
        assert est.outcome == "good"
        found.append(est.values)
        error = np.sqrt(np.diag(est.covariance))
        inside += (np.abs(est.values - truth) < 1.96 * error).sum()
    found = np.array(found)
    spread = found.std(axis=0, ddof=1)
    bound = cramer_rao(num, den, u, rate, sd)
    assert np.all(np.abs(found.mean(axis=0) - truth) < 4 * spread / np.sqrt(runs))
    assert np.all((spread / bound > 0.9) & (spread / bound < 1.15))
    # 1800 intervals of 95 %, correlated within a run: 3 standard errors of 300 independent ones.
    assert inside / (runs * len(truth)) == pytest.approx(0.95, abs=3 * np.sqrt(0.95 * 0.05 / 300))


def coloured(rows, rng, pole=0.95):
    return scipy_signal.lfilter([1.0], [1.0, -pole], rng.normal(size=rows + 500))[500:]


def filtered_least_squares(u, y, rate_hz, cutoff):
    """State-variable filter least squares for b0/(s^2 + a1 s + a0): the classical biased method."""
    den = np.poly([-cutoff, -cutoff])

    def filtered(top, x):
        b, a, _ = scipy_signal.cont2discrete((top, den), 1 / rate_hz, "foh")
        return scipy_signal.lfilter(b[0], a, x)

    parts = [[filtered(top, v) for top in ([1, 0, 0], [1, 0], [1])] for v in (y, u)]
    phi = np.column_stack([-parts[0][1], -parts[0][2], parts[1][2]])
    return np.linalg.lstsq(phi, parts[0][0], rcond=None)[0]


def test_coloured_noise_biases_least_squares_and_not_instruments():
    num, den, rate, rows, runs = [25.0], [1.0, 2.0, 25.0], 100.0, 4000, 40
    u = held_noise(rows, 20, 4)
    clean = scipy_output(num, den, u, rate)
    rng = np.random.default_rng(5)
    refined, squares, covered = [], [], []
    for _ in range(runs):
        noise = coloured(rows, rng)
        y = clean + noise * clean.std() / noise.std() / np.sqrt(10)
        est = models.identify_transfer_function(u, y, rate_hz=rate, poles=2, zeros=0, held_out=0)
        refined.append(est.values)
        squares.append(filtered_least_squares(u, y, rate, 10.0))
        covered.append([est.interval(n)[0] < t < est.interval(n)[1]
                        for n, t in zip(est.names, (25.0, 2.0, 25.0), strict=True)])  # fmt: skip
        assert len(est.noise_ar) > 0
    refined, squares = np.array(refined), np.array(squares)
    error = refined.std(axis=0, ddof=1) / np.sqrt(runs)
    assert np.all(np.abs(refined.mean(axis=0) - [25.0, 2.0, 25.0]) < 4 * error)
    bias = squares.mean(axis=0) - [2.0, 25.0, 25.0]
    assert np.any(np.abs(bias) > 10 * squares.std(axis=0, ddof=1) / np.sqrt(runs))
    # 120 intervals of 95 %: at least 86 % is 3 standard errors of 40 independent ones below.
    assert np.mean(covered) > 0.86


@pytest.mark.slow
def test_intervals_hold_the_truth_under_any_noise():
    num, den, rate, rows, runs = [25.0, 50.0], [1.0, 2.0, 25.0], 100.0, 3000, 400
    u = held_noise(rows, 10, 6)
    clean = scipy_output(num, den, u, rate)
    truth = np.array([25.0, 2.0, 50.0, 25.0])
    for pole in (0.0, 0.8, 0.98):
        rng = np.random.default_rng(7)
        inside = 0
        for _ in range(runs):
            noise = coloured(rows, rng, pole)
            y = clean + 0.3 * clean.std() * noise * np.sqrt(1 - pole**2)
            est = models.identify_transfer_function(
                u, y, rate_hz=rate, poles=2, zeros=1, held_out=0
            )
            inside += (np.abs(est.values - truth) < 1.96 * np.sqrt(np.diag(est.covariance))).sum()
        # 400 independent runs of 4 intervals: within 3.5 standard errors of 400.
        assert inside / (4 * runs) == pytest.approx(0.95, abs=3.5 * np.sqrt(0.95 * 0.05 / runs)), pole


# Options -----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def trial():
    """Mass, spring and damper: 25/(s^2 + 2 s + 25) after 50 ms, at 100 Hz, with noise."""
    u = held_noise(5000, 20, 8)
    clean = models.simulate([25.0], [1.0, 2.0, 25.0], u, rate_hz=100.0, delay_s=0.05)
    return u, clean + 0.1 * np.random.default_rng(9).normal(size=5000)


def identify(trial, **keywords):
    given = {"rate_hz": 100.0, "poles": 2, "zeros": 0, "delay_s": 0.05} | keywords
    return models.identify_transfer_function(*trial, **given)


def test_both_methods_agree(trial):
    srivc, oe = identify(trial, tolerance=1e-6), identify(trial, tolerance=1e-6, method="oe")
    assert np.all(np.abs(srivc.values - oe.values) < 1e-4 * np.sqrt(np.diag(oe.covariance)))


def test_fixed_and_bounded(trial):
    est = identify(trial, fixed={"a0": 25.0}, bounds={"a1": (3.0, 9.0)})
    assert est.value("a0") == 25.0 and est.value("a1") == 3.0
    assert est.states == ("fixed", "at its bound", "free")
    assert est.se("a0") == est.se("a1") == 0.0 < est.se("b0")
    assert any("a1" in note for note in est.notes)
    loose = identify(trial, bounds={"a1": (0.0, np.inf)})
    assert np.array_equal(loose.values, identify(trial).values)
    known = identify(trial, fixed={"a0": 25.0})
    assert known.se("b0") < identify(trial).se("b0")


def test_held_out_rows_validate(trial):
    est = identify(trial, held_out=0.4)
    assert est.refitted and est.held_out_rows == 2000 and est.rows == 5000 - 5
    known = np.isfinite(est.validation_error)
    assert known.sum() == 2000 and known[3000:].all()
    y = trial[1][3000:]
    error = est.validation_error[3000:]
    assert est.vaf_held_out == pytest.approx(100 * (1 - error.var() / y.var()))
    kept = identify(trial, held_out=0.4, refit=False)
    assert not kept.refitted and kept.rows == 3000 - 5
    assert np.allclose(kept.output_error[3000:], error)
    assert np.isnan(identify(trial, held_out=0).vaf_held_out)
    # The same model again, on the second half only.
    check = est.validate(trial[0][2500:], trial[1][2500:], rate_hz=100.0)
    assert check.vaf == pytest.approx(est.vaf, abs=1.0)


def test_runs_are_the_trials_of_a_record(trial):
    u, y = trial
    t = np.arange(5000) / 100.0
    t[2500:] += 60.0  # a pause
    y = y + np.where(t > 60, 4.0, 0.0)
    log = ulna.Record.from_arrays(t, {"F_x": u, "x": y}).split()
    assert len(log.segments) == 2
    est = models.identify_transfer_function(
        log, input="F_x", output="x", poles=2, zeros=0, delay_s=0.05,
    )  # fmt: skip
    assert est.input_names == ("F_x",) and est.output_name == "x"
    assert est.initial.shape == (2, 3) and est.outcome == "good"
    assert est.initial[1, -1] - est.initial[0, -1] == pytest.approx(4.0, abs=0.1)
    same = models.identify_transfer_function(
        u, y, rate_hz=log.rate_hz, runs=[(s.begin, s.end) for s in log.segments],
        poles=2, zeros=0, delay_s=0.05,
    )  # fmt: skip
    assert np.array_equal(est.values, same.values)


def test_several_inputs():
    u = np.column_stack([held_noise(4000, 10, 10), held_noise(4000, 10, 11)])
    y = models.simulate(
        [[25.0], [1.0, -40.0]], [1.0, 2.0, 25.0], u, rate_hz=100.0, delay_s=[0.0, 0.02]
    )
    est = models.identify_transfer_function(
        u, y, rate_hz=100.0, poles=2, zeros=[0, 1], delay_s=[0.0, 0.02]
    )
    assert est.names == ("a0", "a1", "b0[0]", "b0[1]", "b1[1]")
    assert np.allclose(est.num[0], 25.0) and np.allclose(est.num[1], [1.0, -40.0])
    assert est.gain == pytest.approx((1.0, -1.6))
    assert np.allclose(est.simulate(u), y, atol=1e-8)
    h = est.frequency_response([1.0], input=1)
    s = 2j * np.pi
    assert h[0] == pytest.approx((s - 40) / (s * s + 2 * s + 25) * np.exp(-0.02 * s))


def test_the_response_error_is_that_of_draws(trial):
    est = identify(trial)
    rng = np.random.default_rng(0)
    freq = np.array([0.1, 0.8, 3.0])
    draws = rng.multivariate_normal(est.values, est.covariance, size=4000)
    s = 2j * np.pi * freq
    values = draws[:, 2:] / (s**2 + draws[:, 1:2] * s + draws[:, :1]) * np.exp(-0.05 * s)
    spread = np.sqrt((np.abs(values - values.mean(axis=0)) ** 2).mean(axis=0))
    # 4000 draws give a standard deviation to 1 %.
    assert est.response_se(freq) == pytest.approx(spread, rel=0.05)


# Orders ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("criterion", ["held-out", "bic", "yic"])
def test_the_true_order_and_delay_are_recommended(trial, criterion):
    found = models.select_order(
        *trial, rate_hz=100.0, poles=[1, 2, 3], delay_s=[0.0, 0.04, 0.05, 0.06], criterion=criterion
    )
    best = found.best
    assert (best.poles, best.zeros, best.delay_s) == (2, 0, 0.05), found.summary()
    assert len(found.candidates) == 24 and found.reason
    est = found.identify()
    assert est.outcome == "good" and est.delay_s == 0.05
    assert "Recommended" in found.summary()
    again = models.select_order(
        *trial, rate_hz=100.0, poles=[1, 2, 3], delay_s=[0.0, 0.04, 0.05, 0.06],
        criterion=criterion, threads=1,
    )  # fmt: skip
    assert again.candidates == found.candidates


def test_a_search_that_finds_nothing_says_so():
    u = held_noise(2000, 10, 12)
    y = np.random.default_rng(13).normal(size=2000)
    found = models.select_order(u, y, rate_hz=100.0, poles=[1, 2])
    assert found.best is None
    assert "none" in found.reason
    with pytest.raises(ArgumentError, match="none of the models"):
        found.identify()
    assert all(c.note for c in found.candidates)


# Frequency responses -----------------------------------------------------------------------------

NUM, DEN = [30.0, 400.0], [1.0, 6.0, 400.0]


def truth(freq_hz):
    """Of the samples: a straight line between them is a filter of its own, sinc(f / rate)^2."""
    s = 2j * np.pi * freq_hz
    return np.polyval(NUM, s) / np.polyval(DEN, s) * np.sinc(freq_hz / 200.0) ** 2


def inside(h, skip=1, top_hz=20.0):
    known = np.isfinite(h.value[:, 0, 0]) & (h.freq_hz < top_hz)
    known[:skip] = False
    return (np.abs(h.value[known, 0, 0] - truth(h.freq_hz[known])) < h.radius[known, 0, 0]).mean()


def plant_output(u, rate_hz=200.0):
    return scipy_output(NUM, DEN, u, rate_hz, "foh")


def smooth_input(rows, seed):
    """Noise below 25 Hz, sampled at 200 Hz: what is between the samples follows from them."""
    sos = scipy_signal.butter(6, 25.0, fs=200.0, output="sos")
    return scipy_signal.sosfilt(sos, np.random.default_rng(seed).normal(size=rows)) * 3


def test_local_circles_hold_the_truth():
    shares = []
    for seed in range(12):
        u = smooth_input(8000, seed)
        y = plant_output(u) + 0.3 * np.random.default_rng(100 + seed).normal(size=8000)
        h = models.frf(u, y, rate_hz=200.0, method="local")
        shares.append(inside(h))
    # 12 runs of some 90 windows: 95 % to within 3 standard errors of a thousand.
    assert np.mean(shares) == pytest.approx(0.95, abs=0.025)
    assert h.coherence.shape == (h.freq_hz.size, 1)


def test_periodic_circles_hold_the_truth_and_nothing_leaks():
    period = 1000
    rng = np.random.default_rng(0)
    k = np.arange(1, 100)
    phase = rng.uniform(0, 2 * np.pi, k.size)
    u = np.cos(2 * np.pi * np.outer(np.arange(period), k) / period + phase).sum(axis=1) / 7
    u = np.tile(u, 12)
    clean = plant_output(u)
    exact = models.frf(u, clean, rate_hz=200.0, method="periodic", period_s=5.0, skip_periods=6)
    known = np.isfinite(exact.value[:, 0, 0])
    assert np.array_equal(np.flatnonzero(known), k)
    # What is left are the images of the straight line above 180 Hz.
    assert np.abs(exact.value[k, 0, 0] / truth(exact.freq_hz[k]) - 1).max() < 0.01
    assert np.all(exact.radius[k] < 1e-8)
    shares = []
    for _ in range(20):
        noisy = clean + 0.5 * rng.normal(size=clean.size)
        h = models.frf(u, noisy, rate_hz=200.0, method="periodic", period_s=5.0, skip_periods=4)
        error = np.abs(h.value[k, 0, 0] - exact.value[k, 0, 0])
        shares.append((error < h.radius[k, 0, 0]).mean())
    # 1980 circles: 95 % to within 4 standard errors.
    assert np.mean(shares) == pytest.approx(0.95, abs=0.02)


def closed_loop(seed, rows=60000):
    """u = r - y fed back by a computer; y = G u + v with strong noise v. Returns r, u, y, G."""
    rng = np.random.default_rng(seed)
    r = rng.normal(size=rows)
    v = scipy_signal.lfilter([1.0], [1.0, -0.9], rng.normal(size=rows)) * 0.5
    u, y = np.zeros(rows), np.zeros(rows)
    for k in range(1, rows):
        # y[k] = 0.8 y0[k-1] + 0.4 u[k-1] is the plant, v the disturbance behind it.
        y[k] = 0.8 * (y[k - 1] - v[k - 1]) + 0.4 * u[k - 1] + v[k]
        u[k] = r[k] - 0.7 * y[k]
    return r, u, y, lambda f: 0.4 / (np.exp(2j * np.pi * f) - 0.8)


def test_in_a_closed_loop_the_reference_tells_what_h1_cannot():
    r, u, y, plant = closed_loop(0)
    h = models.frf(u, y, rate_hz=1.0, reference=r, segment=256)
    plain = models.frf(u, y, rate_hz=1.0, segment=256)
    use = slice(3, 120)
    exact = plant(h.freq_hz[use])
    joint = np.abs(h.value[use, 0, 0] - exact) < h.radius[use, 0, 0]
    naive = np.abs(plain.value[use, 0, 0] - exact) < plain.radius[use, 0, 0]
    assert joint.mean() > 0.88  # 95 % circles of 117 frequencies that share neighbours
    assert naive.mean() < 0.3
    assert h.input_coherence.shape == (129, 1) and h.method == "closed loop"


def test_several_inputs_are_told_apart():
    rng = np.random.default_rng(1)
    u = rng.normal(size=(40000, 2))
    u[:, 1] += 0.6 * u[:, 0]  # correlated
    y = np.column_stack([u[:, 0] - 2 * u[:, 1], 3 * u[:, 1]]) + 0.2 * rng.normal(size=(40000, 2))
    for h in (
        models.frf(u, y, rate_hz=1.0, segment=256),
        models.frf(u, y, rate_hz=1.0, method="local"),
        models.frf(u, y, rate_hz=1.0, reference=u, segment=256),
    ):
        error = np.abs(h.value - np.array([[1.0, -2.0], [0.0, 3.0]]))
        assert np.mean(error[2:-2] < h.radius[2:-2]) == pytest.approx(0.95, abs=0.03), h.method
        assert np.nanmin(h.coherence[2:-2]) > 0.9


def test_bands_of_magnitude_and_phase_are_those_of_the_circle():
    rng = np.random.default_rng(2)
    u = rng.normal(size=4000)
    h = models.frf(u, u + rng.normal(size=4000), rate_hz=1.0, segment=256)
    low, high = h.magnitude_band
    left, right = h.phase_band
    turn = np.exp(1j * np.linspace(0, 2 * np.pi, 2000))
    for k in (5, 60):
        circle = h.value[k, 0, 0] + h.radius[k, 0, 0] * turn
        assert low[k] == pytest.approx(np.abs(circle).min(), rel=1e-4)
        assert high[k] == pytest.approx(np.abs(circle).max(), rel=1e-4)
        angle = np.angle(circle / h.value[k, 0, 0])
        assert right[k] - left[k] == pytest.approx(np.ptp(angle), rel=1e-3)


def test_what_noise_hides_does_not_turn_the_phase():
    """Where the circle holds zero the phase is lost; beyond, it goes on where it was."""
    gap = scipy_signal.firwin(201, [0.4, 0.7])  # little power between 0.2 and 0.35 of the rate
    turned = 0
    for seed in range(10):
        rng = np.random.default_rng(seed)
        u = scipy_signal.lfilter(gap, 1.0, rng.normal(size=20000))
        y = np.concatenate([[0.0], u[:-1]]) + 0.1 * rng.normal(size=20000)  # a sample late
        h = models.frf(u, y, rate_hz=1.0, segment=512)
        value, radius = h.value[:, 0, 0], h.radius[:, 0, 0]
        assert 0.6 < (radius < np.abs(value)).mean() < 0.8
        clear = radius < 0.5 * np.abs(value)
        exact = -2 * np.pi * h.freq_hz[clear]
        assert np.abs(h.phase_rad[clear, 0, 0] - exact).max() < 0.6  # asin(0.5) and a little
        turned += np.abs(np.unwrap(np.angle(value))[clear] - exact).max() > np.pi
    assert turned > 0  # what this is about: plain unwrapping goes astray


# Real data ---------------------------------------------------------------------------------------


def test_an_ankle():
    path = SHARED / "data" / "ankle" / "ankle-b.csv"
    if not path.exists():
        pytest.skip(f"{path} is absent")
    log = ulna.read(path)
    x, f = log.values.T[:2]
    rate = log.rate_hz
    # Compliance: a position recorded under a torque, below 50 Hz.
    sos = scipy_signal.butter(4, 50.0, fs=rate, output="sos")
    x, f = (scipy_signal.sosfiltfilt(sos, v)[::8] for v in (x, f))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ulna.UncertainResult)
        est = models.identify_transfer_function(
            f, x, rate_hz=rate / 8, poles=2, zeros=0, hold="foh", held_out=1 / 3
        )
    assert est.vaf_held_out > 50
    assert est.noise_ar.size > 0  # reflexes and drift are no white noise


# Presentation ------------------------------------------------------------------------------------


def test_words_and_figures(trial):
    pyplot = pytest.importorskip("matplotlib.pyplot")
    est = identify(trial)
    lines = est.summary().splitlines()
    assert max(map(len, lines)) <= 80
    assert "±" in est.summary() and "ms (given)" in est.summary()
    assert "a0 25" in repr(est) or "a0 24" in repr(est)
    h = models.frf(*trial, rate_hz=100.0, segment=512)
    assert "coherence" in h.summary() and "welch" in repr(h)
    try:
        assert len(est.plot()) == 3
        assert len(est.plot(response=h)) == 3
        assert len(h.plot(model=est)) == 3
        found = models.select_order(*trial, rate_hz=100.0, poles=[1, 2])
        assert max(map(len, found.summary().splitlines())) <= 80
        assert len(found.plot()) == 2
        pair = models.frf(np.column_stack([trial[0], trial[1]]), trial[1], rate_hz=100.0)
        with pytest.raises(ArgumentError, match="inputs"):
            pair.plot(model=est)
    finally:
        pyplot.close("all")


def test_estimates_travel(trial):
    est = identify(trial)
    back = pickle.loads(pickle.dumps(est))
    assert np.array_equal(back.values, est.values) and back.summary() == est.summary()
    found = models.select_order(*trial, rate_hz=100.0, poles=[2], zeros=[0])
    assert np.array_equal(pickle.loads(pickle.dumps(found)).identify().values, found.identify().values)


def test_an_estimate_that_is_not_good_warns_once():
    u = held_noise(2000, 10, 14)
    y = np.random.default_rng(15).normal(size=2000)
    with pytest.warns(ulna.UncertainResult) as caught:
        est = models.identify_transfer_function(u, y, rate_hz=100.0)
    assert len(caught) == 1 and est.outcome != "good"
    assert est.notes[0] in str(caught[0].message)
    assert "!" in est.summary()


# Refused -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("keywords", "words"),
    [
        ({"poles": 0}, "poles"),
        ({"poles": 11, "zeros": 0}, "poles"),
        ({"zeros": 3}, "input and output exchanged"),
        ({"zeros": -1}, "zeros"),
        ({"zeros": 0.5}, "whole numbers"),
        ({"zeros": [0, 0]}, "zeros has 2 entries for 1 inputs"),
        ({"delay_s": -0.1}, "delay_s"),
        ({"delay_s": np.nan}, "delay_s"),
        ({"delay_s": 1e6}, "longer than the record"),
        ({"method": "magic"}, "'srivc', 'oe'"),
        ({"hold": "cubic"}, "'zoh', 'foh'"),
        ({"initial": "guess"}, "'free', 'rest'"),
        ({"errors": "pink"}, "'coloured', 'white'"),
        ({"held_out": 1.0}, "held_out"),
        ({"fixed": {"a7": 1.0}}, "the coefficients are a0, a1, b0"),
        ({"fixed": {"a0": np.nan}}, "no value fits"),
        ({"bounds": {"a0": (2.0, 1.0)}}, "no value fits"),
        ({"bounds": {"a0": (1.0, 2.0)}, "fixed": {"a0": 1.0}}, "both fixed and bounded"),
        ({"runs": [1, 2]}, "pairs"),
        ({"runs": [(0, 99999)]}, "ranges"),
        ({"rate_hz": 0.0}, "rate_hz"),
        ({"rate_hz": None}, "rate_hz"),
        ({"input": "F"}, "arrays were given"),
        ({"cutoffs_hz": [0.0]}, "cutoffs_hz"),
        ({"max_iterations": 0}, "max_iterations"),
        ({"tolerance": -1.0}, "tolerance"),
        ({"bounds": {"a1": (-5.0, -4.0)}}, "bounds"),
    ],
)
def test_bad_options_are_refused_by_name(trial, keywords, words):
    with pytest.raises((ArgumentError, AnalysisError), match=words):
        identify(trial, **keywords)


def test_bad_data_are_refused(trial):
    u, y = trial
    gap = y.copy()
    gap[77] = np.nan
    with pytest.raises(DataError, match="row 77"):
        identify((u, gap))
    with pytest.raises(AnalysisError, match="input 0 is constant"):
        identify((np.full(5000, 2.0), y))
    with pytest.raises(AnalysisError, match="output is constant"):
        identify((u, np.full(5000, 2.0)))
    with pytest.raises(DataError, match="too few"):
        identify((u[:12], y[:12]))
    with pytest.raises(ArgumentError, match="5000 rows and y 4000"):
        identify((u, y[:4000]))
    with pytest.raises(ArgumentError, match="one output"):
        identify((u, np.column_stack([y, y])))
    with pytest.raises(ArgumentError, match="real numbers"):
        identify((u + 1j, y))
    with pytest.raises(ArgumentError, match="give the output"):
        models.identify_transfer_function(u, rate_hz=100.0)
    log = ulna.Record.from_arrays(np.arange(5000) / 100, {"F_x": u, "x": y})
    with pytest.raises(ArgumentError, match="name the channels"):
        models.identify_transfer_function(log)
    with pytest.raises(ulna.Error, match="channel"):
        models.identify_transfer_function(log, input="nothing", output="x")
    with pytest.raises(ArgumentError, match="leave y and rate_hz out"):
        models.identify_transfer_function(log, y, input="F_x", output="x")
    with pytest.raises(ArgumentError, match="no coefficient"):
        identify(trial).value("c3")


def test_bad_simulations_are_refused():
    for num, den, u, words in [
        ([1.0], [1.0], np.ones(5), "den"),
        ([1.0], [0.0, 1.0], np.ones(5), "den"),
        ([1.0, 2.0, 3.0], [1.0, 1.0], np.ones(5), "higher degree"),
        ([1.0], [1.0, 1.0], np.ones((5, 2)), "each of 2 inputs"),
        ([np.nan], [1.0, 1.0], np.ones(5), "finite"),
        ([1.0], [1.0, 1.0], np.ones((5, 1, 1)), "axes"),
    ]:
        with pytest.raises(ArgumentError, match=words):
            models.simulate(num, den, u, rate_hz=1.0)
    with pytest.raises(DataError, match="row 2"):
        models.simulate([1.0], [1.0, 1.0], [0.0, 1.0, np.nan], rate_hz=1.0)
    with pytest.raises(ArgumentError, match="rate_hz"):
        models.simulate([1.0], [1.0, 1.0], np.ones(5), rate_hz=-1.0)


@pytest.mark.parametrize(
    ("keywords", "words"),
    [
        ({"method": "magic"}, "'local'"),
        ({"confidence": 1.0}, "confidence"),
        ({"method": "periodic"}, "period_s"),
        ({"method": "periodic", "period_s": 0.0123}, "whole number"),
        ({"method": "periodic", "period_s": 40.0}, "at least 2"),
        ({"method": "periodic", "period_s": 1.0, "skip_periods": -1}, "skip_periods"),
        ({"method": "local", "order": 0}, "order"),
        ({"method": "local", "half_width": 1}, "degree of freedom"),
        ({"method": "local", "half_width": 3000}, "too short"),
        ({"segment": 9999}, "segment"),
        ({"segment": 4500}, "averages"),
        ({"reference": np.ones(5000)}, "constant|power|dependent"),
        ({"reference": np.ones((5000, 2))}, "2 references for 1 inputs"),
        ({"reference": np.ones(400)}, "5000 rows and reference 400"),
        ({"reference": np.ones(5000), "method": "local"}, "leave method out"),
        ({"runs": [(0, 9999)]}, "range"),
    ],
)
def test_bad_responses_are_refused(trial, keywords, words):
    with pytest.raises((ArgumentError, AnalysisError, DataError), match=words):
        models.frf(*trial, **({"rate_hz": 100.0} | keywords))


def test_bad_grids_are_refused(trial):
    for keywords, words in [
        ({"poles": []}, "poles"),
        ({"delay_s": []}, "delay"),
        ({"poles": [1], "zeros": [2]}, "zeros"),
        ({"zeros": []}, "zeros"),
        ({"poles": [1.5]}, "whole"),
        ({"criterion": "luck"}, "criterion"),
    ]:
        with pytest.raises(ArgumentError, match=words):
            models.select_order(*trial, **({"rate_hz": 100.0} | keywords))
