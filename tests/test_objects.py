"""Objects that stand on the floor: what they take from the light behind them, they get themselves."""

from __future__ import annotations

import numpy as np
import pytest
from scenery import ANY_SUN, FREE_METHODS, assert_adds_up, refracted, render, save_box, scene

from oracle.cases import sunlight

ROUNDING = 2e-5  # float32 landings a metre away, in pixels of 25 mm

SIDE, MIDDLE = 0.3, (1.0, 0.6)
FLOOR = {"size": (2.0, 1.2), "resolution": (80, 48)}  # square pixels of 25 mm: the box fills 12 by 12


@pytest.mark.parametrize("method", FREE_METHODS)
@pytest.mark.parametrize("zenith", [0.0, 45.0, 65.0])
def test_a_box_on_the_floor_in_closed_form(device, method, zenith, tmp_path):
    direction = sunlight(zenith, 0.0)
    objects = [{"mesh": save_box(tmp_path), "translate": (*MIDDLE, 0.0), "scale": SIDE}]
    what = scene((), {"plane": 0.0, "objects": objects}, direction, **FLOOR)
    result = render(what, method, device)
    light = result.caustic_map / -direction[2]
    assert_adds_up(result)
    # Nothing is lost: the box's top and side get what its shadow lacks.
    assert np.mean(light, dtype=np.float64) == pytest.approx(1.0, rel=ROUNDING)
    pixel = 0.025
    near, far = (MIDDLE[0] - SIDE / 2.0) / pixel, (MIDDLE[0] + SIDE / 2.0) / pixel
    bottom, top = (MIDDLE[1] - SIDE / 2.0) / pixel, (MIDDLE[1] + SIDE / 2.0) / pixel
    length = SIDE * refracted(direction)[0] / pixel  # of the shadow
    column, row = np.arange(80) + 0.5, np.arange(48)[:, None] + 0.5
    beside = (row < bottom - 2) | (row > top + 2) | (column < near - 2) | (column > far + length + 2)
    np.testing.assert_allclose(light[beside], 1.0, rtol=ROUNDING)  # and so there are no streaks
    across = (row > bottom + 1) & (row < top - 1)
    on_top = across & (column > near + 2) & (column < far - 2)
    np.testing.assert_allclose(light[on_top], 1.0, rtol=1e-2)
    if zenith > 0.0:
        shadow = across & (column > far + 1) & (column < far + length - 1)
        assert shadow.any()
        assert light[shadow].max() == 0.0
        rows = slice(int(bottom) + 1, int(top) - 1)
        side = light[rows, int(near) - 2 : int(near) + 2].mean(axis=0).sum() - 4.0
        assert side == pytest.approx(length, rel=0.1)  # the lit side stands on a line of the map


@pytest.mark.parametrize("method", FREE_METHODS)
def test_a_box_that_rises_out_of_the_water_shades_it(device, method, tmp_path):
    objects = [{"mesh": save_box(tmp_path), "translate": (*MIDDLE, 0.0), "scale": SIDE}]
    what = scene((), {"plane": 0.0, "objects": objects}, (0.0, 0.0, -1.0), level=0.2, **FLOOR)
    result = render(what, method, device)
    assert_adds_up(result)
    assert result.energy.blocked == pytest.approx(SIDE**2, rel=1e-2)
    assert result.caustic_map[24, 40] == 0.0
    low = render(what.model_copy(update={"sun": scene(direction=sunlight(60.0, 0.0)).sun}), method, device)
    assert_adds_up(low)
    # 0.1 m above the water, under a sun 60° from the zenith, it shades 0.17 m of the water behind it.
    assert low.energy.blocked / 0.5 == pytest.approx(SIDE * (SIDE + 0.1 * np.tan(np.radians(60.0))), rel=3e-2)


@pytest.mark.parametrize("method", FREE_METHODS)
def test_objects_are_placed_and_scaled(device, method, tmp_path):
    box = save_box(tmp_path)
    places = [((0.5, 0.3, 0.0), 0.2), ((1.5, 0.9, 0.1), 0.1)]
    together = [{"mesh": box, "translate": where, "scale": scale} for where, scale in places]
    dark = []
    for objects in (together, together[:1], together[1:]):
        what = scene((), {"plane": 0.0, "objects": objects}, sunlight(45.0, 0.0), **FLOOR)
        dark.append(render(what, method, device).caustic_map < 0.01)
    assert dark[1].any()
    assert dark[2].any()
    np.testing.assert_array_equal(dark[0], dark[1] | dark[2])
    # A box in mid-water throws its shadow further on.
    columns = np.flatnonzero(dark[2].any(axis=0)) * 0.025
    assert columns.min() > 1.55 - 0.05 + 0.1 * refracted(ANY_SUN)[0]
