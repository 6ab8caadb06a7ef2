"""Places of a lattice in a height map that repeats, tabulated once for each row and each column.

A point's place is between which nodes it stands, and how far along. In float32 it would be wrong by some 1e-7 of the
way to the map's far corner, which steep light makes visible and which would differ from one period to the next: the
tables are made in float64, and water that repeats repeats bit for bit.
"""

import warp as wp

from .grid import Grid, Place
from .lattice import Lattice, water_along, whole
from .photon import Scene, SunSample


@wp.func
def place_along(grid: Grid, axis: int, count: int, at: wp.float64) -> wp.vec2:
    """The node before a place along one axis, a whole number, and how far the place is past it in node spacings."""
    past_origin = at - whole(grid.origin[axis], grid.origin_rest[axis])
    place = past_origin * whole(grid.per_metre[axis], grid.per_metre_rest[axis])
    place -= wp.float64(count) * wp.floor(place / wp.float64(count))
    node = wp.clamp(int(wp.floor(place)), 0, count - 1)
    return wp.vec2(float(node), float(place - wp.float64(node)))


@wp.kernel(enable_backward=False)
def place_table(
    # In:
    scene: Scene,
    suns: wp.array[SunSample],
    sun: int,
    lattice: Lattice,
    first_row: int,
    offset: float,
    # Out:
    column_waves_out: wp.array2d[wp.vec2],
    row_waves_out: wp.array2d[wp.vec2],
):
    """One thread a column or row; launch dim the larger count; ``offset`` is of the first point, in cells.

    ``column_waves_out[i, 0]`` and ``row_waves_out[j, 0]`` are the node and the way past it: see :func:`place_along`.
    """
    i = wp.tid()
    shift = suns[sun].rest_shift
    grid = scene.water.surface.grid
    if i < column_waves_out.shape[0]:
        x = water_along(lattice, 0, lattice.first[0] + i, offset, shift)
        column_waves_out[i, 0] = place_along(grid, 0, grid.nodes.shape[1], x)
    if i < row_waves_out.shape[0]:
        y = water_along(lattice, 1, first_row + i, offset, shift)
        row_waves_out[i, 0] = place_along(grid, 1, grid.nodes.shape[0], y)


@wp.func
def tabled_place(
    grid: Grid, column_waves: wp.array2d[wp.vec2], row_waves: wp.array2d[wp.vec2], column: int, row: int
) -> Place:
    """Place of a lattice point, from the tables."""
    x = column_waves[column, 0]
    y = row_waves[row, 0]
    at = Place()
    at.column = int(x[0])
    at.row = int(y[0])
    at.right = (at.column + 1) % grid.nodes.shape[1]
    at.above = (at.row + 1) % grid.nodes.shape[0]
    at.u = x[1]
    at.v = y[1]
    return at
