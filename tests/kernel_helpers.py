"""What the tests of the kernels share: surfaces, receivers and points on a device, made from NumPy."""

from __future__ import annotations

import numpy as np
import warp as wp

from warp_caustics.height_map import hermite_nodes
from warp_caustics.kernels.grid import Grid
from warp_caustics.kernels.lattice import Lattice
from warp_caustics.kernels.project import Receiver
from warp_caustics.kernels.surface import Surface
from warp_caustics.kernels.waves import Wave
from warp_caustics.state import split

ENDLESS = 1e30  # where water without a border ends


def rounded(values):
    """Round to float32 and back: what the kernels are given, in the float64 that the reference computes with."""
    return np.asarray(values, dtype=np.float32).astype(np.float64)


def points(values, device):
    """Vectors [n, 2] or [n, 3] as a Warp array of vec2 or vec3."""
    values = np.ascontiguousarray(values, dtype=np.float32)
    return wp.array(values, dtype={2: wp.vec2, 3: wp.vec3, 4: wp.vec4}[values.shape[-1]], device=device)


def wave_array(waves, device):
    """Sines (amplitude, (kx, ky), phase) as the kernels hold them."""
    table = np.zeros(len(waves), dtype=Wave.numpy_dtype())
    for i, (amplitude, wavevector, phase) in enumerate(waves):
        (k, k_rest), (turn, turn_rest) = split(wavevector), split(phase)
        table[i] = (amplitude, k, turn, k_rest, turn_rest)
    return wp.array(table, dtype=Wave, device=device)


def wave_surface(waves, device, base=0.0, slope=(0.0, 0.0)):
    """A tilted plane with sines."""
    surface = Surface()
    surface.base = base
    surface.slope = wp.vec2(*slope)
    surface.waves = wave_array(waves, device)
    return surface


def grid_surface(z, origin, spacing, device):
    """A height map whose node (0, 0) stands at ``origin``."""
    grid, surface = Grid(), Surface()
    grid.nodes = points(hermite_nodes(np.asarray(z, dtype=np.float64)), device)
    grid.origin = wp.vec2(*origin)
    grid.per_metre = wp.vec2(*(1.0 / np.asarray(spacing)))
    surface.grid = grid
    return surface


def terrain_receiver(terrain, lowest, highest, slope, step):
    """A height field to land on, with the bounds that its march needs."""
    receiver = Receiver()
    receiver.terrain = terrain
    receiver.lowest, receiver.highest = lowest, highest
    receiver.slope, receiver.step = slope, step
    receiver.reach = ENDLESS
    return receiver


def mesh(vertices, triangles, device):
    """A mesh with its BVH; the caller keeps it alive."""
    return wp.Mesh(
        points=points(vertices, device),
        indices=wp.array(np.ascontiguousarray(triangles, dtype=np.int32).ravel(), dtype=wp.int32, device=device),
    )


def lattice(first, count, step=1.0, pixel=(1.0, 1.0), resolution=(8, 8)):
    """Cells of endless water over a map."""
    made = Lattice()
    made.step = step
    made.first, made.count = wp.vec2i(*first), wp.vec2i(*count)
    made.pixel, made.map = wp.vec2(*pixel), wp.vec2i(*resolution)
    made.cell_rest = wp.vec2(*(step * np.asarray(pixel, dtype=np.float64) - split(step)[0] * split(pixel)[0]))
    made.low, made.high = wp.vec2(-ENDLESS, -ENDLESS), wp.vec2(ENDLESS, ENDLESS)
    return made
