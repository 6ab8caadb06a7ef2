"""What the commands print: short tables on standard output."""

from __future__ import annotations

import platform
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
    track,
)
from rich.table import Table

from warp_caustics import __version__
from warp_caustics.errors import RenderError

if TYPE_CHECKING:
    from warp_caustics.energy import Energy
    from warp_caustics.result import Result

# These stand beside the sum of the ledger, not in it.
BESIDE = ("dry", "over_lit", "invented")
CHANNELS = ("red", "green", "blue")
FEW_MILLISECONDS = 10.0  # below, decimals tell
# A pipe has no width of its own: wide enough that no path is folded there.
PIPE_WIDTH = 4096
# Packages that decide what works here.
PACKAGES = ("warp-lang", "numpy", "pyvista", "vtk", "OpenEXR", "pydantic")


def console() -> Console:
    """Return a console on the standard output of this moment."""
    out = Console(highlight=False)
    return out if out.is_terminal else Console(highlight=False, width=PIPE_WIDTH)


def progress(count: int) -> Iterable[int]:
    """Count up from 0; with a bar on the error stream if there are several steps and a terminal to show it."""
    bar = Console(stderr=True)
    if count == 1 or not bar.is_terminal:
        return range(count)
    return track(range(count), description="rendering", console=bar, transient=True)


@contextmanager
def share() -> Iterator[Callable[[float], None] | None]:
    """Give what is told the share of a long frame that is done: a bar, or None where no terminal would show it."""
    bar = Console(stderr=True)
    if not bar.is_terminal:
        yield None
        return
    columns = (TextColumn("rendering"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn(), TimeElapsedColumn())
    with Progress(*columns, console=bar, transient=True) as progress_bar:
        task = progress_bar.add_task("", total=1.0)
        yield lambda done: progress_bar.update(task, completed=done)


def working(what: str) -> AbstractContextManager[object]:
    """Say what is being waited for while a block runs, where there is a terminal to show it."""
    terminal = Console(stderr=True)
    return terminal.status(what) if terminal.is_terminal else nullcontext()


@contextmanager
def steps() -> Iterator[Callable[[int, int, str], None]]:
    """Give what is told of each step its number, how many there are and its name: a bar, where there is a terminal.

    The bar is drawn at each step and at no other time: a thread that drew it meanwhile would disturb what is timed.
    """
    bar = Console(stderr=True)
    if not bar.is_terminal:
        yield lambda number, count, what: None
        return
    columns = (BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TextColumn("{task.description}"))
    with Progress(*columns, console=bar, transient=True, auto_refresh=False) as progress_bar:
        task = progress_bar.add_task("", total=None)

        def tell(number: int, count: int, what: str) -> None:
            progress_bar.update(task, completed=number, total=count, description=escape(what), refresh=True)

        yield tell


def print_files(paths: Sequence[Path]) -> None:
    """Say where files were written."""
    table = _grid()
    _add_files(table, paths)
    console().print(table)


def print_result(
    result: Result,
    *,
    files: Sequence[Path],
    frames: int | None,
    milliseconds: Sequence[float],
    compile_seconds: float,
) -> None:
    """Say what was rendered: files, method, device, time, bytes, energy, warnings.

    Parameters
    ----------
    result
        The last frame; the energy is its own.
    files
        Where it was written; patterns with a frame number for a sequence.
    frames
        Frames of the sequence, or None for a single map.
    milliseconds
        Of each frame, without compiling.
    compile_seconds
        Spent on building or loading kernels.
    """
    table = _grid()
    _add_files(table, files)
    if frames is not None:
        table.add_row("frames", str(frames))
    table.add_row("method", result.method)
    table.add_row("device", escape(result.device))
    mean = sum(milliseconds) / len(milliseconds)
    decimals = 1 if mean >= FEW_MILLISECONDS else 3
    table.add_row("time", f"{mean:,.{decimals}f} ms per frame, and {compile_seconds:.2f} s for kernels before")
    if result.error_bar is not None:
        table.add_row("error bar", f"{result.error_bar:.1e} relative L2")
    table.add_row("memory", f"{result.plan.bytes:,} bytes ({_mebibytes(result.plan.bytes)})")
    out = console()
    out.print(table)
    if result.energy is not None:
        out.print(_energy_table(result.energy))
    _print_warnings(out, result.warnings)


def print_rows(rows: Sequence[tuple[str, str]], warnings: Sequence[str]) -> None:
    """Print what is named, a line each, and warnings after it."""
    table, out = _grid(), console()
    for name, text in rows:
        table.add_row(name, escape(text))
    out.print(table)
    _print_warnings(out, warnings)


def print_info() -> None:
    """Say versions, devices, methods, bundled scenes, and whether pictures can be drawn here."""
    import warp as wp

    from warp_caustics.scene import METHODS, bundled_scenes
    from warp_caustics.view import check_can_show

    table = _grid()
    table.add_row("warp_caustics", __version__)
    table.add_row("Python", f"{platform.python_version()} on {platform.system()} {platform.machine()}")
    for name in PACKAGES:
        table.add_row(name, _version(name))
    for device in wp.get_devices():
        memory = f", {_mebibytes(device.total_memory)}" if device.is_cuda else ""
        table.add_row(f"device {device.alias}", escape(device.name) + memory)
    table.add_row("methods", ", ".join(METHODS))
    table.add_row("scenes", ", ".join(bundled_scenes()))
    try:
        check_can_show(window=False)
        table.add_row("pictures in 3D", "yes, without a display")
    except RenderError as error:
        table.add_row("pictures in 3D", escape(f"no: {error}"))
    console().print(table)


def _energy_table(energy: Energy) -> Table:
    """Lay out the energy ledger by channel [W], with the sum of its parts beside what was emitted."""
    values = {name: np.atleast_1d(np.asarray(value, dtype=np.float64)) for name, value in energy.items()}
    emitted = values.pop("emitted")
    beside = {name: values.pop(name) for name in BESIDE}
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
    table.add_column("energy [W]")
    for channel in CHANNELS if emitted.size > 1 else ("",):
        table.add_column(channel, justify="right")
    table.add_column("share", justify="right")
    table.add_row("emitted", *_watts(emitted), "")
    for name, value in values.items():
        if value.any():
            table.add_row(f"  {name}", *_watts(value), f"{_share(value, emitted):.3%}")
    table.add_row("sum", *_watts(np.sum(list(values.values()), axis=0)), f"off by {energy.unaccounted:.1e}")
    for name, value in beside.items():
        if value.any():
            table.add_row(f"beside: {name}", *_watts(value), f"{_share(value, emitted):.3%}")
    return table


def _print_warnings(out: Console, warnings: Sequence[str]) -> None:
    for warning in warnings:
        out.print(f"warning: {escape(warning)}", style="yellow")


def _grid() -> Table:
    table = Table.grid(padding=(0, 2, 0, 0))
    table.add_column(style="dim")
    table.add_column(overflow="fold")
    return table


def _add_files(table: Table, paths: Sequence[Path]) -> None:
    for path in paths:
        table.add_row("file", escape(str(path.absolute())))


def _watts(value: np.ndarray) -> list[str]:
    return [f"{watts:.6g}" for watts in value]


def _share(value: np.ndarray, emitted: np.ndarray) -> float:
    total = float(emitted.sum())
    return float(value.sum()) / total if total else 0.0


def _mebibytes(count: int) -> str:
    return f"{count / 2**20:,.1f} MiB"


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"
