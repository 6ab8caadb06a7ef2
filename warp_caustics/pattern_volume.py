"""The volume of a projected pattern, and what its kernel is told: all that is large or precise, in float64."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .kernels.pattern import Pattern
from .kernels.photon import Medium
from .receiver import SHALLOWEST
from .scene import Volume
from .tone import LUMINANCE
from .views import light_axes

if TYPE_CHECKING:
    from .assets import TriangleMesh
    from .facts import Facts
    from .scene import Scene

REPEATS = 3.0
"""Of the texture across the map, when no scale is given."""

SPARE_DEPTH = 0.01
"""Share of the water's depth by which the volume of no given size goes deeper: a floor on its face would not show."""


def scale_of(scene: Scene) -> float:
    """Width of one repeat of the texture [m]."""
    return scene.method.pattern.scale or min(scene.map.size) / REPEATS


def volume_of(scene: Scene, meshes: list[TriangleMesh]) -> Volume:
    """The volume of the scene, or the box of the water over the map, down to the lowest ground."""
    if scene.method.pattern.volume is not None:
        return scene.method.pattern.volume
    (x, y), (width, length) = scene.map.origin, scene.map.size
    lowest = min(float(mesh.vertices[:, 2].min()) for mesh in meshes)
    depth = max(scene.water.level - lowest, SHALLOWEST) * (1.0 + SPARE_DEPTH)
    return Volume(
        centre=(x + 0.5 * width, y + 0.5 * length, scene.water.level - 0.5 * depth), size=(width, length, depth)
    )


def device_pattern(scene: Scene, volume: Volume) -> Any:
    """Make the kernel's settings; what is large or precise is worked out here, in float64."""
    import warp as wp

    settings, made = scene.method.pattern, Pattern()
    origin = np.array([*scene.map.origin, scene.water.level])
    turn = np.radians(volume.rotation)
    axes = np.array([[np.cos(turn), np.sin(turn), 0.0], [-np.sin(turn), np.cos(turn), 0.0], [0.0, 0.0, 1.0]])
    to_object = axes / np.array(volume.size)[:, None]
    right, up, _ = light_axes(scene.sun.direction)
    tiling = 1.0 / scale_of(scene)
    irradiance = np.broadcast_to(np.array(scene.sun.irradiance, dtype=np.float64), 3)
    luminance = np.array(LUMINANCE) * irradiance
    made.to_object = wp.mat33(*to_object.ravel())
    made.object_offset = wp.vec3(*(to_object @ (origin - volume.centre)))
    made.right, made.up = wp.vec3(*right), wp.vec3(*up)
    made.anchor = wp.vec2(*np.mod(tiling * np.array([right @ origin, up @ origin]), 1.0))
    made.tiling, made.speed, made.split = tiling, settings.speed, settings.split
    made.strength, made.luminance_strength = settings.strength, settings.luminance_strength
    made.fade_radius, made.fade_strength = settings.fade_radius, settings.fade_strength
    made.irradiance = wp.vec3(*irradiance)
    made.luminance = wp.vec3(*(luminance / luminance.sum() if luminance.any() else luminance))
    return made


def device_medium(facts: Facts) -> Any:
    """Make the kernel's optics of the water."""
    import warp as wp

    made = Medium()
    made.ior, made.eta = facts.ior, 1.0 / facts.ior
    made.attenuation = wp.vec3(*facts.attenuation)
    return made
