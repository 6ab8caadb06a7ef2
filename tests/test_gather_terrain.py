"""The gather on a terrain: its kernel against a direct sum, and its maps against the photon splat of a unit box."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from kernel_helpers import lattice, rounded, terrain_receiver, wave_surface
from scenery import (
    GENTLE,
    assert_adds_up,
    bundled,
    refracted,
    render,
    sample_points,
    save_heights,
    scene,
    sum_of_waves,
    tables,
    wave,
)

import warp_caustics as wc
from oracle.cases import sunlight
from warp_caustics.kernels.deposit import FLUX
from warp_caustics.kernels.gather_terrain import make_gather_terrain
from warp_caustics.kernels.photon import Scene, SunSample
from warp_caustics.kernels.spec import Spec
from warp_caustics.ledger import beyond_border

# A few dozen float32 products of numbers up to one, added up.
SUM_TOLERANCE = 2e-6
# The same landings, each rounded to 1e-6 of a pixel, added up in two orders; relative to the mean.
SPLAT_TOLERANCE = 1e-5
# Channels and single maps are added up alike; only the factor of the sun's colour is rounded in another place.
COLOUR_TOLERANCE = 1e-6
# Where the march of a flat terrain lands: 1e-7 of the way, in pixels of some centimetres.
MARCH_TOLERANCE = 1e-5
# Light that N = 7 misses on the beach at 256 x 256: 2e-5 where each pixel has its own centre, 0.6 with a common one.
PUBLISHED_MISS = 1e-3

PIXEL = (0.1, 0.08)
SUN = np.array([0.4, -0.3, -np.sqrt(0.75)])
IOR = 1.333
RESOLUTION = (9, 7)
FIRST, COUNT = (-8, -7), (25, 22)
SHIFT = (0.31, -0.22)
BASE, SLOPE, RIPPLE = -1.2, (0.5, -0.4), (0.05, (3.0, 2.0), 0.4)
STEEPEST = 0.9  # bound of the slope above

SPLATTED = {"name": "photon", "photon": {"photons_per_pixel": 1.0, "footprint": "pixel"}}
"""What a gather by a wide enough window is."""


# --- the kernel ------------------------------------------------------------------------------------------------------


def depths():
    """Depth of the terrain under the middle of each pixel."""
    x = (np.arange(RESOLUTION[0]) + 0.5) * PIXEL[0]
    y = (np.arange(RESOLUTION[1]) + 0.5)[:, None] * PIXEL[1]
    amplitude, (kx, ky), phase = RIPPLE
    return -(BASE + SLOPE[0] * x + SLOPE[1] * y + amplitude * np.sin(kx * x + ky * y + phase))


def gather(landing, flux, n, m, low, high, device, before=None, amplitude=0.0):
    """The pass over samples [rows, columns] of the lattice: landings [..., 2], fluxes [..., channels]."""
    channels = flux.shape[-1]
    world, sun = Scene(), SunSample()
    world.receiver = terrain_receiver(wave_surface([RIPPLE], device, BASE, SLOPE), -3.0, 0.0, STEEPEST, 1e-3)
    world.medium.eta = 1.0 / IOR
    sun.direction, sun.rest_shift = wp.vec3(*SUN), wp.vec2(*SHIFT)
    start = np.zeros(RESOLUTION[0] * RESOLUTION[1] * channels) if before is None else before.ravel()
    out = wp.array(start.astype(np.float32), dtype=float, device=device)
    samples = wp.array(np.ascontiguousarray(landing, np.float32), dtype=wp.vec2, device=device)
    light = wp.array(np.ascontiguousarray(flux, np.float32), dtype=FLUX[channels], device=device)
    wp.launch(
        make_gather_terrain(Spec(receiver="waves", channels=channels)),
        dim=(RESOLUTION[1], RESOLUTION[0]),
        inputs=[
            0, world, wp.array([sun], dtype=SunSample, device=device), 0, lattice(FIRST, COUNT, 1.0, PIXEL, RESOLUTION),
            wp.vec2(*low), wp.vec2(*high), amplitude + STEEPEST * np.hypot(*PIXEL), n, m, samples, light,
        ],
        outputs=[out],
        device=device,
    )  # fmt: skip
    return out.numpy().reshape(RESOLUTION[1], RESOLUTION[0], channels).astype(np.float64)


def direct_sum(landing, flux, n, m):
    """What each pixel gets of the n x (m + 1) samples around P_G - h R0_xy / |R0_z|, one by one, in float64."""
    image = np.zeros((RESOLUTION[1], RESOLUTION[0], flux.shape[-1]))
    across = -refracted(SUN) * depths()[..., None]  # from the ground up to the illumination centre
    centre = np.rint((np.asarray(SHIFT) + across) / PIXEL).astype(int)
    for row, column in np.ndindex(image.shape[:2]):
        for j in range(centre[row, column, 1] - m // 2, centre[row, column, 1] + m // 2 + 1):
            for i in range(centre[row, column, 0] - n // 2, centre[row, column, 0] + n // 2 + 1):
                at = row + j - FIRST[1], column + i - FIRST[0]
                if 0 <= at[0] < COUNT[1] and 0 <= at[1] < COUNT[0]:
                    x, y = landing[at]
                    share = max(0.0, 1.0 - abs(i + x)) * max(0.0, 1.0 - abs(j + y))
                    image[row, column] += share * flux[at]
    return image


def samples(reach, channels, seed):
    """Random landings within a reach [pixels] of a pixel's distance at rest, and fluxes."""
    rng = np.random.default_rng(seed)
    shape = (COUNT[1], COUNT[0])
    return rounded(rng.uniform(-reach, reach, (*shape, 2))), rounded(rng.random((*shape, channels)))


