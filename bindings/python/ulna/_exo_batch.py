"""Many simulated assessments on the library's threads, and as the function of a study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._call import Handle, check, ffi, lib, long_call, options, text, view
from ._exo_arguments import plant_pointer
from ._exo_assessment import protocol_of
from .record import refuse

if TYPE_CHECKING:
    from ._exo_assessment import Protocol
    from ._factors import Factor
    from ._study_call import RunTable
    from .exo import Plant
    from .study import Study

Array = NDArray[np.float64]

STATUSES = ("ok", "failed_init", "diverged", "limit", "timeout", "nonfinite")
OUTPUTS = (
    "start_s", "slip_rad", "K_est", "D_est", "K_est_error", "D_est_error", "K_true", "D_true",
    "K_true_alone", "residual_nm", "r_squared", "model_residual_nm",
)  # fmt: skip
_OUTPUT_UNITS = {
    "start_s": "s", "slip_rad": "rad", "K_est": "N m/rad", "D_est": "N m s/rad",
    "K_est_error": "N m/rad", "D_est_error": "N m s/rad", "K_true": "N m/rad",
    "D_true": "N m s/rad", "K_true_alone": "N m/rad", "K_error": "N m/rad", "D_error": "N m s/rad",
    "residual_nm": "N m", "r_squared": "", "model_residual_nm": "N m",
}  # fmt: skip
# Differences that a study asks for: estimate less truth.
_DIFFERENCES = {"K_error": ("K_est", "K_true"), "D_error": ("D_est", "D_true")}

# Factor -> its constant, and what is added to it.
FACTORS = {
    "upper_factor": ("upper_factor", 0),
    "fore_factor": ("fore_factor", 0),
    "upper_mass_kg": ("upper_mass", 0),
    "fore_mass_kg": ("fore_mass", 0),
    "upper_stiffness_n_m": ("upper_stiffness", 0),
    "fore_stiffness_n_m": ("fore_stiffness", 0),
    "upper_viscosity_n_s_m": ("upper_viscosity", 0),
    "fore_viscosity_n_s_m": ("fore_viscosity", 0),
    "upper_friction": ("upper_friction", 0),
    "fore_friction": ("fore_friction", 0),
    "upper_pretension_n": ("upper_pretension", 0),
    "fore_pretension_n": ("fore_pretension", 0),
    **{f"shoulder_offset_{axis}_m": ("shoulder_offset", k) for k, axis in enumerate("xyz")},
    **{f"elbow_offset_{axis}_m": ("elbow_offset", k) for k, axis in enumerate("xyz")},
    "donning_rotation_rad": ("donning_rotation", 0),
    "flexors": ("flexors", 0),
    "extensors": ("extensors", 0),
    "height_m": ("height", 0),
    "mass_kg": ("mass", 0),
}
_ENDINGS = {
    "_kg": "kg", "_n_s_m": "N s/m", "_n_m": "N/m", "_n": "N", "_m": "m", "_rad": "rad",
}  # fmt: skip


class _Batch(Handle):
    kind = "ulna_batch"
    __slots__ = ()


def _code(name: str) -> int:
    word, more = FACTORS[name]
    return int(getattr(lib, f"ULNA_VARIED_{word.upper()}")) + more


def _unit(name: str) -> str:
    return next((unit for end, unit in _ENDINGS.items() if name.endswith(end)), "")


def published_factors() -> dict[str, Factor]:
    """The six factors of Tesfazgi (2023), Table 1: uniform, lengths as factors of the published arm.

    Lengths of 27.28 to 37.78 cm and 28.27 to 34.55 cm over the nominal 36.37 and 34.9 cm, masses
    without soft tissue, and elasticity as a true stiffness of an element.

    Examples
    --------
    >>> from ulna import exo
    >>> exo.published_factors()["fore_mass_kg"]
    Uniform(low=0.1, high=1.82)
    """
    from ._factors import Uniform

    return {
        "upper_factor": Uniform(0.2728 / 0.3637, 0.3778 / 0.3637),
        "fore_factor": Uniform(0.2827 / 0.349, 0.3455 / 0.349),
        "upper_mass_kg": Uniform(0.3, 3.41),
        "fore_mass_kg": Uniform(0.1, 1.82),
        "upper_stiffness_n_m": Uniform(100.5, 974.43),
        "fore_stiffness_n_m": Uniform(100.5, 974.43),
    }


def _nominal_words(nominal: Any) -> bool | str:
    """What a journal's plan says of the estimator's nominal model: each row's own, or which."""
    if nominal is None or isinstance(nominal, str):
        return nominal is not None
    return sha256(nominal.mjcf.encode()).hexdigest()


@dataclass(frozen=True, eq=False)
class AssessmentBatch:
    """Assessments of many arms, a row each.

    Attributes
    ----------
    status : tuple of str
        ok, failed_init, diverged, limit, timeout, nonfinite.
    wall_s : ndarray
        Time of computing, s.
    values : dict of str to ndarray
        Of each of `exo.AssessmentModel`'s outputs; NaN where the status is not ok.
    messages : dict of int to str
        Why rows did not end as ok.
    """

    status: tuple[str, ...]
    wall_s: Array
    values: Mapping[str, Array] = field(repr=False)
    messages: Mapping[int, str] = field(default_factory=dict, repr=False)

    def __getitem__(self, name: str) -> Array:
        return self.values[name]

    def __repr__(self) -> str:
        good = sum(status == "ok" for status in self.status)
        return f"<AssessmentBatch: {len(self.status)} rows, {good} ok>"


