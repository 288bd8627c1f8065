"""Passive devices that carry the arms, such as an exoskeleton for overhead work.

A spring mechanism on a hip belt pushes both upper arms up with a force that depends on their
elevation. The device is in balance: what it gives to the arms it takes from the hip, so the wrenches
on the person sum to its own weight and to no moment.

Global frame: z up unless `up` says otherwise. Elevation is 0 with the arm hanging, 90° with it
horizontal. All wrenches are those of the device on the person, forces in N and moments in Nm, in the
global frame. Axis 0 is the frame, axis 1 the arm: left, right. See Latella et al. 2021.
"""

from __future__ import annotations

import csv
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._call import DataError, FileError, FormatError, lib, options, out_array, view
from .record import refuse

__all__ = [
    "DeviceWrenches",
    "ForceCurve",
    "ForceTable",
    "PassiveDevice",
    "elevation",
    "elevation_of_joints",
    "published_wrenches",
    "read_force_table",
    "zxy_angles",
]

Array = NDArray[np.float64]

SIDES = ("left", "right")
# Where the device holds the upper arm, as a share of its length from the shoulder.
ATTACHMENT = 0.6895

_COLUMNS = {
    "F_support_N": "support_n",
    "F_shear_N": "shear_n",
    "F_hip_x_N": "hip_x_n",
    "F_hip_y_N": "hip_y_n",
}


# Elevation of the arm -----------------------------------------------------------------------------


def elevation(direction: ArrayLike, *, up: ArrayLike = (0.0, 0.0, 1.0)) -> Array:
    """Angle of the upper arm from hanging, by geometry, 0 to pi.

    Parameters
    ----------
    direction
        From the shoulder to the elbow, shape (..., 3), any length.
    up
        Of the world, or of the trunk for the angle relative to it; shape (3,) or as `direction`.

    Returns
    -------
    ndarray, shape (...)
        In rad.

    Examples
    --------
    >>> np.degrees(elevation([[0, 0, -1], [1, 0, 0], [0, 1, 1]])).round(12)
    array([  0.,  90., 135.])
    """
    arms, vertical = _vectors(direction, "direction"), _vectors(up, "up")
    _refuse_no_length(arms, "direction")
    _refuse_no_length(vertical, "up")
    try:
        vertical = np.broadcast_to(vertical, arms.shape)
    except ValueError:
        raise refuse(
            f"up has the shape {vertical.shape}, which does not go with {arms.shape}", "up"
        ) from None
    rows, ups = view(arms.reshape(-1, 3)), view(vertical.reshape(-1, 3))
    return np.asarray(out_array(lib.ulna_arm_elevation, rows, ups)).reshape(arms.shape[:-1])


def zxy_angles(angles_rad: ArrayLike) -> Array:
    """The same rotation in the sequence ZXY instead of XYZ (equations 13 to 16).

    Parameters
    ----------
    angles_rad
        Shape (..., 3): u_x, u_y, u_z of R = R_x R_y R_z, as the three joints of the shoulder.

    Returns
    -------
    ndarray, shape (..., 3)
        u'_x, u'_y, u'_z of R = R_z R_x R_y. Where u'_x is a right angle the other two turn about one
        line: they are NaN within 1e-7 of it.

    Examples
    --------
    >>> zxy_angles([0.3, 0.0, 0.0]).round(12)
    array([0.3, 0. , 0. ])
    """
    u = _vectors(angles_rad, "angles_rad")
    turned = out_array(lib.ulna_shoulder_zxy, view(u.reshape(-1, 3)))
    return np.asarray(turned).reshape(u.shape) + 0.0  # no negative zeros


