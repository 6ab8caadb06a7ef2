"""Photon differentials: their formulas against finite differences, their footprints, and the light that they keep."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from scenery import (
    GENTLE,
    IOR,
    assert_adds_up,
    bundled,
    relative_l2,
    render,
    sample_points,
    save_heights,
    scene,
    sum_of_waves,
    tables,
    wave,
)

import warp_caustics as wc
from oracle.cases import sunlight
from warp_caustics.kernels.deposit import FLUX
from warp_caustics.kernels.differential import landed_edge, normal_differential, normal_of, refract_differential
from warp_caustics.kernels.footprint import make_deposit_ellipse, make_deposit_parallelogram
from warp_caustics.kernels.photon import Photon
from warp_caustics.kernels.waves import vec6

STEP = 1e-5  # of central differences in float64 [m]: their error is of order 1e-9
DIFFERENCES = 2e-5  # float32 formulas against them, relative to the largest of a set
SAMPLED = {"ellipse": 0.02, "parallelogram": 0.03}  # thin rows by their middles; edges by 64 x 64 points a pixel
EXACT = 1e-5  # what is asked of energy
UNIFORM = 2e-5  # as of flat water by the other methods: what a cell's landing is rounded by
PIXELS = 24  # of a small map, along each side
COUNT = 60  # random points of a surface


def differential(**settings):
    return {"differential": settings}


# --- the formulas ----------------------------------------------------------------------------------------------------


def normal64(slope):
    m = np.concatenate([-slope, np.ones((len(slope), 1))], axis=1)
    return m / np.linalg.norm(m, axis=1, keepdims=True)


def refract64(direction, normal, eta):
    c = -(normal * direction).sum(axis=1, keepdims=True)
    return eta * direction + (eta * c - np.sqrt(1.0 - eta**2 * (1.0 - c * c))) * normal


@pytest.fixture(scope="module")
def bent():
    """Points of a paraboloid (height, slope, curvature), a sun and a tilted receiver below, in float64."""
    rng = np.random.default_rng(3)
    slope, curvature = rng.uniform(-0.3, 0.3, (COUNT, 2)), rng.uniform(-4.0, 4.0, (COUNT, 3))
    z = np.concatenate([np.zeros((COUNT, 1)), slope, curvature], axis=1)
    receiver = np.concatenate([rng.uniform(-0.4, 0.4, (COUNT, 2)), np.ones((COUNT, 1))], axis=1)
    return {
        "z": z, "sun": np.array(sunlight(40.0)) / np.linalg.norm(sunlight(40.0)), "receiver": receiver,
        "depth": rng.uniform(0.2, 3.0, COUNT), "edge": rng.normal(size=(COUNT, 2)),
    }  # fmt: skip


def followed(bent, at):
    """Follow the rays from horizontal places ``at`` beside each point: normal, refracted direction, landing."""
    z = bent["z"]
    slope = z[:, 1:3] + np.stack([z[:, 3] * at[:, 0] + z[:, 4] * at[:, 1], z[:, 4] * at[:, 0] + z[:, 5] * at[:, 1]], 1)
    height = 0.5 * ((z[:, 1:3] + slope) * at).sum(axis=1)
    origin = np.concatenate([at, height[:, None]], axis=1)
    normal = normal64(slope)
    direction = refract64(np.broadcast_to(bent["sun"], normal.shape), normal, 1.0 / IOR)
    foot = np.array([0.0, 0.0, -1.0]) * bent["depth"][:, None]  # a point of the receiver's plane
    t = ((foot - origin) * bent["receiver"]).sum(axis=1) / (direction * bent["receiver"]).sum(axis=1)
    return normal, direction, origin + t[:, None] * direction, t


@wp.kernel(enable_backward=False)
def differentials(
    z: wp.array[vec6], edge: wp.array[wp.vec2], direction: wp.array[wp.vec3], distance: wp.array[float],
    receiver: wp.array[wp.vec3], sun: wp.vec3, eta: float,
    normal_out: wp.array[wp.vec3], refracted_out: wp.array[wp.vec3], landed_out: wp.array[wp.vec2],
):  # fmt: skip
    i = wp.tid()
    photon = Photon()
    photon.direction = direction[i]
    photon.distance = distance[i]
    photon.normal = receiver[i]
    change = normal_differential(z[i], edge[i])
    normal_out[i] = change
    refracted_out[i] = refract_differential(sun, wp.vec3(0.0, 0.0, 0.0), direction[i], normal_of(z[i]), change, eta)
    landed_out[i] = landed_edge(sun, eta, photon, z[i], edge[i])


def test_normal_direction_and_landing_change_as_finite_differences_say(device, bent):
    ends = [followed(bent, sign * STEP * bent["edge"]) for sign in (-1.0, 1.0)]
    expected = [(high - low) / (2.0 * STEP) for low, high in zip(*ends, strict=True)]
    _, direction, _, distance = followed(bent, 0.0 * bent["edge"])

    def device_array(values, dtype):
        return wp.array(np.asarray(values, dtype=np.float32), dtype=dtype, device=device)

    out = [wp.zeros(COUNT, dtype=dtype, device=device) for dtype in (wp.vec3, wp.vec3, wp.vec2)]
    inputs = [
        device_array(bent["z"], vec6), device_array(bent["edge"], wp.vec2), device_array(direction, wp.vec3),
        device_array(distance, float), device_array(bent["receiver"], wp.vec3), wp.vec3(*bent["sun"]), 1.0 / IOR,
    ]  # fmt: skip
    wp.launch(differentials, dim=COUNT, inputs=inputs, outputs=out, device=device)
    for made, wanted in zip(out, (expected[0], expected[1], expected[2][:, :2]), strict=True):
        np.testing.assert_allclose(made.numpy(), wanted, atol=DIFFERENCES * np.abs(wanted).max())


@wp.kernel(enable_backward=False)
def refracted_changes(
    direction: wp.array[wp.vec3], change: wp.array[wp.vec3], refracted: wp.array[wp.vec3], normal: wp.array[wp.vec3],
    eta: float, out: wp.array[wp.vec3],
):  # fmt: skip
    i = wp.tid()
    out[i] = refract_differential(direction[i], change[i], refracted[i], normal[i], wp.vec3(0.0, 0.0, 0.0), eta)


def test_a_changing_direction_refracts_as_finite_differences_say(device):
    """dD is zero for the sun; the formula holds for any light."""
    rng = np.random.default_rng(4)
    normal = normal64(rng.uniform(-0.5, 0.5, (COUNT, 2)))
    across = rng.normal(size=(2, COUNT, 3))
    direction = across[0] * 0.3 - np.array([0.0, 0.0, 1.0])
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    change = across[1] - (across[1] * direction).sum(axis=1, keepdims=True) * direction  # a unit vector only turns
    ends = [refract64(direction + sign * STEP * change, normal, 1.0 / IOR) for sign in (-1.0, 1.0)]
    arrays = [
        wp.array(values.astype(np.float32), dtype=wp.vec3, device=device)
        for values in (direction, change, refract64(direction, normal, 1.0 / IOR), normal)
    ]
    out = wp.zeros(COUNT, dtype=wp.vec3, device=device)
    wp.launch(refracted_changes, dim=COUNT, inputs=[*arrays, 1.0 / IOR], outputs=[out], device=device)
    np.testing.assert_allclose(out.numpy(), (ends[1] - ends[0]) / (2.0 * STEP), atol=DIFFERENCES * 5.0)


# --- footprints ------------------------------------------------------------------------------------------------------

ellipse, parallelogram = make_deposit_ellipse("float32", 1), make_deposit_parallelogram("float32", 1)
one_channel = FLUX[1]


@wp.kernel(enable_backward=False)
def deposit_one(
    size: wp.vec2i, at: wp.vec2, u: wp.vec2, v: wp.vec2, largest: float, whole: int,
    map_out: wp.array[float], inside_out: wp.array[float],
):  # fmt: skip
    base = wp.vec2i(int(wp.floor(at[0])), int(wp.floor(at[1])))
    p = wp.vec2(at[0] - float(base[0]), at[1] - float(base[1]))
    if whole == 0:
        inside_out[0] = ellipse(map_out, size, base, p, u, v, largest, one_channel(1.0))
    else:
        inside_out[0] = parallelogram(map_out, size, base, p, u, v, largest, one_channel(1.0))


def deposited(kind, at, u, v, device, largest=1e3):
    made = wp.zeros(PIXELS * PIXELS, dtype=float, device=device)
    inside = wp.zeros(1, dtype=float, device=device)
    inputs = [wp.vec2i(PIXELS, PIXELS), wp.vec2(*at), wp.vec2(*u), wp.vec2(*v), largest, int(kind == "parallelogram")]
    wp.launch(deposit_one, dim=1, inputs=inputs, outputs=[made, inside], device=device)
    made = made.numpy().reshape(PIXELS, PIXELS).astype(np.float64)
    assert made.sum() == pytest.approx(float(inside.numpy()[0]), abs=1e-6)
    assert (made >= -1e-6).all()
    return made


def by_points(kind, at, u, v, parts=64):
    """The footprint's density in each pixel, by the mean of many points."""
    middles = (np.arange(PIXELS * parts) + 0.5) / parts
    x, y = np.meshgrid(middles - at[0], middles - at[1])
    a, b = np.einsum("ij,jkl->ikl", np.linalg.inv(np.column_stack([u, v])), np.stack([x, y]))
    if kind == "ellipse":
        density = 3.0 / np.pi * np.maximum(1.0 - a * a - b * b, 0.0) ** 2
    else:
        density = ((np.abs(a) < 0.5) & (np.abs(b) < 0.5)).astype(float)
    density /= abs(u[0] * v[1] - u[1] * v[0])
    return density.reshape(PIXELS, parts, PIXELS, parts).mean(axis=(1, 3))


