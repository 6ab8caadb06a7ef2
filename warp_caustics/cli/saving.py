"""How a frame becomes a file: its map, or the picture that its camera sees."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from warp_caustics.picture import Painter
    from warp_caustics.result import Result

Save = Callable[[Path], object]


class MapSaver:
    """Saves maps; all pictures of a sequence have one scale, or it would flicker."""

    def __init__(self) -> None:
        self._limits: tuple[float, float] | None = None

    def of(self, result: Result) -> Save:
        """Make what is to be saved of a frame, and return what saves it to a path."""
        from warp_caustics.tone import value_limits

        limits = self._limits = self._limits or value_limits(result.image)
        return lambda path: result.save(path, limits=limits)


class PictureSaver:
    """Saves pictures; the exposure is the scene's."""

    def __init__(self) -> None:
        self._painter: Painter | None = None

    def of(self, result: Result) -> Save:
        """Draw the picture of a frame, and return what saves it to a path."""
        from warp_caustics.picture import Painter, save_picture

        self._painter = self._painter or Painter(result)
        radiance = self._painter.paint(result)
        return lambda path: save_picture(path, radiance, result)
