"""Exact overlap of a triangle with the pixels, and the deposit of its flux by that overlap.

The overlap is the signed sum over the triangle's edges of the integral of ``clamp(x(y) - i, 0, 1)`` over a pixel's
row, as exact font rasterizers take it; divided by the triangle's area it is the share of the flux that the pixel gets.
Coordinates are pixels from a whole pixel (``base``) near the triangle, so that float32 keeps its digits on any map.
"""

import functools

import warp as wp

from .deposit import ACCUMULATOR, FLUX, make_add
from .edges import make_put_flux

NEEDLE = wp.constant(1.0e-4)
"""Area over extent below which a triangle is a line to float32: the overlap's rounding, 1e-7, is 1e-3 of its area."""

NEEDLE_SPACING = 4.0
"""Points a pixel along a needle: their lattice is then finer than the box of a pixel by more than it shows."""

NEEDLE_LIMIT = 64
"""Points along a needle at most."""


@wp.func
def mean_clamp(a: float, b: float) -> float:
    """Mean of clamp(x, 0, 1) for x from a to b."""
    low = wp.min(a, b)
    high = wp.max(a, b)
    if high <= 0.0:
        return 0.0
    if low >= 1.0:
        return 1.0
    if low >= 0.0 and high <= 1.0:
        return 0.5 * (a + b)
    inner_low = wp.max(low, 0.0)
    inner_high = wp.min(high, 1.0)
    inside = 0.5 * (inner_high - inner_low) * (inner_high + inner_low)
    return (inside + wp.max(high - 1.0, 0.0)) / (high - low)


@wp.func
def edge_in_row(a: wp.vec2, b: wp.vec2, row: float) -> wp.vec3:
    """The part of an edge inside the row [row, row + 1]: x where it enters, x where it leaves, signed height."""
    low = wp.clamp(a[1], row, row + 1.0)
    high = wp.clamp(b[1], row, row + 1.0)
    if low == high:
        return wp.vec3(0.0, 0.0, 0.0)
    slope = (b[0] - a[0]) / (b[1] - a[1])
    return wp.vec3(a[0] + (low - a[1]) * slope, a[0] + (high - a[1]) * slope, high - low)


@wp.func
def overlap(e: wp.vec3, f: wp.vec3, g: wp.vec3, column: float) -> float:
    """Signed overlap of a triangle, by its three edges in a row, with the pixel at this column."""
    total = e[2] * mean_clamp(e[0] - column, e[1] - column)
    total += f[2] * mean_clamp(f[0] - column, f[1] - column)
    total += g[2] * mean_clamp(g[0] - column, g[1] - column)
    return total


@wp.func
def row_extent(e: wp.vec3, f: wp.vec3, g: wp.vec3) -> wp.vec2:
    """Smallest and largest x that the three edges reach in a row; a crossed edge without height has no say."""
    low = float(1.0e30)
    high = float(-1.0e30)
    if e[2] != 0.0:
        low = wp.min(low, wp.min(e[0], e[1]))
        high = wp.max(high, wp.max(e[0], e[1]))
    if f[2] != 0.0:
        low = wp.min(low, wp.min(f[0], f[1]))
        high = wp.max(high, wp.max(f[0], f[1]))
    if g[2] != 0.0:
        low = wp.min(low, wp.min(g[0], g[1]))
        high = wp.max(high, wp.max(g[0], g[1]))
    return wp.vec2(low, high)


@functools.cache
def make_deposit_point(accumulate: str, channels: int, steps: bool = False) -> wp.Function:
    """Put a flux into the pixel that a point falls in, of a map or of a map of steps (:mod:`.edges`).

    It returns the share that fell in the map (0 or 1).
    """
    add = make_add(accumulate, channels)
    put_flux = make_put_flux(channels)
    dtype = ACCUMULATOR[accumulate]

    @wp.func
    def deposit_point(
        map: wp.array[dtype], size: wp.vec2i, base: wp.vec2i, p: wp.vec2, flux: FLUX[channels], share: float
    ) -> float:
        column = base[0] + int(wp.floor(p[0]))
        row = base[1] + int(wp.floor(p[1]))
        if column < 0 or column >= size[0] or row < 0 or row >= size[1]:
            return 0.0
        if wp.static(steps):
            put_flux(map, row * (size[0] + 1) + column, flux, share)
        else:
            add(map, row * size[0] + column, flux, share)
        return share

    return deposit_point


