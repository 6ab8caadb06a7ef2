"""Direct sunlight on what an eye sees, under water at rest, and what stands in its way.

What a projected pattern is scaled by: the light that a point of the receiver would get if no wave bent it.
"""

import functools

import warp as wp

from .optics import refract_at_slope, transmittance_at_slope
from .photon import Medium, Scene, make_attenuate
from .project import Receiver, make_clearance
from .spec import Spec
from .surface import HEIGHT_AND_SLOPE
from .views import View, unproject

SHADOW_BIAS = wp.constant(1.0e-4)
"""How far from what an eye sees a ray to the sun starts, as a share of its depth: some hundred roundings of float32."""


@wp.func
def towards_eye(view: View, point: wp.vec3, normal: wp.vec3) -> wp.vec3:
    """Turn a normal to the side that an eye sees."""
    eye = -wp.vec3(view.inverse * view.offset)
    if wp.dot(normal, eye - point) < 0.0:
        return -normal
    return normal


@functools.cache
def make_rest_light(fresnel: bool, attenuation: str) -> wp.Function:
    """Give direct sunlight on a surface at a point, by channel and for unit irradiance.

    Under water the sun's beam is as wide as its refraction makes it, |I_z| T / |R_z|, meets the surface at N . -R and
    has gone the refracted way; above, it is N . -I.
    """
    attenuate = make_attenuate(Spec(attenuation=attenuation))

    @wp.func
    def rest_light(medium: Medium, sun: wp.vec3, point: wp.vec3, normal: wp.vec3) -> wp.vec3:
        if point[2] > 0.0:
            dry = wp.max(0.0, -wp.dot(sun, normal))
            return wp.vec3(dry, dry, dry)
        level = wp.vec2(0.0, 0.0)
        below = refract_at_slope(sun, level, medium.eta)
        transmitted = -sun[2]
        if wp.static(fresnel):
            transmitted *= transmittance_at_slope(sun, below, level, medium.ior)
        incident = transmitted / -below[2] * wp.max(0.0, -wp.dot(below, normal))
        return incident * attenuate(medium, point[2] / below[2], below)

    return rest_light


@functools.cache
def make_unshaded(receiver_kind: str, marches: bool, objects: bool) -> wp.Function:
    """Tell whether a ray upwards meets none of the meshes and, where it marches, no hill of the terrain."""
    clear_of_land = make_clearance(receiver_kind if receiver_kind in HEIGHT_AND_SLOPE else "waves")
    mesh = receiver_kind == "mesh"

    @wp.func
    def unshaded(receiver: Receiver, origin: wp.vec3, direction: wp.vec3, top: float, reach: float) -> bool:
        free = bool(True)
        if wp.static(marches):
            near = clear_of_land(receiver.terrain, origin, direction, 1.0, receiver.slope, top, receiver.step)
            if near[0] < 0.0:
                free = False
        if wp.static(mesh):
            if wp.mesh_query_ray_anyhit(receiver.mesh, origin, direction, reach):
                free = False
        if wp.static(objects):
            if wp.mesh_query_ray_anyhit(receiver.objects, origin, direction, reach):
                free = False
        return free

    return unshaded


@functools.cache
def make_shadow(receiver_kind: str, marches: bool, objects: bool) -> wp.Kernel:
    """Test what each pixel sees for shadow: up to the water along the refracted sun, and on to the sun."""
    unshaded = make_unshaded(receiver_kind, marches, objects)

    @wp.kernel(module="unique", enable_backward=False)
    def shadow(
        # In:
        begin: int,
        depth: wp.array2d[float],
        normal: wp.array2d[wp.vec3],
        view: wp.array[View],
        scene: Scene,
        sun: wp.vec3,
        # Out:
        lit_out: wp.array2d[float],
    ):
        """One thread a pixel; launch dims (rows, columns)."""
        row, column = wp.tid()
        row += begin
        far = depth[row, column]
        lit = float(0.0)
        if wp.isfinite(far):
            point = unproject(view[0], float(column) + 0.5, float(row) + 0.5, far)
            origin = point + SHADOW_BIAS * far * towards_eye(view[0], point, normal[row, column])
            land = scene.receiver
            free = bool(True)
            if origin[2] < 0.0:
                below = refract_at_slope(sun, wp.vec2(0.0, 0.0), scene.medium.eta)
                way = origin[2] / below[2]
                free = unshaded(land, origin, -below, wp.min(land.highest, 0.0), way)
                origin = origin - way * below
            if free and unshaded(land, origin, -sun, land.highest, land.reach):
                lit = 1.0
        lit_out[row, column] = lit

    return shadow
