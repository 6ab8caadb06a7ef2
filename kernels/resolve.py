"""From accumulators to the caustic map: lanes added up, scaled to irradiance, dry land lit directly."""

import functools

import warp as wp

from .deposit import ACCUMULATOR
from .optics import facing
from .photon import Scene, SunSample, share_lit
from .project import FAR, Receiver, make_clearance
from .spec import Spec
from .surface import HEIGHT_AND_SLOPE

DRY_PARTS = 4
"""Parts of a pixel along each side in which its dry share is taken."""

SURE = 3.0
"""Pixels around a pixel that must be all wet, or all dry, by the slope at its middle, for it to be sure."""


@functools.cache
def make_resolve(accumulate: str, channels: int, colours: int) -> wp.Kernel:
    """Add the lanes' maps and scale them to irradiance; ``colours`` of the map share ``channels`` of transport."""
    dtype = ACCUMULATOR[accumulate]

    @wp.kernel(module="unique", enable_backward=False)
    def resolve(
        # In:
        begin: int,
        lanes: wp.array2d[dtype],
        scale: wp.vec3d,
        # Out:
        map_out: wp.array[float],
    ):
        """One thread a value of the map, from ``begin``; launch dim pixels * colours."""
        i = wp.tid() + begin
        pixel = i // wp.static(colours)
        colour = i - pixel * wp.static(colours)
        at = pixel * wp.static(channels) + wp.where(wp.static(channels) == 1, 0, colour)
        total = wp.float64(0.0)
        for lane in range(lanes.shape[0]):
            total += wp.float64(lanes[lane, at])
        map_out[i] = float(total * scale[colour])

    return resolve


@functools.cache
def make_add_lanes(accumulate: str) -> wp.Kernel:
    """Add what other lanes have to an accumulator."""
    dtype = ACCUMULATOR[accumulate]

    @wp.kernel(module="unique", enable_backward=False)
    def add_lanes(
        # In:
        begin: int,
        others: wp.array2d[dtype],
        # Out:
        total_out: wp.array[dtype],
    ):
        """One thread a value, from ``begin``; launch dim the values of a lane."""
        i = wp.tid() + begin
        total = total_out[i]
        for lane in range(others.shape[0]):
            total += others[lane, i]
        total_out[i] = total

    return add_lanes


@wp.kernel(enable_backward=False)
def stack(
    # In:
    begin: int,
    red: wp.array[float],
    green: wp.array[float],
    blue: wp.array[float],
    each: int,
    # Out:
    map_out: wp.array[float],
):
    """Join three maps into one in colour; each brings 1 value a pixel, or 3 of which its own channel's counts.

    One thread a pixel, from ``begin``.
    """
    i = wp.tid() + begin
    map_out[3 * i] = red[i * each]
    map_out[3 * i + 1] = green[i * each + each // 2]
    map_out[3 * i + 2] = blue[i * each + each - 1]


@functools.cache
def make_dry_land(spec: Spec) -> wp.Kernel:
    """Light dry land directly: E max(0, -I_z + z_x I_x + z_y I_y) on the part of a pixel that is dry and in the sun."""
    water_at = HEIGHT_AND_SLOPE[spec.water]
    kind = spec.receiver if spec.receiver in HEIGHT_AND_SLOPE else "waves"
    terrain_at = HEIGHT_AND_SLOPE[kind]
    clear_of_land = make_clearance(kind)
    hills_shade = spec.hills_shade

    @wp.func
    def dry_share(scene: Scene, at: wp.vec2, size: wp.vec2) -> float:
        ground = terrain_at(scene.receiver.terrain, at[0], at[1])
        spread = wp.abs(ground[1]) * size[0] + wp.abs(ground[2]) * size[1]
        if ground[0] + spread < -scene.water.amplitude:
            return 0.0
        if ground[0] - spread > scene.water.amplitude:
            return 1.0
        water = water_at(scene.water.surface, at[0], at[1])
        return share_lit(ground[0] - water[0], wp.vec2(ground[1] - water[1], ground[2] - water[2]), size)

    @wp.func
    def sunlit_share(land: Receiver, sun: wp.vec3, at: wp.vec2, size: wp.vec2) -> float:
        """Share of a pixel that no hill shades: one ray from its middle, whose edge of shadow is filtered."""
        ground = terrain_at(land.terrain, at[0], at[1])
        origin = wp.vec3(at[0], at[1], ground[0])
        near = clear_of_land(land.terrain, origin, -sun, 1.0, land.slope, land.highest, land.step)
        if near[0] >= FAR:
            return 1.0
        hill = terrain_at(land.terrain, origin[0] - near[1] * sun[0], origin[1] - near[1] * sun[1])
        return share_lit(near[0], wp.vec2(ground[1] - hill[1], ground[2] - hill[2]), size)

    @wp.kernel(module="unique", enable_backward=False)
    def dry_land(
        # In:
        begin: int,
        scene: Scene,
        suns: wp.array[SunSample],
        pixel: wp.vec2,
        columns: int,
        irradiance: wp.vec3,
        colours: int,
        # Out:
        map_out: wp.array[float],
        dry_out: wp.array[wp.float64],
    ):
        """One thread a pixel, from row ``begin``; launch dims (rows, columns).

        ``irradiance`` is that of one direction of the sun.
        """
        row, column = wp.tid()
        row += begin
        middle = wp.vec2((float(column) + 0.5) * pixel[0], (float(row) + 0.5) * pixel[1])
        # Most pixels are wholly wet or wholly dry by a margin; only the others are looked at in parts.
        share = dry_share(scene, middle, wp.static(SURE) * pixel)
        if share <= 0.0:
            return
        parts = int(wp.static(DRY_PARTS))  # a variable, so that the loops are not unrolled
        part = pixel / float(parts)
        light = float(0.0)
        for k in range(suns.shape[0]):
            sun = suns[k].direction
            direct = float(0.0)
            for j in range(parts):
                for i in range(parts):
                    x = float(column) * pixel[0] + (float(i) + 0.5) * part[0]
                    y = float(row) * pixel[1] + (float(j) + 0.5) * part[1]
                    dry = float(1.0)
                    if share < 1.0:
                        dry = dry_share(scene, wp.vec2(x, y), part)
                    if dry > 0.0:
                        ground = terrain_at(scene.receiver.terrain, x, y)
                        direct += dry * wp.max(0.0, facing(sun, wp.vec2(ground[1], ground[2])))
            if wp.static(hills_shade):
                if direct > 0.0:
                    direct *= sunlit_share(scene.receiver, sun, middle, pixel)
            light += direct
        light /= float(wp.static(DRY_PARTS)) * float(wp.static(DRY_PARTS))
        if light > 0.0:
            for c in range(colours):
                at = (row * columns + column) * colours + c
                map_out[at] = map_out[at] + light * irradiance[c]
                wp.atomic_add(dry_out, c, wp.float64(light * irradiance[c]))

    return dry_land
