"""Light to 8-bit colour: a colour map for maps of one channel, a white value for three, a film for pictures."""

from __future__ import annotations

import functools
import math
from typing import Any

import numpy as np
import numpy.typing as npt

from warp_caustics.errors import InputError

WHITE_PERCENTILE = 99.9
"""White stands here and above: the peaks on a caustic are a few pixels, and rise without bound with the resolution."""

BLACK_PERCENTILE = 0.1
"""Lower end of the values of a calm map, by the same argument."""

CALM = 0.5
"""A map whose darkest pixels reach this share of its brightest ones is shown from its darkest, not from zero."""

UNIFORM = 1e-3
"""Relative range under which a map is taken for uniform: to stretch less would show rounding and noise as waves."""

DARKEST_WHITE, BRIGHTEST_WHITE = float(np.finfo(np.float32).tiny), float(np.finfo(np.float32).max)
"""White stays where float32 divides without loss: not among its denormals, nor past its end."""

COLOUR_MAP = "YlGnBu_r"
"""Matplotlib's name. Deep blue through the colours of shallow water to near white, lightness rising all the way."""

NOT_FINITE_COLOUR = (255, 0, 160)
"""Pixels that are NaN or infinite stand out; the colour map has no magenta."""

MATT_WHITE = 0.8
"""What a white matt surface that faces the sun is exposed to, in the units of `FILM`: its shoulder then has room for
sunlight that the water has focused."""

FILM = (2.51, 0.03, 2.43, 0.59, 0.14)
"""A film's response to x: (a x^2 + b x) / (c x^2 + d x + e), Narkowicz' fit of the ACES curve (2015)."""

BRIGHTEST_EXPOSED = 1e6
"""Far past white, and its square no overflow."""

LEVELS = 256
RGB = 3

# sRGB transfer function, IEC 61966-2-1.
SRGB_LINEAR_LIMIT = 0.0031308
SRGB_LINEAR_SLOPE = 12.92
SRGB_OFFSET = 0.055
SRGB_GAMMA = 2.4

LUMINANCE = (0.2126, 0.7152, 0.0722)
"""Shares of red, green and blue in luminance, ITU-R BT.709: the primaries of sRGB."""


def is_colour(image: npt.NDArray[Any]) -> bool:
    """Tell [rows, columns, 3] from [rows, columns]; anything else is refused with an InputError."""
    if image.size and image.ndim == 2:
        return False
    if image.size and image.ndim == 3 and image.shape[2] == RGB:
        return True
    raise InputError(f"a map is [rows, columns] or [rows, columns, 3] with at least one pixel, this one {image.shape}")


def value_limits(image: npt.NDArray[np.floating[Any]]) -> tuple[float, float]:
    """Values that a picture shows as black and as white, robust against a few peaks, NaN and infinity.

    Black is zero, no light, save for calm water of one channel, which would be all pale. Frames of a sequence should
    share the limits of the first, or the picture flickers.

    Parameters
    ----------
    image
        [rows, columns] or [rows, columns, 3].

    Returns
    -------
    low, high : float
        In the units of the map; 0 <= low < high.
    """
    colour = is_colour(image)
    brightest = image.max(axis=2) if colour else image
    values = np.maximum(brightest[np.isfinite(brightest)], 0.0)
    if values.size == 0 or values.max() <= DARKEST_WHITE:
        return 0.0, 1.0
    low, high = (float(v) for v in np.percentile(values, (BLACK_PERCENTILE, WHITE_PERCENTILE)))
    if high <= DARKEST_WHITE:  # fewer pixels are lit than the percentile leaves out
        return 0.0, float(values.max())
    if high - low < UNIFORM * high:
        return 0.0, min(2.0 * high, BRIGHTEST_WHITE)  # a uniform map comes out in the middle of the scale
    return (0.0 if colour or low < CALM * high else low), high


def to_scale(values: npt.ArrayLike, low: float, high: float) -> npt.NDArray[np.floating[Any]]:
    """Place on the colour scale, 0 to 1: even steps of the square root, near to even steps for the eye.

    On an even scale of the values themselves the floor between caustics would be almost black.
    """
    black, white = math.sqrt(low), math.sqrt(high)
    return (np.sqrt(np.clip(values, low, high)) - black) / (white - black)


def from_scale(place: npt.ArrayLike, low: float, high: float) -> npt.NDArray[np.float64]:
    """Undo `to_scale`: the value at a place between 0 and 1 on the colour scale."""
    black, white = math.sqrt(low), math.sqrt(high)
    return (black + np.asarray(place, dtype=np.float64) * (white - black)) ** 2


