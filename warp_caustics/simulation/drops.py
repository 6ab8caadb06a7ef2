"""Drops: Gaussian bumps, repeated or mirrored at the border, as products of a profile along x and one along y."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError

if TYPE_CHECKING:
    from ..scene import Simulation
    from .basin import Basin

GAUSSIAN_REACH = 6.5
"""Radii past which a Gaussian is under 1e-18, and no image of it is added."""

WIDEST_DROP = 8.0
"""Radius of a drop at most, in sides of the water: its images, which are added up, would lift the water as one."""

DROWNED = 0.01
"""Share of a drop's height: where no more of it than this is in open water, it is in an obstacle."""

PEAK_POINTS = 256
"""Intervals of two radii in which a profile's peak is sought."""

PEAK_MARGIN = 1e-4
"""Share added to a peak: it is missed by up to 1 / 256^2 of it, and float32 rounds."""


def drop_profiles(basin: Basin) -> tuple[np.ndarray, np.ndarray]:
    """Profiles of each drop along y ``[drops, rows]``, with its amplitude [m], and along x ``[drops, columns]``."""
    x, y = basin.centres()
    drops = basin.settings.drops
    row_profiles, column_profiles = np.zeros((len(drops), basin.rows)), np.zeros((len(drops), basin.columns))
    for number, drop in enumerate(drops):
        column_profiles[number], rise = (
            _images(at - low, middle - low, drop.radius, side, basin.periodic)
            for at, low, middle, side in zip((x, y), basin.origin, drop.position, basin.size, strict=True)
        )
        row_profiles[number] = drop.amplitude * rise
    return row_profiles, column_profiles


def check_drops(basin: Basin) -> None:
    """Refuse drops that the cells do not resolve, or that fall beside the water.

    Raises
    ------
    InputError
        With the drop and what would be right.
    """
    low, high = np.asarray(basin.origin), np.add(basin.origin, basin.size)
    for number, drop in enumerate(basin.settings.drops):
        where = f"water.simulation.drops[{number}]"
        least, most = max(basin.cell), WIDEST_DROP * min(basin.size)
        if not least <= drop.radius <= most:
            raise InputError(
                f"{where}.radius: expected {least:g} m, a cell's side, to {most:g} m, {WIDEST_DROP:g} times the "
                f"water's, got {drop.radius:g} m"
            )
        if not basin.periodic and not ((low <= drop.position) & (drop.position <= high)).all():
            raise InputError(
                f"{where}.position: expected a point of the water, {basin.extent}, got {list(drop.position)}"
            )


def check_open(basin: Basin, number: int) -> None:
    """Refuse a drop that an obstacle swallows.

    Raises
    ------
    InputError
        With the drop and where it is.
    """
    if basin.solid is None:
        return
    drop = basin.settings.drops[number]
    along, across = basin.away(drop.position)
    reach = drop.radius * float(np.sqrt(-np.log(DROWNED)))
    columns, rows = np.flatnonzero(np.abs(along[0]) <= reach), np.flatnonzero(np.abs(across[:, 0]) <= reach)
    under = np.hypot(along[:, columns], across[rows]) <= reach
    if basin.solid[np.ix_(rows, columns)][under].all():
        raise InputError(
            f"water.simulation.drops[{number}].position: expected a point of open water, and all within {reach:.3g} m "
            f"of {list(drop.position)} is in an obstacle"
        )


def highest_drops(settings: Simulation) -> float:
    """Height of all drops in one place [m], each with its images where the water's rectangle is given."""
    total, periodic = 0.0, settings.border == "periodic"
    for drop in settings.drops:
        height = abs(drop.amplitude)
        if settings.origin is not None and settings.size is not None:
            for low, middle, side in zip(settings.origin, drop.position, settings.size, strict=True):
                height *= _peak(middle - low, min(drop.radius, WIDEST_DROP * side), side, periodic)
        total += height
    return total * (1.0 + PEAK_MARGIN)


def _peak(middle: float, radius: float, side: float, periodic: bool) -> float:
    """Peak of a profile: it is within a radius of the drop's middle, or at a wall there."""
    at = middle + radius * np.linspace(-1.0, 1.0, PEAK_POINTS + 1)
    at = np.mod(at, side) if periodic else np.clip(at, 0.0, side)
    return float(_images(at, middle, radius, side, periodic).max())


def _images(at: np.ndarray, middle: float, radius: float, side: float, periodic: bool) -> np.ndarray:
    """Sum of a Gaussian and its images, in water of this side."""
    period = side if periodic else 2.0 * side
    middles = [middle % period] if periodic else [middle, -middle]
    count = int(np.ceil(GAUSSIAN_REACH * radius / period)) + 1
    shifts = period * np.arange(-count, count + 1)
    total = np.zeros_like(at)
    for one in middles:
        total += np.exp(-(((at[:, None] - one - shifts) / radius) ** 2)).sum(axis=1)
    return total
