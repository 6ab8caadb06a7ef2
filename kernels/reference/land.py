"""Direct sunlight on dry land, in float64."""

import functools

import warp as wp

from ..spec import Spec
from .meet import make_meet
from .ray import ENDLESS, World
from .surface import make_field

PARTS, SHORE_PARTS = 8, 32
"""Points each way in a pixel at which land is looked at; a shore's pixel is then right to a thousandth."""


@functools.cache
def make_land(spec: Spec) -> wp.Kernel:
    """Light the dry part of each pixel: E max(0, -I_z + z_x I_x + z_y I_y), where no hill stands before the sun."""
    water_at = make_field(spec.water)
    terrain_at = make_field(spec.receiver)
    meet_land = make_meet(spec.receiver)

    @wp.func
    def is_dry(world: World, x: wp.float64, y: wp.float64) -> bool:
        ground = terrain_at(world.terrain, x, y)[0]
        if ground > world.water.highest:
            return True
        return ground >= -world.water.highest and ground >= water_at(world.water, x, y)[0]

    @wp.func
    def light_at(world: World, suns: wp.array[wp.vec3d], x: wp.float64, y: wp.float64) -> wp.float64:
        ground = terrain_at(world.terrain, x, y)
        origin = wp.vec3d(x, y, ground[0])
        total = wp.float64(0.0)
        for k in range(suns.shape[0]):
            sun = suns[k]
            light = ground[1] * sun[0] + ground[2] * sun[1] - sun[2]
            if light > wp.float64(0.0):
                hill = meet_land(
                    world.terrain, origin, -sun, wp.float64(1.0), world.terrain.highest, wp.float64(wp.static(ENDLESS))
                )
                if hill < wp.float64(0.0):
                    total += light
        return total

    @wp.func
    def part_of(pixel: int, part: int, parts: int, width: wp.float64) -> wp.float64:
        """The middle of a part of a pixel [m]."""
        return (wp.float64(pixel) + (wp.float64(part) + wp.float64(0.5)) / wp.float64(parts)) * width

    @wp.func
    def dry_parts(world: World, row: int, column: int, parts: int) -> int:
        count = int(0)
        for j in range(parts):
            for i in range(parts):
                x = part_of(column, i, parts, world.pixel[0])
                if is_dry(world, x, part_of(row, j, parts, world.pixel[1])):
                    count += 1
        return count

    @wp.kernel(module="unique", enable_backward=False)
    def reference_land(
        # In:
        world: World,
        suns: wp.array[wp.vec3d],
        first_row: int,
        columns: int,
        # Out:
        map_out: wp.array[wp.float64],
    ):
        """One thread a pixel; launch dims (rows of a band, columns). A shore's pixel is looked at in more parts."""
        band_row, column = wp.tid()
        row = first_row + band_row
        parts = int(wp.static(PARTS))
        dry = dry_parts(world, row, column, parts)
        if dry == 0:
            return
        if dry < parts * parts:
            parts = int(wp.static(SHORE_PARTS))
        total = wp.float64(0.0)
        for j in range(parts):
            for i in range(parts):
                x = part_of(column, i, parts, world.pixel[0])
                y = part_of(row, j, parts, world.pixel[1])
                if is_dry(world, x, y):
                    total += light_at(world, suns, x, y)
        map_out[row * columns + column] = total / wp.float64(parts * parts)

    return reference_land
