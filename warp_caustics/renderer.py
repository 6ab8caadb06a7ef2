"""The renderer: allocates what the plan kept, once; compiles; launches; reads back only when asked."""

from __future__ import annotations

import os
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING, Any

import warp as wp

from .errors import InputError, RenderError
from .kernels.deposit import ACCUMULATOR, FLUX, unit
from .kernels.resolve import make_dry_land, make_resolve
from .ledger import read_energy
from .plan import Plan, make_plan
from .result import Result
from .scene import Scene, load_scene
from .state import SceneState
from .water import check_time

if TYPE_CHECKING:
    from .reference.renderer import ReferenceRenderer

DTYPES: Mapping[str, Any] = {"float32": wp.float32, "vec1": FLUX[1], "vec2": wp.vec2, "vec3": FLUX[3],
                             "uint8": wp.uint8}  # fmt: skip
"""Elements of a program's buffers."""

OUTPUT = "_out"
"""Ending of a kernel's parameters that it writes; the buffer's name is what stands before it."""


LEFT_OUT = frozenset({"column_waves", "row_waves", "state", "torn_cells"})
"""Buffers that a kernel names and does not touch where its specification leaves them out. All others must be there:
Warp would write through the pointer of an array that is not."""


@dataclass(frozen=True)
class Frame:
    """A frame on the device; its arrays are the renderer's own and hold until the next frame.

    Attributes
    ----------
    caustic_map : wp.array
        float32 ``[rows, columns]`` or ``[rows, columns, 3]``, as :attr:`Result.caustic_map`.
    time : float
        [s].
    """

    caustic_map: wp.array
    time: float


