"""Rigs and sensors to validate an experiment with.

Springs of known stiffness (Dyck 2013, appendix D), the empty rig taken out of a measurement, strain
gauges (appendix E), and the accelerometer against the encoders. Forces are those of the human, or of
the springs, on the robot.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ._call import Handle, check, ffi, lib, long_call, options, out_array, result, text, view
from ._sensed import ForceBudget, SensedForce, _Sensed, filters, lines, sensed, words
from .record import SEVERITIES, Finding, Record, refuse

if TYPE_CHECKING:
    from .impedance import ImpedanceEstimate
    from .passivity import Margins

__all__ = [
    "CalibrationLine",
    "ForceBudget",
    "SensedForce",
    "SensorCheck",
    "Spring",
    "SpringArray",
    "SpringDesign",
    "SpringEquilibrium",
    "StrainGauge",
    "TaredImpedance",
    "calibrate_line",
    "cross_check",
    "design_springs",
    "published_rigs",
    "tare",
    "tare_record",
]

FRAME_HALF_M = (0.175, 0.183)


# Springs -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Spring:
    """One extension spring: it pulls with ``rate (length - rest)`` and hangs slack when shorter.

    Attributes
    ----------
    anchor_m : (float, float)
        Where it is fixed to the frame, m.
    rate_n_m : float
    rest_m : float
        Relaxed length, m.
    """

    anchor_m: tuple[float, float]
    rate_n_m: float
    rest_m: float


@dataclass(frozen=True, eq=False)
class SpringEquilibrium:
    """Where the handle rests between springs and what it feels there.

    Attributes
    ----------
    position_m : ndarray, shape (2,)
    K : ndarray, shape (2, 2)
        Stiffness, N/m, from the analytic gradient; symmetric.
    eigenvalues_n_m : ndarray, shape (2,)
        Ascending.
    slack : tuple of bool
        Springs that hang slack there.
    slack_radius_m : float
        Displacement in any direction that leaves every taut spring taut.
    radius_m : float
        Within which linearity was looked at.
    deviation_n : float
        Largest force by which the law F = -K d errs within that radius.
    deviation_share : float
        The same relative to the linear force.
    linear_radius_m : float
        Radius at which that share reaches 5 %; at most 0.1 m.
    """

    position_m: np.ndarray
    K: np.ndarray
    eigenvalues_n_m: np.ndarray
    slack: tuple[bool, ...]
    slack_radius_m: float
    radius_m: float
    deviation_n: float
    deviation_share: float
    linear_radius_m: float

    @property
    def angle_deg(self) -> float:
        """Direction of the larger stiffness to +x, 0 to 180."""
        _, vectors = np.linalg.eigh(self.K)
        return float(np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1])) % 180.0)

    def summary(self) -> str:
        """Stiffness, equilibrium and range of linearity as text."""
        (kxx, kxy), (_, kyy) = self.K
        x, y = 1e3 * self.position_m
        slack = [str(i + 1) for i, loose in enumerate(self.slack) if loose]
        out = [
            f"stiffness    k_xx {kxx:.2f}, k_yy {kyy:.2f}, k_xy {kxy:.2f} N/m",
            f"equilibrium  ({x:.2f}, {y:.2f}) mm",
            f"linear       within {1e3 * self.radius_m:.0f} mm the force errs by at most "
            f"{self.deviation_n:.2g} N ({100 * self.deviation_share:.1f} %); 5 % at "
            f"{1e3 * self.linear_radius_m:.0f} mm",
            f"taut         up to {1e3 * self.slack_radius_m:.0f} mm from there",
        ]
        if slack:
            out.append(f"! slack at the equilibrium: spring {', '.join(slack)} of the array")
        if self.slack_radius_m < self.radius_m:
            out.append(f"! a spring goes slack within {1e3 * self.radius_m:.0f} mm")
        return "\n".join(out)

    def __repr__(self) -> str:
        (kxx, kxy), (_, kyy) = self.K
        return f"<SpringEquilibrium K=[{kxx:.4g} {kxy:.4g} {kxy:.4g} {kyy:.4g}] N/m>"


def _positions(position: ArrayLike) -> tuple[np.ndarray, Any]:
    values = np.asarray(position, dtype=float)
    if values.ndim not in (1, 2) or values.shape[-1] != 2:
        raise refuse(
            f"positions must have the shape (2,) or (n, 2), got {values.shape}", "position"
        )
    return values, view(np.atleast_2d(values))


@dataclass(frozen=True)
class SpringArray:
    """Linear springs between a handle and a frame, at most eight. Dyck (2013), appendix D.

    The stored energy is convex, so there is one equilibrium at most.

    Parameters
    ----------
    springs : sequence of Spring
    half_m : (float, float)
        Half sides of the frame around `centre_m`, for drawings.
    centre_m : (float, float)

    Examples
    --------
    >>> from ulna.rig import SpringArray
    >>> array = SpringArray.on_frame([80] * 8, rest_m=0.09)
    >>> array.equilibrium().K.round(3)
    array([[501.901,   0.   ],
           [  0.   , 503.384]])
    """

    springs: tuple[Spring, ...]
    half_m: tuple[float, float] = FRAME_HALF_M
    centre_m: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        object.__setattr__(self, "springs", tuple(self.springs))
        if not 1 <= len(self.springs) <= lib.ULNA_SPRINGS_MOST:
            raise refuse(
                f"a spring array has from 1 to 8 springs, got {len(self.springs)}", "springs"
            )
        self.force(self.springs[0].anchor_m)  # refuses impossible springs at once

    @classmethod
    def on_frame(
        cls,
        rates_n_m: ArrayLike,
        *,
        rest_m: ArrayLike = 0.09,
        centre_m: Sequence[float] = (0.0, 0.0),
        half_m: Sequence[float] = FRAME_HALF_M,
    ) -> SpringArray:
        """Springs at the places k1 to k8 of a frame; a rate of 0 leaves a place empty.

        The places are (-x,-y) (-x,0) (-x,+y) (0,+y) (+x,+y) (+x,0) (+x,-y) (0,-y).

        Parameters
        ----------
        rates_n_m : array_like, shape (8,)
        rest_m : float or array_like, shape (8,)
            Relaxed lengths, m.
        """
        rates = np.asarray(rates_n_m, dtype=float).reshape(-1)
        if rates.shape != (8,):
            raise refuse(f"a frame has eight places, got {len(rates)} rates", "rates_n_m")
        rests = np.broadcast_to(np.asarray(rest_m, dtype=float), (8,))
        places = frame_places(centre_m=centre_m, half_m=half_m)
        springs = [
            Spring((float(x), float(y)), float(rate), float(rest))
            for (x, y), rate, rest in zip(places, rates, rests, strict=True)
            if rate != 0
        ]
        return cls(tuple(springs), _pair(half_m, "half_m"), _pair(centre_m, "centre_m"))

    @cached_property
    def _array(self) -> Any:
        rows = ffi.new("ulna_spring[]", len(self.springs))
        for row, spring in zip(rows, self.springs, strict=True):
            row.anchor_x_m, row.anchor_y_m = map(float, spring.anchor_m)
            row.rate_n_m = float(spring.rate_n_m)
            row.rest_m = float(spring.rest_m)
        return rows

    def __array__(self, dtype: Any = None, copy: Any = None) -> np.ndarray:
        # What ulna.sim.Arm takes: anchor x, anchor y, rate and rest length of every spring.
        rows = [(*s.anchor_m, s.rate_n_m, s.rest_m) for s in self.springs]
        return np.array(rows, dtype=dtype or float)

    def __len__(self) -> int:
        return len(self.springs)

    def force(self, position: ArrayLike) -> np.ndarray:
        """Force of the springs on the handle, N, at one position (2,) or several (n, 2). (D.1)."""
        values, rows = _positions(position)
        return out_array(lib.ulna_springs_force, self._array, len(self), rows, shape=values.shape)

    def stiffness(self, position: ArrayLike) -> np.ndarray:
        """-dF/dx, N/m, at one position (2,) or several (n, 2): shape (..., 2, 2)."""
        values, rows = _positions(position)
        shape = (*values.shape[:-1], 2, 2)
        return out_array(lib.ulna_springs_stiffness, self._array, len(self), rows, shape=shape)

    def equilibrium(self, *, radius_m: float = 0.025) -> SpringEquilibrium:
        """Where the handle rests, the stiffness there, and how far it is linear.

        Parameters
        ----------
        radius_m : float
            Of the motion; linearity is judged within.
        """
        info = result("ulna_springs_info")
        if not radius_m > 0:
            raise refuse("radius_m must be above 0", "radius_m")
        check(lib.ulna_springs_equilibrium(self._array, len(self), float(radius_m), info))
        return SpringEquilibrium(
            position_m=np.array([info.x_m, info.y_m]),
            K=np.array(list(info.stiffness_n_m)).reshape(2, 2),
            eigenvalues_n_m=np.array(list(info.eigenvalues_n_m)),
            slack=tuple(bool(info.slack[i]) for i in range(len(self))),
            slack_radius_m=info.slack_radius_m,
            radius_m=float(radius_m),
            deviation_n=info.deviation_n,
            deviation_share=info.deviation_share,
            linear_radius_m=info.linear_radius_m,
        )

    def summary(self) -> str:
        """Springs and equilibrium as text."""
        out = [
            f"spring {i + 1}     {s.rate_n_m:.4g} N/m, {1e3 * s.rest_m:.4g} mm, at "
            f"({1e3 * s.anchor_m[0]:.4g}, {1e3 * s.anchor_m[1]:.4g}) mm"
            for i, s in enumerate(self.springs)
        ]
        return "\n".join([*out, self.equilibrium().summary()])

    def plot(self, **keywords: Any) -> Any:
        """Draw frame, springs, force field and ellipse; see `ulna.plot.spring_array`."""
        from . import plot

        return plot.spring_array(self, **keywords)

    def __repr__(self) -> str:
        rates = " ".join(f"{s.rate_n_m:.4g}" for s in self.springs)
        return f"<SpringArray: {len(self)} springs of {rates} N/m>"


def _pair(values: Sequence[float], name: str) -> tuple[float, float]:
    pair = tuple(float(v) for v in values)
    if len(pair) != 2:
        raise refuse(f"{name} must be two numbers, x and y", name)
    return pair


def frame_places(
    *, centre_m: Sequence[float] = (0.0, 0.0), half_m: Sequence[float] = FRAME_HALF_M
) -> np.ndarray:
    """Places k1 to k8 of a frame, m, shape (8, 2), in the order of the thesis.

    Examples
    --------
    >>> from ulna.rig import frame_places
    >>> frame_places()[:2]
    array([[-0.175, -0.183],
           [-0.175,  0.   ]])
    """
    centre, half = _pair(centre_m, "centre_m"), _pair(half_m, "half_m")
    return out_array(lib.ulna_springs_frame, *half, *centre, shape=(8, 2))


@dataclass(frozen=True, eq=False)
class SpringDesign:
    """Springs chosen for a wanted stiffness.

    Attributes
    ----------
    array : SpringArray
    equilibrium : SpringEquilibrium
    wanted : ndarray, shape (2, 2)
    rates_n_m : ndarray, shape (8,)
        At the places k1 to k8; 0: empty.
    kinds : tuple of int
        Which of the available springs hangs at each place; -1: none, or continuous rates.
    error : float
        \\|K - wanted\\| / \\|wanted\\|, Frobenius norms.
    taut, central : bool
        Every spring stays taut within the radius; the handle rests near the centre.
    exhaustive : bool
        Nothing else does better.
    evaluations : int
        Arrangements tried.
    """

    array: SpringArray
    equilibrium: SpringEquilibrium
    wanted: np.ndarray
    rates_n_m: np.ndarray
    kinds: tuple[int, ...]
    error: float
    taut: bool
    central: bool
    exhaustive: bool
    evaluations: int

    def summary(self) -> str:
        """What to hang where, and what it reaches, as text."""
        (kxx, kxy), (_, kyy) = self.wanted
        out = [
            f"wanted       k_xx {kxx:.2f}, k_yy {kyy:.2f}, k_xy {kxy:.2f} N/m",
            self.array.summary(),
            f"off by       {100 * self.error:.2g} %"
            + ("; nothing else does better" if self.exhaustive else "; the best that was found"),
        ]
        if not self.taut:
            out.append("! springs go slack within the radius: use shorter springs")
        if not self.central:
            out.append("! the handle rests far from the centre of the frame")
        return "\n".join(out)

    def plot(self, **keywords: Any) -> Any:
        """Draw the array with the wanted ellipse; see `ulna.plot.spring_array`."""
        from . import plot

        return plot.spring_array(self.array, wanted=self.wanted, **keywords)

    def __repr__(self) -> str:
        return f"<SpringDesign: {len(self.array)} springs, off by {100 * self.error:.2g} %>"


def design_springs(
    stiffness_n_m: ArrayLike | None = None,
    *,
    major_n_m: float | None = None,
    minor_n_m: float | None = None,
    angle_deg: float = 0.0,
    springs: Sequence[Sequence[float]] | None = None,
    rest_m: float = 0.09,
    max_rate_n_m: float = 0.0,
    offset_m: Sequence[float] = (0.0, 0.0),
    radius_m: float = 0.025,
    reach: float = 1.0 / 3.0,
    centre_m: Sequence[float] = (0.0, 0.0),
    half_m: Sequence[float] = FRAME_HALF_M,
    seed: int = 0,
    threads: int = 0,
    progress: bool = False,
) -> SpringDesign:
    """Springs for the frame that give the handle a wanted stiffness.

    Parameters
    ----------
    stiffness_n_m : array_like, shape (2, 2)
        Symmetric and positive definite. Or its ellipse:
    major_n_m, minor_n_m, angle_deg : float
        Eigenvalues and the direction of the larger one to +x.
    springs : sequence of (rate, rest length) or (rate, rest length, count), optional
        The drawer: N/m, m, and how many there are (0 or left out: enough). Without it the rates are
        free, for springs that will be wound or combined.
    rest_m, max_rate_n_m, offset_m
        For free rates: relaxed length, largest rate (0: no limit), wanted equilibrium from the
        centre.
    radius_m : float
        Of the motion: every spring stays taut within.
    reach : float
        Share of the half sides within which the handle may rest.
    seed : int
        Of the search where the drawer is too large to try every arrangement.

    Examples
    --------
    >>> from ulna.rig import design_springs
    >>> design = design_springs([[440, 0], [0, 300]], springs=[(80, 0.09), (200, 0.10), (90, 0.10)])
    >>> design
    <SpringDesign: 4 springs, off by 4.8 %>
    >>> design.rates_n_m.tolist()
    [90.0, 90.0, 90.0, 0.0, 0.0, 200.0, 0.0, 0.0]
    """
    if (stiffness_n_m is None) == (major_n_m is None):
        raise refuse(
            "give a stiffness matrix, or an ellipse by major_n_m and minor_n_m", "major_n_m"
        )
    if stiffness_n_m is None:
        if minor_n_m is None or not major_n_m >= minor_n_m > 0:  # type: ignore[operator]
            raise refuse("an ellipse of stiffness has major_n_m >= minor_n_m > 0", "minor_n_m")
        direction = np.array([np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))])
        wanted = minor_n_m * np.eye(2) + (major_n_m - minor_n_m) * np.outer(direction, direction)
    else:
        wanted = np.asarray(stiffness_n_m, dtype=float)
        if wanted.shape != (2, 2):
            raise refuse(
                f"the stiffness must have the shape (2, 2), got {wanted.shape}", "stiffness_n_m"
            )
    kinds = None
    if springs is not None:
        if len(springs) == 0:
            raise refuse(
                "the drawer is empty: give springs, or leave it out for free rates", "springs"
            )
        kinds = ffi.new("ulna_spring_kind[]", len(springs))
        for kind, row in zip(kinds, springs, strict=True):
            if len(row) not in (2, 3):
                raise refuse("a spring is given as (rate, rest length) or with a count", "springs")
            kind.rate_n_m, kind.rest_m = float(row[0]), float(row[1])
            kind.count = int(row[2]) if len(row) == 3 else 0
    half, centre = _pair(half_m, "half_m"), _pair(centre_m, "centre_m")
    wish = options(
        "ulna_springs_wish",
        radius_m=float(radius_m),
        reach=float(reach),
        kind_count=0 if springs is None else len(springs),
        rest_m=float(rest_m),
        max_rate_n_m=float(max_rate_n_m),
        seed=seed,
        threads=threads,
    )
    wish.stiffness_n_m = wanted.ravel().tolist()
    wish.half_m, wish.centre_m = half, centre
    wish.offset_m = _pair(offset_m, "offset_m")
    if kinds is not None:
        wish.kinds = kinds
    choice = result("ulna_springs_choice")
    long_call(lib.ulna_springs_choose, wish, ffi.NULL, choice, progress=progress, label="springs")
    rates, rests = np.array(list(choice.rates_n_m)), np.array(list(choice.rests_m))
    array = SpringArray.on_frame(rates, rest_m=rests, centre_m=centre, half_m=half)
    return SpringDesign(
        array=array,
        equilibrium=array.equilibrium(radius_m=radius_m),
        wanted=wanted,
        rates_n_m=rates,
        kinds=tuple(choice.kinds),
        error=choice.error,
        taut=bool(choice.taut),
        central=bool(choice.central),
        exhaustive=bool(choice.exhaustive),
        evaluations=choice.evaluations,
    )


@dataclass(frozen=True, eq=False)
class PublishedRig:
    """A mass-spring system of Tables 3.1 or 5.1 of Dyck (2013).

    Attributes
    ----------
    K : ndarray, shape (2, 2)
        Stiffness calculated from measured springs, N/m.
    x0_m : ndarray, shape (2,)
        Equilibrium in the robot's frame.
    masses_kg : tuple of float
        Payloads that were weighed and mounted.
    """

    K: np.ndarray
    x0_m: np.ndarray
    masses_kg: tuple[float, ...]


def published_rigs(table: str) -> dict[str, PublishedRig]:
    """The mass-spring systems of Table "3.1" (one payload each) or "5.1" (five payloads each).

    Examples
    --------
    >>> from ulna.rig import published_rigs
    >>> published_rigs("3.1")["1"].masses_kg, published_rigs("5.1")["K5"].masses_kg
    ((0.293,), (0.539, 0.786, 1.031, 1.279, 1.527))
    """
    from . import _dyck2013 as dyck

    if table not in ("3.1", "5.1"):
        raise refuse(f"rigs are published in Tables 3.1 and 5.1, not {table!r}", "table")
    rows = dyck.SPRINGS_31 if table == "3.1" else dyck.SPRINGS_51
    out = {}
    for name, (kxx, kyy, ks, x, y, *mass) in rows.items():
        masses = tuple(mass) if mass else tuple(dyck.MASSES_51.values())
        out[name] = PublishedRig(np.array([[kxx, ks], [ks, kyy]]), 1e-3 * np.array([x, y]), masses)
    return out


# The empty rig -----------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class TaredImpedance:
    """The impedance of the hand: a measurement less the empty rig.

    Attributes
    ----------
    M, B, K : ndarray, shape (n, n)
    x0 : ndarray, shape (n,)
        Where the hand alone is at rest; NaN where K is singular.
    cov : ndarray, shape (3 n^2 + n, 3 n^2 + n)
        Covariance of M, B, K row by row, then x0: those of both identifications together.
    axes : tuple of str
    measured, rig : ImpedanceEstimate
    """

    M: np.ndarray
    B: np.ndarray
    K: np.ndarray
    x0: np.ndarray
    cov: np.ndarray
    axes: tuple[str, ...]
    measured: ImpedanceEstimate
    rig: ImpedanceEstimate

    def se(self, name: str) -> np.ndarray:
        """Standard errors of "M", "B", "K" or "x0", in its shape."""
        n = len(self.axes)
        places = {"M": (0, (n, n)), "B": (n * n, (n, n)), "K": (2 * n * n, (n, n))}
        if name not in (*places, "x0"):
            raise refuse(f"there is no parameter {name!r}; there are M, B, K and x0", "name")
        first, shape = places.get(name, (3 * n * n, (n,)))
        return np.sqrt(np.diag(self.cov)[first : first + int(np.prod(shape))]).reshape(shape)

    def margins(self, **keywords: Any) -> Margins:
        """Passivity margins of the hand's M, B and K; keywords as `ulna.passivity.of_model`."""
        from . import passivity

        return passivity.of_model(self.M, self.B, self.K, **keywords)

    def summary(self) -> str:
        """Measured, rig and hand side by side, as text."""
        from ._words import _entry

        out = [f"{'':<6}{'measured':>22}{'empty rig':>22}{'hand':>22}"]
        units = self.measured.units
        for name in ("M", "B", "K"):
            for k in range(len(self.axes) ** 2):
                i, j = divmod(k, len(self.axes))
                cells = [
                    _entry(getattr(e, name)[i, j], e.se(name)[i, j])
                    for e in (self.measured, self.rig, self)
                ]
                label = f"{name}_{self.axes[i]}{self.axes[j]}"
                out.append(
                    f"{label:<6}" + "".join(f"{cell:>22}" for cell in cells) + f" {units[name]}"
                )
        least = np.linalg.eigvalsh(0.5 * (self.M + self.M.T))[0]
        if least < 0:
            out.append("! the rig holds more inertia than was measured: is it the rig's recording?")
        return "\n".join(out)

    def __repr__(self) -> str:
        parts = []
        for name in ("M", "B", "K"):
            pairs = zip(getattr(self, name).ravel(), self.se(name).ravel(), strict=True)
            entries = " ".join(f"{v:.4g}±{e:.2g}" for v, e in pairs)
            parts.append(f"{name}=[{entries}] {self.measured.units[name]}")
        return f"<TaredImpedance {' '.join(parts)}>"


