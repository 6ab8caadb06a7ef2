"""Recorded frames: every launch of a frame bound to its arguments, once, so that a frame allocates nothing."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import warp as wp

from .energy import Energy
from .errors import RenderError
from .kernels.deposit import FLUX

DTYPES: Mapping[str, Any] = {
    "float16": wp.float16, "float32": wp.float32, "float64": wp.float64, "int32": wp.int32, "int64": wp.int64,
    "uint8": wp.uint8, "uint16": wp.uint16, "uint32": wp.uint32, "uint64": wp.uint64,
    "vec1": FLUX[1], "vec2": wp.vec2, "vec3": FLUX[3], "vec4": wp.vec4, "vec3i": wp.vec3i,
    "vec2h": wp.vec2h, "vec2s": wp.vec2s,
}  # fmt: skip
"""Elements of a program's buffers."""

CLEAR = "clear"
"""Name of the passes that fill arrays and no more."""

OUTPUT = "_out"
"""Ending of a kernel's parameters that it writes; the buffer's name is what stands before it."""

RUN = "columns_each"
"""The parameter of a kernel whose threads each take a run of columns."""

LEFT_OUT = frozenset({"column_waves", "row_waves", "state", "torn_cells", "owner"})
"""Buffers that a kernel names and does not touch where its specification leaves them out. All others must be there:
Warp would write through the pointer of an array that is not."""


class Command(Protocol):
    """Something that a frame launches."""

    def launch(self) -> None:
        """Start it."""


@dataclass(frozen=True)
class FillCommand:
    """One fill of an array, and the pass of the plan that it is part of."""

    array: wp.array
    value: Any = 0
    pass_name: str = CLEAR

    def launch(self) -> None:
        """Start it."""
        self.array.fill_(self.value)


@dataclass(frozen=True)
class CopyCommand:
    """One copy of an array, from pinned memory of the host if it is to be part of a graph."""

    target: wp.array
    source: wp.array

    def launch(self) -> None:
        """Start it."""
        wp.copy(self.target, self.source)


Lanes = list[list[Command]]
"""Lane by lane, the commands in order."""

Stages = list[Lanes]
"""Stage by stage, lane by lane, the commands in order."""


class Recording(Protocol):
    """The launches of a frame and the arrays that they write.

    Attributes
    ----------
    stages : Stages
        One after the other; the lanes of a stage may run side by side.
    caustic_map, screen_map : wp.array or None
        float32 ``[rows, columns]`` or ``[rows, columns, 3]``; None for what the method does not make.
    """

    stages: Stages
    caustic_map: wp.array | None
    screen_map: wp.array | None

    def energy(self) -> Energy | None:
        """Read back the ledger; None for a method that follows no light."""


def bind(
    kernel: wp.Kernel,
    dim: tuple[int, ...],
    values: Mapping[str, Any],
    device: str,
    names: Mapping[str, str | None] | None = None,
    pass_name: str | None = None,
    block: int = 256,
    work: int | None = None,
) -> Command:
    """Record a launch; a parameter whose buffer was left out gets an array without elements.

    A kernel with a parameter ``columns_each`` takes so many columns a thread: its last dimension is divided by it.

    Parameters
    ----------
    kernel, dim, device
        What is launched, and where.
    values
        Buffers and values by name.
    names
        For parameters whose value has another name; None for an array that is left out.
    pass_name
        What the plan calls the pass; the kernel's own name when left out. No frame looks at it.
    block
        Threads of a block.
    work
        Values that the launch goes through, if not one a thread.
    """
    arguments = []
    work = math.prod(dim) if work is None else work
    for argument in kernel.adj.args:
        parameter = argument.label.removesuffix(OUTPUT)
        if parameter == RUN:
            dim = (*dim[:-1], -(-dim[-1] // values[RUN]))
        name = (names or {}).get(parameter, parameter)
        if name is not None and name in values:
            arguments.append(values[name])
        elif name is None or name in LEFT_OUT:
            kind: Any = argument.type
            arguments.append(_nothing(kind.ndim, kind.dtype, device))
        else:
            raise RenderError(f"kernel {kernel.key}: nothing in the plan is called {name!r}")
    launch: Any = wp.launch(kernel, dim=dim, inputs=arguments, device=device, block_dim=block, record_cmd=True)
    launch.pass_name, launch.work = pass_name or own_name(kernel), work
    return launch


def own_name(kernel: wp.Kernel) -> str:
    """Name of a kernel's function, without that of the factory that it was made in."""
    return kernel.key.split("__locals__")[-1].lstrip("_")


@functools.cache
def _nothing(ndim: int, dtype: Any, device: str) -> wp.array:
    """An array without elements."""
    return wp.empty((0,) * ndim, dtype=dtype, device=device)


def launches(lanes: Lanes) -> list[list[Callable[[], None]]]:
    """Give the calls that start the commands of each lane."""
    return [[command.launch for command in lane] for lane in lanes]


def run_stages(stages: Stages) -> None:
    """Launch all commands from this thread, one after the other."""
    for stage in stages:
        for lane in stage:
            for command in lane:
                command.launch()


def work_of(command: Command) -> int:
    """Values that a bound launch goes through; a fill or a copy counts for nothing."""
    return int(getattr(command, "work", 0))


def shaped(values: wp.array, rows: int, columns: int, colours: int) -> wp.array:
    """View a flat array of a map as ``[rows, columns]`` or ``[rows, columns, 3]``."""
    return values.reshape((rows, columns, colours) if colours > 1 else (rows, columns))
