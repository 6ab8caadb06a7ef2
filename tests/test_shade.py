"""The functions that shade a picture, each against its closed form."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from kernel_helpers import points, rounded

from warp_caustics.kernels.shade import Appearance, beer, folded, margin, read_map, reflectance, sky_radiance
from warp_caustics.tone import decode_srgb, expose

ROUNDING = 2e-6
"""A dozen operations in float32."""
NEAR_GRAZING = 2e-4
"""Where a square root of nearly nothing keeps half of its digits."""
IOR = 1.333


@wp.kernel(enable_backward=False)
def mirrors(directions: wp.array[wp.vec3], eta: float, out: wp.array[float]):
    i = wp.tid()
    out[i] = reflectance(directions[i], wp.vec3(0.0, 0.0, 1.0), eta)


@wp.kernel(enable_backward=False)
def ways(attenuation: wp.vec3, lengths: wp.array[float], out: wp.array[wp.vec3]):
    i = wp.tid()
    out[i] = beer(attenuation, lengths[i])


@wp.kernel(enable_backward=False)
def skies(look: Appearance, directions: wp.array[wp.vec3], out: wp.array[wp.vec3]):
    i = wp.tid()
    out[i] = sky_radiance(look, directions[i])


@wp.kernel(enable_backward=False)
def reads(image: wp.array2d[wp.vec3], places: wp.array[wp.vec2], size: wp.vec2, out: wp.array[wp.vec3]):
    i = wp.tid()
    out[i] = read_map(image, places[i], size)


@wp.kernel(enable_backward=False)
def margins(places: wp.array[wp.vec2], low: wp.vec2, size: wp.vec2, out: wp.array[float]):
    i = wp.tid()
    out[i] = margin(places[i], low, size)


@wp.kernel(enable_backward=False)
def folds(places: wp.array[wp.vec2], size: wp.vec2, out: wp.array[wp.vec2]):
    i = wp.tid()
    out[i] = folded(places[i], size)


def run(kernel, count, inputs, dtype, device):
    out = wp.zeros(count, dtype=dtype, device=device)
    wp.launch(kernel, dim=count, inputs=[*inputs, out], device=device)
    return out.numpy()


def downward(angles):
    """Directions at angles from straight down [degrees]."""
    angles = np.radians(angles)
    return np.stack([np.sin(angles), 0.0 * angles, -np.cos(angles)], axis=-1)


@pytest.mark.parametrize("eta", [1.0 / IOR, IOR])
def test_fresnel_at_normal_incidence(device, eta):
    mirror = run(mirrors, 1, [points(downward([0.0]), device), eta], float, device)
    np.testing.assert_allclose(mirror, ((IOR - 1.0) / (IOR + 1.0)) ** 2, rtol=1e-5)


def test_fresnel_at_any_angle(device):
    """By the sines and tangents of the angles, where the kernel has their cosines."""
    angles = np.linspace(1.0, 89.0, 50)
    mirror = run(mirrors, 50, [points(downward(angles), device), 1.0 / IOR], float, device)
    t1 = np.radians(angles)
    t2 = np.arcsin(np.sin(t1) / IOR)
    s = (np.sin(t1 - t2) / np.sin(t1 + t2)) ** 2
    p = (np.tan(t1 - t2) / np.tan(t1 + t2)) ** 2
    np.testing.assert_allclose(mirror, (s + p) / 2.0, atol=ROUNDING)


def test_the_edge_of_snells_window(device):
    """From within the water, nothing leaves past arcsin(1 / n), 48.6 degrees."""
    edge = np.degrees(np.arcsin(1.0 / IOR))
    assert edge == pytest.approx(48.6, abs=0.05)
    angles = np.array([edge - 1.0, edge - 1e-3, edge + 1e-3, 89.0])
    mirror = run(mirrors, 4, [points(downward(angles), device), IOR], float, device)
    assert mirror[0] < mirror[1] < 1.0
    np.testing.assert_array_equal(mirror[2:], 1.0)


def test_what_a_way_leaves(device):
    attenuation, lengths = rounded([0.34, 0.0565, 0.0]), rounded([0.0, 0.5, 2.0, 30.0])
    left = run(ways, 4, [wp.vec3(*attenuation), wp.array(lengths, dtype=float, device=device)], wp.vec3, device)
    np.testing.assert_allclose(left, np.exp(-lengths[:, None] * attenuation), rtol=1e-5)
    np.testing.assert_allclose(left[3], left[1] ** 60, rtol=1e-4)


def test_the_sky(device):
    """The horizon's colour along and below it, the zenith's above, the sun where its light comes from."""
    look = Appearance()
    look.sun, look.sun_cosine = wp.vec3(0.0, -0.6, -0.8), float(np.cos(np.radians(1.0)))
    look.zenith, look.horizon, look.sun_radiance = wp.vec3(1.0, 2.0, 3.0), wp.vec3(5.0, 4.0, 3.5), wp.vec3(100.0)
    beside = np.radians(1.1)
    turned = [0.0, 0.6 * np.cos(beside) + 0.8 * np.sin(beside), 0.8 * np.cos(beside) - 0.6 * np.sin(beside)]
    directions = [[1, 0, 0], [0.8, 0, -0.6], [0, 0, 1], [0.6, 0.0, 0.25], [0, 0.6, 0.8], turned]
    seen = run(skies, 6, [look, points(directions, device)], wp.vec3, device)
    zenith, horizon = np.array([1.0, 2.0, 3.0]), np.array([5.0, 4.0, 3.5])
    np.testing.assert_allclose(seen[:2], [horizon, horizon])
    np.testing.assert_allclose(seen[2], zenith, rtol=ROUNDING)
    np.testing.assert_allclose(seen[3], (zenith + horizon) / 2.0, rtol=ROUNDING)
    np.testing.assert_allclose(seen[4] - horizon - np.sqrt(0.8) * (zenith - horizon), 100.0, rtol=1e-5)
    np.testing.assert_allclose(seen[5], horizon + np.sqrt(turned[2]) * (zenith - horizon), rtol=1e-5)


def test_a_map_is_read_between_its_pixels(device):
    image = np.random.default_rng(1).random((3, 4, 3)).astype(np.float32)
    # Pixels of 0.5 m x 2 m: a centre, the middle of four, a corner, and a place beside.
    places = np.array([[0.75, 3.0], [1.0, 4.0], [0.0, 0.0], [9.0, 3.0]])
    seen = run(reads, 4, [points(image, device), points(places, device), wp.vec2(2.0, 6.0)], wp.vec3, device)
    expected = [image[1, 1], image[1:3, 1:3].mean(axis=(0, 1)), image[0, 0], image[1, 3]]
    np.testing.assert_allclose(seen, expected, rtol=ROUNDING)
    one = run(reads, 4, [points(image[:1, :1], device), points(places, device), wp.vec2(2.0, 6.0)], wp.vec3, device)
    np.testing.assert_allclose(one, np.broadcast_to(image[0, 0], (4, 3)))


def test_how_far_inside_a_rectangle(device):
    places = points([[1.5, 2.5], [3.8, 3.0], [2.0, 0.5], [5.0, 9.0]], device)
    inside = run(margins, 4, [places, wp.vec2(1.0, 1.0), wp.vec2(3.0, 4.0)], float, device)
    np.testing.assert_allclose(inside, [0.5, 0.2, -0.5, -4.0], rtol=1e-5)


def test_a_map_goes_on_as_its_mirror_image(device):
    """Inside it is itself; past a side the same place comes again at the same distance from it."""
    places = points([[0.5, 1.0], [-0.5, 1.0], [3.5, 4.5], [6.5, -9.0], [-4.5, 7.0]], device)
    inside = run(folds, 5, [places, wp.vec2(2.0, 4.0)], wp.vec2, device)
    np.testing.assert_allclose(inside, [[0.5, 1.0], [0.5, 1.0], [0.5, 3.5], [1.5, 1.0], [0.5, 1.0]], rtol=1e-6)


def test_exposure():
    """White is white, black black, a stop brightens, and what is no number stands out."""
    radiance = np.zeros((1, 5, 3), np.float32)
    radiance[0, 1:4] = np.array([0.1, 0.3, 1e9])[:, None]
    radiance[0, 4] = np.nan
    shown = expose(radiance, 1.0)
    assert not shown[0, 0].any() and (shown[0, 3] == 255).all()
    assert 0 < shown[0, 1, 0] < shown[0, 2, 0] < 255
    assert tuple(shown[0, 4]) == (255, 0, 160)
    np.testing.assert_array_equal(expose(2.0 * radiance, 1.0), expose(radiance, 1.0, stops=1.0))
    np.testing.assert_array_equal(expose(2.0 * radiance, 2.0), shown)


def test_srgb_is_decoded_as_it_is_defined():
    np.testing.assert_allclose(decode_srgb(np.array([0.0, 0.04, 0.5, 1.0])), [0.0, 0.04 / 12.92, 0.21404114, 1.0])
