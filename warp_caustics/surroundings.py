"""Light beside the map: a wider, coarser map by the same method, so that a picture does not end where the map does."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .errors import InputError
from .receiver import receiver_kind, rest_depth
from .scene import Map
from .water import angular_frequency, is_radial

if TYPE_CHECKING:
    from .renderer import Renderer
    from .result import Result
    from .scene import Scene

LIT_BY_BEAMS = frozenset({"reference", "cascaded"})
"""Methods that follow light and have no map for what lies around: one converges slowly, one makes none."""

NO_LIGHT = frozenset({"pattern"})
"""Methods whose picture of light ends where they say it does."""

WIDER = 3.0
"""Sides of the wider map over those of the map."""

COARSER = 2.0
"""Pixels of the wider map over those of the map: it lies farther from what the camera looks at."""

FADE = 0.125
"""Band of the wider map in which its light turns into that of still water, as a share of its smaller side."""


@dataclass(frozen=True)
class Surroundings:
    """Renders a caustic map of more than the map.

    Attributes
    ----------
    renderer : Renderer
        Of the wider map.
    origin, size : (x, y)
        [m].
    fade : float
        Width of the band at its rim [m].
    """

    renderer: Renderer
    origin: tuple[float, float]
    size: tuple[float, float]
    fade: float

    def light(self, time: float) -> np.ndarray:
        """The wider map at a time [s], as :attr:`Result.caustic_map`."""
        made = self.renderer.render(time).caustic_map
        assert made is not None  # make_surroundings has seen to it
        return np.asarray(made.numpy())


def make_surroundings(result: Result) -> Surroundings | None:
    """Plan the light around the map of a result; None where nothing goes on there or the method cannot reach it.

    Waves have no end, and a plane or a terrain none either; a height map, a simulation and a mesh have, and rings
    belong to the map that they surround. A sea goes on where the floor is flat: over a terrain its mean depth, and
    with it its waves, would be others.
    """
    from .renderer import Renderer

    scene = result.scene
    kind, water = receiver_kind(scene), scene.water
    waves = water.waves is not None or (water.preset is not None and not is_radial(scene))
    if result.method in NO_LIGHT or kind == "mesh" or not (waves or (water.spectrum is not None and kind == "plane")):
        return None
    origin, size = _wider(result)
    pixels = np.ceil(np.asarray(scene.map.resolution) * size / scene.map.size / COARSER).astype(int)
    window = Map(origin=origin, size=size, resolution=(int(pixels[0]), int(pixels[1])))
    wide = _with_frequencies(result).model_copy(update={"map": window})
    method = "beam" if result.method in LIT_BY_BEAMS else result.method
    try:
        renderer = Renderer(wide, method, result.device, result.plan.threads)
    except InputError:
        return None
    return Surroundings(renderer, origin, size, FADE * min(size))


def _wider(result: Result) -> tuple[tuple[float, float], tuple[float, float]]:
    """The rectangle around the map, cut to the terrain's file where there is one."""
    origin, size = np.asarray(result.scene.map.origin), np.asarray(result.scene.map.size)
    low, high = origin - 0.5 * (WIDER - 1.0) * size, origin + 0.5 * (WIDER + 1.0) * size
    terrain = result.assets.terrain
    if terrain is not None:
        low = np.maximum(low, terrain.origin)
        high = np.minimum(high, np.add(terrain.origin, terrain.size))
    extent = high - low
    return (float(low[0]), float(low[1])), (float(extent[0]), float(extent[1]))


def _with_frequencies(result: Result) -> Scene:
    """The scene with each wave and its frequency written out.

    Over a wider map the mean depth would be another, and with it the frequencies; and so would a preset be.
    """
    scene, depth = result.scene, rest_depth(result.scene, result.assets)
    if scene.water.spectrum is not None:
        return scene
    waves = []
    for wave in scene.waves:
        own = float(angular_frequency(np.hypot(*wave.wavevector), depth))
        waves.append(wave if wave.angular_frequency is not None else wave.model_copy(update={"angular_frequency": own}))
    water = scene.water.model_copy(update={"waves": tuple(waves), "preset": None})
    return scene.model_copy(update={"water": water})