def _natural(estimate: Any, name: str) -> np.ndarray:
    try:
        blocks = (estimate.M, estimate.B, estimate.K, estimate.x0)
        return np.concatenate([np.asarray(block, dtype=float).ravel() for block in blocks])
    except AttributeError:
        raise refuse(f"{name} must be an impedance with M, B, K, x0 and cov", name) from None


def tare(measured: ImpedanceEstimate, rig: ImpedanceEstimate) -> TaredImpedance:
    """The hand's impedance: what was measured less the empty rig, with the errors of both.

    Parameters
    ----------
    measured : ImpedanceEstimate
        With the arm, nothing removed (`payload_kg` 0).
    rig : ImpedanceEstimate
        From a recording without the arm, along the same axes. Where the rig has no springs, identify
        it with a stiffness all the same: it then comes out near zero, with its error.

    Examples
    --------
    >>> import numpy as np
    >>> import ulna
    >>> from ulna.rig import tare
    >>> rng, t = np.random.default_rng(0), np.arange(20000) / 1000
    >>> x = sum(np.sin(2 * np.pi * f * t + p) for f, p in zip((0.4, 1.1, 2.3), (0, 1, 2))) / 100
    >>> v = np.gradient(x, t); a = np.gradient(v, t)
    >>> def identify(m, b, k):
    ...     force = -(m * a + b * v + k * x) + 0.01 * rng.normal(size=len(t))
    ...     log = ulna.Record.from_arrays(t, {"x": x, "F_x": force})
    ...     return ulna.identify_impedance(log)
    >>> hand = tare(identify(2.0, 8.0, 120.0), identify(0.5, 1.0, 20.0))
    >>> hand.M.round(1), hand.B.round(0), hand.K.round(0)
    (array([[1.5]]), array([[7.]]), array([[100.]]))
    """
    one, other = _natural(measured, "measured"), _natural(rig, "rig")
    if measured.payload_kg or rig.payload_kg:
        raise refuse(
            "a payload was already removed: identify both with payload_kg 0, the tare removes it",
            "measured" if measured.payload_kg else "rig",
        )
    if measured.rotational != rig.rotational or measured.axes != rig.axes:
        raise refuse(
            f"the measurement is along {', '.join(measured.axes)}, the rig along "
            f"{', '.join(rig.axes)}: they must be the same axes and units",
            "rig",
        )
    views = (view(one), view(measured.cov), view(other), view(rig.cov))
    value = out_array(lib.ulna_tare_impedance, *views, lib.ULNA_TARE_PARAMETERS)
    cov = out_array(lib.ulna_tare_impedance, *views, lib.ULNA_TARE_COVARIANCE)
    n = measured.n
    matrices = value[: 3 * n * n].reshape(3, n, n)
    return TaredImpedance(
        M=matrices[0],
        B=matrices[1],
        K=matrices[2],
        x0=value[3 * n * n :],
        cov=cov.reshape(len(value), len(value)),
        axes=measured.axes,
        measured=measured,
        rig=rig,
    )


