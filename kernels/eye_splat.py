"""The atomic splat into an eye's picture: a point, a bilinear pixel, or the texel's own outline as the eye sees it.

A photon lights only pixels that see the surface on which it lands. What would fall on others is not handed to their
neighbours: it lands out of sight.
"""

import functools

import warp as wp

from .deposit import ACCUMULATOR, FLUX, make_add
from .eye_surface import lies_on
from .views import View, project

SPREAD = wp.constant(1.5535)
"""Radius of a texel's footprint in texels. The transform of (1 - r^2)^2 over a disk is 48 J3(k)/k^3 of k = 2 pi SPREAD,
and this is its second zero, 9.761: the ripple that a lattice of footprints would leave on even light vanishes."""

LEAST_RADIUS = wp.constant(1.0)  # [pixels] of a footprint: half a pixel's diagonal and more, so that it meets a centre
MOST_RADIUS = wp.constant(24.0)  # [pixels] of a footprint: photons this near to the eye are spread over less than a
# texel, with all their light, or one would take the time of thousands


@wp.func
def on_screen(view: View, point: wp.vec3) -> wp.vec3:
    """Column and row [pixels], and depth [m], of a point; a depth before the near plane is -1."""
    at = project(view, point)
    if not at[2] > view.near:
        return wp.vec3(0.0, 0.0, -1.0)
    return wp.vec3(at[0] / at[2], at[1] / at[2], at[2])


@wp.func
def screen_step(view: View, at: wp.vec3, step: wp.vec3) -> wp.vec2:
    """How far a small step [m] moves a point on the screen [pixels], the point standing ``at`` there."""
    moved = wp.vec3(view.matrix * wp.vec3d(step))
    return wp.vec2((moved[0] - at[0] * moved[2]) / at[2], (moved[1] - at[1] * moved[2]) / at[2])


@wp.func
def outline(u: wp.vec2, v: wp.vec2) -> wp.vec3:
    """Ellipse (S_xx, S_xy, S_yy) [pixels^2] of a footprint whose texel steps are ``u`` and ``v`` on the screen.

    The sum of the texel's own ellipse and a pixel's, as in elliptical weighted average splatting (Zwicker et al. 2001,
    *EWA splatting*), so that no texel, however small or seen on edge, falls between the pixels' centres.
    """
    spread = SPREAD * SPREAD
    least = LEAST_RADIUS * LEAST_RADIUS
    s = wp.vec3(
        spread * (u[0] * u[0] + v[0] * v[0]) + least,
        spread * (u[0] * u[1] + v[0] * v[1]),
        spread * (u[1] * u[1] + v[1] * v[1]) + least,
    )
    largest = wp.max(s[0], s[2])
    most = MOST_RADIUS * MOST_RADIUS
    if largest > most:
        s = s * (most / largest)
        s = wp.vec3(s[0] + least, s[1], s[2] + least)  # a sliver stays a pixel wide
    return s


@wp.func
def conic(ellipse: wp.vec3) -> wp.vec3:
    """Coefficients (a, b, c) of a x^2 + b x y + c y^2, which is 1 on the ellipse."""
    inverse = 1.0 / (ellipse[0] * ellipse[2] - ellipse[1] * ellipse[1])
    return wp.vec3(ellipse[2] * inverse, -2.0 * ellipse[1] * inverse, ellipse[0] * inverse)


@wp.func
def weight(form: wp.vec3, x: float, y: float) -> float:
    """Weight, not normalised, of a pixel whose centre lies (x, y) [pixels] from the photon's; 0 outside."""
    inside = wp.max(1.0 - (form[0] * x * x + form[1] * x * y + form[2] * y * y), 0.0)
    return inside * inside


@wp.func
def columns_of_row(ellipse: wp.vec3, form: wp.vec3, y: float) -> wp.vec2:
    """Where the ellipse begins and ends on a row [pixels from its middle]; a row that misses it has the middle alone.

    Its middle there is y S_xy / S_yy, and its half width sqrt((1 - y^2 / S_yy) / a).
    """
    middle = y * ellipse[1] / ellipse[2]
    half = wp.sqrt(wp.max(1.0 - y * y / ellipse[2], 0.0) / form[0])
    return wp.vec2(middle - half, middle + half)


@functools.cache
def make_splat_point(accumulate: str, channels: int) -> wp.Function:
    """Add a photon's flux to the pixel that it falls in, if that sees where it lands; return the share taken."""
    add = make_add(accumulate, channels)
    dtype = ACCUMULATOR[accumulate]

    @wp.func
    def splat_point(
        light: wp.array[dtype], eye_plane: wp.array2d[wp.vec4], landing: wp.vec3, normal: wp.vec3, column: int,
        row: int, flux: FLUX[channels], share: float, stride: int, offset: int,
    ) -> float:  # fmt: skip
        if column < 0 or column >= eye_plane.shape[1] or row < 0 or row >= eye_plane.shape[0]:
            return 0.0
        if not lies_on(eye_plane[row, column], landing, normal):
            return 0.0
        add(light, (row * eye_plane.shape[1] + column) * stride + offset, flux, share)
        return share

    return splat_point


