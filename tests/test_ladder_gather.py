"""The gather's ladder: every rung that runs here gives the map of the first; the peer, where it is installed."""

from __future__ import annotations

import importlib.util

import numpy as np
import pytest
from ladder_gather import FORMS, PEER_FORMS, WINDOWS, rungs

PIXELS = 40


def maps(ladder):
    """The map of each rung that runs, by name, with its tolerance."""
    made = {}
    for rung in ladder:
        if rung.make is not None:
            run, read = rung.make(1)
            run()
            made[rung.name] = read().astype(np.float64), rung.tolerance
    return made


def assert_one_sum(ladder):
    found = maps(ladder)
    first, _ = found[ladder[0].name]
    assert first.std() > 0.01
    for name, (values, tolerance) in found.items():
        assert np.linalg.norm(values - first) <= tolerance * np.linalg.norm(first), name
    return found


def test_every_rung_is_the_published_sum(device, monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    ladders = rungs(PIXELS, device)
    assert len(ladders) == len(WINDOWS)
    for ladder in ladders:
        assert ladder[0].name.startswith("two_pass")
        assert len(assert_one_sum(ladder)) == len(FORMS) - 1  # tiles need a GPU, rows a CPU
        assert all(rung.traffic > 0 for rung in ladder if rung.make)
        left_out = [rung.name for rung in ladder if rung.make is None]
        assert sum("not installed" in name for name in left_out) == (len(PEER_FORMS) if device == "cpu" else 0)


@pytest.mark.slow
def test_the_peer_is_the_published_sum():
    pytest.importorskip("numba", reason="needs the extra `peer`")
    for ladder in rungs(PIXELS, "cpu"):
        assert sum(name.startswith("Numba") for name in assert_one_sum(ladder)) == len(PEER_FORMS)
