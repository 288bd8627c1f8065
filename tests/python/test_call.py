"""The helpers between Python and C: errors, views, options, texts, tokens and Ctrl-C."""

import gc
import pickle
import subprocess
import sys
import threading
import time
import weakref

import numpy as np
import pytest
from ctrl_c import ctrl_c

import ulna
from ulna import _call
from ulna._call import ffi, lib


def test_errors_carry_what_the_record_says():
    with pytest.raises(ulna.ArgumentError, match="token must not be NULL") as failure:
        _call.check(lib.ulna_token_cancel(ffi.NULL))
    assert failure.value.status == "ULNA_ERROR_ARGUMENT"
    assert failure.value.argument == "token"
    copy = pickle.loads(pickle.dumps(failure.value))
    assert type(copy) is ulna.ArgumentError and copy.argument == "token"
    assert str(copy) == str(failure.value)


def test_errors_are_also_the_built_in_ones():
    built_in = {
        ulna.ArgumentError: ValueError, ulna.DataError: ValueError, ulna.FileError: OSError,
        ulna.FormatError: ValueError, ulna.AnalysisError: ArithmeticError,
        ulna.OutOfMemory: MemoryError, ulna.UnsupportedError: NotImplementedError,
        ulna.InternalError: RuntimeError,
    }  # fmt: skip
    for kind, base in built_in.items():
        assert issubclass(kind, base) and issubclass(kind, ulna.Error)
        assert str(kind("one sentence", status="s")) == "one sentence"
    assert not issubclass(ulna.Cancelled, KeyboardInterrupt)


def test_every_status_has_a_class():
    assert set(_call._KINDS) == {value for _, value in _call.constants("ULNA_ERROR_")}


def seen(view):
    """The array as C reads it through a view."""
    return np.array(
        [
            [view.data[r * view.row_stride + c * view.col_stride] for c in range(view.cols)]
            for r in range(view.rows)
        ]
    ).reshape(view.rows, view.cols)


BASE = np.arange(24.0).reshape(6, 4)


@pytest.mark.parametrize(
    "array",
    [BASE, BASE.T, np.asfortranarray(BASE), BASE[::-1, ::2], BASE[1:1], BASE[:, 1], BASE[::-2, 0]],
    ids=["rows", "transposed", "fortran", "reversed", "empty", "column", "reversed column"],
)
def test_floats_pass_without_a_copy(array):
    view = _call.view(array)
    expected = array if array.ndim == 2 else array[:, None]
    np.testing.assert_array_equal(seen(view), expected)
    assert int(ffi.cast("intptr_t", view.data)) == array.__array_interface__["data"][0]


@pytest.mark.parametrize(
    "array",
    [
        BASE.astype(np.float32), BASE.astype(">f8"), BASE.astype(np.int16), BASE > 3, [[1, 2], [3, 4]],
        np.frombuffer(b"\0" + BASE.tobytes(), dtype=np.uint8)[1:].view(np.float64).reshape(6, 4),
        np.rec.fromarrays([BASE[:, 0], np.zeros(6, np.int32)], names="a,b").a,
    ],
    ids=["float32", "big-endian", "int16", "bool", "list", "unaligned", "field of records"],
)  # fmt: skip
def test_other_arrays_are_converted(array):
    values = np.asarray(array, dtype=np.float64)
    np.testing.assert_array_equal(seen(_call.view(array)), values.reshape(len(values), -1))


@pytest.mark.parametrize("array", [1.0, np.zeros((2, 2, 2)), np.zeros(3, complex), ["a"], [None]])
def test_what_is_no_array_of_numbers_is_refused(array):
    with pytest.raises(ulna.ArgumentError, match="expected an array"):
        _call.view(array)


def test_a_view_keeps_its_array_alive():
    array = np.ones(5)
    reference = weakref.ref(array)
    view = _call.view(array)
    del array
    gc.collect()
    assert reference() is not None and view.data[4] == 1.0
    del view
    gc.collect()
    assert reference() is None


