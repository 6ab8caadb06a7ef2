"""``pattern``: a moving picture of caustics in a volume, on what a camera sees (the Unity article). Any receiver.

Not a way of the light: the waves are not looked at. What is seen is direct sunlight as under calm water, times the
pattern. The article draws the volume's back faces without a depth test (Cull Front, ZTest Always), so that each pixel
in which the volume may lie is shaded once wherever the camera is. Here each pixel of the eye's G-buffer is shaded once
and the box mask does the rest, so a camera inside the volume is no case of its own.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from ..assets.textures import load_texture
from ..errors import InputError
from ..eye import camera_of, eye_view, mesh_uploads, rasterize_steps, view_array
from ..kernels.pattern import PatternSpec, make_pattern
from ..kernels.rest_light import make_shadow
from ..pattern_texture import texture_shape, upload_texture
from ..pattern_volume import device_medium, device_pattern, scale_of, volume_of
from ..program import Buffer
from ..scene.faults import gathered
from ..screen import receiver_meshes
from ..sequence import Sequence, Step, Upload
from ..specify import HEIGHT_FIELDS, Reason
from ..sun import refract_slopes
from ..triangles import mesh_triangles

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..facts import Facts
    from ..scene import PatternSettings, Scene

SHOWN = ("speed", "strength", "split", "luminance_mask", "blend")
"""Settings that a plan prints, beside the texture and its scale."""


def pattern(facts: Facts) -> Sequence:
    """Plan the eye's G-buffer, the shadow test where one is asked for and can fail, and the projection.

    Raises
    ------
    InputError
        If the scene has no camera, the texture cannot be used, or a key is given that a pattern cannot honour.
    """
    scene = facts.scene
    settings, camera = scene.method.pattern, camera_of(scene, "pattern")
    _check(scene)
    texture = _loaded(settings)
    meshes = receiver_meshes(scene, facts.assets)
    origin = (*scene.map.origin, scene.water.level)
    columns, rows = camera.resolution
    counts = (sum(len(mesh.vertices) for mesh in meshes), sum(len(mesh.triangles) for mesh in meshes))
    eye = rasterize_steps("eye", "ground", counts, (columns, rows), does="what the eye sees first", normals="face")
    marches, shades = _shading(facts)
    shadows = shades and settings.luminance_mask != "none"
    volume = volume_of(scene, meshes)
    return Sequence(
        stages=(((*eye.steps, *_steps(facts, (rows, columns), marches, shadows)),),),
        buffers=(
            *eye.buffers,
            *((Buffer("lit", "float32", (rows, columns), 4),) if shadows else ()),
            Buffer("seen", "float32", (rows * columns * scene.channels,), 4),
        ),
        screen_map="seen",
        values={"sun": tuple(scene.sun.direction)},
        uploads={
            **eye.uploads,
            **mesh_uploads("ground", counts, lambda device: mesh_triangles(*meshes, origin=origin, device=device)),
            "texture": Upload(
                Buffer("texture", "float32", texture_shape(texture), 4), lambda device: upload_texture(texture, device)
            ),
            "pattern": lambda _: device_pattern(scene, volume),
            "medium": lambda _: device_medium(facts),
        },
        views=lambda camera: {"eye.view": view_array(eye_view(camera).projection(origin))},
        settings={
            "texture": settings.texture or "own tile",
            "scale": scale_of(scene),
            **settings.model_dump(include=set(SHOWN)),
        },
        reasons=_reasons(facts, shadows, shades),
        warnings=_warnings(scene),
        samples=rows * columns,
        meets_scene=shadows,
        follows_water=False,
    )


def _steps(facts: Facts, dim: tuple[int, int], marches: bool, shadows: bool) -> Iterator[Step]:
    """Give the launches after the G-buffer."""
    spec, settings = facts.spec, facts.scene.method.pattern
    mask = settings.luminance_mask
    chosen = PatternSpec(
        luminance_mask="none" if mask == "shadow" and not shadows else mask,
        shadows=shadows,
        split=settings.split > 0.0,
        overlay=settings.blend == "overlay",
        fresnel=spec.fresnel,
        attenuation=spec.attenuation,
        colours=facts.scene.channels,
    )
    bind: dict[str, str | None] = {"depth": "eye.depth", "normal": "eye.normal", "view": "eye.view"}
    if shadows:
        build = functools.partial(make_shadow, spec.receiver, marches, spec.objects)
        yield Step("shadow", "from what is seen up to the sun", build, dim, bind)
    else:
        bind["lit"] = None
    does = "two layers of the texture, their masks, direct sunlight"
    yield Step("pattern", does, functools.partial(make_pattern, chosen), dim, bind)


def _check(scene: Scene) -> None:
    """Refuse the keys that a pattern cannot honour."""
    faults = []
    if scene.method.pattern.split > 0.0 and scene.channels == 1:
        faults.append(
            "method.pattern.split: it makes colours, and the light of this scene has none; expected 0, or a "
            "sun.irradiance of [r, g, b]"
        )
    if scene.water.self_shadow is True:
        faults.append('water.self_shadow: method "pattern" does not look at the waves; expected "auto" or false')
    if scene.method.accumulate != "float32":
        faults.append(
            f'method.accumulate = "{scene.method.accumulate}": method "pattern" adds nothing up; leave it out'
        )
    if faults:
        raise gathered(faults, scene.name)


def _loaded(settings: PatternSettings) -> NDArray[np.float64] | None:
    """Load the texture from its file, if it has one: what is wrong with it is said before anything is made."""
    if settings.texture is None:
        return None
    try:
        return load_texture(settings.texture)
    except InputError as error:
        raise InputError(f"method.pattern.texture: {error}") from None


def _shading(facts: Facts) -> tuple[bool, bool]:
    """Whether a hill can shade, so that terrain is marched over, and whether anything can."""
    spec, sun = facts.spec, facts.scene.sun.unit_direction
    # Refracted light is steeper; the sun's own meets ground only where that rises from the water.
    light = sun if spec.shore else refract_slopes(sun, np.zeros((1, 2)), facts.ior)[0]
    marches = spec.receiver in HEIGHT_FIELDS and bool(facts.ground.slope * np.hypot(light[0], light[1]) > -light[2])
    return marches, marches or spec.objects or spec.receiver == "mesh"


def _warnings(scene: Scene) -> tuple[str, ...]:
    disk = ", nor the width of the sun's disk" if scene.sun.angular_diameter > 0.0 else ""
    return (f"method.pattern: its caustics are a moving picture; the water's waves are not looked at{disk}",)


def _reasons(facts: Facts, shadows: bool, shades: bool) -> tuple[Reason, ...]:
    settings = facts.scene.method.pattern
    mask = settings.luminance_mask
    named = f'method.pattern.luminance_mask is "{mask}"'
    tile = settings.texture or "a tile that this library renders, once"
    table = (
        ("waves", False, "", "the pattern is a picture: the water is taken as calm"),
        ("Fresnel", facts.spec.fresnel, "medium.fresnel, at the water at rest", "medium.fresnel is false"),
        ("attenuation", facts.spec.attenuation != "none", f"by {facts.spec.attenuation}", "nothing absorbs"),
        ("texture", True, tile, ""),
        ("channel split", settings.split > 0.0, "three samples of each layer", "method.pattern.split is 0"),
        ("luminance mask", mask in ("lerp", "smoothstep"), named, named),
        ("shadow test", shadows, "hills or meshes may shade", named if shades else "nothing can shade what is seen"),
        ("sun's disk", False, "", "one direction: the pattern is as sharp as its texture"),
        ("light outside the volume", settings.blend == "light", "as under calm water", "black: an overlay"),
    )  # fmt: skip
    return tuple(Reason(what, kept, why if kept else why_not) for what, kept, why, why_not in table)
