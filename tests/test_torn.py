"""Cells at an edge of the receiver: no streak across it, and no light lost on it."""

import numpy as np
import pytest
import warp as wp

import oracle
import warp_caustics as wc
from warp_caustics.assets import load_assets
from warp_caustics.facts import gather_facts
from warp_caustics.kernels.deposit import ACCUMULATOR
from warp_caustics.kernels.ledger import BINS, ENTRIES
from warp_caustics.kernels.torn import make_torn
from warp_caustics.methods import METHODS
from warp_caustics.state import SceneState

# Landings under flat water are rounded to 1e-6 of a pixel, and each cell's flux to 1e-7.
FLAT_TOLERANCE = 2e-5
# The promise for the ledger on planes; float32 shares keep it here too.
ENERGY_TOLERANCE = 1e-5
# An edge is found to a part of a cell, 1/4 pixel, and a wall's light to that over the way that lights it.
EDGE_TOLERANCE = 0.05
# Parts of a quarter of a cell, each a parallelogram, against triangles on a cubic; 0.02 without the water's curvature.
PARTS_TOLERANCE = 0.01

# From a wall to its top the landing has a kink: the cubic through it swings for this many pixels.
KINK = 2.0

PIXELS, TOP, LEFT, RIGHT, FRONT, BACK = 64, 0.3, 0.4, 0.7, 0.3, 0.6
PIXEL = 1.0 / PIXELS
SUN = np.array([0.6, 0.0, -0.8])


@pytest.fixture(scope="module")
def box_file(tmp_path_factory):
    """A box without a bottom, as an OBJ file: top at 0.3 m, walls down to the floor."""
    corners = [(x, y, z) for z in (0.0, TOP) for x, y in ((LEFT, FRONT), (RIGHT, FRONT), (RIGHT, BACK), (LEFT, BACK))]
    faces = [(5, 6, 7, 8), (1, 2, 6, 5), (2, 3, 7, 6), (3, 4, 8, 7), (4, 1, 5, 8)]
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + ["f " + " ".join(map(str, face)) for face in faces]
    path = tmp_path_factory.mktemp("torn") / "box.obj"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def over_box(box_file, waves=(), direction=SUN):
    """A box on a flat floor, under a metre of water."""
    return wc.Scene(
        water={"level": 1.0, "waves": list(waves)},
        receiver={"plane": 0.0, "objects": [{"mesh": str(box_file)}]},
        sun={"direction": tuple(direction)},
        medium={"ior": 1.333},
        map={"origin": (0.0, 0.0), "size": (1.0, 1.0), "resolution": (PIXELS, PIXELS)},
    )


def tangent(direction):
    """Horizontal way by depth of the light refracted at flat water, along x."""
    ray = oracle.refract(np.asarray(direction), np.array([[0.0, 0.0, 1.0]]), 1.333)[0]
    return -ray[0] / ray[2]


def pixels(low, high, margin=1.0):
    """Pixels wholly between two places, but for a margin at each."""
    return slice(int(np.ceil(low / PIXEL + margin)), int(np.floor(high / PIXEL - margin)))


def check_box(image):
    """Compare with what paper says: light on floor, top and the wall that faces the sun, and none in the shadow."""
    light = -SUN[2]
    behind = RIGHT + TOP * tangent(SUN)
    rows = pixels(FRONT, BACK)
    shadow = image[rows, pixels(RIGHT, behind)]
    assert shadow.size > 100
    assert (shadow == 0.0).all()
    assert image[rows, pixels(LEFT, RIGHT, KINK)] == pytest.approx(light, rel=FLAT_TOLERANCE)
    for beside in (image[rows, pixels(0.0, LEFT, KINK)], image[rows, pixels(behind, 1.0)], image[pixels(0.0, FRONT)],
                   image[pixels(BACK, 1.0)]):  # fmt: skip
        assert beside == pytest.approx(light, rel=FLAT_TOLERANCE)
    # Over the edge of the wall a pixel's column takes in all that falls on the wall.
    wall = int(LEFT / PIXEL)
    on_wall = (image[rows, wall - 2 : wall + 3] - light).sum(axis=1)
    assert on_wall == pytest.approx(light * TOP * tangent(SUN) / PIXEL, rel=EDGE_TOLERANCE)
    # And the edge of the shadow is where it should be.
    lit = image[rows, pixels(RIGHT, 1.0, 0.0)].sum(axis=1) / light
    assert lit == pytest.approx((1.0 - behind) / PIXEL, abs=0.6)


def test_the_edges_of_a_box_leave_no_streak_and_lose_no_light(device, box_file):
    result = wc.render(over_box(box_file), method="beam", device=device)
    check_box(result.caustic_map)
    # All that would light the floor at rest lands on floor, top or wall within the map.
    assert result.caustic_map.mean(dtype=np.float64) == pytest.approx(-SUN[2], rel=ENERGY_TOLERANCE)
    assert result.energy.unaccounted < ENERGY_TOLERANCE
    assert result.energy.left_water == result.energy.dropped == result.energy.blocked == 0.0


def follow_all(scene, device):
    """Follow every cell as if it were torn: map and ledger by entry, at unit irradiance, per pixel."""
    facts = gather_facts(scene, load_assets(scene))
    program, state = METHODS["beam"](facts), SceneState(facts, device)
    state.write(0.0)
    (columns, rows), lattice = scene.map.resolution, program.lattice
    image = wp.zeros(columns * rows, dtype=ACCUMULATOR["float32"], device=device)
    ledger = wp.zeros((len(ENTRIES), BINS), dtype=wp.float64, device=device)
    flags = wp.full((lattice.count[1], lattice.count[0]), value=1, dtype=wp.uint8, device=device)
    inputs = [state.scene, state.suns, 0, state.lattice(lattice), lattice.first[1], flags]
    kernel = make_torn(facts.spec, edges=False)
    wp.launch(kernel, dim=flags.shape, inputs=inputs, outputs=[image, ledger], device=device)
    entries = dict(zip(ENTRIES, ledger.numpy().sum(axis=1), strict=True))
    return image.numpy().reshape(rows, columns) * lattice.step**2, entries, lattice


