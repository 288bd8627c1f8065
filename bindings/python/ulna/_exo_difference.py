"""What a reduced plant costs: its assessment beside the full plant's; `ulna.exo` offers it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ._call import Handle, check, ffi, lib, long_call, result, text
from ._exo_arguments import plant_pointer
from ._exo_assessment import estimator_options, protocol_of
from .record import Record, _Record

if TYPE_CHECKING:
    from ._exo_assessment import Protocol
    from .exo import Plant

_NUMBERS = (
    "full_k", "full_k_error", "full_d", "full_slip_rad", "k", "k_error", "d", "slip_rad",
    "torque_rms_nm", "angle_rms_rad", "displacement_rms_m",
)  # fmt: skip


class _PlantDifference(Handle):
    kind = "ulna_plant_difference"
    __slots__ = ()


@dataclass(frozen=True, eq=False)
class PlantDifference:
    """An assessment with a full plant beside that with its reduced one.

    What bushings do not know is not compared: pressure, pressed area, tension of the strap, sliding
    of the skin.

    Attributes
    ----------
    joint : str
        Of the device.
    full_k, full_d : float
        Of the full plant: N m/rad, N m s/rad.
    full_k_error : float
        Its K less the muscles' true one.
    full_slip_rad : float
        Its largest slip since donned.
    k, k_error, d, slip_rad : float
        The same, reduced less full.
    torque_rms_nm, angle_rms_rad, displacement_rms_m : float
        Between the two, over the movement: torque of the muscles by the nominal model, angle of
        the human joint, place of the limbs in their cuffs.
    full, reduced : Record
        The logs.
    """

    joint: str
    full_k: float
    full_k_error: float
    full_d: float
    full_slip_rad: float
    k: float
    k_error: float
    d: float
    slip_rad: float
    torque_rms_nm: float
    angle_rms_rad: float
    displacement_rms_m: float
    full: Record = field(repr=False)
    reduced: Record = field(repr=False)

    def __repr__(self) -> str:
        return (
            f"<PlantDifference {self.joint} K {self.k:+.2g} N m/rad D {self.d:+.2g} N m s/rad "
            f"torque {self.torque_rms_nm:.2g} N m rms>"
        )

    def summary(self) -> str:
        """The numbers in a few lines."""
        from math import degrees

        rows = (
            ("K", self.full_k, self.k, "N m/rad"),
            ("K less true", self.full_k_error, self.k_error, "N m/rad"),
            ("D", self.full_d, self.d, "N m s/rad"),
            ("slip", degrees(self.full_slip_rad), degrees(self.slip_rad), "deg"),
        )
        lines = [f"{self.joint:12} {'full':>8} {'reduced':>8} {'less full':>9}"]
        for name, full, less, unit in rows:
            lines.append(f"{name:12} {full:8.3f} {full + less:8.3f} {less:+9.3f} {unit}")
        lines.append(
            f"rms: torque {self.torque_rms_nm:.3g} N m, "
            f"angle {degrees(self.angle_rms_rad):.2g} deg, "
            f"place in the cuffs {1e3 * self.displacement_rms_m:.2g} mm"
        )
        return "\n".join(lines)

    def plot(self, axes: Any = None) -> Any:
        """Torque, slip and displacement of both over time: :func:`ulna.plot.plant_difference`."""
        from .plot import plant_difference

        return plant_difference(self, axes)


def difference(
    full: Plant, reduced: Plant | None, protocol: Protocol | None, **estimator: Any
) -> PlantDifference:
    """See :meth:`ulna.exo.Plant.difference`."""
    chosen = protocol_of(protocol)
    other = full.reduced() if reduced is None else reduced
    out = ffi.new("ulna_plant_difference **")
    long_call(
        lib.ulna_plant_difference_new,
        full._pointer,
        plant_pointer(other, "reduced"),
        chosen._struct(),
        estimator_options(**estimator),
        ffi.NULL,
        out,
    )
    handle = _PlantDifference(out[0])
    raw = result("ulna_plant_difference_result")
    check(lib.ulna_plant_difference_get_result(handle.pointer, raw))
    logs = [
        Record(_Record.make(lib.ulna_plant_difference_record, handle.pointer, which))
        for which in (0, 1)
    ]
    return PlantDifference(
        joint=text(lib.ulna_plant_difference_text, handle.pointer),
        full=logs[0],
        reduced=logs[1],
        **{name: getattr(raw, name) for name in _NUMBERS},
    )
