"""HDR-FLIP, an extra: how different two maps look to a person who flips between them.

P. Andersson, J. Nilsson, P. Shirley, T. Akenine-Möller, *Visualizing Errors in Rendered High Dynamic Range Images*,
Eurographics 2021; the implementation is the authors' own (PyPI ``flip-evaluator``).
"""

from __future__ import annotations

import math
from importlib.util import find_spec

import numpy as np

NOT_INSTALLED = "flip-evaluator is not installed: pip install 'warp-caustics[flip]'"

EXPOSURES = {"startExposure": -2.0, "stopExposure": 2.0, "numExposures": 2}
"""Stops, where 0 shows the reference's mean as 1: -2 keeps peaks of four times the mean, +2 shows the dark gaps.

Fixed, or each map would choose its own and no two figures could be compared."""

VIEWING = {"ppd": 67.0, "tonemapper": "ACES"}
"""The package's defaults, written down: pixels per degree of a 4K monitor of 0.7 m at 0.7 m."""

RGB = 3


def why_not() -> str | None:
    """Say why FLIP cannot be had here; None if it can."""
    return None if find_spec("flip_evaluator") else NOT_INSTALLED


def flip_error(caustic_map: np.ndarray, reference: np.ndarray) -> float | None:
    """Mean HDR-FLIP of a map against the reference, from 0 (no difference) to 1.

    Parameters
    ----------
    caustic_map, reference : ndarray
        ``[rows, columns]`` or ``[rows, columns, 3]``.

    Returns
    -------
    float or None
        Infinite for a map that is not finite, since FLIP takes a NaN for no difference; None if the reference is dark
        or not finite, where there is no exposure to show it at: left to choose one, the package ends the process.
    """
    mean = float(np.mean(reference, dtype=np.float64))
    if not (math.isfinite(mean) and mean > 0.0 and np.isfinite(reference).all()):
        return None
    if not np.isfinite(caustic_map).all():
        return math.inf
    import flip_evaluator

    _, error, _ = flip_evaluator.evaluate(
        _picture(reference / mean), _picture(caustic_map / mean), "HDR",
        applyMagma=False, computeMeanError=True, parameters={**EXPOSURES, **VIEWING},
    )  # fmt: skip
    return float(error)


def _picture(values: np.ndarray) -> np.ndarray:
    """Give float32 [rows, columns, 3] without negative values, of which FLIP knows nothing."""
    picture = np.maximum(values, 0.0).astype(np.float32)
    if picture.ndim == RGB:
        return np.ascontiguousarray(picture)
    return np.repeat(picture[..., None], RGB, axis=2)
