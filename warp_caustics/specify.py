"""What the kernels of a scene must contain, and why the rest is left out.

Each decision to leave something out is taken here once, and its reason is kept for the plan to print.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .kernels.spec import Spec
from .receiver import Bounds, receiver_kind

if TYPE_CHECKING:
    from .assets import Assets
    from .scene import Scene
    from .simulation import Basin, Sea

WATER_IN_WORDS = {"waves": "a sum of waves", "grid": "a file", "radial": "rings around a point"}
"""Kinds of water that are not made before each frame."""

HEIGHT_FIELDS = ("waves", "grid")
"""Kinds of receiver that have one height at a point, and are marched over."""


@dataclass(frozen=True)
class Reason:
    """One thing that a scene could need: whether it does, and why."""

    what: str
    kept: bool
    why: str


@dataclass(frozen=True)
class Light:
    """What the specification needs to know of the light.

    Attributes
    ----------
    suns : ndarray
        Directions of the sun ``[n, 3]``.
    slopes : ndarray
        Points whose hull holds every slope of the surface ``[n, 2]``.
    steepest : float
        The largest tangent of a refracted ray's angle from the vertical.
    amplitude : float
        Bound of the water's displacement [m].
    """

    suns: np.ndarray
    slopes: np.ndarray
    steepest: float
    amplitude: float


def water_kind(scene: Scene, assets: Assets) -> str:
    """Kind of the water: ``"waves"``, ``"grid"`` (a height map), ``"periodic"`` (one that repeats) or ``"radial"``."""
    if scene.water.preset == "radial":
        return "radial"
    if scene.water.spectrum is not None:
        return "periodic"
    if scene.water.simulation is not None:
        return "periodic" if scene.water.simulation.border == "periodic" else "grid"
    return "waves" if assets.water is None else "grid"


def specify(scene: Scene, assets: Assets, light: Light, ground: Bounds) -> Spec:
    """Decide what the kernels contain; ``ground`` bounds the receiver, from the water's level."""
    kind, medium = receiver_kind(scene), scene.medium
    height_field = kind in HEIGHT_FIELDS
    slope = float(np.linalg.norm(light.slopes, axis=1).max())
    faces_away = bool((light.slopes @ light.suns[:, :2].T - light.suns[:, 2] < 0.0).any())
    meshes = [mesh for mesh in (assets.mesh, assets.objects) if mesh is not None]
    top = max((float(mesh.vertices[:, 2].max()) - scene.water.level for mesh in meshes), default=-np.inf)
    shore = height_field and bool(ground.highest > -light.amplitude)
    across = np.linalg.norm(light.suns[:, :2], axis=1)
    by_depth = medium.jerlov is not None
    absorbs = by_depth or bool(np.any(medium.absorption))
    return Spec(
        water=water_kind(scene, assets),
        declared=scene.water.simulation is not None or scene.water.spectrum is not None,
        receiver=kind,
        objects=assets.objects is not None,
        bounded=water_kind(scene, assets) == "grid",
        shore=shore,
        hills_shade=shore and bool((ground.slope * across > -light.suns[:, 2]).any()),
        occluders=bool(top > -light.amplitude),
        self_shadow=faces_away and scene.water.self_shadow is not False,
        faces_away=faces_away,
        exits=bool(slope * light.steepest > 1.0),
        tears=height_field and bool(ground.slope * light.steepest >= 1.0),
        fresnel=medium.fresnel,
        attenuation="none" if not absorbs else "depth" if by_depth else "path",
        channels=3 if by_depth or (absorbs and isinstance(medium.absorption, tuple)) else 1,
        accumulate=scene.method.accumulate,
    )


def reasons(scene: Scene, spec: Spec, suns: int, basin: Basin | Sea | None) -> tuple[Reason, ...]:
    """Say of each thing that a scene could need whether it does, and why."""
    height_field, meshes = spec.receiver in HEIGHT_FIELDS, spec.objects or spec.receiver == "mesh"
    unshaded = "water.self_shadow is false" if spec.faces_away else "no slope reaches the sun's elevation"
    simulation, spectrum = scene.water.simulation, scene.water.spectrum
    made = "simulated" if simulation else "a sea" if spectrum else WATER_IN_WORDS[spec.water]
    water = f"water is {made}"
    summary = "" if basin is None else basin.summary
    table = (
        ("surface by height map", spec.water in ("grid", "periodic"), water, water),
        ("simulation", simulation is not None, summary, water),
        ("spectrum", spectrum is not None, summary, water),
        ("border of the water", spec.bounded, "cells are clipped to it", "the water has no end"),
        ("Fresnel", spec.fresnel, "medium.fresnel", "medium.fresnel is false"),
        ("attenuation", spec.attenuation != "none", f"by {spec.attenuation}", "nothing absorbs: no path length"),
        ("transport by colour", spec.channels > 1, "absorption differs by channel", "all channels travel alike"),
        ("self-shadow", spec.self_shadow, "slopes pass the sun's elevation", unshaded),
        ("exit through the surface", spec.exits, "a ray may meet a crest from below", "no ray is flat enough for it"),
        ("march over terrain", height_field, "receiver.terrain", f"the receiver is a {spec.receiver}"),
        ("shore", spec.shore, "land may rise above the water", "no land near the surface"),
        (
            "shade on dry land",
            spec.hills_shade,
            "hills face away from the sun",
            "no hill is as steep as the sun's rays",
        ),
        ("torn cells", spec.breaks, "a cell's corners may meet different fates", "neighbouring rays stay neighbours"),
        ("BVH", meshes, "meshes in the scene", "no meshes"),
        ("sun's disk", suns > 1, f"{suns} directions share the flux", "one direction: its disk is a point"),
    )
    return tuple(Reason(what, kept, why if kept else why_not) for what, kept, why, why_not in table)
