"""``beam``: refracted cells of the surface, clipped exactly to the pixels. Plan view, any receiver; the default."""

from __future__ import annotations

import functools
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from ..kernels.beam import make_cells, make_corners
from ..kernels.cell_rows import make_cell_rows, serves_rows
from ..kernels.corner_rows import make_corner_rows
from ..kernels.edge_cells import make_edge_cells
from ..kernels.lanes import LANES, padded
from ..kernels.patch import BORDER, flux_planes
from ..kernels.torn import make_torn
from ..program import Buffer, Pass, Program, accumulator, strip_rows, wave_pass, wave_plane_pass
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
    edges = _by_edges(facts)
    spec = replace(facts.spec, accumulate="float64" if edges else accumulator(facts.scene, lattice))
    by_row = facts.device == "cpu" and spec.water == "waves"
    make = make_edge_cells if edges else make_cells
    if edges and by_row and serves_rows(spec):
        make = make_cell_rows
    columns, rows = lattice.count[0], strip_rows(STRIP_ROWS, lattice, len(facts.suns))
    beside = 1 + 2 * BORDER
    # Lanes are read from any column on, so that the last reach past the last corner.
    across = padded(columns + beside) + LANES if by_row else columns + beside
    tail = () if by_row else (across,)
    corners = (rows + beside, across)
    plan_waves = wave_plane_pass if by_row else functools.partial(wave_pass, spec)
    waves = plan_waves(lattice, facts.waves, rows, beside, -float(BORDER))
    land = make_corner_rows if by_row else make_corners
    passes = [
        *waves.passes,
        Pass("corners", "waves, refraction, landing at the corners of cells", lambda: land(spec),
             lambda strip: (strip + beside, *tail), weight=across if by_row else 1),
        Pass("cells", "beam: cells cut where they bend, clipped to pixels, added up",
             lambda: make(spec, settings.refine), lambda strip: (strip, columns), walks=edges),
    ]  # fmt: skip
    buffers = [*waves.buffers, Buffer("planes", "float32", (2 + flux_planes(spec), *corners), 4, per_lane=True)]
    if edges:
        buffers.append(Buffer("above", "float64", (columns, spec.channels), 8, per_lane=True))
    if spec.breaks:
        passes.append(
            Pass(
                "torn",
                "cells at an edge, followed ray by ray",
                lambda: make_torn(spec, edges),
                lambda strip: (strip, columns),
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
        steps=edges,
        settings={
            "samples_per_pixel": settings.samples_per_pixel,
            "refine": settings.refine,
            "deposit": "edges" if edges else "triangles",
        },
    )


def _by_edges(facts: Facts) -> bool:
    """Choose the form of the deposit."""
    method = facts.scene.method
    if method.accumulate == "fixed":
        if method.beam.deposit == "edges":
            raise InputError(
                'method.beam.deposit = "edges": steps are summed up in float64, and method.accumulate = "fixed"; '
                'expected deposit "triangles", or another accumulate'
            )
        return False
    if method.beam.deposit is None:
        # On a GPU edges have not been measured, and take a minute to compile.
        return facts.device == "cpu"
    return method.beam.deposit == "edges"
