"""The package as a whole: documented, complete, in step with the library."""

import dataclasses
import doctest
import importlib
import inspect
import os
import pkgutil
import re
import subprocess
import sys
import tomllib
import warnings
from pathlib import Path

import pytest

import ulna
from ulna._call import ffi, lib

ROOT = Path(__file__).resolve().parents[2]
SOURCE = ROOT / "bindings" / "python" / "ulna"
MODULES = sorted(
    m.name for m in pkgutil.iter_modules(ulna.__path__, "ulna.") if m.name != "ulna._abi"
)

# C functions that Python has no use for -> why.
NOT_BOUND = {}


def public_callables():
    """(name, object) of every public function, class and public method of the package."""
    for module in ["ulna", *MODULES]:
        if module.rpartition(".")[2].startswith("_"):
            continue
        loaded = importlib.import_module(module)
        names = getattr(loaded, "__all__", [n for n in vars(loaded) if not n.startswith("_")])
        for name in names:
            value = getattr(loaded, name)
            if not callable(value) or not getattr(value, "__module__", "").startswith("ulna"):
                continue
            if value.__module__ in ("ulna._call", "ulna._abi") and module != "ulna":
                continue
            yield f"{module}.{name}", value
            if inspect.isclass(value):
                for member, method in vars(value).items():
                    public = not member.startswith("_")
                    if public and (inspect.isfunction(method) or isinstance(method, property)):
                        yield f"{module}.{name}.{member}", method


def test_every_public_callable_has_a_docstring():
    missing = [name for name, value in public_callables() if not (value.__doc__ or "").strip()]
    assert not missing


def test_arrays_are_positional_and_all_else_is_keyword_only():
    """A bare number in a call means nothing to a reader: flags and numbers are given by name."""
    wrong = []
    for name, value in public_callables():
        if isinstance(value, property) or inspect.isclass(value):
            continue
        for parameter in inspect.signature(value).parameters.values():
            positional = parameter.kind is inspect.Parameter.POSITIONAL_OR_KEYWORD
            setting = parameter.default is not inspect.Parameter.empty
            number = str(parameter.annotation).split(" | ")[0] in ("float", "int", "bool")
            if positional and setting and number:
                wrong.append(f"{name}({parameter.name})")
    assert not wrong


def test_public_functions_are_typed():
    untyped = []
    for name, value in public_callables():
        if inspect.isfunction(value):
            signature = inspect.signature(value)
            parameters = [p for p in signature.parameters.values() if p.name not in ("self", "cls")]
            if signature.return_annotation is inspect.Signature.empty or any(
                p.annotation is inspect.Parameter.empty for p in parameters
            ):
                untyped.append(name)
    assert not untyped


def test_dataclasses_are_frozen():
    classes = [v for _, v in public_callables() if inspect.isclass(v) and dataclasses.is_dataclass(v)]
    thawed = [c.__name__ for c in classes if not c.__dataclass_params__.frozen]
    assert not thawed


@pytest.mark.parametrize("module", ["ulna", *MODULES])
def test_doctests(module, monkeypatch, tmp_path):
    if module == "ulna._body_page":
        from ulna._body_page import three_files

        try:
            three_files()
        except FileNotFoundError as missing:
            pytest.skip(str(missing))
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        result = doctest.testmod(
            importlib.import_module(module),
            optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE,
        )
    assert result.failed == 0


def test_every_c_function_is_bound_or_listed():
    declared = {name for name in dir(lib) if name.startswith("ulna_")}
    text = "\n".join(p.read_text(encoding="utf-8") for p in sorted(SOURCE.glob("*.py")))
    used = set(re.findall(r"\blib\.(ulna_\w+)", text))
    # A Handle frees what its kind names.
    used |= {kind + "_free" for kind in re.findall(r'kind = "(ulna_\w+)"', text)}
    assert declared - used - set(NOT_BOUND) == set(), "bind them or say why not in NOT_BOUND"
    assert used - declared == set(), "the library has no such functions"
    assert set(NOT_BOUND) & used == set(), "bound after all: remove them from NOT_BOUND"


def test_names_are_loaded_lazily_and_listed():
    assert set(ulna.__all__) <= set(dir(ulna))
    for name in ulna.__all__:
        assert getattr(ulna, name) is not None
    code = "import ulna, sys; print(*sorted(m for m in sys.modules if m.startswith('ulna')))"
    loaded = subprocess.check_output([sys.executable, "-c", code], text=True).split()
    assert set(loaded) <= {"ulna", "ulna._abi", "ulna._abi.lib", "ulna._call", "ulna._release"}
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        ulna.nothing  # noqa: B018


@pytest.mark.parametrize("first", ["ulna.passivity", "ulna.report"])
def test_a_function_is_not_hidden_by_its_module(first):
    name = first.split(".")[1]
    code = f"import importlib, ulna; importlib.import_module({first!r}); print(callable(ulna.{name}))"
    assert subprocess.check_output([sys.executable, "-c", code], text=True).strip() == "True"


def test_optional_packages_are_imported_where_they_are_used():
    code = "import sys\n"
    code += "".join(
        f"sys.modules[{name!r}] = None\n"
        for name in (
            "scipy", "h5py", "matplotlib", "tqdm", "pandas", "distributed", "cloudpickle", "pyarrow",
            "SALib", "sklearn",
        )  # fmt: skip
    )
    code += "import importlib\n"
    code += "".join(f"importlib.import_module({m!r})\n" for m in MODULES)
    subprocess.run([sys.executable, "-c", code], check=True)


def test_release_is_the_same_everywhere():
    cmake = (ROOT / "CMakeLists.txt").read_text(encoding="utf-8")
    release = re.search(r"project\(ulna VERSION ([\d.]+)", cmake)[1]
    assert ulna.__version__ == release
    assert ffi.string(lib.ulna_release()).decode() == release
    number = int(re.search(r"ULNA_INTERFACE_NUMBER (\d+)", cmake)[1])
    assert number == lib.ULNA_INTERFACE == lib.ulna_interface_number()


def test_the_package_carries_its_library_and_its_types():
    folder = Path(ulna.__file__).parent
    assert (folder / f"libulna.so.{lib.ULNA_INTERFACE}").is_file()
    assert (folder / "py.typed").is_file()
    with open(f"/proc/{os.getpid()}/maps", encoding="utf-8") as maps:
        loaded = {line.split()[-1] for line in maps if "libulna.so" in line}
    assert {Path(p).parent for p in loaded} == {folder}


def test_the_script_is_declared():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["scripts"] == {"ulna": "ulna.cli:main"}
