"""Error of each method on the reference scenes, and the time it takes: ``python bench/accuracy.py [DEVICE]``.

The references are those of ``tests/oracle``: float64, converged, sharing no code with what is judged. Errors are
RMSE over mean; the time is a warm frame's median on a map of 64 x 64 pixels.
"""

from __future__ import annotations

import statistics
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import warp_caustics as wc
from oracle import CASES, load_reference, relative_l2

FRAMES = 5
SETTINGS: dict[str, dict[str, object]] = {
    "beam": {"name": "beam"},
    "beam, refine = false": {"name": "beam", "beam": {"refine": False}},
    "photon, 4 a pixel, cell": {"name": "photon"},
    "photon, 16 a pixel, point": {"name": "photon", "photon": {"photons_per_pixel": 16.0, "footprint": "point"}},
    "gather": {"name": "gather"},
}


def measure(name: str, method: dict[str, object], device: str | None) -> tuple[float, float] | None:
    """Error and milliseconds of a method on a case; None where it cannot."""
    case = CASES[name]
    try:
        renderer = wc.Renderer(wc.Scene(**case.scene_dict(), method=method), device=device)
    except wc.InputError:
        return None
    seconds = []
    for _ in range(FRAMES):
        renderer.render(case.time)
        result = renderer.result()
        seconds.append(result.seconds)
    error = relative_l2(result.caustic_map, load_reference(name).caustic_map)
    return float(error), 1e3 * statistics.median(seconds)


def main() -> None:
    """Print the table, as Markdown."""
    device = sys.argv[1] if len(sys.argv) > 1 else None
    print("| scene | " + " | ".join(SETTINGS) + " |")
    print("|---" * (1 + len(SETTINGS)) + "|")
    for name in CASES:
        cells = [measure(name, method, device) for method in SETTINGS.values()]
        row = ["-" if cell is None else f"{100 * cell[0]:.2g} %, {cell[1]:.0f} ms" for cell in cells]
        print(f"| {name} | " + " | ".join(row) + " |", flush=True)


if __name__ == "__main__":
    main()
