"""A camera that flies towards a patch of the floor, which passes from one cascade into the next on the way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenery import GENTLE, scene

import warp_caustics as wc
from warp_caustics.scene import Camera

SIZE = (40.0, 40.0)  # wider than either cascade, so that the nearer one is finer
PATCH, WIDTH = (20.0, 25.0), 1.2  # middle of the patch, and the half width of the window that it is weighed by [m]
START, WAY, HEIGHT = 17.0, 4.0, 2.5  # [m] along y; the patch is 8 m away at first
NEAR, FAR = 1.0, 11.0  # with two cascades the border lies at 6 m


@dataclass(frozen=True)
class Flight:
    """How a flight is rendered."""

    blend: float
    frames: int
    resolution: tuple[int, int] = (96, 54)
    texels: int = 128
    brightness: str = "flux"


def camera_at(way: float, resolution: tuple[int, int]) -> Camera:
    """Give the camera after so many metres."""
    return Camera(
        position=(PATCH[0], START + way, HEIGHT), target=(PATCH[0], START + way + 5.0, -0.5), vertical_fov=50.0,
        resolution=resolution,
    )  # fmt: skip


def flight_scene(flight: Flight) -> wc.Scene:
    """Give gentle water over a wide floor, and the camera where the flight begins."""
    settings = {"resolution": flight.texels, "count": 2, "near": NEAR, "far": FAR, "blend": flight.blend,
                "brightness": flight.brightness}  # fmt: skip
    return scene(
        GENTLE, camera=camera_at(0.0, flight.resolution).model_dump(), size=SIZE, resolution=(16, 16),
        method={"name": "cascaded", "cascaded": settings},
    )  # fmt: skip


def fly(flight: Flight, device: str) -> tuple[np.ndarray, np.ndarray]:
    """Give the patch's mean brightness and depth in each frame.

    The mean is over the floor's area, weighed by a smooth window, so that no pixel at its border counts for much.
    """
    what = flight_scene(flight)
    renderer = wc.Renderer(what, "cascaded", device, 1)
    arrays, found, depths = renderer._recording.arrays, [], []
    for way in np.linspace(0.0, WAY, flight.frames):
        camera = camera_at(way, flight.resolution)
        renderer.look_from(camera)
        seen = renderer.render(0.0).screen_map.numpy().astype(np.float64)
        view = renderer.plan.program.views(camera)["eye.view"].numpy()[0]
        depth = arrays["eye.depth"].numpy().astype(np.float64)
        depth = np.where(np.isfinite(depth), depth, 0.0)
        row, column = np.mgrid[: depth.shape[0], : depth.shape[1]] + 0.5
        homogeneous = np.stack([column * depth, row * depth, depth], axis=-1)
        point = (homogeneous - view["offset"]) @ np.array(view["inverse"]).T
        window = np.clip(1.0 - (np.abs(point[..., :2] - PATCH) / WIDTH) ** 2, 0.0, None).prod(axis=-1)
        weight = window * arrays["eye.area"].numpy()
        found.append((weight * seen).sum() / weight.sum())
        depths.append((weight * depth).sum() / weight.sum())
    return np.array(found), np.array(depths)
