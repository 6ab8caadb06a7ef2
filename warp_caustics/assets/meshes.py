"""Meshes, through pyvista's readers."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from warp_caustics.assets.locate import locate
from warp_caustics.assets.ply import check_ply
from warp_caustics.assets.types import TriangleMesh
from warp_caustics.errors import InputError
from warp_caustics.scene.formats import suffix
from warp_caustics.scene.receiver import MeshObject


def load_mesh(file: str) -> TriangleMesh:
    """Load a mesh in the coordinates of its file, cut into triangles; lines and loose points are left out.

    Raises
    ------
    InputError
        If the file is missing, cannot be read, has no triangles, a vertex that is not finite, or a triangle of vertices
        that are not there.
    """
    path = locate(file)
    if suffix(path.name) == ".ply":
        check_ply(path)
    surface = _read(path)
    vertices = np.array(surface.points, dtype=np.float64)
    faulty = np.flatnonzero(~np.isfinite(vertices).all(axis=1))
    if len(faulty):
        raise InputError(f"{path}: expected finite vertices, got {len(faulty)} that are not, the first is {faulty[0]}")
    _check_indices(path, surface)
    triangles = np.array(surface.triangulate().faces, dtype=np.int32).reshape(-1, 4)[:, 1:]
    if not len(triangles):
        raise InputError(f"{path}: expected a mesh with triangles, got none")
    return TriangleMesh(vertices, np.ascontiguousarray(triangles))


def place_objects(objects: Sequence[MeshObject], meshes: Sequence[TriangleMesh]) -> TriangleMesh:
    """Put the meshes of objects in their places, scaled and then moved, all in one mesh."""
    firsts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    return TriangleMesh(
        np.concatenate([m.vertices * o.scale + np.array(o.translate) for o, m in zip(objects, meshes, strict=True)]),
        np.concatenate([m.triangles + np.int32(k) for k, m in zip(firsts[:-1], meshes, strict=True)]),
    )


def _read(path: Path) -> Any:
    """Return what the file holds as pyvista's PolyData.

    `pyvista.read` does the same but hands on VTK's errors as warnings and log lines, beside an empty mesh.
    """
    import pyvista

    quiet, errors = pyvista.vtk_verbosity("off"), pyvista.VtkErrorCatcher(raise_errors=True, send_to_logging=False)
    try:
        with warnings.catch_warnings(), quiet, errors:
            warnings.simplefilter("ignore")  # of arrays beside the mesh, which nobody needs
            reader = pyvista.get_reader(path)
            reader.reader.Update()
            data = pyvista.wrap(reader.reader.GetOutputDataObject(0))
    except (RuntimeError, ValueError, OSError, MemoryError) as error:
        last_line = str(error).strip().rpartition("\n")[2]
        raise InputError(f"{path}: cannot be read as a mesh: {last_line}") from None
    if not isinstance(data, pyvista.PolyData):
        raise InputError(f"{path}: expected a surface, got {type(data).__name__}")
    return data


def _check_indices(path: Path, surface: Any) -> None:
    """Raise `InputError` for cells of vertices that are not there: VTK's filters would read past the end."""
    import pyvista

    for cells in (surface.GetVerts(), surface.GetLines(), surface.GetPolys(), surface.GetStrips()):
        if not cells.GetNumberOfCells():
            continue
        corners = np.asarray(pyvista.convert_array(cells.GetConnectivityArray()))
        starts = np.asarray(pyvista.convert_array(cells.GetOffsetsArray()))
        if np.any(np.diff(starts) < 0) or starts[0] < 0 or starts[-1] > len(corners):
            raise InputError(f"{path}: expected cells of its own corners, got damaged ones")
        if len(corners) and (corners.min() < 0 or corners.max() >= surface.n_points):
            raise InputError(f"{path}: expected cells of its {surface.n_points} vertices, got one that names another")
