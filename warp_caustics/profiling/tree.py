"""What a profile says: a tree of passes with times and counts, the limits that they are held against, the memory."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from pydantic import TypeAdapter, computed_field
from pydantic.dataclasses import dataclass

from ..files import whole_file

MEMORY, ARITHMETIC = "memory", "arithmetic"
"""What may limit a pass."""


@dataclass(frozen=True)
class Limits:
    """What the device can do at best, as measured in the same run.

    Attributes
    ----------
    threads : int
        That worked side by side; 1 on a GPU.
    bandwidth : float
        Bytes read and written in a copy [1/s].
    operations : float
        Single-precision floating-point operations [1/s].
    """

    threads: int
    bandwidth: float
    operations: float


@dataclass(frozen=True)
class ProfileNode:
    """A frame, a part of it, or a pass.

    Attributes
    ----------
    name, does : str
        What it is called, and what it does.
    milliseconds : float
        Of the frame's time. Where lanes run side by side, their stage takes about as long as the longest of them, and
        each of its passes the same share of that as of the lanes' own times; so the children of a node add up to it.
    launches : int
        Of kernels; fills of arrays too.
    bytes_read, bytes_written : int
        The least that memory must move, see :mod:`.traffic`.
    operations : int or None
        In floating point, as executed, see :mod:`.tally`; None where they are not known.
    floor_milliseconds : float
        What these bytes, or these operations, take at the least; the larger of both, of a node with children the sum of
        theirs.
    limit : str or None
        Which of the two that is, ``"memory"`` or ``"arithmetic"``; None for what moves nothing, or mixes.
    lanes : tuple of float
        Of a stage, the time of each lane [ms].
    children : tuple of ProfileNode
        Its parts, in the order in which they begin.
    """

    name: str
    does: str
    milliseconds: float
    launches: int = 0
    bytes_read: int = 0
    bytes_written: int = 0
    operations: int | None = 0
    floor_milliseconds: float = 0.0
    limit: str | None = None
    lanes: tuple[float, ...] = ()
    children: tuple[ProfileNode, ...] = ()

    @computed_field  # type: ignore[prop-decorator]
    @property
    def bandwidth(self) -> float:
        """Bytes read and written per second, by the count of bytes."""
        moved = self.bytes_read + self.bytes_written
        return 1e3 * moved / self.milliseconds if self.milliseconds > 0.0 else 0.0

    @computed_field  # type: ignore[prop-decorator]
    @property
    def floor_share(self) -> float:
        """The floor as a share of the time that it took: 1 is as fast as can be."""
        return self.floor_milliseconds / self.milliseconds if self.milliseconds > 0.0 else 0.0

    @property
    def passes(self) -> Iterator[ProfileNode]:
        """Give the leaves, in order."""
        if not self.children:
            yield self
        for child in self.children:
            yield from child.passes


def joined(name: str, does: str, children: tuple[ProfileNode, ...], lanes: tuple[float, ...] = ()) -> ProfileNode:
    """Make a node of its parts, with their sums."""
    known = [child.operations for child in children if child.operations is not None]
    limits = {child.limit for child in children if child.floor_milliseconds > 0.0}
    return ProfileNode(
        name,
        does,
        sum(child.milliseconds for child in children),
        sum(child.launches for child in children),
        sum(child.bytes_read for child in children),
        sum(child.bytes_written for child in children),
        sum(known) if len(known) == len(children) else None,
        sum(child.floor_milliseconds for child in children),
        limits.pop() if len(limits) == 1 else None,
        lanes,
        children,
    )


@dataclass(frozen=True)
class BufferUse:
    """A buffer of the plan: its element and shape, how often it is allocated, and the bytes of all copies."""

    name: str
    dtype: str
    shape: tuple[int, ...]
    copies: int
    bytes: int


@dataclass(frozen=True)
class Memory:
    """Memory of a renderer.

    Attributes
    ----------
    buffers : tuple of BufferUse
        What the plan counted.
    planned : int
        Their sum [bytes].
    peak : int
        The largest sum of what Warp had allocated at once, on host and devices, while the renderer was made and frames
        ran [bytes].
    pool_peak : int or None
        High-water mark of a CUDA device's memory pool since the process began [bytes]; None elsewhere.
    frame_allocations : int
        Allocations in the profiled frames; 0 is what is promised.
    """

    buffers: tuple[BufferUse, ...]
    planned: int
    peak: int
    pool_peak: int | None
    frame_allocations: int


@dataclass(frozen=True)
class Profile:
    """Where the time and the memory of a frame went.

    Attributes
    ----------
    scene, method, device : str
        By name.
    threads : int
        Of the plan.
    time : float
        Of the first of the profiled frames [s].
    samples : int
        Cells, photons or pixels of a frame, as the plan counts them.
    frames : int
        Frames that were measured each way; the fastest counts.
    frame : ProfileNode
        The traced frame.
    untraced_milliseconds : float
        The frame as it is without tracing.
    limits : tuple of Limits
        For one thread, and for all.
    memory : Memory
        By buffer, and its peak.
    """

    scene: str
    method: str
    device: str
    threads: int
    time: float
    samples: int
    frames: int
    frame: ProfileNode
    untraced_milliseconds: float
    limits: tuple[Limits, ...]
    memory: Memory

    @property
    def difference(self) -> float:
        """How much longer the passes of the traced frame took than the frame without tracing, as a share of that."""
        return self.frame.milliseconds / self.untraced_milliseconds - 1.0

    def to_json(self) -> str:
        """Return the profile as JSON, with the derived bandwidth and share of the floor at each node."""
        return TypeAdapter(Profile).dump_json(self, indent=1).decode() + "\n"

    @classmethod
    def from_json(cls, text: str) -> Profile:
        """Read what :meth:`to_json` wrote."""
        return TypeAdapter(Profile).validate_json(text)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the JSON to a file, whole or not at all, and return its path.

        Raises
        ------
        InputError
            The file cannot be written.
        """
        with whole_file(path) as temporary:
            temporary.write_text(self.to_json(), encoding="utf-8")
        return Path(path)
