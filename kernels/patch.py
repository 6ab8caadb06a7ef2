"""A cell of the landed lattice as a smooth interpolant: its corners, its mean flux, and its parts' nodes.

A cell is known by the four by four corners around it. ``planes[plane, row + 1, column + 1]`` is its own first corner,
and so is ``block[1, 1]`` of the block that :func:`read_block` reads.
"""

import functools

import warp as wp

from .deposit import FLUX
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
def read_block(planes: wp.array3d[float], plane: int, row: int, column: int) -> wp.mat44:
    """The corners of a plane around a cell."""
    block = wp.mat44()
    for j in range(wp.static(4)):
        for i in range(wp.static(4)):
            block[j, i] = planes[plane, row + j, column + i]
    return block


@functools.cache
def make_read_flux(spec: Spec) -> wp.Function:
    """The blocks of the flux that arrives, one channel under the other."""
    channels, arrived = spec.channels, arrived_plane(spec)
    blocks_type = wp.types.matrix(shape=(4 * channels, 4), dtype=float)

    @wp.func
    def read_flux(planes: wp.array3d[float], row: int, column: int) -> blocks_type:
        blocks = blocks_type()
        for k in range(wp.static(channels)):
            for j in range(wp.static(4)):
                for i in range(wp.static(4)):
                    blocks[4 * k + j, i] = planes[wp.static(arrived) + k, row + j, column + i]
        return blocks

    return read_flux


@functools.cache
def make_flux_line(channels: int) -> wp.Function:
    """Rows of flux weighted and added up, by channel: the flux along one line through a cell."""
    blocks_type = wp.types.matrix(shape=(4 * channels, 4), dtype=float)
    lines_type = wp.types.matrix(shape=(channels, 4), dtype=float)

    @wp.func
    def flux_line(blocks: blocks_type, v: wp.vec4) -> lines_type:
        lines = lines_type()
        for k in range(wp.static(channels)):
            for i in range(wp.static(4)):
                lines[k, i] = (
                    v[0] * blocks[4 * k, i]
                    + v[1] * blocks[4 * k + 1, i]
                    + v[2] * blocks[4 * k + 2, i]
                    + v[3] * blocks[4 * k + 3, i]
                )
        return lines

    return flux_line


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
    return wp.dot(weights * read_block(planes, plane, row, column), weights)


@wp.func
def corner_mean(planes: wp.array3d[float], plane: int, row: int, column: int) -> float:
    """Mean of a plane over a cell whose sides are straight."""
    return 0.25 * (
        planes[plane, row + 1, column + 1]
        + planes[plane, row + 1, column + 2]
        + planes[plane, row + 2, column + 1]
        + planes[plane, row + 2, column + 2]
    )


@functools.cache
def make_cell_mean(refine: bool) -> wp.Function:
    """Mean of a plane over a cell: of its cubic, if cells are refined and this one has it, or of its corners."""

    @wp.func
    def cell_mean(planes: wp.array3d[float], plane: int, row: int, column: int, cubic: int) -> float:
        if wp.static(refine):
            if cubic == 1:
                return plane_mean(planes, plane, row, column, integral_weights(1))
        return corner_mean(planes, plane, row, column)

    return cell_mean


@functools.cache
def make_flux_mean(spec: Spec, refine: bool) -> wp.Function:
    """Mean of the flux that arrives over a cell, by channel."""
    cell_mean = make_cell_mean(refine)
    channels, arrived, flux_type = spec.channels, arrived_plane(spec), FLUX[spec.channels]

    @wp.func
    def flux_mean(planes: wp.array3d[float], row: int, column: int, cubic: int) -> flux_type:
        mean = flux_type()
        for k in range(wp.static(channels)):
            mean[k] = cell_mean(planes, wp.static(arrived) + k, row, column, cubic)
        return mean

    return flux_mean
