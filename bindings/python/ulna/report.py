"""One HTML file that says what was found, how sure it is, and how it was done.

The file needs no network, no server and no script: figures are inside it as SVG. Read from the top
it answers first and justifies later, and it prints on A4.
"""

from __future__ import annotations

import re
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from . import plot
from ._page import definitions, document, figure, ordered
from ._result import record_information
from .record import refuse

_VERDICTS = {
    "passive": ("Passive", "good"),
    "not passive": ("Not passive", "bad"),
    "undecided": ("Undecided", "open"),
}
_APPROACHES = {
    "model": "the identified model alone",
    "energy": "the energy measured alone",
    "both": "the identified model and the energy measured",
}
# What the words of an outcome mean for the reader; others are shown by name.
_OUTCOMES = {
    "good": "",
    "closed_loop_biased": "The human moved the hand as well as the robot did, which biases least "
    "squares.",
    "poor_fit": "A second-order model does not describe this recording well; "
    "do not read M, B and K as properties of the limb.",
    "ill_conditioned": "The motion hardly tells some of the parameters apart.",
    "force_lag": "Force and motion do not seem to be recorded at the same instants.",
    "not_converged": "The constrained fit did not converge.",
    "not_finite": "The stiffness is singular along some direction: the equilibrium is undefined.",
    "unchecked": "The recording holds no reference, so nobody can tell how much of the motion the "
    "human caused.",
}
# Words that only say what could not be checked do not change the colour of the verdict.
_HARMLESS = {"good", "unchecked"}


def report(
    estimate: Any,
    path: Any,
    *,
    title: str | None = None,
    source: str | None = None,
    shoulder_m: tuple[float, float] | None = None,
    command: str | None = None,
    figures: Any = None,
) -> Path:
    """Write a report of an estimate as one HTML file and return its path.

    Parameters
    ----------
    estimate : ImpedanceEstimate
        What :func:`ulna.identify_impedance` returned.
    path : path-like
        The file to write; its folder is made when it does not exist.
    title : str, optional
        Heading; "Impedance of the limb" when left out.
    source : str, optional
        Name of the recording, shown below the heading.
    shoulder_m : tuple of two floats, optional
        Place of the shoulder in the frame of the record; the ellipses are then drawn on an arm.
    command : str, optional
        Command that made the report, kept with its provenance.
    figures : iterable of ulna.plot.Picture, optional
        Figures to use in place of ``ulna.plot.pictures(estimate)``.

    Examples
    --------
    >>> import ulna
    >>> log = ulna.read("examples/data/relaxed-arm.csv")
    >>> path = ulna.report(ulna.identify_impedance(log), "out/trial.html")
    >>> path.name
    'trial.html'
    """
    target = Path(path)
    if target.is_dir():
        raise refuse(
            f"{str(path)!r} is a folder: give the name of the file to write, as "
            f"{str(target / 'report.html')!r}",
            "path",
        )
    if figures is None:
        figures = plot.pictures(estimate, shoulder_m=shoulder_m)
    page = _page(estimate, title or "Impedance of the limb", source, command, figures)
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(page, encoding="utf-8")
    return target


def _page(
    estimate: Any, title: str, source: str | None, command: str | None, figures: Any
) -> str:
    verdict = estimate.passivity()
    parts = [
        f"<h1>{escape(title)}</h1>",
        f'<p class="source">{escape(_about(estimate, source))}</p>',
        _verdict(estimate, verdict),
        _warnings(estimate),
        "<h2>Parameters</h2>",
        _parameters(estimate),
        _fit_words(estimate),
        _trials(estimate),
        "<h2>Passivity</h2>",
        _passivity(estimate, verdict),
        _ellipses(estimate),
        "<h2>Figures</h2>",
        *[figure(picture) for picture in figures],
        "<h2>How it was done</h2>",
        _method(estimate, command),
    ]
    heading = f"{title} · {source}" if source else title
    return document(heading, parts)


