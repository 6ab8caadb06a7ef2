"""The beam's cells by their edges: each edge between two triangles followed once, into a map of steps.

A thread walks over a block of cells, so that the edges between them, too, are followed once. On a CPU the block is a
strip; on a GPU it is one cell, whose four sides are then followed by both its neighbours.
"""

import functools

import warp as wp

from .cell import make_judge
from .deposit import FLUX
from .edge_patch import is_within, make_add_quad, make_deposit_edged_patch
from .edge_triangle import make_deposit_edged_triangle
from .edges import DENSITY, make_add_edge
from .lattice import Lattice, pixel_base, pixel_fraction, share_of_cell
from .ledger import bin_of, make_account, make_close_account, make_count_unlanded, make_enter_landed
from .patch import arrived_plane, make_cell_mean, make_flux_mean
from .photon import LANDED, LANDED_ON_OBJECT, LOST, SunSample
from .quarters import make_deposit_quarters
from .spec import Spec


@wp.func
def landed_at(lattice: Lattice, index: wp.vec2i, planes: wp.array3d[float], row: int, column: int) -> wp.vec2d:
    """Where a lattice point lands [pixels]; the same bits for all cells around it."""
    step = wp.float64(lattice.step)
    return wp.vec2d(
        wp.float64(index[0]) * step + wp.float64(planes[0, row + 1, column + 1]),
        wp.float64(index[1]) * step + wp.float64(planes[1, row + 1, column + 1]),
    )


@functools.cache
def make_deposit_cut(spec: Spec) -> wp.Function:
    """Deposit a cell that is not cut into parts, but by the border of the map or of the water; return what fell in."""
    deposit_triangle = make_deposit_edged_triangle(spec.channels)
    flux_type = FLUX[spec.channels]

    @wp.func
    def deposit_cut(
        map: wp.array[wp.float64], size: wp.vec2i, low: wp.vec2, side: wp.vec2, planes: wp.array3d[float], row: int,
        column: int, lower: flux_type, upper: flux_type,
    ) -> flux_type:  # fmt: skip
        near = wp.vec2d(wp.float64(low[0]), wp.float64(low[1]))
        far = wp.vec2d(wp.float64(low[0] + side[0]), wp.float64(low[1] + side[1]))
        i = column + 1
        j = row + 1
        a = near + wp.vec2d(wp.float64(planes[0, j, i]), wp.float64(planes[1, j, i]))
        b = wp.vec2d(far[0] + wp.float64(planes[0, j, i + 1]), near[1] + wp.float64(planes[1, j, i + 1]))
        c = far + wp.vec2d(wp.float64(planes[0, j + 1, i + 1]), wp.float64(planes[1, j + 1, i + 1]))
        d = wp.vec2d(near[0] + wp.float64(planes[0, j + 1, i]), far[1] + wp.float64(planes[1, j + 1, i]))
        inside = lower * deposit_triangle(map, size, a, b, c, lower)
        return inside + upper * deposit_triangle(map, size, a, c, d, upper)

    return deposit_cut


