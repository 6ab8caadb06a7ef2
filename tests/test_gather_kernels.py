"""The gather's forms: by hand, against the direct sum, and against the splat of a unit box; the paper's errata."""

import functools

import numpy as np
import pytest
import warp as wp
from hypothesis import given, settings
from hypothesis import strategies as st
from kernel_helpers import rounded

import warp_caustics as wc
from warp_caustics.kernels.deposit import FLUX
from warp_caustics.kernels.gather import make_columns, make_rows
from warp_caustics.kernels.gather_fused import TILE, make_fused, make_tile, tile_threads
from warp_caustics.kernels.gather_scatter import make_deposit_window
from warp_caustics.kernels.lattice import Lattice

FORMS = ("two_pass", "fused", "scatter")
# A few dozen float32 products of numbers up to one, added up.
SUM_TOLERANCE = 2e-6
# Two orders of adding the same float32 numbers, landings rounded to 1e-6 of a pixel, relative to the mean.
SPLAT_TOLERANCE = 1e-5


def gather(landing, flux, n, m, resolution, device, before=None, form="two_pass"):
    """A form of the sum over samples [rows + m, columns + n - 1]: landings [..., 2], fluxes [..., channels]."""
    (columns, rows), channels = resolution, flux.shape[-1]
    assert landing.shape == (rows + m, columns + n - 1, 2)
    dtype = FLUX[channels]
    shape = landing.shape[:2]
    samples = wp.array(np.ascontiguousarray(landing, np.float32), dtype=wp.vec2, shape=shape, device=device)
    light = wp.array(np.ascontiguousarray(flux, np.float32), dtype=dtype, shape=shape, device=device)
    start = np.zeros(rows * columns * channels) if before is None else before.ravel()
    out = wp.array(start.astype(np.float32), dtype=float, device=device)
    lattice = Lattice()
    lattice.map, lattice.first = wp.vec2i(*resolution), wp.vec2i(-(n // 2), -(m // 2))

    def launch(kernel, dim, *inputs, outputs=None):
        wp.launch(kernel, dim=dim, inputs=list(inputs), outputs=[out] if outputs is None else outputs, device=device)

    first = wp.vec2i(0, 0)
    if form == "two_pass":
        # Filled with rubbish: the first pass must not add to what a frame before has left.
        channel = wp.full((m + 1, rows + m, columns), value=dtype(7.0), dtype=dtype, device=device)
        launch(make_rows(channels), (rows + m, columns), 0, samples, light, first, n, m, outputs=[channel])
        launch(make_columns(channels), (rows, columns), 0, channel, m)
    elif form == "fused":
        launch(make_fused(channels), (rows, columns), 0, lattice, samples, light, first, n, m)
    elif form == "tile":
        tiles = -(-rows // TILE), -(-columns // TILE), tile_threads(device)
        launch(make_tile(channels, n, m), tiles, 0, lattice, samples, light, first)
    else:
        inside = wp.zeros(shape, dtype=float, device=device)
        launch(make_deposit(channels), shape, lattice, samples, light, n, m, outputs=[out, inside])
        assert np.abs(inside.numpy() - share_in_map(landing, n, m, resolution)).max() < SUM_TOLERANCE
    return out.numpy().reshape(rows, columns, channels).astype(np.float64)


@functools.cache
def make_deposit(channels):
    """The scatter's box, of samples that are given."""
    deposit_window = make_deposit_window(channels)
    flux_type = FLUX[channels]

    @wp.kernel(module="unique", enable_backward=False)
    def deposit(
        lattice: Lattice, landing: wp.array2d[wp.vec2], flux: wp.array2d[flux_type], n: int, m: int,
        map_out: wp.array[float], inside_out: wp.array2d[float],
    ):  # fmt: skip
        row, column = wp.tid()
        own = wp.vec2i(lattice.first[0] + column, lattice.first[1] + row)
        inside_out[row, column] = deposit_window(
            map_out, lattice.map, own, landing[row, column], n, m, flux[row, column]
        )

    return deposit


def share_in_map(landing, n, m, resolution):
    """The part of each sample's box that lies in the map, whatever the windows hold."""
    share = np.ones(landing.shape[:2])
    for axis, half in ((0, n // 2), (1, m // 2)):
        at = np.arange(landing.shape[1 - axis]) - half
        middle = landing[..., axis] + (at if axis == 0 else at[:, None]) + 0.5
        share *= np.maximum(0.0, np.minimum(middle + 0.5, resolution[axis]) - np.maximum(middle - 0.5, 0.0))
    return np.nan_to_num(share)


def direct_sum(landing, flux, n, m, resolution):
    """What each pixel gets from the n x (m + 1) samples around it, one by one, in float64."""
    columns, rows = resolution
    image = np.zeros((rows, columns, flux.shape[-1]))
    for row in range(rows):
        for column in range(columns):
            for j in range(m + 1):
                for i in range(n):
                    x, y = landing[row + j, column + i]
                    # The sample stands i - n // 2 beside the pixel and j - m / 2 above it, and lands x, y from there.
                    share = max(0.0, 1.0 - abs(i - n // 2 + x)) * max(0.0, 1.0 - abs(j - m // 2 + y))
                    image[row, column] += share * flux[row + j, column + i]
    return image


def box_splat(landing, flux, n, m, resolution):
    """All samples as boxes of one pixel where they land: max(0, 1 - |dx|) max(0, 1 - |dy|), in float64."""
    columns, rows = resolution
    x = landing[..., 0] + np.arange(landing.shape[1]) - n // 2
    y = landing[..., 1] + np.arange(landing.shape[0])[:, None] - m // 2
    wide = np.maximum(0.0, 1.0 - np.abs(x[..., None] - np.arange(columns)))
    tall = np.maximum(0.0, 1.0 - np.abs(y[..., None] - np.arange(rows)))
    return np.einsum("abr,abc,abk->rck", tall, wide, flux)


def samples(n, m, resolution, reach, channels, seed):
    """Random landings within a reach, and fluxes, in float32 values."""
    shape = (resolution[1] + m, resolution[0] + n - 1)
    rng = np.random.default_rng(seed)
    return rounded(rng.uniform(-reach, reach, (*shape, 2))), rounded(rng.random((*shape, channels)))


def test_a_four_by_four_map_by_hand(device):
    """One sample of flux 1 above the pixel (1, 1), window 3 x 3: it lands where it is sent, and nowhere else."""
    resolution, n, m = (4, 4), 3, 2
    cases = {
        (0.0, 0.0): {(1, 1): 1.0},
        (1.0, 0.0): {(1, 2): 1.0},
        (0.0, 1.0): {(2, 1): 1.0},
        (0.0, -1.0): {(0, 1): 1.0},
        (0.25, 0.0): {(1, 1): 0.75, (1, 2): 0.25},
        (-0.5, 0.5): {(1, 1): 0.25, (1, 0): 0.25, (2, 1): 0.25, (2, 0): 0.25},
        (2.5, 0.0): {},  # past the window
        (1.75, 0.0): {(1, 2): 0.25},  # its box reaches out of the window: what is beyond is missed
    }
    for (x, y), expected in cases.items():
        landing, flux = np.zeros((6, 6, 2)), np.zeros((6, 6, 1))
        landing[1 + m // 2, 1 + n // 2] = x, y
        flux[1 + m // 2, 1 + n // 2] = 1.0
        by_hand = np.zeros((4, 4))
        for at, share in expected.items():
            by_hand[at] = share
        assert gather(landing, flux, n, m, resolution, device)[..., 0] == pytest.approx(by_hand, abs=1e-7), (x, y)


def test_channels_are_fetched_from_the_side_they_were_sent_from(device):
    """Erratum: read with the printed sign, a sample that lands three above would light the pixel three below."""
    resolution, n, m = (3, 9), 1, 6
    landing, flux = np.zeros((15, 3, 2)), np.zeros((15, 3, 1))
    flux[4 + m // 2, 1] = 1.0
    for j in range(-3, 4):
        landing[4 + m // 2, 1] = 0.0, j
        found = gather(landing, flux, n, m, resolution, device)[..., 0]
        assert found[4 + j, 1] == 1.0
        assert found.sum() == 1.0


@pytest.mark.parametrize(("n", "m"), [(1, 2), (3, 2), (7, 6), (5, 2), (3, 8), (7, 2)])
@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("form", FORMS)
def test_each_form_equals_the_direct_sum(device, form, n, m, channels):
    """Also where light lands outside the window, and where the window is not square."""
    resolution = (7, 5)
    landing, flux = samples(n, m, resolution, 4.5, channels, seed=n + 10 * m)
    found = gather(landing, flux, n, m, resolution, device, form=form)
    expected = direct_sum(landing, flux, n, m, resolution)
    assert expected.max() > 0.1
    assert np.abs(found - expected).max() < SUM_TOLERANCE * max(1.0, expected.max())


@pytest.mark.parametrize(("n", "m", "channels"), [(3, 8, 1), (7, 6, 3)])
def test_tiles_equal_the_direct_sum(device, n, m, channels):
    """Over several tiles, the last of which reach past the map and past the samples."""
    resolution = (TILE + 5, TILE + 3)
    landing, flux = samples(n, m, resolution, 4.5, channels, seed=3)
    found = gather(landing, flux, n, m, resolution, device, form="tile")
    expected = direct_sum(landing, flux, n, m, resolution)
    assert np.abs(found - expected).max() < SUM_TOLERANCE * expected.max()


@pytest.mark.parametrize(("reach", "n", "m"), [(0.9, 3, 2), (2.9, 7, 6), (3.0, 7, 6)])
def test_a_window_that_reaches_far_enough_is_the_splat_of_a_unit_box(device, reach, n, m):
    """Deflections up to half the window: not one share is missed."""
    resolution = (9, 8)
    landing, flux = samples(n, m, resolution, reach, 1, seed=4)
    found = gather(landing, flux, n, m, resolution, device)
    expected = box_splat(landing, flux, n, m, resolution)
    assert np.abs(found - expected).max() < SUM_TOLERANCE * expected.max()


def test_a_window_that_is_too_small_misses_light(device):
    """The bound above is sharp: deflections half a pixel past it are missed in part."""
    landing, flux = samples(7, 6, (9, 8), 3.5, 1, seed=4)
    found, expected = gather(landing, flux, 7, 6, (9, 8), device), box_splat(landing, flux, 7, 6, (9, 8))
    assert (found < expected + SUM_TOLERANCE * expected.max()).all()
    assert found.sum() < 0.999 * expected.sum()


@pytest.mark.parametrize("form", (*FORMS, "tile"))
def test_passes_add_to_the_map(device, form):
    """Each direction of the sun adds its light to that of the ones before."""
    landing, flux = samples(3, 2, (4, 4), 0.9, 3, seed=7)
    before = rounded(np.random.default_rng(1).random((4, 4, 3)))
    fresh = gather(landing, flux, 3, 2, (4, 4), device)
    assert gather(landing, flux, 3, 2, (4, 4), device, before, form) == pytest.approx(before + fresh, abs=SUM_TOLERANCE)


@pytest.mark.parametrize("form", FORMS)
def test_a_landing_that_is_no_number_lights_nothing(device, form):
    landing, flux = samples(3, 2, (4, 4), 0.9, 1, seed=2)
    spoilt = landing.copy()
    spoilt[2, 2], spoilt[3, 3, 0], spoilt[1, 1, 1], spoilt[4, 2] = np.nan, np.nan, np.nan, np.inf
    dark = flux.copy()
    for at in ((2, 2), (3, 3), (1, 1), (4, 2)):
        dark[at] = 0.0
    found = gather(spoilt, flux, 3, 2, (4, 4), device, form=form)
    assert found == pytest.approx(gather(landing, dark, 3, 2, (4, 4), device), abs=SUM_TOLERANCE)


@settings(deadline=None, max_examples=30)
@given(
    n=st.sampled_from([1, 3, 5]), m=st.sampled_from([2, 4]), columns=st.integers(1, 4), rows=st.integers(1, 4),
    reach=st.floats(0.0, 6.0), seed=st.integers(0, 99), form=st.sampled_from(FORMS),
)  # fmt: skip
def test_each_form_equals_the_direct_sum_for_any_window_and_map(n, m, columns, rows, reach, seed, form):
    landing, flux = samples(n, m, (columns, rows), reach, 1, seed)
    expected = direct_sum(landing, flux, n, m, (columns, rows))
    found = gather(landing, flux, n, m, (columns, rows), "cpu", form=form)
    assert np.abs(found - expected).max() < SUM_TOLERANCE * max(1.0, expected.max())


def pool(amplitude, method, direction=(0.5, -0.3, -1.0)):
    """Two waves over a flat floor; ``method`` is its table."""
    return wc.Scene(
        water={"level": 1.0, "waves": [
            {"amplitude": amplitude, "wavevector": (6.0, 2.0)}, {"amplitude": amplitude, "wavevector": (-3.0, 7.0)}
        ]},
        receiver={"plane": 0.0}, sun={"direction": direction}, medium={"ior": 1.333},
        map={"origin": (0.0, 0.0), "size": (1.0, 0.75), "resolution": (32, 24)}, method=method,
    )  # fmt: skip


def test_the_illumination_centre_is_where_light_lands_at_rest(device):
    """Erratum: P_C = P_G - h R0_xy / |R0_z|. Under flat water the smallest window misses nothing, at any sun."""
    for direction in ((0.0, 0.0, -1.0), (0.5, -0.3, -1.0), (-3.0, 1.0, -1.0)):
        scene = pool(0.0, {"name": "gather", "gather": {"n": 1, "m": 2}}, direction)
        result = wc.render(scene, device=device)
        unit = np.array(direction) / np.linalg.norm(direction)
        assert result.caustic_map == pytest.approx(np.full((24, 32), -unit[2]), rel=SPLAT_TOLERANCE)
        assert abs(result.energy.missed_by_window) < SPLAT_TOLERANCE * result.energy.emitted


def test_gather_by_its_own_window_is_the_photon_splat_of_one_pixel(device):
    """The chosen window reaches the largest deflection: no light is missed, and two methods give one map."""
    gathered = wc.render(pool(0.02, {"name": "gather"}), device=device)
    photon = {"name": "photon", "photon": {"photons_per_pixel": 1.0, "footprint": "pixel"}}
    splatted = wc.render(pool(0.02, photon), device=device)
    difference = np.abs(gathered.caustic_map - splatted.caustic_map).max()
    assert difference < SPLAT_TOLERANCE * splatted.caustic_map.mean()
    assert splatted.caustic_map.std() > 0.3  # it is a caustic, and not flat water
    assert abs(gathered.energy.missed_by_window) < SPLAT_TOLERANCE * gathered.energy.emitted
