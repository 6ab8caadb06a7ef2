"""Yuksel & Keyser's gather: intersections, pass 1 along rows, pass 2 along columns.

As published, with the errata mended: the illumination centre is P_C = P_G - h R0_xy / |R0_z|, channels are counted
from zero, and pass 2 fetches channel j from j - M/2 rows above. The lattice of the intersections is the map's own
pixels with a border; the lattice's anchor makes each pixel's illumination centre its own cell. The border holds all
the water that can light the map, also where the windows are narrower, so that what they miss is known.
"""

import functools

import warp as wp

from .deposit import FLUX
from .lattice import Lattice, at_rest, clip_to_water, deviation, on_water, share_of_cell
from .ledger import MISSED_BY_WINDOW, bin_of, make_book_landed, make_count_unlanded, tally
from .photon import LANDED, Scene, SunSample, make_photon
from .spec import Spec
from .wave_table import make_water_on_lattice


@wp.func
def box_overlap(distance: float) -> float:
    """Overlap of two unit intervals whose middles are this far apart (the paper's ax and ay)."""
    return wp.max(0.0, 1.0 - wp.abs(distance))


@functools.cache
def make_intersections(spec: Spec) -> wp.Kernel:
    """The pre-pass: where the light of each sample lands, and how much of it there is."""
    photon = make_photon(spec)
    water_on_lattice = make_water_on_lattice(spec)
    book_landed = make_book_landed(spec)
    count_unlanded = make_count_unlanded(spec)
    flux_type = FLUX[spec.channels]
    channels, bounded = spec.channels, spec.bounded

    @wp.kernel(module="unique", enable_backward=False)
    def intersections(
        # In:
        begin: int,
        scene: Scene,
        suns: wp.array[SunSample],
        sun: int,
        lattice: Lattice,
        column_waves: wp.array2d[wp.vec2],
        row_waves: wp.array2d[wp.vec2],
        # Out:
        landing_out: wp.array2d[wp.vec2],
        flux_out: wp.array2d[flux_type],
        ledger_out: wp.array2d[wp.float64],
    ):
        """One thread a sample; launch dims (rows, columns) of the lattice, from row ``begin``.

        Landings are in pixels from the sample's own.
        """
        row, column = wp.tid()
        row += begin
        light = suns[sun]
        index = wp.vec2i(lattice.first[0] + column, lattice.first[1] + row)
        pixel = at_rest(lattice, index, 0.5)
        rest = pixel
        share = float(1.0)
        if wp.static(bounded):
            # A sample at the water's border stands for what is left of its cell, and still lands as a whole pixel.
            low = clip_to_water(lattice, at_rest(lattice, index, 0.0), light.rest_shift)
            high = clip_to_water(lattice, at_rest(lattice, index, 1.0), light.rest_shift)
            rest = 0.5 * (low + high)
            share = wp.max(share_of_cell(lattice, low, high), 0.0)
        water = on_water(lattice, rest, light.rest_shift)
        z = water_on_lattice(scene, column_waves, row_waves, column, row, water)
        result = photon(scene, light.direction, water, z)
        offset = deviation(lattice, result.distance, result.direction, light.rest_shift)
        bin = bin_of(row, column)
        flux = flux_type()
        if result.state == LANDED:
            for c in range(wp.static(channels)):
                flux[c] = share * result.arrived[c]
            inside = box_inside(pixel[0] + offset[0], lattice.map[0]) * box_inside(pixel[1] + offset[1], lattice.map[1])
            book_landed(ledger_out, bin, share * result.incident, share * result.transmitted, flux, inside * flux)
            # What lands in the map; the host takes off what the windows then find of it.
            for c in range(wp.static(channels)):
                tally(ledger_out, MISSED_BY_WINDOW * wp.static(channels) + c, bin, inside * flux[c])
        else:
            count_unlanded(ledger_out, bin, result.state, share * result.incident, share * result.transmitted)
        landing_out[row, column] = offset
        flux_out[row, column] = flux

    return intersections


@wp.func
def box_inside(middle: float, count: int) -> float:
    """Share of a unit interval around ``middle`` that lies in [0, count]."""
    return wp.max(0.0, wp.min(middle + 0.5, float(count)) - wp.max(middle - 0.5, 0.0))


@functools.cache
def make_rows(channels: int) -> wp.Kernel:
    """Pass 1: what the n samples beside a pixel, in its row, give to the m + 1 pixels of its column around it."""
    flux_type = FLUX[channels]

    @wp.kernel(module="unique", enable_backward=False)
    def rows(
        # In:
        begin: int,
        landing: wp.array2d[wp.vec2],
        flux: wp.array2d[flux_type],
        first: wp.vec2i,
        n: int,
        m: int,
        # Out:
        channel_out: wp.array3d[flux_type],
    ):
        """One thread a pixel of a column of the map that reaches m / 2 rows past it; launch dims (rows, columns).

        ``channel_out[j, row, column]`` is what row ``row`` gives to the pixel ``j - m / 2`` rows above it; ``first`` is
        the sample (column, row) at which the window of the pixel of row 0 and column 0 begins. Rows from ``begin``.
        """
        row, column = wp.tid()
        row += begin
        for j in range(m + 1):
            channel_out[j, row, column] = flux_type()
        for i in range(n):
            at = wp.vec2i(column + first[0] + i, row + first[1])
            sample = landing[at[1], at[0]]
            ax = box_overlap(sample[0] + float(i - n // 2))
            if ax > 0.0:
                light = ax * flux[at[1], at[0]]
                for j in range(m + 1):
                    ay = box_overlap(sample[1] - float(j - m // 2))
                    if ay > 0.0:
                        channel_out[j, row, column] = channel_out[j, row, column] + ay * light

    return rows


@functools.cache
def make_columns(channels: int) -> wp.Kernel:
    """Pass 2: a pixel adds up what the rows around it have for it."""
    flux_type = FLUX[channels]

    @wp.kernel(module="unique", enable_backward=False)
    def columns(
        # In:
        begin: int,
        channel: wp.array3d[flux_type],
        m: int,
        # Out:
        map_out: wp.array[float],
    ):
        """One thread a pixel of the map, from row ``begin``; launch dims (rows, columns)."""
        row, column = wp.tid()
        row += begin
        total = flux_type()
        for j in range(m + 1):
            # Row r of the channels is map row r - m / 2: what lies j - m / 2 below gives through channel j.
            total += channel[j, row + m - j, column]
        at = (row * channel.shape[2] + column) * wp.static(channels)
        for c in range(wp.static(channels)):
            map_out[at + c] = map_out[at + c] + total[c]

    return columns