def test_every_cell_followed_ray_by_ray_is_as_good_on_flat_water(device, box_file):
    """The torn cells' kernel alone: uniform light, the same shadow, all light accounted for."""
    image, entries, lattice = follow_all(over_box(box_file), device)
    check_box(image)
    assert entries["emitted"] == pytest.approx(-SUN[2] * lattice.cells, rel=ENERGY_TOLERANCE)
    landed = image.sum(dtype=np.float64) / lattice.step**2
    assert landed + entries["outside_map"] == pytest.approx(entries["emitted"], rel=ENERGY_TOLERANCE)


def test_torn_cells_follow_the_curvature_of_waves(device, box_file):
    """On a caustic, every cell ray by ray is near the beam's own map, and adds up as exactly."""
    waves = [{"amplitude": 0.004, "wavevector": (12.0, 5.0)}, {"amplitude": 0.004, "wavevector": (-4.0, 14.0)}]
    scene = over_box(box_file, waves)
    image, entries, lattice = follow_all(scene, device)
    beam = wc.render(scene, method="beam", device=device)
    assert beam.caustic_map.std() > 0.2 * beam.caustic_map.mean()
    assert oracle.relative_l2(image, beam.caustic_map) < PARTS_TOLERANCE
    landed = image.sum(dtype=np.float64) / lattice.step**2
    assert landed + entries["outside_map"] == pytest.approx(entries["emitted"], rel=ENERGY_TOLERANCE)
    # The same light enters, whichever way it is followed: the flux through the window in closed form.
    assert entries["emitted"] * PIXEL**2 == pytest.approx(beam.energy.emitted, rel=1e-4)


@pytest.mark.parametrize("turn", [0.0, 90.0])
def test_a_cliff_of_a_mesh_leaves_no_streak(device, tmp_path, turn):
    """A terrace that drops from 0.3 m to the floor, away from the sun, along either axis: all one mesh."""
    rim, far = 0.3, 6.0
    line = [(-far, TOP), (rim, TOP), (rim, 0.0), (far, 0.0)]
    corners = np.array([(x, y, z) for x, z in line for y in (-far, far)])
    turned = corners if turn == 0.0 else corners[:, [1, 0, 2]]
    faces = [(1, 3, 4, 2), (3, 5, 6, 4), (5, 7, 8, 6)]
    path = tmp_path / "cliff.obj"
    path.write_text(
        "".join(f"v {x} {y} {z}\n" for x, y, z in turned) + "".join(f"f {a} {b} {c} {d}\n" for a, b, c, d in faces),
        encoding="utf-8",
    )
    sun = SUN if turn == 0.0 else SUN[[1, 0, 2]]
    scene = wc.Scene(
        water={"level": 1.0, "waves": []},
        receiver={"mesh": str(path)},
        sun={"direction": tuple(sun)},
        medium={"ior": 1.333},
        map={"origin": (0.0, 0.0), "size": (1.0, 1.0), "resolution": (PIXELS, PIXELS)},
    )
    result = wc.render(scene, method="beam", device=device)
    image = result.caustic_map if turn == 0.0 else result.caustic_map.T
    behind = rim + TOP * tangent(SUN)
    assert image[:, pixels(0.0, rim)] == pytest.approx(-SUN[2], rel=FLAT_TOLERANCE)
    assert image[:, pixels(behind, 1.0)] == pytest.approx(-SUN[2], rel=FLAT_TOLERANCE)
    assert result.energy.unaccounted < ENERGY_TOLERANCE
    lit = (1.0 - behind + rim) / PIXEL
    assert image.sum(axis=1) / -SUN[2] == pytest.approx(lit, abs=0.6)
    assert (image[:, pixels(rim, behind)] == 0.0).all()


def test_light_lands_only_where_rays_land_behind_a_hill(device):
    """A sharp ridge in closed form: the shadow behind it, found by rays in float64, stays dark to the last pixel."""
    ridge = {"amplitude": 0.25, "wavevector": (2.0 * np.pi, 0.0), "phase": np.pi / 2.0}
    sun = np.array([0.98, 0.0, -0.199])
    sun /= np.linalg.norm(sun)
    scene = wc.Scene(
        water={"level": 0.6, "waves": []},
        receiver={"terrain": {"base": 0.0, "waves": [ridge]}},
        sun={"direction": tuple(sun)},
        medium={"ior": 1.333},
        map={"origin": (-0.5, 0.0), "size": (2.0, 0.25), "resolution": (128, 16)},
    )
    result = wc.render(scene, method="beam", device=device)
    # The first depth at which a ray is under the ridge, by a fine march.
    x = np.linspace(-3.0, 2.5, 8000)
    depth = np.full(x.shape, np.inf)
    for d in np.linspace(0.0, 0.85, 1500):
        depth[(0.6 - d < 0.25 * np.cos(2.0 * np.pi * (x + d * tangent(sun)))) & np.isinf(depth)] = d
    lit = np.isin(np.arange(128), np.floor((x + depth * tangent(sun) + 0.5) / 2.0 * 128.0))
    beside = np.roll(lit, 1) | np.roll(lit, -1)
    dark = ~lit & ~beside
    assert dark.sum() > 30 and lit.sum() > 60
    assert result.caustic_map[:, lit].min() > 0.0
    assert result.energy.unaccounted < ENERGY_TOLERANCE
    assert result.caustic_map[:, dark].max() == 0.0
