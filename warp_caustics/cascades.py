"""Cascades: the eye's frustum cut at growing far planes, and the view along the sun that lights each part.

Bäcklund's thesis, 3.2.2, after Microsoft's cascaded shadow maps, "fit to scene": sub-frusta share the near plane of
the eye, and their far planes grow linearly. A light view encloses all water whose light can land in what the
scene's own camera sees of its sub-frustum; the last one holds all of the scene. Its size stays when the eye moves, and
it moves by whole texels of a grid that is fixed in the world: a moving eye does not make it shimmer. What an eye that
has turned sees beside a view is lit by the next. All here is float64, from the map's origin and the water's level.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from .dispersion import CHANNELS, channel_scene
from .errors import InputError
from .eye import eye_view
from .polytope import box_planes, frustum_planes, frustum_radius, half_extent, polytope_corners
from .receiver import receiver_kind
from .sun import refract_slopes
from .views import Float64Array, Projection, light_axes
from .water import extreme_slopes
from .window import Reach, refraction_reach

if TYPE_CHECKING:
    from .facts import Facts
    from .scene import Camera

CELL_TEXELS = 2
"""Texels along a side of a lattice cell. A wave is seen as straight chords of that length: a chord's error is that of
the texels' own, which are no more than points of it, times four, and the triangles are half as many as the texels."""

SNAP_TEXELS = 2
"""Texels by which a view is wider than what it must hold: snapping moves it by half of one, and edges round."""

ROOM = 0.05
"""Share by which a view is wider on each side than what the scene's camera sees of its cascade: an eye that turns a
little keeps it whole; one that turns more is lit by the next cascade where this one has ended."""

FARTHER = 1e-6
"""Share by which the last far plane lies behind the farthest that the eye sees: float32 depths round to 6e-8."""


