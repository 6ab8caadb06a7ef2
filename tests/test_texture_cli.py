"""The command `texture`: the files that it makes, what it refuses, and whole files only when it is interrupted."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import warp_caustics as wc
from warp_caustics.cli import main
from warp_caustics.exr import load_header
from warp_caustics.tone import to_srgb8

SCENE = """
[water]
level = 1.0
waves = [
  { amplitude = 0.02, wavevector = [6.283, 12.566] },
  { amplitude = 0.01, wavevector = [-12.566, 6.283] },
]

[receiver]
plane = 0.0

[sun]
direction = [0.2, 0.1, -1.0]

[medium]
ior = 1.333

[map]
origin = [0.0, 0.0]
size = [1.0, 1.0]
resolution = [16, 16]
"""
LOOP = ("--loop", "1", "--fps", "3")
WHITE = 2.0
MANY_FRAMES = "100000"  # per second: more than can be rendered before the signal comes
START_SECONDS = 120.0  # for a cold compile on a slow machine


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """An empty working folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def small(folder) -> str:
    """A scene of few pixels, whose waves fit to the decimals that they have."""
    (folder / "small.toml").write_text(SCENE)
    return "small.toml"


def files(folder: Path) -> set[str]:
    """Names of all files but the scene, hidden ones too."""
    return {path.name for path in folder.iterdir()} - {"small.toml"}


def texture() -> wc.Texture:
    return wc.make_texture("small.toml", loop=1.0, fps=3.0)


def test_a_loop_of_tiles(small, folder, capfd, device):
    assert main(["texture", small, "--tile", *LOOP, "--device", device, "-o", "t.%04d.exr", "-o", "t.%04d.png"]) == 0
    out, err = capfd.readouterr()
    assert err == ""
    assert files(folder) == {f"t.{i:04d}.{suffix}" for i in range(3) for suffix in ("exr", "png")}
    said = " ".join(out.split())
    for words in (
        "tile 1 x 1 m",
        "loop 1 s, 3 frames per second",
        "moved wavevector, 2 of them",
        "white at",
        "frames 3",
    ):
        assert words in said
    made = texture()
    for i in range(3):
        expected = wc.render(made.scene, device=device, time=made.time(i)).caustic_map
        np.testing.assert_allclose(wc.load_map(f"t.{i:04d}.exr"), expected, rtol=1e-5)
    header = load_header("t.0001.exr")
    assert header["wrapmodes"] == "periodic"
    assert (header["loop"], header["frames"], header["fps"], header["time"]) == (1.0, 3.0, 3.0, 1.0 / 3.0)
    assert wc.make_texture(wc.scene.parse_scene(header["scene"])).changes == ()  # the file's scene is the moved one


def test_a_png_is_bare_pixels_at_one_exposure(small, device):
    """As many pixels as the map, the last row first, sRGB of the values over the same white in every frame."""
    tokens = ["texture", small, "--tile", *LOOP, "--device", device]
    assert main([*tokens, "--white", str(WHITE), "-o", "t.%d.png", "-o", "t.%d.exr"]) == 0
    assert main([*tokens, "-o", "own.%d.png"]) == 0
    whites = set()
    for i in range(3):
        with Image.open(f"t.{i}.png") as picture:
            assert (picture.size, picture.mode, picture.text["White"]) == ((16, 16), "L", str(int(WHITE)))
            assert picture.text["wrapmodes"] == "periodic"
            np.testing.assert_array_equal(np.asarray(picture), to_srgb8(wc.load_map(f"t.{i}.exr")[::-1], WHITE))
        with Image.open(f"own.{i}.png") as picture:
            whites.add(picture.text["White"])
    assert len(whites) == 1


def test_colour_stays_colour(small, folder):
    (folder / small).write_text(SCENE.replace("ior = 1.333", "ior = 1.333\nabsorption = [0.5, 0.1, 0.05]"))
    assert main(["texture", small, "--tile", "-o", "t.png", "-o", "t.exr"]) == 0
    with Image.open("t.png") as picture:
        assert (picture.size, picture.mode) == ((16, 16), "RGB")
        red, _, blue = np.asarray(picture, dtype=float).mean(axis=(0, 1))
    assert red < blue
    assert wc.load_map("t.exr").shape == (16, 16, 3)


def test_a_tile_alone_is_one_map_and_a_loop_alone_need_not_tile(small, folder, capfd):
    assert main(["texture", small, "--tile"]) == 0
    assert files(folder) == {"small.exr"}
    assert "loop" not in load_header("small.exr")
    (folder / small).write_text(SCENE.replace("6.283", "5.0"))
    assert main(["texture", small, *LOOP]) == 0
    assert files(folder) == {"small.exr", "small.0000.exr", "small.0001.exr", "small.0002.exr"}
    assert "wrapmodes" not in load_header("small.0000.exr")
    out = capfd.readouterr().out
    assert "wavevector" not in out.split("loop")[-1]


