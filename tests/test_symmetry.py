"""What must not matter: handedness, the way the axes lie, where in the world the map is, when the waves came by."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenery import (
    FREE_METHODS,
    GENTLE,
    METHODS,
    relative_l2,
    render,
    sample_points,
    save_box,
    save_heights,
    scene,
    sum_of_waves,
    tables,
    wave,
)

import warp_caustics as wc
from oracle.cases import CASES

ROUNDING = 2e-5  # float32 landings, marches and sums, taken in another order
# A beam's cells are cut along one diagonal. A mirror lays it the other way, and a map is only right to its own error.
OTHER_DIAGONAL = 5e-3
FAR = 1e-4  # what the issue allows a window at 1e5 m
FAR_AWAY = (1e5, -3e5)

SLOPE = {"terrain": {"base": 0.1, "slope": (0.1, -0.05), "waves": [wave(0.03, 4.0, 2.0, 0.1)]}}
PLACE = {"origin": (0.3, -0.2), "size": (2.0, 1.1), "resolution": (40, 28)}


def plane_scene(**more):
    return scene(GENTLE, **PLACE, **more)


def terrain_scene():
    return scene(GENTLE, SLOPE, **PLACE)


def case_scene(name):
    """A hard case of the reference, made small: its kernels are those of its accuracy test."""
    return wc.Scene(**replace(CASES[name], resolution=(48, 40)).scene_dict())


def change(what, water=None, direction=None, terrain=None, **place):
    """Change a scene's waves one by one, its terrain, its sun, and where its map lies."""
    new = tables(what)
    if water is not None:
        new["water"]["waves"] = [water(one) for one in new["water"]["waves"]]
    if direction is not None:
        new["sun"]["direction"] = direction(*new["sun"]["direction"])
    if terrain is not None and "terrain" in new["receiver"]:
        new["receiver"]["terrain"] = terrain(new["receiver"]["terrain"])
    new["map"].update(place)
    return wc.Scene(**new)


def mirrored(what, axis):
    """The scene in a mirror through the middle of its map, across an axis."""
    middle = what.map.origin[axis] + 0.5 * what.map.size[axis]
    sign = np.where(np.arange(2) == axis, -1.0, 1.0)

    def flip_wave(one):
        k = np.asarray(one["wavevector"])
        return {**one, "wavevector": tuple(k * sign), "phase": one.get("phase", 0.0) + 2.0 * middle * k[axis]}

    def flip_terrain(one):
        slope = np.asarray(one.get("slope", (0.0, 0.0)))
        return {
            "base": one["base"] + 2.0 * middle * slope[axis],
            "slope": tuple(slope * sign),
            "waves": [flip_wave(w) for w in one.get("waves", ())],
        }

    return change(what, flip_wave, lambda x, y, z: (x * sign[0], y * sign[1], z), flip_terrain)


def turned(what):
    """The scene turned by 90 degrees about the world's origin, x to y and y to -x."""

    def turn_wave(one):
        return {**one, "wavevector": (-one["wavevector"][1], one["wavevector"][0])}

    def turn_terrain(one):
        sx, sy = one.get("slope", (0.0, 0.0))
        return {**one, "slope": (-sy, sx), "waves": [turn_wave(w) for w in one.get("waves", ())]}

    (x, y), (w, h), (columns, rows) = what.map.origin, what.map.size, what.map.resolution
    return change(
        what, turn_wave, lambda ix, iy, iz: (-iy, ix, iz), turn_terrain,
        origin=(-(y + h), x), size=(h, w), resolution=(rows, columns),
    )  # fmt: skip


def moved(what, shift):
    """The scene with all that is in it at another place of the world."""
    shift = np.asarray(shift)

    def move_wave(one):
        return {**one, "phase": one.get("phase", 0.0) - float(np.dot(one["wavevector"], shift))}

    def move_terrain(one):
        base = one["base"] - float(np.dot(one.get("slope", (0.0, 0.0)), shift))
        return {**one, "base": base, "waves": [move_wave(w) for w in one.get("waves", ())]}

    return change(what, move_wave, None, move_terrain, origin=tuple(np.add(what.map.origin, shift)))


SCENES = [
    *((plane_scene, method) for method in METHODS),
    *((terrain_scene, method) for method in FREE_METHODS),
    *((name, method) for name in ("shore", "shaded") for method in FREE_METHODS),
]
each_scene = pytest.mark.parametrize(
    ("made", "method"), SCENES, ids=[f"{getattr(made, '__name__', made)}-{method}" for made, method in SCENES]
)


def make(made):
    return case_scene(made) if isinstance(made, str) else made()


