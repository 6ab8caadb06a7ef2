"""How nearly a ray clears a surface: the shadow of crests, the exit through troughs, near misses, against float64."""

import numpy as np
import pytest
import warp as wp
from kernel_helpers import grid_surface, points, wave_surface

from warp_caustics.kernels.project import FAR, make_clearance
from warp_caustics.kernels.surface import Surface

wp.set_module_options({"enable_backward": False})

STEP = 1e-3  # smallest step of the marches [m]
CREST, WAVENUMBER = 0.1, 8.0  # a sine of slope 0.8
# A march goes by the gap itself, and step by step where that is less: past a few steps it knows it to a part only.
NEAR_TOLERANCE = 0.3 * STEP

clear_of_waves = make_clearance("waves")
clear_of_grid = make_clearance("grid")


@wp.kernel
def clear(
    by_grid: bool, surface: Surface, origins: wp.array[wp.vec3], directions: wp.array[wp.vec3], side: float,
    slope: float, bound: float, step: float, nearest: wp.array[wp.vec2],
):  # fmt: skip
    i = wp.tid()
    if by_grid:
        nearest[i] = clear_of_grid(surface, origins[i], directions[i], side, slope, bound, step)
    else:
        nearest[i] = clear_of_waves(surface, origins[i], directions[i], side, slope, bound, step)


def clearance(surface, origins, directions, side, slope, bound, device, by_grid=False):
    """Clearance and its distance, [n, 2]."""
    nearest = wp.zeros(len(origins), dtype=wp.vec2, device=device)
    inputs = [by_grid, surface, points(origins, device), points(directions, device), side, slope, bound, STEP]
    wp.launch(clear, dim=len(origins), inputs=inputs, outputs=[nearest], device=device)
    return nearest.numpy().astype(np.float64)


def least_gap(origins, directions, side, longest=4.5, samples=10000):
    """Least height of a ray over, or under, the sine while it closes in, in float64; inf if it never does."""
    t = np.linspace(0.0, longest, samples + 1)
    x = origins[:, None, 0] + t * directions[:, None, 0]
    gap = side * (origins[:, None, 2] + t * directions[:, None, 2] - CREST * np.sin(WAVENUMBER * x))
    gap[:, 0] = 0.0
    return np.where(np.diff(gap, axis=1) < 0.0, gap[:, 1:], np.inf).min(axis=1)


def from_the_sine(turns, angles, side):
    """Rays from points of the sine, in turns, along +x, up (side 1) or down (-1), at angles from the horizontal."""
    x = 2.0 * np.pi / WAVENUMBER * turns
    origins = np.stack([x, 0.0 * x, CREST * np.sin(WAVENUMBER * x)], axis=1)
    directions = np.stack([np.cos(angles), 0.0 * x, side * np.sin(angles)], axis=1)
    return origins, directions


def sine(device, by_grid=False):
    """The sine as waves, or as a height map."""
    if not by_grid:
        return wave_surface([(CREST, (WAVENUMBER, 0.0), 0.0)], device)
    row = CREST * np.sin(WAVENUMBER * np.arange(-1.0, 8.0, 1.0 / 128.0))
    return grid_surface(np.tile(row, (5, 1)), (-1.0, -2.0), (1.0 / 128.0, 1.0), device)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("by_grid", [False, True])
def test_clearance_tells_which_rays_meet_a_sine(device, side, by_grid):
    """Towards a low sun, the shadow of crests; along a flat refracted ray, the exit through the troughs."""
    rng = np.random.default_rng(4)
    origins, directions = from_the_sine(rng.uniform(0.0, 2.5, 400), np.radians(rng.uniform(3.0, 45.0, 400)), side)
    found = clearance(sine(device, by_grid), origins, directions, side, CREST * WAVENUMBER, CREST, device, by_grid)
    expected = least_gap(origins, directions, side)
    # The gap changes by a step times the closing speed, at most 1, between the points of a march.
    sure = np.abs(expected) > STEP
    assert ((found[:, 0] < 0.0) == (expected < 0.0))[sure].all()
    assert 0.2 < (expected < 0.0).mean() < 0.8  # both fates are there
    assert sure.mean() > 0.95


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_clearance_of_near_misses_is_right_to_a_part_of_a_step(device, side):
    """An edge of shadow is drawn from it: rays past the next crest, lower or higher by some steps."""
    rng = np.random.default_rng(7)
    turns = rng.uniform(0.5, 0.7, 200) + (0.0 if side > 0.0 else 0.5)
    x, z = 2.0 * np.pi / WAVENUMBER * turns, CREST * np.sin(2.0 * np.pi * turns)
    ahead = x[:, None] + np.linspace(0.05, 0.8, 4000)
    tangent = np.arctan(side * (CREST * np.sin(WAVENUMBER * ahead) - z[:, None]) / (ahead - x[:, None])).max(axis=1)
    origins, directions = from_the_sine(turns, tangent + rng.uniform(-6e-3, 6e-3, 200), side)
    found = clearance(sine(device), origins, directions, side, CREST * WAVENUMBER, CREST, device)[:, 0]
    expected = least_gap(origins, directions, side)
    assert 0.3 < (expected < 0.0).mean() < 0.7
    assert np.abs(expected).max() < 4.0 * STEP
    assert (np.abs(found - expected) < NEAR_TOLERANCE).all()


def test_a_ray_that_never_closes_in_is_far_from_everything(device):
    """The sun at the zenith, and a surface without waves, cast no shadow and show no near miss."""
    origins, directions = from_the_sine(np.linspace(0.0, 1.0, 20), np.full(20, np.pi / 2.0), 1.0)
    assert (clearance(sine(device), origins, directions, 1.0, 0.8, CREST, device)[:, 0] == np.float32(FAR)).all()
    flat = wave_surface([], device)
    origins[:, 2] = 0.0
    directions = np.tile([np.cos(0.1), 0.0, np.sin(0.1)], (20, 1))
    assert (clearance(flat, origins, directions, 1.0, 0.0, 0.0, device)[:, 0] == np.float32(FAR)).all()


def test_the_distance_of_the_closest_approach_is_where_the_crest_is(device):
    """A ray that skims a crest by a millimetre, from the trough before it."""
    x, top = 1.5 * np.pi / WAVENUMBER, 2.5 * np.pi / WAVENUMBER
    rise = 2.0 * CREST + 0.004
    way = np.array([top - x, 0.0, rise])
    origins = np.array([[x, 0.0, -CREST]])
    directions = (way / np.linalg.norm(way))[None, :]
    found = clearance(sine(device), origins, directions, 1.0, CREST * WAVENUMBER, CREST + 0.1, device)[0]
    t = np.linspace(0.2, 0.6, 100_001)
    gap = -CREST + t * directions[0, 2] - CREST * np.sin(WAVENUMBER * (x + t * directions[0, 0]))
    assert found[0] == pytest.approx(gap.min(), abs=2.0 * STEP)
    assert found[1] == pytest.approx(t[gap.argmin()], abs=0.03)
