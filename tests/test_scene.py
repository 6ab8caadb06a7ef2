"""The scene models: what they take, what they refuse, and in which words."""

from __future__ import annotations

import copy
import math
import re
from typing import Any

import numpy as np
import pytest

from warp_caustics.errors import InputError
from warp_caustics.scene import (
    IOR_TABLE,
    JERLOV_TABLE,
    METHODS,
    ClosedTerrain,
    GatherSettings,
    Map,
    Medium,
    Method,
    Scene,
    Sun,
    TerrainFile,
    Water,
    Wave,
    known_method,
)
from warp_caustics.scene.faults import quoted

# Normalising a vector rounds its length and three quotients.
UNIT_TOLERANCE = 1e-15
# Quan & Fry's formula against its table in five decimals.
TABLE_ROUNDING = 0.6e-5

PLAIN: dict[str, Any] = {
    "water": {"level": 2.0, "waves": []},
    "receiver": {"plane": 0.0},
    "sun": {"direction": [0.0, 0.0, -1.0]},
    "medium": {"ior": 1.333},
    "map": {"origin": [0.0, 0.0], "size": [4.0, 2.0], "resolution": [64, 32]},
}
CAMERA = {"position": [0.0, 0.0, 1.0], "target": [0.0, 1.0, 0.0], "vertical_fov": 50.0, "resolution": [64, 32]}


def scene_with(**tables: Any) -> Scene:
    """Return the plain scene with some of its tables replaced."""
    return Scene(**{**copy.deepcopy(PLAIN), **tables})


def faults(**tables: Any) -> list[str]:
    """Return the lines of the error of a scene with these tables, without its heading."""
    with pytest.raises(InputError) as caught:
        scene_with(**tables)
    lines = str(caught.value).split("\n")
    return [line.strip() for line in lines[1:]] if len(lines) > 1 else [lines[0].removeprefix("Scene: ")]


def test_a_plain_scene_has_the_defaults_of_the_design() -> None:
    scene = scene_with()
    assert scene.water.waves == ()
    assert scene.water.self_shadow == "auto"
    assert scene.receiver.objects == ()
    assert (scene.sun.irradiance, scene.sun.angular_diameter) == (1.0, 0.0)
    assert (scene.medium.absorption, scene.medium.fresnel, scene.medium.dispersion) == (0.0, False, "none")
    assert scene.camera is None
    assert (scene.method.name, scene.method.accumulate) == ("beam", "float32")
    assert (scene.method.beam.samples_per_pixel, scene.method.beam.refine) == (1.0, True)
    assert (scene.method.photon.photons_per_pixel, scene.method.photon.footprint) == (4.0, "cell")
    assert (scene.method.gather.n, scene.method.gather.m) == (None, None)
    assert scene.name == "scene"


def test_models_and_dictionaries_make_the_same_scene() -> None:
    wave = Wave(amplitude=0.01, wavevector=(1.0, 2.0))
    as_models = scene_with(water=Water(level=2.0, waves=(wave,)), medium=Medium(ior=1.333))
    as_tables = scene_with(water={"level": 2.0, "waves": [{"amplitude": 0.01, "wavevector": [1, 2]}]})
    assert as_models == as_tables
    assert hash(as_models) == hash(as_tables)


def test_numpy_numbers_and_arrays_become_plain_ones() -> None:
    area = Map(origin=np.zeros(2), size=np.array([4, 2]), resolution=np.array([64, 32]))
    assert area == scene_with().map
    assert type(area.size[0]) is float
    assert type(area.resolution[0]) is int
    assert type(Water(level=np.float32(1.0), waves=[]).level) is float


def test_a_scene_is_frozen() -> None:
    with pytest.raises(ValueError, match="frozen"):
        scene_with().water.level = 3.0


