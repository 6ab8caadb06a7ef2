"""The passes of the method ``cascaded``: the camera's G-buffer, a lane for each cascade, and the composite."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from .cascades import Cascade, Cascades
from .eye import Rasterized, mesh_uploads, rasterize_steps
from .kernels.cascade_photon import CascadeSpec, make_cascade_photons
from .kernels.composite import make_composite, make_dry_picture
from .kernels.disperse import disperse
from .kernels.eye_surface import eye_surface
from .kernels.filter import make_filter
from .kernels.light_g_buffer import make_light_lattice, make_store_texel
from .program import ACCUMULATOR_BYTES, Buffer
from .screen import receiver_meshes
from .sequence import Fill, Lane, Step, Upload

if TYPE_CHECKING:
    from .facts import Facts
    from .scene import Camera
    from .scene.cascaded import CascadedSettings

Passes = tuple[Lane, tuple[Buffer, ...], dict[str, Callable[[str], Any]]]
"""Launches, what they need, and what is uploaded once."""

POSITION_BUFFER = {"depth": ("float32", 4), "float3": ("vec3", 12)}
NORMAL_BUFFER = {"float3": ("vec3", 12), "angles": ("vec2h", 4), "octahedral": ("vec2s", 4)}
"""Element and bytes of a G-buffer, by how it is stored."""

ACCUMULATOR_DTYPE = {"float32": "float32", "float64": "float64", "fixed": "int64"}
"""Element of a cascade's picture, by `method.accumulate`."""

EYE = {f"eye_{name}": f"eye.{name}" for name in ("view", "depth", "normal", "plane", "area")}
"""Names of the eye's buffers, by the parameters of the kernels."""


@dataclass(frozen=True)
class Layout:
    """What the parts of the plan share."""

    facts: Facts
    settings: CascadedSettings
    cascades: Cascades
    camera: Camera
    spec: CascadeSpec

    @property
    def picture(self) -> tuple[int, int]:
        """Rows and columns of the camera's picture."""
        columns, rows = self.camera.resolution
        return rows, columns

    @property
    def texels(self) -> tuple[int, int]:
        """Rows and columns of a light view."""
        return self.settings.resolution, self.settings.resolution

    @property
    def colours(self) -> int:
        """Colours of the picture."""
        return len(self.facts.irradiance)

    @property
    def channels(self) -> int:
        """Channels of a cascade's picture."""
        return self.spec.scene.channels

    @property
    def post(self) -> bool:
        """Whether colours are moved in the picture."""
        return self.facts.scene.medium.dispersion == "post"

    def picture_buffer(self, name: str) -> Buffer:
        """Give a picture of the camera in float32."""
        return Buffer(name, "float32", (self.picture[0] * self.picture[1] * self.colours,), 4)


def eye_passes(layout: Layout) -> Passes:
    """Plan what the eye sees of the receiver, and how photons are held against it."""
    meshes = receiver_meshes(layout.facts.scene, layout.facts.assets)
    counts = (sum(len(mesh.vertices) for mesh in meshes), sum(len(mesh.triangles) for mesh in meshes))
    rows, columns = layout.picture
    raster = rasterize_steps(
        "eye", "receiver", counts, (columns, rows), does="the receiver, as the camera sees it", normals="face"
    )
    surface = Step("eye_surface", "plane and area that each pixel sees", lambda: eye_surface, (rows, columns), EYE)
    buffers = (Buffer("eye.plane", "vec4", (rows, columns), 16), Buffer("eye.area", "float32", (rows, columns), 4))

    def upload(device: str) -> Any:
        from .triangles import mesh_triangles

        return mesh_triangles(*meshes, origin=layout.cascades.origin, device=device)

    return (
        (*raster.steps, surface),
        (*raster.buffers, *buffers),
        {**raster.uploads, **mesh_uploads("receiver", counts, upload)},
    )


