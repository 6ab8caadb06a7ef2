"""A cell's deposit triangle by triangle: the plain form, which :mod:`.edge_patch` is checked against."""

import functools

import warp as wp

from .coverage import make_deposit_triangle
from .deposit import ACCUMULATOR, FLUX
from .lattice import Lattice
from .patch import interpolate, make_flux_line, make_read_flux, read_block, trapezoid_weights
from .spec import Spec


@functools.cache
def make_deposit_patch(spec: Spec) -> wp.Function:
    """Deposit a cell as n x n pairs of triangles; return the flux that fell in the map.

    Position and flux at the nodes come from one interpolant. Its trapezoid sum over n parts is known in closed form
    and so is its integral: each part gets the same small amount more, and the parts add up to ``mean`` for any n.
    """
    channels = spec.channels
    deposit_triangle = make_deposit_triangle(spec.accumulate, channels)
    read_flux, flux_line = make_read_flux(spec), make_flux_line(channels)
    dtype, flux_type = ACCUMULATOR[spec.accumulate], FLUX[channels]

    @wp.func
    def deposit_patch(
        map: wp.array[dtype], lattice: Lattice, base: wp.vec2i, corner: wp.vec2, side: wp.vec2,
        planes: wp.array3d[float], row: int, column: int, n: int, cubic: int, mean: flux_type,
    ) -> flux_type:  # fmt: skip
        """``corner`` and ``side`` [pixels] are the cell's square at rest, from ``base``; ``mean`` its flux density."""
        inside = flux_type()
        part = 1.0 / float(n)
        area = side[0] * side[1] * part * part / (lattice.step * lattice.step)
        x = read_block(planes, 0, row, column)
        y = read_block(planes, 1, row, column)
        flux = read_flux(planes, row, column)
        weights = trapezoid_weights(n, cubic)
        mend = mean - flux_line(flux, weights) * weights
        for j in range(n):
            v = interpolate(float(j) * part, cubic)
            w = interpolate(float(j + 1) * part, cubic)
            x_low = v * x
            x_high = w * x
            y_low = v * y
            y_high = w * y
            flux_low = flux_line(flux, v)
            flux_high = flux_line(flux, w)
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
