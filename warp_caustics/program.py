"""The words in which a method says its plan: passes and buffers, by name.

A pass names a kernel and the shape of its launch. What it is launched with follows from the kernel's own signature:
each parameter stands for the value or buffer of its name, ``map_out`` for the buffer ``map``. Buffers that no pass of
a program has are not allocated.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from .kernels.lanes import padded
from .kernels.ledger import BINS, ENTRIES
from .kernels.place_table import place_table
from .kernels.wave_rows import wave_planes
from .kernels.wave_table import wave_table

if TYPE_CHECKING:
    from .facts import Facts
    from .kernels.spec import Spec
    from .scene import Scene
    from .window import Lattice


MOST_WORK = 2**33
"""Cells in a frame at most, all directions of the sun together: a core goes through them in a day."""

MOST_JOBS = 4096
"""Strips times directions of the sun at most: each is recorded, at 4 KB and a tenth of a millisecond a launch."""


MANY_STRIPS = 8
"""Strips for each thread past which one more or less makes little difference."""

LEAST_STRIP = 16
"""Rows of a strip that is made smaller than its method asks for: a strip has rows of corners beside it."""


ACCUMULATOR_BYTES = {"float32": 4, "float64": 8, "fixed": 8}
"""Of an element of the map while light is added up."""

CROWD = 2**12
"""Cells for each pixel past which a map is summed in float64 unless the scene says otherwise: float32 rounds as many
sums to 1e-5 of a pixel, and at 2^24 of them adds nothing more."""


def accumulator(scene: Scene, lattice: Lattice) -> str:
    """Choose the number format that a map is summed in: the scene's own, or what its cells need if it names none."""
    columns, rows = scene.map.resolution
    crowded = lattice.cells > CROWD * columns * rows
    if crowded and "accumulate" not in scene.method.model_fields_set:
        return "float64"
    return scene.method.accumulate


