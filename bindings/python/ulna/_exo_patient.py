"""Stiffness and damping of a measured patient whose arm is not known exactly; `ulna.exo` offers it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ._exo_assessment import identify_viscoelasticity
from .record import refuse

if TYPE_CHECKING:
    from ._factors import Factor
    from ._study_patient import Patient
    from .exo import Plant
    from .record import Record

_UNITS = {"upper_mass_kg": "kg", "fore_mass_kg": "kg", "height_m": "m", "mass_kg": "kg"}


def population() -> dict[str, Factor]:
    """What an arm may be of which nothing is measured: lengths and masses of a population.

    Truncated normal distributions around the published arm: factors of the lengths of upper arm and
    forearm (standard deviation 5 %), masses without soft tissue (0.36 and 0.21 kg).

    Examples
    --------
    >>> from ulna import exo
    >>> sorted(exo.population())
    ['fore_factor', 'fore_mass_kg', 'upper_factor', 'upper_mass_kg']
    """
    from ._factors import TruncatedNormal

    return {
        "upper_factor": TruncatedNormal(1.0, 0.05, 0.9, 1.1),
        "fore_factor": TruncatedNormal(1.0, 0.0516, 0.9, 1.1),
        "upper_mass_kg": TruncatedNormal(1.761, 0.36, 0.001, 3.521),
        "fore_mass_kg": TruncatedNormal(0.962, 0.21, 0.001, 1.922),
    }


def patient(
    record: Record,
    plant: Plant,
    factors: Mapping[str, Factor] | None = None,
    *,
    nominal: Callable[..., Plant] | None = None,
    joints: Sequence[str] | None = None,
    observed: Mapping[str, Any] | None = None,
    covariance: Any = None,
    measurable: Sequence[str] | None = None,
    method: str = "reweight",
    n: int | None = None,
    level: float = 0.9,
    seed: int = 0,
    misfit: bool = False,
    identify: Mapping[str, Any] | None = None,
    **running: Any,
) -> Patient:
    """Intervals of K and D from a log, over what is not known of the patient's arm.

    The log is identified once more for each arm that the patient could have, with that arm as
    nominal model. The intervals hold the errors of the measurement and of the arm together, and
    say which part of the arm to measure better.

    Parameters
    ----------
    record : Record
        Simulated or recorded; see :func:`identify_viscoelasticity`.
    plant : Plant
        Whose device it is.
    factors : dict of str to Factor, optional
        Settings of :func:`exoskeleton` that are uncertain; :func:`population` by default.
    nominal : callable, optional
        Makes the plant of an arm from the factors by name; :func:`exoskeleton` by default.
    joints : sequence of str, optional
        Default: those that moved. With more than one the quantities are "K_J3", "D_J3", ...
    observed, covariance, measurable, method, n, level, seed
        See :meth:`ulna.Study.patient`.
    misfit : bool
        The log's own errors count all that a straight line leaves, not the noise alone: for
        sensors whose errors are as slow as the movement.
    identify : dict, optional
        More for :func:`identify_viscoelasticity`.
    **running
        As of :meth:`ulna.Study.run`: journal, progress.

    Returns
    -------
    ulna.study.Patient
        Its quantities are "K" (N m/rad) and "D" (N m s/rad).

    Examples
    --------
    >>> import ulna
    >>> from ulna import exo
    >>> plant = exo.exoskeleton()
    >>> log = exo.mobilise(plant).record
    >>> mass = {"fore_mass_kg": ulna.Normal(0.96, 0.1)}
    >>> print(exo.patient(log, plant, mass, n=64)["K"].advice())
    To halve the interval of K: measure fore_mass_kg to ±0.057 kg (standard error).
    """
    from .exo import exoskeleton
    from .study import Study

    chosen = population() if factors is None else dict(factors)
    make = exoskeleton if nominal is None else nominal
    if not callable(make):
        raise refuse(f"nominal must make a plant from the factors, got {make!r}", "nominal")
    options = dict(identify or {})

    def assess(**arm: float) -> dict[str, float]:
        found = identify_viscoelasticity(record, plant, nominal=make(**arm), joints=joints, **options)
        out = {}
        for one in found:
            tail = "" if len(found) == 1 else f"_{one.joint}"
            k_error = one.k_misfit_error if misfit else one.k_error
            out |= {f"K{tail}": one.k, f"K{tail}_error": k_error}
            if rate:
                d_error = one.d_misfit_error if misfit else one.d_error
                out |= {f"D{tail}": one.d, f"D{tail}_error": d_error}
        return out

    # Once with the plant's own arm: names of the quantities, and an error about the log at once.
    rate = options.get("rate", not options.get("published", False)) is not False
    first = identify_viscoelasticity(record, plant, joints=joints, **options)
    tails = [""] if len(first) == 1 else [f"_{one.joint}" for one in first]
    quantities = {
        f"{letter}{tail}": f"{letter}{tail}_error"
        for tail in tails
        for letter in ("KD" if rate else "K")
    }
    names = [*quantities, *quantities.values()]
    units = {name: "N m/rad" if name.startswith("K") else "N m s/rad" for name in names}
    study = Study(
        chosen,
        assess,
        outputs=names,
        units={**units, **{name: unit for name, unit in _UNITS.items() if name in chosen}},
    )
    return study.patient(
        n=n,
        quantities=quantities,
        observed=observed,
        covariance=covariance,
        measurable=measurable,
        method=method,
        level=level,
        seed=seed,
        **running,
    )
