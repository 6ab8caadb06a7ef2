"""How the error of a series falls with its count: a straight line in log-log, by least squares."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

CLEAR_OF_THE_BAR = 3.0
"""An error of fewer error bars is in part the reference's own, and bends the line."""

LEAST_POINTS = 2


@dataclass(frozen=True)
class Fit:
    """Error as ``count ** slope``, from the lowest count that was fitted to the highest."""

    slope: float
    lowest: float
    highest: float


def fit_slope(counts: Sequence[float], errors: Sequence[float], error_bar: float = 0.0) -> Fit | None:
    """Fit the errors that stand clear of the reference's error bar.

    Parameters
    ----------
    counts
        Samples per pixel.
    errors
        At each.
    error_bar
        Of the reference.

    Returns
    -------
    Fit or None
        None if fewer than two different counts are left.
    """
    kept = [
        (count, error)
        for count, error in zip(counts, errors, strict=True)
        if math.isfinite(error) and error > CLEAR_OF_THE_BAR * error_bar
    ]
    if len({count for count, _ in kept}) < LEAST_POINTS:
        return None
    x, y = np.log(np.array(kept)).T
    slope = float(np.polyfit(x, y, 1)[0])
    fitted = [count for count, _ in kept]
    return Fit(slope, min(fitted), max(fitted))
