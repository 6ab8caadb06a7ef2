"""Cases that can be solved on paper: flat water, and one sine with the sun in its plane."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from oracle.surfaces import Array

SCAN = 20000  # samples in which folds are looked for: two within a sample would escape, and so would their light
BISECTIONS = 90  # halvings that close any bracket to float64


def flat_water_irradiance(
    light_z: float, ior: float, depth: float, irradiance: float = 1.0, absorption: float = 0.0, fresnel: bool = False
) -> float:
    """Give the irradiance under flat water, E |I_z| T exp(-c d / |R_z|), for a unit light direction of z ``light_z``.

    Fresnel's equations are taken in the form of angles, sin(i - t) / sin(i + t) and the tangents.
    """
    inward = float(np.arccos(-light_z))
    refracted = float(np.arcsin(np.sin(inward) / ior))
    passes = 1.0
    if fresnel and inward < 1e-6:
        passes = 1.0 - ((ior - 1.0) / (ior + 1.0)) ** 2
    elif fresnel:
        s = np.sin(inward - refracted) / np.sin(inward + refracted)
        p = np.tan(inward - refracted) / np.tan(inward + refracted)
        passes = 1.0 - 0.5 * float(s * s + p * p)
    return float(-light_z * irradiance * passes * np.exp(-absorption * depth / np.cos(refracted)))


def first_focus_depth(amplitude: float, wavenumber: float, ior: float) -> float:
    """Give the depth below the crest of a sine where light from the zenith first comes to a focus, n / ((n-1) a k²)."""
    return ior / ((ior - 1.0) * amplitude * wavenumber**2)


def sine_landing(
    x: Array, amplitude: float, wavenumber: float, depth: float, ior: float, light_x: float = 0.0, phase: float = 0.0
) -> Array:
    """Give where light that enters z = depth + a sin(k x + φ) at x meets the floor z = 0.

    ``light_x`` is the x component of the unit direction of travel, in the x-z plane. Angles do the work here, from the
    vertical: the normal leans by -atan z_x, and Snell's law holds for the angles measured from it.
    """
    angle = wavenumber * x + phase
    lean = np.arctan(amplitude * wavenumber * np.cos(angle))
    refracted = lean + np.arcsin(np.sin(np.arcsin(light_x) - lean) / ior)
    return np.asarray(x + (depth + amplitude * np.sin(angle)) * np.tan(refracted))


def sine_folds(
    amplitude: float,
    wavenumber: float,
    depth: float,
    ior: float,
    low: float,
    high: float,
    light_x: float = 0.0,
    phase: float = 0.0,
) -> Array:
    """Give the places x between ``low`` and ``high`` where the landing turns back, dX/dx = 0."""
    args = (amplitude, wavenumber, depth, ior, light_x, phase)
    x = np.linspace(low, high, SCAN + 1)
    rate = _landing_rate(x, *args)
    turn = np.flatnonzero(np.sign(rate[:-1]) * np.sign(rate[1:]) < 0.0)
    a, b, rising = x[turn], x[turn + 1], rate[turn] < 0.0
    for _ in range(BISECTIONS):
        middle = 0.5 * (a + b)
        first = (_landing_rate(middle, *args) < 0.0) == rising
        a, b = np.where(first, middle, a), np.where(first, b, middle)
    return np.asarray(0.5 * (a + b))


def sine_focus_depth(amplitude: float, wavenumber: float, ior: float, low: float, high: float) -> float:
    """Find by bisection the depth of a floor under the crest at which folds first appear, between two depths."""
    around = np.pi / wavenumber
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        rate = _landing_rate(
            np.linspace(-0.1, 0.1, SCAN + 1) * around, amplitude, wavenumber, middle - amplitude, ior, 0.0, np.pi / 2
        )
        low, high = (low, middle) if rate.min() < 0.0 else (middle, high)
    return 0.5 * (low + high)


def sine_irradiance(
    edges: Array,
    amplitude: float,
    wavenumber: float,
    depth: float,
    ior: float,
    light_x: float = 0.0,
    phase: float = 0.0,
) -> Array:
    """Give the irradiance between pixel edges [n + 1] under one sine, exactly: flux through all sheets over width.

    Between folds the landing is monotone, so the light in a pixel enters between two roots, and the flux taken in
    between x1 and x2 is (z2 - z1) I_x - (x2 - x1) I_z, a difference of end values.
    """
    args = (amplitude, wavenumber, depth, ior, light_x, phase)
    slope = amplitude * wavenumber
    lean = np.linspace(-np.arctan(slope), np.arctan(slope), SCAN)
    steepest = np.tan(lean + np.arcsin(np.sin(np.arcsin(light_x) - lean) / ior))
    reach = (depth + amplitude) * np.abs(steepest).max() * 1.01
    low, high = edges[0] - reach, edges[-1] + reach
    ends = np.concatenate([[low], sine_folds(amplitude, wavenumber, depth, ior, low, high, light_x, phase), [high]])
    light_z = -np.sqrt(1.0 - light_x**2)
    flux = np.zeros(edges.size - 1)
    for start, stop in pairwise(ends):
        x = _preimages(edges, start, stop, args)
        height = amplitude * np.sin(wavenumber * x + phase)
        flux += np.abs(np.diff(height * light_x - x * light_z))
    return np.asarray(flux / np.diff(edges))


def _preimages(edges: Array, start: float, stop: float, args: tuple[float, ...]) -> Array:
    """Find where on a monotone branch the landing passes each edge; the branch's end where it never does."""
    rises = sine_landing(np.array(stop), *args) > sine_landing(np.array(start), *args)
    a, b = np.full(edges.shape, start), np.full(edges.shape, stop)
    for _ in range(BISECTIONS):
        middle = 0.5 * (a + b)
        before = (sine_landing(middle, *args) < edges) == rises
        a, b = np.where(before, middle, a), np.where(before, b, middle)
    return 0.5 * (a + b)


def _landing_rate(
    x: Array, amplitude: float, wavenumber: float, depth: float, ior: float, light_x: float, phase: float
) -> Array:
    """Give dX/dx in closed form."""
    angle = wavenumber * x + phase
    slope = amplitude * wavenumber * np.cos(angle)
    lean_rate = -amplitude * wavenumber**2 * np.sin(angle) / (1.0 + slope * slope)
    lean = np.arctan(slope)
    inward = np.arcsin(light_x) - lean
    inner = np.sin(inward) / ior
    refracted = lean + np.arcsin(inner)
    refracted_rate = lean_rate * (1.0 - np.cos(inward) / ior / np.sqrt(1.0 - inner * inner))
    height = depth + amplitude * np.sin(angle)
    return np.asarray(1.0 + slope * np.tan(refracted) + height * refracted_rate / np.cos(refracted) ** 2)
