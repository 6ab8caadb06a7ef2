"""References on disk, by the content of what they answer: a scene, its files, a time, a tolerance and this code."""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import warp_caustics

from .. import kernels as device_code
from ..energy import Energy
from ..errors import WarpCausticsError
from ..files import whole_file

if TYPE_CHECKING:
    from ..facts import Facts
    from . import Reference
    from .converge import Budget

FOLDER_VARIABLE = "WARP_CAUSTICS_CACHE"
"""Environment variable that names another folder."""

PACKAGE, KERNELS = (Path(str(package.__file__)).resolve().parent for package in (warp_caustics, device_code))
SOURCES = (
    *(PACKAGE / folder for folder in ("reference", "simulation", "assets", "scene")), KERNELS / "reference",
    *(PACKAGE / f"{name}.py" for name in ("facts", "height_map", "ledger", "metrics", "receiver", "specify", "sun",
                                          "water", "window")),
    *(KERNELS / f"{name}.py" for name in ("fft", "height_field", "spec", "spectral")),
)  # fmt: skip
"""The code that an answer follows from: a method that is being tuned does not cost another reference."""

NUMBERS = ("error_bar", "samples", "seconds")
"""Fields of an answer that are single numbers."""

PATHS = {"file", "mesh"}
"""Keys that name files, of which the content counts."""

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


def load(name: str) -> dict[str, Any] | None:
    """Read the fields of an answer; None where there is none, or none that is whole."""
    path = cache_folder() / f"{name}.npz"
    try:
        with np.load(path, allow_pickle=False) as stored:
            values = {entry: stored[entry] for entry in stored.files}
        entries = {field.name: values[f"energy_{field.name}"] for field in fields(Energy)}
        return {
            "caustic_map": values["caustic_map"],
            "energy": Energy(**{key: float(value) if value.ndim == 0 else value for key, value in entries.items()}),
            **{key: float(values[key]) for key in NUMBERS},
            "notes": tuple(str(note) for note in values["notes"]),
        }
    except Exception:  # a spoiled archive raises what its bytes happen to spell: it is made again
        return None


def store(name: str, made: Reference) -> None:
    """Write an answer, whole or not at all; a cache that cannot be written is done without."""
    folder = cache_folder()
    values = {
        "caustic_map": made.caustic_map,
        **{f"energy_{entry}": np.asarray(made.energy[entry]) for entry in made.energy},
        **{key: np.asarray(getattr(made, key)) for key in NUMBERS},
        "notes": np.asarray(made.notes, dtype=str),
    }
    with contextlib.suppress(OSError, WarpCausticsError):
        folder.mkdir(parents=True, exist_ok=True)
        with whole_file(folder / f"{name}.npz") as path:
            np.savez_compressed(path, **values)  # type: ignore[arg-type]


def _content(facts: Facts, time: float, budget: Budget) -> Iterable[bytes]:
    scene = facts.scene.model_dump(exclude_none=True)
    yield repr(_without_paths({name: table for name, table in scene.items() if name not in LEFT_OUT})).encode()
    yield repr((float(time), budget)).encode()
    for name, asset in vars(facts.assets).items():
        if is_dataclass(asset):
            for field in fields(asset):
                value = np.ascontiguousarray(getattr(asset, field.name))
                yield f"{name}.{field.name} {value.dtype.str} {value.shape}".encode()
                yield value.tobytes()
    for source in SOURCES:
        for path in sorted(source.glob("*.py")) if source.is_dir() else [source]:
            yield path.read_bytes()


def _without_paths(value: Any) -> Any:
    if isinstance(value, Mapping):
        return sorted((key, _without_paths(item)) for key, item in value.items() if key not in PATHS)
    return [_without_paths(item) for item in value] if isinstance(value, (list, tuple)) else value
