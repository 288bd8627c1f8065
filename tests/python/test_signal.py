"""Filters, spectra and clocks against SciPy, and against what must hold whatever the data."""

from __future__ import annotations

import numpy as np
import pytest
import ulna.signal as us
from ulna import AnalysisError, ArgumentError, DataError

RATE = 1000.0


def drifting(rows: int, columns: int = 1, seed: int = 0) -> np.ndarray:
    """Noise on a wandering base, so that ends and scale matter."""
    noise = np.random.default_rng(seed).normal(size=(rows, columns))
    return noise + np.cumsum(noise[::-1], axis=0)


# Savitzky-Golay ----------------------------------------------------------------------------------


def local_fit(y: np.ndarray, window: int, order: int, derivative: int) -> np.ndarray:
    """Every window fitted anew with Legendre polynomials on [-1, 1]: slow and well conditioned."""
    half = (window - 1) // 2
    x = np.linspace(-1, 1, window)
    series = np.polynomial.Legendre
    out = np.empty_like(y)
    for row in range(len(y)):
        start = min(max(row - half, 0), len(y) - window)
        fit = series.fit(x, y[start : start + window], order, domain=[-1, 1])
        out[row] = (fit.deriv(derivative) if derivative else fit)(x[row - start])
    return out * (RATE / half) ** derivative


@pytest.mark.parametrize(("window", "order"), [(101, 6), (151, 6), (5, 2), (21, 3), (31, 0), (9, 8)])
@pytest.mark.parametrize("derivative", [0, 1, 2, 3])
def test_savgol_filter_is_scipys(window: int, order: int, derivative: int) -> None:
    scipy = pytest.importorskip("scipy.signal")
    y = drifting(400, 3)
    ours = us.savgol_filter(y, window=window, order=order, derivative=derivative, rate_hz=RATE)
    if derivative > order:
        assert np.all(ours == 0)
        return
    theirs = scipy.savgol_filter(
        y, window, order, deriv=derivative, delta=1 / RATE, axis=0, mode="interp"
    )
    # 10.3 of the specification asks for 1e-10. With order 6 and 101 samples SciPy's own kernels are
    # wrong by 1e-6 (with 151 by 5e-6), because it solves with powers up to 50**6: see the next test.
    tolerance = 1e-5 if order == 6 else 1e-10
    assert np.abs(ours - theirs).max() < tolerance * np.abs(theirs).max()


@pytest.mark.parametrize("window", [101, 151])
@pytest.mark.parametrize("derivative", [0, 1, 2, 3])
def test_savgol_filter_is_a_local_fit(window: int, derivative: int) -> None:
    y = drifting(400)[:, 0]
    ours = us.savgol_filter(y, window=window, order=6, derivative=derivative, rate_hz=RATE)
    theirs = local_fit(y, window, 6, derivative)
    assert np.abs(ours - theirs).max() < 1e-10 * np.abs(theirs).max()


def test_savgol_kernel_of_the_reference() -> None:
    kernels = [us.savgol_kernel(window=101, order=6, derivative=d) for d in range(3)]
    assert kernels[0][50] == pytest.approx(0.047419682296, abs=1e-12)
    assert kernels[0] @ kernels[0] == pytest.approx(0.047419682296, abs=1e-12)
    assert kernels[1] @ kernels[1] == pytest.approx(2.2334857615e-4, abs=1e-14)
    assert kernels[2][50] == pytest.approx(-3.352535494957e-4, abs=1e-16)


def test_savgol_is_exact_on_polynomials_of_its_order_up_to_the_ends() -> None:
    t = np.linspace(-1, 1, 301)
    p = np.polynomial.Polynomial([1.0, -2.0, 0.5, 3.0, -1.0, 0.7, 2.0])
    for derivative in range(4):
        ours = us.savgol_filter(p(t), window=101, order=6, derivative=derivative, rate_hz=150)
        exact = p.deriv(derivative)(t) if derivative else p(t)
        # Rounding of y (1e-16) times the gain of the end polynomial's derivatives, up to 1e5.
        assert np.abs(ours - exact).max() < 1e-11 * np.abs(exact).max()


