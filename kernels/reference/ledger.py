"""The reference's own ledger: float64 sums ``[entry * channels + channel, bin]`` in watts at unit irradiance."""

import functools

import warp as wp

from .ray import DROPPED, DRY, LEAVES, SHADED, UNLIT, Ray

ENTRIES = (
    "emitted", "received", "reflected", "absorbed", "outside_map", "left_water", "blocked", "dropped", "over_lit"
)  # fmt: skip
"""Names of the entries, in the order of their rows."""

EMITTED, RECEIVED, REFLECTED, ABSORBED, OUTSIDE_MAP, LEFT_WATER, BLOCKED, LOST, OVER_LIT = range(len(ENTRIES))

BINS = 256
"""Bins of an entry, which keep the threads of a GPU out of each other's way."""


@functools.cache
def make_book(channels: int, over_lit: bool) -> wp.Function:
    """Enter a ray that stands for ``area`` [m^2], of which the share ``inside`` fell into the map."""

    @wp.func
    def enter(ledger: wp.array2d[wp.float64], entry: int, channel: int, bin: int, watts: wp.float64):
        wp.atomic_add(ledger, entry * wp.static(channels) + channel, bin, watts)

    @wp.func
    def book(ledger: wp.array2d[wp.float64], thread: int, ray: Ray, area: wp.float64, inside: wp.float64):
        bin = thread & (wp.static(BINS) - 1)
        if ray.fate == DRY:
            return
        for c in range(wp.static(channels)):
            if ray.fate == UNLIT:
                # With shadows off, what lies behind a crest is lit by light that the crest has taken already.
                if wp.static(over_lit):
                    enter(ledger, wp.static(OVER_LIT), c, bin, -ray.incident * area)
            else:
                enter(ledger, wp.static(EMITTED), c, bin, ray.incident * area)
                if ray.fate == SHADED:
                    enter(ledger, wp.static(BLOCKED), c, bin, ray.incident * area)
                elif ray.fate == DROPPED:
                    enter(ledger, wp.static(LOST), c, bin, ray.incident * area)
                else:
                    enter(ledger, wp.static(REFLECTED), c, bin, (ray.incident - ray.transmitted) * area)
                    if ray.fate == LEAVES:
                        enter(ledger, wp.static(LEFT_WATER), c, bin, ray.transmitted * area)
                    else:
                        enter(ledger, wp.static(ABSORBED), c, bin, (ray.transmitted - ray.arrived[c]) * area)
                        enter(ledger, wp.static(RECEIVED), c, bin, ray.arrived[c] * area * inside)
                        enter(
                            ledger, wp.static(OUTSIDE_MAP), c, bin,
                            ray.arrived[c] * area * (wp.float64(1.0) - inside),
                        )  # fmt: skip

    return book
