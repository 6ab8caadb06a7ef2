"""Views: world to pixels and back, for a parallel light and a perspective eye by the same arithmetic.

A point becomes homogeneous pixels (X, Y, Z): X / w and Y / w are its column and row, with pixel centres at
half-integers, and Z [m] is its depth along the view direction. For an eye w is Z, for a parallel light w is 1.
"""

import warp as wp


@wp.struct
class View:
    """World [m, relative to the origin of the triangles] to homogeneous pixels."""

    matrix: wp.mat33d
    offset: wp.vec3d
    inverse: wp.mat33d
    w_of_depth: float  # w = w_of_depth Z + w_constant: (1, 0) for an eye, (0, 1) for a parallel light
    w_constant: float
    near: float  # what lies before this depth [m] is cut off


@wp.func
def homogeneous_w(view: View, depth: float) -> float:
    """Divisor of X and Y at this depth [m]."""
    return view.w_of_depth * depth + view.w_constant


@wp.func
def project(view: View, point: wp.vec3) -> wp.vec3:
    """Homogeneous pixels (X, Y, Z) of a point [m]; in float64 inside, since the terms cancel."""
    return wp.vec3(view.matrix * wp.vec3d(point) + view.offset)


@wp.func
def unproject(view: View, column: float, row: float, depth: float) -> wp.vec3:
    """Point [m] that a pixel position (a pixel's centre: its index + 0.5) sees at this depth [m]."""
    w = homogeneous_w(view, depth)
    pixels = wp.vec3d(wp.float64(column) * wp.float64(w), wp.float64(row) * wp.float64(w), wp.float64(depth))
    return wp.vec3(view.inverse * (pixels - view.offset))
