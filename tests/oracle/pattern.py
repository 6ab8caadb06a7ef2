"""The projected pattern of the Unity article in NumPy and float64, point by point, with none of the library's code.

Refraction and Fresnel's losses are by the angles of Snell's law, rotations by trigonometry.
"""

from __future__ import annotations

from typing import Any

import numpy as np

BT709 = np.array([0.2126, 0.7152, 0.0722])


def sample(texture: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Repeat a texture, bilinear between texel centres."""
    rows, columns = texture.shape
    x, y = u * columns - 0.5, v * rows - 0.5
    i, j = np.floor(x).astype(int), np.floor(y).astype(int)
    p, q = x - i, y - j
    total = np.zeros_like(u)
    for down, across, weight in ((0, 0, (1 - p) * (1 - q)), (0, 1, p * (1 - q)), (1, 0, (1 - p) * q), (1, 1, p * q)):
        total += weight * texture[np.mod(j + down, rows), np.mod(i + across, columns)]
    return total


def least_mean(texture: np.ndarray) -> float:
    """Average the lesser of all pairs of texels."""
    values = texture.ravel()
    return float(np.minimum(values[:, None], values[None, :]).mean())


def light_uv(points: np.ndarray, sun: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates to the right and upwards of a view along the light."""
    right = np.cross(sun, (0.0, 1.0, 0.0))
    right /= np.linalg.norm(right)
    return points @ right, points @ np.cross(right, sun)


def caustics(points: np.ndarray, time: float, sun: np.ndarray, given: dict[str, Any]) -> np.ndarray:
    """``min(tex1, tex2) * strength`` by colour, [..., 3]."""
    u, v = light_uv(points, sun)
    texture = given["texture"] / least_mean(given["texture"])
    s, layers = given["split"], []
    for speed, tiling in ((0.75 * given["speed"], 1.0 / given["scale"]), (given["speed"], -1.0 / given["scale"])):
        x, y = time * speed + u * tiling, v * tiling
        layers.append(np.stack([sample(texture, x + a, y + b) for a, b in ((s, s), (s, -s), (-s, -s))], axis=-1))
    return given["strength"] * np.minimum(*layers)


def object_space(points: np.ndarray, centre: Any, size: Any, rotation: float) -> np.ndarray:
    """World to the space of a box that is turned about z [degrees]."""
    a = np.radians(rotation)
    x, y, z = np.moveaxis(points - np.array(centre), -1, 0)
    turned = np.stack([np.cos(a) * x + np.sin(a) * y, np.cos(a) * y - np.sin(a) * x, z], axis=-1)
    return turned / np.array(size)


def calm_light(points: np.ndarray, normals: np.ndarray, sun: np.ndarray, given: dict[str, Any]) -> np.ndarray:
    """Sunlight on surfaces under water at rest, by colour and for unit irradiance, without shadow."""
    incident = np.arccos(-sun[2])
    inside = np.arcsin(np.sin(incident) / given["ior"])
    along = sun[:2] / np.hypot(*sun[:2])
    below = np.array([*(along * np.sin(inside)), -np.cos(inside)])
    through = 1.0
    if given["fresnel"]:
        away, sum_ = incident - inside, incident + inside
        through = 1.0 - 0.5 * ((np.sin(away) / np.sin(sum_)) ** 2 + (np.tan(away) / np.tan(sum_)) ** 2)
    depth = given["level"] - points[..., 2]
    beam = np.cos(incident) * through / np.cos(inside) * np.maximum(0.0, -normals @ below)
    wet = beam[..., None] * np.exp(-np.array(given["absorption"]) * depth[..., None] / np.cos(inside))
    dry = np.maximum(0.0, -normals @ sun)[..., None]
    return np.where(depth[..., None] < 0.0, dry, wet)


def seen(
    points: np.ndarray, normals: np.ndarray, lit: np.ndarray | float, time: float, given: dict[str, Any]
) -> np.ndarray:
    """What each point shows [..., 3]; normals are those of the sides that are seen."""
    sun = np.array(given["sun"]) / np.linalg.norm(given["sun"])
    position = object_space(points, given["centre"], given["size"], given["rotation"])
    mask = np.all((position <= 0.5) & (position > -0.5), axis=-1).astype(float)
    far = (np.linalg.norm(position, axis=-1) - given["fade_radius"]) / (1.0 - given["fade_strength"])
    mask *= 1.0 - np.clip(far, 0.0, 1.0)
    light, irradiance = calm_light(points, normals, sun, given), np.array(given["irradiance"])
    luminance = lit * ((light * irradiance) @ BT709) / (irradiance @ BT709)
    k = given["luminance_strength"]
    if given["luminance_mask"] == "lerp":
        mask *= 1.0 + k * (luminance - 1.0)
    elif given["luminance_mask"] == "smoothstep":
        t = np.clip((luminance - k) / 0.1, 0.0, 1.0)
        mask *= t * t * (3.0 - 2.0 * t)
    elif given["luminance_mask"] == "shadow":
        mask *= lit
    outside = 0.0 if given["blend"] == "overlay" else (1.0 - mask) * lit
    share = np.broadcast_to(np.asarray(outside)[..., None], light.shape)
    return irradiance * light * (share + mask[..., None] * caustics(points, time, sun, given))
