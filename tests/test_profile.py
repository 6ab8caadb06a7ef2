"""Profiles: every launch in one pass, sums that add up, bytes and operations counted by hand, and the command line."""

from __future__ import annotations

import json
import time
from pathlib import Path

import numpy as np
import pytest
import warp as wp
from scenery import GENTLE, scene
from test_simulation_scene import GRID, SPECTRAL

import warp_caustics as wc
from warp_caustics import profiling
from warp_caustics.cli import main
from warp_caustics.dispersion import DispersedPlan
from warp_caustics.errors import InputError
from warp_caustics.kernels.box_blur import make_box_blur
from warp_caustics.kernels.gather import make_rows
from warp_caustics.kernels.multiply_add import CHAINS, FACTOR, TERM, multiply_add
from warp_caustics.kernels.resolve import make_resolve
from warp_caustics.kernels.scatter import make_scatter
from warp_caustics.kernels.spec import Spec
from warp_caustics.profiling import Limits, trace
from warp_caustics.profiling.assemble import Assembly
from warp_caustics.profiling.count import counted_frame
from warp_caustics.profiling.tally import Tally, counted_source, transform_operations
from warp_caustics.profiling.trace import TracedFrame, TracedStage, traced_frame, watched_launches
from warp_caustics.profiling.traffic import reads_output, traffic
from warp_caustics.recording import FillCommand, bind

EYE = {"position": [1.0, -0.6, 1.4], "target": [1.0, 0.55, 0.0], "vertical_fov": 40.0, "resolution": [24, 16]}
SLOW, FAST = Limits(1, 1e9, 1e9), Limits(2, 2e9, 2e9)
ROUNDING = 1e-9  # of sums in float64, taken in another order
WAVE_BYTES, SUN_BYTES = 28, 20

CASES = {
    "beam": {},
    "photon": {},
    "gather": {},
    "area_ratio": {},
    "differential": {},
    "sample": {},
    "cascaded": {"camera": EYE, "method": {"cascaded": {"count": 2, "resolution": 16}}},
    "pattern": {"camera": EYE},
    "photon of three channels": {"medium": {"ior": (1.331, 1.333, 1.34), "dispersion": "traced"}},
    "photon in spectral water": {"waves": (), "simulation": SPECTRAL},
    "photon in grid water": {"waves": (), "simulation": GRID},
}


@pytest.fixture
def quick(monkeypatch):
    """Few frames, and limits that nobody measures."""
    monkeypatch.setattr(trace, "LEAST_FRAMES", 1)
    monkeypatch.setattr(trace, "ENOUGH_SECONDS", 0.0)
    monkeypatch.setattr(profiling, "_limits", lambda device, threads: (SLOW, FAST) if threads > 1 else (SLOW,))


@pytest.fixture
def uncounted(monkeypatch):
    """Operations are left out: to build every kernel a second time takes minutes."""
    monkeypatch.setattr(profiling, "_operations", lambda renderer, time, fps: ({}, {}))


def made(name: str) -> wc.Scene:
    return scene(**{"waves": GENTLE, "resolution": (16, 12), **CASES[name]})


def launches_of(nodes) -> dict[str, int]:
    counts: dict[str, int] = {}
    for node in nodes:
        counts[node.name] = counts.get(node.name, 0) + node.launches
    return counts


# --- the tree --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("threads", [1, 2])
def test_passes_are_those_of_the_plan(name, threads, device, quick, uncounted):
    what, method = made(name), name.split()[0]
    profile = wc.profile(what, method, device=device, threads=threads)
    plan = wc.make_plan(what, method, device=device, threads=threads)
    plans = plan.plans if isinstance(plan, DispersedPlan) else (plan,)
    expected: dict[str, int] = {}
    for one in plans:
        for step, count, _ in one.program.pass_lines(one.facts):
            expected[step] = expected.get(step, 0) + count
    if isinstance(plan, DispersedPlan):
        expected["stack"] = 1
    host, *parts = profile.frame.children
    assert host.name == "host"
    found = launches_of(leaf for part in parts for leaf in part.passes)
    water = {one.name for one in plans[0].water_passes if one.each != "drop"}
    assert {step for step in found if step in water} == water
    assert all(found.pop(step) > 0 for step in water)
    if "clear" not in expected:
        found.pop("clear", None)  # fills of accumulators, which the plan of a lattice does not list
    assert found.keys() == expected.keys()
    # Threads may share a launch, which is several then.
    assert all(found[step] >= count if threads > 1 else found[step] == count for step, count in expected.items())