def tare_record(
    record: Record,
    rig: ImpedanceEstimate,
    *,
    position: str | Sequence[str] | None = None,
    force: str | Sequence[str] | None = None,
    lowpass_hz: float | None = None,
    window: int | None = None,
    order: int | None = None,
    progress: bool = False,
) -> SensedForce:
    """The record with forces of the hand alone: F + M_r x'' + B_r x' + K_r (x - x_r).

    The motion is differentiated with a low pass four times above what an identification would
    choose, so that what is identified afterwards is the hand; rows at the ends of every trial are
    left out. The errors of the rig's parameters travel along: see `SensedForce.budget`.

    Parameters
    ----------
    record : Record
        With the arm.
    rig : ImpedanceEstimate or TaredImpedance
        Of the recording without it.
    lowpass_hz : float, optional
        Of the differentiation.
    """
    prepare = filters(
        position=position, force=force, lowpass_hz=lowpass_hz, window=window, order=order
    )
    out = ffi.new("ulna_sensed **")
    long_call(
        lib.ulna_tare_record,
        record._handle.pointer,
        prepare,
        view(_natural(rig, "rig")),
        view(rig.cov),
        ffi.NULL,
        out,
        progress=progress,
        label="tare",
    )
    return sensed(_Sensed(out[0]))


