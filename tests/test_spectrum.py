"""Spectra of wind waves and the seas made of them: energy, directions, bounds, motion, against sums and integrals."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp

from warp_caustics.kernels.fft import LONGEST
from warp_caustics.kernels.spectral import Dispersion, make_travel
from warp_caustics.scene import Spectrum
from warp_caustics.scene.spectrum import MOST_NODES, MOST_SPREADING, NODES_A_WAVE
from warp_caustics.simulation import SimulatedWater, make_sea
from warp_caustics.simulation.sea import BEYOND_SAMPLES, mode_variances, wave_vectors
from warp_caustics.simulation.spectrum import (
    depth_factor,
    energy_scale,
    frequency_spectrum,
    peak_frequency,
    spreading,
    vector_spectrum,
    whole_variance,
)
from warp_caustics.water import GRAVITY, angular_frequency

# Sums of a thousand modes in float64, by their height.
ROUNDING = 1e-12
# Gauss-Legendre of eight points in a mode, against sixty even ones: the spreading bends at the peak.
QUADRATURE = 5e-3
# A ring of modes is not a disk: squares of wave vectors stand out at the cut-off, whose share of the slopes is larger.
RAGGED = {"variance": 0.01, "slope": 0.03}
# Fourth-order differences at eight nodes a wave lose 1.3 % of its slope; most slope is in longer waves.
DIFFERENCES = 0.01
# The table of the spreading's norm.
NORM = 1e-5
# wavespectra's g is 9.80665, whose square is 0.07 % less than ours; it approximates the wave number of a frequency.
ORACLE = 2e-3
DEPTH = 50.0

JONSWAP = {"kind": "jonswap", "wind_speed": 5.0, "fetch": 3e3}
KINDS = {"jonswap": JONSWAP, "tma": {**JONSWAP, "kind": "tma"}, "pm": {"kind": "pm", "wind_speed": 3.0}}


def spectrum(kind: str = "jonswap", **more) -> Spectrum:
    """A square of ten peak wave lengths, unless said otherwise."""
    settings = {**KINDS[kind], "period": 1.0, "resolution": 256, **more}
    if "period" not in more:
        peak = peak_frequency(Spectrum(**settings))
        settings["period"] = 10.0 * 2.0 * np.pi * GRAVITY / peak**2
    return Spectrum(**settings)


def surface_at(water: SimulatedWater, time: float) -> np.ndarray:
    water.advance(time)
    return water.motion.surface.numpy().copy()


def energies(settings: Spectrum, depth: float = DEPTH) -> tuple[np.ndarray, np.ndarray]:
    """Variance of each mode, and its wave vector as kx + i ky."""
    kx, ky = wave_vectors(settings)
    return 0.5 * np.abs(make_sea(settings, depth).modes) ** 2, kx + 1j * ky


# --- the spectra ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_spectra_are_those_of_wavespectra(kind):
    """An independent package's, by frequency in Hz: E(f) = 2 pi S(w); its peak and alpha are given to it."""
    construct = pytest.importorskip("wavespectra.construct.frequency")
    settings, depth = spectrum(kind), 3.0
    k = np.geomspace(0.02, 60.0, 200) * peak_frequency(settings) ** 2 / GRAVITY
    hertz = angular_frequency(k, depth) / (2.0 * np.pi)
    given = {"freq": hertz, "fp": peak_frequency(settings) / (2.0 * np.pi), "alpha": energy_scale(settings)}
    theirs = {"jonswap": construct.jonswap, "pm": construct.pierson_moskowitz, "tma": construct.tma}[kind]
    expected = np.asarray(theirs(**given, **({"dep": depth} if kind == "tma" else {})))
    # Where the spectrum is all but nothing its exponential underflows at its own place.
    np.testing.assert_allclose(2.0 * np.pi * frequency_spectrum(settings, k, depth), expected, rtol=ORACLE, atol=1e-12)