def to_rgb8(image: npt.NDArray[np.floating[Any]], limits: tuple[float, float]) -> npt.NDArray[np.uint8]:
    """Colour a map.

    One channel goes through the colour map, by the square root of its values. Three are divided by the white value,
    clipped, and encoded as sRGB. Pixels that are not finite become `NOT_FINITE_COLOUR`.

    Parameters
    ----------
    image
        [rows, columns] or [rows, columns, 3].
    limits
        Values shown as black and as white; see `value_limits`.

    Returns
    -------
    numpy.ndarray
        uint8 [rows, columns, 3], rows in the order of `image`.
    """
    low, high = limits
    colour = is_colour(image)
    finite = np.isfinite(image)
    values = np.where(finite, image, 0.0)
    if colour:
        finite = finite.all(axis=2)
        coloured = _to_level(_encode_srgb(np.clip(values, 0.0, high) / high))
    else:
        coloured = _colour_table()[_to_level(to_scale(values, low, high))]
    coloured[~finite] = NOT_FINITE_COLOUR
    return coloured


def to_srgb8(image: npt.NDArray[np.floating[Any]], white: float) -> npt.NDArray[np.uint8]:
    """Expose a map and encode it as sRGB, one channel as one: what a program takes for light, and nobody for a chart.

    Parameters
    ----------
    image
        [rows, columns] or [rows, columns, 3].
    white
        Value that becomes white; what is above is clipped, and what is not finite is black.

    Returns
    -------
    numpy.ndarray
        uint8, of the image's shape.

    Raises
    ------
    InputError
        `image` is no map, or white is no value.
    """
    is_colour(image)
    if not 0.0 < white < math.inf:
        raise InputError(f"the white of a picture must be a finite value above 0, not {white}")
    return _to_level(_encode_srgb(np.clip(np.where(np.isfinite(image), image, 0.0), 0.0, white) / white))


def expose(radiance: npt.NDArray[np.floating[Any]], irradiance: float, stops: float = 0.0) -> npt.NDArray[np.uint8]:
    """Colour a picture: exposure, the response of a film channel by channel (`FILM`), sRGB.

    The exposure is that of a light meter held into the sun, so that it is the same for every frame and every method.

    Parameters
    ----------
    radiance
        Linear [rows, columns, 3].
    irradiance
        Of the sun, in the unit of the radiance times steradian.
    stops
        Added to the exposure; each doubles the light.

    Returns
    -------
    numpy.ndarray
        uint8 [rows, columns, 3]; pixels that are not finite become `NOT_FINITE_COLOUR`.
    """
    finite = np.isfinite(radiance).all(axis=2)
    scale = MATT_WHITE * 2.0**stops * math.pi / irradiance if irradiance > 0.0 else 0.0
    x = np.clip(scale * np.where(finite[..., None], radiance, 0.0), 0.0, BRIGHTEST_EXPOSED)
    a, b, c, d, e = FILM
    shown = _to_level(_encode_srgb(np.clip(x * (a * x + b) / (x * (c * x + d) + e), 0.0, 1.0)))
    shown[~finite] = NOT_FINITE_COLOUR
    return shown


def _to_level(share: npt.NDArray[np.floating[Any]]) -> npt.NDArray[np.uint8]:
    """Round 0 to 1 to the nearest of 256 levels."""
    return (share * (LEVELS - 1) + 0.5).astype(np.uint8)


def _encode_srgb(linear: npt.NDArray[np.floating[Any]]) -> npt.NDArray[np.floating[Any]]:
    """Encode linear light, 0 to 1, as sRGB."""
    curve = (1.0 + SRGB_OFFSET) * linear ** (1.0 / SRGB_GAMMA) - SRGB_OFFSET
    return np.where(linear <= SRGB_LINEAR_LIMIT, SRGB_LINEAR_SLOPE * linear, curve)


def decode_srgb(encoded: npt.NDArray[np.floating[Any]]) -> npt.NDArray[np.floating[Any]]:
    """Decode sRGB, 0 to 1, to linear light."""
    curve = ((encoded + SRGB_OFFSET) / (1.0 + SRGB_OFFSET)) ** SRGB_GAMMA
    return np.where(encoded <= SRGB_LINEAR_LIMIT * SRGB_LINEAR_SLOPE, encoded / SRGB_LINEAR_SLOPE, curve)


@functools.cache
def _colour_table() -> npt.NDArray[np.uint8]:
    """Colours of the levels, uint8 [256, 3]: matplotlib's data alone, none of its plotting."""
    from matplotlib import colormaps

    return np.asarray(colormaps[COLOUR_MAP](np.linspace(0.0, 1.0, LEVELS), bytes=True)[:, :RGB], dtype=np.uint8)
