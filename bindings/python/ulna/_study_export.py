"""The runs of a study as a table for other programs."""

from __future__ import annotations

import csv
import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ._study_indices import STATUSES
from ._study_salib import problem_of
from .record import refuse

if TYPE_CHECKING:
    from .study import Runs

_KINDS = {
    ".csv": "csv",
    ".h5": "hdf5",
    ".hdf5": "hdf5",
    ".nc": "netcdf",
    ".parquet": "parquet",
}


def status_words(status: np.ndarray) -> list[str]:
    """Statuses by their names; "not run" for -1."""
    return [STATUSES[code] if 0 <= code < len(STATUSES) else "not run" for code in status.tolist()]


def columns_of(runs: Runs) -> dict[str, Any]:
    """Columns of the table: row, block, factors, outputs, status, wall_s, message."""
    design = runs.design
    rows = np.arange(len(runs.y))
    out: dict[str, Any] = {"row": rows, "block": rows // design.block_rows}
    if design.has_points:
        for name, column in zip(design.factors, design.values().T, strict=True):
            out[_free(name, out)] = np.ascontiguousarray(column)
    for name, column in zip(runs.outputs, runs.y.T, strict=True):
        out[_free(name, out)] = np.ascontiguousarray(column)
    out[_free("status", out)] = status_words(runs.status)
    out[_free("wall_s", out)] = runs.wall_s
    out[_free("message", out)] = [runs.messages.get(row, "") for row in rows.tolist()]
    return out


def _free(name: str, taken: dict[str, Any]) -> str:
    while name in taken:  # a factor called "row", an output called as a factor
        name += "_"
    return name


def about(runs: Runs) -> dict[str, str]:
    """What the table is of, as words of its own."""
    from . import __version__
    from ._study_journal import plan_of

    plan = plan_of(runs.design, runs.outputs, None, False)
    for unknown in ("function", "source", "vectorized"):
        plan.pop(unknown)
    return {
        "title": "runs of a sensitivity study",
        "design": json.dumps(plan, sort_keys=True),
        "factors": json.dumps(list(runs.design.factors)),
        "outputs": json.dumps(list(runs.outputs)),
        "statuses": json.dumps(list(STATUSES)),
        "software": f"ulna {__version__}",
    }


def export(runs: Runs, path: str | os.PathLike[str]) -> Path:
    """Write a table in the format of the path's ending."""
    target = Path(path)
    kind = _KINDS.get(target.suffix.lower())
    if kind is None:
        raise refuse(
            f"{target.name!r} ends in none of {', '.join(_KINDS)}, which name the format", "path"
        )
    target.parent.mkdir(parents=True, exist_ok=True)
    # Under another name first: a reader never meets half a table, a failure leaves the old one.
    partial = target.with_name(target.name + ".partial")
    try:
        {"csv": _csv, "hdf5": _hdf5, "netcdf": _netcdf, "parquet": _parquet}[kind](runs, partial)
        os.replace(partial, target)
    finally:
        partial.unlink(missing_ok=True)
    return target


def _csv(runs: Runs, path: Path) -> None:
    columns = columns_of(runs)
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(columns)
        lists = [c.tolist() if isinstance(c, np.ndarray) else c for c in columns.values()]
        # Numbers as Python writes them: the shortest that is read back as the same.
        writer.writerows(zip(*lists, strict=True))


def _hdf5(runs: Runs, path: Path) -> None:
    try:
        import h5py
    except ImportError as failure:
        raise ImportError(
            "HDF5 needs h5py: install it with `pip install ulna[io]`"
        ) from failure
    with h5py.File(path, "w") as file:
        for name, words in about(runs).items():
            file.attrs[name] = words
        for name, column in columns_of(runs).items():
            if isinstance(column, np.ndarray):
                file.create_dataset(_safe(name), data=column)
            else:
                file.create_dataset(_safe(name), data=column, dtype=h5py.string_dtype())


def _safe(name: str) -> str:
    return name.replace("/", "_")  # which makes folders in HDF5 and is refused by NetCDF


def _netcdf(runs: Runs, path: Path) -> None:
    """NetCDF 3, which every reader knows; text is in arrays of characters there."""
    try:
        from scipy.io import netcdf_file
    except ImportError as failure:
        raise ImportError(
            "NetCDF needs scipy: install it with `pip install ulna[io]`"
        ) from failure
    columns = columns_of(runs)
    with netcdf_file(path, "w", version=2) as file:
        for name, words in about(runs).items():
            setattr(file, name, words)
        file.createDimension("run", len(runs.y))
        for name, column in columns.items():
            if isinstance(column, np.ndarray):
                kind = "i4" if column.dtype.kind == "i" else "f8"
                variable = file.createVariable(_safe(name), kind, ("run",))
                variable[:] = column.astype(kind)
                continue
            data = [text.encode("utf-8") for text in column]
            size = max(1, *map(len, data)) if data else 1
            file.createDimension(f"{name}_characters", size)
            variable = file.createVariable(_safe(name), "c", ("run", f"{name}_characters"))
            variable[:] = np.array(data, dtype=f"S{size}").view("S1").reshape(-1, size)


def _parquet(runs: Runs, path: Path) -> None:
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError as failure:
        raise ImportError(
            "Parquet needs pyarrow: install it with `pip install ulna[parquet]`"
        ) from failure
    table = pyarrow.table(columns_of(runs))
    parquet.write_table(table.replace_schema_metadata(about(runs)), path)


def salib_files(runs: Runs, folder: str | os.PathLike[str]) -> list[Path]:
    """Write what SALib reads: problem.json for Python, params.csv for its command, X.txt, Y.txt."""
    if not runs.design.has_points:
        raise refuse("SALib needs the values of the factors: read_outputs(y, x=...)", "x")
    problem = problem_of(runs.design.factors, runs.design.groups)
    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    paths = {name: target / name for name in ("problem.json", "X.txt", "Y.txt")}
    paths["problem.json"].write_text(json.dumps(problem, indent=1) + "\n", encoding="utf-8")
    np.savetxt(paths["X.txt"], runs.design.values(), fmt="%.17g")
    np.savetxt(paths["Y.txt"], runs.y, fmt="%.17g")
    if all(len(bound) == 2 for bound in problem["bounds"]):  # more do not fit the file
        paths["params.csv"] = target / "params.csv"
        groups = problem.get("groups", problem["names"])
        with paths["params.csv"].open("w", newline="", encoding="utf-8") as stream:
            csv.writer(stream, lineterminator="\n").writerows(
                [name, *bound, group, kind]
                for name, bound, group, kind in zip(
                    problem["names"], problem["bounds"], groups, problem["dists"], strict=True
                )
            )
    return list(paths.values())