@functools.cache
def make_edge_cells(spec: Spec, refine: bool) -> wp.Kernel:
    """Deposit the cells of a strip into a map of steps."""
    channels = spec.channels
    judge = make_judge(spec, refine)
    cell_mean = make_cell_mean(refine)
    flux_mean = make_flux_mean(spec, refine)
    add_edge = make_add_edge(channels)
    add_quad = make_add_quad(channels)
    deposit_cut = make_deposit_cut(spec)
    deposit_patch = make_deposit_edged_patch(spec)
    deposit_quarters = make_deposit_quarters(spec)
    enter_landed, close_account, account_type = make_enter_landed(spec), make_close_account(spec), make_account(spec)
    count_unlanded = make_count_unlanded(spec)
    flux_type, density_type = FLUX[channels], DENSITY[channels]
    bounded = spec.bounded
    breaks, fresnel, arrived = spec.breaks, spec.fresnel, arrived_plane(spec)

    @wp.kernel(module="unique", enable_backward=False)
    def cells(
        # In:
        suns: wp.array[SunSample],
        sun: int,
        lattice: Lattice,
        first_row: int,
        planes: wp.array3d[float],
        state: wp.array2d[wp.uint8],
        block: wp.vec2i,
        extent: wp.vec2i,
        # Out:
        above_out: wp.array2d[wp.float64],
        torn_cells_out: wp.array2d[wp.uint8],
        map_out: wp.array[wp.float64],
        ledger_out: wp.array2d[wp.float64],
    ):
        """One thread a block of cells (columns, rows) of the strip, whose size is ``extent``.

        Launch dims (rows, columns) of blocks. ``above_out`` keeps, for each column, the density under the edge between
        a row and the next.
        """
        block_row, block_column = wp.tid()
        first = wp.vec2i(block_column * block[0], block_row * block[1])
        last = wp.vec2i(wp.min(first[0] + block[0], extent[0]), wp.min(first[1] + block[1], extent[1]))
        light = suns[sun]
        pitch = lattice.map[0] + 1
        for row in range(first[1], last[1]):
            left = density_type()  # of the cell before, on the other side of the edge to this one
            bin = bin_of(row, first[0])
            account = account_type()
            start = wp.vec2i(lattice.first[0] + first[0], first_row + row)
            a = landed_at(lattice, start, planes, row, first[0])
            d = landed_at(lattice, start + wp.vec2i(0, 1), planes, row + 1, first[0])
            for column in range(first[0], last[0]):
                index = wp.vec2i(lattice.first[0] + column, first_row + row)
                cell = judge(lattice, light.rest_shift, index, planes, state, row, column)
                b = landed_at(lattice, index + wp.vec2i(1, 0), planes, row, column + 1)
                c = landed_at(lattice, index + wp.vec2i(1, 1), planes, row + 1, column + 1)
                below = density_type()
                above = density_type()
                common = cell.state
                if cell.side[0] > 0.0 and cell.side[1] > 0.0:
                    share = float(1.0)
                    if wp.static(bounded):
                        share = share_of_cell(lattice, cell.low, cell.low + cell.side)
                    incident = share * cell_mean(planes, 2, row, column, cell.cubic)
                    transmitted = incident
                    if wp.static(fresnel):
                        transmitted = share * cell_mean(planes, 3, row, column, cell.cubic)
                    if common != 0 and not wp.isfinite(incident):
                        # A corner beside it is no number: the cell takes in what it would at rest, and none arrives.
                        common = int(LOST)
                        incident = -share * light.direction[2]
                        transmitted = incident
                    if common == LANDED or common == LANDED_ON_OBJECT:
                        mean = flux_mean(planes, row, column, cell.cubic)
                        flux = share * mean
                        inside = flux
                        within = is_within(a, b, c, d, lattice.map, cell.spare)
                        if cell.parts == 1:
                            lower = flux_type()
                            for k in range(wp.static(channels)):
                                plane = wp.static(arrived) + k
                                tilt = planes[plane, row + 1, column + 2] - planes[plane, row + 2, column + 1]
                                lower[k] = 0.5 * flux[k] + share * tilt * wp.static(1.0 / 12.0)
                            if within and cell.whole == 1:
                                below, above = add_quad(map_out, lattice.map, a, b, c, d, lower, flux - lower)
                            else:
                                inside = deposit_cut(
                                    map_out, lattice.map, cell.low, cell.side, planes, row, column, lower, flux - lower
                                )
                        if wp.static(refine):
                            if cell.parts == 2 and within and cell.cubic == 1:
                                step = wp.float64(lattice.step)
                                corner = wp.vec2d(wp.float64(index[0]) * step, wp.float64(index[1]) * step)
                                deposit_quarters(map_out, lattice.map, corner, step, planes, row, column, mean)
                            elif cell.parts > 1:
                                base = pixel_base(cell.low)
                                inside = deposit_patch(
                                    map_out, lattice, base, pixel_fraction(cell.low, base), cell.side, planes, row,
                                    column, cell.parts, cell.cubic, mean, within,
                                )  # fmt: skip
                        account = enter_landed(account, incident, transmitted, flux, inside)
                    elif common != 0:
                        count_unlanded(ledger_out, bin, common, incident, transmitted)
                if wp.static(breaks):
                    torn = common == 0 and cell.side[0] > 0.0 and cell.side[1] > 0.0
                    torn_cells_out[row, column] = wp.uint8(wp.where(torn, 1, 0))
                under = density_type()
                if row > first[1]:
                    for k in range(wp.static(channels)):
                        under[k] = above_out[column, k]
                add_edge(map_out, pitch, a, b, below - under)
                add_edge(map_out, pitch, d, a, above - left)
                add_edge(map_out, pitch, c, a, below - above)
                if row + 1 == last[1]:
                    add_edge(map_out, pitch, c, d, above)
                else:
                    for k in range(wp.static(channels)):
                        above_out[column, k] = above[k]
                if column + 1 == last[0]:
                    add_edge(map_out, pitch, b, c, below)
                left = below
                a = b
                d = c
            close_account(ledger_out, bin, account)

    return cells
