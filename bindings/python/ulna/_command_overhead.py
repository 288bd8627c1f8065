"""``ulna study overhead``: overhead work with and without an arm support, from simulation to report."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from ._command import OK, add_command, check_folder, count, require_matplotlib, seed


def add_to(verbs: Any) -> None:
    """Add the verb ``overhead`` to ``ulna study``."""
    parser = add_command(
        verbs,
        "overhead",
        summary="simulate overhead work with and without an arm support, and analyse it",
        examples="  ulna study overhead --out out/overhead\n"
        "  ulna study overhead --out out/quick --quick\n"
        "  ulna study overhead --out out/measured --device paexo.csv --subjects 12",
    )
    parser.add_argument("--out", required=True, metavar="DIR", help="of tables, figures and report")
    parser.add_argument(
        "--subjects", type=_people, default=None, metavar="N", help="people (default: 12)"
    )
    parser.add_argument("--blocks", type=count, metavar="N", help="of a session (default: 5)")
    parser.add_argument(
        "--repetitions", type=count, metavar="N",
        help="of each of the 8 movements in a block (default: 3)",
    )  # fmt: skip
    parser.add_argument(
        "--quick", action="store_true", help="4 people, 2 short blocks: seconds instead of minutes"
    )
    parser.add_argument(
        "--device", metavar="CSV", help="measured force curves (default: a smooth curve)"
    )
    parser.add_argument("--seed", type=seed, default=0, metavar="N", help="(default: 0)")
    parser.add_argument(
        "--workers", type=count, metavar="N", help="sessions at once (default: one a processor)"
    )
    parser.add_argument("--quiet", action="store_true", help="no lines about the progress")
    parser.add_argument("--json", action="store_true", help="print one JSON object, nothing else")
    parser.set_defaults(run=_run)


def _people(text: str) -> int:
    number = count(text)
    if number < 3:
        raise argparse.ArgumentTypeError(f"{text} is too few: a comparison needs at least 3")
    return number


def _run(options: argparse.Namespace) -> int:
    from ._overhead_report import result
    from ._result import plain
    from .overhead import Protocol, overhead_study

    require_matplotlib()
    folder = Path(options.out)
    check_folder(folder)
    asked = {"blocks": options.blocks, "repetitions": options.repetitions}
    short = {"blocks": 2, "repetitions": 1, "rest_s": 8.0, "still_s": 2.0} if options.quick else {}
    study = overhead_study(
        subjects=options.subjects or (4 if options.quick else 12),
        protocol=Protocol(**short | {name: n for name, n in asked.items() if n is not None}),
        device=options.device,
        seed=options.seed,
        workers=options.workers or 0,
        progress=(lambda done, of: None) if options.quiet else _tell,
    )
    page = study.write(folder, command=options.command_line)
    if options.json:
        found = {**result(study), "report": str(page)}
        print(json.dumps(plain(found), indent=2, allow_nan=False))
        return OK
    print(study.summary())
    print(f"\nreport: {page}")
    return OK


def _tell(done: int, of: int) -> None:
    end = "\n" if done == of or not sys.stderr.isatty() else "\r"
    print(f"session {done} of {of}", end=end, file=sys.stderr, flush=True)
