"""Numbers that the kernels' float32 can hold, and hold squared: others are refused before they become infinite."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from .errors import InputError

if TYPE_CHECKING:
    from .scene import Scene

LARGEST, SMALLEST = 1e18, 1e-18
"""Sizes whose squares float32 still holds."""

DIVISORS = frozenset({"size", "samples_per_pixel", "photons_per_pixel", "footprint"})
"""Keys by whose values something is divided: they must not be too small either."""


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
            yield from _faults(item, f"{path}.{key}" if path else str(key), key in DIVISORS)
    elif isinstance(value, (list, tuple)):
        for i, item in enumerate(value):
            yield from _faults(item, f"{path}[{i}]", small)
    elif isinstance(value, float):
        if abs(value) > LARGEST:
            yield f"{path}: expected a number of size up to {LARGEST:g}, got {value:g}"
        elif small and abs(value) < SMALLEST:
            yield f"{path}: expected a number of at least {SMALLEST:g}, got {value:g}"
