"""Forces that were computed rather than read, and what their errors do to an impedance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ._call import Handle, check, ffi, lib, long_call, options, out_array, result, text
from .record import Record, _Record, refuse

if TYPE_CHECKING:
    from .impedance import ImpedanceEstimate

_PLACES = {"M": 0, "B": 1, "K": 2}


class _Sensed(Handle):
    kind = "ulna_sensed"
    __slots__ = ()


class _ForceBudget(Handle):
    kind = "ulna_force_budget"
    __slots__ = ()


def words(channels: str | Sequence[str] | None) -> str | None:
    """A word for several channels as it is; a list of names means exactly these."""
    if channels is None or isinstance(channels, str):
        return channels
    return ",".join(channels) + ","


def filters(
    *,
    position: str | Sequence[str] | None = None,
    force: str | Sequence[str] | None = None,
    lowpass_hz: float | None = None,
    lowpass_order: int | None = None,
    window: int | None = None,
    order: int | None = None,
    plain_savgol: bool = False,
    threads: int = 0,
) -> Any:
    """Options of the preparation; a low pass of 0 Hz means none."""
    if lowpass_hz is not None and lowpass_hz == 0:
        lowpass_hz = -1.0
    return options(
        "ulna_prepare_options",
        position=words(position),
        force=words(force),
        lowpass_hz=lowpass_hz,
        lowpass_order=lowpass_order,
        window=window,
        order=order,
        plain_savgol=plain_savgol,
        threads=threads,
    )


def lines(words_: str) -> tuple[str, ...]:
    """Text of several lines as a tuple; empty for no text."""
    return tuple(words_.split("\n")) if words_ else ()


@dataclass(frozen=True, eq=False)
class SensedForce:
    """A record with computed forces and what is known of their errors.

    Made by `ulna.virtual_sensor.sense`, `StrainGauge.apply` and `ulna.rig.tare_record`.

    Attributes
    ----------
    record : Record
        With the forces (N, by the human on the robot), ready for `ulna.identify_impedance`.
    constants : tuple of str
        What may be wrong by the same amount in every row: "parameter 1", "slope x", "lever".
    constant_cov : ndarray, shape (constants, constants)
        Their covariance.
    accelerometer : bool
        Whether accelerations were measured; False: differentiated or none needed.
    worst_quality : float
        Smallest over largest singular value of the Jacobian; 1 for other sensors.
    worst_row : int
        Row of the source record where that is.
    lowpass_hz : float
        Of the signals; 0 without.
    """

    record: Record
    constants: tuple[str, ...]
    constant_cov: np.ndarray
    accelerometer: bool
    worst_quality: float
    worst_row: int
    lowpass_hz: float
    _handle: _Sensed = field(repr=False)
    _axes: int = field(repr=False)

    def _rows(self, quantity: int) -> np.ndarray:
        values = out_array(lib.ulna_sensed_get_values, self._handle.pointer, quantity)
        return values.reshape(-1, self._axes)

    @cached_property
    def force(self) -> np.ndarray:
        """The computed forces, N, shape (rows, axes)."""
        columns = list(self.record.with_role("force"))
        return self.record.values[:, columns]

    @cached_property
    def force_se(self) -> np.ndarray:
        """Standard deviation of the force at every row, all known sources, N, shape (rows, axes)."""
        if not self.constants and not self.parts:
            return np.zeros((len(self.record), self._axes))
        return self._rows(lib.ULNA_SENSED_TOTAL)

    @cached_property
    def parts(self) -> dict[str, np.ndarray]:
        """Standard deviation of the force by source, N, each of shape (rows, axes).

        "constants" is the same error in every row; "torque", "angle" and "acceleration" are noise.
        Sources of which nothing is known are left out.
        """
        found = {
            "constants": self._rows(lib.ULNA_SENSED_SYSTEMATIC),
            "torque": self._rows(lib.ULNA_SENSED_TORQUE),
            "angle": self._rows(lib.ULNA_SENSED_ANGLE),
            "acceleration": self._rows(lib.ULNA_SENSED_ACCELERATION),
        }
        return {name: values for name, values in found.items() if np.any(values)}

    def budget(self, estimate: ImpedanceEstimate) -> ForceBudget:
        """What the constants do to M, B and K of an impedance identified from this record.

        Parameters
        ----------
        estimate : ImpedanceEstimate
            From `record`, whatever the options.
        """
        if not hasattr(estimate, "K"):
            raise refuse("estimate must be an ulna.ImpedanceEstimate from this record", "estimate")
        out = ffi.new("ulna_force_budget **")
        long_call(
            lib.ulna_force_budget_new,
            self._handle.pointer,
            estimate._handle.pointer,
            ffi.NULL,
            out,
        )
        handle = _ForceBudget(out[0])
        size = len(estimate.cov)

        def get(quantity: int, *shape: int) -> np.ndarray:
            return out_array(
                lib.ulna_force_budget_get_values, handle.pointer, quantity, shape=shape
            )

        return ForceBudget(
            estimate=estimate,
            constants=self.constants,
            constant_cov=self.constant_cov,
            sensitivity=get(lib.ULNA_BUDGET_SENSITIVITY, size, len(self.constants)),
            systematic_cov=get(lib.ULNA_BUDGET_SYSTEMATIC, size, size),
            total_cov=get(lib.ULNA_BUDGET_TOTAL, size, size),
        )

    def summary(self) -> str:
        """Where the force comes from and how uncertain it is, as text."""
        from ._words import _paragraph

        force = self.force
        size = np.sqrt(np.mean((force - force.mean(axis=0)) ** 2, axis=0))
        out = [_paragraph(self.record.provenance[-1]), ""]
        names = [self.record.channels[c].name for c in self.record.with_role("force")]
        table = {"force": size} | {
            name: np.sqrt(np.mean(values**2, axis=0)) for name, values in self.parts.items()
        }
        if self.parts:
            table["all errors"] = np.sqrt(np.mean(self.force_se**2, axis=0))
        out.append(f"{'rms, N':<16}" + "".join(f"{name:>12}" for name in names))
        for name, values in table.items():
            out.append(f"{name:<16}" + "".join(f"{value:>12.4g}" for value in values))
        if not self.parts:
            out.append("Nothing was given about the errors of this force.")
        return "\n".join(out)

    def __repr__(self) -> str:
        error = np.sqrt(np.mean(self.force_se**2))
        spread = f" ± {error:.3g} N" if error > 0 else ""
        return f"<SensedForce: {len(self.record)} rows{spread}>"


@dataclass(frozen=True, eq=False)
class ForceBudget:
    """What the errors of a computed force do to an impedance.

    Attributes
    ----------
    estimate : ImpedanceEstimate
    constants : tuple of str
    constant_cov : ndarray, shape (constants, constants)
    sensitivity : ndarray, shape (parameters, constants)
        Change of M, B and K row by row and x0 per unit of each constant.
    systematic_cov : ndarray
        Covariance of these parameters from the constants: a longer recording does not lower it.
    total_cov : ndarray
        With the statistical covariance of the estimate.
    """

    estimate: ImpedanceEstimate
    constants: tuple[str, ...]
    constant_cov: np.ndarray
    sensitivity: np.ndarray
    systematic_cov: np.ndarray
    total_cov: np.ndarray

    def _shaped(self, covariance: np.ndarray, name: str) -> np.ndarray:
        n = self.estimate.n
        if name not in (*_PLACES, "x0"):
            raise refuse(f"there is no parameter {name!r}; there are M, B, K and x0", "name")
        first = 3 * n * n if name == "x0" else _PLACES[name] * n * n
        shape = (n,) if name == "x0" else (n, n)
        spread = np.sqrt(np.diag(covariance)[first : first + int(np.prod(shape))])
        return spread.reshape(shape)

    def systematic_se(self, name: str) -> np.ndarray:
        """Standard error of "M", "B", "K" or "x0" from the constants alone, in its shape."""
        return self._shaped(self.systematic_cov, name)

    def total_se(self, name: str) -> np.ndarray:
        """Standard error of "M", "B", "K" or "x0" from everything, in its shape."""
        return self._shaped(self.total_cov, name)

    def shares(self) -> dict[str, np.ndarray]:
        """Systematic standard error of every parameter by constant, correlations left out."""
        sd = np.sqrt(np.diag(self.constant_cov))
        return {
            name: np.abs(self.sensitivity[:, i]) * sd[i] for i, name in enumerate(self.constants)
        }

    def summary(self) -> str:
        """M, B and K with statistical, systematic and total standard error, as text."""
        estimate = self.estimate
        out = [f"{'':<10}{'value':>10}{'statistical':>14}{'systematic':>14}{'total':>12}"]
        shares = self.shares()
        size = estimate.n**2
        for name, place in _PLACES.items():
            rows = zip(
                getattr(estimate, name).ravel(),
                estimate.se(name).ravel(),
                self.systematic_se(name).ravel(),
                self.total_se(name).ravel(),
                strict=True,
            )
            for k, (value, random, constant, total) in enumerate(rows):
                i, j = divmod(k, estimate.n)
                label = f"{name}_{estimate.axes[i]}{estimate.axes[j]}"
                largest = max(shares, key=lambda key: shares[key][place * size + k])
                line = f"{label:<10}{value:>10.4g}{random:>14.2g}{constant:>14.2g}{total:>12.2g}"
                out.append(f"{line}  {largest if constant > random else ''}".rstrip())
        out.append(
            "The last column names the largest systematic source where it is the larger part."
        )
        return "\n".join(out)

    def __repr__(self) -> str:
        k = self.systematic_se("K").max()
        return f"<ForceBudget: K ± {k:.3g} {self.estimate.units['K']} from {len(self.constants)} constants>"


def sensed(handle: _Sensed, kind: type[SensedForce] = SensedForce, **more: Any) -> Any:
    """The Python object of a computed force."""
    info = result("ulna_sensed_info")
    check(lib.ulna_sensed_get_info(handle.pointer, info))
    constants = lines(text(lib.ulna_sensed_get_names, handle.pointer))
    count = len(constants)
    return kind(
        record=Record(_Record.make(lib.ulna_sensed_get_record, handle.pointer)),
        constants=constants,
        constant_cov=out_array(
            lib.ulna_sensed_get_values,
            handle.pointer,
            lib.ULNA_SENSED_COVARIANCE,
            shape=(count, count),
        ),
        accelerometer=bool(info.accelerometer),
        worst_quality=info.worst_quality,
        worst_row=info.worst_row,
        lowpass_hz=info.lowpass_hz,
        _handle=handle,
        _axes=info.axes,
        **more,
    )
