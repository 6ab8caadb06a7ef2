"""``gather``: Yuksel & Keyser's two passes over a window of the surface. Plan view, a flat receiver."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from ..kernels.gather import make_columns, make_intersections, make_rows
from ..program import Buffer, Pass, Program, wave_pass
from ..window import INDEX_BOUND, TOO_FAR, Lattice

if TYPE_CHECKING:
    from ..facts import Facts

LEAST_M = 2
"""A box overlaps two rows of pixels, so one neighbour each way is the least."""

BOX_REACH = 1.0
"""A sample's box reaches into the next pixel."""


def gather(facts: Facts) -> Program:
    """Plan the pre-pass of intersections and the two passes.

    Raises
    ------
    InputError
        If the receiver is not a plane, or the map is to be added up in anything but float32.
    """
    scene, spec = facts.scene, facts.spec
    if spec.receiver != "plane" or spec.objects:
        on = "objects" if spec.objects else "mesh" if spec.receiver == "mesh" else "terrain"
        raise InputError(
            f'method "gather" computes its intersections with a flat receiver, and this scene has receiver.{on}; '
            'methods that can: "beam", "photon"'
        )
    if scene.method.accumulate != "float32":
        raise InputError(
            f'method.accumulate = "{scene.method.accumulate}": gather adds up in registers, in a fixed order and in '
            'float32; leave it out, or use method "beam" or "photon"'
        )
    columns, rows = scene.map.resolution
    needed = _widest(facts)
    n, m = _window(facts, needed)
    left, below = max(n // 2, needed[0]), max(m // 2, needed[1])
    lattice = Lattice((-left, -below), (columns + 2 * left, rows + 2 * below), 1.0)
    grid = (lattice.count[1], lattice.count[0])
    flux = f"vec{spec.channels}"
    waves = wave_pass(spec, lattice, facts.waves, grid[0], 0, 0.5)
    return Program(
        lattice=lattice,
        strip_rows=lattice.count[1],
        passes=(
            *waves.passes,
            Pass("intersections", "waves, refraction, landing of each sample", lambda: make_intersections(spec),
                 lambda _: grid),
            Pass("rows", f"gather pass 1: {n} samples in a row, for {m + 1} pixels of a column",
                 lambda: make_rows(spec.channels), lambda _: (rows + m, columns)),
            Pass("columns", f"gather pass 2: {m + 1} channels of a column", lambda: make_columns(spec.channels),
                 lambda _: (rows, columns)),
        ),
        buffers=(
            *waves.buffers,
            Buffer("landing", "vec2", grid, 8),
            Buffer("flux", flux, grid, 4 * spec.channels),
            Buffer("channel", flux, (m + 1, rows + m, columns), 4 * spec.channels),
        ),
        values={**waves.values, "first": (left - n // 2, below - m // 2), "n": n, "m": m},
        settings={"n": n, "m": m},
        banded=False,
    )  # fmt: skip


def _widest(facts: Facts) -> tuple[int, int]:
    """Pixels that light is deflected from its illumination centre at most, with the reach of a box.

    Raises
    ------
    InputError
        If they cannot be counted.
    """
    widest = np.ceil(np.maximum(-facts.deviation[0], facts.deviation[1]) + BOX_REACH)
    if not widest.max() < INDEX_BOUND:
        raise InputError(f"map: light lands {widest.max():.3g} pixels from where it does at rest; {TOO_FAR}")
    return int(widest[0]), int(widest[1])


def _window(facts: Facts, widest: tuple[int, int]) -> tuple[int, int]:
    """N and M: those of the scene, or wide enough for the largest deflection."""
    settings = facts.scene.method.gather
    n = 2 * widest[0] + 1 if settings.n is None else settings.n
    m = 2 * widest[1] if settings.n is None else max(settings.n - 1, LEAST_M)
    return n, m if settings.m is None else settings.m
