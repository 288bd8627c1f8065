"""A published table beside what comes out here, and the comparisons in it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Comparison:
    """One published number or word beside ours.

    Attributes
    ----------
    row, quantity, unit : str
        Where it stands in the table.
    published, ours : float or str
    tolerance : float
        How far they may differ: the rounding of what is printed and of what it is computed from, or
        the accuracy that a simulated recording is asked to give. Zero for words.
    agrees : bool
    """

    row: str
    quantity: str
    unit: str
    published: float | str
    ours: float | str
    tolerance: float
    agrees: bool


@dataclass(frozen=True)
class PublishedTable:
    """A table of the document and what became of it.

    Attributes
    ----------
    number, title : str
        "3.3", "Ellipses of the relaxed arm ..."
    status : str
        "reproduced": it follows from other published numbers; "recovered": simulated recordings at
        its numbers give them back; "does not follow": the document's own equations give something
        else; "not recovered"; "not published": it needs recordings that are not available.
    comparisons : tuple of Comparison
    remarks : tuple of str
        How it was done and why something differs.
    """

    number: str
    title: str
    status: str
    comparisons: tuple[Comparison, ...] = field(repr=False)
    remarks: tuple[str, ...] = field(repr=False)

    @property
    def agreeing(self) -> int:
        """Number of comparisons that agree."""
        return sum(item.agrees for item in self.comparisons)


def rounding(value: Callable[[np.ndarray], float], inputs: np.ndarray, half_step: float) -> float:
    """Furthest that rounding every input to the printed digits moves a computed value (linear)."""
    total = 0.0
    for i in np.ndindex(inputs.shape):
        low, high = inputs.copy(), inputs.copy()
        low[i] -= half_step
        high[i] += half_step
        total += abs(value(high) - value(low)) / 2
    return total


def compare(
    row: str, quantity: str, unit: str, published: float, ours: float, tolerance: float
) -> Comparison:
    """Two numbers side by side."""
    # 1e-9: a difference of printed decimals is exact but for the last bits.
    agrees = bool(abs(published - ours) <= tolerance + 1e-9)
    return Comparison(row, quantity, unit, published, float(ours), float(tolerance), agrees)


def compare_words(row: str, quantity: str, published: str, ours: str) -> Comparison:
    """Two words side by side."""
    return Comparison(row, quantity, "", published, ours, 0.0, published == ours)


def computed(
    number: str,
    title: str,
    found: Sequence[Comparison],
    *remarks: str,
    good: str = "reproduced",
    bad: str = "does not follow",
) -> PublishedTable:
    """A table whose outcome is `good` if every comparison agrees, else `bad`."""
    status = good if all(item.agrees for item in found) else bad
    return PublishedTable(number, title, status, tuple(found), remarks)
