"""The float64 reference checks itself: closed forms, a second road, and conservation."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import oracle
from oracle.meet import crosses, meet_floor
from oracle.rays import LEFT, trace_lattice, trace_points
from oracle.window import emitting_window

ROUNDING = 1e-12  # float64 sums of some 1e5 terms
CLOSED_FORM = 1e-4  # what a converged map owes to a closed form
SAME_RECIPE = 1e-6  # a stored map is the computed one, rounded to float32
PRINTED = 6e-4  # figures printed to three digits
ORDINARY_ERROR, DEEP_ERROR = 5e-4, 3e-3  # an order under the accuracy that tests demand of the library
SHADOW_EDGE = 2e-4  # 20 000 samples see an edge to half a sample, 2.5e-5 of a wave that a low sun lights by 0.1
NOISE_BAND = (0.85, 1.15)  # difference over noise: 4096 pixels, each with a noise known from 8 batches


def flat_scene(direction, receiver=None, level=1.0, medium=None, resolution=(12, 8), waves=(), irradiance=1.0):
    return {
        "water": {"level": level, "waves": list(waves)},
        "receiver": receiver or {"plane": 0.0},
        "sun": {"direction": direction, "irradiance": irradiance},
        "medium": medium or {"ior": 1.333},
        "map": {"origin": (0.3, -0.2), "size": (1.5, 0.8), "resolution": resolution},
    }


# --- optics ---------------------------------------------------------------------------------------------------------


def test_snell_by_angles():
    rng = np.random.default_rng(1)
    normal = rng.normal(size=(500, 3)) * (0.5, 0.5, 0.0) + (0.0, 0.0, 1.0)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    direction = np.array([0.6, -0.3, -1.0]) / np.linalg.norm([0.6, -0.3, -1.0])
    normal = normal[normal @ direction < 0.0]
    refracted = oracle.refract(direction, normal, 1.34)
    inward = np.linalg.norm(np.cross(normal, direction), axis=1)
    onward = np.linalg.norm(np.cross(normal, refracted), axis=1)
    np.testing.assert_allclose(np.linalg.norm(refracted, axis=1), 1.0, atol=ROUNDING)
    np.testing.assert_allclose(onward * 1.34, inward, atol=ROUNDING)
    plane = np.cross(normal, direction)
    assert np.abs(np.einsum("ij,ij->i", plane, refracted)).max() < ROUNDING
    assert (np.einsum("ij,ij->i", normal, refracted) < 0.0).all()


def test_fresnel_figures():
    angles = np.radians([0.0, 40.0, 60.0, 70.0, 80.0])
    printed = [0.979, 0.975, 0.939, 0.865, 0.650]
    np.testing.assert_allclose(oracle.transmittance(np.cos(angles), 1.34), printed, atol=PRINTED)


def test_dispersion_relation_limits():
    np.testing.assert_allclose(oracle.angular_frequency(4.0, 1e3), np.sqrt(9.81 * 4.0), rtol=ROUNDING)
    np.testing.assert_allclose(oracle.angular_frequency(0.01, 0.5), 0.01 * np.sqrt(9.81 * 0.5), rtol=1e-5)


def test_slopes_are_derivatives_and_lattice_is_points():
    surface = oracle.read_setting(oracle.CASES["bumpy_terrain"].scene_dict()).floor
    u, v, h = np.linspace(0.0, 1.0, 7), np.linspace(-1.0, 0.0, 5), 1e-5
    x, y = np.meshgrid(u, v)
    z, zx, zy = surface.height_and_slopes(x, y)
    np.testing.assert_allclose(zx, (surface.height(x + h, y) - surface.height(x - h, y)) / (2 * h), atol=1e-8)
    np.testing.assert_allclose(zy, (surface.height(x, y + h) - surface.height(x, y - h)) / (2 * h), atol=1e-8)
    for one, other in zip(surface.lattice(u, v), (z, zx, zy), strict=True):
        np.testing.assert_allclose(one, other, atol=ROUNDING)


# --- the clipper ----------------------------------------------------------------------------------------------------


def clipped_area(polygon, left, bottom):
    """Area of a polygon inside a unit pixel, by Sutherland and Hodgman."""
    for axis, side, bound in ((0, 1, left), (0, -1, left + 1), (1, 1, bottom), (1, -1, bottom + 1)):
        kept = []
        for a, b in zip(polygon, polygon[1:] + polygon[:1], strict=True):
            da, db = side * (a[axis] - bound), side * (b[axis] - bound)
            if da >= 0:
                kept.append(a)
            if da * db < 0:
                kept.append(tuple(p + (q - p) * da / (da - db) for p, q in zip(a, b, strict=True)))
        polygon = kept
        if not polygon:
            return 0.0
    x, y = np.array(polygon).T
    return 0.5 * abs(float(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))))


coordinate = st.floats(-3.0, 9.0) | st.integers(-2, 8).map(float)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(coordinate, coordinate), min_size=3, max_size=3))
def test_triangle_shares_are_overlap_areas(corners):
    x, y = np.array(corners).T[:, :, None]
    image = np.zeros((1, 5, 6))
    outside = oracle.deposit_triangles(image, x, y, np.ones((1, 1)))
    assert image.min() >= 0.0
    assert abs(image.sum() + outside[0] - 1.0) < ROUNDING
    area = 0.5 * abs(((x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])).item())
    if area > 1e-3:  # the other clipper divides by the area
        expected = [[clipped_area(corners, c, r) / area for c in range(6)] for r in range(5)]
        np.testing.assert_allclose(image[0], expected, atol=1e-9)


def test_triangle_orientation_and_order_do_not_matter():
    rng = np.random.default_rng(2)
    x, y = rng.uniform(-2.0, 8.0, (2, 3, 50))
    flux = rng.uniform(0.0, 1.0, (2, 50))
    first = np.zeros((2, 5, 6))
    oracle.deposit_triangles(first, x, y, flux)
    for order in ([1, 2, 0], [0, 2, 1]):
        image = np.zeros((2, 5, 6))
        oracle.deposit_triangles(image, x[order], y[order], flux)
        np.testing.assert_allclose(image, first, atol=ROUNDING)


def test_triangles_without_area():
    image = np.zeros((1, 1, 4))
    # a segment from 0 to 4 whose third corner halves it: the flux is that of a triangle pressed flat, a tent
    x = np.array([[0.0], [4.0], [2.0]])
    oracle.deposit_triangles(image, x, np.full((3, 1), 0.5), np.ones((1, 1)))
    np.testing.assert_allclose(image[0, 0], [0.125, 0.375, 0.375, 0.125], atol=ROUNDING)
    point = np.zeros((1, 1, 4))
    oracle.deposit_triangles(point, np.full((3, 1), 2.0), np.full((3, 1), 0.5), np.ones((1, 1)))
    np.testing.assert_array_equal(point[0, 0], [0.0, 0.0, 1.0, 0.0])


def test_one_triangle_over_many_pixels():
    image = np.zeros((1, 40, 30))
    corners_x, corners_y = np.array([[-100.0], [300.0], [-100.0]]), np.array([[-100.0], [-100.0], [300.0]])
    outside = oracle.deposit_triangles(image, corners_x, corners_y, np.full((1, 1), 80_000.0))
    np.testing.assert_allclose(image, 1.0, atol=1e-9)
    np.testing.assert_allclose(outside, 80_000.0 - 1200.0, atol=1e-7)


# --- closed forms ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("direction", [(0.0, 0.0, -1.0), (0.7, -0.4, -1.0), (4.0, 4.0, -1.0)])
def test_flat_water_is_uniform(direction):
    medium = {"ior": (1.34, 1.33, 1.35), "absorption": (0.4, 0.1, 0.0), "fresnel": True}
    made = oracle.reference_map(flat_scene(direction, medium=medium, irradiance=(1.0, 2.0, 3.0)), oversample=2)
    light_z = direction[2] / np.linalg.norm(direction)
    for channel, (c, e) in enumerate([(0.4, 1.0), (0.1, 2.0), (0.0, 3.0)]):
        expected = oracle.flat_water_irradiance(light_z, 1.33, 1.0, e, c, True)
        np.testing.assert_allclose(made.caustic_map[..., channel], expected, rtol=ROUNDING)


def test_flat_water_over_a_sloping_floor():
    """The landing X = x + D (level - floor(X)) stretches areas by 1 / (1 + D·slope)."""
    slope = (0.2, -0.3)
    scene = flat_scene((0.5, 0.2, -1.0), {"terrain": {"base": -1.0, "slope": slope}})
    setting = oracle.read_setting(scene)
    stretch = 1.0 + np.dot(setting.rest_deflection, slope)
    made = oracle.reference_map(scene, oversample=2)
    np.testing.assert_allclose(made.caustic_map, -setting.direction[2] * stretch, rtol=ROUNDING)


def test_flat_water_on_a_beach():
    """Uniform under water, direct sunlight on dry land, and both by their part of the pixels at the waterline."""
    slope, edge = 0.4, 0.8
    scene = flat_scene((0.5, 0.2, -1.0), {"terrain": {"base": 1.0 - slope * edge, "slope": (slope, 0.0)}})
    setting = oracle.read_setting(scene)
    ix, _, iz = setting.direction
    wet = -iz * (1.0 + setting.rest_deflection[0] * slope)
    x = 0.3 + 1.5 / 12 * np.arange(13)
    share = np.diff(np.minimum(x, edge)) / np.diff(x)
    expected = share * wet + (1.0 - share) * (slope * ix - iz)
    made = oracle.reference_map(scene, oversample=4)
    np.testing.assert_allclose(made.caustic_map, np.tile(expected, (8, 1)), atol=0.02 * wet)
    away = np.abs(x[:-1] + 0.0625 - edge) > 0.07
    np.testing.assert_allclose(made.caustic_map[:, away], np.tile(expected[away], (8, 1)), rtol=ROUNDING)


@pytest.mark.parametrize(
    ("slope", "depth", "light_x", "ior"),
    [(0.1, 1.0, 0.0, 1.333), (0.25, 2.0, 0.0, 1.5), (0.2, 1.5, np.sin(np.pi / 4), 1.333), (0.8, 0.6, 0.3, 1.3)],
)
def test_one_sine_against_its_branches(slope, depth, light_x, ior):
    k, phase, columns = 2.0 * np.pi / 0.5, 0.4, 40
    wave = {"amplitude": slope / k, "wavevector": (k, 0.0), "phase": phase}
    scene = flat_scene(
        (light_x, 0.0, -np.sqrt(1.0 - light_x**2)),
        medium={"ior": ior},
        level=depth,
        waves=[wave],
        resolution=(columns, 2),
    )
    edges = 0.3 + np.linspace(0.0, 1.5, columns + 1)
    exact = oracle.sine_irradiance(edges, slope / k, k, depth, ior, light_x, phase)
    made = oracle.reference_map(scene, oversample=32)
    assert oracle.relative_l2(made.caustic_map, exact) < CLOSED_FORM


def test_sine_branches_hold_all_light():
    """Over whole periods the mean is the sun's: nothing is lost between the branches."""
    k = 2.0 * np.pi / 0.5
    exact = oracle.sine_irradiance(np.linspace(0.0, 1.5, 31), 0.2 / k, k, 2.0, 1.333, 0.6, 0.1)
    np.testing.assert_allclose(exact.mean(), 0.8, rtol=1e-10)


