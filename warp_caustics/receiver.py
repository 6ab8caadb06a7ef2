"""The receiver on the host: its kind, its height, its bounds. All in float64, relative to nothing but the world."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .errors import InputError
from .height_map import covers, sample_heights, surface_hull
from .scene import ClosedTerrain

if TYPE_CHECKING:
    from .assets import Assets
    from .scene import Scene

DEPTH_SAMPLES = 64
"""Points along each side of the map at which the mean depth is taken."""

SLOPE_STEP = 0.01
"""Step of a difference quotient [pixels]."""

SHALLOWEST = 1e-6
"""Least mean depth of the water [m], so that a scene that is all but dry still has a dispersion relation."""


@dataclass(frozen=True)
class Bounds:
    """Between which heights the receiver lies over a rectangle [m], and how steep it is."""

    lowest: float
    highest: float
    slope: float


def receiver_kind(scene: Scene) -> str:
    """``"plane"``, ``"waves"`` (terrain in closed form), ``"grid"`` (terrain from a file) or ``"mesh"``."""
    if scene.receiver.plane is not None:
        return "plane"
    if scene.receiver.mesh is not None:
        return "mesh"
    return "waves" if isinstance(scene.receiver.terrain, ClosedTerrain) else "grid"


def closed_terrain(scene: Scene) -> ClosedTerrain:
    """The terrain of a scene whose receiver is one in closed form."""
    terrain = scene.receiver.terrain
    assert isinstance(terrain, ClosedTerrain)
    return terrain


def receiver_heights(scene: Scene, assets: Assets, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Height of a plane or a terrain at world coordinates of any one shape [m], without the objects on it.

    Raises
    ------
    InputError
        If the receiver is a mesh, which is no height field.
    """
    x, y = np.broadcast_arrays(np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64))
    kind = receiver_kind(scene)
    if kind == "plane":
        return np.full(x.shape, float(scene.receiver.plane or 0.0))
    if kind == "mesh":
        raise InputError("receiver.mesh: a mesh has no height at a point; a plane or a terrain has")
    if kind == "grid":
        assert assets.terrain is not None
        return sample_heights(assets.terrain, x, y)
    terrain = closed_terrain(scene)
    z = terrain.base + terrain.slope[0] * x + terrain.slope[1] * y
    for wave in terrain.waves:
        z = z + wave.amplitude * np.sin(wave.wavevector[0] * x + wave.wavevector[1] * y + wave.phase)
    return z


def receiver_slopes(scene: Scene, assets: Assets) -> np.ndarray:
    """Slope (z_x, z_y) of a plane or a terrain at the middle of each pixel, ``[rows, columns, 2]``.

    By central differences over a hundredth of a pixel, which float64 takes to ten digits.
    """
    columns, rows = scene.map.resolution
    pixel = np.asarray(scene.map.size, dtype=np.float64) / (columns, rows)
    x = scene.map.origin[0] + (np.arange(columns)[None, :] + 0.5) * pixel[0]
    y = scene.map.origin[1] + (np.arange(rows)[:, None] + 0.5) * pixel[1]
    h = SLOPE_STEP * pixel
    dx = receiver_heights(scene, assets, x + h[0], y) - receiver_heights(scene, assets, x - h[0], y)
    dy = receiver_heights(scene, assets, x, y + h[1]) - receiver_heights(scene, assets, x, y - h[1])
    return np.stack([dx / (2.0 * h[0]), dy / (2.0 * h[1])], axis=-1)


def receiver_bounds(scene: Scene, assets: Assets, low: np.ndarray, high: np.ndarray) -> Bounds:
    """Bounds of the receiver, objects aside, over the rectangle from ``low`` to ``high`` (x, y) [m]."""
    kind = receiver_kind(scene)
    if kind == "plane":
        plane = float(scene.receiver.plane or 0.0)
        return Bounds(plane, plane, 0.0)
    if kind == "mesh":
        assert assets.mesh is not None
        z = assets.mesh.vertices[:, 2]
        return Bounds(float(z.min()), float(z.max()), np.inf)
    if kind == "grid":
        assert assets.terrain is not None
        hull = surface_hull(assets.terrain)
        return Bounds(hull.lowest, hull.highest, hull.slope)
    terrain = closed_terrain(scene)
    corners = [
        terrain.base + terrain.slope[0] * x + terrain.slope[1] * y for x in (low[0], high[0]) for y in (low[1], high[1])
    ]
    swing = sum(abs(wave.amplitude) for wave in terrain.waves)
    steepest = np.hypot(*terrain.slope) + sum(abs(w.amplitude) * np.hypot(*w.wavevector) for w in terrain.waves)
    return Bounds(min(corners) - swing, max(corners) + swing, float(steepest))


def rest_depth(scene: Scene, assets: Assets) -> float:
    """Mean depth of the water at rest over the wet part of the map [m]: that of the dispersion relation."""
    origin, size = np.asarray(scene.map.origin), np.asarray(scene.map.size)
    if receiver_kind(scene) == "mesh":
        return max(scene.water.level - receiver_bounds(scene, assets, origin, origin + size).lowest, SHALLOWEST)
    at = (np.arange(DEPTH_SAMPLES) + 0.5) / DEPTH_SAMPLES
    z = receiver_heights(scene, assets, origin[0] + at[None, :] * size[0], origin[1] + at[:, None] * size[1])
    depth = scene.water.level - z
    return float(max(depth[depth > 0.0].mean(), SHALLOWEST)) if (depth > 0.0).any() else SHALLOWEST


def check_covered(scene: Scene, assets: Assets) -> None:
    """Refuse a map that reaches past the terrain's file.

    Raises
    ------
    InputError
        With both rectangles.
    """
    grid = assets.terrain
    if grid is not None and not covers(grid, scene.map.origin, scene.map.size):
        raise InputError(
            f"map: reaches past receiver.terrain, which covers {_rectangle(grid.origin, grid.size)}; "
            f"the map is {_rectangle(scene.map.origin, scene.map.size)}"
        )


def _rectangle(origin: tuple[float, float], size: tuple[float, float]) -> str:
    return f"x {origin[0]:g} to {origin[0] + size[0]:g} m, y {origin[1]:g} to {origin[1] + size[1]:g} m"
