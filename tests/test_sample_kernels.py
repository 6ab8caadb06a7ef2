"""The kernels of the sampled caustic map, each against Collard & Mundi's pseudo code in NumPy and float64."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from kernel_helpers import points, rounded, wave_surface

from warp_caustics.kernels.box_blur import make_box_blur, mirrored
from warp_caustics.kernels.photon import Scene
from warp_caustics.kernels.sample import Sampling, face_normals, make_heights, make_sample, scale_to_irradiance

FLOAT32 = 2e-6  # a few roundings of values around 1
# Of an intensity: cosines to 1e-7, which the environment map's power of 40 and the 81 samples multiply.
INTENSITY = 5e-5

ROWS, COLUMNS = 10, 14
SETTINGS = {
    "steps": 4, "size": 0.4, "ground_offset": 0.9, "base_intensity": 0.1, "falloff_power": 4.0, "weight_power": 64.0,
    "environment_power": 40.0,
}  # fmt: skip


@wp.kernel(enable_backward=False)
def mirror(count: int, index_out: wp.array[int]):
    i = wp.tid()
    index_out[i] = mirrored(index_out[i], count)


def published_normals(height, size, rows, columns):
    """Face normals, y up as theirs, of the triangle that is seen from above at each texel's middle."""
    vertices = height.shape[0]
    x, z = np.linspace(0.0, size[0], height.shape[1]), np.linspace(0.0, size[1], vertices)
    seen = np.zeros((rows, columns, 3))
    for row in range(rows):
        for column in range(columns):
            at = np.array([(column + 0.5) / columns * (height.shape[1] - 1), (row + 0.5) / rows * (vertices - 1)])
            i, j = at.astype(int)
            corners = (
                [(i, j), (i + 1, j + 1), (i + 1, j)] if at[1] - j <= at[0] - i else [(i, j), (i, j + 1), (i + 1, j + 1)]
            )
            p1, p2, p3 = (np.array([x[i], height[j, i], z[j]]) for i, j in corners)
            normal = np.cross(p2 - p1, p3 - p1)
            seen[row, column] = normal / np.linalg.norm(normal)
    return seen


def texture(image, u, v, wrap):
    """OpenGL's linear filter at texture coordinates, with what ``wrap`` makes of texels beyond the border."""
    rows, columns = image.shape[:2]
    x, y = u * columns - 0.5, v * rows - 0.5
    i, j = int(np.floor(x)), int(np.floor(y))
    total = 0.0
    for dj, di in np.ndindex(2, 2):
        weight = abs(1 - di - (x - i)) * abs(1 - dj - (y - j))
        total = total + weight * image[wrap(j + dj, rows), wrap(i + di, columns)]
    return total


def mirrored_repeat(i, count):
    place = (i + 0.5) % (2 * count)
    return int(min(place, 2 * count - place))


def clamped(i, count):
    return min(max(i, 0), count - 1)


def radial(power):
    def environment(u, v):
        return max(1.0 - 2.0 * np.hypot(u - 0.5, v - 0.5), 0.0) ** power

    return environment


def published_map(normals, settings, environment):
    """Section 3.3, and the direction of the authors' code; y is up."""
    rows, columns = normals.shape[:2]
    size, steps = settings["size"], settings["steps"]
    caustic = np.zeros((rows, columns))
    for row, column in np.ndindex(rows, columns):
        centre = np.array([(column + 0.5) / columns, (row + 0.5) / rows])
        for u in np.linspace(centre[0] - size, centre[0] + size, steps + 1):
            for v in np.linspace(centre[1] - size, centre[1] + size, steps + 1):
                away = np.array([u, v]) - centre
                approximation = np.array([away[0], settings["ground_offset"], away[1]])
                approximation /= np.linalg.norm(approximation)
                normal = texture(normals, u, v, mirrored_repeat)
                normal = normal / np.linalg.norm(normal)
                weight = (approximation @ normal) ** settings["weight_power"]
                refracted = np.array([normal[0], (1.0 - weight) * normal[1], normal[2]])
                refracted /= np.linalg.norm(refracted)
                mapping = max(refracted @ (0.0, 1.0, 0.0) / 2.0, 0.0)
                distance = (1.0 - np.hypot(*away)) ** settings["falloff_power"]
                caustic[row, column] += environment(mapping, mapping) * settings["base_intensity"] * distance
    return np.clip(caustic, 0.0, 1.0)


