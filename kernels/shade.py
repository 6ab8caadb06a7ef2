"""Shading: what a picture is made of, the sky, Fresnel's mirror, and what water and air leave of light on its way."""

import functools
from dataclasses import dataclass

import warp as wp

from .optics import fresnel_transmittance
from .photon import Scene
from .spec import Spec
from .surface import HEIGHT_AND_SLOPE

SKY_EXPONENT = wp.constant(0.5)
"""How the sky turns from the horizon's colour to the zenith's, as a power of the direction's height. The square root
keeps the pale band near the horizon, as a clear sky does."""

SUN_RIM = wp.constant(0.2)
"""Share of the drawn sun's disk over which it fades, so that its edge does not step."""

DIFFUSE_PATH = wp.constant(1.2)
"""Way of the sky's light under water by unit depth: one over the mean cosine of refracted diffuse light, 0.83."""

DIFFUSE_TRANSMITTANCE = wp.constant(0.934)
"""Share of the sky's light that enters flat water: Fresnel's mean for light from all of the upper half (n = 1.33)."""

PI = wp.constant(3.14159265)


@dataclass(frozen=True)
class PictureSpec:
    """What a picture's kernel contains.

    Attributes
    ----------
    scene : Spec
        Kinds of water and receiver, ``bounded`` and ``objects`` as of the scene; the rest at its defaults.
    fresnel : bool
        Sunlight beside the map was weakened at the surface.
    by_depth : bool
        Daylight is lost over the vertical depth (Jerlov's K_d), not along its path.
    published : bool
        Ground and water are shaded as Collard & Mundi publish it.
    around : bool
        There is a second map, of the surroundings of the first.
    screen : bool
        Light comes from the camera's own map, along straight lines of sight; else from a plan-view map.
    """

    scene: Spec
    fresnel: bool = False
    by_depth: bool = False
    published: bool = False
    around: bool = False
    screen: bool = False


@wp.struct
class Appearance:
    """What light and things look like; places are relative to the map's origin and the water's level [m]."""

    eye: wp.vec3
    pixel_angle: float  # of the middle of the picture [rad]
    sun: wp.vec3  # the way light travels
    irradiance: wp.vec3  # of the sun, on a plane that faces it
    sun_radiance: wp.vec3  # of the disk that is drawn
    sun_cosine: float  # of the half angle of that disk
    zenith: wp.vec3  # radiance of the sky there
    horizon: wp.vec3
    sky_irradiance: wp.vec3  # of the sky without the sun, on level ground
    albedo: wp.vec3
    attenuation: wp.vec3  # along the eye's path in the water [1/m]
    veil: wp.vec3  # radiance of endless water
    haze: float  # way in the air after which 1/e of the contrast is left [m]
    map_size: wp.vec2  # [m]
    land_low: wp.vec2  # lower corner of the terrain's file, where there is one [m]
    land_size: wp.vec2
    around_low: wp.vec2  # lower corner of the map of the surroundings [m]
    around_size: wp.vec2
    around_fade: float  # width of the band in which its light turns into that of still water [m]


@wp.func
def sky_radiance(look: Appearance, direction: wp.vec3) -> wp.vec3:
    """Radiance of a clear sky: a gradient from the horizon to the zenith, and the sun's disk."""
    rise = wp.pow(wp.max(direction[2], 0.0), SKY_EXPONENT)
    sky = look.horizon + rise * (look.zenith - look.horizon)
    inside = (-wp.dot(direction, look.sun) - look.sun_cosine) / (SUN_RIM * (1.0 - look.sun_cosine))
    return sky + wp.clamp(inside, 0.0, 1.0) * look.sun_radiance


@wp.func
def reflectance(direction: wp.vec3, normal: wp.vec3, eta: float) -> float:
    """Share of unpolarised light that is reflected, 1 at total internal reflection; arguments as of ``refract``."""
    c = -wp.dot(normal, direction)
    k = 1.0 - eta * eta * (1.0 - c * c)
    if k <= 0.0:
        return 1.0
    return 1.0 - fresnel_transmittance(c, wp.sqrt(k), 1.0 / eta)


@wp.func
def beer(attenuation: wp.vec3, way: float) -> wp.vec3:
    """Transmittance by channel after a way in the water [m] (Beer and Lambert)."""
    return wp.vec3(wp.exp(-attenuation[0] * way), wp.exp(-attenuation[1] * way), wp.exp(-attenuation[2] * way))


@wp.func
def way_left(look: Appearance, wet: bool, way: float) -> wp.vec3:
    """Share of the radiance that is left after a way in the water or in the air [m]."""
    if wet:
        return beer(look.attenuation, way)
    left = wp.exp(-way / look.haze)
    return wp.vec3(left, left, left)


@wp.func
def way_glow(look: Appearance, wet: bool) -> wp.vec3:
    """Radiance that takes the place of what is lost on the way: the water's veil, or the horizon's colour."""
    if wet:
        return look.veil
    return look.horizon


@wp.func
def read_map(image: wp.array2d[wp.vec3], at: wp.vec2, size: wp.vec2) -> wp.vec3:
    """Read a map of this size at a point [m] from its lower corner, bilinear between the centres of pixels."""
    x = wp.clamp(at[0] / size[0] * float(image.shape[1]) - 0.5, 0.0, float(image.shape[1] - 1))
    y = wp.clamp(at[1] / size[1] * float(image.shape[0]) - 0.5, 0.0, float(image.shape[0] - 1))
    left = int(x)
    low = int(y)
    right = wp.min(left + 1, image.shape[1] - 1)
    high = wp.min(low + 1, image.shape[0] - 1)
    p = x - float(left)
    q = y - float(low)
    return (1.0 - q) * ((1.0 - p) * image[low, left] + p * image[low, right]) + q * (
        (1.0 - p) * image[high, left] + p * image[high, right]
    )


@wp.func
def margin(at: wp.vec2, low: wp.vec2, size: wp.vec2) -> float:
    """How far inside a rectangle a point lies; negative beside it [m]."""
    from_low = wp.min(at[0] - low[0], at[1] - low[1])
    return wp.min(from_low, wp.min(low[0] + size[0] - at[0], low[1] + size[1] - at[1]))


@wp.func
def folded(at: wp.vec2, size: wp.vec2) -> wp.vec2:
    """Bring a point into the rectangle from (0, 0) to ``size``, by mirrors at its sides."""
    x = at[0] - 2.0 * size[0] * wp.floor(at[0] / (2.0 * size[0]))
    y = at[1] - 2.0 * size[1] * wp.floor(at[1] / (2.0 * size[1]))
    return wp.vec2(size[0] - wp.abs(size[0] - x), size[1] - wp.abs(size[1] - y))


@functools.cache
def make_water_at(spec: Spec) -> wp.Function:
    """Height and slope of the water wherever an eye may look: it lies still where its height map has ended."""
    surface_at = HEIGHT_AND_SLOPE[spec.water]
    bounded = spec.bounded

    @wp.func
    def water_at(scene: Scene, x: float, y: float) -> wp.vec3:
        if wp.static(bounded):
            grid = scene.water.surface.grid
            u = (x - grid.origin[0]) * grid.per_metre[0] + 0.5
            v = (y - grid.origin[1]) * grid.per_metre[1] + 0.5
            if u < 0.0 or v < 0.0 or u > float(grid.nodes.shape[1]) or v > float(grid.nodes.shape[0]):
                return wp.vec3(0.0, 0.0, 0.0)
        return surface_at(scene.water.surface, x, y)

    return water_at
