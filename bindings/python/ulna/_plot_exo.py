"""Figures of the exoskeleton and the arm; `ulna.plot` offers them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ._figure import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PINK,
    SKY,
    WIDTH_IN,
    axes_grid,
    style,
)
from .record import refuse

# Young's moduli that soft and stiff tissue must enclose, as in the published simulation, kPa.
_MUSCLE_KPA = (10.0, 70.0)


def elbow_torque(torque: Any, axes: Any = None) -> np.ndarray:
    """Maximum isometric torque beside measurements, and beside it the muscles' moment arms.

    Left: flexion above zero and extension below, passive torque grey, Amis as circles, Buchanan as
    squares. Right: moment arms, flexors blue and extensors orange.
    """
    from .exo import measured_torque

    with style():
        grid = axes_grid(axes, 1, 2, (WIDTH_IN, 3.2), width_ratios=[1.25, 1.0])
        left, right = grid[0]
        degrees = np.degrees(torque.angle_rad)
        left.axhline(0, color=INK, linewidth=0.6)
        left.plot(degrees, torque.flexion, color=BLUE, linewidth=1.6, label="flexion")
        left.plot(degrees, torque.extension, color=ORANGE, linewidth=1.6, label="extension")
        left.plot(degrees, torque.passive, color=GREY, linestyle="--", label="passive")
        for source, marker in (("Amis", "o"), ("Buchanan", "s")):
            angle, flexion, extension = measured_torque(source)
            look = {
                "marker": marker,
                "linestyle": "",
                "markersize": 4,
                "markerfacecolor": "white",
            }
            left.plot(np.degrees(angle), flexion, color=BLUE, **look)
            left.plot(np.degrees(angle), extension, color=ORANGE, **look)
            left.plot([], [], color=INK, label=source, **look)
        left.set(
            xlabel="elbow flexion (deg)",
            ylabel="torque (N m)",
            title="Maximum isometric torque",
        )
        left.set_ylim(-75, 115)
        left.legend(ncol=3, loc="upper left")

        ends = []
        for k, name in enumerate(torque.muscles):
            arm = 1e3 * torque.moment_arm_m[:, k]
            colour = BLUE if arm.mean() > 0 else ORANGE
            right.plot(degrees, arm, color=colour, linewidth=1.0)
            ends.append((arm[-1], name.replace("_", " "), colour))
        _write_apart(right, degrees[-1], ends)
        right.axhline(0, color=INK, linewidth=0.6)
        right.set_xlim(degrees[0], degrees[0] + 1.55 * (degrees[-1] - degrees[0]))
        right.set_xticks(right.get_xticks()[right.get_xticks() <= degrees[-1] + 1])
        right.set(xlabel="elbow flexion (deg)", ylabel="moment arm (mm)", title="Moment arms")
        return grid


def compression(tests: Any, axes: Any = None, *, labels: Sequence[str] | None = None) -> np.ndarray:
    """Compression tests of soft tissue: force over shortening, stress over strain, modulus.

    Parameters
    ----------
    tests : Compression or sequence of Compression
        Of :func:`ulna.exo.compression_test`, as the softest and the stiffest tissue.
    axes : array of three axes, optional
    labels : sequence of str, optional
        One a test. The grey band is the published range of moduli.
    """
    several = list(tests) if isinstance(tests, (list, tuple)) else [tests]
    if not several:
        raise refuse("tests holds no compression test", "tests")
    names = [f"{t.limb} arm" for t in several] if labels is None else list(labels)
    if len(names) != len(several):
        raise refuse(f"{len(several)} tests need as many labels, got {len(names)}", "labels")
    with style():
        grid = axes_grid(axes, 1, 3, (WIDTH_IN, 2.7))
        left, middle, right = grid[0]
        looks = [(BLUE, "-"), (ORANGE, "--"), (GREEN, "-."), (PINK, ":")]
        for k, (test, name) in enumerate(zip(several, names, strict=True)):
            colour, dash = looks[k % len(looks)]
            look = {"color": colour, "linestyle": dash, "linewidth": 1.6, "label": name}
            percent = 100 * test.strain
            left.plot(1e3 * test.displacement_m, test.force_n, **look)
            middle.plot(percent, 1e-3 * test.stress_pa, **look)
            right.plot(percent, 1e-3 * test.modulus_pa, **look)
        right.axhspan(*_MUSCLE_KPA, color=GREY, alpha=0.18, linewidth=0)
        right.annotate(
            "published range",
            (0.04, _MUSCLE_KPA[1]),
            xycoords=("axes fraction", "data"),
            xytext=(0, 3),
            textcoords="offset points",
            color="#555555",
            fontsize=7,
        )
        left.set(xlabel="shortening (mm)", ylabel="force on a plate (N)", title="Force")
        middle.set(xlabel="strain (%)", ylabel="stress (kPa)", title="Stress")
        right.set(xlabel="strain (%)", ylabel="stress / strain (kPa)", title="Modulus")
        right.set_yscale("log")
        right.set_yticks([1, 2, 5, 10, 20, 50, 100, 200, 500])
        low, high = right.get_ylim()
        right.set_ylim(max(low, 0.5), max(high, 100))
        right.yaxis.set_major_formatter("{x:g}")
        right.yaxis.set_minor_formatter("")
        for ax in grid[0]:
            ax.set_xlim(left=0)
        left.set_ylim(bottom=0)
        middle.set_ylim(bottom=0)
        left.legend(loc="upper left")
        return grid


def assessment(done: Any, axes: Any = None, *, joint: str | None = None) -> np.ndarray:
    """One assessment of a joint: its angle, its torques, and the line whose slope is the stiffness.

    Parameters
    ----------
    done : Assessment
        Of :func:`ulna.exo.mobilise`.
    axes : array of three axes, optional
    joint : str, optional
        Default: the first that moved.
    """
    record = done.record
    if record is None:
        raise refuse("there is nothing to draw, because the movement did not begin", "done")
    if joint is None:
        moved = record.with_role("position")
        joint = record.channels[moved[0]].name.removeprefix("theta_")
    if f"theta_{joint}" not in record:
        raise refuse(f"the record has no joint {joint!r}", "joint")
    with style():
        grid = axes_grid(axes, 1, 3, (WIDTH_IN, 3.1), width_ratios=[1.0, 1.08, 1.08])
        left, middle, right = grid[0]
        time = record.time - record.time[0]
        angle = np.degrees(record[f"theta_{joint}"])
        _draw_angles(left, record, joint, time, angle)
        _draw_torques(middle, record, joint, time)
        _draw_line(right, done, joint, angle)
        return grid


def _human_joint(record: Any, joint: str) -> str | None:
    """The arm's joint that a joint of the device moves: its own name, else the elbow."""
    for name in (joint, "elbow_flexion"):
        if f"q_{name}" in record:
            return name
    return None


