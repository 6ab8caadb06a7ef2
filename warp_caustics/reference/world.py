"""The reference's view of a scene: structs and arrays of float64 on a device."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from ..height_map import hermite_nodes, node_spacing, patch_slopes, surface_hull
from ..kernels.reference.meet import Mesh
from ..kernels.reference.ray import World
from ..kernels.reference.surface import HeightField, Sine
from ..receiver import closed_terrain
from ..simulation import bound_notes, simulated_surface
from ..water import BETWEEN_SAMPLES, phases

if TYPE_CHECKING:
    from ..assets import HeightGrid, TriangleMesh
    from ..facts import Facts

WAYS_A_STEP = 1e-5
"""Smallest step of a march as a share of the longest way under water: what it may step over is 1e-10 of a way deep."""

PIXELS_A_STEP = 1e-3
"""And as a share of a pixel: edges are found that much finer than anything the map shows."""

NEAR = 4
"""Patches to every side over which a local bound of the slope holds: wider, a march takes longer steps, and more."""

ENDLESS = 1e30
"""Where water without a border ends [m]."""


class DeviceWorld:
    """A scene at a time, on a device; owns what its struct points to.

    Attributes
    ----------
    world : World
        For kernels.
    notes : tuple of str
        What is to be known of it.
    """

    def __init__(self, facts: Facts, time: float, device: str) -> None:
        self._facts, self._device = facts, device
        self._keep: list[Any] = []
        self.notes: tuple[str, ...] = ()
        self.world = self._make(time)

    def _make(self, time: float) -> World:
        facts, world = self._facts, World()
        world.water = self._water(time)
        world.terrain = self._terrain()
        if facts.spec.receiver == "plane":
            world.plane = float(facts.scene.receiver.plane or 0.0) - facts.scene.water.level
        world.mesh = self._mesh(facts.assets.mesh)
        world.objects = self._mesh(facts.assets.objects)
        world.ior = facts.ior
        world.attenuation = wp.vec3d(*facts.attenuation)
        world.pixel = wp.vec2d(*facts.pixel)
        low, high = facts.water_border or (np.full(2, -ENDLESS), np.full(2, ENDLESS))
        world.low, world.high = wp.vec2d(*low), wp.vec2d(*high)
        return world

    def _water(self, time: float) -> HeightField:
        facts = self._facts
        if facts.basin is not None:
            return self._simulated(time)
        if facts.assets.water is not None:
            field = self._patches(facts.assets.water, 0.0)
        else:
            waves = facts.scene.waves
            turns = phases(facts.scene, time, facts.rest_depth)
            field = self._sines([(w.amplitude, w.wavevector, turn) for w, turn in zip(waves, turns, strict=True)])
            field.middle = wp.vec2d(*(0.5 * side for side in facts.scene.map.size))
        field.steepest, field.highest = facts.slope, facts.amplitude
        field.step = self._step()
        return field

    def _simulated(self, time: float) -> HeightField:
        """Water as it is simulated, which is taken as it comes: the light is judged, not the water."""
        facts = self._facts
        basin, grid = simulated_surface(facts.scene, facts.assets, time)
        field, hull = self._patches(grid, 0.0), surface_hull(grid)
        field.steepest, field.highest = hull.slope, max(abs(hull.lowest), abs(hull.highest))
        # The hull's slope is a bound, not a value: it may pass the real one by as much as one between samples may.
        self.notes = bound_notes(basin, hull.slope / (1.0 + BETWEEN_SAMPLES), field.highest)
        field.low = wp.vec2d(*np.subtract(basin.origin, facts.scene.map.origin))
        field.period = wp.vec2d(*basin.size)
        field.step = self._step()
        return field

    def _terrain(self) -> HeightField:
        facts = self._facts
        if facts.spec.receiver not in ("waves", "grid"):
            return HeightField()
        level = facts.scene.water.level
        if facts.assets.terrain is not None:
            field = self._patches(facts.assets.terrain, level)
        else:
            terrain, origin = closed_terrain(facts.scene), np.asarray(facts.scene.map.origin, dtype=np.float64)
            field = self._sines(
                [(w.amplitude, w.wavevector, w.phase + np.dot(w.wavevector, origin)) for w in terrain.waves]
            )
            field.base = float(terrain.base + np.dot(terrain.slope, origin) - level)
            field.slope = wp.vec2d(*terrain.slope)
        field.steepest, field.highest = facts.ground.slope, facts.ground.highest
        field.step = self._step()
        return field

    def _step(self) -> float:
        return min(PIXELS_A_STEP * float(self._facts.pixel.min()), WAYS_A_STEP * self._facts.longest_way)

    def _sines(self, waves: list[tuple[float, tuple[float, float], float]]) -> HeightField:
        table = np.zeros(len(waves), dtype=Sine.numpy_dtype())
        for i, wave in enumerate(waves):
            table[i] = wave
        field = HeightField()
        field.sines = self._array(table, Sine)
        return field

    def _patches(self, grid: HeightGrid, level: float) -> HeightField:
        nodes, spacing = hermite_nodes(grid.z), node_spacing(grid)
        nodes[..., 0] -= level
        field = HeightField()
        field.nodes = self._array(nodes, wp.vec4d)
        field.origin = wp.vec2d(*(np.subtract(grid.origin, self._facts.scene.map.origin) + 0.5 * spacing))
        field.spacing = wp.vec2d(*spacing)
        field.steepest_near = self._array(_widened(patch_slopes(grid)), wp.float64)
        # From anywhere in a patch, as many patches on every side.
        field.window = NEAR * float(spacing.min())
        return field

    def _mesh(self, mesh: TriangleMesh | None) -> Mesh:
        made = Mesh()
        if mesh is None:
            return made
        scene = self._facts.scene
        vertices = mesh.vertices - np.array([*scene.map.origin, scene.water.level])
        triangles = mesh.triangles.astype(np.int32)
        bvh = wp.Mesh(
            points=self._array(vertices.astype(np.float32), wp.vec3), indices=self._array(triangles.ravel(), wp.int32)
        )
        self._keep.append(bvh)
        made.id = bvh.id
        made.vertices = self._array(vertices, wp.vec3d)
        made.triangles = self._array(triangles, wp.vec3i)
        made.reach = self._facts.longest_ray
        return made

    def _array(self, values: np.ndarray, dtype: Any) -> Any:
        array: wp.array = wp.array(values, dtype=dtype, device=self._device)
        self._keep.append(array)
        return array


def _widened(slopes: np.ndarray) -> np.ndarray:
    """The largest of all patches up to NEAR to every side."""
    for axis in (0, 1):
        padded = np.pad(slopes, [(NEAR, NEAR) if a == axis else (0, 0) for a in (0, 1)], mode="edge")
        slopes = np.lib.stride_tricks.sliding_window_view(padded, 2 * NEAR + 1, axis=axis).max(axis=-1)
    return np.ascontiguousarray(slopes)
