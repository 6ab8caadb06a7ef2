"""The gather on a receiver that is not flat: one pass, around each pixel's own illumination centre.

Yuksel & Keyser leave it as future work. Their P_C = P_G - h R0_xy / |R0_z| holds for the depth h of each ground point
P_G; only on a plane is h the same for all. Where it is not, the pixels of a column no longer look at the samples of a
row through one window, so that there is nothing left for two passes to share: a pixel adds up its own window.
"""

import functools

import warp as wp

from .deposit import FLUX
from .gather import box_overlap
from .lattice import Lattice
from .optics import refract_at_slope
from .photon import Scene, SunSample
from .spec import Spec
from .surface import HEIGHT_AND_SLOPE

ROUNDING = 1.0e-2
"""Pixels by which float32 may misplace the end of a window: landings are known to 1e-5 of them, and better."""


@wp.func
def window(
    depth: float, spread: float, rest: float, low: float, high: float, shift: float, pixel: float, half: int
) -> wp.vec2i:
    """First and last sample, counted from a pixel along one axis, that the pixel looks at.

    The window reaches ``half`` samples each way from the illumination centre of the pixel, whose ground lies at
    ``depth``. Light that lands on the pixel comes down by ``depth`` give or take ``spread``, and shifts by ``low`` to
    ``high`` of that (``rest`` in still water): what lies beyond is left out, and nothing is lost. ``shift`` is the
    lattice's own; all in metres but ``half``.
    """
    middle = int(wp.round((shift - wp.max(depth, 0.0) * rest) / pixel))
    shallow = wp.max(depth - spread, 0.0)
    deep = wp.max(depth + spread, 0.0)
    nearest = wp.min(shallow * low, deep * low)
    farthest = wp.max(shallow * high, deep * high)
    # The box of a sample reaches into the next pixel.
    first = int(wp.floor((shift - farthest) / pixel - wp.static(ROUNDING))) - 1
    last = int(wp.ceil((shift - nearest) / pixel + wp.static(ROUNDING))) + 1
    return wp.vec2i(wp.max(first, middle - half), wp.min(last, middle + half))


@functools.cache
def make_gather_terrain(spec: Spec) -> wp.Kernel:
    """What each pixel gets of the samples that can light its own ground."""
    terrain_at = HEIGHT_AND_SLOPE[spec.receiver]
    flux_type = FLUX[spec.channels]
    channels = spec.channels

    @wp.kernel(module="unique", enable_backward=False)
    def gather_terrain(
        # In:
        begin: int,
        scene: Scene,
        suns: wp.array[SunSample],
        sun: int,
        lattice: Lattice,
        way_low: wp.vec2,
        way_high: wp.vec2,
        spread: float,
        n: int,
        m: int,
        landing: wp.array2d[wp.vec2],
        flux: wp.array2d[flux_type],
        # Out:
        map_out: wp.array[float],
    ):
        """One thread a pixel of the map, from row ``begin``; launch dims (rows, columns).

        Landings are in pixels from the sample's own.
        ``way_low`` and ``way_high`` bound the horizontal way of refracted light by unit depth, over every slope of the
        water and direction of the sun; ``spread`` bounds by how much more or less than the depth of the pixel's ground
        light comes down that lands on it [m].
        """
        row, column = wp.tid()
        row += begin
        light = suns[sun]
        pixel = lattice.pixel
        x = (float(column) + 0.5) * pixel[0]
        y = (float(row) + 0.5) * pixel[1]
        depth = -terrain_at(scene.receiver.terrain, x, y)[0]
        direction = refract_at_slope(light.direction, wp.vec2(0.0, 0.0), scene.medium.eta)
        rest = wp.vec2(direction[0], direction[1]) / -direction[2]
        shift = light.rest_shift
        wide = window(depth, spread, rest[0], way_low[0], way_high[0], shift[0], pixel[0], n / 2)
        tall = window(depth, spread, rest[1], way_low[1], way_high[1], shift[1], pixel[1], m / 2)
        # The pixel's own sample in the lattice.
        own = wp.vec2i(column - lattice.first[0], row - lattice.first[1])
        total = flux_type()
        for j in range(wp.max(tall[0], -own[1]), wp.min(tall[1], lattice.count[1] - 1 - own[1]) + 1):
            for i in range(wp.max(wide[0], -own[0]), wp.min(wide[1], lattice.count[0] - 1 - own[0]) + 1):
                sample = landing[own[1] + j, own[0] + i]
                ax = box_overlap(sample[0] + float(i))
                if ax > 0.0:
                    ay = box_overlap(sample[1] + float(j))
                    if ay > 0.0:
                        total += ax * ay * flux[own[1] + j, own[0] + i]
        at = (row * lattice.map[0] + column) * wp.static(channels)
        for c in range(wp.static(channels)):
            map_out[at + c] = map_out[at + c] + total[c]

    return gather_terrain
