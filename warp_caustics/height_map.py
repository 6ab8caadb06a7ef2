"""Height maps made ready for the kernels: nodes of a bicubic Hermite surface, and its bounds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from .assets import HeightGrid

BOUND_ROWS = 256
"""Rows of patches whose control points are made at a time, so that a large map's bounds take little memory."""


ROUNDING = 1e-6
"""Share by which bounds are widened for float32, in which the kernels work."""


@dataclass(frozen=True)
class Hull:
    """Bounds of a height map's surface, nodes and all between them."""

    lowest: float
    highest: float
    slope: float


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


def surface_hull(grid: HeightGrid) -> Hull:
    """Bound the surface between the nodes: a patch lies in the hull of its Bézier control points."""
    lowest, highest = np.inf, -np.inf
    for control, _, _ in _control_bands(grid):
        lowest, highest = min(lowest, float(control.min())), max(highest, float(control.max()))
    spare = ROUNDING * max(abs(lowest), abs(highest), 1.0)
    return Hull(lowest - spare, highest + spare, float(patch_slopes(grid).max()))


def patch_slopes(grid: HeightGrid) -> np.ndarray:
    """Bound the slope of each patch ``[rows - 1, columns - 1]``.

    The control points of a cubic are (z0, z0 + m0/3, z1 - m1/3, z1), those of its slope three times their
    differences, and the slope lies in their hull.
    """
    spacing, bands = node_spacing(grid), []
    for control, wide, tall in _control_bands(grid):
        along = 3.0 * np.abs(np.diff(control, axis=1)).max(axis=(0, 1)) / wide / spacing[0]
        across = 3.0 * np.abs(np.diff(control, axis=0)).max(axis=(0, 1)) / tall / spacing[1]
        bands.append(np.hypot(along, across) * (1.0 + ROUNDING))
    return np.concatenate(bands)


def _control_bands(grid: HeightGrid) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Yield control points of some rows of patches, and how wide and tall the patches are [nodes].

    The outer patches reach half a node further, to the map's border.
    """
    nodes = hermite_nodes(grid.z)
    for first in range(0, len(nodes) - 1, BOUND_ROWS):
        control = _control_points(nodes[first : first + BOUND_ROWS + 1])
        wide, tall = np.ones(control.shape[3]), np.ones((control.shape[2], 1))
        _reach_border(control, 1, (..., 0), (..., -1), wide)
        upto = first + BOUND_ROWS >= len(nodes) - 1
        _reach_border(control, 0, (..., 0, slice(None)) if first == 0 else None,
                      (..., -1, slice(None)) if upto else None, tall)  # fmt: skip
        yield control, wide, tall


def _reach_border(control: np.ndarray, axis: int, first: Any, last: Any, width: np.ndarray) -> None:
    """Stretch the outer patches along an axis by half a node, in place; ``width`` [nodes] follows."""
    for at, start, end, index in ((first, -0.5, 1.0, 0), (last, 0.0, 1.5, -1)):
        if at is not None:
            weights = np.array(
                [_blossom(u) for u in ((start,) * 3, (start, start, end), (start, end, end), (end,) * 3)]
            )
            patches = np.moveaxis(control[at], axis, 0)
            control[at] = np.moveaxis(np.tensordot(weights, patches, 1), 0, axis)
            width[index] = end - start


def _blossom(u: tuple[float, float, float]) -> np.ndarray:
    """Weights of a cubic's control points in its polar form at three parameters (de Casteljau)."""
    points = np.eye(4)
    for t in u:
        points = (1.0 - t) * points[:-1] + t * points[1:]
    return points[0]


def _control_points(nodes: np.ndarray) -> np.ndarray:
    """Control points ``[4 along y, 4 along x, rows - 1, columns - 1]`` of the patches between nodes."""
    control = np.empty((4, 4, nodes.shape[0] - 1, nodes.shape[1] - 1))
    for j, (row, up) in enumerate(((0, 0.0), (0, 1.0), (1, -1.0), (1, 0.0))):
        for i, (column, right) in enumerate(((0, 0.0), (0, 1.0), (1, -1.0), (1, 0.0))):
            z, zu, zv, zuv = np.moveaxis(
                nodes[row : nodes.shape[0] - 1 + row, column : nodes.shape[1] - 1 + column], -1, 0
            )
            control[j, i] = z + right * zu / 3.0 + up * zv / 3.0 + right * up * zuv / 9.0
    return control


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
    """Weights of (value 0, value 1, slope 0, slope 1), as in ``kernels/grid.py``."""
    s = 1.0 - t
    return s * s * (1.0 + 2.0 * t), t * t * (3.0 - 2.0 * t), t * s * s, -t * t * s
