"""The splat in its plain form: a box by its overlaps, one division and one addition for each tap and channel."""

import functools

import warp as wp

from warp_caustics.kernels.coverage import make_deposit_point
from warp_caustics.kernels.deposit import ACCUMULATOR, FLUX, make_add
from warp_caustics.kernels.splat import FARTHEST, NARROWEST

from .landed import Command, Landed, record


@functools.cache
def make_deposit_box_plain(accumulate: str, channels: int) -> wp.Function:
    """As :func:`~warp_caustics.kernels.splat.make_deposit_box`, tap by tap."""
    add = make_add(accumulate, channels)
    deposit_point = make_deposit_point(accumulate, channels)
    dtype = ACCUMULATOR[accumulate]

    @wp.func
    def deposit_box_plain(
        map: wp.array[dtype], size: wp.vec2i, base: wp.vec2i, p: wp.vec2, width: wp.vec2, flux: FLUX[channels]
    ) -> float:
        if not (width[0] > wp.static(NARROWEST) and width[1] > wp.static(NARROWEST)):
            return deposit_point(map, size, base, p, flux, 1.0)
        if not (wp.abs(p[0]) < wp.static(FARTHEST) and wp.abs(p[1]) < wp.static(FARTHEST)):
            return 0.0
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

    return deposit_box_plain


@functools.cache
def make_splat_plain(accumulate: str, channels: int) -> wp.Kernel:
    """Splat landed photons, one thread each."""
    deposit = make_deposit_box_plain(accumulate, channels)
    dtype, flux_type = ACCUMULATOR[accumulate], FLUX[channels]

    @wp.kernel(module="unique", enable_backward=False)
    def splat_plain(
        # In:
        x: wp.array[float],
        y: wp.array[float],
        flux: wp.array[flux_type],
        width: float,
        size: wp.vec2i,
        # Out:
        map_out: wp.array[dtype],
    ):
        """Launch dim the photons."""
        i = wp.tid()
        deposit(map_out, size, wp.vec2i(0, 0), wp.vec2(x[i], y[i]), wp.vec2(width, width), flux[i])

    return splat_plain


@functools.cache
def make_splat_channel(accumulate: str, channels: int) -> wp.Kernel:
    """Splat one channel of landed photons into every n-th element of a map: a pass over the photons for each."""
    deposit = make_deposit_box_plain(accumulate, 1)
    dtype, flux_type, mono = ACCUMULATOR[accumulate], FLUX[channels], FLUX[1]

    @wp.kernel(module="unique", enable_backward=False)
    def splat_channel(
        # In:
        x: wp.array[float],
        y: wp.array[float],
        flux: wp.array[flux_type],
        channel: int,
        width: float,
        size: wp.vec2i,
        # Out:
        map_out: wp.array[dtype],
    ):
        """Launch dim the photons; ``map_out`` is the channel's own, of any stride."""
        i = wp.tid()
        deposit(map_out, size, wp.vec2i(0, 0), wp.vec2(x[i], y[i]), wp.vec2(width, width), mono(flux[i][channel]))

    return splat_channel


def plain(photons: Landed, image: wp.array) -> list[Command]:
    """Today's plain form, kept as the reference: all channels in one pass."""
    kernel = make_splat_plain(photons.accumulate, photons.channels)
    inputs = [photons.x, photons.y, photons.flux, photons.width, wp.vec2i(*photons.resolution)]
    return [record(kernel, photons.count, inputs, [image], photons.device)]


def each_channel(photons: Landed, image: wp.array) -> list[Command]:
    """The plain form, once for each channel: what one pass for all of them saves."""
    kernel = make_splat_channel(photons.accumulate, photons.channels)
    commands = []
    for channel in range(photons.channels):
        inputs = [photons.x, photons.y, photons.flux, channel, photons.width, wp.vec2i(*photons.resolution)]
        own = image[channel :: photons.channels] if photons.channels > 1 else image
        commands.append(record(kernel, photons.count, inputs, [own], photons.device))
    return commands
