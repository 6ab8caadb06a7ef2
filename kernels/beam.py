"""The beam: cells of the water refracted at their corners, their light deposited by exact overlap with the pixels.

Two passes over a strip of the lattice: :func:`make_corners` lands the corners, with a border of one more, into planes
of numbers; :func:`make_cells` deposits each cell as triangles, cut finer where its landing map bends. Cells whose
corners met different fates are only flagged here: :mod:`.torn` follows them ray by ray.

Planes, each [rows, columns] of corners: deviation x, deviation y [pixels]; incident flux; with Fresnel the transmitted
flux; with attenuation the arrived flux of each channel.
"""

import functools

import warp as wp

from .deposit import ACCUMULATOR, FLUX
from .lattice import Lattice, at_rest, clip_to_water, deviation, on_water, pixel_base, pixel_fraction, share_of_cell
from .ledger import make_book_landed, make_count_unlanded
from .patch import (
    BORDER,
    arrived_plane,
    integral_weights,
    make_deposit_patch,
    misses_map,
    plane_bend,
    plane_jump,
    plane_mean,
    thickness,
)
from .photon import LANDED, LANDED_ON_OBJECT, LOST, Scene, SunSample, make_photon
from .spec import Spec
from .wave_table import make_water_on_lattice

BEND_SHARE = 0.005
"""Bend that is left inside one part of a cell, as a share of the cell's width where it lands."""

BEND_LEAST, BEND_MOST = 0.0005, 0.005
"""Bounds of the bend that is left [pixels]."""

FINEST = 16
"""Parts of a cell along each side at most."""

TORN = 0.25
"""Bend or jump [pixels] past which a cell over a receiver with edges is followed ray by ray instead of interpolated."""


@functools.cache
def make_corners(spec: Spec) -> wp.Kernel:
    """Land the corners of a strip."""
    photon = make_photon(spec)
    water_on_lattice = make_water_on_lattice(spec)
    fresnel, breaks = spec.fresnel, spec.breaks
    absorbs = spec.attenuation != "none"
    channels = spec.channels
    arrived = arrived_plane(spec)

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
        result = photon(scene, light.direction, water, z)
        offset = deviation(lattice, result.distance, result.direction, light.rest_shift)
        planes_out[0, row, column] = offset[0]
        planes_out[1, row, column] = offset[1]
        planes_out[2, row, column] = wp.where(result.state == LOST, wp.NAN, result.incident)
        if wp.static(fresnel):
            planes_out[3, row, column] = result.transmitted
        if wp.static(absorbs):
            for c in range(wp.static(channels)):
                planes_out[wp.static(arrived) + c, row, column] = result.arrived[c]
        if wp.static(breaks):
            state_out[row, column] = wp.uint8(result.state)

    return corners


@wp.func
def common_state(state: wp.array2d[wp.uint8], row: int, column: int, first: int, count: int) -> int:
    """The state that a square of corners shares, or 0; (row + first, column + first) is its first corner."""
    common = int(state[row + first, column + first])
    for j in range(first, first + count):
        for i in range(first, first + count):
            if int(state[row + j, column + i]) != common:
                common = int(0)
    return common


@functools.cache
def make_cells(spec: Spec, refine: bool) -> wp.Kernel:
    """Deposit the cells of a strip."""
    deposit_patch = make_deposit_patch(spec)
    book_landed = make_book_landed(spec)
    count_unlanded = make_count_unlanded(spec)
    dtype = ACCUMULATOR[spec.accumulate]
    flux_type = FLUX[spec.channels]
    channels, breaks, bounded = spec.channels, spec.breaks, spec.bounded
    edges = spec.tears or spec.objects or spec.receiver == "mesh"
    transmitted_plane = 2 + int(spec.fresnel)
    arrived = arrived_plane(spec)

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
        shift = suns[sun].rest_shift
        index = wp.vec2i(lattice.first[0] + column, first_row + row)
        low = at_rest(lattice, index, 0.0)
        high = at_rest(lattice, index, 1.0)
        base = pixel_base(low)
        cubic = int(wp.static(int(refine)))
        whole = int(1)
        if wp.static(bounded):
            # A cell that the water's border cuts keeps what is left of it, without the neighbours' cubic.
            before = clip_to_water(lattice, at_rest(lattice, index, -1.0), shift)
            after = clip_to_water(lattice, at_rest(lattice, index, 2.0), shift)
            low = clip_to_water(lattice, low, shift)
            high = clip_to_water(lattice, high, shift)
            uncut = 2.99 * lattice.step
            if after[0] - before[0] < uncut or after[1] - before[1] < uncut:
                cubic = int(0)
                whole = int(0)
            if high[0] <= low[0] or high[1] <= low[1]:
                if wp.static(breaks):
                    torn_cells_out[row, column] = wp.uint8(0)
                return
        common = int(LANDED)
        if wp.static(breaks):
            common = common_state(state, row, column, 1, 2)
            if common_state(state, row, column, 0, 4) == 0:
                # No interpolant reaches across an edge: beside one, a cell is followed ray by ray like those on it.
                cubic = int(0)
                if common == LANDED or common == LANDED_ON_OBJECT:
                    common = int(0)
        n = int(1)
        if wp.static(refine or edges):
            bend = float(0.0)
            if whole == 1 and common != 0:
                bend = wp.max(plane_bend(planes, 0, row, column), plane_bend(planes, 1, row, column))
            if wp.static(refine):
                thick = thickness(planes, row, column, high - low)
                left = wp.clamp(wp.static(BEND_SHARE) * thick, wp.static(BEND_LEAST), wp.static(BEND_MOST))
                n = wp.clamp(int(wp.ceil(wp.sqrt(bend / left))), 1, wp.static(FINEST))
                # A cubic bulges over its chord by its bend, with room to spare.
                if n > 1 and misses_map(planes, lattice, row, column, low, high - low, 4.0 * bend + 1.0):
                    n = int(1)
            if wp.static(edges):
                if whole == 1 and common != 0:
                    jump = wp.max(plane_jump(planes, 0, row, column), plane_jump(planes, 1, row, column))
                    if wp.max(bend, jump) > wp.static(TORN):
                        common = int(0)
        if wp.static(breaks):
            torn_cells_out[row, column] = wp.uint8(wp.where(common == 0, 1, 0))
        bin = row * 31 + column
        weights = integral_weights(cubic)
        share = share_of_cell(lattice, low, high)
        incident = share * plane_mean(planes, 2, row, column, weights)
        transmitted = share * plane_mean(planes, wp.static(transmitted_plane), row, column, weights)
        if common != 0 and not wp.isfinite(incident):
            # A corner beside it is no number: the cell takes in what it would at rest, and none of it arrives.
            common = int(LOST)
            incident = -share * suns[sun].direction[2]
            transmitted = incident
        if common == LANDED or common == LANDED_ON_OBJECT:
            mean = flux_type()
            for c in range(wp.static(channels)):
                mean[c] = plane_mean(planes, wp.static(arrived) + c, row, column, weights)
            inside = deposit_patch(
                map_out, lattice, base, pixel_fraction(low, base), high - low, planes, row, column, n, cubic, mean
            )
            book_landed(ledger_out, bin, incident, transmitted, share * mean, inside)
        elif common != 0:
            count_unlanded(ledger_out, bin, common, incident, transmitted)

    return cells
