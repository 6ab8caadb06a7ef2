"""Views: pixels of known points, there and back, far from the world's origin, and bad input."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from hypothesis import given
from hypothesis import strategies as st

from warp_caustics import g_buffer
from warp_caustics.errors import InputError
from warp_caustics.kernels.views import View, project, unproject
from warp_caustics.triangles import Lattice, lattice_triangles
from warp_caustics.views import EyeView, LightView

# float64: rounding of coordinates of a few hundred, many times over.
EXACT = 1e-9
# float32 on the device: positions of a few metres and some hundred pixels, a few roundings of 6e-8.
DEVICE_TOLERANCE = 2e-6

number = st.floats(-1.0, 1.0)
sun = st.tuples(number, number, st.floats(-1.0, -0.02))
point = st.tuples(number, number, number)


@given(sun)
def test_the_light_view_holds_its_box_exactly(direction):
    lower, upper = np.array([-3.0, 2.0, -1.0]), np.array([5.0, 4.0, 0.5])
    view = LightView(direction, tuple(lower), tuple(upper), (64, 48))
    corners = np.array([[(lower, upper)[(k >> axis) & 1][axis] for axis in range(3)] for k in range(8)])
    position, depth = view.projection().project(corners)
    np.testing.assert_allclose(position.min(axis=0), 0.0, atol=EXACT)
    np.testing.assert_allclose(position.max(axis=0), (64, 48), atol=EXACT)
    assert depth.min() == pytest.approx(0.0, abs=EXACT)
    # Points along the light fall on one pixel, and depth is the distance between them.
    along = np.array(direction) / np.linalg.norm(direction)
    position, depth = view.projection().project([lower, lower + 7.0 * along])
    np.testing.assert_allclose(position[0], position[1], atol=EXACT)
    assert depth[1] - depth[0] == pytest.approx(7.0, abs=EXACT)


def test_under_a_sun_at_the_zenith_columns_are_x_and_rows_are_y():
    position, depth = LightView((0, 0, -2), (0, 0, 0), (4, 2, 3), (8, 8)).projection().project([1.0, 0.5, 2.0])
    np.testing.assert_allclose(position, (2.0, 2.0), atol=EXACT)
    assert depth == pytest.approx(1.0)


def test_the_eye_sees_its_target_in_the_middle_and_its_angle_at_the_edge():
    view = EyeView((1.0, 2.0, 3.0), (1.0, 12.0, 3.0), 90.0, (200, 100))
    projection = view.projection()
    position, depth = projection.project([[1, 12, 3], [1, 12, 13], [3, 12, 3], [1, -8, 3]])
    np.testing.assert_allclose(position[0], (100, 50), atol=EXACT)
    np.testing.assert_allclose(position[1], (100, 100), atol=EXACT)  # 45 degrees up: the top edge, the last row
    np.testing.assert_allclose(position[2], (110, 50), atol=EXACT)  # east of a view to the north: to the right
    np.testing.assert_allclose(depth, (10, 10, 10, -10), atol=EXACT)


@pytest.mark.parametrize("target", [(0, 0, -5), (0, 0, 5)])
def test_the_eye_can_look_straight_down_and_up(target):
    projection = EyeView((0, 0, 0), target, 40.0, (10, 10)).projection()
    assert np.isfinite(projection.matrix).all()
    assert projection.project(target)[1] == pytest.approx(5.0)


def test_the_light_can_run_along_y():
    assert np.isfinite(LightView((0, 1, 0), (0, 0, 0), (1, 1, 1), (4, 4)).projection().matrix).all()


VIEWS = [
    LightView((0.4, -0.3, -1.0), (-2, -2, -2), (2, 2, 2), (320, 240)),
    EyeView((3.0, -5.0, 2.0), (0.0, 0.0, 0.0), 60.0, (320, 240)),
]


@given(point)
@pytest.mark.parametrize("view", VIEWS)
def test_a_far_origin_changes_nothing(view, relative):
    origin = np.array([1e5, -2e5, 30.0])
    moved = {name: tuple(np.array(value) + origin) for name, value in vars(view).items() if name in
             ("lower", "upper", "position", "target")}  # fmt: skip
    here = view.projection().project(relative)
    far = type(view)(**{**vars(view), **moved}).projection(origin)
    homogeneous = far.matrix @ np.array(relative) + far.offset
    w = homogeneous[2] if far.perspective else 1.0
    # World coordinates of 1e5 m in float64 are exact to 3e-11 m.
    np.testing.assert_allclose(homogeneous[:2] / w, here[0], atol=1e-7)
    assert homogeneous[2] == pytest.approx(here[1], abs=1e-9)


@pytest.mark.parametrize("view", VIEWS)
def test_positions_come_back_from_depth(view):
    projection = view.projection((0.5, 0.25, -1.0))
    depth = np.random.default_rng(3).uniform(1.0, 9.0, (240, 320))
    depth[7, 9] = np.inf
    points = projection.positions(depth)
    position, again = projection.project(points)
    assert np.isnan(points[7, 9]).all()
    seen = np.isfinite(depth)
    np.testing.assert_allclose(again[seen], depth[seen], atol=EXACT)
    column, row = np.meshgrid(np.arange(320) + 0.5, np.arange(240) + 0.5)
    np.testing.assert_allclose(position[seen], np.stack([column, row], -1)[seen], atol=1e-8)
    with pytest.raises(InputError, match="rows, columns"):
        projection.positions(depth.T)


@wp.kernel(enable_backward=False)
def there_and_back_kernel(
    view: wp.array[View], points: wp.array[wp.vec3], pixels_out: wp.array[wp.vec3], back_out: wp.array[wp.vec3]
):
    i = wp.tid()
    p = project(view[0], points[i])
    w = view[0].w_of_depth * p[2] + view[0].w_constant
    pixels_out[i] = wp.vec3(p[0] / w, p[1] / w, p[2])
    back_out[i] = unproject(view[0], p[0] / w, p[1] / w, p[2])


@pytest.mark.parametrize("view", VIEWS)
def test_the_device_projects_as_the_host_and_back(device, view):
    origin = (0.5, -0.25, 0.125)
    triangles = lattice_triangles(Lattice(1, 1, (0.5, -0.25), (1, 1), 0.125), device)
    scratch = g_buffer.make_scratch(triangles, view.projection(origin))
    points = np.random.default_rng(1).uniform(-1.5, 1.5, (50, 3)).astype(np.float32)
    pixels, back = (wp.zeros(50, dtype=wp.vec3, device=device) for _ in range(2))
    wp.launch(
        there_and_back_kernel,
        dim=50,
        inputs=[scratch.view, wp.array(points, dtype=wp.vec3, device=device)],
        outputs=[pixels, back],
        device=device,
    )
    position, depth = view.projection(origin).project(points.astype(float) + origin)
    expected = np.concatenate([position, depth[:, None]], axis=1)
    np.testing.assert_allclose(pixels.numpy(), expected, atol=DEVICE_TOLERANCE * 320)
    np.testing.assert_allclose(back.numpy(), points, atol=DEVICE_TOLERANCE * 10)


LIGHT = {"direction": (0, 0, -1), "lower": (0, 0, 0), "upper": (1, 1, 1), "resolution": (8, 8)}
EYE = {"position": (0, 0, 0), "target": (0, 1, 0), "vertical_fov": 50.0, "resolution": (8, 8), "near": 0.1}


@pytest.mark.parametrize(
    ("kind", "good", "bad", "message"),
    [
        (LightView, LIGHT, {"direction": (0, 0, 0)}, "direction is zero"),
        (LightView, LIGHT, {"direction": (0, np.nan, -1)}, "three finite"),
        (LightView, LIGHT, {"lower": (0, 0)}, "three finite"),
        (LightView, LIGHT, {"lower": (2, 0, 0)}, "not below"),
        (LightView, LIGHT, {"upper": (0, 1, 1)}, "no width"),
        (LightView, LIGHT, {"resolution": (0, 8)}, "resolution"),
        (LightView, LIGHT, {"resolution": (8, 100000)}, "resolution"),
        (LightView, LIGHT, {"resolution": (8.5, 8)}, "resolution"),
        (LightView, LIGHT, {"resolution": 8}, "resolution"),
        (EyeView, EYE, {"target": (0, 0, 0)}, "another point"),
        (EyeView, EYE, {"position": "here"}, "three finite"),
        (EyeView, EYE, {"vertical_fov": 180.0}, "vertical_fov"),
        (EyeView, EYE, {"vertical_fov": np.nan}, "vertical_fov"),
        (EyeView, EYE, {"near": 0.0}, "near"),
        (EyeView, EYE, {"near": np.nan}, "near"),
        (EyeView, EYE, {"near": 1e-45}, "near"),
        (EyeView, EYE, {"resolution": (np.nan, 8)}, "resolution"),
    ],
)
def test_bad_views_are_refused(kind, good, bad, message):
    kind(**good)
    with pytest.raises(InputError, match=message):
        kind(**{**good, **bad})
