"""Light held and error of the comparators, by slope and depth: ``python bench/comparators.py [-o DIR]``.

Ways to turn landed cells of the surface into brightness, all with 1 cell a pixel, on the pool's waves scaled to an rms
slope, over a floor at a depth. Each figure is the median of some frames against their converged references: light in
the map over that in the reference's, and RMSE over mean. A mean would say nothing of the area ratio: one triangle that
a fold leaves thin, and that covers a pixel's middle, can hold more light than the rest of the map. Writes a table and
JSON.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import numpy as np
import warp as wp
from scenery import rough_pool

import warp_caustics as wc
from warp_caustics.metrics import relative_l2

RESULTS = Path("out/comparators")
SLOPES = (0.05, 0.1, 0.15)
DEPTHS = (1.0, 2.0, 4.0)  # [m]
SUN = (0.4, 0.2, -1.0)  # the pool's own
INTERVAL = 1.7  # between frames [s]: no wave of the pool repeats itself over them
CUSTOMARY_CLAMP = 5.0

COMPARATORS: dict[str, tuple[str, dict[str, Any]]] = {
    "area_ratio": ("area_ratio", {}),
    "latest": ("area_ratio", {"overlap": "latest"}),
    "clamp 5": ("area_ratio", {"clamp": CUSTOMARY_CLAMP}),
    "cross": ("area_ratio", {"area": "cross"}),
    "cross latest": ("area_ratio", {"area": "cross", "overlap": "latest"}),
    "photon cell": ("photon", {"photons_per_pixel": 1.0}),
    "differential ellipse": ("differential", {"footprint": "ellipse"}),
    "differential parallelogram": ("differential", {"footprint": "parallelogram"}),
    "beam unrefined": ("beam", {"refine": False}),
    "beam": ("beam", {}),
}
"""By name, the method and its settings; those of the area ratio differ from its defaults by what the name says."""

ABOUT = """# The comparators

Light that a map holds over the light of the reference's map, and relative L2 error against the reference, at one sample
a pixel: medians of {frames} frames of {resolution} x {resolution} pixels of a plane under waves like the pool's, scaled
to an rms slope. `area_ratio` is the published form: `|dFdx| |dFdy|`, added. Its mean has no bound where sheets fold, so
that no one factor tells how much light it invents: another frame or resolution gives another. Made by `python
bench/comparators.py`.

"""
HEADING = "| rms slope | depth | " + " | ".join(COMPARATORS) + " |\n|" + "---|" * (2 + len(COMPARATORS))


def measure(slope: float, depth: float, resolution: int, frames: int) -> dict[str, Any]:
    """Measure every comparator on one water."""
    size = (resolution, resolution)
    times = [INTERVAL * frame for frame in range(frames)]
    truths = [wc.make_reference(rough_pool(slope, depth, size, SUN), time=time).caustic_map for time in times]
    measured: dict[str, Any] = {"slope": slope, "depth": depth}
    for name, (method, settings) in COMPARATORS.items():
        renderer = wc.Renderer(rough_pool(slope, depth, size, SUN, **{method: settings}), method)
        held, errors = [], []
        for time, truth in zip(times, truths, strict=True):
            renderer.render(time)
            caustic_map = renderer.result().caustic_map
            held.append(float(np.sum(caustic_map, dtype=np.float64) / np.sum(truth)))
            errors.append(relative_l2(caustic_map, truth))
        measured[name] = {"held": held, "error": errors}
    return measured


def rows(resolution: int, frames: int) -> Iterator[dict[str, Any]]:
    """Measure every water."""
    for slope in SLOPES:
        for depth in DEPTHS:
            yield measure(slope, depth, resolution, frames)


def line(row: dict[str, Any]) -> str:
    """Give a row of the table: light held, and error."""
    cells = [f"{np.median(row[name]['held']):.3f}, {np.median(row[name]['error']):.1%}" for name in COMPARATORS]
    return f"| {row['slope']:g} | {row['depth']:g} m | " + " | ".join(cells) + " |"


def main() -> None:
    """Print the table and write it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, default=RESULTS, help="folder of the results")
    parser.add_argument("--resolution", type=int, default=128, help="pixels along the map's sides")
    parser.add_argument("--frames", type=int, default=5, help="frames of each water")
    chosen = parser.parse_args()
    wp.config.log_level = wp.LOG_WARNING
    begin = ABOUT.format(resolution=chosen.resolution, frames=chosen.frames) + HEADING
    print(begin)
    measured = []
    for row in rows(chosen.resolution, chosen.frames):
        measured.append(row)
        print(line(row), flush=True)
    chosen.output.mkdir(parents=True, exist_ok=True)
    (chosen.output / "comparators.md").write_text("\n".join([begin, *map(line, measured)]) + "\n")


if __name__ == "__main__":
    main()
