"""``gather``: Yuksel & Keyser's gather over windows of the surface. Plan view, a flat receiver or a terrain.

On a plane it is their two passes, or one of the other forms of the same sum. On a terrain each pixel has an
illumination centre of its own, and one pass adds up its window; the intersections are the same.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from ..kernels.gather import make_columns, make_intersections, make_rows
from ..kernels.gather_fused import SHARED_BYTES, TILE, make_fused, make_tile, shared_bytes, tile_threads
from ..kernels.gather_rows import make_scatter_rows, serves
from ..kernels.gather_scatter import make_gather_scatter
from ..kernels.gather_terrain import make_gather_terrain
from ..program import Buffer, Pass, Program, WavePass, strip_rows, wave_pass, wave_plane_pass
from ..receiver import receiver_bounds
from ..specify import HEIGHT_FIELDS
from ..window import INDEX_BOUND, TOO_FAR, Lattice, deviation_bounds, lattice_over

if TYPE_CHECKING:
    from ..facts import Facts

LEAST_M = 2
"""A box overlaps two rows of pixels, so one neighbour each way is the least."""

BOX_REACH = 1.0
"""A sample's box reaches into the next pixel."""

CUT_REACH = 0.5
"""A cell that the water's border cuts is followed from the middle of what is left, and lands as if from its own."""

CENTRE_ROUNDED = 0.5
"""The sample nearest to an illumination centre is off it by up to half a pixel; on a plane it is the centre."""

STRIP_ROWS, LEAST_ROWS = 160, 32
"""Rows of a strip at most, but for frames of very many; and at least: each strip makes tables of its own."""

EVEN = 8
"""Strips come in multiples of this, so that 2, 4 or 8 threads have as many each."""

MOST_LOOKS = 2**44
"""Samples that all pixels of a terrain look at: at a nanosecond each, a core goes through them in five hours."""


def gather(facts: Facts) -> Program:
    """Plan the pre-pass of intersections and the passes that gather them.

    Raises
    ------
    InputError
        If the receiver is neither a plane nor a terrain or carries objects, if the map is to be added up in anything
        but float32, or if light spreads too far to be gathered.
    """
    scene, spec = facts.scene, facts.spec
    if spec.receiver == "mesh" or spec.objects:
        raise InputError(
            'method "gather" computes its intersections with a plane or a terrain, and this scene has '
            f'receiver.{"objects" if spec.objects else "mesh"}; methods that can: "beam", "photon"'
        )
    if scene.method.accumulate != "float32":
        raise InputError(
            f'method.accumulate = "{scene.method.accumulate}": gather adds up in registers, in a fixed order and in '
            'float32; leave it out, or use method "beam" or "photon"'
        )
    return _on_terrain(facts) if spec.receiver in HEIGHT_FIELDS else _on_plane(facts)


