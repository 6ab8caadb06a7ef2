"""A flip-book atlas: all frames of a loop in one picture with sides that are powers of two, as game engines take it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .capacity import SPARE_MEMORY
from .device import free_memory
from .errors import InputError

FLOAT_BYTES = 4


class FlipBook:
    """Frames laid left to right, then top to bottom, as one reads; cells that are left over stay black.

    Parameters
    ----------
    frames : int
        How many there are.
    resolution : (int, int)
        Columns and rows of one: powers of two.
    colours : int
        1 or 3.

    Attributes
    ----------
    grid : (int, int)
        Columns and rows of cells: as few as hold the frames, in the picture that is nearest to a square.
    image : ndarray
        float32 ``[rows, columns]`` or ``[rows, columns, 3]``, row 0 at the bottom, as of a map.

    Raises
    ------
    InputError
        If a frame's sides are no powers of two, so that no such picture is full of whole frames, or if it would not fit
        in memory.
    """

    def __init__(self, frames: int, resolution: Sequence[int], colours: int) -> None:
        if any(side & (side - 1) for side in resolution):
            fitting = [1 << round(np.log2(side)) for side in resolution]
            raise InputError(
                f"map.resolution: an atlas needs powers of two, got {list(resolution)}; the nearest are {fitting}"
            )
        self.frames, self.resolution = frames, tuple(resolution)
        self.grid = _grid(frames, resolution)
        columns, rows = (cells * side for cells, side in zip(self.grid, resolution, strict=True))
        needed, free = FLOAT_BYTES * columns * rows * colours, free_memory("cpu")
        if needed > SPARE_MEMORY * free:
            raise InputError(
                f"atlas: {frames} frames of {resolution[0]} x {resolution[1]} pixels take {needed:,} bytes, and "
                f"{free:,} are free; expected fewer frames, or a smaller map"
            )
        self.image = np.zeros((rows, columns) if colours == 1 else (rows, columns, colours), dtype=np.float32)

    def put(self, index: int, frame: np.ndarray) -> None:
        """Lay one frame, counted from 0, row 0 at its bottom, into its cell; refuse one of another size."""
        columns, rows = self.resolution
        if frame.shape[:2] != (rows, columns):
            raise InputError(f"atlas: holds maps of {columns} x {rows} pixels, got {frame.shape[1]} x {frame.shape[0]}")
        from_top, column = divmod(index, self.grid[0])
        bottom, left = (self.grid[1] - 1 - from_top) * rows, column * columns
        self.image[bottom : bottom + rows, left : left + columns] = frame


def _grid(frames: int, resolution: Sequence[int]) -> tuple[int, int]:
    """Columns and rows of cells, powers of two; of equally square pictures the wider one."""
    doublings = (frames - 1).bit_length()
    choices = [(1 << (doublings - i), 1 << i) for i in range(doublings + 1)]

    def out_of_square(grid: tuple[int, int]) -> float:
        return float(abs(np.log2(grid[0] * resolution[0] / (grid[1] * resolution[1]))))

    return min(choices, key=out_of_square)