def cascade_passes(layout: Layout, number: int, cascade: Cascade) -> Passes:
    """Plan one cascade: its G-buffers, and its photons."""
    prefix, settings = f"cascade{number}", layout.settings
    water = _lattice(layout, prefix, "water", layout.facts.spec.water, cascade, cascade.margin)
    parts = [water]
    if layout.spec.ground:
        kind = layout.facts.spec.receiver
        margin = cascade.ground_margin
        parts.append(
            _mesh_ground(layout, prefix)
            if kind == "mesh"
            else _lattice(layout, prefix, "ground", kind, cascade, margin)
        )
    rows, columns = layout.picture
    light = Buffer(
        f"{prefix}.light", ACCUMULATOR_DTYPE[layout.spec.scene.accumulate], (rows * columns * layout.channels,),
        ACCUMULATOR_BYTES[layout.spec.scene.accumulate], per_lane=True,
    )  # fmt: skip
    uploads: dict[str, Callable[[str], Any]] = {}
    for part in parts:
        uploads |= part.uploads
    photons = _photons(layout, prefix, booked=number == settings.count - 1)
    steps = (*(step for part in parts for step in part.steps), *photons)
    return steps, (*(buffer for part in parts for buffer in part.buffers), light), uploads


def _lattice(layout: Layout, prefix: str, of: str, kind: str, cascade: Cascade, margin: tuple[int, int]) -> Rasterized:
    """Plan the G-buffers of the water or of a terrain: a lattice, lifted, rasterized, stored."""
    rows, columns = cascade.corners(layout.settings.resolution, margin)
    vertices, triangles = rows * columns, 2 * (rows - 1) * (columns - 1)
    mesh, ground = f"{prefix}.{of}", of == "ground"
    bind: dict[str, str | None] = {
        "light_view": f"{prefix}.view", "cell": "cell", "level": f"{of}_level", "columns": f"{mesh}.columns",
        "margin": f"{mesh}.margin", "vertices": f"{mesh}.vertices",
        "normals": None if ground else f"{mesh}.normals",
    }  # fmt: skip
    lift = Step(
        f"{of} lattice", f"corners of the {of}'s triangles, lifted to their heights",
        lambda: make_light_lattice(kind, ground), (rows, columns), bind,
    )  # fmt: skip
    buffers = [Buffer(f"{mesh}.vertices", "vec3", (vertices,), 12)]
    if not ground:
        buffers.append(Buffer(f"{mesh}.normals", "vec3", (vertices,), 12))
    shared = f"lattice{columns}x{rows}.triangles"  # cascades whose lattices are alike share them
    drawn = _draw(layout, prefix, of, (vertices, triangles), shared=shared)
    upload = Upload(Buffer(shared, "vec3i", (triangles,), 12), functools.partial(_lattice_triangles, rows, columns))
    return Rasterized((lift, *drawn.steps), (*buffers, *drawn.buffers), {**drawn.uploads, shared: upload})


def _mesh_ground(layout: Layout, prefix: str) -> Rasterized:
    """Plan the G-buffer of a ground of meshes, which the eye's pass has uploaded."""
    meshes = receiver_meshes(layout.facts.scene, layout.facts.assets)
    counts = (sum(len(mesh.vertices) for mesh in meshes), sum(len(mesh.triangles) for mesh in meshes))
    return _draw(layout, prefix, "ground", counts, mesh="receiver")


def _draw(
    layout: Layout, prefix: str, of: str, counts: tuple[int, int], mesh: str | None = None, shared: str | None = None
) -> Rasterized:
    """Plan the rasterization of a mesh into a light view, and what its texels store."""
    texels, settings = layout.texels, layout.settings
    own = f"{prefix}.{of}"
    mesh = mesh or own
    raster = rasterize_steps(
        prefix, mesh, counts, texels, does=f"the {of}, as the sun sees it", depth=False, into=own, shared=shared
    )
    storage = "none" if of == "ground" else settings.normals
    store = Step(
        f"store {of}", f"position{'' if of == 'ground' else ' and normal'} of each texel",
        lambda: make_store_texel(settings.positions, storage), texels,
        {
            "light_view": f"{prefix}.view", "visibility": f"{own}.visibility", "screen": f"{own}.screen",
            "triangles": shared or f"{mesh}.triangles", "normals": None if of == "ground" else f"{mesh}.normals",
            "position": f"{own}_position", "normal": None if of == "ground" else f"{own}_normal",
        },
    )  # fmt: skip
    kind, size = POSITION_BUFFER[settings.positions]
    buffers = [Buffer(f"{own}_position", kind, texels, size)]
    if of != "ground":
        kind, size = NORMAL_BUFFER[settings.normals]
        buffers.append(Buffer(f"{own}_normal", kind, texels, size))
    return Rasterized((*raster.steps, store), (*raster.buffers, *buffers), raster.uploads)


