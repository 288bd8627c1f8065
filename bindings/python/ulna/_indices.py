"""Passivity indices of linear systems and absolute stability of two-ports; see `ulna.passivity`."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ._call import check, decode, lib, options, out_array, result, view
from .record import refuse
from .systems import LinearSystem, as_system, impedance

__all__ = ["PortIndices", "TwoPortStability", "indices", "is_positive_real", "two_port"]

_VERDICTS = {
    lib.ULNA_VERDICT_PASSIVE: "passive",
    lib.ULNA_VERDICT_NOT_PASSIVE: "not passive",
    lib.ULNA_VERDICT_UNDECIDED: "undecided",
}
_STABLE = {
    lib.ULNA_VERDICT_PASSIVE: "absolutely stable",
    lib.ULNA_VERDICT_NOT_PASSIVE: "not absolutely stable",
    lib.ULNA_VERDICT_UNDECIDED: "undecided",
}

Band = tuple[float, float]


@dataclass(frozen=True, eq=False)
class PortIndices:
    """How passive a linear system H is; u is its input, y its output, u'y the power it takes.

    Attributes
    ----------
    input : float
        Largest nu with energy >= nu times the integral of u'u: the excess of passivity of an
        impedance. Minus infinity when an unstable or badly stored mode allows none.
    output : float
        Largest rho with energy >= rho times the integral of y'y; NaN when H is singular.
    relative : float
        Gain of (I - H) (I + H)^-1: at most 1 exactly when H is passive.
    input_frequency_rad_s, output_frequency_rad_s, relative_frequency_rad_s : float
        Where they are met; may be infinite.
    verdict : str
        "passive" (positive real), "not passive", or "undecided" within the tolerance.
    reason : str
        One sentence: why.
    notes : tuple of str
        What else to know, as modes that cancel.
    band_rad_s : (float, float) or None
        Where it was judged; None for all frequencies.
    direction : ndarray or None
    tolerance : float
    system : LinearSystem
    """

    input: float
    output: float
    relative: float
    input_frequency_rad_s: float
    output_frequency_rad_s: float
    relative_frequency_rad_s: float
    verdict: str
    reason: str
    notes: tuple[str, ...]
    band_rad_s: Band | None
    direction: np.ndarray | None
    tolerance: float
    system: LinearSystem = field(repr=False)

    def curves(self, omega_rad_s: ArrayLike) -> np.ndarray:
        """At every frequency: smallest eigenvalue of the Hermitian part of H and of its inverse,
        and the gain of (I - H) (I + H)^-1; shape (frequencies, 3).

        Examples
        --------
        >>> import ulna
        >>> found = ulna.passivity.indices(ulna.TransferFunction([1], [1, 1]))
        >>> found.curves([0, 1]).round(3)
        array([[1.   , 1.   , 0.   ],
               [0.5  , 1.   , 0.447]])
        """
        omega = np.atleast_1d(np.asarray(omega_rad_s, dtype=float))
        flat = out_array(
            lib.ulna_passivity_curves,
            self.system._handle.pointer,
            _port_options(None, self.direction, self.tolerance),
            view(omega),
        )
        return flat.reshape(-1, 3)

    def summary(self) -> str:
        """Verdict and indices in a few lines of at most 80 columns."""
        from ._words_passivity import indices_summary

        return indices_summary(self)

    def plot(self, axes: Any = None) -> Any:
        """Nyquist plot and the three indices over frequency (needs matplotlib)."""
        from . import plot

        return plot.port_indices(self, axes)

    def __repr__(self) -> str:
        return (
            f"<PortIndices {self.verdict}, input {self.input:.4g}, output {self.output:.4g}, "
            f"relative {self.relative:.4g}>"
        )


def indices(
    system: Any,
    *,
    band_rad_s: Band | None = None,
    direction: ArrayLike | None = None,
    tolerance: float = 1e-9,
    antisymmetry_threshold: float = 0.15,
) -> PortIndices:
    """Passivity indices of a linear system, exactly, over every frequency.

    The smallest value over frequency comes from roots of polynomials (one port) or eigenvalues of a
    Hamiltonian matrix (several), never from a grid alone. Simple poles and zeros on the axis, at 0
    and at infinity are lossless and are taken out; the system may be improper.

    Parameters
    ----------
    system
        `ulna.TransferFunction`, `ulna.StateSpace`, a system of python-control or scipy.signal, or
        an `ulna.ImpedanceEstimate` (M s + B + K / s, from velocity to force).
    band_rad_s : (float, float), optional
        Judge the response in this band only, without asking for stability.
    direction : array_like, optional
        Motion along this line only: input index, relative index and verdict are those of d'Hd, the
        output index that of d'H^-1 d. Scaled to unit length.
    tolerance : float
        A Hermitian part that is zero within this share of the response leaves the verdict
        undecided; a pole with a real part below this share of its modulus counts as on the axis.
        0: as far as double arithmetic can tell.
    antisymmetry_threshold : float
        For an estimate: antisymmetric parts of M and K below this share are dropped, as
        `ulna.passivity` does.

    Examples
    --------
    A system with a zero at 0 and one at infinity: input index 0, output index 0.2.

    >>> import ulna
    >>> ulna.passivity.indices(ulna.TransferFunction([1, 0], [1, 0.2, 1]))
    <PortIndices passive, input 0, output 0.2, relative 1>
    """
    notes: list[str] = []
    model = _model(system, antisymmetry_threshold, notes)
    if band_rad_s is not None:
        band_rad_s = _band(band_rad_s)
    line = None if direction is None else np.atleast_1d(np.asarray(direction, dtype=float))
    raw = result("ulna_port_indices")
    chosen = _port_options(band_rad_s, line, tolerance)
    check(lib.ulna_passivity_of_system(model._handle.pointer, chosen, raw))
    notes += decode(raw.notes).splitlines()
    return PortIndices(
        input=raw.input,
        output=raw.output,
        relative=raw.relative,
        input_frequency_rad_s=raw.input_frequency_rad_s,
        output_frequency_rad_s=raw.output_frequency_rad_s,
        relative_frequency_rad_s=raw.relative_frequency_rad_s,
        verdict=_VERDICTS[raw.verdict],
        reason=decode(raw.reason),
        notes=tuple(notes),
        band_rad_s=band_rad_s,
        direction=None if line is None else line / np.linalg.norm(line),
        tolerance=tolerance,
        system=model,
    )


def is_positive_real(system: Any, *, tolerance: float = 1e-9) -> bool | None:
    """Whether a system is positive real, that is passive; None when the tolerance leaves it open.

    Parameters as for `indices`.

    Examples
    --------
    >>> import ulna
    >>> ulna.passivity.is_positive_real(ulna.TransferFunction([1, 2.9], [1, 3, 2]))
    True
    >>> ulna.passivity.is_positive_real(ulna.TransferFunction([1, 3.1], [1, 3, 2]))
    False
    """
    verdict = indices(system, tolerance=tolerance).verdict
    return None if verdict == "undecided" else verdict == "passive"


@dataclass(frozen=True, eq=False)
class TwoPortStability:
    """Absolute stability of a two-port network between two terminations.

    Attributes
    ----------
    verdict : str
        "absolutely stable", "not absolutely stable", or "undecided" within the tolerance.
    reason : str
    margin, margin_frequency_rad_s : float
        Smallest 2 r1 (r2 - a) - Re k - abs(k) over frequency, with r the real parts of the own
        impedances, k = z12 z21, and a the shortage of the termination (of port 2).
    largest_shortage, largest_shortage_frequency_rad_s : float
        Largest a of the termination that keeps stability, the other one passive, and the frequency
        that limits it. Negative: it takes this much excess.
    opposite_shortage, opposite_shortage_frequency_rad_s : float
        The same for a termination of the other port.
    shortage : float
        The a that was judged.
    port : int
    """

    verdict: str
    reason: str
    margin: float
    margin_frequency_rad_s: float
    largest_shortage: float
    largest_shortage_frequency_rad_s: float
    opposite_shortage: float
    opposite_shortage_frequency_rad_s: float
    shortage: float
    port: int
    band_rad_s: Band | None
    tolerance: float
    system: LinearSystem = field(repr=False)

    def curves(self, omega_rad_s: ArrayLike) -> np.ndarray:
        """Margin and tolerable shortage at every frequency; shape (frequencies, 2).

        Examples
        --------
        >>> import ulna
        >>> ulna.passivity.two_port([[2, 1], [1, 2]]).curves([1.0])
        array([[6. , 1.5]])
        """
        omega = np.atleast_1d(np.asarray(omega_rad_s, dtype=float))
        chosen = _two_port_options(self.shortage, self.port, None, self.tolerance)
        flat = out_array(
            lib.ulna_two_port_curves, self.system._handle.pointer, chosen, view(omega)
        )
        return flat.reshape(-1, 2)

    def summary(self) -> str:
        """Verdict, margin and tolerable shortage in a few lines of at most 80 columns."""
        from ._words_passivity import two_port_summary

        return two_port_summary(self)

    def plot(self, axes: Any = None) -> Any:
        """Margin and tolerable shortage over frequency (needs matplotlib)."""
        from . import plot

        return plot.two_port(self, axes)

    def __repr__(self) -> str:
        return (
            f"<TwoPortStability {self.verdict}, margin {self.margin:.4g}, "
            f"largest shortage {self.largest_shortage:.4g}>"
        )


def two_port(
    z: Any,
    *,
    shortage: float = 0.0,
    port: int = 2,
    band_rad_s: Band | None = None,
    tolerance: float = 1e-9,
) -> TwoPortStability:
    """Absolute stability by Llewellyn's criterion, also beside a termination that is not passive.

    (4.1) and (4.2) of Dyck (2013), whose printed form leaves out poles of z12 and z21 and the
    condition 0 <= k12 k21 <= k11 k22 on residues on the axis.

    Parameters
    ----------
    z
        Two by two system of impedances (or other immittance parameters); systems of
        python-control and scipy.signal and matrices of numbers are taken too.
    shortage : float
        a of the termination, Re z >= -a. Negative: an excess, for example minus the input index
        of an arm.
    port : int
        That this termination ends, 1 or 2. The other port ends in any passive impedance.
    band_rad_s, tolerance
        As for `indices`.

    Examples
    --------
    >>> import ulna
    >>> ulna.passivity.two_port([[2, 1], [1, 2]])
    <TwoPortStability absolutely stable, margin 6, largest shortage 1.5>
    """
    model = as_system(z)
    if band_rad_s is not None:
        band_rad_s = _band(band_rad_s)
    raw = result("ulna_two_port_stability")
    chosen = _two_port_options(shortage, port, band_rad_s, tolerance)
    check(lib.ulna_two_port_assess(model._handle.pointer, chosen, raw))
    return TwoPortStability(
        verdict=_STABLE[raw.verdict],
        reason=decode(raw.reason),
        margin=raw.margin,
        margin_frequency_rad_s=raw.margin_frequency_rad_s,
        largest_shortage=raw.shortage,
        largest_shortage_frequency_rad_s=raw.shortage_frequency_rad_s,
        opposite_shortage=raw.opposite,
        opposite_shortage_frequency_rad_s=raw.opposite_frequency_rad_s,
        shortage=float(shortage),
        port=port,
        band_rad_s=band_rad_s,
        tolerance=tolerance,
        system=model,
    )


# Inside ------------------------------------------------------------------------------------------


def _band(band: Band) -> Band:
    try:
        low, high = (float(edge) for edge in band)
    except (TypeError, ValueError):
        raise refuse("band_rad_s must be two frequencies in rad/s", "band_rad_s") from None
    if not 0.0 <= low < high or not np.isfinite(low):
        raise refuse(
            f"band_rad_s is ({low:g}, {high:g}): the first frequency must not be negative and the "
            "second must be above it",
            "band_rad_s",
        )
    return low, high


def _tolerance(tolerance: float) -> float:
    if not 0.0 <= tolerance <= 0.1:
        raise refuse("tolerance must lie between 0 and 0.1", "tolerance")
    # Zero bytes would mean the default; the interface takes a negative value as zero.
    return tolerance if tolerance > 0.0 else -1.0


def _port_options(band: Band | None, direction: np.ndarray | None, tolerance: float) -> Any:
    low, high = (None, None) if band is None else band
    return options(
        "ulna_port_options",
        direction=direction,
        band_low_rad_s=low,
        band_high_rad_s=high,
        tolerance=_tolerance(tolerance),
    )


def _two_port_options(shortage: float, port: int, band: Band | None, tolerance: float) -> Any:
    if port not in (1, 2):
        raise refuse(f"port is {port}: it must be 1 or 2", "port")
    low, high = (None, None) if band is None else band
    return options(
        "ulna_two_port_options",
        shortage=shortage,
        port=port,
        band_low_rad_s=low,
        band_high_rad_s=high,
        tolerance=_tolerance(tolerance),
    )


def _model(system: Any, threshold: float, notes: list[str]) -> LinearSystem:
    if not all(hasattr(system, name) for name in ("M", "B", "K", "x0")):
        return as_system(system)
    from .passivity import of_model

    margins = of_model(system.M, system.B, system.K, antisymmetry_threshold=threshold)
    parts = {"M": np.asarray(system.M), "B": np.asarray(system.B), "K": np.asarray(system.K)}
    for name, small, share in (
        ("M", margins.m_symmetric, margins.antisymmetry_m),
        ("K", margins.k_symmetric, margins.antisymmetry_k),
    ):
        if not small or not share > 0:
            continue
        parts[name] = (parts[name] + parts[name].T) / 2
        notes.append(
            f"The antisymmetric part of {name} ({100 * share:.2g} %, below the threshold of "
            f"{100 * threshold:.3g} %) was dropped."
        )
    return impedance(**parts)
