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


BIN_STEP = 31
"""Bins from a row to the next: no divisor of their count, so that the threads of a column do not share one."""


@wp.func
def tally(ledger: wp.array2d[wp.float64], row: int, bin: int, amount: float):
    """Add an amount to a row of the ledger."""
    if amount != 0.0:
        wp.atomic_add(ledger, row, bin & (wp.static(BINS) - 1), wp.float64(amount))


@wp.func
def bin_of(row: int, column: int) -> int:
    """The bin of a thread: neighbours, along a row as across rows, are in bins of their own."""
    return row * wp.static(BIN_STEP) + column


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


@functools.cache
def make_account(spec: Spec) -> type:
    """The type of a thread's own account of landed light: emitted, reflected, then absorbed and outside by channel.

    What this scene's light cannot suffer has no place in it.
    """
    slots = 1 + int(spec.fresnel) + spec.channels * (1 + int(spec.attenuation != "none"))
    return wp.types.vector(length=slots, dtype=wp.float64)


@functools.cache
def make_enter_landed(spec: Spec) -> wp.Function:
    """As :func:`make_book_landed`, into an account that a thread keeps in its registers; return the account."""
    account_type, flux_type = make_account(spec), FLUX[spec.channels]
    channels, fresnel, absorbs = spec.channels, spec.fresnel, spec.attenuation != "none"
    lost = 1 + int(fresnel)  # where the losses by channel begin

    @wp.func
    def enter_landed(
        account: account_type, incident: float, transmitted: float, arrived: flux_type, inside: flux_type
    ) -> account_type:
        account[0] += wp.float64(incident)
        if wp.static(fresnel):
            account[1] += wp.float64(incident - transmitted)
        for c in range(wp.static(channels)):
            account[wp.static(lost) + c] += wp.float64(arrived[c] - inside[c])
            if wp.static(absorbs):
                account[wp.static(lost + channels) + c] += wp.float64(transmitted - arrived[c])
        return account

    return enter_landed


@functools.cache
def make_close_account(spec: Spec) -> wp.Function:
    """Enter a thread's account into the ledger."""
    account_type = make_account(spec)
    channels, fresnel, absorbs = spec.channels, spec.fresnel, spec.attenuation != "none"
    lost = 1 + int(fresnel)

    @wp.func
    def post(ledger: wp.array2d[wp.float64], row: int, bin: int, amount: wp.float64):
        if amount != wp.float64(0.0):
            wp.atomic_add(ledger, row, bin & (wp.static(BINS) - 1), amount)

    @wp.func
    def close_account(ledger: wp.array2d[wp.float64], bin: int, account: account_type):
        for c in range(wp.static(channels)):
            post(ledger, EMITTED * wp.static(channels) + c, bin, account[0])
            if wp.static(fresnel):
                post(ledger, REFLECTED * wp.static(channels) + c, bin, account[1])
            post(ledger, OUTSIDE_MAP * wp.static(channels) + c, bin, account[wp.static(lost) + c])
            if wp.static(absorbs):
                post(ledger, ABSORBED * wp.static(channels) + c, bin, account[wp.static(lost + channels) + c])

    return close_account
