"""The gather as a scatter, for the plainest scenes, row by row: waves, refraction and landing of many columns at once.

It is :mod:`.gather_scatter` for water that is a sum of waves over a plane, where no ray is lost or shaded on its way.
What is left of :func:`~.photon.make_photon` is a few closed forms, the same for all columns of a row; a row is worked
out in :mod:`.lanes`, and only the boxes are added one by one. The order of each sum and product is that of the general
functions: a landing is known to some 1e-5 of a pixel, and other roundings would show.
"""

import functools
from dataclasses import replace

import warp as wp

from .deposit import FLUX
from .gather_scatter import make_deposit_window
from .lanes import LANES, floor_lanes, in_all, lanes, lanes_of, sqrt_lanes
from .lattice import Lattice
from .ledger import BINS, DROPPED, EMITTED, MISSED_BY_WINDOW, OUTSIDE_MAP, REFLECTED
from .photon import Medium, Scene, SunSample
from .spec import Spec
from .wave_rows import Water, water_block


def serves(spec: Spec) -> bool:
    """Whether a scene is so plain that its rows can be worked out here."""
    return replace(spec, fresnel=False) == Spec()


@wp.struct
class Landing:
    """Where the light of a block lands [pixels], from where it does at rest; its flux before the surface and after."""

    x: lanes
    y: lanes
    incident: lanes
    flux: lanes


@functools.cache
def make_land_block(fresnel: bool) -> wp.Function:
    """Refract at the surface, meet the plane z = ``level``, and take off where light lands at rest.

    As :func:`~.optics.refract_at_slope`, :func:`~.optics.transmittance_at_slope`, :func:`~.project.hit_plane` and
    :func:`~.lattice.deviation`.
    """

    @wp.func
    def land_block(sun: wp.vec3, shift: wp.vec2, medium: Medium, level: float, pixel: wp.vec2, water: Water) -> Landing:
        x = water.slope_x
        y = water.slope_y
        eta = medium.eta
        squared = in_all(1.0) + wp.cw_mul(x, x) + wp.cw_mul(y, y)
        facing = sun[0] * x + sun[1] * y - in_all(sun[2])
        root = sqrt_lanes((1.0 - eta * eta) * squared + wp.cw_mul(eta * eta * facing, facing))
        gamma = wp.cw_div(eta * facing - root, squared)
        across = in_all(eta * sun[0]) - wp.cw_mul(gamma, x)
        along = in_all(eta * sun[1]) - wp.cw_mul(gamma, y)
        up = in_all(eta * sun[2]) + gamma
        distance = wp.cw_div(water.z - in_all(level), -up)
        landing = Landing()
        landing.x = (wp.cw_mul(distance, across) - in_all(shift[0])) / pixel[0]
        landing.y = (wp.cw_mul(distance, along) - in_all(shift[1])) / pixel[1]
        landing.incident = facing
        landing.flux = facing
        if wp.static(fresnel):
            # The cosines times the length of the normal, which both of Fresnel's ratios lose again.
            refracted = wp.cw_mul(across, x) + wp.cw_mul(along, y) - up
            ior = medium.ior
            rs = wp.cw_div(facing - ior * refracted, facing + ior * refracted)
            rp = wp.cw_div(ior * facing - refracted, ior * facing + refracted)
            lost = 0.5 * (wp.cw_mul(rs, rs) + wp.cw_mul(rp, rp))
            landing.flux = wp.cw_mul(facing, in_all(1.0) - lost)
        return landing

    return land_block


