"""The beam: cells of the water refracted at their corners, their light deposited by exact overlap with the pixels.

Two passes over a strip of the lattice: :func:`make_corners` lands the corners, with a border of one more, into planes
of numbers; the cells are then deposited as triangles, cut finer where the landing map bends. :func:`make_cells` does
that triangle by triangle, :mod:`.edge_cells` by the edges between them. Cells whose corners met different fates are
only flagged here: :mod:`.torn` follows them ray by ray.

Planes, each [rows, columns] of corners: deviation x, deviation y [pixels]; incident flux; with Fresnel the transmitted
flux; with attenuation the arrived flux of each channel.
"""

import functools

import warp as wp

from .cell import make_judge
from .deposit import ACCUMULATOR
from .lattice import Lattice, at_rest, deviation, on_water, pixel_base, pixel_fraction, share_of_cell
from .ledger import bin_of, make_book_landed, make_count_unlanded
from .patch import BORDER, arrived_plane, make_cell_mean, make_flux_mean
from .photon import LANDED, LANDED_ON_OBJECT, LOST, Scene, SunSample, make_photon
from .spec import Spec
from .triangle_patch import make_deposit_patch
from .wave_table import make_water_on_lattice


@functools.cache
def make_land_corner(spec: Spec) -> wp.Function:
    """Follow the light of one corner into the planes of a strip."""
    photon = make_photon(spec)
    fresnel, breaks = spec.fresnel, spec.breaks
    absorbs = spec.attenuation != "none"
    channels = spec.channels
    arrived = arrived_plane(spec)

    @wp.func
    def land_corner(
        scene: Scene, light: SunSample, lattice: Lattice, water: wp.vec2, z: wp.vec3, row: int, column: int,
        planes: wp.array3d[float], state: wp.array2d[wp.uint8],
    ):  # fmt: skip
        """``z`` is the water's displacement and slope at the point ``water``."""
        result = photon(scene, light.direction, water, z)
        offset = deviation(lattice, result.distance, result.direction, light.rest_shift)
        planes[0, row, column] = offset[0]
        planes[1, row, column] = offset[1]
        planes[2, row, column] = wp.where(result.state == LOST, wp.NAN, result.incident)
        if wp.static(fresnel):
            planes[3, row, column] = result.transmitted
        if wp.static(absorbs):
            for c in range(wp.static(channels)):
                planes[wp.static(arrived) + c, row, column] = result.arrived[c]
        if wp.static(breaks):
            state[row, column] = wp.uint8(result.state)

    return land_corner


@functools.cache
def make_corners(spec: Spec) -> wp.Kernel:
    """Land the corners of a strip."""
    land_corner = make_land_corner(spec)
    water_on_lattice = make_water_on_lattice(spec)

    @wp.kernel(module="unique", enable_backward=False)
    def corners(
        # In:
        scene: Scene,
        suns: wp.array[SunSample],
        sun: int,
        lattice: Lattice,
        first_row: int,
        column_waves: wp.array2d[wp.vec2],
        row_waves: wp.array2d[wp.vec2],
        # Out:
        planes_out: wp.array3d[float],
        state_out: wp.array2d[wp.uint8],
    ):
        """One thread a corner of the strip with its border; launch dims (rows, columns) of corners."""
        row, column = wp.tid()
        light = suns[sun]
        index = wp.vec2i(lattice.first[0] + column - wp.static(BORDER), first_row + row - wp.static(BORDER))
        water = on_water(lattice, at_rest(lattice, index, 0.0), light.rest_shift)
        z = water_on_lattice(scene, column_waves, row_waves, column, row, water)
        land_corner(scene, light, lattice, water, z, row, column, planes_out, state_out)

    return corners


@functools.cache
def make_cells(spec: Spec, refine: bool) -> wp.Kernel:
    """Deposit the cells of a strip triangle by triangle."""
    judge = make_judge(spec, refine)
    cell_mean = make_cell_mean(refine)
    flux_mean = make_flux_mean(spec, refine)
    deposit_patch = make_deposit_patch(spec)
    book_landed = make_book_landed(spec)
    count_unlanded = make_count_unlanded(spec)
    dtype = ACCUMULATOR[spec.accumulate]
    breaks = spec.breaks
    transmitted_plane = 2 + int(spec.fresnel)

    @wp.kernel(module="unique", enable_backward=False)
    def cells(
        # In:
        suns: wp.array[SunSample],
        sun: int,
        lattice: Lattice,
        first_row: int,
        planes: wp.array3d[float],
        state: wp.array2d[wp.uint8],
        # Out:
        torn_cells_out: wp.array2d[wp.uint8],
        map_out: wp.array[dtype],
        ledger_out: wp.array2d[wp.float64],
    ):
        """One thread a cell of the strip; launch dims (rows, columns) of cells."""
        row, column = wp.tid()
        index = wp.vec2i(lattice.first[0] + column, first_row + row)
        cell = judge(lattice, suns[sun].rest_shift, index, planes, state, row, column)
        if wp.static(breaks):
            torn_cells_out[row, column] = wp.uint8(0)
        if cell.side[0] <= 0.0 or cell.side[1] <= 0.0:
            return
        bin = bin_of(row, column)
        share = share_of_cell(lattice, cell.low, cell.low + cell.side)
        incident = share * cell_mean(planes, 2, row, column, cell.cubic)
        transmitted = share * cell_mean(planes, wp.static(transmitted_plane), row, column, cell.cubic)
        common = cell.state
        if wp.static(breaks):
            torn_cells_out[row, column] = wp.uint8(wp.where(common == 0, 1, 0))
        if common != 0 and not wp.isfinite(incident):
            # A corner beside it is no number: the cell takes in what it would at rest, and none of it arrives.
            common = int(LOST)
            incident = -share * suns[sun].direction[2]
            transmitted = incident
        if common == LANDED or common == LANDED_ON_OBJECT:
            mean = flux_mean(planes, row, column, cell.cubic)
            base = pixel_base(cell.low)
            corner = pixel_fraction(cell.low, base)
            inside = deposit_patch(
                map_out, lattice, base, corner, cell.side, planes, row, column, cell.parts, cell.cubic, mean
            )
            book_landed(ledger_out, bin, incident, transmitted, share * mean, inside)
        elif common != 0:
            count_unlanded(ledger_out, bin, common, incident, transmitted)

    return cells
