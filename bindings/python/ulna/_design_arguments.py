"""What the functions of a design take: checked numbers, units, names of axes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ._call import lib
from .record import refuse, unit_factor

KINDS = {"m": "position", "rad": "position", "N": "force", "Nm": "force"}
DRIVES = {"position": lib.ULNA_DRIVE_POSITION, "force": lib.ULNA_DRIVE_FORCE}


def number(
    value: Any, name: str, *, least: float | None = None, above: float | None = None
) -> float:
    """A finite number; zero bytes mean a default below, so a zero that is none is refused here."""
    try:
        given = float(value)
    except (TypeError, ValueError):
        raise refuse(f"{name} is {value!r}; it must be a number", name) from None
    if not np.isfinite(given):
        raise refuse(f"{name} must be a finite number", name)
    if least is not None and given < least:
        raise refuse(f"{name} is {given:g}; it must be {least:g} or more", name)
    if above is not None and given <= above:
        raise refuse(f"{name} is {given:g}; it must be above {above:g}", name)
    return given


def whole(value: Any, name: str, *, least: int = 1) -> int:
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        raise refuse(f"{name} is {value!r}; it must be a whole number", name)
    if value < least:
        raise refuse(f"{name} is {value}; it must be {least} or more", name)
    return int(value)


def pair(value: Any, name: str) -> tuple[float, float]:
    try:
        low, high = value
    except (TypeError, ValueError):
        raise refuse(
            f"{name} is {value!r}; it must be two numbers, the smaller one first", name
        ) from None
    low, high = number(low, name), number(high, name)
    if low > high:
        raise refuse(f"{name} is ({low:g}, {high:g}); the smaller number comes first", name)
    return low, high


def limit_of(value: float | None, name: str) -> float:
    return 0.0 if value is None else number(value, name, above=0.0)


def si_unit(unit: str) -> tuple[str, float]:
    si, factor = unit_factor(unit)
    if si not in KINDS:
        raise refuse(
            f"the unit {unit!r} is neither of a position (m, rad) nor of a force (N, Nm)", "unit"
        )
    return si, factor


def axis_names(axes: Any) -> tuple[str, ...]:
    names = (axes,) if isinstance(axes, str) else tuple(axes)
    for name in names:
        if not isinstance(name, str) or not name or "," in name or not name.isprintable():
            raise refuse(f"{name!r} is no name of an axis: use a short word, as 'x'", "axes")
    if not names or len(set(names)) != len(names):
        raise refuse("axes must be one or more different names, as ('x', 'y')", "axes")
    return names


def amplitudes(value: Any, axes: tuple[str, ...], factor: float, name: str) -> np.ndarray:
    values = np.asarray(value, dtype=float) * factor
    if values.ndim == 0:
        values = np.full(len(axes), float(values))
    if values.shape != (len(axes),):
        raise refuse(
            f"{name} must be one number, or one for each of the axes {', '.join(axes)}", name
        )
    return values


_MOST = {"m": 2.0, "rad": 10.0}  # further than a hand or a joint goes


def within_reach(values: Any, si: str, name: str) -> None:
    """Refuse a motion that only another unit can mean."""
    most = np.max(values)
    if most > _MOST.get(si, np.inf):
        unit = {"m": "mm", "rad": "deg"}[si]
        raise refuse(
            f"{name} is {most:g} {si}, further than an arm goes: give {si}, or unit={unit!r}", name
        )


def usual(table: Mapping[str, float], si: str, name: str) -> float:
    if si not in table:
        raise refuse(f"give the {name} in {si}: there is no usual one", name)
    return table[si]


def span(value: Any, name: str) -> tuple[float, float]:
    low, high = pair(value, name)
    number(low, name, least=0.0)
    number(high, name, above=0.0)
    return low, high