@pytest.mark.parametrize("name", CASES)
def test_the_parts_add_up(name, device, quick, uncounted):
    profile = wc.profile(made(name), name.split()[0], device=device, threads=2)

    def check(node):
        for child in node.children:
            check(child)
        if node.children:
            for what in ("launches", "bytes_read", "bytes_written"):
                assert getattr(node, what) == sum(getattr(child, what) for child in node.children), (node.name, what)
            parts = sum(child.milliseconds for child in node.children)
            assert node.milliseconds == pytest.approx(parts, rel=ROUNDING)
        else:
            assert node.does

    check(profile.frame)
    assert profile.untraced_milliseconds > 0.0
    renderer = wc.Renderer(made(name), name.split()[0], device=device, threads=2)
    commands = sum(len(lane) for stage in renderer.stages for lane in stage)
    frame_launches = sum(part.launches for part in profile.frame.children if part.name != "water")
    assert frame_launches == commands
    plan = renderer.plan
    assert sum(use.bytes for use in profile.memory.buffers) == profile.memory.planned == plan.bytes
    assert profile.memory.peak >= 0.9 * plan.bytes  # meshes of cascades are shared, and counted once each
    assert profile.memory.frame_allocations == 0


def test_lanes_share_the_time_of_their_stage():
    """Two passes in lanes of 4 and 2 s, in a stage that took 5 s: they add up to it, as their own times do to 6."""
    array = wp.zeros(4, dtype=float, device="cpu")
    first, second = FillCommand(array, 0, "first"), FillCommand(array, 0, "second")
    stage = TracedStage([[(first, 3.0), (second, 1.0)], [(first, 2.0)]], 5.0)
    plan = wc.make_plan(made("photon"), "photon", device="cpu", threads=2)
    frame = Assembly(plan, (SLOW, FAST), {(False, "first"): 10**9}, {}).frame(
        TracedFrame(0.5, TracedStage([[]], 0.0), [stage])
    )
    host, staged = frame.children
    assert host.milliseconds == 500.0
    assert staged.lanes == (4000.0, 2000.0)
    assert [child.milliseconds for child in staged.children] == pytest.approx([1e3 * 25 / 6, 1e3 * 5 / 6])
    assert staged.milliseconds == pytest.approx(5000.0)
    assert staged.children[0].launches == 2
    # A billion operations at two billion a second, on two threads; 16 bytes are no matter.
    assert staged.children[0].floor_milliseconds == pytest.approx(500.0)
    assert staged.children[0].limit == "arithmetic"
    assert staged.children[1].limit == "memory"
    assert staged.children[1].floor_milliseconds == pytest.approx(1e3 * 16 / 2e9)
    assert staged.children[1].operations is None
    assert staged.limit is None


def test_a_step_of_water_is_a_sweep():
    """A launch that is made three times moves its array three times, two bands of one array once together."""
    launch = recorded(multiply_add, 2, 1, zeros(2))
    plan = wc.make_plan(made("photon"), "photon", device="cpu", threads=1)
    for commands, written in (([launch] * 3, 3 * 8), ([launch, recorded(multiply_add, 2, 1, launch.fwd_args[1])], 8)):
        water = TracedStage([[(command, 1.0) for command in commands]], 2.0)
        frame = Assembly(plan, (SLOW,), {(True, "multiply_add"): 10}, {(True, "multiply_add"): 1}).frame(
            TracedFrame(0.0, water, [])
        )
        (swept,) = frame.children[1].children
        assert (swept.bytes_read, swept.bytes_written) == (0, written)
        assert swept.launches == len(commands)
        assert swept.operations == 10 * len(commands)
        assert swept.milliseconds == pytest.approx(2000.0)


