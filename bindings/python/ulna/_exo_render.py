"""Pictures and films of a scene, drawn without a window; `ulna.exo` offers them."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._call import (
    Handle,
    check,
    constants,
    encode,
    ffi,
    lib,
    options,
    out_array,
    text,
    view,
)
from .record import Record, refuse

if TYPE_CHECKING:
    from ._exo_assessment import Assessment
    from .exo import Plant, Run

Array = NDArray[np.float64]
Pixels = NDArray[np.uint8]

_BACKENDS = dict(constants("ULNA_BACKEND_"))
_LIMBS = ("upper", "fore")
_INK = (0.10, 0.45, 0.35)


class _Renderer(Handle):
    kind = "ulna_renderer"
    __slots__ = ()


class _Video(Handle):
    kind = "ulna_video"
    __slots__ = ()


def _backend(name: str) -> int:
    if name not in _BACKENDS:
        raise refuse(f"backend is {name!r}; it must be one of {', '.join(_BACKENDS)}", "backend")
    return _BACKENDS[name]


def render_available(*, backend: str = "any") -> tuple[bool, str]:
    """Whether pictures can be drawn here, and by what, or what is missing in one sentence.

    Parameters
    ----------
    backend : {"any", "egl", "osmesa"}

    Examples
    --------
    >>> from ulna import exo
    >>> there, words = exo.render_available()
    >>> words.startswith(("EGL", "OSMesa")) if there else "Debian package" in words
    True
    """
    available = ffi.new("int32_t *")
    words = text(lib.ulna_render_available, _backend(backend), available)
    return bool(available[0]), words


class Renderer:
    """Draws runs of a plant, one picture after the other, in one thread at a time.

    Parameters
    ----------
    plant : Plant
        One that was made from descriptions is drawn as a device and an arm; one from an MJCF file
        by its own shapes and lights.
    size : (int, int)
        Width and height in pixels.
    camera : str
        "": oblique, on the inside of the arm, where its muscles are seen; "device": on the device's
        side; "side", "front", "back", "top"; or the name of a camera of the scene.
    azimuth_rad, elevation_rad : float, optional
        Of the direction of view instead of the camera's: 0 and 0 look forward, along x.
    look_at_m : array_like, shape (3,), optional
        Default: the middle of what the first picture shows.
    distance_m : float, optional
        From that point. Default: so that everything is seen.
    whole_range : bool
        The default camera leaves room for the elbow's whole range, for films.
    samples : int
        Along each side of a pixel, 1 to 4: more is smoother and slower.
    grid, person, skin, interfaces : bool
        Lines of 0.1 m on the floor; a figure whose arm it is; a translucent cover of the arm; tissue,
        straps and forces of soft interfaces.
    force_scale_m_n : float
        Length of arrows for forces; 0: none.
    backend : {"any", "egl", "osmesa"}

    Examples
    --------
    >>> from ulna import exo
    >>> plant = exo.exoskeleton()
    >>> if exo.render_available()[0]:
    ...     picture = exo.Renderer(plant, size=(64, 48)).draw(plant.run())
    ...     assert picture.shape == (48, 64, 3)
    """

    def __init__(
        self,
        plant: Plant,
        *,
        size: tuple[int, int] = (1280, 960),
        camera: str = "",
        azimuth_rad: float | None = None,
        elevation_rad: float | None = None,
        look_at_m: ArrayLike | None = None,
        distance_m: float | None = None,
        whole_range: bool = False,
        samples: int = 2,
        grid: bool = True,
        person: bool = True,
        skin: bool = True,
        interfaces: bool = True,
        force_scale_m_n: float = 0.0015,
        backend: str = "any",
    ) -> None:
        self.plant = plant
        width, height = _size(size)
        if samples < 1:
            raise refuse(f"samples is {samples!r}; it must be between 1 and 4", "samples")
        if distance_m is not None and not distance_m > 0:
            raise refuse(f"distance_m is {distance_m!r}; it must be positive", "distance_m")
        if not force_scale_m_n >= 0:
            raise refuse(
                f"force_scale_m_n is {force_scale_m_n!r}; it must be 0 or more",
                "force_scale_m_n",
            )
        if (azimuth_rad is None) != (elevation_rad is None):
            raise refuse(
                "a direction of view needs azimuth_rad and elevation_rad",
                "elevation_rad",
            )
        struct = options(
            "ulna_render_options",
            width=width,
            height=height,
            samples=samples,
            backend=_backend(backend),
            no_grid=not grid,
            no_person=not person,
            no_skin=not skin,
            no_interfaces=not interfaces,
            whole_range=whole_range,
            camera=camera or None,
            direction=None if azimuth_rad is None else np.array([azimuth_rad, elevation_rad]),
            look_at=None if look_at_m is None else np.asarray(look_at_m, dtype=float),
            distance_m=distance_m,
            force_scale_m_n=force_scale_m_n or -1.0,
        )
        self._handle = _Renderer.make(lib.ulna_renderer_new, plant._pointer, struct)

    def __repr__(self) -> str:
        width, height = self.size
        return f"<Renderer {width} x {height}, {self.backend}>"

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        width, height = ffi.new("int32_t *"), ffi.new("int32_t *")
        check(lib.ulna_renderer_size(self._handle.pointer, width, height))
        return width[0], height[0]

    @property
    def backend(self) -> str:
        """What it draws with."""
        return text(lib.ulna_renderer_text, self._handle.pointer)

    def draw(
        self, run: Run, shapes: ArrayLike | None = None, forces: ArrayLike | None = None
    ) -> Pixels:
        """Draw a run as its last step or `forward` left it.

        Parameters
        ----------
        run : Run
            Of the renderer's plant, or of one with other numbers.
        shapes : array_like, shape (shapes, 12), optional
            What else there is in the world, see :func:`arrows` and :func:`spheres`.
        forces : array_like, shape (interfaces, 6), optional
            Of cuff and strap on the limb in the cuff's frame, N. Default: the run's own.

        Returns
        -------
        ndarray of uint8, shape (height, width, 3)
            Red, green, blue; the top row first.
        """
        width, height = self.size
        pixels = np.empty((height, width, 3), dtype=np.uint8)
        count = ffi.new("int64_t *")
        check(
            lib.ulna_renderer_draw(
                self._handle.pointer,
                run._handle.pointer,
                _rows(shapes, 12),
                _rows(forces, 6),
                ffi.cast("char *", pixels.ctypes.data),
                pixels.size,
                count,
            )
        )
        return pixels

    @property
    def depth_m(self) -> Array:
        """Distance along the direction of view in the last picture, shape (height, width).

        Infinite for floor and background.
        """
        width, height = self.size
        return out_array(lib.ulna_renderer_depth, self._handle.pointer, shape=(height, width))


def _size(size: tuple[int, int]) -> tuple[int, int]:
    pair = tuple(size)
    if len(pair) != 2 or not all(isinstance(n, (int, np.integer)) and n > 0 for n in pair):
        raise refuse(f"size is {size!r}; it must be two positive whole numbers", "size")
    return int(pair[0]), int(pair[1])


def _rows(values: ArrayLike | None, columns: int) -> Any:
    if values is None:
        return ffi.NULL
    rows = np.asarray(values, dtype=float)
    return (
        ffi.NULL if rows.size == 0 else view(rows.reshape(-1, columns) if rows.ndim == 1 else rows)
    )


def _shape_rows(
    kind: int, begin: ArrayLike, end: ArrayLike, radius: float, colour: Sequence[float]
) -> Array:
    first = np.atleast_2d(np.asarray(begin, dtype=float))
    last = np.atleast_2d(np.asarray(end, dtype=float))
    paint = tuple(colour) if len(colour) == 4 else (*colour, 1.0)
    if first.shape[1] != 3 or first.shape != last.shape or len(paint) != 4:
        raise refuse(
            "points must be rows of three numbers, a colour three or four between 0 and 1",
            "points",
        )
    rows = np.empty((len(first), 12))
    rows[:, 0] = kind
    rows[:, 1:4], rows[:, 4:7], rows[:, 7], rows[:, 8:] = first, last, radius, paint
    return rows


def arrows(
    points_m: ArrayLike,
    forces_n: ArrayLike,
    *,
    scale_m_n: float = 0.0015,
    radius_m: float = 0.006,
    colour: Sequence[float] = _INK,
) -> Array:
    """Forces at points in the world as shapes to draw; none for a force of less than 0.1 mm.

    Examples
    --------
    >>> from ulna import exo
    >>> exo.arrows([0, 0, 0], [0, 0, 100.0])[0, 4:7].round(2)
    array([0.  , 0.  , 0.15])
    """
    points = np.atleast_2d(np.asarray(points_m, dtype=float))
    ways = scale_m_n * np.atleast_2d(np.asarray(forces_n, dtype=float))
    if points.shape != ways.shape:
        raise refuse("there must be a force for each point", "forces_n")
    seen = ~(np.linalg.norm(ways, axis=1) < 1e-4)
    return _shape_rows(
        lib.ULNA_SHAPE_ARROW, points[seen], points[seen] + ways[seen], radius_m, colour
    )


def spheres(
    points_m: ArrayLike, *, radius_m: float = 0.005, colour: Sequence[float] = _INK
) -> Array:
    """Points in the world as shapes to draw.

    Examples
    --------
    >>> from ulna import exo
    >>> exo.spheres([[0, 0, 0], [0, 0, 0.1]]).shape
    (2, 12)
    """
    return _shape_rows(lib.ULNA_SHAPE_SPHERE, points_m, points_m, radius_m, colour)


def write_png(path: str | os.PathLike[str], pixels: ArrayLike) -> None:
    """Write a picture, an array of uint8 of shape (height, width, 3), as PNG."""
    rgb = _pixels(pixels)
    height, width = rgb.shape[:2]
    data = ffi.cast("const char *", rgb.ctypes.data)
    check(lib.ulna_image_write_png(encode(os.fspath(path), "path"), data, width, height))


def _pixels(values: ArrayLike) -> Pixels:
    rgb = np.ascontiguousarray(values)
    if rgb.dtype != np.uint8 or rgb.ndim != 3 or rgb.shape[2] != 3 or rgb.size == 0:
        raise refuse(
            f"a picture is an array of uint8 of shape (height, width, 3), not of {rgb.dtype} of "
            f"shape {rgb.shape}",
            "pixels",
        )
    return rgb


class Video:
    """A film (MP4) that is written picture by picture; ends with the ``with`` block.

    Examples
    --------
    >>> import numpy as np, tempfile, pathlib
    >>> from ulna import exo
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder) / "grey.mp4"
    ...     with exo.Video(path, size=(64, 48), rate_hz=25) as film:
    ...         for level in range(10):
    ...             film.add(np.full((48, 64, 3), 20 * level, dtype=np.uint8))
    ...     path.stat().st_size > 500
    True
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        *,
        size: tuple[int, int],
        rate_hz: float = 25.0,
    ) -> None:
        width, height = _size(size)
        self.path = Path(path)
        self.frames = 0
        self._handle = _Video.make(
            lib.ulna_video_new, encode(os.fspath(path), "path"), width, height, rate_hz
        )

    def add(self, pixels: ArrayLike) -> None:
        """Add a picture of the film's size."""
        rgb = _pixels(pixels)
        height, width = rgb.shape[:2]
        data = ffi.cast("const char *", rgb.ctypes.data)
        check(lib.ulna_video_add(self._handle.pointer, data, width, height))
        self.frames += 1

    def close(self) -> None:
        """End the film; again does nothing."""
        check(lib.ulna_video_close(self._handle.pointer))

    def __enter__(self) -> Video:
        return self

    def __exit__(self, kind: Any, value: Any, traceback: Any) -> None:
        if kind is None:
            self.close()
            return
        # What broke off is no film.
        lib.ulna_video_close(self._handle.pointer)
        self.path.unlink(missing_ok=True)


