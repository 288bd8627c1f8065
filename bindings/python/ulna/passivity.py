"""Passivity of a limb: a verdict with its probability, from the model and from the energy.

The module can be called: ``ulna.passivity(estimate)`` is ``ulna.passivity.assess(estimate)``.
`indices` judges any linear system, `two_port` what stands between two of them.
"""

from __future__ import annotations

import sys
import types
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ._call import (
    ArgumentError,
    Handle,
    check,
    ffi,
    lib,
    long_call,
    options,
    out_array,
    result,
    text,
    view,
)
from ._indices import PortIndices, TwoPortStability, indices, is_positive_real, two_port

if TYPE_CHECKING:
    from .impedance import ImpedanceEstimate

__all__ = [
    "EnergyIndex",
    "Margins",
    "PassivityVerdict",
    "PortIndices",
    "TwoPortStability",
    "assess",
    "indices",
    "is_positive_real",
    "of_energy",
    "of_model",
    "two_port",
]

_VERDICTS = {
    lib.ULNA_VERDICT_PASSIVE: "passive",
    lib.ULNA_VERDICT_NOT_PASSIVE: "not passive",
    lib.ULNA_VERDICT_UNDECIDED: "undecided",
}


class _Passivity(Handle):
    kind = "ulna_passivity"
    __slots__ = ()


@dataclass(frozen=True)
class Margins:
    """Margins of M, B and K: passive when none is negative and M and K are symmetric.

    Theorem 3.2 of Dyck (2013), corrected: by eigenvalues of the symmetric parts.

    Attributes
    ----------
    verdict : str
        "passive", "not passive", or "undecided" when a margin is zero to rounding.
    m_min, b_min, k_min : float
        Smallest eigenvalue of the symmetric part.
    excess : float
        Excess of passivity (EOP): b_min; minus infinity when M or K allow none.
    antisymmetry_m, antisymmetry_k : float
        (3.26): size of the antisymmetric part over the geometric mean eigenvalue.
    m_symmetric, k_symmetric : bool
        Whether it is below the threshold, and dropped.
    """

    verdict: str
    m_min: float
    b_min: float
    k_min: float
    excess: float
    antisymmetry_m: float
    antisymmetry_k: float
    m_symmetric: bool
    k_symmetric: bool


def _margins(raw: Any) -> Margins:
    return Margins(
        verdict=_VERDICTS[raw.verdict],
        m_min=raw.m_min,
        b_min=raw.b_min,
        k_min=raw.k_min,
        excess=raw.excess,
        antisymmetry_m=raw.antisymmetry_m,
        antisymmetry_k=raw.antisymmetry_k,
        m_symmetric=bool(raw.m_symmetric),
        k_symmetric=bool(raw.k_symmetric),
    )


@dataclass(frozen=True)
class EnergyIndex:
    """Excess (or, when negative, shortage) of passivity that recorded energy shows.

    Attributes
    ----------
    index : float
        N s/m or N m s/rad; NaN when nothing moved.
    time_s : float
        When the bound is met.
    energy_j : ndarray
        Absorbed energy at every row.
    """

    index: float
    time_s: float
    energy_j: np.ndarray = field(repr=False)


