"""The method ``cascaded``: light views, landings, irradiance, energy, a moving camera, and all of its settings."""

from __future__ import annotations

import functools

import numpy as np
import pytest
import warp as wp
from flight import Flight, flight_scene, fly
from scenery import GENTLE, LOSSES, bundled, scene, sum_of_waves, tables, wave

import warp_caustics as wc
from oracle.cases import sunlight
from warp_caustics.kernels.cascade_photon import CascadeSpec, make_follow, slope_of
from warp_caustics.kernels.light_g_buffer import make_texel_position
from warp_caustics.kernels.packing import UNPACK
from warp_caustics.kernels.photon import LANDED, SunSample
from warp_caustics.kernels.photon import Scene as DeviceScene
from warp_caustics.kernels.views import View
from warp_caustics.scene import Camera

EYE = {"position": (1.0, -1.2, 2.4), "target": (1.0, 0.6, 0.0), "vertical_fov": 40.0, "resolution": (48, 30)}
TEXELS = 96

# Chords of two texels over the shortest wave: h^2 a k^2 / 8, with the texel's 4 cm and a k^2 of 0.7.
CHORD = 6e-4
# Corners' normals between which a texel's is interpolated: h^2 a k^3 / 8 for the same.
NORMAL = 8e-3
FLOAT_ROUNDING = 2e-6  # of a way of metres
OVERSHOOT, OVERSHOOT_BAND = 0.17, 0.01  # of Eq. 3.3 at 45 degrees
MEAN = 0.01  # of a picture of even light
NOISE = 0.02  # of its pixels: what footprints of a texel leave of ripple, and pixels of one size each
SUMS = 1e-5  # float32 sums of some ten thousand photons
MOVED, MOVED_NOISE = 0.01, 0.15
"""A view that was fitted to another place has coarser texels: 1 % of the mean, and the noise of photons."""

LEDGER = 1e-6
LIKE_BEAM = 0.2  # relative L2 to what beam sees: texels of 3 cm and pixels of 5 blur what beam resolves
GREEN = 0.02  # of a picture whose light views have slightly larger texels
ACROSS_BORDER = 0.01  # of a floor patch's mean brightness


def looking(waves=(), direction=(0.3, 0.2, -1.0), eye=EYE, medium=None, receiver=None, **settings):
    method = {"name": "cascaded", "cascaded": {"resolution": TEXELS, "count": 2, **settings}}
    return scene(
        waves, receiver, direction, medium, camera=eye, method=method, size=(2.0, 2.0), resolution=(64, 64)
    )  # fmt: skip


def rendered(what, device):
    renderer = wc.Renderer(what, "cascaded", device, 1)
    renderer.render(0.0)
    return renderer, renderer._recording.arrays


@functools.cache
def landing_kernel(spec):
    follow, position_at, unpack = make_follow(spec), make_texel_position(spec.positions), UNPACK[spec.normals]

    @wp.kernel(module="unique", enable_backward=False)
    def land_texels(
        scene: DeviceScene, suns: wp.array[SunSample], view: wp.array[View], position: wp.array2d[float],
        normal: wp.array2d[wp.vec3], landing_out: wp.array2d[wp.vec3], distance_out: wp.array2d[float],
    ):  # fmt: skip
        row, column = wp.tid()
        origin = position_at(view[0], position, column, row)
        result = follow(scene, suns[0].direction, origin, slope_of(unpack(normal[row, column])), origin)
        landing_out[row, column] = wp.vec3(wp.inf, wp.inf, wp.inf)
        if result.state == LANDED:
            landing_out[row, column] = origin + result.distance * result.direction
        distance_out[row, column] = result.distance

    return land_texels


def landings(renderer, arrays, device, backlund):
    spec = CascadeSpec(wc_spec(renderer, backlund))
    landing = wp.empty((TEXELS, TEXELS), dtype=wp.vec3, device=device)
    distance = wp.empty((TEXELS, TEXELS), dtype=float, device=device)
    (state,) = renderer._states
    wp.launch(landing_kernel(spec), dim=(TEXELS, TEXELS), inputs=[
        state.scene, state.suns, arrays["cascade1.view"], arrays["cascade1.water_position"],
        arrays["cascade1.water_normal"]], outputs=[landing, distance], device=device)  # fmt: skip
    return landing.numpy().astype(np.float64), distance.numpy().astype(np.float64)


def wc_spec(renderer, backlund):
    from dataclasses import replace

    return replace(renderer.plan.facts.spec, self_shadow=False, backlund=backlund)


