"""References on disk, by the content of what they answer: a scene, its files, a time, a tolerance and this code."""

from __future__ import annotations

import contextlib
import hashlib
import os
import zipfile
from collections.abc import Iterable
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..energy import Energy
from ..errors import WarpCausticsError
from ..files import whole_file
from ..kernels import reference as device_code

if TYPE_CHECKING:
    from ..facts import Facts
    from .converge import Budget

FOLDER_VARIABLE = "WARP_CAUSTICS_CACHE"
"""Environment variable that names another folder."""

SOURCES = (Path(__file__).resolve().parent, Path(str(device_code.__file__)).resolve().parent)
"""Folders of the code that makes a reference."""

LEFT_OUT = {"name", "camera", "method"}
"""Tables of a scene that a caustic map does not depend on."""


def cache_folder() -> Path:
    """Folder of the cache: the environment's, or the user's own for this platform."""
    named = os.environ.get(FOLDER_VARIABLE)
    if named:
        return Path(named)
    from platformdirs import user_cache_path

    return user_cache_path("warp-caustics")


def key(facts: Facts, time: float, budget: Budget) -> str:
    """Name an answer by all that it follows from."""
    digest = hashlib.sha256()
    for part in _content(facts, time, budget):
        digest.update(len(part).to_bytes(8, "little") + part)
    return digest.hexdigest()


def load(name: str) -> dict[str, np.ndarray] | None:
    """Read an answer; None where there is none, or none that is whole."""
    path = cache_folder() / f"{name}.npz"
    try:
        with np.load(path, allow_pickle=False) as stored:
            return {entry: stored[entry] for entry in stored.files}
    except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile):
        return None


def store(name: str, values: dict[str, np.ndarray]) -> None:
    """Write an answer, whole or not at all; a cache that cannot be written is done without."""
    folder = cache_folder()
    with contextlib.suppress(OSError, WarpCausticsError):
        folder.mkdir(parents=True, exist_ok=True)
        with whole_file(folder / f"{name}.npz") as path:
            np.savez_compressed(path, **values)  # type: ignore[arg-type]


def pack_energy(energy: Energy) -> dict[str, np.ndarray]:
    """The ledger as arrays."""
    return {f"energy_{name}": np.asarray(energy[name]) for name in energy}


def unpack_energy(values: dict[str, np.ndarray]) -> Energy:
    """The ledger from arrays."""
    entries = {field.name: values[f"energy_{field.name}"] for field in fields(Energy)}
    return Energy(**{name: float(value) if value.ndim == 0 else value for name, value in entries.items()})


def _content(facts: Facts, time: float, budget: Budget) -> Iterable[bytes]:
    scene = facts.scene.model_dump(exclude_none=True)
    yield repr(sorted((name, table) for name, table in scene.items() if name not in LEFT_OUT)).encode()
    yield repr((float(time), budget)).encode()
    for asset in vars(facts.assets).values():
        if is_dataclass(asset):
            for field in fields(asset):
                yield np.ascontiguousarray(getattr(asset, field.name)).tobytes()
    for folder in SOURCES:
        for path in sorted(folder.glob("*.py")):
            yield path.read_bytes()