# Numbers -----------------------------------------------------------------------------------------


def digits_after_point(spread: float) -> int:
    """Decimals that show two figures of an uncertainty.

    Examples
    --------
    >>> digits_after_point(0.0123), digits_after_point(9.7), digits_after_point(120.0)
    (3, 1, 0)
    """
    if not np.isfinite(spread) or spread <= 0:
        return 3
    return int(np.clip(1 - np.floor(np.log10(spread)), 0, 9))


def number(value: float, spread: float) -> str:
    """`value` with as many decimals as its uncertainty deserves, with a true minus sign."""
    if not np.isfinite(value):
        return "–"
    text = f"{value:.{digits_after_point(spread)}f}"
    if float(text) == 0.0:
        text = text.lstrip("-")
    return text.replace("-", "−")


def percent(probability: float) -> str:
    """A probability without false certainty: never 0 % or 100 %.

    Examples
    --------
    >>> percent(0.99972), percent(0.5), percent(1e-6)
    ('above 99.9 %', '50 %', 'below 0.1 %')
    """
    if not np.isfinite(probability):
        return "unknown"
    if probability > 0.999:
        return "above 99.9 %"
    if probability < 0.001:
        return "below 0.1 %"
    digits = 0 if 0.01 <= probability <= 0.99 else 1
    return f"{100 * probability:.{digits}f} %"


def value_and_interval(value: float, interval: Any) -> str:
    """``4.92 [4.10, 5.71]``; the value alone when there is no interval."""
    if interval is None or not np.all(np.isfinite(np.asarray(interval, dtype=float))):
        return f"{value:.3g}".replace("-", "−") if np.isfinite(value) else "–"
    low, high = (float(side) for side in np.ravel(interval))
    spread = (high - low) / 4
    return f"{number(value, spread)} [{number(low, spread)}, {number(high, spread)}]"


def held(value: float) -> str:
    """A parameter that the model holds at its value: ``0 (fixed)``.

    Examples
    --------
    >>> held(-0.0)
    '0 (fixed)'
    """
    return f"{value + 0.0:.3g} (fixed)".replace("-", "−")


# Parts -------------------------------------------------------------------------------------------


def _about(estimate: Any, source: str | None) -> str:
    facts = record_information(estimate.record)
    words = [source] if source else []
    words.append(f"{estimate.n} axis" if estimate.n == 1 else f"{estimate.n} axes")
    words.append(f"{facts['duration_s']:.1f} s at {facts['rate_hz']:.6g} Hz")
    if facts["trials"] > 1:
        words.append(f"{facts['trials']} trials")
    return " · ".join(words)


def _verdict(estimate: Any, verdict: Any) -> str:
    word, kind = _VERDICTS.get(verdict.verdict, (str(verdict.verdict).capitalize(), "open"))
    chance = percent(float(verdict.probability))
    lines = [
        f'<p class="word">{escape(word)}</p>',
        f"<p>The probability that the limb is passive is <b>{chance}</b>, judged by "
        f"{escape(_APPROACHES.get(verdict.approach, str(verdict.approach)))}.</p>",
    ]
    lines.append(f"<p>{_answer_in_words(estimate)}</p>")
    words = re.findall(r"\w+", str(estimate.outcome))
    told = [_OUTCOMES.get(word, f"Outcome: {word.replace('_', ' ')}.") for word in words]
    if any(told):
        sentences = escape(" ".join(sentence for sentence in told if sentence))
        lines.append(f"<p><b>Look before you use it:</b> {sentences}</p>")
    if kind == "good" and not _HARMLESS.issuperset(words):
        kind = "open"
    return f'<section class="verdict {kind}">' + "".join(lines) + "</section>"


