"""What a comparison was measured on and with: processor, versions, commit."""

from __future__ import annotations

import contextlib
import os
import platform
import re
import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import warp_caustics

PROJECT = "warp-caustics"
CPU_TABLE = Path("/proc/cpuinfo")
PACKAGES = {"warp": "warp-lang", "numpy": "numpy", "flip": "flip-evaluator"}
GIT_SECONDS = 10.0
"""A file system that does not answer must not hold up a comparison."""


def cpu_name() -> str:
    """Name the processor as its maker does, or at least its kind."""
    with contextlib.suppress(OSError):
        found = re.search(r"^model name\s*:\s*(.+)$", CPU_TABLE.read_text(encoding="utf-8"), re.MULTILINE)
        if found:
            return found[1].strip()
    return platform.processor() or platform.machine() or "unknown"


def cores() -> int:
    """Count the cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def device_name(device: str) -> str:
    """Name a device's hardware."""
    import warp as wp

    return cpu_name() if device == "cpu" else str(wp.get_device(device).name)


def versions() -> dict[str, str]:
    """Give the versions of what a figure depends on; packages that are not there are left out."""
    found = {"warp_caustics": warp_caustics.__version__, "python": platform.python_version()}
    for name, package in PACKAGES.items():
        with contextlib.suppress(PackageNotFoundError):
            found[name] = version(package)
    return found


def commit(root: Path = Path(__file__).parents[2]) -> str | None:
    """Name the commit if the package lies in a checkout of this project, ``-dirty`` if files have changed since.

    Parameters
    ----------
    root
        The folder that the package's folder lies in.

    Returns
    -------
    str or None
        None without a checkout, without git, or in a checkout of something else.
    """
    with contextlib.suppress(OSError, subprocess.SubprocessError):
        settings = root / "pyproject.toml"
        if (root / ".git").exists() and f'name = "{PROJECT}"' in settings.read_text(encoding="utf-8"):
            done = subprocess.run(
                ["git", "-C", str(root), "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*"],
                capture_output=True, text=True, check=True, timeout=GIT_SECONDS,
            )  # fmt: skip
            return done.stdout.strip() or None
    return None


def slug(device: str) -> str:
    """Name a device as a folder: its hardware's name in lower case, with the cores of a processor."""
    words = re.sub(r"\((r|tm)\)|\bcpu\b|\bprocessor\b|@.*$", " ", device_name(device).lower())
    name = re.sub(r"[^a-z0-9]+", "-", words).strip("-") or "unknown"
    return f"{name}-{cores()}-cores" if device == "cpu" else name
