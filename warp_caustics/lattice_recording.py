"""The recorded frame of a method that follows light from a lattice of the water into a map in plan view."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import warp as wp

from .kernels.deposit import ACCUMULATOR, unit
from .kernels.resolve import make_dry_land, make_resolve
from .ledger import read_energy
from .recording import DTYPES, Command, FillCommand, Stages, bind, shaped

if TYPE_CHECKING:
    from .energy import Energy
    from .plan import Plan
    from .program import Program
    from .state import SceneState


class LatticeRecording:
    """Strips of the lattice, spread over lanes that own their maps; then the lanes added up and dry land lit.

    Attributes
    ----------
    stages, caustic_map, screen_map
        As :class:`~warp_caustics.recording.Recording`.
    maps, ledgers : wp.array
        Of each lane.
    flat_map : wp.array
        The caustic map as ``[rows * columns * colours]``.
    """

    def __init__(self, plan: Plan, program: Program, state: SceneState) -> None:
        self._plan, self._program, self._state = plan, program, state
        self.caustic_map: wp.array | None = None
        self.screen_map: wp.array | None = None
        self._allocate()
        self.stages: Stages = [self._record_lanes(), [self._record_closing()]]

    def energy(self) -> Energy:
        """Read back the ledger."""
        return read_energy(self._plan, self._program, self.ledgers.numpy(), self.flat_map.numpy(), self._dry.numpy())

    def _allocate(self) -> None:
        plan, device = self._plan, self._plan.device
        columns, rows = plan.facts.scene.map.resolution
        buffers = {buffer.name: buffer for buffer in plan.buffers}
        accumulator = ACCUMULATOR[self._program.accumulate]
        self.maps = wp.zeros((plan.threads, *buffers["map"].shape), dtype=accumulator, device=device)
        self.ledgers = wp.zeros((plan.threads, *buffers["ledger"].shape), dtype=wp.float64, device=device)
        self.flat_map = wp.zeros(buffers["caustic_map"].shape, dtype=wp.float32, device=device)
        self.caustic_map = shaped(self.flat_map, rows, columns, len(plan.facts.irradiance))
        self._dry = wp.zeros(buffers["dry"].shape if "dry" in buffers else 0, dtype=wp.float64, device=device)
        self._own = [
            {
                buffer.name: wp.empty(buffer.shape, dtype=DTYPES[buffer.dtype], device=device)
                for buffer in self._program.buffers
            }
            for _ in range(plan.threads)
        ]

    def _record_lanes(self) -> list[list[Command]]:
        """Build each kernel, and bind every launch of the strips to its arguments."""
        plan, program, state = self._plan, self._program, self._state
        lattice = state.lattice(program.lattice)
        common = {"scene": state.scene, "suns": state.suns, "lattice": lattice, **program.values}
        kernels = [(step, step.kernel()) for step in program.passes]
        lanes: list[list[Command]] = [
            [FillCommand(self.maps[lane]), FillCommand(self.ledgers[lane])] for lane in range(plan.threads)
        ]
        lanes[0].append(FillCommand(self._dry))
        jobs = [(sun, strip) for sun in range(len(plan.facts.suns)) for strip in range(program.strips)]
        for number, (sun, strip) in enumerate(jobs):
            lane = number % plan.threads
            first = strip * program.strip_rows
            rows = min(program.strip_rows, program.lattice.count[1] - first)
            values = {
                **common, **self._own[lane], "sun": sun, "first_row": program.lattice.first[1] + first,
                "map": self.maps[lane], "ledger": self.ledgers[lane],
            }  # fmt: skip
            lanes[lane] += [bind(kernel, step.dim(rows), values, plan.device) for step, kernel in kernels]
        return lanes

    def _record_closing(self) -> list[Command]:
        facts, program = self._plan.facts, self._program
        colours = len(facts.irradiance)
        # A cell's flux over a pixel's area is its share of the pixel; each direction of the sun has its own share.
        share = program.lattice.step**2 * facts.sun_share * unit(program.accumulate)
        scale = [share * facts.irradiance[i % colours] for i in range(3)]
        one_sun = wp.vec3(*(facts.sun_share * facts.irradiance[i % colours] for i in range(3)))
        resolve = make_resolve(program.accumulate, facts.spec.channels, colours)
        values: dict[str, Any] = {
            "lanes": self.maps, "scale": wp.vec3d(*scale), "map": self.flat_map, "scene": self._state.scene,
            "suns": self._state.suns, "pixel": wp.vec2(*facts.pixel), "columns": facts.scene.map.resolution[0],
            "irradiance": one_sun, "colours": colours, "dry": self._dry,
        }  # fmt: skip
        closing = [bind(resolve, self.flat_map.shape, values, self._plan.device)]
        if facts.spec.shore:
            columns, rows = facts.scene.map.resolution
            closing.append(bind(make_dry_land(facts.spec), (rows, columns), values, self._plan.device))
        return closing
