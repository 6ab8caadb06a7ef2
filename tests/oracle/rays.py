"""What becomes of the light that meets the water at given points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from oracle.meet import Flags, crosses, meet_floor
from oracle.optics import path_transmittance, refract_slopes, transmittance
from oracle.setting import Setting
from oracle.surfaces import Array

DARK, SHADED, DRY, LEFT, MISSED, LANDS = range(6)
"""Fates: faces away; in shadow; no water here; leaves through the surface; never lands; reaches the floor."""


@dataclass(frozen=True)
class Rays:
    """The fate of light at points of the water, arrays of one shape; fluxes per horizontal area, [channels, ...]."""

    fate: npt.NDArray[np.int8]
    x: Array  # landing, in pixels of the map
    y: Array
    emitted: Array  # taken in by the water
    reflected: Array
    absorbed: Array
    carried: Array  # what reaches the floor, or the surface again
    over_lit: Array  # the part of ``emitted`` that shadows would take away

    def pick(self, index: Any) -> Rays:
        """Index the last axes of every array by a tuple of as many."""
        deep = (slice(None), *index)
        flat = (self.fate[index], self.x[index], self.y[index])
        return Rays(*flat, *(getattr(self, name)[deep] for name in FLUXES))


FLUXES = ("emitted", "reflected", "absorbed", "carried", "over_lit")


def trace_lattice(setting: Setting, u: Array, v: Array) -> Rays:
    """Trace the light that meets the water on the lattice v × u: arrays [len(v), len(u)]."""
    x, y = np.broadcast_arrays(u[None, :], v[:, None])
    return _trace(setting, x, y, *setting.water.lattice(u, v))


def trace_points(setting: Setting, x: Array, y: Array) -> Rays:
    """Trace the light that meets the water at scattered points of any shape."""
    return _trace(setting, x, y, *setting.water.height_and_slopes(x, y))


def _trace(setting: Setting, x: Array, y: Array, z: Array, zx: Array, zy: Array) -> Rays:
    shape = x.shape
    x, y, z, zx, zy = (np.ravel(a) for a in (x, y, z, zx, zy))
    ix, iy, iz = setting.direction
    rx, ry, rz, cosine = refract_slopes(setting.direction, zx, zy, setting.ior)
    facing = zx * ix + zy * iy - iz
    taken = np.maximum(facing, 0.0)
    fate = np.full(x.shape, LANDS, dtype=np.int8)
    fate[facing <= 0.0] = DARK
    start, ray = np.stack([x, y, z]), np.stack([rx, ry, rz])
    shaded = _shaded(setting, start, facing > 0.0)
    if setting.shadows:
        fate[shaded] = SHADED
    dry = z < setting.floor.height(x, y)
    fate[dry] = DRY
    # the light is followed wherever there is water, lit or not: dark corners belong to cells that are partly lit
    length = np.zeros(x.shape)
    wet = np.flatnonzero(~dry)
    length[wet], hit = meet_floor(setting.floor, start[:, wet], ray[:, wet])
    missed = np.zeros(x.shape, dtype=np.bool_)
    missed[wet] = ~hit
    lost = _leaves(setting, start, ray, np.where(missed, np.inf, length), fate == LANDS)
    fate[missed & (fate == LANDS)] = MISSED
    fate[lost] = LEFT
    return _account(setting, fate, x + length * rx, y + length * ry, length, taken, cosine, shaded, shape)


def _account(
    setting: Setting,
    fate: npt.NDArray[np.int8],
    x: Array,
    y: Array,
    length: Array,
    taken: Array,
    cosine: Array,
    shaded: Flags,
    shape: tuple[int, ...],
) -> Rays:
    """Share out the flux that each point takes in."""
    lit = fate >= LEFT
    emitted = np.multiply.outer(setting.irradiance, np.where(lit, taken, 0.0))
    enters = transmittance(cosine, setting.ior) if setting.fresnel else np.ones(x.shape)
    # the path of light that leaves again is not measured: it counts as unabsorbed
    passes = path_transmittance(setting.absorption, np.where(fate == LANDS, length, 0.0))
    carried = emitted * enters * passes
    pixel = setting.pixel
    full = (setting.channels, *shape)
    return Rays(
        fate.reshape(shape),
        ((x - setting.origin[0]) / pixel[0]).reshape(shape),
        ((y - setting.origin[1]) / pixel[1]).reshape(shape),
        emitted.reshape(full),
        (emitted * (1.0 - enters)).reshape(full),
        (emitted * enters - carried).reshape(full),
        carried.reshape(full),
        (emitted * shaded).reshape(full),
    )


def _shaded(setting: Setting, start: Array, candidates: Flags) -> Flags:
    """Tell which points lie in the shadow of a crest: the way back to the sun meets the water."""
    shaded = np.zeros(candidates.shape, dtype=np.bool_)
    i = np.flatnonzero(candidates) if setting.can_shade else np.zeros(0, dtype=np.int64)
    back = np.repeat(-setting.direction[:, None], i.size, axis=1)
    shaded[i] = crosses(setting.water, start[:, i], back, np.full(i.size, np.inf), 1.0)
    return shaded


def _leaves(setting: Setting, start: Array, ray: Array, end: Array, candidates: Flags) -> Flags:
    """Tell which refracted light meets the surface from below before it lands; only rays flatter than it can."""
    left = np.zeros(candidates.shape, dtype=np.bool_)
    i = np.flatnonzero(candidates & (setting.water.slope_bound * np.hypot(ray[0], ray[1]) >= -ray[2]))
    left[i] = crosses(setting.water, start[:, i], ray[:, i], end[i], -1.0)
    return left
