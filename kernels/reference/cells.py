"""The first road to the reference: a fine mesh of the water, refracted, each landed triangle clipped to its pixels."""

import functools

import warp as wp

from ..spec import Spec
from .deposit import make_deposit_point, make_deposit_quad
from .ledger import make_book
from .ray import DROPPED, LANDS, LANDS_ON_MESH, Ray, World, make_trace

PARTS = 8
"""Parts, each way, of a cell whose corners meet different fates; each part is one ray."""

LONG = 1.5
"""A landed cell this many times longer than at rest may be torn by the edge of a hill: its middle is looked at."""

OFF_CENTRE = 0.1
"""A cell is torn if its middle lands this share of its length away from its corners' mean; a tear's is a quarter."""

X, Y, INCIDENT, TRANSMITTED, ARRIVED = range(5)
"""Planes of a strip's corners; ``ARRIVED`` is the first of as many as there are channels."""


@wp.struct
class Mesh2D:
    """Cells of the water: corner (i, j) would land on (i, j) * step pixels, were the water at rest."""

    step: wp.float64  # [pixels]
    first: wp.vec2i
    shift: wp.vec2d  # horizontal way of the light at rest [m]
    size: wp.vec2i  # columns and rows of the map


@wp.func
def water_of(mesh: Mesh2D, world: World, i: wp.float64, j: wp.float64) -> wp.vec2d:
    """Where the water of a mesh coordinate stands [m], not past its border."""
    x = i * mesh.step * world.pixel[0] - mesh.shift[0]
    y = j * mesh.step * world.pixel[1] - mesh.shift[1]
    return wp.vec2d(wp.clamp(x, world.low[0], world.high[0]), wp.clamp(y, world.low[1], world.high[1]))


@functools.cache
def make_rays(spec: Spec) -> wp.Kernel:
    """Trace the corners of a strip of cells."""
    trace = make_trace(spec)
    channels = spec.channels

    @wp.kernel(module="unique", enable_backward=False)
    def reference_rays(
        # In:
        world: World,
        sun: wp.vec3d,
        mesh: Mesh2D,
        first_row: int,
        # Out:
        planes_out: wp.array3d[wp.float64],
        fates_out: wp.array2d[wp.uint8],
    ):
        """One thread a corner; launch dims (rows + 1, columns + 1)."""
        row, column = wp.tid()
        at = water_of(mesh, world, wp.float64(mesh.first[0] + column), wp.float64(first_row + row))
        ray = trace(world, sun, at[0], at[1])
        fates_out[row, column] = wp.uint8(ray.fate)
        planes_out[wp.static(X), row, column] = ray.landing[0]
        planes_out[wp.static(Y), row, column] = ray.landing[1]
        planes_out[wp.static(INCIDENT), row, column] = ray.incident
        planes_out[wp.static(TRANSMITTED), row, column] = ray.transmitted
        for c in range(wp.static(channels)):
            planes_out[wp.static(ARRIVED) + c, row, column] = ray.arrived[c]

    return reference_rays


@wp.func
def mean_of_corners(planes: wp.array3d[wp.float64], plane: int, row: int, column: int) -> wp.float64:
    """Mean over a cell's four corners."""
    low = planes[plane, row, column] + planes[plane, row, column + 1]
    return wp.float64(0.25) * (low + planes[plane, row + 1, column] + planes[plane, row + 1, column + 1])


@wp.func
def landing_of(planes: wp.array3d[wp.float64], row: int, column: int) -> wp.vec2d:
    """Where a corner landed [pixels]."""
    return wp.vec2d(planes[wp.static(X), row, column], planes[wp.static(Y), row, column])


