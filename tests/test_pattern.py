"""The projected pattern as a method: against NumPy from any camera, its shadows, its loop, what it leaves out."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from PIL import Image
from scenery import save_box, save_mesh, tables
from scenery import scene as scene_of

import warp_caustics as wc
from oracle import pattern as oracle
from warp_caustics.assets.textures import load_texture
from warp_caustics.errors import InputError
from warp_caustics.eye import eye_view
from warp_caustics.pattern_texture import TILE_PIXELS, mean_of_least, rendered_tile
from warp_caustics.scene import Camera, PatternSettings

# Float32 positions to 1e-6 of a metre, on a texture that changes by a texel in 0.1 m.
SEEN = 2e-4
FACE = 1e-4  # of the volume: pixels this near to a face may be taken for either side
EYE = {"position": [10.4, -8.0, 4.2], "target": [12.0, -3.1, 0.4], "vertical_fov": 40.0, "resolution": [45, 33]}
LEVELS = np.random.default_rng(3).integers(0, 256, (10, 14), dtype=np.uint8)
VOLUME = {"centre": [12.2, -3.0, 0.6], "size": [3.4, 2.8, 1.6], "rotation": 20.0}
TERRAIN = {"terrain": {"base": -1.5, "slope": [0.1, -0.15], "waves": [
    {"amplitude": 0.1, "wavevector": [2.0, 1.5], "phase": 0.3}]}}  # fmt: skip
SETTINGS: dict[str, Any] = {"scale": 1.4, "speed": 0.2, "strength": 1.3, "fade_radius": 0.3, "fade_strength": 0.6,
                            "luminance_strength": 0.6, "volume": VOLUME}  # fmt: skip
CALM = {"luminance_mask": "smoothstep"}
COLOURED = {"luminance_mask": "lerp", "split": 0.03, "blend": "overlay"}
LIGHT = (1.0, 0.9, 0.7)
WATER = {"ior": 1.34, "absorption": (0.3, 0.1, 0.02), "fresnel": True}


@pytest.fixture
def texture(tmp_path):
    """A picture of greys, whose top row is the file's first."""
    path = tmp_path / "texture.png"
    Image.fromarray(LEVELS).save(path)
    return str(path)


def linear(levels):
    """sRGB to light, row 0 at the bottom."""
    encoded = levels[::-1] / 255.0
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


def fitting(settings):
    """Leave out a strength that the mask does not take, which is refused."""
    if settings.get("luminance_mask", "shadow") in ("none", "shadow"):
        return {name: value for name, value in settings.items() if name != "luminance_strength"}
    return settings


def scene(texture, receiver=TERRAIN, more=None, **changed):
    """Terrain that rises from the water, seen by a camera, far from the world's origin."""
    return scene_of(
        receiver=receiver,
        origin=(10.0, -5.0),
        size=(4.0, 4.0),
        resolution=(16, 16),
        level=1.0,
        camera=EYE,
        method={"pattern": fitting({"texture": texture, **SETTINGS, **(more or {})})},
        **changed,
    )


def g_buffer(renderer, camera):
    """World points, normals on the side that is seen, and which pixels see ground."""
    arrays = renderer._recording.arrays
    points = eye_view(camera).projection().positions(arrays["eye.depth"].numpy())
    normals = arrays["eye.normal"].numpy().astype(np.float64)
    normals[((np.array(camera.position) - points) * normals).sum(axis=-1) < 0.0] *= -1.0
    return points, normals, np.isfinite(points[..., 0])


def expected(renderer, camera, time, lit=1.0):
    """What NumPy makes of the G-buffer, and the pixels that are not too near to a face of the volume."""
    what = renderer.plan.facts.scene
    given = what.method.pattern.model_dump()
    volume = given.pop("volume")
    given |= {**volume, "texture": linear(LEVELS), "sun": what.sun.direction, "level": what.water.level,
              "ior": what.medium.green_ior, "fresnel": what.medium.fresnel,
              "absorption": np.broadcast_to(what.medium.absorption, 3),
              "irradiance": np.broadcast_to(what.sun.irradiance, 3)}  # fmt: skip
    points, normals, ground = g_buffer(renderer, camera)
    box = oracle.object_space(points, volume["centre"], volume["size"], volume["rotation"])
    sure = ground & (np.abs(np.abs(box) - 0.5) > FACE).all(axis=-1)
    wanted = oracle.seen(np.where(ground[..., None], points, 0.0), normals, lit, time, given)
    return wanted, sure, (np.abs(box) < 0.5).all(axis=-1)


