"""`render --profile`: which file it writes, and the tables that it prints."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.markup import escape
from rich.table import Table

from warp_caustics.cli.interrupt import Interrupt
from warp_caustics.cli.report import console, print_files, working
from warp_caustics.errors import InputError

if TYPE_CHECKING:
    from warp_caustics.profiling import Memory, Profile, ProfileNode
    from warp_caustics.scene import Scene

SUFFIX = ".profile.json"
"""Of the file beside the first output."""

TABLE_WIDTH = 120
"""Columns of text that the table of passes takes, with room for long names."""

AGREEMENT = 0.05
"""Share of the frame's time by which its passes may miss it."""

FEW = 10.0
"""Below, three decimals tell."""

MOST_NAMED = 20
"""Buffers that are named, the largest; the others are a line."""


def profile_path(outputs: list[Path], scene: str) -> tuple[list[Path], Path]:
    """Split what `-o` names into maps and the profile's JSON, which else stands beside the first map.

    Raises
    ------
    InputError
        Two of them end in .json.
    """
    named = [path for path in outputs if path.suffix.lower() == ".json"]
    maps = [path for path in outputs if path not in named]
    if len(named) > 1:
        raise InputError(f"--output: '{named[1]}' is a second profile, after '{named[0]}'; expected one .json at most")
    beside = maps[0] if maps else Path(f"{Path(scene).stem}.exr")
    return maps, named[0] if named else beside.with_suffix(SUFFIX)


def check_can_profile(picture: bool, frames: int | None) -> None:
    """Refuse what a profile does not go with.

    Raises
    ------
    InputError
        A picture, or a sequence.
    """
    if picture:
        raise InputError(
            "--profile: it measures the passes of the map, and a picture's come after; leave out --picture"
        )
    if frames is not None:
        raise InputError("--profile: it measures frames of its own, from --time on; leave out --frames")


def profile_frame(scene: Scene, path: Path, **chosen: Any) -> None:
    """Profile a frame, print what was found, and write it to a path; what is chosen is as for `wc.profile`."""
    from warp_caustics.profiling import profile

    interrupt = Interrupt()
    with interrupt.watch():
        with working("profiling"):
            profiled = profile(scene, **chosen)
        print_profile(profiled)
        with interrupt.hold():
            profiled.save(path)
    print_files([path])


def print_profile(profile: Profile) -> None:
    """Print the tree of passes, the limits and the memory."""
    out = console()
    # A narrow terminal folds a line rather than cut its figures.
    out.width = max(out.width, TABLE_WIDTH)
    out.print(_passes(profile.frame))
    plain, traced = profile.untraced_milliseconds, profile.frame.milliseconds
    out.print(
        f"frame without tracing {plain:,.3f} ms; its passes, traced, {traced:,.3f} ms, {profile.difference:+.1%}; "
        f"the fastest of {profile.frames} each"
    )
    if abs(profile.difference) > AGREEMENT:
        out.print(f"warning: they differ by more than {AGREEMENT:.0%}; was the machine busy?", style="yellow")
    out.print(_each(profile))
    for limit in profile.limits:
        where = f"{limit.threads} thread(s)" if profile.device == "cpu" else escape(profile.device)
        out.print(
            f"limits of {where}, measured: copies {1e-9 * limit.bandwidth:,.1f} GB/s, "
            f"single precision {1e-9 * limit.operations:,.1f} Gflop/s"
        )
    out.print(_buffers(profile.memory))
    memory = profile.memory
    pool = "" if memory.pool_peak is None else f", memory pool {_mebibytes(memory.pool_peak)} at most"
    out.print(
        f"peak {_mebibytes(memory.peak)} allocated{pool}; {_mebibytes(memory.planned)} planned; "
        f"{memory.frame_allocations} allocations in the measured frames"
    )


def _each(profile: Profile) -> str:
    """Say what a cell, a photon or a pixel takes."""
    frame, samples = profile.frame, profile.samples
    moved = (frame.bytes_read + frame.bytes_written) / samples
    operations = "operations not known" if frame.operations is None else f"{frame.operations / samples:,.0f} operations"
    return f"{samples:,} samples, each {1e6 * frame.milliseconds / samples:,.1f} ns, {moved:,.1f} bytes, {operations}"


def _passes(frame: ProfileNode) -> Table:
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
    table.add_column("pass", no_wrap=True)
    for name in ("ms", "share", "launches", "read MB", "written MB", "Mflop", "GB/s", "floor"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("by", no_wrap=True)
    for depth, node in _walk(frame):
        table.add_row(
            "  " * depth + escape(node.name),
            _figure(node.milliseconds),
            f"{node.milliseconds / frame.milliseconds:.1%}" if frame.milliseconds else "",
            f"{node.launches:,}",
            _figure(1e-6 * node.bytes_read),
            _figure(1e-6 * node.bytes_written),
            "not known" if node.operations is None else _figure(1e-6 * node.operations),
            _figure(1e-9 * node.bandwidth),
            f"{node.floor_share:.1%}",
            node.limit or "",
            style="bold" if node.children else None,
        )
        if len(node.lanes) > 1:
            lanes = ", ".join(map(_figure, node.lanes))
            table.add_row("  " * (depth + 1) + f"lanes: {lanes} ms", style="dim")
    return table


def _walk(node: ProfileNode, depth: int = 0) -> Iterator[tuple[int, ProfileNode]]:
    yield depth, node
    for child in node.children:
        yield from _walk(child, depth + 1)


def _buffers(memory: Memory) -> Table:
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
    table.add_column("buffer", no_wrap=True)
    table.add_column("MiB", justify="right")
    table.add_column("of")
    for buffer in memory.buffers[:MOST_NAMED]:
        shape = " x ".join(map(str, buffer.shape))
        copies = f", {buffer.copies} times" if buffer.copies > 1 else ""
        table.add_row(escape(buffer.name), f"{buffer.bytes / 2**20:,.3f}", f"{buffer.dtype} {shape}{copies}")
    others = memory.buffers[MOST_NAMED:]
    if others:
        table.add_row(f"{len(others)} others", f"{sum(buffer.bytes for buffer in others) / 2**20:,.3f}", "")
    return table


def _figure(value: float) -> str:
    """Write a number with the decimals that tell."""
    return f"{value:,.3f}" if value < FEW else f"{value:,.1f}"


def _mebibytes(count: int) -> str:
    return f"{count / 2**20:,.3f} MiB"
