"""The beam's deposit by edges, against a polygon clipper in float64 and against its triangles one by one."""

import numpy as np
import pytest
import warp as wp
from scenery import bundled

import warp_caustics as wc
from oracle import deposit_triangles
from warp_caustics.kernels.cell_rows import make_cell_rows
from warp_caustics.kernels.deposit import FLUX
from warp_caustics.kernels.edge_cells import make_edge_cells
from warp_caustics.kernels.edge_triangle import make_deposit_edged_triangle
from warp_caustics.kernels.edges import SLIVER
from warp_caustics.kernels.lanes import LANES
from warp_caustics.kernels.lattice import Lattice
from warp_caustics.kernels.ledger import BINS, ENTRIES, OUTSIDE_MAP
from warp_caustics.kernels.patch import BORDER
from warp_caustics.kernels.photon import SunSample
from warp_caustics.kernels.resolve_steps import make_resolve_steps
from warp_caustics.kernels.spec import Spec
from warp_caustics.metrics import relative_l2

wp.set_module_options({"enable_backward": False})

COLUMNS, ROWS = 12, 9
STEPS = (COLUMNS + 1) * (ROWS + 1) + 1
# Float64 rounds a crossing by 1e-15 of the map's width, and the steps of the thinnest triangle are 1e5 times its light.
EXACT = 1e-9
# Shares come back as float32.
ROUNDING = 1e-6
# Triangles one by one are clipped in float32 from a whole pixel near them, and those thinner than 1e-4 pixels are
# points along a line: single pixels at folds differ by some percent of the mean, the map by this much.
FORMS = 4e-4

FLUX_1, FLUX_3 = FLUX[1], FLUX[3]
deposit_one = make_deposit_edged_triangle(1)
deposit_three = make_deposit_edged_triangle(3)


@wp.kernel
def deposit(size: wp.vec2i, corners: wp.array2d[wp.vec2d], steps: wp.array2d[wp.float64], inside: wp.array[float]):
    i = wp.tid()
    inside[i] = deposit_one(steps[i], size, corners[i, 0], corners[i, 1], corners[i, 2], FLUX_1(1.0))


@wp.kernel
def deposit_all(size: wp.vec2i, corners: wp.array2d[wp.vec2d], flux: wp.vec3, steps: wp.array[wp.float64]):
    i = wp.tid()
    deposit_three(steps, size, corners[i, 0], corners[i, 1], corners[i, 2], flux)


def lay_down(corners, device):
    """Deposit triangles [n, 3, 2], each on a map of its own between others that nothing may write to."""
    n = len(corners)
    steps = wp.zeros((n + 2, STEPS), dtype=wp.float64, device=device)
    inside = wp.zeros(n, dtype=float, device=device)
    places = wp.array(np.asarray(corners, dtype=np.float64), dtype=wp.vec2d, device=device)
    wp.launch(deposit, dim=n, inputs=[wp.vec2i(COLUMNS, ROWS), places, steps[1 : n + 1], inside], device=device)
    laid = steps.numpy()
    assert (laid[0] == 0.0).all() and (laid[-1] == 0.0).all()
    light = np.cumsum(laid[1:-1, :-1].reshape(n, ROWS + 1, COLUMNS + 1), axis=2)
    assert np.abs(light[:, ROWS]).max() < EXACT  # the row above the map
    return light[:, :ROWS, :COLUMNS], inside.numpy()


def clip(corners):
    """The same by the clipper."""
    maps = np.zeros((len(corners), ROWS, COLUMNS))
    for image, triangle in zip(maps, corners, strict=True):
        x, y = triangle.T
        deposit_triangles(image[None], x[:, None], y[:, None], np.ones((1, 1)))
    return maps


def anywhere(n, extent, seed):
    """Triangles of about an extent, on the map or up to two pixels beside it."""
    rng = np.random.default_rng(seed)
    middle = rng.uniform(-2.0, np.array([COLUMNS, ROWS]) + 2.0, (n, 1, 2))
    return middle + extent * rng.uniform(-0.5, 0.5, (n, 3, 2))


def area_over_extent(corners):
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) / np.ptp(corners, axis=1).max(axis=1)


