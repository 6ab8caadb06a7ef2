"""The renderer: threads, number formats, frames, time, graphs, and the front door."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
import warp as wp
from scenery import FREE_METHODS, GENTLE, METHODS, bundled, relative_l2, render, scene, tables, wave

import warp_caustics as wc
from oracle import angular_frequency
from oracle.cases import CASES

FORMATS = ("float32", "float64", "fixed")
ANOTHER_ORDER = 1e-6  # float32 sums of some tens of cells a pixel, taken in another order
# A float32 map keeps 24 bits of a sum and loses some to each of its tens of terms; a fixed one has steps of 2^-32.
OTHER_FORMAT = 1e-6
SAME_WATER = 2e-5  # a phase given, or reached in time: float32 phases of some radians
TALL = {"resolution": (20, 300), "size": (0.2, 3.0)}  # strips for several threads, whatever the method


def tall(accumulate="float32", **more):
    return scene(GENTLE, method={"accumulate": accumulate}, **TALL, **more)


def frame(renderer, time):
    """Render a frame, and give its map as an array of its own."""
    return renderer.render(time).caustic_map.numpy().copy()


# --- threads and number formats -------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", METHODS)
def test_threads_agree(method):
    maps, energies = [], []
    for threads in (1, 2, 8):
        renderer = wc.Renderer(tall(), method, "cpu", threads)
        assert renderer.plan.threads == threads
        maps.append(frame(renderer, 0.4))
        energies.append(renderer.result().energy)
    for image, energy in zip(maps[1:], energies[1:], strict=True):
        assert relative_l2(image, maps[0]) < ANOTHER_ORDER
        assert energy.received == pytest.approx(energies[0].received, rel=ANOTHER_ORDER)
        assert energy.emitted == pytest.approx(energies[0].emitted, rel=1e-12)


@pytest.mark.parametrize("method", METHODS)
def test_each_thread_adds_to_a_map_of_its_own(method):
    # Sums on a CPU are plain additions: two threads on one map would now and then lose light, and no test would see it.
    renderer = wc.Renderer(tall(), method, "cpu", 2)
    renderer.render(0.4)
    lanes = np.abs(renderer._recording.maps.numpy())  # steps of a beam add up to nothing along a row
    assert lanes.shape[0] == 2
    assert (lanes.sum(axis=1) > 0.1 * lanes.sum()).all()
    ledgers = renderer._recording.ledgers.numpy()
    assert (ledgers[:, 0].sum(axis=1) > 0.1 * ledgers[:, 0].sum()).all()


@pytest.mark.parametrize("method", FREE_METHODS)
def test_fixed_point_is_the_same_to_the_bit_for_any_threads_and_every_run(method):
    maps = [frame(wc.Renderer(tall("fixed"), method, "cpu", threads), 0.4) for threads in (1, 2, 8, 1)]
    for image in maps[1:]:
        np.testing.assert_array_equal(image, maps[0])


@pytest.mark.parametrize("method", FREE_METHODS)
def test_fixed_point_is_the_same_to_the_bit_on_every_run(device, method):
    renderer = wc.Renderer(tall("fixed"), method, device)
    first = frame(renderer, 0.4)
    frame(renderer, 1.0)
    np.testing.assert_array_equal(frame(renderer, 0.4), first)
    np.testing.assert_array_equal(frame(wc.Renderer(tall("fixed"), method, device), 0.4), first)


@pytest.mark.parametrize("method", FREE_METHODS)
def test_number_formats_agree(device, method):
    maps = {name: render(tall(name), method, device).caustic_map for name in FORMATS}
    for name in ("float64", "fixed"):
        assert maps[name].dtype == np.float32
        assert relative_l2(maps["float32"], maps[name]) < OTHER_FORMAT
    # Fixed point has the beam's triangles one by one: so must the float64 map, where sums alone are to differ.
    pieces = {"accumulate": "float64", "beam": {"deposit": "triangles"}}
    by_triangles = render(scene(GENTLE, method=pieces, **TALL), method, device).caustic_map
    assert relative_l2(maps["fixed"], by_triangles) < OTHER_FORMAT / 10.0


def test_threads_agree_where_cells_are_torn_and_the_sun_has_a_disk():
    torn = wc.Scene(**replace(CASES["shaded"], resolution=(24, 150)).scene_dict())
    disk = tall(sun={"angular_diameter": 2.0})
    assert len(wc.make_plan(disk, "beam", "cpu").facts.suns) > 4
    for what in (torn, disk):
        one, three = (wc.Renderer(what, "beam", "cpu", threads) for threads in (1, 3))
        assert three.plan.threads == 3
        assert relative_l2(frame(three, 0.0), frame(one, 0.0)) < ANOTHER_ORDER


# --- frames ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", METHODS)
def test_frames_do_not_depend_on_those_before_them(device, method):
    def fresh(time):
        return render(scene(GENTLE), method, device, time)

    renderer = wc.Renderer(scene(GENTLE), method, device, threads=1)
    seen = {}
    for time in (0.0, 1.3, 0.0, -7.0, 1.3):
        renderer.render(time)
        result = renderer.result()
        assert result.time == time
        expected = fresh(time)
        assert relative_l2(result.caustic_map, expected.caustic_map) < ANOTHER_ORDER
        for name, value in expected.energy.items():
            assert result.energy[name] == pytest.approx(value, rel=ANOTHER_ORDER, abs=ANOTHER_ORDER), name
        if time in seen:
            assert relative_l2(result.caustic_map, seen[time]) < ANOTHER_ORDER
        seen[time] = result.caustic_map
    assert relative_l2(seen[0.0], seen[1.3]) > 0.05


def test_dry_land_is_lit_afresh_in_every_frame(device):
    renderer = wc.Renderer(bundled("beach"), "photon", device, threads=1)
    for _ in range(3):
        renderer.render(0.5)
    again, once = renderer.result(), render(bundled("beach"), "photon", device, 0.5)
    np.testing.assert_allclose(again.energy.dry, once.energy.dry, rtol=1e-6)
    assert relative_l2(again.caustic_map, once.caustic_map) < ANOTHER_ORDER


def test_a_result_keeps_its_frame(device):
    renderer = wc.Renderer(scene(GENTLE), "photon", device, threads=1)
    renderer.render(0.0)
    result = renderer.result()
    kept = result.caustic_map.copy()
    renderer.render(2.0)
    np.testing.assert_array_equal(result.caustic_map, kept)
    assert renderer.result().time == 2.0


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("threads", [1, 2])
def test_a_frame_allocates_nothing(device, method, threads):
    renderer = wc.Renderer(tall(), method, device, threads)
    renderer.render(0.0)
    reports = []
    with wp.ScopedMemoryTracker("frames", report_func=reports.append) as tracker:
        wp.zeros(1000, dtype=float, device=device)
        tracker.report()
        tracker.clear()
        for time in (0.1, 0.2):
            renderer.render(time)
    assert re.search(r"Total allocations:\n +\S", reports[0])
    assert re.search(r"Total allocations:\n +Peak usage:", reports[-1]), reports[-1]


def test_a_frame_is_on_the_device_and_a_result_is_not(device):
    renderer = wc.Renderer(scene(GENTLE, sun={"irradiance": (1.0, 0.5, 0.25)}), "photon", device, threads=1)
    shown = renderer.render(0.25)
    assert isinstance(shown.caustic_map, wp.array)
    assert str(shown.caustic_map.device) == device
    assert shown.caustic_map.shape == (28, 40, 3)
    assert shown.caustic_map.dtype == wp.float32
    assert shown.time == 0.25
    result = renderer.result()
    assert type(result.caustic_map) is np.ndarray
    assert result.caustic_map.dtype == np.float32
    np.testing.assert_array_equal(result.caustic_map, shown.caustic_map.numpy())
    if device == "cpu":
        np.testing.assert_array_equal(np.from_dlpack(shown.caustic_map), result.caustic_map)


# --- time -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("given", [None, 2.5])
def test_time_moves_waves_by_their_frequency(device, method, given):
    depth, time = 0.3, 0.83
    k = np.array([4.0, -3.0])
    more = {} if given is None else {"angular_frequency": given}
    omega = angular_frequency(np.hypot(*k), depth) if given is None else given
    assert given is not None or omega < 0.96 * np.sqrt(9.81 * 5.0)  # shallow enough for the depth to tell
    moving = render(scene([wave(0.02, *k, 0.4, **more)], level=depth), method, device, time)
    still = render(scene([wave(0.02, *k, 0.4 - omega * time)], level=depth), method, device)
    assert relative_l2(moving.caustic_map, still.caustic_map) < SAME_WATER
    # They go the way of their wavevector.
    shift = omega * time / np.dot(k, k) * k
    behind = scene([wave(0.02, *k, 0.4)], level=depth, origin=(-shift[0], -shift[1]))
    assert relative_l2(render(behind, method, device).caustic_map, moving.caustic_map) < SAME_WATER
    before = render(scene([wave(0.02, *k, 0.4)], level=depth), method, device)
    assert relative_l2(moving.caustic_map, before.caustic_map) > 0.01


def test_over_a_slope_waves_go_by_the_mean_depth_of_the_map(device):
    bed, time = {"terrain": {"base": 0.2, "slope": (0.2, 0.0)}}, 0.7
    depth = 1.0 - (0.2 + 0.2 * 1.0)
    omega = angular_frequency(2.0, depth)
    moving = render(scene([wave(0.02, 2.0, 0.0)], bed), "photon", device, time)
    still = render(scene([wave(0.02, 2.0, 0.0, -omega * time)], bed), "photon", device)
    assert relative_l2(moving.caustic_map, still.caustic_map) < SAME_WATER


def test_a_water_from_a_file_stands_still(device, tmp_path):
    np.save(tmp_path / "water.npy", 0.01 * np.random.default_rng(1).normal(size=(40, 40)))
    table = {"file": str(tmp_path / "water.npy"), "origin": (-2.0, -2.0), "size": (6.0, 6.0)}
    renderer = wc.Renderer(scene(height_map=table), "photon", device, threads=1)
    assert relative_l2(frame(renderer, 5.0), frame(renderer, 0.0)) < ANOTHER_ORDER


@pytest.mark.parametrize("time", [np.nan, np.inf, -np.inf])
def test_no_time_is_no_frame(device, time):
    renderer = wc.Renderer(scene(GENTLE), "photon", device, threads=1)
    renderer.render(0.5)
    before = renderer.result()
    with pytest.raises(wc.InputError, match="time: expected"):
        renderer.render(time)
    with pytest.raises(wc.InputError, match="time: expected"):
        wc.render(scene(GENTLE), method="photon", device=device, time=time)
    assert renderer.result().time == 0.5
    np.testing.assert_array_equal(renderer.result().caustic_map, before.caustic_map)


# --- CUDA graphs ----------------------------------------------------------------------------------------------------


@pytest.mark.skipif(not wp.is_cuda_available(), reason="graphs are captured on CUDA, and there is no such device here")
@pytest.mark.parametrize("method", METHODS)
def test_a_captured_frame_replays(method):
    renderer = wc.Renderer(scene(GENTLE), method, "cuda:0")
    first, later = frame(renderer, 0.0), frame(renderer, 1.0)
    with wp.ScopedCapture("cuda:0") as capture:
        renderer.render(1.0)
    frame(renderer, 0.0)
    wp.capture_launch(capture.graph)
    replayed = renderer.result().caustic_map
    # What is written on the host before a frame belongs to the frame that is replayed.
    assert min(relative_l2(replayed, later), relative_l2(replayed, first)) < ANOTHER_ORDER


# --- the front door -------------------------------------------------------------------------------------------------


def test_scenes_names_and_paths_are_all_taken(device, tmp_path):
    what = bundled("pool", (24, 16))
    path = tmp_path / "small.toml"
    path.write_text(what.to_toml())
    expected = render(what, "photon", device).caustic_map
    for given in (what, path, str(path)):
        result = wc.render(given, method="photon", device=device, threads=1)
        np.testing.assert_allclose(result.caustic_map, expected, rtol=1e-6)
    assert wc.make_plan("pool", device=device).facts.scene == wc.load_scene("pool")
    assert wc.make_plan("pool", device=device).method == wc.load_scene("pool").method.name == "beam"


def test_the_scenes_own_method_and_the_first_frame_are_the_defaults(device):
    new = tables(scene(GENTLE))
    what = wc.Scene(**{**new, "method": {"name": "photon", "photon": {"photons_per_pixel": 2.0}}})
    result = wc.Renderer(what, device=device).result()
    assert result.method == "photon"
    assert result.plan.program.settings["photons_per_pixel"] == 2.0
    assert result.time == 0.0
    assert wc.render(what, method="beam", device=device).method == "beam"


def test_a_result_says_what_it_is(device, tmp_path):
    what = scene(GENTLE, receiver={"terrain": {"base": 0.1}})
    result = render(what, "photon", device, 0.5)
    assert (result.scene, result.method, result.device, result.time) == (what, "photon", device, 0.5)
    assert result.seconds > 0.0
    assert result.plan.bytes > 0
    assert result.warnings == []
    assert result.picture is None
    assert dict(result.energy) == {name: getattr(result.energy, name) for name in result.energy}
    assert {"emitted", "received", "over_lit"} < set(result.energy)
    path = result.save(tmp_path / "map.exr")
    np.testing.assert_array_equal(wc.load_map(path), result.caustic_map)
    with pytest.raises(wc.InputError, match=r"\.exr"):
        result.save(tmp_path / "map.jpg")
