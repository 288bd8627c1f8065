"""Figures: right content, nothing cut off, axes in and axes out."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

matplotlib = pytest.importorskip("matplotlib")
matplotlib.use("Agg")

import matplotlib.pyplot as plt  # noqa: E402
from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: E402

import ulna  # noqa: E402
from ulna import plot  # noqa: E402
from ulna.record import join  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "examples" / "python"))

import relaxed_arm  # noqa: E402


class Altered:
    """An estimate with some of its fields replaced."""

    def __init__(self, estimate, **changes):
        self.__dict__.update(_of=estimate, **changes)

    def __getattr__(self, name):
        return getattr(self.__dict__["_of"], name)


@pytest.fixture(scope="module")
def arm():
    return ulna.identify_impedance(ulna.read(ROOT / "examples" / "data" / "relaxed-arm.csv"))


@pytest.fixture(scope="module")
def ankle():
    path = ROOT.parent / "shared" / "data" / "ankle" / "ankle-b.csv"
    if not path.exists():
        pytest.skip(f"{path} is not there")
    return ulna.identify_impedance(ulna.read(path), lowpass_hz=50.0, train_s=40.0)


@pytest.fixture(autouse=True)
def no_open_figures():
    plt.close("all")
    yield
    plt.close("all")


def _texts_outside(figure):
    """Visible texts that reach beyond the paper by more than two pixels."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    paper = figure.bbox
    renderer = canvas.get_renderer()
    undrawn = _undrawn(figure)
    outside = []
    for text in figure.findobj(matplotlib.text.Text):
        if not text.get_visible() or not text.get_text().strip():
            continue
        box = text.get_window_extent(renderer)
        if (
            box.x0 < paper.x0 - 2
            or box.y0 < paper.y0 - 2
            or box.x1 > paper.x1 + 2
            or box.y1 > paper.y1 + 2
        ) and id(text) not in undrawn:
            outside.append(text.get_text())
    return outside


def _undrawn(figure):
    """Labels that matplotlib keeps for ticks beyond the limits of an axis."""
    labels = set()
    for axes in figure.findobj(matplotlib.axes.Axes):
        for axis, limits in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
            for tick in axis.get_major_ticks():
                if not min(limits) <= tick.get_loc() <= max(limits):
                    labels |= {id(tick.label1), id(tick.label2)}
    return labels


@pytest.mark.parametrize("shoulder", [None, (0.0, 0.0)])
def test_no_text_is_cut_off_and_every_figure_is_labelled(arm, shoulder):
    names = []
    for picture in plot.pictures(arm, shoulder_m=shoulder):
        names.append(picture.name)
        assert _texts_outside(picture.figure) == []
        assert picture.caption.endswith(".")
        labelled = [ax for ax in picture.figure.axes if ax.get_xlabel()]
        assert labelled, picture.name
    assert names == [
        "parameters", "prediction", "ellipses", "energy", "frequency-response", "human-share",
        "signals",
    ]  # fmt: skip
    assert plt.get_fignums() == []


def test_one_axis_has_no_ellipses_and_speaks_of_torque(ankle):
    pictures = {picture.name: picture for picture in plot.pictures(ankle)}
    assert "ellipses" not in pictures and "human-share" not in pictures
    labels = [ax.get_ylabel() for ax in pictures["prediction"].figure.axes]
    assert labels == ["torque (N m)"]
    for picture in pictures.values():
        assert _texts_outside(picture.figure) == []


def test_axes_in_axes_out(arm):
    figure, axes = plt.subplots(2, 2)
    assert plot.parameters(arm, axes)[1, 1] is axes[1, 1]
    one = figure.add_subplot()
    assert plot.energy(arm, one) is one
    with pytest.raises(ValueError, match="1 x 3 axes, got 4"):
        plot.ellipses(arm, axes)


def test_truth_is_drawn_where_it_belongs(arm):
    grid = plot.parameters(arm, truth={"K": relaxed_arm.P1.k_n_m})
    crosses = [line for line in grid.flat[2].lines if line.get_marker() == "x"]
    assert np.allclose(crosses[0].get_xdata(), relaxed_arm.P1.k_n_m.ravel())


