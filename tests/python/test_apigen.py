"""The parser of the headers refuses what rule 8 of the interface forbids, and says where."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
HEADERS = ROOT / "capi" / "include" / "ulna"
sys.path.insert(0, str(ROOT / "capi" / "tools"))

import abicheck  # noqa: E402
import apigen  # noqa: E402
from cheader import Constant, Function, HeaderError, Struct, layout, read_interface  # noqa: E402

DOC = "/** Does it.\n * @thread any\n * @since 0.1 */\n"
TYPES = (
    "/** A handle. @since 0.1 */\ntypedef struct ulna_thing ulna_thing;\n"
    "/** A pair. @since 0.1 */\n"
    "typedef struct ulna_pair {\n  double a; /* N */\n  double b; /* N */\n} ulna_pair;\n"
)


def parse(tmp_path, text):
    (tmp_path / "x.h").write_text(text)
    return read_interface(tmp_path)


def test_the_headers_of_ulna_keep_to_the_grammar():
    interface = read_interface(HEADERS)
    functions = interface.all(Function)
    assert functions and interface.all(Struct) and interface.all(Constant)
    for function in functions:
        assert function.comment.text, function.name
        assert function.comment.tags["since"] and function.comment.tags["thread"]
    for header in interface.headers:
        assert header.intro, f"{header.name} does not say what it is for"


def test_a_declaration_is_read_whole(tmp_path):
    text = TYPES + (
        "/** Limit of it. @since 0.2 */\n#define ULNA_THING_LIMIT (0x10)\n"
        "/** Names, as one sentence.\n * @thread shared thing, exclusive token\n * @realtime\n"
        " * @since 0.3 */\n"
        "ULNA_API int32_t ulna_thing_count(const ulna_thing *thing,\n"
        "    const char *const *names, ulna_thing **token);\n"
    )
    interface = parse(tmp_path, text)
    (function,) = interface.all(Function)
    assert function.signature() == (
        "int32_t ulna_thing_count(const ulna_thing *thing, const char *const *names, "
        "ulna_thing **token)"
    )
    assert function.comment.text == "Names, as one sentence."
    assert function.comment.tags == {
        "thread": "shared thing, exclusive token", "realtime": "", "since": "0.3",
    }  # fmt: skip
    assert interface.constant_values() == {"ULNA_THING_LIMIT": 16}
    assert layout(interface.all(Struct)[0], interface) == (16, [("a", 0, 8), ("b", 8, 8)])


REFUSED = {
    "bool": (DOC + "ULNA_API bool ulna_a_b(void);", 4, "`bool`"),
    "long": (DOC + "ULNA_API int32_t ulna_a_b(long x);", 4, "`long`"),
    "int": (DOC + "ULNA_API int ulna_a_b(void);", 4, "`int`"),
    "float": (DOC + "ULNA_API int32_t ulna_a_b(float x);", 4, "`float`"),
    "enum": ("/** E. @since 0.1 */\ntypedef enum ulna_e ulna_e;", 2, "`enum`"),
    "variadic": (DOC + "ULNA_API int32_t ulna_a_b(int32_t x, ...);", 4, "`...`"),
    "callback": (DOC + "ULNA_API int32_t ulna_a_b(void (*f)(void));", 4, "function pointers"),
    "void pointer": (DOC + "ULNA_API int32_t ulna_a_b(void *p);", 4, "`void *`"),
    "struct by value": (TYPES + DOC + "ULNA_API int32_t ulna_a_b(ulna_pair p);", 11, "by value"),
    "struct result": (TYPES + DOC + "ULNA_API ulna_pair ulna_a_b(void);", 11, "by value"),
    "struct member": (
        TYPES + "/** N. @since 0.1 */\ntypedef struct ulna_n {\n  ulna_pair p; /* N */\n} ulna_n;",
        10, "by value",
    ),
    "bit-field": (
        "/** N. @since 0.1 */\ntypedef struct ulna_n {\n  int32_t p : 3; /* flag */\n} ulna_n;",
        3, "bit-fields",
    ),
    "member without comment": (
        "/** N. @since 0.1 */\ntypedef struct ulna_n {\n  double p;\n  double q; /* N */\n} ulna_n;",
        3, "not `type name; /*",
    ),
    "hidden padding": (
        "/** N. @since 0.1 */\ntypedef struct ulna_n {\n  int32_t p; /* 1 */\n  double q; /* N */\n"
        "} ulna_n;", 4, "4 bytes of padding before",
    ),
    "padding at the end": (
        "/** N. @since 0.1 */\ntypedef struct ulna_n {\n  double q; /* N */\n  int32_t p; /* 1 */\n"
        "} ulna_n;", 2, "padding at the end",
    ),
    "options without size": (
        "/** N. @since 0.1 */\ntypedef struct ulna_n_options {\n  double q; /* N */\n"
        "} ulna_n_options;", 2, "struct_size",
    ),
    "no prototype": (DOC + "ULNA_API int32_t ulna_a_b();", 4, "no prototype"),
    "nameless argument": (DOC + "ULNA_API int32_t ulna_a_b(double);", 4, "not `type name`"),
    "unknown type": (DOC + "ULNA_API int32_t ulna_a_b(ulna_what *x);", 4, "not declared before"),
    "no comment": ("ULNA_API int32_t ulna_a_b(void);", 1, "no /** */ comment"),
    "no since": ("/** It. @thread any */\nULNA_API int32_t ulna_a_b(void);", 1, "@since"),
    "no thread": ("/** It. @since 0.1 */\nULNA_API int32_t ulna_a_b(void);", 2, "@thread"),
    "thread of nobody": (
        "/** It. @since 0.1 @thread shared x */\nULNA_API int32_t ulna_a_b(void);", 2, "@thread",
    ),
    "unknown tag": ("/** It. @since 0.1 @return x */\n#define ULNA_A (1)", 1, "@return"),
    "lonely comment": ("/** It. @since 0.1 */\n", 1, "no declaration follows"),
    "wrong name": (DOC + "ULNA_API int32_t other_a(void);", 4, "not named"),
    "expression": ("/** It. @since 0.1 */\n#define ULNA_A (1 << 2)", 2, "directive"),
    "foreign include": ("#include <stdio.h>\n", 1, "directive"),
    "twice": (
        DOC + "ULNA_API int32_t ulna_a_b(void);\n" + DOC + "ULNA_API int32_t ulna_a_b(void);",
        8, "twice",
    ),
    "definition": (DOC + "static inline int32_t ulna_a_b(void) { return 1; }", 4, "`static`"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_refuses(tmp_path, name):
    text, line, message = REFUSED[name]
    with pytest.raises(HeaderError) as failure:
        parse(tmp_path, text)
    assert re.match(rf"x\.h:{line}: ", str(failure.value)), failure.value
    assert message in str(failure.value)


def test_reference_has_a_section_for_every_declaration(tmp_path):
    interface = read_interface(HEADERS)
    apigen.write_docs(interface, tmp_path)
    for header in interface.headers:
        page = (tmp_path / header.name.replace(".h", ".md")).read_text()
        for item in header.items:
            assert f"## {item.name}\n" in page
    assert set(p.name for p in tmp_path.iterdir()) == {"README.md"} | {
        h.name.replace(".h", ".md") for h in interface.headers
    }


def test_command_line_says_where(tmp_path):
    (tmp_path / "x.h").write_text("int x;\n")
    run = subprocess.run(
        [sys.executable, ROOT / "capi/tools/apigen.py", "--headers", tmp_path],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert run.returncode == 1
    assert "x.h:1: `int` is not allowed" in run.stderr


# The record of the interface ---------------------------------------------------------------------

SMALL = (
    "/** One. @since 0.1 */\n#define ULNA_INTERFACE (0)\n" + TYPES
    + "/** O. @since 0.1 */\ntypedef struct ulna_o_options {\n  int64_t struct_size; /* bytes */\n"
    "  double gain; /* 1 */\n} ulna_o_options;\n"
    + DOC + "ULNA_API int32_t ulna_thing_count(const ulna_thing *thing);\n"
)  # fmt: skip
INCLUDES = "#include <stdint.h>\n#define ULNA_API extern\n"


def check_after(tmp_path, change):
    """(exit status) of the check when the recorded header becomes change(header)."""
    headers = tmp_path / "ulna"
    headers.mkdir()
    arguments = ["--headers", str(headers), "--record", str(tmp_path / "record.json")]
    (headers / "x.h").write_text(INCLUDES + SMALL)
    assert abicheck.main([*arguments, "--update"]) == 0
    assert abicheck.main(arguments) == 0
    changed = change(SMALL)
    assert changed != SMALL
    (headers / "x.h").write_text(INCLUDES + changed)
    return abicheck.main(arguments)


BREAKS = {
    "constant changed": lambda s: s.replace("(0)", "(0)\n/** T. @since 0.1 */\n#define ULNA_T (1)")
    .replace("ULNA_INTERFACE (0)", "ULNA_INTERFACE (1)"),
    "member gone": lambda s: s.replace("  double b; /* N */\n", ""),
    "member changed": lambda s: s.replace("double gain", "int64_t gain"),
    "plain struct grew": lambda s: s.replace("b; /* N */\n", "b; /* N */\n  double c; /* N */\n"),
    "order": lambda s: s.replace("  double a; /* N */\n  double b;", "  double b; /* N */\n  double a;"),
    "signature": lambda s: s.replace("(const ulna_thing", "(ulna_thing"),
    "function renamed": lambda s: s.replace("thing_count", "thing_number"),
}  # fmt: skip
ALLOWED = {
    "constant": lambda s: s + "/** T. @since 0.2 */\n#define ULNA_T (1)\n",
    "function": lambda s: s + DOC + "ULNA_API int32_t ulna_thing_more(void);\n",
    "option": lambda s: s.replace("gain; /* 1 */\n", "gain; /* 1 */\n  double c; /* N */\n"),
}


@pytest.mark.parametrize("name", BREAKS)
def test_a_change_of_the_interface_fails(tmp_path, name):
    assert check_after(tmp_path, BREAKS[name]) == 1


@pytest.mark.parametrize("name", ALLOWED)
def test_an_addition_is_allowed_and_named(tmp_path, name, capsys):
    assert check_after(tmp_path, ALLOWED[name]) == 0
    assert "--update" in capsys.readouterr().out