def texel_points(renderer, arrays, of):
    """Where the texels' depths say that they are, in float64."""
    view = renderer.plan.program.views(renderer.plan.facts.scene.camera)["cascade1.view"].numpy()[0]
    depth = arrays[f"cascade1.{of}_position"].numpy().astype(np.float64)
    assert np.isfinite(depth).all()  # the lattice is wider than the view
    column, row = np.meshgrid(np.arange(TEXELS) + 0.5, np.arange(TEXELS) + 0.5)
    return (np.stack([column, row, depth], axis=-1) - np.array(view["offset"])) @ np.array(view["inverse"]).T


def test_texels_hold_the_water_that_the_sun_sees(device):
    renderer, arrays = rendered(looking(GENTLE), device)
    point = texel_points(renderer, arrays, "water")
    waves = [dict(one) for one in GENTLE]
    x, y = point[..., 0], point[..., 1]
    np.testing.assert_allclose(point[..., 2], sum_of_waves(waves, x, y), atol=CHORD)
    h = 1e-5
    slope = [(sum_of_waves(waves, x + dx, y + dy) - sum_of_waves(waves, x - dx, y - dy)) / (2 * h)
             for dx, dy in ((h, 0.0), (0.0, h))]  # fmt: skip
    normal = arrays["cascade1.water_normal"].numpy()
    np.testing.assert_allclose(-normal[..., 0] / normal[..., 2], slope[0], atol=NORMAL)
    np.testing.assert_allclose(-normal[..., 1] / normal[..., 2], slope[1], atol=NORMAL)


def test_at_the_zenith_eq_3_3_and_the_exact_landing_agree_on_a_flat_floor(device):
    renderer, arrays = rendered(looking(direction=(0.0, 0.0, -1.0)), device)
    exact, published = (landings(renderer, arrays, device, backlund)[0] for backlund in (False, True))
    assert np.isfinite(exact).all()
    np.testing.assert_allclose(published, exact, atol=FLOAT_ROUNDING)
    np.testing.assert_allclose(exact[..., 2], -1.0, atol=FLOAT_ROUNDING)


def test_at_45_degrees_eq_3_3_overshoots_by_17_per_cent(device):
    renderer, arrays = rendered(looking(direction=sunlight(45.0)), device)
    exact, published = (landings(renderer, arrays, device, backlund)[1] for backlund in (False, True))
    overshoot = published / exact - 1.0
    assert np.abs(overshoot - OVERSHOOT).max() < OVERSHOOT_BAND


@pytest.mark.parametrize("angle", [0.0, 50.0])
def test_flat_water_over_a_plane_is_evenly_lit(device, angle):
    direction = sunlight(angle)
    medium = {"ior": 1.333, "fresnel": True}
    renderer, _ = rendered(looking(direction=direction, medium=medium), device)
    seen = renderer.result().screen_map
    cos = -direction[2] / np.linalg.norm(direction)
    inside = np.sqrt(1.0 - (1.0 - cos**2) / 1.333**2)
    rs, rp = (cos - 1.333 * inside) / (cos + 1.333 * inside), (1.333 * cos - inside) / (1.333 * cos + inside)
    expected = cos * (1.0 - 0.5 * (rs**2 + rp**2))
    lit = inner(renderer)
    assert lit.sum() > 300
    assert seen[lit].mean() == pytest.approx(expected, rel=MEAN)
    assert seen[lit].std() < NOISE * expected


def inner(renderer):
    """Pixels whose neighbours, two away, all see the floor: the map's border is cut by pixels."""
    seen = np.isfinite(renderer._recording.arrays["eye.depth"].numpy())
    inside = seen.copy()
    for axis in (0, 1):
        for step in (-2, -1, 1, 2):
            inside &= np.roll(seen, step, axis=axis)
    inside[:2], inside[-2:], inside[:, :2], inside[:, -2:] = False, False, False, False
    return inside


def test_what_the_pixels_show_is_what_they_took(device):
    what = looking(GENTLE, count=1, medium={"ior": 1.333, "fresnel": True, "absorption": (0.3, 0.1, 0.05)})
    what = wc.Scene(**{**tables(what), "method": {**tables(what)["method"], "accumulate": "fixed"}})
    renderer, arrays = rendered(what, device)
    result = renderer.result()
    energy, area = result.energy, arrays["eye.area"].numpy().astype(np.float64)
    shown = (result.screen_map.astype(np.float64) * area[..., None]).sum(axis=(0, 1))
    np.testing.assert_allclose(shown, energy.received, rtol=SUMS)
    np.testing.assert_allclose(sum(np.asarray(energy[name]) for name in LOSSES), energy.emitted, rtol=LEDGER)
    assert energy.unaccounted < LEDGER and (np.asarray(energy.received) > 0.2 * np.asarray(energy.emitted)).all()
    assert (np.asarray(energy.absorbed) > 0.0).all() and (np.asarray(energy.reflected) > 0.0).all()
    assert result.caustic_map is None


