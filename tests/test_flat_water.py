"""Flat water has a closed form: E_sun |I_z| T exp(-c d / |R_z|), everywhere, for every method and any sun."""

from __future__ import annotations

import numpy as np
import pytest
from scenery import METHODS, render, scene

from oracle import flat_water_irradiance
from oracle.cases import sunlight

# What a cell's landing is rounded by, 1e-7 of its way, is up to 2e-5 of a pixel in these maps, and the pixels at the
# border lose it; transmittance at 89° from the zenith is rounded by 6e-6.
UNIFORM = 2e-5
LEDGER = 1e-6  # a float32 map against a float64 ledger

METRE_OF_WATER = 1.0
SUNS = (0.0, 1e-4, 30.0, 60.0, 80.0, 89.0)
JERLOV_II = (0.40, 0.089, 0.068)  # K_d of physics.md at 650, 550 and 450 nm
GREEN_IOR = {"fresh": 1.33434, "sea": 1.34079}  # physics.md at 550 nm


def assert_uniform(result, expected):
    """The map is ``expected`` (a number, or one a channel) everywhere, and the ledger knows where the rest went."""
    np.testing.assert_allclose(result.caustic_map, np.broadcast_to(expected, result.caustic_map.shape), rtol=UNIFORM)
    area = float(np.prod(result.scene.map.size))
    np.testing.assert_allclose(result.energy.received, np.multiply(expected, area), rtol=UNIFORM)
    assert result.energy.unaccounted < LEDGER
    for name in ("left_water", "blocked", "dropped", "dry", "over_lit"):
        assert np.max(result.energy[name]) == 0.0, name


def vertical(zenith):
    """|I_z| of a sun."""
    return np.cos(np.radians(zenith))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("zenith", SUNS)
def test_any_sun_lights_flat_water_evenly(device, method, zenith):
    result = render(scene(direction=sunlight(zenith)), method, device)
    assert_uniform(result, vertical(zenith))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    ("resolution", "size"),
    [
        ((1, 1), (1.0, 1.0)),
        ((1, 64), (0.5, 3.0)),
        ((64, 1), (1.0, 0.1)),
        ((31, 17), (1.0, 0.7)),
        ((33, 47), (0.4, 5.0)),
    ],
)
def test_maps_and_pixels_of_any_shape(device, method, resolution, size):
    for density in (0.3, 1.0, 2.3):
        chosen = {"beam": {"samples_per_pixel": density}, "photon": {"photons_per_pixel": density}}
        result = render(
            scene(direction=sunlight(60.0), resolution=resolution, size=size, method=chosen), method, device
        )
        assert result.caustic_map.shape == resolution[::-1]
        assert_uniform(result, vertical(60.0))


@pytest.mark.parametrize("footprint", ["cell", "pixel", 3.5])
def test_photons_of_any_footprint_are_even_where_their_boxes_tile(device, footprint):
    chosen = {"photon": {"photons_per_pixel": 1.0, "footprint": footprint}}
    assert_uniform_inside = render(scene(method=chosen), "photon", device).caustic_map[4:-4, 4:-4]
    np.testing.assert_allclose(assert_uniform_inside, -scene().sun.direction[2], rtol=UNIFORM)


@pytest.mark.parametrize("method", METHODS)
def test_the_colour_of_the_sun(device, method):
    irradiance = (1000.0, 0.0, 3.0)
    result = render(scene(sun={"irradiance": irradiance}), method, device)
    assert result.caustic_map.shape == (28, 40, 3)
    assert result.plan.facts.spec.channels == 1  # light travels alike: one channel is followed, three are shown
    assert_uniform(result, np.multiply(irradiance, -result.scene.sun.direction[2]))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("zenith", [0.0, 60.0, 80.0, 89.0])
def test_fresnel_and_absorption(device, method, zenith):
    medium = {"ior": 1.34, "fresnel": True, "absorption": 0.4}
    result = render(scene(direction=sunlight(zenith), medium=medium), method, device)
    assert_uniform(result, flat_water_irradiance(-vertical(zenith), 1.34, METRE_OF_WATER, 1.0, 0.4, True))
    before, after = (flat_water_irradiance(-vertical(zenith), 1.34, METRE_OF_WATER, 1.0, 0.0, f) for f in (False, True))
    energy = result.energy
    assert energy.reflected / energy.emitted == pytest.approx((before - after) / before, abs=UNIFORM)
    lost = 1.0 - np.exp(-0.4 * METRE_OF_WATER / np.sqrt(1.0 - (np.sin(np.radians(zenith)) / 1.34) ** 2))
    assert energy.absorbed / (energy.emitted - energy.reflected) == pytest.approx(lost, rel=UNIFORM)


