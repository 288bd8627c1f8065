"""The exoskeleton and the arm in it: scenes, their nominal model, runs, isometric elbow torque, and
the assessment of an arm by passive mobilisation.

World: x forward, y left, z up; the origin is the device's shoulder centre. Angles rad, torques N m,
positions m, excitation and activation 0 to 1. A torque is positive that turns its joint towards
positive angles, so flexion of the elbow is positive. Arrays hold one pose a row.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._call import (
    FileError,
    FormatError,
    Handle,
    check,
    constants,
    encode,
    ffi,
    lib,
    long_call,
    options,
    out_array,
    text,
    view,
)
from ._exo_arguments import as_numbers, names_of, number, numbers
from ._exo_assessment import (
    Assessment,
    Protocol,
    Viscoelasticity,
    identify_viscoelasticity,
    mobilise,
    muscle_impedance,
    with_errors,
)
from ._exo_batch import AssessmentBatch, AssessmentModel, assess_batch, published_factors
from ._exo_difference import PlantDifference, difference
from ._exo_patient import patient, population
from ._exo_published import (
    PUBLISHED_DEFECTS,
    PublishedAssessment,
    published_assessment,
    published_simulation,
)
from ._exo_render import (
    Renderer,
    Video,
    arrows,
    film,
    render,
    render_available,
    spheres,
    write_png,
)
from ._exo_soft import (
    Bushing,
    Compression,
    InterfaceState,
    Soft,
    bushings_of,
    compression_test,
    states_of,
)
from .record import pick, refuse

__all__ = [
    "Assessment",
    "AssessmentBatch",
    "AssessmentModel",
    "Bushing",
    "Compression",
    "ElbowTorque",
    "InterfaceState",
    "PUBLISHED_DEFECTS",
    "Plant",
    "PlantDifference",
    "Protocol",
    "PublishedAssessment",
    "Renderer",
    "Run",
    "Soft",
    "Video",
    "Viscoelasticity",
    "arrows",
    "assess_batch",
    "compression_test",
    "exoskeleton",
    "film",
    "fit_elbow_muscles",
    "identify_viscoelasticity",
    "isometric_torque",
    "measured_torque",
    "mobilise",
    "muscle_impedance",
    "patient",
    "population",
    "published_assessment",
    "published_factors",
    "published_simulation",
    "read_device",
    "read_scene",
    "render_available",
    "spheres",
    "with_errors",
    "write_png",
]

Array = NDArray[np.float64]

_COUPLINGS = dict(constants("ULNA_COUPLING_"))
_MUSCLES = dict(constants("ULNA_MUSCLES_"))
_PARTS = dict(constants("ULNA_PART_"))
_QUANTITIES = dict(constants("ULNA_QUANTITY_"))
_DYNAMICS = dict(constants("ULNA_DYNAMICS_"))
_DEGREE = np.pi / 180.0
_NO_ANGLE = 1e-12  # to the library 0 rad is a default where the arm is reduced

# Key of a link in a device file -> numbers, default (None: must be there).
_LINK_KEYS: dict[str, tuple[int, Any]] = {
    "position_m": (3, (0.0, 0.0, 0.0)),
    "quaternion": (4, (1.0, 0.0, 0.0, 0.0)),
    "axis": (3, (0.0, 0.0, 1.0)),
    "range_deg": (2, None),
    "reference_deg": (1, 0.0),
    "mass_kg": (1, None),
    "centre_m": (3, None),
    "inertia_kg_m2": (6, None),
    "damping_nm_s": (1, 0.0),
    "friction_nm": (1, 0.0),
    "motor_limit_nm": (1, 0.0),
}


class _Plant(Handle):
    kind = "ulna_plant"
    __slots__ = ()


class _Run(Handle):
    kind = "ulna_run"
    __slots__ = ()


def _fill(function: Any, *args: Any, shape: tuple[int, ...]) -> Array:
    """What a long call with a token writes into a buffer whose size is known."""
    values = np.empty(shape)
    count = ffi.new("int64_t *")
    pointer = ffi.cast("double *", values.ctypes.data)
    long_call(function, *args, ffi.NULL, pointer, values.size, count)
    return values


def _refuse_zero(**values: Any) -> None:
    """Zero bytes mean a default to the library; a zero that somebody wrote is a mistake.

    Raises
    ------
    ArgumentError
        For a number that is 0, and for what is none.
    """
    for name, value in values.items():
        if value is not None and number(value, name) == 0:
            raise refuse(f"{name} must not be 0", name)


def _angle(value: float | None, name: str) -> float | None:
    return None if value is None else number(value, name) or _NO_ANGLE


def _reduction_options(
    *,
    start_rad: float = np.radians(110),
    end_rad: float = np.radians(3),
    activation: float = 0.4,
    poses: int = 25,
) -> Any:
    """How soft interfaces become bushings, as the library takes it; see :meth:`Plant.reduced`."""
    if activation is not None and not number(activation, "activation") >= 0:
        raise refuse(f"activation is {activation!r}; it must be between 0 and 1", "activation")
    _refuse_zero(poses=poses)
    return options(
        "ulna_reduction_options",
        start_rad=_angle(start_rad, "start_rad"),
        end_rad=_angle(end_rad, "end_rad"),
        activation=-1.0 if activation == 0 else activation,
        poses=poses,
    )


class Plant:
    """A compiled scene: immutable, shared by runs and threads.

    Made by :func:`exoskeleton` and :func:`read_scene`.

    Examples
    --------
    >>> plant = exoskeleton()
    >>> plant.names("joint")
    ('J1', 'J2', 'J3', 'J4')
    >>> device = exoskeleton(coupling="exo_only", published_straps=True)
    >>> device.inertia(device.reference).diagonal().round(3)
    array([0.401, 0.403, 0.084, 0.023])
    """

    def __init__(self, handle: Handle) -> None:
        self._handle = handle

    def __repr__(self) -> str:
        return f"Plant({len(self.names('joint'))} joints, {len(self.names('actuator'))} actuators)"

    @property
    def _pointer(self) -> Any:
        return self._handle.pointer

    def names(self, part: str) -> tuple[str, ...]:
        """Names of the parts of a kind: body, joint, geom, site, tendon, actuator, equality."""
        written = text(
            lib.ulna_plant_names, self._pointer, pick(_PARTS, part, "part")
        )
        return tuple(written.splitlines())

    @property
    def mjcf(self) -> str:
        """The scene in the engine's language; empty for plants that were read or changed."""
        return text(lib.ulna_plant_text, self._pointer)

    @property
    def reference(self) -> Array:
        """Joint angles in which the scene is written, rad."""
        return out_array(lib.ulna_plant_reference, self._pointer)

    @property
    def range(self) -> Array:
        """Limits of the joints, rad, shape (joints, 2)."""
        return out_array(lib.ulna_plant_range, self._pointer, shape=(-1, 2))

    def values(self, quantity: str, name: str) -> Array:
        """Numbers of a part of the compiled scene, as :meth:`change` takes them."""
        kind = pick(_QUANTITIES, quantity, "quantity")
        return out_array(
            lib.ulna_plant_values, self._pointer, kind, encode(name, "name")
        )

    def change(self, quantity: str, name: str, values: ArrayLike) -> Plant:
        """The plant with other numbers, without compiling again; it has no nominal model.

        Parameters
        ----------
        quantity : str
            mass (kg), inertia (centre of mass, then xx yy zz xy xz yz), body_position,
            site_position (m), damping, friction, length_range (m), muscle (peak force in N and the
            two normalised lengths), reference, impedance.
        name : str
            Of the part.
        values : array_like

        Examples
        --------
        >>> plant = exoskeleton().change("mass", "Link4", 0.6)
        >>> plant.values("mass", "Link4")
        array([0.6])
        """
        kind = pick(_QUANTITIES, quantity, "quantity")
        numbers = view(np.atleast_1d(np.asarray(values, dtype=float)))
        return Plant(
            _Plant.make(
                lib.ulna_plant_change,
                self._pointer,
                kind,
                encode(name, "name"),
                numbers,
            )
        )

    def check_start(self, start: ArrayLike) -> None:
        """Refuse a start outside the joints' limits; the message names the joint."""
        check(
            lib.ulna_plant_check_start(
                self._pointer, view(np.asarray(start, dtype=float))
            )
        )

    def inertia(self, angle: ArrayLike) -> Array:
        """Inertia matrix, kg m^2, shape (..., joints, joints)."""
        poses = np.asarray(angle, dtype=float)
        n = poses.shape[-1]
        out = out_array(
            lib.ulna_plant_inertia, self._pointer, view(np.atleast_2d(poses))
        )
        return out.reshape((*poses.shape[:-1], n, n))

    def inverse_dynamics(
        self,
        angle: ArrayLike,
        rate: ArrayLike,
        acceleration: ArrayLike,
        *,
        dynamics: str = "nominal",
    ) -> Array:
        """Torque at each joint for a motion: (6) and (20) of Tesfazgi (2023).

        Parameters
        ----------
        angle, rate, acceleration : array_like, shape (joints,) or (rows, joints)
        dynamics : {"nominal", "friction", "engine"}
            The description's rigid bodies; the same with damping and Coulomb friction; what the
            physics engine needs, with friction, joint limits and unexcited muscles. The engine's
            Coulomb friction creeps: it is less than its limit below about 0.5 rad/s.

        Returns
        -------
        ndarray, N m

        Examples
        --------
        >>> plant = exoskeleton(muscles="none")
        >>> rest = np.zeros(4)
        >>> plant.inverse_dynamics(plant.reference, rest, rest).shape
        (4,)
        """
        poses = np.asarray(angle, dtype=float)
        rows = [
            view(np.atleast_2d(np.asarray(a, dtype=float)))
            for a in (angle, rate, acceleration)
        ]
        kind = pick(_DYNAMICS, dynamics, "dynamics")
        out = out_array(lib.ulna_plant_inverse_dynamics, self._pointer, kind, *rows)
        return out.reshape(poses.shape)

    def reduced(
        self,
        *,
        start_rad: float = np.radians(110),
        end_rad: float = np.radians(3),
        activation: float = 0.4,
        poses: int = 25,
    ) -> Plant:
        """The plant with bushings in place of its soft interfaces, some twenty times as fast.

        The arm at rest, its elbow's muscles at `activation`, is followed through a movement of the
        device's last joint from `start_rad` to `end_rad` in so many `poses`, 4 to 1000; what cuff and
        strap do to it over how far it gives becomes their stiffness. It takes some 50 ms.

        Raises
        ------
        ArgumentError
            For a movement without way, fewer poses, an activation that is none, and a plant without
            soft interfaces to reduce.

        Examples
        --------
        >>> plant = exoskeleton(soft=True).reduced()
        >>> [f"{b.limb} {b.part}" for b in plant.bushings]
        ['upper cuff', 'upper strap', 'fore cuff', 'fore strap']
        """
        reduction = _reduction_options(
            start_rad=start_rad,
            end_rad=end_rad,
            activation=activation,
            poses=poses,
        )
        out = ffi.new("ulna_plant **")
        long_call(lib.ulna_plant_reduce, self._pointer, reduction, ffi.NULL, out)
        return Plant(_Plant(out[0]))

    def difference(
        self,
        reduced: Plant | None = None,
        *,
        protocol: Protocol | None = None,
        **estimator: Any,
    ) -> PlantDifference:
        """What the reduced plant costs: an assessment with it beside one with this plant.

        Parameters
        ----------
        reduced : Plant, optional
            Default: this plant's, by the defaults of :meth:`reduced`.
        protocol : Protocol, optional
            Of both. Reduce for its range; above a co-contraction of 0.4 over the whole range bushings
            are off by more than 0.1 N m/rad.
        **estimator
            As of :func:`identify_viscoelasticity`.

        Returns
        -------
        PlantDifference
            Bushings know no pressure, pressed area, tension and sliding: those are not compared.

        Raises
        ------
        AnalysisError
            When one of the two runs does not end as ok.

        Examples
        --------
        >>> apart = exoskeleton(soft=True).difference()
        >>> bool(abs(apart.k_error) < 0.2)
        True
        """
        return difference(self, reduced, protocol, **estimator)

    @property
    def bushings(self) -> tuple[Bushing, ...]:
        """Of a reduced plant; empty for one with whole interfaces."""
        return bushings_of(
            out_array(lib.ulna_plant_bushings, self._pointer, shape=(-1, 86))
        )

    def render(
        self,
        run: Run | None = None,
        path: str | Path | None = None,
        shapes: ArrayLike | None = None,
        **look: Any,
    ) -> NDArray[np.uint8]:
        """A picture of the scene: device, arm, muscles from blue (no activation) to red (full).

        Needs OpenGL, see :func:`render_available`; nothing else does.

        Parameters
        ----------
        run : Run, optional
            As its last step or `forward` left it. Default: the reference, at rest.
        path : path, optional
            To write the picture to as well; ends with .png.
        shapes : array_like, shape (shapes, 12), optional
            What else to draw, of :func:`arrows` and :func:`spheres`.
        **look
            What :class:`Renderer` takes: size, camera, person, samples ...

        Returns
        -------
        ndarray of uint8, shape (height, width, 3)

        Examples
        --------
        >>> plant = exoskeleton()
        >>> if render_available()[0]:
        ...     assert plant.render(size=(64, 48), camera="side").shape == (48, 64, 3)
        """
        return render(self, run, path, shapes, look)

    def run(self) -> Run:
        """A simulation that starts in the reference, at rest."""
        return Run(self)


