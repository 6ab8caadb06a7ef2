"""The energy ledger: where the light went, counted by the kernels that saw it go.

A ledger is a float64 array ``[entry * channels + channel, bin]``; the bins only keep threads out of each other's way
and are added up at the end. Its unit is the flux of one unshaded cell (or photon) at unit irradiance.
"""

import functools

import warp as wp

from .deposit import FLUX
from .photon import BLOCKED, DRY, LEFT, UNLIT
from .spec import Spec

EMITTED = wp.constant(0)
REFLECTED = wp.constant(1)
ABSORBED = wp.constant(2)
OUTSIDE_MAP = wp.constant(3)
LEFT_WATER = wp.constant(4)
SHADED = wp.constant(5)
MISSED_BY_WINDOW = wp.constant(6)
DROPPED = wp.constant(7)
OVER_LIT = wp.constant(8)

ENTRIES = ("emitted", "reflected", "absorbed", "outside_map", "left_water", "blocked", "missed_by_window", "dropped",
           "over_lit")  # fmt: skip
"""Names of the entries, in the order of their numbers."""

BINS = 256
"""Bins of an entry: enough that the threads of a warp, and neighbouring warps, seldom meet."""


@wp.func
def tally(ledger: wp.array2d[wp.float64], row: int, bin: int, amount: float):
    """Add an amount to a row of the ledger."""
    if amount != 0.0:
        wp.atomic_add(ledger, row, bin & (wp.static(BINS) - 1), wp.float64(amount))


@functools.cache
def make_count_unlanded(spec: Spec) -> wp.Function:
    """Book light that does not land; ``incident`` and ``transmitted`` are its fluxes."""
    channels = spec.channels
    over_lit = not spec.self_shadow

    @wp.func
    def count_unlanded(ledger: wp.array2d[wp.float64], bin: int, state: int, incident: float, transmitted: float):
        for c in range(wp.static(channels)):
            if state == UNLIT:
                # With shadows off, what lies behind a crest is lit by light that the crest has taken already.
                if wp.static(over_lit):
                    tally(ledger, OVER_LIT * wp.static(channels) + c, bin, -incident)
            elif state != DRY:
                tally(ledger, EMITTED * wp.static(channels) + c, bin, incident)
                if state == BLOCKED:
                    tally(ledger, SHADED * wp.static(channels) + c, bin, incident)
                elif state == LEFT:
                    tally(ledger, REFLECTED * wp.static(channels) + c, bin, incident - transmitted)
                    tally(ledger, LEFT_WATER * wp.static(channels) + c, bin, transmitted)
                else:
                    tally(ledger, DROPPED * wp.static(channels) + c, bin, incident)

    return count_unlanded


@functools.cache
def make_book_landed(spec: Spec) -> wp.Function:
    """Enter a landed cell into the ledger: what it took in, what it lost on the way, what fell outside the map."""
    flux_type = FLUX[spec.channels]
    channels = spec.channels

    @wp.func
    def book_landed(
        ledger: wp.array2d[wp.float64], bin: int, incident: float, transmitted: float, arrived: flux_type,
        inside: flux_type,
    ):  # fmt: skip
        for c in range(wp.static(channels)):
            tally(ledger, EMITTED * wp.static(channels) + c, bin, incident)
            tally(ledger, REFLECTED * wp.static(channels) + c, bin, incident - transmitted)
            tally(ledger, ABSORBED * wp.static(channels) + c, bin, transmitted - arrived[c])
            tally(ledger, OUTSIDE_MAP * wp.static(channels) + c, bin, arrived[c] - inside[c])

    return book_landed
