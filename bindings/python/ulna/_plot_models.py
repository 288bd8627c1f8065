"""Figures of linear models: measured responses, transfer functions, orders."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ._figure import AMBER, BLUE, GREEN, GREY, INK, ORANGE, PINK, WIDTH_IN, axes_grid, style
from .record import refuse

if TYPE_CHECKING:
    from .models import OrderSelection, ResponseEstimate, TransferFunctionEstimate

_COLOURS = (BLUE, ORANGE, GREEN, PINK, AMBER)
_DASHES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1)))
_POINTS = 4000  # a line; more do not show on a page
_SECONDS = 10.0  # of output and simulation, so that single movements can be seen


def response(
    estimate: ResponseEstimate, axes: Any = None, *, model: TransferFunctionEstimate | None = None
) -> np.ndarray:
    """Magnitude, phase and coherence of a measured response with its bands.

    Parameters
    ----------
    estimate : ResponseEstimate
    axes : array of 3 (2 without coherence) matplotlib.axes.Axes, optional
    model : TransferFunctionEstimate, optional
        Drawn over the measurement.
    """
    count = 2 if estimate.coherence is None else 3
    with style():
        heights = {"gridspec_kw": {"height_ratios": (3, 2.2, 1.4)[:count]}}
        grid = axes_grid(axes, count, 1, (WIDTH_IN, 1.2 + 1.5 * count), sharex=True, **heights)[:, 0]
        outputs, inputs = estimate.value.shape[1:]
        for j in range(outputs):
            for i in range(inputs):
                place = j * inputs + i
                _measured(estimate, grid, j, i, place, many=outputs * inputs > 1)
        if model is not None:
            if outputs != 1 or inputs != model.inputs:
                raise refuse("the model must have the inputs and the one output of the response", "model")
            known = np.isfinite(estimate.value).all(axis=(1, 2)) & (estimate.freq_hz > 0)
            low, high = estimate.freq_hz[known][[0, -1]]
            for i in range(inputs):
                colour = INK if inputs == 1 else _COLOURS[i % 5]
                _model_lines(model, grid, np.geomspace(low, high, 500), i, colour, "model")
        _bode_labels(grid, estimate.units[0, 0] if estimate.units.size == 1 else "")
        if count == 3:
            _coherence(estimate, grid[2])
        grid[0].set_title(
            f"{', '.join(estimate.output_names)} over {', '.join(estimate.input_names)} "
            f"({estimate.method})"
        )
        grid[-1].set_xlabel("frequency (Hz)")
        if outputs * inputs > 1 or model is not None:
            grid[0].legend(ncols=2)
    return grid


def _measured(
    estimate: ResponseEstimate, grid: np.ndarray, j: int, i: int, place: int, *, many: bool
) -> None:
    known = np.isfinite(estimate.value[:, j, i]) & (estimate.freq_hz > 0)
    freq = estimate.freq_hz[known]
    colour = _COLOURS[place % 5]
    label = f"{estimate.output_names[j]} over {estimate.input_names[i]}" if many else "measured"
    magnitude = estimate.magnitude[known, j, i]
    low, high = (band[known, j, i] for band in estimate.magnitude_band)
    # A circle that holds zero reaches down without end on this scale.
    floor = magnitude[np.isfinite(magnitude)].min() / 30
    marks = {"marker": ".", "markersize": 3} if known.sum() < 120 else {}
    grid[0].plot(
        freq, magnitude, color=colour, linestyle=_DASHES[place % 5], label=label, linewidth=1.0, **marks
    )
    top = np.where(np.isfinite(high), high, magnitude * 30)
    grid[0].fill_between(freq, np.maximum(low, floor), top, color=colour, alpha=0.2, linewidth=0)
    phase = np.degrees(estimate.phase_rad[known, j, i])
    bounds = [np.degrees(band[known, j, i]) for band in estimate.phase_band]
    grid[1].plot(freq, phase, color=colour, linestyle=_DASHES[place % 5], linewidth=1.0, **marks)
    grid[1].fill_between(freq, *bounds, color=colour, alpha=0.2, linewidth=0)
    grid[0].set_ylim(auto=True)


def _coherence(estimate: ResponseEstimate, ax: Any) -> None:
    assert estimate.coherence is not None
    shown = estimate.freq_hz > 0
    for j, name in enumerate(estimate.output_names):
        ax.plot(
            estimate.freq_hz[shown], estimate.coherence[shown, j],
            color=_COLOURS[j % 5], linestyle=_DASHES[j % 5], label=name, linewidth=1.0,
        )  # fmt: skip
    if estimate.input_coherence is not None:
        for i, name in enumerate(estimate.input_names):
            ax.plot(
                estimate.freq_hz[shown], estimate.input_coherence[shown, i], color=GREY,
                linestyle=_DASHES[(i + 1) % 5], label=f"{name}, of the reference", linewidth=1.0,
            )  # fmt: skip
    ax.set_ylim(0, 1.02)
    ax.set_ylabel("coherence")
    if len(estimate.output_names) > 1 or estimate.input_coherence is not None:
        ax.legend(ncols=2, loc="lower left")


def _bode_labels(grid: np.ndarray, unit: str) -> None:
    grid[0].set_xscale("log")
    grid[0].set_yscale("log")
    grid[1].set_xscale("log")
    grid[0].set_ylabel(f"magnitude ({unit})" if unit else "magnitude")
    grid[1].set_ylabel("phase (deg)")
    grid[1].yaxis.set_major_locator(_turns())


def _turns() -> Any:
    from matplotlib.ticker import MaxNLocator

    return MaxNLocator(nbins=6, steps=[1, 1.8, 3, 4.5, 9, 10])


def _model_lines(
    model: TransferFunctionEstimate, grid: np.ndarray, freq: np.ndarray, i: int, colour: str, label: str
) -> None:
    value = model.frequency_response(freq, input=i)
    # Both parts of a circular error of this mean square: the 95 % circle.
    radius = np.sqrt(-np.log(0.05)) * model.response_se(freq, input=i)
    name = label if model.inputs == 1 else f"{label}, {model.input_names[i]}"
    grid[0].plot(freq, np.abs(value), color=colour, linewidth=1.3, label=name)
    low = np.maximum(np.abs(value) - radius, np.abs(value) / 30)
    grid[0].fill_between(freq, low, np.abs(value) + radius, color=colour, alpha=0.25, linewidth=0)
    phase = np.unwrap(np.angle(value))
    lines = [line for line in grid[1].get_lines() if len(line.get_ydata())]
    if lines:  # the same turn as what is drawn already
        xs, ys = lines[min(i, len(lines) - 1)].get_data()
        near = np.radians(np.interp(freq, xs, ys))
        phase += 2 * np.pi * np.round(np.nanmedian(near - phase) / (2 * np.pi))
    half = np.arcsin(np.clip(radius / np.abs(value), 0, 1))
    grid[1].plot(freq, np.degrees(phase), color=colour, linewidth=1.3)
    bounds = np.degrees(phase - half), np.degrees(phase + half)
    grid[1].fill_between(freq, *bounds, color=colour, alpha=0.25, linewidth=0)


def transfer_function(
    estimate: TransferFunctionEstimate, axes: Any = None, *, response: ResponseEstimate | None = None
) -> np.ndarray:
    """Output beside its simulation over the last seconds, then magnitude and phase with bands.

    Parameters
    ----------
    estimate : TransferFunctionEstimate
    axes : array of 3 matplotlib.axes.Axes, optional
    response : ResponseEstimate, optional
        A measured response, drawn under the model's.
    """
    import matplotlib.pyplot as plt

    with style():
        if axes is None:
            figure = plt.figure(figsize=(WIDTH_IN, 5.8), layout="constrained")
            top, bottom = figure.subfigures(2, 1, height_ratios=(1.0, 1.9))
            lower = bottom.subplots(2, 1, sharex=True, gridspec_kw={"height_ratios": (3, 2.2)})
            grid = np.array([top.subplots(), *lower], dtype=object)
        else:
            grid = axes_grid(axes, 3, 1, (WIDTH_IN, 5.8))[:, 0]
        _beside(estimate, grid[0])
        high = estimate.rate_hz / 2
        low = max(high / 1e5, estimate.rate_hz / estimate.rows)
        if response is not None:
            _measured(response, grid[1:], 0, 0, 1, many=False)
            known = np.isfinite(response.value).all(axis=(1, 2)) & (response.freq_hz > 0)
            low, high = response.freq_hz[known][[0, -1]]
        for i in range(estimate.inputs):
            _model_lines(estimate, grid[1:], np.geomspace(low, high, 500), i, _COLOURS[i % 5], "model")
        _bode_labels(grid[1:], "")
        grid[2].set_xlabel("frequency (Hz)")
        if response is not None or estimate.inputs > 1:
            grid[1].legend()
    return grid


def _beside(estimate: TransferFunctionEstimate, ax: Any) -> None:
    """Output and simulation over the end of the data, which validated where rows were held out."""
    rows = np.flatnonzero(np.isfinite(estimate.simulated))
    last = rows[-1] + 1
    first = max(rows[0], last - int(_SECONDS * estimate.rate_hz))
    step = max(1, (last - first) // _POINTS)
    time = np.arange(first, last, step) / estimate.rate_hz
    ax.plot(time, estimate._output[first:last:step], color=GREY, linewidth=0.8, label="output")
    ax.plot(time, estimate.simulated[first:last:step], color=BLUE, label="model")
    ax.set_xlabel("time (s)")
    ax.set_ylabel(estimate.output_name)
    ax.margins(x=0)
    vaf = f"VAF {estimate.vaf:.1f} %"
    if np.isfinite(estimate.vaf_held_out):
        vaf += f", {estimate.vaf_held_out:.1f} % of held-out rows"
    orders = f"{len(estimate.den) - 1} pole{'' if len(estimate.den) == 2 else 's'}"
    if estimate.inputs == 1:
        orders += f", {len(estimate.num) - 1} zero{'' if len(estimate.num) == 2 else 's'}"
    ax.set_title(f"{estimate.output_name} from {', '.join(estimate.input_names)}: {orders}; {vaf}")
    ax.legend(loc="upper right", ncols=2)


def orders(selection: OrderSelection, axes: Any = None) -> np.ndarray:
    """What is left of the held-out output, and BIC, over the number of coefficients.

    Parameters
    ----------
    selection : OrderSelection
    axes : array of 2 matplotlib.axes.Axes, optional
    """
    with style():
        grid = axes_grid(axes, 1, 2, (WIDTH_IN, 2.9))[0]
        usable = [c for c in selection.candidates if c.outcome != "failed"]
        if not usable:
            raise refuse("every candidate failed: there is nothing to draw", "selection")
        held = np.isfinite([c.vaf_held_out for c in usable]).any()
        least = min(c.bic for c in usable)
        poles = sorted({c.poles for c in usable})
        for place, n in enumerate(poles):
            marker = ("o", "s", "D", "^", "v", "P", "X", "*", "h", "<")[place % 10]
            colour = _COLOURS[place % 5]
            for good in (True, False):
                own = [c for c in usable if c.poles == n and (not c.note) == good]
                if not own:
                    continue
                size = [c.poles + c.zeros + 1 for c in own]
                look = {"marker": marker, "s": 26, "color": colour}
                if not good:
                    look |= {"facecolors": "none", "alpha": 0.6}
                label = f"{n} pole{'s' if n > 1 else ''}" if good else None
                left = [100 - (c.vaf_held_out if held else c.vaf) for c in own]
                grid[0].scatter(size, np.maximum(left, 1e-12), label=label, **look)
                grid[1].scatter(size, [c.bic - least + 1 for c in own], **look)
        if selection.best is not None:
            b = selection.best
            size = b.poles + b.zeros + 1
            ring = {"s": 130, "facecolors": "none", "edgecolors": INK, "linewidths": 1.1}
            grid[0].scatter(size, 100 - (b.vaf_held_out if held else b.vaf), label="recommended", **ring)
            grid[1].scatter(size, b.bic - least + 1, **ring)
        grid[0].set_ylabel(f"100 % - VAF, {'held-out rows' if held else 'all rows'} (%)")
        grid[1].set_ylabel("BIC above the least, + 1")
        for ax in grid:
            ax.set_yscale("log")
            ax.set_xlabel("coefficients")
            ax.xaxis.get_major_locator().set_params(integer=True)
        grid[0].set_title("What the model leaves over")
        grid[1].set_title("Information criterion")
        grid[0].legend(fontsize=7)
    return grid
