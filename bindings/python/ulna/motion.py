"""From recorded segments and sensors to the motion of a body: rotations, hinge angles, derivatives, and
how a sensor sits on its segment.

Rotations turn vectors of the segment into the global frame. Axis 0 is the frame. What is missing (NaN)
stays missing and spreads no further than a filter's window.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import signal
from ._call import AnalysisError, DataError
from .record import Record, refuse

__all__ = [
    "Derivatives",
    "Mount",
    "angular_velocity",
    "differentiate",
    "hinge_angles",
    "identify_mount",
    "joint_angles",
    "proper_acceleration",
    "rotation_matrices",
    "segment",
]

Array = NDArray[np.float64]

GRAVITY_M_S2 = 9.81
_AXES = {"x": 0, "y": 1, "z": 2}
# Mount from blocks of this length: errors within a second of movement are alike.
_BLOCK_S = 1.0
_FEWEST_BLOCKS = 8


# Rotations ----------------------------------------------------------------------------------------


def rotation_matrices(quaternions: ArrayLike) -> Array:
    """Rotation matrices of quaternions (w, x, y, z).

    Parameters
    ----------
    quaternions
        Shape (..., 4). Lengths may be off by one per cent, as printed digits leave them.

    Returns
    -------
    ndarray, shape (..., 3, 3)

    Examples
    --------
    >>> rotation_matrices([0.5, 0.5, 0.5, 0.5])
    array([[0., 0., 1.],
           [1., 0., 0.],
           [0., 1., 0.]])
    """
    q = np.asarray(quaternions, dtype=float)
    if q.ndim == 0 or q.shape[-1] != 4:
        raise refuse(
            f"quaternions has the shape {q.shape}, but (..., 4) is expected", "quaternions"
        )
    length = np.linalg.norm(q, axis=-1)
    wrong = np.abs(length - 1) > 0.01  # False where it is missing
    if np.any(wrong):
        at = np.argwhere(np.atleast_1d(wrong))[0]
        raise DataError(
            f"the quaternion of frame {at[0]} has the length {np.atleast_1d(length)[tuple(at)]:.4g}: it "
            "is no rotation",
            status="ULNA_ERROR_DATA",
            argument="quaternions",
            detail=f"row {at[0]}",
        )
    w, x, y, z = np.moveaxis(q / length[..., None], -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def quaternions(rotations: Array) -> Array:
    """Quaternions w, x, y, z (n, 4) of rotation matrices (n, 3, 3), of either sign."""
    r = np.moveaxis(rotations, 0, -1)
    # 4 q q'; its row with the largest diagonal is the most exact.
    xx, yy, zz = r[0, 0], r[1, 1], r[2, 2]
    wx, wy, wz = r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]
    xy, xz, yz = r[0, 1] + r[1, 0], r[0, 2] + r[2, 0], r[1, 2] + r[2, 1]
    products = np.array(
        [
            [1 + xx + yy + zz, wx, wy, wz],
            [wx, 1 + xx - yy - zz, xy, xz],
            [wy, xy, 1 - xx + yy - zz, yz],
            [wz, xz, yz, 1 - xx - yy + zz],
        ]
    )
    best = np.argmax(np.diagonal(products), axis=1)
    row = products[best, :, np.arange(len(best))]
    return np.asarray(row / np.linalg.norm(row, axis=1, keepdims=True))


def segment(record: Record, name: str) -> tuple[Array, Array]:
    """Rotation and position of a segment of a suit's recording.

    Parameters
    ----------
    record
        As `ulna.read` gives an MVNX file: channels ``Pelvis_qw`` … and ``Pelvis_position_x`` ….
    name
        Of the segment.

    Returns
    -------
    rotation : ndarray, shape (n, 3, 3)
        From the segment to the global frame.
    position : ndarray, shape (n, 3)
        In m; missing where the file has none.

    Examples
    --------
    >>> import ulna
    >>> log = ulna.Record.from_arrays([0, 0.1], {"T8_qw": [1, 1], "T8_qx": [0, 0], "T8_qy": [0, 0],
    ...                                          "T8_qz": [0, 0]})
    >>> segment(log, "T8")[0][1].tolist()
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    if f"{name}_qw" not in record:
        known = [c.name.removesuffix("_qw") for c in record.channels if c.name.endswith("_qw")]
        raise refuse(
            f"there is no orientation of {name!r}; there are {', '.join(known) or 'none'}", "name"
        )
    rotation = rotation_matrices(np.stack([record[f"{name}_q{part}"] for part in "wxyz"], axis=-1))
    if f"{name}_position_x" not in record:
        return rotation, np.full((len(record), 3), np.nan)
    return rotation, np.stack([record[f"{name}_position_{axis}"] for axis in "xyz"], axis=-1)


