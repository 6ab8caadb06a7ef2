"""The picture: what the scene's camera sees, in linear radiance. Made when it is asked for, and not before.

Ground is matt; the caustic map is light upon it. Beside the map the same method lights a wider and coarser map of the
surroundings where it can, and past that, or where it cannot, light comes through still water. Lines of sight are bent
at the water's surface, which mirrors a simple sky; of a screen-space method, whose light is known along straight lines
alone, they are straight there. In the water what the eye sees is absorbed and veiled along the way.
"""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from .bands import bind_lanes
from .crew import Crew
from .errors import InputError
from .eye import eye_view, view_array
from .facts import gather_facts
from .kernels.picture import make_picture
from .kernels.shade import Appearance, PictureSpec
from .kernels.spec import Spec
from .recording import launches
from .state import SceneState
from .surroundings import make_surroundings
from .tone import decode_srgb

if TYPE_CHECKING:
    from .result import Result
    from .scene import Camera, Scene

UNITS = "unit of sun.irradiance by steradian"
"""What a picture's values are in."""

RAYS = 2
"""Rays along each side of a pixel: edges of the web and of the waves are smoothed, at four times the work."""

ZENITH, HORIZON = (0.020, 0.038, 0.075), (0.105, 0.122, 0.140)
"""Radiance of the sky over the irradiance of the sun [1/sr]: our choice of a clear noon. The sky then lights level
ground with a sixth of what the sun gives, blue, as clear skies do."""

SKY_MEAN_OF_ZENITH = 0.8
"""Share of the zenith's colour in the irradiance of the sky over pi: the integral of 2 mu sqrt(mu) d mu."""

SUN_HALF_ANGLE = math.radians(1.2)
"""Of the sun that is drawn; the real one, 0.27 degrees, would be missed by most rays between the waves. Its radiance is
less by as much as its disk is larger."""

BACKSCATTER = 0.004
"""Backscattering coefficient of clear natural water [1/m]."""

MOREL_PRIEUR = 0.33
"""Reflectance of endless water by b / (a + b), b its backscattering and a its absorption (Morel & Prieur 1977)."""

HAZE = 400.0
"""Diagonals of the map over which the air takes 1/e of the contrast: it hides the rim of the world, and no more."""


PUBLISHED = frozenset({"sample"})
"""Methods whose paper shades ground and water in a way of its own: in colours as the display shows them, 0 to 1."""


class Painter:
    """Draws pictures of the frames of one scene by one method; makes what they share once.

    Parameters
    ----------
    result : Result
        Any frame.

    Raises
    ------
    InputError
        If the scene has no camera.
    """

    def __init__(self, result: Result) -> None:
        scene = result.scene
        if scene.camera is None:
            raise InputError("camera: missing, and a picture needs one; expected a table [camera]")
        self.facts = gather_facts(scene, result.assets)
        self._device, self._crew = result.device, Crew(result.plan.threads)
        self._straight = result.caustic_map is None
        self._published = result.method in PUBLISHED
        self._around = None if self._published else make_surroundings(result)
        self._state = SceneState(self.facts, self._device, self._crew)
        self._view = wp.clone(view_array(eye_view(scene.camera).projection(_origin(scene))), device=self._device)
        self._look = self._appearance(scene, scene.camera)

    def paint(self, result: Result) -> np.ndarray:
        """Draw a frame: float32 ``[camera rows, camera columns, 3]``, linear radiance, row 0 at the bottom."""
        camera = result.scene.camera
        assert camera is not None  # it is the scene of __init__
        self._state.write(result.time)
        columns, rows = camera.resolution
        picture = wp.empty((rows, columns), dtype=wp.vec3, device=self._device)
        kernel = make_picture(self._spec())
        nothing = wp.empty((0, 0), dtype=wp.vec3, device=self._device)
        around = nothing if self._around is None else self._upload(self._around.light(result.time))
        values = {
            "scene": self._state.scene, "view": self._view, "appearance": self._look,
            "light": self._upload(result.image), "surroundings": around, "side": RAYS, "picture": picture,
        }  # fmt: skip
        self._crew.run(launches(bind_lanes(kernel, picture.shape, values, self._device, self._crew.threads)))
        made = np.asarray(picture.numpy())
        return decode_srgb(np.clip(made, 0.0, 1.0)).astype(np.float32) if self._published else made

    def _spec(self) -> PictureSpec:
        spec = self.facts.spec
        kinds = Spec(water=spec.water, receiver=spec.receiver, objects=spec.objects, bounded=spec.bounded)
        return PictureSpec(
            kinds,
            fresnel=spec.fresnel,
            by_depth=spec.attenuation == "depth",
            published=self._published,
            around=self._around is not None,
            screen=self._straight,
        )

    def _upload(self, image: np.ndarray) -> Any:
        colour = np.broadcast_to(image if image.ndim == 3 else image[..., None], (*image.shape[:2], 3))
        return wp.array(np.ascontiguousarray(colour, dtype=np.float32), dtype=wp.vec3, device=self._device)

    def _appearance(self, scene: Scene, camera: Camera) -> Appearance:
        look, origin = Appearance(), _origin(scene)
        look.eye = wp.vec3(*np.subtract(camera.position, origin))
        look.pixel_angle = 2.0 * math.tan(math.radians(camera.vertical_fov) / 2.0) / camera.resolution[1]
        look.sun = wp.vec3(*scene.sun.unit_direction)
        look.sun_cosine = math.cos(SUN_HALF_ANGLE)
        for name, value in colours_of(scene, self.facts.attenuation).items():
            setattr(look, name, wp.vec3(*value))
        look.haze = HAZE * math.hypot(*scene.map.size)
        look.map_size = wp.vec2(*scene.map.size)
        land, around = self.facts.assets.terrain, self._around
        if land is not None:
            look.land_low, look.land_size = wp.vec2(*np.subtract(land.origin, origin[:2])), wp.vec2(*land.size)
        if around is not None:
            look.around_low = wp.vec2(*np.subtract(around.origin, origin[:2]))
            look.around_size, look.around_fade = wp.vec2(*around.size), around.fade
        return look


