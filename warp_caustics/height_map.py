"""Height maps made ready for the kernels: nodes of a bicubic Hermite surface, and its bounds."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from .assets import HeightGrid

OVERSHOOT = 1.25
"""A cubic between nodes can be steeper than at any node; for fourth-order slopes a quarter more is never passed."""


def difference(z: np.ndarray, axis: int) -> np.ndarray:
    """Fourth-order first difference by node along an axis, one-sided at the ends.

    Parameters
    ----------
    z : ndarray
        Values, at least five along the axis.
    axis : int
        The axis to difference along.

    Returns
    -------
    ndarray
        The derivative by node spacing, of the same shape.
    """
    z = np.moveaxis(z, axis, 0)
    slope = np.empty_like(z)
    slope[2:-2] = (8.0 * (z[3:-1] - z[1:-3]) - (z[4:] - z[:-4])) / 12.0
    end = np.array([-25.0, 48.0, -36.0, 16.0, -3.0]) / 12.0
    near = np.array([-3.0, -10.0, 18.0, -6.0, 1.0]) / 12.0
    for row, weights in ((0, end), (1, near)):
        slope[row] = np.tensordot(weights, z[:5], 1)
        slope[-1 - row] = -np.tensordot(weights, z[:-6:-1], 1)
    return np.moveaxis(slope, 0, axis)


def hermite_nodes(z: np.ndarray) -> np.ndarray:
    """Nodes (z, z_u, z_v, z_uv) of a bicubic Hermite surface, ``[rows, columns, 4]``, by node spacing."""
    along = difference(z, 1)
    return np.stack([z, along, difference(z, 0), difference(along, 0)], axis=-1)


def node_spacing(grid: HeightGrid) -> np.ndarray:
    """Distance between nodes along x and y [m]."""
    rows, columns = grid.z.shape
    return np.array([grid.size[0] / columns, grid.size[1] / rows])


def node_slopes(grid: HeightGrid) -> np.ndarray:
    """Slopes at the nodes, ``[rows * columns, 2]``."""
    spacing = node_spacing(grid)
    return np.stack([difference(grid.z, 1) / spacing[0], difference(grid.z, 0) / spacing[1]], axis=-1).reshape(-1, 2)


def sample_heights(grid: HeightGrid, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Height of the surface that the kernels see, in float64, at world coordinates of any shape [m]."""
    nodes = hermite_nodes(grid.z)
    rows, columns = grid.z.shape
    spacing = node_spacing(grid)
    px = np.clip((x - grid.origin[0]) / spacing[0] - 0.5, -0.5, columns - 0.5)
    py = np.clip((y - grid.origin[1]) / spacing[1] - 0.5, -0.5, rows - 0.5)
    column = np.clip(np.floor(px).astype(int), 0, columns - 2)
    row = np.clip(np.floor(py).astype(int), 0, rows - 2)
    u, v = _hermite(px - column), _hermite(py - row)
    height = np.zeros(np.shape(px))
    for j in range(2):
        for i in range(2):
            node = nodes[row + j, column + i]
            height += v[j] * (u[i] * node[..., 0] + u[2 + i] * node[..., 1])
            height += v[2 + j] * (u[i] * node[..., 2] + u[2 + i] * node[..., 3])
    return height


def covers(grid: HeightGrid, origin: Sequence[float], size: Sequence[float]) -> bool:
    """Tell whether a height map reaches over all of a rectangle (to a thousandth of a node)."""
    slack = 1e-3 * node_spacing(grid)
    low = np.asarray(origin) >= np.asarray(grid.origin) - slack
    high = np.add(origin, size) <= np.add(grid.origin, grid.size) + slack
    return bool(low.all() and high.all())


def _hermite(t: np.ndarray) -> tuple[np.ndarray, ...]:
    s = 1.0 - t
    return s * s * (1.0 + 2.0 * t), t * t * (3.0 - 2.0 * t), t * s * s, -t * t * s