def elevation_of_joints(angles_rad: ArrayLike, *, side: str) -> Array:
    """Elevation from the shoulder's joint angles, as published: pi/2 plus or minus u'_x.

    In the neutral pose the arms point to the sides, the left along y. Equal to `elevation` of the arm
    relative to the frame in which the angles are given.

    Parameters
    ----------
    angles_rad
        As for `zxy_angles`.
    side : {"left", "right"}

    Examples
    --------
    >>> float(np.degrees(elevation_of_joints([-np.pi / 4, 0, 0], side="left")).round(12))
    45.0
    """
    if side not in SIDES:
        raise refuse(f"side is {side!r}: it must be 'left' or 'right'", "side")
    sign = 1.0 if side == "left" else -1.0
    return np.pi / 2 + sign * zxy_angles(angles_rad)[..., 0]


# Force over elevation -----------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class ForceCurve:
    """Force of a device on one arm over the elevation of that arm.

    Linear between the entries, and from the first one to nothing at 0, the hanging arm. Above the last
    angle its value is held, and `DeviceWrenches.outside` marks the frames.

    Attributes
    ----------
    angle_rad : ndarray, shape (n,)
        Increasing.
    support_n : ndarray, shape (n,)
        Perpendicular to the arm, positive upward.
    shear_n : ndarray, shape (n,)
        Along the arm, positive toward the elbow.
    hip_x_n, hip_y_n : ndarray, shape (n,)
        Force at the hip as the table gives it; only the published mapping uses it.
    """

    angle_rad: Array
    support_n: Array
    shear_n: Array
    hip_x_n: Array
    hip_y_n: Array

    @classmethod
    def parametric(
        cls,
        *,
        peak_n: float,
        onset_rad: float = np.radians(10.0),
        peak_rad: float = np.radians(104.5),
        exponent: float = 1.5,
    ) -> ForceCurve:
        """A smooth bump: peak_n sin(pi/2 (angle - onset) / (peak - onset)) ^ exponent.

        Parameters
        ----------
        peak_n
            Largest support.
        onset_rad
            Below it there is no force.
        peak_rad
            Where the force is largest; the curve is symmetric about it.
        exponent
            1 to 4: how gently it begins.

        Examples
        --------
        >>> curve = ForceCurve.parametric(peak_n=35)
        >>> float(curve.support(np.radians(104.5)).round(6)), float(curve.support(0.0))
        (35.0, 0.0)
        """
        if not (np.isfinite(peak_n) and 0 <= onset_rad < peak_rad <= np.pi and 1 <= exponent <= 4):
            raise refuse(
                "a curve needs a finite peak_n, 0 <= onset_rad < peak_rad <= pi and an exponent from "
                "1 to 4",
                "peak_n",
            )
        # Half-degree steps: linear interpolation then errs by less than 1e-4 of the peak.
        angle = np.unique(np.concatenate([np.radians(np.arange(0, 180.25, 0.5)), [peak_rad]]))
        phase = np.clip((angle - onset_rad) / (peak_rad - onset_rad), 0, 2)
        support = peak_n * np.clip(np.sin(np.pi / 2 * phase), 0, None) ** exponent
        none = np.zeros_like(angle)
        return cls(angle, support, none, none, none)

    def scaled(self, factor: float) -> ForceCurve:
        """All forces times a factor, as the lever of the device sets it.

        Examples
        --------
        >>> float(ForceCurve.parametric(peak_n=30).scaled(0.5).support_n.max().round(6))
        15.0
        """
        if not np.isfinite(factor):
            raise refuse("the factor must be finite", "factor")
        forces = {name: factor * getattr(self, name) for name in _COLUMNS.values()}
        return replace(self, **forces)

    def support(self, elevation_rad: ArrayLike) -> Array:
        """Support in N at elevations in rad."""
        return self._at(elevation_rad, "support_n")

    def shear(self, elevation_rad: ArrayLike) -> Array:
        """Force along the arm in N at elevations in rad."""
        return self._at(elevation_rad, "shear_n")

    def outside(self, elevation_rad: ArrayLike) -> NDArray[np.bool_]:
        """Where an elevation is above the last angle of the curve."""
        # Entries of a table in degrees are rounded when they become rad.
        return np.asarray(np.asarray(elevation_rad, dtype=float) > self.angle_rad[-1] + 1e-9)

    def _at(self, elevation_rad: ArrayLike, name: str) -> Array:
        angle, force = self.angle_rad, getattr(self, name)
        if angle[0] > 0:
            angle, force = np.concatenate([[0.0], angle]), np.concatenate([[0.0], force])
        return np.asarray(np.interp(np.asarray(elevation_rad, dtype=float), angle, force))

    def __repr__(self) -> str:
        at = int(np.argmax(self.support_n))
        return (
            f"<ForceCurve: {np.degrees(self.angle_rad[0]):g} to {np.degrees(self.angle_rad[-1]):g} deg, "
            f"{self.support_n[at]:.1f} N at {np.degrees(self.angle_rad[at]):.1f} deg>"
        )


