"""The receiver in 3D with the caustic map on it as light, and the water above it; drawn by pyvista.

A VTK that finds neither a display nor EGL ends the process. So nothing is drawn here before a process of its own has
drawn something.
"""

from __future__ import annotations

import functools
import itertools
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from warp_caustics.errors import InputError, RenderError
from warp_caustics.tone import RGB, is_colour, to_rgb8
from warp_caustics.view_meshes import receiver_meshes, water_mesh

if TYPE_CHECKING:
    import pyvista as pv

    from warp_caustics.assets import Assets
    from warp_caustics.result import Result
    from warp_caustics.scene import Map, Scene

# Drawing one triangle takes a second or two; the rest is for a slow disk and a cold cache of libraries.
PROBE_SECONDS = 120.0
PROBE = (
    "import pyvista as pv; plotter = pv.Plotter(off_screen=True, window_size=[16, 16]); "
    "plotter.add_mesh(pv.Triangle()); plotter.screenshot(None)"
)
NO_DRAWING = (
    "VTK cannot draw on this machine (the attempt {how}); it needs libEGL with a driver, and libX11. "
    "Debian and Ubuntu: apt-get install libegl1 libgl1 libxrender1"
)
NO_DISPLAY = "no display to open a window on (DISPLAY is not set): write a picture with --screenshot FILE.png instead"

WINDOW = (1280, 800)  # pixels
# The brightest hundredth of a map is a few thin folds; white starts there, so that the rest is not drowned in the dark.
WHITE_PERCENTILE = 99.0
BACKGROUND = ("#0d1418", "#26343c")  # bottom and top: dark, so that light stands out
INK = "#d8e0e4"
WATER_COLOR = "#6fc3e6"
WATER_OPACITY = 0.2
WATER_SHINE: dict[str, Any] = {"ambient": 0.3, "diffuse": 0.7, "specular": 0.8, "specular_power": 40.0}
BORDER_ONLY = {"boundary_edges": True, "feature_edges": False, "manifold_edges": False, "non_manifold_edges": False}
# Share of its light that the receiver shows whatever its slope; the rest is shaded, so that its relief can be seen.
RELIEF_AMBIENT = 0.5
CAMERA_DIRECTION = (-0.35, -1.0, 0.85)  # from the scene to the camera, which stands before it and above it
CAMERA_FOV = 30.0  # degrees
CAMERA_MARGIN = 1.08  # leaves room for the labels
LABEL_GAP = 0.04  # between a side of the map and its label, in units of the larger side
LABEL_POINTS = 14


def view(result: Result, *, screenshot: str | Path | None = None) -> None:
    """Show a result in a window, or write a picture of it.

    Parameters
    ----------
    result
        A rendered map with its scene.
    screenshot
        A PNG to write without a display; a window is opened, and waited for, when left out.

    Raises
    ------
    RenderError
        If nothing can be drawn on this machine, or no window opened.
    """
    if result.caustic_map is None:
        raise InputError(f'method "{result.method}" makes what the camera sees; the view shows maps in plan view')
    check_can_show(window=screenshot is None)
    show_plotter(lambda: make_plotter(result, off_screen=screenshot is not None), screenshot)


def show_plotter(make: Callable[[], pv.Plotter], screenshot: str | Path | None) -> None:
    """Open the window of a plotter and wait for its end, or write a picture of it; see :func:`check_can_show` first."""
    with quiet_vtk():
        plotter = make()
        if screenshot is None:
            plotter.show()
        else:
            _write_screenshot(plotter, Path(screenshot))
        plotter.close()


def check_can_show(*, window: bool) -> None:
    """Raise RenderError, with what to do about it, if nothing can be drawn here or no window can open."""
    if window and sys.platform.startswith("linux") and not (os.environ.get("DISPLAY")):
        raise RenderError(NO_DISPLAY)
    failure = _probe()
    if failure is not None:
        raise RenderError(NO_DRAWING.format(how=failure))


