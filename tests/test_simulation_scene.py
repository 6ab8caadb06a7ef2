"""Simulated water in a scene: its caustics, its bounds, its plan, what is refused, and how it is drawn."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import warp as wp
from scenery import METHODS, assert_adds_up, relative_l2, render, scene, tables, wave
from test_plan import REPORT_ROUNDING, allocated, no_graphs

import warp_caustics as wc
from oracle.cases import sunlight
from warp_caustics.assets import load_assets
from warp_caustics.facts import gather_facts
from warp_caustics.reference import make_reference
from warp_caustics.simulation import step_launches
from warp_caustics.simulation.basin import LAUNCH_WORK, MOST_WORK
from warp_caustics.water import GRAVITY, water_heights

# A standing wave on 64 cells a wavelength, by bicubic patches: 2e-6 is seen, float32 not yet.
INTERPOLATION = 1e-5
# Where shadows are, cells at their edges are cut by bounds of slope: a disk's for one, a wave's for the other.
SHADOWED = 2e-3
# Heights by bicubic patches on cells of a 64th of a wave, by its height.
DRAWN = 1e-5

DROP = {"position": (0.9, 0.5), "radius": 0.1, "amplitude": 0.02}
SPECTRAL = {"kind": "spectral", "cell": 0.04, "drops": [DROP]}
GRID = {"kind": "grid", "cell": 0.05, "drops": [DROP]}


def watched(monkeypatch):
    """Count launches of recorded commands."""
    count, launch = [0], wp.Launch.launch

    def launching(command, *args, **kwargs):
        count[0] += 1
        return launch(command, *args, **kwargs)

    monkeypatch.setattr(wp.Launch, "launch", launching)
    return count


# --- caustics -------------------------------------------------------------------------------------------------------

LENGTH, AMPLITUDE, TIME = 0.8, 0.01, 0.3
K = 2.0 * np.pi / LENGTH
OMEGA = np.sqrt((GRAVITY * K + 7.28e-5 * K**3) * np.tanh(K))
# Two wide drops of opposite sign leave a single wave (see test_simulation.py); this makes it of the height wanted.
WIDE = AMPLITUDE / (4.0 * np.sqrt(np.pi) * 0.5 * np.exp(-(K**2) * (LENGTH / 2) ** 2 / 4.0)) / (4.0 * np.sqrt(np.pi))


def standing(**more):
    """The standing wave a cos(k x) cos(w t), simulated."""
    drops = [
        {"position": (x, 0.0), "radius": LENGTH / 2, "amplitude": a} for x, a in ((0.0, WIDE), (LENGTH / 2, -WIDE))
    ]
    simulation = {
        "kind": "spectral", "border": "periodic", "origin": (0.0, 0.0), "size": (LENGTH, LENGTH / 8),
        "resolution": (64, 8), "drops": drops, "max_slope": 1.05 * AMPLITUDE * K, "max_height": AMPLITUDE,
    }  # fmt: skip
    return scene(simulation=simulation, **more)


def as_waves(**more):
    """The same as two travelling waves."""
    pair = [wave(AMPLITUDE / 2, K, 0.0, np.pi / 2, angular_frequency=w) for w in (OMEGA, -OMEGA)]
    return scene(pair, **more)


@pytest.mark.parametrize("method", METHODS)
def test_a_simulated_standing_wave_lights_as_the_same_waves_do(device, method):
    simulated, expected = (render(what, method, device, TIME) for what in (standing(), as_waves()))
    assert_adds_up(simulated)
    assert not simulated.warnings
    assert np.ptp(expected.caustic_map) > 0.3
    assert relative_l2(simulated.caustic_map, expected.caustic_map) < INTERPOLATION


def test_the_reference_takes_water_as_it_is_simulated(device):
    made = [make_reference(what, TIME, tolerance=2e-5, device=device, cache=False) for what in (standing(), as_waves())]
    assert relative_l2(made[0].caustic_map, made[1].caustic_map) < INTERPOLATION + sum(one.error_bar for one in made)


@pytest.mark.parametrize("away", [1e3, 1e7])
def test_water_that_repeats_is_as_sharp_far_from_its_origin(device, away):
    """The rectangle that is simulated stands at the world's origin; the map lies a whole number of periods away."""
    near, far = standing(), standing(origin=(round(away / LENGTH) * LENGTH, 0.0))
    maps = [render(what, "beam", device, TIME).caustic_map for what in (near, far)]
    assert np.ptp(maps[0]) > 0.3
    assert relative_l2(maps[1], maps[0]) < INTERPOLATION


