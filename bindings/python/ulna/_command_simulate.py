"""``ulna simulate``: an experiment that never took place, as a log that reads like a recorded one."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from . import _command_assessment
from ._command import OK, Usage, add_command, check_file, not_negative, seed

_TABLES = ("3.2", "3.4", "4.1", "4.2", "5.6")


def add_to(commands: Any) -> None:
    """Add the command ``simulate`` with its kinds."""
    parser = add_command(
        commands,
        "simulate",
        summary="simulate an experiment and write its log",
        examples="  ulna simulate arm --design design.csv --out log.csv\n"
        "  ulna simulate rigid --design force-steps.csv --out log.csv --tremor 0.3\n"
        "  ulna simulate springs --design design.csv --out log.csv --mass 1.031\n"
        "  ulna simulate assessment --out log.csv",
    )
    kinds = parser.add_subparsers(dest="kind", metavar="KIND", required=True)
    arm = _add_kind(
        kinds, "arm", "a relaxed arm on the robot's handle",
        "  ulna simulate arm --design design.csv --out log.csv --tremor 1 --kp 500",
    )  # fmt: skip
    _add_arm(arm)
    rigid = _add_kind(
        kinds, "rigid", "an arm that holds its place against force perturbations",
        "  ulna design steps --size 2 --unit N --out design.csv\n"
        "  ulna simulate rigid --design design.csv --out log.csv",
    )  # fmt: skip
    _add_arm(rigid)
    springs = _add_kind(
        kinds, "springs", "springs between handle and frame, with a payload",
        "  ulna simulate springs --design design.csv --out log.csv "
        "--rates 0,200,0,90,0,200,0,90 --rest 0.1 --mass 1.031",
    )  # fmt: skip
    springs.add_argument(
        "--rates", type=_eight, default=(80.0,) * 8, metavar="K1,...,K8",
        help="N/m, at the places of the frame, 0: none (default: 80 at each)",
    )  # fmt: skip
    springs.add_argument(
        "--rest", type=not_negative, default=0.09, metavar="M", help="rest length (default: 0.09)"
    )
    springs.add_argument(
        "--mass", type=not_negative, default=0.539, metavar="KG", help="payload (default: 0.539)"
    )
    _command_assessment.add_to(kinds)


def _add_kind(kinds: Any, name: str, summary: str, examples: str) -> argparse.ArgumentParser:
    parser = add_command(kinds, name, summary=summary, examples=examples)
    parser.add_argument(
        "--design",
        required=True,
        metavar="CSV",
        help="table of references, as `ulna design` writes",
    )
    parser.add_argument("--out", required=True, metavar="CSV", help="the log")
    parser.add_argument("--seed", type=seed, default=0, help="from 0 (default: 0)")
    parser.add_argument(
        "--kp",
        type=not_negative,
        default=3000.0,
        help="of the position control, N/m (default: 3000)",
    )
    parser.add_argument("--kd", type=not_negative, default=120.0, help="N s/m (default: 120)")
    parser.add_argument("--exact", action="store_true", help="sensors without noise and steps")
    parser.add_argument(
        "--extras", type=_words, default=(), metavar="WORDS",
        help="more channels: acceleration,robot,truth",
    )  # fmt: skip
    parser.add_argument(
        "--json", action="store_true", help="print one JSON object and nothing else"
    )
    parser.set_defaults(run=_simulate)
    return parser


def _add_arm(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--table", choices=_TABLES, default="3.2", help="of published arms (default: 3.2)"
    )
    parser.add_argument("--row", default="P1", help="participant or method (default: P1)")
    parser.add_argument(
        "--arm", metavar="JSON", help="file with M, B and K instead, as `ulna assess --json` prints"
    )
    parser.add_argument(
        "--payload", type=not_negative, default=0.0, metavar="KG", help="at the handle (default: 0)"
    )
    parser.add_argument(
        "--tremor", type=not_negative, default=0.0, metavar="N", help="rms (default: 0)"
    )


def _words(text: str) -> tuple[str, ...]:
    return tuple(word for word in text.split(",") if word)


def _eight(text: str) -> tuple[float, ...]:
    rates = tuple(not_negative(part) for part in text.split(","))
    if len(rates) != 8:
        raise argparse.ArgumentTypeError(f"{text!r} is not eight numbers, as 0,200,0,90,0,200,0,90")
    return rates


def _simulate(options: argparse.Namespace) -> int:
    from . import io, sim

    target = Path(options.out)
    check_file(target)
    arm = _springs(options) if options.kind == "springs" else _arm(options)
    human = sim.Human(tremor_n=getattr(options, "tremor", 0.0))
    if options.kind == "rigid":
        human = sim.holding(arm, tremor_n=options.tremor)
    design = io.read(options.design)
    if options.kind == "rigid" and not any(c.name.startswith("F_") for c in design.channels):
        raise Usage(
            f"an arm that holds its place is perturbed by forces, but {options.design} holds "
            "positions: use `ulna design steps --unit N`"
        )
    log = sim.simulate(
        arm,
        design,
        robot=sim.Robot(kp_n_m=options.kp, kd_n_s_m=options.kd),
        human=human,
        sensors=sim.Sensors.exact() if options.exact else None,
        extras=options.extras,
        seed=options.seed,
    )
    log.to_csv(target)
    if options.json:
        print(json.dumps(_result(log, target), indent=2))
    else:
        print(f"{log!r}", *log.provenance, f"log: {target}", sep="\n")
    return OK


def _arm(options: argparse.Namespace) -> Any:
    from . import sim

    if options.arm is None:
        rows = sim.arms(options.table)
        if options.row not in rows:
            raise Usage(
                f"--row {options.row} is none of Table {options.table}: it has {', '.join(rows)}"
            )
        return rows[options.row].with_(payload_kg=options.payload)
    try:
        found = json.loads(Path(options.arm).read_text(encoding="utf-8"))
        matrices = [found[name] for name in ("M", "B", "K")]
    except (KeyError, TypeError, json.JSONDecodeError, UnicodeDecodeError) as failure:
        raise Usage(
            f"--arm {options.arm} is no JSON object with M, B and K ({failure})"
        ) from failure
    return sim.Arm(*matrices, payload_kg=options.payload)


def _springs(options: argparse.Namespace) -> Any:
    from . import rig, sim

    array = rig.SpringArray.on_frame(options.rates, rest_m=options.rest)
    return sim.Arm.of_springs(array, mass_kg=options.mass)


def _result(log: Any, target: Path) -> dict[str, Any]:
    return {
        "log": str(target),
        "rows": len(log.time),
        "rate_hz": log.rate_hz,
        "channels": [c.name for c in log.channels],
        "segments": [[s.begin, s.end] for s in log.segments],
        "provenance": list(log.provenance),
    }
