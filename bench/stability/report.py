"""The sweeps' rows as JSON, as a Markdown table, and as pictures."""

from __future__ import annotations

import json
import platform
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np
import warp as wp

import warp_caustics as wc
from stability.row import Row

COLUMNS = (
    "what",
    "value",
    "method",
    "what came out",
    "error",
    "of the truth",
    "rounding",
    "light",
    "unaccounted",
    "least",
    "ms",
    "limit",
)
FLOOR = 1e-9
"""Errors below this are drawn here: a logarithm has no zero."""

DECADE = 10.0
"""Range of values past which their axis is logarithmic; others are spaced evenly."""

COLOURS = {"beam": "#1b6ca8", "photon": "#d1495b", "gather": "#2e8b57"}


def write(name: str, rows: Sequence[Row], folder: Path) -> None:
    """Write ``NAME.json``, ``NAME.md`` and ``NAME.png``."""
    folder.mkdir(parents=True, exist_ok=True)
    about = {
        "sweep": name,
        "machine": platform.processor() or platform.machine(),
        "warp": wp.config.version,
        "numpy": np.__version__,
        "warp_caustics": wc.__version__,
        "rows": [asdict(row) for row in rows],
    }
    (folder / f"{name}.json").write_text(json.dumps(about, indent=1) + "\n")
    (folder / f"{name}.md").write_text(table(rows))
    draw(name, rows, folder / f"{name}.png")


def table(rows: Sequence[Row]) -> str:
    """Give the rows as a Markdown table."""
    lines = ["| " + " | ".join(COLUMNS) + " |", "|---" * len(COLUMNS) + "|"]
    for row in rows:
        truth = row.truth_error if row.error is not None else None
        numbers = [_number(v) for v in (row.error, truth, row.rounding, row.light, row.unaccounted, row.least)]
        cells = [row.what, row.value, row.method, ("" if row.ok else "**WRONG** ") + row.result, *numbers]
        lines.append("| " + " | ".join([*cells, f"{1e3 * row.seconds:.3g}", row.limit]) + " |")
    return "\n".join(lines) + "\n"


def draw(name: str, rows: Sequence[Row], path: Path) -> None:
    """Draw each thing that goes to an extreme in a panel: error (full) and rounding (dashed) against the value."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    drawn = [row for row in rows if row.error is not None or row.rounding is not None or row.light is not None]
    panels = list(dict.fromkeys(row.what for row in drawn))
    if not panels:
        return
    columns = min(3, len(panels))
    figure, axes = pyplot.subplots(
        -(-len(panels) // columns), columns, squeeze=False, layout="constrained",
        figsize=(4.6 * columns, 3.4 * -(-len(panels) // columns)),
    )  # fmt: skip
    for axis, what in zip(axes.flat, panels, strict=False):
        _panel(axis, what, [row for row in drawn if row.what == what])
    for axis in axes.flat[len(panels) :]:
        axis.set_axis_off()
    figure.suptitle(f"{name}: full lines, error against float64; dashed, what float32 alone adds; dots, energy")
    figure.savefig(path, dpi=100)
    pyplot.close(figure)


def _panel(axis: object, what: str, rows: Sequence[Row]) -> None:
    """Draw one panel."""
    values = list(dict.fromkeys(row.value for row in rows))
    at = [row.at for row in rows if row.at is not None and row.at > 0.0]
    numeric = len(at) == len(rows) and max(at) > DECADE * min(at)
    methods = list(dict.fromkeys(row.method for row in rows))
    for method in methods:
        own = [row for row in rows if row.method == method]
        x = [row.at if numeric else values.index(row.value) for row in own]
        if len(values) == 1:
            x = [methods.index(method)]
        colour = COLOURS.get(method.split(",")[0].strip())
        for field, style in (("error", "o-"), ("rounding", "s--"), ("light", ".:")):
            y = [np.nan if (v := getattr(row, field)) is None else max(abs(v), FLOOR) for row in own]
            if np.isfinite(y).any():
                label = method if field == "error" or not any(row.error is not None for row in own) else None
                axis.plot(x, y, style, color=colour, label=label, markersize=4, linewidth=1.2)  # type: ignore[attr-defined]
    if numeric:
        axis.set_xscale("log")  # type: ignore[attr-defined]
    elif len(values) == 1:
        axis.set_xticks(range(len(methods)), methods, rotation=20, fontsize=7)  # type: ignore[attr-defined]
    else:
        axis.set_xticks(range(len(values)), [v[:24] for v in values], rotation=20, fontsize=7)  # type: ignore[attr-defined]
    axis.set_yscale("log")  # type: ignore[attr-defined]
    axis.set_title(what, fontsize=9)  # type: ignore[attr-defined]
    axis.grid(alpha=0.3)  # type: ignore[attr-defined]
    axis.legend(fontsize=7)  # type: ignore[attr-defined]


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.1e}"
