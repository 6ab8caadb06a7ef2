"""Exact deposit of a triangle's flux into pixels, by clipping it as a polygon.

A triangle is clipped to rows of pixels, and each piece to columns (Sutherland and Hodgman 1974). Every corner carries
its place (u, v) in the triangle's own coordinates, and a piece's share of the flux is its area there: so a triangle
that light has folded to a line, or to a point, is shared out as well as any other.
"""

import functools

import warp as wp

ROOM = 8
"""Corners of a polygon: a triangle cut by four lines has seven at most."""

X, Y = 0, 1

corners8 = wp.types.vector(length=ROOM, dtype=wp.float64)


@wp.struct
class Polygon:
    """A convex polygon in pixels, with each corner's place in the triangle that it was cut from."""

    count: int
    x: corners8
    y: corners8
    u: corners8
    v: corners8


@functools.cache
def make_clip(axis: int, side: int) -> wp.Function:
    """Keep the part of a polygon on one side of an axis-parallel line: side 1 is above it, -1 below."""

    @wp.func
    def clip(whole: Polygon, line: wp.float64) -> Polygon:
        part = Polygon()
        n = int(0)
        last = whole.count - 1
        for k in range(whole.count):
            if wp.static(axis == X):
                from_line = wp.float64(side) * (whole.x[last] - line)
                to_line = wp.float64(side) * (whole.x[k] - line)
            else:
                from_line = wp.float64(side) * (whole.y[last] - line)
                to_line = wp.float64(side) * (whole.y[k] - line)
            inside = to_line >= wp.float64(0.0)
            if inside != (from_line >= wp.float64(0.0)):
                t = from_line / (from_line - to_line)
                part.x[n] = whole.x[last] + t * (whole.x[k] - whole.x[last])
                part.y[n] = whole.y[last] + t * (whole.y[k] - whole.y[last])
                part.u[n] = whole.u[last] + t * (whole.u[k] - whole.u[last])
                part.v[n] = whole.v[last] + t * (whole.v[k] - whole.v[last])
                n += 1
            if inside:
                part.x[n] = whole.x[k]
                part.y[n] = whole.y[k]
                part.u[n] = whole.u[k]
                part.v[n] = whole.v[k]
                n += 1
            last = k
        part.count = n
        return part

    return clip


right_of = make_clip(X, 1)
left_of = make_clip(X, -1)
above = make_clip(Y, 1)
below = make_clip(Y, -1)


@wp.func
def share_of_triangle(polygon: Polygon) -> wp.float64:
    """Area of a polygon in the triangle's own coordinates, the triangle having 1."""
    total = wp.float64(0.0)
    last = polygon.count - 1
    for k in range(polygon.count):
        total += polygon.u[last] * polygon.v[k] - polygon.u[k] * polygon.v[last]
        last = k
    return wp.abs(total)


@wp.func
def first_pixel(low: wp.float64, count: int) -> int:
    """The first pixel of the map that something from ``low`` upwards can touch."""
    return int(wp.clamp(wp.floor(low), wp.float64(0.0), wp.float64(count)))


@wp.func
def last_pixel(high: wp.float64, count: int) -> int:
    """One past the last pixel of the map that something up to ``high`` can touch."""
    return int(wp.clamp(wp.floor(high) + wp.float64(1.0), wp.float64(0.0), wp.float64(count)))


@wp.func
def in_one_pixel(low: wp.vec2d, high: wp.vec2d, size: wp.vec2i) -> bool:
    """Whether a box lies within a single pixel of the map."""
    zero = wp.float64(0.0)
    return (
        low[0] >= zero and low[1] >= zero and wp.floor(low[0]) == wp.floor(high[0])
        and wp.floor(low[1]) == wp.floor(high[1]) and high[0] < wp.float64(size[0]) and high[1] < wp.float64(size[1])
    )  # fmt: skip


