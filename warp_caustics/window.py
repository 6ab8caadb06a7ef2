"""Which water can light the map: bounds of refraction, and the lattice that covers that water and no more."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .errors import InputError
from .sun import refract_slopes

STEEPEST_RAY = 20.0
"""Tangent of the flattest refracted ray that the window is made for (87 degrees from the vertical)."""

FLOAT32 = 1e-6
"""Share of a way by which the kernels' float32 may land elsewhere: some roundings of 6e-8."""

MARGIN = 0.02
"""Share by which bounds are widened: refraction is tried at points of the set of slopes, and bends between them."""

TOO_FAR = "light spreads far for pixels this small: make them larger, or the water shallower or calmer"

MOST_CELLS = 2**36
"""Cells at most: there is no frame with as many (the plan refuses it sooner), and their count fits an integer."""

INDEX_BOUND = 2**24
"""Rows or columns at most: float32 counts whole numbers up to here."""


@dataclass(frozen=True)
class Reach:
    """How far light travels sideways under water, for one direction of the sun.

    Attributes
    ----------
    rest : ndarray
        Horizontal way by unit depth, from a surface at rest, ``[2]``.
    low, high : ndarray
        Its bounds over all slopes of the surface, ``[2]`` each.
    backlund_low, backlund_high : ndarray
        The bounds by Bäcklund's Eq. 3.3, which lands too far: the unrefracted way, projected on the refracted one.
    steepest : float
        The largest tangent of a refracted ray's angle from the vertical.
    clipped : bool
        True where a ray flatter than :data:`STEEPEST_RAY` was cut to it.
    """

    rest: np.ndarray
    low: np.ndarray
    high: np.ndarray
    backlund_low: np.ndarray
    backlund_high: np.ndarray
    steepest: float
    clipped: bool


@dataclass(frozen=True)
class Lattice:
    """Cells of water: index of the first (column, row), their count, and their step [pixels]."""

    first: tuple[int, int]
    count: tuple[int, int]
    step: float

    @property
    def cells(self) -> int:
        """Cells in all."""
        return self.count[0] * self.count[1]


def refraction_reach(direction: np.ndarray, slopes: np.ndarray, ior: float) -> Reach:
    """Bounds of the refracted rays from a surface whose slopes ``[n, 2]`` are given, where it faces the sun."""
    rest = refract_slopes(direction, np.zeros((1, 2)), ior)[0]
    # A slope that faces away counts as the one on its way there that the light just grazes.
    towards = slopes @ direction[:2]
    faces_away = towards < direction[2]
    share = np.where(faces_away, direction[2] / np.where(faces_away, towards, 1.0), 1.0)
    rays = np.concatenate([rest[None, :], refract_slopes(direction, share[:, None] * slopes, ior)])
    across = np.linalg.norm(rays[:, :2], axis=1)
    # A sun so low, through water that hardly bends, that even light at rest is flatter sets its own limit.
    flattest = max(STEEPEST_RAY, 2.0 * across[0] / -rays[0, 2])
    down = np.maximum(np.maximum(-rays[:, 2], across / flattest), np.finfo(np.float64).tiny)
    way = rays[:, :2] / down[:, None]
    steepest = np.linalg.norm(way, axis=1).max()
    by_backlund = rays[:, :2] * (rays @ direction / -direction[2])[:, None]
    return Reach(
        rest=-rest[:2] / rest[2],
        low=_widened(way, -1.0),
        high=_widened(way, 1.0),
        backlund_low=_widened(by_backlund, -1.0),
        backlund_high=_widened(by_backlund, 1.0),
        steepest=min(float(steepest * (1.0 + MARGIN)), flattest) if len(slopes) > 1 else float(steepest),
        clipped=bool((down > -rays[:, 2]).any()),
    )


def _widened(way: np.ndarray, side: float) -> np.ndarray:
    """The bound of ``way`` on one side, widened by a share of its spread."""
    low, high = way.min(axis=0), way.max(axis=0)
    return np.asarray((high if side > 0.0 else low) + side * MARGIN * (high - low))


def deviation_bounds(
    ways: Sequence[np.ndarray], rest: np.ndarray, depths: tuple[float, float], reference: float, pixel: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Bound how far from its place at rest light lands, ``[2]`` each way [pixels].

    Parameters
    ----------
    ways : sequence of ndarray
        Bounds of the horizontal way by unit depth.
    rest : ndarray
        The way by unit depth at rest.
    depths : (float, float)
        Least and largest depth of the receiver under the surface [m].
    reference : float
        Depth at which a lattice is anchored [m].
    pixel : ndarray
        Width and height of a pixel [m].
    """
    far = np.array([depth * way for depth in depths for way in ways])
    spare = FLOAT32 * (np.abs(far).max(axis=0) + np.abs(reference * rest))
    ends = far - reference * rest
    return (ends.min(axis=0) - spare) / pixel, (ends.max(axis=0) + spare) / pixel


def lattice_over(low: np.ndarray, high: np.ndarray, resolution: tuple[int, int], step: float) -> Lattice:
    """Cells whose light can land in the map, ``low`` and ``high`` being the bounds of the deviation [pixels].

    Raises
    ------
    InputError
        If there are more than can be counted, or gone through.
    """
    size = np.asarray(resolution, dtype=np.float64)
    # A cell lands within its square at rest plus the deviation.
    first = np.floor((0.0 - high) / step)
    last = np.ceil((size - low) / step)
    count = last - first
    if not np.isfinite(count).all() or np.abs([first, last]).max() > INDEX_BOUND or count.prod() > MOST_CELLS:
        raise InputError(
            f"map: it takes {count[0]:.3g} x {count[1]:.3g} cells of water, too many to go through; {TOO_FAR}"
        )
    return Lattice((int(first[0]), int(first[1])), (int(count[0]), int(count[1])), step)
