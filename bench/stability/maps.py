"""Maps of odd shapes, and samples from one to a hundred million."""

from __future__ import annotations

from collections.abc import Iterator

from stability.row import METHODS, Row, each, measure
from stability.scenes import RESOLUTION, choppy, converged

SHAPES = ((1, 1), (1, 4096), (4096, 1), (7, 5), (127, 63), (3, 1000))
COUNTS = (1.0, 1e2, 1e4, 1e6, 1e8)
LONGEST_BEAM = 1e6
"""Cells up to which a beam is measured: it has long converged."""


def shapes() -> Iterator[Row]:
    """Maps of one pixel, of one row, of odd sizes."""
    for columns, rows in SHAPES:
        table = choppy(resolution=(columns, rows))
        yield from each(METHODS, "map of columns x rows", f"{columns} x {rows}", table, converged(table), same=True,
                        limit="the method")  # fmt: skip


def counts() -> Iterator[Row]:
    """Samples over the map, from one on."""
    table = choppy()
    truth = converged(table, oversample=24)
    pixels = RESOLUTION[0] * RESOLUTION[1]
    for count in COUNTS:
        for accumulate in ("float32", "float64") if count == COUNTS[-1] else ("float32",):
            settings = {"accumulate": accumulate, "photon": {"photons_per_pixel": count / pixels}}
            limit = "the number of photons"
            if accumulate == "float32" and count == COUNTS[-1]:
                limit += ", and sums of float32"
            yield measure("photons", count, "photon", table, truth, settings=settings, limit=limit,
                          label="photon" if accumulate == "float32" else "photon, float64")  # fmt: skip
        if count <= LONGEST_BEAM:
            cells = {"beam": {"samples_per_pixel": count / pixels}}
            yield measure("cells", count, "beam", table, truth, settings=cells, limit="the number of cells")