def assert_seen(renderer, camera, time, lit=1.0):
    """The frame is what NumPy computes, in and outside the volume, and black where there is no ground."""
    seen = renderer.render(time).screen_map.numpy()
    wanted, sure, inside = expected(renderer, camera, time, lit)
    if seen.ndim == 2:
        wanted = wanted[..., 0]
    assert (sure & inside).sum() > 50
    np.testing.assert_allclose(seen[sure], wanted[sure], atol=SEEN * np.nanmax(wanted[sure]))
    assert (seen[~np.isfinite(renderer._recording.arrays["eye.depth"].numpy())] == 0.0).all()
    return seen


def test_from_outside_and_inside_the_volume(device, texture):
    """By NumPy from both; and the middle pixel, which sees the same point from both, shows the same."""
    renderer = wc.Renderer(scene(texture, more=CALM), "pattern", device)
    outside = renderer.plan.facts.scene.camera
    way = np.array(EYE["target"]) - EYE["position"]
    inside = Camera(**{**EYE, "position": (np.array(EYE["position"]) + 0.75 * way).tolist()})
    middle = []
    for camera, within in ((outside, False), (inside, True)):
        at = oracle.object_space(np.array(camera.position), VOLUME["centre"], VOLUME["size"], VOLUME["rotation"])
        assert (np.abs(at) < 0.5).all() == within
        renderer.look_from(camera)
        middle.append(assert_seen(renderer, camera, 3.7)[16, 22])
    assert middle[0] > 0.0
    np.testing.assert_allclose(middle[0], middle[1], rtol=SEEN)


def test_colour_split_luminance_loss_and_overlay(device, texture):
    what = scene(texture, more=COLOURED, medium=WATER, sun={"irradiance": LIGHT})
    renderer = wc.Renderer(what, "pattern", device)
    seen = assert_seen(renderer, what.camera, 2.1)
    points, _, ground = g_buffer(renderer, what.camera)
    assert seen.shape == (33, 45, 3) and (seen[ground & (points[..., 2] > 1.5)] == 0.0).all()


def test_it_loops(device, texture):
    """Both layers have gone whole repeats after 4 / speed; after 1 / speed the first has not."""
    renderer = wc.Renderer(scene(texture, more=CALM), "pattern", device)
    frames = [renderer.render(time / SETTINGS["speed"]).screen_map.numpy().copy() for time in (0.0, 4.0, 1.0)]
    np.testing.assert_allclose(frames[1], frames[0], atol=SEEN * frames[0].max())
    assert np.abs(frames[2] - frames[0]).max() > 0.1 * frames[0].max()


BOX_AT, BOX = (12.0, -3.2), 1.3
"""Where a cube stands on the floor z = 0, and its side: it rises from a metre of water."""


def reaches_sun(points, sun, ior, side, dry=True):
    """Whether the cube of this side leaves the way to the sun free, by its slabs, in the water and (dry) above."""
    low = np.array([BOX_AT[0] - 0.5 * side, BOX_AT[1] - 0.5 * side, -1.0])
    high = np.array([BOX_AT[0] + 0.5 * side, BOX_AT[1] + 0.5 * side, side])

    def free(start, direction, length):
        with np.errstate(divide="ignore"):
            a, b = (low - start) / direction, (high - start) / direction
        enters, leaves = np.minimum(a, b).max(axis=-1), np.maximum(a, b).min(axis=-1)
        return ~((np.maximum(enters, 0.0) < leaves) & (enters < length))

    across = np.hypot(*sun[:2])
    below = np.array([*(sun[:2] / ior), -np.sqrt(1.0 - (across / ior) ** 2)])
    way = np.maximum(1.0 - points[..., 2], 0.0) / -below[2]
    above = free(points - way[..., None] * below, -sun, np.inf)
    return free(points, -below, way) & (above | (not dry))


