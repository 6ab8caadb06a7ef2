"""The seam: simulated water as nodes of a height map on the device, at any time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import warp as wp

from ..kernels.nodes import EXTREMES, make_extremes, make_nodes
from .grid import GridWater
from .spectral import SpectralWater

if TYPE_CHECKING:
    from .basin import Basin

KINDS: dict[str, Any] = {"spectral": SpectralWater, "grid": GridWater}
"""By ``water.simulation.kind``."""


class SimulatedWater:
    """Allocates a simulation once, and records all its launches; a frame allocates nothing and reads nothing back.

    Attributes
    ----------
    basin : Basin
        What is simulated.
    motion : SpectralWater or GridWater
        What moves the water, and owns its state.
    nodes : wp.array
        vec4 ``[rows, columns]``, as :func:`~warp_caustics.height_map.hermite_nodes`, written by :meth:`advance`.
    """

    def __init__(self, basin: Basin, device: str) -> None:
        self.basin = basin
        self.motion = KINDS[basin.settings.kind](basin, device)
        self.nodes = wp.zeros((basin.rows, basin.columns), dtype=wp.vec4, device=device)
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

    def warnings(self) -> list[str]:
        """Read back what the water of the last time passed of its declared bounds, and say so."""
        settings, notes = self.basin.settings, []
        declared = {"slope": settings.max_slope, "height": settings.height_bound}
        for name, largest in zip(EXTREMES, self._extremes.numpy(), strict=True):
            if largest > declared[name]:
                notes.append(
                    f"water.simulation: its surface reaches a {name} of {largest:.3g}, and {declared[name]:.3g} is "
                    f"planned for; light may be missing at the map's border: raise max_{name}"
                )
        return notes
