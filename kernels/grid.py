"""Height maps: bicubic Hermite patches between nodes that hold the height and its differences.

A node holds ``(z, z_u, z_v, z_uv)``, the derivatives by node spacing, made in float64 by fourth-order differences: on
the host for a file, by ``nodes.py`` for a simulation. The patch is C1, so the slope is continuous and consistent with
the height.
"""

import warp as wp

from .waves import vec6


@wp.struct
class Grid:
    """Nodes of a height map; node (0, 0) stands at ``origin``, metres from the map's origin."""

    nodes: wp.array2d[wp.vec4]
    origin: wp.vec2  # [m]
    per_metre: wp.vec2  # nodes per metre
    origin_rest: wp.vec2  # what float32 leaves out of the two above: added in float64 they have the host's digits
    per_metre_rest: wp.vec2


@wp.func
def hermite(t: float) -> wp.vec4:
    """Weights of (value 0, value 1, slope 0, slope 1) in the cubic on [0, 1]."""
    s = 1.0 - t
    return wp.vec4(s * s * (1.0 + 2.0 * t), t * t * (3.0 - 2.0 * t), t * s * s, -t * t * s)


@wp.func
def hermite_first(t: float) -> wp.vec4:
    """First derivative of :func:`hermite`'s weights."""
    return wp.vec4(6.0 * t * (t - 1.0), 6.0 * t * (1.0 - t), (3.0 * t - 1.0) * (t - 1.0), t * (3.0 * t - 2.0))


@wp.func
def hermite_second(t: float) -> wp.vec4:
    """Second derivative of :func:`hermite`'s weights."""
    return wp.vec4(12.0 * t - 6.0, 6.0 - 12.0 * t, 6.0 * t - 4.0, 6.0 * t - 2.0)


@wp.struct
class Place:
    """Where a point lies in a height map: between which nodes, and how far along, in node spacings."""

    row: int
    column: int
    above: int  # the row after
    right: int  # the column after
    u: float
    v: float


@wp.func
def patch(grid: Grid, at: Place, u: wp.vec4, v: wp.vec4) -> float:
    """Tensor product of the weights ``u`` along x and ``v`` along y over the patch at a place."""
    a = grid.nodes[at.row, at.column]
    b = grid.nodes[at.row, at.right]
    c = grid.nodes[at.above, at.column]
    d = grid.nodes[at.above, at.right]
    values = v[0] * (u[0] * a[0] + u[1] * b[0] + u[2] * a[1] + u[3] * b[1])
    values += v[1] * (u[0] * c[0] + u[1] * d[0] + u[2] * c[1] + u[3] * d[1])
    values += v[2] * (u[0] * a[2] + u[1] * b[2] + u[2] * a[3] + u[3] * b[3])
    values += v[3] * (u[0] * c[2] + u[1] * d[2] + u[2] * c[3] + u[3] * d[3])
    return values


@wp.func
def grid_cell(position: float, count: int) -> int:
    """The patch that holds a position in node units; bounded, NaN included."""
    return wp.clamp(int(wp.floor(position)), 0, count - 2)


@wp.func
def grid_place(grid: Grid, x: float, y: float) -> Place:
    """Place of (x, y) in a height map with a border: half a node past the last one."""
    nx = grid.nodes.shape[1]
    ny = grid.nodes.shape[0]
    px = wp.clamp((x - grid.origin[0]) * grid.per_metre[0], -0.5, float(nx) - 0.5)
    py = wp.clamp((y - grid.origin[1]) * grid.per_metre[1], -0.5, float(ny) - 0.5)
    at = Place()
    at.column = grid_cell(px, nx)
    at.row = grid_cell(py, ny)
    at.right = at.column + 1
    at.above = at.row + 1
    at.u = px - float(at.column)
    at.v = py - float(at.row)
    return at


@wp.func
def periodic_place(grid: Grid, x: float, y: float) -> Place:
    """Place of (x, y) in a height map that repeats without end; bounded, NaN included."""
    nx = grid.nodes.shape[1]
    ny = grid.nodes.shape[0]
    px = (x - grid.origin[0]) * grid.per_metre[0]
    py = (y - grid.origin[1]) * grid.per_metre[1]
    px -= float(nx) * wp.floor(px / float(nx))
    py -= float(ny) * wp.floor(py / float(ny))
    at = Place()
    at.column = wp.clamp(int(wp.floor(px)), 0, nx - 1)
    at.row = wp.clamp(int(wp.floor(py)), 0, ny - 1)
    at.right = (at.column + 1) % nx
    at.above = (at.row + 1) % ny
    at.u = px - float(at.column)
    at.v = py - float(at.row)
    return at


@wp.func
def grid_sum(grid: Grid, at: Place) -> wp.vec3:
    """Height and slope (z, z_x, z_y) of the height map at a place."""
    return wp.vec3(
        patch(grid, at, hermite(at.u), hermite(at.v)),
        patch(grid, at, hermite_first(at.u), hermite(at.v)) * grid.per_metre[0],
        patch(grid, at, hermite(at.u), hermite_first(at.v)) * grid.per_metre[1],
    )


@wp.func
def grid_sum_curved(grid: Grid, at: Place) -> vec6:
    """Height, slope and second derivatives (z, z_x, z_y, z_xx, z_xy, z_yy) of the height map at a place."""
    mx = grid.per_metre[0]
    my = grid.per_metre[1]
    return vec6(
        patch(grid, at, hermite(at.u), hermite(at.v)),
        patch(grid, at, hermite_first(at.u), hermite(at.v)) * mx,
        patch(grid, at, hermite(at.u), hermite_first(at.v)) * my,
        patch(grid, at, hermite_second(at.u), hermite(at.v)) * mx * mx,
        patch(grid, at, hermite_first(at.u), hermite_first(at.v)) * mx * my,
        patch(grid, at, hermite(at.u), hermite_second(at.v)) * my * my,
    )