@pytest.mark.parametrize("extent", [0.1, 1.0, 4.0, 40.0, 1e4])
def test_a_triangle_is_clipped_exactly(device, extent):
    corners = anywhere(150, extent, seed=1)
    light, inside = lay_down(corners, device)
    expected = clip(corners)
    plump = area_over_extent(corners) > 10.0 * float(SLIVER)
    assert plump.mean() > 0.9
    np.testing.assert_allclose(light[plump], expected[plump], atol=EXACT)
    np.testing.assert_allclose(inside, light.sum(axis=(1, 2)), atol=ROUNDING)


def test_corners_and_edges_on_the_grid(device):
    """What lies on lines between pixels, and on the border, belongs to one side, and is written nowhere else."""
    corners = np.round(anywhere(300, 5.0, seed=2))
    corners[150:] = 0.5 * np.round(2.0 * corners[150:])
    corners = corners[area_over_extent(corners) > 0.0]
    light, _ = lay_down(corners, device)
    np.testing.assert_allclose(light, clip(corners), atol=EXACT)


def test_a_triangle_without_area_keeps_its_light(device):
    corners = anywhere(60, 3.0, seed=3)
    corners[:, 2] = corners[:, 0] + 0.3 * (corners[:, 1] - corners[:, 0])
    corners[20:40, 1:] = corners[20:40, :1]
    light, inside = lay_down(corners, device)
    within = ((corners > 0.0) & (corners < [COLUMNS, ROWS])).all(axis=(1, 2))
    assert within.sum() > 20
    np.testing.assert_allclose(light[within].sum(axis=(1, 2)), 1.0, atol=1e-5)
    np.testing.assert_allclose(inside, light.sum(axis=(1, 2)), atol=1e-5)
    assert (light[20:40].astype(bool).sum(axis=(1, 2)) <= 1).all()  # a point is in one pixel


def test_light_without_a_place_or_beside_the_map_is_left_out(device):
    corners = np.tile([[[1.0, 1.0], [4.0, 1.0], [1.0, 4.0]]], (6, 1, 1))
    corners[0, 1] = np.nan
    corners[1, 2, 0] = np.inf
    corners[2] += [COLUMNS, 0.0]
    corners[3] -= [5.0, 0.0]
    corners[4] += [0.0, ROWS]
    corners[5] -= [0.0, 5.0]
    light, inside = lay_down(corners, device)
    assert (light == 0.0).all() and (inside == 0.0).all()


def test_a_mesh_leaves_no_seam_and_colours_are_apart(device):
    """Triangles that tile a square wholly cover its pixels, each with its density."""
    rng = np.random.default_rng(4)
    x, y = np.meshgrid(np.linspace(2.0, 9.0, 8), np.linspace(1.0, 8.0, 8))
    x[1:-1, 1:-1] += rng.uniform(-0.4, 0.4, (6, 6))
    y[1:-1, 1:-1] += rng.uniform(-0.4, 0.4, (6, 6))
    p = np.stack([x, y], axis=-1)
    lower = np.stack([p[:-1, :-1], p[:-1, 1:], p[1:, 1:]], axis=2).reshape(-1, 3, 2)
    upper = np.stack([p[:-1, :-1], p[1:, 1:], p[1:, :-1]], axis=2).reshape(-1, 3, 2)
    expected = np.zeros((1, ROWS, COLUMNS))
    steps = wp.zeros(3 * STEPS, dtype=wp.float64, device=device)
    for triangle in np.concatenate([lower, upper]):
        u, v = triangle[1] - triangle[0], triangle[2] - triangle[0]
        area = 0.5 * (u[0] * v[1] - u[1] * v[0])
        deposit_triangles(expected, *triangle.T[:, :, None], np.full((1, 1), area))
        places = wp.array(triangle[None], dtype=wp.vec2d, device=device)
        flux = wp.vec3(1.0 * area, 0.5 * area, 0.25 * area)
        wp.launch(deposit_all, dim=1, inputs=[wp.vec2i(COLUMNS, ROWS), places, flux, steps], device=device)
    light = np.cumsum(steps.numpy()[:-3].reshape(ROWS + 1, COLUMNS + 1, 3), axis=1)[:ROWS, :COLUMNS]
    np.testing.assert_allclose(light[1:8, 2:9, 0], 1.0, atol=ROUNDING)
    np.testing.assert_allclose(light, expected[0, :, :, None] * [1.0, 0.5, 0.25], atol=ROUNDING)


