"""Where rays land: plane, height field, mesh and objects against float64, and Bäcklund's estimate."""

from dataclasses import dataclass

import numpy as np
import pytest
import warp as wp
from kernel_helpers import grid_surface, mesh, points, rounded, terrain_receiver, wave_surface

import oracle
from warp_caustics.kernels.project import (
    GROUND,
    NOTHING,
    OBJECT,
    Receiver,
    make_hit_receiver,
    project_backlund,
)
from warp_caustics.kernels.spec import Spec

wp.set_module_options({"enable_backward": False})

# Heights of metres in float32, after a few sums: what a hit may be off the surface by.
GAP_TOLERANCE = 3e-6
# Slopes from the sines, at a hit that is rounded.
NORMAL_TOLERANCE = 2e-5
# Slopes between nodes 1/64 m apart, from heights of 2 m that are rounded to 1e-7.
GRID_NORMAL_TOLERANCE = 6e-5
# Bäcklund's overshoot is quoted in whole per cent.
OVERSHOOT_TOLERANCE = 0.01
STEP = 1e-3  # smallest step of the marches [m]
IOR = 1.333

to_plane = make_hit_receiver(Spec(receiver="plane"))
to_plane_and_objects = make_hit_receiver(Spec(receiver="plane", objects=True))
to_waves = make_hit_receiver(Spec(receiver="waves"))
to_grid = make_hit_receiver(Spec(receiver="grid"))
to_mesh = make_hit_receiver(Spec(receiver="mesh"))


@wp.kernel
def land(
    kind: int, receiver: Receiver, origins: wp.array[wp.vec3], directions: wp.array[wp.vec3],
    parts: wp.array[int], distances: wp.array[float], normals: wp.array[wp.vec3],
):  # fmt: skip
    i = wp.tid()
    if kind == 0:
        hit = to_plane(receiver, origins[i], directions[i])
    elif kind == 1:
        hit = to_plane_and_objects(receiver, origins[i], directions[i])
    elif kind == 2:
        hit = to_waves(receiver, origins[i], directions[i])
    elif kind == 3:
        hit = to_grid(receiver, origins[i], directions[i])
    else:
        hit = to_mesh(receiver, origins[i], directions[i])
    parts[i] = hit.part
    distances[i] = hit.distance
    normals[i] = hit.normal


@wp.kernel
def estimate(water: wp.array[wp.vec3], terrain: wp.array[wp.vec3], rays: wp.array[wp.vec3], landing: wp.array[wp.vec3]):
    i = wp.tid()
    landing[i] = project_backlund(water[i], terrain[i], rays[i])


KINDS = {"plane": 0, "plane and objects": 1, "waves": 2, "grid": 3, "mesh": 4}


@dataclass
class Hits:
    part: np.ndarray
    distance: np.ndarray
    normal: np.ndarray


def hits(kind, receiver, origins, directions, device):
    """Where rays [n, 3] land."""
    n = len(origins)
    outputs = [wp.zeros(n, dtype=dtype, device=device) for dtype in (int, float, wp.vec3)]
    inputs = [KINDS[kind], receiver, points(origins, device), points(directions, device)]
    wp.launch(land, dim=n, inputs=inputs, outputs=outputs, device=device)
    return Hits(*(output.numpy().astype(np.float64) for output in outputs))


def rays(n, steepest, seed=1, area=4.0):
    """Rays from the level, z = 0, that go down at up to ``steepest`` degrees from the vertical, in float32 values."""
    rng = np.random.default_rng(seed)
    origins = np.concatenate([area * rng.random((n, 2)), np.zeros((n, 1))], axis=1)
    angle, turn = np.radians(steepest) * rng.random(n), 2.0 * np.pi * rng.random(n)
    directions = np.stack([np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), -np.cos(angle)], axis=1)
    return rounded(origins), rounded(directions)


def first_crossing(height, origins, directions, longest, samples=8000):
    """Distance to the first change of sign of a ray's height over a surface, in float64; inf where there is none."""
    t = np.linspace(0.0, longest, samples + 1)
    p = origins[:, None, :] + t[None, :, None] * directions[:, None, :]
    below = p[..., 2] < height(p[..., 0], p[..., 1])
    first = below.argmax(axis=1)
    low, high = t[np.maximum(first - 1, 0)], t[first]
    for _ in range(60):
        middle = 0.5 * (low + high)
        p = origins + middle[:, None] * directions
        under = p[:, 2] < height(p[:, 0], p[:, 1])
        low, high = np.where(under, low, middle), np.where(under, middle, high)
    return np.where(below.any(axis=1), high, np.inf)


