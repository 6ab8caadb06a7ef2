"""Nodes of a bicubic Hermite surface (see ``grid.py``) from heights on the device, by fourth-order differences."""

import functools

import warp as wp

STEEPEST = wp.constant(0)
HIGHEST = wp.constant(1)

EXTREMES = ("slope", "height")
"""What ``make_extremes`` keeps the largest of, in the order of their numbers."""


@wp.func
def stencil_weight(offset: int) -> wp.float64:
    """Weight of a value in the fourth-order first difference: (1, -8, 0, 8, -1) / 12."""
    return wp.float64(wp.sign(offset) * (17 - 9 * wp.abs(offset))) / wp.float64(12.0)


@functools.cache
def make_nodes(periodic: bool) -> wp.Kernel:
    """Make the nodes of water that repeats, or is mirrored at its walls; one thread a node.

    Water between walls has a ring of nodes beyond them: a wall stands half a cell past the last cell's middle, and the
    surface reaches it level.
    """

    @wp.func
    def folded(index: int, count: int) -> int:
        if wp.static(periodic):
            return (index + count) % count
        if index < 0:
            return -1 - index
        if index >= count:
            return 2 * count - 1 - index
        return index

    @wp.kernel(enable_backward=False, module="unique")
    def nodes(
        # In:
        begin: int,
        surface: wp.array2d[wp.float64],
        # Out:
        nodes_out: wp.array2d[wp.vec4],
    ):
        row, column = wp.tid()
        row += begin
        j = row
        i = column
        if wp.static(not periodic):
            j = row - 1
            i = column - 1
        rows, columns = surface.shape[0], surface.shape[1]
        along = wp.float64(0.0)
        across = wp.float64(0.0)
        twist = wp.float64(0.0)
        here = surface[folded(j, rows), folded(i, columns)]
        for right in range(-2, 3):
            if right != 0:
                weight = stencil_weight(right)
                c = folded(i + right, columns)
                along += weight * surface[folded(j, rows), c]
                across += weight * surface[folded(j + right, rows), folded(i, columns)]
                inner = wp.float64(0.0)
                for up in range(-2, 3):
                    if up != 0:
                        inner += stencil_weight(up) * surface[folded(j + up, rows), c]
                twist += weight * inner
        nodes_out[row, column] = wp.vec4(float(here), float(along), float(across), float(twist))

    return nodes


@wp.func
def swapped(node: wp.vec4) -> wp.vec4:
    """A node with x and y exchanged."""
    return wp.vec4(node[0], node[2], node[1], node[3])


@wp.func
def half_way(a: wp.vec4, b: wp.vec4) -> wp.vec4:
    """What a node half-way from one to the next along x would hold: the cubic between them, and its slope."""
    return wp.vec4(
        0.5 * (a[0] + b[0]) + 0.125 * (a[1] - b[1]),
        1.5 * (b[0] - a[0]) - 0.25 * (a[1] + b[1]),
        0.5 * (a[2] + b[2]) + 0.125 * (a[3] - b[3]),
        1.5 * (b[2] - a[2]) - 0.25 * (a[3] + b[3]),
    )


@functools.cache
def make_extremes(periodic: bool) -> wp.Kernel:
    """Find the steepest slope and the largest displacement [m] at all nodes and half-way between; one thread a node.

    A maximum comes out the same in any order of threads.
    """

    @wp.kernel(enable_backward=False, module="unique")
    def extremes(
        # In:
        begin: int,
        nodes: wp.array2d[wp.vec4],
        per_metre: wp.vec2,
        # Out:
        extremes_out: wp.array[float],
    ):
        row, column = wp.tid()
        row += begin
        right = wp.min(column + 1, nodes.shape[1] - 1)
        above = wp.min(row + 1, nodes.shape[0] - 1)
        if wp.static(periodic):
            right = (column + 1) % nodes.shape[1]
            above = (row + 1) % nodes.shape[0]
        here = nodes[row, column]
        beside = half_way(here, nodes[row, right])
        upwards = swapped(half_way(swapped(here), swapped(nodes[above, column])))
        middle = swapped(half_way(swapped(beside), swapped(half_way(nodes[above, column], nodes[above, right]))))
        steepest = float(0.0)
        highest = float(0.0)
        for i in range(4):
            node = here
            if i == 1:
                node = beside
            elif i == 2:
                node = upwards
            elif i == 3:
                node = middle
            steepest = wp.max(steepest, wp.length(wp.vec2(node[1] * per_metre[0], node[2] * per_metre[1])))
            highest = wp.max(highest, wp.abs(node[0]))
        # Most are no new extreme; what another thread writes meanwhile is only larger.
        if steepest > extremes_out[STEEPEST]:
            wp.atomic_max(extremes_out, STEEPEST, steepest)
        if highest > extremes_out[HIGHEST]:
            wp.atomic_max(extremes_out, HIGHEST, highest)

    return extremes
