"""Finding the files that a scene names."""

from __future__ import annotations

from pathlib import Path

from warp_caustics.errors import InputError
from warp_caustics.scene.formats import BUNDLED_PREFIX, MATPLOTLIB_PREFIX
from warp_caustics.scene.load import BUNDLED_FOLDER


def locate(file: str) -> Path:
    """Return the path of a file named in a scene.

    Parameters
    ----------
    file
        A path, `bundled:NAME` for a file of this library, or `matplotlib:NAME` for one of matplotlib's sample files.

    Raises
    ------
    InputError
        If there is no such file.
    """
    if file.startswith(BUNDLED_PREFIX):
        path = _inside(BUNDLED_FOLDER, file.removeprefix(BUNDLED_PREFIX))
    elif file.startswith(MATPLOTLIB_PREFIX):
        path = _inside(_matplotlib_samples(), file.removeprefix(MATPLOTLIB_PREFIX))
    else:
        path = Path(file)
    if path.is_dir():
        raise InputError(f"expected a file, got the folder {path}")
    if not path.is_file():
        raise InputError(f"no such file: {path}")
    return path


def _inside(folder: Path, name: str) -> Path:
    """Return a file's path in a folder that it must not leave."""
    if Path(name).name != name:
        raise InputError(f'expected the bare name of a file, got "{name}"')
    return folder / name


def _matplotlib_samples() -> Path:
    """Return the folder of matplotlib's sample data."""
    import matplotlib

    return Path(matplotlib.get_data_path()) / "sample_data"
