"""Triangles on a device: meshes, and height fields on a lattice whose heights may change from frame to frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt
import warp as wp

from warp_caustics.errors import InputError
from warp_caustics.kernels.g_buffer import lift_lattice_kernel


class Mesh(Protocol):
    """Vertices float64 [n, 3] in world coordinates [m], triangles int32 [m, 3]: ``assets.TriangleMesh``."""

    @property
    def vertices(self) -> npt.NDArray[np.float64]:
        """World coordinates [m]."""

    @property
    def triangles(self) -> npt.NDArray[np.int32]:
        """Vertices of each triangle."""


@dataclass(frozen=True)
class Triangles:
    """Triangles on a device, in float32 relative to a world origin held in float64.

    Attributes
    ----------
    vertices : wp.array of vec3 [n]
        Relative to ``origin`` [m].
    triangles : wp.array of vec3i [m]
        Vertices of each triangle. Indices that name no vertex are dropped and counted, never followed.
    origin : (x, y, z)
        World coordinates [m].
    normals : wp.array of vec3 [n], optional
        Unit normals of the vertices, for interpolated normals.

    Raises
    ------
    InputError
        An array has another type, shape or device.
    """

    vertices: wp.array
    triangles: wp.array
    origin: tuple[float, float, float]
    normals: wp.array | None = None

    def __post_init__(self) -> None:
        """Check what the kernels rely on."""
        check_array("Triangles.vertices", self.vertices, wp.vec3, None, None)
        check_array("Triangles.triangles", self.triangles, wp.vec3i, None, self.vertices.device)
        if self.normals is not None:
            check_array("Triangles.normals", self.normals, wp.vec3, self.vertices.shape, self.vertices.device)
        if not self.triangles.size:
            raise InputError("there are no triangles to rasterize")
        if not np.all(np.isfinite(self.origin)):
            raise InputError(f"Triangles.origin is {self.origin}; it wants three finite numbers")


@dataclass(frozen=True)
class Lattice:
    """Cells of a height field: corners at ``origin + (column, row) * size / (columns, rows)``.

    Attributes
    ----------
    columns, rows : int
        Cells; there is one corner more each way.
    origin : (x, y)
        World coordinates of corner (0, 0) [m].
    size : (w, h)
        Of the whole lattice [m].
    level : float
        World z that heights are displacements from [m]: a displacement keeps the digits that an absolute height loses.
    """

    columns: int
    rows: int
    origin: tuple[float, float]
    size: tuple[float, float]
    level: float = 0.0

    def __post_init__(self) -> None:
        """Check."""
        if self.columns < 1 or self.rows < 1:
            raise InputError(f"Lattice has {self.columns} x {self.rows} cells; it wants one or more each way")
        if not np.all(np.isfinite([*self.origin, *self.size, self.level])) or min(self.size) <= 0.0:
            raise InputError(
                f"Lattice has origin {self.origin}, size {self.size}, level {self.level}; it wants finite numbers "
                "and a positive size"
            )

    @property
    def corners(self) -> tuple[int, int]:
        """Rows and columns of corners: the shape of its heights."""
        return self.rows + 1, self.columns + 1


def mesh_triangles(*meshes: Mesh, origin: Sequence[float], device: str) -> Triangles:
    """Upload meshes as one: the triangles of the second follow those of the first.

    Parameters
    ----------
    *meshes : Mesh
        One or more; vertices in world coordinates [m].
    origin : (x, y, z)
        World coordinates [m], subtracted in float64: near the meshes, so that float32 keeps their digits.
    device : str
        Where the arrays live.

    Raises
    ------
    InputError
        A mesh has no triangles, arrays of another shape, or an index that names no vertex.
    """
    if not meshes:
        raise InputError("there are no meshes to rasterize")
    vertices, triangles, first = [], [], 0
    for number, mesh in enumerate(meshes):
        points, corners = np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.triangles)
        if points.ndim != 2 or points.shape[1] != 3 or corners.ndim != 2 or corners.shape[1] != 3 or not corners.size:
            raise InputError(
                f"mesh {number} has vertices {points.shape} and triangles {corners.shape}; it wants [n, 3] and [m, 3], "
                "with one triangle or more"
            )
        if corners.dtype.kind not in "iu" or corners.min() < 0 or corners.max() >= len(points):
            raise InputError(f"mesh {number} has an index that is not one of its {len(points)} vertices")
        vertices.append(points - np.asarray(origin, dtype=np.float64))
        triangles.append(corners.astype(np.int64) + first)
        first += len(points)
    if first > np.iinfo(np.int32).max:
        raise InputError(f"{first} vertices are more than 32-bit indices can name")
    with np.errstate(over="ignore"):  # what float32 cannot hold becomes infinite: dropped and counted on the device
        points32 = np.concatenate(vertices).astype(np.float32)
    return Triangles(
        wp.array(points32, dtype=wp.vec3, device=device),
        wp.array(np.concatenate(triangles).astype(np.int32), dtype=wp.vec3i, device=device),
        (float(origin[0]), float(origin[1]), float(origin[2])),
    )


def lattice_triangles(lattice: Lattice, device: str, normals: bool = False) -> Triangles:
    """Triangles of a lattice, flat at its level until :func:`lift_lattice` gives them heights.

    Cell (row, column) is split from its corner (row, column) to (row + 1, column + 1), into the triangles
    ``2 * (row * columns + column)`` on the right and the next on the left, both anticlockwise from above.

    Parameters
    ----------
    lattice : Lattice
    device : str
    normals : bool
        Allocate normals of the vertices too, for the caller to fill ([corner row, corner column], row by row).
    """
    rows, columns = lattice.corners
    if rows * columns > np.iinfo(np.int32).max:
        raise InputError(f"a lattice of {rows} x {columns} corners is more than 32-bit indices can name")
    triangles = lattice_indices(rows, columns)
    flat = wp.zeros((rows, columns), dtype=float, device=device)
    result = Triangles(
        wp.empty(rows * columns, dtype=wp.vec3, device=device),
        wp.array(triangles, dtype=wp.vec3i, device=device),
        (float(lattice.origin[0]), float(lattice.origin[1]), float(lattice.level)),
        wp.zeros(rows * columns, dtype=wp.vec3, device=device) if normals else None,
    )
    lift_lattice(lattice, flat, result)
    return result


def lattice_indices(rows: int, columns: int) -> npt.NDArray[np.int32]:
    """Corners ``[n, 3]`` of the triangles of a lattice with so many rows and columns of corners."""
    corner = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, :-1], corner[1:, 1:]
    return np.stack([a, b, d, a, d, c], axis=-1).reshape(-1, 3)


def lift_lattice(lattice: Lattice, heights: wp.array, triangles: Triangles) -> None:
    """Give the vertices of a lattice their heights. Allocates nothing, reads nothing back.

    Parameters
    ----------
    lattice : Lattice
    heights : wp.array2d of float32 [rows + 1, columns + 1]
        Displacement from ``lattice.level`` [m] at the corners.
    triangles : Triangles
        From :func:`lattice_triangles` of this lattice; its vertices are written.
    """
    device = triangles.vertices.device
    check_array("heights", heights, wp.float32, lattice.corners, device)
    check_array("triangles.vertices", triangles.vertices, wp.vec3, (heights.size,), device)
    spacing = wp.vec2(lattice.size[0] / lattice.columns, lattice.size[1] / lattice.rows)
    wp.launch(
        lift_lattice_kernel, dim=heights.shape, inputs=[heights, spacing], outputs=[triangles.vertices], device=device
    )


def check_array(name: str, array: object, dtype: type, shape: tuple[int, ...] | None, device: object) -> None:
    """Refuse what a kernel would crash on: None, another type, shape or device. A shape of None is any 1-D one."""
    if not isinstance(array, wp.array):
        raise InputError(f"{name} is {type(array).__name__}; it wants a wp.array")
    if array.dtype != dtype or array.ndim != (1 if shape is None else len(shape)):
        raise InputError(f"{name} is {array.ndim}-D of {array.dtype.__name__}; it wants {dtype.__name__}")
    if shape is not None and tuple(array.shape) != tuple(shape):
        raise InputError(f"{name} has shape {tuple(array.shape)}; it wants {tuple(shape)}")
    if device is not None and array.device != device:
        raise InputError(f"{name} is on {array.device}; it wants {device}")
