"""The pictures of ``bench/ratio.py``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TypeAlias

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from fronts import Point, Ratio

Panel: TypeAlias = tuple[str, Sequence[Point], Sequence[Ratio], float]
"""Name of a ratio, all points, the ratios, and the reference's error bar."""

SCORE_LIMIT = 4.0  # of the colours of differences, in expected errors
BRIGHT = 99.5  # percentile that is drawn white
LOWEST = 0.1  # of errors that are drawn, in error bars of the reference: below them an error says nothing


def draw_curves(path: Path, panels: Sequence[Panel], floors: Sequence[float | None], title: str) -> None:
    """Draw error against time for each panel, and below it the time for the same error."""
    figure, axes = plt.subplots(2, len(panels), figsize=(6.5 * len(panels), 9.0), squeeze=False, layout="constrained")
    for column, ((name, points, found, error_bar), floor) in enumerate(zip(panels, floors, strict=True)):
        top, bottom = axes[:, column]
        for curve in dict.fromkeys(p.curve for p in points):
            line = [p for p in points if p.curve == curve]
            style = "o--" if curve.endswith("extrapolated") else "o-"
            top.loglog([p.seconds for p in line], [p.error for p in line], style, label=curve, markersize=4)
            for p in (p for p in line if p.error > LOWEST * error_bar):
                top.annotate(p.setting, (p.seconds, p.error), textcoords="offset points", xytext=(3, 3), fontsize=7)
        top.axhline(error_bar, color="0.6", linestyle="--", label="the reference's error bar")
        if floor:
            top.axhline(floor, color="tab:red", linestyle=":", label="floor of ptracer")
        top.set(xlabel="seconds a frame", ylabel="relative L2 error", title=title)
        top.set_ylim(bottom=LOWEST * error_bar)
        top.legend(fontsize=8)
        bottom.loglog([r.error for r in found], [r.value for r in found], "o-")
        for r in found:
            bottom.annotate(f"{r.bound}{r.value:.3g}", (r.error, r.value), textcoords="offset points", xytext=(4, 4))
        bottom.axhline(1.0, color="0.6", linestyle="--")
        bottom.set(xlabel="relative L2 error", ylabel=f"seconds, {name}", title="time for the same error")
    _save(figure, path)


def draw_maps(path: Path, ours: np.ndarray, theirs: np.ndarray, scores: np.ndarray) -> None:
    """Draw the reference, Mitsuba's map and their difference in expected errors, row 0 below."""
    figure, axes = plt.subplots(1, 3, figsize=(17.0, 5.4), layout="constrained")
    white = float(np.percentile(ours, BRIGHT))
    for axis, (title, values) in zip(axes, (("reference", ours), ("Mitsuba ptracer", theirs)), strict=False):
        picture = axis.imshow(values, origin="lower", vmin=0.0, vmax=white, cmap="gray")
        axis.set_title(title)
        figure.colorbar(picture, ax=axis, shrink=0.8)
    picture = axes[2].imshow(scores, origin="lower", vmin=-SCORE_LIMIT, vmax=SCORE_LIMIT, cmap="coolwarm")
    axes[2].set_title(f"difference over expected error, mean square {np.mean(scores**2):.3f}")
    figure.colorbar(picture, ax=axes[2], shrink=0.8)
    _save(figure, path)


def _save(figure: plt.Figure, path: Path) -> None:
    figure.savefig(path, dpi=110)
    plt.close(figure)