class Run:
    """A simulation of a plant, of one thread at a time.

    After a failure of :meth:`step` the run can only be thrown away.

    Examples
    --------
    >>> run = exoskeleton().run()
    >>> run.set(control=[0, 0, 0, 5.0] + 8 * [0])
    >>> run.step(100)
    >>> round(run.time_s, 6)
    0.5
    """

    def __init__(self, plant: Plant) -> None:
        self.plant = plant
        self._handle = _Run.make(lib.ulna_run_new, plant._pointer)

    def set(self, **fields: ArrayLike) -> None:
        """Set fields: position, velocity, activation, control, applied (torque from outside)."""
        settable = ("position", "velocity", "activation", "control", "applied")
        for name, values in fields.items():
            if name not in settable:
                raise refuse(
                    f"a run has no {name} to set; it has {', '.join(settable)}",
                    name,
                )
            kind = getattr(lib, f"ULNA_RUN_{name.upper()}")
            numbers = view(np.atleast_1d(np.asarray(values, dtype=float)))
            check(lib.ulna_run_set(self._handle.pointer, kind, numbers))

    def reset(self) -> None:
        """Back to the plant's reference, at rest, time 0."""
        check(lib.ulna_run_reset(self._handle.pointer))

    def don(self, device_angle: ArrayLike) -> None:
        """Put the arm into its soft interfaces with the device's joints at these angles, at rest."""
        angle = view(np.atleast_1d(np.asarray(device_angle, dtype=float)))
        check(lib.ulna_run_don(self._handle.pointer, angle))

    @property
    def interfaces(self) -> dict[str, InterfaceState]:
        """What each soft interface did in the last step; empty where there is none."""
        rows = out_array(lib.ulna_run_interfaces, self._handle.pointer, shape=(-1, 22))
        return states_of(rows)

    def forward(self) -> None:
        """Compute what follows from the state without moving it."""
        check(lib.ulna_run_forward(self._handle.pointer))

    def step(self, count: int) -> None:
        """Move on by so many time steps."""
        long_call(lib.ulna_run_step, self._handle.pointer, count)

    def _get(self, field: int) -> Array:
        return out_array(lib.ulna_run_get, self._handle.pointer, field)

    @property
    def position(self) -> Array:
        """Angle of each joint, rad."""
        return self._get(lib.ULNA_RUN_POSITION)

    @property
    def velocity(self) -> Array:
        """Rate of each joint, rad/s."""
        return self._get(lib.ULNA_RUN_VELOCITY)

    @property
    def acceleration(self) -> Array:
        """Acceleration of each joint, rad/s^2."""
        return self._get(lib.ULNA_RUN_ACCELERATION)

    @property
    def activation(self) -> Array:
        """Activation of each muscle."""
        return self._get(lib.ULNA_RUN_ACTIVATION)

    @property
    def control(self) -> Array:
        """Control of each actuator: motor torque (N m), excitation of a muscle."""
        return self._get(lib.ULNA_RUN_CONTROL)

    @property
    def bias_torque(self) -> Array:
        """Coriolis, centrifugal and gravity torque of each joint, N m."""
        return self._get(lib.ULNA_RUN_BIAS)

    @property
    def damping_torque(self) -> Array:
        """Damping torque on each joint, N m."""
        return self._get(lib.ULNA_RUN_PASSIVE)

    @property
    def constraint_torque(self) -> Array:
        """Torque of friction, limits and contacts on each joint, N m."""
        return self._get(lib.ULNA_RUN_CONSTRAINT)

    @property
    def actuator_torque(self) -> Array:
        """Torque of all actuators on each joint, N m."""
        return self._get(lib.ULNA_RUN_ACTUATOR_TORQUE)

    @property
    def actuator_force(self) -> Array:
        """Force of each actuator; less than 0 where a muscle pulls, N or N m."""
        return self._get(lib.ULNA_RUN_ACTUATOR_FORCE)

    @property
    def actuator_length(self) -> Array:
        """Length of each path, m; of a motor its joint's angle."""
        return self._get(lib.ULNA_RUN_ACTUATOR_LENGTH)

    @property
    def time_s(self) -> float:
        """Simulated time."""
        return float(self._get(lib.ULNA_RUN_TIME_AND_ENERGY)[0])

    @property
    def energy_j(self) -> tuple[float, float]:
        """Energy of weight and energy of motion."""
        _, weight, motion = self._get(lib.ULNA_RUN_TIME_AND_ENERGY)
        return float(weight), float(motion)


