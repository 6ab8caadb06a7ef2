"""The photon method: one photon a cell of the lattice, through its middle, splatted where it lands."""

import functools

import warp as wp

from .deposit import ACCUMULATOR, FLUX
from .lattice import Lattice, at_rest, clip_to_water, deviation, on_water, pixel_base, pixel_fraction, share_of_cell
from .ledger import make_book_landed, make_count_unlanded
from .photon import LANDED, LANDED_ON_OBJECT, Scene, SunSample, make_photon
from .spec import Spec
from .splat import make_deposit_box
from .wave_table import make_water_on_lattice


@functools.cache
def make_scatter(spec: Spec) -> wp.Kernel:
    """Splat the photons of a strip."""
    photon = make_photon(spec)
    water_on_lattice = make_water_on_lattice(spec)
    deposit_box = make_deposit_box(spec.accumulate, spec.channels)
    book_landed = make_book_landed(spec)
    count_unlanded = make_count_unlanded(spec)
    dtype = ACCUMULATOR[spec.accumulate]
    flux_type = FLUX[spec.channels]
    channels, bounded = spec.channels, spec.bounded

    @wp.kernel(module="unique", enable_backward=False)
    def scatter(
        # In:
        scene: Scene,
        suns: wp.array[SunSample],
        sun: int,
        lattice: Lattice,
        first_row: int,
        footprint: wp.vec2,
        column_waves: wp.array2d[wp.vec2],
        row_waves: wp.array2d[wp.vec2],
        # Out:
        map_out: wp.array[dtype],
        ledger_out: wp.array2d[wp.float64],
    ):
        """One thread a photon of the strip; launch dims (rows, columns) of cells; ``footprint`` in pixels."""
        row, column = wp.tid()
        light = suns[sun]
        index = wp.vec2i(lattice.first[0] + column, first_row + row)
        rest = at_rest(lattice, index, 0.5)
        share = float(1.0)
        if wp.static(bounded):
            low = clip_to_water(lattice, at_rest(lattice, index, 0.0), light.rest_shift)
            high = clip_to_water(lattice, at_rest(lattice, index, 1.0), light.rest_shift)
            rest = 0.5 * (low + high)
            share = share_of_cell(lattice, low, high)
            if not share > 0.0:
                return
        water = on_water(lattice, rest, light.rest_shift)
        z = water_on_lattice(scene, column_waves, row_waves, column, row, water)
        result = photon(scene, light.direction, water, z)
        bin = row * 31 + column
        if result.state != LANDED and result.state != LANDED_ON_OBJECT:
            count_unlanded(ledger_out, bin, result.state, share * result.incident, share * result.transmitted)
            return
        base = pixel_base(rest)
        at = pixel_fraction(rest, base) + deviation(lattice, result.distance, result.direction, light.rest_shift)
        flux = flux_type()
        for c in range(wp.static(channels)):
            flux[c] = share * result.arrived[c]
        inside = deposit_box(map_out, lattice.map, base, at, footprint, flux)
        book_landed(ledger_out, bin, share * result.incident, share * result.transmitted, flux, inside * flux)

    return scatter
