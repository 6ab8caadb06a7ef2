"""Waves: sums of sines and their tables against float64, their frequency, and their phases at late times."""

from decimal import Decimal, getcontext

import numpy as np
import pytest
import warp as wp
from hypothesis import given, settings
from hypothesis import strategies as st
from kernel_helpers import lattice, points, rounded, wave_array, wave_surface

import oracle
import warp_caustics as wc
from warp_caustics.assets import load_assets
from warp_caustics.facts import gather_facts
from warp_caustics.kernels.photon import Scene, SunSample
from warp_caustics.kernels.surface import Surface, waves_at, waves_curved_at
from warp_caustics.kernels.wave_table import wave_lattice_sum, wave_table
from warp_caustics.kernels.waves import Wave, vec6, wave_sum
from warp_caustics.state import SceneState
from warp_caustics.water import angular_frequency, phases, water_heights

wp.set_module_options({"enable_backward": False})

# Phases up to 500 radians are rounded to 3e-5, relative to the sum of the amplitudes, or of a|k|, or of a k².
SUM_TOLERANCE = 5e-5
# Tables come from float64: what is left is a product of two float32 and the sum, whatever the phase was.
TABLE_TOLERANCE = 1e-6
# Heights at 1e7 s, relative to the sum of the amplitudes, in float64 against exact turns: the phases are 5e7 radians.
LATE_TOLERANCE = 1e-4
# pi to more digits than a late phase needs.
PI = Decimal("3.14159265358979323846264338327950288419716939937510582097494459230781640628620899")
LATE = 1e7  # [s]

WAVES = [(0.03, (4.2, 1.3), 0.0), (0.02, (-2.0, 7.5), 1.0), (0.001, (0.0, -90.0), 2.5), (0.05, (0.3, 0.0), 6.0)]


@wp.kernel
def at_points(surface: Surface, at: wp.array[wp.vec2], sums: wp.array[wp.vec3], curved: wp.array[vec6]):
    i = wp.tid()
    p = at[i]
    sums[i] = waves_at(surface, p[0], p[1])
    curved[i] = waves_curved_at(surface, p[0], p[1])


@wp.kernel
def on_lattice(
    waves: wp.array[Wave], columns: wp.array2d[wp.vec2], rows: wp.array2d[wp.vec2], sums: wp.array2d[wp.vec3]
):
    row, column = wp.tid()
    sums[row, column] = wave_lattice_sum(waves, columns, rows, column, row)


@wp.kernel
def bare_sum(waves: wp.array[Wave], at: wp.array[wp.vec2], sums: wp.array[wp.vec3]):
    i = wp.tid()
    sums[i] = wave_sum(waves, at[i][0], at[i][1])


def evaluate(surface, at, device):
    """Sums [n, 3] and curved sums [n, 6] at points [n, 2]."""
    sums, curved = wp.zeros(len(at), dtype=wp.vec3, device=device), wp.zeros(len(at), dtype=vec6, device=device)
    wp.launch(at_points, dim=len(at), inputs=[surface, points(at, device)], outputs=[sums, curved], device=device)
    return sums.numpy(), curved.numpy()


def direct(waves, x, y, base=0.0, slope=(0.0, 0.0)):
    """z, z_x, z_y, z_xx, z_xy, z_yy in float64, [..., 6]."""
    total = [base + slope[0] * x + slope[1] * y, x * 0 + slope[0], y * 0 + slope[1], x * 0, x * 0, x * 0]
    for amplitude, (kx, ky), phase in waves:
        s, c = amplitude * np.sin(kx * x + ky * y + phase), amplitude * np.cos(kx * x + ky * y + phase)
        for i, term in enumerate((s, kx * c, ky * c, -kx * kx * s, -kx * ky * s, -ky * ky * s)):
            total[i] = total[i] + term
    return np.stack(total, axis=-1)


def scales(waves):
    """What z, the slopes and the curvatures reach, to measure errors by."""
    a, k = np.array([abs(w[0]) for w in waves]), np.array([np.hypot(*w[1]) for w in waves])
    return np.array([(a * k**n).sum() for n in (0, 1, 1, 2, 2, 2)])


def exact(waves):
    """The waves in float32 values."""
    return [(float(rounded(a)), tuple(rounded(k)), float(rounded(p))) for a, k, p in waves]


