"""Where the time and the memory of a frame go: a tree of passes, held against what the machine can do.

The frame is run in two ways, in turn: as it is, and with a clock around each launch. The tracer stands beside the
renderer and goes through the same recorded launches, so that tracing costs nothing where nobody asks for it.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from ..errors import InputError
from .tree import BufferUse, Limits, Memory, Profile, ProfileNode

if TYPE_CHECKING:
    from ..renderer import Renderer
    from ..scene import Scene
    from .count import Key, Operations

__all__ = ["BufferUse", "Limits", "Memory", "Profile", "ProfileNode", "profile"]

FPS = 24.0
"""Frames a second of the film that is profiled, unless another rate is asked for."""


def profile(
    scene: Scene | str | os.PathLike[str],
    method: str | None = None,
    device: str | None = None,
    threads: int | None = None,
    time: float = 0.0,
    fps: float = FPS,
) -> Profile:
    """Profile a frame: milliseconds, launches, bytes and operations of its passes, and the memory by buffer.

    Frames of a film are run that begins at ``time``, as they are and traced in turn; of each, the fastest counts. The
    first one, which compiles, and takes simulated water from its beginning, is not measured. Operations are counted in
    the second one, on the CPU; for a GPU's profile by a renderer of the same scene there.

    Parameters
    ----------
    scene : Scene, str or path
        A scene, the name of a bundled one, or a file.
    method, device, threads
        As for :func:`~warp_caustics.make_plan`.
    time : float
        Of the first frame [s].
    fps : float
        Frames a second.

    Returns
    -------
    Profile

    Raises
    ------
    InputError
        As :func:`~warp_caustics.make_plan`; or if the method is ``reference``, which is no fixed list of passes.
    """
    from ..renderer import Renderer
    from ..scene import Scene, load_scene
    from .assemble import Assembly
    from .memory import MemoryTracker, measured_memory
    from .trace import run_film

    loaded = scene if isinstance(scene, Scene) else load_scene(scene)
    if (method or loaded.method.name) == "reference":
        raise InputError(
            'a profile of method "reference": it converges for as long as it needs, so no frame has a fixed list of '
            "passes; expected a method that renders in one frame"
        )
    with MemoryTracker() as tracker:
        renderer = Renderer(loaded, method, device, threads)
        renderer.render(time)
        operations, counted = _operations(renderer, time, fps)
        before = tracker.allocations
        film = run_film(renderer, time + 1.0 / fps, fps)
        memory = measured_memory(renderer.plan, tracker, tracker.allocations - before)
    plan = renderer.plan
    limits = _limits(plan.device, plan.threads)
    return Profile(
        scene=loaded.name,
        method=plan.method,
        device=plan.device,
        threads=plan.threads,
        time=time,
        samples=plan.samples,
        frames=film.frames,
        frame=Assembly(plan, limits, operations, counted).frame(film.traced),
        untraced_milliseconds=1e3 * film.plain,
        limits=limits,
        memory=memory,
    )


def _limits(device: str, threads: int) -> tuple[Limits, ...]:
    """What the device can do, on one thread and on all."""
    from ..bandwidth import copy_bandwidth
    from .peak import peak_operations

    return tuple(
        Limits(count, copy_bandwidth(device, count), peak_operations(device, count)) for count in sorted({1, threads})
    )


def _operations(renderer: Renderer, time: float, fps: float) -> tuple[Operations, dict[Key, int]]:
    """Count the operations of the frame that follows the one at a time [s], on the CPU."""
    from ..renderer import Renderer
    from .count import counted_frame

    plan = renderer.plan
    if plan.device != "cpu":
        renderer = Renderer(plan.facts.scene, plan.method, "cpu", 1)
        renderer.render(time)
    return counted_frame(renderer, time + 1.0 / fps)
