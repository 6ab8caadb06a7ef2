"""The texture of a projected pattern: a picture from a file, or a tile that this library renders."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .scene import Scene
from .sun import GOLDEN_ANGLE

TILE_WAVES = (
    (1, 2), (-2, 1), (3, 1), (-1, 3), (2, -3), (4, 1), (-3, -4), (1, 5), (5, -2), (-5, 3), (4, 5), (-6, 1), (2, 7)
)  # fmt: skip
"""Periods of each wave across the tile, along x and y: all ways, so that the picture prefers none."""

TILE_STEEPNESS = 0.055
"""Slope of the longest wave; the others' falls with the root of their length. It gives a network with few folds."""

TILE_DEPTH = 0.8
"""Depth of the floor, in sides of the tile: near where most of the waves focus."""

TILE_PIXELS = 256


@functools.cache
def rendered_tile(device: str) -> NDArray[np.float64]:
    """Render the caustics of some waves that fit a tile, [rows, columns]; kept, since it takes a renderer of its own.

    Water that repeats lights a floor that repeats: the map is one period wide, so that it has no seam.
    """
    from .renderer import Renderer

    longest = min(float(np.hypot(*periods)) for periods in TILE_WAVES)
    waves = []  # turned by the golden angle from one to the next, so that no two crests stand together
    for number, periods in enumerate(TILE_WAVES):
        k = 2.0 * np.pi * np.array(periods, dtype=np.float64)
        slope = TILE_STEEPNESS * np.sqrt(longest / np.hypot(*periods))
        waves.append(
            {"amplitude": float(slope / np.hypot(*k)), "wavevector": k.tolist(), "phase": GOLDEN_ANGLE * number}
        )
    scene = Scene.model_validate(
        {
            "name": "tile",
            "water": {"level": TILE_DEPTH, "waves": waves},
            "receiver": {"plane": 0.0},
            "sun": {"direction": (0.0, 0.0, -1.0)},
            "medium": {"ior": "fresh"},
            "map": {"origin": (0.0, 0.0), "size": (1.0, 1.0), "resolution": (TILE_PIXELS, TILE_PIXELS)},
        }
    )
    made = Renderer(scene, "beam", device).render().caustic_map
    assert made is not None  # the beam makes one
    return made.numpy().astype(np.float64)


def texture_shape(texture: NDArray[np.float64] | None) -> tuple[int, int]:
    """Rows and columns of a texture, or of this library's own for None."""
    return (TILE_PIXELS, TILE_PIXELS) if texture is None else (texture.shape[0], texture.shape[1])


def upload_texture(texture: NDArray[np.float64] | None, device: str) -> Any:
    """Put a texture, or this library's own for None, on a device, float32 [rows, columns].

    It is scaled so that the least of two layers has a mean of 1: see :func:`mean_of_least`.
    """
    import warp as wp

    texture = rendered_tile(device) if texture is None else texture
    return wp.array((texture / mean_of_least(texture)).astype(np.float32), dtype=wp.float32, device=device)


def mean_of_least(values: NDArray[np.float64]) -> float:
    """Mean of the lesser of two of these values, over all pairs.

    As the two layers pan over one another, all pairs of places meet.
    """
    ordered = np.sort(values, axis=None)
    count = len(ordered)
    # Of the count^2 pairs, each value is the lesser of those with the values after it, twice, and with itself.
    return float(ordered @ (2.0 * np.arange(count - 1, -1, -1) + 1.0)) / count**2
