"""The recorded frame of a method that follows light from a lattice of the water into a map in plan view.

Strips are spread over lanes that own what they write; a program whose strips cannot run side by side has its passes cut
into bands of rows instead, each lane with a ledger of its own. Then the lanes are added up, and dry land is lit.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import warp as wp

from .bands import bind_lanes
from .kernels.deposit import ACCUMULATOR, unit
from .kernels.resolve import make_dry_land, make_resolve
from .kernels.resolve_steps import make_resolve_steps
from .ledger import read_energy
from .recording import DTYPES, RUN, Command, FillCommand, Lanes, Stages, bind, shaped

if TYPE_CHECKING:
    from collections.abc import Mapping

    from .energy import Energy
    from .plan import Plan
    from .program import Pass, Program
    from .state import SceneState


def columns_each(device: str, columns: int) -> int:
    """Choose the columns that a thread takes, of kernels that leave it open.

    A CPU's loop over a whole row keeps in registers what a thread for each column would fetch again; on a GPU
    neighbouring threads read neighbouring columns.
    """
    return columns if device == "cpu" else 1


class LatticeRecording:
    """All launches of a frame, bound.

    Attributes
    ----------
    stages, caustic_map, screen_map
        As :class:`~warp_caustics.recording.Recording`.
    maps, ledgers : wp.array
        Of each lane; lanes of bands share one map.
    flat_map : wp.array
        The caustic map as ``[rows * columns * colours]``.
    """

    def __init__(self, plan: Plan, program: Program, state: SceneState) -> None:
        self._plan, self._program, self._state = plan, program, state
        self.caustic_map: wp.array | None = None
        self.screen_map: wp.array | None = None
        self._allocate()
        passes = [self._record_strips()] if program.banded else self._record_bands()
        self.stages: Stages = [*passes, *self._record_closing()]

    def energy(self) -> Energy:
        """Read back the ledger."""
        dry = self._dry.numpy().sum(axis=0)
        return read_energy(self._plan, self._program, self.ledgers.numpy(), self.flat_map.numpy(), dry)

    def _allocate(self) -> None:
        plan, device = self._plan, self._plan.device
        columns, rows = plan.facts.scene.map.resolution
        buffers = {buffer.name: buffer for buffer in plan.buffers}
        accumulator = ACCUMULATOR[self._program.accumulate]
        own = plan.threads if self._program.banded else 1
        self.maps = wp.zeros((own, *buffers["map"].shape), dtype=accumulator, device=device)
        self.ledgers = wp.zeros((plan.threads, *buffers["ledger"].shape), dtype=wp.float64, device=device)
        self.flat_map = wp.zeros(buffers["caustic_map"].shape, dtype=wp.float32, device=device)
        self.caustic_map = shaped(self.flat_map, rows, columns, len(plan.facts.irradiance))
        dry = buffers["dry"].shape if "dry" in buffers else (0,)
        self._dry = wp.zeros((plan.threads, *dry), dtype=wp.float64, device=device)
        self._own = [
            {
                buffer.name: wp.empty(buffer.shape, dtype=DTYPES[buffer.dtype], device=device)
                for buffer in self._program.buffers
            }
            for _ in range(own)
        ]

    def _record_strips(self) -> Lanes:
        """Build each kernel, and bind every launch of the strips to its arguments."""
        plan, program = self._plan, self._program
        common, kernels = self._common(), [(step, step.kernel()) for step in program.passes]
        lanes: Lanes = [[FillCommand(self.maps[lane]), FillCommand(self.ledgers[lane])] for lane in range(plan.threads)]
        jobs = [(sun, strip) for sun in range(len(plan.facts.suns)) for strip in range(program.strips)]
        for number, (sun, strip) in enumerate(jobs):
            lane = number % plan.threads
            first = strip * program.strip_rows
            rows = min(program.strip_rows, program.lattice.count[1] - first)
            values = {
                **common, **self._own[lane], "sun": sun, "first_row": program.lattice.first[1] + first,
                "map": self.maps[lane], "ledger": self.ledgers[lane],
            }  # fmt: skip
            lanes[lane] += [self._bind(step, kernel, rows, values) for step, kernel in kernels]
        return lanes

    def _bind(self, step: Pass, kernel: wp.Kernel, rows: int, values: Mapping[str, Any]) -> Command:
        """Record a pass over a strip; one that walks has its items in one thread on a CPU, where threads are few."""
        dim = step.dim(rows)
        work = step.weight * math.prod(dim)
        if step.walks:
            extent = (dim[1], dim[0])
            alone = self._plan.device == "cpu"
            values = {**values, "extent": extent, "block": extent if alone else (1, 1)}
            dim = (1, 1) if alone else dim
        return bind(kernel, dim, values, self._plan.device, pass_name=step.name, work=work)

    def _record_bands(self) -> Stages:
        """Bind each pass for each direction of the sun, over all rows at once: a stage each."""
        plan, program = self._plan, self._program
        fills: list[Command] = [FillCommand(self.maps), FillCommand(self.ledgers)]
        kernels = [(step, step.kernel()) for step in program.passes]
        rows, ledgers = program.lattice.count[1], [{"ledger": self.ledgers[lane]} for lane in range(plan.threads)]
        stages: Stages = [[fills]]
        for sun in range(len(plan.facts.suns)):
            values = {
                **self._common(), **self._own[0], "sun": sun, "first_row": program.lattice.first[1],
                "map": self.maps[0],
            }  # fmt: skip
            stages += [
                bind_lanes(
                    kernel,
                    step.dim(rows),
                    values,
                    plan.device,
                    plan.threads,
                    own=ledgers,
                    weight=step.weight,
                    pass_name=step.name,
                )
                for step, kernel in kernels
            ]
        return stages

    def _common(self) -> dict[str, Any]:
        state, program = self._state, self._program
        lattice = state.lattice(program.lattice)
        run = columns_each(self._plan.device, program.lattice.count[0])
        return {"scene": state.scene, "suns": state.suns, "lattice": lattice, RUN: run, **program.values}

    def _record_closing(self) -> Stages:
        plan, facts, program = self._plan, self._plan.facts, self._program
        colours = len(facts.irradiance)
        # A cell's flux over a pixel's area is its share of the pixel; each direction of the sun has its own share.
        share = program.lattice.step**2 * facts.sun_share * unit(program.accumulate)
        scale = [share * facts.irradiance[i % colours] for i in range(3)]
        one_sun = wp.vec3(*(facts.sun_share * facts.irradiance[i % colours] for i in range(3)))
        if program.steps:
            resolve = make_resolve_steps(facts.spec.channels, colours)
            weight, dim = facts.scene.map.resolution
        else:
            weight = 1
            resolve, dim = make_resolve(program.accumulate, facts.spec.channels, colours), self.flat_map.size
        values: dict[str, Any] = {
            "lanes": self.maps, "scale": wp.vec3d(*scale), "map": self.flat_map, "scene": self._state.scene,
            "suns": self._state.suns, "pixel": wp.vec2(*facts.pixel), "columns": facts.scene.map.resolution[0],
            "irradiance": one_sun, "colours": colours,
        }  # fmt: skip
        closing = [bind_lanes(resolve, (dim,), values, plan.device, plan.threads, weight=weight)]
        if facts.spec.shore:
            columns, rows = facts.scene.map.resolution
            land, own = make_dry_land(facts.spec), [{"dry": self._dry[lane]} for lane in range(plan.threads)]
            closing.append([[FillCommand(self._dry)]])
            closing.append(bind_lanes(land, (rows, columns), values, plan.device, plan.threads, own=own))
        return closing