def check_hits(found, expected, surface, origins, directions, normal_tolerance=NORMAL_TOLERANCE):
    """All rays land, on the surface, at the first crossing but for slivers of less than a step, with its normal."""
    assert (found.part == GROUND).all()
    p = origins + found.distance[:, None] * directions
    height, zx, zy = surface.height_and_slopes(p[:, 0], p[:, 1])
    # Along a long way the point itself is rounded, to 6e-8 of the distance.
    rounding = 1.0 + 0.1 * found.distance
    assert (np.abs(p[:, 2] - height) < GAP_TOLERANCE * rounding).all()
    normal = np.stack([-zx, -zy, np.ones(len(zx))], axis=1)
    assert (np.abs(found.normal - normal).max(axis=1) < normal_tolerance * rounding).all()
    rate = np.abs((directions * normal).sum(axis=1))
    late = found.distance - expected
    assert (late > -2.0 * GAP_TOLERANCE * rounding / rate).all()
    over = late > 2.0 * GAP_TOLERANCE * rounding / rate
    assert over.mean() < 0.005
    for i in np.flatnonzero(over):
        t = expected[i] + np.linspace(0.0, late[i], 20000)
        q = origins[i] + t[:, None] * directions[i]
        under = q[:, 2] - surface.height(q[:, 0], q[:, 1]) < -GAP_TOLERANCE
        assert under.sum() * (t[1] - t[0]) < STEP


HILLS = oracle.Surface(
    -1.5,
    (0.1, -0.05),
    np.array([0.5, 0.3, 0.1]),
    np.array([[3.0, 1.0], [-1.0, 4.0], [7.0, -6.0]]),
    np.array([0.0, 1.0, 2.0]),
)


def hills(device):
    """A terrain in closed form, steep enough to hide behind, whose tops stay under the level within the area."""
    waves = zip(HILLS.amplitude, HILLS.wavevector, HILLS.phase, strict=True)
    surface = wave_surface(list(waves), device, HILLS.base, HILLS.slope)
    return terrain_receiver(surface, -5.0, 1.0, HILLS.slope_bound, STEP)


def test_a_plane_is_met_in_closed_form(device):
    origins, directions = rays(500, 89.0)
    origins[:, 2] = rounded(np.random.default_rng(2).uniform(-0.2, 0.2, 500))
    receiver = Receiver()
    receiver.level = -2.0
    found = hits("plane", receiver, origins, directions, device)
    expected = (origins[:, 2] + 2.0) / -directions[:, 2]
    assert (found.part == GROUND).all()
    assert found.distance == pytest.approx(expected, rel=3e-7)
    assert (found.normal == [0.0, 0.0, 1.0]).all()


def test_rays_that_do_not_go_down_meet_no_plane_and_those_below_it_stay(device):
    receiver = Receiver()
    receiver.level = -1.0
    down = [0.0, 0.6, -0.8]
    found = hits("plane", receiver, np.array([[0, 0, 0.0], [0, 0, 0.0], [0, 0, -1.5]]),
                 np.array([[0.0, 0.6, 0.8], [1.0, 0.0, 0.0], down]), device)  # fmt: skip
    assert found.part.tolist() == [NOTHING, NOTHING, GROUND]
    assert found.distance[2] == 0.0


@pytest.mark.parametrize("steepest", [30.0, 60.0, 85.0])
def test_hills_in_closed_form_against_a_dense_search(device, steepest):
    origins, directions = rays(400, steepest, seed=int(steepest))
    found = hits("waves", hills(device), origins, directions, device)
    longest = 60.0 if steepest > 80.0 else 8.0
    check_hits(found, first_crossing(HILLS.height, origins, directions, longest), HILLS, origins, directions)


def test_a_height_map_of_the_hills_is_met_where_they_are(device):
    """The same terrain through nodes: fourth order, so a fine map is the hills themselves to 1e-6."""
    spacing = 1.0 / 64.0
    x = np.arange(-4.0, 8.0, spacing)
    surface = grid_surface(HILLS.height(*np.meshgrid(x, x)), (-4.0, -4.0), (spacing, spacing), device)
    receiver = terrain_receiver(surface, -5.0, 1.0, HILLS.slope_bound, STEP)
    origins, directions = rays(400, 60.0, seed=6)
    found = hits("grid", receiver, origins, directions, device)
    expected = first_crossing(HILLS.height, origins, directions, 8.0)
    check_hits(found, expected, HILLS, origins, directions, GRID_NORMAL_TOLERANCE)


