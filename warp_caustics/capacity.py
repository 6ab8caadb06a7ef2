"""What fits: memory and work that a plan may take, and what is refused because it would take more."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .errors import InputError
from .program import MOST_WORK
from .simulation import simulation_buffers
from .window import TOO_FAR

if TYPE_CHECKING:
    from .facts import Facts
    from .plan import Plan
    from .program import Program
    from .scene import Scene
    from .sequence import Sequence

MOST_VALUES = 2**31 - 1
"""Values of one array at most, in Warp."""

MOST_STRIDE = 2**31 - 1
"""Bytes of a row of an array of several dimensions at most: Warp's kernels step from one to the next by an int32."""

SPARE_MEMORY = 0.9
"""Share of the free memory that a plan may take."""


def too_large(plan: Plan, free: int) -> str:
    """Say what takes the most of a plan that does not fit in memory."""
    scene, basin = plan.facts.scene, plan.facts.basin
    room = f"and {plan.device} has {free:,} free; "
    if basin is not None:
        water = sum(buffer.bytes for buffer in simulation_buffers(basin))
        if 2 * water > plan.bytes:
            return (
                f"{basin.fineness}: {basin.columns} x {basin.rows} cells take {water:,} bytes of {plan.bytes:,}, "
                f"{room}expected fewer cells"
            )
    return (
        f"map: {scene.map.resolution[0]} x {scene.map.resolution[1]} pixels by method {plan.method} take "
        f"{plan.bytes:,} bytes, {room}lower map.resolution"
    )


def check_map_fits(scene: Scene, device: str, free: int) -> None:
    """Refuse a map whose pixels alone do not fit in memory, before anything is loaded or derived.

    Raises
    ------
    InputError
        With the bytes that it takes and those that are free.
    """
    columns, rows = scene.map.resolution
    if columns * rows * scene.channels > MOST_VALUES:
        raise InputError(
            f"map.resolution: {columns} x {rows} pixels take at least {columns * rows * 4 * (1 + scene.channels):,} "
            f"bytes, and no array holds more than {MOST_VALUES:,} values; expected a smaller map"
        )
    least = columns * rows * 4 * (1 + scene.channels)
    if least > SPARE_MEMORY * free:
        raise InputError(
            f"map.resolution: {columns} x {rows} pixels take at least {least:,} bytes, and {device} has {free:,} free; "
            "expected a map that fits in memory"
        )


def steps_too_far(plan: Plan) -> bool:
    """Tell whether a lane's copy of a buffer is so large that no kernel can step on to the next lane's."""
    return any(plan.copies(buffer) > 1 and buffer.bytes > MOST_STRIDE for buffer in plan.buffers)


def check_work(facts: Facts, program: Program | Sequence) -> None:
    """Refuse a frame that would take days.

    Raises
    ------
    InputError
        With the cells that it takes.
    """
    work, suns = program.work(facts), len(facts.suns)
    if work > MOST_WORK:
        raise InputError(
            f"map: a frame takes {work // suns:,} cells of water for each of {suns} sun direction(s), and "
            f"{MOST_WORK:,} in all are what can be gone through; {TOO_FAR}"
        )
