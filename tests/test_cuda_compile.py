"""Every kernel of the pipeline compiles for CUDA, on a machine without a GPU too (NVRTC comes with Warp)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
import warp as wp

from warp_caustics.kernels.area_ratio import make_claim, make_triangles
from warp_caustics.kernels.beam import make_cells, make_corners
from warp_caustics.kernels.box_blur import make_box_blur
from warp_caustics.kernels.cascade_photon import CascadeSpec, make_cascade_photons
from warp_caustics.kernels.centres import unclaim
from warp_caustics.kernels.composite import make_composite, make_dry_picture
from warp_caustics.kernels.differential import make_differential
from warp_caustics.kernels.disperse import disperse
from warp_caustics.kernels.eye_surface import eye_surface
from warp_caustics.kernels.fft import make_fft_rows
from warp_caustics.kernels.filter import make_filter
from warp_caustics.kernels.gather import make_columns, make_intersections, make_rows
from warp_caustics.kernels.gather_terrain import make_gather_terrain
from warp_caustics.kernels.height_field import (
    begin_solve,
    make_drop,
    make_leap,
    make_pressure,
    make_solve,
    make_surface,
)
from warp_caustics.kernels.light_g_buffer import make_light_lattice, make_store_texel
from warp_caustics.kernels.nodes import make_extremes, make_nodes
from warp_caustics.kernels.pattern import PatternSpec, make_pattern
from warp_caustics.kernels.picture import make_picture
from warp_caustics.kernels.place_table import place_table
from warp_caustics.kernels.reference.cells import make_cells as make_reference_cells
from warp_caustics.kernels.reference.cells import make_rays
from warp_caustics.kernels.reference.land import make_land
from warp_caustics.kernels.reference.photons import make_photons
from warp_caustics.kernels.resolve import make_dry_land, make_resolve
from warp_caustics.kernels.rest_light import make_shadow
from warp_caustics.kernels.sample import face_normals, make_heights, make_sample, scale_to_irradiance
from warp_caustics.kernels.scatter import make_scatter
from warp_caustics.kernels.shade import PictureSpec
from warp_caustics.kernels.spec import Spec
from warp_caustics.kernels.spectral import make_evolve, make_travel, make_turn, spectral_surface
from warp_caustics.kernels.torn import make_torn
from warp_caustics.kernels.wave_table import wave_table

# The oldest architecture that Warp 1.19 and the goals of this library share: newer ones run its PTX.
ARCHITECTURE = 80

EVERYTHING = Spec(
    water="grid",
    receiver="grid",
    objects=True,
    bounded=True,
    shore=True,
    hills_shade=True,
    occluders=True,
    self_shadow=True,
    faces_away=True,
    exits=True,
    tears=True,
    fresnel=True,
    attenuation="path",
    channels=3,
    accumulate="fixed",
)
BACKLUND = Spec(
    water="periodic", receiver="mesh", tears=True, backlund=True, attenuation="depth", channels=3, accumulate="float64"
)
RINGS = Spec(water="radial", tears=True, faces_away=True, exits=True, self_shadow=True)

CASCADED = CascadeSpec(
    replace(EVERYTHING, self_shadow=False), "depth", "angles", footprint="texel", dispersed=True, booked=True
)
PERIODIC = replace(BACKLUND, backlund=False)
LATEST = replace(EVERYTHING, accumulate="float32")

LAND = PictureSpec(
    Spec(water="grid", receiver="grid", objects=True, bounded=True), fresnel=True, by_depth=True, around=True
)
ROCKS = PictureSpec(Spec(water="periodic", receiver="mesh"), screen=True)

KERNELS = {
    "wave_table": lambda: wave_table,
    "place_table": lambda: place_table,
    "corners": lambda: make_corners(EVERYTHING),
    "cells": lambda: make_cells(EVERYTHING, True),
    "torn": lambda: make_torn(EVERYTHING),
    "torn over rings": lambda: make_torn(RINGS),
    "scatter": lambda: make_scatter(BACKLUND),
    "unclaim": lambda: unclaim,
    "claim": lambda: make_claim(LATEST),
    "triangles": lambda: make_triangles(LATEST, True, True, True),
    "differential": lambda: make_differential(EVERYTHING, True),
    "differential as parallelograms": lambda: make_differential(PERIODIC, False),
    "intersections": lambda: make_intersections(Spec()),
    "gather_terrain": lambda: make_gather_terrain(EVERYTHING),
    "rows": lambda: make_rows(1),
    "columns": lambda: make_columns(3),
    "resolve": lambda: make_resolve("fixed", 3, 3),
    "heights": lambda: make_heights("periodic"),
    "face_normals": lambda: face_normals,
    "sample": lambda: make_sample(True),
    "box_blur": lambda: make_box_blur(1, 0),
    "scale_to_irradiance": lambda: scale_to_irradiance,
    "fft_rows": lambda: make_fft_rows(1024, True),
    "evolve": lambda: make_evolve(True),
    "travel": lambda: make_travel(True),
    "turn": lambda: make_turn(True),
    "spectral_surface": lambda: spectral_surface,
    "pressure": lambda: make_pressure(True, True, True),
    "leap": lambda: make_leap(True, True),
    "begin_solve": lambda: begin_solve,
    "solve": lambda: make_solve(True, True),
    "drop": lambda: make_drop(True),
    "surface": lambda: make_surface(True, True),
    "nodes": lambda: make_nodes(True),
    "extremes": lambda: make_extremes(True),
    "picture": lambda: make_picture(LAND),
    "picture of a camera's own map": lambda: make_picture(ROCKS),
    "picture as published": lambda: make_picture(PictureSpec(Spec(), published=True)),
    "eye_surface": lambda: eye_surface,
    "light_lattice": lambda: make_light_lattice("periodic", False),
    "store_texel": lambda: make_store_texel("float3", "octahedral"),
    "cascade_photons": lambda: make_cascade_photons(CASCADED),
    "composite": lambda: make_composite("fixed", 3, 3, True),
    "dry_picture": lambda: make_dry_picture(EVERYTHING, 3),
    "disperse": lambda: disperse,
    "filter_picture": lambda: make_filter(True, 3),
    "dry_land": lambda: make_dry_land(EVERYTHING),
    "project_pattern": lambda: make_pattern(
        PatternSpec("smoothstep", shadows=True, split=True, fresnel=True, attenuation="path", colours=3)
    ),
    "shadow": lambda: make_shadow("grid", True, True),
    "reference_rays": lambda: make_rays(EVERYTHING),
    "reference_rays from rings": lambda: make_rays(RINGS),
    "reference_cells": lambda: make_reference_cells(EVERYTHING),
    "reference_photons": lambda: make_photons(BACKLUND, True),
    "reference_land": lambda: make_land(EVERYTHING),
}


@pytest.mark.parametrize("name", KERNELS)
def test_compiles_for_cuda(name: str, tmp_path: Path) -> None:
    wp.compile_aot_module(KERNELS[name]().module, device=None, arch=ARCHITECTURE, module_dir=tmp_path)
    (compiled,) = (*tmp_path.glob("*.ptx"), *tmp_path.glob("*.cubin"))
    assert name.split()[0].encode() in compiled.read_bytes()