def _draw_angles(axes: Any, record: Any, joint: str, time: np.ndarray, angle: np.ndarray) -> None:
    human = _human_joint(record, joint)
    axes.plot(time, angle, color=BLUE, linewidth=1.8, label="device")
    if human is not None and human != joint:
        axes.plot(time, np.degrees(record[f"q_{human}"]), color=ORANGE, label="arm")
    reference = f"theta_ref_{joint}"
    if reference in record:
        axes.plot(
            time,
            np.degrees(record[reference]),
            color=INK,
            linestyle=":",
            label="reference",
        )
    axes.set(xlabel="time (s)", ylabel=f"angle of {joint} (deg)", title="Angle")
    axes.legend(loc="best")


def _draw_torques(axes: Any, record: Any, joint: str, time: np.ndarray) -> None:
    axes.axhline(0, color=INK, linewidth=0.6)
    human = _human_joint(record, joint)
    for name, colour, dash, label in (
        (f"tau_motor_{joint}", GREY, "-", "motor"),
        (f"tau_hum_{joint}", BLUE, "-", "arm, nominal"),
        (f"tau_muscle_{human}", ORANGE, "--", "muscles, true"),
    ):
        if name in record:
            axes.plot(
                time,
                record[name],
                color=colour,
                linestyle=dash,
                linewidth=1.5,
                label=label,
            )
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.42 * (high - low))  # of which the legend has the top
    axes.set(xlabel="time (s)", ylabel="torque (N m)", title="Torque")
    axes.legend(loc="upper left")