def proper_acceleration(record: Record, sensor: str) -> Array:
    """What the accelerometer of a suit's sensor reads, in the sensor's axes.

    Parameters
    ----------
    record
        As `ulna.read` gives an MVNX file: with ``<sensor>_sensor_acceleration_x`` …, or with the free
        acceleration ``<sensor>_free_acceleration_x`` … (global, gravity removed) and the orientation
        ``<sensor>_sensor_qw`` ….
    sensor
        Its label.

    Returns
    -------
    ndarray, shape (n, 3)
        In m/s^2, gravity included: 9.81 upward at rest.

    Examples
    --------
    >>> import ulna
    >>> zeros = {f"T8_free_acceleration_{axis}": [0, 0] for axis in "xyz"}
    >>> turned = {"T8_sensor_qw": [0.5, 0.5], "T8_sensor_qx": [0.5, 0.5], "T8_sensor_qy": [0.5, 0.5],
    ...           "T8_sensor_qz": [0.5, 0.5]}
    >>> log = ulna.Record.from_arrays([0, 0.1], zeros | turned)
    >>> proper_acceleration(log, "T8")[0].tolist()
    [0.0, 9.81, 0.0]
    """
    read = [f"{sensor}_sensor_acceleration_{axis}" for axis in "xyz"]
    if all(name in record for name in read):
        return np.stack([record[name] for name in read], axis=-1)
    free = [f"{sensor}_free_acceleration_{axis}" for axis in "xyz"]
    turn = [f"{sensor}_sensor_q{part}" for part in "wxyz"]
    missing = [name for name in free + turn if name not in record]
    if missing:
        raise refuse(
            f"there is neither {read[0]} nor {missing[0]}: the acceleration of {sensor!r} in its own "
            "axes needs the free acceleration and the orientation",
            "sensor",
        )
    acceleration = np.stack([record[name] for name in free], axis=-1)
    rotation = rotation_matrices(np.stack([record[name] for name in turn], axis=-1))
    upward = np.array([0.0, 0.0, GRAVITY_M_S2])
    return np.asarray(np.einsum("nji,nj->ni", rotation, acceleration + upward))