STEEPER = {**SPECTRAL, "drops": [{**DROP, "amplitude": 0.1, "radius": 0.06}], "max_slope": 0.3, "max_height": 0.1}


@pytest.mark.parametrize("method", METHODS)
def test_light_past_the_declared_slope_is_dropped_and_said(device, method):
    """Faces that turn from a low sun although no declared slope does: none of their light is negative, or lost."""
    low = np.array([1.0, 0.0, -0.5]) / np.sqrt(1.25)
    result = render(scene(simulation=STEEPER, direction=tuple(low), level=0.15), method, device)
    assert not result.plan.facts.spec.faces_away
    assert result.caustic_map.min() >= 0.0
    assert result.energy.dropped > 0.0
    assert result.energy.unaccounted < 1e-6
    assert any("max_slope" in note for note in result.warnings)
    assert any("dropped" in note for note in result.warnings)


def test_the_reference_says_where_declared_bounds_are_passed(device):
    made = make_reference(scene(simulation=STEEPER), tolerance=2e-2, device=device)
    assert any("max_slope" in note for note in made.notes)
    again = make_reference(scene(simulation=STEEPER), tolerance=2e-2, device=device)
    assert again.cached
    assert again.notes == made.notes


def test_the_reference_sees_the_walls_of_a_basin(device):
    """Water that ends inside the window: what is lit, and what would be from beyond, are the beam's own."""
    ends = {**SPECTRAL, "origin": (0.0, 0.0), "size": (2.0, 1.12)}
    what = scene(simulation=ends, method={"beam": {"samples_per_pixel": 16.0}})
    made, drawn = make_reference(what, TIME, tolerance=5e-4, cache=False), render(what, "beam", device, TIME)
    assert np.ptp(drawn.caustic_map) > 0.3
    assert relative_l2(drawn.caustic_map, made.caustic_map) < 1e-3  # level at the walls, by both
    assert made.energy.missed_by_window == pytest.approx(drawn.energy.missed_by_window, rel=1e-6)
    assert made.energy.missed_by_window > 0.0


def test_a_simulated_standing_wave_with_shadows_lights_as_the_same_waves_do(device):
    """The march over crests, and the cells at their shadows' edges, see water that repeats."""
    low = {"direction": sunlight(87.5), "resolution": (30, 8)}
    simulated, expected = (render(what, "beam", device, TIME) for what in (standing(**low), as_waves(**low)))
    assert simulated.plan.facts.spec.self_shadow
    assert np.max(simulated.energy.blocked) > 0.0
    # Declared bounds are wider, so more water is looked at; of the light on it, the same share is blocked.
    shares = [one.energy.blocked / one.energy.emitted for one in (simulated, expected)]
    assert shares[0] == pytest.approx(shares[1], rel=0.05)
    assert relative_l2(simulated.caustic_map, expected.caustic_map) < SHADOWED


@pytest.mark.parametrize("simulation", [SPECTRAL, GRID, {**GRID, "integrator": "implicit"}])
def test_each_kind_lights_and_adds_up(device, simulation):
    renderer = wc.Renderer(scene(simulation=simulation), "beam", device, threads=1)
    maps = {}
    for time in (0.0, 0.25, 0.0):
        renderer.render(time)
        result = renderer.result()
        assert_adds_up(result)
        assert maps.setdefault(time, result.caustic_map).tobytes() == result.caustic_map.tobytes()
    assert relative_l2(maps[0.25], maps[0.0]) > 0.1
    assert np.max(result.energy.missed_by_window) == pytest.approx(0.0, abs=1e-9)


