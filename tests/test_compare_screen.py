"""Errors in eye pixels: the reference carried to what a camera sees, and the methods that are judged there."""

from types import SimpleNamespace

import numpy as np
import pytest
from scenery import GENTLE, scene

import warp_caustics as wc
from warp_caustics import metrics
from warp_caustics.assets import load_assets
from warp_caustics.comparison.rows import Truth, _errors, _map_errors, _screen_errors, with_fronts
from warp_caustics.comparison.screen import CarriedReference

EYE = {"position": (1.0, -1.0, 2.0), "target": (1.0, 0.5, 0.0), "vertical_fov": 60.0, "resolution": (40, 30)}
LOOKED_UP = 1e-5  # float32 positions on the map, and bilinear weights


@pytest.fixture
def what():
    return scene(GENTLE, camera=EYE, resolution=(64, 48))


def carried(what, image, device, bar=0.0):
    reference = SimpleNamespace(caustic_map=image, error_bar=bar, energy=None)
    return CarriedReference(what, load_assets(what), what.camera, reference, device)


def test_a_uniform_reference_is_uniform_in_the_eye(what, device):
    seen = carried(what, np.full((48, 64), 0.7), device, bar=0.01)
    assert 0 < seen.irradiance.size < 40 * 30  # the map's border is in the picture
    np.testing.assert_allclose(seen.irradiance, 0.7, rtol=LOOKED_UP)
    assert seen.error_bar == pytest.approx(0.01)  # nothing moves when a uniform map is carried


def test_a_ramp_is_read_where_each_pixel_looks(what, device):
    """The mean of a ramp over a pixel's lines of sight is the ramp at their mean, whatever the map's resolution."""

    def ramp(columns, rows):
        x, y = (np.arange(columns) + 0.5) / columns, (np.arange(rows) + 0.5) / rows
        return 1.0 + x[None, :] + 2.0 * y[:, None]

    fine, coarse = carried(what, ramp(64, 48), device), carried(what, ramp(32, 24), device)
    away = np.abs(fine.irradiance - coarse.irradiance)
    # Half a pixel at the border has no neighbour to be bilinear with.
    assert np.quantile(away, 0.9) < LOOKED_UP and away.max() < 2.0 / 48
    assert fine.irradiance.min() < 1.3 and fine.irradiance.max() > 3.0


def test_detail_finer_than_the_map_is_in_the_error_bar(what, device):
    noise = np.random.default_rng(1).uniform(0.5, 1.5, (48, 64))
    assert carried(what, noise, device).error_bar > 0.05


def test_a_map_is_judged_in_both_and_a_picture_in_the_eye_alone(what, device):
    reference = SimpleNamespace(caustic_map=wc.render(what, device=device).caustic_map.astype(float), error_bar=1e-4)
    seen = carried(what, reference.caustic_map, device)
    image = np.zeros((30, 40), dtype=np.float32)
    image[seen._gaze.inside] = 2.0 * seen.irradiance
    looks = SimpleNamespace(caustic_map=None, image=image, energy=None)
    assert _map_errors(looks, reference) is None
    errors = _screen_errors(looks, seen)
    assert errors.bias == pytest.approx(1.0, rel=1e-4) and errors.energy_error is None
    assert errors.scale == pytest.approx(0.5, rel=1e-4) and errors.scaled_l2 < LOOKED_UP

    plan_view = SimpleNamespace(caustic_map=reference.caustic_map.astype(np.float32), energy=None)
    assert _map_errors(plan_view, reference).relative_l2 < LOOKED_UP
    assert _screen_errors(plan_view, seen).relative_l2 < LOOKED_UP
    assert _screen_errors(plan_view, None) is None


def test_a_grey_picture_is_judged_against_colour():
    truth = np.array([[1.0, 2.0, 3.0]])
    assert _errors(np.array([2.0]), truth).relative_l2 == pytest.approx(np.sqrt(2.0 / 3.0) / 2.0)


def test_the_best_scale():
    assert metrics.best_scale(np.array([1.0, 2.0]), np.array([3.0, 6.0])) == pytest.approx(3.0)
    assert metrics.best_scale(np.array([1.0, 0.0]), np.array([3.0, 6.0])) == pytest.approx(3.0)
    assert metrics.best_scale(np.zeros(2), np.ones(2)) == 1.0
    assert metrics.best_scale(np.array([np.nan, 1.0]), np.ones(2)) == 1.0


def test_each_front_has_its_own_rows():
    from warp_caustics.comparison.record import Errors, Row, Speed

    def row(label, map_error, eye_error, milliseconds):
        def errors(value):
            return None if value is None else Errors(relative_l2=value, bias=0.0, percentile_999=value)

        speed = Speed(milliseconds=milliseconds, milliseconds_low=1.0, milliseconds_high=1.0, frames=3,
                      compile_seconds=0.0, bytes=1, samples=1, samples_per_second=1.0,
                      pixels_per_second=1.0)  # fmt: skip
        return Row(method="m", series="s", label=label, settings={}, status="measured", errors=errors(map_error),
                   screen_errors=errors(eye_error), speed=speed)  # fmt: skip

    rows = [row("map", 0.1, 0.2, 5.0), row("eye", None, 0.1, 4.0), row("slow", 0.3, 0.3, 9.0)]
    marked = with_fronts(rows, Truth(SimpleNamespace(error_bar=0.0), SimpleNamespace(error_bar=0.0)))
    assert [one.on_front for one in marked] == [True, False, False]
    assert [one.on_screen_front for one in marked] == [False, True, False]


def test_a_camera_that_sees_nothing_of_the_map_is_told(what, device, monkeypatch):
    """There is no error to show, and a row of dashes would not say why."""
    from warp_caustics.comparison import measure, rows
    from warp_caustics.comparison.settings import series_of, with_settings
    from warp_caustics.comparison.trials import Trial

    away = what.model_copy(update={"camera": what.camera.model_copy(update={"target": (1.0, -3.0, 4.0)})})
    seen = carried(away, np.ones((48, 64)), device)
    assert not seen.irradiance.size
    (series,) = series_of(away, "pattern")
    trial = Trial(series, series.settings[0], "pattern", with_settings(away, "pattern", series.settings[0]), None, True)
    monkeypatch.setattr(measure, "measure", lambda *_: SimpleNamespace(result=SimpleNamespace(caustic_map=None)))
    row = rows.measured_row(trial, Truth(SimpleNamespace(error_bar=0.0), seen), device, 1, 0.0)
    assert row.status == "refused" and row.reason == rows.UNSEEN
