"""Every pass on one thread and on several: ``python bench/threads.py [-o FILE.json] [--threads N] [--resolution N]``.

Passes are timed within whole frames, the fastest of some. A pass whose launches stand alone in their stages takes as
long as those stages; of passes that follow one another within a lane, each takes as long as the busiest thread spends
in it. Before all, it says how idle the machine was and how much faster so many threads copy memory; after all, how much
of a frame is spent in the interpreter. Prints tables in Markdown.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from time import perf_counter
from typing import Any

import warp as wp

import warp_caustics as wc
from warp_caustics.bandwidth import copy_bandwidth
from warp_caustics.crew import Crew
from warp_caustics.picture import Painter
from warp_caustics.recording import Command, Lanes, launches

FRAMES = 7
"""Frames timed; the fastest counts, since whatever else runs can only slow one down."""

ARITHMETIC, OF_BANDWIDTH = 1.7, 0.9
"""Goals on two threads: of passes bound by arithmetic, and the share of the bandwidth's ratio of the others."""

BY_MEMORY = frozenset({"fill", "resolve", "add_lanes", "stack", "scale_to_irradiance"})
"""Passes that do little but read and write."""

LEAST_MS = 0.2
"""Below, waking a thread is a good part of a pass, and no goal is set."""

OVERHEAD_FRAMES = 300
STEPS = 40
"""Steps of a simulation that are timed as one."""

CAMERA = (640, 360)
DROP = {"position": (2.0, 2.0), "radius": 0.2, "amplitude": 0.02}
GRID = {"kind": "grid", "resolution": (512, 512), "drops": [DROP], "max_slope": 0.5}

RUNS: tuple[tuple[str, str, dict[str, Any], dict[str, Any]], ...] = (
    ("pool", "beam", {}, {}),
    ("pool", "photon", {}, {}),
    ("pool", "differential", {}, {}),
    ("pool", "area_ratio", {}, {}),
    ("pool", "area_ratio", {"overlap": "latest"}, {}),
    ("pool", "gather", {}, {}),
    ("pool", "sample", {}, {}),
    ("pool", "pattern", {}, {}),
    ("pool", "cascaded", {"count": 4, "filter": "bilateral"}, {}),
    ("pool", "cascaded", {"count": 1}, {}),
    ("pool", "photon", {}, {"medium": {"ior": "fresh", "dispersion": "traced"}}),
    ("pool", "photon", {}, {"water": {"level": 2.0, "simulation": GRID}}),
    ("pool", "photon", {}, {"water": {"level": 2.0, "simulation": {**GRID, "kind": "spectral"}}}),
    ("beach", "beam", {}, {}),
    ("beach", "gather", {}, {}),
    ("tank", "beam", {}, {}),
    ("sea", "photon", {}, {}),
)
"""Scene, method, its settings, and tables of the scene that are replaced."""

Seconds = dict[str, float]


def scene_of(name: str, method: str, settings: dict[str, Any], more: dict[str, Any], resolution: int) -> wc.Scene:
    """Give a bundled scene with some of its tables replaced."""
    table = wc.load_scene(name).model_dump(exclude_unset=True, exclude_none=True)
    table["map"]["resolution"] = (resolution, resolution)
    table["camera"]["resolution"] = CAMERA
    return wc.Scene(**table | more | {"method": {"name": method, method: settings}})


def pass_of(command: Command) -> str:
    """Name a command by its kernel."""
    return str(command.kernel.func.__name__) if isinstance(command, wp.Launch) else "fill"


def stage_seconds(lanes: Lanes, crew: Crew) -> Seconds:
    """Run a stage, and time its passes."""
    names = {pass_of(command) for lane in lanes for command in lane}
    if len(names) == 1:
        start = perf_counter()
        crew.run(launches(lanes))
        return {names.pop(): perf_counter() - start}
    spent: list[Seconds] = [dict.fromkeys(names, 0.0) for _ in lanes]

    def timed(command: Command, into: Seconds) -> Callable[[], None]:
        def call() -> None:
            start = perf_counter()
            command.launch()
            into[pass_of(command)] += perf_counter() - start

        return call

    crew.run([[timed(command, into) for command in lane] for lane, into in zip(lanes, spent, strict=True)])
    # A thread takes a lane when it is free: what all of them spend is shared evenly where lanes outnumber threads.
    if len(lanes) > crew.threads:
        return {name: sum(into[name] for into in spent) / crew.threads for name in names}
    return {name: max(into[name] for into in spent) for name in names}


def frame_seconds(renderer: wc.Renderer, crew: Crew, time: float) -> Seconds:
    """Time the passes of a frame, and the steps of simulated water before it."""
    found: Seconds = {}
    for state in renderer._states:
        if state.simulated is not None and hasattr(state.simulated.motion, "height"):
            step = state.simulated.basin.step
            state.prepare(0.0)
            start = perf_counter()
            state.prepare(STEPS * step)
            found[f"{STEPS} steps of the water"] = perf_counter() - start
        state.prepare(time)
    for lanes in renderer.stages:
        for name, seconds in stage_seconds(lanes, crew).items():
            found[name] = found.get(name, 0.0) + seconds
    start = perf_counter()
    renderer.render(time)
    found["whole frame"] = perf_counter() - start
    return found


