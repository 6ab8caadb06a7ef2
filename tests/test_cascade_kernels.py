"""The kernels of the cascades one by one: what an eye sees, splat, ramps, composite, filter, colours."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from kernel_helpers import points

from warp_caustics.eye import view_array
from warp_caustics.kernels.cascade_photon import RAMPS, Ramps, slope_of
from warp_caustics.kernels.composite import make_composite
from warp_caustics.kernels.deposit import FLUX
from warp_caustics.kernels.disperse import disperse
from warp_caustics.kernels.eye_splat import MOST_RADIUS, make_splat_eye, on_screen, outline, screen_step
from warp_caustics.kernels.eye_surface import eye_surface
from warp_caustics.kernels.filter import make_filter
from warp_caustics.kernels.views import View
from warp_caustics.views import EyeView, LightView

ROWS, COLUMNS = 36, 64
EYE = EyeView((0.3, -2.0, 1.5), (0.2, 0.5, -0.6), 50.0, (COLUMNS, ROWS))
FLOOR = -1.0
# Positions of metres in float32, projected with a focal length of tens of pixels.
FLOAT32 = 1e-5
# A pixel sees a trapezium, and its area is that of its middle times its size: second order in the pixel's angle.
PIXEL_SIZE = 0.01
# What is left of the ripple of even photons once its first two frequencies are gone: the diagonal one, 4 * 0.3 %.
RIPPLE = 0.013
SUMS = 1e-5  # of a few thousand float32


def floor_seen(device, eye=EYE, tolerance=(0.0, 2.0)):
    """Eye's depth, normal, plane and area of an endless level floor, by rays in float64, and the kernel's outputs."""
    projection = eye.projection()
    near, far = (projection.positions(np.full((ROWS, COLUMNS), depth)) for depth in (1.0, 2.0))
    way = far - near
    with np.errstate(divide="ignore"):
        depth = 1.0 + (FLOOR - near[..., 2]) / way[..., 2]
    depth = np.where((way[..., 2] < 0.0) & (depth < 50.0), depth, np.inf)
    arrays = {
        "view": wp.clone(view_array(projection), device=device),
        "depth": wp.array(depth.astype(np.float32), dtype=float, device=device),
        "normal": wp.full((ROWS, COLUMNS), wp.vec3(0.0, 0.0, 1.0), dtype=wp.vec3, device=device),
        "plane": wp.empty((ROWS, COLUMNS), dtype=wp.vec4, device=device),
        "area": wp.empty((ROWS, COLUMNS), dtype=float, device=device),
    }
    wp.launch(
        eye_surface,
        dim=(ROWS, COLUMNS),
        inputs=[0, arrays["view"], arrays["depth"], arrays["normal"], wp.vec2(*tolerance)],
        outputs=[arrays["plane"], arrays["area"]],
        device=device,
    )
    return projection, depth, arrays


def floor_at(projection, columns, rows):
    """Points of the floor under pixel positions."""
    inverse = np.linalg.inv(projection.matrix)
    eye = -inverse @ projection.offset
    ways = np.stack([columns, rows, np.ones_like(columns)], axis=-1) @ inverse.T
    return eye + ((FLOOR - eye[2]) / ways[..., 2])[..., None] * ways


def test_a_pixel_sees_the_area_of_its_outline_on_the_floor(device):
    projection, depth, arrays = floor_seen(device)
    row, column = np.meshgrid(np.arange(ROWS), np.arange(COLUMNS), indexing="ij")
    corners = [floor_at(projection, column + i * 1.0, row + j * 1.0) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))]
    x, y = (np.stack([corner[..., axis] for corner in corners]) for axis in (0, 1))
    outline_area = 0.5 * np.abs((x * np.roll(y, -1, axis=0) - np.roll(x, -1, axis=0) * y).sum(axis=0))
    seen = np.isfinite(depth) & (depth < 5.0)
    assert seen.sum() > 500
    np.testing.assert_allclose(arrays["area"].numpy()[seen], outline_area[seen], rtol=PIXEL_SIZE)
    assert (arrays["area"].numpy()[~np.isfinite(depth)] == 0.0).all()


def test_a_pixel_takes_what_lies_on_its_floor_and_nothing_off_it(device):
    projection, depth, arrays = floor_seen(device, tolerance=(0.01, 0.0))
    plane = arrays["plane"].numpy().astype(np.float64)
    seen = np.isfinite(depth)
    for off, inside in ((0.0, True), (0.009, True), (-0.009, True), (0.011, False), (-0.011, False)):
        point = projection.positions(depth) + np.array([0.0, 0.0, off])
        away = np.abs((plane[..., :3] * point).sum(axis=-1) - plane[..., 3])
        assert ((away[seen] <= 1.0) == inside).all()
    # The tolerance in footprints grows with the distance.
    _, _, wide = floor_seen(device, tolerance=(0.0, 2.0))
    footprint = depth[seen] / np.sqrt(abs(np.linalg.det(projection.matrix)))
    np.testing.assert_allclose(1.0 / wide["plane"].numpy()[..., 2][seen], 2.0 * footprint, rtol=FLOAT32)
    assert (wide["plane"].numpy()[..., 3][~seen] > 1e20).all()


@wp.kernel(enable_backward=False)
def footprints(
    view: wp.array[View], where: wp.array[wp.vec3], u: wp.vec3, v: wp.vec3, at_out: wp.array[wp.vec3],
    steps_out: wp.array[wp.vec4], ellipse_out: wp.array[wp.vec3],
):  # fmt: skip
    i = wp.tid()
    at = on_screen(view[0], where[i])
    a = screen_step(view[0], at, u)
    b = screen_step(view[0], at, v)
    at_out[i] = at
    steps_out[i] = wp.vec4(a[0], a[1], b[0], b[1])
    ellipse_out[i] = outline(a, b)


def test_steps_on_the_screen_are_those_of_the_projection(device):
    projection, _, arrays = floor_seen(device)
    where = np.random.default_rng(1).uniform((-1, -1, -1), (1, 3, -0.5), size=(50, 3))
    at, steps, ellipse = (wp.empty(50, dtype=d, device=device) for d in (wp.vec3, wp.vec4, wp.vec3))
    u, v = (0.01, 0.002, 0.003), (-0.001, 0.02, -0.004)
    wp.launch(footprints, dim=50, inputs=[arrays["view"], points(where, device), wp.vec3(*u), wp.vec3(*v)],
              outputs=[at, steps, ellipse], device=device)  # fmt: skip
    position, depth = projection.project(where)
    np.testing.assert_allclose(at.numpy(), np.c_[position, depth], rtol=FLOAT32)
    h = 1e-4
    expected = np.concatenate(
        [(projection.project(where + h * np.array(s))[0] - projection.project(where - h * np.array(s))[0]) / (2 * h)
         for s in (u, v)], axis=1,
    )  # fmt: skip
    np.testing.assert_allclose(steps.numpy(), expected, rtol=1e-4, atol=1e-5)
    # No footprint is thinner than a pixel, nor wider than what one photon may fill.
    xx, xy, yy = ellipse.numpy().T
    smallest = 0.5 * (xx + yy) - np.sqrt(0.25 * (xx - yy) ** 2 + xy**2)
    assert (smallest > 0.99).all() and (np.maximum(xx, yy) < MOST_RADIUS**2 + 2.0).all()


def splat_kernel(footprint):
    splat = make_splat_eye(footprint, "float32", 1)
    flux_type = FLUX[1]

    @wp.kernel(module="unique", enable_backward=False)
    def splat_photons(
        view: wp.array[View], plane: wp.array2d[wp.vec4], where: wp.array[wp.vec3], normal: wp.vec3,
        u: wp.vec3, v: wp.vec3, light_out: wp.array[float], taken_out: wp.array[float],
    ):  # fmt: skip
        i = wp.tid()
        flux = flux_type(1.0)
        at = on_screen(view[0], where[i])
        ellipse = outline(screen_step(view[0], at, u), screen_step(view[0], at, v))
        taken_out[i] = splat(light_out, plane, where[i], normal, at, ellipse, flux, 1, 0)

    return splat_photons


def splatted(device, footprint, where, u, v, arrays, normal=(0.0, 0.0, 1.0)):
    light = wp.zeros(ROWS * COLUMNS, dtype=float, device=device)
    taken = wp.empty(len(where), dtype=float, device=device)
    wp.launch(splat_kernel(footprint), dim=len(where), inputs=[arrays["view"], arrays["plane"], points(where, device),
              wp.vec3(*normal), wp.vec3(*u), wp.vec3(*v)], outputs=[light, taken], device=device)  # fmt: skip
    return light.numpy().reshape(ROWS, COLUMNS), taken.numpy()


@pytest.mark.parametrize("footprint", ["point", "pixel", "texel"])
def test_a_photon_gives_all_its_light_to_pixels_that_see_it(device, footprint):
    projection, _, arrays = floor_seen(device)
    random = np.random.default_rng(2)
    inside = floor_at(projection, random.uniform(8, 56, 40), random.uniform(8, 16, 40))
    above = inside + np.array([0.0, 0.0, 0.4])
    behind = np.array([[0.3, -5.0, 1.0]])
    u, v = (0.04, 0.0, 0.0), (0.0, 0.04, 0.0)
    light, taken = splatted(device, footprint, np.concatenate([inside, above, behind]), u, v, arrays)
    np.testing.assert_allclose(taken[:40], 1.0, rtol=SUMS)
    assert (taken[40:] == 0.0).all()
    assert light.sum() == pytest.approx(40.0, rel=SUMS)
    # What lands on a wall beside the floor is not the floor's, however near; a zero normal is not asked for.
    for normal, share in (((0.0, 0.9, 0.4), 0.0), ((0.0, 0.4, -0.9), 1.0), ((0.0, 0.0, 0.0), 1.0)):
        _, taken = splatted(device, footprint, inside, u, v, arrays, normal)
        np.testing.assert_allclose(taken, share, rtol=SUMS)
    one, _ = splatted(device, footprint, inside[:1], u, v, arrays)
    at = projection.project(inside[:1])[0][0]
    row, column = np.mgrid[:ROWS, :COLUMNS] + 0.5
    middle = np.array([(one * column).sum(), (one * row).sum()])
    # A point is put into its pixel's middle; the others keep their place, to what a pixel's sampling does to it.
    np.testing.assert_allclose(middle, at, atol=0.5 if footprint == "point" else 0.05)


def test_even_photons_light_a_floor_evenly_however_fine_the_pixels(device):
    projection, depth, arrays = floor_seen(device)
    spacing = 0.06  # of several pixels near the eye, of about one far away
    x, y = np.meshgrid(np.arange(-5.0, 5.0, spacing), np.arange(-2.0, 8.0, spacing))
    where = np.stack([x, y, np.full_like(x, FLOOR)], axis=-1).reshape(-1, 3)
    light, _ = splatted(device, "texel", where, (spacing, 0.0, 0.0), (0.0, spacing, 0.0), arrays)
    seen = projection.positions(depth)
    inside = np.isfinite(depth) & (np.abs(seen[..., 0]) < 3.0) & (np.abs(seen[..., 1] - 1.5) < 2.5)
    assert inside.sum() > 400
    even = light[inside] * spacing**2 / arrays["area"].numpy()[inside]
    assert even.mean() == pytest.approx(1.0, abs=0.5 * PIXEL_SIZE)
    assert even.std() < RIPPLE


def composed(device, depth, parts, flux=True, light=1.0):
    """Compose cascades one after the other; each is (reach, need, side, zone, scale). Looks straight down."""
    rows, columns = depth.shape
    eye = EyeView((0.0, 0.0, 5.0), (0.0, 0.0, 0.0), 60.0, (columns, rows)).projection()
    sun = LightView((0.0, 0.0, -1.0), (-1.0, -1.0, -1.0), (1.0, 1.0, 0.0), (10, 10)).projection()
    left = wp.full((rows, columns), 1.0, dtype=float, device=device)
    area = wp.full((rows, columns), 0.5, dtype=float, device=device)
    picture = wp.zeros(rows * columns * 3, dtype=float, device=device)
    given = wp.array(depth.astype(np.float32), dtype=float, device=device)
    lights = wp.full(rows * columns, light, dtype=float, device=device)
    found = []
    for reach, need, side, zone, scale in parts:
        before = picture.numpy().reshape(rows, columns, 3).copy()
        views = [wp.clone(view_array(view), device=device) for view in (eye, sun)]
        wp.launch(
            make_composite("float32", 1, 3, flux), dim=(rows, columns),
            inputs=[0, lights, views[0], given, area, views[1], wp.vec2(*reach), wp.vec4(*need), side, zone,
                    wp.vec3d(*scale)],
            outputs=[left, picture], device=device,
        )  # fmt: skip
        found.append(picture.numpy().reshape(rows, columns, 3) - before)
    return np.array(found)


UNSCALED = (1.0, 1.0, 1.0)
NOWHERE = (0.0, 0.0, 0.0, 0.0)
EVERYWHERE = (1e3, 1e3, -1e3, -1e3)  # texels that a view has to spare


@pytest.mark.parametrize("zone", [0.0, 0.3, 1.0])
def test_the_weights_of_the_cascades_add_up_to_one(device, zone):
    depth = np.linspace(0.01, 5.0, 400)[None, :]
    parts = [((end, zone), EVERYWHERE, 10.0, 0.0, UNSCALED) for end in (2.0, 3.0)]
    found = composed(device, depth, [*parts, ((4.0, 0.0), NOWHERE, 0.0, 0.0, UNSCALED)], flux=False)[..., 0]
    assert (found >= 0.0).all()
    np.testing.assert_allclose(found.sum(axis=0), 1.0, atol=1e-6)  # the last takes what lies behind it, too
    jump = max(np.abs(np.diff(one)).max() for one in found)
    assert jump == 1.0 if zone == 0.0 else jump <= np.diff(depth).max() / zone * 1.01


@pytest.mark.parametrize("zone", [0.0, 3.0])
def test_what_a_view_does_not_hold_falls_to_the_next(device, zone):
    """The eye looks down on 5.8 m of ground, of which the view of ten texels holds 2 m."""
    depth = np.full((40, 40), 5.0)
    need = (-1.0, -1.0, 1.0, 1.0)  # a texel to each side
    whole = ((9.0, 0.0), NOWHERE, 0.0, 0.0, UNSCALED)
    inner, rest = composed(device, depth, [((9.0, 0.0), need, 10.0, zone, UNSCALED), whole], flux=False)[..., 0]
    np.testing.assert_allclose(inner + rest, 1.0, atol=1e-6)
    x = (np.arange(40) + 0.5 - 20.0) / 20.0 * 5.0 * np.tan(np.radians(30.0))
    room = 5.0 * (1.0 - np.maximum(np.abs(x)[None, :], np.abs(x)[:, None])) - 1.0  # texels of 0.2 m
    expected = np.clip(room / zone, 0.0, 1.0) if zone else room >= 0.0
    np.testing.assert_allclose(inner, expected, atol=1e-4)
    assert 0.0 < inner.mean() < 0.2


def test_the_composite_is_flux_over_area_by_weight(device):
    depth = np.array([[1.0, 1.9, 2.5, np.inf]])
    part = ((2.0, 0.2), EVERYWHERE, 10.0, 0.0, (3.0, 6.0, 9.0))
    for flux, expected in ((True, [12.0, 6.0, 0.0, 0.0]), (False, [6.0, 3.0, 0.0, 0.0])):
        found = composed(device, depth, [part], flux, light=2.0)[0, 0]
        np.testing.assert_allclose(found, np.outer(expected, [1.0, 2.0, 3.0]), rtol=1e-5)


@wp.kernel(enable_backward=False)
def hard_ramp(ramps: Ramps, depths: wp.array[float], out: wp.array[float]):
    i = wp.tid()
    out[i] = wp.static(RAMPS["hard"])(ramps, depths[i])


@wp.kernel(enable_backward=False)
def smooth_ramp(ramps: Ramps, depths: wp.array[float], out: wp.array[float]):
    i = wp.tid()
    out[i] = wp.static(RAMPS["smooth"])(ramps, depths[i])


def test_the_ramps_are_those_of_the_thesis(device):
    ramps = Ramps()
    ramps.least, ramps.most = 0.2, 6.0
    depths = np.array([0.0, 0.2, 0.7, 1.2, 3.0, 5.0, 5.5, 6.0, 7.0], dtype=np.float32)
    found = {}
    for name, kernel in (("hard", hard_ramp), ("smooth", smooth_ramp)):
        out = wp.empty(len(depths), dtype=float, device=device)
        wp.launch(kernel, dim=len(depths), inputs=[ramps, wp.array(depths, dtype=float, device=device)], outputs=[out],
                  device=device)  # fmt: skip
        found[name] = out.numpy()
    shallow = np.clip(depths - 0.2, 0.0, 1.0)
    np.testing.assert_allclose(found["hard"], shallow * np.clip(6.0 - depths, 0.0, 1.0), atol=1e-6)
    np.testing.assert_allclose(found["smooth"], shallow * np.clip((6.0 - depths) / 6.0, 0.0, 1.0), atol=1e-6)


@wp.kernel(enable_backward=False)
def slopes(normals: wp.array[wp.vec3], slope_out: wp.array[wp.vec2]):
    i = wp.tid()
    slope_out[i] = slope_of(normals[i])


def test_a_normal_gives_its_slope(device):
    given = np.random.default_rng(3).uniform(-0.8, 0.8, size=(100, 2))
    normals = np.c_[-given, np.ones(100)] / np.sqrt(1.0 + (given**2).sum(axis=1))[:, None]
    out = wp.empty(100, dtype=wp.vec2, device=device)
    wp.launch(slopes, dim=100, inputs=[points(normals, device)], outputs=[out], device=device)
    np.testing.assert_allclose(out.numpy(), given, atol=1e-6)


def filtered(device, guided, picture, depth, normal, arrays, radius=2):
    out = wp.empty(ROWS * COLUMNS, dtype=float, device=device)
    inputs = [0, wp.array(picture.ravel().astype(np.float32), dtype=float, device=device), arrays["view"],
              wp.array(depth.astype(np.float32), dtype=float, device=device),
              points(normal.reshape(-1, 3), device).reshape((ROWS, COLUMNS)), arrays["plane"], radius]  # fmt: skip
    wp.launch(make_filter(guided, 1), dim=(ROWS, COLUMNS), inputs=inputs, outputs=[out], device=device)
    return out.numpy().reshape(ROWS, COLUMNS)


def test_filters_keep_an_even_picture_and_the_blur_is_a_box(device):
    _, depth, arrays = floor_seen(device)
    normal = np.broadcast_to([0.0, 0.0, 1.0], (ROWS, COLUMNS, 3))
    seen = np.isfinite(depth)
    for guided in (False, True):
        even = filtered(device, guided, np.full((ROWS, COLUMNS), 3.0), depth, normal, arrays)
        np.testing.assert_allclose(even[seen], 3.0, rtol=SUMS)
        assert (even[~seen] == 0.0).all()
    spot = np.zeros((ROWS, COLUMNS))
    spot[8, 30] = 25.0
    blurred = filtered(device, False, spot, depth, normal, arrays)
    expected = np.zeros_like(spot)
    expected[6:11, 28:33] = 1.0
    np.testing.assert_allclose(blurred, expected, atol=1e-5)


def test_the_bilateral_filter_keeps_light_on_its_own_surface(device):
    # The right half is another surface: in one case it leans, in the other it stands a metre higher.
    for leans in (True, False):
        projection, depth, arrays = floor_seen(device)
        normal = np.broadcast_to([0.0, 0.0, 1.0], (ROWS, COLUMNS, 3)).copy()
        right = np.arange(COLUMNS) >= 32
        if leans:
            normal[:, right] = (0.9, 0.0, np.sqrt(1.0 - 0.81))
        else:
            eye = -np.linalg.inv(projection.matrix) @ projection.offset
            depth[:, right] *= (FLOOR + 1.0 - eye[2]) / (FLOOR - eye[2])
        picture = np.where(right, 1.0, 0.0)[None, :] * np.ones((ROWS, 1))
        guided = filtered(device, True, picture, depth, normal, arrays)
        plain = filtered(device, False, picture, depth, normal, arrays)
        near = slice(4, 12), slice(30, 32)
        assert plain[near].max() > 0.3
        assert guided[near].max() < 0.02


def test_channels_move_by_the_difference_of_their_ways(device):
    projection, depth, arrays = floor_seen(device)
    position = projection.positions(np.where(np.isfinite(depth), depth, np.nan))
    # A picture that is linear on the floor in x and y, as the eye sees it: what is read says from where.
    ramp = np.nan_to_num(position[..., 0] + 10.0 * position[..., 1])
    picture = np.repeat(ramp[..., None], 3, axis=-1)
    ways = np.array([[0.05, -0.02], [0.0, 0.0], [-0.04, 0.03]])
    out = wp.empty(ROWS * COLUMNS * 3, dtype=float, device=device)
    wp.launch(disperse, dim=(ROWS, COLUMNS), inputs=[
        0, wp.array(picture.ravel().astype(np.float32), dtype=float, device=device), arrays["view"], arrays["depth"],
        arrays["normal"], arrays["plane"], points(ways, device)], outputs=[out], device=device)  # fmt: skip
    moved = out.numpy().reshape(ROWS, COLUMNS, 3)
    shift = FLOOR * (ways[:, 0] + 10.0 * ways[:, 1])
    inner = (slice(3, 14), slice(4, 60))
    # The floor is seen in perspective, so that what is linear on it is not between pixels.
    np.testing.assert_allclose(moved[inner] - picture[inner], np.broadcast_to(shift, moved[inner].shape), atol=0.01)
    np.testing.assert_array_equal(moved[..., 1], picture[..., 1].astype(np.float32))
