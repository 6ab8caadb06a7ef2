"""Time for the same error, side by side in one run: ``beam`` against ``photon``, and against Mitsuba's ``ptracer``.

``python bench/ratio.py [--quick] [--threads N] [-o DIR]`` measures the pool at 512 x 512, prints the tables and writes
``ratio.json``, ``ratio.png`` and ``ratio_maps.png``. Errors are relative L2 (RMSE over mean) against the converged
reference. ``photon`` is compared on the pool as it is; Mitsuba on a copy whose water reflects (``fresnel = true``),
since Mitsuba's does, with a reference of its own. What is timed is a warm frame of ours, in which the waves are worked
out again, and the tracing of Mitsuba's, whose mesh and search tree are built before: that favours Mitsuba. Its curve is
measured as far as its batches go, and from there extrapolated to the floor that its rays' offset sets. All use the same
count of threads. Mitsuba is left out where it is not installed (``pip install '.[peer]'``).
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import platform
import statistics
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import numpy as np
import warp as wp
from fronts import Point, Ratio, ratios
from ratio_pictures import Panel, draw_curves, draw_maps

import warp_caustics as wc
from warp_caustics.device import resolve_threads
from warp_caustics.metrics import relative_l2
from warp_caustics.reference import Reference, make_reference

FRAMES = 5  # warm ones, of which the median counts
PATIENCE = 3.0  # seconds after which no more of them are rendered
ERRORS = 9  # at which a ratio is printed
BEAM_SAMPLES = tuple(2.0**k for k in range(-4, 5))
PHOTONS = (0.25, 1.0, 4.0, 16.0, 64.0, 256.0)
FOOTPRINTS = ("point", "pixel", "cell")
PEER_SAMPLES = 4  # particles a pixel in a batch
VARIANTS = ("scalar_rgb", "llvm_ad_rgb")  # the second needs LLVM 19, and ends the process with an older one

FULL = {"resolution": 512, "batches": 64}
QUICK = {"resolution": 64, "batches": 16}


@dataclass(frozen=True)
class Run:
    """Pixels along a side, batches of Mitsuba's particles (a power of two), threads, and Mitsuba's variant."""

    resolution: int
    batches: int
    threads: int
    variant: str


def pool(resolution: int, fresnel: bool) -> dict[str, Any]:
    """Give the tables of the bundled pool at a resolution, with or without reflection."""
    table = wc.load_scene("pool").model_dump(exclude_unset=True, exclude_none=True)
    table["map"]["resolution"] = (resolution, resolution)
    table["medium"]["fresnel"] = fresnel
    return table


def measure(table: dict[str, Any], reference: Reference, label: tuple[str, str], threads: int, **method: Any) -> Point:
    """Render a setting once cold, and warm some times."""
    renderer = wc.Renderer(wc.Scene(**{**table, "method": method}), device="cpu", threads=threads)
    renderer.render(0.0)
    seconds: list[float] = []
    while len(seconds) < FRAMES and sum(seconds) < PATIENCE:
        renderer.render(0.0)
        result = renderer.result()
        seconds.append(result.seconds)
    print(f"{label[0]}, {label[1]} a pixel: {statistics.median(seconds):.3g} s", file=sys.stderr)
    spread = 0.5 * (max(seconds) - min(seconds))
    return Point(*label, relative_l2(result.caustic_map, reference.caustic_map), statistics.median(seconds), spread)


def beam_points(table: dict[str, Any], reference: Reference, threads: int) -> Iterator[Point]:
    """Measure ``beam``, from coarse to fine."""
    for samples in BEAM_SAMPLES:
        settings = {"samples_per_pixel": samples}
        yield measure(table, reference, ("beam", f"{samples:g}"), threads, name="beam", beam=settings)


def photon_points(table: dict[str, Any], reference: Reference, threads: int) -> Iterator[Point]:
    """Measure ``photon`` with each footprint, from few to many."""
    for footprint in FOOTPRINTS:
        for count in PHOTONS:
            settings = {"photons_per_pixel": count, "footprint": footprint}
            label = (f"photon, {footprint}", f"{count:g}")
            yield measure(table, reference, label, threads, name="photon", photon=settings)


def trace_peer(
    table: dict[str, Any], reference: Reference, run: Run
) -> tuple[list[Point], dict[str, Any], np.ndarray, np.ndarray]:
    """Measure Mitsuba's tracer: the mean of more and more batches of one run, and the floor that it tends to."""
    import drjit
    import mitsuba

    from peer import Peer, z_scores

    drjit.set_thread_count(run.threads)
    peer = Peer(table, variant=run.variant)
    peer.trace(PEER_SAMPLES, 2, seed=run.batches)  # warm: pages, and code where a variant compiles it
    found = peer.trace(PEER_SAMPLES, run.batches)
    # Batches are alike, so the median of one stands for each.
    batch, spread = float(np.median(found.seconds)), 0.5 * float(np.ptp(found.seconds))
    points = []
    for count in (2**k for k in range(run.batches.bit_length())):
        error = relative_l2(found.batches[:count].mean(axis=0), reference.caustic_map)
        points.append(Point("Mitsuba ptracer", f"{count * PEER_SAMPLES:g}", error, count * batch, count * spread))
    truth = reference.caustic_map
    gradient = np.hypot(*np.gradient(truth, peer.setting.pixel[1], peer.setting.pixel[0]))
    scores = z_scores(peer, found, truth, reference.error_bar)
    noise = float(np.sqrt(found.variance_ratio / truth.mean()))
    facts = {
        "version": mitsuba.__version__,
        "variant": run.variant,
        "build_seconds": peer.build_seconds,
        "floor": found.floor(truth),
        "floor_seen_from": noise * float(np.sqrt(2.0 / np.sqrt(truth.size))),  # where its estimate's own noise ends
        "floor_expected": float(peer.landing_error * np.sqrt(np.mean(gradient**2)) / truth.mean()),
        "noise": noise,
        "landing_error_m": peer.landing_error,
        "mean_square_score": float(np.mean(scores**2)),
        "energy_difference": float(found.irradiance.mean() / truth.mean() - 1.0),
        "energy_noise": float(np.sqrt(found.variance_ratio / truth.sum())),
    }
    return points, facts, found.irradiance, scores


