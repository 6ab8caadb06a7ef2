"""The water on the host: its waves at a time, its bounds, its height for drawing. All in float64."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .errors import InputError
from .height_map import sample_heights, surface_hull

if TYPE_CHECKING:
    from .assets import Assets
    from .scene import Scene
    from .simulation import Sea

GRAVITY = 9.81
"""Acceleration of free fall [m/s^2]."""

DISK_DIRECTIONS = 64
"""Directions in which a disk of slopes is tried; it is drawn around, not inside, so that it holds them all."""

EDGE_POINTS = 8
"""Points along each edge of the set of slopes at which refraction is tried."""

RADII = np.linspace(0.0, 1.0, 9)
"""Where, from no slope to the farthest, refraction is tried for its bounds."""

BETWEEN_SAMPLES = 0.25
"""Share by which a simulation's bound of slope is widened: slopes are measured at nodes and half-way between them, and
a parabola through three samples of a slope may rise that far above the largest."""

LONGEST_TIME = 1e9
"""Latest time [s], 32 years, at which a phase of float64 is still right to 1e-6 rad."""


def check_time(time: float) -> None:
    """Refuse a time that is not finite, or so late that phases are not known.

    Raises
    ------
    InputError
        With the time that it got.
    """
    if not abs(time) <= LONGEST_TIME:
        raise InputError(f"time: expected a number of seconds up to {LONGEST_TIME:g} either way, got {time}")


def angular_frequency(wavenumber: np.ndarray, depth: float) -> np.ndarray:
    """Angular frequency of gravity waves over a finite depth: w^2 = g k tanh(k d) (Airy).

    Parameters
    ----------
    wavenumber : ndarray
        [rad/m].
    depth : float
        Of the water at rest [m].

    Returns
    -------
    ndarray
        [rad/s].
    """
    return np.sqrt(GRAVITY * wavenumber * np.tanh(wavenumber * depth))


def is_radial(scene: Scene) -> bool:
    """Tell whether the water is rings around the map's middle."""
    return scene.water.preset == "radial"


def phases(scene: Scene, time: float, depth: float) -> np.ndarray:
    """Phase of each wave at the map's origin, or of rings at their middle, at a time, reduced to [0, 2 pi) [rad].

    Taken in float64, so that neither a distant map nor a late time costs the kernels a digit.
    """
    return phases_at(*first_phases(scene, depth), time)


def phases_at(first: np.ndarray, omega: np.ndarray, time: float) -> np.ndarray:
    """Phases at a time, from those at time 0 and the angular frequencies [rad/s]; reduced as :func:`phases`."""
    # The two large terms are reduced apart, so that their sum does not round them together.
    return np.asarray(np.mod(first - np.mod(omega * time, 2.0 * np.pi), 2.0 * np.pi))


def first_phases(scene: Scene, depth: float) -> tuple[np.ndarray, np.ndarray]:
    """Phase of each wave at time 0, as :func:`phases`, and its angular frequency [rad/s]."""
    waves = scene.waves
    k = np.array([wave.wavevector for wave in waves], dtype=np.float64).reshape(-1, 2)
    given = [wave.angular_frequency for wave in waves]
    own = angular_frequency(np.hypot(k[:, 0], k[:, 1]), depth)
    omega = np.array([own[i] if w is None else w for i, w in enumerate(given)])
    phase = np.array([wave.phase for wave in waves])
    if not is_radial(scene):
        phase = phase + k @ np.asarray(scene.map.origin, dtype=np.float64)
    return np.mod(phase, 2.0 * np.pi), omega


