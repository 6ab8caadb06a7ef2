"""The splat as a point and as a box of any width, and the number formats that a map is added up in."""

import numpy as np
import pytest
import warp as wp
from hypothesis import given, settings
from hypothesis import strategies as st
from kernel_helpers import points, rounded

from oracle import deposit_triangles
from warp_caustics.kernels.deposit import FLUX, unit
from warp_caustics.kernels.splat import make_deposit_box

wp.set_module_options({"enable_backward": False})

COLUMNS, ROWS = 8, 6
# Sides of overlaps are differences of coordinates up to 16 pixels, rounded to 1e-6, over the box's width.
SHARE_TOLERANCE = 2e-6
# The promise for box splats inside the map; shares of float32 keep it by an order.
ENERGY_TOLERANCE = 1e-5
EDGE = 1e-5  # [pixels] so near the border, rounding decides on which side of it a point lies
# Some thousand additions to one float32 pixel, each rounded to 6e-8 of what is there already.
FLOAT32_SUM_TOLERANCE = 1e-4
# Additions in float64 of fluxes that float32 has rounded.
FLOAT64_SUM_TOLERANCE = 1e-7

FLUX_1 = FLUX[1]
box_float32 = make_deposit_box("float32", 1)
box_float64 = make_deposit_box("float64", 1)
box_fixed = make_deposit_box("fixed", 1)


@wp.kernel
def splat_apart(
    size: wp.vec2i, bases: wp.array[wp.vec2i], at: wp.array[wp.vec2], widths: wp.array[wp.vec2],
    maps: wp.array2d[float], inside: wp.array[float],
):  # fmt: skip
    i = wp.tid()
    inside[i] = box_float32(maps[i], size, bases[i], at[i], widths[i], FLUX_1(1.0))


@wp.kernel
def splat_together(
    size: wp.vec2i, at: wp.array[wp.vec2], width: wp.vec2, flux: wp.array[float],
    map_32: wp.array[float], map_64: wp.array[wp.float64], map_fixed: wp.array[wp.int64],
):  # fmt: skip
    i = wp.tid()
    base = wp.vec2i(0, 0)
    box_float32(map_32, size, base, at[i], width, FLUX_1(flux[i]))
    box_float64(map_64, size, base, at[i], width, FLUX_1(flux[i]))
    box_fixed(map_fixed, size, base, at[i], width, FLUX_1(flux[i]))


def splat(at, widths, device, bases=None, size=(COLUMNS, ROWS)):
    """Splat boxes at [n, 2], given from their bases, each on a map of its own: maps and shares inside."""
    at = np.asarray(at, np.float32)
    n = len(at)
    bases = np.zeros((n, 2)) if bases is None else bases
    maps = wp.zeros((n + 2, size[0] * size[1]), dtype=float, device=device)
    inside = wp.zeros(n, dtype=float, device=device)
    inputs = [wp.vec2i(*size), wp.array(np.ascontiguousarray(bases, np.int32), dtype=wp.vec2i, device=device)]
    inputs += [points(at, device), points(np.broadcast_to(widths, (n, 2)), device)]
    wp.launch(splat_apart, dim=n, inputs=inputs, outputs=[maps[1 : n + 1], inside], device=device)
    laid = maps.numpy()
    assert (laid[0] == 0.0).all() and (laid[-1] == 0.0).all()
    return laid[1:-1].reshape(n, size[1], size[0]).astype(np.float64), inside.numpy().astype(np.float64)


def expected_shares(at, width, size=(COLUMNS, ROWS)):
    """Overlap of boxes with the pixels over their area, in float64; a point is in the pixel that it falls in."""
    sides = []
    for axis in (0, 1):
        pixel = np.arange(size[axis])
        if min(width) <= 0.0:
            sides.append((np.floor(at[:, axis])[:, None] == pixel).astype(float))
            continue
        low, high = (at[:, axis] + s * 0.5 * width[axis] for s in (-1.0, 1.0))
        overlap = np.minimum(high[:, None], pixel + 1.0) - np.maximum(low[:, None], pixel)
        sides.append(np.maximum(overlap, 0.0) / width[axis])
    return sides[1][:, :, None] * sides[0][:, None, :]


WIDTHS = [(0.0, 0.0), (0.5, 0.5), (1.0, 1.0), (3.7, 3.7), (0.5, 3.7), (0.0, 1.0), (30.0, 30.0)]