ANYWHERE = ((-100.0, -100.0), (100.0, 100.0))
"""Bounds of the ways that leave each window as wide as N and M say."""


@pytest.mark.parametrize(("n", "m"), [(1, 2), (7, 6), (5, 2), (3, 8), (41, 40)])
@pytest.mark.parametrize("channels", [1, 3])
def test_a_pixel_adds_up_the_window_around_its_own_illumination_centre(device, n, m, channels):
    """Also where the window reaches past the lattice."""
    landing, flux = samples(6.0, channels, seed=n + 10 * m)
    expected = direct_sum(landing, flux, n, m)
    assert expected.max() > 0.1
    found = gather(landing, flux, n, m, *ANYWHERE, device)
    assert np.abs(found - expected).max() < SUM_TOLERANCE * max(1.0, expected.max())


def physical_samples(low, high, crest, seed):
    """Landings of rays between two ways, on the terrain, from water between crest and trough, in float64."""
    rng = np.random.default_rng(seed)
    shape = (COUNT[1], COUNT[0])
    way = rng.uniform(low, high, (*shape, 2))
    column, row = np.meshgrid(np.arange(COUNT[0]) + FIRST[0] + 0.5, np.arange(COUNT[1]) + FIRST[1] + 0.5)
    water = np.stack([column * PIXEL[0] - SHIFT[0], row * PIXEL[1] - SHIFT[1]], axis=-1)
    level = rng.choice([-crest, crest], shape)
    (amplitude, (kx, ky), phase), down = RIPPLE, np.ones(shape)
    for _ in range(200):  # a contraction: way times slope is below one
        x, y = np.moveaxis(water + way * down[..., None], -1, 0)
        down = level - (BASE + SLOPE[0] * x + SLOPE[1] * y + amplitude * np.sin(kx * x + ky * y + phase))
    return rounded((way * down[..., None] - SHIFT) / PIXEL), rounded(rng.random((*shape, 1)))