@functools.cache
def make_deposit_needle(accumulate: str, channels: int, steps: bool = False) -> wp.Function:
    """Spread a flux along a triangle without area, as points at the centroids of its equal parts."""
    deposit_point = make_deposit_point(accumulate, channels, steps)
    dtype = ACCUMULATOR[accumulate]

    @wp.func
    def deposit_needle(
        map: wp.array[dtype], size: wp.vec2i, base: wp.vec2i, a: wp.vec2, b: wp.vec2, c: wp.vec2, extent: float,
        flux: FLUX[channels],
    ) -> float:  # fmt: skip
        n = wp.clamp(int(wp.ceil(extent * wp.static(NEEDLE_SPACING))), 1, wp.static(NEEDLE_LIMIT))
        step = 1.0 / float(n)
        hits = int(0)
        for i in range(n):
            for j in range(2 * (n - i) - 1):
                # Parts pointing up (even j) and down (odd j) of row i, in barycentric steps along b - a and c - a.
                third = (1.0 + float(j & 1)) / 3.0
                u = (float(j // 2) + third) * step
                v = (float(i) + third) * step
                if deposit_point(map, size, base, a + u * (b - a) + v * (c - a), flux, step * step) > 0.0:
                    hits += 1
        return float(hits) * step * step

    return deposit_needle


@functools.cache
def make_deposit_triangle(accumulate: str, channels: int) -> wp.Function:
    """Deposit a flux, uniform over a triangle, by exact overlap; return the share that fell in the map."""
    add = make_add(accumulate, channels)
    deposit_needle = make_deposit_needle(accumulate, channels)
    dtype = ACCUMULATOR[accumulate]

    @wp.func
    def deposit_triangle(
        map: wp.array[dtype], size: wp.vec2i, base: wp.vec2i, a: wp.vec2, b: wp.vec2, c: wp.vec2, flux: FLUX[channels]
    ) -> float:
        if not wp.isfinite(a[0] + a[1] + b[0] + b[1] + c[0] + c[1]):
            return 0.0
        low_x = wp.min(a[0], wp.min(b[0], c[0]))
        high_x = wp.max(a[0], wp.max(b[0], c[0]))
        low_y = wp.min(a[1], wp.min(b[1], c[1]))
        high_y = wp.max(a[1], wp.max(b[1], c[1]))
        # Bounds in float: a landing point far away must not overflow an integer.
        left = float(-base[0])
        bottom = float(-base[1])
        right = left + float(size[0])
        top = bottom + float(size[1])
        if not (high_x >= left and low_x <= right and high_y >= bottom and low_y <= top):
            return 0.0
        columns = wp.vec2i(int(wp.floor(wp.max(low_x, left))), int(wp.floor(wp.min(high_x, right))))
        rows = wp.vec2i(int(wp.floor(wp.max(low_y, bottom))), int(wp.floor(wp.min(high_y, top))))
        within = low_x >= left and high_x < right and low_y >= bottom and high_y < top
        if within and columns[0] == columns[1] and rows[0] == rows[1]:
            add(map, (base[1] + rows[0]) * size[0] + base[0] + columns[0], flux, 1.0)
            return 1.0
        area = 0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]))
        extent = wp.max(high_x - low_x, high_y - low_y)
        if wp.abs(area) <= NEEDLE * extent:
            return deposit_needle(map, size, base, a, b, c, extent, flux)
        inside = float(0.0)
        last_column = wp.min(columns[1], size[0] - 1 - base[0])
        for row in range(rows[0], wp.min(rows[1], size[1] - 1 - base[1]) + 1):
            e = edge_in_row(a, b, float(row))
            f = edge_in_row(b, c, float(row))
            g = edge_in_row(c, a, float(row))
            reach = row_extent(e, f, g)
            if reach[0] <= reach[1]:
                start = (base[1] + row) * size[0] + base[0]
                first = wp.max(columns[0], int(wp.floor(wp.max(reach[0], left))))
                last = wp.min(last_column, int(wp.floor(wp.min(reach[1], right))))
                for column in range(first, last + 1):
                    share = overlap(e, f, g, float(column)) / area
                    inside += share
                    add(map, start + column, flux, share)
        if within:
            # What rounding left over goes to the middle, so that energy is exact.
            middle = (a + b + c) / 3.0
            column = wp.clamp(int(wp.floor(middle[0])), columns[0], columns[1])
            row = wp.clamp(int(wp.floor(middle[1])), rows[0], rows[1])
            add(map, (base[1] + row) * size[0] + base[0] + column, flux, 1.0 - inside)
            inside = 1.0
        return inside

    return deposit_triangle