def _draw_line(axes: Any, done: Any, joint: str, angle: np.ndarray) -> None:
    record = done.record
    name = f"tau_hum_{joint}"
    if name not in record:
        raise refuse(f"the record has no channel {name}", "done")
    found = next((j for j in done.joints if j.joint == joint), None)
    torque = record[name]
    rate = f"theta_dot_{joint}"
    damped = found is not None and np.isfinite(found.d) and rate in record
    # Torque without the part of the damping, so that what is left is a line of the angle.
    static = torque + found.d * record[rate] if damped else torque
    axes.plot(angle, torque, color=SKY, linewidth=1.2, label="measured")
    if damped:
        axes.plot(angle, static, color=BLUE, linewidth=1.2, label="less damping")
    if found is not None:
        ends = np.array([angle.min(), angle.max()])
        line = found.offset - found.k * np.radians(ends)
        axes.plot(ends, line, color=INK, linestyle="--", linewidth=1.2)
        words = f"K = {found.k:.2f} ± {found.k_error:.2g} N m/rad"
        if np.isfinite(found.d):
            words += f"\nD = {found.d:.2f} ± {found.d_error:.2g} N m s/rad"
        if np.isfinite(found.true_k):
            words += f"\ntrue K = {found.true_k:.2f} N m/rad"
    else:
        words = f"{done.status}: no K and no D"
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.95 * (high - low))
    axes.legend(loc="upper left", bbox_to_anchor=(0.0, 0.83), handlelength=1.4)
    axes.text(0.03, 0.98, words, transform=axes.transAxes, va="top", fontsize=7.5, color=INK)
    axes.set(
        xlabel=f"angle of {joint} (deg)",
        ylabel="torque of the arm (N m)",
        title="Stiffness",
    )


def plant_difference(apart: Any, axes: Any = None) -> np.ndarray:
    """Torque, slip and place in the cuffs of a full plant (lines) and its reduced one (dashes).

    Parameters
    ----------
    apart : PlantDifference
        Of :meth:`ulna.exo.Plant.difference`.
    axes : Axes or array of them, optional
        Three.
    """
    with style():
        grid = axes_grid(axes, 1, 3, (WIDTH_IN, 2.9))
        left, middle, right = grid[0]
        for record, dash in ((apart.full, "-"), (apart.reduced, "--")):
            time = record.time - record.time[0]
            label = "full" if dash == "-" else "reduced"
            left.plot(time, record[f"tau_hum_{apart.joint}"], dash, color=BLUE, label=label)
            human = _human_joint(record, apart.joint)
            slip = np.degrees(record[f"q_{human}"] - record[f"theta_{apart.joint}"])
            middle.plot(time, slip, dash, color=ORANGE, label=label)
            for limb, colour in (("upper", GREEN), ("fore", PINK)):
                place = [record[f"displacement_{limb}_{axis}"] for axis in "xyz"]
                right.plot(
                    time,
                    1e3 * np.linalg.norm(place, axis=0),
                    dash,
                    color=colour,
                    label=f"{limb}, {label}",
                )
        left.set(xlabel="time (s)", ylabel="torque of the arm (N m)", title="Torque")
        middle.set(xlabel="time (s)", ylabel="elbow less device (deg)", title="Slip")
        right.set(xlabel="time (s)", ylabel="moved in its cuff (mm)", title="Limbs")
        for one in grid[0]:
            low, high = one.get_ylim()
            one.set_ylim(low, high + 0.4 * (high - low))  # of which the legend has the top
            one.legend(loc="upper right", fontsize=7)
        return grid


