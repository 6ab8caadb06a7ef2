"""Dispersion after the fact: each channel of a picture is moved to where its own index would have sent it.

All channels were refracted as green. Light of channel c that green would have brought to a point lands, at rest, a
step ``d (way_c - way_green)`` away, d being the depth of the water and way the horizontal way by unit depth of a ray
refracted by level water. So a pixel takes channel c from the point that lies one such step back, on the plane that it
sees. This is our own form; it takes no account of the waves, which bend the colours apart as well.
"""

import warp as wp

from .eye_splat import on_screen
from .eye_surface import lies_on
from .views import View, unproject

LEAST_UPRIGHT = wp.constant(
    0.05
)  # z of a normal below which a wall is seen: a step over the ground leads nowhere on it


@wp.func
def dispersed_from(point: wp.vec3, normal: wp.vec3, way: wp.vec2) -> wp.vec3:
    """Point whose green light stands for a channel's at ``point``; ``way`` is the channel's less green's."""
    depth = wp.max(-point[2], 0.0)
    x = -depth * way[0]
    y = -depth * way[1]
    return point + wp.vec3(x, y, -(normal[0] * x + normal[1] * y) / normal[2])


@wp.kernel(enable_backward=False)
def disperse(
    # In:
    begin: int,
    picture: wp.array[float],
    eye_view: wp.array[View],
    eye_depth: wp.array2d[float],
    eye_normal: wp.array2d[wp.vec3],
    eye_plane: wp.array2d[wp.vec4],
    ways: wp.array[wp.vec2],
    # Out:
    screen_map_out: wp.array[float],
):
    """One thread a pixel; launch dims (rows, columns). ``ways`` by channel, less green's; pictures have 3 channels.

    Between pixel centres the picture is bilinear over those that see the same surface; where none does, the pixel keeps
    its own.
    """
    row, column = wp.tid()
    row += begin
    rows = eye_depth.shape[0]
    columns = eye_depth.shape[1]
    pixel = row * columns + column
    depth = eye_depth[row, column]
    normal = eye_normal[row, column]
    moved = wp.isfinite(depth) and wp.abs(normal[2]) > LEAST_UPRIGHT
    point = wp.vec3(0.0, 0.0, 0.0)
    if moved:
        point = unproject(eye_view[0], float(column) + 0.5, float(row) + 0.5, depth)
    for c in range(3):
        value = picture[pixel * 3 + c]
        if moved and wp.length_sq(ways[c]) > 0.0:
            source = dispersed_from(point, normal, ways[c])
            at = on_screen(eye_view[0], source)
            inside = at[2] > 0.0 and at[0] > 0.0 and at[0] < float(columns) and at[1] > 0.0 and at[1] < float(rows)
            if inside:
                x = at[0] - 0.5
                y = at[1] - 0.5
                left = int(wp.floor(x))
                low = int(wp.floor(y))
                total = float(0.0)
                light = float(0.0)
                for j in range(2):
                    for i in range(2):
                        u = wp.clamp(left + i, 0, columns - 1)
                        v = wp.clamp(low + j, 0, rows - 1)
                        weight = wp.abs(1.0 - float(i) - (x - float(left))) * wp.abs(1.0 - float(j) - (y - float(low)))
                        if lies_on(eye_plane[v, u], source, normal):
                            total += weight
                            light += weight * picture[(v * columns + u) * 3 + c]
                if total > 0.0:
                    value = light / total
        screen_map_out[pixel * 3 + c] = value