@functools.cache
def _probe() -> str | None:
    """Draw a triangle in a process of its own; return how that failed, or None."""
    try:
        done = subprocess.run([sys.executable, "-c", PROBE], capture_output=True, timeout=PROBE_SECONDS, check=False)
    except subprocess.TimeoutExpired:
        return f"took more than {PROBE_SECONDS:.0f} s"
    if done.returncode == 0:
        return None
    if done.returncode < 0:
        return f"ended with signal {-done.returncode}"
    lines = done.stderr.decode(errors="replace").strip().splitlines()
    return f"ended with status {done.returncode}" + (f": {lines[-1]}" if lines else "")


def make_plotter(result: Result, *, off_screen: bool) -> pv.Plotter:
    """Put the receiver with its light, the water, the scale bar and the camera together; nothing is drawn yet."""
    from warp_caustics.assets import load_assets

    scene = result.scene
    assert result.caustic_map is not None  # view has seen to it
    assets = load_assets(scene)
    plotter = empty_plotter(off_screen=off_screen)
    add_sun(plotter, scene)
    add_receiver(plotter, scene, assets, result.caustic_map)
    add_water(plotter, scene, assets, result.time)
    plotter.add_text(f"{scene.name}: {result.method}, t = {result.time:g} s", font_size=9, color=INK)
    _add_lengths(plotter, scene.map)
    set_camera(plotter)
    return plotter


def empty_plotter(*, off_screen: bool, shape: tuple[int, int] = (1, 1)) -> pv.Plotter:
    """Make a plotter of the house's size and colours, of so many rows and columns, without light."""
    import pyvista as pv

    plotter = pv.Plotter(off_screen=off_screen, window_size=list(WINDOW), lighting="none", shape=shape)
    plotter.set_background(BACKGROUND[0], top=BACKGROUND[1])  # type: ignore[arg-type]  # its decorator loses self
    return plotter


def add_sun(plotter: pv.Plotter, scene: Scene) -> None:
    """Put the sun where it stands, in the place of any other light."""
    import pyvista as pv

    plotter.remove_all_lights()
    towards_sun = -np.asarray(scene.sun.unit_direction)
    plotter.add_light(pv.Light(position=tuple(towards_sun), light_type="scene light"))


def add_receiver(plotter: pv.Plotter, scene: Scene, assets: Assets, caustic_map: npt.NDArray[np.float32]) -> None:
    """Draw what receives light, with a map upon it; in the place of what was drawn so before."""
    texture = light_texture(light_picture(caustic_map))
    for number, mesh in enumerate(receiver_meshes(scene, assets)):
        plotter.add_mesh(
            mesh, texture=texture, ambient=RELIEF_AMBIENT, diffuse=1.0 - RELIEF_AMBIENT, name=f"receiver {number}",
            reset_camera=False, render=False,
        )  # fmt: skip


def add_water(plotter: pv.Plotter, scene: Scene, assets: Assets, time: float) -> None:
    """Draw the water's surface and its border; in the place of what was drawn so before."""
    water = water_mesh(scene, assets, time)
    plotter.add_mesh(
        water, color=WATER_COLOR, opacity=WATER_OPACITY, smooth_shading=True, name="water", reset_camera=False,
        render=False, **WATER_SHINE,
    )  # fmt: skip
    plotter.add_mesh(
        water.extract_feature_edges(**BORDER_ONLY), color=WATER_COLOR, lighting=False, name="border",
        reset_camera=False, render=False,
    )  # fmt: skip


def light_texture(picture: npt.NDArray[np.uint8]) -> pv.Texture:
    """Make a texture of a picture whose row 0 is at the bottom."""
    import pyvista as pv

    texture = pv.Texture(np.ascontiguousarray(picture[::-1]))  # the first row of a texture is its top
    texture.interpolate = True
    return texture


