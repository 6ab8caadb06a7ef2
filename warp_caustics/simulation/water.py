"""The seam: simulated water, or a sea, as nodes of a height map on the device, at any time."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

from ..bands import bind_lanes
from ..crew import Crew
from ..kernels.nodes import EXTREMES, make_extremes, make_nodes
from ..recording import FillCommand, Stages, run_stages
from .basin import Basin
from .grid import GridWater
from .passes import node_ring
from .sea import Sea
from .spectral import SpectralWater

ROUNDING = 1.0 + 1e-6
"""Times a bound that float32 may pass."""


class SimulatedWater:
    """Allocates simulated water or a sea once, and records its launches; a frame allocates and reads back nothing.

    Attributes
    ----------
    basin : Basin or Sea
        What is simulated.
    motion : SpectralWater or GridWater
        What moves the water, and owns its state.
    nodes : wp.array
        vec4 ``[rows, columns]``, as :func:`~warp_caustics.height_map.hermite_nodes`, written by :meth:`advance`;
        between walls with a ring of nodes beyond them.
    ring : int
        How many.
    stages : Stages
        What makes the nodes once :meth:`prepare` has been called: the same launches in every frame.
    """

    def __init__(self, basin: Basin | Sea, device: str, crew: Crew | None = None) -> None:
        crew = Crew() if crew is None else crew
        self.basin = basin
        self.motion = make_motion(basin, device, crew)
        self.ring = node_ring(basin)
        shape = (basin.rows + 2 * self.ring, basin.columns + 2 * self.ring)
        self.nodes = wp.zeros(shape, dtype=wp.vec4, device=device)
        # Each thread has extremes of its own: an atomic maximum on a CPU is a comparison and a store.
        self._extremes = wp.zeros((crew.threads, len(EXTREMES)), dtype=wp.float32, device=device)
        values = {
            "surface": self.motion.surface, "nodes": self.nodes,
            "per_metre": wp.vec2(1.0 / basin.cell[0], 1.0 / basin.cell[1]),
        }  # fmt: skip
        own = [{"extremes": self._extremes[lane]} for lane in range(crew.threads)]
        self.stages: Stages = [
            *self.motion.stages,
            bind_lanes(make_nodes(basin.periodic), shape, values, device, crew.threads),
            [[FillCommand(self._extremes)]],
            bind_lanes(make_extremes(basin.periodic), shape, values, device, crew.threads, own=own),
        ]

    def advance(self, time: float) -> None:
        """Make the nodes of the water at a time [s].

        Raises
        ------
        InputError
            If the kind of simulation does not reach it.
        """
        self.prepare(time)
        run_stages(self.stages)

    def prepare(self, time: float) -> None:
        """Do what depends on how far the time is from the last: a simulation's steps. Raises as :meth:`advance`."""
        self.motion.prepare(time)

    def warnings(self) -> tuple[str, ...]:
        """Read back what the water of the last time passed of its declared bounds, and say so."""
        slope, height = np.max(self._extremes.numpy(), axis=0)
        return bound_notes(self.basin, float(slope), float(height))


def make_motion(basin: Basin | Sea, device: str, crew: Crew | None = None) -> Any:
    """What moves this water: a :class:`SpectralWater` or a :class:`GridWater`."""
    crew = Crew() if crew is None else crew
    if isinstance(basin, Basin) and not basin.spectral:
        return GridWater(basin, device, crew)
    return SpectralWater(basin, device, crew)


def bound_notes(basin: Basin | Sea, slope: float, height: float) -> tuple[str, ...]:
    """Say which bounds a surface of this steepest slope and largest height [m] passes."""
    sea = isinstance(basin, Sea)
    declared = (("slope", slope, basin.max_slope), ("height", height, basin.max_height))
    return tuple(
        f"water.{'spectrum' if sea else 'simulation'}: its surface reaches a {name} of {largest:.3g}, and {bound:.3g} "
        f"is planned for; light may be missing at the map's border, and is dropped where the surface faces away from "
        f"the sun: {'give it a loop, whose bounds are known' if sea else f'raise max_{name}'}"
        for name, largest, bound in declared
        if largest > bound * ROUNDING
    )
