"""Water in closed form: one sine with its folds and its first focus, and a lens."""

from __future__ import annotations

import numpy as np
import pytest
from scenery import IOR, METHODS, refracted, relative_l2, render, sample_points, save_heights, scene, wave

from oracle import first_focus_depth, sine_folds, sine_irradiance, sine_landing
from oracle.cases import sunlight

# Relative L2 error over a wave of 96 pixels. The beam lets 0.005 of a pixel's bend stand, so a pixel is right to a
# thousandth; beside a fold one pixel holds what rises as 1/sqrt(distance). A box of a pixel blurs by a pixel: 16
# photons a pixel leave that blur, and the gather's one sample a pixel leaves gaps where light is drawn apart.
SMOOTH_ERROR = {"beam": 2e-3, "photon": 1e-2, "gather": 0.15}
FOLDED_ERROR = {"beam": 5e-3, "photon": 0.15, "gather": 0.4}
CREST_ERROR = {"beam": 1e-2, "photon": 0.02, "gather": 0.1}
CHOSEN = {"photon": {"photons_per_pixel": 16.0, "footprint": "pixel"}}

WAVELENGTH = 0.96
K = 2.0 * np.pi / WAVELENGTH
AMPLITUDE = 0.01
PIXELS = 96  # one wavelength
ROWS = 4
FOCUS = first_focus_depth(AMPLITUDE, K, IOR)  # below the crest: 9.3 wavelengths


def sine_scene(depth, light_x=0.0, axis=0):
    """One wave whose crest stands in the middle of the map, over a floor ``depth`` below the level."""
    turn = np.pi / 2.0 - K * WAVELENGTH / 2.0
    wavevector = (K, 0.0) if axis == 0 else (0.0, K)
    light = (light_x, 0.0) if axis == 0 else (0.0, light_x)
    size, resolution = (WAVELENGTH, WAVELENGTH * ROWS / PIXELS), (PIXELS, ROWS)
    return scene(
        [wave(AMPLITUDE, *wavevector, turn)],
        direction=(*light, -np.sqrt(1.0 - light_x**2)),
        medium={"ior": IOR},
        level=depth,
        size=size if axis == 0 else size[::-1],
        resolution=resolution if axis == 0 else resolution[::-1],
        method=CHOSEN,
    ), turn


def exact(depth, turn, light_x=0.0, pixels=PIXELS):
    edges = np.linspace(0.0, WAVELENGTH, pixels + 1)
    return sine_irradiance(edges, AMPLITUDE, K, depth, IOR, light_x, turn)


def profile(result, axis=0):
    """The map along the wave; it does not change across it."""
    image = result.caustic_map if axis == 0 else result.caustic_map.T
    np.testing.assert_allclose(image, np.broadcast_to(image[0], image.shape), rtol=1e-4)
    return image.mean(axis=0, dtype=np.float64)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("axis", [0, 1])
def test_irradiance_before_the_first_focus(device, method, axis):
    depth = 0.6 * FOCUS
    what, turn = sine_scene(depth, axis=axis)
    assert relative_l2(profile(render(what, method, device), axis), exact(depth, turn)) < SMOOTH_ERROR[method]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("light_x", [0.0, 0.5])
def test_irradiance_past_the_first_focus(device, method, light_x):
    depth = 1.6 * FOCUS
    what, turn = sine_scene(depth, light_x)
    expected = exact(depth, turn, light_x)
    assert expected.max() > 4.0 * expected.mean()
    assert relative_l2(profile(render(what, method, device)), expected) < FOLDED_ERROR[method]