@pytest.mark.parametrize(
    "truth, words", [({"Z": [1.0]}, "truth names 'Z'"), ({"K": [1.0]}, "in the shape")]
)
def test_truth_that_fits_no_parameter_is_refused(arm, truth, words):
    with pytest.raises(ulna.ArgumentError, match=words):
        plot.parameters(arm, truth=truth)
    assert plt.get_fignums() == []


def test_what_cannot_be_drawn_is_an_argument_error(arm):
    with pytest.raises(ulna.ArgumentError, match="no reference"):
        plot.human_share(Altered(arm, rho=None))
    with pytest.raises(ulna.ArgumentError, match="must hold 4 x 1 axes, got 1"):
        plot.record(arm.record, plt.figure().subplots())


def test_a_record_is_drawn_channel_by_channel(arm):
    log = arm.record
    with plot.style():
        grid = log.plot()
    assert [ax.get_ylabel() for ax in grid[:, 0]] == ["x (mm)", "y (mm)", "F_x (N)", "F_y (N)"]
    assert [line.get_label() for line in grid[0, 0].lines] == ["x", "x_ref"]
    drawn = grid[2, 0].lines[0].get_ydata()
    # However many samples a line stands for, its extremes are those of the channel.
    assert len(drawn) < 5000
    assert (np.nanmin(drawn), np.nanmax(drawn)) == (log["F_x"].min(), log["F_x"].max())
    assert all(len(ax.patches) == 0 for ax in grid[:, 0])
    assert _texts_outside(grid[0, 0].figure) == []


def test_trials_and_segments_of_a_record_are_shaded(arm):
    part = arm.record.select(stop_s=10.0)
    two = join([part, part.select(onsets_s=[2.0, 4.0], after_s=1.0)])
    ax = plot.record(two)[0, 0]
    spans = [(p.get_x(), p.get_x() + p.get_width()) for p in ax.patches]
    # The clock restarts, so the second trial is drawn after the first: from 10 s on.
    assert np.allclose(spans[0], (10.0, 19.999))
    assert np.allclose(spans[1:], [(0.0, 9.999), (12.0, 12.999), (14.0, 14.999)])
    x = ax.lines[0].get_xdata()
    assert np.nanmax(x) > 19.9 and np.isnan(x).sum() == 2


def test_every_public_name_is_there():
    assert all(hasattr(plot, name) for name in plot.__all__)


def test_drawn_signals_are_those_of_the_estimate(arm):
    grid = plot.prediction(arm)
    held = arm.signals("held-out")
    measured = grid[0, 0].lines[0]
    inside = np.isin(measured.get_xdata(), held.time) | np.isnan(measured.get_xdata())
    assert inside.all()
    row = np.flatnonzero(held.time == measured.get_xdata()[10])[0]
    assert measured.get_ydata()[10] == held.force[row, 0]


def test_ellipses_refuse_one_axis(ankle):
    with pytest.raises(ValueError, match="1 axes"):
        plot.ellipses(ankle)


def test_share_of_the_human_needs_a_reference(arm):
    with pytest.raises(ValueError, match="no reference"):
        plot.human_share(Altered(arm, rho=None))


def test_indefinite_stiffness_is_said_on_the_drawing(arm):
    grid = plot.ellipses(Altered(arm, K=np.diag([50.0, -20.0])), count=0)
    texts = [text.get_text() for text in grid[0, 2].texts]
    assert "negative along one direction" in texts
    assert not any("negative" in text.get_text() for text in grid[0, 0].texts)


def test_outline_spans_the_eigenvalues():
    matrix = np.array([[42.45, -34.38], [-23.02, 125.43]])
    radius = np.hypot(*plot._outline(matrix, 1.0))
    low, high = np.linalg.eigvalsh((matrix + matrix.T) / 2)
    # 120 directions miss an axis by at most 1.5 degrees: cos(1.5 deg) = 0.99966 of the major axis.
    assert radius.max() == pytest.approx(high, rel=4e-4)
    assert radius.min() == pytest.approx(low, rel=1e-2)


