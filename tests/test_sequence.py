"""Sequences: launches by name, stages and lanes, fills, views that follow the camera, and what they refuse."""

from dataclasses import replace

import numpy as np
import pytest
import warp as wp
from scenery import scene as scene_of

import warp_caustics as wc
from warp_caustics import methods
from warp_caustics.errors import InputError, RenderError
from warp_caustics.eye import eye_view, mesh_uploads, rasterize_steps, view_array
from warp_caustics.g_buffer import rasterize
from warp_caustics.program import Buffer
from warp_caustics.scene import Camera
from warp_caustics.screen import receiver_meshes
from warp_caustics.sequence import Fill, Sequence, Step
from warp_caustics.triangles import mesh_triangles

EYE = {"position": [0.5, -1.0, 2.0], "target": [0.5, 0.5, 0.0], "vertical_fov": 50.0, "resolution": [24, 16]}


@wp.kernel(enable_backward=False)
def add_clock(clock: wp.array[wp.float64], amount: float, total_out: wp.array[float]):
    i = wp.tid()
    total_out[i] = total_out[i] + float(clock[0]) + amount


@wp.kernel(enable_backward=False)
def copy_depth(depth: wp.array2d[float], seen_out: wp.array[float]):
    row, column = wp.tid()
    seen_out[row * depth.shape[1] + column] = depth[row, column]


def counting(facts):
    """Each lane of a stage fills its own buffer; the stage after it adds to one of them."""
    pixels = int(np.prod(facts.scene.map.resolution))

    def lane(name):
        return (
            Fill("zero", "nothing yet", name, 1.0),
            Step("add", "adds", lambda: add_clock, (pixels,), {"total": name}),
        )

    return Sequence(
        stages=(
            (lane("left"), lane("right")),
            ((Step("add", "adds", lambda: add_clock, (pixels,), {"total": "left"}),),),
        ),
        buffers=(Buffer("left", "float32", (pixels,), 4), Buffer("right", "float32", (pixels,), 4)),
        caustic_map="left",
        values={"amount": 10.0},
        samples=pixels,
    )


def looking(facts):
    scene = facts.scene
    origin = (*scene.map.origin, scene.water.level)
    meshes = receiver_meshes(scene, facts.assets)
    counts = (sum(len(m.vertices) for m in meshes), sum(len(m.triangles) for m in meshes))
    columns, rows = scene.camera.resolution
    eye = rasterize_steps("eye", "ground", counts, (columns, rows), does="what the eye sees", normals="face")
    copy = Step("copy", "depth as it is", lambda: copy_depth, (rows, columns), {"depth": "eye.depth"})
    return Sequence(
        stages=(((*eye.steps, copy),),),
        buffers=(*eye.buffers, Buffer("seen", "float32", (rows * columns,), 4)),
        screen_map="seen",
        uploads={
            **eye.uploads,
            **mesh_uploads("ground", counts, lambda device: mesh_triangles(*meshes, origin=origin, device=device)),
        },
        views=lambda camera: {"eye.view": view_array(eye_view(camera).projection(origin))},
        samples=rows * columns,
    )


@pytest.fixture
def method(monkeypatch):
    """Let a sequence stand in for the photon method."""

    def use(made):
        monkeypatch.setitem(methods.METHODS, "photon", made)

    return use


def test_stages_lanes_and_fills_run_in_order(device, method):
    method(counting)
    renderer = wc.Renderer(scene_of(), "photon", device, threads=2)
    for time in (0.5, 2.0):
        frame = renderer.render(time)
        assert np.allclose(frame.caustic_map.numpy(), 1.0 + 2.0 * (time + 10.0))
    result = renderer.result()
    assert result.energy is None and result.screen_map is None and result.warnings == list(renderer.plan.warnings)
    assert renderer.plan.launches == 3 and renderer.plan.kernels == ("add",) and renderer._states == []
    assert "add" in str(renderer.plan) and renderer.plan.samples == result.caustic_map.size


def test_a_camera_is_rasterized_and_moved_without_a_new_renderer(device, method):
    method(looking)
    scene = scene_of(camera=EYE)
    renderer = wc.Renderer(scene, "photon", device)
    moved = Camera(**{**EYE, "position": [0.2, -0.4, 1.5]})
    for camera in (scene.camera, moved):
        renderer.look_from(camera)
        seen = renderer.render().screen_map.numpy()
        origin = (*scene.map.origin, scene.water.level)
        triangles = mesh_triangles(*receiver_meshes(scene, renderer.plan.facts.assets), origin=origin, device=device)
        assert np.array_equal(seen, rasterize(triangles, eye_view(camera)).depth.numpy())
    assert np.isfinite(seen).any()
    result = renderer.result()
    assert result.scene.camera == moved and wc.Renderer(scene, "photon", device).result().scene.camera == scene.camera
    assert result.caustic_map is None and result.surface_irradiance is None
    assert np.array_equal(result.screen_map, seen)
    assert next(reason for reason in renderer.plan.reasons if reason.what == "camera").kept


def test_what_a_moved_camera_cannot_be(device, method):
    method(looking)
    renderer = wc.Renderer(scene_of(camera=EYE), "photon", device)
    with pytest.raises(InputError, match=r"camera.resolution: expected \[24, 16\]"):
        renderer.look_from(Camera(**{**EYE, "resolution": [8, 8]}))
    with pytest.raises(InputError, match='"gather" does not look'):
        wc.Renderer(scene_of(camera=EYE), "gather", device).look_from(Camera(**EYE))


def test_a_name_that_nothing_has_is_said(device, method):
    method(lambda facts: replace(counting(facts), values={}))
    with pytest.raises(RenderError, match="nothing in the plan is called 'amount'"):
        wc.Renderer(scene_of(), "photon", device)


def test_what_a_camera_sees_is_saved_as_it_is(device, method, tmp_path):
    from PIL import Image

    method(looking)
    result = wc.render(scene_of(camera=EYE), "photon", device)
    with Image.open(result.save(tmp_path / "seen.png")) as picture:
        assert picture.size == (24, 16)
    result.save(tmp_path / "seen.exr")
    assert wc.load_map(tmp_path / "seen.exr").shape == (16, 24)


@pytest.mark.parametrize("name", ["cascaded", "pattern", "sample"])
def test_a_plan_counts_every_array_that_is_made(device, name):
    renderer = wc.Renderer(scene_of(camera=EYE), name, device)
    planned = {buffer.name: buffer.bytes for buffer in renderer.plan.program.own_buffers(renderer.plan.facts)}
    made = {name: array for name, array in renderer._recording.arrays.items() if isinstance(array, wp.array)}
    views = {name for name in made if name.endswith(".view")}  # a few numbers each
    assert {name: array.size * wp.types.type_size_in_bytes(array.dtype) for name, array in made.items()
            if name not in views} == planned  # fmt: skip
