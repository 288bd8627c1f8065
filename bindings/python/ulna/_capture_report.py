"""The report of a capture: one HTML file that says what the joints did, how sure it is, and what is wrong."""

from __future__ import annotations

from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import plot
from ._capture_motion import mean_of, median_of, rms_of
from ._capture_tables import BALANCE, balance_rms, by_severity, joint_rows, shown
from ._page import definitions, document, figure, ordered, table
from .record import refuse

if TYPE_CHECKING:
    from .capture import RecordedTorques

_MOST_JOINTS = 12  # in the table of the report; all are in joints.csv


def write_report(
    found: RecordedTorques,
    path: Any,
    *,
    title: str,
    command: str | None,
    figures: list[plot.Picture] | None = None,
) -> Path:
    """Write the report and return its path."""
    target = Path(path)
    if target.is_dir():
        raise refuse(f"{str(path)!r} is a folder: give the name of the file to write", "path")
    heading = title or "Torques of the joints"
    source = " and ".join(found.frames.sources)
    parts = [
        f"<h1>{escape(heading)}</h1>",
        f'<p class="source">{escape(_about(found, source))}</p>',
        _verdict(found),
        "<h2>Torques</h2>",
        _joints(found),
        _two_ways(found),
        "<h2>Balance</h2>",
        _balance(found),
        "<h2>Figures</h2>",
        *[figure(picture) for picture in (pictures(found) if figures is None else figures)],
        "<h2>Sensors</h2>",
        _sensors(found),
        "<h2>How it was done</h2>",
        _method(found, command),
    ]
    target.parent.mkdir(parents=True, exist_ok=True)
    page = document(f"{heading} · {source}" if source else heading, parts)
    target.write_text(page, encoding="utf-8")
    return target


def pictures(found: RecordedTorques) -> list[plot.Picture]:
    """The figures of a report: torques over time, and the body in its hardest frame."""
    import matplotlib.pyplot as plt

    out = []
    bridged = " Ticks at the top mark bridged frames." if found.torques.bridged.any() else ""
    with plot.style():
        for name, title, caption, make in (
            (
                "torques", "Torques over time",
                "The joints with the largest torques and their 95 % intervals; below, the force that the "
                "measured wrenches lack for the motion, and twice its standard deviation." + bridged,
                found.plot,
            ),
            (
                "body", "The body in its hardest frame",
                "Every link has the colour of the torque at the joint that carries it, the base that of "
                "the hardest joint on it; arrows are forces of the ground and of a device.",
                lambda: plot.body_effort(found),
            ),
        ):  # fmt: skip
            drawn = make().flat[0].figure
            plt.close(drawn)
            out.append(plot.Picture(name, title, caption, drawn))
    return out


def _about(found: RecordedTorques, source: str) -> str:
    frames = found.frames
    words = [source] if source else []
    words.append(f"{len(frames)} frames at {frames.rate_hz:.6g} Hz")
    words.append(f"{found.body.mass_kg:.4g} kg, {len(found.body.joints)} joints")
    if frames.device is not None:
        words.append("with a device")
    return " · ".join(words)


def _verdict(found: RecordedTorques) -> str:
    order = by_severity(found)
    worst = order[0].severity if order else "note"
    word, kind = {
        "error": ("Do not use these torques yet", "bad"),
        "warning": ("Look before you use them", "open"),
        "note": ("Nothing contradicts the measurement", "good"),
    }[worst]
    largest = max(joint_rows(found), key=lambda row: row.get("rms_nm", 0.0))
    told = ""
    if "rms_nm" in largest:
        told = (
            f"<p>The hardest joint is <b>{escape(largest['joint'])}</b>, "
            f"{_number(largest['lowest_nm'])} to {_number(largest['highest_nm'])} N m, "
            f"± {largest['deviation_nm']:.2g} (standard deviation).</p>"
        )
    items = ordered(finding.message for finding in order)
    return f'<div class="verdict {kind}"><p class="word">{word}</p>{told}{items}</div>'


