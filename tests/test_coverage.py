"""Exact overlap of triangles with pixels, against a polygon clipper in float64."""

import numpy as np
import pytest
import warp as wp
from hypothesis import example, given, settings
from hypothesis import strategies as st
from kernel_helpers import points, rounded

from oracle import deposit_triangles
from warp_caustics.kernels.coverage import NEEDLE, make_deposit_triangle, mean_clamp
from warp_caustics.kernels.deposit import FLUX, unit

wp.set_module_options({"enable_backward": False})

COLUMNS, ROWS = 12, 9
# An overlap is a difference of sums of products of coordinates up to the triangle's extent, each rounded to 6e-8; the
# share is that over the area.
ROUNDING = 5e-7
# A needle's flux stands on a lattice of points a quarter of a pixel apart: by pixel of its length, half of that may be
# beside the right pixel, at each of its two ends.
NEEDLE_ERROR = 0.25
# The sum of some hundred float32 shares of one; of the few thousand points of a needle, added one by one.
ENERGY_TOLERANCE = 1e-6
NEEDLE_ENERGY_TOLERANCE = 1e-4
EDGE = 1e-5  # [pixels] so near the border, rounding decides on which side of it a line lies

FLUX_1, FLUX_3 = FLUX[1], FLUX[3]
deposit_one = make_deposit_triangle("float32", 1)
deposit_fixed = make_deposit_triangle("fixed", 3)


@wp.kernel
def deposit(
    size: wp.vec2i, bases: wp.array[wp.vec2i], a: wp.array[wp.vec2], b: wp.array[wp.vec2], c: wp.array[wp.vec2],
    maps: wp.array2d[float], inside: wp.array[float],
):  # fmt: skip
    i = wp.tid()
    inside[i] = deposit_one(maps[i], size, bases[i], a[i], b[i], c[i], FLUX_1(1.0))


@wp.kernel
def deposit_colours(
    size: wp.vec2i, bases: wp.array[wp.vec2i], a: wp.array[wp.vec2], b: wp.array[wp.vec2], c: wp.array[wp.vec2],
    flux: wp.vec3, maps: wp.array2d[wp.int64], inside: wp.array[float],
):  # fmt: skip
    i = wp.tid()
    inside[i] = deposit_fixed(maps[i], size, bases[i], a[i], b[i], c[i], flux)


@wp.kernel
def means(ends: wp.array[wp.vec2], out: wp.array[float]):
    i = wp.tid()
    out[i] = mean_clamp(ends[i][0], ends[i][1])


def lay_down(corners, bases, device, size=(COLUMNS, ROWS)):
    """Deposit triangles [n, 3, 2], given from their bases [n, 2], each on a map of its own: maps and shares inside.

    The maps lie side by side in memory: a write past the end of one shows in its neighbour.
    """
    corners, bases = np.asarray(corners, np.float32), np.ascontiguousarray(bases, np.int32)
    n = len(corners)
    maps = wp.zeros((n + 2, size[0] * size[1]), dtype=float, device=device)
    inside = wp.zeros(n, dtype=float, device=device)
    inputs = [wp.vec2i(*size), wp.array(bases, dtype=wp.vec2i, device=device)]
    inputs += [points(corners[:, k], device) for k in range(3)]
    wp.launch(deposit, dim=n, inputs=inputs, outputs=[maps[1 : n + 1], inside], device=device)
    laid = maps.numpy()
    assert (laid[0] == 0.0).all() and (laid[-1] == 0.0).all()
    return laid[1:-1].reshape(n, size[1], size[0]).astype(np.float64), inside.numpy().astype(np.float64)


def clip(corners, bases, size=(COLUMNS, ROWS)):
    """The same by the clipper."""
    maps = np.zeros((len(corners), size[1], size[0]))
    for image, triangle, base in zip(maps, rounded(corners), bases, strict=True):
        x, y = (triangle + base).T
        deposit_triangles(image[None], x[:, None], y[:, None], np.ones((1, 1)))
    return maps


def area_and_extent(corners):
    """Area and larger side of the box around triangles [n, 3, 2]."""
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return 0.5 * np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]), np.ptp(corners, axis=1).max(axis=1)


def share_tolerance(corners):
    """What float32 leaves of each triangle's shares, by what they are computed from."""
    area, extent = area_and_extent(corners)
    reach = np.maximum(np.abs(corners).max(axis=(1, 2)), 1.0)
    return ROUNDING * np.maximum(reach, extent) / np.maximum(area, 1e-30) + ROUNDING


