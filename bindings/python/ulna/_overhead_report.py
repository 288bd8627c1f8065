"""The overhead study as a folder: tables, figures, a moving body, and a report to read."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ._page import definitions, document, figure, table
from ._result import plain

if TYPE_CHECKING:
    from .overhead import OverheadStudy
    from .plot import Picture

_SHOWN = ("norm", "mean absolute", "torso", "left arm", "right arm", "left leg", "right leg",
          "left shoulder", "right shoulder")  # fmt: skip


def write(study: OverheadStudy, folder: Path, command: str) -> Path:
    """Everything into a folder; the path of the report."""
    for part in ("tables", "figures"):
        (folder / part).mkdir(parents=True, exist_ok=True)
    found = study.tables()
    for name, rows in found.items():
        with open(folder / "tables" / f"{name}.csv", "w", newline="", encoding="utf-8") as file:
            csv.writer(file, lineterminator="\n").writerows(
                [_short(v) for v in row] for row in rows
            )
    text = json.dumps(plain(result(study)), indent=2, allow_nan=False)
    (folder / "result.json").write_text(text + "\n", encoding="utf-8")
    body = _moving_body(study, folder)
    drawn = list(pictures(study))
    for picture in drawn:
        picture.save(folder / "figures")
    page = folder / "report.html"
    page.write_text(_page(study, found, drawn, body, command), encoding="utf-8")
    return page


def result(study: OverheadStudy) -> dict[str, Any]:
    """The numbers for a program."""
    change = study.change(_SHOWN)
    coverage = study.coverage
    return {
        "subjects": len(study.sessions),
        "blocks": study.protocol.blocks,
        "frames": coverage.frames,
        "seed": study.seed,
        "change": {
            name: {
                "difference_nm": change.difference.value[i],
                "difference_interval_nm": [change.difference.low[i], change.difference.high[i]],
                "relative": change.relative.value[i],
                "relative_interval": [change.relative.low[i], change.relative.high[i]],
            }
            for i, name in enumerate(_SHOWN)
        },
        "published_reduction": study.published.reduction,
        "anova": {effect.name: vars(effect) for effect in study.anova().effects},
        "coverage": {
            "overall": coverage.overall,
            "standard_error": coverage.overall_error,
            "joints": dict(zip(coverage.joints, coverage.share, strict=True)),
        },
        "largest_imbalance_of_the_truth": max(
            one.balance for pair in study.sessions for one in pair
        ),
    }


def pictures(study: OverheadStudy) -> Iterator[Picture]:
    """Every figure, in the order of the report; closed for pyplot."""
    import matplotlib.pyplot as plt

    from ._figure import style
    from .plot import Picture

    with style():
        for name, title, caption, make in _catalogue(study):
            axes = np.atleast_1d(np.asarray(make(), dtype=object)).flat[0]
            plt.close(axes.figure)
            yield Picture(name, title, caption, axes.figure)


def _catalogue(study: OverheadStudy) -> Iterator[tuple[str, str, str, Any]]:
    from . import plot

    joints = study.joint_values()
    yield (
        "effort-over-time", "Effort over time",
        "Mean over subjects of the norm of all joint torques with its 95 % interval, over one cycle of "
        "the task. Rests are grey.",
        lambda: plot.effort_over_time(study),
    )  # fmt: skip
    yield (
        "effort-by-block", "Effort block by block",
        "Left: every subject (thin) and the mean with its 95 % interval, working frames alone. Middle: "
        "change of that effort. Right: the signed mean of all torques, rests included, and above it what "
        "the published study calls a reduction; where the mean changes its sign, it is none.",
        lambda: plot.effort_by_block(study),
    )  # fmt: skip
    yield (
        "subjects", "The whole body, subject by subject",
        "Norm of all torques, mean over blocks.",
        lambda: _of_subjects(study, "norm", "norm of all torques (N m)"),
    )  # fmt: skip
    yield (
        "right-shoulder", "The right shoulder, subject by subject",
        "Norm of the three torques of the shoulder that holds the drill, mean over blocks.",
        lambda: _of_subjects(study, "right shoulder", "right shoulder (N m)"),
    )  # fmt: skip
    yield (
        "areas", "Change of every joint",
        "Change of the mean absolute torque, a bar for each block; whiskers are standard errors over "
        "subjects.",
        lambda: plot.effort_change(joints[:, 0], joints[:, 1], joints=study.joints),
    )  # fmt: skip
    scenes = [one.scene for one in study.sessions[0]]
    if None not in scenes:
        yield (
            "body", "One subject in the first block",
            "Torque at the joint that carries each segment, without and with the device; the names are those "
            "of the largest.",
            lambda: plot.body_effort(scenes[0], beside=scenes[1]),
        )  # fmt: skip
    yield (
        "coverage", "Can the intervals be trusted?",
        "Above: share of frames, over all sessions, in which the true torque lies inside its 95 % "
        "interval. Below: the true errors and the standard deviations that were stated for them (the toes "
        "carry too little to be seen).",
        lambda: plot.interval_coverage(study),
    )  # fmt: skip


def _of_subjects(study: OverheadStudy, measure: str, label: str) -> Any:
    from . import plot

    means = study.values(measure).mean(axis=2)
    return plot.subject_lines(means[:, 0], means[:, 1], label=label)


def _moving_body(study: OverheadStudy, folder: Path) -> str:
    """Write the page with the moving body; its name, or why there is none."""
    scenes = [one.scene for one in study.sessions[0]]
    if None in scenes:
        return ""
    from .plot import body_page

    try:
        body_page(
            scenes[0], folder / "body.html", beside=scenes[1],
            title="Overhead work without and with the device",
            source="subject 1, first block; simulated",
        )  # fmt: skip
    except FileNotFoundError as failure:
        return escape(str(failure))
    return '<a href="body.html">The moving body</a>, to turn and to play.'


# The page -----------------------------------------------------------------------------------------


def _page(study: OverheadStudy, found: Any, drawn: list[Picture], body: str, command: str) -> str:
    title = "Overhead work with and without an arm support"
    return document(
        title,
        [
            f"<h1>{title}</h1>",
            f'<p class="source">{len(study.sessions)} simulated subjects · two sessions · '
            f"{study.protocol.blocks} blocks · {study.coverage.frames:,} frames · "
            f"seed {study.seed}</p>",
            _answer(study),
            "<h2>Change with the device</h2>",
            _change_table(study),
            "<h2>Analysis of variance</h2>",
            "<p>Two-way, repeated measures, of the norm of all torques; degrees of freedom after "
            "Greenhouse and Geisser.</p>",
            _anova_table(study),
            "<h2>Table I as published, and the effort</h2>",
            "<p>The published reduction is that of the signed mean of all torques, rests included. It "
            "changes when one axis is turned round and cannot tell less effort from more.</p>",
            _published_table(study),
            "<h2>Figures</h2>",
            *(figure(picture) for picture in drawn),
            f"<p>{body}</p>" if body else "",
            "<h2>How often the intervals hold the truth</h2>",
            _coverage_words(study),
            _coverage_table(found["coverage"]),
            "<h2>Method</h2>",
            _method(study, command),
        ],
    )


def _answer(study: OverheadStudy) -> str:
    names = ("norm", "right shoulder", "torso", "right leg")
    change = study.change(names).relative
    true = study.change(names, true=True).relative
    parts = []
    for i, name in enumerate(names):
        what = "effort of the whole body" if name == "norm" else name
        parts.append(
            f"{what} {_percent(change.value[i])} [{_percent(change.low[i])}, "
            f"{_percent(change.high[i])}], true {_percent(true.value[i])}"
        )
    session = study.anova()["session"]
    covered = study.coverage
    return (
        '<div class="verdict good"><p class="word">With the device: '
        f"{parts[0]}.</p><p>{'; '.join(parts[1:])}.</p>"
        f"<p>Session: F({session.dof:.3g}, {session.error_dof:.3g}) = {session.f:.3g}, "
        f"{_p(session.p_corrected)}. {escape(covered.summary())}.</p></div>"
    )


def _change_table(study: OverheadStudy) -> str:
    change, true = study.change(_SHOWN), study.change(_SHOWN, true=True)
    rows = []
    for i, name in enumerate(_SHOWN):
        without, worn = study.values(name).mean(axis=(0, 2))
        d, r = change.difference, change.relative
        rows.append(
            [
                escape(name), f"{without:.2f}", f"{worn:.2f}",
                f"{d.value[i]:+.2f} [{d.low[i]:+.2f}, {d.high[i]:+.2f}]",
                f"{_percent(r.value[i])} [{_percent(r.low[i])}, {_percent(r.high[i])}]",
                _percent(true.relative.value[i]),
            ]
        )  # fmt: skip
    head = ["measure", "without (N m)", "with (N m)", "difference (N m)", "relative", "true"]
    return table(head, rows, dense=True)


def _anova_table(study: OverheadStudy) -> str:
    rows = []
    for effect in study.anova().effects:
        e = effect.epsilon
        rows.append(
            [
                escape(effect.name), f"{effect.f:.3g}",
                f"{e * effect.dof:.3g}, {e * effect.error_dof:.3g}", f"{e:.2f}",
                _p(effect.p_corrected), f"{effect.partial_eta_squared:.3f}",
            ]
        )  # fmt: skip
    head = ["effect", "F", "degrees of freedom", "epsilon", "p", "partial eta²"]
    return table(head, rows)


def _published_table(study: OverheadStudy) -> str:
    found = study.published
    rows = []
    for b in range(study.protocol.blocks):
        cells = [f"{b + 1}", f"{found.without_nm[b]:.2f}", f"{found.with_nm[b]:.2f}",
                 f"{100 * found.reduction[b]:.0f} %"]  # fmt: skip
        for one in (found.norm.relative, found.mean_abs.relative):
            cells.append(
                f"{_percent(one.value[b])} [{_percent(one.low[b])}, {_percent(one.high[b])}]"
            )
        rows.append(cells)
    head = ["block", "signed mean, without", "with (N m)", "“reduction”", "change of norm",
            "of mean absolute"]  # fmt: skip
    return table(head, rows, dense=True)


def _coverage_words(study: OverheadStudy) -> str:
    return (
        f"<p>{escape(study.coverage.summary())}. Fixed errors of sensors are drawn once a session, so "
        "the frames of a session are right or wrong together: the standard error counts sessions.</p>"
    )


def _coverage_table(rows: Any) -> str:
    cells = [
        [escape(row[0]), f"{100 * row[1]:.1f} %", *(f"{v:.3g}" if v != "" else "" for v in row[2:])]
        for row in rows[1:]
    ]
    head = ["joint", "inside", "true error (N m)", "stated", "of sensors", "of posture"]
    return table(head, cells, dense=True)


def _method(study: OverheadStudy, command: str) -> str:
    e, p = study.errors, study.protocol
    return definitions(
        [
            ("task", f"{p.blocks} blocks of {8 * p.repetitions} pointing movements (2 sizes of the "
             f"target, 4 starting points), {p.hold_s:g} s at the target, {p.rest_s:g} s of rest; drill "
             "of 0.66 kg in the right hand"),
            ("device", f"{escape(study.device)} of force over elevation, 1.8 kg, in balance with its "
             "reaction at the hip; true force off by "
             f"{100 * e.device_share:g} % an arm"),
            ("suit", f"17 sensors at {p.rate_hz:g} Hz; orientation of a segment off by "
             f"{e.segment_deg:g}° and wandering by {e.wander_deg:g}°; accelerometers off by "
             f"{e.imu_bias_m_s2:g} m/s² and {1e3 * e.imu_place_m:g} mm, noise {e.imu_noise_m_s2:g} m/s²"),
            ("shoes", f"{e.shoe_rate_hz:g} Hz; off by {e.shoe_bias_n:g} N, {e.shoe_bias_nm:g} N m, "
             f"{1e3 * e.shoe_place_m:g} mm and {e.shoe_tilt_deg:g}°, noise {e.shoe_noise_n:g} N and "
             f"{e.shoe_noise_nm:g} N m"),
            ("estimate", "maximum a posteriori with the deviations of the sensors, and the errors of the "
             "told posture carried through it; the body's masses and lengths are taken as known"),
            ("intervals", "bootstrap over subjects (bias-corrected, accelerated, moved out for few "
             "subjects)"),
            ("command", f"<code>{escape(command)}</code>" if command else ""),
        ]
    )  # fmt: skip


def _percent(share: float) -> str:
    return f"{100 * share:+.0f} %"


def _p(p: float) -> str:
    return "p &lt; 0.0001" if p < 1e-4 else f"p = {p:.4f}"


def _short(value: Any) -> Any:
    return f"{value:.6g}" if isinstance(value, float) else value
