"""Tiles and loops: they repeat although nothing is wrapped, and what does not fit is refused or moved, and said."""

from __future__ import annotations

import numpy as np
import pytest
from scenery import scene, tables, wave

import warp_caustics as wc
from oracle.cases import sunlight
from warp_caustics.flip_book import FlipBook
from warp_caustics.repeat import looping, tiled

REPEATS = 1e-5
"""Largest difference of any pixel, over the mean: what was promised, and some roundings of float32 at a bright edge."""

ROUNDED = 5e-5
"""The same where a cell is no binary fraction of a pixel: where it lands at rest is then rounded, by 4e-6 pixels."""

MOVES = 0.1
"""What two frames of moving water differ by at least, over the mean."""

WIDTH, HEIGHT = 1.9, 1.3  # no float32 holds the pixels' sides
X, Y = 2.0 * np.pi / WIDTH, 2.0 * np.pi / HEIGHT
RESOLUTION = (64, 48)
WAVES = (
    wave(0.012, X, 2.0 * Y, 0.3),
    wave(0.010, -3.0 * X, Y, 1.0),
    wave(0.006, 5.0 * X, -4.0 * Y, 2.0),
    wave(0.003, -8.0 * X, 7.0 * Y, 0.5),
)
LOW, DEEP = (
    {"direction": sunlight(80.0)},
    {"direction": sunlight(70.0), "level": 6.0},
)  # whose light comes from tiles away
COLOUR = {"medium": {"ior": 1.333, "absorption": (0.3, 0.1, 0.05)}}
BUMPS = {
    "receiver": {"terrain": {"base": 0.1, "waves": [{"amplitude": 0.05, "wavevector": (2.0 * X, -Y), "phase": 1.0}]}}
}
CASES = {
    "beam": ("beam", {}),
    "photon": ("photon", {}),
    "gather": ("gather", {}),
    "beam, low sun": ("beam", LOW),
    "photon, low sun": ("photon", LOW),
    "beam, deep water": ("beam", DEEP),
    "photon, deep water": ("photon", DEEP),
    "beam, far from the world's origin": ("beam", {"origin": (1.0e5, -4.7e5)}),
    "beam, colour": ("beam", COLOUR),
    "photon, colour": ("photon", COLOUR),
    "photon, cells that float32 rounds": ("photon", {"method": {"photon": {"photons_per_pixel": (14 / 16) ** 2}}}),
    "beam, cells that float32 rounds": ("beam", {"method": {"beam": {"samples_per_pixel": (28 / 16) ** 2}}}),
}


def tile(waves=WAVES, **more) -> wc.Scene:
    """Waves that fit a tile of 1.9 m x 1.3 m, unless others are given."""
    return scene(waves, size=(WIDTH, HEIGHT), resolution=RESOLUTION, **more)


def sea(**more) -> wc.Scene:
    """A sea that repeats after a metre, and twice as wide a map."""
    spectrum = {"kind": "jonswap", "wind_speed": 1.5, "fetch": 100.0, "period": 1.1, "resolution": 64, **more}
    table = tables(scene(size=(1.1, 2.2), resolution=(32, 64), origin=(0.3, -0.7)))
    return wc.Scene(**{**table, "water": {"level": 1.0, "spectrum": spectrum}})


def moved(what: wc.Scene, x: float, y: float) -> wc.Scene:
    """The scene with the map's origin moved by shares of its size."""
    at = what.map.origin[0] + x * what.map.size[0], what.map.origin[1] + y * what.map.size[1]
    return what.model_copy(update={"map": what.map.model_copy(update={"origin": at})})


def rendered(what: wc.Scene, method: str, device: str, time: float = 0.0) -> np.ndarray:
    return wc.render(what, method=method, device=device, threads=1, time=time).caustic_map.astype(np.float64)


def worst(one: np.ndarray, other: np.ndarray) -> float:
    """Largest difference of any pixel, over the mean."""
    return float(np.abs(one - other).max() / other.mean())


