"""Reads the C headers of ulna into plain data.

The headers keep to a small grammar, so that everything else (bindings, export map, layout test,
reference pages, record of the interface) is made from them and cannot drift. A declaration outside
of the grammar is refused with its place: this is where rule 8 of the interface is enforced.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

SCALARS = {"int32_t": 4, "int64_t": 8, "uint32_t": 4, "double": 8, "char": 1}
POINTER_BYTES = 8


class HeaderError(Exception):
    """A declaration that the grammar does not have; the message starts with header:line."""


@dataclass(frozen=True)
class Comment:
    text: str
    tags: dict[str, str]


@dataclass(frozen=True)
class Type:
    """A scalar, an alias of one, a struct or a handle behind `stars` pointers."""

    base: str
    stars: int = 0
    const_base: bool = False
    const_inner: bool = False  # const char *const *

    def c(self) -> str:
        text = ("const " if self.const_base else "") + self.base
        if self.stars:
            text += " *" + ("const *" if self.const_inner else "*" * (self.stars - 1))
        return text

    def declare(self, name: str) -> str:
        text = self.c()
        return text + name if text.endswith("*") else f"{text} {name}"


@dataclass(frozen=True)
class Member:
    name: str
    type: Type
    dimensions: tuple[str, ...]
    comment: str
    line: int


@dataclass(frozen=True)
class Constant:
    name: str
    value: str
    comment: Comment
    line: int


@dataclass(frozen=True)
class Alias:
    name: str
    type: Type
    comment: Comment
    line: int


@dataclass(frozen=True)
class Handle:
    name: str
    comment: Comment
    line: int


@dataclass(frozen=True)
class Struct:
    name: str
    members: tuple[Member, ...]
    comment: Comment
    line: int


@dataclass(frozen=True)
class Parameter:
    name: str
    type: Type


@dataclass(frozen=True)
class Function:
    name: str
    result: Type
    parameters: tuple[Parameter, ...]
    comment: Comment
    line: int

    def signature(self) -> str:
        inside = ", ".join(p.type.declare(p.name) for p in self.parameters) or "void"
        return self.result.declare(f"{self.name}({inside})")


@dataclass
class Header:
    name: str  # "base.h"
    intro: str
    includes: list[str] = field(default_factory=list)
    items: list = field(default_factory=list)


@dataclass
class Interface:
    headers: list[Header]

    def all(self, kind: type) -> list:
        return [item for header in self.headers for item in header.items if isinstance(item, kind)]

    def constant_values(self) -> dict[str, int | float]:
        return {c.name: number(c.value) for c in self.all(Constant)}


def number(text: str) -> int | float:
    return int(text, 0) if re.fullmatch(r"-?(0x[0-9A-Fa-f]+|\d+)", text) else float(text)


_TAG = re.compile(r"@(\w+)[ \t]*((?:[^@\n]|@(?!\w))*)")
_TAGS = {"since", "thread", "realtime"}
_IGNORED_DIRECTIVES = re.compile(
    r"#\s*(ifndef ULNA_\w+_H|define ULNA_\w+_H|ifdef __cplusplus|endif|else|if defined\(_WIN32\)"
    r"|define ULNA_API [^\n]+)\s*$"
)
_INCLUDE = re.compile(r"#\s*include <(ulna/(\w+\.h)|stdint\.h)>\s*$")
_CONSTANT = re.compile(
    r"#\s*define (\w+) \((-?(?:0x[0-9A-Fa-f]+|\d+|\d+\.\d*(?:[eE][-+]?\d+)?|\d+[eE][-+]?\d+))\)\s*$"
)
_FORBIDDEN = {
    "bool": "use int32_t", "_Bool": "use int32_t", "long": "use int64_t", "int": "use int32_t",
    "short": "use int32_t", "unsigned": "use uint32_t", "signed": "use int32_t",
    "float": "use double", "enum": "use int32_t and #define constants", "union": "use a struct",
    "size_t": "use int64_t", "uint64_t": "use int64_t", "int8_t": "use int32_t",
    "uint8_t": "use int32_t", "...": "give every argument", "volatile": "use a token",
    "static": "the header holds declarations only", "inline": "the header holds declarations only",
}


class _Parser:
    def __init__(self, path: Path, known: Interface):
        self.path = path
        self.source = path.read_text(encoding="utf-8")
        self.position = 0
        self.header = Header(path.name, "")
        self.pending: tuple[Comment, int] | None = None
        self.in_extern = False
        # Names that earlier headers declared, by kind; declared names of this header are added.
        self.aliases = {a.name: a.type for a in known.all(Alias)}
        self.structs = {s.name for s in known.all(Struct)}
        self.handles = {h.name for h in known.all(Handle)}
        self.constants = {c.name for c in known.all(Constant)}
        self.functions = {f.name for f in known.all(Function)}

    # Places and errors ---------------------------------------------------------------------------

    def line(self, position: int | None = None) -> int:
        return self.source.count("\n", 0, self.position if position is None else position) + 1

    def fail(self, message: str, line: int | None = None) -> HeaderError:
        return HeaderError(f"{self.path.name}:{line or self.line()}: {message}")

    # Pieces of the file --------------------------------------------------------------------------

    def parse(self) -> Header:
        while self.skip_space():
            if self.source.startswith("/*", self.position):
                self.read_comment()
            elif self.source[self.position] == "#":
                self.read_directive()
            elif self.source.startswith('extern "C" {', self.position):
                self.in_extern = True
                self.position += len('extern "C" {')
            elif self.source[self.position] == "}" and self.in_extern:
                self.in_extern = False
                self.position += 1
            else:
                self.read_declaration()
        if self.pending is not None:
            raise self.fail("a /** */ comment that no declaration follows", self.pending[1])
        return self.header

    def skip_space(self) -> bool:
        while self.position < len(self.source) and self.source[self.position].isspace():
            self.position += 1
        return self.position < len(self.source)

    def read_comment(self) -> None:
        start = self.position
        end = self.source.find("*/", start)
        if end < 0:
            raise self.fail("a comment that does not end")
        body = self.source[start:end]
        self.position = end + 2
        if not body.startswith("/**"):
            if not self.header.items and not self.header.intro:
                self.header.intro = _unwrap(body[2:])
            return
        if self.pending is not None:
            raise self.fail("a /** */ comment that no declaration follows", self.pending[1])
        text = _unwrap(body[3:])
        tags = {match[1]: match[2].strip() for match in _TAG.finditer(text)}
        unknown = set(tags) - _TAGS
        if unknown:
            raise self.fail(f"unknown tag @{min(unknown)}", self.line(start))
        text = _TAG.sub("", text).strip()
        if not text:
            raise self.fail("a comment without a sentence", self.line(start))
        if not re.fullmatch(r"\d+\.\d+", tags.get("since", "")):
            raise self.fail("the comment has no `@since <major>.<minor>`", self.line(start))
        self.pending = Comment(text, tags), self.line(start)

    def take_comment(self, what: str, line: int) -> Comment:
        if self.pending is None:
            raise self.fail(f"{what} has no /** */ comment before it", line)
        comment, self.pending = self.pending[0], None
        return comment

    def read_directive(self) -> None:
        line = self.line()
        end = self.source.find("\n", self.position)
        text = self.source[self.position : end if end >= 0 else len(self.source)]
        if text.rstrip().endswith("\\"):
            raise self.fail("a directive over several lines", line)
        self.position += len(text)
        if _IGNORED_DIRECTIVES.match(text):
            return
        if match := _INCLUDE.match(text):
            if match[2]:
                self.header.includes.append(match[2])
            return
        match = _CONSTANT.match(text)
        if match is None:
            raise self.fail(
                "a directive that is neither an include of stdint.h or ulna/, an include guard nor "
                f"`#define ULNA_GROUP_NAME (number)`: {text.strip()}",
                line,
            )
        name, value = match[1], match[2]
        if not re.fullmatch(r"ULNA_[A-Z][A-Z0-9_]*", name):
            raise self.fail(f"the constant {name} is not named ULNA_GROUP_NAME", line)
        if name in self.constants:
            raise self.fail(f"the constant {name} is defined twice", line)
        self.constants.add(name)
        self.header.items.append(Constant(name, value, self.take_comment(name, line), line))

    def read_declaration(self) -> None:
        start, line = self.position, self.line()
        struct = re.compile(r"typedef struct (\w+) \{").match(self.source, start)
        if struct:
            self.read_struct(struct, line)
            return
        end = self.source.find(";", start)
        if end < 0:
            raise self.fail(f"a declaration that does not end: {self.source[start:start + 60]!r}", line)
        raw = self.source[start:end]
        self.position = end + 1
        if "/*" in raw:
            raise self.fail("a comment inside of a declaration: put it into the one before", line)
        text = " ".join(raw.split())
        self.refuse_forbidden(text, line)
        if match := re.fullmatch(r"typedef struct (\w+) (\w+)", text):
            self.add_handle(match[1], match[2], line)
        elif match := re.fullmatch(r"typedef (\w+) (\w+)", text):
            self.add_alias(match[1], match[2], line)
        elif match := re.fullmatch(r"ULNA_API (.+?)\b(\w+)\((.*)\)", text):
            self.add_function(match[1].strip(), match[2], match[3].strip(), line)
        else:
            raise self.fail(f"not in the grammar of these headers: {text}", line)

    # Declarations --------------------------------------------------------------------------------

    def refuse_forbidden(self, text: str, line: int) -> None:
        for word in re.findall(r"\.\.\.|\w+", text):
            if word in _FORBIDDEN:
                raise self.fail(f"`{word}` is not allowed in the interface: {_FORBIDDEN[word]}", line)
        if "(*" in text.replace(" ", ""):
            raise self.fail("function pointers are not allowed in the interface: use a token", line)

    def new_type_name(self, name: str, line: int) -> None:
        if not re.fullmatch(r"ulna_[a-z][a-z0-9_]*", name):
            raise self.fail(f"the type {name} is not named ulna_<noun>", line)
        if name in self.aliases or name in self.structs or name in self.handles:
            raise self.fail(f"the type {name} is declared twice", line)

    def add_handle(self, tag: str, name: str, line: int) -> None:
        self.new_type_name(name, line)
        if tag != name:
            raise self.fail(f"struct {tag} and its type {name} have different names", line)
        self.handles.add(name)
        self.header.items.append(Handle(name, self.take_comment(name, line), line))

    def add_alias(self, base: str, name: str, line: int) -> None:
        self.new_type_name(name, line)
        if base not in SCALARS:
            raise self.fail(f"an alias stands for one of {', '.join(SCALARS)}, not {base}", line)
        self.aliases[name] = Type(base)
        self.header.items.append(Alias(name, Type(base), self.take_comment(name, line), line))

    def read_struct(self, match: re.Match, line: int) -> None:
        name = match[1]
        self.new_type_name(name, line)
        closing = re.compile(r"^\} (\w+);", re.MULTILINE).search(self.source, match.end())
        if closing is None:
            raise self.fail(f"struct {name} does not end with `}} {name};` at the start of a line", line)
        if closing[1] != name:
            raise self.fail(f"struct {name} and its type {closing[1]} have different names", line)
        members = self.read_members(match.end(), closing.start())
        if not members:
            raise self.fail(f"struct {name} has no members", line)
        if name.endswith("_options") and (members[0].name, members[0].type) != (
            "struct_size", Type("int64_t"),
        ):
            raise self.fail(f"{name} does not start with `int64_t struct_size`", line)
        self.position = closing.end()
        self.structs.add(name)
        struct = Struct(name, tuple(members), self.take_comment(name, line), line)
        self.header.items.append(struct)

    def read_members(self, start: int, end: int) -> list[Member]:
        members: list[Member] = []
        pattern = re.compile(r"\s*([^;{}/]+);[ \t]*/\*(.*?)\*/", re.DOTALL)
        position = start
        while self.source[position:end].strip():
            match = pattern.match(self.source, position, end)
            if match is None:
                at = position + len(self.source[position:end]) - len(self.source[position:end].lstrip())
                rest = self.source[at:end].split("\n")[0]
                raise self.fail(f"not `type name; /* unit, shape, meaning */`: {rest}", self.line(at))
            line = self.line(match.start(1))
            text = " ".join(match[1].split())
            self.refuse_forbidden(text, line)
            if ":" in text:
                raise self.fail(f"bit-fields are not allowed in the interface: {text}", line)
            member = re.fullmatch(r"(.+?)\b(\w+)((?:\[\w+\])*)", text)
            if member is None:
                raise self.fail(f"not one member `type name`: {text}", line)
            kind = self.parse_type(member[1].strip(), line)
            if kind.stars == 0 and kind.base in self.structs | self.handles:
                raise self.fail(f"{kind.base} by value in a struct: use a pointer or its members", line)
            dimensions = tuple(re.findall(r"\[(\w+)\]", member[3]))
            for size in dimensions:
                if not size.isdigit() and size not in self.constants:
                    raise self.fail(f"the array size {size} is not a number or a constant", line)
            if any(member[2] == other.name for other in members):
                raise self.fail(f"the member {member[2]} is there twice", line)
            members.append(Member(member[2], kind, dimensions, _unwrap(match[2]), line))
            position = match.end()
        return members

    def parse_type(self, text: str, line: int) -> Type:
        match = re.fullmatch(r"(const )?(\w+) ?(\*(?: ?const)? ?\*|\*)?", text)
        if match is None:
            raise self.fail(f"the type `{text}` is not in the grammar of these headers", line)
        base, stars = match[2], (match[3] or "").count("*")
        if base == "void":
            if stars:
                raise self.fail("`void *` is not allowed in the interface: use a typed pointer", line)
            return Type("void")
        known = base in SCALARS or base in self.aliases or base in self.structs | self.handles
        if not known:
            raise self.fail(f"the type {base} is not declared before this line", line)
        return Type(base, stars, bool(match[1]), "const" in (match[3] or ""))

    def add_function(self, result: str, name: str, inside: str, line: int) -> None:
        if not re.fullmatch(r"ulna_[a-z][a-z0-9_]*", name):
            raise self.fail(f"the function {name} is not named ulna_<noun>_<verb>", line)
        if name in self.functions:
            raise self.fail(f"the function {name} is declared twice", line)
        kind = self.parse_type(result, line)
        if kind.stars == 0 and kind.base in self.structs | self.handles:
            raise self.fail(f"{name} returns {kind.base} by value", line)
        if not inside:
            raise self.fail(f"{name}() has no prototype in C: write {name}(void)", line)
        parameters: list[Parameter] = []
        for part in [] if inside == "void" else inside.split(","):
            match = re.fullmatch(r"(.+?)\b(\w+)", part.strip())
            if match is None or match[2] in SCALARS:
                raise self.fail(f"{name}: an argument is not `type name`: {part.strip()}", line)
            parameter = Parameter(match[2], self.parse_type(match[1].strip(), line))
            if parameter.type.stars == 0 and (
                parameter.type.base in self.structs | self.handles or parameter.type.base == "void"
            ):
                raise self.fail(f"{name}: {parameter.type.base} {parameter.name} is by value", line)
            if any(parameter.name == other.name for other in parameters):
                raise self.fail(f"{name}: the argument {parameter.name} is there twice", line)
            parameters.append(parameter)
        comment = self.take_comment(name, line)
        self.check_thread_tag(name, comment, {p.name for p in parameters}, line)
        self.functions.add(name)
        self.header.items.append(Function(name, kind, tuple(parameters), comment, line))

    def check_thread_tag(self, name: str, comment: Comment, arguments: set[str], line: int) -> None:
        tag = comment.tags.get("thread")
        if tag is None:
            raise self.fail(f"the comment of {name} has no `@thread any | shared h | exclusive h`", line)
        for part in tag.split(","):
            words = part.split()
            named = len(words) == 2 and words[0] in ("shared", "exclusive") and words[1] in arguments
            if words != ["any"] and not named:
                raise self.fail(
                    f"{name}: `@thread {tag}` is not `any`, `shared h` or `exclusive h` with an argument h",
                    line,
                )


def _unwrap(comment: str) -> str:
    lines = [re.sub(r"^\s*\*? ?", "", line).rstrip() for line in comment.split("\n")]
    return "\n".join(lines).strip()


def layout(struct: Struct, interface: Interface) -> tuple[int, list[tuple[str, int, int]]]:
    """Size of a struct and (member, offset, size) on a platform of natural alignment, 8-byte pointers."""
    aliases = {a.name: a.type for a in interface.all(Alias)}
    constants = interface.constant_values()
    offset, widest, rows = 0, 1, []
    for member in struct.members:
        base = aliases.get(member.type.base, member.type).base
        one = POINTER_BYTES if member.type.stars else SCALARS[base]
        size = one
        for dimension in member.dimensions:
            size *= int(dimension) if dimension.isdigit() else int(constants[dimension])
        offset = -(-offset // one) * one
        rows.append((member.name, offset, size))
        offset += size
        widest = max(widest, one)
    return -(-offset // widest) * widest, rows


def _check_padding(struct: Struct, interface: Interface, header: str) -> None:
    # A hidden hole would let a later member appear without struct_size changing.
    size, rows = layout(struct, interface)
    end = 0
    for member, (name, offset, width) in zip(struct.members, rows, strict=True):
        if offset != end:
            raise HeaderError(
                f"{header}:{member.line}: {offset - end} bytes of padding before {struct.name}.{name}: "
                "change the order or add a member `int32_t reserved`"
            )
        end = offset + width
    if end != size:
        raise HeaderError(
            f"{header}:{struct.line}: {size - end} bytes of padding at the end of {struct.name}: "
            "change the order or add a member `int32_t reserved`"
        )


def read_interface(folder: Path, experimental: bool = False) -> Interface:
    """All headers of a folder, each after those that it includes; ulna.h holds only includes."""
    paths = {p.name: p for p in sorted(folder.glob("*.h"))}
    if not experimental:
        paths.pop("experimental.h", None)
    umbrella = paths.pop("ulna.h", None)
    interface = Interface([])
    state: dict[str, str] = {}

    def visit(name: str) -> None:
        state[name] = "open"
        source = paths[name].read_text(encoding="utf-8")
        for included in re.findall(r"^#\s*include <ulna/(\w+\.h)>", source, re.MULTILINE):
            if included not in paths:
                raise HeaderError(f"{name}: includes <ulna/{included}>, which is not there")
            if state.get(included) == "open":
                raise HeaderError(f"{name}: includes <ulna/{included}>, which includes it")
            if included not in state:
                visit(included)
        header = _Parser(paths[name], interface).parse()
        interface.headers.append(header)
        for item in header.items:
            if isinstance(item, Struct):
                _check_padding(item, interface, name)
        state[name] = "done"

    for name in paths:
        if name not in state:
            visit(name)
    if umbrella is not None:
        listed = set(re.findall(r"#include <ulna/(\w+\.h)>", umbrella.read_text(encoding="utf-8")))
        missing = set(paths) - listed - {"experimental.h"}
        if missing:
            raise HeaderError(f"ulna.h: does not include <ulna/{min(missing)}>")
    return interface
