"""Recorded frames: every launch of a frame bound to its arguments, once, so that a frame allocates nothing."""

from __future__ import annotations

from collections.abc import Mapping
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

OUTPUT = "_out"
"""Ending of a kernel's parameters that it writes; the buffer's name is what stands before it."""

LEFT_OUT = frozenset({"column_waves", "row_waves", "state", "torn_cells", "owner"})
"""Buffers that a kernel names and does not touch where its specification leaves them out. All others must be there:
Warp would write through the pointer of an array that is not."""


class Command(Protocol):
    """Something that a frame launches."""

    def launch(self) -> None:
        """Start it."""


@dataclass(frozen=True)
class FillCommand:
    """One fill of an array."""

    array: wp.array
    value: Any = 0

    def launch(self) -> None:
        """Start it."""
        self.array.fill_(self.value)


Stages = list[list[list[Command]]]
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
) -> Command:
    """Record a launch; a parameter whose buffer was left out gets an array without elements.

    Parameters
    ----------
    kernel, dim, device
        What is launched, and where.
    values
        Buffers and values by name.
    names
        For parameters whose value has another name; None for an array that is left out.
    """
    arguments = []
    for argument in kernel.adj.args:
        parameter = argument.label.removesuffix(OUTPUT)
        name = (names or {}).get(parameter, parameter)
        if name is not None and name in values:
            arguments.append(values[name])
        elif name is None or name in LEFT_OUT:
            kind: Any = argument.type
            arguments.append(wp.empty((0,) * kind.ndim, dtype=kind.dtype, device=device))
        else:
            raise RenderError(f"kernel {kernel.key}: nothing in the plan is called {name!r}")
    return wp.launch(kernel, dim=dim, inputs=arguments, device=device, record_cmd=True)


def shaped(values: wp.array, rows: int, columns: int, colours: int) -> wp.array:
    """View a flat array of a map as ``[rows, columns]`` or ``[rows, columns, 3]``."""
    return values.reshape((rows, columns, colours) if colours > 1 else (rows, columns))
