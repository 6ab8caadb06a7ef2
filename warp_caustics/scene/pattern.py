"""`[method.pattern]`: a moving picture of caustics, projected into a volume."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal

from pydantic import Field

from warp_caustics.scene.model import Model
from warp_caustics.scene.values import Box, NonNegative, Number, TexturePath, Triple, finite, one_of, that

SMALLEST_REPEAT = 1e-6
"""Of a texture [m]: float32 counts no more of them across a few metres."""

Width = Annotated[float, that(finite, lambda value: value >= SMALLEST_REPEAT, f"a number from {SMALLEST_REPEAT:g}")]
Share = Annotated[float, that(finite, lambda value: 0.0 <= value <= 1.0, "a number from 0 to 1")]
ShareBelowOne = Annotated[float, that(finite, lambda value: 0.0 <= value < 1.0, "a number from 0 to less than 1")]


class Volume(Model):
    """The box in which a pattern shows."""

    centre: Triple = Field(description="middle of the box [m]")
    size: Box = Field(description="lengths of its edges [m]")
    rotation: Number = Field(default=0.0, description="turn about z, from +x towards +y [degrees]")


class PatternSettings(Model):
    """`[method.pattern]`: a moving picture of caustics, projected along the light into a volume, on what a camera sees.

    The water's waves are not followed: published as a way to draw caustics, not to compute them.
    """

    texture: TexturePath | None = Field(
        default=None,
        description="picture of caustics that is repeated; a tile that this library renders when not given",
    )
    scale: Width | None = Field(
        default=None, description="width of one repeat [m]; a third of the map's shorter side when not given"
    )
    speed: Number = Field(
        default=0.1,
        description="repeats that the second of the two layers moves by [1/s], the first at 0.75 times that; a picture "
        "loops after 4 / speed",
    )
    strength: NonNegative = Field(
        default=1.0, description="1 gives, on average, as much light as calm water would let through"
    )
    split: NonNegative = Field(
        default=0.0, description="offset of red, green and blue, in repeats of the texture; 0 leaves it out"
    )
    luminance_mask: Annotated[
        Literal["none", "lerp", "smoothstep", "shadow"], one_of("none", "lerp", "smoothstep", "shadow")
    ] = Field(
        default="shadow",
        description="less pattern where the scene is dark: by its luminance without caustics, in two forms, or by "
        "a shadow test, which the forms by luminance make too and `none` does not",
    )
    luminance_strength: Share = Field(
        default=0.5, description="of the forms by luminance: how much it counts (lerp), or where it starts (smoothstep)"
    )
    volume: Volume | None = Field(
        default=None,
        description="where it shows; the water over the map, down to the lowest ground, when not given",
    )
    fade_radius: NonNegative = Field(
        default=0.75, description="distance from the volume's middle at which it fades, in edges of the volume"
    )
    fade_strength: ShareBelowOne = Field(
        default=0.5, description="how fast it fades: over 1 - fade_strength edges of the volume"
    )
    blend: Annotated[Literal["light", "overlay"], one_of("light", "overlay")] = Field(
        default="light",
        description="what the masks leave out is lit as under calm water (`light`), or black (`overlay`, as published: "
        "to be added to a picture)",
    )

    @classmethod
    def rules(cls, given: Mapping[str, Any]) -> Iterator[str]:
        """Yield the fault of a strength that no mask takes."""
        yield from super().rules(given)
        mask = given.get("luminance_mask", "shadow")
        if "luminance_strength" in given and mask in ("none", "shadow"):
            yield f'expected no luminance_strength with luminance_mask "{mask}"; it is of "lerp" and "smoothstep"'
