"""``cascaded``: Bäcklund's cascaded caustic maps. Screen space: light views of the eye's frustum, photons by texel."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..cascade_passes import Layout, cascade_passes, composite_passes, eye_passes
from ..cascades import CELL_TEXELS, Cascade, Cascades, backlund_miss, iors
from ..energy import Energy
from ..errors import InputError
from ..eye import camera_of, view_array
from ..kernels.cascade_photon import CascadeSpec, Ramps
from ..kernels.deposit import unit
from ..kernels.ledger import BINS, ENTRIES
from ..program import Buffer
from ..sequence import Sequence, Upload
from ..specify import HEIGHT_FIELDS, Reason
from ..state import ENDLESS
from ..sun import refract_slopes

if TYPE_CHECKING:
    from ..facts import Facts

TOLERANCE_PIXELS = 1.0
"""Footprints of its pixel that a photon may lie off the surface that is seen: the bend of the surface over a photon's
pixels, and the chords of the eye's triangles. With twice as many, rough ground takes light of what it hides."""

SIDE_ZONE = 0.04
"""Share of a view's side over which the next cascade takes its place where the eye has turned away from it: less than
:data:`~warp_caustics.cascades.ROOM` on each side, so that nothing of it is seen from where views were fitted."""

GREEN = 1


def cascaded(facts: Facts) -> Sequence:
    """Plan the eye's G-buffer, a lane of passes for each cascade, and the composite.

    Raises
    ------
    InputError
        If the scene has no camera, or asks for what a light view cannot do.
    """
    layout = _layout(facts)
    settings = layout.settings
    eye, eye_buffers, eye_uploads = eye_passes(layout)
    lanes, buffers, uploads, values = [], list(eye_buffers), dict(eye_uploads), _values(layout)
    for number, cascade in enumerate(layout.cascades.cascades):
        lane, own, more = cascade_passes(layout, number, cascade)
        lanes.append(lane)
        buffers += own
        uploads |= more
        values |= _cascade_values(layout, number, cascade)
    closing, pictures = composite_passes(layout)
    flux = settings.brightness == "flux"
    return Sequence(
        stages=((eye,), tuple(lanes), (closing,)),
        buffers=(*buffers, *pictures, *(_ledger(layout) if flux else ())),
        screen_map="screen_map",
        values=values,
        uploads={**uploads, **_uploads(layout)},
        views=lambda camera: {
            "eye.view": view_array(layout.cascades.eye(camera)),
            **{
                f"cascade{number}.view": view_array(projection)
                for number, projection in enumerate(layout.cascades.projections(camera))
            },
        },
        settings=_chosen(layout),
        reasons=tuple(_reasons(layout)),
        samples=settings.count * settings.resolution**2 * len(facts.suns),
        energy=(lambda arrays: _energy(layout, arrays)) if flux else None,
    )


def _layout(facts: Facts) -> Layout:
    """Resolve the settings, and refuse what cannot be."""
    scene, settings = facts.scene, facts.scene.method.cascaded
    camera = camera_of(scene, "cascaded")
    if facts.spec.faces_away and not facts.spec.self_shadow:
        raise InputError(
            'water.self_shadow: expected "auto" or true with method cascaded, since a light view sees no water that '
            "a crest hides"
        )
    traced = scene.medium.dispersion == "traced"
    if "dispersion_photons" in settings.model_fields_set and not traced:
        raise InputError(
            f'method.cascaded.dispersion_photons: expected medium.dispersion "traced" with it, got '
            f'"{scene.medium.dispersion}"'
        )
    backlund, published = settings.projection == "backlund", settings.brightness == "published"
    height_field = facts.spec.receiver in HEIGHT_FIELDS
    # A light view sees the same ground that a ray along the light meets; one of a plane is in closed form.
    ground = backlund and (facts.spec.receiver == "mesh" or (height_field and not facts.spec.objects))
    spec = CascadeSpec(
        scene=replace(
            facts.spec, self_shadow=False, backlund=backlund and not ground,
            channels=3 if traced else 1 if published else facts.spec.channels, accumulate=scene.method.accumulate,
            fresnel=facts.spec.fresnel and not published, attenuation="none" if published else facts.spec.attenuation,
        ),
        positions=settings.positions,
        normals=settings.normals,
        ground=ground,
        footprint=settings.footprint,
        dispersed=traced,
        brightness="flux" if settings.brightness == "flux" else settings.ramp,
    )  # fmt: skip
    cascades = Cascades(
        facts, settings.count, settings.resolution, settings.near, settings.far, settings.blend, backlund
    )
    return Layout(facts, settings, cascades, camera, spec)


def _values(layout: Layout) -> dict[str, Any]:
    """Give the kernels' plain parameters that all cascades share."""
    facts, settings = layout.facts, layout.settings
    border = facts.water_border or (np.full(2, -ENDLESS), np.full(2, ENDLESS))
    light = tuple(facts.sun_share * facts.irradiance[c % layout.colours] for c in range(3))
    return {
        "light_direction": tuple(facts.scene.sun.unit_direction),
        "cell": CELL_TEXELS, "water_level": 0.0, "ground_level": layout.cascades.ground_level,
        "tolerance": _tolerance(layout), "border_low": tuple(border[0]),
        "border_high": tuple(border[1]), "ior": iors(facts) if layout.spec.dispersed else (facts.ior,) * 3,
        "irradiance": light, "filter_radius": settings.filter_radius,
        **{f"channel{c}": c for c in range(4)},
    }  # fmt: skip


