"""Passive mobilisation of an arm by an exoskeleton, and what it says of a joint; `ulna.exo` offers it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._call import (
    AnalysisError,
    DataError,
    Handle,
    check,
    constants,
    ffi,
    lib,
    long_call,
    options,
    result,
    text,
    view,
)
from ._exo_arguments import moved_joints, names_of, number, numbers, plant_pointer
from .record import Record, _Record, pick, refuse

if TYPE_CHECKING:
    from .exo import Plant

Array = NDArray[np.float64]

_TORQUES = dict(constants("ULNA_TORQUE_"))
_MOTIONS = dict(constants("ULNA_MOTION_"))
_EXCITATIONS = dict(constants("ULNA_EXCITATION_"))
_FRICTIONS = dict(constants("ULNA_FRICTION_"))
_ERRORS = {"newey-west": lib.ULNA_ERRORS_NEWEY_WEST, "bootstrap": lib.ULNA_ERRORS_BLOCK_BOOTSTRAP}
_STATUSES = ("ok", "failed_init", "diverged", "limit", "timeout", "nonfinite")


class _Mobilisation(Handle):
    kind = "ulna_mobilisation"
    __slots__ = ()


class _Viscoelastic(Handle):
    kind = "ulna_viscoelastic"
    __slots__ = ()


def _zero(value: float) -> float:
    """A number as the library takes it, to which 0 means its default and less than 0 none."""
    return -1.0 if value == 0 else value


def _positive(value: float | None, name: str) -> float | None:
    """A number whose 0 would mean the library's default."""
    if value is not None and not number(value, name) > 0:
        raise refuse(f"{name} is {value!r}; it must be positive", name)
    return value