@pytest.mark.parametrize("kind", ["ellipse", "parallelogram"])
@pytest.mark.parametrize(
    ("at", "u", "v"),
    [
        ((12.3, 11.8), (4.0, 1.0), (-0.5, 3.0)),  # turned
        ((12.3, 11.8), (3.0, 3.0), (-2.5, -3.0)),  # slender, along a diagonal
        ((9.1, 12.4), (6.0, 0.3), (0.2, -0.5)),  # a folded one, nearly along a row
        ((1.0, 22.5), (4.0, 1.0), (-0.5, 3.0)),  # over a corner of the map
    ],
)
def test_footprints_are_spread_as_their_kernels_say(device, kind, at, u, v):
    made, expected = deposited(kind, at, u, v, device), by_points(kind, at, u, v)
    np.testing.assert_allclose(made, expected, atol=SAMPLED[kind] * expected.max())
    assert made.sum() == pytest.approx(expected.sum(), rel=2.0 * SAMPLED[kind])


@pytest.mark.parametrize("kind", ["ellipse", "parallelogram"])
@pytest.mark.parametrize("size", [0.0, 1e-6, 1e-3, 0.2, 1.0, 5.0])
@pytest.mark.parametrize("thin", [0.0, 1e-4, 1.0])
def test_no_footprint_is_lost_between_pixels(device, kind, size, thin):
    for at in ((12.0, 12.0), (12.5, 12.5), (11.93, 12.41)):
        made = deposited(kind, at, (size, 0.7 * size), (-0.7 * thin * size, thin * size), device)
        assert made.sum() == pytest.approx(1.0, abs=EXACT)
        middle = (made * (np.arange(PIXELS) + 0.5)).sum()
        assert middle == pytest.approx(at[0], abs=0.51)