# Assessments -------------------------------------------------------------------------------------


def film(
    plant: Plant,
    done: Assessment | Record,
    path: str | os.PathLike[str],
    *,
    rate_hz: float = 25.0,
    speed: float = 1.0,
    size: tuple[int, int] = (960, 720),
    **look: Any,
) -> int:
    """Write an assessment as a film (MP4) from its record.

    Parameters
    ----------
    plant : Plant
        That was assessed.
    done : Assessment or Record
        With ``theta_<joint>`` or ``q_<joint>`` for every joint of the plant. Muscles are coloured by
        ``a_<muscle>``; forces of soft interfaces are arrows.
    path : path
        Ends with .mp4.
    rate_hz : float
        Pictures a second.
    speed : float
        2: twice as fast as it was.
    size : (int, int)
        Width and height in pixels, even numbers.
    **look
        What :class:`Renderer` takes: camera, samples, person ...

    Returns
    -------
    int
        Pictures written.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> from ulna import exo
    >>> plant = exo.exoskeleton()
    >>> log = exo.mobilise(plant)
    >>> if exo.render_available()[0]:
    ...     with tempfile.TemporaryDirectory() as folder:
    ...         path = pathlib.Path(folder) / "elbow.mp4"
    ...         count = exo.film(plant, log, path, rate_hz=2, size=(64, 48))
    ...     assert count == 12
    """
    record = _record_of(done)
    for name, value in (("rate_hz", rate_hz), ("speed", speed)):
        if not 0 < value < float("inf"):
            raise refuse(f"{name} is {value!r}; it must be positive", name)
    states = _States(plant, record)
    time = record.time - record.time[0]
    count = max(1, int(np.floor(time[-1] * rate_hz / speed + 1e-9)))
    rows = np.searchsorted(time, np.arange(count) * speed / rate_hz - 1e-9)
    renderer = Renderer(plant, size=size, **{"whole_range": True, **look})
    run = plant.run()
    with Video(path, size=size, rate_hz=rate_hz) as video:
        for row in rows:
            states.put(run, int(row))
            video.add(renderer.draw(run, forces=states.forces(int(row))))
        return video.frames


