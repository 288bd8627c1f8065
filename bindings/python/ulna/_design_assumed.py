"""What a design is held against: the arm, the robot, what disturbs, and limits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ._call import options
from ._design_arguments import pair
from .record import refuse

if TYPE_CHECKING:
    from .design import Design


def _square(values: Any, name: str, n: int | None = None) -> np.ndarray:
    """A matrix of finite numbers; with n, a number is that much on every axis."""
    matrix = np.asarray(values, dtype=float)
    if n is not None and matrix.ndim == 0:
        matrix = matrix * np.eye(n)
    elif n is not None and matrix.ndim == 1:
        matrix = np.diag(matrix)
    elif n is None:
        matrix = np.atleast_2d(matrix)
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or n not in (None, matrix.shape[0]):
        size = "square" if n is None else f"{n} x {n}"
        raise refuse(f"{name} must be {size}, got the shape {matrix.shape}", name)
    if not np.all(np.isfinite(matrix)):
        raise refuse(f"{name} must hold finite numbers", name)
    return matrix


@dataclass(frozen=True, eq=False)
class Arm:
    """The impedance that is expected: M x'' + B x' + K (x - x0) = -F.

    The default is participant P1 of Dyck (2013), relaxed, Table 3.2.

    Attributes
    ----------
    M, B, K : array_like, shape (n, n)
        Inertia, damping and stiffness; numbers for one axis.
    x0 : array_like, shape (n,), optional
        Where the arm would rest by itself, from where the robot starts; by default there.

    Examples
    --------
    >>> from ulna.design import Arm
    >>> Arm().n, Arm(M=1.5, B=8, K=300).n
    (2, 1)
    """

    M: Any = ((1.33, -0.93), (-0.96, 1.89))
    B: Any = ((5.75, -3.39), (-0.94, 10.60))
    K: Any = ((42.45, -34.38), (-23.02, 125.43))
    x0: Any = None

    def __post_init__(self) -> None:
        for name in ("M", "B", "K"):
            object.__setattr__(self, name, _square(getattr(self, name), name))
        x0 = np.zeros(self.n) if self.x0 is None else np.atleast_1d(np.asarray(self.x0, float))
        object.__setattr__(self, "x0", x0)

    @property
    def n(self) -> int:
        """Number of axes."""
        return int(self.M.shape[0])


@dataclass(frozen=True)
class Robot:
    """The robot as a mass on a spring and a damper.

    mass x'' + damping x' + stiffness x = u + F, with u = stiffness r + damping r' for a position
    design r, and u = the design for a force design. Numbers hold on every axis; a vector gives each
    axis its own, a matrix couples them.

    Attributes
    ----------
    stiffness : float or array_like
        Of the position controller, N/m or N m/rad; of a force-controlled robot by itself, often 0.
        The default is a stiff controller for position designs and 0 for force designs.
    damping : float or array_like
        N s/m or N m s/rad. By default half the critical damping of mass, an arm of 1.6 kg and
        stiffness for position designs, and 5 for force designs.
    mass : float or array_like
        Between motor and force sensor, kg or kg m^2.

    Examples
    --------
    >>> from ulna.design import Robot
    >>> soft = Robot(stiffness=500.0, damping=35.0, mass=1.1)
    """

    stiffness: Any = None
    damping: Any = None
    mass: Any = 1.1

    def _matrices(self, kind: str, n: int) -> dict[str, np.ndarray]:
        position = kind == "position"
        stiffness = (3000.0 if position else 0.0) if self.stiffness is None else self.stiffness
        mass = _square(self.mass, "mass", n)
        stiff = _square(stiffness, "stiffness", n)
        if self.damping is not None:
            damping = _square(self.damping, "damping", n)
        elif position:
            moved = np.abs(np.diag(mass)) + 1.6
            damping = np.diag(np.sqrt(np.abs(np.diag(stiff)) * moved))
        else:
            damping = 5.0 * np.eye(n)
        return {"stiffness": stiff, "damping": damping, "mass": mass}


@dataclass(frozen=True)
class Noise:
    """What disturbs the experiment. The defaults are those of a hand: joints need their own.

    Attributes
    ----------
    tremor : float
        Standard deviation of the force that the human adds on each axis, N or N m.
    tremor_band_hz : (float, float)
        Its band, of flat density.
    force : float
        Standard deviation of white noise on a sample of the force, N or N m. The default is the
        sensor of Dyck (2013).
    position : float
        The same of the position, m or rad; an encoder's step over the square root of 12.

    Examples
    --------
    >>> from ulna.design import Noise
    >>> calm = Noise(tremor=0.3)
    """

    tremor: float = 1.0
    tremor_band_hz: tuple[float, float] = (0.0, 5.0)
    force: float = 1 / 24
    position: float = 2e-6 / 12**0.5


@dataclass(frozen=True)
class Limits:
    """What arm and robot must not exceed; ``None`` is no limit.

    Attributes
    ----------
    force : float, optional
        Between hand and robot, N or N m.
    displacement : float, optional
        Of the hand from where it rests, m or rad.
    velocity : float, optional
        m/s or rad/s.
    per_axis : bool, optional
        Each axis by itself; else the length of the vector. By default joints by themselves.

    Examples
    --------
    >>> from ulna.design import Limits
    >>> gentle = Limits(force=15.0, velocity=0.25)
    """

    force: float | None = None
    displacement: float | None = None
    velocity: float | None = None
    per_axis: bool | None = None


def arm_of(arm: Any) -> Arm:
    """An `Arm` from one, from an estimate or anything else with M, B and K, or a mapping of these."""
    if arm is None:
        return Arm()
    if isinstance(arm, Arm):
        return arm
    if isinstance(arm, Mapping):
        unknown = sorted(set(arm) - {"M", "B", "K", "x0"})
        if unknown or not {"M", "B", "K"} <= set(arm):
            raise refuse("an arm as a mapping has the keys M, B, K and perhaps x0", "arm")
        return Arm(**arm)
    try:
        matrices = {name: getattr(arm, name) for name in ("M", "B", "K")}
    except AttributeError as failure:
        raise refuse(
            "arm must be an ulna.design.Arm, an estimate, or a mapping of M, B and K", "arm"
        ) from failure
    # An estimate's x0 is a place in the frame of its record: nothing says where this robot starts.
    return Arm(**matrices)


def structs_of(design: Design, arm: Any, robot: Robot | None, noise: Noise | None) -> list[Any]:
    """Arm, robot and noise as the interface takes them."""
    expected = arm_of(arm)
    if expected.n != design.n:
        raise refuse(f"the design has {design.n} axes and the arm {expected.n}", "arm")
    for value, kind, name in ((robot, Robot, "robot"), (noise, Noise, "noise")):
        if value is not None and not isinstance(value, kind):
            raise refuse(
                f"{name} must be an ulna.design.{kind.__name__}, not {type(value).__name__}", name
            )
    matrices = (robot or Robot())._matrices(design.kind, design.n)
    noise = noise or Noise()
    low, high = pair(noise.tremor_band_hz, "tremor_band_hz")
    return [
        options("ulna_design_arm", m=expected.M, b=expected.B, k=expected.K, x0=expected.x0),
        options("ulna_design_robot", **matrices),
        options(
            "ulna_design_noise",
            tremor=noise.tremor,
            tremor_low_hz=low,
            tremor_high_hz=high if high != 0 else -1.0,  # zero would mean the default
            force=noise.force,
            position=noise.position,
        ),
    ]
