"""A plan-view map seen by the camera: the eye's G-buffer of the receiver, and the map looked up where it lands."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .assets import TriangleMesh
from .eye import eye_view
from .g_buffer import rasterize
from .receiver import receiver_heights, receiver_kind
from .triangles import mesh_triangles

if TYPE_CHECKING:
    from .assets import Assets
    from .scene import Scene


def look(scene: Scene, assets: Assets, caustic_map: np.ndarray, device: str) -> np.ndarray | None:
    """Irradiance on the surface that each pixel of the camera sees, along straight lines through the water.

    Parameters
    ----------
    scene, assets
        The scene and its files.
    caustic_map : ndarray
        Flux per horizontal area, ``[rows, columns]`` or ``[rows, columns, 3]``.
    device : str
        Where to rasterize.

    Returns
    -------
    ndarray or None
        float32 ``[camera rows, camera columns]`` (and colours), row 0 at the bottom of the picture, 0 where the eye
        sees no part of the map; None without a camera. Where one part of the receiver hides another from above, both
        get the light of both, since the map adds them up.
    """
    camera = scene.camera
    if camera is None:
        return None
    view = eye_view(camera)
    origin = (*scene.map.origin, scene.water.level)
    triangles = mesh_triangles(*receiver_meshes(scene, assets), origin=origin, device=device)
    seen = rasterize(triangles, view, normals="face", ids=False)
    assert seen.depth is not None and seen.normal is not None
    points = view.projection().positions(seen.depth.numpy())
    # Light per horizontal area, on a surface that leans: the same light on more area.
    lean = np.abs(seen.normal.numpy()[..., 2])
    light = _sample(scene, caustic_map, points)
    return np.asarray(light * (lean if light.ndim == 2 else lean[..., None]), dtype=np.float32)


def receiver_meshes(scene: Scene, assets: Assets) -> list[TriangleMesh]:
    """Triangles of all that light can land on over the map, in world coordinates; the objects come last."""
    meshes = [mesh for mesh in (assets.mesh, assets.objects) if mesh is not None]
    kind = receiver_kind(scene)
    if kind == "mesh":
        return meshes
    columns, rows = (1, 1) if kind == "plane" else scene.map.resolution
    x = scene.map.origin[0] + scene.map.size[0] * np.arange(columns + 1) / columns
    y = scene.map.origin[1] + scene.map.size[1] * np.arange(rows + 1) / rows
    x, y = np.meshgrid(x, y)
    vertices = np.stack([x, y, receiver_heights(scene, assets, x, y)], axis=-1).reshape(-1, 3)
    corner = np.arange((rows + 1) * (columns + 1), dtype=np.int32).reshape(rows + 1, columns + 1)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, :-1], corner[1:, 1:]
    triangles = np.stack([a, b, d, a, d, c], axis=-1).reshape(-1, 3)
    return [TriangleMesh(vertices, triangles), *meshes]


def _sample(scene: Scene, image: np.ndarray, points: np.ndarray) -> np.ndarray:
    """The map at points ``[..., 3]``, bilinear between pixel centres; 0 beside it."""
    columns, rows = scene.map.resolution
    with np.errstate(invalid="ignore"):
        at = (points[..., :2] - scene.map.origin) / scene.map.size * (columns, rows)
        inside = np.logical_and(at >= 0.0, at <= (columns, rows)).all(axis=-1)
    at = np.clip(np.where(np.expand_dims(inside, -1), at, 0.0) - 0.5, 0.0, (columns - 1.0, rows - 1.0))
    low = np.minimum(at.astype(int), (max(columns - 2, 0), max(rows - 2, 0)))
    high = np.minimum(low + 1, (columns - 1, rows - 1))
    u, v = np.moveaxis(at - low, -1, 0)
    weights = np.stack([(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v]) * inside
    corners = [image[y, x] for y in (low[..., 1], high[..., 1]) for x in (low[..., 0], high[..., 0])]
    return np.asarray(sum(w[(...,) + (None,) * (image.ndim - 2)] * c for w, c in zip(weights, corners, strict=True)))
