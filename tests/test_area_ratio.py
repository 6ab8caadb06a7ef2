"""The area ratio: its triangles at pixel centres, its two ratios, and the light that it invents."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import warp as wp
from scenery import GENTLE, assert_adds_up, bundled, relative_l2, render, rough_pool, save_box, scene, tables, wave

import warp_caustics as wc
from oracle.cases import sunlight
from warp_caustics.kernels.area_ratio import ratio_by_cross, ratio_by_derivatives, share_in_map
from warp_caustics.kernels.centres import SUBPIXELS, make_draw, turned, unclaim
from warp_caustics.kernels.deposit import FLUX
from warp_caustics.kernels.lattice import Lattice
from warp_caustics.metrics import energy_error

SIZE = 8
FLOAT32 = 2e-5  # ratios of affine maps whose determinant is down to 0.1, in float32
CLIPPED = 1e-5  # of a triangle's area, by coordinates that are shares of the map
SNAPPED = 1e-4  # corners are rounded to 2^-16 of a pixel, and a cell here is as small as half of one
BORDER_CELLS = 1e-3  # cells of 6 cm that bend are cut straight by the border of the map
SAME_FATES = 2e-3  # a photon's fate by corners against the beam's by parts, where edges cut cells
CENTRES = 0.06  # the spread of the light at 4096 pixel centres, half of it in triangles smaller than a pixel
KINDS = [{"area": area, "overlap": overlap} for area in ("derivatives", "cross") for overlap in ("add", "latest")]


def area_ratio(**settings):
    return {"area_ratio": settings}


def held(result):
    """The map's light over what reached it."""
    return 1.0 + result.energy.invented / result.energy.received


# --- the ratios ------------------------------------------------------------------------------------------------------


@wp.kernel(enable_backward=False)
def ratios(
    before: wp.array2d[wp.vec2],
    after: wp.array2d[wp.vec2],
    cross_out: wp.array[float],
    derivatives_out: wp.array[float],
):
    i = wp.tid()
    area = wp.abs(after[i, 0][0] * after[i, 1][1] - after[i, 0][1] * after[i, 1][0])
    cross_out[i] = ratio_by_cross(before[i, 0], before[i, 1], area)
    derivatives_out[i] = ratio_by_derivatives(before[i, 0], before[i, 1], after[i, 0], after[i, 1], area)


def ratios_of(old, new, device):
    """Ratios of triangles by their edges ``[n, 2 edges, 2]``."""
    out = [wp.zeros(len(old), dtype=float, device=device) for _ in range(2)]
    edges = [wp.array(np.asarray(e, dtype=np.float32), dtype=wp.vec2, device=device) for e in (old, new)]
    wp.launch(ratios, dim=len(old), inputs=edges, outputs=out, device=device)
    return [one.numpy() for one in out]


def test_ratios_are_those_of_the_affine_map_back(device):
    rng = np.random.default_rng(1)
    maps = rng.normal(size=(200, 2, 2))
    maps = maps[np.abs(np.linalg.det(maps)) > 0.1]
    old = np.broadcast_to(np.array([[1.0, 0.0], [1.0, 1.0]]), (len(maps), 2, 2))
    cross, derivatives = ratios_of(old, old @ maps.transpose(0, 2, 1), device)
    back = np.linalg.inv(maps)
    np.testing.assert_allclose(cross, np.abs(np.linalg.det(back)), rtol=FLOAT32)
    # d old / dx and d old / dy are the columns of the map back from the picture to the surface.
    np.testing.assert_allclose(derivatives, np.prod(np.linalg.norm(back, axis=1), axis=1), rtol=FLOAT32)
    assert (derivatives >= cross * (1.0 - FLOAT32)).all()
    assert derivatives.sum() > 1.2 * cross.sum()


@pytest.mark.parametrize("stretch", [0.5, 0.1, 0.02])
def test_a_fold_at_an_angle_is_too_bright_and_one_along_the_axes_is_not(device, stretch):
    """A sheet squeezed by s along a line at 45 degrees: (1 + 1/s^2) / 2 instead of 1/s."""
    turn = np.array([[1.0, -1.0], [1.0, 1.0]]) / np.sqrt(2.0)
    for axes, expected in ((np.eye(2), 1.0 / stretch), (turn, 0.5 * (1.0 + stretch**-2))):
        squeeze = axes @ np.diag([stretch, 1.0]) @ axes.T
        old = np.array([[[1.0, 0.0], [0.0, 1.0]]])
        cross, derivatives = ratios_of(old, old @ squeeze.T, device)
        assert cross[0] == pytest.approx(1.0 / stretch, rel=FLOAT32)
        assert derivatives[0] == pytest.approx(expected, rel=FLOAT32 / stretch)