def test_the_shape_is_the_printed_one():
    """At its peak and one width to either side of it; and the whole variance of Pierson and Moskowitz' closed form."""
    settings, deep = spectrum("jonswap"), 1e4
    peak = peak_frequency(settings)
    at = peak * np.array([1.0, 1.0 - 0.07, 1.0 + 0.09])
    found = frequency_spectrum(settings, at**2 / GRAVITY, deep)
    tail = energy_scale(settings) * GRAVITY**2 * at**-5 * np.exp(-1.25 * (peak / at) ** 4)
    np.testing.assert_allclose(found, tail * 3.3 ** np.array([1.0, np.exp(-0.5), np.exp(-0.5)]), rtol=1e-9)
    full = spectrum("pm")
    expected = energy_scale(full) * GRAVITY**2 / (5.0 * peak_frequency(full) ** 4)
    assert whole_variance(full, deep) == pytest.approx(expected, rel=1e-5)
    shallow = frequency_spectrum(spectrum("tma"), np.array([0.5]), 2.0)
    as_deep = frequency_spectrum(settings, np.array([0.5]), 2.0)
    assert shallow / as_deep == pytest.approx(np.tanh(1.0) ** 2 / (1.0 + 2.0 / np.sinh(2.0)))


def test_the_peak_and_the_height_are_the_published_ones():
    """JONSWAP: f_p U / g = 3.5 (g F / U^2)^-0.33; PM: Hs = 0.21 U^2 / g of the wind at 19.5 m (Stewart)."""
    wind, fetch = 10.0, 1e4 * 100.0 / GRAVITY
    grown = Spectrum(kind="jonswap", wind_speed=wind, fetch=fetch, period=100.0)
    assert peak_frequency(grown) / (2.0 * np.pi) * wind / GRAVITY == pytest.approx(3.5 * 1e4**-0.33, rel=0.04)
    assert energy_scale(grown) == pytest.approx(0.076 * 1e4**-0.22)
    full = Spectrum(kind="pm", wind_speed=wind, period=100.0)
    assert 4.0 * np.sqrt(whole_variance(full, 1e4)) == pytest.approx(0.21 * (1.026 * wind) ** 2 / GRAVITY, rel=0.02)


def test_the_depth_s_factor_is_the_ratio_of_its_definition():
    """Kitaigorodskii: (k^-3 dk/dw) over that of deep water at the same frequency."""
    depth, k = 2.0, np.geomspace(1e-3, 1e2, 60)
    step = 1e-6 * k
    slope = 2.0 * step / (angular_frequency(k + step, depth) - angular_frequency(k - step, depth))
    frequency = angular_frequency(k, depth)
    deep = frequency**2 / GRAVITY
    ratio = k**-3.0 * slope / (deep**-3.0 * 2.0 * frequency / GRAVITY)
    np.testing.assert_allclose(depth_factor(k * depth), ratio, rtol=1e-6)
    assert depth_factor(np.array([1e-4, 1e3])) == pytest.approx([0.5e-8, 1.0], rel=1e-6)


@pytest.mark.parametrize("exponent", [1e-6, 0.3, 4.0, 80.0])
def test_directions_share_the_energy(exponent):
    """The spreading integrates to 1, and its mean cosine is s / (s + 1) in closed form."""
    angle = np.linspace(-np.pi, np.pi, 2000, endpoint=False)
    share = spreading(np.full_like(angle, exponent), angle) * 2.0 * np.pi / len(angle)
    assert share.sum() == pytest.approx(1.0, abs=NORM)
    assert (share * np.cos(angle)).sum() == pytest.approx(exponent / (exponent + 1.0), abs=NORM)
    mixed = spreading(np.geomspace(1e-6, 80.0, 7), np.zeros(7))
    alone = [float(spreading(np.array([s]), np.zeros(1))[0]) for s in np.geomspace(1e-6, 80.0, 7)]
    np.testing.assert_allclose(mixed, alone, rtol=NORM)


