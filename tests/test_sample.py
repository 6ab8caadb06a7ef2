"""The method ``sample`` as a whole: what it makes of a scene, what it leaves out, and what it refuses."""

from __future__ import annotations

from importlib import import_module

import numpy as np
import pytest
from PIL import Image
from scenery import GENTLE, bundled, render, save_heights, save_quad, scene, tables, wave

import warp_caustics as wc
from warp_caustics.errors import InputError
from warp_caustics.scene import SampleSettings

# Of an intensity: the water's height is known to 1e-8 m, its slope to 1e-6, and the environment map's power of 512
# multiplies that by some hundred.
INTENSITY = 1e-3
FLOAT32 = 1e-6


def with_sample(**settings):
    return {"name": "sample", "sample": settings}


def test_pool(device):
    result = render(bundled("pool", (64, 64)), "sample", device)
    down = -result.scene.sun.unit_direction[2]
    intensity = result.caustic_map / down
    assert result.caustic_map.shape == (64, 64) and result.energy is None
    assert intensity.min() >= 0.0 and intensity.max() <= 1.0 + FLOAT32
    # A bright web on a dark ground, as in figure 7: half of it is dark, and some of it is bright;
    # the blur of a pixel takes more of the bright lines here than on a map of full size.
    assert np.median(intensity) < 0.35 and np.percentile(intensity, 99) > 0.55


def test_a_sequence_of_plain_passes(device):
    renderer = wc.Renderer(bundled("pool", (24, 20)), "sample", device)
    plan = renderer.plan
    assert plan.kernels == ("heights", "normals", "sample", "blur", "scale")
    names = {buffer.name for buffer in plan.buffers}
    assert names == {"height", "normal", "caustic", "blurred", "caustic_map", "suns", "waves"}
    assert plan.settings["ground_offset"] == 2.0
    left_out = {reason.what: reason.why for reason in plan.reasons if not reason.kept}
    assert {"refraction", "sun's direction", "environment image", "energy ledger"} <= left_out.keys()
    assert "Snell" in str(plan)


def test_time_moves_the_water(device):
    renderer = wc.Renderer(scene(GENTLE, resolution=(24, 16)), "sample", device)
    first, later, again = (renderer.render(time).caustic_map.numpy().copy() for time in (0.0, 0.7, 0.0))
    assert np.array_equal(first, again) and np.abs(first - later).max() > 0.05


def test_threads_and_bands_change_nothing(device):
    water = scene(GENTLE, resolution=(16, 5))  # fewer rows than bands
    assert np.array_equal(
        render(water, "sample", device).caustic_map, render(water, "sample", device, threads=4).caustic_map
    )


def test_without_blur_there_is_no_pass(device):
    water = scene(GENTLE, resolution=(24, 16), method=with_sample(blur_radius=0))
    renderer = wc.Renderer(water, device=device)
    assert "blur" not in renderer.plan.kernels and "blurred" not in renderer._recording.arrays
    sharp = renderer.render().caustic_map.numpy()
    blurred = render(
        scene(GENTLE, resolution=(24, 16), method=with_sample(blur_radius=2)), "sample", device
    ).caustic_map
    window = np.lib.stride_tricks.sliding_window_view(np.pad(sharp, 2, mode="symmetric"), (5, 5))
    np.testing.assert_allclose(blurred, window.mean(axis=(2, 3)), atol=FLOAT32)


def test_flat_water_is_uniform(device):
    settings = with_sample(sample_steps=2, base_intensity=0.25)
    result = render(scene(direction=(0.0, 0.0, -1.0), method=settings), "sample", device)
    offsets = np.array([(x, y) for x in (-0.5, 0.0, 0.5) for y in (-0.5, 0.0, 0.5) if x or y])
    expected = 0.25 * ((1.0 - np.hypot(*offsets.T)) ** 4).sum()
    np.testing.assert_allclose(result.caustic_map, expected, atol=INTENSITY)


