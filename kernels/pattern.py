"""A moving picture of caustics, projected into a box: the caustics volume of the Unity article, on an eye's G-buffer.

The steps stand in the order and under the names of the article. It lives in a left-handed world with y up; here the
world is right-handed with z up. Only the axes of the light know of it (:func:`warp_caustics.views.light_axes`): u runs
to the right and v upwards of a view along the light, in both.
"""

import functools
from dataclasses import dataclass

import warp as wp

from .photon import Medium
from .rest_light import make_rest_light, towards_eye
from .views import View, unproject

FIRST_SPEED, SECOND_SPEED = 0.75, 1.0
"""Speeds of the two layers, in terms of the one that is set: the article's own numbers."""

SMOOTH_WIDTH = wp.constant(0.1)
"""Width of the smoothstep form of the luminance mask, as published."""

HALF = wp.constant(0.5)
"""A volume reaches from -0.5 to 0.5 in its own space."""


@dataclass(frozen=True)
class PatternSpec:
    """What the kernel contains.

    Attributes
    ----------
    luminance_mask : str
        ``"none"``, ``"lerp"``, ``"smoothstep"`` or ``"shadow"``.
    shadows : bool
        A shadow test has been made.
    split : bool
        Three samples of each layer, apart.
    overlay : bool
        What the masks leave out is black, as published; else it is lit as by calm water.
    fresnel, attenuation
        As :class:`~.spec.Spec`.
    colours : int
        1 or 3.
    """

    luminance_mask: str = "none"
    shadows: bool = False
    split: bool = False
    overlay: bool = False
    fresnel: bool = False
    attenuation: str = "none"
    colours: int = 1


@wp.struct
class Pattern:
    """The settings of a projected pattern; points are relative to the map's origin and the water's level."""

    to_object: wp.mat33  # world to the volume's own space
    object_offset: wp.vec3
    right: wp.vec3  # axes of the light
    up: wp.vec3
    anchor: wp.vec2  # repeats of the texture from the world's origin to the map's
    tiling: float  # repeats of the texture in a metre
    speed: wp.float64  # repeats of the texture in a second
    split: float  # [repeats of the texture]
    strength: float
    luminance_strength: float
    fade_radius: float
    fade_strength: float
    irradiance: wp.vec3
    luminance: wp.vec3  # share of each colour in the luminance of the sun


@wp.func
def box_mask(position: wp.vec3) -> float:
    """1 inside a volume, by a position in its own space: ``all(step(p, 0.5) * (1 - step(p, -0.5)))``."""
    inside = float(1.0)
    for axis in range(3):
        if not (position[axis] <= HALF and position[axis] > -HALF):
            inside = 0.0
    return inside


@wp.func
def panner(uv: wp.vec2, time: wp.float64, speed: wp.float64, tiling: float) -> wp.vec2:
    """``(1, 0) * time * speed + uv * tiling``; whole repeats of the way panned are left out, in float64."""
    way = time * speed
    return wp.vec2(float(way - wp.floor(way)), 0.0) + tiling * uv


@wp.func
def sample_repeat(texture: wp.array2d[float], uv: wp.vec2) -> float:
    """Value of a texture that repeats, bilinear between texel centres; uv in repeats, row 0 at v = 0."""
    rows = texture.shape[0]
    columns = texture.shape[1]
    x = (uv[0] - wp.floor(uv[0])) * float(columns) - HALF
    y = (uv[1] - wp.floor(uv[1])) * float(rows) - HALF
    u = x - wp.floor(x)
    v = y - wp.floor(y)
    left = (int(wp.floor(x)) + columns) % columns
    low = (int(wp.floor(y)) + rows) % rows
    right = (left + 1) % columns
    high = (low + 1) % rows
    below = wp.lerp(texture[low, left], texture[low, right], u)
    above = wp.lerp(texture[high, left], texture[high, right], u)
    return wp.lerp(below, above, v)


@wp.func
def sample_split(texture: wp.array2d[float], uv: wp.vec2, split: float) -> wp.vec3:
    """``SampleCaustics``: red, green and blue from three places, offset as published."""
    return wp.vec3(
        sample_repeat(texture, uv + wp.vec2(split, split)),
        sample_repeat(texture, uv + wp.vec2(split, -split)),
        sample_repeat(texture, uv + wp.vec2(-split, -split)),
    )


@wp.func
def lerp_mask(luminance: float, strength: float) -> float:
    """``lerp(1, sceneLuminance, strength)``."""
    return wp.lerp(1.0, luminance, strength)