@pytest.mark.parametrize("name", ["pool", "beach"])
def test_it_sees_what_beam_sees(device, name):
    whole = tables(bundled(name, (128, 128)))
    whole["camera"]["resolution"] = (160, 90)
    whole["method"] = {"name": "cascaded", "cascaded": {"resolution": 192, "count": 2}}
    what = wc.Scene(**whole)
    renderer, _ = rendered(what, device)
    seen, beam = renderer.result().screen_map, wc.render(what, "beam", device, 1).screen_map
    lit = inner(renderer)
    difference = np.sqrt(np.mean((seen[lit] - beam[lit]) ** 2)) / beam[lit].mean()
    assert difference < LIKE_BEAM
    assert seen[lit].mean() == pytest.approx(beam[lit].mean(), rel=MEAN)


def test_a_disk_of_the_sun_is_softer_and_as_bright(device):
    disk = looking(GENTLE).model_copy(
        update={"sun": wc.scene.Sun(direction=(0.3, 0.2, -1.0), angular_diameter=12.0)}
    )  # fmt: skip
    point, _ = rendered(looking(GENTLE), device)
    soft, _ = rendered(disk, device)
    assert soft.plan.samples > point.plan.samples
    lit, sharp, seen = inner(point), point.result().screen_map, soft.result().screen_map
    assert seen[lit].mean() == pytest.approx(sharp[lit].mean(), rel=MEAN)
    assert seen[lit].std() < 0.95 * sharp[lit].std()
    assert soft.result().energy.unaccounted < LEDGER
    beam = wc.render(disk, "beam", device, 1).screen_map
    assert np.sqrt(np.mean((seen[lit] - beam[lit]) ** 2)) / beam[lit].mean() < 0.5 * LIKE_BEAM


def test_a_crest_hides_the_trough_behind_it(device):
    steep, sun = [wave(0.13, 6.0, 0.0)], np.array(sunlight(70.0))
    renderer, arrays = rendered(looking(steep, direction=tuple(sun)), device)
    point = texel_points(renderer, arrays, "water")
    # Nothing stands between what a texel holds and the sun: the way up stays above the water.
    way = -sun / -sun[2]
    rise = np.linspace(0.01, 0.3, 40)
    above = point[..., None, :] + rise[:, None] * way
    assert (above[..., 2] - sum_of_waves(steep, above[..., 0], above[..., 1])).min() > -0.01
    # The troughs are there, and are not among what is held.
    assert point[..., 2].min() > -0.12
    assert renderer.result().energy.unaccounted < LEDGER


VARIANTS = {
    "published": {"footprint": "point", "blend": 0.0},
    "small": {"normals": "octahedral", "positions": "float3", "filter": "bilateral"},
    "angles": {"footprint": "pixel", "normals": "angles", "filter": "blur", "filter_radius": 1},
}


@pytest.mark.parametrize("variant", VARIANTS)
def test_every_setting_keeps_the_mean(device, variant):
    renderer, _ = rendered(looking(GENTLE, **VARIANTS[variant]), device)
    plain, _ = rendered(looking(GENTLE), device)
    lit, seen, other = inner(plain), renderer.result().screen_map, plain.result().screen_map
    assert seen[lit].mean() == pytest.approx(other[lit].mean(), rel=NOISE)
    assert (seen != other).any()


TERRAIN = {"terrain": {"base": 0.1, "slope": (0.1, 0.3)}}


def test_eq_3_3_lands_by_the_ground_of_the_same_texel(device):
    renderer, arrays = rendered(looking(GENTLE, receiver=TERRAIN, projection="backlund"), device)
    point = texel_points(renderer, arrays, "ground")
    np.testing.assert_allclose(point[..., 2], 0.1 + 0.1 * point[..., 0] + 0.3 * point[..., 1] - 1.0, atol=1e-5)
    result = renderer.result()
    assert result.energy.unaccounted < LEDGER
    # All that lands in the picture's middle is taken, though Eq. 3.3 lands beside the floor.
    assert result.screen_map[inner(renderer)].mean() == pytest.approx(0.94, abs=0.06)
    assert not any("ground" in b.name for b in wc.make_plan(looking(projection="backlund"), "cascaded", "cpu").buffers)


