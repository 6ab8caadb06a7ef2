"""A ladder: the same sum by several kernels, from the published form to the fastest, checked before they are timed."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from time import perf_counter

import numpy as np

LEAST_SECONDS, LEAST_FRAMES, MOST_FRAMES = 1.0, 3, 50
"""A rung is timed for so long, within these counts of frames; its median counts."""


@dataclass(frozen=True)
class Rung:
    """One form of a sum.

    Attributes
    ----------
    ladder, name : str
        Which sum, and which form of it.
    make : callable
        Threads to a frame that is ready to run: two callables, one that runs it, one that reads its map back.
        None where this device cannot run it.
    traffic : int
        Bytes that a frame reads and writes at the least, each array once.
    bytes : int
        Of its buffers, on one thread.
    tolerance : float
        Relative L2 distance from the ladder's first rung at most: it is refused beyond. Infinite for another sum, which
        stands beside the ladder as its measure.
    accuracy : callable or None
        Gives the relative L2 error against the reference, on a map of its own.
    """

    ladder: str
    name: str
    make: Callable[[int], tuple[Callable[[], None], Callable[[], np.ndarray]]] | None
    traffic: int
    bytes: int
    tolerance: float = 1e-5
    accuracy: Callable[[], float] | None = None


@dataclass(frozen=True)
class Timed:
    """A rung as measured on one device with one count of threads.

    Attributes
    ----------
    rung : Rung
        What was timed.
    threads : int
        On a CPU.
    seconds : float
        Median of its frames.
    ratio : float
        Seconds of the ladder's first rung, on as many threads, over its own.
    error : float
        Relative L2 distance from the first rung.
    share : float
        Of the floor: the time that its traffic takes by a copy, over its own.
    truth : float or None
        Relative L2 error against the reference, where it was asked for.
    """

    rung: Rung
    threads: int
    seconds: float
    ratio: float
    error: float
    share: float
    truth: float | None = None


def measure(rungs: Iterable[Rung], threads: int, bandwidth: float) -> list[Timed]:
    """Check and time a ladder; its first rung is the published form.

    Raises
    ------
    RuntimeError
        If a rung's sum is not that of the first.
    """
    timed: list[Timed] = []
    first: np.ndarray | None = None
    for rung in rungs:
        if rung.make is None:
            continue
        run, read = rung.make(threads)
        run()
        values = read().astype(np.float64)
        first = values if first is None else first
        error = float(np.linalg.norm(values - first) / np.linalg.norm(first))
        if not error <= rung.tolerance:
            raise RuntimeError(f"{rung.ladder}, {rung.name}: {error:.1e} from the first rung, over {rung.tolerance}")
        seconds = median_seconds(run)
        ratio = (timed[0].seconds if timed else seconds) / seconds
        timed.append(Timed(rung, threads, seconds, ratio, error, rung.traffic / bandwidth / seconds))
    return timed


def median_seconds(run: Callable[[], None]) -> float:
    """Time a warm frame; ``run`` must have been called before, and wait for what it starts."""
    samples: list[float] = []
    while len(samples) < LEAST_FRAMES or (sum(samples) < LEAST_SECONDS and len(samples) < MOST_FRAMES):
        start = perf_counter()
        run()
        samples.append(perf_counter() - start)
    return statistics.median(samples)
