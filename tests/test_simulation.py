"""Simulated water against its own dispersion in closed form; its energy, stability, borders, drops and obstacles."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest
from scenery import scene

import warp_caustics as wc
from warp_caustics.simulation import Basin, SimulatedWater, make_basin, step_launches
from warp_caustics.simulation.basin import MOST_ITERATIONS, SAFE_SHARE, implicit_iterations
from warp_caustics.simulation.chebyshev import SOLVER_TOLERANCE, chebyshev_count
from warp_caustics.water import GRAVITY

# Sums of a few thousand float64, relative to the drop's height.
ROUNDING = 1e-12
# At 1e7 s the roughest mode has turned by 5e8 rad, of which float64 holds 1e-7.
LATE_ROUNDING = 1e-6
# An angle of 1e3 steps, each of which solves to the solver's tolerance.
IMPLICIT_PHASE = 1e3 * SOLVER_TOLERANCE
# Energy of the explicit integrator oscillates by (w dt / 2)^2, which of a drop two cells wide, at a quarter of the
# default step, is parts in a thousand.
EXPLICIT_ENERGY = 0.01
# The implicit one keeps its energy to its solver's tolerance and the rounding of 1e5 steps.
IMPLICIT_ENERGY = 1e-8

DEPTH = 0.3
TENSION = 0.0728 / 1000.0
ONE_DROP = ({"position": (0.22, 0.11), "radius": 0.05, "amplitude": 0.004},)
KINDS = {
    "spectral": {"kind": "spectral", "resolution": (32, 16)},
    "explicit": {"kind": "grid", "resolution": (32, 16)},
    "implicit": {"kind": "grid", "resolution": (32, 16), "integrator": "implicit"},
}
BORDERS = ("reflecting", "periodic")


def basin(**settings) -> Basin:
    """Make a basin of 0.64 m x 0.32 m, 0.3 m deep, unless said otherwise."""
    default = {"origin": (0.0, 0.0), "size": (0.64, 0.32), "depth": DEPTH, "drops": ONE_DROP}
    return make_basin(scene(simulation={**default, **settings}), 1.0, np.zeros(2), np.ones(2))


def surface_at(water: SimulatedWater, time: float) -> np.ndarray:
    water.advance(time)
    return water.motion.surface.numpy().copy()  # on the CPU, NumPy would look at the array itself


def laplacian(h: np.ndarray, of: Basin) -> np.ndarray:
    """Five-point Laplacian over open sides, by shifting arrays."""
    solid = np.zeros(h.shape, bool) if of.solid is None else of.solid.astype(bool)
    mode = "wrap" if of.periodic else "edge"
    z, wall = np.pad(h, 1, mode=mode), np.pad(solid, 1, mode=mode)
    total = np.zeros_like(h)
    for rows, columns, side in ((slice(1, -1), slice(0, -2), 0), (slice(1, -1), slice(2, None), 0),
                                (slice(0, -2), slice(1, -1), 1), (slice(2, None), slice(1, -1), 1)):  # fmt: skip
        total += np.where(wall[rows, columns] | solid, 0.0, z[rows, columns] - h) / of.cell[side] ** 2
    return total


def energy(water: SimulatedWater, time: float) -> float:
    """Energy of a grid's state by area and density, its heights at whole steps: v^2 + h K h, K the stiffness."""
    of, h = water.basin, surface_at(water, time)
    if of.solid is not None:
        h = np.where(of.solid, 0.0, h)
    v = water.motion.velocity.numpy()
    force = GRAVITY * of.depth * h - of.tension * of.depth * laplacian(h, of)
    return 0.5 * float((v * v - h * laplacian(force, of)).sum())


def put(water: SimulatedWater, height: np.ndarray) -> None:
    """Replace the drops of a grid at time 0."""
    water.advance(0.0)
    water.motion.height.assign(height)


# --- dispersion -----------------------------------------------------------------------------------------------------


