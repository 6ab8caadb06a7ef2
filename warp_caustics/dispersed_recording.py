"""The recorded frame of three channels that refract apart: their own frames, and then one map of the three."""

from __future__ import annotations

from typing import TYPE_CHECKING

import warp as wp

from .bands import bind_lanes
from .dispersion import CHANNELS, DispersedPlan, stacked_energy
from .kernels.resolve import stack
from .lattice_recording import LatticeRecording
from .recording import Stages, shaped

if TYPE_CHECKING:
    from .energy import Energy


class DispersedRecording:
    """Lanes of all channels side by side.

    Attributes
    ----------
    stages, caustic_map, screen_map
        As :class:`~warp_caustics.recording.Recording`.
    """

    def __init__(self, plan: DispersedPlan, channels: list[LatticeRecording]) -> None:
        self._channels = channels
        columns, rows = plan.facts.scene.map.resolution
        flat = wp.zeros(len(CHANNELS) * columns * rows, dtype=wp.float32, device=plan.device)
        self.caustic_map: wp.array | None = shaped(flat, rows, columns, len(CHANNELS))
        self.screen_map: wp.array | None = None
        maps = [channel.flat_map for channel in channels]
        values = {**dict(zip(CHANNELS, maps, strict=True)), "each": maps[0].size // (columns * rows), "map": flat}
        stages = zip(*(channel.stages for channel in channels), strict=True)
        self.stages: Stages = [[lane for lanes in stage for lane in lanes] for stage in stages]
        self.stages.append(bind_lanes(stack, (columns * rows,), values, plan.device, plan.threads))

    def energy(self) -> Energy:
        """Read back the ledgers of the channels."""
        return stacked_energy([channel.energy() for channel in self._channels])