def some_normals(spread, seed=3):
    rng = np.random.default_rng(seed)
    normals = np.stack([*rng.uniform(-spread, spread, (2, ROWS, COLUMNS)), np.ones((ROWS, COLUMNS))], axis=-1)
    return rounded(normals / np.linalg.norm(normals, axis=-1, keepdims=True))


def sampled(normals, device, environment=None, first_row=0, **changed):
    sampling = Sampling()
    for name, value in {**SETTINGS, **changed}.items():
        setattr(sampling, name, value)
    image = wp.zeros((0, 0), dtype=float, device=device)
    if environment is not None:
        image = wp.array(environment.astype(np.float32), device=device)
    caustic = wp.zeros(normals.shape[:2], dtype=float, device=device)
    inputs = [first_row, points(normals, device), image, sampling]
    dim = (normals.shape[0] - first_row, normals.shape[1])
    wp.launch(make_sample(environment is not None), dim, inputs, [caustic], device=device)
    return caustic.numpy()


def y_up(normals):
    return normals[..., [0, 2, 1]]


def test_mirrored_repeat(device):
    for count in (1, 2, 5):
        expected = np.pad(np.arange(count), 3 * count, mode="symmetric")
        index = wp.array(np.arange(-3 * count, 4 * count), dtype=int, device=device)
        wp.launch(mirror, len(index), [count], [index], device=device)
        assert np.array_equal(index.numpy(), expected)


def test_vertices_stand_at_the_waters_height(device):
    scene = Scene()
    scene.water.surface = wave_surface([(0.1, (2.0, -1.0), 0.4), (0.05, (-3.0, 5.0), 2.0)], device)
    height = wp.zeros((9, 9), dtype=float, device=device)
    wp.launch(make_heights("waves"), (9, 9), [0, scene, wp.vec2(0.25, 0.125)], [height], device=device)
    y, x = np.mgrid[:9, :9] * np.array([0.125, 0.25])[:, None, None]
    expected = 0.1 * np.sin(2.0 * x - y + 0.4) + 0.05 * np.sin(-3.0 * x + 5.0 * y + 2.0)
    np.testing.assert_allclose(height.numpy(), expected, atol=FLOAT32)


def test_normals_of_the_faces(device):
    # No texel's middle lies on the edge of a triangle, where rounding would choose.
    height = rounded(np.random.default_rng(4).uniform(-0.1, 0.1, (8, 8)))
    size = (2.0, 1.0)
    normals = wp.zeros((ROWS, COLUMNS + 3), dtype=wp.vec3, device=device)
    cell = wp.vec2(size[0] / 7, size[1] / 7)
    wp.launch(
        face_normals, normals.shape, [0, wp.array(height, dtype=float, device=device), cell], [normals], device=device
    )
    np.testing.assert_allclose(
        y_up(normals.numpy()), published_normals(height, size, ROWS, COLUMNS + 3), atol=10 * FLOAT32
    )


@pytest.mark.parametrize("changed", [{}, {"steps": 7, "size": 0.5}, {"weight_power": 3.0, "falloff_power": 0.5}])
def test_samples(device, changed):
    normals = some_normals(0.3)
    expected = published_map(y_up(normals), {**SETTINGS, **changed}, radial(SETTINGS["environment_power"]))
    assert 0.05 < expected.mean() < 0.95
    np.testing.assert_allclose(sampled(normals, device, **changed), expected, atol=INTENSITY)


