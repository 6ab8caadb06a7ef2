"""Memory of a renderer: buffer by buffer as planned, and the peak as measured."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import warp as wp
from warp._src import context

from ..dispersion import CHANNELS, DispersedPlan
from .tree import BufferUse, Memory

if TYPE_CHECKING:
    from ..plan import Plan

FLOAT32_BYTES = 4


class MemoryTracker:
    """Counts what Warp allocates while it is entered, on host and devices, its own trees of meshes included."""

    def __enter__(self) -> MemoryTracker:
        self._tracker = wp.ScopedMemoryTracker("profile", print=False)
        self._tracker.__enter__()
        self._core: Any = context.runtime.core  # type: ignore[attr-defined]  # typed as None before Warp starts
        return self

    def __exit__(self, *error: object) -> None:
        self._tracker.__exit__(*error)

    @property
    def peak(self) -> int:
        """The most that was allocated at once [bytes]; Warp's own report gives it rounded."""
        return int(self._core.wp_alloc_tracker_get_peak_bytes())

    @property
    def allocations(self) -> int:
        """How often memory was allocated."""
        return int(self._core.wp_alloc_tracker_get_total_alloc_count())


def pool_peak(device: str) -> int | None:
    """High-water mark of a CUDA device's memory pool [bytes]; None where there is none."""
    if device == "cpu" or not wp.is_mempool_enabled(device):
        return None
    return int(wp.get_mempool_used_mem_high(device))


def buffer_uses(plan: Plan | DispersedPlan) -> Iterator[BufferUse]:
    """Give what a plan allocates, largest first; of a dispersed one, of each channel by its name."""
    uses = list(_uses(plan))
    yield from sorted(uses, key=lambda use: -use.bytes)


def _uses(plan: Plan | DispersedPlan) -> Iterator[BufferUse]:
    if isinstance(plan, DispersedPlan):
        for channel, one in zip(CHANNELS, plan.plans, strict=True):
            for use in _uses(one):
                yield BufferUse(f"{channel}.{use.name}", use.dtype, use.shape, use.copies, use.bytes)
        columns, rows = plan.facts.scene.map.resolution
        shape = (rows, columns, len(CHANNELS))
        yield BufferUse("caustic_map", "float32", shape, 1, FLOAT32_BYTES * rows * columns * len(CHANNELS))
        return
    for buffer in plan.buffers:
        copies = plan.copies(buffer)
        yield BufferUse(buffer.name, buffer.dtype, buffer.shape, copies, copies * buffer.bytes)


def measured_memory(plan: Plan | DispersedPlan, tracker: MemoryTracker, frame_allocations: int) -> Memory:
    """Put together what was planned and what was measured."""
    return Memory(tuple(buffer_uses(plan)), plan.bytes, tracker.peak, pool_peak(plan.device), frame_allocations)
