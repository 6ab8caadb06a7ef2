"""What the files of a scene hold, ready for the core: arrays in world coordinates, float64."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class HeightGrid:
    """Heights on a regular grid.

    Sample (row, column) stands at `origin + (column + 0.5, row + 0.5) * cell`.

    Attributes
    ----------
    z
        Heights [m], float64 [rows, columns], contiguous, row 0 at the lowest y. A receiver's are world z, the water's
        are displacement from its level.
    origin
        Lower corner (x, y) of the cell of sample (0, 0) [m].
    size
        Extent (x, y) of all cells [m].
    """

    z: NDArray[np.float64]
    origin: tuple[float, float]
    size: tuple[float, float]

    @property
    def cell(self) -> tuple[float, float]:
        """Extent (x, y) of one sample's cell [m]."""
        rows, columns = self.z.shape
        return self.size[0] / columns, self.size[1] / rows


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """Triangles in world coordinates.

    Attributes
    ----------
    vertices
        Positions [m], float64 [n, 3], all finite.
    triangles
        Indices of vertices, int32 [m, 3], m at least 1. Degenerate triangles may be among them.
    """

    vertices: NDArray[np.float64]
    triangles: NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Assets:
    """The loaded files of a scene; None for what the scene does not name.

    Attributes
    ----------
    water
        The height map of the water.
    terrain
        The height map of the receiver; None for one in closed form.
    mesh
        The receiver's mesh.
    objects
        All objects that stand on the receiver, in one mesh.
    """

    water: HeightGrid | None = None
    terrain: HeightGrid | None = None
    mesh: TriangleMesh | None = None
    objects: TriangleMesh | None = None