@dataclass(frozen=True, kw_only=True)
class Protocol:
    """How an arm is mobilised: settle, contract, drive to the start, move, log.

    Attributes
    ----------
    moved : mapping of str to float, optional
        Joints of the device that move, each with the angle where it ends in rad. Default: the last
        one, to 0 (logistic) or 10 degrees.
    start_rad : array_like, optional
        Angle of every joint of the device. Default: the reference with the last joint at 110 degrees.
    shape : {"logistic", "minimum_jerk", "ramp", "sinusoid"}
        Of the movement. The logistic one is published: it starts with a step of 0.6 % and ends at
        90.8 % of the way, and has one speed and no way back.
    duration_s, speeds, repeats, rest_s
        Of one way at speed 1; speeds one after the other, each there and back; how often; rest at
        both ends of a way.
    torque : {"implicit", "every_step", "held"}
        The derivative gain as damping in the joints (stable with any arm); the torque recomputed at
        every time step; the torque held for `hold_s`, as published.
    kp, ki, kd : float
        N m/rad, N m/(rad s), N m s/rad.
    carry_weight : bool
        The motors carry the nominal model's weight.
    excitation : {"constant", "stretch_reflex", "velocity_dependent"}
    flexors, extensors, shoulder : float
        Excitation at rest.
    balanced : bool
        The extensors balance the flexors at the start.
    rate_gain_s, rate_threshold_1_s, length_gain, length_threshold, delay_s
        Of the reflexes: excitation for a stretch of one optimal length a second above the threshold,
        for a stretch of one optimal length above the threshold (stretch reflex only), after a delay
        (stretch reflex only).
    from_reference : bool
        The run begins in the plant's reference with the motors off and the arm falls, as published.
        Default: donned at the start.
    settle_s, approach_s, start_limit_s, start_angle_rad, start_rate_rad_s
        Before the movement: time to settle, of the way to the start (0: at once), limit to reach it,
        how near and how slow it must be.
    log_rate_hz : float
    rate_limit_rad_s, follow_limit_rad, limit_margin_rad, time_limit_s
        Where a run ends: a joint is faster; further from its reference; a moved joint is beyond its
        range; computing takes longer.
    reference_hold_s : float
        The movement's reference changes only so often; 0: always.
    published_flags : bool
        In place of these limits only a moved joint that turns faster than 2 rad/s towards positive
        angles ends a movement. An arm that leaves its strap goes unnoticed.

    Examples
    --------
    >>> from ulna import exo
    >>> exo.Protocol(shape="minimum_jerk", speeds=[0.5, 1, 2], moved={"J4": 0.5}).shape
    'minimum_jerk'
    """

    moved: Mapping[str, float] | None = None
    start_rad: ArrayLike | None = None
    shape: str = "logistic"
    duration_s: float = 6.0
    speeds: Sequence[float] = (1.0,)
    repeats: int = 1
    rest_s: float = 0.0
    torque: str = "implicit"
    kp: float = 50.0
    ki: float = 25.0
    kd: float = 15.0
    hold_s: float = 0.01
    carry_weight: bool = False
    excitation: str = "constant"
    flexors: float = 0.4
    extensors: float = 0.4
    shoulder: float = 0.0
    balanced: bool = False
    rate_gain_s: float = 0.5
    rate_threshold_1_s: float = 0.1
    length_gain: float = 0.0
    length_threshold: float = 1.0
    delay_s: float = 0.04
    from_reference: bool = False
    settle_s: float | None = None
    approach_s: float = 0.0
    start_limit_s: float = 25.0
    start_angle_rad: float = np.pi / 180
    start_rate_rad_s: float = 0.25 * np.pi / 180
    log_rate_hz: float = 100.0
    rate_limit_rad_s: float = 10.0
    follow_limit_rad: float = 20 * np.pi / 180
    limit_margin_rad: float = 0.0
    time_limit_s: float = 0.0
    reference_hold_s: float = 0.0
    published_flags: bool = False

    @classmethod
    def published(cls) -> Protocol:
        """The published settings: the arm falls, the torque is held for 10 ms."""
        return cls(from_reference=True, torque="held", reference_hold_s=0.01)

    def with_(self, **changes: Any) -> Protocol:
        """The protocol with other settings."""
        return replace(self, **changes)

    def _struct(self) -> Any:
        moved = None if self.moved is None else moved_joints(self.moved)
        positive = (
            "duration_s", "hold_s", "start_limit_s", "start_angle_rad", "start_rate_rad_s",
            "log_rate_hz", "rate_limit_rad_s", "follow_limit_rad", "length_threshold", "repeats",
        )  # fmt: skip
        or_none = (
            "kp", "ki", "kd", "flexors", "extensors", "rate_gain_s", "rate_threshold_1_s", "delay_s",
        )  # fmt: skip
        for name in or_none:
            if not number(getattr(self, name), name) >= 0:
                raise refuse(f"{name} is {getattr(self, name)!r}; it must be 0 or more", name)
        if self.settle_s is not None and not number(self.settle_s, "settle_s") >= 0:
            raise refuse(f"settle_s is {self.settle_s!r}; it must be 0 or more", "settle_s")
        plain = (
            "rest_s", "shoulder", "length_gain", "approach_s", "limit_margin_rad", "time_limit_s",
            "reference_hold_s",
        )  # fmt: skip
        return options(
            "ulna_protocol",
            moved=None if moved is None else list(moved),
            end_rad=None if moved is None else np.array(list(moved.values()), dtype=float),
            moved_count=None if moved is None else len(moved),
            start_rad=None if self.start_rad is None else numbers(self.start_rad, "start_rad"),
            speeds=np.atleast_1d(numbers(self.speeds, "speeds")),
            shape=pick(_MOTIONS, self.shape, "shape"),
            torque=pick(_TORQUES, self.torque, "torque"),
            excitation=pick(_EXCITATIONS, self.excitation, "excitation"),
            from_reference=self.from_reference,
            carry_weight=self.carry_weight,
            balanced=self.balanced,
            published_flags=self.published_flags,
            settle_s=None if self.settle_s is None else _zero(self.settle_s),
            **{name: _positive(getattr(self, name), name) for name in positive},
            **{name: _zero(getattr(self, name)) for name in or_none},
            **{name: number(getattr(self, name), name) for name in plain},
        )


def protocol_of(given: Protocol | None) -> Protocol:
    """A protocol as it is given: itself, or None for the defaults."""
    chosen = Protocol() if given is None else given
    if not isinstance(chosen, Protocol):
        raise refuse(f"protocol is a {type(chosen).__name__}, not a Protocol", "protocol")
    return chosen


