"""Converged references kept on disk, since making them takes a minute or two."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from oracle.surfaces import Array

STORE = Path(__file__).with_name("references.npz")
FIGURES = "figures"  # the key of the figures, beside one array for each case


@dataclass(frozen=True)
class StoredReference:
    """A converged map and what is known about it.

    Attributes
    ----------
    caustic_map : array [rows, columns] or [rows, columns, 3]
        Flux per horizontal area, rounded to float32 on its way to disk.
    energy : dict of float, or lists of 3
        As in ``Reference``.
    error : float
        Estimated relative L2 error.
    ideal_error : (float, float)
        Relative L2 error of unrefined triangles at one cell a pixel, cut along the rising and the falling diagonal.
    """

    caustic_map: Array
    energy: dict[str, Any]
    error: float
    ideal_error: tuple[float, float]


def save_references(references: Mapping[str, StoredReference], path: Path = STORE) -> None:
    """Write references to one compressed file."""
    figures = {
        name: {"energy": r.energy, "error": r.error, "ideal_error": r.ideal_error} for name, r in references.items()
    }
    maps = {name: np.float32(r.caustic_map) for name, r in references.items()}
    np.savez_compressed(path, allow_pickle=False, **maps, **{FIGURES: np.array(json.dumps(figures))})


@cache
def load_reference(name: str) -> StoredReference:
    """Read the converged reference of a case by its name; KeyError where there is none."""
    with np.load(STORE) as stored:
        figures = json.loads(str(stored[FIGURES]))[name]
        image = stored[name].astype(np.float64)
    image.flags.writeable = False  # shared by all who ask
    return StoredReference(image, figures["energy"], figures["error"], tuple(figures["ideal_error"]))