def _answer_in_words(estimate: Any) -> str:
    low, high = estimate.interval("K")
    if estimate.n == 1:
        value = value_and_interval(float(estimate.K[0, 0]), (low[0, 0], high[0, 0]))
        words = f"Stiffness <b>{value} {escape(plot.unit_of(estimate, 'K'))}</b>"
    elif estimate.n == 2:
        shape = estimate.ellipses()["K"]
        unit = escape(plot.unit_of(estimate, "K"))
        major = value_and_interval(shape.major, getattr(shape, "major_interval", None))
        minor = value_and_interval(shape.minor, getattr(shape, "minor_interval", None))
        words = (
            f"Stiffness <b>{major} {unit}</b> along the stiffest direction and "
            f"<b>{minor} {unit}</b> along the softest"
        )
    else:
        values = ", ".join(
            value_and_interval(float(estimate.K[i, i]), (low[i, i], high[i, i]))
            for i in range(estimate.n)
        )
        words = f"Stiffness along the axes <b>{values} {escape(plot.unit_of(estimate, 'K'))}</b>"
    return f"{words}. {_explained(estimate)}"


def _explained(estimate: Any) -> str:
    """Share of the force explained: of all of it, and of the part that the perturbation caused."""
    force = "torque" if estimate.rotational else "force"
    shares = []
    if np.all(np.isfinite(estimate.vaf)):
        shares.append(f"{_percents(estimate.vaf)} of the {force} on data it has not seen")
    if np.all(np.isfinite(estimate.vaf_reference)):
        caused = f"what the perturbation caused of the {force}"
        shares.append(f"<b>{_percents(estimate.vaf_reference)}</b> of {caused}")
    if not shares:
        return "No data were held out to test the model."
    words = f"The model explains {', and '.join(shares)}."
    if len(shares) == 2 and np.min(estimate.vaf_reference) >= 90.0:
        words += " What is left is mostly what the human did besides, and noise."
    return words


def _percents(values: Any) -> str:
    # Never 100 % of a measured force: near it a decimal is shown.
    return " and ".join(
        f"{value:.{1 if value > 99 else 0}f} %" for value in np.atleast_1d(values)
    )


def _misled(estimate: Any) -> list[str]:
    """What least squares would have said, when the human moved the hand too."""
    squares = estimate.least_squares
    if squares is None or "closed_loop_biased" not in str(squares.outcome):
        return []
    distance = np.abs(np.asarray(estimate.K) - squares.K) / np.asarray(estimate.K_se)
    i, j = np.unravel_index(int(np.nanargmax(distance)), distance.shape)
    spread = float(np.asarray(estimate.K_se)[i, j])
    name = plot.entry_names(estimate, "K")[int(i) * estimate.n + int(j)]
    share = ""
    if estimate.rho is not None:
        totals = [f"{100 * float(t):.0f} %" for t in np.atleast_1d(estimate.rho.total)]
        share = f" ({' and '.join(totals)} of the motion's power)"
    return [
        f"The human moved the hand as well as the robot did{share}, which misleads least squares: "
        f"it would put the stiffness {name} at {number(float(squares.K[i, j]), spread)} instead "
        f"of {number(float(estimate.K[i, j]), spread)} {plot.unit_of(estimate, 'K')}. The numbers "
        "here come from instrumental variables, which the reference keeps free of that."
    ]


def _warnings(estimate: Any) -> str:
    sentences = [*estimate.warnings, *_misled(estimate)]
    if not sentences:
        return ""
    lines = "".join(f"<p>{_with_symbols(estimate, str(sentence))}</p>" for sentence in sentences)
    word = "Warning" if len(sentences) == 1 else "Warnings"
    return f'<section class="warn"><p><b>{word}</b></p>{lines}</section>'


def _with_symbols(estimate: Any, sentence: str) -> str:
    """A sentence as HTML in which ``k_yy`` and its like have an index."""
    text = escape(sentence)
    for matrix in ("M", "B", "K"):
        for entry in plot.entry_names(estimate, matrix):
            if "_" in entry:
                text = re.sub(rf"(?<!\w){re.escape(escape(entry))}(?!\w)", _symbol(entry), text)
    return text


