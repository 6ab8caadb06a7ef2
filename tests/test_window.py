"""The window of water that lights a map: bounds that hold, cells that cover it, the directions of the sun's disk."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import oracle
import warp_caustics as wc
from oracle.optics import refract_slopes as oracle_refract_slopes
from warp_caustics.assets import Assets, load_assets
from warp_caustics.errors import InputError
from warp_caustics.facts import gather_facts
from warp_caustics.sun import MOST_DIRECTIONS, disk_count, disk_directions, refract_slopes
from warp_caustics.water import amplitude_bound, extreme_slopes
from warp_caustics.window import INDEX_BOUND, STEEPEST_RAY, deviation_bounds, lattice_over, refraction_reach

# float64 all the way.
ROUNDING = 1e-9
# A bound that is twice as wide as need be would cost four times the water.
WIDEST = 1.25
HALF_ANGLE = np.radians(0.2665)
IOR = 1.333


def sunlight(zenith, azimuth):
    """Direction of travel from angles in degrees."""
    z, a = np.radians(zenith), np.radians(azimuth)
    return np.array([np.sin(z) * np.cos(a), np.sin(z) * np.sin(a), -np.cos(z)])


def water(steps, sun=(0.0, 0.0)):
    """A metre of water whose waves have these vectors a k, and a wave number of 4 each."""
    waves = []
    for step in np.asarray(steps, dtype=float).reshape(-1, 2):
        slope = float(np.hypot(*step))
        waves.append({"amplitude": slope / 4.0, "wavevector": tuple(4.0 * step / slope)})
    return wc.Scene(
        water={"level": 1.0, "waves": waves},
        receiver={"plane": 0.0},
        sun={"direction": tuple(sunlight(*sun))},
        medium={"ior": IOR},
        map={"origin": (0.0, 0.0), "size": (1.0, 1.0), "resolution": (8, 8)},
    )


def slopes_within(steps, n, seed=0):
    """Slopes that the waves can have together: inside the zonotope of their vectors, and on its edges and corners."""
    rng = np.random.default_rng(seed)
    steps = np.asarray(steps, dtype=float).reshape(-1, 2)
    share = rng.uniform(-1.0, 1.0, (n, len(steps)))
    corner = np.sign(rng.uniform(-1.0, 1.0, (n, len(steps))))
    edge = np.where(np.arange(len(steps)) == rng.integers(0, len(steps), n)[:, None], share, corner)
    return np.concatenate([share, corner, edge]) @ steps


def ways(direction, slopes):
    """Horizontal way by unit depth [n, 2] of the light that these slopes let in, and is not flatter than is traced."""
    rx, ry, rz, cosine = oracle_refract_slopes(direction, slopes[:, 0], slopes[:, 1], IOR)
    kept = (cosine > 0.0) & (np.hypot(rx, ry) < STEEPEST_RAY * -rz)
    return np.stack([rx, ry], axis=1)[kept] / -rz[kept, None]


SETS = {
    "calm": [[0.05, 0.02], [-0.03, 0.04]],
    "one wave": [[0.5, 0.0]],
    "cross sea": [[0.6, 0.0], [0.0, 0.6]],
    "three": [[0.3, 0.1], [-0.1, 0.3], [0.2, -0.2]],
    "nearly one direction": [[0.4, 0.1], [0.35, 0.2]],
}
SUNS = {"zenith": (0.0, 0.0), "30": (30.0, 70.0), "60": (60.0, 25.0), "80": (80.0, 0.0)}


def test_no_slope_sends_light_past_the_bounds():
    """Random slopes that the waves can have, over seas and suns: the way stays within low and high, and steepest."""
    wrong = []
    for name, steps in SETS.items():
        for sun, angles in SUNS.items():
            direction = sunlight(*angles)
            reach = refraction_reach(direction, extreme_slopes(water(steps), Assets(None, None, None, None)), IOR)
            way = ways(direction, slopes_within(steps, 20_000))
            past = max((reach.low - way.min(axis=0)).max(), (way.max(axis=0) - reach.high).max())
            if past > ROUNDING or np.linalg.norm(way, axis=1).max() > reach.steepest + ROUNDING:
                wrong.append((name, sun, past))
    assert not wrong


@pytest.mark.parametrize("name", SETS)
@pytest.mark.parametrize("sun", SUNS)
def test_the_bounds_are_not_far_too_wide(name, sun):
    """As far as some slope goes, or a quarter more."""
    direction = sunlight(*SUNS[sun])
    reach = refraction_reach(direction, extreme_slopes(water(SETS[name]), Assets(None, None, None, None)), IOR)
    way = ways(direction, slopes_within(SETS[name], 20_000))
    assert ((reach.high - reach.low) <= WIDEST * (way.max(axis=0) - way.min(axis=0)) + ROUNDING).all()
    assert ((reach.low <= reach.rest) & (reach.rest <= reach.high)).all()


def test_every_slope_of_the_waves_is_in_the_hull_of_the_extreme_ones():
    """In every direction the extreme slopes reach as far as the waves do together, to the bulge between 64 of them."""
    for steps in SETS.values():
        extreme = extreme_slopes(water(steps), Assets(None, None, None, None))
        assert (extreme == 0.0).all(axis=1).any()
        for angle in np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False):
            outward = np.array([np.cos(angle), np.sin(angle)])
            assert (extreme @ outward).max() == pytest.approx(np.abs(np.array(steps) @ outward).sum(), abs=ROUNDING)


def test_flat_water_sends_light_one_way():
    direction = sunlight(45.0, 30.0)
    reach = refraction_reach(direction, np.zeros((1, 2)), IOR)
    tangent = np.tan(np.arcsin(np.sin(np.radians(45.0)) / IOR))
    expected = tangent * np.array([np.cos(np.radians(30.0)), np.sin(np.radians(30.0))])
    for found in (reach.rest, reach.low, reach.high):
        assert found == pytest.approx(expected, abs=1e-12)
    assert reach.steepest == pytest.approx(tangent, abs=1e-12)
    assert not reach.clipped


def test_a_ray_that_is_all_but_level_is_cut_and_said_so():
    reach = refraction_reach(sunlight(89.0, 0.0), np.array([[0.0, 0.0], [100.0, 0.0]]), IOR)
    assert reach.clipped
    assert reach.steepest == pytest.approx(STEEPEST_RAY)


def test_refraction_of_the_host_equals_the_oracle():
    direction, slopes = sunlight(70.0, 10.0), slopes_within(SETS["three"], 500)
    rx, ry, rz, cosine = oracle_refract_slopes(direction, slopes[:, 0], slopes[:, 1], IOR)
    lit = cosine > 0.0
    assert np.abs(refract_slopes(direction, slopes, IOR) - np.stack([rx, ry, rz], axis=1))[lit].max() < 1e-12


@pytest.mark.parametrize("sun", ["zenith", "30", "60", "80"])
def test_landings_stay_within_the_deviation_of_the_plan(sun):
    """Points of the water over a plane, at the moment at which the waves add up, against gather_facts."""
    scene = water(SETS["cross sea"], SUNS[sun])
    facts = gather_facts(scene, load_assets(scene))
    waves = [(w.amplitude, w.wavevector) for w in scene.water.waves]
    surface = oracle.Surface(
        1.0, (0.0, 0.0), np.array([a for a, _ in waves]), np.array([k for _, k in waves]), np.zeros(len(waves))
    )
    x, y = np.random.default_rng(1).uniform(0.0, 2.0 * np.pi / 4.0, (2, 200_000))
    z, zx, zy = surface.height_and_slopes(x, y)
    rx, ry, rz, cosine = oracle_refract_slopes(facts.suns[0], zx, zy, IOR)
    kept = (cosine > 0.0) & (np.hypot(rx, ry) < STEEPEST_RAY * -rz)
    landed = np.stack([z * rx / -rz, z * ry / -rz], axis=1)[kept]
    deviation = (landed - facts.rest_shifts[0]) / facts.pixel
    low, high = facts.deviation
    assert (deviation >= low - ROUNDING).all() and (deviation <= high + ROUNDING).all()


def test_the_amplitude_is_bounded_by_the_sum_of_the_waves():
    assert amplitude_bound(water(SETS["cross sea"]), Assets(None, None, None, None)) == pytest.approx(0.3)


@settings(deadline=None, max_examples=60)
@given(
    low=st.tuples(st.floats(-50.0, 5.0), st.floats(-50.0, 5.0)),
    width=st.tuples(st.floats(0.0, 60.0), st.floats(0.0, 60.0)),
    resolution=st.tuples(st.integers(1, 40), st.integers(1, 40)),
    step=st.sampled_from([0.25, 0.5, 0.7071, 1.0, 3.0]),
)
def test_a_lattice_has_every_cell_that_can_light_the_map_and_few_more(low, width, resolution, step):
    low, high = np.array(low), np.add(low, width)
    lattice = lattice_over(low, high, resolution, step)
    assert lattice.cells == lattice.count[0] * lattice.count[1]
    for axis in (0, 1):
        cells = np.arange(lattice.first[axis] - 5, lattice.first[axis] + lattice.count[axis] + 5)
        # A cell lands somewhere between its own square moved by low and by high.
        lights = (cells * step + low[axis] < resolution[axis]) & ((cells + 1) * step + high[axis] > 0.0)
        inside = (cells >= lattice.first[axis]) & (cells < lattice.first[axis] + lattice.count[axis])
        assert inside[lights].all()
        assert (inside & ~lights).sum() <= 2


def test_a_lattice_past_what_can_be_counted_is_refused():
    for low, high in ((-INDEX_BOUND * 2.0, 0.0), (-np.inf, 0.0), (np.nan, 0.0), (-3e5, 3e5)):
        with pytest.raises(InputError, match="map"):
            lattice_over(np.full(2, low), np.full(2, high), (64, 64), 1.0)


def test_deviation_is_measured_from_where_light_lands_at_rest():
    """Depths from 1 to 3 m, ways from 0.1 to 0.4: the ends are products of ends, less the shift at rest."""
    reach = refraction_reach(sunlight(30.0, 0.0), slopes_within(SETS["calm"], 100), IOR)
    low, high = deviation_bounds((reach.low, reach.high), reach.rest, (1.0, 3.0), 2.0, np.array([0.5, 0.25]))
    rng = np.random.default_rng(3)
    depth, share = rng.uniform(1.0, 3.0, (1000, 1)), rng.random((1000, 2))
    way = reach.low + share * (reach.high - reach.low)
    deviation = (depth * way - 2.0 * reach.rest) / [0.5, 0.25]
    assert (deviation >= low - ROUNDING).all() and (deviation <= high + ROUNDING).all()
    # Beside that only the room for float32.
    assert high[0] == pytest.approx((3.0 * reach.high[0] - 2.0 * reach.rest[0]) / 0.5, rel=2e-5)


@pytest.mark.parametrize("count", [1, 2, 3, 7, 8, 64, 256])
@pytest.mark.parametrize("angles", [(0.0, 0.0), (60.0, 25.0), (88.0, 90.0), (45.0, 180.0)])
def test_the_disk_has_its_directions_within_the_half_angle_around_its_middle(count, angles):
    direction = sunlight(*angles)
    rays = disk_directions(direction, HALF_ANGLE, count)
    assert rays.shape == (count, 3)
    assert np.linalg.norm(rays, axis=1) == pytest.approx(np.ones(count), abs=1e-12)
    away = np.arctan2(np.linalg.norm(np.cross(rays, direction), axis=1), rays @ direction)
    assert (away <= HALF_ANGLE).all()
    assert len(np.unique(rays.round(12), axis=0)) == count
    if count == 1:
        assert (rays[0] == direction).all()
        return
    # Stratified: the mean of the squared angle is that of a disk, half of its radius squared.
    assert np.sqrt(np.mean(away**2)) == pytest.approx(HALF_ANGLE / np.sqrt(2.0), rel=1e-3)
    middle = rays.mean(axis=0)
    middle /= np.linalg.norm(middle)
    off = np.linalg.norm(np.cross(middle, direction)) / HALF_ANGLE
    assert off < ROUNDING


def test_directions_fill_the_disk_evenly():
    """Each of four quarters of the disk, and of four rings of equal area, has its quarter of 256 directions."""
    direction = sunlight(40.0, 25.0)
    rays = disk_directions(direction, HALF_ANGLE, 256)
    right = np.cross(direction, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    x, y = rays @ right, rays @ np.cross(direction, right)
    quarter = np.histogram(np.arctan2(y, x), bins=4, range=(-np.pi, np.pi))[0]
    ring = np.histogram((x**2 + y**2) / HALF_ANGLE**2, bins=4, range=(0.0, 1.0))[0]
    assert np.abs(quarter - 64).max() <= 3
    assert np.abs(ring - 64).max() <= 1


def disk_landings(zenith, count, depth):
    """Where the light of the disk's directions lands under flat water [count, 2]."""
    directions = disk_directions(sunlight(zenith, 0.0), HALF_ANGLE, count)
    rays = np.concatenate([refract_slopes(direction, np.zeros((1, 2)), IOR) for direction in directions])
    return depth * rays[:, :2] / -rays[:, 2:]


