"""From measured settings to the rows and slopes of the record."""

from __future__ import annotations

import math
from collections.abc import Sequence
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
    from warp_caustics.comparison.trials import Trial
    from warp_caustics.reference import Reference

QUARTILES = (25.0, 50.0, 75.0)
"""The median of a few times, and a spread that one disturbed frame does not make."""

BROKEN = "the map has values that are not finite"


def measured_row(trial: Trial, reference: Reference, device: str, threads: int | None, time: float) -> Row:
    """Measure a setting, or say why it cannot be."""
    from warp_caustics.comparison.measure import measure

    common: dict[str, Any] = {"method": trial.series.method, "series": trial.series.name, "label": trial.label}
    asked = trial.settings.model_dump(exclude_none=True)
    if trial.refusal is not None:
        return Row(**common, settings=asked, status="refused", reason=trial.refusal)
    measured = measure(trial.scene, device, threads, time)
    finite = bool(np.isfinite(measured.result.caustic_map).all())
    return Row(
        **common,
        settings={**asked, **measured.plan.settings},
        status="measured" if finite else "broken",
        reason=None if finite else BROKEN,
        errors=_errors(measured, reference),
        speed=_speed(measured),
    )


def _errors(measured: Measured, reference: Reference) -> Errors:
    caustic_map, truth = measured.result.caustic_map, reference.caustic_map
    return Errors(
        relative_l2=metrics.relative_l2(caustic_map, truth),
        bias=metrics.bias(caustic_map, truth),
        energy_error=metrics.energy_error(measured.result.energy, reference.energy),
        percentile_999=metrics.percentile_error(caustic_map, truth),
        flip=None if why_not() else flip_error(caustic_map, truth),
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


def with_front(rows: Sequence[Row], error_bar: float) -> list[Row]:
    """Mark the rows on the front, and those whose errors the reference cannot tell apart."""
    timed = [row for row in rows if row.speed is not None and row.errors is not None]
    seconds = [row.speed.milliseconds for row in timed if row.speed is not None]
    errors = [row.errors.relative_l2 for row in timed if row.errors is not None]
    marks = {id(row): mark for row, mark in zip(timed, on_front(seconds, errors, error_bar), strict=True)}
    return [
        row.model_copy(
            update={
                "on_front": marks.get(id(row), False),
                "at_error_bar": row.errors is not None and row.errors.relative_l2 < error_bar,
            }
        )
        for row in rows
    ]


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