# --- it repeats ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("case", CASES)
def test_half_a_period_away_is_the_same_map_rolled(case, device):
    """Nothing is wrapped: the other map is lit by other water, and only the water's period makes them the same."""
    method, more = CASES[case]
    texture = wc.make_texture(tile(**more), method=method)
    here = rendered(texture.scene, method, device)
    for x, y in ((0.5, 0.0), (0.0, 0.5), (0.5, 0.5)):
        there = rendered(moved(texture.scene, x, y), method, device)
        rolled = np.roll(here, (-round(y * RESOLUTION[1]), -round(x * RESOLUTION[0])), axis=(0, 1))
        assert worst(there, rolled) < (ROUNDED if "rounds" in case else REPEATS), (x, y)
    assert worst(rendered(moved(texture.scene, 0.25, 0.0), method, device), here) > MOVES


@pytest.mark.parametrize("method", ["beam", "photon"])
def test_a_sea_repeats_in_space_and_in_time(method, device):
    """By the spectrum's own rounding; two periods across are a tile as well, so half of it is a whole period."""
    texture = wc.make_texture(sea(), loop=2.0, fps=2.0, method=method)
    assert texture.scene.water.spectrum.loop == 2.0
    here = rendered(texture.scene, method, device)
    there = rendered(moved(texture.scene, 0.5, 0.25), method, device)
    assert worst(there, np.roll(here, (-16, -16), axis=(0, 1))) < REPEATS
    assert worst(rendered(texture.scene, method, device, time=2.0), here) < REPEATS
    assert worst(rendered(texture.scene, method, device, time=1.0), here) > MOVES


def preset(name: str) -> wc.Scene:
    return wc.Scene(**{**tables(tile()), "water": {"level": 1.0, "preset": name}})


