"""Cascades on the host: what they enclose, how they are snapped, and what stays while the camera moves."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenery import GENTLE, scene

import warp_caustics as wc
from oracle.cases import sunlight
from warp_caustics.cascades import Cascades
from warp_caustics.plan import make_plan
from warp_caustics.polytope import box_planes, frustum_radius, polytope_corners
from warp_caustics.scene import Camera
from warp_caustics.scene.cascaded import MOST_TEXELS
from warp_caustics.sun import refract_slopes
from warp_caustics.views import MAX_RESOLUTION
from warp_caustics.water import extreme_slopes

RESOLUTION = 64
WHOLE = 1e-6  # of a texel: offsets are float64
SPARE = 8.0  # texels: snapping, and bounds of refraction and of heights, each taken by itself
SIZE = (12.0, 10.0)
EYE = {"position": (6.0, -2.0, 3.0), "target": (6.0, 5.0, 0.0), "vertical_fov": 40.0, "resolution": (32, 18)}


def facts_of(direction=(0.4, 0.2, -1.0), eye=EYE, **more):
    return make_plan(scene(GENTLE, direction=direction, size=SIZE, camera=eye, **more), "beam", "cpu", 1).facts


FACTS = {angle: facts_of(direction=sunlight(angle)) for angle in (0.0, 35.0, 70.0)}


def eye_at(x, y, z, turn, tilt):
    """A camera that looks along an angle in plan and one from the horizontal [rad]."""
    way = np.array([np.cos(turn) * np.cos(tilt), np.sin(turn) * np.cos(tilt), np.sin(tilt)])
    return Camera(**{**EYE, "position": (x, y, z), "target": tuple(np.add((x, y, z), way))})


CAMERAS = st.builds(
    eye_at, st.floats(-3, 15), st.floats(-3, 13), st.floats(0.2, 5), st.floats(-3.1, 3.1), st.floats(-1.5, 0.3)
)


def assert_holds(cascades, cascade, view, region, facts, seed):
    """All water whose light can land in a region stands in the view, by the bounds of refraction."""
    random, slopes = np.random.default_rng(seed), extreme_slopes(facts.scene, facts.assets)
    landed = random.dirichlet(np.full(len(region), 0.3), size=200) @ region
    landed = np.concatenate([region, landed])
    rays = refract_slopes(facts.suns[0], slopes[random.integers(0, len(slopes), len(landed))], facts.ior)
    depth = random.choice([-1.0, 0.0, 1.0], len(landed)) * facts.amplitude - landed[:, 2]
    water = landed + (depth / rays[:, 2])[:, None] * rays
    at, _ = view.project(water + view.origin)
    assert (at >= 0.0).all() and (at <= RESOLUTION).all()


@settings(max_examples=40)
@given(camera=CAMERAS, angle=st.sampled_from(sorted(FACTS)), seed=st.integers(0, 2**31))
def test_each_light_view_holds_what_its_own_camera_sees_and_the_last_one_all(camera, angle, seed):
    facts = FACTS[angle]
    cascades = Cascades(facts, 3, RESOLUTION)
    own = facts.scene.camera
    for cascade, view in zip(cascades.cascades, cascades.projections(own), strict=True):
        assert_holds(cascades, cascade, view, cascades.lit_region(own, cascade.far), facts, seed)
    last, moved = cascades.cascades[-1], cascades.projections(camera)[-1]
    region = cascades.lit_region(camera, 100.0)  # whatever the eye sees, from anywhere
    if len(region):
        assert_holds(cascades, last, moved, region, facts, seed)


@settings(max_examples=40)
@given(camera=CAMERAS, angle=st.sampled_from(sorted(FACTS)), seed=st.integers(0, 2**31))
def test_a_far_plane_that_is_given_bounds_the_last_view(camera, angle, seed):
    facts = FACTS[angle]
    cascades = Cascades(facts, 3, RESOLUTION, near=0.5, far=9.0)
    region = cascades.lit_region(camera, 9.0)
    if len(region):
        assert_holds(cascades, cascades.cascades[-1], cascades.projections(camera)[-1], region, facts, seed)


def test_near_water_gets_more_photons():
    """On every bundled scene with a camera the nearest cascade is finer than the last, or there is one alone."""
    for name in ("pool", "beach", "lake", "tank"):
        facts = make_plan(name, "beam", "cpu", 1).facts
        areas = [cascade.texel_area for cascade in Cascades(facts, 4, RESOLUTION).cascades]
        assert areas == sorted(areas)
        assert areas[0] < 0.7 * areas[-1], name


@given(camera=CAMERAS, step=st.tuples(*[st.floats(-0.3, 0.3)] * 3))
def test_a_moving_camera_moves_the_grid_by_whole_texels(camera, step):
    cascades = Cascades(FACTS[35.0], 3, RESOLUTION, near=0.5, far=9.0)
    place = tuple(np.add(camera.position, step))
    moved = Camera(**{**EYE, "position": place, "target": tuple(np.add(camera.target, step))})
    for here, there in zip(cascades.projections(camera), cascades.projections(moved), strict=True):
        np.testing.assert_array_equal(here.matrix, there.matrix)  # neither size nor direction follow the camera
        texels = (there.offset - here.offset)[:2]
        np.testing.assert_allclose(texels, np.round(texels), atol=WHOLE)


def test_far_planes_grow_linearly_to_the_farthest_that_is_seen():
    cascades = Cascades(FACTS[35.0], 4, RESOLUTION)
    ends = [cascades.near, *(cascade.far for cascade in cascades.cascades)]
    np.testing.assert_allclose(np.diff(ends), np.diff(ends)[0], rtol=1e-9)
    eye = cascades.eye(FACTS[35.0].scene.camera)
    corners = np.array(list(product((0.0, SIZE[0]), (0.0, SIZE[1]), (-1.0,))))
    depths = corners @ eye.matrix[2] + eye.offset[2]
    assert cascades.far == pytest.approx(depths.max(), rel=1e-4)
    assert 0.0 < cascades.near < depths.min() + 3.0
    # Each is as fine as the one behind it, or finer.
    areas = [cascade.texel_area for cascade in cascades.cascades]
    assert areas == sorted(areas)


def test_a_cube_cut_by_a_plane_has_its_corners():
    cube = box_planes(np.zeros(3), np.ones(3))
    assert len(np.unique(polytope_corners(cube), axis=0)) == 8
    cut = np.array([[-1.0, 0.0, 0.0, 0.25]])  # keeps x <= 1/4
    corners = np.unique(np.round(polytope_corners(np.concatenate([cube, cut])), 12), axis=0)
    assert len(corners) == 8 and set(corners[:, 0]) == {0.0, 0.25}
    assert not len(polytope_corners(np.concatenate([cube, [[-1.0, 0.0, 0.0, -0.5]]])))


@pytest.mark.parametrize("fov", [20.0, 60.0, 120.0])
def test_a_sphere_of_this_radius_holds_the_frustum(fov):
    cascades = Cascades(facts_of(eye={**EYE, "vertical_fov": fov}), 1, RESOLUTION)
    eye = cascades.eye(Camera(**{**EYE, "vertical_fov": fov}))
    far, (columns, rows) = 5.0, eye.resolution
    pixels = [(c * far, r * far, far) for c in (0, columns) for r in (0, rows)]
    corners = (np.array(pixels) - eye.offset) @ np.linalg.inv(eye.matrix).T
    apex = -np.linalg.inv(eye.matrix) @ eye.offset
    forward = eye.matrix[2]
    radius = frustum_radius(eye, far)
    middle = apex + min(radius, far) * forward
    reach = np.linalg.norm(np.concatenate([corners, [apex]]) - middle, axis=1)
    assert reach.max() == pytest.approx(radius, rel=1e-9)


def test_a_light_view_is_no_larger_than_the_rasterizer_holds():
    assert MOST_TEXELS == MAX_RESOLUTION


def test_a_scene_without_a_camera_is_refused():
    with pytest.raises(wc.InputError, match='method "cascaded" needs a camera'):
        wc.make_plan(scene(GENTLE), "cascaded", "cpu", 1)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"resolution": 8}, "a whole number from 16 to 16384"),
        ({"count": 0}, "a whole number from 1 to 16"),
        ({"near": 3.0, "far": 2.0}, "expected far beyond near, got near 3 and far 2"),
        ({"blend": 1.5}, "a number from 0 to 1"),
        ({"ramp": "smooth"}, 'expected no ramp, since brightness is "flux"'),
        ({"filter_radius": 3}, 'expected no filter_radius, since filter is "none"'),
        ({"positions": "half"}, 'one of "depth" or "float3"'),
    ],
)
def test_settings_that_cannot_be_are_refused(settings, message):
    with pytest.raises(wc.InputError, match=message):
        scene(GENTLE, method={"name": "cascaded", "cascaded": settings})


def test_photons_by_channel_want_traced_dispersion():
    one_index = scene(GENTLE, camera=EYE, method={"name": "cascaded", "cascaded": {"dispersion_photons": "each"}})
    with pytest.raises(wc.InputError, match=r'dispersion_photons: expected medium\.dispersion "traced"'):
        wc.make_plan(one_index, "cascaded", "cpu", 1)


@pytest.mark.parametrize("angle", sorted(FACTS))
def test_the_view_of_a_camera_that_sees_all_is_filled_by_the_light_of_all(angle):
    facts, random = FACTS[angle], np.random.default_rng(1)
    camera = Camera(**{**EYE, "position": (6.0, 4.99, 40.0), "target": (6.0, 5.0, 0.0)})
    cascades = Cascades(facts, 1, RESOLUTION, far=60.0)
    region = cascades.lit_region(camera, 60.0)
    slopes = extreme_slopes(facts.scene, facts.assets)
    landed = np.repeat(region, 400, axis=0)
    rays = refract_slopes(facts.suns[0], slopes[random.integers(0, len(slopes), len(landed))], facts.ior)
    depth = random.choice([-1.0, 1.0], len(landed)) * facts.amplitude - landed[:, 2]
    (view,) = cascades.projections(camera)
    at, _ = view.project(landed + (depth / rays[:, 2])[:, None] * rays + view.origin)
    assert (at >= 0.0).all() and (at <= RESOLUTION).all()
    assert (at.min(axis=0) < SPARE).all() and (at.max(axis=0) > RESOLUTION - SPARE).all()
