"""`[water] spectrum`: a sea of random waves under a wind, periodic in space."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Final, Literal

from pydantic import Field

from warp_caustics.scene.model import Model
from warp_caustics.scene.values import COUNT, POSITIVE, Number, Positive, one_of, that, whole

#: Nodes along a side: below, fewer than two waves fit; above, a row does not fit into a transform.
FEWEST_NODES: Final = 16
MOST_NODES: Final = 4096

#: Nodes in the shortest wave: its slope by fourth-order differences is then right to 1.3 %, that of one twice as long
#: to 0.08 %.
NODES_A_WAVE: Final = 8

#: Exponent of the spreading at most, whose energy is within 8 degrees of the wind: modes of a few waves know no less.
MOST_SPREADING: Final = 100.0


def _power_of_two(count: int) -> bool:
    return FEWEST_NODES <= count <= MOST_NODES and count & (count - 1) == 0


class Spectrum(Model):
    """A sea: waves of random phase whose energy follows a spectrum, in a square that repeats without end.

    `kind = "jonswap"` is a sea that grows over a fetch (Hasselmann et al. 1973), `"tma"` the same over a finite depth,
    that of the water at rest (Bouws et al. 1985), `"pm"` a fully grown one (Pierson and Moskowitz 1964). The square's
    corner is the world's origin. It holds the waves that fit into it a whole number of times each way, down to eight
    nodes a wave: from `period` to `8 period / resolution` long. Each has the amplitude that its share of the spectrum
    asks for, and a phase by the seed.
    """

    kind: Annotated[Literal["jonswap", "pm", "tma"], one_of("jonswap", "pm", "tma")] = Field(
        description="which spectrum"
    )
    wind_speed: Positive = Field(description="10 m above the sea [m/s]")
    fetch: Positive | None = Field(
        default=None, description='over which the wind has blown [m]; kinds "jonswap" and "tma", which need it'
    )
    period: Positive = Field(description="side of the square after which the sea repeats [m]")
    seed: Annotated[int, that(whole, lambda seed: seed >= 0, "a whole number of at least 0")] = Field(
        default=1, description="of the phases; another seed is another sea of the same spectrum"
    )
    direction: Number = Field(default=0.0, description="which way the wind blows, from +x towards +y [degrees]")
    spreading: Annotated[
        Literal["mitsuyasu"] | float,
        one_of(
            "mitsuyasu",
            other=that(POSITIVE.read, lambda exponent: exponent <= MOST_SPREADING, "").read,
            or_else=", or a finite number above 0, at most 100",
        ),
    ] = Field(
        default="mitsuyasu",
        description="exponent s of the directional spreading cos^2s((θ - direction) / 2); or that of Mitsuyasu et al. "
        "1975, which is largest for the longest waves and lets short ones run every way",
    )
    loop: Positive | None = Field(
        default=None,
        description="time after which the water repeats [s]: frequencies are rounded to whole multiples of 2π / loop, "
        "at least one; the plan says how far the worst is moved",
    )
    resolution: Annotated[int, that(COUNT.read, _power_of_two, "a power of two from 16 to 4096")] = Field(
        default=256, description="nodes along a side of the square"
    )

    @classmethod
    def rules(cls, given: Mapping[str, Any]) -> Iterator[str]:
        """Yield the fault of a fetch that is missing, or that the kind cannot honour."""
        yield from super().rules(given)
        if given.get("kind") == "pm" and "fetch" in given:
            yield 'expected no fetch with kind "pm": it is fully grown'
        if given.get("kind") in ("jonswap", "tma") and "fetch" not in given:
            yield f'expected a fetch with kind "{given["kind"]}": a finite number above 0'
