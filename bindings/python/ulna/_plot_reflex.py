"""Figures of reflexes, delayed feedback, windows and joints: axes in, axes out."""

from __future__ import annotations

from typing import Any

import numpy as np

from ._figure import AMBER, BLUE, GREEN, GREY, INK, ORANGE, SKY, WIDTH_IN, axes_grid, style
from .record import refuse

_POINTS = 2500  # a line; more do not show on a page


def _stretch(estimate: Any, start_s: float | None, length_s: float, trial: int) -> Any:
    """Signals of a stretch: held-out data where there are any."""
    s = estimate.signals(trial=trial)
    known = np.isfinite(s.intrinsic) & np.isfinite(s.reflex)
    wanted = known & (s.use == 2) if np.any(known & (s.use == 2)) else known
    if not np.any(wanted):
        raise refuse(f"trial {trial} has no row where both paths are known", "trial")
    first = s.time[wanted][0] if start_s is None else start_s
    keep = known & (s.time >= first) & (s.time < first + length_s)
    if not np.any(keep):
        raise refuse(f"nothing is known at {first:g} s of trial {trial}", "start_s")
    return s, np.flatnonzero(keep)[:: max(1, int(keep.sum()) // _POINTS)]


def _time_span(s: Any, rows: np.ndarray) -> str:
    return "held-out data" if np.all(s.use[rows] == 2) else "prepared data"


@style()
def reflex(
    estimate: Any,
    axes: Any = None,
    *,
    start_s: float | None = None,
    length_s: float = 4.0,
    trial: int = 0,
) -> np.ndarray:
    """Torque with both paths, their impulse responses, and the delay's profile: five axes.

    `start_s` and `length_s` choose the stretch of the torque; by default the first seconds of the
    held-out data.
    """
    if axes is None:
        import matplotlib.pyplot as plt

        figure = plt.figure(figsize=(WIDTH_IN, 6.6), layout="constrained")
        mosaic = figure.subplot_mosaic(
            [["torque"] * 3, ["paths"] * 3, ["intrinsic", "reflex", "delay"]],
            height_ratios=[1, 1, 1.1],
        )
        given = [mosaic[name] for name in ("torque", "paths", "intrinsic", "reflex", "delay")]
    else:
        given = list(axes_grid(axes, 1, 5, (WIDTH_IN, 6.6))[0])
    _torques(estimate, given[0], given[1], start_s, length_s, trial)
    _intrinsic_response(estimate, given[2])
    _reflex_response(estimate, given[3])
    delay_profile(estimate, given[4])
    return np.array(given, dtype=object)


def _torques(
    estimate: Any, top: Any, below: Any, start_s: float | None, length_s: float, trial: int
) -> None:
    s, rows = _stretch(estimate, start_s, length_s, trial)
    unit = "N m" if estimate.rotational else "N"
    time = s.time[rows]
    # Slow offsets are no part of the paths: everything about its mean over the stretch.
    whole = np.isfinite(s.intrinsic) & (s.time >= time[0]) & (s.time <= time[-1])

    def about_mean(values: np.ndarray) -> np.ndarray:
        return values[rows] - values[whole].mean()

    top.plot(time, about_mean(s.torque), color=GREY, lw=1.6, label="measured")
    top.plot(time, about_mean(s.intrinsic + s.reflex), color=BLUE, lw=1.1, label="both paths")
    vaf = estimate.vaf if np.isfinite(estimate.vaf) else estimate.vaf_train
    part = "" if np.isfinite(estimate.vaf) else " of the data of the fit"
    top.set_title(f"Torque, {_time_span(s, rows)}: VAF {vaf:.1f} %{part}")
    below.plot(time, about_mean(s.intrinsic), color=GREEN, lw=1.1, label="intrinsic")
    below.plot(time, about_mean(s.reflex), color=ORANGE, lw=1.4, label="reflex")
    without = estimate.vaf_without if np.isfinite(estimate.vaf) else estimate.vaf_train_without
    below.set_title(f"The two paths; without a reflex the VAF is {without:.1f} %")
    for ax in (top, below):
        ax.set_xlim(time[0], time[-1])
        ax.set_ylabel(f"torque ({unit})" if estimate.rotational else f"force ({unit})")
        ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.1)
    top.set_xticklabels([])
    below.set_xlabel("time (s)")


def _empty(ax: Any, words: str) -> None:
    ax.text(0.5, 0.5, words, ha="center", va="center", transform=ax.transAxes, color=GREY)
    ax.set_xticks([])
    ax.set_yticks([])


def _intrinsic_response(estimate: Any, ax: Any) -> None:
    ax.set_title("Intrinsic response")
    response = estimate.intrinsic_response
    if response is None:
        _empty(ax, "trials too short")
        return
    lag = 1e3 * response.lag_s
    ax.fill_between(
        lag, response.value - 2 * response.se, response.value + 2 * response.se,
        color=GREEN, alpha=0.2, lw=0,
    )  # fmt: skip
    ax.plot(lag, response.value, "o-", color=GREEN, ms=2.5)
    ax.axhline(0, color=INK, lw=0.6)
    ax.set_xlabel("lag (ms)")
    ax.set_ylabel("N m/rad a lag" if estimate.rotational else "N/m a lag")


def _reflex_response(estimate: Any, ax: Any) -> None:
    ax.set_title("Reflex response")
    response = estimate.reflex_response
    span = estimate.reflex_response.lag_s[-1] if response is not None else 0.4
    if response is not None:
        lag = 1e3 * response.lag_s
        ax.fill_between(
            lag, response.value - 2 * response.se, response.value + 2 * response.se,
            color=SKY, alpha=0.35, lw=0,
        )  # fmt: skip
        ax.plot(lag, response.value, color=SKY, lw=1.0, label="free")
    time = np.linspace(0.0, span, 400)
    ax.plot(
        1e3 * time, _element(estimate, time), color=ORANGE, lw=1.5, ls=(0, (5, 1.2)), label="model"
    )
    low, high = estimate.delay_interval_s
    ax.axvspan(1e3 * low, 1e3 * high, color=AMBER, alpha=0.35, lw=0)
    ax.axhline(0, color=INK, lw=0.6)
    ax.set_xlim(0, 1e3 * span)
    ax.set_xlabel("lag (ms)")
    ax.set_ylabel("N m/rad" if estimate.rotational else "N/m")
    ax.legend(loc="upper right")


def _element(estimate: Any, time: np.ndarray) -> np.ndarray:
    """Impulse response of the reflex model."""
    after = np.maximum(time - estimate.delay_s, 0.0)
    w, z = estimate.omega, estimate.zeta
    if estimate.order == 1:
        shape = w * np.exp(-w * after)
    elif abs(z - 1.0) < 1e-6:
        shape = w * w * after * np.exp(-w * after)
    else:
        root = np.sqrt(complex(z * z - 1.0))
        poles = w * (-z + root), w * (-z - root)
        shape = np.real(
            w * w * (np.exp(poles[0] * after) - np.exp(poles[1] * after)) / (poles[0] - poles[1])
        )
    return estimate.gain * np.where(time >= estimate.delay_s, shape, 0.0)


@style()
def delay_profile(estimate: Any, ax: Any = None) -> Any:
    """Quality of the best fit at each delay, with the delay's 95 % interval."""
    ax = axes_grid(None if ax is None else [ax], 1, 1, (WIDTH_IN / 1.6, 2.6))[0, 0]
    low, high = (1e3 * bound for bound in estimate.delay_interval_s)
    delay = 1e3 * estimate.profile_delay_s
    if hasattr(estimate, "profile_vaf"):
        ax.plot(delay, estimate.profile_vaf, color=BLUE)
        ax.set_ylabel("VAF, data of the fit (%)")
    else:
        ax.plot(delay, np.sqrt(estimate.profile_statistic), color=BLUE)
        ax.axhline(1.96, color=GREY, lw=0.8, ls=(0, (5, 1.2)))
        ax.set_ylabel("distance from the best\n(standard errors)")
    ax.axvspan(low, high, color=AMBER, alpha=0.35, lw=0)
    ax.axvline(1e3 * estimate.delay_s, color=INK, lw=0.8)
    ax.set_title(f"Delay {1e3 * estimate.delay_s:.0f} ms ({low:.0f}–{high:.0f})")
    ax.set_xlabel("delay (ms)")
    ax.set_xlim(delay[0], delay[-1])
    return ax


@style()
def windows(comparison: Any, axes: Any = None) -> np.ndarray:
    """Damping and stiffness in the window and after it, entry by entry, with 95 % intervals."""
    n = comparison.n
    free = bool(np.any(comparison.difference["M"]))
    names = ("M", "B", "K") if free else ("B", "K")
    words = {"M": "Inertia", "B": "Damping", "K": "Stiffness"}
    grid = axes_grid(axes, 1, len(names), (WIDTH_IN, 2.8))
    labels = [
        f"{comparison.axes[i]}{comparison.axes[j]}" if n > 1 else comparison.axes[0]
        for i in range(n)
        for j in range(n)
    ]
    place = np.arange(n * n)
    for ax, name in zip(grid[0], names, strict=True):
        for part, colour, marker, shift in (
            ("early", BLUE, "o", -0.12),
            ("late", ORANGE, "s", 0.12),
        ):
            low, high = comparison.interval(name, part=part)
            value = getattr(comparison, part)[name].ravel()
            bars = np.abs(np.vstack([value - low.ravel(), high.ravel() - value]))
            label = f"first {1e3 * comparison.window_s:.0f} ms" if part == "early" else "after it"
            ax.errorbar(
                place + shift, value, bars, fmt=marker, color=colour, ms=4, capsize=2.5, label=label
            )
        ax.axhline(0, color=INK, lw=0.6)
        ax.set_xticks(place, labels)
        ax.set_xlim(-0.6, n * n - 0.4)
        ax.set_title(words[name])
        ax.set_ylabel(comparison.units[name])
    p = comparison.p_value
    verdict = f"test that both agree: p = {p:.2g}" if np.isfinite(p) else "too few to test"
    handles, names_of = grid[0, 0].get_legend_handles_labels()
    if axes is None:
        grid[0, 0].figure.legend(
            handles, names_of, loc="outside upper right", ncols=2, title=verdict
        )
    else:
        grid[0, 0].legend(loc="best")
    return grid


@style()
def joint(impedance: Any, axes: Any = None) -> np.ndarray:
    """A planar arm at its posture, and what its joint stiffness is made of."""
    if impedance.at != "joints" or impedance.arm is None:
        raise refuse("the figure needs an impedance at the joints of a planar arm", "impedance")
    grid = axes_grid(axes, 1, 2, (WIDTH_IN, 2.9))
    _arm(impedance, grid[0, 0])
    total = impedance.K
    elastic = total + impedance.gamma
    bars = (
        ("hand's stiffness, J′KJ", elastic, GREEN, "//"),
        ("posture under force, −Γ", -impedance.gamma, AMBER, ""),
    )
    names = ["shoulder", "shoulder–\nelbow", "elbow–\nshoulder", "elbow"]
    place = np.arange(4)
    ax = grid[0, 1]
    positive, negative = np.zeros(4), np.zeros(4)
    for label, matrix, colour, hatch in bars:
        value = matrix.ravel()
        bottom = np.where(value >= 0, positive, negative)
        ax.bar(
            place, value, 0.55, bottom, color=colour, hatch=hatch, edgecolor="white", label=label
        )
        positive += np.maximum(value, 0)
        negative += np.minimum(value, 0)
    error = 2 * impedance.se("K").ravel()
    bars_of = np.where(np.isfinite(error), error, 0.0)
    ax.errorbar(
        place,
        total.ravel(),
        bars_of,
        fmt="o",
        color=INK,
        ms=4,
        capsize=2.5,
        label="joint stiffness",
    )
    ax.axhline(0, color=INK, lw=0.6)
    ax.set_xticks(place, names, fontsize=7)
    ax.set_ylabel(impedance.units["K"])
    ax.set_title("Joint stiffness")
    ax.legend(loc="best")
    return grid


def _arm(impedance: Any, ax: Any) -> None:
    arm, q = impedance.arm, impedance.angles_rad
    shoulder = np.asarray(arm.shoulder_m, dtype=float)
    elbow = shoulder + arm.upper_arm_m * np.array([np.cos(q[0]), np.sin(q[0])])
    hand = arm.hand(q)
    chain = np.vstack([shoulder, elbow, hand])
    ax.plot(chain[:, 0], chain[:, 1], "-", color=GREY, lw=6, alpha=0.5, solid_capstyle="round")
    ax.plot(chain[:2, 0], chain[:2, 1], "o", color=INK, ms=5)
    ax.plot(*hand, "o", color=BLUE, ms=6)
    force = impedance.force_n
    size = float(np.hypot(*force))
    if size > 0:
        tip = hand + 0.12 * force / size
        ax.update_datalim([tip])  # an arrow alone does not count, and is not drawn beyond the axes
        ax.autoscale_view()
        ax.annotate("", tip, hand, arrowprops={"arrowstyle": "-|>", "color": ORANGE, "lw": 1.6})
        ax.annotate(f"{size:.2g} N", tip, xytext=(3, 3), textcoords="offset points", color=ORANGE)
    degrees = np.degrees(q)
    ax.set_title(f"q = {degrees[0]:.0f}°, {degrees[1]:.0f}°")
    ax.set_aspect("equal", adjustable="datalim")
    ax.margins(0.15)
    ax.set_xlabel("x (m)")
    ax.set_ylabel("y (m)")
