"""Named scenes on which accuracy is measured, with lengths in pixels, so that one sample a pixel means something."""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

GOLDEN_TURN = 2.399963229728653  # [rad] turns by it never line up: directions and phases spread without a seed
PHASE_TURN = 1.7  # [rad] any number that shares no period with the turn

Kind = Literal["ordinary", "deep", "hard"]

OVERSAMPLE = {"ordinary": 16, "deep": 12, "hard": 12}
"""Cells along a pixel's side that a reference takes to be an order better than what is measured against it."""


@dataclass(frozen=True)
class Case:
    """A scene, and how its reference is made.

    Attributes
    ----------
    name, about : str
        What it is called and what it is there for.
    kind : str
        "ordinary" and "deep" carry the accuracy promised for them; "hard" has edges of shadow, shores and silhouettes,
        which a lattice of corners must find.
    oversample : int
        Cells along a pixel's side that the reference needs.
    """

    name: str
    about: str
    kind: Kind
    oversample: int
    water: dict[str, Any]
    receiver: dict[str, Any]
    direction: tuple[float, float, float]
    pixel: float
    resolution: tuple[int, int] = (64, 64)
    origin: tuple[float, float] = (0.0, 0.0)
    irradiance: float | tuple[float, float, float] = 1.0
    medium: dict[str, Any] = field(default_factory=lambda: {"ior": 1.333})
    time: float = 0.0

    def scene_dict(self) -> dict[str, Any]:
        """Give the scene as its TOML file would, for ``warp_caustics.Scene(**case.scene_dict())``."""
        return {
            "water": deepcopy(self.water),
            "receiver": deepcopy(self.receiver),
            "sun": {"direction": self.direction, "irradiance": self.irradiance},
            "medium": deepcopy(self.medium),
            "map": {
                "origin": self.origin,
                "size": tuple(self.pixel * n for n in self.resolution),
                "resolution": self.resolution,
            },
        }


def waves(
    pixel: float, longest: float, shortest: float, count: int, rms_slope: float, turn: float = 0.0
) -> list[dict[str, Any]]:
    """Make sines of equal slope, from the longest to the shortest wave length in pixels, in spread directions."""
    slope = rms_slope * np.sqrt(2.0 / count)
    made = []
    for i, length in enumerate(np.geomspace(longest, shortest, count)):
        k = 2.0 * np.pi / (length * pixel)
        heading = turn + GOLDEN_TURN * i
        made.append(
            {
                "amplitude": float(slope / k),
                "wavevector": (float(k * np.cos(heading)), float(k * np.sin(heading))),
                "phase": float(PHASE_TURN * i),
            }
        )
    return made


def sunlight(zenith_angle: float, azimuth: float = 25.0) -> tuple[float, float, float]:
    """Give the direction of light from a sun at angles in degrees from the zenith; it travels towards the azimuth."""
    a, z = np.radians(azimuth), np.radians(zenith_angle)
    return float(np.sin(z) * np.cos(a)), float(np.sin(z) * np.sin(a)), float(-np.cos(z))


def _case(
    name: str,
    about: str,
    kind: Kind = "ordinary",
    *,
    pixel: float = 1.0 / 64.0,
    depth: float = 64.0,
    longest: float = 60.0,
    shortest: float = 12.0,
    count: int = 6,
    rms_slope: float = 0.05,
    turn: float = 0.0,
    sun: float = 20.0,
    receiver: dict[str, Any] | None = None,
    **rest: Any,
) -> Case:
    """Make a case whose floor is at z = 0 and whose water is ``depth`` pixels deep."""
    water = {"level": depth * pixel, "waves": waves(pixel, longest, shortest, count, rms_slope, turn)}
    floor = {"plane": 0.0} if receiver is None else receiver
    return Case(name, about, kind, OVERSAMPLE[kind], water, floor, sunlight(sun), pixel, **rest)


