"""What every command shares: exit codes, the parser's manners, kinds of arguments."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any, NoReturn

OK = 0
BAD_INPUT = 2  # the file, the map or the command line must change
FAILED_ANALYSIS = 3  # the input is sound but does not determine what was asked for
INTERNAL = 4  # a defect of ulna
INTERRUPTED = 130  # 128 + SIGINT, as shells have it

EXIT_CODES = """exit codes:
  0  done; look at the outcome before you use the numbers
  2  the file, the map or the command line is wrong
  3  the recording does not determine what was asked for
  4  a defect of ulna
  130  interrupted"""


class Usage(Exception):
    """The command cannot be done as asked."""


class Parser(argparse.ArgumentParser):
    """Says in one line what is wrong with a command, without the whole usage above it."""

    def error(self, message: str) -> NoReturn:
        """Exit with the sentence."""
        self.exit(BAD_INPUT, f"{self.prog}: {message}; see `{self.prog} --help`\n")


def add_command(commands: Any, name: str, *, summary: str, examples: str) -> argparse.ArgumentParser:
    """A command with a help that shows examples and the exit codes."""
    parser: argparse.ArgumentParser = commands.add_parser(
        name,
        help=summary,
        description=summary[0].upper() + summary[1:] + ".",
        epilog="examples:\n" + examples + "\n\n" + EXIT_CODES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    # SUPPRESS keeps the value of `ulna --debug assess`.
    parser.add_argument(
        "--debug", action="store_true", default=argparse.SUPPRESS,
        help="show the traceback of an error",
    )  # fmt: skip
    return parser


def add_recording(parser: argparse.ArgumentParser) -> None:
    """The arguments that name a recording; `read_recording` reads it."""
    parser.add_argument(
        "file", metavar="FILE", nargs="+",
        help="recording: CSV, TSV, MAT, NPZ, HDF5, MVNX, MOT, STO, TRC or C3D; several files, or a "
        "folder, are trials",
    )  # fmt: skip
    parser.add_argument("--map", metavar="MAP", help="TOML file that names columns and units")
    parser.add_argument(
        "--split", action="store_true", help="start a new trial after gaps and missing values"
    )
    parser.add_argument(
        "--regularise", action="store_true", help="put jittering time stamps on an even clock"
    )


def read_recording(options: argparse.Namespace) -> Any:
    """The record that `add_recording`'s arguments name; what goes wrong later names its findings."""
    import ulna

    record = options.record = ulna.read(options.file, map=options.map)
    if options.split:  # before the clock is made even, which gaps forbid
        record = options.record = record.split()
    if options.regularise:
        record = options.record = record.regularise()
    return record


def add_results(parser: argparse.ArgumentParser, what: str) -> None:
    """``--out`` and ``--json``; `say` serves them."""
    parser.add_argument("--out", metavar="DIR", help=f"write {what}")
    parser.add_argument("--json", action="store_true", help="print one JSON object, nothing else")


def check_out(options: argparse.Namespace) -> None:
    """Refuse before the work what ``--out`` cannot do after it."""
    if options.out is not None:
        require_matplotlib()
        check_folder(Path(options.out))


def say(options: argparse.Namespace, name: str, found: Any, values: dict[str, Any]) -> int:
    """Print a result's summary or its JSON object; with ``--out`` write both it and its figure."""
    from . import __version__
    from ._result import plain

    text = json.dumps(plain({**values, "ulna": __version__}), indent=2, allow_nan=False)
    folder = None if options.out is None else Path(options.out)
    if folder is not None:
        _write(folder, name, found, text)
    if options.json:
        print(text)
        return OK
    print(found.summary())
    if folder is not None:
        print(f"\nfigure: {folder / (name + '.png')}")
    return OK


def _write(folder: Path, name: str, found: Any, text: str) -> None:
    from . import plot

    folder.mkdir(parents=True, exist_ok=True)
    (folder / "result.json").write_text(text + "\n", encoding="utf-8")
    with plot.style():
        drawn = found.plot()
        figure = (drawn.ravel()[0] if hasattr(drawn, "ravel") else drawn).figure
        while figure.figure is not figure:  # a part of a figure
            figure = figure.figure
        for ending in ("png", "svg"):
            figure.savefig(folder / f"{name}.{ending}")


def number(text: str) -> float:
    """A finite number."""
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number") from None
    if value != value or value in (float("inf"), float("-inf")):
        raise argparse.ArgumentTypeError(f"{text!r} is not a finite number")
    return value


def positive(text: str) -> float:
    """A number above 0."""
    value = number(text)
    if value <= 0:
        raise argparse.ArgumentTypeError(f"{text} is not above 0")
    return value


def not_negative(text: str) -> float:
    """A number that is 0 or more."""
    value = number(text)
    if value < 0:
        raise argparse.ArgumentTypeError(f"{text} is below 0")
    return value


def odd(text: str) -> int:
    """An odd number of samples."""
    if not text.isdecimal() or int(text) % 2 == 0:
        raise argparse.ArgumentTypeError(f"{text!r} is not an odd number of samples")
    return int(text)


def count(text: str) -> int:
    """A whole number above 0."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number above 0")
    return int(text)


def seed(text: str) -> int:
    """A whole number from 0."""
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from 0")
    return int(text)


def numbers(text: str) -> list[float]:
    """Numbers with commas or blanks between."""
    return [number(part) for part in text.replace(",", " ").split()]


def whole_numbers(text: str) -> list[int]:
    """Whole numbers with commas between, as ``1,2,3``."""
    parts = text.replace(",", " ").split()
    if not parts or not all(part.isdecimal() for part in parts):
        raise argparse.ArgumentTypeError(f"{text!r} is not whole numbers, as 1,2,3")
    return [int(part) for part in parts]


def pair(text: str) -> tuple[float, float]:
    """Two numbers with a comma between."""
    parts = text.split(",")
    if len(parts) != 2:
        raise argparse.ArgumentTypeError(f"{text!r} is not two numbers, as 0,0")
    return number(parts[0]), number(parts[1])


def require_matplotlib(option: str = "--out") -> None:
    """Draw without windows; refuse `option` early where there is nothing to draw with."""
    try:
        import matplotlib
    except ImportError as failure:
        raise Usage(
            f"{option} needs matplotlib: install it with `pip install ulna[plot]`"
        ) from failure
    matplotlib.use("Agg")


def check_file(path: Path) -> None:
    """Refuse before the work rather than after it."""
    if path.is_dir():
        raise Usage(f"--out {path} is a folder: give the name of a file")


def check_folder(folder: Path) -> None:
    """Refuse before the work rather than after it."""
    if folder.exists() and not folder.is_dir():
        raise Usage(f"--out {folder} is a file: give a folder")