# --- coverage --------------------------------------------------------------------------------------------------------

DRAW = {role: make_draw("float32", 1, *role) for role in ((False, False), (True, False), (False, True))}
one_channel = FLUX[1]
adds, claims, adds_own = DRAW[False, False], DRAW[True, False], DRAW[False, True]


@wp.kernel(enable_backward=False)
def draw_all(
    corners: wp.array2d[wp.vec2i], order: wp.array[int], size: wp.vec2i, map_out: wp.array[float],
    counted_out: wp.array[float], owner_out: wp.array[int],
):  # fmt: skip
    for k in range(order.shape[0]):
        i = order[k]
        triangle = turned(corners[i, 0], corners[i, 1], corners[i, 2])
        claims(map_out, owner_out, size, wp.vec2i(0, 0), triangle, i + 1, one_channel(), 0.0)
        adds(counted_out, owner_out, size, wp.vec2i(0, 0), triangle, i + 1, one_channel(1.0), 1.0)
    for k in range(order.shape[0]):
        i = order[k]
        triangle = turned(corners[i, 0], corners[i, 1], corners[i, 2])
        adds_own(map_out, owner_out, size, wp.vec2i(0, 0), triangle, i + 1, one_channel(float(i + 1)), 1.0)


def drawn(corners, order, device):
    """Draw triangles [n, 3, 2] in sub-pixels; return the latest's number, and how many cover each pixel."""
    made = [wp.zeros(SIZE * SIZE, dtype=float, device=device) for _ in range(2)]
    owner = wp.empty(SIZE * SIZE, dtype=int, device=device)
    wp.launch(unclaim, dim=SIZE * SIZE, outputs=[owner], device=device)
    inputs = [
        wp.array(np.asarray(corners, dtype=np.int32), dtype=wp.vec2i, device=device),
        wp.array(np.asarray(order, dtype=np.int32), dtype=int, device=device), wp.vec2i(SIZE, SIZE),
    ]  # fmt: skip
    wp.launch(draw_all, dim=1, inputs=inputs, outputs=[*made, owner], device=device)
    latest, count = (one.numpy().reshape(SIZE, SIZE) for one in made)
    np.testing.assert_array_equal(latest, owner.numpy().reshape(SIZE, SIZE))
    return latest, count


def covers(triangle):
    """Pixels whose centres lie strictly inside a triangle, and those on its edges, in whole numbers."""
    middle = (np.arange(SIZE) * 2 + 1) * int(SUBPIXELS) // 2
    x, y = (one.astype(object) for one in np.meshgrid(middle, middle))
    signs = []
    for p, q in zip(triangle, np.roll(triangle, -1, axis=0), strict=True):
        p, q = [int(v) for v in p], [int(v) for v in q]
        signs.append(np.sign((q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0])).astype(int))
    signs = np.array(signs)
    inside = (signs > 0).all(axis=0) | (signs < 0).all(axis=0)
    return inside, (signs == 0).any(axis=0) & ((signs >= 0).all(axis=0) | (signs <= 0).all(axis=0))


def test_a_triangle_covers_the_centres_inside_it_and_the_latest_keeps_them(device):
    rng = np.random.default_rng(2)
    corners = (rng.uniform(-4.0, SIZE + 4.0, (40, 3, 2)) * int(SUBPIXELS)).astype(int)
    corners[0] = corners[0, 0]  # no area
    expected, count = np.zeros((SIZE, SIZE)), np.zeros((SIZE, SIZE))
    for i, triangle in enumerate(corners):
        inside, edge = covers(triangle)
        assert i == 0 or not edge.any()
        expected[inside] = i + 1
        count += inside
    for order in (np.arange(len(corners)), rng.permutation(len(corners))):
        latest, counted = drawn(corners, order, device)
        np.testing.assert_array_equal(latest, expected)
        np.testing.assert_array_equal(counted, count)


def test_centres_on_shared_edges_belong_to_one_triangle(device):
    """A square from centre to centre, cut along its diagonal and turned over by a fold or not."""
    half = int(SUBPIXELS) // 2
    a, b, c, d = (np.array(p) * half for p in ((1, 1), (13, 1), (13, 13), (1, 13)))
    for flipped in (False, True):
        lower, upper = ((a, c, b), (a, d, c)) if flipped else ((a, b, c), (a, c, d))
        _, count = drawn([lower, upper], [0, 1], device)
        assert set(np.unique(count)) == {0.0, 1.0}
        assert count.sum() == 36.0  # 6 by 6: of its border it has the left and the top, or whichever the rule says


