"""Threads: every pass spread over them, and what they must not change: bits, sums, ledgers."""

from __future__ import annotations

import dataclasses
import threading
import time
from concurrent.futures import wait
from typing import Any

import numpy as np
import pytest
import warp as wp
from scenery import GENTLE, bundled, relative_l2, scene, tables

import warp_caustics as wc
from warp_caustics import bands, crew
from warp_caustics.crew import Crew
from warp_caustics.lattice_recording import LatticeRecording
from warp_caustics.picture import Painter
from warp_caustics.program import Pass
from warp_caustics.recording import run_stages
from warp_caustics.simulation import SimulatedWater
from warp_caustics.state import SceneState

ANOTHER_ORDER = 1e-6  # float32 sums of some tens of cells a pixel, taken in another order
LEDGER_ORDER = 1e-6  # of the same, over a whole map
EYE = {"position": (1.0, -1.2, 2.4), "target": (1.0, 0.6, 0.0), "vertical_fov": 40.0, "resolution": (48, 30)}
DROP = {"position": (0.4, 0.3), "radius": 0.15, "amplitude": 0.01}
WATERS: dict[str, dict[str, Any]] = {
    "spectral": {"kind": "spectral", "cell": 0.04, "drops": [DROP]},
    "explicit": {"kind": "grid", "cell": 0.05, "drops": [DROP]},
    "implicit": {"kind": "grid", "cell": 0.05, "drops": [DROP], "integrator": "implicit",
                 "obstacles": [{"position": (1.2, 0.6), "radius": 0.1}]},
}  # fmt: skip

IN_ORDER = {
    "fill_small_kernel", "fill_large_kernel",  # an atomic depth test, and a list that is appended to
    "wave_table", "place_table", "wave_planes",  # small
    "claim", "corners", "triangles", "unclaim",  # area_ratio with overlap = "latest": each pixel asks all triangles
}  # fmt: skip
"""Kernels of passes that one thread makes, in programs whose strips do not run side by side."""


@pytest.fixture(autouse=True)
def small_pieces(monkeypatch):
    """Cut small maps too."""
    monkeypatch.setattr(bands, "LEAST_PIECE", 1)
    monkeypatch.setattr(bands, "LEAST_FILL", 16)


def looking(method: str, receiver: Any = None, accumulate: str = "float32", **settings: Any) -> wc.Scene:
    chosen = {"name": method, "accumulate": accumulate, method: settings}
    return scene(GENTLE, receiver, camera=EYE, method=chosen, size=(2.0, 2.0), resolution=(64, 64))


def over(name: str, method: str, accumulate: str = "float32", **settings: Any) -> wc.Scene:
    table = tables(bundled(name))
    table["method"] = {"name": method, "accumulate": accumulate, method: settings}
    return wc.Scene(**table)


CASCADED = {"resolution": 96, "count": 1}
WITHOUT_SUMS = {
    "gather in two passes": lambda: over("pool", "gather", form="two_pass"),
    "gather in one": lambda: over("pool", "gather", form="fused"),
    "gather on a terrain": lambda: over("beach", "gather"),
    "the latest triangle": lambda: over("pool", "area_ratio", overlap="latest"),
    "sample": lambda: over("pool", "sample", vertices=40),
    "a drop": lambda: scene(simulation=WATERS["explicit"], method={"name": "photon", "accumulate": "fixed"}),
    "pattern": lambda: looking("pattern"),
    "pattern with shadows": lambda: looking("pattern", {"terrain": {"base": 0.2, "slope": (0.9, 0.0)}},
                                            luminance_mask="shadow"),
    "fixed point": lambda: over("beach", "photon", "fixed"),
    "cascaded in fixed point": lambda: looking("cascaded", None, "fixed", **CASCADED, filter="bilateral"),
    "cascades in fixed point": lambda: looking("cascaded", None, "fixed", resolution=96, count=2),
}  # fmt: skip
"""Frames that come out the same to the bit on any number of threads."""

