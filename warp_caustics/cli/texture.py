"""The command `texture`: seamless, looping caustic textures."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from cyclopts.types import PositiveFloat, PositiveInt

from warp_caustics.cli import report
from warp_caustics.cli.commands import SUFFIXES, Flag, Outputs, Time, app, check_outputs
from warp_caustics.cli.interrupt import Interrupt
from warp_caustics.cli.quiet import start_warp
from warp_caustics.errors import InputError

if TYPE_CHECKING:
    from warp_caustics.flip_book import FlipBook
    from warp_caustics.texture import Texture


@app.command
def texture(
    scene: str,
    /,
    *,
    tile: Flag = False,
    loop: PositiveFloat | None = None,
    fps: PositiveFloat | None = None,
    round: Flag = False,
    method: str | None = None,
    device: str | None = None,
    threads: PositiveInt | None = None,
    time: Time = 0.0,
    white: PositiveFloat | None = None,
    atlas: Path | None = None,
    output: Outputs | None = None,
) -> None:
    """Render a caustic texture: a seamless tile, a loop, or both.

    Parameters
    ----------
    scene
        A bundled scene's name, or a TOML file.
    tile
        The map repeats without a seam: its size is the period, and what does not fit it is refused.
    loop
        Seconds after which the water is as it was; its frequencies are rounded to that, and it is said how far.
    fps
        Frames per second of the loop; 24 when left out.
    round
        With --tile: move what does not fit to the nearest that does, and say how far.
    method
        The technique; that of the scene when left out.
    device
        `cpu`, `cuda:0`, ...; the best one present when left out.
    threads
        Threads on the CPU.
    time
        Seconds on the water's clock, of the first frame.
    white
        Value that is white in a PNG; by default the 99.9th percentile of the first frame.
    atlas
        An EXR or PNG with all frames of the loop, left to right and top to bottom, with sides that are powers of two.
    output
        OUT.%04d.exr or OUT.%04d.png for a loop, OUT.exr or OUT.png for one frame: bare pixels, no chart; may be given
        more than once. SCENE.%04d.exr or SCENE.exr when left out without an atlas.
    """
    from warp_caustics.files import check_writable, frame_path, is_sequence
    from warp_caustics.scene import load_scene
    from warp_caustics.texture import DEFAULT_FPS, make_texture

    _check_together(tile=tile, loop=loop, fps=fps, rounding=round, atlas=atlas)
    made = make_texture(
        load_scene(scene), tile=tile, loop=loop, fps=fps or DEFAULT_FPS, rounding=round, method=method, start=time
    )
    stem = Path(scene).stem
    named = Path(f"{stem}.exr" if loop is None else f"{stem}.%04d.exr")
    outputs = output or ([] if atlas else [named])
    check_outputs(outputs, None if loop is None else made.frames, "--loop")
    files = [*outputs, atlas] if atlas else outputs
    if white is not None and not any(path.suffix.lower() == ".png" for path in files):
        raise InputError("--white: no PNG is written, and an EXR holds the values themselves")
    book = None if atlas is None else _flip_book(made)

    def paths(index: int) -> list[Path]:
        return [frame_path(path, index) if is_sequence(path) else path for path in outputs]

    for path in [*paths(0), atlas] if atlas else paths(0):
        check_writable(path)

    start_warp()
    from warp_caustics.renderer import make_renderer
    from warp_caustics.tone import value_limits

    interrupt, milliseconds = Interrupt(), []
    with interrupt.watch():
        with report.working("building kernels"):
            renderer = make_renderer(made.scene, method=method, device=device, threads=threads)
        for index, result in zip(report.progress(made.frames), made.results(renderer), strict=True):
            # One exposure for all pictures of a loop, or it would flicker.
            white = white or value_limits(result.image)[1]
            for path in paths(index):
                with interrupt.hold():
                    made.save(result, path, white)
            if book is not None:
                book.put(index, result.image)
            milliseconds.append(1e3 * result.seconds)
        if book is not None and atlas is not None and white is not None:
            with interrupt.hold():
                made.save_atlas(book, atlas, white, result.method)
    report.print_result(
        result, files=files, frames=None if loop is None else made.frames, milliseconds=milliseconds,
        compile_seconds=renderer.compile_seconds,
    )  # fmt: skip
    drawn = white if any(path.suffix.lower() == ".png" for path in files) else None
    report.print_rows(_said(made, book, drawn), made.warnings)


def _check_together(*, tile: bool, loop: float | None, fps: float | None, rounding: bool, atlas: Path | None) -> None:
    """Refuse options that would do nothing."""
    if not tile and loop is None:
        raise InputError("texture: expected --tile, --loop SECONDS, or both; `render` makes maps that do not repeat")
    if rounding and not tile:
        raise InputError("--round: it moves what does not fit a tile, and --tile was not given")
    for name, given in (("--fps", fps), ("--atlas", atlas)):
        if given is not None and loop is None:
            raise InputError(f"{name}: one frame has no use for it, and --loop was not given")
    if atlas is not None and atlas.suffix.lower() not in SUFFIXES:
        raise InputError(f"--atlas: '{atlas}' should end in {' or '.join(SUFFIXES)}")


def _flip_book(made: Texture) -> FlipBook:
    from warp_caustics.flip_book import FlipBook

    return FlipBook(made.frames, made.resolution, made.scene.channels)


def _said(made: Texture, book: FlipBook | None, white: float | None) -> list[tuple[str, str]]:
    """Say how it repeats, what was moved for it, and how its files are to be read."""
    rows = []
    if made.tile:
        width, height = made.scene.map.size
        rows.append(("tile", f"{width:g} x {height:g} m"))
    if made.loop is not None:
        rows.append(("loop", f"{made.loop:g} s, {made.frames / made.loop:g} frames per second"))
    for kind in dict.fromkeys(change.key.rpartition(".")[2] for change in made.changes):
        moved = [change for change in made.changes if change.key.endswith(f".{kind}")]
        most = max(moved, key=lambda change: change.relative)
        rows.append(("moved", f"{kind}, {len(moved)} of them, the most: {most}" if len(moved) > 1 else str(most)))
    if white is not None:
        rows.append(("PNG", f"sRGB, white at {white:.6g}"))
    if book is not None:
        columns, lines = book.grid
        height, width = book.image.shape[:2]
        rows.append(("atlas", f"{columns} x {lines} cells, {book.frames} frames, {width} x {height} pixels"))
    return rows