def modes_summed(of: Basin, drop: dict, time: float) -> np.ndarray:
    """A drop's waves by plain sums over cosines, in extended precision where NumPy has it."""
    longer = np.longdouble
    axes = []
    for axis, count in enumerate((of.columns, of.rows)):
        side = longer(of.size[axis])
        at = (np.arange(count, dtype=longer) + longer(0.5)) * side / count
        middle, radius = longer(drop["position"][axis]), longer(drop["radius"])
        period = side if of.periodic else 2 * side
        images = [m + n * period for n in range(-9, 10) for m in ((middle,) if of.periodic else (middle, -middle))]
        bump = sum(np.exp(-(((at - m) / radius) ** 2)) for m in images)
        if of.periodic:
            k = 2 * longer(np.pi) / side * np.fft.fftfreq(count, 1.0 / count).astype(longer)
            factor = np.exp(-1j * np.multiply.outer(k, at)) @ bump / count
            wave = np.exp(1j * np.multiply.outer(k, at))
        else:
            k = longer(np.pi) / side * np.arange(count, dtype=longer)
            wave = np.cos(np.multiply.outer(k, at))
            factor = wave @ bump / (wave**2).sum(axis=1)
        axes.append((k, factor[:, None] * wave))
    (kx, along), (ky, across) = axes
    k = np.hypot(kx[None, :], ky[:, None])
    frequency = np.sqrt((longer(GRAVITY) * k + longer(of.tension) * k**3) * np.tanh(k * longer(of.depth)))
    turned = np.cos(np.fmod(frequency * longer(time), 2 * longer(np.pi)))
    return np.asarray((across.T @ turned @ along).real * drop["amplitude"], dtype=np.float64)


@pytest.mark.parametrize("border", BORDERS)
def test_spectral_water_follows_its_dispersion_to_any_time(device, border):
    water = SimulatedWater(basin(**KINDS["spectral"], border=border), device)
    for time, tolerance in ((0.0, ROUNDING), (0.37, ROUNDING), (-0.37, ROUNDING), (1e7, LATE_ROUNDING)):
        expected = modes_summed(water.basin, ONE_DROP[0], time)
        np.testing.assert_allclose(surface_at(water, time), expected, rtol=0.0, atol=tolerance)
    assert np.ptp(expected) > 1e-4  # it is still moving


def test_one_mode_of_spectral_water_stands(device):
    """Two wide drops of opposite sign leave one wave: the even modes cancel, the third is under 1e-9 of the first."""
    length = 0.64
    pair = [{"position": (x, 0.0), "radius": length / 2, "amplitude": a} for x, a in ((0.0, 0.01), (length / 2, -0.01))]
    of = basin(kind="spectral", resolution=(32, 16), size=(length, length / 8), border="periodic", drops=pair)
    water = SimulatedWater(of, device)
    start, k = surface_at(water, 0.0), 2.0 * np.pi / length
    omega = np.sqrt((GRAVITY * k + TENSION * k**3) * np.tanh(k * DEPTH))
    shape = np.cos(k * (np.arange(32) + 0.5) * length / 32)
    np.testing.assert_allclose(start, start.max() / shape.max() * np.tile(shape, (16, 1)), atol=1e-8 * start.max())
    for time in (0.1, 0.5, 12.3):
        np.testing.assert_allclose(surface_at(water, time), np.cos(omega * time) * start, atol=1e-8 * start.max())


def grid_mode(of: Basin, numbers: tuple[int, int]) -> tuple[np.ndarray, float, float]:
    """A standing mode of the cells, its angular frequency by the five-point Laplacian, and by the equation itself."""
    turns = 2.0 * np.pi if of.periodic else np.pi
    phases = [turns * n * (np.arange(c) + 0.5) / c for n, c in zip(numbers, (of.columns, of.rows), strict=True)]
    k = [turns * n / side for n, side in zip(numbers, of.size, strict=True)]
    discrete = sum((2.0 * np.sin(0.5 * q * c) / c) ** 2 for q, c in zip(k, of.cell, strict=True))
    omega = [np.sqrt(GRAVITY * of.depth * q + of.tension * of.depth * q * q) for q in (discrete, k[0] ** 2 + k[1] ** 2)]
    return 0.002 * np.cos(phases[1])[:, None] * np.cos(phases[0])[None, :], omega[0], omega[1]


