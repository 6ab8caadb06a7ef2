"""The plan: what a scene and a method need, what they leave out and why, and how many bytes it takes."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from .assets import load_assets
from .capacity import SPARE_MEMORY, check_map_fits, check_work, steps_too_far, too_large
from .dispersion import CHANNELS, DispersedPlan, channel_scene
from .errors import InputError
from .facts import Facts, gather_facts, with_placed_water
from .magnitude import check_asset_magnitudes, check_magnitudes
from .methods import DISPERSING, METHODS
from .program import Buffer, Program
from .scene import Scene, known_method, load_scene
from .scene.faults import quoted
from .sequence import Sequence
from .simulation import SimulationPass, frame_launches, simulation_buffers, simulation_passes, step_launches
from .specify import Reason
from .window import TOO_FAR

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from .reference.plan import ReferencePlan

WAVE_BYTES, SUN_BYTES = 28, 20
"""Bytes of a wave and of a direction of the sun on the device."""

LONG_WORK = 2**27
"""Cells in a frame past which it takes minutes, and the plan says so."""


@dataclass(frozen=True)
class Plan:
    """What will be done for a frame, for people and for the renderer.

    Attributes
    ----------
    method, device : str
        By name.
    threads : int
        That a frame is spread over; 1 on a GPU.
    facts : Facts
        What follows from the scene.
    program : Program or Sequence
        What the method does.
    buffers : tuple of Buffer
        Everything that is allocated.
    """

    method: str
    device: str
    threads: int
    facts: Facts
    program: Program | Sequence
    buffers: tuple[Buffer, ...]

    @property
    def bytes(self) -> int:
        """Bytes of all buffers."""
        return sum(self.copies(buffer) * buffer.bytes for buffer in self.buffers)

    @property
    def settings(self) -> Mapping[str, Any]:
        """The method's parameters as chosen."""
        return self.program.settings

    @property
    def samples(self) -> int:
        """Cells or photons of a frame, all directions of the sun together."""
        return self.program.work(self.facts)

    @property
    def launches(self) -> int:
        """Kernel launches in a frame, a simulation's steps and drops apart."""
        water = 0 if self.facts.basin is None else frame_launches(self.facts.basin)
        return water + self.program.launches(self.facts)

    @property
    def water_passes(self) -> tuple[SimulationPass, ...]:
        """What a simulation of the water launches before all else."""
        return () if self.facts.basin is None else simulation_passes(self.facts.basin)

    @property
    def kernels(self) -> tuple[str, ...]:
        """Names of the kernels that are compiled."""
        return (*(step.name for step in self.water_passes), *self.program.kernels(self.facts))

    @property
    def reasons(self) -> tuple[Reason, ...]:
        """What is kept and left out, and why."""
        looks, scene = self.program.looks, self.facts.scene
        why_not = "this method does not look" if scene.camera else "no camera"
        camera = Reason("camera", looks, "this method looks through it" if looks else why_not)
        return (*(self.facts.reasons if self.program.reasons is None else self.program.reasons), camera)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a user should know before trusting the map."""
        work = self.samples
        long = (f"map: a frame takes {work:,} cells of water, which is minutes; {TOO_FAR}",) if work > LONG_WORK else ()
        return (*self.facts.warnings, *self.program.warnings, *long)

    def copies(self, buffer: Buffer) -> int:
        """Count how often a buffer is allocated."""
        return self.program.copies(self.threads) if buffer.per_lane else 1

    def __str__(self) -> str:
        """Return the plan as text: kept, left out, why, bytes."""
        return "\n".join(self._lines())

    def _lines(self) -> Iterator[str]:
        program = self.program
        settings = ", ".join(f"{name} = {value}" for name, value in program.settings.items())
        yield f"{self.facts.scene.name}: method {self.method} ({settings}) on {self.device}, {self.threads} thread(s)"
        yield f"  {program.size(self.facts)}"
        yield "passes"
        for one in self.water_passes:
            often = "launch(es)" if one.each == "frame" else f"a {one.each}"
            yield f"  {one.name:<16}{one.launches:>6} {often:<12}{one.does}"
        for name, count, does in program.pass_lines(self.facts):
            yield f"  {name:<16}{count:>6} launch(es)  {does}"
        for kept in (True, False):
            yield "kept" if kept else "left out"
            for reason in self.reasons:
                if reason.kept == kept:
                    yield f"  {reason.what:<28}{reason.why}"
        yield "buffers"
        for buffer in self.buffers:
            copies = self.copies(buffer)
            times = f" x {copies} threads" if copies > 1 else ""
            shape = " x ".join(str(length) for length in buffer.shape)
            yield f"  {buffer.name:<16}{copies * buffer.bytes:>14,} bytes  {buffer.dtype} {shape}{times}"
        steps = 0 if self.facts.basin is None else step_launches(self.facts.basin)
        more = f" and {steps} for each step of the water" if steps else ""
        yield f"{self.launches} launches{more}, {len(self.kernels)} kernels, {self.bytes:,} bytes"
        for warning in self.warnings:
            yield f"warning: {warning}"


def make_plan(
    scene: Scene | str | os.PathLike[str],
    method: str | None = None,
    device: str | None = None,
    threads: int | None = None,
) -> Plan | DispersedPlan | ReferencePlan:
    """Plan a scene: which passes and buffers it needs, and why the others are left out.

    Nothing is compiled and nothing is allocated on a device.

    Parameters
    ----------
    scene : Scene, str or path
        A scene, the name of a bundled one, or a file.
    method : str, optional
        Instead of the scene's own.
    device : str, optional
        ``"cpu"``, ``"cuda:0"``; the best one present if not given.
    threads : int, optional
        Threads on a CPU; all cores if not given.

    Returns
    -------
    Plan
        Or, for the method ``"reference"``, a ReferencePlan, and for traced dispersion in plan view, a DispersedPlan;
        they print and count alike.

    Raises
    ------
    InputError
        If the scene, method, device or number of threads cannot be used together, or would not fit in memory.
    """
    from .device import free_memory, resolve_device, resolve_threads

    if not isinstance(scene, Scene):
        scene = load_scene(scene)
    name = known_method(method if method is not None else scene.method.name)
    device = resolve_device(device)
    check_magnitudes(scene)
    lanes, free = resolve_threads(threads, device), free_memory(device)
    check_map_fits(scene, device, free)
    assets = load_assets(scene)
    check_asset_magnitudes(assets)
    facts = gather_facts(scene, assets)
    if name == "reference":
        from .reference.plan import plan_reference

        return plan_reference(facts, device, lanes, free)
    room = Room(device, lanes, fewer=threads is None, free=free)
    if scene.medium.dispersion != "none" and name not in DISPERSING:
        return _plan_by_channel(facts, name, room)
    return _plan(facts, name, room)


@dataclass(frozen=True)
class Room:
    """What a plan may use: a device, its threads (fewer if need be and the user named none), and free memory."""

    device: str
    threads: int
    fewer: bool
    free: int


def _plan_by_channel(facts: Facts, name: str, room: Room) -> DispersedPlan:
    """Plan each channel by itself."""
    scene, room = facts.scene, replace(room, free=room.free // len(CHANNELS))
    if scene.medium.dispersion == "post":
        raise InputError(
            f'medium.dispersion = "post" is not for method "{name}", which does not splat into a camera\'s pixels; '
            f'expected "traced", or method {quoted(DISPERSING)}'
        )
    scene = with_placed_water(scene, facts.assets)
    plans = [_plan(gather_facts(channel_scene(scene, c), facts.assets), name, room) for c in range(3)]
    if not isinstance(plans[0].program, Program):
        raise InputError(f'medium.dispersion = "{scene.medium.dispersion}": method "{name}" refracts no light')
    return DispersedPlan(facts, (plans[0], plans[1], plans[2]))


def _plan(facts: Facts, name: str, room: Room) -> Plan:
    facts = replace(facts, device=room.device)
    program = METHODS[name](facts)
    if isinstance(program, Sequence) and not program.follows_water:
        facts = replace(facts, basin=None)
    check_work(facts, program)
    if isinstance(program, Program):
        program = program.spread(room.threads, len(facts.suns))
    lanes = min(room.threads, program.lanes(facts))
    plan = Plan(name, room.device, lanes, facts, program, _buffers(facts, program))
    too_far = steps_too_far(plan)
    if too_far and not room.fewer:
        columns, rows = facts.scene.map.resolution
        raise InputError(
            f"threads: {lanes} of them have a map of {columns} x {rows} pixels each, of more bytes than a kernel can "
            "step over; expected 1, or a smaller map"
        )
    if too_far or (plan.bytes > SPARE_MEMORY * room.free and room.fewer):
        # Each thread has a map of its own; with fewer there may be room.
        plan = replace(plan, threads=1)
    if plan.bytes > SPARE_MEMORY * room.free:
        raise InputError(too_large(plan, room.free) + (" or threads" if lanes > 1 else ""))
    return plan


def _buffers(facts: Facts, program: Program | Sequence) -> tuple[Buffer, ...]:
    if isinstance(program, Sequence) and not program.meets_scene:
        return program.own_buffers(facts)
    buffers = [*program.own_buffers(facts), Buffer("suns", "SunSample", (len(facts.suns),), SUN_BYTES)]
    if facts.waves:
        buffers.append(Buffer("waves", "Wave", (facts.waves,), WAVE_BYTES))
    for name, grid in (("water_nodes", facts.assets.water), ("terrain_nodes", facts.assets.terrain)):
        if grid is not None:
            buffers.append(Buffer(name, "vec4", grid.z.shape, 16))
    if facts.basin is not None:
        buffers += simulation_buffers(facts.basin)
    for name, mesh in (("mesh", facts.assets.mesh), ("objects", facts.assets.objects)):
        if mesh is not None:
            # Vertices and indices; the BVH is Warp's own and comes on top.
            buffers.append(Buffer(name, "Mesh", (mesh.vertices.size + mesh.triangles.size,), 4))
    return tuple(buffers)
