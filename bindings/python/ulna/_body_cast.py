"""Rays against rounded boxes, cylinders, capsules and balls: the picture of a body as an image.

Parallel rays, so lengths along the picture are true. Each shape is a distance function along which
the rays step (J. C. Hart, "Sphere tracing", 1996); of what a ray meets the nearest is seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ._body_scene import BodyLink

# A ray that grazes a shape approaches it slowly; what it misses by then is less than a pixel.
_STEPS = 48


@dataclass(frozen=True)
class Solid:
    """A shape in the world with its colour (sRGB from 0 to 1)."""

    link: BodyLink
    centre_m: np.ndarray
    axes: np.ndarray  # columns: axes of the shape in the world
    colour: np.ndarray
    through: bool = False  # shines through what lies before it


class View:
    """Parallel projection from an azimuth (0 from ahead, 90 from the left) and an elevation."""

    def __init__(self, azimuth_deg: float, elevation_deg: float) -> None:
        a, e = np.radians([azimuth_deg, elevation_deg])
        self.towards = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        self.right = np.array([-np.sin(a), np.cos(a), 0.0])
        self.up = np.cross(self.towards, self.right)

    def project(self, points_m: Any) -> np.ndarray:
        """(..., 2) places in the picture, in metres to the right and up."""
        points = np.asarray(points_m, dtype=float)
        return np.stack([points @ self.right, points @ self.up], axis=-1)


def corner_radius(link: BodyLink) -> float:
    """How far edges are rounded: as much as looks like a limb and keeps the extents, in metres."""
    share = {"box": 0.42, "cylinder": 0.30}.get(link.shape, 0.0)
    return share * float(link.half_extents_m.min())


def image(
    solids: Sequence[Solid],
    view: View,
    window_m: tuple[float, float, float, float],
    pixels: tuple[int, int],
    floor_m: float | None,
) -> np.ndarray:
    """RGBA (rows, columns, 4) from 0 to 1 of what the window (left, right, bottom, top) shows.

    Nothing is drawn where there is nothing, so it lies on any ground. With a floor, a soft shadow
    falls on it.
    """
    left, right, bottom, top = window_m
    columns, rows = (2 * n for n in pixels)  # four rays a pixel
    x = left + (np.arange(columns) + 0.5) * (right - left) / columns
    y = top - (np.arange(rows) + 0.5) * (top - bottom) / rows
    depth = np.full((rows, columns), -np.inf)
    which = np.full((rows, columns), -1)
    colour = np.zeros((rows, columns, 3))
    for index, solid in enumerate(solids):
        if not solid.through:
            _cast(index, solid, view, x, y, depth, which, colour)
    colour *= np.where(_outline(which, depth), 0.42, 1.0)[..., None]
    inner = [index for index, solid in enumerate(solids) if solid.through]
    if inner:
        nearest, ball = np.full_like(depth, -np.inf), np.full_like(which, -1)
        paint = np.zeros_like(colour)
        for index in inner:
            _cast(index, solids[index], view, x, y, nearest, ball, paint)
        paint *= np.where(_outline(ball, nearest), 0.42, 1.0)[..., None]
        share = np.where(ball < 0, 0.0, np.where(nearest > depth, 1.0, 0.6))[..., None]
        colour = share * paint + (1 - share) * colour
        which = np.where(ball >= 0, ball, which)

    alpha = (which >= 0).astype(float)
    if floor_m is not None and solids:
        shade = _shadow(solids, view, x[::2], y[::2], floor_m).repeat(2, axis=0).repeat(2, axis=1)
        alpha = np.where(which >= 0, 1.0, shade)
    # Averaging needs colours weighed by how much of them there is.
    weighed = np.concatenate([colour * alpha[..., None], alpha[..., None]], axis=-1)
    small = weighed.reshape(rows // 2, 2, columns // 2, 2, 4).mean(axis=(1, 3))
    cover = small[..., 3:]
    small[..., :3] = np.divide(
        small[..., :3], cover, out=np.zeros_like(small[..., :3]), where=cover > 0
    )
    return np.clip(small, 0.0, 1.0)


def _cast(
    index: int,
    solid: Solid,
    view: View,
    x: np.ndarray,
    y: np.ndarray,
    depth: np.ndarray,
    which: np.ndarray,
    colour: np.ndarray,
) -> None:
    """Draw one shape over what is there where it is nearer."""
    half = solid.link.half_extents_m
    middle = view.project(solid.centre_m)
    reach_x = np.abs(view.right @ solid.axes) @ half
    reach_y = np.abs(view.up @ solid.axes) @ half
    columns = np.flatnonzero(np.abs(x - middle[0]) <= reach_x)
    rows = np.flatnonzero(np.abs(y - middle[1]) <= reach_y)
    if columns.size == 0 or rows.size == 0:
        return
    window = np.ix_(rows, columns)
    ahead, hit, points = _march(
        solid, view, x[columns] - middle[0], y[rows] - middle[1], x[1] - x[0]
    )
    ahead = ahead + solid.centre_m @ view.towards
    seen = hit & (ahead > depth[window])
    if not seen.any():
        return
    normal = _normals(solid.link, points[:, seen]) @ solid.axes.T
    light = 0.35 * view.right + 0.55 * view.up + 0.75 * view.towards
    # Mostly even light, so that a colour is that of the bar; its fall tells the form.
    bright = 0.74 + 0.26 * np.clip(normal @ light, 0, 1) + 0.04 * normal[:, 2]
    bright *= 0.82 + 0.20 * np.clip(normal @ view.towards, 0, 1)
    for target, values in (
        (depth, ahead[seen]),
        (which, np.full(int(seen.sum()), index)),
        (colour, np.clip(bright[:, None] * solid.colour, 0, 1)),
    ):
        part = target[window]
        part[seen] = values
        target[window] = part


def _march(
    solid: Solid, view: View, x: np.ndarray, y: np.ndarray, pixel: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Along every ray: how far towards the eye it meets the shape, whether, and where on it.

    The last is (3, rows, columns), in the axes of the shape.
    """
    far = float(np.linalg.norm(solid.link.half_extents_m))
    right, up, towards = (one @ solid.axes for one in (view.right, view.up, view.towards))
    start = (
        x[None, None, :] * right[:, None, None]
        + y[None, :, None] * up[:, None, None]
        + far * towards[:, None, None]
    ).reshape(3, -1)
    gone = np.zeros(start.shape[1])
    hit = np.zeros(start.shape[1], dtype=bool)
    active = np.arange(start.shape[1])
    points = start.copy()
    for _ in range(_STEPS):
        distance = _distance(solid.link, points)
        near = distance < 0.25 * pixel
        hit[active[near]] = True
        gone[active] += np.where(near, 0.0, distance)
        stay = ~near & (gone[active] <= 2 * far)
        active = active[stay]
        if active.size == 0:
            break
        points = points[:, stay] - distance[stay] * towards[:, None]
    shape = (y.size, x.size)
    met = (start - gone * towards[:, None]).reshape(3, *shape)
    return (far - gone).reshape(shape), hit.reshape(shape), met


