"""``beam``: refracted cells of the surface, clipped exactly to the pixels. Plan view, any receiver; the default."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..kernels.beam import make_cells, make_corners
from ..kernels.patch import BORDER, flux_planes
from ..kernels.torn import make_torn
from ..program import Buffer, Pass, Program, accumulator, strip_rows, wave_pass
from ..window import lattice_over

if TYPE_CHECKING:
    from ..facts import Facts

STRIP_ROWS = 64
"""Rows of a strip: 3 rows of corners are landed twice, 5 %, and its planes stay in a core's cache."""


def beam(facts: Facts) -> Program:
    """Plan the corners, the cells and, where they can be torn, the torn cells."""
    settings = facts.scene.method.beam
    low, high = facts.deviation
    lattice = lattice_over(low, high, facts.scene.map.resolution, float(np.sqrt(1.0 / settings.samples_per_pixel)))
    spec = replace(facts.spec, accumulate=accumulator(facts.scene, lattice))
    columns, rows = lattice.count[0], strip_rows(STRIP_ROWS, lattice, len(facts.suns))
    beside = 1 + 2 * BORDER
    corners = (rows + beside, columns + beside)
    waves = wave_pass(spec, lattice, facts.waves, rows, beside, -float(BORDER))
    passes = [
        *waves.passes,
        Pass("corners", "waves, refraction, landing at the corners of cells", lambda: make_corners(spec),
             lambda strip: (strip + beside, columns + beside)),
        Pass("cells", "beam: cells cut where they bend, clipped to pixels, added up",
             lambda: make_cells(spec, settings.refine), lambda strip: (strip, columns)),
    ]  # fmt: skip
    buffers = [*waves.buffers, Buffer("planes", "float32", (2 + flux_planes(spec), *corners), 4, per_lane=True)]
    if spec.breaks:
        passes.append(
            Pass(
                "torn", "cells at an edge, followed ray by ray", lambda: make_torn(spec), lambda strip: (strip, columns)
            )
        )
        buffers.append(Buffer("state", "uint8", corners, 1, per_lane=True))
        buffers.append(Buffer("torn_cells", "uint8", (rows, columns), 1, per_lane=True))
    return Program(
        lattice=lattice,
        strip_rows=rows,
        passes=tuple(passes),
        buffers=tuple(buffers),
        values=waves.values,
        accumulate=spec.accumulate,
        settings={"samples_per_pixel": settings.samples_per_pixel, "refine": settings.refine},
    )
