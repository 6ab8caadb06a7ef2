"""The places of a lattice in a height map that repeats, against float64 in NumPy."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from kernel_helpers import lattice

from warp_caustics.kernels.grid import Grid
from warp_caustics.kernels.photon import Scene, SunSample
from warp_caustics.kernels.place_table import place_table
from warp_caustics.state import split

NODES = (12, 20)  # rows, columns
ORIGIN, CELL = np.array((-0.317, 1.23)), np.array((0.1 / 3.0, 0.07))  # no float32 holds them
SHIFT = np.array((0.375, -0.75))  # which one holds: the lattice is anchored by it

PLACE = 1e-7
"""Error of a place [nodes]: that of writing its fraction as a float32. A float32 position would be wrong by 1e-3."""


def repeating_grid(device: str) -> Grid:
    """A height map of no heights, whose places alone are looked at."""
    grid = Grid()
    grid.nodes = wp.zeros(NODES, dtype=wp.vec4, device=device)
    grid.origin, grid.origin_rest = (wp.vec2(*part) for part in split(ORIGIN))
    grid.per_metre, grid.per_metre_rest = (wp.vec2(*part) for part in split(1.0 / CELL))
    return grid


@pytest.mark.parametrize(("first", "offset"), [(0, 0.5), (-7, -1.0), (-200_000, 0.5), (300_000, -1.0)])
def test_places_are_those_of_float64_however_far(device, first, offset):
    shape, step, pixel, first_row = (9, 14), 3.0**-0.5, np.array((0.0153, 0.021)), 5 - first
    world, sun = Scene(), SunSample()
    world.water.surface.grid = repeating_grid(device)
    sun.rest_shift = wp.vec2(*SHIFT)
    suns = wp.array([sun], dtype=SunSample, device=device)
    # One entry of guard behind each table: a thread past its end must not write.
    tables = [wp.full((count + 1, 1), wp.vec2(7.0, 7.0), dtype=wp.vec2, device=device) for count in shape[::-1]]
    wp.launch(
        place_table,
        dim=max(shape) + 5,
        inputs=[world, suns, 0, lattice((first, -999), (shape[1], 999), step, pixel), first_row, offset],
        outputs=[tables[0][: shape[1]], tables[1][: shape[0]]],
        device=device,
    )
    for axis, start in enumerate((first, first_row)):
        made, count = tables[axis].numpy()[:, 0].astype(np.float64), NODES[1 - axis]
        assert (made[-1] == 7.0).all()
        node, past = made[:-1].T
        assert (node == np.round(node)).all() and (node >= 0).all() and (node < count).all()
        assert (past >= 0.0).all() and (past <= 1.0).all()
        water = (start + np.arange(shape[1 - axis]) + offset) * step * pixel[axis] - SHIFT[axis]
        turns = ((water - ORIGIN[axis]) / CELL[axis] - node - past) / count
        assert np.abs(turns - np.round(turns)).max() * count < PLACE