@pytest.mark.parametrize("suffix", ["exr", "png"])
def test_an_atlas_holds_all_frames(small, folder, capfd, suffix):
    assert main(["texture", small, "--tile", *LOOP, "--white", "2", "--atlas", f"a.{suffix}", "-o", "t.%d.png"]) == 0
    assert f"a.{suffix}" in files(folder) and len(files(folder)) == 4
    assert "atlas 2 x 2 cells, 3 frames, 32 x 32 pixels" in " ".join(capfd.readouterr().out.split())
    if suffix == "exr":
        atlas = to_srgb8(wc.load_map("a.exr")[::-1], WHITE)
        header = load_header("a.exr")
        assert (header["flipBook"], header["frames"], header["loop"]) == ((2.0, 2.0), 3.0, 1.0)
        assert "wrapmodes" not in header
    else:
        with Image.open("a.png") as picture:
            atlas = np.asarray(picture)
            assert (picture.text["flipBook"], picture.text["frames"]) == ("2 x 2", "3")
    for i in range(3):
        with Image.open(f"t.{i}.png") as picture:
            row, column = 16 * (i // 2), 16 * (i % 2)
            np.testing.assert_array_equal(atlas[row : row + 16, column : column + 16], np.asarray(picture))
    assert not atlas[16:, 16:].any()


def test_rounding_is_asked_for_and_said(small, folder, capfd):
    (folder / small).write_text(SCENE.replace("[6.283, 12.566]", "[7.0, 12.566]"))
    assert main(["texture", small, "--tile", "--round"]) == 0
    out = " ".join(capfd.readouterr().out.split())
    assert "water.waves[0].wavevector: [7, 12.566] to [6.28319, 12.5664]" in out
    assert "%" in out and "degrees" in out


BAD_COMMANDS = {
    "nothing that repeats": ([], "--tile"),
    "rounding without a tile": ([*LOOP, "--round"], "--tile"),
    "a rate without a loop": (["--tile", "--fps", "3"], "--loop"),
    "an atlas without a loop": (["--tile", "--atlas", "a.png"], "--loop"),
    "an atlas of another format": (["--tile", *LOOP, "--atlas", "a.jpg"], ".png"),
    "an atlas in a folder that is missing": (["--tile", *LOOP, "--atlas", "no/a.png"], "no"),
    "a loop that is no time": (["--tile", "--loop", "0"], "--loop"),
    "a loop without an end": (["--tile", "--loop", "inf"], "loop"),
    "a part of a frame": (["--tile", "--loop", "1", "--fps", "2.5"], "whole number"),
    "a white without a picture": (["--tile", "--white", "2"], "--white"),
    "a white that is none": (["--tile", "--white", "0", "-o", "t.png"], "--white"),
    "a white without end": (["--tile", "--white", "inf", "-o", "t.png"], "white"),
    "a format that is none": (["--tile", "-o", "t.tif"], ".exr"),
    "a number without a loop": (["--tile", "-o", "t.%d.exr"], "--loop"),
    "a loop without a number": (["--tile", *LOOP, "-o", "t.exr"], "%04d"),
    "a method that is none": (["--tile", "--method", "beem"], "beam"),
}


@pytest.mark.parametrize("case", BAD_COMMANDS)
def test_a_bad_command_is_refused(case, small, folder, capfd):
    tokens, words = BAD_COMMANDS[case]
    assert main(["texture", small, *tokens]) == 2
    out, err = capfd.readouterr()
    assert out == ""
    assert err.startswith("error: ") and err.count("error:") == 1
    assert words in err
    assert files(folder) == set()


def test_waves_that_do_not_fit_are_listed(small, folder, capfd):
    (folder / small).write_text(SCENE.replace("6.283", "7.5"))
    assert main(["texture", small, "--tile"]) == 2
    err = capfd.readouterr().err
    for words in ("2 faults", "waves[0]", "waves[1]", "6.28319", "rounding"):
        assert words in err
    assert files(folder) == set()


@pytest.mark.skipif(sys.platform == "win32", reason="signals are sent the way of POSIX")
def test_an_interrupt_leaves_whole_files_only(small, folder):
    running = subprocess.Popen(
        [
            *(sys.executable, "-m", "warp_caustics", "texture", small, "--tile", "--loop", "1", "--fps", MANY_FRAMES),
            *("-o", "t.%06d.exr", "-o", "t.%06d.png"),
        ],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        deadline = time.monotonic() + START_SECONDS
        while not (folder / "t.000001.png").exists() and time.monotonic() < deadline and running.poll() is None:
            time.sleep(0.01)
        running.send_signal(signal.SIGINT)
        _, err = running.communicate(timeout=START_SECONDS)
    finally:
        running.kill()
    assert running.returncode == 130
    assert err == "error: interrupted\n"
    written = files(folder)
    assert len(written) >= 4
    for name in written:
        assert re.fullmatch(r"t\.\d{6}\.(exr|png)", name)
        if name.endswith("exr"):
            assert wc.load_map(name).shape == (16, 16)
        else:
            with Image.open(name) as picture:
                picture.load()
