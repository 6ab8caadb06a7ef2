"""The converged reference: against closed forms, against the oracle, and its two roads against each other."""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np
import pytest
from scenery import ANY_SUN, GENTLE, IOR, refracted, relative_l2, sample_points, save_box, save_heights, scene, wave

import warp_caustics as wc
from oracle import CASES, first_focus_depth, flat_water_irradiance, load_reference, sine_irradiance
from oracle.cases import sunlight
from warp_caustics.reference import jittered_photons, make_reference

EXACT = 1e-9  # float64 over some thousands of additions
CLOSED = 1e-4  # what is promised against closed forms; folds rise as 1/sqrt(distance)
ORACLE = 3.0  # times its own error bar, or the oracle's, whichever is larger
BAR = 5e-4  # tolerance of the references here: some seconds each
NOISES = 1.5  # two roads differ by the noise of one, give or take the noise of the noise

WAVELENGTH, AMPLITUDE, PIXELS, ROWS = 0.96, 0.01, 96, 2
K = 2.0 * np.pi / WAVELENGTH


def reference(what, tolerance=BAR, device="cpu", **options):
    return make_reference(what, tolerance=tolerance, device=device, cache=False, **options)


def test_flat_water_is_uniform_to_float64(device):
    medium = {"ior": IOR, "absorption": 0.3, "fresnel": True}
    made = reference(scene(direction=ANY_SUN, medium=medium), device=device)
    expected = flat_water_irradiance(ANY_SUN[2], IOR, 1.0, absorption=0.3, fresnel=True)
    np.testing.assert_allclose(made.caustic_map, expected, rtol=EXACT)
    assert made.error_bar < EXACT
    assert made.energy.unaccounted < EXACT


def test_a_tilted_floor_spreads_light_by_its_slope(device):
    # Landing on z = base + p x + q y from flat water: the plan area is that of the water over 1 + p tx + q ty, where
    # t is the way by unit depth.
    slope = (0.3, -0.2)
    floor = {"terrain": {"base": -1.0, "slope": slope}}
    made = reference(scene(receiver=floor, direction=ANY_SUN), device=device)
    stretch = 1.0 + float(np.dot(slope, refracted(ANY_SUN)))
    np.testing.assert_allclose(made.caustic_map, -ANY_SUN[2] * stretch, rtol=EXACT)


@pytest.mark.parametrize("share", [0.6, 1.6])
@pytest.mark.parametrize("light_x", [0.0, 0.5])
def test_a_sine_before_and_past_its_focus(device, share, light_x):
    depth = share * first_focus_depth(AMPLITUDE, K, IOR)
    size, resolution = (WAVELENGTH, WAVELENGTH * ROWS / PIXELS), (PIXELS, ROWS)
    direction = (light_x, 0.0, -np.sqrt(1.0 - light_x**2))
    what = scene([wave(AMPLITUDE, K, 0.0)], direction=direction, level=depth, size=size, resolution=resolution)
    made = reference(what, tolerance=CLOSED / 10.0, device=device)
    expected = sine_irradiance(np.linspace(0.0, WAVELENGTH, PIXELS + 1), AMPLITUDE, K, depth, IOR, light_x)
    error = relative_l2(made.caustic_map.mean(axis=0), expected)
    assert error < CLOSED
    assert error < ORACLE * made.error_bar


def test_a_lens_of_water(device, tmp_path):
    # s = -r^2 / (2 radius) under a sun at the zenith sends light from r to a place on the same radius: the light within
    # a square of the floor is that of the water that lands there, a sum over a fine polar mesh.
    half_width, radius, depth, pixels = 0.1, 1.0, 1.5, 32
    origin, size = (-half_width, -half_width), (2.0 * half_width, 2.0 * half_width)
    x, y = sample_points((24, 24), origin, size)
    height_map = save_heights(tmp_path, "lens", -(x**2 + y**2) / (2.0 * radius), origin, size)
    down = (0.0, 0.0, -1.0)
    what = scene(height_map=height_map, direction=down, level=depth, origin=origin, size=size, resolution=(pixels,) * 2)
    made = reference(what, tolerance=CLOSED / 2.0, device=device)
    # The landing is radial, X = g(r) x / r with g smooth and rising before the focus: so a pixel's light is the area
    # of its own preimage, which an exact polygon with many points on each side has.
    inside = (slice(8, -8), slice(8, -8))  # no light of the lens's border falls there
    expected = lens_light(radius, depth, half_width, pixels)
    assert expected[inside].min() > 1.5  # it is a lens
    assert relative_l2(made.caustic_map[inside], expected[inside]) < CLOSED


