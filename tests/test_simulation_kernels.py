"""Kernels of simulated water on single arrays: transforms, nodes, and the look-up of a surface that repeats."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from kernel_helpers import grid_surface, points

from warp_caustics.assets import HeightGrid
from warp_caustics.height_map import hermite_nodes, sample_heights
from warp_caustics.kernels.fft import LONGEST, fft_block, make_fft_rows
from warp_caustics.kernels.grid import Grid
from warp_caustics.kernels.nodes import make_extremes, make_nodes
from warp_caustics.kernels.spectral import Dispersion, angular_frequency
from warp_caustics.kernels.surface import Surface, grid_at, grid_curved_at, periodic_at, periodic_curved_at
from warp_caustics.kernels.waves import vec6

wp.set_module_options({"enable_backward": False})

# A transform of n values rounds log2(n) times; its twiddle factors, by a running product, a little more.
FFT_TOLERANCE = 1e-13
# Nodes are rounded to float32 once.
NODE_TOLERANCE = 1e-7
# Sums of four products of float32.
VALUE_TOLERANCE = 2e-6
# Half of a difference quotient's base [m]: its cubic error and its rounding are both under 1e-8.
QUOTIENT_STEP = 1e-5
# One float64 formula against another.
ROUNDING = 1e-14
# Two float32 evaluations of one place, reached by other sums.
PLACE_TOLERANCE = 5e-5


@wp.kernel
def frequencies(dispersion: Dispersion, wavevectors: wp.array[wp.vec2d], out: wp.array[wp.float64]):
    i = wp.tid()
    out[i] = angular_frequency(dispersion, wavevectors[i])


@wp.kernel
def both(surface: Surface, wide: Surface, at: wp.array[wp.vec2], ours: wp.array2d[vec6], sums: wp.array2d[wp.vec3]):
    i = wp.tid()
    p = at[i]
    sums[0, i] = periodic_at(surface, p[0], p[1])
    sums[1, i] = grid_at(wide, p[0], p[1])
    ours[0, i] = periodic_curved_at(surface, p[0], p[1])
    ours[1, i] = grid_curved_at(wide, p[0], p[1])


@pytest.mark.parametrize("inverse", [False, True])
@pytest.mark.parametrize("length", [2, 64, 1024])
def test_rows_are_transformed_as_numpy_does(device, length, inverse):
    values = np.random.default_rng(length).normal(size=(3, length, 2))
    rows = wp.array(values, dtype=wp.vec2d, device=device)
    block = fft_block(length, device)
    kernel = make_fft_rows(length, inverse)
    wp.launch(kernel, dim=(3, block), inputs=[0], outputs=[rows], block_dim=block, device=device)
    complex_values = values[..., 0] + 1j * values[..., 1]
    expected = np.fft.ifft(complex_values) * length if inverse else np.fft.fft(complex_values)
    found = rows.numpy()[..., 0] + 1j * rows.numpy()[..., 1]
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=FFT_TOLERANCE * np.abs(expected).max())


def test_a_block_shares_a_row_evenly():
    for length in 2 ** np.arange(1, int(np.log2(LONGEST)) + 1):
        assert length % fft_block(int(length), "cuda:0") == 0


@pytest.mark.parametrize("depth", [1e-4, 0.3, 1e4])
@pytest.mark.parametrize("tension", [0.0, 7.28e-5])
def test_the_dispersion_relation(device, depth, tension):
    k = np.random.default_rng(1).normal(size=(40, 2)) * np.logspace(-3, 5, 40)[:, None]
    k[0] = 0.0
    out = wp.zeros(len(k), dtype=wp.float64, device=device)
    dispersion = Dispersion()
    dispersion.gravity, dispersion.tension, dispersion.depth = 9.81, tension, depth
    wp.launch(frequencies, len(k), inputs=[dispersion, wp.array(k, dtype=wp.vec2d, device=device), out], device=device)
    q = np.hypot(*k.T)
    expected = np.sqrt((9.81 * q + tension * q**3) * np.tanh(q * depth))
    np.testing.assert_allclose(out.numpy(), expected, rtol=ROUNDING)
    assert out.numpy()[0] == 0.0


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize("shape", [(4, 5), (9, 16)])
def test_nodes_are_those_of_the_host(device, periodic, shape):
    """Of heights that go on past the border, repeated or mirrored, so that no difference is one-sided."""
    z = np.random.default_rng(5).normal(size=shape)
    ring = 0 if periodic else 1  # of nodes beyond the walls
    beyond = 4 - ring
    shape = (shape[0] + 2 * ring, shape[1] + 2 * ring)
    nodes = wp.zeros(shape, dtype=wp.vec4, device=device)
    surface = wp.array(z, dtype=wp.float64, device=device)
    wp.launch(make_nodes(periodic), dim=shape, inputs=[0, surface], outputs=[nodes], device=device)
    expected = hermite_nodes(np.pad(z, 4, mode="wrap" if periodic else "symmetric"))[beyond:-beyond, beyond:-beyond]
    np.testing.assert_allclose(nodes.numpy(), expected, rtol=0.0, atol=NODE_TOLERANCE * np.abs(expected).max())


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize("seed", range(12))  # the steepest place is a node, or between two, or amid four
def test_extremes_are_those_of_the_surface(device, periodic, seed):
    """At the nodes and half-way between, by difference quotients of the host's surface."""
    z = np.random.default_rng(seed).normal(size=(5, 6))
    cell, border = np.array([0.5, 0.25]), 4
    padded = np.pad(z, border, mode="wrap" if periodic else "symmetric")
    size = cell * padded.shape[::-1]
    grid = HeightGrid(padded, (-border * cell[0], -border * cell[1]), (size[0], size[1]))
    rows, columns = (np.arange(2 * n if periodic else 2 * n - 1) / 2.0 + 0.5 for n in z.shape)
    x, y = np.meshgrid(columns * cell[0], rows * cell[1])
    h = QUOTIENT_STEP
    along = (sample_heights(grid, x + h, y) - sample_heights(grid, x - h, y)) / (2.0 * h)
    across = (sample_heights(grid, x, y + h) - sample_heights(grid, x, y - h)) / (2.0 * h)
    nodes = points(hermite_nodes(padded)[border:-border, border:-border], device)
    extremes = wp.zeros(2, dtype=float, device=device)
    per_metre = wp.vec2(1.0 / cell[0], 1.0 / cell[1])
    wp.launch(make_extremes(periodic), dim=z.shape, inputs=[0, nodes, per_metre], outputs=[extremes], device=device)
    expected = [np.hypot(along, across).max(), np.abs(sample_heights(grid, x, y)).max()]
    np.testing.assert_allclose(extremes.numpy(), expected, rtol=VALUE_TOLERANCE)