def extrapolated(measured: list[Point], noise: float, floor: float) -> list[Point]:
    """Continue Mitsuba's curve to where its noise is its floor: noise falls with the root of the count of particles."""
    last, points, times = measured[-1], [], 1
    while floor > 0.0 and noise / np.sqrt(times) > floor:
        times *= 4
        error = float(np.hypot(noise / np.sqrt(times), floor))
        setting = f"{times * float(last.setting):g}"
        points.append(Point("ptracer, extrapolated", setting, error, times * last.seconds, times * last.spread))
    return points


def trusted(points: list[Point], reference: Reference) -> list[Point]:
    """Leave out what is nearer to the reference than the reference is to the truth."""
    return [point for point in points if point.error > reference.error_bar]


def print_points(title: str, points: list[Point], reference: Reference) -> None:
    """Print a table of what was measured, as Markdown."""
    print(f"\n{title}; the reference's error bar is {reference.error_bar:.1e}, and * marks what is below it\n")
    print("| method | samples a pixel | error | seconds | ± |\n|---|---|---|---|---|")
    for p in points:
        note = " *" if p.error <= reference.error_bar else ""
        print(f"| {p.curve} | {p.setting} | {p.error:.2e}{note} | {p.seconds:.4g} | {p.spread:.2g} |")


def print_ratios(title: str, found: list[Ratio]) -> None:
    """Print a table of times for the same error, as Markdown."""
    print(f"\n{title}: seconds for the same error\n")
    print("| error | other | beam | ratio |\n|---|---|---|---|")
    for r in found:
        print(f"| {r.error:.2e} | {r.seconds:.4g} | {r.beam_seconds:.4g} | {r.bound} {r.value:.3g} |")


