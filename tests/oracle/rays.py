"""What becomes of the light that meets the water at given points."""

from __future__ import annotations

from dataclasses import dataclass

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

    def pick(self, index: tuple[object, ...]) -> Rays:
        """Index the last axes of every array."""
        flat = (self.fate[index], self.x[index], self.y[index])
        return Rays(*flat, *(getattr(self, name)[(..., *index)] for name in FLUXES))


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
    shaded = (facing > 0.0) & _shaded(setting, x, y, z, facing > 0.0)
    if setting.shadows:
        fate[shaded] = SHADED
    dry = z < setting.floor.height(x, y)
    fate[dry] = DRY
    # the light is followed wherever there is water, lit or not: dark corners belong to cells that are partly lit
    length = np.zeros(x.shape)
    wet = np.flatnonzero(~dry)
    length[wet], hit = meet_floor(setting.floor, *(a[wet] for a in (x, y, z, rx, ry, rz)))
    missed = np.zeros(x.shape, dtype=np.bool_)
    missed[wet] = ~hit
    lost = _leaves(setting, x, y, z, rx, ry, rz, np.where(missed, np.inf, length), fate == LANDS)
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


def _shaded(setting: Setting, x: Array, y: Array, z: Array, candidates: Flags) -> Flags:
    """Tell which points lie in the shadow of a crest: the way back to the sun meets the water."""
    shaded = np.zeros(x.shape, dtype=np.bool_)
    if not setting.can_shade:
        return shaded
    i = np.flatnonzero(candidates)
    back = (np.full(i.shape, -c) for c in setting.direction)
    shaded[i] = crosses(setting.water, x[i], y[i], z[i], *back, np.full(i.shape, np.inf), 1.0)
    return shaded


def _leaves(
    setting: Setting, x: Array, y: Array, z: Array, rx: Array, ry: Array, rz: Array, end: Array, candidates: Flags
) -> Flags:
    """Tell which refracted light meets the surface from below before it lands; only rays flatter than it can."""
    left = np.zeros(x.shape, dtype=np.bool_)
    i = np.flatnonzero(candidates & (setting.water.slope_bound * np.hypot(rx, ry) >= -rz))
    if i.size:
        left[i] = crosses(setting.water, *(a[i] for a in (x, y, z, rx, ry, rz)), end[i], -1.0)
    return left
