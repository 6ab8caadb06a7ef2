"""What is compared: series of settings of each method, each series by a count that grows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from warp_caustics.errors import InputError
from warp_caustics.scene import (
    AreaRatioSettings,
    BeamSettings,
    CascadedSettings,
    DifferentialSettings,
    GatherSettings,
    PatternSettings,
    PhotonSettings,
    SampleSettings,
    Scene,
)

Settings = (
    BeamSettings
    | PhotonSettings
    | GatherSettings
    | CascadedSettings
    | SampleSettings
    | PatternSettings
    | AreaRatioSettings
    | DifferentialSettings
)

BEAM_COUNTS = (1 / 16, 1 / 4, 1.0, 4.0, 16.0)
"""Cells per pixel: steps of 4 pixels to a quarter of one."""

PHOTON_COUNTS = (1.0, 4.0, 16.0, 64.0)
PIXEL_COUNTS = (1.0, 4.0, 16.0)
"""A box of a pixel's width is at its floor by then."""

BACKLUND_COUNTS = (1.0, 4.0)
"""More photons do not mend where Eq. 3.3 puts them."""

AREA_RATIO_COUNTS = (1.0, 4.0, 16.0)
"""More cells do not make pixel centres denser."""

DIFFERENTIAL_COUNTS = (1 / 4, 1.0, 4.0)

CASCADE_TEXELS = (256, 512, 1024)
"""Along a side of each light view; the last is the default."""

PUBLISHED_N = 7
"""Yuksel & Keyser's window; it keeps M = N - 1 neighbours."""

SAMPLE_STEPS = (2, 4, 8)
"""Around Collard & Mundi's own: what they look up is not where light goes, however often they look."""

COUNT_KEY = {
    "beam": "samples_per_pixel",
    "photon": "photons_per_pixel",
    "area_ratio": "samples_per_pixel",
    "differential": "photons_per_pixel",
    "sample": "sample_steps",
}
"""The setting that counts what lands on a pixel."""


@dataclass(frozen=True)
class Series:
    """Settings of one method that differ in one number.

    Attributes
    ----------
    name : str
        Starts with the method's.
    method : str
        By name.
    settings : tuple of Settings
        In the order of the number.
    expected : str
        How its error should fall with the count, in words; empty where there is no count or nothing is known.
    """

    name: str
    method: str
    settings: tuple[Settings, ...]
    expected: str = ""

    def count(self, settings: Settings) -> float | None:
        """Samples per pixel of a setting, or None."""
        key = COUNT_KEY.get(self.method)
        return None if key is None else float(getattr(settings, key))


def _beams(refine: bool) -> tuple[Settings, ...]:
    return tuple(BeamSettings(samples_per_pixel=count, refine=refine) for count in BEAM_COUNTS)


def _photons(counts: Sequence[float], footprint: str, projection: str = "exact") -> tuple[Settings, ...]:
    return tuple(
        PhotonSettings.model_validate({"photons_per_pixel": n, "footprint": footprint, "projection": projection})
        for n in counts
    )


def _samples(counts: Sequence[int]) -> tuple[Settings, ...]:
    """As bright with more samples as with the number of the defaults: past 1 the map would be cut off."""
    usual = SampleSettings()
    return tuple(
        SampleSettings(sample_steps=n, base_intensity=usual.base_intensity * ((usual.sample_steps + 1) / (n + 1)) ** 2)
        for n in counts
    )


def _cascades(texels: Sequence[int], **chosen: Any) -> tuple[Settings, ...]:
    return tuple(CascadedSettings.model_validate({"resolution": n, **chosen}) for n in texels)


def _area_ratios(area: str, overlap: str) -> tuple[Settings, ...]:
    return tuple(
        AreaRatioSettings.model_validate({"samples_per_pixel": n, "area": area, "overlap": overlap})
        for n in AREA_RATIO_COUNTS
    )


def _differentials(footprint: str) -> tuple[Settings, ...]:
    return tuple(
        DifferentialSettings.model_validate({"photons_per_pixel": n, "footprint": footprint})
        for n in DIFFERENTIAL_COUNTS
    )


