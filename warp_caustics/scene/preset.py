"""`[water] preset`: the wave presets of Collard & Mundi, laid over a map.

Their surface is a square of 4 x 4 units about its middle, with heights from sums of sines of position and time. They
print the ripples' `(sin 2x + sin πx) / 2`, the rings' `A sin(-π d f + t)`, and that further sines are summed on top of
ripples "to introduce greater wave patterns". All other numbers here are this library's: they give no amplitudes,
frequencies, directions or speeds. A preset's square is laid over the map's middle, four units to its shorter side.
"""

from __future__ import annotations

import math
from typing import Final

from warp_caustics.scene.frame import Map
from warp_caustics.scene.water import Wave

#: Sides of their surface, in its units.
UNITS: Final = 4.0

#: Factors of x in the ripples' two sines: their ratio is irrational, so that the sum never repeats.
RIPPLE_FACTORS: Final = (2.0, math.pi)

#: Ours: ripples run along both axes, this many times as fine as printed, where 4 units hold only one or two waves.
RIPPLE_FREQUENCY: Final = 5.0

#: Ours: bound of the slope of the ripples along each axis, of each greater wave, and of the rings.
RIPPLE_SLOPE: Final = 0.12
GREATER_SLOPE: Final = 0.1
RING_SLOPE: Final = 0.35

#: Ours: wave vectors of the greater waves [rad by unit], one to three waves across the surface, in no common direction.
GREATER_WAVES: Final = ((2.1, 0.9), (-1.3, 3.3), (3.9, -2.6))

#: Ours: f of the rings, which makes them one unit wide.
RING_FREQUENCY: Final = 2.0

#: Printed: the rings' `+ t`, with t in seconds.
RING_SPEED: Final = 1.0


def preset_waves(name: str, over: Map) -> tuple[Wave, ...]:
    """Return the waves of a preset over a map; of "radial" the one whose k . x is k_x times the way from the middle."""
    unit = min(over.size) / UNITS
    if name == "radial":
        k = math.pi * RING_FREQUENCY / unit
        # A sin(-k d + t) = -A sin(k d - t).
        return (Wave(amplitude=-RING_SLOPE / k, wavevector=(k, 0.0), angular_frequency=RING_SPEED),)
    ripples = [factor * RIPPLE_FREQUENCY for factor in RIPPLE_FACTORS]
    amplitude = RIPPLE_SLOPE / sum(ripples)
    vectors = [(amplitude, (k, 0.0)) for k in ripples] + [(amplitude, (0.0, k)) for k in ripples]
    if name == "waves":
        vectors += [(GREATER_SLOPE / math.hypot(*k), k) for k in GREATER_WAVES]
    middle = [low + 0.5 * side for low, side in zip(over.origin, over.size, strict=True)]
    return tuple(
        Wave(
            amplitude=height * unit,
            wavevector=(kx / unit, ky / unit),
            phase=-(kx * middle[0] + ky * middle[1]) / unit,
        )
        for height, (kx, ky) in vectors
    )