def test_all_faults_come_at_once_with_their_paths() -> None:
    lines = faults(
        water={
            "levle": 2.0,
            "waves": [
                {"amplitude": 0.1, "wavevector": [1, 0]},
                {"amplitude": math.nan, "wavevector": [0, 0]},
                {"amplitude": 0.1, "wavevector": [1, math.inf], "phase": "east"},
            ],
        },
        receiver={"plane": 0.0, "terrain": {"base": True}},
        sun={"direction": [0, 0, 1], "irradiance": [1, -1, 1]},
        medium={"ior": 0.9, "dispersion_strength": 1.0},
        map={"origin": [0, 0], "size": [0, 1], "resolution": [512, 0.5]},
        camera={**CAMERA, "target": CAMERA["position"], "vertical_fov": 180},
        wtaer={},
    )
    assert lines == [
        "water.level: missing, expected a finite number",
        "water.waves[1].amplitude: expected a finite number, got nan",
        "water.waves[1].wavevector: expected a wavevector that is not [0, 0]: a wave of no length is a change of level",
        "water.waves[2].wavevector[1]: expected a finite number, got inf",
        'water.waves[2].phase: expected a finite number, got "east"',
        'water.levle: unknown key, did you mean "level"?',
        "receiver.terrain.base: expected a finite number, got true",
        "receiver: expected exactly one of plane, terrain or mesh, got plane and terrain",
        "sun.direction: expected light that travels downwards, with z below 0, got [0.0, 0.0, 1.0]",
        "sun.irradiance[1]: expected a finite number of at least 0, got -1",
        "medium.ior: expected a finite number of at least 1, got 0.9",
        'medium: expected no dispersion_strength, since dispersion is "none"',
        "map.size[0]: expected a finite number above 0, got 0",
        "map.resolution[1]: expected a whole number of at least 1, got 0.5",
        "camera.target: expected a target away from the camera's position, got [0.0, 0.0, 1.0] for both",
        "camera.vertical_fov: expected degrees above 0 and below 180, got 180",
        'wtaer: unknown key, did you mean "water"?',
    ]


def test_the_heading_counts_the_faults_and_names_what_was_called() -> None:
    with pytest.raises(InputError, match=r"^Water: 2 faults\n  level: missing"):
        Water()  # type: ignore[call-arg]
    with pytest.raises(InputError, match=r"^Wave: amplitude: expected a finite number, got nan$"):
        Wave(amplitude=math.nan, wavevector=(1.0, 0.0))


@pytest.mark.parametrize(
    ("tables", "fault"),
    [
        (
            {"water": {"level": 1.0}},
            "water: expected exactly one of waves, preset, height_map, simulation or spectrum, got none",
        ),
        ({"water": 3}, "water: expected a table, got 3"),
        ({"water": {"level": 1.0, "waves": 3}}, "water.waves: expected a list of tables, got 3"),
        ({"water": {"level": 1.0, "waves": [3]}}, "water.waves[0]: expected a table, got 3"),
        (
            {"water": {"level": 1.0, "waves": [], "self_shadow": "atuo"}},
            'water.self_shadow: expected "auto", true or false, got "atuo": did you mean "auto"?',
        ),
        (
            {"water": {"level": 1.0, "preset": "ripple"}},
            'water.preset: expected one of "ripples", "waves" or "radial", got "ripple": did you mean "ripples"?',
        ),
        (
            {"water": {"level": 1.0, "preset": "ripples", "waves": []}},
            "water: expected exactly one of waves, preset, height_map, simulation or spectrum, got waves and preset",
        ),
        (
            {"water": {"level": 10**5000, "waves": []}},
            "water.level: expected a finite number, got a number too long to print",
        ),
        ({"receiver": {}}, "receiver: expected exactly one of plane, terrain or mesh, got none"),
        ({"receiver": {"terrain": 3}}, "receiver.terrain: expected a table, got 3"),
        ({"receiver": {"plane": 2.0}}, "receiver: expected a plane below the water's level 2.0, got 2.0"),
        (
            {"receiver": {"terrain": {"base": 0.0, "waves": [{"amplitude": 1.0, "wavevector": [0.0, -0.0]}]}}},
            "receiver.terrain.waves[0].wavevector: expected a wavevector that is not [0, 0]: "
            "a wave of no length is a change of level",
        ),
        (
            {"receiver": {"mesh": "rock.pkl"}},
            'receiver.mesh: expected a file that ends in .obj, .ply, .stl or .vtp, got "rock.pkl"',
        ),
        (
            {"receiver": {"plane": 0.0, "objects": [{"mesh": "a.obj", "scale": 0.0}]}},
            "receiver.objects[0].scale: expected a finite number above 0, got 0.0",
        ),
        ({"sun": {}}, "sun: expected direction, or elevation and azimuth, got neither"),
        ({"sun": {"elevation": 30.0}}, "sun: expected elevation and azimuth together, got elevation alone"),
        (
            {"sun": {"direction": [0, 0, -1], "elevation": 30.0, "azimuth": 0.0}},
            "sun: expected direction, or elevation and azimuth, got both",
        ),
        (
            {"sun": {"elevation": 0.0, "azimuth": 0.0}},
            "sun.elevation: expected degrees above 0 and up to 90, got 0.0",
        ),
        (
            {"sun": {"direction": [1, 0, 0]}},
            "sun.direction: expected light that travels downwards, with z below 0, got [1.0, 0.0, 0.0]",
        ),
        (
            {"sun": {"direction": [0, -1]}},
            "sun.direction: expected [x, y, z], three finite numbers, got [0, -1]",
        ),
        (
            {"sun": {"elevation": 1.0, "azimuth": 0.0, "angular_diameter": 2.0}},
            "sun.angular_diameter: expected a disk wholly above the horizon, got one that reaches below it",
        ),
        ({"medium": {"ior": [1.3, 1.3, math.nan]}}, "medium.ior[2]: expected a finite number of at least 1, got nan"),
        (
            {"medium": {"ior": "frsh"}},
            'medium.ior: expected one of "fresh" or "sea", a finite number of at least 1, or [r, g, b] of them, '
            'got "frsh": did you mean "fresh"?',
        ),
        (
            {"medium": {"ior": 1.3, "absorption": [1, 2]}},
            "medium.absorption: expected [r, g, b], three finite numbers, got [1, 2]",
        ),
        (
            {"medium": {"ior": 1.3, "absorption": 0.0, "jerlov": "II"}},
            "medium: expected absorption or jerlov, got both: one goes with the path, the other with the depth",
        ),
        (
            {"medium": {"ior": 1.3, "dispersion": "traced"}},
            'medium: expected an ior by channel, "fresh" or "sea" with dispersion: one index bends all colours alike',
        ),
        ({"medium": {"ior": 1.3, "fresnel": 1}}, "medium.fresnel: expected true or false, got 1"),
        (
            {"method": {"name": "gahter"}},
            f'method.name: expected one of {quoted(METHODS)}, got "gahter": did you mean "gather"?',
        ),
        (
            {"method": {"photon": {"footprint": -1.0}}},
            'method.photon.footprint: expected one of "point", "pixel" or "cell", or a finite number above 0, got -1.0',
        ),
        (
            {"method": {"gather": {"n": 6}}},
            "method.gather.n: expected an odd whole number of at least 1, got 6",
        ),
        ({"name": ""}, 'name: expected a text, got ""'),
    ],
)
def test_a_fault_is_said_in_one_line(tables: dict[str, Any], fault: str) -> None:
    assert faults(**tables) == [fault]