def test_rows_are_summed_up_by_channel_and_what_cancelled_is_dark(device):
    steps = np.zeros((2, STEPS, 3))
    grid = steps[:, :-1].reshape(2, ROWS + 1, COLUMNS + 1, 3)
    grid[0, 2, 3], grid[1, 2, 5] = (1.0, 2.0, 4.0), (-1.0, -1.0, -1.0)
    grid[1, 2, 8] = (1e-13, -1.0 + 1e-13, -3.0)
    grid[0, 3, 1] = 7.0
    lanes = wp.array(steps.reshape(2, -1), dtype=wp.float64, device=device)
    image = wp.zeros(ROWS * COLUMNS * 3, dtype=float, device=device)
    inputs = [0, lanes, COLUMNS, wp.vec3d(1.0, 10.0, 100.0)]
    wp.launch(make_resolve_steps(3, 3), dim=ROWS, inputs=inputs, outputs=[image], device=device)
    light = image.numpy().reshape(ROWS, COLUMNS, 3)
    np.testing.assert_allclose(light[2, 3:5], [[1.0, 20.0, 400.0]] * 2)
    np.testing.assert_allclose(light[2, 5:8], [[0.0, 10.0, 300.0]] * 3)
    assert (light[2, 8:] == 0.0).all() and (light[2, :3] == 0.0).all()
    np.testing.assert_allclose(light[3, 1:], np.broadcast_to([7.0, 70.0, 700.0], (COLUMNS - 1, 3)))


by_rows_too = pytest.mark.parametrize("by_rows", [False, True])


def lay_down_cells(planes, device, by_rows=False):
    """Deposit a strip of cells as large as the map, by planes [deviation x and y and flux, row, column] of corners.

    Cell by cell, or judged row by row in lanes.

    Returns the map [row, column], and what the ledger has outside it.
    """
    lattice, cells = Lattice(), wp.vec2i(COLUMNS, ROWS)
    lattice.step, lattice.pixel = 1.0, wp.vec2(1.0, 1.0)
    lattice.count = lattice.map = cells
    suns = wp.zeros(1, dtype=SunSample, device=device)
    steps = wp.zeros((3, STEPS), dtype=wp.float64, device=device)
    ledger = wp.zeros((len(ENTRIES), BINS), dtype=wp.float64, device=device)
    above = wp.zeros((COLUMNS, 1), dtype=wp.float64, device=device)
    nothing = wp.zeros((0, 0), dtype=wp.uint8, device=device)
    spec = Spec(accumulate="float64")  # as of a beam over a pool: tests share what they compile
    if by_rows:
        # Lanes reach past the last corner, where nothing may be looked at.
        planes = np.pad(planes, ((0, 0), (0, 0), (0, 2 * LANES)), constant_values=np.nan)
        kernel, given = make_cell_rows(spec, True), [cells, above]
    else:
        kernel, given = make_edge_cells(spec, True), [nothing, cells, cells, above, nothing]
    corners = wp.array(planes.astype(np.float32), dtype=float, device=device)
    inputs = [suns, 0, lattice, 0, corners, *given, steps[1], ledger]
    wp.launch(kernel, dim=(1, 1), inputs=inputs, device=device)
    laid = steps.numpy()
    assert (laid[0] == 0.0).all() and (laid[2] == 0.0).all()
    light = np.cumsum(laid[1, :-1].reshape(ROWS + 1, COLUMNS + 1), axis=1)
    assert np.abs(light[ROWS]).max() < EXACT and np.abs(light[:, COLUMNS]).max() < EXACT
    return light[:ROWS, :COLUMNS], ledger.numpy()[int(OUTSIDE_MAP)].sum()


@by_rows_too
@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("middle", [3.0, -3.0])
@pytest.mark.parametrize("swing", [100.0, -100.0])
def test_a_cell_may_swing_out_of_the_map_between_its_corners(device, axis, middle, swing, by_rows):
    """Second differences that cancel in a cell's middle leave no bend there, and pixels on either side of it."""
    planes = np.zeros((3, ROWS + 1 + 2 * BORDER, COLUMNS + 1 + 2 * BORDER))
    first, size = 5, (COLUMNS, ROWS)[axis]
    low = (middle if middle > 0.0 else size + middle) - first  # of the cell's corners, along the axis
    high, bend = low - 0.5, 0.3
    before, after = swing + 2.0 * low - high + bend, -swing + 2.0 * high - low + bend
    along = np.array([before, low, high, after])
    planes[axis, first : first + 4, :] = along[:, None]
    if axis == 0:
        planes[0] = 0.0
        planes[0, :, first : first + 4] = along
    planes[2, first + 1 : first + 3, first + 1 : first + 3] = 1.0
    light, outside = lay_down_cells(planes, device, by_rows)
    flux = 4.0  # of four corners
    assert 0.0 < light.sum() < flux
    assert outside == pytest.approx(flux - light.sum(), abs=1e-5)


