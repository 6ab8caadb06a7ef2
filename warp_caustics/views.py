"""Views of a scene: the sun's, parallel along the light, and an eye's, in perspective; world to pixels in float64.

Pictures are ``[row, column]`` with pixel centres at half-integers and row 0 at the bottom, as maps are: columns run to
the right of a view and rows upwards.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from warp_caustics.errors import InputError

Float64Array = npt.NDArray[np.float64]

# The rasterizer's sub-pixel integers hold no larger picture: kernels.rasterize.MAX_RESOLUTION, repeated here so that a
# view can be checked without loading Warp (a test compares the two).
MAX_RESOLUTION = 16384
# Least sine of the angle between a view and its up direction. Closer, the axes would turn by rounding.
_LEAST_UP_SINE = 1e-6
_UP_Y = np.array([0.0, 1.0, 0.0])
_UP_Z = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Projection:
    """World [m, relative to ``origin``] to homogeneous pixels (X, Y, Z), all in float64.

    ``(X, Y, Z) = matrix @ point + offset``; Z [m] is the depth along the view direction, and the pixel position is
    ``(X, Y) / w`` with ``w = Z`` in perspective and ``w = 1`` in parallel.

    Attributes
    ----------
    matrix : float64 [3, 3]
    offset : float64 [3]
    perspective : bool
    near : float
        Depth [m] before which all is cut off; ``-inf`` in parallel, where the light comes from far away.
    resolution : (int, int)
        Columns and rows.
    origin : float64 [3]
        World point [m] that points are relative to.
    """

    matrix: Float64Array
    offset: Float64Array
    perspective: bool
    near: float
    resolution: tuple[int, int]
    origin: Float64Array

    def project(self, points: npt.ArrayLike) -> tuple[Float64Array, Float64Array]:
        """Pixel positions [..., 2] (column, row) and depths [...] [m] of world points [..., 3] [m].

        In perspective a depth that is not positive lies behind the eye, and its pixel position means nothing.
        """
        homogeneous = (np.asarray(points, dtype=np.float64) - self.origin) @ self.matrix.T + self.offset
        depth = homogeneous[..., 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            position = homogeneous[..., :2] / (depth[..., None] if self.perspective else 1.0)
        return position, depth

    def positions(self, depth: npt.ArrayLike) -> Float64Array:
        """World points [rows, columns, 3] [m] that the pixel centres see at these depths [rows, columns] [m].

        Points are NaN where the depth is not finite. Position from depth as in Bäcklund's thesis, 3.3.1.
        """
        depth = np.asarray(depth, dtype=np.float64)
        columns, rows = self.resolution
        if depth.shape != (rows, columns):
            raise InputError(f"depth has shape {depth.shape}; this view wants (rows, columns) = {(rows, columns)}")
        depth = np.where(np.isfinite(depth), depth, np.nan)
        w = depth if self.perspective else np.ones_like(depth)
        column, row = np.meshgrid(np.arange(columns) + 0.5, np.arange(rows) + 0.5)
        homogeneous = np.stack([column * w, row * w, depth], axis=-1)
        return (homogeneous - self.offset) @ np.linalg.inv(self.matrix).T + self.origin


class View(Protocol):
    """What the rasterizer asks of a view."""

    def projection(self, origin: Sequence[float] | Float64Array = (0.0, 0.0, 0.0)) -> Projection:
        """World to pixels, for points relative to ``origin`` [m]."""


@dataclass(frozen=True)
class LightView:
    """What the sun sees: parallel, along the light, around a box (Bäcklund's thesis, 3.2.1).

    The picture holds the box exactly; depth is 0 where the light first touches it. Geometry before that is kept, with
    negative depth, since it shades the box. Columns run along the world's x and rows along its y under a sun at the
    zenith.

    Parameters
    ----------
    direction : (x, y, z)
        The way the light travels; any length.
    lower, upper : (x, y, z)
        Corners of the box [m].
    resolution : (columns, rows)

    Raises
    ------
    InputError
        A value is not finite, the direction is zero, or the box has no width across the light.
    """

    direction: tuple[float, float, float]
    lower: tuple[float, float, float]
    upper: tuple[float, float, float]
    resolution: tuple[int, int]

    def __post_init__(self) -> None:
        """Check and normalise."""
        for name in ("direction", "lower", "upper"):
            object.__setattr__(self, name, _point(f"LightView.{name}", getattr(self, name)))
        object.__setattr__(self, "resolution", _resolution("LightView.resolution", self.resolution))
        if not math.hypot(*self.direction) > 0.0:
            raise InputError("LightView.direction is zero; it wants the way the light travels")
        if not all(low <= high for low, high in zip(self.lower, self.upper, strict=True)):
            raise InputError(f"LightView.lower {self.lower} is not below LightView.upper {self.upper}")
        low, high = self._bounds(self._axes())
        if not np.all((high - low)[:2] > 0.0):
            raise InputError("LightView's box has no width across the light; give it a size in two directions")

    def projection(self, origin: Sequence[float] | Float64Array = (0.0, 0.0, 0.0)) -> Projection:
        """World to pixels, for points relative to ``origin`` [m]; the origin is subtracted in float64."""
        start = np.array(_point("origin", origin))
        axes = self._axes()
        low, high = self._bounds(axes)
        scale = np.array([*(np.array(self.resolution) / (high - low)[:2]), 1.0])
        # Relative to the box's own corner first: large world coordinates cancel before anything is scaled.
        offset = scale * (axes @ (start - np.array(self.lower)) - low)
        return Projection(scale[:, None] * axes, offset, False, -math.inf, self.resolution, start)

    def _axes(self) -> Float64Array:
        """Right, up and forward, as rows."""
        return light_axes(self.direction)

    def _bounds(self, axes: Float64Array) -> tuple[Float64Array, Float64Array]:
        """Least and greatest coordinate of the box along each axis, relative to its lower corner."""
        reach = axes * (np.array(self.upper) - np.array(self.lower))
        return np.minimum(reach, 0.0).sum(axis=1), np.maximum(reach, 0.0).sum(axis=1)


@dataclass(frozen=True)
class EyeView:
    """What an eye sees: perspective, square pixels, the world's z upwards.

    Parameters
    ----------
    position, target : (x, y, z)
        Where the eye stands, and what is in the middle of its picture [m].
    vertical_fov : float
        Angle between the top and the bottom of the picture [degrees].
    resolution : (columns, rows)
    near : float
        Depth [m] before which all is cut off.

    Raises
    ------
    InputError
        A value is not finite or out of its range, or the target is the position.
    """

    position: tuple[float, float, float]
    target: tuple[float, float, float]
    vertical_fov: float
    resolution: tuple[int, int]
    near: float = 0.01

    def __post_init__(self) -> None:
        """Check and normalise."""
        for name in ("position", "target"):
            object.__setattr__(self, name, _point(f"EyeView.{name}", getattr(self, name)))
        object.__setattr__(self, "resolution", _resolution("EyeView.resolution", self.resolution))
        if not 0.0 < self.vertical_fov < 180.0:
            raise InputError(f"EyeView.vertical_fov is {self.vertical_fov}; it wants degrees between 0 and 180")
        # Above float32's least normal number, since depths are divided by on the device.
        if not float(np.finfo(np.float32).tiny) < self.near < math.inf:
            raise InputError(f"EyeView.near is {self.near}; it wants a positive, finite number of metres")
        if self.position == self.target:
            raise InputError(f"EyeView.target is EyeView.position, {self.position}; it wants another point")

    def projection(self, origin: Sequence[float] | Float64Array = (0.0, 0.0, 0.0)) -> Projection:
        """World to pixels, for points relative to ``origin`` [m]; the origin is subtracted in float64."""
        start = np.array(_point("origin", origin))
        eye = np.array(self.position)
        sight = np.array(self.target) - eye
        axes = _axes(sight / np.linalg.norm(sight), _UP_Z, _UP_Y)
        columns, rows = self.resolution
        focal = 0.5 * rows / math.tan(math.radians(self.vertical_fov) / 2.0)  # [pixels]
        camera = np.array([[focal, 0.0, columns / 2.0], [0.0, focal, rows / 2.0], [0.0, 0.0, 1.0]])
        matrix = camera @ axes
        return Projection(matrix, matrix @ (start - eye), True, float(self.near), self.resolution, start)


def light_axes(direction: Sequence[float] | Float64Array) -> Float64Array:
    """Right, up and forward of a view along the light, as rows: the sun's own frame.

    ``right`` runs along the world's x and ``up`` along its y under a sun at the zenith.
    """
    forward = np.asarray(direction, dtype=np.float64)
    return _axes(forward / math.hypot(*forward), _UP_Y, _UP_Z)


def _axes(forward: Float64Array, up: Float64Array, other_up: Float64Array) -> Float64Array:
    """Right, up and forward, as rows; ``other_up`` serves where ``forward`` runs along ``up``."""
    right = np.cross(forward, up)
    if np.linalg.norm(right) < _LEAST_UP_SINE:
        right = np.cross(forward, other_up)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(right, forward), forward])


def _point(name: str, value: Sequence[float] | Float64Array) -> tuple[float, float, float]:
    """Three finite numbers."""
    try:
        numbers = tuple(float(number) for number in value)
    except (TypeError, ValueError):
        numbers = ()
    if len(numbers) != 3 or not all(map(math.isfinite, numbers)):
        raise InputError(f"{name} is {value!r}; it wants three finite numbers")
    return numbers[0], numbers[1], numbers[2]


def _resolution(name: str, value: Sequence[int]) -> tuple[int, int]:
    """Columns and rows of a picture that the rasterizer can hold."""
    try:
        columns, rows = (int(number) for number in value)
        whole = (columns, rows) == tuple(value)
    except (TypeError, ValueError, OverflowError):
        whole = False
    if not whole or not 1 <= columns <= MAX_RESOLUTION or not 1 <= rows <= MAX_RESOLUTION:
        raise InputError(f"{name} is {value!r}; it wants columns and rows, whole numbers from 1 to {MAX_RESOLUTION}")
    return columns, rows