@dataclass(frozen=True, eq=False)
class ForceTable:
    """Measured force curves of several subjects, as `read_force_table` gives them.

    Attributes
    ----------
    curves : mapping of str to ForceCurve
        By subject.
    """

    curves: Mapping[str, ForceCurve]

    @property
    def subjects(self) -> tuple[str, ...]:
        """Names of the subjects."""
        return tuple(self.curves)

    def of(self, subject: str | int) -> ForceCurve:
        """The curve of a subject, exact at the angles of the table."""
        try:
            return self.curves[str(subject)]
        except KeyError:
            raise refuse(
                f"there is no subject {subject!r}; there are {', '.join(self.curves)}", "subject"
            ) from None

    @cached_property
    def mean(self) -> ForceCurve:
        """Mean of all subjects, up to the largest angle that everyone has."""
        curves = list(self.curves.values())
        end = min(curve.angle_rad[-1] for curve in curves)
        angle = np.unique(np.concatenate([curve.angle_rad for curve in curves]))
        # Equal degrees of two subjects may differ by rounding.
        angle = angle[np.concatenate([[True], np.diff(angle) > 1e-9])]
        angle = angle[angle <= end + 1e-9]
        forces = {
            name: np.mean([c._at(angle, name) for c in curves], axis=0)
            for name in _COLUMNS.values()
        }
        return ForceCurve(angle, **forces)

    def scale_of(self, subject: str | int) -> float:
        """The factor by which the mean curve is nearest to a subject's support.

        Examples
        --------
        >>> table = ForceTable({"1": ForceCurve.parametric(peak_n=30),
        ...                     "2": ForceCurve.parametric(peak_n=40)})
        >>> round(table.scale_of(2), 6)
        1.142857
        """
        mean, own = self.mean, self.of(subject)
        inside = ~own.outside(mean.angle_rad)
        measured = own.support(mean.angle_rad[inside])
        basis = mean.support_n[inside]
        power = float(basis @ basis)
        if power == 0:
            raise refuse("the mean curve has no support, so nothing can be scaled", "subject")
        return float(basis @ measured) / power

    def fit(self, subject: str | int | None = None) -> ForceCurve:
        """The parametric curve nearest to a subject, or to the mean (needs SciPy)."""
        try:
            from scipy.optimize import least_squares
        except ImportError as failure:
            raise ImportError(
                "a fit needs SciPy: install it with `pip install ulna[io]`"
            ) from failure
        curve = self.mean if subject is None else self.of(subject)
        angle, support = curve.angle_rad, curve.support_n
        if len(angle) < 8:
            raise refuse("a fit of four parameters needs at least 8 angles", "subject")

        def error(p: Array) -> Array:
            bump = ForceCurve.parametric(peak_n=p[0], onset_rad=p[1], peak_rad=p[2], exponent=p[3])
            return bump.support(angle) - support

        start = [float(support.max()), 0.15, float(angle[np.argmax(support)]), 1.5]
        low, high = [0.0, 0.0, 1.0, 1.0], [np.inf, 0.9, np.pi, 4.0]
        found = least_squares(error, np.clip(start, low, high), bounds=(low, high)).x
        return ForceCurve.parametric(
            peak_n=found[0], onset_rad=found[1], peak_rad=found[2], exponent=found[3]
        )

    def plot(self, axes: Any = None) -> Any:
        """Draw the curves; see `ulna.plot.force_curves`."""
        from . import plot

        return plot.force_curves(self, axes)

    def __repr__(self) -> str:
        return f"<ForceTable: {len(self.curves)} subjects; mean {self.mean!r}>"


