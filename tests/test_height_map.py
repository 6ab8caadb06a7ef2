"""Height maps: fourth-order differences, the Hermite surface through them, its border, and its bounds."""

import numpy as np
import pytest
import warp as wp
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from kernel_helpers import grid_surface, points, rounded

import warp_caustics as wc
from warp_caustics.assets import Assets, HeightGrid
from warp_caustics.height_map import covers, difference, hermite_nodes, node_spacing, sample_heights
from warp_caustics.kernels.grid import grid_cell
from warp_caustics.kernels.surface import Surface, grid_at, grid_curved_at
from warp_caustics.kernels.waves import vec6
from warp_caustics.receiver import receiver_bounds
from warp_caustics.water import amplitude_bound, extreme_slopes

wp.set_module_options({"enable_backward": False})

# Sixteen products of float32, a few of them of opposite sign.
VALUE_TOLERANCE = 2e-6
# The derivatives' weights are larger, up to 6 and 12, and cancel.
SLOPE_TOLERANCE = 1e-5
CURVATURE_TOLERANCE = 1e-4
# An order measured from two spacings misses its limit by what the next order adds.
ORDER_MARGIN = 0.25

ORIGIN, SPACING = (-1.25, 0.5), (0.25, 0.125)  # powers of two, so that float32 holds them


@wp.kernel
def at_points(surface: Surface, at: wp.array[wp.vec2], sums: wp.array[wp.vec3], curved: wp.array[vec6]):
    i = wp.tid()
    p = at[i]
    sums[i] = grid_at(surface, p[0], p[1])
    curved[i] = grid_curved_at(surface, p[0], p[1])


@wp.kernel
def cells_of(positions: wp.array[float], count: int, cells: wp.array[int]):
    i = wp.tid()
    cells[i] = grid_cell(positions[i], count)


def evaluate(z, at, device, origin=ORIGIN, spacing=SPACING):
    """Sums [n, 3] and curved sums [n, 6] of the surface through nodes z, at points [n, 2]."""
    surface = grid_surface(z, origin, spacing, device)
    sums, curved = wp.zeros(len(at), dtype=wp.vec3, device=device), wp.zeros(len(at), dtype=vec6, device=device)
    wp.launch(at_points, dim=len(at), inputs=[surface, points(at, device)], outputs=[sums, curved], device=device)
    return sums.numpy().astype(np.float64), curved.numpy().astype(np.float64)


def nodes(shape, origin=ORIGIN, spacing=SPACING):
    """World coordinates of nodes, each of ``shape``."""
    x, y = (o + s * np.arange(n) for o, s, n in zip(origin, spacing, shape[::-1], strict=True))
    return np.meshgrid(x, y)


def polynomial(x, y):
    """A bicubic: value, slopes and second derivatives, [..., 6]."""
    p, px, pxx = x**3 - 2.0 * x, 3.0 * x**2 - 2.0, 6.0 * x
    q, qy, qyy = 1.0 + y - 0.5 * y**3, 1.0 - 1.5 * y**2, -3.0 * y
    return np.stack([p * q, px * q, p * qy, pxx * q, px * qy, p * qyy], axis=-1)


def ripple(x, y, k=(2.0, 3.0)):
    """A sine: value, slopes and second derivatives, [..., 6]."""
    s, c = np.sin(k[0] * x + k[1] * y), np.cos(k[0] * x + k[1] * y)
    return np.stack([s, k[0] * c, k[1] * c, -(k[0] ** 2) * s, -k[0] * k[1] * s, -(k[1] ** 2) * s], axis=-1)


@pytest.mark.parametrize("axis", [0, 1])
def test_differences_are_exact_for_a_quartic_to_the_last_node(axis):
    i = np.arange(9.0)
    z, slope = 1.0 + i - 0.3 * i**2 + 0.1 * i**3 - 0.02 * i**4, 1.0 - 0.6 * i + 0.3 * i**2 - 0.08 * i**3
    z = z[:, None] * np.ones((1, 5)) if axis == 0 else z[None, :] * np.ones((5, 1))
    found = np.moveaxis(difference(z, axis), axis, 0)[:, 2]
    assert found == pytest.approx(slope, abs=1e-11)
    assert np.abs(difference(z, 1 - axis)).max() < 1e-11