# --- bounds ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("zenith", [0.0, 60.0])
def test_by_default_the_water_covers_all_that_lights_the_map(zenith):
    what = scene(simulation=GRID, direction=sunlight(zenith))
    facts = gather_facts(what, load_assets(what))
    low, high = facts.water_border
    deviation = [bound * facts.pixel for bound in facts.deviation]
    np.testing.assert_allclose(low, -facts.rest_shifts[0] - deviation[1])
    np.testing.assert_allclose(high, what.map.size - facts.rest_shifts[0] - deviation[0])


def test_light_beyond_the_walls_is_missed_and_that_of_water_that_repeats_is_not(device):
    small = {**SPECTRAL, "origin": (0.3, 0.2), "size": (1.2, 0.6)}
    walled, endless = (render(scene(simulation={**small, "border": b}), "beam", device)
                       for b in ("reflecting", "periodic"))  # fmt: skip
    assert_adds_up(walled)
    assert_adds_up(endless)
    assert walled.energy.missed_by_window > 0.3 * walled.energy.emitted
    assert endless.energy.missed_by_window == 0.0
    assert endless.energy.received > 1.4 * walled.energy.received


def test_water_past_its_declared_bounds_is_told_with_its_figures(device):
    steepest = 0.02 / 0.1 * np.sqrt(2.0) * np.exp(-0.5)  # of a Gaussian, at r = radius / sqrt 2
    fine = {**SPECTRAL, "cell": 0.01}
    assert not render(scene(simulation=fine), "beam", device).warnings
    slope, height = (render(scene(simulation={**fine, **bound}), "beam", device).warnings
                     for bound in ({"max_slope": 0.1}, {"max_height": 0.015}))  # fmt: skip
    assert len(slope) == len(height) == 1
    assert f"reaches a slope of {steepest:.2g}" in slope[0]
    assert "0.1 is planned for" in slope[0]
    assert "raise max_slope" in slope[0]
    assert "reaches a height of 0.0" in height[0]
    assert "raise max_height" in height[0]
    renderer = wc.Renderer(scene(simulation={**fine, "max_height": 0.015}), "beam", device, threads=1)
    for time, told in ((0.0, True), (0.4, False), (0.0, True)):  # it is said of the last frame, not of all before
        renderer.render(time)
        assert bool(renderer.result().warnings) == told


# --- plan -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("simulation", [SPECTRAL, GRID, {**GRID, "integrator": "implicit"}])
def test_launches_are_those_of_the_plan(device, simulation, monkeypatch):
    monkeypatch.setattr(wp, "capture_begin", no_graphs)
    count = watched(monkeypatch)
    renderer = wc.Renderer(scene(simulation=simulation), "photon", device, threads=1)
    plan = renderer.plan
    drops = 0 if simulation is SPECTRAL else 1
    renderer.render(0.0)
    assert count[0] == plan.launches + drops
    steps = 0 if simulation is SPECTRAL else step_launches(plan.facts.basin)
    for before, after in ((0, 4), (4, 7), (7, 7)):
        count[0] = 0
        renderer.render(after * plan.facts.basin.step if steps else 0.1 * after)
        assert count[0] == plan.launches + (after - before) * steps
    text = str(plan)
    for one in plan.water_passes:
        assert f"\n  {one.name} " in text
        assert one.name in plan.kernels
    assert ("for each step of the water" in text) == bool(steps)


@pytest.mark.parametrize(
    "simulation",
    [SPECTRAL, {**SPECTRAL, "border": "periodic"}, GRID,
     {**GRID, "integrator": "implicit", "obstacles": [{"position": (0.2, 0.2), "radius": 0.1}]}],
)  # fmt: skip
def test_bytes_are_those_allocated(device, simulation):
    what = scene(simulation=simulation)
    wc.Renderer(what, "photon", device, threads=1)  # compiled, so that only the scene's own arrays are counted
    reports: list[str] = []
    with wp.ScopedMemoryTracker("renderer", report_func=reports.append) as tracker:
        tracker.clear()
        plan = wc.Renderer(what, "photon", device, threads=1).plan
    assert allocated(reports[-1], device) == pytest.approx(plan.bytes, rel=1e-3, abs=REPORT_ROUNDING)


