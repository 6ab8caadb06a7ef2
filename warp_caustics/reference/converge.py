"""Levels of cells, ever finer, until two of them agree."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from ..kernels.reference.cells import PARTS
from ..metrics import relative_l2
from ..window import lattice_over
from .detail import first_per_side
from .roads import Sums

if TYPE_CHECKING:
    from ..facts import Facts
    from .roads import Roads

ORDER_FACTOR = 4.0
"""Half the step, a quarter of the error: triangles are of second order."""


LEAST_LEVELS = 3
"""Levels in any case: an agreement of the first two says little."""

LUCK = 8.0
"""A difference is taken to be no less than this part of the one before: at second order it is a quarter."""

LAND_PARTS = 4
"""Points along a pixel's side at which dry land is looked at, at the first level."""


@dataclass(frozen=True)
class Budget:
    """When to stop: at this difference of two levels, or before a level of more rays."""

    tolerance: float
    rays: int


@dataclass(frozen=True)
class Level:
    """An answer at unit irradiance, dry land beside it, and the relative L2 error that it may have."""

    sums: Sums
    land: np.ndarray
    per_side: int
    directions: int
    error_bar: float


def converge(roads: Roads, facts: Facts, budget: Budget) -> Level:
    """Walk by cells until two answers differ by less than the tolerance, or rays run out.

    The first level resolves the shortest wave and the smallest object. A level's answer is its map as it is; or two
    levels' combined as if their error were of second order (Richardson), which is far better where the water is
    smooth, and worse where edges rule. Of both kinds the one whose last answers differ less is given, and that
    difference is its error bar. A sun's disk has twice the directions at each level, and dry land twice the points
    along a pixel's side.
    """
    first = len(facts.suns)
    chains: tuple[_Chain, _Chain] = (_Chain(facts), _Chain(facts))
    coarse: Sums | None = None
    for level, per_side in enumerate(_doubling(first_per_side(facts))):
        directions = min(first * 2**level, _most_directions(facts, per_side, budget)) if first > 1 else 1
        fine, land = roads.cells(per_side, directions), roads.land(LAND_PARTS * 2**level)
        chains[0].add(fine, land)
        if coarse is not None:
            chains[1].add(_combined(coarse, fine), land)
        coarse = fine
        best = min(chains, key=lambda chain: chain.error_bar)
        more = _can_go_on(facts, 2 * per_side, 2 * directions if first > 1 else 1, budget)
        enough = best.error_bar <= budget.tolerance
        if level + 1 >= LEAST_LEVELS and (enough or not more):
            return Level(*best.answers[-1], per_side, directions, best.error_bar)
    raise AssertionError("the levels have no end")


class _Chain:
    """Answers of one kind, level by level, and by how much the last two differ."""

    def __init__(self, facts: Facts) -> None:
        self._area = float(np.prod(facts.pixel))
        self.answers: list[tuple[Sums, np.ndarray]] = []
        self.error_bar = np.inf

    def add(self, sums: Sums, land: np.ndarray) -> None:
        """Add an answer; two that agree by chance are not believed to differ less than a part of the two before."""
        self.answers.append((sums, land))
        if len(self.answers) > 1:
            one, two = (answer.flux / self._area + lit[..., None] for answer, lit in self.answers[-2:])
            before = self.error_bar / LUCK if np.isfinite(self.error_bar) else 0.0
            self.error_bar = max(relative_l2(one, two), before)
            del self.answers[0]


def first_work(facts: Facts) -> int:
    """Rays of the levels that are walked in any case.

    Raises
    ------
    InputError
        If there are more than can be counted.
    """
    per_side, first = first_per_side(facts), len(facts.suns)
    most = 2 ** (LEAST_LEVELS - 1)
    return _rays(facts, most * per_side, most * first if first > 1 else 1)


def _doubling(first: int) -> Iterator[int]:
    while True:
        yield first
        first *= 2


def _can_go_on(facts: Facts, per_side: int, directions: int, budget: Budget) -> bool:
    try:
        return _rays(facts, per_side, directions) <= budget.rays
    except InputError:  # more than can be counted
        return False


def _rays(facts: Facts, per_side: int, directions: int) -> int:
    low, high = facts.deviation
    cells = lattice_over(low, high, facts.scene.map.resolution, 1.0 / per_side).cells * directions
    return cells * PARTS**2 if facts.spec.receiver == "mesh" else cells


def _most_directions(facts: Facts, per_side: int, budget: Budget) -> int:
    """Directions of the disk that the rays of a level allow, no fewer than the plan itself takes."""
    return max(len(facts.suns), budget.rays // _rays(facts, per_side, 1))


def _combined(coarse: Sums, fine: Sums) -> Sums:
    def combine(one: np.ndarray, two: np.ndarray) -> np.ndarray:
        return np.asarray(two + (two - one) / (ORDER_FACTOR - 1.0))

    ledger = {name: combine(coarse.ledger[name], fine.ledger[name]) for name in fine.ledger}
    return Sums(combine(coarse.flux, fine.flux), ledger)
