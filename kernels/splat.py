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
def make_deposit_quad(accumulate: str, channels: int) -> wp.Function:
    """Add a flux to two columns and two rows that are on the map, by the weights of the second of each."""
    add = make_add(accumulate, channels)
    dtype = ACCUMULATOR[accumulate]

    @wp.func
    def deposit_quad(map: wp.array[dtype], columns: int, first: int, right: float, upper: float, flux: FLUX[channels]):
        """``first`` is the lower left pixel's index; the first column's weight is 1 - ``right``."""
        left = 1.0 - right
        lower = 1.0 - upper
        add(map, first, flux, left * lower)
        add(map, first + 1, flux, right * lower)
        add(map, first + columns, flux, left * upper)
        add(map, first + columns + 1, flux, right * upper)

    return deposit_quad


@functools.cache
def make_deposit_taps(accumulate: str, channels: int) -> wp.Function:
    """Spread a flux over a box of any width, on and across the map's border; return the share in the map."""
    add = make_add(accumulate, channels)
    dtype = ACCUMULATOR[accumulate]

    @wp.func
    def deposit_taps(
        map: wp.array[dtype], size: wp.vec2i, base: wp.vec2i, low: wp.vec2, high: wp.vec2, scale: float,
        flux: FLUX[channels],
    ) -> float:  # fmt: skip
        """``low`` and ``high`` are the box's corners from ``base`` [pixels], ``scale`` is one over its area."""
        left = float(-base[0])
        bottom = float(-base[1])
        right = left + float(size[0])
        top = bottom + float(size[1])
        if not (high[0] >= left and low[0] <= right and high[1] >= bottom and low[1] <= top):
            return 0.0
        first_column = int(wp.floor(wp.max(low[0], left)))
        last_column = wp.min(int(wp.floor(wp.min(high[0], right))), size[0] - 1 - base[0])
        first_row = int(wp.floor(wp.max(low[1], bottom)))
        last_row = wp.min(int(wp.floor(wp.min(high[1], top))), size[1] - 1 - base[1])
        inside = float(0.0)
        for row in range(first_row, last_row + 1):
            tall = wp.max(wp.min(high[1], float(row) + 1.0) - wp.max(low[1], float(row)), 0.0) * scale
            start = (base[1] + row) * size[0] + base[0]
            for column in range(first_column, last_column + 1):
                share = wp.max(wp.min(high[0], float(column) + 1.0) - wp.max(low[0], float(column)), 0.0) * tall
                if share > 0.0:
                    inside += share
                    add(map, start + column, flux, share)
        return inside

    return deposit_taps


@functools.cache
def make_deposit_box(accumulate: str, channels: int) -> wp.Function:
    """Spread a flux over an axis-parallel box by its overlap with the pixels; return the share in the map.

    A box of one pixel is the bilinear splat, and the footprint of Yuksel & Keyser's gather. A box of a pixel or less
    that is wholly in the map, which is nearly every one, meets two columns and two rows at most: four additions whose
    weights are known from two numbers, and no loop.
    """
    deposit_point = make_deposit_point(accumulate, channels)
    deposit_quad = make_deposit_quad(accumulate, channels)
    deposit_taps = make_deposit_taps(accumulate, channels)
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
        whole = wp.vec2(wp.floor(p[0]), wp.floor(p[1]))
        base = base + wp.vec2i(int(whole[0]), int(whole[1]))
        p = p - whole
        low = p - 0.5 * width
        high = p + 0.5 * width
        if width[0] <= 1.0 and width[1] <= 1.0:
            # The box begins in this pixel or the one before.
            column = wp.where(low[0] < 0.0, -1, 0)
            row = wp.where(low[1] < 0.0, -1, 0)
            first = base + wp.vec2i(column, row)
            if first[0] >= 0 and first[0] + 1 < size[0] and first[1] >= 0 and first[1] + 1 < size[1]:
                right = wp.max(high[0] - float(column + 1), 0.0) * (1.0 / width[0])
                upper = wp.max(high[1] - float(row + 1), 0.0) * (1.0 / width[1])
                deposit_quad(map, size[0], first[1] * size[0] + first[0], right, upper, flux)
                return 1.0
        return deposit_taps(map, size, base, low, high, 1.0 / (width[0] * width[1]), flux)

    return deposit_box