@pytest.mark.parametrize("where", [slice(2, -2), slice(0, 1), slice(1, 2), slice(-1, None), slice(-2, -1)])
def test_differences_are_of_fourth_order_inside_and_at_both_ends(where):
    """Half the spacing, a sixteenth of the error, at the first two, the last two and all other nodes."""
    errors = []
    for n in (40, 80, 160):
        x = np.linspace(0.0, 2.0, n + 1)
        error = difference(np.exp(x), 0) * n / 2.0 - np.exp(x)  # no derivative of it is zero anywhere
        errors.append(np.abs(error[where]).max())
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert np.abs(orders - 4.0).max() < ORDER_MARGIN


def test_nodes_hold_height_slopes_and_twist_by_node():
    x, y = nodes((8, 9))
    found, expected = hermite_nodes(polynomial(x, y)[..., 0]), polynomial(x, y)
    by_node = np.array([1.0, SPACING[0], SPACING[1], SPACING[0] * SPACING[1]])
    assert found == pytest.approx(expected[..., [0, 1, 2, 4]] * by_node, abs=1e-12)


def inner_points(shape, n=400, seed=5):
    """Points anywhere on a map, to half a node past its last node."""
    rng = np.random.default_rng(seed)
    low = np.subtract(ORIGIN, np.multiply(0.5, SPACING))
    return rounded(low + rng.random((n, 2)) * np.multiply(SPACING, shape[::-1]))


def test_a_bicubic_is_met_exactly_with_slope_and_curvature(device):
    """To float32 rounding, everywhere, in the half nodes past the last ones too."""
    shape = (8, 9)
    at = inner_points(shape)
    sums, curved = evaluate(polynomial(*nodes(shape))[..., 0], at, device)
    expected = polynomial(at[:, 0], at[:, 1])
    scale = np.abs(expected).max(axis=0)
    # Slopes by node are divided by the spacing, 1/4 and 1/8 m: their rounding grows as much, or by its square.
    tolerance = np.array([VALUE_TOLERANCE] + [SLOPE_TOLERANCE] * 2 + [CURVATURE_TOLERANCE] * 3) * scale
    assert (np.abs(curved - expected).max(axis=0) < tolerance).all()
    assert (np.abs(sums - expected[:, :3]).max(axis=0) < tolerance[:3]).all()


def test_order_of_value_slope_and_curvature(device):
    """On a sine: errors of order 4 in the height, 3 in the slope, 2 in the curvature."""
    errors = []
    for n in (12, 24):
        x = np.linspace(0.0, 1.0, n + 1)
        z = ripple(*np.meshgrid(x, x))[..., 0]
        at = rounded(0.2 + 0.6 * np.random.default_rng(2).random((2000, 2)))
        _, curved = evaluate(z, at, device, (0.0, 0.0), (1.0 / n, 1.0 / n))
        errors.append(np.abs(curved - ripple(at[:, 0], at[:, 1])).max(axis=0))
    orders = np.log2(errors[0] / errors[1])
    # Errors of 1e-6 in the height are near float32's own: its order is only shown not to be a lower one.
    assert orders[0] > 4.0 - 3.0 * ORDER_MARGIN
    assert np.abs(orders[1:3] - 3.0).max() < 2.0 * ORDER_MARGIN
    assert np.abs(orders[3:] - 2.0).max() < 2.0 * ORDER_MARGIN


def test_height_and_slope_are_continuous_across_nodes(device):
    """However rough the nodes: a point a hair left of a node line and one a hair right of it."""
    z = np.random.default_rng(7).random((7, 8))
    x = ORIGIN[0] + SPACING[0] * np.arange(1, 7)
    y = ORIGIN[1] + 2.3 * SPACING[1]
    hair = 2.0**-20
    sides = [np.stack([x + side * hair, np.full(6, y)], axis=-1) for side in (-1.0, 1.0)]
    left, right = (evaluate(z, side, device)[0] for side in sides)
    # Slopes reach 10, second derivatives 300: over a hair that is 3e-4.
    assert np.abs(left - right)[:, 0].max() < 3e-5
    assert np.abs(left - right)[:, 1:].max() < 1e-3