def _record_of(done: Assessment | Record) -> Record:
    record = done if isinstance(done, Record) else getattr(done, "record", None)
    if not isinstance(record, Record):
        raise refuse("there is no record to draw, because the movement did not begin", "done")
    return record


class _States:
    """States of a plant by the rows of a record."""

    def __init__(self, plant: Plant, record: Record) -> None:
        self.angle = np.column_stack(
            [_channel(record, ("theta_" + j, "q_" + j)) for j in plant.names("joint")]
        )
        tendons = set(plant.names("tendon"))
        muscles = [name for name in plant.names("actuator") if name in tendons]
        there = [name for name in muscles if "a_" + name in record]
        self.activation = (
            np.column_stack([record["a_" + name] for name in muscles])
            if muscles and len(there) == len(muscles)
            else None
        )
        names = [
            [f"F_{limb}_{part}_{axis}" for part in ("cuff", "strap") for axis in "xyz"]
            for limb in _LIMBS
        ]
        full = all(name in record for row in names for name in row)
        self.force = (
            np.stack([[record[name] for name in row] for row in names], axis=0) if full else None
        )

    def put(self, run: Run, row: int) -> None:
        run.set(position=self.angle[row])
        if self.activation is not None:
            run.set(activation=self.activation[row])
        run.forward()

    def forces(self, row: int) -> Array | None:
        return None if self.force is None else self.force[:, :, row]


def _channel(record: Record, names: Sequence[str]) -> Array:
    for name in names:
        if name in record:
            return record[name]
    raise refuse(f"the record has no channel {' or '.join(names)}", "done")


def render(
    plant: Plant,
    run: Run | None,
    path: str | os.PathLike[str] | None,
    shapes: ArrayLike | None,
    look: Mapping[str, Any],
) -> Pixels:
    """A picture of a run; see Plant.render."""
    if path is not None and Path(path).suffix.lower() != ".png":
        raise refuse(f"the path {os.fspath(path)} must end with .png", "path")
    pixels = Renderer(plant, **look).draw(plant.run() if run is None else run, shapes)
    if path is not None:
        write_png(path, pixels)
    return pixels