@functools.cache
def make_splat_texel(accumulate: str, channels: int) -> wp.Function:
    """Spread a photon's flux over its texel's outline; return the share that pixels took."""
    add = make_add(accumulate, channels)
    dtype = ACCUMULATOR[accumulate]

    @wp.func
    def splat_texel(
        light: wp.array[dtype], eye_plane: wp.array2d[wp.vec4], landing: wp.vec3, normal: wp.vec3, at: wp.vec3,
        ellipse: wp.vec3, flux: FLUX[channels], stride: int, offset: int,
    ) -> float:  # fmt: skip
        rows = eye_plane.shape[0]
        columns = eye_plane.shape[1]
        form = conic(ellipse)
        reach = wp.sqrt(ellipse[2])
        first_row = int(wp.ceil(at[1] - reach - 0.5))
        last_row = int(wp.floor(at[1] + reach - 0.5))
        total = float(0.0)
        for row in range(first_row, last_row + 1):
            y = float(row) + 0.5 - at[1]
            ends = columns_of_row(ellipse, form, y)
            for column in range(int(wp.ceil(at[0] + ends[0] - 0.5)), int(wp.floor(at[0] + ends[1] - 0.5)) + 1):
                total += weight(form, float(column) + 0.5 - at[0], y)
        taken = float(0.0)
        share = 1.0 / total
        for row in range(wp.max(first_row, 0), wp.min(last_row, rows - 1) + 1):
            y = float(row) + 0.5 - at[1]
            ends = columns_of_row(ellipse, form, y)
            first = wp.max(int(wp.ceil(at[0] + ends[0] - 0.5)), 0)
            last = wp.min(int(wp.floor(at[0] + ends[1] - 0.5)), columns - 1)
            for column in range(first, last + 1):
                part = weight(form, float(column) + 0.5 - at[0], y) * share
                if part > 0.0:
                    if lies_on(eye_plane[row, column], landing, normal):
                        add(light, (row * columns + column) * stride + offset, flux, part)
                        taken += part
        return taken

    return splat_texel


@functools.cache
def make_splat_eye(footprint: str, accumulate: str, channels: int) -> wp.Function:
    """Add a photon's flux to the pixels that see where it lands; return the share that they took."""
    splat_point = make_splat_point(accumulate, channels)
    splat_texel = make_splat_texel(accumulate, channels)
    dtype = ACCUMULATOR[accumulate]

    @wp.func
    def splat_eye(
        light: wp.array[dtype],
        eye_plane: wp.array2d[wp.vec4],
        landing: wp.vec3,
        normal: wp.vec3,
        at: wp.vec3,
        ellipse: wp.vec3,
        flux: FLUX[channels],
        stride: int,
        offset: int,
    ) -> float:
        """``at`` is the landing on the screen; the flux goes to ``light[pixel * stride + offset]``."""
        reach = wp.vec2(1.0, 1.0)
        if wp.static(footprint == "texel"):
            reach = wp.vec2(wp.sqrt(ellipse[0]), wp.sqrt(ellipse[2]))
        # Compared as floats first: a landing far off the screen has no integer pixel.
        if not (at[2] > 0.0 and at[0] > -reach[0] and at[0] < float(eye_plane.shape[1]) + reach[0]):
            return 0.0
        if not (at[1] > -reach[1] and at[1] < float(eye_plane.shape[0]) + reach[1]):
            return 0.0
        if wp.static(footprint == "point"):
            column = int(wp.floor(at[0]))
            row = int(wp.floor(at[1]))
            return splat_point(light, eye_plane, landing, normal, column, row, flux, 1.0, stride, offset)
        elif wp.static(footprint == "pixel"):
            # Two columns and two rows, whose weights add up to one.
            column = int(wp.floor(at[0] - 0.5))
            row = int(wp.floor(at[1] - 0.5))
            right = at[0] - 0.5 - float(column)
            upper = at[1] - 0.5 - float(row)
            taken = float(0.0)
            for tap in range(4):
                across = wp.where((tap & 1) == 1, right, 1.0 - right)
                up = wp.where((tap >> 1) == 1, upper, 1.0 - upper)
                taken += splat_point(
                    light, eye_plane, landing, normal, column + (tap & 1), row + (tap >> 1), flux, across * up, stride,
                    offset,
                )  # fmt: skip
            return taken
        else:
            return splat_texel(light, eye_plane, landing, normal, at, ellipse, flux, stride, offset)

    return splat_eye