@pytest.mark.parametrize(("swing", "crest"), [(0.0, 0.0), (0.1, 0.0), (0.3, 0.03), (0.0, 0.4)])
def test_what_a_window_leaves_out_by_depth_cannot_light_its_pixel(device, swing, crest):
    """Windows cut to the ways that light can take find all that windows of any width find."""
    rest = refracted(SUN)
    low, high = rest - swing, rest + swing
    landing, flux = physical_samples(low, high, crest, seed=3)
    wide = direct_sum(landing, flux, 41, 40)
    assert wide.min() > 0.0
    found = gather(landing, flux, 41, 40, low, high, device, amplitude=crest)
    assert np.abs(found - wide).max() < SUM_TOLERANCE * wide.max()
    # And they are cut: light from beyond, which no ray could bring, is not looked at.
    strayed = landing + np.array([0.0, 12.0])
    found = gather(strayed, flux, 41, 40, low, high, device, amplitude=crest)
    assert found.sum() < 0.9 * direct_sum(strayed, flux, 41, 40).sum()


def test_the_pass_adds_to_the_map_and_passes_over_what_is_no_number(device):
    landing, flux = samples(6.0, 3, seed=5)
    fresh = gather(landing, flux, 7, 6, *ANYWHERE, device)
    before = rounded(np.random.default_rng(1).random(fresh.shape))
    found = gather(landing, flux, 7, 6, *ANYWHERE, device, before)
    assert found == pytest.approx(before + fresh, abs=SUM_TOLERANCE)
    spoilt, dark = landing.copy(), flux.copy()
    spoilt[10, 10], spoilt[11, 12, 0], spoilt[9, 13] = np.nan, np.nan, np.inf
    dark[10, 10] = dark[11, 12] = dark[9, 13] = 0.0
    found = gather(spoilt, flux, 41, 40, *ANYWHERE, device)
    assert found == pytest.approx(gather(landing, dark, 41, 40, *ANYWHERE, device), abs=SUM_TOLERANCE)


# --- the method ------------------------------------------------------------------------------------------------------


def by(what, method):
    """The scene with a table of the method instead of its own."""
    return wc.Scene(**{**tables(what), "method": method})


def difference(one, other):
    """Largest difference of two maps, over the mean."""
    return np.abs(one.caustic_map - other.caustic_map).max() / other.caustic_map.mean()


@pytest.mark.parametrize("name", ["beach", "lake"])
def test_by_its_own_window_it_is_the_photon_splat_of_one_pixel(device, name):
    """Closed form and height map, colour and grey, shore, hills that shade and Fresnel: samples and boxes are one."""
    what = bundled(name, (64, 64))
    gathered, splatted = render(what, "gather", device), render(by(what, SPLATTED), "photon", device)
    assert difference(gathered, splatted) < SPLAT_TOLERANCE
    assert splatted.caustic_map.std() > 0.1 * splatted.caustic_map.mean()
    for entry, light in gathered.energy.items():
        assert light == pytest.approx(splatted.energy[entry], abs=SPLAT_TOLERANCE * np.max(splatted.energy.emitted))


STEEP = {"terrain": {"base": 0.0, "slope": (0.6, -0.4), "waves": [wave(0.05, 9.0, 7.0)]}}
BUMPS = {"terrain": {"base": 0.0, "slope": (0.2, -0.1), "waves": [wave(0.1, 5.0, 3.0)]}}


def test_each_direction_of_the_suns_disk_has_its_own_centre(device):
    what = scene(GENTLE, BUMPS, sunlight(50.0), sun={"angular_diameter": 8.0})
    gathered, splatted = render(what, "gather", device), render(by(what, SPLATTED), "photon", device)
    assert len(gathered.plan.facts.suns) > 1
    assert difference(gathered, splatted) < SPLAT_TOLERANCE


def test_windows_hold_what_a_cut_cell_of_the_waters_border_lands(device, tmp_path):
    """All that is missing is what would have come from beyond the border."""
    low, size = (-0.213, 0.117), (1.9, 0.83)
    x, y = sample_points((48, 64), low, size)
    pond = save_heights(tmp_path, "pond", 1.0 + sum_of_waves(GENTLE, x, y), low, size)
    what = scene((), STEEP, height_map=pond, resolution=(80, 56))
    result = render(what, "gather", device)
    beyond = beyond_border(result.plan.facts)
    assert min(beyond, result.energy.received) > 0.1 * result.energy.emitted
    assert result.energy.missed_by_window == pytest.approx(beyond, abs=SPLAT_TOLERANCE * result.energy.emitted)


