"""The view in 3D: that it can be drawn without a display, that light lies where it belongs, and how it fails."""

from __future__ import annotations

import os
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import numpy.typing as npt
import pytest

import warp_caustics as wc
from warp_caustics import view as view_module
from warp_caustics import view_live
from warp_caustics.cli import main
from warp_caustics.view import check_can_show, light_picture, make_plotter, show_plotter, view
from warp_caustics.view_compare import make_comparison, render_all
from warp_caustics.view_live import LiveView

SCENE = """
[water]
level = 0.5
waves = [{{ amplitude = 0.02, wavevector = [5.0, 2.0] }}]

[receiver]
{receiver}

[sun]
direction = [0.2, 0.1, -1.0]

[medium]
ior = 1.333

[map]
origin = [100.0, -50.0]
size = [2.0, 1.0]
resolution = [32, 16]
"""
TETRAHEDRON = "v 100 -50 0\nv 101 -50 0\nv 100 -49 0\nv 100 -50 0.3\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
RECEIVERS = {
    "plane": "plane = 0.0",
    "terrain": "terrain = { base = 20.0, slope = [-0.2, 0.0], waves = [] }",
    "mesh": 'mesh = "rock.obj"',
    "plane with an object": 'plane = 0.0\nobjects = [{ mesh = "rock.obj", translate = [0.5, 0.2, 0.0] }]',
}
ROWS, COLUMNS = 16, 32
# Of 255, between the halves of a picture of which one is lit: far above what shading and the water could do.
CLEAR_DIFFERENCE = 20.0
WINDOW = (320, 200)  # pixels; large enough to tell the halves of a map apart


@pytest.fixture
def drawing(monkeypatch) -> None:
    """Draw small pictures; skip where VTK cannot draw, and say what it lacks."""
    monkeypatch.setattr(view_module, "WINDOW", WINDOW)
    try:
        check_can_show(window=False)
    except wc.RenderError as error:
        pytest.skip(str(error))


@pytest.fixture
def broken_drawing(monkeypatch):
    """A machine whose VTK kills the process."""
    monkeypatch.setattr(view_module, "PROBE", "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)")
    view_module._probe.cache_clear()
    yield
    view_module._probe.cache_clear()


@pytest.fixture
def make_result(tmp_path):
    """Make what a render gives, as far as the view looks at it, with a map of one's own."""

    def make(receiver: str, caustic_map: npt.NDArray[np.float32]) -> SimpleNamespace:
        (tmp_path / "rock.obj").write_text(TETRAHEDRON)
        path = tmp_path / "scene.toml"
        path.write_text(SCENE.format(receiver=RECEIVERS[receiver]))
        return SimpleNamespace(scene=wc.load_scene(path), caustic_map=caustic_map, method="beam", time=0.0)

    return make