# Strain gauges -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class CalibrationLine:
    """force = slope_n_v volts + intercept_n, with its errors.

    Attributes
    ----------
    slope_n_v, intercept_n : float
    slope_se, intercept_se : float
        Standard errors.
    covariance : float
        Of slope and intercept.
    r_squared : float
        Weighted.
    residual_n : float
        Standard deviation of a calibration point.
    chi_square, fit_p : float
        Of the residuals in units of the errors given, and the chance of one this large for a true
        line; NaN without errors.
    curvature_p : float
        Chance of a quadratic part this large for a true line; NaN for three points.
    largest_residual : float
        Studentised, of the point `largest_row`.
    outlier_p : float
        Chance of a largest residual like this for a true line; NaN for three points.
    points : int
    """

    slope_n_v: float
    intercept_n: float
    slope_se: float = 0.0
    intercept_se: float = 0.0
    covariance: float = 0.0
    r_squared: float = np.nan
    residual_n: float = np.nan
    chi_square: float = np.nan
    fit_p: float = np.nan
    curvature_p: float = np.nan
    largest_residual: float = np.nan
    outlier_p: float = np.nan
    largest_row: int = 0
    points: int = 0

    @property
    def warnings(self) -> tuple[str, ...]:
        """What speaks against the line, in words; empty when nothing does."""
        out = []
        if self.curvature_p < 0.01:
            out.append(
                f"The points bend away from the line (p = {self.curvature_p:.1g}): calibrate within "
                "the range of use, or with a curve."
            )
        if self.fit_p < 0.01:
            out.append(
                f"The points scatter more than their errors allow (p = {self.fit_p:.1g}): the errors "
                "are too small or the line does not hold."
            )
        if self.outlier_p < 0.01:
            out.append(
                f"Point {self.largest_row} (from 0) lies further off the line than the others allow "
                f"(p = {self.outlier_p:.1g}): check its weight and reading."
            )
        return tuple(out)

    def summary(self) -> str:
        """The line as in (E.2), with its checks."""
        from ._words import _paragraph

        out = [
            f"F = ({self.slope_n_v:.4g} ± {self.slope_se:.2g}) N/V · V + "
            f"({self.intercept_n:.4g} ± {self.intercept_se:.2g}) N",
            f"  R² = {self.r_squared:.4f}, {self.points} points, ± {self.residual_n:.2g} N each",
        ]
        return "\n".join([*out, *(_paragraph(words_, "  ! ") for words_ in self.warnings)])

    def __repr__(self) -> str:
        return (
            f"<CalibrationLine: {self.slope_n_v:.4g} ± {self.slope_se:.2g} N/V, "
            f"{self.intercept_n:.4g} ± {self.intercept_se:.2g} N, R² {self.r_squared:.4f}>"
        )

    def _struct(self) -> Any:
        return options(
            "ulna_gauge_line",
            slope_n_v=float(self.slope_n_v),
            intercept_n=float(self.intercept_n),
            slope_se=float(self.slope_se),
            intercept_se=float(self.intercept_se),
            covariance=float(self.covariance),
        )


