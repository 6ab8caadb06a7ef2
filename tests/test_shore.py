"""Receivers of every kind: land that rises out of the water, one floor given in several ways, and water from files."""

from __future__ import annotations

import numpy as np
import pytest
from scenery import (
    FREE_METHODS,
    GENTLE,
    LEDGER,
    METHODS,
    assert_adds_up,
    refracted,
    relative_l2,
    render,
    sample_points,
    save_heights,
    save_quad,
    scene,
    sum_of_waves,
    wave,
)

import warp_caustics as wc
from oracle.cases import sunlight

ROUNDING = 2e-5  # float32 landings a few metres away, in pixels of some centimetres
# A shoreline is cut to 1/16 of a cell in the beam's pixels, and to the box of a photon in the photon's.
SHORELINE = {"beam": 5e-3, "photon": 5e-2}
# The same scene on another lattice: a beam is right to its own error, photons leave the noise of 4 a pixel.
OTHER_LATTICE = {"beam": 2e-3, "photon": 8e-2}
HEIGHT_MAP = 5e-4  # bicubic through 15 and more samples a wave, its slopes right to the fourth order
DRY_PARTS = 2e-3  # dry land is sampled 4 by 4 times in a pixel, here against 8 by 8
SHADE = 4e-2  # an edge of shadow on it is filtered over a pixel of 5 cm by one ray; without shade it is ten times that
CUT_CELL = 1e-3  # [W] of 4: light of a cell that the border cuts, spread over the cell whole


# --- land ----------------------------------------------------------------------------------------------------------


def share_of_land(what, level, parts=64):
    """Share of each pixel in which a sloping plane stands above flat water."""
    terrain, (columns, rows) = what.receiver.terrain, what.map.resolution
    x, y = sample_points((rows * parts, columns * parts), what.map.origin, what.map.size)
    land = terrain.base + terrain.slope[0] * x + terrain.slope[1] * y > level
    return land.reshape(rows, parts, columns, parts).mean(axis=(1, 3))


def _inner(kind):
    """Pixels of a kind whose neighbours are of it too."""
    return kind & np.roll(kind, 1, 0) & np.roll(kind, -1, 0) & np.roll(kind, 1, 1) & np.roll(kind, -1, 1)


@pytest.mark.parametrize("method", FREE_METHODS)
@pytest.mark.parametrize("slope", [(0.5, 0.15), (-0.3, 0.4)])
@pytest.mark.parametrize("direction", [(0.0, 0.0, -1.0), sunlight(30.0, 25.0), sunlight(50.0, 200.0)])
def test_a_beach_under_flat_water_in_closed_form(device, method, slope, direction):
    # Wet, it gets |I_z| (1 + slope . R_xy / |R_z|) by horizontal area: the landing's Jacobian. Dry, it gets the light
    # that its slope faces. A pixel on the shoreline gets each by its share.
    what = scene(
        (), {"terrain": {"base": 0.6, "slope": slope}}, direction, origin=(-0.2, -0.1), size=(2.0, 1.6),
        resolution=(48, 40), method={"photon": {"photons_per_pixel": 16.0, "footprint": "pixel"}},
    )  # fmt: skip
    result = render(what, method, device)
    wet = -direction[2] * (1.0 + np.dot(slope, refracted(direction)))
    dry = max(0.0, -direction[2] + np.dot(slope, direction[:2]))
    land = share_of_land(what, 1.0)
    assert 0.05 < land.mean() < 0.95
    expected = (1.0 - land) * wet + land * dry
    on_land, under_water = (_inner(kind) for kind in (land == 1.0, land == 0.0))
    np.testing.assert_allclose(result.caustic_map[on_land], dry, rtol=ROUNDING)
    assert result.caustic_map[under_water].mean() == pytest.approx(wet, rel=SHORELINE[method])
    if method == "beam":  # the boxes of photons do not tile where the slope draws them apart
        np.testing.assert_allclose(result.caustic_map[under_water], wet, rtol=ROUNDING)
    assert relative_l2(result.caustic_map, expected) < SHORELINE[method]
    assert_adds_up(result)
    pixel_area = np.prod(what.map.size) / np.prod(what.map.resolution)
    assert result.energy.dry == pytest.approx((land * dry).sum() * pixel_area, rel=1e-3)


