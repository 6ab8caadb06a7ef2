"""The beam's cells by their edges on a CPU, row by row: :mod:`.edge_cells` where nothing tears or cuts a cell.

What a cell does before its edges are followed, that is how it bends, whether it lands in the map or in one pixel, and
the densities of its triangles, is worked out for many columns at once, in :mod:`.lanes`. Then each cell is deposited by
the way that was found for it.
"""

import functools

import warp as wp

from .cell import BEND_LEAST, BEND_MOST, BEND_SHARE, BULGE, FINEST, second_difference
from .deposit import FLUX
from .edge_cells import landed_at, make_deposit_cut
from .edge_patch import make_deposit_edged_patch
from .edges import DENSITY, SLIVER, make_add_edge, make_put_flux
from .lanes import LANES, lanes
from .lattice import Lattice, at_rest, pixel_base, pixel_fraction
from .ledger import bin_of, make_account, make_close_account, make_count_unlanded, make_enter_landed
from .patch import arrived_plane
from .photon import LOST, SunSample
from .quarters import make_deposit_quarters
from .spec import Spec

BY_EDGES = wp.constant(0)  # its triangles have densities, and its edges are followed
IN_ONE_PIXEL = wp.constant(1)
BY_TRIANGLES = wp.constant(2)  # it crosses the border of the map, or one of its triangles has no area
IN_QUARTERS = wp.constant(3)
IN_PARTS = wp.constant(4)
BESIDE = wp.constant(5)  # it lands beside the map
UNKNOWN = wp.constant(6)  # a corner is no number

wide_lanes = wp.types.vector(length=LANES, dtype=wp.float64)
ways = wp.types.vector(length=LANES, dtype=wp.int32)


def serves_rows(spec: Spec) -> bool:
    """Whether a scene's cells can be judged here: all corners land, on one channel, and no border cuts the water."""
    return not (spec.breaks or spec.bounded or spec.attenuation != "none")


@wp.struct
class Block:
    """Cells side by side: their fluxes, the densities of their triangles, and the ways that were found for them."""

    below: wide_lanes
    above: wide_lanes
    incident: lanes
    flux: lanes
    lower: lanes  # flux of the lower triangle
    way: ways
    parts: ways  # along each side
    within: lanes  # 1 where it lands in the map with room for its bulge


@wp.func
def load(planes: wp.array3d[float], plane: int, row: int, column: int) -> lanes:
    """Corners side by side, from any column on."""
    at = (plane * planes.shape[1] + row) * planes.shape[2] + column
    view = wp.array(ptr=planes.ptr + wp.uint64(4) * wp.uint64(at), shape=(1,), dtype=lanes)
    return view[0]


@wp.func
def cubic_line(planes: wp.array3d[float], plane: int, row: int, column: int) -> lanes:
    """A row of :func:`cubic_mean`, times 24."""
    inner = load(planes, plane, row, column + 1) + load(planes, plane, row, column + 2)
    return 13.0 * inner - (load(planes, plane, row, column) + load(planes, plane, row, column + 3))


@wp.func
def cubic_mean(planes: wp.array3d[float], plane: int, row: int, column: int) -> lanes:
    """Means of a plane over cells by the integrals of their cubics, as :func:`.patch.integral_weights`."""
    inner = cubic_line(planes, plane, row + 1, column) + cubic_line(planes, plane, row + 2, column)
    outer = cubic_line(planes, plane, row, column) + cubic_line(planes, plane, row + 3, column)
    return (13.0 * inner - outer) / 576.0


@wp.func
def corner_means(planes: wp.array3d[float], plane: int, row: int, column: int) -> lanes:
    """Means of a plane over cells whose sides are straight."""
    low = load(planes, plane, row + 1, column + 1) + load(planes, plane, row + 1, column + 2)
    high = load(planes, plane, row + 2, column + 1) + load(planes, plane, row + 2, column + 2)
    return 0.25 * (low + high)


@wp.func
def curvature(a: float, b: float, c: float) -> float:
    """Second difference of three values."""
    return wp.abs(a - 2.0 * b + c)


@wp.func
def line_curvature(a: lanes, b: lanes, c: lanes, d: lanes, worst: lanes) -> lanes:
    """The larger of ``worst`` and the second differences of four values, lane by lane."""
    larger = lanes()
    for k in range(wp.static(LANES)):
        here = wp.max(curvature(a[k], b[k], c[k]), curvature(b[k], c[k], d[k]))
        larger[k] = wp.max(worst[k], here)
    return larger


