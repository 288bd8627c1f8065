"""Figures of passivity indices, two-ports, and what a delay allows."""

from __future__ import annotations

from typing import Any

import numpy as np

from ._figure import BLUE, GREY, INK, ORANGE, WIDTH_IN, axes_grid, style
from .record import refuse

_POINTS = 1200


def _grid_rad_s(system: Any, marks: list[float], band: tuple[float, float] | None) -> np.ndarray:
    """Frequencies around the poles, the zeros and what is marked."""
    if band is not None and np.isfinite(band[1]):
        return np.geomspace(max(band[0], 1e-4 * band[1]), band[1], _POINTS)
    landmarks = [abs(p) for p in system.poles()]
    try:
        landmarks += [abs(z) for z in system.zeros()]
    except (ArithmeticError, ValueError):
        pass
    largest = max(landmarks, default=0.0)
    near = [x for x in landmarks + marks if np.isfinite(x) and x > 1e-6 * largest]
    low, high = (min(near), max(near)) if near else (1.0, 1.0)
    return np.unique(np.concatenate([np.geomspace(low / 30, high * 30, _POINTS), np.array(near)]))


def _loci(found: Any, omega: np.ndarray) -> np.ndarray:
    """Eigenvalues of the response, sorted by their real part: (frequencies, ports)."""
    response = found.system.frequency_response(omega)
    if response.ndim == 1:
        return response[:, None]
    if found.direction is not None:
        line = found.direction
        return np.einsum("i,kij,j->k", line, response, line)[:, None]
    finite = np.all(np.isfinite(response), axis=(1, 2))
    values = np.full(response.shape[:2], np.nan + 0j)
    values[finite] = np.linalg.eigvals(response[finite])
    order = np.argsort(values.real, axis=1)
    return np.take_along_axis(values, order, axis=1)


def _window(values: np.ndarray, marks: list[float]) -> tuple[float, float]:
    """Limits that show most of a curve: what runs away at a pole is cut off."""
    finite = values[np.isfinite(values)]
    low, high = np.percentile(finite, [2, 98]) if finite.size else (-1.0, 1.0)
    middle = np.percentile(finite, [15, 85]) if finite.size else np.array([-1.0, 1.0])
    reach = 3.0 * (middle[1] - middle[0]) + 1e-12
    low, high = max(low, middle[0] - reach), min(high, middle[1] + reach)
    for mark in marks:
        low, high = min(low, mark), max(high, mark)
    edge = 0.08 * (high - low) or max(abs(high), 1.0) * 0.1
    return low - edge, high + edge


def _nyquist(found: Any, ax: Any, omega: np.ndarray) -> None:
    loci = _loci(found, omega)
    for k in range(loci.shape[1]):
        labels = ("$\\omega$ > 0", "$\\omega$ < 0") if k == 0 else (None, None)
        ax.plot(loci[:, k].real, loci[:, k].imag, color=BLUE, label=labels[0])
        ax.plot(loci[:, k].real, -loci[:, k].imag, color=BLUE, ls=":", lw=0.9, label=labels[1])
    marks = [0.0, found.input] if np.isfinite(found.input) else [0.0]
    ax.set_xlim(*_window(loci.real, marks))
    height = max(abs(edge) for edge in _window(loci.imag, [0.0]))
    ax.set_ylim(-height, height)
    ax.axvspan(ax.get_xlim()[0], 0.0, color=ORANGE, alpha=0.08, lw=0)
    ax.axvline(0.0, color=GREY, lw=0.8)
    ax.axhline(0.0, color=GREY, lw=0.8)
    if np.isfinite(found.input):
        ax.axvline(found.input, color=ORANGE, ls=(0, (4, 1.2)), lw=1.0)
    several = loci.shape[1] > 1
    ax.set_xlabel("real part" + (" of the eigenvalues" if several else ""))
    ax.set_ylabel("imaginary part")
    ax.set_title("Nyquist plot")
    ax.legend(loc="best", fontsize=7)


def _over_frequency(
    ax: Any, omega: np.ndarray, values: np.ndarray, worst: tuple[float, float], bound: float
) -> None:
    value, place = worst
    ax.plot(omega, values, color=BLUE)
    ax.axhline(bound, color=GREY, lw=0.8)
    ax.set_xscale("log")
    if np.isfinite(value):
        ax.axhline(value, color=ORANGE, ls=(0, (4, 1.2)), lw=1.0)
        shown = np.clip(place, omega[0], omega[-1])
        inside = omega[0] <= place <= omega[-1]
        marker = "o" if inside else "<" if place < omega[0] else ">"
        ax.plot([shown], [value], marker=marker, color=ORANGE, ms=5, clip_on=False, ls="none")
    ax.set_ylim(*_window(values, [bound] + ([value] if np.isfinite(value) else [])))
    ax.set_xlim(omega[0], omega[-1])