@pytest.mark.parametrize("border", BORDERS)
@pytest.mark.parametrize("integrator", ["explicit", "implicit"])
@pytest.mark.parametrize("numbers", [(1, 0), (3, 2), (15, 7)])
def test_a_mode_of_the_grid_has_its_integrator_s_frequency(device, integrator, border, numbers):
    """Leapfrog: sin(w' dt / 2) = w dt / 2; trapezoidal: tan(w' dt / 2) = w dt / 2."""
    of = basin(**KINDS[integrator], border=border)
    water = SimulatedWater(of, device)
    shape, omega, _ = grid_mode(of, numbers)
    put(water, shape)
    half = 0.5 * omega * of.step
    turned = 2.0 * (np.arcsin(half) if integrator == "explicit" else np.arctan(half))
    tolerance = (1e-10 if integrator == "explicit" else IMPLICIT_PHASE) * np.abs(shape).max()
    for steps in (1, 10, 100):
        expected = np.cos(steps * turned) * shape
        np.testing.assert_allclose(surface_at(water, steps * of.step), expected, rtol=0.0, atol=tolerance)


def test_without_surface_tension_it_is_left_out_of_the_code(device):
    of = basin(**KINDS["explicit"], surface_tension=0.0)
    assert of.step > 1.01 * basin(**KINDS["explicit"]).step
    water = SimulatedWater(of, device)
    shape, omega, _ = grid_mode(of, (3, 2))
    put(water, shape)
    expected = np.cos(200.0 * np.arcsin(0.5 * omega * of.step)) * shape
    np.testing.assert_allclose(surface_at(water, 100 * of.step), expected, rtol=0.0, atol=1e-10 * np.abs(shape).max())


@pytest.mark.parametrize("integrator", ["explicit", "implicit"])
def test_long_waves_of_the_grid_have_the_equation_s_frequency(device, integrator):
    """Cells and steps bend it by (k cell)^2 / 24 and (w dt)^2 / 12 at most: parts in a thousand of these."""
    of = basin(kind="grid", integrator=integrator, resolution=(64, 8), border="periodic")
    water = SimulatedWater(of, device)
    shape, _, omega = grid_mode(of, (1, 0))
    put(water, shape)
    steps = round(2.0 * np.pi / omega / of.step)
    expected = np.cos(omega * steps * of.step) * shape
    assert steps > 40
    np.testing.assert_allclose(surface_at(water, steps * of.step), expected, atol=0.01 * np.abs(shape).max())


@pytest.mark.parametrize("integrator", ["explicit", "implicit"])
def test_damping_is_that_of_an_oscillator(device, integrator):
    """h = e^(-c t / 2) (cos w' t + c / (2 w') sin w' t), w'^2 = w^2 - c^2 / 4; steps bend it by (w dt)^2 / 12."""
    damping = 3.0
    of = basin(**KINDS[integrator], damping=damping)
    of = dataclasses.replace(of, step=of.step / 4.0)
    water = SimulatedWater(of, device)
    shape, omega, _ = grid_mode(of, (2, 1))
    put(water, shape)
    for steps in (20, 400):
        time = steps * of.step
        slower = np.sqrt(omega**2 - damping**2 / 4.0)
        swing = np.cos(slower * time) + 0.5 * damping / slower * np.sin(slower * time)
        expected = np.exp(-0.5 * damping * time) * swing * shape
        np.testing.assert_allclose(surface_at(water, time), expected, atol=0.02 * np.abs(shape).max())
    assert np.exp(-0.5 * damping * time) < 0.5