def read_force_table(path: str | os.PathLike[str]) -> ForceTable:
    """Force curves from a text table.

    Columns ``subject``, ``beta_deg`` (elevation) and ``F_support_N``; ``F_shear_N``, ``F_hip_x_N`` and
    ``F_hip_y_N`` where they are known. Angles of a subject increase.

    Examples
    --------
    >>> table = read_force_table("examples/data/arm-support.csv")
    >>> table.of(1)
    <ForceCurve: 10 to 140 deg, 35.0 N at 105.0 deg>
    """
    name = os.path.basename(os.fspath(path))
    try:
        with open(path, newline="", encoding="utf-8-sig") as file:
            rows = list(csv.DictReader(file))
    except OSError as failure:
        raise FileError(
            f"{os.fspath(path)!r} cannot be read: {failure.strerror}", status="ULNA_ERROR_FILE"
        ) from failure
    except (UnicodeDecodeError, csv.Error) as failure:
        raise FormatError(f"{name} is no text table", status="ULNA_ERROR_FORMAT") from failure
    known = set(rows[0]) if rows else set()
    for column in ("subject", "beta_deg", "F_support_N"):
        if column not in known:
            raise FormatError(
                f"{name} has no rows with a column {column!r}", status="ULNA_ERROR_FORMAT"
            )
    found: dict[str, list[list[float]]] = {}
    for number, row in enumerate(rows):
        cells = [row["beta_deg"], *(row.get(column) or "0" for column in _COLUMNS)]
        try:
            numbers = [float(cell) for cell in cells]
        except (TypeError, ValueError):
            numbers = [np.nan]
        if not np.all(np.isfinite(numbers)) or not (row["subject"] or "").strip():
            raise FormatError(
                f"line {number + 2} of {name} holds a cell that is no number",
                status="ULNA_ERROR_FORMAT",
                detail=f"line {number + 2}",
            )
        found.setdefault(row["subject"].strip(), []).append(numbers)
    return ForceTable(
        {subject: _curve(entries, subject, name) for subject, entries in found.items()}
    )


def _curve(entries: list[list[float]], subject: str, name: str) -> ForceCurve:
    table = np.array(entries)
    angle = table[:, 0]
    if len(angle) < 2 or np.any(np.diff(angle) <= 0) or angle[0] < 0 or angle[-1] > 180:
        raise FormatError(
            f"the angles of subject {subject} in {name} must increase from 0 to 180 degrees at most",
            status="ULNA_ERROR_FORMAT",
            detail=f"subject {subject}",
        )
    forces = dict(zip(_COLUMNS.values(), table[:, 1:].T, strict=True))
    return ForceCurve(np.radians(angle), **forces)


