"""One photon: from a point of the water to where it lands, with all that happens to it on the way.

Every method that follows light down uses this one function, built for the scene's :class:`~.spec.Spec`: what the
scene does not need is not in its code.
"""

import functools

import warp as wp

from .optics import facing, refract_at_slope, transmittance_at_slope
from .project import FAR, NOTHING, OBJECT, Receiver, make_clearance, make_hit_receiver, project_backlund
from .spec import Spec
from .surface import HEIGHT_AND_SLOPE, Surface

LANDED = wp.constant(1)  # on the ground
LANDED_ON_OBJECT = wp.constant(2)
DRY = wp.constant(3)  # no water here
UNLIT = wp.constant(4)  # faces away from the sun
BLOCKED = wp.constant(5)  # in the shadow of a crest, of land or of an object
LEFT = wp.constant(6)  # left the water without meeting the receiver
LOST = wp.constant(7)  # not a finite number


@wp.struct
class Water:
    """The water's surface, relative to its rest level, with the bounds that end a march."""

    surface: Surface
    amplitude: float  # bound of the displacement [m]
    slope: float  # bound of the slope
    step: float  # smallest step of a march [m]


@wp.struct
class Medium:
    """The water's optics."""

    ior: float
    eta: float  # 1 / ior
    attenuation: wp.vec3  # by channel [1/m]


@wp.struct
class Scene:
    """All that a photon meets."""

    water: Water
    receiver: Receiver
    medium: Medium


@wp.struct
class SunSample:
    """One direction of the sun's disk; written by the host before a frame, read by every kernel."""

    direction: wp.vec3
    rest_shift: wp.vec2  # horizontal way of this light from the surface at rest to the reference depth [m]


@wp.struct
class Photon:
    """A photon's fate; fluxes are per horizontal area and unit irradiance."""

    state: int
    origin: wp.vec3  # on the surface, relative to the rest level [m]
    direction: wp.vec3  # refracted
    distance: float  # to where it lands [m]
    normal: wp.vec3  # of the receiver there, not normalised
    incident: float  # negative where the surface faces away
    transmitted: float  # after Fresnel
    arrived: wp.vec3  # after attenuation, by channel


@wp.func
def share_lit(clearance: float, gradient: wp.vec2, size: wp.vec2) -> float:
    """Share of a cell of this size in which a clearance is positive that is linear in it (a box-filtered edge)."""
    spread = wp.abs(gradient[0]) * size[0] + wp.abs(gradient[1]) * size[1]
    return wp.clamp(0.5 + clearance / wp.max(spread, 1.0e-12), 0.0, 1.0)


@functools.cache
def make_attenuate(spec: Spec) -> wp.Function:
    """Transmittance by channel along a path: absorption over its length, or K_d over its vertical extent."""
    by_depth = spec.attenuation == "depth"
    absorbs = spec.attenuation != "none"

    @wp.func
    def attenuate(medium: Medium, distance: float, direction: wp.vec3) -> wp.vec3:
        if wp.static(absorbs):
            way = distance
            if wp.static(by_depth):
                way = -distance * direction[2]
            c = medium.attenuation
            return wp.vec3(wp.exp(-c[0] * way), wp.exp(-c[1] * way), wp.exp(-c[2] * way))
        else:  # what follows a static return would stay in the code
            return wp.vec3(1.0, 1.0, 1.0)

    return attenuate


@functools.cache
def make_lit(spec: Spec) -> wp.Function:
    """Share of a cell of the surface that is wet and in the sun; a cell of no size gives 0 or 1."""
    water_at = HEIGHT_AND_SLOPE[spec.water]
    kind = spec.receiver if spec.receiver in HEIGHT_AND_SLOPE else "waves"
    terrain_at = HEIGHT_AND_SLOPE[kind]
    clear_of_water = make_clearance(spec.water)
    clear_of_land = make_clearance(kind)
    self_shadow = spec.self_shadow
    shore = spec.shore
    occluders = spec.occluders
    mesh = spec.receiver == "mesh"
    objects = spec.objects

    @wp.func
    def lit(scene: Scene, sun: wp.vec3, origin: wp.vec3, slope: wp.vec2, size: wp.vec2) -> float:
        share = float(1.0)
        to_sun = -sun
        if wp.static(self_shadow):
            water = scene.water
            near = clear_of_water(water.surface, origin, to_sun, 1.0, water.slope, water.amplitude, water.step)
            if near[0] < FAR:
                other = water_at(water.surface, origin[0] + near[1] * to_sun[0], origin[1] + near[1] * to_sun[1])
                share *= share_lit(near[0], wp.vec2(slope[0] - other[1], slope[1] - other[2]), size)
        if wp.static(shore):
            land = scene.receiver
            near = clear_of_land(land.terrain, origin, to_sun, 1.0, land.slope, land.highest, land.step)
            if near[0] < FAR:
                other = terrain_at(land.terrain, origin[0] + near[1] * to_sun[0], origin[1] + near[1] * to_sun[1])
                share *= share_lit(near[0], wp.vec2(slope[0] - other[1], slope[1] - other[2]), size)
        if wp.static(occluders and mesh):
            if wp.mesh_query_ray_anyhit(scene.receiver.mesh, origin, to_sun, scene.receiver.reach):
                share = 0.0
        if wp.static(occluders and objects):
            if wp.mesh_query_ray_anyhit(scene.receiver.objects, origin, to_sun, scene.receiver.reach):
                share = 0.0
        return share

    return lit


