"""A cell of the landed lattice: its bend, its mean flux, and its deposit as triangles on a smooth interpolant.

A cell reads the four by four corners around it: ``planes[plane, row + 1, column + 1]`` is its own first corner.
"""

import functools

import warp as wp

from .coverage import make_deposit_triangle
from .deposit import ACCUMULATOR, FLUX
from .lattice import Lattice
from .spec import Spec

BORDER = 1
"""Corners beyond a strip's cells on each side: the cubic through four corners wants one more."""


def flux_planes(spec: Spec) -> int:
    """Planes of flux that a scene needs: incident, and what differs from it."""
    return 1 + int(spec.fresnel) + (spec.channels if spec.attenuation != "none" else 0)


def arrived_plane(spec: Spec) -> int:
    """First plane of the flux that arrives, the last ``channels`` of all; the incident one if nothing is lost."""
    return 2 + flux_planes(spec) - spec.channels


@wp.func
def stencil_row(planes: wp.array3d[float], plane: int, row: int, column: int) -> wp.vec4:
    """Four neighbouring values of a plane, from the corner before a cell to the one after it."""
    return wp.vec4(
        planes[plane, row, column],
        planes[plane, row, column + 1],
        planes[plane, row, column + 2],
        planes[plane, row, column + 3],
    )


@wp.func
def stencil(planes: wp.array3d[float], plane: int, row: int, column: int, v: wp.vec4) -> wp.vec4:
    """Four rows of a plane weighted and added up: the plane along one line through a cell."""
    return (
        v[0] * stencil_row(planes, plane, row, column)
        + v[1] * stencil_row(planes, plane, row + 1, column)
        + v[2] * stencil_row(planes, plane, row + 2, column)
        + v[3] * stencil_row(planes, plane, row + 3, column)
    )


@wp.func
def catmull_rom(t: float) -> wp.vec4:
    """Weights of the cubic through the middle two of four values whose slopes are central differences."""
    return wp.vec4(
        0.5 * t * ((2.0 - t) * t - 1.0),
        0.5 * (t * t * (3.0 * t - 5.0) + 2.0),
        0.5 * t * ((4.0 - 3.0 * t) * t + 1.0),
        0.5 * t * t * (t - 1.0),
    )


@wp.func
def interpolate(t: float, cubic: int) -> wp.vec4:
    """Weights of four values at t between the middle two: Catmull-Rom, or the straight line."""
    if cubic == 1:
        return catmull_rom(t)
    return wp.vec4(0.0, 1.0 - t, t, 0.0)


@wp.func
def integral_weights(cubic: int) -> wp.vec4:
    """Weights of four values in the integral of :func:`interpolate` from 0 to 1."""
    if cubic == 1:
        return wp.vec4(-1.0, 13.0, 13.0, -1.0) / 24.0
    return wp.vec4(0.0, 0.5, 0.5, 0.0)


@wp.func
def trapezoid_weights(n: int, cubic: int) -> wp.vec4:
    """Weights of four values in the trapezoid sum of :func:`interpolate` over n parts (exact for a cubic)."""
    if cubic == 1:
        q = 1.0 / float(n * n)
        return wp.vec4(q - 1.0, 13.0 - q, 13.0 - q, q - 1.0) / 24.0
    return wp.vec4(0.0, 0.5, 0.5, 0.0)


@wp.func
def plane_mean(planes: wp.array3d[float], plane: int, row: int, column: int, weights: wp.vec4) -> float:
    """Mean of a plane over a cell by these weights along each side."""
    return wp.dot(weights, stencil(planes, plane, row, column, weights))


@wp.func
def second_difference(a: float, b: float, c: float, d: float) -> float:
    """Bend of the middle interval of four values: how far a parabola's middle is from its chord."""
    return wp.abs(a - b - c + d) / 16.0


@wp.func
def plane_bend(planes: wp.array3d[float], plane: int, row: int, column: int) -> float:
    """How far a plane is from straight along a cell's sides, and across it, in its own unit."""
    worst = float(0.0)
    for i in range(1, 3):
        a = stencil_row(planes, plane, row + i, column)
        worst = wp.max(worst, second_difference(a[0], a[1], a[2], a[3]))
        worst = wp.max(
            worst,
            second_difference(
                planes[plane, row, column + i],
                planes[plane, row + 1, column + i],
                planes[plane, row + 2, column + i],
                planes[plane, row + 3, column + i],
            ),
        )
    twist = planes[plane, row + 1, column + 1] - planes[plane, row + 1, column + 2]
    twist += planes[plane, row + 2, column + 2] - planes[plane, row + 2, column + 1]
    return wp.max(worst, 0.25 * wp.abs(twist))


@wp.func
def jump_between(a: float, b: float, c: float, d: float) -> float:
    """How far the middle two of four values are apart beyond what their neighbours' differences lead to expect."""
    return wp.abs(c - b - 0.5 * (b - a + d - c))


@wp.func
def plane_jump(planes: wp.array3d[float], plane: int, row: int, column: int) -> float:
    """How far a plane jumps within a cell: a step between its own corners has no second difference, but this."""
    worst = float(0.0)
    for i in range(1, 3):
        a = stencil_row(planes, plane, row + i, column)
        worst = wp.max(worst, jump_between(a[0], a[1], a[2], a[3]))
        worst = wp.max(
            worst,
            jump_between(
                planes[plane, row, column + i],
                planes[plane, row + 1, column + i],
                planes[plane, row + 2, column + i],
                planes[plane, row + 3, column + i],
            ),
        )
    return worst