def test_savgol_strided_and_single_precision_input() -> None:
    y = drifting(600, 4)
    plain = us.savgol_filter(np.ascontiguousarray(y[::2, 1]), window=31, order=3)
    assert np.array_equal(us.savgol_filter(y[::2, 1], window=31, order=3), plain)
    assert np.array_equal(us.savgol_filter(np.asfortranarray(y)[::2], window=31, order=3)[:, 1], plain)
    single = us.savgol_filter(y[::2, 1].astype(np.float32), window=31, order=3)
    assert np.allclose(single, plain, rtol=0, atol=1e-5 * np.abs(y).max())


# Butterworth and zero phase ----------------------------------------------------------------------


@pytest.mark.parametrize("order", range(1, 21))
@pytest.mark.parametrize("cutoff_hz", [0.5, 5.0, 50.0, 250.5, 400.0])
def test_butterworth_is_scipys(order: int, cutoff_hz: float) -> None:
    scipy = pytest.importorskip("scipy.signal")
    ours = us.butterworth(order=order, cutoff_hz=cutoff_hz, rate_hz=RATE)
    theirs = scipy.butter(order, cutoff_hz, fs=RATE, output="sos")
    assert ours.shape == theirs.shape
    # The overall gain is a product of up to 20 factors: 1e-12 relative, coefficients absolute.
    assert np.abs(ours[:, 3:] - theirs[:, 3:]).max() < 1e-12
    assert np.abs(ours[0, :3] / theirs[0, 0] - theirs[0, :3] / theirs[0, 0]).max() < 1e-11
    assert np.array_equal(ours[1:, :3], theirs[1:, :3])


@pytest.mark.parametrize("order", [1, 2, 3, 4, 5, 8])
@pytest.mark.parametrize("columns", [1, 3, 8, 14])
def test_zero_phase_is_scipys(order: int, columns: int) -> None:
    scipy = pytest.importorskip("scipy.signal")
    sos = us.butterworth(order=order, cutoff_hz=5, rate_hz=RATE)
    y = drifting(1503, columns)
    ours = us.filter_zero_phase(y, sos=sos, pad="scipy")
    theirs = scipy.sosfiltfilt(sos, y, axis=0)
    assert np.abs(ours - theirs).max() < 1e-9 * np.ptp(y)
    pad = us.pad_samples(sos)
    ours = us.filter_zero_phase(y, sos=sos)
    theirs = scipy.sosfiltfilt(sos, y, axis=0, padlen=min(pad, len(y) - 1))
    assert np.abs(ours - theirs).max() < 1e-9 * np.ptp(y)


def test_columns_are_filtered_on_their_own() -> None:
    sos = us.butterworth(order=5, cutoff_hz=20, rate_hz=RATE)
    y = drifting(700, 11)
    together = us.filter_zero_phase(y, sos=sos)
    for column in range(11):
        assert np.array_equal(together[:, column], us.filter_zero_phase(y[:, column], sos=sos))


def test_zero_phase_is_linear_and_symmetric_in_time() -> None:
    sos = us.butterworth(order=5, cutoff_hz=20, rate_hz=RATE)
    a, b = drifting(900, 2).T
    f = us.filter_zero_phase(np.column_stack([a, b, 2 * a - 3 * b, a[::-1]]), sos=sos)
    scale = np.ptp(a) + np.ptp(b)
    assert np.abs(f[:, 2] - 2 * f[:, 0] + 3 * f[:, 1]).max() < 1e-12 * scale
    # The order of the two passes matters only through the extension's transient, 1e-3 of it squared.
    assert np.abs(f[::-1, 3] - f[:, 0]).max() < 1e-4 * scale


def test_a_straight_line_passes_unchanged() -> None:
    sos = us.butterworth(order=5, cutoff_hz=5, rate_hz=RATE)
    line = np.linspace(-1, 4, 3000)
    # What is left of the transient at the ends: epsilon of the slope over one settling time.
    assert np.abs(us.filter_zero_phase(line, sos=sos) - line).max() < 1e-3 * 5 * 712 / 3000


def test_pad_is_limited_by_the_signal_and_says_so() -> None:
    sos = us.butterworth(order=5, cutoff_hz=5, rate_hz=RATE)
    # ceil(ln 1e-3 / ln r), r = sqrt(0.98077370253) the slowest pole: 711.6 samples.
    assert us.settle_samples(sos) == us.pad_samples(sos) == 712
    assert us.pad_samples(sos, pad="scipy") == 18
    assert us.pad_samples(sos, rows=100) == 99
    assert np.isfinite(us.filter_zero_phase(drifting(100), sos=sos)).all()


