"""The area ratio: landed triangles of the surface drawn at pixel centres, each pixel lit by old area over new.

It is what WebGL demos and engines do: a mesh of the water is refracted at its corners, drawn where it lands, and each
pixel that a triangle covers gets the light of the surface times how much smaller the triangle has become. Corners come
from :func:`.beam.make_corners`; a triangle is drawn if all three landed, straight across whatever edge lies between.

A triangle that is drawn covers a pixel centre, so its rounded area (see ``centres.py``) is not zero, and no ratio is
infinite.
"""

import functools

import warp as wp

from .centres import SUBPIXELS, in_subpixels, make_draw, turned
from .coverage import edge_in_row, overlap
from .deposit import ACCUMULATOR, FLUX
from .lattice import Lattice, at_rest, clip_to_water, pixel_base, pixel_fraction, share_of_cell
from .ledger import bin_of, make_book_landed, make_count_unlanded
from .patch import BORDER, arrived_plane
from .photon import LANDED, LANDED_ON_OBJECT, LOST, SunSample
from .spec import Spec


@wp.struct
class Corner:
    """A corner of the lattice, and where its light lands."""

    rest: wp.vec2  # where it lands at rest, from the cell's whole pixel [pixels]
    landing: wp.vec2i  # from the cell's whole pixel, in sub-pixels
    at: wp.vec2  # the same, not rounded [pixels]
    state: int
    incident: float
    transmitted: float


@wp.func
def ratio_by_cross(old_b: wp.vec2, old_c: wp.vec2, area: float) -> float:
    """Old area over new of a triangle, |old x old| / |new x new|: by its edges before, and twice its area after."""
    return wp.abs(old_b[0] * old_c[1] - old_b[1] * old_c[0]) / area


@wp.func
def ratio_by_derivatives(old_b: wp.vec2, old_c: wp.vec2, new_b: wp.vec2, new_c: wp.vec2, area: float) -> float:
    """Old area over new as the demos take it: |d old / dx| |d old / dy| / (|d new / dx| |d new / dy|).

    x and y are those of the rasterized pixel. The picture that is drawn is the map itself, so the new position moves
    by one pixel a pixel, and the denominator is 1. The old position, interpolated over the landed triangle, is the
    affine map that takes the landed edges back: d old / dx = (old_b new_c.y - old_c new_b.y) / (new_b x new_c).
    The product of the two lengths is never less than the determinant, and more wherever they are not at a right angle.
    """
    by_x = (old_b * new_c[1] - old_c * new_b[1]) / area
    by_y = (old_c * new_b[0] - old_b * new_c[0]) / area
    return wp.length(by_x) * wp.length(by_y)


@functools.cache
def make_ratio(derivatives: bool, clamped: bool) -> wp.Function:
    """Old area over new of a drawn triangle, by ``derivatives`` or exactly, and clamped or not."""

    @wp.func
    def ratio(pixel: wp.vec2, limit: float, a: Corner, b: Corner, c: Corner) -> float:
        """``pixel`` is a pixel's size [m]; the new triangle is the one that is drawn, rounded to sub-pixels."""
        old_b = b.rest - a.rest
        old_c = c.rest - a.rest
        area = float(turned(a.landing, b.landing, c.landing).area) * wp.static(1.0 / 2.0**32)
        if wp.static(derivatives):
            # Lengths are those of metres; a pixel's own size, by which the new position moves, is divided out again.
            metric = pixel / wp.sqrt(pixel[0] * pixel[1])
            new_b = wp.vec2(b.landing - a.landing) * wp.static(1.0 / 2.0**16)
            new_c = wp.vec2(c.landing - a.landing) * wp.static(1.0 / 2.0**16)
            made = ratio_by_derivatives(wp.cw_mul(metric, old_b), wp.cw_mul(metric, old_c), new_b, new_c, area)
        else:
            made = ratio_by_cross(old_b, old_c, area)
        if wp.static(clamped):
            made = wp.min(made, limit)
        return made

    return ratio


@wp.func
def share_in_map(lattice: Lattice, base: wp.vec2i, a: wp.vec2, b: wp.vec2, c: wp.vec2) -> float:
    """Share of a landed triangle [pixels from ``base``] that lies in the map, by its overlap with the map's rectangle.

    A triangle that float32 sees as a line is where its middle is.
    """
    size = wp.vec2(float(lattice.map[0]), float(lattice.map[1]))
    corner = wp.vec2(float(base[0]), float(base[1]))
    a = wp.cw_div(a + corner, size)
    b = wp.cw_div(b + corner, size)
    c = wp.cw_div(c + corner, size)
    low = wp.min(a, wp.min(b, c))
    high = wp.max(a, wp.max(b, c))
    if low[0] >= 0.0 and low[1] >= 0.0 and high[0] <= 1.0 and high[1] <= 1.0:
        return 1.0
    if not (high[0] > 0.0 and high[1] > 0.0 and low[0] < 1.0 and low[1] < 1.0):
        return 0.0
    area = 0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]))
    inside = overlap(edge_in_row(a, b, 0.0), edge_in_row(b, c, 0.0), edge_in_row(c, a, 0.0), 0.0) / area
    middle = (a + b + c) / 3.0
    if not (inside >= 0.0 and inside <= 1.0):
        inside = wp.where(wp.min(middle) >= 0.0 and wp.max(middle) <= 1.0, 1.0, 0.0)
    return inside


