"""How hard joints work: effort from joint torques, over the whole body and its areas.

The sound measures do not depend on how joint axes are signed or named: mean absolute torque, root
mean square, norm. Those of the published overhead study (Latella et al. 2021) are here beside them for
comparison; its reduction in Table I comes from the signed mean of all torques, which changes when an
axis is turned round, and is no effort.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._call import DataError
from .record import refuse

__all__ = [
    "AREAS",
    "Effort",
    "area_of",
    "effort",
    "published_mean_torque",
    "published_normalised_norm",
    "published_reduction",
    "working_frames",
]

Array = NDArray[np.float64]

AREAS = ("torso", "left arm", "right arm", "left leg", "right leg")
_LIMBS = {
    "arm": ("C7Shoulder", "Shoulder", "Elbow", "Wrist", "UpperArm", "ForeArm", "Hand"),
    "leg": ("Hip", "Knee", "Ankle", "BallFoot", "UpperLeg", "LowerLeg", "Foot", "Toe"),
}


def area_of(joint: str) -> str:
    """Area of the body that a joint belongs to, by its name in the suit's model.

    Examples
    --------
    >>> area_of("jRightC7Shoulder_rotx"), area_of("jL5S1_roty"), area_of("jLeftKnee_roty")
    ('right arm', 'torso', 'left leg')
    """
    body = joint.removeprefix("j").partition("_")[0]
    for side in ("Left", "Right"):
        if body.startswith(side):
            rest = body[len(side) :]
            for limb, names in _LIMBS.items():
                if rest in names:
                    return f"{side.lower()} {limb}"
            raise refuse(
                f"the joint {joint!r} belongs to no arm or leg: name its area yourself", "joint"
            )
    return "torso"


@dataclass(frozen=True, eq=False)
class Effort:
    """Effort of joints over the frames of a recording.

    Attributes
    ----------
    joints : tuple of str
    mean_abs_nm, rms_nm : ndarray, shape (joints,)
        Mean absolute torque and root mean square of each joint.
    norm_nm : float
        Mean over frames of the Euclidean norm of all torques.
    area_norm_nm : mapping of str to float
        The same of each area's joints.
    body_mass_kg : float or None
    frames, missing : int
        Used, and left out because a torque was missing.
    """

    joints: tuple[str, ...]
    mean_abs_nm: Array
    rms_nm: Array
    norm_nm: float
    area_norm_nm: Mapping[str, float]
    body_mass_kg: float | None
    frames: int
    missing: int

    @property
    def total_mean_abs_nm(self) -> float:
        """Mean absolute torque over joints and frames."""
        return float(self.mean_abs_nm.mean())

    @property
    def total_rms_nm(self) -> float:
        """Root mean square over joints and frames."""
        return float(np.sqrt(np.mean(self.rms_nm**2)))

    @property
    def norm_nm_kg(self) -> float:
        """Norm per kilogram of the body."""
        if self.body_mass_kg is None:
            raise refuse("give body_mass_kg to `effort` for an effort per kilogram", "body_mass_kg")
        return self.norm_nm / self.body_mass_kg

    def summary(self) -> str:
        """What was found, as text.

        Examples
        --------
        >>> torque = np.tile([3.0, -4.0], (100, 1))
        >>> print(effort(torque, joints=["jRightElbow_roty", "jL5S1_roty"]).summary())
        effort of 2 joints over 100 frames
        norm 5 Nm, mean absolute torque 3.5 Nm, root mean square 3.536 Nm
        torso 4 Nm, right arm 3 Nm
        """
        head = f"effort of {len(self.joints)} joints over {self.frames} frames"
        head += f", {self.missing} left out" if self.missing else ""
        whole = (
            f"norm {self.norm_nm:.4g} Nm, mean absolute torque {self.total_mean_abs_nm:.4g} Nm, "
            f"root mean square {self.total_rms_nm:.4g} Nm"
        )
        areas = ", ".join(f"{area} {norm:.4g} Nm" for area, norm in self.area_norm_nm.items())
        return "\n".join([head, whole, areas])

    def __repr__(self) -> str:
        return f"<Effort: norm {self.norm_nm:.4g} Nm over {self.frames} frames>"


def effort(
    torques_nm: ArrayLike,
    *,
    joints: Sequence[str] | None = None,
    areas: Sequence[str] | None = None,
    working: ArrayLike | None = None,
    body_mass_kg: float | None = None,
) -> Effort:
    """Effort from joint torques.

    Parameters
    ----------
    torques_nm
        Shape (frames, joints). Frames with a missing torque (NaN) are left out and counted.
    joints
        Names; ``"joint 1"`` and so on unless given.
    areas
        Area of each joint; by `area_of` where joints are named, one area ``"body"`` otherwise.
    working
        Frames that count, shape (frames,), as `working_frames` gives them: a block of pointing holds
        pauses with the arms down.
    body_mass_kg
        For an effort per kilogram.

    Returns
    -------
    Effort

    Examples
    --------
    >>> effort([[3.0, -4.0], [-3.0, 4.0]]).norm_nm
    5.0
    """
    torque = _torques(torques_nm, "torques_nm")
    count = torque.shape[1]
    names = tuple(joints) if joints is not None else tuple(f"joint {i + 1}" for i in range(count))
    if len(names) != count:
        raise refuse(f"joints has {len(names)} names for {count} torques", "joints")
    if areas is None:
        areas = [area_of(name) for name in names] if joints is not None else ["body"] * count
    if len(areas) != count:
        raise refuse(f"areas has {len(areas)} entries for {count} torques", "areas")
    if body_mass_kg is not None and not (np.isfinite(body_mass_kg) and body_mass_kg > 0):
        raise refuse("body_mass_kg must be positive", "body_mass_kg")
    chosen = _chosen(working, len(torque))
    whole = np.isfinite(torque).all(axis=1)
    used = torque[chosen & whole]
    if not len(used):
        raise DataError(
            "no frame has all torques: choose other frames or joints",
            status="ULNA_ERROR_DATA",
            argument="torques_nm",
        )
    order = [area for area in AREAS if area in areas]
    order += [area for area in dict.fromkeys(areas) if area not in AREAS]
    columns = {area: [i for i, own in enumerate(areas) if own == area] for area in order}
    return Effort(
        joints=names,
        mean_abs_nm=np.abs(used).mean(axis=0),
        rms_nm=np.sqrt(np.mean(used**2, axis=0)),
        norm_nm=float(np.linalg.norm(used, axis=1).mean()),
        area_norm_nm={
            area: float(np.linalg.norm(used[:, own], axis=1).mean())
            for area, own in columns.items()
        },
        body_mass_kg=body_mass_kg,
        frames=len(used),
        missing=int(np.count_nonzero(chosen & ~whole)),
    )


def working_frames(
    elevation_rad: ArrayLike,
    *,
    rate_hz: float,
    threshold_rad: float = np.radians(45.0),
    shortest_rest_s: float = 5.0,
) -> NDArray[np.bool_]:
    """Frames in which the arm works, without the pauses with the arm down.

    Parameters
    ----------
    elevation_rad
        Of the working arm, shape (frames,). A missing value belongs to what surrounds it.
    rate_hz
        Of the frames.
    threshold_rad
        An arm below it is down.
    shortest_rest_s
        A shorter stretch with the arm down is a movement, not a pause.

    Returns
    -------
    ndarray of bool, shape (frames,)

    Examples
    --------
    >>> angle = np.radians(np.repeat([90.0, 20.0, 90.0, 20.0, 90.0], [60, 30, 60, 600, 60]))
    >>> int(working_frames(angle, rate_hz=60).sum())
    210
    """
    angle = np.asarray(elevation_rad, dtype=float)
    if angle.ndim != 1:
        raise refuse(
            f"elevation_rad has the shape {angle.shape}, but (frames,) is expected", "elevation_rad"
        )
    if not rate_hz > 0:
        raise refuse("rate_hz must be positive", "rate_hz")
    if not shortest_rest_s >= 0:
        raise refuse("shortest_rest_s must not be negative", "shortest_rest_s")
    known = np.isfinite(angle)
    if not known.any():
        raise DataError(
            "the elevation of the arm is missing in every frame",
            status="ULNA_ERROR_DATA",
            argument="elevation_rad",
        )
    # The nearest known frame before, or after at the start, decides a missing one.
    last = np.maximum.accumulate(np.where(known, np.arange(len(angle)), -1))
    filled = angle[np.where(last < 0, int(np.argmax(known)), last)]
    down = filled < threshold_rad
    edges = np.flatnonzero(np.diff(np.concatenate([[False], down, [False]]).astype(int)))
    working = np.ones(len(angle), dtype=bool)
    for begin, end in edges.reshape(-1, 2):
        if (end - begin) / rate_hz >= shortest_rest_s:
            working[begin:end] = False
    return working


# As published -------------------------------------------------------------------------------------


def published_mean_torque(torques_nm: Sequence[ArrayLike]) -> float:
    """Equation (18): the signed mean over subjects, joints and frames.

    Parameters
    ----------
    torques_nm
        Of each subject, shape (frames, joints). Every subject counts alike. Missing values are left
        out.

    Examples
    --------
    >>> published_mean_torque([[[1.0, -3.0]], [[2.0, 2.0]]])
    0.5
    """
    means = [np.nanmean(_torques(torque, "torques_nm")) for torque in torques_nm]
    if not means or not np.all(np.isfinite(means)):
        raise refuse(
            "give the torques of at least one subject, none without any value", "torques_nm"
        )
    return float(np.mean(means))


def published_reduction(without: Sequence[ArrayLike], with_device: Sequence[ArrayLike]) -> float:
    """Table I: size of the change of the signed mean torque over its size without the device.

    It cannot tell a reduction from an increase, and another sign of one joint's axis changes it: use
    `effort` and `ulna.stats.compare_pairs` for a statement about effort.

    Parameters
    ----------
    without, with_device
        Torques of each subject, as for `published_mean_torque`.

    Examples
    --------
    >>> published_reduction([[[2.0, 2.0]]], [[[1.0, 0.0]]])
    0.75
    """
    before, after = published_mean_torque(without), published_mean_torque(with_device)
    if before == 0:
        raise refuse("the mean torque without the device is zero, so there is no ratio", "without")
    return abs(before - after) / abs(before)


def published_normalised_norm(norms: ArrayLike) -> Array:
    """Figures 7 and 8: values scaled to 0 at the smallest and 1 at the largest.

    Scaling by extremes makes subjects alike by force; tests belong on the values themselves.

    Parameters
    ----------
    norms
        Any shape; missing values stay missing.

    Examples
    --------
    >>> published_normalised_norm([20.0, 30.0, 25.0]).tolist()
    [0.0, 1.0, 0.5]
    """
    values = np.asarray(norms, dtype=float)
    if not np.isfinite(values).any() or np.nanmax(values) == np.nanmin(values):
        raise refuse("the values must differ to be scaled by their extremes", "norms")
    low, high = np.nanmin(values), np.nanmax(values)
    return np.asarray((values - low) / (high - low))


# Inside -------------------------------------------------------------------------------------------


def _torques(values: Any, name: str) -> Array:
    table = np.asarray(values, dtype=float)
    if table.ndim != 2 or not table.size:
        raise refuse(f"{name} has the shape {table.shape}, but (frames, joints) is expected", name)
    if np.isinf(table).any():
        row, column = np.argwhere(np.isinf(table))[0]
        raise DataError(
            f"the torque of frame {row}, joint {column} is infinite",
            status="ULNA_ERROR_DATA",
            argument=name,
            detail=f"row {row}",
        )
    return table


def _chosen(working: Any, frames: int) -> NDArray[np.bool_]:
    if working is None:
        return np.ones(frames, dtype=bool)
    chosen = np.asarray(working)
    if chosen.shape != (frames,) or chosen.dtype != bool:
        raise refuse(f"working must hold {frames} truth values, one a frame", "working")
    return chosen