# Descriptions ------------------------------------------------------------------------------------


def read_device(path: str | Path) -> dict[str, Any]:
    """Read a device from a TOML file with one ``[[link]]`` table for each link, each on the last.

    A link has ``name``, ``joint``, ``range_deg``, ``mass_kg``, ``centre_m``, ``inertia_kg_m2`` (xx yy
    zz xy xz yz about the centre of mass), and may have ``position_m``, ``quaternion`` (w x y z),
    ``axis``, ``reference_deg``, ``damping_nm_s``, ``friction_nm``, ``motor_limit_nm``.
    ``examples/data/nesm.toml`` is the published device without its straps: a file has none.

    Raises
    ------
    FileError
        When there is no such file or it cannot be read.
    FormatError
        When it is not TOML.
    """
    if not isinstance(path, str | PathLike):
        raise refuse(
            f"device is {path!r}; it must be the path of a TOML file or what read_device gives",
            "device",
        )
    try:
        with open(path, "rb") as file:
            return tomllib.load(file)
    except OSError as failure:
        raise FileError(
            f"{path} cannot be read: {failure.strerror}",
            status="ULNA_ERROR_FILE",
            argument="device",
        ) from failure
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as failure:
        raise FormatError(
            f"{path} is not TOML: {failure}",
            status="ULNA_ERROR_FORMAT",
            detail=str(path),
        ) from failure


