"""What cannot be planned is refused before anything is made, in one message that says what would be right."""

from __future__ import annotations

import re

import pytest
from scenery import FREE_METHODS, GENTLE, METHODS, save_box, save_quad, scene

import warp_caustics as wc


def planned(what, method="beam"):
    return wc.make_plan(what, method, "cpu", 1)


@pytest.fixture
def gigabyte(monkeypatch):
    """A machine with a gigabyte free."""
    monkeypatch.setattr("warp_caustics.device.free_memory", lambda device: 10**9)


def test_a_map_that_does_not_fit_is_refused_with_its_bytes_before_anything_is_made(gigabyte, monkeypatch):
    def too_late(*args):
        raise AssertionError("the map should have been refused first")

    monkeypatch.setattr("warp_caustics.plan.load_assets", too_late)
    for resolution, least in (((100_000, 100_000), "80,000,000,000"), ((20_000, 20_000), "3,200,000,000")):
        said = rf"map\.resolution: {resolution[0]} x {resolution[1]} pixels take at least {least} bytes"
        with pytest.raises(wc.InputError, match=said):
            planned(scene(GENTLE, resolution=resolution))
    with pytest.raises(wc.InputError, match=r"6,400,000,000 bytes, and cpu has 1,000,000,000 free"):
        planned(scene(GENTLE, resolution=(20_000, 20_000), sun={"irradiance": (1.0, 1.0, 1.0)}))


@pytest.mark.parametrize("method", METHODS)
def test_buffers_that_do_not_fit_are_refused_with_their_bytes(gigabyte, method):
    fits = scene(GENTLE, resolution=(2000, 2000), method={"gather": {"n": 3}})
    plan = wc.make_plan(fits, method, "cpu", 1)
    assert plan.bytes < 0.9e9
    # The map alone would fit; what the method needs beside it does not.
    huge = scene(
        GENTLE, resolution=(10_000, 10_000), size=(1e3, 1e3), method={"gather": {"n": 31}, "accumulate": "float32"}
    )
    with pytest.raises(wc.InputError, match=rf"by method {method} take [\d,]{{11,}} bytes.*lower map.resolution"):
        wc.make_plan(huge, method, "cpu", 64)


def test_more_water_than_can_be_gone_through_is_refused():
    with pytest.raises(wc.InputError, match="cells of water"):
        planned(scene(GENTLE, level=1e6, size=(1e-3, 1e-3)))


@pytest.mark.parametrize("kind", ["mesh", "objects"])
def test_the_gather_refuses_meshes_and_names_who_takes_them(kind, tmp_path):
    receiver = {
        "mesh": {"mesh": save_quad(tmp_path)},
        "objects": {"plane": 0.0, "objects": [{"mesh": save_box(tmp_path), "scale": 0.2}]},
    }[kind]
    with pytest.raises(wc.InputError) as caught:
        planned(scene(GENTLE, receiver), "gather")
    for word in ("gather", kind, '"beam"', '"photon"'):
        assert word in str(caught.value)
    for method in FREE_METHODS:
        planned(scene(GENTLE, receiver), method)


def test_a_terrain_so_deep_that_each_pixel_looks_at_the_whole_lake_is_refused_by_the_gather():
    deep = scene(GENTLE, {"terrain": {"base": 0.0}}, resolution=(512, 512), level=1000.0, size=(4.0, 4.0))
    with pytest.raises(wc.InputError, match=r"each of 512 x 512 pixels gathers from \d+ x \d+ samples"):
        planned(deep, "gather")


@pytest.mark.parametrize("receiver", [{"plane": 0.0}, {"terrain": {"base": 0.0}}])
@pytest.mark.parametrize("accumulate", ["float64", "fixed"])
def test_the_gather_refuses_a_format_it_cannot_honour(accumulate, receiver):
    what = scene(GENTLE, receiver, method={"accumulate": accumulate})
    with pytest.raises(wc.InputError, match=f'accumulate = "{accumulate}"'):
        planned(what, "gather")
    for method in FREE_METHODS:
        assert planned(what, method).facts.spec.accumulate == accumulate


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"method": "beems"}, 'did you mean "beam"'),
        ({"device": "cuda:99"}, "there is no 'cuda:99' here; expected one of cpu"),
        ({"device": "gpu"}, "there is no 'gpu' here"),
        ({"threads": 0}, "threads: expected a whole number of at least 1, got 0"),
        ({"threads": 1.5}, "threads: expected a whole number"),
        ({"threads": True}, "threads: expected a whole number"),
        ({"scene": "pol"}, "pool"),
        ({"scene": "nosuch.toml"}, "nosuch.toml"),
    ],
)
def test_what_is_not_there_is_refused(changes, message):
    with pytest.raises(wc.InputError, match=re.escape(message)):
        wc.make_plan(**{"scene": "pool", "device": "cpu", **changes})
