"""The corners of a beam over waves, row by row on a CPU: as :mod:`.beam` lands them, in :mod:`.lanes`."""

import functools
from dataclasses import replace

import warp as wp

from .beam import make_land_corner
from .gather_rows import make_land_block, serves
from .lanes import LANES, lanes_of
from .lattice import Lattice, at_rest, on_water
from .patch import BORDER
from .photon import Scene, SunSample
from .spec import Spec
from .wave_rows import water_block


@functools.cache
def make_corner_rows(spec: Spec) -> wp.Kernel:
    """Land the corners of a strip; of the plainest scenes all of a block at once, of others one by one."""
    land_corner = make_land_corner(spec)
    land_block = make_land_block(spec.fresnel)
    plain, fresnel = serves(replace(spec, accumulate="float32")), spec.fresnel

    @wp.kernel(module="unique", enable_backward=False)
    def corners(
        # In:
        scene: Scene,
        suns: wp.array[SunSample],
        sun: int,
        lattice: Lattice,
        first_row: int,
        column_cos: wp.array2d[float],
        column_sin: wp.array2d[float],
        row_waves: wp.array2d[wp.vec2],
        # Out:
        planes_out: wp.array3d[float],
        state_out: wp.array2d[wp.uint8],
    ):
        """One thread a row of corners of the strip with its border; rows are :func:`~.lanes.padded`."""
        row = wp.tid()
        light = suns[sun]
        waves = scene.water.surface.waves
        cosines = lanes_of(column_cos)
        sines = lanes_of(column_sin)
        for block in range(cosines.shape[1]):
            water = water_block(waves, cosines, sines, row_waves, row, block)
            if wp.static(plain):
                landing = land_block(
                    light.direction, light.rest_shift, scene.medium, scene.receiver.level, lattice.pixel, water
                )
                lanes_of(planes_out[0])[row, block] = landing.x
                lanes_of(planes_out[1])[row, block] = landing.y
                lanes_of(planes_out[2])[row, block] = landing.incident
                if wp.static(fresnel):
                    lanes_of(planes_out[3])[row, block] = landing.flux
            else:
                z = water.z
                slope_x = water.slope_x
                slope_y = water.slope_y
                first = block * wp.static(LANES)
                for k in range(wp.static(LANES)):
                    column = first + k
                    index = wp.vec2i(lattice.first[0] + column - wp.static(BORDER), first_row + row - wp.static(BORDER))
                    at = on_water(lattice, at_rest(lattice, index, 0.0), light.rest_shift)
                    surface = wp.vec3(z[k], slope_x[k], slope_y[k])
                    land_corner(scene, light, lattice, at, surface, row, column, planes_out, state_out)

    return corners