def compare_photon(run: Run) -> tuple[Panel, dict[str, Any]]:
    """Measure ``beam`` and ``photon`` on the pool as it is."""
    table = pool(run.resolution, fresnel=False)
    reference = make_reference(wc.Scene(**table), threads=run.threads)
    points = list(beam_points(table, reference, run.threads))
    beam = trusted(points, reference)
    points += photon_points(table, reference, run.threads)
    curves = [trusted([p for p in points if p.curve.endswith(name)], reference) for name in FOOTPRINTS]
    found = ratios(curves, beam, ERRORS)
    print_points("The pool", points, reference)
    print_ratios("The best photon against beam", found)
    return ("photon / beam", points, found, reference.error_bar), as_data(points, found, reference)


def compare_peer(run: Run, pictures: Path) -> tuple[Panel, dict[str, Any]]:
    """Measure ``beam`` and Mitsuba's tracer on the pool with reflection, and draw both maps."""
    table = pool(run.resolution, fresnel=True)
    reference = make_reference(wc.Scene(**table), threads=run.threads)
    points = list(beam_points(table, reference, run.threads))
    beam = trusted(points, reference)
    peer, facts, irradiance, scores = trace_peer(table, reference, run)
    floor = facts["floor"] if facts["floor"] > facts["floor_seen_from"] else facts["floor_expected"]
    further = extrapolated(peer, facts["noise"], floor)
    points += peer + further
    found = ratios([trusted(peer + further, reference)], beam, ERRORS)
    print_points("The pool with reflection", points, reference)
    print("\nMitsuba")
    for name, value in facts.items():
        print(f"  {name}: {value:.3g}" if isinstance(value, float) else f"  {name}: {value}")
    print_ratios(f"Mitsuba's ptracer (extrapolated below {peer[-1].error:.2e}) against beam", found)
    draw_maps(pictures / "ratio_maps.png", reference.caustic_map, irradiance, scores)
    return ("ptracer / beam", points, found, reference.error_bar), {**as_data(points, found, reference), **facts}


def as_data(points: list[Point], found: list[Ratio], reference: Reference) -> dict[str, Any]:
    """Give a comparison as what JSON can hold."""
    return {
        "error_bar": reference.error_bar,
        "points": [asdict(p) for p in points],
        "ratios": [{**asdict(r), "ratio": r.value} for r in found],
    }


def read_arguments() -> tuple[Run, Path]:
    """Read the command line: the run, and the folder of what it writes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a small map, to see that it runs")
    parser.add_argument("--threads", type=int, help="of every method; all cores if not given")
    parser.add_argument("--variant", choices=VARIANTS, default=VARIANTS[0], help="of Mitsuba")
    parser.add_argument("-o", "--out", type=Path, default=Path("out/ratio"), help="folder of what is written")
    asked = parser.parse_args()
    asked.out.mkdir(parents=True, exist_ok=True)
    size = QUICK if asked.quick else FULL
    return Run(**size, threads=resolve_threads(asked.threads, "cpu"), variant=asked.variant), asked.out


def main() -> None:
    """Measure, print, write."""
    wp.config.log_level = wp.LOG_WARNING  # the tables alone
    run, out = read_arguments()
    report: dict[str, Any] = {
        "scene": "pool",
        "run": asdict(run),
        "warp_caustics": wc.__version__,
        "device": "cpu",
        "cores": os.cpu_count(),
        "machine": platform.platform(),
    }
    panel, report["photon"] = compare_photon(run)
    panels = [panel]
    if importlib.util.find_spec("mitsuba") is None:
        report["mitsuba"] = "left out: it is not installed (pip install '.[peer]')"
        print(f"\nMitsuba is {report['mitsuba']}")
    else:
        panel, report["mitsuba"] = compare_peer(run, out)
        panels.append(panel)
    floors = [None, report["mitsuba"]["floor"]] if len(panels) > 1 else [None]
    draw_curves(out / "ratio.png", panels, floors, f"pool, {run.resolution} x {run.resolution}, {run.threads} threads")
    (out / "ratio.json").write_text(json.dumps(report, indent=1) + "\n")
    print(f"\nWritten to {out}/: " + ", ".join(sorted(p.name for p in out.glob("ratio*"))))


if __name__ == "__main__":
    main()
