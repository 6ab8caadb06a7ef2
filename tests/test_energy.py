"""What goes in comes out: the ledger adds up, and the light that lands is the light that the sun sent."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenery import (
    FREE_METHODS,
    LEDGER,
    METHODS,
    assert_adds_up,
    bundled,
    render,
    sample_points,
    save_box,
    save_heights,
    scene,
    sum_of_waves,
    wave,
)

import warp_caustics as wc
from oracle.cases import CASES, sunlight

EXACT = 1e-5  # what the issue asks on planes: float32 sums of some hundred cells a pixel
LEDGER_OF_CELLS = 1e-4  # what a beam's cells make of where the water turns from the sun
PHASES = 16  # frames over a period: their mean holds no first to fifteenth harmonic of what crosses the window's ends
# The beam's energy is right to 1e-4 in every case; a photon is lit or not, and a low sun lights 10 to 30 of a wave's.
SHADOW_EDGES = {"beam": 1e-4, "photon": 1e-2, "gather": 4e-2}
# 16 frames see the ends of the window, where a shadow's edge is a cell wide, at 16 places only.
FRAME_EDGES = {"beam": 2e-3, "photon": 5e-3, "gather": 5e-3}
HUMP = 1e-3  # a gather's samples stand 5 cm apart on a hump of 60
PRINTED = 6e-3  # factors printed to three digits, at 64 samples a wave that a low sun lights over a fifth
STEEP_FACTORS = {60.0: 1.06, 70.0: 1.27, 80.0: 1.98, 85.0: 3.43}  # physics.md, for a sine of slope 0.8
OVER_LIT_WARNING = "enters twice"

TELLING = {"shore": "dry", "hills": "outside_map", "leaving": "left_water", "shaded": "blocked"}


def periodic_waves(size, slope, turns=((1, 0), (0, 2), (2, -1), (-1, 3))):
    """Waves whose lengths fit the map's size a whole number of times, so that it shows one period of the light."""
    made = []
    for i, turn in enumerate(turns):
        kx, ky = 2.0 * np.pi * np.divide(turn, size)
        made.append(wave(slope / np.hypot(kx, ky), kx, ky, 1.3 * i))
    return made


# --- planes ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("zenith", [0.0, 35.0, 70.0])
@pytest.mark.parametrize(("resolution", "size"), [((32, 32), (1.0, 1.0)), ((24, 36), (1.2, 1.0)), ((7, 5), (0.3, 0.2))])
def test_a_whole_period_receives_what_flat_water_would(device, method, zenith, resolution, size):
    for slope in (0.01, 0.05):
        what = scene(
            periodic_waves(size, slope), direction=sunlight(zenith), resolution=resolution, size=size, level=0.5
        )
        result = render(what, method, device)
        assert np.mean(result.caustic_map, dtype=np.float64) == pytest.approx(np.cos(np.radians(zenith)), rel=EXACT)
        assert abs(result.energy.missed_by_window) < EXACT * result.energy.emitted  # the gather's window is wide enough
        assert_adds_up(result)


@pytest.mark.parametrize("footprint", ["point", "pixel", "cell", 0.3, 3.5])
@pytest.mark.parametrize("density", [0.4, 1.0, 5.0])
def test_boxes_of_any_width_keep_their_light(device, footprint, density):
    size = (1.0, 0.8)
    chosen = {"photon": {"footprint": footprint, "photons_per_pixel": density}}
    what = scene(
        periodic_waves(size, 0.05), size=size, resolution=(30, 20), direction=(0.0, 0.0, -1.0), level=0.5, method=chosen
    )
    result = render(what, "photon", device)
    assert_adds_up(result)
    # Photons of any spacing sum to the same light up to what their lattice makes of the waves at the border.
    assert np.mean(result.caustic_map, dtype=np.float64) == pytest.approx(1.0, rel=2e-2)
    if density == 1.0:  # a whole number of photons a period
        assert np.mean(result.caustic_map, dtype=np.float64) == pytest.approx(1.0, rel=EXACT)


@pytest.mark.parametrize("n", [1, 3, 7])
def test_a_narrow_gather_books_what_its_window_misses(device, n):
    waves = periodic_waves((1.0, 1.0), 0.1)
    wide = render(scene(waves, size=(1.0, 1.0), resolution=(64, 64), level=2.0), "gather", device)
    narrow = scene(waves, size=(1.0, 1.0), resolution=(64, 64), level=2.0, method={"gather": {"n": n}})
    result = render(narrow, "gather", device)
    assert result.plan.program.settings["n"] == n
    assert_adds_up(result)
    assert result.energy.received < 0.9 * wide.energy.received
    assert (result.caustic_map <= wide.caustic_map + EXACT).all()
    # Lit by the same rows and columns, the narrow window's own map and what it missed make the wide one's.
    assert result.energy.missed_by_window > 0.1 * result.energy.received