def _distance(link: BodyLink, points: np.ndarray) -> np.ndarray:
    """Distance of points (3, n) in the axes of the shape to its surface; negative inside."""
    x, y, z = points
    size = link.size_m
    if link.shape == "sphere":
        return np.sqrt(x * x + y * y + z * z) - size[0]
    if link.shape == "capsule":
        straight = size[1] / 2 - size[0]
        z = z - np.clip(z, -straight, straight)
        return np.sqrt(x * x + y * y + z * z) - size[0]
    radius = corner_radius(link)
    half = link.half_extents_m - radius
    if link.shape == "box":
        beyond = [np.abs(x) - half[0], np.abs(y) - half[1], np.abs(z) - half[2]]
    else:
        beyond = [np.hypot(x, y) - half[0], np.abs(z) - half[2]]
    outside = np.sqrt(sum(np.maximum(one, 0) ** 2 for one in beyond))
    inside = beyond[0]
    for one in beyond[1:]:
        inside = np.maximum(inside, one)
    return outside + np.minimum(inside, 0) - radius


def _normals(link: BodyLink, points: np.ndarray) -> np.ndarray:
    """Outward unit normals (n, 3) in the axes of the shape, from the slope of the distance."""
    step = 1e-4
    slope = np.stack(
        [
            _distance(link, points + step * axis[:, None])
            - _distance(link, points - step * axis[:, None])
            for axis in np.eye(3)
        ],
        axis=-1,
    )
    return slope / np.maximum(np.linalg.norm(slope, axis=-1, keepdims=True), 1e-12)


