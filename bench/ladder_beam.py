"""The beam's ladder: the deposit of landed cells, by triangles one by one and by the edges between them.

A frame is the passes that deposit: clearing, cells, and the sum over lanes and rows. The corners have landed before it.
Beside them stands the yardstick, a plain bilinear splat of the same samples, which is another sum.
"""

from __future__ import annotations

import functools
import importlib
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import warp as wp
from bilinear import bilinear_plain
from ladder import Rung
from scenes import SCENES

import warp_caustics as wc
from warp_caustics.metrics import relative_l2

BEAM = importlib.import_module("warp_caustics.methods.beam")
"""The module; its package has the function of that name."""

SAMPLES = (1, 4)
"""Cells for each pixel."""

DEPOSITS = {"clear", "cells", "resolve"}
"""Passes of a frame that deposit."""

FORMS = 4e-4
"""Relative L2 distance of edges from triangles, which are clipped in float32."""

REFINED = 2e-2
"""Of refined cells from unrefined ones, whose error they lack."""

TRUTH_PIXELS = 512
"""Side of the map on which rungs are compared with the reference."""

Frame = tuple[Callable[[], None], Callable[[], np.ndarray]]


def pool(pixels: int, samples: int, settings: Mapping[str, Any]) -> wc.Scene:
    """Give the pool by beams."""
    table = SCENES["pool"].at_resolution(pixels, pixels).model_dump(exclude_unset=True, exclude_none=True)
    return wc.Scene(**{**table, "method": {"name": "beam", "beam": {"samples_per_pixel": float(samples), **settings}}})


def landed(scene: wc.Scene, device: str, threads: int) -> wc.Renderer:
    """Make a renderer with one strip a thread, whose planes then hold all corners, and render a frame."""
    rows = wc.make_plan(scene, device=device, threads=1).program.lattice.count[1]
    before = BEAM.STRIP_ROWS
    try:
        BEAM.STRIP_ROWS = -(-rows // threads)
        renderer = wc.Renderer(scene, device=device, threads=threads)
    finally:
        BEAM.STRIP_ROWS = before
    renderer.render()
    return renderer


def deposit(scene: wc.Scene, device: str, threads: int) -> Frame:
    """Make the frame of a rung."""
    renderer = landed(scene, device, threads)
    stages = [[[c for c in lane if c.pass_name in DEPOSITS] for lane in stage] for stage in renderer.stages]
    crew = ThreadPoolExecutor(threads) if threads > 1 else None

    def lay(lane: list[Any]) -> None:
        for command in lane:
            command.launch()

    def run() -> None:
        for stage in stages:
            if crew is None:
                for lane in stage:
                    lay(lane)
            else:
                list(crew.map(lay, stage))
        wp.synchronize_device(device)

    return run, lambda: renderer.result().caustic_map


def yardstick(scene: wc.Scene, device: str, threads: int) -> Frame:
    """Make the bilinear splat of the corners that a frame's cells begin at."""
    renderer = landed(scene, device, 1)
    lattice, shape = renderer.plan.program.lattice, scene.map.resolution
    planes = renderer._recording._own[0]["planes"].numpy()
    columns, rows = lattice.count
    x, y, flux = planes[:3, 1 : rows + 1, 1 : columns + 1]
    rest_x = (lattice.first[0] + np.arange(columns)) * lattice.step
    rest_y = (lattice.first[1] + np.arange(rows)) * lattice.step
    scaled = flux * np.float32(lattice.step**2)
    return bilinear_plain(x + rest_x, y + rest_y[:, None], scaled, shape, device, threads)


def rungs(pixels: int, device: str) -> list[list[Rung]]:
    """Give a ladder for each count of samples.

    Parameters
    ----------
    pixels : int
        Of the map's sides.
    device : str
        ``"cpu"``, ``"cuda:0"``.
    """
    return [_ladder(pixels, samples, device) for samples in SAMPLES]


def _ladder(pixels: int, samples: int, device: str) -> list[Rung]:
    title = f"beam, {samples} a pixel"
    forms = {
        "triangles one by one": ({"refine": False, "deposit": "triangles"}, FORMS),
        "edges between triangles": ({"refine": False}, FORMS),
        "triangles, refined": ({"deposit": "triangles"}, REFINED),
        "edges, refined (default)": ({}, REFINED),
    }
    ladder = []
    for name, (settings, tolerance) in forms.items():
        scene = pool(pixels, samples, settings)
        plan = wc.make_plan(scene, device=device, threads=1)
        sizes = {buffer.name: buffer.bytes for buffer in plan.buffers}
        # Corners are read, the accumulator is cleared, written and read, the map written.
        corners = plan.program.lattice.cells * 12
        traffic = corners + 3 * sizes["map"] + sizes["caustic_map"]
        make = functools.partial(deposit, scene, device)
        accuracy = functools.partial(_accuracy, samples, settings)
        ladder.append(Rung(title, name, make, traffic, plan.bytes, tolerance, accuracy))
    scene = pool(pixels, samples, {"refine": False})
    arrays = wc.make_plan(scene, device=device).program.lattice.cells * 12 + 4 * pixels * pixels
    make = functools.partial(yardstick, scene, device)
    ladder.append(Rung(title, "yardstick: bilinear splat of the same samples", make, arrays, arrays, np.inf))
    return ladder


@functools.cache
def _reference() -> np.ndarray:
    return np.asarray(wc.render(pool(TRUTH_PIXELS, 1, {}), method="reference").caustic_map)


def _accuracy(samples: int, settings: Mapping[str, Any]) -> float:
    rendered = wc.render(pool(TRUTH_PIXELS, samples, settings))
    return relative_l2(rendered.caustic_map, _reference())