# --- energy and stability -------------------------------------------------------------------------------------------

SMALL = {
    "kind": "grid", "size": (0.06, 0.05), "resolution": (6, 5),
    "drops": [{"position": (0.02, 0.02), "radius": 0.02, "amplitude": 0.003}],
    "obstacles": [{"position": (0.045, 0.035), "size": (0.01, 0.01)}],
}  # fmt: skip


@pytest.mark.parametrize("integrator", ["explicit", "implicit"])
def test_energy_does_not_drift_in_1e5_steps(device, integrator):
    of = basin(**SMALL, integrator=integrator)
    of = dataclasses.replace(of, step=0.25 * of.step)
    water = SimulatedWater(of, device)
    parts = np.linspace(0, 100_000, 41).round()
    energies = np.array([energy(water, n * of.step) for n in parts])
    early, late = energies[:21].mean(), energies[21:].mean()
    allowed = EXPLICIT_ENERGY if integrator == "explicit" else IMPLICIT_ENERGY
    assert np.abs(energies / energies[0] - 1.0).max() < allowed
    assert abs(late / early - 1.0) < 0.1 * allowed  # what stays of the oscillation in a mean of twenty
    level = np.where(of.solid, 0.0, water.motion.surface.numpy()).sum()
    assert level == pytest.approx(np.where(of.solid, 0.0, surface_at(water, 0.0)).sum(), rel=1e-9)


def rough(of: Basin) -> np.ndarray:
    """A checkerboard, the stiffest mode, among all others."""
    noise = np.random.default_rng(3).normal(size=(of.rows, of.columns))
    return 1e-3 * noise * (1 if of.solid is None else 1 - of.solid)


def test_the_explicit_limit_is_where_it_turns_unstable(device):
    default = basin(kind="grid", resolution=(8, 6), border="periodic", drops=[])
    for share, stable in ((0.999, True), (1.001, False)):
        of = dataclasses.replace(default, step=share * default.step / SAFE_SHARE)
        water = SimulatedWater(of, device)
        put(water, rough(of))
        grown = np.abs(surface_at(water, 2000 * of.step)).max()
        # Below, a mode swings to 1 / sqrt(1 - share^2) of its start; above, it grows by 9 % a step.
        assert (grown < 0.3) == stable


def test_a_step_past_the_limit_is_refused_with_the_limit():
    coarse = {"kind": "grid", "resolution": (8, 6), "drops": []}
    longest = basin(**coarse).step / SAFE_SHARE
    assert basin(**coarse, step=0.999 * longest).step == 0.999 * longest
    with pytest.raises(wc.InputError, match=rf"step: expected less than {longest:.6g} s.* \"implicit\""):
        basin(**coarse, step=1.001 * longest)
    # It falls with the square of the cell where surface tension rules.
    fine, finer = (basin(kind="grid", size=(4 * c, 4 * c), cell=c, drops=[]).step for c in (1e-5, 5e-6))
    assert fine / finer == pytest.approx(4.0, rel=0.01)


def test_a_step_of_too_many_iterations_is_refused_with_the_longest():
    stiff = {"kind": "grid", "integrator": "implicit", "resolution": (8, 6), "drops": []}
    for step in (1e6, 1e12, 1e18):
        with pytest.raises(wc.InputError, match=r"^water.simulation.step: .* iterations .* 32,768 ") as refused:
            basin(**stiff, step=step)
        longest = float(re.search(r"expected (\S+) s at most", str(refused.value))[1])
    assert implicit_iterations(basin(**stiff, step=longest)) > 0.99 * MOST_ITERATIONS
    with pytest.raises(wc.InputError, match=f"expected {longest:.6g} s at most"):
        basin(**stiff, step=1.001 * longest)
    # In cells of a micrometre, surface tension makes the default too long.
    assert implicit_iterations(basin(**{**stiff, "size": (8e-6, 6e-6)})) <= MOST_ITERATIONS


