"""Splats that add up in a block's own memory, and the sorting of photons by the tile of the map that they land in.

Float additions to shared memory are a loop of compare and swap, integer ones are native: a block adds up in int32, in
steps of a power of two that as many photons as it takes between two visits to the map cannot overflow. So what it
adds does not depend on their order.
"""

import functools

import warp as wp

from warp_caustics.kernels.deposit import ACCUMULATOR, FIXED_SCALE, FLUX
from warp_caustics.kernels.splat import NARROWEST, make_deposit_box

from .landed import Command, Fill, Landed, record
from .vector import NOWHERE, pair

TILE = 32
"""Pixels of a tile's side: with one photon a pixel a block of threads has four photons each."""

THREADS = 256
"""Of a block."""

BATCH = 1024
"""Photons that a block adds up before it visits the map."""

STEPS = 2.0**20
"""Steps in the largest flux of a photon: a batch of those, all in one pixel, is half of what int32 holds."""

PATCH = 32
"""Photons of the side of a patch, of photons in the order of their lattice."""

SCAN = 1024
"""Counts that are summed at a time."""


@wp.func
def tile_of(x: float, y: float, width: float, size: wp.vec2i, tiles_across: int) -> int:
    """The tile in which a photon's first pixel lies, or the nearest to it; -1 for a photon beside the map."""
    across = pair(x, width, size[0])
    up = pair(y, width, size[1])
    if across[0] == NOWHERE or up[0] == NOWHERE:
        return -1
    return wp.max(int(up[0]), 0) / wp.static(TILE) * tiles_across + wp.max(int(across[0]), 0) / wp.static(TILE)


@wp.kernel(enable_backward=False)
def count_photons(
    # In:
    x: wp.array[float],
    y: wp.array[float],
    width: float,
    size: wp.vec2i,
    tiles_across: int,
    # Out:
    counts_out: wp.array[int],
):
    """One thread a photon."""
    i = wp.tid()
    tile = tile_of(x[i], y[i], width, size, tiles_across)
    if tile >= 0:
        wp.atomic_add(counts_out, tile, 1)


@wp.kernel(enable_backward=False)
def scan_counts(
    # In:
    counts: wp.array[int],
    # Out:
    starts_out: wp.array[int],
    places_out: wp.array[int],
):
    """One block in all: the place of each tile's first photon, twice, since one copy moves as photons are placed."""
    total = int(0)
    for chunk in range(counts.shape[0] / wp.static(SCAN)):
        part = wp.tile_load(counts, shape=wp.static(SCAN), offset=chunk * wp.static(SCAN))
        before = wp.tile_scan_exclusive(part) + wp.tile_full(shape=wp.static(SCAN), value=total, dtype=int)
        wp.tile_store(starts_out, before, offset=chunk * wp.static(SCAN))
        wp.tile_store(places_out, before, offset=chunk * wp.static(SCAN))
        total += wp.tile_extract(wp.tile_sum(part), 0)


@wp.kernel(enable_backward=False)
def place_photons(
    # In:
    x: wp.array[float],
    y: wp.array[float],
    width: float,
    size: wp.vec2i,
    tiles_across: int,
    # Out:
    places_out: wp.array[int],
    order_out: wp.array[int],
):
    """One thread a photon; ``order_out`` names the photons tile by tile, in any order within one."""
    i = wp.tid()
    tile = tile_of(x[i], y[i], width, size, tiles_across)
    if tile >= 0:
        order_out[wp.atomic_add(places_out, tile, 1)] = i


@functools.cache
def make_splat_ordered(accumulate: str, channels: int) -> wp.Kernel:
    """Splat landed photons in the order of their tiles, by the library's own deposit."""
    deposit = make_deposit_box(accumulate, channels)
    dtype, flux_type = ACCUMULATOR[accumulate], FLUX[channels]

    @wp.kernel(module="unique", enable_backward=False)
    def splat_ordered(
        # In:
        x: wp.array[float],
        y: wp.array[float],
        flux: wp.array[flux_type],
        order: wp.array[int],
        starts: wp.array[int],
        tiles: int,
        width: float,
        size: wp.vec2i,
        # Out:
        map_out: wp.array[dtype],
    ):
        """One thread a photon; those past the last start are beside the map."""
        place = wp.tid()
        if place < starts[tiles]:
            i = order[place]
            deposit(map_out, size, wp.vec2i(0, 0), wp.vec2(x[i], y[i]), wp.vec2(width, width), flux[i])

    return splat_ordered


