"""Collard & Mundi's shading of ground and water against their pseudo code in float64."""

from __future__ import annotations

import numpy as np
import warp as wp
from kernel_helpers import points, rounded

from warp_caustics.kernels.collard_mundi import shade_ground, shade_water

FLOAT32 = 2e-6  # a few roundings of values around 1
HIGHLIGHT = 1e-4  # a 256th power multiplies the relative rounding of its base by 256
WATER = np.array([0.0, 112.5 / 255.0, 1.0])


@wp.kernel(enable_backward=False)
def shade_grounds(albedo: wp.array[wp.vec3], light: wp.array[wp.vec2], colour_out: wp.array[wp.vec3]):
    i = wp.tid()
    colour_out[i] = shade_ground(albedo[i], light[i][0], light[i][1])


@wp.kernel(enable_backward=False)
def shade_waters(
    normal: wp.array[wp.vec3],
    to_light: wp.array[wp.vec3],
    to_eye: wp.array[wp.vec3],
    light: wp.array[wp.vec3],
    colour_out: wp.array[wp.vec4],
):
    i = wp.tid()
    colour_out[i] = shade_water(normal[i], to_light[i], to_eye[i], light[i])


def published_ground(ground, caustic, offset):
    attenuation = 2.0 / (0.1 * offset**2 + 0.1 * offset + 1.0)
    colour = ground + ground * caustic[:, None]
    colour = colour * np.minimum(attenuation, 1.0)[:, None]
    return colour + WATER * 0.25


def published_water(normal, to_light, to_eye, light):
    cosine = np.einsum("ij,ij->i", normal, to_light)
    n_dot_l = np.maximum(cosine, 0.0)
    green = np.clip(2.0 * n_dot_l - n_dot_l**2, 0.0, 1.0)
    diffuse = np.stack([n_dot_l, green, n_dot_l], axis=-1) * light
    mirrored = 2.0 * cosine[:, None] * normal - to_light
    specular = (np.maximum(np.einsum("ij,ij->i", to_eye, mirrored), 0.0) ** 256)[:, None] * light
    bright = specular.mean(axis=1) > 0.3
    specular[bright] = 1.0
    colour = (0.1 * light + diffuse) * WATER + specular
    return np.column_stack([colour, np.clip(n_dot_l + specular[:, 0], 0.0, 1.0)]), bright


def units(rng, count):
    vectors = rng.normal(size=(count, 3))
    return rounded(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def test_ground(device):
    rng = np.random.default_rng(1)
    albedo = rounded(rng.uniform(size=(200, 3)))
    # Down to 5 m, theirs at most: the attenuation passes 1 at 2.7 m, so that both sides of the limit are met.
    light = rounded(np.column_stack([rng.uniform(0.0, 1.0, 200), rng.uniform(0.0, 5.0, 200)]))
    colour = wp.zeros(len(albedo), dtype=wp.vec3, device=device)
    wp.launch(shade_grounds, len(albedo), [points(albedo, device), points(light, device)], [colour], device=device)
    np.testing.assert_allclose(colour.numpy(), published_ground(albedo, light[:, 0], light[:, 1]), atol=FLOAT32)


def test_water(device):
    rng = np.random.default_rng(2)
    normal, to_light = units(rng, 400), units(rng, 400)
    mirrored = 2.0 * np.einsum("ij,ij->i", normal, to_light)[:, None] * normal - to_light
    # Half of the eyes near the mirrored ray, where the highlight is.
    to_eye = mirrored + 0.1 * rng.normal(size=mirrored.shape) * rng.integers(0, 2, size=(400, 1))
    to_eye[::4] = units(rng, 100)
    to_eye = rounded(to_eye / np.linalg.norm(to_eye, axis=1, keepdims=True))
    light = rounded(rng.uniform(0.5, 1.0, size=(400, 3)))
    expected, bright = published_water(normal, to_light, to_eye, light)
    assert 50 < bright.sum() < 350
    colour = wp.zeros(400, dtype=wp.vec4, device=device)
    inputs = [points(values, device) for values in (normal, to_light, to_eye, light)]
    wp.launch(shade_waters, 400, inputs, [colour], device=device)
    np.testing.assert_allclose(colour.numpy(), expected, atol=HIGHLIGHT)
