"""G-buffers of planes, lattices and meshes: depth, normals, ids, buffers left out, captured frames, bad input."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import warp as wp

from warp_caustics.errors import InputError
from warp_caustics.g_buffer import GBuffer, make_scratch, rasterize, rasterize_into, set_view
from warp_caustics.kernels.g_buffer import Resolve, resolve_kernel
from warp_caustics.kernels.visibility import key_depth, key_triangle, visibility_key
from warp_caustics.triangles import Lattice, Triangles, lattice_triangles, lift_lattice, mesh_triangles
from warp_caustics.views import EyeView, LightView

# The corners of a plane are rounded to 1/8192 pixel sideways, and its depths to float32: millimetre pixels, metres.
PLANE_TOLERANCE = 1e-5
# Interpolated normals at a corner rounded to float32: a few 1e-4 pixel of a triangle that is pixels wide.
NORMAL_TOLERANCE = 1e-3

LATTICE = Lattice(24, 16, origin=(100.0, -50.0), size=(3.0, 2.0), level=2.0)
VIEWS = {
    "light": LightView((0.3, 0.2, -1.0), (100.0, -50.0, 1.5), (103.0, -48.0, 2.5), (60, 44)),
    "eye": EyeView((101.5, -52.0, 4.0), (101.5, -49.0, 2.0), 50.0, (60, 44)),
}


def sloping(device):
    """The lattice as a plane of slope (0.1, -0.05) with its normals."""
    triangles = lattice_triangles(LATTICE, device, normals=True)
    y, x = np.meshgrid(np.linspace(0, 2, 17), np.linspace(0, 3, 25), indexing="ij")
    heights = (0.1 * x - 0.05 * y).astype(np.float32)
    lift_lattice(LATTICE, wp.array(heights, dtype=wp.float32, device=device), triangles)
    normal = np.array([-0.1, 0.05, 1.0]) / np.linalg.norm([-0.1, 0.05, 1.0])
    triangles.normals.fill_(wp.vec3(*normal))
    return triangles, normal


def analytic_depth(view, triangles):
    """Depth of the plane z = level + 0.1 x - 0.05 y at every pixel, by its ray in float64."""
    projection = view.projection(triangles.origin)
    columns, rows = projection.resolution
    start, end = (
        projection.positions(np.full((rows, columns), 1.0)),
        projection.positions(np.full((rows, columns), 2.0)),
    )
    across = np.array([-0.1, 0.05, 1.0])
    above = (start - triangles.origin) @ across
    return 1.0 + above / ((start - end) @ across)


@pytest.mark.parametrize("normals", ["face", "vertex"])
@pytest.mark.parametrize("name", list(VIEWS))
def test_a_plane_has_its_depth_its_normal_and_its_cells(device, name, normals):
    triangles, normal = sloping(device)
    view = VIEWS[name]
    picture = rasterize(triangles, view, normals=normals)
    depth, ids = picture.depth.numpy(), picture.id.numpy()
    seen = ids >= 0
    assert 0.2 < seen.mean() < 1.0
    np.testing.assert_allclose(depth[seen], analytic_depth(view, triangles)[seen], rtol=PLANE_TOLERANCE)
    assert np.isposinf(depth[~seen]).all()
    np.testing.assert_allclose(picture.normal.numpy()[seen], np.broadcast_to(normal, (seen.sum(), 3)), atol=2e-5)
    assert (picture.normal.numpy()[~seen] == 0.0).all()
    # The id names the cell in which the pixel's position lies, but for positions on a cell's edge.
    place = (view.projection(triangles.origin).positions(depth)[seen] - triangles.origin)[:, :2] * 8.0
    inner = (np.abs(place - np.round(place)) > 1e-3).all(axis=1)
    cell = np.floor(place).astype(int)
    np.testing.assert_array_equal((ids[seen] // 2)[inner], (cell[:, 1] * 24 + cell[:, 0])[inner])
    right = (place - cell)[:, 0] > (place - cell)[:, 1]
    inner &= np.abs((place - cell)[:, 0] - (place - cell)[:, 1]) > 1e-3
    np.testing.assert_array_equal((ids[seen] % 2 == 0)[inner], right[inner])


def test_normals_between_corners_are_perspective_correct(device):
    # A wall that leaves the eye, cut by the near plane; normals that vary linearly along it before normalisation.
    vertices = np.array([[1, -2, -3], [1, 9, -3], [1, -2, 3], [1, 9, 3]], dtype=np.float32)
    normals = np.array([[1, -0.2, 0], [1, 0.9, 0], [1, -0.2, 0], [1, 0.9, 0]])  # (1, 0.1 y, 0)
    triangles = Triangles(
        wp.array(vertices, dtype=wp.vec3, device=device),
        wp.array([[0, 1, 3], [0, 3, 2]], dtype=wp.vec3i, device=device),
        (0.0, 0.0, 0.0),
        wp.array(normals, dtype=wp.vec3, device=device),
    )
    eye = EyeView((0, 0, 0), (1, 3, 0), 80.0, (50, 40))
    picture = rasterize(triangles, eye, normals="vertex")
    seen = picture.id.numpy() >= 0
    y = eye.projection().positions(picture.depth.numpy())[seen][:, 1]
    expected = np.stack([np.ones_like(y), 0.1 * y, np.zeros_like(y)], -1)
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    assert np.ptp(y) > 5.0
    np.testing.assert_allclose(picture.normal.numpy()[seen], expected, atol=NORMAL_TOLERANCE)


def test_two_meshes_are_one_and_far_origins_change_nothing(device):
    def boxlike(x, z):
        return SimpleNamespace(
            vertices=np.array([[x, 0, z], [x + 2, 0, z], [x, 2, z], [x + 2, 2, z]], dtype=float),
            triangles=np.array([[0, 1, 2], [1, 3, 2]], dtype=np.int32),
        )

    view = LightView((0, 0, -1), (0, 0, 0), (4, 2, 2), (16, 8))
    here = rasterize(mesh_triangles(boxlike(0, 1), boxlike(1, 2), origin=(0, 0, 0), device=device), view)
    ids = here.id.numpy()
    assert set(np.unique(ids[:, :4])) == {0, 1}
    assert set(np.unique(ids[:, 4:12])) == {2, 3}
    assert (ids[:, 12:] == -1).all()
    np.testing.assert_array_equal(here.depth.numpy()[:, 4:12], 0.0)
    np.testing.assert_array_equal(here.depth.numpy()[:, :4], 1.0)
    far = LightView((0, 0, -1), (1e5, 0, 0), (1e5 + 4, 2, 2), (16, 8))
    there = rasterize(mesh_triangles(boxlike(1e5, 1), boxlike(1e5 + 1, 2), origin=(1e5, 0, 0), device=device), far)
    np.testing.assert_array_equal(there.id.numpy(), ids)
    np.testing.assert_array_equal(there.depth.numpy(), here.depth.numpy())


@pytest.mark.parametrize(
    "asked", [{"depth": True}, {"ids": True}, {"normals": "face"}, {"depth": True, "ids": True, "normals": "vertex"}]
)
def test_buffers_that_nobody_asked_for_are_left_out(device, asked):
    triangles, _ = sloping(device)
    picture = rasterize(triangles, VIEWS["eye"], **{"depth": False, "ids": False, **asked})
    everything = rasterize(triangles, VIEWS["eye"], normals=asked.get("normals", "face"))
    for name, key in (("depth", "depth"), ("normal", "normals"), ("id", "ids")):
        array = getattr(picture, name)
        assert (array is not None) == bool(asked.get(key))
        if array is not None:
            np.testing.assert_array_equal(array.numpy(), getattr(everything, name).numpy())


def test_resolve_kernels_are_built_once():
    assert resolve_kernel(Resolve()) is resolve_kernel(Resolve())
    assert resolve_kernel(Resolve()) is not resolve_kernel(Resolve(id=False))


@wp.kernel(enable_backward=False)
def key_kernel(
    depths: wp.array[float], keys_out: wp.array[wp.uint64], back_out: wp.array[float], ids_out: wp.array[int]
):
    i = wp.tid()
    keys_out[i] = visibility_key(depths[i], i)
    back_out[i] = key_depth(keys_out[i])
    ids_out[i] = key_triangle(keys_out[i])


def test_keys_order_as_depths_do(device):
    depths = np.array([-np.inf, -3e38, -2.5, -1e-40, 0.0, 1e-40, 0.5, 3e38, np.inf, -0.0], dtype=np.float32)
    keys = wp.zeros(10, dtype=wp.uint64, device=device)
    back, ids = wp.zeros(10, dtype=float, device=device), wp.zeros(10, dtype=int, device=device)
    wp.launch(
        key_kernel,
        dim=10,
        inputs=[wp.array(depths, dtype=float, device=device)],
        outputs=[keys, back, ids],
        device=device,
    )
    codes = keys.numpy()
    assert (np.diff(codes[:9].astype(object)) > 0).all()
    assert codes[9] >> np.uint64(32) == codes[4] >> np.uint64(32)  # one zero
    np.testing.assert_array_equal(back.numpy(), depths)
    np.testing.assert_array_equal(ids.numpy(), np.arange(10))


def test_a_captured_frame_follows_the_view_and_the_heights(device):
    triangles, _ = sloping(device)
    heights = wp.zeros(LATTICE.corners, dtype=wp.float32, device=device)
    first, second = VIEWS["eye"], EyeView((101.0, -51.0, 3.5), (102.0, -49.0, 2.0), 60.0, (60, 44))
    scratch = make_scratch(triangles, first.projection(triangles.origin))
    picture = rasterize(triangles, first, normals="face")

    def frame():
        lift_lattice(LATTICE, heights, triangles)
        rasterize_into(picture, triangles, scratch)

    frame()
    graph = None
    if wp.get_device(device).is_cuda:
        with wp.ScopedCapture(device=device) as capture:
            frame()
        graph = capture.graph
    set_view(scratch, second.projection(triangles.origin))
    heights.fill_(0.125)
    wp.capture_launch(graph) if graph else frame()
    expected = rasterize(triangles, second, normals="face")
    np.testing.assert_array_equal(picture.id.numpy(), expected.id.numpy())
    np.testing.assert_array_equal(picture.depth.numpy(), expected.depth.numpy())
    np.testing.assert_array_equal(picture.normal.numpy(), expected.normal.numpy())
    assert triangles.vertices.numpy()[:, 2] == pytest.approx(0.125)


def test_a_frame_allocates_nothing(device, monkeypatch):
    triangles, _ = sloping(device)
    view = VIEWS["light"]
    picture = rasterize(triangles, view)
    scratch = make_scratch(triangles, view.projection(triangles.origin))

    def refuse(*_args, **_kwargs):
        raise AssertionError("an array was made")

    with monkeypatch.context() as patch:
        patch.setattr(wp.array, "__init__", refuse)
        with pytest.raises(AssertionError):
            wp.zeros(1, dtype=float, device=device)
        rasterize_into(picture, triangles, scratch)
    assert scratch.bytes == 60 * 44 * 8 + 768 * 12 + 425 * 12 + 8 + 8 + scratch.view.strides[0]


def test_indices_that_name_no_vertex_are_dropped_and_counted(device):
    triangles = Triangles(
        wp.array([[0, 0, 0], [4, 0, 0], [0, 2, 0]], dtype=wp.vec3, device=device),
        wp.array([[0, 1, 3], [-1, 1, 2], [0, 1, 2], [0, 1, 1 << 30]], dtype=wp.vec3i, device=device),
        (0.0, 0.0, 0.0),
    )
    view = LightView((0, 0, -1), (0, 0, 0), (4, 2, 2), (16, 8))
    scratch = make_scratch(triangles, view.projection())
    picture = rasterize(triangles, view)
    rasterize_into(picture, triangles, scratch)
    assert (scratch.dropped().bad_index, scratch.dropped().not_finite) == (3, 0)
    assert set(np.unique(picture.id.numpy())) == {-1, 2}


def test_what_the_kernels_would_crash_on_is_refused():
    triangles, _ = sloping("cpu")
    view = VIEWS["eye"]
    scratch = make_scratch(triangles, view.projection(triangles.origin))
    picture = rasterize(triangles, view)
    small = wp.zeros((3, 3), dtype=float, device="cpu")
    bare = replace(triangles, normals=None)
    other = lattice_triangles(Lattice(2, 2, (0, 0), (1, 1)), "cpu")
    for message, call in (
        ("shape", lambda: rasterize_into(GBuffer(small, None, None), triangles, scratch)),
        ("wants float32", lambda: rasterize_into(GBuffer(picture.id, None, None), triangles, scratch)),
        ("holds nothing", lambda: rasterize_into(GBuffer(None, None, None), triangles, scratch)),
        ("bring normals", lambda: rasterize(bare, view, normals="vertex")),
        ("'face' or 'vertex'", lambda: rasterize(triangles, view, normals="smooth")),
        ("scratch.screen", lambda: rasterize_into(picture, other, scratch)),
        ("NoneType", lambda: rasterize_into(picture, triangles, replace(scratch, tally=None))),
        ("pixels", lambda: set_view(scratch, replace(view, resolution=(8, 8)).projection())),
        ("heights", lambda: lift_lattice(LATTICE, small, triangles)),
        ("cells", lambda: Lattice(0, 1, (0, 0), (1, 1))),
        ("positive size", lambda: Lattice(1, 1, (0, 0), (1, 0))),
        ("NoneType", lambda: Triangles(None, triangles.triangles, (0, 0, 0))),
        ("no triangles", lambda: replace(triangles, triangles=wp.empty(0, dtype=wp.vec3i, device="cpu"))),
        ("no meshes", lambda: mesh_triangles(origin=(0, 0, 0), device="cpu")),
    ):
        with pytest.raises(InputError, match=message):
            call()


@pytest.mark.parametrize(
    ("vertices", "triangles"),
    [
        (np.zeros((3, 2)), [[0, 1, 2]]),
        (np.zeros((3, 3)), np.zeros((0, 3), int)),
        (np.zeros((3, 3)), [[0, 1, 3]]),
        (np.zeros((3, 3)), [[0, -1, 2]]),
        (np.zeros((3, 3)), [[0.0, 1.0, 2.0]]),
    ],
)
def test_bad_meshes_are_refused(vertices, triangles):
    mesh = SimpleNamespace(vertices=vertices, triangles=np.asarray(triangles))
    with pytest.raises(InputError, match="mesh 0"):
        mesh_triangles(mesh, origin=(0, 0, 0), device="cpu")