WITH_SUMS = {
    "beam": lambda: over("beach", "beam"),
    "photon": lambda: over("tank", "photon"),
    "beam on a plane": lambda: over("pool", "beam"),
    "gather by rows": lambda: over("pool", "gather"),
    "differential": lambda: over("pool", "differential"),
    "area_ratio": lambda: over("pool", "area_ratio"),
    "colours apart": lambda: wc.Scene(
        **{**tables(bundled("pool")), "medium": {"ior": "fresh", "dispersion": "traced"}}
    ),
    "cascaded": lambda: looking("cascaded", **CASCADED),
    "cascaded over land": lambda: looking("cascaded", {"terrain": {"base": 0.6, "slope": (0.4, 0.0)}}, **CASCADED),
}
"""Frames in which threads add up shares of a pixel in their own order."""


def rendered(what: wc.Scene, threads: int) -> wc.Result:
    renderer = wc.Renderer(what, what.method.name, "cpu", threads)
    renderer.render(0.3)
    return renderer.result()


def picture_of(result: wc.Result) -> np.ndarray:
    made = result.image
    assert made.std() > 0.0
    return np.asarray(made)


@pytest.mark.parametrize("name", WITHOUT_SUMS)
def test_threads_do_not_change_a_bit(name):
    results = [rendered(WITHOUT_SUMS[name](), threads) for threads in (1, 2, 8)]
    for result in results[1:]:
        np.testing.assert_array_equal(picture_of(result), picture_of(results[0]))
        assert_same_energy(result, results[0])


@pytest.mark.parametrize("name", WITH_SUMS)
def test_threads_add_up_to_the_same(name):
    results = [rendered(WITH_SUMS[name](), threads) for threads in (1, 2, 8)]
    for result in results[1:]:
        assert relative_l2(picture_of(result), picture_of(results[0])) < ANOTHER_ORDER
        assert_same_energy(result, results[0])


def assert_same_energy(result: wc.Result, other: wc.Result) -> None:
    if other.energy is None:
        assert result.energy is None
        return
    total = np.max(other.energy.emitted)
    for entry, value in other.energy.items():
        np.testing.assert_allclose(result.energy[entry], value, atol=LEDGER_ORDER * total, err_msg=entry)
    assert result.energy.unaccounted < LEDGER_ORDER


@pytest.mark.parametrize("kind", WATERS)
def test_simulated_water_is_the_same_to_the_bit(kind):
    basin = wc.make_plan(scene(simulation=WATERS[kind]), "photon", "cpu").facts.basin
    assert basin is not None
    waters = [SimulatedWater(basin, "cpu", Crew(threads)) for threads in (1, 2, 8)]
    for water in waters:
        water.advance(0.4)
    assert len(waters[1].stages[-1]) == 2
    assert (waters[1]._extremes.numpy() > 0.0).all()  # each thread has its own
    for water in waters[1:]:
        np.testing.assert_array_equal(water.nodes.numpy(), waters[0].nodes.numpy())
        np.testing.assert_array_equal(water._extremes.numpy().max(axis=0), waters[0]._extremes.numpy()[0])


def test_a_picture_is_the_same_to_the_bit():
    result = rendered(scene(GENTLE, camera=EYE), 1)
    pictures = []
    for threads in (1, 2, 8):
        painter = Painter(dataclasses.replace(result, plan=dataclasses.replace(result.plan, threads=threads)))
        painter._around = None
        pictures.append(painter.paint(result))
    for picture in pictures[1:]:
        np.testing.assert_array_equal(picture, pictures[0])


# --- what is spread -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [*WITHOUT_SUMS, *WITH_SUMS])
def test_every_pass_is_spread(name):
    """A new pass that could be and is not shows up here."""
    what = {**WITHOUT_SUMS, **WITH_SUMS}[name]()
    renderer = wc.Renderer(what, what.method.name, "cpu", 2)
    assert renderer.plan.threads == 2
    for lanes in renderer.stages:
        kernels = {command.kernel.func.__name__ for lane in lanes for command in lane if isinstance(command, wp.Launch)}
        if not kernels <= IN_ORDER:
            assert len(lanes) > 1, kernels


