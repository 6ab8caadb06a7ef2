"""Rasterization into G-buffers, in two tiers: :func:`rasterize` allocates, :func:`rasterize_into` fills your arrays."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
import warp as wp

from warp_caustics.errors import InputError
from warp_caustics.kernels.g_buffer import Resolve, resolve_kernel
from warp_caustics.kernels.rasterize import (
    BAD_INDEX,
    MAX_LARGE,
    NOT_FINITE,
    fill_large_kernel,
    fill_small_kernel,
    project_vertices_kernel,
)
from warp_caustics.kernels.views import View as DeviceView
from warp_caustics.kernels.visibility import EMPTY
from warp_caustics.triangles import Triangles, check_array
from warp_caustics.views import MAX_RESOLUTION, Projection, View

Normals = Literal["face", "vertex"]

# Threads that share the blocks of large triangles: about what the largest GPU keeps in flight. The CPU runs one at a
# time, and each looks at the list once.
LARGE_WORKERS_CUDA = 1 << 17
LARGE_WORKERS_CPU = 1
# Stands for "no near plane" on the device; finite, so that a distance to it is too.
_NO_NEAR = float(np.finfo(np.float32).min)


@dataclass(frozen=True)
class GBuffer:
    """What each pixel of a view sees first; ``[row, column]``, row 0 at the bottom. None: not asked for.

    Attributes
    ----------
    depth : wp.array2d of float32
        Depth along the view direction [m]; inf where there is nothing. ``Projection.positions`` and the device
        function ``kernels.views.unproject`` turn it into positions.
    normal : wp.array2d of vec3
        Unit normal, on the side from which the triangle runs anticlockwise, whichever side is seen; zero where there
        is nothing.
    id : wp.array2d of int32
        Index of the triangle; -1 where there is nothing.
    """

    depth: wp.array | None
    normal: wp.array | None
    id: wp.array | None


@dataclass(frozen=True)
class Dropped:
    """Triangles that were left out because they cannot be drawn."""

    not_finite: int
    bad_index: int


@dataclass(frozen=True)
class Scratch:
    """What rasterization needs besides its input and output; made once by :func:`make_scratch`, used each frame."""

    view: wp.array  # of View [1]
    screen: wp.array  # of vec3 [vertices]: homogeneous pixels
    visibility: wp.array  # of uint64 [rows, columns]
    large: wp.array  # of int32: the large triangles
    ends: wp.array  # of int64: how many blocks of large triangles there are up to each
    tally: wp.array  # of uint64 [1]
    dropped_counts: wp.array  # of int32 [2]

    @property
    def bytes(self) -> int:
        """Bytes of all arrays."""
        return sum(array.size * wp.types.type_size_in_bytes(array.dtype) for array in vars(self).values())

    def dropped(self) -> Dropped:
        """Count what the last frame left out; reads back, and so waits for the device."""
        counts = self.dropped_counts.numpy()
        return Dropped(not_finite=int(counts[int(NOT_FINITE)]), bad_index=int(counts[int(BAD_INDEX)]))


def make_scratch(triangles: Triangles, projection: Projection) -> Scratch:
    """Allocate what :func:`rasterize_into` needs, on the device of the triangles, and set its view."""
    device = wp.get_device(triangles.vertices.device)
    columns, rows = projection.resolution
    capacity = min(triangles.triangles.size, MAX_LARGE)
    scratch = Scratch(
        view=wp.zeros(1, dtype=DeviceView, device=device),
        screen=wp.empty(triangles.vertices.size, dtype=wp.vec3, device=device),
        visibility=wp.empty((rows, columns), dtype=wp.uint64, device=device),
        large=wp.empty(capacity, dtype=wp.int32, device=device),
        ends=wp.empty(capacity, dtype=wp.int64, device=device),
        tally=wp.zeros(1, dtype=wp.uint64, device=device),
        dropped_counts=wp.zeros(2, dtype=wp.int32, device=device),
    )
    set_view(scratch, projection)
    return scratch


def set_view(scratch: Scratch, projection: Projection) -> None:
    """Put a view into its device struct, so that a captured frame can be replayed for another sun or eye."""
    columns, rows = projection.resolution
    if scratch.visibility.shape != (rows, columns):
        raise InputError(
            f"the view has {columns} x {rows} pixels, the buffers {scratch.visibility.shape[1]} x "
            f"{scratch.visibility.shape[0]}"
        )
    scratch.view.assign([device_view(projection)])


def device_view(projection: Projection) -> DeviceView:
    """Make the kernels' form of a projection."""
    view = DeviceView()
    view.matrix = wp.mat33d(*projection.matrix.ravel())
    view.offset = wp.vec3d(*projection.offset)
    view.inverse = wp.mat33d(*np.linalg.inv(projection.matrix).ravel())
    view.w_of_depth, view.w_constant = (1.0, 0.0) if projection.perspective else (0.0, 1.0)
    view.near = projection.near if math.isfinite(projection.near) else _NO_NEAR
    return view


