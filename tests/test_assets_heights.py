"""Height maps from files: orientation, scaling, place, and what is refused."""

from __future__ import annotations

import copy
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from warp_caustics.assets import HeightGrid, load_assets
from warp_caustics.errors import InputError
from warp_caustics.exr import write_map
from warp_caustics.scene import Scene, load_scene

ROWS, COLUMNS = 6, 8
# Every sample differs, so that a flip, a transposition or a shift shows.
HEIGHTS = np.arange(ROWS * COLUMNS, dtype=np.float64).reshape(ROWS, COLUMNS)
PLACE: dict[str, Any] = {"origin": [10.0, 20.0], "size": [4.0, 3.0]}
PLAIN: dict[str, Any] = {
    "name": "own",
    "water": {"level": 50.0, "waves": []},
    "receiver": {"plane": 0.0},
    "sun": {"direction": [0, 0, -1]},
    "medium": {"ior": 1.333},
    "map": {"origin": [0, 0], "size": [1, 1], "resolution": [8, 8]},
}


def terrain_of(path: Path | str, **keys: Any) -> HeightGrid:
    """Load a file as a terrain."""
    tables = copy.deepcopy(PLAIN)
    tables["receiver"] = {"terrain": {"file": str(path), **PLACE, **keys}}
    terrain = load_assets(Scene(**tables)).terrain
    assert terrain is not None
    return terrain


def refusal_of(path: Path | str, **keys: Any) -> str:
    """Return the message with which a file is refused as a terrain."""
    with pytest.raises(InputError) as caught:
        terrain_of(path, **keys)
    message = str(caught.value)
    assert "\n" not in message
    return message.removeprefix("own: receiver.terrain: ")


def npy(folder: Path, values: Any, name: str = "bed.npy") -> Path:
    """Write an array and return its path."""
    np.save(folder / name, values)
    return folder / name


def exr(folder: Path, channels: dict[str, Any]) -> Path:
    """Write channels as an EXR file, top row first."""
    import OpenEXR

    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {name: np.ascontiguousarray(values) for name, values in channels.items()}).write(
        str(folder / "bed.exr")
    )
    return folder / "bed.exr"


def test_an_array_has_its_first_row_at_the_origin(tmp_path: Path) -> None:
    grid = terrain_of(npy(tmp_path, HEIGHTS))
    np.testing.assert_array_equal(grid.z, HEIGHTS)
    assert grid.z.dtype == np.float64
    assert grid.z.flags.c_contiguous
    assert (grid.origin, grid.size, grid.cell) == ((10.0, 20.0), (4.0, 3.0), (0.5, 0.5))


@pytest.mark.parametrize("dtype", [np.uint8, np.int16, np.float16, np.float32, ">f8", "<i4"])
def test_arrays_of_any_real_type_become_float64(tmp_path: Path, dtype: Any) -> None:
    grid = terrain_of(npy(tmp_path, np.asfortranarray(HEIGHTS.astype(dtype))))
    assert grid.z.dtype == np.float64
    np.testing.assert_array_equal(grid.z, HEIGHTS)


def test_heights_are_scaled_then_offset(tmp_path: Path) -> None:
    grid = terrain_of(npy(tmp_path, HEIGHTS), scale=-0.5, offset=2.0)
    np.testing.assert_array_equal(grid.z, HEIGHTS * -0.5 + 2.0)


def test_water_from_a_file_is_displacement(tmp_path: Path) -> None:
    tables = copy.deepcopy(PLAIN)
    tables["water"] = {"level": 50.0, "height_map": {"file": str(npy(tmp_path, HEIGHTS)), "scale": 0.1, **PLACE}}
    assets = load_assets(Scene(**tables))
    assert assets.water is not None
    np.testing.assert_array_equal(assets.water.z, HEIGHTS * 0.1)
    assert (assets.terrain, assets.mesh, assets.objects) == (None, None, None)


