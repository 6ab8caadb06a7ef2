"""What `warp-caustics compare` prints: settings, fitted slopes and published figures, as tables."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from warp_caustics.cli.report import console

if TYPE_CHECKING:
    from warp_caustics.comparison.record import Comparison, Errors, Row

FRONT_MARK, TIE_MARK = "*", "~"
MEGA, MEBI = 1e6, 2**20
MANY_PERCENT, FEW_PERCENT = 100.0, 0.1  # no digit after the point from the first on, powers of ten below the second
FEW_MILLISECONDS = 10.0  # below, decimals tell
ERROR_COLUMNS = ("error %", "scaled %", "eye %", "eye scaled %", "bias %", "energy %", "p99.9 %")
SPEED_COLUMNS = ("ms", "spread", "build s", "MiB", "M/s")
NEEDED_WIDTH = 140  # a narrower terminal folds the lines; cut columns would be lost


def print_comparison(comparison: Comparison) -> None:
    """Print a comparison."""
    out = console()
    where, reference = comparison.machine, comparison.reference
    columns, rows = comparison.resolution
    out.print(
        f"{escape(comparison.scene_name)}, {columns} x {rows} pixels, on {escape(where.device)} "
        f"({escape(where.device_name)}), {where.threads} thread(s)"
    )
    came = "from the cache" if reference.cached else "made now"
    out.print(
        f"reference: error bar {reference.error_bar:.2e}, {reference.samples:,.0f} samples per pixel, "
        f"{reference.seconds:.1f} s, {came}"
    )
    if comparison.screen is not None:
        screen = comparison.screen
        out.print(
            f"in {screen.resolution[0]} x {screen.resolution[1]} eye pixels: error bar {screen.error_bar:.2e}, "
            f"{screen.pixels:,} of them see the map alone and are judged"
        )
    out.print()
    width, out.width = out.width, max(out.width, NEEDED_WIDTH)
    out.print(_settings(comparison))
    out.width = width
    out.print(
        "error: in the map's pixels, eye: in the camera's, scaled: after the best single factor; over the mean of the "
        "reference; ms: median of warm frames, spread: their quartiles' distance over it; "
        "M/s: million cells or photons a second"
    )
    out.print(
        f"{FRONT_MARK} on the front of error against time   {TIE_MARK} under the reference's error bar: "
        "a tie with all others there"
    )
    if comparison.flip_skipped:
        out.print(f"no HDR-FLIP: {escape(comparison.flip_skipped)}")
    _print_refused(out, comparison)
    if comparison.slopes:
        out.print("\nerror against samples per pixel, error ~ count ^ slope")
        out.print(_slopes(comparison))
    out.print("\npublished by others, on their hardware, not measured here")
    out.print(_published(comparison))


def _settings(comparison: Comparison) -> Table:
    table = Table(box=None, padding=(0, 1, 0, 0), header_style="dim")
    table.add_column("")
    table.add_column("setting", no_wrap=True)
    flip = () if comparison.flip_skipped else ("FLIP",)
    for name in (*ERROR_COLUMNS, *flip, *SPEED_COLUMNS):
        table.add_column(name, justify="right", no_wrap=True)
    series = None
    for row in comparison.rows:
        if row.status == "refused":
            continue
        if series is not None and row.series != series:
            table.add_section()
        series = row.series
        style = "bold" if row.on_front else None
        table.add_row(*_cells(row, with_flip=not comparison.flip_skipped), style=style)
    return table


def _cells(row: Row, *, with_flip: bool) -> list[str]:
    errors, eye, speed = row.errors, row.screen_errors, row.speed
    judged = errors or eye
    assert speed is not None
    front, tie = row.on_front, row.at_error_bar
    if errors is None:  # judged in eye pixels alone
        front, tie = row.on_screen_front, row.at_screen_error_bar
    marks = (FRONT_MARK if front else " ") + (TIE_MARK if tie else " ")
    flip = [_shown(errors, "flip", "{:.4f}".format)] if with_flip else []
    spread = (speed.milliseconds_high - speed.milliseconds_low) / speed.milliseconds
    decimals = 1 if speed.milliseconds >= FEW_MILLISECONDS else 3
    return [
        marks, escape(row.label), _shown(errors, "relative_l2", _percent),
        _shown(errors, "scaled_l2", _percent), _shown(eye, "relative_l2", _percent),
        _shown(eye, "scaled_l2", _percent), _shown(judged, "bias", _signed),
        _shown(judged, "energy_error", _signed), _shown(judged, "percentile_999", _percent),
        *flip, f"{speed.milliseconds:,.{decimals}f}", f"{spread:.0%}",
        f"{speed.compile_seconds:.2f}", f"{speed.bytes / MEBI:,.1f}", f"{speed.samples_per_second / MEGA:,.1f}",
    ]  # fmt: skip


def _shown(errors: Errors | None, name: str, how: Callable[[float], str]) -> str:
    """Show one of the errors, or a dash where there is none."""
    value = None if errors is None else getattr(errors, name)
    return "-" if value is None else how(value)


def _print_refused(out: Console, comparison: Comparison) -> None:
    """Say why settings are not in the table, those with the same reason together."""
    reasons: dict[str, list[str]] = {}
    for row in comparison.rows:
        if row.reason is not None:
            reasons.setdefault(f"{row.status}: {row.reason}", []).append(row.label)
    for reason, labels in reasons.items():
        out.print(f"{escape(', '.join(labels))}: {escape(reason)}", style="yellow")


def _slopes(comparison: Comparison) -> Table:
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
    for name in ("series", "slope", "fitted over", "expected"):
        table.add_column(name)
    for slope in comparison.slopes:
        if slope.slope is None or slope.lowest is None or slope.highest is None:
            fitted = ("-", "fewer than two errors clear of the error bar")
        else:
            fitted = (f"{slope.slope:+.2f}", f"{slope.lowest:g} to {slope.highest:g}")
        table.add_row(escape(slope.series), *fitted, escape(slope.expected) or "-")
    return table


def _published(comparison: Comparison) -> Table:
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
    for name in ("system", "hardware", "work"):
        table.add_column(name)
    table.add_column("theirs, ms", justify="right")
    table.add_column("gather here, ms", justify="right")
    for one in comparison.published:
        low, high = one.milliseconds_low, one.milliseconds_high
        theirs = f"{low:g}" if low == high else f"{low:g} to {high:g}"
        ours = "-" if one.ours_milliseconds is None else f"{one.ours_milliseconds:.2f}"
        table.add_row(one.system, one.hardware, one.work, theirs, ours)
    return table


def _percent(share: float) -> str:
    percent = 100.0 * share
    return f"{percent:,.0f}" if percent >= MANY_PERCENT else f"{percent:.3g}"


def _signed(share: float) -> str:
    percent = 100.0 * share
    return "0" if not percent else f"{percent:+.2f}" if abs(percent) >= FEW_PERCENT else f"{percent:+.0e}"
