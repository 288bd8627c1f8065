"""Checks who includes whom: the layers that doc comments promise are only real if a test holds them.

    layering.py <root of the repository>
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

# Module -> modules whose headers it may include, besides its own.
MAY_INCLUDE = {
    "base": set(),
    "signal": {"base"},
    "record": {"base"},
    "stats": {"base"},
    "plant": {"base", "signal", "record", "stats"},
    "sim": {"base", "signal", "record", "stats", "plant"},
    "control": {"base", "signal", "record", "stats", "plant"},
    "estimate": {"base", "signal", "record", "stats", "plant"},
    "ident": {"base", "signal", "record", "stats", "plant"},
    "impedance": {"base", "signal", "record", "stats", "plant", "ident"},
    "passivity": {"base", "signal", "record", "stats", "plant", "ident", "impedance"},
    "study": {"base", "record"},
    "vision": {"base", "record"},
}

# Third-party header -> folders of libcore that may include it.
ONLY_IN = {
    r"opencv2?/": ("vision",),
    r"mujoco/": ("plant/engine",),
    r"nlopt\.h": ("ident", "plant"),
    r"(coin/|coin-or/)?Ip\w+\.(h|hpp)": ("ident", "plant"),
    r"ulna/": (),
}
_INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]*([<"])([^>"]+)[>"]', re.MULTILINE)


def problems_of_core(core: Path) -> list[str]:
    problems = []
    for file in sorted(core.rglob("*.[ch]pp")):
        place = file.relative_to(core)
        module = place.parts[0]
        if module not in MAY_INCLUDE:
            problems.append(f"libcore/{place}: {module} is no module that the layers know")
            continue
        for match in _INCLUDE.finditer(file.read_text(encoding="utf-8")):
            bracket, name = match.groups()
            line = f"libcore/{place}: includes {name}"
            for pattern, folders in ONLY_IN.items():
                allowed = any(place.is_relative_to(folder) for folder in folders)
                if re.match(pattern, name) and not allowed:
                    problems.append(f"{line}, allowed in: {', '.join(folders) or 'no module'}")
            if bracket == '"':
                other = name.split("/")[0]
                if "/" not in name or not (core / name).is_file():
                    problems.append(f'{line}: own headers are included as "<module>/x.hpp"')
                elif other != module and other not in MAY_INCLUDE[module]:
                    problems.append(f"{line}: {module} must not know {other}")
    return problems


def problems_of_bindings(bindings: Path) -> list[str]:
    """Bindings see the C headers only, and one Python file sees the extension module."""
    problems = []
    for file in sorted(bindings.rglob("*")):
        place = f"bindings/{file.relative_to(bindings)}"
        if file.suffix in (".c", ".cpp", ".h", ".hpp"):
            for bracket, name in _INCLUDE.findall(file.read_text(encoding="utf-8")):
                if bracket == '"' and "libcore" in name or name.endswith(".hpp"):
                    problems.append(f"{place}: includes {name}, bindings see capi/include only")
        elif file.suffix == ".py" and file.name != "_call.py":
            if re.search(r"^\s*(from|import)\b.*\b_abi\b", file.read_text(encoding="utf-8"), re.M):
                problems.append(f"{place}: imports _abi, which only _call.py does")
    return problems


def main() -> int:
    root = Path(sys.argv[1])
    problems = problems_of_core(root / "libcore") + problems_of_bindings(root / "bindings")
    for problem in problems:
        print(problem, file=sys.stderr)
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