@dataclass(frozen=True, eq=False)
class PassivityVerdict:
    """Is the limb passive, and how sure is that?

    Attributes
    ----------
    verdict : str
        "passive", "not passive" or "undecided".
    probability : float
        That the limb is passive, by the approach that the verdict rests on.
    approach : str
        "model" or "energy".
    eop, eop_interval : float, (float, float)
        Excess of passivity by the model: smallest eigenvalue of the symmetric part of B. Negative:
        a shortage. N s/m or N m s/rad.
    eop_energy, eop_energy_interval
        The same from the energy that flowed in the recording.
    model_probability, energy_probability : float
    reason, would_change : str
        One sentence each.
    time_s, energy_j : ndarray
        Energy absorbed by the limb over the first trial; `series` holds every trial's.
    margins : Margins
    eigenvalues : dict
        Smallest eigenvalue of the symmetric part of "M", "B" and "K".
    """

    verdict: str
    probability: float
    approach: str
    eop: float
    eop_interval: tuple[float, float]
    eop_energy: float
    eop_energy_time_s: float
    eop_energy_interval: tuple[float, float]
    model_probability: float
    energy_probability: float
    m_min_interval: tuple[float, float]
    k_min_interval: tuple[float, float]
    beta_j: float
    margins: Margins
    reason: str
    would_change: str
    time_s: np.ndarray
    energy_j: np.ndarray
    series: tuple[tuple[np.ndarray, np.ndarray, np.ndarray], ...]
    unit: str

    @property
    def eigenvalues(self) -> dict[str, float]:
        """Smallest eigenvalue of the symmetric part of each matrix."""
        return {"M": self.margins.m_min, "B": self.margins.b_min, "K": self.margins.k_min}

    @property
    def z_mean_M(self) -> float:
        """Antisymmetry of M, (3.26)."""
        return self.margins.antisymmetry_m

    @property
    def z_mean_K(self) -> float:
        """Antisymmetry of K, (3.26)."""
        return self.margins.antisymmetry_k

    def summary(self) -> str:
        """The verdict in a few lines of at most 80 columns."""
        from ._words import passivity_summary

        return passivity_summary(self)

    def plot(self, ax: Any = None) -> Any:
        """Energy absorbed over time (needs matplotlib)."""
        from . import plot

        return plot.energy(self, ax)

    def __repr__(self) -> str:
        low, high = self.eop_interval
        return (
            f"<PassivityVerdict {self.verdict}, probability {self.probability:.3g} by {self.approach}, "
            f"EOP {self.eop:.4g} ({low:.3g} to {high:.3g}) {self.unit}>"
        )


def _options(
    antisymmetry_threshold: float,
    level: float = 0.95,
    min_share: float = 0.05,
    block_s: float = 2.0,
    bootstrap: int = 1000,
    seed: int = 0,
) -> Any:
    # Zero bytes would mean the default; the interface takes any negative value as zero.
    def or_negative(value: float) -> float:
        return -1.0 if value == 0 else value

    return options(
        "ulna_passivity_options",
        antisymmetry_threshold=or_negative(antisymmetry_threshold),
        level=or_negative(level),
        min_share=or_negative(min_share),
        block_s=or_negative(block_s),
        bootstrap=bootstrap,
        seed=seed,
    )