@wp.kernel(enable_backward=False)
def shares(lattice: Lattice, base: wp.vec2i, corners: wp.array2d[wp.vec2], share_out: wp.array[float]):
    i = wp.tid()
    share_out[i] = share_in_map(lattice, base, corners[i, 0], corners[i, 1], corners[i, 2])


def test_the_share_of_a_triangle_in_the_map(device):
    made, base = Lattice(), np.array([5, -3])
    made.map = wp.vec2i(16, 12)
    corners = np.array(
        [
            [[1.0, 1.0], [3.0, 1.0], [1.0, 4.0]],  # inside
            [[-9.0, 1.0], [-3.0, 1.0], [-9.0, 4.0]],  # beside
            [[-2.0, 2.0], [2.0, 2.0], [-2.0, 6.0]],  # cut through x = 0: a quarter is left
            [[10.0, 6.0], [10.0, 20.0], [22.0, 13.0]],  # over the corner (16, 12)
            [[-50.0, -50.0], [150.0, -50.0], [-50.0, 150.0]],  # holds the map
            [[3.0, 3.0], [3.0, 3.0], [3.0, 3.0]],  # points
            [[-3.0, 3.0], [-3.0, 3.0], [-3.0, 3.0]],
        ]
    )
    # By hand: the part of the fourth with x < 16 and y < 12 is a trapezoid less what lies under its lower side.
    lower = 0.5 * (6.0 + 2.5) * 6.0
    expected = [1.0, 0.0, 0.25, lower / 84.0, 192.0 / 20000.0, 1.0, 0.0]
    out = wp.zeros(len(corners), dtype=float, device=device)
    from_base = wp.array((corners - base).astype(np.float32), dtype=wp.vec2, device=device)
    inputs = [made, wp.vec2i(*base.tolist()), from_base]
    wp.launch(shares, dim=len(corners), inputs=inputs, outputs=[out], device=device)
    np.testing.assert_allclose(out.numpy(), expected, rtol=CLIPPED, atol=CLIPPED)


# --- maps ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("settings", KINDS)
def test_flat_water_is_uniform(device, settings):
    for zenith, density in ((0.0, 1.0), (60.0, 4.0), (80.0, 0.3), (35.0, 2.3)):
        what = scene(direction=sunlight(zenith), method=area_ratio(samples_per_pixel=density, **settings))
        result = render(what, "area_ratio", device)
        np.testing.assert_allclose(result.caustic_map, np.cos(np.radians(zenith)), rtol=SNAPPED)
        assert abs(held(result) - 1.0) < SNAPPED
        assert_adds_up(result)
        assert result.warnings == []


def test_pixel_centres_that_grow_dense_turn_it_into_the_beam(device):
    """The same cells, seen at k x k centres a pixel: as k grows, the mean over a pixel is the exact clipping's."""
    beam = render(bundled("pool", (32, 32)).model_copy(update=MESH), "beam", device).caustic_map
    errors = []
    for k in (1, 2, 4, 8):
        what = tables(bundled("pool", (32 * k, 32 * k)))
        what["method"] = area_ratio(samples_per_pixel=1.0 / k**2, area="cross")
        fine = render(wc.Scene(**what), "area_ratio", device).caustic_map
        errors.append(relative_l2(fine.reshape(32, k, 32, k).mean(axis=(1, 3)), beam))
    assert all(finer < 0.75 * coarser for coarser, finer in pairwise(errors))
    assert errors[-1] < 0.2 * errors[0]


MESH = {"method": wc.Scene(**{**tables(bundled("pool")), "method": {"beam": {"refine": False}}}).method}


def test_the_published_ratio_invents_light_and_the_exact_one_does_not(device):
    """Rms slope 0.15, 4 m deep: about 2.5 times the light in an ordinary frame (the mean has no bound); clamps hide it.

    Half of all frames hold more than the median, which single triangles at a fold do not move.
    """
    medians = {}
    for name, settings in {
        "published": {},
        "exact": {"area": "cross"},
        "latest": {"area": "cross", "overlap": "latest"},
        "clamped": {"clamp": 5.0},
    }.items():
        renderer = wc.Renderer(rough_pool(0.15, 4.0, **area_ratio(**settings)), "area_ratio", device, 1)
        shares = []
        for time in np.arange(7) * 1.7:
            renderer.render(time)
            result = renderer.result()
            shares.append(held(result))
            assert np.isfinite(result.caustic_map).all()
        medians[name] = np.median(shares)
    assert 1.8 < medians["published"] < 4.0
    assert medians["exact"] == pytest.approx(1.0, abs=CENTRES)
    assert medians["latest"] < 0.7  # most of what several sheets bring is thrown away
    assert 1.05 < medians["clamped"] < 1.25