@pytest.mark.parametrize("kind", ["ellipse", "parallelogram"])
def test_a_footprint_that_is_too_large_is_narrowed_and_keeps_its_light(device, kind):
    wild = deposited(kind, (12.2, 11.7), (300.0, 40.0), (-1.0, 2.0), device, largest=4.0)
    assert wild.sum() == pytest.approx(1.0, abs=EXACT)
    rows, columns = np.nonzero(wild)
    assert max(np.ptp(rows), np.ptp(columns)) <= 10
    for broken in (np.nan, np.inf):
        point = deposited(kind, (12.2, 11.7), (broken, 0.0), (0.0, 1.0), device)
        assert point[11, 12] == pytest.approx(1.0, abs=EXACT)


# --- maps ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("zenith", [0.0, 60.0])
def test_flat_water_is_uniform(device, zenith):
    """A parallelogram is the cell itself at any density; ellipses overlap evenly where photons and pixels agree."""
    for footprint, density in (("parallelogram", 0.3), ("parallelogram", 2.3), ("ellipse", 1.0), ("ellipse", 4.0)):
        what = scene(direction=sunlight(zenith), method=differential(footprint=footprint, photons_per_pixel=density))
        result = render(what, "differential", device)
        np.testing.assert_allclose(result.caustic_map, np.cos(np.radians(zenith)), rtol=UNIFORM)
        assert_adds_up(result)


