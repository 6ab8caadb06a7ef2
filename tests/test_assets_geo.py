"""Height maps from GeoTIFF and NetCDF, which come with the extras `geotiff` and `netcdf`."""

from __future__ import annotations

import copy
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from warp_caustics.assets import HeightGrid, load_assets
from warp_caustics.errors import InputError
from warp_caustics.scene import Scene

ROWS, COLUMNS = 6, 8
HEIGHTS = np.arange(ROWS * COLUMNS, dtype=np.float32).reshape(ROWS, COLUMNS)
LEFT, LOW, CELL = 500_000.0, 4_000_000.0, 30.0
PLAIN: dict[str, Any] = {
    "name": "own",
    "water": {"level": 100.0, "waves": []},
    "sun": {"direction": [0, 0, -1]},
    "medium": {"ior": 1.333},
    "map": {"origin": [0, 0], "size": [1, 1], "resolution": [8, 8]},
}
PLACE: dict[str, Any] = {"origin": [1.0, 2.0], "size": [16.0, 12.0]}


def terrain_of(path: Path, **keys: Any) -> HeightGrid:
    """Load a file as a terrain."""
    terrain = load_assets(Scene(**copy.deepcopy(PLAIN), receiver={"terrain": {"file": str(path), **keys}})).terrain
    assert terrain is not None
    return terrain


def refusal_of(path: Path, **keys: Any) -> str:
    """Return the message with which a file is refused as a terrain."""
    with pytest.raises(InputError) as caught:
        terrain_of(path, **keys)
    return str(caught.value).removeprefix("own: receiver.terrain: ")


def tiff(folder: Path, transform: tuple[float, ...] | None, crs: str | None = "EPSG:32617", **options: Any) -> Path:
    """Write the heights as a GeoTIFF, in the rows' order of the array."""
    rasterio = pytest.importorskip("rasterio")
    profile = {"driver": "GTiff", "width": COLUMNS, "height": ROWS, "count": 1, "dtype": "float32", "crs": crs}
    if transform:
        profile["transform"] = rasterio.Affine(*transform)
    with rasterio.open(folder / "bed.tif", "w", **{**profile, **options}) as dataset:
        for band in range(dataset.count):
            dataset.write(HEIGHTS, band + 1)
    return folder / "bed.tif"


NORTH_UP = (CELL, 0.0, LEFT, 0.0, -CELL, LOW + ROWS * CELL)


def test_a_geotiff_brings_its_own_place(tmp_path: Path) -> None:
    grid = terrain_of(tiff(tmp_path, NORTH_UP), scale=2.0)
    np.testing.assert_array_equal(grid.z, 2.0 * HEIGHTS[::-1])
    assert (grid.origin, grid.size) == ((LEFT, LOW), (COLUMNS * CELL, ROWS * CELL))


def test_a_geotiff_may_lie_the_other_way_around(tmp_path: Path) -> None:
    grid = terrain_of(tiff(tmp_path, (-CELL, 0.0, LEFT + COLUMNS * CELL, 0.0, CELL, LOW)))
    np.testing.assert_array_equal(grid.z, HEIGHTS[:, ::-1])
    assert (grid.origin, grid.size) == ((LEFT, LOW), (COLUMNS * CELL, ROWS * CELL))


def test_the_scene_goes_before_the_place_of_a_geotiff(tmp_path: Path) -> None:
    grid = terrain_of(tiff(tmp_path, NORTH_UP), **PLACE)
    assert (grid.origin, grid.size) == ((1.0, 2.0), (16.0, 12.0))
    np.testing.assert_array_equal(grid.z, HEIGHTS[::-1])


def test_a_geotiff_in_degrees_or_feet_needs_a_place(tmp_path: Path) -> None:
    degrees = tiff(tmp_path, (0.001, 0.0, -84.0, 0.0, -0.001, 36.0), "EPSG:4326")
    assert refusal_of(degrees) == "expected origin and size, since the file's coordinates are degrees"
    np.testing.assert_array_equal(terrain_of(degrees, **PLACE).z, HEIGHTS[::-1])
    feet = tiff(tmp_path, NORTH_UP, "EPSG:2274")
    assert refusal_of(feet).startswith("expected origin and size, since the file's coordinates are in US survey foot")


@pytest.mark.filterwarnings("ignore::UserWarning")  # rasterio's, when such a file is written
def test_a_plain_tiff_needs_a_place(tmp_path: Path) -> None:
    plain = tiff(tmp_path, None, None)
    assert refusal_of(plain) == "expected origin and size, since the file does not say where it lies"
    np.testing.assert_array_equal(terrain_of(plain, **PLACE).z, HEIGHTS[::-1])


def test_cells_without_data_turned_rasters_and_several_bands_are_refused(tmp_path: Path) -> None:
    assert "got 1 that are NaN, infinite or without data" in refusal_of(tiff(tmp_path, NORTH_UP, nodata=7.0))
    turned = (CELL, 1.0, LEFT, 1.0, -CELL, LOW)
    assert refusal_of(tiff(tmp_path, turned)).endswith("expected rows along x, got a raster that is turned")
    assert refusal_of(tiff(tmp_path, NORTH_UP, count=2)).endswith("expected one band, got 2")


