"""Pictures that a pattern is made of."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from warp_caustics.assets.arrays import GREY_MODES, chosen
from warp_caustics.assets.locate import locate
from warp_caustics.errors import InputError
from warp_caustics.scene.formats import suffix
from warp_caustics.tone import LUMINANCE, decode_srgb

LEVEL_MODES = ("1", "L", "LA", "P", "PA", "RGB", "RGBA", "RGBX", "CMYK", "YCbCr")
"""Pillow's modes of 8 bits, which hold sRGB."""

BRIGHTEST = 255.0


def load_texture(file: str) -> NDArray[np.float64]:
    """Load a picture as linear luminance, float64 [rows, columns], row 0 at the bottom.

    Pictures of 8 bits are decoded as sRGB; EXR and pictures of more bits hold light as it is.

    Raises
    ------
    InputError
        If the file is missing or cannot be read, or holds no finite light of at least 0, or none at all.
    """
    path = locate(file)
    top_first = _read_exr(path) if suffix(file) == ".exr" else _read_image(path)
    if not (np.isfinite(top_first).all() and top_first.min() >= 0.0 and top_first.max() > 0.0):
        raise InputError(f"{path}: expected finite light of at least 0, and some of it above")
    return np.ascontiguousarray(top_first[::-1])


def _read_exr(path: Path) -> NDArray[np.float64]:
    from warp_caustics.exr import CHANNELS, read_exr

    _, channels = read_exr(path)
    names = CHANNELS[3] if set(CHANNELS[3]) <= set(channels) else (chosen(None, channels, "channel"),)
    weights = LUMINANCE if len(names) > 1 else (1.0,)
    light = [weight * channels[name].astype(np.float64) for weight, name in zip(weights, names, strict=True)]
    return np.asarray(sum(light), dtype=np.float64)


def _read_image(path: Path) -> NDArray[np.float64]:
    from PIL import Image

    try:
        with Image.open(path) as image:
            levels = image.mode in LEVEL_MODES
            values = np.asarray(image.convert("RGB") if levels else image, dtype=np.float64)
            mode = image.mode
    except (OSError, SyntaxError, ValueError, MemoryError, Image.DecompressionBombError) as error:
        raise InputError(f"{path}: cannot be read as an image: {error}") from None
    if levels:
        return np.asarray(decode_srgb(values / BRIGHTEST) @ np.array(LUMINANCE))
    if mode not in GREY_MODES:
        raise InputError(f"{path}: expected a picture of colours or greys, got one of mode {mode}")
    return values
