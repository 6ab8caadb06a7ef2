"""`[method]`: how the caustic map is made."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Final, Literal

from pydantic import Field
from pydantic_core import PydanticCustomError

from warp_caustics.errors import InputError
from warp_caustics.scene.cascaded import CascadedSettings
from warp_caustics.scene.model import Model
from warp_caustics.scene.pattern import PatternSettings
from warp_caustics.scene.values import (
    COUNT,
    POSITIVE,
    Count,
    ImagePath,
    NonNegative,
    Positive,
    Truth,
    finite,
    one_of,
    that,
    whole,
)

#: The methods by name.
METHODS: Final = (
    "beam", "photon", "gather", "cascaded", "sample", "pattern", "area_ratio", "differential", "reference",
)  # fmt: skip


#: Methods that make what a camera sees, and no map.
SCREEN_SPACE: Final = ("cascaded", "pattern")

METHOD_NAME: Final = one_of(*METHODS)


def known_method(name: str) -> str:
    """Return the name of a method of this version.

    Raises
    ------
    InputError
        If there is none of that name.
    """
    try:
        return str(METHOD_NAME.checked(name))
    except PydanticCustomError as error:
        raise InputError(f"method: {error.message()}") from None


class BeamSettings(Model):
    """`[method.beam]`: surface cells, refracted and clipped exactly to the pixels."""

    samples_per_pixel: Positive = Field(default=1.0, description="surface cells for each pixel of the map, by area")
    refine: Truth = Field(default=True, description="divide cells where their landing map bends")
    deposit: Annotated[Literal["edges", "triangles"], one_of("edges", "triangles")] | None = Field(
        default=None,
        description="how light is clipped to the pixels: `edges` follows the edges between triangles through the "
        "pixels that they cross and sums up rows in float64, `triangles` visits the pixels of each triangle; both are "
        "exact. When it is not given: edges on a CPU, triangles on a GPU and for fixed point",
    )


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


GATHER_FORMS: Final = ("auto", "two_pass", "fused", "scatter", "scatter_rows", "tile")


class GatherSettings(Model):
    """`[method.gather]`: Yuksel & Keyser's sum over windows of samples, on a terrain around each pixel's own centre."""

    n: Annotated[int, that(COUNT.read, lambda n: n % 2 == 1, "an odd whole number of at least 1")] | None = Field(
        default=None, description="pixels across the window of samples; from the largest deflection when not given"
    )
    m: Annotated[int, that(COUNT.read, lambda m: m % 2 == 0, "an even whole number of at least 2")] | None = Field(
        default=None,
        description="rows of samples beside a pixel's own; m + 1 channels keep them in two passes; from n when not "
        "given",
    )
    form: Annotated[Literal["auto", "two_pass", "fused", "scatter", "scatter_rows", "tile"], one_of(*GATHER_FORMS)] = (
        Field(
            default="auto",
            description="how the sum is done on a plane: `two_pass` as published, `fused` in one pass over each "
            "pixel's window, `tile` the same from shared memory (for CUDA; slow on a CPU), `scatter` by adding each "
            "sample's box to the pixels whose windows hold it, `scatter_rows` the same by whole rows (for a CPU, and "
            "waves over a plane without shadows and absorption); `auto` is the fastest, and the only form on a terrain",
        )
    )


class SampleSettings(Model):
    """`[method.sample]`: Collard & Mundi's sampled caustic map, which follows no light."""

    sample_steps: Count = Field(
        default=4,
        description="even steps across the square of samples, with one sample more than that each way; the authors' "
        "code has 4",
    )
    sample_size: Annotated[float, that(finite, lambda size: 0.0 < size <= 0.5, "a number above 0 and up to 0.5")] = (
        Field(default=0.5, description="half of the square's width, as a share of the map's; the authors' code has 0.5")
    )
    ground_offset: Positive | None = Field(
        default=None, description="height of the water at rest above the ground [m]; the scene's own when not given"
    )
    base_intensity: NonNegative = Field(
        default=2.0,
        description="brightness of each sample; the sum is limited to 0 to 1. The default is ours, as is "
        "environment_power's: a bright web on a dark ground on the bundled pool",
    )
    falloff_power: NonNegative = Field(
        default=4.0,
        description="a sample counts by (1 - its distance as a share of the map)^falloff_power; the authors' code "
        "has 4",
    )
    weight_power: Positive = Field(
        default=64.0,
        description="the upright part of a normal counts by 1 - (its cosine with the way to it)^weight_power, after "
        "the authors' code, which has 64; the paper gives no formula",
    )
    environment: ImagePath | None = Field(
        default=None,
        description="image whose first channel is the environment map, brightest in its middle; the built-in one, "
        "max(1 - 2 r, 0)^environment_power at a distance r from its middle, when not given",
    )
    environment_power: Positive = Field(
        default=512.0, description="of the built-in environment map; the default is ours"
    )
    vertices: Annotated[int, that(whole, lambda n: 2 <= n <= 4096, "a whole number from 2 to 4096")] = Field(
        default=160, description="of the water's mesh over the map, each way; 160 as published"
    )
    blur_radius: Annotated[int, that(whole, lambda n: 0 <= n <= 64, "a whole number from 0 to 64")] = Field(
        default=1, description="pixels that the box blur reaches each way; 0 is no blur. The default is ours"
    )

    @classmethod
    def rules(cls, given: Mapping[str, Any]) -> Iterator[str]:
        """Yield the fault of two environment maps."""
        yield from super().rules(given)
        if {"environment", "environment_power"} <= given.keys():
            yield "expected environment or environment_power, got both: an image has a falloff of its own"


