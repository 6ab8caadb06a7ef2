"""Loading all files of a scene."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import TypeVar

from warp_caustics.assets.heights import load_heights
from warp_caustics.assets.meshes import load_mesh, place_objects
from warp_caustics.assets.types import Assets, TriangleMesh
from warp_caustics.errors import InputError
from warp_caustics.scene import Scene, TerrainFile
from warp_caustics.scene.faults import gathered

A = TypeVar("A")
T = TypeVar("T")


def load_assets(scene: Scene) -> Assets:
    """Load the height maps and meshes that a scene names.

    Heights are `scale * value + offset`: displacement from `water.level` for the water, world z for a terrain. Objects
    are scaled, moved and merged into one mesh.

    Raises
    ------
    InputError
        With the faults of all files, each with its path in the scene.
    """
    water, receiver = scene.water, scene.receiver
    faults: list[str] = []

    def attempt(where: str, load: Callable[[A], T], what: A | None) -> T | None:
        if what is None:
            return None
        try:
            return load(what)
        except InputError as error:
            faults.append(f"{where}: {error}")
            return None

    load_once = cache(load_mesh)  # many objects may share a mesh
    height_map = attempt("water.height_map", load_heights, water.height_map)
    terrain_file = receiver.terrain if isinstance(receiver.terrain, TerrainFile) else None
    terrain = attempt("receiver.terrain", load_heights, terrain_file)
    mesh = attempt("receiver.mesh", load_once, receiver.mesh)
    meshes: list[TriangleMesh] = []
    for i, item in enumerate(receiver.objects):
        loaded = attempt(f"receiver.objects[{i}].mesh", load_once, item.mesh)
        meshes += [loaded] if loaded else []
    if faults:
        raise gathered(faults, scene.name)
    return Assets(height_map, terrain, mesh, place_objects(receiver.objects, meshes) if meshes else None)
