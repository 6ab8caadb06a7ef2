"""Surfaces in closed form: a sloping plane plus a sum of sines. Water and terrain are both of this kind."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

GRAVITY = 9.81  # [m/s²]


def angular_frequency(wavenumber: npt.ArrayLike, depth: float) -> Array:
    """Give the angular frequency [rad/s] of gravity waves over a finite depth: ω² = g k tanh(k d)."""
    k = np.asarray(wavenumber, dtype=np.float64)
    return np.asarray(np.sqrt(GRAVITY * k * np.tanh(k * depth)), dtype=np.float64)


@dataclass(frozen=True)
class Surface:
    """z = base + slope·(x, y) + Σ a sin(k·(x, y) + φ).

    Attributes
    ----------
    base : float
        Height of the mean plane at the world origin [m].
    slope : (float, float)
        Slope of the mean plane.
    amplitude, wavevector, phase : arrays of shape [n], [n, 2], [n]
        The sines [m], [rad/m], [rad].
    """

    base: float
    slope: tuple[float, float]
    amplitude: Array
    wavevector: Array
    phase: Array

    @property
    def wavenumber(self) -> Array:
        """Length of each wavevector [rad/m]."""
        return np.asarray(np.hypot(self.wavevector[:, 0], self.wavevector[:, 1]), dtype=np.float64)

    @property
    def swing(self) -> float:
        """Largest possible distance from the mean plane, Σ|a| [m]."""
        return float(np.abs(self.amplitude).sum())

    @property
    def slope_bound(self) -> float:
        """Largest possible slope, |slope| + Σ|a||k|."""
        return float(np.hypot(*self.slope) + (np.abs(self.amplitude) * self.wavenumber).sum())

    @property
    def shortest_wave(self) -> float:
        """Shortest wave length [m], infinite for a plane."""
        k = self.wavenumber[self.amplitude != 0.0]
        k = k[k > 0.0]
        return float(2.0 * np.pi / k.max()) if k.size else float("inf")

    def plane(self, x: npt.ArrayLike, y: npt.ArrayLike) -> Array:
        """Give the height of the mean plane [m]."""
        return np.asarray(self.base + self.slope[0] * np.asarray(x) + self.slope[1] * np.asarray(y))

    def height(self, x: Array, y: Array) -> Array:
        """Give the height [m] at scattered points of any shape."""
        z = self.plane(x, y) + np.zeros(np.broadcast(x, y).shape)
        for a, (kx, ky), phase in zip(self.amplitude, self.wavevector, self.phase, strict=True):
            z += a * np.sin(kx * x + ky * y + phase)
        return z

    def height_and_slopes(self, x: Array, y: Array) -> tuple[Array, Array, Array]:
        """Give height, z_x and z_y at scattered points of any shape."""
        shape = np.broadcast(x, y).shape
        z = self.plane(x, y) + np.zeros(shape)
        zx = np.full(shape, self.slope[0])
        zy = np.full(shape, self.slope[1])
        for a, (kx, ky), phase in zip(self.amplitude, self.wavevector, self.phase, strict=True):
            angle = kx * x + ky * y + phase
            z += a * np.sin(angle)
            c = a * np.cos(angle)
            zx += kx * c
            zy += ky * c
        return z, zx, zy

    def lattice(self, x: Array, y: Array) -> tuple[Array, Array, Array]:
        """Give height, z_x and z_y on the lattice y × x, each [len(y), len(x)].

        The sines separate, sin(p + q) = sin p cos q + cos p sin q, so a lattice is three small matrix products.
        """
        kx, ky = self.wavevector[:, 0], self.wavevector[:, 1]
        p = kx * x[:, None] + self.phase
        q = ky * y[:, None]
        sine = np.concatenate([np.sin(p), np.cos(p)], axis=1)
        cosine = np.concatenate([np.cos(p), -np.sin(p)], axis=1)
        rows = np.concatenate([np.cos(q), np.sin(q)], axis=1)
        a = np.tile(self.amplitude, 2)
        z = self.plane(x[None, :], y[:, None]) + (rows * a) @ sine.T
        zx = self.slope[0] + (rows * (a * np.tile(kx, 2))) @ cosine.T
        zy = self.slope[1] + (rows * (a * np.tile(ky, 2))) @ cosine.T
        return z, zx, zy
