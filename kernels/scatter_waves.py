"""The photon method over a sum of waves, on a CPU: a row's waves are added up for many columns at once.

Only the water is worked out in :mod:`.lanes`; each photon is then followed as in :mod:`.scatter`. Over a plane, where
light is neither shaded nor absorbed, it is refracted and landed by blocks, too, and only its box is its own.
"""

import functools
from dataclasses import replace

import warp as wp

from .deposit import ACCUMULATOR, FLUX
from .gather_rows import make_land_block, serves
from .lanes import LANES, lanes_of
from .lattice import Lattice, at_rest, pixel_base, pixel_fraction
from .ledger import bin_of, make_account, make_close_account, make_count_unlanded, make_enter_landed
from .photon import LOST, Scene, SunSample
from .scatter import make_cell, make_splat_photon
from .spec import Spec
from .splat import make_deposit_box
from .wave_rows import Water, water_block


@functools.cache
def make_splat_block(spec: Spec) -> wp.Function:
    """Follow and splat the photons of a block one by one; return the account."""
    cell_at, splat_photon = make_cell(spec), make_splat_photon(spec)
    dtype, account_type = ACCUMULATOR[spec.accumulate], make_account(spec)

    @wp.func
    def splat_block(
        scene: Scene, light: SunSample, lattice: Lattice, footprint: wp.vec2, first: wp.vec2i, count: int,
        water: Water, bin: int, account: account_type, map: wp.array[dtype], ledger: wp.array2d[wp.float64],
    ) -> account_type:  # fmt: skip
        """``first`` is the index of the block's first cell, ``count`` how many it has."""
        z = water.z
        slope_x = water.slope_x
        slope_y = water.slope_y
        for k in range(count):
            cell = cell_at(lattice, light, wp.vec2i(first[0] + k, first[1]))
            if cell.share > 0.0:
                at = wp.vec3(z[k], slope_x[k], slope_y[k])
                account = splat_photon(scene, light, lattice, footprint, cell, at, bin, account, map, ledger)
        return account

    return splat_block


@functools.cache
def make_splat_plain_block(spec: Spec) -> wp.Function:
    """As :func:`make_splat_block`, over a plane without shadows and absorption: light lands by blocks."""
    land_block = make_land_block(spec.fresnel)
    deposit_box, enter_landed = make_deposit_box(spec.accumulate, spec.channels), make_enter_landed(spec)
    count_unlanded = make_count_unlanded(spec)
    dtype, account_type, flux_type = ACCUMULATOR[spec.accumulate], make_account(spec), FLUX[spec.channels]

    @wp.func
    def splat_plain_block(
        scene: Scene, light: SunSample, lattice: Lattice, footprint: wp.vec2, first: wp.vec2i, count: int,
        water: Water, bin: int, account: account_type, map: wp.array[dtype], ledger: wp.array2d[wp.float64],
    ) -> account_type:  # fmt: skip
        level = scene.receiver.level
        landing = land_block(light.direction, light.rest_shift, scene.medium, level, lattice.pixel, water)
        x = landing.x
        y = landing.y
        incident = landing.incident
        arrived = landing.flux
        at_rest_taken = -light.direction[2]
        for k in range(count):
            if not wp.isfinite(x[k] + y[k] + arrived[k]):
                # What it took in is not known; it is counted as what it would take in at rest.
                count_unlanded(ledger, bin, LOST, at_rest_taken, at_rest_taken)
                continue
            rest = at_rest(lattice, wp.vec2i(first[0] + k, first[1]), 0.5)
            base = pixel_base(rest)
            at = pixel_fraction(rest, base) + wp.vec2(x[k], y[k])
            flux = flux_type(arrived[k])
            inside = deposit_box(map, lattice.map, base, at, footprint, flux)
            account = enter_landed(account, incident[k], arrived[k], flux, inside * flux)
        return account

    return splat_plain_block


@functools.cache
def make_scatter_waves(spec: Spec) -> wp.Kernel:
    """Splat the photons of a strip of waves."""
    # The number format of the map is no matter of the scene's plainness.
    plain = serves(replace(spec, accumulate="float32"))
    splat_block = make_splat_plain_block(spec) if plain else make_splat_block(spec)
    close_account = make_close_account(spec)
    dtype, account_type = ACCUMULATOR[spec.accumulate], make_account(spec)

    @wp.kernel(module="unique", enable_backward=False)
    def scatter_waves(
        # In:
        scene: Scene,
        suns: wp.array[SunSample],
        sun: int,
        lattice: Lattice,
        first_row: int,
        footprint: wp.vec2,
        column_cos: wp.array2d[float],
        column_sin: wp.array2d[float],
        row_waves: wp.array2d[wp.vec2],
        # Out:
        map_out: wp.array[dtype],
        ledger_out: wp.array2d[wp.float64],
    ):
        """One thread a row of the strip; the tables of the columns have :func:`~.lanes.padded` columns."""
        row = wp.tid()
        light = suns[sun]
        bin = bin_of(row, 0)
        account = account_type()
        cosines = lanes_of(column_cos)
        sines = lanes_of(column_sin)
        for block in range(cosines.shape[1]):
            done = block * wp.static(LANES)
            first = wp.vec2i(lattice.first[0] + done, first_row + row)
            count = wp.min(wp.static(LANES), lattice.count[0] - done)
            water = water_block(scene.water.surface.waves, cosines, sines, row_waves, row, block)
            account = splat_block(
                scene, light, lattice, footprint, first, count, water, bin, account, map_out, ledger_out
            )
        close_account(ledger_out, bin, account)

    return scatter_waves