@dataclass(frozen=True)
class Viscoelasticity:
    """Stiffness and damping of a passively moved joint.

    K = -d tau / d theta and D = -d tau / d theta' of the muscles' torque: what resists is positive,
    an anti-spring has K < 0. (Tesfazgi 2023 has the other sign.) What is not known is NaN.

    Attributes
    ----------
    joint : str
    k, d, offset : float
        N m/rad, N m s/rad, torque at angle 0 in N m.
    k_error, d_error : float
        Standard errors by the noise of the measurement: what would change if this movement of this
        arm were measured again. Noise as slow as the movement cannot be told from the arm.
    k_interval, d_interval : (float, float)
        Of them, at `level`. They hold neither what a wrong nominal model does nor what a soft
        interface does.
    k_misfit_error, d_misfit_error, k_misfit_interval, d_misfit_interval
        The same with all counted that a straight line leaves, noise or not: the muscles' curves,
        the interface, slow errors. K and D of a population of such movements.
    r_squared, residual_rms, noise_rms
        Share of the torque's variance on the line; what is off it, N m; of that, what is no
        function of angle and rate.
    true_k, true_d, true_k_alone : float
        Line through the muscles' true torque on the true human angle: by the same regressors; with
        the angle and an intercept only, as published. Simulated records only.
    model_residual_rms, model_residual_max : float
        Nominal less true torque of the muscles, N m.
    """

    joint: str
    k: float
    d: float
    offset: float
    k_error: float
    d_error: float
    k_interval: tuple[float, float]
    d_interval: tuple[float, float]
    k_misfit_error: float
    d_misfit_error: float
    k_misfit_interval: tuple[float, float]
    d_misfit_interval: tuple[float, float]
    level: float
    r_squared: float
    residual_rms: float
    noise_rms: float
    condition: float
    rows: int
    true_k: float
    true_d: float
    true_k_alone: float
    model_residual_rms: float
    model_residual_max: float
    warnings: tuple[str, ...] = ()

    def __repr__(self) -> str:
        parts = [f"K={self.k:.4g}±{self.k_error:.2g} N m/rad"]
        if np.isfinite(self.d):
            parts.append(f"D={self.d:.4g}±{self.d_error:.2g} N m s/rad")
        return f"<Viscoelasticity {self.joint} {' '.join(parts)}>"

    def summary(self) -> str:
        """The numbers in a few lines."""
        share = f"{100 * self.level:.3g} %"
        lines = [
            f"{self.joint}: K {self.k:9.3f} N m/rad    {share} "
            f"{_span(self.k_interval)}, with misfit {_span(self.k_misfit_interval)}"
        ]
        if np.isfinite(self.d):
            lines.append(
                f"    D {self.d:9.3f} N m s/rad  {share} "
                f"{_span(self.d_interval)}, with misfit {_span(self.d_misfit_interval)}"
            )
        if np.isfinite(self.true_k):
            lines.append(
                f"    true K {self.true_k:.3f}, D {self.true_d:.3f}; nominal torque off by "
                f"{self.model_residual_rms:.2g} N m rms"
            )
        lines.append(
            f"    a line explains {100 * self.r_squared:.1f} % of the torque, "
            f"{self.residual_rms:.3g} N m rms are left"
        )
        return "\n".join([*lines, *self.warnings])


def _span(ends: tuple[float, float]) -> str:
    return f"{ends[0]:.3f} to {ends[1]:.3f}"


