"""Run the sweeps of extremes: ``python bench/stability/run.py [-o DIR] [--only NAME]``.

Each sweep writes a table, a JSON file and a picture. The exit status is 1 if a row is wrong: a map that is not finite,
light that the ledger cannot account for and that nobody warns of, or a kernel that departs from float64.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from time import perf_counter

sys.path.insert(0, str(Path(__file__).parents[1]))

import warp as wp

from stability import ground, light, maps, report, space, sums, values
from stability.row import Row

SWEEPS: dict[str, tuple[Callable[[], Iterator[Row]], ...]] = {
    "light": (light.sun, light.slopes, light.facing_away, light.indices, light.critical),
    "space": (space.depth, space.scale, space.far, space.late),
    "maps": (maps.shapes, maps.counts),
    "ground": (ground.steep_floor, ground.cliff, ground.meshes, ground.collapse),
    "values": (values.tiny, values.huge, values.not_numbers, values.faulty_files),
    "sums": (sums.ones, sums.photons, sums.costs),
}
"""By name: what goes to its extreme in one sweep."""

RESULTS = Path("out/stability")


def main() -> int:
    """Run what is asked for, and say what is wrong."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, default=RESULTS, help="folder of the results")
    parser.add_argument("--only", choices=SWEEPS, action="append", help="one sweep; may be repeated")
    chosen = parser.parse_args()
    wp.config.log_level = wp.LOG_WARNING
    wrong = 0
    for name in chosen.only or SWEEPS:
        start = perf_counter()
        rows = []
        for family in SWEEPS[name]:
            rows += family()
            print(f"{name}: {family.__name__}, {perf_counter() - start:.0f} s", flush=True)
        report.write(name, rows, chosen.output)
        bad = [row for row in rows if not row.ok]
        wrong += len(bad)
        print(f"{name}: {len(rows)} rows, {len(bad)} wrong, {perf_counter() - start:.0f} s", flush=True)
        for row in bad:
            print(f"  {row.what} {row.value} {row.method}: {row.result}, unaccounted {row.unaccounted}")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
