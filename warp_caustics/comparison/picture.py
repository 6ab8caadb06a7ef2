"""The picture of a comparison: error against time per frame, log-log, with the front and the reference's error bar."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.text import Annotation
    from matplotlib.transforms import Bbox

    from warp_caustics.comparison.record import Comparison, Errors, Row

INCHES = (12.0, 8.0)
DPI = 120
COLOURS = ("#0b5fa5", "#4fb0e8", "#b3261e", "#e8894f", "#8a6d1d", "#8e63b8", "#2a7f4f", "#555555", "#c2568e")
"""Of the series in their order; neighbours differ in lightness, too."""

MARKERS = "os^Dv"
"""Of the series in their order: the first of them while the colours last, then the next, so that no two look alike."""

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
Look = tuple[str, str]  # colour and marker


def draw(comparison: Comparison) -> Figure:
    """Draw a comparison.

    Returns
    -------
    Figure
        Of matplotlib, with a canvas of its own: no window and no global state.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    panels = _panels(comparison)
    figure = Figure(figsize=(INCHES[0], INCHES[1] * len(panels)), dpi=DPI, layout="tight")
    FigureCanvasAgg(figure)
    names = list(dict.fromkeys(row.series for row in comparison.rows if row.status == "measured"))
    looks = {
        name: (COLOURS[number % len(COLOURS)], MARKERS[number // len(COLOURS) % len(MARKERS)])
        for number, name in enumerate(names)
    }
    column = figure.subplots(len(panels), squeeze=False)[:, 0]
    drawn = [_draw_panel(axes, panel, comparison, looks) for axes, panel in zip(column, panels, strict=True)]
    figure.draw_without_rendering()  # lays the axes out, so that labels can be placed in pixels
    for axes, panel, caption in drawn:
        _place_labels(axes, panel, looks, caption)
    return figure


@dataclass(frozen=True)
class Panel:
    """One pair of axes: rows with an error of one kind.

    Attributes
    ----------
    rows : list of Row
        Those that have the error.
    points : list of (float, float)
        Milliseconds and error of each, as drawn.
    best : list of bool
        Which of them are on the front.
    bar : float
        The reference's error bar, as drawn.
    error_bar : float
        As it is.
    heading : str
        What the error is taken over.
    """

    rows: list[Row]
    points: list[tuple[float, float]]
    best: list[bool]
    bar: float
    error_bar: float
    heading: str


def _panels(comparison: Comparison) -> list[Panel]:
    """Maps in plan view, and what the camera sees where there is one."""
    columns, rows = comparison.resolution
    panels = []
    in_plan = [(row, row.errors, row.on_front) for row in comparison.rows]
    panels.append(_panel(in_plan, comparison.reference.error_bar, f"{columns} x {rows} pixels"))
    if comparison.screen is not None:
        columns, rows = comparison.screen.resolution
        seen = [(row, row.screen_errors, row.on_screen_front) for row in comparison.rows]
        panels.append(_panel(seen, comparison.screen.error_bar, f"{columns} x {rows} eye pixels"))
    return panels


def _panel(found: list[tuple[Row, Errors | None, bool]], error_bar: float, heading: str) -> Panel:
    bar = max(error_bar, LEAST_BAR)
    shown = [
        (row, (row.speed.milliseconds, max(errors.relative_l2, BELOW_THE_BAR * bar)), best)
        for row, errors, best in found
        if errors is not None and row.speed is not None and math.isfinite(errors.relative_l2)
    ]
    rows, points, best = ([one[i] for one in shown] for i in range(3))
    return Panel(rows, points, best, bar, error_bar, heading)  # type: ignore[arg-type]  # by column


def _draw_panel(
    axes: Axes, panel: Panel, comparison: Comparison, looks: Mapping[str, Look]
) -> tuple[Axes, Panel, Annotation]:
    _scale(axes, panel.points, panel.bar)
    axes.axhspan(axes.get_ylim()[0], panel.bar, color=BAR_COLOUR, zorder=0)
    said = f"error bar of the reference, {panel.error_bar:.1e}: errors in here are ties"
    caption = axes.annotate(
        said, (1.0, 0.0), (-6, 5),
        xycoords="axes fraction", textcoords="offset points", ha="right", va="bottom", fontsize=LABEL_SIZE,
    )  # fmt: skip
    front = sorted(point for point, best in zip(panel.points, panel.best, strict=True) if best)
    if front:
        axes.plot(*zip(*front, strict=True), color=FRONT_COLOUR, lw=5, alpha=0.16, zorder=1, label="front")
    for name in dict.fromkeys(row.series for row in panel.rows):
        points = [point for row, point in zip(panel.rows, panel.points, strict=True) if row.series == name]
        colour, marker = looks[name]
        axes.plot(*zip(*points, strict=True), "-", marker=marker, color=colour, lw=1.0, ms=5, zorder=2, label=name)
    if front:
        axes.plot(*zip(*front, strict=True), "o", ms=10, mfc="none", mec=FRONT_COLOUR, mew=1.3, zorder=3)
    _describe(axes, comparison, panel.heading)
    return axes, panel, caption


def _scale(axes: Axes, points: list[tuple[float, float]], bar: float) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    times, errors = [time for time, _ in points], [*(error for _, error in points), BELOW_THE_BAR * bar]
    if times:
        axes.set_xlim(min(times) / ROOM, max(times) * ROOM)
        axes.set_ylim(min(errors) / ROOM, max(errors) * ROOM)


def _describe(axes: Axes, comparison: Comparison, heading: str) -> None:
    where = comparison.machine
    threads = f", {where.threads} thread(s)" if where.device == "cpu" else ""
    axes.set_title(
        f"{comparison.scene_name}, {heading}: error against time per frame\n"
        f"{where.device_name}{threads}; rings: on the front; figures: samples per pixel, or window N",
        fontsize=11, parse_math=False,
    )  # fmt: skip
    axes.set_xlabel("warm frame, median [ms]")
    axes.set_ylabel("relative L2 error (RMSE over mean)")
    axes.grid(True, which="major", color="#e6e8eb", lw=0.7, zorder=0)
    axes.set_axisbelow(True)
    if axes.lines:
        axes.legend(fontsize=9, loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)


def _place_labels(axes: Axes, panel: Panel, looks: Mapping[str, Look], caption: Annotation) -> None:
    """Put each label at the nearest free place beside its point: none over another label, a point or the caption."""
    from matplotlib.patheffects import withStroke

    canvas: Any = axes.figure.canvas  # of Agg, whose renderer measures text
    renderer = canvas.get_renderer()
    scale = DPI / POINTS_PER_INCH
    pixels = axes.transData.transform(panel.points)
    frame = _box(axes.get_window_extent(renderer))
    half = MARKER * scale
    taken: list[Box] = [(x - half, y - half, x + half, y + half) for x, y in pixels]
    taken.append(_box(caption.get_window_extent(renderer)))
    for row, (x, y) in zip(panel.rows, pixels, strict=True):
        short = row.label if row.series == row.method else row.label.removeprefix(f"{row.method} ")
        text = axes.annotate(
            short, (x, y), (0.0, 0.0), xycoords="figure pixels", textcoords="offset points", fontsize=LABEL_SIZE,
            color=looks[row.series][0], zorder=4, path_effects=[withStroke(linewidth=2.5, foreground="white")],
        )  # fmt: skip
        extent = text.get_window_extent(renderer)
        size = extent.width, extent.height
        offset, box = _free_place((x, y), size, taken, frame, scale)
        taken.append(box)
        text.set_position((offset[0] / scale, offset[1] / scale))
        if math.hypot(*offset) > LEADER_FROM * scale + max(size):
            axes.annotate(
                "", (x, y), (box[0] + size[0] / 2, box[1] + size[1] / 2), xycoords="figure pixels",
                arrowprops={"arrowstyle": "-", "color": looks[row.series][0], "lw": 0.5, "alpha": 0.6},
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