def hinge_angles(rotations: ArrayLike, *, axes: str = "xyz") -> tuple[Array, Array]:
    """Angles of hinges in a row that come nearest to a rotation.

    Parameters
    ----------
    rotations
        From the child to the parent, shape (n, 3, 3).
    axes
        Hinges from parent to child, each axis once and in the order x, y, z: ``"xyz"``, ``"yz"``, ``"y"``
        and so on. Three hinges reach every rotation, fewer leave a misfit.

    Returns
    -------
    angles : ndarray, shape (n, hinges)
        In rad, R = R_x R_y R_z with what is left out.
    misfit : ndarray, shape (n,)
        Angle of the rotation that is left, rad.

    Examples
    --------
    >>> c, s = np.cos(0.3), np.sin(0.3)
    >>> angles, misfit = hinge_angles([[[c, 0, s], [0, 1, 0], [-s, 0, c]]], axes="yz")
    >>> angles.round(12).tolist(), misfit.round(7).tolist()
    ([[0.3, 0.0]], [0.0])
    """
    target = np.asarray(rotations, dtype=float)
    if target.ndim != 3 or target.shape[1:] != (3, 3):
        raise refuse(
            f"rotations has the shape {target.shape}, but (n, 3, 3) is expected", "rotations"
        )
    if not axes or "".join(a for a in "xyz" if a in axes) != axes:
        raise refuse(f"axes is {axes!r}: it must name x, y, z in this order, each once", "axes")
    angles = np.zeros((len(target), len(axes)))
    if axes == "xyz":
        angles[:, 1] = np.arcsin(np.clip(target[:, 0, 2], -1, 1))
        angles[:, 0] = np.arctan2(-target[:, 1, 2], target[:, 2, 2])
        angles[:, 2] = np.arctan2(-target[:, 0, 1], target[:, 0, 0])
    else:
        angles[:] = _nearest(target, axes)
    angles += 0.0  # no negative zeros
    angles[~np.isfinite(target).all(axis=(1, 2))] = np.nan
    left = np.swapaxes(target, 1, 2) @ hinge_rotations(angles, axes)
    # The angle of a rotation by its sine where it is small.
    sine = 0.5 * np.linalg.norm(_vee(left), axis=-1)
    cosine = 0.5 * (np.trace(left, axis1=1, axis2=2) - 1)
    return angles, np.arctan2(sine, cosine)


def _nearest(target: Array, axes: str) -> Array:
    """One or two hinges at the largest trace(target' product), in closed form."""
    if len(axes) == 1:
        i, j = [k for k in range(3) if k != _AXES[axes]]
        sine = (target[:, j, i] - target[:, i, j]) * (-1 if axes == "y" else 1)
        return np.arctan2(sine, target[:, i, i] + target[:, j, j])[:, None]
    # The trace is 4 <p, q>^2 - 1 of the two unit quaternions, and <p, q> is bilinear in cosine and
    # sine of half of either angle: a 2 x 2 matrix, whose first singular vectors they are.
    p = quaternions(target)
    first, second = (1 + _AXES[axis] for axis in axes)
    third = p[:, 6 - first - second] * (-1 if axes == "xz" else 1)
    difference = np.arctan2(p[:, first] - p[:, second], p[:, 0] + third)
    total = np.arctan2(p[:, first] + p[:, second], p[:, 0] - third)
    angles = np.column_stack([total + difference, total - difference])
    return np.asarray(np.pi - np.mod(np.pi - angles, 2 * np.pi))  # above -pi, up to pi


def hinge_rotations(angles: Array, axes: str) -> Array:
    """Product of the rotations of hinges in a row, shape (n, 3, 3), from angles (n, hinges)."""
    out = np.tile(np.eye(3), (len(angles), 1, 1))
    for at, axis in enumerate(axes):
        c, s = np.cos(angles[:, at]), np.sin(angles[:, at])
        turn = np.tile(np.eye(3), (len(angles), 1, 1))
        i, j = [k for k in range(3) if k != _AXES[axis]]
        turn[:, i, i] = turn[:, j, j] = c
        sign = -1 if axis == "y" else 1
        turn[:, j, i], turn[:, i, j] = sign * s, -sign * s
        out = out @ turn
    return out


def _vee(matrices: Array) -> Array:
    """Twice the vector of the skew part."""
    m = matrices
    return np.stack([m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0],
                     m[..., 1, 0] - m[..., 0, 1]], axis=-1)  # fmt: skip


