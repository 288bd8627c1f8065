"""Figures of the overhead study; `ulna.plot` offers them."""

from __future__ import annotations

from typing import Any

import numpy as np

from ._figure import BLUE, GREY, INK, ORANGE, WIDTH_IN, axes_grid, style
from ._plot_effort import short_name
from .effort import AREAS, area_of
from .stats import f_tail

# Without and with the device.
_COLOURS = (ORANGE, BLUE)
_MARKERS = ("o", "s")
_NAMES = ("without the device", "with the device")


def effort_over_time(study: Any, axes: Any = None) -> np.ndarray:
    """Norm of all torques over a session: mean over subjects with its 95 % interval, both sessions.

    Parameters
    ----------
    study : OverheadStudy
    axes : axes, optional

    Means over one cycle of the task; rests are shaded.
    """
    protocol = study.protocol
    with style():
        grid = axes_grid(axes, 1, 1, (WIDTH_IN, 2.9))
        ax = grid[0, 0]
        for begin, end in _rests(protocol):
            ax.axvspan(begin / 60, end / 60, color=GREY, alpha=0.15, linewidth=0)
        for session in range(2):
            table = np.array([pair[session].second_nm for pair in study.sessions])
            table = _running(table, max(1, round(protocol.cycle_s)))
            minutes = (np.arange(table.shape[1]) + 0.5) / 60
            mean = table.mean(axis=0)
            half = _t95(len(table)) * table.std(axis=0, ddof=1) / np.sqrt(len(table))
            ax.fill_between(minutes, mean - half, mean + half, color=_COLOURS[session], alpha=0.2,
                            linewidth=0)  # fmt: skip
            ax.plot(minutes, mean, color=_COLOURS[session], linewidth=1.4, label=_NAMES[session],
                    linestyle=("-", "--")[session])  # fmt: skip
        for block, start in enumerate(protocol.starts_s):
            ax.text((start + protocol.block_s / 2) / 60, 1.0, f"block {block + 1}", ha="center",
                    va="bottom", fontsize=7.5, color="#5B5B5B", transform=ax.get_xaxis_transform())  # fmt: skip
        ax.set(xlabel="time (min)", ylabel="norm of all torques (N m)",
               xlim=(0, protocol.duration_s / 60))  # fmt: skip
        ax.set_ylim(bottom=0)
        ax.set_title(f"Effort of the whole body, {len(study.sessions)} subjects", pad=16)
        ax.legend(loc="lower right", ncols=2)
        return grid


def effort_by_block(study: Any, axes: Any = None) -> np.ndarray:
    """Effort block by block in both sessions, its change, and what the published study reports.

    Parameters
    ----------
    study : OverheadStudy
    axes : array of three axes, optional

    The third panel holds the signed mean of all torques, which the published reduction (the numbers
    above) rests on: it may change its sign, and then its size says nothing.
    """
    values = study.values("norm")
    blocks = np.arange(1, values.shape[2] + 1)
    published = study.published
    with style():
        grid = axes_grid(axes, 1, 3, (WIDTH_IN, 2.9), width_ratios=[1.3, 1.0, 1.0])
        effort, change, signed = grid[0]
        for session in range(2):
            own = values[:, session]
            place = blocks + (-0.08, 0.08)[session]
            effort.plot(place, own.T, color=_COLOURS[session], linewidth=0.5, alpha=0.35)
            half = _t95(len(own)) * own.std(axis=0, ddof=1) / np.sqrt(len(own))
            effort.errorbar(place, own.mean(axis=0), yerr=half, color=_COLOURS[session], capsize=3,
                            marker=_MARKERS[session], markersize=4, linewidth=1.5,
                            label=_NAMES[session])  # fmt: skip
            signed.plot(blocks, (published.without_nm, published.with_nm)[session],
                        color=_COLOURS[session], marker=_MARKERS[session], markersize=4)  # fmt: skip
        effort.set(ylabel="norm of all torques (N m)", title="Subjects, mean, 95 %")
        effort.set_ylim(bottom=0)
        effort.legend(loc="lower left")
        found = published.norm.relative
        change.axhline(0, color=INK, linewidth=0.7)
        change.errorbar(
            blocks, 100 * found.value, fmt="s", color=BLUE, capsize=3, markersize=4,
            yerr=100 * np.array([found.value - found.low, found.high - found.value]),
        )  # fmt: skip
        change.set(ylabel="change with the device (%)", title="Change, 95 %")
        change.set_ylim(min(-100.0, 110 * found.low.min()), max(10.0, 110 * found.high.max()))
        signed.axhline(0, color=INK, linewidth=0.7)
        signed.set(ylabel="signed mean torque (N m)", title="As published, signed")
        signed.margins(y=0.25)
        for place, reduction in zip(blocks, published.reduction, strict=True):
            signed.text(place, 0.99, f"{100 * reduction:.0f} %", fontsize=6.5, ha="center", va="top",
                        transform=signed.get_xaxis_transform())  # fmt: skip
        for ax in grid[0]:
            ax.set_xticks(blocks)
            ax.set_xlim(0.5, blocks[-1] + 0.5)
            ax.set_xlabel("block")
        return grid


