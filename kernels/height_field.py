"""Water as a height field on a grid of cells: h_tt = g d lap(h) - (sigma d / rho) lap(lap(h)) - damping h_t.

It is the flow under the pressure ``p = g d h - (sigma d / rho) lap(h)``, ``v_t = lap(p) - damping v``, ``h_t = v``,
between walls that nothing passes: across the side of a cell that is closed there is no difference. So the Laplacian is
symmetric with obstacles too, its eigenvalues are those of open water at most, and what the integrators promise for one
mode holds for all.
"""

import functools

import warp as wp

FILL_REACH = 3
"""Cells into an obstacle over which the surface around it fades out."""


@wp.struct
class HeightField:
    """The cells, and what drives them."""

    solid: wp.array2d[wp.uint8]  # 1 where an obstacle stands; empty where there is none
    per_area: wp.vec2d  # 1 / (cell along x)^2, 1 / (cell along y)^2 [1/m^2]
    gravity: wp.float64  # g d [m^2/s^2]
    tension: wp.float64  # sigma d / rho [m^4/s^2]


@functools.cache
def make_laplacian(periodic: bool, obstacles: bool) -> wp.Function:
    """Five-point Laplacian of one cell, over its open sides."""

    @wp.func
    def rise(field: HeightField, values: wp.array2d[wp.float64], row: int, column: int, to_row: int, to_column: int):
        """How much more a neighbour has, across an open side."""
        rows, columns = values.shape[0], values.shape[1]
        if wp.static(periodic):
            to_row = (to_row + rows) % rows
            to_column = (to_column + columns) % columns
        else:
            to_row = wp.clamp(to_row, 0, rows - 1)
            to_column = wp.clamp(to_column, 0, columns - 1)
        difference = values[to_row, to_column] - values[row, column]
        if wp.static(obstacles):
            if field.solid[to_row, to_column] != wp.uint8(0):
                difference = wp.float64(0.0)
        return difference

    @wp.func
    def laplacian(field: HeightField, values: wp.array2d[wp.float64], row: int, column: int) -> wp.float64:
        if wp.static(obstacles):
            if field.solid[row, column] != wp.uint8(0):
                return wp.float64(0.0)
        along = rise(field, values, row, column, row, column - 1) + rise(field, values, row, column, row, column + 1)
        across = rise(field, values, row, column, row - 1, column) + rise(field, values, row, column, row + 1, column)
        return along * field.per_area[0] + across * field.per_area[1]

    return laplacian


@functools.cache
def make_pressure(periodic: bool, obstacles: bool, capillary: bool) -> wp.Kernel:
    """Pressure (times depth by density) of the water at a height; one thread a cell."""
    laplacian = make_laplacian(periodic, obstacles)

    @wp.kernel(enable_backward=False, module="unique")
    def pressure(
        # In:
        begin: int,
        field: HeightField,
        height: wp.array2d[wp.float64],
        # Out:
        pressure_out: wp.array2d[wp.float64],
    ):
        row, column = wp.tid()
        row += begin
        value = field.gravity * height[row, column]
        if wp.static(capillary):
            value -= field.tension * laplacian(field, height, row, column)
        pressure_out[row, column] = value

    return pressure


@functools.cache
def make_leap(periodic: bool, obstacles: bool) -> wp.Kernel:
    """Take an explicit step (leapfrog, symplectic); one thread a cell, which changes itself alone.

    Heights are half a step ahead of velocities. With ``drag`` = damping step / 2, taken at the middle:
    ``v' = ((1 - drag) v + step lap(p)) / (1 + drag)``, ``h' = h + step v'``.
    """
    laplacian = make_laplacian(periodic, obstacles)

    @wp.kernel(enable_backward=False, module="unique")
    def leap(
        # In:
        begin: int,
        field: HeightField,
        pressure: wp.array2d[wp.float64],
        step: wp.float64,
        drag: wp.float64,
        # Out:
        velocity_out: wp.array2d[wp.float64],
        height_out: wp.array2d[wp.float64],
    ):
        row, column = wp.tid()
        row += begin
        one = wp.float64(1.0)
        velocity = (one - drag) * velocity_out[row, column] + step * laplacian(field, pressure, row, column)
        velocity = velocity / (one + drag)
        velocity_out[row, column] = velocity
        height_out[row, column] = height_out[row, column] + step * velocity

    return leap


@wp.kernel(enable_backward=False)
def begin_solve(
    # In:
    begin: int,
    height: wp.array2d[wp.float64],
    velocity: wp.array2d[wp.float64],
    ahead: wp.float64,
    # Out:
    mean_out: wp.array2d[wp.float64],
):
    """First guess of the mean of a step's two heights: its right-hand side ``h + ahead v``; one thread a cell."""
    row, column = wp.tid()
    row += begin
    mean_out[row, column] = height[row, column] + ahead * velocity[row, column]