def _origin(scene: Scene) -> tuple[float, float, float]:
    """What the kernels' coordinates are relative to [m]."""
    return (*scene.map.origin, scene.water.level)


def colours_of(scene: Scene, attenuation: tuple[float, float, float]) -> dict[str, np.ndarray]:
    """Colours of light, sky, ground and water, red, green and blue.

    Returns
    -------
    dict
        ``irradiance`` of the sun, ``sun_radiance`` of the disk that is drawn, ``zenith`` and ``horizon``,
        ``sky_irradiance`` on level ground, ``albedo``, ``attenuation`` [1/m] and ``veil``, the radiance
        of endless water.
    """
    sun = np.broadcast_to(np.asarray(scene.sun.irradiance, dtype=np.float64), 3)
    zenith, horizon = np.asarray(ZENITH) * sun, np.asarray(HORIZON) * sun
    sky = math.pi * (SKY_MEAN_OF_ZENITH * zenith + (1.0 - SKY_MEAN_OF_ZENITH) * horizon)
    falling = -float(scene.sun.unit_direction[2]) * sun + sky
    absorption = np.asarray(attenuation)
    return {
        "irradiance": sun,
        "sun_radiance": sun / (2.0 * math.pi * (1.0 - math.cos(SUN_HALF_ANGLE))),
        "zenith": zenith,
        "horizon": horizon,
        "sky_irradiance": sky,
        "albedo": np.broadcast_to(np.asarray(scene.receiver.albedo, dtype=np.float64), 3),
        "attenuation": absorption,
        "veil": MOREL_PRIEUR * BACKSCATTER / (absorption + BACKSCATTER) * falling / math.pi,
    }


def save_picture(path: str | os.PathLike[str], radiance: np.ndarray, result: Result) -> None:
    """Write a picture of a frame, whole or not at all: linear radiance as EXR, :func:`.tone.expose` as PNG.

    Raises
    ------
    InputError
        If the ending is another one, or the folder cannot be written.
    """
    from . import __version__
    from .exr import write_map
    from .png import write_picture
    from .tone import expose, to_rgb8

    path, scene = Path(path), result.scene
    if path.suffix.lower() == ".exr":
        write_map(
            path, radiance, scene_text=scene.to_toml(), version=__version__, method=result.method,
            units=UNITS, energy={}, time=result.time,
        )  # fmt: skip
    elif path.suffix.lower() == ".png":
        stops = 0.0 if scene.camera is None else scene.camera.exposure
        title = f"{scene.name}, {result.method}, t = {result.time:g} s, seen by its camera"
        if result.method in PUBLISHED:  # back to its own colours, whatever the film would make of them
            pixels = to_rgb8(radiance, (0.0, 2.0**-stops))
        else:
            pixels = expose(radiance, float(np.mean(scene.sun.irradiance)), stops)
        write_picture(path, pixels, metadata={"Title": title})
    else:
        raise InputError(f"{path}: expected a file that ends in .exr or .png")
