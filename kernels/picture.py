"""The picture: a ray of sight for each sample of a pixel, bent at the water, to the ground that it sees."""

import functools

import warp as wp

from .ground import make_ground_radiance
from .optics import refract
from .photon import Scene
from .project import NOTHING
from .published_picture import make_see_published
from .shade import (
    Appearance,
    PictureSpec,
    make_water_at,
    reflectance,
    sky_radiance,
    way_glow,
    way_left,
)
from .sight import NO_WATER, make_hit_ground, make_meet_water
from .views import View, unproject

LEGS = wp.constant(2)
"""Parts of a line of sight: to the water, and from there to the ground."""

LEAST_FACING = wp.constant(1.0e-3)
"""Least cosine between a line of sight and the ground's normal, so that a footprint is finite."""

LEAST_RISE = wp.constant(0.02)
"""Least height of a direction that was mirrored: steep waves far away would mirror rays into the water again."""


@functools.cache
def make_see(spec: PictureSpec) -> wp.Function:
    """Radiance along one line of sight: to the ground, the sky, or the water and on from there."""
    water_at = make_water_at(spec.scene)
    meet_water = make_meet_water(spec.scene)
    hit_ground = make_hit_ground(spec.scene)
    ground_radiance = make_ground_radiance(spec)
    straight = spec.screen

    @wp.func
    def slope_change(scene: Scene, at: wp.vec3, sight: wp.vec3, water: wp.vec3, length: float) -> float:
        """How much the water's slope changes over the length that one pixel covers of it."""
        ahead = length * wp.normalize(wp.vec2(sight[0], sight[1]))
        other = water_at(scene, at[0] + ahead[0], at[1] + ahead[1])
        return wp.length(wp.vec2(other[1] - water[1], other[2] - water[2]))

    @wp.func
    def see(
        scene: Scene,
        look: Appearance,
        light: wp.array2d[wp.vec3],
        surroundings: wp.array2d[wp.vec3],
        pixel: wp.vec2i,
        direction: wp.vec3,
    ) -> wp.vec3:
        """``pixel`` (column, row) is where a camera's own map is read."""
        wet = bool(look.eye[2] < water_at(scene, look.eye[0], look.eye[1])[0])
        origin = look.eye
        sight = direction
        seen = wp.vec3(0.0, 0.0, 0.0)
        weight = wp.vec3(1.0, 1.0, 1.0)  # of what lies ahead
        width = float(0.0)  # of what a pixel covers, across the line of sight [m]
        spread = look.pixel_angle  # by which it grows with the way
        mirrored_once = bool(False)
        legs = int(LEGS)  # a variable, so that the loop is not unrolled
        for leg in range(legs):
            hit = hit_ground(scene.receiver, look, origin, sight)
            way = float(NO_WATER)
            if leg == 0:  # what was bent or mirrored goes on to the ground
                way = meet_water(scene, look.pixel_angle, origin, sight)
            on_ground = hit.part != NOTHING and (way < 0.0 or hit.distance < way)
            if not on_ground and way < 0.0:
                if wet:
                    seen += wp.cw_mul(weight, look.veil)
                else:
                    seen += wp.cw_mul(weight, sky_radiance(look, sight))
                break
            distance = way
            if on_ground:
                distance = hit.distance
            left = way_left(look, wet, distance)
            seen += wp.cw_mul(weight, wp.cw_mul(wp.vec3(1.0, 1.0, 1.0) - left, way_glow(look, wet)))
            weight = wp.cw_mul(weight, left)
            origin += distance * sight
            width += spread * distance
            if on_ground:
                footprint = width / wp.max(wp.abs(wp.dot(sight, wp.normalize(hit.normal))), LEAST_FACING)
                if wp.dot(hit.normal, sight) > 0.0:  # a mesh's normals point upwards, wherever it is seen from
                    hit.normal = -hit.normal
                ground = ground_radiance(
                    scene, look, light, surroundings, pixel, not mirrored_once, footprint, origin, hit
                )
                seen += wp.cw_mul(weight, ground)
                break
            water = water_at(scene, origin[0], origin[1])
            normal = wp.normalize(wp.vec3(-water[1], -water[2], 1.0))
            eta = scene.medium.eta
            if wet:
                normal = -normal
                eta = scene.medium.ior
            turn = slope_change(scene, origin, sight, water, width / wp.max(-wp.dot(sight, normal), LEAST_FACING))
            mirror = reflectance(sight, normal, eta)
            mirrored = sight - 2.0 * wp.dot(sight, normal) * normal
            bent = refract(sight, normal, eta)
            # Radiance over the square of the index is what refraction keeps.
            through = (1.0 - mirror) * eta * eta
            if wet:
                if mirror < 1.0:
                    seen += through * wp.cw_mul(weight, sky_radiance(look, bent))
                weight *= mirror
                mirrored_once = True
                spread += 2.0 * turn  # a mirror turns a line of sight by twice its own turn
                mirrored[2] = wp.min(mirrored[2], -LEAST_RISE)
                sight = wp.normalize(mirrored)
            else:
                mirrored[2] = wp.max(mirrored[2], LEAST_RISE)
                seen += mirror * wp.cw_mul(weight, sky_radiance(look, wp.normalize(mirrored)))
                weight *= through
                spread += (1.0 - eta) * turn  # refraction, by so much where it is steep
                if wp.static(not straight):
                    sight = bent
            wet = True
        return seen

    return see


@functools.cache
def make_picture(spec: PictureSpec) -> wp.Kernel:
    """Build the kernel of a picture's pixels."""
    see = make_see_published(spec) if spec.published else make_see(spec)

    @wp.kernel(module="unique", enable_backward=False)
    def picture(
        # In:
        begin: int,
        scene: Scene,
        view: wp.array[View],
        appearance: Appearance,
        light: wp.array2d[wp.vec3],
        surroundings: wp.array2d[wp.vec3],
        side: int,
        # Out:
        picture_out: wp.array2d[wp.vec3],
    ):
        """One thread a pixel, from row ``begin``; launch dims (rows, columns); the mean of ``side`` x ``side`` rays."""
        row, column = wp.tid()
        row += begin
        total = wp.vec3(0.0, 0.0, 0.0)
        for j in range(side):
            for i in range(side):
                x = float(column) + (float(i) + 0.5) / float(side)
                y = float(row) + (float(j) + 0.5) / float(side)
                direction = wp.normalize(unproject(view[0], x, y, 1.0) - appearance.eye)
                total += see(scene, appearance, light, surroundings, wp.vec2i(column, row), direction)
        picture_out[row, column] = total / float(side * side)

    return picture
