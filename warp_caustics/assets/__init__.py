"""The files that a scene names: height maps and meshes."""

from warp_caustics.assets.load import load_assets
from warp_caustics.assets.types import Assets, HeightGrid, TriangleMesh

__all__ = ["Assets", "HeightGrid", "TriangleMesh", "load_assets"]
