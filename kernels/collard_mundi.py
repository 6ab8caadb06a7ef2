"""The shading of Collard & Mundi, Real-Time Water Caustics (2022): the ground (3.5) and the water's surface (3.6).

As published, so that pictures can be compared: an additive blend, a depth falloff and a tint of their own making, no
radiometry. Where the paper is silent (ambient share, exponent and threshold of the highlight) the constants are those
of `default.frag` in the authors' public repository, sebastiancollard/Water-Caustics.
"""

import warp as wp

WATER_COLOUR = wp.constant(wp.vec3(0.0, 112.5 / 255.0, 1.0))

WATER_TINT = wp.constant(0.25)
"""Of the water's colour that is added to the ground."""

AMBIENT = wp.constant(0.1)
SHININESS = wp.constant(256.0)
FULL_SPECULAR = wp.constant(0.3)
"""Average of the highlight past which it is replaced by white."""


@wp.func
def ground_attenuation(depth: float) -> float:
    """Light that is left at a depth [m], 2 / (0.1 d² + 0.1 d + 1), not yet limited to 1 (3.5, figure 8)."""
    return 2.0 / (0.1 * depth * depth + 0.1 * depth + 1.0)


@wp.func
def shade_ground(albedo: wp.vec3, caustic: float, depth: float) -> wp.vec3:
    """Colour of the ground under a caustic intensity of 0 to 1, at a depth [m] below the water at rest (3.5)."""
    lit = albedo + albedo * caustic
    return lit * wp.min(ground_attenuation(depth), 1.0) + WATER_COLOUR * WATER_TINT


@wp.func
def green_weight(n_dot_l: float) -> float:
    """Share of the light's green, 2 N·L - (N·L)², from 0 to 1 (3.6, figure 10)."""
    return wp.clamp(2.0 * n_dot_l - n_dot_l * n_dot_l, 0.0, 1.0)


@wp.func
def shade_water(normal: wp.vec3, to_light: wp.vec3, to_eye: wp.vec3, light: wp.vec3) -> wp.vec4:
    """Colour and opacity of the water's surface by the revised Phong model (3.6); the colour is not limited.

    All directions are unit vectors; ``light`` is the light's colour. N·L is taken as 0 where the surface faces away,
    as the authors' code has it. The opacity, N·L + specular, is limited to 0 to 1 as a blend would limit it; of the
    specular's channels it takes the first, which is what their code comes down to.
    """
    n_dot_l = wp.max(wp.dot(normal, to_light), 0.0)
    diffuse = wp.vec3(n_dot_l * light[0], green_weight(n_dot_l) * light[1], n_dot_l * light[2])
    mirrored = 2.0 * wp.dot(normal, to_light) * normal - to_light
    specular = wp.pow(wp.max(wp.dot(to_eye, mirrored), 0.0), SHININESS) * light
    if (specular[0] + specular[1] + specular[2]) / 3.0 > FULL_SPECULAR:
        specular = wp.vec3(1.0, 1.0, 1.0)
    colour = wp.cw_mul(AMBIENT * light + diffuse, WATER_COLOUR) + specular
    return wp.vec4(colour[0], colour[1], colour[2], wp.clamp(n_dot_l + specular[0], 0.0, 1.0))