def joint_angles(
    record: Record, hinges: Sequence[str], *, connections: Mapping[str, tuple[str, str]]
) -> tuple[Array, dict[str, Array]]:
    """Hinge angles of a body model from the segments' orientations of a suit.

    Parameters
    ----------
    record
        With orientations of all segments that the joints connect.
    hinges
        Names such as ``"jRightElbow_roty"``, in the model's order.
    connections
        Joint -> its parent's and child's point, as ``read_suit`` gives them:
        ``{"jRightElbow": ("RightUpperArm/jRightElbow", "RightForeArm/jRightElbow")}``.

    Returns
    -------
    angles : ndarray, shape (n, hinges)
        In rad, without jumps by whole turns.
    misfit : dict of str to ndarray, shape (n,)
        Per joint, the rotation that its hinges cannot make, rad.

    Examples
    --------
    >>> import ulna
    >>> still = {"qw": [1, 1], "qx": [0, 0], "qy": [0, 0], "qz": [0, 0]}
    >>> log = ulna.Record.from_arrays([0, 0.1], {f"{s}_{q}": v for s in ("Pelvis", "L5")
    ...                                          for q, v in still.items()})
    >>> angles, misfit = joint_angles(log, ["jL5S1_rotx", "jL5S1_roty"],
    ...                               connections={"jL5S1": ("Pelvis/jL5S1", "L5/jL5S1")})
    >>> angles.tolist()
    [[0.0, 0.0], [0.0, 0.0]]
    """
    axes: dict[str, str] = {}
    for hinge in hinges:
        joint, _, turn = hinge.rpartition("_rot")
        if joint not in connections or turn not in _AXES:
            raise refuse(
                f"the hinge {hinge!r} is no axis of a joint that the suit connects", "hinges"
            )
        axes[joint] = axes.get(joint, "") + turn
    rotations: dict[str, Array] = {}
    out = np.empty((len(record), len(hinges)))
    misfit = {}
    for joint, turns in axes.items():
        ends = [point.partition("/")[0] for point in connections[joint]]
        for name in ends:
            if name not in rotations:
                rotations[name] = segment(record, name)[0]
        relative = np.swapaxes(rotations[ends[0]], 1, 2) @ rotations[ends[1]]
        angles, misfit[joint] = hinge_angles(relative, axes=turns)
        for at, turn in enumerate(turns):
            out[:, list(hinges).index(f"{joint}_rot{turn}")] = unwrapped(angles[:, at])
    return out, misfit


def unwrapped(angle: Array) -> Array:
    """An angle without jumps by whole turns; what is missing stays missing."""
    out = angle.copy()
    known = np.isfinite(angle)
    out[known] = np.unwrap(angle[known])
    return out


# Derivatives --------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Derivatives:
    """A signal smoothed by local polynomials, with its derivatives.

    Attributes
    ----------
    value, rate, acceleration : ndarray, the shape of the signal
        Of one polynomial, so that they belong together. Missing within half a window of a gap.
    noise_gains : tuple of float
        Standard deviations of the three over that of white noise in the signal, in the interior.
    cutoff_hz : float
        At -3 dB.
    """

    value: Array
    rate: Array
    acceleration: Array
    noise_gains: tuple[float, float, float]
    cutoff_hz: float

    def __repr__(self) -> str:
        return (
            f"<Derivatives: {self.value.shape} to {self.cutoff_hz:.3g} Hz, noise of the acceleration "
            f"{self.noise_gains[2]:.3g} times that of the signal>"
        )


def differentiate(
    values: ArrayLike, *, rate_hz: float, window: int = 15, order: int = 4
) -> Derivatives:
    """Smoothed values, rates and accelerations of sampled angles or positions.

    Parameters
    ----------
    values
        Shape (n,) or (n, channels), evenly sampled.
    rate_hz
        Sampling rate.
    window, order
        Of the Savitzky-Golay filter; odd window, order from 2.

    Returns
    -------
    Derivatives

    Examples
    --------
    >>> t = np.arange(100) / 60
    >>> found = differentiate(t**2, rate_hz=60)
    >>> bool(np.allclose(found.acceleration, 2)), round(found.cutoff_hz, 1)
    (True, 6.9)
    """
    table = np.asarray(values, dtype=float)
    if table.ndim not in (1, 2):
        raise refuse(f"values has {table.ndim} axes: it must have one or two", "values")
    if order < 2:
        raise refuse("order must be at least 2, for accelerations", "order")
    kernels = [
        signal.savgol_kernel(window=window, order=order, derivative=d, rate_hz=rate_hz)
        for d in range(3)
    ]
    parts = np.full((3, *table.shape), np.nan)
    columns = table.reshape(len(table), -1)
    flat = parts.reshape(3, len(table), -1)
    for column in range(columns.shape[1]):
        for begin, end in _pieces(np.isfinite(columns[:, column]), window):
            for d in range(3):
                flat[d, begin:end, column] = signal.savgol_filter(
                    columns[begin:end, column],
                    window=window,
                    order=order,
                    derivative=d,
                    rate_hz=rate_hz,
                )
            # The ends of a piece beside a gap come from a polynomial of one side only.
            half = (window - 1) // 2
            if begin > 0:
                flat[:, begin : begin + half, column] = np.nan
            if end < len(table):
                flat[:, end - half : end, column] = np.nan
    gains = tuple(float(np.sqrt(np.sum(kernel**2))) for kernel in kernels)
    cutoff = 0.5 * rate_hz * signal.savgol_cutoff(window=window, order=order)
    return Derivatives(parts[0], parts[1], parts[2], (gains[0], gains[1], gains[2]), cutoff)


