"""The view in 3D with sliders for the sun, the water's depth, time and method: each move renders anew."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from warp_caustics.errors import InputError
from warp_caustics.receiver import rest_depth
from warp_caustics.renderer import Renderer
from warp_caustics.scene import METHODS, Scene, Sun
from warp_caustics.view import INK, add_receiver, add_sun, add_water, empty_plotter, set_camera

if TYPE_CHECKING:
    from warp_caustics.result import Result

LIVE_METHODS = tuple(name for name in METHODS if name != "reference")
"""A reference takes seconds to minutes: it does not follow a slider."""

FINEST, COARSEST = 512, 64
"""Pixels along the longer side of the map while it is moved, at most and at least."""

SLOW, QUICK = 0.2, 0.02
"""A frame that takes longer [s] halves the resolution of the next; one that is quicker doubles it again."""

LOWEST_SUN, HIGHEST_SUN = 10.0, 90.0
"""Elevation [degrees]. A lower sun's light spreads too far for a live map."""

DEPTHS = (0.1, 3.0)
"""Range of the depth, over the scene's own."""

LONGEST = 20.0
"""Range of the time [s]."""

SLIDERS = ((0.02, 0.27), (0.29, 0.54), (0.56, 0.76), (0.78, 0.98))
"""Ends of the sliders at the foot of the window, as shares of its width."""

SLIDER_FOOT, METHOD_HEAD = 0.07, 0.93
"""Heights of the sliders, as shares of the window's."""


@dataclass(frozen=True)
class Setting:
    """Where the sliders stand: sun [degrees], mean depth [m], time [s], method."""

    elevation: float
    azimuth: float
    depth: float
    time: float
    method: str


class LiveView:
    """A window whose light and water follow its sliders.

    Parameters
    ----------
    scene : Scene
        Where the sliders start.
    method, device
        As for :class:`~warp_caustics.Renderer`.
    time : float
        [s].
    off_screen : bool
        Draw without a window, for tests.

    Attributes
    ----------
    plotter : pv.Plotter
        The window.
    setting : Setting
        Where the sliders stand.
    result : Result
        What is shown.
    sliders : list of vtkSliderWidget
        For elevation, azimuth, depth and time.
    message : str
        Why a setting was not shown; empty where it was.

    Raises
    ------
    InputError
        If the method cannot serve the scene as it stands, or makes no map.
    """

    def __init__(
        self, scene: Scene, method: str | None = None, device: str | None = None, time: float = 0.0, *, off_screen: bool
    ) -> None:
        self._scene, self._device = scene, device
        self._side = FINEST
        self._renderer: tuple[Scene, str, Renderer] | None = None
        self.message = ""
        self.setting = self._start = _setting(scene, method or scene.method.name, time)
        self.result = self._render(self.setting)
        self.plotter = empty_plotter(off_screen=off_screen)
        self._draw()
        set_camera(self.plotter)
        self._add_sliders()

    def move(self, **changes: float | str) -> None:
        """Move sliders by name and show what follows; what cannot be rendered is said, and the last light stays."""
        setting = replace(self.setting, **changes)  # type: ignore[arg-type]  # names and types are Setting's own
        if setting == self.setting:
            return
        self.setting = setting
        try:
            self.result, self.message = self._render(setting), ""
        except InputError as error:
            self.message = str(error)
        self._draw()
        self.plotter.render()

    def _render(self, setting: Setting) -> Result:
        scene = self._scene_of(setting)
        if self._renderer is None or self._renderer[:2] != (scene, setting.method):
            self._renderer = (scene, setting.method, Renderer(scene, setting.method, self._device))
        renderer = self._renderer[2]
        renderer.render(setting.time)
        result = renderer.result()
        if result.caustic_map is None:
            raise InputError(f'method "{result.method}" makes what the camera sees; the view shows maps in plan view')
        if result.seconds > SLOW:
            self._side = max(self._side // 2, COARSEST)
        elif result.seconds < QUICK:
            self._side = min(self._side * 2, FINEST)
        return result

    def _scene_of(self, setting: Setting) -> Scene:
        """The scene as the sliders have it, at the resolution of the moment."""
        scene, start = self._scene, self._start
        changed: dict[str, object] = {}
        if (setting.elevation, setting.azimuth) != (start.elevation, start.azimuth):
            sun = scene.sun
            changed["sun"] = Sun(
                elevation=setting.elevation, azimuth=setting.azimuth, irradiance=sun.irradiance,
                angular_diameter=sun.angular_diameter,
            )  # fmt: skip
        if setting.depth != start.depth:
            level = scene.water.level + setting.depth - start.depth
            changed["water"] = scene.water.model_copy(update={"level": level})
        columns, rows = scene.map.resolution
        share = min(1.0, self._side / max(columns, rows))
        smaller = scene.model_copy(update=changed)
        return smaller.at_resolution(max(1, round(columns * share)), max(1, round(rows * share)))

    def _draw(self) -> None:
        """Put the last result's light and water into the window."""
        result, plotter = self.result, self.plotter
        assert result.caustic_map is not None  # _render has seen to it
        add_sun(plotter, result.scene)
        add_receiver(plotter, result.scene, result.assets, result.caustic_map)
        add_water(plotter, result.scene, result.assets, result.time)
        columns, rows = result.scene.map.resolution
        text = f"{result.scene.name}: {result.method}, {columns} x {rows}, {1e3 * result.seconds:.1f} ms"
        plotter.add_text(f"{text}\n{self.message}" if self.message else text, font_size=9, color=INK, name="title")

    def _add_sliders(self) -> None:
        start, depth = self.setting, self.setting.depth
        plotter: Any = self.plotter  # the decorators of its widgets lose `self` to a type checker
        ranges = (
            ("elevation", "sun's elevation [°]", (LOWEST_SUN, HIGHEST_SUN)),
            ("azimuth", "sun's azimuth [°]", (0.0, 360.0)),
            ("depth", "depth [m]", (DEPTHS[0] * depth, DEPTHS[1] * depth)),
            ("time", "time [s]", (min(start.time, 0.0), start.time + LONGEST)),
        )
        self.sliders = []
        for (name, title, span), (left, right) in zip(ranges, SLIDERS, strict=True):
            value = min(max(getattr(start, name), span[0]), span[1])
            slider = plotter.add_slider_widget(
                lambda value, name=name: self.move(**{name: float(value)}), span, value=value, title=title, color=INK,
                pointa=(left, SLIDER_FOOT), pointb=(right, SLIDER_FOOT), style="modern", title_height=0.015,
            )  # fmt: skip
            self.sliders.append(slider)
        plotter.add_text_slider_widget(
            lambda name: self.move(method=str(name)), list(LIVE_METHODS), value=LIVE_METHODS.index(start.method),
            pointa=(0.7, METHOD_HEAD), pointb=(0.98, METHOD_HEAD), color=INK, style="modern",
        )  # fmt: skip


def _setting(scene: Scene, method: str, time: float) -> Setting:
    """Where the sliders of a scene start."""
    from warp_caustics.assets import load_assets

    if method not in LIVE_METHODS:
        raise InputError(f'method "{method}" does not follow sliders; expected one of {", ".join(LIVE_METHODS)}')
    x, y, z = (float(-part) for part in scene.sun.unit_direction)
    azimuth = math.degrees(math.atan2(y, x)) % 360.0
    depth = rest_depth(scene, load_assets(scene))
    return Setting(math.degrees(math.asin(min(z, 1.0))), azimuth, depth, time, method)