@dataclass(frozen=True, eq=False)
class Assessment:
    """A simulated assessment: how it ended, its log and what it says of the joints.

    Attributes
    ----------
    status : str
        ok, failed_init, diverged, limit, timeout, nonfinite. The last one is also a movement that
        says nothing of a joint: an arm that has left its strap does not move.
    reason : str
        One sentence; empty for ok.
    record : Record or None
        The log of the movement, as far as it came.
    joints : tuple of Viscoelasticity
        Empty unless the status is ok: nothing is filled in.
    notes : tuple of str
        What to know of the run.
    simulated_s, start_s : float
        In all; when the start was reached.
    largest_slip_rad : float
        Between a moved joint and the arm's.
    """

    status: str
    reason: str
    record: Record | None
    joints: tuple[Viscoelasticity, ...]
    notes: tuple[str, ...]
    simulated_s: float
    start_s: float
    largest_slip_rad: float
    protocol: Protocol = field(repr=False)

    def __repr__(self) -> str:
        if self.status != "ok":
            return f"<Assessment {self.status}: {self.reason}>"
        return f"<Assessment ok {' '.join(map(repr, self.joints))}>"

    def summary(self) -> str:
        """Status and joints in a few lines."""
        head = self.status if not self.reason else f"{self.status}: {self.reason}"
        return "\n".join([head, *(joint.summary() for joint in self.joints), *self.notes])

    def plot(self, axes: Any = None, *, joint: str | None = None) -> Any:
        """Angle, torques and the line of the stiffness: :func:`ulna.plot.assessment`."""
        from .plot import assessment

        return assessment(self, axes, joint=joint)


def mobilise(
    plant: Plant,
    protocol: Protocol | None = None,
    *,
    nominal: Plant | None = None,
    published_estimator: bool = False,
) -> Assessment:
    """Mobilise the arm of a plant passively, and assess the joints that moved.

    Parameters
    ----------
    plant : Plant
        Its device must hold the arm.
    protocol : Protocol, optional
    nominal : Plant, optional
        Whose description is the nominal model. Default: the plant's own. One that was changed or
        read has none; in a scene that was read, joints, motors and muscles have its names.
    published_estimator : bool
        See :func:`identify_viscoelasticity`.

    Returns
    -------
    Assessment
        A run that goes wrong has a status and a reason; only descriptions that cannot be raise.

    Examples
    --------
    >>> from ulna import exo
    >>> done = exo.mobilise(exo.exoskeleton())
    >>> done
    <Assessment ok <Viscoelasticity J4 K=-0.9176±0.0006 N m/rad D=3.36±0.0013 N m s/rad>>
    >>> bool(abs(done.joints[0].k - done.joints[0].true_k) < 1e-9)
    True
    """
    chosen = protocol_of(protocol)
    own = plant_pointer(plant)
    other = ffi.NULL if nominal is None else plant_pointer(nominal, "nominal")
    out = ffi.new("ulna_mobilisation **")
    long_call(lib.ulna_mobilisation_new, own, other, chosen._struct(), ffi.NULL, out)
    handle = _Mobilisation(out[0])
    raw = result("ulna_mobilisation_result")
    check(lib.ulna_mobilisation_get_result(handle.pointer, raw))
    record = None
    if raw.rows > 0:
        record = Record(_Record.make(lib.ulna_mobilisation_record, handle.pointer))
    status = _STATUSES[raw.status]
    reason = text(lib.ulna_mobilisation_text, handle.pointer, lib.ULNA_MOBILISATION_REASON)
    joints: tuple[Viscoelasticity, ...] = ()
    if status == "ok" and record is not None:
        try:
            joints = identify_viscoelasticity(
                record, plant, nominal=nominal, published=published_estimator
            )
        except (AnalysisError, DataError) as failure:  # of the movement: its log is kept
            status, reason = "nonfinite", str(failure)
    return Assessment(
        status=status,
        reason=reason,
        record=record,
        joints=joints,
        notes=tuple(
            text(
                lib.ulna_mobilisation_text, handle.pointer, lib.ULNA_MOBILISATION_NOTES
            ).splitlines()
        ),
        simulated_s=raw.simulated_s,
        start_s=raw.start_s,
        largest_slip_rad=raw.largest_slip_rad,
        protocol=chosen,
    )


