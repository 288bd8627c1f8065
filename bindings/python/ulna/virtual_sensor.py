"""The force on a robot's handle without a force sensor. Dyck (2013), chapter 5.

``F = J^-T (I q'' + C q' + F_r - tau)``, from joint angles, motor torques and, where there is one, an
accelerometer at the handle; with the robot's parameters identified from a recording, and the errors
of all of them carried on to M, B and K.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ._call import Handle, check, ffi, lib, long_call, options, out_array, result, text, view
from ._sensed import ForceBudget, SensedForce, _Sensed, filters, lines, sensed, words
from .plant import PlanarRobot
from .record import Record, refuse

if TYPE_CHECKING:
    from .impedance import ImpedanceEstimate

__all__ = [
    "ForceBudget",
    "MethodComparison",
    "RobotEstimate",
    "SensedForce",
    "compare",
    "feasible",
    "identify_robot",
    "sense",
]

_ESTIMATORS = {
    "auto": lib.ULNA_ESTIMATOR_AUTO,
    "least_squares": lib.ULNA_ESTIMATOR_LEAST_SQUARES,
    "instrumental_variables": lib.ULNA_ESTIMATOR_INSTRUMENTAL,
    "ls": lib.ULNA_ESTIMATOR_LEAST_SQUARES,
    "iv": lib.ULNA_ESTIMATOR_INSTRUMENTAL,
}


class _RobotFit(Handle):
    kind = "ulna_robot_fit"
    __slots__ = ()


# The robot's parameters --------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class RobotEstimate:
    """Dynamic parameters of a robot from a recording, with their errors.

    Attributes
    ----------
    names : tuple of str
        "alpha_1" to "alpha_5", then "dry_1" and "dry_2" with dry friction.
    value : ndarray, shape (p,)
        kg m^2, N m s/rad, N m.
    cov : ndarray, shape (p, p)
        Newey-West covariance.
    estimator : str
        "instrumental_variables" or "least_squares".
    other, other_cov : ndarray or None
        The other estimator on the same data; None without a reference.
    difference_p : float
        p value of the test that both agree; NaN without a reference.
    condition : float
        Of the regressor in unit columns: how well the motion tells the parameters apart.
    excitation_nm : ndarray, shape (p,)
        Root mean square of the torque that each parameter causes.
    vaf, vaf_train : ndarray, shape (2,)
        Variance of each joint's torque accounted for, percent, on data not used and used.
    residual_nm : ndarray, shape (2,)
        Root mean square of what is left.
    feasible : bool
        A body can have these parameters: inertia positive definite and friction not negative at
        every pose; with `feasible_probability`, `least_inertia_kg_m2`, `least_friction`.
    warnings : tuple of str
        Empty when good.
    robot : PlanarRobot
        The robot with these parameters, for `sense`; None when they are not feasible.
    """

    names: tuple[str, ...]
    value: np.ndarray
    cov: np.ndarray
    estimator: str
    other: np.ndarray | None
    other_cov: np.ndarray | None
    difference_p: float
    condition: float
    excitation_nm: np.ndarray
    vaf: np.ndarray
    vaf_train: np.ndarray
    residual_nm: np.ndarray
    feasible: bool
    feasible_probability: float
    least_inertia_kg_m2: float
    least_friction: float
    lowpass_hz: float
    wide_hz: float
    train_s: float
    train_rows: int
    held_out_rows: int
    warnings: tuple[str, ...]
    provenance: tuple[str, ...]
    robot: PlanarRobot | None
    _handle: _RobotFit = field(repr=False)

    @property
    def se(self) -> np.ndarray:
        """Standard errors, shape (p,)."""
        return np.sqrt(np.diag(self.cov))

    @property
    def outcome(self) -> str:
        """ "good", or "not_feasible" or "look" when there are warnings."""
        if not self.feasible:
            return "not_feasible"
        return "look" if self.warnings else "good"

    def summary(self) -> str:
        """Parameters with errors, validation and checks, as text."""
        beside = self.other is not None
        head = "least squares" if self.estimator == "instrumental_variables" else "instrumental"
        out = [
            f"robot parameters by {self.estimator.replace('_', ' ')}, low pass "
            f"{self.lowpass_hz:.3g} Hz, first {self.train_s:.3g} s",
            f"{'':<10}{'value':>12}{'± se':>12}{'torque, N m':>14}"
            + (f"{head:>16}" if beside else ""),
        ]
        for i, name in enumerate(self.names):
            line = (
                f"{name:<10}{self.value[i]:>12.5g}{self.se[i]:>12.2g}{self.excitation_nm[i]:>14.3g}"
            )
            out.append(line + (f"{self.other[i]:>16.5g}" if self.other is not None else ""))
        vaf = ", ".join(f"{v:.1f} %" for v in self.vaf)
        out += [
            f"accounts for {vaf} of the torques on held-out data; condition {self.condition:.3g}",
            f"least inertia {self.least_inertia_kg_m2:.3g} kg m^2, least friction "
            f"{self.least_friction:.3g}; feasible with {100 * self.feasible_probability:.0f} %",
        ]
        if np.isfinite(self.difference_p):
            out.append(f"both estimators agree with p = {self.difference_p:.2g}")
        return "\n".join([*out, *(f"! {words_}" for words_ in self.warnings)])

    def __repr__(self) -> str:
        entries = " ".join(
            f"{name}={value:.4g}±{error:.1g}"
            for name, value, error in zip(self.names, self.value, self.se, strict=True)
        )
        return f"<RobotEstimate {entries}, {self.estimator}, {self.outcome}>"


def identify_robot(
    record: Record,
    *,
    robot: PlanarRobot | None = None,
    angle: str | Sequence[str] | None = None,
    torque: str | Sequence[str] | None = None,
    reference: str | Sequence[str] | None = None,
    force: str | Sequence[str] | None = None,
    dry_friction: bool = False,
    dry_threshold_rad_s: float = 0.02,
    estimator: str = "auto",
    train_s: float | None = None,
    lag_s: float = 0.4,
    condition_limit: float = 1000.0,
    lowpass_hz: float | None = None,
    progress: bool = False,
) -> RobotEstimate:
    """Dynamic parameters of a robot that moves freely, (A.5) of Dyck (2013).

    By instrumental variables from the commanded angles where they are named, least squares beside;
    by least squares without. The regressor is formed from angles that are hardly filtered, and then
    it and the torques pass the same low pass.

    Parameters
    ----------
    record : Record
        Joint angles (rad), motor torques (N m) and, if there are, commanded angles.
    robot : PlanarRobot, optional
        Its lengths are used, not its parameters.
    angle, torque, reference, force : str or names, optional
        Words for two channels each; default: theta, else q, and tau; neither reference nor force.
        A force on the handle is taken into account where it is named.
    dry_friction : bool
        Fit a dry friction of each joint besides, which turns its sign within `dry_threshold_rad_s`.
    estimator : {"auto", "instrumental_variables", "least_squares"}
    train_s : float, optional
        Identify from so much of every trial; default 40 s, at most 80 %.
    lag_s : float
        Of the Newey-West errors.

    Raises
    ------
    AnalysisError
        When the motion does not tell the parameters apart; the message names them.
    """
    body = robot if robot is not None else PlanarRobot()
    if not isinstance(body, PlanarRobot):
        raise refuse("robot must be an ulna.plant.PlanarRobot", "robot")
    if estimator not in _ESTIMATORS:
        raise refuse(
            f"estimator is {estimator!r}; it must be one of {', '.join(_ESTIMATORS)}", "estimator"
        )
    struct = options(
        "ulna_robot_fit_options",
        angle=words(angle),
        torque=words(torque),
        reference=words(reference),
        force=words(force),
        prepare=filters(lowpass_hz=lowpass_hz),
        dry_friction=dry_friction,
        estimator=_ESTIMATORS[estimator],
        dry_threshold_rad_s=float(dry_threshold_rad_s),
        train_s=train_s,
        lag_s=float(lag_s),
        condition_limit=float(condition_limit),
    )
    out = ffi.new("ulna_robot_fit **")
    long_call(
        lib.ulna_robot_fit_new,
        record._handle.pointer,
        body._pointer,
        struct,
        ffi.NULL,
        out,
        progress=progress,
        label="robot",
    )
    handle = _RobotFit(out[0])
    info = result("ulna_robot_fit_info")
    check(lib.ulna_robot_fit_get_info(handle.pointer, info))
    p = info.parameters

    def get(quantity: int) -> np.ndarray:
        return out_array(lib.ulna_robot_fit_get_values, handle.pointer, quantity)

    def say(which: int) -> tuple[str, ...]:
        return lines(text(lib.ulna_robot_fit_get_text, handle.pointer, which))

    value = get(lib.ULNA_ROBOT_FIT_VALUE)
    other = get(lib.ULNA_ROBOT_FIT_OTHER)
    found = None
    if info.feasible:
        found = _robot_with(body, value, dry_threshold_rad_s if dry_friction else None)
    return RobotEstimate(
        names=say(lib.ULNA_ROBOT_FIT_TEXT_NAMES),
        value=value,
        cov=get(lib.ULNA_ROBOT_FIT_COVARIANCE).reshape(p, p),
        estimator=(
            "instrumental_variables"
            if info.estimator == lib.ULNA_ESTIMATOR_INSTRUMENTAL
            else "least_squares"
        ),
        other=other if len(other) else None,
        other_cov=(get(lib.ULNA_ROBOT_FIT_OTHER_COVARIANCE).reshape(p, p) if len(other) else None),
        difference_p=info.difference_p,
        condition=info.condition,
        excitation_nm=get(lib.ULNA_ROBOT_FIT_EXCITATION),
        vaf=get(lib.ULNA_ROBOT_FIT_VAF),
        vaf_train=get(lib.ULNA_ROBOT_FIT_VAF_TRAIN),
        residual_nm=get(lib.ULNA_ROBOT_FIT_RESIDUAL),
        feasible=bool(info.feasible),
        feasible_probability=info.feasible_probability,
        least_inertia_kg_m2=info.least_inertia_kg_m2,
        least_friction=info.least_friction,
        lowpass_hz=info.lowpass_hz,
        wide_hz=info.wide_hz,
        train_s=info.train_s,
        train_rows=info.train_rows,
        held_out_rows=info.held_out_rows,
        warnings=say(lib.ULNA_ROBOT_FIT_TEXT_WARNINGS),
        provenance=say(lib.ULNA_ROBOT_FIT_TEXT_PROVENANCE),
        robot=found,
        _handle=handle,
    )


def _robot_with(body: PlanarRobot, value: np.ndarray, threshold: float | None) -> PlanarRobot:
    from .plant import Friction

    count = len(body.parameters)
    dry = None
    if threshold is not None:
        dry = tuple(
            Friction(sliding=float(v), breakaway=float(v), threshold=threshold)
            for v in value[count:]
        )
    return PlanarRobot(link_m=body.link_m, alpha=tuple(value[:count].tolist()), dry_friction=dry)


def feasible(parameters: ArrayLike, *, robot: PlanarRobot | None = None) -> tuple[float, float]:
    """Smallest eigenvalue of the inertia (kg m^2) and smallest friction coefficient over all poses.

    A body can have the parameters when the first is above zero and the second not below.

    Examples
    --------
    >>> from ulna.virtual_sensor import feasible
    >>> inertia, friction = feasible([0.06929, 0.04217, 0.04416, 0.06510, 0.07389])
    >>> round(inertia, 4), round(friction, 4)
    (0.0322, 0.0651)
    """
    body = robot if robot is not None else PlanarRobot()
    inertia, friction = ffi.new("double *"), ffi.new("double *")
    values = view(np.asarray(parameters, dtype=float).reshape(-1))
    check(lib.ulna_robot_feasible(body._pointer, values, inertia, friction))
    return inertia[0], friction[0]


# The force ---------------------------------------------------------------------------------------


def sense(
    record: Record,
    *,
    robot: PlanarRobot | RobotEstimate | None = None,
    angle: str | Sequence[str] | None = None,
    torque: str | Sequence[str] | None = None,
    acceleration: str | Sequence[str] | None = None,
    reference: str | Sequence[str] | None = None,
    parameter_cov: ArrayLike | None = None,
    torque_scale_error: float = 0.0,
    acceleration_scale_error: float = 0.0,
    torque_noise_nm: float = 0.0,
    angle_noise_rad: float = 0.0,
    angle_step_rad: float = 0.0,
    acceleration_noise_m_s2: float = 0.0,
    least_quality: float = 0.05,
    lowpass_hz: float | None = None,
    lowpass_order: int | None = None,
    window: int | None = None,
    order: int | None = None,
    plain_savgol: bool = False,
    progress: bool = False,
) -> SensedForce:
    """The force on the handle from the robot's motion and motor torques.

    All signals pass the same smoother, by default wide open over the band of the motion so that an
    identification afterwards filters for good (``lowpass_hz=4.5, window=151`` are the thesis'). Rows at the
    ends of every trial where the smoother starts and stops are left out: 0.2 s at 20 Hz.

    Parameters
    ----------
    record : Record
        Joint angles (rad), motor torques (N m), and what the next words name.
    robot : PlanarRobot or RobotEstimate, optional
        The robot of the thesis by default. An estimate brings the covariance of its parameters.
    angle, torque : str or names, optional
        Words for two channels each; default: theta, else q, and tau.
    acceleration : str or names, optional
        Accelerometer at the handle in the robot's frame, m/s^2, (5.3); without it the angles are
        differentiated twice.
    reference : str or names, optional
        Commanded angles (rad) or positions (m), for instrumental variables afterwards.
    parameter_cov : array_like, optional
        Covariance of the robot's parameters alpha.
    torque_scale_error, acceleration_scale_error : float
        Relative standard deviations of the scales, each joint or axis on its own.
    torque_noise_nm, angle_noise_rad, acceleration_noise_m_s2 : float
        Standard deviation of a sample.
    angle_step_rad : float
        Resolution of the encoders.
    least_quality : float
        Smallest over largest singular value of the Jacobian; a pose below it is refused.

    Raises
    ------
    DataError
        Near a singular pose, with row, time and pose; for wrong units, NaN and a jittering clock.

    Examples
    --------
    A robot at rest whose motors hold against 2 N along x:

    >>> import numpy as np
    >>> import ulna
    >>> from ulna.virtual_sensor import sense
    >>> robot, rng = ulna.plant.PlanarRobot(), np.random.default_rng(0)
    >>> q = np.radians([45.0, 50.0]) + 1e-6 * rng.normal(size=(2000, 2))
    >>> tau = -np.array([2.0, 0.0]) @ robot.jacobian(q[0]) + 1e-4 * rng.normal(size=(2000, 2))
    >>> log = ulna.Record.from_arrays(
    ...     np.arange(2000) / 1000,
    ...     {"q_1": q[:, 0], "q_2": q[:, 1], "tau_1": tau[:, 0], "tau_2": tau[:, 1]},
    ...     units={"q_1": "rad", "q_2": "rad", "tau_1": "Nm", "tau_2": "Nm"},
    ... )
    >>> force = sense(log, torque_noise_nm=1e-4, angle_noise_rad=1e-6)
    >>> bool(np.allclose(force.force.mean(axis=0), [2, 0], atol=1e-3))
    True
    """
    if isinstance(robot, RobotEstimate):
        if robot.robot is None:
            raise refuse("the robot's parameters are not feasible: " + robot.warnings[0], "robot")
        if parameter_cov is None:
            count = len(robot.robot.parameters)
            parameter_cov = robot.cov[:count, :count]
        robot = robot.robot
    body = robot if robot is not None else PlanarRobot()
    if not isinstance(body, PlanarRobot):
        raise refuse("robot must be an ulna.plant.PlanarRobot or a RobotEstimate", "robot")
    struct = options(
        "ulna_virtual_options",
        angle=words(angle),
        torque=words(torque),
        acceleration=words(acceleration),
        reference=words(reference),
        prepare=filters(
            lowpass_hz=lowpass_hz,
            lowpass_order=lowpass_order,
            window=window,
            order=order,
            plain_savgol=plain_savgol,
        ),
        parameter_covariance=parameter_cov,
        least_quality=float(least_quality),
        torque_scale_error=float(torque_scale_error),
        acceleration_scale_error=float(acceleration_scale_error),
        torque_noise_nm=float(torque_noise_nm),
        angle_noise_rad=float(angle_noise_rad),
        angle_step_rad=float(angle_step_rad),
        acceleration_noise_m_s2=float(acceleration_noise_m_s2),
    )
    out = ffi.new("ulna_sensed **")
    long_call(
        lib.ulna_virtual_sense,
        record._handle.pointer,
        body._pointer,
        struct,
        ffi.NULL,
        out,
        progress=progress,
        label="force",
    )
    return sensed(_Sensed(out[0]))


# Table 5.2 ---------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class MethodComparison:
    """Ways to the force and the impedance from one recording, after Table 5.2 of Dyck (2013).

    Attributes
    ----------
    forces : dict of str to SensedForce
        "accelerometer" (q'' from (5.3)) and "differentiation" (q'' from the angles).
    estimates : dict of str to ImpedanceEstimate
        Of both, and "force sensor" where the record holds a measured force.
    budgets : dict of str to ForceBudget
        Where something is known of the constants' errors.
    vaf : dict of str to ndarray, shape (2,)
        Percent of the measured force that the virtual one accounts for; empty without a sensor.
    rms_n : dict of str to ndarray, shape (2,)
        Root mean square of virtual less measured force; without a sensor, of the two methods'
        difference, under "difference".
    """

    forces: dict[str, SensedForce]
    estimates: dict[str, ImpedanceEstimate]
    budgets: dict[str, ForceBudget]
    vaf: dict[str, np.ndarray]
    rms_n: dict[str, np.ndarray]

    def summary(self) -> str:
        """Forces and parameters side by side, as text."""
        from ._words import _entry

        out = [f"{'force':<16}{'VAF x':>10}{'VAF y':>10}{'rms x, N':>12}{'rms y, N':>12}"]
        for name, rms in self.rms_n.items():
            vaf = self.vaf.get(name, np.full(2, np.nan))
            cells = "".join(f"{v:>9.2f}%" if np.isfinite(v) else f"{'-':>10}" for v in vaf)
            out.append(f"{name:<16}{cells}" + "".join(f"{v:>12.3g}" for v in rms))
        out += ["", f"{'':<8}" + "".join(f"{name:>22}" for name in self.estimates)]
        first = next(iter(self.estimates.values()))
        for name in ("M", "B", "K"):
            for k in range(4):
                i, j = divmod(k, 2)
                cells = []
                for method, estimate in self.estimates.items():
                    budget = self.budgets.get(method)
                    se = (budget.total_se(name) if budget else estimate.se(name))[i, j]
                    cells.append(_entry(getattr(estimate, name)[i, j], se))
                label = f"{name}_{first.axes[i]}{first.axes[j]}"
                out.append(
                    f"{label:<8}" + "".join(f"{c:>22}" for c in cells) + f" {first.units[name]}"
                )
        return "\n".join(out)

    def plot(self, **keywords: Any) -> Any:
        """Draw the forces with their bands; see `ulna.plot.virtual_force`."""
        from . import plot

        return plot.virtual_force(self, **keywords)

    def __repr__(self) -> str:
        return f"<MethodComparison: {', '.join(self.estimates)}>"


def compare(
    record: Record,
    *,
    acceleration: str | Sequence[str],
    robot: PlanarRobot | RobotEstimate | None = None,
    angle: str | Sequence[str] | None = None,
    torque: str | Sequence[str] | None = None,
    reference: str | Sequence[str] | None = None,
    identify: dict[str, Any] | None = None,
    **errors: Any,
) -> MethodComparison:
    """Accelerometer and differentiation side by side, beside the force sensor where there is one.

    Parameters
    ----------
    record : Record
        As for `sense`; forces of the role force are those of a sensor.
    acceleration : str or names
        The accelerometer's channels.
    identify : dict, optional
        Options of `ulna.identify_impedance` for all of them.
    **errors
        What is known of the errors, and filters, as for `sense`.
    """
    import warnings

    from .impedance import UncertainResult, identify_impedance

    common: dict[str, Any] = {
        "robot": robot, "angle": angle, "torque": torque, "reference": reference, **errors,
    }  # fmt: skip
    plain = {k: v for k, v in common.items() if not k.startswith("acceleration_")}
    forces = {
        "accelerometer": sense(record, acceleration=acceleration, **common),
        "differentiation": sense(record, **plain),
    }
    settings = dict(identify or {})
    estimates: dict[str, ImpedanceEstimate] = {}
    budgets, vaf, rms = {}, {}, {}
    with warnings.catch_warnings():
        # Their words stay in the estimates; here they would come once a method.
        warnings.simplefilter("ignore", UncertainResult)
        for name, force in forces.items():
            estimates[name] = identify_impedance(force.record, **settings)
            if force.constants:
                budgets[name] = force.budget(estimates[name])
        one = forces["accelerometer"].record
        measured = [c.name for c in one.channels if c.name.endswith("_measured")]
        if measured:
            estimates["force sensor"] = identify_impedance(one, force=measured, **settings)
    for name, force in forces.items():
        if measured:
            truth = np.column_stack([force.record[c] for c in measured])
            miss = force.force - truth
            rms[name] = np.sqrt(np.mean(miss**2, axis=0))
            vaf[name] = 100 * (1 - miss.var(axis=0) / truth.var(axis=0))
    if not measured:
        miss = forces["accelerometer"].force - forces["differentiation"].force
        rms["difference"] = np.sqrt(np.mean(miss**2, axis=0))
    return MethodComparison(forces, estimates, budgets, vaf, rms)
