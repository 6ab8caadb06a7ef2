"""``area_ratio``: landed triangles drawn at pixel centres, lit by old area over new. Plan view, any receiver.

The way of WebGL demos and of engines that copied it; ``beam`` is what it turns into when triangles are clipped to the
pixels instead.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from ..kernels.area_ratio import make_claim, make_triangles
from ..kernels.beam import make_corners
from ..kernels.centres import unclaim
from ..kernels.patch import BORDER, flux_planes
from ..program import Buffer, Pass, Program, accumulator, strip_rows, wave_pass
from ..window import TOO_FAR, lattice_over

if TYPE_CHECKING:
    from ..facts import Facts

STRIP_ROWS = 64
"""Rows of a strip, as of ``beam``."""

MOST_CELLS = 2**30 - 1
"""Cells whose triangles a 32-bit number tells apart."""


def area_ratio(facts: Facts) -> Program:
    """Plan the corners and the triangles; where the latest wins, the pass before that finds it.

    Raises
    ------
    InputError
        If the map is to be added up in a format that the method cannot honour, or has too many triangles to number.
    """
    settings = facts.scene.method.area_ratio
    latest = settings.overlap == "latest"
    _check_accumulate(facts, latest)
    low, high = facts.deviation
    lattice = lattice_over(low, high, facts.scene.map.resolution, float(np.sqrt(1.0 / settings.samples_per_pixel)))
    if latest and lattice.cells > MOST_CELLS:
        raise InputError(
            f'method.area_ratio.overlap = "latest": {lattice.cells:,} cells are more than can be numbered '
            f'({MOST_CELLS:,}); "add" needs no numbers, or {TOO_FAR}'
        )
    spec = replace(facts.spec, accumulate="float32" if latest else accumulator(facts.scene, lattice))
    # Which triangle is the latest is known when all have been seen, so they are one strip then.
    columns = lattice.count[0]
    rows = lattice.count[1] if latest else strip_rows(STRIP_ROWS, lattice, len(facts.suns))
    beside = 1 + 2 * BORDER
    corners = (rows + beside, columns + beside)
    waves = wave_pass(spec, lattice, facts.waves, rows, beside, -float(BORDER))
    width, height = facts.scene.map.resolution
    passes = [
        *waves.passes,
        Pass("corners", "waves, refraction, landing at the corners of cells", lambda: make_corners(spec),
             lambda strip: (strip + beside, columns + beside)),
    ]  # fmt: skip
    buffers = [*waves.buffers, Buffer("planes", "float32", (2 + flux_planes(spec), *corners), 4, per_lane=True)]
    if spec.breaks:
        buffers.append(Buffer("state", "uint8", corners, 1, per_lane=True))
    if latest:
        passes += [
            Pass("unclaim", "takes every pixel from its triangle", lambda: unclaim, lambda strip: (width * height,)),
            Pass("claim", "finds the latest triangle of each pixel", lambda: make_claim(spec),
                 lambda strip: (strip, columns)),
        ]  # fmt: skip
        buffers.append(Buffer("owner", "int32", (width * height,), 4))
    passes.append(
        Pass("triangles", "area ratio: triangles drawn at pixel centres, lit by old area over new",
             lambda: make_triangles(spec, settings.area == "derivatives", settings.clamp is not None, latest),
             lambda strip: (strip, columns))
    )  # fmt: skip
    return Program(
        lattice=lattice,
        strip_rows=rows,
        passes=tuple(passes),
        buffers=tuple(buffers),
        values={**waves.values, "limit": settings.clamp or 0.0},
        accumulate=spec.accumulate,
        settings=settings.model_dump(exclude_none=True),
        banded=not latest,
        conserves=False,
    )


def _check_accumulate(facts: Facts, latest: bool) -> None:
    """Refuse number formats that cannot be honoured.

    Raises
    ------
    InputError
        For fixed point, since a ratio of areas has no bound; for any but the default where nothing is added up.
    """
    accumulate = facts.scene.method.accumulate
    if latest and accumulate != "float32":
        raise InputError(
            f'method.accumulate = "{accumulate}": with method.area_ratio.overlap = "latest" a pixel keeps one triangle '
            'and nothing is added up; leave it out, or set overlap = "add"'
        )
    if accumulate == "fixed":
        raise InputError(
            'method.accumulate = "fixed": the ratios of area_ratio have no bound, and fixed point has one; '
            'use "float32" or "float64", or method "beam" or "photon"'
        )
