"""Screen-space methods are judged in eye pixels, against the reference carried to the same points of the receiver."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from warp_caustics.metrics import relative_l2
from warp_caustics.screen import Gaze

if TYPE_CHECKING:
    from warp_caustics.assets import Assets
    from warp_caustics.reference import Reference
    from warp_caustics.scene import Camera, Scene

SAMPLES = 2
"""Lines of sight along a side of an eye pixel: far pixels hold several of the map's, and see their mean."""


class CarriedReference:
    """The reference as a camera sees it.

    Parameters
    ----------
    scene, assets, camera, device
        The scene, its files, its eye, and where to rasterize.
    reference : Reference
        In plan view, on the scene's map.

    Attributes
    ----------
    irradiance : ndarray
        Of the pixels that are judged, ``[pixels]`` or ``[pixels, 3]``.
    error_bar : float
        Relative L2 error that it may have: the reference's own, and how much it changes when it is carried from a map
        of half the resolution, which is more than what the map's own pixels blur.
    """

    def __init__(self, scene: Scene, assets: Assets, camera: Camera, reference: Reference, device: str) -> None:
        self._gaze = Gaze(scene, assets, camera, device, SAMPLES)
        self.irradiance = self.carried(reference.caustic_map)
        coarse = self.carried(_coarser(reference.caustic_map)) if self.irradiance.size else self.irradiance
        moved = relative_l2(coarse, self.irradiance) if self.irradiance.size else 0.0
        self.error_bar = float(np.hypot(reference.error_bar, moved))

    def carried(self, caustic_map: np.ndarray) -> np.ndarray:
        """Light of a plan-view map on the pixels that are judged: those that see nothing but the map."""
        return self._gaze.light(caustic_map)[self._gaze.inside]

    def judged(self, screen_map: np.ndarray) -> np.ndarray:
        """Pick the pixels that are judged of a method's own picture."""
        return np.asarray(screen_map[self._gaze.inside])


def _coarser(image: np.ndarray) -> np.ndarray:
    """Mean of two pixels along each side, put back at both."""
    rows, columns = (side // 2 * 2 for side in image.shape[:2])
    made = image.astype(np.float64)
    blocks = made[:rows, :columns].reshape(rows // 2, 2, columns // 2, 2, *image.shape[2:])
    mean = np.broadcast_to(blocks.mean(axis=(1, 3), keepdims=True), blocks.shape)
    made[:rows, :columns] = mean.reshape(made[:rows, :columns].shape)
    return made
