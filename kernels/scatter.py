"""The photon method: one photon a cell of the lattice, through its middle, splatted where it lands.

A thread takes a run of columns: on a CPU a whole row, so that what the row's photons share is read once and its light
is booked once; on a GPU one, so that neighbouring threads read neighbouring photons.
"""

import functools

import warp as wp

from .deposit import ACCUMULATOR, FLUX
from .lattice import Lattice, at_rest, clip_to_water, deviation, on_water, pixel_base, pixel_fraction, share_of_cell
from .ledger import bin_of, make_account, make_close_account, make_count_unlanded, make_enter_landed
from .photon import LANDED, LANDED_ON_OBJECT, Scene, SunSample, make_photon
from .spec import Spec
from .splat import make_deposit_box
from .wave_table import make_water_on_lattice


@wp.struct
class Cell:
    """A cell of the lattice, as a photon stands for it."""

    rest: wp.vec2  # where its middle lands at rest [pixels]
    share: float  # of its area that has water
    water: wp.vec2  # where its middle stands [m from the map's origin]


@functools.cache
def make_cell(spec: Spec) -> wp.Function:
    """Find a cell's middle, of what a border leaves of it."""
    bounded = spec.bounded

    @wp.func
    def cell_at(lattice: Lattice, light: SunSample, index: wp.vec2i) -> Cell:
        cell = Cell()
        cell.rest = at_rest(lattice, index, 0.5)
        cell.share = 1.0
        if wp.static(bounded):
            low = clip_to_water(lattice, at_rest(lattice, index, 0.0), light.rest_shift)
            high = clip_to_water(lattice, at_rest(lattice, index, 1.0), light.rest_shift)
            cell.rest = 0.5 * (low + high)
            cell.share = share_of_cell(lattice, low, high)
        cell.water = on_water(lattice, cell.rest, light.rest_shift)
        return cell

    return cell_at


@functools.cache
def make_splat_photon(spec: Spec) -> wp.Function:
    """Follow a cell's photon, splat it, and enter it into an account; return the account."""
    photon = make_photon(spec)
    deposit_box = make_deposit_box(spec.accumulate, spec.channels)
    enter_landed, count_unlanded = make_enter_landed(spec), make_count_unlanded(spec)
    dtype = ACCUMULATOR[spec.accumulate]
    flux_type, account_type = FLUX[spec.channels], make_account(spec)
    channels = spec.channels

    @wp.func
    def splat_photon(
        scene: Scene, light: SunSample, lattice: Lattice, footprint: wp.vec2, cell: Cell, z: wp.vec3, bin: int,
        account: account_type, map: wp.array[dtype], ledger: wp.array2d[wp.float64],
    ) -> account_type:  # fmt: skip
        """``z`` is the water's displacement and slope at the cell's middle; ``footprint`` is in pixels."""
        share = cell.share
        result = photon(scene, light.direction, cell.water, z)
        if result.state != LANDED and result.state != LANDED_ON_OBJECT:
            count_unlanded(ledger, bin, result.state, share * result.incident, share * result.transmitted)
            return account
        base = pixel_base(cell.rest)
        at = pixel_fraction(cell.rest, base)
        at += deviation(lattice, result.distance, result.direction, light.rest_shift)
        flux = flux_type()
        for c in range(wp.static(channels)):
            flux[c] = share * result.arrived[c]
        inside = deposit_box(map, lattice.map, base, at, footprint, flux)
        return enter_landed(account, share * result.incident, share * result.transmitted, flux, inside * flux)

    return splat_photon


@functools.cache
def make_scatter(spec: Spec) -> wp.Kernel:
    """Splat the photons of a strip."""
    water_on_lattice = make_water_on_lattice(spec)
    cell_at, splat_photon, close_account = make_cell(spec), make_splat_photon(spec), make_close_account(spec)
    dtype, account_type = ACCUMULATOR[spec.accumulate], make_account(spec)

    @wp.kernel(module="unique", enable_backward=False)
    def scatter(
        # In:
        scene: Scene,
        suns: wp.array[SunSample],
        sun: int,
        lattice: Lattice,
        first_row: int,
        columns_each: int,
        footprint: wp.vec2,
        column_waves: wp.array2d[wp.vec2],
        row_waves: wp.array2d[wp.vec2],
        # Out:
        map_out: wp.array[dtype],
        ledger_out: wp.array2d[wp.float64],
    ):
        """One thread ``columns_each`` photons of a row of the strip; launch dims (rows, runs of columns)."""
        row, run = wp.tid()
        light = suns[sun]
        bin = bin_of(row, run)
        account = account_type()
        first = run * columns_each
        for column in range(first, wp.min(first + columns_each, lattice.count[0])):
            cell = cell_at(lattice, light, wp.vec2i(lattice.first[0] + column, first_row + row))
            if cell.share > 0.0:
                z = water_on_lattice(scene, column_waves, row_waves, column, row, cell.water)
                account = splat_photon(scene, light, lattice, footprint, cell, z, bin, account, map_out, ledger_out)
        close_account(ledger_out, bin, account)

    return scatter
