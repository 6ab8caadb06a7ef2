"""The gather as a scatter: the same sum from the other side, each sample's box added once to the pixels it covers.

Yuksel & Keyser's pixel takes from each of N x (M + 1) samples what its box overlaps; all but four products of a sample
are zero. A sample that adds its box to the four pixels itself does the same sum with four additions, however wide the
windows are: a pixel whose window does not hold the sample is left out, as it would not have looked.
"""

import functools

import warp as wp

from .deposit import FLUX
from .lattice import Lattice, at_rest, clip_to_water, deviation, on_water, share_of_cell
from .ledger import MISSED_BY_WINDOW, bin_of, make_book_landed, make_count_unlanded, tally
from .photon import LANDED, Scene, SunSample, make_photon
from .spec import Spec
from .splat import FARTHEST
from .wave_table import make_water_on_lattice


@functools.cache
def make_deposit_window(channels: int) -> wp.Function:
    """Add a unit box to the pixels whose windows hold its sample; return the share of it that lies in the map."""
    flux_type = FLUX[channels]

    @wp.func
    def add(map: wp.array[float], pixel: int, share: float, flux: flux_type):
        for c in range(wp.static(channels)):
            wp.atomic_add(map, pixel * wp.static(channels) + c, share * flux[c])

    @wp.func
    def deposit_window(
        map: wp.array[float], size: wp.vec2i, own: wp.vec2i, landing: wp.vec2, n: int, m: int, flux: flux_type
    ) -> float:
        """The sample is of pixel ``own``, and lands ``landing`` pixels from there."""
        if not (wp.abs(landing[0]) < wp.static(FARTHEST) and wp.abs(landing[1]) < wp.static(FARTHEST)):
            return 0.0
        left = wp.floor(landing[0])
        below = wp.floor(landing[1])
        i = int(left)
        j = int(below)
        x = own[0] + i
        y = own[1] + j
        if x < -1 or x >= size[0] or y < -1 or y >= size[1]:
            return 0.0
        across = landing[0] - left
        along = landing[1] - below
        half_n = n // 2
        half_m = m // 2
        pixel = y * size[0] + x
        in_map = x >= 0 and x + 1 < size[0] and y >= 0 and y + 1 < size[1]
        if in_map and i >= -half_n and i < half_n and j >= -half_m and j < half_m:
            add(map, pixel, (1.0 - across) * (1.0 - along), flux)
            add(map, pixel + 1, across * (1.0 - along), flux)
            add(map, pixel + size[0], (1.0 - across) * along, flux)
            add(map, pixel + size[0] + 1, across * along, flux)
            return 1.0
        # At the rim of the map or of the windows each of the four is asked for.
        inside = float(0.0)
        for b in range(2):
            tall = wp.where(b == 0, 1.0 - along, along)
            for a in range(2):
                share = wp.where(a == 0, 1.0 - across, across) * tall
                if x + a >= 0 and x + a < size[0] and y + b >= 0 and y + b < size[1]:
                    inside += share
                    if wp.abs(i + a) <= half_n and wp.abs(j + b) <= half_m:
                        add(map, pixel + b * size[0] + a, share, flux)
        return inside

    return deposit_window


@functools.cache
def make_gather_scatter(spec: Spec) -> wp.Kernel:
    """Follow the light of a strip's samples and add their boxes: the pre-pass and both passes of the gather in one."""
    photon = make_photon(spec)
    water_on_lattice = make_water_on_lattice(spec)
    deposit_window = make_deposit_window(spec.channels)
    book_landed = make_book_landed(spec)
    count_unlanded = make_count_unlanded(spec)
    flux_type = FLUX[spec.channels]
    channels, bounded = spec.channels, spec.bounded

    @wp.kernel(module="unique", enable_backward=False)
    def gather_scatter(
        # In:
        scene: Scene,
        suns: wp.array[SunSample],
        sun: int,
        lattice: Lattice,
        first_row: int,
        n: int,
        m: int,
        column_waves: wp.array2d[wp.vec2],
        row_waves: wp.array2d[wp.vec2],
        # Out:
        map_out: wp.array[float],
        ledger_out: wp.array2d[wp.float64],
    ):
        """One thread a sample of the strip; launch dims (rows, columns) of the lattice."""
        row, column = wp.tid()
        light = suns[sun]
        index = wp.vec2i(lattice.first[0] + column, first_row + row)
        rest = at_rest(lattice, index, 0.5)
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
        bin = bin_of(row, column)
        if result.state != LANDED:
            count_unlanded(ledger_out, bin, result.state, share * result.incident, share * result.transmitted)
            return
        landing = deviation(lattice, result.distance, result.direction, light.rest_shift)
        flux = flux_type()
        for c in range(wp.static(channels)):
            flux[c] = share * result.arrived[c]
        inside = deposit_window(map_out, lattice.map, index, landing, n, m, flux)
        book_landed(ledger_out, bin, share * result.incident, share * result.transmitted, flux, inside * flux)
        # What lands in the map; the host takes off what the windows then find of it.
        for c in range(wp.static(channels)):
            tally(ledger_out, MISSED_BY_WINDOW * wp.static(channels) + c, bin, inside * flux[c])

    return gather_scatter