def test_the_gather_keeps_the_share_that_the_papers_window_keeps(device):
    """physics.md: N = 7 at 1 cm pixels and rms slope 0.08 keeps 97 / 61 / 22 % of the light at 1 / 2 / 4 m."""
    kept = []
    for level in (1.0, 2.0, 4.0):
        waves = CASES["calm_pool"].water["waves"]
        steeper = [{**w, "amplitude": w["amplitude"] * 0.08 / 0.025} for w in waves]
        what = scene(
            steeper, direction=(0.0, 0.0, -1.0), level=level, size=(0.96, 0.96), resolution=(96, 96),
            method={"gather": {"n": 7}},
        )  # fmt: skip
        kept.append(float(np.mean(render(what, "gather", device).caustic_map, dtype=np.float64)))
    np.testing.assert_allclose(kept, (0.97, 0.61, 0.22), atol=0.08)  # other waves of the same slope


# --- every scene ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", FREE_METHODS)
@pytest.mark.parametrize("name", wc.bundled_scenes())
def test_bundled_scenes_add_up(device, name, method):
    result = render(bundled(name), method, device)
    assert_adds_up(result)
    assert np.max(result.energy.over_lit) == 0.0


@pytest.mark.parametrize("name", ["pool", "beach", "lake"])
def test_the_gathers_bundled_scenes_add_up(device, name):
    assert_adds_up(render(bundled(name), "gather", device))


@pytest.mark.parametrize("method", FREE_METHODS)
@pytest.mark.parametrize("name", ["shore", "hills", "leaving", "shaded", "bumpy_terrain"])
def test_hard_cases_add_up(device, name, method):
    case = replace(CASES[name], resolution=(32, 24))
    result = render(wc.Scene(**case.scene_dict()), method, device)
    assert_adds_up(result)
    assert np.min(result.energy[TELLING.get(name, "absorbed")]) > 0.0, "the case does not show what it is there for"


@pytest.mark.parametrize("method", FREE_METHODS)
def test_the_suns_disk_adds_up(device, method):
    what = bundled("pool", (32, 32))
    what = what.model_copy(update={"sun": what.sun.model_copy(update={"angular_diameter": 8.0})})
    result = render(what, method, device)
    assert len(result.plan.facts.suns) > 10
    assert_adds_up(result)


# --- waves that shade each other ------------------------------------------------------------------------------------


def steep(zenith, self_shadow):
    """One whole sine of slope 0.8 across the map, its sun in its plane."""
    k = 2.0 * np.pi
    return scene(
        [wave(0.8 / k, k, 0.0, 0.3, angular_frequency=1.0)], direction=sunlight(zenith, 0.0), resolution=(64, 8),
        size=(1.0, 0.125), self_shadow=self_shadow,
    )  # fmt: skip


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("zenith", STEEP_FACTORS)
def test_without_shadows_steep_waves_make_light(device, method, zenith):
    result = render(steep(zenith, False), method, device)
    factor = np.mean(result.caustic_map, dtype=np.float64) / np.cos(np.radians(zenith))
    assert factor == pytest.approx(STEEP_FACTORS[zenith], rel=PRINTED)
    assert_adds_up(result)
    assert result.energy.blocked == 0.0
    assert result.energy.over_lit > 0.01 * result.energy.emitted
    assert any(OVER_LIT_WARNING in warning for warning in result.warnings)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("zenith", STEEP_FACTORS)
def test_with_shadows_steep_waves_keep_their_light(device, method, zenith):
    for self_shadow in (True, "auto"):
        result = render(steep(zenith, self_shadow), method, device)
        factor = np.mean(result.caustic_map, dtype=np.float64) / np.cos(np.radians(zenith))
        # A sun 85° from the zenith lights a seventh of the wave: edges weigh more.
        assert factor == pytest.approx(1.0, rel=SHADOW_EDGES[method] * (2.0 if zenith > 80.0 else 1.0))
        assert_adds_up(result)
        assert result.energy.over_lit == 0.0
        assert result.energy.blocked > 0.0
        assert not any(OVER_LIT_WARNING in warning for warning in result.warnings)