@wp.func
def bulges(planes: wp.array3d[float], plane: int, row: int, column: int) -> lanes:
    """As :func:`.cell.bulge_of`, of cells side by side."""
    worst = lanes()
    for i in range(wp.static(4)):
        worst = line_curvature(
            load(planes, plane, row + i, column),
            load(planes, plane, row + i, column + 1),
            load(planes, plane, row + i, column + 2),
            load(planes, plane, row + i, column + 3),
            worst,
        )
        worst = line_curvature(
            load(planes, plane, row, column + i),
            load(planes, plane, row + 1, column + i),
            load(planes, plane, row + 2, column + i),
            load(planes, plane, row + 3, column + i),
            worst,
        )
    return wp.static(BULGE) * worst


@wp.func
def bends(planes: wp.array3d[float], plane: int, row: int, column: int) -> lanes:
    """As :func:`.cell.bend_of`, of cells side by side."""
    a = load(planes, plane, row + 1, column + 1)
    b = load(planes, plane, row + 1, column + 2)
    c = load(planes, plane, row + 2, column + 1)
    d = load(planes, plane, row + 2, column + 2)
    before_a = load(planes, plane, row + 1, column)
    after_b = load(planes, plane, row + 1, column + 3)
    before_c = load(planes, plane, row + 2, column)
    after_d = load(planes, plane, row + 2, column + 3)
    under_a = load(planes, plane, row, column + 1)
    under_b = load(planes, plane, row, column + 2)
    over_c = load(planes, plane, row + 3, column + 1)
    over_d = load(planes, plane, row + 3, column + 2)
    worst = lanes()
    for k in range(wp.static(LANES)):
        along = wp.max(
            second_difference(before_a[k], a[k], b[k], after_b[k]),
            second_difference(before_c[k], c[k], d[k], after_d[k]),
        )
        across = wp.max(
            second_difference(under_a[k], a[k], c[k], over_c[k]), second_difference(under_b[k], b[k], d[k], over_d[k])
        )
        worst[k] = wp.max(wp.max(along, across), 0.25 * wp.abs(a[k] - b[k] + d[k] - c[k]))
    return worst