def test_the_published_brightness_counts_photons(device):
    what = looking(brightness="published", constant=0.5, footprint="point", min_depth=0.1, max_depth=3.0, count=1)
    renderer, _ = rendered(what, device)
    result = renderer.result()
    assert result.energy is None
    # Water of one metre: 0.9 of the shallow ramp and all of the deep one; whole photons.
    photons = result.screen_map / (0.5 * 0.9)
    np.testing.assert_allclose(photons, np.round(photons), atol=1e-3)
    assert photons.max() >= 1.0


@pytest.mark.parametrize("how", ["each", "shared", "post"])
def test_colours_land_apart_by_their_indices(device, how):
    medium = {"ior": (1.30, 1.333, 1.37), "dispersion": "post" if how == "post" else "traced"}
    settings = {} if how == "post" else {"dispersion_photons": how}
    renderer, _ = rendered(looking(GENTLE, direction=sunlight(50.0), medium=medium, **settings), device)
    seen = renderer.result().screen_map
    lit = inner(renderer)
    for channel, ior in enumerate(medium["ior"]):
        alone, _ = rendered(looking(GENTLE, direction=sunlight(50.0), medium={"ior": ior}), device)
        own = alone.result().screen_map
        found, green = (np.sqrt(np.mean((seen[lit][:, c] - own[lit]) ** 2)) for c in (channel, 1))
        if channel == 1:
            assert found < GREEN  # cascades that hold three indices' light are a texel wider
        else:
            # Nearer to its own picture than green's is; the waves bend colours apart as well, which "post" leaves out.
            assert found < (1.0 if how == "post" else 0.6) * green
    assert renderer.result().energy.unaccounted < LEDGER


def test_a_patch_keeps_its_brightness_as_it_passes_from_one_cascade_to_the_next(device):
    flight = Flight(blend=0.4, frames=100)
    plan = wc.make_plan(flight_scene(flight), "cascaded", device, 1)
    fine, wide = (plan.program.values[f"cascade{i}.scale"][0] for i in (0, 1))
    assert wide > 2.0 * fine  # of a photon: what changes at the border
    found, depths = fly(flight, device)
    assert depths.max() > 6.5 and depths.min() < 5.5  # the border lies at 6 m
    assert found.max() / found.min() - 1.0 < ACROSS_BORDER


@pytest.mark.parametrize(
    ("position", "target"),
    [((0.6, -0.9, 2.0), (1.0, 0.6, 0.0)), ((1.0, -4.0, 5.0), (1.0, 0.5, 0.0)), ((2.4, 1.6, 1.8), (0.6, 0.4, 0.0))],
)
def test_a_frame_from_another_place_is_that_of_a_new_renderer(device, position, target):
    """Nearer, far behind, and from the other side: views were fitted to where the camera stood first."""
    what = looking(GENTLE)
    moved = Camera(**{**EYE, "position": position, "target": target})
    renderer, _ = rendered(what, device)
    renderer.look_from(moved)
    frame = renderer.render(0.0).screen_map.numpy().copy()
    anew, _ = rendered(what.model_copy(update={"camera": moved}), device)
    seen = anew.result().screen_map
    assert seen.any() and frame.mean() == pytest.approx(seen.mean(), rel=MOVED)
    # Other texels, the same light.
    assert np.sqrt(np.mean((frame - seen) ** 2)) < MOVED_NOISE * seen.mean()
    renderer.look_from(what.camera)
    again, _ = rendered(what, device)
    np.testing.assert_array_equal(renderer.render(0.0).screen_map.numpy(), again.result().screen_map)


def test_a_plan_says_what_it_keeps_and_leaves_out():
    plan = wc.make_plan(looking(GENTLE), "cascaded", "cpu", 1)
    kept = {reason.what: reason.kept for reason in plan.reasons}
    assert kept["cascades"] and kept["camera"] and not kept["ground seen by the sun"] and not kept["filter"]
    assert not any("ground" in buffer.name for buffer in plan.buffers)
    ground = wc.make_plan(looking(GENTLE, receiver=TERRAIN, projection="backlund"), "cascaded", "cpu", 1)
    assert any("ground" in buffer.name for buffer in ground.buffers) and ground.bytes > plan.bytes