def test_irradiance_on_the_horizontal_by_colour(device):
    def water(**sun):
        return scene(GENTLE, direction=(0.6, 0.0, -0.8), resolution=(24, 16), sun=sun)

    grey = render(water(), "sample", device).caustic_map
    colour = render(water(irradiance=[1.0, 0.5, 3.0]), "sample", device).caustic_map
    assert colour.shape == (16, 24, 3)
    np.testing.assert_allclose(colour, grey[..., None] * [1.0, 0.5, 3.0], rtol=FLOAT32)
    # The published sun stands overhead: where the scene's own stands changes the brightness alone.
    overhead = scene(GENTLE, direction=(0.0, 0.0, -1.0), resolution=(24, 16))
    np.testing.assert_allclose(grey, 0.8 * render(overhead, "sample", device).caustic_map, rtol=1e-5)


def test_symmetric_water_gives_a_symmetric_map(device):
    # Waves whose crests run along y, even about the middle of the map: every face mirrors onto a face.
    even = [wave(0.01, k, 0.0, np.pi / 2.0 - k) for k in (3.0, 7.0, 11.0)]
    across = render(scene(even, size=(2.0, 2.0), resolution=(32, 32)), "sample", device).caustic_map
    assert across.std() > 0.05
    np.testing.assert_allclose(across, across[:, ::-1], atol=INTENSITY)
    # Water that is the same with x and y exchanged, as the diagonals of the mesh are.
    pairs = [wave(0.01, *k, 0.3) for k in ((3.0, 5.0), (5.0, 3.0), (-7.0, 2.0), (2.0, -7.0))]
    diagonal = render(scene(pairs, size=(2.0, 2.0), resolution=(32, 32)), "sample", device).caustic_map
    assert diagonal.std() > 0.05
    np.testing.assert_allclose(diagonal, diagonal.T, atol=INTENSITY)


def test_an_image_is_the_environment(device, tmp_path, monkeypatch):
    ramp = np.linspace(0.0, 1.0, 64)
    image = np.minimum.outer(ramp, ramp)
    Image.fromarray((255.0 * image).round().astype(np.uint8)).save(tmp_path / "sky.png")
    colours = np.zeros((64, 64, 3), dtype=np.uint8)
    colours[..., 0] = (255.0 * image).round()
    Image.fromarray(colours).save(tmp_path / "red.png")
    Image.fromarray((65535.0 * image).round().astype(np.uint16)).save(tmp_path / "deep.png")

    def through(file):
        settings = with_sample(environment=str(tmp_path / file), base_intensity=0.2)
        return scene(GENTLE, resolution=(24, 16), method=settings)

    renderer = wc.Renderer(through("sky.png"), device=device)
    assert "environment_power" not in renderer.plan.settings
    assert next(reason for reason in renderer.plan.reasons if reason.what == "environment image").kept
    sky, red, deep = (render(through(f), "sample", device).caustic_map for f in ("sky.png", "red.png", "deep.png"))
    assert sky.std() > 0.005 and np.array_equal(sky, red)
    np.testing.assert_allclose(deep, sky, atol=2e-3)  # rounding to 8 bits

    # Nothing is read where nothing is named.
    monkeypatch.setattr(import_module("warp_caustics.methods.sample"), "load_environment", None)
    plain = wc.Renderer(scene(GENTLE, resolution=(24, 16)), "sample", device)
    assert "environment" not in plain._recording.arrays


def test_a_bad_image_is_said(tmp_path):
    (tmp_path / "no.png").write_text("no image")
    for file, words in (("no.png", "cannot be read as an image"), ("none.png", "no such file")):
        with pytest.raises(InputError, match=words):
            wc.make_plan(scene(method=with_sample(environment=str(tmp_path / file))), device="cpu")


def test_an_image_lies_beside_the_scene(tmp_path):
    Image.new("L", (4, 4), 255).save(tmp_path / "sky.png")
    made = tables(scene(method=with_sample(environment="sky.png")))
    (tmp_path / "one.toml").write_text(wc.Scene(**made).to_toml())
    assert wc.load_scene(tmp_path / "one.toml").method.sample.environment == str(tmp_path / "sky.png")


