"""``gather``: Yuksel & Keyser's gather over windows of the surface. Plan view, a flat receiver or a terrain.

On a plane it is their two passes. On a terrain each pixel has an illumination centre of its own, and one pass adds up
its window; the intersections are the same.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from ..kernels.gather import make_columns, make_intersections, make_rows
from ..kernels.gather_terrain import make_gather_terrain
from ..program import Buffer, Pass, Program, WavePass, wave_pass
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
    """The two passes as published: the light of a row is first gathered for the columns that it crosses."""
    channels, (columns, rows) = facts.spec.channels, facts.scene.map.resolution
    needed = _counted(np.maximum(-facts.deviation[0], facts.deviation[1]) + BOX_REACH)
    n, m = _window(facts, needed)
    left, below = max(n // 2, needed[0]), max(m // 2, needed[1])
    lattice = Lattice((-left, -below), (columns + 2 * left, rows + 2 * below), 1.0)
    samples = _samples(facts, lattice)
    return Program(
        lattice=lattice,
        strip_rows=lattice.count[1],
        passes=(
            *samples.passes,
            Pass("rows", f"gather pass 1: {n} samples in a row, for {m + 1} pixels of a column",
                 lambda: make_rows(channels), lambda _: (rows + m, columns)),
            Pass("columns", f"gather pass 2: {m + 1} channels of a column", lambda: make_columns(channels),
                 lambda _: (rows, columns)),
        ),
        buffers=(
            *samples.buffers,
            Buffer("channel", f"vec{channels}", (m + 1, rows + m, columns), 4 * channels),
        ),
        values={**samples.values, "first": (left - n // 2, below - m // 2), "n": n, "m": m},
        settings={"n": n, "m": m},
        banded=False,
    )  # fmt: skip


def _on_terrain(facts: Facts) -> Program:
    """One pass: each pixel gathers around the illumination centre of its own ground."""
    spec, (columns, rows) = facts.spec, facts.scene.map.resolution
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
        values={**samples.values, "way_low": tuple(low), "way_high": tuple(high), "spread": spread, "n": n, "m": m},
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
