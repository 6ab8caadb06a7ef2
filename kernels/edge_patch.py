"""A cell's deposit by its edges: as :mod:`.triangle_patch` has it, with the edges between triangles followed once."""

import functools

import warp as wp

from .deposit import FLUX
from .edge_triangle import in_map, is_sliver, make_density, make_deposit_edged_triangle, pixel_of
from .edges import DENSITY, doubled_area, make_add_edge, make_put_flux
from .lattice import Lattice
from .patch import interpolate, make_flux_line, make_read_flux, read_block, trapezoid_weights
from .spec import Spec


@wp.func
def is_within(a: wp.vec2d, b: wp.vec2d, c: wp.vec2d, d: wp.vec2d, size: wp.vec2i, spare: float) -> bool:
    """Tell whether four points are in the map, by more than ``spare`` [pixels]; one that is no number is not."""
    low = wp.min(wp.min(a, b), wp.min(c, d))
    high = wp.max(wp.max(a, b), wp.max(c, d))
    room = wp.float64(spare)
    within = low[0] >= room and low[1] >= room
    within = within and high[0] < wp.float64(size[0]) - room and high[1] < wp.float64(size[1]) - room
    total = a + b + c + d
    return within and wp.isfinite(total[0] + total[1])


@functools.cache
def make_add_quad(channels: int) -> wp.Function:
    """Begin the deposit of a quad within the map; return the densities of its two triangles, whose edges are to come.

    What lies in one pixel, or has no area, is deposited here and has no density.
    """
    put_flux = make_put_flux(channels)
    deposit_triangle = make_deposit_edged_triangle(channels)
    density = make_density(channels)
    flux_type, density_type = FLUX[channels], DENSITY[channels]

    @wp.func
    def add_quad(
        map: wp.array[wp.float64], size: wp.vec2i, a: wp.vec2d, b: wp.vec2d, c: wp.vec2d, d: wp.vec2d, lower: flux_type,
        upper: flux_type,
    ):  # fmt: skip
        """``lower`` is the flux of the triangle a b c, ``upper`` of a c d."""
        below = density_type()
        above = density_type()
        pitch = size[0] + 1
        at = pixel_of(a, pitch)
        if at == pixel_of(b, pitch) and at == pixel_of(c, pitch) and at == pixel_of(d, pitch):
            put_flux(map, at, lower + upper, 1.0)
        else:
            doubled = doubled_area(a, b, c)
            if is_sliver(a, b, c, doubled):
                deposit_triangle(map, size, a, b, c, lower)
            else:
                below = density(lower, doubled)
            doubled = doubled_area(a, c, d)
            if is_sliver(a, c, d, doubled):
                deposit_triangle(map, size, a, c, d, upper)
            else:
                above = density(upper, doubled)
        return below, above

    return add_quad


@functools.cache
def make_deposit_edged_patch(spec: Spec) -> wp.Function:
    """Deposit a cell as n x n pairs of triangles into a map of steps; return the flux that fell in the map."""
    channels = spec.channels
    add_edge = make_add_edge(channels)
    add_quad = make_add_quad(channels)
    deposit_triangle = make_deposit_edged_triangle(channels)
    read_flux, flux_line = make_read_flux(spec), make_flux_line(channels)
    flux_type, density_type = FLUX[channels], DENSITY[channels]

    @wp.func
    def deposit_patch(
        map: wp.array[wp.float64], lattice: Lattice, base: wp.vec2i, corner: wp.vec2, side: wp.vec2,
        planes: wp.array3d[float], row: int, column: int, n: int, cubic: int, mean: flux_type, within: bool,
    ) -> flux_type:  # fmt: skip
        """As :func:`.triangle_patch.make_deposit_patch`; ``within`` tells that all of it lands in the map."""
        pitch = lattice.map[0] + 1
        inside = flux_type()
        part = 1.0 / float(n)
        area = side[0] * side[1] * part * part / (lattice.step * lattice.step)
        x = read_block(planes, 0, row, column)
        y = read_block(planes, 1, row, column)
        flux = read_flux(planes, row, column)
        weights = trapezoid_weights(n, cubic)
        mend = mean - flux_line(flux, weights) * weights
        v = interpolate(0.0, cubic)
        x_low = v * x
        y_low = v * y
        flux_low = flux_line(flux, v)
        for j in range(n):
            w = interpolate(float(j + 1) * part, cubic)
            x_high = w * x
            y_high = w * y
            flux_high = flux_line(flux, w)
            bottom = corner[1] + side[1] * float(j) * part
            top = corner[1] + side[1] * float(j + 1) * part
            a = in_map(base, wp.vec2(corner[0] + x_low[1], bottom + y_low[1]))
            d = in_map(base, wp.vec2(corner[0] + x_high[1], top + y_high[1]))
            left = density_type()  # of the part before, on the other side of this one's first edge
            flux_a = flux_type()
            flux_d = flux_type()
            for k in range(wp.static(channels)):
                flux_a[k] = flux_low[k, 1]
                flux_d[k] = flux_high[k, 1]
            for i in range(n):
                u = interpolate(float(i + 1) * part, cubic)
                right = corner[0] + side[0] * float(i + 1) * part
                b = in_map(base, wp.vec2(right + wp.dot(u, x_low), bottom + wp.dot(u, y_low)))
                c = in_map(base, wp.vec2(right + wp.dot(u, x_high), top + wp.dot(u, y_high)))
                flux_b = flux_low * u
                flux_c = flux_high * u
                # The two triangles share the part's flux by the means of their own corners.
                half = area * 0.5 * (0.25 * (flux_a + flux_b + flux_c + flux_d) + mend)
                tilt = area * (flux_b - flux_d) / 12.0
                lower = half + tilt
                upper = half - tilt
                if within:
                    below, above = add_quad(map, lattice.map, a, b, c, d, lower, upper)
                    add_edge(map, pitch, a, b, below)
                    add_edge(map, pitch, c, a, below - above)
                    add_edge(map, pitch, c, d, above)
                    add_edge(map, pitch, d, a, above - left)
                    left = below
                    inside += lower + upper
                else:
                    inside += lower * deposit_triangle(map, lattice.map, a, b, c, lower)
                    inside += upper * deposit_triangle(map, lattice.map, a, c, d, upper)
                a = b
                d = c
                flux_a = flux_b
                flux_d = flux_c
            if within:
                add_edge(map, pitch, a, d, left)
            x_low = x_high
            y_low = y_high
            flux_low = flux_high
        return inside

    return deposit_patch
