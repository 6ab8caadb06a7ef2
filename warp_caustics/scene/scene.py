"""`Scene`: the whole of a scene file."""

from __future__ import annotations

from pydantic import Field, ValidationInfo, field_validator

from warp_caustics.scene.faults import refusal
from warp_caustics.scene.frame import Camera, Map
from warp_caustics.scene.light import Medium, Sun
from warp_caustics.scene.method import Method
from warp_caustics.scene.model import Model
from warp_caustics.scene.preset import preset_waves
from warp_caustics.scene.receiver import Receiver
from warp_caustics.scene.text import toml_text
from warp_caustics.scene.values import Text
from warp_caustics.scene.water import Water, Wave


class Scene(Model):
    """Water, what lies under it, light, and the map that is asked for.

    A scene is frozen; `scene.model_copy(update={...})` makes another one. Calling `Scene` with its tables, as models or
    as dictionaries, checks them as a file is checked.

    Raises
    ------
    InputError
        With every fault, one a line, each with its path in the file.
    """

    name: Text = Field(default="scene", description="what the scene is called; the file's own name when not given")
    water: Water = Field(description="the surface that refracts")
    receiver: Receiver = Field(description="what lies under the water")
    sun: Sun = Field(description="the light")
    medium: Medium = Field(description="what the water does to it")
    map: Map = Field(description="the caustic map in plan view")
    camera: Camera | None = Field(default=None, description="only for pictures and screen-space methods")
    method: Method = Field(default=Method(), description="how the map is made")

    @field_validator("receiver")
    @classmethod
    def _floor_under_water(cls, receiver: Receiver, info: ValidationInfo) -> Receiver:
        water: Water | None = info.data.get("water")  # None when it has faults of its own
        if water is not None and receiver.plane is not None and receiver.plane >= water.level:
            raise refusal(f"expected a plane below the water's level {water.level}, got {receiver.plane}")
        return receiver

    @property
    def waves(self) -> tuple[Wave, ...]:
        """Waves of the water: those given, or those of its preset over this map; none where it is of another kind."""
        if self.water.preset is not None:
            return preset_waves(self.water.preset, self.map)
        return self.water.waves or ()

    @property
    def channels(self) -> int:
        """Three when light, its loss or its refraction has colour, else one."""
        coloured = isinstance(self.sun.irradiance, tuple) or isinstance(self.medium.absorption, tuple)
        return 3 if coloured or self.medium.jerlov is not None or self.medium.dispersion != "none" else 1

    def at_resolution(self, columns: int, rows: int) -> Scene:
        """Return the scene with another number of pixels on the same map.

        Raises
        ------
        InputError
            If there can be no such map.
        """
        resized = Map(origin=self.map.origin, size=self.map.size, resolution=(columns, rows))
        return self.model_copy(update={"map": resized})

    def to_toml(self) -> str:
        """Return the scene as the text of a scene file, with the keys that were given.

        `parse_scene` makes an equal scene of it. Files stand in it as they were resolved.
        """
        return toml_text(self.model_dump(exclude_unset=True, exclude_none=True))
