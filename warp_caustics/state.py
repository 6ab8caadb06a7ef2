"""The device's view of a scene: structs and arrays that the kernels read, and what the host writes before a frame."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from .crew import Crew
from .height_map import hermite_nodes
from .kernels.grid import Grid
from .kernels.lattice import Lattice
from .kernels.photon import Scene, SunSample
from .kernels.surface import Surface
from .kernels.waves import Wave
from .receiver import closed_terrain
from .recording import CopyCommand, Stages, run_stages
from .simulation import SimulatedWater
from .water import first_phases, is_radial, phases_at

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from .assets import HeightGrid, TriangleMesh
    from .facts import Facts
    from .simulation import Basin, Sea
    from .window import Lattice as HostLattice

PIXELS_A_STEP = 0.25
"""Smallest step of a march, in pixels: an edge is then found to a fraction of what the map shows."""

STEPS_A_WAY = 2048
"""Smallest step of a march, as a share of the longest way: half of the steps after which a march gives up."""

ENDLESS = 1.0e30
"""Where water without a border ends."""


def split(values: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Round to float32, and what that leaves out: two numbers that kernels can add up to 48 bits. Both as float64."""
    whole = np.asarray(values, dtype=np.float64)
    rounded = whole.astype(np.float32).astype(np.float64)
    return rounded, whole - rounded


