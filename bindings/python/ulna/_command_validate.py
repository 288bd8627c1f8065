"""``ulna validate``: published tables beside ours."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from ._command import OK, add_command, check_folder


def add_to(commands: Any) -> None:
    """Add the command."""
    parser = add_command(
        commands,
        "validate",
        summary="put published tables beside what comes out here",
        examples="  ulna validate impedance\n"
        "  ulna validate impedance --out validation\n"
        "  ulna validate impedance --json",
    )
    parser.add_argument("what", choices=("impedance",), help="impedance: the tables of Dyck (2013)")
    parser.add_argument("--out", metavar="DIR", help="write impedance.html and impedance.json")
    parser.add_argument("--json", action="store_true", help="print one JSON object, nothing else")
    parser.set_defaults(run=_validate)


def _validate(options: argparse.Namespace) -> int:
    from . import validate

    if options.out is not None:
        check_folder(Path(options.out))
    found = validate.impedance()
    text = json.dumps(found.to_dict(), indent=2, allow_nan=False, ensure_ascii=False)
    if options.out is not None:
        page = found.write(Path(options.out) / "impedance.html")
        page.with_suffix(".json").write_text(text + "\n", encoding="utf-8")
    if options.json:
        print(text)
        return OK
    print(found.summary())
    if options.out is not None:
        print(f"\npage: {page}")
    return OK
