"""Numbers that the kernels' float32 can hold, and hold squared: others are refused before they become infinite."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from .errors import InputError

if TYPE_CHECKING:
    from .assets import Assets
    from .scene import Scene

LARGEST, SMALLEST = 1e18, 1e-18
"""Sizes whose squares float32 still holds."""

DIVISORS = frozenset(
    {
        "size",
        "cell",
        "step",
        "density",
        "radius",
        "samples_per_pixel",
        "photons_per_pixel",
        "footprint",
        "period",
        "wind_speed",
        "fetch",
        "loop",
    }
)
"""Keys by whose values something is divided: they must not be too small either."""

LIGHT = frozenset({"irradiance"})
"""Keys that scale the map, which would lose digits, and then its light, below float32's normal numbers; 0 is dark."""


def check_magnitudes(scene: Scene) -> None:
    """Refuse numbers outside float32's reach.

    Raises
    ------
    InputError
        With every such number, one a line, each with its path in the file.
    """
    faults = list(_faults(scene.model_dump(exclude_none=True), "", small=False))
    if faults:
        raise InputError("\n".join(faults))


def _faults(value: Any, path: str, small: bool) -> Iterator[str]:
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from _faults(item, f"{path}.{key}" if path else str(key), key in DIVISORS | LIGHT)
    elif isinstance(value, (list, tuple)):
        for i, item in enumerate(value):
            yield from _faults(item, f"{path}[{i}]", small)
    elif isinstance(value, float):
        if abs(value) > LARGEST:
            yield f"{path}: expected a number of size up to {LARGEST:g}, got {value:g}"
        elif small and 0.0 < abs(value) < SMALLEST:
            yield f"{path}: expected a number of at least {SMALLEST:g}, got {value:g}"


def check_asset_magnitudes(assets: Assets) -> None:
    """Refuse heights and vertices outside float32's reach; in float64 they are finite, and files may hold them.

    Raises
    ------
    InputError
        With every such file, one a line, by its key in the scene.
    """
    arrays: dict[str, np.ndarray] = {}
    for path, grid in (("water.height_map", assets.water), ("receiver.terrain", assets.terrain)):
        if grid is not None:
            arrays[path] = grid.z
    for path, mesh in (("receiver.mesh", assets.mesh), ("receiver.objects", assets.objects)):
        if mesh is not None:
            arrays[path] = mesh.vertices
    sizes = {path: float(np.abs(values).max()) for path, values in arrays.items()}
    faults = [
        f"{path}: expected coordinates of size up to {LARGEST:g} m, got {size:g} m"
        for path, size in sizes.items()
        if not size <= LARGEST
    ]
    if faults:
        raise InputError("\n".join(faults))
