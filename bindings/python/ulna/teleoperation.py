"""From the identified arm to the gain and delay that a teleoperator or a virtual wall allows.

The arm enters through its excess of passivity alone: what is allowed here is stable with every arm
of at least that excess, whatever its mass, stiffness or posture.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ._call import lib, options, out_array, view
from .record import refuse

__all__ = ["Allowed", "allowed_gain", "allowed_stiffness"]


@dataclass(frozen=True, eq=False)
class Allowed:
    """What a delay allows, with and without the excess of passivity of the arm.

    Attributes
    ----------
    delay_s : ndarray
    passive : ndarray
        Allowed for any passive arm.
    allowed, low : ndarray
        For this arm: with its excess, and with the lower end of the excess' interval.
    excess, excess_interval : float, (float, float)
        Excess of passivity of the arm; negative is a shortage.
    quantity, unit : str
        "gain" (force times position scaling) or "stiffness".
    loop : str
        The system, in words.
    reason : str
        What the arm's excess gains, in words.
    """

    delay_s: np.ndarray
    passive: np.ndarray
    allowed: np.ndarray
    low: np.ndarray
    excess: float
    excess_interval: tuple[float, float]
    excess_unit: str
    quantity: str
    unit: str
    loop: str
    reason: str

    def summary(self) -> str:
        """A table of at most 80 columns."""
        from ._words_passivity import allowed_summary

        return allowed_summary(self)

    def plot(self, ax: Any = None) -> Any:
        """Allowed gain or stiffness over delay (needs matplotlib)."""
        from . import plot

        return plot.allowed(self, ax)

    def __repr__(self) -> str:
        return (
            f"<Allowed {self.quantity} at {len(self.delay_s)} delays, excess {self.excess:.4g} "
            f"{self.excess_unit}>"
        )


def allowed_gain(
    arm: Any,
    *,
    delay_s: ArrayLike,
    master_damping_n_s_m: float,
    slave_damping_n_s_m: float,
    coupling_damping_n_s_m: float,
    coupling_stiffness_n_m: float,
    direction: ArrayLike | None = None,
) -> Allowed:
    """Largest gain of a position-force teleoperator at each delay.

    Velocities v and forces f, T the delay one way, phi the scaling of forces and lambda that of
    positions::

        master   (m_m s + b_m) v_m = f_arm - phi exp(-sT) f_c
        slave    (m_s s + b_s) v_s = f_c - f_environment
        coupler  f_c = (k_v + k_p / s) (lambda exp(-sT) v_m - v_s)

    The gain is phi times lambda. The environment is any passive one. By Llewellyn's criterion on
    this two-port, with the delay exact, the gain is allowed exactly when

        gain * sup f <= b_m + excess of the arm

    with f as in the C header; the masses cancel. Any delay at all limits the gain to
    (b_m + excess) / k_v, however short it is: at some high frequency it turns the damping of the
    coupler around.

    Parameters
    ----------
    arm
        An `ulna.ImpedanceEstimate` (its excess with the interval of `ulna.passivity`), a
        `ulna.passivity.PassivityVerdict`, or the excess in N s/m; (low, value, high) gives an
        interval too.
    delay_s : array_like
        One way, s.
    master_damping_n_s_m, slave_damping_n_s_m
        b_m and b_s.
    coupling_damping_n_s_m, coupling_stiffness_n_m
        k_v and k_p.
    direction : array_like, optional
        Line along which the master moves, for an estimate: its excess is then d'Bd, which is at
        least that of the worst direction.

    Examples
    --------
    >>> found = allowed_gain(4.0, delay_s=[0.01, 0.1], master_damping_n_s_m=2.0,
    ...     slave_damping_n_s_m=1.0, coupling_damping_n_s_m=30.0, coupling_stiffness_n_m=200.0)
    >>> found.passive.round(3), found.allowed.round(3)
    (array([0.067, 0.056]), array([0.2  , 0.168]))
    """
    excess, interval, unit = _excess(arm, direction)
    delays = _delays(delay_s)
    loop = options(
        "ulna_position_force",
        master_damping_n_s_m=master_damping_n_s_m,
        slave_damping_n_s_m=slave_damping_n_s_m,
        coupling_damping_n_s_m=coupling_damping_n_s_m,
        coupling_stiffness_n_m=coupling_stiffness_n_m,
    )

    def allowed(known: float) -> np.ndarray:
        return out_array(lib.ulna_teleoperation_gain, loop, known, view(delays))

    return _allowed(
        allowed, delays, excess, interval, unit, "gain", "",
        f"a position-force teleoperator (master damping {master_damping_n_s_m:g}, slave damping "
        f"{slave_damping_n_s_m:g}, coupler {coupling_damping_n_s_m:g} N s/m and "
        f"{coupling_stiffness_n_m:g} N/m) on any passive environment",
    )  # fmt: skip


def allowed_stiffness(
    arm: Any,
    *,
    delay_s: ArrayLike,
    device_damping_n_s_m: float,
    wall_damping_n_s_m: float = 0.0,
    direction: ArrayLike | None = None,
) -> Allowed:
    """Largest stiffness of a virtual wall that is rendered with each delay.

    A device of damping b renders f = (K + B s) x with delay T; a sampled loop adds half a period to
    T. It is stable with every arm of at least the given excess exactly when, at every frequency,

        b + excess + B cos(w T) - K sin(w T) / w >= 0

    so that K <= (b + excess) / T without wall damping, as Colgate and Schenkel (1997) found.

    Parameters
    ----------
    arm, delay_s, direction
        As for `allowed_gain`.
    device_damping_n_s_m, wall_damping_n_s_m
        b and B.

    Examples
    --------
    >>> allowed_stiffness(4.0, delay_s=[0.01], device_damping_n_s_m=1.0).allowed
    array([500.])
    """
    excess, interval, unit = _excess(arm, direction)
    delays = _delays(delay_s)

    def allowed(known: float) -> np.ndarray:
        return out_array(
            lib.ulna_teleoperation_stiffness,
            device_damping_n_s_m,
            wall_damping_n_s_m,
            known,
            view(delays),
        )

    return _allowed(
        allowed, delays, excess, interval, unit, "stiffness", "N/m",
        f"a virtual wall (device damping {device_damping_n_s_m:g} N s/m, wall damping "
        f"{wall_damping_n_s_m:g} N s/m)",
    )  # fmt: skip


# Inside ------------------------------------------------------------------------------------------


def _excess(arm: Any, direction: ArrayLike | None) -> tuple[float, tuple[float, float], str]:
    if hasattr(arm, "_handle") and all(hasattr(arm, name) for name in "MBK"):
        if direction is not None:
            return _excess_along(arm, direction)
        arm = arm.passivity()
    if hasattr(arm, "eop") and hasattr(arm, "eop_interval"):
        if direction is not None:
            raise refuse("a direction needs the estimate, not its verdict", "direction")
        low, high = arm.eop_interval
        return float(arm.eop), (float(low), float(high)), arm.unit
    if direction is not None:
        raise refuse("a direction needs an estimate of the arm", "direction")
    try:
        numbers = np.atleast_1d(np.asarray(arm, dtype=float))
    except (TypeError, ValueError):
        numbers = np.empty(0)
    if numbers.shape not in ((1,), (3,)) or not np.all(np.isfinite(numbers)):
        raise refuse(
            "arm must be an estimate, its verdict, an excess of passivity in N s/m, or "
            "(low, value, high) of it",
            "arm",
        )
    if numbers.size == 1:
        return float(numbers[0]), (float(numbers[0]), float(numbers[0])), "N s/m"
    low, value, high = (float(x) for x in numbers)
    if not low <= value <= high:
        raise refuse("the interval (low, value, high) of the excess must increase", "arm")
    return value, (low, high), "N s/m"


def _excess_along(arm: Any, direction: ArrayLike) -> tuple[float, tuple[float, float], str]:
    line = np.atleast_1d(np.asarray(direction, dtype=float))
    if line.shape != (arm.n,) or not np.all(np.isfinite(line)) or not np.any(line):
        raise refuse(f"direction must hold {arm.n} numbers that are not all zero", "direction")
    line = line / np.linalg.norm(line)
    draws = np.einsum("i,kij,j->k", line, arm.draws()["B"].reshape(-1, arm.n, arm.n), line)
    low, high = np.percentile(draws, [2.5, 97.5])
    return float(line @ arm.B @ line), (float(low), float(high)), arm.units["B"]


def _delays(delay_s: ArrayLike) -> np.ndarray:
    delays = np.atleast_1d(np.asarray(delay_s, dtype=float))
    if delays.ndim != 1 or delays.size == 0:
        raise refuse("delay_s must be one delay or a list of them", "delay_s")
    return delays


def _worth(delays: np.ndarray, passive: np.ndarray, low: np.ndarray) -> str:
    """What the excess gains, at the middle of the delays that limit anything."""
    limited = np.flatnonzero(np.isfinite(passive))
    if limited.size == 0:
        return "Without delay nothing limits it, with the arm's excess or without."
    middle = limited[limited.size // 2]
    where = f"At {1e3 * delays[middle]:.4g} ms the arm's excess allows"
    if passive[middle] == 0:
        return f"{where} {low[middle]:.3g}, where any passive arm allows nothing."
    more = low[middle] / passive[middle]
    return f"{where} {more:.3g} times what any passive arm does, at the lower end of its interval."


def _allowed(
    allowed: Any,
    delays: np.ndarray,
    excess: float,
    interval: tuple[float, float],
    excess_unit: str,
    quantity: str,
    unit: str,
    loop: str,
) -> Allowed:
    passive, mine, low = allowed(0.0), allowed(excess), allowed(interval[0])
    if interval[0] < 0:
        reason = (
            "The arm may be less than passive: a design for passive arms is not safe with it. Take "
            "the values at the lower end of its interval."
        )
    else:
        reason = _worth(delays, passive, low)
    return Allowed(
        delays, passive, mine, low, excess, interval, excess_unit, quantity, unit, loop, reason
    )