def _outline(which: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """Pixels of a shape at which something farther, or nothing, begins."""
    line = np.zeros(which.shape, dtype=bool)
    for axis in (0, 1):
        one = np.moveaxis(which, axis, 0)
        far = np.moveaxis(depth, axis, 0)
        marked = np.moveaxis(line, axis, 0)
        differs = one[1:] != one[:-1]
        marked[1:] |= differs & (far[1:] > far[:-1])
        marked[:-1] |= differs & (far[:-1] > far[1:])
    return line & (which >= 0)


def _shadow(
    solids: Sequence[Solid], view: View, x: np.ndarray, y: np.ndarray, floor_m: float
) -> np.ndarray:
    """How dark the floor is in every pixel: what a high, wide lamp leaves in the shade."""
    if view.towards[2] < 0.03:  # along the floor it is a line
        return np.zeros((y.size, x.size))
    above = View(60.0, 74.0)
    middles = np.array([above.project(one.centre_m) for one in solids])
    reach = max(float(np.linalg.norm(one.link.half_extents_m)) for one in solids) + 0.25
    low, high = middles.min(axis=0) - reach, middles.max(axis=0) + reach
    step = 0.012
    across = np.arange(low[0], high[0], step)
    along = np.arange(low[1], high[1], step)
    mask = np.zeros((along.size, across.size))
    for solid in solids:
        middle = above.project(solid.centre_m)
        half = solid.link.half_extents_m
        columns = np.flatnonzero(
            np.abs(across - middle[0]) <= np.abs(above.right @ solid.axes) @ half
        )
        rows = np.flatnonzero(np.abs(along - middle[1]) <= np.abs(above.up @ solid.axes) @ half)
        if columns.size and rows.size:
            hit = _march(solid, above, across[columns] - middle[0], along[rows] - middle[1], step)[
                1
            ]
            mask[np.ix_(rows, columns)] = np.maximum(mask[np.ix_(rows, columns)], hit)
    for _ in range(3):  # three boxes make a bell
        for axis in (0, 1):
            total = np.cumsum(np.pad(mask, [(5, 4) if k == axis else (0, 0) for k in (0, 1)]), axis)
            total = np.moveaxis(total, axis, 0)
            first = np.concatenate([np.zeros_like(total[:1]), total[:-9]])
            mask = np.moveaxis((total[8:] - first) / 9, 0, axis)
    # From a pixel along its ray down to the floor.
    gx, gy = np.meshgrid(x, y)
    away = (floor_m - gy * view.up[2]) / view.towards[2]
    ground = gx[..., None] * view.right + gy[..., None] * view.up + away[..., None] * view.towards
    place = above.project(ground)
    column = np.round((place[..., 0] - low[0]) / step).astype(int)
    row = np.round((place[..., 1] - low[1]) / step).astype(int)
    inside = (column >= 0) & (column < across.size) & (row >= 0) & (row < along.size)
    dark = mask[np.clip(row, 0, along.size - 1), np.clip(column, 0, across.size - 1)]
    return np.where(inside, 0.26 * dark, 0.0)
