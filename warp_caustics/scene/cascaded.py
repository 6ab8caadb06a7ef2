"""`[method.cascaded]`: Bäcklund's cascaded caustic maps in screen space, as published and mended."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Final, Literal

from pydantic import Field

from warp_caustics.scene.model import Model
from warp_caustics.scene.values import NonNegative, Positive, finite, one_of, that, whole

MOST_CASCADES: Final = 16  # each takes a light view of its own; past some there is nothing left to make finer
LEAST_TEXELS: Final = 16
MOST_TEXELS: Final = 16384  # of the rasterizer's pictures: views.MAX_RESOLUTION, which a test compares

MOST_RADIUS: Final = 64  # pixels: wider windows are no filter of noise any more

PUBLISHED_KEYS: Final = ("ramp", "min_depth", "max_depth", "constant")

Texels = Annotated[
    int,
    that(
        whole,
        lambda n: LEAST_TEXELS <= n <= MOST_TEXELS,
        f"a whole number from {LEAST_TEXELS} to {MOST_TEXELS}",
    ),
]
Cascades = Annotated[int, that(whole, lambda n: 1 <= n <= MOST_CASCADES, f"a whole number from 1 to {MOST_CASCADES}")]
Radius = Annotated[int, that(whole, lambda n: 1 <= n <= MOST_RADIUS, f"a whole number from 1 to {MOST_RADIUS}")]
Share = Annotated[float, that(finite, lambda share: 0.0 <= share <= 1.0, "a number from 0 to 1")]


class CascadedSettings(Model):
    """`[method.cascaded]`: photons from light views of the camera's cascades, splatted into its picture."""

    count: Cascades = Field(default=4, description="cascades; all begin at the camera, each reaches farther")
    resolution: Texels = Field(default=1024, description="texels, and so photons, along a side of each light view")
    near: Positive | None = Field(
        default=None,
        description="depth from which the far planes are spaced evenly [m]; that of the nearest part of the scene "
        "that the camera sees when not given",
    )
    far: Positive | None = Field(
        default=None,
        description="depth of the last far plane [m]; that of the farthest part of the scene that the camera sees "
        "when not given",
    )
    blend: Share = Field(
        default=0.2,
        description="part of a cascade's range over which the next takes its place; 0 is a hard switch, as published",
    )
    positions: Annotated[Literal["depth", "float3"], one_of("depth", "float3")] = Field(
        default="depth", description="what a light view stores of a position: its depth (4 bytes) or x, y, z (12)"
    )
    normals: Annotated[Literal["float3", "angles", "octahedral"], one_of("float3", "angles", "octahedral")] = Field(
        default="float3",
        description="what it stores of a normal: x, y, z (12 bytes), yaw and pitch as 16-bit floats (4), or a place "
        "on an octahedron as 16-bit integers (4)",
    )
    projection: Annotated[Literal["exact", "backlund"], one_of("exact", "backlund")] = Field(
        default="exact", description="where a photon lands: exactly, or by Bäcklund's Eq. 3.3 as published"
    )
    footprint: Annotated[Literal["point", "pixel", "texel"], one_of("point", "pixel", "texel")] = Field(
        default="texel",
        description="what a photon fills of the picture: one pixel as published, four (bilinear), or its texel's "
        "outline as the camera sees it",
    )
    depth_tolerance: Positive | None = Field(
        default=None,
        description="how far off the surface that a pixel sees a photon may land and still light it [m]; one "
        "footprint of the pixel when not given, and what Eq. 3.3 misses by where it is used",
    )
    brightness: Annotated[Literal["flux", "published"], one_of("flux", "published")] = Field(
        default="flux",
        description="of a photon: its flux, over the area that a pixel sees, or a constant with ramps as published",
    )
    constant: Positive = Field(default=1.0, description="C, a photon's brightness; only with published brightness")
    ramp: Annotated[Literal["hard", "smooth"], one_of("hard", "smooth")] = Field(
        default="hard",
        description="how brightness ends at max_depth: within a metre, or all the way down; only as published",
    )
    min_depth: NonNegative = Field(
        default=0.0, description="depth at which brightness begins, to rise within a metre [m]; only as published"
    )
    max_depth: Positive = Field(default=10.0, description="depth at which brightness ends [m]; only as published")
    dispersion_photons: Annotated[Literal["each", "shared"], one_of("each", "shared")] = Field(
        default="shared",
        description="traced dispersion: a launch of photons for each channel, or photons that are refracted and "
        "splatted three times",
    )
    filter: Annotated[Literal["none", "blur", "bilateral"], one_of("none", "blur", "bilateral")] = Field(
        default="none", description="of the picture: none, a box blur, or a joint bilateral one by depth and normal"
    )
    filter_radius: Radius = Field(default=2, description="of the filter [pixels]; only with one")

    @classmethod
    def rules(cls, given: Mapping[str, Any]) -> Iterator[str]:
        """Yield the faults of keys that another key leaves without use."""
        yield from super().rules(given)
        near, far = given.get("near"), given.get("far")
        if isinstance(near, (int, float)) and isinstance(far, (int, float)) and near >= far:
            yield f"expected far beyond near, got near {near:g} and far {far:g}"
        for key in PUBLISHED_KEYS:
            if key in given and given.get("brightness", "flux") == "flux":
                yield f'expected no {key}, since brightness is "flux"'
        if "filter_radius" in given and given.get("filter", "none") == "none":
            yield 'expected no filter_radius, since filter is "none"'
