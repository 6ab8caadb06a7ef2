"""Loading scene files and bundled scenes, and writing scenes as text."""

from __future__ import annotations

import hashlib
import importlib.util
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from warp_caustics.errors import InputError
from warp_caustics.scene import JERLOV_TABLE, Scene, TerrainFile, bundled_scenes, load_scene, parse_scene

ROOT = Path(__file__).parent.parent
# The pool is fixed: every quoted figure of error and time is on it.
POOL_SHA256 = "a03afd8857f15a84317b96302ae74034a932a61eafa15cc241bd3c96ed060086"
PLAIN = """
[water]
level = 2.0
waves = []
[receiver]
plane = 0.0
[sun]
direction = [0.4, 0.2, -1.0]
[medium]
ior = 1.333
[map]
origin = [0.0, 0.0]
size = [4.0, 4.0]
resolution = [64, 64]
"""


def written(folder: Path, text: str | bytes, name: str = "own.toml") -> Path:
    """Write a scene file and return its path."""
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def test_the_bundled_scenes_load_under_their_names() -> None:
    assert bundled_scenes() == ["beach", "lake", "pool", "sea", "tank"]
    for name in bundled_scenes():
        scene = load_scene(name)
        assert scene.name == name
        assert parse_scene(scene.to_toml()) == scene
        assert str(ROOT) not in scene.to_toml()  # a map's header names no folder of the machine that made it


def test_the_pool_is_the_one_of_the_quoted_figures() -> None:
    text = (ROOT / "warp_caustics" / "scenes" / "pool.toml").read_bytes().replace(b"\r\n", b"\n")
    assert hashlib.sha256(text).hexdigest() == POOL_SHA256
    pool = load_scene("pool")
    assert pool.water.waves is not None
    assert (len(pool.water.waves), pool.water.level, pool.receiver.plane) == (14, 2.0, 0.0)
    assert sum(wave.amplitude for wave in pool.water.waves) == pytest.approx(0.1296)
    assert (pool.medium.green_ior, pool.map.size, pool.map.resolution) == (1.333, (4.0, 4.0), (512, 512))
    assert pool.camera is not None
    assert pool.channels == 1


def test_the_bundled_scenes_show_what_they_are_for() -> None:
    beach, lake, tank = (load_scene(name) for name in ("beach", "lake", "tank"))
    assert beach.channels == 3
    assert beach.medium.fresnel
    assert beach.camera is not None
    assert isinstance(lake.receiver.terrain, TerrainFile)
    assert len(tank.receiver.objects) == 1


def test_a_file_is_named_after_itself_unless_it_says_otherwise(tmp_path: Path) -> None:
    assert load_scene(written(tmp_path, PLAIN)).name == "own"
    assert load_scene(str(written(tmp_path, 'name = "mine"\n' + PLAIN))).name == "mine"


def test_a_file_goes_before_a_bundled_scene_and_a_folder_does_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "pool").mkdir()
    assert load_scene("pool").map.resolution == (512, 512)
    (tmp_path / "pool").rmdir()
    written(tmp_path, PLAIN, "pool")
    assert load_scene("pool").map.resolution == (64, 64)


def test_files_are_looked_for_beside_the_scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    terrain = 'terrain = { file = "sub/bed.npz", origin = [0, 0], size = [1, 1] }\nobjects = [ { mesh = "rock.obj" } ]'
    (tmp_path / "scenes").mkdir()
    written(tmp_path / "scenes", PLAIN.replace("plane = 0.0", terrain))
    monkeypatch.chdir(tmp_path)
    receiver = load_scene("scenes/own.toml").receiver
    assert isinstance(receiver.terrain, TerrainFile)
    assert Path(receiver.terrain.file) == tmp_path / "scenes" / "sub" / "bed.npz"
    assert Path(receiver.objects[0].mesh) == tmp_path / "scenes" / "rock.obj"


def test_files_of_the_library_and_whole_paths_stay_as_they_are(tmp_path: Path) -> None:
    elsewhere = str(tmp_path / "elsewhere" / "rock.obj")
    objects = f"plane = 0.0\nobjects = [ {{ mesh = 'bundled:rock.obj' }}, {{ mesh = '{elsewhere}' }} ]"
    receiver = load_scene(written(tmp_path, PLAIN.replace("plane = 0.0", objects))).receiver
    assert [item.mesh for item in receiver.objects] == ["bundled:rock.obj", elsewhere]


def test_a_byte_order_mark_is_no_fault(tmp_path: Path) -> None:
    assert load_scene(written(tmp_path, b"\xef\xbb\xbf" + PLAIN.encode())).water.level == 2.0


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"[water\n", "own.toml: expected TOML: "),
        (b"x = " + b"[" * 100_000, "own.toml: expected TOML: "),
        (b"x = " + b"1" * 5000, "own.toml: expected TOML: "),
        (b"name = '\xff'\n", "own.toml: expected UTF-8 text, got other bytes at byte 8"),
        (b"", "own.toml: 5 faults\n  water: missing, expected a table\n"),
        (PLAIN.replace("level", "levle").encode(), 'water.levle: unknown key, did you mean "level"?'),
    ],
    ids=["syntax", "nesting", "digits", "encoding", "empty", "key"],
)
def test_a_file_that_is_no_scene_is_refused_in_one_message(tmp_path: Path, content: bytes, message: str) -> None:
    with pytest.raises(InputError) as caught:
        load_scene(written(tmp_path, content))
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("nosuch.toml", "nosuch.toml: no such scene file (bundled scenes: beach, lake, pool, sea and tank)"),
        ("pol", 'pol: no such scene file, did you mean "pool"? (bundled scenes: beach, lake, pool, sea and tank)'),
        ("folder", "folder: expected a scene file, got a folder"),
    ],
)
def test_a_scene_that_is_not_there_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, message: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    with pytest.raises(InputError) as caught:
        load_scene(name)
    assert str(caught.value) == message