def test_first_focus():
    a, k, n = 0.01, 9.0, 1.333
    paper = oracle.first_focus_depth(a, k, n)
    np.testing.assert_allclose(oracle.sine_focus_depth(a, k, n, 0.5 * paper, 2.0 * paper), paper, rtol=1e-6)
    assert oracle.sine_folds(a, k, 0.98 * paper - a, n, 0.0, 0.7).size == 0
    assert oracle.sine_folds(a, k, 1.02 * paper - a, n, 0.0, 0.7).size == 2


# --- light and shadow -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("zenith", "printed"), [(60.0, 1.06), (70.0, 1.27), (80.0, 1.98), (85.0, 3.43)])
def test_shadows_take_away_what_facing_makes(zenith, printed):
    """A sine of slope 0.8, over one period: lighting all that faces the sun makes light, shadows keep it exact."""
    k, angle = 2.0 * np.pi, np.radians(zenith)
    wave = {"amplitude": 0.8 / k, "wavevector": (k, 0.0)}
    scene = flat_scene((np.sin(angle), 0.0, -np.cos(angle)), level=9.0, waves=[wave])
    u, v = (np.arange(20_000) + 0.5) / 20_000, np.zeros(1)
    for shadow, ratio, tolerance in ((False, printed, 0.005 + ROUNDING), (True, 1.0, SHADOW_EDGE)):
        scene["water"]["self_shadow"] = shadow
        rays = trace_lattice(oracle.read_setting(scene), u, v)
        assert abs(rays.emitted.mean() / np.cos(angle) - ratio) < tolerance
        kept = rays.emitted - rays.over_lit
        assert abs(kept.mean() / np.cos(angle) - 1.0) < SHADOW_EDGE


