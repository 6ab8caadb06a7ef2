"""How fine a mesh must be to see all that a scene holds: two levels that both miss a thing agree by accident."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..assets.meshes import load_mesh
from ..scene import ClosedTerrain, TerrainWave, Wave

if TYPE_CHECKING:
    from ..facts import Facts

CELLS_A_LENGTH = 4.0
"""Cells in the shortest wave, or across the smallest object, at the first level."""

NODES_A_LENGTH = 4.0
"""Nodes of a height map in the shortest wave that it holds well."""

FAINT = 1e-3
"""Share of the steepest wave's slope below which a wave changes less than any tolerance."""


def finest_length(facts: Facts) -> float:
    """The shortest wave of water and terrain, or the smallest object [m]; infinite where there is nothing to see."""
    return min((*_waves(facts), *_grids(facts), *_objects(facts)), default=np.inf)


def first_per_side(facts: Facts) -> int:
    """Cells along a pixel's side that resolve the finest length: a power of two."""
    wanted = CELLS_A_LENGTH * float(facts.pixel.max()) / finest_length(facts)
    return 1 if wanted <= 1.0 else int(2 ** np.ceil(np.log2(wanted)))


def _waves(facts: Facts) -> Iterator[float]:
    terrain = facts.scene.receiver.terrain
    surfaces: tuple[Sequence[Wave | TerrainWave], ...] = (
        facts.scene.waves,
        terrain.waves if isinstance(terrain, ClosedTerrain) else (),
    )
    for waves in surfaces:
        numbers = [float(np.hypot(*wave.wavevector)) for wave in waves]
        slopes = [abs(wave.amplitude) * k for wave, k in zip(waves, numbers, strict=True)]
        for k, slope in zip(numbers, slopes, strict=True):
            if slope > FAINT * max(slopes):
                yield 2.0 * np.pi / k


def _grids(facts: Facts) -> Iterator[float]:
    for grid in (facts.assets.water, facts.assets.terrain, facts.basin):
        if grid is not None:
            yield NODES_A_LENGTH * float(min(grid.cell))


def _objects(facts: Facts) -> Iterator[float]:
    for item in facts.scene.receiver.objects:
        yield float(np.ptp(load_mesh(item.mesh).vertices, axis=0).max()) * abs(item.scale)