def half_lit(side: str) -> npt.NDArray[np.float32]:
    caustic_map = np.zeros((ROWS, COLUMNS), np.float32)
    lit = {"low x": np.s_[:, : COLUMNS // 2], "high x": np.s_[:, COLUMNS // 2 :], "low y": np.s_[: ROWS // 2]}
    caustic_map[lit[side]] = 1.0
    return caustic_map


def read(path) -> npt.NDArray[np.float64]:
    from PIL import Image

    return np.asarray(Image.open(path).convert("L"), dtype=np.float64)


@pytest.mark.usefixtures("drawing")
@pytest.mark.parametrize("receiver", ["plane", "terrain"])
def test_light_lies_where_the_map_says(make_result, tmp_path, receiver):
    """Seen from low y: low x is to the left, low y is near, that is at the bottom of the picture."""
    left, right, near = (
        read_view(make_result(receiver, half_lit(side)), tmp_path) for side in ("low x", "high x", "low y")
    )
    middle = left.shape[1] // 2
    difference = left - right
    assert difference[:, :middle].sum() > 0.0 > difference[:, middle:].sum()
    lit_rows = np.flatnonzero(near.max(axis=1) > near.min() + CLEAR_DIFFERENCE)
    dark = read_view(make_result(receiver, np.zeros((ROWS, COLUMNS), np.float32)), tmp_path)
    both = np.flatnonzero((left + right - 2.0 * dark).max(axis=1) > CLEAR_DIFFERENCE)
    assert lit_rows.size
    assert (near - dark).sum(axis=1) @ np.arange(near.shape[0]) / (near - dark).sum() > both.mean()


def read_view(result, tmp_path) -> npt.NDArray[np.float64]:
    view(result, screenshot=tmp_path / "view.png")
    return read(tmp_path / "view.png")


@pytest.mark.usefixtures("drawing")
@pytest.mark.parametrize("receiver", RECEIVERS)
def test_every_receiver_is_drawn(make_result, tmp_path, receiver):
    caustic_map = np.ones((ROWS, COLUMNS, 3), np.float32)
    picture = read_view(make_result(receiver, caustic_map), tmp_path)
    dark = read_view(make_result(receiver, 0.0 * caustic_map), tmp_path)
    assert np.mean(picture - dark > CLEAR_DIFFERENCE) > 0.01
    assert {path.name for path in tmp_path.iterdir()} == {"rock.obj", "scene.toml", "view.png"}


@pytest.mark.usefixtures("drawing")
def test_an_object_stands_on_the_floor(make_result, tmp_path):
    caustic_map = np.ones((ROWS, COLUMNS), np.float32)
    bare = read_view(make_result("plane", caustic_map), tmp_path)
    # The object is lower than the water: camera and water are the same in both.
    assert np.any(
        np.abs(read_view(make_result("plane with an object", caustic_map), tmp_path) - bare) > CLEAR_DIFFERENCE
    )


@pytest.mark.usefixtures("drawing")
def test_texture_coordinates_are_places_in_the_map(make_result):
    result = make_result("plane", half_lit("low x"))
    plotter = make_plotter(result, off_screen=True)
    plane = next(mesh for mesh in plotter.meshes if mesh.active_texture_coordinates is not None)
    window = result.scene.map
    expected = (plane.points[:, :2] - window.origin) / window.size
    np.testing.assert_allclose(plane.active_texture_coordinates, expected)
    assert {tuple(corner) for corner in np.round(expected).tolist()} == {(0, 0), (1, 0), (1, 1), (0, 1)}
    plotter.close()


@pytest.mark.usefixtures("drawing")
def test_the_whole_scene_is_in_the_picture(make_result, tmp_path):
    picture = read_view(make_result("plane", np.ones((ROWS, COLUMNS), np.float32)), tmp_path)
    dark = read_view(make_result("plane", np.zeros((ROWS, COLUMNS), np.float32)), tmp_path)
    lit = picture - dark > CLEAR_DIFFERENCE
    assert lit.any()
    assert not (lit[0].any() or lit[-1].any() or lit[:, 0].any() or lit[:, -1].any())


@pytest.fixture
def live(make_result):
    """A live view that nobody sees."""
    views = []

    def make(receiver: str = "plane", **more) -> LiveView:
        views.append(LiveView(make_result(receiver, half_lit("low x")).scene, device="cpu", off_screen=True, **more))
        return views[-1]

    yield make
    for one in views:
        one.plotter.close()


@pytest.mark.usefixtures("drawing")
def test_sliders_start_where_the_scene_is_and_render_nothing_until_moved(live):
    shown = live()
    assert shown.setting.elevation == pytest.approx(np.degrees(np.arctan2(1.0, np.hypot(0.2, 0.1))))
    assert shown.setting.azimuth == pytest.approx(180.0 + np.degrees(np.arctan2(0.1, 0.2)))
    assert shown.setting.depth == pytest.approx(0.5)
    first = shown.result
    assert [widget.GetRepresentation().GetValue() for widget in shown.sliders] == pytest.approx(
        [shown.setting.elevation, shown.setting.azimuth, 0.5, 0.0], rel=1e-5
    )
    shown.move(time=0.0)
    assert shown.result is first


@pytest.mark.usefixtures("drawing")
def test_a_moved_slider_renders_what_it_says(live):
    """Each slider's map is the one that a scene with that value has."""
    shown = live()
    scene = shown.result.scene
    shown.move(time=0.5)
    np.testing.assert_array_equal(shown.result.caustic_map, wc.render(scene, device="cpu", time=0.5).caustic_map)
    shown.move(elevation=40.0, azimuth=30.0)
    lower = scene.model_copy(update={"sun": wc.scene.Sun(elevation=40.0, azimuth=30.0)})
    np.testing.assert_array_equal(shown.result.caustic_map, wc.render(lower, device="cpu", time=0.5).caustic_map)
    shown.move(depth=0.8)
    assert shown.result.scene.water.level == pytest.approx(0.8)
    water = next(mesh for mesh in shown.plotter.meshes if mesh.n_points == (ROWS + 1) * (COLUMNS + 1))
    assert water.points[:, 2].mean() == pytest.approx(0.8, abs=0.02)
    shown.move(method="photon")
    assert shown.result.method == "photon" and shown.message == ""


@pytest.mark.usefixtures("drawing")
def test_a_slider_of_the_window_moves_the_light(live):
    shown = live()
    widget = shown.sliders[3]
    widget.GetRepresentation().SetValue(2.0)
    widget.InvokeEvent("EndInteractionEvent")
    assert shown.setting.time == pytest.approx(2.0) and shown.result.time == pytest.approx(2.0)


@pytest.mark.usefixtures("drawing")
def test_a_method_that_cannot_serve_is_said_and_the_last_light_stays(live):
    shown = live("terrain")
    before = shown.result
    shown.move(method="sample")
    assert "flat floor" in shown.message and shown.result is before
    shown.move(method="beam")
    assert shown.message == ""
    with pytest.raises(wc.InputError, match="does not follow sliders"):
        live(method="reference")


@pytest.mark.usefixtures("drawing")
def test_slow_frames_are_coarser(live, monkeypatch):
    monkeypatch.setattr(view_live, "SLOW", -1.0)
    monkeypatch.setattr(view_live, "COARSEST", 8)
    monkeypatch.setattr(view_live, "FINEST", COLUMNS)
    shown = live()
    for time, columns in ((1.0, 16), (2.0, 8), (3.0, 8)):
        shown.move(time=time)
        assert shown.result.scene.map.resolution == (columns, columns // 2)


@pytest.mark.usefixtures("drawing")
def test_all_methods_stand_side_by_side(make_result, tmp_path):
    scene = make_result("terrain", half_lit("low x")).scene
    shown = render_all(scene, ("beam", "sample"), "cpu")
    assert [one.method for one in shown] == ["beam", "sample"]
    np.testing.assert_array_equal(shown[0].image, wc.render(scene, device="cpu").caustic_map)
    assert shown[0].milliseconds > 0.0 and not shown[0].reason
    assert shown[1].image is None and "flat floor" in shown[1].reason
    show_plotter(lambda: make_comparison(scene, shown, off_screen=True), tmp_path / "both.png")
    picture = read(tmp_path / "both.png")
    middle = picture.shape[1] // 2
    assert picture[:, :middle].mean() > picture[:, middle:].mean() + CLEAR_DIFFERENCE


def test_light_has_one_exposure_for_all_channels():
    caustic_map = np.zeros((ROWS, COLUMNS, 3), np.float32)
    caustic_map[...] = (1.0, 0.5, 0.0)
    picture = light_picture(caustic_map)
    assert picture.dtype == np.uint8
    assert picture.shape == (ROWS, COLUMNS, 3)
    # sRGB of one half, IEC 61966-2-1: 255 * (1.055 * 0.5**(1 / 2.4) - 0.055) = 187.5
    assert picture[0, 0, 0] == 255
    assert picture[0, 0, 1] in (187, 188)
    assert picture[0, 0, 2] == 0


def test_a_dark_map_is_black():
    assert not light_picture(np.zeros((ROWS, COLUMNS), np.float32)).any()


@pytest.mark.usefixtures("broken_drawing")
def test_a_vtk_that_dies_is_an_error_that_names_the_packages(capfd, tmp_path):
    with pytest.raises(wc.RenderError, match="libegl1"):
        check_can_show(window=False)
    assert main(["view", "pool", "--screenshot", str(tmp_path / "view.png")]) == 1
    out, err = capfd.readouterr()
    assert out == ""
    assert err.startswith("error: ")
    assert "libegl1" in err
    assert "Traceback" not in err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif("sys.platform != 'linux'", reason="elsewhere a window needs no DISPLAY")
def test_a_window_without_a_display_is_an_error_that_says_what_else(capfd, monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    assert main(["view", "pool"]) == 1
    assert "--screenshot" in capfd.readouterr().err


@pytest.mark.usefixtures("broken_drawing")
def test_the_library_does_not_draw_where_that_would_kill_it(make_result, tmp_path):
    with pytest.raises(wc.RenderError, match="libegl1"):
        view(make_result("plane", half_lit("low x")), screenshot=tmp_path / "view.png")


@pytest.mark.usefixtures("drawing")
def test_the_command_writes_a_picture_and_says_where(make_result, tmp_path):
    make_result("plane", half_lit("low x"))
    tokens = ["view", str(tmp_path / "scene.toml"), "--screenshot", str(tmp_path / "b.png")]
    environment = {name: value for name, value in os.environ.items() if name != "DISPLAY"}
    done = subprocess.run(
        [sys.executable, "-m", "warp_caustics", *tokens], capture_output=True, text=True, env=environment, check=False
    )
    assert done.returncode == 0, done.stderr
    assert str(tmp_path / "b.png") in done.stdout
    assert done.stderr == ""  # not even VTK's complaint that there is no X server
    assert read(tmp_path / "b.png").std() > 0.0
