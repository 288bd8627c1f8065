"""Makes a C file that calls every function of the interface with NULL and with bad arguments.

    make_calls.py <folder of cheader.py> <folder of the headers> <file to write>

In a bad call the outputs are real memory filled with a pattern, so that the test sees whether a
failing call left them alone; handles are NULL; numbers, text, views and options come from the test.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, sys.argv[1])

from apigen import includes  # noqa: E402
from cheader import Alias, Function, Handle, Struct, read_interface  # noqa: E402

interface = read_interface(Path(sys.argv[2]))
structs = {s.name for s in interface.all(Struct)}
handles = {h.name for h in interface.all(Handle)}
aliases = {a.name: a.type.base for a in interface.all(Alias)}


class Argument:
    """What one argument of a bad call needs before it, and how it is written in the call."""

    def __init__(self, parameter, name: str) -> None:
        kind = parameter.type
        self.before, self.output, self.made = "", "", ""
        if kind.stars == 0:
            real = aliases.get(kind.base, kind.base) == "double"
            self.value = "bad->real" if real else "bad->number"
        elif kind.stars == 1 and kind.base == "ulna_view":
            self.value = "&bad->view"
        elif kind.stars == 1 and kind.base == "char" and kind.const_base:
            self.value = "bad->text"
        elif kind.stars == 1 and kind.base in handles:
            self.value = "NULL"
        elif kind.stars == 1 and kind.base in structs:
            self.before = (
                f"  {kind.base} {name}[64];\n"
                f"  ulna_fill({name}, sizeof {name}[0], 64, bad);\n"
            )
            self.value = name
            self.output = "" if kind.const_base else name
        elif kind.const_base and kind.stars == 1:
            self.value = "NULL"
        elif kind.const_inner:
            self.before = f"  const {kind.base} *const {name}[64] = {{NULL}};\n"
            self.value = name
        else:  # scalars, arrays, text and handles out
            pointer = " *" if kind.stars == 2 else " "
            constant = "const " if kind.const_base else ""
            self.before = (
                f"  {constant}{kind.base}{pointer}{name}[64];\n"
                f"  memset((void *){name}, 0x5a, sizeof {name});\n"
            )
            self.value, self.output = name, name
            self.made = kind.base if kind.stars == 2 and kind.base in handles else ""


def call(function: Function, values: str) -> str:
    text = f"{function.name}({values})"
    if function.result.base == "ulna_status":
        return f"const ulna_status status = {text};"
    return f"const ulna_status status = ULNA_OK;\n  (void){text};"


def pair(function: Function) -> str:
    nulls = ", ".join("NULL" if p.type.stars else "0" for p in function.parameters)
    arguments = [Argument(p, f"a{i}") for i, p in enumerate(function.parameters)]
    outputs = [a.output for a in arguments if a.output]
    before = "".join(a.before for a in arguments)
    before += "".join(
        f"  char {o}_before[sizeof {o}];\n  memcpy({o}_before, (const void *)&{o}, sizeof {o});\n"
        for o in outputs
    )
    same = " && ".join(f"memcmp({o}_before, (const void *)&{o}, sizeof {o}) == 0" for o in outputs)
    release = "".join(
        f"  if (status == ULNA_OK && !*out_same) {a.made}_free({a.output}[0]);\n"
        for a in arguments
        if a.made
    )
    return (
        f"static ulna_status null_{function.name}(void) {{\n"
        f"  {call(function, nulls)}\n  return status;\n}}\n"
        f"static ulna_status bad_{function.name}(const ulna_bad_arguments *bad, int *out_same) {{\n"
        f"  (void)bad;\n{before}  {call(function, ', '.join(a.value for a in arguments))}\n"
        f"  *out_same = {same or '1'};\n{release}  return status;\n}}\n\n"
    )


functions = interface.all(Function)
rows = "".join(
    f'  {{"{f.name}", {int(f.result.base == "ulna_status")}, null_{f.name}, bad_{f.name}}},\n'
    for f in functions
)
Path(sys.argv[3]).write_text(
    "/* Made by tests/abi/make_calls.py. */\n#include <string.h>\n\n"
    + includes(interface)
    + '#include "calls.h"\n\n'
    + "".join(pair(f) for f in functions)
    + f"const ulna_call_row ulna_calls[] = {{\n{rows}}};\n"
    + f"const int ulna_call_rows = {len(functions)};\n",
    encoding="utf-8",
)
