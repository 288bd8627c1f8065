"""``ulna study``: plan, run, analyse and report a sensitivity study that a TOML file describes."""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from . import _command_overhead, _command_patient
from ._command import OK, Usage, add_command, check_folder, count, require_matplotlib

UNFINISHED = 5  # runs are missing: another shard has them, or the time was up


def add_to(commands: Any) -> None:
    """Add the command ``study`` with its verbs."""
    parser = add_command(
        commands,
        "study",
        summary="find out which uncertain factor of a model matters",
        examples="  ulna study plan elbow.toml\n"
        "  ulna study run elbow.toml --out out/elbow --workers 4\n"
        "  ulna study run elbow.toml --out part1 --shard 1/2\n"
        "  ulna study merge part1 part2 --into out/elbow\n"
        "  ulna study patient elbow.toml --observed K_est=5.2:0.1 --quantity K\n"
        "  ulna study export elbow.toml --out out/elbow --to runs.parquet\n"
        "  ulna study overhead --out out/overhead",
    )
    verbs = parser.add_subparsers(dest="verb", metavar="VERB", required=True)

    plan = add_command(
        verbs, "plan", summary="check the file and say what would be run",
        examples="  ulna study plan elbow.toml --out out/elbow",
    )  # fmt: skip
    _add_file(plan)
    plan.set_defaults(run=_plan)

    run = add_command(
        verbs, "run", summary="run what is missing, then analyse and report",
        examples="  ulna study run elbow.toml --workers 4\n"
        "  ulna study run elbow.toml --dask tcp://head:8786\n"
        "  ulna study run elbow.toml --out part1 --shard 1/2",
    )  # fmt: skip
    _add_file(run)
    run.add_argument("--workers", type=count, metavar="N", help="slots on this machine")
    run.add_argument("--dask", metavar="ADDRESS", help="scheduler of a Dask cluster")
    run.add_argument("--mpi", action="store_true", help="on the ranks that mpiexec started (mpi4py)")
    run.add_argument("--shard", type=_shard, metavar="I/N", help="only the I-th of N parts")
    run.add_argument("--no-figures", action="store_true", help="tables alone")
    run.add_argument("--quiet", action="store_true", help="no lines about the progress")
    run.add_argument("--json", action="store_true", help="print one JSON object, nothing else")
    run.epilog = (run.epilog or "") + "\n  5  runs are missing: of other shards, or the time was up"
    run.set_defaults(run=_run)

    analyse = add_command(
        verbs, "analyse", summary="analyse and report what has been run",
        examples="  ulna study analyse elbow.toml --out out/elbow\n"
        "  ulna study analyse elbow.toml --outputs Y.txt",
    )  # fmt: skip
    _add_file(analyse)
    analyse.add_argument(
        "--outputs", metavar="TXT",
        help="outputs of the first design that were computed elsewhere, a line a run (SALib's Y)",
    )  # fmt: skip
    analyse.add_argument("--no-figures", action="store_true", help="tables alone")
    analyse.add_argument("--json", action="store_true", help="print one JSON object, nothing else")
    analyse.set_defaults(run=_analyse)

    export = add_command(
        verbs, "export", summary="write the runs, or the points to be run, for other programs",
        examples="  ulna study export elbow.toml --to runs.h5\n"
        "  ulna study export elbow.toml --to salib/ --salib\n"
        "  ulna study export elbow.toml --to X.txt --points",
    )  # fmt: skip
    _add_file(export)
    export.add_argument("--to", required=True, metavar="PATH", help=".csv, .h5, .nc, .parquet")
    export.add_argument("--phase", choices=("screen", "rank"), help="of two (default: the last)")
    what = export.add_mutually_exclusive_group()
    what.add_argument("--salib", action="store_true", help="write SALib's files into the folder")
    what.add_argument(
        "--points", action="store_true", help="only the points of the first design, as text"
    )
    export.set_defaults(run=_export)

    _command_patient.add_to(verbs, _add_file)
    _command_overhead.add_to(verbs)

    merge = add_command(
        verbs, "merge", summary="put the results of shards together",
        examples="  ulna study merge part1 part2 --into out/elbow",
    )  # fmt: skip
    merge.add_argument("folder", metavar="DIR", nargs="+", help="that `run --shard` wrote")
    merge.add_argument("--into", required=True, metavar="DIR", help="made when it is not there")
    merge.set_defaults(run=_merge)