@pytest.mark.parametrize("method", FREE_METHODS)
def test_land_that_faces_away_is_dark(device, method):
    direction = sunlight(60.0, 0.0)
    what = scene((), {"terrain": {"base": 3.0, "slope": (-2.0, 0.0)}}, direction, size=(2.0, 0.5), resolution=(40, 10))
    result = render(what, method, device)
    assert result.caustic_map[:, :18].max() == 0.0
    assert result.energy.dry == 0.0
    assert_adds_up(result)


def hills_and_slopes(x, y, slope, waves):
    """Height above the base and slope (z, z_x, z_y) of a tilted plane with waves."""
    z = slope[0] * x + slope[1] * y
    zx, zy = (np.full(z.shape, part) for part in slope)
    for one in waves:
        (kx, ky), height = one["wavevector"], one["amplitude"]
        angle = kx * x + ky * y + one["phase"]
        z = z + height * np.sin(angle)
        zx, zy = zx + kx * height * np.cos(angle), zy + ky * height * np.cos(angle)
    return z, zx, zy


def sunlit(x, y, z, direction, slope, waves, way=3.0, steps=600):
    """Whether no hill stands between points and the sun, looked at every half a centimetre."""
    clear = np.ones(z.shape, dtype=bool)
    for t in np.linspace(0.0, way, steps + 1)[1:]:
        clear &= z - t * direction[2] >= hills_and_slopes(x - t * direction[0], y - t * direction[1], slope, waves)[0]
    return clear


@pytest.mark.parametrize("method", FREE_METHODS)
@pytest.mark.parametrize(("zenith", "allowed"), [(20.0, DRY_PARTS), (60.0, SHADE)])
def test_hills_above_the_water_get_the_light_that_they_face(device, method, zenith, allowed):
    waves = [wave(0.3, 4.0, 2.0, 0.4), wave(0.2, -3.0, 5.0, 1.0)]
    direction, slope = np.array(sunlight(zenith, 25.0)), (0.3, -0.2)
    what = scene(GENTLE, {"terrain": {"base": 3.0, "slope": slope, "waves": waves}}, tuple(direction))
    result = render(what, method, device)
    parts, (rows, columns) = 8, result.caustic_map.shape
    x, y = np.broadcast_arrays(*sample_points((rows * parts, columns * parts), what.map.origin, what.map.size))
    z, zx, zy = hills_and_slopes(x, y, slope, waves)
    faced = np.maximum(0.0, zx * direction[0] + zy * direction[1] - direction[2])
    lit = sunlit(x, y, z, direction, slope, waves)
    shaded = float(np.mean(~lit & (faced > 0.0)))
    assert (shaded > 0.05) == (allowed == SHADE)  # the low sun leaves shade where the land faces it
    faced = faced * lit
    expected = faced.reshape(rows, parts, columns, parts).mean(axis=(1, 3))
    assert relative_l2(result.caustic_map, expected) < allowed
    assert result.energy.received == pytest.approx(0.0, abs=LEDGER)
    assert result.energy.dry == pytest.approx(faced.mean() * np.prod(what.map.size), rel=allowed)


@pytest.mark.parametrize("method", FREE_METHODS)
def test_ridges_light_their_fronts_and_shade_the_water_behind_them(device, method):
    # Ridges two metres apart rise 0.2 m out of flat water. Whatever the light meets first, a whole period of the map
    # gets what comes through it.
    direction = sunlight(60.0, 0.0)
    ridges = {"terrain": {"base": 0.6, "waves": [wave(0.6, np.pi, 0.0)]}}
    result = render(scene((), ridges, direction, size=(4.0, 0.5), resolution=(64, 8)), method, device)
    light = result.caustic_map.mean(axis=0)
    assert light.mean() == pytest.approx(0.5, rel={"beam": 1e-4, "photon": 3e-2}[method])
    assert result.energy.blocked > 0.0
    assert light[4] > 1.5  # the front of a ridge, x = 0.28, faces the sun
    assert light[12:24].max() == 0.0  # its back and the water behind it do not
    assert_adds_up(result)


