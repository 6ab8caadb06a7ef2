"""What is measured on a GPU: frames, their goals on an H200, and each kernel's time and share of the memory's floor."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np
import warp as wp

import warp_caustics as wc

PAPER_N, PAPER_M = 7, 6
"""Of Yuksel & Keyser, 2009."""

SCREENS = {"1080p": (1920, 1080), "4K": (3840, 2160)}
CASCADES, TEXELS = 4, 2048
FOOTPRINTS = ("point", "texel")

POOL_CAMERA = {"position": [2.0, -1.6, 1.6], "target": [2.0, 2.0, 0.0], "vertical_fov": 55.0}
"""Sees the whole floor of the pool from above the water."""

COLOURS: dict[str, dict[str, Any]] = {
    "mono": {"absorption": 0.05, "dispersion": "none", "ior": 1.333},
    "RGB": {"absorption": [0.3401, 0.0565, 0.00922], "dispersion": "none", "ior": 1.333},
    "RGB dispersed": {"absorption": [0.3401, 0.0565, 0.00922], "dispersion": "traced", "ior": [1.331, 1.334, 1.339]},
}
"""The medium: one channel; three that share their way, of pure water; three, each on its own."""

REPEATS = 5
"""Times that a kernel is timed by itself; the fastest counts."""


@dataclass(frozen=True)
class Case:
    """A frame to be measured.

    Attributes
    ----------
    name : str
        What it is called.
    scene : callable
        A divisor of all sizes, 1 for the real ones, to the scene, whose method is set.
    goal : float or None
        Seconds that are aimed at on an H200.
    """

    name: str
    scene: Callable[[int], wc.Scene]
    goal: float | None = None


@dataclass(frozen=True)
class PassTime:
    """All launches of one kernel in a frame.

    Attributes
    ----------
    name : str
        The kernel's, or ``"fill"``.
    launches : int
        In a frame.
    seconds : float
        Of all of them, each by itself.
    bytes : int
        Of the arrays that they name, each once: what a frame reads and writes at the least.
    share : float
        Of the floor: the time that those bytes take by a copy, over ``seconds``.
    """

    name: str
    launches: int
    seconds: float
    bytes: int
    share: float


def gathered(resolution: tuple[int, int]) -> Callable[[int], wc.Scene]:
    """Give the pool with the paper's window; what so small a window misses is in the ledger."""

    def scene(divisor: int) -> wc.Scene:
        columns, rows = (max(side // divisor, 16) for side in resolution)
        table = wc.load_scene("pool").at_resolution(columns, rows).model_dump(exclude_unset=True, exclude_none=True)
        table["method"] = {"name": "gather", "gather": {"n": PAPER_N, "m": PAPER_M}}
        return wc.Scene(**table)

    return scene


def cascaded(name: str, screen: tuple[int, int], colour: str, footprint: str) -> Callable[[int], wc.Scene]:
    """Give a bundled scene as four cascades see it."""

    def scene(divisor: int) -> wc.Scene:
        table = wc.load_scene(name).model_dump(exclude_unset=True, exclude_none=True)
        table["camera"] = {**table.get("camera", POOL_CAMERA), "resolution": [side // divisor for side in screen]}
        table["medium"] = {"fresnel": True, **COLOURS[colour]}
        table["sun"]["irradiance"] = 1.0
        settings = {"count": CASCADES, "resolution": max(TEXELS // divisor, 16), "footprint": footprint}
        table["method"] = {"name": "cascaded", "cascaded": settings}
        return wc.Scene(**table)

    return scene


def cases() -> Iterator[Case]:
    """Give the paper's two gathers, a large one, and four cascades into two screens, in one channel and three."""
    yield Case("gather 400x300", gathered((400, 300)))
    yield Case("gather 800x600", gathered((800, 600)), 20e-6)
    yield Case("gather 4096x4096", gathered((4096, 4096)), 0.2e-3)
    for name in ("pool", "beach"):
        for screen, resolution in SCREENS.items():
            for colour in COLOURS:
                for footprint in FOOTPRINTS:
                    goal = 1e-3 if (screen, colour, footprint) == ("1080p", "mono", "point") else None
                    title = f"cascades {name} {screen} {colour} {footprint}"
                    yield Case(title, cascaded(name, resolution, colour, footprint), goal)


def passes(renderer: wc.Renderer, bandwidth: float) -> list[PassTime]:
    """Time each kernel of a frame that has been rendered, launch by launch, in the order in which they come."""
    device = renderer.plan.device
    launches = [command for stage in renderer._recording.stages for lane in stage for command in lane]
    best = np.full(len(launches), np.inf)
    for _ in range(REPEATS):
        best = np.minimum(best, [seconds_of(command, device) for command in launches])
    found: dict[str, list[tuple[float, dict[int, int]]]] = {}
    for command, seconds in zip(launches, best, strict=True):
        found.setdefault(name_of(command), []).append((float(seconds), arrays_of(command)))
    timed = []
    for name, parts in found.items():
        arrays: dict[int, int] = {}
        for _, own in parts:
            arrays |= own
        seconds, size = sum(part[0] for part in parts), sum(arrays.values())
        timed.append(PassTime(name, len(parts), seconds, size, size / bandwidth / seconds))
    return timed


def seconds_of(command: Any, device: str) -> float:
    """Time one launch: on a GPU by its own clock."""
    if device == "cpu":
        start = perf_counter()
        command.launch()
        return perf_counter() - start
    wp.timing_begin(cuda_filter=wp.TIMING_ALL)
    command.launch()
    return 1e-3 * sum(result.elapsed for result in wp.timing_end())


def name_of(command: Any) -> str:
    """Name a command by its kernel."""
    kernel = getattr(command, "kernel", None)
    return "fill" if kernel is None else str(kernel.key).split("__")[-1]


def arrays_of(command: Any) -> dict[int, int]:
    """Bytes of the arrays that a command is launched with, by their address."""
    if not isinstance(command, wp.Launch):
        array = command.array
        return {array.ptr: array.capacity}
    sizes = {}
    for argument, given in zip(command.kernel.adj.args, command.params[1:], strict=True):
        if hasattr(argument.type, "ndim") and hasattr(given, "shape"):
            shape = [given.shape[axis] for axis in range(argument.type.ndim)]
            sizes[int(given.data or 0)] = int(np.prod(shape)) * wp.types.type_size_in_bytes(argument.type.dtype)
    return sizes
