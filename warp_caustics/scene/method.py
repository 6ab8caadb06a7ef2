"""`[method]`: how the caustic map is made."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Final, Literal

from pydantic import Field
from pydantic_core import PydanticCustomError

from warp_caustics.errors import InputError
from warp_caustics.scene.faults import quoted
from warp_caustics.scene.model import Model
from warp_caustics.scene.pattern import PatternSettings
from warp_caustics.scene.values import COUNT, POSITIVE, Count, Positive, Truth, one_of, that

#: The methods of this version, and those that later ones bring.
METHODS: Final = ("beam", "photon", "gather", "pattern", "reference")
PLANNED_METHODS: Final = ("cascaded", "sample", "area_ratio", "differential")


METHOD_NAME: Final = one_of(*METHODS, not_yet=PLANNED_METHODS)


def known_method(name: str) -> str:
    """Return the name of a method of this version.

    Raises
    ------
    InputError
        If there is none of that name, or not yet.
    """
    try:
        return str(METHOD_NAME.checked(name))
    except PydanticCustomError as error:
        raise InputError(f"method: {error.message()}") from None


class BeamSettings(Model):
    """`[method.beam]`: surface cells, refracted and clipped exactly to the pixels."""

    samples_per_pixel: Positive = Field(default=1.0, description="surface cells for each pixel of the map, by area")
    refine: Truth = Field(default=True, description="divide cells where their landing map bends")


class PhotonSettings(Model):
    """`[method.photon]`: one photon a cell, splatted."""

    photons_per_pixel: Positive = Field(default=4.0, description="photons for each pixel of the map, by area")
    footprint: Annotated[
        Literal["point", "pixel", "cell"] | float,
        one_of("point", "pixel", "cell", other=POSITIVE.read, or_else=", or a finite number above 0"),
    ] = Field(
        default="cell",
        description="box that a photon fills: none, a pixel (bilinear), the photon's own cell, or a width in pixels",
    )
    projection: Annotated[Literal["exact", "backlund"], one_of("exact", "backlund")] = Field(
        default="exact", description="where a photon lands: exactly, or by Bäcklund's Eq. 3.3 as published"
    )


class GatherSettings(Model):
    """`[method.gather]`: Yuksel & Keyser's two passes on a plane; on a terrain one, around each pixel's own centre."""

    n: Annotated[int, that(COUNT.read, lambda n: n % 2 == 1, "an odd whole number of at least 1")] | None = Field(
        default=None, description="pixels across the window of samples; from the largest deflection when not given"
    )
    m: Annotated[int, that(COUNT.read, lambda m: m % 2 == 0, "an even whole number of at least 2")] | None = Field(
        default=None,
        description="rows of samples beside a pixel's own; m + 1 channels keep them on a plane; from n when not given",
    )


class ReferenceSettings(Model):
    """`[method.reference]`: the converged answer, in float64."""

    tolerance: Positive = Field(
        default=2.5e-4, description="relative L2 difference of two levels at which they are taken as converged"
    )
    rays: Count = Field(
        default=2**26, description="rays of a level at most; past them the error bar stays above the tolerance"
    )


class Method(Model):
    """The method and its parameters; the tables of other methods are validated and unused."""

    not_yet: ClassVar[Mapping[str, str]] = {name: f"use {quoted(METHODS)}" for name in PLANNED_METHODS}

    name: Annotated[str, METHOD_NAME] = Field(default="beam", description="the default of this scene")
    accumulate: Annotated[Literal["float32", "float64", "fixed"], one_of("float32", "float64", "fixed")] = Field(
        default="float32",
        description="what flux is summed in; fixed point is the same on every run. When it is not given, maps with "
        "more than 4096 cells for each pixel are summed in float64",
    )
    beam: BeamSettings = Field(default=BeamSettings(), description="parameters of beam")
    photon: PhotonSettings = Field(default=PhotonSettings(), description="parameters of photon")
    gather: GatherSettings = Field(default=GatherSettings(), description="parameters of gather")
    pattern: PatternSettings = Field(default=PatternSettings(), description="parameters of pattern")
    reference: ReferenceSettings = Field(default=ReferenceSettings(), description="parameters of reference")
