"""Traced dispersion in plan view: each channel's light is followed by itself, at its own index of refraction.

So every method that follows light has it unchanged, and a scene without it pays nothing. The index differs by 0.6 %
from red to blue (Quan & Fry 1995): less than the sun's own blur at noon, and millimetres per metre under a low sun.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from .energy import Energy
from .errors import InputError

if TYPE_CHECKING:
    from .facts import Facts
    from .plan import Plan
    from .scene import Scene
    from .specify import Reason

CHANNELS = ("red", "green", "blue")

LEAST_IOR = 1.0
"""Of water in air: with less, no channel would refract as water does."""


def channel_scene(scene: Scene, channel: int) -> Scene:
    """Return the scene as one channel sees it: its own index, absorption and irradiance.

    Raises
    ------
    InputError
        If the strength of the dispersion takes the channel's index to that of air, or below.
    """
    medium, sun = scene.medium, scene.sun
    ior = medium.dispersed_ior[channel]
    if not ior > LEAST_IOR:
        raise InputError(
            f"medium.dispersion_strength: {medium.dispersion_strength:g} gives {CHANNELS[channel]} an index of "
            f"{ior:.4g}; expected a strength that leaves it above {LEAST_IOR:g}"
        )
    changed: dict[str, Any] = {"ior": ior, "dispersion": "none", "dispersion_strength": 1.0}
    if isinstance(medium.absorption, tuple):
        changed["absorption"] = medium.absorption[channel]
    if isinstance(sun.irradiance, tuple):
        sun = sun.model_copy(update={"irradiance": sun.irradiance[channel]})
    return scene.model_copy(update={"medium": medium.model_copy(update=changed), "sun": sun})


def own_channel(values: np.ndarray, channel: int) -> np.ndarray:
    """Take a channel of values that have it last, or that are one channel's already."""
    return np.asarray(values[..., channel if values.shape[-1] == len(CHANNELS) else 0])


def stacked_energy(energies: list[Energy]) -> Energy:
    """Join the ledgers of the channels [W]."""
    return Energy(
        **{
            field.name: np.array([own_channel(np.atleast_1d(one[field.name]), c) for c, one in enumerate(energies)])
            for field in fields(Energy)
        }
    )


@dataclass(frozen=True)
class DispersedPlan:
    """As :class:`~warp_caustics.Plan`, for three channels that are each planned by themselves.

    Attributes
    ----------
    facts : Facts
        Of the scene in colour.
    plans : tuple of Plan
        Of red, green and blue.
    """

    facts: Facts
    plans: tuple[Plan, Plan, Plan]

    @property
    def method(self) -> str:
        """By name."""
        return self.plans[0].method

    @property
    def device(self) -> str:
        """By Warp's name."""
        return self.plans[0].device

    @property
    def threads(self) -> int:
        """Lanes that strips are spread over."""
        return max(plan.threads for plan in self.plans)

    @property
    def settings(self) -> Mapping[str, Any]:
        """The method's parameters as chosen."""
        return self.plans[0].settings

    @property
    def samples(self) -> int:
        """Cells or photons of a frame, of all channels."""
        return sum(plan.samples for plan in self.plans)

    @property
    def launches(self) -> int:
        """Kernel launches in a frame."""
        return sum(plan.launches for plan in self.plans) + 1

    @property
    def kernels(self) -> tuple[str, ...]:
        """Names of the kernels that are compiled."""
        return (*dict.fromkeys(name for plan in self.plans for name in plan.kernels), "stack")

    @property
    def bytes(self) -> int:
        """Bytes of all buffers."""
        columns, rows = self.facts.scene.map.resolution
        return sum(plan.bytes for plan in self.plans) + 4 * len(CHANNELS) * columns * rows

    @property
    def reasons(self) -> tuple[Reason, ...]:
        """What is kept and left out, and why."""
        return self.plans[0].reasons

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a user should know before trusting the map."""
        return tuple(dict.fromkeys(warning for plan in self.plans for warning in plan.warnings))

    def __str__(self) -> str:
        """Return the plan as text: that of one channel, and what three of them take."""
        return "\n".join(self._lines())

    def _lines(self) -> Iterator[str]:
        indices = zip(CHANNELS, self.facts.scene.medium.dispersed_ior, strict=True)
        iors = ", ".join(f"{name} {ior:.5g}" for name, ior in indices)
        yield f"{self.facts.scene.name}: dispersion traced, each channel by itself: {iors}; this for each of them:"
        yield str(self.plans[1])
        yield f"in all: {self.launches} launches, {len(self.kernels)} kernels, {self.bytes:,} bytes"
