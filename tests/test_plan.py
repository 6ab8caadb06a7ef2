"""The plan: what a scene does not need is not compiled, not allocated and not launched, and people can read why."""

from __future__ import annotations

import re

import numpy as np
import pytest
import warp as wp
from scenery import FREE_METHODS, GENTLE, METHODS, bundled, save_box, save_heights, save_quad, scene, wave

import warp_caustics as wc
from oracle.cases import sunlight
from warp_caustics.kernels.beam import make_cells, make_corners
from warp_caustics.kernels.edge_cells import make_edge_cells
from warp_caustics.kernels.gather import make_columns, make_intersections, make_rows
from warp_caustics.kernels.gather_fused import make_fused, make_tile
from warp_caustics.kernels.gather_rows import make_scatter_rows
from warp_caustics.kernels.gather_scatter import make_gather_scatter
from warp_caustics.kernels.gather_terrain import make_gather_terrain
from warp_caustics.kernels.resolve import make_dry_land, make_resolve
from warp_caustics.kernels.resolve_steps import make_resolve_steps
from warp_caustics.kernels.scatter import make_scatter
from warp_caustics.kernels.scatter_waves import make_scatter_waves
from warp_caustics.kernels.torn import make_torn

KERNEL_OF_PASS = {"waves": "wave_table"}  # where a pass has not its kernel's name
FACTORIES = (
    make_cells, make_columns, make_corners, make_dry_land, make_edge_cells, make_fused, make_gather_scatter,
    make_gather_terrain, make_intersections, make_resolve, make_resolve_steps, make_rows, make_scatter,
    make_scatter_rows, make_scatter_waves, make_tile, make_torn,
)  # fmt: skip
KILOBYTE = 1024  # reports of memory are in kilobytes to two digits
REPORT_ROUNDING = 0.02 * KILOBYTE
UNITS = {"B": 1, "KB": KILOBYTE, "MB": KILOBYTE**2}

SHALLOWS = {"terrain": {"base": 0.55, "slope": (0.3, 0.1)}}  # comes out of the water inside the map
HILLS = {"terrain": {"base": 0.2, "waves": [wave(0.1, 9.0, 0.0)]}}  # a ray can pass a crest by and land behind it
STEEP, CHOPPY = [wave(0.8 / 6.0, 6.0, 0.0)], [wave(0.2, 10.0, 0.0)]
LOW_SUN = sunlight(75.0)


def plan_of(what, method="beam"):
    return wc.make_plan(what, method, "cpu", 1)


def names(plan):
    return {buffer.name for buffer in plan.buffers}


def shape(plan, name):
    return next(buffer.shape for buffer in plan.buffers if buffer.name == name)


def reason(plan, what):
    return next(one for one in plan.facts.reasons if one.what == what)


# A need, what is said of it, a scene that has it not, and one that has it and is otherwise the same.
NEEDS = {
    "Fresnel": ({}, {"medium": {"ior": 1.333, "fresnel": True}}),
    "attenuation": ({}, {"medium": {"ior": 1.333, "absorption": 0.1}}),
    "transport by colour": (
        {"medium": {"ior": 1.333, "absorption": 0.1}},
        {"medium": {"ior": 1.333, "absorption": (0.3, 0.1, 0.0)}},
    ),
    "self-shadow": ({"direction": sunlight(60.0)}, {"waves": STEEP, "direction": LOW_SUN}),
    "exit through the surface": ({"direction": sunlight(60.0)}, {"waves": CHOPPY, "direction": LOW_SUN}),
    "march over terrain": ({}, {"receiver": {"terrain": {"base": 0.0}}}),
    "shore": ({"receiver": {"terrain": {"base": 0.0, "slope": (0.3, 0.1)}}}, {"receiver": SHALLOWS}),
    "torn cells": ({"receiver": {"terrain": {"base": 0.2}}}, {"receiver": HILLS, "direction": LOW_SUN}),
    "sun's disk": ({}, {"sun": {"angular_diameter": 5.0}}),
}