def _terrain_waves(pixel: float, lengths: Sequence[float], slope: float) -> list[dict[str, Any]]:
    """Make bumps of a terrain: one sine of a slope for each wave length in pixels."""
    made = []
    for i, length in enumerate(lengths):
        k = 2.0 * np.pi / (length * pixel)
        heading = 1.0 + GOLDEN_TURN * i
        made.append(
            {
                "amplitude": float(slope / k),
                "wavevector": (float(k * np.cos(heading)), float(k * np.sin(heading))),
                "phase": float(PHASE_TURN * (i + 1)),
            }
        )
    return made


PIXEL = 1.0 / 64.0

_LIST = [
    _case("calm_pool", "gentle waves above their focus", rms_slope=0.025, depth=64.0, shortest=15.0),
    _case("choppy_45", "waves past their focus, sun at 45°", rms_slope=0.10, shortest=18.0, sun=45.0),
    _case("zenith", "sun at the zenith, waves at a later time", rms_slope=0.06, sun=0.0, time=0.7),
    _case("sun_60", "sun 60° from the zenith", rms_slope=0.06, shortest=16.0, sun=60.0),
    _case(
        "sun_80_calm",
        "sun 80° from the zenith over water too calm to shade itself",
        rms_slope=0.03,
        shortest=16.0,
        sun=80.0,
    ),
    _case("steep", "slopes to 0.8", rms_slope=0.33, count=3, longest=60.0, shortest=30.0, depth=24.0, sun=30.0),
    _case(
        "slope_terrain",
        "a sloping floor",
        rms_slope=0.06,
        sun=35.0,
        receiver={"terrain": {"base": -0.1, "slope": (0.2, -0.15)}},
    ),
    _case(
        "bumpy_terrain",
        "a floor of bumps, by colour, with Fresnel's equations and absorption",
        rms_slope=0.06,
        sun=40.0,
        receiver={"terrain": {"base": 0.0, "slope": (0.05, 0.1), "waves": _terrain_waves(PIXEL, (40.0, 23.0), 0.2)}},
        irradiance=(1.0, 0.9, 0.7),
        medium={"ior": 1.34, "absorption": (0.35, 0.07, 0.02), "fresnel": True},
    ),
    _case("millimetre", "a map 6.4 mm wide", pixel=1e-4, rms_slope=0.07),
    _case("kilometre", "a map 2.56 km wide far from the origin", pixel=40.0, rms_slope=0.05, origin=(1e5, -3e5)),
    _case("ior_1_3", "the least index of a liquid", rms_slope=0.07, medium={"ior": 1.3}),
    _case("ior_1_5", "the index of glass", rms_slope=0.07, medium={"ior": 1.5}),
    _case(
        "deep", "tens of crossing sheets", "deep", rms_slope=0.15, depth=256.0, count=10, shortest=15.0, longest=60.0
    ),
    _case(
        "deep_45",
        "tens of crossing sheets, sun at 45°",
        "deep",
        rms_slope=0.12,
        depth=256.0,
        count=8,
        shortest=16.0,
        sun=45.0,
    ),
    _case(
        "shaded",
        "crests shade troughs: sun 80° from the zenith, slopes above tan 10°",
        "hard",
        rms_slope=0.2,
        count=3,
        longest=50.0,
        shortest=25.0,
        depth=32.0,
        sun=80.0,
    ),
    _case(
        "leaving",
        "refracted light that meets the surface again: slope 1.6, sun 70° from the zenith",
        "hard",
        rms_slope=1.13,
        count=1,
        longest=48.0,
        turn=0.6,
        depth=24.0,
        sun=70.0,
    ),
    _case(
        "shore",
        "a beach that comes out of the water",
        "hard",
        rms_slope=0.05,
        depth=10.0,
        sun=40.0,
        receiver={"terrain": {"base": -0.1, "slope": (0.5, 0.15)}},
    ),
    _case(
        "hills",
        "hills steep enough to hide what lies behind them",
        "hard",
        rms_slope=0.05,
        depth=64.0,
        sun=60.0,
        receiver={"terrain": {"base": 0.0, "waves": _terrain_waves(PIXEL, (40.0,), 2.5)}},
    ),
]
CASES: dict[str, Case] = {case.name: case for case in _LIST}
