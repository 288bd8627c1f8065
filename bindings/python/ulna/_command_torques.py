"""The command ``ulna torques``: joint torques of a whole body from recordings, with error bars."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from ._command import OK, add_command, add_results, check_out, count, positive


def add_to(commands: Any) -> None:
    """Add the command."""
    parser = add_command(
        commands,
        "torques",
        summary="joint torques of a whole body from motion, shoes and plates, with error bars",
        examples="  ulna torques bowing.csv --body bowing-model.json\n"
        "  ulna torques suit.mvnx shoes.csv --body person.toml --out report\n"
        "  ulna torques walk.mot forces.mot --body person.urdf --same-clock --json",
    )
    parser.add_argument(
        "file", metavar="FILE", nargs="+",
        help="recordings of one capture: MVNX, MOT, STO, C3D (its plates), CSV and what else is read; "
        "one of them holds the motion",
    )  # fmt: skip
    parser.add_argument(
        "--body", metavar="BODY", required=True,
        help="the person, the sensors and the device: TOML, URDF, MJCF or JSON",
    )  # fmt: skip
    add_results(parser, "report.html, result.json, tables, figures and the page of the moving body")
    parser.add_argument(
        "--calibration", metavar="FILE",
        help="recording in which all segments turn about, which tells where the sensors sit",
    )  # fmt: skip
    parser.add_argument(
        "--same-clock", action="store_true", help="the files were recorded on one clock"
    )
    parser.add_argument(
        "--rate", metavar="HZ", type=positive, help="of the frames (default: that of the motion)"
    )
    fit = parser.add_argument_group("filter and variances")
    fit.add_argument(
        "--window", metavar="S", type=positive, default=0.25,
        help="length of the filter that all signals pass (default: %(default)s)",
    )  # fmt: skip
    fit.add_argument(
        "--order", metavar="N", type=count, default=4, help="of its polynomials (default: 4)"
    )
    fit.add_argument(
        "--variances", choices=("data", "given"), default="data",
        help="standard deviations of the sensors: those that make the recording most likely, or those "
        "of the body's file (default: data)",
    )  # fmt: skip
    parser.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    from . import __version__
    from ._capture_tables import plain_result
    from ._result import plain
    from .capture import recorded_torques

    check_out(options)
    found = recorded_torques(
        [Path(file) for file in options.file],
        Path(options.body),
        calibration=None if options.calibration is None else Path(options.calibration),
        clocks="shared" if options.same_clock else "fit",
        rate_hz=options.rate,
        window_s=options.window,
        order=options.order,
        variances=options.variances,
    )
    text = json.dumps(
        plain({**plain_result(found), "ulna": __version__}), indent=2, allow_nan=False
    )
    lines = [] if options.out is None else _write(options, Path(options.out), found, text)
    if options.json:
        print(text)
        return OK
    print(found.summary())
    if lines:
        print("\n" + "\n".join(lines))
    return OK


def _write(options: argparse.Namespace, folder: Path, found: Any, text: str) -> list[str]:
    """Everything that ``--out`` promises, and a line for what could not be written."""
    from ._capture_report import pictures, write_report

    folder.mkdir(parents=True, exist_ok=True)
    (folder / "result.json").write_text(text + "\n", encoding="utf-8")
    found.tables(folder)
    drawn = pictures(found)
    for picture in drawn:
        picture.save(folder)
    path = write_report(
        found, folder / "report.html", title="", command=options.command_line, figures=drawn
    )
    lines = [f"report: {path}"]
    try:
        lines.append(f"moving body: {found.page(folder / 'body.html')}")
    except FileNotFoundError as failure:
        lines.append(f"no page of the moving body: {failure}")
    return lines