@pytest.mark.parametrize("kind", ["objects", "mesh"])
def test_shadow_of_a_cube(device, texture, tmp_path, kind):
    """The shadow test against slabs, on the floor: all pixels but those at the shadow's edge; and the mask of it."""
    if kind == "objects":
        receiver = {"plane": 0.0, "objects": [{"mesh": save_box(tmp_path), "scale": BOX, "translate": (*BOX_AT, 0.0)}]}
    else:
        corner = [(x, y, 0.0) for y in (-5.0, -1.0) for x in (10.0, 14.0)]
        cube = [(BOX_AT[0] + BOX * x, BOX_AT[1] + BOX * y, BOX * z)
                for z in (0.0, 1.0) for y in (-0.5, 0.5) for x in (-0.5, 0.5)]  # fmt: skip
        faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (1, 3, 7, 5), (3, 2, 6, 7), (2, 0, 4, 6)]
        # All inside out: what counts is the side that is seen.
        faces = [face[::-1] for face in [(0, 1, 3, 2), *(tuple(4 + i for i in face) for face in faces)]]
        receiver = {"mesh": save_mesh(tmp_path, "whole", [*corner, *cube], faces)}
    what = scene(texture, receiver, more={"luminance_mask": "shadow"}, direction=(0.9, -0.6, -1.0))
    renderer = wc.Renderer(what, "pattern", device)
    renderer.render()
    lit = renderer._recording.arrays["lit"].numpy()
    points, _, ground = g_buffer(renderer, what.camera)
    floor = ground & (np.abs(points[..., 2]) < 1e-4)
    sun, ior = np.array(what.sun.direction), what.medium.green_ior
    more, less = (reaches_sun(points, sun, ior, BOX + spare) for spare in (0.01, -0.01))
    sure = floor & (more == less)
    # A good part is lit, a good part in the shadow, and not all of that by what stands in the water.
    drowned = reaches_sun(points, sun, ior, BOX, dry=False)
    assert min((sure & more).sum(), (sure & ~more).sum()) > 30 and (sure & ~more & drowned).sum() > 5
    assert (lit[sure] == more[sure]).all()
    assert_seen(renderer, what.camera, 0.0, lit)


def test_shadow_of_hills(device, texture):
    """Waves of ground under a low sun: against heights sampled along the refracted ray."""
    receiver = {"terrain": {"base": -0.2, "waves": [{"amplitude": 0.5, "wavevector": [4.0, 1.0], "phase": 0.5}]}}
    what = scene(texture, receiver, more={"luminance_mask": "shadow"}, direction=(0.9, 0.2, -0.35))
    what = what.at_resolution(96, 96)  # triangles that follow the ground
    renderer = wc.Renderer(what, "pattern", device)
    renderer.render()
    points, normals, ground = g_buffer(renderer, what.camera)
    sun, ior = np.array(what.sun.direction), what.medium.green_ior
    below = np.array([*(sun[:2] / ior), 0.0])
    below[2] = -np.sqrt(1.0 - below @ below)
    way = np.linspace(0.02, 4.0, 400)
    at = points[..., None, :] - way[:, None] * below
    height = -0.2 + 0.5 * np.sin(4.0 * at[..., 0] + at[..., 1] + 0.5)
    clearance = (at[..., 2] - height).min(axis=-1)
    sure = ground & (np.abs(clearance) > 0.02) & (-normals @ below > 0.05)
    free = clearance > 0.0
    lit = renderer._recording.arrays["lit"].numpy()
    assert (sure & free).sum() > 50 and (sure & ~free).sum() > 50
    assert (lit[sure] == free[sure]).all()


def test_what_is_not_asked_for_is_left_out(texture, tmp_path):
    """By the plan alone: no shadow test for the mask "none", nor where nothing can shade; no colours without light."""
    rock = {"plane": 0.0, "objects": [{"mesh": save_box(tmp_path), "translate": (*BOX_AT, 0.0)}]}
    for receiver, mask, shadow in ((rock, "shadow", True), (rock, "lerp", True), (rock, "none", False),
                                   (TERRAIN, "shadow", False), ({"plane": 0.0}, "lerp", False)):  # fmt: skip
        plan = wc.make_plan(scene(texture, receiver, more={"luminance_mask": mask}), "pattern", "cpu")
        assert ("shadow" in plan.kernels) == shadow
        assert ("lit" in {buffer.name for buffer in plan.buffers}) == shadow
        assert plan.kernels[-1] == "pattern" and plan.samples == 45 * 33
        seen = next(buffer for buffer in plan.buffers if buffer.name == "seen")
        assert seen.bytes == 4 * 45 * 33
    said = {reason.what: reason for reason in plan.reasons}
    assert not said["channel split"].kept and not said["waves"].kept and said["camera"].kept


def test_it_says_that_it_does_not_follow_the_water(texture):
    assert any("not looked at" in warning for warning in wc.make_plan(scene(texture), "pattern", "cpu").warnings)
    simulated = {"kind": "spectral", "resolution": [32, 32]}
    what = scene(texture, {"plane": 0.0}, simulation=simulated)
    assert wc.make_plan(what, "beam", "cpu").water_passes and not wc.make_plan(what, "pattern", "cpu").water_passes


