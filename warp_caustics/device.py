"""Which device, how many threads, how much memory."""

from __future__ import annotations

import os
from pathlib import Path

from .errors import InputError

MEMORY_TABLE = Path("/proc/meminfo")


def resolve_device(name: str | None) -> str:
    """Name the device to use: the one asked for, or the best present.

    Raises
    ------
    InputError
        If it is not there, with those that are.
    """
    import warp as wp

    if name is None:
        return "cuda:0" if wp.is_cuda_available() else "cpu"
    present = [device.alias for device in wp.get_devices()]
    wanted = "cuda:0" if name == "cuda" else name
    if wanted not in present:
        raise InputError(f"device: there is no {name!r} here; expected one of {', '.join(present)}")
    return wanted


def resolve_threads(threads: int | None, device: str) -> int:
    """Count the threads to use: those asked for, or all cores; a GPU is driven by one.

    Raises
    ------
    InputError
        If it is not a whole number of at least 1.
    """
    if threads is not None and (not isinstance(threads, int) or isinstance(threads, bool) or threads < 1):
        raise InputError(f"threads: expected a whole number of at least 1, got {threads!r}")
    if device != "cpu":
        return 1
    if threads is not None:
        return threads
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def free_memory(device: str) -> int:
    """Bytes that can be allocated on a device."""
    import warp as wp

    if device != "cpu":
        return int(wp.get_device(device).free_memory)
    if MEMORY_TABLE.exists():
        for line in MEMORY_TABLE.read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return int(line.split()[1]) * 1024
    return int(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")) if hasattr(os, "sysconf") else 2**63 - 1
