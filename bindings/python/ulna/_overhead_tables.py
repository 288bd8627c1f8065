"""The overhead study as tables: names in the first row, values below."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from .effort import AREAS, area_of

if TYPE_CHECKING:
    from .overhead import OverheadStudy
    from .stats import Interval

Table = list[list[Any]]

_SESSIONS = ("without", "with")
# For the analysis of variance: the whole body, its areas, and the joints that the device is for.
TESTED = ("norm", "mean absolute", *AREAS, "left shoulder", "right shoulder")


def tables(study: OverheadStudy) -> Mapping[str, Sequence[Sequence[Any]]]:
    """All of them, by name."""
    return {
        "cohort": _cohort(study),
        "effort": _effort(study),
        "change": _change(study),
        "table-1": _published(study),
        "anova": _anova(study),
        "joints": _joints(study),
        "coverage": _coverage(study),
    }


def _cohort(study: OverheadStudy) -> Table:
    rows: Table = [["subject", "height_m", "mass_kg", "first_session", "device_peak_N"]]
    for one in study.subjects:
        first = _SESSIONS[one.device_first]
        rows.append([one.name, one.height_m, one.mass_kg, first, one.support_n])
    return rows


def _effort(study: OverheadStudy) -> Table:
    from .overhead import MEASURES

    names = [*MEASURES, "signed mean"]
    measured = {name: study.values(name) for name in names}
    true = study.values("norm", true=True)
    head = ["subject", "session", "block"]
    head += [f"{name} (Nm/kg)" if name.endswith("per kg") else f"{name} (Nm)" for name in names]
    rows: Table = [[*head, "true norm (Nm)"]]
    for s, subject in enumerate(study.subjects):
        for w, session in enumerate(_SESSIONS):
            for b in range(study.protocol.blocks):
                values = [float(measured[name][s, w, b]) for name in names]
                rows.append([subject.name, session, b + 1, *values, float(true[s, w, b])])
    return rows


def _entries(interval: Interval, i: int) -> list[float]:
    return [float(interval.value[i]), float(interval.low[i]), float(interval.high[i])]


def _change(study: OverheadStudy) -> Table:
    from .overhead import MEASURES

    found, true = study.change(MEASURES), study.change(MEASURES, true=True)
    rows: Table = [["measure", "without", "with"]]
    for word in ("difference", "relative", "standardised"):
        rows[0] += [word, f"{word}_low", f"{word}_high"]
    rows[0].append("true_relative")
    for i, name in enumerate(MEASURES):
        means = [float(v) for v in study.values(name).mean(axis=(0, 2))]
        parts = [_entries(p, i) for p in (found.difference, found.relative, found.standardised)]
        rows.append([name, *means, *(v for p in parts for v in p), float(true.relative.value[i])])
    return rows


def _published(study: OverheadStudy) -> Table:
    found = study.published
    rows: Table = [["block", "signed_without_Nm", "signed_with_Nm", "published_reduction"]]
    for word in ("norm", "mean_absolute"):
        rows[0] += [f"{word}_change", f"{word}_low", f"{word}_high"]
    for b in range(study.protocol.blocks):
        signed = [float(v[b]) for v in (found.without_nm, found.with_nm, found.reduction)]
        parts = [*_entries(found.norm.relative, b), *_entries(found.mean_abs.relative, b)]
        rows.append([b + 1, *signed, *parts])
    return rows


def _anova(study: OverheadStudy) -> Table:
    rows: Table = [["measure", "effect", "F", "dof", "error_dof", "p", "epsilon", "p_corrected",
                    "partial_eta_squared"]]  # fmt: skip
    for name in TESTED:
        for effect in study.anova(name).effects:
            rows.append([name, effect.name, effect.f, effect.dof, effect.error_dof, effect.p,
                         effect.epsilon, effect.p_corrected, effect.partial_eta_squared])  # fmt: skip
    return rows


def _joints(study: OverheadStudy) -> Table:
    mean = study.joint_values().mean(axis=2)
    true = study.joint_values(true=True).mean(axis=(0, 2))
    change = mean[:, 1] - mean[:, 0]
    error = change.std(axis=0, ddof=1) / np.sqrt(len(change))
    rows: Table = [["joint", "area", "without_Nm", "with_Nm", "change_Nm", "standard_error_Nm",
                    "true_change_Nm"]]  # fmt: skip
    for j, name in enumerate(study.joints):
        rows.append(
            [name, area_of(name), *(float(v) for v in mean[:, :, j].mean(axis=0)),
             float(change[:, j].mean()), float(error[j]), float(true[1, j] - true[0, j])]
        )  # fmt: skip
    return rows


def _coverage(study: OverheadStudy) -> Table:
    found = study.coverage
    rows: Table = [["joint", "inside", "error_rms_Nm", "stated_rms_Nm", "of_sensors_Nm",
                    "of_posture_Nm"]]  # fmt: skip
    for j, name in enumerate(found.joints):
        columns = (found.share, found.error_nm, found.deviation_nm, found.sensor_nm,
                   found.posture_nm)  # fmt: skip
        rows.append([name, *(float(column[j]) for column in columns)])
    rows.append(["all", found.overall, *[""] * 4])
    return rows