@functools.cache
def make_add_flux(channels: int) -> wp.Function:
    """Add a flux by channel to one pixel."""

    @wp.func
    def add_flux(map: wp.array[wp.float64], pixel: int, flux: wp.vec3d, share: wp.float64):
        for c in range(wp.static(channels)):
            wp.atomic_add(map, pixel * wp.static(channels) + c, flux[c] * share)

    return add_flux


@functools.cache
def make_deposit_point(channels: int) -> wp.Function:
    """Add a point's flux to the pixel that it falls in; give 1 inside the map, 0 outside."""
    add_flux = make_add_flux(channels)

    @wp.func
    def deposit_point(map: wp.array[wp.float64], size: wp.vec2i, at: wp.vec2d, flux: wp.vec3d) -> wp.float64:
        zero = wp.float64(0.0)
        if at[0] >= zero and at[1] >= zero and at[0] < wp.float64(size[0]) and at[1] < wp.float64(size[1]):
            add_flux(map, int(at[1]) * size[0] + int(at[0]), flux, wp.float64(1.0))
            return wp.float64(1.0)
        return zero

    return deposit_point


@functools.cache
def make_deposit_triangle(channels: int) -> wp.Function:
    """Share a triangle's flux out among the pixels that it covers; give the share that fell inside the map."""
    add_flux = make_add_flux(channels)

    @wp.func
    def deposit_triangle(
        map: wp.array[wp.float64], size: wp.vec2i, a: wp.vec2d, b: wp.vec2d, c: wp.vec2d, flux: wp.vec3d
    ) -> wp.float64:
        zero = wp.float64(0.0)
        one = wp.float64(1.0)
        low = wp.min(a, wp.min(b, c))
        high = wp.max(a, wp.max(b, c))
        if in_one_pixel(low, high, size):
            add_flux(map, int(low[1]) * size[0] + int(low[0]), flux, one)
            return one
        left = first_pixel(low[0], size[0])
        right = last_pixel(high[0], size[0])
        bottom = first_pixel(low[1], size[1])
        top = last_pixel(high[1], size[1])
        whole = Polygon()
        whole.count = 3
        whole.x[0] = a[0]
        whole.x[1] = b[0]
        whole.x[2] = c[0]
        whole.y[0] = a[1]
        whole.y[1] = b[1]
        whole.y[2] = c[1]
        whole.u[1] = one
        whole.v[2] = one
        total = zero
        for row in range(bottom, top):
            strip = below(above(whole, wp.float64(row)), wp.float64(row + 1))
            for column in range(left, right):
                piece = left_of(right_of(strip, wp.float64(column)), wp.float64(column + 1))
                share = share_of_triangle(piece)
                if share > zero:
                    add_flux(map, row * size[0] + column, flux, share)
                    total += share
        return total

    return deposit_triangle


@functools.cache
def make_deposit_quad(channels: int) -> wp.Function:
    """Share out a landed cell as two triangles of half its flux each; give the share inside the map."""
    add_flux = make_add_flux(channels)
    deposit_triangle = make_deposit_triangle(channels)

    @wp.func
    def deposit_quad(
        map: wp.array[wp.float64], size: wp.vec2i, a: wp.vec2d, b: wp.vec2d, c: wp.vec2d, d: wp.vec2d, flux: wp.vec3d
    ) -> wp.float64:
        """Corners in order around the cell."""
        low = wp.min(wp.min(a, b), wp.min(c, d))
        high = wp.max(wp.max(a, b), wp.max(c, d))
        if (
            high[0] < wp.float64(0.0) or low[0] > wp.float64(size[0])
            or high[1] < wp.float64(0.0) or low[1] > wp.float64(size[1])
        ):  # fmt: skip
            return wp.float64(0.0)
        # Most cells of a fine lattice land within one pixel.
        if in_one_pixel(low, high, size):
            add_flux(map, int(low[1]) * size[0] + int(low[0]), flux, wp.float64(1.0))
            return wp.float64(1.0)
        half = wp.float64(0.5) * flux
        return wp.float64(0.5) * (
            deposit_triangle(map, size, a, b, c, half) + deposit_triangle(map, size, a, c, d, half)
        )

    return deposit_quad