@pytest.mark.parametrize("method", FREE_METHODS)
def test_surface_irradiance_is_by_area_of_the_receiver(device, method):
    k = np.array([4.0, 2.0])
    terrain = {"base": 0.1, "slope": (0.3, -0.2), "waves": [{"amplitude": 0.05, "wavevector": tuple(k), "phase": 0.4}]}
    result = render(scene(GENTLE, {"terrain": terrain}), method, device)
    x, y = sample_points(result.caustic_map.shape, (0.0, 0.0), result.scene.map.size)
    rise = 0.05 * np.cos(k[0] * x + k[1] * y + 0.4)
    steepness = np.sqrt(1.0 + (0.3 + k[0] * rise) ** 2 + (-0.2 + k[1] * rise) ** 2)
    np.testing.assert_allclose(result.surface_irradiance, result.caustic_map / steepness, rtol=1e-6)
    coloured = scene(GENTLE, {"terrain": terrain}, sun={"irradiance": (1.0, 2.0, 3.0)})
    by_colour = render(coloured, method, device)
    np.testing.assert_allclose(by_colour.surface_irradiance, by_colour.caustic_map / steepness[..., None], rtol=1e-6)


def test_surface_irradiance_of_a_plane_is_the_map_and_of_a_mesh_there_is_none(device, tmp_path):
    flat = render(scene(GENTLE), "photon", device)
    np.testing.assert_array_equal(flat.surface_irradiance, flat.caustic_map)
    assert render(scene(GENTLE, {"mesh": save_quad(tmp_path)}), "photon", device).surface_irradiance is None


# --- one floor, given in four ways ----------------------------------------------------------------------------------


@pytest.mark.parametrize("method", FREE_METHODS)
@pytest.mark.parametrize("zenith", [0.0, 35.0, 70.0])
def test_a_plane_in_every_form_is_the_plane(device, method, zenith, tmp_path):
    direction = sunlight(zenith)
    plane = render(scene(GENTLE, direction=direction), method, device)
    assert plane.caustic_map.std() > 0.05
    file = save_heights(tmp_path, "flat", np.zeros((9, 9)), (-20.0, -20.0), (40.0, 40.0))
    for receiver in ({"terrain": {"base": 0.0}}, {"mesh": save_quad(tmp_path)}, {"terrain": file}):
        other = render(scene(GENTLE, receiver, direction), method, device)
        assert relative_l2(other.caustic_map, plane.caustic_map) < ROUNDING, receiver
        assert_adds_up(other)


@pytest.mark.parametrize("method", FREE_METHODS)
@pytest.mark.parametrize("zenith", [0.0, 35.0])
def test_a_slope_as_a_mesh_is_the_slope(device, method, zenith, tmp_path):
    slope, base, direction = (0.3, 0.1), -0.6, sunlight(zenith)
    terrain = render(scene(GENTLE, {"terrain": {"base": base, "slope": slope}}, direction), method, device)
    mesh = render(scene(GENTLE, {"mesh": save_quad(tmp_path, 30.0, slope, base)}, direction), method, device)
    assert relative_l2(mesh.caustic_map, terrain.caustic_map) < OTHER_LATTICE[method]
    assert mesh.energy.received == pytest.approx(terrain.energy.received, rel=1e-3)
    assert_adds_up(mesh)


@pytest.mark.parametrize("method", FREE_METHODS)
def test_a_mesh_ends_where_it_ends(device, method, tmp_path):
    # Under flat water and a sun at the zenith: half a metre of floor, and light that passes it by.
    what = scene((), {"mesh": save_quad(tmp_path, 0.25)}, (0.0, 0.0, -1.0), origin=(-1.0, -1.0), size=(2.0, 2.0),
                 resolution=(32, 32))  # fmt: skip
    result = render(what, method, device)
    expected = np.zeros((32, 32))
    expected[12:20, 12:20] = 1.0
    np.testing.assert_allclose(result.caustic_map, expected, atol=ROUNDING)
    assert result.energy.received == pytest.approx(0.25, rel=ROUNDING)
    assert result.energy.left_water == pytest.approx(result.energy.emitted - 0.25, rel=ROUNDING)
    assert_adds_up(result)


