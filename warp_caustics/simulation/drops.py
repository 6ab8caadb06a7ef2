"""Drops: Gaussian bumps, repeated or mirrored at the border, as products of a profile along x and one along y."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .basin import cell_centres

if TYPE_CHECKING:
    from .basin import Basin

GAUSSIAN_REACH = 6.5
"""Radii past which a Gaussian is under 1e-18, and no image of it is added."""


def drop_profiles(basin: Basin) -> tuple[np.ndarray, np.ndarray]:
    """Profiles of each drop along y ``[drops, rows]``, with its amplitude [m], and along x ``[drops, columns]``."""
    x, y = cell_centres(basin)
    drops = basin.settings.drops
    row_profiles, column_profiles = np.zeros((len(drops), basin.rows)), np.zeros((len(drops), basin.columns))
    for number, drop in enumerate(drops):
        rise = _images(y - basin.origin[1], drop.position[1] - basin.origin[1], drop.radius, basin.size[1], basin)
        row_profiles[number] = drop.amplitude * rise
        column_profiles[number] = _images(
            x - basin.origin[0], drop.position[0] - basin.origin[0], drop.radius, basin.size[0], basin
        )
    return row_profiles, column_profiles


def _images(at: np.ndarray, middle: float, radius: float, side: float, basin: Basin) -> np.ndarray:
    """Sum of a Gaussian and its images, in water of this side."""
    period = side if basin.periodic else 2.0 * side
    middles = [middle % period] if basin.periodic else [middle, -middle]
    count = int(np.ceil(GAUSSIAN_REACH * radius / period)) + 1
    shifts = period * np.arange(-count, count + 1)
    total = np.zeros_like(at)
    for one in middles:
        total += np.exp(-(((at[:, None] - one - shifts) / radius) ** 2)).sum(axis=1)
    return total
