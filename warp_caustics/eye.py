"""The steps that rasterize triangles into a G-buffer within a frame: what a camera, or the sun, sees first.

The same kernels as :func:`warp_caustics.g_buffer.rasterize_into`, as steps of a
:class:`~warp_caustics.sequence.Sequence`. Names of buffers have a prefix: ``eye.depth`` of the view ``eye.view``,
``ground.vertices`` of the mesh ``ground``.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from .errors import InputError
from .program import Buffer
from .sequence import Fill, Lane, Step, Upload
from .views import EyeView

if TYPE_CHECKING:
    from .g_buffer import Normals
    from .scene import Camera, Scene
    from .triangles import Triangles
    from .views import Projection


@dataclass(frozen=True)
class Rasterized:
    """Steps and buffers that fill a G-buffer, to be joined to a sequence's own."""

    steps: Lane
    buffers: tuple[Buffer, ...]
    uploads: Mapping[str, Callable[[str], Any]]


def rasterize_steps(
    view: str,
    mesh: str,
    counts: tuple[int, int],
    resolution: tuple[int, int],
    *,
    does: str,
    depth: bool = True,
    normals: Normals | None = None,
    ids: bool = False,
    into: str | None = None,
    shared: str | None = None,
) -> Rasterized:
    """Plan the launches that rasterize a mesh as a view sees it.

    Parameters
    ----------
    view : str
        Prefix: ``<view>.view`` is the array of :class:`~warp_caustics.kernels.views.View` that the sequence's ``views``
        or ``uploads`` bring, for points relative to the mesh's origin.
    mesh : str
        Prefix: ``<mesh>.vertices``, ``<mesh>.triangles`` and, where they are asked for, ``<mesh>.normals`` are buffers
        or uploads of the sequence.
    counts : (int, int)
        Vertices and triangles of the mesh.
    resolution : (int, int)
        Columns and rows of the view.
    does : str
        What it is for, in the words of the plan.
    depth, normals, ids
        Which G-buffers are made, as for :func:`warp_caustics.g_buffer.rasterize`; none leaves ``<into>.visibility`` for
        the caller to resolve.
    into : str, optional
        Prefix of the buffers that are made, ``<into>.depth``, ``.normal``, ``.id``; the view's if not given.
    shared : str, optional
        Name of the mesh's triangles where several meshes have the same; ``<mesh>.triangles`` if not given.

    Returns
    -------
    Rasterized
    """
    from .g_buffer import large_workers
    from .kernels.g_buffer import Resolve, resolve_kernel
    from .kernels.rasterize import MAX_LARGE, fill_large_kernel, fill_small_kernel, project_vertices_kernel
    from .kernels.visibility import EMPTY

    into = into or view
    (columns, rows), (vertices, triangles) = resolution, counts
    own = {name: f"{into}.{name}" for name in ("screen", "visibility", "large", "ends", "tally", "dropped", "workers")}
    bind: dict[str, str | None] = {
        **own, "view": f"{view}.view", "vertices": f"{mesh}.vertices", "triangles": shared or f"{mesh}.triangles",
        "normals": f"{mesh}.normals" if normals == "vertex" else None,
    }  # fmt: skip
    made = {"depth": depth, "normal": normals is not None, "id": ids}
    bind |= {name: f"{into}.{name}" if wanted else None for name, wanted in made.items()}
    spec = Resolve(depth=depth, normal=normals or "none", id=ids)
    capacity = min(triangles, MAX_LARGE)
    name = f"rasterize {into}"

    def step(kernel: Callable[[], Any], dim: tuple[int, ...] | Callable[[str], tuple[int, ...]]) -> Step:
        return Step(name, does, kernel, dim, bind)

    elements = {"depth": ("float32", 4), "normal": ("vec3", 12), "id": ("int32", 4)}
    return Rasterized(
        steps=(
            Fill(name, does, own["visibility"], EMPTY),
            Fill(name, does, own["tally"]),
            Fill(name, does, own["dropped"]),
            step(lambda: project_vertices_kernel, (vertices,)),
            step(lambda: fill_small_kernel, (triangles,)),
            step(lambda: fill_large_kernel, lambda device: (large_workers(device),)),
            *((step(lambda: resolve_kernel(spec), (rows, columns)),) if any(made.values()) else ()),
        ),
        buffers=(
            Buffer(own["screen"], "vec3", (vertices,), 12),
            Buffer(own["visibility"], "uint64", (rows, columns), 8),
            Buffer(own["large"], "int32", (capacity,), 4),
            Buffer(own["ends"], "int64", (capacity,), 8),
            Buffer(own["tally"], "uint64", (1,), 8),
            Buffer(own["dropped"], "int32", (2,), 4),
            *(
                Buffer(f"{into}.{name}", elements[name][0], (rows, columns), elements[name][1])
                for name, wanted in made.items()
                if wanted
            ),
        ),
        uploads={own["workers"]: large_workers},
    )


def camera_of(scene: Scene, method: str) -> Camera:
    """Return the camera that a method looks through.

    Raises
    ------
    InputError
        If the scene has none.
    """
    if scene.camera is None:
        raise InputError(
            f'method "{method}" needs a camera: it makes what an eye sees, and the scene has no [camera]; give it '
            "position, target, vertical_fov and resolution"
        )
    return scene.camera


def eye_view(camera: Camera) -> EyeView:
    """Return the view of a scene's camera."""
    return EyeView(camera.position, camera.target, camera.vertical_fov, camera.resolution)


def view_array(projection: Projection) -> Any:
    """Give the content of a ``<prefix>.view`` array, on the host."""
    import warp as wp

    from .g_buffer import device_view
    from .kernels.views import View

    return wp.array([device_view(projection)], dtype=View, device="cpu")


def mesh_uploads(prefix: str, counts: tuple[int, int], make: Callable[[str], Triangles]) -> dict[str, Upload]:
    """Uploads of a mesh of so many vertices and triangles; ``make`` puts it on a device and is called once.

    The parts of a mesh come from one call, so that what is uploaded twice is not made twice.
    """
    made = functools.cache(make)
    vertices, triangles = counts
    return {
        f"{prefix}.vertices": Upload(
            Buffer(f"{prefix}.vertices", "vec3", (vertices,), 12), lambda device: made(device).vertices
        ),
        f"{prefix}.triangles": Upload(
            Buffer(f"{prefix}.triangles", "vec3i", (triangles,), 12), lambda device: made(device).triangles
        ),
    }
