"""Soft interfaces between arm and exoskeleton, and the compression test; `ulna.exo` offers them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._call import ffi, lib, long_call, options
from ._exo_arguments import as_numbers, number
from .record import refuse

Array = NDArray[np.float64]

LIMBS = ("upper", "fore")
_EXACT_ZERO = (
    "viscosity_n_s_m",
    "neighbour",
    "volume",
    "friction",
    "pretension_n",
    "squeeze_m",
    "tightness_pa",
)
_CUFFS = ("fitted", "published")
_PAIRS = (
    "stiffness_n_m", "viscosity_n_s_m", "neighbour", "volume", "element_mass_kg", "friction",
    "pretension_n", "strap_length_m", "strap_stiffness_n_m", "squeeze_m",
    "tightness_pa", "shear",
)  # fmt: skip
_POINTS = ("shoulder_offset_m", "elbow_offset_m")
_MOST_STEPS = 1000  # of a compression's force ramp; some 60 are usual


# Between the plates before a compression, of the tissue of TissueOptions::upper_arm and forearm.
_WIDTH_M = {"upper": 0.08, "fore": 0.06}


@dataclass(frozen=True, kw_only=True)
class Soft:
    """How cuffs, straps and soft tissue hold the arm in the device.

    A setting of the interfaces is one number for both, or two: upper arm, forearm. Stiffness is
    true, whatever the number and the mass of the elements.

    Attributes
    ----------
    stiffness_n_m, viscosity_n_s_m : float or pair
        Of an element of the tissue to the bone. Default: 537.5, 10.
    neighbour, volume : float or pair
        Stiffness of the surface and of the volume, as shares of `stiffness_n_m`.
    element_mass_kg : float or pair
        That slides; it changes no stiffness.
    friction : float or pair
        Coulomb coefficient of skin on cuff and strap.
    pretension_n : float or pair
        Of the whole strap when donned.
    strap_length_m : float or pair
        Without tension, instead of a pretension.
    strap_stiffness_n_m : float or pair
        Of the webbing between two of its points.
    squeeze_m : float or pair
        How far the cuff's lining presses into the limb.
    tightness_pa : float or pair
        Mean pressure on the skin at which the lining is tight and presses no further; 0: it always
        presses by `squeeze_m`.
    shear : float or pair
        Stiffness along the skin before it slides, of the tissue's stiffness across it. Default: a
        third, that of flesh, which keeps its volume (G = E/3).
    cuffs : {"fitted", "published"}
        Shells three quarters around the limb, towards the far end of its segment and as long as the
        joints leave room for; or short open half shells in the middle of the segments, in which the
        arm slips.
    unlined : bool
        Bare cuffs, wider than the limb.
    shoulder_offset_m : array_like, shape (3,)
        Of the arm's shoulder from the device's, world axes.
    elbow_offset_m : array_like, shape (3,)
        Of the elbow from where the arm's lengths put it, humerus axes (x along it).
    donning_rotation_rad : float
        Of the upper arm about its axis in its cuff.
    fixed_device : bool
        The device keeps its published lengths; else it is adjusted to the arm's.

    Examples
    --------
    >>> from ulna import exo
    >>> plant = exo.exoskeleton(soft=exo.Soft(stiffness_n_m=(300, 500), donning_rotation_rad=0.05))
    >>> plant
    Plant(8 joints, 12 actuators)
    """

    stiffness_n_m: ArrayLike | None = None
    viscosity_n_s_m: ArrayLike | None = None
    neighbour: ArrayLike | None = None
    volume: ArrayLike | None = None
    element_mass_kg: ArrayLike | None = None
    friction: ArrayLike | None = None
    pretension_n: ArrayLike | None = None
    strap_length_m: ArrayLike | None = None
    strap_stiffness_n_m: ArrayLike | None = None
    squeeze_m: ArrayLike | None = None
    tightness_pa: ArrayLike | None = None
    shear: ArrayLike | None = None
    cuffs: str = "fitted"
    unlined: bool = False
    shoulder_offset_m: ArrayLike = (0.0, 0.0, 0.0)
    elbow_offset_m: ArrayLike = (0.0, 0.0, 0.0)
    donning_rotation_rad: float = 0.0
    fixed_device: bool = False

    @classmethod
    def of(cls, given: Soft | Mapping[str, Any] | bool) -> Soft:
        """Settings as they are given: themselves, a table, or True for the defaults."""
        if isinstance(given, Soft):
            return given
        if given is True:
            return cls()
        if not isinstance(given, Mapping):
            raise refuse(
                f"soft is {given!r}; it must be True, exo.Soft or a table", "soft"
            )
        known = {f.name for f in fields(cls)}
        for name in given:
            if name not in known:
                raise refuse(
                    f"soft has {name!r}, which there is not; there are {', '.join(sorted(known))}",
                    "soft",
                )
        return cls(**given)

    def _struct(self) -> Any:
        if self.cuffs not in _CUFFS:
            raise refuse(
                f"cuffs is {self.cuffs!r}; it must be {' or '.join(map(repr, _CUFFS))}", "cuffs"
            )
        struct = options(
            "ulna_soft_options",
            cuffs=_CUFFS.index(self.cuffs),
            unlined=self.unlined,
            fixed_device=self.fixed_device,
            donning_rotation_rad=number(self.donning_rotation_rad, "donning_rotation_rad"),
        )
        for name in _POINTS:
            _write(struct, name, getattr(self, name), 3)
        for name in _PAIRS:
            if (value := getattr(self, name)) is not None:
                _write(struct, name, _pair(name, value), 2)
        return struct


def _pair(name: str, value: ArrayLike) -> Array:
    """Two numbers as the library takes them, to which 0 means its default and less than 0 none."""
    given = as_numbers(value)
    if given is None or given.shape not in ((), (1,), (2,)):
        raise refuse(
            f"{name} is {value!r}; it must be one number, or two: upper arm, forearm", name
        )
    pair = np.broadcast_to(given, (2,)).copy()
    if (pair < 0).any():
        raise refuse(f"{name} is {value!r}; it must not be negative", name)
    if (pair == 0).any():
        if name not in _EXACT_ZERO:
            raise refuse(f"{name} is {value!r}; it must be positive", name)
        pair[pair == 0] = -1.0
    return pair


def _write(struct: Any, name: str, value: ArrayLike, count: int) -> None:
    given = as_numbers(value)
    if given is None or given.shape != (count,):
        raise refuse(f"{name} is {value!r}; it must be {count} numbers", name)
    field = getattr(struct, name)
    for i, entry in enumerate(given):
        field[i] = entry


@dataclass(frozen=True)
class Bushing:
    """A Voigt element of six dimensions between a limb and its cuff or strap.

    Coordinates: displacement of the tissue's centre (m) and rotation vector (rad) of the limb since
    it was donned, cuff frame. The wrench on the limb is
    ``preload - stiffness @ (coordinates - origin) - damping @ rates``.
    """

    limb: str
    part: str
    origin: Array
    preload: Array
    stiffness: Array
    damping: Array


def bushings_of(rows: Array) -> tuple[Bushing, ...]:
    """Bushings from the rows of the library."""
    return tuple(
        Bushing(
            limb=LIMBS[int(row[0])],
            part="strap" if row[1] else "cuff",
            origin=row[2:8].copy(),
            preload=row[8:14].copy(),
            stiffness=row[14:50].reshape(6, 6).copy(),
            damping=row[50:86].reshape(6, 6).copy(),
        )
        for row in rows
    )


@dataclass(frozen=True)
class InterfaceState:
    """What an interface did in a run's last step, cuff frame; NaN where bushings do not know.

    Attributes
    ----------
    cuff, strap : ndarray, shape (6,)
        Force (N) and moment about the tissue's centre (N m) on the limb.
    displacement_m : ndarray, shape (3,)
        Of the tissue's centre since it was donned.
    turn_rad : float
        Of the limb in its cuff since then.
    sliding_m : ndarray, shape (3,)
        Of the skin along the cuff since then.
    pressure_pa, area_m2, tension_n : float
        Largest on the skin; pressed; of the strap.
    """

    cuff: Array
    strap: Array
    displacement_m: Array
    turn_rad: float
    sliding_m: Array
    pressure_pa: float
    area_m2: float
    tension_n: float


def states_of(rows: Array) -> dict[str, InterfaceState]:
    """States by limb from the rows of the library."""
    return {
        limb: InterfaceState(
            row[:6].copy(), row[6:12].copy(), row[12:15].copy(), float(row[15]), row[16:19].copy(),
            *(float(value) for value in row[19:22]),
        )
        for limb, row in zip(LIMBS, rows, strict=False)
    }  # fmt: skip


@dataclass(frozen=True)
class Compression:
    """Compression of soft tissue between two plates (Fig. 6 of Tesfazgi 2023).

    Attributes
    ----------
    limb : str
    force_n, strain, stress_pa, modulus_pa : ndarray, shape (steps,)
        Force on each plate; shortening over the width; force over the tissue's length times width;
        stress over strain.
    energy_rise_j : float
        Largest rise of energy less the plates' work within a step of the force: rounding only.
    """

    limb: str
    force_n: Array
    strain: Array
    stress_pa: Array
    modulus_pa: Array
    energy_rise_j: float

    def __repr__(self) -> str:
        return (
            f"Compression({self.limb}, E {self.modulus_at(0.3) / 1e3:.1f} kPa at 30 %, "
            f"{self.modulus_at(0.4) / 1e3:.1f} kPa at 40 %)"
        )

    @property
    def width_m(self) -> float:
        """Distance of the plates before."""
        return _WIDTH_M[self.limb]

    @property
    def displacement_m(self) -> Array:
        """By how much the plates came nearer."""
        return self.strain * self.width_m

    def plot(self, axes: Any = None) -> Any:
        """Force, stress and modulus: :func:`ulna.plot.compression`."""
        from .plot import compression

        return compression(self, axes)

    def modulus_at(self, strain: float) -> float:
        """Stress over strain between the measured points, Pa; NaN beyond them."""
        inside = self.strain[0] <= strain <= self.strain[-1]
        return (
            float(np.interp(strain, self.strain, self.modulus_pa))
            if inside
            else float("nan")
        )


def compression_test(
    soft: Soft | Mapping[str, Any] | bool = True,
    *,
    limb: str = "upper",
    largest_strain: float = 0.45,
) -> Compression:
    """Compress the tissue of an interface, the same that holds the arm, as slowly as it settles.

    Parameters
    ----------
    soft : Soft, mapping or True
        Settings of the interfaces.
    limb : {"upper", "fore"}
    largest_strain : float
        Where the force ends; below 0.9.

    Examples
    --------
    >>> from ulna import exo
    >>> soft = exo.compression_test({"stiffness_n_m": 100.5})
    >>> stiff = exo.compression_test({"stiffness_n_m": 974.43})
    >>> bool((np.diff(soft.stress_pa) > 0).all()), soft.modulus_at(0.3) < stiff.modulus_at(0.3)
    (True, True)
    """
    if limb not in LIMBS:
        raise refuse(f"limb is {limb!r}; it must be one of {', '.join(LIMBS)}", "limb")
    if not number(largest_strain, "largest_strain") > 0:
        raise refuse(
            f"largest_strain is {largest_strain!r}; it must be positive",
            "largest_strain",
        )
    buffer = np.empty(5 * _MOST_STEPS)
    count = ffi.new("int64_t *")
    long_call(
        lib.ulna_tissue_compress,
        Soft.of(soft)._struct(),
        LIMBS.index(limb),
        largest_strain,
        ffi.NULL,
        ffi.cast("double *", buffer.ctypes.data),
        buffer.size,
        count,
    )
    rows = buffer[: count[0]].reshape(-1, 5)
    force, strain, stress, modulus, energy = (column.copy() for column in rows.T)
    return Compression(limb, force, strain, stress, modulus, float(energy.max()))
