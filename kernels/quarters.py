"""A cell's deposit in four parts: the common case of :mod:`.edge_patch`, with its nine nodes in closed form."""

import functools

import warp as wp

from .deposit import FLUX
from .edge_patch import make_add_quad
from .edges import DENSITY, make_add_edge
from .patch import arrived_plane, read_block
from .spec import Spec


@wp.func
def middle(a: float, b: float, c: float, d: float) -> float:
    """The Catmull-Rom cubic through the middle two of four values, half way between them."""
    return 0.5625 * (b + c) - 0.0625 * (a + d)


@wp.func
def nodes_of(m: wp.mat44) -> wp.mat33:
    """The cubic of a block at its cell's corners, the middles of its sides, and its own middle."""
    m0 = middle(m[0, 0], m[0, 1], m[0, 2], m[0, 3])
    m1 = middle(m[1, 0], m[1, 1], m[1, 2], m[1, 3])
    m2 = middle(m[2, 0], m[2, 1], m[2, 2], m[2, 3])
    m3 = middle(m[3, 0], m[3, 1], m[3, 2], m[3, 3])
    before = middle(m[0, 1], m[1, 1], m[2, 1], m[3, 1])
    after = middle(m[0, 2], m[1, 2], m[2, 2], m[3, 2])
    return wp.mat33(m[1, 1], m1, m[1, 2], before, middle(m0, m1, m2, m3), after, m[2, 1], m2, m[2, 2])


@wp.func
def mean_of_nodes(m: wp.mat33) -> float:
    """Trapezoid sum of nine nodes over a cell."""
    corners = m[0, 0] + m[0, 2] + m[2, 0] + m[2, 2]
    sides = m[0, 1] + m[1, 0] + m[1, 2] + m[2, 1]
    return 0.0625 * corners + 0.125 * sides + 0.25 * m[1, 1]


@functools.cache
def make_deposit_quarters(spec: Spec) -> wp.Function:
    """Deposit a whole cell within the map as 2 x 2 pairs of triangles into a map of steps."""
    channels = spec.channels
    add_edge = make_add_edge(channels)
    add_quad = make_add_quad(channels)
    flux_type, density_type = FLUX[channels], DENSITY[channels]
    arrived = arrived_plane(spec)
    nodes_type = wp.types.matrix(shape=(3 * channels, 3), dtype=float)

    @wp.func
    def deposit_quarters(
        map: wp.array[wp.float64], size: wp.vec2i, corner: wp.vec2d, step: wp.float64, planes: wp.array3d[float],
        row: int, column: int, mean: flux_type,
    ):  # fmt: skip
        """``corner`` is the cell's own at rest, ``step`` its side [pixels]; ``mean`` its flux."""
        pitch = size[0] + 1
        half = wp.float64(0.5) * step
        x = nodes_of(read_block(planes, 0, row, column))
        y = nodes_of(read_block(planes, 1, row, column))
        flux = nodes_type()
        mend = flux_type()
        for k in range(wp.static(channels)):
            nodes = nodes_of(read_block(planes, wp.static(arrived) + k, row, column))
            mend[k] = mean[k] - mean_of_nodes(nodes)
            for j in range(wp.static(3)):
                for i in range(wp.static(3)):
                    flux[3 * k + j, i] = nodes[j, i]
        under = density_type()  # under the first and the second part of a row
        under_next = density_type()
        count = int(2)  # a variable, so that the loops are not unrolled
        for j in range(count):
            left = density_type()
            y_low = corner[1] + wp.float64(j) * half
            for i in range(count):
                x_low = corner[0] + wp.float64(i) * half
                a = wp.vec2d(x_low + wp.float64(x[j, i]), y_low + wp.float64(y[j, i]))
                b = wp.vec2d(x_low + half + wp.float64(x[j, i + 1]), y_low + wp.float64(y[j, i + 1]))
                c = wp.vec2d(x_low + half + wp.float64(x[j + 1, i + 1]), y_low + half + wp.float64(y[j + 1, i + 1]))
                d = wp.vec2d(x_low + wp.float64(x[j + 1, i]), y_low + half + wp.float64(y[j + 1, i]))
                lower = flux_type()
                upper = flux_type()
                for k in range(wp.static(channels)):
                    q = 3 * k + j
                    total = flux[q, i] + flux[q, i + 1] + flux[q + 1, i] + flux[q + 1, i + 1]
                    each = 0.125 * (0.25 * total + mend[k])
                    tilt = (flux[q, i + 1] - flux[q + 1, i]) / 48.0
                    lower[k] = each + tilt
                    upper[k] = each - tilt
                below, above = add_quad(map, size, a, b, c, d, lower, upper)
                add_edge(map, pitch, a, b, below - under)
                add_edge(map, pitch, d, a, above - left)
                add_edge(map, pitch, c, a, below - above)
                if j == 1:
                    add_edge(map, pitch, c, d, above)
                if i == 1:
                    add_edge(map, pitch, b, c, below)
                left = below
                under = under_next
                under_next = above

    return deposit_quarters
