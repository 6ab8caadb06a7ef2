"""A plan-view map seen by the camera: the eye's G-buffer of the receiver, and the map looked up where it lands."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from .assets import TriangleMesh
from .eye import eye_view
from .g_buffer import rasterize
from .receiver import receiver_heights, receiver_kind
from .triangles import mesh_triangles

if TYPE_CHECKING:
    from .assets import Assets
    from .scene import Camera, Scene


class Gaze:
    """Where on the map each pixel of a camera looks, along straight lines through the water.

    Parameters
    ----------
    scene, assets
        The scene and its files.
    camera : Camera
        Its eye.
    device : str
        Where to rasterize.
    samples : int
        Lines of sight along each side of a pixel, whose light is averaged.

    Attributes
    ----------
    inside : ndarray
        bool ``[camera rows, camera columns]``: all lines of sight end on the map.
    """

    def __init__(self, scene: Scene, assets: Assets, camera: Camera, device: str, samples: int = 1) -> None:
        columns, rows = camera.resolution
        view = replace(eye_view(camera), resolution=(columns * samples, rows * samples))
        origin = (*scene.map.origin, scene.water.level)
        triangles = mesh_triangles(*receiver_meshes(scene, assets), origin=origin, device=device)
        seen = rasterize(triangles, view, normals="face", ids=False)
        assert seen.depth is not None and seen.normal is not None
        points = view.projection().positions(seen.depth.numpy())
        with np.errstate(invalid="ignore"):
            at = (points[..., :2] - scene.map.origin) / scene.map.size
            hit = np.asarray(np.logical_and(at >= 0.0, at <= 1.0).all(axis=-1))
        self._samples = samples
        self._at = np.where(hit[..., None], at, 0.0).astype(np.float32)
        # Light per horizontal area, on a surface that leans: the same light on more area. Nothing comes from elsewhere.
        self._lean = np.abs(seen.normal.numpy()[..., 2]) * hit
        self.inside = self._blocks(hit).all(axis=(1, 3))

    def light(self, image: np.ndarray) -> np.ndarray:
        """Irradiance on the surface that each pixel sees, of a map in flux per horizontal area.

        Parameters
        ----------
        image : ndarray
            ``[rows, columns]`` or ``[rows, columns, 3]``, of any resolution, bilinear between the middles of its
            pixels.

        Returns
        -------
        ndarray
            ``[camera rows, camera columns]`` (and colours), row 0 at the bottom of the picture, 0 where the eye sees no
            part of the map. Where one part of the receiver hides another from above, both get the light of both, since
            the map adds them up.
        """
        channels = np.atleast_3d(image)
        seen = [self._blocks(_bilinear(channels[..., c], self._at) * self._lean).mean(axis=(1, 3))
                for c in range(channels.shape[2])]  # fmt: skip
        return np.stack(seen, axis=-1) if image.ndim == 3 else seen[0]

    def _blocks(self, image: np.ndarray) -> np.ndarray:
        """View samples as ``[camera rows, samples, camera columns, samples]``."""
        rows, columns = (side // self._samples for side in image.shape)
        return image.reshape(rows, self._samples, columns, self._samples)


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


def _bilinear(image: np.ndarray, at: np.ndarray) -> np.ndarray:
    """One channel at positions ``[..., 2]`` (x, y), as shares of its sides."""
    rows, columns = image.shape
    sides = np.array([columns, rows], dtype=np.float32)
    at = np.clip(at * sides - np.float32(0.5), np.float32(0.0), sides - np.float32(1.0))
    low = np.minimum(at.astype(np.int32), (max(columns - 2, 0), max(rows - 2, 0)))
    right, up = np.moveaxis(at - low, -1, 0)
    x, y = np.moveaxis(low, -1, 0)
    next_x, next_y = np.minimum(x + 1, columns - 1), np.minimum(y + 1, rows - 1)
    below = (1.0 - right) * image[y, x] + right * image[y, next_x]
    above = (1.0 - right) * image[next_y, x] + right * image[next_y, next_x]
    return np.asarray((1.0 - up) * below + up * above)
