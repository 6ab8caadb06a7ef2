"""Caustic maps as OpenEXR files: float32, ZIP, with what made them in the header; read back bit for bit.

OpenEXR's Python binding (3.5.3) has traps, each pinned by a test in `tests/test_exr.py`: it ignores the strides of an
array, so that views, flips and transposes are written wrongly; it takes [rows, columns, 1] for three channels and reads
past the end; it opens a truncated file as a file with no parts. So only fresh, contiguous, two-dimensional channels
with names of their own go in, and files are looked at before they are decoded.
"""

from __future__ import annotations

import io
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from warp_caustics.errors import InputError
from warp_caustics.files import whole_file

CHANNELS = {1: ("Y",), 3: ("R", "G", "B")}
"""Names of a map's channels, by their number."""

ROW_ORDER = "y-up: last row first"
"""Value of the attribute `rowOrder`: the first row in the file is the last of the map, the one of highest y."""

SOFTWARE = "warp-caustics"
"""First word of the attribute `software`, before the version. (OpenEXR keeps `version` for an integer of its own.)"""

ENERGY_PREFIX = "energy."
"""The entries of the energy ledger are attributes of their own: `energy.emitted`, `energy.received`, and so on."""

_MAGIC = b"\x76\x2f\x31\x01"
_FLAGS_AT = 5  # second byte of the version field
_NOT_SCAN_LINES = 0x02 | 0x08 | 0x10  # tiles, deep data, several parts
_ATTRIBUTES_START = 8  # after the magic number and the version field, 4 bytes each
_CHUNK_LEADER = 8  # a scan-line chunk starts with its row and its packed size, 4 bytes each


def write_map(
    path: str | os.PathLike[str],
    image: npt.NDArray[np.float32],
    *,
    scene_text: str,
    version: str,
    method: str,
    units: str,
    energy: Mapping[str, Any],
    time: float,
    origin: Sequence[float] | None = None,
    size: Sequence[float] | None = None,
    marks: Mapping[str, Any] | None = None,
) -> None:
    """Write a map as EXR, whole or not at all; `load_map` gives it back bit for bit.

    Numbers in the header are kept in double precision.

    Parameters
    ----------
    path
        The file to write, in a folder that exists.
    image
        float32 [rows, columns] or [rows, columns, 3], row 0 at the origin; any strides.
    scene_text
        The scene as TOML.
    version, method
        Version of this library, and name of the method that made the map.
    units
        Units of the values, such as "W/m²".
    energy
        The ledger [W]: name to number, or to one number for each channel.
    time
        Time of the frame [s].
    origin, size
        Lower corner and extent of the map, (x, y) [m]; left out of what a camera sees.
    marks
        Further attributes by name: texts, numbers, or tuples of two or three.

    Raises
    ------
    InputError
        `image` is no map, or `path` cannot be written.
    RenderError
        Writing failed although it had begun: the disk is full, for example.
    """
    import OpenEXR

    channels = _to_channels(image)
    header = {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        "rowOrder": ROW_ORDER,
        **({} if origin is None else {"origin": _as_attribute(origin)}),
        **({} if size is None else {"size": _as_attribute(size)}),
        "units": units,
        "scene": scene_text,
        "software": f"{SOFTWARE} {version}",
        "method": method,
        "time": _as_attribute(time),
        **{ENERGY_PREFIX + name: _as_attribute(value) for name, value in energy.items()},
        **{name: mark if isinstance(mark, str) else _as_attribute(mark) for name, mark in (marks or {}).items()},
    }
    # Into memory first: the binding swallows Ctrl-C, and a full disk becomes a text; Python's own file does neither.
    encoded = io.BytesIO()
    with OpenEXR.File(header, channels) as exr:
        exr.write(encoded)
    with whole_file(path) as temporary:
        temporary.write_bytes(encoded.getbuffer())


def load_map(path: str | os.PathLike[str]) -> npt.NDArray[np.float32]:
    """Read a map that `write_map` wrote.

    Returns
    -------
    numpy.ndarray
        float32 [rows, columns] or [rows, columns, 3], row 0 at the map's origin.

    Raises
    ------
    InputError
        The file is missing, is not EXR, is cut short or damaged, or holds other channels than a map's.
    """
    header, channels = read_exr(path)
    row_order = header.get("rowOrder", ROW_ORDER)  # files that have been through other programs may have lost it
    if not isinstance(row_order, str) or row_order != ROW_ORDER:
        raise InputError(f"{os.fspath(path)!r} is not a map: its rowOrder is not {ROW_ORDER!r}")
    names = CHANNELS.get(len(channels), ())
    found = ", ".join(f"{name} ({pixels.dtype})" for name, pixels in channels.items())
    if set(names) != set(channels) or any(pixels.dtype != np.float32 for pixels in channels.values()):
        raise InputError(f"{os.fspath(path)!r} is not a map: its channels are {found}; expected float32 Y, or R, G, B")
    bottom_first = [channels[name][::-1] for name in names]
    return bottom_first[0].copy(order="C") if len(names) == 1 else np.stack(bottom_first, axis=-1)


