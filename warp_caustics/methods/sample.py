"""``sample``: Collard & Mundi's sampled caustic map. Plan view, a flat receiver; follows no light.

What is published is an intensity from 0 to 1. As a caustic map it is multiplied by the irradiance that the sun has on
the horizontal, so that it can stand beside the other methods'; its brightness stays a matter of taste, and a comparison
of patterns scales it first.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ..assets.environment import load_environment
from ..errors import InputError
from ..kernels.box_blur import make_box_blur
from ..kernels.sample import Sampling, face_normals, make_heights, make_sample, scale_to_irradiance
from ..program import Buffer
from ..sequence import Lane, Sequence, Step, Upload
from ..specify import Reason

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..facts import Facts

ROUNDING = 1e-9
"""Share of the map's size by which water may fall short of it: sums of its corners are rounded."""

OF_THE_WATER = ("surface by height map", "simulation", "spectrum")
"""The scene's own reasons that hold for a method that asks the water for its height alone."""


def sample(facts: Facts) -> Sequence:
    """Plan the water's mesh, its normals, the samples, and the blur where there is one.

    Raises
    ------
    InputError
        If the scene has what the method cannot honour, or the environment map cannot be read.
    """
    unfit = list(_unfit(facts))
    if unfit:
        raise InputError(
            'method "sample" looks up an intensity over a flat floor and follows no light, so it cannot honour '
            f'{"; ".join(unfit)}; methods that can: "beam", "photon"'
        )
    scene, settings = facts.scene, facts.scene.method.sample
    columns, rows = scene.map.resolution
    vertices, texels = settings.vertices, (rows, columns)
    environment = None if settings.environment is None else load_environment(settings.environment)
    blur = settings.blur_radius > 0
    return Sequence(
        stages=(((*_mesh(facts), _samples(facts), *_finish(facts)),),),
        buffers=(
            Buffer("height", "float32", (vertices, vertices), 4),
            Buffer("normal", "vec3", texels, 12),
            Buffer("caustic", "float32", texels, 4),
            *((Buffer("blurred", "float32", texels, 4),) if blur else ()),
            Buffer("caustic_map", "float32", (rows * columns * len(facts.irradiance),), 4),
        ),
        caustic_map="caustic_map",
        values=_values(facts),
        uploads=_uploads(environment),
        settings={
            **settings.model_dump(exclude_none=True, exclude={"environment_power"} if settings.environment else None),
            "ground_offset": _ground_offset(facts),
        },
        reasons=_reasons(facts),
        samples=rows * columns * (settings.sample_steps + 1) ** 2,
    )


def _mesh(facts: Facts) -> Lane:
    """The water's mesh and its normals."""
    (columns, rows), vertices = facts.scene.map.resolution, facts.scene.method.sample.vertices
    water = facts.spec.water
    return (
        Step("heights", "the water's mesh at its height", lambda: make_heights(water), (vertices, vertices)),
        Step("normals", "the mesh's face normals, seen from above", lambda: face_normals, (rows, columns)),
    )


def _samples(facts: Facts) -> Step:
    """The samples of the normals."""
    settings, (columns, rows) = facts.scene.method.sample, facts.scene.map.resolution
    image = settings.environment is not None
    each_way = settings.sample_steps + 1
    does = f"{each_way} x {each_way} samples of the normals around each pixel, through the environment map"
    return Step("sample", does, lambda: make_sample(image), (rows, columns), {} if image else {"environment": None})


def _finish(facts: Facts) -> Lane:
    """The blur, where there is one, and the irradiance."""
    columns, rows = facts.scene.map.resolution
    scale = Step(
        "scale", "intensity times the irradiance on the horizontal", lambda: scale_to_irradiance, (rows, columns)
    )
    if not facts.scene.method.sample.blur_radius:
        return (scale,)
    does = "box blur, along rows and then columns"
    along, across = {"image": "caustic", "blurred": "blurred"}, {"image": "blurred", "blurred": "caustic"}
    return (
        Step("blur", does, lambda: make_box_blur(0, 1), (rows, columns), along),
        Step("blur", does, lambda: make_box_blur(1, 0), (rows, columns), across),
        scale,
    )


def _ground_offset(facts: Facts) -> float:
    given = facts.scene.method.sample.ground_offset
    return facts.rest_depth if given is None else given


def _values(facts: Facts) -> Mapping[str, Any]:
    """Values of the kernels' parameters."""
    scene, settings, colours = facts.scene, facts.scene.method.sample, len(facts.irradiance)
    sampling = Sampling()
    sampling.steps = settings.sample_steps
    sampling.size = settings.sample_size
    sampling.ground_offset = _ground_offset(facts)
    sampling.base_intensity = settings.base_intensity
    sampling.falloff_power = settings.falloff_power
    sampling.weight_power = settings.weight_power
    sampling.environment_power = settings.environment_power
    irradiance = np.zeros(3)
    irradiance[:colours] = np.multiply(facts.irradiance, -scene.sun.unit_direction[2])
    return {
        "cell": tuple(np.asarray(scene.map.size) / (settings.vertices - 1)),
        "sampling": sampling,
        "radius": settings.blur_radius,
        "irradiance": tuple(irradiance),
        "colours": colours,
    }


def _uploads(environment: NDArray[np.float32] | None) -> Mapping[str, Callable[[str], Any]]:
    """Put the environment map on a device later; it has been read, so that a bad file is said before anything is."""
    if environment is None:
        return {}

    def upload(device: str) -> Any:
        import warp as wp

        return wp.array(environment, dtype=float, device=device)

    return {"environment": Upload(Buffer("environment", "float32", environment.shape, 4), upload)}


def _unfit(facts: Facts) -> Iterator[str]:
    """Keys of the scene that cannot be honoured, as they stand in it."""
    scene = facts.scene
    for name in ("terrain", "mesh"):
        if getattr(scene.receiver, name) is not None:
            yield f"receiver.{name}"
    if scene.receiver.objects:
        yield "receiver.objects"
    if scene.medium.fresnel:
        yield "medium.fresnel"
    if scene.medium.jerlov is not None:
        yield "medium.jerlov"
    elif np.any(scene.medium.absorption):
        yield "medium.absorption"
    if scene.sun.angular_diameter > 0.0:
        yield "sun.angular_diameter"
    if scene.water.self_shadow is True:
        yield "water.self_shadow = true"
    if scene.method.accumulate != "float32":
        yield f'method.accumulate = "{scene.method.accumulate}"'
    border = facts.water_border
    slack = ROUNDING * np.asarray(scene.map.size)
    if border is not None and (np.any(border[0] > slack) or np.any(border[1] < scene.map.size - slack)):
        yield "water that ends within the map (its origin and size say where)"


def _reasons(facts: Facts) -> tuple[Reason, ...]:
    """Say what is kept and what is left out, and why."""
    settings = facts.scene.method.sample
    overhead = "as published, it stands overhead: the scene's sun gives its irradiance on the horizontal alone"
    return (
        *(reason for reason in facts.reasons if reason.what in OF_THE_WATER),
        Reason("refraction", False, "a weighting of the normals stands for it: not Snell's law, whatever medium.ior"),
        Reason("sun's direction", False, overhead),
        Reason("environment image", settings.environment is not None, settings.environment or "the built-in falloff"),
        Reason("blur", settings.blur_radius > 0,
               f"radius {settings.blur_radius}" if settings.blur_radius else "method.sample.blur_radius is 0"),
        Reason("energy ledger", False, "no light is followed"),
    )  # fmt: skip