numbers = st.floats(allow_nan=False, allow_infinity=False)
moderate = st.floats(-1e6, 1e6)
positive = st.floats(1e-6, 1e6)
pairs = st.tuples(numbers, numbers)
texts = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), min_size=1, max_size=12)
wavevectors = st.tuples(numbers, positive)
colours = st.one_of(st.floats(0.0, 1e6), st.tuples(*[st.floats(0.0, 1e6)] * 3))
waves = st.fixed_dictionaries(
    {"amplitude": numbers, "wavevector": wavevectors}, optional={"phase": numbers, "angular_frequency": numbers}
)
height_files = st.builds(
    lambda stem, rest: {"file": f"bed {stem} z.npz", **rest},
    texts,
    st.fixed_dictionaries(
        {"origin": pairs, "size": st.tuples(positive, positive)},
        optional={"scale": numbers, "offset": numbers, "key": texts},
    ),
)
waters = st.one_of(
    st.fixed_dictionaries(
        {"level": moderate, "waves": st.lists(waves, max_size=3)}, optional={"self_shadow": st.just(True)}
    ),
    st.fixed_dictionaries({"level": moderate, "height_map": height_files}),
)
ripples = st.fixed_dictionaries({"amplitude": numbers, "wavevector": wavevectors})
terrains = st.one_of(
    height_files,
    st.fixed_dictionaries({"base": numbers}, optional={"slope": pairs, "waves": st.lists(ripples, max_size=2)}),
)
objects = st.lists(
    st.fixed_dictionaries(
        {"mesh": texts.map(lambda stem: f"rock {stem} z.obj")},
        optional={"translate": st.tuples(numbers, numbers, numbers), "scale": positive},
    ),
    max_size=2,
)
receivers = st.one_of(
    st.fixed_dictionaries({"plane": st.just(-2e6)}, optional={"objects": objects}),
    st.fixed_dictionaries({"terrain": terrains}, optional={"objects": objects}),
)
suns = st.one_of(
    st.fixed_dictionaries({"direction": st.tuples(moderate, moderate, positive.map(lambda z: -z))}),
    st.fixed_dictionaries({"elevation": st.floats(1.0, 90.0), "azimuth": numbers, "irradiance": colours}),
)
media = st.one_of(
    st.fixed_dictionaries(
        {"ior": st.one_of(st.floats(1.0, 9.0), st.sampled_from(["fresh", "sea"]))}, optional={"absorption": colours}
    ),
    st.fixed_dictionaries({"ior": st.just(1.3), "jerlov": st.sampled_from(list(JERLOV_TABLE))}),
)
maps = st.fixed_dictionaries(
    {"origin": pairs, "size": st.tuples(positive, positive), "resolution": st.tuples(*[st.integers(1, 10**20)] * 2)}
)
methods = st.fixed_dictionaries(
    {},
    optional={
        "name": st.sampled_from(["beam", "photon", "gather"]),
        "photon": st.fixed_dictionaries({}, optional={"footprint": st.one_of(st.just("point"), positive)}),
        "gather": st.fixed_dictionaries({}, optional={"n": st.just(7)}),
    },
)
scenes = st.fixed_dictionaries(
    {"water": waters, "receiver": receivers, "sun": suns, "medium": media, "map": maps},
    optional={"name": texts, "method": methods},
)


@given(scenes)
def test_a_scene_written_as_text_loads_back_equal(tables: dict[str, Any]) -> None:
    scene = Scene(**tables)
    text = scene.to_toml()
    assert parse_scene(text) == scene
    assert parse_scene(text).to_toml() == text


def test_the_reference_of_keys_is_current() -> None:
    spec = importlib.util.spec_from_file_location("make_scene_md", ROOT / "docs" / "make_scene_md.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    made = module.scene_reference()
    assert (ROOT / "docs" / "scene.md").read_text(encoding="utf-8") == made, "run python docs/make_scene_md.py"
    for key in ("angular_frequency", "self_shadow", "photons_per_pixel", "vertical_fov"):
        assert f"`{key}`" in made


def test_scenes_and_assets_load_nothing_heavy_by_themselves() -> None:
    code = (
        "import sys, warp_caustics.scene as scene, warp_caustics.assets\n"
        "scene.load_scene('pool')\n"
        "heavy = {'warp', 'pyvista', 'vtkmodules', 'matplotlib', 'OpenEXR', 'PIL', 'rasterio', 'xarray'}\n"
        "sys.exit(', '.join(heavy & sys.modules.keys()) or 0)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
