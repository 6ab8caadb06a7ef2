"""The picture: what flat water shows in closed form, from above and below, and that nobody pays who does not ask."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import warp as wp
from scenery import IOR, save_box, scene, tables

import warp_caustics as wc
from warp_caustics import picture as picture_module
from warp_caustics.kernels.shade import DIFFUSE_PATH, DIFFUSE_TRANSMITTANCE, SUN_RIM
from warp_caustics.picture import HAZE, colours_of, save_picture
from warp_caustics.tone import decode_srgb

CLOSED = 1e-3
"""Float32, a ray of sight that finds the water to 1e-5 of its way, and a map that is uniform to 1e-4."""
ALBEDO = (0.6, 0.5, 0.3)
ABSORPTION = (0.3, 0.1, 0.02)
MEDIUM = {"ior": IOR, "absorption": ABSORPTION, "fresnel": True}
SUN = (0.3, 0.2, -1.0)
SIZE = (25, 15)


def eye(position: tuple[float, float, float], target: tuple[float, float, float], fov: float = 40.0) -> dict:
    return {"position": position, "target": target, "vertical_fov": fov, "resolution": SIZE}


def flat(camera: dict | None, receiver: dict | None = None) -> wc.Scene:
    """One metre of still, clear blue water over a floor of sand."""
    return scene(
        receiver={"plane": 0.0, "albedo": ALBEDO, **(receiver or {})}, direction=SUN, medium=MEDIUM, camera=camera,
        resolution=(16, 16), size=(2.0, 2.0),
    )  # fmt: skip


def transmittance(cosine: float, ior: float) -> float:
    """Fresnel's, written anew: mean of both polarisations, from outside to the index ``ior``."""
    sine = np.sqrt(1.0 - cosine**2) / ior
    if sine >= 1.0:
        return 0.0
    inside = np.sqrt(1.0 - sine**2)
    s = (cosine - ior * inside) / (cosine + ior * inside)
    p = (inside - ior * cosine) / (inside + ior * cosine)
    return float(1.0 - (s * s + p * p) / 2.0)


class Expected:
    """Radiances of a scene of flat water, in closed form."""

    def __init__(self, what: wc.Scene) -> None:
        self.loss = np.asarray(ABSORPTION)
        self.colours = colours_of(what, ABSORPTION)
        self.sun = what.sun.unit_direction

    def ground(self, depth: float = 1.0, share_of_sun: float = 1.0) -> np.ndarray:
        cosine = -self.sun[2]
        down = np.sqrt(1.0 - (1.0 - cosine**2) / IOR**2)
        direct = cosine * transmittance(cosine, IOR) * np.exp(-self.loss * depth / down)
        sky = self.colours["sky_irradiance"] * float(DIFFUSE_TRANSMITTANCE)
        sky = sky * np.exp(-self.loss * float(DIFFUSE_PATH) * depth)
        return np.asarray(ALBEDO) / np.pi * (share_of_sun * direct * self.colours["irradiance"] + sky)

    def through(self, radiance: np.ndarray, way: float) -> np.ndarray:
        left = np.exp(-self.loss * way)
        return radiance * left + self.colours["veil"] * (1.0 - left)

    def sky(self, rise: float) -> np.ndarray:
        horizon, zenith = self.colours["horizon"], self.colours["zenith"]
        return horizon + np.sqrt(rise) * (zenith - horizon)


