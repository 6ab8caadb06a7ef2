"""Mitsuba's particle tracer at work on a scene, and how far its map is from another one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from time import perf_counter
from typing import Any

import numpy as np

from oracle.setting import Setting, read_setting
from oracle.surfaces import Array
from peer.surroundings import SENSOR_HEIGHT, make_emitter, make_floor, make_sensor
from peer.water import Water, lit_water

VARIANT = "scalar_rgb"
"""Needs no LLVM; the ``llvm`` variants end the whole process where LLVM is older than 19."""

LAST_DEPTH = 3
"""Water, floor, sensor."""


@dataclass(frozen=True)
class PeerMap:
    """What independent batches of particles gave.

    Attributes
    ----------
    batches : ndarray
        Their maps ``[batch, rows, columns]``, float64, each laid out as a caustic map.
    samples : int
        Particles that each of them emitted by pixel.
    seconds : ndarray
        Time that tracing each of them took; building the scene apart.
    """

    batches: Array
    samples: int
    seconds: Array

    @cached_property
    def irradiance(self) -> Array:
        """Mean of the batches ``[rows, columns]``."""
        return np.asarray(self.batches.mean(axis=0))

    @cached_property
    def variance_ratio(self) -> float:
        """Variance of the mean over its value: one number for all pixels, and pooled over all of them."""
        variance = self.batches.var(axis=0, ddof=1) / len(self.batches)
        return float(variance.sum() / self.irradiance.sum())

    @property
    def standard_error(self) -> Array:
        """Of each pixel's mean ``[rows, columns]``."""
        return np.asarray(np.sqrt(self.variance_ratio * self.irradiance))

    def floor(self, reference: Array) -> float:
        """Give the relative L2 difference from a reference that more particles would not mend.

        The noise of the even batches is independent of that of the odd ones, so the mean product of their differences
        from the reference holds none of it. A floor below the noise of this estimate may come out as 0.
        """
        one, other = (self.batches[first::2].mean(axis=0) - reference for first in (0, 1))
        return float(np.sqrt(max(np.mean(one * other), 0.0)) / reference.mean())


@dataclass
class Peer:
    """A scene of waves over a plane, built for Mitsuba.

    Parameters
    ----------
    table : mapping
        The scene, as the dictionary of its file.
    time : float
        [s].
    variant : str
        Of Mitsuba.

    Attributes
    ----------
    setting : Setting
        The scene's numbers.
    landing_error : float
        Largest distance by which light lands beside its place, for the rays' offset and for the mesh [m].
    build_seconds : float
        Time that the mesh and its search tree took.

    Raises
    ------
    ValueError
        If the scene has what the two cannot share.
    """

    table: Mapping[str, Any]
    time: float = 0.0
    variant: str = VARIANT
    setting: Setting = field(init=False)
    landing_error: float = field(init=False)
    build_seconds: float = field(init=False)

    def __post_init__(self) -> None:
        import mitsuba as mi

        mi.set_variant(self.variant)
        mi.logger().clear_appenders()  # its progress bars
        start = perf_counter()
        self.setting = read_setting(self.table, self.time)
        _check(self.setting)
        low, high = lit_water(self.setting)
        water = Water(self.setting, low, high)
        self.landing_error = water.landing_error
        self._scene = mi.load_dict(
            {
                "type": "scene",
                "water": water.shape(mi),
                "sun": make_emitter(mi, self.setting, low, high),
                "floor": make_floor(mi, self.setting),
                "sensor": make_sensor(mi, self.setting),
                "integrator": {"type": "ptracer", "max_depth": LAST_DEPTH, "hide_emitters": True},
            }
        )
        self.build_seconds = perf_counter() - start

    def trace(self, samples: int, batches: int, seed: int = 0) -> PeerMap:
        """Trace batches (at least two), each of so many particles a pixel, and with a seed of its own.

        Keep a batch small: a film of float32 that adds up n equal weights loses up to n 2^-24 of its sum.
        """
        import mitsuba as mi

        maps, seconds = [], []
        for index in range(seed, seed + batches):
            start = perf_counter()
            picture = np.array(mi.render(self._scene, spp=samples, seed=index), dtype=np.float64)
            seconds.append(perf_counter() - start)
            maps.append(np.pi * picture[::-1, :, 0])  # a picture's first row is its highest
        return PeerMap(np.stack(maps), samples, np.array(seconds))


def z_scores(peer: Peer, found: PeerMap, judged: Array, error_bar: float) -> Array:
    """Give each pixel's difference over its expected error, ``[rows, columns]``.

    The expected error adds in quadrature: the particles' noise, for the judged map's own brightness; what a landing
    beside its place changes, which is the map's gradient times :attr:`Peer.landing_error`; and the judged map's error
    bar (relative L2), taken as the same in every pixel.
    """
    pixel = peer.setting.pixel
    across, along = np.gradient(judged, pixel[1], pixel[0])
    shifted = peer.landing_error * np.hypot(across, along)
    variance = found.variance_ratio * judged + shifted**2 + (error_bar * judged.mean()) ** 2
    return np.asarray((found.irradiance - judged) / np.sqrt(variance))


def _check(setting: Setting) -> None:
    swing, depth = setting.water.swing, setting.rest_depth
    refusals = {
        "colour": setting.channels > 1,
        "absorption": bool(setting.absorption.any()),
        "water that reflects nothing (medium.fresnel = false)": not setting.fresnel,
        "a floor that is no level plane": bool(setting.floor.swing) or setting.floor.slope != (0.0, 0.0),
        "pixels that are not square": not np.isclose(*setting.pixel),
        "waves that reach down to the sensor": swing >= (1.0 - SENSOR_HEIGHT) * depth,
    }
    for what, present in refusals.items():
        if present:
            raise ValueError(f"the peer does not take {what}")
