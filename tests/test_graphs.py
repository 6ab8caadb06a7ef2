"""Frames as graphs: what is captured, what is not, progress, interruption, and what a frame allocates."""

from __future__ import annotations

import gc
import tracemalloc
from itertools import pairwise
from threading import Event, Thread
from time import sleep
from typing import Any

import numpy as np
import pytest
import warp as wp
from scenery import GENTLE, bundled, relative_l2, scene, tables

import warp_caustics as wc
from warp_caustics import playback

EYE = {"position": (1.0, -1.2, 2.4), "target": (1.0, 0.6, 0.0), "vertical_fov": 40.0, "resolution": (48, 30)}
DROP = {"position": (0.4, 0.3), "radius": 0.15, "amplitude": 0.01}
LEDGER = 1e-6  # what float32 sums leave of a whole frame; of half of one it is some percent
TALL = {"resolution": (20, 300), "size": (0.2, 3.0)}  # strips for several threads
ANOTHER_ORDER = 1e-6  # float32 sums of some tens of cells a pixel, taken in another order
FRAMES = 20
KEPT_BYTES = 2048
"""Of the interpreter after so many frames, without its free lists, which collecting garbage empties: calls and numbers
that change size; an array kept a frame would be ten times."""

PASSING_BYTES = 2**16
"""Of the interpreter within a frame: calls and numbers; a map of these scenes is larger."""

FREE = ("beam", "photon", "gather", "differential", "area_ratio")
SCENES = {
    **{method: lambda method=method: over_pool(method) for method in FREE},
    "a shore": lambda: bundled("beach"),
    "sample": lambda: looking("sample"),
    "pattern": lambda: looking("pattern"),
    "cascaded": lambda: looking("cascaded", resolution=96, count=2, filter="blur"),
    "a sea": lambda: bundled("sea"),
    "a drop": lambda: scene(simulation={"kind": "spectral", "cell": 0.04, "drops": [DROP]}),
    "stepped": lambda: scene(simulation={"kind": "grid", "cell": 0.05, "drops": [DROP]}),
}  # fmt: skip


def over_pool(method: str) -> wc.Scene:
    return wc.Scene(**tables(bundled("pool", (160, 160))) | {"method": {"name": method}})


def looking(method: str, **settings: Any) -> wc.Scene:
    chosen = {"name": method, method: settings}
    return scene(GENTLE, camera=EYE, method=chosen, size=(2.0, 2.0), resolution=(64, 64))


def images(renderer: wc.Renderer, time: float) -> list[np.ndarray]:
    """Render a frame, and give its pictures as arrays of their own."""
    frame = renderer.render(time)
    return [np.array(made.numpy()) for made in (frame.caustic_map, frame.screen_map) if made is not None]


def no_graphs(*args: object, **kwargs: object) -> None:
    raise RuntimeError("no graphs here")


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("name", SCENES)
def test_a_graph_is_the_launches_that_it_was_made_of(device, name, threads, monkeypatch):
    what = SCENES[name]()
    graphs = wc.Renderer(what, device=device, threads=threads)
    assert graphs.playback.refused == ""
    if device == "cpu":
        assert graphs.playback.graphs >= sum(len(stage) for stage in graphs.stages)
    else:
        assert graphs.playback.graphs == 1
    monkeypatch.setattr(wp, "capture_begin", no_graphs)
    plain = wc.Renderer(what, device=device, threads=threads)
    assert (plain.playback.graphs, plain.playback.refused) == (0, "no graphs here")
    for time in (0.0, 0.7, 0.2):
        for made, expected in zip(images(graphs, time), images(plain, time), strict=True):
            assert made.any()
            if device == "cpu":
                np.testing.assert_array_equal(made, expected)
            else:  # where sums are taken in any order
                assert relative_l2(made, expected) < ANOTHER_ORDER


def test_many_launches_are_made_one_by_one(monkeypatch):
    monkeypatch.setattr(playback, "MOST_CAPTURED", 3)
    renderer = wc.Renderer(scene(GENTLE, **TALL), "beam", "cpu", 1)
    assert renderer.playback.graphs == 0
    assert renderer.playback.refused.endswith("launches are more than 3")
    assert images(renderer, 0.0)[0].any()


def test_a_frame_can_be_part_of_a_graph_of_the_caller(device):
    """On a CPU as well: graphs do not nest, so that the frame's launches are recorded one by one."""
    renderer = wc.Renderer(scene(GENTLE, **TALL), "beam", device, 2)
    later = images(renderer, 1.0)[0]
    renderer.render(0.0)
    with wp.ScopedCapture(device) as capture:
        renderer.render(1.0)
    renderer._recording.caustic_map.zero_()
    wp.capture_launch(capture.graph)
    assert relative_l2(renderer._recording.caustic_map.numpy(), later) < ANOTHER_ORDER