# Wrenches on the person ---------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class DeviceWrenches:
    """What a device does to the person, frame by frame.

    Attributes
    ----------
    arm_force_n : ndarray, shape (n, 2, 3)
        On the left and right upper arm, at `arm_point_m`; no moment there.
    arm_point_m : ndarray, shape (n, 2, 3)
    hip_force_n, hip_moment_nm : ndarray, shape (n, 3)
        On the pelvis, the moment about `hip_point_m`.
    hip_point_m : ndarray, shape (n, 3)
    elevation_rad : ndarray, shape (n, 2)
    outside : ndarray of bool, shape (n, 2)
        Where the elevation is above the curve, so its end was held, or the arm is upright, so that no
        plane holds it and there is no force.
    """

    arm_force_n: Array
    arm_point_m: Array
    hip_force_n: Array
    hip_moment_nm: Array
    hip_point_m: Array
    elevation_rad: Array
    outside: NDArray[np.bool_]

    @property
    def net_force_n(self) -> Array:
        """Sum of all forces, shape (n, 3): the weight of the device where it is in balance."""
        return np.asarray(self.arm_force_n.sum(axis=1) + self.hip_force_n)

    @property
    def net_moment_nm(self) -> Array:
        """Sum of all moments about the hip, shape (n, 3): zero where the device is in balance."""
        lever = self.arm_point_m - self.hip_point_m[:, None, :]
        return np.asarray(np.cross(lever, self.arm_force_n).sum(axis=1) + self.hip_moment_nm)

    def arm_wrench(self, about_m: ArrayLike) -> Array:
        """Force and moment on both arms about other points, shape (n, 2, 6).

        Parameters
        ----------
        about_m
            Shape (n, 2, 3), for example the origins of the upper arms' frames.
        """
        lever = self.arm_point_m - _vectors(about_m, "about_m")
        return np.concatenate([self.arm_force_n, np.cross(lever, self.arm_force_n)], axis=-1)

    def hip_wrench(self, about_m: ArrayLike) -> Array:
        """Force and moment on the pelvis about another point, shape (n, 6)."""
        lever = self.hip_point_m - _vectors(about_m, "about_m")
        moment = self.hip_moment_nm + np.cross(lever, self.hip_force_n)
        return np.concatenate([self.hip_force_n, moment], axis=-1)

    def __repr__(self) -> str:
        largest = float(np.linalg.norm(self.arm_force_n, axis=-1).max(initial=0.0))
        held = int(np.count_nonzero(self.outside))
        note = f", {held} arm frames outside the curve" if held else ""
        return (
            f"<DeviceWrenches: {len(self.arm_force_n)} frames, up to {largest:.1f} N an arm{note}>"
        )


@dataclass(frozen=True)
class PassiveDevice:
    """A device that carries both arms from the hip.

    Attributes
    ----------
    curve : ForceCurve or pair of ForceCurve
        Of both arms, or of the left and the right one.
    attachment : float
        Where it holds the upper arm, as a share of its length from the shoulder.
    mass_kg : float
        Its weight acts at the hip; 0 where the body model carries the mass already.
    along_arm : bool
        Also apply the table's force along the arm, which loads the shoulder joint but does not turn it.
    """

    curve: ForceCurve | tuple[ForceCurve, ForceCurve]
    attachment: float = ATTACHMENT
    mass_kg: float = 1.8
    along_arm: bool = False

    def __post_init__(self) -> None:
        if not 0 < self.attachment <= 1:
            raise refuse("attachment must lie between 0 and 1", "attachment")
        if not (np.isfinite(self.mass_kg) and self.mass_kg >= 0):
            raise refuse("mass_kg must not be negative", "mass_kg")

    def wrenches(
        self,
        shoulder_m: ArrayLike,
        elbow_m: ArrayLike,
        hip_m: ArrayLike,
        *,
        up: ArrayLike = (0.0, 0.0, 1.0),
    ) -> DeviceWrenches:
        """Balanced wrenches: perpendicular to each arm in the vertical plane that holds it, with the
        exact reaction at the hip.

        Parameters
        ----------
        shoulder_m, elbow_m
            Centres of the joints, shape (n, 2, 3), left and right.
        hip_m
            Where the belt sits, shape (n, 3).
        up
            Direction of the vertical, shape (3,).

        Returns
        -------
        DeviceWrenches

        Examples
        --------
        >>> device = PassiveDevice(ForceCurve.parametric(peak_n=35))
        >>> shoulder = np.array([[[0, 0.2, 1.4], [0, -0.2, 1.4]]])
        >>> pair = device.wrenches(shoulder, shoulder + [0.3, 0, 0], [[0, 0, 1.0]])
        >>> pair.arm_force_n[0, 0].round(1), pair.net_force_n[0].round(3)
        (array([ 0. ,  0. , 33.5]), array([  0.   ,   0.   , -17.658]))
        """
        shoulder, arm, hip = _poses(shoulder_m, elbow_m, hip_m)
        vertical = _vectors(up, "up")
        if vertical.shape != (3,):
            raise refuse(f"up has the shape {vertical.shape}, but (3,) is expected", "up")
        _refuse_no_length(vertical, "up")
        left, right = (
            np.column_stack([curve.angle_rad, curve.support_n, curve.shear_n])
            for curve in _curves(self.curve)
        )
        device = options(
            "ulna_arm_support",
            left=left,
            right=right,
            attachment=float(self.attachment),
            mass_kg=float(self.mass_kg) or -1.0,  # 0 would mean the default
            up=vertical.tolist(),
            along_arm=bool(self.along_arm),
        )
        frames = len(hip)
        poses = np.hstack([shoulder.reshape(frames, 6), (shoulder + arm).reshape(frames, 6), hip])
        found = out_array(lib.ulna_arm_support_wrenches, device, view(poses), shape=(frames, 22))
        return DeviceWrenches(
            arm_force_n=found[:, :6].reshape(frames, 2, 3),
            arm_point_m=found[:, 6:12].reshape(frames, 2, 3),
            hip_force_n=found[:, 12:15],
            hip_moment_nm=found[:, 15:18],
            hip_point_m=hip,
            elevation_rad=found[:, 18:20],
            outside=found[:, 20:22] != 0,
        )


