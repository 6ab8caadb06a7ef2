"""The scene file: its models, their validation, and loading."""

from warp_caustics.scene.cascaded import CascadedSettings
from warp_caustics.scene.frame import Camera, Map
from warp_caustics.scene.light import Medium, Sun
from warp_caustics.scene.load import bundled_scenes, load_scene, parse_scene
from warp_caustics.scene.medium_tables import CHANNEL_WAVELENGTHS, IOR_TABLE, JERLOV_TABLE
from warp_caustics.scene.method import (
    METHODS,
    AreaRatioSettings,
    BeamSettings,
    DifferentialSettings,
    GatherSettings,
    Method,
    PhotonSettings,
    SampleSettings,
    known_method,
)
from warp_caustics.scene.pattern import PatternSettings, Volume
from warp_caustics.scene.receiver import ClosedTerrain, MeshObject, Receiver, TerrainFile, TerrainWave
from warp_caustics.scene.scene import Scene
from warp_caustics.scene.simulation import Drop, Obstacle, Simulation
from warp_caustics.scene.spectrum import Spectrum
from warp_caustics.scene.water import HeightMap, Water, Wave

__all__ = [
    "CHANNEL_WAVELENGTHS",
    "IOR_TABLE",
    "JERLOV_TABLE",
    "METHODS",
    "AreaRatioSettings",
    "BeamSettings",
    "Camera",
    "CascadedSettings",
    "ClosedTerrain",
    "DifferentialSettings",
    "Drop",
    "GatherSettings",
    "HeightMap",
    "Map",
    "Medium",
    "MeshObject",
    "Method",
    "Obstacle",
    "PatternSettings",
    "PhotonSettings",
    "Receiver",
    "SampleSettings",
    "Scene",
    "Simulation",
    "Spectrum",
    "Sun",
    "TerrainFile",
    "TerrainWave",
    "Volume",
    "Water",
    "Wave",
    "bundled_scenes",
    "known_method",
    "load_scene",
    "parse_scene",
]