def test_it_is_the_same_as_json(device, quick, uncounted, tmp_path):
    profile = wc.profile(made("photon"), "photon", device=device, threads=2)
    assert wc.Profile.from_json(profile.to_json()) == profile
    path = profile.save(tmp_path / "photon.json")
    table = json.loads(path.read_text())
    assert table["method"] == "photon"
    assert table["frame"]["children"][0]["name"] == "host"
    assert table["frame"]["floor_share"] == profile.frame.floor_share
    assert table["memory"]["buffers"][0]["bytes"] == profile.memory.buffers[0].bytes


# --- the traced frame ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["beam", "photon in grid water"])
def test_a_traced_frame_is_the_frame_and_leaves_nothing_behind(name, device):
    renderer = wc.Renderer(made(name), name.split()[0], device=device, threads=2)
    plain = wp.Launch.launch
    expected = renderer.render(0.2).caustic_map.numpy().copy()
    renderer.render(0.1)
    traced = traced_frame(renderer, 0.2)
    np.testing.assert_array_equal(renderer.result().caustic_map, expected)
    assert wp.Launch.launch is plain
    assert traced.seconds > 0.0
    assert bool(traced.water.lanes[0]) == (renderer.plan.facts.basin is not None)


def test_launches_are_watched_within_the_block_alone(device):
    array = wp.zeros(1, dtype=float, device=device)
    launch = wp.launch(multiply_add, dim=1, inputs=[1], outputs=[array], device=device, record_cmd=True)
    seen = []
    with pytest.raises(KeyError), watched_launches(lambda command, run: (seen.append(command), run())):
        launch.launch()
        raise KeyError
    launch.launch()
    assert seen == [launch]
    assert array.numpy()[0] > 0.0


# --- bytes -----------------------------------------------------------------------------------------------------------


def test_bytes_of_a_small_pass_by_hand(device):
    lanes, pixels = 3, 10
    values = {
        "lanes": wp.zeros((lanes, pixels), dtype=wp.float64, device=device),
        "scale": wp.vec3d(1.0, 1.0, 1.0),
        "map": wp.zeros(pixels, dtype=float, device=device),
        "begin": 0,
    }
    resolve = bind(make_resolve("float64", 1, 1), (pixels,), values, device)
    moved = traffic([resolve])
    assert (moved.read, moved.written) == (8 * lanes * pixels, 4 * pixels)
    # Bands and strips share their arrays.
    assert traffic([resolve, resolve]) == moved
    fill = FillCommand(values["lanes"])
    assert (traffic([fill]).read, traffic([fill]).written) == (0, 8 * lanes * pixels)


def test_arrays_in_structs_are_read(device):
    """A table of waves: of the structs' arrays, the waves alone have elements here."""
    renderer = wc.Renderer(made("photon"), "photon", device=device, threads=1)
    table = next(c for c in renderer.stages[0][0] if getattr(c, "pass_name", "") == "wave_planes")
    assert traffic([table]).read == len(GENTLE) * WAVE_BYTES + SUN_BYTES


def test_bytes_of_what_is_added_to_by_hand():
    """Three integers and one sum are read, the sum and three numbers written; a matrix is no array."""
    launch = recorded(by_hand, 3, zeros(3, int), wp.mat33(), zeros(1, wp.float64), zeros(3))
    moved = traffic([launch])
    assert (moved.read, moved.written) == (3 * 4 + 8, 8 + 3 * 4)


def test_what_is_added_to_is_read_too():
    scatter, rows, blur = make_scatter(Spec()), make_rows(1), make_box_blur(0, 1)
    assert reads_output(scatter, "map_out")
    assert reads_output(scatter, "ledger_out")
    assert reads_output(rows, "channel_out")
    assert not reads_output(blur, "blurred_out")


# --- operations ------------------------------------------------------------------------------------------------------


@wp.func
def squared(v: wp.vec3) -> float:
    return wp.dot(v, v)


