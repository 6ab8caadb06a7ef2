"""``differential``: photons whose footprint follows from the curvature of the water. Plan view, any receiver."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..kernels.differential import make_differential
from ..kernels.footprint import LEAST_AXIS
from ..program import Pass, Program, accumulator, strip_rows, wave_pass
from ..window import lattice_over

if TYPE_CHECKING:
    from ..facts import Facts

STRIP_ROWS = 256
"""Rows of a strip, as of ``photon``."""


def differential(facts: Facts) -> Program:
    """Plan the one pass that follows photons with their differentials.

    The lattice is as wide as the footprints at rest need. One that bends widen may reach into the map from a photon
    that lands farther beside it; its light is then counted as beside the map, and never lost to the ledger.
    """
    settings = facts.scene.method.differential
    low, high = facts.deviation
    step = float(np.sqrt(1.0 / settings.photons_per_pixel))
    ellipse = settings.footprint == "ellipse"
    # At rest a parallelogram is the cell itself, and an ellipse reaches a whole cell from its middle.
    spare = max(step, float(LEAST_AXIS)) - 0.5 * step if ellipse else 0.0
    lattice = lattice_over(low - spare, high + spare, facts.scene.map.resolution, step)
    spec = replace(facts.spec, accumulate=accumulator(facts.scene, lattice))
    columns, rows = lattice.count[0], strip_rows(STRIP_ROWS, lattice, len(facts.suns))
    waves = wave_pass(spec, lattice, facts.waves, rows, 0, 0.5)
    splat = Pass(
        "differential", "waves with their curvature, refraction, landing, splat of each photon's footprint",
        lambda: make_differential(spec, ellipse), lambda strip: (strip, columns),
    )  # fmt: skip
    return Program(
        lattice=lattice,
        strip_rows=rows,
        passes=(*waves.passes, splat),
        buffers=waves.buffers,
        values={**waves.values, "largest": settings.largest},
        accumulate=spec.accumulate,
        settings=settings.model_dump(),
    )