@pytest.mark.parametrize("method", METHODS)
def test_absorption_by_colour(device, method):
    absorption, irradiance = (0.4, 0.1, 0.0), (1.0, 2.0, 0.5)
    for zenith in (0.0, 60.0):
        what = scene(
            direction=sunlight(zenith), medium={"ior": 1.333, "absorption": absorption}, sun={"irradiance": irradiance}
        )
        expected = [
            flat_water_irradiance(-vertical(zenith), 1.333, METRE_OF_WATER, e, c)
            for e, c in zip(irradiance, absorption, strict=True)
        ]
        assert_uniform(render(what, method, device), expected)


@pytest.mark.parametrize("method", METHODS)
def test_jerlov_acts_over_the_vertical_depth(device, method):
    for zenith in (0.0, 70.0):
        medium = {"ior": 1.34, "fresnel": True, "jerlov": "II"}
        level = 3.0
        result = render(scene(direction=sunlight(zenith), medium=medium, level=level), method, device)
        entered = flat_water_irradiance(-vertical(zenith), 1.34, level, 1.0, 0.0, True)
        assert_uniform(result, entered * np.exp(-level * np.array(JERLOV_II)))


@pytest.mark.parametrize(
    ("ior", "index"), [(1.0, 1.0), (1.5, 1.5), ((1.5, 1.4, 1.3), 1.4), *GREEN_IOR.items()], ids=str
)
def test_index_of_refraction(device, ior, index):
    result = render(
        scene(direction=sunlight(60.0), medium={"ior": ior, "fresnel": True, "absorption": 0.4}), "photon", device
    )
    assert_uniform(result, flat_water_irradiance(-0.5, index, METRE_OF_WATER, 1.0, 0.4, True))
    assert any("green" in warning for warning in result.warnings) == (not isinstance(ior, float))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("zenith", "diameter"), [(0.0, 0.533), (60.0, 0.533), (0.0, 30.0), (50.0, 30.0)])
def test_the_suns_disk_shares_out_its_irradiance_and_no_more(device, method, zenith, diameter):
    # Without Fresnel what enters is the irradiance on the horizontal, however wide the disk that it comes from: a
    # disk that is even around its middle has the mean direction of its middle, and `irradiance` faces that.
    result = render(
        scene(direction=sunlight(zenith), sun={"angular_diameter": diameter}, resolution=(12, 10)), method, device
    )
    assert len(result.plan.facts.suns) > 1
    # Points of a sunflower lean by their last turn, 1 / count of the radius.
    lean = np.tan(np.radians(diameter / 2.0)) / len(result.plan.facts.suns)
    assert result.caustic_map.min() == pytest.approx(vertical(zenith), rel=UNIFORM + lean)
    assert result.caustic_map.max() == pytest.approx(vertical(zenith), rel=UNIFORM + lean)
    assert result.energy.unaccounted < LEDGER


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("shift", [0.0, 2500.0, -1e5])
def test_heights_count_from_the_water(device, method, shift):
    result = render(scene(level=1.0 + shift, receiver={"plane": shift}), method, device)
    assert_uniform(result, -result.scene.sun.direction[2])


@pytest.mark.parametrize("method", METHODS)
def test_fine_pixels_under_deep_water_keep_their_border(device, method):
    # 10 m deep and 0.1 mm wide: light travels 50 000 pixels sideways, and its rounding alone is a good part of one.
    what = scene(direction=sunlight(60.0), level=10.0, resolution=(16, 16), size=(1.6e-3, 1.6e-3))
    assert_uniform(render(what, method, device), 0.5)


@pytest.mark.parametrize("method", METHODS)
def test_scale_does_not_matter(device, method):
    for scale in (1e-3, 1e3):
        what = scene(level=scale, size=(2.0 * scale, 1.1 * scale), medium={"ior": 1.333})
        assert_uniform(render(what, method, device), -what.sun.direction[2])