@functools.cache
def make_read_corner(spec: Spec) -> wp.Function:
    """Read a corner of a cell from the planes, with the fate that its light met."""
    breaks, bounded = spec.breaks, spec.bounded
    transmitted_plane = 2 + int(spec.fresnel)

    @wp.func
    def read_corner(
        light: SunSample, lattice: Lattice, base: wp.vec2i, index: wp.vec2i, planes: wp.array3d[float],
        state: wp.array2d[wp.uint8], row: int, column: int, up: int, right: int,
    ) -> Corner:  # fmt: skip
        """``index`` is the cell's in the lattice, ``row`` and ``column`` its place in the strip."""
        rest = at_rest(lattice, index + wp.vec2i(right, up), 0.0)
        row += wp.static(BORDER) + up
        column += wp.static(BORDER) + right
        if wp.static(bounded):
            rest = clip_to_water(lattice, rest, light.rest_shift)
        # All cells that share a corner round it from the corner's own whole pixel, so to the same sub-pixel.
        own = pixel_base(rest)
        apart = own - base
        away = wp.vec2(planes[0, row, column], planes[1, row, column])
        fraction = pixel_fraction(rest, own)
        corner = Corner()
        corner.rest = fraction + wp.vec2(float(apart[0]), float(apart[1]))
        corner.at = corner.rest + away
        corner.landing = in_subpixels(fraction + away) + SUBPIXELS * apart
        corner.incident = planes[2, row, column]
        corner.transmitted = planes[wp.static(transmitted_plane), row, column]
        corner.state = LANDED
        if wp.static(breaks):
            corner.state = int(state[row, column])
        if not wp.isfinite(corner.incident + away[0] + away[1]):
            corner.state = LOST
            corner.incident = -light.direction[2]
            corner.transmitted = corner.incident
        return corner

    return read_corner


@wp.func
def landed(state: int) -> bool:
    """Tell whether a corner's light met the receiver, or an object on it."""
    return state == LANDED or state == LANDED_ON_OBJECT


@functools.cache
def make_claim(spec: Spec) -> wp.Kernel:
    """Find the latest triangle of each pixel: the largest number, whatever the order of the threads."""
    read_corner = make_read_corner(spec)
    draw = make_draw(spec.accumulate, spec.channels, True, False)
    dtype = ACCUMULATOR[spec.accumulate]
    flux_type = FLUX[spec.channels]

    @wp.func
    def claim_half(
        map: wp.array[dtype], owner: wp.array[int], size: wp.vec2i, base: wp.vec2i, a: Corner, b: Corner, c: Corner,
        number: int,
    ):  # fmt: skip
        if landed(a.state) and landed(b.state) and landed(c.state):
            draw(map, owner, size, base, turned(a.landing, b.landing, c.landing), number, flux_type(), 0.0)

    @wp.kernel(module="unique", enable_backward=False)
    def claim(
        # In:
        suns: wp.array[SunSample],
        sun: int,
        lattice: Lattice,
        first_row: int,
        planes: wp.array3d[float],
        state: wp.array2d[wp.uint8],
        # Out:
        map_out: wp.array[dtype],
        owner_out: wp.array[int],
    ):
        """One thread a cell; launch dims (rows, columns) of cells; the map is not touched."""
        row, column = wp.tid()
        light = suns[sun]
        index = wp.vec2i(lattice.first[0] + column, first_row + row)
        base = pixel_base(at_rest(lattice, index, 0.0))
        a = read_corner(light, lattice, base, index, planes, state, row, column, 0, 0)
        b = read_corner(light, lattice, base, index, planes, state, row, column, 0, 1)
        c = read_corner(light, lattice, base, index, planes, state, row, column, 1, 1)
        d = read_corner(light, lattice, base, index, planes, state, row, column, 1, 0)
        number = 2 * (row * lattice.count[0] + column) + 1
        claim_half(map_out, owner_out, lattice.map, base, a, b, c, number)
        claim_half(map_out, owner_out, lattice.map, base, a, c, d, number + 1)

    return claim