def test_slope_and_curvature_are_derivatives_of_the_height(device):
    """The kernel's own slope against central differences of its own height, on rough nodes."""
    z = np.random.default_rng(8).random((6, 6))
    h = 2.0**-8
    at = rounded(
        ORIGIN + np.random.default_rng(9).uniform(0.05, 0.95, (100, 2)) * np.array(SPACING) + 2 * np.array(SPACING)
    )
    sums, curved = evaluate(z, at, device)
    for axis in (0, 1):
        step = np.eye(2)[axis] * h
        inside = ((at - step - ORIGIN) // SPACING == (at + step - ORIGIN) // SPACING).all(axis=1)
        ahead, behind = evaluate(z, at + step, device)[0], evaluate(z, at - step, device)[0]
        rate = (ahead - behind)[inside] / (2.0 * h)
        # A cubic's third derivative, up to 2e4 here, leaves h²/6 of itself.
        assert np.abs(rate[:, 0] - sums[inside, 1 + axis]).max() < 0.06
        second = rate[:, 1:] if axis == 0 else rate[:, 2:]
        expected = curved[inside, 3:5] if axis == 0 else curved[inside, 5:6]
        assert np.abs(second - expected).max() < 0.5


def test_past_its_border_a_map_stays_at_its_border(device):
    """Half a node past the last one the map ends: beyond stands the height of the border, finite however far."""
    shape = (8, 9)
    z = polynomial(*nodes(shape))[..., 0]
    border = np.array([ORIGIN[0] - 0.5 * SPACING[0], ORIGIN[1] + 2.0 * SPACING[1]])
    beyond = np.array([border, border - [0.1, 0.0], border - [1e6, 0.0], border - [1e30, 0.0], border - [np.inf, 0.0]])
    sums, _ = evaluate(z, beyond, device)
    assert (sums[1:] == sums[0]).all()
    assert sums[0, 0] == pytest.approx(polynomial(*border)[0], abs=VALUE_TOLERANCE)
    far = np.array([[1e9, 1e9], [ORIGIN[0] + (9 - 0.5) * SPACING[0], ORIGIN[1] + (8 - 0.5) * SPACING[1]]])
    sums, _ = evaluate(z, far, device)
    assert (sums[0] == sums[1]).all()


def test_an_index_is_bounded_whatever_the_position(device):
    """int(nan) is the smallest integer on one device and 0 on another: neither may be read at."""
    odd = np.array(
        [np.nan, -np.nan, np.inf, -np.inf, 1e30, -1e30, 3e9, -3e9, -0.5, 0.0, 2.5, 3.999, 4.0, 4.5], np.float32
    )
    cells = wp.zeros(len(odd), dtype=int, device=device)
    inputs = [wp.array(odd, dtype=float, device=device), 5]
    wp.launch(cells_of, dim=len(odd), inputs=inputs, outputs=[cells], device=device)
    found = cells.numpy()
    assert ((found >= 0) & (found <= 3)).all()
    assert found[8:].tolist() == [0, 0, 2, 3, 3, 3]


def test_a_point_that_is_no_number_reads_no_other_memory(device):
    z = np.random.default_rng(1).random((5, 5))
    at = np.array([[np.nan, 0.6], [-1.0, np.nan], [np.nan, np.nan], [np.inf, -np.inf], [1e9, -1e9]])
    sums, curved = evaluate(z, at, device)
    assert np.isfinite(sums[3:]).all() and np.isfinite(curved[3:]).all()
    assert (sums[3] == sums[4]).all()


@settings(deadline=None, max_examples=40)
@given(z=hnp.arrays(np.float64, st.tuples(st.integers(5, 9), st.integers(5, 9)), elements=st.floats(-1.0, 1.0)))
def test_host_and_device_see_one_surface(z):
    """sample_heights is the kernel's surface in float64, at world coordinates, past the border too."""
    grid = HeightGrid(z, (100.0, -20.0), (0.25 * z.shape[1], 0.5 * z.shape[0]))
    spacing = node_spacing(grid)
    assert spacing.tolist() == [0.25, 0.5]
    at = np.random.default_rng(0).uniform(-0.3, 1.3, (50, 2)) * np.array(grid.size)
    sums, _ = evaluate(z, at, "cpu", 0.5 * spacing, spacing)
    at = rounded(at)
    host = sample_heights(grid, 100.0 + at[:, 0], -20.0 + at[:, 1])
    # Positions are rounded to 1e-7 of the map, and slopes by node may be 3.
    assert np.abs(sums[:, 0] - host).max() < 10.0 * VALUE_TOLERANCE


def test_sample_heights_passes_through_the_samples():
    """Sample (row, col) stands at origin + (col + 0.5, row + 0.5) spacings."""
    z = np.random.default_rng(4).random((6, 7))
    grid = HeightGrid(z, (3.0, -2.0), (7 * 0.3, 6 * 0.2))
    x, y = 3.0 + 0.3 * (np.arange(7) + 0.5), -2.0 + 0.2 * (np.arange(6) + 0.5)
    assert sample_heights(grid, x[None, :] + 0.0 * y[:, None], y[:, None] + 0.0 * x) == pytest.approx(z, abs=1e-12)


def test_covers_tells_inside_from_outside():
    grid = HeightGrid(np.zeros((5, 5)), (1.0, 2.0), (5.0, 5.0))
    assert covers(grid, (1.0, 2.0), (5.0, 5.0))
    assert covers(grid, (1.0 - 1e-4, 2.0), (5.0, 5.0))
    assert not covers(grid, (0.9, 2.0), (1.0, 1.0))
    assert not covers(grid, (1.0, 2.0), (5.0, 5.1))


def rough(kind):
    """Nodes that a bound by what stands at the nodes may miss."""
    i, j = np.meshgrid(np.arange(16), np.arange(16))
    return {
        "smooth": np.sin(0.4 * i + 0.3 * j),
        "four nodes a wave": np.sin(0.5 * np.pi * i),
        "cliff": np.where(i < 8, 0.0, 1.0),
        "two nodes a wave": np.where(i % 2 == 0, 0.0, 1.0),
        "one pillar": np.where((i == 8) & (j == 8), 1.0, 0.0),
        "noise": np.random.default_rng(3).random((16, 16)),
    }[kind]


def found_between(z, parts=8):
    """Largest slope, lowest and highest point of the surface, looked for between its nodes and in its border."""
    grid = HeightGrid(z, (0.0, 0.0), (float(z.shape[1]), float(z.shape[0])))
    h = 1e-5
    x = np.linspace(2.0 * h, grid.size[0] - 2.0 * h, parts * z.shape[1] + 1)
    y = np.linspace(2.0 * h, grid.size[1] - 2.0 * h, parts * z.shape[0] + 1)
    x, y = np.meshgrid(x, y)
    zx = (sample_heights(grid, x + h, y) - sample_heights(grid, x - h, y)) / (2.0 * h)
    zy = (sample_heights(grid, x, y + h) - sample_heights(grid, x, y - h)) / (2.0 * h)
    height = sample_heights(grid, x, y)
    return grid, float(np.hypot(zx, zy).max()), float(height.min()), float(height.max())


def over_grid(grid):
    """A scene whose water, or whose terrain, is a height map that is at hand already."""
    file = {"file": "at-hand.npy", "origin": grid.origin, "size": grid.size}
    common = {
        "sun": {"direction": (0.2, 0.1, -1.0)},
        "medium": {"ior": 1.333},
        "map": {"origin": grid.origin, "size": grid.size, "resolution": (8, 8)},
    }
    water = wc.Scene(**common, water={"level": 9.0, "height_map": file}, receiver={"plane": 0.0})
    terrain = wc.Scene(**common, water={"level": 9.0, "waves": []}, receiver={"terrain": file})
    return water, terrain


ROUGH = ["four nodes a wave", "cliff", "two nodes a wave", "one pillar", "noise"]
KINDS = ["smooth", *ROUGH]


@pytest.mark.parametrize("kind", KINDS)
def test_the_bounds_of_a_terrain_hold_between_its_nodes(kind):
    """A march steps by the slope's bound, and gives up outside those of the height."""
    grid, steepest, lowest, highest = found_between(rough(kind))
    bounds = receiver_bounds(over_grid(grid)[1], Assets(None, grid, None, None), np.zeros(2), np.array(grid.size))
    assert bounds.slope >= steepest
    assert bounds.lowest <= lowest and bounds.highest >= highest


@pytest.mark.parametrize("kind", KINDS)
def test_the_bounds_of_water_from_a_file_hold_between_its_nodes(kind):
    """The window of water that lights the map follows from them."""
    grid, steepest, lowest, highest = found_between(rough(kind))
    water, assets = over_grid(grid)[0], Assets(grid, None, None, None)
    assert np.linalg.norm(extreme_slopes(water, assets), axis=1).max() >= steepest
    assert amplitude_bound(water, assets) >= max(-lowest, highest)


def test_the_bounds_of_a_smooth_map_are_not_far_too_wide():
    """A bound that is no use would pass the tests above: within a half of what is found."""
    grid, steepest, lowest, highest = found_between(rough("smooth"))
    bounds = receiver_bounds(over_grid(grid)[1], Assets(None, grid, None, None), np.zeros(2), np.array(grid.size))
    assert bounds.slope < 1.5 * steepest
    assert bounds.highest - bounds.lowest < 1.5 * (highest - lowest)