def middle(result: wc.Result) -> np.ndarray:
    picture = result.picture
    assert picture is not None and picture.shape == (SIZE[1], SIZE[0], 3) and picture.dtype == np.float32
    return picture[SIZE[1] // 2, SIZE[0] // 2]


def test_seen_straight_down_through_flat_water(device: str) -> None:
    """Sunlight enters and is absorbed; what the floor sends up is absorbed, leaves, and spreads as n squared."""
    what = flat(eye((1.0, 1.0, 3.0), (1.0, 1.0, 0.0)))
    expected = Expected(what)
    leaves = transmittance(1.0, IOR)
    below = expected.through(expected.ground(), 1.0) * leaves / IOR**2
    air = np.exp(-2.0 / (HAZE * np.hypot(2.0, 2.0)))
    seen = air * (below + (1.0 - leaves) * expected.sky(1.0)) + (1.0 - air) * expected.sky(0.0)
    np.testing.assert_allclose(middle(wc.render(what, device=device)), seen, rtol=CLOSED)


def test_seen_straight_down_from_within_the_water(device: str) -> None:
    what = flat(eye((1.0, 1.0, 0.6), (1.0, 1.0, 0.0)))
    expected = Expected(what)
    np.testing.assert_allclose(
        middle(wc.render(what, device=device)), expected.through(expected.ground(), 0.6), rtol=CLOSED
    )


@pytest.mark.parametrize("angle", [20.0, 46.0, 51.0, 70.0])
def test_snells_window(device: str, angle: float) -> None:
    """Seen from below, the sky stands within 48.6 degrees of the vertical; past that the surface mirrors the floor."""
    turned = np.radians(angle)
    # Away from the sun, whose disk is not what is asked for.
    target = (1.0 + np.sin(turned), 1.0, 0.5 + np.cos(turned))
    what = flat(eye((1.0, 1.0, 0.5), target, fov=0.05))
    expected = Expected(what)
    cosine = np.cos(turned)
    enters = transmittance(cosine, 1.0 / IOR)
    up = expected.sky(np.sqrt(max(1.0 - (IOR * np.sin(turned)) ** 2, 0.0)))
    mirrored = expected.through(expected.ground(), 1.0 / cosine)
    seen = expected.through(enters * IOR**2 * up + (1.0 - enters) * mirrored, 0.5 / cosine)
    assert (enters > 0.0) == (angle < np.degrees(np.arcsin(1.0 / IOR)))
    np.testing.assert_allclose(middle(wc.render(what, device=device)), seen, rtol=CLOSED)


def test_the_sun_stands_where_the_light_comes_from(device: str) -> None:
    towards = -np.asarray(SUN) / np.linalg.norm(SUN)
    what = flat(eye((1.0, 1.0, 3.0), tuple(np.array([1.0, 1.0, 3.0]) + towards), fov=0.5))
    expected = Expected(what)
    sky = expected.sky(towards[2]) + expected.colours["sun_radiance"]
    np.testing.assert_allclose(middle(wc.render(what, device=device)), sky, rtol=CLOSED)
    assert 0.0 < float(SUN_RIM) < 1.0


def test_beside_the_map_the_floor_goes_on_as_it_is(device: str) -> None:
    """Flat water is lit alike on the map, on that of its surroundings, between them and past both."""
    picture = wc.render(flat(eye((1.0, 1.0, 0.9), (1.0, 1.0, 0.0), fov=160.0)), device=device).picture
    assert picture is not None
    row = picture[SIZE[1] // 2]
    what = Expected(flat(None))
    reach = (np.arange(SIZE[0]) + 0.5 - SIZE[0] / 2.0) * np.tan(np.radians(80.0)) / (SIZE[1] / 2.0)
    way = 0.9 * np.hypot(1.0, reach)
    assert 0.9 * reach.max() > 3.0 + 2.0  # past the rim of the surroundings
    expected = np.array([what.through(what.ground(), w) for w in way])
    # Rays of a pixel this wide differ in their way, and their mean is not that of the middle.
    inner = np.abs(reach) < 8.0
    np.testing.assert_allclose(row[inner], expected[inner], rtol=0.1)
    assert np.ptp(row[inner] / expected[inner], axis=0).max() < 0.1


@pytest.mark.parametrize("place", [1.0, 8.0])
def test_an_object_casts_its_shadow(tmp_path, device: str, place: float) -> None:
    """Behind a box, in its full shadow, the sky alone lights the floor; before it the sun does too.

    On the map the map knows the shadow; past its surroundings a ray to the light finds it.
    """
    box = {"objects": [{"mesh": save_box(tmp_path), "translate": (place, 1.0, 0.0), "scale": 0.4}]}
    away = np.array(SUN[:2]) / np.hypot(*SUN[:2])
    expected = Expected(flat(None))
    for side, lit in ((1.0, 0.0), (-1.0, 1.0)):
        x, y = place + side * 0.29 * away[0], 1.0 + side * 0.29 * away[1]  # the shadow ends at 0.35 m
        what = flat(eye((x, y, 0.9), (x, y, 0.0), fov=0.5), box).at_resolution(128, 128)
        seen = middle(wc.render(what, device=device))
        np.testing.assert_allclose(seen, expected.through(expected.ground(share_of_sun=lit), 0.9), rtol=CLOSED)


def test_a_wall_is_lit_though_no_map_in_plan_view_shows_it(tmp_path, device: str) -> None:
    """The side of a box that faces the sun, seen from its own depth through half a metre of water."""
    box = {"objects": [{"mesh": save_box(tmp_path), "translate": (1.0, 1.0, 0.0), "scale": 0.4}]}
    what = flat(eye((0.3, 1.0, 0.2), (1.0, 1.0, 0.2), fov=0.5), box)
    expected = Expected(what)
    down = np.sqrt(1.0 - (1.0 - expected.sun[2] ** 2) / IOR**2)
    direct = -expected.sun[2] / down * transmittance(-expected.sun[2], IOR) * expected.sun[0] / IOR
    direct = direct * expected.colours["irradiance"] * np.exp(-expected.loss * 0.8 / down)
    sky = 0.5 * float(DIFFUSE_TRANSMITTANCE) * expected.colours["sky_irradiance"]
    sky = sky * np.exp(-expected.loss * float(DIFFUSE_PATH) * 0.8)
    wall = np.asarray(ALBEDO) / np.pi * (direct + sky)
    np.testing.assert_allclose(middle(wc.render(what, device=device)), expected.through(wall, 0.5), rtol=CLOSED)


def test_a_camera_s_own_map_is_light(device: str) -> None:
    """Of a method that looks, the light of the middle pixel is the one that the pixel itself has."""
    what = flat(eye((1.0, 1.0, 0.6), (1.0, 1.0, 0.0)))
    result = wc.render(what, device=device)
    own = np.zeros((SIZE[1], SIZE[0]), np.float32)
    own[SIZE[1] // 2, SIZE[0] // 2] = 2.0
    looked = replace(result, caustic_map=None, own_screen_map=own)
    expected = Expected(what)
    sky = expected.ground(share_of_sun=0.0)
    lit = sky + 2.0 * np.asarray(ALBEDO) / np.pi
    picture = looked.picture
    assert picture is not None
    np.testing.assert_allclose(middle(looked), expected.through(lit, 0.6), rtol=CLOSED)
    np.testing.assert_allclose(picture[SIZE[1] // 2, SIZE[0] // 2 + 1], expected.through(sky, 0.6), rtol=0.02)


def test_a_camera_s_own_map_is_not_what_the_surface_mirrors(device: str) -> None:
    """Past Snell's window a line of sight ends on other ground than the straight one of its pixel."""
    turned = np.radians(50.0)
    what = flat(eye((0.1, 1.0, 0.5), (0.1 + np.sin(turned), 1.0, 0.5 + np.cos(turned)), fov=0.05))
    assert 0.1 + 1.5 * np.tan(turned) < 2.0  # on the map
    result = wc.render(what, device=device)
    own = np.full((SIZE[1], SIZE[0]), 7.0, np.float32)
    expected = Expected(what)
    way = 1.5 / np.cos(turned)
    looked = replace(result, caustic_map=None, own_screen_map=own)
    np.testing.assert_allclose(middle(looked), expected.through(expected.ground(), way), rtol=CLOSED)


def test_sampled_caustics_are_shaded_as_published(device: str) -> None:
    """Ground and water by the formulas of Collard & Mundi (3.5, 3.6), one over the other, along a straight line."""
    what = scene(
        receiver={"plane": 0.0, "albedo": ALBEDO}, direction=SUN, resolution=(16, 16), size=(2.0, 2.0),
        camera=eye((1.0, 1.0, 3.0), (1.0, 1.0, 0.0), fov=0.5),
    )  # fmt: skip
    result = wc.render(what, method="sample", device=device)
    assert result.caustic_map is not None
    result.caustic_map[:] = 0.25
    towards_sun = -what.sun.unit_direction
    blue = np.array([0.0, 112.5 / 255.0, 1.0])
    intensity = 0.25 / towards_sun[2]
    ground = np.asarray(ALBEDO) * (1.0 + intensity) * min(2.0 / (0.1 + 0.1 + 1.0), 1.0) + 0.25 * blue
    lit = towards_sun[2]  # N·L, and the mirrored light's cosine with an eye straight above
    shine = lit**256
    water = (0.1 + np.array([lit, 2.0 * lit - lit * lit, lit])) * blue + shine
    over = min(lit + shine, 1.0)
    shown = np.clip((1.0 - over) * ground + over * water, 0.0, 1.0)
    np.testing.assert_allclose(middle(result), decode_srgb(shown), rtol=CLOSED)


def test_threads_draw_one_picture(device: str) -> None:
    what = flat(eye((1.0, -1.0, 2.0), (1.0, 1.0, 0.0)))
    one, three = (wc.render(what, device=device, threads=count).picture for count in (1, 3))
    np.testing.assert_array_equal(one, three)


def test_without_a_camera_there_is_none(device: str) -> None:
    assert wc.render(flat(None), device=device).picture is None


def test_a_map_alone_draws_nothing(monkeypatch: pytest.MonkeyPatch, device: str) -> None:
    built = []
    monkeypatch.setattr(picture_module, "make_picture", built.append)
    monkeypatch.setattr(picture_module, "make_surroundings", lambda _: built.append("light"))
    result = wc.render(flat(eye((1.0, 1.0, 3.0), (1.0, 1.0, 0.0))), device=device)
    assert result.caustic_map is not None and not built
    with pytest.raises(AttributeError):  # what was built is no kernel
        _ = result.picture
    assert built


def test_waves_keep_their_time_around_the_map() -> None:
    """Over a wider map a terrain has another mean depth, by which waves would run at another pace."""
    from warp_caustics.surroundings import make_surroundings

    what = scene(
        waves=[{"amplitude": 0.01, "wavevector": (3.0, 1.0)}], receiver={"terrain": {"base": 0.0, "slope": (0.6, 0.0)}}
    )
    result = wc.render(what, device="cpu", threads=1)
    around = make_surroundings(result)
    assert around is not None
    (wave,) = around.renderer.plan.facts.scene.water.waves or ()
    wider = around.renderer.plan.facts.rest_depth
    assert abs(wider - result.plan.facts.rest_depth) > 1e-3
    depth = result.plan.facts.rest_depth
    k = np.hypot(3.0, 1.0)
    assert wave.angular_frequency == pytest.approx(np.sqrt(9.81 * k * np.tanh(k * depth)))


@pytest.mark.parametrize(
    ("water", "receiver", "goes_on"),
    [
        ({"preset": "ripples"}, {"plane": 0.0}, True),
        ({"preset": "radial"}, {"plane": 0.0}, False),  # rings surround the middle of the map that they are laid over
        ({"waves": []}, {"terrain": {"base": 0.0}}, True),
        ({"simulation": {"kind": "grid", "cell": 0.1}}, {"plane": 0.0}, False),
    ],
)
def test_what_goes_on_around_the_map(water: dict, receiver: dict, goes_on: bool) -> None:
    """A preset is laid over the map; around it the very same waves go on, not those of a wider map."""
    from warp_caustics.surroundings import make_surroundings

    what = wc.Scene(**{**tables(scene(receiver=receiver)), "water": {"level": 1.0, **water}})
    result = wc.render(what, device="cpu", threads=1)
    around = make_surroundings(result)
    assert (around is not None) == goes_on
    if around is not None:
        facts = around.renderer.plan.facts
        assert [w.wavevector for w in facts.scene.waves] == [w.wavevector for w in what.waves]
        np.testing.assert_allclose(np.subtract(facts.scene.map.origin, what.map.origin), -np.asarray(what.map.size))


def test_what_lights_the_ground_around_a_camera_s_own_map(device: str) -> None:
    """Cascades follow light, so that beams go on with it; a projected pattern ends where its volume does."""
    from warp_caustics.surroundings import make_surroundings

    seen = scene(
        camera=eye((1.0, -1.0, 2.0), (1.0, 0.5, 0.0)),
        method={"cascaded": {"resolution": 32, "count": 1}},
        size=(2.0, 2.0),
    )
    around = make_surroundings(wc.render(seen, "cascaded", device))
    assert around is not None and around.renderer.plan.method == "beam"
    assert make_surroundings(wc.render(seen, "pattern", device)) is None


def test_files_of_a_picture(tmp_path) -> None:
    from PIL import Image

    what = flat(eye((1.0, 1.0, 0.6), (1.0, 1.0, 0.0)))
    result = wc.render(what, device="cpu", threads=1)
    picture = result.picture
    assert picture is not None
    save_picture(tmp_path / "frame.exr", picture, result)
    np.testing.assert_array_equal(wc.load_map(tmp_path / "frame.exr"), picture)
    save_picture(tmp_path / "frame.png", picture, result)
    brighter = tables(what)
    brighter["camera"]["exposure"] = 1.0
    save_picture(tmp_path / "brighter.png", picture, replace(result, scene=wc.Scene(**brighter)))
    shown, lifted = (np.asarray(Image.open(tmp_path / f"{name}.png")) for name in ("frame", "brighter"))
    assert shown.shape == (SIZE[1], SIZE[0], 3)
    assert (lifted > shown).all()
    with pytest.raises(wc.InputError, match=r"\.exr or \.png"):
        save_picture(tmp_path / "frame.jpg", picture, result)


@pytest.fixture(autouse=True)
def _quiet() -> None:
    wp.config.log_level = wp.LOG_WARNING
