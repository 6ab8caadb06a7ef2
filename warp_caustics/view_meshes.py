"""Meshes that the views draw: what receives light, with the places of a map on it, and the water."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    import pyvista as pv

    from warp_caustics.assets import Assets, TriangleMesh
    from warp_caustics.scene import Map, Scene

# Vertices along one side of the lattices that are drawn: finer ones are no longer told apart in a window.
LATTICE_LIMIT = 512


def receiver_meshes(scene: Scene, assets: Assets) -> list[pv.PolyData]:
    """Build what receives light within the map, with plan-view texture coordinates."""
    import pyvista as pv

    from warp_caustics.receiver import receiver_heights

    window = scene.map
    meshes: list[pv.PolyData] = []
    if scene.receiver.plane is not None:
        (left, bottom), (right, top), z = window.origin, far_corner(window), scene.receiver.plane
        corners = [(left, bottom, z), (right, bottom, z), (right, top, z), (left, top, z)]
        meshes.append(pv.PolyData(np.array(corners), faces=[4, 0, 1, 2, 3]))
    elif scene.receiver.terrain is not None:
        x, y = _lattice(window)
        meshes.append(pv.StructuredGrid(x, y, receiver_heights(scene, assets, x, y)))
    meshes += [_clip(_polydata(mesh), window) for mesh in (assets.mesh, assets.objects) if mesh is not None]
    meshes = [mesh for mesh in meshes if mesh.n_points]
    for mesh in meshes:
        uv = (mesh.points[:, :2].astype(np.float64) - window.origin) / window.size
        mesh.active_texture_coordinates = uv
    return meshes


def water_mesh(scene: Scene, assets: Assets, time: float) -> pv.PolyData:
    """Build the water's surface over the map."""
    import pyvista as pv

    from warp_caustics.water import water_heights

    x, y = _lattice(scene.map)
    return pv.StructuredGrid(x, y, water_heights(scene, assets, x, y, time))


def _lattice(window: Map) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """World coordinates of the vertices of a lattice over the map, [rows, columns] each."""
    columns, rows = (min(count, LATTICE_LIMIT) + 1 for count in window.resolution)
    (left, bottom), (right, top) = window.origin, far_corner(window)
    x, y = np.meshgrid(np.linspace(left, right, columns), np.linspace(bottom, top, rows))
    return x, y


def far_corner(window: Map) -> tuple[float, float]:
    """Return the upper corner of a map (x, y) [m]."""
    return window.origin[0] + window.size[0], window.origin[1] + window.size[1]


def _polydata(mesh: TriangleMesh) -> pv.PolyData:
    import pyvista as pv

    faces: Any = mesh.triangles  # any integers do, though the annotation there asks for Python's own
    return pv.PolyData.from_regular_faces(mesh.vertices, faces)


def _clip(mesh: pv.PolyData, window: Map) -> pv.PolyData:
    """Cut away what lies outside the map: there is no light for it."""
    (left, bottom), (right, top) = window.origin, far_corner(window)
    for normal, origin in (((-1, 0), (left, 0)), ((1, 0), (right, 0)), ((0, -1), (0, bottom)), ((0, 1), (0, top))):
        if mesh.n_points:
            mesh = mesh.clip(normal=(*normal, 0), origin=(*origin, 0))
    return mesh
