"""``ulna rig``: springs of known stiffness, sensors against each other, force without a sensor."""

from __future__ import annotations

import argparse
import dataclasses
from typing import Any

from ._command import (
    OK,
    Usage,
    add_command,
    add_recording,
    add_results,
    check_out,
    not_negative,
    numbers,
    positive,
    read_recording,
    say,
)


def add_to(commands: Any) -> None:
    """Add the command."""
    parser = add_command(
        commands,
        "rig",
        summary="tools of the rig: springs, sensor check, gauge calibration, virtual force",
        examples='  ulna rig springs --rates "0 200 0 90 0 200 0 90" --rest 0.10\n'
        "  ulna rig check log.csv --acceleration a\n"
        '  ulna rig calibrate --volts "-5.9 -3.5 -1.1 1.2 3.6 5.9" --force "50.9 30.6 10.1 -9.8 -30.4 -50"\n'
        "  ulna rig force log.csv --acceleration a --to sensed.csv",
    )
    tools = parser.add_subparsers(dest="tool", metavar="TOOL", required=True)
    _add_springs(tools)
    _add_check(tools)
    _add_calibrate(tools)
    _add_force(tools)


def _tool(tools: Any, name: str, summary: str) -> argparse.ArgumentParser:
    parser: argparse.ArgumentParser = tools.add_parser(
        name, help=summary, description=summary[0].upper() + summary[1:] + ".", allow_abbrev=False
    )
    parser.add_argument(
        "--debug", action="store_true", default=argparse.SUPPRESS,
        help="show the traceback of an error",
    )  # fmt: skip
    return parser


def _add_springs(tools: Any) -> None:
    parser = _tool(tools, "springs", "equilibrium and stiffness of a spring array")
    parser.add_argument(
        "--rates", metavar="N/M", type=numbers, required=True,
        help="of the springs at the eight places k1 to k8 of the frame; 0: none",
    )  # fmt: skip
    parser.add_argument(
        "--rest", metavar="M", type=positive, required=True, help="relaxed length of every spring"
    )
    add_results(parser, "result.json and the figure")
    parser.set_defaults(run=_springs)


def _add_check(tools: Any) -> None:
    parser = _tool(tools, "check", "the accelerometer, twice integrated, against the encoders")
    add_recording(parser)
    parser.add_argument(
        "--acceleration", metavar="WORD", required=True, help="a stands for a_x and a_y"
    )
    add_results(parser, "result.json and the figure")
    parser.set_defaults(run=_check)


def _add_calibrate(tools: Any) -> None:
    parser = _tool(tools, "calibrate", "a line from known forces to a gauge's volts")
    parser.add_argument(
        "--volts", metavar="V", type=numbers, required=True, help="what the gauge showed"
    )
    parser.add_argument(
        "--force", metavar="N", type=numbers, required=True, help="the known forces, one a voltage"
    )
    parser.add_argument(
        "--errors", metavar="N", type=numbers, help="standard deviations; one, or one a point"
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object, nothing else")
    parser.set_defaults(run=_calibrate)


def _add_force(tools: Any) -> None:
    parser = _tool(tools, "force", "the force on the handle of the planar capstan robot from its motors")
    add_recording(parser)
    parser.add_argument(
        "--acceleration", metavar="WORD",
        help="of the accelerometer; without it the angles are differentiated",
    )  # fmt: skip
    parser.add_argument("--reference", metavar="WORD", help="of the commanded motion")
    parser.add_argument(
        "--alpha", metavar="A", type=numbers, help="the robot's five parameters (default: the thesis')"
    )
    for name, unit, what in (
        ("torque-noise", "NM", "of a torque sample"),
        ("angle-noise", "RAD", "of an angle sample"),
        ("acceleration-noise", "M/S2", "of an acceleration sample"),
    ):
        parser.add_argument(
            f"--{name}", metavar=unit, type=not_negative, default=0.0,
            help=f"standard deviation {what} (default: 0)",
        )  # fmt: skip
    parser.add_argument(
        "--to", metavar="CSV", required=True, help="where the record with the force is written"
    )
    parser.set_defaults(run=_force)


def _springs(options: argparse.Namespace) -> int:
    from .rig import SpringArray

    check_out(options)
    array = SpringArray.on_frame(options.rates, rest_m=options.rest)
    found = array.equilibrium()
    values = {f.name: getattr(found, f.name) for f in dataclasses.fields(found)}
    return say(options, "springs", array, values)


def _check(options: argparse.Namespace) -> int:
    from .rig import cross_check

    check_out(options)
    found = cross_check(read_recording(options), acceleration=options.acceleration)
    traces = {"time", "accelerometer", "encoder"}
    values = {
        f.name: getattr(found, f.name) for f in dataclasses.fields(found) if f.name not in traces
    }
    return say(options, "check", found, values)


def _calibrate(options: argparse.Namespace) -> int:
    from .rig import calibrate_line

    options.out = None  # a line has no figure of its own
    errors = options.errors
    if errors is not None and len(errors) == 1:
        errors = errors[0]
    found = calibrate_line(options.volts, options.force, errors_n=errors)
    values = {f.name: getattr(found, f.name) for f in dataclasses.fields(found)}
    return say(options, "calibration", found, values)


def _force(options: argparse.Namespace) -> int:
    from . import virtual_sensor
    from .plant import PlanarRobot

    robot = None
    if options.alpha is not None:
        if len(options.alpha) != 5:
            raise Usage(f"--alpha needs five numbers and has {len(options.alpha)}")
        robot = PlanarRobot(alpha=tuple(options.alpha))
    sensed = virtual_sensor.sense(
        read_recording(options),
        robot=robot,
        acceleration=options.acceleration,
        reference=options.reference,
        torque_noise_nm=options.torque_noise,
        angle_noise_rad=options.angle_noise,
        acceleration_noise_m_s2=options.acceleration_noise,
    )
    sensed.record.to_csv(options.to)
    print(sensed.summary())
    print(f"\nrecord: {options.to}")
    return OK
