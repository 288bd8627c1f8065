"""The command ``ulna``: assess a recording, look into a file, check the installation.

What a script reads goes to standard output, what went wrong to standard error as one sentence.
"""

from __future__ import annotations

import argparse
import json
import re
import shlex
import sys
import warnings
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from ._command import (
    BAD_INPUT,
    EXIT_CODES,
    FAILED_ANALYSIS,
    INTERNAL,
    INTERRUPTED,
    OK,
    Parser,
    Usage,
    add_command,
    add_recording,
    add_results,
    check_out,
    count,
    not_negative,
    odd,
    pair,
    positive,
    read_recording,
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code.

    Examples
    --------
    >>> main(["--version"])  # doctest: +ELLIPSIS
    ulna ...
    0
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    try:
        options = _parser().parse_args(_with_negative_pair(words))
    except SystemExit as stop:  # argparse: 0 after --help, 2 for a wrong command line
        return int(stop.code or 0)
    options.command_line = shlex.join(["ulna", *words])
    try:
        with warnings.catch_warnings():
            # What an estimate warns of is part of its summary and of the JSON object.
            warnings.simplefilter("ignore", UserWarning)
            return int(options.run(options))
    except KeyboardInterrupt:
        print("ulna: interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:  # the reader of a pipe has gone, as `| head` does
        sys.stdout = open("/dev/null", "w")  # noqa: SIM115 - the flush at exit needs it open
        return OK
    except Exception as failure:  # noqa: BLE001 - one sentence instead of a traceback
        if options.debug:
            raise
        return _explain(failure, options)


def _with_negative_pair(words: list[str]) -> list[str]:
    """``--shoulder -0.1,0`` as one word: argparse would take the pair for an option."""
    out: list[str] = []
    for word in words:
        if out and out[-1] == "--shoulder" and re.match(r"-[.\d]", word):
            out[-1] += f"={word}"
        else:
            out.append(word)
    return out


def _explain(failure: Exception, options: argparse.Namespace) -> int:
    from . import AnalysisError, ArgumentError, DataError, FileError, FormatError, UnsupportedError

    told = (ArgumentError, DataError, FileError, FormatError, UnsupportedError, OSError, Usage)
    message = " ".join(str(failure).split())
    if isinstance(failure, AnalysisError | MemoryError):
        code = FAILED_ANALYSIS
        message = message or "there is not enough memory for this recording"
    elif isinstance(failure, ImportError) and failure.name is None:
        code = BAD_INPUT  # an optional package that this input needs; the message names it
    elif isinstance(failure, told):
        code = BAD_INPUT
        if isinstance(failure, OSError) and failure.strerror and failure.filename:
            message = f"{failure.filename}: {failure.strerror}"
    else:
        code = INTERNAL
        message = (
            f"internal error: {type(failure).__name__}: {message}; "
            "please report it with what --debug prints"
        )
    record = getattr(options, "record", None)  # there from when the file was read
    if record is None or code == INTERNAL:
        print(f"ulna: {message}", file=sys.stderr)
        return code
    print(f"ulna: {message}{_remedy(message, options)}", file=sys.stderr)
    for finding in record.findings:
        if finding.severity != "note":
            print(f"ulna: warning: {' '.join(finding.message.split())}", file=sys.stderr)
    return code


# What the library says of a record that an option can mend.
_SPLITS = ("samples are missing", "has no number", "missing value", "has a gap")
_REGULARISES = ("jitter",)


def _remedy(message: str, options: argparse.Namespace) -> str:
    for phrases, option, used in (
        (_SPLITS, "--split", options.split),
        (_REGULARISES, "--regularise", options.regularise),
    ):
        if not used and any(phrase in message for phrase in phrases):
            return f"; try {option}"
    return ""


# Modules with more commands, in the order of the help: `add_to(commands)` adds them.
_COMMAND_MODULES: tuple[str, ...] = (
    "_command_design",
    "_command_simulate",
    "_command_model",
    "_command_reflex",
    "_command_passivity",
    "_command_rig",
    "_command_validate",
    "_command_study",
    "_command_torques",
)


# The parser --------------------------------------------------------------------------------------


def _parser() -> argparse.ArgumentParser:
    from . import __version__

    parser = Parser(
        prog="ulna",
        description="Impedance and passivity of a human limb from recordings with a robot.",
        epilog="example:\n  ulna assess trial.csv --out report\n\n" + EXIT_CODES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("--version", action="version", version=f"ulna {__version__}")
    parser.add_argument("--selftest", action="store_true", help="check this installation")
    parser.add_argument("--debug", action="store_true", help=argparse.SUPPRESS)
    parser.set_defaults(run=_selftest_or_help, parser=parser)
    commands = parser.add_subparsers(title="commands", metavar="COMMAND")
    _add_assess(commands)
    _add_inspect(commands)
    for module in _COMMAND_MODULES:
        import_module(f"{__package__}.{module}").add_to(commands)
    return parser


def _add_assess(commands: Any) -> None:
    parser = add_command(
        commands,
        "assess",
        summary="estimate inertia, damping and stiffness and judge passivity",
        examples="  ulna assess trial.csv\n"
        "  ulna assess trial.csv --map lab.toml --out report\n"
        "  ulna assess first.csv second.csv --split --out report\n"
        "  ulna assess ankle.csv --lowpass 50 --train 40 --json",
    )
    add_recording(parser)
    add_results(parser, "report.html, result.json and figures")
    model = parser.add_argument_group("model")
    model.add_argument(
        "--model", choices=("free", "symmetric", "passive"), default="free",
        help="structure of M, B and K (default: %(default)s)",
    )  # fmt: skip
    model.add_argument("--no-damping", action="store_true", help="B = 0")
    model.add_argument("--diagonal-mass", action="store_true", help="M = m times the identity")
    model.add_argument(
        "--payload", metavar="KG", type=not_negative, default=0.0,
        help="mass between sensor and hand, taken off M, in kg (kg m^2 for a joint)",
    )  # fmt: skip
    fit = parser.add_argument_group("fit")
    fit.add_argument(
        "--estimator", choices=("auto", "ls", "iv"), default="auto",
        help="least squares or instrumental variables; auto takes iv when the recording holds "
        "the reference",
    )  # fmt: skip
    fit.add_argument("--lowpass", metavar="HZ", type=positive, help="cut-off of the low pass")
    fit.add_argument("--window", metavar="N", type=odd, help="samples of the smoothing window")
    fit.add_argument("--train", metavar="S", type=positive, help="seconds that identify; the rest "
                     "validates")  # fmt: skip
    fit.add_argument(
        "--errors", choices=("newey-west", "bootstrap"),
        help="how standard errors are found (default: newey-west)",
    )  # fmt: skip
    fit.add_argument(
        "--bootstrap", metavar="N", type=count,
        help="number of resamplings; implies --errors bootstrap",
    )  # fmt: skip
    fit.add_argument("--seed", metavar="N", type=int, default=0, help="of the random draws")
    drawing = parser.add_argument_group("drawing")
    drawing.add_argument(
        "--shoulder", metavar="X,Y", type=pair,
        help="place of the shoulder in m, in the frame of the recording: ellipses are then drawn "
        "on an arm",
    )  # fmt: skip
    parser.set_defaults(run=_assess)


def _add_inspect(commands: Any) -> None:
    parser = add_command(
        commands,
        "inspect",
        summary="show what a file holds and draft a map for it",
        examples="  ulna inspect trial.mat\n  ulna inspect trial.mat --out lab.toml",
    )
    parser.add_argument("file", metavar="FILE", help="recording: CSV, TSV, MAT, NPZ or HDF5")
    parser.add_argument("--map", metavar="MAP", help="TOML file that names columns and units")
    parser.add_argument("--out", metavar="MAP", help="write the drafted map to this file")
    parser.set_defaults(run=_inspect)


# assess ------------------------------------------------------------------------------------------


def _assess(options: argparse.Namespace) -> int:
    import ulna

    from ._result import result

    if options.bootstrap is not None and options.errors == "newey-west":
        raise Usage("--bootstrap N needs --errors bootstrap: leave out --errors newey-west")
    check_out(options)
    record = read_recording(options)
    counts = {} if options.bootstrap is None else {"bootstrap": options.bootstrap}
    estimate = ulna.identify_impedance(
        record,
        model=options.model,
        no_damping=options.no_damping,
        diagonal_mass=options.diagonal_mass,
        estimator=options.estimator,
        lowpass_hz=options.lowpass,
        window=options.window,
        train_s=options.train,
        payload_kg=options.payload,
        errors=options.errors or ("bootstrap" if counts else "newey-west"),
        seed=options.seed,
        **counts,
    )
    page = None if options.out is None else Path(options.out) / "report.html"
    source = options.file[0] if len(options.file) == 1 else options.file
    found = result(estimate, source=source, report=None if page is None else str(page))
    text = json.dumps(found, indent=2, allow_nan=False)
    if page is not None:
        _write_results(estimate, page, text, options)
    if options.json:
        print(text)
        return OK
    print(_summary(estimate))
    if page is not None:
        print(f"\nreport: {page}")
    return OK


def _write_results(estimate: Any, page: Path, text: str, options: argparse.Namespace) -> None:
    from . import plot
    from .report import report

    figures = page.parent / "figures"
    figures.mkdir(parents=True, exist_ok=True)
    pictures = list(plot.pictures(estimate, shoulder_m=options.shoulder))
    report(
        estimate,
        page,
        source=_source_words(options.file),
        command=options.command_line,
        figures=pictures,
    )
    for picture in pictures:
        picture.save(figures)
    (page.parent / "result.json").write_text(text + "\n", encoding="utf-8")


def _source_words(files: Sequence[str]) -> str:
    names = [Path(file).name for file in files]
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    return ", ".join(names[:3]) + more


def _summary(estimate: Any) -> str:
    parts = [str(estimate.summary()).rstrip(), str(estimate.passivity().summary()).rstrip()]
    return "\n\n".join(part for part in parts if part)


# inspect -----------------------------------------------------------------------------------------


def _inspect(options: argparse.Namespace) -> int:
    import ulna

    target = None if options.out is None else Path(options.out)
    if target is not None and target.exists():
        raise Usage(f"{target} exists already: choose another name, so that no map is lost")
    found = ulna.inspect(options.file, map=options.map)
    print(found.summary())
    if target is not None:
        target.write_text(found.map_toml, encoding="utf-8")
        print(f"\nmap: {target}")
    return OK


# selftest ----------------------------------------------------------------------------------------


def _selftest_or_help(options: argparse.Namespace) -> int:
    if options.selftest:
        return _selftest()
    options.parser.print_help()
    return BAD_INPUT


def _selftest() -> int:
    """Assess a small recording whose answer is known and say what came out."""
    import tempfile

    import numpy as np

    import ulna

    information = ulna.build_information()
    print(f"ulna {ulna.__version__} ({information['build']}), NumPy {np.__version__}")
    m = np.array([[1.33, -0.93], [-0.93, 1.89]])
    b = np.array([[5.75, -2.2], [-2.2, 10.6]])
    k = np.array([[42.45, -28.7], [-28.7, 125.43]])
    x0 = np.array([-0.003, 0.529])
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "selftest.csv"
        _write_known(path, m, b, k, x0)
        estimate = ulna.identify_impedance(ulna.read(path), estimator="ls")
    good = True
    for name, truth in (("M", m), ("B", b), ("K", k), ("x0", x0)):
        error = float(np.max(np.abs(getattr(estimate, name) - truth)) / np.max(np.abs(truth)))
        # The recording is free of noise; what remains is the ripple of the smoothing filter.
        passed = error < 1e-4
        good = good and passed
        print(f"  {name:<3} relative error {error:.1e}  {'ok' if passed else 'FAILED'}")
    verdict = estimate.passivity().verdict
    passed = verdict == "passive"
    good = good and passed
    print(f"  passivity: {verdict}  {'ok' if passed else 'FAILED'}")
    print("selftest passed" if good else "selftest FAILED: install ulna again")
    return OK if good else INTERNAL


def _write_known(path: Path, m: Any, b: Any, k: Any, x0: Any) -> None:
    """A noise-free two-axis recording of 20 s at 500 Hz with exact derivatives."""
    import numpy as np

    time = np.arange(10000) / 500.0
    frequency = np.array([[0.3, 0.4], [0.9, 1.0], [1.6, 1.7], [2.3, 2.5]])  # Hz, one column an axis
    omega = 2 * np.pi * frequency
    phase = np.array([[0.1, 2.0], [1.2, 4.1], [3.3, 0.4], [5.0, 2.9]])
    angle = omega * time[:, None, None] + phase
    position = np.array([0.0, 0.52]) + 0.004 * np.cos(angle).sum(axis=1)
    velocity = -0.004 * (omega * np.sin(angle)).sum(axis=1)
    acceleration = -0.004 * (omega**2 * np.cos(angle)).sum(axis=1)
    force = -(acceleration @ m.T + velocity @ b.T + (position - x0) @ k.T)
    np.savetxt(
        path,
        np.column_stack([time, position, force]),
        delimiter=",",
        fmt="%.15g",
        header="time_s,x_m,y_m,F_x_N,F_y_N",
        comments="",
    )


if __name__ == "__main__":
    raise SystemExit(main())
