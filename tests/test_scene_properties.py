"""Small scenes at random: whatever the values, a map is finite and not negative, and its ledger adds up."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scenery import FREE_METHODS, METHODS, render, scene, tables, wave

import warp_caustics as wc
from oracle.cases import sunlight

LEDGER = 1e-5
ROUNDING = 1e-6  # of the largest entry, below which a negative number is a rounding of nothing
CALM, STEEP = 0.12, 0.8  # bounds of the slopes
SAMPLES_A_WAVE = 6.0  # pixels; below that a wave is not there to be seen
LARGEST_PHASE = 1e3

EXAMPLES = settings(
    max_examples=15, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)

share = st.floats(0.0, 1.0)
side = st.integers(8, 16)
angle = st.floats(0.0, 2.0 * np.pi)


@st.composite
def maps(draw):
    """A map of any place and scale, its pixels up to three times as long as wide."""
    resolution = (draw(side), draw(side))
    pixel = 10.0 ** draw(st.floats(-4.0, 2.0)) * np.array([1.0, draw(st.floats(0.33, 3.0))])
    far = draw(st.sampled_from([0.0, 1.0, 1e4]))
    size = pixel * resolution
    origin = far * size * (draw(st.floats(-1.0, 1.0)), draw(st.floats(-1.0, 1.0)))
    return {"resolution": resolution, "size": tuple(size), "origin": tuple(origin)}


@st.composite
def waters(draw, place, steepest):
    """Up to three waves whose slopes add up to ``steepest``, none shorter than the map's pixels can show."""
    pixel = max(np.divide(place["size"], place["resolution"]))
    count = draw(st.integers(0, 3))
    made = []
    for _ in range(count):
        k = 2.0 * np.pi / (pixel * SAMPLES_A_WAVE * 10.0 ** (1.5 * draw(share)))
        heading = draw(angle)
        amplitude = steepest / count / k * draw(st.sampled_from([1.0, -1.0, 0.3]))
        phase = LARGEST_PHASE * (2.0 * draw(share) - 1.0)
        made.append(wave(amplitude, k * np.cos(heading), k * np.sin(heading), phase))
    return made


@st.composite
def shallows(draw, place):
    """A depth from a fifth of the map's width to twice it, and the level to go with it."""
    depth = min(place["size"]) * draw(st.floats(0.2, 2.0))
    return depth, draw(st.sampled_from([0.0, 1.0, -50.0])) * depth


@st.composite
def calm_scenes(draw, medium):
    place = draw(maps())
    depth, floor = draw(shallows(place))
    chosen = {
        "beam": {"samples_per_pixel": draw(st.sampled_from([0.5, 1.0, 3.7]))},
        "photon": {
            "photons_per_pixel": draw(st.sampled_from([0.7, 1.0, 4.0])),
            "footprint": draw(st.sampled_from(["point", "pixel", "cell", 0.2, 5.0])),
        },
        "gather": draw(st.sampled_from([{}, {"n": 1}, {"n": 5}, {"n": 5, "m": 2}])),
    }
    return scene(
        draw(waters(place, CALM)), {"plane": floor}, sunlight(70.0 * draw(share), np.degrees(draw(angle))),
        medium | {"ior": draw(st.floats(1.0, 2.5))}, level=floor + depth, method=chosen, **place,
    )  # fmt: skip


@st.composite
def steep_scenes(draw):
    """A low sun over slopes of 0.8 under which waves shade each other, and their light meets them from below."""
    place = draw(maps())
    depth, floor = draw(shallows(place))
    direction = sunlight(draw(st.floats(70.0, 88.0)), np.degrees(draw(angle)))
    water = draw(waters(place, STEEP).filter(bool))
    return scene(water, {"plane": floor}, direction, level=floor + depth, self_shadow=True, **place)


@st.composite
def beaches(draw):
    """Water, a shore and dry land, each anywhere in the map or beside it."""
    place = draw(maps())
    width = min(place["size"])
    slope = np.array([np.cos(heading := draw(angle)), np.sin(heading)]) * draw(st.floats(0.1, 0.3))
    middle = np.add(place["origin"], np.multiply(place["size"], 0.5))
    base = width * (draw(share) - 0.5) * 0.4 - float(np.dot(slope, middle))
    direction = sunlight(50.0 * draw(share), np.degrees(draw(angle)))
    bed = {"terrain": {"base": base, "slope": tuple(slope)}}
    return scene(draw(waters(place, CALM)), bed, direction, level=0.0, **place)


def check(what, method, device, time):
    """The properties; a refusal is as good as a map if it is an InputError."""
    try:
        result = render(what, method, device, time)
    except wc.InputError as refusal:
        assert str(refusal)
        return
    image, energy = result.caustic_map, result.energy
    assert image.shape[:2] == what.map.resolution[::-1]
    assert np.isfinite(image).all()
    assert image.min() >= -ROUNDING * max(image.max(), 1.0)
    assert energy.unaccounted < LEDGER
    largest = np.max([np.max(energy.emitted), np.max(energy.dry)])
    for name, value in energy.items():
        assert np.isfinite(value).all(), name
        assert np.min(value) >= -ROUNDING * largest, name
    assert np.max(energy.dropped) == 0.0
    # No light is made: what lands in the map came in, or fell on dry land.
    assert np.sum(energy.received) <= np.sum(energy.emitted) * (1.0 + LEDGER)


times = st.floats(-1e6, 1e6)
MEDIA = {
    "clear": {},
    "coloured": {"fresnel": True, "absorption": (0.35, 0.07, 0.01)},
}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("medium", MEDIA)
@EXAMPLES
@given(data=st.data())
def test_calm_water_over_a_plane(device, method, medium, data):
    check(data.draw(calm_scenes(MEDIA[medium])), method, device, data.draw(times))


@pytest.mark.parametrize("method", METHODS)
@EXAMPLES
@given(data=st.data())
def test_steep_water_under_a_low_sun(device, method, data):
    check(data.draw(steep_scenes()), method, device, data.draw(times))


@pytest.mark.parametrize("method", FREE_METHODS)
@EXAMPLES
@given(data=st.data())
def test_beaches(device, method, data):
    check(data.draw(beaches()), method, device, data.draw(times))


@pytest.mark.parametrize("method", METHODS)
@EXAMPLES
@given(data=st.data())
def test_light_adds(device, method, data):
    """Twice the sun is twice the light, and a sun of three colours three lights, each as if it were alone."""
    what = data.draw(calm_scenes({}))
    one = render(what, method, device)
    new = tables(what)
    new["sun"]["irradiance"] = (2.0, 0.0, 1e3)
    three = render(wc.Scene(**new), method, device)
    for channel, irradiance in enumerate(new["sun"]["irradiance"]):
        np.testing.assert_allclose(three.caustic_map[..., channel], irradiance * one.caustic_map, rtol=1e-5, atol=1e-9)
        assert three.energy.received[channel] == pytest.approx(irradiance * one.energy.received, rel=1e-5)