def test_elbow_keeps_the_segments_and_bends_to_the_right():
    hand = np.array([0.0, 0.52])
    elbow = plot._elbow(hand, 0.31, 0.34)
    assert np.hypot(*elbow) == pytest.approx(0.31)
    assert np.hypot(*(hand - elbow)) == pytest.approx(0.34)
    assert elbow[0] > 0
    assert plot._elbow(np.array([0.0, 0.8]), 0.31, 0.34) is None
    assert plot._elbow(np.array([0.0, 0.0]), 0.31, 0.34) is None


@pytest.mark.parametrize("value, nice", [(1.0, 1.0), (1.9, 1.0), (0.049, 0.02), (730.0, 500.0)])
def test_scale_is_a_round_number(value, nice):
    assert plot._nice(value) == pytest.approx(nice, rel=1e-12)


def test_lines_break_between_trials():
    time = np.concatenate([np.arange(5) * 0.1, 10 + np.arange(5) * 0.1])
    drawn_time, drawn = plot._thin(time, np.arange(10.0))
    assert np.isnan(drawn[5]) and np.isnan(drawn_time[5])
    assert np.array_equal(drawn[~np.isnan(drawn)], np.arange(10.0))
    many = plot._thin(np.arange(50000.0), np.arange(50000.0))[0]
    assert len(many) <= plot._POINTS


def _record(run, *, reference=True, rows=slice(None)):
    channels = {
        "x": run.position_m[0, rows, 0],
        "y": run.position_m[0, rows, 1],
        "F_x": run.force_n[0, rows, 0],
        "F_y": run.force_n[0, rows, 1],
    }
    if reference:
        channels |= {
            "x_ref": run.reference_m[0, rows, 0],
            "y_ref": run.reference_m[0, rows, 1],
        }
    return ulna.Record.from_arrays(run.time_s[rows], channels)


def test_measured_response_finds_the_arm_without_a_model():
    run = relaxed_arm.simulate(seed=4, tremor_n=0.0, sensors=False)
    points = plot.measured_response(SimpleNamespace(n=2, record=_record(run)))
    arm = relaxed_arm.P1
    truth = plot.dynamic_stiffness(arm.m_kg, arm.b_ns_m, arm.k_n_m, freq_hz=points.freq_hz)
    # Within a band the response is taken as straight; its bend, M w^2, leaves at most
    # m_yy (2 pi 0.6)^2 = 27 N/m at the edge of a band and a fraction of that in its middle.
    assert np.abs(points.value - truth).max() < 20.0
    assert len(points.freq_hz) >= 8


def test_no_measured_response_without_reference_or_time():
    run = relaxed_arm.simulate(seed=4, duration_s=20.0)
    for record in (_record(run, reference=False), _record(run, rows=slice(0, 3000))):
        assert plot.measured_response(SimpleNamespace(n=2, record=record)) is None


def test_energy_is_drawn_with_the_bound_that_it_keeps(arm):
    absorbed, bound, _ = plot.energy(arm).lines
    later = absorbed.get_xdata() > 0.1 * absorbed.get_xdata()[-1]
    gap = (absorbed.get_ydata() - bound.get_ydata())[later]
    # The bound touches the energy; 2000 of 50000 samples are drawn, so it does so only nearly.
    assert gap.min() > -1e-3 and gap.min() < 0.05 * np.nanmax(absorbed.get_ydata())


def test_svg_is_the_same_for_the_same_figure(arm):
    first, second = (
        next(iter(plot.pictures(arm))).svg for _ in range(2)
    )  # fmt: skip
    assert first == second


def test_overview_holds_parameters_prediction_and_energy(arm):
    figure = plot.overview(arm)
    assert len(figure.axes) == 4 + arm.n + 1
    assert _texts_outside(figure) == []


def test_style_takes_back_what_it_set_and_nothing_else():
    before = matplotlib.rcParams["font.size"], matplotlib.rcParams["axes.titleweight"]
    matplotlib.rcParams["interactive"] = False
    with pytest.raises(RuntimeError), plot.style():
        assert matplotlib.rcParams["axes.titleweight"] == "bold"
        matplotlib.rcParams["interactive"] = True  # as a notebook's backend does
        raise RuntimeError
    assert (matplotlib.rcParams["font.size"], matplotlib.rcParams["axes.titleweight"]) == before
    assert matplotlib.rcParams["interactive"] is True
    matplotlib.rcParams["interactive"] = False
