"""``ulna passivity``: passivity indices of a linear system."""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from ._command import (
    Usage,
    add_command,
    add_results,
    check_out,
    number,
    numbers,
    pair,
    say,
)


def add_to(commands: Any) -> None:
    """Add the command."""
    parser = add_command(
        commands,
        "passivity",
        summary="judge the passivity of a linear system or of a two-port",
        examples='  ulna passivity --num "1 3.1" --den "1 3 2"\n'
        '  ulna passivity --num "1.3 6 42" --den "1 0" --band 0.5,20 --out judged\n'
        "  ulna passivity report/result.json\n"
        "  ulna passivity teleoperator.json --two-port --shortage 1.5 --json",
    )
    parser.add_argument(
        "file", metavar="FILE", nargs="?",
        help="JSON with num and den, with A, B, C and D, or with M, B and K as `ulna assess` writes",
    )  # fmt: skip
    parser.add_argument("--num", metavar="B", type=numbers, help="numerator, highest power first")
    parser.add_argument("--den", metavar="A", type=numbers, help="denominator, highest power first")
    add_results(parser, "result.json and the figure")
    parser.add_argument(
        "--band", metavar="LO,HI", type=pair, help="judge the response in this band only, rad/s"
    )
    parser.add_argument(
        "--direction", metavar="D", type=numbers, help="of motion, as 1,0, for several ports"
    )
    two = parser.add_argument_group("two-port")
    two.add_argument(
        "--two-port", action="store_true", help="absolute stability by Llewellyn's criterion"
    )
    two.add_argument(
        "--shortage", metavar="N S/M", type=number, default=0.0,
        help="of passivity that one termination has; negative: an excess (default: 0)",
    )  # fmt: skip
    two.add_argument(
        "--port", type=int, choices=(1, 2), help="with that termination (default: 2)"
    )
    parser.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    import ulna

    check_out(options)
    system = _system(options)
    if not options.two_port and (options.shortage != 0 or options.port is not None):
        raise Usage("--shortage and --port belong to --two-port")
    if options.two_port:
        if options.band is not None or options.direction is not None:
            raise Usage("--two-port judges every frequency: leave --band and --direction out")
        found = ulna.passivity.two_port(system, shortage=options.shortage, port=options.port or 2)
        name = "two-port"
    else:
        found = ulna.passivity.indices(
            system, band_rad_s=options.band, direction=options.direction
        )
        name = "passivity"
    hidden = {"system", "network"}
    values = {
        f.name: _told(getattr(found, f.name))
        for f in dataclasses.fields(found)
        if f.name not in hidden
    }
    return say(options, name, found, values)


def _told(value: Any) -> Any:
    """An infinite index is an answer, for which JSON has no number."""
    return str(value) if isinstance(value, float) and math.isinf(value) else value


def _arm(M: Any, B: Any, K: Any) -> Any:
    """Matrices as an estimate has them: small antisymmetric parts of M and K are dropped."""
    return SimpleNamespace(M=M, B=B, K=K, x0=None)


def _system(options: argparse.Namespace) -> Any:
    import ulna

    given = options.num is not None or options.den is not None
    if given == (options.file is not None):
        raise Usage("give a FILE, or --num and --den")
    if given:
        if options.num is None or options.den is None:
            raise Usage("--num and --den go together")
        return ulna.TransferFunction(options.num, options.den)
    text = Path(options.file).read_text(encoding="utf-8")
    try:
        held = json.loads(text)
    except json.JSONDecodeError as failure:
        raise Usage(f"{options.file} is not JSON: {failure}") from None
    if isinstance(held, dict):
        for names, make in (
            (("num", "den"), ulna.TransferFunction),
            (("A", "B", "C", "D"), ulna.StateSpace),
            (("M", "B", "K"), _arm),
        ):
            if all(name in held for name in names):
                return make(*(held[name] for name in names))
    raise Usage(f"{options.file} must hold num and den, or A, B, C and D, or M, B and K")
