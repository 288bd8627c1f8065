"""What the source documents print, beside what comes out here.

:func:`impedance` goes through every table of Dyck (2013). What follows from other tables is computed
again; arms, rigs and the robot are simulated at the printed numbers and identified; what does not follow
from the thesis' own equations is marked, with the reason; what needs recordings that were not published is
named.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from . import _dyck2013 as dyck
from . import _validate_simulated as simulated
from ._page import document, table
from ._published import (
    Comparison,
    PublishedTable,
    compare,
    compare_words,
    computed,
    rounding,
)

__all__ = ["Comparison", "PublishedTable", "Validation", "impedance"]

_STATUS = {
    "reproduced": "good",
    "recovered": "good",
    "does not follow": "bad",
    "not recovered": "bad",
    "not published": "open",
}


@dataclass(frozen=True)
class Validation:
    """Every table of a document.

    Attributes
    ----------
    document : str
    tables : tuple of PublishedTable
    """

    document: str
    tables: tuple[PublishedTable, ...]

    def __getitem__(self, number: str) -> PublishedTable:
        for entry in self.tables:
            if entry.number == number:
                return entry
        raise KeyError(f"there is no table {number!r}: {', '.join(t.number for t in self.tables)}")

    def summary(self) -> str:
        """A line a table.

        Examples
        --------
        >>> import ulna
        >>> print(ulna.validate.impedance().summary().splitlines()[3])
        Table 3.3   reproduced       18 ellipses ...
        """
        lines = []
        for entry in self.tables:
            counted = ""
            if entry.comparisons:
                counted = f" ({entry.agreeing} of {len(entry.comparisons)} numbers agree)"
            lines.append(f"Table {entry.number:<5} {entry.status:<16} {entry.title}{counted}")
        return "\n".join(lines)

    def to_dict(self) -> dict[str, Any]:
        """Plain values, as ``ulna validate --json`` prints them."""
        return {
            "document": self.document,
            "tables": [
                {
                    "number": entry.number,
                    "title": entry.title,
                    "status": entry.status,
                    "remarks": list(entry.remarks),
                    "comparisons": [dict(vars(item)) for item in entry.comparisons],
                }
                for entry in self.tables
            ],
        }

    def write(self, path: Any) -> Path:
        """Write one HTML page with every table side by side; return its path."""
        target = Path(path)
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(_page(self), encoding="utf-8")
        return target


def impedance() -> Validation:
    """Go through the tables of Dyck (2013); takes about ten seconds of simulated experiments.

    Examples
    --------
    >>> import ulna
    >>> found = ulna.validate.impedance()
    >>> found["3.3"].status, found["3.6"].status
    ('reproduced', 'does not follow')
    """
    tables = [
        _ellipses("3.3", "3.2", "18 ellipses of the relaxed arm, sinusoidal perturbations"),
        _ellipses("3.5", "3.4", "6 ellipses of the relaxed arm, underdamped perturbations"),
        _excess(),
        _antisymmetry(),
        *(_verdicts(number) for number in ("3.2", "3.4", "4.1", "4.2")),
        _errors(),
        *simulated.tables(),
        *_unpublished(),
    ]
    return Validation("Dyck (2013)", tuple(sorted(tables, key=lambda entry: _order(entry.number))))


def _order(number: str) -> tuple[str, float, str]:
    chapter, _, rest = number.partition(".")
    digits = rest.rstrip("abcdefghijklmnopqrstuvwxyz, ")
    return chapter, float(digits or 0), rest


# What follows from printed numbers ---------------------------------------------------------------


def _ellipses(number: str, source: str, title: str) -> PublishedTable:
    from .impedance import ellipse

    half = {"M": 0.005, "B": 0.005, "K": 0.005}  # two decimals are printed
    fields = (("area", "A", 0.05), ("shape", "R", 0.05), ("angle_deg", "θ", 0.05))
    found = []
    for row, arm in dyck.arms(source).items():
        matrices = (("M", arm.m), ("B", arm.b), ("K", arm.k))
        for (name, matrix), printed in zip(matrices, dyck.ELLIPSES[number][row], strict=True):
            for (attribute, symbol, step), published in zip(fields, printed, strict=True):

                def value(entries: np.ndarray, attribute: str = attribute) -> float:
                    return float(getattr(ellipse(entries), attribute))

                tolerance = step + rounding(value, matrix, half[name])
                found.append(
                    compare(
                        row, f"{symbol} of {name}", "°" if symbol == "θ" else "",
                        published, value(matrix), tolerance,
                    )
                )  # fmt: skip
    return computed(
        number, title, found,
        f"Computed from the matrices of Table {source} by (3.14) to (3.17), the angle by atan2 "
        "modulo 180°. Numbers may differ by the rounding of what is printed there.",
    )  # fmt: skip


def _excess() -> PublishedTable:
    found = []
    impossible = []
    for (source, row), published in dyck.EXCESS.items():
        b = dyck.arms(source)[row].b

        def least(entries: np.ndarray) -> float:
            return float(np.linalg.eigvalsh((entries + entries.T) / 2)[0])

        word = f"{row}, {'sinusoidal' if source == '3.2' else 'underdamped'}"
        tolerance = 0.05 + rounding(least, b, 0.005)
        found.append(compare(word, "δ", "N s/m", published, least(b), tolerance))
        if published > b.diagonal().min():
            impossible.append(row if source == "3.2" else f"{row} underdamped")
    return computed(
        "3.6", "Excess of passivity of the relaxed arm", found,
        "By Theorem 3.1 with (3.27), Z(jω) + Z(jω)ᴴ = B + Bᵀ at every frequency, so the excess is "
        "the smallest eigenvalue of (B + Bᵀ)/2. The printed values are not.",
        f"For {', '.join(impossible)} the printed value is above b_xx, which no such eigenvalue "
        "can be.",
    )  # fmt: skip


def _antisymmetry() -> PublishedTable:
    from .impedance import ellipse

    found = []
    for row, arm in dyck.arms("3.2").items():
        ours = ellipse(arm.k).antisymmetry

        def value(entries: np.ndarray) -> float:
            return float(ellipse(entries).antisymmetry)

        tolerance = rounding(value, arm.k, 0.005)
        if row == "P1":
            found.append(
                compare(row, "z_mean of K", "%", 100 * dyck.ANTISYMMETRY_P1, 100 * ours,
                        0.05 + 100 * tolerance)
            )  # fmt: skip
        word = "under 15 %" if ours < dyck.ANTISYMMETRY_BOUND + tolerance else "above 15 %"
        found.append(compare_words(row, f"{100 * ours:.1f} % is", "under 15 %", word))
    return computed(
        "3.6a", "Antisymmetry of the stiffness (section 3.6.1.2, Figures 3.12 and 3.13)", found,
        "(3.26) applied to the mean matrices of Table 3.2. The text has 11.5 % for P1 and less than "
        "15 % for all; the means give 8.5 % and, for P6, 16.4 %. Values of single trials, which the "
        "thesis may have averaged, are not published.",
    )  # fmt: skip


_WORD = {True: "passive", False: "not passive"}


def _verdicts(number: str) -> PublishedTable:
    from .passivity import of_model

    found = []
    reasons = []
    for row, arm in dyck.arms(number).items():
        margins = of_model(arm.m, arm.b, arm.k)
        found.append(
            compare_words(row, "verdict", _WORD[bool(arm.passive)], margins.verdict)
        )
        if found[-1].agrees:
            continue
        for name, share in (("M", margins.antisymmetry_m), ("K", margins.antisymmetry_k)):
            if share > dyck.ANTISYMMETRY_BOUND:
                reasons.append(
                    f"{row}: the antisymmetric part of {name} is {100 * share:.1f} % by (3.26), "
                    "more than the 15 % below which the thesis leaves it out."
                )
    title = {
        "3.2": "Verdicts on the relaxed arm, sinusoidal perturbations",
        "3.4": "Verdicts on the relaxed arm, underdamped perturbations",
        "4.1": "Verdicts on the rigid arm, underdamped perturbations",
        "4.2": "Verdicts on the rigid arm, sinusoidal perturbations",
    }[number]
    remarks = [
        "Theorem 3.2 by the eigenvalues of the symmetric parts of M, B and K (the printed minors "
        "miss three conditions), antisymmetry of M and K left out below 15 %.",
        *reasons,
    ]
    if number in ("4.1", "4.2"):
        remarks.append(
            "All of these models are active, whatever their validity: "
            + ("B is indefinite." if number == "4.1" else "M is indefinite.")
        )
    return computed(f"{number}a", title, found, *remarks)


def _errors() -> PublishedTable:
    """Table 5.4 is printed as identified minus theoretical; its entries are the opposite."""
    found = []
    for method in (0, 1):
        for row, entries in dyck.STIFFNESS_54.items():
            theory, identified = dyck.SPRINGS_51[row], dyck.STIFFNESS_53[row][method]
            for i, name in enumerate(("k_xx", "k_yy", "k_s")):
                found.append(
                    compare(f"{row}, method {method + 1}", name, "N/m", entries[method][i],
                            theory[i] - identified[i], 0.015)
                )  # fmt: skip
        for row, entries in dyck.MASSES_54.items():
            ours = dyck.MASSES_51[row] - dyck.MASSES_53[row][method]
            found.append(
                compare(f"{row}, method {method + 1}", "m", "kg", entries[method], ours, 0.0015)
            )
    return computed(
        "5.4", "Errors of the mass-spring systems", found,
        "The text defines error = identified − theoretical; every entry is theoretical (Table 5.1) "
        "− identified (Table 5.3). Ours are computed with the second sign.",
    )  # fmt: skip


def _unpublished() -> list[PublishedTable]:
    return [
        PublishedTable(
            "5.3", "Mass-spring systems identified on the robot", "not published", (),
            ("The recordings and the rates of the springs are not published. Table 5.4 ties its "
             "means to Table 5.1.",),
        ),
        PublishedTable(
            "4.4", "Models of the rigid arm along one axis", "not published", (),
            ("VAF of −3 to 70 % on five recordings of P2 that are not published.",),
        ),
        PublishedTable(
            "5.5", "VAF by the virtual sensor", "not published", (),
            ("It measures the friction and the cables of one robot, whose recordings are not "
             "published.",),
        ),
    ]  # fmt: skip


# The page ----------------------------------------------------------------------------------------


def _page(found: Validation) -> str:
    counts: dict[str, int] = {}
    for entry in found.tables:
        counts[entry.status] = counts.get(entry.status, 0) + 1
    plural = {"does not follow": "do not follow"}
    words = ", ".join(
        f"{count} {plural.get(status, status) if count > 1 else status}"
        for status, count in counts.items()
    )
    parts = [
        f"<h1>{escape(found.document)}, table by table</h1>",
        f'<p class="source">{len(found.tables)} tables: {escape(words)}. In every cell the printed '
        "value stands above <b>ours</b>. What disagrees is marked ✗.</p>",
        table(
            ("Table", "What", "Outcome", "Agree"),
            [
                (
                    f'<a href="#t{entry.number}">{entry.number}</a>',
                    escape(entry.title),
                    escape(entry.status),
                    f"{entry.agreeing} of {len(entry.comparisons)}" if entry.comparisons else "–",
                )
                for entry in found.tables
            ],
            words=(1, 2),
        ),
        *[_section(entry) for entry in found.tables],
    ]
    return document(f"{found.document}, table by table", parts)


def _section(entry: PublishedTable) -> str:
    kind = _STATUS[entry.status]
    remarks = "".join(f"<p>{escape(remark)}</p>" for remark in entry.remarks)
    return (
        f'<h2 id="t{entry.number}">Table {entry.number} · {escape(entry.title)}</h2>'
        f'<section class="verdict {kind}"><p><b>{escape(entry.status.capitalize())}</b></p>'
        f"{remarks}</section>{_cells(entry)}"
    )


def _cells(entry: PublishedTable) -> str:
    if not entry.comparisons:
        return ""
    rows = list(dict.fromkeys(item.row for item in entry.comparisons))
    quantities = list(dict.fromkeys(item.quantity for item in entry.comparisons))
    units = {item.quantity: item.unit for item in entry.comparisons}
    at = {(item.row, item.quantity): item for item in entry.comparisons}
    if len(quantities) == 1 or len(quantities) > 9:  # too narrow or too wide: a line a number
        return table(
            ("Row", "Quantity", "Printed", "Ours", ""),
            [
                (escape(item.row), escape(item.quantity), _shown(item.published, item),
                 f"<b>{_shown(item.ours, item, more=1)}</b>", "" if item.agrees else "✗")
                for item in entry.comparisons
            ],
            dense=True,
        )  # fmt: skip
    head = ["", *(escape(q) + (f" ({escape(units[q])})" if units[q] else "") for q in quantities)]
    body = [[escape(row), *(_pair(at.get((row, q))) for q in quantities)] for row in rows]
    return table(head, body, dense=True)


def _pair(item: Comparison | None) -> str:
    if item is None:
        return ""
    mark = "" if item.agrees else " ✗"
    return (
        f'<span class="soft">{_shown(item.published, item)}</span><br>'
        f"<b>{_shown(item.ours, item, more=1)}</b>{mark}"
    )


def _shown(value: float | str, item: Comparison, *, more: int = 0) -> str:
    """As many decimals as are printed, and `more`."""
    if isinstance(value, str):
        return escape(value)
    if not math.isfinite(value):
        return "–"
    decimals = len(repr(float(item.published)).partition(".")[2])
    return f"{value:.{decimals + more}f}".replace("-", "−")