def test_light_that_leaves_again():
    """Against a dense look along each path; some light leaves and some lands."""
    case = oracle.CASES["leaving"]
    setting = oracle.read_setting(case.scene_dict())
    rng = np.random.default_rng(3)
    x, y = rng.uniform(0.0, 1.0, (2, 400))
    rays = trace_points(setting, x, y)
    lit = rays.emitted[0] > 0.0
    z, zx, zy = setting.water.height_and_slopes(x, y)
    normal = np.stack([-zx, -zy, np.ones_like(z)], axis=-1) / np.sqrt(1.0 + zx**2 + zy**2)[:, None]
    ray = oracle.refract(setting.direction, normal, setting.ior)
    t = (z / -ray[:, 2])[:, None] * np.linspace(1e-4, 1.0, 4000)
    over = z[:, None] + t * ray[:, 2:] - setting.water.height(x[:, None] + t * ray[:, :1], y[:, None] + t * ray[:, 1:2])
    leaves = (over > 0.0).any(axis=1)
    assert ((rays.fate == LEFT) == leaves)[lit].all()
    assert leaves[lit].any() and not leaves[lit].all()


def test_crossing_sees_a_crest_that_a_ray_just_meets():
    surface = oracle.Surface(0.0, (0.0, 0.0), np.array([0.1]), np.array([[2.0 * np.pi, 0.0]]), np.zeros(1))
    height = [0.1 - 1e-6, 0.1 + 1e-6]  # just under and just over the crest at x = 0.25
    start, ray = np.array([[-0.6, -0.6], [0.0, 0.0], height]), np.array([[1.0, 1.0], [0.0, 0.0], [0.0, 0.0]])
    assert crosses(surface, start, ray, np.ones(2), 1.0).tolist() == [True, False]


