#!/usr/bin/env python3
"""Makes everything that follows from the C headers: nothing here is written twice by hand.

    apigen.py --headers capi/include/ulna --map ulna.map --layout layout.c --cdef abi.h
    apigen.py --headers capi/include/ulna --cffi _abi.c        (needs cffi)
    apigen.py --headers capi/include/ulna --docs docs/reference
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from cheader import Alias, Constant, Function, Handle, HeaderError, Interface, Struct, layout
from cheader import read_interface


def member_text(member) -> str:
    return member.type.declare(member.name) + "".join(f"[{d}]" for d in member.dimensions)


def cdef(interface: Interface) -> str:
    """The declarations as cffi reads them: no comments, no macros."""
    constants = interface.constant_values()
    lines = []
    for header in interface.headers:
        for item in header.items:
            match item:
                case Constant(value=value) if isinstance(constants[item.name], int):
                    lines.append(f"#define {item.name} {value}")
                case Constant():
                    lines.append(f"static const double {item.name};")
                case Alias():
                    lines.append(f"typedef {item.type.declare(item.name)};")
                case Handle():
                    lines.append(f"typedef struct {item.name} {item.name};")
                case Struct():
                    inside = "".join(f"  {member_text(m)};\n" for m in item.members)
                    lines.append(f"typedef struct {item.name} {{\n{inside}}} {item.name};")
                case Function():
                    lines.append(f"{item.signature()};")
    return "\n".join(lines) + "\n"


def includes(interface: Interface) -> str:
    return "".join(f"#include <ulna/{header.name}>\n" for header in interface.headers)


def export_map(interface: Interface) -> str:
    """Linker version script: the declared functions and nothing else."""
    number = interface.constant_values()["ULNA_INTERFACE"]
    names = "".join(f"    {f.name};\n" for f in interface.all(Function))
    return f"ULNA_{number} {{\n  global:\n{names}  local:\n    *;\n}};\n"


def layout_source(interface: Interface) -> str:
    """A C and C++ file with two tables: what the compiler says and what the headers' text says."""
    structs = interface.all(Struct)
    members = [(s, m) for s in structs for m in s.members]
    actual, expected = [], []
    for struct in structs:
        size, rows = layout(struct, interface)
        actual.append(f'  {{"{struct.name}", "", 0, (int64_t)sizeof({struct.name})}},\n')
        expected.append(f'  {{"{struct.name}", "", 0, {size}}},\n')
        for name, offset, width in rows:
            actual.append(
                f'  {{"{struct.name}", "{name}", (int64_t)offsetof({struct.name}, {name}),\n'
                f"   (int64_t)sizeof((({struct.name} *)0)->{name})}},\n"
            )
            expected.append(f'  {{"{struct.name}", "{name}", {offset}, {width}}},\n')
    constants = interface.constant_values()
    used = "".join(f'  {{"{name}", (double)({name})}},\n' for name in constants)
    written = "".join(f'  {{"{name}", {float(value)!r}}},\n' for name, value in constants.items())
    return f"""/* Made by capi/tools/apigen.py. */
#include <stddef.h>

{includes(interface)}#include "layout.h"

const ulna_layout_row ulna_layout_actual[] = {{
{"".join(actual)}}};
const ulna_layout_row ulna_layout_expected[] = {{
{"".join(expected)}}};
const int ulna_layout_rows = {len(members) + len(structs)};

const ulna_constant_row ulna_constants_actual[] = {{
{used}}};
const ulna_constant_row ulna_constants_expected[] = {{
{written}}};
const int ulna_constant_rows = {len(constants)};
"""


def cffi_source(interface: Interface, module: str, path: Path) -> None:
    import cffi

    builder = cffi.FFI()
    builder.cdef(cdef(interface))
    builder.set_source(module, includes(interface))
    builder.emit_c_code(str(path))


def reference_page(header) -> str:
    """One Markdown page a header, in the order of the header."""
    lines = [f"# `<ulna/{header.name}>`", "", header.intro, ""]
    for item in header.items:
        lines += [f"## {item.name}", "", "```c"]
        match item:
            case Constant():
                lines.append(f"#define {item.name} ({item.value})")
            case Alias():
                lines.append(f"typedef {item.type.declare(item.name)};")
            case Handle():
                lines.append(f"typedef struct {item.name} {item.name};")
            case Struct():
                lines.append(f"typedef struct {item.name} {{")
                lines += [f"  {member_text(m)};" for m in item.members]
                lines.append(f"}} {item.name};")
            case Function():
                lines.append(f"{item.signature()};")
        lines += ["```", "", item.comment.text, ""]
        if isinstance(item, Struct):
            lines += ["| member | meaning |", "|---|---|"]
            for m in item.members:
                meaning = " ".join(m.comment.split()).replace("|", "\\|")
                lines.append(f"| `{m.name}` | {meaning} |")
            lines.append("")
        facts = []
        if "thread" in item.comment.tags:
            facts.append(f"Threads: {item.comment.tags['thread']}.")
        if "realtime" in item.comment.tags:
            facts.append("Fit for real-time loops.")
        facts.append(f"Since {item.comment.tags['since']}.")
        lines += [" ".join(facts), ""]
    return "\n".join(lines).rstrip() + "\n"


def write_docs(interface: Interface, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    rows = ["# Reference of the C interface", ""]
    for header in interface.headers:
        page = header.name.removesuffix(".h") + ".md"
        (folder / page).write_text(reference_page(header), encoding="utf-8")
        first = " ".join(header.intro.split("\n\n")[0].split())
        rows.append(f"* [`<ulna/{header.name}>`]({page}): {first}")
    (folder / "README.md").write_text("\n".join(rows) + "\n", encoding="utf-8")


def write_text(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--headers", type=Path, required=True, help="folder of the headers")
    parser.add_argument("--experimental", action="store_true", help="include experimental.h")
    parser.add_argument("--cdef", type=Path, help="declarations for cffi")
    parser.add_argument("--cffi", type=Path, help="C source of the extension module")
    parser.add_argument("--module", default="ulna._abi", help="name of the extension module")
    parser.add_argument("--map", type=Path, help="linker version script")
    parser.add_argument("--layout", type=Path, help="C source of the layout test")
    parser.add_argument("--docs", type=Path, help="folder of the reference pages")
    options = parser.parse_args(arguments)
    try:
        interface = read_interface(options.headers, options.experimental)
    except HeaderError as error:
        print(f"{options.headers}/{error}", file=sys.stderr)
        return 1
    if options.cdef:
        write_text(options.cdef, cdef(interface))
    if options.map:
        write_text(options.map, export_map(interface))
    if options.layout:
        write_text(options.layout, layout_source(interface))
    if options.cffi:
        options.cffi.parent.mkdir(parents=True, exist_ok=True)
        cffi_source(interface, options.module, options.cffi)
    if options.docs:
        write_docs(interface, options.docs)
    return 0


if __name__ == "__main__":
    sys.exit(main())
