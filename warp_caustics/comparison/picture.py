"""The picture of a comparison: error against time per frame, log-log, with the front and the reference's error bar."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.text import Annotation
    from matplotlib.transforms import Bbox

    from warp_caustics.comparison.record import Comparison, Row

INCHES = (12.0, 8.0)
DPI = 120
COLOURS = ("#0b5fa5", "#4fb0e8", "#b3261e", "#e8894f", "#8a6d1d", "#8e63b8", "#2a7f4f", "#555555", "#c2568e")
"""Of the series in their order; neighbours differ in lightness, too."""

BAR_COLOUR, FRONT_COLOUR = "#d9dee5", "#1b1f24"
LABEL_SIZE = 8.0
ROOM = 1.6
"""Factor by which the axes reach past the outermost points, for their labels."""

BELOW_THE_BAR = 0.5
"""Errors far below the bar are drawn at this share of it: how far below is not known, and 0 has no logarithm."""

DIRECTIONS = ((1, 1), (1, 0), (1, -1), (0, 1), (0, -1), (-1, 0), (-1, 1), (-1, -1))
DISTANCES = (8.0, 12.0, 20.0, 30.0, 42.0, 56.0)
"""Where a label may stand from its point, nearest first [points of 1/72 inch]."""

LEADER_FROM = 12.0
"""A label this far off is tied to its point by a line."""

MARKER = 5.0
"""Half the width that a point takes up, its ring included [points of 1/72 inch]."""

POINTS_PER_INCH = 72.0

LEAST_BAR = 1e-8
"""Drawn for a reference that is exact, as of flat water: below float32 there is nothing to tell."""

Box = tuple[float, float, float, float]


def draw(comparison: Comparison) -> Figure:
    """Draw a comparison.

    Returns
    -------
    Figure
        Of matplotlib, with a canvas of its own: no window and no global state.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=INCHES, dpi=DPI, layout="tight")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    bar = max(comparison.reference.error_bar, LEAST_BAR)
    shown = [row for row in comparison.rows if row.errors is not None and math.isfinite(row.errors.relative_l2)]
    points = [_point(row, bar) for row in shown]
    _scale(axes, points, bar)
    axes.axhspan(axes.get_ylim()[0], bar, color=BAR_COLOUR, zorder=0)
    said = f"error bar of the reference, {comparison.reference.error_bar:.1e}: errors in here are ties"
    caption = axes.annotate(
        said, (1.0, 0.0), (-6, 5),
        xycoords="axes fraction", textcoords="offset points", ha="right", va="bottom", fontsize=LABEL_SIZE,
    )  # fmt: skip
    front = [_point(row, bar) for row in comparison.front]
    if front:
        axes.plot(*zip(*front, strict=True), color=FRONT_COLOUR, lw=5, alpha=0.16, zorder=1, label="front")
    names = list(dict.fromkeys(row.series for row in shown))
    for number, name in enumerate(names):
        _draw_series(axes, [row for row in shown if row.series == name], bar, COLOURS[number % len(COLOURS)])
    _describe(axes, comparison)
    colours = {name: COLOURS[number % len(COLOURS)] for number, name in enumerate(names)}
    figure.draw_without_rendering()  # lays the axes out, so that labels can be placed in pixels
    _place_labels(axes, shown, points, colours, caption)
    return figure


def _point(row: Row, bar: float) -> tuple[float, float]:
    """Milliseconds and error, as drawn."""
    assert row.speed is not None and row.errors is not None
    return row.speed.milliseconds, max(row.errors.relative_l2, BELOW_THE_BAR * bar)


def _scale(axes: Axes, points: list[tuple[float, float]], bar: float) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    times, errors = [time for time, _ in points], [*(error for _, error in points), BELOW_THE_BAR * bar]
    if times:
        axes.set_xlim(min(times) / ROOM, max(times) * ROOM)
        axes.set_ylim(min(errors) / ROOM, max(errors) * ROOM)


