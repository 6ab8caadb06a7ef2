"""Snell, Fresnel and what a tilted surface takes in, against float64."""

import numpy as np
import pytest
import warp as wp
from hypothesis import given, settings
from hypothesis import strategies as st
from kernel_helpers import points, rounded

from oracle import optics as oracle
from oracle import refract as oracle_refract
from oracle import transmittance as oracle_transmittance
from warp_caustics.kernels.optics import (
    facing,
    fresnel_transmittance,
    refract,
    refract_at_slope,
    transmittance_at_slope,
)

wp.set_module_options({"enable_backward": False})

# Unit vectors of float32: a dozen roundings of 6e-8.
SNELL_TOLERANCE = 1e-6
# Towards grazing light the transmittance follows the cosine, which is rounded to 1e-7, by a slope of 4 / cos(t): at an
# index near 1 light grazes inside as well, and the slope passes 40.
FRESNEL_TOLERANCE = 1e-5
# The table of the published figures has three decimals.
TABLE_TOLERANCE = 5e-4


@wp.kernel
def at_slopes(
    directions: wp.array[wp.vec3], slopes: wp.array[wp.vec2], iors: wp.array[float],
    by_normal: wp.array[wp.vec3], by_slope: wp.array[wp.vec3], taken: wp.array[float], passes: wp.array[float],
):  # fmt: skip
    i = wp.tid()
    slope = slopes[i]
    normal = wp.normalize(wp.vec3(-slope[0], -slope[1], 1.0))
    by_normal[i] = refract(directions[i], normal, 1.0 / iors[i])
    by_slope[i] = refract_at_slope(directions[i], slope, 1.0 / iors[i])
    taken[i] = facing(directions[i], slope)
    passes[i] = transmittance_at_slope(directions[i], by_slope[i], slope, iors[i])


@wp.kernel
def at_normals(
    directions: wp.array[wp.vec3], normals: wp.array[wp.vec3], etas: wp.array[float], refracted: wp.array[wp.vec3]
):
    i = wp.tid()
    refracted[i] = refract(directions[i], normals[i], etas[i])


@wp.kernel
def fresnel(cosines: wp.array[wp.vec2], iors: wp.array[float], passes: wp.array[float]):
    i = wp.tid()
    passes[i] = fresnel_transmittance(cosines[i][0], cosines[i][1], iors[i])


def surface_light(directions, slopes, iors, device):
    """Refraction by normal and by slope, flux taken in, and transmittance, of n rays at n slopes."""
    n = len(directions)
    outputs = [wp.zeros(n, dtype=dtype, device=device) for dtype in (wp.vec3, wp.vec3, float, float)]
    inputs = [points(directions, device), points(slopes, device), wp.array(iors, dtype=float, device=device)]
    wp.launch(at_slopes, dim=n, inputs=inputs, outputs=outputs, device=device)
    return [output.numpy() for output in outputs]


def refracted(directions, normals, etas, device):
    """Refract n rays at n normals."""
    out = wp.zeros(len(directions), dtype=wp.vec3, device=device)
    inputs = [points(directions, device), points(normals, device), wp.array(etas, dtype=float, device=device)]
    wp.launch(at_normals, dim=len(directions), inputs=inputs, outputs=[out], device=device)
    return out.numpy()


def sunlight(zenith, azimuth):
    """Directions of travel [n, 3] from angles in radians."""
    return np.stack([np.sin(zenith) * np.cos(azimuth), np.sin(zenith) * np.sin(azimuth), -np.cos(zenith)], axis=-1)


def random_rays(n=4000, seed=1):
    """Lit slopes up to 1.5 under suns down to 89 degrees from the zenith, ior 1 to 2, in float32 values."""
    rng = np.random.default_rng(seed)
    directions = sunlight(np.radians(89.0) * rng.random(n), 2.0 * np.pi * rng.random(n))
    turn, steep = 2.0 * np.pi * rng.random(n), 1.5 * rng.random(n)
    slopes = np.stack([steep * np.cos(turn), steep * np.sin(turn)], axis=-1)
    iors = 1.0 + rng.random(n)
    directions, slopes, iors = rounded(directions), rounded(slopes), rounded(iors)
    lit = (slopes * directions[:, :2]).sum(axis=1) - directions[:, 2] > 0.0
    return directions[lit], slopes[lit], iors[lit]


def oracle_rays(directions, slopes, iors):
    """The same in float64: refracted [n, 3] and the cosine of incidence [n]."""
    rays, cosines = [], []
    for direction, slope, ior in zip(directions, slopes, iors, strict=True):
        *ray, cosine = oracle.refract_slopes(direction / np.linalg.norm(direction), *(slope[:, None]), ior)
        rays.append(np.concatenate(ray))
        cosines.append(cosine[0])
    return np.array(rays), np.array(cosines)


def test_snell_in_both_forms_equals_float64(device):
    directions, slopes, iors = random_rays()
    by_normal, by_slope, _, _ = surface_light(directions, slopes, iors, device)
    expected, _ = oracle_rays(directions, slopes, iors)
    assert np.abs(by_normal - expected).max() < SNELL_TOLERANCE
    assert np.abs(by_slope - expected).max() < SNELL_TOLERANCE