# --- the modes ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_each_mode_has_its_share_of_the_spectrum(kind):
    settings = spectrum(kind, resolution=64, period=8.0)
    variances, unit = mode_variances(settings, 3.0), 2.0 * np.pi / 8.0
    at = (np.arange(60) + 0.5) / 60.0 - 0.5
    along, across = (axis.ravel() for axis in np.meshgrid(at, at))
    for row, column in ((0, 1), (1, 0), (2, 3), (-3, -1), (5, -6)):
        density = vector_spectrum(settings, unit * (column + along), unit * (row + across), 3.0)
        expected = density.mean() * unit**2
        assert variances[row, column] == pytest.approx(expected, rel=QUADRATURE, abs=1e-9 * variances.max())
    waves = np.hypot(*(np.fft.fftfreq(64, 1.0 / 64)[axis] for axis in np.ix_(range(64), range(64))))
    assert ((variances > 0.0) <= ((waves > 0.0) & (waves <= 64 / NODES_A_WAVE))).all()
    assert (variances[0, 1:7] > 0.0).all()


SEAS = {
    "jonswap": ("jonswap", {}, DEPTH),
    "pm": ("pm", {}, DEPTH),
    "over shallows": ("tma", {}, 0.5),
    "narrow": ("jonswap", {"spreading": MOST_SPREADING}, DEPTH),
}


@pytest.mark.parametrize("name", SEAS)
def test_variance_slope_and_peak_are_those_of_the_spectrum(name):
    """Against integrals over frequency alone, from half a wave in the square to the cut-off."""
    kind, more, depth = SEAS[name]
    settings = spectrum(kind, direction=20.0, **more)
    variances, vectors = energies(settings, depth)
    unit = 2.0 * np.pi / settings.period
    k = unit * np.linspace(0.5, settings.resolution / NODES_A_WAVE, 20001)
    per_wave = frequency_spectrum(settings, k, depth) * np.gradient(angular_frequency(k, depth), k)
    for share, weight in (("variance", 1.0), ("slope", k**2)):
        expected = np.sum(per_wave * weight) * (k[1] - k[0])
        found = np.sum(variances * (1.0 if share == "variance" else np.abs(vectors) ** 2))
        assert found == pytest.approx(expected, rel=RAGGED[share]), share
    rings = np.bincount(np.round(np.abs(vectors) / unit).astype(int).ravel(), variances.ravel())
    assert abs(rings.argmax() - k[per_wave.argmax()] / unit) <= 1.0
    sea = make_sea(settings, depth)
    assert sea.share == pytest.approx(variances.sum() / whole_variance(settings, depth))
    assert 0.8 < sea.share < 1.0


@pytest.mark.parametrize("direction", [0.0, 65.0, -140.0])
def test_waves_run_with_the_wind(direction):
    """The mean direction is the wind's; about it the mean cosine is s / (s + 1), and Mitsuyasu's short waves stray."""
    variances, vectors = energies(spectrum(direction=direction, spreading=8.0))
    mean = (variances * np.exp(1j * np.angle(vectors))).sum() / variances.sum()
    assert np.angle(mean * np.exp(-1j * np.radians(direction))) == pytest.approx(0.0, abs=0.01)
    assert np.abs(mean) == pytest.approx(8.0 / 9.0, abs=0.01)
    settings = spectrum(direction=direction)
    variances, vectors = energies(settings)
    at_peak = 11.5 * (settings.wind_speed * peak_frequency(settings) / GRAVITY) ** -2.5
    number = np.abs(vectors) * settings.period / (2.0 * np.pi)  # the peak is at 10
    for ring, exponent in ((10.0, at_peak), (28.0, at_peak * 2.8**-1.25)):
        part = variances * (np.abs(number - ring) < 1.5)
        mean = np.abs((part * np.exp(1j * np.angle(vectors))).sum() / part.sum())
        assert mean == pytest.approx(exponent / (exponent + 1.0), abs=0.05)


