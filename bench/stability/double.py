"""The very samples of ``photon`` and ``gather``, followed and splatted in float64 NumPy: what float32 alone costs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

import warp_caustics as wc
from oracle import read_setting
from oracle.rays import LANDS, trace_points


def same_samples(table: Mapping[str, Any], plan: wc.Plan, time: float = 0.0) -> np.ndarray:
    """Give the map of a plan's own samples in float64.

    Parameters
    ----------
    table : mapping
        The scene, of waves over a plane or a terrain in closed form.
    plan : Plan
        Of ``photon`` or ``gather``: its lattice says where the samples are.
    time : float
        [s].
    """
    setting, lattice = read_setting(table, time), plan.program.lattice
    # As the kernels hold them: rounded alike, the places are the same, and only what follows from them differs.
    pixel, shift = (a.astype(np.float32).astype(np.float64) for a in (plan.facts.pixel, plan.facts.rest_shifts[0]))
    columns, rows = setting.resolution
    width = 1.0 if plan.method == "gather" else float(plan.program.values["footprint"][0])
    at = [(lattice.first[i] + np.arange(lattice.count[i]) + 0.5) * lattice.step for i in (0, 1)]
    u, v = (setting.origin[i] + at[i] * pixel[i] - shift[i] for i in (0, 1))
    rays = trace_points(setting, *np.broadcast_arrays(u[None, :], v[:, None]))
    lands = rays.fate == LANDS
    image = np.zeros((setting.channels, rows, columns))
    for channel in range(setting.channels):
        image[channel] = boxes(rays.x[lands], rays.y[lands], rays.carried[channel][lands], width, (rows, columns))
    image *= lattice.step**2
    return np.asarray(image[0] if setting.channels == 1 else np.moveaxis(image, 0, -1))


def boxes(x: np.ndarray, y: np.ndarray, flux: np.ndarray, width: float, shape: tuple[int, int]) -> np.ndarray:
    """Spread fluxes over boxes of a width around places, all in pixels."""
    image = np.zeros(shape)
    first_x, first_y = np.floor(x - 0.5 * width).astype(int), np.floor(y - 0.5 * width).astype(int)
    reach = int(np.ceil(width)) + 1
    for j in range(reach):
        tall = np.minimum(y + 0.5 * width, first_y + j + 1.0) - np.maximum(y - 0.5 * width, first_y + j)
        for i in range(reach):
            wide = np.minimum(x + 0.5 * width, first_x + i + 1.0) - np.maximum(x - 0.5 * width, first_x + i)
            share = np.maximum(wide, 0.0) * np.maximum(tall, 0.0) / width**2
            row, column = first_y + j, first_x + i
            kept = (share > 0.0) & (row >= 0) & (row < shape[0]) & (column >= 0) & (column < shape[1])
            np.add.at(image, (row[kept], column[kept]), (share * flux)[kept])
    return image
