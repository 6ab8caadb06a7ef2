"""Triangles that cross the near plane or the guard band, against homogeneous edge functions in float64."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from warp_caustics.g_buffer import rasterize
from warp_caustics.triangles import mesh_triangles
from warp_caustics.views import EyeView, LightView

COLUMNS, ROWS = 40, 30
# float32 depths from float32 weights, all positive: a few roundings of 6e-8, far under the 1e-5 that is promised.
DEPTH_TOLERANCE = 1e-5
# [pixels] how far the cut of an edge at the guard band, 32768 pixels out, may shift it: float32 there steps by 1/256.
CUT_SHIFT = 0.01

ABOVE = LightView((0, 0, -1), (0, 0, 0), (COLUMNS, ROWS, 10), (COLUMNS, ROWS))
EYE = EyeView((3.0, -6.0, 4.0), (2.0, 8.0, 0.0), 70.0, (COLUMNS, ROWS), near=0.1)


def draw(points, triangles, view, device):
    """Depth and ids of triangles."""
    mesh = SimpleNamespace(vertices=np.asarray(points, float), triangles=np.asarray(triangles, np.int32))
    buffer = rasterize(mesh_triangles(mesh, origin=(0, 0, 0), device=device), view)
    return buffer.depth.numpy(), buffer.id.numpy()


def cut_by_hand(points, view):
    """Depth of one triangle at pixel centres moved by (dx, dy), inf where it is not: homogeneous, in float64."""
    projection = view.projection()
    corners = np.asarray(points, float) @ projection.matrix.T + projection.offset
    weight = corners[:, 2] if projection.perspective else np.ones(3)
    columns, rows = projection.resolution

    def at(dx, dy):
        x, y = np.arange(columns)[None, :] + 0.5 + dx, np.arange(rows)[:, None] + 0.5 + dy
        moved = [(corner[0] - x * w, corner[1] - y * w) for corner, w in zip(corners, weight, strict=True)]
        edges = [
            moved[(k + 1) % 3][0] * moved[(k + 2) % 3][1] - moved[(k + 1) % 3][1] * moved[(k + 2) % 3][0]
            for k in range(3)
        ]
        total = sum(edges)
        with np.errstate(all="ignore"):
            depth = sum(edge * corner[2] for edge, corner in zip(edges, corners, strict=True)) / total
            inside = np.all([edge / total >= 0 for edge in edges], axis=0) & (depth >= projection.near)
        return np.where(inside, depth, np.inf)

    return at


FAR_NEAR = replace(EYE, near=8.0)  # a near plane that cuts what is in the middle of the picture


@pytest.mark.parametrize(
    ("view", "points", "seen"),
    [
        (EYE, [(-2, 30, -1), (8, 30, -1), (2, -30, -1)], True),  # the floor, one corner behind the eye
        (EYE, [(-40, -30, -2), (40, -30, -2), (2, 60, -2)], True),  # two corners behind
        (EYE, [(-1e4, -1e4, -1), (1e4, -1e4, -1), (0, 2e4, -1)], True),  # kilometres: near plane and guard band
        (EYE, [(3.05, -8, -40), (3.05, -8, 40), (9, 40, 0)], True),  # a wall past the eye, before the near plane too
        (EYE, [(-1e5, 3, -1e5), (1e5, 3, -1e5), (0, 3, 2e5)], True),  # a wall over the guard band and behind the eye
        (EYE, [(-1e5, 8, 30), (1e5, 8, 20), (1e4, 2e6, -4e6)], True),  # over the guard band, all before the eye
        (EYE, [(-4, -20, -1), (4, -20, -1), (2, -30, 1)], False),  # behind
        (EYE, [(3, -5.99, 4), (3.01, -5.99, 4), (3, -5.99, 4.01)], False),  # between the eye and the near plane
        (FAR_NEAR, [(-2, 30, -1), (8, 30, -1), (2, -3, -1)], True),  # the near plane cuts it in sight
        (FAR_NEAR, [(-1, 1, 1), (6, 1, 1), (2, -3, -1)], False),  # in sight, but for the near plane
        (ABOVE, [(-1e5, -5e4, 1), (1e5, 5e4 + 20, 5), (0, 1e6, 9)], True),  # an edge through the picture, from afar
        (ABOVE, [(-4e4, -3e4, 1), (9e4, -4e4, 5), (10, 1e6, 9)], True),  # fills the picture
    ],
)
def test_triangles_that_cross_the_near_plane_or_the_guard_band(device, view, points, seen):
    depth, ids = draw(points, [(0, 1, 2)], view, device)
    at = cut_by_hand(points, view)
    centre = at(0.0, 0.0)
    around = np.array([at(dx, dy) for dx in (-CUT_SHIFT, CUT_SHIFT) for dy in (-CUT_SHIFT, CUT_SHIFT)])
    sure = (np.isfinite(around) == np.isfinite(centre)).all(axis=0)
    assert sure.mean() > 0.9
    assert np.isfinite(centre).any() == seen
    np.testing.assert_array_equal((ids >= 0)[sure], np.isfinite(centre)[sure])
    sure &= np.isfinite(centre)
    spread = np.abs(around[:, sure] - centre[sure]).max(axis=0, initial=0.0)
    assert (np.abs(depth[sure] - centre[sure]) <= DEPTH_TOLERANCE * centre[sure] + spread).all()


def test_a_floor_cut_by_the_near_plane_has_no_cracks(device):
    # A lattice that passes under the eye and behind it: below the horizon each pixel sees one triangle.
    x, y = np.meshgrid(np.linspace(-4e4, 4e4, 8), np.linspace(-4e4, 4e4, 8))
    points = np.stack([x + 0.03 * y, y, np.full_like(x, -1.0)], -1).reshape(-1, 3)
    corner = np.arange(64).reshape(8, 8)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, :-1], corner[1:, 1:]
    triangles = np.stack([a, b, d, a, d, c], -1).reshape(-1, 3)
    depth, ids = draw(points, triangles, EYE, device)
    centre = cut_by_hand([(-1e7, -1e7, -1), (1e7, -1e7, -1), (0, 3e7, -1)], EYE)(0.0, 0.0)
    floor = np.isfinite(centre) & (centre < 1e4)
    assert floor.mean() > 0.5
    assert (ids[floor] >= 0).all()
    claims = sum((draw(points, [corners], EYE, device)[1] >= 0).astype(int) for corners in triangles)
    np.testing.assert_array_equal(claims[floor], 1)
    np.testing.assert_allclose(depth[floor], centre[floor], rtol=1e-3)  # a corner at 4e4 m is rounded to 4 mm