@functools.cache
def make_deposit_block(fresnel: bool) -> wp.Function:
    """Add the boxes of a block; return its flux, what of it lands in the map, what Fresnel took, how many are lost."""
    deposit_window = make_deposit_window(1)
    flux_type = FLUX[1]

    @wp.func
    def deposit_block(
        map: wp.array[float], size: wp.vec2i, own: wp.vec2i, count: int, landing: Landing, n: int, m: int
    ) -> wp.vec4d:
        """The first ``count`` samples count; they are of pixel ``own`` and of those beside it."""
        x = landing.x
        y = landing.y
        flux = landing.flux
        incident = landing.incident
        left = floor_lanes(x)
        below = floor_lanes(y)
        across = x - left
        above = wp.cw_mul(y - below, flux)
        under = flux - above
        above_right = wp.cw_mul(across, above)
        above_left = above - above_right
        under_right = wp.cw_mul(across, under)
        under_left = under - under_right
        half_n = n // 2
        half_m = m // 2
        landed = wp.float64(0.0)
        in_map = wp.float64(0.0)
        reflected = wp.float64(0.0)
        lost = wp.float64(0.0)
        for k in range(count):
            if not wp.isfinite(x[k] + y[k] + flux[k]):
                lost += wp.float64(1.0)
                continue
            i = int(left[k])
            j = int(below[k])
            column = own[0] + k + i
            row = own[1] + j
            landed += wp.float64(flux[k])
            if wp.static(fresnel):
                reflected += wp.float64(incident[k] - flux[k])
            whole = column >= 0 and column + 1 < size[0] and row >= 0 and row + 1 < size[1]
            if whole and i >= -half_n and i < half_n and j >= -half_m and j < half_m:
                at = row * size[0] + column
                wp.atomic_add(map, at, under_left[k])
                wp.atomic_add(map, at + 1, under_right[k])
                wp.atomic_add(map, at + size[0], above_left[k])
                wp.atomic_add(map, at + size[0] + 1, above_right[k])
                in_map += wp.float64(flux[k])
            elif whole and (i < -half_n - 1 or i > half_n or j < -half_m - 1 or j > half_m):
                in_map += wp.float64(flux[k])  # in no window
            else:
                pixel = wp.vec2i(own[0] + k, own[1])
                share = deposit_window(map, size, pixel, wp.vec2(x[k], y[k]), n, m, flux_type(flux[k]))
                in_map += wp.float64(share * flux[k])
        return wp.vec4d(landed, in_map, reflected, lost)

    return deposit_block


@functools.cache
def make_scatter_rows(fresnel: bool) -> wp.Kernel:
    """Build the kernel, with Fresnel's loss or without, that follows the light of a strip's rows and adds its boxes."""
    land_block = make_land_block(fresnel)
    deposit_block = make_deposit_block(fresnel)

    @wp.kernel(module="unique", enable_backward=False)
    def scatter_rows(
        # In:
        scene: Scene,
        suns: wp.array[SunSample],
        sun: int,
        lattice: Lattice,
        first_row: int,
        n: int,
        m: int,
        column_cos: wp.array2d[float],
        column_sin: wp.array2d[float],
        row_waves: wp.array2d[wp.vec2],
        # Out:
        map_out: wp.array[float],
        ledger_out: wp.array2d[wp.float64],
    ):
        """One thread a row of the strip; the tables have :func:`~.lanes.padded` columns."""
        row = wp.tid()
        light = suns[sun]
        waves = scene.water.surface.waves
        pixel = lattice.pixel
        level = scene.receiver.level
        cosines = lanes_of(column_cos)
        sines = lanes_of(column_sin)
        reflected = wp.float64(0.0)
        lost = wp.float64(0.0)
        landed = wp.float64(0.0)
        in_map = wp.float64(0.0)
        for block in range(cosines.shape[1]):
            water = water_block(waves, cosines, sines, row_waves, row, block)
            landing = land_block(light.direction, light.rest_shift, scene.medium, level, pixel, water)
            first = block * wp.static(LANES)
            count = wp.min(wp.static(LANES), lattice.count[0] - first)
            own = wp.vec2i(lattice.first[0] + first, first_row + row)
            found = deposit_block(map_out, lattice.map, own, count, landing, n, m)
            landed += found[0]
            in_map += found[1]
            reflected += found[2]
            lost += found[3]
        bin = row & (wp.static(BINS) - 1)
        if wp.static(fresnel):
            wp.atomic_add(ledger_out, REFLECTED, bin, reflected)
        # What a lost sample took in is not known; it is counted as what it would take in at rest.
        dropped = -lost * wp.float64(light.direction[2])
        wp.atomic_add(ledger_out, DROPPED, bin, dropped)
        wp.atomic_add(ledger_out, EMITTED, bin, landed + reflected + dropped)
        wp.atomic_add(ledger_out, OUTSIDE_MAP, bin, landed - in_map)
        # What lands in the map; the host takes off what the windows then find of it.
        wp.atomic_add(ledger_out, MISSED_BY_WINDOW, bin, in_map)

    return scatter_rows
