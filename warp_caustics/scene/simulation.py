"""`[water] simulation`: water that is simulated, from drops that fall into it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Final, Literal

from pydantic import Field, field_validator

from warp_caustics.scene.faults import refusal, shown
from warp_caustics.scene.model import Model, exactly_one
from warp_caustics.scene.values import Extent, NonNegative, Number, Pair, Positive, Resolution, one_of

#: Keys that only a simulation in steps can honour, and why the other needs none.
ONLY_GRID: Final[Mapping[str, str]] = {
    "integrator": "it goes to any time directly",
    "step": "it goes to any time directly",
    "damping": 'its modes stand for ever; kind "grid" has damping',
    "obstacles": 'its modes know no obstacles; kind "grid" has them',
}


class Drop(Model):
    """A drop: the water rises by amplitude exp(-(r / radius)²), at rest, as a falling drop leaves it."""

    position: Pair = Field(description="its middle (x, y) [m]")
    radius: Positive = Field(description="distance at which it has fallen to 1/e; at least one cell [m]")
    amplitude: Number = Field(description="rise of its middle; negative is a dent [m]")
    time: NonNegative = Field(default=0.0, description='when it falls, rounded to a whole step; kind "grid" alone [s]')


class Obstacle(Model):
    """A wall that rises out of the water: a disc, or a box along the axes. It covers the cells whose middles it covers.

    It reflects waves and casts no shadow: for that, stand a mesh of its shape on the receiver.
    """

    position: Pair = Field(description="its middle (x, y) [m]")
    radius: Positive | None = Field(default=None, description="of a disc [m]")
    size: Extent | None = Field(default=None, description="of a box, instead of a radius [m]")

    @classmethod
    def rules(cls, given: Mapping[str, Any]) -> Iterator[str]:
        """Yield the fault of an obstacle of two shapes, or none."""
        yield from super().rules(given)
        yield from exactly_one(given, ("radius", "size"))


class Simulation(Model):
    """Simulated water in a rectangle. Drops disturb it; before the first it is at rest.

    `kind = "spectral"` propagates each mode exactly by ω² = (g k + σ k³/ρ) tanh(k d), to any time directly.
    `kind = "grid"` steps the local equation h_tt = g d ∇²h - (σ d/ρ) ∇⁴h - damping h_t from time 0, among obstacles.
    """

    kind: Annotated[Literal["spectral", "grid"], one_of("spectral", "grid")] = Field(description="how it is simulated")
    cell: Positive | None = Field(
        default=None,
        description="longest side of a cell [m]; the rectangle is cut evenly, spectral water into powers of two",
    )
    resolution: Resolution | None = Field(
        default=None, description="columns, rows of cells, instead of `cell`; powers of two for spectral water"
    )
    origin: Pair | None = Field(
        default=None,
        description="lower corner of the water [m]; by default it is all the water that can light the map, so that "
        "its walls move with the sun, max_slope and the drops: give origin and size for walls that stay",
    )
    size: Extent | None = Field(
        default=None,
        description="extent of the water [m]; given together with origin, for walls that stay",
    )
    border: Annotated[Literal["reflecting", "periodic"], one_of("reflecting", "periodic")] = Field(
        default="reflecting", description="walls, at which the water ends; or water that repeats without end"
    )
    depth: Positive | None = Field(default=None, description="of the water [m]; by default that at rest over the map")
    surface_tension: NonNegative = Field(default=0.0728, description="σ [N/m]")
    density: Positive = Field(default=1000.0, description="ρ [kg/m³]")
    drops: tuple[Drop, ...] = Field(
        default=(),
        description="what disturbs the water. Walls mirror them, so that a drop at a wall stands twice as high, in a "
        "corner four times; in periodic water those wider than it add up with their repeats",
    )
    max_slope: Positive = Field(
        default=0.5, description="steepest slope that is planned for; a frame that passes it gives a warning"
    )
    max_height: Positive | None = Field(
        default=None,
        description="largest displacement that is planned for [m]; by default that of all drops in one place, as "
        "walls and repeats raise them where origin and size are given",
    )
    integrator: Annotated[Literal["explicit", "implicit"], one_of("explicit", "implicit")] = Field(
        default="explicit",
        description="grid alone: leapfrog, stable below a longest step; or trapezoidal, stable at any step",
    )
    step: Positive | None = Field(
        default=None,
        description="grid alone: of time [s]; by default 0.9 of the longest explicit one, or a cell over the speed "
        "of long waves. The longer an implicit step, the more iterations it takes: one of more than 32768, some 2000 "
        "explicit steps long, is refused as too much work. A frame shows the water at the nearest whole step",
    )
    damping: NonNegative = Field(default=0.0, description="grid alone: rate at which velocities die away [1/s]")
    obstacles: tuple[Obstacle, ...] = Field(default=(), description="grid alone: walls in the water")

    @classmethod
    def rules(cls, given: Mapping[str, Any]) -> Iterator[str]:
        """Yield the faults of keys that are given together, or to a kind that cannot honour them."""
        yield from super().rules(given)
        yield from exactly_one(given, ("cell", "resolution"))
        if ("origin" in given) != ("size" in given):
            yield "expected origin and size together, got only one of them"
        if given.get("kind") == "spectral":
            for key, why in ONLY_GRID.items():
                if key in given:
                    yield f'expected no {key} with kind "spectral": {why}'

    @field_validator("drops")
    @classmethod
    def _at_time_zero(cls, drops: tuple[Drop, ...], info: Any) -> tuple[Drop, ...]:
        if info.data.get("kind") == "spectral":
            for number, drop in enumerate(drops):
                if drop.time > 0.0:
                    raise refusal(
                        f'expected drops at time 0 with kind "spectral", got {shown(drop.time)} for drop {number}; '
                        'kind "grid" has drops while it runs'
                    )
        return drops

    @property
    def height_bound(self) -> float:
        """Largest displacement that is planned for [m]."""
        if self.max_height is not None:
            return self.max_height
        from warp_caustics.simulation.drops import highest_drops  # which loads Warp, as a scene alone does not

        return highest_drops(self)
