"""Error of the gather on terrains beside the splat's: ``python bench/gather_terrain.py [-o DIR] [--resolution N]``.

Errors are relative L2 (RMSE over mean) against the converged reference of each scene. ``gather`` is there by its own
window and by the published N = 7, whose share of missed light is told. With one sample a pixel and a window that is
wide enough it is ``photon`` at one a pixel with the footprint of a pixel. Times are the fastest of some warm frames.
Prints a table and writes it.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import warp as wp

import warp_caustics as wc
from warp_caustics.metrics import relative_l2

FRAMES = 5
RESULTS = Path("out/gather_terrain")
TERRAINS = ("beach", "lake")

SETTINGS: Mapping[str, Mapping[str, Any]] = {
    "gather, automatic": {"name": "gather"},
    "gather, N = 7": {"name": "gather", "gather": {"n": 7}},
    **{
        f"photon, {footprint}, {count} a pixel": {
            "name": "photon",
            "photon": {"photons_per_pixel": float(count), "footprint": footprint},
        }
        for footprint in ("pixel", "cell")
        for count in (1, 4)
    },
}
"""By the label of their rows."""

ABOUT = """# The gather on terrains

Relative L2 error against the reference, on maps of {resolution} x {resolution} pixels, and the light that a window of
N x (M + 1) samples misses, each window around its own pixel's illumination centre; beside the photons of a box of one
pixel, which are the same sum when no light is missed. Made by `python bench/gather_terrain.py`.

"""
HEADING = "| scene | setting | window | error | missed by the window | bytes | ms |\n|---|---|---|---|---|---|---|"


def row(name: str, label: str, scene: wc.Scene, reference: np.ndarray) -> str:
    """Render a setting once cold, and warm some times: one line of the table."""
    table = scene.model_dump(exclude_unset=True, exclude_none=True)
    renderer = wc.Renderer(wc.Scene(**{**table, "method": SETTINGS[label]}))
    result, seconds = renderer.result(), []
    for _ in range(FRAMES):
        start = perf_counter()
        renderer.render()
        wp.synchronize()
        seconds.append(perf_counter() - start)
    chosen, energy = renderer.plan.program.settings, result.energy
    window = f"{chosen['n']} x {chosen['m'] + 1}" if "n" in chosen else "-"
    # A share of nothing missed is rounding, of either sign.
    missed = max(0.0, float(np.sum(energy.missed_by_window) / np.sum(energy.received + energy.missed_by_window)))
    error = relative_l2(result.caustic_map, reference)
    return (
        f"| {name} | {label} | {window} | {error:.2%} | {missed:.1e} | {renderer.plan.bytes:,} | "
        f"{1e3 * min(seconds):.1f} |"
    )


def main() -> None:
    """Print the table and write it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, default=RESULTS, help="folder of the results")
    parser.add_argument("--resolution", type=int, default=256, help="pixels along the map's sides")
    chosen = parser.parse_args()
    wp.config.log_level = wp.LOG_WARNING
    lines = [ABOUT.format(resolution=chosen.resolution) + HEADING]
    print(lines[0], flush=True)
    for name in TERRAINS:
        scene = wc.load_scene(name).at_resolution(chosen.resolution, chosen.resolution)
        reference = wc.make_reference(scene).caustic_map
        for label in SETTINGS:
            lines.append(row(name, label, scene, reference))
            print(lines[-1], flush=True)
    chosen.output.mkdir(parents=True, exist_ok=True)
    (chosen.output / "gather_terrain.md").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
