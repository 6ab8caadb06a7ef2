"""One file per method: its passes in order, with their parameters.

A method is a function from the facts of a scene to a :class:`~warp_caustics.program.Program`, or to a
:class:`~warp_caustics.sequence.Sequence` where it follows no strips of a lattice. Adding one is adding a
file here and its line in :data:`METHODS`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from .area_ratio import area_ratio
from .beam import beam
from .cascaded import cascaded
from .differential import differential
from .gather import gather
from .pattern import pattern
from .photon import photon
from .sample import sample

if TYPE_CHECKING:
    from ..facts import Facts
    from ..program import Program
    from ..sequence import Sequence

METHODS: dict[str, Callable[[Facts], Program | Sequence]] = {
    "beam": beam,
    "photon": photon,
    "gather": gather,
    "cascaded": cascaded,
    "sample": sample,
    "pattern": pattern,
    "area_ratio": area_ratio,
    "differential": differential,
}
"""By name."""

DISPERSING = ("cascaded",)
"""Methods that disperse light themselves; all others that follow light are given a channel at a time."""
