"""Mechanisms: planar robots, their kinematics, dynamics and friction.

Frame: the robot's base. Angles rad, torques N m, positions m, forces N. An external force is that of
the human on the robot: ``I(q) q'' + C(q, q') q' + F_r(q') = tau + J(q).T F_ext``, (5.1) of Dyck (2013).
Functions take one pose, shape (2,), or one a row, shape (rows, 2), and answer in kind.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._call import ArgumentError, Handle, ffi, lib, options, out_array, view

__all__ = ["Carriage", "Friction", "PlanarRobot"]

Array = NDArray[np.float64]


class _Robot(Handle):
    kind = "ulna_robot"
    __slots__ = ()


@dataclass(frozen=True)
class Friction:
    """Friction that is continuous in the speed: Ghannadi (2017), (3.25) with its sign repaired.

    Attributes
    ----------
    sliding : float
        Level at high speed, N or N m.
    breakaway : float
        Peak, reached at the threshold speed; at least `sliding`. N or N m.
    viscous : float
        N s/m or N m s/rad.
    threshold : float
        Speed of the peak, m/s or rad/s; positive where there is dry friction.

    Examples
    --------
    >>> Friction(sliding=0.3, breakaway=0.5, viscous=0.1, threshold=0.02).force([0.02, -0.02]).round(6)
    array([ 0.501799, -0.501799])
    """

    sliding: float = 0.0
    breakaway: float = 0.0
    viscous: float = 0.0
    threshold: float = 0.0

    def force(self, speed: ArrayLike) -> Array:
        """Friction at each speed; it opposes a positive speed when positive."""
        values = np.asarray(speed, dtype=float)
        struct = options(
            "ulna_friction",
            sliding=self.sliding,
            breakaway=self.breakaway,
            viscous=self.viscous,
            threshold=self.threshold,
        )
        force = out_array(lib.ulna_friction_force, struct, view(values.reshape(-1)))
        return force.reshape(values.shape)


class _Mechanism:
    """A planar robot of two joints: what every mechanism can answer."""

    _handle: _Robot

    @property
    def _pointer(self) -> Any:
        return self._handle.pointer

    def _rows(self, function: Any, first: ArrayLike, *more: Any, width: tuple[int, ...]) -> Array:
        """Call a function of poses and bring what it wrote into the shape of the first."""
        values = np.asarray(first, dtype=float)
        arguments = [view(np.atleast_2d(values))]
        for item in more:
            if isinstance(item, int):
                arguments.append(item)
            elif item is None:
                arguments.append(ffi.NULL)
            else:
                arguments.append(view(np.atleast_2d(np.asarray(item, dtype=float))))
        out = out_array(function, self._pointer, *arguments)
        return out.reshape((*values.shape[:-1], *width))

    @property
    def parameters(self) -> Array:
        """What the dynamics are linear in: alpha_1 to alpha_5, or mass and damping."""
        return out_array(lib.ulna_robot_parameters, self._pointer)

    def forward(self, angle: ArrayLike) -> Array:
        """Position of the handle, (A.1)."""
        return self._rows(lib.ulna_robot_forward, angle, width=(2,))

    def inverse(self, position: ArrayLike, *, limits: bool = True) -> Array:
        """Joint angles, (A.4); refuses what is out of reach and, with `limits`, beyond (A.2)."""
        keep = lib.ULNA_LIMITS_KEEP if limits else lib.ULNA_LIMITS_IGNORE
        return self._rows(lib.ulna_robot_inverse, position, keep, width=(2,))

    def jacobian(self, angle: ArrayLike) -> Array:
        """Derivative of the position by the angles, (A.3), shape (..., 2, 2)."""
        return self._rows(lib.ulna_robot_jacobian, angle, width=(2, 2))

    def jacobian_rate(self, angle: ArrayLike, rate: ArrayLike) -> Array:
        """Time derivative of the Jacobian at joint rates in rad/s, shape (..., 2, 2)."""
        return self._rows(lib.ulna_robot_jacobian_rate, angle, rate, width=(2, 2))

    def quality(self, angle: ArrayLike) -> Array:
        """Smallest over largest singular value of the Jacobian: 0 at a singular pose."""
        return self._rows(lib.ulna_robot_quality, angle, width=())

    def inertia(self, angle: ArrayLike) -> Array:
        """Inertia matrix, kg m^2, (A.6), shape (..., 2, 2)."""
        return self._rows(lib.ulna_robot_inertia, angle, width=(2, 2))

    def coriolis(self, angle: ArrayLike, rate: ArrayLike) -> Array:
        """Matrix C of the Coriolis torques ``C @ rate``, (A.6), shape (..., 2, 2)."""
        return self._rows(lib.ulna_robot_coriolis, angle, rate, width=(2, 2))

    def friction(self, rate: ArrayLike) -> Array:
        """Friction torque of the joints."""
        return self._rows(lib.ulna_robot_friction, rate, width=(2,))

    def inverse_dynamics(
        self,
        angle: ArrayLike,
        rate: ArrayLike,
        acceleration: ArrayLike,
        force: ArrayLike | None = None,
    ) -> Array:
        """Motor torque for a motion under an external force on the handle."""
        return self._rows(
            lib.ulna_robot_inverse_dynamics, angle, rate, acceleration, force, width=(2,)
        )

    def forward_dynamics(
        self, angle: ArrayLike, rate: ArrayLike, torque: ArrayLike, force: ArrayLike | None = None
    ) -> Array:
        """Joint acceleration under motor torque and an external force on the handle."""
        return self._rows(lib.ulna_robot_forward_dynamics, angle, rate, torque, force, width=(2,))

    def regressor(self, angle: ArrayLike, rate: ArrayLike, acceleration: ArrayLike) -> Array:
        """Regressor of (A.5), shape (..., 2, parameters): times them it is the torque in free motion."""
        width = (2, len(self.parameters))
        return self._rows(lib.ulna_robot_regressor, angle, rate, acceleration, width=width)


@dataclass(frozen=True)
class PlanarRobot(_Mechanism):
    """The planar capstan robot of Dyck (2013), appendix A, with the errata of (A.3) and (A.6).

    ``x = d1 cos(q1) + d2 sin(q2)``, ``y = d1 sin(q1) - d2 cos(q2)``.

    Parameters
    ----------
    link_m : (float, float)
        Lengths d1 and d2, m.
    alpha : five floats
        Table A.1: alpha_1 to alpha_3 in kg m^2, alpha_4 and alpha_5 (viscous friction) in N m s/rad.
    dry_friction : two `Friction`, optional
        Of the joints, beside alpha_4 and alpha_5: leave its `viscous` at 0.

    Examples
    --------
    >>> robot = PlanarRobot()
    >>> q = robot.inverse([0.383, 0.0])
    >>> np.degrees(q).round(1)
    array([43.9, 48.6])
    >>> bool(np.allclose(robot.forward(q), [0.383, 0.0], atol=1e-12))
    True
    >>> (robot.regressor(q, [0.1, 0.2], [1.0, 2.0]) @ robot.parameters
    ...  - robot.inverse_dynamics(q, [0.1, 0.2], [1.0, 2.0])).round(15)
    array([0., 0.])
    """

    link_m: tuple[float, float] = (0.254, 0.2667)
    alpha: tuple[float, float, float, float, float] = (0.06929, 0.04217, 0.04416, 0.06510, 0.07389)
    dry_friction: tuple[Friction, Friction] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "link_m", _numbers(self.link_m, 2, "link_m"))
        object.__setattr__(self, "alpha", _numbers(self.alpha, 5, "alpha"))
        dry = self.dry_friction
        if dry is not None and (len(dry) != 2 or any(not isinstance(f, Friction) for f in dry)):
            raise ArgumentError(
                "dry_friction must be two ulna.plant.Friction, one a joint",
                status="ULNA_ERROR_ARGUMENT",
                argument="dry_friction",
            )
        self._pointer  # noqa: B018 - refuses impossible parameters at once

    @cached_property
    def _handle(self) -> _Robot:
        dry = None
        if self.dry_friction is not None:
            if any(f.viscous != 0 for f in self.dry_friction):
                raise ArgumentError(
                    "viscous friction is alpha_4 and alpha_5: leave it out of dry_friction",
                    status="ULNA_ERROR_ARGUMENT",
                    argument="dry_friction",
                )
            dry = [v for f in self.dry_friction for v in (f.sliding, f.breakaway, f.threshold)]
        struct = options("ulna_capstan_options", link_m=self.link_m, alpha=self.alpha, dry=dry)
        return _Robot.make(lib.ulna_robot_new_capstan, struct)

    def __reduce__(self) -> Any:
        return PlanarRobot, (self.link_m, self.alpha, self.dry_friction)


@dataclass(frozen=True)
class Carriage(_Mechanism):
    """A Cartesian table of two independent axes: a robot whose own dynamics are simple.

    Its "angles" are positions in m and its "torques" forces in N. It is also the robot for experiments
    along one axis.

    Examples
    --------
    >>> Carriage(mass_kg=2.0).inertia([0.0, 0.0])
    array([[2., 0.],
           [0., 2.]])
    """

    mass_kg: float = 1.0
    damping_n_s_m: float = 1.0
    travel_m: float = 0.25

    def __post_init__(self) -> None:
        for name in ("mass_kg", "travel_m"):
            if not getattr(self, name) > 0:
                raise ArgumentError(
                    f"{name} must be positive", status="ULNA_ERROR_ARGUMENT", argument=name
                )
        if not self.damping_n_s_m >= 0:
            raise ArgumentError(
                "damping_n_s_m must not be negative",
                status="ULNA_ERROR_ARGUMENT",
                argument="damping_n_s_m",
            )
        self._pointer  # noqa: B018 - refuses impossible parameters at once

    @cached_property
    def _handle(self) -> _Robot:
        struct = options(
            "ulna_carriage_options",
            mass_kg=self.mass_kg,
            damping_n_s_m=self.damping_n_s_m or -1.0,
            travel_m=self.travel_m,
        )
        return _Robot.make(lib.ulna_robot_new_carriage, struct)

    def __reduce__(self) -> Any:
        return Carriage, (self.mass_kg, self.damping_n_s_m, self.travel_m)


def _numbers(values: Sequence[float], count: int, name: str) -> tuple[float, ...]:
    try:
        numbers = tuple(float(v) for v in values)
    except (TypeError, ValueError):
        numbers = ()
    if len(numbers) != count:
        raise ArgumentError(
            f"{name} must be {count} numbers", status="ULNA_ERROR_ARGUMENT", argument=name
        )
    return numbers
