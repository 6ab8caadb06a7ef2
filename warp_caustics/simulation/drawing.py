"""The height of simulated water or a sea at points, for drawing: made anew on the CPU, read back."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..assets import HeightGrid
from ..height_map import sample_heights

if TYPE_CHECKING:
    from ..assets import Assets
    from ..scene import Scene
    from .basin import Basin
    from .sea import Sea

BESIDE = 3
"""Cells that are repeated or mirrored past the border, so that no one-sided difference is taken within it."""


def simulated_surface(scene: Scene, assets: Assets, time: float) -> tuple[Basin | Sea, HeightGrid]:
    """Simulate a scene's water to a time [s].

    Returns
    -------
    (Basin or Sea, HeightGrid)
        The displacement [m], reaching some cells past the water's rectangle, where it is repeated or mirrored.

    Raises
    ------
    InputError
        If the kind of simulation does not reach the time.
    """
    from ..facts import gather_facts
    from .water import make_motion

    basin = gather_facts(scene, assets).basin
    assert basin is not None
    motion = make_motion(basin, "cpu")
    motion.advance(time)
    z = np.pad(motion.surface.numpy(), BESIDE, mode="wrap" if basin.periodic else "symmetric")
    beside = BESIDE * np.asarray(basin.cell)
    low, size = np.subtract(basin.origin, beside), np.add(basin.size, 2.0 * beside)
    return basin, HeightGrid(z, (float(low[0]), float(low[1])), (float(size[0]), float(size[1])))


def simulated_heights(scene: Scene, assets: Assets, x: np.ndarray, y: np.ndarray, time: float) -> np.ndarray:
    """Displacement of a scene's simulated water at world coordinates of any shape [m], the surface that light sees.

    Raises
    ------
    InputError
        As :func:`simulated_surface`.
    """
    basin, grid = simulated_surface(scene, assets, time)
    at = [np.subtract(x, basin.origin[0]), np.subtract(y, basin.origin[1])]
    if basin.periodic:
        at = [np.mod(d, side) for d, side in zip(at, basin.size, strict=True)]
    else:
        at = [np.clip(d, 0.0, side) for d, side in zip(at, basin.size, strict=True)]
    return sample_heights(grid, at[0] + basin.origin[0], at[1] + basin.origin[1])
