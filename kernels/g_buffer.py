"""G-buffers: what each pixel of a visibility buffer sees, and the lattice of a height field as vertices.

Bäcklund's thesis (3.3) captures positions and normals of the water and positions of the terrain in the light view. As
its 3.3.1 proposes, positions are held as depths, and `unproject` gives them back.
"""

import functools
from dataclasses import dataclass

import warp as wp

from .views import View, homogeneous_w
from .visibility import EMPTY, key_depth, key_triangle


@dataclass(frozen=True)
class Resolve:
    """Which G-buffers are asked for; the code of the others is not generated.

    Attributes
    ----------
    depth : bool
        Depth along the view direction.
    normal : str
        ``"none"``, ``"face"`` (of the triangle's plane) or ``"vertex"`` (interpolated between its corners' normals).
    id : bool
        Index of the triangle.
    """

    depth: bool = True
    normal: str = "none"
    id: bool = True


@wp.func
def face_normal(a: wp.vec3, b: wp.vec3, c: wp.vec3) -> wp.vec3:
    """Take a triangle's unit normal, to the side that sees it run anticlockwise; zero for a degenerate one."""
    return wp.normalize(wp.cross(b - a, c - a))


@wp.func
def toward_pixel(view: View, corner: wp.vec3, column: float, row: float) -> wp.vec2:
    """Homogeneous pixels of a corner with the pixel position moved to zero."""
    w = homogeneous_w(view, corner[2])
    return wp.vec2(corner[0] - column * w, corner[1] - row * w)


@wp.func
def barycentric(view: View, a: wp.vec3, b: wp.vec3, c: wp.vec3, column: float, row: float) -> wp.vec3:
    """Perspective-correct weights of a triangle's corners at a pixel position.

    The homogeneous edge functions (Olano and Greer 1997, 2D homogeneous rendering) hold for corners behind the eye too.
    Weights that rounding takes below zero at an edge are set to zero, so that the sum never leaves the triangle.
    """
    pa = toward_pixel(view, a, column, row)
    pb = toward_pixel(view, b, column, row)
    pc = toward_pixel(view, c, column, row)
    share = wp.vec3(pb[0] * pc[1] - pb[1] * pc[0], pc[0] * pa[1] - pc[1] * pa[0], pa[0] * pb[1] - pa[1] * pb[0])
    if share[0] + share[1] + share[2] < 0.0:
        share = -share
    share = wp.max(share, wp.vec3(0.0))
    total = share[0] + share[1] + share[2]
    if not total > 0.0:
        return wp.vec3(1.0 / 3.0)  # edge-on
    return share / total


@wp.func
def mixed_normal(view: View, a: wp.vec3, b: wp.vec3, c: wp.vec3, normals: wp.mat33, column: float, row: float):
    """Interpolate the unit normal at a pixel position, between the normals of the corners (rows of ``normals``)."""
    return wp.normalize(wp.transpose(normals) * barycentric(view, a, b, c, column, row))


@functools.cache
def resolve_kernel(spec: Resolve) -> wp.Kernel:
    """Kernel that resolves a visibility buffer into the G-buffers of ``spec``."""

    @wp.kernel(module="unique", enable_backward=False)
    def resolve_g_buffer_kernel(
        # In:
        begin: int,
        view: wp.array[View],
        visibility: wp.array2d[wp.uint64],
        triangles: wp.array[wp.vec3i],
        vertices: wp.array[wp.vec3],
        screen: wp.array[wp.vec3],
        normals: wp.array[wp.vec3],
        # Out:
        depth_out: wp.array2d[float],
        normal_out: wp.array2d[wp.vec3],
        id_out: wp.array2d[int],
    ):
        """Resolve one pixel: depth [m], unit normal, triangle; inf, zero, -1 where it sees nothing.

        Launched over (rows, columns). Arrays that ``spec`` does not name are not touched and may be None.
        """
        row, column = wp.tid()
        row += begin
        key = visibility[row, column]
        seen = key != wp.uint64(wp.static(EMPTY))
        id = key_triangle(key)
        if wp.static(spec.depth):
            depth = wp.inf
            if seen:
                depth = key_depth(key)
            depth_out[row, column] = depth
        if wp.static(spec.normal != "none"):
            normal = wp.vec3(0.0)
            if seen:
                corners = triangles[id]
                i = corners[0]
                j = corners[1]
                k = corners[2]
                if wp.static(spec.normal == "face"):
                    normal = face_normal(vertices[i], vertices[j], vertices[k])
                else:
                    rows = wp.matrix_from_rows(normals[i], normals[j], normals[k])
                    normal = mixed_normal(
                        view[0], screen[i], screen[j], screen[k], rows, float(column) + 0.5, float(row) + 0.5
                    )
            normal_out[row, column] = normal
        if wp.static(spec.id):
            id_out[row, column] = wp.where(seen, id, -1)

    return resolve_g_buffer_kernel


@wp.kernel(enable_backward=False)
def lift_lattice_kernel(
    # In:
    heights: wp.array2d[float],
    spacing: wp.vec2,
    # Out:
    vertices_out: wp.array[wp.vec3],
):
    """Place one corner of a lattice: `heights` [m] over a grid of this `spacing` [m]. Launched over the heights."""
    row, column = wp.tid()
    i = row * heights.shape[1] + column
    vertices_out[i] = wp.vec3(float(column) * spacing[0], float(row) * spacing[1], heights[row, column])
