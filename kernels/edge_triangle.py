"""A triangle's deposit by its edges, as :mod:`.coverage` does it pixel by pixel."""

import functools

import warp as wp

from .coverage import make_deposit_needle
from .deposit import FLUX
from .edges import DENSITY, SLIVER, doubled_area, make_add_clipped_edge


@wp.func
def in_map(base: wp.vec2i, p: wp.vec2) -> wp.vec2d:
    """Coordinate of the map [pixels] of a point from a whole pixel."""
    return wp.vec2d(wp.float64(base[0]) + wp.float64(p[0]), wp.float64(base[1]) + wp.float64(p[1]))


@wp.func
def pixel_of(p: wp.vec2d, pitch: int) -> int:
    """Where a map of steps has the pixel of a point in the map."""
    return int(p[1]) * pitch + int(p[0])


@wp.func
def is_sliver(a: wp.vec2d, b: wp.vec2d, c: wp.vec2d, doubled: wp.float64) -> bool:
    """Tell whether a triangle of this doubled area has no more area than a line."""
    reach = wp.abs(b[0] - a[0]) + wp.abs(b[1] - a[1]) + wp.abs(c[0] - a[0]) + wp.abs(c[1] - a[1])
    return wp.abs(doubled) <= SLIVER * reach


@wp.func
def from_pixel(base: wp.vec2i, p: wp.vec2d) -> wp.vec2:
    """A coordinate of the map from a whole pixel."""
    return wp.vec2(float(p[0] - wp.float64(base[0])), float(p[1] - wp.float64(base[1])))


@functools.cache
def make_density(channels: int) -> wp.Function:
    """Density of a flux, uniform over a triangle."""
    density_type = DENSITY[channels]

    @wp.func
    def density(flux: FLUX[channels], doubled: wp.float64) -> DENSITY[channels]:
        result = density_type()
        share = wp.float64(2.0) / doubled
        for k in range(wp.static(channels)):
            result[k] = wp.float64(flux[k]) * share
        return result

    return density


@functools.cache
def make_deposit_edged_triangle(channels: int) -> wp.Function:
    """Deposit a flux, uniform over a triangle, into a map of steps; return the share that fell in the map."""
    add_clipped_edge = make_add_clipped_edge(channels)
    deposit_needle = make_deposit_needle("float64", channels, steps=True)
    density = make_density(channels)

    @wp.func
    def deposit_triangle(
        steps: wp.array[wp.float64], size: wp.vec2i, a: wp.vec2d, b: wp.vec2d, c: wp.vec2d, flux: FLUX[channels]
    ) -> float:
        low = wp.min(a, wp.min(b, c))
        high = wp.max(a, wp.max(b, c))
        right = wp.float64(size[0])
        top = wp.float64(size[1])
        none = wp.float64(0.0)
        total = a + b + c  # the smallest of numbers and a NaN may be a number
        if not wp.isfinite(total[0] + total[1]):
            return 0.0
        if not (high[0] >= none and low[0] <= right and high[1] >= none and low[1] <= top):
            return 0.0
        doubled = doubled_area(a, b, c)
        if is_sliver(a, b, c, doubled):
            base = wp.vec2i(int(wp.clamp(low[0], none, right)), int(wp.clamp(low[1], none, top)))
            extent = float(wp.max(high[0] - low[0], high[1] - low[1]))
            return deposit_needle(
                steps, size, base, from_pixel(base, a), from_pixel(base, b), from_pixel(base, c), extent, flux
            )
        w = density(flux, doubled)
        inside = add_clipped_edge(steps, size, a, b, w)
        inside += add_clipped_edge(steps, size, b, c, w)
        inside += add_clipped_edge(steps, size, c, a, w)
        return float(wp.float64(2.0) * inside / doubled)

    return deposit_triangle