def published_wrenches(
    curve: ForceCurve | tuple[ForceCurve, ForceCurve],
    shoulder_m: ArrayLike,
    elbow_m: ArrayLike,
    hip_m: ArrayLike,
    *,
    arm_rotation: ArrayLike,
    pelvis_rotation: ArrayLike,
    elevation_rad: ArrayLike,
    pelvis_width_m: float,
    attachment: float = ATTACHMENT,
) -> DeviceWrenches:
    """The mapping of the published study, for comparison: not in balance once the arm is flexed.

    The table's forces are laid into the frames of the links as pure forces: support along z of the
    upper arm, shear along its length, the hip's forces along y and z of the pelvis at both its sides.
    In a frame that rolls with the humerus the support turns away from the vertical. The own weight is
    left out.

    Parameters
    ----------
    curve
        With the hip's forces.
    shoulder_m, elbow_m, hip_m
        As for `PassiveDevice.wrenches`.
    arm_rotation
        From the frames of the upper arms to the global one, shape (n, 2, 3, 3); in the neutral pose x
        points forward, y to the left and z up.
    pelvis_rotation
        Shape (n, 3, 3).
    elevation_rad
        At which the table is read, shape (n, 2), as `elevation_of_joints` gives it.
    pelvis_width_m
        The hips' forces act at half of it to either side.
    attachment
        As in `PassiveDevice`.

    Returns
    -------
    DeviceWrenches
        With the moment of the pelvis about the hip point.

    Examples
    --------
    >>> curve = ForceCurve.parametric(peak_n=35)
    >>> shoulder = np.array([[[0, 0.2, 1.4], [0, -0.2, 1.4]]])
    >>> tpose = published_wrenches(curve, shoulder, shoulder * [1, 2.5, 1], [[0, 0, 1.0]],
    ...     arm_rotation=np.tile(np.eye(3), (1, 2, 1, 1)), pelvis_rotation=np.eye(3)[None],
    ...     elevation_rad=[[np.pi / 2, np.pi / 2]], pelvis_width_m=0.3)
    >>> tpose.arm_force_n[0, 0].round(1)
    array([ 0. ,  0. , 33.5])
    """
    shoulder, arm, hip = _poses(shoulder_m, elbow_m, hip_m)
    turn = np.asarray(arm_rotation, dtype=float)
    pelvis = np.asarray(pelvis_rotation, dtype=float)
    angle = np.asarray(elevation_rad, dtype=float)
    frames = len(shoulder)
    for name, array, shape in (
        ("arm_rotation", turn, (frames, 2, 3, 3)),
        ("pelvis_rotation", pelvis, (frames, 3, 3)),
        ("elevation_rad", angle, (frames, 2)),
    ):
        if array.shape != shape:
            raise refuse(f"{name} has the shape {array.shape}, but {shape} is expected", name)
    curves = _curves(curve)
    local = np.zeros((frames, 2, 3))
    at_hip = np.zeros((frames, 2, 3))
    outward = np.array([1.0, -1.0])  # y of the left arm points to its elbow, of the right from it
    for side, own in enumerate(curves):
        local[:, side, 1] = outward[side] * own.shear(angle[:, side])
        local[:, side, 2] = own.support(angle[:, side])
        at_hip[:, side, 1] = -outward[side] * own._at(angle[:, side], "hip_x_n")
        at_hip[:, side, 2] = own._at(angle[:, side], "hip_y_n")
    places = np.zeros((frames, 2, 3))
    places[..., 1] = 0.5 * pelvis_width_m * outward
    return DeviceWrenches(
        arm_force_n=np.einsum("nsij,nsj->nsi", turn, local),
        arm_point_m=shoulder + attachment * arm,
        hip_force_n=np.einsum("nij,nj->ni", pelvis, at_hip.sum(axis=1)),
        hip_moment_nm=np.einsum("nij,nj->ni", pelvis, np.cross(places, at_hip).sum(axis=1)),
        hip_point_m=hip,
        elevation_rad=angle,
        outside=np.stack([c.outside(a) for c, a in zip(curves, angle.T, strict=True)], axis=-1),
    )


