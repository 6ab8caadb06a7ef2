"""Each step of the projected pattern on single values: box, panning, repeating texture, split, masks, edge fade."""

import numpy as np
import pytest
import warp as wp
from kernel_helpers import points

from oracle import pattern as oracle
from warp_caustics.kernels.pattern import (
    box_mask,
    edge_fade,
    lerp_mask,
    panner,
    sample_repeat,
    sample_split,
    smoothstep_mask,
)

# Float32 between texels of a texture of a dozen of them, whose values are up to 1.
SAMPLED = 2e-5
ROUNDED = 1e-6
TEXTURE = np.random.default_rng(5).random((7, 12))


@wp.kernel(enable_backward=False)
def masks(
    position: wp.array[wp.vec3], luminance: wp.array[float], radius: float, strength: float, out: wp.array2d[float]
):
    i = wp.tid()
    out[i, 0] = box_mask(position[i])
    out[i, 1] = edge_fade(position[i], radius, strength)
    out[i, 2] = lerp_mask(luminance[i], strength)
    out[i, 3] = smoothstep_mask(luminance[i], strength)


@wp.kernel(enable_backward=False)
def samples(
    texture: wp.array2d[float], uv: wp.array[wp.vec2], split: float, one_out: wp.array[float],
    three_out: wp.array[wp.vec3]
):  # fmt: skip
    i = wp.tid()
    one_out[i] = sample_repeat(texture, uv[i])
    three_out[i] = sample_split(texture, uv[i], split)


@wp.kernel(enable_backward=False)
def panned(uv: wp.array[wp.vec2], time: wp.float64, speed: wp.float64, tiling: float, uv_out: wp.array[wp.vec2]):
    i = wp.tid()
    uv_out[i] = panner(uv[i], time, speed, tiling)


def masks_at(position, luminance, radius, strength, device):
    out = wp.zeros((len(position), 4), dtype=float, device=device)
    light = wp.array(np.broadcast_to(luminance, len(position)).astype(np.float32), dtype=float, device=device)
    wp.launch(masks, dim=len(position), inputs=[points(position, device), light, radius, strength, out], device=device)
    return out.numpy().T


def sampled(uv, device, split=0.0, texture=TEXTURE):
    uv = np.asarray(uv, dtype=np.float64)
    one = wp.zeros(len(uv), dtype=float, device=device)
    three = wp.zeros(len(uv), dtype=wp.vec3, device=device)
    values = wp.array(texture.astype(np.float32), dtype=float, device=device)
    wp.launch(samples, dim=len(uv), inputs=[values, points(uv, device), split], outputs=[one, three], device=device)
    return one.numpy(), three.numpy()


def pan(uv, time, speed, tiling, device):
    out = wp.zeros(len(uv), dtype=wp.vec2, device=device)
    wp.launch(panned, dim=len(uv), inputs=[points(uv, device), time, speed, tiling, out], device=device)
    return out.numpy()


def test_the_box_is_open_below_and_closed_above(device):
    """As its two steps are: ``step(p, 0.5)`` takes 0.5 in, ``1 - step(p, -0.5)`` leaves -0.5 out."""
    inside = [(0.5, 0.5, 0.5), (0.0, 0.0, 0.0), (-0.49999, 0.2, 0.5), (0.5, -0.49999, -0.3)]
    outside = [(-0.5, 0.0, 0.0), (0.0, -0.5, 0.0), (0.0, 0.0, -0.5), (0.50001, 0.0, 0.0), (0.0, 0.0, 0.50001)]
    box = masks_at(inside + outside, 0.0, 1.0, 0.0, device)[0]
    assert box.tolist() == [1.0] * len(inside) + [0.0] * len(outside)


def test_the_edge_fades_as_published(device):
    radius, strength = 0.25, 0.5
    # At the middle, at the radius, half-way, at its end, and past it.
    at = [(0.0, 0.0, 0.0), (0.0, 0.25, 0.0), (0.3, 0.4, 0.0), (0.0, 0.0, -0.75), (0.8, 0.8, 0.0)]
    fade = masks_at(at, 0.0, radius, strength, device)[1]
    np.testing.assert_allclose(fade, [1.0, 1.0, 0.5, 0.0, 0.0], atol=ROUNDED)


def test_luminance_masks_as_published(device):
    luminance = np.linspace(0.0, 1.0, 41)
    strength = 0.4
    _, _, lerp, smooth = masks_at(np.zeros((41, 3)), luminance, 1.0, strength, device)
    np.testing.assert_allclose(lerp, 1.0 - strength + strength * luminance, atol=ROUNDED)
    t = np.clip((luminance - strength) / 0.1, 0.0, 1.0)
    np.testing.assert_allclose(smooth, 3.0 * t**2 - 2.0 * t**3, atol=1e-5)  # a tenth of rounding in t is ten times it


def test_the_texture_is_bilinear_and_repeats(device):
    uv = np.random.default_rng(1).uniform(-3.0, 3.0, (400, 2))
    one, three = sampled(uv, device, split=0.07)
    np.testing.assert_allclose(one, oracle.sample(TEXTURE, *uv.T), atol=SAMPLED)
    for colour, offset in enumerate(((0.07, 0.07), (0.07, -0.07), (-0.07, -0.07))):
        np.testing.assert_allclose(three[:, colour], oracle.sample(TEXTURE, *(uv + offset).T), atol=SAMPLED)
    rows, columns = TEXTURE.shape
    centres = np.stack(np.meshgrid((np.arange(columns) + 0.5) / columns, (np.arange(rows) + 0.5) / rows), axis=-1)
    for whole in (0.0, 2.0, -1.0):
        np.testing.assert_allclose(
            sampled(centres.reshape(-1, 2) + whole, device)[0], TEXTURE.ravel(), atol=SAMPLED
        )  # row 0 is at v = 0


@pytest.mark.parametrize("axis", [0, 1])
def test_a_repeated_texture_has_no_seam(device, axis):
    """Across the border of a repeat it changes no faster than between the texels on its two sides."""
    steps = 200
    uv = np.full((steps, 2), 0.37)
    uv[:, axis] = np.linspace(0.9, 1.1, steps)
    jumps = np.abs(np.diff(sampled(uv, device)[0]))
    count = TEXTURE.shape[1 - axis]
    fastest = np.abs(np.diff(TEXTURE, axis=1 - axis, append=np.take(TEXTURE, [0], axis=1 - axis))).max() * count
    assert jumps.max() <= fastest * 0.2 / (steps - 1) + SAMPLED


def test_panning_is_a_shift_of_uv(device):
    uv = np.random.default_rng(2).uniform(-1.0, 1.0, (50, 2))
    time, speed, tiling = 7.5, 0.11, -2.5
    moved = pan(uv, time, speed, tiling, device)
    shifted = pan(uv + np.array([time * speed / tiling, 0.0]), 0.0, speed, tiling, device)
    np.testing.assert_allclose(sampled(moved, device)[0], sampled(shifted, device)[0], atol=SAMPLED)
    np.testing.assert_allclose(moved, tiling * uv + (time * speed % 1.0, 0.0), atol=ROUNDED)


def test_panning_for_a_day_keeps_its_place(device):
    """Whole repeats are taken out in float64: 86400 s at 0.3 repeats a second are 25920 of them."""
    uv = np.zeros((1, 2))
    away = pan(uv, 86400.0, 0.3, 1.0, device)[0, 0]
    assert min(away, 1.0 - away) < ROUNDED