def _pieces(known: NDArray[np.bool_], shortest: int) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], known, [False]]).astype(int)))
    return [(int(b), int(e)) for b, e in edges.reshape(-1, 2) if e - b >= shortest]


def angular_velocity(
    quaternions: ArrayLike, *, rate_hz: float, window: int = 15, order: int = 4
) -> tuple[Array, Array]:
    """Angular velocity and acceleration in the segment's own axes.

    Parameters
    ----------
    quaternions
        From the segment to the global frame, shape (n, 4); a change of sign is no rotation.
    rate_hz, window, order
        As for `differentiate`.

    Returns
    -------
    velocity, acceleration : ndarray, shape (n, 3)
        In rad/s and rad/s^2.

    Examples
    --------
    >>> half = 0.5 * 2.0 * np.arange(200) / 60
    >>> q = np.stack([np.cos(half), 0 * half, 0 * half, np.sin(half)], axis=-1)
    >>> angular_velocity(q, rate_hz=60)[0][100].round(5)
    array([0., 0., 2.])
    """
    q = np.array(quaternions, dtype=float)
    rotation_matrices(q)  # refuses what is no rotation
    if q.ndim != 2:
        raise refuse(f"quaternions has the shape {q.shape}, but (n, 4) is expected", "quaternions")
    q = same_sign(q)
    found = differentiate(q, rate_hz=rate_hz, window=window, order=order)
    _, velocity, acceleration = turning(found.value, found.rate, found.acceleration)
    return velocity, acceleration


def same_sign(quaternions: Array) -> Array:
    """The same rotations without the jumps of sign that are none, shape (n, 4)."""
    q = np.array(quaternions)
    known = np.flatnonzero(np.isfinite(q).all(axis=1))
    if len(known) > 1:
        steps = np.sum(q[known[1:]] * q[known[:-1]], axis=1)
        q[known[1:]] *= np.cumprod(np.where(steps < 0, -1.0, 1.0))[:, None]
    return q


def turning(value: Array, rate: Array, acceleration: Array) -> tuple[Array, Array, Array]:
    """Unit quaternion, angular velocity and angular acceleration in the segment's own axes.

    Parameters
    ----------
    value, rate, acceleration
        Of the four components, each filtered by itself, shape (n, 4).
    """
    length = np.linalg.norm(value, axis=1, keepdims=True)
    unit = value / length
    # Of the unit quaternion; the filtered one changes its length a little.
    first = rate / length
    first -= unit * np.sum(unit * first, axis=1, keepdims=True)
    second = acceleration / length
    return unit, 2 * _conjugate_times(unit, first), 2 * _conjugate_times(unit, second)


def _conjugate_times(q: Array, p: Array) -> Array:
    """Vector part of conj(q) p."""
    w, v = q[:, :1], q[:, 1:]
    return np.asarray(w * p[:, 1:] - p[:, :1] * v - np.cross(v, p[:, 1:]))


