"""The seam: simulated water, or a sea, as nodes of a height map on the device, at any time."""

from __future__ import annotations

from typing import Any

import warp as wp

from ..kernels.nodes import EXTREMES, make_extremes, make_nodes
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
    """

    def __init__(self, basin: Basin | Sea, device: str) -> None:
        self.basin = basin
        self.motion = make_motion(basin, device)
        self.ring = node_ring(basin)
        shape = (basin.rows + 2 * self.ring, basin.columns + 2 * self.ring)
        self.nodes = wp.zeros(shape, dtype=wp.vec4, device=device)
        self._extremes = wp.zeros(len(EXTREMES), dtype=wp.float32, device=device)
        per_metre = wp.vec2(1.0 / basin.cell[0], 1.0 / basin.cell[1])
        self._launches = [
            wp.launch(kernel, dim=self.nodes.shape, inputs=inputs, outputs=[out], device=device, record_cmd=True)
            for kernel, inputs, out in (
                (make_nodes(basin.periodic), [self.motion.surface], self.nodes),
                (make_extremes(basin.periodic), [self.nodes, per_metre], self._extremes),
            )
        ]

    def advance(self, time: float) -> None:
        """Make the nodes of the water at a time [s].

        Raises
        ------
        InputError
            If the kind of simulation does not reach it.
        """
        self.motion.advance(time)
        self._extremes.zero_()
        for launch in self._launches:
            launch.launch()

    def warnings(self) -> tuple[str, ...]:
        """Read back what the water of the last time passed of its declared bounds, and say so."""
        slope, height = self._extremes.numpy()
        return bound_notes(self.basin, float(slope), float(height))


def make_motion(basin: Basin | Sea, device: str) -> Any:
    """What moves this water: a :class:`SpectralWater` or a :class:`GridWater`."""
    return GridWater(basin, device) if isinstance(basin, Basin) and not basin.spectral else SpectralWater(basin, device)


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