class AreaRatioSettings(Model):
    """`[method.area_ratio]`: landed triangles drawn at pixel centres, lit by old area over new.

    The defaults are what WebGL demos and engines publish, without the factors that hide how much light it invents.
    """

    samples_per_pixel: Positive = Field(default=1.0, description="surface cells for each pixel of the map, by area")
    area: Annotated[Literal["derivatives", "cross"], one_of("derivatives", "cross")] = Field(
        default="derivatives",
        description="the ratio: `derivatives` is the published length(dFdx) * length(dFdy) of the old position over "
        "that of the new, `cross` the exact ratio of the triangle's areas",
    )
    overlap: Annotated[Literal["add", "latest"], one_of("add", "latest")] = Field(
        default="add",
        description="what a pixel keeps where triangles overlap: `add` is additive blending, `latest` the last one "
        "drawn, as without blending (the first WebGL demo)",
    )
    clamp: Positive | None = Field(default=None, description="largest ratio; not clamped when not given")


FOOTPRINT_SIZE: Final = that(POSITIVE.read, lambda size: 1.0 <= size <= 1024.0, "a number from 1 to 1024")


class DifferentialSettings(Model):
    """`[method.differential]`: photon differentials, each photon's footprint from the curvature of the water."""

    photons_per_pixel: Positive = Field(default=1.0, description="photons for each pixel of the map, by area")
    footprint: Annotated[Literal["ellipse", "parallelogram"], one_of("ellipse", "parallelogram")] = Field(
        default="ellipse",
        description="`ellipse` with the kernel (3 / pi) (1 - r^2)^2, or `parallelogram`, evenly lit and clipped to the "
        "pixels exactly",
    )
    largest: Annotated[float, FOOTPRINT_SIZE] = Field(
        default=32.0,
        description="largest half axis of an ellipse, or side of a parallelogram, in pixels; wider ones are narrowed "
        "and keep their light",
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

    name: Annotated[str, METHOD_NAME] = Field(default="beam", description="the default of this scene")
    accumulate: Annotated[Literal["float32", "float64", "fixed"], one_of("float32", "float64", "fixed")] = Field(
        default="float32",
        description="what flux is summed in; fixed point is the same on every run. When it is not given, maps with "
        "more than 4096 cells for each pixel are summed in float64; the beam's edges always are",
    )
    beam: BeamSettings = Field(default=BeamSettings(), description="parameters of beam")
    photon: PhotonSettings = Field(default=PhotonSettings(), description="parameters of photon")
    gather: GatherSettings = Field(default=GatherSettings(), description="parameters of gather")
    cascaded: CascadedSettings = Field(default=CascadedSettings(), description="parameters of cascaded")
    area_ratio: AreaRatioSettings = Field(default=AreaRatioSettings(), description="parameters of area_ratio")
    differential: DifferentialSettings = Field(default=DifferentialSettings(), description="parameters of differential")
    pattern: PatternSettings = Field(default=PatternSettings(), description="parameters of pattern")
    sample: SampleSettings = Field(default=SampleSettings(), description="parameters of sample")
    reference: ReferenceSettings = Field(default=ReferenceSettings(), description="parameters of reference")