@pytest.mark.parametrize("stiffness", [1e-300, 0.1, 1e4, 1e12])
def test_the_count_of_iterations_is_that_of_chebyshev_s_bound(stiffness):
    """The residual's bound 1 / T_n(centre) falls below the tolerance with the last of them, and not before."""
    count = chebyshev_count(stiffness)
    turned = np.arccosh(1.0 + 2.0 / np.longdouble(stiffness))
    wanted = np.arccosh(np.longdouble(max(stiffness, 1.0) / SOLVER_TOLERANCE))
    assert count * turned >= wanted
    assert count == 1 or (count - 1) * turned < wanted
    assert chebyshev_count(1e20) > 1e10  # 1 + 2e-20 would be 1


@pytest.mark.parametrize("kind", KINDS)
def test_launches_of_a_step_are_those_of_its_passes(kind):
    of = basin(**KINDS[kind])
    assert of.step_launches == step_launches(of)


@pytest.mark.parametrize("times", [1.0, 30.0, 1000.0])
def test_the_implicit_integrator_is_stable_at_any_step(device, times):
    """It gives and takes no energy, whatever the step; obstacles and all."""
    longest = basin(**SMALL).step / SAFE_SHARE
    of = basin(**SMALL, integrator="implicit", step=times * longest)
    water = SimulatedWater(of, device)
    put(water, rough(of))
    start = energy(water, 0.0)
    for steps in (1, 2, 5):
        assert energy(water, steps * of.step) == pytest.approx(start, rel=IMPLICIT_ENERGY)


def test_an_implicit_step_solves_its_equation(device):
    """h' - h = dt (v + v') / 2 and v' - v = -dt K (h + h') / 2, to the tolerance."""
    of = basin(**SMALL, integrator="implicit", step=0.02)
    water = SimulatedWater(of, device)
    put(water, rough(of))
    h, v = water.motion.height.numpy().copy(), water.motion.velocity.numpy().copy()
    water.advance(of.step)
    later_h, later_v = water.motion.height.numpy(), water.motion.velocity.numpy()
    mean = 0.5 * (h + later_h)
    force = laplacian(GRAVITY * of.depth * mean - of.tension * of.depth * laplacian(mean, of), of)
    np.testing.assert_allclose(later_h - h, 0.5 * of.step * (v + later_v), atol=ROUNDING)
    np.testing.assert_allclose(later_v - v, of.step * force, atol=1e-6 * np.abs(of.step * force).max())


# --- time -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_a_time_has_one_surface_whatever_was_asked_before(device, kind):
    later = {} if kind == "spectral" else {"time": 0.07}
    drops = [*ONE_DROP, {"position": (0.5, 0.2), "radius": 0.04, "amplitude": -0.002, **later}]
    of = basin(**KINDS[kind], drops=drops)
    first, second = SimulatedWater(of, device), SimulatedWater(of, device)
    in_order = {time: surface_at(first, time) for time in (0.0, 0.05, 0.12, 0.2)}
    assert np.ptp(in_order[0.2]) > 0.0
    for time in (0.2, 0.0, 0.12, 0.12, 0.05, 0.2):
        assert surface_at(second, time).tobytes() == in_order[time].tobytes()


@pytest.mark.parametrize("kind", ["explicit", "implicit"])
def test_a_time_between_steps_shows_the_nearest(device, kind):
    water = SimulatedWater(basin(**KINDS[kind]), device)
    step = water.basin.step
    exact = surface_at(water, 7 * step)
    for time in (6.6 * step, 7.4 * step):
        np.testing.assert_array_equal(surface_at(water, time), exact)
    assert (surface_at(water, 7.6 * step) != exact).any()