@wp.kernel(enable_backward=False)
def by_hand(counts: wp.array[int], turn: wp.mat33, total_out: wp.array[wp.float64], sum_out: wp.array[float]):
    """Integers, comparisons and roundings count nothing."""
    i = wp.tid()
    v = wp.vec3(1.0, 2.0, 3.0)
    sum = wp.float32(0.0)
    for _j in range(counts[i]):
        sum += wp.sqrt(squared(v)) / 2.0  # 5 of the dot product, a root, a division, a sum
        sum = wp.max(sum, 0.0)
    if counts[i] == 3:
        v = turn * v  # 3 dot products of 5
        v = 2.0 * v  # 3
    wp.atomic_add(total_out, i * 0, wp.float64(sum))  # 1
    sum_out[i] = wp.floor(v[0] * v[1] - v[2])  # 2


@wp.func_native(
    """
    // flops: 1
    return value * value;
    """
)
def declared(value: float) -> float:
    """Say its own count."""


@wp.func_native("return value * value;")
def silent(value: float) -> float:
    """Say nothing."""


@wp.kernel(enable_backward=False, module="unique")
def with_declared(values_out: wp.array[float]):
    values_out[wp.tid()] = 1.0 + declared(2.0)


@wp.kernel(enable_backward=False, module="unique")
def with_silent(values_out: wp.array[float]):
    values_out[wp.tid()] = 1.0 + silent(2.0)


def recorded(kernel, dim, *arguments):
    return wp.launch(kernel, dim=dim, inputs=list(arguments), device="cpu", record_cmd=True)


def zeros(count, dtype=float):
    return wp.zeros(count, dtype=dtype, device="cpu")


def test_operations_of_a_kernel_by_hand():
    counts, total, sums = wp.array([0, 3, 5], dtype=int, device="cpu"), zeros(1, wp.float64), zeros(3)
    launch = recorded(by_hand, 3, counts, wp.mat33(np.eye(3)), total, sums)
    launch.launch()
    expected, expected_sums = total.numpy().copy(), sums.numpy().copy()
    total.zero_()
    sums.zero_()
    tally = Tally()
    assert tally.launch(launch) == 8 * (0 + 3 + 5) + (15 + 3) + 3 * 3
    # It did what the plain launch does.
    np.testing.assert_array_equal(total.numpy(), expected)
    np.testing.assert_array_equal(sums.numpy(), expected_sums)
    assert tally.launch(launch) == 8 * 8 + 18 + 9


def test_native_code_says_its_own_count():
    assert Tally().launch(recorded(with_declared, 7, zeros(7))) == 2 * 7
    values = zeros(7)
    assert Tally().launch(recorded(with_silent, 7, values)) is None
    np.testing.assert_array_equal(values.numpy(), 5.0)  # it ran all the same


def test_operations_of_multiply_adds():
    steps, totals = 9, zeros(2)
    launch = recorded(multiply_add, 2, steps, totals)
    assert Tally().launch(launch) == 2 * 2 * CHAINS * steps
    sums = 1.0 / np.arange(1, CHAINS + 1)
    for _ in range(steps):
        sums = sums * FACTOR + TERM
    np.testing.assert_allclose(totals.numpy(), sums.sum(), rtol=1e-5)  # float32, in any order


def test_transforms_are_counted_by_their_length():
    assert transform_operations(8) == 5 * 8 * 3
    source = '#include "builtin.h"\n\ntile_ifft(0, 0, wp::vec2d, 0, 1, 8, var_7);\n'
    assert f"tally_count += {5 * 8 * 3};" in counted_source(source)
    assert counted_source(source.replace("tile_ifft", "tile_matmul")) is None


def test_operations_of_a_frame_grow_with_its_samples():
    """Four times the photons through the same kernel: each takes the same, and those at the border less."""
    counts = []
    for photons in (1.0, 4.0):
        what = scene(waves=GENTLE, resolution=(16, 12), method={"photon": {"photons_per_pixel": photons}})
        renderer = wc.Renderer(what, "photon", device="cpu", threads=1)
        operations, launches = counted_frame(renderer, 0.0)
        assert launches[False, "scatter_waves"] == 1
        counts.append(operations[False, "scatter_waves"] / renderer.plan.samples)
    assert counts[1] == pytest.approx(counts[0], rel=0.1)
    assert counts[0] > len(GENTLE) * 9  # of a wave: four products and two sums for its height and slope, and more


