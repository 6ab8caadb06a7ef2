"""What each feature of a scene adds when it alone is on: ``python bench/leaving_out.py [-o DIR] [--resolution N]``.

Each row is a scene with one feature on, beside the same scene without it: launches and compiled kernels of a frame,
bytes that are allocated, lines of generated code, and the milliseconds of the fastest of some warm frames, the one
that was disturbed least. Writes a table and JSON.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import warp as wp
from scenery import METHODS, save_box, wave

import warp_caustics as wc
from oracle.cases import sunlight
from warp_caustics.dispersion import DispersedPlan

FRAMES = 7
THREADS = 2
RESULTS = Path("out/leaving_out")

STEEP = [wave(0.8 / 6.0, 6.0, 0.0)]
EYE = {"position": (2.0, -1.5, 3.2), "target": (2.0, 2.0, 0.0), "vertical_fov": 50.0, "resolution": (320, 180)}

LOOKS = "camera, screen map asked for"
"""The feature whose time includes a look through the camera, which renders its own G-buffer after the frame."""

Table = dict[str, Any]


@dataclass(frozen=True)
class Cost:
    """What a scene takes by a method; ``refused`` says why it takes nothing."""

    launches: int = 0
    kernels: int = 0
    bytes: int = 0
    lines: int = 0
    milliseconds: float = 0.0
    refused: str = ""


def bare(resolution: int) -> Table:
    """Give the bundled pool, without its camera."""
    table = wc.load_scene("pool").model_dump(exclude_unset=True, exclude_none=True)
    del table["camera"]
    table["map"]["resolution"] = (resolution, resolution)
    return table


def features(folder: Path) -> Mapping[str, tuple[Table, Table]]:
    """Give each feature as what to change of the bare scene: without it, and with it."""
    low = {"sun": {"direction": sunlight(75.0)}}
    calm, box = {"water": {"level": 2.0, "waves": STEEP, "self_shadow": False}}, save_box(folder)
    shading = {"water": {"level": 2.0, "waves": STEEP}}
    return {
        "colour of the sun": ({}, {"sun": {"direction": (0.4, 0.2, -1.0), "irradiance": (1.0, 0.9, 0.8)}}),
        "Fresnel": ({}, {"medium": {"ior": 1.333, "fresnel": True}}),
        "absorption": ({}, {"medium": {"ior": 1.333, "absorption": 0.1}}),
        "absorption by colour": ({}, {"medium": {"ior": 1.333, "absorption": (0.3, 0.1, 0.02)}}),
        "dispersion": ({}, {"medium": {"ior": (1.331, 1.334, 1.339), "dispersion": "traced"}}),
        "terrain": ({}, {"receiver": {"terrain": {"base": 0.0, "slope": (0.05, 0.02)}}}),
        "terrain with a shore": ({}, {"receiver": {"terrain": {"base": 0.0, "slope": (0.7, 0.1)}}}),
        "objects": ({}, {"receiver": {"plane": 0.0, "objects": [{"mesh": box, "translate": (2.0, 2.0, 0.0)}]}}),
        "self-shadow": ({**low, **calm}, {**low, **shading}),
        "sun's disk": ({}, {"sun": {"direction": (0.4, 0.2, -1.0), "angular_diameter": 0.53}}),
        "camera, map alone": ({}, {"camera": EYE}),
        LOOKS: ({}, {"camera": EYE}),
    }


def measure(table: Table, method: str, look: bool = False) -> Cost:
    """Plan, build and time a scene, and the look of its camera at the map if asked to."""
    try:
        renderer = wc.Renderer(wc.Scene(**table), method, None, THREADS)
    except wc.InputError as error:
        return Cost(refused=str(error).splitlines()[-1].strip())
    milliseconds = []
    for _ in range(1 + FRAMES):
        start = perf_counter()
        renderer.render()
        if look:
            _ = renderer.result().screen_map
        wp.synchronize()
        milliseconds.append(1e3 * (perf_counter() - start))
    plan = renderer.plan
    if not renderer.result().caustic_map.any():
        raise RuntimeError("a map without light is not worth timing")
    one = plan.plans[0] if isinstance(plan, DispersedPlan) else plan  # channels share their kernels
    lines = sum(code_lines(step.kernel) for step in one.program.passes)
    return Cost(plan.launches, len(plan.kernels), plan.bytes, lines, min(milliseconds[1:]))


def code_lines(kernel: Callable[[], wp.Kernel]) -> int:
    """Count the lines that Warp generated for a kernel's module, from its cache."""
    sources = Path(wp.config.kernel_cache_dir).glob(f"wp_{kernel().module.name}_*/*.cpp")
    newest = max(sources, key=lambda path: path.stat().st_mtime)
    return len(newest.read_text().splitlines())


def rows(resolution: int) -> list[dict[str, Any]]:
    """Measure every feature by every method."""
    made: list[dict[str, Any]] = []
    with TemporaryDirectory() as folder:
        for name, (off, on) in features(Path(folder)).items():
            for method in METHODS:
                without = measure({**bare(resolution), **off}, method)
                with_it = measure({**bare(resolution), **on}, method, look=name == LOOKS)
                made.append({"feature": name, "method": method, "without": asdict(without), "with": asdict(with_it)})
                print(line(made[-1]), flush=True)
    return made


HEADING = "| feature | method | launches | kernels | bytes | lines of code | ms |\n|---|---|---|---|---|---|---|"


def line(row: Mapping[str, Any]) -> str:
    """Give a row of the table: the scene without the feature, and what it adds."""
    off, on = row["without"], row["with"]
    if on["refused"]:
        return f"| {row['feature']} | {row['method']} | refused: {on['refused']} | | | | |"
    cells = [f"{off[k]:,} {on[k] - off[k]:+,}" for k in ("launches", "kernels", "bytes", "lines")]
    time = f"{off['milliseconds']:.1f} {on['milliseconds'] - off['milliseconds']:+.1f}"
    return f"| {row['feature']} | {row['method']} | " + " | ".join([*cells, time]) + " |"


def main() -> None:
    """Print the table and write it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, default=RESULTS, help="folder of the results")
    parser.add_argument("--resolution", type=int, default=256, help="pixels along the map's sides")
    chosen = parser.parse_args()
    wp.config.log_level = wp.LOG_WARNING
    print(HEADING)
    measured = rows(chosen.resolution)
    chosen.output.mkdir(parents=True, exist_ok=True)
    about = {"resolution": chosen.resolution, "threads": THREADS, "warp": wp.config.version, "rows": measured}
    (chosen.output / "leaving_out.json").write_text(json.dumps(about, indent=1) + "\n")
    (chosen.output / "leaving_out.md").write_text("\n".join([HEADING, *map(line, measured)]) + "\n")


if __name__ == "__main__":
    main()
