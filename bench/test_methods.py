"""A warm frame of each method on each scene, checked before it is timed: ``pytest bench --benchmark-only``."""

from __future__ import annotations

import pytest
from scenes import SCENES

import warp_caustics as wc
from warp_caustics.metrics import energy_error, relative_l2
from warp_caustics.reference import make_reference

# A frame is timed only if its ledger adds up: rounding of float32 sums over a map.
LEDGER = 1e-5

# And only if its map is near the reference, on a small map, whose reference takes seconds. The bounds hold the worst of
# the bundled scenes with a third to spare, on pixels as coarse as their shortest waves: they catch a method that is
# broken, not one that is a bit worse.
CHECKED_PIXELS = 64
MOST_ERROR = {"beam": 0.06, "photon": 0.15, "gather": 0.3}

RUNS = [
    (scene, method)
    for scene in SCENES
    for method in ("beam", "photon", "gather")
    if method != "gather" or scene != "tank"
]

PAPER = {"400x300": (400, 300), "800x600": (800, 600)}
"""Maps of Yuksel & Keyser, 2009, both with N = 7 and M = 6."""
PAPER_N, PAPER_M = 7, 6


@pytest.fixture(scope="module")
def references() -> dict[str, tuple[wc.Scene, object]]:
    """Small scenes and their references, each made once."""
    return {}


@pytest.mark.parametrize(("name", "method"), RUNS)
def test_frame(benchmark, references, name: str, method: str) -> None:
    if name not in references:
        small = SCENES[name].at_resolution(CHECKED_PIXELS, CHECKED_PIXELS)
        references[name] = (small, make_reference(small))
    small, reference = references[name]
    checked = wc.render(small, method=method)
    error = relative_l2(checked.caustic_map, reference.caustic_map)
    assert checked.energy.unaccounted < LEDGER
    assert error < MOST_ERROR[method]

    renderer = wc.Renderer(SCENES[name], method=method)
    renderer.render(0.0)
    result = renderer.result()
    assert result.energy.unaccounted < LEDGER

    benchmark.pedantic(lambda: (renderer.render(0.0), renderer.result()), rounds=5, warmup_rounds=1)
    median = benchmark.stats["median"]
    cells = renderer.plan.program.lattice.cells * len(renderer.plan.facts.suns)
    benchmark.extra_info.update(
        device=result.device,
        threads=renderer.plan.threads,
        pixels=SCENES[name].map.resolution,
        error=error,
        error_pixels=(CHECKED_PIXELS, CHECKED_PIXELS),
        error_bar=reference.error_bar,
        energy_error=energy_error(checked.energy, reference.energy),
        bytes=renderer.plan.bytes,
        cells_per_second=cells / median,
        compile_seconds=renderer.compile_seconds,
    )


@pytest.mark.parametrize("name", PAPER)
def test_yuksel_keyser(benchmark, name: str) -> None:
    """The paper's two configurations, on the pool; what so small a window misses is in the ledger."""
    table = SCENES["pool"].at_resolution(*PAPER[name]).model_dump(exclude_unset=True, exclude_none=True)
    table["method"] = {"name": "gather", "gather": {"n": PAPER_N, "m": PAPER_M}}
    renderer = wc.Renderer(wc.Scene(**table))
    result = renderer.result()
    assert result.energy.unaccounted < LEDGER
    assert result.energy.received > 0.0

    benchmark.pedantic(lambda: (renderer.render(0.0), renderer.result()), rounds=5, warmup_rounds=1)
    benchmark.extra_info.update(
        device=result.device,
        pixels=PAPER[name],
        n=PAPER_N,
        m=PAPER_M,
        missed_by_window=result.energy.missed_by_window / (result.energy.received + result.energy.missed_by_window),
        bytes=renderer.plan.bytes,
        compile_seconds=renderer.compile_seconds,
    )
