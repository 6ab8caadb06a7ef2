"""A sea: the modes of a spectrum in a square that repeats, the bounds of its surface, and what of it is refused."""

from __future__ import annotations

import functools
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from ..scene.spectrum import NODES_A_WAVE, Spectrum
from ..water import angular_frequency
from .body import WaterBody
from .spectrum import vector_spectrum, whole_variance

if TYPE_CHECKING:
    from collections.abc import Iterator

FINE_POINTS, COARSE_POINTS = 8, 2
"""Points each way (Gauss-Legendre) by which a mode's share of the spectrum is integrated, for long and short waves."""

LONG_WAVES = 16
"""Waves in the square up to which they are long: the peak of a spectrum, 8 % wide, may be narrower than a mode."""

TIMES, FEWEST_TIMES, ENOUGH_POINTS = 32, 4, 2**21
"""Times at which the surface is made to find its bounds; fewer, of a large one, which holds as much in one of them."""

DOMINANT_PERIODS = 4.0
"""Periods of the largest wave over which they are spread where the sea does not loop."""

BEYOND_SAMPLES = 0.2
"""Share by which bounds pass the largest that was found: between the times, between the points, and later, when the
crests of a sea that does not loop have met otherwise. Each frame measures its surface, and says if that was too little.
"""

SEEN = 0.25
"""Share by which a loop may move a frequency before it is warned of: the longest wave then runs visibly off its speed.
"""

FAINT = 1e-3
"""Share of the largest amplitude under which a wave is too faint for that."""

SAMPLES_A_WAVE = 4
"""Points in the shortest wave at which the surface is made then."""


@dataclass(frozen=True, eq=False)
class Sea(WaterBody):
    """Waves ``sum a cos(k . x - w t + phase)``, x from the world's origin, resolved.

    Attributes
    ----------
    settings : Spectrum
        As the scene gives them.
    modes : ndarray
        complex128 ``[rows, columns]``, ordered as ``numpy.fft``: ``a exp(i phase)``.
    share : float
        Of the whole spectrum's variance that its waves have.
    steepest, highest : float
        Bounds of slope and displacement [m], margins included.
    """

    settings: Spectrum
    modes: np.ndarray = field(repr=False)
    share: float
    steepest: float
    highest: float

    @property
    def fineness(self) -> str:
        """Path in the scene of the key that says how fine its cells are."""
        return "water.spectrum.resolution"

    @property
    def spectral(self) -> bool:
        """True: modes are propagated."""
        return True

    @property
    def periodic(self) -> bool:
        """True: a sea repeats."""
        return True

    @property
    def max_slope(self) -> float:
        """Steepest slope that is planned for."""
        return self.steepest

    @property
    def max_height(self) -> float:
        """Largest displacement that is planned for [m]."""
        return self.highest

    @property
    def unit_frequency(self) -> float:
        """Frequencies are whole multiples of this [rad/s]; 0 where they are as they come."""
        return 0.0 if self.settings.loop is None else 2.0 * np.pi / self.settings.loop

    @property
    def moved(self) -> float:
        """Largest share by which a loop moves a wave's frequency, those too faint to be seen aside."""
        kx, ky = wave_vectors(self.settings)
        waves = np.abs(self.modes) > FAINT * np.abs(self.modes).max()
        own = angular_frequency(np.hypot(kx, ky)[waves], self.depth)
        return float(np.abs(looped(own, self.unit_frequency) / own - 1.0).max())

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a loop does to its waves, where that can be seen."""
        if self.settings.loop is None or self.moved <= SEEN:
            return ()
        return (
            f"water.spectrum.loop: {self.settings.loop:g} s move the frequency of a wave by {100 * self.moved:.2g} %; "
            f"a longer loop moves them less",
        )

    @property
    def summary(self) -> str:
        """What there is of the spectrum, in words."""
        s = self.settings
        shortest = NODES_A_WAVE * s.period / s.resolution
        loop = "" if s.loop is None else f"; a loop of {s.loop:g} s moves frequencies by up to {100 * self.moved:.2g} %"
        return (
            f"{s.kind}, repeats after {s.period:g} m; waves of {s.period:g} to {shortest:.3g} m, "
            f"{100 * self.share:.3g} % of its variance{loop}"
        )


@functools.lru_cache(maxsize=4)
def make_sea(settings: Spectrum, depth: float) -> Sea:
    """Resolve a spectrum over water of this depth at rest [m].

    Raises
    ------
    InputError
        If the spectrum has no energy in waves that fit.
    """
    variances = mode_variances(settings, depth)
    total = float(variances.sum())
    if total == 0.0:
        raise InputError(
            f"water.spectrum: no energy in waves of {settings.period:g} m to "
            f"{NODES_A_WAVE * settings.period / settings.resolution:g} m, those that fit into its square; expected a "
            "period of some of its wave lengths, and nodes enough for them"
        )
    # Of a wave of amplitude a, the variance is half its square.
    modes = np.sqrt(2.0 * variances) * np.exp(1j * mode_phases(settings))
    slope, height = _extremes(settings, modes, depth)
    side, beyond = settings.period, 1.0 + BEYOND_SAMPLES
    return Sea(
        (0.0, 0.0), (side, side), settings.resolution, settings.resolution, depth, settings, modes,
        total / whole_variance(settings, depth), slope * beyond, height * beyond,
    )  # fmt: skip


def mode_numbers(settings: Spectrum) -> np.ndarray:
    """Waves of each mode in the square along a side, in the order of ``numpy.fft``."""
    return np.fft.fftfreq(settings.resolution, 1.0 / settings.resolution)


def wave_vectors(settings: Spectrum) -> tuple[np.ndarray, np.ndarray]:
    """Wave vectors kx ``[1, columns]`` and ky ``[rows, 1]`` of the modes [rad/m]."""
    k = 2.0 * np.pi / settings.period * mode_numbers(settings)
    return k[None, :], k[:, None]


def mode_variances(settings: Spectrum, depth: float) -> np.ndarray:
    """Variance of each mode ``[rows, columns]`` [m^2]: the spectrum's integral over its square of wave vectors."""
    numbers, unit = mode_numbers(settings), 2.0 * np.pi / settings.period
    waves = np.hypot(numbers[None, :], numbers[:, None])
    fits = (waves > 0.0) & (waves <= settings.resolution / NODES_A_WAVE)
    variances = np.zeros_like(waves)
    for part, points in ((fits & (waves <= LONG_WAVES), FINE_POINTS), (fits & (waves > LONG_WAVES), COARSE_POINTS)):
        rows, columns = np.nonzero(part)
        if len(rows) == 0:
            continue
        at, weights = np.polynomial.legendre.leggauss(points)
        kx = unit * (numbers[columns] + 0.5 * at[:, None])
        for up, weight in zip(0.5 * at, 0.5 * weights, strict=True):
            density = vector_spectrum(settings, kx, unit * (numbers[rows] + up), depth)
            variances[rows, columns] += weight * unit**2 * (0.5 * weights @ density)
    return variances