@pytest.mark.parametrize("method", FREE_METHODS)
@pytest.mark.parametrize("zenith", [0.0, 45.0])
def test_a_terrain_from_a_file_is_the_terrain(device, method, zenith, tmp_path):
    waves = [wave(0.08, 4.0, 2.0, 0.1), wave(0.05, -3.0, 5.0, 1.0)]
    corner, size = (-2.0, -2.0), (7.0, 6.0)
    x, y = sample_points((180, 200), corner, size)
    file = save_heights(tmp_path, "bed", 0.1 + 0.1 * x - 0.05 * y + sum_of_waves(waves, x, y), corner, size)
    direction = sunlight(zenith)
    closed = render(
        scene(GENTLE, {"terrain": {"base": 0.1, "slope": (0.1, -0.05), "waves": waves}}, direction), method, device
    )
    read = render(scene(GENTLE, {"terrain": file}, direction), method, device)
    assert relative_l2(read.caustic_map, closed.caustic_map) < OTHER_LATTICE[method]
    assert relative_l2(read.surface_irradiance, closed.surface_irradiance) < OTHER_LATTICE[method]
    assert_adds_up(read)


def test_a_terrain_file_that_does_not_reach_is_refused(device, tmp_path):
    file = save_heights(tmp_path, "small", np.zeros((9, 9)), (0.0, 0.0), (1.0, 1.0))
    with pytest.raises(wc.InputError, match="reaches past"):
        render(scene((), {"terrain": file}), "photon", device)


# --- water from a file ----------------------------------------------------------------------------------------------

CORNER, EXTENT = (-1.5, -1.5), (6.0, 5.0)


def wave_file(folder, waves=GENTLE, shape=(150, 180)):
    return save_heights(folder, "water", sum_of_waves(waves, *sample_points(shape, CORNER, EXTENT)), CORNER, EXTENT)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("zenith", [0.0, 35.0, 60.0])
def test_waves_from_a_file_are_the_waves(device, method, zenith, tmp_path):
    direction = sunlight(zenith)
    closed = render(scene(GENTLE, direction=direction), method, device)
    read = render(scene(height_map=wave_file(tmp_path), direction=direction), method, device)
    assert relative_l2(read.caustic_map, closed.caustic_map) < HEIGHT_MAP
    assert abs(read.energy.missed_by_window) < LEDGER * read.energy.emitted  # the border is far from the map
    assert_adds_up(read)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("zenith", [0.0, 50.0])
@pytest.mark.parametrize(
    ("origin", "size", "resolution"),
    [((-1.0, -1.0), (4.0, 4.0), (40, 40)), ((0.03, 0.0), (2.0, 2.0), (33, 31)), ((5.0, 5.0), (1.0, 1.0), (8, 8))],
)
def test_what_the_border_of_flat_water_loses_is_missed(device, method, zenith, origin, size, resolution, tmp_path):
    flat = save_heights(tmp_path, "flat", np.zeros((16, 16)), (0.0, 0.0), (2.0, 2.0))
    direction = sunlight(zenith)
    result = render(
        scene(height_map=flat, direction=direction, origin=origin, size=size, resolution=resolution), method, device
    )
    low = np.maximum(refracted(direction), origin)  # one metre deep, the light of the water lands this far from it
    high = np.minimum(np.add(refracted(direction), 2.0), np.add(origin, size))
    lit = np.prod(np.maximum(high - low, 0.0)) * -direction[2]
    assert result.energy.received == pytest.approx(lit, abs=CUT_CELL)
    assert result.energy.missed_by_window == pytest.approx(np.prod(size) * -direction[2] - lit, abs=CUT_CELL)
    assert_adds_up(result)


@pytest.mark.parametrize("method", METHODS)
def test_inside_its_border_a_file_lights_what_the_waves_would(device, method, tmp_path):
    place = {"origin": (-3.0, -3.0), "size": (9.0, 8.0), "resolution": (90, 80)}
    direction = (0.3, 0.0, -1.0)
    closed = render(scene(GENTLE, direction=direction, **place), method, device).caustic_map
    result = render(scene(height_map=wave_file(tmp_path), direction=direction, **place), method, device)
    # A metre deep: light lands 0.22 m downstream, and 0.1 m either side of that.
    inside = (slice(18, 62), slice(20, 75))
    assert relative_l2(result.caustic_map[inside], closed[inside]) < HEIGHT_MAP
    beyond = np.ones(closed.shape, dtype=bool)
    beyond[12:68, 12:82] = False
    assert result.caustic_map[beyond].max() == 0.0
    assert result.energy.missed_by_window > 0.0
    assert_adds_up(result)
