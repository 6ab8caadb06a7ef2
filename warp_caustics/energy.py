"""The energy ledger of a frame, in watts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields

import numpy as np


@dataclass(frozen=True)
class Energy(Mapping[str, "float | np.ndarray"]):
    """Where the light of a frame went [W]: a number, or ``[3]`` for a scene in colour.

    ``emitted = received + reflected + absorbed + outside_map + left_water + blocked + missed_by_window + dropped``.
    Beside the sum stand ``dry``, ``over_lit`` and ``invented``: the map holds ``received + dry + invented``. It is a
    mapping, too: ``energy["received"]``.

    Attributes
    ----------
    emitted
        Falls on the water's lit side within the window of water that can light the map.
    received
        Lands in the map, under water.
    reflected
        Thrown back at the surface (Fresnel).
    absorbed
        Taken by the water on the way.
    outside_map
        Lands beside the map.
    left_water
        Meets the surface from below, or passes the receiver by.
    blocked
        Falls in the shadow of a crest, of land or of an object.
    missed_by_window
        Lands in the map, but from water outside a gather's window; or would have come, were it at rest, from beyond
        the border of the water, of a height map or a basin.
    dropped
        Had no finite path.
    dry
        Falls straight on dry land in the map.
    over_lit
        Lights a second time what a crest has taken already, because shadows are off.
    invented
        Is in the map and came from nowhere, or came and is not in the map (below 0): of a method whose brightness is a
        ratio of areas and no sum of light. 0 for all others.
    """

    emitted: float | np.ndarray
    received: float | np.ndarray
    reflected: float | np.ndarray
    absorbed: float | np.ndarray
    outside_map: float | np.ndarray
    left_water: float | np.ndarray
    blocked: float | np.ndarray
    missed_by_window: float | np.ndarray
    dropped: float | np.ndarray
    dry: float | np.ndarray
    over_lit: float | np.ndarray
    invented: float | np.ndarray = 0.0

    def __getitem__(self, name: str) -> float | np.ndarray:
        """Give an entry by its name."""
        if name not in self.__dataclass_fields__:
            raise KeyError(name)
        value: float | np.ndarray = getattr(self, name)
        return value

    def __iter__(self) -> Iterator[str]:
        """Give the names, in order."""
        return (field.name for field in fields(self))

    def __len__(self) -> int:
        """Count the entries."""
        return len(fields(self))

    @property
    def unaccounted(self) -> float:
        """What the ledger fails to add up by, as a share of what was emitted; rounding, if all is well."""
        spent = sum(
            np.asarray(self[name])
            for name in self
            if name not in ("emitted", "dry", "over_lit", "invented")
        )  # fmt: skip
        emitted = np.asarray(self.emitted)
        worst = np.max(np.abs(emitted - spent))
        scale = np.max(np.abs(emitted))
        return float(worst / scale) if scale > 0.0 else float(worst)