def _tolerance(layout: Layout) -> tuple[float, float]:
    """How far off the surface that it sees a pixel takes photons: metres, and footprints of the pixel."""
    settings = layout.settings
    if settings.depth_tolerance is not None:
        return settings.depth_tolerance, 0.0
    return (backlund_miss(layout.facts) if settings.projection == "backlund" else 0.0), TOLERANCE_PIXELS


def _cascade_values(layout: Layout, number: int, cascade: Cascade) -> dict[str, Any]:
    """Give the plain parameters of one cascade."""
    facts, prefix = layout.facts, f"cascade{number}"
    # A constant is a brightness already; a flux is that of a texel across the light.
    flux = layout.settings.brightness == "flux"
    size = cascade.texel_area * facts.sun_share if flux else layout.settings.constant
    side = float(layout.settings.resolution)
    scale = size * unit(layout.spec.scene.accumulate)
    values: dict[str, Any] = {
        f"{prefix}.reach": (cascade.far, cascade.zone),
        f"{prefix}.need": tuple(layout.cascades.need(cascade)),
        f"{prefix}.side": 0.0 if number == layout.settings.count - 1 else side,
        f"{prefix}.zone": SIDE_ZONE * side if layout.settings.blend > 0.0 else 0.0,
        f"{prefix}.scale": tuple(scale * facts.irradiance[c % layout.colours] for c in range(3)),
    }
    for of, margin in (("water", cascade.margin), ("ground", cascade.ground_margin)):
        values[f"{prefix}.{of}.margin"] = margin
        values[f"{prefix}.{of}.columns"] = cascade.corners(layout.settings.resolution, margin)[1]
    return values


def _uploads(layout: Layout) -> dict[str, Callable[[str], Any]]:
    """Give what is made on a device once."""
    facts, settings = layout.facts, layout.settings

    def ramps(device: str) -> Ramps:
        made = Ramps()
        made.least, made.most = settings.min_depth, settings.max_depth
        return made

    def ways(device: str) -> Any:
        import warp as wp

        rays = [refract_slopes(facts.scene.sun.unit_direction, np.zeros((1, 2)), ior)[0] for ior in iors(facts)]
        way = np.array([ray[:2] / -ray[2] for ray in rays])
        return wp.array((way - way[GREEN]).astype(np.float32), dtype=wp.vec2, device=device)

    post = {"ways": Upload(Buffer("ways", "vec2", (3,), 8), ways)} if layout.post else {}
    return {"ramps": ramps, **post}


def _ledger(layout: Layout) -> tuple[Buffer, ...]:
    return (Buffer("ledger", "float64", (len(ENTRIES) * layout.channels, BINS), 8, per_lane=True),)


def _chosen(layout: Layout) -> Mapping[str, Any]:
    """Give the settings for people to read."""
    settings, cascades = layout.settings, layout.cascades
    keys = ("count", "resolution", "blend", "positions", "normals", "projection", "footprint", "brightness", "filter")
    far = ", ".join(f"{cascade.far:.3g}" for cascade in cascades.cascades)
    return {**{key: getattr(settings, key) for key in keys}, "far planes [m]": f"({far})"}


def _reasons(layout: Layout) -> Iterator[Reason]:
    """Say what is kept and what is left out: of the scene, and of this method."""
    settings, medium = layout.settings, layout.facts.scene.medium
    replaced = {"self-shadow": "the light view sees no water that a crest hides"}
    if settings.brightness == "published":
        replaced |= dict.fromkeys(("Fresnel", "attenuation", "transport by colour"), "its brightness is a constant")
    for reason in layout.facts.reasons:
        if reason.what in replaced:
            reason = Reason(reason.what, False, replaced[reason.what])
        yield reason
    texels = (1e3 * cascade.texel for cascade in layout.cascades.cascades)
    sizes = ", ".join(f"{across:.3g} x {along:.3g}" for across, along in texels)
    yield Reason("cascades", True, f"{settings.count} light views, texels of {sizes} mm")
    exact = settings.projection == "exact"
    why_not = "the landing is exact" if exact else "the ground of a texel is had by a ray"
    why = "Eq. 3.3 lands by the ground of the same texel" if layout.spec.ground else why_not
    yield Reason("ground seen by the sun", layout.spec.ground, why)
    dispersion = medium.dispersion != "none"
    how = f"{settings.dispersion_photons} photons" if medium.dispersion == "traced" else "channels moved in the picture"
    yield Reason("dispersion", dispersion, how if dispersion else 'medium.dispersion is "none"')
    filtered = settings.filter != "none"
    yield Reason("filter", filtered, settings.filter if filtered else 'filter is "none"')


def _energy(layout: Layout, arrays: Mapping[str, Any]) -> Energy:
    """Read back where the light of the widest cascade went [W]."""
    facts, cascade = layout.facts, layout.cascades.cascades[-1]
    colours = layout.colours
    photon = cascade.texel_area * facts.sun_share * np.asarray(facts.irradiance)
    sums = arrays["ledger"].numpy().sum(axis=1).reshape(len(ENTRIES), -1) * np.ones((1, colours)) * photon
    entries = dict(zip(ENTRIES, sums, strict=True))
    last = arrays[f"cascade{layout.settings.count - 1}.light"].numpy()
    landed = last.reshape(-1, layout.channels).sum(axis=0, dtype=np.float64) * unit(layout.spec.scene.accumulate)
    entries["received"] = landed * np.ones(colours) * photon
    entries["dry"] = np.zeros(colours)
    return Energy(**{name: float(v[0]) if len(v) == 1 else v for name, v in entries.items()})