def scene(waves, *, level=2.0, plane=0.5, origin=(0.0, 0.0), size=(4.0, 4.0)):
    """A scene of waves (amplitude, wavevector, phase, angular frequency or None) over a plane."""
    named = [dict(zip(("amplitude", "wavevector", "phase", "angular_frequency"), wave, strict=True)) for wave in waves]
    return {
        "water": {"level": level, "waves": named},
        "receiver": {"plane": plane},
        "sun": {"direction": (0.2, 0.1, -1.0)},
        "medium": {"ior": 1.333},
        "map": {"origin": origin, "size": size, "resolution": (16, 16)},
    }


def test_height_slope_and_curvature_equal_float64(device):
    at = rounded(np.random.default_rng(1).uniform(-5.0, 5.0, (500, 2)))
    waves, base, slope = exact(WAVES), 0.75, (0.25, -0.5)
    sums, curved = evaluate(wave_surface(waves, device, base, slope), at, device)
    expected = direct(waves, at[:, 0], at[:, 1], base, slope)
    scale = scales(waves) + np.array([4.5, 0.5, 0.5, 0.0, 0.0, 0.0])  # the plane's own height and slope
    assert (np.abs(curved - expected).max(axis=0) < SUM_TOLERANCE * scale).all()
    assert (np.abs(sums - expected[:, :3]).max(axis=0) < SUM_TOLERANCE * scale[:3]).all()


def test_one_sine_by_hand(device):
    """At its node, crest and trough: z = 0, a, -a; slope a k, 0, 0; second derivative 0, -a k², a k²."""
    a, k = 0.25, 2.0
    at = np.array([[0.0, 9.0], [np.pi / 4.0, 9.0], [-np.pi / 4.0, 9.0]])
    _, curved = evaluate(wave_surface([(a, (k, 0.0), 0.0)], device), at, device)
    expected = [[0, a * k, 0, 0, 0, 0], [a, 0, 0, -a * k * k, 0, 0], [-a, 0, 0, a * k * k, 0, 0]]
    assert np.abs(curved - expected).max() < SUM_TOLERANCE


def test_no_waves_is_the_plane(device):
    sums, curved = evaluate(wave_surface([], device, -1.5, (0.5, 0.25)), np.array([[2.0, 4.0]]), device)
    assert sums.tolist() == [[0.5, 0.5, 0.25]]
    assert curved.tolist() == [[0.5, 0.5, 0.25, 0.0, 0.0, 0.0]]


def table(waves, shape, first, first_row, offset, step, pixel, shift, device):
    """Sums on a lattice of ``shape`` rows and columns, by the tables."""
    world, sun = Scene(), SunSample()
    world.water.surface = wave_surface(waves, device)
    sun.rest_shift = wp.vec2(*shift)
    suns = wp.array([sun], dtype=SunSample, device=device)
    cells = lattice((first, -999), (shape[1], 999), step, pixel)
    # One row of guard behind each table: a thread past its end must not write.
    columns = wp.full((shape[1] + 1, len(waves)), wp.vec2(7.0, 7.0), dtype=wp.vec2, device=device)
    rows = wp.full((shape[0] + 1, len(waves)), wp.vec2(7.0, 7.0), dtype=wp.vec2, device=device)
    wp.launch(
        wave_table,
        dim=max(shape) + 5,
        inputs=[world, suns, 0, cells, first_row, offset],
        outputs=[columns[: shape[1]], rows[: shape[0]]],
        device=device,
    )
    assert (columns.numpy()[-1] == 7.0).all() and (rows.numpy()[-1] == 7.0).all()
    sums = wp.zeros(shape, dtype=wp.vec3, device=device)
    inputs = [world.water.surface.waves, columns, rows]
    wp.launch(on_lattice, dim=shape, inputs=inputs, outputs=[sums], device=device)
    return sums.numpy()