def _line(raw: Any) -> CalibrationLine:
    fields = [name for name in CalibrationLine.__dataclass_fields__]
    return CalibrationLine(**{name: getattr(raw, name) for name in fields})


def calibrate_line(
    volts: ArrayLike,
    forces_n: ArrayLike,
    errors_n: ArrayLike | None = None,
    *,
    relative: bool = False,
) -> CalibrationLine:
    """A calibration line by weighted least squares of known forces on voltages.

    Parameters
    ----------
    volts, forces_n : array_like, shape (n,)
    errors_n : float or array_like, shape (n,), optional
        Standard deviation of every force.
    relative : bool
        The errors are weights only; the scatter of the points gives the scale.

    Examples
    --------
    >>> from ulna.rig import calibrate_line
    >>> line = calibrate_line([-2.0, -1.0, 0.0, 1.0, 2.0], [17.6, 9.1, 0.6, -8.0, -16.5])
    >>> line
    <CalibrationLine: -8.53 ± 0.01 N/V, 0.56 ± 0.014 N, R² 1.0000>
    """
    raw = result("ulna_gauge_line")
    if errors_n is not None and np.ndim(errors_n) == 0:
        errors_n = np.full(np.size(volts), errors_n)
    errors = ffi.NULL if errors_n is None else view(np.asarray(errors_n))
    check(
        lib.ulna_gauge_calibrate(
            view(np.asarray(volts)), view(np.asarray(forces_n)), errors, int(relative), raw
        )
    )
    return _line(raw)


