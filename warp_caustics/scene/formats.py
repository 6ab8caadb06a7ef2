"""Which files a scene may name, told by their suffix."""

from __future__ import annotations

from pathlib import PurePath
from typing import Final

#: Files that come with something installed are named `prefix:name` and are never resolved against a folder.
BUNDLED_PREFIX: Final = "bundled:"
MATPLOTLIB_PREFIX: Final = "matplotlib:"
PREFIXES: Final = (BUNDLED_PREFIX, MATPLOTLIB_PREFIX)

IMAGE_SUFFIXES: Final = (".png", ".bmp", ".jpg", ".jpeg")
GEOTIFF_SUFFIXES: Final = (".tif", ".tiff")
NETCDF_SUFFIXES: Final = (".nc", ".nc4", ".cdf")
HEIGHT_SUFFIXES: Final = (".exr", ".npy", ".npz", *IMAGE_SUFFIXES, *GEOTIFF_SUFFIXES, *NETCDF_SUFFIXES)
#: Pictures that a pattern is made of.
TEXTURE_SUFFIXES: Final = (".exr", *IMAGE_SUFFIXES)

#: Formats that can say where they lie on the ground; all others need `origin` and `size` in the scene.
GEOREFERENCED_SUFFIXES: Final = (*GEOTIFF_SUFFIXES, *NETCDF_SUFFIXES)
#: Formats that hold several arrays by name, so that `key` means something.
KEYED_SUFFIXES: Final = (".exr", ".npz", *NETCDF_SUFFIXES)

#: Surfaces that VTK's readers open without harm when they are damaged: its legacy reader takes what lies in memory for
#: what is missing in the file. (glTF has another axis up, and volumes are no receivers.)
MESH_SUFFIXES: Final = (".obj", ".ply", ".stl", ".vtp")


def suffix(file: str) -> str:
    """Return the suffix of a file named in a scene, in lower case and with its dot ("" when it has none)."""
    return PurePath(file.rpartition(":")[2] if file.startswith(PREFIXES) else file).suffix.lower()
