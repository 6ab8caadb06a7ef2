"""Every method's map side by side, at one exposure: its name and its milliseconds, or why it cannot serve the scene."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from warp_caustics.errors import InputError
from warp_caustics.view import INK, empty_plotter, light_picture, light_texture, white_of

if TYPE_CHECKING:
    import pyvista as pv

    from warp_caustics.scene import Scene

LETTERS = 9
"""Size of letters."""

EDGE = 0.02
"""Of captions, as a share of a field."""

LETTER_PIXELS, LINE_PIXELS = 9.5, 24.0
"""Width of such a letter, and height of a line."""

CAPTION = 0.25
"""Room for captions around a map, as a share of its height."""


@dataclass(frozen=True)
class Shown:
    """What one method makes: an image ``[rows, columns]`` (and colours) and its time, or the reason why not."""

    method: str
    image: np.ndarray | None
    milliseconds: float
    reason: str = ""
    from_camera: bool = False


def render_all(
    scene: Scene,
    methods: Sequence[str],
    device: str | None = None,
    time: float = 0.0,
    tell: Callable[[int, int, str], None] = lambda *_: None,
) -> list[Shown]:
    """Render a scene by each method; the time is that of a second frame, as the first one meets cold memory."""
    from warp_caustics.renderer import make_renderer

    shown = []
    for number, method in enumerate(methods):
        tell(number, len(methods), method)
        try:
            renderer = make_renderer(scene, method, device)
            frames = 1 if method == "reference" else 2
            for _ in range(frames):
                renderer.render(time)
            result = renderer.result()
        except InputError as error:
            shown.append(Shown(method, None, math.nan, str(error)))
            continue
        from_camera = result.caustic_map is None
        shown.append(Shown(method, result.image, 1e3 * result.seconds, from_camera=from_camera))
    return shown


def make_comparison(scene: Scene, shown: Sequence[Shown], *, off_screen: bool) -> pv.Plotter:
    """Lay the maps out in a grid; nothing is drawn yet. White is that of the first map, in all of them."""
    import pyvista as pv

    columns = math.ceil(math.sqrt(len(shown)))
    fields = math.ceil(len(shown) / columns)
    plotter = empty_plotter(off_screen=off_screen, shape=(fields, columns))
    line = LINE_PIXELS * fields / plotter.window_size[1]
    width = int(plotter.window_size[0] / columns / LETTER_PIXELS)
    white = next((white_of(one.image) for one in shown if one.image is not None), 1.0)
    for number, one in enumerate(shown):
        plotter.subplot(number // columns, number % columns)
        lines = _caption(one, width)
        place = (EDGE, 1.0 - EDGE - line * len(lines))
        plotter.add_text("\n".join(lines), position=place, font_size=LETTERS, color=INK, viewport=True)
        if one.image is None:
            continue
        rows, pixels = one.image.shape[:2]
        size = (pixels / rows, 1.0) if one.from_camera else np.divide(scene.map.size, max(scene.map.size))
        plane = pv.Plane(i_size=size[0], j_size=size[1], i_resolution=1, j_resolution=1)
        plotter.add_mesh(plane, texture=light_texture(light_picture(one.image, white)), lighting=False)
        plotter.camera.enable_parallel_projection()
        plotter.camera_position = "xy"
        plotter.camera.parallel_scale = 0.5 * size[1] * (1.0 + CAPTION)
    return plotter


def _caption(one: Shown, width: int) -> list[str]:
    if one.image is None:
        return [one.method, *textwrap.wrap(one.reason, width)]
    seen = ", what the camera sees" if one.from_camera else ""
    return [f"{one.method}, {one.milliseconds:.1f} ms{seen}"]
