"""What a plan says of a function: its text, and the data that are bound to it.

Equal functions are described by equal words in every process: there are no addresses in them, and
nothing that depends on the order of a set.
"""

from __future__ import annotations

import copyreg
import functools
import hashlib
import inspect
import json
import sys
import types
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

_PLAIN = (type(None), bool, int, float, str)
_NO_SOURCE = (OSError, TypeError, SyntaxError, IndexError)  # there is none to be found


@dataclass(frozen=True)
class Described:
    """A function as a plan has it.

    `source` is a digest of its text and `state` one of what is bound to it, None without any;
    `unknown` names what neither of them holds.
    """

    name: str
    source: str | None
    state: str | None
    unknown: tuple[str, ...] = ()


class Describes:
    """Describes a study's function, which may change what it holds when it is run.

    A counter or a cache that the function fills makes no other function of it. What somebody else
    changed between two runs does.
    """

    def __init__(self) -> None:
        self._function: Callable[..., Any] | None = None
        self._first: Described | None = None
        self._left: Described | None = None

    def now(self, function: Callable[..., Any] | None) -> Described:
        """The function as it was before it was run."""
        function, _ = unfixed(function)
        found = described(function)
        if self._first is None or function is not self._function or found != self._left:
            self._function, self._first, self._left = function, found, found
        return self._first

    def after_runs(self) -> None:
        """Remember how the runs left it."""
        if self._first is not None:
            self._left = described(self._function)


def unfixed(function: Any) -> tuple[Any, dict[str, float] | None]:
    """The function of a study, and what `Study.fix` fixed of its factors."""
    from ._study_two_phase import Fixed

    fixed: dict[str, float] | None = None
    while isinstance(function, Fixed):
        fixed = {**function.fixed, **(fixed or {})}
        function = function.function
    return function, fixed


def described(function: Callable[..., Any] | None) -> Described:
    """A function's text and data."""
    function, _ = unfixed(function)
    named = getattr(function, "__qualname__", type(function).__name__)
    name = getattr(function, "plan_name", named)
    words = getattr(function, "plan_source", None)
    if words is not None or function is None:
        return Described(name, None if words is None else _digest(words), None)
    text = _text(innermost(function))
    source = None if text is None else _digest(text)
    if text is not None and _is_plain(function, text):
        return Described(name, source, None)
    state = _State()
    try:
        words = json.dumps(state.of(function, ""), sort_keys=True)
    except RecursionError:
        return Described(name, source, None, ("what it holds, which is nested too deep",))
    return Described(name, source, _digest(words), tuple(dict.fromkeys(state.unknown)))


def _digest(words: str) -> str:
    return hashlib.sha256(words.encode("utf-8", "surrogatepass")).hexdigest()


def innermost(function: Any) -> Any:
    """The function of partials of it, the class of an object that can be called."""
    while isinstance(function, functools.partial):
        function = function.func
    if inspect.isroutine(function) or isinstance(function, type) or hasattr(function, "__wrapped__"):
        return function
    return type(function)


def _text(value: Any) -> str | None:
    try:
        return inspect.getsource(value)
    except _NO_SOURCE:
        return None


def _is_plain(function: Any, text: str) -> bool:
    """Whether the text says all: nothing is bound, and it is the text of one function."""
    return (
        isinstance(function, types.FunctionType)
        and not function.__defaults__
        and not function.__kwdefaults__
        and not function.__closure__
        and not function.__dict__
        and (function.__name__ != "<lambda>" or text.count("lambda") == 1)
    )


def _is_own(value: Any) -> bool:
    """Whether it is of nobody's package: its name alone does not say what it does."""
    name = str(getattr(value, "__module__", None) or "")
    top = name.partition(".")[0]
    if name == "__main__":
        return True
    if top in sys.stdlib_module_names or top in ("numpy", "ulna"):
        return False
    file = getattr(sys.modules.get(name), "__file__", None)
    return file is None or not {"site-packages", "dist-packages"} & set(Path(file).parts)


def _is_found_by_name(value: Any) -> bool:
    found: Any = sys.modules.get(str(getattr(value, "__module__", None)))
    for part in value.__qualname__.split("."):
        found = getattr(found, part, None)
    return found is value


def _name(value: Any) -> list[Any]:
    return ["name", getattr(value, "__module__", None), value.__qualname__]


