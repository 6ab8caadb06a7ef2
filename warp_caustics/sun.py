"""The sun's disk as directions that share its flux, and refraction in float64 for bounds."""

from __future__ import annotations

import numpy as np

MOST_DIRECTIONS = 256
"""Directions of the disk at most; past it their dots are wider apart than half a pixel, and the plan says so."""

DOTS_PER_PIXEL = 2.0
"""Directions per pixel across the blur: half a pixel between dots is below what a pixel shows."""

GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))
"""Turn between neighbours of a sunflower, which spreads any number of points evenly over a disk (Vogel 1979)."""


def disk_count(half_angle: float, zenith: float, ior: float, depth: float, pixel: float) -> int:
    """Directions that the sun's disk needs, from its blur over the pixel's width.

    The half angle in the water is ``alpha cos t / sqrt(n^2 - sin^2 t)`` in the plane of incidence and, at a low sun,
    wider across it, ``alpha / n``; the blur is that times the path, and along the floor once more over the cosine.
    """
    if half_angle == 0.0:
        return 1
    cos_water = np.sqrt(1.0 - (np.sin(zenith) / ior) ** 2)
    across = 2.0 * half_angle / ior * depth / cos_water / pixel
    along = 2.0 * half_angle * np.cos(zenith) / (ior * cos_water) * depth / cos_water**2 / pixel
    dots = (1.0 + DOTS_PER_PIXEL * across) * (1.0 + DOTS_PER_PIXEL * along) * np.pi / 4.0
    return int(np.clip(np.ceil(dots), 2, MOST_DIRECTIONS))


def disk_directions(direction: np.ndarray, half_angle: float, count: int) -> np.ndarray:
    """Unit directions ``[count, 3]``, stratified evenly over the disk around ``direction``."""
    if count == 1:
        return direction[None, :]
    helper = np.array([1.0, 0.0, 0.0]) if abs(direction[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    right = np.cross(direction, helper)
    right /= np.linalg.norm(right)
    up = np.cross(direction, right)
    i = np.arange(count)
    # Equal steps of the cosine are equal solid angles.
    cosine = 1.0 - (1.0 - np.cos(half_angle)) * (i + 0.5) / count
    turn = i * GOLDEN_ANGLE
    across = np.sqrt(1.0 - cosine**2)[:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    # A few seeds lean to one side: their middle is brought to the disk's, their spread kept.
    spread = (across**2).sum()
    across -= across.mean(axis=0)
    across *= np.sqrt(spread / (across**2).sum())
    along = np.sqrt(1.0 - (across**2).sum(axis=1))[:, None]
    return along * direction + across[:, :1] * right + across[:, 1:] * up


def refract_slopes(direction: np.ndarray, slopes: np.ndarray, ior: float) -> np.ndarray:
    """Refracted unit directions ``[n, 3]`` at surfaces of these slopes ``[n, 2]`` (Snell's law in vector form)."""
    normal = np.concatenate([-slopes, np.ones((len(slopes), 1))], axis=1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    eta = 1.0 / ior
    c = -normal @ direction
    k = 1.0 - eta**2 * (1.0 - c**2)
    return eta * direction + (eta * c - np.sqrt(k))[:, None] * normal