@functools.cache
def make_judge_block(spec: Spec, refine: bool) -> wp.Function:
    """Judge cells side by side, as :func:`.cell.make_judge` and :func:`.edge_patch.make_add_quad` do one by one."""
    arrived = arrived_plane(spec)

    @wp.func
    def judge_block(lattice: Lattice, index: wp.vec2i, planes: wp.array3d[float], row: int, column: int) -> Block:
        """``index`` is that of the first cell, (row, column) its place in the strip."""
        a_dx = load(planes, 0, row + 1, column + 1)
        a_dy = load(planes, 1, row + 1, column + 1)
        b_dx = load(planes, 0, row + 1, column + 2)
        b_dy = load(planes, 1, row + 1, column + 2)
        c_dx = load(planes, 0, row + 2, column + 2)
        c_dy = load(planes, 1, row + 2, column + 2)
        d_dx = load(planes, 0, row + 2, column + 1)
        d_dy = load(planes, 1, row + 2, column + 1)
        block = Block()
        tilt = load(planes, wp.static(arrived), row + 1, column + 2) - load(
            planes, wp.static(arrived), row + 2, column + 1
        )
        if wp.static(refine):
            flux = cubic_mean(planes, wp.static(arrived), row, column)
            incident = flux
            if wp.static(arrived > 2):
                incident = cubic_mean(planes, 2, row, column)
            bend_x = bends(planes, 0, row, column)
            bend_y = bends(planes, 1, row, column)
            bulge_x = bulges(planes, 0, row, column)
            bulge_y = bulges(planes, 1, row, column)
        else:
            flux = corner_means(planes, wp.static(arrived), row, column)
            incident = flux
            if wp.static(arrived > 2):
                incident = corner_means(planes, 2, row, column)
        step = wp.float64(lattice.step)
        side = lattice.step
        bottom = wp.float64(index[1]) * step
        top = wp.float64(index[1] + 1) * step
        width = wp.float64(lattice.map[0])
        height = wp.float64(lattice.map[1])
        none = wp.float64(0.0)
        below = wide_lanes()
        above = wide_lanes()
        lower = lanes()
        way = ways()
        parts = ways()
        within = lanes()
        for k in range(wp.static(LANES)):
            left = wp.float64(index[0] + k) * step
            right = wp.float64(index[0] + k + 1) * step
            ax = left + wp.float64(a_dx[k])
            ay = bottom + wp.float64(a_dy[k])
            bx = right + wp.float64(b_dx[k])
            by = bottom + wp.float64(b_dy[k])
            cx = right + wp.float64(c_dx[k])
            cy = top + wp.float64(c_dy[k])
            dx = left + wp.float64(d_dx[k])
            dy = top + wp.float64(d_dy[k])
            low_x = wp.min(wp.min(ax, bx), wp.min(cx, dx))
            low_y = wp.min(wp.min(ay, by), wp.min(cy, dy))
            high_x = wp.max(wp.max(ax, bx), wp.max(cx, dx))
            high_y = wp.max(wp.max(ay, by), wp.max(cy, dy))
            n = int(1)
            room = float(0.0)
            if wp.static(refine):
                bend = wp.max(bend_x[k], bend_y[k])
                up_x = side + c_dx[k] - a_dx[k]
                up_y = side + c_dy[k] - a_dy[k]
                down_x = side + b_dx[k] - d_dx[k]
                down_y = b_dy[k] - d_dy[k] - side
                area = 0.5 * wp.abs(up_x * down_y - up_y * down_x)
                longest = wp.sqrt(wp.max(up_x * up_x + up_y * up_y, down_x * down_x + down_y * down_y))
                thick = area / wp.max(longest, 1.0e-6)
                left_over = wp.clamp(wp.static(BEND_SHARE) * thick, wp.static(BEND_LEAST), wp.static(BEND_MOST))
                bulge = wp.max(bulge_x[k], bulge_y[k]) + 1.0  # and what rounding may do
                far = wp.float64(bulge)
                beside = high_x < -far or low_x > width + far or high_y < -far or low_y > height + far
                cut = bend > left_over and not beside
                pieces = wp.min(wp.ceil(wp.sqrt(bend / left_over)), wp.static(float(FINEST)))
                n = wp.where(cut, int(wp.where(cut, pieces, 1.0)), 1)
                room = wp.where(cut, bulge, 0.0)
            edge = wp.float64(room)
            inside = low_x >= edge and low_y >= edge and high_x < width - edge and high_y < height - edge
            total = ax + ay + bx + by + cx + cy + dx + dy
            known = total - total == none and incident[k] - incident[k] == 0.0
            flux_below = 0.5 * flux[k] + tilt[k] * wp.static(1.0 / 12.0)
            doubled_below = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
            doubled_above = (cx - ax) * (dy - ay) - (dx - ax) * (cy - ay)
            diagonal = wp.abs(cx - ax) + wp.abs(cy - ay)
            reach_below = diagonal + wp.abs(bx - ax) + wp.abs(by - ay)
            reach_above = diagonal + wp.abs(dx - ax) + wp.abs(dy - ay)
            solid = wp.abs(doubled_below) > SLIVER * reach_below and wp.abs(doubled_above) > SLIVER * reach_above
            one = wp.floor(low_x) == wp.floor(high_x) and wp.floor(low_y) == wp.floor(high_y)
            found = wp.where(solid, BY_EDGES, BY_TRIANGLES)
            found = wp.where(one, IN_ONE_PIXEL, found)
            found = wp.where(inside, found, BY_TRIANGLES)
            missed = high_x < none or low_x > width or high_y < none or low_y > height
            found = wp.where(missed, BESIDE, found)
            found = wp.where(n > 1, wp.where(n == 2 and inside, IN_QUARTERS, IN_PARTS), found)
            found = wp.where(known, found, UNKNOWN)
            two = wp.float64(2.0)
            edged = found == BY_EDGES
            below[k] = wp.where(edged, two * wp.float64(flux_below) / doubled_below, none)
            above[k] = wp.where(edged, two * wp.float64(flux[k] - flux_below) / doubled_above, none)
            lower[k] = flux_below
            way[k] = found
            parts[k] = n
            within[k] = wp.where(inside, 1.0, 0.0)
        block.below = below
        block.above = above
        block.incident = incident
        block.flux = flux
        block.lower = lower
        block.way = way
        block.parts = parts
        block.within = within
        return block

    return judge_block


