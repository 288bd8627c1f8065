"""What the functions of an exoskeleton take: checked numbers, names and tables."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .record import refuse

Array = NDArray[np.float64]


def number(value: Any, name: str, argument: str | None = None) -> float:
    """One number, finite or not; neither a switch nor text.

    Raises
    ------
    ArgumentError
        For anything else; it names `argument`, or `name`.
    """
    if not isinstance(value, bool | np.bool_ | str | bytes):
        try:
            return float(value)
        except (TypeError, ValueError, OverflowError):
            pass
    raise refuse(f"{name} is {value!r}; it must be a number", argument or name)


def as_numbers(value: Any) -> Array | None:
    """One number or several as an array; None where something else is among them."""
    try:
        given = np.asarray(value)
    except ValueError:  # rows of different lengths
        return None
    return given.astype(float) if given.dtype.kind in "iuf" else None


def numbers(value: Any, name: str) -> Array:
    """One number or several as an array.

    Raises
    ------
    ArgumentError
        When something else is among them.
    """
    given = as_numbers(value)
    if given is None:
        raise refuse(f"{name} is {value!r}; it must be numbers", name)
    return given


def names_of(value: Any, name: str) -> list[Any]:
    """A sequence of names; one text is none.

    Raises
    ------
    ArgumentError
        For a text and what is no sequence.
    """
    if isinstance(value, str | bytes | Mapping) or not isinstance(value, Iterable):
        raise refuse(f"{name} is {value!r}; it must be a sequence of names, as ['J4']", name)
    return list(value)


def moved_joints(value: Any) -> dict[Any, float]:
    """Joints that move, each with the angle where it ends in rad.

    Raises
    ------
    ArgumentError
        When it is no table of numbers, or an empty one.
    """
    if not isinstance(value, Mapping):
        raise refuse(
            f"moved is {value!r}; it must be a table of joints, each with the angle where it ends "
            "in rad, as {'J4': 0.5}",
            "moved",
        )
    if not value:
        raise refuse("moved names no joint", "moved")
    return {joint: number(end, f"moved[{joint!r}]", "moved") for joint, end in value.items()}


def plant_pointer(plant: Any, name: str = "plant") -> Any:
    """What the library knows a plant by.

    Raises
    ------
    ArgumentError
        For what is no plant.
    """
    from .exo import Plant

    if not isinstance(plant, Plant):
        raise refuse(f"{name} is a {type(plant).__name__}, not a Plant", name)
    return plant._pointer
