"""Extremes of light, place, size and time: every method gives a finite map whose ledger adds up, or says no.

``bench/stability`` sweeps the same things further and prints what came out; here are the guarantees.
"""

from __future__ import annotations

import functools

import numpy as np
import pytest
from scenery import FREE_METHODS, LOSSES, METHODS, render, save_heights, save_mesh

import warp_caustics as wc
from oracle import reference_map, relative_l2, sine_irradiance
from oracle.cases import sunlight, waves

PIXEL = 1.0 / 64.0
ADDS_UP = 5e-6  # a float32 map against a float64 ledger; thousands of photons in one pixel at a focus

# Against references that are right to a tenth of it, at default settings; what each method reaches, with a third more.
ERROR = {"beam": 3e-3, "photon": 0.1, "gather": 0.25}

# A sine whose light crosses in hundreds of sheets, each thinner than a pixel: float32 places them to 1e-3 pixel.
DEEP = 1e-2

# Edges of shadow, and of what leaves through a crest, against references that find them to a percent themselves.
EDGES = 3e-2


def table(pixel=PIXEL, zenith=30.0, resolution=(32, 24), origin=(0.0, 0.0), depth=48.0, slope=0.05, **changes):
    """Waves some tens of pixels long over a flat floor, as a scene's tables."""
    made = {
        "water": {"level": depth * pixel, "waves": waves(pixel, 60.0, 16.0, 5, slope)},
        "receiver": {"plane": 0.0},
        "sun": {"direction": sunlight(zenith)},
        "medium": {"ior": 1.333},
        "map": {"origin": origin, "size": tuple(pixel * n for n in resolution), "resolution": resolution},
    }
    return {**made, **changes}


def sine(depth, amplitude, length=0.5, light_x=0.3):
    """One sine along x over 32 by 4 pixels, with the sun in its plane."""
    k = 2.0 * np.pi / length
    return table(
        resolution=(32, 4),
        water={"level": depth, "waves": [{"amplitude": amplitude, "wavevector": (k, 0.0), "phase": 0.3}]},
        sun={"direction": (light_x, 0.0, -float(np.sqrt(1.0 - light_x**2)))},
    )


def closed_form(described):
    """The light under :func:`sine`."""
    wave = described["water"]["waves"][0]
    edges = np.linspace(0.0, described["map"]["size"][0], 33)
    line = sine_irradiance(
        edges, wave["amplitude"], wave["wavevector"][0], described["water"]["level"], 1.333,
        described["sun"]["direction"][0], wave["phase"],
    )  # fmt: skip
    return np.tile(line, (4, 1))


def assert_sound(result):
    """Nothing is infinite, nothing is lost, and what is not there is said."""
    assert np.isfinite(result.caustic_map).all()
    energy = result.energy
    assert energy.unaccounted < ADDS_UP
    spent = sum(np.asarray(energy[name]) for name in LOSSES)
    np.testing.assert_allclose(spent, energy.emitted, rtol=ADDS_UP, atol=1e-12)
    assert np.max(energy.dropped) == 0.0


EXTREMES = {
    "sun 80": table(zenith=80.0, slope=0.03),
    "no refraction": table(medium={"ior": 1.0}),
    "hardly any": table(medium={"ior": 1.0001}),
    "diamond": table(medium={"ior": 2.4}),
    "micrometre": table(pixel=1e-6),
    "100 km": table(pixel=3200.0),
    "10,000 km away": table(origin=(1e7, -1e7)),
    "one row": table(resolution=(300, 1)),
    "one column": table(resolution=(1, 300)),
    "odd": table(resolution=(23, 17)),
}


@functools.cache
def truth_of(name):
    """The reference of an extreme, once for all methods."""
    truth = reference_map(EXTREMES[name], oversample=6)
    assert truth.error < 0.3 * ERROR["beam"]
    return truth


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", EXTREMES)
def test_an_extreme_is_as_right_as_any_scene(device, method, name):
    result = render(wc.Scene(**EXTREMES[name]), method, device)
    assert_sound(result)
    truth = truth_of(name)
    assert relative_l2(result.caustic_map, truth.caustic_map) < ERROR[method]


