"""The atomic splat: a photon's flux as a point, or as a box whose width is free."""

import functools

import warp as wp

from .coverage import make_deposit_point
from .deposit import ACCUMULATOR, FLUX, make_add

NARROWEST = 1.0e-2
"""Width [pixels] up to which a box is a point: its sides would be known to no more than a few digits in float32."""


FARTHEST = 1.0e9
"""Distance [pixels] past which nothing is near a map, and within which an integer holds it."""


@functools.cache
def make_deposit_box(accumulate: str, channels: int) -> wp.Function:
    """Spread a flux over an axis-parallel box by its overlap with the pixels; return the share in the map.

    A box of one pixel is the bilinear splat, and the footprint of Yuksel & Keyser's gather.
    """
    add = make_add(accumulate, channels)
    deposit_point = make_deposit_point(accumulate, channels)
    dtype = ACCUMULATOR[accumulate]

    @wp.func
    def deposit_box(
        map: wp.array[dtype], size: wp.vec2i, base: wp.vec2i, p: wp.vec2, width: wp.vec2, flux: FLUX[channels]
    ) -> float:
        if not (width[0] > wp.static(NARROWEST) and width[1] > wp.static(NARROWEST)):
            return deposit_point(map, size, base, p, flux, 1.0)
        if not (wp.abs(p[0]) < wp.static(FARTHEST) and wp.abs(p[1]) < wp.static(FARTHEST)):
            return 0.0
        # From the pixel that it falls in, so that its sides keep their digits wherever it lands.
        base = base + wp.vec2i(int(wp.floor(p[0])), int(wp.floor(p[1])))
        p = p - wp.vec2(wp.floor(p[0]), wp.floor(p[1]))
        left = float(-base[0])
        bottom = float(-base[1])
        right = left + float(size[0])
        top = bottom + float(size[1])
        low = p - 0.5 * width
        high = p + 0.5 * width
        if not (high[0] >= left and low[0] <= right and high[1] >= bottom and low[1] <= top):
            return 0.0
        first_column = int(wp.floor(wp.max(low[0], left)))
        last_column = wp.min(int(wp.floor(wp.min(high[0], right))), size[0] - 1 - base[0])
        first_row = int(wp.floor(wp.max(low[1], bottom)))
        last_row = wp.min(int(wp.floor(wp.min(high[1], top))), size[1] - 1 - base[1])
        inside = float(0.0)
        for row in range(first_row, last_row + 1):
            tall = wp.min(high[1], float(row) + 1.0) - wp.max(low[1], float(row))
            for column in range(first_column, last_column + 1):
                wide = wp.min(high[0], float(column) + 1.0) - wp.max(low[0], float(column))
                share = wp.max(wide, 0.0) * wp.max(tall, 0.0) / (width[0] * width[1])
                if share > 0.0:
                    inside += share
                    add(map, (base[1] + row) * size[0] + base[0] + column, flux, share)
        return inside

    return deposit_box
