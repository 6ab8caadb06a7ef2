"""Refraction: Snell's law, Fresnel's transmittance, what a tilted surface takes in, and what the water takes out."""

import warp as wp


@wp.func
def refract(direction: wp.vec3, normal: wp.vec3, eta: float) -> wp.vec3:
    """Refracted unit direction, or zero at total internal reflection.

    ``direction`` is the way the light travels, ``normal`` the unit normal against it, ``eta`` the index that the
    light leaves over the one that it enters (air to water: 1/n; Bäcklund's thesis names n itself, which bends the
    wrong way).
    """
    c = -wp.dot(normal, direction)
    k = 1.0 - eta * eta * (1.0 - c * c)
    if k < 0.0:
        return wp.vec3(0.0, 0.0, 0.0)
    return eta * direction + (eta * c - wp.sqrt(k)) * normal


@wp.func
def refract_at_slope(direction: wp.vec3, slope: wp.vec2, eta: float) -> wp.vec3:
    """:func:`refract` at a height field of this slope, for light that enters (eta < 1): one square root in all.

    With the normal left unnormalised, m = (-z_x, -z_y, 1), and f = -m . I, Snell's law reads
    R = eta I + m (eta f - sqrt(m.m (1 - eta^2) + eta^2 f^2)) / m.m, which needs no normalisation.
    """
    squared = 1.0 + slope[0] * slope[0] + slope[1] * slope[1]
    f = facing(direction, slope)
    root = wp.sqrt(squared * (1.0 - eta * eta) + eta * eta * f * f)
    gamma = (eta * f - root) / squared
    return wp.vec3(
        eta * direction[0] - gamma * slope[0], eta * direction[1] - gamma * slope[1], eta * direction[2] + gamma
    )


@wp.func
def facing(direction: wp.vec3, slope: wp.vec2) -> float:
    """Light that a surface of this slope takes in per horizontal area and unit irradiance; negative facing away."""
    return slope[0] * direction[0] + slope[1] * direction[1] - direction[2]


@wp.func
def fresnel_transmittance(cos_incident: float, cos_refracted: float, ior: float) -> float:
    """Share of unpolarised light that enters the water."""
    rs = (cos_incident - ior * cos_refracted) / (cos_incident + ior * cos_refracted)
    rp = (ior * cos_incident - cos_refracted) / (ior * cos_incident + cos_refracted)
    return 1.0 - 0.5 * (rs * rs + rp * rp)


@wp.func
def transmittance_at_slope(direction: wp.vec3, refracted: wp.vec3, slope: wp.vec2, ior: float) -> float:
    """:func:`fresnel_transmittance` at a height field of this slope."""
    length = wp.sqrt(1.0 + slope[0] * slope[0] + slope[1] * slope[1])
    cos_incident = wp.max(facing(direction, slope) / length, 0.0)
    return fresnel_transmittance(cos_incident, facing(refracted, slope) / length, ior)
