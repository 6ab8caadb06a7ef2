"""Exact overlap with the pixels from edges alone: a triangle's light written as steps along the rows of the map.

A density that is uniform over a triangle changes only at its edges. An edge from (x0, y0) to (x1, y1) with the density
w on its left adds, in each pixel that it crosses, -w dy (1 - x) to the step there and -w dy x to the next one, where dy
is its height in the pixel and x its mean distance from the pixel's left side. Summed up along a row the steps are the
exact overlap, as in font rasterizers. Only pixels that an edge crosses are visited, whatever the triangle's size, and
the edge between two triangles is followed once, with the difference of their densities.

A map of steps is float64 ``[(rows + 1) * (columns + 1) + 1, channels]``, flat: an edge on the border then writes
nothing to where nothing is read. Float64, because the steps of a thin triangle are much larger than its light: they
cancel along the row.
"""

import functools

import warp as wp

from .deposit import FLUX

DENSITY = {1: wp.types.vector(length=1, dtype=wp.float64), 3: wp.vec3d}
"""The type of a density of light, by number of channels."""

SLIVER = wp.constant(wp.float64(1.0e-6))
"""Area over the extent of its sides [pixels] below which a triangle is a line: far above what float64 rounds an area
by, and so little that no light goes astray that shows. What its steps leave when they have cancelled is 1e-10 of it."""

OUTSIDE = wp.constant(wp.float64(2.0))
"""A crossing that an edge does not reach, as a share of its length."""


@functools.cache
def make_put(channels: int) -> wp.Function:
    """Add light to a pixel of a map of steps and to all after it in its row, the share ``right`` from the next on."""

    @wp.func
    def put(steps: wp.array[wp.float64], at: int, light: DENSITY[channels], right: wp.float64):
        for c in range(wp.static(channels)):
            index = at * wp.static(channels) + c
            after = light[c] * right
            wp.atomic_add(steps, index, light[c] - after)
            wp.atomic_add(steps, index + wp.static(channels), after)

    return put


@functools.cache
def make_put_flux(channels: int) -> wp.Function:
    """Add a share of a flux to one pixel of a map of steps."""

    @wp.func
    def put_flux(steps: wp.array[wp.float64], at: int, flux: FLUX[channels], share: float):
        for c in range(wp.static(channels)):
            light = wp.float64(flux[c] * share)
            index = at * wp.static(channels) + c
            wp.atomic_add(steps, index, light)
            wp.atomic_add(steps, index + wp.static(channels), -light)

    return put_flux


@functools.cache
def make_add_edge(channels: int) -> wp.Function:
    """Add an edge inside the map, from pixel to pixel."""
    put = make_put(channels)

    @wp.func
    def add_edge(steps: wp.array[wp.float64], pitch: int, a: wp.vec2d, b: wp.vec2d, density: DENSITY[channels]):
        """``density`` is that on its left less that on its right, where y points up; ``pitch`` is columns + 1."""
        dx = b[0] - a[0]
        dy = b[1] - a[1]
        # Not the other way round: beside a corner that is no number, an edge without light has no height either.
        if not wp.abs(wp.dot(density, density) * dy) > wp.float64(0.0):
            return
        column = int(a[0])
        row = int(a[1])
        across = int(b[0]) - column
        along = int(b[1]) - row
        at = row * pitch + column
        x = a[0] - wp.float64(column)
        light = -dy * density
        if across == 0 and along == 0:
            put(steps, at, light, x + wp.float64(0.5) * dx)
            return
        # The shares of the edge at which it next crosses a column and a row, and from there to the one after.
        next_column = OUTSIDE
        next_row = OUTSIDE
        column_share = wp.float64(0.0)
        row_share = wp.float64(0.0)
        right = int(1)
        upward = int(1)
        up = pitch
        if across != 0:
            column_share = wp.float64(1.0) / dx
            if across > 0:
                next_column = (wp.float64(1.0) - x) * column_share
            else:
                next_column = -x * column_share
                column_share = -column_share
                right = -1
        if along != 0:
            row_share = wp.float64(1.0) / dy
            if along > 0:
                next_row = (wp.float64(row + 1) - a[1]) * row_share
            else:
                next_row = (wp.float64(row) - a[1]) * row_share
                row_share = -row_share
                upward = -1
                up = -pitch
        done = wp.float64(0.0)
        for _ in range(wp.abs(across) + wp.abs(along)):
            if next_column < next_row:
                put(steps, at, (next_column - done) * light, x + wp.float64(0.5) * (done + next_column) * dx)
                done = next_column
                next_column += column_share
                at += right
                x -= wp.float64(right)
                across -= right
                if across == 0:  # rounding must not lead it past its end
                    next_column = OUTSIDE
            else:
                put(steps, at, (next_row - done) * light, x + wp.float64(0.5) * (done + next_row) * dx)
                done = next_row
                next_row += row_share
                at += up
                along -= upward
                if along == 0:
                    next_row = OUTSIDE
        put(steps, at, (wp.float64(1.0) - done) * light, x + wp.float64(0.5) * (done + wp.float64(1.0)) * dx)

    return add_edge


