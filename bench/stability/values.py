"""Numbers at the ends of float32 and float64, and what is no number at all."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from scenery import save_heights, save_quad

from stability.row import METHODS, Row, each
from stability.scenes import PIXEL, choppy, flat

AMPLITUDES = (5e-324, 1e-310, 1e-40, 1e-20)
HUGE = (1e6, 1e9, 1e18, 1e30, 1e300)
COARSE = 1e9
"""Pixel [m] at which huge waves fit a map."""


def tiny() -> Iterator[Row]:
    """Waves, light and absorption too small for float32."""
    for amplitude in AMPLITUDES:
        water = {"level": 0.75, "waves": [{"amplitude": amplitude, "wavevector": (9.0, 4.0)}]}
        table = choppy(water=water)
        yield from each(METHODS, "amplitude [m]", amplitude, table, flat(table), limit="float32")
        light = choppy(count=0, sun={"direction": (0.3, 0.0, -1.0), "irradiance": amplitude})
        yield from each(METHODS, "irradiance", amplitude, light, limit="a float32 map holds 1e-45 at least")
        clear = choppy(medium={"ior": 1.333, "absorption": amplitude}, count=0)
        yield from each(METHODS, "absorption [1/m]", amplitude, clear, flat(clear), limit="float32")


def huge() -> Iterator[Row]:
    """Waves, light and absorption too large."""
    for size in HUGE:
        water = {"level": 0.75, "waves": [{"amplitude": size, "wavevector": (9.0, 4.0)}]}
        yield from each(METHODS, "amplitude [m]", size, choppy(water=water), limit="float32 squares up to 1e18")
        short = {"level": PIXEL, "waves": [{"amplitude": 1e-3, "wavevector": (size, 0.0)}]}
        # A few pixels of shallow water: so steep, every ray is marched along for thousands of steps.
        small = choppy(water=short, resolution=(8, 6))
        yield from each(METHODS, "wavevector [rad/m]", size, small, limit="waves far below a pixel are noise")
        light = choppy(sun={"direction": (0.3, 0.0, -1.0), "irradiance": size})
        yield from each(METHODS, "irradiance", size, light, limit="float32 squares up to 1e18")
        dark = choppy(medium={"ior": 1.333, "absorption": size})
        yield from each(METHODS, "absorption [1/m]", size, dark, limit="no light arrives")
    both = {"level": 2e9, "waves": [{"amplitude": 1e9, "wavevector": (1e17, 0.0)}]}
    everything = choppy(pixel=COARSE, water=both, resolution=(8, 6))
    yield from each(METHODS, "slope", 1e26, everything, limit="float32 squares up to 1e18")


def faulty_scenes() -> dict[str, Callable[[float], dict[str, Any]]]:
    """Each number of a scene that could be none, as what to change."""
    water = {"amplitude": 0.01, "wavevector": (9.0, 4.0)}
    return {
        "water.level": lambda v: {"water": {"level": v, "waves": []}},
        "water.waves.amplitude": lambda v: {"water": {"level": 0.75, "waves": [{**water, "amplitude": v}]}},
        "water.waves.wavevector": lambda v: {"water": {"level": 0.75, "waves": [{**water, "wavevector": (v, 1.0)}]}},
        "water.waves.phase": lambda v: {"water": {"level": 0.75, "waves": [{**water, "phase": v}]}},
        "water.waves.angular_frequency": lambda v: {
            "water": {"level": 0.75, "waves": [{**water, "angular_frequency": v}]}
        },
        "receiver.plane": lambda v: {"receiver": {"plane": v}},
        "receiver.terrain.slope": lambda v: {"receiver": {"terrain": {"base": 0.0, "slope": (v, 0.0)}}},
        "sun.direction": lambda v: {"sun": {"direction": (v, 0.0, -1.0)}},
        "sun.irradiance": lambda v: {"sun": {"direction": (0.0, 0.0, -1.0), "irradiance": v}},
        "medium.ior": lambda v: {"medium": {"ior": v}},
        "medium.absorption": lambda v: {"medium": {"ior": 1.333, "absorption": v}},
        "map.origin": lambda v: {"map": {"origin": (v, 0.0), "size": (1.0, 1.0), "resolution": (8, 8)}},
        "map.size": lambda v: {"map": {"origin": (0.0, 0.0), "size": (v, 1.0), "resolution": (8, 8)}},
    }


def not_numbers() -> Iterator[Row]:
    """NaN and infinity, in every number of a scene, and as a time."""
    for where, change in faulty_scenes().items():
        for value in (np.nan, np.inf):
            yield from each(("beam",), where, value, {**choppy(), **change(value)}, limit="refused")
    for value in (np.nan, np.inf):
        yield from each(("beam",), "time", value, choppy(), time=value, limit="refused")


def faulty_files() -> Iterator[Row]:
    """NaN, infinity and numbers that float32 cannot hold, in files of heights and of triangles."""
    corner, size = (-4.0, -4.0), (10.0, 10.0)
    with TemporaryDirectory() as name:
        folder = Path(name)
        for value in (np.nan, np.inf, 1e20, 1e39, 1e300):
            z = np.zeros((64, 64))
            z[20, 30] = value
            heights = save_heights(folder, "heights", z, corner, size)
            for where, change in (
                ("height map of the water", {"water": {"level": 0.75, "height_map": heights}}),
                ("terrain file", {"receiver": {"terrain": heights}}),
            ):
                yield from each(("beam", "photon"), where, value, {**choppy(), **change}, limit="refused")
            path = Path(save_quad(folder))
            path.write_text(path.read_text() + f"v 0 {value} 0\nf 1 2 5\n")
            yield from each(("beam", "photon"), "mesh", value, choppy(receiver={"mesh": str(path)}), limit="refused")
            stone = {"plane": 0.0, "objects": [{"mesh": str(path)}]}
            yield from each(("beam", "photon"), "object", value, choppy(receiver=stone), limit="refused")
