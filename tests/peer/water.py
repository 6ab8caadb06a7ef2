"""The water of a scene as Mitsuba's mesh: which part of it the light must cover, and how exact the mesh is."""

from __future__ import annotations

from typing import Any

import numpy as np

from oracle.optics import refract_slopes
from oracle.setting import Setting
from oracle.surfaces import Array

SCALE = 100.0
"""Scene units by metre: the 1 of the rays' offset is then a per cent of the rest."""

RAY_EPSILON = 1500.0 * 2.0**-24
"""Of the rays' offset: ``math::RayEpsilon`` of float32."""

STEPS_PER_WAVE = 80
"""Steps of the mesh in the shortest wave: its share of the landing error is then below that of the rays' offset."""

FLAT_STEPS = 8
"""Steps of the mesh across flat water, which needs no more than two triangles."""

SEARCH_STEPS = 512
"""Points along a side at which the water that lights the map is looked for."""


def lit_water(setting: Setting) -> tuple[Array, Array]:
    """Give the corners (low, high) of the rectangle at rest level whose light covers the map."""
    depth = setting.water.base + setting.water.swing - setting.floor.base
    flattest = 1.0 / np.sqrt(setting.ior**2 - 1.0)  # tangent of the critical angle, for a surface at rest
    pad = depth * (flattest + setting.water.slope_bound)
    low = np.asarray(setting.origin, dtype=np.float64)
    high = low + setting.size
    x, y = (np.linspace(a - pad, b + pad, SEARCH_STEPS) for a, b in zip(low, high, strict=True))
    z, zx, zy = setting.water.lattice(x, y)
    landing, _ = _landing(setting, x[None, :], y[:, None], z, zx, zy)
    # The light comes down to the surface from the rest level's plane, by way of which the emitter is placed.
    entry = _on_level(setting, x[None, :], y[:, None], z)
    spare = 2.0 * np.array([x[1] - x[0], y[1] - y[0]])  # what the search may have stepped over
    inside = ((landing > low - spare) & (landing < high + spare)).all(axis=-1)
    return entry[inside].min(axis=0) - spare, entry[inside].max(axis=0) + spare


class Water:
    """The mesh of the water, wider than what is lit."""

    def __init__(self, setting: Setting, low: Array, high: Array) -> None:
        pad = 0.05 * (high - low) + 2.0 * setting.water.swing * np.hypot(1.0, 1.0 / setting.direction[2])
        low, high = low - pad, high + pad
        shortest = setting.water.shortest_wave
        step = shortest / STEPS_PER_WAVE if np.isfinite(shortest) else float((high - low).max()) / FLAT_STEPS
        self._setting = setting
        self._x, self._y = (np.linspace(a, b, int(np.ceil((b - a) / step)) + 1) for a, b in zip(low, high, strict=True))
        self._z, self._zx, self._zy = setting.water.lattice(self._x, self._y)

    @property
    def landing_error(self) -> float:
        """Largest landing error: the offset's at any vertex, and the mesh's in the middle of any cell [m]."""
        setting, x, y = self._setting, self._x[None, :], self._y[:, None]
        _, way = _landing(setting, x, y, self._z, self._zx, self._zy)
        places = np.stack(np.broadcast_arrays(x, y, self._z), axis=-1) - middle_of(setting)
        start = (1.0 / SCALE + np.abs(places).max(axis=-1)) * RAY_EPSILON
        up = 1.0 / np.sqrt(1.0 + self._zx**2 + self._zy**2)
        across = up[..., None] * (way - np.stack([self._zx, self._zy], axis=-1))
        by_offset = (start * np.linalg.norm(across, axis=-1)).max()

        x, y = _middles(self._x)[None, :], _middles(self._y)[:, None]
        true, _ = _landing(setting, x, y, *setting.water.lattice(x[0], y[:, 0]))
        flat, _ = _landing(setting, x, y, *(_means(each) for each in (self._z, self._zx, self._zy)))
        return float(by_offset + np.linalg.norm(true - flat, axis=-1).max())

    def shape(self, mi: Any) -> Any:
        """Make Mitsuba's mesh, with the waves' own normals at its vertices."""
        places = np.stack(np.broadcast_arrays(self._x[None, :], self._y[:, None], self._z), axis=-1)
        normals = np.stack([-self._zx, -self._zy, np.ones_like(self._z)], axis=-1)
        normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
        rows, columns = self._z.shape
        index = np.arange(rows * columns).reshape(rows, columns)
        a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
        faces = np.stack([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)])
        bsdf = {"type": "dielectric", "int_ior": self._setting.ior, "ext_ior": 1.0}
        return make_mesh(mi, SCALE * (places - middle_of(self._setting)), faces, normals, bsdf=mi.load_dict(bsdf))


def make_mesh(mi: Any, places: Array, faces: Array, normals: Array | None = None, **parts: Any) -> Any:
    properties = mi.Properties()
    for name, part in parts.items():
        properties[name] = part
    count = (places.size // 3, faces.size // 3)
    mesh = mi.Mesh("mesh", *count, has_vertex_normals=normals is not None, props=properties)
    buffers = mi.traverse(mesh)
    buffers["vertex_positions"] = np.ravel(places).astype(np.float32)
    if normals is not None:
        buffers["vertex_normals"] = np.ravel(normals).astype(np.float32)
    buffers["faces"] = np.ravel(faces).astype(np.uint32)
    buffers.update()
    return mesh


def _landing(setting: Setting, x: Array, y: Array, z: Array, zx: Array, zy: Array) -> tuple[Array, Array]:
    """Where light that enters at points lands ``[..., 2]``, and its horizontal way by unit depth ``[..., 2]``."""
    rx, ry, rz, _ = refract_slopes(setting.direction, zx, zy, setting.ior)
    way = np.stack([rx, ry], axis=-1) / -rz[..., None]
    place = np.stack(np.broadcast_arrays(x, y), axis=-1)
    return place + way * (z - setting.floor.base)[..., None], way


def _on_level(setting: Setting, x: Array, y: Array, z: Array) -> Array:
    """Where unrefracted light that meets points passes the rest level ``[..., 2]``."""
    way = setting.direction[:2] / setting.direction[2]
    return np.asarray(np.stack(np.broadcast_arrays(x, y), axis=-1) - way * (z - setting.water.base)[..., None])


def middle_of(setting: Setting) -> Array:
    """Of the map, at the water's rest level: the origin of Mitsuba's scene."""
    middle = np.asarray(setting.origin) + 0.5 * np.asarray(setting.size)
    return np.array([*middle, setting.water.base])


def _middles(values: Array) -> Array:
    return np.asarray(0.5 * (values[1:] + values[:-1]))


def _means(values: Array) -> Array:
    """Of the four corners of each cell."""
    return np.asarray(0.25 * (values[1:, 1:] + values[1:, :-1] + values[:-1, 1:] + values[:-1, :-1]))
