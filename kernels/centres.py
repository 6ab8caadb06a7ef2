"""Triangles at pixel centres: which centres a landed triangle covers, and which triangle is the latest of a pixel.

Coverage is exact, as in ``rasterize.py``: corners are rounded to a part of a pixel and edge functions are 64-bit
integers, so that with the top-left rule each pixel centre on a shared edge belongs to one of its two triangles.
"""

import functools

import warp as wp

from .deposit import ACCUMULATOR, FLUX, make_add
from .rasterize import edge_bias, edge_function

SUBPIXEL_BITS = wp.constant(16)  # a landing 100 pixels from its place at rest is known to no more in float32
SUBPIXELS = wp.constant(1 << 16)
CENTRE = wp.constant(1 << 15)  # of a pixel, in sub-pixels
SUBPIXEL_STEP = wp.constant(wp.int64(1 << 16))  # SUBPIXELS, for the edge functions

FARTHEST = wp.constant(8192.0)
"""Pixels from its cell at which a corner is held: 2^29 sub-pixels, so that edge functions stay under 2^62."""

UNCLAIMED = wp.constant(0)
"""Owner of a pixel that no triangle covers; triangles count from 1."""


@wp.struct
class Triangle:
    """A landed triangle, turned so that its area is positive."""

    a: wp.vec2i  # from the cell's whole pixel, in sub-pixels
    b: wp.vec2i
    c: wp.vec2i
    area: wp.int64  # twice its area, in sub-pixels squared


@wp.func
def first_centre(position: int) -> int:
    """Index of the first pixel whose centre does not lie before a position in sub-pixels."""
    return (position - CENTRE + SUBPIXELS - 1) >> SUBPIXEL_BITS


@wp.func
def in_subpixels(p: wp.vec2) -> wp.vec2i:
    """A place in pixels, rounded to sub-pixels, and held within :data:`FARTHEST`."""
    x = wp.clamp(p[0], -FARTHEST, FARTHEST)
    y = wp.clamp(p[1], -FARTHEST, FARTHEST)
    return wp.vec2i(int(wp.rint(x * float(SUBPIXELS))), int(wp.rint(y * float(SUBPIXELS))))


@wp.func
def turned(a: wp.vec2i, b: wp.vec2i, c: wp.vec2i) -> Triangle:
    """The triangle of three corners; one that a fold has turned over is turned back."""
    triangle = Triangle()
    triangle.a = a
    triangle.b = b
    triangle.c = c
    triangle.area = edge_function(a, b, c[0], c[1])
    if triangle.area < wp.int64(0):
        triangle.b = c
        triangle.c = b
        triangle.area = -triangle.area
    return triangle


@functools.cache
def make_draw(accumulate: str, channels: int, claims: bool, owned: bool) -> wp.Function:
    """Go over the pixel centres that a triangle covers.

    With ``claims`` each becomes the triangle's if no later one has it; else each gets the flux times ``share``, with
    ``owned`` only where it is the triangle's.
    """
    add = make_add(accumulate, channels)
    dtype = ACCUMULATOR[accumulate]

    @wp.func
    def draw(
        map: wp.array[dtype], owner: wp.array[int], size: wp.vec2i, base: wp.vec2i, triangle: Triangle, number: int,
        flux: FLUX[channels], share: float,
    ):  # fmt: skip
        a = triangle.a
        b = triangle.b
        c = triangle.c
        low = wp.min(a, wp.min(b, c))
        high = wp.max(a, wp.max(b, c))
        first_column = wp.max(first_centre(low[0]), -base[0])
        first_row = wp.max(first_centre(low[1]), -base[1])
        columns = wp.min(first_centre(high[0] + 1), size[0] - base[0]) - first_column
        rows = wp.min(first_centre(high[1] + 1), size[1] - base[1]) - first_row
        if triangle.area == wp.int64(0) or columns <= 0 or rows <= 0:
            return
        x = first_column * SUBPIXELS + CENTRE
        y = first_row * SUBPIXELS + CENTRE
        edge = wp.vec3l(edge_function(b, c, x, y), edge_function(c, a, x, y), edge_function(a, b, x, y))
        step_x = SUBPIXEL_STEP * wp.vec3l(wp.int64(b[1] - c[1]), wp.int64(c[1] - a[1]), wp.int64(a[1] - b[1]))
        step_y = SUBPIXEL_STEP * wp.vec3l(wp.int64(c[0] - b[0]), wp.int64(a[0] - c[0]), wp.int64(b[0] - a[0]))
        for i in range(3):
            edge[i] += edge_bias(step_x[i], step_y[i])
        for j in range(rows):
            here = edge + wp.int64(j) * step_y
            start = (base[1] + first_row + j) * size[0] + base[0] + first_column
            for i in range(columns):
                if (here[0] | here[1] | here[2]) >= wp.int64(0):
                    if wp.static(claims):
                        wp.atomic_max(owner, start + i, number)
                    elif wp.static(owned):
                        if owner[start + i] == number:
                            add(map, start + i, flux, share)
                    else:
                        add(map, start + i, flux, share)
                here += step_x

    return draw


@wp.kernel(enable_backward=False)
def unclaim(
    # Out:
    owner_out: wp.array[int],
):
    """Take every pixel from its triangle; one thread a pixel."""
    owner_out[wp.tid()] = UNCLAIMED
