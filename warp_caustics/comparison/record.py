"""The record of a comparison: one schema for its JSON, its table and its picture.

Numbers that are infinite, such as the error of a map that is not finite, stand in JSON as ``"Infinity"``.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from warp_caustics.errors import InputError
from warp_caustics.files import whole_file

SCHEMA_VERSION: Final = 1
"""Grows by one whenever a key changes its meaning or goes."""

JSON_NAME, PICTURE_NAME = "compare.json", "compare.png"


class Part(BaseModel):
    """A table of the record."""

    model_config = ConfigDict(frozen=True, extra="forbid", ser_json_inf_nan="strings")


class Machine(Part):
    """Where it was measured."""

    cpu: str = Field(description="name of the processor")
    cores: int = Field(description="cores that the process could use")
    system: str = Field(description="operating system and architecture")
    device: str = Field(description="device by Warp's name: cpu, cuda:0, ...")
    device_name: str = Field(description="name of the device's hardware")
    threads: int = Field(description="threads on the CPU; 1 on a GPU")


class ReferenceRecord(Part):
    """The converged reference that errors are taken against."""

    error_bar: float = Field(description="relative L2 error by which the reference itself may be wrong")
    samples: float = Field(description="its samples per pixel")
    seconds: float = Field(description="what it took when it was computed [s]")
    cached: bool = Field(description="whether it was read from the disk this time")


class Errors(Part):
    """Difference of a setting's map from the reference."""

    relative_l2: float = Field(description="root mean square of the difference, over the mean of the reference")
    bias: float = Field(
        description="mean of the difference over the mean of the reference, signed: the light in the map against that "
        "in the reference's, for whatever reason"
    )
    energy_error: float | None = Field(
        default=None,
        description="light that the method made (above 0) or lost (below 0) by its ledger, against the reference's own "
        "balance, over the light in the reference's map: 0 if all light went somewhere, be it the wrong place; null "
        "for methods that follow no light, and in eye pixels",
    )
    scale: float | None = Field(
        default=None, description="the one factor that brings the map nearest to the reference in the mean square"
    )
    scaled_l2: float | None = Field(default=None, description="relative L2 error of the map times that factor")
    percentile_999: float = Field(
        description="absolute difference that 99.9 % of the values stay under, over the mean of the reference"
    )
    flip: float | None = Field(
        default=None, description="mean HDR-FLIP at fixed exposures, 0 to 1; null where it was skipped"
    )


class ScreenRecord(Part):
    """The reference as the scene's camera sees it, which screen-space methods are judged by."""

    resolution: tuple[int, int] = Field(description="columns, rows of the camera")
    pixels: int = Field(description="eye pixels that are judged: those that see nothing but the map's receiver")
    error_bar: float = Field(
        description="relative L2 error that it may have: the reference's own, and the change when it is carried from a "
        "map of half the resolution"
    )


class Speed(Part):
    """Time and memory of a setting."""

    milliseconds: float = Field(description="median of the warm frames, synchronised, all of one time [ms]")
    milliseconds_low: float = Field(description="their lower quartile [ms]")
    milliseconds_high: float = Field(description="their upper quartile [ms]")
    frames: int = Field(description="frames that were timed, after one that was not unless it was slow itself")
    compile_seconds: float = Field(
        description="building or loading the kernels before [s]; near 0 where a setting before had the same ones, and "
        "short where Warp finds them in its cache on the disk"
    )
    bytes: int = Field(description="all buffers of the plan; meshes' trees and Warp itself come on top")
    samples: int = Field(description="cells or photons of a frame, those beside the map included")
    samples_per_second: float = Field(description="samples over the median time [1/s]")
    pixels_per_second: float = Field(description="pixels of the map over the median time [1/s]")


class Row(Part):
    """One setting of one method."""

    method: str = Field(description="by name")
    series: str = Field(description="settings that differ in one number")
    label: str = Field(description="the setting in a few letters")
    settings: dict[str, Any] = Field(description="as the table of the method in a scene file; found ones filled in")
    status: Literal["measured", "broken", "refused"] = Field(
        description="broken: the map is not finite, its errors are infinite; refused: the method cannot do this scene"
    )
    reason: str | None = Field(default=None, description="why it is broken or refused")
    errors: Errors | None = Field(
        default=None, description="of the map in plan view; null where refused, and for screen-space methods"
    )
    screen_errors: Errors | None = Field(
        default=None,
        description="in eye pixels: of what a screen-space method makes, or of the map as the camera sees it; null "
        "where no screen-space method is measured, and where the camera sees none of the map",
    )
    speed: Speed | None = Field(default=None, description="null where refused")
    on_front: bool = Field(
        default=False, description="more accurate than every faster setting; errors under the error bar are ties"
    )
    on_screen_front: bool = Field(
        default=False, description="the same by the errors in eye pixels; times are of the maps, their look-up apart"
    )
    at_screen_error_bar: bool = Field(default=False, description="the same in eye pixels, under the error bar there")
    at_error_bar: bool = Field(
        default=False, description="error under the reference's error bar: not told apart from others there"
    )


