"""One file per method: its passes in order, with their parameters.

A method is a function from the facts of a scene to a :class:`~warp_caustics.program.Program`, or to a
:class:`~warp_caustics.sequence.Sequence` where it follows no strips of a lattice. Adding one is adding a
file here, with a function of its name, and its name in :data:`NAMES`.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..facts import Facts
    from ..program import Program
    from ..sequence import Sequence

NAMES = ("beam", "photon", "gather", "cascaded", "sample", "pattern", "area_ratio", "differential")
"""Of the methods, and of their files."""

DISPERSING = ("cascaded",)
"""Methods that disperse light themselves; all others that follow light are given a channel at a time."""


def _planner(name: str) -> Callable[[Facts], Program | Sequence]:
    """Plan by a method; its file, and the kernels that it names, are read when it is first asked for."""

    def plan(facts: Facts) -> Program | Sequence:
        planned: Program | Sequence = getattr(import_module(f".{name}", __package__), name)(facts)
        return planned

    return plan


METHODS: dict[str, Callable[[Facts], Program | Sequence]] = {name: _planner(name) for name in NAMES}
"""By name."""
