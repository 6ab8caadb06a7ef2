"""Environment maps: images of how bright the sky is."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from warp_caustics.assets.locate import locate
from warp_caustics.errors import InputError

#: Pillow's modes that hold 16 bits a pixel; "I" is how older versions open such a PNG.
_DEEP_MODES: Final = ("I", "I;16", "I;16L", "I;16B")
_DEEP_WHITE: Final = 65535.0
_WHITE: Final = 255.0


def load_environment(file: str) -> NDArray[np.float32]:
    """Load the first channel of an image, from 0 to 1.

    Returns
    -------
    ndarray
        float32 ``[rows, columns]``; the file's first row is row 0.

    Raises
    ------
    InputError
        If the file is missing or cannot be read.
    """
    from PIL import Image

    path = locate(file)
    try:
        with Image.open(path) as image:
            deep = image.mode in _DEEP_MODES
            values = np.asarray(image if deep else image.convert("RGB").getchannel(0), dtype=np.float32)
    except (OSError, SyntaxError, ValueError, MemoryError, Image.DecompressionBombError) as error:
        raise InputError(f"{path}: cannot be read as an image: {error}") from None
    return np.ascontiguousarray(values / np.float32(_DEEP_WHITE if deep else _WHITE))
