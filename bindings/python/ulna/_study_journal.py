"""The results of a study on disk, safe against any kill."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ._call import (
    DataError,
    Handle,
    check,
    decode,
    encode,
    ffi,
    lib,
    options,
    out_array,
    result,
    text,
)
from ._study_design import StudyDesign
from ._study_plan import Described, described, unfixed

__all__ = ["StudyJournal"]

# Statuses whose cause may be the machine: such a row is run again.
TRANSIENT = (lib.ULNA_ROW_TIMEOUT, lib.ULNA_ROW_CRASHED)


class _Journal(Handle):
    kind = "ulna_journal"
    __slots__ = ()

    def close(self) -> None:
        ffi.release(self.pointer)


def plan_of(
    design: StudyDesign,
    outputs: Sequence[str],
    function: Callable[..., Any] | None,
    vectorized: bool,
    told: Described | None = None,
) -> dict[str, Any]:
    """All that the results depend on, as far as it can be known.

    The function's own source is part of it, and what is bound to it; what it calls is not.
    """
    _, fixed = unfixed(function)
    told = described(function) if told is None else told
    points = design.points
    return {
        **({} if fixed is None else {"fixed": fixed}),
        "factors": {
            name: [type(factor).__name__, np.asarray(factor._parameters(), dtype=float).tolist()]
            for name, factor in design.factors.items()
        },
        "groups": None if design.groups is None else dict(design.groups),
        "scheme": design.scheme,
        "sampler": design.sampler,
        "n": int(design.n),
        "replicates": int(design.replicates),
        "second_order": bool(design.second_order),
        "guard": float(design.guard),
        "levels": int(design.levels),
        "candidates": int(design.candidates),
        "seed": int(design.seed),
        "dummy": bool(design.dummy),
        "points": None
        if points is None
        else hashlib.sha256(np.ascontiguousarray(points, dtype=float).tobytes()).hexdigest(),
        "outputs": list(outputs),
        "vectorized": bool(vectorized),
        "function": told.name,
        "source": told.source,
        **({} if told.state is None else {"state": told.state}),
    }


class StudyJournal:
    """A folder with a plan and one append-only file for each writer.

    Parameters
    ----------
    folder : path
        Made when it is not there.
    plan : dict
        All that the results depend on; a folder of another plan is refused.
    rows, outputs : int
    writer : str, optional
        Name of the own file, one process at a time; None only reads.
    sync_s : float
        Records are on the disk at most so much later; a killed process loses none anyway.
    """

    def __init__(
        self,
        folder: str | os.PathLike[str],
        *,
        plan: dict[str, Any],
        rows: int,
        outputs: int,
        writer: str | None = "main",
        sync_s: float = 1.0,
    ) -> None:
        self.folder = Path(folder)
        self.outputs = outputs
        words = json.dumps(plan, indent=1, sort_keys=True) + "\n"
        chosen = options(
            "ulna_journal_options",
            rows=rows,
            outputs=outputs,
            sync_s=-1.0 if sync_s == 0 else sync_s,
        )
        try:
            self._handle = _Journal.make(
                lib.ulna_journal_open,
                encode(os.fspath(folder), "folder"),
                encode(words, "plan"),
                ffi.NULL if writer is None else encode(writer, "writer"),
                chosen,
            )
        except DataError as failure:
            changed = _changed(self.folder, plan)
            if changed:
                failure.add_note(f"what differs: {', '.join(changed)}")
            raise

    def append(
        self, row: int, status: int, wall_s: float, values: np.ndarray, message: str = ""
    ) -> None:
        """Add the result of a row: it survives the process from here on."""
        kept = np.ascontiguousarray(values, dtype=float)
        if kept.shape != (self.outputs,):
            raise ValueError(f"values must be {self.outputs} numbers")
        check(
            lib.ulna_journal_append(
                self._handle.pointer,
                row,
                status,
                wall_s,
                ffi.cast("const double *", kept.__array_interface__["data"][0]),
                encode(message.replace("\0", " "), "message"),
            )
        )

    def sync(self) -> None:
        """Wait until all records are on the disk."""
        check(lib.ulna_journal_sync(self._handle.pointer))

    def close(self) -> None:
        """Sync and close: another process may write under this name then."""
        self._handle.close()

    def _info(self) -> Any:
        info = result("ulna_journal_info")
        check(lib.ulna_journal_get_info(self._handle.pointer, info))
        return info

    @property
    def hash(self) -> str:
        """SHA-256 of the plan."""
        return decode(self._info().hash)

    @property
    def records(self) -> int:
        """Good records of all writers."""
        return self._info().records

    @property
    def damaged_bytes(self) -> int:
        """Bytes that were skipped when the journal was opened: writes that were cut off."""
        return self._info().damaged_bytes

    @property
    def status(self) -> np.ndarray:
        """Status of each row, -1 where there is no result."""
        return out_array(lib.ulna_journal_get_status, self._handle.pointer)

    @property
    def wall_s(self) -> np.ndarray:
        """Time of each run, s."""
        return out_array(lib.ulna_journal_get_times, self._handle.pointer)

    @property
    def values(self) -> np.ndarray:
        """Outputs, (rows, outputs)."""
        flat = out_array(lib.ulna_journal_get_values, self._handle.pointer)
        return flat.reshape(-1, self.outputs)

    def message(self, row: int) -> str:
        """Why a row failed."""
        return text(lib.ulna_journal_get_message, self._handle.pointer, row)


def _changed(folder: Path, plan: dict[str, Any]) -> list[str]:
    """Entries in which the folder's plan is another."""
    try:
        other = json.loads((folder / "plan.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return []
    if not isinstance(other, dict):
        return []
    return sorted(
        key for key in set(plan) | set(other) if plan.get(key, "") != other.get(key, "")
    )