@pytest.mark.parametrize("kind", ["explicit", "implicit"])
def test_an_interrupted_step_leaves_nothing_behind(device, kind, monkeypatch):
    drops = [*ONE_DROP, {**ONE_DROP[0], "time": 0.05}]
    water = SimulatedWater(basin(**KINDS[kind], drops=drops), device)
    expected = surface_at(water, 0.1)
    surface_at(water, 0.06)
    step, left = water.motion._step, [3]
    names = ("height", "velocity", "_pressure", *(("_mean", "_change") if kind == "implicit" else ()))

    def interrupted() -> None:
        left[0] -= 1
        if not left[0]:
            for name in names:
                getattr(water.motion, name).fill_(np.nan)
            raise KeyboardInterrupt
        step()

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(water.motion, "_step", interrupted)
        water.advance(0.1)
    assert surface_at(water, 0.1).tobytes() == expected.tobytes()


# --- drops ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_a_drop_is_a_gaussian_at_rest(device, kind):
    of = basin(**KINDS[kind])
    x, y = (np.arange(32) + 0.5) * 0.02, (np.arange(16) + 0.5) * 0.02
    bump = 0.004 * np.exp(-((x[None, :] - 0.22) ** 2 + (y[:, None] - 0.11) ** 2) / 0.05**2)
    start = surface_at(SimulatedWater(of, device), 0.0)
    np.testing.assert_allclose(start, bump, atol=1e-2 * bump.max())  # the walls mirror its foot
    np.testing.assert_allclose(start[5:, :20], bump[5:, :20], atol=1e-6 * bump.max())


@pytest.mark.parametrize(
    ("border", "drop", "height"),
    [
        ("reflecting", {"position": (0.31, 0.17), "radius": 0.02}, 1.0),
        ("reflecting", {"position": (0.64, 0.17), "radius": 0.02}, 2.0),
        ("reflecting", {"position": (0.0, 0.32), "radius": 0.02}, 4.0),
        ("reflecting", {"position": (0.31, 0.02), "radius": 0.04}, 1.0 / np.exp(0.25) * 2.0),  # highest at the wall
        ("reflecting", {"position": (0.31, 0.17), "radius": 1.28}, 8.0 * np.pi),  # the mean of a wide one, by area
        ("periodic", {"position": (0.0, 0.0), "radius": 0.02}, 1.0),
        ("periodic", {"position": (9.0, -4.0), "radius": 0.64}, 2.0 * np.pi),
    ],
)
def test_the_height_that_is_planned_for_is_that_of_the_drops_and_their_images(device, border, drop, height):
    of = basin(kind="spectral", resolution=(128, 64), border=border, drops=[{**drop, "amplitude": -0.003}])
    bound, water = of.settings.height_bound, SimulatedWater(of, device)
    assert bound == pytest.approx(0.003 * height, rel=2e-3)
    highest = np.abs(surface_at(water, 0.0)).max()
    assert 0.9 * bound < highest <= bound
    assert not [note for note in water.warnings() if "height" in note]


@pytest.mark.parametrize("kind", ["explicit", "implicit"])
def test_a_drop_that_falls_later_is_the_same_drop_later(device, kind):
    step = basin(**KINDS[kind]).step
    late = [{**ONE_DROP[0], "time": 10 * step}]
    at_once, waiting = (SimulatedWater(basin(**KINDS[kind], drops=drops), device) for drops in (ONE_DROP, late))
    assert not surface_at(waiting, 9 * step).any()
    for steps in (0, 1, 25):
        np.testing.assert_array_equal(surface_at(waiting, (10 + steps) * step), surface_at(at_once, steps * step))
    both = SimulatedWater(basin(**KINDS[kind], drops=[*ONE_DROP, *late]), device)
    expected = surface_at(at_once, 30 * step) + surface_at(waiting, 30 * step)
    tolerance = ROUNDING if kind == "explicit" else IMPLICIT_PHASE * 0.004
    np.testing.assert_allclose(surface_at(both, 30 * step), expected, atol=tolerance)


