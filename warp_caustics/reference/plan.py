"""What the reference does for a scene, in words."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from ..errors import InputError
from ..kernels.reference.cells import ARRIVED
from ..kernels.reference.ledger import BINS, ENTRIES
from ..program import MOST_WORK
from ..window import TOO_FAR
from .converge import first_work
from .roads import STRIP_CORNERS

if TYPE_CHECKING:
    from ..facts import Facts

DOUBLE = 8
"""Bytes of a float64."""

HOST_MAPS = 8
"""Maps of the levels before, and of their differences."""


@dataclass(frozen=True)
class ReferencePlan:
    """As :class:`~warp_caustics.Plan`, for levels that follow one another until they agree.

    Attributes
    ----------
    method, device : str
        By name.
    threads : int
        Lanes that strips are spread over.
    facts : Facts
        What follows from the scene.
    warnings : tuple of str
        What a user should know before trusting the map.
    """

    device: str
    threads: int
    facts: Facts
    warnings: tuple[str, ...]
    method: str = "reference"

    @property
    def kernels(self) -> tuple[str, ...]:
        """Names of the kernels that are compiled."""
        walk = ("reference_rays", "reference_cells")
        return (*walk, "reference_land") if self.facts.spec.shore else walk

    @property
    def bytes(self) -> int:
        """Bytes of a level's maps, ledgers and strips; meshes and height maps come on top."""
        columns, rows = self.facts.scene.map.resolution
        channels = self.facts.spec.channels
        lane = columns * rows * channels + len(ENTRIES) * channels * BINS + STRIP_CORNERS * (ARRIVED + channels)
        return (self.threads * lane + HOST_MAPS * columns * rows * channels) * DOUBLE

    def __str__(self) -> str:
        """Return the plan as text: kept, left out, why, bytes."""
        return "\n".join(self._lines())

    def _lines(self) -> Iterator[str]:
        settings, scene = self.facts.scene.method.reference, self.facts.scene
        yield (
            f"{scene.name}: method reference (tolerance = {settings.tolerance:g}, rays = {settings.rays}) "
            f"on {self.device}, {self.threads} thread(s)"
        )
        yield f"  map {scene.map.resolution[0]} x {scene.map.resolution[1]} pixels, float64"
        yield "  each level twice as fine along a side as the one before, until two of them agree or rays run out"
        for kept in (True, False):
            yield "kept" if kept else "left out"
            for reason in self.facts.reasons:
                if reason.kept == kept:
                    yield f"  {reason.what:<28}{reason.why}"
        yield f"{len(self.kernels)} kernels ({', '.join(self.kernels)}), {self.bytes:,} bytes"
        for warning in self.warnings:
            yield f"warning: {warning}"


def plan_reference(facts: Facts, device: str, threads: int, free: int) -> ReferencePlan:
    """Plan the reference of a scene, where there is the time and the memory for it.

    Raises
    ------
    InputError
        If its first levels would take days, or its maps more than the ``free`` bytes.
    """
    work, plan = first_work(facts), ReferencePlan(device, threads, facts, facts.warnings)
    if work > MOST_WORK:
        raise InputError(
            f"method.reference: its first levels take {work:,} rays, and {MOST_WORK:,} are what can be gone through; "
            f"{TOO_FAR}"
        )
    if plan.bytes > free:
        raise InputError(
            f"map: {facts.scene.map.resolution[0]} x {facts.scene.map.resolution[1]} pixels by method reference take "
            f"{plan.bytes:,} bytes, and {device} has {free:,} free; lower map.resolution or threads"
        )
    if work > facts.scene.method.reference.rays:
        note = f"method.reference: its first levels take {work:,} rays, more than method.reference.rays"
        return replace(plan, warnings=(*plan.warnings, note))
    return plan