def test_what_is_invented_is_said_and_judged(device):
    result = render(rough_pool(0.15, 4.0), "area_ratio", device)
    assert any("times the light that reached it" in warning for warning in result.warnings)
    truth = render(rough_pool(0.15, 4.0), "beam", device)
    assert result.energy.received == pytest.approx(truth.energy.received, rel=BORDER_CELLS)
    error = energy_error(result.energy, truth.energy)
    assert error == pytest.approx(result.energy.invented / truth.energy.received, rel=1e-3)
    assert error > 0.5
    assert result.energy.unaccounted < 1e-6


@pytest.mark.parametrize("overlap", ["add", "latest"])
@pytest.mark.parametrize("name", ["beach", "tank"])
def test_any_receiver_and_a_ledger_that_knows_each_fate(device, name, overlap):
    table = tables(bundled(name, (48, 48)))
    table["method"] = area_ratio(overlap=overlap, area="cross")
    result, beam = (render(wc.Scene(**table), method, device) for method in ("area_ratio", "beam"))
    assert_adds_up(result)
    assert np.isfinite(result.caustic_map).all()
    for fate in ("received", "reflected", "absorbed", "outside_map", "blocked"):
        scale = np.max(beam.energy.emitted)
        np.testing.assert_allclose(result.energy[fate], beam.energy[fate], atol=SAME_FATES * scale, err_msg=fate)
    assert relative_l2(result.caustic_map, beam.caustic_map) < 1.0


def test_a_focus_is_finite(device):
    """At the focus of a cylindrical wave whole cells land on a line; none is infinitely bright."""
    k, amplitude = 2.0 * np.pi, 0.01
    focus = 1.333 / (0.333 * amplitude * k * k)
    what = scene([wave(amplitude, k, 0.0, np.pi / 2.0)], direction=(0.0, 0.0, -1.0), level=focus - amplitude)
    for settings in KINDS:
        table = {**tables(what), "method": area_ratio(samples_per_pixel=9.0, **settings)}
        assert np.isfinite(render(wc.Scene(**table), "area_ratio", device).caustic_map).all()


def test_the_latest_does_not_depend_on_threads_or_chance(device):
    what = rough_pool(0.15, 4.0, **area_ratio(overlap="latest"))
    maps = [wc.render(what, "area_ratio", device, threads).caustic_map for threads in (1, 2, 2)]
    np.testing.assert_array_equal(maps[0], maps[1])
    np.testing.assert_array_equal(maps[0], maps[2])


def test_directions_of_the_sun_add_up_though_the_latest_wins(device):
    what = tables(scene(GENTLE, sun={"angular_diameter": 8.0}))
    what["method"] = area_ratio(overlap="latest", area="cross")
    result = render(wc.Scene(**what), "area_ratio", device)
    assert len(result.plan.facts.suns) > 1
    assert held(result) == pytest.approx(1.0, abs=CENTRES)
    assert_adds_up(result)


def test_what_it_cannot_honour_is_refused(tmp_path):
    def plan(accumulate, **settings):
        return wc.make_plan(scene(method={"accumulate": accumulate, **area_ratio(**settings)}), "area_ratio", "cpu", 1)

    assert plan("float64").program.accumulate == "float64"
    with pytest.raises(wc.InputError, match="fixed point"):
        plan("fixed")
    with pytest.raises(wc.InputError, match="nothing is added up"):
        plan("float64", overlap="latest")
    for bad in ({"clamp": 0.0}, {"area": "sum"}, {"overlap": "first"}, {"samples_per_pixel": 0.0}):
        with pytest.raises(wc.InputError, match="area_ratio"):
            scene(method=area_ratio(**bad))


def test_what_a_setting_does_not_need_is_left_out(tmp_path):
    add, latest = (
        wc.make_plan(scene(GENTLE, method=area_ratio(overlap=overlap)), "area_ratio", "cpu", 2)
        for overlap in ("add", "latest")
    )
    assert set(latest.kernels) - set(add.kernels) == {"unclaim", "claim"}
    assert {b.name for b in latest.buffers} - {b.name for b in add.buffers} == {"owner"}
    assert "state" not in {b.name for b in add.buffers}
    rock = {"plane": 0.0, "objects": [{"mesh": save_box(tmp_path), "scale": 0.2, "translate": (1.0, 0.5, 0.0)}]}
    assert "state" in {b.name for b in wc.make_plan(scene(GENTLE, rock), "area_ratio", "cpu", 1).buffers}