# How a sensor sits --------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Mount:
    """How an inertial sensor sits on its segment.

    Attributes
    ----------
    rotation : ndarray, shape (3, 3)
        From the sensor's axes to the segment's.
    position_m : ndarray, shape (3,)
        Of the sensor in the segment's frame.
    gyroscope_bias_rad_s : ndarray, shape (3,)
        In the sensor's axes.
    rotation_error_rad, position_error_m : ndarray, shape (3,)
        Standard errors, from the differences between stretches of the movement.
    gyroscope_rms_rad_s, accelerometer_rms_m_s2 : float
        What the fit leaves.
    """

    rotation: Array
    position_m: Array
    gyroscope_bias_rad_s: Array
    rotation_error_rad: Array
    position_error_m: Array
    gyroscope_rms_rad_s: float
    accelerometer_rms_m_s2: float

    def summary(self) -> str:
        """What was found, as text."""
        degrees = np.degrees(self.rotation_error_rad)
        place = ", ".join(
            f"{1e3 * p:.0f} ± {1e3 * e:.1g}"
            for p, e in zip(self.position_m, self.position_error_m, strict=True)
        )
        return (
            f"sensor at ({place}) mm, axes known to {degrees.max():.2g} deg\n"
            f"left: {self.gyroscope_rms_rad_s:.2g} rad/s, {self.accelerometer_rms_m_s2:.2g} m/s^2"
        )

    def __repr__(self) -> str:
        return f"<Mount: {self.summary().splitlines()[0]}>"


def identify_mount(
    accelerometer_m_s2: ArrayLike,
    gyroscope_rad_s: ArrayLike,
    quaternions: ArrayLike,
    position_m: ArrayLike,
    *,
    rate_hz: float,
    window: int = 15,
    order: int = 4,
) -> Mount:
    """Axes and place of a sensor on its segment, from a calibration motion.

    The angular velocity of the segment and the gyroscope's are one vector in two frames, which gives the
    rotation between them; then a_sensor - a_segment = alpha x r + omega x (omega x r) gives the place,
    omega and alpha from the gyroscope.
    The segment must turn about at least two axes.

    Parameters
    ----------
    accelerometer_m_s2
        Proper acceleration (gravity included) in the sensor's axes, shape (n, 3).
    gyroscope_rad_s
        In the sensor's axes, shape (n, 3).
    quaternions, position_m
        Of the segment in the global frame (z up), shape (n, 4) and (n, 3), on the same clock.
    rate_hz
        Of all of them.
    window, order
        Of the filter that all signals pass, so that they keep in step.

    Returns
    -------
    Mount
        Refused as `ulna.AnalysisError` where the motion does not determine it.
    """
    q = np.asarray(quaternions, dtype=float)
    sensed = [np.asarray(a, dtype=float) for a in (accelerometer_m_s2, gyroscope_rad_s, position_m)]
    for name, array in zip(
        ("accelerometer_m_s2", "gyroscope_rad_s", "position_m"), sensed, strict=True
    ):
        if array.shape != (len(q), 3):
            raise refuse(f"{name} has the shape {array.shape}, but ({len(q)}, 3) is expected", name)
    settings = {"rate_hz": rate_hz, "window": window, "order": order}
    omega, _ = angular_velocity(q, **settings)
    smooth = [differentiate(array, **settings) for array in sensed]
    accelerometer, gyroscope, turning_faster = smooth[0].value, smooth[1].value, smooth[1].rate
    upward = np.array([0.0, 0.0, GRAVITY_M_S2])
    # The segment's rotations, smoothed alike: its own filter would bend them.
    turn = rotation_matrices(q)
    at_segment = np.einsum("nji,nj->ni", turn, smooth[2].acceleration + upward)
    whole = np.isfinite(np.hstack([accelerometer, gyroscope, turning_faster, omega, at_segment])).all(axis=1)
    half = (window - 1) // 2
    whole[:half] = whole[-half:] = False
    blocks = _blocks(np.flatnonzero(whole), max(1, round(_BLOCK_S * rate_hz)))
    if len(blocks) < _FEWEST_BLOCKS:
        raise AnalysisError(
            f"the calibration motion has {len(blocks)} s without gaps, at least {_FEWEST_BLOCKS} s are "
            "needed",
            status="ULNA_ERROR_ANALYSIS",
        )
    arrays = (gyroscope, turning_faster, omega, accelerometer, at_segment)
    rows = np.concatenate(blocks)
    rotation, place, bias, left = _mount(arrays, rows)
    turns, places = [], []
    for out in range(len(blocks)):  # jackknife over blocks
        kept = np.concatenate([block for at, block in enumerate(blocks) if at != out])
        other, where, _, _ = _mount(arrays, kept)
        turns.append(0.5 * _vee(other @ rotation.T))
        places.append(where)
    n = len(blocks)
    scale = np.sqrt((n - 1) ** 2 / n)
    return Mount(
        rotation=rotation,
        position_m=place,
        gyroscope_bias_rad_s=bias,
        rotation_error_rad=scale * np.std(turns, axis=0, ddof=1),
        position_error_m=scale * np.std(places, axis=0, ddof=1),
        gyroscope_rms_rad_s=left[0],
        accelerometer_rms_m_s2=left[1],
    )