def test_each_thread_adds_to_a_picture_of_its_own():
    # Sums on a CPU are plain additions: two threads on one picture would now and then lose light, unseen by most tests.
    renderer = wc.Renderer(looking("cascaded", **CASCADED), "cascaded", "cpu", 2)
    assert sum(b.name.endswith("light") and renderer.plan.copies(b) == 2 for b in renderer.plan.buffers) == 1
    renderer.render(0.0)
    recording = renderer._recording
    total, other = (arrays["cascade0.light"].numpy().sum() for arrays in (recording.arrays, recording._others))
    assert 0.1 * total < other < 0.9 * total
    again = recording.arrays["cascade0.light"].numpy().copy()
    renderer.render(0.0)  # both are emptied before
    np.testing.assert_array_equal(recording.arrays["cascade0.light"].numpy(), again)


def test_each_thread_counts_dry_land_by_itself():
    renderer = wc.Renderer(over("beach", "photon"), "photon", "cpu", 2)
    renderer.render(0.0)
    dry = renderer._recording._dry.numpy()
    assert dry.shape == (2, 3)
    assert (dry[:, 0] > 0.1 * dry[:, 0].sum()).all()


@wp.kernel(enable_backward=False)
def count_cells(begin: int, ledger_out: wp.array2d[wp.float64], map_out: wp.array[float]):
    row, column = wp.tid()
    row += begin
    wp.atomic_add(ledger_out, 0, row % 2, wp.float64(1.0))
    if row == 0:
        map_out[column] = map_out[column] + 1.0


def test_passes_over_rows_share_a_map_and_have_a_ledger_each():
    plan = wc.make_plan(over("pool", "gather", form="fused"), "gather", "cpu", 2)
    rows, columns = plan.program.lattice.count[1], 16
    count = Pass("count", "counts cells", lambda: count_cells, lambda strip: (strip, columns))
    program = dataclasses.replace(plan.program, passes=(count, count), buffers=())
    recording = LatticeRecording(plan, program, SceneState(plan.facts, "cpu"))
    assert [len(lanes) for lanes in recording.stages] == [1, 2, 2, 2]
    for _ in range(2):  # both are emptied before
        run_stages(recording.stages)
    ledgers = recording.ledgers.numpy()[:, 0].sum(axis=1)
    assert ledgers.sum() == 2 * rows * columns
    assert (ledgers > 0.4 * ledgers.sum()).all()
    assert recording.maps.shape[0] == 1
    assert recording.maps.numpy()[0, :columns] == pytest.approx(2.0)


def test_lanes_of_cascades_need_no_pictures_more():
    plan = wc.make_plan(looking("cascaded", resolution=96, count=4), "cascaded", "cpu", 4)
    assert plan.threads == 4
    assert plan.bytes == sum(buffer.bytes for buffer in plan.buffers)


@pytest.mark.parametrize(("threads", "suns"), [(2, 1), (3, 1), (4, 2), (8, 1)])
def test_strips_are_dealt_out_evenly(threads, suns):
    program = wc.make_plan(bundled("pool", (32, 700)), "photon", "cpu", 1).program
    spread = program.spread(threads, suns)
    assert spread.strips * suns % threads == 0
    assert spread.strips * spread.strip_rows >= program.lattice.count[1]
    assert spread.strip_rows <= program.strip_rows
    many = dataclasses.replace(program, strip_rows=2)
    assert many.spread(3, 1) is many  # one strip more or less of hundreds
    few = dataclasses.replace(program, strip_rows=bands.PIECES * 4)
    assert few.spread(10**4, 1) is few  # strips of a row would be all border


@wp.kernel(enable_backward=False)
def mark(begin: int, marks_out: wp.array2d[int]):
    row, column = wp.tid()
    row += begin
    marks_out[row, column] = marks_out[row, column] + 1