@dataclass(frozen=True)
class StrainGauge:
    """A two-axis bending-beam force sensor. Dyck (2013), appendix E.

    Attributes
    ----------
    x, y : CalibrationLine
        Of the sensor's axes.
    lever_m : float
        Lever arm of the calibration, from the gauges to where the force acted.
    lever_se_m : float
        Its standard error.

    Examples
    --------
    The published sensor on a handle that lies 5 mm further out:

    >>> import numpy as np
    >>> import ulna
    >>> from ulna.rig import StrainGauge
    >>> log = ulna.Record.from_arrays(
    ...     np.arange(3) / 1000,
    ...     {"V_x": [0.0, 1.0, 2.0], "V_y": [0.0, 0.0, 0.0], "theta_2": [0.0, 0.0, 0.0]},
    ...     units={"V_x": "V", "V_y": "V", "theta_2": "rad"},
    ... )
    >>> force = StrainGauge.published().apply(log, volts="V", angle="theta_2", lever_m=0.0738)
    >>> force.record["F_y"].round(3)
    array([-0.503,  7.477, 15.457])
    """

    x: CalibrationLine
    y: CalibrationLine
    lever_m: float = 0.0688
    lever_se_m: float = 0.0

    @classmethod
    def published(cls) -> StrainGauge:
        """The sensor of the thesis: (E.2), calibrated at 68.8 mm."""
        lines_ = []
        for axis in (0, 1):
            raw = result("ulna_gauge_line")
            check(lib.ulna_gauge_published(axis, raw))
            lines_.append(_line(raw))
        return cls(*lines_)

    def apply(
        self,
        record: Record,
        *,
        volts: str | Sequence[str],
        angle: str | None = None,
        lever_m: float | None = None,
        lever_se_m: float = 0.0,
        rest_s: Sequence[float] | None = None,
        sign: int = 1,
        name: str = "F",
    ) -> SensedForce:
        """Force channels beside those of a record, with the calibration's errors.

        Parameters
        ----------
        volts : str or two names
            Word for the channels of the raw voltages, the sensor's first axis first.
        angle : str, optional
            Channel that the sensor turns with (theta_2 on the robot of the thesis), (E.4); without it
            the forces stay in the sensor's axes.
        lever_m, lever_se_m : float, optional
            Lever arm of this recording, (E.3), and its standard error.
        rest_s : (float, float), optional
            Span of the clock without any force, which gives the zero; else the intercepts do.
        sign : {1, -1}
            -1 turns the force.
        name : str
            The channels are ``name_x`` and ``name_y``. Forces that the record had become other
            channels.
        """
        begin = end = 0
        if rest_s is not None:
            start, stop = _pair(rest_s, "rest_s")
            begin, end = np.searchsorted(record.time, [start, stop]).tolist()
            if end - begin < 2:
                raise refuse(
                    f"the span {start:g} to {stop:g} s holds fewer than two samples", "rest_s"
                )
        if lever_m is not None and not lever_m > 0:
            raise refuse("lever_m must be above 0", "lever_m")
        struct = options(
            "ulna_gauge_options",
            x=self.x._struct(),
            y=self.y._struct(),
            volts=words(volts),
            angle=angle,
            name=name,
            calibration_lever_m=float(self.lever_m),
            calibration_lever_error_m=float(self.lever_se_m),
            lever_m=lever_m,
            lever_error_m=float(lever_se_m),
            rest_begin=begin,
            rest_end=end,
            sign=sign,
        )
        return sensed(_Sensed.make(lib.ulna_gauge_apply, record._handle.pointer, struct))

    def summary(self) -> str:
        """Both lines as text."""
        return f"x: {self.x.summary()}\ny: {self.y.summary()}\nlever {1e3 * self.lever_m:.4g} mm"


