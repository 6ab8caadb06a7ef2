"""A line of sight as Collard & Mundi draw theirs: water blended over the ground, both by their own shading.

Nothing is bent: two meshes are drawn one over the other. Values are colours from 0 to 1, not radiance. The light is the
scene's sun where they have a lamp; beside the map the ground has no caustics.
"""

import functools

import warp as wp

from .collard_mundi import shade_ground, shade_water
from .photon import Scene
from .project import NOTHING
from .shade import Appearance, PictureSpec, make_water_at, margin, read_map, sky_radiance
from .sight import make_hit_ground, make_meet_water


@functools.cache
def make_see_published(spec: PictureSpec) -> wp.Function:
    """Colour along one line of sight; the parameters are those of ``make_see``'s function."""
    water_at = make_water_at(spec.scene)
    meet_water = make_meet_water(spec.scene)
    hit_ground = make_hit_ground(spec.scene)

    @wp.func
    def see_published(
        scene: Scene,
        look: Appearance,
        light: wp.array2d[wp.vec3],
        surroundings: wp.array2d[wp.vec3],
        pixel: wp.vec2i,
        direction: wp.vec3,
    ) -> wp.vec3:
        hit = hit_ground(scene.receiver, look, look.eye, direction)
        way = meet_water(scene, look.pixel_angle, look.eye, direction)
        brightest = wp.max(look.irradiance[0], wp.max(look.irradiance[1], look.irradiance[2]))
        colour = sky_radiance(look, direction) / brightest
        if hit.part != NOTHING:
            point = look.eye + hit.distance * direction
            at = wp.vec2(point[0], point[1])
            caustic = float(0.0)
            if margin(at, wp.vec2(0.0, 0.0), look.map_size) >= 0.0:
                caustic = wp.max(read_map(light, at, look.map_size)) / (brightest * -look.sun[2])
            colour = shade_ground(look.albedo, caustic, wp.max(-point[2], 0.0))
        if way >= 0.0 and (hit.part == NOTHING or way < hit.distance):
            point = look.eye + way * direction
            water = water_at(scene, point[0], point[1])
            normal = wp.normalize(wp.vec3(-water[1], -water[2], 1.0))
            surface = shade_water(normal, -look.sun, -direction, look.irradiance / brightest)
            over = surface[3]
            colour = (1.0 - over) * colour + over * wp.vec3(surface[0], surface[1], surface[2])
        return colour

    return see_published