@pytest.mark.parametrize("method", METHODS)
def test_a_map_after_four_months_is_that_of_its_phases(device, method):
    result = render(wc.Scene(**table(resolution=(32, 4))), method, device, time=1e7)
    assert_sound(result)
    late, now = (reference_map(table(resolution=(32, 4)), time, oversample=4).caustic_map for time in (1e7, 0.0))
    assert relative_l2(result.caustic_map, late) < ERROR[method]
    assert relative_l2(now, late) > 2.0 * ERROR["beam"]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("zenith", [89.0, 89.9])
def test_a_sun_on_the_horizon_lights_flat_water_evenly(device, method, zenith):
    flat = table(zenith=zenith, water={"level": 0.75, "waves": []})
    result = render(wc.Scene(**flat), method, device)
    assert_sound(result)
    np.testing.assert_allclose(result.caustic_map, np.cos(np.radians(zenith)), rtol=2e-5)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("zenith", [89.0, 89.9])
def test_a_sun_on_the_horizon_over_waves_loses_nothing_unsaid(device, method, zenith):
    low = table(zenith=zenith, slope=0.03, resolution=(12, 8), method={"beam": {"refine": False}})
    result = render(wc.Scene(**low), method, device)
    assert_sound(result)
    assert result.energy.blocked > 0.0  # crests in the way
    assert result.caustic_map.min() >= 0.0  # a refined beam's interpolant may dip below


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("depth", [1e-4, 1.0, 1e2])
def test_a_film_of_water_and_the_deep_sea(device, method, depth):
    described = sine(depth, min(0.004, 0.25 * depth))
    result = render(wc.Scene(**described), method, device)
    assert_sound(result)
    truth = closed_form(described)
    assert np.mean(result.caustic_map, dtype=np.float64) == pytest.approx(truth.mean(), rel=2e-5)
    if method == "beam":
        assert relative_l2(result.caustic_map, truth) < (ERROR["beam"] if depth < 10.0 else DEEP)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("slope", [0.1, 1.0, 10.0, 100.0])
def test_slopes_up_to_a_hundred(device, method, slope):
    k = 2.0 * np.pi / 0.25
    steep = sine(0.25 + slope / k, slope / k, length=0.25)
    result = render(wc.Scene(**steep), method, device)
    assert_sound(result)
    if slope <= 1.0 and method == "beam":
        assert relative_l2(result.caustic_map, reference_map(steep, oversample=6).caustic_map) < EDGES
    assert (result.energy.left_water > 0.0) == (slope > 2.0)


@pytest.mark.parametrize(
    ("method", "shadows"), [("beam", True), ("photon", True), ("gather", True), ("photon", False), ("gather", False)]
)
def test_a_wave_that_faces_away(device, method, shadows):
    k = 2.0 * np.pi / 0.75
    backs = table(
        resolution=(32, 4),
        water={
            "level": 0.75,
            "waves": [{"amplitude": 1.0 / k, "wavevector": (k, 0.0), "phase": 0.3}],
            "self_shadow": shadows,
        },
        sun={"direction": sunlight(70.0, 0.0)},
    )
    result = render(wc.Scene(**backs), method, device)
    assert_sound(result)
    assert (result.energy.blocked > 0.0) == shadows
    assert (result.energy.over_lit > 0.0) == (not shadows)
    if method == "beam":
        assert relative_l2(result.caustic_map, reference_map(backs, oversample=4).caustic_map) < EDGES


@pytest.mark.parametrize("method", FREE_METHODS)
@pytest.mark.parametrize("slope", [3.0, -3.0])
def test_a_floor_steeper_than_the_rays(device, method, slope):
    across = slope * 32 * PIXEL
    floor = {"terrain": {"base": -max(across, 0.0) - 0.5, "slope": (slope, 0.0)}}
    steep = table(zenith=60.0, resolution=(32, 4), receiver=floor)
    result = render(wc.Scene(**steep), method, device)
    assert_sound(result)
    if slope < 0.0:  # it falls away faster than the light comes down
        assert not result.caustic_map.any()
        assert result.energy.blocked == pytest.approx(result.energy.emitted)  # by the land on the sun's side
    else:
        truth = reference_map(steep, oversample=4)
        assert relative_l2(result.caustic_map, truth.caustic_map) < 2.0 * ERROR[method]


