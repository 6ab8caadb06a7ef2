"""Direct sunlight on dry land, in float64."""

import functools

import warp as wp

from ..spec import Spec
from .meet import make_meet
from .ray import ENDLESS, World
from .surface import make_field

EDGE = 4
"""Times as many points, each way, in a pixel that an edge of water or of shadow crosses."""


@wp.struct
class Lit:
    """What was found at the points of a pixel."""

    dry: int  # points that are dry
    lit: int  # of them, points in the sun
    light: wp.float64  # summed


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
    def look(world: World, suns: wp.array[wp.vec3d], row: int, column: int, parts: int) -> Lit:
        found = Lit()
        for j in range(parts):
            for i in range(parts):
                x = part_of(column, i, parts, world.pixel[0])
                y = part_of(row, j, parts, world.pixel[1])
                if is_dry(world, x, y):
                    light = light_at(world, suns, x, y)
                    found.dry += 1
                    found.light += light
                    if light > wp.float64(0.0):
                        found.lit += 1
        return found

    @wp.kernel(module="unique", enable_backward=False)
    def reference_land(
        # In:
        world: World,
        suns: wp.array[wp.vec3d],
        first_row: int,
        columns: int,
        parts: int,
        # Out:
        map_out: wp.array[wp.float64],
    ):
        """One thread a pixel; launch dims (rows of a band, columns)."""
        band_row, column = wp.tid()
        row = first_row + band_row
        count = parts
        found = look(world, suns, row, column, count)
        edge = found.dry < parts * parts or found.lit < found.dry
        if found.dry > 0 and found.lit > 0 and edge:
            count = wp.static(EDGE) * parts
            found = look(world, suns, row, column, count)
        map_out[row * columns + column] = found.light / wp.float64(count * count)

    return reference_land
