"""`[sun]` and `[medium]`: the light, and what the water does to it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, cast

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field, model_validator
from typing_extensions import Self

from warp_caustics.scene.faults import fault, faults_error, refusal, shown
from warp_caustics.scene.medium_tables import IOR_TABLE, JERLOV_TABLE
from warp_caustics.scene.model import Model
from warp_caustics.scene.values import Colour, Ior, Number, Positive, Triple, Truth, finite, one_of, that

#: A direction this close to length 1 is taken as it stands, so that a scene that was written out loads back equal:
#: normalising leaves at most a few roundings, but may move the last digit each time.
UNIT_TOLERANCE = 8.0 * float(np.finfo(np.float64).eps)

GREEN = 1
_ZENITH = 90.0


def _downward_unit(direction: tuple[float, float, float]) -> tuple[float, float, float]:
    """Return the unit vector of a direction that comes from above the horizon."""
    if direction[2] < 0.0:
        largest = max(abs(part) for part in direction)  # first of all, so that no square over- or underflows
        x, y, z = (part / largest for part in direction)
        if abs(math.hypot(*direction) - 1.0) <= UNIT_TOLERANCE:
            return direction
        length = math.hypot(x, y, z)
        if z < 0.0:
            return x / length, y / length, z / length
    raise refusal(f"expected light that travels downwards, with z below 0, got {shown(direction)}")


Elevation = Annotated[float, that(finite, lambda angle: 0.0 < angle <= _ZENITH, "degrees above 0 and up to 90")]
Diameter = Annotated[float, that(finite, lambda angle: 0.0 <= angle < _ZENITH, "degrees from 0 to less than 90")]


class Sun(Model):
    """The sun: its direction one of two ways, its irradiance and its size."""

    direction: Annotated[Triple, AfterValidator(_downward_unit)] = Field(
        # None never stays: `rules` wants one of the two ways, and `_place` makes this one of the other.
        default=cast("Any", None),
        description="the way light travels; brought to length 1. Either this, or elevation and azimuth",
    )
    elevation: Elevation | None = Field(default=None, description="height of the sun above the horizon [degrees]")
    azimuth: Number | None = Field(default=None, description="where the sun stands, from +x towards +y [degrees]")
    irradiance: Colour = Field(
        default=1.0, description="on a plane that faces the sun; W/m² when it is a real sun, else relative"
    )
    angular_diameter: Diameter = Field(default=0.0, description="of the sun's disk [degrees]; 0 is a point")

    @classmethod
    def rules(cls, given: Mapping[str, Any]) -> Iterator[str]:
        """Yield the fault of a direction given twice, by half or not at all."""
        yield from super().rules(given)
        angles = {"elevation", "azimuth"} & given.keys()
        if "direction" in given and angles:
            yield "expected direction, or elevation and azimuth, got both"
        elif len(angles) == 1:
            yield f"expected elevation and azimuth together, got {angles.pop()} alone"
        elif "direction" not in given and not angles:
            yield "expected direction, or elevation and azimuth, got neither"

    @model_validator(mode="after")
    def _place(self) -> Self:
        """Give a sun of two angles its direction, and see that its whole disk is up."""
        if self.elevation is not None and self.azimuth is not None:
            up, around = math.radians(self.elevation), math.radians(math.fmod(self.azimuth, 360.0))
            towards = (math.cos(up) * math.cos(around), math.cos(up) * math.sin(around), math.sin(up))
            # The model is frozen for its users; `direction` stays out of the keys that were given.
            object.__setattr__(
                self, "direction", _downward_unit((0.0 - towards[0], 0.0 - towards[1], 0.0 - towards[2]))
            )
        if self.direction is None:
            return self  # refused by `rules`
        x, y, z = self.direction
        lowest = math.degrees(math.atan2(-z, math.hypot(x, y))) - self.angular_diameter / 2.0
        if lowest <= 0.0:
            text = "expected a disk wholly above the horizon, got one that reaches below it"
            raise faults_error("Sun", [fault(text, ("angular_diameter",))])
        return self

    @property
    def unit_direction(self) -> NDArray[np.float64]:
        """The way light travels, float64 [3], of length 1 to rounding; its z is below 0."""
        return np.array(self.direction, dtype=np.float64)


class Medium(Model):
    """What the water does to light."""

    ior: Ior = Field(
        description='index of refraction; "fresh" and "sea" are tabulated at 650, 550 and 450 nm. By channel it needs '
        "dispersion; without, its green is used for all, and the result says so"
    )
    absorption: Colour = Field(default=0.0, description="along the refracted path [1/m]")
    jerlov: Annotated[str, one_of(*JERLOV_TABLE)] | None = Field(
        default=None, description="instead of absorption: Jerlov's water type, K_d over the vertical depth"
    )
    fresnel: Truth = Field(default=False, description="the surface reflects some of the light away")
    dispersion: Annotated[str, one_of("none", "traced", "post")] = Field(
        default="none",
        description="colours refract apart: each channel's own light is followed, or channels are shifted afterwards "
        "(cascaded alone); needs an ior by channel",
    )
    dispersion_strength: Positive = Field(
        default=1.0, description="times by which the indices differ from green's; 1 is physical; only with dispersion"
    )

    @classmethod
    def rules(cls, given: Mapping[str, Any]) -> Iterator[str]:
        """Yield the faults of keys that exclude each other."""
        yield from super().rules(given)
        if {"absorption", "jerlov"} <= given.keys():
            yield "expected absorption or jerlov, got both: one goes with the path, the other with the depth"
        if given.get("dispersion", "none") != "none" and isinstance(given.get("ior"), int | float):
            yield 'expected an ior by channel, "fresh" or "sea" with dispersion: one index bends all colours alike'
        if "dispersion_strength" in given and given.get("dispersion", "none") == "none":
            yield 'expected no dispersion_strength, since dispersion is "none"'

    @property
    def ior_by_channel(self) -> tuple[float, float, float]:
        """The index for red, green and blue."""
        if isinstance(self.ior, str):
            return IOR_TABLE[self.ior]
        return self.ior if isinstance(self.ior, tuple) else (self.ior, self.ior, self.ior)

    @property
    def dispersed_ior(self) -> tuple[float, float, float]:
        """The index by which each channel refracts under dispersion, at its strength."""
        green = self.green_ior
        red, _, blue = (green + self.dispersion_strength * (ior - green) for ior in self.ior_by_channel)
        return red, green, blue

    @property
    def green_ior(self) -> float:
        """The index that all channels share when there is no dispersion."""
        return self.ior_by_channel[GREEN]

    @property
    def diffuse_attenuation(self) -> tuple[float, float, float] | None:
        """K_d of the Jerlov water type for red, green and blue [1/m], or None without one."""
        return None if self.jerlov is None else JERLOV_TABLE[self.jerlov]
