"""Numbers at their ends, and what is no number: refused in one message, or dropped and counted, never spread."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenery import (
    FREE_METHODS,
    GENTLE,
    METHODS,
    render,
    sample_points,
    save_box,
    save_heights,
    scene,
    sum_of_waves,
    wave,
)

import warp_caustics as wc

ADDS_UP = 1e-6  # a float32 map against a float64 ledger
UNIFORM = 2e-5  # of flat water: roundings of a landing place

SHALLOWS = {"terrain": {"base": 0.55, "slope": (0.3, 0.1)}}  # a shore, so that every state of a ray is in the kernels


# --- refused --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("irradiance", [1e-310, 1e-40, 1e-19, (1.0, 1e-40, 1.0)])
def test_light_too_faint_for_float32_is_refused(irradiance):
    """A map of 1e-40 would be held in a few bits, and one of 1e-310 in none."""
    with pytest.raises(wc.InputError, match=r"sun\.irradiance.*at least 1e-18"):
        wc.make_plan(scene(GENTLE, sun={"irradiance": irradiance}), "beam", "cpu")


def test_no_light_is_a_scene():
    dark = render(scene(GENTLE, sun={"irradiance": 0.0}), "beam", "cpu")
    assert not dark.caustic_map.any()
    assert dark.energy.unaccounted == 0.0
    assert wc.make_plan(scene(GENTLE, sun={"irradiance": (1.0, 0.0, 0.0)}), "beam", "cpu")


@pytest.mark.parametrize("size", [1e19, 1e39, 1e300])
@pytest.mark.parametrize("what", ["water.height_map", "receiver.terrain", "receiver.mesh", "receiver.objects"])
def test_files_past_what_float32_squares_are_refused_by_name(what, size, tmp_path):
    """Finite in their files, they would be infinite on the device."""
    z = np.zeros((16, 16))
    z[3, 4] = size
    heights = save_heights(tmp_path, "z", z, (-20.0, -20.0), (40.0, 40.0))
    path = tmp_path / "far.obj"
    path.write_text(f"v 0 0 0\nv 1 0 0\nv 0 1 {size}\nf 1 2 3\n")
    made = {
        "water.height_map": lambda: scene(height_map=heights),
        "receiver.terrain": lambda: scene(GENTLE, {"terrain": heights}),
        "receiver.mesh": lambda: scene(GENTLE, {"mesh": str(path)}),
        "receiver.objects": lambda: scene(GENTLE, {"plane": 0.0, "objects": [{"mesh": str(path)}]}),
    }[what]()
    with pytest.raises(wc.InputError, match=rf"{what}: expected coordinates of size up to 1e\+18 m"):
        wc.make_plan(made, "beam", "cpu")


@pytest.mark.parametrize("size", [1e9, 1e17, 1e30])
@pytest.mark.parametrize("method", METHODS)
def test_huge_waves_are_refused(method, size):
    with pytest.raises(wc.InputError, match=r"map: it takes|map: light lands|water\.waves"):
        wc.make_plan(scene([wave(size, 9.0, 4.0)]), method, "cpu")


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("amplitude", [5e-324, 1e-310, 1e-40])
def test_denormal_waves_are_flat_water(device, method, amplitude):
    result = render(scene([wave(amplitude, 9.0, 4.0)], direction=(0.0, 0.0, -1.0)), method, device)
    np.testing.assert_allclose(result.caustic_map, 1.0, rtol=UNIFORM)
    assert result.energy.unaccounted < ADDS_UP


def test_troughs_below_a_plane_are_said():
    shallow, deep = (wc.make_plan(scene(GENTLE, level=level), "beam", "cpu") for level in (0.03, 1.0))
    assert any("receiver.plane: troughs" in warning for warning in shallow.warnings)
    assert not deep.warnings
    land = wc.make_plan(scene(GENTLE, {"terrain": {"base": 0.0}}, level=0.03), "beam", "cpu")
    assert not land.warnings  # a terrain knows where it is dry


# --- dropped and counted --------------------------------------------------------------------------------------------


def spoiled(renderer, bad):
    """Render a frame before and after one node of the water's height map is no number."""
    renderer.render()
    before = renderer.result()
    nodes = renderer._states[0].scene.water.surface.grid.nodes
    values = nodes.numpy()
    values[36, 30, 0] = bad
    nodes.assign(values)
    renderer.render()
    return before, renderer.result()


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("shore", [False, True])
@pytest.mark.parametrize("method", METHODS)
def test_a_height_that_is_no_number_darkens_its_own_pixels(device, method, shore, bad, tmp_path):
    """As a simulation that blows up would leave one behind: its light is dropped, and no other is touched."""
    corner, size = (-1.0, -1.0), (4.0, 4.0)
    x, y = sample_points((96, 96), corner, size)
    heights = save_heights(tmp_path, "swell", sum_of_waves(GENTLE, x, y), corner, size)
    what = scene(height_map=heights, receiver=SHALLOWS if shore else None)
    before, after = spoiled(wc.Renderer(what, method, device, threads=1), bad)
    assert np.isfinite(after.caustic_map).all()
    assert after.energy.unaccounted < ADDS_UP
    lost = before.energy.received - after.energy.received
    assert after.energy.dropped == pytest.approx(lost, rel=0.2)  # counted as what it takes in at rest
    assert 0.0 < lost < 0.03 * before.energy.received
    changed = np.abs(after.caustic_map - before.caustic_map) > 1e-6
    assert 0 < changed.sum() < 40
    assert any("no path that is known" in warning for warning in after.warnings)
    assert not any("no path that is known" in warning for warning in before.warnings)