@pytest.mark.parametrize("width", WIDTHS)
def test_shares_are_overlaps_on_and_across_the_border(device, width):
    rng = np.random.default_rng(1)
    place = rng.uniform(-3.0, [COLUMNS + 3.0, ROWS + 3.0], (400, 2))
    bases = np.floor(place).astype(int) + rng.integers(-2, 3, (400, 2))
    at = rounded(place - bases)
    maps, inside = splat(at, width, device, bases)
    expected = expected_shares(at + bases, rounded(width))
    assert np.abs(maps - expected).max() < SHARE_TOLERANCE / max(min(width), 0.5)
    assert np.abs(inside - expected.sum(axis=(1, 2))).max() < ENERGY_TOLERANCE
    assert np.abs(maps.sum(axis=(1, 2)) - inside).max() < SHARE_TOLERANCE
    if max(width) < 4.0:
        within = ((at + bases > 2.0) & (at + bases < np.array([COLUMNS, ROWS]) - 2.0)).all(axis=1)
        assert within.sum() > 10
        assert np.abs(inside[within] - 1.0).max() < ENERGY_TOLERANCE


def test_a_four_by_four_map_by_hand(device):
    """A point, a pixel, four quarters, a bilinear footprint, and boxes of a half and of two pixels."""
    at = np.array([[1.2, 2.9], [1.5, 1.5], [2.0, 2.0], [1.75, 2.25], [2.0, 1.5], [2.0, 2.0], [0.0, 0.0], [3.5, 4.0]])
    widths = np.array([0.0, 1.0, 1.0, 1.0, 0.5, 2.0, 1.0, 1.0])[:, None] * np.ones(2)
    maps, inside = splat(at, widths, device, size=(4, 4))
    by_hand = np.zeros((8, 4, 4))
    by_hand[0, 2, 1] = 1.0
    by_hand[1, 1, 1] = 1.0
    by_hand[2, 1:3, 1:3] = 0.25
    # from 1.25 to 2.25 along x, from 1.75 to 2.75 along y
    by_hand[3, 1:3, 1:3] = np.outer([0.25, 0.75], [0.75, 0.25])
    by_hand[4, 1, 1:3] = 0.5
    by_hand[5, 1:3, 1:3] = 0.25
    by_hand[6, 0, 0] = 0.25
    by_hand[7, 3, 3] = 0.5
    assert maps == pytest.approx(by_hand, abs=1e-7)
    assert inside == pytest.approx([1, 1, 1, 1, 1, 1, 0.25, 0.5], abs=1e-7)


def test_a_box_of_one_pixel_is_the_bilinear_splat(device):
    """And the footprint of Yuksel & Keyser: (1 - |dx|)(1 - |dy|), from the middles of the pixels."""
    at = rounded(np.random.default_rng(2).uniform(0.0, [COLUMNS, ROWS], (200, 2)))
    maps, _ = splat(at, (1.0, 1.0), device)
    dx = np.abs(at[:, 0, None] - (np.arange(COLUMNS) + 0.5))
    dy = np.abs(at[:, 1, None] - (np.arange(ROWS) + 0.5))
    expected = np.maximum(0.0, 1.0 - dy)[:, :, None] * np.maximum(0.0, 1.0 - dx)[:, None, :]
    assert np.abs(maps - expected).max() < SHARE_TOLERANCE


def test_a_box_is_its_two_triangles(device):
    """By the polygon clipper, which knows nothing of boxes."""
    at, width = np.array([[3.3, 2.8]]), np.array([3.7, 2.2])
    maps, _ = splat(at, width, device)
    low, high = rounded(at[0]) - 0.5 * rounded(width), rounded(at[0]) + 0.5 * rounded(width)
    image = np.zeros((1, ROWS, COLUMNS))
    x = np.array([[low[0], high[0], high[0]], [low[0], high[0], low[0]]]).T
    y = np.array([[low[1], low[1], high[1]], [low[1], high[1], high[1]]]).T
    deposit_triangles(image, x, y, np.full((1, 2), 0.5))
    assert np.abs(maps[0] - image[0]).max() < SHARE_TOLERANCE


def test_boxes_beside_the_map_and_far_away_are_dropped(device):
    far = [-5.0, 20.0, 1e8, -1e8, 3e9, -3e9, 1e30, -1e30, np.inf, -np.inf]
    at = np.array([[f, 3.0] for f in far] + [[3.0, f] for f in far] + [[f, f] for f in far])
    for width in ((0.0, 0.0), (1.0, 1.0), (3.7, 3.7)):
        maps, inside = splat(at, width, device)
        assert (maps == 0.0).all() and (inside == 0.0).all()
        bases = np.array([[2**30, 0], [-(2**30), 0], [0, 2**30], [0, -(2**30)]])
        maps, inside = splat(np.ones((4, 2)), width, device, bases)
        assert (maps == 0.0).all() and (inside == 0.0).all()


def test_a_place_that_is_no_number_spoils_no_pixel(device):
    """Dropped, or at most put whole into one pixel: int(nan) is 0 on a GPU."""
    nan = np.nan
    at = np.array([[nan, 3.0], [3.0, nan], [nan, nan], [np.inf, nan]])
    for width in ((0.0, 0.0), (1.0, 1.0), (3.7, 3.7)):
        maps, inside = splat(at, width, device)
        assert np.isfinite(maps).all() and np.isfinite(inside).all()
        assert maps.sum() <= 4.0