class SceneState:
    """Structs and arrays on a device; owns what they point to.

    Attributes
    ----------
    scene : Scene
        What a photon meets.
    suns : wp.array
        Directions of the sun.
    stages : Stages
        What a frame launches before all else, once :meth:`prepare` has been called.
    simulated : SimulatedWater or None
        Water that is simulated, or a sea.
    """

    def __init__(self, facts: Facts, device: str, crew: Crew | None = None) -> None:
        self._facts, self._device = facts, device
        self._keep: list[Any] = []
        # The host side is pinned, so that a copy can be part of a captured frame; on a CPU it is the device's own.
        pinned = device != "cpu"
        self._host_waves = wp.zeros(facts.waves, dtype=Wave, device="cpu", pinned=pinned)
        self._wave_table = self._host_waves.numpy()
        self._first_phases, self._frequencies = first_phases(facts.scene, facts.rest_depth)
        self._write_waves()
        self._waves = wp.clone(self._host_waves, device=device) if pinned else self._host_waves
        self.suns: wp.array = wp.array(self._sun_table(), dtype=SunSample, device=device)
        self.simulated = None if facts.basin is None else SimulatedWater(facts.basin, device, crew)
        self.scene = self._make_scene()
        self.stages: Stages = []
        if pinned and facts.waves:
            self.stages.append([[CopyCommand(self._waves, self._host_waves)]])
        if self.simulated is not None:
            self.stages += self.simulated.stages

    def write(self, time: float) -> None:
        """Put the waves' phases at a time, or simulated water, on the device; allocates nothing there."""
        self.prepare(time)
        run_stages(self.stages)

    def prepare(self, time: float) -> None:
        """Do the host's part of :meth:`write`; :attr:`stages` are the rest."""
        if self.simulated is not None:
            self.simulated.prepare(time)
        if len(self._wave_table):
            table = self._wave_table
            table["phase"], table["phase_rest"] = split(phases_at(self._first_phases, self._frequencies, time))

    def lattice(self, lattice: HostLattice) -> Lattice:
        """Make the kernels' form of a lattice."""
        facts, made = self._facts, Lattice()
        made.step = lattice.step
        made.first = wp.vec2i(*lattice.first)
        made.count = wp.vec2i(*lattice.count)
        made.pixel = wp.vec2(*facts.pixel)
        made.cell_rest = wp.vec2(*(lattice.step * facts.pixel - split(lattice.step)[0] * split(facts.pixel)[0]))
        made.map = wp.vec2i(*facts.scene.map.resolution)
        low, high = np.full(2, -ENDLESS), np.full(2, ENDLESS)
        if facts.water_border is not None:
            low, high = facts.water_border
        made.low, made.high = wp.vec2(*low), wp.vec2(*high)
        return made

    def _sun_table(self) -> np.ndarray:
        suns = np.zeros(len(self._facts.suns), dtype=SunSample.numpy_dtype())
        suns["direction"] = self._facts.suns
        suns["rest_shift"] = self._facts.rest_shifts
        return suns

    def _write_waves(self) -> None:
        """Write what does not change with time."""
        for i, wave in enumerate(self._facts.scene.waves):
            self._wave_table["amplitude"][i] = wave.amplitude
            self._wave_table["wavevector"][i], self._wave_table["wavevector_rest"][i] = split(wave.wavevector)

    def _make_scene(self) -> Scene:
        facts, scene = self._facts, Scene()
        step = max(PIXELS_A_STEP * float(facts.pixel.min()), facts.longest_way / STEPS_A_WAY)
        scene.water.surface = self._surface(facts.assets.water, self._waves)
        if self.simulated is not None:
            scene.water.surface.grid = self._simulated_grid(self.simulated)
        if is_radial(facts.scene):
            scene.water.surface.middle = wp.vec2(*(0.5 * side for side in facts.scene.map.size))
        scene.water.amplitude = facts.amplitude
        scene.water.slope = facts.slope
        scene.water.step = step
        scene.medium.ior = facts.ior
        scene.medium.eta = 1.0 / facts.ior
        scene.medium.attenuation = wp.vec3(*facts.attenuation)
        receiver, ground = scene.receiver, facts.ground
        receiver.lowest, receiver.highest = ground.lowest, ground.highest
        receiver.slope = ground.slope if np.isfinite(ground.slope) else 0.0
        receiver.step = step
        receiver.reach = facts.longest_ray
        if facts.spec.receiver == "plane":
            receiver.level = ground.lowest if not facts.spec.objects else self._plane_level()
        receiver.terrain = self._terrain()
        receiver.mesh = self._mesh(facts.assets.mesh)
        receiver.objects = self._mesh(facts.assets.objects)
        return scene

    def _plane_level(self) -> float:
        return float(self._facts.scene.receiver.plane or 0.0) - self._facts.scene.water.level

    def _terrain(self) -> Surface:
        facts = self._facts
        origin, level = np.asarray(facts.scene.map.origin, dtype=np.float64), facts.scene.water.level
        if facts.spec.receiver != "waves":
            return self._surface(facts.assets.terrain, None, level)
        terrain = closed_terrain(facts.scene)
        table = np.zeros(len(terrain.waves), dtype=Wave.numpy_dtype())
        for i, wave in enumerate(terrain.waves):
            turn = np.mod(wave.phase + np.dot(wave.wavevector, origin), 2.0 * np.pi)
            table[i] = (wave.amplitude, wave.wavevector, turn, (0.0, 0.0), 0.0)  # no table is made of it
        waves: wp.array = wp.array(table, dtype=Wave, device=self._device)
        self._keep.append(waves)
        surface = self._surface(None, waves)
        surface.base = float(terrain.base + np.dot(terrain.slope, origin) - level)
        surface.slope = wp.vec2(*terrain.slope)
        return surface

    def _surface(self, grid: HeightGrid | None, waves: Any, level: float = 0.0) -> Surface:
        surface = Surface()
        if waves is not None:
            surface.waves = waves
        if grid is not None:
            nodes = hermite_nodes(grid.z)
            nodes[..., 0] -= level
            surface.grid = self._grid(wp.array(nodes.astype(np.float32), dtype=wp.vec4, device=self._device), grid)
            self._keep.append(surface.grid.nodes)
        return surface

    def _grid(self, nodes: wp.array, placed: HeightGrid | Basin | Sea) -> Grid:
        """The kernels' form of nodes at the middles of cells."""
        made, cell = Grid(), np.asarray(placed.cell)
        made.nodes = nodes
        _put_origin(made, np.subtract(placed.origin, self._facts.scene.map.origin) + 0.5 * cell)
        per_metre, rest = split(1.0 / cell)
        made.per_metre, made.per_metre_rest = wp.vec2(*per_metre), wp.vec2(*rest)
        return made

    def _simulated_grid(self, water: SimulatedWater) -> Grid:
        """The kernels' form of simulated water; of water that repeats, the rectangle that is nearest to the map."""
        basin = water.basin
        low = np.subtract(basin.origin, self._facts.scene.map.origin)
        if basin.periodic:
            low = low - np.asarray(basin.size) * np.round(low / basin.size)
        made, cell = self._grid(water.nodes, basin), np.asarray(basin.cell)
        _put_origin(made, low + (0.5 - water.ring) * cell)
        return made

    def _mesh(self, mesh: TriangleMesh | None) -> Any:
        if mesh is None:
            return wp.uint64(0)
        scene = self._facts.scene
        vertices = mesh.vertices - np.array([*scene.map.origin, scene.water.level])
        made = wp.Mesh(
            points=wp.array(vertices.astype(np.float32), dtype=wp.vec3, device=self._device),
            indices=wp.array(mesh.triangles.astype(np.int32).ravel(), dtype=wp.int32, device=self._device),
        )
        self._keep.append(made)
        return made.id


def _put_origin(grid: Grid, origin: np.ndarray) -> None:
    whole, rest = split(origin)
    grid.origin, grid.origin_rest = wp.vec2(*whole), wp.vec2(*rest)
