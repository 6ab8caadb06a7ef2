"""One setting timed: warm frames, synchronised, all of them at the same time of the water's clock."""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING

from warp_caustics.renderer import Renderer

if TYPE_CHECKING:
    from warp_caustics.dispersion import DispersedPlan
    from warp_caustics.plan import Plan
    from warp_caustics.result import Result
    from warp_caustics.scene import Scene

MOST_FRAMES = 20
"""Timed frames at most: more would not help the median."""

ENOUGH_FRAMES, FEWEST_FRAMES = 3, 2
"""Timed frames at least: enough for a median, and for a spread where a frame is slow."""

ENOUGH_SECONDS, MOST_SECONDS = 0.5, 3.0
"""Frames are timed until they add up to the first, so that fast ones are timed often; past the second the fewest do."""

SLOW_SECONDS = 0.5
"""A first frame that takes longer is timed, too: what it spends on touching its buffers is nothing beside that."""


@dataclass(frozen=True)
class Measured:
    """A rendered setting and its times.

    Attributes
    ----------
    plan : Plan
        What was done for a frame.
    result : Result
        Of the last frame.
    compile_seconds : float
        Building and loading the kernels; almost nothing where a setting before it had the same ones.
    seconds : tuple of float
        Of each timed frame.
    """

    plan: Plan | DispersedPlan
    result: Result
    compile_seconds: float
    seconds: tuple[float, ...]


def measure(scene: Scene, device: str, threads: int | None, time: float) -> Measured:
    """Render a scene by its own method until its time is known.

    Raises
    ------
    InputError
        As :class:`~warp_caustics.Renderer`.
    """
    import warp as wp

    renderer = Renderer(scene, device=device, threads=threads)

    def frame() -> float:
        start = perf_counter()
        renderer.render(time)
        wp.synchronize_device(device)
        return perf_counter() - start

    first = frame()
    seconds = [first] if first > SLOW_SECONDS else []
    while not enough(seconds):
        seconds.append(frame())
    return Measured(renderer.plan, renderer.result(), renderer.compile_seconds, tuple(seconds))


def enough(seconds: list[float]) -> bool:
    """Tell whether the frames that were timed will do."""
    total = sum(seconds)
    if len(seconds) < ENOUGH_FRAMES:
        return len(seconds) >= FEWEST_FRAMES and total > MOST_SECONDS
    return total > ENOUGH_SECONDS or len(seconds) >= MOST_FRAMES