# --- borders --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["spectral", "explicit"])  # the implicit one's walls are in the same function
def test_water_between_walls_is_half_of_mirrored_water(device, kind):
    """Exactly what walls are: the water of a drop and its mirror images in a periodic rectangle of twice the sides."""
    x, y = ONE_DROP[0]["position"]
    images = [{**ONE_DROP[0], "position": (sx * x, sy * y)} for sx in (1, -1) for sy in (1, -1)]
    doubled = {**KINDS[kind], "resolution": (64, 32), "size": (1.28, 0.64), "origin": (-0.64, -0.32)}
    walled = SimulatedWater(basin(**KINDS[kind]), device)
    mirrored = SimulatedWater(basin(**doubled, border="periodic", drops=images), device)
    for time in (0.0, 0.31, 1.3):
        whole = surface_at(mirrored, time)
        np.testing.assert_allclose(surface_at(walled, time), whole[16:, 32:], atol=ROUNDING)
        np.testing.assert_allclose(whole[16:, 32:], whole[:16, :32][::-1, ::-1], atol=ROUNDING)


@pytest.mark.parametrize("kind", KINDS)
def test_periodic_water_knows_no_place(device, kind):
    moved = [{**ONE_DROP[0], "position": (0.22 + 15 * 0.02, 0.11 - 9 * 0.02)}]
    here, there = (SimulatedWater(basin(**KINDS[kind], border="periodic", drops=d), device) for d in (ONE_DROP, moved))
    for time in (0.0, 0.4):
        rolled = np.roll(surface_at(here, time), (-9, 15), axis=(0, 1))
        np.testing.assert_allclose(surface_at(there, time), rolled, atol=ROUNDING)


# --- obstacles ------------------------------------------------------------------------------------------------------


def test_an_obstacle_reflects_as_a_wall_and_stays_still(device):
    """A box across the basin leaves the water before it in a smaller basin, to the last bit, and that behind calm."""
    wall = [{"position": (0.42, 0.16), "size": (0.04, 0.4)}]
    of = basin(kind="grid", resolution=(32, 16), obstacles=wall)
    assert of.solid is not None
    assert of.solid.sum() == 2 * 16
    blocked = SimulatedWater(of, device)
    alone = SimulatedWater(basin(kind="grid", resolution=(20, 16), size=(0.4, 0.32), drops=[]), device)
    blocked.advance(0.0)
    before = blocked.motion.height.numpy().copy()
    before[:, 20:] = 0.0
    for water, height in ((blocked, before), (alone, before[:, :20])):
        put(water, np.ascontiguousarray(height))
    time = 200 * of.step
    ahead = surface_at(blocked, time)
    np.testing.assert_array_equal(ahead[:, :20], surface_at(alone, time))
    assert np.ptp(ahead[:, :20]) > 1e-5
    assert not blocked.motion.height.numpy()[:, 20:].any()
    assert not blocked.motion.velocity.numpy()[:, 20:].any()


@pytest.mark.parametrize("border", BORDERS)
def test_the_surface_fades_out_into_an_obstacle(device, border):
    """No step at its rim: the cells beside it have the height of their neighbours, its middle that of calm water."""
    of = basin(kind="grid", resolution=(64, 32), border=border, obstacles=[{"position": (0.0, 0.16), "radius": 0.12}])
    water = SimulatedWater(of, device)
    put(water, np.where(of.solid, 0.0, 0.001))
    surface = surface_at(water, 0.0)
    assert (surface[of.solid == 0] == 0.001).all()
    assert ((surface[of.solid == 1] >= 0.0) & (surface[of.solid == 1] < 0.001)).all()
    assert surface[16, 0] < 1e-9
    assert np.abs(np.diff(surface, axis=0)).max() < 0.0005
    if border == "periodic":
        np.testing.assert_allclose(surface[:, :20], surface[:, ::-1][:, :20], atol=ROUNDING)
        assert of.solid[16, -1]
    else:
        assert not of.solid[16, -1]