def test_a_seed_is_one_sea_at_any_resolution():
    coarse, fine = (make_sea(spectrum(resolution=n, period=9.0), DEPTH).modes for n in (64, 256))
    long = np.r_[0:9, -8:0]
    coarse_part, fine_part = (modes[np.ix_(long, long)] for modes in (coarse, fine))
    held = np.abs(coarse_part) > 0.0
    assert held.sum() > 150
    np.testing.assert_allclose(coarse_part[held], fine_part[held], rtol=NORM)
    other = make_sea(spectrum(resolution=64, period=9.0, seed=2), DEPTH).modes
    np.testing.assert_allclose(np.abs(other), np.abs(coarse), rtol=ROUNDING)
    assert np.abs(other - coarse).max() > 0.5 * np.abs(coarse).max()
    phases = np.angle(fine[np.abs(fine) > 0.0])
    assert np.abs(np.exp(1j * phases).mean()) < 4.0 / np.sqrt(len(phases))  # even over a turn


# --- the surface ----------------------------------------------------------------------------------------------------


def direct(settings: Spectrum, x: np.ndarray, y: np.ndarray, time: float) -> np.ndarray:
    """Height and slopes ``[3, points]`` at points of the world, mode by mode."""
    modes, (kx, ky) = make_sea(settings, DEPTH).modes, wave_vectors(settings)
    kx, ky = (k[np.abs(modes) > 0.0] for k in np.broadcast_arrays(kx, ky))
    modes = modes[np.abs(modes) > 0.0]
    frequency = angular_frequency(np.hypot(kx, ky), DEPTH)
    if settings.loop is not None:
        turns = np.maximum(np.round(frequency * settings.loop / (2.0 * np.pi)), 1.0)
        frequency = 2.0 * np.pi * turns / settings.loop
    waves = modes * np.exp(1j * (np.multiply.outer(x, kx) + np.multiply.outer(y, ky) - frequency * time))
    return np.array([waves.real.sum(axis=-1), (1j * kx * waves).real.sum(axis=-1), (1j * ky * waves).real.sum(axis=-1)])


@pytest.mark.parametrize("loop", [None, 3.0])
def test_the_surface_is_the_sum_of_its_waves(device, loop):
    settings = spectrum(resolution=64, period=8.0, loop=loop)
    water = SimulatedWater(make_sea(settings, DEPTH), device)
    x, y = np.meshgrid(*2 * [(np.arange(64) + 0.5) / 8.0])
    for time in (0.0, 1.7, -250.0):
        expected = direct(settings, x, y, time)
        np.testing.assert_allclose(surface_at(water, time), expected[0], rtol=0.0, atol=ROUNDING)
        nodes = water.nodes.numpy() / [1.0, 0.125, 0.125, 1.0]
        np.testing.assert_allclose(nodes[..., 0], expected[0], atol=1e-6 * np.abs(expected[0]).max())
        for slope, exact in zip((nodes[..., 1], nodes[..., 2]), expected[1:], strict=True):
            assert np.sqrt(np.mean((slope - exact) ** 2)) < DIFFERENCES * np.sqrt(np.mean(exact**2))


def test_variances_are_those_of_the_modes(device):
    """In the mean over a loop; and at any time where no waves run against each other, as under a narrow spreading."""
    settings = spectrum(resolution=128, loop=4.0)
    sea = make_sea(settings, DEPTH)
    water, variance = SimulatedWater(sea, device), 0.5 * np.sum(np.abs(sea.modes) ** 2)
    times = [np.var(surface_at(water, 4.0 * i / 128)) for i in range(128)]
    assert np.mean(times) == pytest.approx(variance, rel=1e-9)
    narrow = make_sea(spectrum(resolution=128, spreading=100.0), DEPTH)
    water = SimulatedWater(narrow, device)
    assert np.var(surface_at(water, 0.7)) == pytest.approx(0.5 * np.sum(np.abs(narrow.modes) ** 2), rel=1e-6)
    kx, ky = wave_vectors(settings)
    nodes, cell = water.nodes.numpy().astype(np.float64), narrow.cell[0]
    slope = np.mean(nodes[..., 1] ** 2 + nodes[..., 2] ** 2) / cell**2
    assert slope == pytest.approx(0.5 * np.sum((kx**2 + ky**2) * np.abs(narrow.modes) ** 2), rel=DIFFERENCES)