def _draw_series(axes: Axes, rows: list[Row], bar: float, colour: str) -> None:
    points = [_point(row, bar) for row in rows]
    axes.plot(*zip(*points, strict=True), "-o", color=colour, lw=1.0, ms=5, zorder=2, label=rows[0].series)
    best = [point for row, point in zip(rows, points, strict=True) if row.on_front]
    if best:
        axes.plot(*zip(*best, strict=True), "o", ms=10, mfc="none", mec=FRONT_COLOUR, mew=1.3, zorder=3)


def _describe(axes: Axes, comparison: Comparison) -> None:
    where = comparison.machine
    columns, rows = comparison.resolution
    threads = f", {where.threads} thread(s)" if where.device == "cpu" else ""
    axes.set_title(
        f"{comparison.scene_name}, {columns} x {rows} pixels: error against time per frame\n"
        f"{where.device_name}{threads}; rings: on the front; figures: samples per pixel, or window N",
        fontsize=11, parse_math=False,
    )  # fmt: skip
    axes.set_xlabel("warm frame, median [ms]")
    axes.set_ylabel("relative L2 error (RMSE over mean)")
    axes.grid(True, which="major", color="#e6e8eb", lw=0.7, zorder=0)
    axes.set_axisbelow(True)
    if axes.lines:
        axes.legend(fontsize=9, loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)


def _place_labels(
    axes: Axes, rows: list[Row], points: list[tuple[float, float]], colours: dict[str, str], caption: Annotation
) -> None:
    """Put each label at the nearest free place beside its point: none over another label, a point or the caption."""
    from matplotlib.patheffects import withStroke

    canvas: Any = axes.figure.canvas  # of Agg, whose renderer measures text
    renderer = canvas.get_renderer()
    scale = DPI / POINTS_PER_INCH
    pixels = axes.transData.transform(points)
    frame = _box(axes.get_window_extent(renderer))
    half = MARKER * scale
    taken: list[Box] = [(x - half, y - half, x + half, y + half) for x, y in pixels]
    taken.append(_box(caption.get_window_extent(renderer)))
    for row, (x, y) in zip(rows, pixels, strict=True):
        short = row.label if row.series == row.method else row.label.removeprefix(f"{row.method} ")
        text = axes.annotate(
            short, (x, y), (0.0, 0.0), xycoords="figure pixels", textcoords="offset points", fontsize=LABEL_SIZE,
            color=colours[row.series], zorder=4, path_effects=[withStroke(linewidth=2.5, foreground="white")],
        )  # fmt: skip
        extent = text.get_window_extent(renderer)
        size = extent.width, extent.height
        offset, box = _free_place((x, y), size, taken, frame, scale)
        taken.append(box)
        text.set_position((offset[0] / scale, offset[1] / scale))
        if math.hypot(*offset) > LEADER_FROM * scale + max(size):
            axes.annotate(
                "", (x, y), (box[0] + size[0] / 2, box[1] + size[1] / 2), xycoords="figure pixels",
                arrowprops={"arrowstyle": "-", "color": colours[row.series], "lw": 0.5, "alpha": 0.6},
            )  # fmt: skip


def _free_place(
    point: tuple[float, float], size: tuple[float, float], taken: list[Box], frame: Box, scale: float
) -> tuple[tuple[float, float], Box]:
    """Give the offset of a label's lower left corner from its point, and its box [pixels]; the last tried if none."""
    width, height = size
    for distance in DISTANCES:
        for right, up in DIRECTIONS:
            reach = distance * scale
            offset = (
                right * reach if right > 0 else right * reach - (width if right < 0 else width / 2),
                up * reach - (height if up < 0 else 0.0 if up > 0 else height / 2),
            )
            left, low = point[0] + offset[0], point[1] + offset[1]
            box = (left, low, left + width, low + height)
            if _inside(box, frame) and not any(_overlap(box, other) for other in taken):
                return offset, box
    return offset, box


def _box(extent: Bbox) -> Box:
    return extent.x0, extent.y0, extent.x1, extent.y1


def _inside(box: Box, frame: Box) -> bool:
    return box[0] >= frame[0] and box[1] >= frame[1] and box[2] <= frame[2] and box[3] <= frame[3]


def _overlap(one: Box, other: Box) -> bool:
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]