@pytest.mark.parametrize(("first", "offset"), [(0, 0.0), (-3, -1.0), (5, 0.5), (-400_000, -1.0), (1_000_000, 0.5)])
def test_tables_equal_direct_sums(device, first, offset):
    """Any lattice, however wide: a million cells from its origin, where one float32 sine would be wrong by 0.1 rad.

    Wavevectors, phases, step and pixel have float64's digits: rounded to float32 they would be wrong by 0.02 rad there.
    """
    waves = [(a, k, phase + 0.1) for a, k, phase in WAVES]
    shape, step, pixel, shift, first_row = (
        (7, 12),
        3.0**-0.5,
        np.array((0.0153, 0.021)),
        rounded((0.4, -0.7)),
        3 - first,
    )
    sums = table(waves, shape, first, first_row, offset, step, pixel, shift, device)
    x = (first + np.arange(shape[1]) + offset) * step * pixel[0] - shift[0]
    y = (first_row + np.arange(shape[0]) + offset) * step * pixel[1] - shift[1]
    expected = direct(waves, *np.meshgrid(x, y))[..., :3]
    assert (np.abs(sums - expected).max(axis=(0, 1)) < TABLE_TOLERANCE * scales(waves)[:3]).all()


@settings(deadline=None, max_examples=30)
@given(
    waves=st.lists(
        st.tuples(st.floats(-0.1, 0.1), st.tuples(st.floats(-50, 50), st.floats(-50, 50)), st.floats(0.0, 6.28)),
        min_size=1, max_size=5,
    ),
    first=st.integers(-(2**20), 2**20), step=st.sampled_from([0.25, 0.7071, 1.0, 2.0]),
)  # fmt: skip
def test_tables_equal_direct_sums_for_any_waves(waves, first, step):
    pixel, shift = np.array((0.01, 0.02)), rounded((0.1, 0.2))
    sums = table(waves, (3, 2), first, -first, -1.0, step, pixel, shift, "cpu")
    x = (first + np.arange(2) - 1.0) * step * pixel[0] - shift[0]
    y = (-first + np.arange(3) - 1.0) * step * pixel[1] - shift[1]
    expected = direct(waves, *np.meshgrid(x, y))[..., :3]
    # amplitudes may be so small that their slopes are denormal
    assert (np.abs(sums - expected).max(axis=(0, 1)) <= TABLE_TOLERANCE * scales(waves)[:3] + 1e-30).all()


def test_angular_frequency_of_finite_depth():
    """The oracle's formula, and the limits that it must have: deep, sqrt(g k); shallow, k sqrt(g d)."""
    k = np.geomspace(1e-3, 1e3, 50)
    for depth in (0.01, 1.0, 50.0):
        assert angular_frequency(k, depth) == pytest.approx(oracle.angular_frequency(k, depth), rel=1e-14)
    assert angular_frequency(np.array([100.0]), 10.0)[0] == pytest.approx(np.sqrt(9.81 * 100.0), rel=1e-12)
    assert angular_frequency(np.array([1e-3]), 1.0)[0] == pytest.approx(1e-3 * np.sqrt(9.81), rel=1e-6)
    # between: k d = 1, tanh 1 = 0.76159
    assert angular_frequency(np.array([0.5]), 2.0)[0] == pytest.approx(np.sqrt(9.81 * 0.5 * 0.761594156), rel=1e-9)
    assert angular_frequency(np.zeros(1), 1.0)[0] == 0.0


def late_phase(wavevector, phase, omega, origin, time):
    """Phase reduced to one turn, from exact decimals of the float64 inputs."""
    getcontext().prec = 60
    total = Decimal(phase) - Decimal(omega) * Decimal(time)
    total += sum(Decimal(k) * Decimal(o) for k, o in zip(wavevector, origin, strict=True))
    return float(total % (2 * PI)) % (2.0 * np.pi)


def given_waves():
    """Waves with frequencies of their own."""
    return [(a, k, p, 1.7 + 1.1 * i) for i, (a, k, p) in enumerate(WAVES)]


@pytest.mark.parametrize("origin", [(0.0, 0.0), (1e5, -3e4)])
@pytest.mark.parametrize("time", [0.0, 12.5, LATE, -LATE])
def test_phases_are_reduced_exactly_at_any_time_and_place(origin, time):
    waves = given_waves()
    found = phases(wc.Scene(**scene(waves, origin=origin)), time, 1.5)
    assert ((found >= 0.0) & (found < 2.0 * np.pi + 1e-12)).all()
    for phase, (_, k, start, omega) in zip(found, waves, strict=True):
        turn = (phase - late_phase(k, start, omega, origin, time) + np.pi) % (2.0 * np.pi) - np.pi
        assert abs(turn) < LATE_TOLERANCE


