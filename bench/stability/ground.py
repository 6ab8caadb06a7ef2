"""What lies below at its extremes: floors steeper than the rays, a cliff, needles, and cells that collapse."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from scenery import save_heights, save_mesh

from oracle.cases import sunlight
from stability.row import METHODS, Row, Truth, each
from stability.scenes import PIXEL, RESOLUTION, choppy, converged, sine, sine_truth

FREE = ("beam", "photon")
"""Methods that take any receiver."""

CLIFF = 0.5
"""Height of the step [m]."""

CLIFF_X = -1.0 + (np.arange(96) + 0.5) / 32.0
"""Samples of the terrain [m]: two pixels apart."""

FOCUS_SIDE = 1.5
"""Side of the lens that is focused into one pixel [m]."""


def steep_floor() -> Iterator[Row]:
    """Floors that rise against the light, and that fall away faster than it."""
    for slope in (1.0, 3.0, 10.0, -3.0):
        across = slope * RESOLUTION[0] * PIXEL
        table = choppy(zenith=60.0, receiver={"terrain": {"base": -max(across, 0.0) - 0.5, "slope": (slope, 0.0)}})
        away = slope < 0.0
        yield from each(FREE, "slope of the floor", slope, table, converged(table), same=not away,
                        limit="no light meets it: it falls faster than the rays" if away else "the method")  # fmt: skip


def cliff() -> Iterator[Row]:
    """A step of half the depth between two samples of a terrain, under flat water, that faces the light or hides it."""
    with TemporaryDirectory() as folder:
        for angle, rises in ((0.0, True), (45.0, True), (45.0, False)):
            table = choppy(zenith=angle, count=0, depth=64.0, sun={"direction": sunlight(angle, 0.0)})
            z = np.where((CLIFF_X > 0.375) == rises, CLIFF, 0.0)[None, :] * np.ones((CLIFF_X.size, 1))
            terrain = save_heights(Path(folder), "cliff", z, (-1.0, -1.0), (3.0, 3.0))
            value = f"{angle:g}, {'faces' if rises else 'hides'}"
            truth = Truth(cliff_light(angle, rises))
            yield from each(FREE, "cliff of 0.5 m, sun [deg from zenith]", value,
                            {**table, "receiver": {"terrain": terrain}}, truth,
                            limit="the step is a smooth slope between two samples")  # fmt: skip


def cliff_light(zenith: float, rises: bool) -> np.ndarray:
    """Give the light about a sharp cliff at the middle of the map: the wall's in two columns, or none in its shadow."""
    light, reach = np.cos(np.radians(zenith)), CLIFF * np.tan(np.arcsin(np.sin(np.radians(zenith)) / 1.333))
    edges = np.arange(RESOLUTION[0] + 1) * PIXEL
    line = np.full(RESOLUTION[0], light)
    if rises:
        line[23:25] += light * reach / (2.0 * PIXEL)
    else:
        hidden = np.clip(edges, 0.375, 0.375 + reach)
        line *= 1.0 - np.diff(hidden) / PIXEL
    return np.tile(line, (RESOLUTION[1], 1))


def meshes() -> Iterator[Row]:
    """A floor of triangles among which are some without area, and needles: the floor is a plane all the same."""
    table = choppy()
    truth = converged(table)
    floors = {
        "whole": quads(1),
        "with degenerate triangles": degenerate(),
        "of needles, 1e-4 wide": quads(40_000),
        "of needles, 1e-6 wide": quads(40_000, 0.04),
    }
    with TemporaryDirectory() as folder:
        for what, (vertices, faces) in floors.items():
            path = save_mesh(Path(folder), "floor", vertices, faces)
            yield from each(FREE, "mesh", what, {**table, "receiver": {"mesh": path}}, truth, limit="the method")


def quads(count: int, width: float = 4.0) -> tuple[np.ndarray, list[tuple[int, ...]]]:
    """Make a floor four metres wide from quads, of which ``count - 1`` share a strip of some width in its middle."""
    inner = np.linspace(0.4 - 0.5 * width, 0.4 + 0.5 * width, count + 1)
    x = np.unique(np.concatenate([[-3.0], inner, [4.0]]))
    vertices = np.array([(a, b, 0.0) for a in x for b in (-3.0, 4.0)])
    return vertices, [(2 * i, 2 * i + 2, 2 * i + 3, 2 * i + 1) for i in range(len(x) - 1)]


def degenerate() -> tuple[np.ndarray, list[tuple[int, ...]]]:
    """Make a floor with triangles of repeated corners and of corners on a line."""
    vertices, faces = quads(1)
    line = np.array([(-3.0, -3.0, 0.0), (0.0, 0.0, 0.0), (4.0, 4.0, 0.0)])
    n = len(vertices)
    return np.concatenate([vertices, line]), [(0, 0, 1), (2, 2, 2), (n, n + 1, n + 2), *faces, (0, 1, 1)]


def collapse() -> Iterator[Row]:
    """Cells that the water squeezes to a line, and to a point."""
    length, amplitude, ior = 0.75, 0.005, 1.333
    k = 2.0 * np.pi / length
    focus = ior / ((ior - 1.0) * amplitude * k * k)
    table = sine(focus - amplitude, amplitude, length, light_x=0.0)
    yield from each(METHODS, "cells that collapse to a line", "at the focus", table, sine_truth(table), same=True,
                    limit="the method, at a focus in every pixel of a line")  # fmt: skip
    with TemporaryDirectory() as folder:
        yield from each(METHODS, "cells that collapse to a point", "a lens at its focus", *lens(Path(folder), ior),
                        limit="float32: only the sum is known")  # fmt: skip


def lens(folder: Path, ior: float) -> tuple[dict[str, Any], Truth]:
    """Make a quadric of water whose light falls into a few pixels of the map; and its sum, spread evenly."""
    radius, samples = 2.0, 192
    depth = ior * radius / (ior - 1.0)
    at = ((np.arange(samples) + 0.5) / samples - 0.5) * FOCUS_SIDE
    z = -(at[None, :] ** 2 + at[:, None] ** 2) / (2.0 * radius)
    columns, rows = 65, 65
    size = (columns * PIXEL, rows * PIXEL)
    corner = (0.5 * size[0] - 0.5 * FOCUS_SIDE, 0.5 * size[1] - 0.5 * FOCUS_SIDE)
    side = (FOCUS_SIDE, FOCUS_SIDE)
    table = choppy(
        zenith=0.0,
        water={"level": depth, "height_map": save_heights(folder, "lens", z, corner, side)},
        map={"origin": (0.0, 0.0), "size": size, "resolution": (columns, rows)},
    )
    flux = FOCUS_SIDE**2 / (size[0] * size[1])
    return table, Truth(np.full((rows, columns), flux), total=True)
