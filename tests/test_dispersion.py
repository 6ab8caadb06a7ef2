"""Traced dispersion in plan view: each channel at its own index, what it shifts, what it refuses and what it counts."""

import numpy as np
import pytest
from scenery import GENTLE, assert_adds_up, render, scene

import warp_caustics as wc
from warp_caustics.assets import load_assets
from warp_caustics.dispersion import channel_scene, own_channel
from warp_caustics.errors import InputError
from warp_caustics.facts import gather_facts, with_placed_water
from warp_caustics.reference import jittered_photons, make_reference

LOW_SUN = (1.7, 0.4, -1.0)
SEA = {"ior": "sea", "dispersion": "traced"}
SAME = 1e-6
"""The same launches, added in the same order."""

METHODS = ("beam", "photon", "gather")


@pytest.mark.parametrize("method", METHODS)
def test_each_channel_is_the_map_at_its_own_index(device, method):
    what = scene(GENTLE, direction=LOW_SUN, medium={**SEA, "fresnel": True})
    apart = render(what, method, device, time=0.7)
    assert apart.caustic_map.shape == (28, 40, 3)
    for channel, ior in enumerate(what.medium.ior_by_channel):
        alone = render(scene(GENTLE, direction=LOW_SUN, medium={"ior": ior, "fresnel": True}), method, device, time=0.7)
        assert np.allclose(apart.caustic_map[..., channel], alone.caustic_map, rtol=SAME, atol=SAME)
        assert np.isclose(apart.energy.emitted[channel], alone.energy.emitted)
    assert not np.allclose(apart.caustic_map[..., 0], apart.caustic_map[..., 2], rtol=1e-2)
    assert_adds_up(apart)


def test_colour_of_light_and_water_stay_with_their_channel(device):
    medium = {**SEA, "absorption": (0.3, 0.1, 0.01)}
    what = scene(GENTLE, medium=medium, sun={"irradiance": (1.0, 0.5, 2.0)})
    apart = render(what, "beam", device)
    blue = scene(GENTLE, medium={"ior": what.medium.ior_by_channel[2], "absorption": 0.01}, sun={"irradiance": 2.0})
    assert np.allclose(apart.caustic_map[..., 2], render(blue, "beam", device).caustic_map, rtol=SAME, atol=SAME)


def test_channels_that_keep_three_values_give_their_own(device):
    """K_d by channel has no scalar form, so that each channel's frame holds all three."""
    medium = {"ior": "sea", "jerlov": "II", "dispersion": "traced"}
    apart = render(scene(GENTLE, medium=medium), "beam", device)
    together = render(scene(GENTLE, medium={"ior": "sea", "jerlov": "II"}), "beam", device)
    assert np.allclose(apart.caustic_map[..., 1], together.caustic_map[..., 1], rtol=SAME, atol=SAME)
    assert not np.allclose(apart.caustic_map[..., 0], together.caustic_map[..., 0], rtol=1e-3)


def test_an_edge_of_light_moves_by_the_refraction_of_each_colour(device):
    """Where a basin of flat water ends, light of each colour ends where its own refraction puts it."""
    size, depth = (4.0, 0.5), 1.0
    what = scene(
        direction=(2.0, 0.0, -1.0),
        medium={"ior": (1.30, 1.33, 1.40), "dispersion": "traced", "dispersion_strength": 2.0},
        size=size, resolution=(400, 4),
        simulation={"kind": "grid", "cell": 0.25, "origin": (0.0, -2.0), "size": (2.0, 4.0), "border": "reflecting",
                    "max_slope": 0.01},
    )  # fmt: skip
    lit = render(what, "beam", device).caustic_map[1]
    for channel, ior in enumerate((1.27, 1.33, 1.47)):
        way = refracted_at(ior)
        edge = 2.0 + depth * way
        expected = round(edge / size[0] * 400)
        assert abs(int((lit[:, channel] > 0.5 * lit[:, channel].max()).nonzero()[0].max()) + 1 - expected) <= 1


def refracted_at(ior):
    direction = np.array([2.0, 0.0, -1.0]) / np.sqrt(5.0)
    across = direction[0] / ior
    return across / np.sqrt(1.0 - across**2)


