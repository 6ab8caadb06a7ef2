"""Simulated water: its rectangle and limits, its two kinds, and the seam behind which a frame's water is made."""

from .basin import Basin, make_basin
from .drawing import simulated_heights, simulated_surface
from .passes import SimulationPass, frame_launches, simulation_buffers, simulation_passes, step_launches
from .water import SimulatedWater, bound_notes

__all__ = [
    "Basin",
    "SimulatedWater",
    "SimulationPass",
    "bound_notes",
    "frame_launches",
    "make_basin",
    "simulated_heights",
    "simulated_surface",
    "simulation_buffers",
    "simulation_passes",
    "step_launches",
]