def test_a_loop_closes_and_is_no_shorter(device):
    settings = spectrum(resolution=64, loop=5.0)
    sea = make_sea(settings, DEPTH)
    water = SimulatedWater(sea, device)
    start, height = surface_at(water, 0.3), sea.highest
    np.testing.assert_allclose(surface_at(water, 5.3), start, rtol=0.0, atol=1e-12 * height)
    assert np.abs(surface_at(water, 2.8) - start).max() > 0.1 * height
    free = SimulatedWater(make_sea(spectrum(resolution=64), DEPTH), device)
    assert np.abs(surface_at(free, 5.3) - surface_at(free, 0.3)).max() > 0.1 * height
    # Rounding moves the slowest wave by half of 2 pi / 5 s at most, and that much of its own frequency.
    slowest = angular_frequency(np.array(2.0 * np.pi / settings.period), DEPTH)
    assert 0.0 < sea.moved <= max(np.pi / 5.0 / slowest, 2.0 * np.pi / 5.0 / slowest - 1.0)
    assert f"up to {100 * sea.moved:.2g} %" in sea.summary


def test_bounds_hold_what_is_seen_and_not_much_more(device):
    """Over ten minutes of a sea whose bounds were found in a few periods of its largest waves."""
    sea = make_sea(spectrum(resolution=128), DEPTH)
    water = SimulatedWater(sea, device)
    found = []
    for time in np.linspace(0.0, 600.0, 40):
        water.advance(time)
        assert water.warnings() == ()
        found.append(water._extremes.numpy().max(axis=0))
    slope, height = np.max(found, axis=0)
    assert slope > sea.max_slope / (1.0 + BEYOND_SAMPLES) ** 2
    assert height > sea.max_height / (1.0 + BEYOND_SAMPLES) ** 2


@pytest.mark.parametrize("looped", [False, True])
def test_a_mode_travels(device, looped):
    rng, shape, time = np.random.default_rng(3), (8, 4), 2.3
    modes = rng.normal(size=(*shape, 2))
    numbers = [np.fft.fftfreq(n, 1.0 / n) for n in shape]
    for n, axis in zip(shape, numbers, strict=True):
        axis[n // 2] = n // 2  # the kernel's sign of the middle one
    k = np.hypot(0.7 * numbers[1][None, :], 0.4 * numbers[0][:, None])
    frequency = np.sqrt(9.81 * k * np.tanh(k * 1.5))
    if looped:
        frequency = 1.1 * np.maximum(np.round(frequency / 1.1), 1.0)
    dispersion = Dispersion()
    dispersion.gravity, dispersion.depth, dispersion.unit = 9.81, 1.5, 1.1
    out = wp.zeros(shape, dtype=wp.vec2d, device=device)
    clock = wp.full(1, time, dtype=wp.float64, device=device)
    inputs = [0, wp.array(modes, dtype=wp.vec2d, device=device), wp.vec2d(0.7, 0.4), dispersion, clock]
    wp.launch(make_travel(looped), dim=shape, inputs=inputs, outputs=[out], device=device)
    expected = (modes[..., 0] + 1j * modes[..., 1]) * np.exp(-1j * frequency * time)
    np.testing.assert_allclose(out.numpy(), np.stack([expected.real, expected.imag], axis=-1), atol=1e-12)


def test_rows_of_nodes_fit_into_a_transform():
    assert MOST_NODES <= LONGEST