def _titled(name: str, value: float) -> str:
    if np.isnan(value):
        return f"{name}: none"
    if np.isinf(value):
        return f"{name}: {'-' if value < 0 else ''}infinite"
    return f"{name}: {value:.4g}"


@style()
def port_indices(found: Any, axes: Any = None) -> np.ndarray:
    """Nyquist plot and the three indices over frequency of `ulna.passivity.PortIndices`; 2 x 2 axes.

    Dashed lines are the indices, dots where they are met; a triangle at the edge means at zero or
    infinite frequency.
    """
    grid = axes_grid(axes, 2, 2, (WIDTH_IN, 5.0))
    marks = [
        found.input_frequency_rad_s,
        found.output_frequency_rad_s,
        found.relative_frequency_rad_s,
    ]
    omega = _grid_rad_s(found.system, marks, found.band_rad_s)
    curves = found.curves(omega)
    _nyquist(found, grid[0, 0], omega)
    looks = (
        (grid[0, 1], "Input index", found.input, 0.0, "smallest real part of H"),
        (grid[1, 0], "Output index", found.output, 0.0, "smallest real part of H$^{-1}$"),
        (grid[1, 1], "Relative index", found.relative, 1.0, "gain of (I - H)(I + H)$^{-1}$"),
    )
    for k, (ax, name, value, bound, label) in enumerate(looks):
        _over_frequency(ax, omega, curves[:, k], (value, marks[k]), bound)
        ax.set_title(_titled(name, value))
        ax.set_ylabel(label)
    for ax in (grid[0, 1], grid[1, 0], grid[1, 1]):
        ax.set_xlabel("frequency (rad/s)")
    return grid


@style()
def two_port(found: Any, axes: Any = None) -> np.ndarray:
    """Margin and tolerable shortage over frequency of `ulna.passivity.TwoPortStability`; 1 x 2 axes."""
    grid = axes_grid(axes, 1, 2, (WIDTH_IN, 2.8))
    marks = [found.margin_frequency_rad_s, found.largest_shortage_frequency_rad_s]
    omega = _grid_rad_s(found.system, marks, found.band_rad_s)
    curves = found.curves(omega)
    looks = (
        ("Margin", found.margin, 0.0, "2 r$_1$(r$_2$ - a) - Re k - |k|"),
        ("Largest shortage", found.largest_shortage, found.shortage, "tolerable shortage"),
    )
    for k, (name, value, bound, label) in enumerate(looks):
        ax = grid[0, k]
        _over_frequency(ax, omega, curves[:, k], (value, marks[k]), bound)
        ax.set_title(_titled(name, value))
        ax.set_ylabel(label)
        ax.set_xlabel("frequency (rad/s)")
    return grid


@style()
def allowed(found: Any, ax: Any = None) -> Any:
    """Allowed gain or stiffness over delay of `ulna.teleoperation.Allowed`."""
    ax = axes_grid(ax, 1, 1, (WIDTH_IN * 0.7, 3.0))[0, 0]
    delay = 1e3 * np.asarray(found.delay_s)
    curves = (found.passive, found.low, found.allowed)
    values = np.concatenate([curve[np.isfinite(curve) & (curve > 0)] for curve in curves])
    if not values.size:
        raise refuse("no delay allows a finite gain above zero: there is nothing to draw", "found")

    def finite(curve: np.ndarray) -> np.ndarray:
        return np.where(np.isfinite(curve), curve, np.nan)

    ax.fill_between(delay, 0, finite(found.passive), color=GREY, alpha=0.18, lw=0)
    ax.plot(delay, finite(found.passive), color=INK, ls="-.", label="any passive arm")
    ax.fill_between(delay, finite(found.low), finite(found.allowed), color=BLUE, alpha=0.2, lw=0)
    ax.plot(delay, finite(found.low), color=BLUE, ls=(0, (4, 1.2)), label="this arm, lower end")
    ax.plot(delay, finite(found.allowed), color=BLUE, label="this arm")
    spread = values.max() / values.min()
    if spread > 30:
        ax.set_yscale("log")
    else:
        ax.set_ylim(0, 1.08 * values.max())
    if delay.size > 2 and delay[0] > 0 and delay[-1] / delay[0] > 30:
        ax.set_xscale("log")
    ax.margins(x=0)
    ax.set_xlabel("delay (ms)")
    ax.set_ylabel(f"allowed {found.quantity}" + (f" ({found.unit})" if found.unit else ""))
    ax.set_title(f"Allowed {found.quantity}, excess {found.excess:.3g} {found.excess_unit}")
    ax.legend(loc="best")
    return ax