def mode_phases(settings: Spectrum) -> np.ndarray:
    """Phase of each mode ``[rows, columns]`` [rad], even over a turn.

    They are drawn from the longest waves to the shortest, so that another resolution is the same sea.
    """
    numbers = mode_numbers(settings)
    columns, rows = (axis.ravel() for axis in np.meshgrid(numbers, numbers))
    order = np.lexsort((columns, rows, np.maximum(np.abs(columns), np.abs(rows))))
    phases = np.empty(len(order))
    phases[order] = np.random.Generator(np.random.PCG64(settings.seed)).uniform(0.0, 2.0 * np.pi, len(order))
    return phases.reshape(settings.resolution, settings.resolution)


def looped(frequency: np.ndarray, unit: float) -> np.ndarray:
    """Frequencies rounded to whole multiples of a unit, at least one; as they are where it is 0."""
    return unit * np.maximum(np.round(frequency / unit), 1.0) if unit > 0.0 else frequency


def _extremes(settings: Spectrum, modes: np.ndarray, depth: float) -> tuple[float, float]:
    """Steepest slope and largest displacement [m] at some times, each at as many points as its waves need."""
    count = SAMPLES_A_WAVE * settings.resolution // NODES_A_WAVE
    # Modes of shorter waves are empty, so that the corners of the array hold all there is.
    kept = np.r_[0 : count // 2, settings.resolution - count // 2 : settings.resolution]
    kx, ky = (k.ravel()[kept] for k in wave_vectors(settings))
    kx, ky, modes = kx[None, :], ky[:, None], modes[np.ix_(kept, kept)]
    frequency = angular_frequency(np.hypot(kx, ky), depth)
    dominant = frequency.flat[np.abs(modes).argmax()]
    span = DOMINANT_PERIODS * 2.0 * np.pi / dominant
    if settings.loop is not None:
        span, frequency = settings.loop, looped(frequency, 2.0 * np.pi / settings.loop)
    times = int(np.clip(ENOUGH_POINTS // modes.size, FEWEST_TIMES, TIMES))
    extremes = list(_samples(modes, frequency, (kx, ky), span * np.arange(times) / times))
    return max(slope for slope, _ in extremes), max(height for _, height in extremes)


def _samples(
    modes: np.ndarray, frequency: np.ndarray, k: tuple[np.ndarray, np.ndarray], times: np.ndarray
) -> Iterator[tuple[float, float]]:
    """Yield the steepest slope and largest displacement at each time."""
    for time in times:
        turned = modes * np.exp(-1j * frequency * time)
        height, along, across = (
            (np.fft.ifft2(part) * part.size).real for part in (turned, 1j * k[0] * turned, 1j * k[1] * turned)
        )
        yield float(np.hypot(along, across).max()), float(np.abs(height).max())