def test_two_pass_gain_at_the_corrected_cutoff_is_minus_3_db() -> None:
    scipy = pytest.importorskip("scipy.signal")
    for order in (1, 2, 5, 9):
        for wanted in (2.0, 50.0, 400.0):
            design = us.corrected_cutoff(order=order, wanted_hz=wanted, rate_hz=RATE)
            sos = us.butterworth(order=order, cutoff_hz=design, rate_hz=RATE)
            _, h = scipy.freqz_sos(sos, worN=[wanted], fs=RATE)
            assert abs(h[0]) ** 2 == pytest.approx(np.sqrt(0.5), rel=1e-9)
            back = us.two_pass_cutoff(order=order, cutoff_hz=design, rate_hz=RATE)
            assert back == pytest.approx(wanted, rel=1e-12)


def test_response_is_that_of_the_filters_themselves() -> None:
    sos = us.butterworth(order=5, cutoff_hz=5, rate_hz=RATE)
    rows = 8001
    t = (np.arange(rows) - rows // 2) / RATE
    for freq_hz in (2.0, 4.0, 6.0):
        wave = np.cos(2 * np.pi * freq_hz * t)
        gains = us.response([freq_hz], rate_hz=RATE, sos=sos, relative=False)[0]
        for derivative, gain in enumerate(gains):
            y = us.savgol_filter(wave, derivative=derivative, rate_hz=RATE)
            y = us.filter_zero_phase(y, sos=sos)[2500:5500]
            # 3000 rows are whole periods; the ends' transients are down to 1e-3 ** (2500 / 712).
            assert np.sqrt(2 * np.mean(y**2)) == pytest.approx(gain, rel=1e-8)


def test_response_tends_to_the_ideal_operators() -> None:
    gains = us.response([0.0, 1e-3], rate_hz=RATE)
    assert np.abs(gains - 1).max() < 1e-12


# Spectra -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("segment", [256, 250, 255])
def test_cross_spectra_are_scipys(segment: int) -> None:
    scipy = pytest.importorskip("scipy.signal")
    x = np.random.default_rng(1).normal(size=(5000, 2)) + [3.0, -1.0]
    x[:, 1] += 0.5 * np.roll(x[:, 0], 3)
    freq_hz, density = us.cross_spectra(x, rate_hz=RATE, segment=segment)
    f, s = scipy.csd(x[:, 0], x[:, 1], fs=RATE, nperseg=segment)
    assert np.allclose(freq_hz, f, rtol=1e-14)
    assert np.abs(density[:, 0, 1] - s).max() < 1e-10 * np.abs(s).max()
    assert np.abs(density[:, 1, 0] - s.conj()).max() < 1e-10 * np.abs(s).max()
    c = us.coherence(x[:, 0], x[:, 1], rate_hz=RATE, segment=segment)
    _, theirs = scipy.coherence(x[:, 0], x[:, 1], fs=RATE, nperseg=segment)
    assert np.abs(c.value[:, 0] - theirs).max() < 1e-10


def test_ranges_are_averaged_apart() -> None:
    x = np.random.default_rng(2).normal(size=(1000, 1))
    whole = us.cross_spectra(x, rate_hz=RATE, segment=200, ranges=[(0, 400), (500, 900)])[1]
    parts = [us.cross_spectra(x[a:b], rate_hz=RATE, segment=200)[1] for a, b in ((0, 400), (500, 900))]
    assert np.allclose(whole, (parts[0] + parts[1]) / 2, rtol=1e-12)
    c = us.coherence(x, x, rate_hz=RATE, segment=200, ranges=[(0, 400), (500, 900)])
    assert c.averages == 6


def test_coherence_of_a_known_system() -> None:
    rng = np.random.default_rng(3)
    u = rng.normal(size=(400_000, 2))
    noise = rng.normal(size=400_000)
    # Output power 4 + 1 + 5: half of it is explained.
    y = 2 * u[:, 0] + u[:, 1] + np.sqrt(5) * noise
    c = us.coherence(u, y, rate_hz=RATE, segment=256)
    inner = slice(2, -2)
    # The mean over 125 bins of 3000 averages: standard error below 1e-3.
    assert c.corrected[inner].mean() == pytest.approx(0.5, abs=3e-3)
    h = us.frequency_response(u, y, rate_hz=RATE, segment=256)
    inside = np.abs(h.value[inner, 0] - [2, 1]) < h.radius[inner, 0]
    # 95 % of 250 circles; neighbouring bins are correlated, so the gate is wide: 3.5 standard errors.
    assert 0.89 < inside.mean() < 0.995


def test_bias_correction_of_unrelated_signals() -> None:
    rng = np.random.default_rng(4)
    x = rng.normal(size=(40_000, 2))
    c = us.coherence(x[:, 0], x[:, 1], rate_hz=RATE, segment=4000)
    inner = slice(2, -2)
    # 19 averages, 18 independent: the raw coherence of nothing is 1/18, to 5 % over 2000 bins.
    assert c.value[inner].mean() == pytest.approx(1 / c.effective_averages, rel=0.1)


# Clock and resampling ----------------------------------------------------------------------------


def test_clock_finds_jitter_and_gaps() -> None:
    t = np.arange(1000) / RATE
    t[300:] += 0.004
    t[700:] += 0.002
    t[500] += 0.0002
    clock = us.check_clock(t)
    assert clock.median_step_s == pytest.approx(1 / RATE, rel=1e-9)
    assert clock.gap_rows.tolist() == [299, 699]
    assert clock.largest_gap_s == pytest.approx(0.005)
    assert clock.worst_row in (500, 501)
    assert clock.jitter_max == pytest.approx(0.2, rel=1e-6)
    assert clock.jitter_rms == pytest.approx(0.2 * np.sqrt(2 / 997), rel=1e-6)


def test_resampling_undoes_jitter() -> None:
    rng = np.random.default_rng(5)

    def wave(t: np.ndarray) -> np.ndarray:
        return np.column_stack([np.sin(2 * np.pi * 31 * t), np.cos(2 * np.pi * 240 * t + 1)])

    # 30 % rms of a step: uniform over +-0.5 steps, kept in order.
    t = np.sort((np.arange(40_000) + rng.uniform(-0.5, 0.5, 40_000)) / RATE)
    t = np.maximum(t, np.concatenate([[-1], t[:-1] + 1e-6]))
    times, y = us.resample(t, wave(t), rate_hz=RATE)
    # Windowed-sinc ripple of 1e-7, amplified where stamps are two steps apart. More rows than the
    # 16384 fitted at a time, so the seams are in it.
    assert np.abs(y - wave(times))[64:-64].max() < 1e-4


def test_a_lower_rate_is_free_of_aliases() -> None:
    t = np.arange(20_000) / RATE
    slow, fast = np.sin(2 * np.pi * 3 * t), np.sin(2 * np.pi * 77 * t)
    times, y = us.resample(t, slow + fast, rate_hz=100)
    assert times.size == 2000
    # 77 Hz would alias to 23 Hz; 64 kernel samples at 100 Hz are free of the ends.
    assert np.abs(y - np.sin(2 * np.pi * 3 * times))[64:-64].max() < 1e-6


def test_noise_is_not_amplified() -> None:
    rng = np.random.default_rng(6)
    t = np.sort(np.arange(8000) + rng.uniform(-0.2, 0.2, 8000)) / RATE
    _, y = us.resample(t, rng.normal(size=8000), rate_hz=RATE)
    # White noise is no band-limited signal: what lies above the band must not blow up.
    assert y[64:-64].std() < 1.2


# Refusals ----------------------------------------------------------------------------------------


def test_refusals_name_the_argument() -> None:
    sos = us.butterworth(order=5, cutoff_hz=5, rate_hz=RATE)
    y = drifting(300, 2)
    unstable = sos.copy()
    unstable[1, 5] = 1.01
    cases = [
        (lambda: us.savgol_filter(y, window=100, order=6), ArgumentError, "window"),
        (lambda: us.savgol_filter(y, window=7, order=7), ArgumentError, "order"),
        (lambda: us.savgol_kernel(derivative=-1), ArgumentError, "derivative"),
        (lambda: us.savgol_kernel(rate_hz=0), ArgumentError, "rate_hz"),
        (lambda: us.savgol_filter(y[:50]), DataError, "y"),
        (lambda: us.butterworth(cutoff_hz=500, rate_hz=RATE), ArgumentError, "cutoff_hz"),
        (lambda: us.butterworth(cutoff_hz=-1, rate_hz=RATE), ArgumentError, "cutoff_hz"),
        (lambda: us.butterworth(cutoff_hz=np.nan, rate_hz=RATE), ArgumentError, "cutoff_hz"),
        (lambda: us.butterworth(order=21, cutoff_hz=5, rate_hz=RATE), ArgumentError, "order"),
        (lambda: us.butterworth(order=0, cutoff_hz=5, rate_hz=RATE), ArgumentError, "order"),
        (lambda: us.filter_zero_phase(y, sos=unstable), ArgumentError, "sos"),
        (lambda: us.filter_zero_phase(y, sos=sos[:, :5]), ArgumentError, "sos"),
        (lambda: us.filter_zero_phase(y, sos=sos, pad="none"), ArgumentError, "pad"),
        (lambda: us.filter_zero_phase(y, sos=sos, epsilon=0.0), ArgumentError, "epsilon"),
        (lambda: us.filter_zero_phase(y[:1], sos=sos), DataError, "y"),
        (lambda: us.settle_samples(sos, epsilon=2.0), ArgumentError, "epsilon"),
        (lambda: us.response([501.0], rate_hz=RATE), ArgumentError, "freq_hz"),
        (lambda: us.response([np.nan], rate_hz=RATE), ArgumentError, "freq_hz"),
        (lambda: us.coherence(y, y[:-1], rate_hz=RATE), ArgumentError, "outputs"),
        (lambda: us.coherence(y, y, rate_hz=RATE, segment=301), ArgumentError, "segment"),
        (lambda: us.coherence(y, y, rate_hz=RATE), AnalysisError, "segment"),
        (lambda: us.coherence(0 * y, y, rate_hz=RATE, segment=32), AnalysisError, "inputs"),
        (lambda: us.coherence(y, y, rate_hz=RATE, ranges=[(0, 301)]), ArgumentError, "ranges"),
        (lambda: us.coherence(y, y, rate_hz=RATE, ranges=[0, 3]), ArgumentError, "ranges"),
        (lambda: us.check_clock([0.0]), DataError, "times"),
        (lambda: us.check_clock([[0.0, 1.0]]), ArgumentError, "times_s"),
        (lambda: us.resample([], [], rate_hz=1), ArgumentError, "t"),
        (lambda: us.resample([0, 1, 2], [0, 1], rate_hz=1), ArgumentError, "y"),
        (lambda: us.resample([0, 1, 2], [0, 1, 2], rate_hz=-1), ArgumentError, "rate_hz"),
        (lambda: us.resample([0, 1, 2], [0, 1, 2], rate_hz=1, count=9), ArgumentError, "t0_s"),
    ]
    for number, (call, kind, argument) in enumerate(cases):
        with pytest.raises(kind) as caught:
            call()
        assert caught.value.argument == argument, (number, str(caught.value))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_bad_samples_are_refused_with_their_place(bad: float) -> None:
    sos = us.butterworth(order=5, cutoff_hz=5, rate_hz=RATE)
    y = drifting(300, 3)
    y[117, 2] = bad
    t = np.arange(300) / RATE
    calls = [
        lambda: us.savgol_filter(y),
        lambda: us.filter_zero_phase(y, sos=sos),
        lambda: us.cross_spectra(y, rate_hz=RATE, segment=64),
        lambda: us.resample(t, y, rate_hz=RATE),
    ]
    for call in calls:
        with pytest.raises(DataError, match="row 117, channel 2") as caught:
            call()
        assert caught.value.detail == "row 117, channel 2"
    assert np.count_nonzero(~np.isfinite(y)) == 1


def test_bad_clocks_are_refused_with_their_row() -> None:
    t = np.arange(300) / RATE
    back, gap, broken = t.copy(), t.copy(), t.copy()
    back[41] = back[40]
    gap[200:] += 0.01
    broken[7] = np.nan
    for stamps, row in ((back, "row 41"), (gap, "row 199"), (broken, "row 7")):
        with pytest.raises(DataError) as caught:
            us.resample(stamps, np.zeros(300), rate_hz=RATE, count=100)
        assert caught.value.detail == row
