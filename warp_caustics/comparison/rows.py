"""From measured settings to the rows and slopes of the record."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from warp_caustics import metrics
from warp_caustics.comparison.flip import flip_error, why_not
from warp_caustics.comparison.front import on_front
from warp_caustics.comparison.record import Errors, Row, Slope, Speed
from warp_caustics.comparison.settings import COUNT_KEY, SERIES
from warp_caustics.comparison.slopes import fit_slope

if TYPE_CHECKING:
    from warp_caustics.comparison.measure import Measured
    from warp_caustics.comparison.screen import CarriedReference
    from warp_caustics.comparison.trials import Trial
    from warp_caustics.reference import Reference
    from warp_caustics.result import Result

QUARTILES = (25.0, 50.0, 75.0)
"""The median of a few times, and a spread that one disturbed frame does not make."""

BROKEN = "the map has values that are not finite"
UNSEEN = "no pixel of the camera sees the map alone, so there is nothing to judge"


@dataclass(frozen=True)
class Truth:
    """What settings are judged by.

    Attributes
    ----------
    reference : Reference
        In plan view.
    carried : CarriedReference or None
        As the camera sees it; None without one.
    """

    reference: Reference
    carried: CarriedReference | None


def measured_row(trial: Trial, truth: Truth, device: str, threads: int | None, time: float) -> Row:
    """Measure a setting, or say why it cannot be."""
    from warp_caustics.comparison.measure import measure

    common: dict[str, Any] = {"method": trial.series.method, "series": trial.series.name, "label": trial.label}
    asked = trial.settings.model_dump(exclude_none=True)
    if trial.refusal is not None:
        return Row(**common, settings=asked, status="refused", reason=trial.refusal)
    measured = measure(trial.scene, device, threads, time)
    errors = _map_errors(measured.result, truth.reference)
    screen_errors = _screen_errors(measured.result, truth.carried)
    if errors is None and screen_errors is None:
        return Row(**common, settings=asked, status="refused", reason=UNSEEN)
    finite = bool(np.isfinite(measured.result.image).all())
    return Row(
        **common,
        settings={**asked, **measured.plan.settings},
        status="measured" if finite else "broken",
        reason=None if finite else BROKEN,
        errors=errors,
        screen_errors=screen_errors,
        speed=_speed(measured),
    )


def _map_errors(result: Result, reference: Reference) -> Errors | None:
    if result.caustic_map is None:
        return None
    energy = None if result.energy is None else metrics.energy_error(result.energy, reference.energy)
    flip = None if why_not() else flip_error(result.caustic_map, reference.caustic_map)
    return _errors(result.caustic_map, reference.caustic_map, energy_error=energy, flip=flip)


def _screen_errors(result: Result, carried: CarriedReference | None) -> Errors | None:
    if carried is None or not carried.irradiance.size:
        return None
    if result.caustic_map is not None:
        return _errors(carried.carried(result.caustic_map), carried.irradiance)
    return _errors(carried.judged(result.image), carried.irradiance)


def _errors(image: np.ndarray, truth: np.ndarray, **more: float | None) -> Errors:
    if image.ndim < truth.ndim:
        image = np.repeat(image[..., None], truth.shape[-1], axis=-1)
    scale = metrics.best_scale(image, truth)
    return Errors(
        relative_l2=metrics.relative_l2(image, truth),
        bias=metrics.bias(image, truth),
        percentile_999=metrics.percentile_error(image, truth),
        scale=scale,
        scaled_l2=metrics.relative_l2(scale * image, truth),
        **more,
    )


def _speed(measured: Measured) -> Speed:
    plan = measured.plan
    lower, seconds, upper = (float(quartile) for quartile in np.percentile(measured.seconds, QUARTILES))
    samples = plan.samples
    return Speed(
        milliseconds=1e3 * seconds,
        milliseconds_low=1e3 * lower,
        milliseconds_high=1e3 * upper,
        frames=len(measured.seconds),
        compile_seconds=measured.compile_seconds,
        bytes=plan.bytes,
        samples=samples,
        samples_per_second=samples / seconds,
        pixels_per_second=math.prod(plan.facts.scene.map.resolution) / seconds,
    )


def with_fronts(rows: Sequence[Row], truth: Truth) -> list[Row]:
    """Mark the rows on the fronts, of maps and of eye pixels, and those that the reference cannot tell apart."""
    bar, carried = truth.reference.error_bar, truth.carried
    eye_bar = 0.0 if carried is None else carried.error_bar
    maps = _marks([row.errors for row in rows], rows, bar)
    screens = _marks([row.screen_errors for row in rows], rows, eye_bar)
    return [
        row.model_copy(
            update={
                "on_front": on_map,
                "on_screen_front": on_screen,
                "at_error_bar": row.errors is not None and row.errors.relative_l2 < bar,
                "at_screen_error_bar": row.screen_errors is not None and row.screen_errors.relative_l2 < eye_bar,
            }
        )
        for row, on_map, on_screen in zip(rows, maps, screens, strict=True)
    ]


def _marks(errors: Sequence[Errors | None], rows: Sequence[Row], bar: float) -> list[bool]:
    """Tell which rows are on a front; a row without an error is on none."""
    seconds = [math.inf if row.speed is None else row.speed.milliseconds for row in rows]
    return on_front(seconds, [math.inf if error is None else error.relative_l2 for error in errors], bar)


def slopes_of(rows: Sequence[Row], error_bar: float) -> list[Slope]:
    """Fit each series that has a count."""
    found = []
    for series in (series for group in SERIES.values() for series in group if series.method in COUNT_KEY):
        mine = [row for row in rows if row.series == series.name and row.errors is not None]
        counts = [float(row.settings[COUNT_KEY[series.method]]) for row in mine]
        errors = [row.errors.relative_l2 for row in mine if row.errors is not None]
        if mine:
            found.append(slope_of(series.name, counts, errors, error_bar, series.expected))
    return found


def slope_of(series: str, counts: list[float], errors: list[float], error_bar: float, expected: str) -> Slope:
    """Fit a series, and say over which range.

    A series that is no setting of a method, such as jittered photons of the reference, joins by this.
    """
    fit = fit_slope(counts, errors, error_bar)
    return Slope(
        series=series,
        counts=counts,
        errors=errors,
        slope=None if fit is None else fit.slope,
        lowest=None if fit is None else fit.lowest,
        highest=None if fit is None else fit.highest,
        expected=expected,
    )
