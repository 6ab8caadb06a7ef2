"""Lanes: columns of a row worked on side by side, as one of Warp's vectors.

On a CPU a kernel's own loop over the columns of a row stays scalar code. A vector of Warp's is a small array that its
operators go through one by one, and those loops the compiler does turn into the processor's own vectors. So a row is
worked out :data:`LANES` columns at a time, in the language of every other kernel. Made for one thread a row on a CPU.
"""

import warp as wp

LANES = 32
"""Columns at a time: four registers of AVX, two of AVX-512. Up to 16, Warp unrolls a loop over them, and the compiler
no longer sees that it is one; with 64, the sums of a row no longer fit the registers."""

lanes = wp.types.vector(length=LANES, dtype=float)


def padded(columns: int) -> int:
    """Columns of a row filled up to whole lanes, as :func:`lanes_of` needs it."""
    return -(-columns // LANES) * LANES


@wp.func
def lanes_of(plane: wp.array2d[float]) -> wp.array2d[lanes]:
    """See a contiguous plane as ``[row, block of columns]``; it is a whole number of lanes wide."""
    return wp.array(ptr=plane.ptr, shape=(plane.shape[0], plane.shape[1] // wp.static(LANES)), dtype=lanes)


@wp.func
def in_all(value: float) -> lanes:
    """The same number in each lane."""
    filled = lanes()
    for k in range(wp.static(LANES)):
        filled[k] = value
    return filled


@wp.func
def sqrt_lanes(values: lanes) -> lanes:
    """The square root of each lane."""
    roots = lanes()
    for k in range(wp.static(LANES)):
        roots[k] = wp.sqrt(values[k])
    return roots


@wp.func
def floor_lanes(values: lanes) -> lanes:
    """The largest whole number up to each lane."""
    whole = lanes()
    for k in range(wp.static(LANES)):
        whole[k] = wp.floor(values[k])
    return whole