def test_options_refuse_unknown_names():
    struct = _call.options("ulna_error", status=3, message="é", argument=None)
    assert struct.struct_size == ffi.sizeof("ulna_error")
    assert (struct.status, _call.decode(struct.message), struct.argument[0]) == (3, "é", b"\0")
    with pytest.raises(TypeError, match="no option 'messsage'; it has argument"):
        _call.options("ulna_error", messsage="x")
    with pytest.raises(ulna.ArgumentError, match="longer than 63 bytes"):
        _call.options("ulna_error", argument="x" * 64)
    with pytest.raises(ulna.ArgumentError, match="zero byte"):
        _call.options("ulna_error", argument="a\0b")


def test_handles_are_freed_and_not_pickled():
    token = _call.Token.new()
    assert token.progress == 0.0
    with pytest.raises(TypeError, match="cannot be pickled"):
        pickle.dumps(token)
    token.cancel()


def test_a_library_of_another_release_is_refused(monkeypatch):
    monkeypatch.setattr(_call, "RELEASE", "9.9.9")
    with pytest.raises(ImportError, match=r"ulna 9\.9\.9 with interface 0"):
        _call._check_library()


# Long calls: a Python function stands for the native one, with its signature ----------------------


@pytest.fixture
def slow(monkeypatch):
    """A call of the shape (input, token, output) that works until its token is cancelled."""
    stopped = []

    @ffi.callback("int32_t(int32_t)")
    def signature(_):
        return 0

    def call(steps, token, out):
        for i in range(steps):
            if token in stopped:
                return lib.ulna_token_cancel(ffi.NULL)
            time.sleep(0.005)
        out.append(threading.current_thread())
        return 0

    class Type:
        args = (ffi.typeof("int32_t"), ffi.typeof("ulna_token *"), ffi.typeof("int32_t *"))

    real = ffi.typeof
    proxy = type("Proxy", (), {"typeof": staticmethod(lambda x: Type if x is call else real(x))})
    for name in ("NULL", "gc", "new", "string"):
        setattr(proxy, name, getattr(ffi, name))
    monkeypatch.setattr(_call, "ffi", proxy)
    cancel = _call.Token.cancel
    monkeypatch.setattr(
        _call.Token, "cancel", lambda self: (stopped.append(self.pointer), cancel(self))
    )
    return call


def test_a_long_call_finds_the_place_of_its_token(slow):
    out = []
    _call.long_call(slow, 1, out)
    _call.long_call(slow, 1, ffi.NULL, out)
    assert len(out) == 2 and all(t is not threading.main_thread() for t in out)


def test_a_long_call_on_another_thread_runs_there(slow):
    out = []
    thread = threading.Thread(target=_call.long_call, args=(slow, 1, out))
    thread.start()
    thread.join()
    assert out == [thread]


def test_a_failing_long_call_raises_the_error_of_its_thread():
    with pytest.raises(ulna.ArgumentError, match="out_fraction must not be NULL"):
        _call.long_call(lib.ulna_token_progress, ffi.NULL)


def test_ctrl_c_stops_a_long_call(slow):
    started = time.perf_counter()
    with ctrl_c(after_s=0.2), pytest.raises(KeyboardInterrupt):
        _call.long_call(slow, 2_000, [])
    # 50 ms is what the interface promises; the rest is room for a busy machine.
    assert time.perf_counter() - started - 0.2 < 1.0


def test_a_progress_bar_shows(slow, capsys):
    pytest.importorskip("tqdm")
    _call.long_call(slow, 60, [], progress=True, label="identify")
    assert "identify" in capsys.readouterr().err


def test_without_tqdm_the_bar_says_what_to_install(slow, monkeypatch):
    monkeypatch.setitem(sys.modules, "tqdm.auto", None)
    with pytest.raises(ImportError, match=r"ulna\[progress\]"):
        _call.long_call(slow, 1, [], progress=True)


def test_import_is_quick():
    code = (
        "import numpy, time; t = time.perf_counter(); import ulna; "
        "print(time.perf_counter() - t)"
    )
    runs = [float(subprocess.check_output([sys.executable, "-c", code])) for _ in range(3)]
    assert min(runs) < 0.15, runs
