"""What every figure shares: the look, the palette, making and checking axes.

Colours are those of M. Okabe and K. Ito, which remain distinct for colour-blind readers.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from .record import refuse

BLUE = "#0072B2"
ORANGE = "#D55E00"
GREEN = "#009E73"
PINK = "#CC79A7"
AMBER = "#E69F00"
SKY = "#56B4E9"
GREY = "#8A8A8A"
INK = "#222222"

# From little to much: lightness falls evenly, so the order also holds without colour; the ends stay
# apart from a white and from a dark page.
SEQUENTIAL = ("#FBF0C4", "#F4BE55", "#E0701C", "#B8313F", "#7A0F4E")

# Widths are those of a report page, so nothing is scaled and 8 point text stays 8 point.
WIDTH_IN = 7.0

_STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": 8.5,
    "axes.titlesize": 9,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 8.5,
    "axes.edgecolor": "#666666",
    "axes.labelcolor": INK,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.prop_cycle": "cycler('color', ['#0072B2', '#D55E00', '#009E73', '#CC79A7', '#E69F00'])",
    "axes.formatter.useoffset": False,
    "grid.color": "#E4E4E4",
    "grid.linewidth": 0.6,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "xtick.color": "#444444",
    "ytick.color": "#444444",
    "legend.fontsize": 8,
    "legend.frameon": False,
    "legend.handlelength": 1.8,
    "lines.linewidth": 1.1,
    "figure.dpi": 110,
    "savefig.dpi": 200,
    "svg.fonttype": "path",
    "svg.hashsalt": "ulna",
}


def matplotlib_module() -> Any:
    """matplotlib, or one sentence that says how to get it."""
    try:
        import matplotlib
    except ImportError as failure:
        raise ImportError(
            "figures need matplotlib: install it with `pip install ulna[plot]`"
        ) from failure
    return matplotlib


@contextmanager
def style() -> Iterator[None]:
    """Context in which figures look as in the report: ``with ulna.plot.style(): ...``."""
    settings = matplotlib_module().rcParams
    before = {name: settings[name] for name in _STYLE}
    settings.update(_STYLE)
    try:
        yield
    finally:
        # Not rc_context: it would also take back the interactive mode that a notebook turns on
        # when the first figure is made, and the next figures would not show.
        settings.update(before)


def axes_grid(
    axes: Any, rows: int, columns: int, size: tuple[float, float], **options: Any
) -> np.ndarray:
    """The axes given, checked, or those of a new figure; always as a (rows, columns) array."""
    if axes is None:
        import matplotlib.pyplot as plt

        figure = plt.figure(figsize=size, layout="constrained")
        return figure.subplots(rows, columns, squeeze=False, **options)
    given = np.atleast_1d(np.asarray(axes, dtype=object))
    if given.size != rows * columns:
        raise refuse(f"axes must hold {rows} x {columns} axes, got {given.size}", "axes")
    return given.reshape(rows, columns)