@functools.cache
def make_cells(spec: Spec) -> wp.Kernel:
    """Lay down a strip of cells."""
    trace = make_trace(spec)
    deposit_quad = make_deposit_quad(spec.channels)
    deposit_point = make_deposit_point(spec.channels)
    book = make_book(spec.channels, not spec.self_shadow)
    channels, tears, breaks = spec.channels, spec.tears, spec.breaks

    @wp.func
    def in_parts(
        map: wp.array[wp.float64], ledger: wp.array2d[wp.float64], thread: int, world: World, sun: wp.vec3d,
        size: wp.vec2i, low: wp.vec2d, high: wp.vec2d,
    ):  # fmt: skip
        """Follow a cell of the water, from ``low`` to ``high`` [m], by a ray through the middle of each part."""
        part = (high - low) / wp.float64(wp.static(PARTS))
        area = part[0] * part[1]
        parts = int(wp.static(PARTS))  # a variable, so that the loops are not unrolled
        for j in range(parts):
            for i in range(parts):
                x = low[0] + (wp.float64(i) + wp.float64(0.5)) * part[0]
                y = low[1] + (wp.float64(j) + wp.float64(0.5)) * part[1]
                ray = trace(world, sun, x, y)
                inside = wp.float64(0.0)
                if ray.fate == LANDS or ray.fate == LANDS_ON_MESH:
                    inside = deposit_point(map, size, ray.landing, area * ray.arrived)
                book(ledger, thread, ray, area, inside)

    @wp.kernel(module="unique", enable_backward=False)
    def reference_cells(
        # In:
        world: World,
        sun: wp.vec3d,
        mesh: Mesh2D,
        first_row: int,
        planes: wp.array3d[wp.float64],
        fates: wp.array2d[wp.uint8],
        # Out:
        map_out: wp.array[wp.float64],
        ledger_out: wp.array2d[wp.float64],
    ):
        """One thread a cell; launch dims (rows, columns)."""
        row, column = wp.tid()
        i = wp.float64(mesh.first[0] + column)
        j = wp.float64(first_row + row)
        one = wp.float64(1.0)
        low = water_of(mesh, world, i, j)
        high = water_of(mesh, world, i + one, j + one)
        area = (high[0] - low[0]) * (high[1] - low[1])
        if not area > wp.float64(0.0):
            return
        thread = row * 31 + column
        fate = int(fates[row, column])
        a = landing_of(planes, row, column)
        b = landing_of(planes, row, column + 1)
        c = landing_of(planes, row + 1, column + 1)
        d = landing_of(planes, row + 1, column)
        if wp.static(breaks):
            # A mesh may hide anything between two corners: light on it is followed ray by ray.
            whole = (
                fate != LANDS_ON_MESH and fate == int(fates[row, column + 1]) and fate == int(fates[row + 1, column])
                and fate == int(fates[row + 1, column + 1])
            )  # fmt: skip
            if wp.static(tears):
                spread = wp.max(wp.max(a, b), wp.max(c, d)) - wp.min(wp.min(a, b), wp.min(c, d))
                longest = wp.max(spread[0], spread[1])
                if whole and fate == LANDS and longest > wp.float64(wp.static(LONG)) * mesh.step:
                    half = wp.float64(0.5)
                    middle = trace(world, sun, half * (low[0] + high[0]), half * (low[1] + high[1]))
                    off = middle.landing - wp.float64(0.25) * (a + b + c + d)
                    whole = (
                        middle.fate == LANDS
                        and wp.max(wp.abs(off[0]), wp.abs(off[1])) < wp.float64(wp.static(OFF_CENTRE)) * longest
                    )  # fmt: skip
            if not whole:
                in_parts(map_out, ledger_out, thread, world, sun, mesh.size, low, high)
                return
        ray = Ray()
        ray.fate = fate
        ray.incident = mean_of_corners(planes, wp.static(INCIDENT), row, column)
        ray.transmitted = mean_of_corners(planes, wp.static(TRANSMITTED), row, column)
        for k in range(wp.static(channels)):
            ray.arrived[k] = mean_of_corners(planes, wp.static(ARRIVED) + k, row, column)
        inside = wp.float64(0.0)
        if fate == LANDS:
            inside = deposit_quad(map_out, mesh.size, a, b, c, d, area * ray.arrived)
        elif fate != DROPPED and not wp.isfinite(ray.incident):
            ray.fate = DROPPED
        book(ledger_out, thread, ray, area, inside)

    return reference_cells