@pytest.mark.parametrize("fresnel", [False, True])
@pytest.mark.parametrize("method", METHODS)
def test_water_that_is_no_number_anywhere_is_dropped_whole(device, method, fresnel):
    renderer = wc.Renderer(scene(GENTLE, medium={"ior": 1.333, "fresnel": fresnel}), method, device, threads=1)
    renderer._states[0]._host_waves.numpy()["amplitude"][1] = np.nan
    renderer.render()
    result = renderer.result()
    assert not result.caustic_map.any()
    assert result.energy.emitted > 0.0
    assert result.energy.dropped == pytest.approx(result.energy.emitted)
    assert result.energy.unaccounted < ADDS_UP


# --- sums -----------------------------------------------------------------------------------------------------------


def one_pixel(photons, **method):
    """A map of one pixel under flat water and a sun at the zenith: its value is 1 however many photons there are."""
    return scene(
        resolution=(1, 1), size=(0.1, 0.1), direction=(0.0, 0.0, -1.0),
        method={"photon": {"photons_per_pixel": photons}, "beam": {"samples_per_pixel": photons}, **method},
    )  # fmt: skip


@pytest.mark.parametrize("method", FREE_METHODS)
def test_crowded_maps_are_summed_in_float64_unless_the_scene_says_otherwise(method):
    def chosen(photons, **method_table):
        plan = wc.make_plan(one_pixel(photons, **method_table), method, "cpu", 1)
        return plan.program.accumulate, next(b.dtype for b in plan.buffers if b.name == "map")

    # The beam's edges are summed up along rows, where steps cancel: in float64 at least.
    single = "float64" if method == "beam" else "float32"
    assert chosen(2.0**8) == (single, single)
    assert chosen(2.0**26) == ("float64", "float64")
    for asked in ("float32", "float64", "fixed"):
        given = single if asked == "float32" else asked
        assert chosen(2.0**26, accumulate=asked) == (given, given)
    triangles = {"accumulate": "float32", "beam": {"samples_per_pixel": 2.0**26, "deposit": "triangles"}}
    assert chosen(2.0**26, **triangles) == ("float32", "float32")


@pytest.mark.parametrize("method", FREE_METHODS)
def test_a_map_so_thin_that_cells_crowd_in_it_is_summed_in_float64(method):
    """One sample a pixel, but pixels of 16 mm by 10 µm: thousands of rows of water pass through one row of the map."""
    thin = wc.make_plan(scene(GENTLE, resolution=(16, 1), size=(0.25, 1e-5)), method, "cpu", 1)
    assert thin.program.accumulate == "float64"


@pytest.mark.parametrize("method", FREE_METHODS)
def test_a_crowded_pixel_holds_all_its_light(device, method):
    result = render(one_pixel(2.0**14), method, device)
    assert result.plan.program.accumulate == "float64"
    assert result.caustic_map[0, 0] == pytest.approx(1.0, abs=2e-7)
    assert result.energy.unaccounted < ADDS_UP


def test_sums_that_lose_light_are_said():
    result = render(one_pixel(4.0), "photon", "cpu")
    assert result.warnings == []
    short = replace(result, energy=replace(result.energy, received=0.25 * result.energy.received))
    (warning,) = short.warnings
    assert "method.accumulate" in warning
    assert "7.5e-01 of the light" in warning


def test_objects_that_are_scaled_out_of_reach_are_refused(tmp_path):
    far = {"plane": 0.0, "objects": [{"mesh": save_box(tmp_path), "scale": 1e18, "translate": (1e18, 0.0, 0.0)}]}
    with pytest.raises(wc.InputError, match=r"receiver\.objects: expected coordinates"):
        wc.make_plan(scene(GENTLE, far), "beam", "cpu")
