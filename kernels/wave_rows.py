"""Rows of waves: height and slope of all waves along one row of a lattice, from tables laid out for it.

The sums are those of :mod:`~.wave_table`; only the tables of the columns lie the other way, ``[wave, column]``, cosine
and sine apart, so that a row runs through memory in order. What a row and a wave share is taken out of the loop over
columns.

Made for a CPU, where :func:`water_block` does columns side by side, as one of Warp's vectors.
"""

import warp as wp

from .lanes import lanes
from .lattice import Lattice, water_along, whole
from .photon import Scene, SunSample
from .wave_table import turn
from .waves import Wave

RUN = 32
"""Columns whose sines follow from those of the first: float64 turned so often is right to 1e-14."""


@wp.kernel(enable_backward=False)
def wave_planes(
    # In:
    scene: Scene,
    suns: wp.array[SunSample],
    sun: int,
    lattice: Lattice,
    first_row: int,
    offset: float,
    # Out:
    column_cos_out: wp.array2d[float],
    column_sin_out: wp.array2d[float],
    row_waves_out: wp.array2d[wp.vec2],
):
    """One thread a row or a run of columns; launch dim the larger count of rows and columns.

    ``offset`` is of the first point, in cells. ``column_cos_out[w, i]`` and ``column_sin_out[w, i]`` are of
    k_x x_i + phase, ``row_waves_out[j, w]`` is (cos, sin) of k_y y_j, as in :func:`~.wave_table.wave_table`.
    """
    i = wp.tid()
    begin = i * wp.static(RUN)
    end = wp.min(begin + wp.static(RUN), column_cos_out.shape[1])
    shift = suns[sun].rest_shift
    for w in range(scene.water.surface.waves.shape[0]):
        wave = scene.water.surface.waves[w]
        if begin < end:
            x = water_along(lattice, 0, lattice.first[0] + begin, offset, shift)
            k = whole(wave.wavevector[0], wave.wavevector_rest[0])
            angle = k * x + whole(wave.phase, wave.phase_rest)
            step = k * (water_along(lattice, 0, lattice.first[0] + begin + 1, offset, shift) - x)
            # Each column is the one before it, turned by the same angle.
            cos_a = wp.cos(angle)
            sin_a = wp.sin(angle)
            cos_step = wp.cos(step)
            sin_step = wp.sin(step)
            for column in range(begin, end):
                column_cos_out[w, column] = float(cos_a)
                column_sin_out[w, column] = float(sin_a)
                turned = cos_a * cos_step - sin_a * sin_step
                sin_a = sin_a * cos_step + cos_a * sin_step
                cos_a = turned
        if i < row_waves_out.shape[0]:
            y = water_along(lattice, 1, first_row + i, offset, shift)
            row_waves_out[i, w] = turn(whole(wave.wavevector[1], wave.wavevector_rest[1]) * y)


@wp.struct
class Water:
    """Displacement and slope of the water at the columns of a block."""

    z: lanes
    slope_x: lanes
    slope_y: lanes


@wp.func
def water_block(
    waves: wp.array[Wave],
    column_cos: wp.array2d[lanes],
    column_sin: wp.array2d[lanes],
    row_waves: wp.array2d[wp.vec2],
    row: int,
    block: int,
) -> Water:
    """Displacement and slope of the columns of a block, as :func:`~.wave_table.wave_lattice_sum`.

    The tables are seen through :func:`~.lanes.lanes_of`.
    """
    z = lanes()
    slope_x = lanes()
    slope_y = lanes()
    for w in range(waves.shape[0]):
        wave = waves[w]
        b = row_waves[row, w]
        cos_a = column_cos[w, block]
        sin_a = column_sin[w, block]
        rise = wave.amplitude * (b[0] * cos_a - b[1] * sin_a)
        z += wave.amplitude * (b[0] * sin_a + b[1] * cos_a)
        slope_x += wave.wavevector[0] * rise
        slope_y += wave.wavevector[1] * rise
    water = Water()
    water.z = z
    water.slope_x = slope_x
    water.slope_y = slope_y
    return water
