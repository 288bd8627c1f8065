"""Parts of a study that run apart, and their results together again."""

from __future__ import annotations

import json
import os
import shutil
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ._call import DataError, FileError, FormatError
from ._study_design import StudyDesign
from ._study_journal import StudyJournal
from .record import refuse

__all__ = ["merge"]

# The head of a journal: mark, SHA-256 of the plan, rows, outputs (libcore/study/journal.cpp).
_HEAD = struct.Struct("<8s32sqq")


def check_shard(shard: Any) -> None:
    """Refuse what is no part of a whole."""
    try:
        i, n = shard
        good = int(i) == i and int(n) == n and 1 <= i <= n <= 100000
    except (TypeError, ValueError):
        good = False
    if not good:
        raise refuse(f"shard is {shard!r}; it must be (i, n) with i from 1 to n", "shard")


def rows_of_shard(design: StudyDesign, shard: tuple[int, int]) -> np.ndarray:
    """Every n-th block: shards get the same work, and any prefix of them is spread evenly."""
    i, n = shard
    block = np.arange(design.rows) // design.block_rows
    return np.flatnonzero(block % n == i - 1)


def merge(
    folders: Sequence[str | os.PathLike[str]], into: str | os.PathLike[str]
) -> dict[str, int]:
    """Put the journals of shards into one folder, after checking that they belong together.

    The folders keep what they have. Where two hold a result of the same row it must be the same.

    Parameters
    ----------
    folders : sequence of paths
        Journals of the same plan.
    into : path
        A journal of that plan, made when it is not there; it may be one of them.

    Returns
    -------
    dict
        "rows" of the plan, "done" and "failed" of all that is known now.
    """
    sources = [Path(folder) for folder in folders]
    if not sources:
        raise refuse("there is nothing to merge: name at least one folder", "folders")
    target = Path(into)
    plans = {source: _plan(source) for source in sources}
    first, plan = next(iter(plans.items()))
    if (target / "plan.json").exists():
        first, plan = target, _plan(target)
    for source, other in plans.items():
        if other != plan:
            differs = sorted(k for k in {*plan, *other} if plan.get(k, "") != other.get(k, ""))
            raise DataError(
                f"{source} is of another plan than {first}: {', '.join(differs)} differ",
                status="ULNA_ERROR_DATA",
                argument="folders",
                detail=str(source),
            )
    sizes = {_size(file) for source in sources for file in _journals(source)}
    if len(sizes) != 1:
        raise DataError(
            "the folders hold no journal"
            if not sizes
            else "the journals are of different sizes",
            status="ULNA_ERROR_DATA",
            argument="folders",
        )
    rows, outputs = sizes.pop()
    # The writers' names are kept; the same name from two folders gets a number.
    StudyJournal(target, plan=plan, rows=rows, outputs=outputs, writer=None if (
        target / "plan.json").exists() else "merged").close()
    copied = []
    try:
        for source in sources:
            if source.resolve() == target.resolve():
                continue
            for file in _journals(source):
                copied.append(_copy(file, target))
        whole = StudyJournal(target, plan=plan, rows=rows, outputs=outputs, writer=None)
    except BaseException:
        for file in copied:
            file.unlink(missing_ok=True)
        raise
    status = whole.status
    whole.close()
    return {
        "rows": rows,
        "done": int(np.count_nonzero(status >= 0)),
        "failed": int(np.count_nonzero(status > 0)),
    }


def _plan(folder: Path) -> dict[str, Any]:
    path = folder / "plan.json"
    try:
        plan = json.loads(path.read_text(encoding="utf-8"))
        if isinstance(plan, dict):
            return plan
    except FileNotFoundError as failure:
        raise FileError(
            f"{folder} holds no study: it has no plan.json",
            status="ULNA_ERROR_FILE",
            argument="folders",
            detail=str(folder),
        ) from failure
    except ValueError:
        pass
    raise FormatError(
        f"{path} is no plan of a study", status="ULNA_ERROR_FORMAT", argument="folders", detail=""
    )


def _journals(folder: Path) -> list[Path]:
    return sorted(folder.glob("*.journal"))


def _size(file: Path) -> tuple[int, int]:
    with file.open("rb") as stream:
        head = stream.read(_HEAD.size)
    if len(head) < _HEAD.size or not head.startswith(b"ULNAJRN1"):
        raise FormatError(
            f"{file} is no journal, or its first bytes are damaged: move it away to go on without "
            "its results",
            status="ULNA_ERROR_FORMAT",
            argument="folders",
            detail=str(file),
        )
    _, _, rows, outputs = _HEAD.unpack(head)
    return rows, outputs


def _copy(file: Path, target: Path) -> Path:
    for number in range(1000000):
        name = file.name if number == 0 else f"{file.stem}.{number}.journal"
        place = target / name
        if not place.exists():
            break
    # Whole or not at all: a reader never meets half a file.
    partial = place.with_suffix(".partial")
    shutil.copyfile(file, partial)
    os.replace(partial, place)
    return place