@pytest.mark.parametrize("need", NEEDS)
@pytest.mark.parametrize("method", FREE_METHODS)
def test_each_need_is_seen_and_said_both_ways(need, method):
    without, with_it = ({"waves": GENTLE, **changes} for changes in NEEDS[need])
    plain, full = plan_of(scene(**without), method), plan_of(scene(**with_it), method)
    assert not reason(plain, need).kept
    assert reason(full, need).kept
    assert reason(plain, need).why
    assert reason(plain, need).why != reason(full, need).why
    for plan, heading in ((plain, "left out"), (full, "kept")):
        section = str(plan).split("\nkept\n")[1].split("\nbuffers\n")[0]
        kept, left_out = section.split("left out\n")
        assert need in (kept if heading == "kept" else left_out)


def test_files_and_meshes_are_needs_too(tmp_path):
    flat = save_heights(tmp_path, "flat", np.zeros((9, 9)), (-20.0, -20.0), (40.0, 40.0))
    waves, water = plan_of(scene(GENTLE)), plan_of(scene(height_map=flat))
    assert not reason(waves, "surface by height map").kept
    assert reason(water, "surface by height map").kept
    assert names(waves) - names(water) == {"waves", "column_cos", "column_sin", "row_waves"}
    assert names(water) - names(waves) == {"water_nodes"}
    assert "wave_planes" in waves.kernels
    assert "wave_planes" not in water.kernels
    bed = plan_of(scene(GENTLE, {"terrain": flat}))
    assert names(bed) - names(waves) == {"terrain_nodes"}
    floor = plan_of(scene(GENTLE, {"mesh": save_quad(tmp_path)}))
    rock = plan_of(scene(GENTLE, {"plane": 0.0, "objects": [{"mesh": save_box(tmp_path), "scale": 0.2}]}))
    for plan, name in ((floor, "mesh"), (rock, "objects")):
        assert reason(plan, "BVH").kept
        assert names(plan) - names(waves) == {name, "state", "torn_cells"}
    assert not reason(waves, "BVH").kept
    assert not rock.facts.spec.occluders  # it stays under water
    tall = [{"mesh": save_box(tmp_path), "scale": 1.5}]
    assert plan_of(scene(GENTLE, {"plane": 0.0, "objects": tall})).facts.spec.occluders


def test_buffers_follow_the_needs():
    plain = plan_of(scene(GENTLE))
    planes = shape(plain, "planes")[0]
    assert planes == 3  # where a corner lands, and its flux
    expected = {
        (("fresnel", True),): planes + 1,
        (("absorption", 0.1),): planes + 1,
        (("absorption", (0.3, 0.1, 0.0)),): planes + 3,
        (("jerlov", "II"), ("fresnel", True)): planes + 4,
    }
    for medium, count in expected.items():
        plan = plan_of(scene(GENTLE, medium={"ior": 1.333, **dict(medium)}))
        assert shape(plan, "planes")[0] == count, medium
    pixels = 40 * 28
    by_colour = plan_of(scene(GENTLE, medium={"ior": 1.333, "absorption": (0.3, 0.1, 0.0)}))
    coloured_sun = plan_of(scene(GENTLE, sun={"irradiance": (1.0, 0.9, 0.8)}))
    for plan, carried, shown in ((plain, 1, 1), (by_colour, 3, 3), (coloured_sun, 1, 3)):
        # Steps of 41 columns by 29 rows, and one more; pixels where triangles are deposited one by one.
        assert shape(plan, "map") == (carried * (41 * 29 + 1),)
        assert shape(plan_of(plan.facts.scene, "photon"), "map") == (carried * pixels,)
        assert shape(plan, "caustic_map") == (shown * pixels,)
    shadowed = plan_of(scene(STEEP, direction=LOW_SUN))
    assert names(shadowed) - names(plain) == {"state", "torn_cells"}
    assert set(shadowed.kernels) - set(plain.kernels) == {"torn"}
    shore = plan_of(scene(GENTLE, SHALLOWS))
    assert names(shore) - names(plain) == {"state", "torn_cells", "dry"}
    assert set(shore.kernels) - set(plain.kernels) == {"torn", "dry_land"}
    assert shore.bytes > plain.bytes