@wp.func
def side_misses(
    planes: wp.array3d[float], axis: int, row: int, column: int, low: float, high: float, top: float
) -> bool:
    """Tell whether all corners of a cell land below ``low`` or above ``high`` along an axis, from its first at rest.

    ``top`` is the rest coordinate of the far corners along the axis; all in pixels.
    """
    a = planes[axis, row + 1, column + 1]
    b = planes[axis, row + 1, column + 2]
    c = planes[axis, row + 2, column + 1]
    d = planes[axis, row + 2, column + 2]
    least = wp.min(wp.min(a, b), wp.min(c, d))
    most = wp.max(wp.max(a, b), wp.max(c, d)) + top
    return most < low or least > high


@wp.func
def misses_map(
    planes: wp.array3d[float], lattice: Lattice, row: int, column: int, corner: wp.vec2, side: wp.vec2, spare: float
) -> bool:
    """Tell whether a cell at rest at ``corner`` [pixels] lands beside the map, by more than ``spare``.

    Cutting such a cell finer would show nothing, and its light is counted all the same.
    """
    x_low = -spare - corner[0]
    x_high = float(lattice.map[0]) + spare - corner[0]
    y_low = -spare - corner[1]
    y_high = float(lattice.map[1]) + spare - corner[1]
    return side_misses(planes, 0, row, column, x_low, x_high, side[0]) or side_misses(
        planes, 1, row, column, y_low, y_high, side[1]
    )


@wp.func
def thickness(planes: wp.array3d[float], row: int, column: int, side: wp.vec2) -> float:
    """Width of a landed cell across its longer diagonal [pixels]; nothing at a focus, where it is a sliver."""
    a = wp.vec2(planes[0, row + 1, column + 1], planes[1, row + 1, column + 1])
    b = wp.vec2(planes[0, row + 1, column + 2], planes[1, row + 1, column + 2])
    c = wp.vec2(planes[0, row + 2, column + 2], planes[1, row + 2, column + 2])
    d = wp.vec2(planes[0, row + 2, column + 1], planes[1, row + 2, column + 1])
    up = side + c - a
    down = wp.vec2(side[0], -side[1]) + b - d
    area = 0.5 * wp.abs(up[0] * down[1] - up[1] * down[0])
    return area / wp.max(wp.max(wp.length(up), wp.length(down)), 1.0e-6)


@functools.cache
def make_deposit_patch(spec: Spec) -> wp.Function:
    """Deposit a cell as n x n pairs of triangles; return the flux that fell in the map.

    Position and flux at the nodes come from one interpolant. Its trapezoid sum over n parts is known in closed form
    and so is its integral: each part gets the same small amount more, and the parts add up to ``mean`` for any n.
    """
    channels = spec.channels
    deposit_triangle = make_deposit_triangle(spec.accumulate, channels)
    dtype = ACCUMULATOR[spec.accumulate]
    flux_type = FLUX[channels]
    lines_type = wp.types.matrix(shape=(channels, 4), dtype=float)
    arrived = arrived_plane(spec)

    @wp.func
    def flux_lines(planes: wp.array3d[float], row: int, column: int, v: wp.vec4) -> lines_type:
        lines = lines_type()
        for k in range(wp.static(channels)):
            line = stencil(planes, wp.static(arrived) + k, row, column, v)
            for i in range(wp.static(4)):
                lines[k, i] = line[i]
        return lines

    @wp.func
    def deposit_patch(
        map: wp.array[dtype], lattice: Lattice, base: wp.vec2i, corner: wp.vec2, side: wp.vec2,
        planes: wp.array3d[float], row: int, column: int, n: int, cubic: int, mean: flux_type,
    ) -> flux_type:  # fmt: skip
        """``corner`` and ``side`` [pixels] are the cell's square at rest, from ``base``; ``mean`` its flux density."""
        inside = flux_type()
        part = 1.0 / float(n)
        area = side[0] * side[1] * part * part / (lattice.step * lattice.step)
        weights = trapezoid_weights(n, cubic)
        mend = mean - flux_lines(planes, row, column, weights) * weights
        for j in range(n):
            v = interpolate(float(j) * part, cubic)
            w = interpolate(float(j + 1) * part, cubic)
            x_low = stencil(planes, 0, row, column, v)
            x_high = stencil(planes, 0, row, column, w)
            y_low = stencil(planes, 1, row, column, v)
            y_high = stencil(planes, 1, row, column, w)
            flux_low = flux_lines(planes, row, column, v)
            flux_high = flux_lines(planes, row, column, w)
            bottom = corner[1] + side[1] * float(j) * part
            top = corner[1] + side[1] * float(j + 1) * part
            a = wp.vec2(corner[0] + x_low[1], bottom + y_low[1])
            d = wp.vec2(corner[0] + x_high[1], top + y_high[1])
            flux_a = flux_type()
            flux_d = flux_type()
            for k in range(wp.static(channels)):
                flux_a[k] = flux_low[k, 1]
                flux_d[k] = flux_high[k, 1]
            for i in range(n):
                u = interpolate(float(i + 1) * part, cubic)
                right = corner[0] + side[0] * float(i + 1) * part
                b = wp.vec2(right + wp.dot(u, x_low), bottom + wp.dot(u, y_low))
                c = wp.vec2(right + wp.dot(u, x_high), top + wp.dot(u, y_high))
                flux_b = flux_low * u
                flux_c = flux_high * u
                # The two triangles share the part's flux by the means of their own corners.
                half = area * 0.5 * (0.25 * (flux_a + flux_b + flux_c + flux_d) + mend)
                tilt = area * (flux_b - flux_d) / 12.0
                lower = half + tilt
                upper = half - tilt
                inside += lower * deposit_triangle(map, lattice.map, base, a, b, c, lower)
                inside += upper * deposit_triangle(map, lattice.map, base, a, c, d, upper)
                a = b
                d = c
                flux_a = flux_b
                flux_d = flux_c
        return inside

    return deposit_patch
