"""Waves on a lattice: sines of sums from sines of the parts, tabulated once for each row and each column.

sin(A + B) = sin A cos B + cos A sin B, with A from the column and B from the row: a lattice point costs four products
a wave and no sine. The tables are made in float64, of wavevectors, phases and cells with the host's digits: on a
lattice of thousands of radians the sines are right to their last digit, and water that repeats repeats bit for bit.
"""

import functools

import warp as wp

from .grid import grid_sum
from .lattice import Lattice, water_along, whole
from .photon import Scene, SunSample
from .place_table import tabled_place
from .spec import Spec
from .surface import HEIGHT_AND_SLOPE, HEIGHT_SLOPE_AND_CURVATURE
from .waves import Wave, vec6


@wp.func
def turn(angle: wp.float64) -> wp.vec2:
    """Cosine and sine of an angle, taken in float64."""
    return wp.vec2(float(wp.cos(angle)), float(wp.sin(angle)))


@wp.kernel(enable_backward=False)
def wave_table(
    # In:
    scene: Scene,
    suns: wp.array[SunSample],
    sun: int,
    lattice: Lattice,
    first_row: int,
    offset: float,
    # Out:
    column_waves_out: wp.array2d[wp.vec2],
    row_waves_out: wp.array2d[wp.vec2],
):
    """One thread a column or row; launch dim the larger count; ``offset`` is of the first point, in cells.

    ``column_waves_out[i, w]`` is (cos, sin) of k_x x_i + phase, ``row_waves_out[j, w]`` of k_y y_j.
    """
    i = wp.tid()
    shift = suns[sun].rest_shift
    for w in range(scene.water.surface.waves.shape[0]):
        wave = scene.water.surface.waves[w]
        if i < column_waves_out.shape[0]:
            x = water_along(lattice, 0, lattice.first[0] + i, offset, shift)
            phase = whole(wave.phase, wave.phase_rest)
            column_waves_out[i, w] = turn(whole(wave.wavevector[0], wave.wavevector_rest[0]) * x + phase)
        if i < row_waves_out.shape[0]:
            y = water_along(lattice, 1, first_row + i, offset, shift)
            row_waves_out[i, w] = turn(whole(wave.wavevector[1], wave.wavevector_rest[1]) * y)


@wp.func
def wave_lattice_sum(
    waves: wp.array[Wave], column_waves: wp.array2d[wp.vec2], row_waves: wp.array2d[wp.vec2], column: int, row: int
) -> wp.vec3:
    """Displacement and slope (z, z_x, z_y) at a lattice point, from the tables."""
    total = wp.vec3(0.0, 0.0, 0.0)
    for w in range(waves.shape[0]):
        wave = waves[w]
        a = column_waves[column, w]
        b = row_waves[row, w]
        rise = wave.amplitude * (a[0] * b[0] - a[1] * b[1])
        total += wp.vec3(
            wave.amplitude * (a[1] * b[0] + a[0] * b[1]), rise * wave.wavevector[0], rise * wave.wavevector[1]
        )
    return total


@functools.cache
def make_water_on_lattice(spec: Spec) -> wp.Function:
    """Height and slope of the water at a lattice point: from the tables of its waves or places, or from its kind."""
    water_at = HEIGHT_AND_SLOPE[spec.water]
    tabled, periodic = spec.water == "waves", spec.water == "periodic"

    @wp.func
    def water_on_lattice(
        scene: Scene, column_waves: wp.array2d[wp.vec2], row_waves: wp.array2d[wp.vec2], column: int, row: int,
        at: wp.vec2,
    ) -> wp.vec3:  # fmt: skip
        if wp.static(tabled):
            return wave_lattice_sum(scene.water.surface.waves, column_waves, row_waves, column, row)
        elif wp.static(periodic):
            grid = scene.water.surface.grid
            return grid_sum(grid, tabled_place(grid, column_waves, row_waves, column, row))
        else:
            return water_at(scene.water.surface, at[0], at[1])

    return water_on_lattice


@wp.func
def wave_lattice_sum_curved(
    waves: wp.array[Wave], column_waves: wp.array2d[wp.vec2], row_waves: wp.array2d[wp.vec2], column: int, row: int
) -> vec6:
    """As :func:`wave_lattice_sum`, with the second derivatives (z, z_x, z_y, z_xx, z_xy, z_yy)."""
    total = vec6()
    for w in range(waves.shape[0]):
        wave = waves[w]
        a = column_waves[column, w]
        b = row_waves[row, w]
        k = wave.wavevector
        height = wave.amplitude * (a[1] * b[0] + a[0] * b[1])
        rise = wave.amplitude * (a[0] * b[0] - a[1] * b[1])
        total += vec6(
            height, rise * k[0], rise * k[1], -height * k[0] * k[0], -height * k[0] * k[1], -height * k[1] * k[1]
        )
    return total


@functools.cache
def make_curved_water_on_lattice(spec: Spec) -> wp.Function:
    """As :func:`make_water_on_lattice`, with the second derivatives."""
    water_at = HEIGHT_SLOPE_AND_CURVATURE[spec.water]
    tabled = spec.water == "waves"

    @wp.func
    def curved_water_on_lattice(
        scene: Scene, column_waves: wp.array2d[wp.vec2], row_waves: wp.array2d[wp.vec2], column: int, row: int,
        at: wp.vec2,
    ) -> vec6:  # fmt: skip
        if wp.static(tabled):
            return wave_lattice_sum_curved(scene.water.surface.waves, column_waves, row_waves, column, row)
        else:
            return water_at(scene.water.surface, at[0], at[1])

    return curved_water_on_lattice