@each_scene
def test_mirrored_scenes_give_mirrored_maps(device, made, method):
    what = make(made)
    upright = render(what, method, device).caustic_map
    tolerance = OTHER_DIAGONAL if method == "beam" else ROUNDING
    in_x, in_y = (render(mirrored(what, axis), method, device).caustic_map for axis in (0, 1))
    assert relative_l2(in_x[:, ::-1], upright) < tolerance
    assert relative_l2(in_y[::-1], upright) < tolerance
    assert relative_l2(in_x, upright) > 0.1  # the scene has no such symmetry of its own
    # Both mirrors lay the diagonal back where it was.
    both = render(mirrored(mirrored(what, 0), 1), method, device).caustic_map
    assert relative_l2(both[::-1, ::-1], upright) < ROUNDING


@each_scene
def test_turned_scenes_give_turned_maps(device, made, method):
    what = make(made)
    upright = render(what, method, device).caustic_map
    quarter = render(turned(what), method, device).caustic_map
    half = render(turned(turned(what)), method, device).caustic_map
    # Turned, a point (x, y) of the map lies at (-y, x): columns become rows, and rows columns from the far end.
    assert relative_l2(np.flip(quarter, 1).T, upright) < (OTHER_DIAGONAL if method == "beam" else ROUNDING)
    assert relative_l2(half[::-1, ::-1], upright) < ROUNDING


@pytest.mark.parametrize("method", METHODS)
def test_a_window_moved_by_whole_pixels_shows_the_same_light(device, method):
    what = plane_scene()
    here = render(what, method, device).caustic_map
    pixel = np.divide(what.map.size, what.map.resolution)
    for columns, rows in ((3, 2), (-40, 5), (7, -28)):
        there = change(what, origin=tuple(np.add(what.map.origin, pixel * (columns, rows))))
        size = np.add(what.map.resolution, np.abs((columns, rows)))
        whole = change(
            what, origin=tuple(np.add(what.map.origin, pixel * np.minimum((columns, rows), 0))),
            size=tuple(pixel * size), resolution=tuple(int(n) for n in size),
        )  # fmt: skip
        all_of_it = render(whole, method, device).caustic_map
        x, y = max(-columns, 0), max(-rows, 0)
        assert relative_l2(here, all_of_it[y : y + 28, x : x + 40]) < ROUNDING
        x, y = max(columns, 0), max(rows, 0)
        assert relative_l2(render(there, method, device).caustic_map, all_of_it[y : y + 28, x : x + 40]) < ROUNDING


@each_scene
def test_a_far_window_shows_the_same_light(device, made, method):
    what = make(made)
    near = render(what, method, device)
    far = render(moved(what, FAR_AWAY), method, device)
    assert relative_l2(far.caustic_map, near.caustic_map) < FAR
    np.testing.assert_allclose(far.energy.emitted, near.energy.emitted, rtol=FAR)


@pytest.mark.parametrize("method", METHODS)
def test_a_far_height_map_lies_where_it_says(device, method, tmp_path):
    corner, size = (-1.5, -1.5), (6.0, 5.0)
    z = sum_of_waves(GENTLE, *sample_points((100, 120), corner, size))
    maps = []
    for name, shift in (("near", (0.0, 0.0)), ("far", FAR_AWAY)):
        table = save_heights(tmp_path, name, z, tuple(np.add(corner, shift)), size)
        place = {**PLACE, "origin": tuple(np.add(PLACE["origin"], shift))}
        maps.append(render(scene(height_map=table, **place), method, device).caustic_map)
    assert relative_l2(maps[1], maps[0]) < FAR


@pytest.mark.parametrize("method", FREE_METHODS)
def test_a_far_object_stands_where_it_says(device, method, tmp_path):
    box, maps = save_box(tmp_path), []
    for shift in ((0.0, 0.0), FAR_AWAY):
        objects = [{"mesh": box, "translate": (1.1 + shift[0], 0.3 + shift[1], 0.0), "scale": 0.3}]
        what = moved(scene(GENTLE, {"plane": 0.0, "objects": objects}, **PLACE), shift)
        maps.append(render(what, method, device).caustic_map)
    assert relative_l2(maps[0], render(plane_scene(), method, device).caustic_map) > 0.1  # it is in the light
    assert relative_l2(maps[1], maps[0]) < FAR


@pytest.mark.parametrize("method", METHODS)
def test_waves_come_again_after_their_period(device, method):
    base = 0.5  # [rad/s]; every wave turns a whole number of times in its period
    waves = [{**one, "angular_frequency": base * turns} for one, turns in zip(GENTLE, (1, 3, -4), strict=True)]
    renderer = wc.Renderer(scene(waves, **PLACE), method, device, threads=1)
    period = 2.0 * np.pi / base

    def at(time):
        return renderer.render(time).caustic_map.numpy().copy()

    start = at(0.3)
    for later in (period, 5.0 * period, 1e6 * period, -period):
        assert relative_l2(at(0.3 + later), start) < ROUNDING, later
    assert relative_l2(at(0.3 + 0.5 * period), start) > 0.01