def _numbers(link: Mapping[str, Any], key: str, who: str) -> Array:
    size, default = _LINK_KEYS[key]
    value = link.get(key, default)
    if value is None:
        raise FormatError(
            f"{who} has no {key}", status="ULNA_ERROR_FORMAT", argument=key
        )
    given = as_numbers(value)
    row = np.empty(0) if given is None else np.atleast_1d(given)
    if row.shape != (size,):
        raise FormatError(
            f"{key} of {who} must be {size} number{'s' if size > 1 else ''}",
            status="ULNA_ERROR_FORMAT",
            argument=key,
        )
    return row * _DEGREE if key.endswith("_deg") else row


def _name(link: Mapping[str, Any], key: str, who: str) -> str:
    name = link.get(key, "")
    if not isinstance(name, str):
        raise FormatError(
            f"{key} of {who} is {name!r}; it must be a text",
            status="ULNA_ERROR_FORMAT",
            argument=key,
        )
    return name


def _links(device: Mapping[str, Any]) -> tuple[Array, list[str]]:
    for key in device:
        if key != "link":
            raise FormatError(
                f"the device has {key!r}, which no device has; known is [[link]]",
                status="ULNA_ERROR_FORMAT",
                argument="device",
            )
    links = device.get("link", [])
    if not isinstance(links, Sequence) or len(links) < 2:
        raise FormatError(
            "a device needs two [[link]] tables or more", status="ULNA_ERROR_FORMAT"
        )
    rows, names = [], []
    for i, link in enumerate(links):
        if not isinstance(link, Mapping):
            raise FormatError(
                f"link {i + 1} is {link!r}; it must be a table, [[link]]",
                status="ULNA_ERROR_FORMAT",
                argument="link",
            )
        who = f"link {i + 1} ({link.get('name', 'without a name')})"
        unknown = set(link) - set(_LINK_KEYS) - {"name", "joint"}
        if unknown:
            raise FormatError(
                f"{who} has {sorted(unknown)[0]!r}, which no link has; known are name, joint, "
                f"{', '.join(_LINK_KEYS)}",
                status="ULNA_ERROR_FORMAT",
            )
        name, joint = _name(link, "name", who), _name(link, "joint", who)
        if not joint:
            raise FormatError(
                f"{who} has no joint", status="ULNA_ERROR_FORMAT", argument="joint"
            )
        rows.append(np.concatenate([_numbers(link, key, who) for key in _LINK_KEYS]))
        names += [name, joint]
    return np.array(rows), names


