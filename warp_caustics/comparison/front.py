"""The Pareto front of error against time."""

from __future__ import annotations

import math
from collections.abc import Sequence

SAME = 1e-3
"""Relative difference of two errors that are one: methods with the same samples differ by float32's rounding alone."""


def on_front(seconds: Sequence[float], errors: Sequence[float], error_bar: float = 0.0) -> list[bool]:
    """Tell which points are more accurate than every faster one.

    Errors under the reference's error bar say nothing of which is smaller: they all count as the bar, so that the
    fastest of those at the bar ends the front. Of errors that are the same to three digits the fastest is on it.

    Parameters
    ----------
    seconds, errors
        Of each point; a point whose error is not finite is on no front.
    error_bar
        By which the reference may be wrong.
    """
    points = [(time, max(error, error_bar)) for time, error in zip(seconds, errors, strict=True)]
    best = math.inf
    marks = [False] * len(points)
    for number in sorted(range(len(points)), key=points.__getitem__):
        error = points[number][1]
        if math.isfinite(error) and error < best * (1.0 - SAME):
            marks[number], best = True, error
    return marks
