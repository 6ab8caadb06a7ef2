"""Error against run time on every scene: ``python bench/compare_scenes.py [--device D] [--threads N] [SCENE ...]``.

Writes ``bench/results/<device>/<scene>.json`` and ``.png``; the folder is named after the processor or GPU. With
``--folder`` it prints that folder and does nothing else.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from scenes import SCENES

import warp_caustics as wc
from warp_caustics.cli.compare_table import print_comparison
from warp_caustics.cli.quiet import start_warp
from warp_caustics.cli.report import steps
from warp_caustics.comparison.machine import slug
from warp_caustics.device import resolve_device

RESULTS = Path(__file__).parent / "results"


def main() -> None:
    """Compare the scenes that are asked for, all of them by default."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help=", ".join(SCENES))
    parser.add_argument("--device")
    parser.add_argument("--threads", type=int)
    parser.add_argument("--folder", action="store_true", help="print the folder of the results, and measure nothing")
    asked = parser.parse_args()
    unknown = sorted(set(asked.scenes) - set(SCENES))
    if unknown:
        parser.error(f"no such scene: {', '.join(unknown)}; expected some of {', '.join(SCENES)}")
    start_warp()
    folder = RESULTS / slug(resolve_device(asked.device))
    if asked.folder:
        folder.mkdir(parents=True, exist_ok=True)
        print(folder)
        return
    for name in asked.scenes or SCENES:
        with steps() as tell:
            comparison = wc.compare(SCENES[name], device=asked.device, threads=asked.threads, tell=tell)
        print_comparison(comparison)
        for path in comparison.save(folder, name):
            print(path)


if __name__ == "__main__":
    main()