def test_the_law_of_sines_and_one_plane(device):
    """Snell as a schoolbook has it, by no formula of vectors: n sin t = sin i, in the plane of light and normal."""
    directions, slopes, iors = random_rays(seed=2)
    _, rays, _, _ = surface_light(directions, slopes, iors, device)
    rays = rays.astype(np.float64)
    normals = np.concatenate([-slopes, np.ones((len(slopes), 1))], axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    before, after = np.cross(directions, normals), np.cross(rays, normals)
    assert np.abs(iors[:, None] * after - before).max() < 2.0 * SNELL_TOLERANCE  # ior up to 2
    assert np.abs(np.linalg.norm(rays, axis=1) - 1.0).max() < SNELL_TOLERANCE
    assert ((rays * normals).sum(axis=1) < 0.0).all()


def test_a_ray_along_the_normal_and_an_index_of_one_change_nothing(device):
    directions = sunlight(np.radians([0.0, 30.0, 60.0, 85.0]), np.zeros(4))
    straight = refracted(directions, -directions, np.full(4, 1.0 / 1.333), device)
    assert np.abs(straight - directions).max() < SNELL_TOLERANCE
    _, by_slope, _, passes = surface_light(directions, np.full((4, 2), 0.05), np.ones(4), device)
    assert np.abs(by_slope - directions).max() < SNELL_TOLERANCE
    assert np.abs(passes - 1.0).max() < FRESNEL_TOLERANCE


def test_total_internal_reflection_only_where_it_should_be(device):
    """From water, light past 48.6 degrees stays inside; from air none is ever refused."""
    up = np.tile([0.0, 0.0, 1.0], (3, 1))
    critical = np.arcsin(1.0 / 1.333)
    angles = critical + np.radians([-0.1, 0.1, 20.0])
    out = refracted(sunlight(angles, np.zeros(3)), up, np.full(3, 1.333), device)
    assert np.linalg.norm(out[0]) == pytest.approx(1.0, abs=SNELL_TOLERANCE)
    assert (out[1:] == 0.0).all()
    grazing = sunlight(np.radians([0.0, 60.0, 89.99]), np.zeros(3))
    into = refracted(grazing, up, np.full(3, 1.0 / 1.333), device)
    assert np.abs(np.linalg.norm(into, axis=1) - 1.0).max() < SNELL_TOLERANCE
    expected = oracle_refract(grazing[2], np.array([0.0, 0.0, 1.0]), 1.333)
    assert np.abs(into[2] - expected).max() < SNELL_TOLERANCE


def test_a_surface_that_faces_away_takes_in_nothing_but_stays_finite(device):
    directions = sunlight(np.radians([80.0, 85.0]), np.zeros(2))
    slopes = np.array([[-0.8, 0.0], [-5.0, 3.0]])
    _, rays, taken, passes = surface_light(directions, slopes, np.full(2, 1.333), device)
    assert (taken < 0.0).all()
    assert np.isfinite(rays).all() and np.isfinite(passes).all()


def test_flux_taken_in_is_that_of_the_tilted_area(device):
    """Light on an area is E cos(i) A; the area over one of the horizontal is sqrt(1 + slope²)."""
    directions, slopes, iors = random_rays(seed=3)
    _, _, taken, _ = surface_light(directions, slopes, iors, device)
    _, cosines = oracle_rays(directions, slopes, iors)
    expected = cosines * np.sqrt(1.0 + (slopes**2).sum(axis=1)) * np.linalg.norm(directions, axis=1)
    assert np.abs(taken - expected).max() < 2.0 * SNELL_TOLERANCE  # slopes to 1.5


def test_fresnel_equals_float64(device):
    directions, slopes, iors = random_rays(seed=4)
    _, _, _, passes = surface_light(directions, slopes, iors, device)
    _, cosines = oracle_rays(directions, slopes, iors)
    expected = np.array([oracle_transmittance(c, ior) for c, ior in zip(cosines, iors, strict=True)])
    assert np.abs(passes - expected).max() < FRESNEL_TOLERANCE


def test_fresnel_table_of_sea_water(device):
    """Transmittance for n = 1.34 at 0, 40, 60, 70 and 80 degrees, as published; nothing at grazing."""
    angles = np.radians([0.0, 40.0, 60.0, 70.0, 80.0, 90.0])
    inside = np.sqrt(1.0 - (np.sin(angles) / 1.34) ** 2)
    passes = wp.zeros(6, dtype=float, device=device)
    cosines = points(np.stack([np.cos(angles), inside], axis=-1), device)
    wp.launch(fresnel, dim=6, inputs=[cosines, wp.full(6, 1.34, dtype=float, device=device)], outputs=[passes],
              device=device)  # fmt: skip
    assert np.abs(passes.numpy() - [0.979, 0.975, 0.939, 0.865, 0.650, 0.0]).max() < TABLE_TOLERANCE


@settings(deadline=None, max_examples=40)
@given(
    zenith=st.floats(0.0, 89.0), azimuth=st.floats(0.0, 360.0), ior=st.floats(1.0, 2.5),
    slope=st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)),
)  # fmt: skip
def test_a_mirrored_ray_is_refracted_to_the_mirror_image(zenith, azimuth, ior, slope):
    """Mirrored in x, in y, and in the diagonal; the first two bit for bit, the last but for the order of sums."""
    direction = sunlight(np.radians(zenith), np.radians(azimuth))
    flips = np.array([[1.0, 1.0, 1.0], [-1.0, 1.0, 1.0], [1.0, -1.0, 1.0]])
    directions = np.concatenate([direction * flips, direction[None, [1, 0, 2]]])
    slopes = np.concatenate([np.array(slope) * flips[:, :2], np.array(slope)[None, ::-1]])
    _, rays, taken, passes = surface_light(directions, slopes, np.full(4, ior), "cpu")
    assert (rays[1:3] * flips[1:] == rays[0]).all()
    assert (taken[1:3] == taken[0]).all() and (passes[1:3] == passes[0]).all()
    assert np.abs(rays[3, [1, 0, 2]] - rays[0]).max() < SNELL_TOLERANCE
