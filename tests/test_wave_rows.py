"""Rows of waves, in blocks of columns, against the sum of sines in float64."""

import numpy as np
import pytest
import warp as wp
from scenery import GENTLE, scene

from warp_caustics.assets import load_assets
from warp_caustics.facts import gather_facts
from warp_caustics.kernels.lanes import LANES, lanes_of, padded
from warp_caustics.kernels.wave_rows import water_block, wave_planes
from warp_caustics.kernels.waves import Wave
from warp_caustics.state import SceneState
from warp_caustics.window import Lattice as HostLattice

# Float32 products of numbers up to one, three waves of them, relative to the sum of their amplitudes.
SUM_TOLERANCE = 1e-6
CELLS = HostLattice((-3, -2), (LANES + 21, 10), 0.5)
FIRST, ROWS = 1, 6  # of a strip
OFFSET = 0.5
WIDTH = padded(CELLS.count[0])


@wp.kernel(enable_backward=False)
def by_block(
    waves: wp.array[Wave], column_cos: wp.array2d[float], column_sin: wp.array2d[float],
    row_waves: wp.array2d[wp.vec2], z_out: wp.array2d[float], slope_x_out: wp.array2d[float],
    slope_y_out: wp.array2d[float],
):  # fmt: skip
    row, block = wp.tid()
    water = water_block(waves, lanes_of(column_cos), lanes_of(column_sin), row_waves, row, block)
    z = lanes_of(z_out)
    slope_x = lanes_of(slope_x_out)
    slope_y = lanes_of(slope_y_out)
    z[row, block] = water.z
    slope_x[row, block] = water.slope_x
    slope_y[row, block] = water.slope_y


def expected(what, facts):
    """Displacement and slope at the strip's points in float64, ``[3, rows, columns]``."""
    columns = np.arange(CELLS.first[0], CELLS.first[0] + WIDTH) + OFFSET
    rows = np.arange(FIRST, FIRST + ROWS) + OFFSET
    x = columns * CELLS.step * facts.pixel[0] - facts.rest_shifts[0][0] + what.map.origin[0]
    y = (rows * CELLS.step * facts.pixel[1] - facts.rest_shifts[0][1] + what.map.origin[1])[:, None]
    total = np.zeros((3, ROWS, WIDTH))
    for one in what.waves:
        kx, ky = one.wavevector
        angle = kx * x + ky * y + one.phase
        rise = one.amplitude * np.cos(angle)
        total += one.amplitude * np.sin(angle), kx * rise, ky * rise
    return total


@pytest.fixture
def tables(device):
    """Waves and their tables, the planes to be written, and what should be in them; the state owns the waves."""
    what = scene(GENTLE)
    facts = gather_facts(what, load_assets(what))
    state = SceneState(facts, device)
    state.write(0.0)
    waves = state.scene.water.surface.waves
    count = len(GENTLE)
    cosines, sines = (wp.zeros((count, WIDTH), dtype=float, device=device) for _ in range(2))
    rows = wp.zeros((ROWS, count), dtype=wp.vec2, device=device)
    wp.launch(
        wave_planes, dim=max(WIDTH, ROWS),
        inputs=[state.scene, state.suns, 0, state.lattice(CELLS), FIRST, OFFSET], outputs=[cosines, sines, rows],
        device=device,
    )  # fmt: skip
    # Filled with rubbish: a row must not add to what a frame before has left.
    planes = [wp.full((ROWS, WIDTH), value=7.0, dtype=float, device=device) for _ in range(3)]
    return state, [waves, cosines, sines, rows], planes, expected(what, facts)


def test_a_block_is_the_sum_of_sines(tables, device):
    """More blocks than one: the last columns are beyond the lattice, and are water as well."""
    _, given, planes, sums = tables
    wp.launch(by_block, dim=(ROWS, WIDTH // LANES), inputs=given, outputs=planes, device=device)
    for found, plane in zip(planes, sums, strict=True):
        assert np.abs(found.numpy() - plane).max() < SUM_TOLERANCE