# Accelerometer against encoders ------------------------------------------------------------------


class _SensorCheck(Handle):
    kind = "ulna_sensor_check"
    __slots__ = ()


_WORST = {
    lib.ULNA_DISAGREE_NONE: "good",
    lib.ULNA_DISAGREE_UNRELATED: "unrelated",
    lib.ULNA_DISAGREE_AXES: "axes_exchanged",
    lib.ULNA_DISAGREE_SIGN: "sign_reversed",
    lib.ULNA_DISAGREE_UNIT: "unit",
    lib.ULNA_DISAGREE_TURNED: "turned",
    lib.ULNA_DISAGREE_SCALE: "scale",
    lib.ULNA_DISAGREE_LAG: "lag",
}


@dataclass(frozen=True, eq=False)
class SensorCheck:
    """Accelerometer, twice integrated, against the encoders: p(t) = gain x(t - lag).

    Attributes
    ----------
    outcome : str
        "good", or what is worst: "unrelated", "axes_exchanged", "sign_reversed", "unit", "turned",
        "scale" or "lag".
    findings : tuple of Finding
        Everything that disagrees, in words.
    gain, gain_se : ndarray, shape (n, n)
        Rows are axes of the accelerometer, columns of the encoders; the identity when they agree.
    lag_s, lag_se_s : ndarray, shape (n,)
        How much later the accelerometer is.
    correlation : ndarray, shape (n, n)
    agreement, corrected : ndarray, shape (n,)
        Variance accounted for, percent: as recorded, and with gain and lag.
    offset : ndarray, shape (n,)
        Mean of the accelerometer, m/s^2: bias or tilt; it drops out of the comparison.
    turned_deg, turned_se_deg : float
        By which the accelerometer's axes are turned in the plane.
    highpass_hz, lowpass_hz : float
        Band of the comparison.
    time, accelerometer, encoder : ndarray
        What is compared, m, thinned, first trial.
    """

    outcome: str
    findings: tuple[Finding, ...]
    accelerations: tuple[str, ...]
    positions: tuple[str, ...]
    gain: np.ndarray
    gain_se: np.ndarray
    lag_s: np.ndarray
    lag_se_s: np.ndarray
    correlation: np.ndarray
    agreement: np.ndarray
    corrected: np.ndarray
    offset: np.ndarray
    turned_deg: float
    turned_se_deg: float
    highpass_hz: float
    lowpass_hz: float
    time: np.ndarray
    accelerometer: np.ndarray
    encoder: np.ndarray

    def summary(self) -> str:
        """Gains, lags and what disagrees, as text."""
        from ._words import _paragraph

        out = [
            f"Accelerometer, twice integrated, against encoders, {self.highpass_hz:.2g} to "
            f"{self.lowpass_hz:.2g} Hz: {self.outcome.replace('_', ' ')}"
        ]
        for i, name in enumerate(self.accelerations):
            gains = ", ".join(
                f"{g:.4f} ± {s:.2g} of {x}"
                for g, s, x in zip(self.gain[i], self.gain_se[i], self.positions, strict=True)
            )
            out += [
                f"  {name}: {gains}",
                f"  {'':<{len(name)}}  later by {1e3 * self.lag_s[i]:.2f} ± "
                f"{1e3 * self.lag_se_s[i]:.2g} ms; agrees to {self.agreement[i]:.1f} %, "
                f"corrected {self.corrected[i]:.1f} %",
            ]
        marks = {"warning": "  ! ", "error": "  ! "}
        out += [_paragraph(f.message, marks.get(f.severity, "  - ")) for f in self.findings]
        return "\n".join(out)

    def plot(self, **keywords: Any) -> Any:
        """Draw both traces; see `ulna.plot.sensor_check`."""
        from . import plot

        return plot.sensor_check(self, **keywords)

    def __repr__(self) -> str:
        gains = " ".join(
            f"{g:.3f}±{s:.1g}"
            for g, s in zip(np.diag(self.gain), np.diag(self.gain_se), strict=True)
        )
        return f"<SensorCheck: {self.outcome}, gain {gains}>"


