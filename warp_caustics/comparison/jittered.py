"""Jittered photons of the reference as a series of their own: a fitted slope, no method and no time."""

from __future__ import annotations

from typing import TYPE_CHECKING

from warp_caustics.comparison.rows import slope_of
from warp_caustics.metrics import relative_l2
from warp_caustics.reference import jittered_photons

if TYPE_CHECKING:
    from warp_caustics.comparison.record import Slope
    from warp_caustics.reference import Reference
    from warp_caustics.scene import Scene

SERIES = "jittered points"
EXPECTED = "-0.75: one point at random in each cell"
PER_SIDE = (1, 2, 4)
"""Photons along a pixel's side; their square is the count."""

SEED = 1


def jittered_slope(scene: Scene, time: float, reference: Reference, device: str, threads: int | None) -> Slope:
    """Fit how the error of jittered photons falls with their number."""
    errors = [
        relative_l2(
            jittered_photons(scene, time, per_side=side, seed=SEED, device=device, threads=threads),
            reference.caustic_map,
        )
        for side in PER_SIDE
    ]
    counts = [float(side**2) for side in PER_SIDE]
    return slope_of(SERIES, counts, errors, reference.error_bar, EXPECTED)
