"""Convex sets by the planes that bound them: an eye's frustum, an upright box, and the corners of what both hold."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np

from .views import Float64Array, Projection

INSIDE = 1e-9
"""Share of a polytope's size by which its corners may lie outside its own planes: a few roundings of float64."""

DETERMINANT = 1e-12
"""Below it three planes, of unit normals, meet in no point."""


def frustum_planes(eye: Projection, far: float) -> Float64Array:
    """Planes ``[6, 4]`` of an eye's frustum up to a depth: ``n . x + d >= 0`` inside, n of length 1."""
    columns, rows = eye.resolution
    x, y, z = np.concatenate([eye.matrix, eye.offset[:, None]], axis=1)
    end = np.array([0.0, 0.0, 0.0, 1.0])
    planes = np.stack([x, columns * z - x, y, rows * z - y, z - eye.near * end, far * end - z])
    return planes / np.linalg.norm(planes[:, :3], axis=1, keepdims=True)


def box_planes(low: Float64Array, high: Float64Array) -> Float64Array:
    """Planes ``[6, 4]`` of an upright box."""
    axes = np.eye(3)
    return np.concatenate([np.c_[axes, -low], np.c_[-axes, high]])


def polytope_corners(planes: Float64Array) -> Float64Array:
    """Corners ``[n, 3]`` of the convex set inside all planes ``[m, 4]``: where three meet and no other cuts them off.

    A flat set has its corners, too. Twelve planes have 220 triples, fewer than a clipper has lines.
    """
    triples = np.array(list(combinations(range(len(planes)), 3)))
    normals, offsets = planes[triples, :3], planes[triples, 3]
    meet = np.abs((np.cross(normals[:, 0], normals[:, 1]) * normals[:, 2]).sum(axis=1)) > DETERMINANT
    points = np.linalg.solve(normals[meet], -offsets[meet][..., None])[..., 0]
    size = 1.0 + np.abs(points).max(axis=1, initial=0.0)
    inside = (points @ planes[:, :3].T + planes[:, 3] >= -INSIDE * size[:, None]).all(axis=1)
    return np.asarray(points[inside])


def frustum_radius(eye: Projection, far: float) -> float:
    """Radius of the least sphere around an eye's frustum up to a depth [m], whichever way it looks.

    Around a pyramid whose edges lean by the angle a from its axis: ``far tan a`` past 45 degrees, else
    ``far / (2 cos^2 a)``; the piece before the near plane is too small to count.
    """
    columns, rows = eye.resolution
    focal = math.sqrt(abs(np.linalg.det(eye.matrix)))
    tangent = math.hypot(columns, rows) / (2.0 * focal)
    return far * (tangent if tangent >= 1.0 else 0.5 * (1.0 + tangent**2))


def half_extent(points: Float64Array) -> Float64Array:
    """Half the width of points ``[n, 2]``."""
    return np.asarray(0.5 * (points.max(axis=0) - points.min(axis=0)))
