"""Height maps from GeoTIFF, through rasterio (the extra `geotiff`)."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from warp_caustics.assets.stored import Stored
from warp_caustics.errors import InputError


def read_geotiff(path: Path, key: str | None) -> Stored:
    """Read the only band of a GeoTIFF; cells without data become NaN."""
    try:
        import rasterio
    except ImportError:
        raise InputError('reading GeoTIFF needs rasterio: pip install "warp-caustics[geotiff]"') from None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)  # said by `unplaced`
            with rasterio.open(path) as dataset:
                if dataset.count != 1:
                    raise InputError(f"{path}: expected one band, got {dataset.count}")
                values = dataset.read(1, masked=True)
                transform, crs = dataset.transform, dataset.crs
    except (rasterio.errors.RasterioError, OSError, MemoryError) as error:
        raise InputError(f"{path}: cannot be read as GeoTIFF: {error}") from None
    if np.ma.is_masked(values):
        values = values.astype(np.float64).filled(np.nan)
    return _placed(path, np.asarray(values), transform, crs)


def _placed(path: Path, values: Any, transform: Any, crs: Any) -> Stored:
    """Return the values with their place on the ground, if the file gives it in metres."""
    if transform.b or transform.d:
        raise InputError(f"{path}: expected rows along x, got a raster that is turned")
    if transform.is_identity and crs is None:
        return Stored(values, top_row_first=True)  # a plain image
    stored = Stored(values, top_row_first=transform.e < 0.0, right_column_first=transform.a < 0.0)
    if crs is not None and crs.is_geographic:
        return replace(stored, unplaced="the file's coordinates are degrees")
    if crs is not None and crs.linear_units_factor[1] != 1.0:
        return replace(stored, unplaced=f"the file's coordinates are in {crs.linear_units}")
    rows, columns = values.shape
    x, y = (transform.c, transform.c + columns * transform.a), (transform.f, transform.f + rows * transform.e)
    return replace(stored, origin=(min(x), min(y)), size=(max(x) - min(x), max(y) - min(y)))