@functools.cache
def make_wet(spec: Spec) -> wp.Function:
    """Share of a cell of the surface under which there is water."""
    shore = spec.shore
    kind = spec.receiver if spec.receiver in HEIGHT_AND_SLOPE else "waves"
    terrain_at = HEIGHT_AND_SLOPE[kind]

    @wp.func
    def wet(receiver: Receiver, origin: wp.vec3, slope: wp.vec2, size: wp.vec2) -> float:
        if wp.static(shore):
            ground = terrain_at(receiver.terrain, origin[0], origin[1])
            return share_lit(origin[2] - ground[0], wp.vec2(slope[0] - ground[1], slope[1] - ground[2]), size)
        else:
            return 1.0

    return wet


@functools.cache
def make_land(spec: Spec) -> wp.Function:
    """Follow the refracted ray of a lit point of the surface to where it lands."""
    hit_receiver = make_hit_receiver(spec)
    clear_of_water = make_clearance(spec.water)
    attenuate = make_attenuate(spec)
    fresnel = spec.fresnel
    exits = spec.exits
    backlund = spec.backlund

    @wp.func
    def land(scene: Scene, sun: wp.vec3, origin: wp.vec3, slope: wp.vec2, incident: float) -> Photon:
        photon = Photon()
        photon.origin = origin
        photon.incident = incident
        photon.direction = refract_at_slope(sun, slope, scene.medium.eta)
        photon.transmitted = incident
        if wp.static(fresnel):
            photon.transmitted = incident * transmittance_at_slope(sun, photon.direction, slope, scene.medium.ior)
        hit = hit_receiver(scene.receiver, origin, photon.direction)
        photon.state = LANDED
        if hit.part == NOTHING:
            photon.state = LEFT
        elif hit.part == OBJECT:
            photon.state = LANDED_ON_OBJECT
        photon.distance = hit.distance
        photon.normal = hit.normal
        if wp.static(exits):
            water = scene.water
            near = clear_of_water(
                water.surface, origin, photon.direction, -1.0, water.slope, water.amplitude, water.step
            )
            if near[0] < 0.0 and (hit.part == NOTHING or near[1] < hit.distance):
                photon.state = LEFT
        if wp.static(backlund):
            straight = hit_receiver(scene.receiver, origin, sun)
            landing = project_backlund(origin, origin + straight.distance * sun, photon.direction)
            photon.distance = wp.length(landing - origin)
            if straight.part == NOTHING:
                photon.state = LEFT
        photon.arrived = photon.transmitted * attenuate(scene.medium, photon.distance, photon.direction)
        if not wp.isfinite(photon.distance + wp.length_sq(photon.direction) + incident):
            # What it took in is not known; it is counted as what it would take in at rest.
            photon.state = LOST
            photon.incident = -sun[2]
            photon.transmitted = -sun[2]
        return photon

    return land


@functools.cache
def make_photon(spec: Spec) -> wp.Function:
    """Follow the light at one point of the surface: shadow, refraction, landing, what is lost on the way."""
    lit = make_lit(spec)
    wet = make_wet(spec)
    land = make_land(spec)
    shore = spec.shore
    faces_away = spec.faces_away
    past_bounds = spec.declared and not spec.faces_away  # no part should face away, and one may
    shades = spec.self_shadow or spec.shore or spec.occluders

    @wp.func
    def photon(scene: Scene, sun: wp.vec3, at: wp.vec2, z: wp.vec3) -> Photon:
        """``z`` is the water's displacement and slope at the point ``at``."""
        origin = wp.vec3(at[0], at[1], z[0])
        slope = wp.vec2(z[1], z[2])
        point = wp.vec2(0.0, 0.0)
        incident = facing(sun, slope)
        result = land(scene, sun, origin, slope, incident)
        if wp.static(past_bounds):
            if incident <= 0.0:
                result.state = LOST
                result.incident = -sun[2]
                result.transmitted = -sun[2]
        if result.state == LOST:
            return result
        if wp.static(shades):
            if lit(scene, sun, origin, slope, point) < 0.5:
                result.state = BLOCKED
        if wp.static(faces_away):
            if incident <= 0.0:
                result.state = UNLIT
        if wp.static(shore):
            if wet(scene.receiver, origin, slope, point) < 0.5:
                result.state = DRY
        return result

    return photon
