"""Calls into the C library: the only user of the generated module ``ulna._abi``.

Everything above this file speaks NumPy arrays, keywords and exceptions; everything below it speaks
pointers and status values. Other modules take ``ffi`` and ``lib`` from here.
"""

from __future__ import annotations

import threading
import weakref
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from ._release import RELEASE

try:
    from ._abi import ffi, lib
except ImportError as failure:
    raise ImportError(
        f"the compiled part of ulna cannot be loaded ({failure}); install ulna again with "
        "`pip install --force-reinstall .` in its source folder"
    ) from failure


class Error(Exception):
    """A call failed and changed nothing; the message is one sentence.

    Attributes
    ----------
    status : str
        Name of the status, as ``"ULNA_ERROR_DATA"``.
    argument : str
        Name of the offending argument or option, or ``""``.
    detail : str
        Where in the data, as ``"row 17"``, or ``""``.
    """

    def __init__(
        self, message: str, *, status: str = "", argument: str = "", detail: str = ""
    ) -> None:
        super().__init__(message)
        self.status = status
        self.argument = argument
        self.detail = detail

    def __reduce__(self) -> tuple[Any, ...]:
        # The default would drop the keywords, and multiprocessing pickles exceptions.
        return _rebuild, (type(self), str(self), self.status, self.argument, self.detail)


def _rebuild(kind: type[Error], message: str, status: str, argument: str, detail: str) -> Error:
    return kind(message, status=status, argument=argument, detail=detail)


class ArgumentError(Error, ValueError):
    """The call is wrong: change the argument that the message names."""


class DataError(Error, ValueError):
    """The numbers cannot be used: clean or change the data."""


class FileError(Error, OSError):
    """The file cannot be opened, read or written."""


class FormatError(Error, ValueError):
    """The file does not hold what its kind promises."""


class AnalysisError(Error, ArithmeticError):
    """The data are sound but do not determine what was asked for."""


class Cancelled(Error):
    """The call was stopped through its token. Ctrl-C raises ``KeyboardInterrupt`` instead."""


class OutOfMemory(Error, MemoryError):
    """There is not enough memory."""


class UnsupportedError(Error, NotImplementedError):
    """This build of the library cannot do it."""


class InternalError(Error, RuntimeError):
    """A defect of ulna: please report it with the message."""


_KINDS: dict[int, type[Error]] = {
    lib.ULNA_ERROR_ARGUMENT: ArgumentError,
    lib.ULNA_ERROR_DATA: DataError,
    lib.ULNA_ERROR_FILE: FileError,
    lib.ULNA_ERROR_FORMAT: FormatError,
    lib.ULNA_ERROR_ANALYSIS: AnalysisError,
    lib.ULNA_ERROR_BUFFER: InternalError,  # buffers are sized here, so this is our defect
    lib.ULNA_ERROR_CANCELLED: Cancelled,
    lib.ULNA_ERROR_MEMORY: OutOfMemory,
    lib.ULNA_ERROR_UNSUPPORTED: UnsupportedError,
    lib.ULNA_ERROR_INTERNAL: InternalError,
}

# NumPy's type of the elements behind a pointer.
_NUMBERS: dict[Any, Any] = {
    ffi.typeof("double *"): np.float64,
    ffi.typeof("int32_t *"): np.int32,
    ffi.typeof("int64_t *"): np.int64,
}

# What a struct points to lives as long as the struct.
_alive: weakref.WeakKeyDictionary[Any, list[Any]] = weakref.WeakKeyDictionary()


def _check_library() -> None:
    number = lib.ulna_interface_number()
    release = decode(lib.ulna_release())
    if number != lib.ULNA_INTERFACE or release != RELEASE:
        raise ImportError(
            f"this package is ulna {RELEASE} with interface {lib.ULNA_INTERFACE}, but the library "
            f"that was loaded is {release} with interface {number}: remove the other libulna from "
            "LD_LIBRARY_PATH or install ulna again"
        )


def decode(pointer: Any) -> str:
    """Text behind a ``const char *``; ``""`` for NULL."""
    if pointer == ffi.NULL:
        return ""
    return ffi.string(pointer).decode("utf-8", "replace")


def last_error() -> Error:
    """The reason of the last failing call on this thread, as an exception."""
    record = result("ulna_error")
    lib.ulna_error_last(record)
    return _KINDS.get(record.status, InternalError)(
        decode(record.message),
        status=decode(lib.ulna_status_name(record.status)),
        argument=decode(record.argument),
        detail=decode(record.detail),
    )


def check(status: int) -> None:
    """Raise the error of the call that just returned `status` on this thread."""
    if status != lib.ULNA_OK:
        raise last_error()


# Arrays and structs in ---------------------------------------------------------------------------


