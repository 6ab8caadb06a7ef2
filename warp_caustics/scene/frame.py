"""`[map]` and `[camera]`: what is looked at."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, ValidationInfo, field_validator

from warp_caustics.scene.faults import refusal, shown
from warp_caustics.scene.model import Model
from warp_caustics.scene.values import Extent, Number, Pair, Resolution, Triple, finite, that

FieldOfView = Annotated[float, that(finite, lambda angle: 0.0 < angle < 180.0, "degrees above 0 and below 180")]


class Map(Model):
    """The caustic map, in plan view."""

    origin: Pair = Field(description="lower corner, of lowest x and y [m]")
    size: Extent = Field(description="width and height [m]")
    resolution: Resolution = Field(description="columns, rows")


class Camera(Model):
    """An eye, for pictures and screen-space methods; z is up in its picture."""

    position: Triple = Field(description="where it stands [m]")
    target: Triple = Field(description="what it looks at [m]")
    vertical_fov: FieldOfView = Field(description="full angle of view, from the lowest row to the highest [degrees]")
    resolution: Resolution = Field(description="columns, rows")
    exposure: Number = Field(default=0.0, description="of pictures as PNG; each whole stop doubles the light")

    @field_validator("target")
    @classmethod
    def _elsewhere(cls, target: tuple[float, float, float], info: ValidationInfo) -> tuple[float, float, float]:
        if target == info.data.get("position"):
            raise refusal(f"expected a target away from the camera's position, got {shown(target)} for both")
        return target
