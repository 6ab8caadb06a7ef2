"""A sea in a scene: its caustics by every method, what repeats, its plan, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from scenery import METHODS, assert_adds_up, bundled, relative_l2, render, scene, tables, wave
from test_plan import REPORT_ROUNDING, allocated, no_graphs
from test_simulation_scene import watched

import warp_caustics as wc
from warp_caustics.assets import load_assets
from warp_caustics.energy import Energy
from warp_caustics.reference import make_reference
from warp_caustics.simulation import Sea, bound_notes, make_sea
from warp_caustics.simulation.sea import wave_vectors
from warp_caustics.water import angular_frequency, water_heights

# Bicubic patches of fourth-order differences on eight nodes a wave, against the waves themselves.
INTERPOLATION = 3e-3
# What is asked of a texture: across its seam, and from its last frame to its first.
SEAMLESS = 1e-5
# Surfaces between nodes, by their height.
DRAWN = 0.01

SEA = {"kind": "jonswap", "wind_speed": 2.0, "fetch": 500.0, "period": 2.0, "resolution": 64, "seed": 3}
TIME = 0.4


def sea(**more) -> dict:
    return {**SEA, **more}


def as_waves(settings: dict, **more) -> wc.Scene:
    """The same sea as a list of waves: a cos(k x - w t + phase) as a sine."""
    made = make_sea(scene(spectrum=settings).water.spectrum, 1.0)
    kx, ky = np.broadcast_arrays(*wave_vectors(made.settings))
    rows, columns = np.nonzero(made.modes)
    waves = [
        wave(abs(made.modes[at]), kx[at], ky[at], np.angle(made.modes[at]) + np.pi / 2,
             angular_frequency=float(angular_frequency(np.hypot(kx[at], ky[at]), 1.0)))
        for at in zip(rows, columns, strict=True)
    ]  # fmt: skip
    return scene(waves, **more)


# --- caustics -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", METHODS)
def test_a_sea_lights_as_the_same_waves_do(device, method):
    ours, expected = (render(what, method, device, TIME) for what in (scene(spectrum=sea()), as_waves(sea())))
    assert_adds_up(ours)
    assert not ours.warnings
    assert expected.caustic_map.std() > 0.2
    assert relative_l2(ours.caustic_map, expected.caustic_map) < INTERPOLATION


def test_the_reference_takes_a_sea_as_it_is(device):
    what = scene(spectrum=sea(), method={"beam": {"samples_per_pixel": 16.0}})
    made, drawn = (
        make_reference(what, TIME, tolerance=1e-3, device=device, cache=False),
        render(what, "beam", device, TIME),
    )
    assert isinstance(made.energy, Energy)
    assert made.notes == ()
    assert relative_l2(drawn.caustic_map, made.caustic_map) < 2e-3


@pytest.mark.parametrize("method", ["beam", "photon"])
def test_a_map_one_period_wide_is_a_tile(device, method):
    """Moved by half a period, it is the map rolled by half; moved by whole ones, itself."""
    square = {"size": (2.0, 2.0), "resolution": (32, 32)}
    still, moved, far = (
        render(scene(spectrum=sea(), origin=origin, **square), method, device, TIME).caustic_map
        for origin in ((0.0, 0.0), (1.0, 1.0), (-4.0, 2.0))
    )
    assert np.ptp(still) > 1.0
    assert relative_l2(moved, np.roll(still, (-16, -16), axis=(0, 1))) < SEAMLESS
    assert relative_l2(far, still) < SEAMLESS


def test_a_sea_that_loops_is_lit_alike_after_a_loop(device):
    renderer = wc.Renderer(scene(spectrum=sea(loop=2.0)), "beam", device, threads=1)
    maps = [renderer.render(time).caustic_map.numpy().copy() for time in (0.0, 1.0, 2.0)]
    assert relative_l2(maps[2], maps[0]) < SEAMLESS
    assert relative_l2(maps[1], maps[0]) > 0.1


def test_the_bundled_sea_is_a_tile_of_light():
    """Its map is one period wide: what lands beside it comes in from the other side, and nothing is lost."""
    whole = wc.load_scene("sea")
    assert whole.map.size == 2 * (whole.water.spectrum.period,)
    result = render(bundled("sea", (64, 64)), "photon", "cpu")
    assert_adds_up(result)
    assert not result.warnings
    cosine = -whole.sun.unit_direction[2]
    assert result.caustic_map.mean(dtype=np.float64) == pytest.approx(cosine, rel=1e-6)
    assert result.caustic_map.std() > 0.5


def test_the_height_that_is_drawn_is_that_of_the_sea():
    what = scene(spectrum=sea())
    x, y = (axis.ravel() for axis in np.meshgrid(np.linspace(-3.1, 3.3, 13), np.linspace(-1.0, 1.3, 7)))
    drawn = water_heights(what, load_assets(what), x, y, TIME)
    expected = water_heights(as_waves(sea()), load_assets(what), x, y, TIME)
    np.testing.assert_allclose(drawn, expected, atol=DRAWN * np.ptp(expected))
    again = water_heights(what, load_assets(what), x + 2.0, y - 4.0, TIME)
    np.testing.assert_allclose(again, drawn, rtol=1e-12)


# --- bounds and plan ------------------------------------------------------------------------------------------------


def test_bounds_that_are_passed_are_told(device):
    facts = wc.make_plan(scene(spectrum=sea()), "photon", "cpu", 1).facts
    made = facts.basin
    assert isinstance(made, Sea)
    assert facts.spec.declared  # so that light past them is dropped
    assert (facts.amplitude, facts.slope) == (made.max_height, pytest.approx(made.max_slope, rel=2e-3))
    assert bound_notes(made, made.max_slope, made.max_height) == ()
    (note,) = bound_notes(made, 1.01 * made.max_slope, made.max_height)
    assert note.startswith("water.spectrum: its surface reaches a slope of")
    assert "give it a loop" in note


def test_the_plan_says_what_there_is_of_the_spectrum():
    plan = wc.make_plan(scene(spectrum=sea(loop=3.0)), "beam", "cpu", 1)
    (reason,) = (one for one in plan.facts.reasons if one.what == "spectrum")
    assert reason.kept
    for words in ("jonswap", "repeats after 2 m", "waves of 2 to 0.25 m", "% of its variance", "a loop of 3 s moves"):
        assert words in reason.why
    assert not plan.warnings
    (warning,) = wc.make_plan(scene(spectrum=sea(loop=0.5)), "beam", "cpu", 1).warnings
    assert warning.startswith("water.spectrum.loop: 0.5 s move the frequency of a wave by ")
    assert "travel" in plan.kernels
    assert "evolve" not in plan.kernels


@pytest.mark.parametrize("loop", [None, 3.0])
def test_launches_and_bytes_are_those_of_the_plan(device, loop, monkeypatch):
    what = scene(spectrum=sea(loop=loop))
    wc.Renderer(what, "photon", device, threads=1)  # compiled, so that only the scene's own arrays are counted
    reports: list[str] = []
    with wp.ScopedMemoryTracker("renderer", report_func=reports.append) as tracker:
        tracker.clear()
        renderer = wc.Renderer(what, "photon", device, threads=1)
    plan = renderer.plan
    assert allocated(reports[-1], device) == pytest.approx(plan.bytes, rel=1e-3, abs=REPORT_ROUNDING)
    monkeypatch.setattr(wp, "capture_begin", no_graphs)
    count = watched(monkeypatch)
    renderer = wc.Renderer(what, "photon", device, threads=1)
    with wp.ScopedMemoryTracker("frame", report_func=reports.append) as tracker:
        tracker.clear()
        renderer.render(TIME)
    assert count[0] == plan.launches
    assert allocated(reports[-1], device) == 0.0


def test_a_scene_of_waves_has_nothing_of_a_sea():
    plan = wc.make_plan(scene([wave(0.01, 3.0, 0.0)]), "beam", "cpu")
    assert plan.facts.basin is None
    assert plan.water_passes == ()
    assert not {buffer.name for buffer in plan.buffers} & {"spectrum", "modes", "turned", "water_nodes"}
    (reason,) = (one for one in plan.facts.reasons if one.what == "spectrum")
    assert not reason.kept
    assert reason.why == "water is a sum of waves"


# --- what is refused ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (sea(kind="swell"), 'water.spectrum.kind: expected one of "jonswap", "pm" or "tma", got "swell"'),
        (sea(kind="pm"), 'water.spectrum: expected no fetch with kind "pm"'),
        (sea(fetch=None), 'water.spectrum: expected a fetch with kind "jonswap"'),
        (sea(resolution=48), "water.spectrum.resolution: expected a power of two from 16 to 4096, got 48"),
        (sea(resolution=8192), "water.spectrum.resolution: expected a power of two from 16 to 4096, got 8192"),
        (sea(period=0.0), "water.spectrum.period: expected a finite number above 0, got 0.0"),
        (sea(loop=-1.0), "water.spectrum.loop: expected a finite number above 0, got -1.0"),
        (sea(seed=-1), "water.spectrum.seed: expected a whole number of at least 0, got -1"),
        (
            sea(spreading="donelan"),
            'water.spectrum.spreading: expected "mitsuyasu", or a finite number above 0, at most 100, got "donelan"',
        ),
        (sea(spreading=101.0), "or a finite number above 0, at most 100, got 101.0"),
        (sea(depth=3.0), "water.spectrum.depth: unknown key"),
    ],
)
def test_a_scene_refuses(settings, message):
    with pytest.raises(wc.InputError) as refused:
        scene(spectrum={key: value for key, value in settings.items() if value is not None})
    assert message in str(refused.value)


def test_a_square_too_large_for_the_waves_is_refused():
    with pytest.raises(wc.InputError, match=r"^water.spectrum: no energy in waves of 10000 m to 1250 m"):
        wc.make_plan(scene(spectrum=sea(period=1e4)), "beam", "cpu")


@pytest.mark.parametrize("key", ["period", "wind_speed", "fetch", "loop"])
def test_numbers_too_small_to_divide_by_are_refused(key):
    with pytest.raises(wc.InputError, match=rf"^water.spectrum.{key}: expected a number of at least 1e-18, got 1e-19"):
        wc.make_plan(scene(spectrum=sea(**{key: 1e-19})), "photon", "cpu", 1)


@pytest.mark.parametrize("extreme", [{"period": 1e-18}, {"wind_speed": 1e-18}, {"wind_speed": 1e18}, {"fetch": 1e18},
                                     {"fetch": 1e-18}, {"loop": 1e-18}, {"loop": 1e18}, {"spreading": 1e-18},
                                     {"direction": 1e18}, {"period": 1e18}])  # fmt: skip
def test_extremes_are_planned_or_refused(extreme):
    """Without a number that is not finite, and without a warning of NumPy's."""
    with np.errstate(all="raise", under="ignore"):
        try:
            made = wc.make_plan(scene(spectrum=sea(**extreme)), "photon", "cpu", 1).facts.basin
        except wc.InputError:
            return
    assert np.isfinite([made.max_slope, made.max_height, made.share]).all()


def test_a_sea_comes_back_from_its_text():
    from warp_caustics.scene import parse_scene

    what = scene(spectrum=sea(loop=4.0, direction=20.0, spreading=5.0))
    assert parse_scene(what.to_toml()) == what
    assert wc.Scene(**tables(what)) == what