def test_a_long_value_is_shortened() -> None:
    (line,) = faults(sun={"direction": list(range(1000))})
    assert re.search(r"got \[0, 1, .*…$", line)


def test_braces_in_a_value_stay_as_they_are() -> None:
    assert faults(method={"name": "{x}"})[0].endswith('got "{x}"')


@pytest.mark.parametrize("kind", ["npy", "npz", "exr", "png"])
def test_a_height_map_that_cannot_say_where_it_lies_needs_a_place(kind: str) -> None:
    expected = f"water.height_map: expected origin and size, since a .{kind} file does not say where it lies"
    assert faults(water={"level": 1.0, "height_map": {"file": f"a.{kind}"}}) == [expected]


def test_a_height_map_takes_origin_and_size_together() -> None:
    terrain = {"file": "a.tif", "origin": [0, 0]}
    assert faults(receiver={"terrain": terrain}) == [
        "receiver.terrain: expected origin and size together, got only one of them"
    ]
    assert isinstance(scene_with(receiver={"terrain": {"file": "a.tif"}}).receiver.terrain, TerrainFile)


def test_a_key_for_a_file_of_one_array_is_refused() -> None:
    terrain = {"file": "a.npy", "origin": [0, 0], "size": [1, 1], "key": "z"}
    assert faults(receiver={"terrain": terrain}) == [
        "receiver.terrain: expected no key, since a .npy file holds one array; .exr, .npz, .nc, .nc4 or .cdf files "
        "take a key"
    ]
    assert scene_with(receiver={"terrain": {**terrain, "file": "a.npz"}}).receiver.terrain


def test_the_kind_of_terrain_follows_its_keys() -> None:
    assert isinstance(scene_with(receiver={"terrain": {"base": 0.2}}).receiver.terrain, ClosedTerrain)
    lines = faults(receiver={"terrain": {"file": "a.npz", "origin": [0, 0], "size": [1, 1], "base": 0.0}})
    assert lines[0].startswith("receiver.terrain.base: unknown key")