class Slope(Part):
    """How a series' error falls with its count."""

    series: str
    counts: list[float] = Field(description="samples per pixel")
    errors: list[float] = Field(description="relative L2 error at each")
    slope: float | None = Field(
        description="exponent of the count, by least squares in log-log over the errors that stand clear of three "
        "error bars; null if fewer than two do"
    )
    lowest: float | None = Field(default=None, description="lowest count that was fitted")
    highest: float | None = Field(default=None, description="highest count that was fitted")
    expected: str = Field(description="what theory says; empty where it says nothing")


class Published(Part):
    """A speed from a publication, and ours at the same work where there is such."""

    system: str
    hardware: str = Field(description="theirs")
    work: str
    milliseconds_low: float = Field(description="theirs [ms]")
    milliseconds_high: float = Field(description="theirs [ms]")
    source: str
    measured_here: Literal[False] = Field(default=False, description="a figure of others, on hardware of others")
    ours_milliseconds: float | None = Field(
        default=None, description="our gather at the same work on this scene and machine [ms]; null where none"
    )


class Comparison(Part):
    """Error against run time and memory of every method on one scene, in one run on one device."""

    schema_version: Literal[1] = SCHEMA_VERSION
    created: str = Field(description="UTC, ISO 8601")
    commit: str | None = Field(description="of this project, -dirty if changed; null outside a checkout")
    versions: dict[str, str] = Field(description="warp_caustics, python, warp, numpy, and flip where installed")
    machine: Machine
    scene_name: str
    scene: str = Field(description="text of the scene file")
    time: float = Field(description="on the water's clock [s]")
    resolution: tuple[int, int] = Field(description="columns, rows of the map")
    reference: ReferenceRecord
    screen: ScreenRecord | None = Field(default=None, description="null where no screen-space method is measured")
    rows: list[Row]
    slopes: list[Slope]
    published: list[Published]
    flip_skipped: str | None = Field(description="why there is no HDR-FLIP; null where there is")

    @property
    def front(self) -> list[Row]:
        """Rows on the Pareto front of error against time, fastest first."""
        found = [(row.speed.milliseconds, row) for row in self.rows if row.speed is not None and row.on_front]
        return [row for _, row in sorted(found, key=lambda pair: pair[0])]

    @property
    def screen_front(self) -> list[Row]:
        """Rows on the front of the errors in eye pixels against time, fastest first."""
        found = [(row.speed.milliseconds, row) for row in self.rows if row.speed is not None and row.on_screen_front]
        return [row for _, row in sorted(found, key=lambda pair: pair[0])]

    def to_json(self) -> str:
        """Return the record as JSON, by the schema of ``Comparison.model_json_schema()``."""
        return self.model_dump_json(indent=1) + "\n"

    def save(self, folder: str | os.PathLike[str], name: str = Path(JSON_NAME).stem) -> list[Path]:
        """Write the record and its picture, ``compare.json`` and ``compare.png``; the folder is made if need be.

        Parameters
        ----------
        folder
            Where to.
        name
            What the two files are called, without their endings.

        Raises
        ------
        InputError
            If the folder cannot be made or written.
        """
        from .picture import draw

        folder = Path(folder)
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"the folder {str(folder)!r} cannot be made: {error.strerror or error}") from None
        files = [folder / f"{name}.json", folder / f"{name}.png"]
        picture = draw(self)  # before anything is written
        with whole_file(files[0]) as temporary:
            temporary.write_text(self.to_json(), encoding="utf-8")
        with whole_file(files[1]) as temporary:
            picture.savefig(temporary, format="png")
        return files


def load_comparison(path: str | os.PathLike[str]) -> Comparison:
    """Read a record back.

    Raises
    ------
    InputError
        If it cannot be read, or is no record of this version.
    """
    try:
        return Comparison.model_validate_json(Path(path).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{os.fspath(path)}: cannot be read: {error}") from None
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise InputError(
            f"{os.fspath(path)}: expected a comparison of schema version {SCHEMA_VERSION}: {where}: {first['msg']}"
        ) from None
