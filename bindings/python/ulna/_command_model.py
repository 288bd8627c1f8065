"""``ulna model``: a transfer function between channels of a recording."""

from __future__ import annotations

import argparse
import dataclasses
from typing import Any

import numpy as np

from ._command import (
    Usage,
    add_command,
    add_recording,
    add_results,
    check_out,
    not_negative,
    read_recording,
    say,
    whole_numbers,
)


def add_to(commands: Any) -> None:
    """Add the command."""
    parser = add_command(
        commands,
        "model",
        summary="identify a transfer function in continuous time, and how many poles it has",
        examples="  ulna model log.csv --input F_x --output x --poles 4 --zeros 3\n"
        "  ulna model log.csv --input x_ref --output x --poles 1,2,3,4 --delay 0:40:5\n"
        "  ulna model log.csv --input x_ref --output x --poles 2 --out fit --json",
    )
    add_recording(parser)
    parser.add_argument("--input", metavar="NAME", required=True, help="channel, or several with commas")
    parser.add_argument("--output", metavar="NAME", required=True, help="channel")
    add_results(parser, "result.json and the figure")
    parser.add_argument(
        "--poles", metavar="N", type=whole_numbers, default=[2],
        help="one number, or several with commas to choose among (default: 2)",
    )  # fmt: skip
    parser.add_argument(
        "--zeros", metavar="N", type=whole_numbers, help="the same (default: poles - 1)"
    )
    parser.add_argument(
        "--delay", metavar="MS", type=delays, default=[0.0],
        help="of the input in ms; as 0:40:5 to search from 0 to 40 by 5 (default: 0)",
    )  # fmt: skip
    parser.add_argument(
        "--criterion", choices=("held-out", "bic", "aicc", "yic"), default="held-out",
        help="that chooses (default: %(default)s)",
    )  # fmt: skip
    parser.add_argument(
        "--method", choices=("srivc", "oe"), default="srivc",
        help="refined instrumental variables or output error (default: %(default)s)",
    )  # fmt: skip
    parser.add_argument(
        "--hold", choices=("zoh", "foh"), default="zoh",
        help="of the input between samples: a computer's command or a recorded motion (default: %(default)s)",
    )  # fmt: skip
    parser.set_defaults(run=_run)


def delays(text: str) -> list[float]:
    """Milliseconds, one or ``from:to:step``, in seconds."""
    parts = [not_negative(part) for part in text.split(":")]
    if len(parts) == 1:
        return [1e-3 * parts[0]]
    if len(parts) == 3 and parts[1] < 1.0:
        raise argparse.ArgumentTypeError(f"{text!r} is in ms, as 0:40:5")
    if len(parts) != 3 or parts[2] <= 0 or parts[1] < parts[0]:
        raise argparse.ArgumentTypeError(f"{text!r} is not ms, as 12 or 0:40:5")
    steps = int((parts[1] - parts[0]) / parts[2] + 1e-9)
    return [1e-3 * (parts[0] + i * parts[2]) for i in range(steps + 1)]


def _run(options: argparse.Namespace) -> int:
    from . import models

    check_out(options)
    names = options.input.split(",")
    shared = {
        "input": names if len(names) > 1 else names[0],
        "output": options.output,
        "method": options.method,
        "hold": options.hold,
    }
    record = _read(options)
    one = len(options.poles) == len(options.delay) == 1 and len(options.zeros or [0]) == 1
    selection = None
    if one:
        zeros = None if options.zeros is None else options.zeros[0]
        found = models.identify_transfer_function(
            record, poles=options.poles[0], zeros=zeros, delay_s=options.delay[0], **shared
        )
    else:
        selection = models.select_order(
            record, poles=options.poles, zeros=options.zeros, delay_s=options.delay,
            criterion=options.criterion, **shared,
        )  # fmt: skip
        if not options.json:
            print(selection.summary() + "\n")
        found = selection.identify()
    return say(options, "model", found, _values(found, selection))


def _read(options: argparse.Namespace) -> Any:
    """The record, with its channels named when one is missing."""
    record = read_recording(options)
    held = [channel.name for channel in record.channels]
    for name in [*options.input.split(","), options.output]:
        if name not in held:
            raise Usage(f"there is no channel {name!r}; the record holds {', '.join(held)}")
    return record


def _values(found: Any, selection: Any) -> dict[str, Any]:
    """An estimate without its time series."""
    out = {
        f.name: getattr(found, f.name)
        for f in dataclasses.fields(found)
        if f.repr and not f.name.startswith("_")
    }
    for name in ("poles", "zeros"):
        roots = getattr(found, name)
        if isinstance(roots, np.ndarray):
            out[name] = [[root.real, root.imag] for root in roots]
    out["intervals_95"] = {name: found.interval(name) for name in found.names}
    if selection is not None:
        out["candidates"] = list(selection.candidates)
        out["reason"] = selection.reason
    return out