def test_the_direction_of_light_has_length_one() -> None:
    for direction in ([3.0, 4.0, -12.0], [1e300, 0.0, -1e300], [1e-300, 0.0, -1e-300]):
        unit = Sun(direction=direction).unit_direction
        assert unit.dtype == np.float64
        assert abs(np.linalg.norm(unit) - 1.0) <= UNIT_TOLERANCE
        assert unit[2] < 0.0


def test_light_so_flat_that_its_fall_is_lost_is_refused() -> None:
    with pytest.raises(InputError, match="travels downwards"):
        Sun(direction=(1e300, 0.0, -1e-300))


@pytest.mark.parametrize(
    ("elevation", "azimuth", "expected"),
    [
        (90.0, 17.0, (0.0, 0.0, -1.0)),
        (30.0, 0.0, (-math.sqrt(0.75), 0.0, -0.5)),
        (30.0, 90.0, (0.0, -math.sqrt(0.75), -0.5)),
        (60.0, 180.0 + 360.0, (0.5, 0.0, -math.sqrt(0.75))),
    ],
)
def test_light_comes_from_where_the_sun_stands(
    elevation: float, azimuth: float, expected: tuple[float, float, float]
) -> None:
    sun = Sun(elevation=elevation, azimuth=azimuth)
    np.testing.assert_allclose(sun.unit_direction, expected, atol=UNIT_TOLERANCE)
    assert sun.direction == tuple(sun.unit_direction)


def test_the_index_by_name_is_that_of_quan_and_fry() -> None:
    def quan_fry(wavelength: float, salinity: float, celsius: float = 20.0) -> float:
        s, t, w = salinity, celsius, wavelength
        by_salt = (1.779e-4 - 1.05e-6 * t + 1.6e-8 * t**2) * s
        by_colour = (15.868 + 0.01155 * s - 0.00423 * t) / w - 4382 / w**2 + 1.1455e6 / w**3
        return 1.31405 + by_salt - 2.02e-6 * t**2 + by_colour

    for name, salinity in (("fresh", 0.0), ("sea", 35.0)):
        expected = [quan_fry(wavelength, salinity) for wavelength in (650.0, 550.0, 450.0)]
        np.testing.assert_allclose(IOR_TABLE[name], expected, atol=TABLE_ROUNDING)
        assert Medium(ior=name).green_ior == IOR_TABLE[name][1]


def test_the_green_index_stands_for_all_channels() -> None:
    assert Medium(ior=1.34).green_ior == 1.34
    assert Medium(ior=(1.3, 1.4, 1.5)).green_ior == 1.4
    assert Medium(ior=1.34).ior_by_channel == (1.34, 1.34, 1.34)


def test_a_jerlov_type_gives_its_attenuation_red_first() -> None:
    assert Medium(ior=1.34, jerlov="II").diffuse_attenuation == (0.40, 0.089, 0.068)
    assert Medium(ior=1.34).diffuse_attenuation is None
    reds = [red for red, _, _ in JERLOV_TABLE.values()]
    assert reds == sorted(reds)  # the types are in the order of turbidity


def test_colour_makes_three_channels() -> None:
    assert scene_with().channels == 1
    assert scene_with(sun={"direction": [0, 0, -1], "irradiance": [1, 1, 1]}).channels == 3
    assert scene_with(medium={"ior": 1.33, "absorption": [0.3, 0.1, 0.0]}).channels == 3
    assert scene_with(medium={"ior": 1.33, "jerlov": "IA"}).channels == 3
    assert scene_with(medium={"ior": "fresh"}).channels == 1  # green alone, without dispersion


def test_methods_are_known_or_unknown() -> None:
    assert [known_method(name) for name in METHODS] == list(METHODS)
    with pytest.raises(InputError, match='did you mean "photon"'):
        known_method("foton")


def test_settings_of_methods_that_are_not_chosen_are_kept() -> None:
    method = Method(name="beam", gather={"n": 7, "m": 6}, photon={"footprint": 2})
    assert method.gather == GatherSettings(n=7, m=6)
    assert method.photon.footprint == 2.0


def test_an_absurd_resolution_is_left_to_the_plan() -> None:
    area = Map(origin=(0, 0), size=(1, 1), resolution=(10**12, 10**12))
    assert area.resolution == (10**12, 10**12)
