"""Heights as a file holds them, before they are checked, turned, placed and scaled."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Stored:
    """What a reader found.

    Attributes
    ----------
    values
        The array in the file's own order and type; NaN where the file marks a value as missing.
    top_row_first
        Whether the first row is the one of highest y.
    right_column_first
        Whether the first column is the one of highest x.
    origin, size
        Lower corner and extent of all samples' cells [m], when the file says them in metres.
    unplaced
        Otherwise, why not.
    """

    values: NDArray[Any]
    top_row_first: bool
    right_column_first: bool = False
    origin: tuple[float, float] | None = None
    size: tuple[float, float] | None = None
    unplaced: str = "the file does not say where it lies"