@pytest.mark.parametrize("weight_power", [64.0, 0.05])  # most samples look up; most look down to the image's edge
def test_samples_through_an_image(device, weight_power):
    normals = some_normals(0.8)
    # Not square and not symmetric, so that rows and columns cannot be taken for each other.
    environment = rounded(np.random.default_rng(5).uniform(0.0, 1.0, (5, 9)))
    changed = {**SETTINGS, "weight_power": weight_power}
    expected = published_map(y_up(normals), changed, lambda u, v: texture(environment, u, v, clamped))
    np.testing.assert_allclose(sampled(normals, device, environment, **changed), expected, atol=INTENSITY)


def test_the_sum_is_limited_to_one(device):
    normals = some_normals(0.3)
    free, bright = sampled(normals, device), sampled(normals, device, base_intensity=0.5)
    assert 0.0 < (bright == 1.0).mean() < 1.0
    np.testing.assert_allclose(bright, np.minimum(5.0 * free, 1.0), atol=5 * INTENSITY)


def test_a_band_is_its_rows_of_the_whole(device):
    normals = some_normals(0.3)
    band = sampled(normals, device, first_row=6)
    assert np.array_equal(band[6:], sampled(normals, device)[6:])
    assert not band[:6].any()


def test_flat_water_is_uniform(device):
    normals = np.zeros((ROWS, COLUMNS, 3))
    normals[..., 2] = 1.0
    offsets = np.linspace(-SETTINGS["size"], SETTINGS["size"], SETTINGS["steps"] + 1)
    distance = np.hypot(*np.meshgrid(offsets, offsets))
    # All samples see the middle of the environment map but the one straight above, whose upright part is weighted away.
    expected = SETTINGS["base_intensity"] * ((1.0 - distance) ** 4)[distance > 0.0].sum()
    np.testing.assert_allclose(sampled(normals, device), expected, atol=INTENSITY)


@pytest.mark.parametrize("axis", [0, 1])
def test_mirrored_normals_give_the_mirrored_map(device, axis):
    normals = some_normals(0.3)
    turned = np.flip(normals, axis).copy()
    turned[..., 1 - axis] *= -1.0
    np.testing.assert_allclose(sampled(turned, device), np.flip(sampled(normals, device), axis), atol=INTENSITY)


@pytest.mark.parametrize("radius", [1, 3, 25])
def test_box_blur(device, radius):
    image = rounded(np.random.default_rng(6).uniform(size=(ROWS, COLUMNS)))
    padded = np.pad(image, radius, mode="symmetric")
    window = 2 * radius + 1
    expected = np.lib.stride_tricks.sliding_window_view(padded, (window, window)).mean(axis=(2, 3))
    buffers = [wp.array(image, dtype=float, device=device), wp.zeros(image.shape, dtype=float, device=device)]
    wp.launch(make_box_blur(0, 1), image.shape, [0, buffers[0], radius], [buffers[1]], device=device)
    wp.launch(make_box_blur(1, 0), image.shape, [0, buffers[1], radius], [buffers[0]], device=device)
    blurred = buffers[0].numpy()
    np.testing.assert_allclose(blurred, expected, atol=FLOAT32)
    assert blurred.mean(dtype=np.float64) == pytest.approx(image.mean(), abs=FLOAT32)
    assert blurred.std() < image.std()


@pytest.mark.parametrize("colours", [1, 3])
def test_irradiance_by_colour(device, colours):
    intensity = rounded(np.random.default_rng(7).uniform(size=(ROWS, COLUMNS)))
    made = wp.zeros(ROWS * COLUMNS * colours, dtype=float, device=device)
    inputs = [0, wp.array(intensity, dtype=float, device=device), wp.vec3(2.0, 3.0, 5.0), colours]
    wp.launch(scale_to_irradiance, (ROWS, COLUMNS), inputs, [made], device=device)
    expected = intensity[..., None] * np.array([2.0, 3.0, 5.0])[:colours]
    np.testing.assert_allclose(made.numpy().reshape(expected.shape), expected, rtol=FLOAT32)