def _symbol(name: str) -> str:
    letter, _, index = name.partition("_")
    return f'<i class="q">{letter}</i>' + (f"<sub>{escape(index)}</sub>" if index else "")


_NAMES = {"M": "Inertia", "B": "Damping", "K": "Stiffness", "x0": "Equilibrium"}


def _parameters(estimate: Any) -> str:
    squares = estimate.least_squares
    head = (
        "<th scope=col>Parameter</th><th scope=col>Estimate</th><th scope=col>Standard error</th>"
        "<th scope=col>95 % interval</th><th scope=col>Unit</th>"
    )
    if squares is not None:
        head += "<th scope=col>Least squares</th>"
    rows = []
    for name in ("M", "B", "K", "x0"):
        factor, unit = 1.0, plot.unit_of(estimate, name)
        if name == "x0" and not estimate.rotational:
            factor, unit = 1e3, "mm"
        value, spread = (
            factor * np.ravel(getattr(estimate, field)) for field in (name, name + "_se")
        )
        low, high = (factor * np.ravel(side) for side in estimate.interval(name))
        for i, entry in enumerate(plot.entry_names(estimate, name)):
            cells = [
                number(value[i], spread[i]),
                number(spread[i], spread[i]),
                f"{number(low[i], spread[i])} to {number(high[i], spread[i])}",
                escape(unit),
            ]
            if spread[i] == 0.0 and np.isfinite(value[i]):
                cells[:3] = [held(value[i]), "–", "–"]
            if squares is not None:
                other = factor * np.ravel(getattr(squares, name))
                shown = cells[0] if spread[i] == 0.0 else number(other[i], spread[i])
                cells.append(f'<span class="soft">{shown}</span>')
            title = f"{_NAMES[name]} " if i == 0 else ""
            first = ' class="first"' if i == 0 and name != "M" else ""
            rows.append(
                f"<tr{first}><th scope=row>{title}{_symbol(entry)}</th>"
                + "".join(f"<td>{cell}</td>" for cell in cells)
                + "</tr>"
            )
    return (
        f'<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>'
        + "".join(rows)
        + "</tbody></table></div>"
    )


def _fit_words(estimate: Any) -> str:
    words = f"Estimated by {escape(plot.method_name(estimate.estimator))}. "
    if estimate.n > 1:
        force = "torque" if estimate.rotational else "force"
        words += f"Rows of a matrix are axes of {force}, columns axes of motion. "
    intervals = getattr(estimate, "vaf_interval", None)
    axes = [str(name) for name in estimate.axes]
    parts = []
    for i, value in enumerate(np.atleast_1d(estimate.vaf)):
        pair = None if intervals is None else np.asarray(intervals)[:, i]
        along = f" along {escape(axes[i])}" if estimate.n > 1 else ""
        parts.append(f"{value_and_interval(float(value), pair)} %{along}")
    if np.all(np.isfinite(estimate.vaf)):
        words += "Variance accounted for on held-out data: " + ", ".join(parts) + ". "
    if np.all(np.isfinite(estimate.vaf_reference)):
        parts = [
            f"{value:.1f} %" + (f" along {escape(name)}" if estimate.n > 1 else "")
            for name, value in zip(axes, np.atleast_1d(estimate.vaf_reference), strict=True)
        ]
        words += "Of what the perturbation caused: " + ", ".join(parts) + "."
    return f"<p>{words.rstrip()}</p>"


