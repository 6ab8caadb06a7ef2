"""The commands and their options; what they print is in `report`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, Parameter
from cyclopts.types import PositiveFloat, PositiveInt

from warp_caustics import __version__
from warp_caustics.cli import report
from warp_caustics.cli.interrupt import Interrupt
from warp_caustics.cli.profiling import check_can_profile, profile_frame, profile_path
from warp_caustics.cli.quiet import start_warp
from warp_caustics.cli.saving import MapSaver, PictureSaver
from warp_caustics.cli.viewing import show_comparison, show_live
from warp_caustics.errors import InputError

DEFAULT_FPS = 24.0  # frames per second of film
SUFFIXES = (".exr", ".png")
CAMERA_EXPECTED = "expected a table [camera] with position, target, vertical_fov and resolution"

app = App(
    name="warp-caustics",
    help="Water caustics by the real-time techniques of the literature, on NVIDIA Warp kernels, CUDA and CPU.",
    version=__version__,
    suppress_keyboard_interrupt=False,
)


def _finite(_: Any, value: float | None) -> None:
    if value is not None and not math.isfinite(value):
        raise ValueError("Must be a finite number of seconds.")


Time = Annotated[float, Parameter(validator=_finite)]
Flag = Annotated[bool, Parameter(negative=())]
Outputs = Annotated[list[Path], Parameter(name=["--output", "-o"], negative=())]


@app.command
def render(
    scene: str,
    /,
    *,
    method: str | None = None,
    device: str | None = None,
    threads: PositiveInt | None = None,
    time: Time = 0.0,
    frames: PositiveInt | None = None,
    fps: PositiveFloat = DEFAULT_FPS,
    picture: Flag = False,
    profile: Flag = False,
    output: Outputs | None = None,
) -> None:
    """Render a caustic map or a picture, or a numbered sequence of them.

    Parameters
    ----------
    scene
        A bundled scene's name, or a TOML file.
    method
        The technique; that of the scene when left out.
    device
        `cpu`, `cuda:0`, ...; the best one present when left out.
    threads
        Threads on the CPU.
    time
        Seconds on the water's clock, of the first frame.
    frames
        Frames of a sequence, counted from the time.
    fps
        Frames per second of a sequence.
    picture
        What the scene's camera sees, instead of the map: linear radiance as EXR, exposed as PNG.
    profile
        Time, bytes, operations and memory of each pass, as a table and, beside the first output, as
        OUT.profile.json. Frames from the time on are measured, at --fps.
    output
        OUT.exr, OUT.png, or OUT.%04d.exr for a sequence; may be given more than once. SCENE.exr, or
        SCENE.png of a picture, when left out. With --profile also OUT.json, for the profile; alone, it is
        all that is written.
    """
    from warp_caustics.files import check_writable, frame_path, is_sequence
    from warp_caustics.scene import load_scene

    stem, suffix = Path(scene).stem, "png" if picture else "exr"
    outputs = output or [Path(f"{stem}.{suffix}" if frames is None else f"{stem}.%04d.{suffix}")]
    measured: Path | None = None
    if profile:
        check_can_profile(picture, frames)
        outputs, measured = profile_path(outputs, scene)
        check_writable(measured)
    check_outputs(outputs, frames, "--frames")
    loaded = load_scene(scene)
    if picture and loaded.camera is None:
        raise InputError(f"--picture: {scene} has no camera; {CAMERA_EXPECTED}")

    def paths(index: int) -> list[Path]:
        return [frame_path(path, index) if is_sequence(path) else path for path in outputs]

    for path in paths(0):
        check_writable(path)

    start_warp()
    if measured is not None:
        profile_frame(loaded, measured, method=method, device=device, threads=threads, time=time, fps=fps)
        if not outputs:
            return
    from warp_caustics.plan import LONG_WORK
    from warp_caustics.renderer import Renderer, make_renderer

    saver = PictureSaver() if picture else MapSaver()
    interrupt = Interrupt()
    milliseconds = []
    with interrupt.watch():
        with report.working("building kernels"):
            renderer = make_renderer(loaded, method=method, device=device, threads=threads)
        for index in report.progress(frames or 1):
            at = time + index / fps
            if isinstance(renderer, Renderer) and frames is None and renderer.plan.samples > LONG_WORK:
                with report.share() as tell:
                    renderer.render(at, tell)
            else:
                renderer.render(at)
            result = renderer.result()
            save = saver.of(result)
            for path in paths(index):
                with interrupt.hold():
                    save(path)
            milliseconds.append(1e3 * result.seconds)
    report.print_result(
        result, files=outputs, frames=frames, milliseconds=milliseconds, compile_seconds=renderer.compile_seconds
    )


@app.command
def plan(
    scene: str,
    /,
    *,
    method: str | None = None,
    device: str | None = None,
    threads: PositiveInt | None = None,
) -> None:
    """Say which passes and buffers a scene needs, which are left out and why, and the bytes.

    Parameters
    ----------
    scene
        A bundled scene's name, or a TOML file.
    method
        The technique; that of the scene when left out.
    device
        `cpu`, `cuda:0`, ...; the best one present when left out.
    threads
        Threads on the CPU.
    """
    from warp_caustics.scene import load_scene

    loaded = load_scene(scene)
    start_warp()
    from warp_caustics.plan import make_plan

    print(make_plan(loaded, method=method, device=device, threads=threads))


@app.command
def compare(
    scene: str,
    /,
    *,
    methods: str | None = None,
    device: str | None = None,
    threads: PositiveInt | None = None,
    time: Time = 0.0,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
) -> None:
    """Measure error against run time and memory: every method at several settings, beside a converged reference.

    Parameters
    ----------
    scene
        A bundled scene's name, or a TOML file.
    methods
        Names with commas between them; all that can be compared when left out.
    device
        `cpu`, `cuda:0`, ...; the best one present when left out.
    threads
        Threads on the CPU.
    time
        Seconds on the water's clock.
    output
        A folder for `compare.json` and `compare.png`, made if need be; only the table is shown when left out.
    """
    from warp_caustics.cli.compare_table import print_comparison
    from warp_caustics.comparison.record import JSON_NAME, PICTURE_NAME
    from warp_caustics.comparison.run import compare as compare_methods
    from warp_caustics.comparison.settings import chosen_methods
    from warp_caustics.files import check_folder
    from warp_caustics.scene import load_scene

    names = chosen_methods(None if methods is None else methods.split(","))
    loaded = load_scene(scene)
    if output is not None:
        check_folder(output, JSON_NAME, PICTURE_NAME)
    start_warp()
    interrupt = Interrupt()
    with interrupt.watch():
        with report.steps() as tell:
            comparison = compare_methods(loaded, names, device=device, threads=threads, time=time, tell=tell)
        print_comparison(comparison)
        if output is not None:
            with interrupt.hold():
                files = comparison.save(output)
            report.print_files(files)


@app.command
def view(
    scene: str,
    /,
    *,
    method: str | None = None,
    device: str | None = None,
    time: Time = 0.0,
    compare: Flag = False,
    screenshot: Path | None = None,
) -> None:
    """Show the receiver in 3D with the caustic map on it, and the water above it; sliders render anew.

    Parameters
    ----------
    scene
        A bundled scene's name, or a TOML file.
    method
        The technique; that of the scene when left out.
    device
        `cpu`, `cuda:0`, ...; the best one present when left out.
    time
        Seconds on the water's clock.
    compare
        Every technique's map side by side, with its time.
    screenshot
        A PNG to write instead of opening a window; needs no display.
    """
    from warp_caustics.files import check_writable
    from warp_caustics.scene import load_scene
    from warp_caustics.view import check_can_show

    if screenshot is not None:
        if screenshot.suffix.lower() != ".png":
            raise InputError(f"--screenshot: '{screenshot}' should end in .png")
        check_writable(screenshot)
    if compare and method is not None:
        raise InputError("--method: --compare shows all of them; expected one of the two")
    loaded = load_scene(scene)
    check_can_show(window=screenshot is None)
    start_warp()
    if compare:
        show_comparison(loaded, device, time, screenshot)
    elif screenshot is None:
        show_live(loaded, method, device, time)
    else:
        from warp_caustics.renderer import render as render_once
        from warp_caustics.view import view as show

        with report.working("building kernels and rendering"):
            result = render_once(loaded, method=method, device=device, time=time)
        show(result, screenshot=screenshot)
    if screenshot is not None:
        report.print_files([screenshot])


@app.command
def info() -> None:
    """Say versions, devices, methods, bundled scenes, and whether pictures can be drawn here."""
    start_warp()
    report.print_info()


def check_outputs(outputs: list[Path], frames: int | None, option: str) -> None:
    """Refuse names that would not do, before any work; frames are None where the option that makes them is missing."""
    from warp_caustics.files import is_sequence

    for path in outputs:
        if path.suffix.lower() not in SUFFIXES:
            raise InputError(f"--output: '{path}' should end in {' or '.join(SUFFIXES)}")
        if frames is None and is_sequence(path):
            raise InputError(f"--output: '{path}' has a frame number, and {option} was not given")
        if frames is not None and frames > 1 and not is_sequence(path):
            raise InputError(
                f"--output: {frames} frames need a frame number in the file's name, such as "
                f"'{path.stem}.%04d{path.suffix}', and '{path}' has none"
            )