def test_grazing_rays_are_not_stepped_through_a_crest(device):
    """Rays level with a crest to within millimetres: those under its top stop at it, those over it go on."""
    ridge = oracle.Surface(-1.0, (0.0, 0.0), np.array([0.5]), np.array([[2.0, 0.0]]), np.array([0.0]))
    surface = wave_surface([(0.5, (2.0, 0.0), 0.0)], device, -1.0)
    receiver = terrain_receiver(surface, -2.0, 0.0, ridge.slope_bound, STEP)
    offset = np.array([-2e-2, -2e-3, -2e-4, 2e-4, 2e-3, 2e-2])
    fall = rounded(1e-3)  # the way down of rays that are all but level
    top = np.pi / 4.0  # the first crest, z = -0.5, is met after that many metres
    origins = rounded(np.stack([0.0 * offset, 0.0 * offset, -0.5 + fall * top + offset], axis=1))
    directions = np.tile([np.sqrt(1.0 - fall**2), 0.0, -fall], (6, 1))
    found = hits("waves", receiver, origins, directions, device)
    expected = first_crossing(ridge.height, origins, rounded(directions), 100.0, 100_000)
    assert (found.part == GROUND).all()
    assert found.distance[:3] == pytest.approx(expected[:3], abs=3.0 * STEP)
    assert (found.distance[:3] < top).all()
    assert (found.distance[3:] > top).all()
    assert found.distance[4:] == pytest.approx(expected[4:], abs=3.0 * STEP)


def test_a_start_on_dry_land_or_in_the_ground_lands_where_it_is(device):
    origins = np.array([[1.0, 1.0, 0.0], [1.0, 1.0, -3.0], [1.0, 1.0, 0.0]])
    origins[0, 2] = HILLS.height(np.array(1.0), np.array(1.0)) - 1e-3
    directions = np.array([[0.6, 0.0, -0.8], [0.0, 0.0, -1.0], [0.0, 0.0, -1.0]])
    receiver = hills(device)
    found = hits("waves", receiver, origins, directions, device)
    assert (found.part == GROUND).all()
    assert found.distance[:2].tolist() == [0.0, 0.0]
    assert found.distance[2] > 0.1
    assert np.isfinite(found.normal).all()


def test_rays_that_go_up_or_level_meet_no_terrain(device):
    origins = np.zeros((3, 3))
    directions = np.array([[0.6, 0.0, 0.8], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    found = hits("waves", hills(device), origins, directions, device)
    assert (found.part == NOTHING).all()


def test_rays_that_are_no_numbers_end(device):
    nan, inf = np.nan, np.inf
    origins = np.array([[nan, 0, 0], [0, 0, nan], [0, 0, 0], [inf, 0, 0], [0, 0, inf], [0, 0, 0]])
    directions = np.array([[0, 0, -1], [0, 0, -1], [nan, nan, nan], [0, 0, -1], [0, 0, -1], [inf, 0, -inf]], float)
    for kind in ("plane", "waves"):
        found = hits(kind, hills(device), origins, directions, device)
        assert found.part.shape == (6,)


def tilted_quad(device):
    """The plane z = -2 + 0.25 x - 0.5 y over a square, its triangles turned either way."""
    corners = np.array([[-20.0, -20.0], [20.0, -20.0], [20.0, 20.0], [-20.0, 20.0]])
    vertices = np.concatenate([corners, (-2.0 + corners @ [0.25, -0.5])[:, None]], axis=1)
    return mesh(vertices, [[0, 1, 2], [0, 3, 2]], device)


def test_a_tilted_quad_is_met_in_closed_form_with_normals_up(device):
    origins, directions = rays(300, 50.0, seed=3, area=2.0)
    quad, receiver = tilted_quad(device), Receiver()
    receiver.mesh, receiver.reach = quad.id, 100.0
    found = hits("mesh", receiver, origins, directions, device)
    gap = origins[:, 2] - (-2.0 + origins[:, :2] @ [0.25, -0.5])
    expected = gap / (directions[:, :2] @ [0.25, -0.5] - directions[:, 2])
    assert (found.part == GROUND).all()
    # Barycentric coordinates of triangles 40 m wide, in float32.
    assert found.distance == pytest.approx(expected, rel=3e-5)
    unit = found.normal / np.linalg.norm(found.normal, axis=1)[:, None]
    assert np.abs(unit - np.array([-0.25, 0.5, 1.0]) / np.sqrt(1.3125)).max() < NORMAL_TOLERANCE


def test_a_mesh_is_missed_beside_it_and_beyond_the_reach(device):
    quad, receiver = tilted_quad(device), Receiver()
    receiver.mesh, receiver.reach = quad.id, 1.5
    origins = np.array([[30.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 0.0, -1.0]])
    directions = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, -1.0], [0.0, 0.0, -1.0], [0.0, 0.0, 1.0]])
    assert hits("mesh", receiver, origins, directions, device).part.tolist() == [NOTHING, NOTHING, GROUND, NOTHING]


