"""The forms of the gather, through the front door: one map and one ledger by all of them; which is taken; refusals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import warp as wp
from scenery import GENTLE, bundled, render, save_heights, scene, wave

import warp_caustics as wc
from oracle.cases import sunlight
from warp_caustics.assets import load_assets
from warp_caustics.facts import gather_facts
from warp_caustics.kernels.gather_rows import make_land_block
from warp_caustics.kernels.lanes import LANES, lanes, lanes_of, padded
from warp_caustics.kernels.photon import Medium
from warp_caustics.kernels.wave_rows import Water
from warp_caustics.methods.gather import gather

# Orders of adding the same float32 numbers, relative to the map's mean.
SAME_SUM = 1e-5
# Of the ledgers: both count in float64, one of them a row at a time.
SAME_LEDGER = 1e-6
# Of a landing [pixels] in float32, of a way of a metre over pixels of 2 cm.
LANDING = 2e-5

RIPPLES = [wave(0.03, 9.0, 2.0), wave(0.02, -4.0, 7.0, 0.5)]
CLEAR = {"ior": 1.333, "fresnel": True}
LOSSES = {"ior": 1.333, "fresnel": True, "absorption": (0.5, 0.2, 0.1)}


def pool(**more):
    """The plainest of scenes: waves over a plane."""
    return {"waves": RIPPLES, **more}


def pond(folder):
    """All that the general forms have: water that ends, losses, transport by colour, a sun with a disk."""
    heights = save_heights(
        folder, "pond", 0.02 * np.sin(0.2 * np.arange(30)[:, None] + 0.3 * np.arange(40)), (0.2, 0.1), (1.4, 0.9)
    )
    return {"waves": (), "height_map": heights, "medium": LOSSES, "sun": {"angular_diameter": 0.02}}


def surf(folder):
    """Crests that shade troughs."""
    return {"waves": [wave(0.05, 10.0, 0.0)], "direction": sunlight(75.0)}


SCENES = {"pool": lambda folder: pool(), "clear": lambda folder: pool(medium=CLEAR), "pond": pond, "surf": surf}
WINDOW = {"pool": 3, "clear": 3, "pond": 3, "surf": 7}
"""Samples across: they find most of the light, and miss some."""
GENERAL = ("fused", "scatter", "auto")


def by_form(form, n, **table):
    return scene(method={"gather": {"n": n, "form": form}}, **table)


@pytest.mark.parametrize(
    ("name", "form"),
    [
        *((name, form) for name in SCENES for form in GENERAL),
        ("pool", "scatter_rows"),
        ("clear", "scatter_rows"),
        ("pool", "tile"),
    ],
)
def test_each_form_gives_the_map_and_the_ledger_of_the_published_one(device, name, form, tmp_path):
    """With windows that miss light, on maps and lattices that are no whole number of lanes or tiles."""
    table = SCENES[name](tmp_path)
    published = render(by_form("two_pass", WINDOW[name], **table), "gather", device, time=0.3)
    found = render(by_form(form, WINDOW[name], **table), "gather", device, time=0.3)
    assert published.plan.settings["form"] == "two_pass"
    assert form in ("auto", found.plan.settings["form"])
    assert np.abs(found.caustic_map - published.caustic_map).max() < SAME_SUM * published.caustic_map.mean()
    energy = published.energy
    assert np.min(energy.missed_by_window) > 1e-3 * np.max(energy.emitted)
    assert np.min(energy.received) > 1e-2 * np.max(energy.emitted)
    for entry, light in published.energy.items():
        assert found.energy[entry] == pytest.approx(light, abs=SAME_LEDGER * np.max(published.energy.emitted)), entry


@pytest.mark.parametrize("n", [1, 31])
def test_rows_in_lanes_are_the_published_form_for_other_windows(device, n):
    """Also by several suns, and where the windows reach past all light."""
    table = pool(sun={"angular_diameter": 0.03}, resolution=(33, 70))
    published = render(by_form("two_pass", n, **table), "gather", device)
    found = render(by_form("scatter_rows", n, **table), "gather", device, threads=2)
    assert len(found.plan.facts.suns) > 1
    assert np.abs(found.caustic_map - published.caustic_map).max() < SAME_SUM * published.caustic_map.mean()
    assert found.energy.received == pytest.approx(published.energy.received, rel=SAME_LEDGER)


def test_rows_in_lanes_read_water_that_moves(device):
    """A frame writes the tables anew, and adds to nothing that a frame before has left."""
    renderer = wc.Renderer(by_form("scatter_rows", 3, **pool()), "gather", device, 1)
    first = renderer.render(0.0).caustic_map.numpy().copy()
    later = renderer.render(0.4).caustic_map.numpy().copy()
    again = renderer.render(0.0).caustic_map.numpy().copy()
    assert np.abs(later - first).max() > 0.1
    assert np.abs(again - first).max() < SAME_SUM


def chosen(device, **table):
    what = scene(**table)
    facts = replace(gather_facts(what, load_assets(what)), device=device)
    return gather(facts)


def test_auto_takes_rows_on_a_cpu_where_they_serve_and_scatters_elsewhere():
    assert chosen("cpu", **pool()).settings["form"] == "scatter_rows"
    assert chosen("cpu", **pool(medium=CLEAR)).settings["form"] == "scatter_rows"
    assert chosen("cuda:0", **pool()).settings["form"] == "scatter"
    for more in ({"medium": LOSSES}, {"direction": sunlight(75.0), "waves": [wave(0.2, 10.0, 0.0)]}):
        assert chosen("cpu", **{**pool(), **more}).settings["form"] == "scatter"


def test_a_tile_is_a_block_of_threads_on_a_gpu_and_one_thread_on_a_cpu():
    table = pool(method={"gather": {"n": 7, "form": "tile"}})
    blocks = {device: chosen(device, **table).passes[-1].dim(0) for device in ("cpu", "cuda:0")}
    assert blocks["cpu"][:2] == blocks["cuda:0"][:2] == (2, 3)
    assert (blocks["cpu"][2], blocks["cuda:0"][2]) == (1, 256)


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ({"method": {"gather": {"form": "tile", "n": 151}}}, r"151 x 151 samples take [\d,]+ bytes of shared memory"),
        ({"method": {"gather": {"form": "scatter_rows"}}, "medium": LOSSES}, 'form = "scatter_rows": it is for a sum'),
        ({"method": {"gather": {"form": "fused"}}, "receiver": {"terrain": {"base": 0.0}}}, "on a terrain each pixel"),
        ({"method": {"gather": {"form": "three_pass"}}}, r'method.gather.form: expected one of "auto", "two_pass"'),
    ],
)
def test_a_form_that_cannot_be_had_is_refused(table, said):
    with pytest.raises(wc.InputError, match=said):
        wc.make_plan(scene(GENTLE, **table), "gather", "cpu", 1)


def test_the_bundled_pool_is_gathered_by_rows():
    assert "scatter_rows" in wc.make_plan(bundled("pool"), "gather", "cpu", 1).kernels


land_block = make_land_block(True)


@wp.kernel(enable_backward=False)
def land(
    z: wp.array2d[float], slope_x: wp.array2d[float], slope_y: wp.array2d[float], sun: wp.vec3, shift: wp.vec2,
    medium: Medium, level: float, pixel: wp.vec2, x_out: wp.array2d[float], y_out: wp.array2d[float],
    incident_out: wp.array2d[float], flux_out: wp.array2d[float],
):  # fmt: skip
    row, block = wp.tid()
    water = Water()
    water.z = lanes_of(z)[row, block]
    water.slope_x = lanes_of(slope_x)[row, block]
    water.slope_y = lanes_of(slope_y)[row, block]
    landing = land_block(sun, shift, medium, level, pixel, water)
    x = lanes_of(x_out)
    y = lanes_of(y_out)
    incident = lanes_of(incident_out)
    flux = lanes_of(flux_out)
    x[row, block] = landing.x
    y[row, block] = landing.y
    incident[row, block] = landing.incident
    flux[row, block] = landing.flux


def test_lanes_land_where_snells_law_sends_them(device):
    """Against the refraction of each ray by itself, in float64."""
    shape, rng = (3, padded(LANES + 1)), np.random.default_rng(5)
    assert shape[1] == 2 * LANES == 2 * lanes._length_
    z, slope_x, slope_y = (rng.uniform(-0.2, 0.2, shape).astype(np.float32) for _ in range(3))
    sun, eta, level, pixel, shift = np.array(sunlight(35.0)), 1.0 / 1.333, -1.0, np.array([0.02, 0.03]), [0.3, -0.1]
    arrays = [wp.array(one, dtype=float, device=device) for one in (z, slope_x, slope_y)]
    out = [wp.zeros(shape, dtype=float, device=device) for _ in range(4)]
    medium = Medium()
    medium.ior, medium.eta = 1.0 / eta, eta
    wp.launch(
        land, dim=(shape[0], shape[1] // LANES),
        inputs=[*arrays, wp.vec3(*sun), wp.vec2(*shift), medium, level, wp.vec2(*pixel)], outputs=out, device=device,
    )  # fmt: skip
    normal = np.stack([-slope_x, -slope_y, np.ones(shape)], axis=-1).astype(np.float64)
    facing = -normal @ sun
    length = np.linalg.norm(normal, axis=-1)
    cosine = facing / length
    bend = eta * cosine - np.sqrt(1.0 - eta**2 * (1.0 - cosine**2))
    ray = eta * sun + (bend / length)[..., None] * normal
    way = (z - level)[..., None] * ray[..., :2] / -ray[..., 2:]
    x, y, incident, flux = (one.numpy() for one in out)
    assert np.abs(np.stack([x, y], axis=-1) - (way - shift) / pixel).max() < LANDING
    assert np.abs(incident - facing).max() < SAME_LEDGER
    inside = -(normal * ray).sum(axis=-1) / length
    rs = (cosine - inside / eta) / (cosine + inside / eta)
    rp = (cosine / eta - inside) / (cosine / eta + inside)
    assert np.abs(flux - facing * (1.0 - 0.5 * (rs**2 + rp**2))).max() < SAME_LEDGER