def cross_check(
    record: Record,
    *,
    acceleration: str | Sequence[str],
    position: str | Sequence[str] | None = None,
    highpass_hz: float = 0.0,
    max_lag_s: float = 0.25,
    lowpass_hz: float | None = None,
    window: int | None = None,
    order: int | None = None,
    progress: bool = False,
) -> SensorCheck:
    """Do accelerometer and encoders see the same motion?

    The accelerometer is integrated twice; a cubic and everything below `highpass_hz` are removed
    from it and from the position by the same linear operator; gains and lags are fitted, with errors
    from leaving out blocks.

    Parameters
    ----------
    acceleration : str or names
        Word for the accelerometer's channels, m/s^2, as many as positions.
    position : str or names, optional
        Positions of the handle, m; by role where left out.
    highpass_hz : float
        0: from the motion, 0.2 to 1 Hz.
    max_lag_s : float
        Looked for in either direction.

    Examples
    --------
    >>> import numpy as np
    >>> import ulna
    >>> from ulna.rig import cross_check
    >>> t = np.arange(60000) / 1000
    >>> w = 2 * np.pi * np.array([0.7, 1.3, 2.1])
    >>> x = (0.01 * np.sin(w * t[:, None])).sum(axis=1)
    >>> a = (-0.01 * w**2 * np.sin(w * t[:, None])).sum(axis=1)
    >>> log = ulna.Record.from_arrays(t, {"x": x, "a_x": a / 9.80665}, units={"a_x": "m/s^2"})
    >>> print(cross_check(log, acceleration="a").findings[0].message)
    a_x looks as if it were in g: multiply it by 9.80665 to have m/s^2 (gain 0.102)
    """
    struct = options(
        "ulna_sensor_check_options",
        position=words(position),
        acceleration=words(acceleration),
        prepare=filters(lowpass_hz=lowpass_hz, window=window, order=order),
        highpass_hz=float(highpass_hz),
        max_lag_s=float(max_lag_s),
    )
    out = ffi.new("ulna_sensor_check **")
    long_call(
        lib.ulna_sensor_check_new,
        record._handle.pointer,
        struct,
        ffi.NULL,
        out,
        progress=progress,
        label="check",
    )
    handle = _SensorCheck(out[0])
    info = result("ulna_sensor_check_info")
    check(lib.ulna_sensor_check_get_info(handle.pointer, info))
    n = info.axes

    def get(quantity: int, *shape: int) -> np.ndarray:
        return out_array(lib.ulna_sensor_check_get_values, handle.pointer, quantity, shape=shape)

    def names(which: int) -> tuple[str, ...]:
        return lines(text(lib.ulna_sensor_check_get_text, handle.pointer, which))

    findings = []
    for index in range(info.findings):
        raw = result("ulna_finding")
        check(lib.ulna_sensor_check_get_finding(handle.pointer, index, raw))
        findings.append(_finding(raw))
    trace = get(lib.ULNA_SENSOR_CHECK_TRACE, -1, 1 + 2 * n)
    return SensorCheck(
        outcome=_WORST[info.worst],
        findings=tuple(findings),
        accelerations=names(lib.ULNA_SENSOR_CHECK_TEXT_ACCELERATIONS),
        positions=names(lib.ULNA_SENSOR_CHECK_TEXT_POSITIONS),
        gain=get(lib.ULNA_SENSOR_CHECK_GAIN, n, n),
        gain_se=get(lib.ULNA_SENSOR_CHECK_GAIN_ERROR, n, n),
        lag_s=get(lib.ULNA_SENSOR_CHECK_LAG, n),
        lag_se_s=get(lib.ULNA_SENSOR_CHECK_LAG_ERROR, n),
        correlation=get(lib.ULNA_SENSOR_CHECK_CORRELATION, n, n),
        agreement=get(lib.ULNA_SENSOR_CHECK_AGREEMENT, n),
        corrected=get(lib.ULNA_SENSOR_CHECK_CORRECTED, n),
        offset=get(lib.ULNA_SENSOR_CHECK_OFFSET, n),
        turned_deg=float(np.degrees(info.turned_rad)),
        turned_se_deg=float(np.degrees(info.turned_error_rad)),
        highpass_hz=info.highpass_hz,
        lowpass_hz=info.lowpass_hz,
        time=trace[:, 0],
        accelerometer=trace[:, 1 : 1 + n],
        encoder=trace[:, 1 + n :],
    )


def _finding(raw: Any) -> Finding:
    from ._call import decode

    return Finding(
        severity=SEVERITIES[raw.severity],
        code=decode(raw.code),
        channel=decode(raw.channel),
        row=raw.row,
        count=raw.count,
        message=decode(raw.message),
    )