@functools.cache
def make_cell_rows(spec: Spec, refine: bool) -> wp.Kernel:
    """Deposit the cells of a strip into a map of steps, a strip a thread."""
    judge_block = make_judge_block(spec, refine)
    add_edge, put_flux = make_add_edge(1), make_put_flux(1)
    deposit_cut = make_deposit_cut(spec)
    deposit_quarters = make_deposit_quarters(spec)
    deposit_patch = make_deposit_edged_patch(spec)
    enter_landed, close_account, account_type = make_enter_landed(spec), make_close_account(spec), make_account(spec)
    count_unlanded = make_count_unlanded(spec)
    flux_type, density_type = FLUX[1], DENSITY[1]

    @wp.kernel(module="unique", enable_backward=False)
    def cells(
        # In:
        suns: wp.array[SunSample],
        sun: int,
        lattice: Lattice,
        first_row: int,
        planes: wp.array3d[float],
        extent: wp.vec2i,
        # Out:
        above_out: wp.array2d[wp.float64],
        map_out: wp.array[wp.float64],
        ledger_out: wp.array2d[wp.float64],
    ):
        """One thread all cells of the strip, ``extent`` (columns, rows); ``above_out`` as in :mod:`.edge_cells`."""
        wp.tid()
        pitch = lattice.map[0] + 1
        step = wp.float64(lattice.step)
        side = wp.vec2(lattice.step, lattice.step)
        for row in range(extent[1]):
            left = density_type()  # of the cell before, on the other side of the edge to this one
            bin = bin_of(row, 0)
            account = account_type()
            start = wp.vec2i(lattice.first[0], first_row + row)
            a = landed_at(lattice, start, planes, row, 0)
            d = landed_at(lattice, start + wp.vec2i(0, 1), planes, row + 1, 0)
            for first in range(0, extent[0], wp.static(LANES)):
                index = wp.vec2i(lattice.first[0] + first, first_row + row)
                block = judge_block(lattice, index, planes, row, first)
                densities_below = block.below
                densities_above = block.above
                incidents = block.incident
                fluxes = block.flux
                lowers = block.lower
                ways_found = block.way
                parts = block.parts
                withins = block.within
                for k in range(wp.min(wp.static(LANES), extent[0] - first)):
                    column = first + k
                    after = wp.vec2i(index[0] + k + 1, index[1])
                    b = landed_at(lattice, after, planes, row, column + 1)
                    c = landed_at(lattice, after + wp.vec2i(0, 1), planes, row + 1, column + 1)
                    below = density_type(densities_below[k])
                    above = density_type(densities_above[k])
                    flux = flux_type(fluxes[k])
                    inside = flux
                    way = ways_found[k]
                    if way != BY_EDGES:
                        here = wp.vec2i(index[0] + k, index[1])
                        low = at_rest(lattice, here, 0.0)
                        if way == IN_ONE_PIXEL:
                            put_flux(map_out, int(a[1]) * pitch + int(a[0]), flux, 1.0)
                        elif way == BESIDE:
                            inside = flux_type()
                        elif way == BY_TRIANGLES:
                            lower = flux_type(lowers[k])
                            inside = deposit_cut(
                                map_out, lattice.map, low, side, planes, row, column, lower, flux - lower
                            )
                        if wp.static(refine):
                            if way == IN_QUARTERS:
                                corner = wp.vec2d(wp.float64(here[0]) * step, wp.float64(here[1]) * step)
                                deposit_quarters(map_out, lattice.map, corner, step, planes, row, column, flux)
                            elif way == IN_PARTS:
                                base = pixel_base(low)
                                within = withins[k] > 0.0
                                inside = deposit_patch(
                                    map_out, lattice, base, pixel_fraction(low, base), side, planes, row, column,
                                    parts[k], 1, flux, within,
                                )  # fmt: skip
                    if way == UNKNOWN:
                        # The cell takes in what it would at rest, and none of it arrives.
                        lost = -suns[sun].direction[2]
                        count_unlanded(ledger_out, bin, LOST, lost, lost)
                    else:
                        account = enter_landed(account, incidents[k], flux[0], flux, inside)
                    under = density_type()
                    if row > 0:
                        under[0] = above_out[column, 0]
                    add_edge(map_out, pitch, a, b, below - under)
                    add_edge(map_out, pitch, d, a, above - left)
                    add_edge(map_out, pitch, c, a, below - above)
                    if row + 1 == extent[1]:
                        add_edge(map_out, pitch, c, d, above)
                    else:
                        above_out[column, 0] = above[0]
                    if column + 1 == extent[0]:
                        add_edge(map_out, pitch, b, c, below)
                    left = below
                    a = b
                    d = c
            close_account(ledger_out, bin, account)

    return cells