def check(corners, bases, device, size=(COLUMNS, ROWS)):
    """Shares equal the clipper's; what is not on the map is not counted; nothing is lost inside."""
    corners = rounded(corners)
    maps, inside = lay_down(corners, bases, device, size)
    expected = clip(corners, bases, size)
    area, extent = area_and_extent(corners)
    plump = area > 2.0 * NEEDLE * extent
    error = np.abs(maps - expected).max(axis=(1, 2))
    assert (error[plump] < share_tolerance(corners)[plump]).all()
    spare = np.where(plump, ENERGY_TOLERANCE, NEEDLE_ENERGY_TOLERANCE)
    assert (np.abs(maps.sum(axis=(1, 2)) - inside) < spare).all()
    low, high = corners.min(axis=1) + bases, corners.max(axis=1) + bases
    within = ((low > EDGE) & (high < np.array(size) - EDGE)).all(axis=1)
    assert (np.abs(inside - 1.0) < spare)[within].all()
    missed = ((low > np.array(size) + EDGE) | (high < -EDGE)).any(axis=1)
    assert (inside[missed] == 0.0).all()
    return maps, inside


def random_triangles(n, extent, seed, spread=2.0):
    """Triangles of about an extent, anywhere on the map or up to ``spread`` beside it, from whole pixels near them."""
    rng = np.random.default_rng(seed)
    middle = rng.uniform(-spread, np.array([COLUMNS, ROWS]) + spread, (n, 2))
    corners = middle[:, None, :] + extent * rng.uniform(-0.5, 0.5, (n, 3, 2))
    bases = np.floor(middle).astype(int) + rng.integers(-2, 3, (n, 2))
    return corners - bases[:, None, :], bases


@pytest.mark.parametrize("extent", [0.05, 0.7, 2.0, 7.0, 40.0])
def test_random_triangles_on_and_across_the_border(device, extent):
    corners, bases = random_triangles(300, extent, seed=int(10 * extent))
    _, inside = check(corners, bases, device)
    assert (inside > 0.0).any() and (inside < 1.0).any()


def test_a_four_by_four_map_by_hand(device):
    """Half of a 2 x 2 square; the same turned round; a square's two halves; one across the left border."""
    triangles = np.array([
        [[0, 0], [2, 0], [0, 2]], [[0, 2], [2, 0], [0, 0]], [[1, 1], [3, 1], [3, 3]], [[1, 1], [3, 3], [1, 3]],
        [[-1, 1], [1, 1], [0, 2]], [[0.5, 0.5], [3.5, 0.5], [0.5, 3.5]],
    ], float)  # fmt: skip
    maps, inside = lay_down(triangles, np.zeros((6, 2)), device, (4, 4))
    half = np.array([[0.5, 0.25, 0, 0], [0.25, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0]])
    assert maps[0] == pytest.approx(half, abs=1e-7)
    assert maps[1] == pytest.approx(half, abs=1e-7)
    square = np.zeros((4, 4))
    square[1:3, 1:3] = 0.5
    assert maps[2] + maps[3] == pytest.approx(square, abs=1e-7)
    across = np.zeros((4, 4))
    across[1, 0] = 0.5
    assert maps[4] == pytest.approx(across, abs=1e-7)
    # Legs of 3 from a pixel's middle: 1/4 there, 1/2 along the legs and the slanted side, 1 inside, 1/8 at the ends.
    large = np.array([[2, 4, 4, 1], [4, 8, 4, 0], [4, 4, 0, 0], [1, 0, 0, 0]]) / 8.0 / 4.5
    assert maps[5] == pytest.approx(large, abs=1e-7)
    assert inside == pytest.approx([1.0, 1.0, 1.0, 1.0, 0.5, 1.0], abs=1e-6)


def test_tiny_triangles_stay_in_the_pixels_they_touch(device):
    """Down to a millionth of a pixel, across pixel lines and corners: energy exact, nothing beside."""
    for extent in (1e-2, 1e-3, 1e-4, 1e-6):
        rng = np.random.default_rng(int(-np.log10(extent)))
        middle = rng.integers(1, 8, (100, 2)) + np.where(rng.random((100, 2)) < 0.5, 0.0, rng.random((100, 2)))
        corners = middle[:, None, :] + extent * rng.uniform(-0.5, 0.5, (100, 3, 2))
        bases = np.floor(middle).astype(int)
        maps, inside = check(corners - bases[:, None, :], bases, device)
        assert np.abs(inside - 1.0).max() < ENERGY_TOLERANCE
        assert np.abs(maps[clip(corners - bases[:, None, :], bases) == 0.0]).max() == 0.0


