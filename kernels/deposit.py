"""Adding flux to a caustic map, in the number format that the scene asks for."""

import functools

import warp as wp

FIXED_SCALE = 2.0**32
"""Steps of the fixed-point map in the flux of one cell: 2^-32 is finer than float32, and 2^31 cells fit a pixel."""

vec1 = wp.types.vector(length=1, dtype=float)

FLUX = {1: vec1, 3: wp.vec3}
"""The type of a flux, by number of channels."""

ACCUMULATOR = {"float32": wp.float32, "float64": wp.float64, "fixed": wp.int64}
"""The type of a map's elements while light is added up."""


@functools.cache
def make_add(accumulate: str, channels: int) -> wp.Function:
    """Add a flux, by channel, to one pixel; the caller has bounded the index."""
    dtype = ACCUMULATOR[accumulate]
    fixed = accumulate == "fixed"

    @wp.func
    def add(map: wp.array[dtype], pixel: int, flux: FLUX[channels], share: float):
        for c in range(wp.static(channels)):
            if wp.static(fixed):
                step = wp.float64(flux[c] * share) * wp.float64(wp.static(FIXED_SCALE))
                wp.atomic_add(map, pixel * wp.static(channels) + c, wp.int64(wp.rint(step)))
            else:
                wp.atomic_add(map, pixel * wp.static(channels) + c, dtype(flux[c] * share))

    return add


def unit(accumulate: str) -> float:
    """The flux that one unit of an accumulator stands for."""
    return 1.0 / FIXED_SCALE if accumulate == "fixed" else 1.0