@pytest.mark.parametrize("rises", [True, False])
def test_a_cliff_lights_its_wall_or_shades_its_foot(device, rises, tmp_path):
    """One step of a terrain file, half as high as the water: far from it the light is even, and the sum is exact."""
    height, zenith = 0.5, 45.0
    x = -1.0 + (np.arange(96) + 0.5) / 32.0
    z = np.where((x > 0.25) == rises, height, 0.0)[None, :] * np.ones((96, 1))
    flat = table(
        resolution=(64, 8), receiver={"terrain": save_heights(tmp_path, "cliff", z, (-1.0, -1.0), (3.0, 3.0))},
        water={"level": 1.0, "waves": []}, sun={"direction": sunlight(zenith, 0.0)},
    )  # fmt: skip
    result = render(wc.Scene(**flat), "photon", device)  # the march over the step is the same for all
    assert_sound(result)
    light = np.cos(np.radians(zenith))
    reach = height * np.tan(np.arcsin(np.sin(np.radians(zenith)) / 1.333)) / PIXEL  # of the shadow, in pixels
    line = result.caustic_map.mean(axis=0, dtype=np.float64)
    # A step is a smooth slope between two samples, four pixels with what its interpolant overshoots on either side.
    far = np.abs(np.arange(64) + 0.5 - 16.0) > 8.0
    if not rises:
        far &= np.arange(64) + 0.5 > 16.0 + reach + 8.0
    np.testing.assert_allclose(line[far], light, rtol=2e-5)
    expected = 64.0 + (reach if rises else -reach)
    assert line.sum() / light == pytest.approx(expected, rel=5e-3)


def test_degenerate_triangles_and_needles_change_nothing(device, tmp_path):
    """Repeated corners, corners on a line, and a floor that is a fan of a thousand slivers."""
    corners = [(-3.0, -3.0, 0.0), (4.0, -3.0, 0.0), (4.0, 4.0, 0.0), (-3.0, 4.0, 0.0), (0.5, 0.5, 0.0)]
    whole = render(wc.Scene(**table(receiver={"mesh": save_mesh(tmp_path, "a", corners, [(0, 1, 2), (0, 2, 3)])})),
                   "photon", device)  # fmt: skip
    flawed = [(0, 0, 1), (2, 2, 2), (0, 4, 2), (0, 1, 2), (0, 2, 3), (3, 3, 0)]
    rim = np.linspace(-3.0, 4.0, 501)
    sliver = [(-3.0, -3.0, 0.0), *((4.0, y, 0.0) for y in rim), *((x, 4.0, 0.0) for x in rim[::-1])]
    fan = [(0, i, i + 1) for i in range(1, len(sliver) - 1)]
    for name, vertices, faces in (("b", corners, flawed), ("c", sliver, fan)):
        result = render(
            wc.Scene(**table(receiver={"mesh": save_mesh(tmp_path, name, vertices, faces)})), "photon", device
        )
        assert_sound(result)
        assert relative_l2(result.caustic_map, whole.caustic_map) < 1e-5


@pytest.mark.parametrize("method", METHODS)
def test_cells_that_collapse_to_a_line_keep_their_light(device, method):
    ior, amplitude, length = 1.333, 0.005, 0.75
    focus = ior / ((ior - 1.0) * amplitude * (2.0 * np.pi / length) ** 2)
    described = sine(focus - amplitude, amplitude, length, light_x=0.0)
    result = render(wc.Scene(**described), method, device)
    assert_sound(result)
    if method == "beam":
        assert relative_l2(result.caustic_map, closed_form(described)) < ERROR["beam"]


@pytest.mark.parametrize("method", METHODS)
def test_cells_that_collapse_to_a_point_keep_their_light(device, method, tmp_path):
    """A quadric of water over its focus: all that it takes in lands in a few pixels."""
    side, samples, radius = 1.0, 96, 2.0
    at = ((np.arange(samples) + 0.5) / samples - 0.5) * side
    z = -(at[None, :] ** 2 + at[:, None] ** 2) / (2.0 * radius)
    lens = table(
        zenith=0.0, resolution=(33, 33),
        water={"level": 1.333 * radius / 0.333, "height_map": save_heights(
            tmp_path, "lens", z, (16.5 * PIXEL - 0.5, 16.5 * PIXEL - 0.5), (side, side))},
    )  # fmt: skip
    result = render(wc.Scene(**lens), method, device)
    assert_sound(result)
    assert result.energy.received == pytest.approx(side * side, rel=1e-5)
    middle = result.caustic_map[12:21, 12:21].sum(dtype=np.float64)
    assert middle > 0.99 * result.caustic_map.sum(dtype=np.float64)