def lens_landing(r, radius, depth):
    """Where light that meets the lens at r lands, from the axis."""
    lean = np.arctan(r / radius)  # of the normal, outwards
    bent = lean - np.arcsin(np.sin(lean) / IOR)  # towards the axis
    return r - (depth - r**2 / (2.0 * radius)) * np.tan(bent)


def lens_light(radius, depth, half_width, pixels, points=256):
    """Irradiance by pixel: the area of each pixel's preimage in the lens, over the pixel's own."""
    r = np.linspace(0.0, 2.0 * half_width, 200_001)
    landed = lens_landing(r, radius, depth)
    edges = np.linspace(-half_width, half_width, pixels + 1)
    t = np.linspace(0.0, 1.0, points, endpoint=False)
    light = np.zeros((pixels, pixels))
    for row in range(pixels):
        for column in range(pixels):
            (a, b), (c, d) = edges[column : column + 2], edges[row : row + 2]
            x = np.concatenate([a + t * (b - a), np.full(points, b), b - t * (b - a), np.full(points, a)])
            y = np.concatenate([np.full(points, c), c + t * (d - c), np.full(points, d), d - t * (d - c)])
            from_axis = np.hypot(x, y)
            scale = np.interp(from_axis, landed, r) / np.maximum(from_axis, 1e-30)
            u, v = np.clip(x * scale, -half_width, half_width), np.clip(y * scale, -half_width, half_width)
            light[row, column] = 0.5 * np.sum(u * np.roll(v, -1) - np.roll(u, -1) * v)
    return light / (edges[1] - edges[0]) ** 2


@pytest.mark.parametrize("name", ["calm_pool", "choppy_45", "bumpy_terrain", "shaded"])
def test_it_agrees_with_the_oracle(device, name):
    case, stored = CASES[name], load_reference(name)
    made = reference(wc.Scene(**case.scene_dict()), time=case.time, device=device)
    assert relative_l2(made.caustic_map, stored.caustic_map) < ORACLE * max(made.error_bar, stored.error)
    assert made.energy.unaccounted < EXACT
    assert np.max(made.energy.dropped) == 0.0


def two_roads(what, device, per_side=8):
    """How far the photons' map lies from the cells', and by how much two maps of photons say it should."""
    cells = reference(what, device=device)
    one, two = (jittered_photons(what, per_side=per_side, seed=seed, device=device) for seed in (1, 2))
    noise = np.sqrt(np.mean((one - two) ** 2) / 2.0) / cells.caustic_map.mean()
    return relative_l2(one, cells.caustic_map), noise, one, cells


def test_two_roads_lead_to_one_answer_on_a_plane(device):
    far, noise, one, cells = two_roads(scene(GENTLE), device)
    assert noise / NOISES < far < NOISES * noise
    # The noise is of single pixels: what they gather together agrees far better.
    assert one.mean() == pytest.approx(cells.caustic_map.mean(), rel=1e-3)


def test_two_roads_lead_to_one_answer_on_objects_under_a_disk_of_the_sun(device, tmp_path):
    box = {"mesh": save_box(tmp_path), "translate": (1.0, 0.5, 0.0), "scale": 0.3}
    what = scene(GENTLE, {"plane": 0.0, "objects": [box]}, sun={"angular_diameter": 2.0}, resolution=(20, 14))
    far, noise, one, cells = two_roads(what, device)
    assert noise / NOISES < far < NOISES * noise
    assert one.mean() == pytest.approx(cells.caustic_map.mean(), rel=3e-3)


def test_the_error_bar_is_the_difference_of_two_levels(device):
    what = scene(GENTLE)
    loose, tight = reference(what, tolerance=1e-2, device=device), reference(what, tolerance=1e-4, device=device)
    assert loose.samples < tight.samples
    assert tight.error_bar <= 1e-4 < loose.error_bar <= 1e-2
    assert relative_l2(loose.caustic_map, tight.caustic_map) < 2.0 * loose.error_bar


def test_when_rays_run_out_it_says_so(device):
    what = scene(GENTLE, method={"reference": {"rays": 1, "tolerance": 1e-6}})
    result = wc.render(what, method="reference", device=device)
    assert result.error_bar > 1e-6
    assert any("rays ran out" in warning for warning in result.warnings)


