"""Spectral water on a device: its modes at time 0, and the launches that take them to a time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from ..bands import bind_lanes
from ..kernels.fft import fft_block, make_fft_rows
from ..kernels.spectral import Dispersion, make_evolve, make_travel, make_turn, spectral_surface
from ..recording import CopyCommand, Stages, run_stages
from ..water import GRAVITY
from .basin import Basin
from .drops import drop_profiles
from .sea import Sea, mode_numbers

if TYPE_CHECKING:
    from ..crew import Crew
    from .body import WaterBody


class SpectralWater:
    """Modes that stand, of water that started at rest, or travel, of a sea; nothing is kept from a time to the next.

    Attributes
    ----------
    surface : wp.array
        Displacement at the cells [m], float64 ``[rows, columns]``, written by :meth:`advance`.
    stages : Stages
        What makes it once :meth:`prepare` has been called.
    """

    def __init__(self, basin: Basin | Sea, device: str, crew: Crew) -> None:
        mirrored = not basin.periodic
        shape = padded_shape(basin)
        self._spectrum: wp.array = wp.array(_modes(basin), dtype=wp.vec2d, device=device)
        self._modes = wp.zeros((basin.rows, shape[1]), dtype=wp.vec2d, device=device)
        self._turned = wp.zeros((basin.columns, shape[0]), dtype=wp.vec2d, device=device)
        self.surface = wp.zeros((basin.rows, basin.columns), dtype=wp.float64, device=device)
        turns = np.pi if mirrored else 2.0 * np.pi
        wavenumbers = wp.vec2d(turns / basin.size[0], turns / basin.size[1])
        dispersion = Dispersion()
        dispersion.gravity, dispersion.depth = GRAVITY, basin.depth
        if isinstance(basin, Sea):
            dispersion.unit = basin.unit_frequency
            evolve = make_travel(basin.unit_frequency > 0.0)
        else:
            dispersion.tension = basin.tension
            evolve = make_evolve(mirrored)

        pinned = device != "cpu"
        host = wp.zeros(1, dtype=wp.float64, device="cpu", pinned=pinned)
        self._time = host.numpy()
        clock = wp.zeros(1, dtype=wp.float64, device=device) if pinned else host
        values = {"spectrum": self._spectrum, "wavenumbers": wavenumbers, "dispersion": dispersion, "clock": clock,
                  "modes": self._modes, "turned": self._turned, "height": self.surface}  # fmt: skip

        def record(kernel: Any, dim: tuple[int, ...], block: int = 256, weight: int = 1, **names: str) -> None:
            self.stages.append(bind_lanes(kernel, dim, values, device, crew.threads, names, block=block, weight=weight))

        self.stages: Stages = [[[CopyCommand(clock, host)]]] if pinned else []
        record(evolve, self._modes.shape)
        for name, array, following in (("modes", self._modes, self._turned), ("turned", self._turned, None)):
            rows, length = array.shape
            block = fft_block(length, device)
            record(make_fft_rows(length, True), (rows, block), block, length // block, rows=name)
            if following is not None:
                record(make_turn(mirrored), following.shape)
        record(spectral_surface, self.surface.shape)

    def advance(self, time: float) -> None:
        """Make the surface of a time [s], any time."""
        self.prepare(time)
        run_stages(self.stages)

    def prepare(self, time: float) -> None:
        """Do the host's part of :meth:`advance`."""
        self._time[0] = time


def padded_shape(basin: WaterBody) -> tuple[int, int]:
    """Lengths of the transforms along y and x: between walls, twice the cells."""
    factor = 1 if basin.periodic else 2
    return factor * basin.rows, factor * basin.columns


def _modes(basin: Basin | Sea) -> np.ndarray:
    """Modes at time 0 of a sea or of drops, ``[rows, columns, 2]``, so that their plain sum is the surface.

    Made once, on the host. Between walls a mode is the factor of a product of cosines, the one along x already with
    the phase of its sum.
    """
    if isinstance(basin, Sea):
        # Of a sea the modes' phase is that at the world's origin, and the first node stands half a cell from there.
        half = np.exp(1j * np.pi * mode_numbers(basin.settings) / basin.rows)
        spectrum = basin.modes * half[:, None] * half[None, :]
        return np.ascontiguousarray(np.stack([spectrum.real, spectrum.imag], axis=-1))
    row_profiles, column_profiles = drop_profiles(basin)
    if basin.periodic:
        spectrum = np.fft.fft(row_profiles).T @ np.fft.fft(column_profiles) / (basin.rows * basin.columns)
    else:
        phase = np.exp(0.5j * np.pi * np.arange(basin.columns) / basin.columns)
        spectrum = (_cosines(row_profiles).T @ _cosines(column_profiles)) * phase
    return np.ascontiguousarray(np.stack([spectrum.real, spectrum.imag], axis=-1))


def _cosines(values: np.ndarray) -> np.ndarray:
    """Factors c of ``values[:, n] = sum_k c[:, k] cos(pi k (n + 1/2) / N)``, by the transform of twice the length."""
    count = values.shape[1]
    doubled = np.fft.fft(np.concatenate([values, values[:, ::-1]], axis=1))[:, :count]
    factors = (doubled * np.exp(-0.5j * np.pi * np.arange(count) / count)).real / count
    factors[:, 0] *= 0.5
    return factors
