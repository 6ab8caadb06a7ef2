"""Footprints of photon differentials: the flux of a photon over an ellipse or a parallelogram of any shape.

A footprint is the image of a cell under an affine map, by what becomes of the cell's edges ``u`` and ``v`` [pixels].
One that is made wider or narrower keeps its flux: weights are divided by their own sum, overlaps by the new area.
"""

import functools

import warp as wp

from .coverage import make_deposit_triangle
from .deposit import ACCUMULATOR, FLUX, make_add

LEAST_AXIS = wp.constant(1.0e-2)
"""Half axis [pixels] of an ellipse at least: it is narrower than anything that a map shows, and none has no width."""

NO_WIDTH = wp.constant(1.0e-6)
"""Half width [pixels] of a thin row at least, so that a share of it can be taken."""

ROWS_A_PIXEL = wp.constant(4.0)
"""Thin rows that an ellipse is cut into for each pixel that its middle line crosses, up or across."""

FEWEST_ROWS = wp.constant(2)
"""Thin rows in a row of pixels at least: an ellipse smaller than a pixel is not all at its widest."""


@wp.struct
class Axes:
    """The two axes of an ellipse at a right angle, and their half lengths [pixels]."""

    along: wp.vec2  # unit vector of the longer one
    across: wp.vec2
    semi_major: float
    semi_minor: float


@wp.func
def axes_of(u: wp.vec2, v: wp.vec2) -> Axes:
    """Axes of the ellipse of all a u + b v with a^2 + b^2 = 1: the singular values of the matrix [u v]."""
    xx = u[0] * u[0] + v[0] * v[0]
    xy = u[0] * u[1] + v[0] * v[1]
    yy = u[1] * u[1] + v[1] * v[1]
    angle = 0.5 * wp.atan2(2.0 * xy, xx - yy)
    axes = Axes()
    axes.along = wp.vec2(wp.cos(angle), wp.sin(angle))
    axes.across = wp.vec2(-axes.along[1], axes.along[0])
    half = 0.5 * (xx - yy)
    axes.semi_major = wp.sqrt(0.5 * (xx + yy) + wp.sqrt(half * half + xy * xy))
    if axes.semi_major > 0.0:
        axes.semi_minor = wp.abs(u[0] * v[1] - u[1] * v[0]) / axes.semi_major
    return axes


@wp.func
def kernel_below(s: float) -> float:
    """Share of a row through the kernel (1 - r^2)^2 that lies below s, which runs from -1 to 1 across it."""
    s = wp.clamp(s, -1.0, 1.0)
    squared = s * s
    return 0.5 + 0.0625 * s * (15.0 - squared * (10.0 - 3.0 * squared))


@wp.struct
class ThinRows:
    """The thin rows that a row of pixels cuts from an ellipse; heights are from its middle, as shares of ``tall``."""

    count: int
    low: float
    step: float


@wp.func
def thin_rows(row: int, at: float, tall: float, lean: float) -> ThinRows:
    """Cut the part of an ellipse between ``row`` and ``row + 1`` [pixels]; ``at`` is its middle's height."""
    cut = ThinRows()
    cut.low = wp.max((float(row) - at) / tall, -1.0)
    high = wp.min((float(row) + 1.0 - at) / tall, 1.0)
    span = wp.max(high - cut.low, 0.0)
    cut.count = wp.max(int(wp.ceil(span * wp.max(tall, wp.abs(lean)) * ROWS_A_PIXEL)), FEWEST_ROWS)
    cut.step = span / float(cut.count)
    return cut


@wp.func
def left_over(rows: ThinRows, k: int) -> float:
    """1 - y^2 at the middle of a thin row: the square of its width, as a share of the widest's."""
    y = rows.low + (float(k) + 0.5) * rows.step
    return wp.max(1.0 - y * y, 0.0)


@wp.func
def row_light(rows: ThinRows, left: float) -> float:
    """Light in a thin row, not normalised: the kernel's integral across it goes as (1 - y^2)^(5/2)."""
    return left * left * wp.sqrt(left) * rows.step