def _scene_options(
    device: str | Path | Mapping[str, Any] | None = None,
    *,
    coupling: str = "rigid",
    muscles: str = "fitted",
    muscle_values: ArrayLike | None = None,
    shoulder_muscles: bool = False,
    published_straps: bool = False,
    pronation: bool = False,
    wrist: bool = False,
    upper_factor: float | None = None,
    fore_factor: float | None = None,
    upper_mass_kg: float | None = None,
    fore_mass_kg: float | None = None,
    height_m: float | None = None,
    mass_kg: float | None = None,
    timestep_s: float | None = None,
    solver_tolerance: float | None = None,
    solver_iterations: int | None = None,
    impratio: float | None = None,
    elliptic_cones: bool = False,
) -> Any:
    """A scene as the library takes it; see :func:`exoskeleton`."""
    table, names = None, None
    if device is not None:
        table, names = _links(
            device if isinstance(device, Mapping) else read_device(device)
        )
    _refuse_zero(
        upper_factor=upper_factor,
        fore_factor=fore_factor,
        upper_mass_kg=upper_mass_kg,
        fore_mass_kg=fore_mass_kg,
        height_m=height_m,
        mass_kg=mass_kg,
        timestep_s=timestep_s,
        solver_tolerance=solver_tolerance,
        solver_iterations=solver_iterations,
        impratio=impratio,
    )
    return options(
        "ulna_scene_options",
        coupling=pick(_COUPLINGS, coupling, "coupling"),
        muscles=pick(_MUSCLES, muscles, "muscles"),
        shoulder_muscles=shoulder_muscles,
        published_straps=published_straps,
        pronation=pronation,
        wrist=wrist,
        elliptic=elliptic_cones,
        iterations=solver_iterations,
        upper_factor=upper_factor,
        fore_factor=fore_factor,
        upper_mass_kg=upper_mass_kg,
        fore_mass_kg=fore_mass_kg,
        height_m=height_m,
        mass_kg=mass_kg,
        timestep_s=timestep_s,
        tolerance=solver_tolerance,
        impratio=impratio,
        links=table,
        link_names=names,
        link_name_count=None if names is None else len(names),
        muscle_values=None
        if muscle_values is None
        else numbers(muscle_values, "muscle_values"),
    )