@dataclass(frozen=True)
class Cascade:
    """What of a cascade stays while the eye moves.

    Attributes
    ----------
    far : float
        Depth at which its sub-frustum ends [m].
    zone : float
        Depth before that over which it gives way to the next [m]; 0 for a hard switch.
    half : float64 [2]
        Half the width of what is to be lit, across the light [m].
    texel : float64 [2]
        Sides of a texel, across the light [m].
    margin : (int, int)
        Texels by which the water's lattice is wider on each side: lifted corners are seen elsewhere.
    ground_margin : (int, int)
        The same of the ground's.
    whole : bool
        Whether it holds all of the scene, and so stands still.
    """

    far: float
    zone: float
    half: Float64Array
    texel: Float64Array
    margin: tuple[int, int]
    ground_margin: tuple[int, int]
    whole: bool

    @property
    def texel_area(self) -> float:
        """Area of a texel across the light [m^2]."""
        return float(self.texel.prod())

    def corners(self, resolution: int, margin: tuple[int, int]) -> tuple[int, int]:
        """Rows and columns of corners of a lattice over the view."""
        columns, rows = (-(-(resolution + 2 * m) // CELL_TEXELS) + 1 for m in margin)
        return rows, columns


class Cascades:
    """The cascades of a scene and its camera.

    Parameters
    ----------
    facts : Facts
        Of a scene with a camera.
    near, far : float or None
        Depths [m] between which the far planes are spaced: those of the nearest and the farthest that the scene's
        camera sees of the scene if not given.

    Attributes
    ----------
    cascades : tuple of Cascade
        From the finest to the widest.
    resolution : int
        Texels along a side.
    near, far : float
        As resolved [m].
    origin : (x, y, z)
        World point that all coordinates are relative to.
    ground_level : float
        Plane on which the ground's lattice lies on the texel grid [m].
    """

    def __init__(
        self,
        facts: Facts,
        count: int,
        resolution: int,
        near: float | None = None,
        far: float | None = None,
        blend: float = 0.0,
        backlund: bool = False,
    ) -> None:
        scene = facts.scene
        camera = scene.camera
        assert camera is not None
        self.resolution = resolution
        self.origin = (*scene.map.origin, scene.water.level)
        self.ground_level = 0.5 * (facts.ground.lowest + min(facts.ground.highest, facts.amplitude))
        self._amplitude = facts.amplitude
        self._axes = light_axes(scene.sun.unit_direction)
        self._low, self._high = scene_box(facts)
        slopes = extreme_slopes(scene, facts.assets)
        reaches = [refraction_reach(sun, slopes, ior) for sun in facts.suns for ior in set(iors(facts))]
        self._pad = self._padding(reaches, backlund, facts.amplitude - facts.ground.lowest)
        nearest, farthest = self._seen_depths(camera)
        self.near = nearest if near is None else near
        if far is not None and far <= nearest:
            raise InputError(
                f"method.cascaded.far: expected more than {nearest:.4g} m, where what the camera sees begins"
            )
        if near is not None and near >= farthest:
            raise InputError(
                f"method.cascaded.near: expected less than {farthest:.4g} m, where what the camera sees ends"
            )
        self.far = max(farthest * (1.0 + FARTHER) if far is None else far, self.near * (1.0 + FARTHER))
        # Nothing lies behind the last cascade, unless a far plane was asked for.
        self._endless = far is None
        fars = self.near + (self.far - self.near) * np.arange(1, count + 1) / count
        zone = blend * (self.far - self.near) / count
        swing = (facts.amplitude, 0.5 * (min(facts.ground.highest, facts.amplitude) - facts.ground.lowest))
        self.cascades = tuple(
            self._cascade(camera, float(end), zone if i < count - 1 else 0.0, swing, last=i == count - 1)
            for i, end in enumerate(fars)
        )

    def projections(self, camera: Camera) -> tuple[Projection, ...]:
        """Light views of all cascades, for an eye."""
        return tuple(self._projection(camera, cascade) for cascade in self.cascades)

    def eye(self, camera: Camera) -> Projection:
        """Projection of the eye."""
        return eye_view(camera).projection(self.origin)

    def lit_region(self, camera: Camera, far: float) -> Float64Array:
        """Corners ``[n, 3]`` of the part of the scene that the eye sees up to a depth; empty where it sees none."""
        planes = np.concatenate([frustum_planes(self.eye(camera), far), box_planes(self._low, self._high)])
        return polytope_corners(planes)

    def need(self, cascade: Cascade) -> Float64Array:
        """How far the water that lights a point may stand from it across the light, lowest and highest [texels]."""
        return np.concatenate([self._pad[0] / cascade.texel, self._pad[1] / cascade.texel])

    def _cascade(self, camera: Camera, far: float, zone: float, swing: tuple[float, float], last: bool) -> Cascade:
        half = half_extent(self._across(self._box_corners()))
        region = self.lit_region(camera, far)
        if last and not self._endless:
            # No wider than a sphere around the frustum, which holds it however it turns.
            half = np.minimum(frustum_radius(self.eye(camera), far), half)
        elif not last and len(region):
            half = np.minimum((1.0 + 2.0 * ROOM) * half_extent(self._across(region)), half)
        texel = (2.0 * half + self._pad[1] - self._pad[0]) / (self.resolution - SNAP_TEXELS)
        lift = np.abs(self._axes[:2, 2]) / texel
        margins = [tuple(int(m) for m in np.ceil(lift * s) + CELL_TEXELS) for s in swing]
        return Cascade(
            far,
            zone,
            half,
            texel,
            (margins[0][0], margins[0][1]),
            (margins[1][0], margins[1][1]),
            last and self._endless,
        )

    def _projection(self, camera: Camera, cascade: Cascade) -> Projection:
        """View whose grid of texels stands still in the world: it is moved by whole texels."""
        region = self._box_corners() if cascade.whole else self.lit_region(camera, cascade.far)
        across = self._across(region if len(region) else self._box_corners())
        middle = 0.5 * (across.min(axis=0) + across.max(axis=0) + self._pad[0] + self._pad[1])
        first = np.round(middle / cascade.texel - 0.5 * self.resolution)
        # Depth is 0 where the view's middle meets the water at rest, so that float32 keeps its digits.
        snapped = (first + 0.5 * self.resolution) * cascade.texel
        depth = -(snapped @ self._axes[:2, 2]) / self._axes[2, 2]
        scale = np.array([*(1.0 / cascade.texel), 1.0])
        return Projection(
            scale[:, None] * self._axes, np.array([*-first, -depth]), False, -math.inf,
            (self.resolution, self.resolution), np.array(self.origin),
        )  # fmt: skip

    def _across(self, points: Float64Array) -> Float64Array:
        """Coordinates ``[n, 2]`` across the light [m]."""
        return points @ self._axes[:2].T

    def _box_corners(self) -> Float64Array:
        return np.array(list(product(*zip(self._low, self._high, strict=True))))

    def _padding(self, reaches: list[Reach], backlund: bool, deepest: float) -> tuple[Float64Array, Float64Array]:
        """How far across the light water can stand from where its light lands, both ways [m].

        Light lands ``depth * way`` beside its water and ``depth`` below it, the way being bounded by the refraction.
        """
        bounds = [(r.low, r.high) for r in reaches]
        if backlund:
            bounds += [(r.backlund_low, r.backlund_high) for r in reaches]
        ways = np.array([(x, y) for low, high in bounds for x in (low[0], high[0]) for y in (low[1], high[1])])
        up = np.concatenate([-ways, np.ones((len(ways), 1))], axis=1)
        offsets = np.concatenate([np.zeros((1, 2)), max(deepest, 0.0) * self._across(up)])
        return offsets.min(axis=0), offsets.max(axis=0)

    def _seen_depths(self, camera: Camera) -> tuple[float, float]:
        """Depths [m] of the nearest and the farthest that an eye sees of the scene; of all of it if it sees none."""
        eye = self.eye(camera)
        corners = self._box_corners()
        depths = corners @ eye.matrix[2] + eye.offset[2]
        region = self.lit_region(camera, max(float(depths.max()), 2.0 * eye.near))
        if len(region):
            depths = region @ eye.matrix[2] + eye.offset[2]
        return max(float(depths.min()), eye.near), max(float(depths.max()), 2.0 * eye.near)


def iors(facts: Facts) -> tuple[float, float, float]:
    """Index of refraction of each channel: green's for all without dispersion.

    Raises
    ------
    InputError
        If the strength of the dispersion takes an index to that of air, or below.
    """
    if facts.scene.medium.dispersion == "none":
        return facts.ior, facts.ior, facts.ior
    red, green, blue = (channel_scene(facts.scene, channel).medium.green_ior for channel in range(len(CHANNELS)))
    return red, green, blue


def backlund_miss(facts: Facts) -> float:
    """How far off a level floor Eq. 3.3 lands at most [m]: along the ray by too much, and so under the floor.

    The way from water to ground along the light, ``depth / cos``, is projected on the refracted ray; on a floor that
    slopes it is off by as much again.
    """
    sun = facts.scene.sun.unit_direction
    rays = refract_slopes(sun, extreme_slopes(facts.scene, facts.assets), facts.ior)
    rays = rays[np.isfinite(rays).all(axis=1)]
    share = np.abs((rays @ sun) * rays[:, 2] / sun[2] - 1.0).max()
    slope = facts.ground.slope if np.isfinite(facts.ground.slope) else 1.0
    return float(share * (1.0 + slope) * max(facts.amplitude - facts.ground.lowest, 0.0))


def scene_box(facts: Facts) -> tuple[Float64Array, Float64Array]:
    """Corners of the box that holds all wet ground which an eye can see: the map's, and that of meshes."""
    scene, assets = facts.scene, facts.assets
    low, high = np.zeros(2), np.asarray(scene.map.size, dtype=np.float64)
    for mesh in (assets.mesh, assets.objects):
        if mesh is not None:
            at = mesh.vertices[:, :2] - np.asarray(scene.map.origin)
            whole = receiver_kind(scene) == "mesh" and mesh is assets.mesh  # it takes the map's place
            low, high = (at.min(axis=0), at.max(axis=0)) if whole else (
                np.minimum(low, at.min(axis=0)), np.maximum(high, at.max(axis=0)))  # fmt: skip
    top = max(min(facts.ground.highest, facts.amplitude), facts.ground.lowest)
    return np.array([*low, facts.ground.lowest]), np.array([*high, top])