def test_a_preset_repeats_once_its_waves_are_moved(device):
    """It is laid over its map, wherever that lies: as waves, it stays where it was."""
    with pytest.raises(wc.InputError, match="does not fit"):
        tiled(preset("ripples"))
    texture = wc.make_texture(preset("ripples"), rounding=True, loop=2.0, fps=1.0)
    assert texture.scene.water.preset is None
    here = rendered(texture.scene, "beam", device)
    there = rendered(moved(texture.scene, 0.5, 0.5), "beam", device)
    assert worst(there, np.roll(here, (-RESOLUTION[1] // 2, -RESOLUTION[0] // 2), axis=(0, 1))) < REPEATS
    assert worst(rendered(texture.scene, "beam", device, time=2.0), here) < REPEATS


def test_rings_are_refused():
    with pytest.raises(wc.InputError, match=r"water.preset.*one middle"):
        tiled(preset("radial"))
    with pytest.raises(wc.InputError, match="speed of their own"):
        looping(preset("radial"), 2.0)


def test_a_sea_needs_whole_periods():
    with pytest.raises(wc.InputError, match=r"water.spectrum.period: 0.9 m.*\[0.9, 1.8\]"):
        tiled(sea(period=0.9))
    assert looping(sea(loop=2.0), 2.0)[1] == ()
    (change,) = looping(sea(loop=2.0), 3.0)[1]
    assert (change.before, change.after) == ((2.0,), (3.0,))
    assert "%" in change.note


def test_terrain_repeats_with_the_water(device):
    texture = wc.make_texture(tile(**BUMPS), method="beam")
    here = rendered(texture.scene, "beam", device)
    there = rendered(moved(texture.scene, 0.5, 0.5), "beam", device)
    assert worst(there, np.roll(here, (-RESOLUTION[1] // 2, -RESOLUTION[0] // 2), axis=(0, 1))) < REPEATS


@pytest.mark.parametrize("method", ["beam", "photon"])
def test_the_seam_is_no_worse_than_what_is_inside(method, device):
    here = rendered(wc.make_texture(tile(), method=method).scene, method, device)
    for axis in (0, 1):
        inside = np.abs(np.diff(here, axis=axis))
        seam = np.abs(here.take(0, axis) - here.take(-1, axis))
        assert seam.max() <= inside.max()
    # The same eye sees the seam of water that does not fit.
    k = {"wavevector": (3.4 * X, 2.3 * Y)}
    other = rendered(tile([{**one, **k} for one in WAVES[:1]]), method, device)
    assert np.abs(other[0] - other[-1]).max() > np.abs(np.diff(other, axis=0)).max()


@pytest.mark.parametrize("method", ["beam", "photon"])
def test_the_frame_at_the_end_of_the_loop_is_the_first(method, device):
    """It is rendered with the phases of that time; half-way through, and without the loop, the water is another."""
    seconds = 2.0
    texture = wc.make_texture(tile(), loop=seconds, fps=4.0, method=method)
    assert texture.frames == 8
    renderer = wc.Renderer(texture.scene, method=method, device=device, threads=1)
    maps = [renderer.render(texture.time(i)).caustic_map.numpy().astype(np.float64) for i in (0, 4, 8, 24)]
    assert texture.time(8) == seconds
    assert worst(maps[2], maps[0]) < REPEATS
    assert worst(maps[3], maps[0]) < REPEATS
    assert worst(maps[1], maps[0]) > MOVES
    assert worst(rendered(tile(), method, device, seconds), maps[0]) > MOVES


def test_results_are_the_frames_in_order(device):
    texture = wc.make_texture(tile(), loop=1.0, fps=3.0, start=0.5)
    results = list(texture.results(wc.Renderer(texture.scene, device=device, threads=1)))
    assert [result.time for result in results] == [0.5, 0.5 + 1.0 / 3.0, 0.5 + 2.0 / 3.0]
    np.testing.assert_array_equal(
        results[2].caustic_map, wc.render(texture.scene, device=device, threads=1, time=results[2].time).caustic_map
    )


# --- what is moved, and said -----------------------------------------------------------------------------------------


def test_waves_that_fit_are_not_moved():
    made, changes = tiled(tile())
    assert changes == ()
    np.testing.assert_allclose([w.wavevector for w in made.water.waves], [w["wavevector"] for w in WAVES], rtol=1e-15)


def test_decimals_are_made_exact_without_asking():
    made, changes = tiled(tile([wave(0.01, round(X, 3), round(2.0 * Y, 3))]))
    assert made.water.waves[0].wavevector == (X, 2.0 * Y)
    (change,) = changes
    assert change.key == "water.waves[0].wavevector"
    assert change.relative < 1e-3


def test_what_does_not_fit_is_refused_all_of_it_at_once():
    with pytest.raises(wc.InputError) as refusal:
        tiled(tile([wave(0.01, X, Y), wave(0.01, 1.4 * X, Y), wave(0.01, 0.2 * X, -0.4 * Y), wave(0.01, X, 2.6 * Y)]))
    message = str(refusal.value)
    assert "3 faults" in message and "rounding" in message
    for words in ("waves[1]", "waves[2]", "two tiles", "waves[3]", f"[{X:.6g}, {3.0 * Y:.6g}]", "degrees", "%"):
        assert words in message
    assert "waves[0]" not in message


def test_rounding_moves_it_and_says_how_far():
    given = tile([wave(0.01, 1.25 * X, 0.0), wave(0.01, X, Y)])
    made, (change,) = tiled(given, rounding=True)
    assert made.water.waves[0].wavevector == (X, 0.0)
    assert change.relative == pytest.approx(0.2)
    assert "wavelength +25 %" in str(change) and "0 degrees" in str(change)
    assert tables(made)["water"]["waves"][0]["amplitude"] == 0.01
    assert wc.make_texture(made).changes == ()
    turned = tiled(tile([wave(0.01, X, 0.4 * X)]), rounding=True)[1][0]
    assert f"turned by {-np.degrees(np.arctan(0.4)):.2g} degrees" in str(turned)
    with pytest.raises(wc.InputError, match="two tiles"):
        tiled(tile([wave(0.01, 0.2 * X, 0.0)]), rounding=True)


@pytest.mark.parametrize(("method", "key"), [("photon", "photons_per_pixel"), ("beam", "samples_per_pixel")])
def test_cells_must_meet_at_the_seam(method, key):
    """64 x 48 pixels have squares of 16 pixels in common: 3 a pixel are 27.7 cells across one, 28 would do."""
    given = tile(method={method: {key: 3.0}})
    with pytest.raises(wc.InputError, match=rf"method.{method}.{key}: 3 .*{(28 / 16) ** 2}"):
        tiled(given, method)
    made, (change,) = tiled(given, method, rounding=True)
    assert getattr(getattr(made.method, method), key) == (28 / 16) ** 2
    assert change.key == f"method.{method}.{key}"
    assert tiled(given, "gather")[1] == ()


REFUSED = {
    "a slope": ({"receiver": {"terrain": {"base": 0.0, "slope": (0.1, 0.0)}}}, "receiver.terrain.slope"),
    "a terrain that does not fit": (
        {"receiver": {"terrain": {"base": 0.0, "waves": [{"amplitude": 0.01, "wavevector": (1.5 * X, Y)}]}}},
        r"receiver.terrain.waves\[0\]",
    ),
    "a terrain from a file": (
        {"receiver": {"terrain": {"file": "bay.npy", "origin": (0, 0), "size": (1, 1)}}},
        "ends at its border",
    ),
    "a mesh": ({"receiver": {"mesh": "rock.obj"}}, "receiver.mesh"),
    "an object": ({"receiver": {"plane": 0.0, "objects": [{"mesh": "rock.obj"}]}}, "receiver.objects"),
    "a height map": ({"height_map": {"file": "z.npy", "origin": (0, 0), "size": (1, 1)}}, "water.height_map"),
    "a simulation": ({"simulation": {"kind": "spectral", "cell": 0.1}}, "water.simulation"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_a_tile_is_refused(case):
    more, words = REFUSED[case]
    with pytest.raises(wc.InputError, match=words):
        tiled(tile(**more))


def test_a_loop_rounds_frequencies_and_says_how_far():
    given = tile([wave(0.01, X, Y), wave(0.01, X, 0.0, angular_frequency=-3.3), wave(0.01, X, -Y, angular_frequency=0)])
    made, changes = looping(given, 2.0)
    omega = [w.angular_frequency for w in made.water.waves]
    np.testing.assert_allclose(np.divide(omega[1:], np.pi), [-1.0, 0.0], rtol=1e-15)  # multiples of 2 pi / T = pi
    own = np.sqrt(9.81 * np.hypot(X, Y) * np.tanh(np.hypot(X, Y)))  # over a metre of water
    assert omega[0] == pytest.approx(np.pi * round(own / np.pi), rel=1e-15)
    assert [change.key for change in changes] == [f"water.waves[{i}].angular_frequency" for i in (0, 1)]
    assert changes[1].relative == pytest.approx(1.0 - np.pi / 3.3)
    assert "speed -4.8 %" in str(changes[1])
    assert looping(made, 2.0)[1] == ()


def test_a_short_loop_hurries_the_water_and_warns():
    given = tile([wave(0.01, X, Y, angular_frequency=1.0)])
    texture = wc.make_texture(given, loop=2.0, fps=1.0)
    assert texture.scene.water.waves[0].angular_frequency == pytest.approx(np.pi)  # it moves on, one period
    (warning,) = texture.warnings
    assert "3.1 times" in warning and "3.14 s" in warning
    assert wc.make_texture(given, loop=3.2, fps=5.0).warnings == []


STILL = {
    "flat water": ({}, "does not move"),
    "a height map": ({"height_map": {"file": "z.npy", "origin": (0, 0), "size": (1, 1)}}, "does not move"),
    "a simulation": ({"simulation": {"kind": "spectral", "cell": 0.1}}, "water.simulation"),
}


@pytest.mark.parametrize("case", STILL)
def test_water_that_cannot_loop_is_refused(case):
    more, words = STILL[case]
    with pytest.raises(wc.InputError, match=words):
        looping(tile((), **more), 2.0)


@pytest.mark.parametrize("seconds", [0.0, -1.0, np.inf, np.nan])
def test_a_loop_that_is_no_time_is_refused(seconds):
    with pytest.raises(wc.InputError, match="above 0"):
        looping(tile(), seconds)
    with pytest.raises(wc.InputError, match="above 0"):
        wc.make_texture(tile(), loop=seconds)


def test_frames_must_be_whole():
    assert wc.make_texture(tile(), loop=0.1, fps=30.0).frames == 3  # whose product is not 3 in float64
    with pytest.raises(wc.InputError) as refusal:
        wc.make_texture(tile(), loop=4.0, fps=29.97)
    for words in ("119.88", "120", "4.004004", "30 per second"):
        assert words in str(refusal.value)


# --- the atlas -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("frames", "resolution", "grid"),
    [
        (1, (4, 4), (1, 1)),
        (5, (2, 2), (4, 2)),
        (16, (2, 2), (4, 4)),
        (16, (4, 2), (4, 4)),
        (16, (8, 2), (2, 8)),
        (17, (8, 8), (8, 4)),
    ],
)
def test_an_atlas_is_read_as_a_page_is(frames, resolution, grid):
    """Left to right, top to bottom, each frame upright; cells that are left over are black."""
    book = FlipBook(frames, resolution, 1)
    for i in range(frames):
        book.put(i, np.full(resolution[::-1], i + 1.0) + np.linspace(0.0, 0.5, resolution[1])[:, None])
    assert book.grid == grid
    picture = book.image[::-1]  # the first row on top
    assert picture.shape == (grid[1] * resolution[1], grid[0] * resolution[0])
    assert all(side & (side - 1) == 0 for side in picture.shape)
    for i in range(grid[0] * grid[1]):
        row, column = i // grid[0] * resolution[1], i % grid[0] * resolution[0]
        cell = picture[row : row + resolution[1], column : column + resolution[0]]
        expected = i + 1.0 + np.linspace(0.5, 0.0, resolution[1]) if i < frames else np.zeros(resolution[1])
        np.testing.assert_allclose(cell, np.repeat(expected[:, None], resolution[0], axis=1), rtol=1e-6)


def test_an_atlas_needs_powers_of_two():
    with pytest.raises(wc.InputError, match=r"\[48, 64\].*\[64, 64\]"):
        FlipBook(4, (48, 64), 1)


def test_a_method_that_mirrors_the_water_makes_no_tile():
    with pytest.raises(wc.InputError, match='method "sample": mirrors the water'):
        tiled(tile(), "sample")


# --- methods that look -----------------------------------------------------------------------------------------------

EYE = {"position": (0.5, -1.0, 2.0), "target": (0.5, 0.5, 0.0), "vertical_fov": 50.0, "resolution": (32, 16)}


def test_a_pattern_loops_by_its_own_speed(device):
    made = wc.make_texture(scene(WAVES, camera=EYE), tile=False, loop=10.0, fps=0.2, method="pattern")
    (change,) = made.changes
    assert change.key == "method.pattern.speed" and change.after == (0.4,)
    assert made.scene.water == scene(WAVES).water and made.resolution == (32, 16)
    renderer = wc.Renderer(made.scene, "pattern", device)
    first, half, last = (renderer.render(time).screen_map.numpy().copy() for time in (0.0, 5.0, 10.0))
    assert np.abs(last - first).max() < 1e-5 < np.abs(half - first).max()
    with pytest.raises(wc.InputError, match=r"method\.pattern\.speed is 0"):
        looping(scene(WAVES, method={"pattern": {"speed": 0.0}}), 2.0, "pattern")


def test_what_a_camera_sees_is_no_tile():
    with pytest.raises(wc.InputError, match="a tile is a map in plan view"):
        wc.make_texture(scene(WAVES, camera=EYE), method="pattern")


def test_a_loop_past_the_last_time_is_refused_before_any_frame():
    with pytest.raises(wc.InputError, match="time"):
        wc.make_texture(tile(), loop=2.0, fps=1.0, start=999_999_999.5)


def test_an_atlas_that_does_not_fit_is_refused():
    with pytest.raises(wc.InputError, match=r"atlas: 3600 frames of 16384 x 16384 pixels take [0-9,]+ bytes"):
        FlipBook(3600, (16384, 16384), 3)