def exoskeleton(
    device: str | Path | Mapping[str, Any] | None = None,
    *,
    coupling: str = "rigid",
    soft: Soft | Mapping[str, Any] | bool = False,
    muscles: str = "fitted",
    muscle_values: ArrayLike | None = None,
    shoulder_muscles: bool = False,
    published_straps: bool = False,
    pronation: bool = False,
    wrist: bool = False,
    upper_factor: float | None = None,
    fore_factor: float | None = None,
    upper_mass_kg: float | None = None,
    fore_mass_kg: float | None = None,
    height_m: float | None = None,
    mass_kg: float | None = None,
    timestep_s: float | None = None,
    solver_tolerance: float | None = None,
    solver_iterations: int | None = None,
    impratio: float | None = None,
    elliptic_cones: bool = False,
) -> Plant:
    """Compile an exoskeleton and an arm.

    Parameters
    ----------
    device : path or mapping, optional
        What :func:`read_device` reads. Default: the published device of four joints.
    coupling : {"rigid", "apart", "exo_only", "arm_only"}
        The arm stands in its links, moves beside the device, or one of them is not there.
    soft : Soft, mapping or True
        Cuffs, straps and soft tissue hold the arm instead; True: with their defaults.
    muscles : {"fitted", "published", "unfitted", "none"}
        Of the elbow: around cylinders with forces fitted to measured torque; the published straight
        lines; around cylinders with published forces; none.
    muscle_values : array_like, shape (muscles, 3), optional
        Peak force (N) and range of each muscle in their place, as :func:`fit_elbow_muscles` gives.
    shoulder_muscles : bool
        Fifteen straight muscles of the shoulder as well.
    published_straps : bool
        Straps of 1.2 kg each, off their centre, as in the published simulation; else 0.05 kg. Of the
        default device: one that is given has no straps.
    pronation, wrist : bool
        Joints of the forearm and of the wrist.
    upper_factor, fore_factor : float, optional
        Of the lengths of the published arm.
    upper_mass_kg, fore_mass_kg : float, optional
        Of the segments without soft tissue. Defaults: 1.761, 0.962.
    height_m, mass_kg : float, optional
        Segments of a person of this height and mass instead.
    timestep_s, solver_tolerance, solver_iterations, impratio, elliptic_cones
        Of the engine. Defaults: 0.005, 1e-11, 200, 10, pyramids.

    Examples
    --------
    >>> exoskeleton(coupling="arm_only").names("joint")[-1]
    'elbow_flexion'
    """
    scene = _scene_options(
        device,
        coupling=coupling,
        muscles=muscles,
        muscle_values=muscle_values,
        shoulder_muscles=shoulder_muscles,
        published_straps=published_straps,
        pronation=pronation,
        wrist=wrist,
        upper_factor=upper_factor,
        fore_factor=fore_factor,
        upper_mass_kg=upper_mass_kg,
        fore_mass_kg=fore_mass_kg,
        height_m=height_m,
        mass_kg=mass_kg,
        timestep_s=timestep_s,
        solver_tolerance=solver_tolerance,
        solver_iterations=solver_iterations,
        impratio=impratio,
        elliptic_cones=elliptic_cones,
    )
    if soft is False or soft is None:
        return Plant(_Plant.make(lib.ulna_plant_new, scene))
    if coupling != "rigid":
        raise refuse(
            f"an arm in soft interfaces cannot be held {coupling!r} as well: leave coupling out",
            "coupling",
        )
    return Plant(_Plant.make(lib.ulna_plant_new_soft, scene, Soft.of(soft)._struct()))


def read_scene(path: str | Path, *, contacts: int = 100) -> Plant:
    """Compile a scene from an MJCF file; a run has room for so many contacts at once.

    Such a plant has no nominal model; :func:`mobilise` takes that of another plant.
    """
    _refuse_zero(contacts=contacts)
    return Plant(_Plant.make(lib.ulna_plant_read, encode(path, "path"), contacts))


# Isometric torque --------------------------------------------------------------------------------


def measured_torque(source: str) -> tuple[Array, Array, Array]:
    """Measured maximum isometric elbow torque: angle (rad), flexion and extension (N m).

    Parameters
    ----------
    source : {"Amis", "Buchanan"}
    """
    tables = {
        "Amis": (
            (0, 30, 60, 90, 120, 145),
            (53, 68, 76, 70, 51, 35),
            (-35, -41, -51, -52, -46, -42),
        ),
        "Buchanan": (
            range(20, 131, 10),
            (40, 44, 50, 56, 62, 69, 74, 78, 78, 75, 68, 57),
            (-18, -23, -30, -35, -40, -45, -48, -50, -51, -50, -47, -41),
        ),
    }
    if source not in tables:
        raise refuse(
            f"source is {source!r}; it must be one of {', '.join(tables)}",
            "source",
        )
    angle, flexion, extension = (
        np.array(list(column), dtype=float) for column in tables[source]
    )
    return angle * _DEGREE, flexion, extension


