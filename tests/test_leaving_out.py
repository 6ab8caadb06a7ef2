"""A feature that is off adds nothing: no launch, no kernel, no byte, no line of code; one that is on is really there.

What is decided and said of each need is in ``test_plan.py``; here a scene that names a feature and switches it off is
held against one that never heard of it, and the code that Warp generated is read.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import warp as wp
from scenery import FREE_METHODS, GENTLE, IOR, METHODS, relative_l2, render, save_box, scene, wave

import warp_caustics as wc
from oracle.cases import sunlight
from warp_caustics.kernels.scatter_waves import make_scatter_waves

SUN = {"direction": (0.2, 0.1, -1.0)}
STEEP = [wave(0.8 / 6.0, 6.0, 0.0)]
CHANGES = 1e-3  # a feature that is on changes the map by more than any rounding
EYE = {"position": (1.0, -1.5, 2.0), "target": (1.0, 0.5, 0.0), "vertical_fov": 50.0, "resolution": (32, 18)}

OFF = {
    "colour": {"sun": {"irradiance": 1.0}},
    "Fresnel": {"medium": {"ior": IOR, "fresnel": False}},
    "absorption": {"medium": {"ior": IOR, "absorption": 0.0}},
    "dispersion": {"medium": {"ior": IOR, "dispersion": "none"}},
    "objects": {"receiver": {"plane": 0.0, "objects": []}},
    "shadows of calm water": {"self_shadow": True},
    "sun's disk": {"sun": {"angular_diameter": 0.0}},
    "other methods": {"method": {"gather": {"n": 7}, "photon": {}, "beam": {}}},
}
"""Features by name, each named in the scene and switched off."""

# Functions that only the feature calls, as Warp names them in the code that it generates.
MARKS = {
    # With what absorbs, since a CPU has other code for light that loses nothing else.
    "Fresnel": ("transmittance_at_slope", {"medium": {"ior": IOR, "fresnel": True, "absorption": 0.1}}),
    "absorption": ("wp::exp(", {"medium": {"ior": IOR, "absorption": 0.1}}),
    "terrain": ("hit_height_field", {"receiver": {"terrain": {"base": 0.0, "slope": (0.05, 0.02)}}}),
    "self-shadow": ("clearance", {"waves": STEEP, "direction": sunlight(75.0)}),
}


def with_eye(what):
    return what.model_copy(update={"camera": wc.Scene(**{**tables(what), "camera": EYE}).camera})


def tables(what):
    return what.model_dump(exclude_unset=True, exclude_none=True)


def footprint(plan):
    """All that a plan allocates, compiles and launches."""
    return plan.launches, plan.kernels, plan.bytes, plan.buffers, plan.facts.spec


def code(kernel):
    """The source that Warp generated for a kernel that was loaded on the CPU."""
    sources = list(Path(wp.config.kernel_cache_dir).glob(f"wp_{kernel.module.name}_*/*.cpp"))
    return max(sources, key=lambda path: path.stat().st_mtime).read_text()


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", OFF)
def test_a_feature_that_is_off_adds_nothing(method, name):
    if name == "other methods" and method == "gather":
        pytest.skip("its own table")
    bare, off = (wc.make_plan(scene(GENTLE, **change), method, "cpu", 1) for change in ({}, OFF[name]))
    assert footprint(off) == footprint(bare)
    for one, other in zip(off.program.passes, bare.program.passes, strict=True):
        assert one.kernel() is other.kernel()  # the very same: nothing is compiled for it


@pytest.mark.parametrize("method", METHODS)
def test_a_camera_adds_nothing_to_a_method_that_does_not_look(device, method):
    bare = scene(GENTLE)
    plans = [wc.make_plan(what, method, "cpu", 1) for what in (bare, with_eye(bare))]
    assert footprint(plans[0]) == footprint(plans[1])
    (reason,) = (reason for reason in plans[1].reasons if reason.what == "camera")
    assert not reason.kept
    assert "does not look" in reason.why
    np.testing.assert_array_equal(
        render(with_eye(bare), method, "cpu").caustic_map, render(bare, method, "cpu").caustic_map
    )


@pytest.mark.parametrize("name", MARKS)
def test_code_of_a_feature_is_generated_only_where_it_is_on(name):
    mark, change = MARKS[name]
    bare, full = (
        wc.Renderer(scene(**{"waves": GENTLE, **c}), "photon", "cpu", 1).plan.facts.spec for c in ({}, change)
    )
    assert mark not in code(make_scatter_waves(bare))
    assert mark in code(make_scatter_waves(full))
    assert len(code(make_scatter_waves(bare))) < len(code(make_scatter_waves(full)))


def test_code_of_a_bvh_is_generated_only_where_there_are_meshes(tmp_path):
    bare = wc.Renderer(scene(GENTLE), "photon", "cpu", 1).plan.facts.spec
    rock = {"plane": 0.0, "objects": [{"mesh": save_box(tmp_path), "scale": 0.2, "translate": (1.0, 0.5, 0.0)}]}
    full = wc.Renderer(scene(GENTLE, rock), "photon", "cpu", 1).plan.facts.spec
    assert "mesh_query_ray" not in code(make_scatter_waves(bare))
    assert "mesh_query_ray" in code(make_scatter_waves(full))


@pytest.mark.parametrize("name", MARKS)
def test_a_feature_that_is_on_changes_the_map(device, name):
    change = MARKS[name][1]
    off = {"waves": STEEP, "direction": sunlight(75.0), "self_shadow": False} if name == "self-shadow" else {}
    bare, full = (
        render(scene(**{"waves": GENTLE, **settings}), "photon", device).caustic_map for settings in (off, change)
    )
    assert relative_l2(full, bare) > CHANGES


@pytest.mark.parametrize("method", FREE_METHODS)
def test_features_that_are_on_add_what_they_need_and_no_more(method, tmp_path):
    """Colour of the sun is channels of the map and nothing else; objects bring a BVH, and a beam's torn cells."""
    bare = wc.make_plan(scene(GENTLE), method, "cpu", 1)
    colour = wc.make_plan(scene(GENTLE, sun={"irradiance": (1.0, 0.9, 0.8)}), method, "cpu", 1)
    pixels = 40 * 28
    assert colour.bytes - bare.bytes == 2 * 4 * pixels
    assert (colour.launches, colour.kernels, colour.facts.spec) == (bare.launches, bare.kernels, bare.facts.spec)
    rock = {"plane": 0.0, "objects": [{"mesh": save_box(tmp_path), "scale": 0.2}]}
    objects = wc.make_plan(scene(GENTLE, rock), method, "cpu", 1)
    torn = {"torn"} if method == "beam" else set()
    assert set(objects.kernels) - set(bare.kernels) == torn
    assert objects.bytes > bare.bytes
