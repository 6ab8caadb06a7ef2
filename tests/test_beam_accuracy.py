"""The beam against converged references that share no code with it (tests/oracle)."""

from __future__ import annotations

import numpy as np
import pytest

import warp_caustics as wc
from oracle import CASES, load_reference, relative_l2

# What the library promises of `beam` at its default settings, as RMSE over mean.
ORDINARY = 5e-3
DEEP = 2e-2

# Edges of shadow, shores and silhouettes carry no promise; these hold what was measured, with a margin of a third.
HARD = {"shaded": 5e-3, "leaving": 1e-1, "shore": 2e-3, "hills": 2e-2}

# Unrefined, the beam is the ideal triangle deposit; half as much again is allowed for float32 and corner conventions.
IDEAL_FACTOR = 1.5

# Light in the map against the reference's, which is itself right to a tenth of its own error.
ENERGY = 1e-4


NAMES = {kind: [case.name for case in CASES.values() if case.kind == kind] for kind in ("ordinary", "deep", "hard")}


def beam(name: str, device: str, **settings: object) -> wc.Result:
    case = CASES[name]
    scene = wc.Scene(**case.scene_dict(), method={"beam": settings})
    return wc.render(scene, method="beam", device=device, time=case.time)


def light(result: wc.Result) -> float:
    return float(np.sum(result.energy.received) + np.sum(result.energy.dry))


def reference_light(name: str) -> float:
    energy = load_reference(name).energy
    return float(np.sum(energy["received"]) + np.sum(energy["dry"]))


@pytest.mark.parametrize("name", NAMES["ordinary"])
def test_ordinary_scenes_at_default_settings(name: str, device: str) -> None:
    result = beam(name, device)
    assert relative_l2(result.caustic_map, load_reference(name).caustic_map) <= ORDINARY
    assert light(result) == pytest.approx(reference_light(name), rel=ENERGY)


@pytest.mark.parametrize("name", NAMES["deep"])
def test_deep_water_at_default_settings(name: str, device: str) -> None:
    result = beam(name, device)
    assert relative_l2(result.caustic_map, load_reference(name).caustic_map) <= DEEP
    assert light(result) == pytest.approx(reference_light(name), rel=ENERGY)


@pytest.mark.parametrize("name", NAMES["hard"])
def test_edges_of_shadow_shore_and_silhouette(name: str, device: str) -> None:
    assert relative_l2(beam(name, device).caustic_map, load_reference(name).caustic_map) <= HARD[name]


@pytest.mark.parametrize("name", NAMES["ordinary"] + NAMES["deep"])
def test_without_refinement_it_is_the_ideal_triangle_deposit(name: str, device: str) -> None:
    stored = load_reference(name)
    error = relative_l2(beam(name, device, refine=False).caustic_map, stored.caustic_map)
    assert error <= IDEAL_FACTOR * min(stored.ideal_error)


def test_error_falls_as_the_square_of_the_step(device: str) -> None:
    """Four times the samples, a quarter of the error: on a calm scene, without refinement."""
    reference = load_reference("calm_pool").caustic_map
    coarse, fine = (
        relative_l2(beam("calm_pool", device, refine=False, samples_per_pixel=n).caustic_map, reference)
        for n in (1.0, 4.0)
    )
    assert 3.0 < coarse / fine < 6.0
