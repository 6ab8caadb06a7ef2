"""Light at its extremes: low suns, steep waves and those that face away, indices of refraction, the critical angle."""

from collections.abc import Iterator

import numpy as np
import warp as wp

from oracle.cases import sunlight
from stability.row import METHODS, Row, each, judged
from stability.scenes import choppy, converged, dense, flat
from warp_caustics.kernels.optics import refract

ZENITH_ANGLES = (60.0, 80.0, 89.0, 89.9)
SLOPES = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0)
INDICES = (1.0, 1.0001, 1.333, 2.4)

STEEP = 2.0
"""Slope past which dense photons are the truth: most light leaves through crests, and what lands is a few slivers."""

LOW = 85.0
"""Angle of the sun past which the reference's march along its rays is long, and a coarser lattice has to do."""

WAVE_LENGTH = 0.25
"""Of a steep wave [m]: 16 pixels, so that a slope of 100 is a crest of 4 m."""

SNELL = 1e-4
"""Allowed of a refracted direction: towards the critical angle the cosine is the root of a difference, and float32
keeps half its digits there, sqrt(6e-8)."""


def sun() -> Iterator[Row]:
    """The sun towards the horizon, over flat water in closed form and over waves."""
    for angle in ZENITH_ANGLES:
        calm = choppy(zenith=angle, count=0)
        yield from each(METHODS, "sun over flat water [deg from zenith]", angle, calm, flat(calm), same=True,
                        limit="float32")  # fmt: skip
        wavy = choppy(zenith=angle, slope=0.03)
        truth = converged(wavy, oversample=4 if angle > LOW else 8)
        limit = "edges of shadow, found to a quarter of a cell" if angle > LOW else "the method"
        yield from each(METHODS, "sun over waves [deg from zenith]", angle, wavy, truth, same=True, limit=limit)


def slopes() -> Iterator[Row]:
    """Waves ever steeper, until light leaves through the next crest."""
    for slope in SLOPES:
        k = 2.0 * np.pi / WAVE_LENGTH
        wave = {"amplitude": slope / k, "wavevector": (k, 0.0), "phase": 0.3}
        # In one plane, so that few rays must be marched along.
        table = choppy(
            water={"level": 0.25 + slope / k, "waves": [wave]},
            sun={"direction": sunlight(20.0, 0.0)},
            resolution=(64, 4),
        )
        truth = dense(table) if slope > STEEP else converged(table)
        limit = "edges of what leaves through crests" if slope >= 1.0 else "the method"
        yield from each(METHODS, "slope of a wave", slope, table, truth, same=True, limit=limit)


def facing_away() -> Iterator[Row]:
    """A wave whose back faces away from the sun, with shadows and without."""
    k = 2.0 * np.pi / 0.75
    wave = {"amplitude": 1.0 / k, "wavevector": (k, 0.0), "phase": 0.3}
    for shadow in (True, False):
        water = {"level": 0.75, "waves": [wave], "self_shadow": shadow}
        table = choppy(water=water, sun={"direction": sunlight(70.0, 10.0)}, resolution=(48, 12))
        limit = "edges of shadow" if shadow else "light that enters twice, said in a warning"
        truth = converged(table, oversample=4)
        yield from each(METHODS, "wave that faces away, shadows", str(shadow), table, truth, same=True, limit=limit)


def indices() -> Iterator[Row]:
    """From no refraction to diamond's."""
    for ior in INDICES:
        table = choppy(medium={"ior": ior, "fresnel": True})
        yield from each(METHODS, "ior", ior, table, converged(table), same=True, limit="the method")


@wp.kernel(enable_backward=False)
def refract_all(
    # In:
    directions: wp.array[wp.vec3],
    eta: float,
    # Out:
    refracted_out: wp.array[wp.vec3],
):
    """One thread a direction; light travels up, against a normal that looks down."""
    i = wp.tid()
    refracted_out[i] = refract(directions[i], wp.vec3(0.0, 0.0, -1.0), eta)


def critical() -> Iterator[Row]:
    """Light that goes up out of the water: refracted, and past the critical angle returned as nothing."""
    ior = 1.333
    angles = np.concatenate([np.linspace(0.0, 90.0, 2001), np.degrees(np.arcsin(1.0 / ior)) + np.geomspace(1e-4, 1, 9)])
    directions = np.stack([np.sin(np.radians(angles)), 0.0 * angles, np.cos(np.radians(angles))], -1).astype(np.float32)
    refracted = wp.zeros(len(angles), dtype=wp.vec3, device="cpu")
    given = wp.array(directions, dtype=wp.vec3, device="cpu")

    def launch() -> None:
        wp.launch(refract_all, dim=len(angles), inputs=[given, ior], outputs=[refracted], device="cpu")

    launch()
    found = refracted.numpy().astype(np.float64)
    across, eta = directions[:, 0].astype(np.float64), float(np.float32(ior))
    length = np.linalg.norm(directions.astype(np.float64), axis=1)
    k = 1.0 - eta**2 * (1.0 - directions[:, 2].astype(np.float64) ** 2)
    expected = np.stack([eta * across, 0.0 * across, np.sqrt(np.maximum(k, 0.0)) * length], axis=-1)
    expected[k < 0.0] = 0.0
    sure = np.abs(k) > 4.0 * np.finfo(np.float32).eps  # nearer, either answer is right
    error = float(np.abs(found - expected)[sure].max()) if np.isfinite(found).all() else float("nan")
    yield judged("out of the water, past the critical angle", "0 to 90 deg", "refract, eta 1.333", error, SNELL,
                 "k = 1 - eta^2 sin^2 loses half of float32's digits at the critical angle", launch)  # fmt: skip