def light_picture(caustic_map: npt.NDArray[np.float32], white: float | None = None) -> npt.NDArray[np.uint8]:
    """Expose a caustic map as a white diffuse ground would look under it.

    Parameters
    ----------
    caustic_map
        float32 [rows, columns] or [rows, columns, 3], irradiance in any unit.
    white
        Irradiance that is shown as white; :func:`white_of` the map if not given.

    Returns
    -------
    uint8 [rows, columns, 3]
        sRGB, in the row order of the map; one exposure for all channels.
    """
    colour = caustic_map if is_colour(caustic_map) else np.repeat(caustic_map[..., None], RGB, axis=2)
    return to_rgb8(colour, (0.0, white_of(caustic_map) if white is None else white))


def white_of(caustic_map: npt.NDArray[np.float32]) -> float:
    """Irradiance that is to be shown as white, so that all but the thin folds of a map keeps below it."""
    brightest = caustic_map.max(axis=2) if is_colour(caustic_map) else caustic_map
    lit = brightest[np.isfinite(brightest) & (brightest > 0.0)]
    return float(np.percentile(lit, WHITE_PERCENTILE)) if lit.size else 1.0


def _add_lengths(plotter: pv.Plotter, window: Map) -> None:
    """Write the lengths of the map's sides beside them, at the foot of all that is drawn."""
    (left, bottom), (width, depth), foot = window.origin, window.size, plotter.bounds.z_min
    gap = LABEL_GAP * max(width, depth)
    labels: tuple[tuple[tuple[float, float, float], str, Literal["center", "right"]], ...] = (
        ((left + width / 2, bottom - gap, foot), f"x: {width:g} m", "center"),
        ((left - gap, bottom + depth / 2, foot), f"y: {depth:g} m", "right"),
    )
    for place, text, side in labels:
        plotter.add_point_labels(
            [place],
            [text],
            show_points=False,
            shape=None,
            text_color=INK,
            font_size=LABEL_POINTS,
            justification_horizontal=side,
            always_visible=True,
        )


def set_camera(plotter: pv.Plotter) -> None:
    """Stand before the map and above it, at the distance from which everything just fits into the window."""
    low, high = np.reshape(plotter.bounds, (3, 2)).T
    middle = (low + high) / 2.0
    corners = np.array(list(itertools.product(*zip(low, high, strict=True)))) - middle
    backward = np.array(CAMERA_DIRECTION) / np.linalg.norm(CAMERA_DIRECTION)
    right = np.cross((0.0, 0.0, 1.0), backward)
    right /= np.linalg.norm(right)
    up = np.cross(backward, right)
    half_height = np.tan(np.radians(CAMERA_FOV) / 2.0)
    half_width = half_height * WINDOW[0] / WINDOW[1]
    spread = np.maximum(np.abs(corners @ right) / half_width, np.abs(corners @ up) / half_height)
    distance = CAMERA_MARGIN * float(np.max(spread + corners @ backward))
    plotter.camera.up = (0.0, 0.0, 1.0)
    plotter.camera.focal_point = tuple(middle)
    plotter.camera.position = tuple(middle + distance * backward)
    plotter.camera.view_angle = CAMERA_FOV
    plotter.reset_camera_clipping_range()


def _write_screenshot(plotter: pv.Plotter, path: Path) -> None:
    from PIL import Image

    from warp_caustics.files import whole_file

    pixels = plotter.screenshot(None, return_img=True)
    with whole_file(path) as temporary:
        Image.fromarray(np.asarray(pixels)).save(temporary, format="PNG")


@contextmanager
def quiet_vtk() -> Iterator[None]:
    """Keep VTK from warning that there is no X server before it turns to EGL."""
    from vtkmodules.vtkCommonCore import vtkLogger

    logger: Any = vtkLogger
    before = logger.GetCurrentVerbosityCutoff()
    logger.SetStderrVerbosity(logger.VERBOSITY_ERROR)
    try:
        yield
    finally:
        logger.SetStderrVerbosity(before)
