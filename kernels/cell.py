"""What becomes of a cell of the landed lattice: how finely it is cut, or that it is followed ray by ray."""

import functools

import warp as wp

from .lattice import Lattice, at_rest, clip_to_water
from .patch import read_block
from .photon import LANDED, LANDED_ON_OBJECT
from .spec import Spec

BEND_SHARE = 0.005
"""Bend that is left inside one part of a cell, as a share of the cell's width where it lands."""

BEND_LEAST, BEND_MOST = 0.0005, 0.005
"""Bounds of the bend that is left [pixels]."""

FINEST = 16
"""Parts of a cell along each side at most."""

TORN = 0.25
"""Bend or jump [pixels] past which a cell over a receiver with edges is followed ray by ray instead of interpolated."""

BULGE = (1.0 + 1.25) / 8.0
"""Bulge of a cubic surface, of its largest second difference: one eighth along the first axis, and along the second one
what the weights of :func:`.patch.catmull_rom`, whose sizes add up to 1.25 at most, make of it."""

UNCUT = 2.99
"""Cells across a cell and its neighbours, of 3, that the water's border must leave."""


@wp.struct
class Cell:
    """A cell's square at rest, and what becomes of it."""

    low: wp.vec2  # [pixels]
    side: wp.vec2  # [pixels]; nothing, or less, where there is no water
    state: int  # that its corners share, or 0 where it is torn
    whole: int  # 1 where the water's border leaves it and its neighbours
    cubic: int  # 1 where it is interpolated across its neighbours, 0 where from its own corners alone
    parts: int  # along each side
    spare: float  # how far the parts bulge over the corners, at most [pixels]


@wp.func
def common_state(state: wp.array2d[wp.uint8], row: int, column: int, first: int, count: int) -> int:
    """The state that a square of corners shares, or 0; (row + first, column + first) is its first corner."""
    common = int(state[row + first, column + first])
    for j in range(first, first + count):
        for i in range(first, first + count):
            if int(state[row + j, column + i]) != common:
                common = int(0)
    return common


@wp.func
def second_difference(a: float, b: float, c: float, d: float) -> float:
    """Bend of the middle interval of four values: how far a parabola's middle is from its chord."""
    return wp.abs(a - b - c + d) / 16.0


@wp.func
def bend_of(m: wp.mat44) -> float:
    """How far a plane is from straight along a cell's sides, and across it, in its own unit."""
    worst = float(0.0)
    for i in range(wp.static(1), wp.static(3)):
        worst = wp.max(worst, second_difference(m[i, 0], m[i, 1], m[i, 2], m[i, 3]))
        worst = wp.max(worst, second_difference(m[0, i], m[1, i], m[2, i], m[3, i]))
    return wp.max(worst, 0.25 * wp.abs(m[1, 1] - m[1, 2] + m[2, 2] - m[2, 1]))


@wp.func
def bulge_of(m: wp.mat44) -> float:
    """Bound how far a cell's cubic leaves the hull of its corners, in the plane's own unit.

    A cubic leaves its chord by an eighth of its larger second difference at most, even where both cancel in its middle
    and :func:`bend_of` sees none. Across a cell those along one axis are interpolated along the other.
    """
    worst = float(0.0)
    for i in range(wp.static(4)):
        for j in range(wp.static(2)):
            worst = wp.max(worst, wp.abs(m[i, j] - 2.0 * m[i, j + 1] + m[i, j + 2]))
            worst = wp.max(worst, wp.abs(m[j, i] - 2.0 * m[j + 1, i] + m[j + 2, i]))
    return wp.static(BULGE) * worst


@wp.func
def jump_between(a: float, b: float, c: float, d: float) -> float:
    """How far the middle two of four values are apart beyond what their neighbours' differences lead to expect."""
    return wp.abs(c - b - 0.5 * (b - a + d - c))


@wp.func
def jump_of(m: wp.mat44) -> float:
    """How far a plane jumps within a cell: a step between its own corners has no second difference, but this."""
    worst = float(0.0)
    for i in range(wp.static(1), wp.static(3)):
        worst = wp.max(worst, jump_between(m[i, 0], m[i, 1], m[i, 2], m[i, 3]))
        worst = wp.max(worst, jump_between(m[0, i], m[1, i], m[2, i], m[3, i]))
    return worst