@pytest.mark.parametrize(
    ("changed", "fault"),
    [
        ({"camera": None}, 'method "pattern" needs a camera'),
        (
            {"medium": {"ior": "sea", "dispersion": "traced"}},
            'medium.dispersion = "traced": method "pattern" refracts no',
        ),
        ({"method": {"pattern": {"split": 0.1}}}, "method.pattern.split: it makes colours"),
        ({"method": {"pattern": {"scale": 1e-40}}}, "method.pattern.scale: expected a number from 1e-06"),
        ({"method": {"accumulate": "fixed"}}, 'method.accumulate = "fixed": method "pattern" adds nothing up'),
        ({"method": {"pattern": {"texture": "nowhere.png"}}}, "method.pattern.texture: no such file"),
        ({"method": {"pattern": {"fade_strength": 1.0}}}, "method.pattern.fade_strength: expected a number from 0"),
        ({"method": {"pattern": {"volume": {"centre": [0, 0, 0], "size": [1, 0, 1]}}}}, "volume.size"),
        ({"method": {"pattern": {"texture": "nowhere.txt"}}}, "method.pattern.texture: expected a file that ends in"),
    ],
)
def test_what_it_refuses(texture, changed, fault):
    given = {key: value for key, value in {**tables(scene(texture)), **changed}.items() if value is not None}
    with pytest.raises(InputError, match=fault):
        wc.make_plan(wc.Scene(**given), "pattern", "cpu")


def test_textures_are_linear_light_with_row_0_at_the_bottom(tmp_path):
    """Colours of 8 bits by sRGB and their luminance; EXR and 16 bits as they are; what is no light is refused."""
    import OpenEXR

    colours = np.random.default_rng(6).integers(0, 256, (3, 5, 3), dtype=np.uint8)
    Image.fromarray(colours).save(tmp_path / "colours.png")
    decoded = np.stack([linear(colours[..., c]) for c in range(3)], axis=-1)
    np.testing.assert_allclose(load_texture(str(tmp_path / "colours.png")), decoded @ oracle.BT709, rtol=1e-3)
    deep = np.arange(15, dtype=np.uint16).reshape(3, 5) * 4000
    Image.fromarray(deep).save(tmp_path / "deep.png")
    np.testing.assert_array_equal(load_texture(str(tmp_path / "deep.png")), deep[::-1])
    light = np.random.default_rng(7).random((3, 3, 5)).astype(np.float32)
    for name, pixels in (("light", light), ("dark", 0.0 * light), ("negative", -light), ("holes", np.nan * light)):
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        with OpenEXR.File(header, dict(zip("RGB", pixels, strict=True))) as file:
            file.write(str(tmp_path / f"{name}.exr"))
        if name == "light":
            found = load_texture(str(tmp_path / "light.exr"))
            np.testing.assert_allclose(found, np.tensordot(oracle.BT709, light, 1)[::-1], rtol=1e-6)
        else:
            with pytest.raises(InputError, match="expected finite light"):
                load_texture(str(tmp_path / f"{name}.exr"))


def test_the_least_of_two_layers_has_a_mean_of_1():
    values = np.random.default_rng(4).random((5, 9)) ** 3
    np.testing.assert_allclose(mean_of_least(values), oracle.least_mean(values), rtol=1e-12)


def test_the_own_tile_has_no_seam(device):
    """Across its border it changes no more than inside, and a layer over another gives as much light as calm water."""
    tile = rendered_tile(device)
    assert tile.shape == (TILE_PIXELS, TILE_PIXELS)
    for axis in (0, 1):
        jumps = np.abs(np.diff(tile, axis=axis, append=np.take(tile, [0], axis=axis)))
        seam = np.take(jumps, [-1], axis=axis)
        assert 0.0 < seam.max() <= np.delete(jumps, -1, axis=axis).max()
        np.testing.assert_allclose(seam.mean(), jumps.mean(), rtol=0.5)
    np.testing.assert_allclose(tile.mean(), 1.0, rtol=1e-5)


def test_a_strength_that_no_mask_takes_is_refused():
    with pytest.raises(InputError, match='expected no luminance_strength with luminance_mask "shadow"'):
        PatternSettings(luminance_strength=0.3)
    assert PatternSettings(luminance_mask="lerp", luminance_strength=0.3).luminance_strength == 0.3


def test_it_moves_as_late_as_at_first(device, texture):
    """A step of the clock that float32 would not see at a million seconds."""
    renderer = wc.Renderer(scene(texture), "pattern", device)

    def moved(at):
        frames = [renderer.render(at + step).screen_map.numpy().copy() for step in (0.0, 1.0 / 60.0)]
        return np.abs(frames[1] - frames[0]).max()

    assert moved(1e6) > 0.2 * moved(0.0) > 0.0