def estimator_options(
    *,
    joints: Sequence[str] | None = None,
    published: bool = False,
    friction: str | None = None,
    damping_torque: bool | None = None,
    inertia: bool | None = None,
    human_angle: bool | None = None,
    intercept: bool = True,
    rate: bool | None = None,
    errors: str = "newey-west",
    lag_s: float = 0.4,
    block_s: float = 0.4,
    bootstrap: int = 1000,
    level: float = 0.95,
    seed: int = 0,
) -> Any:
    """An estimator as the library takes it; see :func:`identify_viscoelasticity`."""

    def switch(value: bool | None, otherwise: bool) -> bool:
        return otherwise if value is None else value

    names = None if joints is None else names_of(joints, "joints")
    return options(
        "ulna_viscoelastic_options",
        joints=names,
        joint_count=None if names is None else len(names),
        friction=pick(_FRICTIONS, friction or ("none" if published else "engine"), "friction"),
        no_damping_torque=not switch(damping_torque, not published),
        no_inertia=not switch(inertia, not published),
        human_angle=switch(human_angle, published),
        no_intercept=not intercept,
        no_rate=not switch(rate, not published),
        errors=pick(_ERRORS, errors, "errors"),
        hac_lag_s=_positive(lag_s, "lag_s"),
        block_s=_positive(block_s, "block_s"),
        bootstrap=_positive(bootstrap, "bootstrap"),
        level=_positive(level, "level"),
        seed=seed,
    )


def identify_viscoelasticity(
    record: Record,
    plant: Plant,
    *,
    nominal: Plant | None = None,
    joints: Sequence[str] | None = None,
    published: bool = False,
    friction: str | None = None,
    damping_torque: bool | None = None,
    inertia: bool | None = None,
    human_angle: bool | None = None,
    intercept: bool = True,
    rate: bool | None = None,
    errors: str = "newey-west",
    lag_s: float = 0.4,
    block_s: float = 0.4,
    bootstrap: int = 1000,
    level: float = 0.95,
    seed: int = 0,
) -> tuple[Viscoelasticity, ...]:
    """Stiffness and damping of moved joints: (9), (20) and (21) of Tesfazgi (2023).

    Parameters
    ----------
    record : Record
        With ``theta_<joint>`` and ``tau_motor_<joint>`` for every joint of the device, simulated or
        recorded. Rates and accelerations that it does not hold are derivatives of the angles.
    plant : Plant
        Whose device it is.
    nominal : Plant, optional
        Whose description is the nominal model. Default: the plant's own.
    joints : sequence of str, optional
        Default: those whose ``theta_`` has the role position.
    published : bool
        The estimator of the published simulation: true human angle with intercept, no rate, no
        inertia, damping or friction in the nominal torque. The switches below change it.
    friction : {"engine", "coulomb", "none"}, optional
        In the nominal model: as the simulated device has it; its limit times the sign of the rate.
    damping_torque, inertia : bool, optional
        In the nominal model.
    human_angle, intercept, rate : bool, optional
        Regressors: the true human angle instead of the device's; a torque at angle 0; the rate.
    errors : {"newey-west", "bootstrap"}
        With the misfit counted; those of the noise alone are by its spectrum.
    lag_s, block_s, bootstrap, seed
        Of `errors`.
    level : float
        Of all intervals.

    Examples
    --------
    >>> from ulna import exo
    >>> plant = exo.exoskeleton()
    >>> log = exo.mobilise(plant).record
    >>> exo.identify_viscoelasticity(log, plant, published=True)
    (<Viscoelasticity J4 K=-1.715±0.0019 N m/rad>,)
    """

    if not isinstance(record, Record):
        raise refuse(f"record is a {type(record).__name__}, not a Record", "record")
    struct = estimator_options(
        joints=joints,
        published=published,
        friction=friction,
        damping_torque=damping_torque,
        inertia=inertia,
        human_angle=human_angle,
        intercept=intercept,
        rate=rate,
        errors=errors,
        lag_s=lag_s,
        block_s=block_s,
        bootstrap=bootstrap,
        level=level,
        seed=seed,
    )
    own = plant_pointer(plant)
    other = ffi.NULL if nominal is None else plant_pointer(nominal, "nominal")
    out = ffi.new("ulna_viscoelastic **")
    long_call(
        lib.ulna_viscoelastic_new,
        record._handle.pointer,
        own,
        other,
        struct,
        ffi.NULL,
        out,
    )
    handle = _Viscoelastic(out[0])
    count = ffi.new("int64_t *")
    check(lib.ulna_viscoelastic_count(handle.pointer, count))
    return tuple(_joint(handle, i) for i in range(count[0]))


