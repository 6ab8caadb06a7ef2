"""An independent float64 reference in plain NumPy, for tests.

It shares no code with the library: it works from the physics alone (Snell, Fresnel, flux over area) and takes the
library's scene as a plain dictionary, so that one description drives both.
"""

from __future__ import annotations

from oracle.cases import CASES, Case
from oracle.clip import deposit_points, deposit_triangles
from oracle.closed_forms import (
    first_focus_depth,
    flat_water_irradiance,
    sine_focus_depth,
    sine_folds,
    sine_irradiance,
    sine_landing,
)
from oracle.optics import path_transmittance, refract, transmittance
from oracle.photons import PhotonEstimate, photon_map
from oracle.reference import Reference, ideal_map, reference_map, relative_l2, triangle_map
from oracle.setting import Setting, read_setting
from oracle.store import StoredReference, load_reference
from oracle.surfaces import Surface, angular_frequency

__all__ = [
    "CASES",
    "Case",
    "PhotonEstimate",
    "Reference",
    "Setting",
    "StoredReference",
    "Surface",
    "angular_frequency",
    "deposit_points",
    "deposit_triangles",
    "first_focus_depth",
    "flat_water_irradiance",
    "ideal_map",
    "load_reference",
    "path_transmittance",
    "photon_map",
    "read_setting",
    "reference_map",
    "refract",
    "relative_l2",
    "sine_focus_depth",
    "sine_folds",
    "sine_irradiance",
    "sine_landing",
    "transmittance",
    "triangle_map",
]