@pytest.mark.parametrize("reach", [1e2, 1e4, 1e6])
def test_triangles_that_cover_the_map(device, reach):
    """Every pixel gets its part, 1 / area, however far the corners are."""
    corners = np.array([[[-reach, -reach], [2.5 * reach, -0.9 * reach], [-0.8 * reach, 2.3 * reach]]])
    corners = np.concatenate([corners, corners[:, ::-1]])
    maps, inside = lay_down(corners, np.zeros((2, 2)), device)
    area, _ = area_and_extent(rounded(corners))
    assert maps * area[:, None, None] == pytest.approx(np.ones_like(maps), rel=1e-5)
    assert inside * area == pytest.approx(np.full(2, COLUMNS * ROWS), rel=1e-5)


def needles(n, seed):
    """Triangles without area, or with next to none, on the map and across its border."""
    rng = np.random.default_rng(seed)
    a = rng.uniform(0.0, [COLUMNS, ROWS], (n, 2))
    way = rng.uniform(-4.0, 4.0, (n, 2))
    middle = a + rng.random((n, 1)) * way + 1e-5 * rng.uniform(-1.0, 1.0, (n, 2))
    corners = np.stack([a, middle, a + way], axis=1)
    bases = np.floor(a).astype(int)
    return corners - bases[:, None, :], bases


def test_needles_lie_along_their_line(device):
    corners, bases = needles(200, 11)
    maps, inside = check(corners, bases, device)
    expected = clip(corners, bases)
    area, extent = area_and_extent(rounded(corners))
    assert (area <= NEEDLE * extent).mean() > 0.9
    wrong = 0.5 * np.abs(maps - expected).sum(axis=(1, 2))
    assert (wrong < NEEDLE_ERROR / np.maximum(extent, 1.0)).all()
    assert np.abs(inside - expected.sum(axis=(1, 2))).max() < NEEDLE_ERROR
    assert maps.min() >= 0.0


def test_thin_triangles_lose_nothing_to_rounding(device):
    """Just too wide for a needle, their overlaps are rounded to 1e-3 of their area: what is left over is made good."""
    rng = np.random.default_rng(12)
    n, turn = 300, rng.uniform(0.0, 2.0 * np.pi, 300)
    way = rng.uniform(0.5, 4.0, (n, 1)) * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    aside = rng.uniform(4e-4, 1e-3, (n, 1)) * np.stack([-np.sin(turn), np.cos(turn)], axis=1)
    middle = rng.uniform(2.0, [COLUMNS - 2.0, ROWS - 2.0], (n, 2))
    bases = np.floor(middle).astype(int)
    corners = np.stack([-0.5 * way, 0.5 * way, rng.uniform(-0.5, 0.5, (n, 1)) * way + aside], axis=1)
    corners = corners + (middle - bases)[:, None, :]
    maps, inside = check(corners, bases, device)
    assert np.abs(maps.sum(axis=(1, 2)) - 1.0).max() < ENERGY_TOLERANCE
    assert (inside == 1.0).all()


def test_needles_along_a_row_a_column_and_a_pixel_line(device):
    """Edge-on cells of flat water: lines of no area at all, the last one just on the border between rows."""
    corners = np.array([[[1.25, 2.5], [4.25, 2.5], [2.25, 2.5]], [[3.5, 1.25], [3.5, 1.5], [3.5, 6.75]],
                        [[1.5, 3.0], [2.5, 3.0], [3.5, 3.0]]])  # fmt: skip
    maps, inside = lay_down(corners, np.zeros((3, 2)), device)
    assert inside == pytest.approx(np.ones(3), abs=NEEDLE_ENERGY_TOLERANCE)
    assert maps[0, 2].sum() == pytest.approx(1.0, abs=NEEDLE_ENERGY_TOLERANCE)
    assert maps[1, :, 3].sum() == pytest.approx(1.0, abs=NEEDLE_ENERGY_TOLERANCE)
    assert maps[2, 2:4].sum() == pytest.approx(1.0, abs=NEEDLE_ENERGY_TOLERANCE)


