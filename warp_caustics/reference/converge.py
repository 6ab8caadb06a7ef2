"""Levels of cells, ever finer, until two of them agree."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..kernels.reference.cells import PARTS
from ..metrics import relative_l2
from ..window import lattice_over
from .roads import Sums

if TYPE_CHECKING:
    from ..facts import Facts
    from .roads import Roads

ORDER_FACTOR = 4.0
"""Half the step, a quarter of the error: triangles are of second order."""


@dataclass(frozen=True)
class Budget:
    """When to stop: at this difference of two levels, or before a level of more rays."""

    tolerance: float
    rays: int


@dataclass(frozen=True)
class Level:
    """An answer at unit irradiance, and the relative L2 error that it may have."""

    sums: Sums
    per_side: int
    directions: int
    error_bar: float


def converge(roads: Roads, facts: Facts, budget: Budget, land: np.ndarray) -> Level:
    """Walk by cells until two answers differ by less than the tolerance, or rays run out.

    A level's answer is its map as it is; or two levels' combined as if their error were of second order (Richardson),
    which is far better where the water is smooth, and worse where edges rule. Of both kinds the one whose last two
    answers differ less is given, and that difference is its error bar. A sun's disk has twice the directions at each
    level.
    """
    area = float(np.prod(facts.pixel))
    first = len(facts.suns)
    coarse, combined = roads.cells(1, first), None
    for per_side in _doubling(2):
        directions = min(first * per_side, _most_directions(facts, per_side, budget)) if first > 1 else 1
        fine = roads.cells(per_side, directions)
        following = _combined(coarse, fine)
        answers = [(coarse, fine)] if combined is None else [(coarse, fine), (combined, following)]
        bars = [relative_l2(_whole(one, area, land), _whole(two, area, land)) for one, two in answers]
        error = min(bars)
        if error <= budget.tolerance or _rays(facts, 2 * per_side, 2 * directions) > budget.rays:
            return Level(answers[bars.index(error)][1], per_side, directions, error)
        coarse, combined = fine, following
    raise AssertionError("the levels have no end")


def _doubling(first: int) -> Iterator[int]:
    while True:
        yield first
        first *= 2


def _rays(facts: Facts, per_side: int, directions: int) -> int:
    low, high = facts.deviation
    cells = lattice_over(low, high, facts.scene.map.resolution, 1.0 / per_side).cells * directions
    return cells * PARTS**2 if facts.spec.receiver == "mesh" else cells


def _most_directions(facts: Facts, per_side: int, budget: Budget) -> int:
    """Directions of the disk that the rays of a level allow, no fewer than the plan itself takes."""
    return max(len(facts.suns), budget.rays // _rays(facts, per_side, 1))


def _whole(sums: Sums, area: float, land: np.ndarray) -> np.ndarray:
    return np.asarray(sums.flux / area + land[..., None])


def _combined(coarse: Sums, fine: Sums) -> Sums:
    def combine(one: np.ndarray, two: np.ndarray) -> np.ndarray:
        return np.asarray(two + (two - one) / (ORDER_FACTOR - 1.0))

    ledger = {name: combine(coarse.ledger[name], fine.ledger[name]) for name in fine.ledger}
    return Sums(combine(coarse.flux, fine.flux), ledger)
