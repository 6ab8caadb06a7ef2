"""Write `docs/scene.md`, the reference of all keys of a scene file, from the models.

Run as `python docs/make_scene_md.py` after a change of the models.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

from warp_caustics.scene import IOR_TABLE, JERLOV_TABLE, METHODS, Scene, bundled_scenes
from warp_caustics.scene.faults import listed, shown
from warp_caustics.scene.formats import HEIGHT_SUFFIXES, MESH_SUFFIXES, TEXTURE_SUFFIXES
from warp_caustics.scene.model import Model, expectation

PAGE = Path(__file__).with_name("scene.md")

INTRODUCTION = """\
# The scene file

<!-- Made by docs/make_scene_md.py from the models: change those, then run it. -->

A scene is a TOML file. Lengths are metres, angles are radians unless the unit says degrees, z is up. Relative paths are
relative to the scene file. Every fault is reported at once, each with its path in the file: unknown keys, NaN and
infinities, wrong shapes, impossible values, and keys that cannot be honoured.

From Python, `warp_caustics.load_scene("file.toml")` loads one; `warp_caustics.Scene(water={...}, ...)` takes the same
tables as dictionaries and checks them alike. `scene.to_toml()` gives the text back.
"""


def scene_reference() -> str:
    """Return the whole page."""
    parts = [INTRODUCTION, f"Bundled scenes: {listed((f'`{name}`' for name in bundled_scenes()), 'and')}.\n"]
    parts += ["## Top level\n", *_table(Scene)]
    for name, model in _models(Scene):
        if name.count(".") == 0:
            parts.append(f"## `[{name}]`\n")
        else:
            parts.append(f"### `{name}`\n")
        parts += [f"{inspect.getdoc(model)}\n", *_table(model)]
    return "\n".join([*parts, *_appendix()])


def _models(model: type[Model], path: str = "") -> Iterator[tuple[str, type[Model]]]:
    """Yield all tables below a model, each with its path, in the order of the fields."""
    for name, field in model.model_fields.items():
        inner = list(_inner(field.annotation))
        for each in inner:
            is_list = "list" in expectation(field)
            label = f"{path}{name}{'[]' if is_list else ''}{_variant(each) if len(inner) > 1 else ''}"
            yield label, each
            yield from _models(each, f"{path}{name}{'[]' if is_list else ''}.")


def _inner(annotation: Any) -> Iterator[type[Model]]:
    """Yield the models inside a type."""
    arguments = get_args(annotation)
    if not arguments and isinstance(annotation, type) and issubclass(annotation, Model):
        yield annotation
    for argument in arguments:
        yield from _inner(argument)


def _variant(model: type[Model]) -> str:
    """Return what tells one kind of table from another in the same place."""
    return " (from a file)" if "file" in model.model_fields else " (closed form)"


def _table(model: type[Model]) -> list[str]:
    """Return a table of a model's keys."""
    lines = ["| key | expected | default | meaning |", "|---|---|---|---|"]
    for name, field in model.model_fields.items():
        if field.is_required():
            default = "required"
        elif field.default is None or isinstance(field.default, Model):
            default = ""
        else:
            default = f"`{shown(field.default)}`"
        lines.append(f"| `{name}` | {expectation(field)} | {default} | {field.description} |")
    lines += [f"| `{key}` | not yet in this version | | {hint} |" for key, hint in model.not_yet.items()]
    return [*lines, ""]


def _appendix() -> list[str]:
    """Return the tables of constants and the lists of names."""
    rows = ["| name | red, 650 nm | green, 550 nm | blue, 450 nm |", "|---|---|---|---|"]
    return [
        "## Index of refraction by name\n",
        "Quan & Fry 1995, at 20 °C and salinity 0 or 35 per mille.\n",
        *rows,
        *(f"| {name} | {r} | {g} | {b} |" for name, (r, g, b) in IOR_TABLE.items()),
        "",
        "## Jerlov water types\n",
        "Diffuse attenuation K_d [1/m].\n",
        *rows,
        *(f"| {name} | {r} | {g} | {b} |" for name, (r, g, b) in JERLOV_TABLE.items()),
        "",
        "## Files and methods\n",
        f"- Height maps: {listed(HEIGHT_SUFFIXES)}. GeoTIFF needs the extra `geotiff`, NetCDF the extra `netcdf`.",
        f"- Meshes: {listed(MESH_SUFFIXES)}.",
        f"- Textures of a pattern: {listed(TEXTURE_SUFFIXES)}; those of 8 bits are taken for sRGB.",
        f"- Methods: {listed(METHODS, 'and')}.",
        "",
    ]


if __name__ == "__main__":
    PAGE.write_text(scene_reference(), encoding="utf-8")
