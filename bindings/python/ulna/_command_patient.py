"""``ulna study patient``: what the runs of a study say of one measured patient."""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path
from typing import Any

from ._command import OK, Usage, add_command


def add_to(verbs: Any, add_file: Any) -> None:
    """Add the verb ``patient`` to ``ulna study``."""
    parser = add_command(
        verbs,
        "patient",
        summary="intervals of a measured patient, and which factor to measure better",
        examples="  ulna study patient elbow.toml --observed K_est=5.2:0.1 --quantity K\n"
        "  ulna study patient elbow.toml --observed K_est=5.2:0.1 --quantity K=0.05 "
        "--method emulator",
    )
    add_file(parser)
    parser.add_argument(
        "--observed", action="append", default=[], metavar="NAME=VALUE:ERROR",
        help="an output that predicts what was measured, the value and its standard error",
    )  # fmt: skip
    parser.add_argument(
        "--quantity", action="append", default=[], metavar="NAME[=ERROR]",
        help="an output that is asked for; its own standard error is a number or an output "
        "(default: every output)",
    )  # fmt: skip
    parser.add_argument(
        "--measurable", action="append", metavar="FACTOR",
        help="a factor that could be measured better (default: every factor)",
    )  # fmt: skip
    parser.add_argument(
        "--method", choices=("reweight", "emulator"), default="reweight",
        help="the runs themselves, or a Gaussian process that learns from them",
    )  # fmt: skip
    parser.add_argument(
        "--level", type=_share, default=0.9, metavar="SHARE", help="of the intervals (default: 0.9)"
    )
    parser.add_argument("--no-figures", action="store_true", help="numbers alone")
    parser.add_argument("--json", action="store_true", help="print one JSON object, nothing else")
    parser.set_defaults(run=_run)


def _share(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 < value < 1.0:
        raise argparse.ArgumentTypeError(f"{text!r} is no number between 0 and 1")
    return value


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def _observed(words: list[str]) -> dict[str, tuple[float, float]]:
    found = {}
    for word in words:
        name, equals, rest = word.partition("=")
        value, colon, error = rest.partition(":")
        pair = _number(value), _number(error)
        if not (name and equals and colon) or pair[0] is None or pair[1] is None:
            raise Usage(f"--observed {word!r} is not NAME=VALUE:ERROR, as K_est=5.2:0.1")
        found[name] = (pair[0], pair[1])
    return found


def _quantities(words: list[str]) -> dict[str, Any] | None:
    found: dict[str, Any] = {}
    for word in words:
        name, equals, error = word.partition("=")
        if not name or (equals and not error):
            raise Usage(f"--quantity {word!r} is not NAME or NAME=ERROR")
        number = _number(error)
        found[name] = (error if number is None else number) if equals else None
    return found or None


def _run(options: argparse.Namespace) -> int:
    from ._command_study import collected, folder_of, need_figures, read_file

    file = read_file(options)
    folder = folder_of(options)
    need_figures(options)
    if file.study.function is None:
        raise Usage(f"{file.path} names no model: there are no runs")
    if file.kind == "two-phase":
        raise Usage("a patient needs runs over all factors: choose kind 'sample' or 'sobol'")
    observed, quantities = _observed(options.observed), _quantities(options.quantity)
    phase, design = file.first_design()
    runs = collected(file, folder)(file.study, design, phase)
    found = runs.patient(
        quantities=quantities,
        observed=observed or None,
        measurable=options.measurable,
        method=options.method,
        level=options.level,
        seed=file.design["seed"],
        on_failure="error" if file.on_failure == "error" else "drop_block",
    )
    text = json.dumps(_told(found), indent=2, allow_nan=False)
    (folder / "patient.json").write_text(text + "\n", encoding="utf-8")
    if not options.no_figures:
        _draw(found, folder / "figures")
    if options.json:
        print(text)
        return OK
    print(found.summary())
    print(f"\nwritten: {folder / 'patient.json'}")
    return OK


def _draw(found: Any, folder: Path) -> None:
    import matplotlib.pyplot as plt

    from ._figure import style
    from .plot import Picture

    folder.mkdir(exist_ok=True)
    with style():
        figure = found.plot().flat[0].figure
        plt.close(figure)
        Picture(
            "patient", "One measured patient",
            "Intervals, and what a better known factor would leave of them.", figure,
        ).save(folder)  # fmt: skip


def _told(found: Any) -> dict[str, Any]:
    return {
        "level": found.level,
        "method": found.method,
        "runs": found.runs,
        "effective": found.effective,
        "distance": found.distance,
        "observed": {name: list(pair) for name, pair in found.observed.items()},
        "q2": dict(found.q2),
        "factors": {
            name: {"mean": mean, "deviation": deviation}
            for name, (mean, deviation) in found.factors.items()
        },
        "quantities": {
            name: {
                "unit": one.unit,
                "mean": one.mean,
                "deviation": one.deviation,
                "interval": list(one.interval),
                "interval_error": list(one.interval_error),
                "unobserved": list(one.unobserved),
                "noise_deviation": one.noise_deviation,
                "known": dict(one.known),
                "halved": dict(one.halved),
                "to_halve": dict(one.to_halve),
                "together": [list(pair) for pair in one.together],
                "advice": one.advice(),
            }
            for name, one in found.quantities.items()
        },
    }
