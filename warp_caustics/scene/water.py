"""`[water]`: the surface that refracts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field

from warp_caustics.scene.faults import listed, refusal
from warp_caustics.scene.formats import GEOREFERENCED_SUFFIXES, HEIGHT_SUFFIXES, KEYED_SUFFIXES, suffix
from warp_caustics.scene.model import Model, exactly_one
from warp_caustics.scene.simulation import Simulation
from warp_caustics.scene.spectrum import Spectrum
from warp_caustics.scene.values import Extent, HeightPath, Number, Pair, Said, Text, one_of, truth


def _not_zero(wavevector: tuple[float, float]) -> tuple[float, float]:
    if wavevector == (0.0, 0.0):
        raise refusal("expected a wavevector that is not [0, 0]: a wave of no length is a change of level")
    return wavevector


Wavevector = Annotated[Pair, AfterValidator(_not_zero)]


class Wave(Model):
    """One wave of the water: z = level + a sin(kx x + ky y - ω t + φ)."""

    amplitude: Number = Field(description="a [m]")
    wavevector: Wavevector = Field(description="(kx, ky) [rad/m]")
    phase: Number = Field(default=0.0, description="φ [rad]")
    angular_frequency: Number | None = Field(
        default=None, description="ω [rad/s]; from the dispersion relation of the water's depth when it is not given"
    )


class HeightFile(Model):
    """Heights from a file: z = scale * value + offset."""

    file: HeightPath = Field(
        description="EXR, NPY, NPZ, greyscale image, GeoTIFF or NetCDF; `matplotlib:NAME` is one of matplotlib's "
        "sample files, `bundled:NAME` one that comes with this library. EXR, images and GeoTIFF are read with their "
        "last row at the lowest y, NPY and NPZ with their first"
    )
    origin: Pair | None = Field(
        default=None,
        description="lower corner of the lowest, leftmost sample's cell [m]; a georeferenced file brings its own",
    )
    size: Extent | None = Field(
        default=None, description="extent of all samples' cells [m]; a georeferenced file brings its own"
    )
    scale: Number = Field(default=1.0, description="metres for one unit of the file; images hold raw integers")
    offset: Number = Field(default=0.0, description="added after scaling [m]")
    key: Text | None = Field(
        default=None,
        description="array of an NPZ, variable of a NetCDF, channel of an EXR; needed when there are several",
    )

    @classmethod
    def rules(cls, given: Mapping[str, Any]) -> Iterator[str]:
        """Yield what the kind of file forbids or needs."""
        yield from super().rules(given)
        if ("origin" in given) != ("size" in given):
            yield "expected origin and size together, got only one of them"
        kind = suffix(str(given.get("file", "")))
        if kind not in HEIGHT_SUFFIXES:
            return  # the fault of `file` says enough
        if kind not in GEOREFERENCED_SUFFIXES and not {"origin", "size"} & given.keys():
            yield f"expected origin and size, since a {kind} file does not say where it lies"
        if kind not in KEYED_SUFFIXES and "key" in given:
            yield f"expected no key, since a {kind} file holds one array; {listed(KEYED_SUFFIXES)} files take a key"


class HeightMap(HeightFile):
    """The water's displacement from `level`, from a file."""


class Water(Model):
    """The water surface."""

    level: Number = Field(description="z of the surface at rest [m]")
    waves: Annotated[tuple[Wave, ...], Said("a list of tables")] | None = Field(
        default=None, description="waves, which add up; an empty list is flat water"
    )
    preset: Annotated[Literal["ripples", "waves", "radial"], one_of("ripples", "waves", "radial")] | None = Field(
        default=None,
        description="instead of `waves`: those of Collard & Mundi, laid over the map, four of their units to its "
        "shorter side. `ripples` are their (sin 2x + sin πx) / 2 along both axes, `waves` the same with greater waves "
        "on top, `radial` their A sin(-π d f + t), d being the way from the map's middle; amplitudes, frequencies and "
        "directions are this library's",
    )
    height_map: HeightMap | None = Field(default=None, description="instead of `waves`: displacement from `level`")
    simulation: Simulation | None = Field(default=None, description="instead of `waves`: water that drops fall into")
    spectrum: Spectrum | None = Field(default=None, description="instead of `waves`: a sea, periodic in space")
    self_shadow: Annotated[Literal["auto"] | bool, one_of("auto", other=truth, or_else=", true or false")] = Field(
        default="auto",
        description='crests shade troughs: "auto" is on when the bound of the slope passes the sun\'s elevation',
    )

    @classmethod
    def rules(cls, given: Mapping[str, Any]) -> Iterator[str]:
        """Yield the fault of several kinds of water, or none."""
        yield from super().rules(given)
        yield from exactly_one(given, ("waves", "preset", "height_map", "simulation", "spectrum"))