@pytest.mark.parametrize("footprint", ["ellipse", "parallelogram"])
@pytest.mark.parametrize("largest", [1.0, 3.0, 32.0])
def test_a_whole_period_receives_what_flat_water_would(device, footprint, largest):
    waves = [wave(0.004, 2.0 * np.pi * i, 2.0 * np.pi * j, i + j) for i, j in ((1, 0), (0, 2), (2, -1), (-1, 3))]
    chosen = differential(footprint=footprint, largest=largest)
    what = scene(waves, size=(1.0, 1.0), resolution=(32, 32), level=1.5, method=chosen)
    result = render(what, "differential", device)
    expected = np.cos(np.radians(35.0))
    assert np.std(result.caustic_map) > 0.1
    assert np.mean(result.caustic_map, dtype=np.float64) == pytest.approx(expected, rel=EXACT)
    assert_adds_up(result)


def test_it_is_more_accurate_than_boxes_of_the_same_count(device):
    """On the pool; a parallelogram at 1 photon a pixel betters a box at 4."""
    pool = bundled("pool", (64, 64))
    truth = wc.make_reference(pool, device=device).caustic_map

    def error(method, **settings):
        what = wc.Scene(**{**tables(pool), "method": {method: settings}})
        return relative_l2(render(what, method, device).caustic_map, truth)

    for count in (0.25, 1.0, 4.0):
        box = error("photon", photons_per_pixel=count)
        for footprint in ("ellipse", "parallelogram"):
            assert error("differential", photons_per_pixel=count, footprint=footprint) < 0.8 * box
    assert error("differential", photons_per_pixel=1.0, footprint="parallelogram") < 0.05


@pytest.mark.parametrize("name", ["beach", "tank"])
def test_any_receiver(device, name):
    """Terrain with a shore, and meshes; at 4 photons a pixel cells are small beside the waves."""
    table = tables(bundled(name, (48, 48)))
    truth = render(wc.Scene(**{**table, "method": {"beam": {"samples_per_pixel": 16.0}}}), "beam", device).caustic_map
    chosen = {"differential": {"footprint": "parallelogram", "photons_per_pixel": 4.0}}
    what = wc.Scene(**{**table, "method": chosen})
    result, box = (render(what, method, device) for method in ("differential", "photon"))
    assert_adds_up(result)
    assert relative_l2(result.caustic_map, truth) < 0.6 * relative_l2(box.caustic_map, truth)


def test_a_height_map_has_the_curvature_of_its_waves(device, tmp_path):
    """The same water by its formula and by a file of it, whose curvature is that of its bicubic patches."""
    origin, size = (-3.0, -3.0), (8.0, 8.0)
    x, y = sample_points((400, 400), origin, size)
    heights = sum_of_waves(GENTLE, x, y)
    chosen = differential(photons_per_pixel=0.25)
    waves = scene(GENTLE, method=chosen)
    grid = scene(height_map=save_heights(tmp_path, "sea", heights, origin, size), method=chosen)
    maps = [render(what, "differential", device).caustic_map for what in (waves, grid)]
    assert relative_l2(maps[1], maps[0]) < 1e-3
    assert np.std(maps[0]) > 0.05


def test_settings_are_bounded():
    for bad in ({"largest": 0.5}, {"largest": 1e6}, {"footprint": "disk"}, {"photons_per_pixel": -1.0}):
        with pytest.raises(wc.InputError, match="differential"):
            scene(method=differential(**bad))