def test_an_npz_gives_its_only_array_or_the_one_of_the_key(tmp_path: Path) -> None:
    np.savez(tmp_path / "one.npz", z=HEIGHTS)
    np.savez_compressed(tmp_path / "two.npz", z=HEIGHTS, cell=0.5)
    np.testing.assert_array_equal(terrain_of(tmp_path / "one.npz").z, HEIGHTS)
    np.testing.assert_array_equal(terrain_of(tmp_path / "two.npz", key="z").z, HEIGHTS)
    assert refusal_of(tmp_path / "two.npz") == "expected a key, since there are several arrays: z and cell"
    assert refusal_of(tmp_path / "two.npz", key="cel") == 'no array "cel", did you mean "cell"?'
    assert refusal_of(tmp_path / "two.npz", key="cell") == "expected a two-dimensional array, got a single number"


def test_an_image_gives_its_raw_numbers_with_the_top_row_last(tmp_path: Path) -> None:
    for dtype in (np.uint8, np.uint16):
        Image.fromarray(HEIGHTS.astype(dtype) + 200).save(tmp_path / "bed.png")
        np.testing.assert_array_equal(terrain_of(tmp_path / "bed.png").z, HEIGHTS[::-1] + 200)


def test_an_image_in_colour_is_refused(tmp_path: Path) -> None:
    Image.new("RGB", (COLUMNS, ROWS)).save(tmp_path / "bed.png")
    assert refusal_of(tmp_path / "bed.png").endswith("expected a greyscale image, got one of mode RGB")


def test_an_exr_gives_its_only_channel_or_the_one_of_the_key(tmp_path: Path) -> None:
    values = HEIGHTS.astype(np.float32)
    np.testing.assert_array_equal(terrain_of(exr(tmp_path, {"Z": values})).z, HEIGHTS[::-1])
    two = exr(tmp_path, {"R": values, "G": 2 * values, "B": 3 * values})
    np.testing.assert_array_equal(terrain_of(two, key="G").z, 2 * HEIGHTS[::-1])
    assert refusal_of(two).startswith("expected a key, since there are several channels")


def test_a_map_of_this_library_comes_back_as_it_was(tmp_path: Path) -> None:
    about = {"scene_text": "", "version": "0", "method": "beam", "units": "m", "time": 0.0, "energy": {}}
    write_map(tmp_path / "bed.exr", HEIGHTS.astype(np.float32), origin=(0, 0), size=(1, 1), **about)
    np.testing.assert_array_equal(terrain_of(tmp_path / "bed.exr").z, HEIGHTS)


def test_the_bed_of_the_lake_comes_with_matplotlib() -> None:
    lake = load_scene("lake")
    terrain = load_assets(lake).terrain
    assert terrain is not None
    assert terrain.z.shape == (344, 403)
    columns = np.arange(403) * terrain.cell[0] + terrain.cell[0] / 2 + terrain.origin[0]
    rows = np.arange(344) * terrain.cell[1] + terrain.cell[1] / 2 + terrain.origin[1]
    (left, low), (width, height) = lake.map.origin, lake.map.size
    shown = terrain.z[(rows > low) & (rows < low + height)][:, (columns > left) & (columns < left + width)]
    assert 0.02 < np.mean(shown > lake.water.level) < 0.5  # most of the map is flooded, its shores are dry


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (HEIGHTS[0], "expected a two-dimensional array, got 8"),
        (HEIGHTS[None], "expected a two-dimensional array, got 1×6×8"),
        (HEIGHTS[:4], "expected at least 5×5 samples, got 4×8"),
        (HEIGHTS[:, :4], "expected at least 5×5 samples, got 6×4"),
        (HEIGHTS * 1j, "expected real numbers, got an array of complex128"),
        (HEIGHTS > 3, "expected real numbers, got an array of bool"),
        (HEIGHTS.astype("U"), "expected real numbers, got an array of <U32"),
    ],
    ids=["1-D", "3-D", "rows", "columns", "complex", "bool", "text"],
)
def test_an_array_that_is_no_height_map_is_refused(tmp_path: Path, values: Any, message: str) -> None:
    assert refusal_of(npy(tmp_path, values)) == message


def test_heights_that_are_not_finite_are_counted_and_the_first_is_named(tmp_path: Path) -> None:
    faulty = HEIGHTS.copy()
    faulty[2, 3], faulty[4, 1], faulty[5, 5] = np.nan, np.inf, -np.inf
    what = "expected finite heights, got 3 that are NaN, infinite or without data"
    expected = f"{what}, the first at row 2, column 3 of the file"
    assert refusal_of(npy(tmp_path, faulty)) == expected
    assert refusal_of(exr(tmp_path, {"Y": faulty.astype(np.float32)})) == expected  # rows as the file counts them