@by_rows_too
def test_a_corner_without_a_place_darkens_the_cells_around_it_alone(device, by_rows):
    planes = np.zeros((3, ROWS + 1 + 2 * BORDER, COLUMNS + 1 + 2 * BORDER))
    planes[2] = 1.0
    planes[:, 5, 6] = np.nan
    light, _ = lay_down_cells(planes, device, by_rows)
    expected = np.ones((ROWS, COLUMNS))
    expected[2:6, 3:7] = 0.0  # whose cubics it is part of
    np.testing.assert_allclose(light, expected, atol=ROUNDING)


def beam(name, device, **settings):
    table = bundled(name).model_dump(exclude_unset=True, exclude_none=True)
    return wc.render(wc.Scene(**{**table, "method": {"name": "beam", "beam": settings}}), device=device)


@pytest.mark.parametrize("name", ["pool", "beach", "tank"])
@pytest.mark.parametrize("settings", [{}, {"refine": False}, {"samples_per_pixel": 3.0}, {"samples_per_pixel": 0.1}])
def test_edges_and_triangles_are_one_sum(device, name, settings):
    edges = beam(name, device, deposit="edges", **settings)
    triangles = beam(name, device, deposit="triangles", **settings)
    assert relative_l2(edges.caustic_map, triangles.caustic_map) < FORMS
    assert edges.energy.received == pytest.approx(triangles.energy.received, rel=ROUNDING)
    assert edges.energy.outside_map == pytest.approx(triangles.energy.outside_map, rel=1e-5)
    assert edges.energy.unaccounted < ROUNDING


@by_rows_too
def test_cells_of_random_water_are_the_triangles_of_the_oracle(device, by_rows):
    """Corners anywhere, so that cells fold, stretch and leave the map, too little to be cut into parts."""
    rng = np.random.default_rng(5)
    shape = (ROWS + 1 + 2 * BORDER, COLUMNS + 1 + 2 * BORDER)
    row, column = np.mgrid[: shape[0], : shape[1]]
    # Linear deviations have no bend, whatever they do to a cell.
    for _ in range(10):
        m = rng.uniform(-1.5, 0.5, (2, 2))
        planes = np.stack(
            [*(m[i, 0] * column + m[i, 1] * row + rng.uniform(0.0, 6.0) for i in range(2)), np.ones(shape)]
        )
        light, outside = lay_down_cells(planes, device, by_rows)
        own = planes[:2, BORDER:-BORDER, BORDER:-BORDER].astype(np.float32) + np.mgrid[: ROWS + 1, : COLUMNS + 1][::-1]
        expected = np.zeros((1, ROWS, COLUMNS))
        for j in range(ROWS):
            for i in range(COLUMNS):
                a, b, c, d = (own[:, y, x] for y, x in ((j, i), (j, i + 1), (j + 1, i + 1), (j + 1, i)))
                for triangle in ((a, b, c), (a, c, d)):
                    x, y = np.array(triangle).T
                    deposit_triangles(expected, x[:, None], y[:, None], np.full((1, 1), 0.5))
        np.testing.assert_allclose(light, expected[0], atol=1e-5)
        assert outside == pytest.approx(ROWS * COLUMNS - light.sum(), abs=1e-4)


def test_fixed_point_takes_triangles():
    table = bundled("pool").model_dump(exclude_unset=True, exclude_none=True)
    table["method"] = {"name": "beam", "accumulate": "fixed"}
    assert wc.make_plan(wc.Scene(**table), device="cpu").settings["deposit"] == "triangles"
    table["method"]["beam"] = {"deposit": "edges"}
    with pytest.raises(wc.InputError, match=r'method\.beam\.deposit = "edges".*expected deposit "triangles"'):
        wc.make_plan(wc.Scene(**table), device="cpu")