@functools.cache
def make_deposit_ellipse(accumulate: str, channels: int) -> wp.Function:
    """Spread a flux by (3 / pi) (1 - r^2)^2 over the ellipse of ``u`` and ``v``; return the share in the map.

    Each row of pixels cuts thin rows from the ellipse, and the share of one of them in each pixel is the kernel's
    integral in closed form. Their weights are divided by their sum, so that what is deposited and what falls beside the
    map add up to the flux, however small or slender the ellipse is.
    """
    add = make_add(accumulate, channels)
    dtype = ACCUMULATOR[accumulate]

    @wp.func
    def deposit_ellipse(
        map: wp.array[dtype], size: wp.vec2i, base: wp.vec2i, at: wp.vec2, u: wp.vec2, v: wp.vec2, largest: float,
        flux: FLUX[channels],
    ) -> float:  # fmt: skip
        """``at`` is the middle, from the whole pixel ``base``."""
        axes = axes_of(u, v)
        if not wp.isfinite(axes.semi_major + axes.semi_minor):
            # Light that grazes the receiver has no linear footprint; it lands where it lands.
            axes = Axes()
            axes.along = wp.vec2(1.0, 0.0)
            axes.across = wp.vec2(0.0, 1.0)
        semi_major = wp.clamp(axes.semi_major, LEAST_AXIS, largest)
        semi_minor = wp.clamp(axes.semi_minor, LEAST_AXIS, largest)
        p = axes.along * semi_major
        q = axes.across * semi_minor
        tall = wp.sqrt(p[1] * p[1] + q[1] * q[1])
        wide = wp.sqrt(p[0] * p[0] + q[0] * q[0])
        left = float(-base[0])
        bottom = float(-base[1])
        if at[0] + wide < left or at[0] - wide > left + float(size[0]):
            return 0.0
        if at[1] + tall < bottom or at[1] - tall > bottom + float(size[1]):
            return 0.0
        lean = (p[0] * p[1] + q[0] * q[1]) / tall  # of the middle line, from the ellipse's middle to its top
        broad = semi_major * semi_minor / tall  # half width of the middle row
        first_row = int(wp.floor(at[1] - tall))
        last_row = int(wp.floor(at[1] + tall))
        total = float(0.0)
        for row in range(first_row, last_row + 1):
            rows = thin_rows(row, at[1], tall, lean)
            for k in range(rows.count):
                total += row_light(rows, left_over(rows, k))
        inside = float(0.0)
        for row in range(wp.max(first_row, -base[1]), wp.min(last_row, size[1] - 1 - base[1]) + 1):
            start = (base[1] + row) * size[0] + base[0]
            rows = thin_rows(row, at[1], tall, lean)
            for k in range(rows.count):
                narrowing = left_over(rows, k)
                half = wp.max(broad * wp.sqrt(narrowing), NO_WIDTH)
                middle = at[0] + (rows.low + (float(k) + 0.5) * rows.step) * lean
                weight = row_light(rows, narrowing) / total
                first = wp.max(int(wp.floor(middle - half)), -base[0])
                last = wp.min(int(wp.floor(middle + half)), size[0] - 1 - base[0])
                below = kernel_below((float(first) - middle) / half)
                for column in range(first, last + 1):
                    above = kernel_below((float(column) + 1.0 - middle) / half)
                    share = weight * (above - below)
                    if share > 0.0:
                        inside += share
                        add(map, start + column, flux, share)
                    below = above
        return inside

    return deposit_ellipse


@wp.func
def narrowed(edge: wp.vec2, axes: Axes, largest: float) -> wp.vec2:
    """An edge of a parallelogram whose axes are held to ``largest``."""
    along = wp.dot(axes.along, edge) * wp.min(1.0, largest / wp.max(axes.semi_major, 1.0e-12))
    across = wp.dot(axes.across, edge) * wp.min(1.0, largest / wp.max(axes.semi_minor, 1.0e-12))
    return along * axes.along + across * axes.across


@functools.cache
def make_deposit_parallelogram(accumulate: str, channels: int) -> wp.Function:
    """Spread a flux evenly over the parallelogram of ``u`` and ``v``, by exact overlap; return the share in the map."""
    deposit_triangle = make_deposit_triangle(accumulate, channels)
    dtype = ACCUMULATOR[accumulate]

    @wp.func
    def deposit_parallelogram(
        map: wp.array[dtype], size: wp.vec2i, base: wp.vec2i, at: wp.vec2, u: wp.vec2, v: wp.vec2, largest: float,
        flux: FLUX[channels],
    ) -> float:  # fmt: skip
        """``at`` is the middle, from the whole pixel ``base``."""
        axes = axes_of(u, v)
        if not wp.isfinite(axes.semi_major + axes.semi_minor):
            u = wp.vec2(0.0, 0.0)
            v = wp.vec2(0.0, 0.0)
        elif axes.semi_major > largest:
            u = narrowed(u, axes, largest)
            v = narrowed(v, axes, largest)
        a = at - 0.5 * (u + v)
        b = at + 0.5 * (u - v)
        c = at + 0.5 * (u + v)
        d = at - 0.5 * (u - v)
        inside = deposit_triangle(map, size, base, a, b, c, 0.5 * flux)
        return 0.5 * (inside + deposit_triangle(map, size, base, a, c, d, 0.5 * flux))

    return deposit_parallelogram
