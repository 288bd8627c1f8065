"""Whole bodies: the human model, URDF and MJCF, and the dynamics of recorded motion.

The world has x forward, y left and z up. A body is a tree of links on hinges; its first link (the
base) is free in space. Torques, angles and accelerations are in the order of `Body.joints`, wrenches
in the order of `Body.links`. A wrench is a force (N) and a moment (N m). SI and radians throughout.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._call import (
    ArgumentError,
    FileError,
    FormatError,
    Handle,
    check,
    encode,
    ffi,
    lib,
    options,
    out_array,
    text,
    view,
)

__all__ = [
    "Body",
    "Centroid",
    "Link",
    "Motion",
    "body_from_links",
    "body_from_text",
    "human_body",
    "human_names",
    "read_body",
]

Array = NDArray[np.float64]

_SHAPES = ("none", "box", "cylinder", "sphere")
_FORMATS = {"urdf": lib.ULNA_BODY_URDF, "mjcf": lib.ULNA_BODY_MJCF}


class _Body(Handle):
    kind = "ulna_body"
    __slots__ = ()


@dataclass(frozen=True)
class Link:
    """A link of a body and the joint that carries it.

    Attributes
    ----------
    name : str
    parent : str or None
        ``None`` for the base.
    joint : str or None
        Hinge that carries it; ``None`` for the base and for a link fixed to its parent.
    position_m : (3,) array
        Of the link's frame, which lies at its joint, in the parent.
    orientation : (3, 3) array
        Columns: the link's axes in the parent's, at the angle `reference_rad`.
    axis : (3,) array
        Of the hinge, link axes, length 1.
    mass_kg : float
        0 for a link between two hinges at one point.
    centre_m : (3,) array
        Of mass, link axes.
    inertia_kg_m2 : (3, 3) array
        About the centre of mass, link axes.
    lower_rad, upper_rad, reference_rad : float
    shape : {"none", "box", "cylinder", "sphere"}
    shape_size_m : (3,) array
        Edges of a box; radius and length of a cylinder; radius of a sphere.
    shape_centre_m, shape_axis : (3,) array
        Link axes; the axis is a cylinder's.
    """

    name: str
    parent: str | None = None
    joint: str | None = None
    position_m: Array = field(default_factory=lambda: np.zeros(3))
    orientation: Array = field(default_factory=lambda: np.eye(3))
    axis: Array = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    mass_kg: float = 0.0
    centre_m: Array = field(default_factory=lambda: np.zeros(3))
    inertia_kg_m2: Array = field(default_factory=lambda: np.zeros((3, 3)))
    lower_rad: float = -np.inf
    upper_rad: float = np.inf
    reference_rad: float = 0.0
    shape: str = "none"
    shape_size_m: Array = field(default_factory=lambda: np.zeros(3))
    shape_centre_m: Array = field(default_factory=lambda: np.zeros(3))
    shape_axis: Array = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))


@dataclass(frozen=True)
class Motion:
    """How a body moves: one row a frame. What is ``None`` is zero or at rest.

    Attributes
    ----------
    angle : (frames, joints) array, rad
    rate, acceleration : (frames, joints) array or None, rad/s, rad/s^2
    position_m, velocity_m_s : (frames, 3) array or None
        Of the base link's origin in the world.
    orientation : (frames, 4) array or None
        Unit quaternion w x y z of the base in the world.
    angular_velocity_rad_s : (frames, 3) array or None
        Of the base, world axes.
    base_acceleration : (frames, 6) array or None
        Proper linear acceleration of the base origin (g upwards at rest, which is what ``None``
        means), then angular; world axes.
    """

    angle: ArrayLike
    rate: ArrayLike | None = None
    acceleration: ArrayLike | None = None
    position_m: ArrayLike | None = None
    orientation: ArrayLike | None = None
    velocity_m_s: ArrayLike | None = None
    angular_velocity_rad_s: ArrayLike | None = None
    base_acceleration: ArrayLike | None = None

    def _struct(self) -> Any:
        given = {}
        for member in fields(self):
            value = getattr(self, member.name)
            if value is not None:
                given[member.name] = np.atleast_2d(np.asarray(value, dtype=float))
        names = {
            "position_m": "position",
            "velocity_m_s": "velocity",
            "angular_velocity_rad_s": "angular_velocity",
        }
        return options("ulna_body_motion", **{names.get(k, k): v for k, v in given.items()})


@dataclass(frozen=True)
class Centroid:
    """Centre of mass of a moving body, world axes, one row a frame.

    Attributes
    ----------
    position_m, velocity_m_s : (frames, 3) array
    momentum : (frames, 6) array
        Linear (kg m/s) and angular about the centre of mass (kg m^2/s).
    momentum_rate : (frames, 6) array
        Sum of the external wrenches and the weight about the centre of mass.
    """

    position_m: Array
    velocity_m_s: Array
    momentum: Array
    momentum_rate: Array


class Body:
    """A body: immutable. Made by :func:`human_body`, :func:`read_body`, :func:`body_from_links`.

    Attributes
    ----------
    links, joints : tuple of str
        Names; one joint is one hinge, one degree of freedom.
    mass_kg, gravity_m_s2 : float
    """

    def __init__(self, handle: Any) -> None:
        if not isinstance(handle, _Body):
            raise ArgumentError(
                "a body is made by human_body, read_body, body_from_text or body_from_links",
                status="ULNA_ERROR_ARGUMENT",
                argument="handle",
            )
        self._handle = handle
        counts = ffi.new("int64_t[2]")
        numbers = ffi.new("double[2]")
        check(lib.ulna_body_size(handle.pointer, counts, counts + 1, numbers, numbers + 1))
        self.mass_kg = float(numbers[0])
        self.gravity_m_s2 = float(numbers[1])
        self.links = self._names(lib.ULNA_BODY_LINK_NAMES)
        self.joints = self._names(lib.ULNA_BODY_JOINT_NAMES)

    def _names(self, kind: int) -> tuple[str, ...]:
        names = text(lib.ulna_body_names, self._handle.pointer, kind)
        return tuple(names.split("\n")) if names else ()

    def __repr__(self) -> str:
        return (
            f"Body({len(self.links)} links, {len(self.joints)} joints, {self.mass_kg:.4g} kg, "
            f"base {self.links[0]!r})"
        )

    def __reduce__(self) -> Any:
        return _rebuilt, (self.describe(), self.gravity_m_s2)

    def describe(self) -> list[Link]:
        """Every link with its joint, in order.

        Examples
        --------
        >>> knee = human_body(height_m=1.8, mass_kg=75).describe()[34]
        >>> knee.joint, knee.parent, round(float(np.degrees(knee.upper_rad)))
        ('jRightKnee_roty', 'RightUpperLeg', 135)
        """
        width = lib.ULNA_BODY_LINK_VALUES + lib.ULNA_BODY_SHAPE_VALUES
        rows = out_array(lib.ulna_body_links, self._handle.pointer, shape=(-1, width))
        hinges = text(lib.ulna_body_names, self._handle.pointer, lib.ULNA_BODY_LINK_JOINTS)
        links = []
        for name, hinge, row in zip(self.links, hinges.split("\n"), rows, strict=True):
            inertia = row[21:27]
            xx, yy, zz, xy, xz, yz = inertia
            links.append(
                Link(
                    name=name,
                    parent=None if row[0] < 0 else self.links[int(row[0])],
                    joint=hinge or None,
                    position_m=row[1:4].copy(),
                    orientation=row[4:13].reshape(3, 3).copy(),
                    axis=row[13:16].copy(),
                    reference_rad=float(row[16]),
                    mass_kg=float(row[17]),
                    centre_m=row[18:21].copy(),
                    inertia_kg_m2=np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]),
                    lower_rad=float(row[27]),
                    upper_rad=float(row[28]),
                    shape=_SHAPES[int(row[29])],
                    shape_size_m=row[30:33].copy(),
                    shape_centre_m=row[33:36].copy(),
                    shape_axis=row[36:39].copy(),
                )
            )
        return links

    def attach(
        self,
        name: str,
        *,
        link: str,
        mass_kg: float,
        centre_m: ArrayLike,
        inertia_kg_m2: ArrayLike | None = None,
    ) -> Body:
        """The body with a tool or device on a link: its centre of mass in link axes, and its inertia
        about it (3 x 3; ``None``: a point).

        Examples
        --------
        >>> body = human_body(height_m=1.8, mass_kg=75)
        >>> drill = body.attach("drill", link="RightHand", mass_kg=0.66, centre_m=(0.1, -0.1, 0))
        >>> round(drill.mass_kg - body.mass_kg, 6)
        0.66
        """
        six = ffi.NULL
        if inertia_kg_m2 is not None:
            m = np.asarray(inertia_kg_m2, dtype=float)
            if m.shape != (3, 3) or not np.allclose(m, m.T):
                raise ArgumentError(
                    f"inertia_kg_m2 must be a symmetric 3 x 3 matrix, got shape {m.shape}",
                    status="ULNA_ERROR_ARGUMENT",
                    argument="inertia_kg_m2",
                )
            six = view(np.array([m[0, 0], m[1, 1], m[2, 2], m[0, 1], m[0, 2], m[1, 2]]))
        return Body(
            _Body.make(
                lib.ulna_body_attach,
                self._handle.pointer,
                encode(name, "name"),
                encode(link, "link"),
                float(mass_kg),
                view(np.asarray(centre_m, dtype=float)),
                six,
            )
        )

    def rebased(self, base: str) -> Body:
        """The same body told from another base link; torques and their signs stay."""
        return Body(_Body.make(lib.ulna_body_rebase, self._handle.pointer, encode(base, "base")))

    def to_text(self, *, format: str = "urdf", name: str = "body", fixed_base: bool = False) -> str:
        """The body as URDF, or as MJCF with a base that floats or is fixed to the world."""
        if format not in _FORMATS:
            raise ArgumentError(
                f"format is {format!r}; it must be 'urdf' or 'mjcf'",
                status="ULNA_ERROR_ARGUMENT",
                argument="format",
            )
        kind = _FORMATS[format]
        if fixed_base and format == "mjcf":
            kind = lib.ULNA_BODY_MJCF_FIXED
        return text(lib.ulna_body_text, self._handle.pointer, kind, encode(name, "name"))

    def poses(self, motion: Motion) -> Array:
        """Where every link is: (frames, links, 7), position (m) and quaternion w x y z, world.

        Examples
        --------
        >>> body = human_body(height_m=1.8, mass_kg=75)
        >>> pose = body.poses(Motion(np.zeros((1, 48))))
        >>> pose.shape, round(float(pose[0, body.links.index("Head"), 2]), 4)
        ((1, 49, 7), 0.612)
        """
        flat = out_array(lib.ulna_body_poses, self._handle.pointer, motion._struct())
        return flat.reshape(-1, len(self.links), 7)

    def sensor(
        self, motion: Motion, *, link: str, point_m: ArrayLike = (0.0, 0.0, 0.0)
    ) -> tuple[Array, Array, Array, Array]:
        """What a point of a link feels, in the link's axes.

        Returns
        -------
        velocity, angular_velocity, proper_acceleration, angular_acceleration : (frames, 3) array
        """
        rows = out_array(
            lib.ulna_body_point,
            self._handle.pointer,
            motion._struct(),
            encode(link, "link"),
            view(np.asarray(point_m, dtype=float)),
            shape=(-1, 12),
        )
        return rows[:, :3], rows[:, 3:6], rows[:, 6:9], rows[:, 9:]

    def inverse_dynamics(
        self, motion: Motion, external: ArrayLike | None = None
    ) -> tuple[Array, Array]:
        """Torques of a known motion by recursive Newton-Euler.

        Parameters
        ----------
        motion : Motion
        external : (frames, links, 6) array, optional
            Wrench on each link about its origin, link axes.

        Returns
        -------
        torque : (frames, joints) array, N m
        missing : (frames, 6) array
            Wrench about the base origin (world axes) that the base still lacks: without external
            wrenches, all that holds the body.

        Examples
        --------
        >>> body = human_body(height_m=1.8, mass_kg=75)
        >>> torque, missing = body.inverse_dynamics(Motion(np.zeros((1, 48))))
        >>> round(float(missing[0, 2] / body.gravity_m_s2), 6)
        75.0
        """
        wrenches = ffi.NULL
        if external is not None:
            values = np.asarray(external, dtype=float)
            if values.ndim != 3 or values.shape[1:] != (len(self.links), 6):
                raise ArgumentError(
                    f"external has shape {values.shape}; (frames, {len(self.links)}, 6) is expected",
                    status="ULNA_ERROR_ARGUMENT",
                    argument="external",
                )
            wrenches = view(values.reshape(len(values), -1))
        rows = out_array(
            lib.ulna_body_inverse_dynamics,
            self._handle.pointer,
            motion._struct(),
            wrenches,
            shape=(-1, len(self.joints) + 6),
        )
        return rows[:, :-6], rows[:, -6:]

    def centroid(self, motion: Motion) -> Centroid:
        """Centre of mass, momentum about it and its rate."""
        rows = out_array(
            lib.ulna_body_centroid, self._handle.pointer, motion._struct(), shape=(-1, 18)
        )
        return Centroid(rows[:, :3], rows[:, 3:6], rows[:, 6:12], rows[:, 12:])

    def mass_matrix(self, motion: Motion) -> Array:
        """At the first frame: base linear, base angular (world axes, base origin), joints."""
        n = 6 + len(self.joints)
        return out_array(
            lib.ulna_body_mass_matrix, self._handle.pointer, motion._struct(), shape=(n, n)
        )

    def jacobian(self, motion: Motion, *, link: str, point_m: ArrayLike = (0.0, 0.0, 0.0)) -> Array:
        """Of a point of a link at the first frame: 6 x (6 + joints), world axes."""
        return out_array(
            lib.ulna_body_jacobian,
            self._handle.pointer,
            motion._struct(),
            encode(link, "link"),
            view(np.asarray(point_m, dtype=float)),
            shape=(6, 6 + len(self.joints)),
        )


def _rebuilt(links: list[Link], gravity_m_s2: float) -> Body:
    return body_from_links(links, gravity_m_s2=gravity_m_s2)


def human_names(kind: str) -> list[str]:
    """Names of the human model: its ``"segments"``, ``"points"`` or ``"suit"`` links.

    Examples
    --------
    >>> human_names("segments")[:4]
    ['head', 'neck', 'shoulder', 'upper_arm']
    >>> len(human_names("suit"))
    17
    """
    kinds = {
        "segments": lib.ULNA_HUMAN_SEGMENTS,
        "points": lib.ULNA_HUMAN_POINTS,
        "suit": lib.ULNA_HUMAN_SUIT,
    }
    if kind not in kinds:
        raise ArgumentError(
            f"kind is {kind!r}; it must be one of {', '.join(kinds)}",
            status="ULNA_ERROR_ARGUMENT",
            argument="kind",
        )
    return text(lib.ulna_human_names, kinds[kind]).split("\n")


def human_body(
    *,
    height_m: float,
    mass_kg: float,
    lengths_m: Mapping[str, float] | None = None,
    points_m: Mapping[str, ArrayLike] | None = None,
    spherical: bool = False,
    published_masses: bool = False,
    density_kg_m3: float | None = None,
) -> Body:
    """The human model in a T-pose: 49 links on 48 hinges, or 67 on 66 with spherical joints.

    Parameters
    ----------
    height_m, mass_kg : float
    lengths_m : mapping, optional
        Measured lengths by segment (`human_names`); the others follow from height.
    points_m : mapping, optional
        Measured joint centres and ends in the neutral pose by name (`human_names`), any frame along
        x forward, y left, z up; both hips must be there.
    spherical : bool
    published_masses : bool
        Mass fractions of the published model, which goes with points of a suit.
    density_kg_m3 : float, optional
        Fixes the girth of segments; default 1050.

    Examples
    --------
    >>> human_body(height_m=1.793, mass_kg=72.7)
    Body(49 links, 48 joints, 72.7 kg, base 'Pelvis')
    """
    given: dict[str, Any] = {}
    if lengths_m:
        given["segments"] = list(lengths_m)
        given["segment_lengths"] = np.array([float(v) for v in lengths_m.values()])
        given["segment_count"] = len(lengths_m)
    if points_m:
        given["points"] = list(points_m)
        given["point_positions"] = np.array([np.asarray(p, dtype=float) for p in points_m.values()])
        given["point_count"] = len(points_m)
    return Body(
        _Body.make(
            lib.ulna_body_new_human,
            options(
                "ulna_human_options",
                height_m=height_m,
                mass_kg=mass_kg,
                density_kg_m3=density_kg_m3,
                spherical_joints=bool(spherical),
                published_masses=bool(published_masses),
                **given,
            ),
        )
    )


def body_from_links(links: Sequence[Link], *, gravity_m_s2: float = 9.81) -> Body:
    """A body from its links, the base first, parents before what they carry.

    Examples
    --------
    >>> ball = dict(mass_kg=1.0, inertia_kg_m2=0.01 * np.eye(3))
    >>> body_from_links([Link("trunk", **ball),
    ...                  Link("arm", parent="trunk", joint="shoulder", **ball)])
    Body(2 links, 1 joints, 2 kg, base 'trunk')
    """
    places = {link.name: index for index, link in enumerate(links)}
    rows = []
    names: list[str] = []
    for link in links:
        if link.parent is not None and link.parent not in places:
            raise ArgumentError(
                f"link {link.name!r} hangs on {link.parent!r}, which is not there",
                status="ULNA_ERROR_ARGUMENT",
                argument="links",
            )
        m = np.asarray(link.inertia_kg_m2, dtype=float).reshape(3, 3)
        rows.append(
            np.concatenate(
                [
                    [-1.0 if link.parent is None else places[link.parent]],
                    np.ravel(link.position_m),
                    np.ravel(link.orientation),
                    np.ravel(link.axis),
                    [link.reference_rad, link.mass_kg],
                    np.ravel(link.centre_m),
                    [m[0, 0], m[1, 1], m[2, 2], m[0, 1], m[0, 2], m[1, 2]],
                    [link.lower_rad, link.upper_rad],
                ]
            )
        )
        names += [link.name, link.joint or ""]
    pointers = [ffi.new("char[]", name.encode()) for name in names]
    values = np.array(rows) if rows else np.zeros((0, lib.ULNA_BODY_LINK_VALUES))
    return Body(
        _Body.make(
            lib.ulna_body_new_links,
            view(values),
            ffi.new("const char *[]", pointers),
            len(names),
            float(gravity_m_s2),
        )
    )


def body_from_text(text: str) -> Body:  # noqa: A002 - the field's word
    """A body from URDF or MJCF text."""
    return Body(_Body.make(lib.ulna_body_new_text, encode(text, "text")))


def read_body(path: str | os.PathLike[str]) -> Body:
    """A body from a file: URDF, MJCF, or JSON with a list of ``links``.

    A JSON link has ``name``, ``mass``, ``com``, ``inertia_diag`` (or ``inertia``, 3 x 3, about the
    centre of mass) and, but for the first, ``joint``, ``axis`` and ``origin`` in its ``parent``,
    which is the link before it where none is named.
    """
    if not os.fspath(path).lower().endswith(".json"):
        return Body(_Body.make(lib.ulna_body_read, encode(os.fspath(path), "path")))
    try:
        with open(path, encoding="utf-8") as file:
            content = json.load(file)
    except OSError as failure:
        raise FileError(
            f"{path} cannot be read: {failure.strerror}", status="ULNA_ERROR_FILE", argument="path"
        ) from failure
    except ValueError as failure:
        raise FormatError(
            f"{path} is no JSON: {failure}", status="ULNA_ERROR_FORMAT", argument="path"
        ) from failure
    return _from_json(content, os.fspath(path))


def _from_json(content: Any, path: str) -> Body:
    links: list[Link] = []
    try:
        for entry in content["links"]:
            inertia = (
                np.diag(np.asarray(entry["inertia_diag"], dtype=float))
                if "inertia_diag" in entry
                else np.asarray(entry["inertia"], dtype=float)
            )
            first = not links
            links.append(
                Link(
                    name=str(entry["name"]),
                    parent=None if first else str(entry.get("parent", links[-1].name)),
                    joint=None if first else entry.get("joint"),
                    position_m=np.asarray(entry.get("origin", (0, 0, 0)), dtype=float),
                    axis=np.asarray(entry.get("axis", (0, 0, 1)), dtype=float),
                    mass_kg=float(entry["mass"]),
                    centre_m=np.asarray(entry["com"], dtype=float),
                    inertia_kg_m2=inertia,
                )
            )
    except (KeyError, TypeError, ValueError) as failure:
        raise FormatError(
            f"link {len(links)} of {path} cannot be read: {type(failure).__name__} {failure}",
            status="ULNA_ERROR_FORMAT",
            argument="path",
            detail=f"link {len(links)}",
        ) from failure
    return body_from_links(links)