def test_first_meeting_with_hills():
    """Landing points lie on the floor, and no ray was under it before."""
    setting = oracle.read_setting(oracle.CASES["hills"].scene_dict())
    rng = np.random.default_rng(4)
    x, y = rng.uniform(0.0, 1.0, (2, 300))
    start = np.stack([x, y, np.full(300, setting.water.base)])
    angle = rng.uniform(0.0, 2.0 * np.pi, 300)
    ray = np.stack([0.7 * np.cos(angle), 0.7 * np.sin(angle), np.full(300, -np.sqrt(0.51))])
    length, hit = meet_floor(setting.floor, start, ray)
    assert hit.all()
    at = length * np.linspace(0.0, 1.0, 2001)[:, None]
    over = start[2] + at * ray[2] - setting.floor.height(x + at * ray[0], y + at * ray[1])
    assert np.abs(over[-1]).max() < 1e-12
    assert over[:-1].min() > -1e-6  # a march step may graze a hill by that much


def test_window_holds_all_water_that_can_light_the_map():
    """One wave that reaches its slope bound: the window is wide enough, and not much wider."""
    k = 2.0 * np.pi / 0.01
    wave = {"amplitude": 0.3 / k, "wavevector": (k, 0.0)}
    setting = oracle.read_setting(flat_scene((0.5, 0.2, -1.0), waves=[wave]))
    (low, high), _ = emitting_window(setting)
    x = np.linspace(low - 0.5, high + 0.5, 20_001)
    rays = trace_points(setting, x, np.full(x.shape, 0.1))
    lights = x[(rays.x >= 0.0) & (rays.x <= 12.0)]
    assert low < lights.min() < low + 0.02
    assert high - 0.02 < lights.max() < high


# --- the whole ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", oracle.CASES)
def test_energy_adds_up(name):
    case = oracle.CASES[name]
    setting = oracle.read_setting(case.scene_dict(), case.time)
    made = oracle.triangle_map(setting, 1)
    energy = {key: np.sum(value) for key, value in made.energy.items()}
    spent = sum(energy[key] for key in ("received", "reflected", "absorbed", "outside_map", "left_water"))
    assert abs(spent / energy["emitted"] - 1.0) < ROUNDING
    area = setting.pixel[0] * setting.pixel[1]
    assert abs(made.caustic_map.sum() * area / (energy["received"] + energy["dry"]) - 1.0) < ROUNDING
    assert (energy["left_water"] > 0.0) == (name == "leaving")
    assert (energy["dry"] > 0.0) == (name == "shore")