def test_a_surface_that_repeats_is_itself_everywhere(device):
    """Against the nodes laid out three times each way, whose border is far."""
    z = np.random.default_rng(6).normal(size=(6, 9))
    spacing, origin = (0.25, 0.5), (-0.75, 0.5)
    nodes = hermite_nodes(np.tile(z, (5, 5)))
    narrow, wide = (grid_surface(np.zeros((5, 5)), origin, spacing, device) for _ in range(2))
    for surface, part in ((narrow, nodes[12:18, 18:27]), (wide, nodes[6:24, 9:36])):
        grid: Grid = surface.grid
        grid.nodes = points(part, device)
        surface.grid = grid
    wide.grid.origin = wp.vec2(origin[0] - 9 * spacing[0], origin[1] - 6 * spacing[1])
    side = np.array([9 * spacing[0], 6 * spacing[1]])
    at = np.random.default_rng(7).uniform(np.array(origin) - 0.9 * side, np.array(origin) + 1.8 * side, (400, 2))
    at[0] = origin
    sums = wp.zeros((2, len(at)), dtype=wp.vec3, device=device)
    curved = wp.zeros((2, len(at)), dtype=vec6, device=device)
    wp.launch(both, len(at), inputs=[narrow, wide, points(at, device), curved, sums], device=device)
    for found, expected in (sums.numpy(), curved.numpy()):
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=PLACE_TOLERANCE * np.abs(expected).max())
    bad = wp.zeros((2, 2), dtype=wp.vec3, device=device)
    worse = wp.zeros((2, 2), dtype=vec6, device=device)
    lost = points([[np.nan, 0.0], [np.inf, 1e30]], device)
    wp.launch(both, 2, inputs=[narrow, wide, lost, worse, bad], device=device)  # reads no node beyond the last
