"""The scenes that the sweeps change: one metre is 64 pixels, and waves are some tens of pixels long."""

from __future__ import annotations

from typing import Any

import numpy as np

import warp_caustics as wc
from oracle import flat_water_irradiance, reference_map, relative_l2, sine_irradiance
from oracle.cases import sunlight, waves
from stability.double import same_samples
from stability.row import Truth

PIXEL = 1.0 / 64.0
RESOLUTION = (48, 32)
DEPTH = 48.0
"""Of the water [pixels]: short of its focus."""

OVERSAMPLE = 8
"""Cells along a pixel's side in the reference: it says by how much it may be wrong."""


def choppy(
    *,
    pixel: float = PIXEL,
    slope: float = 0.05,
    depth: float = DEPTH,
    zenith: float = 30.0,
    resolution: tuple[int, int] = RESOLUTION,
    origin: tuple[float, float] = (0.0, 0.0),
    count: int = 5,
    **changes: Any,
) -> dict[str, Any]:
    """Give waves of some root mean square slope over a flat floor at z = 0; ``changes`` replace whole tables."""
    table = {
        "water": {"level": depth * pixel, "waves": waves(pixel, 60.0, 16.0, count, slope) if count else []},
        "receiver": {"plane": 0.0},
        "sun": {"direction": sunlight(zenith)},
        "medium": {"ior": 1.333},
        "map": {"origin": origin, "size": tuple(pixel * n for n in resolution), "resolution": resolution},
    }
    return {**table, **changes}


def converged(table: dict[str, Any], time: float = 0.0, oversample: int = OVERSAMPLE) -> Truth:
    """Give the float64 reference of a scene."""
    with np.errstate(invalid="ignore"):  # where no light lands there is no relative error
        reference = reference_map(table, time, oversample)
    return Truth(reference.caustic_map, float(np.nan_to_num(reference.error)))


def dense(table: dict[str, Any], per_pixel: float = 256.0) -> Truth:
    """Give what many photons in float64 make of a scene, where the reference's own lattice does not converge."""
    coarse, fine = (
        same_samples(
            table, wc.make_plan(wc.Scene(**table, method={"photon": {"photons_per_pixel": n}}), "photon", "cpu")
        )
        for n in (0.25 * per_pixel, per_pixel)
    )
    return Truth(fine, relative_l2(coarse, fine) if fine.any() else 0.0)


def flat(table: dict[str, Any]) -> Truth:
    """Give the light under flat water, in closed form."""
    direction, medium = table["sun"]["direction"], table["medium"]
    columns, rows = table["map"]["resolution"]
    depth = table["water"]["level"] - table["receiver"].get("plane", 0.0)
    light = flat_water_irradiance(
        direction[2], medium["ior"], depth, absorption=medium.get("absorption", 0.0),
        fresnel=medium.get("fresnel", False),
    )  # fmt: skip
    return Truth(np.full((rows, columns), light))


def sine(depth: float, amplitude: float, length: float, light_x: float = 0.3, columns: int = 64) -> dict[str, Any]:
    """Give one sine along x, over a map four pixels tall; lengths in metres."""
    k = 2.0 * np.pi / length
    return {
        "water": {"level": depth, "waves": [{"amplitude": amplitude, "wavevector": (k, 0.0), "phase": 0.3}]},
        "receiver": {"plane": 0.0},
        "sun": {"direction": (light_x, 0.0, -float(np.sqrt(1.0 - light_x**2)))},
        "medium": {"ior": 1.333},
        "map": {"origin": (0.0, 0.0), "size": (columns * PIXEL, 4 * PIXEL), "resolution": (columns, 4)},
    }


def sine_truth(table: dict[str, Any]) -> Truth:
    """Give the light under :func:`sine`, folds and all, in closed form."""
    wave, (columns, rows) = table["water"]["waves"][0], table["map"]["resolution"]
    edges = np.linspace(0.0, table["map"]["size"][0], columns + 1)
    line = sine_irradiance(
        edges, wave["amplitude"], wave["wavevector"][0], table["water"]["level"], table["medium"]["ior"],
        table["sun"]["direction"][0], wave["phase"],
    )  # fmt: skip
    return Truth(np.tile(line, (rows, 1)))