class AssessmentModel:
    """Assessment of an arm in an exoskeleton as a function of uncertain factors.

    A vectorised function for :class:`ulna.Study`: it takes factors by name as arrays and gives
    outputs, statuses and times, on the library's threads. Results are the same to the last bit for
    any number of threads and however rows are grouped. A native crash ends the process; runs that
    must be kept apart go through ``Study.run(workers=...)`` with a function of their own.

    Parameters
    ----------
    factors : sequence of str
        What is varied: upper_factor, fore_factor, upper_mass_kg, fore_mass_kg (or height_m,
        mass_kg), flexors, extensors; of soft interfaces also upper_ and fore_stiffness_n_m,
        _viscosity_n_s_m, _friction, _pretension_n; shoulder_offset_x_m (y, z), elbow_offset_x_m
        (y, z), donning_rotation_rad. As of :func:`exoskeleton`, `Soft` and `Protocol`.
    outputs : sequence of str
        start_s, slip_rad (between device and arm), K_est, D_est and their standard errors
        K_est_error, D_est_error; K_true, D_true (line through the true torque), K_true_alone (as
        published); K_error, D_error (estimate less truth); residual_nm, r_squared,
        model_residual_nm. Of the first joint that is assessed.
    scene : dict, optional
        Other settings of :func:`exoskeleton`, but for device and soft.
    device : path or mapping, optional
    soft : Soft, mapping or True
        Soft interfaces hold the arm; otherwise it stands in the device rigidly.
    reduced : bool or dict
        As bushings, each row reduced by itself; options of :meth:`Plant.reduced`.
    nominal : Plant, "own"
        Nominal model of the estimator. Default: the scene as it is without factors, held rigidly:
        the estimator does not know the patient. "own": each row's own arm.
    protocol : Protocol, optional
    identify : dict, optional
        For the estimator: options of :func:`identify_viscoelasticity`.
    threads : int
        0: one per processor.

    Attributes
    ----------
    factors, outputs : tuple of str
    rows_at_once : int
        That a study gives at once.

    Examples
    --------
    >>> from ulna import exo
    >>> model = exo.AssessmentModel(["fore_mass_kg"], outputs=["K_est", "K_true"])
    >>> done = model.run({"fore_mass_kg": [0.8, 0.962]})
    >>> done
    <AssessmentBatch: 2 rows, 2 ok>
    >>> bool(abs(done["K_est"][1] - done["K_true"][1]) < 1e-9)
    True
    """

    rows_at_once = 64  # of a study: what a kill can lose

    def __init__(
        self,
        factors: Sequence[str],
        *,
        outputs: Sequence[str] = ("K_est", "D_est", "K_true", "D_true"),
        scene: Mapping[str, Any] | None = None,
        device: Any = None,
        soft: Any = False,
        reduced: bool | Mapping[str, Any] = False,
        nominal: Plant | str | None = None,
        protocol: Protocol | None = None,
        identify: Mapping[str, Any] | None = None,
        threads: int = 0,
    ) -> None:
        from ._exo_assessment import estimator_options
        from ._exo_soft import Soft
        from .exo import _reduction_options, _scene_options, exoskeleton, read_device

        if isinstance(factors, str):
            raise refuse("factors must be a sequence of names, not one text", "factors")
        self.factors = tuple(factors)
        for name in self.factors:
            if name not in FACTORS:
                raise refuse(
                    f"{name!r} is no factor of an assessment; there are {', '.join(FACTORS)}",
                    "factors",
                )
        if isinstance(outputs, str):
            raise refuse("outputs must be a sequence of names, not one text", "outputs")
        self.outputs = tuple(outputs)
        for name in self.outputs:
            if name not in OUTPUTS and name not in _DIFFERENCES:
                raise refuse(
                    f"{name!r} is no output of an assessment; there are "
                    f"{', '.join((*OUTPUTS, *_DIFFERENCES))}",
                    "outputs",
                )
        self.threads = threads
        if isinstance(device, str | Path):
            device = read_device(device)
        self._made_of = {
            "outputs": self.outputs, "scene": scene, "device": device, "soft": soft,
            "reduced": reduced, "nominal": nominal, "protocol": protocol,
            "identify": identify, "threads": threads,
        }  # fmt: skip
        kept = dict(scene or {})
        struct = _scene_options(device, **kept)
        if nominal is None:
            nominal = exoskeleton(device, **{**kept, "coupling": "rigid"})
        elif isinstance(nominal, str) and nominal == "own":
            nominal = None
        elif isinstance(nominal, str):
            raise refuse(f"nominal is {nominal!r}; it must be a plant or 'own'", "nominal")
        soft_struct = Soft.of(soft)._struct() if soft is not False else None
        reduction = None
        if reduced is not False:
            reduction = _reduction_options(**(reduced if isinstance(reduced, Mapping) else {}))
        chosen = protocol_of(protocol)
        # Made once; what it points to must live until then.
        parts = (struct, soft_struct, reduction, chosen._struct(), estimator_options(**dict(identify or {})))
        given = options(
            "ulna_batch_options",
            scene=parts[0],
            soft=parts[1],
            reduction=parts[2],
            nominal=None if nominal is None else plant_pointer(nominal, "nominal"),
            protocol=parts[3],
            estimator=parts[4],
            varied=np.array([_code(name) for name in self.factors], dtype=np.int32),
            varied_count=len(self.factors),
        )
        out = ffi.new("ulna_batch **")
        check(lib.ulna_batch_new(given, out))
        self._handle = _Batch(out[0])
        # What makes a plan: a journal of other settings is refused by it.
        self._settings = repr(
            (self.factors, self.outputs, kept, device, soft, reduced, _nominal_words(self._made_of["nominal"]),
             chosen, dict(identify or {}))
        )  # fmt: skip

    def run(self, rows: Mapping[str, ArrayLike]) -> AssessmentBatch:
        """Assess arms: factors by name, an array each."""
        if set(rows) != set(self.factors):
            raise refuse(f"rows must give {', '.join(self.factors)}, and nothing else", "rows")
        columns = [np.asarray(rows[name], dtype=float) for name in self.factors]
        if any(c.ndim != 1 or c.shape != columns[0].shape for c in columns):
            raise refuse("rows must be arrays of one dimension and the same length", "rows")
        count = len(columns[0]) if columns else 1
        points = np.column_stack(columns) if columns else np.empty((1, 0))
        width = lib.ULNA_BATCH_COLUMNS
        values = np.empty((count, width))
        written = ffi.new("int64_t *")
        pointer = ffi.cast("double *", values.__array_interface__["data"][0])
        long_call(
            lib.ulna_batch_run, self._handle.pointer, view(points), self.threads, ffi.NULL, pointer,
            values.size, written,
        )  # fmt: skip
        status = tuple(STATUSES[int(code)] for code in values[:, 0])
        found = dict(zip(OUTPUTS, values[:, 2:].T, strict=True))
        for name, (estimate, truth) in _DIFFERENCES.items():
            found[name] = found[estimate] - found[truth]
        return AssessmentBatch(
            status=status,
            wall_s=values[:, 1].copy(),
            values={name: found[name].copy() for name in self.outputs},
            messages={
                i: text(lib.ulna_batch_text, self._handle.pointer, i)
                for i, word in enumerate(status)
                if word != "ok"
            },
        )

    def __call__(self, **rows: Any) -> RunTable:
        """What a vectorised study asks."""
        from ._study_call import RunTable

        done = self.run(rows)
        return RunTable(
            values=np.column_stack([done.values[name] for name in self.outputs]),
            status=done.status,
            wall_s=done.wall_s,
            messages=done.messages,
        )

    def __reduce__(self) -> Any:
        # A handle does not travel; what it was made of does, unless a plant is part of it.
        return _again, (self.factors, self._made_of)

    @property
    def plan_source(self) -> str:
        """What a journal's plan says of this function."""
        return f"ulna.exo.AssessmentModel{self._settings}"

    def study(self, factors: Mapping[str, Factor]) -> Study:
        """A study of these outputs over the factors' uncertainty.

        Examples
        --------
        >>> import ulna
        >>> from ulna import exo
        >>> factors = {"fore_mass_kg": ulna.Uniform(0.1, 1.82), "fore_factor": ulna.Uniform(0.8, 1)}
        >>> model = exo.AssessmentModel(factors, outputs=["K_error"])
        >>> model.study(factors).screen(r=4, seed=1).ranking
        ('fore_mass_kg', 'fore_factor')
        """
        from .study import Study

        if set(factors) != set(self.factors):
            raise refuse(f"the study's factors must be {', '.join(self.factors)}", "factors")
        units = {name: _unit(name) for name in self.factors}
        units |= {name: _OUTPUT_UNITS[name] for name in self.outputs}
        return Study(
            {name: factors[name] for name in self.factors},
            self,
            outputs=self.outputs,
            vectorized=True,
            units=units,
        )


def _again(factors: tuple[str, ...], made_of: dict[str, Any]) -> AssessmentModel:
    return AssessmentModel(factors, **made_of)


def assess_batch(rows: Mapping[str, ArrayLike], **settings: Any) -> AssessmentBatch:
    """Mobilise and assess many arms at once; settings are those of :class:`AssessmentModel`.

    Parameters
    ----------
    rows : dict of str to array_like
        Factors by name, a value for each arm.

    Examples
    --------
    >>> from ulna import exo
    >>> done = exo.assess_batch({"fore_factor": [0.95, 1.0, 1.05]}, outputs=["K_error"])
    >>> done["K_error"].round(2).tolist()
    [0.14, 0.0, -0.14]
    """
    return AssessmentModel(tuple(rows), **settings).run(rows)
