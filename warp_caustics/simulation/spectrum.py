"""Spectra of wind waves: energy over frequency, its spreading over directions, and both over the wave vector.

All in float64, lengths in metres, angles in radians. A spectrum over anything integrates to the variance of the
displacement.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..water import GRAVITY, angular_frequency

if TYPE_CHECKING:
    from ..scene import Spectrum

PEAK_ENHANCEMENT = 3.3
"""JONSWAP's mean gamma."""

PEAK_WIDTHS = (0.07, 0.09)
"""JONSWAP's sigma, below the peak and above it."""

DECAY = 1.25
"""Exponent's factor in ``exp(-5/4 (w_p / w)^4)``, which puts the peak at w_p."""

PM_ALPHA, PM_BETA, PM_WIND = 8.1e-3, 0.74, 1.026
"""Pierson and Moskowitz: Phillips' constant, beta, and the wind at 19.5 m by the one at 10 m (Stewart 2008, 16.4)."""

LEAST_EXPONENT = 1e-6
"""Of the spreading, which is then even to a millionth: Mitsuyasu's falls without end away from the peak."""

TABLED = 4096
"""Exponents for which the spreading's norm is computed; between them its logarithm is linear to 1e-5."""

OCTAVES, FREQUENCIES = (-4.0, 10.0), 16384
"""Of the peak's frequency, over which the whole variance is summed, and at how many: its tail falls with w^-4."""


def peak_frequency(settings: Spectrum) -> float:
    """Angular frequency of the peak of the spectrum over deep water [rad/s]."""
    if settings.fetch is None:
        return float((PM_BETA / DECAY) ** 0.25 * GRAVITY / (PM_WIND * settings.wind_speed))
    return float(22.0 * (GRAVITY**2 / (settings.wind_speed * settings.fetch)) ** (1.0 / 3.0))


def energy_scale(settings: Spectrum) -> float:
    """Phillips' alpha."""
    if settings.fetch is None:
        return PM_ALPHA
    return float(0.076 * (settings.wind_speed**2 / (settings.fetch * GRAVITY)) ** 0.22)


def frequency_spectrum(settings: Spectrum, wavenumber: np.ndarray, depth: float) -> np.ndarray:
    """Spectrum over angular frequency [m^2 s / rad], at the frequencies of these wave numbers.

    ``alpha g^2 w^-5 exp(-5/4 (w_p / w)^4) gamma^r``: gamma is 1 for Pierson and Moskowitz; TMA multiplies by
    Kitaigorodskii's factor of the depth, ``tanh^2(k d) / (1 + 2 k d / sinh(2 k d))``.

    Parameters
    ----------
    settings : Spectrum
        As the scene gives it.
    wavenumber : ndarray
        Above 0 [rad/m].
    depth : float
        Of the water at rest [m].
    """
    frequency, peak = angular_frequency(wavenumber, depth), peak_frequency(settings)
    energy = energy_scale(settings) * GRAVITY**2 * frequency**-5.0 * np.exp(-DECAY * (peak / frequency) ** 4)
    if settings.kind == "pm":
        return energy
    width = np.where(frequency <= peak, *PEAK_WIDTHS)
    energy = energy * PEAK_ENHANCEMENT ** np.exp(-0.5 * ((frequency / peak - 1.0) / width) ** 2)
    return energy * depth_factor(wavenumber * depth) if settings.kind == "tma" else energy


def depth_factor(turns: np.ndarray) -> np.ndarray:
    """Kitaigorodskii's factor for waves of ``k d``: 1 over deep water, ``(k d)^2 / 2`` over shallow."""
    # 2x / sinh 2x as 4x e^-2x / (1 - e^-4x), which does not overflow.
    return np.tanh(turns) ** 2 / (1.0 + 4.0 * turns * np.exp(-2.0 * turns) / -np.expm1(-4.0 * turns))


def spreading_exponent(settings: Spectrum, frequency: np.ndarray) -> np.ndarray:
    """Exponent s of the spreading at angular frequencies [rad/s]: the one given, or Mitsuyasu's.

    ``s = 11.5 (U w_p / g)^-2.5``, times ``(w / w_p)^5`` below the peak and ``(w / w_p)^-2.5`` above it (Mitsuyasu et
    al. 1975, J. Phys. Oceanogr. 5).
    """
    if settings.spreading != "mitsuyasu":
        return np.full(np.shape(frequency), max(float(settings.spreading), LEAST_EXPONENT))
    peak = peak_frequency(settings)
    at_peak = 11.5 * (settings.wind_speed * peak / GRAVITY) ** -2.5
    exponent = at_peak * (frequency / peak) ** np.where(frequency <= peak, 5.0, -2.5)
    return np.maximum(exponent, LEAST_EXPONENT)


def spreading(exponent: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Share of the energy by direction [1/rad], ``C(s) cos^2s(angle / 2)``, whose integral over a turn is 1."""
    low, high = math.log(float(exponent.min())), math.log(float(exponent.max()))
    table = np.linspace(low, high, TABLED) if high > low else np.array([low])
    norm = [math.lgamma(s + 1.0) - math.lgamma(s + 0.5) for s in np.exp(table)]
    scale = np.exp(np.interp(np.log(exponent), table, norm)) / (2.0 * math.sqrt(math.pi))
    return scale * np.abs(np.cos(0.5 * angle)) ** (2.0 * exponent)


def vector_spectrum(settings: Spectrum, kx: np.ndarray, ky: np.ndarray, depth: float) -> np.ndarray:
    """Spectrum over the wave vector [m^4 / rad^2]: ``S(w) D(w, angle) (dw / dk) / k``.

    Parameters
    ----------
    settings : Spectrum
        As the scene gives it.
    kx, ky : ndarray
        Wave vectors, none of them zero [rad/m].
    depth : float
        Of the water at rest [m].
    """
    k = np.hypot(kx, ky)
    frequency, turns = angular_frequency(k, depth), np.tanh(k * depth)
    group_speed = GRAVITY * (turns + k * depth * (1.0 - turns**2)) / (2.0 * frequency)
    away = np.arctan2(ky, kx) - math.radians(settings.direction)
    share = spreading(spreading_exponent(settings, frequency), away)
    return frequency_spectrum(settings, k, depth) * share * group_speed / k


def whole_variance(settings: Spectrum, depth: float) -> float:
    """Variance of the displacement of waves of all lengths [m^2]."""
    peak = peak_frequency(settings) ** 2 / GRAVITY
    k = peak * np.exp2(2.0 * np.linspace(*OCTAVES, FREQUENCIES))
    frequency = angular_frequency(k, depth)
    energy = frequency_spectrum(settings, k, depth)
    return float((0.5 * (energy[1:] + energy[:-1]) * np.diff(frequency)).sum())
