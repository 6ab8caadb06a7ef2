"""The memory's copy bandwidth: the floor under a pass that does little arithmetic, measured in the same run."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from time import perf_counter

import numpy as np
import warp as wp

CPU_BYTES, CUDA_BYTES = 2**28, 2**30
"""Bytes that are copied: more than the last level of cache, so that memory is measured."""

REPEATS = 5
"""Copies timed; the fastest counts, since whatever else runs can only slow one down."""


def copy_bandwidth(device: str, threads: int = 1) -> float:
    """Measure how fast memory is copied.

    Parameters
    ----------
    device : str
        ``"cpu"``, ``"cuda:0"``.
    threads : int
        That copy side by side, on a CPU.

    Returns
    -------
    float
        Bytes read and written per second.
    """
    if device == "cpu":
        return _cpu_bandwidth(threads)
    source = wp.zeros(CUDA_BYTES, dtype=wp.uint8, device=device)
    target = wp.empty_like(source)
    best = float("inf")
    for _ in range(REPEATS + 1):
        with wp.ScopedTimer("copy", print=False, synchronize=True, cuda_filter=wp.TIMING_MEMCPY) as timer:
            wp.copy(target, source)
        best = min(best, *(1e-3 * each.elapsed for each in timer.timing_results))
    return 2.0 * CUDA_BYTES / best


def _cpu_bandwidth(threads: int) -> float:
    source = np.ones((threads, CPU_BYTES // threads), dtype=np.uint8)
    target = np.zeros_like(source)
    best = float("inf")
    with ThreadPoolExecutor(threads) as pool:
        for _ in range(REPEATS):
            start = perf_counter()
            list(pool.map(np.copyto, target, source))
            best = min(best, perf_counter() - start)
    return 2.0 * source.nbytes / best
