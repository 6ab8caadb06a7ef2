"""Every kernel of the pipeline compiles for CUDA, on a machine without a GPU too (NVRTC comes with Warp)."""

from __future__ import annotations

import ast
from dataclasses import replace
from pathlib import Path

import pytest
import warp as wp
from bilinear import bilinear_splat
from splat_rungs.merged import make_splat_merged
from splat_rungs.plain import make_splat_channel, make_splat_plain
from splat_rungs.tiles import TILE, make_splat_ordered, make_splat_private, scan_counts
from splat_rungs.vector import make_splat_quads, make_sum_quads, splat_rgba

from warp_caustics import kernels
from warp_caustics.kernels.area_ratio import make_claim, make_triangles
from warp_caustics.kernels.beam import make_cells, make_corners
from warp_caustics.kernels.box_blur import make_box_blur
from warp_caustics.kernels.cascade_photon import CascadeSpec, make_cascade_photons
from warp_caustics.kernels.centres import unclaim
from warp_caustics.kernels.composite import make_composite, make_dry_picture
from warp_caustics.kernels.differential import make_differential
from warp_caustics.kernels.disperse import disperse
from warp_caustics.kernels.edge_cells import make_edge_cells
from warp_caustics.kernels.eye_surface import eye_surface
from warp_caustics.kernels.fft import make_fft_rows
from warp_caustics.kernels.filter import make_filter
from warp_caustics.kernels.g_buffer import Resolve, lift_lattice_kernel, resolve_kernel
from warp_caustics.kernels.gather import make_columns, make_intersections, make_rows
from warp_caustics.kernels.gather_fused import make_fused, make_tile
from warp_caustics.kernels.gather_rows import make_scatter_rows
from warp_caustics.kernels.gather_scatter import make_gather_scatter
from warp_caustics.kernels.gather_terrain import make_gather_terrain
from warp_caustics.kernels.height_field import (
    begin_solve,
    end_solve,
    make_drop,
    make_leap,
    make_pressure,
    make_solve,
    make_surface,
)
from warp_caustics.kernels.light_g_buffer import make_light_lattice, make_store_texel
from warp_caustics.kernels.multiply_add import multiply_add
from warp_caustics.kernels.nodes import make_extremes, make_nodes
from warp_caustics.kernels.pattern import PatternSpec, make_pattern
from warp_caustics.kernels.picture import make_picture
from warp_caustics.kernels.place_table import place_table
from warp_caustics.kernels.rasterize import fill_large_kernel, fill_small_kernel, project_vertices_kernel
from warp_caustics.kernels.reference.cells import make_cells as make_reference_cells
from warp_caustics.kernels.reference.cells import make_rays
from warp_caustics.kernels.reference.land import make_land
from warp_caustics.kernels.reference.photons import make_photons
from warp_caustics.kernels.resolve import make_add_lanes, make_dry_land, make_resolve, stack
from warp_caustics.kernels.resolve_steps import make_resolve_steps
from warp_caustics.kernels.rest_light import make_shadow
from warp_caustics.kernels.sample import face_normals, make_heights, make_sample, scale_to_irradiance
from warp_caustics.kernels.scatter import make_scatter
from warp_caustics.kernels.scatter_waves import make_scatter_waves
from warp_caustics.kernels.shade import PictureSpec
from warp_caustics.kernels.spec import Spec
from warp_caustics.kernels.spectral import make_evolve, make_travel, make_turn, spectral_surface
from warp_caustics.kernels.torn import make_torn
from warp_caustics.kernels.wave_rows import wave_planes
from warp_caustics.kernels.wave_table import wave_table

OLDEST = 80
"""The oldest architecture that Warp 1.19 and the goals of this library share: newer ones run its PTX."""

ARCHITECTURES = (OLDEST, 90, 100)
"""Compiled for; of the newer ones only some kernels, unless slow tests are asked for."""

ON_EVERY = ("scatter of waves", "splat_quads", "splat_private")
"""Kernels that are compiled for each: what most scenes need, and those with instructions of their own."""