def test_heights_that_overflow_are_refused(tmp_path: Path) -> None:
    message = refusal_of(npy(tmp_path, HEIGHTS), scale=1e308)
    assert message == "expected finite heights, got an overflow from scale or offset"


def test_pickled_objects_are_refused(tmp_path: Path) -> None:
    objects = np.array([[{}] * COLUMNS] * ROWS, dtype=object)
    assert "cannot be read as .npy" in refusal_of(npy(tmp_path, objects))
    np.savez(tmp_path / "bed.npz", z=objects)
    assert 'the array "z" cannot be read' in refusal_of(tmp_path / "bed.npz")


@pytest.mark.parametrize("kind", ["npy", "npz", "exr", "png", "jpg", "bmp"])
@pytest.mark.parametrize("content", [b"", b"garbage that is no such file"])
def test_a_file_of_another_kind_is_refused(tmp_path: Path, kind: str, content: bytes) -> None:
    (tmp_path / f"bed.{kind}").write_bytes(content)
    assert f"bed.{kind}" in refusal_of(tmp_path / f"bed.{kind}")


@pytest.mark.parametrize("kind", ["npy", "npz", "exr", "png", "bmp"])
@pytest.mark.parametrize("part", [0.2, 0.5, 0.9])
def test_a_file_that_is_cut_short_is_refused(tmp_path: Path, kind: str, part: float) -> None:
    rough = np.random.default_rng(0).integers(0, 255, (64, 64)).astype(np.uint8)
    path = tmp_path / f"bed.{kind}"
    match kind:
        case "npy":
            np.save(path, rough)
        case "npz":
            np.savez(path, z=rough)
        case "exr":
            exr(tmp_path, {"Y": rough.astype(np.float32)})
        case _:
            Image.fromarray(rough).save(path)
    terrain_of(path)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(len(whole) * part)])
    assert f"bed.{kind}" in refusal_of(path)


def test_npy_and_npz_are_not_taken_for_each_other(tmp_path: Path) -> None:
    npy(tmp_path, HEIGHTS).rename(tmp_path / "bed.npz")
    assert "NPY and NPZ" in refusal_of(tmp_path / "bed.npz")
    np.savez(tmp_path / "other.npz", z=HEIGHTS)
    (tmp_path / "other.npz").rename(tmp_path / "bed.npy")
    assert "NPY and NPZ" in refusal_of(tmp_path / "bed.npy")


def test_an_empty_archive_is_refused(tmp_path: Path) -> None:
    zipfile.ZipFile(tmp_path / "bed.npz", "w").close()
    assert "the file holds no array" in refusal_of(tmp_path / "bed.npz")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("nosuch.npy", "no such file: nosuch.npy"),
        ("matplotlib:nosuch.npz", "no such file: "),
        ("matplotlib:../matplotlibrc.npz", 'expected the bare name of a file, got "../matplotlibrc.npz"'),
        ("bundled:nosuch.npz", "no such file: "),
    ],
)
def test_a_file_that_is_not_there_is_said(name: str, message: str) -> None:
    assert refusal_of(name).startswith(message)


def test_a_folder_is_no_height_map(tmp_path: Path) -> None:
    (tmp_path / "bed.npy").mkdir()
    assert refusal_of(tmp_path / "bed.npy").startswith("expected a file, got the folder")


def test_the_faults_of_all_files_come_at_once(tmp_path: Path) -> None:
    tables = copy.deepcopy(PLAIN)
    tables["water"] = {"level": 50.0, "height_map": {"file": "a.npy", **PLACE}}
    tables["receiver"] = {
        "terrain": {"file": str(npy(tmp_path, HEIGHTS[:3])), **PLACE},
        "objects": [{"mesh": "bundled:rock.obj"}, {"mesh": "b.obj"}],
    }
    with pytest.raises(InputError) as caught:
        load_assets(Scene(**tables))
    assert str(caught.value).split("\n") == [
        "own: 3 faults",
        "  water.height_map: no such file: a.npy",
        "  receiver.terrain: expected at least 5×5 samples, got 3×8",
        "  receiver.objects[1].mesh: no such file: b.obj",
    ]
