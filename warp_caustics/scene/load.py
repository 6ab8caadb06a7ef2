"""Reading scene files, and the scenes that come with the library."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any, Final

from pydantic import ValidationError

from warp_caustics.errors import InputError
from warp_caustics.scene.faults import did_you_mean, input_error, listed
from warp_caustics.scene.scene import Scene

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

#: The folder of the bundled scenes and of the files they need.
BUNDLED_FOLDER: Final = Path(__file__).resolve().parent.parent / "scenes"
SCENE_SUFFIX: Final = ".toml"


def bundled_scenes() -> list[str]:
    """Return the names of the scenes that come with the library."""
    return sorted(path.stem for path in BUNDLED_FOLDER.glob(f"*{SCENE_SUFFIX}"))


def load_scene(name_or_path: str | os.PathLike[str]) -> Scene:
    """Load a scene from a TOML file, or a bundled one by its name.

    Parameters
    ----------
    name_or_path
        A file; or, where there is no such file, a bundled name. Files that the scene names are looked for beside it.

    Raises
    ------
    InputError
        If the file cannot be read, is not TOML, or has faults: all of them, one a line.
    """
    given = os.fspath(name_or_path)
    path = Path(given)
    if not path.is_file():
        if given in bundled_scenes():
            path = BUNDLED_FOLDER / f"{given}{SCENE_SUFFIX}"
        else:
            raise InputError(_not_found(path, given))
    try:
        text = path.read_text(encoding="utf-8-sig")  # a byte order mark is no fault
    except UnicodeDecodeError as error:
        raise InputError(f"{given}: expected UTF-8 text, got other bytes at byte {error.start}") from None
    except OSError as error:
        raise InputError(f"{given}: cannot be read: {error.strerror}") from None
    return _scene_of(text, source=given, name=path.stem, folder=path.absolute().parent)


def parse_scene(text: str) -> Scene:
    """Return the scene of a TOML text, such as `Scene.to_toml` makes.

    Raises
    ------
    InputError
        As `load_scene`; files are not looked for here.
    """
    return _scene_of(text, source="scene text", name=None, folder=None)


def _scene_of(text: str, source: str, name: str | None, folder: Path | None) -> Scene:
    """Return the scene of a text; `name` is for a scene that gives none, files are relative to `folder`."""
    try:
        values: dict[str, Any] = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # bad syntax, an integer of thousands of digits, absurd nesting
        raise InputError(f"{source}: expected TOML: {error}") from None
    if name is not None:
        values.setdefault("name", name)
    try:
        return Scene.model_validate(values, context=None if folder is None else {"folder": folder})
    except ValidationError as error:
        raise input_error(error, source) from None


def _not_found(path: Path, given: str) -> str:
    """Return why there is no such scene, and what is there instead."""
    if path.is_dir():
        return f"{given}: expected a scene file, got a folder"
    problem = "expected a scene file, got something else" if path.exists() else "no such scene file"
    names = bundled_scenes()
    hint = did_you_mean(path.stem, names)
    return f"{given}: {problem}{f', {hint}' if hint else ''} (bundled scenes: {listed(names, 'and')})"
