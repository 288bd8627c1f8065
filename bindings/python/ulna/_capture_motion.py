"""Quantities of a moving body where its state is known, and NaN where it is missing.

The body itself refuses a state that holds NaN; a capture has gaps.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .body import Body, Motion

Array = NDArray[np.float64]


def known_frames(motion: Motion) -> NDArray[np.bool_]:
    """Frames in which nothing of the motion is missing, its accelerations included."""
    parts = [np.asarray(v, dtype=float) for v in vars(motion).values() if v is not None]
    return np.asarray(np.all([np.isfinite(part).all(axis=1) for part in parts], axis=0))


def frames_of(motion: Motion, rows: Any) -> Motion:
    """Some frames of a motion."""
    return Motion(**{
        name: None if value is None else np.asarray(value)[rows]
        for name, value in vars(motion).items()
    })  # fmt: skip


def where_known(motion: Motion, compute: Callable[[Motion], tuple[Array, ...]]) -> list[Array]:
    """Arrays that `compute` gives of a motion, frames first; NaN at frames that are not known."""
    known = known_frames(motion)
    if known.all():
        return list(compute(motion))
    if not known.any():
        # One frame at rest tells the shapes.
        joints = np.asarray(motion.angle).shape[1]
        found = compute(Motion(np.zeros((1, joints))))
    else:
        found = compute(frames_of(motion, known))
    out = []
    for part in found:
        whole = np.full((len(known), *part.shape[1:]), np.nan)
        if known.any():
            whole[known] = part
        out.append(whole)
    return out


def poses_of(body: Body, motion: Motion) -> Array:
    """As `Body.poses`."""
    return where_known(motion, lambda m: (body.poses(m),))[0]


def felt_at(body: Body, motion: Motion, link: str) -> list[Array]:
    """As `Body.sensor` at the origin of a link."""
    return where_known(motion, lambda m: body.sensor(m, link=link))


def lift_of(body: Body, motion: Motion) -> Array:
    """Vertical force that the motion needs, N, (frames,)."""
    weight = body.mass_kg * body.gravity_m_s2
    rate = where_known(motion, lambda m: (body.centroid(m).momentum_rate,))[0]
    return rate[:, 2] + weight


def newton_euler(body: Body, motion: Motion) -> list[Array]:
    """As `Body.inverse_dynamics` without external wrenches."""
    return where_known(motion, body.inverse_dynamics)


def mean_of(values: Array) -> float:
    """Of what is not missing; NaN of nothing."""
    there = values[np.isfinite(values)]
    return float(there.mean()) if there.size else float("nan")


def rms_of(values: Array) -> Array:
    """Root mean square of each column, of what is not missing."""
    return np.sqrt([mean_of(column**2) for column in np.asarray(values).T])


def median_of(values: Array) -> Array:
    """Median of each column, of what is not missing."""
    columns = [column[np.isfinite(column)] for column in np.asarray(values).T]
    return np.array([np.median(column) if column.size else np.nan for column in columns])
