"""Impedance at the hand and at the joints.

With torques tau = J' F (F by the human on the robot) a restoring impedance at the hand acts on the
joints as::

    K_q = J' K J - Gamma,    B_q = J' B J,    M_q = J' M J,    Gamma_ik = sum_m dJ_mi/dq_k F_m

Gamma is the posture's share: under a force, a change of posture changes the torques even where the
hand is held by no stiffness at all. It is symmetric.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ._call import check, ffi, lib, options, out_array, result, view
from .impedance import _prepare_options
from .record import Record, _Record, refuse

if TYPE_CHECKING:
    from .impedance import ImpedanceEstimate

__all__ = [
    "Arm",
    "JointImpedance",
    "JointMargins",
    "angles_of_markers",
    "from_endpoint",
    "to_endpoint",
    "to_joints",
]


@dataclass(frozen=True)
class Arm:
    """A planar arm: shoulder, upper arm and forearm, as figures draw it beside an ellipse.

    ``hand = shoulder + upper (cos q1, sin q1) + fore (cos(q1 + q2), sin(q1 + q2))``; q1 is the
    angle of the upper arm to +x and q2 the flexion of the elbow (0: straight), positive for a right
    arm.

    Attributes
    ----------
    upper_arm_m, forearm_m : float
        Shoulder to elbow, elbow to hand.
    shoulder_m : (float, float)
        In the frame of the record.
    left : bool
        The elbow bends to the other side.

    Examples
    --------
    >>> from ulna.joint import Arm
    >>> arm = Arm(upper_arm_m=0.3, forearm_m=0.3)
    >>> arm.angles([0.3, 0.3]).round(3)
    array([0.   , 1.571])
    >>> arm.hand(arm.angles([0.1, 0.45])).round(6)
    array([0.1 , 0.45])
    """

    upper_arm_m: float = 0.31
    forearm_m: float = 0.34
    shoulder_m: tuple[float, float] = (0.0, 0.0)
    left: bool = False

    def __post_init__(self) -> None:
        for name in ("upper_arm_m", "forearm_m"):
            if not getattr(self, name) > 0:
                raise refuse(f"{name} is {getattr(self, name)!r}; it must be positive", name)
        if len(self.shoulder_m) != 2:
            raise refuse("shoulder_m must be two numbers, x and y", "shoulder_m")

    def _struct(self) -> Any:
        struct = options(
            "ulna_arm", upper_m=self.upper_arm_m, fore_m=self.forearm_m, left=self.left
        )
        struct.shoulder_m = [float(value) for value in self.shoulder_m]
        return struct

    def _pairs(self, function: Any, values: Any, name: str) -> np.ndarray:
        given = np.asarray(values, dtype=float)
        if given.ndim not in (1, 2) or given.shape[-1] != 2:
            raise refuse(f"{name} must be two numbers, or rows of two", name)
        rows = given.reshape(-1, 2)
        return out_array(function, self._struct(), view(rows)).reshape(given.shape)

    def hand(self, angles_rad: Any) -> np.ndarray:
        """Place of the hand for angles (2,) or (rows, 2), m."""
        return self._pairs(lib.ulna_arm_hand, angles_rad, "angles_rad")

    def angles(self, hand_m: Any) -> np.ndarray:
        """Angles for places of the hand (2,) or (rows, 2), rad.

        Raises
        ------
        ulna.AnalysisError
            Out of reach, with the row.
        """
        return self._pairs(lib.ulna_arm_angles, hand_m, "hand_m")

    def jacobian(self, angles_rad: Any) -> np.ndarray:
        """J = d hand / d angles, shape (2, 2)."""
        return self._posture(angles_rad)[0]

    def jacobian_slope(self, angles_rad: Any) -> np.ndarray:
        """dJ/dq1 and dJ/dq2, shape (2, 2, 2): the first index is the angle."""
        return self._posture(angles_rad)[1:]

    def _posture(self, angles_rad: Any) -> np.ndarray:
        given = view(np.asarray(angles_rad, dtype=float).reshape(-1))
        return out_array(lib.ulna_arm_posture, self._struct(), given).reshape(3, 2, 2)


def angles_of_markers(shoulder_m: Any, elbow_m: Any, wrist_m: Any) -> np.ndarray:
    """Joint angles of a planar arm from three markers, each (rows, 2): (rows, 2), unwrapped.

    Raises
    ------
    ulna.DataError
        Two markers in one place or a gap, with the row.

    Examples
    --------
    >>> from ulna.joint import angles_of_markers
    >>> angles_of_markers([[0, 0]], [[0.3, 0]], [[0.3, 0.3]]).round(3)
    array([[0.   , 1.571]])
    """
    markers = [np.atleast_2d(np.asarray(m, dtype=float)) for m in (shoulder_m, elbow_m, wrist_m)]
    return out_array(lib.ulna_arm_angles_of_markers, *(view(m) for m in markers)).reshape(-1, 2)


@dataclass(frozen=True)
class JointMargins:
    """Smallest eigenvalues of the symmetric parts, and the probability that none is negative.

    Intervals come from draws from the covariance; without one they are the values themselves.
    """

    m_min: float
    b_min: float
    k_min: float
    m_interval: tuple[float, float]
    b_interval: tuple[float, float]
    k_interval: tuple[float, float]
    probability: float


@dataclass(frozen=True, eq=False)
class JointImpedance:
    """M, B and K carried to the joints, or back to the hand.

    Attributes
    ----------
    M, B, K : ndarray, shape (n, n)
    cov : ndarray or None
        Of M, B, K row by row.
    gamma : ndarray
        The posture's share at the joints, N m/rad: K_q = J' K J - gamma.
    condition : float
        Condition number of J.
    at : str
        "joints" or "hand".
    jacobian, jacobian_slope, force_n : ndarray
        Posture and force.
    """

    M: np.ndarray
    B: np.ndarray
    K: np.ndarray
    cov: np.ndarray | None
    gamma: np.ndarray
    condition: float
    at: str
    jacobian: np.ndarray
    jacobian_slope: np.ndarray
    force_n: np.ndarray
    angles_rad: np.ndarray | None = None
    arm: Arm | None = field(default=None, repr=False)

    @property
    def n(self) -> int:
        """Joints or axes."""
        return len(self.M)

    @property
    def units(self) -> dict[str, str]:
        """Unit of M, B and K, for a hand in m and joints in rad."""
        if self.at == "joints":
            return {"M": "kg m^2", "B": "N m s/rad", "K": "N m/rad"}
        return {"M": "kg", "B": "N s/m", "K": "N/m"}

    def se(self, name: str) -> np.ndarray:
        """Standard errors of "M", "B" or "K"; NaN without a covariance."""
        if name not in ("M", "B", "K"):
            raise refuse(f"there is no parameter {name!r}; there are M, B and K", "name")
        if self.cov is None:
            return np.full((self.n, self.n), np.nan)
        first = "MBK".index(name) * self.n**2
        return np.sqrt(np.diag(self.cov)[first : first + self.n**2]).reshape(self.n, self.n)

    def passivity(self, *, level: float = 0.95, draws: int = 4000, seed: int = 0) -> JointMargins:
        """Margins of the symmetric parts and the probability that all are passive.

        A negative margin of K alone is possible under a force at a passive hand: the force does the
        work.
        """
        raw = result("ulna_joint_margins")
        cov = ffi.NULL if self.cov is None else view(self.cov)
        matrices = [view(np.ascontiguousarray(z)) for z in (self.M, self.B, self.K)]
        check(lib.ulna_joint_get_margins(*matrices, cov, level, draws, seed, raw))
        return JointMargins(
            m_min=raw.m_min,
            b_min=raw.b_min,
            k_min=raw.k_min,
            m_interval=tuple(raw.m_interval),
            b_interval=tuple(raw.b_interval),
            k_interval=tuple(raw.k_interval),
            probability=raw.probability,
        )

    def summary(self) -> str:
        """The matrices as text of at most 80 columns."""
        from ._reflex_words import joint_summary

        return joint_summary(self)

    def plot(self) -> Any:
        """The arm, and what makes up its joint stiffness (needs matplotlib, a planar arm)."""
        from . import plot

        return plot.joint(self)

    def __repr__(self) -> str:
        parts = []
        for name in ("M", "B", "K"):
            value, error = getattr(self, name), self.se(name)
            entries = " ".join(
                f"{v:.4g}" + (f"±{e:.2g}" if np.isfinite(e) else "")
                for v, e in zip(value.ravel(), error.ravel(), strict=True)
            )
            parts.append(f"{name}=[{entries}] {self.units[name]}")
        return f"<JointImpedance at the {self.at} {' '.join(parts)}>"


def from_endpoint(
    estimate: ImpedanceEstimate | Sequence[Any],
    *,
    arm: Arm | None = None,
    angles_rad: Any = None,
    jacobian: Any = None,
    jacobian_slope: Any = None,
    force_n: Any = None,
    force_cov: Any = None,
    cov: Any = None,
) -> JointImpedance:
    """Impedance at the joints from that at the hand.

    Parameters
    ----------
    estimate : ImpedanceEstimate or (M, B, K)
    arm : Arm, optional
        A planar arm; else give `jacobian` and `jacobian_slope`.
    angles_rad : array_like, optional
        Posture of the arm. Default: at the mean position of the estimate.
    jacobian, jacobian_slope : array_like, shapes (m, n) and (n, m, n)
        J and dJ/dq_k at the posture, for any other arm.
    force_n : array_like, shape (m,), optional
        By the human on the robot, at that posture. Default: the estimate's mean force; zero for
        matrices.
    force_cov : array_like, shape (m, m), optional
    cov : array_like, optional
        Of M, B, K row by row; default: the estimate's.

    Examples
    --------
    >>> import ulna
    >>> est = ulna.identify_impedance(ulna.read("examples/data/relaxed-arm.csv"))
    >>> z = ulna.joint.from_endpoint(est, arm=ulna.joint.Arm())
    >>> z.K.shape, z.at
    ((2, 2), 'joints')
    """
    matrices, cov, force_n, angles_rad = _unpack(estimate, cov, force_n, angles_rad, arm)
    return _carried(
        lib.ULNA_JOINT_FROM_ENDPOINT, "joints", matrices, cov, force_n, force_cov, arm, angles_rad,
        jacobian, jacobian_slope, 0.0,
    )  # fmt: skip


def to_endpoint(
    impedance: JointImpedance | Sequence[Any],
    *,
    arm: Arm | None = None,
    angles_rad: Any = None,
    jacobian: Any = None,
    jacobian_slope: Any = None,
    force_n: Any = None,
    force_cov: Any = None,
    cov: Any = None,
    condition_limit: float = 1e4,
) -> JointImpedance:
    """Impedance at the hand from that at the joints, K = J^-T (K_q + Gamma) J^-1.

    Posture and force of a `JointImpedance` are its own unless given.

    Raises
    ------
    ulna.AnalysisError
        J is not square, or the posture is singular: the message names the direction that is lost.

    Examples
    --------
    >>> import ulna
    >>> from ulna.joint import Arm, from_endpoint, to_endpoint
    >>> z = from_endpoint(([[1, 0], [0, 1]], [[5, 0], [0, 5]], [[90, 0], [0, 90]]),
    ...                   arm=Arm(), angles_rad=[0.6, 1.4], force_n=[2.0, -1.0])
    >>> to_endpoint(z).K.round(9)
    array([[90.,  0.],
           [ 0., 90.]])
    """
    if isinstance(impedance, JointImpedance):
        if impedance.at != "joints":
            raise refuse("the impedance is at the hand already", "impedance")
        matrices = (impedance.M, impedance.B, impedance.K)
        cov = impedance.cov if cov is None else cov
        force_n = impedance.force_n if force_n is None else force_n
        if arm is None and jacobian is None:
            arm, angles_rad = impedance.arm, impedance.angles_rad
            jacobian, jacobian_slope = (
                (None, None) if arm is not None else (impedance.jacobian, impedance.jacobian_slope)
            )
    else:
        matrices = _three(impedance)
    return _carried(
        lib.ULNA_JOINT_TO_ENDPOINT, "hand", matrices, cov, force_n, force_cov, arm, angles_rad,
        jacobian, jacobian_slope, condition_limit,
    )  # fmt: skip


def _three(given: Any) -> tuple[Any, Any, Any]:
    try:
        m, b, k = given
    except (TypeError, ValueError):
        raise refuse("give an estimate, or the three matrices (M, B, K)", "estimate") from None
    return m, b, k


def _unpack(
    estimate: Any, cov: Any, force_n: Any, angles_rad: Any, arm: Arm | None
) -> tuple[Any, Any, Any, Any]:
    if not hasattr(estimate, "signals"):
        return _three(estimate), cov, force_n, angles_rad
    size = 3 * estimate.n**2
    cov = estimate.cov[:size, :size] if cov is None else cov
    signals = [estimate.signals(trial=trial) for trial in range(len(estimate.record.trials))]
    if force_n is None:
        force_n = np.concatenate([s.force for s in signals]).mean(axis=0)
    if angles_rad is None and arm is not None:
        angles_rad = arm.angles(np.concatenate([s.position for s in signals]).mean(axis=0))
    return (estimate.M, estimate.B, estimate.K), cov, force_n, angles_rad


def _carried(
    direction: int,
    at: str,
    matrices: tuple[Any, Any, Any],
    cov: Any,
    force_n: Any,
    force_cov: Any,
    arm: Arm | None,
    angles_rad: Any,
    jacobian: Any,
    jacobian_slope: Any,
    condition_limit: float,
) -> JointImpedance:
    if (arm is None) == (jacobian is None):
        raise refuse("give either an arm or a jacobian", "arm")
    if arm is not None:
        if angles_rad is None:
            raise refuse("give angles_rad, the posture of the arm", "angles_rad")
        angles_rad = np.asarray(angles_rad, dtype=float).reshape(-1)
        jacobian, jacobian_slope = arm.jacobian(angles_rad), arm.jacobian_slope(angles_rad)
    if jacobian_slope is None:
        raise refuse(
            "give jacobian_slope, the derivatives dJ/dq_k: without them the posture's share of the "
            "stiffness is unknown",
            "jacobian_slope",
        )
    j = np.atleast_2d(np.asarray(jacobian, dtype=float))
    slope = np.asarray(jacobian_slope, dtype=float)
    if slope.shape != (j.shape[1], *j.shape):
        raise refuse(
            f"jacobian_slope has the shape {slope.shape}; it must be "
            f"{(j.shape[1], *j.shape)}: one matrix for each joint",
            "jacobian_slope",
        )
    force = np.zeros(len(j)) if force_n is None else np.asarray(force_n, dtype=float).reshape(-1)
    request = options(
        "ulna_joint_request",
        m=view(np.atleast_2d(np.asarray(matrices[0], dtype=float))),
        b=view(np.atleast_2d(np.asarray(matrices[1], dtype=float))),
        k=view(np.atleast_2d(np.asarray(matrices[2], dtype=float))),
        covariance=None if cov is None else view(np.asarray(cov, dtype=float)),
        jacobian=view(j),
        slope=view(slope.reshape(-1, j.shape[1])),
        force_n=view(force),
        force_covariance=None if force_cov is None else view(np.asarray(force_cov, dtype=float)),
        condition_limit=condition_limit,
        direction=direction,
    )
    condition = ffi.new("double *")
    values = out_array(lib.ulna_joint_transform, request, condition)
    n = j.shape[1] if at == "joints" else j.shape[0]
    size = n * n
    m, b, k = values[: 3 * size].reshape(3, n, n)
    covariance = None
    if cov is not None:
        covariance = values[3 * size : 3 * size + 9 * size**2].reshape(3 * size, 3 * size)
    return JointImpedance(
        M=m,
        B=b,
        K=k,
        cov=covariance,
        gamma=values[-(j.shape[1] ** 2) :].reshape(j.shape[1], -1),
        condition=condition[0],
        at=at,
        jacobian=j,
        jacobian_slope=slope,
        force_n=force,
        angles_rad=angles_rad,
        arm=arm,
    )


def to_joints(
    record: Record,
    *,
    arm: Arm,
    angles_rad: Any = None,
    position: str | Sequence[str] | None = None,
    force: str | Sequence[str] | None = None,
    reference: str | Sequence[str] | None = None,
    condition_limit: float = 1e3,
) -> Record:
    """A record of the hand as one of the joints, so that everything runs there too.

    Channels q1, q2 (rad), tau1, tau2 = J' F (N m), and q1_ref, q2_ref where there is a reference.

    Parameters
    ----------
    record : Record
        Positions and forces along x and y.
    arm : Arm
    angles_rad : array_like, shape (rows, 2), optional
        Angles measured otherwise, as by :func:`angles_of_markers`; default: from the hand's place.
    position, force, reference : str or list of str, optional
        As :func:`ulna.identify_impedance`.
    condition_limit : float
        Of J, above which a row is refused: the arm is nearly straight.

    Raises
    ------
    ulna.AnalysisError
        The hand is out of reach or the arm singular, with the row.

    Examples
    --------
    >>> import ulna
    >>> log = ulna.read("examples/data/relaxed-arm.csv")
    >>> joints = ulna.joint.to_joints(log, arm=ulna.joint.Arm())
    >>> [channel.name for channel in joints.channels]
    ['q1', 'q2', 'tau1', 'tau2', 'q1_ref', 'q2_ref']
    """
    if not isinstance(record, Record):
        raise refuse(f"record is a {type(record).__name__}, not a Record", "record")
    if not isinstance(arm, Arm):
        raise refuse(f"arm is a {type(arm).__name__}; make one with ulna.joint.Arm(...)", "arm")
    prepare = _prepare_options(
        position=position,
        force=force,
        reference=reference,
        lowpass_hz=None,
        lowpass_order=None,
        corrected=False,
        window=None,
        order=None,
        plain_savgol=False,
        pad="pole-radius",
        threads=0,
    )
    angles = ffi.NULL if angles_rad is None else view(np.asarray(angles_rad, dtype=float))
    return Record(
        _Record.make(
            lib.ulna_record_to_joints,
            record._handle.pointer,
            arm._struct(),
            prepare,
            angles,
            float(condition_limit),
        )
    )
