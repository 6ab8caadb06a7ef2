"""Photons that have landed, and a frame that splats them: the maps of its threads, what it launches, their sum."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import warp as wp

from warp_caustics.kernels.deposit import ACCUMULATOR, FLUX, unit


class Command(Protocol):
    """Something that a frame launches."""

    def launch(self) -> None:
        """Start it."""


@dataclass(frozen=True)
class Landed:
    """Photons on a device, and the map that they land on.

    Attributes
    ----------
    x, y : wp.array
        Landing points [pixels from the map's lower corner], float32 ``[photons]``.
    flux : wp.array
        Vectors of one or three channels, ``[photons]``.
    width : float
        Of a photon's box [pixels]; 0 is a point.
    most : float
        Bound of a photon's flux in any channel, a power of two.
    resolution : tuple of int
        Columns and rows.
    channels : int
        1 or 3.
    accumulate : str
        As ``method.accumulate`` of a scene.
    """

    x: wp.array
    y: wp.array
    flux: wp.array
    width: float
    most: float
    resolution: tuple[int, int]
    channels: int
    accumulate: str

    @property
    def count(self) -> int:
        """Photons."""
        return self.x.shape[0]

    @property
    def device(self) -> str:
        """Where they are."""
        return str(self.x.device)

    @property
    def map_size(self) -> int:
        """Elements of a map."""
        return self.resolution[0] * self.resolution[1] * self.channels


def land(
    x: np.ndarray,
    y: np.ndarray,
    flux: np.ndarray,
    resolution: tuple[int, int],
    device: str,
    width: float = 1.0,
    accumulate: str = "float32",
) -> Landed:
    """Put photons on a device; ``flux`` is ``[photons]`` or ``[photons, 3]``."""
    flux = np.asarray(flux, np.float32).reshape(len(x), -1)
    most = float(2.0 ** np.ceil(np.log2(flux.max())))
    return Landed(
        wp.array(np.asarray(x, np.float32), dtype=float, device=device),
        wp.array(np.asarray(y, np.float32), dtype=float, device=device),
        wp.array(flux, dtype=FLUX[flux.shape[1]], device=device),
        width, most, resolution, flux.shape[1], accumulate,
    )  # fmt: skip


Form = Callable[[Landed, wp.array], Sequence[Command]]
"""What a form of the splat does: photons and a map of zeros to the launches that add them to it."""


def record(kernel: Any, dim: Any, inputs: Sequence[Any], outputs: Sequence[Any], device: str, **more: Any) -> Command:
    """Record a launch."""
    return wp.launch(kernel, dim=dim, inputs=inputs, outputs=outputs, device=device, record_cmd=True, **more)


@dataclass(frozen=True)
class Fill:
    """Zeros for an array."""

    array: wp.array

    def launch(self) -> None:
        """Start it."""
        self.array.zero_()


def make_frame(form: Form, bands: Sequence[Landed]) -> tuple[Callable[[], None], Callable[[], np.ndarray]]:
    """Make a frame that splats bands of photons side by side, each on a map of its own, and adds these up.

    Forms whose kernels hold tiles take one band alone on a CPU, where Warp keeps the tiles of all threads in one place.

    Returns
    -------
    tuple of callable
        One that runs the frame and waits for it, one that reads its map, ``[rows, columns, channels]``.
    """
    first = bands[0]
    device, dtype = first.device, ACCUMULATOR[first.accumulate]
    maps = [wp.zeros(first.map_size, dtype=dtype, device=device) for _ in bands]
    lanes = [[Fill(each), *form(band, each)] for band, each in zip(bands, maps, strict=True)]
    views = [each.numpy() for each in maps] if device == "cpu" else []
    pool = ThreadPoolExecutor(len(bands)) if len(bands) > 1 else None

    def work(lane: Sequence[Command]) -> None:
        for command in lane:
            command.launch()

    def run() -> None:
        if pool is None:
            work(lanes[0])
        else:
            list(pool.map(work, lanes))
            for view in views[1:]:
                np.add(views[0], view, out=views[0])
        wp.synchronize_device(device)

    columns, rows = first.resolution
    scale = unit(first.accumulate)
    return run, lambda: maps[0].numpy().reshape(rows, columns, first.channels) * scale
