"""Caustic textures: seamless tiles and loops, their frames, and their files."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .errors import InputError
from .repeat import Change, looping, tiled
from .scene import Scene, known_method, load_scene
from .scene.method import SCREEN_SPACE
from .water import check_time

if TYPE_CHECKING:
    import numpy as np

    from .flip_book import FlipBook
    from .reference.renderer import ReferenceRenderer
    from .renderer import Renderer
    from .result import Result

DEFAULT_FPS = 24.0
"""Frames per second of film."""

WHOLE = 1e-9
"""Relative difference up to which seconds times frames per second are a whole number: both are decimals."""

HURRIED = 2.0
"""A wave that runs so many times as fast as it would is worth a warning."""


@dataclass(frozen=True)
class Texture:
    """A scene that repeats, and when its frames are.

    Attributes
    ----------
    scene : Scene
        With what was moved so that it repeats.
    tile : bool
        Whether its map is a tile.
    loop : float or None
        Length of the loop [s]; None for one frame.
    frames : int
        How many frames there are.
    start : float
        Time of the first one [s].
    changes : tuple of Change
        What was moved.
    method : str
        That renders it.
    """

    scene: Scene
    tile: bool
    loop: float | None
    frames: int
    start: float
    changes: tuple[Change, ...]
    method: str

    @property
    def resolution(self) -> tuple[int, int]:
        """Columns and rows of a frame."""
        camera = self.scene.camera
        return camera.resolution if self.method in SCREEN_SPACE and camera is not None else self.scene.map.resolution

    def time(self, index: int) -> float:
        """Time of a frame, counted from 0 [s]."""
        return self.start + (self.loop or 0.0) * index / self.frames

    def results(self, renderer: Renderer | ReferenceRenderer) -> Iterator[Result]:
        """Render the frames, one after the other, by a renderer of this texture's scene."""
        for index in range(self.frames):
            renderer.render(self.time(index))
            yield renderer.result()

    @property
    def marks(self) -> Mapping[str, Any]:
        """What a file says of it: OpenEXR's own `wrapmodes`, and the loop."""
        wrap: dict[str, Any] = {"wrapmodes": "periodic"} if self.tile else {}
        return wrap | self._loop_marks

    @property
    def _loop_marks(self) -> dict[str, Any]:
        return {} if self.loop is None else {"loop": self.loop, "frames": self.frames, "fps": self.frames / self.loop}

    @property
    def warnings(self) -> list[str]:
        """What to know before it is used."""
        hurried = [c for c in self.changes if "frequency" in c.key and abs(c.after[0]) > HURRIED * abs(c.before[0])]
        if not hurried:
            return []
        most = max(abs(c.after[0] / c.before[0]) for c in hurried)
        longest = max(2.0 * math.pi / abs(c.before[0]) for c in hurried)
        return [
            f"loop: {self.loop:g} s is short: {len(hurried)} waves run up to {most:.2g} times as fast as they would; "
            f"from {longest / HURRIED:.3g} s on none runs more than {HURRIED:g} times as fast"
        ]

    def save(self, result: Result, path: str | os.PathLike[str], white: float) -> Path:
        """Write one frame as EXR, in its own units, or as a bare PNG of its pixels, by the file's ending.

        Parameters
        ----------
        result
            A frame of this texture.
        path
            A file that ends in ``.exr`` or ``.png``.
        white
            Value that is white in a PNG, the same for all frames of a loop, or it would flicker.

        Raises
        ------
        InputError
            If the ending is another one, or the folder cannot be written.
        """
        if Path(path).suffix.lower() != ".png":
            return result.save(path, marks=self.marks)
        _write_bare(path, result.image, white, self.marks)
        return Path(path)

    def save_atlas(self, book: FlipBook, path: str | os.PathLike[str], white: float, method: str) -> Path:
        """Write all frames as one EXR or PNG, which names the grid; parameters and faults as of :meth:`save`."""
        from . import __version__
        from .exr import write_map
        from .result import UNITS

        marks = {**self._loop_marks, "flipBook": book.grid}
        if Path(path).suffix.lower() == ".png":
            _write_bare(path, book.image, white, marks)
        else:
            write_map(
                path, book.image, scene_text=self.scene.to_toml(), version=__version__, method=method, units=UNITS,
                origin=self.scene.map.origin, size=self.scene.map.size, energy={}, time=self.start, marks=marks,
            )  # fmt: skip
        return Path(path)


def make_texture(
    scene: Scene | str | os.PathLike[str],
    *,
    tile: bool = True,
    loop: float | None = None,
    fps: float = DEFAULT_FPS,
    rounding: bool = False,
    method: str | None = None,
    start: float = 0.0,
) -> Texture:
    """Make a scene repeat in space, in time, or both.

    Parameters
    ----------
    scene : Scene, str or path
        A scene, the name of a bundled one, or a file.
    tile : bool
        The map shall be one period of an endless pattern: see :func:`~warp_caustics.repeat.tiled`.
    loop : float, optional
        Length of a loop [s], :func:`~warp_caustics.repeat.looping`; one frame if not given.
    fps : float
        Frames per second of the loop.
    rounding : bool
        Move what does not fit the tile to the nearest that does, instead of refusing it.
    method : str, optional
        The method that will render it; that of the scene if not given.
    start : float
        Time of the first frame [s].

    Raises
    ------
    InputError
        If the scene does not repeat and cannot be moved, or the loop is no whole number of frames.
    """
    if not isinstance(scene, Scene):
        scene = load_scene(scene)
    changes: tuple[Change, ...] = ()
    frames = 1 if loop is None else whole_frames(loop, fps)
    for end in (start, start + (loop or 0.0)):
        check_time(end)
    method = known_method(scene.method.name if method is None else method)
    if tile and method in SCREEN_SPACE:
        raise InputError(f'method: "{method}" makes what a camera sees, and a tile is a map in plan view')
    if tile:
        scene, changes = tiled(scene, method, rounding)
    if loop is not None:
        scene, moved = looping(scene, loop, method)
        changes += moved
    return Texture(scene, tile, loop, frames, start, changes, method)


def whole_frames(seconds: float, fps: float) -> int:
    """Frames of a loop.

    Raises
    ------
    InputError
        If it is no whole number of them, with the nearest that are.
    """
    if not (0.0 < seconds < math.inf and 0.0 < fps < math.inf):
        raise InputError(f"loop, fps: expected finite numbers above 0, got {seconds} and {fps}")
    count = seconds * fps
    whole = max(1, round(count))
    if abs(count - whole) > WHOLE * whole:
        raise InputError(
            f"loop: {seconds:g} s at {fps:g} frames per second are {count:.6g} frames, expected a whole number: "
            f"{whole} are {whole / fps:.9g} s at that rate, or {whole / seconds:.9g} per second in that time"
        )
    return whole


def _write_bare(path: str | os.PathLike[str], image: np.ndarray, white: float, marks: Mapping[str, Any]) -> None:
    """Write pixels with nothing beside them, so that they tile, and what is to be known of them as texts."""
    from .png import write_picture
    from .tone import to_srgb8

    texts = {
        name: " x ".join(f"{part:g}" for part in value) if isinstance(value, tuple) else str(value)
        for name, value in marks.items()
    }
    write_picture(path, to_srgb8(image, white), {"White": f"{white:.9g}", **texts})