@functools.cache
def make_solve(periodic: bool, obstacles: bool) -> wp.Kernel:
    """One iteration of Chebyshev's method on ``(1 - stiffness lap p) mean = h + ahead v``; one thread a cell.

    ``pressure`` is that of ``mean_out`` as it stands. ``change = kept change + gained residual``, by which the mean
    moves.
    """
    laplacian = make_laplacian(periodic, obstacles)

    @wp.kernel(enable_backward=False, module="unique")
    def solve(
        # In:
        begin: int,
        field: HeightField,
        height: wp.array2d[wp.float64],
        velocity: wp.array2d[wp.float64],
        pressure: wp.array2d[wp.float64],
        ahead: wp.float64,
        stiffness: wp.float64,
        kept: wp.float64,
        gained: wp.float64,
        # Out:
        change_out: wp.array2d[wp.float64],
        mean_out: wp.array2d[wp.float64],
    ):
        row, column = wp.tid()
        row += begin
        mean = mean_out[row, column]
        residual = height[row, column] + ahead * velocity[row, column] - mean
        residual += stiffness * laplacian(field, pressure, row, column)
        change = kept * change_out[row, column] + gained * residual
        change_out[row, column] = change
        mean_out[row, column] = mean + change

    return solve


@wp.kernel(enable_backward=False)
def end_solve(
    # In:
    begin: int,
    mean: wp.array2d[wp.float64],
    per_half_step: wp.float64,
    # Out:
    velocity_out: wp.array2d[wp.float64],
    height_out: wp.array2d[wp.float64],
):
    """Reflect the old state at the mean: ``h' = 2 mean - h``, ``v' = 4 (mean - h) / step - v``; one thread a cell."""
    row, column = wp.tid()
    row += begin
    two = wp.float64(2.0)
    half = mean[row, column] - height_out[row, column]
    velocity_out[row, column] = two * per_half_step * half - velocity_out[row, column]
    height_out[row, column] = height_out[row, column] + two * half


@functools.cache
def make_drop(obstacles: bool) -> wp.Kernel:
    """Add a drop, the product of a row's and a column's profile, to the water; one thread a cell."""

    @wp.kernel(enable_backward=False, module="unique")
    def drop(
        # In:
        begin: int,
        field: HeightField,
        row_profiles: wp.array2d[wp.float64],
        column_profiles: wp.array2d[wp.float64],
        number: int,
        # Out:
        height_out: wp.array2d[wp.float64],
    ):
        row, column = wp.tid()
        row += begin
        rise = row_profiles[number, row] * column_profiles[number, column]
        if wp.static(obstacles):
            if field.solid[row, column] != wp.uint8(0):
                rise = wp.float64(0.0)
        height_out[row, column] = height_out[row, column] + rise

    return drop


@functools.cache
def make_surface(periodic: bool, obstacles: bool) -> wp.Kernel:
    """Height of the water at whole steps [m], ``h - lag v``; one thread a cell.

    Inside an obstacle the surface around it fades out over some cells, a normalised convolution: a step at its rim
    would focus light that no water bent.
    """

    @wp.kernel(enable_backward=False, module="unique")
    def surface(
        # In:
        begin: int,
        field: HeightField,
        height: wp.array2d[wp.float64],
        velocity: wp.array2d[wp.float64],
        lag: wp.float64,
        # Out:
        surface_out: wp.array2d[wp.float64],
    ):
        row, column = wp.tid()
        row += begin
        value = height[row, column] - lag * velocity[row, column]
        if wp.static(obstacles):
            if field.solid[row, column] != wp.uint8(0):
                rows, columns = height.shape[0], height.shape[1]
                total = wp.float64(0.0)
                # Calm water in the cell itself weighs 1: the fade is then about even over the reach.
                weights = wp.float64(1.0)
                for j in range(wp.static(-FILL_REACH), wp.static(FILL_REACH + 1)):
                    for i in range(wp.static(-FILL_REACH), wp.static(FILL_REACH + 1)):
                        r = row + j
                        c = column + i
                        if wp.static(periodic):
                            r = (r + rows) % rows
                            c = (c + columns) % columns
                        if r >= 0 and r < rows and c >= 0 and c < columns:
                            if field.solid[r, c] == wp.uint8(0):
                                weight = wp.exp(-wp.float64(i * i + j * j) / wp.float64(wp.static(FILL_REACH)))
                                total += weight * (height[r, c] - lag * velocity[r, c])
                                weights += weight
                value = total / weights
        surface_out[row, column] = value

    return surface