@functools.cache
def make_triangles(spec: Spec, derivatives: bool, clamped: bool, latest: bool) -> wp.Kernel:
    """Draw the triangles of a strip, and book where their light really went."""
    read_corner = make_read_corner(spec)
    draw = make_draw(spec.accumulate, spec.channels, False, latest)
    ratio = make_ratio(derivatives, clamped)
    book_landed = make_book_landed(spec)
    count_unlanded = make_count_unlanded(spec)
    dtype = ACCUMULATOR[spec.accumulate]
    flux_type = FLUX[spec.channels]
    channels = spec.channels
    bounded = spec.bounded
    arrived = arrived_plane(spec)

    @wp.func
    def arrived_at(planes: wp.array3d[float], row: int, column: int) -> flux_type:
        """What arrives from a corner of the cell at this place in the planes."""
        flux = flux_type()
        for k in range(wp.static(channels)):
            flux[k] = planes[wp.static(arrived) + k, row + wp.static(BORDER), column + wp.static(BORDER)]
        return flux

    @wp.func
    def book_corner(
        ledger: wp.array2d[wp.float64], bin: int, lattice: Lattice, base: wp.vec2i, corner: Corner, flux: flux_type,
        third: float,
    ):  # fmt: skip
        """A third of a triangle that is not drawn has the fate of its corner."""
        if landed(corner.state):
            inside = share_in_map(lattice, base, corner.at, corner.at, corner.at)
            lit = third * flux
            book_landed(ledger, bin, third * corner.incident, third * corner.transmitted, lit, inside * lit)
        else:
            count_unlanded(ledger, bin, corner.state, third * corner.incident, third * corner.transmitted)

    @wp.func
    def draw_half(
        map: wp.array[dtype], ledger: wp.array2d[wp.float64], owner: wp.array[int], lattice: Lattice, base: wp.vec2i,
        bin: int, number: int, third: float, limit: float,
        a: Corner, b: Corner, c: Corner, flux_a: flux_type, flux_b: flux_type, flux_c: flux_type,
    ):  # fmt: skip
        """``third`` is the share of a cell that each corner of the triangle stands for."""
        if landed(a.state) and landed(b.state) and landed(c.state):
            # A cell's flux is the unit, and a pixel of the surface takes in this part of it.
            pixel = 1.0 / (lattice.step * lattice.step)
            mean = (flux_a + flux_b + flux_c) / 3.0
            triangle = turned(a.landing, b.landing, c.landing)
            if triangle.area != wp.int64(0):
                bright = pixel * ratio(lattice.pixel, limit, a, b, c)
                draw(map, owner, lattice.map, base, triangle, number, mean, bright)
            # One order of operations for all three, so that what nothing takes away is the same to the last bit.
            lit = 3.0 * third * mean
            incident = 3.0 * third * ((a.incident + b.incident + c.incident) / 3.0)
            transmitted = 3.0 * third * ((a.transmitted + b.transmitted + c.transmitted) / 3.0)
            inside = share_in_map(lattice, base, a.at, b.at, c.at)
            book_landed(ledger, bin, incident, transmitted, lit, inside * lit)
        else:
            book_corner(ledger, bin, lattice, base, a, flux_a, third)
            book_corner(ledger, bin, lattice, base, b, flux_b, third)
            book_corner(ledger, bin, lattice, base, c, flux_c, third)

    @wp.kernel(module="unique", enable_backward=False)
    def triangles(
        # In:
        suns: wp.array[SunSample],
        sun: int,
        lattice: Lattice,
        first_row: int,
        limit: float,
        planes: wp.array3d[float],
        state: wp.array2d[wp.uint8],
        owner: wp.array[int],
        # Out:
        map_out: wp.array[dtype],
        ledger_out: wp.array2d[wp.float64],
    ):
        """One thread a cell of the strip; launch dims (rows, columns) of cells; ``limit`` clamps the ratio."""
        row, column = wp.tid()
        light = suns[sun]
        index = wp.vec2i(lattice.first[0] + column, first_row + row)
        base = pixel_base(at_rest(lattice, index, 0.0))
        a = read_corner(light, lattice, base, index, planes, state, row, column, 0, 0)
        b = read_corner(light, lattice, base, index, planes, state, row, column, 0, 1)
        c = read_corner(light, lattice, base, index, planes, state, row, column, 1, 1)
        d = read_corner(light, lattice, base, index, planes, state, row, column, 1, 0)
        if wp.static(bounded):
            if c.rest[0] <= a.rest[0] or c.rest[1] <= a.rest[1]:
                return
        flux_a = arrived_at(planes, row, column)
        flux_b = arrived_at(planes, row, column + 1)
        flux_c = arrived_at(planes, row + 1, column + 1)
        flux_d = arrived_at(planes, row + 1, column)
        third = share_of_cell(lattice, a.rest, c.rest) / 6.0
        bin = bin_of(row, column)
        number = 2 * (row * lattice.count[0] + column) + 1
        draw_half(map_out, ledger_out, owner, lattice, base, bin, number, third, limit, a, b, c, flux_a, flux_b, flux_c)
        draw_half(
            map_out, ledger_out, owner, lattice, base, bin, number + 1, third, limit, a, c, d, flux_a, flux_c, flux_d
        )

    return triangles