def test_a_wave_without_a_frequency_has_that_of_its_depth():
    waves = [(a, k, p, None) for a, k, p in WAVES]
    late = phases(wc.Scene(**scene(waves)), 3.0, 1.5)
    own = [float(oracle.angular_frequency(np.hypot(*k), 1.5)) for _, k, _ in WAVES]
    expected = [late_phase(k, p, omega, (0.0, 0.0), 3.0) for (_, k, p), omega in zip(WAVES, own, strict=True)]
    assert late == pytest.approx(expected, abs=1e-12)


def test_waves_travel_along_their_wavevector():
    """A crest moves by omega t / k in the direction of k, so that z(x + c t, t) = z(x, 0)."""
    waves = [(0.03, (3.0, 4.0), 0.3, 2.0)]
    made = wc.Scene(**scene(waves))
    x, y, time = np.array([0.3, 1.0]), np.array([0.2, 0.9]), 0.7
    before = water_heights(made, load_assets(made), x, y, 0.0)
    moved = 2.0 / 5.0 * time
    after = water_heights(made, load_assets(made), x + 0.6 * moved, y + 0.8 * moved, time)
    assert after == pytest.approx(before, abs=1e-12)
    assert np.abs(water_heights(made, load_assets(made), x, y, time) - before).max() > 1e-3


@pytest.mark.parametrize(
    ("origin", "time"), [((0.0, 0.0), 0.0), ((0.0, 0.0), LATE), ((1e5, -2e5), 0.0), ((1e5, 0.0), LATE)]
)
def test_the_device_sees_the_water_of_a_late_time_and_a_distant_map(device, origin, time):
    """float32 on the device, positions from the map's origin: as good at 1e7 s and 1e5 m as at home."""
    waves = given_waves()
    made = wc.Scene(**scene(waves, origin=origin))
    state = SceneState(gather_facts(made, load_assets(made)), device)
    state.write(time)
    at = rounded(np.random.default_rng(3).uniform(0.0, 4.0, (200, 2)))
    sums = wp.zeros(len(at), dtype=wp.vec3, device=device)
    inputs = [state.scene.water.surface.waves, points(at, device)]
    wp.launch(bare_sum, dim=len(at), inputs=inputs, outputs=[sums], device=device)
    shifted = [(a, k, late_phase(k, p, omega, origin, time)) for a, k, p, omega in waves]
    expected = direct(shifted, at[:, 0], at[:, 1])[:, :3]
    assert (np.abs(sums.numpy() - expected).max(axis=0) < LATE_TOLERANCE * scales(WAVES)[:3]).all()


@pytest.mark.parametrize("origin", [(0.0, 0.0), (1e5, -2e5)])
@pytest.mark.parametrize("time", [0.0, 2.5])
def test_water_heights_equal_the_oracle(origin, time):
    """Given and natural frequencies, at world coordinates of any shape."""
    described = scene([*given_waves()[:2], (0.05, (0.8, 0.3), 1.0, None)], origin=origin)
    made, setting = wc.Scene(**described), oracle.read_setting(described, time)
    x, y = np.meshgrid(origin[0] + np.linspace(-1.0, 5.0, 9), origin[1] + np.linspace(0.0, 4.0, 7))
    found = water_heights(made, load_assets(made), x, y, time)
    # k x is 1e6 radians away from the origin: float64 keeps 1e-10 of it, in either order of adding
    assert found == pytest.approx(setting.water.height(x, y), abs=1e-9)
    assert water_heights(made, load_assets(made), x[0, 0], y[0, 0], time) == pytest.approx(found[0, 0], abs=1e-12)


def test_tables_and_sums_of_the_same_waves_agree(device):
    """Where float32 is good enough for both: two roads to one surface."""
    waves = exact(WAVES)
    sums = table(waves, (6, 6), 0, 0, 0.5, 1.0, (0.01, 0.01), (0.0, 0.0), device)
    x = rounded((np.arange(6) + 0.5) * 0.01)
    at = np.stack([*np.meshgrid(x, x)], axis=-1).reshape(-1, 2)
    found = wp.zeros(36, dtype=wp.vec3, device=device)
    wp.launch(bare_sum, dim=36, inputs=[wave_array(waves, device), points(at, device)], outputs=[found], device=device)
    error = np.abs(sums.reshape(-1, 3) - found.numpy()).max(axis=0)
    assert (error < SUM_TOLERANCE * scales(waves)[:3]).all()