@pytest.mark.parametrize("name", ["choppy_45", "bumpy_terrain", "deep", "shaded", "leaving", "hills", "shore"])
def test_second_road(name):
    """Photons at random places agree with the stored map within their own noise."""
    case = oracle.CASES[name]
    counted = oracle.photon_map(case.scene_dict(), case.time, per_pixel=1 if case.kind == "hard" else 2, batches=8)
    exact = oracle.load_reference(name).caustic_map
    if name == "shore":  # photons see no dry land
        lit = counted.caustic_map > 0.0
        shore = oracle.read_setting(case.scene_dict())
        exact = exact - np.moveaxis(oracle.reference.direct_sunlight(shore), 0, -1)[..., 0]
        assert lit.any() and not lit.all()
    difference = np.sqrt(np.mean((counted.caustic_map - exact) ** 2))
    noise = np.sqrt(np.mean(counted.noise**2))
    assert NOISE_BAND[0] < difference / noise < NOISE_BAND[1]
    mean_noise = np.sqrt(np.sum(counted.noise**2)) / counted.noise.size
    assert abs(np.mean(counted.caustic_map - exact)) < 4.0 * mean_noise


def test_second_order_convergence():
    """Half the step, a quarter of the error."""
    case = oracle.CASES["steep"]
    exact = oracle.load_reference("steep").caustic_map
    one, two, four = (
        oracle.relative_l2(oracle.ideal_map(case.scene_dict(), per_pixel=n).caustic_map, exact) for n in (1, 2, 4)
    )
    assert 3.0 < one / two < 5.5
    assert 3.0 < two / four < 5.5


def test_mirrored_scene_gives_a_mirrored_map():
    scene = oracle.CASES["choppy_45"].scene_dict()
    made = oracle.triangle_map(oracle.read_setting(scene), 2)
    size = scene["map"]["size"][0]
    for wave in scene["water"]["waves"]:
        kx, ky = wave["wavevector"]
        wave["wavevector"], wave["phase"] = (-kx, ky), wave["phase"] + kx * size
    ix, iy, iz = scene["sun"]["direction"]
    scene["sun"]["direction"] = (-ix, iy, iz)
    mirrored = oracle.triangle_map(oracle.read_setting(scene), 2, falling=True)
    np.testing.assert_allclose(mirrored.caustic_map[:, ::-1], made.caustic_map, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("name", oracle.CASES)
def test_stored_references_are_good_enough(name):
    case, stored = oracle.CASES[name], oracle.load_reference(name)
    assert stored.caustic_map.shape[:2] == case.resolution[::-1]
    assert np.isfinite(stored.caustic_map).all()
    assert stored.error < (ORDINARY_ERROR if case.kind == "ordinary" else DEEP_ERROR)
    ideal = [
        oracle.relative_l2(oracle.ideal_map(case.scene_dict(), case.time, falling=f).caustic_map, stored.caustic_map)
        for f in (False, True)
    ]
    np.testing.assert_allclose(ideal, stored.ideal_error, rtol=1e-3)


def test_a_stored_reference_can_be_made_again():
    case = oracle.CASES["zenith"]
    made = oracle.reference_map(case.scene_dict(), case.time, case.oversample)
    stored = oracle.load_reference("zenith")
    assert oracle.relative_l2(made.caustic_map, stored.caustic_map) < SAME_RECIPE
    np.testing.assert_allclose(made.error, stored.error, rtol=1e-6)


@pytest.mark.parametrize("name", oracle.CASES)
def test_cases_are_scenes_of_the_library(name):
    from warp_caustics.scene import Scene

    scene = Scene(**oracle.CASES[name].scene_dict())
    assert scene.map.resolution == oracle.CASES[name].resolution


def test_what_the_reference_does_not_know_is_refused():
    with pytest.raises(ValueError, match=r"medium\.jerlov"):
        oracle.read_setting(flat_scene((0.0, 0.0, -1.0), medium={"ior": 1.3, "jerlov": "II"}))
