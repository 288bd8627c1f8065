#!/usr/bin/env python3
"""Compares the interface of now with the released one in capi/abi/ulna-<number>.json.

A member, a constant or a signature that changed or went away fails: it would break programs that
are built. What is new is allowed, and recorded with --update.

    abicheck.py                       headers against the record
    abicheck.py --library libulna.so  the exported functions of a built library as well
    abicheck.py --update              write the record
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from apigen import layout_source, member_text
from cheader import Alias, Function, Handle, HeaderError, Interface, Struct, read_interface

ROOT = Path(__file__).resolve().parents[2]

_PRINTER = r"""
#include <stdio.h>
int main(void) {
  for (int i = 0; i < ulna_layout_rows; ++i) {
    const ulna_layout_row *r = &ulna_layout_actual[i];
    printf("%s %s %lld %lld\n", r->type, r->member[0] ? r->member : "-", (long long)r->offset,
           (long long)r->size);
  }
  return 0;
}
"""


def real_layout(interface: Interface, headers: Path) -> dict[tuple[str, str], tuple[int, int]]:
    """(struct, member) -> (offset, size) as the C compiler lays it out; member "-" is the whole."""
    with tempfile.TemporaryDirectory() as folder:
        source, program = Path(folder, "layout.c"), Path(folder, "layout")
        source.write_text(layout_source(interface) + _PRINTER, encoding="utf-8")
        compiler = os.environ.get("CC", "cc")
        include = [f"-I{headers.parent}", f"-I{ROOT / 'tests' / 'abi'}"]
        subprocess.run([compiler, "-std=c99", *include, str(source), "-o", str(program)], check=True)
        text = subprocess.run([str(program)], check=True, capture_output=True, text=True).stdout
    rows = (line.split() for line in text.splitlines())
    return {(kind, member): (int(offset), int(size)) for kind, member, offset, size in rows}


def describe(interface: Interface, headers: Path) -> dict:
    """The interface as the data that is committed."""
    places = real_layout(interface, headers)
    structs = {}
    for struct in interface.all(Struct):
        members = {
            m.name: dict(zip(("offset", "size"), places[struct.name, m.name], strict=True))
            | {"declaration": member_text(m)}
            for m in struct.members
        }
        structs[struct.name] = {"size": places[struct.name, "-"][1], "members": members}
    return {
        "interface": interface.constant_values()["ULNA_INTERFACE"],
        "constants": interface.constant_values(),
        "types": {a.name: a.type.base for a in interface.all(Alias)}
        | {h.name: "handle" for h in interface.all(Handle)},
        "structs": structs,
        "functions": {f.name: f.signature() for f in interface.all(Function)},
    }


def exported(library: Path) -> set[str]:
    command = ["nm", "-D", "--defined-only", str(library)]
    lines = subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()
    # Kind A is the version of the symbols, not a symbol.
    return {line.split()[-1].split("@")[0] for line in lines if line.split()[-2] != "A"}


def differences(old: dict, new: dict) -> tuple[list[str], list[str]]:
    """(what breaks programs that are built, what is new)."""
    broken, added = [], []
    for group in ("constants", "types", "functions"):
        for name, value in old[group].items():
            if name not in new[group]:
                broken.append(f"{name} is gone")
            elif new[group][name] != value:
                broken.append(f"{name} was `{value}` and is now `{new[group][name]}`")
        added += [name for name in new[group] if name not in old[group]]
    for name, struct in old["structs"].items():
        if name not in new["structs"]:
            broken.append(f"{name} is gone")
            continue
        now = new["structs"][name]
        for member, place in struct["members"].items():
            if member not in now["members"]:
                broken.append(f"{name}.{member} is gone")
            elif now["members"][member] != place:
                broken.append(f"{name}.{member} was {place} and is now {now['members'][member]}")
        appended = [member for member in now["members"] if member not in struct["members"]]
        if appended and "struct_size" not in struct["members"]:
            broken.append(f"{name} grew by {', '.join(appended)} but has no struct_size")
        elif now["size"] < struct["size"] or (not appended and now["size"] != struct["size"]):
            broken.append(f"{name} had {struct['size']} bytes and now has {now['size']}")
        added += [f"{name}.{member}" for member in appended]
    added += [name for name in new["structs"] if name not in old["structs"]]
    return broken, added


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--headers", type=Path, default=ROOT / "capi" / "include" / "ulna")
    parser.add_argument("--record", type=Path, help="default: capi/abi/ulna-<number>.json")
    parser.add_argument("--library", type=Path, help="a built libulna.so")
    parser.add_argument("--update", action="store_true", help="write the record")
    options = parser.parse_args(arguments)
    try:
        interface = read_interface(options.headers)
    except HeaderError as error:
        print(error, file=sys.stderr)
        return 1
    now = describe(interface, options.headers)
    record = options.record or ROOT / "capi" / "abi" / f"ulna-{now['interface']}.json"

    problems = []
    if options.library:
        names = exported(options.library)
        problems += [f"{n} is declared but not exported" for n in sorted(set(now["functions"]) - names)]
        problems += [f"{n} is exported but not declared" for n in sorted(names - set(now["functions"]))]
    if options.update:
        record.parent.mkdir(parents=True, exist_ok=True)
        record.write_text(json.dumps(now, indent=1) + "\n", encoding="utf-8")
        print(f"wrote {record}")
    elif not record.exists():
        problems.append(f"{record} is not there: run abicheck.py --update")
    else:
        broken, added = differences(json.loads(record.read_text(encoding="utf-8")), now)
        problems += broken
        if added:
            print(f"new, run `abicheck.py --update` to record: {', '.join(added)}")
    for problem in problems:
        print(problem, file=sys.stderr)
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
