"""Surfaces: water and terrain as one thing, a plane that carries waves, a height map, or rings."""

import warp as wp

from .grid import Grid, grid_place, grid_sum, grid_sum_curved, periodic_place
from .radial import ring_sum, ring_sum_curved
from .waves import Wave, vec6, wave_sum, wave_sum_curved


@wp.struct
class Surface:
    """A height field, relative to the water's rest level; ``grid`` or ``waves`` is empty where it is not used."""

    base: float  # [m]
    slope: wp.vec2
    waves: wp.array[Wave]
    grid: Grid
    middle: wp.vec2  # of rings, whose wave is the first


@wp.func
def waves_at(surface: Surface, x: float, y: float) -> wp.vec3:
    """Height and slope (z, z_x, z_y) of a tilted plane with waves."""
    plane = wp.vec3(surface.base + surface.slope[0] * x + surface.slope[1] * y, surface.slope[0], surface.slope[1])
    return plane + wave_sum(surface.waves, x, y)


@wp.func
def waves_curved_at(surface: Surface, x: float, y: float) -> vec6:
    """As :func:`waves_at`, with the second derivatives."""
    total = wave_sum_curved(surface.waves, x, y)
    total[0] += surface.base + surface.slope[0] * x + surface.slope[1] * y
    total[1] += surface.slope[0]
    total[2] += surface.slope[1]
    return total


@wp.func
def grid_at(surface: Surface, x: float, y: float) -> wp.vec3:
    """Height and slope (z, z_x, z_y) of a height map."""
    return grid_sum(surface.grid, grid_place(surface.grid, x, y))


@wp.func
def grid_curved_at(surface: Surface, x: float, y: float) -> vec6:
    """As :func:`grid_at`, with the second derivatives."""
    return grid_sum_curved(surface.grid, grid_place(surface.grid, x, y))


@wp.func
def periodic_at(surface: Surface, x: float, y: float) -> wp.vec3:
    """Height and slope (z, z_x, z_y) of a height map that repeats."""
    return grid_sum(surface.grid, periodic_place(surface.grid, x, y))


@wp.func
def periodic_curved_at(surface: Surface, x: float, y: float) -> vec6:
    """As :func:`periodic_at`, with the second derivatives."""
    return grid_sum_curved(surface.grid, periodic_place(surface.grid, x, y))


@wp.func
def radial_at(surface: Surface, x: float, y: float) -> wp.vec3:
    """Height and slope (z, z_x, z_y) of rings."""
    return ring_sum(surface.waves[0], x - surface.middle[0], y - surface.middle[1])


@wp.func
def radial_curved_at(surface: Surface, x: float, y: float) -> vec6:
    """As :func:`radial_at`, with the second derivatives."""
    return ring_sum_curved(surface.waves[0], x - surface.middle[0], y - surface.middle[1])


HEIGHT_AND_SLOPE = {"waves": waves_at, "grid": grid_at, "periodic": periodic_at, "radial": radial_at}
"""By kind of surface: (z, z_x, z_y) at a point."""

HEIGHT_SLOPE_AND_CURVATURE = {
    "waves": waves_curved_at,
    "grid": grid_curved_at,
    "periodic": periodic_curved_at,
    "radial": radial_curved_at,
}
"""By kind of surface: (z, z_x, z_y, z_xx, z_xy, z_yy) at a point."""