def test_a_tiff_of_another_kind_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("rasterio")
    (tmp_path / "bed.tif").write_bytes(b"garbage")
    assert "cannot be read as GeoTIFF" in refusal_of(tmp_path / "bed.tif")


def netcdf(folder: Path, coords: dict[str, Any], dims: tuple[str, ...] = ("y", "x"), **more: Any) -> Path:
    """Write the heights as a NetCDF variable `bed`, in the order of the array."""
    xarray = pytest.importorskip("xarray")
    variables = {"bed": (dims, HEIGHTS if dims[0] not in ("x", "lon") else HEIGHTS.T), **more}
    xarray.Dataset(variables, coords=coords).to_netcdf(folder / "bed.nc")
    return folder / "bed.nc"


def centres(first: float, count: int, units: str = "m", name: str = "y", **attributes: Any) -> Any:
    """Return a coordinate of cell centres."""
    return (name, first + CELL * (np.arange(count) + 0.5), {"units": units, **attributes})


def metric(y_up: bool = True) -> dict[str, Any]:
    """Return coordinates in metres."""
    y = centres(LOW, ROWS)
    return {"x": centres(LEFT, COLUMNS, name="x"), "y": y if y_up else ("y", y[1][::-1], y[2])}


def test_a_netcdf_brings_its_own_place_whichever_way_it_lies(tmp_path: Path) -> None:
    for y_up in (True, False):
        grid = terrain_of(netcdf(tmp_path, metric(y_up)))
        np.testing.assert_array_equal(grid.z, HEIGHTS if y_up else HEIGHTS[::-1])
        np.testing.assert_allclose([*grid.origin, *grid.size], [LEFT, LOW, COLUMNS * CELL, ROWS * CELL])
        (tmp_path / "bed.nc").unlink()


def test_a_netcdf_may_have_x_first(tmp_path: Path) -> None:
    grid = terrain_of(netcdf(tmp_path, metric(), dims=("x", "y")))
    np.testing.assert_array_equal(grid.z, HEIGHTS)


def test_a_netcdf_gives_its_only_plane_or_the_one_of_the_key(tmp_path: Path) -> None:
    more = {"other": (("y", "x"), 2 * HEIGHTS), "crs": 0, "series": (("time", "y", "x"), 3 * HEIGHTS[None])}
    path = netcdf(tmp_path, metric(), **more)
    np.testing.assert_array_equal(terrain_of(path, key="other").z, 2 * HEIGHTS)
    np.testing.assert_array_equal(terrain_of(path, key="series").z, 3 * HEIGHTS)
    assert refusal_of(path) == "expected a key, since there are several variables: bed, other and series"
    assert refusal_of(path, key="bad") == 'no variable "bad", did you mean "bed"?'
    assert refusal_of(path, key="crs").startswith("expected a two-dimensional array")


def test_a_netcdf_in_degrees_kilometres_or_without_coordinates_needs_a_place(tmp_path: Path) -> None:
    degrees = {
        "lat": ("lat", np.linspace(36.5, 36.0, ROWS), {"units": "degrees_north"}),
        "lon": ("lon", np.linspace(-84.0, -83.5, COLUMNS), {"units": "degrees_east"}),
    }
    path = netcdf(tmp_path, degrees, dims=("lat", "lon"))
    assert refusal_of(path) == "expected origin and size, since the file's coordinates are degrees"
    np.testing.assert_array_equal(terrain_of(path, **PLACE).z, HEIGHTS[::-1])
    path.unlink()
    kilometres = {**metric(), "x": centres(LEFT, COLUMNS, "km", "x")}
    path = netcdf(tmp_path, kilometres)
    assert refusal_of(path) == "expected origin and size, since the file's coordinates are in km"
    path.unlink()
    path = netcdf(tmp_path, {})
    assert refusal_of(path) == "expected origin and size, since the file does not say where it lies"
    np.testing.assert_array_equal(terrain_of(path, **PLACE).z, HEIGHTS)


def test_uneven_coordinates_and_missing_values_are_refused(tmp_path: Path) -> None:
    uneven = {**metric(), "y": ("y", [0.0, 1.0, 2.0, 3.0, 4.0, 6.0])}
    path = netcdf(tmp_path, uneven)
    assert refusal_of(path).endswith('expected an evenly spaced coordinate "y"')
    path.unlink()
    path = netcdf(tmp_path, metric(), hole=(("y", "x"), HEIGHTS, {"_FillValue": np.float32(9.0)}))
    assert "got 1 that are NaN, infinite or without data" in refusal_of(path, key="hole")


def test_a_netcdf_of_another_kind_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("xarray")
    (tmp_path / "bed.nc").write_bytes(b"garbage")
    assert "cannot be read as NetCDF" in refusal_of(tmp_path / "bed.nc")


@pytest.mark.parametrize(
    ("needed", "file", "extra"), [("rasterio", "bed.tif", "geotiff"), ("xarray and netCDF4", "bed.nc", "netcdf")]
)
def test_a_reader_that_is_not_installed_is_named_with_its_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, needed: str, file: str, extra: str
) -> None:
    monkeypatch.setitem(sys.modules, needed.split(" ")[0], None)  # as if it were not installed
    (tmp_path / file).touch()
    message = refusal_of(tmp_path / file)
    assert f'needs {needed}: pip install "warp-caustics[{extra}]"' in message