@dataclass(frozen=True)
class ElbowTorque:
    """What the muscles do at a joint held still at each angle.

    Attributes
    ----------
    angle_rad : ndarray, shape (angles,)
    muscles : tuple of str
    length_m, moment_arm_m : ndarray, shape (angles, muscles)
        Path length; moment arm, positive for flexors.
    active_nm, passive_nm : ndarray, shape (angles, muscles)
        Torque at full activation without the passive part, and the passive part.
    """

    angle_rad: Array
    muscles: tuple[str, ...]
    length_m: Array
    moment_arm_m: Array
    active_nm: Array
    passive_nm: Array

    def __repr__(self) -> str:
        (flexion, at), (extension, there) = self.peaks
        return (
            f"ElbowTorque(flexion {flexion:.1f} N m at {at / _DEGREE:.0f} deg, "
            f"extension {extension:.1f} N m at {there / _DEGREE:.0f} deg)"
        )

    @property
    def _flexors(self) -> NDArray[np.bool_]:
        return self.moment_arm_m.mean(axis=0) > 0

    @property
    def passive(self) -> Array:
        """Torque of all muscles without activation, N m."""
        return self.passive_nm.sum(axis=1)

    @property
    def flexion(self) -> Array:
        """Torque with all flexors at full activation, N m."""
        return self.active_nm[:, self._flexors].sum(axis=1) + self.passive

    @property
    def extension(self) -> Array:
        """Torque with all extensors at full activation, N m, negative."""
        return self.active_nm[:, ~self._flexors].sum(axis=1) + self.passive

    @property
    def peaks(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Largest flexion and extension torque (N m), each with its angle (rad)."""
        top, low = int(np.argmax(self.flexion)), int(np.argmin(self.extension))
        return (
            (float(self.flexion[top]), float(self.angle_rad[top])),
            (float(self.extension[low]), float(self.angle_rad[low])),
        )

    def error(self, source: str) -> tuple[float, float]:
        """Root-mean-square difference to measured flexion and extension torque, N m.

        Angles of the measurement beyond those of the curves are left out.
        """
        angle, flexion, extension = measured_torque(source)
        low, high = self.angle_rad.min() - 1e-9, self.angle_rad.max() + 1e-9
        inside = (angle >= low) & (angle <= high)

        def rms(curve: Array, measured: Array) -> float:
            read = np.interp(angle[inside], self.angle_rad, curve)
            return float(np.sqrt(np.mean((read - measured[inside]) ** 2)))

        return rms(self.flexion, flexion), rms(self.extension, extension)

    def summary(self) -> str:
        """The curves in a few lines."""
        (flexion, at), (extension, there) = self.peaks
        inside = (self.angle_rad >= 30 * _DEGREE - 1e-9) & (
            self.angle_rad <= 110 * _DEGREE + 1e-9
        )
        lines = [
            f"flexion peak    {flexion:7.1f} N m at {at / _DEGREE:3.0f} deg",
            f"extension peak  {extension:7.1f} N m at {there / _DEGREE:3.0f} deg",
        ]
        if inside.any():
            worst = np.abs(self.passive[inside]).max()
            lines.append(
                f"passive torque  {worst:7.1f} N m at most within 30 to 110 deg"
            )
        for source in ("Amis", "Buchanan"):
            errors = self.error(source)
            lines.append(
                f"rms to {source:<9}{errors[0]:7.1f} N m flexion, {errors[1]:.1f} extension"
            )
        return "\n".join(lines)

    def plot(self, axes: Any = None) -> Any:
        """Torque beside measurements, and each muscle's moment arm: :func:`ulna.plot.elbow_torque`."""
        from .plot import elbow_torque

        return elbow_torque(self, axes)


def _degrees(angle: ArrayLike) -> str:
    return " to ".join(f"{value / _DEGREE:.4g}" for value in np.atleast_1d(angle))


def _whole_range(plant: Plant, joint: str) -> Array:
    """0 to 125 degrees in steps of one, as far as the joint goes."""
    low, high = _range_of(plant, joint)
    grid = np.arange(126) * _DEGREE
    inside = grid[(grid >= low - 1e-9) & (grid <= high + 1e-9)]
    if inside.size == 0:
        raise refuse(
            f"joint {joint!r} goes from {_degrees((low, high))} degrees, nowhere between 0 and 125: "
            "give its angles",
            "angle_rad",
        )
    return inside


def _range_of(plant: Plant, joint: str) -> Array:
    """Limits of a joint, rad; none for a joint that there is not, which the library refuses."""
    names = plant.names("joint")
    if joint not in names:
        return np.array([-np.inf, np.inf])
    return plant.range[names.index(joint)]


def _check_within(plant: Plant, joint: str, angle: Array) -> None:
    low, high = _range_of(plant, joint)
    outside = angle[(angle < low - 1e-9) | (angle > high + 1e-9)]
    if outside.size:
        raise refuse(
            f"angle_rad has {outside[0]:.6g} rad, which is {_degrees(outside[0])} degrees: joint "
            f"{joint!r} goes from {_degrees((low, high))} degrees; angles are in rad, "
            "np.radians makes them of degrees",
            "angle_rad",
        )


def _turns(moment_arm: Array) -> bool:
    return bool((np.abs(moment_arm) > 1e-9).any())


def _refuse_idle(plant: Plant, joint: str, muscles: Sequence[str]) -> None:
    """Say at which joint the muscles have a moment arm, where they have none at this one."""
    names = plant.names("joint")
    turned = next(
        (
            name
            for name in sorted(names, key=lambda name: name != "elbow_flexion")
            if _turns(_muscle_rows(plant, name, muscles, np.zeros(1), None)[1])
        ),
        None,
    )
    hint = f": joint={turned!r} is one that they turn" if turned else ""
    raise refuse(f"the muscles have no moment arm at joint {joint!r}{hint}", "joint")


def _muscle_rows(
    plant: Plant,
    joint: str,
    muscles: Sequence[str],
    angle: Array,
    pose_rad: ArrayLike | None,
) -> list[Array]:
    """Length, moment arm, active and passive torque, each angles x muscles."""
    names = [encode(name, "muscles") for name in muscles]
    pose = ffi.NULL if pose_rad is None else view(np.asarray(pose_rad, dtype=float))
    rows = _fill(
        lib.ulna_plant_muscles,
        plant._pointer,
        encode(joint, "joint"),
        ffi.new("const char *[]", names),
        len(names),
        view(angle),
        pose,
        shape=(angle.size, 4 * len(names)),
    )
    return np.split(rows, 4, axis=1)


def isometric_torque(
    plant: Plant | None = None,
    *,
    angle_rad: ArrayLike | None = None,
    joint: str = "elbow_flexion",
    muscles: Sequence[str] | None = None,
    pose_rad: ArrayLike | None = None,
) -> ElbowTorque:
    """The maximum isometric torque test, held still at each angle (Fig. 3 of Tesfazgi 2023).

    Parameters
    ----------
    plant : Plant, optional
        Default: the arm alone with its fitted muscles, shoulder at 90 degrees.
    angle_rad : array_like, optional
        Within the joint's range. Default: 0 to 125 degrees in steps of one, as far as it goes.
    joint : str
        That the muscles turn: the arm's own, "elbow_flexion", also in soft interfaces; on a device
        that holds the arm rigidly the device's last one ("J4").
    muscles : sequence of str, optional
        Default: every muscle whose name is that of a tendon.
    pose_rad : array_like, optional
        Angle of every joint, `joint` among them, which `angle_rad` replaces; default: the plant's
        reference.

    Raises
    ------
    ArgumentError
        For angles outside the joint's range, a joint that no muscle turns, and no muscles.

    Examples
    --------
    >>> isometric_torque()
    ElbowTorque(flexion 76.6 N m at 86 deg, extension -50.5 N m at 66 deg)
    """
    if plant is None:
        plant = exoskeleton(coupling="arm_only")
    if muscles is None:
        tendons = set(plant.names("tendon"))
        muscles = [name for name in plant.names("actuator") if name in tendons]
        if not muscles:
            raise refuse("the plant has no muscles", "plant")
    chosen = names_of(muscles, "muscles")
    if not chosen:
        raise refuse("muscles names no muscle", "muscles")
    if angle_rad is None:
        angle = _whole_range(plant, joint)
    else:
        angle = np.atleast_1d(numbers(angle_rad, "angle_rad"))
        _check_within(plant, joint, angle)
    rows = _muscle_rows(plant, joint, chosen, angle, pose_rad)
    if not _turns(rows[1]):
        _refuse_idle(plant, joint, chosen)
    return ElbowTorque(angle, tuple(chosen), *rows)


def fit_elbow_muscles(
    plant: Plant | None = None,
    *,
    passive_limit_nm: float = 2.0,
    evaluations: int | None = None,
) -> Array:
    """Fit forces and ranges of the elbow's muscles to measured maximum torque.

    One scale for flexors, one for extensors, a range for each muscle; targets are the errors of 12
    and 12 N m to Amis, 6 and 8 N m to Buchanan, peaks of 78 N m at 85 and -51 N m at 67.5 degrees.

    Parameters
    ----------
    plant : Plant, optional
        Default: ``exoskeleton(coupling="arm_only", muscles="unfitted")``.
    passive_limit_nm : float
        Largest passive torque within 30 to 110 degrees.
    evaluations : int, optional
        At most, in each of four rounds. Default: 60000, a second or two in all.

    Returns
    -------
    ndarray, shape (muscles, 3)
        Peak force in N and range, for ``exoskeleton(muscle_values=...)``.
    """
    _refuse_zero(passive_limit_nm=passive_limit_nm)
    if evaluations is not None and evaluations < 1:
        raise refuse(
            "evaluations must be 1 or more",
            "evaluations",
        )
    if plant is None:
        plant = exoskeleton(coupling="arm_only", muscles="unfitted")
    count = sum(name in set(plant.names("tendon")) for name in plant.names("actuator"))
    return _fill(
        lib.ulna_plant_fit_muscles,
        plant._pointer,
        passive_limit_nm,
        evaluations or 0,
        shape=(count, 3),
    )