class Renderer:
    """Renders frames of one scene by one method.

    Parameters
    ----------
    scene : Scene, str or path
        A scene, the name of a bundled one, or a file.
    method, device, threads
        As for :func:`~warp_caustics.make_plan`.

    Attributes
    ----------
    plan : Plan
        What it does, and what it leaves out.
    compile_seconds : float
        Time that building and loading the kernels took.

    Raises
    ------
    InputError
        As :func:`~warp_caustics.make_plan`.
    """

    def __init__(
        self,
        scene: Scene | str | os.PathLike[str],
        method: str | None = None,
        device: str | None = None,
        threads: int | None = None,
    ) -> None:
        plan = make_plan(scene, method, device, threads)
        if not isinstance(plan, Plan):
            raise InputError("method: a reference is converged anew for each frame; use warp_caustics.render(...)")
        self.plan: Plan = plan
        self._state = SceneState(self.plan.facts, self.plan.device)
        self._allocate()
        start = perf_counter()
        self._lanes = self._record()
        self.compile_seconds = perf_counter() - start
        self._pool = ThreadPoolExecutor(self.plan.threads) if self.plan.threads > 1 else None
        self._time: float | None = None
        self._seconds = 0.0

    def render(self, time: float = 0.0) -> Frame:
        """Render the frame at a time [s]: no allocation, no read-back.

        Returns
        -------
        Frame
            On the device; on a GPU the work may still be under way.

        Raises
        ------
        InputError
            If the time is not finite, so late that the waves' phases are not known, or one that the water's
            simulation does not reach.
        """
        check_time(time)
        start = perf_counter()
        self._state.write(time)
        if self._pool is None:
            self._run(0)
        else:
            # list() waits for every lane, and passes on what went wrong in one.
            list(self._pool.map(self._run, range(self.plan.threads)))
        for launch in self._closing:
            launch.launch()
        self._time, self._seconds = time, perf_counter() - start
        return Frame(self._shaped, time)

    def result(self) -> Result:
        """Read back the last frame; render the one at time 0 first if there is none."""
        if self._time is None:
            self.render(0.0)
        start = perf_counter()
        wp.synchronize_device(self.plan.device)
        waited = perf_counter() - start if self.plan.device != "cpu" else 0.0
        facts = self.plan.facts
        caustic_map = self._shaped.numpy().copy()
        energy = read_energy(self.plan, self._ledgers.numpy(), caustic_map, self._dry.numpy())
        return Result(
            scene=facts.scene,
            method=self.plan.method,
            device=self.plan.device,
            time=self._time or 0.0,
            plan=self.plan,
            caustic_map=caustic_map,
            energy=energy,
            seconds=self._seconds + waited,
            assets=facts.assets,
            notes=() if self._state.simulated is None else self._state.simulated.warnings(),
        )

    def _allocate(self) -> None:
        plan, device = self.plan, self.plan.device
        columns, rows = plan.facts.scene.map.resolution
        colours = len(plan.facts.irradiance)
        buffers = {buffer.name: buffer for buffer in plan.buffers}
        accumulator = ACCUMULATOR[plan.program.accumulate]
        self._maps = wp.zeros((plan.threads, *buffers["map"].shape), dtype=accumulator, device=device)
        self._ledgers = wp.zeros((plan.threads, *buffers["ledger"].shape), dtype=wp.float64, device=device)
        self._caustic_map = wp.zeros(buffers["caustic_map"].shape, dtype=wp.float32, device=device)
        self._shaped = self._caustic_map.reshape((rows, columns, colours) if colours == 3 else (rows, columns))
        self._dry = wp.zeros(buffers["dry"].shape if "dry" in buffers else 0, dtype=wp.float64, device=device)
        self._own = [
            {
                buffer.name: wp.empty(buffer.shape, dtype=DTYPES[buffer.dtype], device=device)
                for buffer in plan.program.buffers
            }
            for _ in range(plan.threads)
        ]

    def _record(self) -> list[list[Any]]:
        """Build each kernel, and bind every launch of a frame to its arguments, lane by lane."""
        plan, program = self.plan, self.plan.program
        lattice = self._state.lattice(program.lattice)
        common = {"scene": self._state.scene, "suns": self._state.suns, "lattice": lattice, **program.values}
        kernels = [(step, step.kernel()) for step in program.passes]
        lanes: list[list[Any]] = [[] for _ in range(plan.threads)]
        jobs = [(sun, strip) for sun in range(len(plan.facts.suns)) for strip in range(program.strips)]
        for number, (sun, strip) in enumerate(jobs):
            lane = number % plan.threads
            first = strip * program.strip_rows
            rows = min(program.strip_rows, program.lattice.count[1] - first)
            values = {
                **common, **self._own[lane], "sun": sun, "first_row": program.lattice.first[1] + first,
                "map": self._maps[lane], "ledger": self._ledgers[lane],
            }  # fmt: skip
            lanes[lane] += [self._bind(kernel, step.dim(rows), values) for step, kernel in kernels]
        self._closing = self._record_closing()
        return lanes

    def _record_closing(self) -> list[Any]:
        facts, program = self.plan.facts, self.plan.program
        colours = len(facts.irradiance)
        # A cell's flux over a pixel's area is its share of the pixel; each direction of the sun has its own share.
        share = program.lattice.step**2 * facts.sun_share * unit(program.accumulate)
        scale = [share * facts.irradiance[i % colours] for i in range(3)]
        one_sun = wp.vec3(*(facts.sun_share * facts.irradiance[i % colours] for i in range(3)))
        resolve = make_resolve(program.accumulate, facts.spec.channels, colours)
        values = {
            "lanes": self._maps, "scale": wp.vec3d(*scale), "map": self._caustic_map, "scene": self._state.scene,
            "suns": self._state.suns, "pixel": wp.vec2(*facts.pixel), "columns": facts.scene.map.resolution[0],
            "irradiance": one_sun, "colours": colours, "dry": self._dry,
        }  # fmt: skip
        closing = [self._bind(resolve, self._caustic_map.shape, values)]
        if facts.spec.shore:
            columns, rows = facts.scene.map.resolution
            closing.append(self._bind(make_dry_land(facts.spec), (rows, columns), values))
        return closing

    def _bind(self, kernel: wp.Kernel, dim: tuple[int, ...], values: Mapping[str, Any]) -> Any:
        """Record a launch; a parameter whose buffer was left out gets an array without elements."""
        arguments = []
        for argument in kernel.adj.args:
            name = argument.label.removesuffix(OUTPUT)
            if name in values:
                arguments.append(values[name])
            elif name in LEFT_OUT:
                kind: Any = argument.type
                arguments.append(wp.empty((0,) * kind.ndim, dtype=kind.dtype, device=self.plan.device))
            else:
                raise RenderError(f"kernel {kernel.key}: nothing in the plan is called {name!r}")
        return wp.launch(kernel, dim=dim, inputs=arguments, device=self.plan.device, record_cmd=True)

    def _run(self, lane: int) -> None:
        self._maps[lane].zero_()
        self._ledgers[lane].zero_()
        if lane == 0:
            self._dry.zero_()
        for launch in self._lanes[lane]:
            launch.launch()


def make_renderer(
    scene: Scene | str | os.PathLike[str],
    method: str | None = None,
    device: str | None = None,
    threads: int | None = None,
) -> Renderer | ReferenceRenderer:
    """Make the renderer of a method: the reference has one of its own.

    Raises
    ------
    InputError
        As :func:`~warp_caustics.make_plan`.
    """
    if not isinstance(scene, Scene):
        scene = load_scene(scene)
    if (scene.method.name if method is None else method) == "reference":
        from .reference.renderer import ReferenceRenderer

        return ReferenceRenderer(scene, device, threads)
    return Renderer(scene, method, device, threads)


def render(
    scene: Scene | str | os.PathLike[str],
    method: str | None = None,
    device: str | None = None,
    threads: int | None = None,
    time: float = 0.0,
) -> Result:
    """Render one caustic map.

    Parameters
    ----------
    scene : Scene, str or path
        A scene, the name of a bundled one, or a file.
    method, device, threads
        As for :func:`~warp_caustics.make_plan`.
    time : float
        [s].

    Returns
    -------
    Result

    Raises
    ------
    InputError
        As :func:`~warp_caustics.make_plan`.
    """
    renderer = make_renderer(scene, method, device, threads)
    renderer.render(time)
    return renderer.result()
