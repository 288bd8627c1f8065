"""Simulated experiments: an arm on a robot's handle, the human behind it, controller and sensors.

The result is a `Record` like that of a real experiment: positions in the frame of the arm, forces of
the human on the robot. SI units.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from math import pi
from os import PathLike
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from ._call import ffi, lib, long_call, options, view
from .plant import Carriage, PlanarRobot
from .record import Record, _Record, refuse

__all__ = [
    "CNS",
    "Arm",
    "Cocontraction",
    "Human",
    "Robot",
    "Sensors",
    "arms",
    "batch",
    "holding",
    "simulate",
]

_CONTROLS = {"position": lib.ULNA_CONTROL_POSITION, "force": lib.ULNA_CONTROL_FORCE}
_EXTRAS = {
    "acceleration": lib.ULNA_EXTRA_ACCELERATION,
    "robot": lib.ULNA_EXTRA_ROBOT,
    "truth": lib.ULNA_EXTRA_TRUTH,
}

# The workplace of Dyck (2013): where the hand is tested, and the robot so that it is in a comfortable
# pose there. The robot's x axis points at the participant, whose y axis points at the robot.
_TEST_LOCATION_M = (0.0, 0.52)
_REACH_M = 0.383
_PLACES = {
    "shoulder": (_TEST_LOCATION_M, (0.0, _TEST_LOCATION_M[1] + _REACH_M), -pi / 2),
    "robot": ((_REACH_M, 0.0), (0.0, 0.0), 0.0),
    "rig": ((0.0, 0.0), (-_REACH_M, 0.0), 0.0),
}


@dataclass(frozen=True, eq=False)
class Arm:
    """An arm at the handle, ``M x'' + B x' + K (x - x0) = -F``, (3.2) of Dyck (2013).

    Attributes
    ----------
    M, B, K : array_like, shape (n, n)
        kg, N s/m, N/m; n is 1 or 2. M need not be symmetric, as identified ones are not.
    x0_m : array_like, shape (n,), optional
        Equilibrium; by default where the experiment takes place.
    payload_kg : float
        Mass between force sensor and hand.
    springs : array_like, shape (springs, 4), optional
        Anchor x and y (m), rate (N/m) and rest length (m) of springs on the handle. Their force is
        evaluated exactly, in place of K.
    frame : str
        "shoulder" (origin at the shoulder, y away from the body), "robot" (origin at its base) or
        "rig" (of the springs).
    name : str

    Examples
    --------
    >>> arm = Arm([[1.3, -0.9], [-0.9, 1.9]], [[6, -2], [-2, 11]], [[42, -29], [-29, 125]])
    >>> arm
    <Arm of 2 axes, M [1.3 -0.9; -0.9 1.9] kg, B [6 -2; -2 11] N s/m, K [42 -29; -29 125] N/m>
    """

    M: Any
    B: Any
    K: Any = None
    x0_m: Any = None
    payload_kg: float = 0.0
    springs: Any = None
    frame: str = "shoulder"
    name: str = ""

    def __post_init__(self) -> None:
        if self.K is None and self.springs is None:
            raise refuse("give the stiffness K, or springs", "K")
        for name in ("M", "B", "K"):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, _matrix(value, name))
        for name in ("x0_m", "springs"):
            value = getattr(self, name)
            if value is not None:
                array = np.array(value, dtype=float)
                array.flags.writeable = False
                object.__setattr__(self, name, array)
        if self.frame not in _PLACES:
            raise refuse(
                f"frame is {self.frame!r}; it must be one of {', '.join(_PLACES)}", "frame"
            )

    @classmethod
    def of_springs(
        cls, springs: Any, *, mass_kg: float, damping_n_s_m: float = 0.0, name: str = ""
    ) -> Arm:
        """A rig of springs with a payload in place of an arm.

        Parameters
        ----------
        springs : ulna.rig.SpringArray or array_like, shape (springs, 4)
        mass_kg : float
            Payload: the inertia of the rig.
        damping_n_s_m : float
            Of the rig, along both axes alike.

        Examples
        --------
        >>> import ulna
        >>> Arm.of_springs(ulna.rig.SpringArray.on_frame([80] * 8, rest_m=0.09), mass_kg=0.539)
        <Arm of 2 axes, M [0.539 0; 0 0.539] kg, B [0 0; 0 0] N s/m, 8 springs>
        """
        rest = springs.equilibrium().position_m if hasattr(springs, "equilibrium") else None
        return cls(
            mass_kg * np.eye(2),
            damping_n_s_m * np.eye(2),
            springs=np.asarray(springs),
            x0_m=rest,
            frame="rig",
            name=name,
        )

    @property
    def n(self) -> int:
        """Number of axes."""
        return self.M.shape[0]

    def with_(self, **changes: Any) -> Arm:
        """The same arm with some attributes changed.

        Examples
        --------
        >>> arms("3.2")["P1"].with_(payload_kg=0.194).payload_kg
        0.194
        """
        return replace(self, **changes)

    def __repr__(self) -> str:
        spring = f"{len(self.springs)} springs" if self.springs is not None else _words(self.K)
        unit = "" if self.springs is not None else " N/m"
        payload = f", payload {self.payload_kg:g} kg" if self.payload_kg else ""
        return (
            f"<Arm{' ' + self.name if self.name else ''} of {self.n} ax{'es' if self.n > 1 else 'is'}, "
            f"M {_words(self.M)} kg, B {_words(self.B)} N s/m, "
            f"{'' if self.springs is not None else 'K '}{spring}{unit}{payload}>"
        )


@dataclass(frozen=True, eq=False)
class CNS:
    """The voluntary position controller of Fig. 4.2b: it holds the hand at a target.

    It knows the displacement of `delay_s` ago, and its force comes through the muscles' lag.

    Attributes
    ----------
    stiffness_n_m, damping_n_s_m, integral_n_m_s : float
        Gains on displacement, velocity and the integral of the displacement.
    delay_s : float
        Reaction time.
    lag_s : float
        First-order lag of the muscles.
    target_m : array_like, shape (n,), optional
        By default where the experiment takes place.
    """

    stiffness_n_m: float = 0.0
    damping_n_s_m: float = 0.0
    integral_n_m_s: float = 0.0
    delay_s: float = 0.15
    lag_s: float = 0.0
    target_m: Any = None


@dataclass(frozen=True)
class Cocontraction:
    """Muscles that work against each other stiffen the arm.

    At level 1, K and B are multiplied by their factors. With a `reaction_speed_m_s` part of the level
    r is a reaction: a leaky memory, over `memory_s`, of how fast the hand moved a reaction time ago. It
    adds to `level` and takes the voluntary controller back by 1 - r: who cannot follow a perturbation
    stiffens instead (section 4.4.1 of Dyck 2013).

    Attributes
    ----------
    level : float
        0 to 1, throughout.
    stiffness_factor, damping_factor : float
    reaction_speed_m_s : float
        A hand that is as fast as this co-contracts fully; 0: no reaction.
    memory_s : float
    """

    level: float = 0.0
    stiffness_factor: float = 1.0
    damping_factor: float = 1.0
    reaction_speed_m_s: float = 0.0
    memory_s: float = 1.0


@dataclass(frozen=True, eq=False)
class Human:
    """What the human does beside having an arm.

    Attributes
    ----------
    tremor_n : float
        Root mean square of a stationary force of the human's own, on each axis.
    tremor_hz, tremor_damping : float
        White noise through a second-order filter of this natural frequency and damping ratio: 0.7 is a
        low pass, 0.05 at 10 Hz a physiological tremor.
    cns : CNS, optional
        The voluntary controller; none in a relaxed arm.
    cocontraction : Cocontraction, optional
    """

    tremor_n: float = 0.0
    tremor_hz: float = 2.0
    tremor_damping: float = 0.7
    cns: CNS | None = None
    cocontraction: Cocontraction | None = None


@dataclass(frozen=True, eq=False)
class Robot:
    """A mechanism, its controller and where it stands.

    Attributes
    ----------
    mechanism : PlanarRobot or Carriage
    control : {"position", "force"}, optional
        PD control of the handle, or a force in open loop. By default what the design is for.
    kp_n_m, kd_n_s_m : float
        Cartesian gains of the position control.
    rate_hz : float
        Of the control, raised to a multiple of the record's rate.
    delay_s : float
        From reading to torque, in steps of the control.
    force_limit_n : float
        Of the commanded force; 0: none.
    hold_axis : {"x", "y"}, optional
        Under force control this axis is held at the centre by `kp_n_m` and `kd_n_s_m`.
    base_m, base_angle_rad : optional
        Base of the robot in the frame of the arm. By default as at the workplace of Dyck (2013), with
        the test location 0.383 m in front of it; a carriage stands at the centre.
    """

    mechanism: Any = field(default_factory=PlanarRobot)
    control: Literal["position", "force"] | None = None
    kp_n_m: float = 3000.0
    kd_n_s_m: float = 120.0
    rate_hz: float = 1000.0
    delay_s: float = 0.0
    force_limit_n: float = 0.0
    hold_axis: Literal["x", "y"] | None = None
    base_m: tuple[float, float] | None = None
    base_angle_rad: float | None = None


@dataclass(frozen=True)
class Sensors:
    """Errors of the sensors; noise is white, with this root mean square, and 0 means none.

    The defaults are the encoder and the force sensor of Dyck (2013): 0.002 mm and 1/24 N.

    Examples
    --------
    >>> Sensors.exact().force_noise_n
    0.0
    """

    position_resolution_m: float = 2e-6
    position_noise_m: float = 2e-6
    force_resolution_n: float = 1 / 24
    force_noise_n: float = 1 / 24
    force_delay_s: float = 0.0
    acceleration_resolution_m_s2: float = 0.0
    acceleration_noise_m_s2: float = 0.0

    @classmethod
    def exact(cls) -> Sensors:
        """Sensors without any error."""
        return cls(0.0, 0.0, 0.0, 0.0)


def arms(table: str) -> dict[str, Arm]:
    """Identified arms of Dyck (2013), by participant or method.

    Parameters
    ----------
    table : {"3.2", "3.4", "4.1", "4.2", "5.6"}
        Relaxed under sinusoidal and underdamped perturbations; rigid under underdamped and sinusoidal
        ones (what (3.2) made of an arm with its voluntary control: some have negative masses); relaxed,
        below the shoulder, in the frame of the robot.

    Examples
    --------
    >>> arms("3.2")["P1"].K
    array([[ 42.45, -34.38],
           [-23.02, 125.43]])
    """
    from . import _dyck2013 as thesis

    try:
        rows = thesis.arms(table)
    except KeyError:
        raise refuse(
            f"there are no arms in table {table!r}; they are in 3.2, 3.4, 4.1, 4.2 and 5.6", "table"
        ) from None
    frame = "robot" if table == "5.6" else "shoulder"
    return {
        name: Arm(a.m, a.b, a.k, x0_m=a.x0_m, frame=frame, name=f"{name} of Table {table}")
        for name, a in rows.items()
    }


def holding(arm: Arm, *, tremor_n: float = 0.0) -> Human:
    """A human who holds the hand where it is: rigid grasping, chapter 4 of Dyck (2013).

    The arm is co-contracted a little. A controller brings the hand back after a reaction time of 0.15 s;
    when the hand is moved fast or without pause, the human stiffens instead and the controller fades.
    The gains follow the arm's own stiffness and damping (means of the diagonals of K and B). They were
    chosen so that Table 4.3 and Fig. 4.5 come out for the arms of Table 3.2; they are no measurement.

    Parameters
    ----------
    arm : Arm
    tremor_n : float
        As for `Human`.

    Examples
    --------
    >>> human = holding(arms("3.2")["P1"])
    >>> human.cns.delay_s, round(human.cns.integral_n_m_s, 1)
    (0.15, 230.8)
    """
    _require(arm, Arm, "arm")
    if arm.K is None:
        raise refuse(
            "springs do not hold a place on purpose: give an arm with a stiffness K", "arm"
        )
    stiffness, damping = float(np.trace(arm.K)) / arm.n, float(np.trace(arm.B)) / arm.n
    if not (stiffness > 0 and damping > 0):
        raise refuse("the arm's K and B must be positive on average, or no gains follow", "arm")
    return Human(
        tremor_n=tremor_n,
        cns=CNS(
            stiffness_n_m=0.08 * stiffness,
            damping_n_s_m=2.2 * damping,
            integral_n_m_s=2.75 * stiffness,
            delay_s=0.15,
            lag_s=0.05,
        ),
        cocontraction=Cocontraction(
            level=0.22,
            stiffness_factor=3.2,
            damping_factor=2.6,
            reaction_speed_m_s=0.18,
            memory_s=0.65,
        ),
    )


def simulate(
    arm: Arm,
    reference: Any,
    *,
    robot: Robot | None = None,
    human: Human | None = None,
    sensors: Sensors | None = None,
    rate_hz: float | None = None,
    segments: Any = None,
    centre_m: ArrayLike | None = None,
    settle_s: float = 2.0,
    extras: Iterable[str] = (),
    seed: int = 0,
    run: int = 0,
) -> Record:
    """Simulate an experiment; the result is a record like that of a real one.

    Parameters
    ----------
    arm : Arm
    reference : design or array_like, shape (rows, n)
        A design of `ulna.design`, its table as `ulna.read` reads it or the file's path, or anything with `reference`,
        `rate_hz`, `kind` and `segments`; or an array: positions relative to the centre (m) or, with
        force control, forces of the robot on the human (N). A design along x or y alone leaves the
        other axis of the arm at 0.
    robot : Robot, optional
    human : Human, optional
        By default passive: no force of its own.
    sensors : Sensors, optional
        By default those of Dyck (2013); `Sensors.exact()` for none.
    rate_hz : float, optional
        Of the reference and the record; by default the design's, or 1000.
    segments : sequence of (begin, end), optional
        Rows of the perturbations; by default the design's, or all rows.
    centre_m : array_like, shape (n,), optional
        Where the reference is zero. By default (0, 0.52) m from the shoulder, the test location of Dyck
        (2013), (0.383, 0) m from the robot's base, where springs rest, or 0 for one axis.
    settle_s : float
        Time at the first row of the reference before the record starts.
    extras : iterable of {"acceleration", "robot", "truth"}
        More channels: ``a_x``; ``q_1`` and ``tau_1`` (angles and torques of the joints); ``x_true``,
        ``v_x_true``, ``a_x_true``, ``F_x_true``, ``F_x_cns``, ``F_x_tremor``, ``cocontraction``.
    seed, run : int
        A record is a function of the description, the seed and the number of the run.

    Returns
    -------
    Record
        Channels ``x``, ``y``, ``F_x``, ``F_y`` and ``x_ref``, ``y_ref`` (or ``F_x_ref``, ``F_y_ref``).

    Examples
    --------
    >>> import numpy as np, ulna
    >>> from ulna import sim
    >>> t = np.arange(0, 20, 0.001)
    >>> wave = [sum(np.sin(2 * np.pi * f * t + f * f) for f in fs) for fs in ((0.4, 1.1, 2.3), (0.7, 1.6))]
    >>> arm = sim.arms("3.2")["P1"]
    >>> log = sim.simulate(arm, 0.004 * np.transpose(wave), seed=1)
    >>> log
    <Record: 20000 samples at 1000 Hz, 1 trial; x [m], y [m], F_x [N], F_y [N], x_ref [m], y_ref [m]>
    >>> bool(np.allclose(ulna.identify_impedance(log).K, arm.K, atol=2.0))
    True
    """
    question = _question(
        arm, reference, robot, human, sensors, rate_hz, segments, centre_m, settle_s, extras, seed
    )
    out = ffi.new("ulna_record **")
    long_call(lib.ulna_sim_run, *question, run, ffi.NULL, out)
    return Record(_Record(out[0]))


def batch(
    arm: Arm,
    reference: Any,
    *,
    runs: int,
    robot: Robot | None = None,
    human: Human | None = None,
    sensors: Sensors | None = None,
    rate_hz: float | None = None,
    segments: Any = None,
    centre_m: ArrayLike | None = None,
    settle_s: float = 2.0,
    extras: Iterable[str] = (),
    seed: int = 0,
    threads: int = 0,
    progress: bool = False,
) -> list[Record]:
    """Simulate runs 0 to `runs` - 1 of a seed on several threads, the same as one by one.

    Parameters
    ----------
    arm, reference, robot, human, sensors, rate_hz, segments, centre_m, settle_s, extras, seed
        As for `simulate`.
    runs : int
    threads : int
        0: one per processor.
    progress : bool
        Show a bar (needs tqdm).

    Examples
    --------
    >>> import numpy as np
    >>> wave = 0.004 * np.sin(np.arange(3000)[:, None] / (80.0, 130.0))
    >>> human = Human(tremor_n=1.0)
    >>> two = batch(arms("3.2")["P1"], wave, runs=2, human=human, seed=3)
    >>> alone = simulate(arms("3.2")["P1"], wave, human=human, seed=3, run=1)
    >>> bool((two[1].values == alone.values).all()), bool((two[0].values == alone.values).all())
    (True, False)
    """
    question = _question(
        arm,
        reference,
        robot,
        human,
        sensors,
        rate_hz,
        segments,
        centre_m,
        settle_s,
        extras,
        seed,
        threads,
    )
    if not 1 <= int(runs) <= 1_000_000:
        raise refuse("runs must be from 1 to 1000000", "runs")
    out = ffi.new("ulna_record *[]", int(runs))
    long_call(lib.ulna_sim_batch, *question, runs, ffi.NULL, out, progress=progress, label="runs")
    return [Record(_Record(pointer)) for pointer in out]


# What the C interface takes -----------------------------------------------------------------------


def _question(
    arm: Arm,
    reference: Any,
    robot: Robot | None,
    human: Human | None,
    sensors: Sensors | None,
    rate_hz: float | None,
    segments: Any,
    centre_m: ArrayLike | None,
    settle_s: float,
    extras: Iterable[str],
    seed: int,
    threads: int = 0,
) -> list[Any]:
    """Arguments of ulna_sim_run up to the reference."""
    _require(arm, Arm, "arm")
    robot, human = robot or Robot(), human or Human()
    sensors = sensors or Sensors()
    _require(robot, Robot, "robot")
    _require(human, Human, "human")
    _require(sensors, Sensors, "sensors")
    plan = _plan(reference, rate_hz, segments, arm.n)
    centre, base, angle = _place(arm, robot, centre_m)
    control = robot.control or plan.kind
    if control not in _CONTROLS:
        raise refuse(f"control is {control!r}; it must be position or force", "control")
    if plan.given and robot.control not in (None, plan.kind):
        raise refuse(
            f"the design is for {plan.kind} control, but the robot's control is {robot.control}",
            "control",
        )
    hold = {None: 0, "x": 1, "y": 2}.get(robot.hold_axis, -1)
    flags = 0
    for word in (extras,) if isinstance(extras, str) else extras:
        if word not in _EXTRAS:
            raise refuse(f"extras are {', '.join(_EXTRAS)}, not {word!r}", "extras")
        flags |= _EXTRAS[word]
    return [
        robot.mechanism._pointer,
        _arm_struct(arm),
        _human_struct(human),
        options(
            "ulna_sim_control",
            mode=_CONTROLS[control],
            hold_axis=hold,
            kp_n_m=_zero_is_none(robot.kp_n_m, "kp_n_m"),
            kd_n_s_m=_zero_is_none(robot.kd_n_s_m, "kd_n_s_m"),
            rate_hz=robot.rate_hz,
            delay_s=robot.delay_s,
            force_limit_n=robot.force_limit_n,
            base_m=list(base),
            base_angle_rad=angle,
        ),
        options(
            "ulna_sim_sensors",
            **{name: _zero_is_none(value, name) for name, value in vars(sensors).items()},
        ),
        options(
            "ulna_sim_options",
            rate_hz=plan.rate_hz,
            settle_s=_zero_is_none(settle_s, "settle_s"),
            centre=centre,
            segments=plan.segments.reshape(-1) if len(plan.segments) else None,
            segment_count=len(plan.segments),
            notes=plan.provenance or None,
            frame=arm.frame if arm.n == 2 else "",
            seed=seed,
            extras=flags,
            threads=threads,
        ),
        view(plan.reference),
    ]


@dataclass(frozen=True)
class _Plan:
    reference: np.ndarray
    rate_hz: float
    kind: str
    segments: np.ndarray  # of rows, shape (segments, 2)
    provenance: str
    given: bool  # by a design, not as a bare array


def _plan(reference: Any, rate_hz: float | None, segments: Any, n: int) -> _Plan:
    if isinstance(reference, str | PathLike):
        from .io import read

        reference = read(reference)
    if isinstance(reference, Record):
        reference = _Table(reference)
    given = hasattr(reference, "reference") and hasattr(reference, "rate_hz")
    values = np.asarray(reference.reference if given else reference)
    if values.dtype.kind not in "fiub" or values.ndim not in (1, 2):
        raise refuse("the reference must be a design, or numbers of shape (rows, n)", "reference")
    if getattr(reference, "unit", "m") not in ("m", "N"):
        raise refuse(
            f"the design is in {reference.unit}, but the handle is moved in m or pushed in N",
            "reference",
        )
    if given and rate_hz not in (None, reference.rate_hz):
        raise refuse(
            f"rate_hz is {rate_hz:g}, but the design's is {reference.rate_hz:g}", "rate_hz"
        )
    rate = reference.rate_hz if given else 1000.0 if rate_hz is None else rate_hz
    if not rate > 0:
        raise refuse("rate_hz must be positive", "rate_hz")
    rows = getattr(reference, "segments", None) if segments is None else segments
    return _Plan(
        reference=_on_axes(values, tuple(getattr(reference, "axes", ())), n),
        rate_hz=float(rate),
        kind=str(getattr(reference, "kind", "position")) if given else "position",
        segments=_segments(rows),
        provenance=str(getattr(reference, "provenance", "") or "") if given else "",
        given=given,
    )


class _Table:
    """A design as it was read from a table: channels x_ref, y_ref or F_x_ref, F_y_ref."""

    def __init__(self, record: Record) -> None:
        found = [re.fullmatch(r"(F_)?([xy])_ref", c.name) for c in record.channels]
        names = [m[0] for m in found if m]
        if not names or len({name[:2] == "F_" for name in names}) > 1:
            raise refuse(
                "the record is no design: it must have the channels x_ref and y_ref, or F_x_ref and "
                f"F_y_ref, and it has {', '.join(c.name for c in record.channels)}",
                "reference",
            )
        self.kind = "force" if names[0].startswith("F_") else "position"
        self.axes = tuple(m[2] for m in found if m)
        self.reference = np.column_stack([record[name] for name in names])
        self.rate_hz = record.rate_hz
        self.segments = record.segments
        self.provenance = "\n".join(record.provenance)


def _on_axes(values: np.ndarray, names: tuple[str, ...], n: int) -> np.ndarray:
    """A design along x or y alone, for an arm of two axes: the other reference is zero."""
    one = values.ndim == 1 or values.shape[1] == 1
    if n != 2 or not one or names not in (("x",), ("y",)):
        return values
    both = np.zeros((len(values), 2))
    both[:, "xy".index(names[0])] = values.reshape(-1)
    return both


def _segments(rows: Any) -> np.ndarray:
    pairs = [
        (row.begin, row.end) if hasattr(row, "begin") else row
        for row in ([] if rows is None else rows)
    ]
    try:
        out = np.array(pairs, dtype=np.int64).reshape(len(pairs), 2)
    except (TypeError, ValueError):
        raise refuse("segments must be pairs of rows, (begin, end)", "segments") from None
    return out


def _place(
    arm: Arm, robot: Robot, centre_m: ArrayLike | None
) -> tuple[np.ndarray, Sequence[float], float]:
    """Centre of the experiment, base of the robot and its angle."""
    if not isinstance(robot.mechanism, (PlanarRobot, Carriage)):
        raise refuse(
            "the mechanism must be an ulna.plant.PlanarRobot or an ulna.plant.Carriage", "mechanism"
        )
    centre, base, angle = _PLACES[arm.frame]
    if arm.n == 1:
        centre = (0.0,)
    if arm.springs is not None and arm.x0_m is not None:
        centre = arm.x0_m
    if centre_m is not None:
        centre = np.atleast_1d(np.asarray(centre_m, dtype=float))
    if arm.frame == "rig":
        base = (centre[0] - _REACH_M, centre[-1])
    if isinstance(robot.mechanism, Carriage):
        base, angle = (*centre, 0.0)[:2], 0.0
    return (
        np.asarray(centre, dtype=float),
        _two(base if robot.base_m is None else robot.base_m, "base_m"),
        angle if robot.base_angle_rad is None else robot.base_angle_rad,
    )


def _arm_struct(arm: Arm) -> Any:
    return options(
        "ulna_sim_arm",
        m=arm.M,
        b=arm.B,
        k=arm.K,
        x0=arm.x0_m,
        springs=arm.springs,
        payload_kg=arm.payload_kg,
    )


def _human_struct(human: Human) -> Any:
    cns = human.cns or CNS()
    muscles = human.cocontraction or Cocontraction()
    _require(cns, CNS, "cns")
    _require(muscles, Cocontraction, "cocontraction")
    tiny = np.finfo(float).tiny  # where zero bytes would mean 1: a factor of 0 is allowed
    return options(
        "ulna_sim_human",
        tremor_n=human.tremor_n,
        tremor_hz=_not_zero(human.tremor_hz, "tremor_hz"),
        tremor_damping=_not_zero(human.tremor_damping, "tremor_damping"),
        cns=human.cns is not None,
        delay_s=_not_zero(cns.delay_s, "delay_s"),
        lag_s=cns.lag_s,
        stiffness_n_m=cns.stiffness_n_m,
        damping_n_s_m=cns.damping_n_s_m,
        integral_n_m_s=cns.integral_n_m_s,
        target=cns.target_m,
        cocontraction=muscles.level,
        stiffness_factor=muscles.stiffness_factor or tiny,
        damping_factor=muscles.damping_factor or tiny,
        reaction_speed_m_s=muscles.reaction_speed_m_s,
        memory_s=_not_zero(muscles.memory_s, "memory_s"),
    )


def _require(value: Any, kind: type, name: str) -> None:
    if not isinstance(value, kind):
        raise refuse(f"{name} must be an ulna.sim.{kind.__name__}, not {value!r}", name)


def _zero_is_none(value: float, name: str) -> float:
    # Zero bytes would mean the default; the interface takes a negative number as none.
    if isinstance(value, (int, float)) and value < 0:
        raise refuse(f"{name} is {value:g}; it must not be negative", name)
    return -1.0 if value == 0 else value


def _not_zero(value: float, name: str) -> float:
    if value == 0:
        raise refuse(f"{name} must be positive", name)
    return value


def _two(values: Any, name: str) -> tuple[float, float]:
    try:
        x, y = (float(v) for v in values)
    except (TypeError, ValueError):
        raise refuse(f"{name} must be two numbers", name) from None
    return x, y


def _matrix(value: Any, name: str) -> np.ndarray:
    try:
        array = np.atleast_2d(np.array(value, dtype=float))
    except (TypeError, ValueError):
        array = np.empty((0, 0))
    if array.ndim != 2 or array.shape[0] != array.shape[1] or array.shape[0] not in (1, 2):
        raise refuse(f"{name} must be a 1 x 1 or 2 x 2 matrix of numbers", name)
    array.flags.writeable = False
    return array


def _words(matrix: np.ndarray) -> str:
    return "[" + "; ".join(" ".join(f"{v:g}" for v in row) for row in matrix) + "]"
