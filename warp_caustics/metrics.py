"""How far a caustic map is from the reference: a few numbers, each defined once, here."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from warp_caustics.errors import InputError

if TYPE_CHECKING:
    from warp_caustics.energy import Energy

PERCENTILE = 99.9
"""Of the pixels, the share whose error is not looked at one by one: the rest are the tips of the caustics."""

FATES = ("received", "reflected", "absorbed", "outside_map", "left_water", "blocked")
"""What may become of light that a method neither loses nor makes."""


def relative_l2(caustic_map: np.ndarray, reference: np.ndarray) -> float:
    """Root mean square of the difference, over the reference's mean; all pixels and channels count alike.

    Parameters
    ----------
    caustic_map, reference : ndarray
        ``[rows, columns]`` or ``[rows, columns, 3]``, in the same units.

    Returns
    -------
    float
        Infinite for a map that is not finite; against a dark reference, 0 for a dark map and infinite for any other.

    Raises
    ------
    InputError
        If the two differ in shape.
    """
    difference = _difference(caustic_map, reference)
    return _over(math.sqrt(float(np.mean(difference**2))), reference)


def best_scale(caustic_map: np.ndarray, reference: np.ndarray) -> float:
    """The one factor that brings a map nearest to the reference in the mean square; 1 for a map that is dark.

    For methods whose brightness is a matter of taste: :func:`relative_l2` of the scaled map tells how far its pattern
    is from the truth. Parameters are those of :func:`relative_l2`.

    Returns
    -------
    float
        1 as well for a map that is not finite, which no factor mends.
    """
    values = np.asarray(caustic_map, dtype=np.float64)
    power = float(np.sum(values**2))
    if not (math.isfinite(power) and power > 0.0):
        return 1.0
    return float(np.sum(values * reference) / power)


def bias(caustic_map: np.ndarray, reference: np.ndarray) -> float:
    """Mean of the difference over the reference's mean, signed: how much too bright the map is as a whole.

    It is also the light in the map against that in the reference's, for whatever reason the two differ: light lost or
    made, or put beside the map. :func:`energy_error` has the first of these alone. Parameters and infinities are those
    of :func:`relative_l2`; a map that is not finite has a bias of plus infinity.
    """
    return _over(float(np.mean(_difference(caustic_map, reference))), reference)


def percentile_error(caustic_map: np.ndarray, reference: np.ndarray) -> float:
    """The absolute difference that 99.9 % of the values stay under, over the reference's mean.

    Parameters and infinities are those of :func:`relative_l2`.
    """
    difference = np.abs(_difference(caustic_map, reference))
    if not np.isfinite(difference).all():  # percentiles of infinities are NaN
        return math.inf
    return _over(float(np.percentile(difference, PERCENTILE)), reference)


def energy_error(energy: Energy, reference: Energy) -> float:
    """Light that a method makes (above 0) or loses (below 0) on its way, over the light in the reference's map.

    By the methods' own ledgers: what has a fate (received, reflected, absorbed, beside the map, out of the water,
    blocked), what shines twice (``over_lit``) and what came from nowhere (``invented``), less what was emitted. Light
    outside a gather's window, light without a finite path, and whatever a ledger fails to add up by are lost. The
    reference's own balance is taken off, since light from beyond a height map's border is missing there, too.

    Unlike :func:`bias` it is 0 for a method that puts all light somewhere, be it in the wrong place.

    Returns
    -------
    float
        Signed. If the reference's map is dark: 0 if nothing is made or lost, else infinite.
    """
    lit = _sum(reference, ("received", "dry"))
    off = _balance(energy) - _balance(reference)
    if not math.isfinite(off):
        return math.inf
    if lit > 0.0:
        return off / lit
    return math.copysign(math.inf, off) if off else 0.0


def _balance(energy: Energy) -> float:
    return _sum(energy, (*FATES, "over_lit", "invented")) - _sum(energy, ("emitted",))


def _sum(energy: Energy, names: tuple[str, ...]) -> float:
    return float(sum(np.sum(np.asarray(energy[name], dtype=np.float64)) for name in names))


def _difference(caustic_map: np.ndarray, reference: np.ndarray) -> np.ndarray:
    if caustic_map.shape != reference.shape:
        raise InputError(f"expected maps of one shape, got {caustic_map.shape} and {reference.shape}")
    return np.asarray(caustic_map, dtype=np.float64) - reference


def _over(value: float, reference: np.ndarray) -> float:
    """Divide by the mean of the reference; what is not finite is infinitely wrong, never right."""
    mean = float(np.mean(reference, dtype=np.float64))
    if not (math.isfinite(value) and math.isfinite(mean)):
        return math.inf
    if mean > 0.0:
        return value / mean
    return math.copysign(math.inf, value) if value else 0.0
