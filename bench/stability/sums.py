"""Adding up: what each number format of a map makes of many photons, and what it costs."""

import functools
import statistics
from collections.abc import Iterator
from time import perf_counter
from typing import Any

import numpy as np
import warp as wp

import warp_caustics as wc
from oracle import relative_l2
from stability.row import THREADS, Row, measure
from stability.scenes import choppy, flat
from warp_caustics.kernels.deposit import ACCUMULATOR, FLUX, make_add, unit

FORMATS = ("float32", "float64", "fixed")
ONES = (2**20, 2**24, 2**26)
STALL = 2**24
"""One more than this is the same number to float32."""

POOL = (256, 256)
FRAMES = 5


@functools.cache
def make_pile(accumulate: str) -> wp.Kernel:
    """Add ones to one pixel, one thread a one."""
    add, dtype, flux = make_add(accumulate, 1), ACCUMULATOR[accumulate], FLUX[1]

    @wp.kernel(module="unique", enable_backward=False)
    def pile(map_out: wp.array[dtype]):
        add(map_out, 0, flux(1.0), 1.0)

    return pile


def ones() -> Iterator[Row]:
    """Ones into one pixel, by the kernels' own function."""
    for count in ONES:
        for accumulate in FORMATS:
            total = wp.zeros(1, dtype=ACCUMULATOR[accumulate], device="cpu")
            wp.launch(make_pile(accumulate), dim=1, outputs=[total], device="cpu")  # compiled apart
            total.zero_()
            start = perf_counter()
            wp.launch(make_pile(accumulate), dim=count, outputs=[total], device="cpu")
            seconds = perf_counter() - start
            found = float(total.numpy()[0]) * unit(accumulate)
            stalls = accumulate == "float32" and count > STALL
            yield Row(
                "ones added to one pixel", f"2^{count.bit_length() - 1}", f"add, {accumulate}", f"sum {found:.0f}",
                found == (STALL if stalls else count), float(count), abs(found / count - 1.0), seconds=seconds,
                limit="float32 has 24 bits" if accumulate == "float32" else "fixed: 2^31 cells fit a pixel"
                if accumulate == "fixed" else "float64 has 53 bits",
            )  # fmt: skip


def photons() -> Iterator[Row]:
    """A map of one pixel that takes 2^26 photons, all the way through the library."""
    table = choppy(zenith=0.0, count=0, resolution=(1, 1))
    for accumulate in (None, *FORMATS):
        settings: dict[str, Any] = {"photon": {"photons_per_pixel": float(ONES[-1])}}
        if accumulate is not None:
            settings["accumulate"] = accumulate
        limit = "asked for by name; it warns" if accumulate == "float32" else "float32 of the map itself"
        yield measure("photons into a map of one pixel", "2^26", "photon", table, flat(table), settings=settings,
                      label=f"photon, {accumulate or 'as it chooses'}", limit=limit)  # fmt: skip
    cells = {"beam": {"samples_per_pixel": float(2**22)}}
    yield measure("cells into a map of one pixel", "2^22", "beam", table, flat(table), settings=cells,
                  label="beam, as it chooses", limit="float32 of the map itself")  # fmt: skip


def costs() -> Iterator[Row]:
    """What a format costs on the bundled pool: time, bytes, error, and whether its bits come again."""
    whole = wc.load_scene("pool").model_dump(exclude_unset=True, exclude_none=True)
    whole["map"]["resolution"] = POOL
    for method in ("beam", "photon"):
        exact: np.ndarray | None = None
        for accumulate in ("float64", "float32", "fixed"):
            scene = wc.Scene(**{**whole, "method": {"accumulate": accumulate}})
            renderer = wc.Renderer(scene, method, "cpu", THREADS)
            seconds = []
            for _ in range(1 + FRAMES):
                start = perf_counter()
                renderer.render()
                seconds.append(perf_counter() - start)
            result = renderer.result()
            image = result.caustic_map.astype(np.float64)
            exact = image if exact is None else exact
            others = [wc.render(scene, method, "cpu", threads).caustic_map for threads in (1, 3)]
            same = all(np.array_equal(other, result.caustic_map) for other in others)
            bits = "the same bits" if same else "other bits"
            yield Row(
                "format, pool 256 x 256", accumulate, method,
                f"{renderer.plan.bytes:,} bytes, {bits} by 1, 2 and 3 threads", same or accumulate != "fixed",
                error=relative_l2(image, exact), unaccounted=result.energy.unaccounted,
                limit="against float64", seconds=statistics.median(seconds[1:]),
            )  # fmt: skip