def best_seconds(scene: wc.Scene, threads: int) -> Seconds:
    """Time the passes of a scene's method, the fastest of some frames, and of the beam its picture."""
    renderer, crew = wc.Renderer(scene, device="cpu", threads=threads), Crew(threads)
    frames = [frame_seconds(renderer, crew, 0.1 * frame) for frame in range(FRAMES + 1)][1:]
    best = {name: min(frame[name] for frame in frames) for name in frames[0]}
    if scene.method.name == "beam":
        result = renderer.result()
        painter = Painter(result)
        painter._around = None
        painter.paint(result)
        start = perf_counter()
        painter.paint(result)
        best["picture"] = perf_counter() - start
    return best


def rows(resolution: int, threads: int) -> Iterator[dict[str, Any]]:
    """Time all passes of all runs."""
    for name, method, settings, more in RUNS:
        scene = scene_of(name, method, settings, more, resolution)
        cut = {pass_of(c) for lanes in wc.Renderer(scene, device="cpu", threads=threads).stages
               if len(lanes) > 1 for lane in lanes for c in lane}  # fmt: skip
        one, many = best_seconds(scene, 1), best_seconds(scene, threads)
        kind = ", ".join([*(f"{key} = {value}" for key, value in settings.items()), *more])
        for step, seconds in one.items():
            whole = step in ("whole frame", "picture") or step.endswith("steps of the water")
            yield {
                "scene": name, "method": method, "settings": kind, "pass": step, "spread": whole or step in cut,
                "by_memory": step in BY_MEMORY, "ms_1": 1e3 * seconds, f"ms_{threads}": 1e3 * many[step],
                "ratio": seconds / many[step],
            }  # fmt: skip


def goal(row: dict[str, Any], bandwidth_ratio: float) -> str:
    """Say what a pass should reach, and whether it does."""
    if row["ms_1"] < LEAST_MS:
        return "small"
    if not row["spread"]:
        return "one thread"
    least = OF_BANDWIDTH * bandwidth_ratio if row["by_memory"] else ARITHMETIC
    return f"{'yes' if row['ratio'] >= least else 'no'}, {least:.2f}"


def overhead() -> dict[str, float]:
    """Microseconds of a frame of the pool by beam, 16 x 16 pixels, on one thread: whole, and the same graphs alone."""
    scene = scene_of("pool", "beam", {}, {}, 16)
    renderer = wc.Renderer(scene, device="cpu", threads=1)
    graphs = [call.args[0] for lanes in renderer.playback._played for lane in lanes for call in lane]  # type: ignore
    replay = wp._src.context.runtime.core.wp_apic_cpu_replay_state
    whole, native = [], []
    for frame in range(OVERHEAD_FRAMES):
        begin = perf_counter()
        renderer.render(0.01 * frame)
        middle = perf_counter()
        for graph in graphs:
            replay(graph.apic_state)
        whole.append(middle - begin)
        native.append(perf_counter() - middle)
    # The fastest of each: what else runs comes between the two.
    frame, alone = 1e6 * min(whole), 1e6 * min(native)
    return {"frame": frame, "native": alone, "interpreter": frame - alone}


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--resolution", type=int, default=512)
    chosen = parser.parse_args()
    load = os.getloadavg()[0]
    wp.config.log_level = wp.LOG_WARNING
    copies = [copy_bandwidth("cpu", threads) for threads in (1, chosen.threads)]
    ratio = copies[1] / copies[0]
    print(
        f"{os.cpu_count()} cores; load average before: {load:.2f}. Memory is copied at {1e-9 * copies[0]:.1f} GB/s by "
        f"one thread and {1e-9 * copies[1]:.1f} GB/s by {chosen.threads}: {ratio:.2f} times. Maps of "
        f"{chosen.resolution} x {chosen.resolution}.\n"
    )
    print(f"| scene | method | pass | ms on 1 | ms on {chosen.threads} | ratio | goal |\n" + "|---" * 7 + "|")
    found = []
    for row in rows(chosen.resolution, chosen.threads):
        found.append(row)
        method = row["method"] + (f" ({row['settings']})" if row["settings"] else "")
        print(
            f"| {row['scene']} | {method} | {row['pass']} | {row['ms_1']:.3f} | {row[f'ms_{chosen.threads}']:.3f} | "
            f"{row['ratio']:.2f} | {goal(row, ratio)} |", flush=True,
        )  # fmt: skip
    interpreter = overhead()
    print("\nA frame of 16 x 16: " + ", ".join(f"{name} {value:.0f} us" for name, value in interpreter.items()) + ".")
    if chosen.output is not None:
        about = {"cores": os.cpu_count(), "load": load, "threads": chosen.threads, "resolution": chosen.resolution,
                 "bandwidth": copies, "interpreter_us": interpreter}  # fmt: skip
        chosen.output.write_text(json.dumps({**about, "passes": found}, indent=1) + "\n")


if __name__ == "__main__":
    main()