@pytest.mark.parametrize("simulation", [SPECTRAL, GRID, {**GRID, "integrator": "implicit"}])
def test_a_frame_allocates_nothing(device, simulation):
    renderer = wc.Renderer(scene(simulation=simulation), "photon", device, threads=1)
    renderer.render(0.0)
    reports: list[str] = []
    with wp.ScopedMemoryTracker("frame", report_func=reports.append) as tracker:
        tracker.clear()
        for time in (0.1, 0.05):
            renderer.render(time)
    assert allocated(reports[-1], device) == 0.0


def test_the_example_lights(device):
    """The scene of examples/, on a small map."""
    example = wc.load_scene(Path(__file__).parents[1] / "examples" / "drops.toml")
    small = example.model_copy(update={"map": example.map.model_copy(update={"resolution": (48, 48)})})
    result = render(small, "photon", device, 1.5)
    assert_adds_up(result)
    assert not result.warnings
    assert result.caustic_map.std() > 0.1 * result.caustic_map.mean()


def test_a_scene_without_a_simulation_has_nothing_of_one():
    plan = wc.make_plan(scene([wave(0.01, 3.0, 0.0)]), "beam", "cpu")
    assert plan.facts.basin is None
    assert plan.water_passes == ()
    reasons = {reason.what: reason for reason in plan.facts.reasons}
    assert not reasons["simulation"].kept
    assert not reasons["border of the water"].kept


# --- what is refused ------------------------------------------------------------------------------------------------

