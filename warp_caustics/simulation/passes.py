"""What a simulation launches and allocates, for the plan."""

from __future__ import annotations

from dataclasses import dataclass

from ..program import Buffer
from .basin import Basin, implicit_iterations
from .sea import Sea
from .spectral import padded_shape


@dataclass(frozen=True)
class SimulationPass:
    """Launches of one kernel, in every ``"frame"``, every ``"step"``, or for every ``"drop"``."""

    name: str
    does: str
    each: str = "frame"
    launches: int = 1


def simulation_passes(basin: Basin | Sea) -> tuple[SimulationPass, ...]:
    """Say what is launched, in order."""
    closing = (
        SimulationPass("nodes", "slopes of the water at its cells"),
        SimulationPass("extremes", "its steepest slope and largest height, read back when a result is"),
    )
    if basin.spectral:
        evolve = "travel" if isinstance(basin, Sea) else "evolve"
        return (
            SimulationPass(evolve, "each mode of the water taken to the time of the frame"),
            SimulationPass("fft_rows", "modes summed up along x, then along y", launches=2),
            SimulationPass("turn", "rows turned into columns between the two"),
            SimulationPass("spectral_surface", "height of the water at its cells"),
            *closing,
        )
    assert isinstance(basin, Basin)
    surface = SimulationPass("surface", "height of the simulated water at a whole step")
    drops = (SimulationPass("drop", "falls into the water", "drop"),) if basin.settings.drops else ()
    steps: tuple[SimulationPass, ...]
    if basin.explicit:
        steps = (
            SimulationPass("pressure", "of the water on its cells", "step"),
            SimulationPass("leap", f"an explicit step of {basin.step:.4g} s", "step"),
        )
    else:
        count = implicit_iterations(basin)
        steps = (
            SimulationPass("begin_solve", f"an implicit step of {basin.step:.4g} s", "step"),
            SimulationPass("pressure", "of the water on its cells, in each iteration", "step", count),
            SimulationPass("solve", "Chebyshev iterations for the mean of its two heights", "step", count),
            SimulationPass("end_solve", "the new state from the mean", "step"),
        )
    return (*drops, *steps, surface, *closing)


def frame_launches(basin: Basin | Sea) -> int:
    """Launches of every frame, steps and drops apart."""
    return sum(one.launches for one in simulation_passes(basin) if one.each == "frame")


def step_launches(basin: Basin | Sea) -> int:
    """Launches of every step."""
    return sum(one.launches for one in simulation_passes(basin) if one.each == "step")


def node_ring(basin: Basin | Sea) -> int:
    """Nodes beyond the border of the water, to each side: one past a wall, none where the water repeats."""
    return 0 if basin.periodic else 1


def simulation_buffers(basin: Basin | Sea) -> tuple[Buffer, ...]:
    """Say what is allocated."""
    cells = (basin.rows, basin.columns)
    ring = 2 * node_ring(basin)
    buffers = [Buffer("water_nodes", "vec4", (basin.rows + ring, basin.columns + ring), 16),
               Buffer("water_surface", "float64", cells, 8),
               Buffer("water_extremes", "float32", (2,), 4)]  # fmt: skip
    if basin.spectral:
        rows, columns = padded_shape(basin)
        buffers += [
            Buffer("spectrum", "vec2d", cells, 16),
            Buffer("modes", "vec2d", (basin.rows, columns), 16),
            Buffer("turned", "vec2d", (basin.columns, rows), 16),
        ]
        return tuple(buffers)
    assert isinstance(basin, Basin)
    drops = len(basin.settings.drops)
    state = ("water_height", "water_velocity", "pressure", *(() if basin.explicit else ("mean", "change")))
    buffers += [Buffer(name, "float64", cells, 8) for name in state]
    if basin.solid is not None:
        buffers.append(Buffer("solid", "uint8", cells, 1))
    if drops:
        buffers.append(Buffer("drop_profiles", "float64", (drops, basin.rows + basin.columns), 8))
    return tuple(buffers)
