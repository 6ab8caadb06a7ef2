"""The peak of arithmetic: single-precision multiply-adds a second, measured in the same run."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from time import perf_counter

import warp as wp

from ..kernels.multiply_add import CHAINS, multiply_add

CPU_STEPS, CUDA_STEPS = 2**19, 2**11
"""Steps of each chain: some milliseconds."""

CUDA_THREADS = 2**18
"""More than a GPU holds at once."""

REPEATS = 5
"""Runs timed; the fastest counts, since whatever else runs can only slow one down."""


def peak_operations(device: str, threads: int = 1) -> float:
    """Measure how many floating-point operations a device does a second, at best.

    A multiply-add is two. What is measured is what Warp's compiler makes of a loop that it can vectorise: within some
    percent of what the hardware can do, and many times what code of one number at a time reaches.

    Parameters
    ----------
    device : str
        ``"cpu"``, ``"cuda:0"``.
    threads : int
        That work side by side, on a CPU.
    """
    count, steps = (1, CPU_STEPS) if device == "cpu" else (CUDA_THREADS, CUDA_STEPS)
    launches = [
        wp.launch(multiply_add, dim=count, inputs=[steps], outputs=[wp.empty(count, dtype=float, device=device)],
                  device=device, record_cmd=True)
        for _ in range(threads)
    ]  # fmt: skip
    best = float("inf")
    with ThreadPoolExecutor(threads) as pool:
        for _ in range(REPEATS):
            wp.synchronize_device(device)
            start = perf_counter()
            list(pool.map(lambda launch: launch.launch(), launches))
            wp.synchronize_device(device)
            best = min(best, perf_counter() - start)
    return 2.0 * CHAINS * steps * count * threads / best