REFUSED = {
    "a step past the limit": ({**GRID, "step": 0.1}, r"step: expected less than 0\.0\d+ s"),
    "no power of two": ({"kind": "spectral", "resolution": (48, 32)}, "powers of two from 4 to 2048.*48 x 32"),
    "cells too fine to transform": ({"kind": "spectral", "cell": 1e-4}, "simulation.cell: expected powers of two"),
    "too many cells": ({"kind": "grid", "cell": 1e-5}, "simulation.cell: expected 4 cells a side to 67,108,864"),
    "too few cells": ({"kind": "grid", "resolution": (8, 3)}, "expected 4 cells a side"),
    "a drop finer than a cell": ({**GRID, "cell": 0.2}, r"drops\[0\].radius: expected 0.\d+ m, a cell's side"),
    "a drop as wide as a sea": (
        {**GRID, "drops": [{**DROP, "radius": 99.0}]}, r"drops\[0\].radius: .* 8 times the water's, got 99 m"),
    "a drop beside the water": (
        {**GRID, "drops": [DROP, {**DROP, "position": (99.0, 0.0)}]}, r"drops\[1\].position: .*got \[99.0, 0.0\]"),
    "an implicit step past all bounds": (
        {**GRID, "integrator": "implicit", "step": 1e6}, r"^water.simulation.step: 1e\+06 s take .* iterations"),
    "a drop that falls too late": (
        {**GRID, "drops": [DROP, {**DROP, "time": 1e8}]}, r"^water.simulation.drops\[1\].time: 1e\+08 s are .* steps"),
    "a drop in an obstacle": (
        {**GRID, "obstacles": [{"position": (0.9, 0.5), "radius": 0.3}]}, r"^water.simulation.drops\[0\].position: "),
    "an obstacle between the cells": (
        {**GRID, "obstacles": [{"position": (1, 0.5), "radius": 0.4}, {"position": (1, 0.5), "radius": 1e-4}]},
        r"^water.simulation.obstacles\[1\]: it covers the middle of no cell"),
    "an obstacle beside the water": (
        {**GRID, "obstacles": [{"position": (99, 0.5), "radius": 0.4}]}, r"^water.simulation.obstacles\[0\]: "),
    "water as thin as a hair": (
        {**GRID, "origin": (0, 0), "size": (1e-18, 1.0)}, "^water.simulation.size: expected sides .* in 1e-18 x 1 m"),
    "no water left": ({**GRID, "obstacles": [{"position": (1, 0.5), "radius": 9.0}]}, "cover all of it"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_a_plan_refuses(case):
    simulation, message = REFUSED[case]
    with pytest.raises(wc.InputError, match=message):
        wc.make_plan(scene(simulation=simulation), "beam", "cpu")


@pytest.mark.parametrize("cells", [{"resolution": (8192, 4096)}, {"cell": 4e-4}])
def test_water_that_does_not_fit_is_told_by_its_own_key(cells, monkeypatch):
    monkeypatch.setattr("warp_caustics.device.free_memory", lambda device: 10**9)
    key = next(iter(cells))
    what = scene(simulation={"kind": "grid", **cells, "drops": [DROP]})
    with pytest.raises(wc.InputError, match=rf"^water\.simulation\.{key}: \d+ x \d+ cells take [\d,]+ bytes"):
        wc.make_plan(what, "beam", "cpu", 1)


@pytest.mark.parametrize(
    ("simulation", "message"),
    [
        ({"kind": "grid"}, "exactly one of cell or resolution, got none"),
        ({"kind": "grid", "cell": 0.1, "resolution": (4, 4)}, "exactly one of cell or resolution"),
        ({"kind": "grid", "cell": 0.1, "origin": (0, 0)}, "origin and size together"),
        ({"kind": "wavelet", "cell": 0.1}, 'kind: expected one of "spectral" or "grid"'),
        ({**SPECTRAL, "step": 0.1}, 'no step with kind "spectral"'),
        ({**SPECTRAL, "integrator": "implicit"}, 'no integrator with kind "spectral"'),
        ({**SPECTRAL, "damping": 0.1}, 'no damping with kind "spectral"'),
        ({**SPECTRAL, "obstacles": []}, 'no obstacles with kind "spectral"'),
        ({**SPECTRAL, "drops": [DROP, {**DROP, "time": 1.0}]}, "drops at time 0.*got 1.0 for drop 1"),
        ({**GRID, "obstacles": [{"position": (0, 0)}]}, r"obstacles\[0\]: expected exactly one of radius or size"),
        ({**GRID, "drops": [{**DROP, "time": -1.0}]}, r"drops\[0\].time: expected a finite number of at least 0"),
    ],
)
def test_a_scene_refuses(simulation, message):
    with pytest.raises(wc.InputError, match=message):
        scene(simulation=simulation)


def test_the_least_of_a_grid_is_a_scene_and_comes_back_from_its_text():
    least = scene(simulation={"kind": "grid", "cell": 0.05, "damping": 0.0, "drops": []})
    assert wc.make_plan(least, "beam", "cpu").facts.basin.step > 0.0
    from warp_caustics.scene import parse_scene

    for what in (least, scene(simulation=SPECTRAL)):
        assert parse_scene(what.to_toml()) == what
        assert wc.Scene(**tables(what)) == what


@pytest.mark.parametrize("time", [-1.0, 1e9])
def test_a_time_that_a_grid_does_not_reach_is_refused(device, time):
    renderer = wc.Renderer(scene(simulation=GRID), "photon", device, threads=1)
    with pytest.raises(wc.InputError, match=r"^time: ") as refused:
        renderer.render(time)
    if time > 0.0:
        latest = float(re.search(r"expected (\S+) s at most", str(refused.value))[1])
        basin = renderer.plan.facts.basin
        work = basin.steps_to(latest) * basin.step_launches * (basin.rows * basin.columns + LAUNCH_WORK)
        assert work == pytest.approx(MOST_WORK, rel=1e-4)


# --- drawing --------------------------------------------------------------------------------------------------------


def test_the_height_that_is_drawn_is_that_of_the_water():
    what = standing()
    x, y = np.meshgrid(np.linspace(-3.0, 3.0, 41), np.linspace(-1.0, 1.0, 5))
    z = water_heights(what, load_assets(what), x, y, TIME)
    np.testing.assert_allclose(z, 1.0 + AMPLITUDE * np.cos(K * x) * np.cos(OMEGA * TIME), atol=DRAWN * AMPLITUDE)
    walled = scene(simulation=SPECTRAL)
    top = water_heights(walled, load_assets(walled), np.array([0.9, 0.9]), np.array([0.5, 99.0]), 0.0)
    np.testing.assert_allclose(top, [1.02, 1.0], atol=1e-4)