def view(array: Any) -> Any:
    """Borrow an array of one or two dimensions as ``ulna_view *``; the result keeps it alive.

    Floats of 8 bytes pass without a copy whatever their strides; other numbers are converted.
    """
    values = np.asarray(array)
    if values.dtype.kind not in "fiub":
        raise ArgumentError(
            f"expected an array of real numbers, got one of {values.dtype}",
            status="ULNA_ERROR_ARGUMENT",
        )
    values = values.astype(np.float64, copy=False)
    if values.ndim not in (1, 2):
        raise ArgumentError(
            f"expected an array of one or two dimensions, got {values.ndim}",
            status="ULNA_ERROR_ARGUMENT",
        )
    if not values.flags.aligned or any(stride % values.itemsize for stride in values.strides):
        values = np.ascontiguousarray(values)
    struct = ffi.new("ulna_view *")
    struct.data = ffi.cast("const double *", values.__array_interface__["data"][0])
    struct.rows = values.shape[0]
    struct.row_stride = values.strides[0] // 8
    struct.cols = values.shape[1] if values.ndim == 2 else 1
    struct.col_stride = values.strides[1] // 8 if values.ndim == 2 else 1
    _alive[struct] = [values]
    return struct


def options(kind: str, **fields: Any) -> Any:
    """New options struct of a kind, as ``options("ulna_x_options", order=4)``.

    ``None`` leaves a field at its default. Text, arrays (for ``const ulna_view *`` and
    ``const double *``) and lists of text are kept alive by the struct.
    """
    struct = result(kind)
    kept = _alive.setdefault(struct, [])
    members = _members(kind)
    for name, value in fields.items():
        if name not in members or name == "struct_size":
            known = ", ".join(sorted(set(members) - {"struct_size", "reserved"}))
            raise TypeError(f"{kind} has no option {name!r}; it has {known}")
        if value is None:
            continue
        try:
            _set_field(struct, name, members[name], value, kept)
        except (TypeError, OverflowError) as failure:
            raise ArgumentError(
                f"{name} is {value!r}; it must be {_wanted(members[name])}",
                status="ULNA_ERROR_ARGUMENT",
                argument=name,
            ) from failure
    return struct


def _wanted(kind: Any) -> str:
    words = {"double": "a number", "int32_t": "a whole number", "int64_t": "a whole number"}
    return words.get(kind.cname, "text" if "char" in kind.cname else f"a {kind.cname}")


def _members(kind: str) -> dict[str, Any]:
    return {name: field.type for name, field in ffi.typeof(kind).fields}


def _set_field(struct: Any, name: str, kind: Any, value: Any, kept: list[Any]) -> None:
    if kind.kind == "array" and kind.item.cname == "char":
        data = _encode(value, name)
        if len(data) >= kind.length:
            raise ArgumentError(
                f"{name} is longer than {kind.length - 1} bytes",
                status="ULNA_ERROR_ARGUMENT",
                argument=name,
            )
        setattr(struct, name, data)
    elif kind.kind == "pointer":
        pointer = _pointer(kind, name, value)
        kept.append(pointer)
        setattr(struct, name, pointer[0] if isinstance(pointer, tuple) else pointer)
    elif kind.kind == "primitive" and kind.cname in ("int32_t", "int64_t", "uint32_t"):
        setattr(struct, name, int(value) if isinstance(value, (bool, np.bool_)) else value)
    else:
        setattr(struct, name, value)


def _pointer(kind: Any, name: str, value: Any) -> Any:
    """A C object for a pointer field; a tuple when more than the first must stay alive."""
    if isinstance(value, ffi.CData):
        return value
    if kind is ffi.typeof("char *"):
        return ffi.new("char[]", _encode(value, name))
    if kind is ffi.typeof("char **"):
        texts = [ffi.new("char[]", _encode(text, name)) for text in value]
        return ffi.new("const char *[]", texts), texts
    if kind is ffi.typeof("ulna_view *"):
        return view(value)
    numbers = _NUMBERS.get(kind)
    if numbers is None:
        raise TypeError(f"{name} takes a {kind.cname}")
    values = np.ascontiguousarray(value, dtype=numbers)
    return ffi.cast(kind, values.__array_interface__["data"][0]), values


def _encode(value: Any, name: str) -> bytes:
    data = value if isinstance(value, bytes) else str(value).encode("utf-8", "surrogateescape")
    if b"\0" in data:
        raise ArgumentError(
            f"{name} holds a zero byte", status="ULNA_ERROR_ARGUMENT", argument=name
        )
    return data


def encode(value: Any, name: str = "text") -> Any:
    """Text or a path as a ``char[]`` to pass as ``const char *``."""
    return ffi.new("char[]", _encode(value, name))


# Results out -------------------------------------------------------------------------------------


def result(kind: str) -> Any:
    """New zeroed struct of a kind with ``struct_size`` set, to pass as ``kind *``."""
    struct = ffi.new(kind + " *")
    if hasattr(struct, "struct_size"):
        struct.struct_size = ffi.sizeof(kind)
    return struct