def assess(
    estimate: ImpedanceEstimate,
    *,
    antisymmetry_threshold: float = 0.15,
    level: float = 0.95,
    min_share: float = 0.05,
    block_s: float = 2.0,
    bootstrap: int = 1000,
    seed: int = 0,
) -> PassivityVerdict:
    """Judge the passivity of an estimate by its model and by the recorded energy.

    Parameters
    ----------
    estimate : ImpedanceEstimate
    antisymmetry_threshold : float
        Antisymmetric parts of M and K below this share are dropped, and the reason says so.
    level : float
        Of the intervals, and the probability that decides.
    min_share : float
        The energy is judged from where this share of the motion is done.
    block_s, bootstrap, seed
        Of the energy's bootstrap.

    Examples
    --------
    >>> import ulna
    >>> est = ulna.identify_impedance(ulna.read("examples/data/relaxed-arm.csv"))
    >>> ulna.passivity(est).verdict
    'passive'
    """
    if not hasattr(estimate, "K"):
        raise ArgumentError(
            "estimate must be an ulna.ImpedanceEstimate; for a system use ulna.passivity.indices",
            status="ULNA_ERROR_ARGUMENT",
            argument="estimate",
        )
    if getattr(estimate, "_handle", None) is None or getattr(estimate, "_fit", 0) != 0:
        raise ArgumentError(
            "estimate must be what ulna.identify_impedance returned; for matrices use "
            "ulna.passivity.of_model",
            status="ULNA_ERROR_ARGUMENT",
            argument="estimate",
        )
    chosen = _options(antisymmetry_threshold, level, min_share, block_s, bootstrap, seed)
    out = ffi.new("ulna_passivity **")
    long_call(lib.ulna_passivity_assess, estimate._handle.pointer, chosen, ffi.NULL, out)
    handle = _Passivity(out[0])
    info = result("ulna_passivity_info")
    check(lib.ulna_passivity_get_info(handle.pointer, info))
    raw = result("ulna_passivity_margins")
    check(lib.ulna_passivity_get_margins(handle.pointer, raw))

    def words(which: int) -> str:
        return text(lib.ulna_passivity_get_text, handle.pointer, which)

    def series(trial: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        kinds = (lib.ULNA_ENERGY_TIME, lib.ULNA_ENERGY_ABSORBED, lib.ULNA_ENERGY_MOTION)
        time, energy, motion = (
            out_array(lib.ulna_passivity_get_series, handle.pointer, trial, kind) for kind in kinds
        )
        return time, energy, motion

    every = tuple(series(trial) for trial in range(info.trials))
    return PassivityVerdict(
        verdict=_VERDICTS[info.verdict],
        probability=info.probability,
        approach="model" if info.approach == lib.ULNA_APPROACH_MODEL else "energy",
        eop=info.excess,
        eop_interval=tuple(info.excess_interval),
        eop_energy=info.energy_index,
        eop_energy_time_s=info.energy_index_time_s,
        eop_energy_interval=tuple(info.energy_interval),
        model_probability=info.model_probability,
        energy_probability=info.energy_probability,
        m_min_interval=tuple(info.m_min_interval),
        k_min_interval=tuple(info.k_min_interval),
        beta_j=info.beta_j,
        margins=_margins(raw),
        reason=words(lib.ULNA_PASSIVITY_TEXT_REASON),
        would_change=words(lib.ULNA_PASSIVITY_TEXT_WOULD_CHANGE),
        time_s=every[0][0],
        energy_j=every[0][1],
        series=every,
        unit=estimate.units["B"],
    )


def of_model(M: Any, B: Any, K: Any, *, antisymmetry_threshold: float = 0.15) -> Margins:
    """Passivity of given matrices, n x n, without uncertainty.

    Examples
    --------
    Participant P1 of Dyck (2013), Table 3.2:

    >>> import ulna
    >>> p1 = ulna.passivity.of_model(
    ...     [[1.33, -0.93], [-0.96, 1.89]],
    ...     [[5.75, -3.39], [-0.94, 10.60]],
    ...     [[42.45, -34.38], [-23.02, 125.43]],
    ... )
    >>> p1.verdict, round(p1.excess, 3)
    ('passive', 4.924)
    """
    raw = result("ulna_passivity_margins")
    matrices = [view(np.atleast_2d(np.asarray(matrix))) for matrix in (M, B, K)]
    check(lib.ulna_passivity_of_model(*matrices, _options(antisymmetry_threshold), raw))
    return _margins(raw)


def of_energy(
    force: Any, velocity: Any, *, rate_hz: float, beta_j: float = 0.0, min_share: float = 0.05
) -> EnergyIndex:
    """Passivity index from recorded energy, (3.1) and (4.3) of Dyck (2013).

    Parameters
    ----------
    force : array_like, shape (rows,) or (rows, n)
        By the human on the robot, N or N m.
    velocity : array_like, the same shape
        m/s or rad/s.
    beta_j : float
        Minus the energy stored at the start, at most 0.
    min_share : float
        Judge from where this share of the motion is done.

    Examples
    --------
    A pure damper of 3 N s/m:

    >>> import numpy as np, ulna
    >>> v = np.sin(np.arange(0, 10, 0.001))
    >>> round(ulna.passivity.of_energy(-3.0 * v, v, rate_hz=1000.0).index, 9)
    3.0
    """
    index = ffi.new("double *")
    when = ffi.new("double *")
    energy = out_array(
        lib.ulna_passivity_of_energy,
        view(force),
        view(velocity),
        float(rate_hz),
        float(beta_j),
        _options(0.15, min_share=min_share),
        index,
        when,
    )
    return EnergyIndex(index=index[0], time_s=when[0], energy_j=energy)


class _Callable(types.ModuleType):
    def __call__(self, estimate: ImpedanceEstimate, **keywords: Any) -> PassivityVerdict:
        """Judge the passivity of an estimate; see `assess`."""
        return assess(estimate, **keywords)


sys.modules[__name__].__class__ = _Callable