def test_a_point_lies_in_one_pixel(device):
    """Three corners in one place: inside, on a line, at the border and beside it."""
    at = np.array([[2.5, 3.5], [4.0, 5.0], [0.0, 0.0], [12.0, 4.0], [11.99, 8.99], [-0.01, 4.0], [3.0, 9.0]])
    maps, inside = lay_down(np.repeat(at[:, None, :], 3, axis=1), np.zeros((7, 2)), device)
    assert inside.tolist() == [1.0, 1.0, 1.0, 0.0, 1.0, 0.0, 0.0]
    for i, (column, row) in {0: (2, 3), 1: (4, 5), 2: (0, 0), 4: (11, 8)}.items():
        assert maps[i, row, column] == 1.0


def test_triangles_beside_the_map_leave_nothing_on_it(device):
    corners = np.array([[[0, 0], [1, 0], [0, 1]]]) + np.array([
        [[-1.5, 3]], [[12.0, 3]], [[3, -1.0]], [[3, 9.0]], [[-50, -50]], [[1000, 3]]
    ])  # fmt: skip
    maps, inside = lay_down(corners, np.zeros((6, 2)), device)
    assert np.abs(maps).max() == 0.0
    assert np.abs(inside).max() == 0.0


FAR_CORNERS = [1e5, 1e8, 3e9, 1e19, 1e30]


@pytest.mark.parametrize("far", [*FAR_CORNERS, np.inf])
def test_triangles_far_beside_the_map_are_dropped(device, far):
    """A landing far away must not overflow an index; bases as far as int32 reaches."""
    small = np.array([[[0, 0], [1, 0], [0, 1]]], float)
    ways = np.array([[[far, 0]], [[-far, 3]], [[3, far]], [[3, -far]], [[far, -far]]])
    maps, inside = lay_down(small + ways, np.zeros((5, 2)), device)
    assert (maps == 0.0).all() and (inside == 0.0).all()
    bases = np.array([[2**30, 3], [-(2**30), 3], [3, 2**30], [3, -(2**30)], [2**30, 2**30]])
    maps, inside = lay_down(np.repeat(small, 5, axis=0), bases, device)
    assert (maps == 0.0).all() and (inside == 0.0).all()


@pytest.mark.parametrize("far", FAR_CORNERS)
def test_one_corner_far_away_leaves_the_map_finite_and_no_light_too_much(device, far):
    """Streaks across the map: their shares are as small as their area is large."""
    corners = np.array([
        [[3, 3], [4, 3], [far, 4]], [[3, 3], [-far, 4], [4, 3]], [[3, far], [3, 3], [4, 4]],
        [[3, 3], [4, 4], [far, far]], [[-far, 3], [far, 4], [3, 5]],
    ])  # fmt: skip
    maps, inside = lay_down(corners, np.zeros((5, 2)), device)
    assert np.isfinite(maps).all() and np.isfinite(inside).all()
    assert maps.min() > -1e-3 and maps.sum(axis=(1, 2)).max() < 1.0 + 1e-3
    assert (inside > -1e-3).all() and (inside < 1.0 + 1e-3).all()


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("corner", [0, 1, 2])
def test_corners_that_are_no_numbers_spoil_no_pixel(device, bad, corner):
    """Dropped, or bounded: never a NaN on the map, which one would be for good."""
    small = np.array([[3, 3], [4, 3], [3, 4]], float)
    wide = np.array([[3, 3], [7, 3.5], [4, 7]])
    corners = np.stack([small, small, small, wide, wide, wide])
    for i, axes in enumerate(([0], [1], [0, 1]) * 2):
        corners[i, corner, axes] = bad
    maps, inside = lay_down(corners, np.zeros((6, 2)), device)
    assert np.isfinite(maps).all() and np.isfinite(inside).all()
    assert np.abs(maps).max() <= 1.0


def test_a_triangle_turned_round_or_seen_from_another_base_is_the_same(device):
    corners, bases = random_triangles(100, 3.0, seed=21)
    maps, _ = lay_down(corners, bases, device)
    for order in ([1, 2, 0], [2, 1, 0]):
        turned, _ = lay_down(corners[:, order], bases, device)
        assert (np.abs(turned - maps).max(axis=(1, 2)) < 2.0 * share_tolerance(corners)).all()
    shift = np.array([5, -3])
    moved, _ = lay_down(corners + shift, bases - shift, device)
    assert (np.abs(moved - maps).max(axis=(1, 2)) < 4.0 * share_tolerance(corners)).all()