def out_array(function: Callable[..., int], *args: Any, shape: Any = None, order: str = "C") -> Any:
    """Array that `function` writes through its last arguments (buffer, capacity, count).

    Asks for the count, then fills. `shape` and `order` reshape what was written.
    """
    count = ffi.new("int64_t *")
    check(function(*args, ffi.NULL, 0, count))
    kind = ffi.typeof(function).args[-3]
    values = np.empty(count[0], dtype=_NUMBERS[kind])
    if values.size:
        pointer = ffi.cast(kind, values.__array_interface__["data"][0])
        check(function(*args, pointer, values.size, count))
    return values if shape is None else values.reshape(shape, order=order)


def text(function: Callable[..., int], *args: Any) -> str:
    """Text that `function` writes through its last arguments (buffer, capacity, size)."""
    size = ffi.new("int64_t *")
    check(function(*args, ffi.NULL, 0, size))
    buffer = ffi.new("char[]", max(size[0], 1))
    check(function(*args, buffer, size[0], size))
    return decode(buffer)


class Handle:
    """Owner of a pointer that one ``<kind>_free`` releases.

    A subclass names the kind: ``class _Record(Handle): kind = "ulna_record"``.
    """

    kind = ""
    __slots__ = ("pointer", "__weakref__")

    def __init__(self, pointer: Any) -> None:
        self.pointer = ffi.gc(pointer, getattr(lib, self.kind + "_free"))

    @classmethod
    def make(cls, function: Callable[..., int], *args: Any) -> Any:
        """Call a function whose last argument is ``<kind> **`` and own what it made."""
        out = ffi.new(cls.kind + " **")
        check(function(*args, out))
        return cls(out[0])

    def __reduce__(self) -> Any:
        raise TypeError(f"{type(self).__name__} holds a pointer and cannot be pickled")


class Token(Handle):
    """Progress and cancellation of a running call."""

    kind = "ulna_token"
    __slots__ = ()

    @classmethod
    def new(cls) -> Token:
        return cls.make(lib.ulna_token_new)

    def cancel(self) -> None:
        check(lib.ulna_token_cancel(self.pointer))

    @property
    def progress(self) -> float:
        fraction = ffi.new("double *")
        check(lib.ulna_token_progress(self.pointer, fraction))
        return fraction[0]


# Long calls --------------------------------------------------------------------------------------

_POLL_S = 0.1  # between updates of a progress bar; an interrupt wakes the wait at once


def long_call(
    function: Callable[..., int], *args: Any, progress: bool = False, label: str | None = None
) -> None:
    """Run a call that takes an ``ulna_token *`` so that Ctrl-C stops it and a bar can show.

    The token may be left out of `args` or be ``ffi.NULL``. On the main thread, where Python
    delivers Ctrl-C, the call runs on a helper thread and this one waits; other threads call
    directly unless they show a bar.
    """
    bar = _ProgressBar(label) if progress else None
    place, args = _token_place(function, args)
    if bar is None and threading.current_thread() is not threading.main_thread():
        check(function(*args))
        return
    token = Token.new()
    args[place] = token.pointer
    failure: list[BaseException] = []

    def work() -> None:
        # The error record belongs to the thread that made the call, so it is read here.
        try:
            check(function(*args))
        except BaseException as error:  # noqa: BLE001 - handed to the waiting thread
            failure.append(error)

    worker = threading.Thread(target=work, name="ulna", daemon=True)
    try:
        worker.start()
        while worker.is_alive():
            worker.join(_POLL_S)
            if bar is not None:
                bar.update_to(token.progress)
    except BaseException:
        token.cancel()
        worker.join()
        raise
    finally:
        if bar is not None:
            bar.close()
    if failure:
        raise failure[0]


def _token_place(function: Any, args: tuple[Any, ...]) -> tuple[int, list[Any]]:
    kinds = ffi.typeof(function).args
    place = kinds.index(ffi.typeof("ulna_token *"))
    filled = list(args)
    if len(filled) == len(kinds) - 1:
        filled.insert(place, ffi.NULL)
    return place, filled


class _ProgressBar:
    def __init__(self, label: str | None) -> None:
        try:
            from tqdm.auto import tqdm
        except ImportError as failure:
            raise ImportError(
                "a progress bar needs tqdm: install it with `pip install ulna[progress]`"
            ) from failure
        form = "{l_bar}{bar}| {elapsed} < {remaining}"
        self.bar = tqdm(total=1.0, desc=label, bar_format=form, leave=False)

    def update_to(self, fraction: float) -> None:
        self.bar.update(fraction - self.bar.n)

    def close(self) -> None:
        self.bar.close()


def constants(prefix: str) -> Iterator[tuple[str, int]]:
    """Constants of a group as (name in lower case without the prefix, value)."""
    for name in dir(lib):
        if name.startswith(prefix):
            yield name[len(prefix) :].lower(), getattr(lib, name)


_check_library()