def extreme_slopes(scene: Scene, assets: Assets) -> np.ndarray:
    """Points ``[n, 2]`` whose convex hull holds every slope that the surface can have, zero among them.

    For waves the slopes fill a zonotope, the sum of the segments from -a k to a k; for a height map they are bounded
    by a disk, and for a simulation or a spectrum declared so; rings have a slope in every direction.
    """
    water = scene.water
    if assets.water is not None or water.simulation is not None or water.spectrum is not None or is_radial(scene):
        angle = np.linspace(0.0, 2.0 * np.pi, DISK_DIRECTIONS, endpoint=False)
        steepest = _steepest(scene, assets) / np.cos(np.pi / DISK_DIRECTIONS)
        rim = steepest * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    else:
        steps = np.array([np.multiply(wave.amplitude, wave.wavevector) for wave in scene.waves])
        rim = zonotope(steps.reshape(-1, 2))
    share = np.arange(EDGE_POINTS)[:, None, None] / EDGE_POINTS
    outline = ((1.0 - share) * rim + share * np.roll(rim, -1, axis=0)).reshape(-1, 2)
    return (RADII[:, None, None] * outline).reshape(-1, 2)


def _steepest(scene: Scene, assets: Assets) -> float:
    """Bound of the slope of a height map, the one that a simulation declares, or what a spectrum's surface reaches."""
    if scene.water.spectrum is not None:
        return _sea(scene, assets).max_slope
    if scene.water.simulation is not None:
        return scene.water.simulation.max_slope * (1.0 + BETWEEN_SAMPLES)
    if is_radial(scene):
        return sum(abs(wave.amplitude) * wave.wavevector[0] for wave in scene.waves)
    assert assets.water is not None
    return surface_hull(assets.water).slope


def _sea(scene: Scene, assets: Assets) -> Sea:
    """The sea of a scene's spectrum, made once."""
    from .receiver import rest_depth
    from .simulation import make_sea

    assert scene.water.spectrum is not None
    return make_sea(scene.water.spectrum, rest_depth(scene, assets))


def zonotope(steps: np.ndarray) -> np.ndarray:
    """Corners, in order, of the sum of the segments from -step to step, for steps ``[n, 2]``."""
    if not len(steps):
        return np.zeros((1, 2))
    upper = np.where((steps[:, 1] < 0.0) | ((steps[:, 1] == 0.0) & (steps[:, 0] < 0.0)), -1.0, 1.0)[:, None] * steps
    upper = upper[np.argsort(np.arctan2(upper[:, 1], upper[:, 0]))]
    half = -upper.sum(axis=0) + np.concatenate([np.zeros((1, 2)), 2.0 * np.cumsum(upper, axis=0)])
    return np.concatenate([half[:-1], -half[:-1]])


def amplitude_bound(scene: Scene, assets: Assets) -> float:
    """Largest displacement from the rest level, either way [m]."""
    if scene.water.spectrum is not None:
        return _sea(scene, assets).max_height
    if scene.water.simulation is not None:
        return scene.water.simulation.height_bound
    if assets.water is not None:
        hull = surface_hull(assets.water)
        return max(abs(hull.lowest), abs(hull.highest))
    return float(sum(abs(wave.amplitude) for wave in scene.waves))


def water_heights(
    scene: Scene, assets: Assets, x: np.ndarray, y: np.ndarray, time: float, depth: float | None = None
) -> np.ndarray:
    """Height of the water's surface at world coordinates, for drawing.

    Parameters
    ----------
    scene, assets
        The scene and the files that it names.
    x, y : ndarray
        World coordinates of any one shape [m].
    time : float
        [s].
    depth : float, optional
        Depth for the waves' dispersion relation [m]; taken from the receiver if not given.

    Returns
    -------
    ndarray
        z [m], float64.
    """
    x, y = np.broadcast_arrays(np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64))
    if assets.water is not None:
        return scene.water.level + sample_heights(assets.water, x, y)
    if scene.water.simulation is not None or scene.water.spectrum is not None:
        from .simulation import simulated_heights

        return scene.water.level + simulated_heights(scene, assets, x, y, time)
    if depth is None:
        from .receiver import rest_depth

        depth = rest_depth(scene, assets)
    z = np.full(x.shape, float(scene.water.level))
    origin = scene.map.origin
    for wave, phase in zip(scene.waves, phases(scene, time, depth), strict=True):
        kx, ky = wave.wavevector
        way = kx * (x - origin[0]) + ky * (y - origin[1])
        if is_radial(scene):
            middle = np.add(origin, 0.5 * np.asarray(scene.map.size))
            way = kx * np.hypot(x - middle[0], y - middle[1])
        z += wave.amplitude * np.sin(way + phase)
    return z
