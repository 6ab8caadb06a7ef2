"""The scenes that are timed, compared and drawn: the bundled ones, each at the size that it is measured at."""

from __future__ import annotations

import warp_caustics as wc

PIXELS = {"pool": 512, "beach": 512}
"""Columns and rows, where they are the scene's own; every published figure of this project is quoted on the pool."""

OTHER_PIXELS = 128
"""Where light is traced ray by ray, on steep terrain and meshes, the reference takes a minute at this size."""

SCENES: dict[str, wc.Scene] = {
    name: wc.load_scene(name).at_resolution(*(2 * (PIXELS.get(name, OTHER_PIXELS),))) for name in wc.bundled_scenes()
}
"""By name."""
