"""The fate of the light that meets the water at one point, in float64."""

import functools

import warp as wp

from ..spec import Spec
from .meet import LOST, Mesh, make_gap, make_meet, meet_mesh
from .surface import HeightField, make_field

LANDS = wp.constant(1)
DRY = wp.constant(2)  # no water here
UNLIT = wp.constant(3)  # faces away from the sun
SHADED = wp.constant(4)
LEAVES = wp.constant(5)  # meets the surface from below, or nothing
DROPPED = wp.constant(6)  # given up, or not a number
LANDS_ON_MESH = wp.constant(7)

ENDLESS = 1.0e300
"""A way without end."""


@wp.struct
class World:
    """The scene, metres from the map's origin and the water's level."""

    water: HeightField
    terrain: HeightField
    plane: wp.float64  # z of a flat floor [m]
    mesh: Mesh
    objects: Mesh
    ior: wp.float64
    attenuation: wp.vec3d  # [1/m]
    pixel: wp.vec2d  # [m]
    low: wp.vec2d  # borders of the water [m]
    high: wp.vec2d


@wp.struct
class Ray:
    """What became of the light; fluxes by horizontal area at unit irradiance."""

    fate: int
    landing: wp.vec2d  # [pixels]
    incident: wp.float64  # negative where the surface faces away
    transmitted: wp.float64
    arrived: wp.vec3d


@wp.func
def refract_ray(sun: wp.vec3d, normal: wp.vec3d, ior: wp.float64) -> wp.vec3d:
    """Snell's law: the tangential part shrinks by the index, the rest of the unit length goes against the normal."""
    along = wp.dot(sun, normal)
    tangent = (sun - along * normal) / ior
    return tangent - wp.sqrt(wp.float64(1.0) - wp.dot(tangent, tangent)) * normal


@wp.func
def fresnel_transmittance(cosine_air: wp.float64, cosine_water: wp.float64, ior: wp.float64) -> wp.float64:
    """Unpolarised transmittance from air into water, 1 - (rs^2 + rp^2) / 2."""
    s = (cosine_air - ior * cosine_water) / (cosine_air + ior * cosine_water)
    p = (ior * cosine_air - cosine_water) / (ior * cosine_air + cosine_water)
    return wp.float64(1.0) - wp.float64(0.5) * (s * s + p * p)


@functools.cache
def make_shadowed(spec: Spec) -> wp.Function:
    """Whether something stands between a point of the water and the sun."""
    meet_water = make_meet(spec.water)
    meet_land = make_meet(spec.receiver)
    self_shadow, shore, occluders = spec.self_shadow, spec.shore, spec.occluders
    mesh, objects = spec.receiver == "mesh", spec.objects

    @wp.func
    def shadowed(world: World, origin: wp.vec3d, to_sun: wp.vec3d) -> bool:
        endless = wp.float64(wp.static(ENDLESS))
        up = wp.float64(1.0)
        if wp.static(self_shadow):
            if meet_water(world.water, origin, to_sun, up, world.water.highest, endless) >= wp.float64(0.0):
                return True
        if wp.static(shore):
            if meet_land(world.terrain, origin, to_sun, up, world.terrain.highest, endless) >= wp.float64(0.0):
                return True
        if wp.static(occluders and mesh):
            if meet_mesh(world.mesh, origin, to_sun) >= wp.float64(0.0):
                return True
        if wp.static(occluders and objects):
            if meet_mesh(world.objects, origin, to_sun) >= wp.float64(0.0):
                return True
        return False

    return shadowed