class _State:
    """Data in words that JSON can write; what has none is named in `unknown`."""

    def __init__(self) -> None:
        self.unknown: list[str] = []
        self._path: list[Any] = []  # objects that hold the one at hand

    def of(self, value: Any, place: str) -> Any:
        """Words of a value; `place` is the name of what holds it."""
        if type(value) in _PLAIN:
            return value
        for up, holder in enumerate(reversed(self._path)):
            if holder is value:
                return ["again", up]
        self._path.append(value)
        try:
            return self._words(value, place)
        finally:
            self._path.pop()

    def _words(self, value: Any, place: str) -> Any:
        kind = type(value)
        if kind in (bytes, bytearray):
            return [kind.__name__, value.hex()]
        if kind in (tuple, list):
            return [kind.__name__, *(self.of(each, place) for each in value)]
        if kind is dict:
            return ["dict", *self._pairs(value.items(), place)]
        if kind in (set, frozenset):
            return ["set", *sorted((self.of(each, place) for each in value), key=json.dumps)]
        if kind in (np.ndarray, np.memmap):
            return self._array(value, place)
        if isinstance(value, np.generic):
            return ["number", *self._array(np.asarray(value), place)]
        if kind is types.ModuleType:
            return ["module", value.__name__]
        if kind is types.CodeType:
            return self._code(value, place)
        words = inspect.getattr_static(value, "plan_source", None) and value.plan_source
        if isinstance(words, str):
            return ["plan", kind.__qualname__, words]
        if isinstance(value, type):
            return self._class(value, place)
        if kind is types.FunctionType:
            return self._function(value, place)
        if kind is types.MethodType:
            return ["method", self.of(value.__func__, place), self.of(value.__self__, place)]
        if kind is types.BuiltinMethodType:
            owner = value.__self__
            if owner is None or isinstance(owner, types.ModuleType):
                return _name(value)
            return ["method", value.__name__, self.of(owner, place)]
        if callable(value) and hasattr(value, "__wrapped__"):  # functools.cache, say
            return ["wrapped", kind.__qualname__, self.of(value.__wrapped__, place)]
        return self._object(value, place)

    def _pairs(self, items: Any, place: str) -> list[Any]:
        pairs = [
            [self.of(key, place), self.of(value, place or (key if isinstance(key, str) else ""))]
            for key, value in items
        ]
        return sorted(pairs, key=json.dumps)

    def _array(self, value: np.ndarray, place: str) -> list[Any]:
        if value.dtype.hasobject:
            return ["array", list(value.shape), *(self.of(x, place) for x in value.ravel().tolist())]
        data = hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()
        return ["array", str(value.dtype.descr), list(value.shape), data]

    def _code(self, code: types.CodeType, place: str) -> list[Any]:
        names = (code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars)
        counts = [code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags]
        consts = self.of(code.co_consts, place)
        return ["code", code.co_code.hex(), consts, *map(list, names), counts]

    def _function(self, function: types.FunctionType, place: str) -> list[Any]:
        if not _is_own(function) and _is_found_by_name(function):
            return _name(function)
        text: Any = _text(function.__code__)
        if text is None or (function.__name__ == "<lambda>" and text.count("lambda") > 1):
            text = self._code(function.__code__, place)
        code, defaults = function.__code__, function.__defaults__ or ()
        last = code.co_varnames[code.co_argcount - len(defaults) : code.co_argcount]
        given = {**dict(zip(last, defaults, strict=True)), **(function.__kwdefaults__ or {})}
        cells = zip(code.co_freevars, function.__closure__ or (), strict=True)
        return [
            "function",
            function.__qualname__,
            text,
            self.of(given, place),
            self.of({name: _content(cell) for name, cell in cells}, place),
            self.of(function.__dict__, place),
        ]

    def _class(self, value: type, place: str) -> list[Any]:
        texts = []
        for each in value.__mro__:
            if _is_own(each):
                texts.append(_text(each))
                if texts[-1] is None:
                    self._miss(f"the text of the class {each.__qualname__}", place)
        return ["class", value.__qualname__, *texts] if texts else _name(value)

    def _object(self, value: Any, place: str) -> list[Any]:
        """As pickle takes it apart."""
        kind = type(value)
        try:
            reduce = copyreg.dispatch_table.get(kind)
            parts = value.__reduce_ex__(4) if reduce is None else reduce(value)
        except Exception:  # noqa: BLE001 - a lock, a file, what a library made
            self._miss(f"a {kind.__qualname__}", place)
            return ["unknown", kind.__module__, kind.__qualname__]
        if isinstance(parts, str):
            return ["name", getattr(value, "__module__", None), parts]
        make, given, state, items, pairs = (*parts, None, None, None)[:5]
        return [
            "object",
            self.of(make, place),
            self.of(given, place),
            self.of(state, place),
            self.of(list(items or ()), place),
            *self._pairs(pairs or (), place),
        ]

    def _miss(self, what: str, place: str) -> None:
        self.unknown.append(f"{place} ({what})" if place else what)


def _content(cell: Any) -> Any:
    try:
        return cell.cell_contents
    except ValueError:  # not assigned yet
        return None