def _photons(layout: Layout, prefix: str, booked: bool) -> Lane:
    """Plan the photons of a cascade: one launch, or one for each channel."""
    spec = replace(layout.spec, booked=booked and layout.settings.brightness == "flux")
    ground = spec.ground
    bind: dict[str, str | None] = {
        **EYE, "light_view": f"{prefix}.view", "water_position": f"{prefix}.water_position",
        "water_normal": f"{prefix}.water_normal", "ground_position": f"{prefix}.ground_position" if ground else None,
        "light": f"{prefix}.light", "ledger": "ledger" if spec.booked else None,
    }  # fmt: skip
    ranges: list[tuple[str, str]] = [("channel0", "channel1")]
    if spec.dispersed:
        each = layout.settings.dispersion_photons == "each"
        ranges = [(f"channel{c}", f"channel{c + 1}") for c in range(3)] if each else [("channel0", "channel3")]
    fills = [Fill("clear", "pictures and ledger without light", f"{prefix}.light")]
    if spec.booked:
        fills.append(Fill("clear", "pictures and ledger without light", "ledger"))
    return (
        *fills,
        *(
            Step("photons", "refraction, landing, splat of each texel's photon", lambda: make_cascade_photons(spec),
                 layout.texels, {**bind, "first_channel": first, "last_channel": last}, ("light", "ledger"))
            for first, last in ranges
        ),
    )  # fmt: skip


def composite_passes(layout: Layout) -> tuple[Lane, tuple[Buffer, ...]]:
    """Plan the passes from the cascades' pictures to the screen map."""
    facts, settings = layout.facts, layout.settings
    accumulate, channels, colours = layout.spec.scene.accumulate, layout.channels, layout.colours
    flux, guided, post = settings.brightness == "flux", settings.filter == "bilateral", layout.post
    chain = ["picture"] * (post or settings.filter != "none") + ["dispersed"] * (post and settings.filter != "none")
    names = [*chain, "screen_map"]
    does = "the finest cascade that holds each pixel, as irradiance"
    steps: list[Step | Fill] = [Fill("composite", does, names[0]), Fill("composite", does, "left", 1.0)]
    for number in range(settings.count):
        prefix = f"cascade{number}"
        own = {name: f"{prefix}.{name}" for name in ("light", "reach", "need", "side", "zone", "scale")}
        bind = {**EYE, **own, "light_view": f"{prefix}.view", "picture": names[0]}
        steps.append(
            Step("composite", does,
                 lambda: make_composite(accumulate, channels, colours, flux), layout.picture, bind)
        )  # fmt: skip
    if facts.spec.shore:
        steps.append(
            Step("dry_picture", "direct sunlight on dry land", lambda: make_dry_picture(facts.spec, colours),
                 layout.picture, {**EYE, "picture": names[0]})
        )  # fmt: skip
    if post:
        bind = {**EYE, "picture": names[0], "screen_map": names[1]}
        steps.append(Step("disperse", "each channel moved to where its index sends it", lambda: disperse,
                          layout.picture, bind))  # fmt: skip
    if settings.filter != "none":
        bind = {**EYE, "picture": names[-2], "screen_map": "screen_map", "radius": "filter_radius"}
        steps.append(Step("filter", f"{settings.filter} of the picture", lambda: make_filter(guided, colours),
                          layout.picture, bind))  # fmt: skip
    left = Buffer("left", "float32", layout.picture, 4)
    return tuple(steps), (left, *(layout.picture_buffer(name) for name in names))


def _lattice_triangles(rows: int, columns: int, device: str) -> Any:
    """Triangles of a lattice of so many corners."""
    import warp as wp

    from .triangles import lattice_indices

    return wp.array(lattice_indices(rows, columns), dtype=wp.vec3i, device=device)
