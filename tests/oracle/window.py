"""The part of the water whose light can reach the map."""

from __future__ import annotations

import numpy as np

from oracle.optics import refract_slopes
from oracle.setting import Setting
from oracle.surfaces import Array

SLOPE_RINGS = 40  # samples of the disk of possible slopes, along its radius
SLOPE_TURNS = 96  # and around
MARGIN = 1.02  # what lies between the samples


def deflection_range(setting: Setting) -> Array:
    """Bound the horizontal travel per depth of refracted light: [[least x, greatest x], [least y, greatest y]]."""
    radius = setting.water.slope_bound * np.linspace(0.0, 1.0, SLOPE_RINGS + 1)[:, None]
    turn = np.linspace(0.0, 2.0 * np.pi, SLOPE_TURNS, endpoint=False)
    rx, ry, rz, cosine = refract_slopes(setting.direction, radius * np.cos(turn), radius * np.sin(turn), setting.ior)
    lit = cosine > 0.0
    x, y = (rx / -rz)[lit], (ry / -rz)[lit]
    rest = np.array(setting.rest_deflection)[:, None]
    bounds = np.array([[x.min(), x.max()], [y.min(), y.max()]])
    return np.asarray(rest + MARGIN * (bounds - rest))


def emitting_window(setting: Setting) -> Array:
    """Bound the water that can light the map: [[least x, greatest x], [least y, greatest y]] in metres.

    Light lands in the map at a depth under its point of entry that the water's swing and the floor of the map bound.
    """
    area = np.stack([setting.origin, np.add(setting.origin, setting.size)], axis=1)
    travel = np.multiply.outer(deflection_range(setting), depth_range(setting))
    return np.stack([area[:, 0] - travel.max(axis=(1, 2)), area[:, 1] - travel.min(axis=(1, 2))], axis=1)


def depth_range(setting: Setting) -> Array:
    """Bound the depth of water over the map, from the mean planes and the swings. Never under zero."""
    area = np.stack([setting.origin, np.add(setting.origin, setting.size)], axis=1)
    x, y = np.meshgrid(area[0], area[1])
    between = setting.water.plane(x, y) - setting.floor.plane(x, y)
    swing = setting.water.swing + setting.floor.swing
    return np.maximum(0.0, [float(between.min()) - swing, float(between.max()) + swing])