def test_the_reference_disperses_too(device):
    what = scene(GENTLE, direction=LOW_SUN, medium=SEA, resolution=(20, 14))
    apart = make_reference(what, tolerance=1e-3, device=device, cache=False)
    for channel in range(3):
        alone = make_reference(channel_scene(what, channel), tolerance=1e-3, device=device, cache=False)
        assert np.array_equal(apart.caustic_map[..., channel], alone.caustic_map)
    assert 0.0 < apart.error_bar < 2e-3
    beam = render(what, "beam", device).caustic_map
    assert np.sqrt(np.mean((beam - apart.caustic_map) ** 2)) < 5e-3 * apart.caustic_map.mean()
    scattered = jittered_photons(what, per_side=8, device=device)
    assert scattered.shape == apart.caustic_map.shape
    assert np.allclose(scattered.mean(axis=(0, 1)), apart.caustic_map.mean(axis=(0, 1)), rtol=1e-2)


def test_strength_scales_the_difference_from_green():
    medium = scene(medium={**SEA, "dispersion_strength": 3.0}).medium
    red, green, blue = medium.ior_by_channel
    assert np.allclose(medium.dispersed_ior, (green + 3 * (red - green), green, green + 3 * (blue - green)))


def test_what_is_refused():
    with pytest.raises(InputError, match=r"an index of 0\.9"):
        wc.make_plan(scene(medium={"ior": (1.3, 1.4, 1.5), "dispersion": "traced", "dispersion_strength": 5.0}), "beam")
    with pytest.raises(InputError, match='"post" is not for method "beam"'):
        wc.make_plan(scene(medium={"ior": "sea", "dispersion": "post"}), "beam")
    with pytest.raises(InputError, match="expected an ior by channel"):
        scene(medium={"ior": 1.33, "dispersion": "traced"})


def test_the_plan_counts_all_channels(device):
    one = wc.make_plan(scene(GENTLE, medium={"ior": 1.34}), "beam", device, threads=1)
    three = wc.make_plan(scene(GENTLE, medium=SEA), "beam", device, threads=1)
    assert three.launches == 3 * one.launches + 1 and three.samples > 2.9 * one.samples
    assert three.bytes > 3 * one.bytes - 1000 and "stack" in three.kernels
    assert "red 1.3377" in str(three)


def test_one_value_is_anyones():
    assert own_channel(np.array([5.0]), 2) == 5.0 and own_channel(np.array([1.0, 2.0, 3.0]), 2) == 3.0


def test_a_sea_without_dispersion_is_mono_and_says_so(device):
    assert any(
        "green's" in note for note in wc.make_plan(scene(GENTLE, medium={"ior": "sea"}), "beam", device).warnings
    )
    assert not wc.make_plan(scene(GENTLE, medium=SEA), "beam", device).warnings


DROPS = {
    "kind": "grid",
    "cell": 0.04,
    "drops": [{"time": 0.0, "position": (1.0, 0.5), "radius": 0.15, "amplitude": 0.02}],
}


def test_channels_of_simulated_water_are_lit_through_one_water(device):
    """Where the rectangle follows from the light, it is that of all channels together."""
    what = scene(direction=LOW_SUN, medium=SEA, simulation=DROPS)
    plans = wc.make_plan(what, "photon", device, threads=1).plans
    assert len({(plan.facts.basin.origin, plan.facts.basin.size, plan.facts.basin.step) for plan in plans}) == 1
    apart = render(what, "photon", device, time=0.3)
    placed = {**DROPS, "origin": plans[0].facts.basin.origin, "size": plans[0].facts.basin.size}
    blue = scene(direction=LOW_SUN, medium={"ior": what.medium.ior_by_channel[2]}, simulation=placed)
    assert np.allclose(apart.caustic_map[..., 2], render(blue, "photon", device, time=0.3).caustic_map, rtol=SAME)


def test_a_rectangle_that_is_written_down_stays_when_the_map_is_finer():
    """The disk's directions, and so the rectangle, follow the pixels; two resolutions need one water."""
    what = scene(simulation=DROPS, sun={"angular_diameter": 3.0}, direction=LOW_SUN)
    assets = load_assets(what)
    placed = with_placed_water(what, assets)
    basins = [gather_facts(one, assets).basin for one in (what, placed, placed.at_resolution(160, 112))]
    assert all(basin.origin == basins[0].origin and basin.size == basins[0].size for basin in basins)
    assert gather_facts(what.at_resolution(160, 112), assets).basin.size != basins[0].size
    assert with_placed_water(placed, assets) is placed
