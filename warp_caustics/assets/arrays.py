"""Height maps from NumPy's files, EXR and images."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from warp_caustics.assets.stored import Stored
from warp_caustics.errors import InputError
from warp_caustics.scene.faults import did_you_mean, listed

#: Pillow's modes of one channel with the file's own numbers; a palette or colours are no heights.
GREY_MODES = ("L", "I", "I;16", "I;16L", "I;16B", "F")


def read_npy(path: Path, key: str | None) -> Stored:
    """Read an NPY file; its first row is at the lowest y."""
    return Stored(_numpy_file(path), top_row_first=False)


def read_npz(path: Path, key: str | None) -> Stored:
    """Read one array of an NPZ file; its first row is at the lowest y."""
    archive = _numpy_file(path)
    with archive:
        name = chosen(key, archive.files, "array")
        try:
            return Stored(archive[name], top_row_first=False)
        except (ValueError, OSError, EOFError, zipfile.BadZipFile, MemoryError) as error:
            raise InputError(f'{path}: the array "{name}" cannot be read: {error}') from None


def read_exr(path: Path, key: str | None) -> Stored:
    """Read one channel of an EXR file; its first row is at the highest y, as in the maps of this library."""
    from warp_caustics import exr

    header, channels = exr.read_exr(path)
    if header.get("rowOrder", exr.ROW_ORDER) != exr.ROW_ORDER:
        raise InputError(f'{path}: expected the rowOrder "{exr.ROW_ORDER}", got "{header["rowOrder"]}"')
    return Stored(channels[chosen(key, channels, "channel")], top_row_first=True)


def read_image(path: Path, key: str | None) -> Stored:
    """Read a greyscale image as its raw numbers; its first row is at the highest y."""
    from PIL import Image

    try:
        with Image.open(path) as image:
            mode, values = image.mode, np.asarray(image)
    except (OSError, SyntaxError, ValueError, MemoryError, Image.DecompressionBombError) as error:
        raise InputError(f"{path}: cannot be read as an image: {error}") from None
    if mode not in GREY_MODES:
        raise InputError(f"{path}: expected a greyscale image, got one of mode {mode}")
    return Stored(values, top_row_first=True)


def chosen(key: str | None, names: Any, kind: str) -> str:
    """Return the name of the array that a key means: itself, or the only one when there is no key."""
    found = list(names)
    if key in found:
        return str(key)
    if not found:
        raise InputError(f"the file holds no {kind}")
    if key is not None:
        raise InputError(f'no {kind} "{key}", {did_you_mean(key, found) or f"expected {listed(found)}"}')
    if len(found) > 1:
        raise InputError(f"expected a key, since there are several {kind}s: {listed(found, 'and')}")
    return str(found[0])


def _numpy_file(path: Path) -> Any:
    """Open a file of NumPy's; pickled objects are refused, since they could run anything."""
    try:
        content = np.load(path, allow_pickle=False)
    except (ValueError, OSError, EOFError, zipfile.BadZipFile, MemoryError) as error:
        raise InputError(f"{path}: cannot be read as {path.suffix}: {error}") from None
    if isinstance(content, np.ndarray) != (path.suffix.lower() == ".npy"):
        raise InputError(f"{path}: expected what {path.suffix} says, got the other one of NPY and NPZ")
    return content
