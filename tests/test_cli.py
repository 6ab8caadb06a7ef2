"""The command line: what it makes, what it refuses, and with which status."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import warp_caustics as wc
from warp_caustics.cli import main, report
from warp_caustics.cli.interrupt import Interrupt

SCENE = """
[water]
level = 1.0
waves = [{ amplitude = 0.02, wavevector = [5.0, 2.0] }]

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
HEIGHT_MAP = "waves = [{ amplitude = 0.02, wavevector = [5.0, 2.0] }]"
FRAMES_FOR_AN_INTERRUPT = "100000"  # more than can be rendered before the signal comes
START_SECONDS = 120.0  # for a cold compile on a slow machine


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """An empty working folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def scene(folder) -> Path:
    """A scene of few pixels."""
    path = folder / "small.toml"
    path.write_text(SCENE)
    return path


def files(folder: Path) -> set[str]:
    """Names of all files in a folder, hidden ones too."""
    return {path.name for path in folder.iterdir()}


def refused(capfd: pytest.CaptureFixture[str], *tokens: str, status: int = 2) -> str:
    """Run a command that must fail, and return its message."""
    assert main(tokens) == status
    out, err = capfd.readouterr()
    assert out == ""
    assert err.startswith("error: ")
    assert err.count("error:") == 1
    assert "Traceback" not in err
    return err


def command(*tokens: str) -> list[str]:
    return [sys.executable, "-m", "warp_caustics", *tokens]


# --- what it makes ---------------------------------------------------------------------------------------------------


def test_render_writes_beside_the_caller_and_says_what_it_did(scene, folder, capfd, device):
    assert main(["render", str(scene), "--device", device]) == 0
    out, err = capfd.readouterr()
    assert err == ""
    assert files(folder) == {"small.toml", "small.exr"}
    assert str(folder / "small.exr") in out
    for word in ("beam", device, "ms per frame", "bytes", "emitted", "received", "off by"):
        assert word in out
    assert wc.load_map("small.exr").shape == (16, 16)


def test_the_map_in_the_file_is_the_map_of_the_library(scene, device):
    assert main(["render", str(scene), "--device", device, "--time", "0.25", "-o", "map.exr"]) == 0
    expected = wc.render(wc.load_scene(scene), device=device, time=0.25).caustic_map
    np.testing.assert_array_equal(wc.load_map("map.exr"), expected)


@pytest.mark.parametrize("method", ["beam", "photon", "gather"])
def test_render_by_each_method(scene, capfd, method):
    assert main(["render", str(scene), "--method", method, "-o", "map.exr"]) == 0
    assert method in capfd.readouterr().out


def test_one_render_into_several_files(scene, folder):
    assert main(["render", str(scene), "-o", "map.exr", "-o", "map.png"]) == 0
    assert files(folder) == {"small.toml", "map.exr", "map.png"}


def test_a_sequence_is_numbered_and_moves(scene, folder, capfd):
    assert main(["render", str(scene), "--frames", "3", "--fps", "2", "--time", "1", "-o", "out.%04d.exr"]) == 0
    out, err = capfd.readouterr()
    assert files(folder) == {"small.toml", "out.0000.exr", "out.0001.exr", "out.0002.exr"}
    assert "frames 3" in " ".join(out.split())
    assert err == ""  # the progress bar is for terminals
    assert not np.array_equal(wc.load_map("out.0000.exr"), wc.load_map("out.0001.exr"))
    second = wc.render(wc.load_scene(scene), time=1.5).caustic_map
    np.testing.assert_array_equal(wc.load_map("out.0001.exr"), second)


def test_a_sequence_without_a_name_for_it(scene, folder):
    assert main(["render", str(scene), "--frames", "2"]) == 0
    assert files(folder) == {"small.toml", "small.0000.exr", "small.0001.exr"}


CAMERA = """
[camera]
position = [0.5, 0.5, 0.6]
target = [0.5, 0.5, 0.0]
vertical_fov = 40.0
resolution = [12, 8]
"""


def test_a_picture_is_what_the_camera_sees(scene, folder, capfd, device):
    from PIL import Image

    scene.write_text(SCENE + CAMERA)
    assert main(["render", str(scene), "--picture", "--device", device, "-o", "frame.exr"]) == 0
    assert main(["render", str(scene), "--picture", "--device", device]) == 0
    out, err = capfd.readouterr()
    assert err == "" and str(folder / "small.png") in out
    assert files(folder) == {"small.toml", "frame.exr", "small.png"}
    np.testing.assert_array_equal(wc.load_map("frame.exr"), wc.render(wc.load_scene(scene), device=device).picture)
    assert Image.open("small.png").size == (12, 8)


def test_a_sequence_of_pictures_moves(scene, folder):
    scene.write_text(SCENE + CAMERA)
    assert main(["render", str(scene), "--picture", "--frames", "2", "--fps", "2"]) == 0
    assert files(folder) == {"small.toml", "small.0000.png", "small.0001.png"}
    tokens = ["render", str(scene), "--picture", "--frames", "2", "--fps", "2", "--time", "0.25", "-o", "f.%04d.exr"]
    assert main(tokens) == 0
    second = wc.render(wc.load_scene(scene), time=0.75).picture
    np.testing.assert_array_equal(wc.load_map("f.0001.exr"), second)
    assert not np.array_equal(wc.load_map("f.0000.exr"), second)


def test_a_picture_needs_a_camera(scene, folder, capfd):
    assert "[camera]" in refused(capfd, "render", str(scene), "--picture")
    assert files(folder) == {"small.toml"}


def test_plan_prints_the_plan(scene, capfd):
    assert main(["plan", str(scene)]) == 0
    out, err = capfd.readouterr()
    assert out.strip() == str(wc.make_plan(wc.load_scene(scene))).strip()
    assert err == ""


def test_info_says_what_is_here(capfd):
    assert main(["info"]) == 0
    out, err = capfd.readouterr()
    assert err == ""
    for word in (wc.__version__, "warp-lang", "pyvista", "OpenEXR", "cpu", "beam", *wc.bundled_scenes(), "pictures"):
        assert word in out


def test_version_and_help(capfd):
    assert main(["--version"]) == 0
    assert capfd.readouterr().out.strip() == wc.__version__
    assert main(["render", "--help"]) == 0
    help_text = capfd.readouterr().out
    for option in ("--method", "--device", "--threads", "--time", "--frames", "--fps", "--picture", "--profile", "-o"):
        assert option in help_text


def test_a_fresh_process_prints_no_banner(scene):
    done = subprocess.run(command("render", str(scene)), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert "Kernel cache" not in done.stdout


# --- what it refuses -------------------------------------------------------------------------------------------------

BAD_COMMANDS = {
    "no scene": (["render"], "SCENE"),
    "no such command": (["rendr", "pool"], "render"),
    "no such option": (["render", "pool", "--methud", "beam"], "--method"),
    "a word too many": (["render", "pool", "extra"], "extra"),
    "a time that is none": (["render", "pool", "--time", "nan"], "--time"),
    "an infinite time": (["view", "pool", "--time", "inf"], "--time"),
    "no threads": (["render", "pool", "--threads", "0"], "--threads"),
    "no frames": (["render", "pool", "--frames", "0"], "--frames"),
    "frames that stand still": (["render", "pool", "--frames", "2", "--fps", "0"], "--fps"),
    "frames that are infinitely fast": (["render", "pool", "--frames", "2", "--fps", "nan"], "--fps"),
    "a picture of another format": (["render", "pool", "--picture", "-o", "frame.jpg"], ".png"),
    "two kinds of view": (["view", "pool", "--compare", "--method", "beam"], "--compare"),
    "a method that is none": (["render", "pool", "--method", "beem"], "beam"),
    "a device that is none": (["render", "pool", "--device", "gpu"], "cpu"),
    "an absent CUDA device": (["render", "pool", "--device", "cuda:99"], "cpu"),
    "an absent CUDA device in a plan": (["plan", "pool", "--device", "cuda:99"], "cpu"),
    "a format that is none": (["render", "pool", "-o", "map.tif"], ".exr"),
    "frames without a number": (["render", "pool", "--frames", "2", "-o", "map.exr"], "%04d"),
    "frames with two numbers": (["render", "pool", "--frames", "2", "-o", "%d.%d.exr"], "%04d"),
    "a number without frames": (["render", "pool", "-o", "map.%04d.exr"], "--frames"),
    "a folder that is missing": (["render", "pool", "-o", "missing/map.exr"], "missing"),
    "a folder that is a file": (["render", "pool", "-o", "a_file/map.exr"], "a_file"),
    "a folder for a file": (["render", "pool", "-o", "a_folder.exr"], "a_folder.exr"),
    "a screenshot that is missing its folder": (["view", "pool", "--screenshot", "missing/view.png"], "missing"),
    "a screenshot of another format": (["view", "pool", "--screenshot", "view.jpg"], ".png"),
}


@pytest.mark.parametrize("case", BAD_COMMANDS)
def test_a_bad_command_is_refused(case, folder, capfd):
    (folder / "a_file").touch()
    (folder / "a_folder.exr").mkdir()
    tokens, words = BAD_COMMANDS[case]
    assert words in refused(capfd, *tokens)
    assert files(folder) == {"a_file", "a_folder.exr"}


@pytest.mark.parametrize("output", ["missing/map.exr", "map.tif", "map.%d.exr"])
def test_the_output_is_checked_before_the_work(scene, capfd, monkeypatch, output):
    def work(*_, **__):
        raise AssertionError("this is too late")

    monkeypatch.setattr("warp_caustics.renderer.Renderer", work)
    refused(capfd, "render", str(scene), "-o", output)


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="permissions do not bind the superuser")
def test_a_folder_that_cannot_be_written_is_refused(scene, folder, capfd):
    closed = folder / "closed"
    closed.mkdir(mode=0o500)
    assert "closed" in refused(capfd, "render", str(scene), "-o", "closed/map.exr")


BAD_SCENES = {
    "an unknown key": ("level = 1.0", "levle = 1.0", ["water.levle", "level"]),
    "a sun from below": ("[0.2, 0.1, -1.0]", "[0.2, 0.1, 1.0]", ["sun.direction"]),
    "an index under one": ("ior = 1.333", "ior = 0.9", ["medium.ior"]),
    "a map without a size": ("size = [1.0, 1.0]", "size = [0.0, 1.0]", ["map.size"]),
    "a map without pixels": ("[16, 16]", "[0, 16]", ["map.resolution"]),
    "a map that does not fit": ("[16, 16]", "[100000, 100000]", ["bytes", "100000"]),
    "a preset of nobody": (HEIGHT_MAP, 'preset = "tsunami"', ["water.preset", '"ripples"']),
    "a height map that is missing": (
        HEIGHT_MAP,
        'height_map = { file = "no.npy", origin = [0, 0], size = [1, 1] }',
        ["no.npy"],
    ),
    "NaN in a height map": (
        HEIGHT_MAP,
        'height_map = { file = "nan.npy", origin = [0, 0], size = [1, 1] }',
        ["water.height_map", "row 3, column 4"],
    ),
    "infinity in a height map": (
        HEIGHT_MAP,
        'height_map = { file = "inf.npy", origin = [0, 0], size = [1, 1] }',
        ["water.height_map", "row 3, column 4"],
    ),
    "a mesh that is missing": ("plane = 0.0", 'mesh = "no.obj"', ["no.obj"]),
    "a mesh without triangles": ("plane = 0.0", 'mesh = "points.obj"', ["points.obj", "triangle"]),
    "TOML that is none": ("[water]", "[water", ["TOML"]),
}


@pytest.mark.parametrize("verb", ["render", "plan"])
@pytest.mark.parametrize("case", BAD_SCENES)
def test_a_bad_scene_is_refused(case, verb, folder, capfd):
    heights = np.zeros((8, 8))
    for name, value in (("nan", np.nan), ("inf", np.inf)):
        heights[3, 4] = value
        np.save(folder / f"{name}.npy", heights)
    (folder / "points.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n")
    good, bad, words = BAD_SCENES[case]
    assert SCENE.count(good) == 1
    (folder / "bad.toml").write_text(SCENE.replace(good, bad))
    before = files(folder)
    message = refused(capfd, verb, "bad.toml")
    for word in words:
        assert word in message
    assert files(folder) == before


def test_a_scene_that_is_missing_is_refused(folder, capfd):
    assert "nosuch.toml" in refused(capfd, "render", "nosuch.toml")
    assert "pool" in refused(capfd, "render", "poool")  # did you mean
    assert files(folder) == set()


def test_all_faults_of_a_scene_come_in_one_message(folder, capfd):
    (folder / "bad.toml").write_text(SCENE.replace("ior = 1.333", "ior = 0.9").replace("[16, 16]", "[0, 16]"))
    message = refused(capfd, "render", "bad.toml")
    assert "medium.ior" in message
    assert "map.resolution" in message


def test_bad_input_in_a_process_of_its_own(folder):
    done = subprocess.run(command("render", "nosuch.toml"), capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.startswith("error: nosuch.toml")
    assert files(folder) == set()


@pytest.mark.parametrize(("longest", "told"), [(0, True), (2**40, False)])
def test_a_long_frame_tells_how_far_it_is(scene, folder, monkeypatch, longest, told):
    shares: list[float] = []
    monkeypatch.setattr("warp_caustics.plan.LONG_WORK", longest)
    monkeypatch.setattr("warp_caustics.cli.report.share", lambda: contextlib.nullcontext(shares.append))
    assert main(["render", str(scene), "--device", "cpu"]) == 0
    assert shares[-1:] == ([1.0] if told else [])


def test_a_bar_is_for_terminals(monkeypatch):
    with report.share() as tell:
        assert tell is None
    monkeypatch.setenv("FORCE_COLOR", "1")  # what makes rich take a pipe for a terminal
    with report.share() as tell:
        assert tell is not None
        tell(0.5)


# --- failure and interruption ----------------------------------------------------------------------------------------


def test_a_failure_is_status_one(scene, folder, capfd, monkeypatch):
    def fail(*_, **__):
        raise wc.RenderError("the device is on fire")

    monkeypatch.setattr("warp_caustics.renderer.Renderer", fail)
    assert "on fire" in refused(capfd, "render", str(scene), status=1)
    assert files(folder) == {"small.toml"}


def test_a_failure_while_writing_leaves_no_half_file(scene, folder, capfd, monkeypatch):
    def fail(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", fail)
    assert "No space left" in refused(capfd, "render", str(scene), status=1)
    assert files(folder) == {"small.toml"}


@pytest.mark.skipif(sys.platform == "win32", reason="signals are sent the way of POSIX")
def test_an_interrupt_leaves_whole_files_only(scene, folder):
    running = subprocess.Popen(
        command("render", str(scene), "--frames", FRAMES_FOR_AN_INTERRUPT, "-o", "out.%06d.exr"),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        deadline = time.monotonic() + START_SECONDS
        while not (folder / "out.000001.exr").exists() and time.monotonic() < deadline and running.poll() is None:
            time.sleep(0.01)
        running.send_signal(signal.SIGINT)
        _, err = running.communicate(timeout=START_SECONDS)
    finally:
        running.kill()
    assert running.returncode == 130
    assert err == "error: interrupted\n"
    written = files(folder) - {"small.toml"}
    assert len(written) >= 2
    for name in written:
        assert re.fullmatch(r"out\.\d{6}\.exr", name)
        assert wc.load_map(folder / name).shape == (16, 16)


def test_an_interrupt_while_a_file_is_written_waits_for_its_end():
    interrupt = Interrupt()
    before = signal.getsignal(signal.SIGINT)
    done = []
    with pytest.raises(KeyboardInterrupt), interrupt.watch():
        with interrupt.hold():
            signal.raise_signal(signal.SIGINT)
            done.append("written")
        done.append("went on")
    assert done == ["written"]
    assert signal.getsignal(signal.SIGINT) is before


def test_an_interrupt_that_native_code_drops_is_raised_again():
    interrupt = Interrupt()
    with pytest.raises(KeyboardInterrupt), interrupt.watch(), contextlib.suppress(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)


@pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo-terminal")
def test_a_sequence_shows_a_progress_bar_on_a_terminal(scene):
    import pty

    try:
        ours, theirs = pty.openpty()
    except OSError as error:
        pytest.skip(f"no pseudo-terminal here: {error}")
    try:
        environment = {**os.environ, "TERM": "xterm"}
        done = subprocess.run(
            command("render", str(scene), "--frames", "3"),
            stdout=subprocess.DEVNULL,
            stderr=theirs,
            env=environment,
            check=False,
        )
        shown = os.read(ours, 1 << 16).decode()
    finally:
        os.close(theirs)
        os.close(ours)
    assert done.returncode == 0
    assert "rendering" in shown
