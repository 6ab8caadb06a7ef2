"""The same map by a second road: photons at jittered places, counted by pixel."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from oracle.clip import deposit_points
from oracle.rays import LANDS, trace_points
from oracle.setting import read_setting
from oracle.surfaces import Array
from oracle.window import emitting_window

CHUNK = 100_000  # photons traced at a time


@dataclass(frozen=True)
class PhotonEstimate:
    """The mean of independent batches and the standard error of that mean, by pixel: [rows, columns(, 3)]."""

    caustic_map: Array
    noise: Array


def photon_map(
    scene: Mapping[str, Any], time: float = 0.0, per_pixel: int = 4, batches: int = 16, seed: int = 0
) -> PhotonEstimate:
    """Estimate the light that comes through water by counting photons; dry land stays dark.

    Parameters
    ----------
    scene, time
        As for ``reference_map``.
    per_pixel : int
        Photons along a pixel's side, in each batch: one at a random place in each cell.
    batches : int
        Independent repetitions, at least two, which give the noise.
    seed : int
        Of the random places.
    """
    setting = read_setting(scene, time)
    rng = np.random.default_rng(seed)
    pixel = np.array(setting.pixel)
    window = emitting_window(setting)
    cells = np.ceil((window[:, 1] - window[:, 0]) / pixel * per_pixel).astype(int)
    width, height = pixel / per_pixel
    columns, rows = setting.resolution
    block = max(1, CHUNK // cells[0])
    maps = np.zeros((batches, setting.channels, rows, columns))
    for image in maps:
        for bottom in range(0, cells[1], block):
            shape = (min(block, cells[1] - bottom), cells[0])
            u = window[0, 0] + width * (np.arange(shape[1]) + rng.random(shape)).ravel()
            v = window[1, 0] + height * (bottom + np.arange(shape[0])[:, None] + rng.random(shape)).ravel()
            rays = trace_points(setting, u, v)
            lands = rays.fate == LANDS
            deposit_points(image, rays.x[lands], rays.y[lands], rays.carried[:, lands] * width * height)
    maps = np.moveaxis(maps, 1, -1) / (pixel[0] * pixel[1])
    if setting.channels == 1:
        maps = maps[..., 0]
    noise = maps.std(axis=0, ddof=1) / np.sqrt(batches)
    return PhotonEstimate(maps.mean(axis=0), noise)