def test_shadows_that_are_not_wanted_are_left_out():
    shaded, bare = (plan_of(scene(STEEP, direction=LOW_SUN, self_shadow=on), "photon") for on in (True, False))
    assert shaded.facts.spec.self_shadow
    assert not bare.facts.spec.self_shadow
    assert "false" in reason(bare, "self-shadow").why
    assert bare.facts.spec.faces_away  # what faces away is still unlit


def test_every_direction_of_the_sun_is_launched():
    one, many = plan_of(scene(GENTLE)), plan_of(scene(GENTLE, sun={"angular_diameter": 5.0}))
    directions = len(many.facts.suns)
    assert directions > 5
    assert one.launches == 3 + 1
    assert many.launches == 3 * directions + 1
    assert shape(many, "suns") == (directions,)
    assert many.kernels == one.kernels


def test_pool_needs_less_than_beach():
    for method in FREE_METHODS:
        pool, beach = (plan_of(bundled(name), method) for name in ("pool", "beach"))
        assert len(pool.program.passes) <= len(beach.program.passes)
        assert len(pool.kernels) < len(beach.kernels)
        assert pool.launches < beach.launches
        assert len(pool.buffers) < len(beach.buffers)
        assert pool.bytes < beach.bytes
        assert sum(r.kept for r in pool.facts.reasons) < sum(r.kept for r in beach.facts.reasons)


def test_the_plan_in_print():
    for name in wc.bundled_scenes():
        plan = plan_of(bundled(name))
        text = str(plan)
        assert text.startswith(
            f"{name}: method beam (samples_per_pixel = 1.0, refine = True, deposit = edges) on cpu, 1 thread(s)\n"
        )
        for step in plan.program.passes:
            assert re.search(rf"^  {step.name} +\d+ launch\(es\)  \S", text, re.MULTILINE), step.name
        for one in plan.facts.reasons:
            assert f"  {one.what:<28}{one.why}\n" in text
        for buffer in plan.buffers:
            assert re.search(rf"^  {buffer.name} .* bytes", text, re.MULTILINE), buffer.name
        summary = f"{plan.launches} launches, {len(plan.kernels)} kernels, {plan.bytes:,} bytes"
        assert text.splitlines()[-1 - len(plan.warnings)] == summary
    warned = scene(GENTLE, medium={"ior": (1.33, 1.34, 1.35)})
    assert str(plan_of(warned)).splitlines()[-1].startswith("warning: medium.ior")


# --- the plan is what is done ---------------------------------------------------------------------------------------


def no_graphs(*args, **kwargs):
    """Stand in for the beginning of a capture: launches are then made one by one, and can be counted."""
    raise RuntimeError("no graphs here")


class Watch:
    """Kernels recorded for launching, and launches of a frame."""

    def __init__(self, monkeypatch):
        self.kernels, self.frame = [], 0
        record, launch = wp.launch, wp.Launch.launch

        def recording(kernel, *args, **kwargs):
            self.kernels.append(kernel.func.__name__)
            return record(kernel, *args, **kwargs)

        def launching(command, *args, **kwargs):
            self.frame += 1
            return launch(command, *args, **kwargs)

        monkeypatch.setattr(wp, "capture_begin", no_graphs)
        monkeypatch.setattr(wp, "launch", recording)
        monkeypatch.setattr(wp.Launch, "launch", launching)


PLANNED = [
    *((name, method) for name in ("pool", "beach", "tank") for method in FREE_METHODS),
    ("pool", "gather"),
    ("beach", "gather"),
]


@pytest.mark.parametrize(("name", "method"), PLANNED)
def test_kernels_and_launches_are_those_of_the_plan(device, name, method, monkeypatch):
    watch = Watch(monkeypatch)
    renderer = wc.Renderer(bundled(name), method, device, threads=1)
    planned = [KERNEL_OF_PASS.get(kernel, kernel) for kernel in renderer.plan.kernels]
    assert set(watch.kernels) == set(planned)
    assert len(watch.kernels) == renderer.plan.launches
    for time in (0.0, 1.0):
        watch.frame = 0
        renderer.render(time)
        assert watch.frame == renderer.plan.launches
    assert ("torn" in watch.kernels) == (method == "beam" and name != "pool")
    assert ("dry_land" in watch.kernels) == (name == "beach")


