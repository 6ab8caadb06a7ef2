"""A warm frame of each method on each bundled scene that it can serve: ``pytest bench --benchmark-only``."""

from __future__ import annotations

import pytest

import warp_caustics as wc

# A frame is timed only if its ledger adds up: rounding of float32 sums over a map.
LEDGER = 1e-5

RUNS = [
    (scene, method)
    for scene in wc.bundled_scenes()
    for method in ("beam", "photon", "gather")
    if method != "gather" or scene == "pool"
]


@pytest.mark.parametrize(("scene", "method"), RUNS)
def test_frame(benchmark, scene: str, method: str) -> None:
    renderer = wc.Renderer(scene, method=method)
    renderer.render(0.0)
    result = renderer.result()
    assert result.energy.unaccounted < LEDGER

    benchmark.pedantic(lambda: (renderer.render(0.0), renderer.result()), rounds=5, warmup_rounds=1)
    benchmark.extra_info.update(
        device=result.device,
        threads=renderer.plan.threads,
        bytes=renderer.plan.bytes,
        cells_per_second=renderer.plan.program.lattice.cells / benchmark.stats["median"],
        compile_seconds=renderer.compile_seconds,
    )