@wp.func
def point_at_x(a: wp.vec2d, b: wp.vec2d, x: wp.float64) -> wp.vec2d:
    """Where an edge that is not upright crosses a line of constant x."""
    return wp.vec2d(x, a[1] + (x - a[0]) / (b[0] - a[0]) * (b[1] - a[1]))


@wp.func
def clip_to_rows(a: wp.vec2d, b: wp.vec2d, rows: wp.float64) -> wp.vec2d:
    """The end ``a`` of an edge moved along it into [0, rows]; the edge reaches in there."""
    y = wp.clamp(a[1], wp.float64(0.0), rows)
    if y == a[1]:
        return a
    return wp.vec2d(a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]), y)


@functools.cache
def make_add_clipped_edge(channels: int) -> wp.Function:
    """Add what an edge that may leave the map gives to it; return the area of the map on its left, signed.

    The areas of a triangle's three edges add up to that of its part in the map.
    """
    add_edge = make_add_edge(channels)

    @wp.func
    def add_piece(
        steps: wp.array[wp.float64], size: wp.vec2i, a: wp.vec2d, b: wp.vec2d, density: DENSITY[channels]
    ) -> wp.float64:
        """Beside the map an edge lights whole rows of it from the left, and none from the right."""
        width = wp.float64(size[0])
        p = wp.vec2d(wp.clamp(a[0], wp.float64(0.0), width), a[1])
        q = wp.vec2d(wp.clamp(b[0], wp.float64(0.0), width), b[1])
        if p[1] == q[1]:
            return wp.float64(0.0)
        add_edge(steps, size[0] + 1, p, q, density)
        return (p[1] - q[1]) * (width - wp.float64(0.5) * (p[0] + q[0]))

    @wp.func
    def add_clipped_edge(
        steps: wp.array[wp.float64], size: wp.vec2i, a: wp.vec2d, b: wp.vec2d, density: DENSITY[channels]
    ) -> wp.float64:
        height = wp.float64(size[1])
        area = wp.float64(0.0)
        if wp.max(a[1], b[1]) <= wp.float64(0.0) or wp.min(a[1], b[1]) >= height:
            return area
        p = clip_to_rows(a, b, height)
        q = clip_to_rows(b, a, height)
        for i in range(2):
            # The sides of the map in the order in which the edge meets them.
            side = wp.float64(0.0)
            if (i == 0) == (p[0] > q[0]):
                side = wp.float64(size[0])
            if (p[0] < side) != (q[0] < side) and p[0] != side and q[0] != side:
                middle = point_at_x(p, q, side)
                area += add_piece(steps, size, p, middle, density)
                p = middle
        return area + add_piece(steps, size, p, q, density)

    return add_clipped_edge


@wp.func
def doubled_area(a: wp.vec2d, b: wp.vec2d, c: wp.vec2d) -> wp.float64:
    """Twice the signed area of a triangle."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])