def sums(at, width, flux, device, size=(4, 4)):
    """All boxes on one map, in each format: float32, float64, and fixed as whole steps."""
    maps = [wp.zeros(size[0] * size[1], dtype=dtype, device=device) for dtype in (float, wp.float64, wp.int64)]
    inputs = [wp.vec2i(*size), points(at, device), wp.vec2(*width), wp.array(flux, dtype=float, device=device)]
    wp.launch(splat_together, dim=len(at), inputs=inputs, outputs=maps, device=device)
    return [image.numpy().reshape(size[1], size[0]) for image in maps]


def test_formats_add_up_to_the_same_map_each_as_well_as_it_can(device):
    rng = np.random.default_rng(5)
    at, flux = rounded(rng.uniform(0.0, 4.0, (6000, 2))), rounded(rng.uniform(0.0, 2.0, 6000))
    expected = (expected_shares(at, (1.5, 1.5), (4, 4)) * flux[:, None, None]).sum(axis=0)
    float32, float64, fixed = sums(at, (1.5, 1.5), flux, device)
    assert float32 == pytest.approx(expected, rel=FLOAT32_SUM_TOLERANCE)
    assert float64 == pytest.approx(expected, rel=10.0 * FLOAT64_SUM_TOLERANCE)  # the shares, too, are float32
    # Each of 6000 fluxes is rounded to a step of 2^-32.
    assert fixed * unit("fixed") == pytest.approx(float64, abs=6000 * unit("fixed"))
    assert unit("float32") == unit("float64") == 1.0


def test_fixed_point_does_not_depend_on_the_order(device):
    """Bit for bit, over many shuffles; float32 does not come out the same, which is why the format is there."""
    rng = np.random.default_rng(6)
    at, flux = rng.uniform(0.0, 4.0, (2000, 2)), rng.uniform(0.0, 2.0, 2000)
    first_32, _, first = sums(at, (1.0, 1.0), flux, device)
    differs = False
    for _ in range(5):
        order = rng.permutation(2000)
        other_32, _, other = sums(at[order], (1.0, 1.0), flux[order], device)
        assert (other == first).all()
        differs |= bool((other_32 != first_32).any())
    assert differs
    assert first.sum() > 0


def test_fixed_point_does_not_depend_on_the_device(device):
    rng = np.random.default_rng(8)
    at, flux = rng.integers(0, 4 * 256, (500, 2)) / 256.0, rng.integers(1, 256, 500) / 256.0
    # Places and fluxes of few digits, so that every share is exact in float32 on any device.
    assert (sums(at, (1.0, 1.0), flux, device)[2] == sums(at, (1.0, 1.0), flux, "cpu")[2]).all()


NARROW = [1e-2, 1e-3, 1e-4, 1e-6, 1e-8]


@pytest.mark.parametrize("width", NARROW)
def test_a_narrow_box_keeps_its_flux(device, width):
    """A footprint is any number: as it narrows, a box becomes a point, whose flux is all there."""
    at = rounded(np.random.default_rng(9).uniform(1.0, [COLUMNS - 1.0, ROWS - 1.0], (300, 2)))
    # Bases as far off as deep, choppy water sends light: the place is a deviation of some hundred pixels.
    bases = np.tile([-100, 120], (300, 1))
    maps, inside = splat(at - bases, (width, width), device, bases)
    assert np.abs(inside - 1.0).max() < ENERGY_TOLERANCE
    assert np.abs(maps.sum(axis=(1, 2)) - 1.0).max() < ENERGY_TOLERANCE


widths = st.floats(0.125, 12.0, width=32) | st.just(0.0)


@settings(deadline=None, max_examples=100)
@given(
    at=st.tuples(st.floats(-10.0, 20.0, width=32), st.floats(-10.0, 20.0, width=32)),
    width=st.tuples(widths, widths),
    base=st.tuples(st.integers(-5, 12), st.integers(-5, 12)),
)
def test_any_box_conserves_its_flux(at, width, base):
    """What is on the map is what is said to be inside, and never more than there was."""
    at = rounded([at]) - base
    maps, inside = splat(at, width, "cpu", np.array([base]))
    assert maps.min() >= 0.0
    spare = 2.0 * ENERGY_TOLERANCE / max(min(width), 0.5)  # coordinates of 1e-6 over the width
    assert abs(maps.sum() - inside[0]) < SHARE_TOLERANCE
    assert inside[0] < 1.0 + spare
    low, high = (rounded(at)[0] + base + s * 0.5 * np.array(width) for s in (-1.0, 1.0))
    if (low > EDGE).all() and (high < np.array([COLUMNS, ROWS]) - EDGE).all():
        assert abs(inside[0] - 1.0) < spare
    if (low > np.array([COLUMNS, ROWS]) + EDGE).any() or (high < -EDGE).any():
        assert inside[0] == 0.0