@wp.func
def smoothstep_mask(luminance: float, strength: float) -> float:
    """``smoothstep(strength, strength + 0.1, sceneLuminance)``."""
    return wp.smoothstep(strength, strength + SMOOTH_WIDTH, luminance)


@wp.func
def edge_fade(position: wp.vec3, radius: float, strength: float) -> float:
    """``1 - saturate((distance(positionOS, 0) - radius) / (1 - strength))``."""
    return 1.0 - wp.clamp((wp.length(position) - radius) / (1.0 - strength), 0.0, 1.0)


@functools.cache
def make_caustics(split: bool) -> wp.Function:
    """Join the two layers by their least: ``min(tex1, tex2) * strength``, by colour."""

    @wp.func
    def caustics(pattern: Pattern, texture: wp.array2d[float], time: wp.float64, point: wp.vec3) -> wp.vec3:
        uv = wp.vec2(wp.dot(point, pattern.right), wp.dot(point, pattern.up))
        uv1 = panner(uv, time, wp.float64(wp.static(FIRST_SPEED)) * pattern.speed, pattern.tiling) + pattern.anchor
        uv2 = panner(uv, time, wp.float64(wp.static(SECOND_SPEED)) * pattern.speed, -pattern.tiling) - pattern.anchor
        if wp.static(split):
            first = sample_split(texture, uv1, pattern.split)
            second = sample_split(texture, uv2, pattern.split)
            return pattern.strength * wp.min(first, second)
        else:  # what follows a static return would stay in the code
            value = pattern.strength * wp.min(sample_repeat(texture, uv1), sample_repeat(texture, uv2))
            return wp.vec3(value, value, value)

    return caustics


@functools.cache
def make_mask(luminance_mask: str) -> wp.Function:
    """Multiply the masks of the box, of its edge and of the luminance."""

    @wp.func
    def mask(pattern: Pattern, position: wp.vec3, light: wp.vec3, lit: float) -> float:
        """``light`` is direct sunlight without shadow, for unit irradiance; ``lit`` is 0 in a shadow."""
        result = box_mask(position) * edge_fade(position, pattern.fade_radius, pattern.fade_strength)
        luminance = lit * wp.dot(pattern.luminance, light)
        if wp.static(luminance_mask == "lerp"):
            result *= lerp_mask(luminance, pattern.luminance_strength)
        if wp.static(luminance_mask == "smoothstep"):
            result *= smoothstep_mask(luminance, pattern.luminance_strength)
        if wp.static(luminance_mask == "shadow"):
            result *= lit
        return result

    return mask


@functools.cache
def make_pattern(spec: PatternSpec) -> wp.Kernel:
    """Project the pattern onto what an eye sees, as irradiance on the surface."""
    rest_light = make_rest_light(spec.fresnel, spec.attenuation)
    caustics = make_caustics(spec.split)
    mask = make_mask(spec.luminance_mask)
    shadows = spec.shadows
    overlay = spec.overlay
    colours = spec.colours

    @wp.kernel(module="unique", enable_backward=False)
    def project_pattern(
        # In:
        begin: int,
        depth: wp.array2d[float],
        normal: wp.array2d[wp.vec3],
        lit: wp.array2d[float],
        view: wp.array[View],
        texture: wp.array2d[float],
        pattern: Pattern,
        medium: Medium,
        sun: wp.vec3,
        clock: wp.array[wp.float64],
        # Out:
        seen_out: wp.array[float],
    ):
        """One thread a pixel; launch dims (rows, columns)."""
        row, column = wp.tid()
        row += begin
        far = depth[row, column]
        result = wp.vec3(0.0, 0.0, 0.0)
        if wp.isfinite(far):
            point = unproject(view[0], float(column) + 0.5, float(row) + 0.5, far)
            position = pattern.to_object * point + pattern.object_offset
            light = rest_light(medium, sun, point, towards_eye(view[0], point, normal[row, column]))
            visible = float(1.0)
            if wp.static(shadows):
                visible = lit[row, column]
            share = mask(pattern, position, light, visible)
            beside = (1.0 - share) * visible
            if wp.static(overlay):
                beside = 0.0
            result = wp.vec3(beside, beside, beside) + share * caustics(pattern, texture, clock[0], point)
            result = wp.cw_mul(wp.cw_mul(result, light), pattern.irradiance)
        for c in range(wp.static(colours)):
            seen_out[(row * depth.shape[1] + column) * wp.static(colours) + c] = result[c]

    return project_pattern