SELDOM = (
    "cells of waves", "differential of waves", "cascade_photons of pixels", "bilinear_splat", "splat_plain",
    "splat_channel", "splat_merged", "splat_ordered", "sum_quads", "splat_private in fixed point",
    "splat_private by patches", "edge cells, refined", "edge cells of everything",
)  # fmt: skip
"""Kernels compiled with the slow tests alone: fewer branches, not the library's own, or minutes to compile."""

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
    "wave_planes": lambda: wave_planes,
    "place_table": lambda: place_table,
    "corners": lambda: make_corners(EVERYTHING),
    "cells": lambda: make_cells(EVERYTHING, True),
    "edge cells": lambda: make_edge_cells(Spec(), False),
    "edge cells, refined": lambda: make_edge_cells(Spec(), True),
    "edge cells of everything": lambda: make_edge_cells(EVERYTHING, True),
    "torn": lambda: make_torn(EVERYTHING, edges=True),
    "torn over rings": lambda: make_torn(RINGS, edges=False),
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
    "fused": lambda: make_fused(3),
    "gather_tile": lambda: make_tile(3, 7, 6),
    "gather_scatter": lambda: make_gather_scatter(LATEST),
    "scatter_rows": lambda: make_scatter_rows(True),
    "resolve": lambda: make_resolve("fixed", 3, 3),
    "add_lanes": lambda: make_add_lanes("fixed"),
    "resolve steps": lambda: make_resolve_steps(3, 3),
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
    # Nothing but waves over a plane, as most scenes are.
    "corners of waves": lambda: make_corners(Spec()),
    "cells of waves": lambda: make_cells(Spec(), True),
    "scatter_waves": lambda: make_scatter_waves(replace(LATEST, water="waves")),
    "scatter of waves": lambda: make_scatter(Spec()),
    "differential of waves": lambda: make_differential(Spec(), True),
    "cascade_photons of pixels": lambda: make_cascade_photons(CascadeSpec(Spec(), footprint="pixel")),
    "resolve of one channel": lambda: make_resolve("float32", 1, 1),
    "stack": lambda: stack,
    "end_solve": lambda: end_solve,
    # Modules of several kernels.
    "project_vertices_kernel": lambda: project_vertices_kernel,
    "fill_small_kernel": lambda: fill_small_kernel,
    "fill_large_kernel": lambda: fill_large_kernel,
    "resolve_g_buffer_kernel": lambda: resolve_kernel(Resolve()),
    "lift_lattice_kernel": lambda: lift_lattice_kernel,
    # The forms of the splat that are measured beside the library's own.
    "bilinear_splat": lambda: bilinear_splat,
    "splat_plain": lambda: make_splat_plain("float32", 3),
    "splat_channel": lambda: make_splat_channel("float32", 3),
    "splat_merged": lambda: make_splat_merged("fixed", 3),
    "splat_quads": lambda: make_splat_quads(3),
    "sum_quads": lambda: make_sum_quads(3),
    "splat_rgba": lambda: splat_rgba,
    "scan_counts": lambda: scan_counts,
    "splat_ordered": lambda: make_splat_ordered("float32", 3),
    "splat_private": lambda: make_splat_private("float32", 1, TILE + 1, True),
    "splat_private in fixed point": lambda: make_splat_private("fixed", 3, TILE + 1, True),
    "splat_private by patches": lambda: make_splat_private("float32", 3, 48, False),
    "multiply_add": lambda: multiply_add,
}


COMPILED = [
    pytest.param(
        name, arch, id=f"{name}-sm_{arch}",
        marks=[] if name in ON_EVERY or (arch == OLDEST and name not in SELDOM) else pytest.mark.slow,
    )
    for arch in ARCHITECTURES
    for name in KERNELS
]  # fmt: skip


def compiled(name: str, arch: int, folder: Path, use_ptx: bool | None = None) -> bytes:
    """Compile a kernel's module; give the code."""
    wp.compile_aot_module(KERNELS[name]().module, device=None, arch=arch, module_dir=folder, use_ptx=use_ptx)
    (file,) = (*folder.glob("*.ptx"), *folder.glob("*.cubin"))
    return file.read_bytes()


@pytest.mark.parametrize(("name", "arch"), COMPILED)
def test_compiles_for_cuda(name: str, arch: int, tmp_path: Path) -> None:
    assert name.split()[0].encode() in compiled(name, arch, tmp_path)


def test_every_kernel_is_compiled() -> None:
    """By the names of the functions in the folder of kernels; an entry here begins with its kernel's."""
    here = Path(kernels.__file__).parent
    trees = [ast.walk(ast.parse(path.read_text())) for path in here.rglob("*.py")]
    found = {
        node.name
        for tree in trees
        for node in tree
        if isinstance(node, ast.FunctionDef) and any("wp.kernel" in ast.unparse(mark) for mark in node.decorator_list)
    }
    assert len(found) > 50
    assert found - {name.split()[0] for name in KERNELS} == set()


def test_vector_and_integer_atomics_where_the_device_has_them(tmp_path: Path) -> None:
    """One instruction for four floats from sm_90 on, four before; additions to a block's memory without a loop."""
    for arch in ARCHITECTURES:
        for name in ("quads", "private"):
            (tmp_path / f"{name}{arch}").mkdir()
        four = compiled("splat_quads", arch, tmp_path / f"quads{arch}", use_ptx=True).decode()
        assert ("red.global.add.v4.f32" in four) == (arch >= 90)
        assert ("atom.global.add.f32" in four or "red.global.add.f32" in four) == (arch < 90)
        private = compiled("splat_private", arch, tmp_path / f"private{arch}", use_ptx=True).decode()
        assert "shared.add.u32" in private and "shared.cas" not in private
