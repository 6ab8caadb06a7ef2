"""The splat's ladder: given landing points into a map, from an atomic for each tap to what a GPU may like best."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from bilinear import bilinear_plain
from ladder import Rung
from splat_rungs.landed import Form, Landed, land, make_frame
from splat_rungs.merged import merged
from splat_rungs.plain import each_channel, plain
from splat_rungs.tiles import PATCH, binned, make_private_patches, private_tiles
from splat_rungs.vector import quads, rgba

PER_PIXEL = (1, 4)
WIDTHS = {"point": 0.0, "bilinear": 1.0}
CHANNELS = (1, 3)

FOLDS, SWING = (9.0, 14.0), 1.6
"""Waves of the landing points across and up the map, and how far each carries light, in its own length over 2 pi: past
1 sheets of light cross, as they do under a choppy pool."""

WINDOW_SPARE = 16
"""Pixels that the window of a patch of photons has beyond the patch: crossing sheets reach so far at 1024 pixels."""

TILED = ("binned by tile", "binned, tile in shared memory", "patches in shared memory")
"""Forms whose kernels hold tiles: Warp keeps those of a CPU in one place of a module, so that two threads that run the
same kernel write over each other. They have one thread there, whatever is asked."""

FLUX = (1.0, 0.6, 0.3)
"""By channel, of every photon."""


def landing_points(pixels: int, per_pixel: int) -> tuple[np.ndarray, np.ndarray]:
    """Give landing points [pixels] of a lattice of photons over a square map, row by row."""
    across = round(pixels * per_pixel**0.5)
    side = (np.arange(across) + 0.5) * pixels / across
    x, y = np.meshgrid(side, side)
    turn_x, turn_y = (2.0 * np.pi * waves / pixels for waves in FOLDS)
    at_x = x + SWING / turn_x * np.sin(turn_x * (x + 0.3 * y))
    at_y = y + SWING / turn_y * np.sin(turn_y * (y - 0.2 * x))
    return at_x.ravel(), at_y.ravel()


def banded(
    form: Form, pixels: int, per_pixel: int, width: float, channels: int, device: str, alone: bool
) -> Callable[[int], tuple[Callable[[], None], Callable[[], np.ndarray]]]:
    """Make a rung's frame of a form: photons in bands of whole rows of patches, a thread each, or one for all."""

    def make(threads: int) -> tuple[Callable[[], None], Callable[[], np.ndarray]]:
        x, y = landing_points(pixels, per_pixel)
        row_of_patches = PATCH * round(len(x) ** 0.5)
        lanes = 1 if alone or device != "cpu" else threads
        rows = np.array_split(np.arange(len(x)).reshape(-1, row_of_patches), lanes)
        bands: list[Landed] = []
        for band in rows:
            flux = np.broadcast_to(FLUX[:channels], (band.size, channels))
            bands.append(land(x[band.ravel()], y[band.ravel()], flux, (pixels, pixels), device, width))
        return make_frame(form, bands)

    return make


def forms(pixels: int, per_pixel: int, width: float, channels: int) -> dict[str, Form]:
    """Name the forms that can add such photons; the first is the plain one."""
    across = round(pixels * per_pixel**0.5)
    window = min(round(PATCH / per_pixel**0.5) + WINDOW_SPARE, pixels)
    found: dict[str, Form] = {"plain": plain, "a pass a channel": each_channel, "merged taps": merged}
    if channels == 1:
        del found["a pass a channel"]
    else:
        found["four floats a pixel"] = rgba
    if width > 0.0:
        found["blocks of four pixels"] = quads
    found["binned by tile"] = binned
    found["binned, tile in shared memory"] = private_tiles
    found["patches in shared memory"] = make_private_patches(across, window)
    return found


def yardstick(pixels: int, per_pixel: int, device: str) -> Callable[[int], tuple]:
    """Make the rung of the plain bilinear splat that other ladders are measured in."""

    def make(threads: int) -> tuple[Callable[[], None], Callable[[], np.ndarray]]:
        x, y = landing_points(pixels, per_pixel)
        run, read = bilinear_plain(x, y, np.full(len(x), FLUX[0]), (pixels, pixels), device, threads)
        return run, lambda: read()[..., None]

    return make


def rungs(pixels: int, device: str) -> list[list[Rung]]:
    """Give the ladders of the point and the bilinear splat, of 1 and 4 photons a pixel, in 1 and 3 channels.

    Parameters
    ----------
    pixels : int
        Of the map's sides, a multiple of 32.
    device : str
        ``"cpu"``, ``"cuda:0"``.
    """
    ladders = []
    for per_pixel in PER_PIXEL:
        for name, width in WIDTHS.items():
            for channels in CHANNELS:
                title = f"splat, {name}, {per_pixel} a pixel, {'mono' if channels == 1 else 'RGB'}"
                photons = pixels**2 * per_pixel
                arrays = 4 * (photons * (2 + channels) + pixels**2 * channels)
                ladder = [
                    Rung(
                        title,
                        form_name,
                        banded(form, pixels, per_pixel, width, channels, device, form_name in TILED),
                        arrays,
                        arrays,
                    )
                    for form_name, form in forms(pixels, per_pixel, width, channels).items()
                ]
                if channels == 1 and width > 0.0:
                    ladder.insert(1, Rung(title, "yardstick", yardstick(pixels, per_pixel, device), arrays, arrays))
                ladders.append(ladder)
    return ladders
