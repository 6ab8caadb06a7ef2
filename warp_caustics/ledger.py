"""The energy ledger read back: from the kernels' bins to watts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .energy import Energy
from .kernels.ledger import ENTRIES

if TYPE_CHECKING:
    from .facts import Facts
    from .plan import Plan
    from .program import Program


def read_energy(plan: Plan, program: Program, ledgers: np.ndarray, caustic_map: np.ndarray, dry: np.ndarray) -> Energy:
    """Add up a frame's ledger.

    Parameters
    ----------
    plan : Plan
        The renderer's plan.
    program : Program
        Its program.
    ledgers : ndarray
        ``[lanes, entries * channels, bins]``, in fluxes of a cell at unit irradiance.
    caustic_map : ndarray
        The frame's map.
    dry : ndarray
        Irradiance on dry land, summed over pixels, by colour; empty without a shore.

    Returns
    -------
    Energy
        [W].
    """
    facts, lattice = plan.facts, program.lattice
    colours = len(facts.irradiance)
    pixel_area = float(np.prod(facts.pixel))
    cell = lattice.step**2 * pixel_area * facts.sun_share * np.asarray(facts.irradiance)
    sums = ledgers.sum(axis=(0, 2)).reshape(len(ENTRIES), -1) * np.ones((1, colours)) * cell
    entries = dict(zip(ENTRIES, sums, strict=True))
    landed = caustic_map.reshape(-1, colours).sum(axis=0, dtype=np.float64) * pixel_area
    entries["dry"] = dry[:colours] * pixel_area if len(dry) else np.zeros(colours)
    entries["received"] = landed - entries["dry"]
    entries["invented"] = np.zeros(colours)
    if not program.conserves:
        # What had no other fate arrived; the map's own sum is not the light that it got.
        entries["received"] = entries["emitted"] - sum(entries[name] for name in ENTRIES[1:] if name != "over_lit")
        entries["invented"] = landed - entries["dry"] - entries["received"]
    if plan.method == "gather":
        # The kernels book all that lands in the map.
        entries["missed_by_window"] = entries["missed_by_window"] - entries["received"]
    beyond = beyond_border(facts) * np.asarray(facts.irradiance)
    entries["emitted"] = entries["emitted"] + beyond
    entries["missed_by_window"] = entries["missed_by_window"] + beyond
    return Energy(**{name: _plain(value) for name, value in entries.items()})


def beyond_border(facts: Facts) -> float:
    """Light at unit irradiance that would light the map, were it at rest, from beyond the water's border [W]."""
    if facts.water_border is None:
        return 0.0
    low, high = facts.water_border
    total = 0.0
    for sun, shift in zip(facts.suns, facts.rest_shifts, strict=True):
        inside = np.minimum(high + shift, facts.scene.map.size) - np.maximum(low + shift, 0.0)
        missing = np.prod(facts.scene.map.size) - np.prod(np.maximum(inside, 0.0))
        total += -sun[2] * max(float(missing), 0.0)
    return total * facts.sun_share


def _plain(value: np.ndarray) -> float | np.ndarray:
    return float(value[0]) if len(value) == 1 else value