@pytest.mark.parametrize("method", METHODS)
def test_folds_stand_where_the_landing_turns_back(device, method):
    depth = 1.6 * FOCUS
    what, turn = sine_scene(depth)
    folds = sine_folds(AMPLITUDE, K, depth, IOR, 0.0, WAVELENGTH, 0.0, turn)
    pixels = np.sort(sine_landing(folds, AMPLITUDE, K, depth, IOR, 0.0, turn)) / WAVELENGTH * PIXELS
    assert len(pixels) == 2
    assert pixels.sum() == pytest.approx(PIXELS)  # on either side of the crest
    brightness = profile(render(what, method, device))
    for half, fold in ((slice(0, PIXELS // 2), pixels[0]), (slice(PIXELS // 2, PIXELS), pixels[1])):
        brightest = np.argmax(brightness[half]) + half.start
        assert abs(brightest + 0.5 - fold) <= 1.0  # the pixel of the fold, or its neighbour


@pytest.mark.parametrize("method", METHODS)
def test_brightness_under_crest_and_trough(device, method):
    # At the crest dX/dx = 1 - D / focus, D being its height above the floor, and at the trough 1 + D / focus.
    for share in (0.3, 0.6):
        above_crest = share * FOCUS
        depth = above_crest - AMPLITUDE
        what, _ = sine_scene(depth)
        brightness = profile(render(what, method, device))
        middle = brightness[PIXELS // 2 - 1 : PIXELS // 2 + 1].mean()
        ends = brightness[[0, 1, 2, -3, -2, -1]].mean()
        assert middle == pytest.approx(1.0 / (1.0 - share), rel=CREST_ERROR[method])
        assert ends == pytest.approx(1.0 / (1.0 + (depth - AMPLITUDE) / FOCUS), rel=CREST_ERROR[method])


@pytest.mark.parametrize("method", METHODS)
def test_the_first_focus_lies_under_the_crest_and_there_it_splits(device, method):
    def brightest(share):
        what, _ = sine_scene(share * FOCUS - AMPLITUDE)
        brightness = profile(render(what, method, device))
        return abs(np.argmax(brightness) + 0.5 - PIXELS / 2.0), brightness.max()

    before, at, after = brightest(0.8), brightest(1.0), brightest(1.6)
    assert before[0] <= 1.0
    assert at[0] <= 1.0
    assert after[0] > 3.0
    assert at[1] > before[1]
    assert at[1] > after[1]


@pytest.mark.parametrize("method", METHODS)
def test_a_lens_of_water_focuses(device, method, tmp_path):
    # s = -r^2 / (2 radius) focuses near ior * radius / (ior - 1) below its top; halfway it has shrunk to half its
    # width. A bicubic surface holds a paraboloid exactly, and the lens ends at the border of its file.
    half_width, radius = 0.1, 1.0
    focus = IOR * radius / (IOR - 1.0)
    origin, size = (-half_width, -half_width), (2.0 * half_width, 2.0 * half_width)
    x, y = sample_points((24, 24), origin, size)
    height_map = save_heights(tmp_path, "lens", -(x**2 + y**2) / (2.0 * radius), origin, size)
    pixel = 0.01
    area = (2.0 * half_width) ** 2

    def shine(depth):
        what = scene(
            height_map=height_map, direction=(0.0, 0.0, -1.0), medium={"ior": IOR}, level=depth,
            origin=(-0.105, -0.105), size=(0.21, 0.21), resolution=(21, 21),
        )  # fmt: skip
        return render(what, method, device)

    near = shine(focus / 2.0)
    assert near.caustic_map[10, 10] == pytest.approx(4.0, rel=0.01)
    assert near.caustic_map[10, 2] == 0.0
    far = shine(focus)
    assert far.energy.received == pytest.approx(area, rel=1e-4)
    # Rays from the corner of the lens miss the axis by their spherical aberration: a third of a pixel.
    middle = far.caustic_map[9:12, 9:12].sum(dtype=np.float64) * pixel**2
    assert middle == pytest.approx(area, rel=1e-3)
    assert far.caustic_map[10, 10] > 0.5 * area / pixel**2


@pytest.mark.parametrize(("zenith", "share"), [(0.0, 1.0), (20.0, 1.024), (30.0, 1.06), (45.0, 1.17), (60.0, 1.43)])
def test_the_light_of_eq_3_3_lands_too_far_by_its_printed_share(device, zenith, share, tmp_path):
    # Flat water from a file lights a square of the floor, whose middle tells how far its light went sideways.
    flat = save_heights(tmp_path, "flat", np.zeros((9, 9)), (-0.5, -0.5), (1.0, 1.0))
    what = scene(
        height_map=flat, direction=sunlight(zenith, 0.0), medium={"ior": IOR}, origin=(-1.0, -1.0), size=(4.0, 2.0),
        resolution=(80, 40), method={"photon": {"projection": "backlund"}},
    )  # fmt: skip
    image = render(what, "photon", device).caustic_map
    x, y = sample_points(image.shape, what.map.origin, what.map.size)
    exactly = refracted(sunlight(zenith, 0.0))[0]
    assert (image * x).sum() / image.sum() == pytest.approx(share * exactly, abs=5e-3)
    assert (image * y).sum() / image.sum() == pytest.approx(0.0, abs=1e-4)
