"""The seam: simulated water as nodes of a height map on the device, at any time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import warp as wp

from ..kernels.nodes import EXTREMES, make_extremes, make_nodes
from .grid import GridWater
from .passes import node_ring
from .spectral import SpectralWater

if TYPE_CHECKING:
    from .basin import Basin

KINDS: dict[str, Any] = {"spectral": SpectralWater, "grid": GridWater}
"""By ``water.simulation.kind``."""


ROUNDING = 1.0 + 1e-6
"""Times a bound that float32 may pass."""


class SimulatedWater:
    """Allocates a simulation once, and records all its launches; a frame allocates nothing and reads nothing back.

    Attributes
    ----------
    basin : Basin
        What is simulated.
    motion : SpectralWater or GridWater
        What moves the water, and owns its state.
    nodes : wp.array
        vec4 ``[rows, columns]``, as :func:`~warp_caustics.height_map.hermite_nodes`, written by :meth:`advance`;
        between walls with a ring of nodes beyond them.
    ring : int
        How many.
    """

    def __init__(self, basin: Basin, device: str) -> None:
        self.basin = basin
        self.motion = KINDS[basin.settings.kind](basin, device)
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


def bound_notes(basin: Basin, slope: float, height: float) -> tuple[str, ...]:
    """Say which declared bounds a surface of this steepest slope and largest height [m] passes."""
    settings = basin.settings
    declared = (("slope", slope, settings.max_slope), ("height", height, settings.height_bound))
    return tuple(
        f"water.simulation: its surface reaches a {name} of {largest:.3g}, and {bound:.3g} is planned for; light may "
        f"be missing at the map's border, and is dropped where the surface faces away from the sun: raise max_{name}"
        for name, largest, bound in declared
        if largest > bound * ROUNDING
    )