@wp.func
def side_misses(m: wp.mat44, low: float, high: float, top: float) -> bool:
    """Tell whether all corners of a cell land below ``low`` or above ``high`` along an axis, from its first at rest.

    ``top`` is the rest coordinate of the far corners along the axis; all in pixels.
    """
    least = wp.min(wp.min(m[1, 1], m[1, 2]), wp.min(m[2, 1], m[2, 2]))
    most = wp.max(wp.max(m[1, 1], m[1, 2]), wp.max(m[2, 1], m[2, 2])) + top
    return most < low or least > high


@wp.func
def misses_map(lattice: Lattice, x: wp.mat44, y: wp.mat44, corner: wp.vec2, side: wp.vec2, spare: float) -> bool:
    """Tell whether a cell at rest at ``corner`` [pixels] lands beside the map, by more than ``spare``.

    Cutting such a cell finer would show nothing, and its light is counted all the same.
    """
    width = float(lattice.map[0])
    height = float(lattice.map[1])
    return side_misses(x, -spare - corner[0], width + spare - corner[0], side[0]) or side_misses(
        y, -spare - corner[1], height + spare - corner[1], side[1]
    )


@wp.func
def thickness(x: wp.mat44, y: wp.mat44, side: wp.vec2) -> float:
    """Width of a landed cell across its longer diagonal [pixels]; nothing at a focus, where it is a sliver."""
    up = wp.vec2(side[0] + x[2, 2] - x[1, 1], side[1] + y[2, 2] - y[1, 1])
    down = wp.vec2(side[0] + x[1, 2] - x[2, 1], y[1, 2] - y[2, 1] - side[1])
    area = 0.5 * wp.abs(up[0] * down[1] - up[1] * down[0])
    return area / wp.max(wp.max(wp.length(up), wp.length(down)), 1.0e-6)


@functools.cache
def make_judge(spec: Spec, refine: bool) -> wp.Function:
    """Judge a cell by its corners' states and by how its landing map bends."""
    breaks, bounded = spec.breaks, spec.bounded
    may_tear = spec.tears or spec.objects or spec.receiver == "mesh"

    @wp.func
    def judge(
        lattice: Lattice, shift: wp.vec2, index: wp.vec2i, planes: wp.array3d[float], state: wp.array2d[wp.uint8],
        row: int, column: int,
    ) -> Cell:  # fmt: skip
        """``index`` is the cell's own, (row, column) its place in the strip; ``shift`` the way of the light at rest."""
        cell = Cell()
        low = at_rest(lattice, index, 0.0)
        high = at_rest(lattice, index, 1.0)
        cell.whole = 1
        cell.parts = 1
        cell.state = LANDED
        cubic = int(wp.static(int(refine)))
        if wp.static(bounded):
            # A cell that the water's border cuts keeps what is left of it, without the neighbours' cubic.
            before = clip_to_water(lattice, at_rest(lattice, index, -1.0), shift)
            after = clip_to_water(lattice, at_rest(lattice, index, 2.0), shift)
            low = clip_to_water(lattice, low, shift)
            high = clip_to_water(lattice, high, shift)
            uncut = wp.static(UNCUT) * lattice.step
            if after[0] - before[0] < uncut or after[1] - before[1] < uncut:
                cubic = int(0)
                cell.whole = 0
        cell.low = low
        cell.side = high - low
        if wp.static(breaks):
            cell.state = common_state(state, row, column, 1, 2)
            if common_state(state, row, column, 0, 4) == 0:
                # No interpolant reaches across an edge: beside one, a cell is followed ray by ray like those on it.
                cubic = int(0)
                if cell.state == LANDED or cell.state == LANDED_ON_OBJECT:
                    cell.state = 0
        if wp.static(refine or may_tear):
            x = read_block(planes, 0, row, column)
            y = read_block(planes, 1, row, column)
            bend = float(0.0)
            if cell.whole == 1 and cell.state != 0:
                bend = wp.max(bend_of(x), bend_of(y))
            if wp.static(refine):
                thick = thickness(x, y, cell.side)
                left = wp.clamp(wp.static(BEND_SHARE) * thick, wp.static(BEND_LEAST), wp.static(BEND_MOST))
                if bend > left:
                    spare = wp.max(bulge_of(x), bulge_of(y)) + 1.0  # and what rounding may do
                    if not misses_map(lattice, x, y, low, cell.side, spare):
                        cell.parts = wp.clamp(int(wp.ceil(wp.sqrt(bend / left))), 1, wp.static(FINEST))
                        cell.spare = spare
            if wp.static(may_tear):
                if cell.whole == 1 and cell.state != 0:
                    if wp.max(bend, wp.max(jump_of(x), jump_of(y))) > wp.static(TORN):
                        cell.state = 0
        cell.cubic = cubic
        return cell

    return judge