def assessment_scheme(axes: Any = None) -> np.ndarray:
    """How an assessment works, as a block diagram (Fig. 7 of Tesfazgi 2023)."""
    with style():
        grid = axes_grid(axes, 1, 1, (WIDTH_IN, 3.15))
        ax = grid[0, 0]
        ax.set(xlim=(0, 100), ylim=(0, 45))
        ax.set_aspect("equal", adjustable="box")
        ax.axis("off")
        block, wire, note, dot = _drawer(ax)
        block(10, 33, 18, 9, "Reference", "$\\theta_d,\\ \\dot\\theta_d$", BLUE)
        block(45, 33, 21, 9, "Controller", "$K_p e + K_i\\!\\int\\! e + K_d \\dot e$", INK)
        block(80, 33, 21, 12, "Device and arm", "true $K_h,\\ D_h$", ORANGE)
        block(
            45,
            9,
            30,
            11,
            "Nominal model",
            "$M\\ddot\\theta + c + g + \\mathrm{loss} - \\tau_m$",
            GREEN,
        )
        block(
            81,
            9,
            22,
            11,
            "Regression",
            "$-k\\theta - d\\,\\dot\\theta + \\tau_0$",
            PINK,
        )
        wire([(19, 33), (25.4, 33)])
        wire([(28.6, 33), (34.5, 33)])
        note(31.5, 34.2, "$e$")
        wire([(55.5, 33), (69.5, 33)])
        note(62.5, 34.2, "$\\tau_m$")
        wire([(90.5, 33), (97.5, 33), (97.5, 21), (27, 21), (27, 31.4)])
        note(94.8, 34.2, "$\\theta,\\ \\dot\\theta$")
        wire([(40, 21), (40, 14.5)])
        wire([(81, 21), (81, 14.5)])
        wire([(58, 33), (58, 14.5)])
        wire([(60, 9), (70, 9)])
        note(65, 10.2, "$\\tau_{hum}$")
        wire([(92, 9), (98, 9)])
        note(95.2, 10.2, "$\\hat K_h,$\n$\\hat D_h$")
        dot(27, 33, 1.6, hollow=True)
        note(24.6, 29.2, "$-$")
        for x, y in ((40, 21), (81, 21), (58, 33)):
            dot(x, y, 0.55)
        return grid


def _drawer(axes: Any) -> tuple[Any, ...]:
    """What a block diagram is drawn with: block, wire, note, dot."""
    from matplotlib.patches import Circle, FancyBboxPatch

    def block(x: float, y: float, w: float, h: float, title: str, inside: str, colour: str) -> None:
        look = {
            "facecolor": colour + "16",
            "edgecolor": colour,
            "linewidth": 1.2,
            "zorder": 3,
        }
        shape = "round,pad=0,rounding_size=1.2"
        axes.add_patch(FancyBboxPatch((x - w / 2, y - h / 2), w, h, boxstyle=shape, **look))
        words = {"ha": "center", "zorder": 4}
        axes.text(
            x,
            y + h / 2 - 1.2,
            title,
            va="top",
            fontweight="bold",
            color=colour,
            **words,
        )
        axes.text(x, y - 1.4, inside, va="center", fontsize=9, color=INK, **words)

    def wire(points: Sequence[tuple[float, float]]) -> None:
        xs, ys = zip(*points, strict=True)
        axes.plot(xs[:-1], ys[:-1], color=INK, linewidth=1.1, zorder=2)
        look = {
            "arrowstyle": "-|>",
            "color": INK,
            "linewidth": 1.1,
            "shrinkA": 0,
            "shrinkB": 0,
        }
        axes.annotate("", points[-1], points[-2], arrowprops=look)

    def note(x: float, y: float, words: str) -> None:
        axes.text(x, y, words, ha="center", va="bottom", fontsize=9, color=INK)

    def dot(x: float, y: float, radius: float, hollow: bool = False) -> None:
        inside = "white" if hollow else INK
        axes.add_patch(Circle((x, y), radius, facecolor=inside, edgecolor=INK, zorder=5))

    return block, wire, note, dot


def _write_apart(axes: Any, x: float, ends: list[tuple[float, str, str]]) -> None:
    """Names at the ends of lines, moved apart where they would lie on each other, as little as that takes."""
    low, high = axes.get_ylim()
    gap = 0.062 * (high - low)
    ends = sorted(ends)
    # Names that touch stand in a row about the mean of their ends: (number of names, their first place).
    rows: list[tuple[int, float]] = []
    for value, _, _ in ends:
        rows.append((1, value))
        while len(rows) > 1 and rows[-2][1] + gap * rows[-2][0] > rows[-1][1]:
            (many, first), (more, second) = rows[-2:]
            start = (many * first + more * (second - gap * many)) / (many + more)
            rows[-2:] = [(many + more, start)]
    places = [first + gap * k for many, first in rows for k in range(many)]
    for (value, name, colour), place in zip(ends, places, strict=True):
        axes.annotate(
            name,
            (x, value),
            xytext=(x + 4, place),
            color=colour,
            fontsize=7,
            va="center",
            arrowprops={
                "arrowstyle": "-",
                "color": colour,
                "linewidth": 0.4,
                "shrinkB": 0,
            },
        )
