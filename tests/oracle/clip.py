"""Exact deposit of triangles of flux into unit pixels.

A triangle that crosses a pixel line is cut there into three; the cuts go on until each part lies in one pixel. A part's
share of the flux follows from where its edges are cut, (s t), (1 - s) and s (1 - t), never from an area: shares add up
to one for any triangle, turned either way, thin or of no area at all, which spreads its flux along its line.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from oracle.surfaces import Array

Index = npt.NDArray[np.int64]
Parts = tuple[Array, Array, Array, Index]  # x [3, n], y [3, n], share [n], owner [n]


def deposit_points(image: Array, x: Array, y: Array, flux: Array) -> Array:
    """Add point fluxes [channels, n] at pixel coordinates to an image, as below; gives the flux outside."""
    channels, rows, columns = image.shape
    inside = (x >= 0.0) & (x < columns) & (y >= 0.0) & (y < rows)
    pixel = np.floor(y[inside]).astype(np.int64) * columns + np.floor(x[inside]).astype(np.int64)
    for channel in range(channels):
        image[channel] += np.bincount(pixel, flux[channel, inside], rows * columns).reshape(rows, columns)
    return np.asarray(flux[:, ~inside].sum(axis=1))


def deposit_triangles(image: Array, x: Array, y: Array, flux: Array) -> Array:
    """Add triangles of flux to an image, by exact overlap.

    Parameters
    ----------
    image : array [channels, rows, columns]
        Added to, in place. Pixel (r, c) is the unit square from (c, r) to (c + 1, r + 1).
    x, y : arrays [3, n]
        Corners in pixel coordinates.
    flux : array [channels, n]
        Flux of each triangle, spread evenly over it.

    Returns
    -------
    array [channels]
        The flux that fell outside the image.
    """
    channels, rows, columns = image.shape
    outside = np.zeros(channels)
    if not np.isfinite(x).all() or not np.isfinite(y).all():
        raise ValueError("triangle corners must be finite")
    flux = np.asarray(flux, dtype=np.float64)
    parts: Parts = (x, y, np.ones(x.shape[1]), np.arange(x.shape[1]))
    while parts[2].size:
        x, y, share, owner = parts
        x_low, x_high, y_low, y_high = x.min(axis=0), x.max(axis=0), y.min(axis=0), y.max(axis=0)
        out = (x_high <= 0.0) | (x_low >= columns) | (y_high <= 0.0) | (y_low >= rows)
        first, last = np.floor(x_low), np.ceil(x_high)
        bottom, top = np.floor(y_low), np.ceil(y_high)
        whole = (last - first <= 1.0) & (top - bottom <= 1.0) & ~out
        pixel = (bottom[whole] * columns + first[whole]).astype(np.int64)
        for channel in range(channels):
            amount = share[whole] * flux[channel, owner[whole]]
            image[channel] += np.bincount(pixel, amount, rows * columns).reshape(rows, columns)
            outside[channel] += (share[out] * flux[channel, owner[out]]).sum()
        rest = ~(whole | out)
        wide = (last - first >= top - bottom)[rest]
        cut_x = _cut(first[rest], last[rest], columns)
        cut_y = _cut(bottom[rest], top[rest], rows)
        x, y, share, owner = x[:, rest], y[:, rest], share[rest], owner[rest]
        upright = _split(x[:, wide], y[:, wide], share[wide], owner[wide], cut_x[wide])
        level = _split(y[:, ~wide], x[:, ~wide], share[~wide], owner[~wide], cut_y[~wide])
        parts = (
            np.concatenate([upright[0], level[1]], axis=1),
            np.concatenate([upright[1], level[0]], axis=1),
            np.concatenate([upright[2], level[2]]),
            np.concatenate([upright[3], level[3]]),
        )
    return outside


def _cut(first: Array, last: Array, count: int) -> Array:
    """Choose the pixel line to cut at: the middle one, kept inside the image so that what is outside goes first."""
    middle = np.floor(0.5 * (first + last))
    return np.asarray(np.clip(middle, np.maximum(first + 1.0, 0.0), np.minimum(last - 1.0, float(count))))


def _split(x: Array, y: Array, share: Array, owner: Index, cut: Array) -> Parts:
    """Cut triangles at x = cut, a line strictly inside each, into three parts."""
    below = x < cut
    lone = np.where(below.sum(axis=0) == 1, below, ~below).argmax(axis=0)  # the corner alone on its side
    order = (lone + np.arange(3)[:, None]) % 3
    (xa, xb, xc), (ya, yb, yc) = np.take_along_axis(x, order, 0), np.take_along_axis(y, order, 0)
    s = (cut - xa) / (xb - xa)
    t = (cut - xa) / (xc - xa)
    ys, yt = ya + s * (yb - ya), ya + t * (yc - ya)
    parts_x = np.concatenate([[xa, cut, cut], [cut, xb, xc], [cut, xc, cut]], axis=1)
    parts_y = np.concatenate([[ya, ys, yt], [ys, yb, yc], [ys, yc, yt]], axis=1)
    parts_share = np.concatenate([share * s * t, share * (1.0 - s), share * s * (1.0 - t)])
    kept = parts_share > 0.0
    return parts_x[:, kept], parts_y[:, kept], parts_share[kept], np.tile(owner, 3)[kept]
