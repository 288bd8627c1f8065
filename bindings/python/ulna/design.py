"""Design of perturbation experiments: signals for the robot, their safety, and what they will tell.

A design is a reference that a robot follows: positions (m, rad) of a position controller, relative to
where it starts, or forces (N, N m) of the robot on the human.

>>> import ulna
>>> push = ulna.design.steps(size=2.0, unit="N", seed=1)
>>> len(push.segments), push.kind
(16, 'force')
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from ._call import Handle, check, ffi, lib, long_call, options, out_array, result, text, view
from ._design_arguments import (
    DRIVES,
    KINDS,
    amplitudes,
    axis_names,
    number,
    pair,
    si_unit,
    span,
    usual,
    whole,
    within_reach,
)
from ._design_assumed import Arm, Limits, Noise, Robot, structs_of
from ._design_plan import Comparison, Plan, compare, plan
from ._design_safety import SafetyCheck, check_design
from .record import Record, Segment, _Record, pick, refuse

__all__ = [
    "Arm",
    "Comparison",
    "Design",
    "Limits",
    "Line",
    "Noise",
    "Plan",
    "Robot",
    "SafetyCheck",
    "Step",
    "StepFacts",
    "compare",
    "from_signal",
    "multisine",
    "plan",
    "random_binary",
    "step_facts",
    "step_response",
    "steps",
]

_PHASES = {
    "optimised": lib.ULNA_PHASES_OPTIMISED,
    "random": lib.ULNA_PHASES_RANDOM,
    "schroeder": lib.ULNA_PHASES_SCHROEDER,
}
# Largest references of Dyck (2013), 3.4.1 and 4.1: a circle of 2 cm, joints over 4 degrees, 6 N.
_USUAL_PEAK = {"m": 0.01, "rad": float(np.radians(2.0)), "N": 6.0}
_USUAL_STEP = {"m": 0.005, "N": 2.0}
_RESPONSES = {
    "position": lib.ULNA_RESPONSE_POSITION,
    "velocity": lib.ULNA_RESPONSE_VELOCITY,
    "acceleration": lib.ULNA_RESPONSE_ACCELERATION,
    "force": lib.ULNA_RESPONSE_FORCE,
}


class _Design(Handle):
    kind = "ulna_design"
    __slots__ = ()


# Designs -------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Line:
    """One sinusoid of a multisine: amplitude cos(2 pi freq_hz t + phase_rad)."""

    axis: int
    freq_hz: float
    amplitude: float
    phase_rad: float


@dataclass(frozen=True)
class Step:
    """One step: when it comes, how long it is held, the number of its direction, its size by axis."""

    onset_s: float
    hold_s: float
    direction: int
    size: tuple[float, ...]


@dataclass(frozen=True)
class StepFacts:
    """Overshoot (share of the step), time of the peak, and time to settle to 2 %."""

    overshoot: float
    peak_time_s: float
    settling_s: float


@dataclass(frozen=True, eq=False)
class Design:
    """A reference for a robot, and which of its rows are perturbations.

    Made by `multisine`, `steps`, `random_binary` or `from_signal`.

    Attributes
    ----------
    reference : ndarray, shape (rows, n)
        SI, relative to where the robot starts. Read-only, as all arrays.
    reference_rate, reference_acceleration : ndarray, shape (rows, n)
        Its exact derivatives, per s and s^2.
    rate_hz : float
    kind : str
        "position" or "force" (of the robot on the human).
    unit : str
        "m", "rad", "N" or "Nm".
    axes : tuple of str
        Names of the columns.
    segments : tuple of Segment
        Rows of the perturbations.
    peak, rms, crest : ndarray, shape (n,)
        Over the segments: largest magnitude, root mean square, and their ratio.
    lines : tuple of Line
        Of a multisine.
    events : tuple of Step
        Of steps.
    period_s : float
        Of a multisine; 0 where nothing repeats.
    seed : int or None
    notes : tuple of str
        What to know before using it.
    provenance : str
        How to make it again.
    """

    reference: np.ndarray
    reference_rate: np.ndarray = field(repr=False)
    reference_acceleration: np.ndarray = field(repr=False)
    rate_hz: float
    kind: str
    unit: str
    axes: tuple[str, ...]
    segments: tuple[Segment, ...]
    peak: np.ndarray
    rms: np.ndarray
    crest: np.ndarray
    lines: tuple[Line, ...]
    events: tuple[Step, ...]
    period_s: float
    seed: int | None
    notes: tuple[str, ...]
    provenance: str

    @property
    def n(self) -> int:
        """Number of axes."""
        return len(self.axes)

    @cached_property
    def time_s(self) -> np.ndarray:
        """Time of each row from the start, s."""
        return np.arange(len(self.reference)) / self.rate_hz

    @property
    def duration_s(self) -> float:
        """Length of the whole design, s."""
        return len(self.reference) / self.rate_hz

    @property
    def rotational(self) -> bool:
        """Whether the axes are joints (rad, N m)."""
        return self.unit in ("rad", "Nm")

    def _native(self) -> _Design:
        rows = np.array([(s.begin, s.end) for s in self.segments], dtype=np.int64)
        return _Design.make(
            lib.ulna_design_new,
            DRIVES[self.kind],
            view(self.reference),
            view(self.reference_rate),
            view(self.reference_acceleration),
            self.rate_hz,
            ffi.from_buffer("int64_t[]", rows),
            len(rows),
            self.provenance.encode(),
        )

    def scaled(self, factor: float) -> Design:
        """The same design `factor` times as large.

        Examples
        --------
        >>> import ulna
        >>> half = ulna.design.multisine(seed=1).scaled(0.5)
        >>> half.peak.round(6).tolist()
        [0.005, 0.005]
        """
        handle = _Design.make(lib.ulna_design_scale, self._native().pointer, float(factor))
        return replace(
            self,
            reference=_table(handle, lib.ULNA_DESIGN_VALUE, self.n),
            reference_rate=_table(handle, lib.ULNA_DESIGN_RATE, self.n),
            reference_acceleration=_table(handle, lib.ULNA_DESIGN_ACCELERATION, self.n),
            peak=_column(handle, lib.ULNA_DESIGN_PEAK),
            rms=_column(handle, lib.ULNA_DESIGN_RMS),
            lines=tuple(replace(one, amplitude=factor * one.amplitude) for one in self.lines),
            events=tuple(
                replace(one, size=tuple(factor * size for size in one.size)) for one in self.events
            ),
            provenance=_text(handle, lib.ULNA_DESIGN_TEXT_PROVENANCE),
        )

    def record(self, *, derivatives: bool = False) -> Record:
        """The design as a record with one reference channel an axis, ``x_ref`` or ``F_x_ref``.

        Parameters
        ----------
        derivatives : bool
            With velocity and acceleration of the reference.

        Examples
        --------
        >>> import ulna
        >>> ulna.design.multisine(duration_s=10).record()
        <Record: 10000 samples at 1000 Hz, 1 trial; x_ref [m], y_ref [m]>
        """
        handle = _Record.make(
            lib.ulna_design_to_record,
            self._native().pointer,
            ",".join(self.axes).encode(),
            int(self.rotational),
            int(derivatives),
        )
        return Record(handle)

    def to_csv(self, path: str | os.PathLike[str], *, derivatives: bool = False) -> None:
        """Write the design as a table for a robot's controller; `ulna.read` reads it back.

        Lines that begin with ``#`` hold rate, segments and how the design was made; then a heading
        with units, time in s, and one column an axis. The file appears only when it is whole.

        Parameters
        ----------
        path : path
        derivatives : bool
            With velocity and acceleration of the reference.

        Examples
        --------
        >>> import os, tempfile
        >>> import ulna
        >>> design = ulna.design.steps(repeats=1, seed=3)
        >>> path = os.path.join(tempfile.mkdtemp(), "design.csv")
        >>> design.to_csv(path)
        >>> log = ulna.read(path)
        >>> len(log.segments), bool((log["x_ref"] == design.reference[:, 0]).all())
        (8, True)
        """
        self.record(derivatives=derivatives).to_csv(path)

    def mark(self, record: Record, *, start_s: float = 0.0) -> Record:
        """A recording made with this design, with its perturbations as segments.

        Parameters
        ----------
        record : Record
        start_s : float
            When the design starts, after the first row of each trial.

        Examples
        --------
        >>> import ulna
        >>> design = ulna.design.steps(repeats=1, seed=3)
        >>> log = ulna.Record.from_arrays(design.time_s, {"x": design.reference[:, 0]})
        >>> len(design.mark(log).segments)
        8
        """
        pointer = record._handle.pointer
        return Record(
            _Record.make(lib.ulna_design_mark, self._native().pointer, pointer, float(start_s))
        )

    def respond(
        self, arm: Any = None, *, robot: Robot | None = None, response: str = "position"
    ) -> np.ndarray:
        """What an arm does under this design, away from rest, shape (rows, n).

        Parameters
        ----------
        arm : Arm, estimate or mapping, optional
        robot : Robot, optional
        response : {"position", "velocity", "acceleration", "force"}
            The force is that of the human on the robot.

        Examples
        --------
        >>> import ulna
        >>> design = ulna.design.multisine(seed=1)
        >>> force = design.respond(response="force")
        >>> force.shape
        (50000, 2)
        """
        which = pick(_RESPONSES, response, "response")
        expected, machine, _ = structs_of(self, arm, robot, None)
        values = out_array(
            lib.ulna_design_respond,
            self._native().pointer,
            expected,
            machine,
            which,
            ffi.NULL,
            shape=self.reference.shape,
            order="F",
        )
        return values

    def check(
        self,
        arm: Any = None,
        *,
        robot: Robot | None = None,
        limits: Limits | None = None,
        noise: Noise | None = None,
        sigmas: float = 3.0,
    ) -> SafetyCheck:
        """Peak force, displacement and velocity against limits.

        The linear loop of arm and robot is simulated exactly from rest; `sigmas` standard deviations
        of what the tremor adds are put on every peak.

        Parameters
        ----------
        arm : Arm, estimate or mapping, optional
            By default participant P1 of Dyck (2013).
        robot : Robot, optional
        limits : Limits, optional
        noise : Noise, optional
            Its tremor is used.
        sigmas : float

        Examples
        --------
        >>> import ulna
        >>> from ulna.design import Limits
        >>> design = ulna.design.multisine(seed=1)
        >>> found = design.check(limits=Limits(force=15.0))
        >>> found.within, found.tightest
        (True, 'force')
        """
        return check_design(self, arm, robot=robot, limits=limits, noise=noise, sigmas=sigmas)

    def plan(self, arm: Any = None, **keywords: Any) -> Plan:
        """What an experiment with this design will tell; see `ulna.design.plan`."""
        return plan(self, arm, **keywords)

    def summary(self) -> str:
        """The design in a few lines.

        Examples
        --------
        >>> import ulna
        >>> print(ulna.design.random_binary(seed=2).summary())
        force design along y: 50 s at 1000 Hz, 1 segment
          largest ... N, rms ... N, crest factor ...
        """
        return _design_summary(self)

    def plot(self) -> Any:
        """Signals over time, spectrum and path in the plane (needs matplotlib)."""
        from ._plot_design import design

        return design(self)

    def __repr__(self) -> str:
        return (
            f"<Design {self.kind} along {', '.join(self.axes)}: {self.duration_s:.6g} s at "
            f"{self.rate_hz:.6g} Hz, {len(self.segments)} "
            f"segment{'s' if len(self.segments) != 1 else ''}, peak "
            f"{_list(self.peak)} {self.unit}, crest factor {_list(self.crest)}>"
        )


def _list(values: Any) -> str:
    return ", ".join(f"{value:.3g}" for value in np.atleast_1d(values))


def _design_summary(design: Design) -> str:
    count = len(design.segments)
    lines = [
        f"{design.kind} design along {', '.join(design.axes)}: {design.duration_s:.6g} s at "
        f"{design.rate_hz:.6g} Hz, {count} segment{'s' if count != 1 else ''}",
        f"  largest {_list(design.peak)} {design.unit}, rms {_list(design.rms)} {design.unit}, "
        f"crest factor {_list(design.crest)}",
    ]
    for axis, name in enumerate(design.axes):
        own = [line.freq_hz for line in design.lines if line.axis == axis]
        if own:
            lines.append(f"  {name}: {len(own)} lines, {own[0]:.4g} to {own[-1]:.4g} Hz")
    from ._words import _paragraph

    lines += [_paragraph(note, "  - ") for note in design.notes]
    return "\n".join(lines)


def _table(handle: _Design, quantity: int, columns: int) -> np.ndarray:
    values = out_array(
        lib.ulna_design_get_values, handle.pointer, quantity, shape=(-1, columns), order="F"
    )
    values.flags.writeable = False
    return values


def _column(handle: _Design, quantity: int) -> np.ndarray:
    values = out_array(lib.ulna_design_get_values, handle.pointer, quantity)
    values.flags.writeable = False
    return values


def _text(handle: _Design, which: int) -> str:
    return text(lib.ulna_design_get_text, handle.pointer, which)


def _from_handle(handle: _Design, unit: str, axes: tuple[str, ...], seed: int | None) -> Design:
    info = result("ulna_design_info")
    check(lib.ulna_design_get_info(handle.pointer, info))
    n = int(info.axes)
    pairs = _table(handle, lib.ULNA_DESIGN_SEGMENTS, 2)
    notes = _text(handle, lib.ULNA_DESIGN_TEXT_NOTES)
    return Design(
        reference=_table(handle, lib.ULNA_DESIGN_VALUE, n),
        reference_rate=_table(handle, lib.ULNA_DESIGN_RATE, n),
        reference_acceleration=_table(handle, lib.ULNA_DESIGN_ACCELERATION, n),
        rate_hz=info.rate_hz,
        kind=KINDS[unit],
        unit=unit,
        axes=axes,
        segments=tuple(Segment(int(begin), int(end), 0) for begin, end in pairs),
        peak=_column(handle, lib.ULNA_DESIGN_PEAK),
        rms=_column(handle, lib.ULNA_DESIGN_RMS),
        crest=_column(handle, lib.ULNA_DESIGN_CREST),
        lines=tuple(
            Line(int(axis), freq, amplitude, phase)
            for axis, freq, amplitude, phase in _table(handle, lib.ULNA_DESIGN_LINES, 4).tolist()
        ),
        events=tuple(
            Step(onset, hold, int(direction), tuple(size))
            for onset, hold, direction, *size in _table(
                handle, lib.ULNA_DESIGN_EVENTS, 3 + n
            ).tolist()
        ),
        period_s=info.period_s,
        seed=seed,
        notes=tuple(notes.split("\n")) if notes else (),
        provenance=_text(handle, lib.ULNA_DESIGN_TEXT_PROVENANCE),
    )


# Making --------------------------------------------------------------------------------------------


def multisine(
    *,
    peak: Any = None,
    rms: Any = None,
    unit: str = "m",
    axes: Sequence[str] = ("x", "y"),
    lines: int = 10,
    band_hz: tuple[float, float] = (0.0, 3.0),
    duration_s: float = 50.0,
    rate_hz: float = 1000.0,
    phases: str = "optimised",
    shared_lines: bool = False,
    lines_hz: Any = None,
    period_s: float | None = None,
    slope: float = 0.0,
    fade_s: float = 0.0,
    starts: int = 10,
    seed: int = 0,
    progress: bool = False,
) -> Design:
    """Sums of sinusoids, section 3.4.1 of Dyck (2013): ten an axis, 0 to 3 Hz, 50 s.

    Parameters
    ----------
    peak, rms : float or array_like, shape (n,), optional
        Largest magnitude, or root mean square, of each axis, in `unit`. By default a peak of 0.01 m,
        2 degrees or 6 N.
    unit : str
        "m", "mm", "rad", "deg", "N", "Nm", ...: what the robot follows. The design itself is SI.
    axes : sequence of str
        Names of the axes.
    lines : int
        Sinusoids an axis.
    band_hz : (float, float)
        The lines lie evenly above the first and up to the second, a whole number of steps of
        1 / period_s apart where that reaches nine tenths of the band: as harmonics they have a low
        crest factor.
    duration_s : float
        Of the whole design, fades included.
    rate_hz : float
    phases : {"optimised", "random", "schroeder"}
        Optimised for a low crest factor by minimising L_2p norms (Guillaume et al., 1991).
    shared_lines : bool
        All axes have the same lines; by default they take turns along the band, so that each line
        belongs to one axis.
    lines_hz : array_like, shape (k,) or (k, n), optional
        Exactly these, instead of `lines` and `band_hz`.
    period_s : float, optional
        Lines are multiples of 1 / period_s; by default as long as the part between the fades.
    slope : float
        The amplitude of a line grows with its frequency to this power: 0 for equal positions, -1
        for equal velocities.
    fade_s : float
        Smooth rise at the start and fall at the end; the segment lies between.
    starts : int
        Random starts of the optimisation, beside Schroeder's phases.
    seed : int
        Any integer from 0.
    progress : bool
        Show a bar (needs tqdm).

    Returns
    -------
    Design

    Examples
    --------
    >>> import ulna
    >>> design = ulna.design.multisine(peak=10, unit="mm", seed=1)
    >>> design
    <Design position along x, y: 50 s at 1000 Hz, 1 segment, peak 0.01, 0.01 m, crest factor ...>
    """
    si, factor = si_unit(unit)
    names = axis_names(axes)
    if peak is not None and rms is not None:
        raise refuse("give peak or rms, not both", "rms")
    given, name = (rms, "rms") if rms is not None else (peak, "peak")
    size = (
        np.full(len(names), usual(_USUAL_PEAK, si, "peak"))
        if given is None
        else amplitudes(given, names, factor, name)
    )
    within_reach(size, si, name)
    low, high = pair(band_hz, "band_hz")
    table = None
    if lines_hz is not None:
        table = np.asarray(lines_hz, dtype=float)
        table = table[:, None] if table.ndim == 1 else table
    seed = whole(seed, "seed", least=0)
    starts = whole(starts, "starts", least=0)
    chosen = options(
        "ulna_multisine_options",
        rate_hz=number(rate_hz, "rate_hz", above=0.0),
        duration_s=number(duration_s, "duration_s", above=0.0),
        low_hz=low,
        high_hz=number(high, "band_hz", above=0.0),
        period_s=None if period_s is None else number(period_s, "period_s", above=0.0),
        slope=number(slope, "slope"),
        fade_s=number(fade_s, "fade_s", least=0.0),
        lines_hz=table,
        lines=whole(lines, "lines"),
        seed=seed,
        phases=pick(_PHASES, phases, "phases"),
        shared=bool(shared_lines),
        rms=rms is not None,
        starts=starts or -1,
    )
    out = ffi.new("ulna_design **")
    long_call(
        lib.ulna_design_multisine, DRIVES[KINDS[si]], view(size), chosen, ffi.NULL, out,
        progress=progress, label="phases",
    )  # fmt: skip
    return _from_handle(_Design(out[0]), si, names, seed)


def steps(
    *,
    size: float | None = None,
    unit: str = "m",
    axes: Sequence[str] = ("x", "y"),
    directions: Any = None,
    repeats: int = 2,
    hold_s: tuple[float, float] = (1.5, 2.0),
    wait_s: tuple[float, float] = (2.0, 7.0),
    return_s: float = 1.0,
    rest_s: float = 1.0,
    damping_ratio: float = 0.1,
    natural_rad_s: float = 15.0,
    rate_hz: float = 1000.0,
    seed: int = 0,
) -> Design:
    """Underdamped steps in random directions, sections 3.4.1 and 4.1 of Dyck (2013).

    Each step passes through w^2 / (s^2 + 2 zeta w s + w^2), is held, and is then taken back gently.
    The holds are the segments.

    Parameters
    ----------
    size : float, optional
        Of a step before the filter, in `unit`; by default 5 mm or 2 N.
    unit : str
        "m", "mm", "rad", "deg", "N", "Nm".
    axes : sequence of str
    directions : int or array_like, shape (k, n), optional
        How many, evenly about the circle (8; forth and back for one axis), or the directions
        themselves, of length 1.
    repeats : int
        Of each direction. Each comes once before any comes again, in random order.
    hold_s : (float, float)
        Least and most duration of a step.
    wait_s : (float, float)
        Least and most time from the end of a hold to the next onset.
    return_s : float
        How long the way back takes; it lies within the wait.
    rest_s : float
        After the last way back.
    damping_ratio, natural_rad_s : float
        Of the filter.
    rate_hz : float
    seed : int

    Returns
    -------
    Design

    Examples
    --------
    >>> import ulna
    >>> design = ulna.design.steps(seed=1)
    >>> len(design.events), max(step.hold_s for step in design.events) <= 2.0
    (16, True)
    """
    si, factor = si_unit(unit)
    names = axis_names(axes)
    given = (
        usual(_USUAL_STEP, si, "size") if size is None else number(size, "size", above=0.0) * factor
    )
    within_reach(given, si, "size")
    vectors, count = None, 0
    if directions is None or isinstance(directions, int | np.integer):
        count = 0 if directions is None else whole(directions, "directions")
    else:
        vectors = np.atleast_2d(np.asarray(directions, dtype=float))
        if vectors.shape[1] != len(names):
            raise refuse(f"directions must have {len(names)} columns, one an axis", "directions")
    seed = whole(seed, "seed", least=0)
    chosen = options(
        "ulna_steps_options",
        rate_hz=number(rate_hz, "rate_hz", above=0.0),
        damping_ratio=number(damping_ratio, "damping_ratio", above=0.0),
        natural_rad_s=number(natural_rad_s, "natural_rad_s", above=0.0),
        hold_s=span(hold_s, "hold_s"),
        wait_s=span(wait_s, "wait_s"),
        return_s=number(return_s, "return_s", above=0.0),
        rest_s=number(rest_s, "rest_s", least=0.0) or -1.0,
        directions=vectors,
        axes=len(names),
        direction_count=count,
        repeats=whole(repeats, "repeats"),
        seed=seed,
    )
    out = ffi.new("ulna_design **")
    long_call(lib.ulna_design_steps, DRIVES[KINDS[si]], given, chosen, ffi.NULL, out)
    return _from_handle(_Design(out[0]), si, names, seed)


def random_binary(
    *,
    amplitude: Any = None,
    unit: str = "N",
    axes: Sequence[str] = ("y",),
    clock_s: float = 0.5,
    duration_s: float = 50.0,
    return_s: float = 1.0,
    filtered: bool = True,
    damping_ratio: float = 0.1,
    natural_rad_s: float = 15.0,
    rate_hz: float = 1000.0,
    seed: int = 0,
) -> Design:
    """A random binary sequence through an underdamped filter, section 4.4.2 of Dyck (2013).

    Parameters
    ----------
    amplitude : float or array_like, shape (n,), optional
        The filter's input is plus or minus this, in `unit`; by default 2 N or 5 mm.
    unit : str
    axes : sequence of str
        Each has signs of its own. The thesis moves y and holds x.
    clock_s : float
        The sign is drawn anew this often, each as likely as the other.
    duration_s : float
        Of the whole design.
    return_s : float
        Gently back to 0 at the end; the segment is what lies before.
    filtered : bool
        False: the values themselves, with jumps.
    damping_ratio, natural_rad_s : float
        Of the filter.
    rate_hz : float
    seed : int

    Returns
    -------
    Design

    Examples
    --------
    >>> import ulna
    >>> design = ulna.design.random_binary(amplitude=2, filtered=False, seed=5)
    >>> sorted(set(design.reference[:49000, 0].tolist()))
    [-2.0, 2.0]
    """
    si, factor = si_unit(unit)
    names = axis_names(axes)
    size = (
        np.full(len(names), usual(_USUAL_STEP, si, "amplitude"))
        if amplitude is None
        else amplitudes(amplitude, names, factor, "amplitude")
    )
    within_reach(size, si, "amplitude")
    seed = whole(seed, "seed", least=0)
    chosen = options(
        "ulna_binary_options",
        rate_hz=number(rate_hz, "rate_hz", above=0.0),
        duration_s=number(duration_s, "duration_s", above=0.0),
        clock_s=number(clock_s, "clock_s", above=0.0),
        return_s=number(return_s, "return_s", least=0.0) or -1.0,
        damping_ratio=number(damping_ratio, "damping_ratio", above=0.0) if filtered else -1.0,
        natural_rad_s=number(natural_rad_s, "natural_rad_s", above=0.0),
        seed=seed,
    )
    out = ffi.new("ulna_design **")
    long_call(lib.ulna_design_binary, DRIVES[KINDS[si]], view(size), chosen, ffi.NULL, out)
    return _from_handle(_Design(out[0]), si, names, seed)


def from_signal(
    reference: Any,
    *,
    rate_hz: float,
    unit: str = "m",
    axes: Sequence[str] | None = None,
    segments: Sequence[tuple[int, int]] | None = None,
) -> Design:
    """A design from a signal of one's own, to check and plan with it.

    Parameters
    ----------
    reference : array_like, shape (rows,) or (rows, n)
        In `unit`, relative to where the robot starts. Derivatives come from differences.
    rate_hz : float
    unit : str
    axes : sequence of str, optional
        By default x, y, z.
    segments : sequence of (int, int), optional
        Begin and end (one past the last row) of each perturbation; by default all rows.

    Examples
    --------
    >>> import numpy as np
    >>> import ulna
    >>> t = np.arange(5000) / 500
    >>> ulna.design.from_signal(5 * np.sin(t), rate_hz=500, unit="mm").peak.round(4).tolist()
    [0.005]
    """
    si, factor = si_unit(unit)
    values = np.asarray(reference, dtype=float) * factor
    values = values[:, None] if values.ndim == 1 else values
    if values.ndim != 2:
        raise refuse("reference must have one or two dimensions", "reference")
    n = values.shape[1]
    if axes is None and n > 6:
        raise refuse(f"a design has from 1 to 6 axes, not {n}", "reference")
    names = axis_names(axes if axes is not None else ("x", "y", "z", "u", "v", "w")[:n])
    if len(names) != n:
        raise refuse(f"reference has {n} columns and axes {len(names)} names", "axes")
    rows = _segment_rows(segments)
    handle = _Design.make(
        lib.ulna_design_new,
        DRIVES[KINDS[si]],
        view(values),
        ffi.NULL,
        ffi.NULL,
        number(rate_hz, "rate_hz", above=0.0),
        ffi.from_buffer("int64_t[]", rows) if rows.size else ffi.NULL,
        len(rows),
        ffi.NULL,
    )
    return _from_handle(handle, si, names, None)


def _segment_rows(segments: Sequence[tuple[int, int]] | None) -> np.ndarray:
    """Begin and end of each segment, shape (segments, 2); none are no rows."""
    if segments is None:
        return np.empty((0, 2), dtype=np.int64)
    try:
        rows = np.array([[whole(row, "segments", least=0) for row in pair] for pair in segments])
    except (TypeError, ValueError):
        rows = np.empty(0)
    if rows.ndim != 2 or rows.shape[1] != 2:
        raise refuse("segments must be pairs of rows, begin and end", "segments")
    return rows.astype(np.int64)


def step_response(
    time_s: Any, *, damping_ratio: float = 0.1, natural_rad_s: float = 15.0
) -> np.ndarray:
    """Unit step response of (3.5) of Dyck (2013), exact: value, rate and acceleration, (rows, 3).

    Parameters
    ----------
    time_s : array_like, shape (rows,)
        From the step; 0 before it.
    damping_ratio, natural_rad_s : float

    Examples
    --------
    >>> import ulna
    >>> ulna.design.step_response([0.0, 0.210495])[:, 0].round(6).tolist()
    [0.0, 1.729248]
    """
    return out_array(
        lib.ulna_step_response,
        view(np.atleast_1d(np.asarray(time_s, dtype=float))),
        float(damping_ratio),
        float(natural_rad_s),
        shape=(-1, 3),
        order="F",
    )


def step_facts(*, damping_ratio: float = 0.1, natural_rad_s: float = 15.0) -> StepFacts:
    """Overshoot, time of the peak and settling time of that response.

    Examples
    --------
    >>> import ulna
    >>> facts = ulna.design.step_facts()
    >>> f"{100 * facts.overshoot:.4f} % at {facts.peak_time_s:.6f} s, settled in {facts.settling_s:.2f} s"
    '72.9248 % at 0.210495 s, settled in 2.67 s'
    """
    overshoot, peak, settling = (ffi.new("double *") for _ in range(3))
    check(
        lib.ulna_step_facts(float(damping_ratio), float(natural_rad_s), overshoot, peak, settling)
    )
    return StepFacts(overshoot[0], peak[0], settling[0])