@pytest.mark.parametrize("shape", [(1, 7), (5, 3), (97, 2), (64, 64)])
@pytest.mark.parametrize("threads", [1, 2, 8])
def test_bands_cover_each_row_once(shape, threads):
    marks = wp.zeros(shape, dtype=int, device="cpu")
    lanes = bands.bind_lanes(mark, shape, {"marks": marks}, "cpu", threads)
    assert len(lanes) == min(threads, shape[0])
    for lane in lanes:
        for command in lane:
            command.launch()
    assert (marks.numpy() == 1).all()


def test_bands_are_neither_too_small_nor_too_large(monkeypatch):
    marks = wp.zeros((64, 64), dtype=int, device="cpu")

    def pieces(threads, device="cpu"):
        return [len(lane) for lane in bands.bind_lanes(mark, (64, 64), {"marks": marks}, device, threads)]

    monkeypatch.setattr(bands, "LEAST_PIECE", 2**10)  # a quarter of the array
    assert pieces(8) == [1, 1, 1, 1]
    assert pieces(1) == [1]
    heavy = bands.bind_lanes(mark, (64, 1), {"marks": marks}, "cpu", 2, weight=64)
    assert [len(lane) for lane in heavy] == [2, 2]  # a thread a row
    monkeypatch.setattr(bands, "MOST_PIECE", 2**9)
    assert pieces(1) == [8]
    assert [len(list(bands._cuts((64, 64), 1, device))) for device in ("cpu", "cuda:0")] == [8, 1]


def test_a_fill_is_shared_too():
    array = wp.zeros((50, 3), dtype=float, device="cpu")
    lanes = bands.fill_lanes(array, 2.0, 4)
    assert len(lanes) == 4
    for lane in lanes:
        for command in lane:
            command.launch()
    assert (array.numpy() == 2.0).all()


# --- the crew -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_a_crew_makes_every_call_once_and_those_of_a_lane_in_order(threads):
    made: list[tuple[int, int]] = []
    lanes = [[lambda lane=lane, i=i: made.append((lane, i)) for i in range(3)] for lane in range(7)]
    told: list[int] = []
    Crew(threads).run(lanes, told.append)
    assert sorted(made) == [(lane, i) for lane in range(7) for i in range(3)]
    for lane in range(7):
        assert [i for one, i in made if one == lane] == [0, 1, 2]
    assert told == sorted(told)
    assert told[-1] == 21


def test_a_crew_works_side_by_side():
    both = threading.Barrier(2, timeout=30.0)  # broken, and raises, if one waits for the other to end
    Crew(2).run([[both.wait], [both.wait]])


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("where", [0, 1])
def test_what_goes_wrong_in_a_lane_is_raised(threads, where):
    def fails():
        raise ValueError("lane")

    lanes = [[lambda: time.sleep(0.01)], [lambda: time.sleep(0.01)]]
    lanes[where].append(fails)
    with pytest.raises(ValueError, match="lane"):
        Crew(threads).run(lanes)


def test_an_interruption_stops_all_lanes_and_waits_for_them():
    made, running = [], threading.Event()

    def other():
        running.set()
        time.sleep(0.02)
        made.append(None)

    def interrupted_or_other():
        if threading.current_thread() is threading.main_thread():
            running.wait(30.0)
            raise KeyboardInterrupt
        other()

    with pytest.raises(KeyboardInterrupt):
        Crew(2).run([[interrupted_or_other] * 1000] * 2)
    count = len(made)
    assert 0 < count < 1000
    time.sleep(0.1)
    assert len(made) == count


def test_an_interruption_of_the_wait_stops_the_others(monkeypatch):
    made, waits = [], [KeyboardInterrupt]

    def interrupted(*args):
        if waits:
            raise waits.pop()
        return wait(*args)

    def other():
        if threading.current_thread() is not threading.main_thread():
            time.sleep(0.02)
            made.append(None)

    monkeypatch.setattr(crew, "wait", interrupted)
    with pytest.raises(KeyboardInterrupt):
        Crew(2).run([[lambda: time.sleep(0.05)], [other] * 1000])
    count = len(made)
    assert count < 1000
    time.sleep(0.1)
    assert len(made) == count
