"""Where a ray first meets a height field or a mesh, in float64."""

import functools

import warp as wp

from .surface import HeightField, make_field, make_steepness

MARCH_LIMIT = 100000
"""Steps after which a ray is given up, and its light entered as dropped."""

ROOT_LIMIT = 100
"""Steps of the Illinois rule, which needs some ten."""

ROOT_SHARE = 1.0e-14
"""Width of a closed bracket, or a gap, relative to the way: some roundings of float64."""

TINY = 1.0e-12
"""Keeps a rate from being nothing: the step is then without end."""

MISSES = -1.0
"""Distance of a ray that meets nothing."""

LOST = -2.0
"""Distance of a ray that was given up."""


@functools.cache
def make_gap(kind: str) -> wp.Function:
    """How far a point of a ray stands on its side of a height field; side is 1 above, -1 below."""
    field_at = make_field(kind)

    @wp.func
    def gap(field: HeightField, origin: wp.vec3d, ray: wp.vec3d, t: wp.float64, side: wp.float64) -> wp.float64:
        p = origin + t * ray
        return side * (p[2] - field_at(field, p[0], p[1])[0])

    return gap


@functools.cache
def make_meet(kind: str) -> wp.Function:
    """Give the distance at which a ray first meets a height field, MISSES or LOST.

    The ray marches by its gap over the fastest rate at which that can shrink, so that no meeting is stepped over that
    is deeper than the smallest step's sagitta; the Illinois rule closes in.
    """
    gap = make_gap(kind)
    steepness = make_steepness(kind)

    @wp.func
    def meet(
        field: HeightField, origin: wp.vec3d, ray: wp.vec3d, side: wp.float64, bound: wp.float64, end: wp.float64
    ) -> wp.float64:
        """``side`` is that of the field on which the ray runs; it misses past ``end`` or past ``side * z = bound``."""
        across = wp.sqrt(ray[0] * ray[0] + ray[1] * ray[1])
        near = wp.float64(0.0)
        # A ray that starts on the field has no gap there.
        above = wp.max(gap(field, origin, ray, near, side), wp.float64(0.0))
        far = wp.float64(0.0)
        below = wp.float64(0.0)
        tiny = wp.float64(wp.static(TINY))
        result = wp.float64(wp.static(LOST))
        for _ in range(wp.static(MARCH_LIMIT)):
            bound_here = steepness(field, origin[0] + near * ray[0], origin[1] + near * ray[1])
            fastest = wp.max(bound_here[0] * across - side * ray[2], tiny)
            far = near + wp.max(wp.min(above / fastest, bound_here[1] / wp.max(across, tiny)), field.step)
            below = gap(field, origin, ray, far, side)
            if below < wp.float64(0.0):
                result = near
                break
            if near > end or (side * ray[2] > wp.float64(0.0) and side * (origin[2] + near * ray[2]) > bound):
                result = wp.float64(wp.static(MISSES))
                break
            near = far
            above = below
        if result < wp.float64(0.0):
            return result
        # Illinois: the false position, the weight of an end that stays halved.
        for _ in range(wp.static(ROOT_LIMIT)):
            if far - near <= wp.float64(wp.static(ROOT_SHARE)) * far or above <= wp.float64(0.0):
                break
            middle = (near * below - far * above) / (below - above)
            value = gap(field, origin, ray, middle, side)
            if wp.abs(value) <= wp.float64(wp.static(ROOT_SHARE)) * far:
                return middle
            if value > wp.float64(0.0):
                near = middle
                above = value
                below = wp.float64(0.5) * below
            else:
                far = middle
                below = value
                above = wp.float64(0.5) * above
        return wp.float64(0.5) * (near + far)

    return meet


@wp.struct
class Mesh:
    """Triangles: Warp's BVH finds which one a ray meets, float64 says where."""

    id: wp.uint64
    vertices: wp.array[wp.vec3d]
    triangles: wp.array[wp.vec3i]
    reach: float  # longest ray [m]


@wp.func
def to_single(v: wp.vec3d) -> wp.vec3:
    """A vector in float32, for the BVH."""
    return wp.vec3(float(v[0]), float(v[1]), float(v[2]))


@wp.func
def meet_mesh(mesh: Mesh, origin: wp.vec3d, ray: wp.vec3d) -> wp.float64:
    """Distance at which a ray meets a mesh, or MISSES."""
    query = wp.mesh_query_ray(mesh.id, to_single(origin), to_single(ray), mesh.reach)
    if not query.result:
        return wp.float64(wp.static(MISSES))
    corners = mesh.triangles[query.face]
    a = mesh.vertices[corners[0]]
    normal = wp.cross(mesh.vertices[corners[1]] - a, mesh.vertices[corners[2]] - a)
    along = wp.dot(normal, ray)
    if along == wp.float64(0.0):
        return wp.float64(query.t)
    return wp.max(wp.dot(normal, a - origin) / along, wp.float64(0.0))
