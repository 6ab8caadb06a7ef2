"""Curves of error against run time, and the ratio of two of them: time for the same error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Point:
    """One setting of one method, measured: relative L2 error, and warm seconds a frame with their spread."""

    curve: str
    setting: str
    error: float
    seconds: float
    spread: float = 0.0  # half the range of the repetitions [s]


@dataclass(frozen=True)
class Ratio:
    """Seconds of two methods for one error.

    ``bound`` is ">=" where the coarsest setting of ``beam`` is already better than that error: a still coarser one
    might be faster.
    """

    error: float
    seconds: float
    beam_seconds: float
    bound: str = ""

    @property
    def value(self) -> float:
        """How many times as long as ``beam`` the other takes."""
        return self.seconds / self.beam_seconds


def front(points: Sequence[Point]) -> list[Point]:
    """Points that no faster one betters, from the fastest to the best."""
    kept: list[Point] = []
    for point in sorted(points, key=lambda p: (p.seconds, p.error)):
        if not kept or point.error < kept[-1].error:
            kept.append(point)
    return kept


def seconds_for(points: Sequence[Point], error: float) -> float:
    """Interpolate the time that a curve takes for an error that it reaches, in logarithms of both.

    For an error coarser than any that was measured it is the fastest time.
    """
    line = front(points)[::-1]
    errors, seconds = (np.log([getattr(p, name) for p in line]) for name in ("error", "seconds"))
    return float(np.exp(np.interp(np.log(error), errors, seconds)))


def ratios(others: Sequence[Sequence[Point]], beam: Sequence[Point], count: int) -> list[Ratio]:
    """Time for the same error: the best of some curves against ``beam``, from the best error that both reach on.

    The last error is the coarsest of the others. ``beam`` may have none as coarse; then the ratio is a bound.
    """
    line = front(beam)
    others = [front(each) for each in others if each]
    if not line or not others:
        return []
    low = max(min(each[-1].error for each in others), line[-1].error)
    high = max(each[0].error for each in others)
    found = []
    for error in map(float, np.geomspace(low, high, count)) if low < high else ():
        # The ends of a geometric series may be off by a rounding; the error itself must be among those reached.
        reached = min(max(error, low), high)
        seconds = min(seconds_for(each, reached) for each in others if each[-1].error <= reached)
        found.append(Ratio(reached, seconds, seconds_for(line, reached), ">=" if reached > line[0].error else ""))
    return found