def load_header(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Read the header of an EXR file in plain Python types, the energy ledger gathered into one dict under `energy`.

    Returns
    -------
    dict
        Attributes by name: text as str, numbers as int or float, vectors as tuples, OpenEXR's own types as they come.

    Raises
    ------
    InputError
        The file is missing, is not EXR, or its header is damaged.
    """
    header, _ = read_exr(path, header_only=True)
    plain = {name: _as_plain(value) for name, value in header.items()}
    ledger = {name: plain.pop(name) for name in list(plain) if name.startswith(ENERGY_PREFIX)}
    return plain | {"energy": {name.removeprefix(ENERGY_PREFIX): value for name, value in ledger.items()}}


def read_exr(
    path: str | os.PathLike[str], *, header_only: bool = False
) -> tuple[dict[str, Any], dict[str, npt.NDArray[Any]]]:
    """Read any EXR file of one part: its header, and its channels by name, top row first, each [rows, columns].

    Raises
    ------
    InputError
        The file is missing, is not EXR, is cut short or damaged, or has several parts.
    """
    import OpenEXR

    shown = os.fspath(path)
    try:
        data = Path(path).read_bytes()
    except (OSError, ValueError) as error:  # a null character in the name is a ValueError
        raise InputError(f"cannot read {shown!r}: {getattr(error, 'strerror', None) or error}") from None
    if not data.startswith(_MAGIC):
        raise InputError(f"{shown!r} is not an OpenEXR file")
    try:
        if not header_only and _is_cut_short(data):
            raise InputError(f"{shown!r} is cut short or damaged: its pixels are not all there")
        with OpenEXR.File(io.BytesIO(data), separate_channels=True, header_only=header_only) as exr:
            return _single_part(exr, shown)
    except InputError:
        raise
    except (RuntimeError, ValueError, TypeError, MemoryError) as error:
        # The binding raises RuntimeError for nearly everything; a damaged header can claim any size: MemoryError.
        raise InputError(f"{shown!r} is damaged and cannot be read as OpenEXR ({error})") from error


def _single_part(exr: Any, shown: str) -> tuple[dict[str, Any], dict[str, npt.NDArray[Any]]]:
    """Header and channels of an open file that must have one part."""
    if len(exr.parts) > 1:
        raise InputError(f"{shown!r} has {len(exr.parts)} parts; expected one")
    return dict(exr.header()), {name: channel.pixels for name, channel in exr.channels().items()}


def _is_cut_short(data: bytes) -> bool:
    """Tell whether a scan-line file ends before its last chunk does, as a copy that was interrupted does.

    The decoder would find it too, but prints on both standard streams on the way. Files laid out in another way
    (tiles, parts, rows from the bottom) are left to the decoder. After "OpenEXR File Layout", openexr.com.
    """
    at, line_order = _ATTRIBUTES_START, 0
    try:
        if data[_FLAGS_AT] & _NOT_SCAN_LINES:
            return False
        while data[at]:  # name, null, type, null, length, value; an empty name ends them
            value = data.index(0, data.index(0, at) + 1) + 5
            if data.startswith(b"lineOrder\0", at):
                line_order = data[value]
            at = value + int.from_bytes(data[value - 4 : value], "little")
    except (IndexError, ValueError):  # the file ends before its header does
        return True
    table = at + 1
    if line_order != 0:
        return False
    # With rows from the top the table of chunk offsets reaches up to the first chunk.
    first = int.from_bytes(data[table : table + 8], "little")
    if not table + 8 <= first <= len(data) or (first - table) % 8:
        return True
    last = int(np.frombuffer(data, "<u8", (first - table) // 8, table).max())
    packed = int.from_bytes(data[last + 4 : last + _CHUNK_LEADER], "little")
    return last + _CHUNK_LEADER + packed > len(data)


def _to_channels(image: npt.NDArray[np.float32]) -> dict[str, npt.NDArray[np.float32]]:
    """Split a map into channels as the binding must have them: named, two-dimensional, contiguous, top row first."""
    if image.dtype != np.float32:
        raise InputError(f"a map holds float32, this one {image.dtype}")
    shape = image.shape
    if image.size == 0 or not (len(shape) == 2 or (len(shape) == 3 and shape[2] == len(CHANNELS[3]))):
        raise InputError(f"a map is [rows, columns] or [rows, columns, 3] with at least one pixel, this one {shape}")
    top_first = image[::-1]
    if image.ndim == 2:
        return {CHANNELS[1][0]: top_first.copy(order="C")}
    return {name: top_first[:, :, i].copy(order="C") for i, name in enumerate(CHANNELS[3])}


def _as_attribute(value: Any) -> npt.NDArray[np.float64]:
    """Make an attribute of a number, or of two or three, that stays in double precision; a Python float is rounded."""
    return np.array(value, dtype=np.float64).reshape(-1)


def _as_plain(value: Any) -> Any:
    """Attribute as Python has it: number, tuple of numbers, or what it was."""
    if not isinstance(value, np.ndarray):
        return value
    return value.item() if value.size == 1 else tuple(value.tolist())
