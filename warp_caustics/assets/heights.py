"""Height maps: reading any of the formats, checking, and putting in place."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from warp_caustics.assets.arrays import read_exr, read_image, read_npy, read_npz
from warp_caustics.assets.geotiff import read_geotiff
from warp_caustics.assets.locate import locate
from warp_caustics.assets.netcdf import read_netcdf
from warp_caustics.assets.stored import Stored
from warp_caustics.assets.types import HeightGrid
from warp_caustics.errors import InputError
from warp_caustics.scene.formats import GEOTIFF_SUFFIXES, IMAGE_SUFFIXES, NETCDF_SUFFIXES, suffix
from warp_caustics.scene.water import HeightFile

#: Slopes are fourth-order differences, whose stencils take five samples in a row.
LEAST_SAMPLES: Final = 5

_READERS: Final[dict[str, Callable[[Path, str | None], Stored]]] = {
    ".npy": read_npy,
    ".npz": read_npz,
    ".exr": read_exr,
    **dict.fromkeys(IMAGE_SUFFIXES, read_image),
    **dict.fromkeys(GEOTIFF_SUFFIXES, read_geotiff),
    **dict.fromkeys(NETCDF_SUFFIXES, read_netcdf),
}


def load_heights(file: HeightFile) -> HeightGrid:
    """Load a height map: `scale * value + offset`, row 0 at the lowest y.

    Raises
    ------
    InputError
        If the file is missing, cannot be read, holds no two-dimensional array of finite numbers, or neither it nor the
        scene says where it lies.
    """
    stored = _READERS[suffix(file.file)](locate(file.file), file.key)
    _check(stored.values)
    origin, size = file.origin or stored.origin, file.size or stored.size
    if origin is None or size is None:
        raise InputError(f"expected origin and size, since {stored.unplaced}")
    values = stored.values[:: -1 if stored.top_row_first else 1, :: -1 if stored.right_column_first else 1]
    with np.errstate(over="ignore"):
        z = np.ascontiguousarray(values.astype(np.float64) * file.scale + file.offset)
    if not np.isfinite(z).all():
        raise InputError("expected finite heights, got an overflow from scale or offset")
    return HeightGrid(z, origin, size)


def _check(values: NDArray[Any]) -> None:
    """Raise `InputError` for what is no height map."""
    shape = "×".join(map(str, values.shape)) or "a single number"
    if values.ndim != 2:
        raise InputError(f"expected a two-dimensional array, got {shape}")
    if values.dtype.kind not in "iuf":
        raise InputError(f"expected real numbers, got an array of {values.dtype}")
    if min(values.shape) < LEAST_SAMPLES:
        raise InputError(f"expected at least {LEAST_SAMPLES}×{LEAST_SAMPLES} samples, got {shape}")
    faulty = np.argwhere(~np.isfinite(values))
    if len(faulty):
        row, column = faulty[0]
        raise InputError(
            f"expected finite heights, got {len(faulty)} that are NaN, infinite or without data, "
            f"the first at row {row}, column {column} of the file"
        )
