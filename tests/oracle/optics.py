"""Refraction, transmittance and absorption in float64."""

from __future__ import annotations

import numpy as np

from oracle.surfaces import Array


def refract(direction: Array, normal: Array, ior: float) -> Array:
    """Refract air light into water by Snell's law in vector form.

    Parameters
    ----------
    direction : array [3]
        Unit direction of travel.
    normal : array [..., 3]
        Unit normals, up, against the light.
    ior : float
        Refractive index of the water, at least 1: there is no total reflection on the way in.

    Returns
    -------
    array [..., 3]
        Unit refracted directions.
    """
    eta = 1.0 / ior
    c = -(normal @ direction)
    root = np.sqrt(1.0 - eta * eta * (1.0 - c * c))
    return np.asarray(eta * direction + (eta * c - root)[..., None] * normal)


def refract_slopes(direction: Array, zx: Array, zy: Array, ior: float) -> tuple[Array, Array, Array, Array]:
    """Refract at a height field of slopes z_x, z_y: gives R_x, R_y, R_z and the cosine of incidence."""
    scale = 1.0 / np.sqrt(1.0 + zx * zx + zy * zy)
    c = (zx * direction[0] + zy * direction[1] - direction[2]) * scale
    eta = 1.0 / ior
    # a surface that faces away takes in no light, but keeps a finite direction: it is a corner of cells that do
    facing = np.maximum(c, 0.0)
    along = (eta * facing - np.sqrt(1.0 - eta * eta * (1.0 - facing * facing))) * scale
    return eta * direction[0] - along * zx, eta * direction[1] - along * zy, eta * direction[2] + along, c


def transmittance(cos_incidence: Array, ior: float) -> Array:
    """Give Fresnel's transmittance of unpolarised light from air into water; 0 where it grazes or faces away."""
    ci = np.clip(cos_incidence, 0.0, 1.0)
    ct = np.sqrt(1.0 - (1.0 - ci * ci) / ior**2)
    rs = (ci - ior * ct) / (ci + ior * ct)
    rp = (ior * ci - ct) / (ior * ci + ct)
    return np.asarray(1.0 - 0.5 * (rs * rs + rp * rp))


def path_transmittance(absorption: Array, length: Array) -> Array:
    """Give exp(-c L) by channel, [channels, ...], for absorption [channels] and path lengths [...]."""
    return np.asarray(np.exp(-np.multiply.outer(absorption, length)))
