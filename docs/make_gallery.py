"""Makes the pictures of README's gallery: runs the command under each, and scales what it wrote to the page.

python docs/make_gallery.py [NAME ...]
"""

from __future__ import annotations

import shlex
import sys
import tempfile
from pathlib import Path

from PIL import Image

from warp_caustics.cli import main

FOLDER = Path(__file__).parent / "images"

WIDTH = 720
"""Pixels: two pictures beside each other fill a page."""

GALLERY = {
    "beach_cascaded": "render beach --method cascaded --picture",
    "beach_pattern": "render beach --method pattern --picture",
    "pool_picture": "render pool --picture",
    "pool_sample": "render pool --method sample --picture",
    "pool": "render pool",
    "pool_gather": "render pool --method gather",
    "pool_area_ratio": "render pool --method area_ratio",
    "pool_differential": "render pool --method differential",
    "lake": "render lake",
    "tank": "render tank --method photon",
    "sea": "render sea",
}
"""By name of the file."""


def make(name: str) -> None:
    """Run a command of the gallery and keep its picture."""
    with tempfile.TemporaryDirectory() as folder:
        whole = Path(folder, "whole.png")
        status = main([*shlex.split(GALLERY[name]), "-o", str(whole)])
        if status:
            raise SystemExit(status)
        with Image.open(whole) as picture:
            small = picture.convert("RGB")
            small.thumbnail((WIDTH, WIDTH), Image.Resampling.LANCZOS)
            small.save(FOLDER / f"{name}.png", optimize=True)


if __name__ == "__main__":
    for wanted in sys.argv[1:] or GALLERY:
        make(wanted)
