"""A rendered frame, read back: its map, its energy, what to know of it, and its way to a file."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .errors import InputError
from .receiver import receiver_kind, receiver_slopes

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping

    from .assets import Assets
    from .dispersion import DispersedPlan
    from .energy import Energy
    from .plan import Plan
    from .reference.plan import ReferencePlan
    from .scene import Scene

UNITS = "unit of sun.irradiance"
"""What a map's values are in: whatever the scene gives the sun in, W/m² when that is a real one."""

OVER_LIT_LIMIT = 0.01
"""Share of the light that may enter twice before it is worth a warning."""

INVENTED_LIMIT = 0.01
"""Share of the light in a map that may have come from nowhere before it is worth a warning."""

LOST_LIMIT = 1e-5
"""Share of the light that the sums of a map may lose before it is worth a warning: what is promised on planes."""


@dataclass(frozen=True)
class Result:
    """One frame.

    Attributes
    ----------
    scene : Scene
        What was rendered.
    method, device : str
        By what, and where.
    time : float
        [s].
    plan : Plan
        What was done for it.
    caustic_map : ndarray or None
        Flux per horizontal area, float32 ``[rows, columns]`` or ``[rows, columns, 3]``, in the units of the sun's
        irradiance; row 0 at the map's origin. Its sum times the pixel's area is the flux. None for screen-space
        methods.
    energy : Energy or None
        Where the light went [W]; None for methods that follow no light.
    seconds : float
        Time of the frame, compilation apart.
    error_bar : float or None
        Relative L2 error that a reference's map may have (RMSE over mean); None for the other methods.
    notes : tuple of str
        What of this frame alone is to be known.
    own_screen_map : ndarray or None
        What a screen-space method made; read :attr:`screen_map`.
    """

    scene: Scene
    method: str
    device: str
    time: float
    plan: Plan | DispersedPlan | ReferencePlan
    caustic_map: np.ndarray | None
    energy: Energy | None
    seconds: float
    assets: Assets = field(repr=False)
    error_bar: float | None = None
    notes: tuple[str, ...] = ()
    own_screen_map: np.ndarray | None = field(default=None, repr=False)

    @cached_property
    def surface_irradiance(self) -> np.ndarray | None:
        """The map per area of the receiver itself, ``caustic_map / sqrt(1 + |grad z|^2)``.

        None for meshes, and where there is no map.
        """
        if self.caustic_map is None or receiver_kind(self.scene) == "mesh" or self.assets.objects is not None:
            return None
        slopes = receiver_slopes(self.scene, self.assets)
        scale = 1.0 / np.sqrt(1.0 + (slopes**2).sum(axis=-1))
        if self.caustic_map.ndim == 3:
            scale = scale[..., None]
        return (self.caustic_map * scale).astype(np.float32)

    @cached_property
    def screen_map(self) -> np.ndarray | None:
        """Irradiance on the surface that each pixel of the camera sees, ``[rows, columns]``; None without a camera.

        A screen-space method has made it. Else it is the map, looked at, when it is first asked for: a map alone
        compiles and launches nothing for an eye. See :mod:`.screen`.
        """
        if self.own_screen_map is not None:
            return self.own_screen_map
        if self.scene.camera is None or self.caustic_map is None:
            return None
        from .screen import Gaze

        gaze = Gaze(self.scene, self.assets, self.scene.camera, self.device)
        return gaze.light(self.caustic_map).astype(np.float32)

    @cached_property
    def picture(self) -> np.ndarray | None:
        """What the camera sees, float32 ``[rows, columns, 3]`` of linear radiance; None without a camera.

        Row 0 is at the bottom; values are in the unit of the sun's irradiance, by steradian. It is drawn when it is
        first asked for: a map alone compiles and launches nothing for it. See :mod:`.picture`, whose
        ``save_picture`` writes it.
        """
        if self.scene.camera is None:
            return None
        from .picture import Painter

        return Painter(self).paint(self)

    @property
    def image(self) -> np.ndarray:
        """What the method makes, and :meth:`save` writes: its map, or what the camera sees."""
        made = self.caustic_map if self.caustic_map is not None else self.own_screen_map
        assert made is not None  # every method makes one of the two
        return made

    @property
    def warnings(self) -> list[str]:
        """What to know before trusting the map."""
        notes = [*self.plan.warnings, *self.notes]
        if self.energy is None:
            return notes
        emitted, over_lit = np.max(self.energy.emitted), np.max(self.energy.over_lit)
        if over_lit > OVER_LIT_LIMIT * emitted:
            notes.append(
                f"water: its shadows are off, and {over_lit / emitted:.1%} of the light enters twice, "
                "through crests and again behind them"
            )
        received, invented = np.max(self.energy.received), np.max(np.abs(self.energy.invented))
        if invented > INVENTED_LIMIT * received:
            held = np.sum(np.add(self.energy.received, self.energy.invented)) / np.sum(self.energy.received)
            notes.append(f"{self.method}: the map holds {held:.3g} times the light that reached it")
        dropped = np.max(self.energy.dropped)
        if dropped > 0.0:
            notes.append(f"{dropped / emitted:.1e} of the light had no path that is known, and was dropped")
        if self.energy.unaccounted > LOST_LIMIT:
            notes.append(
                f"method.accumulate: the map's sums are off by {self.energy.unaccounted:.1e} of the light; "
                '"float64" keeps it'
            )
        return notes

    def save(
        self,
        path: str | os.PathLike[str],
        limits: tuple[float, float] | None = None,
        marks: Mapping[str, Any] | None = None,
    ) -> Path:
        """Write the map as EXR, or as a PNG picture, by the file's ending; whole, or not at all.

        A screen-space method's is what the camera sees: its PNG has the camera's pixels and nothing beside them.

        Parameters
        ----------
        path
            A file that ends in ``.exr`` or ``.png``.
        limits
            Values of black and white in a PNG, in the map's own units; each picture has its own if not given, which
            would flicker in a sequence (:func:`warp_caustics.tone.value_limits` of its first frame does not).
        marks
            Further attributes of an EXR, by name.

        Raises
        ------
        InputError
            If the ending is another one, or the folder cannot be written.
        """
        from . import __version__
        from .exr import write_map
        from .png import write_picture, write_png
        from .tone import to_rgb8, value_limits

        path, scene, image = Path(path), self.scene, self.image
        in_plan = self.caustic_map is not None
        title = f"{scene.name}, {self.method}, t = {self.time:g} s"
        if path.suffix.lower() == ".exr":
            write_map(
                path, image, scene_text=scene.to_toml(), version=__version__, method=self.method,
                units=UNITS, energy=self.energy or {}, time=self.time,
                origin=scene.map.origin if in_plan else None, size=scene.map.size if in_plan else None,
                marks=marks,
            )  # fmt: skip
        elif path.suffix.lower() != ".png":
            raise InputError(f"{path}: expected a file that ends in .exr or .png")
        elif in_plan:
            write_png(
                path, image, origin=scene.map.origin, size=scene.map.size, units=UNITS, limits=limits, title=title
            )
        else:
            write_picture(path, to_rgb8(image, limits or value_limits(image)), metadata={"Title": title})
        return path
