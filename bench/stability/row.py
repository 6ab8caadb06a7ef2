"""One row of the report: an extreme, what came out, how wrong it is, and what limits it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

import numpy as np

import warp_caustics as wc
from oracle import relative_l2
from stability.double import same_samples

METHODS = ("beam", "photon", "gather")

ADDS_UP = 1e-5
"""Share of the light that a ledger may fail to add up by: float32 sums of some thousand cells a pixel."""

THREADS = 2
"""As many as the machines have on which the figures are committed."""


@dataclass(frozen=True)
class Truth:
    """What a map should be, by a road of its own.

    Attributes
    ----------
    image : ndarray
        float64, of the map's shape.
    error : float
        Relative L2 by which it may itself be wrong; 0 for a closed form.
    total : bool
        Only its sum is known.
    """

    image: np.ndarray
    error: float = 0.0
    total: bool = False


@dataclass(frozen=True)
class Row:
    """An extreme, and what came out.

    Attributes
    ----------
    what, value, method : str
        What goes to the extreme, how far, and who computes.
    result : str
        ``"map"``, ``"refused: ..."``, or what went wrong.
    ok : bool
        Finite, with a ledger that adds up or says what is missing; or refused.
    at : float or None
        The value as a number, for the picture.
    error : float or None
        Relative L2 against the truth: of the method and its settings, and of float32.
    rounding : float or None
        Relative L2 against the same samples in float64: of float32 alone.
    light : float or None
        Difference of all the light in the map from the truth's, as a share of the sunlight that falls on it.
    unaccounted : float or None
        Share of the light that the ledger cannot say the whereabouts of.
    truth_error : float
        By which the truth may be wrong.
    least : float or None
        The map's least value over its mean: below zero where an interpolated flux dips.
    limit : str
        What limits it.
    seconds : float
        Of the frame.
    """

    what: str
    value: str
    method: str
    result: str
    ok: bool
    at: float | None = None
    error: float | None = None
    rounding: float | None = None
    light: float | None = None
    unaccounted: float | None = None
    truth_error: float = 0.0
    least: float | None = None
    limit: str = ""
    seconds: float = 0.0


def number(value: object) -> float | None:
    """Give a value as a number, where it is one."""
    return float(value) if isinstance(value, (int, float)) else None


def refused(what: str, value: object, method: str, error: wc.InputError, limit: str) -> Row:
    """Make the row of a scene that is not taken."""
    first = str(error).splitlines()[-1].strip()
    return Row(what, str(value), method, f"refused: {first}", True, number(value), limit=limit)


def measure(
    what: str,
    value: object,
    method: str,
    table: Mapping[str, Any],
    truth: Truth | None = None,
    *,
    limit: str = "",
    settings: Mapping[str, Any] | None = None,
    label: str | None = None,
    time: float = 0.0,
    same: bool = False,
) -> Row:
    """Render a scene's table by a method, and compare.

    Parameters
    ----------
    what, value
        Of the row.
    method : str
        By name.
    table : mapping
        A scene as its file would give it.
    truth : Truth, optional
        What its map should be.
    limit : str
        What limits it.
    settings : mapping, optional
        The scene's ``[method]``.
    label : str, optional
        How the row calls the method, where settings matter.
    time : float
        [s].
    same : bool
        Follow the same samples in float64 as well (``photon`` and ``gather``).
    """
    label = label or method
    try:
        renderer = wc.Renderer(wc.Scene(**{**table, "method": dict(settings or {})}), method, None, THREADS)
        renderer.render(time)
        result = renderer.result()
    except wc.InputError as error:
        return refused(what, value, label, error, limit)
    image, energy = result.caustic_map.astype(np.float64), result.energy
    finite = bool(np.isfinite(image).all()) and all(np.isfinite(v).all() for v in energy.values())
    dropped = np.max(energy.dropped) / np.max(energy.emitted) if finite and np.max(energy.emitted) > 0.0 else 0.0
    said = energy.unaccounted <= ADDS_UP or any("light" in note for note in result.warnings)
    came = "not finite" if not finite else f"map, {dropped:.0%} dropped and counted" if dropped else "map"
    row = Row(
        what, str(value), label, came, finite and said, number(value),
        unaccounted=energy.unaccounted, limit=limit, seconds=result.seconds,
    )  # fmt: skip
    if finite and image.any():
        row = replace(row, least=float(image.min() / image.mean()))
    if finite and truth is not None and truth.image.any():
        sun = renderer.plan.facts.scene.sun
        sunlight = -sun.unit_direction[2] * float(np.mean(sun.irradiance)) * image.size
        light = float((image.sum() - truth.image.sum()) / sunlight)
        error = None if truth.total else relative_l2(image, truth.image)
        row = replace(row, error=error, light=light, truth_error=truth.error)
    if finite and same and method != "beam":
        double = same_samples(table, renderer.plan, time)
        row = replace(row, rounding=relative_l2(image, double) if double.any() else None)
    return row


def each(
    methods: tuple[str, ...],
    what: str,
    value: object,
    table: Mapping[str, Any],
    truth: Truth | None = None,
    **more: Any,
) -> list[Row]:
    """Measure a scene by several methods."""
    return [measure(what, value, method, table, truth, **more) for method in methods]


def judged(
    what: str, value: object, kernel: str, error: float, allowed: float, limit: str, timed: Callable[[], Any]
) -> Row:
    """Make the row of a kernel's function that was compared with float64; ``timed`` is what is timed."""
    start = perf_counter()
    timed()
    ok = math.isfinite(error) and error <= allowed
    result = "as float64" if ok else "wrong"
    return Row(what, str(value), kernel, result, ok, number(value), error, limit=limit, seconds=perf_counter() - start)