def test_rendered_by_the_front_door(device):
    what = scene(GENTLE)
    result = wc.render(what, method="reference", device=device)
    made = make_reference(what, device=device)
    assert made.cached
    assert result.method == "reference"
    assert result.caustic_map.dtype == np.float32
    np.testing.assert_array_equal(result.caustic_map, made.caustic_map.astype(np.float32))
    assert result.error_bar == made.error_bar
    assert wc.render(what, method="beam", device=device).error_bar is None
    assert "reference_cells" in str(wc.make_plan(what, method="reference", device=device))


def test_a_renderer_of_frames_refuses_it():
    with pytest.raises(wc.InputError, match=r"warp_caustics\.render"):
        wc.Renderer(scene(GENTLE), method="reference")


@pytest.mark.parametrize("tolerance", [0.0, -1.0, float("nan")])
def test_a_tolerance_that_cannot_be_met_is_refused(tolerance):
    with pytest.raises(wc.InputError, match="tolerance"):
        make_reference(scene(GENTLE), tolerance=tolerance)


def test_it_shares_no_kernel_with_what_it_judges():
    """Its device code takes from the other kernels the specification alone, which is no code."""
    folder = Path(__file__).parents[1] / "kernels" / "reference"
    for path in folder.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.level >= 2:
                assert (node.module, [name.name for name in node.names]) == ("spec", ["Spec"]), path.name


def test_water_finer_than_a_pixel_is_not_agreed_upon_by_accident(device):
    """Waves of half a pixel: on a mesh of one and two cells a pixel every corner meets the same phase."""
    columns, rows = 8, 4
    k = 2.0 * np.pi / (0.5 * 2.0 / columns)
    what = scene([wave(0.5 / k, k, 0.0)], direction=(0.6, 0.0, -0.8), resolution=(columns, rows), size=(2.0, 1.0))
    made = reference(what, tolerance=1e-3, device=device)
    fine = jittered_photons(what, per_side=64, device=device)
    assert made.caustic_map.mean() == pytest.approx(fine.mean(), rel=2e-3)
    assert relative_l2(fine, made.caustic_map) < 1e-2


def test_an_object_smaller_than_a_cell_is_seen(device, tmp_path):
    # On 20 x 14 pixels of a tenth of a metre, a box of 3 cm stands between the corners of the first cells.
    box = {"mesh": save_box(tmp_path), "translate": (1.037, 0.537, 0.2), "scale": 0.03}
    shared = {"size": (2.0, 1.4), "resolution": (20, 14)}
    made, bare = (
        reference(scene((), {"plane": 0.0, **more}, **shared), tolerance=5e-3, device=device)
        for more in ({"objects": [box]}, {})
    )
    assert np.abs(made.caustic_map - bare.caustic_map).max() > 0.05
    assert made.error_bar > 0.0


def test_a_low_sun_casts_the_whole_shadow_of_what_stands_above_the_water(device, tmp_path):
    # 1.2 m of box above the water under a sun of 3 degrees: the shadow is 23 m long, and the map lies in it at 15 m.
    box = {"mesh": save_box(tmp_path), "translate": (0.0, 0.5, 0.0), "scale": 1.4}
    low = sunlight(87.0, 0.0)
    what = scene((), {"plane": 0.0, "objects": [box]}, low, level=0.2, origin=(15.0, 0.4), size=(0.4, 0.2),
                 resolution=(8, 4))  # fmt: skip
    for method in ("beam", "photon", "reference"):
        result = wc.render(what, method=method, device=device)
        assert result.caustic_map.max() == 0.0, method
        assert result.energy.blocked > 0.0, method


def test_the_error_bar_covers_dry_land(device):
    """Shadows of hills on land above the water: the whole map is land, and its bar is not that of no water."""
    hills = [wave(0.3, 4.0, 2.0, 0.4), wave(0.2, -3.0, 5.0, 1.0)]
    floor = {"terrain": {"base": 3.0, "slope": (0.3, -0.2), "waves": hills}}
    what = scene((), floor, sunlight(70.0), resolution=(12, 8))
    loose, tight = reference(what, tolerance=5e-2, device=device), reference(what, tolerance=2e-3, device=device)
    assert 0.0 < tight.error_bar <= 2e-3
    assert relative_l2(loose.caustic_map, tight.caustic_map) < 2.0 * loose.error_bar


def test_more_rays_than_can_be_walked_are_refused_by_the_plan():
    far = scene(GENTLE, direction=(0.8, 0.1, -0.6), level=3e4, size=(0.05, 0.05), resolution=(64, 64))
    with pytest.raises(wc.InputError, match=r"rays|cells of water"):
        wc.make_plan(far, method="reference", device="cpu")
