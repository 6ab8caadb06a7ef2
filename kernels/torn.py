"""Torn cells: those whose corners met different fates, followed ray by ray.

A cell at a shore, a shadow's edge, the rim of an object or the crest of a hill is cut into equal parts. Each part is
one ray through its middle, and lands as the parallelogram in which its own beam, by the curvature of the water, cuts
the receiver's tangent plane at the hit: no streak can reach across the edge, and no energy is lost on it. An edge of
light or of water that passes through a part takes its share of it.
"""

import functools

import warp as wp

from .coverage import make_deposit_triangle
from .deposit import ACCUMULATOR, FLUX
from .edge_triangle import in_map, make_deposit_edged_triangle
from .lattice import Lattice, at_rest, clip_to_water, on_water, pixel_base, pixel_fraction, share_of_cell
from .ledger import EMITTED, OVER_LIT, SHADED, bin_of, make_book_landed, make_count_unlanded, tally
from .optics import facing, refract_at_slope
from .photon import LANDED, LANDED_ON_OBJECT, LOST, Photon, Scene, SunSample, make_land, make_lit, make_wet
from .spec import Spec
from .surface import HEIGHT_SLOPE_AND_CURVATURE
from .waves import vec6

PARTS = 4
"""Parts of a torn cell along each side: edges of shadow and shore pass through a part by their share of it."""

PARTS_WITH_EXITS = 8
"""The same where light may leave through the surface again: that edge falls between parts, or not at all."""

WIDEST = 8.0
"""Widest footprint of a part, in cells: past it the tangent plane is nearly along the ray, and a point serves."""


@wp.func
def footprint_corner(scene: Scene, sun: wp.vec3, photon: Photon, z: vec6, dx: float, dy: float) -> wp.vec2:
    """Where the ray from (dx, dy) [m] beside a photon's origin cuts the receiver's tangent plane, from its landing."""
    slope = wp.vec2(z[1] + z[3] * dx + z[4] * dy, z[2] + z[4] * dx + z[5] * dy)
    direction = refract_at_slope(sun, slope, scene.medium.eta)
    start = wp.vec3(dx, dy, 0.5 * ((z[1] + slope[0]) * dx + (z[2] + slope[1]) * dy))
    landing = photon.distance * photon.direction
    t = wp.dot(landing - start, photon.normal) / wp.dot(direction, photon.normal)
    p = start + t * direction - landing
    return wp.vec2(p[0], p[1])


