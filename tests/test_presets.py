"""Presets of water: what the paper prints, what it leaves open, and their light by every method."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from kernel_helpers import points, wave_array
from scenery import FREE_METHODS, IOR, METHODS, assert_adds_up, relative_l2, render, scene

import warp_caustics as wc
from warp_caustics.assets import load_assets
from warp_caustics.kernels.reference.surface import HeightField, Sine, rings_at
from warp_caustics.kernels.surface import Surface, radial_at, radial_curved_at
from warp_caustics.kernels.waves import vec6
from warp_caustics.reference import make_reference
from warp_caustics.scene.preset import GREATER_SLOPE, GREATER_WAVES, RING_FREQUENCY, RING_SLOPE, RIPPLE_FREQUENCY
from warp_caustics.water import amplitude_bound, extreme_slopes, phases, water_heights

wp.set_module_options({"enable_backward": False})

# float32 sines of angles up to 10 rad, and their second derivatives.
FLOAT32 = 2e-6
# Beam at the middle of pixels against the mean of a pixel, of rings that no caustic has formed from.
RINGS = 2e-3
# Map of the default beam against the converged one, where rings have focused.
BEAM = 5e-3

SQUARE = {"size": (2.0, 2.0), "resolution": (48, 48), "origin": (3.0, -1.0)}
UNIT, MIDDLE = 2.0 / 4.0, (4.0, 0.0)


@wp.kernel
def rings(
    surface: Surface, field: HeightField, at: wp.array[wp.vec2],
    flat: wp.array[wp.vec3], curved: wp.array[vec6], fine: wp.array[wp.vec3d],
):  # fmt: skip
    i = wp.tid()
    flat[i] = radial_at(surface, at[i][0], at[i][1])
    curved[i] = radial_curved_at(surface, at[i][0], at[i][1])
    fine[i] = rings_at(field, wp.float64(at[i][0]), wp.float64(at[i][1]))


def heights(preset: str, x: np.ndarray, y: np.ndarray, time: float = 0.0) -> np.ndarray:
    what = scene(preset=preset, **SQUARE)
    return water_heights(what, load_assets(what), x, y, time) - what.water.level


def across() -> tuple[np.ndarray, np.ndarray]:
    return np.meshgrid(np.linspace(2.5, 5.5, 31), np.linspace(-1.4, 1.3, 23))


# --- what is printed ------------------------------------------------------------------------------------------------


def test_ripples_are_the_printed_function_along_both_axes():
    x, y = across()
    u, v = (RIPPLE_FREQUENCY * (at - middle) / UNIT for at, middle in zip((x, y), MIDDLE, strict=True))
    printed = sum((np.sin(2.0 * along) + np.sin(np.pi * along)) / 2.0 for along in (u, v))
    found = heights("ripples", x, y)
    np.testing.assert_allclose(found, found.max() / printed.max() * printed, atol=1e-12)
    assert found.max() > 0.005
    greater = heights("waves", x, y) - found
    expected = sum(
        GREATER_SLOPE / np.hypot(*k) * UNIT * np.sin((k[0] * (x - MIDDLE[0]) + k[1] * (y - MIDDLE[1])) / UNIT)
        for k in GREATER_WAVES
    )
    np.testing.assert_allclose(greater, expected, atol=1e-12)


@pytest.mark.parametrize("time", [0.0, 1.3])
def test_rings_are_the_printed_function(time):
    """A sin(-pi d f + t), d in units of a quarter of the map."""
    x, y = across()
    d = np.hypot(x - MIDDLE[0], y - MIDDLE[1]) / UNIT
    amplitude = RING_SLOPE / (np.pi * RING_FREQUENCY) * UNIT
    expected = amplitude * np.sin(-np.pi * d * RING_FREQUENCY + time)
    np.testing.assert_allclose(heights("radial", x, y, time), expected, atol=1e-12)
    what = scene(preset="radial", **SQUARE)
    assert amplitude_bound(what, load_assets(what)) == pytest.approx(amplitude)
    slopes = np.linalg.norm(extreme_slopes(what, load_assets(what)), axis=1)
    assert slopes.max() == pytest.approx(RING_SLOPE, rel=2e-3)  # a polygon around the disk
    np.testing.assert_allclose(phases(what, 2.0 * np.pi, 1.0), phases(what, 0.0, 1.0), atol=1e-12)


@pytest.mark.parametrize("preset", ["ripples", "waves", "radial"])
def test_a_preset_lies_over_its_map_wherever_and_however_large(preset):
    x, y = across()
    far = scene(preset=preset, origin=(103.0, 49.0), size=(6.0, 6.0))
    larger = water_heights(far, load_assets(far), 106.0 + 3.0 * (x - 4.0), 52.0 + 3.0 * y, 0.0) - 1.0
    np.testing.assert_allclose(larger, 3.0 * heights(preset, x, y), atol=1e-10)


# --- kernels --------------------------------------------------------------------------------------------------------


def test_rings_on_a_device(device):
    """Height, slope and curvature against closed forms and difference quotients; nothing at the tip."""
    amplitude, k, phase, middle = 0.05, 5.0, 0.7, np.array([0.5, -0.25])
    at = np.random.default_rng(1).uniform(-1.0, 1.0, (60, 2)).astype(np.float32).astype(np.float64)
    at = np.concatenate([at, middle[None]])
    surface, field = Surface(), HeightField()
    surface.waves, surface.middle = wave_array([(amplitude, (k, 0.0), phase)], device), wp.vec2(*middle)
    sine = np.array([(amplitude, (k, 0.0), phase)], dtype=Sine.numpy_dtype())
    field.sines, field.middle = wp.array(sine, dtype=Sine, device=device), wp.vec2d(*middle)
    flat, curved, fine = (wp.zeros(len(at), dtype=t, device=device) for t in (wp.vec3, vec6, wp.vec3d))
    wp.launch(rings, len(at), inputs=[surface, field, points(at, device), flat, curved, fine], device=device)

    def exact(p: np.ndarray) -> np.ndarray:
        away = p - middle
        d = np.linalg.norm(away, axis=-1, keepdims=True)
        slope = amplitude * k * np.cos(k * d + phase) * away / np.maximum(d, 1e-300)
        return np.concatenate([amplitude * np.sin(k * d + phase), slope], axis=-1)

    np.testing.assert_allclose(fine.numpy()[:-1], exact(at[:-1]), atol=1e-15)
    np.testing.assert_allclose(flat.numpy()[:-1], exact(at[:-1]), atol=FLOAT32)
    np.testing.assert_allclose(curved.numpy()[:, :3], flat.numpy(), atol=FLOAT32)
    h = 1e-5
    along, up = ((exact(at[:-1] + step) - exact(at[:-1] - step))[:, 1:] / (2.0 * h) for step in ((h, 0.0), (0.0, h)))
    expected = np.stack([along[:, 0], along[:, 1], up[:, 1]], axis=-1)
    np.testing.assert_allclose(curved.numpy()[:-1, 3:], expected, atol=1e-4 * np.abs(expected).max())
    for found in (flat.numpy()[-1], fine.numpy()[-1]):
        np.testing.assert_allclose(found, [amplitude * np.sin(phase), 0.0, 0.0], atol=1e-6)
    assert np.isfinite(curved.numpy()).all()


# --- light ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("preset", ["ripples", "waves"])
@pytest.mark.parametrize("method", METHODS)
def test_sums_of_sines_light_as_their_waves_do(device, method, preset):
    named = scene(preset=preset, **SQUARE)
    written = scene([one.model_dump(exclude_none=True) for one in named.waves], **SQUARE)
    maps = [render(what, method, device, 0.3).caustic_map for what in (named, written)]
    assert maps[0].std() > 0.05
    assert maps[0].tobytes() == maps[1].tobytes()
    assert wc.make_plan(named, method, "cpu").facts.spec == wc.make_plan(written, method, "cpu").facts.spec


def irradiance_of_rings(level: float, time: float) -> np.ndarray:
    """Mean over each pixel under a sun at the zenith, where rays do not cross: d dd / (R dR), on a fine grid."""
    k = np.pi * RING_FREQUENCY / UNIT
    d = np.linspace(1e-6, 2.5, 400001)
    slope = -RING_SLOPE * np.cos(-k * d + time)
    height = level + RING_SLOPE / k * np.sin(-k * d + time)
    # Snell by angles: under rising water the ray turns outwards, towards the crest.
    tilt = np.arctan(slope)
    landing = d + height * np.tan(tilt - np.arcsin(np.sin(tilt) / IOR))
    assert (np.diff(landing) > 0.0).all()
    density = d[1:-1] * (d[2:] - d[:-2]) / (landing[1:-1] * (landing[2:] - landing[:-2]))
    fine = (np.arange(48 * 8) + 0.5) / (48 * 8) * 2.0 - 1.0
    r = np.hypot(fine[:, None], fine[None, :])
    return np.interp(r, landing[1:-1], density).reshape(48, 8, 48, 8).mean(axis=(1, 3))


def test_rings_light_as_their_closed_form(device):
    """Away from the middle, where the tip of a cone spreads its light over a disk or gathers it in a point."""
    what = scene(preset="radial", direction=(0.0, 0.0, -1.0), level=0.15, **SQUARE)
    found = render(what, "beam", device, 1.0).caustic_map
    expected = irradiance_of_rings(0.15, 1.0)
    middle = np.hypot(*np.meshgrid(*2 * [(np.arange(48) + 0.5) / 24.0 - 1.0])) < 0.15
    assert np.ptp(expected[~middle]) > 0.3
    assert relative_l2(found[~middle], expected[~middle]) < RINGS
    for mirrored in (found.T, found[:, ::-1]):
        assert relative_l2(mirrored, found) < RINGS  # the lattice of cells is not mirrored


@pytest.mark.parametrize("method", METHODS)
def test_rings_add_up_by_every_method(device, method):
    result = render(scene(preset="radial", **SQUARE), method, device, 0.5)
    assert_adds_up(result)
    assert not result.warnings
    assert result.caustic_map.std() > 0.3
    assert not {"column_waves", "row_waves", "water_nodes"} & {buffer.name for buffer in result.plan.buffers}


def test_the_reference_takes_rings(device):
    what = scene(preset="radial", level=0.5, method={"beam": {"samples_per_pixel": 4.0}}, **SQUARE)
    made, drawn = (
        make_reference(what, 0.5, tolerance=1e-3, device=device, cache=False),
        render(what, "beam", device, 0.5),
    )
    assert relative_l2(drawn.caustic_map, made.caustic_map) < BEAM
    assert drawn.energy.received == pytest.approx(made.energy.received, rel=1e-4)


@pytest.mark.parametrize("method", FREE_METHODS)
def test_rings_among_hills_and_shadows(device, method):
    """Every part that looks at the water's shape: shadows of crests, a shore, torn cells."""
    hills = {"terrain": {"base": 0.4, "slope": (0.3, 0.0), "waves": [{"amplitude": 0.1, "wavevector": (9.0, 0.0)}]}}
    low = (0.95, 0.0, -0.25)
    result = render(scene((), hills, low, preset="radial", size=(2.0, 2.0), resolution=(24, 24)), method, device)
    spec = result.plan.facts.spec
    assert spec.self_shadow
    assert spec.shore
    assert spec.tears
    assert np.isfinite(result.caustic_map).all()
    assert result.energy.unaccounted < 1e-6
    assert np.max(result.energy.blocked) > 0.0


def test_a_scene_of_waves_has_nothing_of_rings():
    plan = wc.make_plan(scene(preset="ripples"), "beam", "cpu")
    assert plan.facts.spec.water == "waves"
    (reason,) = (one for one in plan.facts.reasons if one.what == "surface by height map")
    assert (reason.kept, reason.why) == (False, "water is a sum of waves")
    (reason,) = (
        one for one in wc.make_plan(scene(preset="radial"), "beam", "cpu").facts.reasons
        if one.what == "surface by height map"
    )  # fmt: skip
    assert (reason.kept, reason.why) == (False, "water is rings around a point")
