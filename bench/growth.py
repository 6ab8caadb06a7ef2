"""Cost as work grows: ``python bench/growth.py [-o DIR] [--device D] [--small]``.

Each series lets one thing grow and keeps the rest: pixels, photons, cascades, triangles, the gather's window, channels.
Seconds are the fastest of some warm frames, bytes the plan's, errors relative L2 against the reference where one is
quick to make. The slope of a series is that of seconds over its own work, both in logarithms: 1 is linear. Prints a
table, and writes it with a JSON and a picture.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import matplotlib as mpl
import numpy as np
import pyvista as pv
import warp as wp
from scenes import SCENES

import warp_caustics as wc
from warp_caustics.metrics import relative_l2

mpl.use("Agg")
import matplotlib.pyplot as plt

RESULTS = Path("out/growth")
FRAMES, ENOUGH_SECONDS = 3, 10.0
"""Warm frames of each row at most, and seconds after which no other is begun."""
ERROR_PIXELS = 512
"""Maps up to this side are compared with a reference, which takes seconds to make; larger ones would take minutes."""
LINEAR = 1.05
"""Slope up to which a series counts as linear: larger arrays leave the caches, which is the memory's own."""

MAP = 256
"""Side of the map where it does not grow."""
GROUND = "ground"


@dataclass(frozen=True)
class Case:
    """A scene of a series, and how much work it is in the series' own unit."""

    series: str
    unit: str
    work: int
    scene: wc.Scene


@dataclass(frozen=True)
class Row:
    """A case as measured."""

    series: str
    unit: str
    work: int
    seconds: float
    bytes: int
    error: float | None


def pool(pixels: int, method: Mapping[str, Any], **tables: Any) -> wc.Scene:
    """Give the pool by a method, on a square map."""
    table = SCENES["pool"].at_resolution(pixels, pixels).model_dump(exclude_unset=True, exclude_none=True)
    return wc.Scene(**{**table, "method": method, **tables})


def resolutions(sizes: tuple[int, ...]) -> Iterator[Case]:
    """Let the map grow, by each method that follows light into it."""
    methods: dict[str, Mapping[str, Any]] = {
        "beam": {"name": "beam"},
        "photon": {"name": "photon"},
        "gather N = 7": {"name": "gather", "gather": {"n": 7, "m": 6}},
        "differential": {"name": "differential", "differential": {"footprint": "parallelogram"}},
    }
    for label, method in methods.items():
        for size in sizes:
            yield Case(f"pixels, {label}", "pixels", size * size, pool(size, method))


def photons(counts: tuple[int, ...]) -> Iterator[Case]:
    """Let photons grow on one map."""
    for count in counts:
        method = {"name": "photon", "photon": {"photons_per_pixel": float(count)}}
        yield Case("photons", "photons", count * MAP * MAP, pool(MAP, method))


def cascades(counts: tuple[int, ...]) -> Iterator[Case]:
    """Let cascades grow before one camera."""
    camera = {**SCENES["pool"].model_dump(exclude_unset=True)["camera"], "resolution": (640, 360)}
    for count in counts:
        method = {"name": "cascaded", "cascaded": {"count": count, "resolution": 512}}
        yield Case("cascades", "cascades", count, pool(MAP, method, camera=camera))


def triangles(sides: tuple[int, ...], folder: Path) -> Iterator[Case]:
    """Let the triangles of the ground grow under one water."""
    for side in sides:
        x = np.linspace(-3.0, 7.0, side)
        grid = pv.StructuredGrid(*np.meshgrid(x, x, [0.0], indexing="ij"))
        grid.points[:, 2] = 0.1 * np.sin(3.0 * grid.points[:, 0]) * np.sin(2.0 * grid.points[:, 1])
        path = folder / f"{GROUND}{side}.ply"
        grid.extract_surface(algorithm="dataset_surface").triangulate().save(path)
        scene = pool(MAP, {"name": "photon"}, receiver={"mesh": str(path)})
        yield Case("triangles", "triangles", 2 * (side - 1) ** 2, scene)


def windows(widths: tuple[int, ...]) -> Iterator[Case]:
    """Let the gather's window grow: as published, and by default."""
    for form in ("two_pass", "auto"):
        for n in widths:
            method = {"name": "gather", "gather": {"n": n, "m": n - 1, "form": form}}
            yield Case(f"N, gather {form}", "samples of a window", n * n, pool(MAP, method))


def channels() -> Iterator[Case]:
    """Carry one channel, or three."""
    for method in ("beam", "photon", "gather"):
        for count, absorption in ((1, 0.2), (3, (0.3, 0.1, 0.05))):
            medium = {"ior": 1.333, "absorption": absorption}
            yield Case(f"channels, {method}", "channels", count, pool(MAP, {"name": method}, medium=medium))


