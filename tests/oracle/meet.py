"""Where a ray meets a surface in closed form."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from oracle.surfaces import Array, Surface

Flags = npt.NDArray[np.bool_]

MARCH_SHARE = 1e-3  # least step of the march, in shortest waves: what it may step over is 1e-6 of a wave high
MARCH_LIMIT = 20000  # steps after which a ray is said to miss; the least steps alone span 20 waves
ROOT_STEPS = 80  # bisection alone reaches float64 in 60
ROOT_SHARE = 1e-14  # width of a closed bracket, relative to the path
CROSS_STEPS = 24  # samples in a shortest wave of a crossing test, whose least gaps are refined by parabolas
SURE = 0.05  # least rate of fall, relative to the ray's own, at which its bound on the path is worth bisecting
BEYOND = 1.001  # a bracket ends this much past its bound, which rounding must not cut short
TINY = 1e-300  # keeps a bracket open where a ray starts on the floor


def meet_floor(floor: Surface, start: Array, ray: Array) -> tuple[Array, Flags]:
    """Give the path length to the first meeting with the floor from points on or above it, and whether there is one.

    ``start`` and unit ``ray`` are [3, n]. A plane is solved in closed form. Elsewhere the ray marches by its height
    over the floor divided by the fastest rate at which that can shrink, so that no meeting is stepped over, and a
    bracketed Newton closes in.
    """
    (x, y, z), (rx, ry, rz) = start, ray
    gap = z - floor.height(x, y)
    if floor.amplitude.size == 0:
        fall = -(rz - floor.slope[0] * rx - floor.slope[1] * ry)
        hit = fall > 0.0
        return np.where(hit, gap / np.where(hit, fall, 1.0), 0.0), hit
    slowest = -rz - floor.slope_bound * np.hypot(rx, ry)
    length, hit = np.zeros(x.shape), np.ones(x.shape, dtype=np.bool_)
    low, high = np.zeros(x.shape), np.zeros(x.shape)
    sure = slowest > SURE * -rz  # the gap shrinks all the way: one meeting, and a bound on how far
    high[sure] = BEYOND * np.maximum(gap[sure], 0.0) / slowest[sure] + TINY
    todo = np.flatnonzero(~sure)
    if todo.size:
        low[todo], high[todo], hit[todo] = _march(floor, start[:, todo], ray[:, todo])
    go = np.flatnonzero(hit)
    length[go] = _close_in(floor, start[:, go], ray[:, go], low[go], high[go])
    return length, hit


def _march(floor: Surface, start: Array, ray: Array) -> tuple[Array, Array, Flags]:
    """Bracket the first change of sign of the height over the floor along each ray."""
    (x, y, z), (rx, ry, rz) = start, ray
    fastest = -rz + floor.slope_bound * np.hypot(rx, ry)
    least = MARCH_SHARE * floor.shortest_wave
    fall = -(rz - floor.slope[0] * rx - floor.slope[1] * ry)
    above = z - floor.plane(x, y) - floor.swing
    t = np.maximum(above, 0.0) / np.where(fall > 0.0, fall, np.inf)  # over every hill until here
    low, high, hit = np.zeros(x.shape), np.zeros(x.shape), np.zeros(x.shape, dtype=np.bool_)
    live = np.arange(x.size)
    for _ in range(MARCH_LIMIT):
        gap = z + t * rz - floor.height(x + t * rx, y + t * ry)
        below = gap < 0.0
        if below.any():
            high[live[below]] = t[below]
            hit[live[below]] = True
            on = ~below
            x, y, z, rx, ry, rz, fastest, t, gap = (a[on] for a in (x, y, z, rx, ry, rz, fastest, t, gap))
            live = live[on]
            if not live.size:
                break
        low[live] = t
        t = t + np.maximum(gap / fastest, least)
    return low, high, hit


def _close_in(floor: Surface, start: Array, ray: Array, low: Array, high: Array) -> Array:
    """Newton's method inside a bracket that shrinks; a step that would leave it is a bisection instead."""
    (x, y, z), (rx, ry, rz) = start, ray
    low, high = low.copy(), high.copy()
    t = 0.5 * (low + high)
    live = np.arange(x.size)
    for _ in range(ROOT_STEPS):
        at = t[live]
        h, hx, hy = floor.height_and_slopes(x[live] + at * rx[live], y[live] + at * ry[live])
        gap = z[live] + at * rz[live] - h
        above = gap >= 0.0
        low[live[above]] = at[above]
        high[live[~above]] = at[~above]
        rate = rz[live] - hx * rx[live] - hy * ry[live]
        with np.errstate(divide="ignore", invalid="ignore"):
            newton = at - gap / rate
        near = np.abs(newton - at) <= ROOT_SHARE * high[live]
        inside = near | ((newton > low[live]) & (newton < high[live]))
        t[live] = np.where(inside, newton, 0.5 * (low[live] + high[live]))
        done = near | (high[live] - low[live] <= ROOT_SHARE * high[live])
        live = live[~done]
        if not live.size:
            break
    return t


def crosses(water: Surface, start: Array, ray: Array, end: Array, side: float) -> Flags:
    """Tell whether rays that start on the water cross it again before path length ``end``.

    ``start`` and unit ``ray`` are [3, n], ``end`` [n]. ``side`` is 1 for a ray that starts upward into the air, -1 for
    one that starts downward into the water.
    """
    (x, y, z), (rx, ry, rz) = start, ray
    crossed = np.zeros(x.shape, dtype=np.bool_)
    edge = water.base + side * water.swing
    across = np.hypot(rx, ry)
    with np.errstate(divide="ignore", invalid="ignore"):
        step = water.shortest_wave / CROSS_STEPS / across
        # past every crest, or trough, nothing is met; one step more, so that the last dip has both its sides
        clear = np.where(side * rz > 0.0, (edge - z) / rz, np.inf) + step
        end = np.minimum(end, clear)
        count = np.ceil(end / step)
        step = end / count  # even steps, as the parabola wants
    live = np.flatnonzero((across > 0.0) & (count >= 1.0))
    before, last = np.zeros(live.size), np.zeros(live.size)
    i = 0
    while live.size:
        i += 1
        t = i * step[live]
        gap = side * (z[live] + t * rz[live] - water.height(x[live] + t * rx[live], y[live] + t * ry[live]))
        crossed[live[gap < 0.0]] = True
        if i > 1:
            bend = before - 2.0 * last + gap
            dip = np.flatnonzero((before >= last) & (last <= gap) & (gap >= 0.0) & (bend > 0.0))
            j = live[dip]
            least = t[dip] - step[j] * (1.0 + (gap - before)[dip] / (2.0 * bend[dip]))
            h, hx, hy = water.height_and_slopes(x[j] + least * rx[j], y[j] + least * ry[j])
            slide = (rz[j] - hx * rx[j] - hy * ry[j]) * step[j]  # what slope is left there says how far the dip goes on
            crossed[j] |= side * (z[j] + least * rz[j] - h) - slide**2 / (2.0 * bend[dip]) < 0.0
        on = ~crossed[live] & (i < count[live])
        before, last, live = last[on], gap[on], live[on]
    return crossed
