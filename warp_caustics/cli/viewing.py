"""What `view` shows: a live window, or all methods side by side."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from warp_caustics.cli import report

if TYPE_CHECKING:
    from warp_caustics.scene import Scene


def show_live(scene: Scene, method: str | None, device: str | None, time: float) -> None:
    """Open the window whose sliders render anew, and wait for its end."""
    from warp_caustics.view import show_plotter
    from warp_caustics.view_live import LiveView

    show_plotter(lambda: LiveView(scene, method, device, time, off_screen=False).plotter, None)


def show_comparison(scene: Scene, device: str | None, time: float, screenshot: Path | None) -> None:
    """Show every method's map side by side, in a window or as a picture."""
    from warp_caustics.scene import METHODS
    from warp_caustics.view import show_plotter
    from warp_caustics.view_compare import make_comparison, render_all

    with report.steps() as tell:
        shown = render_all(scene, METHODS, device, time, tell)
    show_plotter(lambda: make_comparison(scene, shown, off_screen=screenshot is not None), screenshot)
