"""The frustum: which triangles a picture can see, cut at the near plane and at a guard band around the picture.

What is left has corners with w > 0 that fit the integers of `kernels/rasterize.py`, however large the triangle was.
"""

import warp as wp

from .views import View, homogeneous_w

GUARD = wp.constant(32768.0)  # [pixels] triangles are cut this far from pixel (0, 0); twice the largest picture
CLIP_PLANES = wp.constant(5)  # near, and the four sides of the guard band
MAX_CORNERS = wp.constant(8)  # of a triangle cut by five planes

Polygon = wp.types.matrix(shape=(8, 3), dtype=wp.float32)  # corners (X, Y, Z) in homogeneous pixels


@wp.func
def outside_code(view: View, corner: wp.vec3, columns: float, rows: float) -> int:
    """Bits: left of, right of, below, above the picture (0 to 3), before the near plane (4), off the guard band (5)."""
    w = homogeneous_w(view, corner[2])
    code = int(0)
    if corner[0] < 0.0:
        code |= 1
    if corner[0] > columns * w:
        code |= 2
    if corner[1] < 0.0:
        code |= 4
    if corner[1] > rows * w:
        code |= 8
    if corner[2] < view.near:
        code |= 16
    if wp.abs(corner[0]) > GUARD * w or wp.abs(corner[1]) > GUARD * w:
        code |= 32
    return code


@wp.func
def inside_distance(view: View, corner: wp.vec3, plane: int) -> wp.float64:
    """How far inside a clip plane a corner lies, in any unit; in float64, since what is left is a small difference."""
    c = wp.vec3d(corner)
    w = wp.float64(view.w_of_depth) * c[2] + wp.float64(view.w_constant)
    if plane == 0:
        return c[2] - wp.float64(view.near)
    reach = wp.float64(GUARD) * w
    if plane == 1:
        return reach + c[0]
    if plane == 2:
        return reach - c[0]
    if plane == 3:
        return reach + c[1]
    return reach - c[1]


@wp.func
def clip(view: View, polygon: Polygon, count: int, plane: int):
    """Sutherland and Hodgman's clip of a polygon against one plane: corners and their count.

    The cut of an edge is taken from its inner end to its outer one, whichever way the polygon runs, so that two
    triangles that share the edge cut it at the same point.
    """
    kept = Polygon()
    n = int(0)
    if count > 0:
        before = polygon[count - 1]
        depth_before = inside_distance(view, before, plane)
        for i in range(count):
            here = polygon[i]
            depth = inside_distance(view, here, plane)
            if (depth >= wp.float64(0.0)) != (depth_before >= wp.float64(0.0)) and n < MAX_CORNERS:
                inner = wp.vec3d(here)
                outer = wp.vec3d(before)
                t = depth / (depth - depth_before)
                if depth < wp.float64(0.0):
                    inner = wp.vec3d(before)
                    outer = wp.vec3d(here)
                    t = depth_before / (depth_before - depth)
                kept[n] = wp.vec3(inner + t * (outer - inner))
                n += 1
            if depth >= wp.float64(0.0) and n < MAX_CORNERS:
                kept[n] = here
                n += 1
            before = here
            depth_before = depth
    return kept, n


@wp.func
def visible_polygon(view: View, a: wp.vec3, b: wp.vec3, c: wp.vec3, columns: int, rows: int):
    """Cut a triangle to the near plane and the guard band: corners and their count, 0 if nothing is left."""
    polygon = Polygon()
    count = int(0)
    code_a = outside_code(view, a, float(columns), float(rows))
    code_b = outside_code(view, b, float(columns), float(rows))
    code_c = outside_code(view, c, float(columns), float(rows))
    if (code_a & code_b & code_c & 31) == 0:  # not wholly off one side, nor before the near plane
        polygon[0] = a
        polygon[1] = b
        polygon[2] = c
        count = 3
        if ((code_a | code_b | code_c) & 48) != 0:
            for plane in range(CLIP_PLANES):
                polygon, count = clip(view, polygon, count, plane)
    return polygon, count