def strip_rows(least: int, lattice: Lattice, suns: int) -> int:
    """Rows of a strip: at least so many, and so many that there are not too many strips to record."""
    return min(max(least, -(-lattice.count[1] * suns // MOST_JOBS)), lattice.count[1])


@dataclass(frozen=True)
class Buffer:
    """An array of a program: its element by Warp's name, and its shape; a ``per_lane`` one exists once a thread."""

    name: str
    dtype: str
    shape: tuple[int, ...]
    element_bytes: int
    per_lane: bool = False

    @property
    def bytes(self) -> int:
        """Bytes of one copy."""
        total = self.element_bytes
        for length in self.shape:
            total *= length
        return total


@dataclass(frozen=True)
class Pass:
    """One launch, for each strip of the lattice and direction of the sun.

    Attributes
    ----------
    name : str
        What the pass is called.
    does : str
        What it does, in a line.
    kernel : callable
        Builds the kernel; called when a renderer compiles, not when a plan is made.
    dim : callable
        Rows of the strip to launch dimensions, or to the items of a pass that walks.
    weight : int
        Values that each thread goes through, as a row of a picture.
    walks : bool
        Whether a thread walks over a block of items: all of a strip on a CPU, one on a GPU.
    """

    name: str
    does: str
    kernel: Callable[[], Any]
    dim: Callable[[int], tuple[int, ...]]
    weight: int = 1
    walks: bool = False


def wave_pass(spec: Spec, lattice: Lattice, waves: int, rows: int, border: int, offset: float) -> WavePass:
    """Plan the tables of a lattice's waves, or of its places in water that repeats; nothing for other water.

    Parameters
    ----------
    spec : Spec
        Of the scene.
    lattice : Lattice
        The water's cells.
    waves : int
        Count of the waves.
    rows : int
        Rows of points in a strip.
    border : int
        Points beyond the last of a strip's cells, both sides together.
    offset : float
        Of the first point from the first cell's corner [cells].
    """
    if spec.water not in ("waves", "periodic"):
        return WavePass((), (), {})
    columns = lattice.count[0] + border
    if spec.water == "waves":
        name, does, kernel = "waves", "sines of each row and column of points", wave_table
    else:
        name, does, kernel, waves = "places", "nodes beside each row and column of points", place_table, 1
    return WavePass(
        (Pass(name, does, lambda: kernel, lambda strip: (max(columns, strip + border),)),),
        (Buffer("column_waves", "vec2", (columns, waves), 8, per_lane=True),
         Buffer("row_waves", "vec2", (rows + border, waves), 8, per_lane=True)),
        {"offset": offset},
    )  # fmt: skip


def wave_plane_pass(lattice: Lattice, waves: int, rows: int, border: int = 0, offset: float = 0.5) -> WavePass:
    """Plan the tables of a lattice's waves, laid out for whole rows of columns; parameters as :func:`wave_pass`."""
    columns = padded(lattice.count[0] + border)
    tables = Pass(
        "wave_planes", "sines of each row and column of points", lambda: wave_planes,
        lambda strip: (max(columns, strip + border),),
    )  # fmt: skip
    buffers = (
        Buffer("column_cos", "float32", (waves, columns), 4, per_lane=True),
        Buffer("column_sin", "float32", (waves, columns), 4, per_lane=True),
        Buffer("row_waves", "vec2", (rows + border, waves), 8, per_lane=True),
    )
    return WavePass((tables,), buffers, {"offset": offset})


@dataclass(frozen=True)
class WavePass:
    """The pass, buffers and values of :func:`wave_pass`, to be joined to a program's own."""

    passes: tuple[Pass, ...]
    buffers: tuple[Buffer, ...]
    values: Mapping[str, Any]


@dataclass(frozen=True)
class Program:
    """What a method does for a frame, before the map is resolved.

    Attributes
    ----------
    lattice : Lattice
        The water's cells.
    strip_rows : int
        Rows of the lattice that are worked on at a time.
    passes : tuple of Pass
        In order, for each strip.
    buffers : tuple of Buffer
        What the passes need besides the map and the ledger.
    values : mapping
        Plain parameters of the kernels, by name.
    accumulate : str
        Number format of the map while light is added up.
    settings : mapping
        The method's parameters as chosen, for people to read.
    banded : bool
        Whether strips may run side by side, each thread adding to a map of its own. If not, there is one strip, and
        each pass whose kernel has the parameter ``begin`` is spread over threads by itself.
    steps : bool
        Whether the map is summed up from steps along its rows (:mod:`.kernels.edges`), in float64.
    conserves : bool
        Whether the map holds the light that arrives in it, so that its sum is what was received. Else the ledger counts
        that apart, and what the map holds beyond it was invented.
    """

    lattice: Lattice
    strip_rows: int
    passes: tuple[Pass, ...]
    buffers: tuple[Buffer, ...]
    values: Mapping[str, Any] = field(default_factory=dict)
    accumulate: str = "float32"
    settings: Mapping[str, Any] = field(default_factory=dict)
    banded: bool = True
    steps: bool = False
    conserves: bool = True

    @property
    def strips(self) -> int:
        """Strips that cover the lattice."""
        return -(-self.lattice.count[1] // self.strip_rows)

    @property
    def looks(self) -> bool:
        """A lattice lights a map in plan view, and asks for no camera."""
        return False

    @property
    def reasons(self) -> None:
        """What is kept and left out follows from the scene alone."""
        return None

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is to be known follows from the scene alone."""
        return ()

    def launches(self, facts: Facts) -> int:
        """Kernel launches in a frame."""
        return sum(count for _, count, _ in self.pass_lines(facts))

    def lanes(self, facts: Facts) -> int:
        """Threads that can work side by side: on strips, or on rows of a pass."""
        return self.strips * len(facts.suns) if self.banded else self.lattice.count[1]

    def copies(self, threads: int) -> int:
        """Count the buffers that are one for each lane."""
        return threads

    def spread(self, threads: int, suns: int) -> Program:
        """Cut the strips so that each thread gets as many as the others, if there are so few that it matters."""
        if not self.banded or self.strips * suns > MANY_STRIPS * threads:
            return self
        strips = self.strips
        while strips * suns % threads:
            strips += 1
        rows = -(-self.lattice.count[1] // strips)
        return replace(self, strip_rows=rows) if rows >= LEAST_STRIP else self

    def kernels(self, facts: Facts) -> tuple[str, ...]:
        """Names of the kernels that are compiled."""
        return tuple(name for name, _, _ in self.pass_lines(facts))

    def own_buffers(self, facts: Facts) -> tuple[Buffer, ...]:
        """Buffers of the method, its map and its ledger."""
        columns, rows = facts.scene.map.resolution
        channels = facts.spec.channels
        dry = (Buffer("dry", "float64", (3,), 8, per_lane=True),) if facts.spec.shore else ()
        own = self.buffers if self.banded else (replace(buffer, per_lane=False) for buffer in self.buffers)
        return (
            Buffer("caustic_map", "float32", (columns * rows * len(facts.irradiance),), 4),
            self._accumulator(columns, rows, channels),
            Buffer("ledger", "float64", (len(ENTRIES) * channels, BINS), 8, per_lane=True),
            *own,
            *dry,
        )  # fmt: skip

    def _accumulator(self, columns: int, rows: int, channels: int) -> Buffer:
        """What a lane adds light to: pixels, or steps, which have a column and a row more and another after them."""
        values = (columns + 1) * (rows + 1) + 1 if self.steps else columns * rows
        return Buffer("map", self.accumulate, (values * channels,), ACCUMULATOR_BYTES[self.accumulate], self.banded)

    def work(self, facts: Facts) -> int:
        """Cells in a frame, all directions of the sun together."""
        return self.lattice.cells * len(facts.suns)

    def size(self, facts: Facts) -> str:
        """Say how much there is to do."""
        (columns, rows), (across, along) = facts.scene.map.resolution, self.lattice.count
        return f"map {columns} x {rows} pixels, water {across} x {along} cells, {len(facts.suns)} sun direction(s)"

    def pass_lines(self, facts: Facts) -> Iterator[tuple[str, int, str]]:
        """Each pass: its name, its launches, what it does."""
        for step in self.passes:
            yield step.name, self.strips * len(facts.suns), step.does
        yield "resolve", 1, "lanes added up and scaled to irradiance"
        if facts.spec.shore:
            yield "dry_land", 1, "direct sunlight on dry land"