def _trials(estimate: Any) -> str:
    """Mean and standard error over trials that were fitted one by one."""
    if estimate.trials is None:
        return ""
    rows, at = [], 0
    for name in ("M", "B", "K", "x0"):
        factor, unit = 1.0, plot.unit_of(estimate, name)
        if name == "x0" and not estimate.rotational:
            factor, unit = 1e3, "mm"
        for i, entry in enumerate(plot.entry_names(estimate, name)):
            mean, error = (
                factor * float(np.ravel(side)[at])
                for side in (estimate.trial_mean, estimate.trial_se)
            )
            told = f"{number(mean, error)} ± {number(error, error)}"
            each = ", ".join(number(factor * float(trial[at]), error) for trial in estimate.trials)
            if estimate.cov[at, at] == 0.0 and error == 0.0:
                told, each = held(mean), "–"
            title = f"{_NAMES[name]} " if i == 0 else ""
            first = ' class="first"' if i == 0 and name != "M" else ""
            rows.append(
                f"<tr{first}><th scope=row>{title}{_symbol(entry)}</th><td>{told}</td>"
                f'<td class="words soft">{each}</td><td>{escape(unit)}</td></tr>'
            )
            at += 1
    count = len(estimate.trials)
    return (
        f'<h2>Over {count} trials</h2><div class="scroll"><table><thead><tr>'
        "<th scope=col>Parameter</th><th scope=col>Mean ± standard error</th>"
        "<th scope=col>Each trial</th><th scope=col>Unit</th></tr></thead><tbody>"
        + "".join(rows)
        + "</tbody></table></div><p class=soft>Every trial fitted on its own; the standard error is "
        "that of the mean over trials.</p>"
    )


def _passivity(estimate: Any, verdict: Any) -> str:
    unit = escape(plot.unit_of(estimate, "B"))
    pairs = [("Why", escape(str(verdict.reason)))]
    pairs.append(("What would change it", escape(str(verdict.would_change))))
    for label, name in (("by the model", "model"), ("by the energy", "energy")):
        chance = getattr(verdict, name + "_probability", None)
        if chance is not None and np.isfinite(chance):
            pairs.append((f"Probability {label}", f"{percent(float(chance))} that it is passive"))
    for name, label in (("eop", "by the model"), ("eop_energy", "by the energy")):
        value = getattr(verdict, name, None)
        if value is None or not np.isfinite(value):
            continue
        word = "Excess" if value >= 0 else "Shortage"
        text = value_and_interval(float(value), getattr(verdict, name + "_interval", None))
        if name == "eop" and not np.any(estimate.B) and not np.any(estimate.B_se):
            text = held(0.0)
        pairs.append((f"{word} {label}", f"{text} {unit}"))
    intervals = {"M": verdict.m_min_interval, "K": verdict.k_min_interval}
    for name, interval in intervals.items():
        text = value_and_interval(float(verdict.eigenvalues[name]), interval)
        pairs.append(
            (f"Smallest eigenvalue of {name}", f"{text} {escape(plot.unit_of(estimate, name))}")
        )
    asymmetry = [
        f"{name} {100 * float(value):.1f} %"
        for name in ("M", "K")
        if (value := getattr(verdict, "z_mean_" + name, None)) is not None and np.isfinite(value)
    ]
    if estimate.n > 1 and asymmetry:
        pairs.append(("Antisymmetric part", ", ".join(asymmetry)))
    ends = [float(absorbed[-1]) for _, absorbed, _ in verdict.series if len(absorbed)]
    if ends:
        total = f"{sum(ends):.3g}".replace("-", "−")
        over = "the record" if len(ends) == 1 else f"{len(ends)} trials"
        pairs.append(("Energy absorbed", f"{total} J over {over}"))
    return definitions(pairs)


