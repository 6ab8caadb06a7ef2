"""Water that is made before each frame: simulated in a basin or summed to a sea, and the seam behind which it is."""

from .basin import Basin, make_basin
from .drawing import simulated_heights, simulated_surface
from .passes import SimulationPass, frame_launches, simulation_buffers, simulation_passes, step_launches
from .sea import Sea, make_sea
from .water import SimulatedWater, bound_notes

__all__ = [
    "Basin",
    "Sea",
    "SimulatedWater",
    "SimulationPass",
    "bound_notes",
    "frame_launches",
    "make_basin",
    "make_sea",
    "simulated_heights",
    "simulated_surface",
    "simulation_buffers",
    "simulation_passes",
    "step_launches",
]
