"""A design held against limits."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ._call import Handle, check, ffi, lib, long_call, options, out_array, result, text
from ._design_arguments import limit_of, number
from ._design_assumed import Limits, Noise, Robot, structs_of

if TYPE_CHECKING:
    from .design import Design

QUANTITIES = ("force", "displacement", "velocity")


class _Safety(Handle):
    kind = "ulna_safety"
    __slots__ = ()


@dataclass(frozen=True, eq=False)
class SafetyCheck:
    """A design held against limits.

    Attributes
    ----------
    within : bool
        All limits are kept.
    scale : float
        Largest factor of the design that keeps them; infinite without limits, 0 when tremor and rest
        alone exceed them.
    tightest : str
        "force", "displacement" or "velocity": the limit that is met first.
    axis : str
        The axis with the largest share where it is met.
    time_s : float
        When it is met.
    peaks : dict of str to ndarray, shape (n + 1,)
        Largest magnitude on each axis and, last, of the vector, with the tremor's part.
    peak_times_s : dict of str to ndarray, shape (n + 1,)
    tremor : dict of str to ndarray, shape (n + 1,)
        The tremor's part of the peaks.
    limits, scales : dict of str to float
        By quantity; NaN and infinity where there is no limit.
    message : str
        The verdict in a sentence.
    """

    within: bool
    scale: float
    tightest: str
    axis: str
    time_s: float
    peaks: dict[str, np.ndarray]
    peak_times_s: dict[str, np.ndarray]
    tremor: dict[str, np.ndarray]
    limits: dict[str, float]
    scales: dict[str, float]
    message: str
    design: Design = field(repr=False)
    _arm: Any = field(repr=False)
    _robot: Any = field(repr=False)

    @property
    def units(self) -> dict[str, str]:
        """Unit of each quantity."""
        if self.design.rotational:
            return {"force": "N m", "displacement": "rad", "velocity": "rad/s"}
        return {"force": "N", "displacement": "m", "velocity": "m/s"}

    def summary(self) -> str:
        """Peaks beside limits, and the verdict.

        Examples
        --------
        >>> import ulna
        >>> found = ulna.design.steps(seed=1).check(limits=ulna.design.Limits(velocity=0.05))
        >>> print(found.summary())  # doctest: +ELLIPSIS
        Peaks with the tremor's part...
        """
        return _safety_summary(self)

    def plot(self) -> Any:
        """Predicted force, displacement and velocity over time, with the limits (needs matplotlib)."""
        from ._plot_design import safety

        return safety(self)

    def __repr__(self) -> str:
        return f"<SafetyCheck: {self.message}>"


def _safety(design: Design, handle: _Safety, arm: Any, robot: Any) -> SafetyCheck:
    info = result("ulna_safety_info")
    check(lib.ulna_safety_get_info(handle.pointer, info))
    tables = {
        name: out_array(lib.ulna_safety_get_peaks, handle.pointer, which, shape=(-1, 3), order="F")
        for which, name in enumerate(QUANTITIES)
    }
    tightest = QUANTITIES[info.tightest]
    return SafetyCheck(
        within=bool(info.within),
        scale=info.scale,
        tightest=tightest,
        axis=design.axes[info.scale_axes[info.tightest]],
        time_s=info.scale_times_s[info.tightest],
        peaks={name: table[:, 0] for name, table in tables.items()},
        peak_times_s={name: table[:, 1] for name, table in tables.items()},
        tremor={name: table[:, 2] for name, table in tables.items()},
        limits={name: info.limits[which] or np.nan for which, name in enumerate(QUANTITIES)},
        scales={name: info.scales[which] for which, name in enumerate(QUANTITIES)},
        message=text(lib.ulna_safety_get_text, handle.pointer),
        design=design,
        _arm=arm,
        _robot=robot,
    )


def _safety_summary(safety: SafetyCheck) -> str:
    from ._words import _paragraph

    design = safety.design
    vector = ("vector",) if design.n > 1 else ()
    heads = [*design.axes, *vector, "limit", "scale to"]
    width = max(11, 2 + max(map(len, heads)))  # 75 columns for two axes
    lines = [
        "Peaks with the tremor's part",
        f"{'':<20}" + "".join(f"{head:>{width}}" for head in heads),
    ]
    for name in QUANTITIES:
        values = safety.peaks[name][: design.n + len(vector)]
        limit = safety.limits[name]
        entries = [f"{value:.3g}" for value in values]
        entries += ["-", "-"] if np.isnan(limit) else [f"{limit:.3g}", f"{safety.scales[name]:.3g}"]
        label = f"{name} ({safety.units[name]})"
        lines.append(f"{label:<20}" + "".join(f"{entry:>{width}}" for entry in entries))
    return "\n".join([*lines, _paragraph(safety.message)])


def check_design(
    design: Design,
    arm: Any,
    *,
    robot: Robot | None,
    limits: Limits | None,
    noise: Noise | None,
    sigmas: float,
) -> SafetyCheck:
    """What `Design.check` gives."""
    wanted = limits or Limits()
    per_axis = design.rotational if wanted.per_axis is None else wanted.per_axis
    chosen = options(
        "ulna_safety_options",
        **{name: limit_of(getattr(wanted, name), name) for name in QUANTITIES},
        sigmas=-1.0 if sigmas == 0 else number(sigmas, "sigmas", least=0.0),
        per_axis=per_axis,
        rotational=design.rotational,
    )
    names = ffi.new("char[]", ",".join(design.axes).encode())
    out = ffi.new("ulna_safety **")
    long_call(
        lib.ulna_design_check,
        design._native().pointer,
        *structs_of(design, arm, robot, noise),
        names,
        chosen,
        ffi.NULL,
        out,
    )
    return _safety(design, _Safety(out[0]), arm, robot)