# --- wrong use, and the command line ---------------------------------------------------------------------------------


def test_the_reference_has_no_profile():
    with pytest.raises(InputError, match="reference"):
        wc.profile(made("photon"), "reference")


def test_nothing_is_measured_of_a_bad_scene():
    with pytest.raises(InputError, match="beem"):
        wc.profile(made("photon"), "beem")


@pytest.fixture
def small(tmp_path, monkeypatch) -> Path:
    """A scene of few pixels, in an empty working folder."""
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "small.toml"
    path.write_text(
        "water.waves = [{ amplitude = 0.02, wavevector = [5.0, 2.0] }]\nwater.level = 1.0\nreceiver.plane = 0.0\n"
        "sun.direction = [0.2, 0.1, -1.0]\nmedium.ior = 1.333\n"
        "map = { origin = [0, 0], size = [1, 1], resolution = [16, 16] }\n"
    )
    return path


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_render_with_a_profile(small, capfd, quick, device):
    tokens = ["render", str(small), "--method", "photon", "--profile", "--device", device, "--time", "0.5"]
    assert main([*tokens, "-o", "map.exr"]) == 0
    out, err = capfd.readouterr()
    assert err == ""
    assert names(small.parent) == {"small.toml", "map.exr", "map.profile.json"}
    for word in ("scatter", "resolve", "host", "floor", "frame without tracing", "GB/s", "Gflop/s", "planned", "peak"):
        assert word in out
    profile = wc.Profile.from_json(Path("map.profile.json").read_text())
    assert (profile.scene, profile.method, profile.device, profile.time) == ("small", "photon", device, 0.5)
    assert profile.frame.operations > 0
    assert profile.samples == wc.make_plan(wc.load_scene(small), "photon", device=device).samples
    assert f"{profile.samples:,} samples" in out
    assert wc.load_map("map.exr").shape == (16, 16)


def test_a_profile_alone(small, quick, uncounted, capfd):
    tokens = ["render", str(small), "--method", "photon", "--profile"]
    assert main([*tokens, "-o", "times.json"]) == 0
    assert names(small.parent) == {"small.toml", "times.json"}
    assert "not known" in capfd.readouterr().out  # its operations, which this test leaves out
    assert main(tokens) == 0
    assert names(small.parent) == {"small.toml", "times.json", "small.exr", "small.profile.json"}


WRONG = {
    "a picture": (["--picture"], "--picture"),
    "a sequence": (["--frames", "2"], "--frames"),
    "two profiles": (["-o", "a.json", "-o", "b.json"], "second"),
    "a folder that is missing": (["-o", "missing/map.json"], "missing"),
    "the reference": (["--method", "reference"], "reference"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_profile_of_that_is_refused(case, small, capfd, quick):
    tokens, word = WRONG[case]
    assert main(["render", str(small), "--profile", *tokens]) == 2
    out, err = capfd.readouterr()
    assert out == ""
    assert err.startswith("error: ")
    assert word in err
    assert names(small.parent) == {"small.toml"}


def test_json_is_for_profiles_alone(small, capfd):
    assert main(["render", str(small), "-o", "map.json"]) == 2
    assert ".exr" in capfd.readouterr().err


def test_limits_are_measured(monkeypatch):
    """What is copied and added takes some time: no limit is endless or nothing."""
    from warp_caustics.profiling import _limits, peak

    monkeypatch.setattr(peak, "CPU_STEPS", 2**10)
    start = time.perf_counter()
    one, two = _limits("cpu", 2)
    seconds = time.perf_counter() - start
    assert (one.threads, two.threads) == (1, 2)
    for limit in (one, two):
        assert limit.bandwidth > 2.0 * 2**28 / seconds  # a copy of so many bytes was made within that
        assert 0.0 < limit.operations < float("inf")


def test_a_traced_frame_is_of_its_time(device):
    renderer = wc.Renderer(made("photon"), "photon", device=device, threads=1)
    first = renderer.render(0.0).caustic_map.numpy().copy()
    traced_frame(renderer, 1.0)
    assert not np.array_equal(renderer.result().caustic_map, first)
