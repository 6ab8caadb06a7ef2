"""Height maps from NetCDF, through xarray (the extra `netcdf`)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_caustics.assets.arrays import chosen
from warp_caustics.assets.stored import Stored
from warp_caustics.errors import InputError

_METRES = ("", "m", "meter", "meters", "metre", "metres")
_LONGITUDE_LATITUDE = ("lon", "lat", "longitude", "latitude")
#: What a dimension along x is called, by its name, its standard name or its axis (CF conventions, section 4).
_ALONG_X = ("x", "lon", "longitude", "easting", "projection_x_coordinate", "grid_longitude")
#: Coordinates are even when each step is the mean step to this part of it, beside the rounding of their own type.
_EVEN = 1e-3


def read_netcdf(path: Path, key: str | None) -> Stored:
    """Read a variable of two dimensions; missing values become NaN."""
    try:
        import xarray

        with xarray.open_dataset(path, decode_times=False) as dataset:
            flat = [str(name) for name, each in dataset.data_vars.items() if each.squeeze().ndim == 2]
            named = [str(name) for name in dataset.data_vars] if key is not None else flat
            variable = dataset[chosen(key, named, "variable")].squeeze().load()
    except ImportError:  # of xarray, or of the library beneath it that knows the format
        raise InputError('reading NetCDF needs xarray and netCDF4: pip install "warp-caustics[netcdf]"') from None
    except InputError:
        raise
    except (ValueError, OSError, RuntimeError, KeyError, MemoryError) as error:
        raise InputError(f"{path}: cannot be read as NetCDF: {error}") from None
    if variable.ndim != 2:
        return Stored(variable.values, top_row_first=False)  # refused by whoever checks the shape
    if _names(variable, 0) & set(_ALONG_X):
        variable = variable.transpose()
    return _placed(path, variable)


def _placed(path: Path, variable: Any) -> Stored:
    """Return a variable [y, x] with its place on the ground, if its coordinates are metres."""
    values = variable.values
    if not all(name in variable.coords for name in variable.dims):
        return Stored(values, top_row_first=False)
    y, x = (np.asarray(variable.coords[name].values) for name in variable.dims)
    stored = Stored(values, top_row_first=bool(y[0] > y[-1]), right_column_first=bool(x[0] > x[-1]))
    for axis, name in enumerate(variable.dims):
        units = str(variable.coords[name].attrs.get("units", ""))
        if units.startswith("degree") or _names(variable, axis) & set(_LONGITUDE_LATITUDE):
            return replace(stored, unplaced="the file's coordinates are degrees")
        if units not in _METRES:
            return replace(stored, unplaced=f"the file's coordinates are in {units}")
    left, width = _extent(path, x, variable.dims[1])
    low, height = _extent(path, y, variable.dims[0])
    return replace(stored, origin=(left, low), size=(width, height))


def _extent(path: Path, centres: NDArray[Any], name: Any) -> tuple[float, float]:
    """Return lower end and length of the cells around evenly spaced centres [m]."""
    if centres.dtype.kind not in "iuf" or len(centres) < 2:
        raise InputError(f'{path}: expected two or more numbers for the coordinate "{name}"')
    at = centres.astype(np.float64)
    steps = np.diff(at)
    step = abs(at[-1] - at[0]) / len(steps)
    rounding = np.finfo(centres.dtype).eps * np.abs(at).max() if centres.dtype.kind == "f" else 0.0
    if not np.all(np.abs(np.abs(steps) - step) <= _EVEN * step + 2.0 * rounding) or not np.isfinite(step):
        raise InputError(f'{path}: expected an evenly spaced coordinate "{name}"')
    return float(at.min() - step / 2.0), float(step * len(at))


def _names(variable: Any, axis: int) -> set[str]:
    """Return all that a dimension is called, in lower case."""
    dimension = variable.dims[axis]
    attributes = variable.coords[dimension].attrs if dimension in variable.coords else {}
    names = (dimension, attributes.get("standard_name", ""), attributes.get("axis", ""))
    return {str(name).lower() for name in names}