def _add_file(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", metavar="FILE", help="TOML file that describes the study")
    parser.add_argument(
        "--out", metavar="DIR", help="of results, report and figures (default: the file's name)"
    )


def _shard(text: str) -> tuple[int, int]:
    first, slash, second = text.partition("/")
    if not (slash and first.isdecimal() and second.isdecimal()):
        raise argparse.ArgumentTypeError(f"{text!r} is no shard, as 1/4")
    i, n = int(first), int(second)
    if not 1 <= i <= n:
        raise argparse.ArgumentTypeError(f"{text!r}: the first number is from 1 to the second")
    return i, n


def folder_of(options: argparse.Namespace) -> Path:
    """Folder of the results."""
    folder = Path(options.out) if options.out is not None else Path(options.file).with_suffix("")
    if options.out is None and folder == Path(options.file):
        raise Usage("--out is needed: the file has no ending to leave out")
    check_folder(folder)
    return folder


def need_figures(options: argparse.Namespace) -> None:
    """Refuse at once when figures are wanted and cannot be drawn."""
    if not options.no_figures:
        try:
            require_matplotlib()
        except Usage as failure:
            words = "figures need matplotlib: `pip install ulna[plot]`, or give --no-figures"
            raise Usage(words) from failure


def read_file(options: argparse.Namespace) -> Any:
    """The study's file, checked."""
    from ._study_file import read_study

    with _models_print_elsewhere():
        return read_study(options.file)


@contextlib.contextmanager
def _models_print_elsewhere() -> Iterator[None]:
    """What a model or its libraries print goes to standard error: the output is the command's."""
    kept = None
    with contextlib.suppress(OSError):  # a stream may be closed
        sys.stdout.flush()
        kept = os.dup(1)
        os.dup2(2, 1)
    try:
        with contextlib.redirect_stdout(sys.stderr):
            yield
    finally:
        if kept is not None:
            _flush_libraries()
            os.dup2(kept, 1)
            os.close(kept)


def _flush_libraries() -> None:
    """Write out what was printed past `sys.stdout`."""
    import ctypes

    with contextlib.suppress(Exception):
        ctypes.CDLL(None).fflush(None)
    if sys.__stdout__ is not None:
        with contextlib.suppress(OSError, ValueError):
            sys.__stdout__.flush()


# plan ----------------------------------------------------------------------------------------------


def _plan(options: argparse.Namespace) -> int:
    import numpy as np

    file = read_file(options)
    folder = folder_of(options)
    print(f"{file.title}: {file.kind}, outputs {', '.join(file.study.outputs)}")
    width = max(map(len, file.study.factors))
    for name, factor in file.study.factors.items():
        unit = file.units.get(name, "")
        print(f"  {name:<{width}}  {factor!r}" + (f"  {unit}" if unit else ""))
    name, design = file.first_design()
    ranking = file.largest_ranking()
    print(f"\n{name}: {design.rows} runs in {design.blocks} blocks of {design.block_rows}")
    if ranking is not None:
        print(f"rank: at most {ranking.rows} runs, fewer when factors are fixed")
    if file.study.function is not None and (folder / name / "plan.json").exists():
        runs = file.study.collect(design, journal=folder / name)
        done = design.rows - runs.missing.size
        print(f"\n{done} of {design.rows} runs of {name} are done, {runs.failed.size} failed")
        wall = runs.wall_s[np.isfinite(runs.wall_s)]
        if wall.size:
            rest = wall.mean() * (runs.missing.size + (ranking.rows if ranking else 0))
            print(f"a run takes {wall.mean():.3g} s; at most {rest / 3600:.3g} h of computing left")
    return OK


# run -----------------------------------------------------------------------------------------------


class _Unfinished(Exception):
    def __init__(self, phase: str, runs: Any) -> None:
        super().__init__(
            f"{phase}: {len(runs.y) - runs.missing.size} of {len(runs.y)} runs are there"
        )


def _run(options: argparse.Namespace) -> int:
    file = read_file(options)
    folder = folder_of(options)
    need_figures(options)
    if file.study.function is None:
        raise Usage(f"{file.path} names no model and no program to run")
    if sum(map(bool, (options.workers, options.dask, options.mpi))) > 1:
        raise Usage("--workers, --dask and --mpi exclude each other")
    running = dict(file.run)
    with contextlib.ExitStack() as stack:
        if options.dask:
            running["executor"] = stack.enter_context(_dask(options.dask))
            running.pop("workers", None)
        elif options.mpi:
            running["executor"] = stack.enter_context(_mpi())
            running.pop("workers", None)
        elif options.workers:
            running["workers"] = options.workers
        if options.shard:
            running["shard"] = options.shard
        if file.budget_s is not None:
            running["budget_s"] = file.budget_s
        progress = _Lines()

        def execute(study: Any, design: Any, phase: str) -> Any:
            progress.phase = phase
            try:
                runs = study.run(
                    design,
                    on_failure=file.on_failure,
                    journal=folder / phase,
                    progress=False if options.quiet else progress,
                    **running,
                )
            except Exception as failure:
                _tell_of_model(failure)
                raise
            if runs.missing.size:
                raise _Unfinished(phase, runs)
            return runs

        try:
            with _models_print_elsewhere():
                found = _execute(file, execute)
        except _Unfinished as unfinished:
            more = (
                "run the other shards, merge them when they are in folders of their own, then run "
                "this again"
                if options.shard
                else "the time is up; run this again to go on"
            )
            print(f"{unfinished}: {more}", file=sys.stderr if options.json else sys.stdout)
            return UNFINISHED
    return _tell(found, folder, options)


def _tell_of_model(failure: Exception) -> None:
    """An error of the model's own is none of ulna's: raise it as words, with its run."""
    from . import Error

    notes = getattr(failure, "__notes__", ())
    where = next((note for note in notes if note.startswith(("in run ", "in runs "))), None)
    if where is not None and not isinstance(failure, Error):
        raise Usage(f"the model raised {type(failure).__name__}: {failure}, {where}") from failure


class _Lines:
    """A line on standard error every few seconds; one that is written over on a terminal."""

    phase = ""

    def __init__(self) -> None:
        self.next = 0.0

    def __call__(self, state: Any) -> None:
        last = state.done == state.rows
        terminal = sys.stderr.isatty()
        if not (terminal or last or state.elapsed_s >= self.next):
            return
        self.next = state.elapsed_s + 10.0
        line = f"{self.phase}: {state.line()}"
        if terminal:
            line = f"\r{line[:100]:<100}"
        print(line, end="\n" if last or not terminal else "", file=sys.stderr, flush=True)
        if last:
            self.next = 0.0


def _dask(address: str) -> Any:
    try:
        from distributed import Client
    except ImportError as failure:
        raise Usage("--dask needs Dask: install it with `pip install ulna[dask]`") from failure
    try:
        return Client(address, timeout="10s")
    except (OSError, TimeoutError, ValueError) as failure:
        raise Usage(f"--dask {address}: there is no scheduler to be reached ({failure})") from failure


def _mpi() -> Any:
    try:
        from mpi4py.futures import MPIPoolExecutor
    except ImportError as failure:
        raise Usage("--mpi needs mpi4py: install it with `pip install ulna[mpi]`") from failure
    return MPIPoolExecutor()


def _execute(file: Any, execute: Callable[[Any, Any, str], Any]) -> Any:
    """Every phase by `execute`, and the analyses."""
    from ._study_report import Analysed
    from ._study_two_phase import two_phase

    kept: dict[str, Any] = {}

    def keep(study: Any, design: Any, phase: str) -> Any:
        kept[phase] = execute(study, design, phase)
        return kept[phase]

    if file.kind == "two-phase":
        found = two_phase(file.study, execute=keep, **file.two_phases())
        return Analysed(file, found.screening, found.ranking, found, kept)
    name, design = file.first_design()
    runs = keep(file.study, design, name)
    outputs = file.study.outputs
    if file.kind == "screen":
        effects = {o: runs.screen(output=o, **file.options("screen")) for o in outputs}
        return Analysed(file, effects, {}, None, kept)
    ranked = {}
    if file.kind == "sobol":
        ranked = {o: runs.sobol(output=o, **file.options("sobol")) for o in outputs}
    return Analysed(file, {}, ranked, None, kept)


def _tell(found: Any, folder: Path, options: argparse.Namespace) -> int:
    folder.mkdir(parents=True, exist_ok=True)
    pictures = []
    if not options.no_figures:
        figures = folder / "figures"
        figures.mkdir(exist_ok=True)
        pictures = list(found.pictures())
    page = folder / "report.html"
    page.write_text(found.page(options.command_line, pictures), encoding="utf-8")
    for picture in pictures:
        picture.save(figures)
    text = json.dumps({**found.result(), "report": str(page)}, indent=2, allow_nan=False)
    (folder / "result.json").write_text(text + "\n", encoding="utf-8")
    if options.json:
        print(text)
        return OK
    print(found.summary())
    print(f"\nreport: {page}")
    return OK


# analyse, export, merge ----------------------------------------------------------------------------


def collected(file: Any, folder: Path) -> Callable[[Any, Any, str], Any]:
    """What runs a design by taking its runs from the journal, where all must be."""
    def execute(study: Any, design: Any, phase: str) -> Any:
        if not (folder / phase / "plan.json").exists():
            raise Usage(f"{folder} holds no runs of the phase {phase!r}: use `ulna study run` first")
        runs = study.collect(design, journal=folder / phase)
        if runs.missing.size:
            raise Usage(
                f"{phase}: {runs.missing.size} of {len(runs.y)} runs are missing: "
                "use `ulna study run` to go on"
            )
        return runs

    return execute


def _analyse(options: argparse.Namespace) -> int:
    file = read_file(options)
    folder = folder_of(options)
    need_figures(options)
    execute = collected(file, folder)
    if options.outputs is not None:
        if file.kind == "two-phase":
            raise Usage("--outputs is for one design: choose kind sobol, screen or sample")
        execute = _from_text(Path(options.outputs))
    elif file.study.function is None:
        raise Usage(f"{file.path} names no model: give its outputs with --outputs")
    return _tell(_execute(file, execute), folder, options)


def _from_text(path: Path) -> Callable[[Any, Any, str], Any]:
    import numpy as np

    from .study import Runs

    def execute(study: Any, design: Any, phase: str) -> Any:
        try:
            y = np.loadtxt(path, ndmin=2)
        except ValueError as failure:
            raise Usage(f"{path} is no table of numbers ({failure})") from failure
        shape = (design.rows, len(study.outputs))
        if y.shape != shape:
            raise Usage(f"{path} holds {y.shape[0]} x {y.shape[1]} numbers, the design needs "
                        f"{shape[0]} x {shape[1]}")  # fmt: skip
        lost = ~np.isfinite(y).all(axis=1)
        status = np.where(lost, 5, 0).astype(np.int32)  # nonfinite
        return Runs(
            design, y, status, np.full(len(y), np.nan), study.outputs, units=study.units
        )

    return execute


def _export(options: argparse.Namespace) -> int:
    import numpy as np

    file = read_file(options)
    target = Path(options.to)
    if options.points:
        _, design = file.first_design()
        target.parent.mkdir(parents=True, exist_ok=True)
        np.savetxt(target, design.values(), fmt="%.17g")
        print(f"points: {target} ({design.rows} rows: {', '.join(design.factors)})")
        return OK
    folder = folder_of(options)
    if options.phase and file.kind != "two-phase":
        raise Usage("--phase is for a study of two phases")
    if file.study.function is None:
        raise Usage(f"{file.path} names no model: there are no runs to export")
    name, design = file.first_design()
    if file.kind == "two-phase" and options.phase != "screen":
        runs = _execute(file, collected(file, folder)).runs
        runs = runs.get("rank") or runs["screen"]
    else:
        # Also while it runs: rows without a result say so.
        if not (folder / name / "plan.json").exists():
            raise Usage(f"{folder} holds no runs yet: use `ulna study run` first")
        runs = file.study.collect(design, journal=folder / name)
    if options.salib:
        for path in runs.to_salib(target) and sorted(target.iterdir()):
            print(f"written: {path}")
        return OK
    print(f"table: {runs.export(target)} ({len(runs.y)} runs)")
    return OK


def _merge(options: argparse.Namespace) -> int:
    from .study import merge

    folders = [Path(folder) for folder in options.folder]
    target = Path(options.into)
    check_folder(target)
    for folder in folders:
        if not folder.is_dir():
            raise Usage(f"{folder} is no folder")
    phases = sorted({p.parent.name for folder in folders for p in folder.glob("*/plan.json")})
    own = [folder for folder in folders if (folder / "plan.json").exists()]
    if not phases and not own:
        raise Usage(f"{folders[0]} holds no results of a study")
    for phase in phases:
        parts = [folder / phase for folder in folders if (folder / phase / "plan.json").exists()]
        _say_merged(phase, merge(parts, target / phase))
    if own:
        _say_merged("study", merge(own, target))
    return OK


def _say_merged(name: str, told: dict[str, int]) -> None:
    print(f"{name}: {told['done']} of {told['rows']} runs, {told['failed']} failed")