def cases(small: bool, device: str | None, folder: Path) -> Iterator[Case]:
    """Name all cases; ``small`` ones take seconds and say nothing."""
    if small:
        sizes: tuple[int, ...] = (32, 64)
    elif device is not None and device != "cpu":
        sizes = (256, 512, 1024, 2048, 4096, 8192)
    else:
        sizes = (256, 512, 1024, 2048, 4096)
    yield from resolutions(sizes)
    yield from photons((1, 4) if small else (1, 4, 16, 64, 256))
    yield from cascades((1, 2) if small else (1, 2, 4, 8))
    yield from triangles((8, 16) if small else (23, 71, 224, 708, 2237), folder)
    yield from windows((3, 5) if small else (7, 15, 31, 63))
    yield from channels()


def measure(case: Case, device: str | None, references: dict[str, np.ndarray]) -> Row:
    """Time a case, and compare it where that is quick."""
    renderer = wc.Renderer(case.scene, device=device)
    result = renderer.result()
    best, spent = float("inf"), 0.0
    for _ in range(FRAMES):
        start = perf_counter()
        renderer.render()
        wp.synchronize()
        best = min(best, perf_counter() - start)
        spent += perf_counter() - start
        if spent > ENOUGH_SECONDS:
            break
    error = None
    if result.caustic_map is not None and case.series != "triangles" and max(result.caustic_map.shape) <= ERROR_PIXELS:
        key = repr((case.scene.map, case.scene.medium))
        if key not in references:
            references[key] = np.asarray(wc.render(case.scene, method="reference", device=device).caustic_map)
        error = relative_l2(result.caustic_map, references[key])
    return Row(case.series, case.unit, case.work, best, renderer.plan.bytes, error)


def slope(rows: list[Row]) -> float:
    """Fit seconds over work, both in logarithms."""
    work, seconds = ([getattr(row, name) for row in rows] for name in ("work", "seconds"))
    return float(np.polyfit(np.log(work), np.log(seconds), 1)[0])


def by_series(rows: list[Row]) -> dict[str, list[Row]]:
    """Sort rows into their series, in order."""
    found: dict[str, list[Row]] = {}
    for row in rows:
        found.setdefault(row.series, []).append(row)
    return found


def as_text(rows: list[Row]) -> str:
    """Write the table in Markdown."""
    lines = ["| series | work | ms | ns each | MB | error | slope |", "|---|---|---|---|---|---|---|"]
    for name, series in by_series(rows).items():
        for row in series:
            error = "" if row.error is None else f"{100.0 * row.error:.2g} %"
            last = f"{slope(series):.2f}" if row is series[-1] else ""
            each = f"{1e9 * row.seconds / row.work:,.3g}"
            work = f"{row.work:,} {row.unit}"
            lines.append(
                f"| {name} | {work} | {1e3 * row.seconds:.1f} | {each} | {row.bytes / 1e6:.1f} | {error} | {last} |"
            )
    return "\n".join(lines)


def draw(rows: list[Row], path: Path) -> None:
    """Draw seconds and bytes over work, a line a series; the grey line is linear."""
    figure, axes = plt.subplots(1, 2, figsize=(15.0, 6.5), layout="constrained")
    for axis, of, label in ((axes[0], lambda r: r.seconds, "seconds a frame"), (axes[1], lambda r: r.bytes, "bytes")):
        for name, series in by_series(rows).items():
            start = series[0]
            grown = [row.work / start.work for row in series]
            text = f"{name}: {slope(series):.2f}" if axis is axes[0] else name
            axis.loglog(grown, [of(row) for row in series], "o-", markersize=4, label=text)
        reach = np.array(axis.get_xlim())
        axis.loglog(reach, reach * axis.get_ylim()[0], color="0.7", linestyle="--", label="linear")
        axis.set(xlabel="work, in that of the first of its series", ylabel=label)
        axis.legend(fontsize=8)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def main() -> None:
    """Measure all series."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=RESULTS)
    parser.add_argument("--device")
    parser.add_argument("--small", action="store_true", help="a trial of the script itself")
    asked = parser.parse_args()
    asked.output.mkdir(parents=True, exist_ok=True)
    rows: list[Row] = []
    references: dict[str, np.ndarray] = {}
    with tempfile.TemporaryDirectory() as folder:
        for case in cases(asked.small, asked.device, Path(folder)):
            rows.append(measure(case, asked.device, references))
            print(f"{case.series:<24}{case.work:>14,}{1e3 * rows[-1].seconds:>12.1f} ms", flush=True)
    (asked.output / "growth.md").write_text(as_text(rows) + "\n")
    (asked.output / "growth.json").write_text(json.dumps([asdict(row) for row in rows], indent=1) + "\n")
    draw(rows, asked.output / "growth.png")
    print(as_text(rows))
    worse = {name: slope(series) for name, series in by_series(rows).items() if slope(series) > LINEAR}
    print(f"worse than linear: {worse or 'none'}")


if __name__ == "__main__":
    main()
