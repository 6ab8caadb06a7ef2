"""Every rung of every ladder in one table: ``python bench/ladders.py [-o DIR] [--pixels N] [--device D]``.

A ladder is one sum by several kernels, the published or plain form first. Each rung is checked against the first, and
timed on one thread and on all; the share of the floor is that of a copy of the bytes which it must read and write, at
the bandwidth of as many threads. Prints the table, and writes it with a JSON.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import ladder_beam
import ladder_gather
import ladder_splat
import warp as wp
from ladder import Timed, measure

from warp_caustics.bandwidth import copy_bandwidth
from warp_caustics.device import resolve_device, resolve_threads

RESULTS = Path("out/ladders")
LADDERS = {"beam": ladder_beam, "gather": ladder_gather, "splat": ladder_splat}
PIXELS = 1024
HEADING = (
    "| ladder | rung | threads | ms | times as fast as the first | distance from the first | error at "
    f"{ladder_beam.TRUTH_PIXELS}² | MB | share of the floor |\n|---|---|---|---|---|---|---|---|---|"
)


def line(timed: Timed) -> str:
    """Write one rung of the table."""
    rung = timed.rung
    truth = "" if timed.truth is None else f"{100.0 * timed.truth:.3f} %"
    distance = "another sum" if rung.tolerance == float("inf") else f"{timed.error:.1e}"
    return (
        f"| {rung.ladder} | {rung.name} | {timed.threads} | {1e3 * timed.seconds:.1f} | {timed.ratio:.2f} | "
        f"{distance} | {truth} | {rung.bytes / 1e6:.1f} | {100.0 * timed.share:.1f} % |"
    )


def record(timed: Timed) -> dict[str, Any]:
    """Give one rung as JSON has it."""
    return {
        "ladder": timed.rung.ladder, "rung": timed.rung.name, "threads": timed.threads, "seconds": timed.seconds,
        "ratio": timed.ratio, "distance": timed.error, "error": timed.truth, "bytes": timed.rung.bytes,
        "traffic": timed.rung.traffic, "share_of_floor": timed.share,
    }  # fmt: skip


def climb(names: Sequence[str], pixels: int, device: str) -> list[Timed]:
    """Measure ladders, and tell each as it is done."""
    everything: list[Timed] = []
    counts = (1, resolve_threads(None, device))
    for threads in dict.fromkeys(counts):
        bandwidth = copy_bandwidth(device, threads)
        print(f"{threads} thread(s): copies {bandwidth / 1e9:.1f} GB/s", file=sys.stderr)
        for name in names:
            for ladder in LADDERS[name].rungs(pixels, device):
                rows = measure(ladder, threads, bandwidth)
                if threads == counts[0]:
                    rows = [replace(row, truth=row.rung.accuracy()) if row.rung.accuracy else row for row in rows]
                for row in rows:
                    print(line(row), flush=True)
                everything += rows
    return everything


def main() -> None:
    """Measure the ladders that are asked for, all of them by default."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("ladders", nargs="*", metavar="LADDER", help=", ".join(LADDERS))
    parser.add_argument("-o", "--output", type=Path, default=RESULTS)
    parser.add_argument("--pixels", type=int, default=PIXELS)
    parser.add_argument("--device")
    asked = parser.parse_args()
    unknown = sorted(set(asked.ladders) - set(LADDERS))
    if unknown:
        parser.error(f"no such ladder: {', '.join(unknown)}; expected some of {', '.join(LADDERS)}")
    wp.config.log_level = wp.LOG_WARNING
    load = f"{os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else "unknown"
    print(f"load before the run: {load}", file=sys.stderr)
    print(HEADING)
    timed = climb(asked.ladders or list(LADDERS), asked.pixels, resolve_device(asked.device))
    asked.output.mkdir(parents=True, exist_ok=True)
    text = "\n".join([HEADING, *map(line, timed)]) + "\n"
    about = f"Maps of {asked.pixels} x {asked.pixels} pixels; load before the run {load}.\n\n"
    (asked.output / "ladders.md").write_text(about + text)
    (asked.output / "ladders.json").write_text(json.dumps([record(row) for row in timed], indent=1) + "\n")


if __name__ == "__main__":
    main()