def _joint(handle: Handle, index: int) -> Viscoelasticity:
    raw = result("ulna_viscoelastic_joint")
    check(lib.ulna_viscoelastic_get_joint(handle.pointer, index, raw))
    name, *words = text(lib.ulna_viscoelastic_text, handle.pointer, index).splitlines()
    plain = (
        "k", "d", "offset", "k_error", "d_error", "k_misfit_error", "d_misfit_error", "level",
        "r_squared", "residual_rms", "noise_rms", "condition", "rows", "true_k", "true_d", "true_k_alone", "model_residual_rms",
        "model_residual_max",
    )  # fmt: skip
    return Viscoelasticity(
        joint=name,
        k_interval=tuple(raw.k_interval),
        d_interval=tuple(raw.d_interval),
        k_misfit_interval=tuple(raw.k_misfit_interval),
        d_misfit_interval=tuple(raw.d_misfit_interval),
        warnings=tuple(words),
        **{name: getattr(raw, name) for name in plain},
    )


def with_errors(
    record: Record,
    plant: Plant,
    *,
    nominal: Plant | None = None,
    angle_rad: float = 0.0,
    rate_rad_s: float = 0.0,
    acceleration_rad_s2: float = 0.0,
    torque_nm: float = 0.0,
    slow_torque_nm: float = 0.0,
    slow_hz: float = 0.5,
    seed: int = 0,
    run: int = 0,
) -> Record:
    """A record of a mobilisation with errors of the device's sensors, rms.

    White but for `slow_torque_nm`, which lies below `slow_hz`. Truths stay as they are.

    Examples
    --------
    >>> from ulna import exo
    >>> plant = exo.exoskeleton()
    >>> log = exo.mobilise(plant).record
    >>> noisy = exo.with_errors(log, plant, torque_nm=0.1, seed=1)
    >>> round(float((noisy["tau_motor_J4"] - log["tau_motor_J4"]).std()), 2)
    0.1
    """
    struct = options(
        "ulna_joint_errors",
        angle_rad=angle_rad,
        rate_rad_s=rate_rad_s,
        acceleration_rad_s2=acceleration_rad_s2,
        torque_nm=torque_nm,
        slow_torque_nm=slow_torque_nm,
        slow_hz=_positive(slow_hz, "slow_hz"),
        seed=seed,
        run=run,
    )
    own = plant_pointer(plant)
    other = ffi.NULL if nominal is None else plant_pointer(nominal, "nominal")
    return Record(
        _Record.make(
            lib.ulna_record_with_joint_errors,
            record._handle.pointer,
            own,
            other,
            struct,
        )
    )


def muscle_impedance(
    plant: Plant, angle_rad: ArrayLike, rate_rad_s: ArrayLike, activation: ArrayLike
) -> tuple[Array, Array]:
    """Impedance of the muscles alone at states of the human joints, at constant activation.

    Parameters
    ----------
    plant : Plant
    angle_rad, rate_rad_s : array_like, shape (rows, joints)
    activation : array_like, shape (rows, muscles)

    Returns
    -------
    K, D : ndarray, shape (rows, joints, joints)
        -d tau / d q in N m/rad and -d tau / d q' in N m s/rad.

    Examples
    --------
    >>> from ulna import exo
    >>> plant = exo.exoskeleton()
    >>> K, D = exo.muscle_impedance(plant, [[0, -1.5, 0, 1.5]], [[0, 0, 0, 0.0]], [[0.4] * 8])
    >>> K.shape, bool(D[0, 3, 3] > 0)
    ((1, 4, 4), True)
    """
    rows = [np.atleast_2d(np.asarray(a, dtype=float)) for a in (angle_rad, rate_rad_s, activation)]
    count, joints = rows[0].shape
    values = np.empty((count, 2, joints, joints))
    written = ffi.new("int64_t *")
    pointer = ffi.cast("double *", values.ctypes.data)
    long_call(
        lib.ulna_plant_muscle_impedance,
        plant_pointer(plant),
        *(view(r) for r in rows),
        ffi.NULL,
        pointer,
        values.size,
        written,
    )
    return values[:, 0].copy(), values[:, 1].copy()
