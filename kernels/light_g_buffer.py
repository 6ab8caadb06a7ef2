"""G-buffers of a light view: the water, or the ground, as a lattice of triangles, and what each texel stores of it.

The lattice's corners lie on the texel grid, seen along the light, of a level plane; each is then lifted upright to its
height. A grid that is fixed in the world makes a lattice that is fixed in the world, so that a view which moves by
whole texels sees the same triangles again (Bäcklund's thesis, 3.2 and 3.3).
"""

import functools

import warp as wp

from .g_buffer import mixed_normal
from .packing import NORMAL_STORAGE, PACK
from .photon import Scene
from .surface import HEIGHT_AND_SLOPE
from .views import View, unproject
from .visibility import EMPTY, key_depth, key_triangle

POSITION_STORAGE = {"depth": wp.float32, "float3": wp.vec3}
"""Element of a buffer of positions, by how they are stored."""


@wp.func
def along_light(view: View, column: float, row: float, level: float) -> wp.vec3:
    """Where the ray of light through a texel position meets the plane z = ``level``."""
    start = unproject(view, column, row, 0.0)
    way = unproject(view, column, row, 1.0) - start
    return start + (level - start[2]) / way[2] * way


@functools.cache
def make_light_lattice(kind: str, ground: bool) -> wp.Kernel:
    """Place the corners of the lattice; ``kind`` is the surface's, ``ground`` says that it is the receiver.

    The normals of the corners are those of the surface itself, and only the water's are wanted.
    """
    surface_at = HEIGHT_AND_SLOPE[kind]

    @wp.kernel(module="unique", enable_backward=False)
    def light_lattice(
        # In:
        begin: int,
        scene: Scene,
        light_view: wp.array[View],
        cell: int,
        margin: wp.vec2i,
        columns: int,
        level: float,
        # Out:
        vertices_out: wp.array[wp.vec3],
        normals_out: wp.array[wp.vec3],
    ):
        """One thread a corner, row by row; launch dim (rows, columns) of corners.

        ``cell`` and ``margin`` are in texels: corner (0, 0) is seen ``margin`` before the first texel. ``level`` [m]
        is the plane on which the corners lie on the texel grid.
        """
        row, column = wp.tid()
        row += begin
        i = row * columns + column
        texel_column = float(column * cell - margin[0])
        texel_row = float(row * cell - margin[1])
        at = along_light(light_view[0], texel_column, texel_row, level)
        if wp.static(ground):
            z = surface_at(scene.receiver.terrain, at[0], at[1])
            vertices_out[i] = wp.vec3(at[0], at[1], z[0])
        else:
            z = surface_at(scene.water.surface, at[0], at[1])
            vertices_out[i] = wp.vec3(at[0], at[1], z[0])
            normals_out[i] = wp.normalize(wp.vec3(-z[1], -z[2], 1.0))

    return light_lattice


@functools.cache
def make_store_texel(positions: str, storage: str) -> wp.Kernel:
    """Resolve the visibility buffer of a light view; a ``storage`` of normals of "none" stores none."""
    position_type = POSITION_STORAGE[positions]
    normal_type = NORMAL_STORAGE[storage if storage in NORMAL_STORAGE else "float3"]
    pack = PACK[storage if storage in PACK else "float3"]

    @wp.kernel(module="unique", enable_backward=False)
    def store_texel(
        # In:
        begin: int,
        light_view: wp.array[View],
        visibility: wp.array2d[wp.uint64],
        triangles: wp.array[wp.vec3i],
        screen: wp.array[wp.vec3],
        normals: wp.array[wp.vec3],
        # Out:
        position_out: wp.array2d[position_type],
        normal_out: wp.array2d[normal_type],
    ):
        """One thread a texel; launch dim (rows, columns). Where nothing is seen, the position is infinite."""
        row, column = wp.tid()
        row += begin
        key = visibility[row, column]
        seen = key != wp.uint64(wp.static(EMPTY))
        depth = wp.inf
        if seen:
            depth = key_depth(key)
        if wp.static(positions == "depth"):
            position_out[row, column] = depth
        else:
            point = wp.vec3(wp.inf, wp.inf, wp.inf)
            if seen:
                point = unproject(light_view[0], float(column) + 0.5, float(row) + 0.5, depth)
            position_out[row, column] = point
        if wp.static(storage != "none"):
            if seen:
                corners = triangles[key_triangle(key)]
                i = corners[0]
                j = corners[1]
                k = corners[2]
                rows = wp.matrix_from_rows(normals[i], normals[j], normals[k])
                normal = mixed_normal(
                    light_view[0], screen[i], screen[j], screen[k], rows, float(column) + 0.5, float(row) + 0.5
                )
                normal_out[row, column] = pack(normal)

    return store_texel


@functools.cache
def make_texel_position(positions: str) -> wp.Function:
    """Position that a texel holds [m]; not finite where nothing is seen. From depth as in the thesis's 3.3.1."""
    position_type = POSITION_STORAGE[positions]

    @wp.func
    def texel_position(view: View, position: wp.array2d[position_type], column: int, row: int) -> wp.vec3:
        if wp.static(positions == "depth"):
            return unproject(view, float(column) + 0.5, float(row) + 0.5, position[row, column])
        else:
            return position[row, column]

    return texel_position
