"""The numbers of a comparison, on arrays and points worked by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

import warp_caustics as wc
from warp_caustics import metrics
from warp_caustics.comparison import flip
from warp_caustics.comparison.front import on_front
from warp_caustics.comparison.slopes import fit_slope
from warp_caustics.energy import Energy

EXACT = 1e-12  # float64 sums of a few numbers
REFERENCE = np.array([[1.0, 2.0], [3.0, 2.0]])  # mean 2
MAP = np.array([[1.0, 2.0], [3.0, 6.0]], dtype=np.float32)  # off by 4 in one pixel of four
DARK = np.zeros((2, 2))


def energy(**entries: float) -> Energy:
    names = Energy.__dataclass_fields__
    return Energy(**{**dict.fromkeys(names, 0.0), **entries})


def test_errors_by_hand():
    assert metrics.relative_l2(MAP, REFERENCE) == pytest.approx(math.sqrt(16.0 / 4.0) / 2.0, rel=EXACT)
    assert metrics.bias(MAP, REFERENCE) == pytest.approx(0.5, rel=EXACT)
    assert metrics.bias(REFERENCE, MAP.astype(float)) == pytest.approx(-1.0 / 3.0, rel=EXACT)
    # 3 values of 0 and one of 4: 99.9 % of the way lies 0.997 of the way from the third to the fourth
    assert metrics.percentile_error(MAP, REFERENCE) == pytest.approx(4.0 * 0.997 / 2.0, rel=EXACT)
    assert metrics.relative_l2(REFERENCE, REFERENCE) == 0.0


def test_colour_counts_all_channels_alike():
    grey = np.repeat(REFERENCE[..., None], 3, axis=2)
    red = grey.copy()
    red[1, 1, 0] += 4.0
    assert metrics.relative_l2(red, grey) == pytest.approx(math.sqrt(16.0 / 12.0) / 2.0, rel=EXACT)
    assert metrics.bias(red, grey) == pytest.approx(4.0 / 12.0 / 2.0, rel=EXACT)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("metric", [metrics.relative_l2, metrics.bias, metrics.percentile_error])
def test_a_map_that_is_not_finite_is_infinitely_wrong(metric, value):
    broken = REFERENCE.copy()
    broken[0, 1] = value
    assert metric(broken, REFERENCE) == math.inf
    assert metric(REFERENCE, broken) == math.inf


@pytest.mark.parametrize("metric", [metrics.relative_l2, metrics.bias, metrics.percentile_error])
def test_a_dark_reference(metric):
    assert metric(DARK, DARK) == 0.0
    assert metric(REFERENCE, DARK) == math.inf


def test_maps_of_other_shapes_are_refused():
    with pytest.raises(wc.InputError, match="shape"):
        metrics.relative_l2(REFERENCE, np.ones((2, 3)))


def test_energy_error_is_what_is_lost_or_made():
    reference = energy(emitted=12.0, received=8.0, outside_map=2.0, missed_by_window=2.0)  # a height map's border
    assert metrics.energy_error(reference, reference) == 0.0
    # another window, and light put beside the map: nothing is lost
    beside = energy(emitted=22.0, received=7.0, outside_map=13.0, missed_by_window=2.0)
    assert metrics.energy_error(beside, reference) == 0.0
    lost = energy(emitted=12.0, received=6.0, outside_map=2.0, missed_by_window=3.0, dropped=1.0)
    assert metrics.energy_error(lost, reference) == pytest.approx(-2.0 / 8.0, rel=EXACT)
    unaccounted = energy(emitted=12.0, received=7.0, outside_map=2.0, missed_by_window=2.0)
    assert metrics.energy_error(unaccounted, reference) == pytest.approx(-1.0 / 8.0, rel=EXACT)
    twice = energy(emitted=14.0, received=10.0, outside_map=2.0, missed_by_window=2.0, over_lit=2.0)
    assert metrics.energy_error(twice, reference) == pytest.approx(2.0 / 8.0, rel=EXACT)
    assert metrics.energy_error(energy(emitted=math.nan), reference) == math.inf
    assert metrics.energy_error(energy(), energy()) == 0.0
    assert metrics.energy_error(energy(emitted=1.0), energy()) == -math.inf


def test_the_front_by_hand():
    seconds = [1.0, 2.0, 3.0, 4.0, 2.5, 5.0]
    errors = [9.0, 5.0, 6.0, 1.0, 5.0, math.inf]
    assert on_front(seconds, errors) == [True, True, False, True, False, False]


def test_errors_under_the_bar_are_ties_that_the_fastest_wins():
    assert on_front([1.0, 2.0, 3.0], [0.5, 0.009, 0.0001], error_bar=0.01) == [True, True, False]
    assert on_front([1.0, 2.0, 3.0], [0.5, 0.009, 0.0001]) == [True, True, True]


def test_errors_that_differ_by_rounding_are_one():
    assert on_front([1.0, 2.0], [0.18286335, 0.18286334]) == [True, False]


def test_a_nan_error_is_on_no_front():
    assert on_front([1.0, 2.0], [math.nan, 0.5]) == [False, True]
    assert on_front([], []) == []


def test_a_power_law_is_found_again():
    counts = [1.0, 4.0, 16.0, 64.0]
    fit = fit_slope(counts, [2.0 * n**-0.75 for n in counts])
    assert fit is not None
    assert fit.slope == pytest.approx(-0.75, rel=EXACT)
    assert (fit.lowest, fit.highest) == (1.0, 64.0)


def test_what_is_near_the_bar_or_broken_is_not_fitted():
    fit = fit_slope([1.0, 4.0, 16.0, 64.0], [1.0, 0.25, 0.02, math.inf], error_bar=0.01)
    assert fit is not None
    assert fit.slope == pytest.approx(-1.0, rel=EXACT)
    assert (fit.lowest, fit.highest) == (1.0, 4.0)
    assert fit_slope([1.0, 4.0], [1.0, 0.001], error_bar=0.01) is None
    assert fit_slope([2.0, 2.0], [1.0, 0.5]) is None


# --- HDR-FLIP --------------------------------------------------------------------------------------------------------


def test_flip_guards_itself_without_being_asked(monkeypatch):
    """A dark reference and a broken map never reach the package, which the test does without."""
    monkeypatch.setitem(__import__("sys").modules, "flip_evaluator", None)
    assert flip.flip_error(REFERENCE, DARK) is None
    assert flip.flip_error(REFERENCE, np.full((2, 2), math.nan)) is None
    assert flip.flip_error(np.full((2, 2), math.nan), REFERENCE) == math.inf


def test_flip_grows_with_the_error():
    pytest.importorskip("flip_evaluator")
    rng = np.random.default_rng(3)
    reference = 0.5 + rng.random((24, 24))
    assert flip.flip_error(reference, reference) == 0.0
    small, large = (flip.flip_error(reference * factor, reference) for factor in (1.05, 1.5))
    assert small is not None
    assert large is not None
    assert 0.0 < small < large <= 1.0
    # exposures follow the reference's mean, so that units do not matter
    brighter = flip.flip_error(1050.0 * reference, 1000.0 * reference)
    assert brighter == pytest.approx(small, rel=1e-3)  # float32 pictures
