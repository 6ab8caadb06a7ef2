"""Sizes, places and times at their extremes."""

from __future__ import annotations

from collections.abc import Iterator
from decimal import Decimal, getcontext

import numpy as np

import warp_caustics as wc
from stability.row import METHODS, Row, each, judged
from stability.scenes import PIXEL, choppy, converged, flat, sine, sine_truth
from warp_caustics.water import phases

DEPTHS = (1e-4, 1e-2, 1.0, 1e2, 1e4)
PIXELS = (1e-6, 1e-4, 1e-2, 1.0, 100.0, 2100.0)
"""Maps of 48 pixels: from a twentieth of a millimetre to 100 km."""

ORIGINS = (1e3, 1e5, 1e7)
TIMES = (1e3, 1e5, 1e7)
PHASE = 1e-4  # [rad], promised at 1e7 s
TWO_PI = 2 * Decimal("3.14159265358979323846264338327950288419716939937510582097494459230781640628620899")


def depth() -> Iterator[Row]:
    """From a film of water to the deep sea, under one sine in closed form; no water, and land above it."""
    for metres in DEPTHS:
        length = 0.5
        amplitude = min(0.05 * length / (2.0 * np.pi), 0.25 * metres)
        table = sine(metres, amplitude, length)
        limit = "crossing sheets, each thinner than a pixel" if metres > 10.0 else "the method"
        yield from each(METHODS, "depth [m]", metres, table, sine_truth(table), same=True, limit=limit)
    none = choppy(depth=0.0, count=0)
    yield from each(METHODS, "no depth over a plane [m]", 0.0, none, flat(none), limit="a plane has no shore")
    film = sine(1e-3, 0.01, 0.5)
    yield from each(METHODS, "troughs below the plane [m]", 0.009, film, limit="lit as water, said in a warning")
    below = choppy(receiver={"plane": 1.0})
    yield from each(METHODS, "plane above the water [m]", 0.25, below, limit="a plane has no shore")
    for base, what in ((0.75, "land at the level of the water"), (1.0, "land above the water")):
        dry = choppy(receiver={"terrain": {"base": base}})
        yield from each(METHODS, what, base - 0.75, dry, converged(dry), limit="edges of a shore")
    beach = choppy(receiver={"terrain": {"base": 0.2, "slope": (1.5, 0.2)}})
    yield from each(METHODS, "land that rises through the water", "slope 1.5", beach, converged(beach),
                    limit="edges of a shore")  # fmt: skip


def scale() -> Iterator[Row]:
    """The same water at every size."""
    for pixel in PIXELS:
        table = choppy(pixel=pixel)
        yield from each(METHODS, "pixel [m]", pixel, table, converged(table), same=True, limit="the method")


def far() -> Iterator[Row]:
    """A window far from the origin."""
    for metres in ORIGINS:
        table = choppy(origin=(metres, -metres))
        yield from each(METHODS, "map.origin [m]", metres, table, converged(table), same=True, limit="the method")


def late() -> Iterator[Row]:
    """Phases and maps at late times."""
    getcontext().prec = 60
    for seconds in TIMES:
        table = choppy()
        scene = wc.Scene(**table)

        def phase(scene: wc.Scene = scene, seconds: float = seconds) -> np.ndarray:
            return phases(scene, seconds, 48.0 * PIXEL)

        start, own = phases(scene, 0.0, 48.0 * PIXEL), phases_exactly(scene, seconds)
        error = float(np.abs(np.angle(np.exp(1j * (phase() - own)))).max())
        assert len(start) == len(own)
        yield judged("phase at a late time [s]", seconds, "phases", error, PHASE, "float64 of omega t", phase)
        yield from each(METHODS, "map at a late time [s]", seconds, table, converged(table, seconds), time=seconds,
                        same=True, limit="the method")  # fmt: skip


def phases_exactly(scene: wc.Scene, seconds: float) -> np.ndarray:
    """Give the phases by sixty decimals, from the float64 frequencies."""
    turned = []
    for wave in scene.water.waves or ():
        k = float(np.hypot(*wave.wavevector))
        omega = float(np.sqrt(9.81 * k * np.tanh(k * 48.0 * PIXEL)))
        turned.append(float((Decimal(wave.phase) - Decimal(omega) * Decimal(seconds)) % TWO_PI))
    return np.array(turned)
