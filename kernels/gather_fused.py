"""The gather in one pass over the intersections: a pixel adds up its whole window, and nothing is kept in between.

Yuksel & Keyser's two passes save look-ups, not arithmetic: a pixel's N x (M + 1) products are the same, and the
channels between the passes are written and read again. Here they are not; each pixel reads its window instead, from
memory (:func:`make_fused`), or from what its block of threads has brought into shared memory (:func:`make_tile`).
"""

import functools

import warp as wp

from .deposit import FLUX
from .gather import box_overlap
from .lattice import Lattice

TILE = 16
"""Pixels along each side of a tile: a block of 256 threads, Warp's own, has one each."""

SHARED_BYTES = 96 * 1024
"""Shared memory that a block may ask for on the smallest of the devices that the library is made for."""


def shared_bytes(channels: int, n: int, m: int) -> int:
    """Shared memory of a tile [bytes]: landings and fluxes of its pixels and of those that their windows reach."""
    return (TILE + m) * (TILE + n - 1) * 4 * (2 + channels)


def tile_threads(device: str) -> int:
    """Threads of a block: the launch's last dimension. On a CPU Warp runs a block as one thread."""
    return 1 if device == "cpu" else TILE * TILE


@functools.cache
def make_fused(channels: int) -> wp.Kernel:
    """Build the kernel that reads its window from memory."""
    flux_type = FLUX[channels]

    @wp.kernel(module="unique", enable_backward=False)
    def fused(
        # In:
        begin: int,
        lattice: Lattice,
        landing: wp.array2d[wp.vec2],
        flux: wp.array2d[flux_type],
        first: wp.vec2i,
        n: int,
        m: int,
        # Out:
        map_out: wp.array[float],
    ):
        """One thread a pixel of the map, from row ``begin``; launch dims (rows, columns).

        ``first`` is the sample (column, row) at which the window of the map's first pixel begins.
        """
        row, column = wp.tid()
        row += begin
        half_n = n // 2
        half_m = m // 2
        total = flux_type()
        for j in range(m + 1):
            for i in range(n):
                sample = landing[row + first[1] + j, column + first[0] + i]
                ax = box_overlap(sample[0] + float(i - half_n))
                if ax > 0.0:
                    ay = box_overlap(sample[1] + float(j - half_m))
                    if ay > 0.0:
                        total += ax * ay * flux[row + first[1] + j, column + first[0] + i]
        at = (row * lattice.map[0] + column) * wp.static(channels)
        for c in range(wp.static(channels)):
            map_out[at + c] = map_out[at + c] + total[c]

    return fused


@functools.cache
def make_tile(channels: int, n: int, m: int) -> wp.Kernel:
    """Build the kernel whose blocks bring the intersections of a tile into shared memory, once."""
    flux_type = FLUX[channels]
    tall, wide = TILE + m, TILE + n - 1
    half_n, half_m = n // 2, m // 2

    @wp.kernel(module="unique", enable_backward=False)
    def gather_tile(
        # In:
        begin: int,
        lattice: Lattice,
        landing: wp.array2d[wp.vec2],
        flux: wp.array2d[flux_type],
        first: wp.vec2i,
        # Out:
        map_out: wp.array[float],
    ):
        """One block a tile, from row ``begin`` of tiles; launch dims (rows, columns) of tiles, :func:`tile_threads`."""
        tile_row, tile_column, thread = wp.tid()
        bottom = (begin + tile_row) * wp.static(TILE)
        left = tile_column * wp.static(TILE)
        corner = (bottom + first[1], left + first[0])
        samples = wp.tile_load(landing, shape=(tall, wide), offset=corner, storage="shared")
        light = wp.tile_load(flux, shape=(tall, wide), offset=corner, storage="shared")
        for pixel in range(thread, wp.static(TILE * TILE), wp.block_dim()):
            y = pixel // wp.static(TILE)
            x = pixel - y * wp.static(TILE)
            total = flux_type()
            for j in range(y, y + wp.static(m + 1)):
                for i in range(x, x + wp.static(n)):
                    sample = wp.tile_extract(samples, j, i)
                    ax = box_overlap(sample[0] + float(i - x - wp.static(half_n)))
                    if ax > 0.0:
                        ay = box_overlap(sample[1] + float(j - y - wp.static(half_m)))
                        if ay > 0.0:
                            total += ax * ay * wp.tile_extract(light, j, i)
            if bottom + y < lattice.map[1] and left + x < lattice.map[0]:
                at = ((bottom + y) * lattice.map[0] + left + x) * wp.static(channels)
                for c in range(wp.static(channels)):
                    map_out[at + c] = map_out[at + c] + total[c]

    return gather_tile
