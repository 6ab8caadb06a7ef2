"""What each number format of a map makes of many small amounts, in any order: the kernels' own functions."""

import functools

import numpy as np
import pytest
import warp as wp
from kernel_helpers import points

from warp_caustics.kernels.coverage import make_deposit_triangle
from warp_caustics.kernels.deposit import ACCUMULATOR, FLUX, make_add, unit

FORMATS = ("float32", "float64", "fixed")
STALL = 2**24  # one more than this is the same number to float32
TRIANGLES = 1500
COLUMNS, ROWS = 6, 5


@functools.cache
def make_pile(accumulate):
    add, dtype, flux = make_add(accumulate, 1), ACCUMULATOR[accumulate], FLUX[1]

    @wp.kernel(module="unique", enable_backward=False)
    def pile(amount: float, map_out: wp.array[dtype]):
        add(map_out, 0, flux(amount), 1.0)

    return pile


@functools.cache
def make_lay(accumulate):
    deposit, dtype, flux = make_deposit_triangle(accumulate, 1), ACCUMULATOR[accumulate], FLUX[1]

    @wp.kernel(module="unique", enable_backward=False)
    def lay(
        size: wp.vec2i, a: wp.array[wp.vec2], b: wp.array[wp.vec2], c: wp.array[wp.vec2], amount: wp.array[float],
        map_out: wp.array[dtype],
    ):  # fmt: skip
        i = wp.tid()
        deposit(map_out, size, wp.vec2i(0, 0), a[i], b[i], c[i], flux(amount[i]))

    return lay


def piled(accumulate, start, count, amount, device):
    """Add an amount to one pixel many times, from where others have brought it."""
    kind = {"float32": np.float32, "float64": np.float64, "fixed": np.int64}[accumulate]
    total = wp.array(np.array([start / unit(accumulate)], dtype=kind), dtype=ACCUMULATOR[accumulate], device=device)
    wp.launch(make_pile(accumulate), dim=count, inputs=[amount], outputs=[total], device=device)
    return float(total.numpy()[0]) * unit(accumulate)


@pytest.mark.parametrize("accumulate", FORMATS)
def test_only_float32_stalls(device, accumulate):
    """Two to the 26 ones are 2^24 to float32, and all there to the others."""
    below = piled(accumulate, STALL - 100, 100, 1.0, device)
    assert below == STALL
    above = piled(accumulate, STALL, 1000, 1.0, device)
    assert above == (STALL if accumulate == "float32" else STALL + 1000)


def test_fixed_point_holds_what_a_pixel_can_get(device):
    """2^31 cells of flux 1, less one step: the last that 64 bits hold."""
    most = 2.0**31 - 2.0
    assert piled("fixed", most - 1000.0, 1000, 1.0, device) == most


def laid(accumulate, order, device):
    """Lay the same triangles, in an order, on one map; as the accumulator holds it."""
    rng = np.random.default_rng(11)
    corners = rng.uniform(-1.0, [COLUMNS + 1.0, ROWS + 1.0], (3, TRIANGLES, 2))
    corners[:, ::7] = corners[:1, ::7]  # some without area
    corners[2, ::5] = 0.5 * (corners[0, ::5] + corners[1, ::5]) + 1e-6  # and needles
    flux = rng.uniform(0.0, 2.0, TRIANGLES)[order]
    image = wp.zeros(COLUMNS * ROWS, dtype=ACCUMULATOR[accumulate], device=device)
    inputs = [wp.vec2i(COLUMNS, ROWS), *(points(corner[order], device) for corner in corners)]
    wp.launch(
        make_lay(accumulate), dim=TRIANGLES, inputs=[*inputs, wp.array(flux, dtype=float, device=device)],
        outputs=[image], device=device,
    )  # fmt: skip
    return image.numpy()


def test_fixed_point_triangles_do_not_depend_on_their_order(device):
    """Nor on the run; float32 comes out differently, which is why the format is there."""
    rng = np.random.default_rng(12)
    straight = np.arange(TRIANGLES)
    first, first_32 = laid("fixed", straight, device), laid("float32", straight, device)
    assert first.sum() > 0
    np.testing.assert_array_equal(laid("fixed", straight, device), first)
    differs = False
    for _ in range(3):
        order = rng.permutation(TRIANGLES)
        np.testing.assert_array_equal(laid("fixed", order, device), first)
        differs |= bool((laid("float32", order, device) != first_32).any())
    assert differs