def test_what_another_renderer_captures_is_not_the_callers(monkeypatch):
    """On a CPU Warp says to all threads that it captures: launches made meanwhile would be written into its graph."""
    renderer = wc.Renderer(over_pool("photon"), device="cpu", threads=1)
    expected = images(renderer, 1.0)[0]
    renderer.render(0.0)
    begun, over = Event(), Event()

    def make() -> None:
        with playback._CAPTURING, wp.ScopedCapture(device="cpu"):
            begun.set()
            over.wait()

    maker = Thread(target=make)
    maker.start()
    begun.wait()
    try:
        monkeypatch.setattr(wp.Launch, "launch", no_graphs)
        frame = renderer.render(1.0)
    finally:
        over.set()
        maker.join()
    assert frame.caustic_map is not None and (frame.caustic_map.numpy() == expected).all()


def test_frames_of_one_renderer_wait_for_each_other(monkeypatch):
    renderer = wc.Renderer(over_pool("photon"), device="cpu", threads=1)
    running, most = [], []
    run = renderer.playback.run

    def watched(progress: Any = None) -> None:
        running.append(None)
        most.append(len(running))
        sleep(0.01)  # so that another would begin
        run(progress)
        running.pop()

    monkeypatch.setattr(renderer.playback, "run", watched)
    callers = [Thread(target=renderer.render, args=(time,)) for time in (0.0, 1.0, 2.0)]
    for caller in callers:
        caller.start()
    for caller in callers:
        caller.join()
    assert most == [1, 1, 1]


def test_graphs_are_of_bounded_work(monkeypatch):
    monkeypatch.setattr(playback, "GRAPH_WORK", 4000)
    renderer = wc.Renderer(scene(GENTLE, **TALL), "beam", "cpu", 1)
    (lane,) = renderer.stages[0]
    parts = list(playback._parts(lane))
    assert [command for part in parts for command in part] == lane
    for part, following in pairwise(parts):
        work = sum(map(playback.work_of, part))
        assert work <= 4000 or len([c for c in part if playback.work_of(c)]) == 1
        assert work + playback.work_of(following[0]) > 4000  # none is smaller than it need be
    assert renderer.playback.graphs == len(parts) + 1


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_progress_goes_from_nothing_to_all(threads, monkeypatch):
    monkeypatch.setattr(playback, "GRAPH_WORK", 1)
    renderer = wc.Renderer(scene(GENTLE, **TALL), "beam", "cpu", threads)
    shares: list[float] = []
    renderer.render(0.0, shares.append)
    assert shares == sorted(shares)
    assert shares[0] > 0.0
    assert threads > 1 or shares[0] < 0.1
    assert shares[-1] == 1.0


@pytest.mark.parametrize("threads", [1, 2])
def test_an_interrupted_frame_leaves_nothing_behind(threads, monkeypatch):
    monkeypatch.setattr(playback, "GRAPH_WORK", 1)
    renderer = wc.Renderer(scene(GENTLE, **TALL), "beam", "cpu", threads)
    expected = images(renderer, 0.4)[0]
    energy = renderer.result().energy

    def interrupted(share: float) -> None:
        if share > 0.3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        renderer.render(0.8, interrupted)
    # Half a frame is none: its result is that of the whole one.
    result = renderer.result()
    assert result.time == 0.8
    assert result.energy.unaccounted < LEDGER
    np.testing.assert_array_equal(images(renderer, 0.4)[0], expected)
    assert renderer.result().energy == energy


@pytest.mark.parametrize("name", ["beam", "cascaded", "a sea", "stepped"])
def test_a_frame_keeps_nothing_and_holds_little(name):
    """Neither arrays of Warp (see `test_renderer.py`) nor of NumPy, nor anything that grows from frame to frame."""
    renderer = wc.Renderer(SCENES[name](), device="cpu", threads=2)
    for frame in range(FRAMES):
        renderer.render(0.01 * frame)
    tracemalloc.start()
    try:
        renderer.render(0.0)
        gc.collect()
        before, _ = tracemalloc.get_traced_memory()
        tracemalloc.reset_peak()
        for frame in range(FRAMES):
            renderer.render(0.01 * frame)
        _, peak = tracemalloc.get_traced_memory()
        gc.collect()  # a launch from Python leaves one more tuple in the free lists, up to 2000 of each length
        after, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert after - before < KEPT_BYTES
    assert peak - before < PASSING_BYTES
