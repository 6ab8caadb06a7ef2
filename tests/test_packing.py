"""Stored normals: what comes back, and by how much it is off."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from kernel_helpers import points

from warp_caustics.kernels.packing import PACK, UNPACK

# A half float in [1, 2), where pitch near a right angle lies, rounds by 2^-11; yaw in [2, 4) by 2^-10.
ANGLES_ERROR = 2.0**-11 + 2.0**-10
# A step of the octahedron is 1/32767; its sides lean by up to sqrt(3), and two of them are rounded by half of one.
OCTAHEDRAL_ERROR = np.sqrt(2.0) * np.sqrt(3.0) / 32767.0
KEPT = 1e-7


def round_trip(normals, storage, device):
    pack, unpack = PACK[storage], UNPACK[storage]

    @wp.kernel(module="unique", enable_backward=False)
    def there_and_back(normals: wp.array[wp.vec3], back_out: wp.array[wp.vec3]):
        i = wp.tid()
        back_out[i] = unpack(pack(normals[i]))

    given = points(normals, device)
    back = wp.empty_like(given)
    wp.launch(there_and_back, dim=len(normals), inputs=[given], outputs=[back], device=device)
    return given.numpy().astype(np.float64), back.numpy().astype(np.float64)


def turned(given, back):
    """Angle between normals [rad]: by the chord, which a cosine near 1 could not tell."""
    return 2.0 * np.arcsin(np.clip(np.linalg.norm(given - back, axis=1) / 2.0, 0.0, 1.0))


def all_round():
    random = np.random.default_rng(5).normal(size=(20000, 3))
    special = np.array([[0, 0, 1], [0, 0, -1], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [1, 1, -1], [-1, 1, 1]])
    normals = np.concatenate([random, special])
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


@pytest.mark.parametrize(
    ("storage", "bound"), [("float3", KEPT), ("angles", ANGLES_ERROR), ("octahedral", OCTAHEDRAL_ERROR)]
)
def test_a_normal_comes_back_within_the_rounding_of_its_storage(device, storage, bound):
    given, back = round_trip(all_round(), storage, device)
    np.testing.assert_allclose(np.linalg.norm(back, axis=1), 1.0, atol=1e-6)
    assert turned(given, back).max() < bound


def test_yaw_and_pitch_are_off_most_where_calm_water_is(device):
    # The thesis gave this storage up for its rounding errors; the octahedron has no such place.
    slopes = np.random.default_rng(6).uniform(-0.1, 0.1, size=(5000, 2))
    normals = np.concatenate([-slopes, np.ones((len(slopes), 1))], axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    by_angles, by_octahedron = (turned(*round_trip(normals, s, device)) for s in ("angles", "octahedral"))
    assert by_angles.max() > 2.0**-11 * 0.9
    assert by_octahedron.max() < 0.1 * by_angles.max()
