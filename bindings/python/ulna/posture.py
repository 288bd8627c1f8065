"""What errors of the told posture do to estimated torques.

The estimate takes the angles of the joints as known. A suit tells every segment's orientation with an
error of about a degree, which leans a heavy trunk and moves every lever: often more than all noise of
its sensors. To first order that error passes through the whole estimate, so its variance is added.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .body import Body, Motion
from .record import refuse
from .torques import SensorSuite, estimate_torques

__all__ = ["hinge_errors", "joint_segments", "posture_deviation", "times_small"]

Array = NDArray[np.float64]

# Frames estimated in one call: enough to be quick, few enough to be small.
_BATCH = 14000
# Kinds whose readings are vectors in the axes of the segment that wears the sensor, and how many.
_WORN = {"accelerometer": 1, "angular_acceleration": 1, "external_wrench": 2, "external_force": 1}


def posture_deviation(
    suite: SensorSuite,
    motion: Motion,
    measured: ArrayLike,
    *,
    segment_rad: float = np.radians(1.0),
    every: int = 1,
    computed: Callable[[Motion], Mapping[str, Array]] | None = None,
    threads: int = 0,
) -> Array:
    """Standard deviation of every torque from errors of the told orientations of segments.

    Every segment with mass is turned by a small angle about each of its axes, with the sensors that it
    wears: they were told to lie along the axes that are wrong. The angles of its joints change. What
    that does to the whole estimate is added up as for independent errors.

    Parameters
    ----------
    suite, motion, measured
        As for `ulna.torques.estimate_torques`; hinges are those of the human model.
    segment_rad : float
        Standard deviation of the orientation of each segment, about each axis.
    every : int
        Compute every so many frames, with straight lines between: postures change slowly.
    computed : function, optional
        From a motion to readings by sensor: those that were not measured but follow from the told motion,
        such as the wrenches of a passive device. They are computed again for every posture.
    threads : int
        0: one a processor.

    Returns
    -------
    (frames, joints) array, N m
        To be added to `BodyTorques.torque_deviation` in squares; NaN before the first and after the
        last frame with a state. The axes of a worn sensor against its segment are an error of their own,
        which belongs into its deviation.

    Examples
    --------
    >>> from ulna.body import human_body
    >>> from ulna.torques import SensorSuite, suit_sensors
    >>> body = human_body(height_m=1.8, mass_kg=75)
    >>> suite = SensorSuite(body, suit_sensors(body))
    >>> y = suite.stack({"imu Pelvis": [[0, 0, 9.81]]})
    >>> spread = posture_deviation(suite, Motion(np.zeros((1, 48))), y)
    >>> spread.shape, bool(spread[0, body.joints.index("jL5S1_roty")] > 0.5)
    ((1, 48), True)
    """
    if not (np.isfinite(segment_rad) and segment_rad > 0):
        raise refuse("segment_rad must be positive", "segment_rad")
    if every < 1:
        raise refuse("every must be at least 1", "every")
    y = np.atleast_2d(np.asarray(measured, dtype=float))
    body = suite.body
    state = _complete(motion, len(y), body)
    known = np.flatnonzero(np.isfinite(np.hstack(state)).all(axis=1))
    out = np.full((len(y), len(body.joints)), np.nan)
    if not known.size:
        return out
    chosen = np.unique(np.append(known[::every], known[-1]))
    turns = _Turns(suite, segment_rad, computed)
    size = max(1, _BATCH // turns.count)
    found = np.concatenate(
        [
            turns.spread(state, y, chosen[begin : begin + size], threads)
            for begin in range(0, len(chosen), size)
        ]
    )
    inside = np.arange(known[0], known[-1] + 1)
    for joint in range(out.shape[1]):
        out[inside, joint] = np.interp(inside, chosen, found[:, joint])
    return out


def _complete(motion: Motion, frames: int, body: Body) -> tuple[Array, Array, Array, Array, Array]:
    """Angles, rates, orientation, angular velocity and place of the base; what is left out is 0."""
    upright = np.array([1.0, 0.0, 0.0, 0.0])
    wanted = (
        (motion.angle, np.zeros(len(body.joints))), (motion.rate, np.zeros(len(body.joints))),
        (motion.orientation, upright), (motion.angular_velocity_rad_s, np.zeros(3)),
        (motion.position_m, np.zeros(3)),
    )  # fmt: skip
    arrays = []
    for given, default in wanted:
        values = default if given is None else np.atleast_2d(np.asarray(given, dtype=float))
        arrays.append(np.array(np.broadcast_to(values, (frames, default.size))))
    return arrays[0], arrays[1], arrays[2], arrays[3], arrays[4]


class _Turns:
    """Segments that are turned, with the hinges above and below them and the rows they wear."""

    def __init__(
        self,
        suite: SensorSuite,
        size_rad: float,
        computed: Callable[[Motion], Mapping[str, Array]] | None,
    ) -> None:
        self.suite, self.size_rad, self.computed = suite, size_rad, computed
        body = suite.body
        joined = joint_segments(body)
        self.hinges = {name: k for k, name in enumerate(body.joints)}
        self.joints: dict[str, list[tuple[tuple[str, ...], bool]]] = {}
        for parent, child, names in joined:
            self.joints.setdefault(parent, []).append((names, False))
            self.joints.setdefault(child, []).append((names, True))
        self.worn: dict[str, list[tuple[slice, Array]]] = {name: [] for name in self.joints}
        for sensor in suite.sensors:
            if sensor.place in self.worn and sensor.frame == "link":
                axes = np.asarray(sensor.orientation, dtype=float).reshape(3, 3)
                for half in range(_WORN.get(sensor.kind, 0)):
                    first = suite.row(sensor.name) + 3 * half
                    self.worn[sensor.place].append((slice(first, first + 3), axes))
        self.count = 1 + 3 * len(self.joints)

    def spread(
        self, state: tuple[Array, ...], y: Array, rows: NDArray[np.intp], threads: int
    ) -> Array:
        """What all turns together do to the torques of some frames, (rows, joints)."""
        angle, rate, orientation, turning, place = (
            np.tile(values[rows], (self.count, 1)) for values in state
        )
        read = np.tile(y[rows], (self.count, 1))
        first = len(rows)
        for name, near in self.joints.items():
            for axis in range(3):
                own = slice(first, first + len(rows))
                small = np.zeros((len(rows), 3))
                small[:, axis] = self.size_rad
                for names, is_child in near:
                    columns = [self.hinges[hinge] for hinge in names]
                    told = angle[own, columns]
                    pair = (0 * small, small) if is_child else (small, 0 * small)
                    angle[own, columns] = told + hinge_errors(told, names, *pair)
                if name == self.suite.body.links[0]:
                    orientation[own] = times_small(orientation[own], small)
                for columns_worn, axes in self.worn[name]:
                    vector = read[own, columns_worn] @ axes.T
                    read[own, columns_worn] = (vector - np.cross(small, vector)) @ axes
                first += len(rows)
        motion = Motion(
            angle, rate, position_m=place, orientation=orientation, angular_velocity_rad_s=turning
        )
        if self.computed is not None:
            for sensor, values in self.computed(motion).items():
                row = self.suite.row(sensor)
                read[:, row : row + values.shape[1]] = values
        torque = estimate_torques(
            self.suite, motion, read, deviations=False, longest_gap=0, threads=threads
        ).torque.reshape(self.count, len(rows), -1)
        return np.asarray(np.sqrt(np.sum((torque[1:] - torque[:1]) ** 2, axis=0)))


# Segments and hinges ------------------------------------------------------------------------------


def joint_segments(body: Body) -> list[tuple[str, str, tuple[str, ...]]]:
    """Joints between segments with mass: parent, child and the hinges between them, in order.

    Examples
    --------
    >>> from ulna.body import human_body
    >>> joint_segments(human_body(height_m=1.8, mass_kg=75))[0]
    ('Pelvis', 'L5', ('jL5S1_rotx', 'jL5S1_roty'))
    """
    links = {link.name: link for link in body.describe()}
    found = []
    for link in links.values():
        if link.parent is None or link.mass_kg == 0.0:
            continue
        hinges, above = [link.joint], links[link.parent]
        while above.mass_kg == 0.0 and above.parent is not None:
            hinges.insert(0, above.joint)
            above = links[above.parent]
        names = tuple(name for name in hinges if name)
        axes = "".join(name[-1] for name in names if name[-5:-1] == "_rot")
        if len(axes) != len(names) or axes != "".join(a for a in "xyz" if a in axes):
            raise refuse(
                f"the joint above {link.name!r} has other hinges than the human model: they must turn "
                "about x, y and z in this order",
                "body",
            )
        found.append((above.name, link.name, names))
    return found


def hinge_errors(angle: Array, names: tuple[str, ...], parent: Array, child: Array) -> Array:
    """Errors of hinge angles from small rotations of the segments, to first order.

    Parameters
    ----------
    angle : (frames, hinges) array, rad
    names : tuple of str
        Hinges from parent to child; axes x, y, z in this order.
    parent, child : (frames, 3) arrays, rad
        Small rotations of the told segments against the true ones, own axes.

    The told relative rotation is exp(-parent) R exp(child) = R exp(w) with w = child - R^T parent; the
    hinges make of w what they can. The axes of two hinges in a row are at right angles.

    Examples
    --------
    A segment that is told 0.01 rad too far about y turns the hinge about y, and no hinge about x:

    >>> told = np.array([[0.0, 0.01, 0.0]])
    >>> hinge_errors(np.zeros((1, 2)), ("j_rotx", "j_roty"), 0 * told, told).tolist()
    [[0.0, 0.01]]
    """
    axes = "".join(name[-1] for name in names)
    w = parent
    for k, axis in enumerate(axes):
        w = _about(axis, -angle[:, k], w)
    w = child - w
    out = np.empty_like(angle)
    if axes == "xyz":
        # Seen before the last hinge the axes are (cos b, 0, sin b), y and z.
        w = _about("z", angle[:, 2], w)
        out[:, 0] = w[:, 0] / np.cos(angle[:, 1])
        out[:, 1] = w[:, 1]
        out[:, 2] = w[:, 2] - np.sin(angle[:, 1]) * out[:, 0]
        return out
    for k in reversed(range(len(axes))):
        out[:, k] = w[:, "xyz".index(axes[k])]
        w = _about(axes[k], angle[:, k], w)
    return out


def _about(axis: str, angle: Array, v: Array) -> Array:
    """Vectors turned about a coordinate axis."""
    k = "xyz".index(axis)
    i, j = (k + 1) % 3, (k + 2) % 3
    c, s = np.cos(angle), np.sin(angle)
    out = np.empty_like(v)
    out[:, k] = v[:, k]
    out[:, i] = c * v[:, i] - s * v[:, j]
    out[:, j] = s * v[:, i] + c * v[:, j]
    return out


def times_small(q: Array, small: Array) -> Array:
    """Quaternions (w, x, y, z) followed by small rotations (rad) in their own axes.

    Examples
    --------
    >>> times_small(np.array([[1.0, 0, 0, 0]]), np.array([[0.02, 0, 0]])).round(6).tolist()
    [[0.99995, 0.01, 0.0, 0.0]]
    """
    w, v, half = q[:, :1], q[:, 1:], 0.5 * small
    out = np.hstack([w - np.sum(v * half, axis=1, keepdims=True), v + w * half + np.cross(v, half)])
    return np.asarray(out / np.linalg.norm(out, axis=1, keepdims=True))
