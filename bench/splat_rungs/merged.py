"""The splat that the library uses: taps merged, and a thread a run of photons on a CPU."""

import functools

import warp as wp

from warp_caustics.kernels.deposit import ACCUMULATOR, FLUX
from warp_caustics.kernels.splat import make_deposit_box

from .landed import Command, Landed, record


@functools.cache
def make_splat_merged(accumulate: str, channels: int) -> wp.Kernel:
    """Splat landed photons by the library's own deposit."""
    deposit = make_deposit_box(accumulate, channels)
    dtype, flux_type = ACCUMULATOR[accumulate], FLUX[channels]

    @wp.kernel(module="unique", enable_backward=False)
    def splat_merged(
        # In:
        x: wp.array[float],
        y: wp.array[float],
        flux: wp.array[flux_type],
        each: int,
        width: float,
        size: wp.vec2i,
        # Out:
        map_out: wp.array[dtype],
    ):
        """One thread ``each`` photons; launch dim the photons over that."""
        first = wp.tid() * each
        for i in range(first, wp.min(first + each, x.shape[0])):
            deposit(map_out, size, wp.vec2i(0, 0), wp.vec2(x[i], y[i]), wp.vec2(width, width), flux[i])

    return splat_merged


def merged(photons: Landed, image: wp.array) -> list[Command]:
    """Always, on a CPU; on a GPU until one of the others has been measured to be faster there."""
    each = photons.count if photons.device == "cpu" else 1
    kernel = make_splat_merged(photons.accumulate, photons.channels)
    inputs = [photons.x, photons.y, photons.flux, each, photons.width, wp.vec2i(*photons.resolution)]
    return [record(kernel, -(-photons.count // each), inputs, [image], photons.device)]
