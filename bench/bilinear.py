"""The yardstick: a plain bilinear splat of given landing points, which what a deposit costs is measured in."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import warp as wp


@wp.kernel(enable_backward=False)
def bilinear_splat(
    x: wp.array[float],
    y: wp.array[float],
    flux: wp.array[float],
    columns: int,
    rows: int,
    map_out: wp.array[float],
):
    """One thread a photon; launch dim the photons; a tap that falls outside the map is dropped."""
    i = wp.tid()
    u = x[i] - 0.5
    v = y[i] - 0.5
    # Compared as floats first: a landing far away has no integer pixel.
    if not (u >= -1.0 and u < float(columns) and v >= -1.0 and v < float(rows)):
        return
    left = wp.floor(u)
    low = wp.floor(v)
    a = u - left
    b = v - low
    column = int(left)
    row = int(low)
    first = row * columns + column
    amount = flux[i]
    if row >= 0:
        if column >= 0:
            wp.atomic_add(map_out, first, amount * (1.0 - a) * (1.0 - b))
        if column < columns - 1:
            wp.atomic_add(map_out, first + 1, amount * a * (1.0 - b))
    if row < rows - 1:
        if column >= 0:
            wp.atomic_add(map_out, first + columns, amount * (1.0 - a) * b)
        if column < columns - 1:
            wp.atomic_add(map_out, first + columns + 1, amount * a * b)


def bilinear_plain(
    x: np.ndarray, y: np.ndarray, flux: np.ndarray, resolution: tuple[int, int], device: str, threads: int = 1
) -> tuple[Callable[[], None], Callable[[], np.ndarray]]:
    """Make a frame of the plain splat: fill, splat, and on several threads the sum of their maps.

    Parameters
    ----------
    x, y : array
        Landing points [pixels from the map's lower corner], of any one shape.
    flux : array
        Of the same shape.
    resolution : tuple of int
        Columns and rows.
    device : str
        ``"cpu"``, ``"cuda:0"``.
    threads : int
        On a CPU, each with a map of its own.

    Returns
    -------
    tuple of callable
        One that runs the frame and waits for it, one that reads back its float32 map ``[rows, columns]``.
    """
    columns, rows = resolution
    lanes = threads if device == "cpu" else 1
    planes = [np.array_split(np.asarray(plane, np.float32).ravel(), lanes) for plane in (x, y, flux)]
    maps = [wp.zeros(rows * columns, dtype=float, device=device) for _ in range(lanes)]
    views = [each.numpy() for each in maps] if device == "cpu" else []
    launches = []
    for lane, parts in enumerate(zip(*planes, strict=True)):
        inputs = [wp.array(part, dtype=float, device=device) for part in parts]
        launches.append(
            wp.launch(
                bilinear_splat,
                dim=len(parts[0]),
                inputs=[*inputs, columns, rows],
                outputs=[maps[lane]],
                device=device,
                record_cmd=True,
            )
        )
    pool = ThreadPoolExecutor(lanes) if lanes > 1 else None

    def work(lane: int) -> None:
        maps[lane].fill_(0.0)
        launches[lane].launch()

    def run() -> None:
        if pool is None:
            work(0)
        else:
            list(pool.map(work, range(lanes)))
            for view in views[1:]:
                np.add(views[0], view, out=views[0])
        wp.synchronize_device(device)

    return run, lambda: maps[0].numpy().reshape(rows, columns).copy()