def _number(value: float) -> str:
    return shown(value).replace("-", "−")


def _joints(found: RecordedTorques) -> str:
    rows = [row for row in joint_rows(found) if "rms_nm" in row]
    rows.sort(key=lambda row: -row["rms_nm"])
    cells = [
        [escape(row["joint"]), _number(row["lowest_nm"]), _number(row["highest_nm"]),
         _number(row["mean_abs_nm"]), _number(row["rms_nm"]), f"{row['deviation_nm']:.2g}"]
        for row in rows[:_MOST_JOINTS]
    ]  # fmt: skip
    more = len(rows) - len(cells)
    note = (
        f'<p class="soft">{more} joints with smaller torques stand in joints.csv.</p>'
        if more
        else ""
    )
    head = ["joint", "lowest", "highest", "mean |τ|", "RMS", "± (1 σ)"]
    return '<p class="soft">N m, over all frames.</p>' + table(head, cells) + note


def _two_ways(found: RecordedTorques) -> str:
    rows = [row for row in joint_rows(found) if "from_above_lowest_nm" in row]
    if not rows:
        return ""
    cells = [
        [escape(row["joint"]), _number(row["from_above_lowest_nm"]),
         _number(row["from_above_highest_nm"]), _number(row["above_less_below_rms_nm"])]
        for row in rows
    ]  # fmt: skip
    head = ["joint", "lowest, from above", "highest, from above", "above less below, RMS"]
    return (
        "<p>By Newton and Euler without the estimate, from the free ends down and from the ground up; "
        "with perfect data both are the same.</p>" + table(head, cells)
    )


def _balance(found: RecordedTorques) -> str:
    rms = balance_rms(found)
    start = found.start
    lines = "" if start is None else f"<p>{escape(start.summary().splitlines()[0])}.</p>"
    nis = mean_of(found.torques.balance_nis)
    spread = median_of(found.torques.residual_deviation)
    left = rms_of(found.torques.residual)
    rows = [
        ["lacking for the measured motion, RMS", *(_number(rms[name]) for name in BALANCE)],
        ["lacking for the estimated one, RMS", *(_number(float(value)) for value in left)],
        ["of that explained by the sensors, 1 σ", *(_number(float(value)) for value in spread)],
    ]
    units = ["N"] * 3 + ["N m"] * 3
    head = ["", *(f"{name} ({unit})" for name, unit in zip(BALANCE, units, strict=True))]
    return (
        lines + table(head, rows)
        + f"<p>Squared normalised innovation of the balance: {_number(nis)}, where 6 is expected.</p>"
    )  # fmt: skip


def _sensors(found: RecordedTorques) -> str:
    suite = found.frames.suite
    deviation = suite.deviation
    rows = []
    for sensor in suite.sensors:
        if sensor.kind == "joint_acceleration":
            continue
        at = suite.row(sensor.name)
        six = sensor.kind == "external_wrench"
        own = (
            f"{deviation[at]:.2g} N, {deviation[at + 3]:.2g} N m" if six else f"{deviation[at]:.2g}"
        )
        rows.append([escape(sensor.name), escape(sensor.kind.replace("_", " ")),
                     escape(sensor.place), own])  # fmt: skip
    head = ["sensor", "kind", "on", "standard deviation"]
    return table(head, rows, dense=True, words=(1, 2))


def _method(found: RecordedTorques, command: str | None) -> str:
    frames = found.frames
    pairs = [
        ("Body", escape(frames.setup.source or repr(found.body))),
        ("Frames", f"{len(frames)}, {int(found.torques.bridged.sum())} bridged, "
                   f"{found.torques.unusable} without a state"),
        ("Variances", "from the recording" if found.fit is not None else "as given"),
        ("Notes", ordered(frames.notes)),
        ("Command", f"<code>{escape(command)}</code>" if command else ""),
    ]  # fmt: skip
    return definitions(pairs)