def _blocks(rows: NDArray[Any], size: int) -> list[NDArray[Any]]:
    cuts = np.flatnonzero(np.diff(rows) > 1) + 1
    pieces = [piece for piece in np.split(rows, cuts) if len(piece)]
    return [
        piece[at : at + size] for piece in pieces for at in range(0, len(piece) - size // 2, size)
    ]


def _mount(
    arrays: tuple[Array, ...], rows: NDArray[Any]
) -> tuple[Array, Array, Array, tuple[float, float]]:
    gyroscope, faster, omega, accelerometer, at_segment = (array[rows] for array in arrays)
    mean_s, mean_b = gyroscope.mean(axis=0), omega.mean(axis=0)
    covariance = (omega - mean_b).T @ (gyroscope - mean_s)
    u, size, vt = np.linalg.svd(covariance)
    # Turning about one line leaves the rotation about that line open.
    if size[1] < 0.01 * size[0] or np.sqrt(size[0] / len(rows)) < 0.05:
        raise AnalysisError(
            "the segment turns about one axis only, or hardly at all: a calibration motion must turn it "
            "about two",
            status="ULNA_ERROR_ANALYSIS",
        )
    rotation = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    bias = mean_s - rotation.T @ mean_b
    left = omega - (gyroscope - bias) @ rotation.T
    # alpha x r + omega x (omega x r) = L r. From the gyroscope: the segment's own angles differenced
    # twice carry the noise that is in its acceleration as well, which would pull the place off.
    turn = _cross_matrices((gyroscope - bias) @ rotation.T)
    lever = _cross_matrices(faster @ rotation.T) + turn @ turn
    difference = accelerometer @ rotation.T - at_segment
    stacked, target = lever.reshape(-1, 3), difference.reshape(-1)
    place, _, _, singular = np.linalg.lstsq(stacked, target, rcond=None)
    if singular[-1] < 1e-3 * singular[0]:
        raise AnalysisError(
            "the motion does not show where along one line the sensor sits: turn the segment faster and "
            "about another axis",
            status="ULNA_ERROR_ANALYSIS",
        )
    rest = target - stacked @ place
    return (
        np.asarray(rotation),
        np.asarray(place),
        np.asarray(bias),
        (float(np.sqrt(np.mean(left**2))), float(np.sqrt(np.mean(rest**2)))),
    )


def _cross_matrices(vectors: Array) -> Array:
    out = np.zeros((len(vectors), 3, 3))
    x, y, z = vectors.T
    out[:, 0, 1], out[:, 0, 2] = -z, y
    out[:, 1, 0], out[:, 1, 2] = z, -x
    out[:, 2, 0], out[:, 2, 1] = -y, x
    return out