@pytest.mark.parametrize(("zenith", "along", "across"), [(0.0, 3.49e-3, 3.49e-3), (60.0, 3.93e-3, 4.59e-3)])
def test_the_disk_blurs_as_it_should_and_is_sampled_finely_enough_for_it(zenith, along, across):
    """By metre of depth: 0.199 degrees at noon, 0.130 in the plane of incidence at 60, seen along the floor."""
    landed = disk_landings(zenith, MOST_DIRECTIONS, 1.0)
    landed -= landed.mean(axis=0)
    assert 2.0 * landed.std(axis=0) == pytest.approx([along, across], rel=0.02)
    depth, pixel = 4.0, 8e-3
    count = disk_count(HALF_ANGLE, np.radians(zenith), IOR, depth, pixel)
    assert 2 < count < MOST_DIRECTIONS
    dots = disk_landings(zenith, count, depth) / pixel
    apart = np.linalg.norm(dots[:, None] - dots[None, :], axis=2) + 1e9 * np.eye(count)
    # Half a pixel between dots is what no pixel shows; in a sunflower some are a little wider apart.
    assert np.median(apart.min(axis=1)) < 0.6


def test_a_point_sun_is_one_direction_and_a_deep_sea_is_capped():
    assert disk_count(0.0, 0.5, IOR, 1e6, 1e-3) == 1
    assert disk_count(HALF_ANGLE, 0.5, IOR, 1e-9, 1.0) == 2
    assert disk_count(HALF_ANGLE, 0.5, IOR, 1e6, 1e-3) == MOST_DIRECTIONS


@settings(deadline=None, max_examples=60)
@given(zenith=st.floats(0.0, 89.0), depth=st.floats(0.01, 100.0), pixel=st.floats(1e-3, 1.0))
def test_more_depth_or_finer_pixels_never_take_fewer_directions(zenith, depth, pixel):
    angle = np.radians(zenith)
    count = disk_count(HALF_ANGLE, angle, IOR, depth, pixel)
    assume(count < MOST_DIRECTIONS)
    assert disk_count(HALF_ANGLE, angle, IOR, 2.0 * depth, pixel) >= count
    assert disk_count(HALF_ANGLE, angle, IOR, depth, 0.5 * pixel) >= count
    assert disk_count(0.5 * HALF_ANGLE, angle, IOR, depth, pixel) <= count
