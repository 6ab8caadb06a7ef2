"""Lines of sight: where one meets the water, from above or from below, and where the ground."""

import functools

import warp as wp

from .photon import Scene
from .project import NOTHING, Hit, Receiver, make_hit_receiver
from .shade import Appearance, make_water_at, margin
from .spec import Spec

NO_WATER = wp.constant(-1.0)
"""Distance to the water along a ray that does not meet it."""

SIGHT_LIMIT = wp.constant(1024)
"""Steps after which a ray of sight no longer looks for a crest."""

SIGHT_REFINEMENTS = wp.constant(24)
"""Steps of Newton's method, or halvings, inside the step in which a ray met the water; a handful is the rule."""

SIGHT_DIGITS = wp.constant(1.0e-6)
"""Share of its way to which a ray is followed: some roundings of a float32."""

STEP_OF_SIGHT = wp.constant(0.5)
"""Least step, in widths of a pixel at the ray's distance: crests that are narrower than a pixel may be stepped over."""


@functools.cache
def make_meet_water(spec: Spec) -> wp.Function:
    """Meet the water, from above or from below: march to the first change of side, then Newton inside it."""
    water_at = make_water_at(spec)

    @wp.func
    def meet_water(scene: Scene, pixel_angle: float, origin: wp.vec3, direction: wp.vec3) -> float:
        """Return the distance [m], NO_WATER where there is none."""
        water = scene.water
        side = float(1.0)
        if origin[2] < water_at(scene, origin[0], origin[1])[0]:
            side = -1.0
        falling = -side * direction[2]  # how fast the ray comes nearer to the level
        near = wp.max(side * origin[2] - water.amplitude, 0.0)
        if near > 0.0:  # closed form down to the highest crest
            if falling <= 0.0:
                return NO_WATER
            near = near / falling
        p = origin + near * direction
        gap = side * (p[2] - water_at(scene, p[0], p[1])[0])
        if gap <= 0.0:
            return near
        across = wp.sqrt(direction[0] * direction[0] + direction[1] * direction[1])
        closing = water.slope * across + falling
        far = float(near)
        for _ in range(SIGHT_LIMIT):
            if closing <= 0.0 or (falling <= 0.0 and side * p[2] > water.amplitude):
                return NO_WATER
            far = near + wp.max(gap / closing, wp.max(STEP_OF_SIGHT * pixel_angle * near, 1.0e-3 * water.step))
            p = origin + far * direction
            gap = side * (p[2] - water_at(scene, p[0], p[1])[0])
            if gap <= 0.0:
                break
            near = far
        if gap > 0.0:
            return NO_WATER
        t = near
        for _ in range(SIGHT_REFINEMENTS):
            p = origin + t * direction
            z = water_at(scene, p[0], p[1])
            gap = side * (p[2] - z[0])
            if gap > 0.0:
                near = t
            else:
                far = t
            following = t + gap / (side * (z[1] * direction[0] + z[2] * direction[1] - direction[2]))
            if not (following >= near and following <= far):
                following = 0.5 * (near + far)
            closed = wp.abs(following - t) <= SIGHT_DIGITS * far
            t = following
            if closed:
                break
        return t

    return meet_water


@functools.cache
def make_hit_ground(spec: Spec) -> wp.Function:
    """Meet the receiver and its objects; land from a file ends where the file does."""
    hit_receiver = make_hit_receiver(spec)
    ends = spec.receiver == "grid"

    @wp.func
    def hit_ground(receiver: Receiver, look: Appearance, origin: wp.vec3, direction: wp.vec3) -> Hit:
        hit = hit_receiver(receiver, origin, direction)
        if wp.static(ends):
            point = origin + hit.distance * direction
            if margin(wp.vec2(point[0], point[1]), look.land_low, look.land_size) < 0.0:
                hit.part = NOTHING
        return hit

    return hit_ground
