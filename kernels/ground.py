"""Light on the ground: from a caustic map, from one of its surroundings, or straight from the sun; and the sky's."""

import functools

import warp as wp

from .optics import fresnel_transmittance, refract
from .photon import Scene
from .project import GROUND, Hit, Receiver
from .shade import (
    DIFFUSE_PATH,
    DIFFUSE_TRANSMITTANCE,
    PI,
    Appearance,
    PictureSpec,
    beer,
    folded,
    make_water_at,
    margin,
    read_map,
)
from .spec import Spec

OFF_SURFACE = wp.constant(1.0e-4)
"""How far off its triangle a ray to the light starts, as a share of the longest ray."""

STEEP, LEANING = wp.constant(0.2), wp.constant(0.5)
"""Upward parts of a mesh's normal between which its light turns from that of still water into the map's: in plan view
a wall is thinner than a pixel, and its light a spike."""

FINE, COARSE = wp.constant(8.0), wp.constant(64.0)
"""Between how many of its pixels under one of the picture's the map of the surroundings turns into its mean."""


@functools.cache
def make_shaded(spec: Spec) -> wp.Function:
    """Tell whether a mesh stands between a point and the light, whose rays are taken as straight."""
    mesh, objects = spec.receiver == "mesh", spec.objects

    @wp.func
    def shaded(receiver: Receiver, point: wp.vec3, normal: wp.vec3, direction: wp.vec3) -> bool:
        start = point + OFF_SURFACE * receiver.reach * normal
        if wp.static(mesh):
            if wp.mesh_query_ray_anyhit(receiver.mesh, start, -direction, receiver.reach):
                return True
        if wp.static(objects):
            if wp.mesh_query_ray_anyhit(receiver.objects, start, -direction, receiver.reach):
                return True
        return False

    return shaded


@functools.cache
def make_direct_light(spec: PictureSpec) -> wp.Function:
    """Sunlight on ground that no map covers: through still water, or on dry land."""
    fresnel, by_depth = spec.fresnel, spec.by_depth

    @wp.func
    def direct_light(scene: Scene, look: Appearance, direction: wp.vec3, normal: wp.vec3, depth: float) -> wp.vec3:
        """Irradiance on the surface; ``direction`` is that of the light there, ``depth`` negative on dry land."""
        light = look.irradiance
        if depth > 0.0:
            # A beam of one square metre of surface is narrower or wider under water.
            light *= look.sun[2] / direction[2]
            if wp.static(fresnel):
                light *= fresnel_transmittance(-look.sun[2], -direction[2], scene.medium.ior)
            way = depth
            if wp.static(not by_depth):
                way = depth / -direction[2]
            light = wp.cw_mul(light, beer(look.attenuation, way))
        return wp.max(0.0, -wp.dot(normal, direction)) * light

    return direct_light


@functools.cache
def make_ground_radiance(spec: PictureSpec) -> wp.Function:
    """Radiance that leaves matt ground: its albedo over pi, times the light of sun, water and sky upon it.

    Over an endless bare plane the map of the surroundings goes on as its own mirror image, which has the right web
    though not in the right places. Elsewhere it turns into the light of still water at its rim.
    """
    water_at = make_water_at(spec.scene)
    direct_light = make_direct_light(spec)
    shaded = make_shaded(spec.scene)
    around, screen, by_depth = spec.around, spec.screen, spec.by_depth
    repeats = spec.scene.receiver == "plane" and not spec.scene.objects
    meshes = spec.scene.receiver == "mesh"

    @wp.func
    def ground_radiance(
        scene: Scene,
        look: Appearance,
        light: wp.array2d[wp.vec3],
        surroundings: wp.array2d[wp.vec3],
        pixel: wp.vec2i,
        straight: bool,
        footprint: float,
        point: wp.vec3,
        hit: Hit,
    ) -> wp.vec3:
        """``straight``: the line of sight was not mirrored, so that a camera's own map is of this point.

        ``footprint`` is the length of ground [m] that one pixel covers.
        """
        normal = wp.normalize(hit.normal)
        at = wp.vec2(point[0], point[1])
        depth = water_at(scene, at[0], at[1])[0] - point[2]
        direction = look.sun
        if depth > 0.0:
            direction = refract(look.sun, wp.vec3(0.0, 0.0, 1.0), scene.medium.eta)
        on_mesh = wp.static(meshes) or hit.part != GROUND
        mapped = not (on_mesh and depth < 0.0)  # a map has no light for the dry part of a mesh
        within_map = margin(at, wp.vec2(0.0, 0.0), look.map_size)
        inside = mapped and within_map >= 0.0
        if wp.static(screen):  # at the rim a pixel's own map may be of what lies beside
            inside = mapped and straight and within_map >= footprint
        irradiance = wp.vec3(0.0, 0.0, 0.0)
        share = float(1.0)  # of the light that comes from a map
        # A map in plan view has the light of the top of a mesh for its foot as well.
        lit = (inside and not on_mesh) or not shaded(scene.receiver, point, normal, direction)
        level = wp.abs(normal[2])
        # A map is light per horizontal area: on ground that leans, the same light on more area.
        if lit and inside:
            if wp.static(screen):
                irradiance = light[pixel[1], pixel[0]]
            else:
                irradiance = level * read_map(light, at, look.map_size)
                if on_mesh:
                    share = wp.smoothstep(STEEP, LEANING, level)
        elif lit:
            share = 0.0
            if wp.static(around):
                from_low = at - look.around_low
                if mapped:
                    # A pixel that covers more than the web's meshes sees their mean.
                    texel = look.around_size[0] / float(surroundings.shape[1])
                    share = 1.0 - wp.smoothstep(FINE, COARSE, footprint / texel)
                    if on_mesh:
                        share *= wp.smoothstep(STEEP, LEANING, level)
                    if wp.static(repeats):
                        from_low = folded(from_low, look.around_size)
                    else:
                        within = margin(at, look.around_low, look.around_size)
                        share *= wp.smoothstep(0.0, 1.0, within / look.around_fade)
                if share > 0.0:
                    irradiance = level * read_map(surroundings, from_low, look.around_size)
        irradiance *= share
        if lit and share < 1.0:
            irradiance += (1.0 - share) * direct_light(scene, look, direction, normal, depth)
        open_sky = 0.5 * (1.0 + normal[2])  # share of the sky that ground of this lean faces
        sky = open_sky * look.sky_irradiance
        if depth > 0.0:
            way = depth
            if wp.static(not by_depth):
                way = DIFFUSE_PATH * depth
            sky = DIFFUSE_TRANSMITTANCE * wp.cw_mul(sky, beer(look.attenuation, way))
        return wp.cw_mul(look.albedo, irradiance + sky) / PI

    return ground_radiance
