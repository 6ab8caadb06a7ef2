"""Filters of an eye's picture: a plain blur, and a joint bilateral one guided by the depth and normal that are seen.

The bilateral filter (Petschnigg et al. 2004, *Digital photography with flash and no-flash image pairs*) averages a
pixel with neighbours that lie on its own surface alone, so that no light leaks over an edge. Neither keeps the sum of
the light to the last digit: a pixel's irradiance is averaged with others', whatever area each of them sees.
"""

import functools

import warp as wp

from .views import View, unproject

SIGMAS = 2.0
"""Standard deviations in the filter's radius: what lies beyond is less than a fifth of the middle's weight."""

NORMAL_POWER = 32.0
"""Sharpness with which another normal is refused: a turn of 12 degrees halves the weight."""


@functools.cache
def make_filter(guided: bool, colours: int) -> wp.Kernel:
    """Average each pixel with those around it; ``guided`` makes it joint bilateral."""

    @wp.kernel(module="unique", enable_backward=False)
    def filter_picture(
        # In:
        begin: int,
        picture: wp.array[float],
        eye_view: wp.array[View],
        eye_depth: wp.array2d[float],
        eye_normal: wp.array2d[wp.vec3],
        eye_plane: wp.array2d[wp.vec4],
        radius: int,
        # Out:
        screen_map_out: wp.array[float],
    ):
        """One thread a pixel; launch dims (rows, columns). ``radius`` in pixels; what sees nothing stays dark."""
        row, column = wp.tid()
        row += begin
        rows = eye_depth.shape[0]
        columns = eye_depth.shape[1]
        total = float(0.0)
        sums = wp.vec3(0.0, 0.0, 0.0)
        if wp.isfinite(eye_depth[row, column]):
            plane = eye_plane[row, column]
            normal = eye_normal[row, column]
            per_sigma = wp.static(SIGMAS) / float(wp.max(radius, 1))
            for j in range(wp.max(row - radius, 0), wp.min(row + radius, rows - 1) + 1):
                for i in range(wp.max(column - radius, 0), wp.min(column + radius, columns - 1) + 1):
                    depth = eye_depth[j, i]
                    if wp.isfinite(depth):
                        weight = float(1.0)
                        if wp.static(guided):
                            away = float((j - row) * (j - row) + (i - column) * (i - column)) * per_sigma * per_sigma
                            p = unproject(eye_view[0], float(i) + 0.5, float(j) + 0.5, depth)
                            off = plane[0] * p[0] + plane[1] * p[1] + plane[2] * p[2] - plane[3]
                            alike = wp.max(wp.dot(normal, eye_normal[j, i]), 0.0)
                            weight = wp.exp(-0.5 * (away + off * off)) * wp.pow(alike, wp.static(NORMAL_POWER))
                        total += weight
                        for c in range(wp.static(colours)):
                            sums[c] += weight * picture[(j * columns + i) * wp.static(colours) + c]
        for c in range(wp.static(colours)):
            value = float(0.0)
            if total > 0.0:
                value = sums[c] / total
            screen_map_out[(row * columns + column) * wp.static(colours) + c] = value

    return filter_picture