@functools.cache
def make_torn(spec: Spec, edges: bool) -> wp.Kernel:
    """Deposit the flagged cells of a strip; ``edges`` as in :func:`.beam.make_cells`."""
    water_at = HEIGHT_SLOPE_AND_CURVATURE[spec.water]
    lit = make_lit(spec)
    wet = make_wet(spec)
    land = make_land(spec)
    plain = make_deposit_triangle(spec.accumulate, spec.channels)
    deposit_triangle = make_deposit_edged_triangle(spec.channels) if edges else plain
    book_landed = make_book_landed(spec)
    count_unlanded = make_count_unlanded(spec)
    dtype = ACCUMULATOR["float64" if edges else spec.accumulate]
    flux_type = FLUX[spec.channels]
    channels, self_shadow, bounded = spec.channels, spec.self_shadow, spec.bounded
    parts = PARTS_WITH_EXITS if spec.exits else PARTS

    @wp.func
    def deposit_part(
        scene: Scene, sun: SunSample, lattice: Lattice, low: wp.vec2, high: wp.vec2,
        map: wp.array[dtype], ledger: wp.array2d[wp.float64], bin: int,
    ):  # fmt: skip
        """``low`` and ``high`` bound the part, in pixels at rest."""
        middle = 0.5 * (low + high)
        water = on_water(lattice, middle, sun.rest_shift)
        size = wp.vec2((high[0] - low[0]) * lattice.pixel[0], (high[1] - low[1]) * lattice.pixel[1])
        z = water_at(scene.water.surface, water[0], water[1])
        origin = wp.vec3(water[0], water[1], z[0])
        slope = wp.vec2(z[1], z[2])
        share = share_of_cell(lattice, low, high)
        if not wp.isfinite(z[0] + z[1] + z[2]):
            count_unlanded(ledger, bin, LOST, -share * sun.direction[2], -share * sun.direction[2])
            return
        share *= wet(scene.receiver, origin, slope, size)
        incident = facing(sun.direction, slope)
        if incident <= 0.0:
            if wp.static(not self_shadow):
                for k in range(wp.static(channels)):
                    tally(ledger, OVER_LIT * wp.static(channels) + k, bin, -incident * share)
            return
        if not share > 0.0:
            return
        in_sun = lit(scene, sun.direction, origin, slope, size)
        for k in range(wp.static(channels)):
            tally(ledger, EMITTED * wp.static(channels) + k, bin, incident * share * (1.0 - in_sun))
            tally(ledger, SHADED * wp.static(channels) + k, bin, incident * share * (1.0 - in_sun))
        if in_sun <= 0.0:
            return
        share *= in_sun
        photon = land(scene, sun.direction, origin, slope, incident)
        if photon.state != LANDED and photon.state != LANDED_ON_OBJECT:
            count_unlanded(ledger, bin, photon.state, share * photon.incident, share * photon.transmitted)
            return
        landing = wp.vec2(
            (water[0] + photon.distance * photon.direction[0]) / lattice.pixel[0],
            (water[1] + photon.distance * photon.direction[1]) / lattice.pixel[1],
        )
        base = pixel_base(landing)
        at = pixel_fraction(landing, base)
        u = 0.5 * size[0]
        v = 0.5 * size[1]
        a = footprint_corner(scene, sun.direction, photon, z, -u, -v)
        b = footprint_corner(scene, sun.direction, photon, z, u, -v)
        c = footprint_corner(scene, sun.direction, photon, z, u, v)
        d = footprint_corner(scene, sun.direction, photon, z, -u, v)
        reach = wp.max(wp.max(wp.length(a), wp.length(b)), wp.max(wp.length(c), wp.length(d)))
        if not (reach <= wp.static(WIDEST) * lattice.step * wp.max(lattice.pixel[0], lattice.pixel[1])):
            a = wp.vec2(0.0, 0.0)
            b = a
            c = a
            d = a
        a = at + wp.cw_div(a, lattice.pixel)
        b = at + wp.cw_div(b, lattice.pixel)
        c = at + wp.cw_div(c, lattice.pixel)
        d = at + wp.cw_div(d, lattice.pixel)
        flux = flux_type()
        for k in range(wp.static(channels)):
            flux[k] = share * photon.arrived[k]
        if wp.static(edges):
            p = in_map(base, a)
            q = in_map(base, c)
            inside = 0.5 * deposit_triangle(map, lattice.map, p, in_map(base, b), q, 0.5 * flux)
            inside += 0.5 * deposit_triangle(map, lattice.map, p, q, in_map(base, d), 0.5 * flux)
        else:
            inside = 0.5 * deposit_triangle(map, lattice.map, base, a, b, c, 0.5 * flux)
            inside += 0.5 * deposit_triangle(map, lattice.map, base, a, c, d, 0.5 * flux)
        book_landed(ledger, bin, share * photon.incident, share * photon.transmitted, flux, inside * flux)

    @wp.kernel(module="unique", enable_backward=False)
    def torn(
        # In:
        scene: Scene,
        suns: wp.array[SunSample],
        sun: int,
        lattice: Lattice,
        first_row: int,
        torn_cells: wp.array2d[wp.uint8],
        # Out:
        map_out: wp.array[dtype],
        ledger_out: wp.array2d[wp.float64],
    ):
        """One thread a cell of the strip; launch dims (rows, columns) of cells."""
        row, column = wp.tid()
        if torn_cells[row, column] == wp.uint8(0):
            return
        light = suns[sun]
        index = wp.vec2i(lattice.first[0] + column, first_row + row)
        low = at_rest(lattice, index, 0.0)
        high = at_rest(lattice, index, 1.0)
        if wp.static(bounded):
            low = clip_to_water(lattice, low, light.rest_shift)
            high = clip_to_water(lattice, high, light.rest_shift)
        count = int(wp.static(parts))  # a variable, so that the loops are not unrolled
        side = (high - low) / float(count)
        for j in range(count):
            for i in range(count):
                corner = wp.vec2(low[0] + side[0] * float(i), low[1] + side[1] * float(j))
                deposit_part(scene, light, lattice, corner, corner + side, map_out, ledger_out, bin_of(row, column))

    return torn