SERIES: dict[str, tuple[Series, ...]] = {
    "beam": (
        Series("beam", "beam", _beams(True)),
        Series("beam unrefined", "beam", _beams(False), "-1: as the square of the step"),
    ),
    "photon": (
        Series("photon point", "photon", _photons(PHOTON_COUNTS, "point"), "-0.4 to -0.8: points on a lattice"),
        Series("photon pixel", "photon", _photons(PIXEL_COUNTS, "pixel"), "a floor: the box's own blur"),
        Series("photon cell", "photon", _photons(PHOTON_COUNTS, "cell")),
        Series("photon Eq. 3.3", "photon", _photons(BACKLUND_COUNTS, "cell", "backlund"), "a floor: misplaced light"),
    ),
    "gather": (Series("gather", "gather", (GatherSettings(n=PUBLISHED_N), GatherSettings())),),
    "cascaded": (
        Series("cascaded", "cascaded", _cascades(CASCADE_TEXELS)),
        Series("cascaded Eq. 3.3", "cascaded", _cascades((512,), projection="backlund"), "a floor: misplaced light"),
        Series(
            "cascaded published",
            "cascaded",
            _cascades((1024,), projection="backlund", footprint="point", blend=0.0, brightness="published"),
            "none: brightness is a constant",
        ),
    ),
    "area_ratio": (
        Series("area_ratio", "area_ratio", _area_ratios("derivatives", "add"), "none: light is invented"),
        Series("area_ratio latest", "area_ratio", _area_ratios("derivatives", "latest"), "none: light is invented"),
        Series("area_ratio cross", "area_ratio", _area_ratios("cross", "add"), "a floor: pixel centres"),
    ),
    "differential": (
        Series("differential ellipse", "differential", _differentials("ellipse")),
        Series("differential parallelogram", "differential", _differentials("parallelogram")),
    ),
    "pattern": (Series("pattern", "pattern", (PatternSettings(),), "none: a picture, not this water"),),
    "sample": (Series("sample", "sample", _samples(SAMPLE_STEPS)),),
}
"""By method, what is tried. A method joins the comparison by its line here."""


def chosen_methods(names: Sequence[str] | str | None) -> list[str]:
    """Return the methods to compare, each once; all of them when left out.

    Raises
    ------
    InputError
        If one is not known, with those that are.
    """
    if names is None:
        return list(SERIES)
    if isinstance(names, str):
        names = [names]
    wanted = list(dict.fromkeys(name.strip() for name in names))
    unknown = [name for name in wanted if name not in SERIES]
    if unknown or not wanted:
        got = ", ".join(repr(name) for name in unknown) or "none"
        raise InputError(f"methods: expected some of {', '.join(SERIES)}, got {got}")
    return wanted


def series_of(scene: Scene, method: str) -> tuple[Series, ...]:
    """Return what is tried of a method on a scene: the shared series, and the scene's own settings if they are new."""
    shared = SERIES[method]
    own: Settings = getattr(scene.method, method)
    if any(own == settings for series in shared for settings in series.settings):
        return shared
    return (*shared, Series(f"{method} as in the scene", method, (own,)))


def with_settings(scene: Scene, method: str, settings: Settings) -> Scene:
    """Return the scene with a method and its settings; how flux is summed stays the scene's own."""
    return scene.model_copy(update={"method": scene.method.model_copy(update={"name": method, method: settings})})


def label(series: Series, settings: Settings, found: Mapping[str, Any]) -> str:
    """Name a setting in a few letters, the series' name first; `found` is what the plan made of the settings."""
    if isinstance(settings, GatherSettings):
        n = found.get("n", settings.n)
        return series.name + ("" if n is None else f" N={n}") + (" auto" if settings.n is None else "")
    if isinstance(settings, CascadedSettings):
        return f"{series.name} {settings.resolution}"
    count = series.count(settings)
    return series.name if count is None else f"{series.name} {Fraction(count).limit_denominator(1000)}"