@pytest.mark.parametrize("method", METHODS)
def test_what_crests_take_is_what_they_would_have_lit_twice(device, method):
    # Through a horizontal area comes |I_z| E, however steep the water: what faces the sun takes in more, and just that
    # much is in the shade (or, without shadows, lit by light that was taken already).
    zenith, times = 80.0, np.arange(PHASES) * 2.0 * np.pi / PHASES
    sums = {}
    for self_shadow in (False, True):
        renderer = wc.Renderer(steep(zenith, self_shadow), method, device, threads=1)
        energies = []
        for time in times:
            renderer.render(time)
            energies.append(renderer.result().energy)
        sums[self_shadow] = {name: np.mean([energy[name] for energy in energies]) for name in energies[0]}
        lattice = renderer.plan.program.lattice
        window = lattice.cells * lattice.step**2 * np.prod(renderer.plan.facts.pixel)
        through = np.cos(np.radians(zenith)) * window
        spare = sums[self_shadow]["blocked" if self_shadow else "over_lit"]
        tolerance = FRAME_EDGES[method] if self_shadow else LEDGER_OF_CELLS
        assert sums[self_shadow]["emitted"] - spare == pytest.approx(through, rel=tolerance)
    assert sums[True]["emitted"] == pytest.approx(sums[False]["emitted"], rel=LEDGER_OF_CELLS)
    assert sums[True]["blocked"] == pytest.approx(sums[False]["over_lit"], rel=FRAME_EDGES[method])


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("self_shadow", [True, False])
def test_a_hump_of_water_from_a_file_takes_no_more_than_comes(device, method, self_shadow, tmp_path):
    # A hump that is level at its border: through two metres by two comes |I_z| E, less what its neighbours shade.
    corner, size, zenith = (-1.0, -1.0), (2.0, 2.0), 75.0
    x, y = sample_points((64, 64), corner, size)
    hump = 0.2 * (1.0 - np.minimum((x**2 + y**2) / 0.6**2, 1.0)) ** 3
    what = scene(
        height_map=save_heights(tmp_path, "hump", hump, corner, size), direction=sunlight(zenith, 20.0), level=0.5,
        origin=(-2.0, -2.0), size=(6.0, 6.0), resolution=(120, 120), self_shadow=self_shadow,
    )  # fmt: skip
    result = render(what, method, device)
    assert_adds_up(result)
    energy = result.energy
    assert energy.outside_map < LEDGER * energy.emitted
    spare = energy.blocked if self_shadow else energy.over_lit
    assert spare > 0.02
    through = 4.0 * np.cos(np.radians(zenith))
    assert energy.emitted - energy.missed_by_window - spare == pytest.approx(through, rel=HUMP)
    assert energy.received == pytest.approx(through + (0.0 if self_shadow else spare), rel=HUMP)


@pytest.mark.parametrize("method", FREE_METHODS)
def test_everything_at_once_adds_up(device, method, tmp_path):
    """Water and bed from files, a shore, a rock under water and one above, every loss by colour, a wide sun."""
    corner, size = (-1.0, -1.0), (5.0, 5.0)
    x, y = sample_points((120, 120), corner, size)
    swell = sum_of_waves([wave(0.1, 6.0, 2.0), wave(0.05, -5.0, 7.0)], x, y)
    bed = 0.5 + 0.3 * x - 0.1 * y + sum_of_waves([wave(0.08, 5.0, 3.0)], x, y)
    box = save_box(tmp_path)
    what = scene(
        None,
        {
            "terrain": save_heights(tmp_path, "bed", bed, corner, size),
            "objects": [
                {"mesh": box, "translate": (0.7, 0.5, 0.5), "scale": 0.25},
                {"mesh": box, "translate": (1.2, 0.5, 0.4), "scale": 0.9},
            ],
        },
        sunlight(65.0, 200.0),
        {"ior": 1.34, "fresnel": True, "absorption": (0.4, 0.1, 0.02)},
        height_map=save_heights(tmp_path, "swell", swell, corner, size),
        sun={"irradiance": (900.0, 1000.0, 800.0), "angular_diameter": 2.0},
        method={"accumulate": "fixed"},
        size=(2.0, 1.2),
        resolution=(48, 30),
    )
    result = render(what, method, device)
    left_out = {reason.what for reason in result.plan.reasons if not reason.kept}
    assert left_out == {"camera", "simulation", "spectrum"}  # a file is neither
    assert_adds_up(result)
    assert np.isfinite(result.caustic_map).all()
    for name in ("received", "reflected", "absorbed", "blocked", "dry"):
        assert np.min(result.energy[name]) > 0.0, name


def test_calm_water_needs_no_shadows_and_lights_nothing_twice(device):
    for self_shadow in (False, True, "auto"):
        calm = scene([wave(0.01, 2.0, 0.0)], direction=sunlight(60.0), self_shadow=self_shadow)
        result = render(calm, "photon", device)
        assert not result.plan.facts.spec.self_shadow
        assert result.energy.over_lit == 0.0
        assert result.warnings == []
