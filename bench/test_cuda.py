"""Frames on a GPU: ``pytest bench/test_cuda.py --benchmark-only --benchmark-json=$FOLDER/cuda.json``.

``FOLDER`` is what ``python bench/compare_scenes.py --folder`` prints. A frame is timed as :meth:`Renderer.render` runs
it, and waited for; its kernels beside it one by one, each with its share of the floor that a copy sets.
"""

from __future__ import annotations

from dataclasses import asdict

import pytest
import warp as wp
from cuda_frames import Case, cases, passes

import warp_caustics as wc
from warp_caustics.bandwidth import copy_bandwidth

DEVICE = "cuda:0"
LEDGER = 1e-5  # as of the other benchmarks: rounding of float32 sums over a map

ROUNDS, FRAMES = 20, 10
"""Rounds of so many frames, so that a frame of microseconds can be timed; their median counts."""

# Asked of the installation alone, so that collecting the benchmarks starts no device.
pytestmark = pytest.mark.skipif(not wp.is_cuda_available(), reason="needs a CUDA device, and finds none")


@pytest.fixture(scope="module")
def bandwidth() -> float:
    """Bytes a second of a copy on the device."""
    return copy_bandwidth(DEVICE)


@pytest.mark.parametrize("case", cases(), ids=lambda case: case.name)
def test_frame(benchmark, bandwidth: float, case: Case) -> None:
    renderer = wc.Renderer(case.scene(1), device=DEVICE)
    result = renderer.result()
    if result.energy is not None:
        assert result.energy.unaccounted < LEDGER
    light = result.caustic_map if result.screen_map is None else result.screen_map
    assert light.sum() > 0.0

    def frame() -> None:
        renderer.render(0.0)
        wp.synchronize_device(DEVICE)

    benchmark.pedantic(frame, rounds=ROUNDS, iterations=FRAMES, warmup_rounds=1)
    timed = passes(renderer, bandwidth)
    benchmark.extra_info.update(
        device=result.device,
        bandwidth=bandwidth,
        bytes=renderer.plan.bytes,
        compile_seconds=renderer.compile_seconds,
        goal_seconds=case.goal,
        passes=[asdict(each) for each in timed],
        passes_seconds=sum(each.seconds for each in timed),
        share_of_floor=sum(each.bytes for each in timed) / bandwidth / benchmark.stats["median"],
    )
