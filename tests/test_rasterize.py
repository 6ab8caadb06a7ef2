"""Coverage, depth and visibility against a brute-force rasterizer in NumPy integers and float64."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from warp_caustics import g_buffer
from warp_caustics.kernels.rasterize import MAX_RESOLUTION
from warp_caustics.triangles import mesh_triangles
from warp_caustics.views import MAX_RESOLUTION as VIEW_MAX_RESOLUTION
from warp_caustics.views import EyeView, LightView

COLUMNS, ROWS = 40, 30
SUBPIXELS = 4096
# float32 depths from float32 weights, all positive: a few roundings of 6e-8, far under the 1e-5 that is promised.
DEPTH_TOLERANCE = 1e-5

# One metre a pixel, seen from above: column = x, row = y, depth = 10 - z.
ABOVE = LightView((0, 0, -1), (0, 0, 0), (COLUMNS, ROWS, 10), (COLUMNS, ROWS))
EYE = EyeView((3.0, -6.0, 4.0), (2.0, 8.0, 0.0), 70.0, (COLUMNS, ROWS), near=0.1)
VIEWS = {
    "light": ABOVE,
    "slanted light": LightView((0.5, 0.2, -1), (-5, -5, 0), (45, 35, 10), (COLUMNS, ROWS)),
    "eye": EYE,
}


def draw(points, triangles, view, device, **options):
    """Depth and ids of triangles, and what was dropped."""
    mesh = SimpleNamespace(vertices=np.asarray(points, float).reshape(-1, 3), triangles=np.asarray(triangles, np.int32))
    on_device = mesh_triangles(mesh, origin=(0, 0, 0), device=device)
    buffer = g_buffer.rasterize(on_device, view, **options)
    return buffer.depth.numpy(), buffer.id.numpy()


def soup(points):
    """Indices of triangles that share no vertex."""
    return np.arange(len(points)).reshape(-1, 3)


def brute_force(points, triangles, view):
    """Which pixels each triangle covers, and at which depth: bool and float64 [triangles, rows, columns].

    Every edge function at every pixel, in int64; depth in float64. For triangles that need no cut.
    """
    projection = view.projection((0, 0, 0))
    columns, rows = projection.resolution
    points = np.asarray(points, float).reshape(-1, 3).astype(np.float32).astype(np.float64)
    corners = (points @ projection.matrix.T + projection.offset).astype(np.float32)
    w = corners[:, 2:] if projection.perspective else np.ones((len(corners), 1), np.float32)
    fixed = np.rint(corners[:, :2] / w * np.float32(SUBPIXELS)).astype(np.int64)
    x = np.arange(columns)[None, :] * SUBPIXELS + SUBPIXELS // 2
    y = np.arange(rows)[:, None] * SUBPIXELS + SUBPIXELS // 2
    covered = np.zeros((len(triangles), rows, columns), bool)
    depth = np.full(covered.shape, np.inf)
    for number, (a, b, c) in enumerate(np.asarray(triangles)):
        (ax, ay), (bx, by), (cx, cy) = fixed[a], fixed[b], fixed[c]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if area == 0:
            continue
        order = (a, b, c) if area > 0 else (a, c, b)
        inside, shares = np.ones((rows, columns), bool), []
        for k in range(3):
            (px, py), (qx, qy) = fixed[order[(k + 1) % 3]], fixed[order[(k + 2) % 3]]
            edge = (qx - px) * (y - py) - (qy - py) * (x - px)
            own = qy < py or (qy == py and qx < px)  # a left edge runs down, a top edge runs left
            inside &= (edge > 0) | ((edge == 0) & own)
            shares.append(edge.astype(float) / w[order[k], 0])
        covered[number] = inside
        total = sum(shares)
        mean = sum(share * corners[order[k], 2] for k, share in enumerate(shares))
        depth[number][inside] = mean[inside] / total[inside]
    return covered, depth


def check_against_brute_force(points, triangles, view, device):
    """Coverage exact, the nearest triangle wins, depth to the tolerance."""
    depth, ids = draw(points, triangles, view, device)
    covered, depths = brute_force(points, triangles, view)
    np.testing.assert_array_equal(ids >= 0, covered.any(axis=0))
    np.testing.assert_array_equal(np.isfinite(depth), ids >= 0)
    row, column = np.nonzero(ids >= 0)
    winner = ids[row, column]
    assert covered[winner, row, column].all()
    scale = DEPTH_TOLERANCE * (1.0 + np.abs(depth[row, column]))
    assert (np.abs(depths[winner, row, column] - depth[row, column]) <= scale).all()
    assert (depth[row, column] <= depths.min(axis=0)[row, column] + scale).all()
    return ids


coordinate = st.one_of(
    st.integers(-40, 160).map(lambda quarter: quarter / 4.0),  # corners and edges that meet pixel centres
    st.floats(-15.0, 50.0, width=32),
)
triangle = st.lists(st.tuples(coordinate, coordinate, st.floats(0.0, 10.0, width=32)), min_size=3, max_size=3)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(corners=st.lists(triangle, min_size=1, max_size=6))
@pytest.mark.parametrize("name", ["light", "slanted light"])
def test_random_triangles_from_the_light(device, name, corners):
    points = np.array(corners).reshape(-1, 3)
    check_against_brute_force(points, soup(points), VIEWS[name], device)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(corners=st.lists(triangle, min_size=1, max_size=6))
def test_random_triangles_before_the_eye(device, corners):
    eye = EyeView((10.0, -20.0, 15.0), (18.0, 20.0, 0.0), 60.0, (COLUMNS, ROWS))
    points = np.array(corners).reshape(-1, 3)
    _, depth = eye.projection().project(points)
    points = points[np.repeat((depth.reshape(-1, 3) > 1.0).all(axis=1), 3)]  # those that cross it have their own test
    if len(points):
        check_against_brute_force(points, soup(points), eye, device)


@pytest.mark.parametrize("order", [(0, 1, 2), (0, 2, 1)])
@pytest.mark.parametrize(
    ("points", "pixels"),
    [
        ([(-100, -100, 1), (200, -100, 1), (20, 300, 1)], COLUMNS * ROWS),  # fills the picture
        ([(5.4, 7.4, 1), (5.6, 7.4, 1), (5.5, 7.7, 1)], 1),  # one pixel
        ([(5.6, 7.6, 1), (5.9, 7.6, 1), (5.7, 7.9, 1)], 0),  # within a pixel, off its centre
        (
            [(5.5, 7.5, 1), (6.5, 7.5, 1), (5.5, 8.5, 1)],
            0,
        ),  # left and top edges: the centre below the top is not theirs
        ([(5.5, 8.5, 1), (5.5, 7.5, 1), (6.5, 8.5, 1)], 1),  # the one whose left and top edges meet at a centre is
        ([(3, 3, 0), (30, 3, 9), (15, 3, 5)], 0),  # edge-on
        ([(3, 3, 0), (3, 3, 9), (3, 3, 5)], 0),  # a point
        ([(-30, 5, 1), (-10, 5, 1), (-20, 20, 1)], 0),  # off the picture to the left
        ([(45, 5, 1), (60, 5, 1), (50, 20, 1)], 0),
        ([(-50, 20, 1), (10, 80, 1), (-50, 80, 1)], 0),  # its rectangle meets the picture, it does not
        ([(0, 10.4, 1), (40, 10.4, 1), (40, 10.6, 1)], 20),  # a sliver along a row
    ],
)
def test_hand_made_triangles(device, points, pixels, order):
    ids = check_against_brute_force(points, [order], ABOVE, device)
    assert (ids >= 0).sum() == pixels


def claims(points, triangles, view, device):
    """How many triangles of a mesh cover each pixel: each one drawn alone."""
    return sum((draw(points, [corners], view, device)[1] >= 0).astype(int) for corners in triangles)


def test_a_fan_through_pixel_centres_covers_each_pixel_once(device):
    # Every corner, and so many points of every edge, lies on a pixel centre: the top-left rule decides.
    rim = [(34.5, 15.5), (30.5, 25.5), (20.5, 28.5), (10.5, 25.5), (4.5, 15.5), (10.5, 5.5), (20.5, 1.5), (30.5, 5.5)]
    points = [(20.5, 15.5, 5.0), *((x, y, 0.0) for x, y in rim)]
    triangles = [(0, k + 1, (k + 1) % len(rim) + 1) for k in range(len(rim))]
    triangles[::2] = [(c, b, a) for a, b, c in triangles[::2]]  # whichever way they run
    count = claims(points, triangles, ABOVE, device)
    assert count.max() == 1
    whole, _ = brute_force(points, [(1, k, k + 1) for k in range(2, len(rim))], ABOVE)
    np.testing.assert_array_equal(count, whole.sum(axis=0))
    assert count.sum() > 400


@pytest.mark.parametrize("name", list(VIEWS))
def test_a_mesh_covers_each_pixel_once(device, name):
    rng = np.random.default_rng(5)
    view = VIEWS[name]
    # A lattice over the whole picture in pixel coordinates, jittered and snapped to half pixels, seen at any depth.
    columns, rows = np.meshgrid(np.linspace(-10, COLUMNS + 10, 6), np.linspace(-10, ROWS + 10, 5))
    pixels = np.stack([columns, rows], -1) + rng.uniform(-3, 3, (5, 6, 2))
    pixels = np.round(pixels * 2) / 2
    depth = rng.uniform(3, 8, (5, 6))
    projection = view.projection()
    w = depth if projection.perspective else np.ones_like(depth)
    homogeneous = np.stack([pixels[..., 0] * w, pixels[..., 1] * w, depth], -1).reshape(-1, 3)
    points = (homogeneous - projection.offset) @ np.linalg.inv(projection.matrix).T
    corner = np.arange(30).reshape(5, 6)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, :-1], corner[1:, 1:]
    triangles = np.stack([a, b, d, a, d, c], -1).reshape(-1, 3)
    assert (claims(points, triangles, view, device) == 1).all()
    assert (check_against_brute_force(points, triangles, view, device) >= 0).all()


def test_the_least_index_wins_at_equal_depth(device):
    points = [(1, 1, 2), (30, 1, 2), (1, 25, 2)]
    _, ids = draw(points, [(0, 1, 2), (0, 1, 2), (0, 2, 1)], ABOVE, device)
    assert set(np.unique(ids)) == {-1, 0}


def test_depths_before_the_box_are_negative_and_nearest(device):
    far, near = [(0, 0, 5), (40, 0, 5), (0, 40, 5)], [(0, 0, 25), (40, 0, 25), (0, 40, 25)]
    depth, ids = draw([*far, *near], soup([*far, *near]), ABOVE, device)
    assert ids[0, 0] == 1
    assert depth[0, 0] == pytest.approx(-15.0, rel=1e-6)


def test_not_finite_corners_are_dropped_and_counted(device):
    good = [(0, 0, 1), (40, 0, 1), (0, 40, 1)]
    bad = [[(0, 0, value), (40, 0, 9), (0, 40, 9)] for value in (np.nan, np.inf, -np.inf)]
    points = np.array([*bad[0], *good, *bad[1], *bad[2], (1e300, 0, 0), (1, 0, 0), (0, 1, 0)], dtype=float)
    mesh = mesh_triangles(SimpleNamespace(vertices=points, triangles=soup(points)), origin=(0, 0, 0), device=device)
    for view in (ABOVE, EYE):
        projection = view.projection()
        scratch = g_buffer.make_scratch(mesh, projection)
        buffer = g_buffer.rasterize(mesh, view)
        g_buffer.rasterize_into(buffer, mesh, scratch)
        assert scratch.dropped() == g_buffer.Dropped(not_finite=4, bad_index=0)
        assert set(np.unique(buffer.id.numpy())) == {-1, 1}


@pytest.mark.parametrize("name", list(VIEWS))
def test_how_large_triangles_are_split_does_not_matter(device, name, monkeypatch):
    rng = np.random.default_rng(11)
    points = rng.uniform((-20, 0, 0), (60, 50, 3), (90, 3))
    expected = draw(points, soup(points), VIEWS[name], device)
    assert len(np.unique(expected[1])) > 3
    for workers in (7, 1000):
        monkeypatch.setattr(g_buffer, "LARGE_WORKERS_CPU", workers)
        monkeypatch.setattr(g_buffer, "LARGE_WORKERS_CUDA", workers)
        np.testing.assert_array_equal(draw(points, soup(points), VIEWS[name], device), expected)
    monkeypatch.setattr(g_buffer, "MAX_LARGE", 2)  # the list is full: the rest is filled at once
    np.testing.assert_array_equal(draw(points, soup(points), VIEWS[name], device), expected)


def test_views_and_kernels_agree_on_the_largest_picture():
    assert VIEW_MAX_RESOLUTION == MAX_RESOLUTION