@pytest.mark.parametrize("window", [{}, {"n": 1}, {"n": 3, "m": 4}])
def test_a_flat_terrain_is_the_plane(device, window, tmp_path):
    """By any window, so that both also miss the same light; the plane goes by the two passes as published."""
    method, published = {"gather": window}, {"gather": {**window, "form": "two_pass"}}
    heights = save_heights(tmp_path, "flat", np.zeros((8, 8)), (-9.0, -9.0), (20.0, 20.0))
    plane = render(scene(GENTLE, method=published), "gather", device)
    assert "columns" in plane.plan.kernels
    for terrain in ({"base": 0.0}, heights):
        found = render(scene(GENTLE, {"terrain": terrain}, method=method), "gather", device)
        assert "gather_terrain" in found.plan.kernels
        assert difference(found, plane) < MARCH_TOLERANCE
        missed, received = plane.energy.missed_by_window, plane.energy.received
        assert found.energy.missed_by_window == pytest.approx(missed, abs=MARCH_TOLERANCE * received)
        assert (missed > 10.0 * MARCH_TOLERANCE * received) == bool(window)


@pytest.mark.parametrize("n", [1, 3])
def test_what_a_small_window_misses_is_in_the_ledger(device, n):
    what = bundled("beach", (128, 128))
    wide = render(what, "gather", device)
    narrow = render(by(what, {"gather": {"n": n, "m": 2}}), "gather", device)
    assert narrow.plan.program.settings == {"n": n, "m": 2}
    assert_adds_up(wide)
    assert_adds_up(narrow)
    assert (narrow.caustic_map <= wide.caustic_map + SPLAT_TOLERANCE).all()
    missed = wide.energy.received - narrow.energy.received
    assert (np.abs(narrow.energy.missed_by_window - missed) < SPLAT_TOLERANCE * wide.energy.received).all()
    assert (missed > 1e-3 * wide.energy.received).all()


def test_the_published_window_follows_the_ground(device):
    """N = 7 holds what waves deflect; with the ground's own depth light lands over three times as many pixels."""
    what = by(bundled("beach", (256, 256)), {"gather": {"n": 7}})
    result = render(what, "gather", device)
    low, high = result.plan.facts.deviation
    assert (high - low > 20.0).any()
    assert (result.energy.missed_by_window < PUBLISHED_MISS * result.energy.emitted).all()


@pytest.mark.parametrize("receiver", [None, BUMPS])
def test_colour_is_three_single_gathers(device, receiver):
    """By the sun's colour and by an absorption of its own for each channel, on the plane and on a terrain."""
    absorption, irradiance = (0.4, 0.1, 0.02), (1.0, 0.9, 0.7)
    medium = {"ior": IOR, "fresnel": True}
    coloured = scene(GENTLE, receiver, medium={**medium, "absorption": absorption}, sun={"irradiance": irradiance})
    together = render(coloured, "gather", device)
    assert together.caustic_map.shape[2:] == (3,)
    for c in range(3):
        single = scene(GENTLE, receiver, medium={**medium, "absorption": absorption[c]},
                       sun={"irradiance": irradiance[c]})  # fmt: skip
        alone = render(single, "gather", device)
        channel = together.caustic_map[..., c]
        assert np.abs(channel - alone.caustic_map).max() < COLOUR_TOLERANCE * alone.caustic_map.mean()
        for entry, light in alone.energy.items():
            assert together.energy[entry][c] == pytest.approx(light, abs=COLOUR_TOLERANCE * alone.energy.emitted)


def test_no_channel_is_kept_between_passes_on_a_terrain():
    """The widest buffers of the two passes are not there."""
    plans = [
        wc.make_plan(scene(GENTLE, receiver, method={"gather": {"form": form}}), "gather", "cpu", 1)
        for receiver, form in ((None, "two_pass"), (BUMPS, "auto"))
    ]
    assert ["channel" in {buffer.name for buffer in plan.buffers} for plan in plans] == [True, False]
    assert "illumination centre" in str(plans[1])