def test_the_hills_as_triangles_are_met_where_the_hills_are(device):
    """To second order in the spacing: half of it leaves a quarter of the difference."""
    origins, directions = rays(300, 25.0, seed=8)
    expected = first_crossing(HILLS.height, origins, directions, 6.0)
    errors = []
    for n in (101, 201):
        x = np.linspace(-3.0, 7.0, n)
        gx, gy = np.meshgrid(x, x)
        vertices = np.stack([gx, gy, HILLS.height(gx, gy)], axis=-1).reshape(-1, 3)
        corner = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
        above, right = corner + n, corner + 1
        triangles = np.concatenate([np.stack([corner, right, above + 1], 1), np.stack([corner, above + 1, above], 1)])
        terrain, receiver = mesh(vertices, triangles, device), Receiver()
        receiver.mesh, receiver.reach = terrain.id, 100.0
        found = hits("mesh", receiver, origins, directions, device)
        assert (found.part == GROUND).all()
        errors.append(np.median(np.abs(found.distance - expected)))
    assert 3.0 < errors[0] / errors[1] < 5.0
    assert errors[1] < 2e-3


def test_the_nearer_of_ground_and_object_is_met(device):
    """A table at z = -1 over x > 0, and a cellar at z = -3 under x < 0, on a plane at z = -2."""
    vertices = np.array([
        [0.0, -9, -1], [9, -9, -1], [9, 9, -1], [0, 9, -1], [-9.0, -9, -3], [0, -9, -3], [0, 9, -3], [-9, 9, -3]
    ])  # fmt: skip
    things = mesh(vertices, [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]], device)
    receiver = Receiver()
    receiver.level, receiver.objects, receiver.reach = -2.0, things.id, 100.0
    origins = np.array([[1.0, 0.5, 0.0], [-1.0, 0.5, 0.0], [1.0, 0.5, -1.5], [-0.5, 0.5, 0.0]])
    slanted = np.array([np.sin(np.pi / 4), 0.0, -np.cos(np.pi / 4)])
    directions = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, -1.0], [0.0, 0.0, -1.0], slanted])
    found = hits("plane and objects", receiver, origins, directions, device)
    assert found.part.tolist() == [OBJECT, GROUND, GROUND, OBJECT]
    assert found.distance == pytest.approx([1.0, 2.0, 0.5, np.sqrt(2.0)], rel=1e-6)
    assert (found.normal[:, 2] > 0.0).all()


def backlund_share(zenith, device):
    """Length of Bäcklund's way to a flat floor over the right one, for flat water and a sun at angles in degrees."""
    angle = np.radians(np.atleast_1d(zenith))
    n, depth = len(angle), 2.0
    sun = np.stack([np.sin(angle), 0.0 * angle, -np.cos(angle)], axis=1)
    ray = oracle.refract(sun[0], np.array([[0.0, 0.0, 1.0]]), IOR) if n == 1 else np.concatenate(
        [oracle.refract(s, np.array([[0.0, 0.0, 1.0]]), IOR) for s in sun]
    )  # fmt: skip
    water = np.tile([0.3, -0.2, 0.0], (n, 1))
    terrain = water + sun * (depth / np.cos(angle))[:, None]
    landing = wp.zeros(n, dtype=wp.vec3, device=device)
    inputs = [points(values, device) for values in (water, terrain, ray)]
    wp.launch(estimate, dim=n, inputs=inputs, outputs=[landing], device=device)
    way = landing.numpy() - water
    assert np.abs(np.cross(way, ray)).max() < 1e-6 * depth * 10.0  # on the refracted ray
    return np.linalg.norm(way, axis=1) / (depth / -ray[:, 2])


def test_backlund_is_exact_at_the_zenith_and_overshoots_as_published(device):
    assert backlund_share(0.0, device)[0] == pytest.approx(1.0, abs=2e-7)
    share = backlund_share([20.0, 30.0, 45.0, 60.0], device)
    assert np.abs(share - 1.0 - [0.024, 0.06, 0.17, 0.43]).max() < OVERSHOOT_TOLERANCE