@wp.func
def window_around(x: float, y: float, side: int, size: wp.vec2i) -> wp.vec2i:
    """Lower corner of a window of ``side`` pixels around a landing, on the map."""
    # Clamped as floats: a landing far away has no integer pixel.
    u = wp.clamp(x, 0.0, float(size[0])) - 0.5 * float(side)
    v = wp.clamp(y, 0.0, float(size[1])) - 0.5 * float(side)
    return wp.vec2i(wp.max(int(u), 0), wp.max(int(v), 0))


@wp.func
def tap_weight(share: wp.vec2, tap: int) -> float:
    """Weight of one of four taps, lower left first, by the shares of the second column and row."""
    across = wp.where((tap & 1) == 1, share[0], 1.0 - share[0])
    return across * wp.where((tap >> 1) == 1, share[1], 1.0 - share[1])


@functools.cache
def make_splat_private(accumulate: str, channels: int, side: int, ordered: bool) -> wp.Kernel:
    """Splat photons into a window of ``side`` pixels in shared memory, then the window into the map.

    ``ordered``: a block has a tile's photons, all of whose pixels are in its window. Else it has a patch of the
    lattice, and what falls beside its window goes into the map at once.
    """
    dtype, flux_type = ACCUMULATOR[accumulate], FLUX[channels]
    # The map's units in a step: of fixed point a whole number, since both are powers of two.
    per_step = FIXED_SCALE / STEPS if accumulate == "fixed" else 1.0 / STEPS

    @wp.func
    def photon_of(order: wp.array[int], start: int, k: int, across: int) -> int:
        """The photon that is number ``k`` of its block's."""
        if wp.static(ordered):
            return order[start + k]
        else:
            return start + k / wp.static(PATCH) * across + k % wp.static(PATCH)

    @wp.kernel(module="unique", enable_backward=False)
    def splat_private(
        # In:
        x: wp.array[float],
        y: wp.array[float],
        flux: wp.array[flux_type],
        order: wp.array[int],
        starts: wp.array[int],
        across: int,
        most: float,
        width: float,
        size: wp.vec2i,
        # Out:
        map_out: wp.array2d[dtype],
    ):
        """A block a tile, or a patch; ``across`` is their count in a row of tiles, or the photons in one of patches.

        ``most`` is a power of two that no photon's flux passes; ``map_out`` is ``[rows, columns * channels]``.
        """
        block, lane = wp.tid()
        start = int(0)
        count = int(wp.static(PATCH * PATCH))
        corner = wp.vec2i(0, 0)
        if wp.static(ordered):
            start = starts[block]
            count = starts[block + 1] - start
            corner = wp.vec2i(block % across, block / across) * wp.static(TILE)
        else:
            patches = across / wp.static(PATCH)
            start = (block / patches * across + block % patches) * wp.static(PATCH)
            middle = photon_of(order, start, wp.static(PATCH * (PATCH + 1) // 2), across)
            corner = window_around(x[middle], y[middle], wp.static(side), size)
        scale = wp.static(STEPS) / most
        # The lanes of a block add together: each goes round as often, with or without a photon.
        for batch in range((count + wp.static(BATCH - 1)) / wp.static(BATCH)):
            done = batch * wp.static(BATCH)
            window = wp.tile_zeros(shape=(wp.static(side), wp.static(side * channels)), dtype=int, storage="shared")
            lot = wp.min(count - done, wp.static(BATCH))
            for round in range((lot + wp.block_dim() - 1) / wp.block_dim()):
                k = round * wp.block_dim() + lane
                first = wp.vec2(NOWHERE, NOWHERE)
                share = wp.vec2(0.0, 0.0)
                amount = flux_type()
                if k < lot:
                    i = photon_of(order, start, done + k, across)
                    wide = pair(x[i], width, size[0])
                    tall = pair(y[i], width, size[1])
                    if wide[0] != NOWHERE and tall[0] != NOWHERE:
                        first = wp.vec2(wide[0], tall[0])
                        share = wp.vec2(wide[1], tall[1])
                        amount = flux[i]
                for tap in range(4):
                    column = int(first[0]) + (tap & 1)
                    row = int(first[1]) + (tap >> 1)
                    on_map = first[0] != NOWHERE and column >= 0 and column < size[0] and row >= 0 and row < size[1]
                    weight = tap_weight(share, tap)
                    at = wp.vec2i(column, row) - corner
                    inside = at[0] >= 0 and at[0] < wp.static(side) and at[1] >= 0 and at[1] < wp.static(side)
                    for c in range(wp.static(channels)):
                        steps = int(wp.rint(amount[c] * weight * scale))
                        there = on_map and inside and steps != 0
                        place = wp.where(there, at, wp.vec2i(0, 0))
                        wp.tile_scatter_add(window, place[1], place[0] * wp.static(channels) + c, steps, there)
                        if wp.static(not ordered):
                            if on_map and not inside:
                                value = dtype(steps) * dtype(wp.static(per_step) * most)
                                wp.atomic_add(map_out, row, column * wp.static(channels) + c, value)
            light = wp.tile_astype(window, dtype) * dtype(wp.static(per_step) * most)
            wp.tile_atomic_add(map_out, light, offset=(corner[1], corner[0] * wp.static(channels)))

    return splat_private


def record_blocks(kernel: wp.Kernel, blocks: int, inputs: list, outputs: list, device: str) -> Command:
    """Record a launch of blocks of threads; a block of a CPU is one thread."""
    threads = 1 if device == "cpu" else THREADS
    return record(kernel, (blocks, threads), inputs, outputs, device, block_dim=threads)


def order_by_tile(photons: Landed) -> tuple[list[Command], wp.array, wp.array, tuple[int, int]]:
    """Count, scan, place: the launches, the order of the photons, each tile's first, and tiles across and up."""
    device, (columns, rows) = photons.device, photons.resolution
    tiles = (-(-columns // TILE), -(-rows // TILE))
    length = -(-(tiles[0] * tiles[1] + 1) // SCAN) * SCAN  # one more: where the last tile's photons end
    counts, starts, places = (wp.zeros(length, dtype=int, device=device) for _ in range(3))
    order = wp.zeros(photons.count, dtype=int, device=device)
    inputs = [photons.x, photons.y, photons.width, wp.vec2i(columns, rows), tiles[0]]
    commands: list[Command] = [
        Fill(counts),
        record(count_photons, photons.count, inputs, [counts], device),
        record_blocks(scan_counts, 1, [counts], [starts, places], device),
        record(place_photons, photons.count, inputs, [places, order], device),
    ]
    return commands, order, starts, tiles


def binned(photons: Landed, image: wp.array) -> list[Command]:
    """On a GPU whose photons come in no order, as from rays with random starts, at several photons a pixel."""
    if photons.width > 1.0:
        raise ValueError(f"binned: a box of {photons.width} pixels has more than four taps")
    commands, order, starts, tiles = order_by_tile(photons)
    kernel = make_splat_ordered(photons.accumulate, photons.channels)
    inputs = [photons.x, photons.y, photons.flux, order, starts, tiles[0] * tiles[1], photons.width]
    inputs.append(wp.vec2i(*photons.resolution))
    return [*commands, record(kernel, photons.count, inputs, [image], photons.device)]


def private_tiles(photons: Landed, image: wp.array) -> list[Command]:
    """On a GPU where many photons meet in few pixels, so that their atomics would wait for one another."""
    if photons.width > 1.0:
        raise ValueError(f"private_tiles: a box of {photons.width} pixels has more than four taps")
    commands, order, starts, tiles = order_by_tile(photons)
    side = TILE + int(photons.width > NARROWEST)
    kernel = make_splat_private(photons.accumulate, photons.channels, side, True)
    blocks = tiles[0] * tiles[1]
    return [*commands, _private(kernel, photons, image, order, starts, tiles[0], blocks)]


def make_private_patches(across: int, side: int) -> "functools.partial[list[Command]]":
    """Make the form for photons in the order of a lattice of so many across, with windows of so many pixels."""
    return functools.partial(private_patches, across=across, side=side)


def private_patches(photons: Landed, image: wp.array, across: int, side: int) -> list[Command]:
    """On a GPU at four photons a pixel and more, in the order of their lattice: neighbours land near each other.

    Raises
    ------
    ValueError
        If the lattice is not of whole patches, or a box is wider than a pixel.
    """
    if photons.width > 1.0:
        raise ValueError(f"private_patches: a box of {photons.width} pixels has more than four taps")
    if across % PATCH or photons.count % (across * PATCH):
        raise ValueError(f"private_patches: a lattice of whole patches of {PATCH} by {PATCH} photons")
    none = wp.zeros(0, dtype=int, device=photons.device)
    kernel = make_splat_private(photons.accumulate, photons.channels, side, False)
    return [_private(kernel, photons, image, none, none, across, photons.count // PATCH**2)]


def _private(
    kernel: wp.Kernel, photons: Landed, image: wp.array, order: wp.array, starts: wp.array, across: int, blocks: int
) -> Command:
    columns, rows = photons.resolution
    inputs = [photons.x, photons.y, photons.flux, order, starts, across, photons.most, photons.width]
    inputs.append(wp.vec2i(columns, rows))
    flat = image.reshape((rows, columns * photons.channels))
    return record_blocks(kernel, blocks, inputs, [flat], photons.device)
