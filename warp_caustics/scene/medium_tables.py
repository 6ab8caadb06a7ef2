"""Measured constants of water, in the order of the colour channels: red, green, blue."""

from __future__ import annotations

from typing import Final

#: Wavelengths that stand for the channels R, G, B [nm].
CHANNEL_WAVELENGTHS: Final = (650.0, 550.0, 450.0)

#: Refractive index in air at 20 °C: Quan & Fry 1995, Eq. 3, at salinity 0 ("fresh") and 35 per mille ("sea").
IOR_TABLE: Final[dict[str, tuple[float, float, float]]] = {
    "fresh": (1.33132, 1.33434, 1.33925),
    "sea": (1.33766, 1.34079, 1.34586),
}

#: Diffuse attenuation coefficient K_d [1/m] of Jerlov's water types. It belongs to the *vertical* depth, not to the
#: refracted path: that one takes an absorption.
JERLOV_TABLE: Final[dict[str, tuple[float, float, float]]] = {
    "I": (0.36, 0.063, 0.019),
    "IA": (0.37, 0.067, 0.026),
    "IB": (0.375, 0.072, 0.036),
    "II": (0.40, 0.089, 0.068),
    "III": (0.445, 0.12, 0.135),
    "1C": (0.45, 0.12, 0.25),
    "3C": (0.46, 0.19, 0.39),
    "5C": (0.54, 0.30, 0.56),
    "7C": (0.63, 0.46, 0.89),
    "9C": (0.76, 0.63, 1.6),
}
