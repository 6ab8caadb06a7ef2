"""A box blur along one direction; along both, one after the other, it is the square box.

Beyond the border the image repeats mirrored, border texels twice: each texel's weights then add up to one however far
the box reaches out, both in what it gives and in what it takes, so that the sum of the image is kept.

The box has an odd width, around its texel. (`causticMapBlur.frag` of Collard & Mundi's public repository runs from
-n to n - 1, which moves the picture by half a texel; their paper does not say.)
"""

import functools

import warp as wp


@wp.func
def mirrored(i: int, count: int) -> int:
    """Index of a texel in an image that repeats mirrored (OpenGL's GL_MIRRORED_REPEAT): ... 1 0 | 0 1 2 | 2 1 ..."""
    if i >= 0 and i < count:
        return i  # nearly always, and without two divisions
    turn = 2 * count
    place = ((i % turn) + turn) % turn  # the remainder of a negative number is negative
    return wp.min(place, turn - 1 - place)


@wp.func
def box_mean(image: wp.array2d[float], row: int, column: int, row_step: int, column_step: int, radius: int) -> float:
    """Mean of the 2 * radius + 1 texels around one, in steps of so many rows and columns."""
    total = float(0.0)
    for step in range(-radius, radius + 1):
        total += image[
            mirrored(row + step * row_step, image.shape[0]), mirrored(column + step * column_step, image.shape[1])
        ]
    return total / float(2 * radius + 1)


@functools.cache
def make_box_blur(row_step: int, column_step: int) -> wp.Kernel:
    """Blur along the columns of an image, with the steps (1, 0), or along its rows, with (0, 1)."""

    @wp.kernel(module="unique", enable_backward=False)
    def box_blur(
        # In:
        begin: int,
        image: wp.array2d[float],
        radius: int,
        # Out:
        blurred_out: wp.array2d[float],
    ):
        """One thread a texel; launch dims (rows, columns)."""
        row, column = wp.tid()
        row += begin
        blurred_out[row, column] = box_mean(image, row, column, wp.static(row_step), wp.static(column_step), radius)

    return box_blur