def rasterize_into(g_buffer: GBuffer, triangles: Triangles, scratch: Scratch, normals: Normals = "face") -> None:
    """Rasterize triangles, as the view in ``scratch`` sees them, into the arrays of ``g_buffer`` that are not None.

    Allocates nothing and reads nothing back, so that it can be captured as a CUDA graph once it has run (the first run
    compiles). The nearest triangle wins, the lowest index among equals; both sides of a triangle are seen.

    Parameters
    ----------
    g_buffer : GBuffer
        Arrays [rows, columns] of the view; written.
    triangles : Triangles
    scratch : Scratch
        From :func:`make_scratch`, for as many triangles, vertices and pixels.
    normals : {"face", "vertex"}
        Where ``g_buffer.normal`` comes from: the planes of the triangles, or ``triangles.normals`` interpolated.

    Raises
    ------
    InputError
        An array has another type, shape or device, or normals are asked for that the triangles do not have.
    """
    spec = _check(g_buffer, triangles, scratch, normals)
    _fill(triangles, scratch)
    wp.launch(
        resolve_kernel(spec),
        dim=scratch.visibility.shape,
        inputs=[
            0,
            scratch.view,
            scratch.visibility,
            triangles.triangles,
            triangles.vertices,
            scratch.screen,
            triangles.normals,
        ],
        outputs=[g_buffer.depth, g_buffer.normal, g_buffer.id],
        device=triangles.vertices.device,
    )


def _fill(triangles: Triangles, scratch: Scratch) -> None:
    """Fill the visibility buffer."""
    device = wp.get_device(triangles.vertices.device)
    scratch.visibility.fill_(EMPTY)
    scratch.tally.zero_()
    scratch.dropped_counts.zero_()
    wp.launch(
        project_vertices_kernel,
        dim=scratch.screen.size,
        inputs=[0, scratch.view, triangles.vertices],
        outputs=[scratch.screen],
        device=device,
    )
    wp.launch(
        fill_small_kernel,
        dim=triangles.triangles.size,
        inputs=[scratch.view, scratch.screen, triangles.triangles],
        outputs=[scratch.visibility, scratch.large, scratch.ends, scratch.tally, scratch.dropped_counts],
        device=device,
    )
    workers = large_workers(str(device))
    wp.launch(
        fill_large_kernel,
        dim=workers,
        inputs=[
            scratch.view,
            scratch.screen,
            triangles.triangles,
            scratch.large,
            scratch.ends,
            scratch.tally,
            workers,
        ],
        outputs=[scratch.visibility],
        device=device,
    )


def large_workers(device: str) -> int:
    """Count the threads that share the blocks of large triangles on a device."""
    return LARGE_WORKERS_CPU if device == "cpu" else LARGE_WORKERS_CUDA


def rasterize(
    triangles: Triangles, view: View, *, depth: bool = True, normals: Normals | None = None, ids: bool = True
) -> GBuffer:
    """Rasterize triangles into G-buffers that are allocated here; what is not asked for is neither made nor computed.

    Parameters
    ----------
    triangles : Triangles
    view : LightView or EyeView
    depth, ids : bool
        Ask for depth, and for the index of the triangle.
    normals : {"face", "vertex"}, optional
        Ask for normals: those of the triangles' planes, or ``triangles.normals`` interpolated.

    Examples
    --------
    >>> lattice = Lattice(256, 256, origin=(0.0, 0.0), size=(4.0, 4.0), level=2.0)
    >>> water = lattice_triangles(lattice, device="cpu")
    >>> eye = EyeView((2.0, -1.5, 3.2), (2.0, 2.0, 2.0), vertical_fov=50.0, resolution=(640, 360))
    >>> picture = rasterize(water, eye, normals="face")
    """
    device = wp.get_device(triangles.vertices.device)
    projection = view.projection(triangles.origin)
    scratch = make_scratch(triangles, projection)
    shape = scratch.visibility.shape
    g_buffer = GBuffer(
        depth=wp.empty(shape, dtype=wp.float32, device=device) if depth else None,
        normal=wp.empty(shape, dtype=wp.vec3, device=device) if normals else None,
        id=wp.empty(shape, dtype=wp.int32, device=device) if ids else None,
    )
    rasterize_into(g_buffer, triangles, scratch, normals or "face")
    return g_buffer


def _check(g_buffer: GBuffer, triangles: Triangles, scratch: Scratch, normals: str) -> Resolve:
    """Refuse what the kernels would crash on, and say what they are to write."""
    device = wp.get_device(triangles.vertices.device)
    shape = scratch.visibility.shape
    if max(shape) > MAX_RESOLUTION:
        raise InputError(f"a picture of {shape[1]} x {shape[0]} pixels is over {MAX_RESOLUTION}")
    capacity = (min(triangles.triangles.size, MAX_LARGE),)
    check_array("scratch.view", scratch.view, DeviceView, (1,), device)
    check_array("scratch.screen", scratch.screen, wp.vec3, triangles.vertices.shape, device)
    check_array("scratch.visibility", scratch.visibility, wp.uint64, shape, device)
    check_array("scratch.large", scratch.large, wp.int32, capacity, device)
    check_array("scratch.ends", scratch.ends, wp.int64, capacity, device)
    check_array("scratch.tally", scratch.tally, wp.uint64, (1,), device)
    check_array("scratch.dropped_counts", scratch.dropped_counts, wp.int32, (2,), device)
    for name, dtype in (("depth", wp.float32), ("normal", wp.vec3), ("id", wp.int32)):
        if getattr(g_buffer, name) is not None:
            check_array(f"g_buffer.{name}", getattr(g_buffer, name), dtype, shape, device)
    if normals not in ("face", "vertex"):
        raise InputError(f"normals is {normals!r}; it wants 'face' or 'vertex'")
    if g_buffer.depth is None and g_buffer.normal is None and g_buffer.id is None:
        raise InputError("a G-buffer without depth, normal and id holds nothing; ask for one of them")
    if g_buffer.normal is not None and normals == "vertex" and triangles.normals is None:
        raise InputError("normals = 'vertex' wants triangles that bring normals of their vertices")
    wanted = normals if g_buffer.normal is not None else "none"
    return Resolve(depth=g_buffer.depth is not None, normal=wanted, id=g_buffer.id is not None)