# Inside -------------------------------------------------------------------------------------------


def _curves(curve: Any) -> tuple[ForceCurve, ForceCurve]:
    pair = (curve, curve) if isinstance(curve, ForceCurve) else tuple(curve)
    if len(pair) != 2:
        raise refuse(
            "give one curve for both arms, or one for the left and one for the right", "curve"
        )
    return pair


def _vectors(array: ArrayLike, name: str) -> Array:
    values = np.asarray(array, dtype=float)
    if values.ndim == 0 or values.shape[-1] != 3:
        raise refuse(f"{name} has the shape {values.shape}, but (..., 3) is expected", name)
    return values


def _refuse_no_length(vectors: Array, name: str) -> None:
    if np.any(np.linalg.norm(vectors, axis=-1) == 0):
        raise DataError(
            f"{name} holds a vector of no length", status="ULNA_ERROR_DATA", argument=name
        )


def _poses(
    shoulder_m: ArrayLike, elbow_m: ArrayLike, hip_m: ArrayLike
) -> tuple[Array, Array, Array]:
    """Shoulders, arms and hip; a missing value (NaN) makes the wrenches of its frame missing."""
    shoulder, elbow = _vectors(shoulder_m, "shoulder_m"), _vectors(elbow_m, "elbow_m")
    hip = _vectors(hip_m, "hip_m")
    frames = len(hip)
    for name, array, shape in (
        ("hip_m", hip, (frames, 3)),
        ("shoulder_m", shoulder, (frames, 2, 3)),
        ("elbow_m", elbow, (frames, 2, 3)),
    ):
        if array.shape != shape:
            raise refuse(f"{name} has the shape {array.shape}, but {shape} is expected", name)
    arm = elbow - shoulder
    if np.any(np.linalg.norm(arm, axis=-1) == 0):
        raise DataError(
            "an elbow lies in its shoulder: check the segments' positions",
            status="ULNA_ERROR_DATA",
            argument="elbow_m",
        )
    return shoulder, arm, hip
