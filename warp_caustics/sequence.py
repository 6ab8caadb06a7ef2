"""The words in which a method says its plan when it follows no strips of a lattice: launches one after the other.

Screen-space methods, filters over the water's normals and deferred pictures are sequences. Each kernel parameter ``x``
or ``x_out`` is launched with the buffer or value called ``x``, or what ``bind`` names for it: so one kernel serves
several views, whose buffers have a prefix and a dot.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .energy import Energy
    from .facts import Facts
    from .program import Buffer
    from .scene import Camera
    from .specify import Reason


@dataclass(frozen=True)
class Step:
    """One launch of a kernel in every frame.

    Attributes
    ----------
    name, does : str
        What the pass is called, and what it does in a line. Steps of one name are one pass of several launches.
    kernel : callable
        Builds the kernel; called when a renderer compiles, not when a plan is made.
    dim : tuple of int, or callable
        Launch dimensions, or what they are on a device.
    bind : mapping
        Parameters (without ``_out``) whose buffer or value has another name; None for an array that is left out.
    sums : tuple of str
        Parameters that every thread of the launch may add to. Their buffers are ``per_lane``, and hold their sum once
        all lanes of the stage have ended.
    weight : int
        Values that each thread goes through, as a row of a picture.
    """

    name: str
    does: str
    kernel: Callable[[], Any]
    dim: tuple[int, ...] | Callable[[str], tuple[int, ...]]
    bind: Mapping[str, str | None] = field(default_factory=dict)
    sums: tuple[str, ...] = ()
    weight: int = 1


@dataclass(frozen=True)
class Fill:
    """One fill of a whole buffer in every frame."""

    name: str
    does: str
    buffer: str
    value: Any = 0


@dataclass(frozen=True)
class Upload:
    """An array that is made once on a device, and what it takes there.

    Attributes
    ----------
    buffer : Buffer
        Its name, type and shape, so that a plan counts it.
    make : callable
        Makes it on a device.
    """

    buffer: Buffer
    make: Callable[[str], Any]

    def __call__(self, device: str) -> Any:
        """Make the array."""
        return self.make(device)


Lane = tuple[Step | Fill, ...]
"""Launches in order."""


@dataclass(frozen=True)
class Sequence:
    """What a method does for a frame: stages one after the other, each of lanes that may run side by side.

    A launch of a kernel that has the parameter ``begin`` is spread over threads by itself.

    Attributes
    ----------
    stages : tuple of tuple of Lane
        No two lanes of a stage write one buffer.
    buffers : tuple of Buffer
        All that is allocated, outputs included.
    caustic_map, screen_map : str or None
        The float32 buffers that hold the frame, ``[rows * columns * colours]``; None for what is not made.
    values : mapping
        Plain parameters of the kernels, by name. ``scene``, ``suns`` and ``clock`` (float64 ``[1]``, the frame's time)
        are there without being named.
    uploads : mapping
        By name, functions of a device that make a struct or number, once, or an :class:`Upload` that makes an array.
    views : callable, optional
        From a camera to host arrays by name: what follows the camera, copied again when it moves.
    settings : mapping
        The method's parameters as chosen, for people to read.
    reasons : tuple of Reason, optional
        What is kept and left out, and why; the scene's own where the method follows light as the scene says.
    warnings : tuple of str
        What a user should know of the method before trusting what it makes.
    meets_scene : bool
        Whether any kernel asks for ``scene`` or ``suns``, so that what they point to is made, and counted.
    follows_water : bool
        Whether the waves are looked at; if not, none are simulated.
    samples : int
        Photons, or pixels that are shaded, in a frame.
    energy : callable, optional
        Reads a frame's ledger back from the arrays by name; None for a method that follows no light.
    """

    stages: tuple[tuple[Lane, ...], ...]
    buffers: tuple[Buffer, ...]
    caustic_map: str | None = None
    screen_map: str | None = None
    values: Mapping[str, Any] = field(default_factory=dict)
    uploads: Mapping[str, Callable[[str], Any]] = field(default_factory=dict)
    views: Callable[[Camera], Mapping[str, Any]] | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)
    reasons: tuple[Reason, ...] | None = None
    warnings: tuple[str, ...] = ()
    meets_scene: bool = True
    follows_water: bool = True
    samples: int = 0
    energy: Callable[[Mapping[str, Any]], Energy] | None = None

    @property
    def looks(self) -> bool:
        """Whether a camera is needed."""
        return self.views is not None

    def steps(self) -> Iterator[Step | Fill]:
        """Every launch, in order."""
        for stage in self.stages:
            for lane in stage:
                yield from lane

    def launches(self, facts: Facts) -> int:
        """Kernel launches in a frame."""
        return sum(isinstance(step, Step) for step in self.steps())

    def lanes(self, facts: Facts) -> int:
        """Threads that can work side by side: on rows, or on lanes."""
        dims = (step.dim for step in self.steps() if isinstance(step, Step))
        return max(self._width, *(dim[0] for dim in dims if not callable(dim)))

    def copies(self, threads: int) -> int:
        """Count the buffers that are one for each band of a launch: lanes of a stage already fill threads."""
        return -(-threads // self._width)

    @property
    def _width(self) -> int:
        return max(len(stage) for stage in self.stages)

    def kernels(self, facts: Facts) -> tuple[str, ...]:
        """Names of the passes whose kernels are compiled."""
        return tuple(dict.fromkeys(step.name for step in self.steps() if isinstance(step, Step)))

    def own_buffers(self, facts: Facts) -> tuple[Buffer, ...]:
        """Buffers of the method."""
        uploaded = (upload.buffer for upload in self.uploads.values() if isinstance(upload, Upload))
        return (*self.buffers, *uploaded)

    def work(self, facts: Facts) -> int:
        """Photons or pixels in a frame."""
        return self.samples

    def size(self, facts: Facts) -> str:
        """Say how much there is to do."""
        scene = facts.scene
        if not self.looks or scene.camera is None:
            return f"map {scene.map.resolution[0]} x {scene.map.resolution[1]} pixels"
        return f"camera {scene.camera.resolution[0]} x {scene.camera.resolution[1]} pixels, {self.samples:,} samples"

    def pass_lines(self, facts: Facts) -> Iterator[tuple[str, int, str]]:
        """Each pass: its name, its launches, what it does."""
        counts: dict[tuple[str, str], int] = {}
        for step in self.steps():
            counts[step.name, step.does] = counts.get((step.name, step.does), 0) + 1
        for (name, does), count in counts.items():
            yield name, count, does