def interval_coverage(study: Any, axes: Any = None) -> np.ndarray:
    """Joint by joint: how often the true torque lies in its 95 % interval, and the errors behind that.

    Parameters
    ----------
    study : OverheadStudy
    axes : array of two axes, optional
    """
    found = study.coverage
    order = [k for area in AREAS for k, name in enumerate(found.joints) if area_of(name) == area]
    place = np.arange(len(order))
    sizes = [sum(area_of(name) == area for name in found.joints) for area in AREAS]
    with style():
        grid = axes_grid(axes, 2, 1, (WIDTH_IN, 5.2), sharex=True)
        top, below = grid[:, 0]
        top.axhspan(93, 97, color=BLUE, alpha=0.12, linewidth=0, label="93 to 97 %")
        top.axhline(95, color=BLUE, linewidth=0.8)
        top.plot(place, 100 * found.share[order], "o", color=INK, markersize=3.5, label="joint")
        top.axhline(100 * found.overall, color=ORANGE, linestyle="--", linewidth=1.2,
                    label=f"all: {100 * found.overall:.1f} ± {100 * found.overall_error:.1f} %")  # fmt: skip
        top.set(ylabel="inside the interval (%)", title="True torques in their 95 % intervals")
        top.set_ylim(min(70.0, 100 * found.share.min() - 3), 101)
        top.legend(loc="lower right", ncols=3, bbox_to_anchor=(1, 1), borderaxespad=0.1)
        below.semilogy(place, found.error_nm[order], "o", color=INK, markersize=3.5,
                       label="true error")  # fmt: skip
        below.semilogy(place, found.deviation_nm[order], "_", color=ORANGE, markersize=9,
                       markeredgewidth=1.8, label="stated")  # fmt: skip
        below.semilogy(place, found.posture_nm[order], "_", color=BLUE, markersize=6,
                       markeredgewidth=1.2, label="part of the posture")  # fmt: skip
        # The toes carry less than a thousandth of a newton metre: below the axis, to show the others.
        below.set_ylim(bottom=3e-3)
        below.set(ylabel="root mean square (N m)", title="Errors and stated standard deviations")
        below.legend(loc="lower right", ncols=3, bbox_to_anchor=(1, 1), borderaxespad=0.1)
        for ax in (top, below):
            for edge in np.cumsum(sizes)[:-1]:
                ax.axvline(edge - 0.5, color=GREY, linewidth=0.6)
            ax.grid(visible=False, axis="x")
        below.set_xticks(place, [short_name(found.joints[k]) for k in order], rotation=90,
                         fontsize=6.5)  # fmt: skip
        below.set_xlim(-0.8, len(order) - 0.2)
        return grid


def _rests(protocol: Any) -> list[tuple[float, float]]:
    ends = protocol.starts_s + protocol.block_s
    edges = [0.0, *ends], [*protocol.starts_s, protocol.duration_s]
    return [(float(a), float(b)) for a, b in zip(*edges, strict=True)]


def _running(table: np.ndarray, width: int) -> np.ndarray:
    """Means over so many seconds around each; fewer at the ends."""
    kernel = np.ones(width)
    known = np.isfinite(table)
    filled = np.where(known, table, 0.0)
    total = np.array([np.convolve(row, kernel, mode="same") for row in filled])
    count = np.array([np.convolve(row, kernel, mode="same") for row in known.astype(float)])
    return total / np.maximum(count, 1)


def _t95(subjects: int) -> float:
    """The 97.5 % quantile of Student's t: its square is F with one degree of freedom."""
    low, high = 1.9, 13.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        if f_tail(middle**2, dof=1, error_dof=subjects - 1) > 0.05:
            low = middle
        else:
            high = middle
    return high
