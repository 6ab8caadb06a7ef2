"""The lattice of cells that cover the water, anchored where its light would land were the water at rest.

Cell corner (i, j) lands, at rest, on map coordinate (i, j) * step in pixels; its water stands upstream of that by the
rest shift. What moves is then only the deviation from rest, a small number that float32 holds to the last digit.
"""

import warp as wp


@wp.struct
class Lattice:
    """Cells of the water and the pixels of the map."""

    step: float  # of a cell [pixels]
    first: wp.vec2i  # index of the first cell
    count: wp.vec2i  # cells
    pixel: wp.vec2  # [m]
    cell_rest: wp.vec2  # what the float32 of step and pixel leave out of a cell's sides [m]
    map: wp.vec2i  # columns and rows of the caustic map
    low: wp.vec2  # where the water begins and ends, metres from the map's origin;
    high: wp.vec2  # beyond the lattice where it has no end


@wp.func
def at_rest(lattice: Lattice, index: wp.vec2i, offset: float) -> wp.vec2:
    """Map coordinate [pixels] at which the light of a lattice point lands when the water is at rest."""
    return wp.vec2((float(index[0]) + offset) * lattice.step, (float(index[1]) + offset) * lattice.step)


@wp.func
def on_water(lattice: Lattice, rest: wp.vec2, shift: wp.vec2) -> wp.vec2:
    """Where the water of a rest coordinate stands, metres from the map's origin, clipped to the water's border."""
    x = rest[0] * lattice.pixel[0] - shift[0]
    y = rest[1] * lattice.pixel[1] - shift[1]
    return wp.vec2(wp.clamp(x, lattice.low[0], lattice.high[0]), wp.clamp(y, lattice.low[1], lattice.high[1]))


@wp.func
def whole(value: float, rest: float) -> wp.float64:
    """A float64 that came as a float32 and what that left out."""
    return wp.float64(value) + wp.float64(rest)


@wp.func
def water_along(lattice: Lattice, axis: int, index: int, offset: float, shift: wp.vec2) -> wp.float64:
    """As :func:`on_water`, along one axis, of a lattice point of water without a border, in float64."""
    side = wp.float64(lattice.step) * wp.float64(lattice.pixel[axis]) + wp.float64(lattice.cell_rest[axis])
    return (wp.float64(index) + wp.float64(offset)) * side - wp.float64(shift[axis])


@wp.func
def clip_to_water(lattice: Lattice, rest: wp.vec2, shift: wp.vec2) -> wp.vec2:
    """A rest coordinate [pixels] moved back to the water's border where it lies beyond."""
    water = on_water(lattice, rest, shift)
    return wp.vec2((water[0] + shift[0]) / lattice.pixel[0], (water[1] + shift[1]) / lattice.pixel[1])


@wp.func
def share_of_cell(lattice: Lattice, low: wp.vec2, high: wp.vec2) -> float:
    """Area of a square at rest [pixels], as a share of a whole cell's."""
    return (high[0] - low[0]) * (high[1] - low[1]) / (lattice.step * lattice.step)


@wp.func
def deviation(lattice: Lattice, distance: float, direction: wp.vec3, shift: wp.vec2) -> wp.vec2:
    """How far from its place at rest a ray of this length lands [pixels]."""
    return wp.vec2(
        (distance * direction[0] - shift[0]) / lattice.pixel[0],
        (distance * direction[1] - shift[1]) / lattice.pixel[1],
    )


@wp.func
def pixel_base(rest: wp.vec2) -> wp.vec2i:
    """The whole pixel that a rest coordinate falls in."""
    return wp.vec2i(int(wp.floor(rest[0])), int(wp.floor(rest[1])))


@wp.func
def pixel_fraction(rest: wp.vec2, base: wp.vec2i) -> wp.vec2:
    """A rest coordinate from its whole pixel."""
    return wp.vec2(rest[0] - float(base[0]), rest[1] - float(base[1]))
