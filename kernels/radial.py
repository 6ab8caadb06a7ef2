"""Rings around a point: height, slope and curvature of a sine of the distance."""

import warp as wp

from .waves import Wave, vec6

NEAREST = wp.constant(1.0e-6)
"""Distance [m] under which the tip of the cone has no slope: it has one in every direction."""


@wp.func
def ring_sum(wave: Wave, x: float, y: float) -> wp.vec3:
    """Height and slope (z, z_x, z_y) of ``a sin(k d + phase)`` at (x, y) from the middle, k being ``wavevector[0]``."""
    k = wave.wavevector[0]
    d = wp.length(wp.vec2(x, y))
    angle = k * d + wave.phase
    rise = wave.amplitude * k * wp.cos(angle)
    per_metre = 1.0 / wp.max(d, NEAREST)
    return wp.vec3(wave.amplitude * wp.sin(angle), rise * x * per_metre, rise * y * per_metre)


@wp.func
def ring_sum_curved(wave: Wave, x: float, y: float) -> vec6:
    """As :func:`ring_sum`, with the second derivatives (z_xx, z_xy, z_yy)."""
    flat = ring_sum(wave, x, y)
    k = wave.wavevector[0]
    d = wp.max(wp.length(wp.vec2(x, y)), NEAREST)
    u = x / d
    v = y / d
    along = -k * k * flat[0]
    across = wave.amplitude * k * wp.cos(k * d + wave.phase) / d
    return vec6(
        flat[0], flat[1], flat[2],
        along * u * u + across * v * v, (along - across) * u * v, along * v * v + across * u * u,
    )  # fmt: skip
