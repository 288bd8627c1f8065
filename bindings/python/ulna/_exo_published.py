"""The published simulation (Tesfazgi 2023), built again with its defects as switches; `ulna.exo` offers it."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

from ._call import ArgumentError, lib, options
from ._exo_assessment import Assessment, Protocol, identify_viscoelasticity, mobilise

if TYPE_CHECKING:
    from .exo import Plant

PUBLISHED_DEFECTS: Mapping[str, str] = MappingProxyType(
    {
        "hold": "the motors' torque is held for 10 ms, which is unstable on light arms",
        "strap_mask": "73 of the 74 threads of the straps are as soft as the upper arm's tissue",
        "nominal": "the estimator's device knows no inertia, friction, tissue or straps, always the "
        "nominal arm, and has the elbow 15 mm beside its joint",
        "self_contact": "tissue and straps overlap, touch themselves and carry load by it",
        "human_angle": "the torque is regressed on the arm's true angle, which no device knows",
        "flags": "only a joint that turns faster than 2 rad/s in flexion ends a movement",
        "limits": "the start lies on limits of the joints of device and shoulder",
        "drop": "the arm settles by falling from the horizontal with the motors off",
    }
)


def _chosen(defects: Collection[str] | None) -> frozenset[str]:
    if defects is None:
        return frozenset(PUBLISHED_DEFECTS)
    names = [defects] if isinstance(defects, str) else list(defects)
    for name in names:
        if name not in PUBLISHED_DEFECTS:
            raise ArgumentError(
                f"the published simulation has no defect {name!r}; it has "
                + ", ".join(PUBLISHED_DEFECTS),
                status="ULNA_ERROR_ARGUMENT",
                argument="defects",
            )
    return frozenset(names)


def published_simulation(
    *,
    defects: Collection[str] | None = None,
    upper_factor: float = 1.0,
    fore_factor: float = 1.0,
    upper_mass_kg: float = 1.761,
    fore_mass_kg: float = 0.962,
    upper_stiffness_1_s2: float = 537.5,
    fore_stiffness_1_s2: float = 537.5,
    viscosity_1_s: float = 111.0,
) -> Plant:
    """The plant of the published simulation, built again from its numbers.

    Device and arm with straight muscles, tissue as shells of spheres on slides, straps as grids of
    spheres, bare cuffs: 430 degrees of freedom. A run of it takes 0.7 GB of memory and computes about
    as long as it simulates.

    Parameters
    ----------
    defects : collection of str, optional
        Of :data:`PUBLISHED_DEFECTS`; default: all. Those of the plant are "strap_mask", "nominal"
        (its masses), "self_contact" and "limits"; see :func:`published_assessment` for the others.
    upper_factor, fore_factor : float
        Of the lengths of upper arm and forearm.
    upper_mass_kg, fore_mass_kg : float
        Without soft tissue (0.489 and 0.351 kg).
    upper_stiffness_1_s2, fore_stiffness_1_s2, viscosity_1_s : float
        Of the constraints of the tissue, for each kg of an element: published as N/m and N s/m.

    Examples
    --------
    >>> from ulna import exo
    >>> plant = exo.published_simulation()
    >>> plant
    Plant(430 joints, 27 actuators)
    >>> plant.values("reference", "upper_strap_3_1~upper_strap_4_1")
    array([-537.5, -111. ])
    """
    from .exo import Plant, _Plant

    kept = _chosen(defects)
    numbers = {
        "upper_factor": upper_factor,
        "fore_factor": fore_factor,
        "upper_mass_kg": upper_mass_kg,
        "fore_mass_kg": fore_mass_kg,
        "upper_stiffness_1_s2": upper_stiffness_1_s2,
        "fore_stiffness_1_s2": fore_stiffness_1_s2,
        "viscosity_1_s": viscosity_1_s,
    }
    for name, value in numbers.items():
        if not value > 0:
            raise ArgumentError(
                f"{name} is {value!r}; it must be positive",
                status="ULNA_ERROR_ARGUMENT",
                argument=name,
            )
    settings = options(
        "ulna_published_options",
        own_straps="strap_mask" not in kept,
        whole_nominal="nominal" not in kept,
        no_self_contact="self_contact" not in kept,
        wide_limits="limits" not in kept,
        **numbers,
    )
    return Plant(_Plant.make(lib.ulna_plant_new_published, settings))


@dataclass(frozen=True, eq=False)
class PublishedAssessment:
    """An assessment of the published simulation. What is not known is NaN.

    The published sign: K is the slope of the muscles' torque on the angle, so what flexes more the
    more the elbow is bent (an anti-spring) has K > 0.

    Attributes
    ----------
    k_nm_rad, true_k_nm_rad : float
        Estimate, and slope of the muscles' true torque on the arm's angle.
    assessment : Assessment
        In this project's sign.
    defects : frozenset of str
    """

    k_nm_rad: float
    true_k_nm_rad: float
    assessment: Assessment
    defects: frozenset[str]

    @property
    def error_nm_rad(self) -> float:
        """Estimate less truth."""
        return self.k_nm_rad - self.true_k_nm_rad

    @property
    def status(self) -> str:
        """How the run ended: ok, or what flagged it."""
        return self.assessment.status

    @property
    def largest_slip_rad(self) -> float:
        """Between the elbow of the arm and that of the device."""
        return self.assessment.largest_slip_rad

    def __repr__(self) -> str:
        if self.status != "ok":
            return f"<PublishedAssessment {self.status}: {self.assessment.reason}>"
        return (
            f"<PublishedAssessment K={self.k_nm_rad:.3f} N m/rad, true {self.true_k_nm_rad:.3f}, "
            f"error {self.error_nm_rad:+.3f}>"
        )


def published_assessment(
    *, defects: Collection[str] | None = None, **arm: float
) -> PublishedAssessment:
    """Assess an arm as the published simulation does, with all of its defects or some of them.

    Parameters
    ----------
    defects : collection of str, optional
        Of :data:`PUBLISHED_DEFECTS`; default: all. The controller's ("hold") and the straps'
        ("strap_mask") decide what the published study found.
    **arm
        Factors, masses and stiffnesses as :func:`published_simulation` takes them.

    Returns
    -------
    PublishedAssessment
        A run takes a quarter of a minute or more.

    Examples
    --------
    >>> from ulna import exo
    >>> kept = set(exo.PUBLISHED_DEFECTS) - {"hold", "strap_mask"}
    >>> exo.published_assessment(defects=kept)  # doctest: +SKIP
    <PublishedAssessment K=6.256 N m/rad, true 6.276, error -0.020>
    """
    kept = _chosen(defects)
    plant = published_simulation(defects=kept, **arm)
    protocol = Protocol.published().with_(
        torque="held" if "hold" in kept else "every_step",
        from_reference="drop" in kept,
        published_flags="flags" in kept,
    )
    done = mobilise(plant, protocol, published_estimator=True)
    if done.status != "ok" or done.record is None:
        return PublishedAssessment(float("nan"), float("nan"), done, kept)
    known = "nominal" not in kept
    (joint,) = identify_viscoelasticity(
        done.record,
        plant,
        published=True,
        friction="engine" if known else None,
        damping_torque=known,
        inertia=known,
        human_angle="human_angle" in kept,
    )
    return PublishedAssessment(-joint.k, -joint.true_k_alone, done, kept)
