"""From a scene, as the plain dictionary that its TOML file would give, to the numbers that the reference needs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from oracle.optics import refract_slopes
from oracle.surfaces import Array, Surface, angular_frequency

GREEN = 1  # without dispersion, an index given by channel means its green one

UNKNOWN = (("medium", "jerlov"), ("sun", "angular_diameter"), ("receiver", "objects"), ("receiver", "mesh"))
"""Keys of a scene that would change the light, and that the reference leaves to others."""


@dataclass(frozen=True)
class Setting:
    """A water surface at one instant over a floor, the light, and the map that looks down on them."""

    water: Surface
    floor: Surface
    direction: Array  # [3], unit, the way light travels
    irradiance: Array  # [channels]
    ior: float
    absorption: Array  # [channels], [1/m]
    fresnel: bool
    self_shadow: Literal["auto"] | bool
    origin: tuple[float, float]
    size: tuple[float, float]
    resolution: tuple[int, int]  # columns, rows

    @property
    def channels(self) -> int:
        """1 without colour, else 3."""
        return int(self.irradiance.size)

    @property
    def pixel(self) -> tuple[float, float]:
        """Width and height of a pixel [m]."""
        return self.size[0] / self.resolution[0], self.size[1] / self.resolution[1]

    @property
    def can_shade(self) -> bool:
        """Whether the slope bound passes the sun's elevation, so that crests may shade troughs."""
        ix, iy, iz = self.direction
        return bool(self.water.slope_bound * np.hypot(ix, iy) >= -iz)

    @property
    def shadows(self) -> bool:
        """Whether shaded water is kept dark."""
        return self.can_shade if self.self_shadow == "auto" else bool(self.self_shadow)

    @property
    def rest_deflection(self) -> tuple[float, float]:
        """Horizontal travel per depth of the light that a flat surface refracts."""
        zero = np.zeros(1)
        rx, ry, rz, _ = refract_slopes(self.direction, zero, zero, self.ior)
        return float(rx[0] / -rz[0]), float(ry[0] / -rz[0])

    @property
    def rest_depth(self) -> float:
        """Depth of the mean planes under the middle of the map [m]."""
        x, y = (o + 0.5 * s for o, s in zip(self.origin, self.size, strict=True))
        return float(self.water.plane(x, y) - self.floor.plane(x, y))


def read_setting(scene: Mapping[str, Any], time: float = 0.0) -> Setting:
    """Read a scene dictionary, of waves over a plane or a closed terrain, at a time in seconds."""
    medium, sun, view = scene["medium"], scene["sun"], scene["map"]
    for table, key in UNKNOWN:
        if scene[table].get(key):
            raise ValueError(f"the reference does not know {table}.{key}")
    direction = np.asarray(sun["direction"], dtype=np.float64)
    irradiance = np.atleast_1d(np.asarray(sun.get("irradiance", 1.0), dtype=np.float64))
    absorption = np.atleast_1d(np.asarray(medium.get("absorption", 0.0), dtype=np.float64))
    ior = medium["ior"]
    channels = max(irradiance.size, absorption.size)
    floor = _read_floor(scene["receiver"])
    level = float(scene["water"]["level"])
    return Setting(
        water=_read_water(scene["water"], level - floor.base, time),
        floor=floor,
        direction=direction / np.linalg.norm(direction),
        irradiance=np.broadcast_to(irradiance, channels).copy(),
        ior=float(ior[GREEN] if isinstance(ior, Sequence) else ior),
        absorption=np.broadcast_to(absorption, channels).copy(),
        fresnel=bool(medium.get("fresnel", False)),
        self_shadow=scene["water"].get("self_shadow", "auto"),
        origin=(float(view["origin"][0]), float(view["origin"][1])),
        size=(float(view["size"][0]), float(view["size"][1])),
        resolution=(int(view["resolution"][0]), int(view["resolution"][1])),
    )


def _read_floor(receiver: Mapping[str, Any]) -> Surface:
    if "plane" in receiver:
        return _surface(float(receiver["plane"]), (0.0, 0.0), [])
    terrain = receiver["terrain"]
    slope = terrain.get("slope", (0.0, 0.0))
    return _surface(float(terrain["base"]), (float(slope[0]), float(slope[1])), terrain.get("waves", []))


def _read_water(water: Mapping[str, Any], depth: float, time: float) -> Surface:
    """Hold the waves still at a time. Where a wave brings no frequency, it has that of gravity waves at rest depth."""
    surface = _surface(float(water["level"]), (0.0, 0.0), water["waves"])
    if time == 0.0:
        return surface
    given = [wave.get("angular_frequency") for wave in water["waves"]]
    natural = angular_frequency(surface.wavenumber, depth)
    omega = np.array([n if g is None else g for g, n in zip(given, natural, strict=True)])
    return Surface(surface.base, surface.slope, surface.amplitude, surface.wavevector, surface.phase - omega * time)


def _surface(base: float, slope: tuple[float, float], waves: Sequence[Mapping[str, Any]]) -> Surface:
    return Surface(
        base,
        slope,
        np.array([w["amplitude"] for w in waves], dtype=np.float64),
        np.array([w["wavevector"] for w in waves], dtype=np.float64).reshape(-1, 2),
        np.array([w.get("phase", 0.0) for w in waves], dtype=np.float64),
    )
