"""The second road to the reference: photons at jittered places of the water, counted where they land."""

import functools

import warp as wp

from ..spec import Spec
from .cells import Mesh2D, water_of
from .deposit import make_deposit_point
from .ledger import make_book
from .ray import LANDS, LANDS_ON_MESH, World, make_trace


@wp.struct
class Disk:
    """The sun's disk: its middle, two directions across it, and 1 - cos of its half angle."""

    middle: wp.vec3d
    right: wp.vec3d
    up: wp.vec3d
    height: wp.float64


@wp.func
def direction_of(disk: Disk, a: wp.float64, b: wp.float64) -> wp.vec3d:
    """A direction of the disk, even by solid angle for even a and b in [0, 1)."""
    drop = a * disk.height
    across = wp.sqrt(drop * (wp.float64(2.0) - drop))
    turn = wp.float64(2.0 * wp.PI) * b
    side = across * (wp.cos(turn) * disk.right + wp.sin(turn) * disk.up)
    return (wp.float64(1.0) - drop) * disk.middle + side


@functools.cache
def make_photons(spec: Spec, disk: bool) -> wp.Kernel:
    """Trace a photon from a random place of each cell, and from a random direction where the sun is a disk."""
    trace = make_trace(spec)
    deposit_point = make_deposit_point(spec.channels)
    book = make_book(spec.channels, not spec.self_shadow)

    @wp.kernel(module="unique", enable_backward=False)
    def reference_photons(
        # In:
        world: World,
        sun: Disk,
        mesh: Mesh2D,
        first_row: int,
        seed: int,
        # Out:
        map_out: wp.array[wp.float64],
        ledger_out: wp.array2d[wp.float64],
    ):
        """One thread a photon; launch dims (rows, columns) of cells."""
        row, column = wp.tid()
        # A seed of each row, and the column within it: no two photons of a map share their numbers.
        random = wp.rand_init(seed + first_row + row, column)
        low = water_of(mesh, world, wp.float64(mesh.first[0] + column), wp.float64(first_row + row))
        high = water_of(mesh, world, wp.float64(mesh.first[0] + column + 1), wp.float64(first_row + row + 1))
        area = (high[0] - low[0]) * (high[1] - low[1])
        if not area > wp.float64(0.0):
            return
        x = low[0] + wp.float64(wp.randf(random)) * (high[0] - low[0])
        y = low[1] + wp.float64(wp.randf(random)) * (high[1] - low[1])
        direction = sun.middle
        if wp.static(disk):
            direction = direction_of(sun, wp.float64(wp.randf(random)), wp.float64(wp.randf(random)))
        ray = trace(world, direction, x, y)
        inside = wp.float64(0.0)
        if ray.fate == LANDS or ray.fate == LANDS_ON_MESH:
            inside = deposit_point(map_out, mesh.size, ray.landing, area * ray.arrived)
        book(ledger_out, row * 31 + column, ray, area, inside)

    return reference_photons
