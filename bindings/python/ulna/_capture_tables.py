"""A capture's torques as text and as tables."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ._capture_motion import mean_of, rms_of

if TYPE_CHECKING:
    from .capture import RecordedTorques

BALANCE = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
SEVERITIES = ("error", "warning", "note")


def joint_rows(found: RecordedTorques) -> list[dict[str, Any]]:
    """What is told of each joint over the frames, NaN left out."""
    torques = found.torques
    above = found.from_above
    out = []
    for k, joint in enumerate(torques.joints):
        torque, spread = torques.torque[:, k], torques.torque_deviation[:, k]
        known = np.isfinite(torque)
        row: dict[str, Any] = {"joint": joint}
        if known.any():
            row |= {
                "lowest_nm": float(torque[known].min()),
                "highest_nm": float(torque[known].max()),
                "mean_abs_nm": float(np.abs(torque[known]).mean()),
                "rms_nm": float(np.sqrt(np.mean(torque[known] ** 2))),
                "deviation_nm": float(np.median(spread[known])),
            }
        if above is not None and found.from_below is not None:
            top, below = above[:, k], found.from_below[:, k]
            row |= {
                "from_above_lowest_nm": float(np.nanmin(top)),
                "from_above_highest_nm": float(np.nanmax(top)),
                "above_less_below_rms_nm": float(rms_of((top - below)[:, None])[0]),
            }
        out.append(row)
    return out


def balance_rms(found: RecordedTorques) -> dict[str, float]:
    """Root mean square of what the measured wrenches lack, by component (N, N m)."""
    rms = rms_of(found.balance)
    return dict(zip(BALANCE, rms.tolist(), strict=True))


def shown(value: float) -> str:
    """Three figures, and a dash for what is not known."""
    return "–" if value != value else f"{value:.3g}"


def summary_of(found: RecordedTorques) -> str:
    """As text."""
    frames, torques = found.frames, found.torques
    duration = frames.time_s[-1] - frames.time_s[0]
    lines = [
        f"{len(frames)} frames at {frames.rate_hz:.6g} Hz, {duration:.4g} s: "
        f"{int(torques.bridged.sum())} bridged, {torques.unusable} without a state",
        f"body {found.body.mass_kg:.5g} kg, {len(found.body.joints)} joints; "
        f"{len(frames.suite.sensors)} sensors, {len(frames.contacts)} contacts"
        + (", a device is worn" if frames.device is not None else ""),
    ]
    if found.start is not None:
        lines.append(found.start.summary().splitlines()[0])
    rms = balance_rms(found)
    lines.append(
        "balance lacks, RMS: "
        + ", ".join(f"{name} {shown(value)}" for name, value in rms.items())
        + f" (N, N m); NIS {shown(mean_of(torques.balance_nis))}, 6 expected"
    )
    lines.append("")
    lines.append(f"{'joint':<22}{'lowest':>9}{'highest':>9}{'RMS':>9}{'±':>8}   N m")
    for row in joint_rows(found):
        if "rms_nm" not in row:
            lines.append(f"{row['joint']:<22}{'not known':>9}")
            continue
        lines.append(
            f"{row['joint']:<22}{row['lowest_nm']:>9.3g}{row['highest_nm']:>9.3g}"
            f"{row['rms_nm']:>9.3g}{row['deviation_nm']:>8.2g}"
        )
    above = [row for row in joint_rows(found) if "from_above_lowest_nm" in row]
    for row in above:
        lines.append(
            f"{row['joint']} from above: {row['from_above_lowest_nm']:.1f} to "
            f"{row['from_above_highest_nm']:.1f} N m, off from below by "
            f"{shown(row['above_less_below_rms_nm'])} RMS"
        )
    lines += ["", *(f"{f.severity}: {f.message}" for f in by_severity(found))]
    lines += [f"note: {note}" for note in frames.notes]
    return "\n".join(lines).rstrip()


def plain_result(found: RecordedTorques) -> dict[str, Any]:
    """What scripts read: everything but the series, which are in the tables."""
    frames, torques, start = found.frames, found.torques, found.start
    return {
        "files": list(frames.sources),
        "body": {
            "file": frames.setup.source,
            "mass_kg": found.body.mass_kg,
            "links": len(found.body.links),
            "joints": len(found.body.joints),
        },
        "frames": len(frames),
        "rate_hz": frames.rate_hz,
        "duration_s": float(frames.time_s[-1] - frames.time_s[0]),
        "bridged": int(torques.bridged.sum()),
        "without_state": torques.unusable,
        "sound": found.sound,
        "findings": [
            {"severity": f.severity, "code": f.code, "channel": f.channel, "message": f.message}
            for f in by_severity(found)
        ],
        "start": None
        if start is None
        else {
            "carried_kg": start.carried_kg,
            "model_kg": start.model_kg,
            "pressure_m": start.pressure_m,
            "centre_m": start.centre_m,
        },
        "joints": joint_rows(found),
        "balance_rms": balance_rms(found),
        "balance_nis": mean_of(torques.balance_nis),
        "variances": "given" if found.fit is None else "data",
        "deviations": dict(zip(frames.suite.rows, frames.suite.deviation.tolist(), strict=True)),
        "clocks": {
            label: {
                "offset_s": fit.offset_s,
                "offset_error_s": fit.offset_error_s,
                "drift": fit.drift,
            }
            for label, fit in frames.clocks.items()
        },
        "notes": list(frames.notes),
    }


def by_severity(found: RecordedTorques) -> list[Any]:
    """Findings, the worst first."""
    return sorted(found.findings, key=lambda f: SEVERITIES.index(f.severity))


def write_tables(found: RecordedTorques, folder: Any) -> tuple[Path, ...]:
    """``torques.csv``, ``balance.csv`` and ``joints.csv``."""
    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    torques, joints = found.torques, found.torques.joints
    time = found.time_s[:, None]
    heads = ["time_s", *(f"{j}_Nm" for j in joints), *(f"{j}_sd_Nm" for j in joints), "bridged"]
    table = [time, torques.torque, torques.torque_deviation, torques.bridged[:, None]]
    _write(target / "torques.csv", heads, np.hstack(table))
    units = ["N"] * 3 + ["Nm"] * 3
    heads = ["time_s", *(f"{n}_{u}" for n, u in zip(BALANCE, units, strict=True)),
             *(f"{n}_sd_{u}" for n, u in zip(BALANCE, units, strict=True)), "nis"]  # fmt: skip
    table = [time, found.balance, torques.residual_deviation, torques.balance_nis[:, None]]
    _write(target / "balance.csv", heads, np.hstack(table))
    rows = joint_rows(found)
    keys = list(dict.fromkeys(key for row in rows for key in row))
    with (target / "joints.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, keys, restval="")
        writer.writeheader()
        writer.writerows(rows)
    return target / "torques.csv", target / "balance.csv", target / "joints.csv"


def _write(path: Path, heads: list[str], table: np.ndarray) -> None:
    """A missing number is an empty cell."""
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(",".join(heads) + "\n")
        for row in table:
            file.write(",".join("" if v != v else f"{v:.9g}" for v in row.tolist()) + "\n")
