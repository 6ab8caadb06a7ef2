"""The converged caustic map, by laying down ever finer cells of the surface."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from oracle.cells import Deposit
from oracle.rays import trace_lattice
from oracle.setting import Setting, read_setting
from oracle.surfaces import Array
from oracle.window import depth_range, emitting_window

CHUNK = 200_000  # corners traced at a time: some tens of megabytes
SPLITS = 2  # an edge of light and shadow is followed to a 16th of a cell
DRY_SAMPLES = 64  # samples each way in a pixel that a shore may cross
ORDER_FACTOR = 4.0  # half the step, a quarter of the error


@dataclass(frozen=True)
class Reference:
    """A map with its ledger and the error it may have.

    Attributes
    ----------
    caustic_map : array [rows, columns] or [rows, columns, 3]
        Flux per horizontal area.
    energy : dict of float, or arrays [3]
        Flux in watts: emitted = received + reflected + absorbed + outside_map + left_water. Beside it ``dry``, direct
        sunlight on dry land in the map, and ``over_lit``. The map times its pixel area sums to received + dry.
    error : float
        Estimated relative L2 error (RMSE over mean); NaN for a single level.
    """

    caustic_map: Array
    energy: dict[str, Array]
    error: float


def relative_l2(image: Array, reference: Array) -> float:
    """Give the root mean square difference over the mean of the reference."""
    difference = np.asarray(image, dtype=np.float64) - reference
    return float(np.sqrt(np.mean(difference**2)) / np.mean(reference))


def reference_map(
    scene: Mapping[str, Any], time: float = 0.0, oversample: int = 16, extrapolate: bool = True
) -> Reference:
    """Compute a converged map of a scene of waves over a plane or a closed terrain.

    Parameters
    ----------
    scene : mapping
        The scene as its TOML file would give it.
    time : float
        Seconds.
    oversample : int
        Cells of the water surface along a pixel's side; even, since half as many give the error estimate.
    extrapolate : bool
        Combine the two levels as if the error were of second order (Richardson). The estimate is in both cases that of
        the finer level alone, so it is on the safe side for an extrapolated map.
    """
    setting = read_setting(scene, time)
    coarse = triangle_map(setting, oversample // 2)
    fine = triangle_map(setting, oversample)
    step = (fine.caustic_map - coarse.caustic_map) / (ORDER_FACTOR - 1.0)
    error = float(np.sqrt(np.mean(step**2)) / np.mean(fine.caustic_map))
    if not extrapolate:
        return Reference(fine.caustic_map, fine.energy, error)
    energy = {name: value + (value - coarse.energy[name]) / (ORDER_FACTOR - 1.0) for name, value in fine.energy.items()}
    return Reference(fine.caustic_map + step, energy, error)


def ideal_map(scene: Mapping[str, Any], time: float = 0.0, per_pixel: int = 1, falling: bool = False) -> Reference:
    """Lay down unrefined triangles: what a plain exact deposit reaches.

    ``per_pixel`` cells lie along a pixel's side; ``falling`` chooses the diagonal that cuts them, as in ``Deposit``.
    """
    return triangle_map(read_setting(scene, time), per_pixel, 0, falling)


def triangle_map(setting: Setting, oversample: int, splits: int = SPLITS, falling: bool = False) -> Reference:
    """Lay down one lattice of cells, whose corners land on pixel corners when the water is at rest."""
    u, v = (_edges(setting, axis, oversample) for axis in (0, 1))
    deposit = Deposit(setting, splits, falling)
    rows = max(1, CHUNK // u.size)
    for start in range(0, v.size - 1, rows):
        band = v[start : start + rows + 1]
        deposit.add_lattice(trace_lattice(setting, u, band), u, band)
    dry = direct_sunlight(setting)
    area = setting.pixel[0] * setting.pixel[1]
    energy = {**deposit.energy, "received": deposit.image.sum(axis=(1, 2)), "dry": dry.sum(axis=(1, 2)) * area}
    image = np.moveaxis(deposit.image / area + dry, 0, -1)
    if setting.channels == 1:
        return Reference(image[..., 0], {name: value[0] for name, value in energy.items()}, float("nan"))
    return Reference(image, energy, float("nan"))


def _edges(setting: Setting, axis: int, oversample: int) -> Array:
    """Give the lattice lines along one axis over the emitting window."""
    low, high = emitting_window(setting)[axis]
    pixel = setting.pixel[axis]
    anchor = setting.origin[axis] - setting.rest_deflection[axis] * setting.rest_depth
    first = int(np.floor((low - anchor) / pixel))  # whole pixels, so that every level lays down the same water
    last = int(np.ceil((high - anchor) / pixel))
    return np.asarray(anchor + pixel / oversample * np.arange(first * oversample, last * oversample + 1))


def direct_sunlight(setting: Setting) -> Array:
    """Give the sunlight on dry land by horizontal area, averaged over pixels: [channels, rows, columns]."""
    columns, rows = setting.resolution
    image = np.zeros((setting.channels, rows, columns))
    if depth_range(setting)[0] > 0.0:
        return image
    samples = (np.arange(DRY_SAMPLES) + 0.5) / DRY_SAMPLES
    x = setting.origin[0] + setting.pixel[0] * (np.arange(columns)[:, None] + samples).ravel()
    ix, iy, iz = setting.direction
    for row in range(rows):
        y = setting.origin[1] + setting.pixel[1] * (row + samples)
        land, zx, zy = setting.floor.lattice(x, y)
        bare = land >= setting.water.lattice(x, y)[0]
        light = np.where(bare, np.maximum(0.0, zx * ix + zy * iy - iz), 0.0)
        mean = light.reshape(DRY_SAMPLES, columns, DRY_SAMPLES).mean(axis=(0, 2))
        image[:, row] = np.multiply.outer(setting.irradiance, mean)
    return image