@functools.cache
def make_meet_receiver(spec: Spec) -> wp.Function:
    """The distance to the receiver and what stands on it, negative where there is none; and 1 if it is a mesh."""
    kind, objects = spec.receiver, spec.objects
    meet_land = make_meet(kind)

    @wp.func
    def meet_receiver(world: World, origin: wp.vec3d, ray: wp.vec3d) -> wp.vec2d:
        on_mesh = wp.float64(0.0)
        if wp.static(kind == "plane"):
            t = (origin[2] - world.plane) / -ray[2]
        elif wp.static(kind == "mesh"):
            t = meet_mesh(world.mesh, origin, ray)
            on_mesh = wp.float64(1.0)
        else:
            t = meet_land(world.terrain, origin, ray, wp.float64(1.0), wp.float64(0.0), wp.float64(wp.static(ENDLESS)))
        if wp.static(objects):
            other = meet_mesh(world.objects, origin, ray)
            if other >= wp.float64(0.0) and (t < wp.float64(0.0) or other < t):
                t = other
                on_mesh = wp.float64(1.0)
        return wp.vec2d(t, on_mesh)

    return meet_receiver


@functools.cache
def make_transmit(spec: Spec) -> wp.Function:
    """What is left by channel after a way through the water."""
    absorbs, by_depth = spec.attenuation != "none", spec.attenuation == "depth"

    @wp.func
    def transmit(world: World, distance: wp.float64, down: wp.float64) -> wp.vec3d:
        one = wp.float64(1.0)
        if wp.static(not absorbs):
            return wp.vec3d(one, one, one)
        way = distance
        if wp.static(by_depth):
            way = distance * down
        c = world.attenuation
        return wp.vec3d(wp.exp(-c[0] * way), wp.exp(-c[1] * way), wp.exp(-c[2] * way))

    return transmit


@functools.cache
def make_trace(spec: Spec) -> wp.Function:
    """Follow the light at one point of the water."""
    water_at = make_field(spec.water)
    land_gap = make_gap(spec.receiver)
    meet_water = make_meet(spec.water)
    shadowed = make_shadowed(spec)
    meet_receiver = make_meet_receiver(spec)
    transmit = make_transmit(spec)
    shades = spec.self_shadow or spec.shore or spec.occluders
    shore, fresnel, exits = spec.shore, spec.fresnel, spec.exits

    @wp.func
    def trace(world: World, sun: wp.vec3d, x: wp.float64, y: wp.float64) -> Ray:
        zero = wp.float64(0.0)
        ray = Ray()
        z = water_at(world.water, x, y)
        origin = wp.vec3d(x, y, z[0])
        if not wp.isfinite(z[0] + z[1] + z[2]):
            # Water that is no number takes in what it would at rest, and loses it.
            ray.incident = -sun[2]
            ray.fate = DROPPED
            return ray
        ray.incident = z[1] * sun[0] + z[2] * sun[1] - sun[2]
        if wp.static(shore):
            if land_gap(world.terrain, origin, sun, zero, wp.float64(1.0)) < zero:
                ray.fate = DRY
                return ray
        if not ray.incident > zero:
            ray.fate = UNLIT
            return ray
        if wp.static(shades):
            if shadowed(world, origin, -sun):
                ray.fate = SHADED
                return ray
        normal = wp.normalize(wp.vec3d(-z[1], -z[2], wp.float64(1.0)))
        way = refract_ray(sun, normal, world.ior)
        ray.transmitted = ray.incident
        if wp.static(fresnel):
            ray.transmitted *= fresnel_transmittance(-wp.dot(sun, normal), -wp.dot(way, normal), world.ior)
        ray.fate = LANDS
        t = wp.float64(-1.0)
        if way[2] < zero:
            met = meet_receiver(world, origin, way)
            t = met[0]
            if met[1] > zero:
                ray.fate = LANDS_ON_MESH
        if t == wp.float64(wp.static(LOST)):
            ray.fate = DROPPED
            return ray
        if t < zero:
            ray.fate = LEAVES
            return ray
        if wp.static(exits):
            up = meet_water(world.water, origin, way, wp.float64(-1.0), world.water.highest, t)
            if up >= zero and up < t:
                ray.fate = LEAVES
                return ray
        ray.landing = wp.vec2d((x + t * way[0]) / world.pixel[0], (y + t * way[1]) / world.pixel[1])
        ray.arrived = ray.transmitted * transmit(world, t, -way[2])
        if not wp.isfinite(t + ray.transmitted + ray.landing[0] + ray.landing[1]):
            ray.fate = DROPPED
        return ray

    return trace