def test_height_maps_are_sampled_too(device, tmp_path):
    y, x = (np.mgrid[:80, :80] + 0.5) / 80 * 2.4 - 0.2
    heights = 0.02 * np.sin(3.0 * x + y + 0.3)
    shape = save_heights(tmp_path, "surface", heights, (-0.2, -0.2), (2.4, 2.4))
    size = {"size": (2.0, 2.0), "resolution": (24, 24)}
    by_file = render(scene(height_map=shape, **size), "sample", device).caustic_map
    by_waves = render(scene([wave(0.02, 3.0, 1.0, 0.3)], **size), "sample", device).caustic_map
    np.testing.assert_allclose(by_file, by_waves, atol=0.02)
    with pytest.raises(InputError, match="water that ends within the map"):
        wc.make_plan(scene(height_map={**shape, "origin": (0.1, 0.0)}, **size), "sample", "cpu")
    with pytest.raises(InputError, match="water that ends within the map"):
        wc.make_plan(scene(height_map={**shape, "size": (2.1, 2.4)}, **size), "sample", "cpu")


@pytest.mark.parametrize("border", ["reflecting", "periodic"])
def test_simulated_water_is_sampled_too(device, border):
    drop = {"position": (0.9, 0.5), "radius": 0.1, "amplitude": 0.02}
    simulation = {"kind": "grid", "cell": 0.05, "drops": [drop], "border": border}
    simulation |= {"origin": (0.0, 0.0), "size": (2.0, 1.2)}
    # Calm water is looked up near the brightest place by nearly all samples: with the defaults it would all be cut off.
    water = scene(simulation=simulation, resolution=(24, 16), method=with_sample(base_intensity=0.2))
    renderer = wc.Renderer(water, "sample", device)
    first, later = (renderer.render(time).caustic_map.numpy().copy() for time in (0.0, 0.3))
    assert np.abs(first - later).max() > 0.05
    assert next(reason for reason in renderer.plan.reasons if reason.what == "simulation").kept


def test_all_that_it_cannot_honour_in_one_message(tmp_path):
    quad = save_quad(tmp_path)
    what = scene(
        GENTLE,
        {"plane": 0.0, "objects": [{"mesh": quad, "translate": (0.0, 0.0, -5.0)}]},
        medium={"ior": 1.33, "fresnel": True, "absorption": 0.1},
        sun={"angular_diameter": 0.5},
        self_shadow=True,
        method={"accumulate": "float64"},
    )
    with pytest.raises(InputError) as refused:
        wc.make_plan(what, "sample", "cpu")
    for key in (
        "receiver.objects", "medium.fresnel", "medium.absorption", "sun.angular_diameter", "water.self_shadow = true",
        'method.accumulate = "float64"', '"beam"',
    ):  # fmt: skip
        assert key in str(refused.value)
    assert "terrain" not in str(refused.value)
    with pytest.raises(InputError, match=r"medium\.dispersion"):
        wc.make_plan(scene(medium={"ior": "fresh", "dispersion": "traced"}), "sample", "cpu")
    for name in ("beach", "lake", "tank"):
        with pytest.raises(InputError, match='"sample" looks up'):
            wc.make_plan(name, "sample", "cpu")


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"sample_size": 0.6}, "sample_size: expected a number above 0 and up to 0.5"),
        ({"sample_steps": 0}, "sample_steps: expected a whole number of at least 1"),
        ({"vertices": 1}, "vertices: expected a whole number from 2 to 4096"),
        ({"blur_radius": -1}, "blur_radius: expected a whole number from 0 to 64"),
        ({"environment": "sky.txt"}, "environment: expected a file that ends in"),
        ({"environment": "sky.png", "environment_power": 2.0}, "got both"),
    ],
)
def test_settings_that_cannot_be(settings, words):
    with pytest.raises(InputError, match=words):
        SampleSettings(**settings)
