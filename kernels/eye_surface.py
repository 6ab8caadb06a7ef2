"""What each pixel of an eye sees of the receiver, in the form in which photons are tested and weighed against it.

A pixel sees a small plane. A photon lights it if it lands on that plane, within a tolerance: the occlusion test of
Bäcklund's thesis (photons are compared with the eye's depth), freed of the slope at which the eye looks. What the
pixel receives is divided by the receiver area that it sees, ``distance^2 dOmega / |N . V|``.
"""

import warp as wp

from .views import View, unproject

LEAST_COSINE = wp.constant(1.0e-4)  # a surface seen on edge: what its pixel gets has no area to be spread over
ALIKE = wp.constant(0.5)  # squared cosine of normals that are one surface's: edges sharper than 45 degrees part two
NOWHERE = wp.constant(1.0e30)


@wp.func
def focal_squared(view: View) -> float:
    """Square of the focal length [pixels^2]: what the view scales areas by, its axes being of length 1."""
    return float(wp.abs(wp.determinant(view.matrix)))


@wp.func
def pixel_ray(view: View, column: float, row: float) -> wp.vec3:
    """Way from the eye through a pixel position, of depth 1."""
    return wp.vec3(view.inverse * wp.vec3d(wp.float64(column), wp.float64(row), wp.float64(1.0)))


@wp.kernel(enable_backward=False)
def eye_surface(
    # In:
    begin: int,
    eye_view: wp.array[View],
    eye_depth: wp.array2d[float],
    eye_normal: wp.array2d[wp.vec3],
    tolerance: wp.vec2,
    # Out:
    eye_plane_out: wp.array2d[wp.vec4],
    eye_area_out: wp.array2d[float],
):
    """One thread a pixel; launch dims (rows, columns).

    ``eye_plane_out`` is (n, n . p) with n the normal over the tolerance: ``|n . x - w| <= 1`` accepts a point x.
    ``eye_area_out`` is the receiver area that the pixel sees [m^2], 0 where it sees none. ``tolerance`` is in metres
    and in footprints of the pixel, which are added up.
    """
    row, column = wp.tid()
    row += begin
    depth = eye_depth[row, column]
    normal = eye_normal[row, column]
    plane = wp.vec4(0.0, 0.0, 0.0, NOWHERE)
    area = float(0.0)
    if wp.isfinite(depth) and wp.length_sq(normal) > 0.0:
        view = eye_view[0]
        x = float(column) + 0.5
        y = float(row) + 0.5
        footprint = depth * depth / focal_squared(view)
        area = footprint / wp.max(wp.abs(wp.dot(normal, pixel_ray(view, x, y))), LEAST_COSINE)
        normal = normal / (tolerance[0] + tolerance[1] * wp.sqrt(footprint))
        point = unproject(view, x, y, depth)
        plane = wp.vec4(normal[0], normal[1], normal[2], wp.dot(normal, point))
    eye_plane_out[row, column] = plane
    eye_area_out[row, column] = area


@wp.func
def lies_on(plane: wp.vec4, point: wp.vec3, normal: wp.vec3) -> bool:
    """Tell whether a point [m] lies on what a pixel sees, within its tolerance, and on a side that is turned alike.

    Without the normal, of any length, light of a floor would climb a wall by the tolerance; a zero one asks nothing.
    """
    if wp.abs(plane[0] * point[0] + plane[1] * point[1] + plane[2] * point[2] - plane[3]) > 1.0:
        return False
    seen = wp.vec3(plane[0], plane[1], plane[2])
    along = wp.dot(seen, normal)
    return along * along >= ALIKE * wp.length_sq(seen) * wp.length_sq(normal)
