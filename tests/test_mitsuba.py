"""The reference against Mitsuba 3's particle tracer, pixel by pixel: ``pip install '.[peer]'``, ``pytest -m slow``.

Code that shares an author may share a misunderstanding; this peer shares none. How the two can be equal at all is in
``tests/peer``. Each pixel's difference is measured in its own expected error (a z-score): noise of the particles,
light that lands a little beside its place, and the reference's error bar. If all that differs is in there, the squares
of the scores have a mean of at most 1.
"""

from __future__ import annotations

from functools import cache
from statistics import NormalDist
from typing import Any

import numpy as np
import pytest

import warp_caustics as wc
from oracle.closed_forms import flat_water_irradiance
from oracle.surfaces import Array
from peer import Peer, PeerMap, z_scores
from warp_caustics.reference import make_reference

pytestmark = pytest.mark.slow

COARSE = 32  # pixels a side of the 4 m pool: 12.5 cm, of which the landing error of 0.2 mm is a 700th
FINE = 8  # pixels of the judged map across a coarse one; its mean over them is exact
SAMPLES, BATCHES = 256, 32  # 8192 particles a pixel: noise of 1.2 % in each, 0.04 % in the sum
FEW_BATCHES = 4  # what is wrong by several per cent shows in 1024 particles a pixel

#: Chance that a test of what is right fails. Seeds are fixed, so a run that passes goes on passing.
FALSE_ALARM = 1e-4
SIGMAS = NormalDist().inv_cdf(1.0 - 0.5 * FALSE_ALARM)
PIXELS = COARSE * COARSE
#: The mean of n squared scores has a standard deviation of sqrt(2 / n).
LARGEST_MEAN_SQUARE = 1.0 + SIGMAS * np.sqrt(2.0 / PIXELS)
#: The largest of n scores, by Bonferroni; a count of thousands is near enough to normal.
LARGEST_SCORE = NormalDist().inv_cdf(1.0 - 0.5 * FALSE_ALARM / PIXELS)
#: What is wrong must stand out by far more than what is right may.
CLEARLY_WRONG = 2.0 * LARGEST_MEAN_SQUARE


@pytest.fixture(autouse=True)
def _installed() -> None:
    pytest.importorskip("mitsuba", reason="needs the extra `peer`")


Direction = tuple[float, float, float]
POOL: Direction = (0.4, 0.2, -1.0)  # the pool's own sun, 24 degrees from the zenith
LOW: Direction = (1.5, 0.8, -1.0)  # 60 degrees: crests may shade troughs, and three times as much light is reflected


def pool(resolution: int = COARSE, sun: Direction = POOL, **medium: Any) -> dict[str, Any]:
    """Tables of the bundled pool, whose water reflects, since Mitsuba's does."""
    table = wc.load_scene("pool").model_dump(exclude_unset=True, exclude_none=True)
    table["sun"]["direction"] = sun
    table["medium"] = {**table["medium"], "fresnel": True, **medium}
    table["map"]["resolution"] = (resolution, resolution)
    return table


@cache
def traced(sun: Direction = POOL) -> tuple[Peer, PeerMap]:
    peer = Peer(pool(sun=sun))
    return peer, peer.trace(SAMPLES, BATCHES)


@cache
def judged(sun: Direction = POOL, fresnel: bool = True) -> tuple[Array, float]:
    """The reference's map of the pool in coarse pixels, and its error bar."""
    reference = make_reference(wc.Scene(**pool(COARSE * FINE, sun, fresnel=fresnel)))
    parts = reference.caustic_map.reshape(COARSE, FINE, COARSE, FINE)
    return parts.mean(axis=(1, 3)), reference.error_bar


def mean_square(peer: Peer, found: PeerMap, fresnel: bool = True) -> float:
    return float(np.mean(z_scores(peer, found, *judged(fresnel=fresnel)) ** 2))


def test_flat_water_has_its_closed_form() -> None:
    """The peer itself: |I_z| T in every pixel, so units, weights and depth of paths are what they should be."""
    table = pool(8)
    table["water"]["waves"] = []
    peer = Peer(table)
    found = peer.trace(SAMPLES, BATCHES)
    light_z, ior = wc.Scene(**table).sun.unit_direction[2], table["medium"]["ior"]
    expected = np.full((8, 8), flat_water_irradiance(light_z, ior, depth=table["water"]["level"], fresnel=True))
    scores = z_scores(peer, found, expected, 0.0)
    assert np.abs(scores).max() < LARGEST_SCORE
    assert abs(scores.sum()) < SIGMAS * np.sqrt(scores.size)


@pytest.mark.parametrize("sun", [POOL, LOW], ids=["pool", "low"])
def test_every_pixel_agrees(sun: Direction) -> None:
    scores = z_scores(*traced(sun), *judged(sun))
    assert np.mean(scores**2) < LARGEST_MEAN_SQUARE
    assert np.abs(scores).max() < LARGEST_SCORE


@pytest.mark.parametrize("sun", [POOL, LOW], ids=["pool", "low"])
def test_energy_agrees(sun: Direction) -> None:
    """Within the noise of all particles, and what the reference's error bar can come to in a sum: as much at most."""
    _, found = traced(sun)
    expected, error_bar = judged(sun)
    noise = np.sqrt(found.variance_ratio * expected.sum()) / expected.sum()
    difference = found.irradiance.mean() / expected.mean() - 1.0
    assert abs(difference) < SIGMAS * np.hypot(noise, error_bar)


def test_particles_are_independent_and_weigh_the_same() -> None:
    """What the scores rest on: variance between batches is in proportion to the mean, bright or dark."""
    _, found = traced()
    spread = found.batches.var(axis=0, ddof=1) / (BATCHES * found.variance_ratio * found.irradiance)
    expected = np.sqrt(2.0 / (BATCHES - 1) / (PIXELS / 2))  # of a mean over half the pixels
    bright = found.irradiance > np.median(found.irradiance)
    assert abs(spread[bright].mean() - 1.0) < SIGMAS * expected
    assert abs(spread[~bright].mean() - 1.0) < SIGMAS * expected


@pytest.mark.parametrize("ior", [1.30, 1.36])
def test_another_index_is_seen(ior: float) -> None:
    peer = Peer(pool(ior=ior))
    assert mean_square(peer, peer.trace(SAMPLES, FEW_BATCHES)) > CLEARLY_WRONG


def test_a_reference_without_fresnel_is_seen() -> None:
    """Two per cent of the light, in every pixel."""
    assert mean_square(*traced(), fresnel=False) > CLEARLY_WRONG


@pytest.mark.parametrize("turn", [np.flipud, np.fliplr, np.transpose])
def test_a_turned_map_is_seen(turn: Any) -> None:
    peer, found = traced()
    expected, error_bar = judged()
    assert np.mean(z_scores(peer, found, turn(expected), error_bar) ** 2) > CLEARLY_WRONG


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"medium": {"fresnel": False}}, "fresnel"),
        ({"medium": {"absorption": 0.1}}, "absorption"),
        ({"sun": {"irradiance": (1.0, 0.9, 0.8)}}, "colour"),
        ({"map": {"resolution": (32, 16)}}, "square"),
        ({"water": {"level": 0.4}}, "sensor"),
    ],
)
def test_what_cannot_be_shared_is_refused(change: dict[str, Any], words: str) -> None:
    table = pool()
    for name, part in change.items():
        table[name] = {**table[name], **part}
    with pytest.raises(ValueError, match=words):
        Peer(table)
