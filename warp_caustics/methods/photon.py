"""``photon``: one photon a cell of the surface, splatted where it lands. Plan view, any receiver."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..kernels.scatter import make_scatter
from ..kernels.scatter_waves import make_scatter_waves
from ..program import Pass, Program, accumulator, strip_rows, wave_pass, wave_plane_pass
from ..window import lattice_over

if TYPE_CHECKING:
    from ..facts import Facts

STRIP_ROWS = 256
"""Rows of a strip: enough strips for every core, few enough launches."""


def by_blocks(water: str, device: str) -> bool:
    """Whether waves are added up for blocks of columns at once."""
    return device == "cpu" and water == "waves"


def photon(facts: Facts) -> Program:
    """Plan the one pass that follows photons from the surface into the map."""
    settings = facts.scene.method.photon
    spec = replace(facts.spec, backlund=settings.projection == "backlund")
    low, high = facts.backlund_deviation if spec.backlund else facts.deviation
    step = float(np.sqrt(1.0 / settings.photons_per_pixel))
    widths = {"point": 0.0, "pixel": 1.0, "cell": step}
    width = widths[settings.footprint] if isinstance(settings.footprint, str) else float(settings.footprint)
    # A box reaches half its width beyond the cell that the bounds speak of.
    spare = max(0.0, 0.5 * (width - step))
    lattice = lattice_over(low - spare, high + spare, facts.scene.map.resolution, step)
    spec = replace(spec, accumulate=accumulator(facts.scene, lattice))
    columns, rows = lattice.count[0], strip_rows(STRIP_ROWS, lattice, len(facts.suns))
    does = "waves, refraction, landing, splat of each photon"
    if by_blocks(spec.water, facts.device):
        waves = wave_plane_pass(lattice, facts.waves, rows)
        scatter = Pass("scatter_waves", does, lambda: make_scatter_waves(spec), lambda strip: (strip,))
    else:
        waves = wave_pass(spec, lattice, facts.waves, rows, 0, 0.5)
        scatter = Pass("scatter", does, lambda: make_scatter(spec), lambda strip: (strip, columns))
    return Program(
        lattice=lattice,
        strip_rows=rows,
        passes=(*waves.passes, scatter),
        buffers=waves.buffers,
        values={**waves.values, "footprint": (width, width)},
        accumulate=spec.accumulate,
        settings={"photons_per_pixel": settings.photons_per_pixel, "footprint": settings.footprint,
                  "projection": settings.projection},
    )  # fmt: skip