def test_kernels_that_are_left_out_are_never_built(device):
    def built():
        return {factory.__name__: factory.cache_info().misses for factory in FACTORIES}

    calm = scene(GENTLE, resolution=(24, 20))
    before = built()
    wc.Renderer(calm, "photon", device, threads=1)
    after = built()
    assert {name for name in after if after[name] > before[name]} <= {
        "make_scatter",
        "make_scatter_waves",
        "make_resolve",
    }
    wc.Renderer(calm, "beam", device, threads=1)
    last = built()
    assert {name for name in last if last[name] > after[name]} <= {
        "make_corners",
        "make_edge_cells",
        "make_resolve_steps",
    }
    wc.Renderer(calm, "beam", device, threads=1)
    assert built() == last  # a second one takes the kernels of the first


def allocated(report, device):
    """Bytes of all allocations on a device, from Warp's report."""
    match = re.search(rf"Total allocations:.*?\n\s+{re.escape(device)}\s+\d+ \(([\d.]+) (B|KB|MB)\)", report, re.DOTALL)
    return float(match[1]) * UNITS[match[2]] if match else 0.0


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("absorption", [0.0, (0.3, 0.1, 0.0)])
def test_bytes_are_those_allocated(device, method, absorption):
    medium = {"ior": 1.333, "absorption": absorption}
    what = scene(GENTLE, medium=medium, resolution=(60, 50), sun={"irradiance": (1.0, 1.0, 0.5)})
    wc.Renderer(what, method, device, threads=1)  # compiled, so that only the scene's own arrays are counted
    reports = []
    with wp.ScopedMemoryTracker("renderer", report_func=reports.append) as tracker:
        tracker.clear()
        renderer = wc.Renderer(what, method, device, threads=1)
    plan = renderer.plan
    assert plan.bytes > 40 * KILOBYTE
    assert allocated(reports[-1], device) == pytest.approx(plan.bytes, rel=1e-3, abs=REPORT_ROUNDING)


def test_a_plan_allocates_nothing(device):
    reports = []
    with wp.ScopedMemoryTracker("plan", report_func=reports.append) as tracker:
        tracker.clear()
        wc.make_plan(bundled("beach"), "beam", device)
    assert allocated(reports[-1], device) == 0.0


def test_threads_take_a_map_and_buffers_each():
    tall = scene(GENTLE, resolution=(20, 300), size=(0.2, 3.0))
    one, two, many = (wc.make_plan(tall, "beam", "cpu", threads) for threads in (1, 2, 99))
    shared = sum(buffer.bytes for buffer in one.buffers if not buffer.per_lane)
    assert two.threads == 2
    assert two.bytes - shared == 2 * (one.bytes - shared)
    assert many.threads == many.program.strips  # no more threads than there are strips to share out
    looks = scene(GENTLE, resolution=(20, 300), size=(0.2, 3.0), method={"gather": {"form": "two_pass"}})
    gather = wc.make_plan(looks, "gather", "cpu", 8)
    assert gather.threads == 8  # on the rows of a pass, which share a map
    assert [buffer.name for buffer in gather.buffers if gather.copies(buffer) > 1] == ["ledger"]
    assert f"x {two.threads} threads" in str(two)


def test_maps_that_a_kernel_cannot_step_over_are_one(monkeypatch):
    """Warp's strides are int32: of maps of steps of 2 GB each, a kernel finds the first alone."""
    monkeypatch.setattr("warp_caustics.device.free_memory", lambda device: 2**40)
    monkeypatch.setattr("warp_caustics.device.resolve_threads", lambda threads, device: 2)
    large = scene((), resolution=(2**14, 2**14))
    assert wc.make_plan(large, "beam", "cpu").threads == 1
    with pytest.raises(wc.InputError, match="threads: 2 of them have a map of 16384 x 16384 pixels"):
        wc.make_plan(large, "beam", "cpu", threads=2)
    assert wc.make_plan(large, "photon", "cpu", threads=2).threads == 2
