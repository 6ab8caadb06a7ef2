"""`[receiver]`: what lies under the water."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, ValidationInfo

from warp_caustics.scene.faults import refusal, shown
from warp_caustics.scene.model import Model, exactly_one
from warp_caustics.scene.values import Albedo, MeshPath, Number, Pair, Positive, Triple
from warp_caustics.scene.water import HeightFile, Wavevector


class TerrainWave(Model):
    """One ripple of a terrain in closed form: a sin(kx x + ky y + φ)."""

    amplitude: Number = Field(description="a [m]")
    wavevector: Wavevector = Field(description="(kx, ky) [rad/m]")
    phase: Number = Field(default=0.0, description="φ [rad]")


class ClosedTerrain(Model):
    """A terrain in closed form: z = base + sx x + sy y + Σ a sin(kx x + ky y + φ)."""

    base: Number = Field(description="z at x = y = 0, ripples aside [m]")
    slope: Pair = Field(default=(0.0, 0.0), description="(sx, sy), rise over run")
    waves: tuple[TerrainWave, ...] = Field(default=(), description="ripples, which add up")


class TerrainFile(HeightFile):
    """A terrain from a file, in world z."""


class MeshObject(Model):
    """A mesh that stands on the receiver: scaled about its own origin, then moved."""

    mesh: MeshPath = Field(description="file with triangles, or polygons to be cut into them")
    translate: Triple = Field(default=(0.0, 0.0, 0.0), description="where its origin goes [m]")
    scale: Positive = Field(default=1.0, description="metres for one unit of the file")


def _kind_of_terrain(value: Any, info: ValidationInfo) -> Any:
    """Return a terrain of the kind that its keys name, so that faults speak of that kind alone."""
    if value is None or isinstance(value, (ClosedTerrain, TerrainFile)):
        return value
    if not isinstance(value, Mapping):
        raise refusal(f"expected a table, got {shown(value)}")
    kind = TerrainFile if "file" in value else ClosedTerrain
    return kind.model_validate(value, context=info.context)


class Receiver(Model):
    """What the light falls on: exactly one of plane, terrain and mesh, and objects that stand on it."""

    plane: Number | None = Field(default=None, description="z of a flat floor [m]")
    terrain: Annotated[ClosedTerrain | TerrainFile | None, BeforeValidator(_kind_of_terrain)] = Field(
        default=None, description="height field, in closed form or from a file"
    )
    mesh: MeshPath | None = Field(default=None, description="file of a mesh in world coordinates")
    objects: tuple[MeshObject, ...] = Field(default=(), description="meshes that stand on any of these")
    albedo: Albedo = Field(
        default=(0.60, 0.50, 0.36), description="of ground and objects, for pictures alone; pale sand when not given"
    )

    @classmethod
    def rules(cls, given: Mapping[str, Any]) -> Iterator[str]:
        """Yield the fault of several kinds of receiver, or none."""
        yield from super().rules(given)
        yield from exactly_one(given, ("plane", "terrain", "mesh"))
