"""The peer: Yuksel & Keyser's gather and the bilinear splat as a Python user would write them in Numba.

Waves over a plane, as :mod:`ladder_gather` has them, without a ledger. ``fastmath`` and ``prange``, loops over rows
and columns, tables of sines made by NumPy once a frame; private maps for the splat, since its threads would meet.
Needs the package ``numba``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numba import njit, prange, set_num_threads

from warp_caustics.water import phases

if TYPE_CHECKING:
    from warp_caustics import Plan


@njit(parallel=True, fastmath=True)
def intersections(columns, rows, amplitude, wavevector, sun, eta, level, shift, pixel, landing_x, landing_y, flux):
    """Where each sample lands, in pixels from where it does at rest; ``columns`` and ``rows`` hold (cos, sin)."""
    for j in prange(rows.shape[0]):
        for i in range(columns.shape[0]):
            z = np.float32(0.0)
            slope_x = np.float32(0.0)
            slope_y = np.float32(0.0)
            for w in range(amplitude.shape[0]):
                rise = amplitude[w] * (columns[i, w, 0] * rows[j, w, 0] - columns[i, w, 1] * rows[j, w, 1])
                z += amplitude[w] * (columns[i, w, 1] * rows[j, w, 0] + columns[i, w, 0] * rows[j, w, 1])
                slope_x += rise * wavevector[w, 0]
                slope_y += rise * wavevector[w, 1]
            squared = np.float32(1.0) + slope_x * slope_x + slope_y * slope_y
            facing = slope_x * sun[0] + slope_y * sun[1] - sun[2]
            root = np.sqrt(squared * (np.float32(1.0) - eta * eta) + eta * eta * facing * facing)
            gamma = (eta * facing - root) / squared
            distance = (level - z) / (eta * sun[2] + gamma)
            landing_x[j, i] = (distance * (eta * sun[0] - gamma * slope_x) - shift[0]) / pixel[0]
            landing_y[j, i] = (distance * (eta * sun[1] - gamma * slope_y) - shift[1]) / pixel[1]
            flux[j, i] = facing


@njit(parallel=True, fastmath=True)
def pass_one(landing_x, landing_y, flux, left, below, n, m, channels):
    """What the n samples beside a pixel, in its row, give to the m + 1 pixels of its column around it."""
    for r in prange(channels.shape[1]):
        row = r + below - m // 2
        for c in range(channels.shape[2]):
            for j in range(m + 1):
                channels[j, r, c] = 0.0
            for i in range(n):
                column = c + left + i - n // 2
                ax = np.float32(1.0) - abs(landing_x[row, column] + np.float32(i - n // 2))
                if ax > 0.0:
                    light = ax * flux[row, column]
                    for j in range(m + 1):
                        ay = np.float32(1.0) - abs(landing_y[row, column] - np.float32(j - m // 2))
                        if ay > 0.0:
                            channels[j, r, c] += ay * light


@njit(parallel=True, fastmath=True)
def pass_two(channels, m, scale, image):
    """A pixel adds up what the rows around it have for it."""
    for r in prange(image.shape[0]):
        for c in range(image.shape[1]):
            total = np.float32(0.0)
            for j in range(m + 1):
                total += channels[j, r + m - j, c]
            image[r, c] = scale * total


@njit(parallel=True, fastmath=True)
def splat(landing_x, landing_y, flux, left, below, n, m, scale, maps, image):
    """Each sample's light on the four pixels around it, if their windows hold it; a map for each band of rows."""
    bands, height, width = maps.shape
    rows = landing_x.shape[0]
    for band in prange(bands):
        maps[band] = 0.0
        for j in range(band * rows // bands, (band + 1) * rows // bands):
            for i in range(landing_x.shape[1]):
                x = int(np.floor(landing_x[j, i]))
                y = int(np.floor(landing_y[j, i]))
                across = landing_x[j, i] - np.float32(x)
                along = landing_y[j, i] - np.float32(y)
                for b in range(2):
                    for a in range(2):
                        row = j - below + y + b
                        column = i - left + x + a
                        held = abs(x + a) <= n // 2 and abs(y + b) <= m // 2
                        if held and 0 <= row < height and 0 <= column < width:
                            wide = across if a == 1 else np.float32(1.0) - across
                            tall = along if b == 1 else np.float32(1.0) - along
                            maps[band, row, column] += wide * tall * flux[j, i]
    for r in prange(height):
        for c in range(width):
            total = np.float32(0.0)
            for band in range(bands):
                total += maps[band, r, c]
            image[r, c] = scale * total


class Peer:
    """A frame of the peer, by one of its two forms, of the scene and windows of a plan.

    Parameters
    ----------
    plan : Plan
        Of the method ``gather``, for a scene of waves over a plane and one direction of the sun.
    form : str
        ``"two_pass"`` or ``"splat"``.
    threads : int
        For Numba.
    """

    def __init__(self, plan: Plan, form: str, threads: int) -> None:
        facts, self._lattice, self._threads = plan.facts, plan.program.lattice, threads
        assert len(facts.suns) == 1 and plan.method == "gather"
        self._facts, self._form = facts, form
        self._n, self._m = plan.settings["n"], plan.settings["m"]
        (columns, rows), (wide, tall) = facts.scene.map.resolution, self._lattice.count
        self._wavevector = np.array([wave.wavevector for wave in facts.scene.waves])
        self._amplitude = np.array([wave.amplitude for wave in facts.scene.waves], dtype=np.float32)
        self._landing_x, self._landing_y, self._flux = (np.empty((tall, wide), dtype=np.float32) for _ in range(3))
        self._image = np.empty((rows, columns), dtype=np.float32)
        shape = (self._m + 1, rows + self._m, columns) if form == "two_pass" else (threads, rows, columns)
        self._between = np.empty(shape, dtype=np.float32)

    def run(self) -> None:
        """Compute a frame at time 0."""
        facts, lattice, f32 = self._facts, self._lattice, np.float32
        set_num_threads(self._threads)
        at = [(first + np.arange(count) + 0.5) * side - shift for first, count, side, shift in
              zip(lattice.first, lattice.count, facts.pixel, facts.rest_shifts[0], strict=True)]  # fmt: skip
        turns = phases(facts.scene, 0.0, facts.rest_depth)
        angles = at[0][:, None] * self._wavevector[:, 0] + turns, at[1][:, None] * self._wavevector[:, 1]
        columns, rows = (np.stack([np.cos(angle), np.sin(angle)], axis=-1).astype(f32) for angle in angles)
        level = f32(facts.ground.lowest)
        landed = self._landing_x, self._landing_y, self._flux
        intersections(
            columns, rows, self._amplitude, self._wavevector.astype(f32), facts.suns[0].astype(f32),
            f32(1.0 / facts.ior), level, facts.rest_shifts[0].astype(f32), facts.pixel.astype(f32), *landed,
        )  # fmt: skip
        window = -lattice.first[0], -lattice.first[1], self._n, self._m
        scale = f32(facts.sun_share * facts.irradiance[0])
        if self._form == "two_pass":
            pass_one(*landed, *window, self._between)
            pass_two(self._between, self._m, scale, self._image)
        else:
            splat(*landed, *window, scale, self._between, self._image)

    def read(self) -> np.ndarray:
        """Give the map ``[row, column]``."""
        return self._image

    @property
    def bytes(self) -> int:
        """Bytes of its buffers."""
        return sum(one.nbytes for one in (self._landing_x, self._landing_y, self._flux, self._between, self._image))


def make_peer(plan: Plan, form: str) -> Callable[[int], tuple[Callable[[], None], Callable[[], np.ndarray]]]:
    """Give what a rung of a ladder makes its frame with."""

    def make(threads: int) -> tuple[Callable[[], None], Callable[[], np.ndarray]]:
        peer = Peer(plan, form, threads)
        return peer.run, peer.read

    return make
