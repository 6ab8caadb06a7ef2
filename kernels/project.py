"""Where a ray lands: a plane in closed form, a height field by march and bisection, a mesh by BVH, and Eq. 3.3.

Also what stands in its way: the march that tells how nearly a ray clears a height field.
"""

import functools

import warp as wp

from .spec import Spec
from .surface import HEIGHT_AND_SLOPE, Surface

NOTHING = wp.constant(0)
GROUND = wp.constant(1)  # the plane, terrain or mesh that is the receiver
OBJECT = wp.constant(2)  # what stands on it

MARCH_LIMIT = wp.constant(4096)
"""Steps after which a march gives up. The host sets the smallest step so that a ray needs fewer."""

BISECTION_LIMIT = wp.constant(40)
"""Halvings of a bracket: more than the 24 bits of a float32 can tell apart; Newton needs a handful."""

FAR = wp.constant(1.0e30)
"""A clearance or a distance that nothing reaches."""


@wp.struct
class Receiver:
    """What lies under the water, relative to its rest level."""

    level: float  # z of the plane [m]
    terrain: Surface
    lowest: float  # no ground below this z [m]
    highest: float  # no ground above this z [m]
    slope: float  # bound of the terrain's slope
    step: float  # smallest step of the march [m]
    mesh: wp.uint64
    objects: wp.uint64
    reach: float  # longest ray [m]


@wp.struct
class Hit:
    """Where a ray meets the receiver."""

    part: int
    distance: float  # along the ray [m]
    normal: wp.vec3  # of the receiver there, upwards, not normalised


@wp.func
def hit_plane(level: float, origin: wp.vec3, direction: wp.vec3) -> Hit:
    """Meet the plane z = level, in closed form."""
    hit = Hit()
    if direction[2] < 0.0:
        hit.part = GROUND
        hit.distance = wp.max((origin[2] - level) / -direction[2], 0.0)
        hit.normal = wp.vec3(0.0, 0.0, 1.0)
    return hit


@wp.func
def hit_mesh(mesh: wp.uint64, origin: wp.vec3, direction: wp.vec3, reach: float, part: int) -> Hit:
    """Meet a mesh, by Warp's BVH."""
    hit = Hit()
    query = wp.mesh_query_ray(mesh, origin, direction, reach)
    if query.result:
        hit.part = part
        hit.distance = query.t
        hit.normal = query.normal
        if query.normal[2] < 0.0:
            hit.normal = -query.normal
    return hit


@functools.cache
def make_hit_height_field(kind: str) -> wp.Function:
    """Meet a height field: a march that cannot step over it, then Newton's method inside a bisected bracket."""
    surface_at = HEIGHT_AND_SLOPE[kind]

    @wp.func
    def hit_height_field(receiver: Receiver, origin: wp.vec3, direction: wp.vec3) -> Hit:
        hit = Hit()
        across = wp.sqrt(direction[0] * direction[0] + direction[1] * direction[1])
        closing = receiver.slope * across - direction[2]  # how fast the gap can close, at most
        gap = origin[2] - surface_at(receiver.terrain, origin[0], origin[1])[0]
        near = float(0.0)
        far = float(0.0)
        if direction[2] < 0.0 and gap > 0.0:
            for _ in range(MARCH_LIMIT):
                far = near + wp.max(gap / closing, receiver.step)
                p = origin + far * direction
                gap = p[2] - surface_at(receiver.terrain, p[0], p[1])[0]
                if gap <= 0.0:
                    break
                near = far
        if gap <= 0.0:
            t = near
            for _ in range(BISECTION_LIMIT):
                p = origin + t * direction
                z = surface_at(receiver.terrain, p[0], p[1])
                gap = p[2] - z[0]
                if gap > 0.0:
                    near = t
                else:
                    far = t
                hit.normal = wp.vec3(-z[1], -z[2], 1.0)
                step = gap / (z[1] * direction[0] + z[2] * direction[1] - direction[2])
                following = t + step
                if not (following >= near and following <= far):
                    following = 0.5 * (near + far)
                if wp.abs(following - t) <= 1.0e-7 * far:
                    break
                t = following
            hit.part = GROUND
            hit.distance = t
        return hit

    return hit_height_field


@functools.cache
def make_hit_receiver(spec: Spec) -> wp.Function:
    """Meet the receiver of this scene, and the objects on it where there are any."""
    kind = spec.receiver
    objects = spec.objects
    hit_height_field = make_hit_height_field(kind if kind in HEIGHT_AND_SLOPE else "waves")

    @wp.func
    def hit_receiver(receiver: Receiver, origin: wp.vec3, direction: wp.vec3) -> Hit:
        if wp.static(kind == "plane"):
            hit = hit_plane(receiver.level, origin, direction)
        elif wp.static(kind == "mesh"):
            hit = hit_mesh(receiver.mesh, origin, direction, receiver.reach, GROUND)
        else:
            hit = hit_height_field(receiver, origin, direction)
        if wp.static(objects):
            other = hit_mesh(receiver.objects, origin, direction, receiver.reach, OBJECT)
            if other.part != NOTHING and (hit.part == NOTHING or other.distance < hit.distance):
                hit = other
        return hit

    return hit_receiver


@wp.func
def project_backlund(water: wp.vec3, terrain: wp.vec3, refracted: wp.vec3) -> wp.vec3:
    """Bäcklund's Eq. 3.3 as published: the way from water to terrain, projected on the refracted direction.

    In a light view both points lie on one unrefracted ray, so the estimate is too long but for a sun at the zenith.
    """
    return water + wp.dot(terrain - water, refracted) / wp.dot(refracted, refracted) * refracted


@functools.cache
def make_clearance(kind: str) -> wp.Function:
    """How nearly a ray clears a height field of this kind, and where."""
    surface_at = HEIGHT_AND_SLOPE[kind]

    @wp.func
    def clearance(
        surface: Surface, origin: wp.vec3, direction: wp.vec3, side: float, slope: float, bound: float, step: float
    ) -> wp.vec2:
        """Return (clearance [m], distance of the closest approach [m]).

        ``side`` is +1 for a ray that must stay above the surface, -1 below it. The march ends where ``side * z``
        passes ``bound``, beyond which there is no surface. A ray that starts on the surface and moves off it is not
        near it until the gap has begun to close again; FAR says that it never did.
        """
        across = wp.sqrt(direction[0] * direction[0] + direction[1] * direction[1])
        closing = wp.max(slope * across - side * direction[2], 1.0e-6)
        least = FAR
        at = float(0.0)
        t = float(0.0)
        gap = side * (origin[2] - surface_at(surface, origin[0], origin[1])[0])
        for _ in range(MARCH_LIMIT):
            t += wp.max(wp.abs(gap) / closing, step)
            p = origin + t * direction
            if side * p[2] > bound:
                break
            following = side * (p[2] - surface_at(surface, p[0], p[1])[0])
            if following < gap and following < least:
                least = following
                at = t
            gap = following
        return wp.vec2(least, at)

    return clearance