def test_a_mesh_of_triangles_covers_every_pixel_once(device):
    """A jittered lattice over the map, each triangle with the flux of its area: uniform light, to rounding."""
    rng = np.random.default_rng(3)
    x, y = np.meshgrid(np.arange(-1.0, COLUMNS + 2.0, 0.9), np.arange(-1.0, ROWS + 2.0, 0.9))
    p = np.stack([x, y], axis=-1) + rng.uniform(-0.3, 0.3, (*x.shape, 2))
    a, b, c, d = p[:-1, :-1], p[:-1, 1:], p[1:, 1:], p[1:, :-1]
    corners = rounded(np.concatenate([np.stack(t, axis=2).reshape(-1, 3, 2) for t in ((a, b, c), (a, c, d))]))
    maps, _ = lay_down(corners, np.zeros((len(corners), 2)), device)
    area, _ = area_and_extent(corners)
    assert (maps * area[:, None, None]).sum(axis=0) == pytest.approx(np.ones((ROWS, COLUMNS)), abs=2e-5)


def test_colours_in_fixed_point(device):
    """Three channels keep their proportion, and the sum is exact to the step of the format in each pixel."""
    corners, bases = random_triangles(50, 3.0, seed=31)
    n = len(corners)
    maps = wp.zeros((n, COLUMNS * ROWS * 3), dtype=wp.int64, device=device)
    inside = wp.zeros(n, dtype=float, device=device)
    inputs = [wp.vec2i(COLUMNS, ROWS), wp.array(bases.astype(np.int32), dtype=wp.vec2i, device=device)]
    inputs += [points(corners[:, k], device) for k in range(3)] + [wp.vec3(1.0, 0.5, 0.0)]
    wp.launch(deposit_colours, dim=n, inputs=inputs, outputs=[maps, inside], device=device)
    laid = maps.numpy().reshape(n, ROWS, COLUMNS, 3) * unit("fixed")
    single, share = lay_down(corners, bases, device)
    assert laid[..., 0] == pytest.approx(single, abs=1e-7)
    assert laid[..., 1] == pytest.approx(0.5 * single, abs=1e-7)
    assert (laid[..., 2] == 0.0).all()
    assert (inside.numpy() == share).all()


coordinate = st.one_of(
    st.floats(-6.0, 18.0, width=32), st.integers(-2, 14).map(float), st.sampled_from([0.5, 3.25, 1e-6, 11.999999])
)


@settings(deadline=None, max_examples=150)
@given(
    corners=st.lists(st.tuples(coordinate, coordinate), min_size=3, max_size=3),
    base=st.tuples(st.integers(-3, 14), st.integers(-3, 12)),
)
@example(corners=[(0.0, 0.0), (12.0, 0.0), (12.0, 9.0)], base=(0, 0))
@example(corners=[(0.0, 0.0), (0.0, 9.0), (0.0, 4.0)], base=(0, 0))
@example(corners=[(1.0, 1.0), (5.0, 1.0), (3.0, 1.0000001)], base=(0, 0))
def test_any_triangle_equals_the_clipper_and_conserves_its_flux(corners, base):
    corners, bases = np.array([corners]) - base, np.array([base])
    maps, _ = check(corners, bases, "cpu")
    area, extent = area_and_extent(rounded(corners))
    spare = share_tolerance(rounded(corners))[0] if area[0] > 2.0 * NEEDLE * extent[0] else 1e-2
    assert maps.min() > -spare


@settings(deadline=None, max_examples=100)
@given(
    ends=st.lists(st.tuples(coordinate, coordinate).map(lambda p: (p[0] - 2.0, p[1] - 2.0)), min_size=1, max_size=20)
)
def test_mean_of_a_clamped_coordinate(ends):
    """The integral of clamp(x, 0, 1) is 0, x²/2 and x - 1/2 in turn."""
    ends = rounded(ends) - 2.0
    out = wp.zeros(len(ends), dtype=float, device="cpu")
    wp.launch(means, dim=len(ends), inputs=[points(ends, "cpu")], outputs=[out], device="cpu")

    def integral(x):
        return np.where(x < 0.0, 0.0, np.where(x < 1.0, 0.5 * x * x, x - 0.5))

    a, b = ends.T
    with np.errstate(invalid="ignore", divide="ignore"):
        expected = np.where(
            np.abs(b - a) > 1e-5, (integral(b) - integral(a)) / (b - a), np.clip(0.5 * (a + b), 0.0, 1.0)
        )
    assert out.numpy() == pytest.approx(expected, abs=2e-6)
