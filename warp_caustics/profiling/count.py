"""Operations of a frame's passes, by their names: one frame on the CPU, each of its launches counted."""

from __future__ import annotations

from collections.abc import Callable
from threading import Lock
from typing import Any

from ..recording import own_name
from ..renderer import Renderer
from .tally import Tally
from .trace import watched_launches

Key = tuple[bool, str]
"""Whether it is a pass of simulated water, and its name."""

Operations = dict[Key, "int | None"]
"""In a frame; None where they are not known."""


def pass_name(command: Any) -> str:
    """Name of the pass that a command is a launch of; the kernel's own, where nobody gave it one, or what it does."""
    named: str | None = getattr(command, "pass_name", None)
    if named is not None:
        return named
    kernel = getattr(command, "kernel", None)
    return type(command).__name__.removesuffix("Command").lower() if kernel is None else own_name(kernel)


def counted_frame(renderer: Renderer, time: float) -> tuple[Operations, dict[Key, int]]:
    """Run a frame at a time [s] with its operations counted.

    Parameters
    ----------
    renderer : Renderer
        On the CPU.
    time : float
        [s].

    Returns
    -------
    operations, launches : dict
        By pass.
    """
    tally, lock = Tally(), Lock()
    operations: Operations = {}
    launches: dict[Key, int] = {}

    def count(water: bool, command: Any, launch: Callable[[], None]) -> None:
        key = water, pass_name(command)
        own: int | None = 0
        with lock:  # water may be stepped by several threads
            if hasattr(command, "kernel"):
                own = tally.launch(command, launch)
            else:
                launch()
            so_far = operations.get(key, 0)
            operations[key] = None if own is None or so_far is None else so_far + own
            launches[key] = launches.get(key, 0) + 1

    with watched_launches(lambda command, launch: count(True, command, launch)):
        renderer.write(time)
    for stage in renderer.stages:
        for lane in stage:
            for command in lane:
                count(False, command, command.launch)
    return operations, launches