def _on_plane(facts: Facts) -> Program:
    """One of the forms of the same sum over windows that are the same for all pixels."""
    needed = _counted(np.maximum(-facts.deviation[0], facts.deviation[1]) + BOX_REACH)
    n, m = _window(facts, needed)
    left, below = max(n // 2, needed[0]), max(m // 2, needed[1])
    columns, rows = facts.scene.map.resolution
    lattice = Lattice((-left, -below), (columns + 2 * left, rows + 2 * below), 1.0)
    form = facts.scene.method.gather.form
    if form == "auto":
        # Four additions a sample, however wide the windows are, and on a CPU spread over all threads.
        form = "scatter_rows" if facts.device == "cpu" and serves(facts.spec) else "scatter"
    if form in ("scatter", "scatter_rows"):
        program = _scatter(facts, form, lattice)
    else:
        program = _of_intersections(facts, form, lattice, n, m)
    return replace(program, values={**program.values, "n": n, "m": m}, settings={"n": n, "m": m, "form": form})


def _of_intersections(facts: Facts, form: str, lattice: Lattice, n: int, m: int) -> Program:
    """The forms in which a pixel looks at intersections that a pass before has computed."""
    channels, (columns, rows) = facts.spec.channels, facts.scene.map.resolution
    samples = _samples(facts, lattice)
    passes: tuple[Pass, ...]
    channel = Buffer("channel", f"vec{channels}", (m + 1, rows + m, columns), 4 * channels)
    if form == "two_pass":
        passes = (
            Pass("rows", f"gather pass 1: {n} samples in a row, for {m + 1} pixels of a column",
                 lambda: make_rows(channels), lambda _: (rows + m, columns)),
            Pass("columns", f"gather pass 2: {m + 1} channels of a column", lambda: make_columns(channels),
                 lambda _: (rows, columns)),
        )  # fmt: skip
    elif form == "fused":
        does = f"gather: {n} x {m + 1} samples around each pixel"
        passes = (Pass("fused", does, lambda: make_fused(channels), lambda _: (rows, columns)),)
    else:
        passes = (_tile_pass(facts, n, m),)
    return Program(
        lattice=lattice,
        strip_rows=lattice.count[1],
        passes=(*samples.passes, *passes),
        buffers=(*samples.buffers, channel) if form == "two_pass" else samples.buffers,
        values={**samples.values, "begin": 0, "first": (-lattice.first[0] - n // 2, -lattice.first[1] - m // 2)},
        banded=False,
    )  # fmt: skip


def _tile_pass(facts: Facts, n: int, m: int) -> Pass:
    channels, (columns, rows) = facts.spec.channels, facts.scene.map.resolution
    taken = shared_bytes(channels, n, m)
    if taken > SHARED_BYTES:
        raise InputError(
            f'method.gather.form = "tile": windows of {n} x {m + 1} samples take {taken:,} bytes of shared memory, '
            f"more than the {SHARED_BYTES:,} that every device has; expected narrower windows (method.gather.n), or "
            'form "fused" or "scatter"'
        )
    tiles = -(-rows // TILE), -(-columns // TILE), tile_threads(facts.device)
    does = f"gather: {n} x {m + 1} samples around each pixel, from shared memory"
    return Pass("gather_tile", does, lambda: make_tile(channels, n, m), lambda _: tiles)


def _scatter(facts: Facts, form: str, lattice: Lattice) -> Program:
    """The other side of the sum: each sample is followed, and adds its box to the pixels whose windows hold it."""
    spec, columns = facts.spec, lattice.count[0]
    strips = EVEN * -(-lattice.count[1] // (EVEN * STRIP_ROWS))
    rows = strip_rows(max(LEAST_ROWS, -(-lattice.count[1] // strips)), lattice, len(facts.suns))
    does = "waves, refraction, landing of each sample, and its box on the pixels whose windows hold it"
    if form == "scatter":
        waves = wave_pass(spec, lattice, facts.waves, rows, 0, 0.5)
        step = Pass("gather_scatter", does, lambda: make_gather_scatter(spec), lambda strip: (strip, columns))
    elif serves(spec):
        waves = wave_plane_pass(lattice, facts.waves, rows)
        step = Pass("scatter_rows", does, lambda: make_scatter_rows(spec.fresnel), lambda strip: (strip,), columns)
    else:
        raise InputError(
            'method.gather.form = "scatter_rows": it is for a sum of waves over a plane where light is neither shaded '
            'nor absorbed on its way; expected "auto" or "scatter"'
        )
    return Program(
        lattice=lattice, strip_rows=rows, passes=(*waves.passes, step), buffers=waves.buffers, values=waves.values
    )


def _on_terrain(facts: Facts) -> Program:
    """One pass: each pixel gathers around the illumination centre of its own ground."""
    spec, (columns, rows) = facts.spec, facts.scene.map.resolution
    form = facts.scene.method.gather.form
    if form != "auto":
        raise InputError(
            f'method.gather.form = "{form}": on a terrain each pixel has a window of its own, and there is one form of '
            "their sum; leave it out"
        )
    spread = _spread(facts)
    needed = _counted(_deepest_deviation(facts, spread) + CENTRE_ROUNDED + BOX_REACH)
    n, m = _window(facts, needed)
    # A wider window than what light can reach costs nothing: the kernel looks no further.
    looked = min(n, 2 * needed[0] + 1), min(m + 1, 2 * needed[1] + 1)
    if columns * rows * looked[0] * looked[1] * len(facts.suns) > MOST_LOOKS:
        raise InputError(
            f"map: each of {columns} x {rows} pixels gathers from {looked[0]} x {looked[1]} samples of water, too many "
            f"to go through; {TOO_FAR}"
        )
    lattice = lattice_over(*facts.deviation, (columns, rows), 1.0)
    samples = _samples(facts, lattice)
    low = np.min([reach.low for reach in facts.reaches], axis=0)
    high = np.max([reach.high for reach in facts.reaches], axis=0)
    return Program(
        lattice=lattice,
        strip_rows=lattice.count[1],
        passes=(
            *samples.passes,
            Pass("gather_terrain", f"gather: up to {n} x {m + 1} samples around each pixel's own illumination centre",
                 lambda: make_gather_terrain(spec), lambda _: (rows, columns)),
        ),
        buffers=samples.buffers,
        values={**samples.values, "begin": 0, "way_low": tuple(low), "way_high": tuple(high), "spread": spread,
                "n": n, "m": m},
        settings={"n": n, "m": m},
        banded=False,
    )  # fmt: skip


def _samples(facts: Facts, lattice: Lattice) -> WavePass:
    """The pre-pass, with that of the waves: where each sample of the water lands, and how much light it has there."""
    spec, grid = facts.spec, (lattice.count[1], lattice.count[0])
    waves = wave_pass(spec, lattice, facts.waves, grid[0], 0, 0.5)
    intersections = Pass(
        "intersections", "waves, refraction, landing of each sample", lambda: make_intersections(spec), lambda _: grid
    )
    landing = Buffer("landing", "vec2", grid, 8)
    flux = Buffer("flux", f"vec{spec.channels}", grid, 4 * spec.channels)
    return replace(waves, passes=(*waves.passes, intersections), buffers=(*waves.buffers, landing, flux))


def _spread(facts: Facts) -> float:
    """Bound how much more or less than a pixel's own depth light comes down that lands on the pixel [m].

    It starts on a crest or in a trough, and lands where its box still touches the pixel.
    """
    touching = BOX_REACH + (CUT_REACH if facts.spec.bounded else 0.0)
    return facts.amplitude + facts.ground.slope * touching * float(np.hypot(*facts.pixel))


def _deepest_deviation(facts: Facts, spread: float) -> np.ndarray:
    """Pixels ``[2]`` between the illumination centre of the map's deepest ground and what can light it, at most.

    Where the ground is less deep they are fewer: all ways are in proportion to depth, but for the waves' own height.
    """
    scene, low = facts.scene, np.asarray(facts.scene.map.origin, dtype=np.float64)
    deepest = max(0.0, scene.water.level - receiver_bounds(scene, facts.assets, low, low + scene.map.size).lowest)
    depths = (max(0.0, deepest - spread), deepest + spread)
    ends = [deviation_bounds((r.low, r.high), r.rest, depths, deepest, facts.pixel) for r in facts.reaches]
    return np.max([np.maximum(-low, high) for low, high in ends], axis=0)


def _counted(widest: np.ndarray) -> tuple[int, int]:
    """Whole pixels that hold the widest deflections ``[2]``.

    Raises
    ------
    InputError
        If they cannot be counted.
    """
    widest = np.ceil(widest)
    if not widest.max() < INDEX_BOUND:
        raise InputError(f"map: light lands {widest.max():.3g} pixels from where it does at rest; {TOO_FAR}")
    return int(widest[0]), int(widest[1])


def _window(facts: Facts, widest: tuple[int, int]) -> tuple[int, int]:
    """N and M: those of the scene, or wide enough for the largest deflection."""
    settings = facts.scene.method.gather
    n = 2 * widest[0] + 1 if settings.n is None else settings.n
    m = 2 * widest[1] if settings.n is None else max(settings.n - 1, LEAST_M)
    return n, m if settings.m is None else settings.m
