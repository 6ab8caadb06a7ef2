"""The gather's ladder: ``python bench/ladder_gather.py [--pixels N] [--device D]``.

The published three passes, then each form that gives the same sum, for windows of 7 and of 31 samples, as whole frames
of the front door: waves, refraction, landing, gather, and the map brought to irradiance. Beside them the peer in Numba,
where that is installed.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import sys
from collections.abc import Callable

import numpy as np
import warp as wp
from ladder import Rung, measure

import warp_caustics as wc
from warp_caustics.bandwidth import copy_bandwidth

WINDOWS = (7, 31)
FORMS = {
    "two_pass": "as published: intersections, rows, columns",
    "fused": "intersections, then one pass over the window",
    "tile": "the same from shared memory",
    "scatter": "each sample's box added once",
    "scatter_rows": "the same, a row at a time in lanes",
}
PEER_FORMS = ("two_pass", "splat")
PEER_TOLERANCE = 1e-4
"""Of the peer: its ``fastmath`` rounds landings otherwise, and those are known to some 1e-5 of a pixel."""


def scene(pixels: int, n: int, form: str) -> wc.Scene:
    """The bundled pool at a resolution, gathered by a window and a form."""
    table = wc.load_scene("pool").model_dump(exclude_unset=True, exclude_none=True)
    table["map"]["resolution"] = (pixels, pixels)
    return wc.Scene(**{**table, "method": {"name": "gather", "gather": {"n": n, "form": form}}})


def rungs(pixels: int, device: str) -> list[list[Rung]]:
    """A ladder for each window, the published form first."""
    return [_ladder(pixels, n, device) for n in WINDOWS]


def _ladder(pixels: int, n: int, device: str) -> list[Rung]:
    name = f"gather N = {n}"
    ladder = [_form(name, pixels, n, form, device) for form in FORMS]
    if device == "cpu":
        ladder += [_peer(name, pixels, n, form) for form in PEER_FORMS]
    return ladder


def _form(ladder: str, pixels: int, n: int, form: str, device: str) -> Rung:
    what = scene(pixels, n, form)
    plan = wc.make_plan(what, device=device, threads=1)

    def make(threads: int) -> tuple[Callable[[], None], Callable[[], np.ndarray]]:
        renderer = wc.Renderer(what, device=device, threads=threads)

        def run() -> None:
            renderer.render()
            wp.synchronize_device(device)

        return run, lambda: renderer.result().caustic_map

    # Tiles need blocks of threads, and rows a thread that is fast by itself.
    runs = form != ("tile" if device == "cpu" else "scatter_rows")
    # What is written is read again, but for the map itself.
    traffic = sum(2 * buffer.bytes for buffer in plan.buffers) - 4 * pixels * pixels
    return Rung(ladder, f"{form}: {FORMS[form]}", make if runs else None, traffic, plan.bytes)


def _peer(ladder: str, pixels: int, n: int, form: str) -> Rung:
    name = f"Numba, {form}"
    if importlib.util.find_spec("numba") is None:
        return Rung(ladder, f"{name}: not installed", None, 0, 0)
    from numba_peer import Peer, make_peer

    plan = wc.make_plan(scene(pixels, n, "two_pass"), device="cpu", threads=1)
    size = Peer(plan, form, 1).bytes
    return Rung(ladder, name, make_peer(plan, form), 2 * size - 4 * pixels * pixels, size, PEER_TOLERANCE)


def main() -> None:
    """Print both ladders, on one thread and on all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pixels", type=int, default=1024)
    parser.add_argument("--device", default="cpu")
    arguments = parser.parse_args()
    wp.config.log_level = wp.LOG_WARNING
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    print(
        "| ladder | rung | threads | ms | ratio | error | MB | share of the floor |\n|---|---|---|---|---|---|---|---|"
    )
    for threads in dict.fromkeys((1, cores if arguments.device == "cpu" else 1)):
        bandwidth = copy_bandwidth(arguments.device, threads)
        for ladder in rungs(arguments.pixels, arguments.device):
            for rung in ladder:
                if rung.make is None:
                    print(f"{rung.ladder}, {rung.name}: left out on {arguments.device}", file=sys.stderr)
            for one in measure(ladder, threads, bandwidth):
                print(
                    f"| {one.rung.ladder} | {one.rung.name} | {one.threads} | {1e3 * one.seconds:.1f} | "
                    f"{one.ratio:.1f} | {one.error:.0e} | {one.rung.bytes / 1e6:.0f} | {100 * one.share:.0f} % |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