def _ellipses(estimate: Any) -> str:
    if estimate.n != 2:
        return ""
    rows = []
    for name, shape in estimate.ellipses().items():
        unit = escape(plot.unit_of(estimate, name))
        if not np.any(getattr(estimate, name)) and not np.any(getattr(estimate, name + "_se")):
            rows.append(
                f"<tr><th scope=row>{_NAMES[name]} ({unit})</th><td>{held(0.0)}</td>"
                f"<td>{held(0.0)}</td><td>undefined</td><td>undefined</td></tr>"
            )
            continue

        def told(field: str, shape: Any = shape) -> str:
            value = float(getattr(shape, field))
            base = field.removesuffix("_deg")
            for spelled in (f"{field}_interval", f"{base}_interval", f"{base}_interval_deg"):
                pair = getattr(shape, spelled, None)
                if pair is not None:
                    return value_and_interval(value, pair)
            return value_and_interval(value, None)

        angle = f"{told('angle_deg')}°" if getattr(shape, "angle_defined", True) else "undefined"
        rows.append(
            f"<tr><th scope=row>{_NAMES[name]} ({unit})</th><td>{told('major')}</td>"
            f"<td>{told('minor')}</td><td>{_shape_words(shape)}</td><td>{angle}</td></tr>"
        )
    return (
        '<h2>Ellipses</h2><div class="scroll"><table class="dense"><thead><tr>'
        "<th scope=col>Symmetric part</th>"
        "<th scope=col>Major</th><th scope=col>Minor</th><th scope=col>Shape</th>"
        "<th scope=col>Angle to x</th></tr></thead><tbody>" + "".join(rows) + "</tbody></table>"
        "</div><p class=soft>Values with 95 % intervals. Shape is major over minor.</p>"
    )


def _shape_words(shape: Any) -> str:
    value = float(shape.shape)
    if not np.isfinite(value):
        return "undefined"
    low, high = (float(side) for side in shape.minor_interval)
    if low <= 0.0 <= high:  # the denominator may be zero
        return f"{value:.3g} [unbounded]"
    return value_and_interval(value, shape.shape_interval)


def _method(estimate: Any, command: str | None) -> str:
    force = "torque" if estimate.rotational else "force"
    prepared = estimate.preprocessing
    text = prepared.text() if callable(getattr(prepared, "text", None)) else ""
    pairs = [
        ("Model", "M ẍ + B ẋ + K (x − x₀) = −F" + _payload(estimate)),
        ("Data", _split_words(estimate)),
        ("Sign", f"F is the {force} by the human on the robot; positive energy is absorbed by "
                 "the limb."),
        ("Preprocessing", escape(str(text))),
        ("Estimator", escape(plot.method_name(estimate.estimator).capitalize())),
        ("Condition number", f"{estimate.condition:.3g}" if _finite(estimate, "condition") else ""),
    ]  # fmt: skip
    if _finite(estimate, "lag_s"):
        spread = getattr(estimate, "lag_se_s", float("nan"))
        lag = f"{1e3 * estimate.lag_s:.2f} ms".replace("-", "−")
        if np.isfinite(spread):
            lag += f", standard error {1e3 * spread:.2f} ms"
        pairs.append((f"Lag between {force} and position", lag))
    facts = record_information(estimate.record)
    pairs.append(("Provenance", ordered(estimate.provenance)))
    found = [finding["message"] for finding in facts["findings"]]
    pairs.append(("Seen in the data", ordered(found)))
    if command:
        pairs.append(("Command", f"<code>{escape(command)}</code>"))
    notes = "".join(f"<li>{_with_symbols(estimate, str(note))}</li>" for note in estimate.notes)
    pairs.append(("Notes", f"<ol>{notes}</ol>" if notes else ""))
    return definitions(pairs)


def _payload(estimate: Any) -> str:
    if not estimate.payload_kg:
        return ""
    unit = escape(plot.unit_of(estimate, "M"))
    return f", after {estimate.payload_kg:g} {unit} of payload were taken off M"


def _split_words(estimate: Any) -> str:
    words = f"{estimate.train_rows} samples identify, {estimate.held_out_rows} validate"
    return words + ("; reported is a fit to all of them." if estimate.refitted else ".")


def _finite(estimate: Any, name: str) -> bool:
    value = getattr(estimate, name, None)
    return value is not None and bool(np.isfinite(value))
